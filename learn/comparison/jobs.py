"""The jobs `compare` and `tune`: fit the baselines of models, or search grids and fit the winners.

A job runs on the master, and is written as if there were one process only: the executor
(`learn.executor`) does its fits on the workers. Times are processor times, which other programs on
the machine hardly change. Fits of a search are timed while other fits run; the fits of
`fit_and_time` are timed while the other processes wait.

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
from time import process_time
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
    """Numbers of repetitions of an action, whose median time is reported."""

    fewest: int  # smallest number, unless the repetitions take `TOO_LONG`
    largest: int  # largest number, which is reached if the fewest take less than `ENOUGH`


FITS = Repetitions(fewest=3, largest=7)
TEST_PREDICTIONS = Repetitions(fewest=3, largest=9)  # predictions of the whole test set
ROW_PREDICTIONS = Repetitions(fewest=5, largest=99)  # predictions of one row
ENOUGH = 5.0  # time of all repetitions after which the fewest ones are enough [s]
TOO_LONG = 300.0  # time after which no repetition is begun, even if there are too few [s]

CHOSEN_BY_FIT = {"kernel": "kernel_", "iterations": "n_iter_"}
"""Attributes of fitted estimators that results state, by their key in the file of a result."""

note = partial(echo, err=True)  # prints a line for the user on standard error


@dataclass(frozen=True)
class TimedFit:
    """A fit of a model to all training rows, which is timed."""

    model: str  # name of the model
    # values by setting, on top of the settings of the baseline
    settings: SettingValues = field(default_factory=dict)
    kind: str = "baseline"  # kind of the result, one of `learn.comparison.folder.KINDS`
    # True for a candidate of a grid, which has the settings that all candidates share
    of_grid: bool = False
    # time of `time.time` before which each repetition has to end [s]
    until: float = math.inf
    search: SearchReport | None = None  # report of the search that chose the settings
    search_seconds: float = 0.0  # sum of the times of all fits of this search [s]


@dataclass(frozen=True)
class FitTimes:
    """Median processor times of a fit and its predictions [s]; None if the fit has failed."""

    fit: float | None = None  # time of a fit
    fits: int = 0  # number of fits of this median
    test: float | None = None  # time of predicting the whole test set
    row: float | None = None  # time of predicting one row


@dataclass(frozen=True, eq=False)
class MeasuredFit:
    """Predictions, scores and times of a model that was fitted to all training rows."""

    # (m,), predictions of the test rows in the target's unit; empty if the fit failed
    prediction: Values
    # values that the fit itself has chosen, by the keys of `CHOSEN_BY_FIT`
    fitted: dict[str, str]
    test: Scores | None  # scores on the test rows; None if the fit failed
    train: Scores | None  # scores on the training rows; None if the fit failed
    failure: str  # why there are no scores; "" if there are some
    times: FitTimes
    remarks: list[str]  # warnings of the fit


@dataclass(frozen=True, eq=False)
class Target:
    """One target of a comparison: its folder, and its training and test rows."""

    folder: Folder
    training: Training


def compare(request: Request, executor: Executor) -> int:
    """Fit, score and time the baselines of models, and write and print the results.

    A baseline whose result is in the folder already is left out, unless `request.again` is True.

    Parameters
    ----------
    request : Request
        Database, output folder, models and options.
    executor : Executor
        Workers that do the fits, one at a time.

    Returns
    -------
    int
        Number of the signal that stopped the job; 0 if none did.

    Raises
    ------
    InputError
        If the database cannot be used, the folder has results of other conditions or damaged ones,
        or this machine lacks the memory.
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
                    progress.advance(rows=1)
    return interruption.signal


def _lacks_result(target: Target, task: TimedFit) -> bool:
    """Return whether the folder of a target has no result of a fit.

    InputError is raised if the result is damaged.
    """
    return target.folder.result(task.kind, task.model) is None


def _baselines(models: list[Model], features: str) -> list[TimedFit]:
    """Return the fits of the baselines of models, then those with libraries' own settings.

    Models whose baseline has the settings of its library need no fit of the second kind.
    """
    baselines = [
        TimedFit(model=model.name, settings=grids.baseline(model.name, features))
        for model in models
    ]
    libraries = [
        TimedFit(model=model.name, settings=grids.LIBRARY[model.name], kind="library")
        for model in models
        if model.name in grids.LIBRARY
    ]
    return baselines + libraries


def _measure(
    target: Target, task: TimedFit, executor: Executor, say: Callable[[str], None]
) -> None:
    """Do one of the fits of `_baselines` on a worker, write its result, and print it by `say`."""
    training = target.training
    if task.kind == "library":
        # The time of these fits grows with the third power of the number of rows.
        training = training.first(grids.LIBRARY_ROWS)
    result = executor.call(fit_and_time, training, task)
    write_fit(target.folder, task, training, result, say)


def tune(request: Request, executor: Executor) -> int:
    """Search the grids of models; fit, score and time the winners; write and print the results.

    If no candidate is better than the baseline, the baseline is the winner. The folder keeps
    finished fits: another call with an equal request does only the missing ones.

    Parameters
    ----------
    request : Request
        Database, output folder, models and options; the job ends at the time `until`.
    executor : Executor
        Workers that do the fits.

    Returns
    -------
    int
        Number of the signal that stopped the job; 0 if none did.

    Raises
    ------
    InputError
        If the database cannot be used, the folder has results of other conditions or damaged ones,
        or a machine lacks the memory.
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
                search.searches = len(searches)  # All of them share the budget.
                if request.candidates is not None:
                    search.choose(request.candidates)
                elif math.isinf(until):  # There is time for the whole grid.
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
    """Return the search of a model's grid on the training rows of a target.

    `trials` are its finished fits. `stopping` is called before a fit; True ends the search.
    """
    features = target.folder.record().conditions.features
    space = grids.space_of(model.name, features)
    number_of_features = target.training.inputs.shape[1]
    grid = grids.Grid(model, space=space.values, inputs=number_of_features)
    return GridSearch(
        model=model,
        grid=grid,
        training=target.training,
        trials=trials,
        executor=executor,
        stopping=stopping,
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
        Database, output folder and options.
    models : list of Model
        Models that will be fitted.
    executor : Executor
        Workers that compute features.
    stopping : callable
        Called while features are computed and before each target; True ends the iteration.
    searched : bool
        True if grids will be searched, which needs rows in every fold, and more memory.

    Yields
    ------
    Target
        One target, in the order of the request.

    Raises
    ------
    InputError
        If the database cannot be used, there are too few rows, this machine lacks the memory for a
        model, or the folder has results of other conditions.
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
        yield Target(folder=folder, training=_training(request, rows, parts))


def _training(request: Request, rows: Dataset, parts: Split) -> Training:
    """Return the training and test rows of a target.

    `scaling_of` scales the training targets, over these targets alone. The test targets keep the
    target's unit, in which models are scored.
    """
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
    """Fit a model to all training rows, score it on training and test rows, and time it.

    These are the numbers of the paper's Table 4.

    Parameters
    ----------
    training : Training
        Training and test rows.
    task : TimedFit
        Model, settings, and the time at which repetitions end.

    Returns
    -------
    MeasuredFit
        Predictions, scores, and median processor times on one thread. If a fit or prediction raises
        an error, there are none of these, and `failure` is the reason; the error is not raised.
    """
    training = training.seen_by(task.model)
    unfitted = training.unfitted(task.model, task.settings, tuned=task.of_grid)
    restored = training.scaling.restored
    arguments = training.fit_arguments()
    # A pipeline that is fitted again forgets the fit before.
    fit = partial(unfitted.fit, training.inputs, training.target, **arguments)
    failure = ""
    chosen: dict[str, str] = {}
    times = FitTimes()
    prediction = np.empty(0)
    train_scores = None
    test_scores = None
    with remarks() as warnings:
        try:
            began = process_time()
            fitted = fit()
            first_fit = process_time() - began
            chosen = _chosen_by_fit(fitted)
            train_scores = scores(
                restored(training.target), restored(fitted.predict(training.inputs))
            )
            test_prediction = restored(fitted.predict(training.test_inputs))
            test_scores = scores(training.test_target, test_prediction)
            times = _times(training, fitted, fit, first_fit, task.until)
            prediction = test_prediction
        # Libraries raise errors of any type. A model whose fit failed has no scores.
        except Exception as error:
            failure = reason(error)
            # A prediction may have failed after its scores, while it was timed.
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
    """Return values that the estimator of a fitted pipeline has chosen, by keys of `CHOSEN_BY_FIT`.

    They are texts. Attributes that the estimator lacks are left out.
    """
    chosen = {}
    for name, attribute in CHOSEN_BY_FIT.items():
        value = getattr(fitted.named_steps[STEP], attribute, None)
        # Results state single values only, and no array with a number for each output or stage.
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
    """Return median times of a fitted pipeline's predictions, and of its fits.

    `fit` repeats the fit. `first_fit` is the time of the first fit [s], which was a warm-up: it is
    reported only if the fit takes too long to be repeated. Repetitions of the fit end before the
    time `until` of `time.time` [s]; those of predictions are short, and may end after it.
    """
    predict_test = partial(fitted.predict, training.test_inputs)
    predict_row = partial(fitted.predict, training.test_inputs[:1])
    test = repeated(predict_test, TEST_PREDICTIONS)
    row = repeated(predict_row, ROW_PREDICTIONS)
    fits = repeated(fit, FITS, before=first_fit, until=until) or [first_fit]
    return FitTimes(fit=median(fits), fits=len(fits), test=median(test), row=median(row))


def repeated(
    action: Callable[[], object],
    repetitions: Repetitions,
    before: float = 0.0,
    until: float = math.inf,
) -> list[float]:
    """Repeat an action and measure its processor time.

    Parameters
    ----------
    action : callable
        The action, without arguments.
    repetitions : Repetitions
        Smallest and largest number of repetitions.
    before : float
        Processor time of the action before these repetitions; 0 if it is unknown [s].
    until : float
        Time of `time.time` before which each repetition has to end [s].

    Returns
    -------
    list of float
        Processor times of the repetitions [s]. There are `repetitions.largest`, or at least
        `repetitions.fewest` if they take longer than `ENOUGH` together. There are fewer, or none at
        all, if `before` and the times of the repetitions add up to `TOO_LONG` or more, or if the
        next repetition might end after `until`.
    """
    times: list[float] = []
    while len(times) < repetitions.largest and before + sum(times) < TOO_LONG:
        if len(times) >= repetitions.fewest and sum(times) > ENOUGH:
            break
        # A repetition may take up to twice as long as the longest one before.
        if time.time() + 2 * max([before, *times]) >= until:
            break
        began = process_time()
        action()
        times.append(process_time() - began)
    return times


def finish(folder: Folder, search: GridSearch, until: float, *, again: bool) -> None:
    """Fit and time the winner of a search on a worker, and write and print the result.

    The winner is a candidate of the grid, or the baseline. If there is no winner, or its fit does
    not end in time, the reason is written and printed in place of a result. Nothing is done if the
    folder has the result of an equal search with an equal winner.

    Parameters
    ----------
    folder : Folder
        Folder of the target.
    search : GridSearch
        The finished search.
    until : float
        Time of `time.time` at which the fit is stopped [s].
    again : bool
        True to fit the winner even if the folder has its result.

    Raises
    ------
    InputError
        If a stored result is damaged, or a result cannot be written.
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
    scores_of_grid = FOLDS * len(search.grid.differing)
    for text, concerned_scores in [*report.failures.items(), *report.remarks.items()]:
        note(f"{title}: {concerned_scores} of {scores_of_grid} scores: {text}")
    write_fit(folder, task, search.training, result, note)
    if report.winner == "baseline":
        note(f"{title}: {WHY_BASELINE}")


def _fit_of_winner(search: GridSearch, until: float) -> TimedFit:
    """Return the fit of a search's winner, whose repetitions end before `until`.

    `until` is a time of `time.time` [s]. The search must have a winner (`fault` is "").
    """
    of_grid = search.winner in search.grid.differing
    settings = search.baseline or {}
    if of_grid:
        settings = search.grid.first[search.winner]
    return TimedFit(
        model=search.model.name,
        settings=settings,
        kind="tuned",
        of_grid=of_grid,
        until=until,
        search=search.report(),
        search_seconds=search.seconds,
    )


def _is_stored(folder: Folder, task: TimedFit, report: SearchReport) -> bool:
    """Return whether a folder has the result of a search with equal report and equal winner.

    `task` is the fit of the winner, and `report` that of the search. Raises InputError if the
    stored result is damaged.
    """
    stored = folder.result("tuned", task.model)
    if stored is None or stored.search is None:
        return False
    # By way of JSON, tuples become lists as in the file.
    settings = json.loads(json.dumps(task.settings))
    content = json.loads(json.dumps(report.content()))
    return bool(stored.settings == settings and stored.search.content() == content)


def _write_fault(folder: Folder, model: Model, fault: str) -> None:
    """Write the reason why a search has no winner as its result, and print it as a warning."""
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
    """Write the result of a fit into the folder of a target, and print it.

    KIND/MODEL.csv has the predictions of the test rows, and KIND/MODEL.json the rest: settings,
    scores, times, warnings and the report of the search.

    Parameters
    ----------
    folder : Folder
        Folder of the target.
    task : TimedFit
        The fit.
    training : Training
        Rows of the fit.
    result : MeasuredFit
        Predictions, scores and times of the fit.
    say : callable
        Called with lines for the user.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    # Without scores there are no predictions: `zip` ends at once, and the table has no rows.
    pairs = zip(training.test_target.tolist(), result.prediction.tolist(), strict=False)
    rows = [(row, truth, predicted) for row, (truth, predicted) in enumerate(pairs)]
    header = ("test_row", "truth", "prediction")
    folder.write_table(f"{task.kind}/{task.model}.csv", header, rows)
    report = {}
    if task.search is not None:
        report = task.search.content()
    content = {
        "model": task.model,
        "settings": task.settings,
        "fitted": result.fitted,
        "test": _scores_entry(result.test),
        "train": _scores_entry(result.train),
        "failure": result.failure,
        "times": {**asdict(result.times), "search": task.search_seconds},
        "remarks": result.remarks,
        "search": report,
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


def _scores_entry(fit_scores: Scores | None) -> dict[str, float] | None:
    """Return scores as the file of a result has them: by field [%]; None if the fit failed."""
    if fit_scores is None:
        return None
    return asdict(fit_scores)
