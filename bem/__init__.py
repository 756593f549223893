"""Asperity's solver: contact of a rigid rough surface with an elastic half-space or layer.

Arrays come in and arrays go out: no files, no MPI, nothing printed.
"""

from bem.accuracy import NotReachable, Surface, solve_within
from bem.bodies import Body, HalfSpace, Layered
from bem.budget import Budget
from bem.contact import Contact
from bem.derived.grid_error import GridError
from bem.derived.slip import PartialSlip, partial_slip
from bem.problem import NoSolution, OutOfRange, Problem
from bem.solving import NotConverged, ladder, solve
from bem.threads import keep_freed_memory

keep_freed_memory()

__all__ = [
    "Body",
    "Budget",
    "Contact",
    "GridError",
    "HalfSpace",
    "Layered",
    "NoSolution",
    "NotConverged",
    "NotReachable",
    "OutOfRange",
    "PartialSlip",
    "Problem",
    "Surface",
    "ladder",
    "partial_slip",
    "solve",
    "solve_within",
]
