"""The jobs: fit the models' baselines, and tune the models over their grids.

A job runs on the master. It reads as if there were one process: the executor (`learn.executor`)
does its fits on the workers. What is left of a job's time is shared evenly among the searches that
are left.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gen.runtime.farm import Interruption
from gen.runtime.terminal import RunProgress
from learn import dataset, split
from learn.comparison import grid as grids
from learn.comparison import results
from learn.comparison.fits import Training, Trials
from learn.comparison.folder import Folder
from learn.comparison.grid import expected_work
from learn.comparison.results import TimedFit
from learn.comparison.search import GridSearch, growth, halved, steps, whole
from learn.dataset import Request, short_name
from learn.executor import Executor
from learn.features.scene import SCENE
from learn.models import Model, check_memory, models_named, scaling_of

MANY = 200
"""Fits of a search that is told beforehand how long it takes."""

DRAWN = 20
"""Fits that tell it."""

TELLING = 20.0
"""Seconds that these take at most."""


def compare(request: Request, executor: Executor) -> int:
    """Fit, score and time the baselines of all models that are asked for; see `tune`."""
    models = models_named(list(request.models), request.features)
    tasks = [TimedFit(each.name, grids.baseline(each.name, request.features)) for each in models]
    tasks += [
        TimedFit(each.name, grids.LIBRARY[each.name], "library")
        for each in models
        if each.name in grids.LIBRARY
    ]
    with Interruption(listening=True) as interruption:
        for folder, training in _targets(request, models, executor, interruption, searched=False):
            with RunProgress(len(tasks), "models") as progress:
                for task in tasks:
                    if interruption.requested():
                        break
                    if request.again or folder.result(task.kind, task.model) is None:
                        limited = task.kind == "library"
                        own = training.first(grids.LIBRARY_ROWS) if limited else training
                        result = executor.call(results.fit_and_time, own, task)
                        results.write_fit(folder, task, own, result, progress.say)
                    progress.advance(1, 0)
    return interruption.signal


def tune(request: Request, executor: Executor) -> int:
    """Search the models' grids, then fit, score and time the winners, or the baselines that won.

    The number of the signal that stopped the job is returned, 0 if none did; InputError is raised
    for input that cannot be used.
    """
    models = models_named(list(request.models), request.features)
    with Interruption(listening=True) as interruption:
        targets = [*_targets(request, models, executor, interruption, searched=True)]
        if math.isinf(request.until):
            for _, search, _ in _searches(request, models, targets, executor, interruption):
                tell_time(search)
        for folder, search, until in _searches(request, models, targets, executor, interruption):
            found = whole(search) if math.isinf(until) else halved(search, until)
            if interruption.requested():
                break
            if found.fault:
                results.write_failure(folder, search.model, found.fault)
            elif request.again or not results.has_winner(folder, found):
                task = replace(results.winner_of(found), until=until)
                result = executor.call(results.fit_in_time, search.training, task)
                if result is None:
                    results.write_failure(folder, search.model, results.UNFITTED)
                else:
                    results.write_search(folder, found, result)
    return interruption.signal


def _searches(
    request: Request,
    models: list[Model],
    targets: list[tuple[Folder, Training]],
    executor: Executor,
    interruption: Interruption,
) -> Iterator[tuple[Folder, GridSearch, float]]:
    """Open the searches of all targets and models one by one, each with the time at which it ends.

    What is left of the request's time is shared evenly among the searches that are left.
    """
    left = len(models) * len(targets)
    for folder, training in targets:
        agreed, columns = folder.record()["conditions"], training.columns
        features = agreed["features"]
        for model in models:
            if interruption.requested():
                return
            until = time.time() + max(request.until - time.time(), 0.0) / left
            left -= 1
            source, space = grids.space_of(model.name, features)
            grid = grids.grid(model, space, columns)
            _, known = grids.untuned(model.name, features)
            with Trials(folder.path / "trials" / f"{model.name}.jsonl", agreed) as trials:
                search = GridSearch(
                    *(model, grid, training, trials, executor, interruption.requested, source),
                    baseline=grids.baseline(model.name, features),
                    optimum=grid.number_of(grids.canonical_settings(model, known, columns)),
                )
                yield folder, search, until


def tell_time(search: GridSearch) -> None:
    """Say how long the fits of a large grid take that are left, one after the other.

    A few that are drawn at random are done on few rows, within `TELLING`.
    """
    total, model = search.training.rows, search.model
    left = search.tasks(range(len(search.grid.families)), total)
    if len(left) < MANY or search.stopping():
        return
    rows, families = steps(total)[0], len(search.grid.families)
    drawn = np.random.default_rng(search.training.seed).permutation(families)[:DRAWN]
    tasks = search.tasks(drawn.tolist(), rows, 1)
    title = f"{len(left)} fits are left; {len(tasks)} on {rows} rows tell how long they take"
    search.run(tasks, title, until=time.time() + TELLING)
    finished = search.trials.finished
    trials = [(task, finished.get((task.names[0], 0, rows))) for task in tasks]
    done = [(task, trial.seconds * len(task.names)) for task, trial in trials if trial]
    said = f"one of these fits takes more than {TELLING:g} s"
    if done:
        longer = growth(model, total / rows) * rows / total
        work = sum(map(expected_work, left)) / sum(expected_work(task) for task, _ in done)
        hours = sum(seconds for _, seconds in done) * work * longer / 3600
        more = "" if len(done) == len(tasks) else " or more"
        said = f"about {hours:.1g} h{more} on one thread, to be divided by the workers"
    with RunProgress(1) as progress:
        progress.say(f"{model.title}: {said}; --budget bounds it")


def _targets(
    request: Request,
    models: list[Model],
    executor: Executor,
    interruption: Interruption,
    *,
    searched: bool,
) -> Iterator[tuple[Folder, Training]]:
    """Read the database; split the rows of each target and open its folder, until a signal comes.

    InputError is raised if there are too few rows, or this machine lacks the memory for a model.
    """
    for rows in dataset.read(request, executor, interruption.requested):
        if interruption.requested():
            return
        parts = split.draw(rows, request.seed, request.train_rows)
        if searched:
            split.check_folds(rows, parts)
        for model in models:
            check_memory(model.name, parts.train.size, baseline=not searched)
        scaling = scaling_of(rows, parts.train, standard=rows.features.name == SCENE)
        folder = Folder(request.output / short_name(rows.target_name))
        folder.begin(rows, parts, request)
        with RunProgress(1) as progress:
            progress.say(
                f"{request.databases[0]}: {rows.target_name}, {parts.train.size} training rows,"
                f" {parts.test.size} test rows, {rows.features.name} features"
            )
            for line in dataset.remarks(rows, request.normalisation):
                progress.say(f"  {line}")
            if not parts.by_surface:
                progress.say("  all rows share one surface: they are split one by one")
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
