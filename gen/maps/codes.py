"""Codes for missing heights, which stand apart from the heights of a map.

Instruments' programs write a number, such as -9999, where they measured nothing. Such a code is an
exact value that many nodes share and that lies apart from the other heights. Codes are looked for
at either end of the heights, and among them, and named in a warning. No height is changed here:
whether a node was measured is for the user to say, by a mask.
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

# largest heights that are used [um]: those of files in a wrong unit are beyond, and squares of
# smaller ones stay finite
HIGHEST = 1e60
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
    """Return the `GAPS` + 2 lowest different heights of a map [um].

    `number` is the number of nodes that have the lowest height.
    """
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
        return topography.advised(fault, mask_remedy(bounds, plural=True))
    words = SPIKES_IN_WORDS if code.value > kept.max() else PITS_IN_WORDS
    fault = (
        f"the {words.node} {code.first} is a {words.kind}{words.consequence}, or stands"
        f" for a missing height, at {_in_file(topography, code.value)}, apart from the"
        f" others, {span}"
    )
    mask = mask_remedy(bounds, plural=False)
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
