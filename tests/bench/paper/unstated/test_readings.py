"""Other readings of Table 1: ours are the database's, and each counts what it says."""

import numpy as np
import pytest

from bench.paper.facts import RANGES
from bench.paper.unstated import readings
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from gen.scene import load
from gen.statistics import describe

PAPER = load("paper")


def surfaces(count: int) -> list[np.ndarray]:
    plan = parameters(PAPER, 0, count)
    return [surface_of(PAPER, plan, row) for row in range(count)]


def test_our_readings_are_those_of_the_database() -> None:
    (heights,) = surfaces(1)
    values = describe(heights, 1000.0 / 128).values
    ours = [reading for reading in readings.READINGS if reading.ours]
    assert {reading.column for reading in ours} == {r.column for r in readings.READINGS}
    for reading in ours:
        assert reading.value(heights, 1000.0 / 128) == pytest.approx(
            values[reading.column], rel=1e-12
        )


def test_readings_count_what_they_say() -> None:
    heights = np.array([[9.0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 5, 0], [0, 0, 0, 6.0]])
    assert readings.asperity_mean(heights, 1.0, neighbours=4, border=False) == 5
    assert readings.asperity_mean(heights, 1.0, neighbours=4, border=True) == 20 / 3
    assert readings.asperity_mean(heights, 1.0, neighbours=8, border=True) == 7.5
    assert readings.asperity_density(heights, 1.0, neighbours=8, border=False) == 0
    assert readings.peak_density(heights, 1.0, border=False) == 2 / 32
    assert readings.peak_density(heights, 1.0, border=True) == 6 / 32
    assert readings.peak_mean(heights, 1.0, border=True) == 20 / 3


def test_bandwidths_do_not_depend_on_units() -> None:
    (heights,) = surfaces(1)
    for reading in readings.READINGS:
        if reading.column == "bandwidth_x":
            value = reading.value(heights, 7.8)
            assert reading.value(1e3 * heights, 0.3) == pytest.approx(value, rel=1e-12)


def test_distance_is_measured_in_widths_of_the_papers_range() -> None:
    low, high = RANGES["peak_density"]
    ends = np.array([low, high])
    assert readings.range_distance(ends, "peak_density") == 0
    shifted = ends + (high - low)
    assert readings.range_distance(shifted, "peak_density") == pytest.approx(100)
    with pytest.raises(InputError, match="not in the paper's Table 1"):
        readings.range_distance(ends, "iterations")
