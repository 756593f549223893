"""Single pits and spikes: nodes whose heights are far from the heights around them.

A spike is a node, or a few adjacent nodes, far above the heights around it; a pit is far below
them. Spikes are sought among the highest nodes of a map and pits among the lowest, and a warning
names them. No height is changed here: only the user knows whether a node was measured, and can
leave it out by a mask.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.read import Remedy, Topography
from gen.maps.settings import SPIKE

Nodes = NDArray[np.bool_]  # whether each node is chosen, shape (nx, ny)
# end of the heights: 1 for the highest nodes, -1 for the lowest nodes
End = Literal[1, -1]

# least scatter, as a share of the span of all heights: smaller distances may be rounding
ROUNDING = 1e-9
# nodes along each side of a neighbourhood: its median ignores spikes of up to 3 x 4 nodes
WINDOW = 5
LINES = 64  # lines of nodes whose neighbourhoods are gathered at a time, which bounds the memory
# standard deviation of normally distributed numbers over their median absolute deviation
TO_DEVIATION = 1.4826


@dataclass(frozen=True, eq=False)
class LocalLevels:
    """Planes through the heights around each of k nodes, fitted by medians."""

    medians: Values  # height of each plane at its node [um], shape (k,)
    # change of height of each plane from one node to the next along x, and along y [um]; the shape
    # is (k, 1, 1)
    along_x: Values
    along_y: Values


def local_levels(windows: Values) -> LocalLevels:
    """Fit a plane to the heights in each window, by medians.

    The slopes of a plane are the medians of the steps between neighbours in the window. Its height
    in the middle is the median of the heights after these slopes are subtracted, because a slope
    would shift the median beside a hole, a spike or the border.

    Parameters
    ----------
    windows : ndarray, shape (k, n, n)
        Heights around k nodes, with an odd n; NaN for missing nodes [um].

    Returns
    -------
    LocalLevels
        Height in the middle and slopes of the plane of each window. The height is NaN if the
        window has no height, and a slope is 0 if no neighbours along its axis have heights.
    """
    along_x = _median_steps(windows, axis=1)
    along_y = _median_steps(windows, axis=2)
    size = windows.shape[1]
    offsets = np.arange(size) - size // 2  # of the nodes from the middle
    without_slopes = windows - along_x * offsets[:, None] - along_y * offsets
    medians = _medians(without_slopes)
    return LocalLevels(medians=medians, along_x=along_x, along_y=along_y)


def _median_steps(windows: Values, axis: int) -> Values:
    """Return the median step between neighbours along an axis of each window [um].

    The shape is (k, 1, 1). The median is 0 if no neighbours have heights.
    """
    medians = _medians(np.diff(windows, axis=axis))
    return np.nan_to_num(medians, copy=False)[:, None, None]


def local_medians(heights: Heights) -> Heights:
    """Compute the level around each node by medians of the measured nodes around it.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um].

    Returns
    -------
    ndarray, shape (nx, ny)
        At each node, the height of the plane that `local_levels` fits to the `WINDOW` x `WINDOW`
        nodes around it [um]; NaN if none of them has a height.
    """
    padded = np.pad(heights, WINDOW // 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (WINDOW, WINDOW))
    columns = heights.shape[1]
    medians = np.empty(heights.shape)
    for first in range(0, len(heights), LINES):
        lines = slice(first, first + LINES)
        levels = local_levels(windows[lines].reshape(-1, WINDOW, WINDOW))
        medians[lines] = levels.medians.reshape(-1, columns)
    return medians


def scatter_of(distances: Values, heights: Heights) -> float:
    """Estimate the standard deviation of the distances of nodes from their local medians.

    Parameters
    ----------
    distances : ndarray
        Distances of nodes from their local medians, of any shape, NaN at holes [um].
    heights : ndarray, shape (nx, ny)
        Heights of the map, NaN at holes [um].

    Returns
    -------
    float
        Median absolute deviation of the distances times `TO_DEVIATION`, which makes it the standard
        deviation if they are normally distributed, but at least `ROUNDING` times the span of the
        heights [um].
    """
    measured = distances[~np.isnan(distances)]
    deviations = np.abs(measured - np.median(measured))
    scatter = TO_DEVIATION * float(np.median(deviations))
    span = float(np.nanmax(heights) - np.nanmin(heights))
    return max(scatter, ROUNDING * span)


def _medians(values: Values) -> Values:
    """Return the median over all axes but the first, shape (k,); NaN are left out.

    The median is NaN where all values are NaN.
    """
    numbers = values.reshape(len(values), -1)
    ordered = np.sort(numbers, axis=1)  # NaN come last
    count = np.count_nonzero(~np.isnan(numbers), axis=1)
    entries = np.arange(len(numbers))
    lower_place = np.maximum((count - 1) // 2, 0)
    lower = ordered[entries, lower_place]
    upper = ordered[entries, count // 2]
    has_middle = count % 2 == 1
    halfway = lower / 2 + upper / 2  # halves first, as the sum may overflow
    return np.asarray(np.where(has_middle, lower, halfway))


# distance in nodes of the ring around a node that shows whether the node is alone
AROUND = 3
# A node is alone if at most one node of this ring is further from the level than this share of the
# node's own distance from it. Otherwise it is part of a ridge, groove, wall or summit.
HALF = 0.5
# least distance of a spike or pit from its level, over the quantile `USUAL` of the distances of all
# nodes: for normally distributed distances this is about 6 times their scatter
FARTHER = 3.0
USUAL = 0.98
# least distance of a spike or pit from its level, over the change of the level from one node to the
# next
STEEPER = 2.0
SAMPLE = 64  # largest number of nodes along each axis whose distances from the level are sampled
MOST_OUTLIERS = 1000  # largest number of spikes, or of pits, that are sought in one map
# A map has no spikes or pits if the standard deviation of its heights is at most this number of
# spacings of floating-point numbers at the largest height: it may be rounding alone.
LOST = 1000.0


@dataclass(frozen=True, eq=False)
class Outliers:
    """The spikes among the highest nodes of a map, or the pits among its lowest nodes."""

    node: tuple[int, int]  # indices (along x, along y) of the outermost spike or pit
    distance: float  # distance of this node from the level around it, positive [um]
    nodes: Nodes  # all nodes that are spikes or pits

    @property
    def number(self) -> int:
        """Number of nodes that are spikes or pits."""
        return int(np.count_nonzero(self.nodes))


def find_outliers(heights: Heights, end: End) -> Outliers | None:
    """Find the spikes at the top of a map, or the pits at its bottom.

    Nodes are examined from the outermost one inwards, until one is no spike (or pit). The distance
    of a spike or pit from the level around it exceeds `SPIKE` times the scatter of all nodes, as
    for `--despike`, and the two bounds of `FARTHER` and `STEEPER`. A spike or pit is also alone,
    see `HALF`.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at nodes that are left out [um].
    end : {1, -1}
        1 for spikes at the top, -1 for pits at the bottom.

    Returns
    -------
    Outliers or None
        The spikes or pits, None if there are none.
    """
    nx, ny = heights.shape
    padded = np.pad(heights, AROUND, constant_values=np.nan)
    width = 2 * AROUND + 1
    windows = np.lib.stride_tricks.sliding_window_view(padded, (width, width))
    threshold = _outlier_threshold(heights, windows, end)
    places: list[int] = []
    distances: list[float] = []
    for place in _outermost(heights, end):
        ix, iy = divmod(place, ny)
        distance = _distance_alone(windows[ix, iy], end, threshold)
        if distance is None:
            break
        places.append(place)
        distances.append(distance)
    if not places:
        return None
    nodes = np.zeros((nx, ny), dtype=bool)
    nodes.flat[places] = True
    return Outliers(node=divmod(places[0], ny), distance=distances[0], nodes=nodes)


def _outermost(heights: Heights, end: End) -> list[int]:
    """Return the nodes at one end of the heights as flat indices, the outermost node first.

    There are `MOST_OUTLIERS` of them, or one less than all nodes if the map has fewer nodes. Holes
    come last.
    """
    outward = np.where(np.isnan(heights), -np.inf, end * heights).ravel()
    number = min(MOST_OUTLIERS, outward.size - 1)
    places = np.argpartition(-outward, number)[:number]
    order = np.argsort(-outward[places], kind="stable")
    outermost: list[int] = places[order].tolist()
    return outermost


def _middle(windows: Values) -> Values:
    """Return the `WINDOW` x `WINDOW` nodes in the middle of windows, from which levels follow.

    The windows have the shape (..., n, n), where n is 2 `AROUND` + 1.
    """
    half = WINDOW // 2
    inner = slice(AROUND - half, AROUND + half + 1)
    return windows[..., inner, inner]


def _outlier_threshold(heights: Heights, windows: Values, end: End) -> float:
    """Return the least distance of a spike or pit from its level [um], by a sample of the nodes.

    The windows, shape (nx, ny, n, n), hold the heights around each node. The bound by the slope
    (`STEEPER`) is not included, because it differs from node to node.
    """
    nx, ny = heights.shape
    sampled = np.ix_(_sample(nx), _sample(ny))
    sample = windows[sampled].reshape(-1, *windows.shape[2:])
    levels = local_levels(_middle(sample)).medians
    distances = sample[:, AROUND, AROUND] - levels
    usual = float(np.nanquantile(end * distances, USUAL))
    scatter = scatter_of(distances, heights)
    return max(SPIKE * scatter, FARTHER * usual)


def _sample(nodes: int) -> NDArray[np.int_]:
    """Return the indices of at most `SAMPLE` evenly spaced nodes of an axis, shape (k,)."""
    places = np.linspace(0, nodes - 1, SAMPLE).astype(int)
    return np.unique(places)


def _distance_alone(window: Values, end: End, threshold: float) -> float | None:
    """Return the distance of the middle of a window from the level around it [um].

    Return None unless the distance is above the threshold [um], is above `STEEPER` times the change
    of the level to the next node, and the node is alone (`HALF`).
    """
    level = local_levels(_middle(window)[None])  # of this one window
    offsets = np.arange(-AROUND, AROUND + 1)
    slopes = level.along_x[0] * offsets[:, None] + level.along_y[0] * offsets
    outward = end * (window - slopes - level.medians[0])
    distance = float(outward[AROUND, AROUND])
    slope_x = abs(float(level.along_x.item()))
    slope_y = abs(float(level.along_y.item()))
    if not distance > max(threshold, STEEPER * slope_x, STEEPER * slope_y):
        return None
    ring = np.maximum.outer(np.abs(offsets), np.abs(offsets)) == AROUND
    companions = np.count_nonzero(np.abs(outward[ring]) > HALF * distance)
    return distance if companions <= 1 else None


def mask_bounds(heights: Heights, doubtful: Nodes) -> str:
    """Choose the bounds of a mask that leaves out doubtful nodes and keeps all other nodes.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um].
    doubtful : ndarray of bool, shape (nx, ny)
        Nodes to leave out.

    Returns
    -------
    str
        Value of `--mask`, as "8.9:11.1": two bounds [um] of few digits. They are outside the
        heights of the nodes that are not doubtful, by at most about a twentieth of the span of
        these heights. A doubtful node whose height is inside this span is kept, too. "" if all
        doubtful nodes are inside it, if no measured node is doubtful, or if every one is.
    """
    measured = ~np.isnan(heights)
    outside = heights[doubtful & measured]
    kept = heights[~doubtful & measured]
    if not outside.size or not kept.size:
        return ""
    low = float(kept.min())
    high = float(kept.max())
    between = (outside >= low) & (outside <= high)
    if between.all():
        return ""
    below = float(outside[outside < low].max(initial=-np.inf))
    above = float(outside[outside > high].min(initial=np.inf))
    # A bound is halfway between the kept and the doubtful heights, but not further out than this.
    margin = (high - low) / 20
    lower = max(low - margin, (below + low) / 2)
    upper = min(high + margin, (above + high) / 2)
    return f"{_shortest(lower, low)}:{_shortest(upper, high)}"


def _shortest(number: float, end: float) -> str:
    """Write a number with the fewest digits that keep it on its side of another number, `end`.

    The written number differs from the number by less than half of its distance from `end`.
    """
    tolerance = abs(number - end) / 2
    text = ""
    for digits in range(2, 18):  # 17 digits write every number exactly
        text = f"{number:.{digits}g}"
        if abs(float(text) - number) < tolerance:
            break
    rounded = float(text)
    if 1e-3 <= abs(rounded) < 1e6:
        return np.format_float_positional(rounded, trim="-")  # no exponent
    return text


def _is_kept(height: float, bounds: str) -> bool:
    """Tell whether a mask keeps a height [um]; `bounds` is a text from `mask_bounds`."""
    low, high = bounds.split(":")
    return float(low) <= height <= float(high)


@dataclass(frozen=True)
class OutlierWords:
    """Words of a warning for spikes or for pits."""

    end: End  # end of the heights at which the spikes or pits are
    node: str  # name of the outermost node of the map at this end
    kind: str  # name of one spike or pit
    # clause after `kind` that says what follows if the outermost node of the map is a spike or pit;
    # "" if nothing follows
    consequence: str
    side: str  # direction of a spike or pit from its neighbours


SPIKES_IN_WORDS = OutlierWords(
    end=1,
    node="highest node",
    kind="spike",
    consequence=" from whose tip Delta counts",
    side="above",
)
PITS_IN_WORDS = OutlierWords(
    end=-1,
    node="lowest node",
    kind="pit",
    consequence="",
    side="below",
)

OTHER_REMEDIES: tuple[Remedy, ...] = (
    Remedy(f"despike {SPIKE:g}", "replaces it by what is around"),
    Remedy("crop", "leaves this part out"),
)
"""Remedies of a spike or pit other than a mask."""


def mask_remedy(bounds: str, *, plural: bool) -> Remedy:
    """Return a mask as the remedy of spikes, pits or codes for missing heights.

    Parameters
    ----------
    bounds : str
        Value of `--mask`, from `mask_bounds`.
    plural : bool
        Whether the remedy speaks of several nodes rather than of one.

    Returns
    -------
    Remedy
        The option --mask with the bounds, and words for its effect.
    """
    holes = "holes of them" if plural else "a hole of it"
    return Remedy(f"mask {bounds}", f"makes {holes}, which --fill closes")


def with_outlier_warnings(
    topography: Topography, measured: Heights, level: Heights
) -> Topography:
    """Add a warning for the spikes of a map and one for its pits, and mark their nodes as doubtful.

    Nodes that are doubtful already are not examined. A mask is advised if it leaves out the
    outermost spike or pit and keeps all nodes that are not doubtful.

    Parameters
    ----------
    topography : Topography
        The map after the steps that take a form out, without holes.
    measured : ndarray, shape (nx, ny)
        Heights before these steps, NaN at holes; `--mask` acts on these heights [um].
    level : ndarray, shape (nx, ny)
        Heights of the map after its mean plane, if it is tilted, was subtracted [um].

    Returns
    -------
    Topography
        The map with the warnings; the argument itself if the map has no spike and no pit.
    """
    doubtful = topography.doubtful
    if doubtful is None:
        doubtful = np.zeros(measured.shape, dtype=bool)
    heights = np.where(doubtful, np.nan, level)
    largest = float(np.nanmax(np.abs(measured)))
    rounding = float(np.spacing(largest))
    if float(np.nanstd(heights)) <= LOST * rounding:
        return topography
    spikes = find_outliers(heights, end=1)
    pits = find_outliers(heights, end=-1)
    if spikes is None and pits is None:
        return topography
    if spikes is not None:
        doubtful = doubtful | spikes.nodes
    if pits is not None:
        doubtful = doubtful | pits.nodes
    bounds = mask_bounds(measured, doubtful)
    warnings = list(topography.warnings)
    for outliers, words in ((spikes, SPIKES_IN_WORDS), (pits, PITS_IN_WORDS)):
        if outliers is None:
            continue
        remedies = list(OTHER_REMEDIES)
        outermost = float(measured[outliers.node])
        if bounds and not _is_kept(outermost, bounds):
            remedies.insert(0, mask_remedy(bounds, plural=False))
        fault = _outliers_in_words(outliers, words, topography.heights)
        warnings.append(topography.advised(fault, *remedies))
    return replace(topography, warnings=tuple(warnings), doubtful=doubtful)


def _outliers_in_words(outliers: Outliers, words: OutlierWords, heights: Heights) -> str:
    """Write where the outermost spike or pit is, its distance, and the number of further ones.

    It is called the highest (lowest) node only if no height of the map, shape (nx, ny) [um], is
    above (below) its own: in a tilted map, other nodes may lie further out.
    """
    outward = words.end * heights
    is_outermost = not (outward > outward[outliers.node]).any()
    node = "node"
    consequence = ""
    if is_outermost:
        node = words.node
        consequence = words.consequence
    fault = (
        f"the {node} {outliers.node} is a {words.kind}{consequence},"
        f" {outliers.distance:.4g} um {words.side} its neighbours"
    )
    if outliers.number > 1:
        fault += f", and {outliers.number - 1} more nodes are such"
    return fault
