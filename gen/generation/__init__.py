"""How a database comes to be: its plan, its samples, the run, and the check afterwards."""
