"""The work of one task of a search: fit, predict the fold that was left out, score."""

import math
import warnings
from time import perf_counter

import numpy as np
from sklearn.metrics import r2_score

from learn import memory
from learn.arrays import Values
from learn.comparison.search.pruning import Settings, key, shared_fit
from learn.comparison.search.staged import shared_predictions
from learn.comparison.search.task import Task
from learn.comparison.search.trials import Trial
from learn.comparison.training_data import Training
from learn.models import MODELS, Model, pipeline

REMARK_LENGTH = 300
"""Characters of a warning or an error that are kept."""


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
    with memory.reserved(need), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        began = perf_counter()
        predictions = _predictions(MODELS[task.model], training, task.candidates, data)
        scores = [p if isinstance(p, str) else _score(truth, p) for p in predictions]
        seconds = (perf_counter() - began) / len(task.candidates)
    remark = "; ".join(dict.fromkeys(_one_line(warning.message) for warning in caught))
    trials = []
    for candidate, score in zip(task.candidates, scores, strict=True):
        r2, failure = (None, score) if isinstance(score, str) else (score, "")
        place = key(candidate), task.fold, task.rows
        trials.append(Trial(*place, r2=r2, failure=failure, remark=remark, seconds=seconds))
    return trials


def _predictions(
    model: Model,
    training: Training,
    candidates: tuple[Settings, ...],
    data: tuple[Values, Values, Values],
) -> list[Values | str]:
    """Return the predictions of each candidate, or the reason why there are none."""
    name = shared_fit(model)
    common = {k: v for k, v in candidates[0].items() if k != name}
    try:
        unfitted = pipeline(
            model, common, normalisation=training.normalisation, seed=training.seed, tuned=True
        )
        if name and name in candidates[0]:
            values = [candidate[name] for candidate in candidates]
            return list(shared_predictions(model, unfitted, data, name, values))
        return [unfitted.fit(data[0], data[1]).predict(data[2])]
    except Exception as error:  # whatever a library raises: the candidate has no score
        if len(candidates) == 1:
            return [_one_line(error) or type(error).__name__]
    # A shared fit may fail late, after candidates that are fine: fit them one by one.
    return [_predictions(model, training, (candidate,), data)[0] for candidate in candidates]


def _score(truth: Values, prediction: Values) -> float | str:
    """Return R2, or the reason why there is none."""
    if not np.isfinite(prediction).all():
        return "prediction not finite"
    score = float(r2_score(truth, prediction))
    return score if math.isfinite(score) else "score not finite"


def _one_line(message: object) -> str:
    return " ".join(str(message).split())[:REMARK_LENGTH]
