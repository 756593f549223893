"""Proof that the checks of models can fail."""

from dataclasses import replace

import numpy as np

from bench.stability import models
from bench.stability.case import cases_of
from bench.stability.models import Asked, fitted, ordinary, solves_its_equations
from learn.models import MODELS


def test_all_models_are_asked() -> None:
    families = {kind.family for kind in models.KINDS if len(kind.models) == len(MODELS)}
    for family in families:
        titles = {case.name for case in cases_of("models") if case.family == f"models: {family}"}
        assert titles == {model.title for model in MODELS.values()}
    assert {"constant target", "collinear columns", "few rows", "far outside"} <= families


def asked(name: str, way: str = "default") -> Asked:
    return fitted(name, way, ordinary())


def test_wrong_coefficients_fail() -> None:
    fit = asked("kernel-ridge")
    assert all(finding.passed for finding in solves_its_equations(fit))
    fit.estimator.dual_coef_ = fit.estimator.dual_coef_ * (1 + 1e-6)
    assert not all(finding.passed for finding in solves_its_equations(fit))


def test_an_unflagged_row_fails() -> None:
    fit = asked("kernel-ridge", "tuned")
    assert all(finding.passed for finding in models.flagged(fit))
    low, high = fit.surrogate.low - np.inf, fit.surrogate.high + np.inf
    near = replace(fit.surrogate.distance, limit=np.inf)
    wide = replace(fit.surrogate, low=low, high=high, distance=near)
    found = list(models.flagged(replace(fit, surrogate=wide)))
    assert any(not finding.passed for finding in found)


def test_silent_nonsense_fails() -> None:
    fit = asked("decision-tree")
    other = replace(fit, train=replace(fit.train, target=fit.train.target[::-1]))
    assert [f.what for f in models.sound(other) if not f.passed] == [
        "worse than a constant, unsaid"
    ]
