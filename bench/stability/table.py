"""The table of all cases."""

from bench.stability import input_cases, model_cases, shape_cases

CASES = (*input_cases.cases(), *shape_cases.cases(), *model_cases.cases())
"""Every case, family after family."""
