"""Fit surrogates: read, split into three sets, choose settings, fit, calibrate."""

from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.runtime.errors import InputError
from learn import dataset, memory, split
from learn.arrays import Indices, Values
from learn.columns import TARGETS, short_name
from learn.comparison.folder import Folder
from learn.dataset import Dataset
from learn.executor import Executor
from learn.metrics import no_better
from learn.models import models_named
from learn.request import Request, hybrid_for
from learn.surrogate import card
from learn.surrogate.calibration_rows import of_another, planned
from learn.surrogate.fitting import fit_target
from learn.surrogate.learnt import Learnt
from learn.surrogate.model import Surrogate
from learn.surrogate.settings import tuned_conditions

TILES = 4
"""Smallest number of tiles, one each to train, to validate settings, to calibrate and to test."""


def fit(
    request: Request,
    executor: Executor,
    say: Callable[[str], None],
    *,
    source: Path | None = None,
    stopping: Callable[[], bool] = lambda: False,
) -> Surrogate | None:
    """Fit a surrogate to a database.

    Parameters
    ----------
    request : Request
        Request with one model; its folder is not used.
    executor : Executor
        Generates the surfaces for hybrid features.
    say : callable
        Called with lines for the user.
    source : Path, optional
        Comparison folder whose tuned settings are used.
    stopping : callable
        Called between surfaces; True ends the work.

    Returns
    -------
    Surrogate or None
        The surrogate; None after a stop.

    Raises
    ------
    InputError
        If the input cannot be used, or there are too few rows or too little memory.
    """
    models_named(list(request.models))
    sets = read(request, executor, stopping)
    if sets is None:
        return None
    others = None
    if request.calibrate_on is not None:
        wider = replace(request, others=(*request.others, request.calibrate_on))
        together = read(wider, executor, stopping)
        if together is None:
            return None
        others = of_another(sets, together)
    parts = split.draw(sets[0], request.seed, request.train_rows, others=sets[1:])
    fitted = fit_parts(request, sets, parts, say, source=source, others=others)
    require_better(fitted, str(request.database))
    return fitted


def require_better(surrogate: Surrogate, name: str) -> None:
    """Refuse a surrogate of which a target is predicted no better than by a constant.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate, with scores on the test rows in its card.
    name : str
        Name of the database or file in the message.

    Raises
    ------
    InputError
        With the first of these targets.
    """
    for target, judged in surrogate.card["targets"].items():
        if worst := no_better(judged["scores"]["r2"]):
            raise InputError(f"{name}: {target}: {worst}; try another --model, or more rows")


def read(
    request: Request, executor: Executor, stopping: Callable[[], bool] = lambda: False
) -> list[Dataset] | None:
    """Read the rows that all targets have, one dataset for each target.

    Parameters
    ----------
    request : Request
        Databases, targets and features.
    executor : Executor
        Generates the surfaces for hybrid features.
    stopping : callable
        Called between surfaces; True ends the work.

    Returns
    -------
    list of Dataset or None
        The datasets, in the order of the targets; None after a stop.

    Raises
    ------
    InputError
        If the input cannot be used, there are too few rows, or windows lie in too few tiles.
    """
    hybrids: list[Values | None] = []
    for path in request.databases:
        hybrids.append(hybrid_for(replace(request, database=path), executor, stopping))
        if stopping():
            return None
    sets = _read(request, hybrids)
    split.require_tiles(sets[0], TILES)
    return sets


def fit_parts(
    request: Request,
    sets: list[Dataset],
    parts: split.Split,
    say: Callable[[str], None],
    *,
    source: Path | None = None,
    others: list[Dataset] | None = None,
) -> Surrogate:
    """Fit a surrogate to rows whose training and test parts have been chosen.

    Parameters
    ----------
    request : Request
        Request with one model.
    sets : list of Dataset
        The rows, from `read`.
    parts : learn.split.Split
        Positions of the training rows, in random order with groups together, and of the test rows.
    say : callable
        Called with lines for the user.
    source : Path, optional
        Comparison folder whose tuned settings are used.
    others : list of Dataset, optional
        Rows of another database that calibrate the intervals, for each target.

    Raises
    ------
    InputError
        If there are too few rows to train on, or too little memory.
    """
    (model,) = models_named(list(request.models))
    plan = planned(sets[0], parts.train, others)
    train = plan.train
    memory.check(model.name, train.size)
    for rows in sets:
        if np.ptp(rows.target[train]) == 0:
            raise InputError(
                f"{rows.source['database']}: {rows.target_name} does not vary over the"
                f" {train.size} rows that are left to train on: more are needed"
            )
    for line in dataset.remarks(sets[0], request.normalisation):
        say(f"  {line}")
    say(
        f"{sets[0].source['database']}: {train.size} rows train, {plan.size} calibrate,"
        f" {parts.test.size} test; {request.features} features"
    )
    if plan.remark():
        say(f"  {plan.remark()}")
    learnt: dict[str, Learnt] = {}
    judged: dict[str, dict[str, Any]] = {}
    folds = parts.folds[: train.size]
    for number, (target, rows) in enumerate(zip(request.targets, sets, strict=True)):
        folder = None if source is None else Folder(source / short_name(rows.target_name))
        calibration = plan.rows(rows, number)
        learnt[target], judged[target] = _fit_target(
            request, rows, (train, calibration, parts.test), folds, folder, say
        )
    inputs = sets[0].inputs[train]
    sizes = {"train": train.size, "calibration": plan.size, "test": parts.test.size}
    made = card.make(request, sets[0], train, sizes, judged)
    entry = plan.entry()
    return Surrogate(
        card=made if entry is None else made | {"calibration": entry},
        learnt=learnt,
        low=inputs.min(axis=0),
        high=inputs.max(axis=0),
        distance=plan.distance(sets[0]),
    )


def _read(request: Request, hybrids: list[Values | None]) -> list[Dataset]:
    """Return one dataset per target, of the rows that all targets have."""
    sets = dataset.read_together(
        request.databases,
        request.targets,
        request.area_max,
        request.features,
        hybrids,
        roots=request.roots,
        blocks=request.blocks,
    )
    keys = [each.keys for each in sets]
    common = reduce(np.intersect1d, keys)
    found = [
        each.at(np.flatnonzero(np.isin(key, common))) for each, key in zip(sets, keys, strict=True)
    ]
    for each in found:
        dataset.require_usable(each)
    return found


def _fit_target(
    request: Request,
    rows: Dataset,
    parts: tuple[Indices, Dataset | None, Indices],
    folds: NDArray[np.int8],
    folder: Folder | None,
    say: Callable[[str], None],
) -> tuple[Learnt, dict[str, Any]]:
    """Choose settings for the model of one target, fit, calibrate and score it."""
    train, calibration, test = parts
    fit = fit_target(request, rows.at(train), calibration, folds, folder=folder)
    scored = card.judge(fit.learnt, rows, test)
    worst = filter(None, [no_better(scored["scores"]["r2"])])
    judged = scored | {
        "settings": {name: str(value) for name, value in sorted(fit.settings.values.items())},
        "settings_from": fit.settings.origin,
        "fit_seconds": fit.fitting,
        "remarks": [*fit.remarks, *worst],
    }
    if fit.crossed is not None:
        judged["left_out"] = card.left_out(fit.learnt, rows.at(train), fit.crossed)
    scores = judged["scores"]
    say(
        f"{rows.target_name}: {fit.settings.origin}; R2 {scores['r2']:.3f} %, nMAE"
        f" {scores['nmae']:.2f} %, fit {fit.fitting:.3g} s"
    )
    if "left_out" in judged:
        left_out = judged["left_out"]
        say(f"  left out in turn: R2 {left_out['r2']:.3f} %, nMAE {left_out['nmae']:.2f} %")
    for remark in judged["remarks"]:
        say(f"  warning: {remark}")
    return fit.learnt, judged


def request_from(request: Request, source: Path, given: dict[str, Any]) -> Request:
    """Take features, scaling, rows and seed from a comparison; given options must agree.

    Parameters
    ----------
    request : Request
        Request with one model and its targets.
    source : Path
        Comparison folder.
    given : dict of str to object
        Options of the user, of "features", "normalisation", "area_max" and "seed".

    Raises
    ------
    InputError
        If the folder lacks the model, or contradicts an option.
    """
    column = TARGETS.get(request.targets[0], request.targets[0])
    folder = Folder(source / short_name(column))
    conditions = tuned_conditions(folder, request.models[0])
    names = ("features", "normalisation", "area_max", "seed")
    for name in names:
        if name in given and given[name] != conditions[name]:
            raise InputError(
                f"--from: {folder.path} was made with {name} {conditions[name]!r}, not"
                f" {given[name]!r}: leave that out, or give another folder"
            )
    return replace(request, **{name: conditions[name] for name in names})
