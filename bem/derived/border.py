"""The area of contact in the continuum: the count of contact nodes, corrected along the border.

A node is in contact as soon as its own height touches. The cells of all contact nodes therefore
reach beyond the border of contact, by a mean distance that is called the offset. It follows from
one local problem: a straight border on a grid of spacing h, where the pressure rises with the
square root of the distance from the border, and the gap with its power 3/2. K(q) is the compliance
of the nodes for the wave vector q; in the continuum it is 2 / |q|, with E* = 1. Factorising K along
the border's normal n (Wiener and Hopf) gives the offset, averaged over all places of the border
within a cell:

    offset / h = 1 / (2 pi) * integral over q of ln(K(q n) |q| / 2) / q^2

The spectral compliance of patches without edges has an offset of 0.190 h for a border along the
grid, of 0.114 to 0.13 h at most angles, and of 0.134 h along the diagonal. Uniform pressure on
cells, the kernel of free patches, has 0.175 h, 0.101 to 0.12 h, and 0.121 h. Averaged over all
directions, and counted for each edge of a cell between contact and gap, the offsets are 0.1014 h
and 0.0904 h.

The nodes next to an edge locate the border more closely than this average. The same factors give
the distance of the border from a contact node, with the pressure p, and from the open node next to
it, with the gap g: p and g are known functions of these distances. The share
f = g / (g + kappa p h / E*), where kappa is the geometric mean of K along the axis, therefore tells
the place of the border between the two nodes. The ratios p / (p + p2) and g / (g + g2), with the
pressure p2 of the next node inside and the gap g2 of the next node outside, correct f for curved
borders and narrow spots. The offset of an edge is a weighted sum of one, f, and both ratios.
Lengths are in spacings across the edge.

The weights were fitted on square cells, where the number of neighbouring edges in line with an edge
tells the direction of the border. Oblong cells need no weights of their own, but the direction in
true lengths. Let r be the spacing across an edge over the spacing along it:

- Across the long side of the cells (r > 1), a border at 45 degrees has r edges in line. An edge
  therefore has a neighbour in line to the degree that the run of edges on that side reaches as far
  as r edges. A run that is shorter in all than r edges belongs to a border steeper than 45 degrees.
  Its slope is the length of the run over the spacing across. The border is located there by the
  edges of the other axis, and the offset of the edges of this run goes to zero with the slope. The
  gap and the pressure beside the edge belong to shorter distances from the border, so that kappa
  goes to zero with the root of the slope.
- Across the short side (r < 1), the next edge is so far off, in spacings across, that it tells
  little about the border here. As r goes to zero, each line of nodes is a problem of its own, the
  plane one, of which all edges are in line. An edge that has no neighbour in line therefore has
  1 - r of one.

For r = 1, both are the count of neighbours in line.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bem.arrays import Field, Mask, Nodes, Values
from bem.problem import Boundary, Problem

# Weights of the terms of an edge [spacing across the edge]. The columns belong to the terms one, f,
# p / (p + p2) and g / (g + g2); the row is the number of neighbouring edges, of the two beside an
# edge, that are in line with it. They are least squares over 3,300 regular waves, single ones
# (Westergaard's) at all angles and crossed ones, of 3 to 64 nodes a wave and with 1 to 97 % in
# contact. `asperity bench border-weights` fits them again.
WEIGHTS = np.array(
    [
        [-0.079, 0.381, -0.076, 0.130],
        [-0.125, 0.500, -0.070, 0.165],
        [-0.227, 0.817, -0.136, 0.266],
    ]
)

# Reduction of the first column of `WEIGHTS`, row by row, for uniform pressure on cells [spacing].
# It is the difference of the offsets of both kernels in the text of this module. The rows belong to
# edges of a border along the diagonal, between diagonal and grid, and along the grid.
UNIFORM_PRESSURE = np.array([0.0095, 0.0105, 0.0152])

# kappa: the geometric mean of a grid's compliance along an axis [spacing / E*].
COMPLIANCE = {"spectral": 2 * math.e / math.pi, "uniform-pressure": 1.7240}

# Means of p / (p + p2) and of g / (g + g2) along straight borders [1]. They replace a ratio if its
# second node is beyond the border of a free patch, or if both gaps are zero.
USUAL_RATIOS = 0.278, 0.200

# Factor on the elastic displacement of a node where it is weighed against the node's yielded depth
# [1]. The border of an elastic spot is where p goes to zero; that of a yielded spot is where
# the two undeformed surfaces cut each other. The offset of a yielded node's edge is a mean of both.
YIELDED = 4.0

# Compliance of the layer that turns the kernel of uniform pressure into that of concentrated forces
# [spacing / E*]. It is negative, because a concentrated force displaces its own node too little, by
# a factor pi / 2. It is the sum, over all nodes, of the differences of the two kernels'
# coefficients. The offset that it adds is layer / 8 times the logarithm of the radius of spots.
LAYER = -0.47629

# Offset of concentrated forces for a spot with a radius of one spacing, from Hertz's circle
# [spacing].
CONCENTRATED_FORCE = -0.115

# Ratio of a circle's radius to its area over its perimeter along the sides of cells, which is 8
# radii long [1].
CIRCLE = 8 / math.pi

# Number of repetitions of the fixed-point iteration for the radius of spots. Each one multiplies
# the error of the area by 0.06 edges / cells, which is 1/4 for single nodes, less for larger spots.
REPETITIONS = 5

# Modes of `numpy.pad` that continue a field beyond each kind of patch.
CONTINUED: dict[Boundary, Literal["edge", "wrap", "symmetric"]] = {
    "free": "edge",
    "periodic": "wrap",
    "mirror": "symmetric",
}

# Largest ratio of the sides of a cell for which edges in line are counted [1]. Cells that are more
# oblong are treated as cells of this ratio. Borders steep enough to tell the difference have next
# to no offset.
LARGEST_RATIO = 100.0

# Nodes by which fields are continued on each side: an edge needs the node next to it, and one more.
RIM = 2


@dataclass(frozen=True, eq=False)
class BorderEdges:
    """The edges of cells between contact and gap that face one of four ways; e is their number.

    Attributes
    ----------
    aligned : ndarray, shape (e,)
        Number of neighbouring edges in line with each edge, from 0 to 2. It is a whole number on
        square cells [1].
    slope : ndarray, shape (e,)
        Slope of the border where it is steeper than 45 degrees to edges across the long side of the
        cells: the length of the run of edges in line over the spacing across. Otherwise 1 [1].
    terms : ndarray, shape (e, 4)
        Terms that the weights multiply: one, f, p / (p + p2) and g / (g + g2) [1].
    yielded : ndarray, shape (e,), or None
        Weight, from 0 to 1, of the offset of a yielded border against that of an elastic one; None
        if no node has yielded [1].
    """

    aligned: Values
    slope: Values
    terms: Field
    yielded: Values | None

    def part(self, edges: slice) -> "BorderEdges":
        """Return some of the edges, whose arrays are views.

        Parameters
        ----------
        edges : slice
            Their places.

        Returns
        -------
        BorderEdges
            The edges.
        """
        yielded = None
        if self.yielded is not None:
            yielded = self.yielded[edges]
        return BorderEdges(
            aligned=self.aligned[edges],
            slope=self.slope[edges],
            terms=self.terms[edges],
            yielded=yielded,
        )

    def row_factors(self) -> Field:
        """Compute the factors of the rows of `WEIGHTS` in the offset of each edge.

        Weights are interpolated between two rows, and multiplied by the slope.

        Returns
        -------
        ndarray, shape (e, 3)
            Factors; their sum over the rows is the slope [1].
        """
        distances = np.abs(self.aligned[:, np.newaxis] - np.arange(len(WEIGHTS)))
        factors: Field = np.maximum(1 - distances, 0) * self.slope[:, np.newaxis]
        return factors


@dataclass(frozen=True, eq=False)
class _Directions:
    """Direction of the border at the edges that face one way; fields as in `BorderEdges`."""

    aligned: Values
    slope: Values


@dataclass(frozen=True, eq=False)
class _Continued:
    """Flat fields of a patch that is continued by `RIM` nodes on each side.

    Attributes
    ----------
    pressure : ndarray, shape (c,)
        Contact pressure [MPa].
    gap : ndarray, shape (c,)
        Distance between the surfaces [um].
    depth : ndarray, shape (c,)
        Yielded depth, zero beyond the patch [um].
    on_patch : ndarray of bool, shape (c,)
        Whether a node belongs to the patch itself.
    exists : ndarray of bool, shape (c,)
        Whether the body has a node here: everywhere unless the patch is free.
    """

    pressure: Values
    gap: Values
    depth: Values
    on_patch: Mask
    exists: Mask


def continuum_nodes(
    problem: Problem, pressure: Field, gap: Field, depth: Field | None
) -> float:
    """Return the area of contact in the continuum, in cells.

    Parameters
    ----------
    problem : Problem
        Boundary, kernel, spacing, modulus and hardness.
    pressure : ndarray, shape (nx, ny)
        Contact pressure [MPa].
    gap : ndarray, shape (nx, ny)
        Distance between the surfaces [um].
    depth : ndarray, shape (nx, ny), or None
        Depth by which nodes have yielded, None without a hardness [um].

    Returns
    -------
    float
        Area from 0 to nx ny, at least the force over the hardness [cells].
    """
    count = int(np.count_nonzero(pressure > 0))
    if count in (0, pressure.size):  # no contact or full contact has no border
        return float(count)
    weights = WEIGHTS.copy()
    if problem.boundary == "free":
        weights[:, 0] -= UNIFORM_PRESSURE
    edges, numbers = _all_edges(problem, pressure, gap, depth)
    if problem.boundary == "free" and problem.kernel == "concentrated-force":
        return _area_under_concentrated_forces(count, edges=sum(numbers))
    offsets = _offsets(edges, weights)
    excess = sum(float(offsets[part].sum()) for part in _parts(numbers))
    lower_bound = 0.0
    if problem.hardness is not None:  # no area bears more than the hardness
        lower_bound = float(pressure.sum()) / problem.hardness
    return min(max(count - excess, lower_bound), float(pressure.size))


def border_edges(
    problem: Problem, pressure: Field, gap: Field, depth: Field | None
) -> Iterator[BorderEdges]:
    """Yield the edges of cells between contact and gap, for each of the four ways they face.

    Parameters
    ----------
    problem : Problem
        Boundary, spacing and modulus.
    pressure : ndarray, shape (nx, ny)
        Contact pressure [MPa].
    gap : ndarray, shape (nx, ny)
        Distance between the surfaces [um].
    depth : ndarray, shape (nx, ny), or None
        Depth by which nodes have yielded, None without a hardness [um].

    Yields
    ------
    BorderEdges
        First the edges across the first axis that face its start, then those that face its end;
        then the edges across the second axis in the same order.
    """
    edges, numbers = _all_edges(problem, pressure, gap, depth)
    for part in _parts(numbers):
        yield edges.part(part)


def _parts(numbers: Iterable[int]) -> Iterator[slice]:
    """Yield the slices of consecutive parts with these numbers of items."""
    first = 0
    for number in numbers:
        yield slice(first, first + number)
        first += number


def _all_edges(
    problem: Problem, pressure: Field, gap: Field, depth: Field | None
) -> tuple[BorderEdges, list[int]]:
    """Return the edges that `border_edges` yields in one record, and their number for each way."""
    kernel = "uniform-pressure" if problem.boundary == "free" else "spectral"
    compliance = COMPLIANCE[kernel] / problem.modulus
    fields = _continued(problem.boundary, pressure, gap, depth)
    contact = fields.pressure > 0
    touching = np.flatnonzero(contact & fields.on_patch)
    row = pressure.shape[1] + 2 * RIM  # flat step along the first axis
    # The axis that edges are across, and the flat step from the open node to the contact node.
    ways = ((0, row), (0, -row), (1, 1), (1, -1))
    inner_of_ways: list[Nodes] = []
    directions_of_ways: list[_Directions] = []
    for axis, inward in ways:
        # Contact nodes with an edge this way.
        inner = touching[~contact[touching - inward]]
        spacing = problem.spacing[axis]
        ratio = spacing / problem.spacing[1 - axis]
        if ratio > 1:
            # The same nodes as `inner`, as a mask.
            facing = _on_patch(contact & ~np.roll(contact, inward), pressure.shape)
            directions = _by_runs(
                facing, axis, min(ratio, LARGEST_RATIO), problem.boundary
            )
        else:
            along_edge = 1 if axis == 0 else row  # flat step to the next edge in line
            neighbours = np.array([inner + along_edge, inner - along_edge])
            in_line = contact[neighbours] & ~contact[neighbours - inward]
            directions = _by_neighbours(in_line, ratio)
        inner_of_ways.append(inner)
        directions_of_ways.append(directions)
    # The edges of all ways are computed at once, which takes less time on small grids.
    numbers = [inner.size for inner in inner_of_ways]
    edges = _edges_between(
        fields,
        np.concatenate(inner_of_ways),
        np.repeat([inward for _, inward in ways], numbers),
        directions=_Directions(
            aligned=np.concatenate([way.aligned for way in directions_of_ways]),
            slope=np.concatenate([way.slope for way in directions_of_ways]),
        ),
        compliance=np.repeat(
            [compliance * problem.spacing[axis] for axis, _ in ways], numbers
        ),
    )
    return edges, numbers


def _on_patch(continued: Mask, shape: tuple[int, ...]) -> Mask:
    """Return the (nx, ny) part on the patch of a flat mask that is continued by `RIM` nodes."""
    nx, ny = shape
    square: Mask = continued.reshape(nx + 2 * RIM, ny + 2 * RIM)
    return square[RIM:-RIM, RIM:-RIM]


def _by_neighbours(in_line: Mask, ratio: float) -> _Directions:
    """Return the direction of the border at edges across the shorter side of the cells.

    `in_line`, (2, e), tells whether the neighbours of an edge on both sides are in line with it.
    `ratio` is the spacing across an edge over the spacing along it, at most 1. A neighbour that is
    not in line counts 1 - ratio.
    """
    edges = in_line.shape[1]
    aligned = 2 * (1 - ratio) + ratio * np.count_nonzero(in_line, axis=0)
    return _Directions(aligned=aligned, slope=np.ones(edges))


def _by_runs(facing: Mask, axis: int, ratio: float, boundary: Boundary) -> _Directions:
    """Return the direction of the border at edges across the longer side of the cells.

    `facing`, (nx, ny), tells which contact nodes have such an edge; edges are returned in the order
    of these nodes. The edges are across `axis`, and their runs go along the other axis. `ratio` is
    the spacing across an edge over the spacing along it, above 1.
    """
    reach = math.ceil(ratio)  # a longer run on one side makes no difference
    width = [(0, 0), (0, 0)]
    width[1 - axis] = reach, reach
    continued = np.pad(facing, width, CONTINUED[boundary])
    on_patch = np.pad(facing, width)
    places = np.flatnonzero(on_patch)
    step = 1 if axis == 0 else continued.shape[1]  # flat step to the next edge in line
    continued = continued.ravel()
    aligned = np.zeros(len(places))
    run = np.ones(len(places))  # the edge itself and those in line on both sides
    for side in (-step, step):
        in_line = np.zeros(len(places))
        unbroken = np.ones(len(places), dtype=bool)
        for distance in range(1, reach + 1):
            unbroken &= continued[places + distance * side]
            if not unbroken.any():
                break
            in_line += unbroken
        aligned += np.minimum(in_line / ratio, 1)
        run += in_line
    return _Directions(aligned=aligned, slope=np.minimum(run / ratio, 1))


def _continued(
    boundary: Boundary, pressure: Field, gap: Field, depth: Field | None
) -> _Continued:
    """Continue (nx, ny) fields by `RIM` nodes on each side, by the mode of the boundary.

    The depth is continued by zeros in any case; None is a depth of zero.
    """
    shape = [nodes + 2 * RIM for nodes in pressure.shape]
    on_patch = np.zeros(shape, dtype=bool)
    on_patch[RIM:-RIM, RIM:-RIM] = True
    exists = np.ones(shape, dtype=bool)
    if boundary == "free":
        exists = on_patch
    depths = np.zeros(shape)
    if depth is not None:
        depths[RIM:-RIM, RIM:-RIM] = depth
    return _Continued(
        pressure=with_rim(pressure, boundary, RIM).ravel(),
        gap=with_rim(gap, boundary, RIM).ravel(),
        depth=depths.ravel(),
        on_patch=on_patch.ravel(),
        exists=exists.ravel(),
    )


def with_rim(field: Field, boundary: Boundary, width: int) -> Field:
    """Continue a field by some nodes on each side, by the mode of the boundary in `CONTINUED`.

    It is what `numpy.pad` returns, in less time on small grids.

    Parameters
    ----------
    field : ndarray, shape (nx, ny)
        The field.
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.
    width : int
        Number of nodes on each side.

    Returns
    -------
    ndarray, shape (nx + 2 width, ny + 2 width)
        The continued field, a new array.
    """
    rows, columns = (_sources_of_rim(nodes, boundary, width) for nodes in field.shape)
    rim = [*range(width), *range(-width, 0)]
    continued = np.empty([nodes + 2 * width for nodes in field.shape])
    continued[width:-width, width:-width] = field
    continued[width:-width, rim] = field[:, columns]
    continued[rim] = continued[width + rows]
    return continued


def _sources_of_rim(nodes: int, boundary: Boundary, width: int) -> Nodes:
    """Return the nodes whose values continue an axis, (2 width,): before it, then after it."""
    places: Nodes = np.concatenate(
        [np.arange(-width, 0), np.arange(nodes, nodes + width)]
    )
    if boundary == "free":
        return np.clip(places, 0, nodes - 1)
    if boundary == "mirror":  # images repeat themselves after two sides
        places = places % (2 * nodes)
        return np.minimum(places, 2 * nodes - 1 - places)
    return places % nodes


def _edges_between(
    fields: _Continued,
    inner: Nodes,
    inward: Nodes,
    *,
    directions: _Directions,
    compliance: Values,
) -> BorderEdges:
    """Return the edges between contact nodes and the open nodes next to them.

    `inner`, (e,), has the flat indices of the contact nodes. `inward`, (e,), has the steps from the
    open nodes to them. `compliance`, (e,), is kappa h / E* of a border along the edges [um / MPa].
    """
    outer = inner - inward
    next_inner = inner + inward
    next_outer = outer - inward
    pressed = fields.pressure[inner]
    opened = fields.gap[outer]
    depth = fields.depth[inner]
    elastic = compliance * np.sqrt(directions.slope) * pressed
    terms = np.empty((len(inner), 4))
    terms[:, 0] = 1.0
    terms[:, 1] = opened / (opened + elastic + depth)
    terms[:, 2:] = USUAL_RATIOS
    pressures = pressed + fields.pressure[next_inner]
    np.divide(pressed, pressures, out=terms[:, 2], where=fields.exists[next_inner])
    gaps = opened + fields.gap[next_outer]
    np.divide(opened, gaps, out=terms[:, 3], where=fields.exists[next_outer] & (gaps > 0))
    yielded = None
    if depth.any():
        yielded = depth / (depth + YIELDED * elastic)
    return BorderEdges(
        aligned=directions.aligned,
        slope=directions.slope,
        terms=terms,
        yielded=yielded,
    )


def _offsets(edges: BorderEdges, weights: Field) -> Values:
    """Return the distance from each edge back to the border, (e,) [spacing across the edge].

    `weights` has the form of `WEIGHTS`, (3, 4), and is corrected for the kernel.
    """
    weights_of_edges = edges.row_factors() @ weights
    offsets: Values = np.einsum("ij,ij->i", weights_of_edges, edges.terms)
    if edges.yielded is None:
        return offsets
    # Two surfaces that cut each other have a gap and a depth in proportion to the distance.
    where_surfaces_cut = edges.terms[:, 1] - 0.5
    return (1 - edges.yielded) * offsets + edges.yielded * where_surfaces_cut


def _area_under_concentrated_forces(count: int, edges: int) -> float:
    """Return the area under forces at `count` nodes with this number of edges [cells].

    The offset depends on the radius of spots, which is estimated from the area and the edges. Area
    and radius follow from each other by a fixed-point iteration.
    """
    area = float(count)
    for _ in range(REPETITIONS):
        radius = CIRCLE * area / edges
        offset = CONCENTRATED_FORCE + LAYER / 8 * math.log(radius)
        area = max(count - offset * edges, 0.5)
    return area
