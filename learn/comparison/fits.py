"""One fit of a search, which serves many candidates: fit, predict the fold left out, score.

A fit with the largest number of estimators contains all smaller ones: its first k trees are the
model with k trees, to the last bit (`tests/learn/comparison/test_fits.py`). One kernel matrix
serves every alpha of kernel ridge.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from sklearn.metrics import r2_score

from gen.runtime.errors import InputError
from learn import kernel_ridge, memory
from learn.arrays import Values
from learn.comparison.grid import Task, shared_fit
from learn.comparison.training import Training
from learn.comparison.trials import LEAST_SCORE, Trial
from learn.models import MODELS, REMARK_LENGTH, STEP, Model, pipeline, remarks

ALIKE = 1e-3
"""Predictions are alike if their deviation is below this share of the truth's."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """The predictions of a fit.

    Attributes
    ----------
    prediction : ndarray, shape (m,)
        Predictions of the rows that were left out, empty if there are none.
    failure : str
        The reason why there are none.
    at_bound : bool
        Whether the likelihood that chose the kernel is largest at an end of the kernel's range.
    """

    prediction: Values
    failure: str = ""
    at_bound: bool = False


def fit(training: Training, task: Task) -> list[Trial]:
    """Fit the candidates of a task and score them on the fold that was left out.

    A fit that fails is a result too: its trials have no score, but the reason.

    Parameters
    ----------
    training : Training
        The data of the search.
    task : Task
        The candidates and the fold.

    Returns
    -------
    list of Trial
        One trial for each candidate.

    Raises
    ------
    InputError
        If this machine lacks the memory.
    """
    inside = np.flatnonzero(training.folds != task.fold)[: task.rows]
    outside = training.folds == task.fold
    data = training.inputs[inside], training.target[inside], training.inputs[outside]
    truth = training.target[outside]
    if memory.needed(task.model, inside.size) > memory.available():
        raise InputError(
            f"{task.model}: too little memory is free for a fit: give fewer workers, or"
            " --train-rows"
        )
    with remarks() as said:
        began = perf_counter()
        fitted = _predictions(training, task, data)
        scores = [_score(truth, each) for each in fitted]
        seconds = (perf_counter() - began) / len(task.candidates)
    remark = "; ".join(said)
    return [
        Trial(
            candidate=name,
            fold=task.fold,
            rows=task.rows,
            r2=None if isinstance(score, str) else score,
            failure=score if isinstance(score, str) else "",
            remark=remark,
            seconds=seconds,
            collapsed=not isinstance(score, str) and collapsed(truth, each),
        )
        for name, each, score in zip(task.names, fitted, scores, strict=True)
    ]


def collapsed(truth: Values, fitted: Fitted) -> bool:
    """Tell whether a fit found nothing in its rows.

    The likelihood that chose its kernel is largest at an end of the kernel's range, or all its
    predictions are alike. Both come of too few rows: with more of them the same candidate may win.

    Parameters
    ----------
    truth : ndarray, shape (m,)
        Target of the rows that were left out.
    fitted : Fitted
        Predictions of these rows, all finite.
    """
    return fitted.at_bound or float(np.std(fitted.prediction)) < ALIKE * float(np.std(truth))


def _predictions(
    training: Training, task: Task, data: tuple[Values, Values, Values]
) -> list[Fitted]:
    """Return the predictions of each candidate, or the reason why there are none."""
    model, candidates = MODELS[task.model], task.candidates
    name = "" if task.baseline else shared_fit(model)
    common = {k: v for k, v in candidates[0].items() if k != name}
    build = partial(pipeline, normalisation=training.normalisation, seed=training.seed)
    try:
        unfitted = build(model, common, tuned=not task.baseline)
        if name and name in candidates[0]:
            values = [candidate[name] for candidate in candidates]
            return [*map(Fitted, shared_predictions(model, unfitted, data, name, values))]
        fitted = unfitted.fit(data[0], data[1])
        return [Fitted(fitted.predict(data[2]), at_bound=_at_bound(fitted.named_steps[STEP]))]
    except Exception as error:  # whatever a library raises: the candidate has no score
        if len(candidates) == 1:
            said = " ".join(str(error).split())[:REMARK_LENGTH]
            return [Fitted(np.empty(0), said or type(error).__name__)]
    # A shared fit may fail late, after candidates that are fine: fit them one by one.
    alone = (replace(task, candidates=(candidate,)) for candidate in candidates)
    return [_predictions(training, each, data)[0] for each in alone]


def _at_bound(estimator: Any) -> bool:
    """Whether the likelihood that chose a kernel is largest at an end of the kernel's range."""
    kernel = getattr(estimator, "kernel_", None)
    if kernel is None or estimator.optimizer is None:
        return False
    return bool(np.isclose(kernel.bounds, kernel.theta[:, np.newaxis]).any())


def _score(truth: Values, fitted: Fitted) -> float | str:
    """Return R2, or the reason why there is none."""
    if fitted.failure:
        return fitted.failure
    if not np.isfinite(fitted.prediction).all():
        return "prediction not finite"
    with np.errstate(over="ignore"):  # squares of diverged predictions
        score = float(r2_score(truth, fitted.prediction))
    if not math.isfinite(score):
        return "score not finite"
    return score if score >= LEAST_SCORE else "prediction diverged"


def shared_predictions(
    model: Model,
    pipeline: Any,
    data: tuple[Values, Values, Values],
    name: str,
    values: Sequence[Any],
) -> list[Values]:
    """Predict with every value of the setting that one fit serves.

    Parameters
    ----------
    model : Model
        The model.
    pipeline : sklearn.pipeline.Pipeline
        Unfitted, with all other settings.
    data : tuple of ndarray
        Training inputs (n, d) and target (n,), test inputs (m, d).
    name : str
        The setting that one fit serves.
    values : sequence
        Its values.

    Returns
    -------
    list of ndarray, shape (m,)
        Predictions for each value.
    """
    train, target, test = data
    scaling, estimator = pipeline.named_steps["scaling"], pipeline.named_steps[STEP]
    if scaling != "passthrough":
        train = scaling.fit_transform(train)
        test = scaling.transform(test)
    if model.name == "kernel-ridge":
        settings = {key: value for key, value in estimator.get_params().items() if key != name}
        return kernel_ridge.predictions(train, target, test, settings, values)
    estimator.set_params(**{name: max(values)}).fit(train, target)
    numbers = sorted(set(values))
    predictions = _PREFIXES[model.name](estimator, test, numbers)
    wanted = dict(zip(numbers, predictions, strict=True))
    return [wanted[value] for value in values]


def _forest(estimator: Any, test: Values, numbers: Sequence[int]) -> Iterator[Values]:
    """Yield running means over the trees, added up in the forest's own order."""
    rows = np.asarray(test, dtype=np.float32)
    total, wanted = np.zeros(len(rows)), set(numbers)
    for number, tree in enumerate(estimator.estimators_, start=1):
        total += tree.predict(rows, check_input=False)
        if number in wanted:
            yield total / number


def _ada_boost(estimator: Any, test: Values, numbers: Sequence[int]) -> Iterator[Values]:
    """Yield weighted medians over the first trees, as `AdaBoostRegressor.predict` takes them.

    Its own `staged_predict` computes every tree's predictions again for every stage. Boosting may
    end early: larger numbers are then the same model.
    """
    of_trees = np.array([tree.predict(test) for tree in estimator.estimators_]).T
    for number in numbers:
        first = of_trees[:, :number]
        order = np.argsort(first, axis=1)
        share = np.cumsum(estimator.estimator_weights_[order], axis=1)
        middle = (share >= 0.5 * share[:, -1:]).argmax(axis=1)
        rows = np.arange(len(first))
        yield first[rows, order[rows, middle]]


def _gradient_boost(estimator: Any, test: Values, numbers: Sequence[int]) -> Iterator[Values]:
    wanted = set(numbers)
    for number, predicted in enumerate(estimator.staged_predict(test), start=1):
        if number in wanted:
            yield predicted.copy()


def _xgboost(estimator: Any, test: Values, numbers: Sequence[int]) -> Iterator[Values]:
    for number in numbers:
        yield estimator.predict(test, iteration_range=(0, number))


_PREFIXES = {
    "random-forest": _forest,
    "adaboost": _ada_boost,
    "gradient-boost": _gradient_boost,
    "xgboost": _xgboost,
}
