"""Flow of a thin fluid through the gap of a contact, by Reynolds' equation.

A fluid that does not slip flows by -g^3 grad P / (12 mu) through a gap g, and not at all where the
bodies touch. Every node is a cell: the flow between two cells is driven by the harmonic mean of
their g^3, and that through the sides of the patch by the half of one cell. A patch that repeats
itself is driven by the same mean gradient in every period and leaks to all sides; others lie
between a reservoir on either side of the axis and are closed along it.

Gaps span many decades, their cubes three times as many. In plain unknowns the pressure of a wide
pocket behind a narrow throat is lost: its small difference from a pressure nearby, times a large
conductance, is the flow. So the pressures are those of a hierarchy. Nodes whose gaps lie above one
threshold after another form pockets, the next threshold joins them to larger ones; the widest node
of a pocket carries the pressure of the whole pocket, and all others count from it. No entry of the
equations is then a difference of larger numbers, and one factor solves them to rounding.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from bem.arrays import Field, Mask, Nodes, Values
from bem.derived.spots import regions
from bem.problem import OutOfRange

# Ratio of the thresholds of gaps from one level of pockets to the next: 6 decades of conductance
# cost as many digits of the factor. Refinement gives them back to the flow; the field of flux keeps
# 10 digits, and would keep 7 with a ratio of 1e-3.
STEP = 1e-2

# Gaps that are narrower by this factor than the widest one are closed.
CLOSED = 1e-50

# Widest gaps whose cubes double precision holds [um].
WIDEST = 1e-90, 1e90

# Solutions with the factor, each of what the ones before have left, and how far the last one may
# still change the flow.
SOLUTIONS = 2
RTOL = 1e-9


@dataclass(frozen=True, eq=False)
class Flow:
    """Flow through a gap along one axis.

    Attributes
    ----------
    factor : float
        Flow over that between parallel plates at the mean gap; 0 if nothing flows [1].
    aperture : float
        Hydraulic aperture: the distance of parallel plates with the same flow; 0 if nothing flows.
        The flow is W h^3 dP / (12 mu L) through a patch of the width W and the length L [um].
    flux : ndarray, shape (2, nx, ny)
        Flow per width at each node, along x and y, times 12 mu L / dP. Its mean along the axis is
        the cube of the aperture [um^3].
    """

    factor: float
    aperture: float
    flux: Field

    def __post_init__(self) -> None:
        """Keep the field from being written to."""
        self.flux.setflags(write=False)


@dataclass(frozen=True, eq=False)
class _Faces:
    """Faces between cells, each of shape (f,); what drives the flow along k axes."""

    first: Nodes  # cell on one side; the number of cells stands for both reservoirs
    second: Nodes  # cell on the other side, further along either axis
    crossed: int  # how many, the first ones, are crossed along x
    root: Values  # square root of the conductance [reduced]
    drop: Field  # pressure that is lost on the way, beside that of the cells, (f, k) [dP]


def flows_through(
    gap: Field, spacing: tuple[float, float], axes: Sequence[int], *, periodic: bool
) -> list[Flow]:
    """Compute the flow through a gap along axes; those of a periodic patch share their effort.

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
        Flow factor, hydraulic aperture and field of flux along each axis.

    Raises
    ------
    ValueError
        If an axis is neither 0 nor 1. OutOfRange, a ValueError, if the widest gap is beyond
        `WIDEST`.
    ArithmeticError
        If the equations are not solved to `RTOL`.
    """
    if wrong := {*axes} - {0, 1}:
        raise ValueError(
            f"axis {wrong.pop()!r}: give 0 for flow along x, 1 for flow along y"
        )
    if periodic:
        both = _flows(gap, spacing, periodic=True)
        return [both[axis] for axis in axes]
    flows = []
    for axis in axes:
        if axis == 0:
            flows += _flows(gap, spacing, periodic=False)
            continue
        (turned,) = _flows(gap.T, spacing[::-1], periodic=False)
        flows.append(replace(turned, flux=turned.flux[::-1].transpose(0, 2, 1)))
    return flows


def _flows(gap: Field, spacing: tuple[float, float], *, periodic: bool) -> list[Flow]:
    """Compute the flow along x; of a patch that repeats itself, also along y."""
    largest, (nx, ny), (dx, dy) = float(gap.max()), gap.shape, spacing
    nothing = [Flow(0.0, 0.0, np.zeros((2, nx, ny)))] * (1 + periodic)
    if not largest > 0:
        return nothing
    if not WIDEST[0] < largest < WIDEST[1]:
        low, high = WIDEST
        raise OutOfRange(
            f"widest gap = {largest:g} um: its flow needs {low:g} to {high:g} um"
        )
    reduced = np.where(gap > CLOSED * largest, gap / largest, 0.0)
    nodes = np.arange(gap.size).reshape(gap.shape)
    if not periodic:  # reservoirs, which are as wide as need be
        nodes = np.pad(nodes, ((1, 1), (0, 0)), constant_values=gap.size)
        reduced = np.pad(reduced, ((1, 1), (0, 0)), constant_values=np.inf)
    basis, lone, lift, flowing = _pockets(reduced, nodes, periodic=periodic)
    if not flowing.any():
        return nothing
    faces = _faces(reduced, nodes, spacing, flowing, periodic=periodic)
    lost = _solved(faces, basis, lone, lift)
    flows, sides = [], (nx * dx, ny * dy)
    for length, width, drop in zip(sides, sides[::-1], lost.T, strict=False):
        conducted = float(drop @ drop) * largest**3 * length / width
        through = faces.root * drop * (largest**3 * length / 2)
        flux = np.zeros((2, gap.size + 1))
        for component, chosen in enumerate(
            (slice(0, faces.crossed), slice(faces.crossed, None))
        ):
            for cells in (faces.first[chosen], faces.second[chosen]):
                flux[component] += np.bincount(cells, through[chosen], gap.size + 1)
        flux /= np.array([[dy], [dx]])
        factor, aperture = conducted / float(gap.mean()) ** 3, float(np.cbrt(conducted))
        flows.append(Flow(factor, aperture, flux[:, :-1].reshape(2, nx, ny)))
    return flows


def _pockets(
    gap: Field, nodes: Nodes, *, periodic: bool
) -> tuple[csr_matrix, int, Field, Mask]:
    """Find the pockets of all levels.

    Returns
    -------
    basis : csr_matrix, shape (cells + 1, unknowns)
        1 where an unknown is part of a cell's pressure; none is part of the last, the reservoirs'.
    lone : int
        How many unknowns, the last ones, are of one cell each, all of one colour of a chessboard.
    lift : ndarray, shape (cells + 1, k)
        Pressure to begin with, the same all over each pocket that nothing crosses [dP].
    flowing : ndarray of bool, shape (cells + 1,)
        Cells that opposite sides are connected by, and the reservoirs if there are any.
    """
    cells, drives = gap.size if periodic else int(nodes[0, 0]), 1 + periodic
    rising = np.argsort(gap, axis=None)
    lift = np.zeros((drives, *gap.shape))
    widest, rows, columns = nodes, [nodes.reshape(-1)], [nodes.reshape(-1)]
    threshold, least = STEP, float(gap[gap > 0].min())
    while True:
        last = threshold <= least
        inside = gap > 0 if last else gap >= threshold
        labels, crossing, patch = regions(inside, periodic=periodic)
        if not periodic:
            patch = (labels == labels[0, 0])[
                None
            ]  # joined to the reservoir at the higher pressure
        crosses = crossing.T[:drives, labels]
        lift = np.where(inside & ~crosses, patch, lift)
        roots = np.zeros(len(crossing), dtype=np.intp)
        roots[labels.reshape(-1)[rising]] = nodes.reshape(-1)[
            rising
        ]  # the widest of each is last
        now = np.where(inside, roots[labels], nodes)
        joined = now != widest
        rows.append(nodes[joined])
        columns.append(now[joined])
        widest = now
        if last:
            break
        threshold *= STEP
    whole, flowing = np.full(cells + 1, cells), np.zeros(cells + 1, dtype=bool)
    whole[nodes], flowing[nodes] = widest, crosses.any(axis=0)
    lifted = np.zeros((cells + 1, drives))
    lifted[nodes] = np.moveaxis(lift, 0, -1)
    lifted[cells], row, column = 0.0, np.concatenate(rows), np.concatenate(columns)
    wanted = flowing[row] & (
        whole[column] != column
    )  # one of each region is where it counts from
    row, column = row[wanted], column[wanted]
    order = np.argsort(row, kind="stable")
    members = np.bincount(column, minlength=cells)
    x, y = np.divmod(np.arange(cells), gap.shape[1])
    red = (members == 1) & ((x + y) % 2 == 1) & ((x > 0) & (y > 0) | (not periodic))
    inward = np.minimum(np.minimum(x, x[-1] - x), np.minimum(y, y[-1] - y)).astype(
        np.int16
    )
    others = np.flatnonzero(
        (members > 0) & ~red
    )  # from the rim inward the factor fills up less
    unknowns = np.append(
        others[np.argsort(inward[others], kind="stable")], np.flatnonzero(red)
    )
    number = np.empty(cells, dtype=np.intp)
    number[unknowns] = np.arange(unknowns.size)
    starts = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=cells + 1))])
    entries = np.ones(row.size), number[column[order]], starts
    basis = csr_matrix(entries, (cells + 1, unknowns.size))
    return basis, int(np.count_nonzero(red)), lifted, flowing


def _faces(
    gaps: Field,
    cells: Nodes,
    spacing: tuple[float, float],
    flowing: Mask,
    *,
    periodic: bool,
) -> _Faces:
    """Return the faces between cells where something flows."""
    line = gaps.shape[1]
    if periodic:
        nodes, gap = (
            np.concatenate([field, field[:, :1]], axis=1) for field in (cells, gaps)
        )
        cells, gaps = (np.concatenate([field, field[:1]]) for field in (cells, gaps))
    else:
        nodes, gap = cells[1:-1], gaps[1:-1]
    ratio = spacing[1] / spacing[0]
    first = np.concatenate([cells[:-1].reshape(-1), nodes[:, :-1].reshape(-1)])
    second = np.concatenate([cells[1:].reshape(-1), nodes[:, 1:].reshape(-1)])
    one = np.concatenate([gaps[:-1].reshape(-1), gap[:, :-1].reshape(-1)])
    other = np.concatenate([gaps[1:].reshape(-1), gap[:, 1:].reshape(-1)])
    place = np.arange(first.size)
    along = place < cells.size - line
    if periodic:
        last = (
            along & (place >= cells.size - 2 * line),
            ~along & ((place + 1) % line == 0),
        )
        driven = np.stack(last, axis=1)
    else:
        driven = (place < line)[:, None]
    low, high = np.minimum(one, other), np.maximum(one, other)
    kept = (low > 0) & flowing[first] & flowing[second]
    along, low, high = along[kept], low[kept], high[kept]
    share = low / high
    root = low * np.sqrt(
        2 * low * np.where(along, ratio, 1 / ratio) / (1 + share * share * share)
    )
    return _Faces(
        first[kept], second[kept], int(along.sum()), root, driven[kept].astype(float)
    )


def _solved(faces: _Faces, basis: csr_matrix, lone: int, lift: Field) -> Field:
    """Solve for the pressures; return drops at faces by the roots of their conductances, (f, k).

    The sum of their squares is the flow, and the least that pressures can make it.
    """
    count, root = faces.root.size, faces.root
    drop: Field = root[:, None] * (faces.drop - (lift[faces.second] - lift[faces.first]))
    if not basis.shape[1]:
        return drop
    ends, weights = (
        np.stack([faces.second, faces.first], axis=1),
        np.stack([root, -root], axis=1),
    )
    pairs = weights.reshape(-1), ends.reshape(-1), np.arange(0, 2 * count + 1, 2)
    rises = csr_matrix(pairs, (count, basis.shape[0])) @ basis
    rises.eliminate_zeros()
    squares = np.bincount(rises.indices, rises.data**2, basis.shape[1])
    rises.data /= np.sqrt(squares)[rises.indices]
    columns, kept = rises.T.tocsr(), basis.shape[1] - lone
    products = columns @ rises[:, :kept]
    across = products[kept:]  # the lone ones are eliminated: their own products are 1
    factor = splu(
        (products[:kept] - across.T.tocsr() @ across).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        relax=1,
        panel_size=1,
        options={"SymmetricMode": True},
    )
    for _ in range(SOLUTIONS):
        before = (drop**2).sum(axis=0)
        rest, low = np.split(columns @ drop, [kept])
        pressures = factor.solve(rest - across.T @ low)
        drop = drop - rises @ np.concatenate([pressures, low - across @ pressures])
    if not np.all(abs(before - (drop**2).sum(axis=0)) <= RTOL * before):
        raise ArithmeticError(f"flow through the gap: not solved to {RTOL:g}")
    return drop
