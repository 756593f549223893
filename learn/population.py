"""The mean of a result over all surfaces of some parameters, and how uncertain this mean is.

Surfaces of the same parameters differ: a result is a function of parameters and load plus the
scatter between surfaces, which is large, depends on parameters and load, and is the same number for
all loads of a surface, more or less. The mean is a Gaussian process:

- A target above 0 is divided by a power law of its inputs, which are logarithms as a rule. What is
  left varies little, and its scatter hardly at all.
- The size of the scatter is the exponential of a quadratic in the inputs, by the distances from a
  cubic. Rows have the weight of its inverse square.
- A radial basis function has a length for each input, that of the largest likelihood on one row of
  each surface: the scatter of several rows of one is correlated, and would pass for short waves of
  the mean.
- All rows count, but the mean is a sum of functions about a few hundred of them (the subset of
  regressors: J. Quinonero-Candela, C. E. Rasmussen (2005), J. Mach. Learn. Res. 6, 1939). Fit and
  answers take time in proportion to the rows.
- Parts of the surfaces are left out in turn, which takes no further fits of the lengths. Errors on
  them calibrate intervals of new surfaces, and the differences between the means without a part are
  the uncertainty of the mean (the delete-a-group jackknife: P. S. Kott (2001), J. Off. Stat. 17,
  521).
"""

import warnings
from math import comb

import numpy as np
from scipy.linalg import solve
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
        ones = np.ones(len(y))
        self.trend_ = np.zeros(X.shape[1] + 1)
        if y.min() > 0:
            self.trend_ = _polynomial(X, _floored_logarithm(y), ones, 1)
        ratio = y / self._trend(X)
        self.mean_, self.deviation_ = float(ratio.mean()), float(ratio.std()) or 1.0
        unit = (ratio - self.mean_) / self.deviation_
        scatter = _scatter(X, unit)
        amplitude = self._choose_lengths(X, unit, scatter, _one_each(surfaces, random))
        chosen = random.permutation(len(y))[: self.centres]
        self.places_ = X[chosen] / self.lengths_
        self._solve(X, unit, scatter**-2, amplitude, dealt(surfaces, random))
        return self

    def _choose_lengths(self, X: Values, unit: Values, scatter: Values, rows: Indices) -> float:
        """Find the most likely lengths on some rows; return the variance of the mean."""
        few = rows[:LIKELIHOOD_ROWS]
        fits = []
        for start in STARTS:
            kernel = ConstantKernel(1.0, (0.1, 1e5))
            kernel *= RBF(np.full(X.shape[1], start), LENGTHS)
            process = GaussianProcessRegressor(kernel, alpha=scatter[few] ** 2)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)  # lengths at their bounds
                fits.append(process.fit(X[few], unit[few]))
        best = max(fits, key=lambda each: float(each.log_marginal_likelihood_value_)).kernel_
        self.lengths_ = np.atleast_1d(best.k2.length_scale)
        return float(best.k1.constant_value)

    def _solve(
        self, X: Values, unit: Values, weights: Values, amplitude: float, parts: Indices
    ) -> None:
        """Solve for the coefficients with all rows, and without each part of them."""
        functions = self._functions(X)
        weighted = functions * weights[:, None]
        matrix, right = weighted.T @ functions, weighted.T @ unit
        penalty = _near(self.places_, self.places_) / amplitude
        penalty[np.diag_indices_from(penalty)] += JITTER * np.trace(matrix) / len(matrix)
        found, self.left_out_ = [solve(matrix + penalty, right, assume_a="pos")], np.empty(len(X))
        for part in np.unique(parts):
            own = parts == part
            less = matrix - weighted[own].T @ functions[own] + penalty
            found.append(solve(less, right - weighted[own].T @ unit[own], assume_a="pos"))
            values = self.mean_ + self.deviation_ * (functions[own] @ found[-1])
            self.left_out_[own] = values * self._trend(X[own])
        self.coefficients_ = np.column_stack(found)

    def _trend(self, X: Values) -> Values:
        """Return the power law, (n,); 1 for a target that is not above 0."""
        return np.asarray(np.exp(X @ self.trend_[1:] + self.trend_[0]))

    def _functions(self, X: Values) -> Values:
        """Return the functions about the centres, (n, m)."""
        return _near(X / self.lengths_, self.places_)

    def predict(self, X: Values) -> Values:
        """Return the mean, (n,), at standardised inputs, (n, d)."""
        found = self._functions(X) @ self.coefficients_[:, 0]
        return np.asarray((self.mean_ + self.deviation_ * found) * self._trend(X))

    def error(self, X: Values) -> Values:
        """Return the standard error of the mean, (n,), by the means without a part of the rows."""
        found = self._functions(X) @ self.coefficients_[:, 1:]
        parts = found.shape[1]
        error = found.std(axis=1) * np.sqrt(parts - 1)
        return np.asarray(error * self.deviation_ * self._trend(X))

    def quantile(self, level: float) -> float:
        """Return the standard errors on both sides of the mean within which it lies, by level."""
        return float(t.ppf((1 + level) / 2, self.coefficients_.shape[1] - 2))


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


def _polynomial(X: Values, target: Values, weights: Values, degree: int) -> Values:
    """Return the coefficients of a polynomial by weighted least squares."""
    terms = PolynomialFeatures(degree).fit_transform(X)
    weighted = terms * weights[:, None]
    matrix = weighted.T @ terms
    matrix[np.diag_indices_from(matrix)] += RIDGE * weights.sum()
    return np.asarray(solve(matrix, weighted.T @ target, assume_a="pos"))


def _fitted(X: Values, target: Values, weights: Values, degree: int) -> Values:
    """Return the values, (n,), of a polynomial of a degree, or of a lower one for few rows."""
    most = len(X) / ROWS_PER_TERM
    while degree > 1 and comb(X.shape[1] + degree, degree) > most:
        degree -= 1
    found = _polynomial(X, target, weights, degree)
    return np.asarray(PolynomialFeatures(degree).fit_transform(X) @ found)


def _floored_logarithm(values: Values) -> Values:
    """Return logarithms of values of 0 and more, each of them a part of the median at least."""
    least = max(FLOOR * float(np.median(values)), np.finfo(float).tiny)
    return np.asarray(np.log(np.maximum(values, least)))


def _scatter(X: Values, unit: Values) -> Values:
    """Return the size of the scatter of each row, (n,): its root mean square."""
    weights = np.ones(len(unit))
    for _ in range(2):
        wrong = np.abs(unit - _fitted(X, unit, weights, 3))
        logarithm = _fitted(X, _floored_logarithm(wrong), np.ones(len(unit)), 2)
        size = np.exp(np.clip(logarithm, *np.quantile(logarithm, (0.01, 0.99))))
        size *= np.sqrt(np.mean((wrong / size) ** 2))
        weights = size**-2
    return np.asarray(size)
