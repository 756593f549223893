"""Codes for missing heights: numbers in a map that probably say that a node was not measured.

Programs of instruments write a number, as -9999, where they measured nothing. Many nodes share
exactly this number, and it is unlike the heights around them. The lowest, the highest and the
commonest value of a map are examined, and a warning names each code. No height is changed here:
only the user knows whether a node was measured, and can leave it out by a mask.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.outliers import (
    OTHER_REMEDIES,
    PITS_IN_WORDS,
    SPIKES_IN_WORDS,
    TO_DEVIATION,
    Nodes,
    mask_bounds,
    mask_remedy,
)
from gen.maps.read import Topography
from gen.maps.scan import UNITS, unit_of
from gen.runtime.errors import InputError

# largest height that is accepted [um]: heights beyond it are codes or in a wrong unit, and squares
# of smaller heights stay finite
HIGHEST = 1e60
# fewest different heights of a map in which codes are sought
FEWEST_VALUES = 16
# fewest nodes that share a code, unless its gap exceeds the span of all other heights
FEWEST_SHARED = 3
# The gap between a code and the next height is more than `WIDER` times as wide as each of the next
# `GAPS` gaps between heights: the steps of a coarse scale are alike, and a plateau has no gap.
WIDER = 2.0
GAPS = 10
# Least `rim_steps` of a code. Plateaus of saturated and honed maps have less than 3; only sharp
# ridges have more, but they have no gap.
RIM = 3.0
# Least `rim_steps` of a code whose only other sign is that its nodes are scattered over the map.
SCATTERED_RIM = 7.0
# least share of the nodes that have the commonest value, if it is a code
COMMON = 5e-4
# least number of nodes with the commonest value, if it is a code, over that of any other value
COMMONER = 5.0
# Nodes with one value are scattered over the map if they have few pairs of neighbours among them:
# at most this number of pairs for each node, plus twice the pairs that chance would make.
PAIRED = 0.05
# about the number of heights among which the commonest value is sought
SAMPLE_VALUES = 2**17
MOST_CODES = 8  # largest number of codes that are sought in one map


@dataclass(frozen=True, eq=False)
class Code:
    """A height that probably says that a node was not measured."""

    value: float  # the height [um]
    nodes: Nodes  # nodes that have this height
    between: bool  # whether some heights are below it and others above it

    @property
    def number(self) -> int:
        """Number of nodes that have the height."""
        return int(np.count_nonzero(self.nodes))

    @property
    def first(self) -> tuple[int, int]:
        """Indices (along x, along y) of the first node that has the height."""
        ix, iy = np.argwhere(self.nodes)[0].tolist()
        return ix, iy


def find_codes(heights: Heights) -> list[Code]:
    """Find the values of a map that are codes for missing heights.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights before a level or form is subtracted, so that codes are still equal; NaN where
        heights are known to be missing [um].

    Returns
    -------
    list of Code
        At most `MOST_CODES` codes, in the order in which they are found: each one is sought among
        the heights without the codes before it.
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
    """Return the first of the lowest, the highest and the commonest height that is a code.

    Return None if none of them is a code. A flat part of the surface may have equal heights, too.
    """
    measured = heights[~np.isnan(heights)]
    stride = (measured.size // SAMPLE_VALUES) | 1  # odd, to sample all columns
    values, counts = np.unique(measured[::stride], return_counts=True)
    if values.size < FEWEST_VALUES:
        return None
    lowest = float(measured.min())
    lowest_nodes = heights == lowest
    if _is_lowest_apart(heights, lowest_nodes, measured):
        return Code(value=lowest, nodes=lowest_nodes, between=False)
    highest = float(measured.max())
    highest_nodes = heights == highest
    # With the opposite sign, the highest height is the lowest one.
    if _is_lowest_apart(heights, highest_nodes, -measured):
        return Code(value=highest, nodes=highest_nodes, between=False)
    commonest = int(np.argmax(counts))
    next_count = float(np.delete(counts, commonest).max())
    if float(counts[commonest]) / next_count < COMMONER:
        return None
    value = float(values[commonest])
    nodes = heights == value
    is_end = value in {lowest, highest}
    if _is_common_apart(heights, nodes, measured.size, is_end=is_end):
        return Code(value=value, nodes=nodes, between=not is_end)
    return None


def _is_lowest_apart(heights: Heights, nodes: Nodes, measured: Values) -> bool:
    """Tell whether the lowest height is a code, because it is apart from all other heights.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um].
    nodes : ndarray of bool, shape (nx, ny)
        Nodes with the lowest height; to examine the highest height, the nodes with this one.
    measured : ndarray, shape (k,)
        All heights that are not NaN; to examine the highest height, with the opposite sign [um].

    Returns
    -------
    bool
        Whether the gap above the lowest height is wider than the span of all other heights. For
        `FEWEST_SHARED` nodes and more, also whether the gap is wide (`WIDER`) and the rim is steep
        (`RIM`). Always False if more than half of the nodes have this height.
    """
    number = int(np.count_nonzero(nodes))
    if 2 * number > measured.size:
        return False
    lowest = _lowest_values(measured, number)
    gaps = np.diff(lowest)
    gap = gaps[0]
    span_of_others = float(measured.max()) - float(lowest[1])
    if gap > span_of_others:
        return True
    if number < FEWEST_SHARED or gap <= WIDER * gaps[1:].max():
        return False
    return rim_steps(heights, nodes) >= RIM


def _lowest_values(measured: Values, number: int) -> Values:
    """Return the `GAPS` + 2 lowest different heights of a map, rising [um].

    `measured` are the heights of all measured nodes, and `number` counts the nodes that have the
    lowest height. A map with fewer different heights returns all of them.
    """
    # Sorting a part is faster, and usually enough: each height beyond the lowest is at few nodes.
    last = min(number + 8 * GAPS, measured.size - 1)
    lowest = np.unique(np.partition(measured, last)[: last + 1])
    if lowest.size < GAPS + 2:
        lowest = np.unique(measured)
    return lowest[: GAPS + 2]


def _is_common_apart(heights: Heights, nodes: Nodes, total: int, *, is_end: bool) -> bool:
    """Tell whether the commonest height is a code and not the height of a flat part.

    `nodes` are the nodes with this height, `total` is the number of all measured nodes, and
    `is_end` says whether it is the lowest or the highest height. A code at an end has scattered
    nodes and a steep rim; a code between the other heights has one of these signs.
    """
    number = int(np.count_nonzero(nodes))
    if not COMMON * total <= number <= total / 2:
        return False
    # Pairs across opposite borders are counted too.
    pairs_along_x = int(np.count_nonzero(nodes & np.roll(nodes, 1, axis=0)))
    pairs_along_y = int(np.count_nonzero(nodes & np.roll(nodes, 1, axis=1)))
    pairs = pairs_along_x + pairs_along_y
    # Expected pairs for each node if the nodes were at random places: two new pairs a node, whose
    # other node has the value with the probability number / total.
    by_chance = 2 * number / total
    are_scattered = pairs <= number * (2 * by_chance + PAIRED)
    if is_end:
        return are_scattered and rim_steps(heights, nodes) >= SCATTERED_RIM
    return are_scattered or rim_steps(heights, nodes) >= RIM


def rim_steps(heights: Heights, nodes: Nodes) -> float:
    """Compute how much steeper a map is at the rim of some nodes than elsewhere.

    A step is the height difference of two neighbours. Steps at the rim are between a node of
    `nodes` and another node; usual steps are between two other nodes. Steps of 0 are left out,
    because heights with few digits have many of them.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um].
    nodes : ndarray of bool, shape (nx, ny)
        Nodes whose rim is examined.

    Returns
    -------
    float
        Median step at the rim, divided by the spread of usual steps: `TO_DEVIATION` (1.48) times
        their median. Of the ratios along both axes it is the smaller one: along a lay usual steps
        are small, and the ratio is large. It is 0 if no step is at the rim, or if an axis has steps
        at the rim but no usual ones.
    """
    ratios = []
    for axis in (0, 1):
        steps = np.abs(np.diff(heights, axis=axis))
        pairs = np.arange(steps.shape[axis])
        first = np.take(nodes, pairs, axis)
        second = np.take(nodes, pairs + 1, axis)
        measured = steps > 0  # false for a step from or to a hole, which is NaN
        at_rim = steps[measured & (first ^ second)]  # one of the two nodes is in `nodes`
        outside = steps[measured & ~first & ~second]
        if not at_rim.size:
            continue
        usual = np.inf
        if outside.size:
            usual = TO_DEVIATION * float(np.median(outside))
        ratios.append(float(np.median(at_rim)) / usual)
    return min(ratios, default=0.0)


def refuse_overflowing_heights(topography: Topography) -> None:
    """Refuse a map with a height whose magnitude is above `HIGHEST`: its square may overflow.

    Parameters
    ----------
    topography : Topography
        The map, with at least one height.

    Raises
    ------
    InputError
        If a height is too large. The message advises a mask if some heights are not too large.
    """
    heights = topography.heights
    largest = float(np.nanmax(np.abs(heights)))
    if largest <= HIGHEST:
        return
    overflowing = np.abs(heights) > HIGHEST
    bounds = mask_bounds(heights, overflowing)
    fault = f"{topography.name}: heights of {largest:.3g} um"
    if not bounds:  # no mask could keep the other heights
        raise InputError(f"{fault}; check their unit")
    ix, iy = np.argwhere(overflowing)[0].tolist()
    raise InputError(
        f"{fault}, the first at the node ({ix}, {iy}), which may stand for missing"
        f" heights: --mask {bounds} makes holes of them, which --fill closes"
    )


def with_code_warnings(topography: Topography) -> Topography:
    """Add a warning for each code for missing heights, and mark its nodes as doubtful.

    Parameters
    ----------
    topography : Topography
        The map before a level or form is subtracted.

    Returns
    -------
    Topography
        The map with the warnings; the argument itself if the map has no code.
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


def _code_at_end(topography: Topography, code: Code, kept: Values, bounds: str) -> str:
    """Return the warning for a code below or above all other heights.

    `kept` are the heights of all nodes without a code [um]. `bounds` are the bounds of the mask
    that is advised, as `mask_bounds` writes them.
    """
    span = f"{kept.min():.6g} to {kept.max():.6g} um"
    if code.number >= FEWEST_SHARED:
        fault = (
            f"{_shared(topography, code)}, apart from the others, {span}; they may stand"
            " for missing heights"
        )
        return topography.advised(fault, mask_remedy(bounds, plural=True))
    # One or two nodes may as well be a spike or a pit.
    words = SPIKES_IN_WORDS if code.value > kept.max() else PITS_IN_WORDS
    fault = (
        f"the {words.node} {code.first} is a {words.kind}{words.consequence}, or stands"
        f" for a missing height, at {_in_file(topography, code.value)}, apart from the"
        f" others, {span}"
    )
    mask = mask_remedy(bounds, plural=False)
    return topography.advised(fault, mask, *OTHER_REMEDIES)


def _code_between(topography: Topography, code: Code) -> str:
    """Return the warning for a code between the other heights, which no mask can leave out."""
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
    """Write a height [um], followed by its number in the file if the file has another unit.

    The number has the sign that it has in the file, also if the map was turned upside down.
    """
    text = f"{height:.6g} um"
    factor = UNITS.get(unit_of(topography.unit), 1.0)
    if factor == 1.0:
        return text
    sign = -1.0 if "invert" in topography.followed else 1.0
    number = sign * height / factor
    return f"{text} ({number:.6g} {topography.unit} in the file)"
