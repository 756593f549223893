"""Signs at the border of contact of the errors that a grid makes there.

The border of contact is somewhere between the nodes. Four signs tell which answers its place
changes, and by how much:

- The share of the border: the edges of cells between contact and gap over the nodes in contact.
  Each edge adds about the same part of a cell to the error of an area.
- The scatter of the border. The places of the border at two edges are independent draws, so that
  their errors cancel in part. Where the border is straight along an axis, or repeats itself as that
  of regular waves does, all edges of a piece have the same place, and their errors add up. As a
  share of the open nodes it tells by how much the open area is off, and with it the mean gap.
- The work of the border: the pressures inside, times the gaps outside. Where the border is moved by
  a node, the load does about this work. Delta under a given force changes by the work over the
  force.
- The share of the outer nodes. At the edge of a free patch the pressure is singular, as at that of
  a punch. Cells of uniform pressure cannot follow it, by which all answers are off by a part of
  this share.
"""

import math
from dataclasses import dataclass

import numpy as np

from bem.arrays import Field, Mask, Values
from bem.derived.border import with_rim
from bem.problem import Boundary

# Relative difference of two heights, over the range of all heights, below which they are the same:
# the heights of regular waves repeat themselves but for rounding [1].
SAME_HEIGHT = 1e-8


@dataclass(frozen=True)
class BorderSigns:
    """Signs of the errors that a contact's answers have by its border; all zero without a border.

    Attributes
    ----------
    share : float
        Number of cells' edges between contact and gap over the number of nodes in contact [1].
    scatter : float
        This share over the square root of the number of independent pieces of the border [1].
    least_scatter : float
        This share over the square root of the number of edges, as if all were independent [1].
    work : float
        Sum over these edges of the pressure inside times the gap outside, over the sum of the
        pressures of all nodes [um].
    gap : float
        Mean gap outside of these edges [um].
    outer : float
        Share of the nodes in contact that are outer nodes of a free patch [1].
    """

    share: float = 0.0
    scatter: float = 0.0
    least_scatter: float = 0.0
    work: float = 0.0
    gap: float = 0.0
    outer: float = 0.0


def border_signs(
    pressure: Field, gap: Field, heights: Field, boundary: Boundary
) -> BorderSigns:
    """Return the signs of the errors that a contact's answers have by its border.

    Parameters
    ----------
    pressure : ndarray, shape (nx, ny)
        Contact pressure, zero outside of contact [MPa].
    gap : ndarray, shape (nx, ny)
        Distance between the deformed surfaces [um].
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.

    Returns
    -------
    BorderSigns
        The signs.
    """
    touching = pressure > 0
    nodes = int(np.count_nonzero(touching))
    if nodes == 0:
        return BorderSigns()
    outer = 0.0
    if boundary == "free":
        outer = _outer_nodes(touching) / nodes
    # Beyond a border a patch repeats itself, or its outer nodes are repeated.
    continued_pressure = with_rim(pressure, boundary, 1)
    continued_gap = with_rim(gap, boundary, 1)
    inside = continued_pressure > 0
    at_border = np.zeros_like(touching)
    edges = 0
    work = 0.0
    gap_outside = 0.0
    for neighbour in _NEIGHBOURS:
        is_edge = touching & ~inside[neighbour]
        gaps = continued_gap[neighbour][is_edge]
        edges += gaps.size
        work += float(pressure[is_edge] @ gaps)
        gap_outside += float(gaps.sum())
        at_border |= is_edge
    if edges == 0:
        return BorderSigns(outer=outer)
    pieces = _independent_pieces(
        heights[at_border], float(np.ptp(heights)), _corners(inside, boundary)
    )
    return BorderSigns(
        share=edges / nodes,
        scatter=edges / math.sqrt(pieces) / nodes,
        least_scatter=math.sqrt(edges) / nodes,
        work=work / float(pressure.sum()),
        gap=gap_outside / edges,
        outer=outer,
    )


# The neighbours of all nodes along both axes, in an array with one more node on each side.
_NEIGHBOURS = (
    (slice(None, -2), slice(1, -1)),
    (slice(2, None), slice(1, -1)),
    (slice(1, -1), slice(None, -2)),
    (slice(1, -1), slice(2, None)),
)


def _outer_nodes(touching: Mask) -> int:
    """Return the number of outer nodes of a patch that are in contact."""
    return int(np.count_nonzero(touching) - np.count_nonzero(touching[1:-1, 1:-1]))


def _corners(inside: Mask, boundary: Boundary) -> int:
    """Return the number of corners of the border of contact.

    `inside`, (nx + 2, ny + 2), tells the nodes in contact, with one more node on each side. Each
    square of four nodes has a corner for one or three nodes in contact, and two corners for two
    nodes on its diagonal.
    """
    squares = inside[1:, 1:] if boundary == "periodic" else inside[1:-1, 1:-1]
    first = squares[:-1, :-1]
    right = squares[:-1, 1:]
    below = squares[1:, :-1]
    last = squares[1:, 1:]
    is_odd = first ^ right ^ below ^ last
    is_diagonal = (first == last) & (right == below) & (first != right)
    return int(np.count_nonzero(is_odd) + 2 * np.count_nonzero(is_diagonal))


def _independent_pieces(heights: Values, height_range: float, corners: int) -> int:
    """Return the number of pieces of a border whose places between the nodes are independent.

    `heights`, (k,), are those of the contact nodes at the border [um]. Nodes of the same height
    have the same place on repeated waves. Between two corners the border is along an axis, where
    its place changes slowly. A border without corners consists of straight lines.
    """
    levels = np.round(heights / (SAME_HEIGHT * max(height_range, 1e-300)))
    pieces = int(np.unique(levels).size)
    if corners > 0:
        pieces = min(pieces, corners)
    return pieces
