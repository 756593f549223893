"""The grid search: exact scores of all candidates, each distinct fit done once, on the farm.

The fits are tasks of `gen.runtime.farm`: rank 0 hands them out and keeps what comes back
(`learn.comparison.trials`), so that a killed search goes on where it was. The score of a candidate
is the mean R2 over the folds; ties go to the first in ParameterGrid's order, candidates with a
failed fold come last.
"""

import math
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from sklearn.metrics import r2_score

from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.progress import RunProgress
from learn import memory
from learn.arrays import Values
from learn.comparison.pruning import Grid, Settings, key, shared_fit
from learn.comparison.staged import shared_predictions
from learn.comparison.task import Task, expected_work
from learn.comparison.training_data import Training, held
from learn.comparison.trials import Trial, Trials
from learn.models import MODELS, Model, pipeline
from learn.split import FOLDS

REMARK_LENGTH = 300
"""Characters of a warning or an error that are kept."""


@dataclass(frozen=True)
class Found:
    """Scores of all candidates of a grid.

    Attributes
    ----------
    scores : (candidates, folds that count) R2 of every canonical candidate, NaN where a fit failed
    means : (candidates,) over the folds
    winner : number of the best canonical candidate, -1 if all failed
    fits : fits that the search takes, those of earlier runs included
    seconds : sum of the fits' times [s]
    failures : reasons of failed fits, and how many candidates and folds each concerns
    remarks : warnings of the fits, and how many candidates and folds each concerns
    """

    scores: Values
    means: Values
    winner: int
    fits: int
    seconds: float
    failures: dict[str, int]
    remarks: dict[str, int]


def tasks(
    model: Model,
    grid: Grid,
    numbers: Iterable[int],
    rows: int,
    finished: Trials,
    folds: int = FOLDS,
) -> list[Task]:
    """List the fits that some candidates still lack.

    Parameters
    ----------
    model : from `learn.models`
    grid : its candidates
    numbers : of the canonical candidates wanted, in the order in which they are to be fitted
    rows : training rows at most
    finished : what need not be done again
    folds : so many of them, the first ones

    Returns
    -------
    One task per family and fold, the families in the order of their first candidate
    """
    family_of = {number: place for place, family in enumerate(grid.families) for number in family}
    wanted: dict[int, list[int]] = {}
    for number in numbers:
        wanted.setdefault(family_of[number], []).append(number)
    found = []
    for family in wanted.values():
        for fold in range(folds):
            left = tuple(
                grid.differing[number]
                for number in sorted(family)
                if (key(grid.differing[number]), fold, rows) not in finished.finished
            )
            if left:
                found.append(Task(model.name, left, fold, rows))
    return found


def work_off(
    todo: list[Task],
    trials: Trials | None,
    world: farm.World,
    *,
    stopping: Callable[[], bool] = lambda: False,
    title: str = "",
) -> None:
    """Do the tasks and keep what they give; every process of the world has to call it.

    Parameters
    ----------
    todo : the tasks, on the master; ignored elsewhere
    trials : where results are kept, on the master; None elsewhere
    world : from `gen.runtime.farm`
    stopping : asked on the master before a task is handed out
    title : said before, on the master

    Raises
    ------
    InputError
        On the master, for a full disk, or a machine that lacks the memory.
    """
    if trials is None:
        farm.run(fit, iter(()), _ignore, world)
        return
    work = sum(map(expected_work, todo))
    with RunProgress(len(todo), "fits", work) as progress:
        if title:
            progress.say(title)

        def keep(task: Task, results: list[Trial]) -> None:
            if not results:
                raise InputError(
                    f"{task.model}: a machine lacks the memory for a fit: see --train-rows"
                )
            trials.add(results)
            failed = all(trial.r2 is None for trial in results)
            progress.advance(1, int(failed), expected_work(task))

        farm.run(fit, iter(todo), keep, world, stopping=stopping)


def fit(task: Task) -> list[Trial]:
    """Do one task: fit, predict the fold left out, score; a failure is a result too.

    Returns
    -------
    One trial for each candidate; none if this machine lacks the memory
    """
    training = held()
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
        predicted = _predictions(MODELS[task.model], training, task.candidates, data)
        scored = [each if isinstance(each, str) else _score(truth, each) for each in predicted]
        seconds = (perf_counter() - began) / len(task.candidates)
    remark = "; ".join(dict.fromkeys(_one_line(warning.message) for warning in caught))
    return [
        Trial(
            candidate=key(candidate),
            fold=task.fold,
            rows=task.rows,
            r2=None if isinstance(score, str) else score,
            failure=score if isinstance(score, str) else "",
            remark=remark,
            seconds=seconds,
        )
        for candidate, score in zip(task.candidates, scored, strict=True)
    ]


def _predictions(
    model: Model,
    training: Training,
    candidates: tuple[Settings, ...],
    data: tuple[Values, Values, Values],
) -> list[Values | str]:
    """Predictions of each candidate, or why there are none."""
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
    # A fit that fails late may have had good beginnings: one by one, then.
    return [_predictions(model, training, (candidate,), data)[0] for candidate in candidates]


def _score(truth: Values, prediction: Values) -> float | str:
    if not np.isfinite(prediction).all():
        return "prediction not finite"
    score = float(r2_score(truth, prediction))
    return score if math.isfinite(score) else "score not finite"


def _one_line(message: object) -> str:
    return " ".join(str(message).split())[:REMARK_LENGTH]


def _ignore(task: Task, results: list[Trial]) -> None:
    """Drop results: only the master has any."""


def rank(grid: Grid, trials: Trials, rows: int, folds: int = FOLDS) -> Found:
    """Collect the scores of all candidates.

    Parameters
    ----------
    grid : what was searched
    trials : the finished ones; candidates that lack a fold count as failed
    rows : training rows of the trials that count
    folds : so many of them count, the first ones

    Returns
    -------
    Found
    """
    scores = np.full((len(grid.differing), folds), math.nan)
    failures: dict[str, int] = {}
    remarks: dict[str, int] = {}
    seconds = 0.0
    families = set()
    family_of = {number: place for place, family in enumerate(grid.families) for number in family}
    for number, settings in enumerate(grid.differing):
        for fold in range(folds):
            trial = trials.finished.get((key(settings), fold, rows))
            if trial is None:
                continue
            scores[number, fold] = math.nan if trial.r2 is None else trial.r2
            seconds += trial.seconds
            families.add((family_of[number], fold))
            if trial.failure:
                failures[trial.failure] = failures.get(trial.failure, 0) + 1
            if trial.remark:
                remarks[trial.remark] = remarks.get(trial.remark, 0) + 1
    means = scores.mean(axis=1)
    winner = -1 if np.isnan(means).all() else int(np.nanargmax(means))
    return Found(scores, means, winner, len(families), seconds, failures, remarks)
