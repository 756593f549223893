"""Fit surrogates: read, split into three sets, choose settings, fit, calibrate, judge."""

from collections.abc import Callable
from contextlib import suppress
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
    SURFACE,
    Plan,
    calibrate,
    of_another,
    planned,
)
from learn.surrogate.interval import Calibration, ErrorScale
from learn.surrogate.learnt import Learnt, clip_of
from learn.surrogate.model import Surrogate
from learn.surrogate.scale import OWN_SCALE, keeps_its_scale, own_scale

SEARCH_ROWS = 3000  # largest number of training rows of the small searches
LIKELIHOOD_ROWS = 800  # rows for the likelihood of a kernel with a length for every input
LENGTHS = (0.1, 1.0, 10.0, 100.0)  # from which the search for the most likely one starts
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


def choose(request: Request, train: Dataset, target: Values, folds: Folds) -> Settings:
    """Choose the settings of a fit to training rows and their scaled target, (n,).

    A comparison's folder gives its winner. A search takes the candidate with the smallest error on
    the first of the folds, (n,), of those that were fitted to the other ones.
    """
    (name,) = request.models
    if request.source is not None:
        return _tuned(Folder(request.source / short_name(train.target_name)), name)
    if name == "gaussian-process":
        return _most_likely(request, train.inputs, target)
    published = request.features == "paper" and request.normalisation == "l2"
    if name in BUILT_IN and not published:
        return Settings(dict(BUILT_IN[name]), False, "built in")
    if name not in CANDIDATES or published:
        return Settings(dict(OPTIMA[name]), True, "the paper's optimum")
    outside = (
        folds == folds.min()
    )  # 0, unless a few large groups fill the first folds together
    inside, inputs = np.flatnonzero(~outside)[:SEARCH_ROWS], train.inputs
    best: tuple[float, dict[str, Any]] = (np.inf, {})
    for settings in CANDIDATES[name]:
        made = Settings(
            settings, False, ""
        )  # singular with a tiny alpha: the error will tell
        model, _ = _fitted(request, made, inputs[inside], target[inside])
        error = float(np.mean((model.predict(inputs[outside]) - target[outside]) ** 2))
        if error < best[0]:
            best = error, settings
    if not best[1]:
        raise InputError(f"{name}: no candidate of the built-in search could be fitted")
    return Settings(
        best[1], False, f"best of {len(CANDIDATES[name])} on a validation fold"
    )


def _tuned(folder: Folder, model: str) -> Settings:
    """Return the settings of a search's winner."""
    winner = folder.winner(model)
    if winner is None:
        others = [
            part.path.name for part in targets(folder.path.parent) if part.winner(model)
        ]
        instead = f"give --target {','.join(others)}, or first " if others else ""
        tune = command_to_type(f"learn tune --model {model} --target {folder.path.name}")
        raise InputError(f"--from: {folder.path} has no tuned {model}: {instead}{tune}")
    return winner


def with_conditions(request: Request, choice: Any) -> Request:
    """Take features, scaling, rows and seed of a request from a comparison's folder.

    InputError is raised if the folder lacks the model for a target, or contradicts an option that
    the user has chosen.
    """
    source: Path = choice.source
    given = {**choice._asdict(), "normalisation": choice.normalise}
    folder, *others = (
        Folder(source / short_name(TARGETS.get(target, target)))
        for target in request.targets
    )
    conditions = {
        "features": "paper",
        "load": request.load,
        **folder.record()["conditions"],
    }
    for part in (folder, *others):
        _tuned(part, request.models[0])
    names = ("features", "load", "normalisation", "area_max", "seed")
    for name in names:
        if given.get(name) not in {None, "", conditions[name]}:
            raise InputError(
                f"--from: {folder.path} was made with {name} {conditions[name]!r}, not"
                f" {given[name]!r}: leave that out, or give another folder"
            )
    return replace(request, source=source, **{name: conditions[name] for name in names})


def _most_likely(request: Request, inputs: Values, target: Values) -> Settings:
    """Return the most likely radial basis function with a length per input, and noise.

    The likelihood has several maxima, and is flat where the lengths are far too short. Kernels of
    one length, which are fitted within moments, are therefore searched from lengths over four
    decades. The lengths of the inputs start from the best of these, and from `USUAL_LENGTH`.
    """
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    few = inputs[:LIKELIHOOD_ROWS], target[:LIKELIHOOD_ROWS]

    def process(lengths: Values) -> Any:
        """Fit amplitude, lengths, noise by their likelihood; lengths at a bound do not matter."""
        kernel = ConstantKernel(10.0, (1e-2, 1e5)) * RBF(lengths, (1e-2, 1e4))
        kernel += WhiteKernel(1e-3, (1e-9, 1.0))
        given = {"kernel": kernel, "optimizer": "fmin_l_bfgs_b", "alpha": 1e-10}
        return _fitted(request, Settings(given, False, ""), *few)[0].named_steps[STEP]

    likelihood = attrgetter("log_marginal_likelihood_value_")
    alike = max((process(np.array([each])) for each in LENGTHS), key=likelihood)
    starts = {float(alike.kernel_.k1.k2.length_scale), USUAL_LENGTH}
    fits = [alike, *(process(np.full(inputs.shape[1], each)) for each in sorted(starts))]
    return Settings(
        {"kernel": max(fits, key=likelihood).kernel_, "optimizer": None, "alpha": 1e-10},
        False,
        f"kernel of the largest likelihood on {len(few[1])} rows, from {len(LENGTHS) + len(starts)}"
        " starts",
    )


def fit(
    request: Request,
    executor: Executor,
    say: Callable[[str], None],
    stopping: Callable[[], bool] = lambda: False,
) -> Surrogate | None:
    """Fit a surrogate to a database, by a request with one model.

    The executor generates surfaces for hybrid features; `say` is called with lines for the user.
    None is returned after a stop, for which `stopping` is asked between surfaces. InputError is
    raised if the input cannot be used, there are too few rows or too little memory, or a target is
    predicted no better than by a constant.
    """
    sets, others = dataset.read(request, executor, stopping, common=True), None
    if sets and request.calibrate_on is not None:
        wider = replace(request, databases=(*request.databases, request.calibrate_on))
        others = dataset.read(wider, executor, stopping, common=True)
        others = others and of_another(sets, others)
    if not sets or others == []:
        return None
    own = request.seed, request.train_rows
    parts = split.draw(sets[0], *own, further_targets=sets[1:], tiles=split.TILES)
    fitted = fit_parts(request, sets, parts, say, others)
    require_better(fitted, str(request.databases[0]))
    return fitted


def require_better(surrogate: Surrogate, name: str) -> None:
    """Refuse a surrogate of which a target is predicted no better than by a constant.

    InputError names the database or file, and the first of these targets.
    """
    for target, judged in surrogate.card["targets"].items():
        if worst := no_better(judged["scores"]["r2"]):
            raise InputError(
                f"{name}: {target}: {worst}; try another --model, or more rows"
            )


def fit_parts(
    request: Request,
    sets: list[Dataset],
    parts: split.Split,
    say: Callable[[str], None],
    others: list[Dataset] | None = None,
) -> Surrogate:
    """Fit a surrogate to rows, from `dataset.read`, whose training and test parts have been chosen.

    `others` are rows of another database that calibrate, for each target. InputError is raised if
    there are too few rows to train on, or too little memory.
    """
    train, name = parts.train, sets[0].name
    plan = planned(request.models[0], sets[0].at(train), others[0] if others else None)
    sizes = {
        "train": train.size,
        "calibration": plan.groups.labels.size,
        "test": parts.test.size,
    }
    remarks_on_rows = dataset.remarks(sets[0], request.normalisation)
    if others is not None:
        calibrating = dataset.damage_of(others[0])
        remarks_on_rows += [line for line in calibrating if line not in remarks_on_rows]
    for line in remarks_on_rows:
        say(f"  {line}")
    say(
        f"{name}: {sizes['train']} rows train, {sizes['calibration']} calibrate, {sizes['test']}"
        f" test; {request.features} features"
    )
    if plan.remark:
        say(f"  {plan.remark}")
    learnt: dict[str, Learnt] = {}
    judged: dict[str, dict[str, Any]] = {}
    for number, (target, rows) in enumerate(zip(request.targets, sets, strict=True)):
        other = None if others is None else others[number]
        fitted = fit_target(request, rows.at(train), plan, parts.folds, other=other)
        learnt[target] = fitted.learnt
        judged[target] = entry = card.judge(fitted, rows, parts.test)
        score = SCORED.format(**entry["scores"])
        say(
            f"{rows.target_name}: {entry['settings_from']}; {score}, fit {fitted.fitting:.3g} s"
        )
        if plan.remark and fitted.crossed is not None:
            entry["left_out"] = card.scores_of(
                fitted.learnt, rows.at(train), fitted.crossed
            )
            say(f"  left out in turn: {SCORED.format(**entry['left_out'])}")
        for remark in entry["remarks"]:
            say(f"  warning: {remark}")
        if not keeps_its_scale(fitted.learnt, rows.features):
            say(f"  {target}: {OWN_SCALE}")
    inputs, features = sets[0].inputs[train], sets[0].features
    ranges = features.ranges([origin.scene for origin in sets[0].origins], inputs)
    largest = min(each.calibration.largest_level for each in learnt.values())
    say(f"  {card.level_line(largest)}")
    calibration = {**plan.entry, "largest_level": largest}
    return Surrogate(
        card=card.make(request, sets[0], train, sizes, judged)
        | {"calibration": calibration}
        | own_scale(sets, learnt.values(), train),
        learnt=learnt,
        low=ranges.low,
        high=ranges.high,
        distance=plan.distance,
    )


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted model of one target, with times and warnings of the fit."""

    learnt: Learnt
    settings: Settings
    choosing: float  # processor time of the choice of settings [s]
    fitting: float  # and of the fit [s]
    remarks: tuple[str, ...]  # warnings of the fit
    crossed: Values | None = None  # (n,), over the scale, by models without a row's group


def fit_target(
    request: Request,
    train: Dataset,
    plan: Plan,
    folds: Folds,
    settings: Settings | None = None,
    other: Dataset | None = None,
) -> Fit:
    """Fit and calibrate the model of one target, after a choice of settings if none are given.

    By the plan the rows of another database calibrate, or training rows: one or more further fits,
    with the same settings, leave out some of these each. The first of the training rows' folds
    validates the candidates of a search.
    InputError is raised if this machine lacks the memory, or the folder lacks the model.
    """
    (name,) = request.models
    check_memory(name, train.size)
    # Settings of a comparison were tuned for the target as the paper has it.
    scenic = request.features == SCENE and name != POPULATION.name
    standard = scenic or (name == "gaussian-process" and request.source is None)
    scaling = scaling_of(train, np.arange(train.size), standard=standard)
    target, clip = scaling.scaled(train.target), clip_of(train)
    inputs = np.clip(train.inputs, *clip)
    began = process_time()
    settings = settings or choose(request, replace(train, inputs=inputs), target, folds)
    chose = process_time()
    fitted, said = _fitted(request, settings, inputs, target, train.groups)
    done = process_time()
    column = results(train.origins[0].scene, train.features.load)[train.target_name]
    not_yet = Calibration((), ErrorScale(np.empty(0), 0.0, 0.0, 0.0))
    own = (
        column.name,
        column.unit,
        fitted,
        scaling,
        not_yet,
        clip,
        column.bounds,
        train.powers,
    )
    learnt, crossed = Learnt(*own), None
    if other is not None:
        raw = learnt.raw(other.inputs)
    else:
        crossed = _crossed(request, settings, train, target, learnt, plan)
        raw, other = crossed[plan.kept], train.at(plan.kept)
    # Roots of targets that are never below 0 have errors that differ less between small and large.
    intervals = calibrate(other, plan, raw, root=learnt.bounds[0] == 0)
    learnt = replace(learnt, calibration=intervals)
    return Fit(learnt, settings, chose - began, done - chose, said, crossed)


def _fitted(
    request: Request,
    settings: Settings,
    inputs: Values,
    target: Values,
    groups: Indices | None = None,
) -> tuple[Any, tuple[str, ...]]:
    """Return a fitted pipeline and the warnings of its fit; groups are surfaces of the rows."""
    (name,) = request.models
    surfaces = {f"{STEP}__surfaces": groups} if name == POPULATION.name else {}
    own: dict[str, Any] = {
        "normalisation": request.normalisation,
        "seed": request.seed,
        "tuned": settings.tuned,
    }
    with remarks() as said:
        fitted = pipeline(EVERY[name], settings.values, **own).fit(
            inputs, target, **surfaces
        )
    return fitted, tuple(said)


def _crossed(
    request: Request,
    settings: Settings,
    train: Dataset,
    target: Values,
    learnt: Learnt,
    plan: Plan,
) -> Values:
    """Predict the parts of the training rows, over their scale, by models without their groups.

    Models in `CLOSED` need no further fits; their features then keep the scaling of all training
    rows, and moments beyond those of the other groups are not clipped: errors are, if anything,
    larger. Rows that are in no part are NaN.
    """
    groups, parts, model = plan.groups, plan.parts, learnt.pipeline.named_steps[STEP]
    by_surface = groups.kind == SURFACE and groups.scheme == "others"
    found, (name,) = np.full(train.size, np.nan), request.models
    if by_surface and name == POPULATION.name:
        return learnt.scaling.restored(model.left_out_)
    if name in CLOSED and name != POPULATION.name:
        with suppress(
            np.linalg.LinAlgError
        ):  # a singular matrix: further fits deal with it
            errors = left_out_errors(model, [unseen for _, unseen in parts])
            for (mine, unseen), error in zip(parts, errors, strict=True):
                found[mine] = target[mine] - error[np.isin(unseen, mine)]
            return learnt.scaling.restored(found)
    for mine, unseen in parts:
        others = np.setdiff1d(np.arange(train.size), unseen)
        clip = clip_of(train.at(others))
        rest = np.clip(train.inputs[others], *clip), target[others], train.groups[others]
        fitted, _ = _fitted(request, settings, *rest)
        without = replace(learnt, pipeline=fitted, clip=clip)
        found[mine] = without.raw(train.inputs[mine])
    return found
