"""The mean of a result over all surfaces of some parameters, and how uncertain this mean is.

Surfaces of the same parameters differ: a result is a function of parameters and load plus the
scatter between surfaces, which is large, and depends on parameters and load. A surface whose result
is large at one load is one with large results at other loads: four rows of a surface tell hardly
more about the mean than one, but much about what the load does. The mean is a Gaussian process:

- A target above 0 is divided by a power law of its inputs, which are logarithms as a rule. What is
  left varies little, and its scatter hardly at all.
- The size of the scatter is the exponential of a quadratic in the inputs, by the distances from a
  cubic. The deviation of the process is in proportion to the root of the scatter (to the scatter
  itself, or the same everywhere, errors or their estimates are worse).
- The scatter of two rows of a surface is correlated: the most likely exponential of a power of
  their distance, but for a share of each row's own. Rows are whitened by it, so that errors count
  as generalised least squares count them.
- The mean is a plane plus a Matern function, with a length for each input. Lengths and variance
  have the largest evidence on some thousand rows.
- All rows count, but the mean is a sum of functions about a few hundred of them (the subset of
  regressors: J. Quinonero-Candela, C. E. Rasmussen (2005), J. Mach. Learn. Res. 6, 1939).
- Parts of the surfaces are left out in turn, which takes no further fits of the lengths. Errors on
  them calibrate intervals of new surfaces. The error of the mean is the process's own, times what
  two halves of the surfaces tell of each other.
"""

from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, eigh, solve, solve_triangular
from scipy.optimize import minimize, minimize_scalar
from scipy.special import expit
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.preprocessing import PolynomialFeatures

from gen.arrays import Indices, Values
from learn.split import dealt

CENTRES = 500  # rows at most that functions of the mean are about
LIKELY_CENTRES, LIKELY_ROWS = 200, 3000  # the same, and rows, for the evidence
LENGTHS = (0.1, 10.0)  # shortest and longest length, over the deviation of an input
STARTS = (1.0, 2.5)  # lengths from which the search for the most likely ones starts
STEPS = 50  # steps of this search, at most
VARIANCES = (
    1e-3,
    1e5,
)  # least and largest variance of the process, over that of the target
PLANE = 10.0  # deviation of the plane's coefficients before any row is seen, over the target's
PARTS = 20  # parts of the surfaces that are left out in turn
TOGETHER = 200  # rows of a surface, at most, whose correlation counts; more are another surface's
OWN = 1e-4  # least share of the scatter that is a row's own: rows may repeat others
PASSES = 3  # fits of power law and scatter, each with the weights of the last
LEAST = (
    1e-4  # least size of the scatter, over the deviation of the target over its power law
)
KEPT = (
    0.99  # share of the process's variance at the rows that is kept, in far fewer numbers
)
DOUBT = 0.5  # deviation of the logarithm of squared errors of means, over what the process says
LEAST_LARGER = (
    1.15  # least factor of errors over the process's, which takes its lengths for known
)
LEAST_SHARE = 1e-3  # least share of an error in a direction that tells of its size
RIDGE = 1e-6  # penalty of polynomials' coefficients, over the weight of all rows
JITTER = 1e-6  # added to the diagonal of functions at each other's centres, as neighbours are alike
ROUNDING = 1e-14  # added to the equations' diagonal, over the sum of it
FLOOR = 1e-3  # least size of residuals and targets of which logarithms are taken, over the median
SURFACES_PER_TERM = (
    10  # least surfaces for a term of a polynomial: its degree falls with fewer
)


class Population(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Mean of a target over surfaces, of standardised inputs; a regressor of scikit-learn.

    Parameters
    ----------
    random_state : int
        Seed of the draws of centres and parts.
    """

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, X: Values, y: Values, surfaces: Indices | None = None) -> "Population":
        """Fit to inputs, (n, d), and a target, (n,); rows of a surface share its number, (n,).

        Without numbers each row is of a surface of its own.
        """
        random = np.random.default_rng(self.random_state)
        surfaces = np.arange(len(y)) if surfaces is None else surfaces
        weights, most = np.ones(len(y)), np.unique(surfaces).size / SURFACES_PER_TERM
        self.trend_ = np.zeros(X.shape[1] + 1)
        for _ in range(PASSES):
            if y.min() > 0:
                self.trend_ = _polynomial(X, _floored_logarithm(y), weights, 1, most)
            ratio = y / self._trend(X)
            wrong = self._fit_scatter(X, ratio, weights, most)
            weights = self._scatter(X) ** -2
        self.mean_ = float(np.average(ratio, weights=np.sqrt(weights)))
        self.deviation_ = 1.0
        self.deviation_ = float(np.std((ratio - self.mean_) / self._reach(X))) or 1.0
        blocks = _blocks(surfaces)
        alike = _most_alike(X, wrong / self._scatter(X), blocks)
        size = alike.size * self._scatter(X)
        rows = Whitened(
            X, (ratio - self.mean_) / size, self._reach(X) / size, blocks, alike
        )
        centres = X[random.permutation(len(y))[:CENTRES]]
        few = random.permutation(len(y)) < LIKELY_ROWS
        found = _likely(rows.at(few, _blocks(surfaces[few])), centres[:LIKELY_CENTRES])
        self._solve(rows, centres, found, dealt(surfaces, PARTS, random))
        return self

    def _fit_scatter(
        self, X: Values, ratio: Values, weights: Values, most: float
    ) -> Values:
        """Fit the size of the scatter by the distances of the ratio to the power law from a cubic.

        It is the root mean square, and neither below nor above what nearly all rows have. Return
        the distances, (n,).
        """
        distances = ratio - _terms(X, 3) @ _polynomial(X, ratio, weights, 3, most)
        wrong = np.abs(distances)
        self.sizes_ = _polynomial(X, _floored_logarithm(wrong), np.ones(len(X)), 2, most)
        logarithm = _terms(X, 2) @ self.sizes_
        self.ends_ = np.quantile(logarithm, (0.01, 0.99))
        size = np.exp(np.clip(logarithm, *self.ends_))
        larger = np.log(np.sqrt(np.mean((wrong / size) ** 2)))
        self.sizes_[0] += larger
        least = np.log(LEAST * ratio.std())
        self.ends_ = np.maximum(self.ends_ + larger, least)
        return np.asarray(distances)

    def _solve(
        self, rows: "Whitened", centres: Values, found: Values, parts: Indices
    ) -> None:
        """Solve for the coefficients with all rows, and predict each part of them without it.

        `found` are lengths and variance by `_likely`.
        """
        self.lengths_, variance = found[:-1], found[-1]
        self.places_ = centres / self.lengths_
        functions = self._functions(rows.X)
        seen, unit = rows.white(functions * rows.reach[:, None]), rows.white(rows.unit)
        matrix, right = seen.T @ seen, seen.T @ unit
        penalty = np.eye(len(matrix)) * (1 + ROUNDING * np.trace(matrix))
        penalty[: len(centres), : len(centres)] += _among(self.places_)[
            0
        ] / variance - np.eye(len(centres))
        self.coefficients_ = solve(matrix + penalty, right, assume_a="pos")
        left_out = np.empty(len(unit))
        for part in np.unique(parts):
            own = parts == part
            less = matrix - seen[own].T @ seen[own] + penalty
            without = solve(less, right - seen[own].T @ unit[own], assume_a="pos")
            left_out[own] = functions[own] @ without
        self.left_out_ = self._restored(rows.X, left_out)
        larger = _larger(seen, unit, penalty, parts < PARTS // 2)
        inverse = solve_triangular(
            np.linalg.cholesky(matrix + penalty).T, np.eye(len(matrix))
        )
        weighted = functions.T @ functions
        shares, directions = eigh(inverse.T @ weighted @ inverse)
        kept = np.cumsum(shares) > (1 - KEPT) * shares.sum()
        self.spread_ = larger * inverse @ directions[:, kept]

    def _restored(self, X: Values, unit: Values) -> Values:
        """Return means, (n,), of distances from the power law over what the process reaches."""
        return np.asarray((self.mean_ + self._reach(X) * unit) * self._trend(X))

    def _reach(self, X: Values) -> Values:
        """Return the deviation that the process is over, (n,)."""
        return np.asarray(self.deviation_ * np.sqrt(self._scatter(X)))

    def _scatter(self, X: Values) -> Values:
        """Return the size of the scatter over the power law, (n,)."""
        return np.asarray(np.exp(np.clip(_terms(X, 2) @ self.sizes_, *self.ends_)))

    def _trend(self, X: Values) -> Values:
        """Return the power law, (n,); 1 for a target that is not above 0."""
        return np.asarray(np.exp(X @ self.trend_[1:] + self.trend_[0]))

    def _functions(self, X: Values) -> Values:
        """Return the functions about the centres, and those of the plane, (n, m + 1 + d)."""
        return np.hstack([_near(X / self.lengths_, self.places_)[0], _plane(X)])

    def predict(self, X: Values) -> Values:
        """Return the mean, (n,), at standardised inputs, (n, d)."""
        return self._restored(X, self._functions(X) @ self.coefficients_)

    def error(self, X: Values) -> Values:
        """Return the standard error of the mean, (n,)."""
        variance = np.square(self._functions(X) @ self.spread_).sum(axis=1)
        return np.asarray(np.sqrt(variance) * self._reach(X) * self._trend(X))

    def drawn_errors(self, X: Values, number: int) -> Values:
        """Return distances of the mean from functions that the process might be, (n, number)."""
        random = np.random.default_rng(self.random_state)
        draws = self.spread_ @ random.standard_normal((self.spread_.shape[1], number))
        return np.asarray(
            (self._functions(X) @ draws).T * self._reach(X) * self._trend(X)
        ).T


class Alike(NamedTuple):
    """How alike the scatter of rows of one surface is."""

    own: float  # share that is a row's own
    length: float  # distance over which the correlation falls to 1 / e
    power: float = 1.0  # of the distance, in which its logarithm is linear
    size: float = 1.0  # of the scatter, over what was given

    def roots(self, X: Values, blocks: list[Indices]) -> list[Values]:
        """Return the triangular roots of the correlations of rows in blocks, (b, k, k) each."""
        found = []
        for block in blocks:
            rows = X[block]
            apart = np.sqrt(
                np.square(rows[:, :, None, :] - rows[:, None, :, :]).sum(axis=-1)
            )
            alike = np.exp(-((apart / self.length) ** self.power))
            whole = (1 - self.own) * alike + self.own * np.eye(block.shape[1])
            found.append(np.asarray(np.linalg.cholesky(whole)))
        return found


class Whitened:
    """Rows whose scatter is brought to 1, and whitened, of surfaces whose rows are alike."""

    def __init__(
        self, X: Values, unit: Values, reach: Values, blocks: list[Indices], alike: Alike
    ) -> None:
        self.X, self.unit, self.reach, self.alike = (
            X,
            unit,
            reach,
            alike,
        )  # (n, d), (n,), (n,)
        self._blocks = blocks
        self._inverses = [np.linalg.inv(root) for root in alike.roots(X, blocks)]

    def at(self, rows: NDArray[np.bool_], blocks: list[Indices]) -> "Whitened":
        """Return some rows, whose surfaces are in these blocks."""
        return Whitened(
            self.X[rows], self.unit[rows], self.reach[rows], blocks, self.alike
        )

    def white(self, values: Values, *, back: bool = False) -> Values:
        """Whiten columns, (n, m) or (n,), or with `back` apply the transpose of that."""
        columns = values.reshape(len(values), -1)
        found = np.empty_like(columns)
        for block, inverse in zip(self._blocks, self._inverses, strict=True):
            found[block] = (inverse.transpose(0, 2, 1) if back else inverse) @ columns[
                block
            ]
        return found.reshape(values.shape)

    def evidence(self, logarithms: Values, centres: Values) -> tuple[float, Values]:
        """Return minus the logarithm of the evidence and its slopes, (d + 1,).

        They are functions of the logarithms of lengths and variance; centres are (m, d).
        """
        lengths, variance, count = (
            np.exp(logarithms[:-1]),
            np.exp(logarithms[-1]),
            len(centres),
        )
        places, about, plane = self.X / lengths, centres / lengths, _plane(self.X)
        (near, near_slope), (among, among_slope) = _near(places, about), _among(about)
        functions, unit = (
            np.hstack([near, plane]) * self.reach[:, None],
            self.white(self.unit),
        )
        seen = self.white(functions)
        matrix = seen.T @ seen
        matrix += np.eye(len(matrix)) * (1 + ROUNDING * np.trace(matrix))
        matrix[:count, :count] += among / variance - np.eye(count)
        whole, prior = cho_factor(matrix), cho_factor(among)
        found, inverse = (
            cho_solve(whole, seen.T @ unit),
            cho_solve(whole, np.eye(len(matrix))),
        )
        determinants = np.log(np.diag(whole[0])).sum() - np.log(np.diag(prior[0])).sum()
        squares = unit @ unit - found @ (seen.T @ unit)
        minus = determinants + (count * logarithms[-1] + squares) / 2
        # Slopes by the functions at the rows, and at each other's centres.
        by_seen = np.outer(unit - seen @ found, found[:count]) - seen @ inverse[:, :count]
        by_near = self.white(by_seen, back=True) * self.reach[:, None]
        moments = (
            inverse[:count, :count] + np.outer(found[:count], found[:count])
        ) / variance
        by_among = (cho_solve(prior, np.eye(count)) - moments) / 2
        slopes = np.empty(len(logarithms))
        slopes[:-1] = _by_lengths(by_near * near_slope, places, about)
        slopes[:-1] += _by_lengths(by_among * among_slope, about, about)
        slopes[-1] = (np.sum(moments * among) - count) / 2
        return float(minus), -slopes


def _larger(
    seen: Values, unit: Values, penalty: Values, half: NDArray[np.bool_]
) -> float:
    """Return how much larger errors of the mean are than the process says, `LEAST_LARGER` or more.

    Each half of the surfaces tells what the mean of the other one is worth: by the scores of
    directions in which the means may err, whose variance is 1 and the `shares` of these errors.
    """
    shares, squares = [], []
    for own in (half, ~half):
        inverse = np.linalg.inv(np.linalg.cholesky(seen[~own].T @ seen[~own] + penalty))
        mean = inverse.T @ (inverse @ (seen[~own].T @ unit[~own]))
        share, directions = eigh(inverse @ (seen[own].T @ seen[own]) @ inverse.T)
        scores = directions.T @ (inverse @ (seen[own].T @ (unit[own] - seen[own] @ mean)))
        kept = share > LEAST_SHARE
        shares.append(share[kept])
        squares.append(scores[kept] ** 2 / share[kept])

    def minus(logarithm: float) -> float:
        """Return minus the logarithm of the probability of a factor's square."""
        variance = 1 + np.exp(logarithm) * np.concatenate(shares)
        likely = np.log(variance) + np.concatenate(squares) / variance
        return float(likely.sum() + (logarithm / DOUBT) ** 2) / 2

    bounds = 2 * np.log(LEAST_LARGER), 4.0
    return float(np.exp(minimize_scalar(minus, bounds=bounds, method="bounded").x / 2))


def _likely(rows: Whitened, centres: Values) -> Values:
    """Return lengths and variance, (d + 1,), of the largest evidence, from several starts."""
    features = centres.shape[1]
    bounds = [tuple(np.log(each)) for each in [*[LENGTHS] * features, VARIANCES]]
    given: dict[str, Any] = {"jac": True, "method": "L-BFGS-B", "bounds": bounds}
    given["options"] = {"maxiter": STEPS, "ftol": 1e-6}
    starts = [np.log([*[start] * features, 1.0]) for start in STARTS]
    found = [minimize(rows.evidence, start, (centres,), **given) for start in starts]
    return np.asarray(np.exp(min(found, key=lambda each: float(each.fun)).x))


def _most_alike(X: Values, scatter: Values, blocks: list[Indices]) -> Alike:
    """Return how alike rows of a surface most likely are, by their scatter, (n,), of size 1."""

    def sized(logarithms: Values) -> tuple[float, Alike]:
        """Return minus the logarithm of the likelihood, and the size that is most likely."""
        own, length, power = logarithms
        alike = Alike(OWN + (1 - OWN) * float(expit(own)), float(np.exp(length)))
        alike = alike._replace(power=1 + float(expit(power)))
        squares = volume = 0.0
        for block, root in zip(blocks, alike.roots(X, blocks), strict=True):
            squares += np.square(np.linalg.solve(root, scatter[block][:, :, None])).sum()
            volume += np.log(np.diagonal(root, axis1=1, axis2=2)).sum()
        size = np.sqrt(max(squares / len(X), np.finfo(float).tiny))
        return len(X) * np.log(size) + volume, alike._replace(size=float(size))

    given: dict[str, Any] = {
        "method": "Nelder-Mead",
        "options": {"maxiter": 100, "xatol": 0.05},
    }

    def minus(logarithms: Values) -> float:
        return sized(logarithms)[0]

    return sized(minimize(minus, np.array([-2.0, 1.0, 0.0]), **given).x)[1]


def _blocks(surfaces: Indices) -> list[Indices]:
    """Return the rows of surfaces, (b, k) for those of k rows, by the numbers of all rows, (n,)."""
    order = np.argsort(surfaces, kind="stable")
    first = np.flatnonzero(np.diff(surfaces[order], prepend=surfaces[order[0]] - 1))
    of_size: dict[int, list[Indices]] = {}
    for own in np.split(order, first[1:]):
        for start in range(0, own.size, TOGETHER):
            block = own[start : start + TOGETHER]
            of_size.setdefault(block.size, []).append(block)
    return [np.array(each) for each in of_size.values()]


def _plane(X: Values) -> Values:
    """Return the functions of the plane, (n, 1 + d)."""
    return PLANE * np.column_stack([np.ones(len(X)), X])


def _near(places: Values, others: Values) -> tuple[Values, Values]:
    """Return the Matern function between places, (n, d) and (m, d), and its slopes: (n, m) each.

    It is that of two derivatives; slopes are by the squared distance.
    """
    squares = -2.0 * (places @ others.T)
    squares += np.einsum("ij,ij->i", places, places)[:, None]
    squares += np.einsum("ij,ij->i", others, others)
    root = np.sqrt(5.0 * np.maximum(squares, 0.0, out=squares))
    falling = np.exp(-root)
    return (1 + root + root**2 / 3) * falling, -5 / 6 * (1 + root) * falling


def _among(places: Values) -> tuple[Values, Values]:
    """Return `_near` of places among themselves, which can be inverted."""
    near, slopes = _near(places, places)
    near[np.diag_indices_from(near)] += JITTER
    return near, slopes


def _by_lengths(slopes: Values, places: Values, others: Values) -> Values:
    """Return slopes by logarithms of lengths, (d,), of those by squared distances, (n, m)."""
    squares = slopes.sum(axis=1) @ places**2 + slopes.sum(axis=0) @ others**2
    return np.asarray(
        -2 * (squares - 2 * np.einsum("jk,jk->k", slopes.T @ places, others))
    )


def _terms(X: Values, degree: int) -> Values:
    """Return the terms of a polynomial, (n, k)."""
    return np.asarray(PolynomialFeatures(degree).fit_transform(X))


def _polynomial(
    X: Values, target: Values, weights: Values, degree: int, most: float
) -> Values:
    """Return a polynomial's coefficients by weighted least squares, with 0 for terms too many.

    With more than `most` terms the polynomial is of a lower degree, whose terms are the first ones.
    """
    found = np.zeros((terms := _terms(X, degree)).shape[1])
    while degree > 1 and comb(X.shape[1] + degree, degree) > most:
        degree -= 1
    used = slice(comb(X.shape[1] + degree, degree))
    weighted = terms[:, used] * weights[:, None]
    matrix = weighted.T @ terms[:, used]
    matrix[np.diag_indices_from(matrix)] += RIDGE * weights.sum()
    found[used] = solve(matrix, weighted.T @ target, assume_a="pos")
    return found


def _floored_logarithm(values: Values) -> Values:
    """Return logarithms of values of 0 and more, each of them a part of the median at least."""
    least = max(FLOOR * float(np.median(values)), np.finfo(float).tiny)
    return np.asarray(np.log(np.maximum(values, least)))
