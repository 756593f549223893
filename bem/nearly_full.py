"""Nearly full contact of a patch without edges: the few gaps are the unknowns.

With all gaps closed, a load leaves the pressure k of full contact, part of which is tension. Gaps
g >= 0 change it to K g + k >= 0, with the inverse K of the influence matrix, and leave no pressure
where they are open. No load is lost, because K g has no mean. K acts between neighbours above all:
it falls with the third power of the distance. So a sparse matrix of neighbours is solved with an
active set of its own, and a transform finds the little that is left of K g. It falls by a factor
of 10 to 100 from one transform to the next.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from scipy import fft

from bem.arrays import Field, Mask, Nodes, Real
from bem.few_gaps import Opened, open_few
from bem.iterate import Effort
from bem.spacing import Boundary
from bem.spectrum import inverse_filter, wave_numbers
from bem.whole_patch import Pressed, WholePatch

# Largest share of nodes under tension at full contact for which this takes less time than
# iterations on the contact.
FEW_GAPS = 0.02

# Nodes whose gaps may open: those of at most this share of the mean pressure, and at most this many
# nodes away from tension.
SMALL_PRESSURE, RINGS = 0.3, 2

# Cells that the neighbours of a node are away at most, and cells a side of the patch for which
# their coefficients are tabulated.
RADIUS, TABULATED = 3, 64

# Transforms at most, and the share of an error that the next solve on neighbours leaves.
TRANSFORMS, LEFT = 12, 0.03

# Sets of open gaps that such a solve tries, and steps of conjugate gradients on one of them.
SETS, STEPS = 12, 40

# Error of the pressure, over the largest pressure, that single precision leaves.
ROUNDING = 3e-7


def press_nearly_full(whole: WholePatch, full: Field, accuracy: float) -> Pressed | None:
    """Solve for the gaps of a contact that is nearly full.

    Parameters
    ----------
    whole : WholePatch
        The influence matrix under the load.
    full : ndarray, shape (nx, ny)
        Pressure of full contact under the load.
    accuracy : float
        Tension, or pressure on open gaps, that may be left.

    Returns
    -------
    Pressed or None
        The pressure with its residual in double precision; None if there are many gaps.
    """
    tension = full < 0
    if np.count_nonzero(tension) > FEW_GAPS * full.size:
        return None
    accuracy = max(accuracy, ROUNDING * float(full.max()))
    single = full.astype(np.float32)
    opened = open_few(whole, single, accuracy)
    if opened is None:
        opened = _open_by_neighbours(whole, single, tension, accuracy)
    pressure = np.maximum(full + opened.change, 0)
    pressure.reshape(-1)[opened.nodes] = 0
    return whole.press(pressure, Effort(convolutions=1 + opened.transforms))


def _open_by_neighbours(whole: WholePatch, full: Real, tension: Mask, accuracy: float) -> Opened:
    """Open gaps by solves on neighbours until a transform leaves no tension, or up to a bound."""
    gaps = _Gaps(whole, full)
    gaps.admit(tension)
    for _ in range(TRANSFORMS):
        if gaps.solve() <= accuracy:
            break
    return Opened(np.flatnonzero(gaps.opened), gaps.change, gaps.transforms)


class _Gaps:
    """The gaps of a contact, and the change of the pressure that they make.

    Attributes
    ----------
    opened : ndarray, shape (nx, ny)
        Gaps.
    change : ndarray, shape (nx, ny)
        Change of the pressure by the gaps, as the last transform found it.
    transforms : int
        Transforms so far.
    """

    def __init__(self, whole: WholePatch, full: Real) -> None:
        self._patch, self._full = whole.patch, full
        self._filter = inverse_filter(*whole.patch, "float32")
        self._small = np.float32(SMALL_PRESSURE * whole.load / full.size)
        self._admitted = np.zeros(full.shape, np.bool_)
        self.opened, self.change = (np.zeros(full.shape, np.float32) for _ in range(2))
        self.transforms = 0
        self._error = -float(full.min())

    def admit(self, tension: Mask) -> None:
        """Let gaps open at some nodes and at those nearby that carry little."""
        shape, boundary, aspect = self._patch
        near = widened(tension, boundary, RINGS)
        self._admitted |= near & (self._full + self.change < self._small)
        self._nodes = np.flatnonzero(self._admitted)
        self._matrix = neighbour_matrix(shape, boundary, aspect, self._nodes)
        self._sides = -self._full.reshape(-1)[self._nodes]

    def solve(self) -> float:
        """Solve on neighbours and transform; return the largest tension, or pressure on gaps."""
        values = self.opened.reshape(-1)[self._nodes]
        rest = self.change.reshape(-1)[self._nodes] - self._matrix @ values
        values = complementary(self._matrix, self._sides - rest, values, LEFT * self._error)
        self.opened.reshape(-1)[self._nodes] = values
        self._filter.field[:] = self.opened
        self._filter.transform()
        self.change[:] = self._filter.field
        self.transforms += 1
        pressure = self._full + self.change
        inside = pressure.reshape(-1)[self._nodes]
        wrong = max(float(np.abs(inside[values > 0]).max(initial=0)), -float(inside.min()))
        pressure.reshape(-1)[self._nodes] = 0
        tension = -float(pressure.min())
        if tension > wrong:
            self.admit(pressure < 0)
        self._error = max(wrong, tension)
        return self._error


def complementary(matrix: Any, sides: Real, values: Real, accuracy: float) -> Real:
    """Find x >= 0 with A x - b >= 0 and x (A x - b) = 0 by an active set.

    Parameters
    ----------
    matrix : csr_array, shape (m, m)
        The positive definite matrix A.
    sides : ndarray, shape (m,)
        The right side b.
    values : ndarray, shape (m,)
        A start.
    accuracy : float
        Largest residual accepted [unit of b].
    """
    residual = sides - matrix @ values
    chosen = (values > 0) | (residual > 0)
    for _ in range(SETS):
        values = _solve_on(chosen, matrix, sides, np.where(chosen, values, 0), accuracy)
        residual = sides - matrix @ values
        following = np.where(chosen, values > 0, residual > 0)
        values = np.maximum(values, 0)
        settled = np.array_equal(following, chosen)
        chosen = following
        if settled and np.abs(residual[chosen]).max(initial=0) <= accuracy:
            break
    return values


def _solve_on(chosen: Mask, matrix: Any, sides: Real, values: Real, accuracy: float) -> Real:
    """Solve A x = b loosely on a set by conjugate gradients, with zero elsewhere."""
    mask = chosen.astype(np.float32)
    residual = mask * (sides - matrix @ values)
    direction, last, goal = np.zeros_like(values), np.inf, 0.0
    for _ in range(STEPS):
        largest = max(float(residual.max()), -float(residual.min()))
        goal = goal or max(LEFT * largest, accuracy / 2)
        if largest <= goal:
            break
        product = float(np.einsum("i,i->", residual, residual))
        direction *= np.float32(product / last)
        direction += residual
        last = product
        image = mask * (matrix @ direction)
        stiffness = float(np.einsum("i,i->", direction, image))
        if not stiffness > 0:  # only rounding is left
            break
        length = np.float32(product / stiffness)
        values += length * direction
        residual -= length * image
    return values


def neighbour_matrix(
    shape: tuple[int, int], boundary: Boundary, aspect: float, nodes: Nodes
) -> Any:
    """Return K between neighbours among some nodes, a sparse array (m, m)."""
    from scipy import sparse  # takes long to load, and most commands never need it

    rows, columns, coefficients = _neighbours(aspect)
    numbers = np.full(shape, -1, np.int32)
    numbers.reshape(-1)[nodes] = np.arange(len(nodes), dtype=np.int32)
    padded = _continued(numbers, boundary, RADIUS)
    width = padded.shape[1]
    here = nodes + (width - shape[1]) * (nodes // shape[1]) + RADIUS * (width + 1)
    neighbours = padded.reshape(-1).take(np.add.outer(here, rows * width + columns), mode="clip")
    known = neighbours >= 0
    starts = np.zeros(len(nodes) + 1, np.int32)
    np.cumsum(np.count_nonzero(known, axis=1), out=starts[1:])
    entries = np.broadcast_to(coefficients, known.shape)[known]
    return sparse.csr_array((entries, neighbours[known], starts), shape=(len(nodes),) * 2)


@lru_cache(maxsize=8)
def _neighbours(aspect: float) -> tuple[Nodes, Nodes, Real]:
    """Tabulate the rows, columns and coefficients of a node's neighbours, itself included."""
    numbers = wave_numbers((TABULATED, TABULATED), "periodic", aspect)
    table = fft.irfft2(numbers / 2, s=(TABULATED, TABULATED))
    rows, columns = np.mgrid[-RADIUS : RADIUS + 1, -RADIUS : RADIUS + 1].reshape(2, -1)
    near = np.hypot(rows, columns) <= RADIUS
    rows, columns = rows[near], columns[near]
    return rows, columns, table[rows, columns].astype(np.float32)


def widened(marked: Mask, boundary: Boundary, rings: int) -> Mask:
    """Return some nodes of a patch and those in a number of rings around them."""
    wide: Mask = _continued(marked, boundary, rings)
    shape = marked.shape
    for axis in (0, 1):
        size, wide = shape[axis], np.moveaxis(wide, axis, 0)
        ored = wide[:size].copy()
        for ring in range(1, 2 * rings + 1):
            ored |= wide[ring : ring + size]
        wide = np.moveaxis(ored, 0, axis)
    return wide


def _continued(field: Any, boundary: Boundary, cells: int) -> Any:
    """Continue a patch past its borders by some cells."""
    mode = "wrap" if boundary == "periodic" else "symmetric"
    for axis in (0, 1):
        field = field.take(_places(field.shape[axis], cells, mode), axis=axis)
    return field


@lru_cache(maxsize=16)
def _places(nodes: int, cells: int, mode: Any) -> Nodes:
    """Return the nodes along an axis that continues past its ends."""
    return np.pad(np.arange(nodes), cells, mode=mode)
