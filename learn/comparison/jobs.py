"""The jobs: fit the models' baselines, tune them over their grids, estimate what that takes."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from gen.runtime import farm
from gen.runtime.interruption import Interruption
from gen.runtime.progress import RunProgress
from learn import split
from learn.comparison import budget, pruning, search, spaces, training_data, whole_grid
from learn.comparison.folder import Folder
from learn.comparison.preparation import prepared
from learn.comparison.results import is_there, keep, keep_cost, keep_tuned, tell
from learn.comparison.task import Task, expected_work
from learn.comparison.timing import Final, Outcome, measure
from learn.comparison.trials import Trials
from learn.models import Model, chosen
from learn.request import Request, pressed_for


@dataclass(frozen=True)
class Ended:
    """How a job ended, the same on every process: the number of a signal, 0 if none came."""

    signal: int = 0


def compare(request: Request, world: farm.World) -> Ended:
    """Fit, score and time the baselines; every process of the world has to call it.

    Raises
    ------
    InputError
        For input that cannot be used; the workers leave by `gen.runtime.farm.MasterLeft` then.
    """

    def work(models: list[Model], folder: Folder | None, interruption: Interruption) -> None:
        _measure_all(request, models, folder, world, interruption)

    return _each_target(work, request, world, searched=False)


def tune(request: Request, world: farm.World) -> Ended:
    """Search the grids, then fit, score and time the winners; every process has to call it.

    Raises
    ------
    InputError
        For input that cannot be used; the workers leave by `gen.runtime.farm.MasterLeft` then.
    """
    return _one_by_one(_tune_model, request, world)


def estimate(request: Request, world: farm.World) -> Ended:
    """Time fits that are drawn from the grids at random; every process of the world has to call it.

    Raises
    ------
    InputError
        For input that cannot be used; the workers leave by `gen.runtime.farm.MasterLeft` then.
    """
    return _one_by_one(_estimate_model, request, world)


Step = Callable[[Request, Model, Folder | None, farm.World, Interruption, float | None], None]


def _one_by_one(step: Step, request: Request, world: farm.World) -> Ended:
    """Do what grids are concerned with, model after model, each in its share of the time left."""
    end = None if request.limit is None else time.monotonic() + request.limit
    left = len(chosen(list(request.models))) * len(request.targets)

    def work(models: list[Model], folder: Folder | None, interruption: Interruption) -> None:
        nonlocal left
        for model in models:
            limit = None if end is None else max(end - time.monotonic(), 0.0) / left
            left -= 1
            if not world.broadcast(interruption.requested()):
                step(request, model, folder, world, interruption, limit)

    return _each_target(work, request, world, searched=True)


Work = Callable[[list[Model], Folder | None, Interruption], None]


def _each_target(work: Work, request: Request, world: farm.World, *, searched: bool) -> Ended:
    """Prepare the data of one target after the other, and work on it until a signal comes."""
    with _job(request, world) as (interruption, models):
        pressed = pressed_for(request, world, interruption.requested)
        for target in request.targets:
            if world.broadcast(interruption.requested()):
                break
            with prepared(request, target, models, world, pressed, searched=searched) as folder:
                work(models, folder, interruption)
    return _ended(interruption, world)


@contextmanager
def _job(request: Request, world: farm.World) -> Iterator[tuple[Interruption, list[Model]]]:
    """Check what needs no file, and listen for signals."""
    models = chosen(list(request.models))
    with Interruption(listening=world.is_master) as interruption:
        yield interruption, models


def _measure_all(
    request: Request,
    models: list[Model],
    folder: Folder | None,
    world: farm.World,
    interruption: Interruption,
) -> None:
    """Measure the baselines that the folder lacks, one at a time."""
    with _progress(len(models), "models", world) as progress:
        for model in models:
            there = folder is not None and folder.result("baseline", model.name) is not None
            if world.broadcast(interruption.requested()):
                return
            if not world.broadcast(there and not request.again):
                settings = spaces.baseline(model.name, request.features)
                outcome = _alone(Final(model.name, settings), world)
                if folder is not None and outcome is not None:
                    keep(folder, "baseline", model, settings, outcome, {})
                    tell(progress, model, "baseline", outcome)
            if progress is not None:
                progress.advance(1, 0)


def _tune_model(
    request: Request,
    model: Model,
    folder: Folder | None,
    world: farm.World,
    interruption: Interruption,
    limit: float | None,
) -> None:
    """Search one model's grid, and measure the winner."""
    source, space = spaces.of(model.name, request.features)
    if request.spaces is not None:
        source, space = spaces.GIVEN, request.spaces[model.name]
    grid = pruning.grid(model, space, training_data.held().inputs.shape[1])
    with _trials(model, folder) as trials:
        searched = _searched(model, grid, trials, world, interruption, limit)
        if world.broadcast(interruption.requested()):
            return
        final: Final | None = None
        if searched is not None and searched.found.winner >= 0:
            final = Final(model.name, grid.differing[searched.found.winner], tuned=True)
        done = final is not None and folder is not None and not request.again
        done = done and is_there(folder, model, final, searched, source)
        if not world.broadcast(done):
            final = world.broadcast(final)
            outcome = None if final is None else _alone(final, world)
            if folder is not None:
                keep_tuned(folder, model, grid, source, searched, outcome)


def _estimate_model(
    request: Request,
    model: Model,
    folder: Folder | None,
    world: farm.World,
    interruption: Interruption,
    limit: float | None,
) -> None:
    """Estimate what one model's grid takes."""
    source, space = spaces.of(model.name, request.features)
    grid = pruning.grid(model, space, training_data.held().inputs.shape[1])
    stopping = interruption.requested
    with _trials(model, folder) as trials:
        cost = whole_grid.measure(model, grid, trials, world, limit or 0.0, stopping)
        if folder is not None and cost is not None:
            keep_cost(folder, model, source, cost)


@contextmanager
def _trials(model: Model, folder: Folder | None) -> Iterator[Trials | None]:
    """Open the finished fits on the master, None elsewhere."""
    if folder is None:
        yield None
        return
    path = folder.path / "trials" / f"{model.name}.jsonl"
    with Trials(path, folder.record()["conditions"]) as trials:
        yield trials


def _searched(
    model: Model,
    grid: pruning.Grid,
    trials: Trials | None,
    world: farm.World,
    interruption: Interruption,
    limit: float | None,
) -> budget.Searched | None:
    """Search the whole grid, or what the time allows."""
    stopping = interruption.requested
    if limit is not None:
        return budget.search(model, grid, trials, world, limit, stopping)
    rows = training_data.held().target.size
    todo: list[Task] = []
    if trials is not None:
        everything = range(len(grid.differing))
        todo = search.tasks(model, grid, everything, rows, trials)
        # The dearest first: what is left at the end is short, so that no process waits long.
        todo.sort(key=expected_work, reverse=True)
    search.work_off(
        todo,
        trials,
        world,
        stopping=stopping,
        title=(
            f"{model.title}: {grid.nominal} candidates, {len(grid.differing)} differ,"
            f" {split.FOLDS * len(grid.families)} fits, {len(todo)} to do"
        ),
    )
    if trials is None:
        return None
    found = search.rank(grid, trials, rows)
    return budget.Searched(found, rows, budget.WHOLE, found.seconds)


def _alone(final: Final, world: farm.World) -> Outcome | None:
    """Measure on one worker while all others wait; the outcome on the master."""
    came: list[Outcome] = []
    farm.run(
        measure,
        iter([final] if world.is_master else []),
        lambda task, outcome: came.append(outcome),
        world,
    )
    return came[0] if came else None


@contextmanager
def _progress(total: int, noun: str, world: farm.World) -> Iterator[RunProgress | None]:
    if not world.is_master:
        yield None
        return
    with RunProgress(total, noun) as progress:
        yield progress


def _ended(interruption: Interruption, world: farm.World) -> Ended:
    return Ended(world.broadcast(interruption.signal))
