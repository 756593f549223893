"""The jobs `compare` and `tune`: fit the baselines of models, or search grids and fit the winners.

A job runs on the master. It reads as if there were one process: the executor (`learn.executor`)
does its fits on the workers. The times of a search are taken while other fits run beside them,
those of the last fits while the other processes wait.

`open_targets` reads the rows and opens the folder of each target. `fit_and_time` makes the scores
and times of the paper's Table 4, and `learn.comparison.search` those of its Table 3.
"""

import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from gen.arrays import Values
from gen.runtime.farm import Interruption
from gen.runtime.files import inside
from gen.runtime.terminal import RunProgress, echo
from learn import dataset, split
from learn.comparison import grid as grids
from learn.comparison.fits import Training, Trials, reason
from learn.comparison.folder import Folder, SearchReport
from learn.comparison.grid import SettingValues
from learn.comparison.search import GridSearch
from learn.comparison.tables import WHY_BASELINE
from learn.database_rows import Dataset
from learn.dataset import Request, short_name
from learn.executor import Ended, Executor
from learn.metrics import Scores, scores
from learn.models import (
    EVERY,
    STEP,
    Model,
    check_memory,
    models_named,
    remarks,
    scaling_of,
)
from learn.split import FOLDS, Split


@dataclass(frozen=True)
class Repetitions:
    """How often an action is repeated for the median of its times."""

    fewest: int  # unless the action takes too long
    most: int


FITS = Repetitions(3, 7)
TEST_PREDICTIONS = Repetitions(3, 9)  # predictions of the whole test set
ROW_PREDICTIONS = Repetitions(5, 99)  # predictions of one row
ENOUGH = 5.0  # seconds after which the fewest repetitions are enough
TOO_LONG = 300.0  # seconds after which no further repetition is begun

CHOSEN_BY_FIT = {"kernel": "kernel_", "iterations": "n_iter_"}
"""Attributes of fitted estimators that a result reports, by their key in its file."""

note = partial(echo, err=True)  # print a line for the user on standard error


@dataclass(frozen=True)
class TimedFit:
    """A model to fit to all training rows."""

    model: str
    settings: SettingValues = field(default_factory=dict)  # on top of the baseline's
    kind: str = "baseline"  # one of `learn.comparison.folder.KINDS`
    of_grid: bool = False  # whether it has what all candidates of a grid share
    until: float = math.inf  # time of `time.time` at which the fit is stopped [s]
    search: SearchReport | None = None  # report of the search that it has won
    search_seconds: float = 0.0  # time of all fits of this search [s]


@dataclass(frozen=True)
class FitTimes:
    """Times of a fit and its predictions on one thread [s]; None where the fit has failed."""

    fit: float | None = None  # median of the fits
    fits: int = 0  # number of the fits
    test: float | None = None  # of predicting the whole test set, a median
    row: float | None = None  # of predicting one row, a median


@dataclass(frozen=True, eq=False)
class MeasuredFit:
    """Scores and times of a model that was fitted to all training rows."""

    prediction: (
        Values  # of the test rows, (m,), in the target's unit; empty if the fit failed
    )
    fitted: dict[
        str, str
    ]  # what the fit has chosen itself, by the keys of `CHOSEN_BY_FIT`
    test: Scores | None  # None if the fit failed
    train: Scores | None
    failure: str  # why there are no scores
    times: FitTimes
    remarks: list[str]  # warnings of the fit


@dataclass(frozen=True, eq=False)
class Target:
    """One target of a comparison: its folder and its rows."""

    folder: Folder
    training: Training


def compare(request: Request, executor: Executor) -> int:
    """Fit, score and time the baselines of the requested models, and write and print the results.

    Results that the folder has already are not made again, unless the request says so.

    Parameters
    ----------
    request : Request
        Database, output folder, models and choices.
    executor : Executor
        Workers that do the fits, one at a time.

    Returns
    -------
    int
        Number of the signal that stopped the job, 0 if none did.

    Raises
    ------
    InputError
        If the database cannot be used, or this machine lacks the memory.
    """
    models = models_named(list(request.models), request.features)
    tasks = _baselines(models, request.features)
    with Interruption(listening=True) as interruption:
        for target in open_targets(request, models, executor, interruption.requested):
            with RunProgress(len(tasks), "models") as progress:
                for task in tasks:
                    if interruption.requested():
                        break
                    if request.again or _lacks_result(target, task):
                        _measure(target, task, executor, progress.say)
                    progress.advance(1)
    return interruption.signal


def _lacks_result(target: Target, task: TimedFit) -> bool:
    """Return whether a folder has no result of a fit; a damaged one raises InputError."""
    return target.folder.result(task.kind, task.model) is None


def _baselines(models: list[Model], features: str) -> list[TimedFit]:
    """Return the baselines of all models, then the models with their libraries' own settings."""
    tasks = [
        TimedFit(model.name, grids.baseline(model.name, features)) for model in models
    ]
    names = [model.name for model in models if model.name in grids.LIBRARY]
    libraries = [TimedFit(name, grids.LIBRARY[name], "library") for name in names]
    return tasks + libraries


def _measure(
    target: Target, task: TimedFit, executor: Executor, say: Callable[[str], None]
) -> None:
    """Fit and time a baseline on a worker, and write and print its result."""
    training = target.training
    if task.kind == "library":
        training = training.first(grids.LIBRARY_ROWS)
    result = executor.call(fit_and_time, training, task)
    write_fit(target.folder, task, training, result, say)


def tune(request: Request, executor: Executor) -> int:
    """Search the models' grids; fit, score and time the winners; write and print the results.

    Where no candidate is better than a baseline, the baseline is the winner. Finished fits are kept
    in the folder: the same call goes on with those that lack.

    Parameters
    ----------
    request : Request
        Database, output folder, models and choices; `until` ends the job.
    executor : Executor
        Workers that do the fits.

    Returns
    -------
    int
        Number of the signal that stopped the job, 0 if none did.

    Raises
    ------
    InputError
        If the database cannot be used, or a machine lacks the memory.
    """
    models = models_named(list(request.models), request.features)
    with Interruption(listening=True) as interruption:
        stopping = interruption.requested
        targets = [*open_targets(request, models, executor, stopping, searched=True)]
        searches = [(target, model) for target in targets for model in models]
        for number, (target, model) in enumerate(searches):
            if stopping():
                break
            # The remaining time is shared evenly among the remaining searches.
            remaining = max(request.until - time.time(), 0.0)
            until = time.time() + remaining / (len(searches) - number)
            conditions = target.folder.record().conditions.content()
            path = inside(target.folder.path, f"trials/{model.name}.jsonl")
            with Trials(path, conditions) as trials:
                search = _search_of(target, model, trials, executor, stopping)
                search.searches = len(searches)
                if math.isinf(until):
                    search.exhaust()
                else:
                    search.halve(until)
                if not stopping():
                    finish(target.folder, search, until, again=request.again)
    return interruption.signal


def _search_of(
    target: Target,
    model: Model,
    trials: Trials,
    executor: Executor,
    stopping: Callable[[], bool],
) -> GridSearch:
    """Return the search of a model's grid on the rows of a target."""
    features = target.folder.record().conditions.features
    space = grids.space_of(model.name, features)
    grid = grids.Grid(model, space.values, target.training.inputs.shape[1])
    return GridSearch(
        model,
        grid,
        target.training,
        trials,
        executor,
        stopping,
        source=space.name,
        baseline=grids.baseline(model.name, features),
        optimum=grid.name_of(space.default),
    )


def open_targets(
    request: Request,
    models: list[Model],
    executor: Executor,
    stopping: Callable[[], bool] = lambda: False,
    *,
    searched: bool = False,
) -> Iterator[Target]:
    """Read the database, split the rows of each target, open its folder and print its remarks.

    Parameters
    ----------
    request : Request
        Database, output folder and choices.
    models : list of Model
        Models that will be fitted.
    executor : Executor
        Workers that compute features.
    stopping : callable
        Asked while features are computed and before each target; True ends the iteration.
    searched : bool
        Whether grids are searched, which needs rows in every fold, and more memory.

    Yields
    ------
    Target
        The targets of the request, in its order.

    Raises
    ------
    InputError
        If the database cannot be used, there are too few rows, this machine lacks the memory for a
        model, or the folder holds results of other conditions.
    """
    for rows in dataset.read(request, executor, stopping):
        if stopping():
            return
        parts = split.draw(rows, request.seed, request.train_rows)
        if searched:
            split.check_folds(rows, parts)
        for model in models:
            check_memory(model.name, parts.train.size, baseline=not searched)
        folder = Folder(inside(request.output, short_name(rows.target_name)))
        folder.begin(rows, parts, request)
        note(
            f"{request.databases[0]}: {rows.target_name}, {parts.train.size} training rows,"
            f" {parts.test.size} test rows, {rows.features.name} features"
        )
        for line in dataset.remarks(rows, request.normalisation):
            note(f"  {line}")
        if not parts.by_surface:
            note("  all rows share one surface: they are split one by one")
        yield Target(folder, _training(request, rows, parts))


def _training(request: Request, rows: Dataset, parts: Split) -> Training:
    """Return training and test rows of a target, which is scaled over its training rows."""
    scaling = scaling_of(rows, parts.train, standard=rows.features.of_scene)
    return Training(
        inputs=rows.inputs[parts.train],
        target=scaling.scaled(rows.target[parts.train]),
        folds=parts.folds,
        test_inputs=rows.inputs[parts.test],
        test_target=rows.target[parts.test],
        normalisation=request.normalisation,
        seed=request.seed,
        scaling=scaling,
        groups=rows.groups[parts.train],
    )


def fit_and_time(training: Training, task: TimedFit) -> MeasuredFit:
    """Fit a model to all training rows; score it on training and test rows, and time it.

    These are the numbers of the paper's Table 4.

    Parameters
    ----------
    training : Training
        Training and test rows.
    task : TimedFit
        Model and settings.

    Returns
    -------
    MeasuredFit
        Scores, and medians of times on one thread. A fit that fails is a result too: it has the
        reason instead of scores.
    """
    training = training.seen_by(task.model)
    unfitted = training.unfitted(task.model, task.settings, tuned=task.of_grid)
    restored = training.scaling.restored
    arguments = training.fit_arguments()
    fit = partial(unfitted.fit, training.inputs, training.target, **arguments)
    failure = ""
    chosen: dict[str, str] = {}
    times = FitTimes()
    prediction = np.empty(0)
    train_scores = None
    test_scores = None
    with remarks() as warnings:
        try:
            began = perf_counter()
            fitted = fit()
            first_fit = perf_counter() - began
            chosen = _chosen_by_fit(fitted)
            train_scores = scores(
                restored(training.target), restored(fitted.predict(training.inputs))
            )
            test_prediction = restored(fitted.predict(training.test_inputs))
            test_scores = scores(training.test_target, test_prediction)
            times = _times(training, fitted, fit, first_fit, task.until)
            prediction = test_prediction
        except Exception as error:  # whatever a library raises: the model has no scores
            failure = reason(error)
            train_scores = None
            test_scores = None
    return MeasuredFit(
        prediction=prediction,
        fitted=chosen,
        test=test_scores,
        train=train_scores,
        failure=failure,
        times=times,
        remarks=warnings,
    )


def _chosen_by_fit(fitted: Any) -> dict[str, str]:
    """Return what a fitted pipeline has chosen itself, in words."""
    chosen = {}
    for name, attribute in CHOSEN_BY_FIT.items():
        value = getattr(fitted.named_steps[STEP], attribute, None)
        if value is not None and not isinstance(value, np.ndarray):
            chosen[name] = str(value)
    return chosen


def _times(
    training: Training,
    fitted: Any,
    fit: Callable[[], object],
    first_fit: float,
    until: float,
) -> FitTimes:
    """Return median times of predictions and fits; the first fit took `first_fit` [s] before.

    The first of several fits is a warm-up and does not count; one that takes too long to be
    repeated counts itself.
    """
    predict_test = partial(fitted.predict, training.test_inputs)
    predict_row = partial(fitted.predict, training.test_inputs[:1])
    test = repeated(predict_test, TEST_PREDICTIONS)
    row = repeated(predict_row, ROW_PREDICTIONS)
    fits = repeated(fit, FITS, first_fit, until) or [first_fit]
    return FitTimes(median(fits), len(fits), median(test), median(row))


def repeated(
    action: Callable[[], object],
    repetitions: Repetitions,
    before: float = 0.0,
    until: float = math.inf,
) -> list[float]:
    """Repeat an action and time it.

    Parameters
    ----------
    action : callable
        The action, without arguments.
    repetitions : Repetitions
        Fewest and most repetitions.
    before : float
        Time that the action took before, by which to tell whether another one ends in time [s].
    until : float
        Time of `time.time` before which each repetition has to end [s].

    Returns
    -------
    list of float
        Times of the repetitions [s]. There are fewer than the fewest, even none, if they take too
        long.
    """
    taken: list[float] = []
    while len(taken) < repetitions.most and before + sum(taken) < TOO_LONG:
        if len(taken) >= repetitions.fewest and sum(taken) > ENOUGH:
            break
        if time.time() + 2 * max([before, *taken]) >= until:
            break
        began = perf_counter()
        action()
        taken.append(perf_counter() - began)
    return taken


def finish(folder: Folder, search: GridSearch, until: float, *, again: bool) -> None:
    """Fit and time the winner of a search on a worker; write and print the results of both.

    The winner is a candidate of the grid or the baseline. A search without a winner has a result
    with the reason. Nothing is done where the folder has the result of this very search and winner.

    Parameters
    ----------
    folder : Folder
        Folder of the target.
    search : GridSearch
        The finished search.
    until : float
        Time of `time.time` at which the fit is stopped [s].
    again : bool
        Whether to fit again where the folder has the result.

    Raises
    ------
    InputError
        If a result is damaged or cannot be written.
    """
    if search.fault:
        _write_fault(folder, search.model, search.fault)
        return
    task = _fit_of_winner(search, until)
    report = search.report()
    if not again and _is_stored(folder, task, report):
        return
    result = search.executor.call(fit_and_time, search.training, task, until)
    if isinstance(result, Ended):
        fault = (
            "the winner's fit to all rows was not finished within the time:"
            f" {search.advice}"
        )
        _write_fault(folder, search.model, fault)
        return
    title = search.model.title
    number = FOLDS * len(search.grid.differing)
    for text, few in [*report.failures.items(), *report.remarks.items()]:
        note(f"{title}: {few} of {number} scores: {text}")
    write_fit(folder, task, search.training, result, note)
    if report.winner == "baseline":
        note(f"{title}: {WHY_BASELINE}")


def _fit_of_winner(search: GridSearch, until: float) -> TimedFit:
    """Return the fit of a search's winner, which is stopped at a time [s]."""
    of_grid = search.winner in search.grid.differing
    settings = search.grid.first[search.winner] if of_grid else search.baseline
    return TimedFit(
        model=search.model.name,
        settings=settings or {},
        kind="tuned",
        of_grid=of_grid,
        until=until,
        search=search.report(),
        search_seconds=search.seconds,
    )


def _is_stored(folder: Folder, task: TimedFit, report: SearchReport) -> bool:
    """Return whether a folder has the result of this very search and winner."""
    stored = folder.result("tuned", task.model)
    if stored is None or stored.search is None:
        return False
    settings = json.loads(json.dumps(task.settings))  # with lists instead of tuples
    same_search = stored.search.content() == json.loads(json.dumps(report.content()))
    return bool(stored.settings == settings and same_search)


def _write_fault(folder: Folder, model: Model, fault: str) -> None:
    """Write and print why a search has no winner."""
    content = {"model": model.name, "failure": fault, "remarks": []}
    folder.write_json(f"tuned/{model.name}.json", content)
    note(f"warning: {model.title}: {fault}")


def write_fit(
    folder: Folder,
    task: TimedFit,
    training: Training,
    result: MeasuredFit,
    say: Callable[[str], None],
) -> None:
    """Write and print scores and times of a model, with the report and the time of its search.

    KIND/MODEL.csv has the predictions of the test rows, KIND/MODEL.json all other results.

    Parameters
    ----------
    folder : Folder
        Folder of the target.
    task : TimedFit
        The fit.
    training : Training
        Its rows.
    result : MeasuredFit
        Its scores and times.
    say : callable
        Called with lines for the user.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    pairs = zip(training.test_target.tolist(), result.prediction.tolist(), strict=False)
    rows = [(row, truth, predicted) for row, (truth, predicted) in enumerate(pairs)]
    header = ("test_row", "truth", "prediction")
    folder.write_table(f"{task.kind}/{task.model}.csv", header, rows)
    content = {
        "model": task.model,
        "settings": task.settings,
        "fitted": result.fitted,
        "test": None if result.test is None else asdict(result.test),
        "train": None if result.train is None else asdict(result.train),
        "failure": result.failure,
        "times": {**asdict(result.times), "search": task.search_seconds},
        "remarks": result.remarks,
        "search": {} if task.search is None else task.search.content(),
    }
    folder.write_json(f"{task.kind}/{task.model}.json", content)
    title = f"{EVERY[task.model].title}, {task.kind}"
    if task.kind == "tuned" and not task.of_grid:
        title += ", which is the baseline"
    if result.test is None:
        say(f"warning: {title}: {result.failure}")
        return
    say(
        f"{title}: R2 {result.test.r2:.2f} %, nMAE {result.test.nmae:.2f} %,"
        f" fit {result.times.fit:.3g} s, prediction {result.times.test:.3g} s"
    )
    for remark in result.remarks:
        say(f"  warning: {remark}")
