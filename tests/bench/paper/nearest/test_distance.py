"""The distance from the paper's tables is 0 for the paper's own numbers, and counts as it says."""

import math

import numpy as np
import pytest

from bench.paper.facts import RANGES
from bench.paper.nearest.distance import QUANTITIES, distance, of_table_1, of_table_4
from learn.comparison import paper
from learn.metrics import Scores

BASELINES = paper.TEST["baseline"]
COLUMNS = {name: np.array(RANGES[name]) for name in QUANTITIES}


def test_the_papers_numbers_are_at_no_distance() -> None:
    assert distance(COLUMNS, BASELINES) == 0
    assert len(QUANTITIES) == 23


def test_ranges_count_in_their_widths() -> None:
    shifted = {name: ends + np.ptp(ends) for name, ends in COLUMNS.items()}
    assert of_table_1(shifted) == pytest.approx(1)
    low, high = RANGES["hurst"]
    half = COLUMNS | {"hurst": np.array([low, (low + high) / 2])}
    assert of_table_1(half) == pytest.approx(0.25 / len(QUANTITIES))


def test_errors_count_by_their_ratios_both_ways() -> None:
    for factor in (math.e, 1 / math.e):
        scores = {
            name: Scores(
                factor * own.nmse,
                factor * own.nmae,
                factor * own.nmaxe,
                100 - factor * (100 - own.r2),
            )
            for name, own in BASELINES.items()
        }
        assert of_table_4(scores) == pytest.approx(1)
        one = {"mlp": scores["mlp"]}
        assert distance(COLUMNS, one) == pytest.approx(1)
