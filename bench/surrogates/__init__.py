"""Studies of surrogates: where they hold, what they cost, and how long they take to answer."""
