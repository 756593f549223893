"""The error of a surrogate of a growing database, and bounds of this error.

Somebody who looks often is likely to see a lucky result. A surrogate is therefore judged at sizes
of the database that are fixed in advance. The look at size number k may accept a surrogate wrongly
with a probability of only `RISK` / ((k + 1) (k + 2)). The sum of these probabilities is `RISK`.
However many looks there are, the probability that a surrogate is accepted although its error is
above the mark is at most `RISK`.
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

# Largest probability that a surrogate is accepted although its error is above the mark.
RISK = 0.05
# Smallest number of rows of the first size, unless surfaces need more (`SMALLEST_SURFACES`).
SMALLEST_ROWS = 60
# Smallest number of surfaces of the first size.
SMALLEST_SURFACES = 20
# Ratio of two successive sizes of the database.
RATIO = math.sqrt(2)
# One of this many successive surfaces, or tiles of maps, is in the holdout.
SHARE = 5

KEY = 20_260
"""Key of the stream of random numbers that draws the holdout. No other part of a scene uses it."""

# Number of functions drawn from a Gaussian process to estimate the error of its mean.
FUNCTIONS = 400
# Smallest number of looks from which a learning curve is computed.
POINTS = 4
# Smallest and largest exponent with which a learning curve may fall.
EXPONENTS = (0.1, 1.0)
# Logarithm beyond which the exponential of a bound would overflow.
LARGEST_LOGARITHM = 700.0


def size(number: int, per_surface: int) -> int:
    """Return the number of rows of one of the sizes at which a surrogate is judged.

    Parameters
    ----------
    number : int
        Number of the size, counted from 0.
    per_surface : int
        Rows of one surface.

    Returns
    -------
    int
        Rows, rounded to two significant digits and then up to whole surfaces.
    """
    smallest = max(SMALLEST_ROWS, SMALLEST_SURFACES * per_surface)
    exact = smallest * RATIO**number
    rows = int(float(f"{exact:.2g}"))
    surfaces = math.ceil(rows / per_surface)
    return surfaces * per_surface


def size_with(rows: int, per_surface: int) -> int:
    """Return the number of the smallest size that has at least the given rows.

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
    """Estimated error of a surrogate for one target."""

    nmae: float  # mean absolute error over the mean magnitude of the truth [%]
    standard_error: float  # of `nmae`; infinite if there is a single group [%]
    groups: int  # number of independent errors: surfaces, tiles or functions of a process

    def bound(self, risk: float) -> float:
        """Return the bound that the surrogate's error exceeds only with a small probability.

        The bound is nMAE exp(t SE / nMAE) with Student's t: the confidence interval of the
        logarithm, on whose scale the skewness of absolute errors matters little. The sum
        nMAE + t SE would be exceeded several times as often.

        Parameters
        ----------
        risk : float
            The probability, 0 to 1.

        Returns
        -------
        float
            Bound of the nMAE [%]; infinite if there are fewer than two groups.
        """
        from scipy.stats import t

        if self.nmae == 0.0:
            return 0.0
        if self.groups < 2:
            return math.inf
        quantile = float(t.ppf(1.0 - risk, self.groups - 1))
        relative = quantile * self.standard_error / self.nmae
        return self.nmae * math.exp(min(relative, LARGEST_LOGARITHM))


def accuracy(errors: Values, truth: Values, groups: Indices) -> Accuracy:
    """Estimate the error of a surrogate from rows that it has not seen.

    The error is the ratio of the mean error to the mean magnitude of the truth. Its standard error
    is linearised, and computed from sums over whole groups, because rows of one surface or tile are
    not independent.

    Source: W. G. Cochran (1977), Sampling Techniques, sections 2.11 and 9A.

    Parameters
    ----------
    errors : ndarray, shape (n,)
        Absolute errors of the predictions.
    truth : ndarray, shape (n,)
        Solved values in the unit of the errors, at least one of them not 0.
    groups : ndarray, shape (n,)
        Number of the surface or tile of each row.

    Returns
    -------
    Accuracy
        The error with its standard error.
    """
    _, place = np.unique(groups, return_inverse=True)
    error_sums = np.bincount(place.ravel(), errors)
    truth_sums = np.bincount(place.ravel(), np.abs(truth))
    total = float(truth_sums.sum())
    ratio = float(error_sums.sum()) / total
    number = error_sums.size
    if number < 2:
        return Accuracy(nmae=100 * ratio, standard_error=math.inf, groups=number)
    residuals = error_sums - ratio * truth_sums
    squares = float(np.sum(residuals**2))
    standard_error = math.sqrt(number / (number - 1) * squares) / total
    return Accuracy(nmae=100 * ratio, standard_error=100 * standard_error, groups=number)


def accuracy_of_mean(learnt: Learnt, rows: Dataset) -> Accuracy:
    """Estimate the error of the mean over surfaces.

    The error of the mean cannot be seen in single surfaces, which deviate from their mean by much
    more. It is estimated as the distance of the mean from functions that are drawn from the fitted
    Gaussian process.

    Parameters
    ----------
    learnt : Learnt
        Fitted population mean of the target.
    rows : Dataset
        Rows at whose parameters and loads the errors are computed.

    Returns
    -------
    Accuracy
        Mean error over `FUNCTIONS` functions; the standard error is its deviation among them.
    """
    process = learnt.pipeline[-1]
    inputs = learnt.pipeline[:-1].transform(rows.inputs)
    errors = np.abs(process.drawn_errors(inputs, FUNCTIONS))  # (n, FUNCTIONS)
    mean_errors = errors.mean(axis=0) * learnt.scaling.deviation
    magnitude = np.abs(learnt.raw(rows.inputs)).mean()
    percentages = 100 * mean_errors / magnitude
    return Accuracy(
        nmae=float(percentages.mean()),
        standard_error=float(percentages.std()),
        groups=FUNCTIONS,
    )


def drawn_for_holdout(
    numbers: Indices, seed: int, length: int = SHARE
) -> NDArray[np.bool_]:
    """Draw surfaces or tiles for the holdout: one of every `length` successive numbers.

    The draw depends on the number and the seed alone. A surface of the holdout therefore stays in
    it as the database grows.

    Parameters
    ----------
    numbers : ndarray, shape (n,)
        Numbers of surfaces or tiles.
    seed : int
        Seed of the scene.
    length : int
        Length of the intervals of numbers, from each of which one number is drawn.

    Returns
    -------
    ndarray of bool, shape (n,)
        True for surfaces and tiles of the holdout.
    """
    chosen = []
    for number in map(int, numbers):
        interval = number // length
        sequence = np.random.SeedSequence(seed, spawn_key=(KEY, interval, KEY))
        random = np.random.Generator(np.random.PCG64(sequence))
        place = int(random.integers(length))
        chosen.append(place == number % length)
    return np.array(chosen, dtype=bool)


def holdout(rows: Dataset) -> NDArray[np.bool_]:
    """Choose the rows that test a surrogate; all other rows may train it.

    No group of rows is divided. The first row of a group decides for all its rows: those of a
    surface that repeats an earlier one, and those of tiles that share a window.

    Parameters
    ----------
    rows : Dataset
        The n usable rows of a whole database.

    Returns
    -------
    ndarray of bool, shape (n,)
        True for rows that test.
    """
    scene = rows.origins[0].scene
    length = SHARE
    if rows.by_tile:
        assert isinstance(scene.surface, ScanSurface)
        # With fewer groups of tiles than `SHARE`, one of all of them is held out.
        length = min(SHARE, scene.surface.tile_groups())
        with Reader(Path(rows.name)) as reader:
            numbers = np.asarray(reader.column(TILE)[rows.rows], dtype=np.int64)
    elif np.ptp(rows.groups) > 0:
        numbers = rows.rows // scene.samples_per_surface  # of the surfaces
    else:  # all rows are of one surface, and are drawn one by one
        numbers = rows.rows
    # The first row of each group, and the group of each row.
    _, first, group = np.unique(rows.surfaces, return_index=True, return_inverse=True)
    is_drawn = drawn_for_holdout(numbers[first], scene.seed, length)  # for each group
    return is_drawn[group.ravel()]


def split_by_holdout(sets: list[Dataset], seed: int) -> Split:
    """Split rows into the test rows of `holdout` and training rows in random order with folds.

    Parameters
    ----------
    sets : list of Dataset
        One dataset for each target; all have equal rows.
    seed : int
        Seed of the order of the training rows.

    Returns
    -------
    Split
        Training and test rows, for all targets. No group of rows is divided.

    Raises
    ------
    InputError
        If training or test rows are fewer than two, or a target does not vary over them.
    """
    rows = sets[0]
    tests = holdout(rows)
    test = np.flatnonzero(tests)
    train = np.flatnonzero(~tests)
    for target in sets:
        _require_varying(target, "training", train)
        _require_varying(target, "test", test)
    groups, labels = np.unique(rows.surfaces[train], return_inverse=True)
    random = np.random.default_rng(seed)
    # Place of each row's group in the random order of the groups.
    place = random.permutation(groups.size)[labels]
    order = np.argsort(place, kind="stable")
    return Split(
        train=train[order],
        test=test,
        folds=(place[order] * FOLDS // groups.size).astype(np.int8),
        seed=seed,
        by_surface=rows.by_tile or bool(np.ptp(rows.groups) > 0),
    )


def _require_varying(rows: Dataset, name: str, part: Indices) -> None:
    """Refuse a part, "training" or "test", of fewer than two rows or with a constant target."""
    if part.size < 2 or np.ptp(rows.target[part]) == 0:
        raise InputError(
            f"{rows.name}: {rows.target_name} does not vary over the"
            f" {part.size} {name} rows of {rows.size}: more are needed"
        )


@dataclass(frozen=True, eq=False)
class Judged:
    """Predictions of one target for n test rows, in the unit of the target."""

    truth: Values  # (n,), solved values
    prediction: Values  # (n,)
    low: Values  # (n,), lower ends of the intervals
    high: Values  # (n,), upper ends of the intervals
    accuracy: Accuracy  # estimated error of all predictions

    @property
    def inside(self) -> NDArray[np.bool_]:
        """True for rows whose solved value is inside the interval, (n,)."""
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
        Predictions with their intervals, and the estimated error. For features of a scene this is
        the error of the mean over surfaces.
    """
    raw = learnt.raw(rows.inputs)
    ends = learnt.calibration.ends(raw, LEVEL, rows.inputs)
    low, high = (np.clip(end * rows.scale, *learnt.bounds) for end in ends)
    predicted = np.clip(raw * rows.scale, *learnt.bounds)
    truth = rows.target * rows.scale
    if rows.features.of_scene:
        estimate = accuracy_of_mean(learnt, rows)
    else:
        estimate = accuracy(np.abs(predicted - truth), truth, rows.groups)
    return Judged(
        truth=truth, prediction=predicted, low=low, high=high, accuracy=estimate
    )


class Curve(NamedTuple):
    """The learning curve of a target.

    It is a power law of the number of rows, through the error of the last look.
    """

    rows: Values  # (k,), rows of the database at k looks
    nmae: Values  # (k,), errors at these looks [%]

    @property
    def exponent(self) -> float:
        """Exponent c of the law nMAE ~ rows^-c, fitted to all looks, within `EXPONENTS`."""
        logarithms = np.log(np.maximum(self.nmae, 1e-12))  # an error may be 0
        slope = np.polyfit(np.log(self.rows), logarithms, 1)[0]
        return float(np.clip(-slope, *EXPONENTS))

    def at(self, rows: Values) -> Values:
        """Return the errors of the curve, (n,) [%], at numbers of rows, (n,)."""
        ratio = rows / self.rows[-1]
        return np.asarray(self.nmae[-1] * ratio**-self.exponent)


@dataclass(frozen=True, eq=False)
class Look:
    """A surrogate of the present rows of a database, judged on the holdout."""

    rows: int  # number of finished rows of the database
    # number of the smallest size that has at least these rows, see `size_with`
    number: int
    row_limit: int  # largest number of rows that the user allows for the database
    mark: float  # largest nMAE that the user accepts [%]
    surrogate: Surrogate
    judged: dict[str, Judged]  # by target
    parts: Split  # training and test rows
    curve: Curve | None = None  # of the worst target; None before `POINTS` looks
    # Result of `advise`. None without a curve, if the mark is met already, or if the database has
    # all rows that the user allows.
    advised_rows: float | None = None

    def bound(self, target: str) -> float:
        """Return the bound of a target's error, which is above it with a small probability.

        The probability is the `risk` of the look's size.

        Parameters
        ----------
        target : str
            Name of the target.

        Returns
        -------
        float
            Bound of the nMAE [%].
        """
        return self.judged[target].accuracy.bound(risk(self.number))

    @property
    def worst(self) -> str:
        """Name of the target with the largest bound."""
        return max(self.judged, key=self.bound)

    @property
    def met(self) -> bool:
        """True if no bound is above the mark, and all predictions are better than a constant."""
        if self.bound(self.worst) > self.mark:
            return False
        targets = self.surrogate.card["targets"].values()
        return not any(no_better(target["scores"]["r2"]) for target in targets)

    def needed_rows_text(self) -> str:
        """Return half a sentence about the rows that the mark needs; "" without `advised_rows`."""
        if self.advised_rows is None:
            return ""
        if math.isinf(self.advised_rows):
            return f"the learning curve does not reach the mark within {self.row_limit:,} rows"
        missing = self.advised_rows - self.rows
        return f"the learning curve asks for {self.advised_rows:,.0f} rows, {missing:,.0f} more"

    def in_words(self) -> str:
        """Return a line with the error of each target, and `needed_rows_text` for a missed mark."""
        errors = []
        for name, judged in self.judged.items():
            accuracy = judged.accuracy
            errors.append(
                f"{name} {accuracy.nmae:.2f} +- {accuracy.standard_error:.2f} %"
                f" (at most {self.bound(name):.2f} %)"
            )
        text = f"{self.rows} rows: nMAE of {', '.join(errors)}; asked: {self.mark:g} %"
        if self.met:
            return f"{text}: met"
        needed_rows = self.needed_rows_text()
        if needed_rows:
            text += f"; {needed_rows}"
        return text


def advise(look: Look, curve: Curve, rows: Dataset) -> float:
    """Estimate how many rows the mark needs.

    Parameters
    ----------
    look : Look
        The last look. Its mark is not met, and its rows are fewer than the row limit.
    curve : Curve
        Learning curve of its worst target.
    rows : Dataset
        Rows of the last look. If they are windows of maps, the number of groups does not grow with
        the database, because the maps have no further tiles.

    Returns
    -------
    float
        Rows of the first size at which the bound is expected to be at most the mark, the row limit
        being the last size; infinite if the bound is expected to be above the mark at all sizes.
    """
    per_surface = rows.origins[0].scene.samples_per_surface
    present = look.judged[look.worst].accuracy
    # The size of number `look.number` has more rows than the look if that ended between two sizes.
    next_number = size_with(look.rows + 1, per_surface)
    last_number = size_with(look.row_limit, per_surface)
    for number in range(next_number, last_number + 1):
        larger = min(size(number, per_surface), look.row_limit)
        share = float(curve.at(np.array([larger]))[0]) / curve.nmae[-1]
        growth = larger / look.rows  # of the number of groups
        if rows.by_tile:
            growth = 1.0
        expected = Accuracy(
            nmae=present.nmae * share,
            standard_error=present.standard_error * share / math.sqrt(growth),
            groups=max(int(present.groups * growth), 2),
        )
        if expected.bound(risk(number)) <= look.mark:
            return float(larger)
    return math.inf
