"""Fits of surrogates for the reports, made as `learn fit` makes them.

A `Fitted` is the model of one target, with the numbers that its intervals and flags need.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from learn import dataset, split
from learn.comparison.folder import Settings
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.features import FeatureSet, chosen
from learn.metrics import Scores, scores
from learn.surrogate.calibration import plan_calibration
from learn.surrogate.fitting import fit_target
from learn.surrogate.interval import Distance
from learn.surrogate.learnt import Fit

AREA_MAX = 16.56
"""Largest area of the rows that are used, the paper's [%]."""


@dataclass(frozen=True, eq=False)
class Parts:
    """The rows of a dataset, split into training and test rows."""

    train: Dataset  # rows that fit a surrogate
    test: Dataset  # rows that test it
    folds: NDArray[np.int8]  # fold of each training row, 0 to 4


class Ends(NamedTuple):
    """The ends of the intervals of n rows, in the unit of the target's column."""

    low: Values  # (n,) lower ends
    high: Values  # (n,) upper ends


@dataclass(frozen=True, eq=False, kw_only=True)
class Fitted(Fit):
    """A fitted model of a target, which flags rows that do not resemble its training rows."""

    features: FeatureSet  # feature set of the inputs, with the margins of their ranges
    low: Values  # (d,) smallest value of each of the d inputs among the training rows
    high: Values  # (d,) largest value of each input among the training rows
    distance: Distance  # distance of a row from the training rows, and its limit

    def predict(self, rows: Dataset) -> Values:
        """Predict the target.

        Parameters
        ----------
        rows : Dataset
            n rows with the inputs of the training.

        Returns
        -------
        ndarray, shape (n,)
            Predictions inside the bounds of the target, in the unit of its column.
        """
        return np.clip(self.learnt.raw(rows.inputs) * rows.scale, *self.learnt.bounds)

    def scores(self, rows: Dataset) -> Scores:
        """Compare predictions with the target.

        Parameters
        ----------
        rows : Dataset
            Rows with the inputs and the target of the training.

        Returns
        -------
        Scores
            The four scores. The nMSE is in percent times the unit of the target's column, the other
            scores are in percent.
        """
        return scores(rows.target * rows.scale, self.predict(rows))

    def interval(self, rows: Dataset, level: float) -> Ends:
        """Compute the interval of each row.

        Parameters
        ----------
        rows : Dataset
            n rows with the inputs of the training.
        level : float
            Share of the intervals that have to hold their row's target, between 0 and 1. It is
            promised for rows that resemble the training rows.

        Returns
        -------
        Ends
            Both ends, clipped to the bounds of the target.
        """
        raw = self.predict(rows) / rows.scale  # in the unit of the calibration
        ends = self.learnt.calibration.ends(raw, level, rows.inputs)
        low, high = (np.clip(end * rows.scale, *self.learnt.bounds) for end in ends)
        return Ends(low=low, high=high)

    def flags(self, rows: Dataset) -> NDArray[np.bool_]:
        """Flag the rows that do not resemble the training rows.

        Parameters
        ----------
        rows : Dataset
            n rows with the inputs of the training.

        Returns
        -------
        ndarray of bool, shape (n,)
            True if an input is outside its range in the training, or if the row is farther from all
            training rows than the limit of `distance`.
        """
        is_outside = self.features.is_outside(rows.inputs, self.low, self.high).any(
            axis=1
        )
        is_far = self.distance.of(rows.inputs) > self.distance.limit
        return np.asarray(is_outside | is_far)


def request_for(path: Path, model: str, features: str, area_max: float | None) -> Request:
    """Make the request for a surrogate of the contact area.

    Parameters
    ----------
    path : Path
        The database.
    model : str
        Name of the model.
    features : str
        Name of the feature set.
    area_max : float or None
        Largest area of a row that is used [%]; None for all rows.

    Returns
    -------
    Request
        The request, for features with square roots and with the normalisation of the feature set.
    """
    return Request(
        databases=(path,),
        models=(model,),
        area_max=area_max,
        features=features,
        normalisation=chosen(features).normalisation,
        roots=True,
    )


def read(request: Request, rows: int | None = None) -> Dataset:
    """Read the usable rows of a request's database, with its features and its target.

    Parameters
    ----------
    request : Request
        The request, with one database and one target.
    rows : int or None
        Number of the database's first rows that are used; None for all rows.

    Returns
    -------
    Dataset
        The usable rows among them.

    Raises
    ------
    InputError
        If too few rows can be used.
    """
    (all_rows,) = dataset.read(request)
    if rows is None:
        return all_rows
    return all_rows.at(np.flatnonzero(all_rows.rows < rows))


def parted(rows: Dataset, seed: int = 0) -> Parts:
    """Split a dataset into training and test rows, as `learn fit` does.

    Parameters
    ----------
    rows : Dataset
        The rows.
    seed : int
        Seed of the split.

    Returns
    -------
    Parts
        Training rows with their folds, and test rows. All rows of one surface or tile are in the
        same part.
    """
    drawn = split.draw(rows, seed)
    return Parts(train=rows.at(drawn.train), test=rows.at(drawn.test), folds=drawn.folds)


def fit(
    request: Request,
    train: Dataset,
    folds: NDArray[np.int8],
    settings: Settings | None = None,
) -> Fitted:
    """Fit a surrogate, and calibrate its intervals and flags by the training rows.

    Parameters
    ----------
    request : Request
        The request, with one model.
    train : Dataset
        n training rows.
    folds : ndarray of int8, shape (n,)
        Fold of each training row, 0 to 4.
    settings : Settings or None
        Settings of the model; None to choose among the settings that come with the program, by
        cross-validation over the folds.

    Returns
    -------
    Fitted
        The fitted model of the target.

    Raises
    ------
    InputError
        If the memory of this machine does not suffice for the model.
    """
    plan = plan_calibration(request.models[0], train)
    fitted = fit_target(request, train, plan, folds, settings=settings)
    return Fitted(
        **vars(fitted),
        features=train.features,
        low=train.inputs.min(axis=0),
        high=train.inputs.max(axis=0),
        distance=plan.distance,
    )
