"""Stiff and extreme cases of the solver, of surfaces and of models, each judged independently."""
