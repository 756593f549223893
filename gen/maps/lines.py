"""Lines of a scan that stand at different heights, and how they are shifted to each other.

An instrument that traces a surface line by line, as an atomic force microscope does, may lose its
height between two lines. Contact then follows single lines in streaks. Lines run along x here, as
instruments store them: all nodes of a line have the same y.

Median steps between neighbouring lines tell both: their size, and whether they go on. Steps of
neighbouring pairs of lines are alike where waves of the surface are long, even on ground surfaces
with grooves along x. They are independent or opposite where an instrument has lost its height.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.outliers import TO_DEVIATION
from gen.maps.read import Remedy, Topography

# Smallest share of the mean square difference between neighbouring lines that the median steps of
# streaky maps have. Made isotropic surfaces of 64 x 64 nodes, with waves down to two nodes, have
# 0.06; 15 % of the mean square slope across the lines are some 4 % of the area of contact.
STREAKY = 0.15
# Largest correlation of successive median steps on streaky maps: 0 for lines that drift, -0.5 for
# lines that are off independently. Directional made surfaces have 0.35 and more.
UNRELATED = 0.2
FEWEST_LINES = 32  # lines and nodes in a line of a map that is judged
# Median steps count with at most this many standard deviations for their correlation.
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
        heights [um]; 0 for the first line, and for lines that have no node in common with it.
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
        The two numbers. The share is 0 for flat maps, and where most steps are alike.
    """
    # The straight line is due to the tilt and the curvature of the map.
    steps = without_straight_line(steps_of_lines(heights)[1:])
    differences = np.diff(heights, axis=1)
    mean_square = float(np.mean((differences - differences.mean()) ** 2))
    # The median ignores the edges of a few steps of the surface.
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
    """Compute the heights by which the lines of a map are off each other.

    Waves of the surface that run along y alone are part of them.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um]. Lines run along the first axis.

    Returns
    -------
    ndarray, shape (ny,)
        Height of each line, of zero mean [um]. Without them all median steps between lines are 0.
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
        The rest, in the same unit.
    """
    places = np.arange(values.size)
    return np.asarray(values - np.polyval(np.polyfit(places, values, 1), places))
