"""Tests of the made maps: their kinds have the properties that they claim, and files keep them."""

from dataclasses import replace

import numpy as np
import pytest

from bench.made_maps import MAPS, Faults, MadeMap, measured, surface, write
from tests.maps import read

EXAMPLES = [example for example in MAPS if example.number in {1, 3}]


def skewness(heights):
    return float(np.mean((heights - heights.mean()) ** 3) / heights.std() ** 3)


def slopes(description, heights):
    """Rms slopes along x, across the lay if there is one, and along y."""
    return [
        float(np.diff(heights, axis=axis).std() / description.spacing[axis])
        for axis in (0, 1)
    ]


BOUNDS = {
    "turned": (0.3, 0.8),
    "ground": (-0.5, 0.5),
    "sandblasted": (-1.2, -0.3),
    "honed": (-5.0, -1.2),
    "fractal": (-0.3, 0.3),
}
"""Bounds of the skewness of each kind."""


@pytest.fixture(scope="module", params=EXAMPLES, ids=lambda example: example.name)
def made(request):
    """The description of a map, and its surface."""
    return request.param, surface(request.param)


def test_a_map_has_its_rms_height(made):
    description, heights = made
    assert heights.std() == pytest.approx(description.rms, rel=1e-12)


def test_maps_of_other_numbers_are_other_maps(made):
    description, heights = made
    other = replace(description, number=description.number + 100)
    assert not np.array_equal(heights, surface(other))


def test_turned_and_ground_maps_have_a_lay_along_y(made):
    description, heights = made
    across, along = slopes(description, heights)
    if description.kind in {"turned", "ground"}:
        assert across > 2 * along
    if description.kind in {"sandblasted", "fractal"}:
        assert across == pytest.approx(along, rel=0.1)


def test_a_kind_has_its_skewness(made):
    description, heights = made
    low, high = BOUNDS[description.kind]
    assert low < skewness(heights) < high


@pytest.mark.parametrize("suffix", ["x3p", "nc", "gwy"])
def test_files_are_read_as_they_were_written(tmp_path, suffix):
    faults = Faults(spikes=3, holes=4, step=0.2, tilt=(0.01, 0.0))
    description = MadeMap("honed", 7, (40, 30), 0.5, 10.0, (0.5, 0.8), faults, suffix)
    topography = read(write(description, tmp_path))
    assert topography.spacing == pytest.approx(description.spacing, rel=1e-12)
    assert topography.heights == pytest.approx(
        measured(description), rel=1e-9, abs=1e-12, nan_ok=True
    )
