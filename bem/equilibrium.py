"""The equilibrium of a problem in reduced units, and the nodes of the grid that it is solved on."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bem.arrays import Field, Mask, Nodes, Values
from bem.half_space import HalfSpace
from bem.iterate import CONVOLUTION, Iterate
from bem.problem import NoSolution, Problem
from bem.vectors import take


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The solver's result for a whole grid.

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure [length E* / first side of a cell].
    length : float
        Unit of reduced displacements [um].
    delta : float
        Far-field displacement Delta [um].
    approach : float
        Total displacement of the far field [um].
    iterate : Iterate
        Last state of the solver, in units of `length`.
    converged : bool
        Whether that state is the solution.
    displacement : ndarray, shape (nx, ny), or None
        Displacement of the half-space under that pressure, nan outside the box that was solved;
        None if it was not asked for [length].
    """

    pressure: Field
    length: float
    delta: float
    approach: float
    iterate: Iterate
    converged: bool
    displacement: Field | None = None


class Start(NamedTuple):
    """A pressure near the solution, from which a solve begins.

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure [E*].
    displacement : ndarray, shape (nx, ny), or None
        Displacement under that pressure, nan where it is unknown; it saves a convolution [um].
    approach : float or None
        Total displacement of the far field; a given Delta takes precedence [um].
    """

    pressure: Field
    displacement: Field | None = None
    approach: float | None = None


class BeyondCriticalDelta(NoSolution):
    """A compliant far field at or beyond Delta*, where the force has no bound.

    Attributes
    ----------
    delta : float
        The far-field displacement asked for [um].
    critical_delta : float
        Delta* of the surface [um].
    """

    def __init__(self, delta: float, critical: float) -> None:
        self.delta = delta
        self.critical_delta = critical
        super().__init__(
            f"delta = {delta:g} um has no equilibrium on a compliant far field: on this surface"
            f" it must stay below Delta* = {critical:.10g} um"
        )


class Overlap(NamedTuple):
    """The nodes that may touch at a displacement of the far field.

    Attributes
    ----------
    box : tuple of slice
        Rows and columns of a box that holds these nodes.
    nodes : ndarray, shape (m,)
        Flat indices of the nodes in the box.
    interference : ndarray, shape (m,)
        Overlap of the undeformed bodies [displacement of the far field].
    """

    box: tuple[slice, slice]
    nodes: Nodes
    interference: Values

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns of the box."""
        return self.box[0].stop - self.box[0].start, self.box[1].stop - self.box[1].start

    def select(self, field: Field) -> Values:
        """Return the values of an (nx, ny) field at the nodes."""
        return take(field[self.box].reshape(-1), self.nodes)


def overlap(problem: Problem, delta: float) -> Overlap:
    """Find the nodes that may touch at a displacement of the far field [um]."""
    below = problem.heights - problem.heights.max()
    box, nodes = boxed(below > -delta)
    interference = take(below[box].reshape(-1), nodes)
    interference += delta  # above 0, as below > -delta is
    interference /= delta
    return Overlap(box, nodes, interference)


def boxed(marked: Mask) -> tuple[tuple[slice, slice], Nodes]:
    """Find a small box that holds some nodes of a grid, with lengths that transforms reuse.

    Parameters
    ----------
    marked : ndarray of bool, shape (nx, ny)
        The nodes, at least one.

    Returns
    -------
    box : tuple of slice
        Rows and columns of the box.
    inside : ndarray, shape (m,)
        Flat indices of the nodes in the box, ascending.
    """
    rows, columns = (np.flatnonzero(marked.any(axis=axis)) for axis in (1, 0))
    box = (
        _span(int(rows[0]), int(rows[-1]), marked.shape[0]),
        _span(int(columns[0]), int(columns[-1]), marked.shape[1]),
    )
    return box, np.flatnonzero(marked[box])


def started(
    operators: HalfSpace, interference: Values, pressure: Values, displacement: Values | None = None
) -> Iterate:
    """Return an iterate with its residual, for one convolution unless the displacement is known."""
    if displacement is not None and np.isfinite(displacement).all():
        return Iterate(pressure, interference - displacement)
    with np.errstate(over="ignore", invalid="ignore"):  # the caller refuses starts that far away
        residual = interference - operators.displace_some(slice(None), pressure)
    return Iterate(pressure, residual, CONVOLUTION)


def unfold(
    problem: Problem,
    delta: float,
    touching: Overlap,
    iterate: Iterate,
    *,
    converged: bool = True,
    displacement: Field | None = None,
) -> Equilibrium:
    """Put the pressure on the nodes, and the displacement of their box, back on the grid."""
    reduced = np.zeros(problem.heights.shape)
    values = np.zeros(touching.shape)
    values.reshape(-1)[touching.nodes] = iterate.pressure
    reduced[touching.box] = values
    whole = None
    if displacement is not None:
        whole = np.full(reduced.shape, np.nan)
        whole[touching.box] = displacement
    return Equilibrium(
        pressure=reduced,
        length=delta,
        delta=delta,
        approach=delta,
        iterate=iterate,
        converged=converged,
        displacement=whole,
    )


def _span(first: int, last: int, size: int) -> slice:
    """Return a slice from first to last, widened to one of a few lengths to reuse FFT plans.

    The lengths are 1 + (4, 5, 6, 7) 2^j nodes, or all `size` nodes of the grid.
    """
    unit = 2 ** max((last - first).bit_length() - 3, 0)
    nodes = -(-(last - first) // unit) * unit + 1
    if nodes >= size:
        return slice(0, size)
    start = min(first, size - nodes)
    return slice(start, start + nodes)
