"""Fits for the reports: settings chosen as `learn fit` chooses them, intervals calibrated.

`learn.surrogate.training` fits what a database holds; here the rows may come from several.
"""

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from gen.farm import World
from learn import dataset, memory, split
from learn.dataset import Dataset
from learn.features import chosen
from learn.models import MODELS, pipeline
from learn.request import Request, pressed_for
from learn.surrogate.conformal import Calibration, calibrate
from learn.surrogate.learnt import Learnt
from learn.surrogate.settings import Settings, choose

Values = NDArray[np.float64]

CALIBRATION_SHARE = 0.1
"""Share of the training rows that calibrates the intervals, as in `learn fit`."""

NOT_CALIBRATED = Calibration(np.empty(0), (np.empty(0),))


@dataclass(frozen=True, eq=False)
class Parts:
    """Rows of one database, drawn once for all feature sets.

    Attributes
    ----------
    train, calibration, test : rows of the database that fit, calibrate and judge, in random order
    folds : (training rows,) folds of the search for settings
    """

    train: Dataset
    calibration: Dataset
    test: Dataset
    folds: NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Fitted:
    """A model of the contact area with what its judgement needs.

    Attributes
    ----------
    learnt : model and intervals
    low, high : (d,) training ranges
    settings : of the model
    choosing, fitting : processor times of the search for settings and of the fit [s]
    """

    learnt: Learnt
    low: Values
    high: Values
    settings: Settings
    choosing: float
    fitting: float

    def predict(self, rows: Dataset) -> Values:
        """(n,) areas [%]."""
        return np.clip(self.learnt.raw(rows.inputs), 0.0, 100.0)

    def covered(self, rows: Dataset, level: float) -> NDArray[np.bool_]:
        """(n,) whether the interval of a level holds the truth."""
        raw = self.learnt.raw(rows.inputs)
        half = self.learnt.calibration.half_width(raw, level)
        return np.asarray(np.abs(rows.target - raw) <= half)

    def flagged(self, rows: Dataset) -> NDArray[np.bool_]:
        """(n,) whether an input lies outside the training ranges."""
        outside = (rows.inputs < self.low) | (rows.inputs > self.high)
        return np.asarray(outside.any(axis=1))


def request_for(path: Path, model: str, features: str, area_max: float) -> Request:
    """What to learn: the contact area of a database's rows."""
    return Request(
        database=path,
        output=Path(),
        models=(model,),
        area_max=area_max,
        features=features,
        normalisation=chosen(features).normalisation,
    )


def read(request: Request, rows: int | None = None) -> Dataset:
    """Rows of a database with a request's features, of its first `rows` rows only if given.

    Raises
    ------
    InputError
        If too few rows can be used.
    KeyboardInterrupt
        If hybrid features were stopped by a signal while they were computed.
    """
    pressed = pressed_for(request, World(), lambda: False)
    found = dataset.read(request.database, "area", request.area_max, request.features, pressed)
    if rows is None:
        return found
    return found.at(np.flatnonzero(found.rows < rows))


def parted(rows: Dataset) -> Parts:
    """Split a dataset of one sample a surface into training, calibration and test."""
    drawn = split.draw(rows)
    cut = drawn.train.size - int(CALIBRATION_SHARE * drawn.train.size)
    train, calibration = drawn.train[:cut], drawn.train[cut:]
    return Parts(rows.at(train), rows.at(calibration), rows.at(drawn.test), drawn.folds[:cut])


def joined(first: Dataset, second: Dataset) -> Dataset:
    """Rows of two databases as inputs and targets of one fit; the rest is the first's."""
    return Dataset(
        **vars(first)
        | {
            name: np.concatenate([getattr(first, name), getattr(second, name)])
            for name in ("inputs", "target", "rows", "groups", "described", "scale")
        }
    )


def fit(
    request: Request,
    train: Dataset,
    calibration: Dataset,
    folds: NDArray[np.int8],
    settings: Settings | None = None,
) -> Fitted:
    """Choose settings unless they are given, fit, calibrate.

    Parameters
    ----------
    request : from `request_for`
    train, calibration : rows
    folds : (training rows,) fold 0 validates the candidates of the search
    settings : of an earlier fit, None to choose them here

    Raises
    ------
    InputError
        If this machine lacks the memory.
    """
    (name,) = request.models
    memory.check(name, train.size)
    scaled = chosen(request.features).scaled
    mean = float(train.target.mean()) if scaled else 0.0
    deviation = float(train.target.std()) if scaled else 1.0
    target = (train.target - mean) / deviation
    began = process_time()
    settings = settings or choose(request, None, train.inputs, target, folds)
    chose = process_time()
    unfitted = pipeline(
        MODELS[name],
        settings.values,
        normalisation=request.normalisation,
        seed=request.seed,
        tuned=settings.tuned,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of limits reached: the scores say what it is worth
        fitted = unfitted.fit(train.inputs, target)
    done = process_time()
    unscored = Learnt(train.target_name, train.unit, fitted, mean, deviation, NOT_CALIBRATED)
    scores = calibrate(
        SimpleNamespace(predict=unscored.raw),
        calibration.inputs,
        calibration.target,
        train.target,
    )
    return Fitted(
        replace(unscored, calibration=scores),
        low=train.inputs.min(axis=0),
        high=train.inputs.max(axis=0),
        settings=settings,
        choosing=chose - began,
        fitting=done - chose,
    )
