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
    400  # functions that a process might be, of which errors of its mean are taken
)
POINTS = 4  # looks of a learning curve, at least
EXPONENTS = (0.1, 1.0)  # smallest and largest exponent of a curve


def size(number: int, per_surface: int) -> int:
    """Return the rows of a size, counted from 0: two digits, rounded up to whole surfaces."""
    smallest = max(SMALLEST_ROWS, SMALLEST_SURFACES * per_surface)
    return -(-int(float(f"{smallest * RATIO**number:.2g}")) // per_surface) * per_surface


def size_with(rows: int, per_surface: int) -> int:
    """Return the number of the smallest size that has some number of rows, or more."""
    return next(number for number in count() if size(number, per_surface) >= rows)


def risk(number: int) -> float:
    """Return the probability with which the look at a size may accept a surrogate wrongly."""
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
    """Estimate a surrogate's error from absolute errors, solved values and surfaces of rows, (n,).

    It is the ratio of both means; its standard error is linearised, and that of whole groups, since
    rows of one surface or tile are not independent. Not all solved values may be 0.

    Source: W. G. Cochran (1977), Sampling Techniques, sections 2.11 and 9A.
    """
    _, place = np.unique(groups, return_inverse=True)
    wrong, true = (np.bincount(place.ravel(), each) for each in (errors, np.abs(truth)))
    ratio, number = float(wrong.sum() / true.sum()), wrong.size
    if number < 2:
        return Accuracy(100 * ratio, math.inf, number)
    squares = float(np.sum((wrong - ratio * true) ** 2))
    error = math.sqrt(number / (number - 1) * squares) / float(true.sum())
    return Accuracy(100 * ratio, 100 * error, number)


def accuracy_of_mean(learnt: Learnt, rows: Dataset) -> Accuracy:
    """Estimate the error of the mean over surfaces at the parameters and loads of rows.

    Surfaces of the same parameters differ by much more than their mean is uncertain. The error is
    the distance of the mean from other functions that the process might be as well.
    """
    model, scaled = learnt.pipeline[-1], learnt.pipeline[:-1].transform(rows.inputs)
    wrong = (
        np.abs(model.drawn_errors(scaled, FUNCTIONS)).mean(axis=0)
        * learnt.scaling.deviation
    )
    errors = 100 * wrong / np.abs(learnt.raw(rows.inputs)).mean()
    return Accuracy(float(errors.mean()), float(errors.std()), FUNCTIONS)


def drawn(numbers: Indices, seed: int, among: int = SHARE) -> NDArray[np.bool_]:
    """Tell which surfaces or tiles, (n,), are in the holdout: of `among` successive numbers, one.

    That is a function of each number and the seed alone, whatever the size of the database.
    """
    chosen = []
    for value in map(int, numbers):
        sequence = np.random.SeedSequence(seed, spawn_key=(KEY, value // among, KEY))
        draw = np.random.Generator(np.random.PCG64(sequence)).integers(among)
        chosen.append(int(draw) == value % among)
    return np.array(chosen, dtype=bool)


def holdout(rows: Dataset) -> NDArray[np.bool_]:
    """Tell which of the usable rows of a whole database test, (n,); the others may train.

    No group has rows in both: a surface that repeats an earlier one follows that one, and so do
    tiles of which two windows are equal to the last bit.
    """
    scene, groups, among = rows.origins[0].scene, rows.surfaces, SHARE
    numbers = (
        rows.rows if np.ptp(rows.groups) == 0 else rows.rows // scene.samples_per_surface
    )
    if rows.by_tile:
        assert isinstance(scene.surface, ScanSurface)
        among = min(SHARE, scene.surface.tile_groups())
        with Reader(Path(rows.name)) as reader:
            numbers = np.asarray(reader.column(TILE)[rows.rows], dtype=np.int64)
    _, first, place = np.unique(groups, return_index=True, return_inverse=True)
    return drawn(numbers[first], scene.seed, among)[place.ravel()]


def parted(sets: list[Dataset], seed: int) -> Split:
    """Divide the rows of each target into training rows, in random order with folds, and test rows.

    Groups stay together. InputError is raised if there are too few rows in a part, or a target does
    not vary there.
    """
    rows = sets[0]
    tests = holdout(rows)
    test, train = np.flatnonzero(tests), np.flatnonzero(~tests)
    for each in sets:
        for name, part in (("training", train), ("test", test)):
            if part.size < 2 or np.ptp(each.target[part]) == 0:
                raise InputError(
                    f"{rows.name}: {each.target_name} does not vary over the"
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
    """Compare the predictions of a target with the solver's results for some rows."""
    raw = learnt.raw(rows.inputs)
    ends = learnt.calibration.ends(raw, LEVEL, rows.inputs)
    low, high = (np.clip(each * rows.scale, *learnt.bounds) for each in ends)
    predicted = np.clip(raw * rows.scale, *learnt.bounds)
    truth = rows.target * rows.scale
    of_mean = rows.features.of_scene
    errors = np.abs(predicted - truth)
    found = (
        accuracy_of_mean(learnt, rows)
        if of_mean
        else accuracy(errors, truth, rows.groups)
    )
    return Judged(truth, predicted, low, high, found)


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
        scored = [
            each["scores"]["r2"] for each in self.surrogate.card["targets"].values()
        ]
        return self.bound(self.worst) <= self.mark and not any(map(no_better, scored))

    def asked_for(self) -> str:
        """Say how many more rows the learning curve asks for; "" where it says nothing."""
        if self.advice is None:
            return ""
        if math.isinf(self.advice):
            return "the learning curve does not come to it"
        more = self.advice - self.rows
        return f"the learning curve asks for {self.advice:,.0f} rows, {more:,.0f} more"

    def in_words(self) -> str:
        """Say how accurate the surrogate is, and how many rows the mark needs."""
        errors = ", ".join(
            f"{name} {each.accuracy.nmae:.2f} +- {each.accuracy.error:.2f} %"
            f" (at most {self.bound(name):.2f} %)"
            for name, each in self.judged.items()
        )
        end = "met" if self.met else self.asked_for()
        said = f"{self.rows} rows: nMAE of {errors}; asked: {self.mark:g} %"
        return f"{said}{': ' if self.met else '; ' if end else ''}{end}"


def advise(found: Look, curve: Curve, most: int, rows: Dataset) -> float:
    """Return how many rows meet the mark, of the sizes that the database can have up to the most.

    It is the first size at which the bound is expected to be below the mark; infinite if none is.
    More rows of maps have the same tiles, whose errors differ as before.
    """
    per_surface = rows.origins[0].scene.samples_per_surface
    error = found.judged[found.worst].accuracy
    for number in range(found.number + 1, size_with(most, per_surface) + 1):
        wanted = min(size(number, per_surface), most)
        share = float(curve.at(np.array([wanted]))[0]) / curve.nmae[-1]
        grows = 1.0 if rows.by_tile else wanted / found.rows
        expected = Accuracy(
            error.nmae * share,
            error.error * share / math.sqrt(grows),
            max(int(error.groups * grows), 2),
        )
        if expected.bound(risk(number)) <= found.mark:
            return float(wanted)
    return math.inf
