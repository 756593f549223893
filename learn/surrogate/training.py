"""Fit surrogates: read, split by surface into three sets, choose settings, fit, calibrate."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.runtime.errors import InputError
from learn import dataset, memory, split
from learn.arrays import Indices, Values
from learn.comparison.folder import Folder
from learn.dataset import Dataset
from learn.executor import Executor
from learn.models import models_named
from learn.request import Request, hybrid_for
from learn.surrogate import card
from learn.surrogate.fitting import fit_target
from learn.surrogate.learnt import Learnt
from learn.surrogate.model import Surrogate
from learn.surrogate.settings import tuned_conditions

CALIBRATION_SHARE = 0.1
"""Share of the training rows that are used to calibrate the intervals instead."""

SMALLEST_CALIBRATION = 20
"""Smallest number of calibration rows, for intervals of 95 %, if there are five times as many."""


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
    (model,) = models_named(list(request.models))
    hybrid = hybrid_for(request, executor, stopping)
    if stopping():
        return None
    sets = _read(request, hybrid)
    parts = split.draw(sets[0], request.seed, request.train_rows)
    train, calibration = without_calibration(sets[0], parts.train)
    memory.check(model.name, train.size)
    for line in dataset.remarks(sets[0], request.normalisation):
        say(f"  {line}")
    say(
        f"{request.database}: {train.size} rows train, {calibration.size} calibrate,"
        f" {parts.test.size} test; {request.features} features"
    )
    learnt: dict[str, Learnt] = {}
    judged: dict[str, dict[str, Any]] = {}
    folds = parts.folds[: train.size]
    for target, rows in zip(request.targets, sets, strict=True):
        folder = None if source is None else Folder(source / dataset.short_name(rows.target_name))
        learnt[target], judged[target] = _fit_target(
            request, rows, (train, calibration, parts.test), folds, folder, say
        )
    inputs = sets[0].inputs[train]
    return Surrogate(
        card=card.make(request, sets[0], (train, calibration, parts.test), judged),
        learnt=learnt,
        low=inputs.min(axis=0),
        high=inputs.max(axis=0),
    )


def _read(request: Request, hybrid: Values | None) -> list[Dataset]:
    """Return one dataset per target, of the rows that all targets have."""
    sets = dataset.read_targets(
        request.database, request.targets, request.area_max, request.features, hybrid
    )
    common = sets[0].rows
    for each in sets[1:]:
        common = np.intersect1d(common, each.rows)
    return [each.at(np.flatnonzero(np.isin(each.rows, common))) for each in sets]


def without_calibration(rows: Dataset, train: Indices) -> tuple[Indices, Indices]:
    """Split the last rows, by whole surfaces, off the training rows, which are in random order.

    Parameters
    ----------
    rows : Dataset
        The usable rows.
    train : ndarray of int
        Positions of the training rows, from `learn.split.draw`.

    Returns
    -------
    train, calibration : ndarray of int
        Positions of the rows that train, and of those that calibrate.

    Raises
    ------
    InputError
        If too few rows are left to train on.
    """
    wanted = max(int(CALIBRATION_SHARE * train.size), min(SMALLEST_CALIBRATION, train.size // 5))
    groups = rows.groups[train]
    starts = np.flatnonzero(np.diff(groups, prepend=-1))
    if starts.size == 1:  # all rows share one surface
        starts = np.arange(train.size)
    before = int(np.searchsorted(starts, train.size - wanted, side="right")) - 1
    cut = int(starts[max(before, 1)])
    inside = train[:cut]
    if inside.size < 2 or np.ptp(rows.target[inside]) == 0:
        raise InputError(
            f"{rows.source['database']}: {inside.size} rows of {starts.size} surfaces are left to"
            " train on: more are needed"
        )
    return inside, train[cut:]


def _fit_target(
    request: Request,
    rows: Dataset,
    parts: tuple[Indices, Indices, Indices],
    folds: NDArray[np.int8],
    folder: Folder | None,
    say: Callable[[str], None],
) -> tuple[Learnt, dict[str, Any]]:
    """Choose settings for the model of one target, fit, calibrate and score it."""
    train, calibration, test = parts
    fit = fit_target(request, rows.at(train), rows.at(calibration), folds, folder=folder)
    judged = card.judge(fit.learnt, rows, test) | {
        "settings": {name: str(value) for name, value in sorted(fit.settings.values.items())},
        "settings_from": fit.settings.origin,
        "fit_seconds": fit.fitting,
        "remarks": list(fit.remarks),
    }
    scores = judged["scores"]
    say(
        f"{rows.target_name}: {fit.settings.origin}; R2 {scores['r2']:.3f} %, nMAE"
        f" {scores['nmae']:.2f} %, fit {fit.fitting:.3g} s"
    )
    for remark in fit.remarks:
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
    column = dataset.TARGETS.get(request.targets[0], request.targets[0])
    folder = Folder(source / dataset.short_name(column))
    conditions = tuned_conditions(folder, request.models[0])
    names = ("features", "normalisation", "area_max", "seed")
    for name in names:
        if name in given and given[name] != conditions[name]:
            raise InputError(
                f"--from: {folder.path} was made with {name} {conditions[name]!r}, not"
                f" {given[name]!r}: leave that out, or give another folder"
            )
    return replace(request, **{name: conditions[name] for name in names})
