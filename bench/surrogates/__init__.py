"""Studies of surrogates: where they hold, their costs, and the times of their answers."""
