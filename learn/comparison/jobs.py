"""The jobs: fit the models' baselines, tune the models over their grids, estimate the grids' times.

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
from gen.runtime.terminal import RunProgress
from learn import dataset
from learn.comparison import estimate as costs
from learn.comparison import grid as grids
from learn.comparison import halving, results, timing
from learn.comparison.folder import Folder
from learn.comparison.search import GridSearch
from learn.comparison.timing import FitResult, TimedFit
from learn.comparison.training import Training, prepare
from learn.comparison.trials import Trials
from learn.executor import Executor
from learn.models import Model, models_named
from learn.request import Request, hybrid_for


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
        return self.executor.call(timing.fit_in_time, self.training, task)

    @contextmanager
    def searching(self, model: Model) -> Iterator[GridSearch]:
        """Open the finished fits of a model's grid."""
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
                        _fit_baseline(target, model, progress.say)
                    progress.advance(1, 0)
    return interruption.signal


def _fit_baseline(target: _Target, model: Model, say: Callable[[str], None]) -> None:
    task = TimedFit(model.name, grids.baseline(model.name, target.request.features))
    result = target.timed(task)
    assert result is not None  # there is no limit
    results.write_fit(target.folder, task, target.training, result)
    results.print_result(say, task, result)


def tune(request: Request, executor: Executor) -> int:
    """Search the models' grids, then fit, score and time the winners.

    Parameters
    ----------
    request : Request
        Database, folder, targets, models, and the time for all searches.
    executor : Executor
        Does the fits.

    Returns
    -------
    int
        Number of the signal that stopped the job, 0 if none did.

    Raises
    ------
    InputError
        For input that cannot be used.
    """
    return _search(request, executor, _tune_model)


def estimate(request: Request, executor: Executor) -> int:
    """Estimate the times of the models' whole grids from fits drawn at random; see `tune`."""
    return _search(request, executor, _estimate_model)


def _search(
    request: Request, executor: Executor, work: Callable[[_Target, GridSearch, float], None]
) -> int:
    """Do some work on the grid of each model and target, each until its share of the time ends."""
    began, models = time.time(), models_named(list(request.models))
    end = math.inf if request.limit is None else began + request.limit
    left = len(models) * len(request.targets)
    with Interruption(listening=True) as interruption:
        for target in _targets(request, models, executor, interruption, searched=True):
            for model in models:
                if interruption.requested():
                    break
                until = time.time() + max(end - time.time(), 0.0) / left
                left -= 1
                with target.searching(model) as search:
                    work(target, search, until)
    return interruption.signal


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
    hybrid = hybrid_for(request, executor, stopping)
    if stopping():
        return
    for rows in dataset.read_together(
        (request.database,), request.targets, request.area_max, request.features, (hybrid,)
    ):
        if not stopping():
            folder, training = prepare(request, rows, models, searched=searched)
            yield _Target(request, folder, training, executor, stopping)


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


def _estimate_model(target: _Target, search: GridSearch, until: float) -> None:
    """Estimate the time of one model's whole grid."""
    cost = costs.estimate(search, until)
    if cost is not None:
        results.write_cost(target.folder, search, cost)
