"""The area of contact in the continuum: the count of nodes, less what the grid adds along borders.

A node touches as soon as its own height does, so that a count of nodes reaches beyond the border of
contact. How far follows from one local problem: a straight border, whose pressure rises like the
root of the distance and whose gap rises like its power 3/2, on a grid of the spacing h. For the
nodes' compliance K(q) at the wave vector q (2 / |q| in the continuum, E* = 1), factorising it along
the normal n (Wiener and Hopf) gives the mean distance over all places of the border in a cell,

    offset / h = 1 / (2 pi) * integral over q of ln(K(q n) |q| / 2) / q^2,

0.190 along the grid, 0.114 to 0.13 at most angles and 0.134 along the diagonal for spectral
compliance; 0.175, 0.101 to 0.12 and 0.121 for uniform pressure on cells. Over all directions that
is 0.1014 and 0.0904 for each cell's edge between contact and gap.

The nodes next to the border tell more. The same factors give its place between a node in contact,
with the pressure p, and the next one, with the gap g: both are known multiples of their distances
to it, so that the share f = g / (g + kappa p h / E*) tells the place, with kappa the geometric mean
of K along the axis. Each edge of a cell hence counts by weights for one, for f, and for the ratios
p / (p + p2) and g / (g + g2) with the nodes behind, which take off what curved borders and narrow
spots do to f. All lengths are in spacings across the edge, so that oblong cells need nothing else.
"""

import math
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bem.arrays import Field, Values
from bem.problem import Boundary, Problem

# Weights of an edge for one, f, p / (p + p2) and g / (g + g2), by how many of the two edges beside
# it lie in line with it: least squares over 3,300 regular waves, Westergaard's at all angles and
# crossed ones, from 3 to 64 nodes long and 1 to 97 % in contact. The code up to commit b37066e has
# the fit (`python -m bench.border_weights`).
WEIGHTS = np.array(
    [
        [-0.079, 0.381, -0.076, 0.130],
        [-0.125, 0.500, -0.070, 0.165],
        [-0.227, 0.817, -0.136, 0.266],
    ]
)

# What uniform pressure on cells takes off the first weight: the difference of the two offsets above
# over the edges of borders along the diagonal, between, and along the grid.
UNIFORM_PRESSURE = np.array([0.0095, 0.0105, 0.0152])

# Geometric mean of a grid's compliance along an axis [spacing / E*].
COMPLIANCE = {"spectral": 2 * math.e / math.pi, "uniform-pressure": 1.7240}

# Means of the two ratios along straight borders: they stand in for nodes beyond a free patch.
USUAL_RATIOS = 0.278, 0.200

# How many times the compliance of a yielded node weighs against its depth. A yielded border is
# where two surfaces cut each other, and an elastic one where p goes to zero: the edge of a yielded
# node counts as both in the ratio of its depth and its pressure.
YIELDED = 4.0

# A force at each node's centre, whose own displacement lacks a factor pi / 2, is a cell under
# uniform pressure and a layer of this compliance below it [spacing / E*]: the sum of the
# differences of all coefficients. Its offset is layer / 8 times the logarithm of the size of spots.
LAYER = -0.47629

# The offset of such forces for a spot of one spacing in radius, from Hertz's circle.
CONCENTRATED_FORCE = -0.115

# Radius of a circle over the ratio of its area to its perimeter along cells, 8 radii.
CIRCLE = 8 / math.pi


# How `numpy.pad` continues a field beyond a patch, and by how many nodes edges need it.
CONTINUED: dict[Boundary, Literal["edge", "wrap", "symmetric"]] = {
    "free": "edge",
    "periodic": "wrap",
    "mirror": "symmetric",
}
RIM = 2


def continuum_nodes(
    problem: Problem, pressure: Field, gap: Field, depth: Field | None
) -> float:
    """Return the area of contact in the continuum, in cells.

    Parameters
    ----------
    problem : Problem
        Boundary, kernel, spacing and modulus.
    pressure : ndarray, shape (nx, ny)
        Contact pressure [MPa].
    gap : ndarray, shape (nx, ny)
        Distance between the surfaces [um].
    depth : ndarray, shape (nx, ny), or None
        Depth by which nodes have yielded, None without a hardness [um].

    Returns
    -------
    float
        From 0 to nx ny [cells].
    """
    count = int(np.count_nonzero(pressure > 0))
    if count in (0, pressure.size):
        return float(count)
    offsets = list(_offsets(problem, pressure, gap, depth))
    if problem.boundary == "free" and problem.kernel == "concentrated-force":
        return _of_concentrated_forces(count, sum(map(len, offsets)))
    excess = sum(float(each.sum()) for each in offsets)
    # No area bears more than the hardness.
    least = 0.0 if problem.hardness is None else float(pressure.sum()) / problem.hardness
    return min(max(count - excess, least), float(pressure.size))


def _offsets(
    problem: Problem, pressure: Field, gap: Field, depth: Field | None
) -> Iterator[Values]:
    """Yield how far the border lies behind the edges, (e,), that face each of four ways [spacing].

    An edge is that of a cell between contact and gap. Its offset follows from the nodes on the line
    across it: the one in contact and the one behind it, the open one and the one beyond it.
    """
    free = problem.boundary == "free"
    compliance = COMPLIANCE["uniform-pressure" if free else "spectral"] / problem.modulus
    weights = WEIGHTS.copy()
    weights[:, 0] -= UNIFORM_PRESSURE * free
    continued, zeros = CONTINUED[problem.boundary], np.zeros(pressure.shape)
    fields: list[tuple[NDArray[Any], Any]] = [(pressure, continued), (gap, continued)]
    fields += [(zeros if depth is None else depth, "constant"), (zeros == 0, "constant")]
    pressures, gaps, depths, patch = (
        np.pad(one, RIM, mode).ravel() for one, mode in fields
    )
    contact = pressures > 0
    touching = np.flatnonzero(contact & patch)
    row = pressure.shape[1] + 2 * RIM
    for spacing, along, across in zip(problem.spacing, (row, 1), (1, row), strict=True):
        for step in (along, -along):
            here = touching[~contact[touching - step]]
            beside = np.array([here + across, here - across])
            aligned = np.count_nonzero(contact[beside] & ~contact[beside - step], axis=0)
            pressed, opened, yielded = pressures[here], gaps[here - step], depths[here]
            elastic = compliance * spacing * pressed
            terms = np.empty((len(here), 4))  # one, the share f and both ratios
            terms[:, 0] = 1.0
            terms[:, 1] = opened / (opened + elastic + yielded)
            terms[:, 2:] = USUAL_RATIOS
            both = pressed + pressures[here + step]
            np.divide(
                pressed, both, out=terms[:, 2], where=patch[here + step] | (not free)
            )
            both = opened + gaps[here - 2 * step]
            known = (patch[here - 2 * step] | (not free)) & (both > 0)
            np.divide(opened, both, out=terms[:, 3], where=known)
            offsets: Values = np.einsum("ij,ij->i", weights[aligned], terms)
            if yielded.any():
                cut = yielded / (yielded + YIELDED * elastic)
                offsets = (1 - cut) * offsets + cut * (terms[:, 1] - 0.5)
            yield offsets


def _of_concentrated_forces(count: int, edges: int) -> float:
    """Return the area under forces at the nodes, whose offset depends on the size of spots."""
    area = float(count)
    for _ in range(5):
        radius = CIRCLE * area / edges
        offset = CONCENTRATED_FORCE + LAYER / 8 * math.log(radius)
        area = max(count - offset * edges, 0.5)
    return area
