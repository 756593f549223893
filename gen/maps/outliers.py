"""Heights that stand apart from the others: codes for missing heights, single pits and spikes.

Instruments' programs write a number, such as -9999, where they measured nothing. Such a code is an
exact value that many nodes share and that lies apart from the other heights. A pit or a spike is a
node, or a few side by side, that is far from the heights around it. Both are looked for at either
end of the heights and named in a warning. No height is changed here: whether a node was measured
is for the user to say, by a mask.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.read import Topography
from gen.maps.scan import UNITS, unit_of
from gen.maps.settings import SPIKE
from gen.runtime.errors import InputError

HIGHEST = (
    1e60  # heights [um] of files in a wrong unit; squares of smaller ones stay finite
)

Nodes = NDArray[np.bool_]  # whether a node is chosen, shape (nx, ny)

ROUNDING = 1e-9  # relative difference of numbers that are taken for the same
# nodes along each side of the neighbourhood: its median ignores spikes of up to 3 x 4 nodes
WINDOW = 5
ROWS = 64  # rows of nodes whose neighbourhoods are gathered at a time, which bounds the memory


@dataclass(frozen=True, eq=False)
class LocalLevels:
    """The level around some nodes, by the medians of the measured nodes in their windows."""

    medians: Values  # height of the level at each node [um], shape (k,)
    # steps of the level from one node to the next along x and y [um], shape (k, 1, 1)
    along_x: Values
    along_y: Values


def local_levels(windows: Values) -> LocalLevels:
    """Compute the levels in the middle of square windows of heights [um], shape (k, n, n).

    Beside a hole, a spike or the border, a slope would shift the median. So the plane through
    the middle whose slopes are the medians of those in the window is taken out before.
    """
    steps = np.arange(windows.shape[1]) - windows.shape[1] // 2
    along_x, along_y = (
        np.nan_to_num(_medians(np.diff(windows, axis=axis)), copy=False)[:, None, None]
        for axis in (1, 2)
    )
    level = windows - along_x * steps[:, None] - along_y * steps
    return LocalLevels(_medians(level), along_x, along_y)


def local_medians(heights: Heights) -> tuple[Heights, float]:
    """Return the median of the measured nodes around each node, on their slope, and the scatter.

    The scatter is that of the distances of all nodes from their medians; see `scatter_of` [um].
    """
    padded = np.pad(heights, WINDOW // 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (WINDOW, WINDOW))
    medians = np.empty(heights.shape)
    for first in range(0, len(heights), ROWS):
        block = windows[first : first + ROWS].reshape(-1, WINDOW, WINDOW)
        medians[first : first + ROWS] = local_levels(block).medians.reshape(
            -1, heights.shape[1]
        )
    return medians, scatter_of(heights - medians, heights)


def scatter_of(distances: Values, heights: Heights) -> float:
    """Return the usual distance of nodes from their local medians [um].

    It is the median absolute deviation times 1.4826, the standard deviation of normal distances,
    and at least the rounding of the heights [um].
    """
    measured = distances[~np.isnan(distances)]
    scatter = 1.4826 * float(np.median(np.abs(measured - np.median(measured))))
    return max(scatter, ROUNDING * float(np.nanmax(heights) - np.nanmin(heights)))


def _medians(values: Values) -> Values:
    """Return the median of the numbers of each entry of the first axis, NaN if it has none."""
    each = values.reshape(len(values), -1)
    ordered = np.sort(each, axis=1)  # NaN come last
    count = np.count_nonzero(~np.isnan(each), axis=1)
    entries = np.arange(len(each))
    lower, upper = (
        ordered[entries, np.maximum(place, 0)] for place in ((count - 1) // 2, count // 2)
    )
    return np.asarray(np.where(count % 2 == 1, lower, lower / 2 + upper / 2))


FEWEST_VALUES = (
    16  # different heights from which a map has enough of them to stand apart from
)
FEWEST_SHARED = 3  # nodes with one height from which this height may be a code
# The gap between a code and the next height is this many times as wide as the widest of the next
# `GAPS` gaps, at least: steps of a coarse scale are alike, and a plateau has no gap.
WIDER = 2.0
GAPS = 10
# Median step at the rim of a code over the usual step between neighbours, at least. Plateaus of
# saturated and honed maps have less than 3, but for sharp ridges, which have no gap.
RIM = 3.0
# the same where the only sign is that the nodes of a value lie scattered over the map
SCATTERED_RIM = 7.0
# A value that lies between the others is a code if it is at this share of the nodes or more, and
# at so many times as many as any other value.
COMMON = 5e-4
COMMONER = 5.0
SAMPLE_VALUES = 2**17  # heights, about, among which the commonest one is looked for
MOST_CODES = 8  # codes of one map that are looked for


@dataclass(frozen=True, eq=False)
class Code:
    """A height that probably says that a node was not measured."""

    value: float  # [um]
    nodes: Nodes
    between: bool  # whether there are heights below it and heights above it

    @property
    def number(self) -> int:
        """Number of nodes that have the value."""
        return int(np.count_nonzero(self.nodes))

    @property
    def first(self) -> tuple[int, int]:
        """The first node that has the value."""
        row, column = np.argwhere(self.nodes)[0].tolist()
        return row, column


def find_codes(heights: Heights) -> list[Code]:
    """Find the values of a map that are codes for missing heights.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights as they were measured, so that equal ones still are: no plane is taken out [um].
        They are NaN where heights are known to be missing.

    Returns
    -------
    list of Code
        Codes at either end of the heights, and between them.
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
    """Return the least, the greatest or the commonest height if it is a code."""
    measured = heights[~np.isnan(heights)]
    sample = measured[:: measured.size // SAMPLE_VALUES | 1]
    values, counts = np.unique(sample, return_counts=True)
    if values.size < FEWEST_VALUES:
        return None
    commonest = int(np.argmax(counts))
    # how many times as common as any other value it is, by the sample
    ratio = float(counts[commonest]) / float(np.delete(counts, commonest).max())
    ends = float(measured.min()), float(measured.max())
    for sign, end in zip((1, -1), ends, strict=True):
        nodes = heights == end
        if _is_end_apart(heights, nodes, sign * measured):
            return Code(end, nodes, between=False)
    value = float(values[commonest])
    nodes, is_end = heights == value, value in ends
    if ratio >= COMMONER and _is_common_apart(
        heights, nodes, measured.size, is_end=is_end
    ):
        return Code(value, nodes, between=not is_end)
    return None


def _is_end_apart(heights: Heights, nodes: Nodes, rising: Values) -> bool:
    """Tell whether nodes at the least of some `rising` heights lie apart from the others."""
    number = int(np.count_nonzero(nodes))
    if 2 * number > rising.size:
        return False
    first = min(number + 8 * GAPS, rising.size - 1)
    inward = np.unique(np.partition(rising, first)[: first + 1])
    if inward.size < GAPS + 2:  # few heights, each of many nodes
        inward = np.unique(rising)
    gaps = np.diff(inward[: GAPS + 2])
    if gaps[0] > float(rising.max()) - float(inward[1]):  # than all others span
        return True
    if number < FEWEST_SHARED or gaps[0] <= WIDER * gaps[1:].max():
        return False
    return rim_steps(heights, nodes) >= RIM


def _is_common_apart(heights: Heights, nodes: Nodes, total: int, *, is_end: bool) -> bool:
    """Tell whether a common value of some nodes is not that of a flat part of the surface."""
    number = int(np.count_nonzero(nodes))
    if not COMMON * total <= number <= total / 2:
        return False
    pairs = sum(int(np.count_nonzero(nodes & np.roll(nodes, 1, axis))) for axis in (0, 1))
    scattered = pairs <= number * (
        4 * number / total + 0.05
    )  # twice what chance brings together
    if is_end:
        return scattered and rim_steps(heights, nodes) >= SCATTERED_RIM
    return scattered or rim_steps(heights, nodes) >= RIM


def rim_steps(heights: Heights, nodes: Nodes) -> float:
    """Return the median step at the rim of some nodes over the usual one between other neighbours.

    It is the lesser of those along x and along y, as the usual steps along a lay are small. Steps
    of 0 do not count, as heights with few digits have many of them; 0 without any step.
    """
    ratios = []
    for axis in (0, 1):
        steps = np.abs(np.diff(heights, axis=axis))
        shorter = heights.shape[axis] - 1
        first = np.take(nodes, range(shorter), axis)
        second = np.take(nodes, range(1, shorter + 1), axis)
        known = steps > 0  # and no NaN
        across, between = steps[known & (first ^ second)], steps[known & ~first & ~second]
        if across.size:
            usual = 1.4826 * float(np.median(between)) if between.size else np.inf
            ratios.append(float(np.median(across)) / usual)
    return min(ratios, default=0.0)


# Nodes at this distance from a pit or spike lie around it; it is part of a ridge, groove, wall or
# summit if more than one of them is more than half as far from the level as itself.
AROUND = 3
HALF = 0.5
# Where a surface has many pits or summits, one of them is single if it is so many times as far from
# the level as this share of the nodes, at least. Of normal distances it is 6 times their scatter.
USUAL, FARTHER = 0.98, 3.0
# A node whose height differs from the level by less than this many steps of the level's slope to
# the next node is no pit or spike.
STEEPER = 2.0
SAMPLE = 64  # nodes along each axis, at most, whose distances from the level are the usual ones
MOST_SINGLE = 1000  # pits or spikes that are looked for
LOST = 1000.0  # scatter in spacings of numbers at the largest height, below which it is rounding


@dataclass(frozen=True)
class Single:
    """A node that is far from its neighbours, the farthest of its end of the heights."""

    node: tuple[int, int]
    distance: float  # from the level around it, positive [um]
    nodes: Nodes  # this one and those of its end that are far from their neighbours too

    @property
    def number(self) -> int:
        """Number of such nodes."""
        return int(np.count_nonzero(self.nodes))


def find_single(heights: Heights, sign: int) -> Single | None:
    """Find the spikes (`sign` 1) at the top of a map, or the pits (-1) at its bottom.

    The highest node is looked at, then the next one, until one of them is none. A spike is more
    than `SPIKE` times the usual distance from its local median, as `--despike` counts it, more
    than the slope there explains, and stands alone.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um], NaN at nodes that are left out.
    sign : {1, -1}
        The end of the heights that is looked at.
    """
    nx, ny = heights.shape
    padded = np.pad(heights, AROUND, constant_values=np.nan)
    width = 2 * AROUND + 1
    windows = np.lib.stride_tricks.sliding_window_view(padded, (width, width))
    inner = slice(AROUND - WINDOW // 2, AROUND + WINDOW // 2 + 1)
    thin = np.ix_(
        *(np.unique(np.linspace(0, n - 1, SAMPLE).astype(int)) for n in (nx, ny))
    )
    sampled = windows[thin].reshape(-1, width, width)
    usual = sampled[:, AROUND, AROUND] - local_levels(sampled[:, inner, inner]).medians
    least = SPIKE * scatter_of(usual, heights)
    least = max(least, FARTHER * float(np.nanquantile(sign * usual, USUAL)))
    outward = np.where(np.isnan(heights), -np.inf, sign * heights).ravel()
    most = min(MOST_SINGLE, outward.size - 1)
    first = np.argpartition(-outward, most)[:most]
    first = first[np.argsort(-outward[first], kind="stable")]
    single: list[int] = []
    distances: list[float] = []
    for place in first.tolist():
        window = windows[place // ny, place % ny]
        distance = _distance_alone(window, sign, least)
        if distance is None:
            break
        single.append(place)
        distances.append(distance)
    if not single:
        return None
    nodes = np.zeros(heights.shape, dtype=bool)
    nodes.flat[single] = True
    return Single((single[0] // ny, single[0] % ny), distances[0], nodes)


def _distance_alone(window: Values, sign: int, least: float) -> float | None:
    """Return how far the middle of a window is from the level around, None if it is not alone."""
    inner = slice(AROUND - WINDOW // 2, AROUND + WINDOW // 2 + 1)
    level = local_levels(window[None, inner, inner])
    steps = np.arange(-AROUND, AROUND + 1)
    slopes = level.along_x[0] * steps[:, None] + level.along_y[0] * steps
    outward = sign * (window - slopes - level.medians[0])
    distance = float(outward[AROUND, AROUND])
    slope = max(abs(float(level.along_x[0, 0, 0])), abs(float(level.along_y[0, 0, 0])))
    if not distance > max(least, STEEPER * slope):
        return None
    outer = np.maximum(*np.abs(np.meshgrid(steps, steps))) == AROUND
    around = np.count_nonzero(np.abs(outward[outer]) > HALF * distance)
    return distance if around <= 1 else None


def mask_beside(heights: Heights, doubtful: Nodes) -> str:
    """Return the ends of a mask that leaves some nodes out and keeps all others, "" without one.

    They are numbers of few digits, a twentieth of the span of the other heights beyond these.
    """
    left = heights[doubtful & ~np.isnan(heights)]
    kept = heights[~doubtful & ~np.isnan(heights)]
    if not left.size or not kept.size:
        return ""
    low, high = float(kept.min()), float(kept.max())
    if ((left >= low) & (left <= high)).all():
        return ""
    below = float(left[left < low].max(initial=-np.inf))
    above = float(left[left > high].min(initial=np.inf))
    margin = (high - low) / 20
    least = _shortest(max(low - margin, (below + low) / 2), low)
    most = _shortest(min(high + margin, (above + high) / 2), high)
    return f"{least}:{most}"


def _shortest(number: float, end: float) -> str:
    """Write a number with the fewest digits that move it by less than half its way to an end."""
    texts = [f"{number:.{digits}g}" for digits in range(2, 18)]
    text = next(
        (each for each in texts if abs(float(each) - number) < abs(number - end) / 2),
        texts[-1],
    )
    if 1e-3 <= abs(float(text)) < 1e6:
        return np.format_float_positional(float(text), trim="-")
    return text


def refuse_beyond_numbers(topography: Topography) -> None:
    """Refuse heights whose squares numbers do not hold, with a mask if they are codes."""
    heights = topography.heights
    largest = float(np.nanmax(np.abs(heights)))
    if largest <= HIGHEST:
        return
    bounds = mask_beside(heights, np.abs(heights) > HIGHEST)
    fault = f"{topography.name}: heights of {largest:.3g} um"
    if not bounds:
        raise InputError(f"{fault}; check their unit")
    row, column = np.argwhere(np.abs(heights) > HIGHEST)[0].tolist()
    fault += (
        f", the first at the node ({row}, {column}), which may stand for missing heights"
    )
    raise InputError(f"{fault}: --mask {bounds} makes holes of them, which --fill closes")


def with_codes_named(topography: Topography) -> Topography:
    """Add a warning for each code of a map whose heights are as they were measured."""
    heights = topography.heights
    codes = find_codes(heights)
    if not codes:
        return topography
    doubtful = np.any([code.nodes for code in codes], axis=0)
    bounds = mask_beside(heights, doubtful)
    warnings = [*topography.warnings]
    for code in codes:
        if code.between:
            warnings.append(_code_between(topography, code))
            continue
        kept = heights[~doubtful & ~np.isnan(heights)]
        apart = f"apart from the others, {kept.min():.6g} to {kept.max():.6g} um"
        row, column = code.first
        if code.number >= FEWEST_SHARED:
            fault = f"{_shared(topography, code)}, {apart}; they may stand for missing heights"
            remedies = [_mask_advice(bounds, "them")]
        else:
            end = "highest" if code.value > kept.max() else "lowest"
            kind = "spike from whose tip Delta counts" if end == "highest" else "pit"
            fault = f"the {end} node ({row}, {column}) is a {kind}, or stands for a missing height,"
            fault += f" at {_in_file(topography, code.value)}, {apart}"
            remedies = [_mask_advice(bounds, "it"), *OTHER_REMEDIES]
        warnings.append(topography.advised(fault, *remedies))
    return replace(topography, warnings=tuple(warnings), doubtful=doubtful)


OTHER_REMEDIES = (
    (f"despike {SPIKE:g}", "replaces it by what is around"),
    ("crop", "leaves this part out"),
)


def _mask_advice(bounds: str, pronoun: str) -> tuple[str, str]:
    """Return a mask and what it does to nodes outside its bounds."""
    hole = "a hole" if pronoun == "it" else "holes"
    return f"mask {bounds}", f"makes {hole} of {pronoun}, which --fill closes"


def _code_between(topography: Topography, code: Code) -> str:
    """Return the warning for a code that lies between the other heights."""
    return (
        f"{_shared(topography, code)}, unlike their neighbours; they may stand for missing heights;"
        " write nan for them in the file, as a mask would leave out other heights too"
    )


def _shared(topography: Topography, code: Code) -> str:
    """Write how many nodes share a value, and where the first of them is."""
    share = 100 * code.number / topography.heights.size
    row, column = code.first
    value = _in_file(topography, code.value)
    return f"{code.number} nodes ({share:.3g} %) are at {value}, the first is ({row}, {column})"


def _in_file(topography: Topography, height: float) -> str:
    """Write a height in um, and as the file has it where its unit is another one."""
    text = f"{height:.6g} um"
    factor = UNITS.get(unit_of(topography.unit), 1.0)
    if factor == 1.0:
        return text
    upright = -1.0 if "invert" in topography.followed else 1.0
    return f"{text} ({upright * height / factor:.6g} {topography.unit} in the file)"


def with_single_named(
    topography: Topography, measured: Heights, level: Heights
) -> Topography:
    """Add a warning for the pits and one for the spikes at the ends of a map without holes.

    Parameters
    ----------
    topography : Topography
        The map after the steps that take a form out, with all of its nodes.
    measured : ndarray, shape (nx, ny)
        Heights before these steps, which a mask cuts [um].
    level : ndarray, shape (nx, ny)
        Heights of the map without its tilt, if it is still tilted [um].
    """
    left_out = topography.doubtful
    if left_out is None:
        left_out = np.zeros(measured.shape, dtype=bool)
    heights = np.where(left_out, np.nan, level)
    largest = float(np.nanmax(np.abs(measured)))
    if float(np.nanstd(heights)) <= LOST * float(np.spacing(largest)):
        return topography
    looked_for = {sign: find_single(heights, sign) for sign in (1, -1)}
    singles = {sign: single for sign, single in looked_for.items() if single is not None}
    if not singles:
        return topography
    for single in singles.values():
        left_out = left_out | single.nodes
    bounds = mask_beside(measured, left_out)
    warnings = list(topography.warnings)
    for sign, single in singles.items():
        remedies = [*OTHER_REMEDIES]
        if bounds and not _within(float(measured[single.node]), bounds):
            remedies.insert(0, _mask_advice(bounds, "it"))
        fault = _single_in_words(single, sign, topography.heights)
        warnings.append(topography.advised(fault, *remedies))
    return replace(topography, warnings=tuple(warnings), doubtful=left_out)


def _single_in_words(single: Single, sign: int, heights: Heights) -> str:
    """Write where a pit or spike is, how far from its neighbours, and how many more there are."""
    end, kind = ("highest", "spike") if sign > 0 else ("lowest", "pit")
    is_end = not (sign * heights > sign * heights[single.node]).any()
    fault = f"the {end} node" if is_end else "the node"
    fault += f" {single.node} is a {kind}"
    if is_end and sign > 0:
        fault += " from whose tip Delta counts"
    fault += (
        f", {single.distance:.4g} um {'above' if sign > 0 else 'below'} its neighbours"
    )
    if single.number > 1:
        fault += f", and {single.number - 1} more nodes are such"
    return fault


def _within(height: float, bounds: str) -> bool:
    """Tell whether a mask keeps a height."""
    least, most = map(float, bounds.split(":"))
    return least <= height <= most
