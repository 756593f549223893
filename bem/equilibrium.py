"""The solver's answer to a problem, in reduced units, and its way to the grid and from it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bem.half_space import HalfSpace
from bem.iterate import Iterate, Nodes
from bem.problem import Field, Problem


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """What the solver found.

    Attributes
    ----------
    pressure : (nx, ny) [length E* / first side of a cell]
    length : unit of reduced displacements [um]
    delta : far-field displacement Delta [um]
    approach : displacement of the far field in all [um]
    iterate : the solver's last state, in units of `length`
    converged : whether that is the solution
    displacement : (nx, ny) of the half-space under that pressure, nan where nobody asked for it,
        or None [length]
    """

    pressure: Field
    length: float
    delta: float
    approach: float
    iterate: Iterate
    converged: bool
    displacement: Field | None = None


class Start(NamedTuple):
    """What to begin with, near the solution.

    Attributes
    ----------
    pressure : (nx, ny) [E*]
    moved : (nx, ny) displacement under that pressure, nan where unknown, or None: spares a
        convolution [um]
    approach : displacement of the far field in all; a given one takes its place [um]
    """

    pressure: Field
    moved: Field | None = None
    approach: float | None = None


class NoSolution(ValueError):
    """A compliant far field at or beyond Delta*, where the force has no bound."""

    def __init__(self, delta: float, critical: float) -> None:
        self.delta = delta
        self.critical_delta = critical
        super().__init__(
            f"delta = {delta:g} um has no equilibrium on a compliant far field: on this surface"
            f" it must stay below Delta* = {critical:.10g} um"
        )


def overlap(problem: Problem, delta: float) -> tuple[tuple[slice, slice], Nodes, Field]:
    """The box of all nodes that may touch, these nodes in it, their interference over Delta."""
    shape = problem.heights.shape
    below = problem.heights - problem.heights.max()
    nodes = np.flatnonzero(below > -delta)
    rows = nodes // shape[1]
    columns = nodes - shape[1] * rows
    box = (
        _span(int(rows[0]), int(rows[-1]), shape[0]),
        _span(int(columns.min()), int(columns.max()), shape[1]),
    )
    rows -= box[0].start
    columns -= box[1].start
    interference = (below.reshape(-1)[nodes] + delta) / delta  # above 0, as below > -delta is
    return box, rows * (box[1].stop - box[1].start) + columns, interference


def started(
    operators: HalfSpace, interference: Field, pressure: Field, displaced: Field | None = None
) -> Iterate:
    """A pressure to start from, with its residual: one convolution, or none if it is known."""
    if displaced is not None and np.isfinite(displaced).all():
        return Iterate(pressure, interference - displaced)
    everywhere = np.arange(len(pressure))
    with np.errstate(over="ignore", invalid="ignore"):  # too far to start from, and seen to be
        residual = interference - operators.displace_some(everywhere, pressure)
    return Iterate(pressure, residual, convolutions=1)


def unfold(
    problem: Problem,
    delta: float,
    box: tuple[slice, slice],
    nodes: Nodes,
    iterate: Iterate,
    converged: bool = True,
    displaced: Field | None = None,
) -> Equilibrium:
    """Put the pressure on some nodes of a box, and the box's displacement, back on the grid."""
    reduced = np.zeros(problem.heights.shape)
    values = np.zeros(reduced[box].shape)
    values.reshape(-1)[nodes] = iterate.pressure
    reduced[box] = values
    displacement = None
    if displaced is not None:
        displacement = np.full(reduced.shape, np.nan)
        displacement[box] = displaced
    return Equilibrium(reduced, delta, delta, delta, iterate, converged, displacement)


def _span(first: int, last: int, size: int) -> slice:
    """From first to last, widened to 1 + (4, 5, 6, 7) 2^j nodes inside the grid: plans recur."""
    unit = 2 ** max((last - first).bit_length() - 3, 0)
    nodes = -(-(last - first) // unit) * unit + 1
    if nodes >= size:
        return slice(0, size)
    start = min(first, size - nodes)
    return slice(start, start + nodes)
