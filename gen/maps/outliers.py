"""Heights that stand apart from the others: codes for missing heights, single pits and spikes.

Instruments' programs write a number, such as -9999, where they measured nothing. Such a code is an
exact value that many nodes share and that lies apart from the other heights. A pit or a spike is a
node, or a few side by side, that is far from the heights around it. Both are looked for at either
end of the heights and named in a warning. No height is changed here: whether a node was measured
is for the user to say, by a mask.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.read import Remedy, Topography
from gen.maps.scan import UNITS, unit_of
from gen.maps.settings import SPIKE
from gen.runtime.errors import InputError

# largest heights that are used [um]: those of files in a wrong unit are beyond, and squares of
# smaller ones stay finite
HIGHEST = 1e60

Nodes = NDArray[np.bool_]  # whether a node is chosen, shape (nx, ny)
End = Literal[1, -1]  # end of the heights: 1 for the highest ones, -1 for the lowest ones

ROUNDING = 1e-9  # relative difference of numbers that are taken for the same
# nodes along each side of the neighbourhood: its median ignores spikes of up to 3 x 4 nodes
WINDOW = 5
LINES = 64  # lines of nodes whose neighbourhoods are gathered at a time, which bounds the memory
TO_DEVIATION = (
    1.4826  # standard deviation of normal numbers over their median absolute deviation
)


@dataclass(frozen=True, eq=False)
class LocalLevels:
    """The planes through the surroundings of some nodes, by medians."""

    medians: Values  # height of the plane at each node [um], shape (k,)
    # steps of the plane from one node to the next along x and y [um], shape (k, 1, 1)
    along_x: Values
    along_y: Values


def local_levels(windows: Values) -> LocalLevels:
    """Compute the levels of the surroundings in the middle of windows.

    Beside a hole, a spike or the border, a slope would shift the median. Therefore a plane through
    the middle is subtracted first, whose slopes are the medians of those in the window.

    Parameters
    ----------
    windows : ndarray, shape (k, n, n)
        Heights around k nodes, with an odd n; NaN for missing nodes [um].

    Returns
    -------
    LocalLevels
        Median and slopes of each window.
    """
    along_x = _median_steps(windows, axis=1)
    along_y = _median_steps(windows, axis=2)
    places = np.arange(windows.shape[1]) - windows.shape[1] // 2
    level = windows - along_x * places[:, None] - along_y * places
    return LocalLevels(_medians(level), along_x, along_y)


def _median_steps(windows: Values, axis: int) -> Values:
    """Return the median step between neighbours along an axis, or 0 [um], shape (k, 1, 1)."""
    medians = _medians(np.diff(windows, axis=axis))
    return np.nan_to_num(medians, copy=False)[:, None, None]


def local_medians(heights: Heights) -> Heights:
    """Compute the median of the measured nodes around each node, on their slope.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um].

    Returns
    -------
    ndarray, shape (nx, ny)
        Level of the `WINDOW` x `WINDOW` nodes around each node, see `local_levels` [um].
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
    """Compute the usual distance of nodes from their local medians.

    Parameters
    ----------
    distances : ndarray
        Distances of nodes from their local medians, of any shape, NaN at holes [um].
    heights : ndarray, shape (nx, ny)
        Heights of the map, whose span limits the rounding [um].

    Returns
    -------
    float
        Standard deviation of the distances by their median absolute deviation, and at least the
        rounding of the heights [um].
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
    return np.asarray(np.where(count % 2 == 1, lower, lower / 2 + upper / 2))


# different heights from which a map has enough of them for one to stand apart
FEWEST_VALUES = 16
FEWEST_SHARED = 3  # nodes with one height from which this height may be a code
# The gap between a code and the next height is at least this many times as wide as the widest of
# the next `GAPS` gaps: steps of a coarse scale are alike, and a plateau has no gap.
WIDER = 2.0
GAPS = 10
# least median step at the rim of a code over the usual step between neighbours: plateaus of
# saturated and honed maps have less than 3, except for sharp ridges, which have no gap
RIM = 3.0
# the same if the only sign of a code is that its nodes lie scattered over the map
SCATTERED_RIM = 7.0
# least share of the nodes, and least ratio to the nodes of any other value, from which a value
# between the other heights may be a code
COMMON = 5e-4
COMMONER = 5.0
# pairs of neighbours with a common value, for each node with this value, up to which its nodes lie
# scattered over the map; twice the pairs by chance are added
PAIRED = 0.05
SAMPLE_VALUES = 2**17  # heights, about, among which the commonest one is looked for
MOST_CODES = 8  # codes of one map that are looked for


@dataclass(frozen=True, eq=False)
class Code:
    """A height that probably says that a node was not measured."""

    value: float  # [um]
    nodes: Nodes  # nodes that have the value
    between: bool  # whether there are heights below it and heights above it

    @property
    def number(self) -> int:
        """Number of nodes that have the value."""
        return int(np.count_nonzero(self.nodes))

    @property
    def first(self) -> tuple[int, int]:
        """Place (row, column) of the first node that has the value."""
        row, column = np.argwhere(self.nodes)[0].tolist()
        return row, column


def find_codes(heights: Heights) -> list[Code]:
    """Find the values of a map that are codes for missing heights.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights as they were measured, so that equal ones still are: no plane is subtracted [um].
        They are NaN where heights are known to be missing.

    Returns
    -------
    list of Code
        Codes at either end of the heights and between them, `MOST_CODES` at most.
    """
    remaining = heights.copy()
    codes: list[Code] = []
    while len(codes) < MOST_CODES:
        code = _next_code(remaining)
        if code is None:
            break
        codes.append(code)
        remaining[code.nodes] = np.nan
    return codes


def _next_code(heights: Heights) -> Code | None:
    """Return the lowest, the highest or the commonest height, the first of them that is a code."""
    measured = heights[~np.isnan(heights)]
    stride = (measured.size // SAMPLE_VALUES) | 1
    values, counts = np.unique(measured[::stride], return_counts=True)
    if values.size < FEWEST_VALUES:
        return None
    lowest = float(measured.min())
    lowest_nodes = heights == lowest
    if _is_lowest_apart(heights, lowest_nodes, measured):
        return Code(lowest, lowest_nodes, between=False)
    highest = float(measured.max())
    highest_nodes = heights == highest
    if _is_lowest_apart(heights, highest_nodes, -measured):
        return Code(highest, highest_nodes, between=False)
    commonest = int(np.argmax(counts))
    next_count = float(np.delete(counts, commonest).max())
    if float(counts[commonest]) / next_count < COMMONER:
        return None
    value = float(values[commonest])
    nodes = heights == value
    is_end = value in {lowest, highest}
    if _is_common_apart(heights, nodes, measured.size, is_end=is_end):
        return Code(value, nodes, between=not is_end)
    return None


def _is_lowest_apart(heights: Heights, nodes: Nodes, measured: Values) -> bool:
    """Tell whether the nodes with the lowest of the measured heights [um] lie apart.

    For the highest nodes, `measured` are the heights with the opposite sign.
    """
    number = int(np.count_nonzero(nodes))
    if 2 * number > measured.size:
        return False
    lowest = _lowest_values(measured, number)
    gaps = np.diff(lowest)
    span_of_others = float(measured.max()) - float(lowest[1])
    if gaps[0] > span_of_others:
        return True
    if number < FEWEST_SHARED or gaps[0] <= WIDER * gaps[1:].max():
        return False
    return rim_steps(heights, nodes) >= RIM


def _lowest_values(measured: Values, number: int) -> Values:
    """Return the `GAPS` + 2 lowest different heights, if the lowest one is at a number of nodes."""
    last = min(number + 8 * GAPS, measured.size - 1)
    lowest = np.unique(np.partition(measured, last)[: last + 1])
    if lowest.size < GAPS + 2:  # a map of few different heights, each at many nodes
        lowest = np.unique(measured)
    return lowest[: GAPS + 2]


def _is_common_apart(heights: Heights, nodes: Nodes, total: int, *, is_end: bool) -> bool:
    """Tell whether the common value of some nodes is not the height of a flat part of the surface.

    `total` is the number of measured nodes, and `is_end` says that no height is beyond the value.
    """
    number = int(np.count_nonzero(nodes))
    if not COMMON * total <= number <= total / 2:
        return False
    pairs_along_x = int(np.count_nonzero(nodes & np.roll(nodes, 1, 0)))
    pairs_along_y = int(np.count_nonzero(nodes & np.roll(nodes, 1, 1)))
    by_chance = (
        2 * number / total
    )  # pairs for each node of as many nodes at random places
    scattered = pairs_along_x + pairs_along_y <= number * (2 * by_chance + PAIRED)
    if is_end:
        return scattered and rim_steps(heights, nodes) >= SCATTERED_RIM
    return scattered or rim_steps(heights, nodes) >= RIM


def rim_steps(heights: Heights, nodes: Nodes) -> float:
    """Compute the median step at the rim of some nodes over the usual step between other nodes.

    Steps of 0 are left out, because heights with few digits have many of them.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um].
    nodes : ndarray of bool, shape (nx, ny)
        Nodes whose rim is looked at.

    Returns
    -------
    float
        The lesser of the ratios along x and along y, as usual steps along a lay are small; 0 if
        there is no step at the rim [1].
    """
    ratios = []
    for axis in (0, 1):
        steps = np.abs(np.diff(heights, axis=axis))
        pairs = np.arange(steps.shape[axis])
        first = np.take(nodes, pairs, axis)
        second = np.take(nodes, pairs + 1, axis)
        measured = steps > 0  # and neither node is NaN
        at_rim = steps[measured & (first ^ second)]
        outside = steps[measured & ~first & ~second]
        if not at_rim.size:
            continue
        usual = np.inf
        if outside.size:
            usual = TO_DEVIATION * float(np.median(outside))
        ratios.append(float(np.median(at_rim)) / usual)
    return min(ratios, default=0.0)


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
    slope = max(abs(float(level.along_x[0, 0, 0])), abs(float(level.along_y[0, 0, 0])))
    if not distance > max(threshold, STEEPER * slope):
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


def refuse_overflowing_heights(topography: Topography) -> None:
    """Refuse a map with heights beyond `HIGHEST`, whose squares are beyond what numbers hold.

    Parameters
    ----------
    topography : Topography
        The map, with at least one height.

    Raises
    ------
    InputError
        If a height is beyond it. The message advises a mask if other heights are not.
    """
    heights = topography.heights
    largest = float(np.nanmax(np.abs(heights)))
    if largest <= HIGHEST:
        return
    overflowing = np.abs(heights) > HIGHEST
    bounds = mask_bounds(heights, overflowing)
    fault = f"{topography.name}: heights of {largest:.3g} um"
    if not bounds:
        raise InputError(f"{fault}; check their unit")
    row, column = np.argwhere(overflowing)[0].tolist()
    raise InputError(
        f"{fault}, the first at the node ({row}, {column}), which may stand for missing"
        f" heights: --mask {bounds} makes holes of them, which --fill closes"
    )


def with_code_warnings(topography: Topography) -> Topography:
    """Add a warning for each code for missing heights, and note its nodes as doubtful.

    Parameters
    ----------
    topography : Topography
        The map, with its heights as they were measured.

    Returns
    -------
    Topography
        The map with these warnings, or the same one if it has no code.
    """
    heights = topography.heights
    codes = find_codes(heights)
    if not codes:
        return topography
    doubtful = np.any([code.nodes for code in codes], axis=0)
    kept = heights[~doubtful & ~np.isnan(heights)]
    bounds = mask_bounds(heights, doubtful)
    warnings = list(topography.warnings)
    for code in codes:
        if code.between:
            warnings.append(_code_between(topography, code))
        else:
            warnings.append(_code_at_end(topography, code, kept, bounds))
    return replace(topography, warnings=tuple(warnings), doubtful=doubtful)


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


def _mask_remedy(bounds: str, *, plural: bool) -> Remedy:
    """Return the mask with the given bounds and what it does to one node or several."""
    holes = "holes of them" if plural else "a hole of it"
    return Remedy(f"mask {bounds}", f"makes {holes}, which --fill closes")


def _code_at_end(topography: Topography, code: Code, kept: Values, bounds: str) -> str:
    """Return the warning for a code at an end of the heights, with a mask of the given bounds.

    `kept` are the heights of all nodes without a code [um].
    """
    span = f"{kept.min():.6g} to {kept.max():.6g} um"
    if code.number >= FEWEST_SHARED:
        fault = (
            f"{_shared(topography, code)}, apart from the others, {span}; they may stand"
            " for missing heights"
        )
        return topography.advised(fault, _mask_remedy(bounds, plural=True))
    words = SPIKES_IN_WORDS if code.value > kept.max() else PITS_IN_WORDS
    fault = (
        f"the {words.node} {code.first} is a {words.kind}{words.consequence}, or stands"
        f" for a missing height, at {_in_file(topography, code.value)}, apart from the"
        f" others, {span}"
    )
    mask = _mask_remedy(bounds, plural=False)
    return topography.advised(fault, mask, *OTHER_REMEDIES)


def _code_between(topography: Topography, code: Code) -> str:
    """Return the warning for a code that lies between the other heights."""
    return (
        f"{_shared(topography, code)}, unlike their neighbours; they may stand for"
        " missing heights; write nan for them in the file, as a mask would leave out"
        " other heights too"
    )


def _shared(topography: Topography, code: Code) -> str:
    """Write how many nodes share the value of a code, and the place of the first of them."""
    share = 100 * code.number / topography.heights.size
    value = _in_file(topography, code.value)
    return (
        f"{code.number} nodes ({share:.3g} %) are at {value}, the first is {code.first}"
    )


def _in_file(topography: Topography, height: float) -> str:
    """Write a height in um, followed by the number in the file if its unit is another one."""
    text = f"{height:.6g} um"
    factor = UNITS.get(unit_of(topography.unit), 1.0)
    if factor == 1.0:
        return text
    upright = -1.0 if "invert" in topography.followed else 1.0
    return f"{text} ({upright * height / factor:.6g} {topography.unit} in the file)"


def with_outlier_warnings(
    topography: Topography, measured: Heights, level: Heights
) -> Topography:
    """Add a warning for the spikes of a map and one for its pits, and note them as doubtful.

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
            remedies.insert(0, _mask_remedy(bounds, plural=False))
        fault = _outliers_in_words(outliers, words, topography.heights)
        warnings.append(topography.advised(fault, *remedies))
    return replace(topography, warnings=tuple(warnings), doubtful=doubtful)


def _outliers_in_words(outliers: Outliers, words: OutlierWords, heights: Heights) -> str:
    """Write where the outermost spike or pit is, how far from its neighbours, and its companions.

    `heights`, shape (nx, ny), are those of the map [um]. A tilted map has nodes further out.
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
