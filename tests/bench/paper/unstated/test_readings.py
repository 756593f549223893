"""Other readings of Table 1: ours are the database's, and each counts what it says."""

import numpy as np
import pytest

from bench.paper.facts import RANGES
from bench.paper.unstated import readings
from bench.paper.unstated.readings import READINGS
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
    for column, (ours, *_) in READINGS.items():
        value = READINGS[column][ours](heights, 1000.0 / 128)
        assert value == pytest.approx(values[column], rel=1e-12)
    rows = list(readings.compare(PAPER, 2))
    assert [row["quantity"] for row in rows if row["ours"]] == list(READINGS)


def test_readings_count_what_they_say() -> None:
    heights = np.array([[9.0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 5, 0], [0, 0, 0, 6.0]])

    def value(column: str, words: str) -> float:
        return READINGS[column][words](heights, 1.0)

    assert value("asperity_mean", "above 4 neighbours") == 5
    assert value("asperity_mean", "above 4 neighbours, at the border too") == 20 / 3
    assert value("asperity_mean", "above 8 neighbours, at the border too") == 7.5
    assert value("asperity_density", "above 8 neighbours") == 0
    assert value("peak_density", "peaks inside profiles") == 2 / 32
    assert value("peak_density", "and at their ends") == 6 / 32
    assert value("peak_mean", "and at their ends") == 20 / 3


def test_bandwidths_do_not_depend_on_units() -> None:
    (heights,) = surfaces(1)
    for bandwidth in READINGS["bandwidth_x"].values():
        value = bandwidth(heights, 7.8)
        assert bandwidth(1e3 * heights, 0.3) == pytest.approx(value, rel=1e-12)


def test_distance_is_measured_in_widths_of_the_papers_range() -> None:
    low, high = RANGES["peak_density"]
    ends = np.array([low, high])
    assert readings.range_distance(ends, "peak_density") == 0
    shifted = ends + (high - low)
    assert readings.range_distance(shifted, "peak_density") == pytest.approx(100)
    with pytest.raises(InputError, match="not in the paper's Table 1"):
        readings.range_distance(ends, "iterations")
