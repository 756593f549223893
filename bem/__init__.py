"""Asperity's solver: contact of a rigid rough surface with an elastic half-space.

Arrays come in and arrays go out: no files, no MPI, nothing printed.
"""

from bem.contact import Contact, NotConverged, solve
from bem.ladder import ladder
from bem.problem import NoSolution, OutOfRange, Problem

__all__ = ["Contact", "NoSolution", "NotConverged", "OutOfRange", "Problem", "ladder", "solve"]
