"""Fit surrogates: read, split into three sets, choose settings, fit, calibrate, judge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError
from gen.runtime.terminal import command_to_type
from learn import dataset, split
from learn.comparison.folder import Folder, Settings, targets
from learn.comparison.paper import OPTIMA
from learn.database_rows import Dataset
from learn.dataset import TARGETS, Request, results, short_name
from learn.executor import Executor
from learn.features.scene import SCENE
from learn.features.sets import Scaling
from learn.kernel_ridge import left_out_errors
from learn.metrics import no_better
from learn.models import (
    EVERY,
    POPULATION,
    STEP,
    check_memory,
    pipeline,
    remarks,
    scaling_of,
)
from learn.split import Folds
from learn.surrogate import card
from learn.surrogate.calibration import (
    CLOSED,
    Plan,
    calibrate,
    plan_calibration,
    rows_of_another,
)
from learn.surrogate.interval import Calibration, ErrorScale
from learn.surrogate.learnt import Clip, Fit, Learnt, clip_of
from learn.surrogate.model import Surrogate
from learn.surrogate.scale import NO_POWERS, keeps_its_scale, scale_ranges

SEARCH_ROWS = 3000  # largest number of training rows of the small searches
LIKELIHOOD_ROWS = 800  # rows for the likelihood of a kernel with a length for every input
# lengths that the search for the most likely one starts from
LENGTHS = (0.1, 1.0, 10.0, 100.0)
USUAL_LENGTH = 10.0  # length of standardised inputs that the search starts from too
GAMMAS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
# settings of the small searches, by model
CANDIDATES: dict[str, list[dict[str, Any]]] = {
    "kernel-ridge": [
        {"kernel": "rbf", "gamma": gamma, "alpha": alpha}
        for gamma in GAMMAS
        for alpha in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
    ],
    "svm": [
        {"kernel": "rbf", "gamma": gamma, "C": penalty, "epsilon": 0.01}
        for gamma in GAMMAS[2:]
        for penalty in (10.0, 100.0, 1000.0)
    ],
}
# settings where nothing is searched; the mean of a population chooses its own
BUILT_IN: dict[str, dict[str, Any]] = {
    "mlp": {  # for features without units two layers suffice
        "hidden_layer_sizes": (100, 50),
        "activation": "tanh",
        "solver": "lbfgs",
        "alpha": 1e-2,
        "max_iter": 3000,
        "max_fun": 6000,
    },
    POPULATION.name: {},
}
SCORED = "R2 {r2:.3f} %, nMAE {nmae:.2f} %"  # the scores that a user is told
# calibration of a model that is not calibrated yet
UNCALIBRATED = Calibration((), ErrorScale(np.empty(0), 0.0, 0.0, 0.0))


def choose(request: Request, train: Dataset, target: Values, folds: Folds) -> Settings:
    """Choose the settings of a fit.

    Parameters
    ----------
    request : Request
        The fit, of one model. The settings are those of a comparison's winner if it names a folder.
    train : Dataset
        The n training rows.
    target : ndarray, shape (n,)
        Their targets, on the scale that models are trained on.
    folds : ndarray, shape (n,)
        Fold of each row. A search fits its candidates without the first fold, and takes the one
        with the smallest error there.

    Returns
    -------
    Settings
        The settings, and their origin.

    Raises
    ------
    InputError
        If the folder has no winner of the model, or no candidate can be fitted.
    """
    (name,) = request.models
    if request.source is not None:
        return _tuned(Folder(request.source / short_name(train.target_name)), name)
    if name == "gaussian-process":
        return _most_likely(request, train.inputs, target)
    as_published = request.features == "paper" and request.normalisation == "l2"
    if name in BUILT_IN and not as_published:
        return Settings(dict(BUILT_IN[name]), False, "built in")
    if name not in CANDIDATES or as_published:
        return Settings(dict(OPTIMA[name]), True, "the paper's optimum")
    return _search(request, train.inputs, target, folds)


def _search(request: Request, inputs: Values, target: Values, folds: Folds) -> Settings:
    """Return the candidate with the smallest error on the first fold, fitted to the others."""
    (name,) = request.models
    # The first fold is 0, unless a few large groups have filled the first folds together.
    validating = folds == folds.min()
    fitted = np.flatnonzero(~validating)[:SEARCH_ROWS]
    smallest = np.inf
    best: dict[str, Any] | None = None
    for values in CANDIDATES[name]:
        # A tiny alpha makes singular matrices; the error shows it.
        candidate = _fit_pipeline(
            request, Settings(values, False, ""), inputs[fitted], target[fitted]
        )
        predicted = candidate.pipeline.predict(inputs[validating])
        error = float(np.mean((predicted - target[validating]) ** 2))
        if error < smallest:
            smallest = error
            best = values
    if best is None:
        raise InputError(f"{name}: no candidate of the built-in search could be fitted")
    origin = f"best of {len(CANDIDATES[name])} on a validation fold"
    return Settings(best, False, origin)


def _tuned(folder: Folder, model: str) -> Settings:
    """Return the settings of the winner of a model's search, or refuse a folder without one."""
    winner = folder.winner(model)
    if winner is None:
        tuned = [
            part.path.name for part in targets(folder.path.parent) if part.winner(model)
        ]
        other_targets = ""
        if tuned:
            other_targets = f"give --target {','.join(tuned)}, or first "
        tune = command_to_type(f"learn tune --model {model} --target {folder.path.name}")
        raise InputError(
            f"--from: {folder.path} has no tuned {model}: {other_targets}{tune}"
        )
    return winner


def with_conditions(request: Request, choice: Any) -> Request:
    """Take features, load, scaling, rows and seed of a request from a comparison's folder.

    Parameters
    ----------
    request : Request
        A fit of one model.
    choice : learn.commands.fit.Choice
        Options of the user, of which `source` is the folder.

    Returns
    -------
    Request
        The same fit under the conditions of the comparison.

    Raises
    ------
    InputError
        If the folder lacks the model for a target, or contradicts an option of the user.
    """
    source: Path = choice.source
    options = {**choice._asdict(), "normalisation": choice.normalise}
    folders = [
        Folder(source / short_name(TARGETS.get(target, target)))
        for target in request.targets
    ]
    # Comparisons of earlier versions do not state features and load.
    conditions = {
        "features": "paper",
        "load": request.load,
        **folders[0].record().conditions.content(),
    }
    for folder in folders:
        _tuned(folder, request.models[0])
    names = ("features", "load", "normalisation", "area_max", "seed")
    for name in names:
        if options.get(name) not in {None, "", conditions[name]}:
            raise InputError(
                f"--from: {folders[0].path} was made with {name} {conditions[name]!r}, not"
                f" {options[name]!r}: leave that out, or give another folder"
            )
    return replace(request, source=source, **{name: conditions[name] for name in names})


def _most_likely(request: Request, inputs: Values, target: Values) -> Settings:
    """Return the most likely radial basis function with a length for each input, and noise.

    The likelihood has several maxima, and is flat where the lengths are far too short. Kernels with
    one length for all inputs are fitted quickly. They are therefore searched first, from lengths
    over four decades. The lengths of the inputs start from the best of these, and from
    `USUAL_LENGTH`.
    """
    inputs = inputs[:LIKELIHOOD_ROWS]
    target = target[:LIKELIHOOD_ROWS]
    likelihood = attrgetter("log_marginal_likelihood_value_")
    with_one_length = [
        _fit_process(request, inputs, target, np.array([length])) for length in LENGTHS
    ]
    best = max(with_one_length, key=likelihood)
    starts = sorted({float(best.kernel_.k1.k2.length_scale), USUAL_LENGTH})
    with_lengths = [
        _fit_process(request, inputs, target, np.full(inputs.shape[1], length))
        for length in starts
    ]
    kernel = max([best, *with_lengths], key=likelihood).kernel_
    return Settings(
        {"kernel": kernel, "optimizer": None, "alpha": 1e-10},
        False,
        f"kernel of the largest likelihood on {len(target)} rows, from"
        f" {len(LENGTHS) + len(starts)} starts",
    )


def _fit_process(
    request: Request, inputs: Values, target: Values, lengths: Values
) -> Any:
    """Fit amplitude, lengths and noise of a Gaussian process by their likelihood.

    Lengths that end at a bound do not matter.
    """
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    kernel = ConstantKernel(10.0, (1e-2, 1e5)) * RBF(lengths, (1e-2, 1e4))
    kernel += WhiteKernel(1e-3, (1e-9, 1.0))
    values = {"kernel": kernel, "optimizer": "fmin_l_bfgs_b", "alpha": 1e-10}
    fitted = _fit_pipeline(request, Settings(values, False, ""), inputs, target)
    return fitted.pipeline.named_steps[STEP]


def fit(
    request: Request,
    executor: Executor,
    say: Callable[[str], None],
    stopping: Callable[[], bool] = lambda: False,
) -> Surrogate | None:
    """Fit a surrogate to databases.

    Parameters
    ----------
    request : Request
        The fit, of one model.
    executor : Executor
        Generates surfaces for hybrid features.
    say : callable
        Called with each line for the user.
    stopping : callable
        Returns True after a stop; called between surfaces.

    Returns
    -------
    Surrogate or None
        The surrogate; None after a stop.

    Raises
    ------
    InputError
        If the input cannot be used, rows or memory do not suffice, or a target is predicted no
        better than by a constant.
    """
    sets = dataset.read(request, executor, stopping, common=True)
    if not sets:
        return None
    calibrating: list[Dataset] | None = None
    if request.calibrate_on is not None:
        databases = (*request.databases, request.calibrate_on)
        with_another = replace(request, databases=databases)
        together = dataset.read(with_another, executor, stopping, common=True)
        if not together:
            return None
        calibrating = rows_of_another(sets, together)
    parts = split.draw(
        sets[0],
        request.seed,
        request.train_rows,
        further_targets=sets[1:],
        tiles=split.TILES,
    )
    surrogate = fit_parts(request, sets, parts, say, calibrating)
    require_better(surrogate, str(request.databases[0]))
    return surrogate


def require_better(surrogate: Surrogate, name: str) -> None:
    """Refuse a surrogate of which a target is predicted no better than by a constant.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate.
    name : str
        Name of its database or file in the message.

    Raises
    ------
    InputError
        If a target is predicted no better; the message names the first of these.
    """
    for target, entry in surrogate.card["targets"].items():
        fault = no_better(entry["scores"]["r2"])
        if fault:
            raise InputError(
                f"{name}: {target}: {fault}; try another --model, or more rows"
            )


def fit_parts(
    request: Request,
    sets: list[Dataset],
    parts: split.Split,
    say: Callable[[str], None],
    calibrating: list[Dataset] | None = None,
) -> Surrogate:
    """Fit a surrogate to rows that are split already.

    Parameters
    ----------
    request : Request
        The fit, of one model.
    sets : list of Dataset
        The usable rows for each target, from `dataset.read`.
    parts : Split
        Their training and test rows.
    say : callable
        Called with each line for the user.
    calibrating : list of Dataset, optional
        Rows of another database, for each target, which calibrate instead of training rows.

    Returns
    -------
    Surrogate
        The surrogate, with scores on the test rows.

    Raises
    ------
    InputError
        If there are too few rows to train on, or too little memory.
    """
    rows = sets[0]
    other = None if calibrating is None else calibrating[0]
    plan = plan_calibration(request.models[0], rows.at(parts.train), other)
    sizes = {
        "train": parts.train.size,
        "calibration": plan.groups.labels.size,
        "test": parts.test.size,
    }
    for line in _lines_on_rows(request, rows, other, sizes, plan):
        say(line)
    fitted = _fit_targets(request, sets, parts, plan, calibrating, say)
    models = fitted.learnt.values()
    largest_level = min(model.calibration.largest_level for model in models)
    say(f"  {card.level_line(largest_level)}")
    whole_card = card.make(request, rows, parts.train, sizes, fitted.entries)
    whole_card["calibration"] = {**plan.entry, "largest_level": largest_level}
    if not all(keeps_its_scale(model.powers, rows.features) for model in models):
        whole_card["own_scale"] = scale_ranges(rows, parts.train)
    scenes = [origin.scene for origin in rows.origins]
    ranges = rows.features.ranges(scenes, rows.inputs[parts.train])
    return Surrogate(
        card=whole_card,
        learnt=fitted.learnt,
        low=ranges.low,
        high=ranges.high,
        distance=plan.distance,
    )


@dataclass(frozen=True, eq=False)
class _FittedTargets:
    """The models of all targets, by the names of the targets."""

    learnt: dict[str, Learnt]
    entries: dict[str, dict[str, Any]]  # of the card


def _fit_targets(
    request: Request,
    sets: list[Dataset],
    parts: split.Split,
    plan: Plan,
    calibrating: list[Dataset] | None,
    say: Callable[[str], None],
) -> _FittedTargets:
    """Fit and judge the model of each target, and report it to the user by `say`.

    Parameters are those of `fit_parts`, and the plan which rows calibrate.
    """
    learnt: dict[str, Learnt] = {}
    entries: dict[str, dict[str, Any]] = {}
    for number, target in enumerate(request.targets):
        train = sets[number].at(parts.train)
        other = None if calibrating is None else calibrating[number]
        fitted = fit_target(request, train, plan, parts.folds, other=other)
        entry = card.judge(fitted, sets[number], parts.test)
        if plan.remark and fitted.left_out is not None:
            entry["left_out"] = card.scores_of(fitted.learnt, train, fitted.left_out)
        for line in _lines_on_target(target, sets[number], fitted, entry):
            say(line)
        learnt[target] = fitted.learnt
        entries[target] = entry
    return _FittedTargets(learnt, entries)


def _lines_on_rows(
    request: Request,
    rows: Dataset,
    other: Dataset | None,
    sizes: dict[str, int],
    plan: Plan,
) -> list[str]:
    """Return the lines for the user on the rows that train, calibrate and test."""
    remarks_on_rows = list(dataset.remarks(rows, request.normalisation))
    if other is not None:
        for remark in dataset.damage_of(other):
            if remark not in remarks_on_rows:
                remarks_on_rows.append(remark)
    lines = [f"  {remark}" for remark in remarks_on_rows]
    lines.append(
        f"{rows.name}: {sizes['train']} rows train, {sizes['calibration']} calibrate,"
        f" {sizes['test']} test; {request.features} features"
    )
    if plan.remark:
        lines.append(f"  {plan.remark}")
    return lines


def _lines_on_target(
    target: str, rows: Dataset, fitted: Fit, entry: dict[str, Any]
) -> list[str]:
    """Return the lines for the user on the fit of a target, of which `entry` is in the card."""
    score = SCORED.format(**entry["scores"])
    lines = [
        f"{rows.target_name}: {entry['settings_from']}; {score}, fit {fitted.fitting:.3g} s"
    ]
    if "left_out" in entry:
        lines.append(f"  left out in turn: {SCORED.format(**entry['left_out'])}")
    lines += [f"  warning: {remark}" for remark in entry["remarks"]]
    if not keeps_its_scale(fitted.learnt.powers, rows.features):
        lines.append(f"  {target}: {NO_POWERS}")
    return lines


def fit_target(
    request: Request,
    train: Dataset,
    plan: Plan,
    folds: Folds,
    settings: Settings | None = None,
    other: Dataset | None = None,
) -> Fit:
    """Fit the model of one target, and calibrate its intervals.

    Training rows that calibrate are predicted by further fits with the same settings, each without
    a part of them, unless one fit gives all of their errors.

    Parameters
    ----------
    request : Request
        The fit, of one model.
    train : Dataset
        The n training rows.
    plan : Plan
        Which rows calibrate, from `plan_calibration` of these training rows.
    folds : ndarray, shape (n,)
        Fold of each training row; the first fold validates the candidates of a search.
    settings : Settings, optional
        Settings of the model; chosen by `choose` if left out.
    other : Dataset, optional
        Rows of another database that calibrate, if the plan says so.

    Returns
    -------
    Fit
        The model with its intervals, times and warnings.

    Raises
    ------
    InputError
        If this machine lacks the memory, or a comparison's folder lacks the model.
    """
    (name,) = request.models
    check_memory(name, train.size)
    scaling = _scaling_for(request, train)
    target = scaling.scaled(train.target)
    clip = clip_of(train)
    clipped = replace(train, inputs=clip.clipped(train.inputs))
    start = process_time()
    if settings is None:
        settings = choose(request, clipped, target, folds)
    chosen = process_time()
    fitted = _fit_pipeline(request, settings, clipped.inputs, target, train.groups)
    end = process_time()
    learnt = _learnt_of(train, fitted.pipeline, scaling, clip)
    left_out = None
    if other is None:
        left_out = _predict_left_out(request, settings, train, target, learnt, plan)
        raw = left_out[plan.calibrating]
        other = train.at(plan.calibrating)
    else:
        raw = learnt.raw(other.inputs)
    # Errors of roots differ less between small and large values of a target that is never below 0.
    never_negative = learnt.bounds[0] == 0
    calibration = calibrate(other, plan, raw, root=never_negative)
    return Fit(
        learnt=replace(learnt, calibration=calibration),
        settings=settings,
        choosing=chosen - start,
        fitting=end - chosen,
        remarks=fitted.remarks,
        left_out=left_out,
    )


def _scaling_for(request: Request, train: Dataset) -> Scaling:
    """Return the scaling of a target over the training rows.

    Settings of a comparison were tuned for the target as the paper has it.
    """
    (name,) = request.models
    of_scene = request.features == SCENE and name != POPULATION.name
    of_process = name == "gaussian-process" and request.source is None
    return scaling_of(train, np.arange(train.size), standard=of_scene or of_process)


def _learnt_of(train: Dataset, fitted: Any, scaling: Scaling, clip: Clip) -> Learnt:
    """Return the fitted pipeline of a target with its column, not yet calibrated."""
    columns = results(train.origins[0].scene, train.features.load)
    column = columns[train.target_name]
    return Learnt(
        column=column.name,
        unit=column.unit,
        pipeline=fitted,
        scaling=scaling,
        calibration=UNCALIBRATED,
        clip=clip,
        bounds=column.bounds,
        powers=train.powers,
    )


@dataclass(frozen=True, eq=False)
class _FittedPipeline:
    """A fitted pipeline of scikit-learn."""

    pipeline: Any
    remarks: tuple[str, ...]  # warnings of the fit


def _fit_pipeline(
    request: Request,
    settings: Settings,
    inputs: Values,
    target: Values,
    surfaces: Indices | None = None,
) -> _FittedPipeline:
    """Fit the model of a request to features, (n, d), and scaled targets, (n,).

    Numbers of the surfaces, (n,), matter to the mean of a population only.
    """
    (name,) = request.models
    unfitted = pipeline(
        EVERY[name],
        settings.values,
        normalisation=request.normalisation,
        seed=request.seed,
        tuned=settings.tuned,
    )
    options = {}
    if name == POPULATION.name:
        options[f"{STEP}__surfaces"] = surfaces
    with remarks() as warnings:
        fitted = unfitted.fit(inputs, target, **options)
    return _FittedPipeline(fitted, tuple(warnings))


def _predict_left_out(
    request: Request,
    settings: Settings,
    train: Dataset,
    target: Values,
    learnt: Learnt,
    plan: Plan,
) -> Values:
    """Predict training rows, over the target's scale, by models that have not seen their part.

    `target` are the training rows' targets on the scale that models are trained on, (n,). Rows that
    are in no part of the plan are NaN.
    """
    (name,) = request.models
    if name == POPULATION.name and plan.groups.are_surfaces:
        model = learnt.pipeline.named_steps[STEP]
        return learnt.scaling.restored(model.left_out_)
    if name in CLOSED and name != POPULATION.name:
        try:
            return _left_out_by_one_fit(target, learnt, plan)
        except np.linalg.LinAlgError:
            pass  # The matrix is singular: further fits can deal with it.
    return _left_out_by_further_fits(request, settings, train, target, learnt, plan)


def _left_out_by_one_fit(target: Values, learnt: Learnt, plan: Plan) -> Values:
    """Predict left out rows, (n,), from the one fit to all training rows.

    `target` is on the scale of the training, the result is not. Features keep the scaling of all
    training rows, and are not clipped to the ranges of the rows seen: errors are, if anything,
    larger. LinAlgError is raised if the kernel's matrix is singular.
    """
    model = learnt.pipeline.named_steps[STEP]
    errors = left_out_errors(model, [holdout.unseen for holdout in plan.holdouts])
    predicted = np.full(target.size, np.nan)
    for holdout, error in zip(plan.holdouts, errors, strict=True):
        # Both arrays ascend, so that errors and rows of the part have the same order.
        is_in_part = np.isin(holdout.unseen, holdout.rows)
        predicted[holdout.rows] = target[holdout.rows] - error[is_in_part]
    return learnt.scaling.restored(predicted)


def _left_out_by_further_fits(
    request: Request,
    settings: Settings,
    train: Dataset,
    target: Values,
    learnt: Learnt,
    plan: Plan,
) -> Values:
    """Return predictions of left out rows by a further fit for each part."""
    predicted = np.full(train.size, np.nan)
    for holdout in plan.holdouts:
        seen = np.setdiff1d(np.arange(train.size), holdout.unseen)
        clip = clip_of(train.at(seen))
        fitted = _fit_pipeline(
            request,
            settings,
            clip.clipped(train.inputs[seen]),
            target[seen],
            train.groups[seen],
        )
        without_part = replace(learnt, pipeline=fitted.pipeline, clip=clip)
        predicted[holdout.rows] = without_part.raw(train.inputs[holdout.rows])
    return predicted
