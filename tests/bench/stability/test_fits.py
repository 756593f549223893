"""Proof that the checks of models can fail."""

from dataclasses import replace
from typing import Any

import numpy as np

from bench.stability import fits
from bench.stability.case import cases_of
from bench.stability.fits import optimal
from bench.stability.fitted import Asked, fitted, ordinary
from learn.models import MODELS


def test_all_models_are_asked() -> None:
    families = {kind.family for kind in fits.KINDS if len(kind.models) == len(MODELS)}
    cases = cases_of("models")
    for family in families:
        titles = {case.name for case in cases if case.family == f"models: {family}"}
        assert titles == {model.title for model in MODELS.values()}
    assert {"constant target", "constant column", "collinear columns", "a row of zeros"} <= families
    assert {"duplicated rows", "few rows", "far outside", "single precision"} <= families


def asked(name: str, way: str = "default") -> Asked:
    return fitted(name, way, ordinary())


def spoilt(fit: Asked, **attributes: Any) -> Asked:
    """The same fit with attributes of its estimator changed."""
    for name, value in attributes.items():
        setattr(fit.estimator, name, value)
    return fit


def passed(fit: Asked) -> bool:
    return all(finding.passed for finding in optimal(fit))


def test_wrong_coefficients_fail() -> None:
    for name, attribute in (("kernel-ridge", "dual_coef_"), ("gaussian-process", "alpha_")):
        fit = asked(name)
        assert passed(fit)
        coefficients = getattr(fit.estimator, attribute).copy()
        coefficients[3] *= 1 + 1e-6
        assert not passed(spoilt(fit, **{attribute: coefficients}))


def test_wrong_support_vectors_fail() -> None:
    fit = asked("svm", "tuned")
    assert passed(fit)
    assert not passed(spoilt(fit, C=fit.estimator.C / 1e6))


def test_targets_that_a_tree_has_not_seen_fail() -> None:
    fit = asked("decision-tree")
    assert passed(fit)
    other = replace(fit.train, target=fit.train.target * 1.0001)
    assert not passed(replace(fit, train=other))
    boosted = asked("gradient-boost")
    assert passed(boosted)
    assert not passed(replace(boosted, train=other))


def test_an_unflagged_row_fails() -> None:
    fit = asked("kernel-ridge", "tuned")
    assert all(finding.passed for finding in fits.flagged(fit))
    low, high = fit.surrogate.low - np.inf, fit.surrogate.high + np.inf
    near = replace(fit.surrogate.distance, limit=np.inf)
    wide = replace(fit.surrogate, low=low, high=high, distance=near)
    found = list(fits.flagged(replace(fit, surrogate=wide)))
    assert any(not finding.passed for finding in found)


def test_silent_nonsense_fails() -> None:
    fit = asked("decision-tree")
    other = replace(fit, train=replace(fit.train, target=fit.train.target[::-1]))
    assert [f.what for f in fits.sound(other) if not f.passed] == ["worse than a constant, unsaid"]
