"""The jobs: fit the models' baselines, tune the models over their grids, estimate the grids' times.

A job runs on the master. It reads as if there were one process: the executor (`learn.executor`)
does its fits on the workers.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from gen.runtime.signals import Interruption
from gen.runtime.terminal import RunProgress
from learn import dataset
from learn.comparison.clock import Clock
from learn.comparison.folder import Folder
from learn.comparison.preparation import prepare
from learn.comparison.results import (
    has_winner,
    print_result,
    winner_of,
    write_cost,
    write_failure,
    write_fit,
    write_search,
)
from learn.comparison.search import budget, pruning, spaces, whole_grid
from learn.comparison.search.budget import Share
from learn.comparison.search.grid_search import GridSearch
from learn.comparison.search.spaces import Space
from learn.comparison.search.staged import require_served
from learn.comparison.search.trials import Trials
from learn.comparison.timing import FitResult, TimedFit, fit_and_time
from learn.comparison.training_data import Training
from learn.executor import Executor
from learn.models import Model, models_named
from learn.request import Request, hybrid_for


@dataclass(frozen=True)
class _Target:
    """One target of a job: its folder, its data, and the executor of its fits.

    Attributes
    ----------
    stopping : callable
        Returns True once a signal has come.
    """

    request: Request
    folder: Folder
    training: Training
    executor: Executor
    stopping: Callable[[], bool]

    def timed(self, task: TimedFit) -> FitResult:
        """Fit, score and time a model while nothing else runs."""
        return self.executor.call(fit_and_time, self.training, task)

    @property
    def name(self) -> str:
        """Name of the target, and of its folder."""
        return self.folder.path.name

    @contextmanager
    def searching(
        self, model: Model, source: str, space: Space, clock: Clock
    ) -> Iterator[tuple[GridSearch, Share | None]]:
        """Open the finished fits of a model's grid, whose name is `source`; yield its time too."""
        grid = pruning.grid(model, space, self.training.columns)
        features, columns = self.request.features, self.training.columns
        _, known = spaces.untuned(model.name, features)
        optimum = grid.number_of(pruning.canonical_settings(model, known, columns))
        carried = spaces.baseline(model.name, features), optimum
        path = self.folder.path / "trials" / f"{model.name}.jsonl"
        with (
            Trials(path, self.folder.record()["conditions"]) as trials,
            clock.search(self.name, model.name, self.stopping) as share,
        ):
            context = self.training, trials, self.executor, self.stopping
            yield GridSearch(model, grid, *context, source, *carried), share


def compare(request: Request, executor: Executor) -> int:
    """Fit, score and time the baselines of all models that are asked for.

    Parameters
    ----------
    request : Request
        Database, folder, targets and models.
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
    models = models_named(list(request.models))
    with Interruption(listening=True) as interruption:
        for target in _targets(request, models, executor, interruption, searched=False):
            _fit_baselines(target, models)
    return interruption.signal


def tune(request: Request, executor: Executor, given: Mapping[str, Space] | None = None) -> int:
    """Search the models' grids, then fit, score and time the winners.

    Parameters
    ----------
    request : Request
        Database, folder, targets, models, and the time for all searches.
    executor : Executor
        Does the fits.
    given : mapping, optional
        A grid for each model; those of `learn.comparison.search.spaces` if left out. Boosting whose
        first trees are no model of their own (DART, linear, or stopped early) is refused.

    Returns
    -------
    int
        Number of the signal that stopped the job, 0 if none did.

    Raises
    ------
    InputError
        For input that cannot be used.
    """
    models = models_named(list(request.models))
    grids = _grids(request, models, given)
    with Interruption(listening=True) as interruption:
        clock = Clock("tune", request, grids)
        for target in _targets(request, models, executor, interruption, searched=True):
            for model in _left(target, models, clock):
                with target.searching(model, *grids[model.name], clock) as (grid_search, share):
                    _tune_model(target, grid_search, share)
        if not interruption.requested():
            clock.close()
    return interruption.signal


def estimate(request: Request, executor: Executor) -> int:
    """Estimate the times of the models' whole grids from fits that are drawn at random.

    Parameters
    ----------
    request : Request
        Database, folder, targets, models, and the time for all estimates.
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
    models = models_named(list(request.models))
    grids = _grids(request, models)
    with Interruption(listening=True) as interruption:
        clock = Clock("estimate", request, grids)
        for target in _targets(request, models, executor, interruption, searched=True):
            for model in _left(target, models, clock):
                with target.searching(model, *grids[model.name], clock) as (grid_search, share):
                    cost = whole_grid.estimate(grid_search, share or Share(0.0))
                    if cost is not None:
                        write_cost(target.folder, grid_search, cost)
        if not interruption.requested():
            clock.close()
    return interruption.signal


def _grids(
    request: Request, models: list[Model], given: Mapping[str, Space] | None = None
) -> dict[str, tuple[str, Space]]:
    """Return the name and the values of each model's grid, before any row is read."""
    grids = {model.name: spaces.of(model.name, request.features) for model in models}
    if given is not None:
        grids = {model.name: (spaces.GIVEN, given[model.name]) for model in models}
    for model in models:
        require_served(model, grids[model.name][1])
    return grids


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
    for rows in dataset.read_targets(
        request.database, request.targets, request.area_max, request.features, hybrid
    ):
        if not stopping():
            folder, training = prepare(request, rows, models, searched=searched)
            yield _Target(request, folder, training, executor, stopping)


def _fit_baselines(target: _Target, models: list[Model]) -> None:
    """Fit and time the baselines that the folder lacks, one at a time."""
    request, folder = target.request, target.folder
    with RunProgress(len(models), "models") as progress:
        for model in models:
            there = folder.result("baseline", model.name) is not None
            if target.stopping():
                return
            if request.again or not there:
                task = TimedFit(model.name, spaces.baseline(model.name, request.features))
                result = target.timed(task)
                write_fit(folder, task, target.training, result)
                print_result(progress.say, task, result)
            progress.advance(1, 0)


def _left(target: _Target, models: list[Model], clock: Clock) -> Iterator[Model]:
    """Yield the models whose searches the job still lacks, until a signal comes."""
    for model in models:
        if not target.stopping() and not clock.ended(target.name, model.name):
            yield model


def _tune_model(target: _Target, grid_search: GridSearch, share: Share | None) -> None:
    """Search one model's grid, and fit and time the winner, which may be the baseline."""
    folder, model = target.folder, grid_search.model
    search = grid_search.exhaustive() if share is None else budget.search(grid_search, share)
    if target.stopping():
        return
    every_fit_failed = search is not None and not search.scores.scored and search.scores.failures
    if search is None or not search.scores.decided or every_fit_failed:
        write_failure(folder, model, search)
    elif target.request.again or not has_winner(folder, grid_search, search):
        result = target.timed(winner_of(grid_search, search))
        write_search(folder, grid_search, search, result)
