"""Fits for the reports, made as `learn fit` makes them, of rows from one database or several."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from learn import dataset, split
from learn.dataset import Dataset
from learn.executor import Executor
from learn.features import chosen
from learn.request import Request, hybrid_for
from learn.surrogate.fitting import fit_target
from learn.surrogate.learnt import Learnt
from learn.surrogate.settings import Settings
from learn.surrogate.training import without_calibration

Values = NDArray[np.float64]


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
    hybrid = hybrid_for(request, Executor())
    found = dataset.read(request.database, "area", request.area_max, request.features, hybrid)
    if rows is None:
        return found
    return found.at(np.flatnonzero(found.rows < rows))


def parted(rows: Dataset) -> Parts:
    """Split a dataset into training, calibration and test, as `learn fit` does."""
    drawn = split.draw(rows)
    train, calibration = without_calibration(rows, drawn.train)
    folds = drawn.folds[: train.size]
    return Parts(rows.at(train), rows.at(calibration), rows.at(drawn.test), folds)


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
    fit = fit_target(request, train, calibration, folds, settings=settings)
    return Fitted(
        fit.learnt,
        low=train.inputs.min(axis=0),
        high=train.inputs.max(axis=0),
        settings=fit.settings,
        choosing=fit.choosing,
        fitting=fit.fitting,
    )
