"""Fits that fail, or warn, or are refused by the machine's memory."""

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn import memory
from learn.comparison.search.trials import Trials


def test_a_staged_fit_that_fails_late_keeps_its_good_beginnings(searching, monkeypatch):
    from sklearn.ensemble import GradientBoostingRegressor

    whole = GradientBoostingRegressor.fit

    def limited(self, *arguments, **named):
        if self.n_estimators > 5:
            raise ValueError("diverged")
        return whole(self, *arguments, **named)

    monkeypatch.setattr(GradientBoostingRegressor, "fit", limited)
    search = searching("gradient-boost", {"n_estimators": [2, 5, 9]})
    scores = search.exhaustive().scores
    assert np.isfinite(scores.means[:2]).all()
    assert np.isnan(scores.means[2])
    assert scores.failures == {"diverged": 5}
    assert search.grid.first(scores.winner)["n_estimators"] == 5


@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")
def test_a_fit_that_diverges_is_a_failure_that_the_next_run_can_read(searching, trials):
    """Steps of 50 times the gradient: 49 times the residual after each, with other signs."""
    space = {"learning_rate": [0.1, 50.0], "n_estimators": [2, 60]}
    scores = searching("gradient-boost", space).exhaustive().scores
    assert scores.failures == {"prediction diverged": 5}
    assert np.isnan(scores.means).sum() == 1
    trials.__exit__(None, None, None)
    with Trials(trials.path, {}) as again:
        assert again.finished == trials.finished


def test_tiny_alphas_have_scores_and_a_warning_that_is_kept(searching):
    space = {"alpha": [1e-15, 1e-5], "gamma": [1e-5], "kernel": ["rbf"]}
    scores = searching("kernel-ridge", space).exhaustive().scores
    assert np.isfinite(scores.folds).all()
    assert any("condition about" in remark for remark in scores.remarks)


def test_a_machine_without_the_memory_for_a_fit_ends_the_search(searching, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: memory.PROCESS)
    with pytest.raises(InputError, match="svm: too little memory is free for a fit"):
        searching("svm", {"C": [1.0]}).exhaustive()
