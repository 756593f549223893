"""The learning curve of a growing database, and the number of rows that it advises.

The rows of a scene are independent draws, so that a part of a database is a smaller database.
Models fitted to parts, judged on all rows of the holdout, give points of the curve a + b n^-c,
which is fitted to their logarithms.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gen.arrays import Values
from learn.dataset import Dataset, Request
from learn.grow.accuracy import Accuracy, Appraisal, Sizes, judge, risk
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
    train, calibration = without_calibration(rows, found.parts.train)
    inside = (rows.rows[train] >= start) & (rows.rows[train] < stop)
    part, folds = rows.at(train[inside]), found.parts.folds[: train.size][inside]
    if part.size < FEWEST_TRAINING or np.ptp(part.target) == 0 or np.ptp(folds) == 0:
        return None
    fit = fit_target(request, part, rows.at(calibration), folds)
    return judge(fit.learnt, rows.at(found.parts.test)).accuracy.nmae


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
