"""The mean of a result over all surfaces of some parameters, and how uncertain this mean is.

Surfaces of the same parameters differ: a result is a function of parameters and load plus the
scatter between surfaces, which is large, and depends on parameters and load. A surface whose result
is large at one load is one with large results at other loads: four rows of a surface tell hardly
more about the mean than one, but much about how the result changes with the load. The mean is a
Gaussian process:

- A target above 0 is divided by a power law of its inputs, which are logarithms as a rule. The
  ratio varies little, and its scatter hardly at all.
- The size of the scatter is the exponential of a quadratic in the inputs, fitted to the distances
  of the ratio from a cubic. The deviation of the process is in proportion to the root of the
  scatter.
  (In proportion to the scatter itself, or with the same deviation everywhere, errors or their
  estimates are worse.)
- The scatter of two rows of a surface is correlated: the most likely exponential of a power of
  their distance, but for a share that is each row's alone. Rows are whitened by it, so that errors
  count as generalised least squares count them.
- The mean is a plane plus a Matern function, with a length for each input. Lengths and variance
  have the largest evidence on some thousand rows.
- All rows count, but the mean is a sum of functions about a few hundred of them (the subset of
  regressors: J. Quinonero-Candela, C. E. Rasmussen (2005), J. Mach. Learn. Res. 6, 1939).
- Parts of the surfaces are left out in turn, which takes no further fits of the lengths. Errors on
  them calibrate intervals of new surfaces. The error of the mean is the process's, times a factor
  by which the two halves of the surfaces disagree more than the process says.

Inputs X, (n, d), are standardised throughout.
"""

from collections.abc import Sequence
from dataclasses import dataclass
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

CENTRES = 500  # largest number of rows that functions of the mean are about
LIKELY_CENTRES = 200  # the same for the evidence
LIKELY_ROWS = 3000  # largest number of rows that the evidence is computed from
LENGTHS = (0.1, 10.0)  # shortest and longest length, over the deviation of an input
STARTS = (1.0, 2.5)  # lengths from which the search for the most likely ones starts
STEPS = 50  # largest number of steps of this search
# smallest and largest variance of the process, over that of the target
VARIANCES = (1e-3, 1e5)
PLANE = 10.0  # deviation of the plane's coefficients before any row is seen, over the target's
PARTS = 20  # parts of the surfaces that are left out in turn
# Largest number of rows of a surface whose correlation counts; further ones count as rows of
# another surface.
TOGETHER = 200
# smallest share of the scatter that is each row's alone: rows may repeat earlier ones
SMALLEST_SEPARATE = 1e-4
PASSES = 3  # fits of power law and scatter, each with the weights of the last
# smallest size of the scatter, over the deviation of the target over its power law
SMALLEST_SCATTER = 1e-4
# share of the process's variance at the rows that is kept, in far fewer numbers
KEPT = 0.99
# deviation of the logarithm of squared errors of means, over those of the process
DOUBT = 0.5
# smallest factor of errors over the process's, which takes its lengths for known
SMALLEST_FACTOR = 1.15
# smallest share of an error in a direction from which its size can be judged
SMALLEST_SHARE = 1e-3
RIDGE = 1e-6  # penalty of polynomials' coefficients, over the weight of all rows
# added to the diagonal of functions at each other's centres, because neighbours are alike
JITTER = 1e-6
ROUNDING = 1e-14  # added to the diagonal of equations, over the sum of the diagonal
# smallest size of residuals and targets of which logarithms are taken, over the median
FLOOR = 1e-3
# surfaces that a term of a polynomial needs: with fewer, the degree of the polynomial falls
SURFACES_PER_TERM = 10


class Kernel(NamedTuple):
    """Values of the Matern function between n and m places, and their slopes."""

    values: Values  # (n, m)
    slopes: Values  # (n, m), by the squared distance


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
        """Fit the mean and its error to rows.

        Parameters
        ----------
        X : ndarray, shape (n, d)
            Standardised inputs.
        y : ndarray, shape (n,)
            Target.
        surfaces : ndarray, shape (n,), optional
            Number of the surface of each row; each row is of another surface if left out.

        Returns
        -------
        Population
            The regressor itself.
        """
        random = np.random.default_rng(self.random_state)
        if surfaces is None:
            surfaces = np.arange(len(y))
        unit, distances = self._fit_trend(X, y, surfaces)
        blocks = _blocks(surfaces)
        correlation = _most_likely_correlation(X, distances / self._scatter(X), blocks)
        size = correlation.size * self._scatter(X)
        rows = Whitened(X, unit / size, self._reach(X) / size, blocks, correlation)
        centres = X[random.permutation(len(y))[:CENTRES]]
        few = random.permutation(len(y)) < LIKELY_ROWS
        likely = _most_likely(
            rows.at(few, _blocks(surfaces[few])), centres[:LIKELY_CENTRES]
        )
        self._solve(rows, centres, likely, dealt(surfaces, PARTS, random))
        return self

    def _fit_trend(
        self, X: Values, y: Values, surfaces: Indices
    ) -> tuple[Values, Values]:
        """Fit the power law, the size of the scatter, and mean and deviation of the ratio to both.

        Return the distances of the ratio from its mean, and from a cubic, (n,) each.
        """
        weights = np.ones(len(y))
        most_terms = np.unique(surfaces).size / SURFACES_PER_TERM
        self.trend_ = np.zeros(X.shape[1] + 1)
        for _ in range(PASSES):
            if y.min() > 0:
                logarithm = _floored_logarithm(y)
                self.trend_ = _polynomial(X, logarithm, weights, 1, most_terms)
            ratio = y / self._trend(X)
            distances = self._fit_scatter(X, ratio, weights, most_terms)
            weights = self._scatter(X) ** -2
        self.mean_ = float(np.average(ratio, weights=np.sqrt(weights)))
        from_mean = ratio - self.mean_
        self.deviation_ = 1.0  # which the reach of the next line takes
        self.deviation_ = float(np.std(from_mean / self._reach(X))) or 1.0
        return from_mean, distances

    def _fit_scatter(
        self, X: Values, ratio: Values, weights: Values, most_terms: float
    ) -> Values:
        """Fit the size of the scatter to the distances of the ratio to the power law from a cubic.

        The size is a root mean square, within the range that nearly all rows have. Return the
        distances, (n,).
        """
        cubic = _polynomial(X, ratio, weights, 3, most_terms)
        distances = ratio - _terms(X, 3) @ cubic
        magnitudes = np.abs(distances)
        logarithms = _floored_logarithm(magnitudes)
        self.sizes_ = _polynomial(X, logarithms, np.ones(len(X)), 2, most_terms)
        logarithm = _terms(X, 2) @ self.sizes_
        self.ends_ = np.quantile(logarithm, (0.01, 0.99))
        size = np.exp(np.clip(logarithm, *self.ends_))
        factor = np.log(np.sqrt(np.mean((magnitudes / size) ** 2)))
        self.sizes_[0] += factor
        smallest = np.log(SMALLEST_SCATTER * ratio.std())
        self.ends_ = np.maximum(self.ends_ + factor, smallest)
        return np.asarray(distances)

    def _solve(
        self, rows: "Whitened", centres: Values, likely: Values, parts: Indices
    ) -> None:
        """Solve for the coefficients with all rows, and predict each part of them without it.

        `likely` has the lengths and the variance, (d + 1,).
        """
        self.lengths_ = likely[:-1]
        variance = likely[-1]
        self.places_ = centres / self.lengths_
        functions = self._functions(rows.X)
        seen = rows.white(functions * rows.reach[:, None])
        unit = rows.white(rows.unit)
        matrix = seen.T @ seen
        count = len(centres)
        penalty = np.eye(len(matrix)) * (1 + ROUNDING * np.trace(matrix))
        prior = _among(self.places_).values / variance
        penalty[:count, :count] += prior - np.eye(count)
        equations = Equations(seen, unit, matrix, seen.T @ unit, penalty)
        self.coefficients_ = solve(matrix + penalty, equations.right, assume_a="pos")
        left_out = equations.left_out(functions, parts)
        self.left_out_ = self._restored(rows.X, left_out)
        factor = _error_factor(seen, unit, penalty, parts < PARTS // 2)
        self.spread_ = equations.spread(functions, factor)

    def _restored(self, X: Values, unit: Values) -> Values:
        """Return means in the unit of the target, (n,), from those that equations give, (n,)."""
        ratio = self.mean_ + self._reach(X) * unit
        return np.asarray(ratio * self._trend(X))

    def _reach(self, X: Values) -> Values:
        """Return the deviation of the process over the power law, (n,)."""
        return np.asarray(self.deviation_ * np.sqrt(self._scatter(X)))

    def _scatter(self, X: Values) -> Values:
        """Return the size of the scatter over the power law, (n,)."""
        logarithm = _terms(X, 2) @ self.sizes_
        low, high = self.ends_
        return np.asarray(np.exp(np.clip(logarithm, low, high)))

    def _trend(self, X: Values) -> Values:
        """Return the power law, (n,); 1 for a target that is not above 0."""
        exponents = self.trend_[1:]
        logarithm = X @ exponents + self.trend_[0]
        return np.asarray(np.exp(logarithm))

    def _functions(self, X: Values) -> Values:
        """Return the functions about the centres, and those of the plane, (n, m + 1 + d)."""
        kernel = _near(X / self.lengths_, self.places_)
        return np.hstack([kernel.values, _plane(X)])

    def predict(self, X: Values) -> Values:
        """Predict the mean.

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
        return np.asarray(deviation * self._reach(X) * self._trend(X))

    def drawn_errors(self, X: Values, number: int) -> Values:
        """Draw functions that the process might be, and return the distances of the mean from them.

        The draws are the same in each call.

        Parameters
        ----------
        X : ndarray, shape (n, d)
            Standardised inputs.
        number : int
            Number of functions.

        Returns
        -------
        ndarray, shape (n, number)
            Distances in the unit of the target.
        """
        random = np.random.default_rng(self.random_state)
        draws = self.spread_ @ random.standard_normal((self.spread_.shape[1], number))
        functions = self._functions(X) @ draws
        distances = functions.T * self._reach(X) * self._trend(X)
        return np.asarray(distances).T


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations of k coefficients, from n whitened rows."""

    seen: Values  # (n, k), functions at the rows
    unit: Values  # (n,), targets
    matrix: Values  # (k, k), seen.T @ seen
    right: Values  # (k,), seen.T @ unit
    penalty: Values  # (k, k), of the coefficients, added to the matrix

    def left_out(self, functions: Values, parts: Indices) -> Values:
        """Predict each part of the rows from the equations without it.

        Parameters
        ----------
        functions : ndarray, shape (n, k)
            Functions at the rows, not whitened.
        parts : ndarray, shape (n,)
            Part of each row.

        Returns
        -------
        ndarray, shape (n,)
            Means over the reach of the process.
        """
        means = np.empty(len(self.unit))
        for part in np.unique(parts):
            inside = parts == part
            seen = self.seen[inside]
            matrix = self.matrix - seen.T @ self.seen[inside] + self.penalty
            right = self.right - seen.T @ self.unit[inside]
            means[inside] = functions[inside] @ solve(matrix, right, assume_a="pos")
        return means

    def spread(self, functions: Values, factor: float) -> Values:
        """Return independent errors of the coefficients that have nearly all variance at the rows.

        Parameters
        ----------
        functions : ndarray, shape (n, k)
            Functions at the rows, not whitened.
        factor : float
            Factor of the errors over the process's.

        Returns
        -------
        ndarray, shape (k, q)
            Errors, one a column, that keep a share `KEPT` of the variance.
        """
        root = np.linalg.cholesky(self.matrix + self.penalty)
        inverse = solve_triangular(root.T, np.eye(len(self.matrix)))
        weighted = functions.T @ functions
        shares, directions = eigh(inverse.T @ weighted @ inverse)
        negligible = (1 - KEPT) * shares.sum()
        kept = np.cumsum(shares) > negligible
        return np.asarray(factor * inverse @ directions[:, kept])


class ScatterCorrelation(NamedTuple):
    """The correlation of the scatter of two rows of one surface."""

    separate: float  # share of the scatter that is each row's alone
    length: float  # distance over which the correlation falls to 1 / e
    power: float = 1.0  # of the distance, in which its logarithm is linear
    # most likely size of the scatter, over the size that it was fitted to
    size: float = 1.0

    def roots(self, X: Values, blocks: Sequence[Indices]) -> list[Values]:
        """Return the triangular roots of the correlations of rows in blocks.

        Parameters
        ----------
        X : ndarray, shape (n, d)
            Standardised inputs.
        blocks : sequence of ndarray, shape (b, k)
            Rows of b surfaces of k rows each.

        Returns
        -------
        list of ndarray, shape (b, k, k)
            Lower triangular roots for each block.
        """
        roots = []
        for block in blocks:
            rows = X[block]
            differences = rows[:, :, None, :] - rows[:, None, :, :]
            distances = np.sqrt(np.square(differences).sum(axis=-1))
            common = np.exp(-((distances / self.length) ** self.power))
            alone = self.separate * np.eye(block.shape[1])
            correlations = (1 - self.separate) * common + alone
            roots.append(np.asarray(np.linalg.cholesky(correlations)))
        return roots


@dataclass(frozen=True, eq=False)
class EvidenceTerms:
    """What the evidence of lengths and a variance, and its slopes, are computed from."""

    logarithm: float  # of the variance
    variance: float
    places: Values  # (n, d), rows over the lengths
    about: Values  # (m, d), centres over the lengths
    near: Kernel  # between rows and centres
    among: Kernel  # among the centres
    seen: Values  # (n, m + 1 + d), whitened functions at the rows
    unit: Values  # (n,), whitened targets
    factor: Any  # Cholesky factor of the equations, as `cho_factor` returns it
    prior_factor: Any  # Cholesky factor of the functions among the centres
    solution: Values  # (m + 1 + d,), coefficients

    def minus_logarithm(self) -> float:
        """Return minus the logarithm of the evidence."""
        matrix = self.factor[0]
        prior = self.prior_factor[0]
        of_matrix = np.log(np.diag(matrix)).sum()
        of_prior = np.log(np.diag(prior)).sum()
        determinants = of_matrix - of_prior
        explained = self.solution @ (self.seen.T @ self.unit)
        squares = self.unit @ self.unit - explained
        count = len(self.about)
        return float(determinants + (count * self.logarithm + squares) / 2)


class Whitened:
    """Rows whose scatter is brought to 1, and whitened, of surfaces whose rows are alike.

    Parameters
    ----------
    X : ndarray, shape (n, d)
        Standardised inputs.
    unit : ndarray, shape (n,)
        Targets over the size of their scatter.
    reach : ndarray, shape (n,)
        Deviation of the process over the size of the scatter.
    blocks : list of ndarray, shape (b, k)
        Rows of surfaces.
    correlation : ScatterCorrelation
        Correlation of the scatter of two rows of a surface.
    """

    def __init__(
        self,
        X: Values,
        unit: Values,
        reach: Values,
        blocks: list[Indices],
        correlation: ScatterCorrelation,
    ) -> None:
        self.X = X
        self.unit = unit
        self.reach = reach
        self.correlation = correlation
        self._blocks = blocks
        self._inverses = [np.linalg.inv(root) for root in correlation.roots(X, blocks)]

    def at(self, rows: NDArray[np.bool_], blocks: list[Indices]) -> "Whitened":
        """Return some of the rows.

        Parameters
        ----------
        rows : ndarray of bool, shape (n,)
            True for k rows to be kept.
        blocks : list of ndarray
            Their surfaces, by positions among the k rows.

        Returns
        -------
        Whitened
            These rows.
        """
        unit = self.unit[rows]
        return Whitened(self.X[rows], unit, self.reach[rows], blocks, self.correlation)

    def white(self, values: Values, *, back: bool = False) -> Values:
        """Whiten columns, or apply the transpose of that.

        Parameters
        ----------
        values : ndarray, shape (n, m) or (n,)
            Columns.
        back : bool
            True for the transpose.

        Returns
        -------
        ndarray, shape (n, m) or (n,)
            The columns times the inverse root of the correlations, or times its transpose.
        """
        columns = values.reshape(len(values), -1)
        whitened = np.empty_like(columns)
        for block, inverse in zip(self._blocks, self._inverses, strict=True):
            matrices = inverse.transpose(0, 2, 1) if back else inverse
            whitened[block] = matrices @ columns[block]
        return whitened.reshape(values.shape)

    def evidence(self, logarithms: Values, centres: Values) -> tuple[float, Values]:
        """Return minus the logarithm of the evidence, and its slopes.

        Parameters
        ----------
        logarithms : ndarray, shape (d + 1,)
            Logarithms of the lengths and of the variance.
        centres : ndarray, shape (m, d)
            Places that functions are about.

        Returns
        -------
        (float, ndarray of shape (d + 1,))
            The value, and its slopes by the logarithms.
        """
        terms = self._evidence_terms(logarithms, centres)
        return terms.minus_logarithm(), -self._evidence_slopes(terms)

    def _evidence_terms(self, logarithms: Values, centres: Values) -> EvidenceTerms:
        """Solve the equations with lengths and a variance by their logarithms, (d + 1,)."""
        lengths = np.exp(logarithms[:-1])
        variance = np.exp(logarithms[-1])
        count = len(centres)
        places = self.X / lengths
        about = centres / lengths
        near = _near(places, about)
        among = _among(about)
        functions = np.hstack([near.values, _plane(self.X)]) * self.reach[:, None]
        unit = self.white(self.unit)
        seen = self.white(functions)
        matrix = seen.T @ seen
        matrix += np.eye(len(matrix)) * (1 + ROUNDING * np.trace(matrix))
        matrix[:count, :count] += among.values / variance - np.eye(count)
        factor = cho_factor(matrix)
        return EvidenceTerms(
            logarithm=logarithms[-1],
            variance=variance,
            places=places,
            about=about,
            near=near,
            among=among,
            seen=seen,
            unit=unit,
            factor=factor,
            prior_factor=cho_factor(among.values),
            solution=cho_solve(factor, seen.T @ unit),
        )

    def _evidence_slopes(self, terms: EvidenceTerms) -> Values:
        """Return the slopes of the logarithm of the evidence, by logarithms, (d + 1,).

        They come from the functions at the rows, and from those at each other's centres.
        """
        count = len(terms.about)
        solution = terms.solution[:count]
        inverse = cho_solve(terms.factor, np.eye(len(terms.solution)))
        errors = terms.unit - terms.seen @ terms.solution
        by_seen = np.outer(errors, solution) - terms.seen @ inverse[:, :count]
        by_near = self.white(by_seen, back=True) * self.reach[:, None]
        moments = inverse[:count, :count] + np.outer(solution, solution)
        moments = moments / terms.variance
        by_among = (cho_solve(terms.prior_factor, np.eye(count)) - moments) / 2
        slopes = np.empty(terms.about.shape[1] + 1)
        slopes[:-1] = _by_lengths(by_near * terms.near.slopes, terms.places, terms.about)
        slopes[:-1] += _by_lengths(
            by_among * terms.among.slopes, terms.about, terms.about
        )
        slopes[-1] = (np.sum(moments * terms.among.values) - count) / 2
        return slopes


def _error_factor(
    seen: Values, unit: Values, penalty: Values, half: NDArray[np.bool_]
) -> float:
    """Return the factor of errors of the mean over the process's, `SMALLEST_FACTOR` or more.

    The mean of each half of the surfaces is judged by the rows of the other one: by the scores of
    directions in which the means may err, whose variance is 1 and the `shares` of these errors.
    """
    shares = []
    squares = []
    for inside in (half, ~half):
        outside = ~inside
        matrix = seen[outside].T @ seen[outside] + penalty
        inverse = np.linalg.inv(np.linalg.cholesky(matrix))
        mean = inverse.T @ (inverse @ (seen[outside].T @ unit[outside]))
        share, directions = eigh(inverse @ (seen[inside].T @ seen[inside]) @ inverse.T)
        errors = unit[inside] - seen[inside] @ mean
        scores = directions.T @ (inverse @ (seen[inside].T @ errors))
        telling = share > SMALLEST_SHARE
        shares.append(share[telling])
        squares.append(scores[telling] ** 2 / share[telling])

    def minus(logarithm: float) -> float:
        """Return minus the logarithm of the probability of a factor's square."""
        variance = 1 + np.exp(logarithm) * np.concatenate(shares)
        terms = np.log(variance) + np.concatenate(squares) / variance
        return float(terms.sum() + (logarithm / DOUBT) ** 2) / 2

    bounds = (2 * np.log(SMALLEST_FACTOR), 4.0)
    logarithm = minimize_scalar(minus, bounds=bounds, method="bounded").x
    return float(np.exp(logarithm / 2))


def _most_likely(rows: Whitened, centres: Values) -> Values:
    """Return lengths and variance, (d + 1,), of the largest evidence, from several starts."""
    features = centres.shape[1]
    limits = [*[LENGTHS] * features, VARIANCES]
    searches = []
    for length in STARTS:
        search = minimize(
            rows.evidence,
            np.log([*[length] * features, 1.0]),
            (centres,),
            jac=True,
            method="L-BFGS-B",
            bounds=[tuple(np.log(ends)) for ends in limits],
            options={"maxiter": STEPS, "ftol": 1e-6},
        )
        searches.append(search)
    likeliest = min(searches, key=lambda search: float(search.fun))
    return np.asarray(np.exp(likeliest.x))


@dataclass(frozen=True)
class LikelyCorrelation:
    """A correlation with its most likely size, and how likely it is."""

    minus_likelihood: float  # minus the logarithm of the likelihood
    correlation: ScatterCorrelation


def _most_likely_correlation(
    X: Values, scatter: Values, blocks: list[Indices]
) -> ScatterCorrelation:
    """Return the most likely correlation of rows of a surface, by a scatter, (n,), of size 1."""

    def minus(logarithms: Values) -> float:
        return _sized(logarithms, X, scatter, blocks).minus_likelihood

    search = minimize(
        minus,
        np.array([-2.0, 1.0, 0.0]),
        method="Nelder-Mead",
        options={"maxiter": 100, "xatol": 0.05},
    )
    return _sized(search.x, X, scatter, blocks).correlation


def _sized(
    logarithms: Values, X: Values, scatter: Values, blocks: list[Indices]
) -> LikelyCorrelation:
    """Return a correlation with the size that is most likely for a scatter, (n,).

    The three numbers are the share that is each row's alone (as a logit), the length (as a
    logarithm) and the power (as a logit between 1 and 2).
    """
    separate, length, power = logarithms
    correlation = ScatterCorrelation(
        separate=SMALLEST_SEPARATE + (1 - SMALLEST_SEPARATE) * float(expit(separate)),
        length=float(np.exp(length)),
        power=1 + float(expit(power)),
    )
    squares = 0.0
    volume = 0.0
    for block, root in zip(blocks, correlation.roots(X, blocks), strict=True):
        squares += np.square(np.linalg.solve(root, scatter[block][:, :, None])).sum()
        volume += np.log(np.diagonal(root, axis1=1, axis2=2)).sum()
    size = np.sqrt(max(squares / len(X), np.finfo(float).tiny))
    likelihood = len(X) * np.log(size) + volume
    return LikelyCorrelation(likelihood, correlation._replace(size=float(size)))


def _blocks(surfaces: Indices) -> list[Indices]:
    """Return the rows of surfaces in blocks, (b, k) for those of k rows.

    Takes the number of the surface of each row, (n,), and cuts surfaces of more than `TOGETHER`.
    """
    order = np.argsort(surfaces, kind="stable")
    first = np.flatnonzero(np.diff(surfaces[order], prepend=surfaces[order[0]] - 1))
    of_size: dict[int, list[Indices]] = {}
    for rows in np.split(order, first[1:]):
        for start in range(0, rows.size, TOGETHER):
            block = rows[start : start + TOGETHER]
            of_size.setdefault(block.size, []).append(block)
    return [np.array(blocks) for blocks in of_size.values()]


def _plane(X: Values) -> Values:
    """Return the functions of the plane, (n, 1 + d)."""
    return PLANE * np.column_stack([np.ones(len(X)), X])


def _near(places: Values, centres: Values) -> Kernel:
    """Return the Matern function of two derivatives between places, (n, d), and centres, (m, d)."""
    squares = -2.0 * (places @ centres.T)
    squares += np.einsum("ij,ij->i", places, places)[:, None]
    squares += np.einsum("ij,ij->i", centres, centres)
    root = np.sqrt(5.0 * np.maximum(squares, 0.0, out=squares))
    falling = np.exp(-root)
    values = (1 + root + root**2 / 3) * falling
    slopes = -5 / 6 * (1 + root) * falling
    return Kernel(values, slopes)


def _among(centres: Values) -> Kernel:
    """Return the Matern function among centres, (m, d), as a matrix that can be inverted."""
    kernel = _near(centres, centres)
    kernel.values[np.diag_indices_from(kernel.values)] += JITTER
    return kernel


def _by_lengths(slopes: Values, places: Values, centres: Values) -> Values:
    """Return slopes by logarithms of lengths, (d,), of those by squared distances, (n, m)."""
    of_places = slopes.sum(axis=1) @ places**2
    of_centres = slopes.sum(axis=0) @ centres**2
    squares = of_places + of_centres
    products = np.einsum("jk,jk->k", slopes.T @ places, centres)
    return np.asarray(-2 * (squares - 2 * products))


def _terms(X: Values, degree: int) -> Values:
    """Return the terms of a polynomial of a degree, (n, k), those of lower degrees first."""
    return np.asarray(PolynomialFeatures(degree).fit_transform(X))


def _polynomial(
    X: Values, target: Values, weights: Values, degree: int, most_terms: float
) -> Values:
    """Return a polynomial's coefficients by weighted least squares, (k,).

    If it would have more than `most_terms` terms, the polynomial is of a lower degree, and the
    coefficients of further terms are 0.
    """
    terms = _terms(X, degree)
    coefficients = np.zeros(terms.shape[1])
    while degree > 1 and comb(X.shape[1] + degree, degree) > most_terms:
        degree -= 1
    used = slice(comb(X.shape[1] + degree, degree))
    weighted = terms[:, used] * weights[:, None]
    matrix = weighted.T @ terms[:, used]
    matrix[np.diag_indices_from(matrix)] += RIDGE * weights.sum()
    coefficients[used] = solve(matrix, weighted.T @ target, assume_a="pos")
    return coefficients


def _floored_logarithm(values: Values) -> Values:
    """Return logarithms of values of 0 and more, of which small ones count as `FLOOR` medians."""
    floor = FLOOR * float(np.median(values))
    smallest = max(floor, np.finfo(float).tiny)
    return np.asarray(np.log(np.maximum(values, smallest)))
