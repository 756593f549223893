"""How accurate a surrogate of a growing database is, and how sure that is.

Looking often makes it likely that one look is lucky. The sizes of the database at which it is
looked at are therefore fixed in advance, and the look at size number k may be wrong with a
probability of only `RISK` / ((k + 1) (k + 2)). These probabilities add up to `RISK`, so that it
bounds the probability that a surrogate worse than its mark is accepted at any of the sizes, however
many of them are looked at.
"""

import math
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.database import Reader
from gen.generators.scans import ScanSurface
from gen.runtime.errors import InputError
from learn.database_rows import Dataset
from learn.metrics import LEVEL, no_better
from learn.split import FOLDS, TILE, Split
from learn.surrogate.learnt import Learnt
from learn.surrogate.model import Surrogate

RISK = 0.05  # largest probability that a surrogate is accepted although its error is above the mark
SMALLEST_ROWS = 60  # rows of the smallest database, at least
SMALLEST_SURFACES = 20  # surfaces of the smallest database, at least
RATIO = math.sqrt(2)  # ratio of two successive sizes
SHARE = 5  # one of this many surfaces, or tiles, is in the holdout

KEY = 20_260
"""Key of the draw's stream of random numbers, which belongs to no other part of a scene."""

FUNCTIONS = (
    400  # functions that a process might be, by which errors of its mean are estimated
)
POINTS = 4  # looks of a learning curve, at least
EXPONENTS = (0.1, 1.0)  # smallest and largest exponent of a curve


def size(number: int, per_surface: int) -> int:
    """Return the number of rows of a size at which a database is looked at.

    Parameters
    ----------
    number : int
        Number of the size, counted from 0.
    per_surface : int
        Rows of one surface.

    Returns
    -------
    int
        Rows, with two digits and then rounded up to whole surfaces.
    """
    smallest = max(SMALLEST_ROWS, SMALLEST_SURFACES * per_surface)
    rows = int(float(f"{smallest * RATIO**number:.2g}"))
    surfaces = math.ceil(rows / per_surface)
    return surfaces * per_surface


def size_with(rows: int, per_surface: int) -> int:
    """Return the number of the smallest size with at least some rows.

    Parameters
    ----------
    rows : int
        Number of rows.
    per_surface : int
        Rows of one surface.

    Returns
    -------
    int
        Number of the size, counted from 0.
    """
    return next(number for number in count() if size(number, per_surface) >= rows)


def risk(number: int) -> float:
    """Return the probability with which the look at a size may accept a surrogate wrongly.

    Parameters
    ----------
    number : int
        Number of the size, counted from 0.

    Returns
    -------
    float
        Probability; the sum over all sizes is `RISK`.
    """
    return RISK / ((number + 1) * (number + 2))


class Accuracy(NamedTuple):
    """Estimated error of a surrogate."""

    nmae: float  # mean absolute error over the mean magnitude of the truth [%]
    error: float  # its standard error, infinite if there is a single group [%]
    groups: int  # surfaces, tiles of maps, or functions of a process that tell of it

    def bound(self, risk: float) -> float:
        """Return a number that the surrogate's error exceeds with a probability of `risk` only [%].

        It is nMAE exp(t SE / nMAE) with Student's t. On the logarithm's scale the skewness of
        absolute errors matters little: nMAE + t SE fails several times as often as it may.
        """
        from scipy.stats import t

        if self.nmae == 0.0:
            return 0.0
        if self.groups < 2:
            return math.inf
        relative = float(t.ppf(1.0 - risk, self.groups - 1)) * self.error / self.nmae
        return self.nmae * math.exp(min(relative, 700.0))


def accuracy(errors: Values, truth: Values, groups: Indices) -> Accuracy:
    """Estimate the error of a surrogate by rows that it has not seen.

    The error is the ratio of the mean error to the mean magnitude of the truth. Its standard error
    is linearised, and is that of whole groups, since rows of one surface or tile are not
    independent.

    Source: W. G. Cochran (1977), Sampling Techniques, sections 2.11 and 9A.

    Parameters
    ----------
    errors : ndarray, shape (n,)
        Absolute errors of the predictions.
    truth : ndarray, shape (n,)
        Solved values, in the same unit; at least one is not 0.
    groups : ndarray, shape (n,)
        Surface or tile of each row.

    Returns
    -------
    Accuracy
        The error with its standard error.
    """
    _, place = np.unique(groups, return_inverse=True)
    error_sums = np.bincount(place.ravel(), errors)
    truth_sums = np.bincount(place.ravel(), np.abs(truth))
    total = float(truth_sums.sum())
    ratio = float(error_sums.sum() / truth_sums.sum())
    number = error_sums.size
    if number < 2:
        return Accuracy(100 * ratio, math.inf, number)
    squares = float(np.sum((error_sums - ratio * truth_sums) ** 2))
    standard_error = math.sqrt(number / (number - 1) * squares) / total
    return Accuracy(100 * ratio, 100 * standard_error, number)


def accuracy_of_mean(learnt: Learnt, rows: Dataset) -> Accuracy:
    """Estimate the error of the mean over surfaces.

    Surfaces of the same parameters differ by much more than their mean is uncertain. The error is
    the distance of the mean from other functions that the Gaussian process might be as well.

    Parameters
    ----------
    learnt : Learnt
        Fitted population mean of the target.
    rows : Dataset
        Rows at whose parameters and loads the errors are taken.

    Returns
    -------
    Accuracy
        Mean error over `FUNCTIONS` functions, and its deviation among them.
    """
    model = learnt.pipeline[-1]
    scaled = learnt.pipeline[:-1].transform(rows.inputs)
    distances = np.abs(model.drawn_errors(scaled, FUNCTIONS)).mean(axis=0)
    distances = distances * learnt.scaling.deviation
    errors = 100 * distances / np.abs(learnt.raw(rows.inputs)).mean()
    return Accuracy(float(errors.mean()), float(errors.std()), FUNCTIONS)


def drawn(numbers: Indices, seed: int, among: int = SHARE) -> NDArray[np.bool_]:
    """Draw the surfaces or tiles of the holdout: one of some successive numbers.

    Whether a surface is drawn depends on its number and the seed alone, whatever the size of the
    database.

    Parameters
    ----------
    numbers : ndarray, shape (n,)
        Numbers of surfaces or tiles.
    seed : int
        Seed of the scene.
    among : int
        Length of the intervals of numbers, of which one is drawn.

    Returns
    -------
    ndarray of bool, shape (n,)
        Whether each surface or tile is in the holdout.
    """
    chosen = []
    for number in map(int, numbers):
        interval = number // among
        sequence = np.random.SeedSequence(seed, spawn_key=(KEY, interval, KEY))
        place = np.random.Generator(np.random.PCG64(sequence)).integers(among)
        chosen.append(int(place) == number % among)
    return np.array(chosen, dtype=bool)


def holdout(rows: Dataset) -> NDArray[np.bool_]:
    """Choose the rows that test; all other rows may train.

    No group has rows in both parts: a surface that repeats an earlier one belongs to the same part,
    and so do tiles of which two windows are equal to the last bit.

    Parameters
    ----------
    rows : Dataset
        The n usable rows of a whole database.

    Returns
    -------
    ndarray of bool, shape (n,)
        Whether each row tests.
    """
    scene = rows.origins[0].scene
    among = SHARE
    numbers = rows.rows
    if np.ptp(rows.groups) > 0:
        numbers = rows.rows // scene.samples_per_surface
    if rows.by_tile:
        assert isinstance(scene.surface, ScanSurface)
        among = min(SHARE, scene.surface.tile_groups())
        with Reader(Path(rows.name)) as reader:
            numbers = np.asarray(reader.column(TILE)[rows.rows], dtype=np.int64)
    _, first, place = np.unique(rows.surfaces, return_index=True, return_inverse=True)
    return drawn(numbers[first], scene.seed, among)[place.ravel()]


def parted(sets: list[Dataset], seed: int) -> Split:
    """Divide rows into training rows, in random order with folds, and test rows.

    Parameters
    ----------
    sets : list of Dataset
        The same rows for each target.
    seed : int
        Seed of the order of the training rows.

    Returns
    -------
    Split
        Training and test rows, the same for all targets. Groups stay together.

    Raises
    ------
    InputError
        If a part has too few rows, or a target does not vary over it.
    """
    rows = sets[0]
    tests = holdout(rows)
    test = np.flatnonzero(tests)
    train = np.flatnonzero(~tests)
    for target in sets:
        for name, part in (("training", train), ("test", test)):
            if part.size < 2 or np.ptp(target.target[part]) == 0:
                raise InputError(
                    f"{rows.name}: {target.target_name} does not vary over the"
                    f" {part.size} {name} rows of {rows.size}: more are needed"
                )
    groups, labels = np.unique(rows.surfaces[train], return_inverse=True)
    place = np.random.default_rng(seed).permutation(groups.size)[labels]
    shuffled = np.argsort(place, kind="stable")
    folds = (place[shuffled] * FOLDS // groups.size).astype(np.int8)
    by_surface = rows.by_tile or bool(np.ptp(rows.groups) > 0)
    return Split(train[shuffled], test, folds, seed, by_surface)


@dataclass(frozen=True, eq=False)
class Judged:
    """Predictions of one target for n test rows, each (n,), in the target's unit."""

    truth: Values
    prediction: Values
    low: Values  # ends of the intervals
    high: Values
    accuracy: Accuracy

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Whether each row is inside its interval, shape (n,)."""
        return np.asarray((self.low <= self.truth) & (self.truth <= self.high))


def judge(learnt: Learnt, rows: Dataset) -> Judged:
    """Compare the predictions of a target with the solver's results.

    Parameters
    ----------
    learnt : Learnt
        Fitted model of the target.
    rows : Dataset
        Rows that the model has not seen.

    Returns
    -------
    Judged
        Predictions with their intervals, and the estimated error.
    """
    raw = learnt.raw(rows.inputs)
    ends = learnt.calibration.ends(raw, LEVEL, rows.inputs)
    low, high = (np.clip(end * rows.scale, *learnt.bounds) for end in ends)
    predicted = np.clip(raw * rows.scale, *learnt.bounds)
    truth = rows.target * rows.scale
    if rows.features.of_scene:
        estimate = accuracy_of_mean(learnt, rows)
        return Judged(truth, predicted, low, high, estimate)
    estimate = accuracy(np.abs(predicted - truth), truth, rows.groups)
    return Judged(truth, predicted, low, high, estimate)


class Curve(NamedTuple):
    """The learning curve of a target, a power of the rows through the last error."""

    rows: Values  # of the looks, (k,)
    nmae: Values  # (k,) [%]

    @property
    def exponent(self) -> float:
        """The power with which errors fall."""
        slope = np.polyfit(np.log(self.rows), np.log(np.maximum(self.nmae, 1e-12)), 1)[0]
        return float(np.clip(-slope, *EXPONENTS))

    def at(self, rows: Values) -> Values:
        """Return the errors, (n,), at numbers of rows [%]."""
        return np.asarray(self.nmae[-1] * (rows / self.rows[-1]) ** -self.exponent)


@dataclass(frozen=True, eq=False)
class Look:
    """A surrogate of the present rows, and its errors on the holdout."""

    rows: int  # finished ones of the database
    number: int  # of the database's size
    mark: float  # largest nMAE that is asked for [%]
    surrogate: Surrogate
    judged: dict[str, Judged]  # by target
    parts: Split  # of its usable rows
    curve: Curve | None = None  # None if there are too few looks for one
    advice: float | None = None  # rows that meet the mark, infinite if none do

    def bound(self, target: str) -> float:
        """Return the bound that a target's error exceeds with this size's probability only [%]."""
        return self.judged[target].accuracy.bound(risk(self.number))

    @property
    def worst(self) -> str:
        """The target with the largest bound, on which the mark depends."""
        return max(self.judged, key=self.bound)

    @property
    def met(self) -> bool:
        """Whether the errors of all targets are below the mark, and no constant does as well."""
        if self.bound(self.worst) > self.mark:
            return False
        targets = self.surrogate.card["targets"].values()
        return not any(no_better(target["scores"]["r2"]) for target in targets)

    def needed_rows(self) -> str:
        """Return in words how many more rows the mark needs by the curve; "" without a curve."""
        if self.advice is None:
            return ""
        if math.isinf(self.advice):
            return "the learning curve does not come to it"
        more = self.advice - self.rows
        return f"the learning curve asks for {self.advice:,.0f} rows, {more:,.0f} more"

    def in_words(self) -> str:
        """Return in words how accurate the surrogate is, and how many rows the mark needs."""
        errors = ", ".join(
            f"{name} {target.accuracy.nmae:.2f} +- {target.accuracy.error:.2f} %"
            f" (at most {self.bound(name):.2f} %)"
            for name, target in self.judged.items()
        )
        text = f"{self.rows} rows: nMAE of {errors}; asked: {self.mark:g} %"
        if self.met:
            return f"{text}: met"
        needed = self.needed_rows()
        return f"{text}; {needed}" if needed else text


def advise(look: Look, curve: Curve, most: int, rows: Dataset) -> float:
    """Estimate how many rows the mark needs.

    Parameters
    ----------
    look : Look
        The last look, whose mark is not met.
    curve : Curve
        Learning curve of its worst target.
    most : int
        Largest number of rows that the database may have.
    rows : Dataset
        Rows of the last look. More rows of maps have the same tiles, whose errors differ as before.

    Returns
    -------
    float
        Rows of the first size at which the bound is expected to be below the mark; infinite if
        there is none.
    """
    per_surface = rows.origins[0].scene.samples_per_surface
    error = look.judged[look.worst].accuracy
    for number in range(look.number + 1, size_with(most, per_surface) + 1):
        larger = min(size(number, per_surface), most)
        share = float(curve.at(np.array([larger]))[0]) / curve.nmae[-1]
        growth = 1.0 if rows.by_tile else larger / look.rows
        expected = Accuracy(
            error.nmae * share,
            error.error * share / math.sqrt(growth),
            max(int(error.groups * growth), 2),
        )
        if expected.bound(risk(number)) <= look.mark:
            return float(larger)
    return math.inf
