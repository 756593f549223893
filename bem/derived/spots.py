"""Spots of contact: regions of nodes in contact that are connected along the sides of their cells.

Regions of the gap are connected along sides too, so that two diagonal cells connect neither contact
nor gap. Regions of a patch that repeats itself are also connected across its borders. On a mirrored
patch every region at a border meets only its own mirror image, so that it is treated as a free one.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bem.arrays import Mask, Values

# Numbers of regions, one for each node, 0 for the nodes of no region.
Labels = NDArray[np.int32]

# Whether something connects opposite sides of the patch, along the first and the second axis.
Connects = tuple[bool, bool]


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
        Whether any spot connects opposite sides of the patch, along the first and the second axis.
        On a patch that repeats itself, which has no sides, it is whether a spot continues without
        end.
    gap_connects : tuple of bool
        Whether any region of the gap does so, which means that the contact leaks along the axis.
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
        if not self.areas.size:
            return 0.0
        return float(self.areas[0] / self.areas.sum())


@dataclass(frozen=True, eq=False)
class Regions:
    """The k connected regions of a mask.

    Attributes
    ----------
    labels : ndarray of int, shape (nx, ny)
        Number of the region that each node belongs to, from 1; 0 outside the mask.
    crosses : ndarray of bool, shape (k + 1, 2)
        Whether each of the k regions connects opposite sides, along the first and the second axis.
        The row of a region has its number; the first row, for the nodes of no region, is False.
    offsets : ndarray of int, shape (2, nx, ny)
        On a patch that repeats itself, the period, along either axis, to which each node has to be
        moved for its region to be in one piece. Adding a constant to a region's offsets changes
        nothing. All are 0 if the patch does not repeat itself.
    """

    labels: Labels
    crosses: NDArray[np.bool_]
    offsets: Labels


@dataclass(frozen=True)
class _Link:
    """A step across a border of a patch that repeats itself, from a label to another one.

    Attributes
    ----------
    label : int
        Label on this side of the border.
    following : int
        Label on the other side, in the next patch.
    step : tuple of int
        Number of patches along the first and the second axis: 1 or -1 along one of them.
    """

    label: int
    following: int
    step: tuple[int, int]


@dataclass(frozen=True, eq=False)
class _Group:
    """Labels that are connected across borders, and so form one region.

    Attributes
    ----------
    offsets : dict of int to tuple of int
        Number of patches along both axes from the first label to each label, by the label.
    endless : tuple of bool
        Whether the region meets itself in another patch, and so continues without end, along the
        first and the second axis.
    """

    offsets: dict[int, tuple[int, int]]
    endless: Connects


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

    Returns
    -------
    Spots
        The spots; `labels` and `open_gap` are read-only.
    """
    contact = regions(touching, periodic=periodic)
    gap = regions(~touching, periodic=periodic)
    number_of_labels = len(contact.crosses)  # the spots, and 0 for nodes out of contact
    cells = np.bincount(contact.labels.reshape(-1), minlength=number_of_labels)[1:]
    largest_first = np.argsort(-cells, kind="stable")
    ranks = np.zeros(number_of_labels, dtype=np.int32)
    ranks[largest_first + 1] = np.arange(1, number_of_labels)
    labels = ranks[contact.labels]
    is_open = np.any(gap.crosses, axis=1)  # by the label of a region of the gap
    open_gap = is_open[gap.labels]
    labels.setflags(write=False)
    open_gap.setflags(write=False)
    areas: Values = cells[largest_first].astype(np.float64) * cell
    return Spots(
        labels=labels,
        areas=areas,
        contact_connects=_any_connects(contact),
        gap_connects=_any_connects(gap),
        open_gap=open_gap,
    )


def _any_connects(all_regions: Regions) -> Connects:
    """Return whether any region connects opposite sides, along the first and the second axis."""
    along = all_regions.crosses[:, 0]
    across = all_regions.crosses[:, 1]
    return bool(along.any()), bool(across.any())


def regions(mask: Mask, *, periodic: bool) -> Regions:
    """Find the connected regions of a mask, and which of them connect opposite sides.

    Parameters
    ----------
    mask : ndarray of bool, shape (nx, ny)
        Nodes of the regions.
    periodic : bool
        Whether the patch repeats itself.

    Returns
    -------
    Regions
        The regions, numbered by their first nodes.
    """
    # Imported here, because few contacts are asked for their spots.
    from scipy.ndimage import label

    labels = np.empty(mask.shape, dtype=np.int32)
    number = label(mask, output=labels)
    if periodic:
        return _joined_across_borders(labels, number)
    # Whether a label is at the first or the last side of an axis: side, label, axis.
    at_side = np.zeros((2, number + 1, 2), dtype=bool)
    for side, end in enumerate((0, -1)):
        at_side[side, labels[end], 0] = True
        at_side[side, labels[:, end], 1] = True
    crosses: NDArray[np.bool_] = at_side[0] & at_side[1]
    crosses[0] = False
    no_offsets = np.zeros((2, *mask.shape), dtype=np.int32)
    return Regions(labels=labels, crosses=crosses, offsets=no_offsets)


def _joined_across_borders(labels: Labels, number: int) -> Regions:
    """Join `number` labels that meet across the borders of a patch that repeats itself."""
    neighbours = _neighbours(_links(labels))
    region_of = np.zeros(number + 1, dtype=np.int32)
    crosses = np.zeros((number + 1, 2), dtype=bool)
    offsets = np.zeros((2, number + 1), dtype=np.int32)
    count = 0
    for label in range(1, number + 1):
        if region_of[label]:  # it has been joined to an earlier label
            continue
        count += 1
        group = _group_of(label, neighbours)
        crosses[count] = group.endless
        for member, offset in group.offsets.items():
            region_of[member] = count
            offsets[:, member] = offset
    return Regions(
        labels=region_of[labels],
        crosses=crosses[: count + 1],
        offsets=offsets[:, labels],
    )


def _links(labels: Labels) -> Iterator[_Link]:
    """Yield a link for each two labels that meet across a border of a patch that repeats itself."""
    borders = (
        (labels[-1], labels[0], (1, 0)),
        (labels[:, -1], labels[:, 0], (0, 1)),
    )
    for last, first, step in borders:
        meet = (last > 0) & (first > 0)
        pairs = np.unique(np.stack([last[meet], first[meet]], axis=1), axis=0)
        for label, following in pairs:
            yield _Link(label=int(label), following=int(following), step=step)


def _neighbours(links: Iterable[_Link]) -> dict[int, list[_Link]]:
    """Return the links that leave each label, by the label.

    Each of `links` is included twice: from its label, and back from the label that follows.
    """
    neighbours: dict[int, list[_Link]] = {}
    for link in links:
        along, across = link.step
        back = _Link(label=link.following, following=link.label, step=(-along, -across))
        neighbours.setdefault(link.label, []).append(link)
        neighbours.setdefault(link.following, []).append(back)
    return neighbours


def _group_of(start: int, neighbours: dict[int, list[_Link]]) -> _Group:
    """Return the group of a label: follow the links to all labels that it is connected to."""
    offsets = {start: (0, 0)}
    endless_along = False
    endless_across = False
    to_visit = [start]
    while to_visit:
        label = to_visit.pop()
        along, across = offsets[label]
        for link in neighbours.get(label, []):
            reached = along + link.step[0], across + link.step[1]
            if link.following not in offsets:
                offsets[link.following] = reached
                to_visit.append(link.following)
                continue
            # If two ways to a label end in different patches, the region meets itself.
            earlier = offsets[link.following]
            endless_along |= earlier[0] != reached[0]
            endless_across |= earlier[1] != reached[1]
    return _Group(offsets=offsets, endless=(endless_along, endless_across))
