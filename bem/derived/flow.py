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
        For each entry of `members`, the widest cell of the pocket that the cell is joined to.
    widest : ndarray of int, shape of the gap
        Widest cell of the region of open gap that holds each cell; the cell itself where the gap is
        closed.
    lift : ndarray, shape (k, nx, ny)
        Initial pressure of each cell for a flow driven along each of k axes: x and y on a patch
        that repeats itself, else x alone. Each pocket that does not connect opposite sides has one
        initial pressure; in every period that the pocket enters it is one dP higher [dP].
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
        Number of unknowns that each belong to one cell alone; they are the last ones. Their cells
        have one colour of a chessboard, so that no two of them are neighbours.
    lift : ndarray, shape (cells + 1, k)
        Initial pressure of each cell for each of k drives, see `_Levels` [dP].
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
        Number of the cell on one side. The number of a reservoir is the count of all cells.
    second : ndarray of int, shape (f,)
        Number of the cell on the other side, further along x or y.
    crossed_along_x : int
        Number of faces that a flow along x crosses. They come first; the remaining faces are
        crossed by a flow along y.
    root : ndarray, shape (f,)
        Square root of the conductance, which is the mean of g^3 over both sides times width over
        distance. Gaps g are relative to the widest one [1].
    drop : ndarray, shape (f, k)
        Drop of pressure that each of k drives imposes between the two cells, in addition to the
        difference of their pressures: 1 or 0 [dP].
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
    """Compute the flow along x, and for a patch that repeats itself also the flow along y.

    Return one `Flow` for each of these axes. Gaps below `CLOSED` of the widest one are closed.
    Raises OutOfRange and ArithmeticError as `flows_through`.
    """
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
    weighted_drops = _solve_drops(faces, unknowns)
    return [
        _flow(gap, spacing, axis, faces=faces, weighted_drop=weighted_drops[:, axis])
        for axis in range(drives)
    ]


def _flow(
    gap: Field,
    spacing: tuple[float, float],
    axis: int,
    *,
    faces: _Faces,
    weighted_drop: Values,
) -> Flow:
    """Return the flow along an axis from the drop of pressure at each of the f faces.

    `weighted_drop`, (f,), is the drop [dP] times the square root of the face's conductance. The sum
    of its squares is the conductance of the patch.
    """
    largest = float(gap.max())
    sides = gap.shape[0] * spacing[0], gap.shape[1] * spacing[1]
    length = sides[axis]
    width = sides[1 - axis]
    conductance = float(weighted_drop @ weighted_drop)
    aperture_cubed = conductance * largest**3 * length / width
    # Half of the flow through a face belongs to the node on either side.
    through = faces.root * weighted_drop * (largest**3 * length / 2)
    flux = np.zeros((2, gap.size + 1))  # the last column, of the reservoirs, is dropped
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

    `gap` is relative to the widest one. `cells` has the number of each cell. Unless `periodic`,
    both have a first and a last row for the reservoirs, in which the gap is infinite and the number
    is the count of all cells.
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
    # An unknown is named by the widest cell of its pocket; a lone one has a pocket of one entry.
    size = np.bincount(pockets, minlength=number)  # entries of each pocket
    red = (size == 1) & _red_cells(number, gap.shape[1], periodic=periodic)
    unknowns = _ordered_unknowns((size > 0) & ~red, red, columns=gap.shape[1])
    place = np.empty(number, dtype=np.intp)  # column of each unknown in the basis
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
    """Join cells to pockets, level by level from the widest gaps to the narrowest.

    The arguments have the forms of those of `_unknowns`.
    """
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
        # One dP for each period, or for the pocket that holds the first reservoir.
        at_first = (level.labels == level.labels[0, 0])[np.newaxis]
        level_lift = level.offsets if periodic else at_first
        # In a region that connects opposite sides, the smaller pockets keep their lift.
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
    """Return whether each of `number` cells is red, (number,), so that no red ones are neighbours.

    Red is one colour of a chessboard. On a patch that repeats itself the first row and column have
    no red cells, because they are neighbours of the last row and column.
    """
    x, y = np.divmod(np.arange(number), columns)
    red: Mask = (x + y) % 2 == 1
    if periodic:
        red &= (x > 0) & (y > 0)
    return red


def _ordered_unknowns(black: Mask, red: Mask, *, columns: int) -> Nodes:
    """Return the numbers of the cells that carry unknowns, in the order of the unknowns.

    The cells of the mask `black` come first, from the rim of the patch inward, then those of the
    mask `red`. In this order the factor of the equations has fewer entries.
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
    """Return the faces between two open cells of regions that connect opposite sides.

    `gap` and `cells` have the forms of the arguments of `_unknowns`; `flowing` is that of
    `_Unknowns`. Faces that a flow along x crosses come before those that a flow along y crosses.
    """
    columns = gap.shape[1]
    # Neighbours along x are in successive rows of `cells_x`, neighbours along y in successive
    # columns of `cells_y`.
    if periodic:  # the last row and column are followed by the first ones
        cells_x = np.concatenate([cells, cells[:1]])
        gap_x = np.concatenate([gap, gap[:1]])
        cells_y = np.concatenate([cells, cells[:, :1]], axis=1)
        gap_y = np.concatenate([gap, gap[:, :1]], axis=1)
    else:  # the reservoirs' rows have no flow along y
        cells_x = cells
        gap_x = gap
        cells_y = cells[1:-1]
        gap_y = gap[1:-1]
    first = _flat_faces(cells_x[:-1], cells_y[:, :-1])
    second = _flat_faces(cells_x[1:], cells_y[:, 1:])
    first_gap = _flat_faces(gap_x[:-1], gap_y[:, :-1])
    second_gap = _flat_faces(gap_x[1:], gap_y[:, 1:])
    number_along_x = cells_x.size - columns
    index = np.arange(first.size)
    crossed_along_x = index < number_along_x
    if periodic:  # each period begins with a drop of one
        into_next_row = crossed_along_x & (index >= number_along_x - columns)
        into_next_column = ~crossed_along_x & ((index + 1) % columns == 0)
        has_drop = np.stack([into_next_row, into_next_column], axis=1)
    else:  # the drop between the first reservoir and the first row
        has_drop = (index < columns)[:, np.newaxis]
    low = np.minimum(first_gap, second_gap)
    high = np.maximum(first_gap, second_gap)
    kept = (low > 0) & flowing[first] & flowing[second]
    crossed_along_x = crossed_along_x[kept]
    aspect = spacing[1] / spacing[0]
    return _Faces(
        first=first[kept],
        second=second[kept],
        crossed_along_x=int(crossed_along_x.sum()),
        root=_conductance_roots(low[kept], high[kept], crossed_along_x, aspect),
        drop=has_drop[kept].astype(float),
    )


def _flat_faces(along_x: NDArray[Any], along_y: NDArray[Any]) -> NDArray[Any]:
    """Return the values of all faces as a flat array.

    `along_x` has those of the faces that a flow along x crosses, which come first; `along_y` those
    that a flow along y crosses.
    """
    return np.concatenate([along_x.reshape(-1), along_y.reshape(-1)])


def _conductance_roots(
    low: Values, high: Values, crossed_along_x: Mask, aspect: float
) -> Values:
    """Return the square root of each face's conductance, from the harmonic mean of the cubed gaps.

    `low` and `high`, (f,), are the narrower and the wider gap on both sides of a face. The cubes of
    gaps are never formed, because they could underflow. `aspect` is a cell's length along y over
    its length along x.
    """
    ratio = low / high
    width_over_distance = np.where(crossed_along_x, aspect, 1 / aspect)
    roots: Values = low * np.sqrt(
        2 * low * width_over_distance / (1 + ratio * ratio * ratio)
    )
    return roots


def _solve_drops(faces: _Faces, unknowns: _Unknowns) -> Field:
    """Solve for the pressures; return each face's drop times the root of its conductance, (f, k).

    The pressures minimise the sum of the squared results, which is the flow. The method is linear
    least squares by the normal equations A^T A x = A^T d: A are the rises of the faces for each
    unknown, d the drops. The lone unknowns are eliminated, the Schur complement of the others is
    factorised, and `SOLUTIONS` solves refine the result. Raises ArithmeticError if the last solve
    still changes a flow by more than `RTOL`.
    """
    lift = unknowns.lift
    initial_rise = lift[faces.second] - lift[faces.first]
    weighted_drop: Field = faces.root[:, np.newaxis] * (faces.drop - initial_rise)
    count = unknowns.basis.shape[1]
    if not count:  # the initial pressures are the solution
        return weighted_drop
    rises = _rises(faces, unknowns.basis)
    transposed = rises.T.tocsr()
    joined = count - unknowns.lone  # number of the unknowns that are not lone
    normal_columns = transposed @ rises[:, :joined]
    lone_by_joined = normal_columns[joined:]
    # The block of the lone unknowns is the identity: no two have a face in common, and the columns
    # of A have length one.
    schur_complement = normal_columns[:joined] - lone_by_joined.T.tocsr() @ lone_by_joined
    factor = splu(
        schur_complement.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        relax=1,
        panel_size=1,
        options={"SymmetricMode": True},
    )
    for _ in range(SOLUTIONS):
        flow_before = (weighted_drop**2).sum(axis=0)
        joined_side, lone_side = np.split(transposed @ weighted_drop, [joined])
        joined_solution = factor.solve(joined_side - lone_by_joined.T @ lone_side)
        lone_solution = lone_side - lone_by_joined @ joined_solution
        solution = np.concatenate([joined_solution, lone_solution])
        weighted_drop = weighted_drop - rises @ solution
    change = abs(flow_before - (weighted_drop**2).sum(axis=0))
    if not np.all(change <= RTOL * flow_before):  # also where it is nan
        raise ArithmeticError(f"flow through the gap: not solved to {RTOL:g}")
    return weighted_drop


def _rises(faces: _Faces, basis: csr_matrix) -> csr_matrix:
    """Return the rise of pressure at each face by each unknown, (f, unknowns).

    A rise is multiplied by the root of the face's conductance. Each column is then scaled to length
    one, so that the unknowns are multiples of pressures.
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
