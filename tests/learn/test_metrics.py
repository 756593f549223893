"""Scores against the formulas of section 3.4, written out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from learn.metrics import bootstrap, scores, spread

pairs = st.lists(
    st.tuples(st.floats(0.01, 60), st.floats(-9, 9, allow_subnormal=False)),
    min_size=2,
    max_size=30,
)


@given(pairs)
def test_scores_are_the_papers_formulas(drawn):
    truth = np.array([*(true for true, _ in drawn), 61.0])
    prediction = truth + np.array([*(error for _, error in drawn), 0.5])
    error = truth - prediction
    found = scores(truth, prediction)
    assert found.nmse == pytest.approx(100 * (error**2).mean() / truth.mean(), rel=1e-12)
    assert found.nmae == pytest.approx(100 * abs(error).mean() / truth.mean(), rel=1e-12)
    assert found.nmaxe == pytest.approx(100 * abs(error).max() / truth.max(), rel=1e-12)
    spread = ((truth - truth.mean()) ** 2).sum()
    assert found.r2 == pytest.approx(
        100 * (1 - (error**2).sum() / spread), rel=1e-9, abs=1e-9
    )


@pytest.mark.parametrize(
    ("truth", "prediction"),
    [([1, 2], [1, 2, 3]), ([1], [1]), ([2, 2], [1, 3]), ([1, np.nan], [1, 1])],
)
def test_undefined_scores_are_refused(truth, prediction):
    with pytest.raises(ValueError, match=r"."):
        scores(truth, prediction)


def test_bootstrap_intervals_hold_the_score_of_other_rows_as_often_as_they_say():
    generator = np.random.default_rng(5)
    inside, trials = 0, 30
    for _ in range(trials):
        truth = generator.uniform(1.0, 9.0, 100)
        low, high = bootstrap(truth, truth + generator.normal(size=100))["nmse"]
        inside += low <= 100 * 1.0 / 5.0 <= high
    assert inside / trials == pytest.approx(0.9, abs=0.15)


@pytest.fixture
def truth():
    return np.random.default_rng(5).uniform(1.0, 9.0, 100)


def test_a_larger_level_has_a_wider_interval(truth):
    wide = bootstrap(truth, truth + 0.1, 0.99)["nmae"]
    narrow = bootstrap(truth, truth + 0.1, 0.5)["nmae"]
    assert wide.low < narrow.low < narrow.high < wide.high


def test_predictions_without_error_have_no_interval(truth):
    assert bootstrap(truth, truth)["r2"] == (100.0, 100.0)


def test_rows_of_a_single_group_have_no_intervals(truth):
    assert bootstrap(truth, truth + 0.1, groups=np.zeros(100)) == {}


@pytest.mark.long
def test_rows_of_one_group_are_drawn_together():
    """Forty surfaces of eight rows whose errors are alike: rows drawn alone promise too much."""
    generator = np.random.default_rng(6)
    inside = {"groups": 0, "rows": 0}
    trials, groups = 60, np.repeat(np.arange(40), 8)
    for _ in range(trials):
        truth = generator.uniform(1.0, 9.0, groups.size)
        prediction = truth + generator.normal(size=40)[groups]
        for name, each in (("groups", groups), ("rows", None)):
            low, high = bootstrap(truth, prediction, groups=each)["nmse"]
            inside[name] += low <= 100 * 1.0 / 5.0 <= high
    assert inside["groups"] / trials == pytest.approx(0.87, abs=0.1)
    assert inside["rows"] < 0.65 * trials


@pytest.mark.parametrize("sign", [-1.0, (-1.0) ** np.arange(40)])
def test_errors_are_divided_by_the_mean_magnitude(sign):
    """So that a negative target has no negative error, and one of mean 0 has a finite error."""
    random = np.random.default_rng(1)
    truth, error = random.uniform(1, 2, 40), random.normal(size=40)
    wanted = scores(truth, truth + sign * error)
    found = scores(sign * truth, sign * truth + error)
    assert (found.nmse, found.nmae, found.nmaxe) == pytest.approx(
        (wanted.nmse, wanted.nmae, wanted.nmaxe)
    )
    low, high = bootstrap(sign * truth, sign * truth + error)["nmae"]
    assert 0 < low < found.nmae < high
    assert spread(sign * truth) > 0
