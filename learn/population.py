"""The mean of a result over all surfaces of given parameters, and the error of this mean.

Surfaces of the same parameters differ. A result is therefore a function of parameters and load plus
a scatter between surfaces, which is large and depends on parameters and load. A surface whose
result is large at one load has large results at other loads, too. Four rows of one surface say
little more about the mean than one row does, but much about how the result changes with the load.
The mean is a Gaussian process, fitted in these steps:

- Power law. A target above 0 is divided by a power law of its inputs, which usually are logarithms.
  This ratio and its scatter vary much less than the target.
- Size of the scatter. It is the exponential of a quadratic polynomial of the inputs, fitted to the
  distances of the ratio from a cubic polynomial. The standard deviation of the process is
  proportional to the square root of the scatter. (With a deviation proportional to the scatter
  itself, or a constant one, the errors or their estimates are worse.)
- Correlation of the scatter of two rows of one surface. It is the exponential of minus a power of
  the distance of their inputs; a share of the scatter is independent for each row. The correlation
  with the largest likelihood is taken. Rows are whitened by it, as in generalised least squares.
- Process. It is a plane plus a Matern function with one length for each input. Lengths and
  variance maximise the evidence (marginal likelihood) of some thousand rows.
- Coefficients. They are fitted to all rows, but the mean is a sum of functions about only a few
  hundred of them (the subset of regressors: J. Quinonero-Candela, C. E. Rasmussen (2005), J. Mach.
  Learn. Res. 6, 1939).
- Errors. Parts of the surfaces are left out in turn, without new fits of the lengths. The errors at
  these parts calibrate intervals of new surfaces. The error of the mean is that of the process,
  times a factor: fits to the two halves of the surfaces tell how much the process underestimates
  it.

Inputs `X`, shape (n, d), are standardised throughout: mean 0 and deviation 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, eigh, solve, solve_triangular
from scipy.optimize import minimize, minimize_scalar
from scipy.special import expit
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.preprocessing import PolynomialFeatures

from gen.arrays import Indices, Values
from learn.split import dealt

# Largest number of centres: rows about which the Matern functions of the mean are placed.
CENTRES = 500
# Largest number of centres in the search for lengths and variance, which is repeated often.
LIKELY_CENTRES = 200
# Largest number of rows in the search for lengths and variance.
LIKELY_ROWS = 3000
# Smallest and largest length of the Matern function, over the deviation of an input.
LENGTHS = (0.1, 10.0)
# Lengths at which the searches for lengths and variance start, one search for each.
STARTS = (1.0, 2.5)
# Largest number of steps of each of these searches.
STEPS = 50
# Smallest and largest variance of the process, over the square of `Population._process_deviation`.
VARIANCES = (1e-3, 1e5)
# Prior deviation of the coefficients of the plane, over `Population._process_deviation`.
PLANE = 10.0
# Number of parts of the surfaces that are left out in turn.
PARTS = 20
# Largest number of rows of a surface whose scatter is treated as correlated. Further rows of the
# surface are treated as rows of another surface, which keeps the matrices small.
TOGETHER = 200
# Smallest share of the scatter that is independent for each row. It keeps correlations invertible
# where rows repeat earlier ones.
SMALLEST_SEPARATE = 1e-4
# The three settings of the correlation at which the search for them starts. They are
# described in `_with_likeliest_size`.
FIRST_CORRELATION = (
    -2.0,  # logit of the independent share, which is 12 %
    1.0,  # logarithm of the length, which is 2.7 deviations of an input
    0.0,  # logit of the power less 1: the power is 1.5
)
# Number of fits of power law and scatter; each takes the weights of the fit before.
PASSES = 3
# Smallest size of the scatter, over the standard deviation of the ratio (target over power law).
SMALLEST_SCATTER = 1e-4
# Quantiles of the fitted scatter to which its sizes are limited, because the quadratic polynomial
# is not reliable at the ends of the inputs.
SCATTER_QUANTILES = (0.01, 0.99)
# Share of the variance of the process at the rows that the stored errors of coefficients keep.
KEPT = 0.99
# Prior deviation of the logarithm of the squared factor by which errors of means exceed the
# errors of the process.
DOUBT = 0.5
# Smallest factor of the errors of means over those of the process. It is above 1 because the
# process treats its lengths as known.
SMALLEST_FACTOR = 1.15
# Largest logarithm of the square of the factor, at which the search for the factor ends.
LARGEST_LOGARITHM = 4.0
# Smallest of the `shares` of `DirectionScores`. Directions with a smaller share do not enter the
# estimate of the factor.
SMALLEST_SHARE = 1e-3
# Penalty on the coefficients of polynomials, over the sum of the weights of all rows.
RIDGE = 1e-6
# Added to the diagonal of the Matern matrix among centres, which close centres make singular.
JITTER = 1e-6
# Added to the diagonal of the equations against rounding, over the sum of their diagonal.
ROUNDING = 1e-14
# Smallest value of which a logarithm is taken, over the median of all values.
FLOOR = 1e-3
# Number of surfaces that each term of a polynomial needs. With fewer surfaces the polynomial is of
# a lower degree.
SURFACES_PER_TERM = 10


class Kernel(NamedTuple):
    """The Matern function between n places and m centres, with its slopes."""

    values: Values  # (n, m)
    slopes: Values  # (n, m), derivatives with respect to the squared distance


class TrendDistances(NamedTuple):
    """Distances of the ratio (target over power law) of n rows from two fits."""

    from_mean: Values  # (n,), from the mean of the ratio
    from_cubic: Values  # (n,), from a cubic polynomial of the inputs


class Population(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Mean of a target over surfaces, of standardised inputs; a regressor of scikit-learn.

    Parameters
    ----------
    random_state : int
        Seed of the draws of centres and parts.
    """

    # Attributes that `fit` sets. Surrogates store them by these names.
    # (1 + d,), logarithm of the power law: its constant, and its slopes by the inputs
    trend_: Values
    # (k,), coefficients of the quadratic polynomial that is the logarithm of the scatter
    sizes_: Values
    ends_: Values  # (2,), smallest and largest logarithm of the scatter
    mean_: float  # mean of the ratio (target over power law)
    deviation_: float  # deviation of the process over the square root of the scatter
    lengths_: Values  # (d,), lengths of the Matern function, one for each input
    places_: Values  # (m, d), centres over the lengths
    coefficients_: Values  # (m + 1 + d,), coefficients of the functions of `_functions`
    # (n,), prediction of each row by the equations without the row's part, in the target's unit
    left_out_: Values
    spread_: Values  # (m + 1 + d, q), independent errors of the coefficients

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, X: Values, y: Values, surfaces: Indices | None = None) -> "Population":
        """Fit the mean and its error to rows.

        Parameters
        ----------
        X : ndarray, shape (n, d)
            Standardised inputs.
        y : ndarray, shape (n,)
            Target.
        surfaces : ndarray, shape (n,), optional
            Number of the surface of each row. If left out, each row is of another surface.

        Returns
        -------
        Population
            This regressor, with the attributes that are declared in its class.
        """
        random = np.random.default_rng(self.random_state)
        if surfaces is None:
            surfaces = np.arange(len(y))
        distances = self._fit_trend(X, y, surfaces)
        blocks = _blocks(surfaces)
        fitted_size = self._scatter(X)
        correlation = _most_likely_correlation(
            X, distances.from_cubic / fitted_size, blocks
        )
        size = correlation.size * fitted_size
        rows = Whitened(
            X=X,
            targets=distances.from_mean / size,
            process=self._process_deviation(X) / size,
            blocks=blocks,
            correlation=correlation,
        )
        # Results depend on the order of the draws: centres, a sample of the rows, parts.
        centres = X[random.permutation(len(y))[:CENTRES]]
        # True for `LIKELY_ROWS` rows drawn at random, or for all rows if there are fewer.
        sample = random.permutation(len(y)) < LIKELY_ROWS
        sampled_rows = rows.where(sample, _blocks(surfaces[sample]))
        likely = _most_likely_scales(sampled_rows, centres[:LIKELY_CENTRES])
        parts = dealt(surfaces, PARTS, random)
        self._solve(rows, centres, likely, parts)
        return self

    def _fit_trend(self, X: Values, y: Values, surfaces: Indices) -> TrendDistances:
        """Fit the power law, the scatter, and mean and deviation of the ratio; return distances.

        Takes inputs, (n, d), targets, (n,), and the number of the surface of each row, (n,). The
        ratio is the target over its power law. If a target is 0 or less, the power law is 1. The
        distances are those of the ratio from its mean and from its cubic polynomial. Sets
        `trend_`, `sizes_`, `ends_`, `mean_` and `deviation_`.
        """
        weights = np.ones(len(y))
        most_terms = np.unique(surfaces).size / SURFACES_PER_TERM
        self.trend_ = np.zeros(X.shape[1] + 1)  # the power law 1
        all_positive = y.min() > 0
        for _ in range(PASSES):
            if all_positive:
                logarithms = _floored_logarithm(y)
                self.trend_ = _polynomial(
                    X, logarithms, weights, degree=1, most_terms=most_terms
                )
            ratio = y / self._trend(X)
            from_cubic = self._fit_scatter(X, ratio, weights, most_terms)
            # The next fits weigh each row by the inverse variance of its scatter.
            weights = self._scatter(X) ** -2
        # The mean weighs each row by the inverse variance of the process, which is in proportion to
        # the scatter.
        self.mean_ = float(np.average(ratio, weights=np.sqrt(weights)))
        from_mean = ratio - self.mean_
        # With `deviation_` 1, `_process_deviation` returns the square root of the scatter.
        self.deviation_ = 1.0
        in_roots_of_scatter = from_mean / self._process_deviation(X)
        # The deviation is a divisor. It is 0 for a constant ratio, and 1 takes its place.
        self.deviation_ = float(np.std(in_roots_of_scatter)) or 1.0
        return TrendDistances(from_mean=from_mean, from_cubic=from_cubic)

    def _fit_scatter(
        self, X: Values, ratio: Values, weights: Values, most_terms: float
    ) -> Values:
        """Fit the size of the scatter; return the distances of the ratio from a cubic, (n,).

        Takes inputs, (n, d), the ratio and the weights of rows, (n,) each, and the largest number
        of terms of a polynomial. Sets `sizes_` and `ends_`. The size is the exponential of a
        quadratic polynomial fitted to the logarithms of the distances, limited to its
        `SCATTER_QUANTILES` over the rows. It is then multiplied by a number with which the root
        mean square of the distances over the size is 1.
        """
        cubic = _polynomial(X, ratio, weights, degree=3, most_terms=most_terms)
        distances = ratio - _terms(X, degree=3) @ cubic
        magnitudes = np.abs(distances)
        log_magnitudes = _floored_logarithm(magnitudes)
        equal_weights = np.ones(len(X))
        self.sizes_ = _polynomial(
            X, log_magnitudes, equal_weights, degree=2, most_terms=most_terms
        )
        log_sizes = _terms(X, degree=2) @ self.sizes_
        log_low, log_high = np.quantile(log_sizes, SCATTER_QUANTILES)
        # A mean of logarithms is below the logarithm of the root mean square: raise the sizes.
        sizes = np.exp(np.clip(log_sizes, log_low, log_high))
        root_mean_square = np.sqrt(np.mean((magnitudes / sizes) ** 2))
        shift = np.log(root_mean_square)
        self.sizes_[0] += shift  # the constant of the quadratic polynomial
        log_smallest = np.log(SMALLEST_SCATTER * ratio.std())
        self.ends_ = np.maximum([log_low + shift, log_high + shift], log_smallest)
        return np.asarray(distances)

    def _solve(
        self, rows: "Whitened", centres: Values, likely: "LikelyScales", parts: Indices
    ) -> None:
        """Solve for the coefficients with all rows, and predict each part of them without it.

        Takes n whitened rows, m centres, (m, d), and the number of the part of each row, (n,). Sets
        `lengths_`, `places_`, `coefficients_`, `left_out_` and `spread_`.
        """
        self.lengths_ = likely.lengths
        self.places_ = centres / self.lengths_
        functions = self._functions(rows.X)
        whitened = rows.white(functions * rows.process[:, None])
        targets = rows.white(rows.targets)
        matrix = whitened.T @ whitened
        count = len(centres)
        # The penalty is the inverse of the prior covariance of the coefficients. It is 1 for those
        # of the plane, whose functions `PLANE` scales. For those of the Matern functions it is the
        # Matern matrix over the variance, which replaces the 1 of their diagonal.
        penalty = np.eye(len(matrix)) * (1 + ROUNDING * np.trace(matrix))
        inverse_covariance = _matern_among(self.places_).values / likely.variance
        penalty[:count, :count] += inverse_covariance - np.eye(count)
        equations = Equations(
            whitened=whitened,
            targets=targets,
            matrix=matrix,
            right=whitened.T @ targets,
            penalty=penalty,
        )
        self.coefficients_ = solve(matrix + penalty, equations.right, assume_a="pos")
        self.left_out_ = self._restored(rows.X, equations.left_out(functions, parts))
        first_half = parts < PARTS // 2
        factor = _error_factor(equations, first_half)
        self.spread_ = equations.spread(functions, factor)

    def _restored(self, X: Values, means: Values) -> Values:
        """Turn means of the process over its deviation, (n,), into means of the target, (n,)."""
        ratio = self.mean_ + self._process_deviation(X) * means
        return np.asarray(ratio * self._trend(X))

    def _process_deviation(self, X: Values) -> Values:
        """Return the deviation of the process, as a deviation of the ratio, (n,).

        It is `deviation_` times the square root of the scatter at inputs, (n, d).
        """
        return np.asarray(self.deviation_ * np.sqrt(self._scatter(X)))

    def _scatter(self, X: Values) -> Values:
        """Return the fitted size of the scatter of the ratio at inputs, (n, d), as (n,)."""
        logarithm = _terms(X, degree=2) @ self.sizes_
        low, high = self.ends_
        return np.asarray(np.exp(np.clip(logarithm, low, high)))

    def _trend(self, X: Values) -> Values:
        """Return the power law at inputs, (n, d), in the unit of the target, (n,).

        It is 1 if a target of the training is 0 or less.
        """
        exponents = self.trend_[1:]
        logarithm = X @ exponents + self.trend_[0]
        return np.asarray(np.exp(logarithm))

    def _functions(self, X: Values) -> Values:
        """Return the functions of which the mean is a sum, at inputs, (n, d), as (n, m + 1 + d).

        They are the m Matern functions, then the 1 + d functions of the plane.
        """
        kernel = _matern(X / self.lengths_, self.places_)
        return np.hstack([kernel.values, _plane(X)])

    def predict(self, X: Values) -> Values:
        """Predict the mean over surfaces.

        Parameters
        ----------
        X : ndarray, shape (n, d)
            Standardised inputs.

        Returns
        -------
        ndarray, shape (n,)
            Means in the unit of the target.
        """
        return self._restored(X, self._functions(X) @ self.coefficients_)

    def error(self, X: Values) -> Values:
        """Return the standard error of the mean.

        Parameters
        ----------
        X : ndarray, shape (n, d)
            Standardised inputs.

        Returns
        -------
        ndarray, shape (n,)
            Standard errors in the unit of the target.
        """
        errors = self._functions(X) @ self.spread_
        deviation = np.sqrt(np.square(errors).sum(axis=1))
        return np.asarray(deviation * self._process_deviation(X) * self._trend(X))

    def drawn_errors(self, X: Values, number: int) -> Values:
        """Draw errors of the mean from the fitted process, each a function of the inputs.

        Each call draws equal functions, because the seed is `random_state`.

        Parameters
        ----------
        X : ndarray, shape (n, d)
            Standardised inputs.
        number : int
            Number of functions.

        Returns
        -------
        ndarray, shape (n, number)
            Errors in the unit of the target, one drawn function a column.
        """
        random = np.random.default_rng(self.random_state)
        normal = random.standard_normal((self.spread_.shape[1], number))
        functions = self._functions(X) @ (self.spread_ @ normal)
        errors = functions.T * self._process_deviation(X) * self._trend(X)
        return np.asarray(errors).T


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations of k coefficients, from n whitened rows."""

    whitened: Values  # (n, k), whitened functions at the rows
    targets: Values  # (n,), whitened targets
    matrix: Values  # (k, k), whitened.T @ whitened
    right: Values  # (k,), whitened.T @ targets
    penalty: Values  # (k, k), inverse of the prior covariance, added to the matrix

    def left_out(self, functions: Values, parts: Indices) -> Values:
        """Predict each part of the rows from the equations without its rows.

        Parameters
        ----------
        functions : ndarray, shape (n, k)
            Functions at the rows, not whitened.
        parts : ndarray, shape (n,)
            Number of the part of each row.

        Returns
        -------
        ndarray, shape (n,)
            Means over the deviation of the process.
        """
        means = np.empty(len(self.targets))
        for part in np.unique(parts):
            inside = parts == part
            rows = self.whitened[inside]
            # For `rows.T @ rows` numpy would call a routine that rounds differently; a second copy
            # of the rows keeps the results of earlier versions.
            matrix = self.matrix - rows.T @ self.whitened[inside] + self.penalty
            right = self.right - rows.T @ self.targets[inside]
            means[inside] = functions[inside] @ solve(matrix, right, assume_a="pos")
        return means

    def spread(self, functions: Values, factor: float) -> Values:
        """Return independent errors of the coefficients, with the largest in the last column.

        Parameters
        ----------
        functions : ndarray, shape (n, k)
            Functions at the rows, not whitened.
        factor : float
            Factor of the errors over those of the process.

        Returns
        -------
        ndarray, shape (k, q)
            Errors, one a column, in ascending order of their variance at the rows. They are the q
            largest ones, which have at least the share `KEPT` of the variance of all k.
        """
        root = np.linalg.cholesky(self.matrix + self.penalty)
        inverse = solve_triangular(root.T, np.eye(len(self.matrix)))
        products = functions.T @ functions
        # `eigh` sorts the variances in ascending order.
        variances, directions = eigh(inverse.T @ products @ inverse)
        negligible = (1 - KEPT) * variances.sum()
        kept = np.cumsum(variances) > negligible
        return np.asarray(factor * inverse @ directions[:, kept])


class ScatterCorrelation(NamedTuple):
    """The correlation of the scatter of two rows of one surface, and the size of the scatter."""

    separate: float  # share of the scatter that is independent for each row
    length: float  # distance of inputs at which the correlation falls to 1 / e
    power: float = 1.0  # power p of the distance in exp(-(distance / length)^p)
    size: float = 1.0  # most likely size of the scatter, over its fitted size

    def roots(self, X: Values, blocks: Sequence[Indices]) -> list[Values]:
        """Return the Cholesky factor of the matrix of correlations of the rows of each surface.

        Parameters
        ----------
        X : ndarray, shape (n, d)
            Standardised inputs.
        blocks : sequence of ndarray, shape (b, k)
            Positions of the rows of b surfaces of k rows each.

        Returns
        -------
        list of ndarray, shape (b, k, k)
            Lower triangular factors of the b surfaces of each block.
        """
        roots = []
        for block in blocks:
            rows = X[block]
            differences = rows[:, :, None, :] - rows[:, None, :, :]
            distances = np.sqrt(np.square(differences).sum(axis=-1))
            common = np.exp(-((distances / self.length) ** self.power))
            independent = self.separate * np.eye(block.shape[1])
            correlations = (1 - self.separate) * common + independent
            roots.append(np.asarray(np.linalg.cholesky(correlations)))
        return roots


class MinusLogEvidence(NamedTuple):
    """Minus the logarithm of the evidence with its slopes, in the order that a minimiser takes."""

    value: float  # minus the logarithm of the evidence, up to a constant
    # (d + 1,), slopes of `value` by the logarithms of the d lengths and of the variance
    slopes: Values


@dataclass(frozen=True, eq=False)
class EvidenceTerms:
    """The numbers from which the evidence of lengths and a variance, and its slopes, follow."""

    log_variance: float  # logarithm of `variance`
    # variance of the process, over the square of `Population._process_deviation`
    variance: float
    places: Values  # (n, d), inputs of the rows over the lengths
    about: Values  # (m, d), centres over the lengths
    near: Kernel  # Matern function between rows and centres, (n, m)
    among: Kernel  # Matern function among the centres, (m, m)
    whitened: Values  # (n, m + 1 + d), whitened functions at the rows
    targets: Values  # (n,), whitened targets
    # Cholesky factor of the equations' matrix, as `cho_factor` returns it
    factor: tuple[Values, bool]
    # Cholesky factor of the Matern matrix among the centres, as `cho_factor` returns it
    prior_factor: tuple[Values, bool]
    solution: Values  # (m + 1 + d,), coefficients that solve the equations

    def minus_log_evidence(self) -> float:
        """Return minus the logarithm of the evidence, up to a constant."""
        matrix_root, _ = self.factor
        prior_root, _ = self.prior_factor
        # Half the logarithm of the determinant of a matrix is the sum over its Cholesky factor.
        half_log_matrix = np.log(np.diag(matrix_root)).sum()
        half_log_prior = np.log(np.diag(prior_root)).sum()
        explained = self.solution @ (self.whitened.T @ self.targets)
        unexplained = self.targets @ self.targets - explained
        # The prior covariance of the m coefficients is in proportion to the variance.
        prior = len(self.about) * self.log_variance
        return float(half_log_matrix - half_log_prior + (prior + unexplained) / 2)


class Whitened:
    """Rows divided by the size of their scatter; `white` also removes its correlation.

    Parameters
    ----------
    X : ndarray, shape (n, d)
        Standardised inputs.
    targets : ndarray, shape (n,)
        Distances of the ratio from its mean, over the size of its scatter.
    process : ndarray, shape (n,)
        Deviation of the process, over the size of the scatter.
    blocks : list of ndarray, shape (b, k)
        Positions of the rows of b surfaces of k rows each.
    correlation : ScatterCorrelation
        Correlation of the scatter of two rows of a surface.
    """

    def __init__(
        self,
        X: Values,
        targets: Values,
        process: Values,
        blocks: list[Indices],
        correlation: ScatterCorrelation,
    ) -> None:
        self.X = X
        self.targets = targets
        self.process = process
        self.correlation = correlation
        self._blocks = blocks
        self._inverses = [np.linalg.inv(root) for root in correlation.roots(X, blocks)]

    def where(self, mask: NDArray[np.bool_], blocks: list[Indices]) -> "Whitened":
        """Return some of the rows.

        Parameters
        ----------
        mask : ndarray of bool, shape (n,)
            True for the k rows to return.
        blocks : list of ndarray, shape (b, j)
            Surfaces of these rows, by positions among the k rows.

        Returns
        -------
        Whitened
            The k rows.
        """
        return Whitened(
            X=self.X[mask],
            targets=self.targets[mask],
            process=self.process[mask],
            blocks=blocks,
            correlation=self.correlation,
        )

    def white(self, values: Values, *, transposed: bool = False) -> Values:
        """Multiply columns by the inverse Cholesky factors of the correlations.

        Parameters
        ----------
        values : ndarray, shape (n, m) or (n,)
            Columns.
        transposed : bool
            True to multiply by the transposes of the inverse factors.

        Returns
        -------
        ndarray, shape (n, m) or (n,)
            The products, which are whitened columns unless `transposed`.
        """
        columns = values.reshape(len(values), -1)
        whitened = np.empty_like(columns)
        for block, inverse in zip(self._blocks, self._inverses, strict=True):
            matrices = inverse
            if transposed:
                matrices = inverse.transpose(0, 2, 1)
            whitened[block] = matrices @ columns[block]
        return whitened.reshape(values.shape)

    def minus_log_evidence(self, logarithms: Values, centres: Values) -> MinusLogEvidence:
        """Return minus the logarithm of the evidence of lengths and a variance, with its slopes.

        Parameters
        ----------
        logarithms : ndarray, shape (d + 1,)
            Logarithms of the d lengths and of the variance.
        centres : ndarray, shape (m, d)
            Centres of the Matern functions, standardised inputs.

        Returns
        -------
        MinusLogEvidence
            The value, and its slopes by the logarithms.
        """
        terms = self._evidence_terms(logarithms, centres)
        return MinusLogEvidence(
            value=terms.minus_log_evidence(), slopes=-self._evidence_slopes(terms)
        )

    def _evidence_terms(self, logarithms: Values, centres: Values) -> EvidenceTerms:
        """Solve the equations of the coefficients for lengths and a variance.

        Takes the logarithms of the d lengths and of the variance, (d + 1,), and m centres, (m, d).
        """
        lengths = np.exp(logarithms[:-1])
        variance = np.exp(logarithms[-1])
        count = len(centres)
        places = self.X / lengths
        about = centres / lengths
        near = _matern(places, about)
        among = _matern_among(about)
        functions = np.hstack([near.values, _plane(self.X)])
        targets = self.white(self.targets)
        whitened = self.white(functions * self.process[:, None])
        matrix = whitened.T @ whitened
        # Add the penalty that `Population._solve` describes.
        matrix += np.eye(len(matrix)) * (1 + ROUNDING * np.trace(matrix))
        matrix[:count, :count] += among.values / variance - np.eye(count)
        factor = cho_factor(matrix)
        return EvidenceTerms(
            log_variance=logarithms[-1],
            variance=variance,
            places=places,
            about=about,
            near=near,
            among=among,
            whitened=whitened,
            targets=targets,
            factor=factor,
            prior_factor=cho_factor(among.values),
            solution=cho_solve(factor, whitened.T @ targets),
        )

    def _evidence_slopes(self, terms: EvidenceTerms) -> Values:
        """Return the slopes of the logarithm of the evidence, (d + 1,).

        They are derivatives by the logarithms of the d lengths and of the variance. By the chain
        rule they are sums over the values of the Matern function between rows and centres (`near`)
        and over its values among the centres (`among`).
        """
        count = len(terms.about)
        solution = terms.solution[:count]
        inverse = cho_solve(terms.factor, np.eye(len(terms.solution)))
        errors = terms.targets - terms.whitened @ terms.solution
        uncertainty = terms.whitened @ inverse[:, :count]
        by_whitened = np.outer(errors, solution) - uncertainty
        by_near = self.white(by_whitened, transposed=True) * self.process[:, None]
        moments = inverse[:count, :count] + np.outer(solution, solution)
        moments = moments / terms.variance
        prior_inverse = cho_solve(terms.prior_factor, np.eye(count))
        by_among = (prior_inverse - moments) / 2
        slopes = np.empty(terms.about.shape[1] + 1)
        slopes[:-1] = _by_lengths(by_near * terms.near.slopes, terms.places, terms.about)
        slopes[:-1] += _by_lengths(
            by_among * terms.among.slopes, terms.about, terms.about
        )
        slopes[-1] = (np.sum(moments * terms.among.values) - count) / 2
        return slopes


class DirectionScores(NamedTuple):
    """Errors of a mean in q independent directions, measured at rows that it was not fitted to.

    If the errors of means are `factor` times those that the process states, the expected value of
    `squares` is 1 + factor^2 `shares`. The 1 is the scatter of the rows.
    """

    # (q,), variance of the mean's error that the process states, over the variance of the scatter
    shares: Values
    # (q,), squared distance of the rows from the mean, over the variance of the scatter
    squares: Values


def _direction_scores(equations: Equations, inside: NDArray[np.bool_]) -> DirectionScores:
    """Fit the mean to one half of the rows, and measure its errors at the other half.

    `inside`, (n,), is True for the rows at which errors are measured. Directions with a share of
    `SMALLEST_SHARE` or less are left out.
    """
    outside = ~inside
    functions = equations.whitened
    matrix = functions[outside].T @ functions[outside] + equations.penalty
    inverse = np.linalg.inv(np.linalg.cholesky(matrix))
    right = functions[outside].T @ equations.targets[outside]
    mean = inverse.T @ (inverse @ right)
    information = functions[inside].T @ functions[inside]
    shares, directions = eigh(inverse @ information @ inverse.T)
    errors = equations.targets[inside] - functions[inside] @ mean
    scores = directions.T @ (inverse @ (functions[inside].T @ errors))
    # Where the share is small, the scatter of the rows hides the error of the mean.
    kept = shares > SMALLEST_SHARE
    return DirectionScores(shares=shares[kept], squares=scores[kept] ** 2 / shares[kept])


def _error_factor(equations: Equations, first_half: NDArray[np.bool_]) -> float:
    """Estimate the factor by which errors of the mean exceed those that the process states.

    `first_half`, (n,), is True for the rows of one half of the surfaces. The errors of the mean of
    each half are measured at the rows of the other half. The factor is the most probable one that
    is at least `SMALLEST_FACTOR`.
    """
    halves = [_direction_scores(equations, half) for half in (first_half, ~first_half)]
    shares = np.concatenate([half.shares for half in halves])
    squares = np.concatenate([half.squares for half in halves])

    def minus_log_probability(log_square: float) -> float:
        """Return minus the logarithm of the probability of a factor.

        Takes the logarithm of the square of the factor. A constant is left out.
        """
        # The prior of this logarithm is normal, with mean 0 and deviation `DOUBT`.
        variance = 1 + np.exp(log_square) * shares
        terms = np.log(variance) + squares / variance
        return float(terms.sum() + (log_square / DOUBT) ** 2) / 2

    bounds = (2 * np.log(SMALLEST_FACTOR), LARGEST_LOGARITHM)
    search = minimize_scalar(minus_log_probability, bounds=bounds, method="bounded")
    log_square_of_factor = search.x
    return float(np.exp(log_square_of_factor / 2))


class LikelyScales(NamedTuple):
    """Lengths and variance of the process with the largest evidence."""

    lengths: Values  # (d,), over the deviation of each input
    variance: float  # over the square of `Population._process_deviation`


def _most_likely_scales(rows: Whitened, centres: Values) -> LikelyScales:
    """Return the d lengths and the variance of the largest evidence that the searches reach.

    One search starts at each of `STARTS`. The centres of the Matern functions are (m, d).
    """
    dimensions = centres.shape[1]
    log_limits = [tuple(np.log(LENGTHS))] * dimensions
    log_limits.append(tuple(np.log(VARIANCES)))
    searches = []
    for length in STARTS:
        start = np.zeros(dimensions + 1)  # The logarithm of the variance starts at 0.
        start[:-1] = np.log(length)
        search = minimize(
            rows.minus_log_evidence,
            start,
            args=(centres,),
            jac=True,  # The function also returns its slopes.
            method="L-BFGS-B",
            bounds=log_limits,
            options={"maxiter": STEPS, "ftol": 1e-6},
        )
        searches.append(search)
    likeliest = min(searches, key=lambda search: float(search.fun))
    scales = np.exp(likeliest.x)
    return LikelyScales(lengths=scales[:-1], variance=scales[-1])


@dataclass(frozen=True)
class LikelyCorrelation:
    """A correlation with the most likely size of the scatter, and their likelihood."""

    minus_log_likelihood: float  # minus the logarithm of the likelihood, up to a constant
    correlation: ScatterCorrelation


def _most_likely_correlation(
    X: Values, scatter: Values, blocks: list[Indices]
) -> ScatterCorrelation:
    """Return the most likely correlation of the scatter of a surface's rows, with its size.

    Takes inputs, (n, d), and the `scatter`, (n,): the distances of the ratio from the cubic, over
    their fitted size. `blocks` are the positions of the rows of each surface, from `_blocks`.
    """

    def minus_log_likelihood(settings: Values) -> float:
        """Return minus the logarithm of the likelihood of three settings, (3,)."""
        return _with_likeliest_size(settings, X, scatter, blocks).minus_log_likelihood

    search = minimize(
        minus_log_likelihood,
        np.array(FIRST_CORRELATION),
        method="Nelder-Mead",
        options={"maxiter": 100, "xatol": 0.05},
    )
    return _with_likeliest_size(search.x, X, scatter, blocks).correlation


def _with_likeliest_size(
    settings: Values, X: Values, scatter: Values, blocks: list[Indices]
) -> LikelyCorrelation:
    """Return the correlation of three settings, with the most likely size of a scatter, (n,).

    Takes the inputs of the rows, (n, d), and the blocks of `_blocks`. A block is an array, (b, k):
    the positions of the rows of b surfaces, or pieces of surfaces, of k rows each.

    The settings, (3,), are numbers without bounds, as a minimiser needs them: the logit of the
    share that is independent for each row, the logarithm of the length, and the logit of the power
    less 1.
    """
    logit_separate, log_length, logit_power = settings
    above_smallest = (1 - SMALLEST_SEPARATE) * float(expit(logit_separate))
    correlation = ScatterCorrelation(
        separate=SMALLEST_SEPARATE + above_smallest,
        length=float(np.exp(log_length)),
        power=1 + float(expit(logit_power)),
    )
    squares = 0.0  # sum of the squares of the whitened scatter
    log_determinant = 0.0  # of the Cholesky factors of all surfaces
    for block, root in zip(blocks, correlation.roots(X, blocks), strict=True):
        of_surfaces = scatter[block]  # (b, k); the root is (b, k, k)
        whitened = np.linalg.solve(root, of_surfaces[:, :, None])
        squares += np.square(whitened).sum()
        log_determinant += np.log(np.diagonal(root, axis1=1, axis2=2)).sum()
    size = np.sqrt(max(squares / len(X), np.finfo(float).tiny))
    return LikelyCorrelation(
        minus_log_likelihood=len(X) * np.log(size) + log_determinant,
        correlation=correlation._replace(size=float(size)),
    )


def _blocks(surfaces: Indices) -> list[Indices]:
    """Return the positions of the rows of each surface, one array for each number of rows.

    Takes the number of the surface of each row, (n,). An array, (b, k), has the b surfaces of k
    rows each. A surface of more than `TOGETHER` rows is cut into several.
    """
    order = np.argsort(surfaces, kind="stable")
    ordered = surfaces[order]
    starts_of_surfaces = np.flatnonzero(np.diff(ordered)) + 1
    by_size: dict[int, list[Indices]] = {}
    for rows in np.split(order, starts_of_surfaces):
        for start in range(0, rows.size, TOGETHER):
            block = rows[start : start + TOGETHER]
            by_size.setdefault(block.size, []).append(block)
    return [np.array(blocks) for blocks in by_size.values()]


def _plane(X: Values) -> Values:
    """Return the functions of the plane, (n, 1 + d): 1 and the inputs, times `PLANE`."""
    return PLANE * np.column_stack([np.ones(len(X)), X])


def _matern(places: Values, centres: Values) -> Kernel:
    """Return the Matern function of order 5/2 between n places, (n, d), and m centres, (m, d).

    Places and centres are inputs that have been divided by the lengths.
    """
    squares = -2.0 * (places @ centres.T)
    squares += np.einsum("ij,ij->i", places, places)[:, None]
    squares += np.einsum("ij,ij->i", centres, centres)
    np.maximum(squares, 0.0, out=squares)  # rounding may leave them below 0
    root = np.sqrt(5.0 * squares)
    falling = np.exp(-root)
    values = (1 + root + root**2 / 3) * falling
    slopes = -5 / 6 * (1 + root) * falling
    return Kernel(values, slopes)


def _matern_among(centres: Values) -> Kernel:
    """Return the Matern function among m centres, (m, d), made invertible by `JITTER`.

    The centres have been divided by the lengths.
    """
    kernel = _matern(centres, centres)
    kernel.values[np.diag_indices_from(kernel.values)] += JITTER
    return kernel


def _by_lengths(slopes: Values, places: Values, centres: Values) -> Values:
    """Turn slopes by squared distances, (n, m), into slopes by logarithms of the lengths, (d,).

    Places, (n, d), and centres, (m, d), are over the lengths.
    """
    of_places = slopes.sum(axis=1) @ places**2
    of_centres = slopes.sum(axis=0) @ centres**2
    squares = of_places + of_centres
    products = np.einsum("jk,jk->k", slopes.T @ places, centres)
    return np.asarray(-2 * (squares - 2 * products))


def _terms(X: Values, degree: int) -> Values:
    """Return the k terms of a polynomial of inputs, (n, d), as (n, k), in order of their degrees.

    The first term is 1.
    """
    return np.asarray(PolynomialFeatures(degree).fit_transform(X))


def _polynomial(
    X: Values, target: Values, weights: Values, degree: int, most_terms: float
) -> Values:
    """Fit a polynomial by weighted least squares; return the coefficients of `_terms`, (k,).

    Takes inputs, (n, d), and the target and the weights of rows, (n,) each. If the polynomial would
    have more than `most_terms` terms, it is of a lower degree, but at least linear. The
    coefficients of higher terms are then 0.
    """
    terms = _terms(X, degree)
    inputs = X.shape[1]
    coefficients = np.zeros(terms.shape[1])
    fitted_degree = degree
    while fitted_degree > 1 and _number_of_terms(inputs, fitted_degree) > most_terms:
        fitted_degree -= 1
    # Terms are in the order of their degrees: the terms of the lower degree come first.
    fitted = slice(_number_of_terms(inputs, fitted_degree))
    weighted = terms[:, fitted] * weights[:, None]
    matrix = weighted.T @ terms[:, fitted]
    matrix[np.diag_indices_from(matrix)] += RIDGE * weights.sum()
    coefficients[fitted] = solve(matrix, weighted.T @ target, assume_a="pos")
    return coefficients


def _number_of_terms(inputs: int, degree: int) -> int:
    """Return the number of terms of a polynomial, from the number of inputs and the degree."""
    return comb(inputs + degree, degree)


def _floored_logarithm(values: Values) -> Values:
    """Return the logarithms of values, (n,), that are 0 or more.

    Values below `FLOOR` times the median are first raised to this bound. The bound is above 0 even
    if the median is 0.
    """
    floor = FLOOR * float(np.median(values))
    smallest = max(floor, np.finfo(float).tiny)
    return np.asarray(np.log(np.maximum(values, smallest)))
