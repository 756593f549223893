"""The two jobs: fit the baselines of the models, and tune them over their grids."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from gen import farm
from gen.errors import InputError
from gen.interruption import Interruption
from gen.progress import RunProgress
from learn import budget, dataset, features, memory, pruning, search, split
from learn.dataset import Values
from learn.folder import Folder, conditions
from learn.models import NORMALISATIONS, Model, chosen
from learn.spaces import SPACES, Space
from learn.timing import Final, Outcome, measure
from learn.trials import Trials


@dataclass(frozen=True)
class Request:
    """What to compare and where.

    Attributes
    ----------
    database : made by `gen`
    output : the comparison folder
    targets : one or more of "area", "force" or further columns
    models : names; all nine for none
    area_max : largest area that is kept [%], None for all
    normalisation : one of `learn.models.NORMALISATIONS`
    features : a name of `learn.features.SETS`
    seed : of the split and of the models
    train_rows : training rows at most, None for all
    again : True to measure anew what is there
    limit : time for the searches [s], None for whole grids
    spaces : search spaces by model
    """

    database: Path
    output: Path
    targets: tuple[str, ...] = ("area",)
    models: tuple[str, ...] = ()
    area_max: float | None = None
    normalisation: str = "l2"
    features: str = "paper"
    seed: int = 0
    train_rows: int | None = None
    again: bool = False
    limit: float | None = None
    spaces: dict[str, Space] = field(default_factory=lambda: SPACES)


@dataclass(frozen=True)
class Ended:
    """How a job ended, the same on every process: the number of a signal, 0 if none came."""

    signal: int = 0


def compare(request: Request, world: farm.World) -> Ended:
    """Fit, score and time the baselines; every process of the world has to call it.

    Raises
    ------
    InputError
        On every process alike, for input that cannot be used.
    """
    with _job(request, world) as (interruption, models):
        pressed = pressed_for(request, world, interruption.requested)
        for target in request.targets:
            if world.broadcast(interruption.requested()):
                break
            with _prepared(request, target, models, world, pressed, searched=False) as folder:
                _measure_all(request, models, folder, world, interruption)
    return _ended(interruption, world)


def tune(request: Request, world: farm.World) -> Ended:
    """Search the grids, then fit, score and time the winners; every process has to call it.

    Raises
    ------
    InputError
        On every process alike, for input that cannot be used.
    """
    end = None if request.limit is None else time.monotonic() + request.limit
    with _job(request, world) as (interruption, models):
        left = len(models) * len(request.targets)
        pressed = pressed_for(request, world, interruption.requested)
        for target in request.targets:
            if world.broadcast(interruption.requested()):
                break
            with _prepared(request, target, models, world, pressed, searched=True) as folder:
                for model in models:
                    limit = None if end is None else max(end - time.monotonic(), 0.0) / left
                    left -= 1
                    if not world.broadcast(interruption.requested()):
                        _tune_model(request, model, folder, world, interruption, limit)
    return _ended(interruption, world)


@contextmanager
def _job(request: Request, world: farm.World) -> Iterator[tuple[Interruption, list[Model]]]:
    """Check what needs no file, and listen for signals."""
    models = chosen(list(request.models))
    if request.normalisation not in NORMALISATIONS:
        known = ", ".join(NORMALISATIONS)
        raise InputError(f"--normalise {request.normalisation!r}: give one of {known}")
    with Interruption(listening=world.is_master) as interruption:
        yield interruption, models


def pressed_for(request: Request, world: farm.World, stopping: Callable[[], bool]) -> Values | None:
    """What the database's surfaces add to the features, if they need it; collective.

    Parameters
    ----------
    request : says which features
    world : whose processes generate the surfaces
    stopping : asked on the master between surfaces
    """
    if not features.chosen(request.features).needs_surface:
        return None
    from learn.features.regeneration import pressed_rows

    return pressed_rows(request.database, world, stopping)


@contextmanager
def _prepared(
    request: Request,
    target: str,
    models: list[Model],
    world: farm.World,
    pressed: Values | None,
    *,
    searched: bool,
) -> Iterator[Folder | None]:
    """Read the data on the master and give it to all; the folder on the master, None elsewhere."""
    folder: Folder | None = None
    training: search.Training | None = None
    refusal = ""
    if world.is_master:
        try:
            training, folder = _read(request, target, models, pressed, searched=searched)
        except InputError as error:
            refusal = str(error)
    refusal = world.broadcast(refusal)
    if refusal:
        raise InputError(refusal)
    search.hold(training, world)
    yield folder


def _read(
    request: Request,
    target: str,
    models: list[Model],
    pressed: Values | None,
    *,
    searched: bool,
) -> tuple[search.Training, Folder]:
    """Read the rows, split them, refuse what is too large, and open the folder."""
    rows = dataset.read(request.database, target, request.area_max, request.features, pressed)
    parts = split.draw(rows, request.seed, request.train_rows)
    if searched:
        split.check_folds(parts)
    for model in models:
        memory.check(model.name, parts.train.size, baseline=not searched)
    short = {column: name for name, column in dataset.TARGETS.items()}
    folder = Folder(request.output / short.get(rows.target_name, rows.target_name))
    agreed = conditions(rows, parts, request.normalisation, {"area_max": request.area_max})
    with RunProgress(1) as progress:
        folder.begin(rows, parts, agreed)
        progress.say(
            f"{request.database}: {rows.target_name}, {parts.train.size} training rows,"
            f" {parts.test.size} test rows, {rows.features} features"
        )
        for line in dataset.remarks(rows, request.normalisation):
            progress.say(f"  {line}")
        if not parts.by_surface:
            progress.say("  all rows share one surface: they are split one by one")
    training = search.Training(
        inputs=rows.inputs[parts.train],
        target=rows.target[parts.train],
        folds=parts.folds,
        test_inputs=rows.inputs[parts.test],
        test_target=rows.target[parts.test],
        normalisation=request.normalisation,
        seed=request.seed,
    )
    return training, folder


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
                outcome = _alone(Final(model.name), world)
                if folder is not None and outcome is not None:
                    _keep(folder, "baseline", model, {}, outcome, {})
                    _tell(progress, model, "baseline", outcome)
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
    grid = pruning.grid(model, request.spaces[model.name], search.held().inputs.shape[1])
    with ExitStack() as stack:
        trials: Trials | None = None
        refusal = ""
        if folder is not None:
            try:
                path = folder.path / "trials" / f"{model.name}.jsonl"
                trials = stack.enter_context(Trials(path, folder.record()["conditions"]))
            except InputError as error:
                refusal = str(error)
        refusal = world.broadcast(refusal)
        if refusal:
            raise InputError(refusal)
        searched = _searched(model, grid, trials, world, interruption, limit)
        if world.broadcast(interruption.requested()):
            return
        final: Final | None = None
        if searched is not None and searched.found.winner >= 0:
            final = Final(model.name, grid.differing[searched.found.winner], tuned=True)
        done = final is not None and folder is not None and not request.again
        done = done and _is_there(folder, model, final, searched)
        if not world.broadcast(done):
            final = world.broadcast(final)
            outcome = None if final is None else _alone(final, world)
            if folder is not None:
                _keep_tuned(folder, model, grid, searched, outcome)


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
    rows = search.held().target.size
    todo: list[search.Task] = []
    if trials is not None:
        everything = range(len(grid.differing))
        todo = search.tasks(model, grid, everything, rows, trials)
        # The dearest first: what is left at the end is short, so that no process waits long.
        todo.sort(key=search.expected_work, reverse=True)
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
    return budget.Searched(search.rank(grid, trials, rows), rows, "whole grid")


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


def _is_there(
    folder: Folder | None, model: Model, final: Final | None, searched: budget.Searched | None
) -> bool:
    """Whether the winner has been measured already."""
    result = None if folder is None else folder.result("tuned", model.name)
    return (
        result is not None
        and final is not None
        and searched is not None
        and result["settings_key"] == pruning.key(final.settings)
        and result["search"]["how"] == searched.how
        and result["search"]["candidates_scored"] == _scored(searched)
    )


def _scored(searched: budget.Searched) -> int:
    return sum(not math.isnan(mean) for mean in searched.found.means)


def _keep_tuned(
    folder: Folder,
    model: Model,
    grid: pruning.Grid,
    searched: budget.Searched | None,
    outcome: Outcome | None,
) -> None:
    """Write what a search has found."""
    if searched is None or outcome is None:
        why = "no candidate was finished within the time"
        if searched is not None:
            why = "; ".join(searched.found.failures) or why
        folder.write_json(
            f"tuned/{model.name}.json", {"model": model.name, "failure": why, "remarks": []}
        )
        _say(f"warning: {model.title}: {why}")
        return
    found = searched.found
    report = {
        "how": searched.how,
        "rows": searched.rows,
        "candidates": grid.nominal,
        "candidates_differing": len(grid.differing),
        "candidates_scored": _scored(searched),
        "fits_nominal": split.FOLDS * grid.nominal,
        "fits": found.fits,
        "r2_folds": [100 * float(score) for score in found.scores[found.winner]],
        "failures": found.failures,
        "remarks": found.remarks,
    }
    folder.write_table(f"tuned/{model.name}-grid.csv", *_candidates(grid, found))
    _keep(folder, "tuned", model, grid.first(found.winner), outcome, report, found.seconds)
    for text, number in [*found.failures.items(), *found.remarks.items()]:
        _say(f"{model.title}: {number} of {found.scores.size} scores: {text}")
    _tell(None, model, "tuned", outcome)


def _candidates(grid: pruning.Grid, found: search.Found) -> tuple[list[str], list[list[object]]]:
    """Table of all candidates as the paper counts them, in ParameterGrid's order."""
    names = list(grid.candidates[0])
    folds = [f"r2_fold_{fold}" for fold in range(split.FOLDS)]
    rows: list[list[object]] = []
    for candidate, number in zip(grid.candidates, grid.canonical, strict=True):
        scored = [float(found.means[number]), *map(float, found.scores[number])]
        rows.append([*(candidate[name] for name in names), number, *scored])
    return [*names, "differing_candidate", "r2_mean", *folds], rows


def _keep(
    folder: Folder,
    kind: str,
    model: Model,
    settings: pruning.Settings,
    outcome: Outcome,
    report: dict[str, Any],
    search_seconds: float = 0.0,
) -> None:
    """Write a model's result; predictions first, so that a result is never without them."""
    test = search.held().test_target
    rows = enumerate(zip(test.tolist(), outcome.prediction.tolist(), strict=False))
    folder.write_table(
        f"{kind}/{model.name}.csv",
        ("test_row", "truth", "prediction"),
        ((number, *pair) for number, pair in rows),
    )
    canonical = pruning.canonical_settings(model, settings, search.held().inputs.shape[1])
    folder.write_json(
        f"{kind}/{model.name}.json",
        {
            "model": model.name,
            "settings": settings,
            "settings_key": pruning.key(canonical),
            "refit": dict(model.refit) if kind == "tuned" else {},
            "fitted": outcome.fitted,
            "test": None if outcome.test is None else asdict(outcome.test),
            "train": None if outcome.train is None else asdict(outcome.train),
            "failure": outcome.failure,
            "remarks": list(outcome.remarks),
            "search": report,
            "times": {**vars(outcome.times), "search": search_seconds},
        },
    )


def _tell(progress: RunProgress | None, model: Model, kind: str, outcome: Outcome) -> None:
    """Say a result, and what its fit warned of."""
    say: Callable[[str], None] = _say if progress is None else progress.say
    if outcome.test is None:
        say(f"warning: {model.title}, {kind}: {outcome.failure}")
        return
    times = outcome.times
    say(
        f"{model.title}, {kind}: R2 {outcome.test.r2:.2f} %, nMAE {outcome.test.nmae:.2f} %,"
        f" fit {times.fit:.3g} s, prediction {times.test:.3g} s"
    )
    for remark in outcome.remarks:
        say(f"  warning: {remark}")


def _say(line: str) -> None:
    with RunProgress(1) as progress:
        progress.say(line)


@contextmanager
def _progress(total: int, noun: str, world: farm.World) -> Iterator[RunProgress | None]:
    if not world.is_master:
        yield None
        return
    with RunProgress(total, noun) as progress:
        yield progress


def _ended(interruption: Interruption, world: farm.World) -> Ended:
    return Ended(world.broadcast(interruption.signal))
