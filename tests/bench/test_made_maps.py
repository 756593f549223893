"""Tests of the made maps: their kinds have the properties that they claim, and files keep them."""

from dataclasses import replace

import numpy as np
import pytest

from bench.made_maps import MAPS, Faults, MadeMap, measured, surface, write
from tests.maps import read

SOME = [made for made in MAPS if made.number in {1, 3}]


def skewness(heights):
    return float(np.mean((heights - heights.mean()) ** 3) / heights.std() ** 3)


def slopes(made, heights):
    return [float(np.diff(heights, axis=k).std() / made.spacing[k]) for k in (0, 1)]


@pytest.mark.parametrize("made", SOME, ids=lambda made: made.name)
def test_a_kind_has_its_lay_and_its_skewness(made):
    heights = surface(made)
    assert heights.std() == pytest.approx(made.rms, rel=1e-12)
    assert not np.array_equal(heights, surface(replace(made, number=made.number + 100)))
    across, along = slopes(made, heights)
    if made.kind in {"turned", "ground"}:
        assert across > 2 * along, "the lay runs along y"
    if made.kind in {"sandblasted", "fractal"}:
        assert across == pytest.approx(along, rel=0.1), "no lay"
    bounds = {
        "turned": (0.3, 0.8),
        "ground": (-0.5, 0.5),
        "sandblasted": (-1.2, -0.3),
        "honed": (-5.0, -1.2),
        "fractal": (-0.3, 0.3),
    }
    low, high = bounds[made.kind]
    assert low < skewness(heights) < high


@pytest.mark.parametrize("suffix", ["x3p", "nc", "gwy"])
def test_files_are_read_as_they_were_written(tmp_path, suffix):
    faults = Faults(spikes=3, holes=4, step=0.2, tilt=(0.01, 0.0))
    made = MadeMap("honed", 7, (40, 30), 0.5, 10.0, (0.5, 0.8), faults, suffix)
    topography = read(write(made, tmp_path))
    assert topography.spacing == pytest.approx(made.spacing, rel=1e-12)
    assert topography.heights == pytest.approx(
        measured(made), rel=1e-9, abs=1e-12, nan_ok=True
    )
