"""The learning curve of a growing database, and the number of rows that it advises.

The rows of a scene are independent draws, so that a part of a database is a smaller database.
Models fitted to parts, judged on all rows of the holdout, give points of the curve a + b n^-c,
which is fitted to their logarithms. Drawing the surfaces of the holdout and the parts again and
again, with replacement, shows how uncertain the curve is.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gen.arrays import Values
from learn.dataset import Dataset, Request
from learn.grow.accuracy import Appraisal, Sizes, judge, quantile, risk, summed
from learn.surrogate.calibration import without_calibration
from learn.surrogate.fitting import fit_target

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

REPETITIONS = 100
"""Curves of resampled parts and test rows."""

EXPONENTS = (0.1, 1.0)
"""Smallest and largest exponent of a curve. Steeper ones, which pass for a curve where few rows
scatter, would level off at once."""

BAND = (0.1, 0.9)
"""Quantiles of the resampled curves that are stated."""


@dataclass(frozen=True, eq=False)
class Curve:
    """The learning curve of a target."""

    target: str
    rows: Values  # of the databases, ascending, (k,)
    nmae: Values  # mean error of the parts of one size, (k,) [%]
    lowest: Values  # smallest of them, (k,) [%]
    highest: Values  # largest of them, (k,) [%]
    fit: Values  # a [%], b [%] and c of the curve a + b n^-c, (3,)
    resampled: Values  # the same of the resampled curves, (repetitions, 3)

    def at(self, rows: Values) -> tuple[Values, Values, Values]:
        """Return the curve, and both ends of its band, at numbers of rows; each (n,) [%]."""
        every = np.stack([values(each, rows) for each in self.resampled])
        low, high = np.quantile(every, BAND, axis=0)
        return values(self.fit, rows), low, high


class Advice(NamedTuple):
    """Rows of the database that meets the mark, infinite if no allowed number suffices.

    With quantiles of the resampled curves, and the share of them that do not come to the mark.
    """

    rows: float
    low: float
    high: float
    hopeless: float


def learning_curve(request: Request, found: Appraisal) -> Curve | None:
    """Fit models to parts of a database, and a curve to the errors of its worst target.

    None is returned if the database is too small for three points.
    """
    target = found.worst
    rows, judged = found.sets[request.targets.index(target)], found.judged[target]
    groups = rows.at(found.parts.test).groups
    truth = summed(np.abs(judged.truth), groups)
    points = [(found.rows, summed(np.abs(judged.prediction - judged.truth), groups))]
    for size, start in _parts(found.rows):
        errors = _wrong_of_part(request, found, rows, start, start + size)
        if errors is not None:
            points.append((size, errors))
    sizes = np.unique([size for size, _ in points])
    if sizes.size < 3:
        return None
    wrong = [np.array([each for size, each in points if size == wanted]) for wanted in sizes]
    shares = [100 * each.sum(axis=1) / truth.sum() for each in wrong]
    means = np.array([each.mean() for each in shares])
    return Curve(
        target=target,
        rows=sizes.astype(float),
        nmae=means,
        lowest=np.array([each.min() for each in shares]),
        highest=np.array([each.max() for each in shares]),
        fit=fitted(sizes.astype(float), means),
        resampled=_resampled(sizes.astype(float), wrong, truth, request.seed),
    )


def _parts(rows: int) -> Iterator[tuple[int, int]]:
    """Yield size and first row of parts: halves, quarters and so on, a few of each size."""
    largest = rows // 2
    while largest > MOST_ROWS:
        largest //= 2
    for size in (largest >> halving for halving in range(HALVINGS)):
        if size >= FEWEST_ROWS:
            yield from ((size, draw * size) for draw in range(min(DRAWS, rows // size)))


def _wrong_of_part(
    request: Request, found: Appraisal, rows: Dataset, start: int, stop: int
) -> Values | None:
    """Return the absolute errors of a model of some rows, summed over each group of test rows.

    None if these rows cannot be trained on, since they are too few or all alike.
    """
    train, calibration = without_calibration(rows, found.parts.train)
    inside = (rows.rows[train] >= start) & (rows.rows[train] < stop)
    part, folds = rows.at(train[inside]), found.parts.folds[: train.size][inside]
    if part.size < FEWEST_TRAINING or np.ptp(part.target) == 0 or np.ptp(folds) == 0:
        return None
    fit = fit_target(request, part, rows.at(calibration), folds)
    test = rows.at(found.parts.test)
    judged = judge(fit.learnt, test)
    return summed(np.abs(judged.prediction - judged.truth), test.groups)


def _resampled(rows: Values, wrong: list[Values], truth: Values, seed: int) -> Values:
    """Return curves of resampled parts and groups of test rows, shape (repetitions, 3)."""
    random = np.random.default_rng(seed)
    curves = []
    for _ in range(REPETITIONS):
        weights = random.multinomial(truth.size, np.full(truth.size, 1 / truth.size))
        if not truth @ weights:  # only surfaces on which the target is 0
            continue
        errors = []
        for parts in wrong:
            drawn = parts[random.integers(len(parts), size=len(parts))]
            errors.append(100 * float((drawn @ weights).mean()) / float(truth @ weights))
        curves.append(fitted(rows, np.array(errors)))
    return np.array(curves)


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


def advise(found: Appraisal, curve: Curve, sizes: Sizes, most: int) -> Advice:
    """Say how many rows meet the mark, of the sizes that the database can have up to the most.

    It is the first size at which the bound is expected to be below the mark.
    """
    error = found.judged[curve.target].accuracy
    numbers = range(found.number + 1, sizes.number(most) + 1)
    rows = np.array([min(sizes.rows(number), most) for number in numbers], dtype=float)
    if not rows.size:
        return Advice(math.inf, math.inf, math.inf, 1.0)
    grows = rows / found.rows if not found.sets[0].by_tile else np.ones(rows.size)
    relative = error.error / error.nmae / np.sqrt(grows) if error.nmae else np.zeros(rows.size)
    groups = np.maximum(error.groups * grows, 2).astype(int)
    margins = np.exp(
        [
            min(quantile(risk(number), count) * each, 700.0)
            for number, count, each in zip(numbers, groups, relative, strict=True)
        ]
    )

    def needed(each: Values) -> float:
        here = values(each, np.array([float(found.rows)]))[0]
        bounds = error.nmae * values(each, rows) / here * margins
        meets = np.flatnonzero(bounds <= found.mark)
        return float(rows[meets[0]]) if meets.size else math.inf

    every = np.sort([needed(each) for each in curve.resampled])
    low, high = (float(every[int(share * (every.size - 1))]) for share in BAND)
    return Advice(needed(curve.fit), low, high, float(np.mean(np.isinf(every))))
