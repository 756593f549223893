"""The jobs: fit the models' baselines, tune them over their grids, or estimate what that takes.

A job runs on the master. It reads as if there were one process: the executor (`learn.executor`)
does its fits on the workers. What is left of a job's time is shared evenly among the searches that
are left.

An estimate rests on fits that are drawn at random: the winners of a search would bias it, as their
fits are shorter or longer than others. The drawn fits are done on few rows, then on three times as
many, and so on up to all, as far as the time reaches. The sum of their times over the sum of their
expected work, times the work of the whole grid, is a ratio estimate (W. G. Cochran, Sampling
Techniques, chapter 6). Where the last fits were of fewer rows, it is multiplied by the growth of a
fit's time, which is on the safe side. Fits on all rows are trials like all others, which a later
search does not repeat.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from gen.arrays import Values
from gen.runtime.signals import Interruption
from gen.runtime.terminal import RunProgress, echo, print_table
from learn import dataset, split
from learn.comparison import grid as grids
from learn.comparison import paper, results
from learn.comparison.fits import Training, Trials
from learn.comparison.folder import Folder, conditions
from learn.comparison.grid import Task, expected_work, key
from learn.comparison.results import TimedFit
from learn.comparison.search import GridSearch, growth, halved, steps, whole
from learn.comparison.tables import new_table
from learn.dataset import Request, short_name
from learn.executor import Executor
from learn.models import MODELS, Model, check_memory, models_named, scaling_of
from learn.split import FOLDS

DRAWN = 40
"""Fits that are drawn at most: the error is then about a sixth of their times' scatter."""

FEWEST = 5
"""Fits on some rows that say more than any number of fits on fewer rows."""


class Cost(NamedTuple):
    """The time of all fits of a grid and of its baseline, one after the other on one thread."""

    model: str
    grid: str
    seconds: float
    error: float | None  # standard error [s]; None for one fit, or for fits of fewer rows
    fits: int  # that were timed on all rows
    of: int  # fits that there are
    rows: int  # largest number on which a drawn fit was timed


def compare(request: Request, executor: Executor) -> int:
    """Fit, score and time the baselines of all models that are asked for; see `tune`."""
    models = models_named(list(request.models))
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
    with Interruption(listening=True) as interruption:
        for folder, search, until in _searches(request, executor, interruption):
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


def estimate(request: Request, executor: Executor) -> int:
    """Estimate the times of the models' whole grids from fits drawn at random; see `tune`."""
    costs: dict[Folder, list[Cost]] = {}
    with Interruption(listening=True) as interruption:
        for folder, search, until in _searches(request, executor, interruption):
            if (cost := timed(search, until)) is not None:
                costs.setdefault(folder, []).append(cost)
            elif not interruption.requested():
                echo(
                    f"{search.model.title}: too few fits ended in its time: give a larger --budget"
                )
    for place, found in costs.items():
        report(place, found)
    return interruption.signal


def _searches(
    request: Request, executor: Executor, interruption: Interruption
) -> Iterator[tuple[Folder, GridSearch, float]]:
    """Open the searches of all targets and models one by one, each with the time at which it ends.

    What is left of the request's time is shared evenly among the searches that are left.
    """
    models = models_named(list(request.models))
    left = len(models) * len(request.targets)
    for folder, training in _targets(request, models, executor, interruption, searched=True):
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
        scaling = scaling_of(rows, parts.train)
        folder = Folder(request.output / short_name(rows.target_name))
        folder.begin(rows, parts, conditions(rows, parts, request.normalisation, request.area_max))
        with RunProgress(1) as progress:
            progress.say(
                f"{request.database}: {rows.target_name}, {parts.train.size} training rows,"
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
            ),
        )


def timed(search: GridSearch, until: float) -> Cost | None:
    """Do the drawn fits that end before a time of `time.time`, and estimate the whole grid's time.

    The baseline's fits are the first, and are counted as they are. None is returned if one of them,
    or the first drawn fit on the fewest rows, was not finished.
    """
    total = search.training.rows
    own = search.baseline_tasks(total)
    search.run(own, f"{len(own)} fits of the baseline", until=until)
    if search.baseline_tasks(total):
        return None
    began, sizes, drawn = time.time(), steps(total), draw(search)[:DRAWN]
    for place, rows in enumerate(sizes, start=1):
        tasks = [
            t for family, fold in drawn for t in search.tasks([family], rows) if t.fold == fold
        ]
        said = f"{search.fits} fits, {len(tasks)} drawn to be timed on {rows} rows"
        search.run(tasks, said, until=began + place / len(sizes) * (until - began))
    return cost(search)


def cost(search: GridSearch) -> Cost | None:
    """Estimate the time of a grid from its finished fits; None if those drawn first are not."""
    total, drawn, model = search.training.rows, draw(search), search.model
    times = {rows: _times(search, drawn, rows) for rows in steps(total)}
    rows = max(times, key=lambda rows: (min(times[rows].size, FEWEST), rows))
    if not (number := times[rows].size):
        return None
    families = {family: search.grid.served_by(family) for family, _ in drawn}
    tasks = (Task(model.name, families[family], 0, rows) for family, _ in drawn)
    works = np.fromiter(map(expected_work, tasks), float)
    ratio = float(times[rows].sum() / works[:number].sum())
    seconds = ratio * float(works.sum()) * growth(model, total / rows)
    error = None
    if rows == total and number > 1:
        scatter = (times[rows] - ratio * works[:number]).std(ddof=1) / times[rows].mean()
        error = seconds * float(scatter) * math.sqrt(1 / number - 1 / len(drawn))
    own = [trial.seconds for trial in search.baseline_trials(total) if trial]
    return Cost(
        *(model.name, search.source, seconds + sum(own), error),
        fits=times[total].size + len(own),
        of=len(drawn) + len(own),
        rows=rows,
    )


def draw(search: GridSearch) -> list[tuple[int, int]]:
    """Return all fits as family and fold, in the order in which they are drawn."""
    drawn = np.random.default_rng([search.training.seed, search.fits]).permutation(search.fits)
    return [divmod(int(place), FOLDS) for place in drawn]


def _times(search: GridSearch, drawn: list[tuple[int, int]], rows: int) -> Values:
    """Return the times of the first drawn fits [s], up to one that a candidate lacks."""
    found = (
        [search.trials.finished.get((key(s), fold, rows)) for s in search.grid.served_by(family)]
        for family, fold in drawn
    )
    return np.array([sum(t.seconds for t in each if t) for each in takewhile(all, found)])


def hours(seconds: float) -> str:
    """Return a time [s] in hours as text."""
    number = seconds / 3600
    return f"{number:.2g}" if number < 99.5 else f"{number:.0f}"


def report(folder: Folder, costs: list[Cost]) -> None:
    """Print the times of whole grids, and write them to whole-grids.csv."""
    rows = [[*cost, paper.TUNING_SECONDS[cost.model]] for cost in costs]
    folder.write_table("whole-grids.csv", [*Cost._fields, "paper_s"], rows)
    title = "Whole grids, one fit after the other on one thread; the paper's in brackets"
    numbers = ("time [h]", "fits", "timed on all rows", "on rows up to", "relative error")
    table = new_table(title, ("Model", "Grid"), numbers)
    for cost in costs:
        took = f"{hours(cost.seconds)} ({hours(paper.TUNING_SECONDS[cost.model])})"
        error = "" if cost.error is None else f"{100 * cost.error / cost.seconds:.0f} %"
        table.add_row(
            *(MODELS[cost.model].title, cost.grid, took),
            *(str(each) for each in (cost.of, cost.fits, cost.rows)),
            "measured" if cost.fits == cost.of else error,
        )
    print_table(table)
