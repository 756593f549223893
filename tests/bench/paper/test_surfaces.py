"""The paper's pictures of surfaces show what the generator and the statistics do."""

import numpy as np
import pytest

from bench.paper import surfaces
from gen.statistics import describe


def test_levels_are_one_surface():
    for generator in ("diamond-square", "midpoint"):
        coarse, fine_grid = (surfaces.shown_surface(0.6, generator, cells + 1) for cells in (8, 32))
        offset = fine_grid[::4, ::4] - coarse
        assert np.ptp(offset) < 1e-12


def test_marks_are_what_the_statistics_count():
    heights = surfaces.shown_surface(surfaces.ROUGH)
    values = describe(heights, 1.0).values
    along = [surfaces.above(heights, *each) for each in (surfaces.ALONG, surfaces.ACROSS)]
    assert sum(marks.sum() for marks in along) == round(values["peak_density"] * 2 * heights.size)
    assert heights[along[0] & along[1]].mean() == pytest.approx(values["asperity_mean"])
