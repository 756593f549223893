"""The worth of feature sets: what is counted, and what a small study finds."""

from itertools import pairwise

import numpy as np
import pytest

from bench.report import part_of
from bench.surrogates import features as study
from bench.surrogates.features import Judged, features
from gen.runtime.errors import InputError


def judged(truth, predicted, half_width):
    """Test rows with intervals about the predictions."""
    predicted = np.array(predicted)
    return Judged(
        trained=4 * len(truth),
        truth=np.array(truth),
        predicted=predicted,
        low=predicted - half_width,
        high=predicted + half_width,
    )


def test_errors_of_small_areas_are_relative_ones():
    rows = judged([0.1, 0.2, 0.4, 5.0], [0.11, 0.24, 0.52, 50.0], half_width=0.05)
    assert rows.of_small_areas(0.5) == pytest.approx(20.0)
    assert rows.of_small_areas(1.0) == pytest.approx(30.0)
    assert rows.inside.tolist() == [1, 1, 0, 0]
    assert np.isnan(judged([1.0], [1.0], half_width=1.0).of_small_areas(0.5))


def test_quarters_have_equally_many_rows_and_rise():
    truth = np.random.default_rng(0).uniform(0, 16, 41)
    rows = judged(truth, truth + 0.1, half_width=0.2)
    quarters = list(study._rows_of_quarters({study.VARIANTS[0]: rows}))
    assert [quarter["rows"] for quarter in quarters] == [11, 10, 10, 10]
    assert all(lower["to"] <= higher["from"] for lower, higher in pairwise(quarters))
    assert all(quarter["covered"] == 1 for quarter in quarters)
    assert [quarter["width"] for quarter in quarters] == pytest.approx([0.4] * 4)


@pytest.mark.parametrize(("rows", "seeds"), [(99, [0]), (200, [])])
def test_too_few_rows_or_seeds_are_refused(rows, seeds, tmp_path):
    with pytest.raises(InputError, match=r"give 100 rows and one seed or more"):
        features(tmp_path, rows, seeds, 2)
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_a_small_study_has_every_set_and_target(tmp_path):
    report = features(tmp_path, 160, [0], 2)
    errors = {row["features"]: row["nmae"] for row in report.tables["features"]}
    assert list(errors) == [variant.name for variant in study.VARIANTS]
    assert errors["hybrid"] < errors["dimensionless"]
    assert [row["target"] for row in report.tables["yielding"]] == list(study.TARGETS)
    assert all(row["r2"] > 90 for row in report.tables["yielding"])
    paths = report.write(tmp_path / "written", part_of("features").contents)
    assert [path.name for path in paths] == [
        "features.csv",
        "quarters.csv",
        "errors.csv",
        "yielding.csv",
        "features.png",
    ]
