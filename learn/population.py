"""The mean of a result over all surfaces of some parameters, and how uncertain this mean is.

Surfaces of the same parameters differ: a result is a function of parameters and load plus the
scatter between surfaces, which is large, depends on parameters and load, and is the same number for
all loads of a surface, more or less. The mean is a Gaussian process:

- A target above 0 is divided by a power law of its inputs, which are logarithms as a rule. What is
  left varies little, and its scatter hardly at all.
- The size of the scatter is the exponential of a quadratic in the inputs, by the distances from a
  cubic. Rows have the weight of its inverse square. Where surfaces scatter little, the mean follows
  the power law closer too: the deviation of the process is in proportion to the root of the scatter
  (to the scatter itself, or the same everywhere, errors or their estimates are worse).
- A radial basis function has a length for each input. Likely ones are found on one row of each
  surface: the scatter of several rows of one is correlated, and would pass for short waves of the
  mean. Those count with which all rows are predicted best, by the others' surfaces.
- All rows count, but the mean is a sum of functions about a few hundred of them (the subset of
  regressors: J. Quinonero-Candela, C. E. Rasmussen (2005), J. Mach. Learn. Res. 6, 1939). Fit and
  answers take time in proportion to the rows.
- Parts of the surfaces are left out in turn, which takes no further fits of the lengths. Errors on
  them calibrate intervals of new surfaces.
- The variance of the mean is the sum of two: that of the means without a part (the delete-a-group
  jackknife: P. S. Kott (2001), J. Off. Stat. 17, 521), which knows that rows of a surface are alike
  but not what no row shows, and that of the process, which knows the latter only. Either alone is
  too small; on some hundred surfaces their sum may be too, where short waves are lost in scatter.
"""

import warnings
from collections.abc import Iterator
from itertools import product
from math import comb
from typing import Any

import numpy as np
from scipy.linalg import cholesky, eigh, solve, solve_triangular
from scipy.stats import t
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel
from sklearn.preprocessing import PolynomialFeatures

from gen.arrays import Indices, Values

CENTRES = 500
"""Rows at most that functions of the mean are about."""

LIKELIHOOD_ROWS = 800
"""Rows of as many surfaces for the likelihood, at most."""

LENGTHS = (0.1, 3.0)
"""Shortest and longest length, over the deviation of an input. Longer ones, of inputs whose effect
looks like a power law on a few hundred rows, are too stiff for thousands."""

STARTS = (1.0, 2.5)
"""Lengths from which the search for the most likely ones starts."""

PARTS = 20
"""Parts of the surfaces that are left out in turn."""

PASSES = 3
"""Fits of power law and scatter, each with the weights of the last."""

LEAST = 1e-4
"""Least size of the scatter, over the deviation of the target over its power law."""

KEPT = 0.99
"""Share of the process's variance at the rows that is kept, in far fewer numbers than all of it."""

RIDGE = 1e-6
"""Penalty of polynomials' coefficients, over the weight of all rows."""

JITTER = 1e-11
"""Added to the equations' diagonal, over its mean: neighbouring functions are nearly the same."""

FLOOR = 1e-3
"""Least size of a residual or a target before its logarithm is taken, over their median."""

ROWS_PER_TERM = 10
"""Rows for each term of a polynomial, at least; polynomials of lower degree have fewer terms."""


class Population(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Mean of a target over surfaces, of standardised inputs; a regressor of scikit-learn.

    Parameters
    ----------
    centres : int
        Rows at most that functions of the mean are about.
    random_state : int
        Seed of the draws of centres and parts.
    """

    def __init__(self, centres: int = CENTRES, random_state: int = 0) -> None:
        self.centres = centres
        self.random_state = random_state

    def fit(self, X: Values, y: Values, surfaces: Indices | None = None) -> "Population":
        """Fit to inputs, (n, d), and a target, (n,); rows of a surface share its number, (n,).

        Without numbers each row is of a surface of its own.
        """
        random = np.random.default_rng(self.random_state)
        surfaces = np.arange(len(y)) if surfaces is None else surfaces
        weights = np.ones(len(y))
        self.trend_ = np.zeros(X.shape[1] + 1)
        for _ in range(PASSES):
            if y.min() > 0:
                self.trend_ = _polynomial(X, _floored_logarithm(y), weights, 1)
            ratio = y / self._trend(X)
            self._fit_scatter(X, ratio, weights)
            weights = self._scatter(X) ** -2
        self.mean_ = float(np.average(ratio, weights=np.sqrt(weights)))
        self.deviation_ = 1.0
        self.deviation_ = float(np.std((ratio - self.mean_) / self._reach(X))) or 1.0
        reach = self._reach(X)
        unit, noise = (ratio - self.mean_) / reach, (self._scatter(X) / reach) ** 2
        rows = _one_each(surfaces, random)
        centres = X[random.permutation(len(y))[: self.centres]]
        parts = dealt(surfaces, random)

        def error(kernel: Any) -> float:
            """Solve with a kernel, and return the error of rows that are left out."""
            return self._solve(X, unit, 1 / noise, (kernel, centres, parts))

        error(min(_likely(X, unit, noise, rows), key=error))
        return self

    def _fit_scatter(self, X: Values, ratio: Values, weights: Values) -> None:
        """Fit the size of the scatter by the distances of the ratio to the power law from a cubic.

        It is the root mean square, and neither below nor above what nearly all rows have.
        """
        wrong = np.abs(ratio - _terms(X, 3) @ _polynomial(X, ratio, weights, 3))
        self.sizes_ = _polynomial(X, _floored_logarithm(wrong), np.ones(len(X)), 2)
        logarithm = _terms(X, 2) @ self.sizes_
        self.ends_ = np.quantile(logarithm, (0.01, 0.99))
        size = np.exp(np.clip(logarithm, *self.ends_))
        larger = np.log(np.sqrt(np.mean((wrong / size) ** 2)))
        self.sizes_[0] += larger
        least = np.log(LEAST * ratio.std())
        self.ends_ = np.maximum(self.ends_ + larger, least)

    def _solve(
        self, X: Values, unit: Values, weights: Values, given: tuple[Any, Values, Indices]
    ) -> float:
        """Solve for the coefficients with all rows, and without each part of them.

        `given` are the kernel, the centres of the functions and the parts. The mean square error of
        rows that are left out is returned, in units of their scatter.
        """
        kernel, centres, parts = given
        self.lengths_ = np.full(X.shape[1], kernel.k2.length_scale)
        self.places_ = centres / self.lengths_
        functions = self._functions(X)
        weighted = functions * weights[:, None]
        matrix, right = weighted.T @ functions, weighted.T @ unit
        penalty = _near(self.places_, self.places_) / kernel.k1.constant_value
        penalty[np.diag_indices_from(penalty)] += JITTER * np.trace(matrix) / len(matrix)
        found, left_out = [solve(matrix + penalty, right, assume_a="pos")], np.empty(len(X))
        for part in np.unique(parts):
            own = parts == part
            less = matrix - weighted[own].T @ functions[own] + penalty
            found.append(solve(less, right - weighted[own].T @ unit[own], assume_a="pos"))
            left_out[own] = functions[own] @ found[-1]
        self.coefficients_ = np.column_stack(found)
        inverse = solve_triangular(cholesky(matrix + penalty), np.eye(len(matrix)))
        shares, directions = eigh(inverse.T @ matrix @ inverse)
        kept = np.cumsum(shares) > (1 - KEPT) * shares.sum()
        self.spread_ = inverse @ directions[:, kept]
        self.left_out_ = self._restored(X, left_out)
        return float(np.mean((unit - left_out) ** 2 * weights))

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
        """Return the functions about the centres, (n, m)."""
        return _near(X / self.lengths_, self.places_)

    def predict(self, X: Values) -> Values:
        """Return the mean, (n,), at standardised inputs, (n, d)."""
        return self._restored(X, self._functions(X) @ self.coefficients_[:, 0])

    def error(self, X: Values) -> Values:
        """Return the standard error of the mean, (n,)."""
        functions = self._functions(X)
        found = functions @ self.coefficients_[:, 1:]
        parts = found.var(axis=1) * (found.shape[1] - 1)
        process = np.square(functions @ self.spread_).sum(axis=1)
        return np.asarray(np.sqrt(parts + process) * self._reach(X) * self._trend(X))

    def quantile(self, level: float) -> float:
        """Return the standard errors on both sides of the mean within which it lies, by level."""
        return float(t.ppf((1 + level) / 2, self.coefficients_.shape[1] - 2))


def _likely(X: Values, unit: Values, noise: Values, rows: Indices) -> Iterator[Any]:
    """Yield the kernels of the largest likelihood on some rows, from several starts.

    The scatter makes the likelihood flat, and what is most likely on few rows may miss what all of
    them show.
    """
    features = X.shape[1]
    subsets = [rows[:LIKELIHOOD_ROWS]] + [rows[-LIKELIHOOD_ROWS:]] * (rows.size > LIKELIHOOD_ROWS)
    starts = [1.0, *(np.full(features, start) for start in STARTS)]
    for few, start in product(subsets, starts):
        kernel = ConstantKernel(1.0, (1e-3, 1e5)) * RBF(start, LENGTHS)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # lengths at their bounds
            process = GaussianProcessRegressor(kernel, alpha=noise[few])
            yield process.fit(X[few], unit[few]).kernel_


def dealt(surfaces: Indices, random: np.random.Generator) -> Indices:
    """Deal surfaces, by the numbers of their rows, (n,), into parts of about the same size."""
    _, place = np.unique(surfaces, return_inverse=True)
    return np.asarray(random.permutation(place.max() + 1)[place] % PARTS)


def _one_each(surfaces: Indices, random: np.random.Generator) -> Indices:
    """Draw one row of each surface, in random order."""
    order = random.permutation(surfaces.size)
    _, first = np.unique(surfaces[order], return_index=True)
    return np.asarray(order[random.permutation(first)])


def _near(places: Values, others: Values) -> Values:
    """Return the radial basis function of distances between places, (n, d) and (m, d): (n, m)."""
    squares = -2.0 * (places @ others.T)
    squares += np.einsum("ij,ij->i", places, places)[:, None]
    squares += np.einsum("ij,ij->i", others, others)
    squares *= -0.5
    return np.asarray(np.exp(np.minimum(squares, 0.0, out=squares), out=squares))


def _terms(X: Values, degree: int) -> Values:
    """Return the terms of a polynomial, (n, k)."""
    return np.asarray(PolynomialFeatures(degree).fit_transform(X))


def _polynomial(X: Values, target: Values, weights: Values, degree: int) -> Values:
    """Return a polynomial's coefficients by weighted least squares, with 0 for terms too many.

    With few rows for each term the polynomial is of a lower degree, whose terms are the first ones.
    """
    terms = _terms(X, degree)
    found, most = np.zeros(terms.shape[1]), len(X) / ROWS_PER_TERM
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
