"""Fit one target's model: choose its settings, fit it, calibrate its intervals."""

import warnings
from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.schema import COLUMNS
from learn import memory
from learn.arrays import Values
from learn.comparison.folder import Folder
from learn.dataset import Dataset
from learn.models import MODELS, pipeline
from learn.request import Request
from learn.surrogate.conformal import Calibration, calibrate
from learn.surrogate.learnt import Learnt
from learn.surrogate.settings import Settings, choose
from learn.target import scaling_of

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
    """

    learnt: Learnt
    settings: Settings
    choosing: float
    fitting: float
    remarks: tuple[str, ...]


def fit_target(
    request: Request,
    train: Dataset,
    calibration: Dataset,
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
    train, calibration : Dataset
        Rows with one target, perhaps of several databases.
    folds : ndarray of int, shape (training rows,)
        Fold of each training row; fold 0 validates the candidates of the search.
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
    scaling = scaling_of(train, np.arange(train.size))
    target = scaling.scaled(train.target)
    began = process_time()
    settings = settings or choose(request, folder, train.inputs, target, folds)
    chose = process_time()
    fitted, remarks = _fitted(request, settings, train.inputs, target)
    done = process_time()
    unit = next(column.unit for column in COLUMNS if column.name == train.target_name)
    learnt = Learnt(
        train.target_name, unit, fitted, scaling.mean, scaling.deviation, NOT_CALIBRATED
    )
    scores = calibrate(learnt.raw(calibration.inputs), calibration.target, train.target)
    return Fit(replace(learnt, calibration=scores), settings, chose - began, done - chose, remarks)


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
    need = memory.needed(name, len(inputs))
    with memory.reserved(need), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fitted = unfitted.fit(inputs, target)
    said = [" ".join(str(each.message).split())[:300] for each in caught]
    return fitted, tuple(dict.fromkeys(said))
