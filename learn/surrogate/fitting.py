"""Fit surrogates: read, split into three sets, choose settings, fit, calibrate, judge."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from sklearn.kernel_ridge import KernelRidge

from gen.runtime.errors import InputError
from gen.scene import Scene
from learn import dataset, memory, split
from learn.arrays import Folds, Indices, Values
from learn.columns import TARGETS, results, short_name
from learn.comparison.folder import Folder
from learn.dataset import Dataset
from learn.executor import Executor
from learn.features import chosen
from learn.kernel_ridge import left_out_errors
from learn.metrics import no_better
from learn.models import MODELS, STEP, models_named, pipeline, remarks, scaling_of
from learn.request import Request, hybrid_for
from learn.surrogate import calibration as calibrating
from learn.surrogate import card, interval
from learn.surrogate.calibration import Plan, groups_of, holdout_squares, holdouts, near
from learn.surrogate.flag import Distance
from learn.surrogate.interval import Calibration, Growth
from learn.surrogate.learnt import Clip, Learnt, clip_of
from learn.surrogate.model import Surrogate
from learn.surrogate.settings import Settings, choose, tuned_conditions

TILES = 4
"""Smallest number of tiles, one each to train, to validate settings, to calibrate and to test."""

NOT_CALIBRATED = Calibration(np.empty(0), (np.empty(0),))


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
        If the input cannot be used, there are too few rows or too little memory, or a target is
        predicted no better than by a constant.
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
        others = calibrating.of_another(sets, together)
    parts = split.draw(sets[0], request.seed, request.train_rows, others=sets[1:])
    fitted = fit_parts(request, sets, parts, say, source=source, others=others)
    require_better(fitted, str(request.database))
    return fitted


def require_better(surrogate: Surrogate, name: str) -> None:
    """Refuse a surrogate of which a target is predicted no better than by a constant.

    InputError names the database or file, and the first of these targets.
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
    sets = dataset.read_together(
        request.databases,
        request.targets,
        request.area_max,
        request.features,
        hybrids,
        roots=request.roots,
        blocks=request.blocks,
    )
    common = reduce(np.intersect1d, [each.keys for each in sets])
    sets = [each.at(np.flatnonzero(np.isin(each.keys, common))) for each in sets]
    for each in sets:
        dataset.require_usable(each)
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
    plan = calibrating.planned(sets[0], parts.train, others)
    train, name = plan.train, sets[0].source["database"]
    memory.check(model.name, train.size)
    for rows in sets:
        if np.ptp(rows.target[train]) == 0:
            raise InputError(
                f"{name}: {rows.target_name} does not vary over the {train.size} rows that are left"
                " to train on: more are needed"
            )
    for line in dataset.remarks(sets[0], request.normalisation):
        say(f"  {line}")
    say(
        f"{name}: {train.size} rows train, {plan.size} calibrate, {parts.test.size} test;"
        f" {request.features} features"
    )
    if plan.remark():
        say(f"  {plan.remark()}")
    learnt: dict[str, Learnt] = {}
    judged: dict[str, dict[str, Any]] = {}
    for number, (target, rows) in enumerate(zip(request.targets, sets, strict=True)):
        folder = None if source is None else Folder(source / short_name(rows.target_name))
        folds = parts.folds[: train.size]
        fitted = fit_target(request, rows.at(train), plan.rows(rows, number), folds, folder=folder)
        learnt[target], judged[target] = fitted.learnt, _judged(fitted, rows, plan, parts.test)
        for line in _said(rows.target_name, judged[target]):
            say(line)
    inputs = sets[0].inputs[train]
    sizes = {"train": train.size, "calibration": plan.size, "test": parts.test.size}
    return Surrogate(
        card=card.make(request, sets[0], train, sizes, judged) | plan.entry(),
        learnt=learnt,
        low=inputs.min(axis=0),
        high=inputs.max(axis=0),
        distance=plan.distance(sets[0]),
    )


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


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted model of one target, with times and warnings of the fit.

    Attributes
    ----------
    learnt : Learnt
        Model and intervals.
    settings : Settings
        Settings of the model.
    choosing, fitting : float
        Processor times of the choice of settings and of the fit [s].
    remarks : tuple of str
        Warnings of the fit.
    crossed : ndarray, shape (training rows,), optional
        Predictions over their scale by models that have not seen the group, or the surface, of
        each training row, where these calibrate the intervals.
    """

    learnt: Learnt
    settings: Settings
    choosing: float
    fitting: float
    remarks: tuple[str, ...]
    crossed: Values | None = None


def _judged(fitted: Fit, rows: Dataset, plan: Plan, test: Indices) -> dict[str, Any]:
    """Return the card's entry of a target."""
    scored = card.judge(fitted.learnt, rows, test)
    judged = scored | {
        "settings": {name: str(each) for name, each in sorted(fitted.settings.values.items())},
        "settings_from": fitted.settings.origin,
        "fit_seconds": fitted.fitting,
        "remarks": [*fitted.remarks, *filter(None, [no_better(scored["scores"]["r2"])])],
    }
    if fitted.crossed is not None:
        judged["left_out"] = card.left_out(fitted.learnt, rows.at(plan.train), fitted.crossed)
    return judged


def _said(name: str, judged: dict[str, Any]) -> list[str]:
    """Return the lines about the fit of a target."""
    scores, seconds = judged["scores"], judged["fit_seconds"]
    score = f"R2 {scores['r2']:.3f} %, nMAE {scores['nmae']:.2f} %"
    lines = [f"{name}: {judged['settings_from']}; {score}, fit {seconds:.3g} s"]
    if left_out := judged.get("left_out"):
        score = f"R2 {left_out['r2']:.3f} %, nMAE {left_out['nmae']:.2f} %"
        lines.append(f"  left out in turn: {score}")
    return lines + [f"  warning: {remark}" for remark in judged["remarks"]]


def fit_target(
    request: Request,
    train: Dataset,
    calibration: Dataset | None,
    folds: Folds,
    *,
    folder: Folder | None = None,
    settings: Settings | None = None,
) -> Fit:
    """Fit and calibrate the model of one target, after a choice of settings if none are given.

    Parameters
    ----------
    request : Request
        Request with one model; its database is not used.
    train : Dataset
        Rows with one target, perhaps of several databases.
    calibration : Dataset or None
        Rows that calibrate. None to calibrate with the training rows, which have to be of several
        maps or databases: further fits, with the same settings, leave out some of them each.
    folds : ndarray of int, shape (training rows,)
        Fold of each training row; the first one validates the candidates of the search.
    folder : Folder, optional
        Comparison whose tuned settings are used.
    settings : Settings, optional
        Settings of an earlier fit.

    Raises
    ------
    InputError
        If this machine lacks the memory, or the folder lacks the model.
    """
    (name,) = request.models
    memory.check(name, train.size)
    roots = chosen(request.features, roots=request.roots).rooted
    # Settings of a comparison were tuned for the target as the paper has it.
    standard = name == "gaussian-process" and folder is None
    scaling = scaling_of(train, np.arange(train.size), roots=roots, standard=standard)
    target = scaling.scaled(train.target)
    began = process_time()
    settings = settings or choose(request, folder, train.inputs, target, folds)
    chose = process_time()
    fitted, said = _fitted(request, settings, train.inputs, target)
    done = process_time()
    column = results(Scene.from_text(train.source["scene"]))[train.target_name]
    own = NOT_CALIBRATED, _clip(train), column.bounds
    learnt = Learnt(column.name, column.unit, fitted, scaling, *own)
    crossed = None
    if calibration is None:
        crossed = _crossed(request, settings, train, target, learnt)
    intervals = _calibrated(learnt, train, target, calibration, crossed)
    learnt = replace(learnt, calibration=intervals)
    return Fit(learnt, settings, chose - began, done - chose, said, crossed)


def _fitted(
    request: Request, settings: Settings, inputs: Values, target: Values
) -> tuple[Any, tuple[str, ...]]:
    """Return a fitted pipeline and the warnings of its fit."""
    (name,) = request.models
    unfitted = pipeline(
        MODELS[name],
        settings.values,
        normalisation=request.normalisation,
        seed=request.seed,
        tuned=settings.tuned,
    )
    with remarks() as said:
        fitted = unfitted.fit(inputs, target)
    return fitted, tuple(said)


def _clip(train: Dataset) -> Clip | None:
    """Return the training ranges that moments are clipped to; None for features with units."""
    if not chosen(train.features).scaled:
        return None
    return clip_of(train.names, train.inputs.min(axis=0), train.inputs.max(axis=0))


def _crossed(
    request: Request, settings: Settings, train: Dataset, target: Values, learnt: Learnt
) -> Values:
    """Predict the training rows over their scale by models that have not seen their groups.

    Kernel ridge needs no further fits; its features then keep the scaling of all training rows, and
    moments beyond those of the other groups are not clipped: errors are, if anything, larger.
    """
    groups = groups_of(train)
    if groups is None:
        raise ValueError("rows of one map or database cannot be calibrated by groups")
    parts = list(holdouts(train, groups.left_out(train)))
    found = _ridge_left_out(learnt, target, parts)
    if found is not None:
        return found
    found = np.empty(train.size)
    for mine, unseen in parts:
        others = np.setdiff1d(np.arange(train.size), unseen)
        fitted, _ = _fitted(request, settings, train.inputs[others], target[others])
        without = replace(learnt, pipeline=fitted, clip=_clip(train.at(others)))
        found[mine] = without.raw(train.inputs[mine])
    return found


def _ridge_left_out(
    learnt: Learnt, target: Values, parts: Sequence[tuple[Indices, Indices]]
) -> Values | None:
    """Predict the training rows over their scale without further fits; None if that is impossible.

    The model is one of kernel ridge, fitted to all rows and their scaled target, (n,); `parts` come
    from `holdouts`.
    """
    found, ridge = np.empty(target.size), learnt.pipeline.named_steps[STEP]
    if isinstance(ridge, KernelRidge):
        with suppress(np.linalg.LinAlgError):  # a singular matrix: further fits deal with it
            errors = left_out_errors(ridge, [unseen for _, unseen in parts])
            for (mine, unseen), error in zip(parts, errors, strict=True):
                found[mine] = target[mine] - error[np.isin(unseen, mine)]
            return learnt.scaling.restored(found)
    return None


def _calibrated(
    learnt: Learnt,
    train: Dataset,
    target: Values,
    calibration: Dataset | None,
    crossed: Values | None,
) -> Calibration:
    """Calibrate intervals by rows that calibrate, or by the training rows and `crossed`."""
    rows = train if calibration is None else calibration
    raw = learnt.raw(rows.inputs) if crossed is None else crossed
    groups, root = groups_of(rows), learnt.scaling.root
    errors = _errors(raw, rows, root=root)
    if groups is not None and groups.scheme == "others":
        return calibrating.calibrate_by_groups(rows, errors, groups, root=root)
    distance = near(train)
    if crossed is None or groups is None:
        squares = np.square(distance.of(rows.inputs))
    else:
        squares = holdout_squares(train, list(holdouts(train, groups.left_out(train))))
    growth = _growth(learnt, distance, train, target) or interval.fit_growth(
        distance, squares, errors, _kinds(raw, rows)
    )
    if groups is None:
        return interval.calibrate(
            raw, rows.target, train.target, rows.inputs, root=root, growth=growth
        )
    return calibrating.calibrate_by_groups(
        rows, errors, groups, root=root, growth=growth, squares=squares
    )


def _growth(learnt: Learnt, distance: Distance, train: Dataset, target: Values) -> Growth | None:
    """Fit the growth of the errors by clusters of the training that are left out in turn.

    None for models other than kernel ridge, which would need a fit for each cluster, and for few
    surfaces.
    """
    clusters = calibrating.clusters_of(train)
    if clusters is None:
        return None
    parts = list(holdouts(train, clusters))
    raw = _ridge_left_out(learnt, target, parts)
    if raw is None:
        return None
    errors = _errors(raw, train, root=learnt.scaling.root)
    return interval.fit_growth(distance, holdout_squares(train, parts), errors, _kinds(raw, train))


def _errors(raw: Values, rows: Dataset, *, root: bool) -> Values:
    """Return the absolute errors of predictions over their scale, or of their roots, (n,)."""
    change = np.sqrt if root else np.asarray
    return np.asarray(np.abs(change(raw) - change(rows.target)))


def _kinds(raw: Values, rows: Dataset) -> Indices:
    """Return the kind of each row, (n,): rows of one kind are compared with each other."""
    return calibrating.near_labels(rows) * interval.RANGES + interval.ranges_of(raw)
