"""Spots of contact: regions of nodes that touch along the sides of their cells.

Contact and gap are both joined along sides only, so that two diagonal cells join neither. A patch
that repeats itself is joined across its borders; at those of a mirrored one every region meets its
own image.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bem.arrays import Mask, Values

Labels = NDArray[np.int32]

# Whether something connects opposite sides, along the first and the second axis.
Connects = tuple[bool, bool]

# Whether each region crosses the patch along either axis, of shape (k + 1, 2).
Crosses = NDArray[np.bool_]

# Two regions that join across a border, and the patches by which the second one lies further on.
Link = tuple[int, int, tuple[int, int]]


@dataclass(frozen=True, eq=False)
class Spots:
    """The spots of a contact.

    Attributes
    ----------
    labels : ndarray of int, shape (nx, ny)
        Number of the spot that each node belongs to, from 1 for the largest; 0 out of contact.
    areas : ndarray, shape (k,)
        Area of each spot, the largest first; of a mirrored spot the part inside the patch [um2].
    contact_connects : tuple of bool
        Whether one spot connects opposite sides of the patch along the first and along the second
        axis. A patch that repeats itself has no sides: there, whether the spot goes on without end.
    gap_connects : tuple of bool
        The same of the gap, which then leaks.
    open_gap : ndarray of bool, shape (nx, ny)
        Nodes of the gap that belong to a region which connects opposite sides.
    """

    labels: Labels
    areas: Values
    contact_connects: Connects
    gap_connects: Connects
    open_gap: NDArray[np.bool_]

    @property
    def number(self) -> int:
        """Number of spots."""
        return self.areas.size

    @property
    def largest_share(self) -> float:
        """Share of the contact area that the largest spot has, 0 without contact [1]."""
        return float(self.areas[0] / self.areas.sum()) if self.areas.size else 0.0


def spots_of(touching: NDArray[np.bool_], cell: float, *, periodic: bool) -> Spots:
    """Find the spots of a contact.

    Parameters
    ----------
    touching : ndarray of bool, shape (nx, ny)
        Nodes in contact.
    cell : float
        Area of a cell [um2].
    periodic : bool
        Whether the patch repeats itself.
    """
    labels, crosses, _ = regions(touching, periodic=periodic)
    gaps, gap_crosses, _ = regions(~touching, periodic=periodic)
    cells = np.bincount(labels.reshape(-1), minlength=len(crosses))[1:]
    order = np.argsort(-cells, kind="stable")
    places = np.zeros(len(crosses), dtype=np.int32)
    places[order + 1] = np.arange(1, len(crosses))
    ordered = places[labels]
    open_gap = np.any(gap_crosses, axis=1, keepdims=True)[gaps, 0]
    for field in (ordered, open_gap):
        field.setflags(write=False)
    areas: Values = cells[order].astype(np.float64) * cell
    return Spots(ordered, areas, _either(crosses), _either(gap_crosses), open_gap)


def _either(crosses: Crosses) -> Connects:
    """Return whether any region connects opposite sides, along either axis."""
    return bool(crosses[:, 0].any()), bool(crosses[:, 1].any())


def regions(mask: Mask, *, periodic: bool) -> tuple[Labels, Crosses, Labels]:
    """Label the regions of a mask from 1 on, and find those that connect opposite sides.

    Parameters
    ----------
    mask : ndarray of bool, shape (nx, ny)
        Nodes of the regions.
    periodic : bool
        Whether the patch repeats itself.

    Returns
    -------
    labels : ndarray of int, shape (nx, ny)
        Label of the region that each node belongs to, 0 outside the mask.
    crosses : ndarray of bool, shape (k + 1, 2)
        Whether each region connects opposite sides along either axis; the first row, for nodes
        outside the mask, is False.
    patches : ndarray of int, shape (2, nx, ny)
        By how many patches along either axis each node lies off its place in the mask where its
        region is seen as a whole, up to a number that the region shares; 0 if nothing repeats.
    """
    from scipy.ndimage import (
        label,
    )  # here, because few contacts are asked for their spots

    labels = np.empty(mask.shape, dtype=np.int32)
    number = label(mask, output=labels)
    if periodic:
        joined, around, patches = _joined(number, _links(labels))
        return joined[labels], around, patches[:, labels]
    sides = np.zeros((2, number + 1, 2), dtype=bool)
    for end in (0, -1):
        sides[end, labels[end], 0] = sides[end, labels[:, end], 1] = True
    crosses: Crosses = sides[0] & sides[1]
    crosses[0] = False
    return labels, crosses, np.zeros((2, *mask.shape), dtype=np.int32)


def _links(labels: Labels) -> Iterator[Link]:
    """Yield the regions that meet across the borders of a patch that repeats itself."""
    borders = (labels[-1], labels[0], (1, 0)), (labels[:, -1], labels[:, 0], (0, 1))
    for last, first, step in borders:
        both = (last > 0) & (first > 0)
        pairs = np.unique(np.stack([last[both], first[both]], axis=1), axis=0)
        yield from ((int(one), int(other), step) for one, other in pairs)


def _joined(number: int, links: Iterator[Link]) -> tuple[Labels, Crosses, Labels]:
    """Join linked regions; one that meets itself some patches further goes on without end.

    Parameters
    ----------
    number : int
        Number of regions.
    links : iterator of Link
        Regions that meet across a border.

    Returns
    -------
    joined : ndarray of int, shape (number + 1,)
        New label of each region, 0 for 0.
    crosses : ndarray of bool, shape (k + 1, 2)
        Whether each joined region goes on without end along either axis.
    patches : ndarray of int, shape (2, number + 1)
        By how many patches each region lies off the first one that it is joined to.
    """
    neighbours: dict[int, list[tuple[int, int, int]]] = {}
    for one, other, (along, across) in links:
        neighbours.setdefault(one, []).append((other, along, across))
        neighbours.setdefault(other, []).append((one, -along, -across))
    joined = np.zeros(number + 1, dtype=np.int32)
    crosses = np.zeros((number + 1, 2), dtype=bool)
    patches = np.zeros((2, number + 1), dtype=np.int32)
    count = 0
    for region in range(1, number + 1):
        if joined[region]:
            continue
        count += 1
        joined[region] = count
        patch, open_ends = {region: (0, 0)}, [region]
        while open_ends:
            here = open_ends.pop()
            patches[:, here] = patch[here]
            for other, along, across in neighbours.get(here, []):
                there = patch[here][0] + along, patch[here][1] + across
                if other in patch:
                    for axis in (0, 1):
                        crosses[count, axis] |= patch[other][axis] != there[axis]
                    continue
                joined[other], patch[other] = count, there
                open_ends.append(other)
    return joined, crosses[: count + 1], patches
