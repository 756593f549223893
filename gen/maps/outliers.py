"""Single pits and spikes: heights that stand apart from those around them.

A pit or a spike is a node, or a few side by side, that is far from the heights around it. Pits and
spikes are looked for at either end of the heights and named in a warning. No height is changed
here: whether a node was measured is for the user to say, by a mask.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.read import Remedy, Topography
from gen.maps.settings import SPIKE

Nodes = NDArray[np.bool_]  # whether a node is chosen, shape (nx, ny)
End = Literal[1, -1]  # end of the heights: 1 for the highest ones, -1 for the lowest ones

ROUNDING = 1e-9  # relative difference of numbers that are taken for the same
# nodes along each side of the neighbourhood: its median ignores spikes of up to 3 x 4 nodes
WINDOW = 5
LINES = 64  # lines of nodes whose neighbourhoods are gathered at a time, which bounds the memory
# standard deviation of normal numbers over their median absolute deviation
TO_DEVIATION = 1.4826


@dataclass(frozen=True, eq=False)
class LocalLevels:
    """Planes through the heights around some nodes, fitted by medians."""

    medians: Values  # height of the plane at each node [um], shape (k,)
    # steps of the plane from one node to the next along x and y [um], shape (k, 1, 1)
    along_x: Values
    along_y: Values


def local_levels(windows: Values) -> LocalLevels:
    """Fit a plane to the heights in each window, by medians.

    The slopes of a plane are the medians of the steps between neighbours in the window. Its height
    in the middle is the median of the heights without these slopes, because a slope would shift the
    median beside a hole, a spike or the border.

    Parameters
    ----------
    windows : ndarray, shape (k, n, n)
        Heights around k nodes, with an odd n; NaN for missing nodes [um].

    Returns
    -------
    LocalLevels
        Height in the middle and slopes of the plane of each window.
    """
    along_x = _median_steps(windows, axis=1)
    along_y = _median_steps(windows, axis=2)
    places = np.arange(windows.shape[1]) - windows.shape[1] // 2
    level = windows - along_x * places[:, None] - along_y * places
    return LocalLevels(_medians(level), along_x, along_y)


def _median_steps(windows: Values, axis: int) -> Values:
    """Return the median step in each window along an axis, 0 without any [um], shape (k, 1, 1)."""
    medians = _medians(np.diff(windows, axis=axis))
    return np.nan_to_num(medians, copy=False)[:, None, None]


def local_medians(heights: Heights) -> Heights:
    """Compute the local level of each node, by the median of the measured nodes around it.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um].

    Returns
    -------
    ndarray, shape (nx, ny)
        Height of the plane through the `WINDOW` x `WINDOW` nodes around each node, see
        `local_levels` [um].
    """
    padded = np.pad(heights, WINDOW // 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (WINDOW, WINDOW))
    medians = np.empty(heights.shape)
    for first in range(0, len(heights), LINES):
        lines = slice(first, first + LINES)
        levels = local_levels(windows[lines].reshape(-1, WINDOW, WINDOW))
        medians[lines] = levels.medians.reshape(-1, heights.shape[1])
    return medians


def scatter_of(distances: Values, heights: Heights) -> float:
    """Estimate the standard deviation of the distances of nodes from their local medians.

    Parameters
    ----------
    distances : ndarray
        Distances of nodes from their local medians, of any shape, NaN at holes [um].
    heights : ndarray, shape (nx, ny)
        Heights of the map, whose span limits the rounding [um].

    Returns
    -------
    float
        Median absolute deviation of the distances times that factor which makes it the standard
        deviation of normal ones, and at least the rounding of the heights [um].
    """
    measured = distances[~np.isnan(distances)]
    deviations = np.abs(measured - np.median(measured))
    scatter = TO_DEVIATION * float(np.median(deviations))
    span = float(np.nanmax(heights) - np.nanmin(heights))
    return max(scatter, ROUNDING * span)


def _medians(values: Values) -> Values:
    """Return the median of the numbers of each entry of the first axis, NaN if it has none."""
    numbers = values.reshape(len(values), -1)
    ordered = np.sort(numbers, axis=1)  # NaN come last
    count = np.count_nonzero(~np.isnan(numbers), axis=1)
    entries = np.arange(len(numbers))
    lower = ordered[entries, np.maximum((count - 1) // 2, 0)]
    upper = ordered[entries, count // 2]
    odd = count % 2 == 1
    return np.asarray(np.where(odd, lower, lower / 2 + upper / 2))


# Nodes at this distance from a pit or spike are its surroundings; it is part of a ridge, groove,
# wall or summit if more than one of them is more than `HALF` as far from the level as itself.
AROUND = 3
HALF = 0.5
# least distance of a pit or spike from the level, over the distance that the share `USUAL` of the
# nodes does not exceed: for normal distances this is 6 times their scatter
USUAL = 0.98
FARTHER = 3.0
# A node whose height differs from the level by less than this many steps of the level's slope to
# the next node is no pit or spike.
STEEPER = 2.0
SAMPLE = 64  # largest number of nodes along each axis whose distances from the level are sampled
MOST_OUTLIERS = 1000  # pits or spikes that are looked for
LOST = (
    1000.0  # scatter, in spacings of numbers at the largest height, that may be rounding
)


@dataclass(frozen=True, eq=False)
class Outliers:
    """The spikes at the top of a map, or the pits at its bottom."""

    node: tuple[int, int]  # place (row, column) of the outermost one
    distance: float  # of this node from the level around it, positive [um]
    nodes: Nodes  # all of them

    @property
    def number(self) -> int:
        """Number of nodes that are spikes or pits."""
        return int(np.count_nonzero(self.nodes))


def find_outliers(heights: Heights, end: End) -> Outliers | None:
    """Find the spikes at the top of a map, or the pits at its bottom.

    Nodes are looked at from the outermost one inwards, until one is no spike (or pit). A spike is
    more than `SPIKE` times the usual distance from its local median, as for `--despike`, is more
    than the slope at this place explains, and stands alone.

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
    columns = heights.shape[1]
    padded = np.pad(heights, AROUND, constant_values=np.nan)
    width = 2 * AROUND + 1
    windows = np.lib.stride_tricks.sliding_window_view(padded, (width, width))
    threshold = _outlier_threshold(heights, windows, end)
    places: list[int] = []
    distances: list[float] = []
    for place in _outermost(heights, end):
        window = windows[place // columns, place % columns]
        distance = _distance_alone(window, end, threshold)
        if distance is None:
            break
        places.append(place)
        distances.append(distance)
    if not places:
        return None
    nodes = np.zeros(heights.shape, dtype=bool)
    nodes.flat[places] = True
    return Outliers(divmod(places[0], columns), distances[0], nodes)


def _outermost(heights: Heights, end: End) -> list[int]:
    """Return flat places of the outermost nodes at one end of the heights, the first one first."""
    outward = np.where(np.isnan(heights), -np.inf, end * heights).ravel()
    number = min(MOST_OUTLIERS, outward.size - 1)
    places = np.argpartition(-outward, number)[:number]
    order = np.argsort(-outward[places], kind="stable")
    outermost: list[int] = places[order].tolist()
    return outermost


def _middle(windows: Values) -> Values:
    """Return the parts of windows, shape (..., n, n), from which levels are computed."""
    inner = slice(AROUND - WINDOW // 2, AROUND + WINDOW // 2 + 1)
    return windows[..., inner, inner]


def _outlier_threshold(heights: Heights, windows: Values, end: End) -> float:
    """Return the least distance of a spike or pit from its level [um], by a sample of the nodes.

    The windows, shape (nx, ny, n, n), hold the heights around each node.
    """
    rows, columns = (
        np.unique(np.linspace(0, nodes - 1, SAMPLE).astype(int))
        for nodes in heights.shape
    )
    sample = windows[np.ix_(rows, columns)].reshape(-1, *windows.shape[2:])
    distances = sample[:, AROUND, AROUND] - local_levels(_middle(sample)).medians
    usual = float(np.nanquantile(end * distances, USUAL))
    return max(SPIKE * scatter_of(distances, heights), FARTHER * usual)


def _distance_alone(window: Values, end: End, threshold: float) -> float | None:
    """Return the distance of the middle of a window from the level around it [um].

    None is returned if it is below the threshold [um] or what the slope explains, or if the node
    is not alone.
    """
    level = local_levels(_middle(window)[None])
    places = np.arange(-AROUND, AROUND + 1)
    plane = level.along_x[0] * places[:, None] + level.along_y[0] * places
    outward = end * (window - plane - level.medians[0])
    distance = float(outward[AROUND, AROUND])
    slope_x = abs(float(level.along_x.item()))
    slope_y = abs(float(level.along_y.item()))
    if not distance > max(threshold, STEEPER * slope_x, STEEPER * slope_y):
        return None
    rows, columns = np.meshgrid(places, places)
    surroundings = np.maximum(np.abs(rows), np.abs(columns)) == AROUND
    companions = np.count_nonzero(np.abs(outward[surroundings]) > HALF * distance)
    return distance if companions <= 1 else None


def mask_bounds(heights: Heights, doubtful: Nodes) -> str:
    """Choose a mask that leaves out nodes and keeps all other nodes.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um].
    doubtful : ndarray of bool, shape (nx, ny)
        Nodes to leave out.

    Returns
    -------
    str
        Value of `--mask` with two numbers of few digits, about a twentieth of the span beyond the
        other heights, as "8.9:11.1"; "" if no mask tells the nodes from the others.
    """
    measured = ~np.isnan(heights)
    outside = heights[doubtful & measured]
    kept = heights[~doubtful & measured]
    if not outside.size or not kept.size:
        return ""
    low = float(kept.min())
    high = float(kept.max())
    if ((outside >= low) & (outside <= high)).all():
        return ""
    below = float(outside[outside < low].max(initial=-np.inf))
    above = float(outside[outside > high].min(initial=np.inf))
    margin = (high - low) / 20
    lower = _shortest(max(low - margin, (below + low) / 2), low)
    upper = _shortest(min(high + margin, (above + high) / 2), high)
    return f"{lower}:{upper}"


def _shortest(number: float, end: float) -> str:
    """Write a number with the fewest digits that move it by less than half its way to an end."""
    tolerance = abs(number - end) / 2
    text = ""
    for digits in range(2, 18):
        text = f"{number:.{digits}g}"
        if abs(float(text) - number) < tolerance:
            break
    if 1e-3 <= abs(float(text)) < 1e6:
        return np.format_float_positional(float(text), trim="-")
    return text


def _is_kept(height: float, bounds: str) -> bool:
    """Tell whether the mask with the given bounds keeps a height [um]."""
    low, high = bounds.split(":")
    return float(low) <= height <= float(high)


@dataclass(frozen=True)
class OutlierWords:
    """Words of a warning for spikes or for pits."""

    end: End  # end of the heights at which they are
    node: str  # name of the outermost node
    kind: str  # name of one of them
    consequence: str  # what follows if it is the outermost node, "" for nothing
    side: str  # direction from the neighbours


SPIKES_IN_WORDS = OutlierWords(
    1, "highest node", "spike", " from whose tip Delta counts", "above"
)
PITS_IN_WORDS = OutlierWords(-1, "lowest node", "pit", "", "below")


OTHER_REMEDIES: tuple[Remedy, ...] = (
    Remedy(f"despike {SPIKE:g}", "replaces it by what is around"),
    Remedy("crop", "leaves this part out"),
)
"""Remedies of a pit or spike that need no mask."""


def mask_remedy(bounds: str, *, plural: bool) -> Remedy:
    """Return a mask as the remedy of a pit, a spike or a code.

    Parameters
    ----------
    bounds : str
        Value of `--mask`, from `mask_bounds`.
    plural : bool
        Whether it is the remedy for several nodes rather than for one.

    Returns
    -------
    Remedy
        The mask and what it does.
    """
    holes = "holes of them" if plural else "a hole of it"
    return Remedy(f"mask {bounds}", f"makes {holes}, which --fill closes")


def with_outlier_warnings(
    topography: Topography, measured: Heights, level: Heights
) -> Topography:
    """Add a warning for the spikes of a map and one for its pits, and note their nodes as doubtful.

    Parameters
    ----------
    topography : Topography
        The map after the steps that take a form out, without holes.
    measured : ndarray, shape (nx, ny)
        Heights before these steps, which a mask cuts [um].
    level : ndarray, shape (nx, ny)
        Heights of the map without its tilt, if it still has one [um].

    Returns
    -------
    Topography
        The map with these warnings, or the same one if it has no spike and no pit.
    """
    doubtful = topography.doubtful
    if doubtful is None:
        doubtful = np.zeros(measured.shape, dtype=bool)
    heights = np.where(doubtful, np.nan, level)
    largest = float(np.nanmax(np.abs(measured)))
    if float(np.nanstd(heights)) <= LOST * float(np.spacing(largest)):
        return topography
    spikes = find_outliers(heights, 1)
    pits = find_outliers(heights, -1)
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
        if bounds and not _is_kept(float(measured[outliers.node]), bounds):
            remedies.insert(0, mask_remedy(bounds, plural=False))
        fault = _outliers_in_words(outliers, words, topography.heights)
        warnings.append(topography.advised(fault, *remedies))
    return replace(topography, warnings=tuple(warnings), doubtful=doubtful)


def _outliers_in_words(outliers: Outliers, words: OutlierWords, heights: Heights) -> str:
    """Write where the outermost spike or pit is, how far from its neighbours, and its companions.

    `heights`, shape (nx, ny), are those of the map [um]. In a tilted map, other nodes may be higher
    or lower.
    """
    outward = words.end * heights
    node = "node"
    consequence = ""
    if not (outward > outward[outliers.node]).any():
        node = words.node
        consequence = words.consequence
    fault = (
        f"the {node} {outliers.node} is a {words.kind}{consequence},"
        f" {outliers.distance:.4g} um {words.side} its neighbours"
    )
    if outliers.number > 1:
        fault += f", and {outliers.number - 1} more nodes are such"
    return fault
