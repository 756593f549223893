"""Fits of surrogates.

`fit` reads the databases and splits the rows into training and test rows. For each target,
`fit_target` chooses settings, fits the model to the training rows, and calibrates its intervals by
models that have not seen a part of these rows. The test rows judge the model and its intervals
(`learn.surrogate.card.judge`).
"""

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
from learn.comparison.folder import Folder, Settings
from learn.comparison.folder import targets as target_folders
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

# Largest number of rows to which a built-in search fits its candidates.
SEARCH_ROWS = 3000
# Largest number of rows by which the kernel of a Gaussian process is chosen.
LIKELIHOOD_ROWS = 800
# Lengths of standardised inputs from which searches for the most likely length of all inputs start.
LENGTHS = (0.1, 1.0, 10.0, 100.0)
# Length from which a search for the most likely length of each input starts, besides the best
# length of all inputs.
USUAL_LENGTH = 10.0
# Factors of squared distances between standardised inputs, which the built-in searches try.
GAMMAS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
# Candidates of the built-in searches, by model.
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
# Settings of models without a built-in search, on top of their baselines.
BUILT_IN: dict[str, dict[str, Any]] = {
    "mlp": {  # Two layers suffice for features without units.
        "hidden_layer_sizes": (100, 50),
        "activation": "tanh",
        "solver": "lbfgs",
        "alpha": 1e-2,
        "max_iter": 3000,
        "max_fun": 6000,
    },
    POPULATION.name: {},  # The fit itself chooses its lengths and variances.
}
SCORED = "R2 {r2:.3f} %, nMAE {nmae:.2f} %"  # scores in the lines for the user
# Calibration of a model before it is calibrated. It has no scores.
UNCALIBRATED = Calibration(
    scores=(), usual=ErrorScale(slopes=np.empty(0), offset=0.0, low=0.0, high=0.0)
)


def choose(request: Request, train: Dataset, target: Values, folds: Folds) -> Settings:
    """Choose the settings of a fit.

    If the request names the folder of a comparison, the settings are those of its winner.
    Otherwise, a Gaussian process has the most likely kernel. With the paper's features and rows of
    unit length, all other models have the paper's optimum. With other features, kernel ridge and
    the SVM have the candidate with the smallest error on the first fold, and the remaining models
    have fixed settings, from `BUILT_IN` or the paper's optimum.

    Parameters
    ----------
    request : Request
        The fit, of one model.
    train : Dataset
        The n training rows.
    target : ndarray, shape (n,)
        Targets of these rows, on the scale that models are trained on.
    folds : ndarray, shape (n,)
        Fold of each row.

    Returns
    -------
    Settings
        The settings, and their origin.

    Raises
    ------
    InputError
        If the folder has no winner of the model or is damaged, or if no candidate of a built-in
        search can be fitted.
    """
    (name,) = request.models
    if request.source is not None:
        return _tuned(Folder(request.source / short_name(train.target_name)), name)
    if name == "gaussian-process":
        return _with_most_likely_kernel(request, train.inputs, target)
    # The paper's optimum holds for its own features, in rows of unit length.
    as_published = request.features == "paper" and request.normalisation == "l2"
    if name in BUILT_IN and not as_published:
        return Settings(values=dict(BUILT_IN[name]), tuned=False, origin="built in")
    if name not in CANDIDATES or as_published:
        return Settings(
            values=dict(OPTIMA[name]), tuned=True, origin="the paper's optimum"
        )
    return _search(request, train.inputs, target, folds)


def _search(request: Request, inputs: Values, target: Values, folds: Folds) -> Settings:
    """Return the settings of the model's `CANDIDATES` with the smallest mean squared error.

    Takes the features, (n, d), the scaled targets, (n,), and the fold of each row, (n,). Candidates
    are fitted to rows outside the first fold, `SEARCH_ROWS` at most, and judged on the rows of the
    first fold. InputError is raised if all errors are NaN or infinite.
    """
    (name,) = request.models
    # The first fold is the smallest number that any row has: fold 0 may be empty if there are a few
    # large groups.
    validating = folds == folds.min()
    fitted = np.flatnonzero(~validating)[:SEARCH_ROWS]
    smallest = np.inf
    best: dict[str, Any] | None = None
    for values in CANDIDATES[name]:
        # A small alpha may make the matrix singular. The warnings of this fit are dropped, because
        # its error is large, so that it is not chosen.
        candidate = _fit_pipeline(
            request,
            Settings(values=values, tuned=False, origin=""),
            inputs[fitted],
            target[fitted],
        )
        predicted = candidate.pipeline.predict(inputs[validating])
        error = float(np.mean((predicted - target[validating]) ** 2))
        if error < smallest:
            smallest = error
            best = values
    if best is None:
        raise InputError(f"{name}: no candidate of the built-in search could be fitted")
    origin = f"best of {len(CANDIDATES[name])} on a validation fold"
    return Settings(values=best, tuned=False, origin=origin)


def _tuned(folder: Folder, model: str) -> Settings:
    """Return the settings of the winner of a model's search, from the folder of one target.

    InputError is raised if there is no winner; it names the targets that have one.
    """
    winner = folder.winner(model)
    if winner is not None:
        return winner
    comparison = folder.path.parent
    other_targets = [
        other.path.name for other in target_folders(comparison) if other.winner(model)
    ]
    advice = ""
    if other_targets:
        advice = f"give --target {','.join(other_targets)}, or first "
    advice += command_to_type(f"learn tune --model {model} --target {folder.path.name}")
    raise InputError(f"--from: {folder.path} has no tuned {model}: {advice}")


def with_conditions(request: Request, choice: Any) -> Request:
    """Replace the conditions of a fit by those of the comparison that its settings come from.

    The conditions are features, load, normalisation, largest area and seed.

    Parameters
    ----------
    request : Request
        A fit of one model.
    choice : learn.commands.fit.Choice
        Options of the user, of which `source` is the folder of the comparison.

    Returns
    -------
    Request
        The fit under the conditions of the comparison, with its folder as `source`.

    Raises
    ------
    InputError
        If the comparison has no winner of the model for a target, is missing or damaged, or an
        option of the user differs from its conditions.
    """
    source: Path = choice.source
    options = {**choice._asdict(), "normalisation": choice.normalise}
    folders = [
        Folder(source / short_name(TARGETS.get(target, target)))
        for target in request.targets
    ]
    # All targets of a comparison have equal conditions. Comparisons of earlier versions do not
    # state features and load.
    conditions = {
        "features": "paper",
        "load": request.load,
        **folders[0].record().conditions.content(),
    }
    # Refuse targets without a winner now; `choose` takes the settings later.
    for folder in folders:
        _tuned(folder, request.models[0])
    names = ("features", "load", "normalisation", "area_max", "seed")
    for name in names:
        # Options that the user did not give are None or "".
        if options.get(name) not in {None, "", conditions[name]}:
            raise InputError(
                f"--from: {folders[0].path} was made with {name} {conditions[name]!r}, not"
                f" {options[name]!r}: leave that out, or give another folder"
            )
    return replace(request, source=source, **{name: conditions[name] for name in names})


def _with_most_likely_kernel(
    request: Request, inputs: Values, target: Values
) -> Settings:
    """Return settings of a Gaussian process with the kernel that is most likely for some rows.

    Takes the features, (n, d), and the scaled targets, (n,); the first `LIKELIHOOD_ROWS` rows are
    used. The kernel is an amplitude times a radial basis function, plus noise. The likelihood has
    several maxima, and is flat where lengths are far too short. Kernels with one length for all
    inputs are therefore fitted first, quickly, with a search from each of `LENGTHS`. Kernels with a
    length for each input are then fitted from the best of these lengths, and from `USUAL_LENGTH`.
    """
    inputs = inputs[:LIKELIHOOD_ROWS]
    target = target[:LIKELIHOOD_ROWS]
    likelihood = attrgetter("log_marginal_likelihood_value_")
    with_one_length = [
        _fit_process(request, inputs, target, np.array([length])) for length in LENGTHS
    ]
    best = max(with_one_length, key=likelihood)
    product = best.kernel_.k1  # The kernel is a sum: k1 is the product, k2 the noise.
    radial_function = product.k2  # The product has the amplitude as k1.
    best_length = float(radial_function.length_scale)
    starts = sorted({best_length, USUAL_LENGTH})
    with_lengths = [
        _fit_process(request, inputs, target, np.full(inputs.shape[1], length))
        for length in starts
    ]
    kernel = max([best, *with_lengths], key=likelihood).kernel_
    # The noise is in the kernel; alpha only keeps its matrix from being singular.
    return Settings(
        values={"kernel": kernel, "optimizer": None, "alpha": 1e-10},
        tuned=False,
        origin=f"kernel of the largest likelihood on {len(target)} rows, from"
        f" {len(LENGTHS) + len(starts)} starts",
    )


def _fit_process(
    request: Request, inputs: Values, target: Values, lengths: Values
) -> Any:
    """Return a fitted Gaussian process whose amplitude, lengths and noise are the most likely ones.

    `inputs` are the features, (n, d), and `target` the scaled targets, (n,). The search starts from
    `lengths`: one for all features, (1,), or one for each feature, (d,). Only the last step of the
    pipeline is returned: it and the lengths are for features as the pipeline scales them.
    """
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    # Each part of the kernel has the value at which its search starts, and the bounds of the
    # search. The length of an input without effect ends at the upper bound; scikit-learn's warning
    # of this is dropped.
    amplitude = ConstantKernel(10.0, (1e-2, 1e5))
    noise = WhiteKernel(1e-3, (1e-9, 1.0))
    kernel = amplitude * RBF(lengths, (1e-2, 1e4)) + noise
    values = {"kernel": kernel, "optimizer": "fmin_l_bfgs_b", "alpha": 1e-10}
    settings = Settings(values=values, tuned=False, origin="")
    fitted = _fit_pipeline(request, settings, inputs, target)
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
        Workers that generate surfaces for hybrid features.
    say : callable
        Called with each line for the user.
    stopping : callable
        Called between surfaces; True ends the fit.

    Returns
    -------
    Surrogate or None
        The surrogate; None if `stopping` ended the fit.

    Raises
    ------
    InputError
        If a database cannot be used; if rows or memory do not suffice; if the database that
        calibrates needs other features than the training; if the settings of the model cannot be
        chosen (see `choose`); or if a target is predicted no better than by a constant.
    """
    # With `common`, only rows that are usable for all targets are read.
    by_target = dataset.read(request, executor, stopping, common=True)
    if not by_target:  # `stopping` has ended the reading.
        return None
    calibrating: list[Dataset] | None = None
    if request.calibrate_on is not None:
        # Nodes and hardness are features only if they differ between rows. All databases are
        # therefore read together: `rows_of_another` refuses the other one if it would bring a
        # further feature.
        databases = (*request.databases, request.calibrate_on)
        with_another = replace(request, databases=databases)
        together = dataset.read(with_another, executor, stopping, common=True)
        if not together:  # `stopping` has ended the reading.
            return None
        calibrating = rows_of_another(by_target, together)
    parts = split.draw(
        by_target[0],
        request.seed,
        request.train_rows,
        further_targets=by_target[1:],
        tiles=split.TILES,
    )
    surrogate = fit_parts(request, by_target, parts, say, calibrating)
    require_better(surrogate, str(request.databases[0]))
    return surrogate


def require_better(surrogate: Surrogate, name: str) -> None:
    """Refuse a surrogate that predicts a target no better than a constant does.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate.
    name : str
        Name of its database or file, for the message.

    Raises
    ------
    InputError
        If R2 of a target on the test rows is not above 0; the message names the first such target.
    """
    for target, entry in surrogate.card["targets"].items():
        fault = no_better(entry["scores"]["r2"])
        if fault:
            raise InputError(
                f"{name}: {target}: {fault}; try another --model, or more rows"
            )


def fit_parts(
    request: Request,
    by_target: list[Dataset],
    parts: split.Split,
    say: Callable[[str], None],
    calibrating: list[Dataset] | None = None,
) -> Surrogate:
    """Fit a surrogate to rows that are split already.

    Parameters
    ----------
    request : Request
        The fit, of one model.
    by_target : list of Dataset
        For each target of the request, the usable rows, from `dataset.read`.
    parts : Split
        Positions of training and test rows among them.
    say : callable
        Called with each line for the user.
    calibrating : list of Dataset, optional
        For each target, rows of another database, which calibrate in place of training rows.

    Returns
    -------
    Surrogate
        The surrogate. Its card has the scores on the test rows.

    Raises
    ------
    InputError
        If this machine lacks the memory, or the settings of the model cannot be chosen (see
        `choose`).
    """
    # All targets have equal rows, features and groups, so that the first one gives them.
    rows = by_target[0]
    other = None
    if calibrating is not None:
        other = calibrating[0]
    plan = plan_calibration(request.models[0], rows.at(parts.train), other)
    sizes = {
        "train": parts.train.size,
        "calibration": plan.groups.labels.size,
        "test": parts.test.size,
    }
    for line in _lines_on_rows(request, rows, other, sizes, plan):
        say(line)
    fitted = _fit_targets(request, by_target, parts, plan, calibrating, say)
    models = fitted.learnt.values()
    largest_level = min(model.calibration.largest_level for model in models)
    say(f"  {card.level_line(largest_level)}")
    whole_card = card.make(request, rows, parts.train, sizes, fitted.entries)
    whole_card["calibration"] = {**plan.entry, "largest_level": largest_level}
    if not all(keeps_its_scale(model.powers, rows.features) for model in models):
        # Rows outside these ranges of heights, lengths and E* are flagged.
        whole_card["own_scale"] = scale_ranges(rows, parts.train)
    scenes = [origin.scene for origin in rows.origins]
    # Rows with a feature outside these ranges are flagged.
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
    """The fitted models of all targets, with their entries of the card."""

    learnt: dict[str, Learnt]  # models by the short names of the targets
    # entries of the card by the short names of the targets, from `card.judge`, with "left_out"
    # added if there are scores of left out rows
    entries: dict[str, dict[str, Any]]


def _fit_targets(
    request: Request,
    by_target: list[Dataset],
    parts: split.Split,
    plan: Plan,
    calibrating: list[Dataset] | None,
    say: Callable[[str], None],
) -> _FittedTargets:
    """Fit the model of each target, score it on the test rows, and report it by `say`.

    `plan` has the rows that calibrate; see `fit_parts` for the other parameters.
    """
    learnt: dict[str, Learnt] = {}
    entries: dict[str, dict[str, Any]] = {}
    for number, target in enumerate(request.targets):
        rows = by_target[number]
        train = rows.at(parts.train)
        other = None
        if calibrating is not None:
            other = calibrating[number]
        fitted = fit_target(request, train, plan, parts.folds, other=other)
        entry = card.judge(fitted, rows, parts.test)
        # Scores of left out rows tell how well a new map, database or surface is predicted.
        if plan.groups.are_several and fitted.left_out is not None:
            entry["left_out"] = card.scores_of(fitted.learnt, train, fitted.left_out)
        for line in _lines_on_target(target, rows, fitted, entry):
            say(line)
        learnt[target] = fitted.learnt
        entries[target] = entry
    return _FittedTargets(learnt=learnt, entries=entries)


def _lines_on_rows(
    request: Request,
    rows: Dataset,
    other: Dataset | None,
    sizes: dict[str, int],
    plan: Plan,
) -> list[str]:
    """Return the lines for the user on the rows that train, calibrate and test.

    `rows` are all usable rows. `other` are the rows of another database that calibrates, or None.
    `sizes` are the numbers of "train", "calibration" and "test" rows.
    """
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
    """Return the lines for the user on the fit of a target.

    `target` is its short name, as "area"; `rows.target_name` is its column, as "area_percent".
    `entry` is the entry of the card for this target.
    """
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

    Training rows that calibrate are predicted by additional fits with equal settings, each without
    a part of these rows, unless the model gives their errors by the fit to all training rows.

    Parameters
    ----------
    request : Request
        The fit, of one model.
    train : Dataset
        The n training rows.
    plan : Plan
        The rows that calibrate, from `plan_calibration` of these training rows.
    folds : ndarray, shape (n,)
        Fold of each training row, by which `choose` judges candidates.
    settings : Settings, optional
        Settings of the model; by default `choose` chooses them.
    other : Dataset, optional
        Rows of another database, with which `plan` was made. They calibrate.

    Returns
    -------
    Fit
        The model with its intervals, times and warnings.

    Raises
    ------
    InputError
        If this machine lacks the memory, or the settings of the model cannot be chosen (see
        `choose`).
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
        calibrating = train.at(plan.calibrating)
    else:
        raw = learnt.raw(other.inputs)
        calibrating = other
    # Errors of the roots of targets that are never negative depend less on the size of the target.
    never_negative = learnt.bounds[0] == 0
    calibration = calibrate(calibrating, plan, raw, root=never_negative)
    return Fit(
        learnt=replace(learnt, calibration=calibration),
        settings=settings,
        choosing=chosen - start,
        fitting=end - chosen,
        remarks=fitted.remarks,
        left_out=left_out,
    )


def _scaling_for(request: Request, train: Dataset) -> Scaling:
    """Return the scaling of a target, by its values in all training rows.

    The target is standardised in two cases: for a scene's own features, unless the model is the
    mean of a population; and for a Gaussian process with a built-in search. In other cases
    `scaling_of` decides.
    """
    (name,) = request.models
    # The mean of a population divides the target by a power law of its own.
    of_scene = request.features == SCENE and name != POPULATION.name
    # The bounds of the search (`_fit_process`) are for standardised targets. Settings of a
    # comparison were tuned for targets as comparisons scale them.
    of_process = name == "gaussian-process" and request.source is None
    return scaling_of(train, np.arange(train.size), standard=of_scene or of_process)


def _learnt_of(train: Dataset, fitted: Any, scaling: Scaling, clip: Clip) -> Learnt:
    """Return the model of a target without calibration, from its fitted pipeline of scikit-learn.

    Column, unit, bounds and powers are those of the target of `train`.
    """
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
    """A fitted pipeline, and the warnings of its fit."""

    pipeline: Any  # pipeline of scikit-learn
    remarks: tuple[str, ...]  # warnings


def _fit_pipeline(
    request: Request,
    settings: Settings,
    inputs: Values,
    target: Values,
    surfaces: Indices | None = None,
) -> _FittedPipeline:
    """Fit the model of a request to features, (n, d), and scaled targets, (n,).

    `surfaces` is the number of the surface of each row, (n,). Only the mean of a population needs
    it.
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
    return _FittedPipeline(pipeline=fitted, remarks=tuple(warnings))


def _predict_left_out(
    request: Request,
    settings: Settings,
    train: Dataset,
    target: Values,
    learnt: Learnt,
    plan: Plan,
) -> Values:
    """Return predictions, (n,), of the training rows, each by a model that has not seen its part.

    `target` are the targets of the rows, (n,), on the scale that models are trained on. The
    predictions are over the target's scale, as from `Learnt.raw`; NaN for rows in no part of
    `plan`.
    """
    (name,) = request.models
    if name == POPULATION.name and plan.groups.are_surfaces:
        # `Population.fit` has predicted the rows of each part of the surfaces without this part.
        model = learnt.pipeline.named_steps[STEP]
        return learnt.scaling.restored(model.left_out_)
    if name in CLOSED and name != POPULATION.name:
        try:
            return _left_out_by_one_fit(target, learnt, plan)
        except np.linalg.LinAlgError:
            # The kernel's matrix of all rows is singular. The matrices of fits without a part may
            # be regular.
            pass
    return _left_out_by_further_fits(request, settings, train, target, learnt, plan)


def _left_out_by_one_fit(target: Values, learnt: Learnt, plan: Plan) -> Values:
    """Predict left out rows from the single fit to all n training rows, (n,).

    `target` are the targets on the scale that models are trained on, (n,); the predictions are over
    the target's scale, NaN for rows in no part of `plan`. LinAlgError is raised if the kernel's
    matrix is singular.

    Unlike in a fit for each part, features are scaled and clipped by all training rows. Errors are,
    if anything, larger.
    """
    model = learnt.pipeline.named_steps[STEP]
    errors = left_out_errors(model, [holdout.unseen for holdout in plan.holdouts])
    predicted = np.full(target.size, np.nan)
    for holdout, error in zip(plan.holdouts, errors, strict=True):
        # `unseen` and `rows` ascend, so that the errors are in the order of the rows of the part.
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
    """Predict left out rows by a fit for each part to the other training rows, (n,).

    Parameters and result are described in `_predict_left_out`.
    """
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
