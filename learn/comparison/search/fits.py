"""The work of one task of a search: fit, predict the fold that was left out, score."""

import math
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from sklearn.metrics import r2_score

from learn import memory
from learn.arrays import Values
from learn.comparison.search.pruning import shared_fit
from learn.comparison.search.staged import shared_predictions
from learn.comparison.search.task import Task
from learn.comparison.search.trials import DIVERGED, LEAST_SCORE, Trial
from learn.comparison.training_data import Training
from learn.models import MODELS, REMARK_LENGTH, STEP, pipeline, remarks

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
        One trial for each candidate; none if this machine lacks the memory.
    """
    inside = np.flatnonzero(training.folds != task.fold)[: task.rows]
    outside = training.folds == task.fold
    data = training.inputs[inside], training.target[inside], training.inputs[outside]
    truth = training.target[outside]
    need = memory.needed(task.model, inside.size)
    if need > memory.available():
        return []
    with remarks() as said:
        began = perf_counter()
        fitted = _predictions(training, task, data)
        scores = [_score(truth, each) for each in fitted]
        seconds = (perf_counter() - began) / len(task.candidates)
    remark = "; ".join(said)
    trials = []
    for name, each, score in zip(task.names, fitted, scores, strict=True):
        r2, failure = (None, score) if isinstance(score, str) else (score, "")
        trial = Trial(name, task.fold, task.rows, r2=r2, failure=failure, remark=remark)
        found_nothing = r2 is not None and collapsed(truth, each)
        trials.append(replace(trial, seconds=seconds, collapsed=found_nothing))
    return trials


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
            return [Fitted(np.empty(0), _one_line(error) or type(error).__name__)]
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
    return score if score >= LEAST_SCORE else DIVERGED


def _one_line(message: object) -> str:
    return " ".join(str(message).split())[:REMARK_LENGTH]
