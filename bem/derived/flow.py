"""Flow of a thin fluid through the gap of a contact, by Reynolds' equation.

A fluid that does not slip flows by -g^3 grad P / (12 mu) through a gap g, and not at all where the
bodies touch. Every node is a cell. The flow between two cells is driven by the harmonic mean of
their g^3; the flow through a side of the patch by the half cell next to it. A patch that repeats
itself is driven by the same mean gradient in every period, and leaks to all sides. Other patches
are between two reservoirs, one at each end of the axis, and closed along the axis.

Gaps span many decades, and their cubes three times as many. With one unknown pressure for each
cell, the flow out of a wide pocket behind a narrow throat would be lost to rounding: it is the
small difference of two nearly equal pressures, times a large conductance. The unknowns are
therefore pressures of a hierarchy. At a threshold, cells with wider gaps form pockets; the next,
lower threshold joins them to larger pockets. The widest cell of a pocket carries the pressure of
the whole pocket, and the other cells' unknowns count from it. No entry of the equations is then a
difference of larger numbers, and one factor solves them to rounding.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from bem.arrays import Field, Mask, Nodes, Values
from bem.derived.spots import regions
from bem.problem import OutOfRange

# Ratio of the thresholds of gaps from one level of pockets to the next [1]. Its cube, 6 decades of
# conductance, costs as many digits of the factor. Refinement gives them back to the flow; the field
# of flux keeps 10 digits, and would keep 7 with a ratio of 1e-3.
STEP = 1e-2

# Ratio to the widest gap below which a gap is closed [1].
CLOSED = 1e-50

# Bounds of the widest gap [um]: double precision holds its cube.
WIDEST = 1e-90, 1e90

# Number of solutions with the factor: after the first, each one corrects the result so far.
SOLUTIONS = 2

# Largest relative change of the flow by the last solution that is accepted [1].
RTOL = 1e-9


@dataclass(frozen=True, eq=False)
class Flow:
    """Flow through a gap along one axis.

    Attributes
    ----------
    factor : float
        Flow over that between parallel plates at the mean gap; 0 if nothing flows [1].
    aperture : float
        Hydraulic aperture h, the distance of parallel plates with the same flow; 0 if nothing
        flows. The flow is W h^3 dP / (12 mu L) through a patch of width W and length L [um].
    flux : ndarray, shape (2, nx, ny)
        Flow per width at each node, along x and y, times 12 mu L / dP. Its mean along the axis is
        the cube of the aperture [um^3].
    """

    factor: float
    aperture: float
    flux: Field

    def __post_init__(self) -> None:
        """Make the field of flux read-only."""
        self.flux.setflags(write=False)


@dataclass(frozen=True, eq=False)
class _Levels:
    """Pockets of all levels. Cells have numbers from 0; both reservoirs have the next number.

    Attributes
    ----------
    members : ndarray of int, shape (m,)
        Cells, each once for itself and once for every level that joins it to another pocket.
    pockets : ndarray of int, shape (m,)
        Widest cell of the pocket that each of these is joined to.
    widest : ndarray of int, shape of the gap
        Widest cell of the region of open gap that holds each cell; the cell itself where the gap is
        closed.
    lift : ndarray, shape (k, shape of the gap)
        Pressure to begin with for each of k drives. It is uniform over each pocket that does not
        connect opposite sides [dP].
    flowing : ndarray of bool, shape of the gap
        Cells that belong to a region which connects opposite sides.
    """

    members: Nodes
    pockets: Nodes
    widest: Nodes
    lift: Field
    flowing: Mask


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """The unknown pressures, and how the pressures of the cells follow from them.

    Attributes
    ----------
    basis : csr_matrix, shape (cells + 1, unknowns)
        1 where an unknown is part of a cell's pressure. The last row, of the reservoirs, is empty.
    lone : int
        Number of unknowns, the last ones, of which each belongs to one cell alone. These cells have
        one colour of a chessboard, so that no two of them are neighbours.
    lift : ndarray, shape (cells + 1, k)
        Pressure of each cell to begin with [dP].
    flowing : ndarray of bool, shape (cells + 1,)
        Cells that belong to a region which connects opposite sides, and the reservoirs if any do.
    """

    basis: csr_matrix
    lone: int
    lift: Field
    flowing: Mask


@dataclass(frozen=True, eq=False)
class _Faces:
    """The f faces between cells through which something flows.

    Attributes
    ----------
    first : ndarray of int, shape (f,)
        Cell on one side. Both reservoirs have the number of all cells.
    second : ndarray of int, shape (f,)
        Cell on the other side, further along x or y.
    crossed_along_x : int
        Number of faces that a flow along x crosses. They come first; the remaining faces are
        crossed by a flow along y.
    root : ndarray, shape (f,)
        Square root of the conductance [reduced].
    drop : ndarray, shape (f, k)
        Drop of pressure that each of k drives imposes between the two cells, in addition to the
        difference of their pressures [dP].
    """

    first: Nodes
    second: Nodes
    crossed_along_x: int
    root: Values
    drop: Field


def flows_through(
    gap: Field, spacing: tuple[float, float], axes: Sequence[int], *, periodic: bool
) -> list[Flow]:
    """Compute the flow through a gap along one axis or several.

    The axes of a periodic patch share one factor of the equations.

    Parameters
    ----------
    gap : ndarray, shape (nx, ny)
        Distance between the bodies, 0 where they touch [um].
    spacing : tuple of float
        Lengths of a cell along x and y [um].
    axes : sequence of int
        0 for flow along x, 1 for flow along y.
    periodic : bool
        Whether the patch repeats itself.

    Returns
    -------
    list of Flow
        Flow factor, hydraulic aperture and field of flux along each of `axes`.

    Raises
    ------
    ValueError
        If an axis is neither 0 nor 1. OutOfRange, a ValueError, if the widest gap is outside
        `WIDEST`.
    ArithmeticError
        If the equations are not solved to `RTOL`.
    """
    if wrong := {*axes} - {0, 1}:
        raise ValueError(
            f"axis {wrong.pop()!r}: give 0 for flow along x, 1 for flow along y"
        )
    if periodic:
        along_both = _flows(gap, spacing, periodic=True)
        return [along_both[axis] for axis in axes]
    flows = []
    for axis in axes:
        if axis == 0:
            flows += _flows(gap, spacing, periodic=False)
            continue
        (transposed,) = _flows(gap.T, spacing[::-1], periodic=False)
        flux = transposed.flux[::-1].transpose(0, 2, 1)
        flows.append(replace(transposed, flux=flux))
    return flows


def _flows(gap: Field, spacing: tuple[float, float], *, periodic: bool) -> list[Flow]:
    """Compute the flow along x, and for a patch that repeats itself also the flow along y."""
    drives = 2 if periodic else 1
    no_flow = Flow(factor=0.0, aperture=0.0, flux=np.zeros((2, *gap.shape)))
    nothing = [no_flow] * drives
    largest = float(gap.max())
    if not largest > 0:
        return nothing
    if not WIDEST[0] < largest < WIDEST[1]:
        low, high = WIDEST
        raise OutOfRange(
            f"widest gap = {largest:g} um: its flow needs {low:g} to {high:g} um"
        )
    reduced = np.where(gap > CLOSED * largest, gap / largest, 0.0)
    cells = np.arange(gap.size).reshape(gap.shape)
    if not periodic:  # a row of infinitely wide cells at both ends: the reservoirs
        cells = np.pad(cells, ((1, 1), (0, 0)), constant_values=gap.size)
        reduced = np.pad(reduced, ((1, 1), (0, 0)), constant_values=np.inf)
    unknowns = _unknowns(reduced, cells, periodic=periodic)
    if not unknowns.flowing.any():
        return nothing
    faces = _faces(reduced, cells, spacing, unknowns.flowing, periodic=periodic)
    drops = _solve_drops(faces, unknowns)
    return [
        _flow(gap, spacing, axis, faces=faces, drop=drops[:, axis])
        for axis in range(drives)
    ]


def _flow(
    gap: Field, spacing: tuple[float, float], axis: int, *, faces: _Faces, drop: Values
) -> Flow:
    """Return the flow along an axis from the (f,) drops that `_solve_drops` returns for it."""
    largest = float(gap.max())
    sides = gap.shape[0] * spacing[0], gap.shape[1] * spacing[1]
    length = sides[axis]
    width = sides[1 - axis]
    aperture_cubed = float(drop @ drop) * largest**3 * length / width
    # Half of the flow through a face belongs to the node on either side.
    through = faces.root * drop * (largest**3 * length / 2)
    flux = np.zeros((2, gap.size + 1))
    along_x = slice(0, faces.crossed_along_x)
    along_y = slice(faces.crossed_along_x, None)
    for component, crossed in enumerate((along_x, along_y)):
        for cells in (faces.first[crossed], faces.second[crossed]):
            flux[component] += np.bincount(cells, through[crossed], gap.size + 1)
    crossed_widths = np.array([[spacing[1]], [spacing[0]]])
    flux /= crossed_widths
    return Flow(
        factor=aperture_cubed / float(gap.mean()) ** 3,
        aperture=float(np.cbrt(aperture_cubed)),
        flux=flux[:, :-1].reshape(2, *gap.shape),
    )


def _unknowns(gap: Field, cells: Nodes, *, periodic: bool) -> _Unknowns:
    """Choose the unknown pressures of a gap.

    `gap` is relative to the widest one, and infinite in the rows of the reservoirs. `cells` has the
    number of each cell; in the rows of the reservoirs it is the number of all cells.
    """
    number = gap.size if periodic else int(cells[0, 0])
    levels = _levels(gap, cells, periodic=periodic)
    flowing = np.zeros(number + 1, dtype=bool)
    flowing[cells] = levels.flowing
    region = np.full(number + 1, number)
    region[cells] = levels.widest
    lift = np.zeros((number + 1, len(levels.lift)))
    lift[cells] = np.moveaxis(levels.lift, 0, -1)
    lift[number] = 0.0
    # In each region the pressures count from that of the widest cell, which is no unknown.
    kept = flowing[levels.members] & (region[levels.pockets] != levels.pockets)
    members = levels.members[kept]
    pockets = levels.pockets[kept]
    size = np.bincount(pockets, minlength=number)  # entries of each pocket
    red = (size == 1) & _red_cells(number, gap.shape[1], periodic=periodic)
    unknowns = _ordered_unknowns((size > 0) & ~red, red, columns=gap.shape[1])
    place = np.empty(number, dtype=np.intp)
    place[unknowns] = np.arange(unknowns.size)
    by_member = np.argsort(members, kind="stable")
    row_sizes = np.bincount(members, minlength=number + 1)
    row_starts = np.concatenate([[0], np.cumsum(row_sizes)])
    entries = np.ones(members.size), place[pockets[by_member]], row_starts
    basis = csr_matrix(entries, (number + 1, unknowns.size))
    return _Unknowns(
        basis=basis, lone=int(np.count_nonzero(red)), lift=lift, flowing=flowing
    )


def _levels(gap: Field, cells: Nodes, *, periodic: bool) -> _Levels:
    """Join cells to pockets, from the widest gaps to the narrowest; arguments as `_unknowns`."""
    drives = 2 if periodic else 1
    narrow_to_wide = np.argsort(gap, axis=None)
    cells_to_wide = cells.reshape(-1)[narrow_to_wide]
    narrowest = float(gap[gap > 0].min())
    lift = np.zeros((drives, *gap.shape))
    widest = cells
    members = [cells.reshape(-1)]
    pockets = [cells.reshape(-1)]
    threshold = STEP
    while True:
        is_last = threshold <= narrowest
        inside = gap > 0 if is_last else gap >= threshold
        level = regions(inside, periodic=periodic)
        crosses = level.crosses.T[:drives, level.labels]
        # A pressure of one for each patch, or for the pocket of the first reservoir.
        at_first = (level.labels == level.labels[0, 0])[np.newaxis]
        level_lift = level.offsets if periodic else at_first
        lift = np.where(inside & ~crosses, level_lift, lift)
        widest_of_region = np.zeros(len(level.crosses), dtype=np.intp)
        # The widest cell of a region is assigned last, and so is the one that is kept.
        widest_of_region[level.labels.reshape(-1)[narrow_to_wide]] = cells_to_wide
        pocket = np.where(inside, widest_of_region[level.labels], cells)
        is_joined = pocket != widest
        members.append(cells[is_joined])
        pockets.append(pocket[is_joined])
        widest = pocket
        if is_last:
            break
        threshold *= STEP
    flowing: Mask = crosses[0] | crosses[-1]
    return _Levels(
        members=np.concatenate(members),
        pockets=np.concatenate(pockets),
        widest=widest,
        lift=lift,
        flowing=flowing,
    )


def _red_cells(number: int, columns: int, *, periodic: bool) -> Mask:
    """Return the red cells of a chessboard, (number,), of which no two are neighbours.

    On a patch that repeats itself the first row and column have none, because they are neighbours
    of the last ones.
    """
    x, y = np.divmod(np.arange(number), columns)
    red: Mask = (x + y) % 2 == 1
    if periodic:
        red &= (x > 0) & (y > 0)
    return red


def _ordered_unknowns(black: Mask, red: Mask, *, columns: int) -> Nodes:
    """Return the cells that carry unknowns: first `black` from the rim inward, then `red`.

    In this order the factor of the equations has fewer entries.
    """
    x, y = np.divmod(np.arange(red.size), columns)
    to_rim = np.minimum(np.minimum(x, x[-1] - x), np.minimum(y, y[-1] - y))
    chosen = np.flatnonzero(black)
    inward = np.argsort(to_rim.astype(np.int16)[chosen], kind="stable")
    return np.append(chosen[inward], np.flatnonzero(red))


def _faces(
    gap: Field,
    cells: Nodes,
    spacing: tuple[float, float],
    flowing: Mask,
    *,
    periodic: bool,
) -> _Faces:
    """Return the faces between cells where something flows; arguments as `_unknowns`."""
    columns = gap.shape[1]
    if periodic:  # the first row and column follow the last ones
        cells_across = np.concatenate([cells, cells[:, :1]], axis=1)
        gap_across = np.concatenate([gap, gap[:, :1]], axis=1)
        cells_along = np.concatenate([cells, cells[:1]])
        gap_along = np.concatenate([gap, gap[:1]])
    else:  # nothing flows inside the reservoirs
        cells_across = cells[1:-1]
        gap_across = gap[1:-1]
        cells_along = cells
        gap_along = gap
    first = _joined(cells_along[:-1], cells_across[:, :-1])
    second = _joined(cells_along[1:], cells_across[:, 1:])
    first_gap = _joined(gap_along[:-1], gap_across[:, :-1])
    second_gap = _joined(gap_along[1:], gap_across[:, 1:])
    place = np.arange(first.size)
    along_x = place < cells_along.size - columns
    if periodic:  # the gradient is a step where one patch follows another
        last_row = along_x & (place >= cells_along.size - 2 * columns)
        last_column = ~along_x & ((place + 1) % columns == 0)
        driven = np.stack([last_row, last_column], axis=1)
    else:  # the first reservoir has the higher pressure
        driven = (place < columns)[:, np.newaxis]
    low = np.minimum(first_gap, second_gap)
    high = np.maximum(first_gap, second_gap)
    kept = (low > 0) & flowing[first] & flowing[second]
    along_x = along_x[kept]
    return _Faces(
        first=first[kept],
        second=second[kept],
        crossed_along_x=int(along_x.sum()),
        root=_conductance_roots(low[kept], high[kept], along_x, spacing[1] / spacing[0]),
        drop=driven[kept].astype(float),
    )


def _joined(along: NDArray[Any], across: NDArray[Any]) -> NDArray[Any]:
    """Return the flat values of the faces crossed along x, then those of the other faces."""
    return np.concatenate([along.reshape(-1), across.reshape(-1)])


def _conductance_roots(low: Values, high: Values, along_x: Mask, aspect: float) -> Values:
    """Return the root of each face's conductance, from the harmonic mean of the cubed gaps.

    `low` and `high` are the gaps on both sides. The cubes are never formed: they could underflow.
    """
    share = low / high
    shape = np.where(along_x, aspect, 1 / aspect)
    roots: Values = low * np.sqrt(2 * low * shape / (1 + share * share * share))
    return roots


def _solve_drops(faces: _Faces, unknowns: _Unknowns) -> Field:
    """Solve for the pressures; return drops at faces times the roots of conductances, (f, k).

    The sum of the squared results is the flow, and the pressures minimise it. Raises
    ArithmeticError if the last solution still changes the flow by more than `RTOL`.
    """
    root = faces.root
    lift = unknowns.lift
    rise = lift[faces.second] - lift[faces.first]
    drop: Field = root[:, np.newaxis] * (faces.drop - rise)
    if not unknowns.basis.shape[1]:  # the pressures to begin with are the solution
        return drop
    rises = _rises(faces, unknowns.basis)
    columns = rises.T.tocsr()
    kept = unknowns.basis.shape[1] - unknowns.lone
    products = columns @ rises[:, :kept]
    across = products[kept:]
    # The lone unknowns are eliminated; their own products with themselves are 1.
    schur_complement = products[:kept] - across.T.tocsr() @ across
    factor = splu(
        schur_complement.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        relax=1,
        panel_size=1,
        options={"SymmetricMode": True},
    )
    for _ in range(SOLUTIONS):
        flow_before = (drop**2).sum(axis=0)
        kept_side, lone_side = np.split(columns @ drop, [kept])
        pressures = factor.solve(kept_side - across.T @ lone_side)
        lone_pressures = lone_side - across @ pressures
        drop = drop - rises @ np.concatenate([pressures, lone_pressures])
    change = abs(flow_before - (drop**2).sum(axis=0))
    if not np.all(change <= RTOL * flow_before):
        raise ArithmeticError(f"flow through the gap: not solved to {RTOL:g}")
    return drop


def _rises(faces: _Faces, basis: csr_matrix) -> csr_matrix:
    """Return the rise at each face by each unknown, (f, unknowns), with columns of length one.

    A rise is multiplied by the root of the face's conductance.
    """
    count = faces.root.size
    ends = np.stack([faces.second, faces.first], axis=1)
    weights = np.stack([faces.root, -faces.root], axis=1)
    row_starts = np.arange(0, 2 * count + 1, 2)
    entries = weights.reshape(-1), ends.reshape(-1), row_starts
    rises: csr_matrix = csr_matrix(entries, (count, basis.shape[0])) @ basis
    rises.eliminate_zeros()
    squares = np.bincount(rises.indices, rises.data**2, basis.shape[1])
    rises.data /= np.sqrt(squares)[rises.indices]
    return rises
