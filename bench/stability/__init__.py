"""Stiff and extreme cases of the solver, of surfaces and of models, each judged independently.

`case` says what a case is and runs the tables; the cases stand in the modules that it names.
"""
