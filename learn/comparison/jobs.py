"""The jobs: fit the models' baselines, and tune the models over their grids; then the last fits.

A job runs on the master. It reads as if there were one process: the executor (`learn.executor`)
does its fits on the workers. The times of a search are taken while other fits run beside them,
those of the last fits while the other processes wait.
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
from learn.comparison.folder import Folder
from learn.comparison.grid import Settings
from learn.comparison.search import GridSearch
from learn.comparison.tables import WHY_BASELINE
from learn.dataset import Request, short_name
from learn.executor import Ended, Executor
from learn.metrics import scores
from learn.models import (
    EVERY,
    STEP,
    Model,
    check_memory,
    models_named,
    remarks,
    scaling_of,
)
from learn.split import FOLDS

FITS = (3, 7)  # fewest and most fits that a median is over
ENOUGH = 5.0  # seconds after which the fewest repetitions are enough
TOO_LONG = 300.0  # seconds after which no further repetition is begun

note = partial(echo, err=True)  # print a line for the user on standard error


@dataclass(frozen=True)
class TimedFit:
    """A model to fit to all training rows."""

    model: str
    settings: Settings = field(default_factory=dict)  # on top of the baseline's
    kind: str = "baseline"  # one of `learn.comparison.folder.KINDS`
    of_grid: bool = (
        False  # whether it has the settings that all candidates of a grid share
    )
    until: float = math.inf  # time of `time.time` at which the fit is stopped [s]
    search: dict[str, Any] = field(
        default_factory=dict
    )  # report of the search that it has won
    seconds: float = 0.0  # time of this search [s]


def compare(request: Request, executor: Executor) -> int:
    """Fit, score and time the baselines of all models that are asked for; see `tune`."""
    models = models_named(list(request.models), request.features)
    tasks = [
        TimedFit(each.name, grids.baseline(each.name, request.features))
        for each in models
    ]
    libraries = [each.name for each in models if each.name in grids.LIBRARY]
    tasks += [TimedFit(name, grids.LIBRARY[name], "library") for name in libraries]
    with Interruption(listening=True) as interruption:
        for folder, training in targets(
            request, models, executor, interruption.requested
        ):
            with RunProgress(len(tasks), "models") as progress:
                for task in tasks:
                    if interruption.requested():
                        break
                    if request.again or folder.result(task.kind, task.model) is None:
                        limited = task.kind == "library"
                        own = training.first(grids.LIBRARY_ROWS) if limited else training
                        result = executor.call(fit_and_time, own, task)
                        write_fit(folder, task, own, result, progress.say)
                    progress.advance(1)
    return interruption.signal


def tune(request: Request, executor: Executor) -> int:
    """Search the models' grids, then fit, score and time the winners, or the baselines that won.

    The number of the signal that stopped the job is returned, 0 if none did; InputError is raised
    for input that cannot be used.
    """
    models = models_named(list(request.models), request.features)
    with Interruption(listening=True) as interruption:
        found = [
            *targets(request, models, executor, interruption.requested, searched=True)
        ]
        searches = [(*target, model) for target in found for model in models]
        for place, (folder, training, model) in enumerate(searches):
            if interruption.requested():
                break
            # What is left of the time is shared evenly among the searches that are left.
            share = max(request.until - time.time(), 0.0) / (len(searches) - place)
            agreed, until = folder.record()["conditions"], time.time() + share
            with Trials(
                inside(folder.path, f"trials/{model.name}.jsonl"), agreed
            ) as trials:
                source, space, settings = grids.space_of(model.name, agreed["features"])
                grid = grids.Grid(model, space, training.inputs.shape[1])
                search = GridSearch(
                    *(
                        model,
                        grid,
                        training,
                        trials,
                        executor,
                        interruption.requested,
                        source,
                    ),
                    baseline=grids.baseline(model.name, agreed["features"]),
                    optimum=grid.name_of(settings),
                    searches=len(searches),
                )
                if math.isinf(until):
                    search.exhaust()
                else:
                    search.halve(until)
                if not interruption.requested():
                    finish(folder, search, until, again=request.again)
    return interruption.signal


def targets(
    request: Request,
    models: list[Model],
    executor: Executor,
    stopping: Callable[[], bool] = lambda: False,
    *,
    searched: bool = False,
) -> Iterator[tuple[Folder, Training]]:
    """Read the database; split the rows of each target and open its folder, until a signal comes.

    InputError is raised if there are too few rows, or this machine lacks the memory for a model.
    """
    for rows in dataset.read(request, executor, stopping):
        if stopping():
            return
        parts = split.draw(rows, request.seed, request.train_rows)
        if searched:
            split.check_folds(rows, parts)
        for model in models:
            check_memory(model.name, parts.train.size, baseline=not searched)
        scaling = scaling_of(rows, parts.train, standard=rows.features.of_scene)
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
        yield (
            folder,
            Training(
                inputs=rows.inputs[parts.train],
                target=scaling.scaled(rows.target[parts.train]),
                folds=parts.folds,
                test_inputs=rows.inputs[parts.test],
                test_target=rows.target[parts.test],
                normalisation=request.normalisation,
                seed=request.seed,
                scaling=scaling,
                groups=rows.groups[parts.train],
            ),
        )


def fit_and_time(training: Training, task: TimedFit) -> tuple[Values, dict[str, Any]]:
    """Fit, score and time a model.

    Return predictions of the test rows, (m,), empty if the fit failed, and what a result says of
    it. Times are medians on one thread: of a "fit", of predicting the "test" set, and one "row".
    """
    training = training.seen_by(task.model)
    unfitted = training.unfitted(task.model, task.settings, tuned=task.of_grid)
    prediction, restored = np.empty(0), training.scaling.restored
    found: dict[str, Any] = {"fitted": {}, "test": None, "train": None, "failure": ""}
    found["times"] = {"fit": None, "fits": 0, "test": None, "row": None}
    fit = partial(unfitted.fit, training.inputs, training.target, **training.beside())
    with remarks() as said:
        try:
            began = perf_counter()
            fitted = fit()
            alone = perf_counter() - began
            answer = partial(fitted.predict, training.test_inputs)
            for name, attribute in (("kernel", "kernel_"), ("iterations", "n_iter_")):
                chosen = getattr(fitted.named_steps[STEP], attribute, None)
                if chosen is not None and not isinstance(chosen, np.ndarray):
                    found["fitted"][name] = str(chosen)
            train = restored(fitted.predict(training.inputs))
            found["train"] = asdict(scores(restored(training.target), train))
            guess = restored(answer())
            found["test"] = asdict(scores(training.test_target, guess))
            test = median(repeated(answer, (3, 9)))
            row = median(
                repeated(partial(fitted.predict, training.test_inputs[:1]), (5, 99))
            )
            # The first of several fits is a warm-up; one that is too long counts itself.
            fits = repeated(fit, FITS, alone, task.until) or [alone]
            times = {"fit": median(fits), "fits": len(fits), "test": test, "row": row}
            found["times"], prediction = times, guess
        except Exception as error:  # whatever a library raises: the model has no scores
            found |= {"failure": reason(error), "test": None, "train": None}
    return prediction, {**found, "remarks": said}


def repeated(
    action: Callable[[], Any],
    bounds: tuple[int, int],
    before: float = 0.0,
    until: float = math.inf,
) -> list[float]:
    """Time an action repeatedly, between two numbers of times, and return the times [s].

    There are fewer, even none, if they take too long. An action that took a time `before` tells
    whether another one ends before `until` [s].
    """
    taken: list[float] = []
    while len(taken) < bounds[1] and before + sum(taken) < TOO_LONG:
        if len(taken) >= bounds[0] and sum(taken) > ENOUGH:
            break
        if time.time() + 2 * max([before, *taken]) >= until:
            break
        began = perf_counter()
        action()
        taken.append(perf_counter() - began)
    return taken


def finish(folder: Folder, search: GridSearch, until: float, *, again: bool) -> None:
    """Fit the winner of a search until a time [s], and write and print what came of both.

    The winner is a candidate of the grid or the baseline. Nothing is done, except `again`, where
    the folder has the result of this very search and winner.
    """
    name, title, why = search.model.name, search.model.title, search.fault
    if not why:
        of_grid, report = search.winner in search.grid.differing, search.report()
        settings = search.grid.first[search.winner] if of_grid else search.baseline or {}
        task = TimedFit(name, settings, "tuned", of_grid, until, report, search.seconds)
        there = folder.result("tuned", name) or {}
        found = json.loads(json.dumps([task.settings, report]))
        if not again and found == [there.get("settings"), there.get("search")]:
            return
        result = search.executor.call(fit_and_time, search.training, task, until)
        if isinstance(result, Ended):
            why = f"the winner's fit to all rows was not finished within the time: {search.advice}"
    if why:
        folder.write_json(
            f"tuned/{name}.json", {"model": name, "failure": why, "remarks": []}
        )
        note(f"warning: {title}: {why}")
        return
    number = FOLDS * len(search.grid.differing)
    for text, few in [*report["failures"].items(), *report["remarks"].items()]:
        note(f"{title}: {few} of {number} scores: {text}")
    write_fit(folder, task, search.training, result, note)
    if report["winner"] == "baseline":
        note(f"{title}: {WHY_BASELINE}")


def write_fit(
    folder: Folder,
    task: TimedFit,
    training: Training,
    result: tuple[Values, dict[str, Any]],
    say: Callable[[str], None],
) -> None:
    """Write and print scores and times of a model, with the report and the time of its search."""
    prediction, found = result
    pairs = zip(training.test_target.tolist(), prediction.tolist(), strict=False)
    folder.write_table(
        f"{task.kind}/{task.model}.csv",
        ("test_row", "truth", "prediction"),
        ((number, *pair) for number, pair in enumerate(pairs)),
    )
    times = {**found["times"], "search": task.seconds}
    content = {"model": task.model, "settings": task.settings, **found}
    folder.write_json(
        f"{task.kind}/{task.model}.json",
        {**content, "search": task.search, "times": times},
    )
    title = f"{EVERY[task.model].title}, {task.kind}"
    title += (
        ", which is the baseline" if task.kind == "tuned" and not task.of_grid else ""
    )
    if found["test"] is None:
        say(f"warning: {title}: {found['failure']}")
        return
    say(
        f"{title}: R2 {found['test']['r2']:.2f} %, nMAE {found['test']['nmae']:.2f} %,"
        f" fit {times['fit']:.3g} s, prediction {times['test']:.3g} s"
    )
    for remark in found["remarks"]:
        say(f"  warning: {remark}")
