"""Lines of a scan that stand at different heights, and how they are shifted to each other.

An instrument that traces a surface line by line, as an atomic force microscope does, may lose its
height between two lines. Contact then follows single lines in streaks. Lines run along x here, as
instruments store them: all nodes of a line have the same y.

The median step from each line to the next one tells a lost height from a surface. Successive steps
are alike where the waves of a surface span several lines, also on ground surfaces with grooves
along x. They are independent or opposite where an instrument has lost its height. Steps of a
surface with waves of two lines are independent, too, but they are small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.outliers import TO_DEVIATION
from gen.maps.read import Remedy, Topography

# Smallest share that the median steps of streaky maps have in the mean square difference between
# neighbouring lines. Isotropic surfaces whose steps are independent, because they have waves of two
# nodes, have smaller shares (`pytest tests/gen/maps/test_lines.py -k clean`).
STREAKY = 0.15
# Largest correlation of successive median steps on streaky maps. It is 0 if lines drift, and -0.5
# if their heights are independent.
UNRELATED = 0.2
FEWEST_LINES = 32  # fewest lines, and fewest nodes in a line, of a map that is judged
# Median steps are clipped at this number of standard deviations before their correlation is
# computed, so that one step of the surface does not decide it.
LARGEST_STEP = 5.0


@dataclass(frozen=True)
class LineSteps:
    """The median steps from each line of a map to the next one, as two numbers."""

    # share of their mean square in the mean square difference between neighbouring lines [1]
    share: float
    correlation: float  # correlation of successive steps [1]

    @property
    def are_streaks(self) -> bool:
        """Whether the lines stand at different heights."""
        return self.share > STREAKY and self.correlation < UNRELATED


def steps_of_lines(heights: Heights) -> Values:
    """Compute the median step from each line of a map to the next one.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um]. Lines run along the first axis.

    Returns
    -------
    ndarray, shape (ny,)
        Median difference of the heights of each line and of the last line before it that has
        heights [um]. It is 0 for the first line, and where both lines have no place along x at
        which both have a height.
    """
    measured = ~np.isnan(heights)
    steps = np.zeros(heights.shape[1])
    last = 0
    for line in range(1, steps.size):
        common = measured[:, line] & measured[:, last]
        if common.any():
            steps[line] = np.median(heights[common, line] - heights[common, last])
        if measured[:, line].any():
            last = line
    return steps


def judge_lines(heights: Heights) -> LineSteps:
    """Measure the median steps between the lines of a map.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes, of at least 3 lines [um]. A tilt or a curvature changes nothing.

    Returns
    -------
    LineSteps
        The two numbers. For flat maps, and if more than half of the steps are equal, the share is 0
        and the correlation 1.
    """
    # The straight line is due to the tilt and the curvature of the map.
    steps = without_straight_line(steps_of_lines(heights)[1:])
    differences = np.diff(heights, axis=1)
    mean_square = float(np.mean((differences - differences.mean()) ** 2))
    # The median absolute deviation ignores a few large steps, such as the edge of a terrace.
    deviation = TO_DEVIATION * float(np.median(np.abs(steps - np.median(steps))))
    if deviation == 0.0 or mean_square == 0.0:
        return LineSteps(share=0.0, correlation=1.0)
    limit = LARGEST_STEP * deviation
    limited = np.clip(steps, -limit, limit)
    correlation = np.mean(limited[1:] * limited[:-1]) / np.mean(limited**2)
    return LineSteps(share=deviation**2 / mean_square, correlation=float(correlation))


def with_line_warning(topography: Topography) -> Topography:
    """Add a warning if lines of a map stand at different heights.

    Parameters
    ----------
    topography : Topography
        The map, without holes.

    Returns
    -------
    Topography
        The map, with one more warning if `LineSteps.are_streaks`. Maps with fewer than
        `FEWEST_LINES` nodes along an axis are not judged.
    """
    heights = topography.heights
    if min(heights.shape) < FEWEST_LINES:
        return topography
    steps = judge_lines(heights)
    if not steps.are_streaks:
        return topography
    fault = (
        "its lines along x stand at different heights, so contact follows lines (median steps"
        f" between lines have {100 * steps.share:.2g} % of the mean square slope across them)"
    )
    remedy = Remedy("level lines", "shifts lines by their median differences")
    warning = topography.advised(fault, remedy)
    return replace(topography, warnings=(*topography.warnings, warning))


def shifts_of_lines(heights: Heights) -> Values:
    """Compute the shift of each line of a map that makes its median step to the line before 0.

    The shifts include waves of the surface that run along y alone.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um]. Lines run along the first axis.

    Returns
    -------
    ndarray, shape (ny,)
        Height to subtract from each line; the mean over the lines is 0 [um].
    """
    shifts = np.cumsum(steps_of_lines(heights))
    return np.asarray(shifts - shifts.mean())


def without_straight_line(values: Values) -> Values:
    """Subtract the straight line that is fitted to numbers at equal distances.

    Parameters
    ----------
    values : ndarray, shape (n,)
        At least two numbers, in any unit.

    Returns
    -------
    ndarray, shape (n,)
        The numbers less the line, in the same unit.
    """
    places = np.arange(values.size)
    return np.asarray(values - np.polyval(np.polyfit(places, values, 1), places))
