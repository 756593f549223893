"""Fits for the reports, made as `learn fit` makes them, of rows from one database or several."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from learn import dataset, split
from learn.comparison.folder import Settings
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.features import chosen
from learn.metrics import Scores, scores
from learn.surrogate.calibration import plan_calibration
from learn.surrogate.fitting import fit_target
from learn.surrogate.interval import Distance
from learn.surrogate.learnt import Fit


@dataclass(frozen=True, eq=False)
class Parts:
    """Rows of one database that fit and judge, with the folds of those that fit."""

    train: Dataset
    test: Dataset
    folds: NDArray[np.int8]


@dataclass(frozen=True, eq=False, kw_only=True)
class Fitted(Fit):
    """A fitted model of a target, with the flags for rows of another kind."""

    low: Values  # (d,) ends of the training ranges
    high: Values
    distance: Distance  # from the training

    def predict(self, rows: Dataset) -> Values:
        """Predict n rows, in the unit of the target's column."""
        return np.clip(self.learnt.raw(rows.inputs) * rows.scale, *self.learnt.bounds)

    def scores(self, rows: Dataset) -> Scores:
        """Judge the predictions of some rows."""
        return scores(rows.target * rows.scale, self.predict(rows))

    def interval(self, rows: Dataset, level: float) -> tuple[Values, Values]:
        """Return both ends of the interval of each of n rows, in the unit of the column."""
        raw, inputs = self.predict(rows) / rows.scale, rows.inputs
        ends = self.learnt.calibration.ends(raw, level, inputs)
        low, high = (np.clip(end * rows.scale, *self.learnt.bounds) for end in ends)
        return low, high

    def flags(self, rows: Dataset) -> NDArray[np.bool_]:
        """Return whether rows have an input outside the training ranges, or are far away, (n,)."""
        outside = ((rows.inputs < self.low) | (rows.inputs > self.high)).any(axis=1)
        return np.asarray(outside | (self.distance.of(rows.inputs) > self.distance.limit))


def request_for(path: Path, model: str, features: str, area_max: float | None) -> Request:
    """Ask for the contact area of a database's rows."""
    return Request(
        databases=(path,),
        models=(model,),
        area_max=area_max,
        features=features,
        normalisation=chosen(features).normalisation,
        roots=True,
    )


def read(request: Request, rows: int | None = None) -> Dataset:
    """Read a database with a request's features: all of it, or its first rows.

    An InputError is raised if too few rows can be used.
    """
    (found,) = dataset.read(request)
    return found if rows is None else found.at(np.flatnonzero(found.rows < rows))


def parted(rows: Dataset, seed: int = 0) -> Parts:
    """Split a dataset into training and test, as `learn fit` does with a seed."""
    drawn = split.draw(rows, seed)
    return Parts(rows.at(drawn.train), rows.at(drawn.test), drawn.folds)


def fit(
    request: Request,
    train: Dataset,
    folds: NDArray[np.int8],
    settings: Settings | None = None,
) -> Fitted:
    """Choose settings by the folds unless they are given, fit, calibrate by the training rows.

    An InputError is raised if this machine lacks the memory.
    """
    plan = plan_calibration(request.models[0], train)
    fitted = fit_target(request, train, plan, folds, settings=settings)
    low, high = train.inputs.min(axis=0), train.inputs.max(axis=0)
    return Fitted(**vars(fitted), low=low, high=high, distance=plan.distance)
