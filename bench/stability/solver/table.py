"""The table of all cases."""

from bench.stability.solver import input_cases, mechanics_cases, shape_cases

CASES = (*input_cases.cases(), *shape_cases.cases(), *mechanics_cases.cases())
"""Every case, family after family."""
