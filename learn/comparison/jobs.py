"""The jobs: fit the models' baselines, and tune the models over their grids.

A job runs on the master. It reads as if there were one process: the executor (`learn.executor`)
does its fits on the workers. The time that a job is given is wall-clock time of its call; what is
left of it is shared evenly among the searches that are left.
"""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from gen.runtime.signals import Interruption
from gen.runtime.terminal import RunProgress, echo
from learn import dataset, split
from learn.comparison import estimate as estimates
from learn.comparison import grid as grids
from learn.comparison import halving, results
from learn.comparison.estimate import Cost
from learn.comparison.fits import Training, Trials
from learn.comparison.folder import Folder, conditions
from learn.comparison.results import FitResult, TimedFit
from learn.comparison.search import GridSearch
from learn.dataset import Dataset, Request
from learn.executor import Executor
from learn.models import Model, check_memory, models_named, scaling_of
from learn.stored import short_name


@dataclass(frozen=True)
class _Target:
    """One target of a job; `stopping` returns True once a signal has come."""

    request: Request
    folder: Folder
    training: Training
    executor: Executor
    stopping: Callable[[], bool]

    def timed(self, task: TimedFit) -> FitResult | None:
        """Fit, score and time a model while nothing else runs; None if its time was over."""
        return self.executor.call(results.fit_in_time, self.training, task)

    @contextmanager
    def searching(self, model: Model) -> Iterator[GridSearch]:
        """Open the search of a model's grid, with the fits that are finished."""
        features, columns = self.request.features, self.training.columns
        source, space = grids.space_of(model.name, features)
        grid = grids.grid(model, space, columns)
        _, known = grids.untuned(model.name, features)
        path = self.folder.path / "trials" / f"{model.name}.jsonl"
        with Trials(path, self.folder.record()["conditions"]) as trials:
            yield GridSearch(
                *(model, grid, self.training, trials, self.executor, self.stopping, source),
                baseline=grids.baseline(model.name, features),
                optimum=grid.number_of(grids.canonical_settings(model, known, columns)),
            )


def compare(request: Request, executor: Executor) -> int:
    """Fit, score and time the baselines of all models that are asked for; see `tune`."""
    models = models_named(list(request.models))
    with Interruption(listening=True) as interruption:
        for target in _targets(request, models, executor, interruption, searched=False):
            with RunProgress(len(models), "models") as progress:
                for model in models:
                    there = target.folder.result("baseline", model.name) is not None
                    if interruption.requested():
                        break
                    if request.again or not there:
                        task = TimedFit(model.name, grids.baseline(model.name, request.features))
                        result = target.timed(task)
                        assert result is not None  # there is no limit
                        results.write_fit(target.folder, task, target.training, result)
                        results.print_result(progress.say, task, result)
                    progress.advance(1, 0)
    return interruption.signal


def tune(request: Request, executor: Executor) -> int:
    """Search the models' grids, then fit, score and time the winners.

    The number of the signal that stopped the job is returned, 0 if none did; InputError is raised
    for input that cannot be used.
    """
    with Interruption(listening=True) as interruption:
        for target, search, until in _searches(request, executor, interruption):
            _tune_model(target, search, until)
    return interruption.signal


def estimate(request: Request, executor: Executor) -> int:
    """Estimate the times of the models' whole grids from fits drawn at random; see `tune`."""
    found: dict[Folder, list[Cost]] = {}
    with Interruption(listening=True) as interruption:
        for target, search, until in _searches(request, executor, interruption):
            costs, cost = found.setdefault(target.folder, []), estimates.estimate(search, until)
            if cost is not None:
                costs.append(cost)
            elif not target.stopping():
                echo(
                    f"{search.model.title}: too few fits ended in its time: give a larger --budget"
                )
    for folder, costs in found.items():
        if costs:
            estimates.report(folder, costs)
    return interruption.signal


def _searches(
    request: Request, executor: Executor, interruption: Interruption
) -> Iterator[tuple[_Target, GridSearch, float]]:
    """Open the searches of all targets and models one by one, each with the time at which it ends.

    The time that the request gives is shared evenly among the searches that are left.
    """
    began, models = time.time(), models_named(list(request.models))
    end = math.inf if request.limit is None else began + request.limit
    left = len(models) * len(request.targets)
    for target in _targets(request, models, executor, interruption, searched=True):
        for model in models:
            if interruption.requested():
                return
            until = time.time() + max(end - time.time(), 0.0) / left
            left -= 1
            with target.searching(model) as search:
                yield target, search, until


def _tune_model(target: _Target, search: GridSearch, until: float) -> None:
    """Search one model's grid, and fit and time the winner, which may be the baseline."""
    folder, model = target.folder, search.model
    found = search.exhaustive() if math.isinf(until) else halving.within(search, until)
    if target.stopping():
        return
    every_fit_failed = found is not None and not found.scores.scored and found.scores.failures
    if found is None or not found.scores.decided or every_fit_failed:
        failures = [] if found is None else [*found.scores.failures]
        results.write_failure(folder, model, "; ".join(failures) or results.UNFINISHED)
    elif target.request.again or not results.has_winner(folder, search, found):
        result = target.timed(replace(results.winner_of(search, found), until=until))
        if result is None:
            results.write_failure(folder, model, results.UNFITTED)
        else:
            results.write_search(folder, search, found, result)


def _targets(
    request: Request,
    models: list[Model],
    executor: Executor,
    interruption: Interruption,
    *,
    searched: bool,
) -> Iterator[_Target]:
    """Read the database, and prepare one target after the other until a signal comes."""
    stopping = interruption.requested
    for rows in dataset.read(request, executor, stopping):
        if not stopping():
            folder, training = _prepare(request, rows, models, searched=searched)
            yield _Target(request, folder, training, executor, stopping)


def _prepare(
    request: Request, rows: Dataset, models: list[Model], *, searched: bool
) -> tuple[Folder, Training]:
    """Split the rows of one target, check the memory and open the target's folder."""
    parts = split.draw(rows, request.seed, request.train_rows)
    if searched:
        split.check_folds(rows, parts)
    for model in models:
        check_memory(model.name, parts.train.size, baseline=not searched)
    scaling = scaling_of(rows, parts.train)
    with RunProgress(1) as progress:
        folder = Folder(request.output / short_name(rows.target_name))
        agreed = conditions(rows, parts, request.normalisation, request.area_max)
        folder.begin(rows, parts, agreed)
        progress.say(
            f"{request.database}: {rows.target_name}, {parts.train.size} training rows,"
            f" {parts.test.size} test rows, {rows.features.name} features"
        )
        for line in dataset.remarks(rows, request.normalisation):
            progress.say(f"  {line}")
        if not parts.by_surface:
            progress.say("  all rows share one surface: they are split one by one")
    return folder, Training(
        inputs=rows.inputs[parts.train],
        target=scaling.scaled(rows.target[parts.train]),
        folds=parts.folds,
        test_inputs=rows.inputs[parts.test],
        test_target=rows.target[parts.test],
        normalisation=request.normalisation,
        seed=request.seed,
        scaling=scaling,
    )
