"""The ladder of tolerances behind the solver's default."""

from pathlib import Path

import pytest

from bem.problem import RTOL
from bench import default_tolerance
from bench.files import read_table


@pytest.fixture(scope="module")
def report():
    return default_tolerance.default_tolerance(samples=2)


def test_errors_fall_and_convolutions_rise_with_the_tolerance(report):
    rows = report.tables["default-tolerance"]
    assert [row["rtol"] for row in rows] == list(default_tolerance.LADDER)
    assert rows[-1]["largest_force_error"] < 1e-7 < rows[0]["largest_force_error"]
    assert rows[-1]["convolutions"] > rows[0]["convolutions"]


def test_the_default_finds_every_node_of_the_first_samples(report):
    (default,) = (
        row for row in report.tables["default-tolerance"] if row["rtol"] == RTOL
    )
    assert default["right_percent"] == 100
    assert default["largest_miss_nodes"] == 0


@pytest.mark.parametrize(
    ("right_percents", "chosen"),
    [
        ((90, 99.95, 100), "0.01"),
        ((100, 99.5, 100), "0.001"),
        ((100, 100, 99), "none of these"),
    ],
)
def test_the_loosest_is_right_as_are_all_tighter_ones(right_percents, chosen):
    rows = [
        {"rtol": rtol, "right_percent": percent}
        for rtol, percent in zip((0.1, 0.01, 0.001), right_percents, strict=True)
    ]
    assert default_tolerance._loosest_right(rows) == chosen


def test_the_published_ladder_supports_the_default():
    folder = Path(default_tolerance.__file__).parent / "results/default-tolerance"
    _, lines = read_table(folder / "default-tolerance.csv")
    rows = [{name: float(value) for name, value in line.items()} for line in lines]
    assert default_tolerance._loosest_right(rows) == f"{RTOL:g}"
