"""What feature sets are worth: the study on few rows, and its coverage."""

import numpy as np
import pytest

from bench import __main__ as bench
from bench.contents import contents_of, files_of
from bench.files import read_table
from bench.surrogates.features import (
    VARIANTS,
    Judged,
    covered,
    scored,
)

ONES = {each.name: 1.0 for each in VARIANTS}


def judged(name, error, half, seed=0, rows=2000):
    """Test rows with normal relative errors, and intervals of a given relative half width."""
    (variant,) = (each for each in VARIANTS if each.name == name)
    generator = np.random.default_rng(seed)
    truth = generator.uniform(0.1, 16.0, rows)
    predicted = truth * (1 + error * generator.normal(size=rows))
    low, high = predicted / (1 + half), predicted / (1 - half)
    return Judged(variant, seed, 9094, 1010, truth, predicted, low, high)


def test_coverage_is_counted_in_quarters_over_all_seeds():
    right = [judged("hybrid", 0.01, 1.645 * 0.01, seed) for seed in range(3)]
    rows = list(covered(right))
    assert [row["rows"] for row in rows] == [1500] * 4
    assert all(row["holds"] for row in rows)
    assert all(row["covered"] == pytest.approx(0.9, abs=0.03) for row in rows)
    assert rows[0]["slack"] == pytest.approx(3 * np.sqrt(0.09 * (1 / 1500 + 4 / 3030)))
    assert rows[1]["from"] == rows[0]["to"]
    narrow = covered([judged("hybrid", 0.01, 0.01)])
    assert not any(row["holds"] for row in narrow)


def test_a_row_has_intervals_of_its_scores_and_the_ratio_of_nmse_to_r2():
    (row,) = scored([judged("hybrid", 0.05, 0.1)], ONES)
    assert row["nmse_low"] < row["nmse"] < row["nmse_high"]
    assert row["r2_low"] < row["r2"] < row["r2_high"]
    assert row["nmse"] == pytest.approx((100 - row["r2"]) * row["ratio"])
    assert row["small_p95"] == pytest.approx(100 * 1.96 * 0.05, rel=0.3)


def test_the_command_writes_what_the_page_shows(tmp_path, capsys):
    command = ["features", "-o", str(tmp_path), "--features", "dimensionless", "--seeds", "3"]
    assert bench.main([*command, "--surfaces", "2", "--rows", "100"]) == 0
    assert "(1 - R2) times the variance" in capsys.readouterr().out
    _, rows = read_table(tmp_path / "features.csv")
    assert [row["features"] for row in rows] == ["dimensionless"]
    files = {path.name for each in contents_of("features", tmp_path) for path in files_of(each)}
    assert files == {"features.csv", "coverage.csv", "features.png"}
    assert bench.main([*command, "--rows", "50"]) == 2
    assert "--rows 50" in capsys.readouterr().err
