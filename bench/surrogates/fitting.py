"""Fits for the reports, made as `learn fit` makes them, of rows from one database or several."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from learn import dataset, split
from learn.dataset import Dataset
from learn.executor import Executor
from learn.features import chosen
from learn.metrics import Scores, scores
from learn.request import Request, hybrid_for
from learn.surrogate.fitting import Fit, fit_target
from learn.surrogate.settings import Settings
from learn.surrogate.training import without_calibration

Values = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Parts:
    """Rows of one database that fit, calibrate and judge, with the folds of those that fit."""

    train: Dataset
    calibration: Dataset
    test: Dataset
    folds: NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Fitted(Fit):
    """A fitted model of the contact area, with its training ranges low and high, shape (d,)."""

    low: Values
    high: Values

    def predict(self, rows: Dataset) -> Values:
        """Predict the areas of n rows [%]."""
        return np.clip(self.learnt.raw(rows.inputs), 0.0, 100.0)

    def scores(self, rows: Dataset) -> Scores:
        """Judge the predictions of some rows."""
        return scores(rows.target, self.predict(rows))

    def covered(self, rows: Dataset, level: float) -> float:
        """Return the share of rows whose interval of a level holds the truth [1]."""
        raw = self.learnt.raw(rows.inputs)
        half = self.learnt.calibration.half_width(raw, level)
        return float(np.mean(np.abs(rows.target - raw) <= half))

    def flagged(self, rows: Dataset) -> float:
        """Return the share of rows with an input outside the training ranges [1]."""
        outside = (rows.inputs < self.low) | (rows.inputs > self.high)
        return float(outside.any(axis=1).mean())


def request_for(path: Path, model: str, features: str, area_max: float | None) -> Request:
    """Ask for the contact area of a database's rows."""
    return Request(
        database=path,
        output=Path(),
        models=(model,),
        area_max=area_max,
        features=features,
        normalisation=chosen(features).normalisation,
    )


def read(request: Request, rows: int | None = None) -> Dataset:
    """Read a database with a request's features: all of it, or its first rows.

    Raises
    ------
    InputError
        If too few rows can be used.
    KeyboardInterrupt
        If hybrid features were stopped by a signal while they were computed.
    """
    hybrid = hybrid_for(request, Executor())
    found = dataset.read(request.database, "area", request.area_max, request.features, hybrid)
    return found if rows is None else found.at(np.flatnonzero(found.rows < rows))


def parted(rows: Dataset) -> Parts:
    """Split a dataset into training, calibration and test, as `learn fit` does."""
    drawn = split.draw(rows)
    train, calibration = without_calibration(rows, drawn.train)
    folds = drawn.folds[: train.size]
    return Parts(rows.at(train), rows.at(calibration), rows.at(drawn.test), folds)


def fit(
    request: Request,
    train: Dataset,
    calibration: Dataset,
    folds: NDArray[np.int8],
    settings: Settings | None = None,
) -> Fitted:
    """Choose settings by the folds unless they are given, fit, calibrate.

    Raises
    ------
    InputError
        If this machine lacks the memory.
    """
    fitted = fit_target(request, train, calibration, folds, settings=settings)
    low, high = train.inputs.min(axis=0), train.inputs.max(axis=0)
    return Fitted(**vars(fitted), low=low, high=high)
