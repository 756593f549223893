"""Fit one target's model: choose its settings, fit it, calibrate its intervals."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.kernel_ridge import KernelRidge

from gen.scene import Scene
from learn import memory
from learn.arrays import Indices, Values
from learn.columns import results
from learn.comparison.folder import Folder
from learn.dataset import Dataset
from learn.features import chosen
from learn.kernel_ridge import left_out_errors
from learn.models import MODELS, STEP, pipeline, remarks, scaling_of
from learn.request import Request
from learn.surrogate.conformal import RANGES, Calibration, calibrate, ranges_of
from learn.surrogate.distance import Distance
from learn.surrogate.error_growth import Growth, clusters_of, fit_growth
from learn.surrogate.groups import (
    calibrate_by_groups,
    groups_of,
    holdout_squares,
    holdouts,
    left_out,
    near,
    near_labels,
)
from learn.surrogate.learnt import Learnt
from learn.surrogate.moments import Clipped, clipped
from learn.surrogate.settings import Settings, choose

NOT_CALIBRATED = Calibration(np.empty(0), (np.empty(0),))


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


def fit_target(
    request: Request,
    train: Dataset,
    calibration: Dataset | None,
    folds: NDArray[np.int8],
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
    own = NOT_CALIBRATED, _clipped(train), column.bounds
    learnt = Learnt(column.name, column.unit, fitted, scaling, *own)
    crossed = None
    if calibration is None:
        crossed = _crossed(request, settings, train, target, learnt)
    learnt = replace(learnt, calibration=_calibrated(learnt, train, target, calibration, crossed))
    return Fit(learnt, settings, chose - began, done - chose, said, crossed)


def _crossed(
    request: Request, settings: Settings, train: Dataset, target: Values, learnt: Learnt
) -> Values:
    """Predict the training rows over their scale by models that have not seen their groups.

    Kernel ridge needs no further fits; its features then keep the scaling of all training rows, and
    moments beyond those of the other groups are not held: errors are, if anything, larger.
    """
    groups = groups_of(train)
    if groups is None:
        raise ValueError("rows of one map or database cannot be calibrated by groups")
    parts = list(holdouts(train, left_out(train, groups)))
    found = _ridge_left_out(learnt, target, parts)
    if found is not None:
        return found
    found = np.empty(train.size)
    for mine, unseen in parts:
        others = np.setdiff1d(np.arange(train.size), unseen)
        fitted, _ = _fitted(request, settings, train.inputs[others], target[others])
        apart_from = replace(learnt, pipeline=fitted, clipped=_clipped(train.at(others)))
        found[mine] = apart_from.raw(train.inputs[mine])
    return found


def _ridge_left_out(
    learnt: Learnt, target: Values, parts: Sequence[tuple[Indices, Indices]]
) -> Values | None:
    """Predict the training rows over their scale without further fits; None if that is impossible.

    Parameters
    ----------
    learnt : Learnt
        The model, fitted to all rows; kernel ridge.
    target : ndarray, shape (n,)
        Target of the training rows, as the model learnt it.
    parts : sequence of pairs of ndarray of int
        From `holdouts`.
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
    if calibration is None or crossed is not None:
        rows, raw = train, crossed
    else:
        rows, raw = calibration, learnt.raw(calibration.inputs)
    assert raw is not None  # `fit_target` crosses the training rows where no others calibrate
    groups, root = groups_of(rows), learnt.root
    parts = None if groups is None else left_out(rows, groups)
    if groups is not None and parts is not None and groups.scheme == "others":
        return calibrate_by_groups(rows, raw, groups, parts, root=root)
    distance = near(train)
    if crossed is None or parts is None:
        squares = np.square(distance.of(rows.inputs))
    else:
        squares = holdout_squares(train, list(holdouts(train, parts)))
    growth = _growth(learnt, distance, train, target) or fit_growth(
        distance, squares, *_errors(raw, rows, root=root)
    )
    if groups is None or parts is None:
        return calibrate(
            raw, rows.target, train.target, root=root, growth=growth, inputs=rows.inputs
        )
    return calibrate_by_groups(rows, raw, groups, parts, root=root, growth=growth, squares=squares)


def _growth(learnt: Learnt, distance: Distance, train: Dataset, target: Values) -> Growth | None:
    """Fit the growth of the errors by clusters of the training that are left out in turn.

    None for models other than kernel ridge, which would need a fit for each cluster, and for few
    surfaces.
    """
    clusters = clusters_of(train)
    if clusters is None:
        return None
    parts = list(holdouts(train, clusters))
    raw = _ridge_left_out(learnt, target, parts)
    if raw is None:
        return None
    squares = holdout_squares(train, parts)
    return fit_growth(distance, squares, *_errors(raw, train, root=learnt.root))


def _errors(raw: Values, rows: Dataset, *, root: bool) -> tuple[Values, Indices]:
    """Return the errors of predictions, and the kinds of rows that are compared with each other."""
    change = np.sqrt if root else np.asarray
    errors = np.abs(change(raw) - change(rows.target))
    return errors, near_labels(rows) * RANGES + ranges_of(raw)


def _clipped(train: Dataset) -> Clipped | None:
    """Hold moments inside their training ranges; None for features with units."""
    if not chosen(train.features).scaled:
        return None
    return clipped(train.names, train.inputs.min(axis=0), train.inputs.max(axis=0))


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
