"""Tests of resampling: exact for what splines hold, without folding where it is coarser."""

import numpy as np
import pytest

from gen.measured.resampling import is_same, resampled
from gen.measured.topography import Topography
from gen.runtime.errors import InputError


def topography(shape, spacing, height, boundary="free"):
    """A map of a function of x and y [um]."""
    x, y = (step * np.arange(nodes) for nodes, step in zip(shape, spacing, strict=True))
    sides = tuple(
        step * (nodes - (boundary == "free")) for nodes, step in zip(shape, spacing, strict=True)
    )
    return Topography("map", height(x[:, None], y[None, :]), sides, (), (), boundary)


def cubic(x, y):
    return 1 + x - 0.5 * y + 0.1 * x * y**2 - 0.02 * x**3


def test_finer_nodes_are_those_of_a_cubic():
    fine = resampled(topography((20, 15), (1.0, 0.8), cubic), (0.3, 0.5))
    assert fine.spacing == pytest.approx((0.3, 0.5), rel=1e-12)
    assert fine.heights.shape == (64, 23)  # within 19 um and 11.2 um
    expected = topography((64, 23), (0.3, 0.5), cubic).heights
    assert fine.heights == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_coarser_nodes_are_means_of_a_cubic_over_their_cells():
    coarse = resampled(topography((41, 41), (1.0, 1.0), cubic), (2.5, 4.0))
    assert coarse.heights.shape == (16, 10)

    def mean(low, high, power):
        return (high ** (power + 1) - low ** (power + 1)) / (power + 1) / (high - low)

    x, y = 2.5 * np.arange(16)[:, None], 4.0 * np.arange(10)[None, :]
    x1, x3 = mean(x, x + 2.5, 1), mean(x, x + 2.5, 3)
    y1, y2 = mean(y, y + 4.0, 1), mean(y, y + 4.0, 2)
    expected = 1 + x1 - 0.5 * y1 + 0.1 * x1 * y2 - 0.02 * x3
    assert coarse.heights == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_short_waves_are_not_folded_back():
    """Little is left of waves of 2.5 old spacings at 5 times the spacing; values would keep all."""
    wave = topography((201, 9), (1.0, 1.0), lambda x, y: np.cos(2 * np.pi * x / 2.5) + 0 * y)
    assert resampled(wave, (5.0, 1.0)).heights.std() < 0.05 * wave.heights.std()


def test_spacings_that_differ_by_rounding_keep_the_nodes():
    given = topography((9, 9), (1.0005, 0.9996), cubic)
    same = resampled(given, (1.0, 1.0))
    assert same.heights is given.heights
    assert same.spacing == (1.0, 1.0)
    assert same.steps == ()
    assert not is_same(1.0, 1.002)


@pytest.mark.parametrize("boundary", ["free", "mirror"])
def test_the_step_is_recorded_and_the_boundary_kept(boundary):
    finer = resampled(topography((9, 9), (1.0, 1.0), cubic, boundary), (0.5, 0.25))
    assert finer.steps == ("resampled to 17 x 33 nodes every 0.5 x 0.25 um by cubic splines",)
    assert finer.boundary == boundary
    assert finer.spacing == pytest.approx((0.5, 0.25), rel=1e-12)


def test_too_few_nodes_are_refused():
    with pytest.raises(InputError, match="3 nodes along an axis, resampling needs 4"):
        resampled(topography((3, 9), (1.0, 1.0), cubic), (0.5, 1.0))
    with pytest.raises(InputError, match="a spacing of 7 um leaves 1 x 1 nodes"):
        resampled(topography((9, 9), (1.0, 1.0), cubic), (7.0, 7.0))
