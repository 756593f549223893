"""How accurate a surrogate of a growing database is, and how sure that is.

A fixed random fifth of the surfaces, or of the maps' tiles, is held out: their rows never train.
The error on them has a bound that the true error exceeds with a small probability only.

Looking often makes it likely that one look is lucky. The sizes of the database at which it is
looked at are therefore fixed in advance, and the look at size number k may be wrong with a
probability of only `RISK` / ((k + 1) (k + 2)). These probabilities add up to `RISK`, so that it
bounds the probability that a surrogate worse than its mark is accepted at any of the sizes, however
many of them are looked at.

The rows of a scene are independent draws, so that a part of a database is a smaller database.
Models fitted to parts, judged on all rows of the holdout, give points of the learning curve
a + b n^-c, which is fitted to their logarithms.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.scene import ScanSurface
from learn import dataset
from learn.dataset import Dataset, Request
from learn.executor import Executor, within
from learn.metrics import no_better
from learn.split import FOLDS, TILE, Split, require_tiles
from learn.surrogate import fitting
from learn.surrogate.fitting import fit_target
from learn.surrogate.learnt import Learnt
from learn.surrogate.model import Surrogate

RISK = 0.05
"""Largest probability that a surrogate is accepted although its error is above the mark."""

SMALLEST_ROWS = 60
"""Rows of the smallest database, at least."""

SMALLEST_SURFACES = 20
"""Surfaces of the smallest database, at least."""

RATIO = math.sqrt(2)
"""Ratio of two successive sizes."""

SHARE = 5
"""One of this many surfaces, or tiles, is in the holdout."""

KEY = 20_260
"""Key of the draw's stream of random numbers, which belongs to no other part of a scene."""

LEVEL = 0.9
"""Coverage of the intervals that are looked at."""


@dataclass(frozen=True)
class Sizes:
    """The sizes of a database at which it is looked at: multiples of `samples_per_surface` rows."""

    samples_per_surface: int

    def rows(self, number: int) -> int:
        """Return the rows of a size, counted from 0: two digits, rounded up to whole surfaces."""
        smallest = max(SMALLEST_ROWS, SMALLEST_SURFACES * self.samples_per_surface)
        return self.rounded_up(int(float(f"{smallest * RATIO**number:.2g}")))

    def rounded_up(self, rows: int) -> int:
        """Round a number of rows up to whole surfaces."""
        return -(-rows // self.samples_per_surface) * self.samples_per_surface

    def number(self, rows: int) -> int:
        """Return the number of the smallest size that has some number of rows, or more."""
        number = 0
        while self.rows(number) < rows:
            number += 1
        return number


def risk(number: int) -> float:
    """Return the probability with which the look at a size may accept a surrogate wrongly."""
    return RISK / ((number + 1) * (number + 2))


def quantile(risk: float, groups: int) -> float:
    """Return the value that Student's t of `groups` - 1 degrees exceeds with a probability."""
    from scipy.stats import t

    return float(t.ppf(1.0 - risk, groups - 1))


class Accuracy(NamedTuple):
    """Error of a surrogate, estimated on test rows."""

    nmae: float  # mean absolute error over the mean magnitude of the truth [%]
    error: float  # its standard error, infinite if there is a single group [%]
    groups: int  # surfaces, or tiles of maps, that the rows are of

    def bound(self, risk: float) -> float:
        """Return a number that the surrogate's error exceeds with a probability of `risk` only [%].

        It is nMAE exp(t SE / nMAE) with Student's t. On the logarithm's scale the skewness of
        absolute errors matters little: nMAE + t SE fails several times as often as it may.
        """
        if self.nmae == 0.0:
            return 0.0
        if self.groups < 2:
            return math.inf
        relative = quantile(risk, self.groups) * self.error / self.nmae
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


def drawn(numbers: Indices, seed: int, among: int = SHARE) -> NDArray[np.bool_]:
    """Tell which surfaces or tiles, (n,), are in the holdout: of `among` successive numbers, one.

    That is a function of each number and the seed alone, whatever the size of the database.
    """
    values, places = np.unique(numbers, return_inverse=True)
    chosen = []
    for value in map(int, values):
        sequence = np.random.SeedSequence(seed, spawn_key=(KEY, value // among, KEY))
        draw = np.random.Generator(np.random.PCG64(sequence)).integers(among)
        chosen.append(int(draw) == value % among)
    return np.array(chosen, dtype=bool)[places.ravel()]


def split_holdout(rows: Dataset) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell which of the usable rows of a whole database test, and which may train, (n,) each.

    No group has rows in both. A row is in neither if it could train but shares its group with rows
    that test, as windows of two tiles do that are equal to the last bit. Surfaces that repeat an
    earlier one follow that one.
    """
    scene = rows.origins[0].scene
    if rows.by_tile:
        assert isinstance(scene.surface, ScanSurface)
        with Reader(Path(rows.name)) as reader:
            tiles = np.asarray(reader.column(TILE)[rows.rows], dtype=np.int64)
        test = drawn(tiles, scene.seed, min(SHARE, scene.surface.tile_groups()))
    elif np.ptp(rows.groups) == 0:  # one surface under many loads: its rows are drawn one by one
        test = drawn(rows.rows, scene.seed)
        return test, ~test
    else:
        surfaces = rows.rows // scene.samples_per_surface
        _, first, place = np.unique(rows.groups, return_index=True, return_inverse=True)
        test = drawn(surfaces[first], scene.seed)[place.ravel()]
    tested = np.unique(rows.groups[test])
    return test, ~np.isin(rows.groups, tested)


def parted(sets: list[Dataset], seed: int) -> Split:
    """Divide the rows of each target into training rows, in random order with folds, and test rows.

    Groups stay together. InputError is raised if there are too few rows in a part, or a target does
    not vary there.
    """
    rows = sets[0]
    test, train = (np.flatnonzero(each) for each in split_holdout(rows))
    for each in sets:
        for name, part in (("training", train), ("test", test)):
            if part.size < 2 or np.ptp(each.target[part]) == 0:
                raise InputError(
                    f"{rows.name}: {each.target_name} does not vary over the"
                    f" {part.size} {name} rows of {rows.size}: more are needed"
                )
    by_surface = rows.by_tile or bool(np.ptp(rows.groups) > 0)
    labels = rows.groups[train] if by_surface else rows.rows[train]
    groups = np.unique(labels)
    order = np.random.default_rng(seed).permutation(groups.size)
    place = order[np.searchsorted(groups, labels)]
    shuffled = np.argsort(place, kind="stable")
    folds = (place[shuffled] * FOLDS // groups.size).astype(np.int8)
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
    found = accuracy(np.abs(predicted - truth), truth, rows.groups)
    return Judged(truth, predicted, low, high, found)


@dataclass(frozen=True, eq=False)
class Appraisal:
    """A surrogate of the present rows, and its errors on the holdout."""

    rows: int  # finished ones of the database
    number: int  # of the database's size
    mark: float  # largest nMAE that is asked for [%]
    surrogate: Surrogate
    sets: list[Dataset]  # the usable rows for each target
    parts: Split  # their division
    judged: dict[str, Judged]  # by target
    reading: float  # time to read the rows, and to compute the features of new ones [s]

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
        scored = [each["scores"]["r2"] for each in self.surrogate.card["targets"].values()]
        return self.bound(self.worst) <= self.mark and not any(map(no_better, scored))


def appraise(
    request: Request,
    rows: int,
    number: int,
    mark: float,
    executor: Executor,
    say: Callable[[str], None],
    stopping: Callable[[], bool],
    until: float = math.inf,
) -> Appraisal | None:
    """Fit a surrogate to the finished rows, judge it by a mark and save it; None after a stop.

    The rows are those of the size of a number. The fit is stopped at the time `until` of
    `time.time` [s]. InputError is raised if there are too few rows to fit or to judge.
    """
    began = time.monotonic()
    sets = dataset.read(request, executor, stopping, common=True)
    if not sets:
        return None
    require_tiles(sets[0])
    reading = time.monotonic() - began
    sets = [each.at(np.flatnonzero(each.rows < rows)) for each in sets]
    parts = parted(sets, request.seed)
    done = within(_fitted, (request, sets, parts), None, until)
    if done is None:
        return None
    surrogate, lines = done
    for line in lines:
        say(line)
    judged = {
        target: judge(surrogate.learnt[target], each.at(parts.test))
        for target, each in zip(request.targets, sets, strict=True)
    }
    found = Appraisal(rows, number, mark, surrogate, sets, parts, judged, reading)
    surrogate.card["grown"] = {
        "mark": mark,
        "met": found.met,
        "rows": rows,
        "errors": {name: each.accuracy.error for name, each in judged.items()},
        "bounds": {name: found.bound(name) for name in judged},
    }
    surrogate.save(request.output)
    return found


def _fitted(data: tuple[Request, list[Dataset], Split], task: None) -> tuple[Surrogate, list[str]]:
    """Fit a surrogate to rows that are divided; return the lines for the user too."""
    lines: list[str] = []
    return fitting.fit_parts(*data, lines.append), lines


FEWEST_ROWS = 15
"""Rows of the smallest part."""

FEWEST_TRAINING = 8
"""Training rows of a part, at least."""

MOST_ROWS = 2000
"""Rows of the largest part: more would take longer than the fit itself."""

HALVINGS = 3
"""Times that the size of the parts is halved: the first rows teach much more than later ones, so
that errors of still smaller parts would bend the curve."""

DRAWS = 4
"""Parts of one size, at most."""

EXPONENTS = (0.1, 1.0)
"""Smallest and largest exponent of a curve. Steeper ones, which pass for a curve where few rows
scatter, would level off at once."""


@dataclass(frozen=True, eq=False)
class Curve:
    """The learning curve of a target."""

    target: str
    rows: Values  # of the databases, ascending, (k,)
    nmae: Values  # mean error of the parts of one size, (k,) [%]
    lowest: Values  # smallest of them, (k,) [%]
    highest: Values  # largest of them, (k,) [%]
    fit: Values  # a [%], b [%] and c of the curve a + b n^-c, (3,)


def learning_curve(request: Request, found: Appraisal) -> Curve | None:
    """Fit models to parts of a database, and a curve to the errors of its worst target.

    None is returned if the database is too small for three points.
    """
    target = found.worst
    rows = found.sets[request.targets.index(target)]
    points = [(found.rows, found.judged[target].accuracy.nmae)]
    for size, start in _parts(found.rows):
        error = _error_of_part(request, found, rows, start, start + size)
        if error is not None:
            points.append((size, error))
    sizes = np.unique([size for size, _ in points])
    if sizes.size < 3:
        return None
    errors = [np.array([error for size, error in points if size == wanted]) for wanted in sizes]
    means = np.array([each.mean() for each in errors])
    lowest, highest = (np.array([end(each) for each in errors]) for end in (np.min, np.max))
    numbers = sizes.astype(float)
    return Curve(target, numbers, means, lowest, highest, fitted(numbers, means))


def _parts(rows: int) -> Iterator[tuple[int, int]]:
    """Yield size and first row of parts: halves, quarters and so on, a few of each size."""
    largest = rows // 2
    while largest > MOST_ROWS:
        largest //= 2
    for size in (largest >> halving for halving in range(HALVINGS)):
        if size >= FEWEST_ROWS:
            yield from ((size, draw * size) for draw in range(min(DRAWS, rows // size)))


def _error_of_part(
    request: Request, found: Appraisal, rows: Dataset, start: int, stop: int
) -> float | None:
    """Return the nMAE of a model of some rows on all test rows [%].

    None if these rows cannot be trained on, since they are too few or all alike.
    """
    train, test = found.parts.train, rows.at(found.parts.test)
    inside = (rows.rows[train] >= start) & (rows.rows[train] < stop)
    part, folds = rows.at(train[inside]), found.parts.folds[inside]
    if part.size < FEWEST_TRAINING or np.ptp(part.target) == 0 or np.ptp(folds) == 0:
        return None
    fit = fit_target(request, part, test, folds)  # its intervals are not looked at
    return judge(fit.learnt, test).accuracy.nmae


def fitted(rows: Values, nmae: Values) -> Values:
    """Fit a + b n^-c to errors at numbers of rows, (k,) [%], by least squares of logarithms.

    Return a, not below 0 [%], b [%] and c, shape (3,).
    """
    from scipy.optimize import least_squares

    nmae = np.maximum(nmae, 1e-12)
    unit = math.sqrt(rows[0] * rows[-1])
    wanted = np.log(nmae)

    def residuals(parameters: Values) -> Values:
        floor, scale, exponent = parameters
        return np.asarray(np.log(floor + np.exp(scale) * (rows / unit) ** -exponent) - wanted)

    smallest = float(nmae.min())
    start = [0.3 * smallest, float(np.log(np.median(nmae))), 0.5]
    limits = [0.0, -np.inf, EXPONENTS[0]], [0.999 * smallest, np.inf, EXPONENTS[1]]
    floor, scale, exponent = least_squares(residuals, start, bounds=limits).x
    return np.array([floor, math.exp(scale) * unit**exponent, exponent])


def values(curve: Values, rows: Values) -> Values:
    """Return a + b n^-c at numbers of rows, (n,) [%]."""
    floor, scale, exponent = curve
    return np.asarray(floor + scale * rows**-exponent)


def advise(found: Appraisal, curve: Curve, sizes: Sizes, most: int) -> float:
    """Return how many rows meet the mark, of the sizes that the database can have up to the most.

    It is the first size at which the bound is expected to be below the mark; infinite if none is.
    """
    error = found.judged[curve.target].accuracy
    for number in range(found.number + 1, sizes.number(most) + 1):
        rows = min(sizes.rows(number), most)
        grows = 1.0 if found.sets[0].by_tile else rows / found.rows
        at, here = values(curve.fit, np.array([rows, found.rows], dtype=float))
        nmae = error.nmae * at / here
        relative = error.error / error.nmae / math.sqrt(grows) if error.nmae else 0.0
        expected = Accuracy(nmae, nmae * relative, max(int(error.groups * grows), 2))
        if expected.bound(risk(number)) <= found.mark:
            return float(rows)
    return math.inf
