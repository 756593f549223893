"""Multilevel Monte Carlo: means over a population of surfaces, from samples on nested grids.

The mean of an answer on a fine grid is its mean on the coarsest grid, plus the mean corrections
from each grid to the next finer one. A correction is the difference of the answers of one surface
on two grids. It scatters little, so that few surfaces tell its mean; the many surfaces that the
mean on the coarsest grid needs are cheap (Giles 2008, Operations Research 56, 607; Giles 2015, Acta
Numerica 24, 259). No surface is in the samples of two grids, so that these are independent.

The error of a mean has four parts, which are added in quadrature:

- that of the surfaces, whose number is finite: half of a 95 % interval by Student's distribution,
- that of the finest grid, which is at most the last correction where errors fall in proportion to
  the spacing or faster,
- that of the waves that the finest grid has dropped, and that of the tolerance of the solver, as
  for one contact (`bem.accuracy`).

The number of surfaces on each grid follows from the variance and the cost of a sample there: with
numbers in proportion to the root of their ratio, the variance of a mean costs least (Giles 2008).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from bem.accuracy import OF_DROPPED
from bem.derived.grid_error import ORDERS
from gen.arrays import Values

PILOT = 8
"""Surfaces on each grid before the numbers are chosen: their scatter tells how many are needed."""

PILOT_OF_FINER = 5
"""First surfaces on a finer grid that is taken later, because the errors need it. They are fewer,
because surfaces cost more there."""

PARTS_OF_BIAS = (0.35, 0.5, math.sqrt(0.5))
"""Parts of a largest error that grid, dropped waves and solver together may make [1]. The part is
taken that costs least. The last one is half of the squared error (Giles 2008)."""

LARGEST_BIAS = 0.95
"""The largest part that they may make if there is no finer grid, which would reduce it [1]."""

GROWTH = 3
"""Largest factor by which the number of surfaces on a grid grows before scatter and cost are
estimated anew [1]."""

LEVEL = 0.95
"""Probability with which errors are kept [1]."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Answers of one surface on a grid, and on the next coarser one.

    Attributes
    ----------
    values : ndarray, shape (m,)
        Answers on the grid, NaN or infinite where there is none.
    coarser_values : ndarray, shape (m,), or None
        The same answers on the next coarser grid; None if they were not solved there.
    waves_dropped : float
        Share of the surface's mean square slope that the grid lacks [1].
    slope_order : float
        Order in the spacing of the mean square slope on the grid, see
        `bem.derived.grid_error.slope_order` [1].
    cost : float
        Cost of the surface and its contacts on the grid, in convolutions on the grid of the scene
        [1].
    coarser_cost : float
        Cost of the contacts on the coarser grid, in the same unit [1].
    convolutions : float
        Convolutions of the contacts on both grids, in the same unit [1].
    """

    values: Values
    coarser_values: Values | None
    waves_dropped: float
    slope_order: float
    cost: float
    coarser_cost: float
    convolutions: float


@dataclass
class Level:
    """The samples on one grid.

    Attributes
    ----------
    nodes : tuple of int
        Nodes (mx, my) of the grid.
    samples : list of Sample
        One for each surface.
    """

    nodes: tuple[int, int]
    samples: list[Sample] = field(default_factory=list)

    @property
    def surface_count(self) -> int:
        """Number of surfaces."""
        return len(self.samples)

    @property
    def cost(self) -> float:
        """Mean cost of a sample without its coarser grid, see `Sample.cost` [1]."""
        return float(np.mean([sample.cost for sample in self.samples]))

    @property
    def cost_of_correction(self) -> float:
        """Mean cost of the samples that have a coarser grid, on both grids [1]."""
        return float(
            np.mean(
                [
                    sample.cost + sample.coarser_cost
                    for sample in self.samples
                    if sample.coarser_values is not None
                ]
            )
        )

    @property
    def convolutions(self) -> float:
        """Convolutions of all samples, in convolutions on the grid of the scene [1]."""
        return sum(sample.convolutions for sample in self.samples)

    @property
    def values(self) -> Values:
        """Answers on the grid, of all n surfaces, (n, m)."""
        return np.array([sample.values for sample in self.samples])

    @property
    def corrections(self) -> Values:
        """Answers less those on the next coarser grid, of the surfaces with both, (n, m)."""
        pairs = self.pairs
        with np.errstate(invalid="ignore"):  # an infinite answer has no correction
            return pairs[:, 0] - pairs[:, 1]

    @property
    def pairs(self) -> Values:
        """Answers of the surfaces that were solved on both grids, (n, 2, m), finer grid first."""
        pairs = [
            (sample.values, sample.coarser_values)
            for sample in self.samples
            if sample.coarser_values is not None
        ]
        # Without pairs the array has this shape, too.
        return np.array(pairs).reshape(len(pairs), 2, self.samples[0].values.size)


@dataclass(frozen=True, eq=False)
class Means:
    """Means of m answers over a population, and the parts of their errors at 95 %.

    All errors are absolute, in the units of the answers.

    Attributes
    ----------
    mean : ndarray, shape (m,)
        Means, not finite where an answer of a surface is not.
    standard_error : ndarray, shape (m,)
        Standard errors for the finite number of surfaces.
    surfaces : ndarray, shape (m,)
        Half-widths of the 95 % intervals for the finite number of surfaces.
    grid : ndarray, shape (m,)
        Bounds of the error of the finest grid, infinite where only one grid was solved.
    waves : ndarray, shape (m,)
        Bounds of the error for waves that the finest grid has dropped.
    solver : ndarray, shape (m,)
        Bounds of the error for the tolerance of the solver.
    """

    mean: Values
    standard_error: Values
    surfaces: Values
    grid: Values
    waves: Values
    solver: Values

    @property
    def bias(self) -> Values:
        """Errors that more surfaces do not reduce, (m,)."""
        return np.sqrt(self.grid**2 + self.waves**2 + self.solver**2)

    @property
    def total(self) -> Values:
        """Roots of the sums of the squares of all parts, (m,)."""
        return np.sqrt(self.surfaces**2 + self.bias**2)

    def chosen(self, places: NDArray[np.int64]) -> Means:
        """Return some of the means.

        Parameters
        ----------
        places : ndarray of int, shape (k,)
            Indices of these means.

        Returns
        -------
        Means
            k means and their errors, in this order.
        """
        return Means(
            mean=self.mean[places],
            standard_error=self.standard_error[places],
            surfaces=self.surfaces[places],
            grid=self.grid[places],
            waves=self.waves[places],
            solver=self.solver[places],
        )


def students(freedom: Values | float, level: float = LEVEL) -> Values:
    """Return the factor from a standard error to half of an interval.

    Parameters
    ----------
    freedom : float or ndarray
        Degrees of freedom of the standard error.
    level : float
        Probability of the interval, between 0 and 1.

    Returns
    -------
    ndarray
        Quantile of Student's distribution [1].
    """
    return np.asarray(stdtrit(freedom, (1 + level) / 2))


def means_of(levels: Sequence[Level], tolerance: float) -> Means:
    """Estimate the means and their errors from the samples on nested grids.

    Parameters
    ----------
    levels : sequence of Level
        Samples on one grid or more, from the coarsest one, two or more surfaces on each.
    tolerance : float
        Tolerance of the solver [Delta].

    Returns
    -------
    Means
        Means on the finest of the grids, and their errors.
    """
    parts = _parts_of_means(levels)
    mean = np.sum([part.mean for part in parts], axis=0)
    variance = np.sum([part.variance_of_mean for part in parts], axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Welch and Satterthwaite's degrees of freedom of a sum of means
        spread = np.sum(
            [part.variance_of_mean**2 / (part.number - 1) for part in parts], axis=0
        )
        freedom = np.where(spread > 0, variance**2 / spread, math.inf)
        standard_error = np.sqrt(variance)
        surfaces = np.where(variance > 0, students(freedom) * standard_error, variance)
    finest = levels[-1].samples
    dropped = float(np.mean([sample.waves_dropped for sample in finest]))
    grid = _error_of_grid(levels)
    # An answer that is the same on all surfaces and grids is a given load, and is exact.
    is_given = (variance == 0) & (grid == 0)
    scale = np.where(is_given, 0.0, np.abs(mean))
    # A mean of 0, as of an area in spots smaller than a cell, tells nothing of that on finer grids.
    grid[mean == 0] = math.inf
    return Means(
        mean=mean,
        standard_error=standard_error,
        surfaces=surfaces,
        grid=grid,
        waves=OF_DROPPED * dropped * scale,
        solver=tolerance * scale,
    )


@dataclass(frozen=True, eq=False)
class _Part:
    """Mean answers on the coarsest grid, or mean corrections to a finer one, each (m,)."""

    number: int  # of surfaces
    mean: Values
    variance: Values  # over the surfaces

    @classmethod
    def of(cls, answers: Values) -> _Part:
        """Return the means and variances of answers or corrections of n surfaces, (n, m)."""
        with np.errstate(invalid="ignore"):  # of infinite answers
            variance = answers.var(axis=0, ddof=1)
            return cls(len(answers), answers.mean(axis=0), variance)

    @property
    def variance_of_mean(self) -> Values:
        """Variances of the means, (m,)."""
        return self.variance / self.number


def _parts_of_means(levels: Sequence[Level]) -> list[_Part]:
    """Return the means on the coarsest grid, then the mean corrections to each finer one."""
    coarsest, *finer = levels
    return [
        _Part.of(coarsest.values),
        *[_Part.of(level.corrections) for level in finer],
    ]


def _error_of_grid(levels: Sequence[Level]) -> Values:
    """Return bounds of the errors of the finest grid, (m,); infinite without two corrections.

    The error that is left is at most the last correction if errors fall in proportion to the
    spacing or faster, and larger if the slopes converge more slowly. The upper end of the interval
    of the last correction is taken. As this correction may be small by chance, at least half of the
    correction before it is taken.
    """
    finest = levels[-1]
    if len(finest.corrections) < 2:
        return np.full(finest.samples[0].values.shape, math.inf)
    last = _Part.of(finest.corrections)
    removed = np.abs(last.mean) + _reach(last)
    removed = np.maximum(removed, _least_removed(levels))
    return remaining_error(finest) * removed


def _least_removed(levels: Sequence[Level]) -> Values:
    """Return a least size of the last correction, (m,): half of the one before, 0 without one."""
    if len(levels) < 2 or len(levels[-2].corrections) < 2:
        return np.zeros(levels[-1].samples[0].values.shape)
    return np.abs(_Part.of(levels[-2].corrections).mean) / 2


def _reach(part: _Part) -> Values:
    """Return by how much the true mean may be larger, one-sided at 95 %, (m,)."""
    return students(part.number - 1, 2 * LEVEL - 1) * np.sqrt(part.variance_of_mean)


def _lower_end(level: Level) -> Values:
    """Return the lower ends of the intervals of a level's corrections in size, (m,).

    They are NaN without two corrections.
    """
    if len(level.corrections) < 2:
        return np.full(level.samples[0].values.shape, math.nan)
    part = _Part.of(level.corrections)
    return np.abs(part.mean) - _reach(part)


def remaining_error(level: Level) -> float:
    """Return the error that is left on a grid, over the correction that it has brought.

    Parameters
    ----------
    level : Level
        Samples on the grid.

    Returns
    -------
    float
        1 or more: 1 where errors fall in proportion to the spacing or faster.
    """
    order = float(np.median([sample.slope_order for sample in level.samples]))
    lowest, highest = ORDERS
    return max(1.0, 1 / (2 ** min(max(order, lowest), highest) - 1))


# The next step


@dataclass(frozen=True)
class Sampling:
    """The next step: to solve more surfaces.

    Attributes
    ----------
    coarsest : int
        Index of the coarsest grid that is worth its samples. Means leave out coarser grids.
    numbers : tuple of int
        Number of all surfaces on each grid, from `coarsest` to the finest one.
    cost : float
        Cost of the further surfaces until all errors are met, in convolutions on the grid of the
        scene [1]; infinite if it is not known.
    """

    coarsest: int
    numbers: tuple[int, ...]
    cost: float


@dataclass(frozen=True)
class Refinement:
    """The next step: to take a finer grid."""


@dataclass(frozen=True)
class Completion:
    """No further step, because all errors are met."""


@dataclass(frozen=True)
class Unreachable:
    """No further step, because the finest grid that there is has larger errors than asked for."""


Step = Sampling | Refinement | Completion | Unreachable


@dataclass(frozen=True, eq=False)
class Planner:
    """The choice of grids and of the number of surfaces on each.

    Attributes
    ----------
    relative_errors : ndarray, shape (m,)
        Largest relative errors of the means at 95 %, infinite for answers that may have any [1].
    tolerance : float
        Tolerance of the solver [Delta].
    """

    relative_errors: Values
    tolerance: float

    def next_step(
        self, levels: Sequence[Level], cost_of_finer: float | None = None
    ) -> Step:
        """Choose the next step from the samples that there are.

        A finer grid is taken if its first surfaces and all further surfaces are then expected to
        cost less than the further surfaces without this grid.

        Parameters
        ----------
        levels : sequence of Level
            Samples on some grids, from the coarsest one, two or more surfaces on each.
        cost_of_finer : float or None
            Cost of a sample on the next finer grid, in convolutions on the grid of the scene; None
            if there is no finer one [1].

        Returns
        -------
        Step
            What to do next.
        """
        means = means_of(levels, self.tolerance)
        largest = self.largest_errors(means)
        if not (means.total > largest).any():
            return Completion()
        parts: tuple[float, ...] = PARTS_OF_BIAS
        if cost_of_finer is None:
            parts = (*PARTS_OF_BIAS, LARGEST_BIAS)
        plans = [self._plan(levels, means, part * largest, largest) for part in parts]
        possible_plans = [plan for plan in plans if plan is not None]
        best = min(possible_plans, key=lambda plan: plan.cost, default=None)
        if cost_of_finer is not None:
            # The bias is expected to fall in proportion to the spacing.
            variance = _left_for_surfaces(means.bias / 2, largest)
            cost = (
                PILOT_OF_FINER * cost_of_finer + _cheapest(levels, means, variance).cost
            )
            if best is None or cost < best.cost:
                return Refinement()
        if best is None:
            return self._more_for_bias(levels, means, largest)
        kept = levels[best.coarsest :]
        numbers = [
            min(max(number, level.surface_count), GROWTH * level.surface_count)
            for number, level in zip(best.numbers, kept, strict=True)
        ]
        return replace(best, numbers=tuple(numbers))

    def _plan(
        self, levels: Sequence[Level], means: Means, for_bias: Values, largest: Values
    ) -> Sampling | None:
        """Return the numbers of surfaces with which all errors are met; None if no numbers do.

        Grid, dropped waves and solver may have errors up to `for_bias`, (m,), and all parts
        together up to `largest`, (m,).
        """
        number = self._number_for_bias(levels, means, for_bias)
        if number == math.inf:
            return None
        bias = np.minimum(means.bias, for_bias)  # with this number of surfaces
        plan = _cheapest(levels, means, _left_for_surfaces(bias, largest))
        finest = levels[-1]
        on_finest = max(plan.numbers[-1], math.ceil(number))
        new_surfaces = on_finest - max(plan.numbers[-1], finest.surface_count)
        return Sampling(
            coarsest=plan.coarsest,
            numbers=(*plan.numbers[:-1], on_finest),
            cost=plan.cost + max(new_surfaces, 0) * finest.cost_of_correction,
        )

    def _more_for_bias(
        self, levels: Sequence[Level], means: Means, largest: Values
    ) -> Sampling | Unreachable:
        """Ask for more surfaces on the finest two grids, which may show a smaller error.

        The step is `Unreachable` if the error is too large even with the lower ends of the
        intervals of the last two corrections.
        """
        remaining = remaining_error(levels[-1])
        removed = np.fmax(0.0, _lower_end(levels[-1]))
        if len(levels) > 1:
            # Half of the correction before is the least that is taken for the last one.
            removed = np.fmax(removed, 0.5 * _lower_end(levels[-2]))
        with np.errstate(invalid="ignore"):
            bias = np.hypot(remaining * removed, np.hypot(means.waves, means.solver))
        counted = np.isfinite(largest)
        never = (bias > LARGEST_BIAS * largest) | (means.mean == 0)
        if len(levels[-1].corrections) < 2 or never[counted].any():
            return Unreachable()
        numbers = [level.surface_count for level in levels]
        for index in range(max(len(levels) - 2, 0), len(levels)):
            numbers[index] *= GROWTH
        return Sampling(coarsest=0, numbers=tuple(numbers), cost=math.inf)

    def largest_errors(self, means: Means) -> Values:
        """Return the errors that were asked for, in the units of the answers.

        Parameters
        ----------
        means : Means
            The means.

        Returns
        -------
        ndarray, shape (m,)
            Largest errors, infinite for answers that may have any, and for those that are not
            finite.
        """
        is_asked = np.isfinite(self.relative_errors) & np.isfinite(means.mean)
        factors = np.where(is_asked, self.relative_errors, 1.0)
        scale = np.where(is_asked, np.abs(means.mean), math.inf)
        return factors * scale

    def _number_for_bias(
        self, levels: Sequence[Level], means: Means, largest: Values
    ) -> float:
        """Return the number of surfaces on the finest grid that shows its error to be small enough.

        More surfaces make the interval of the last correction shorter. The number is infinite if
        the error is too large even without this interval. `largest` has the largest errors of grid,
        dropped waves and solver together, (m,).
        """
        finest = levels[-1]
        too_large = means.bias > largest
        if not too_large.any():
            return finest.surface_count
        if len(finest.corrections) < 2:
            return math.inf
        last = _Part.of(finest.corrections)
        remaining = remaining_error(finest)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            of_grid = np.sqrt(largest**2 - means.waves**2 - means.solver**2)
            allowed = of_grid - remaining * np.abs(last.mean)
            factors = (remaining * _reach(last) / allowed) ** 2
            never = ~(allowed > 0) | (remaining * _least_removed(levels) > of_grid)
        factors[never | (means.mean == 0)] = math.inf
        return float(finest.surface_count * max(np.max(factors[too_large]), 1.0))


def _left_for_surfaces(bias: Values, largest: Values) -> Values:
    """Return the squares of the errors that the finite number of surfaces may make, (m,).

    A bias above `LARGEST_BIAS` of the largest error is replaced by this: further surfaces on the
    finest grid will reduce it.
    """
    # Answers without an asked error have infinite ones.
    with np.errstate(invalid="ignore"):
        variance = largest**2 - bias**2
    return np.fmax(variance, (1 - LARGEST_BIAS**2) * largest**2)


def _cheapest(levels: Sequence[Level], means: Means, variance: Values) -> Sampling:
    """Return the coarsest grid that is worth its samples, and the numbers that cost least.

    `variance` has the largest squared errors of the finite number of surfaces, (m,).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        factors = means.surfaces / means.standard_error
        largest_variance = variance / factors**2
    coarsest = _coarsest_worth_it(levels, largest_variance)
    kept = levels[coarsest:]
    numbers = _numbers(kept, largest_variance)
    costs = _costs(kept)
    cost = sum(
        max(number - level.surface_count, 0) * cost
        for number, level, cost in zip(numbers, kept, costs, strict=True)
    )
    return Sampling(coarsest, tuple(numbers), cost)


def _costs(levels: Sequence[Level]) -> list[float]:
    """Return the costs of a sample on the coarsest grid, and of a correction on each other one."""
    coarsest, *finer = levels
    return [coarsest.cost, *[level.cost_of_correction for level in finer]]


def _coarsest_worth_it(levels: Sequence[Level], largest_variance: Values) -> int:
    """Return the index of the coarsest grid with which means cost less than without it.

    The costs follow from the surfaces that were solved on this grid and on the next finer one. The
    last two grids are always kept, because the corrections between them tell the error of the grid.
    """
    for coarser in range(len(levels) - 2):
        finer = levels[coarser + 1]
        pairs = finer.pairs
        with np.errstate(invalid="ignore", divide="ignore"):
            scatter = pairs.std(axis=0, ddof=1)  # on both grids, (2, m)
            of_corrections = finer.corrections.std(axis=0, ddof=1)
            with_coarser = scatter[1] * math.sqrt(levels[coarser].cost)
            with_coarser += of_corrections * math.sqrt(finer.cost_of_correction)
            with_coarser = with_coarser**2 / largest_variance
            without = scatter[0] ** 2 * finer.cost / largest_variance
        counted = np.isfinite(with_coarser) & np.isfinite(without)
        if counted.any() and with_coarser[counted].max() < without[counted].max():
            return coarser
    return max(len(levels) - 2, 0)


def _numbers(levels: Sequence[Level], largest_variance: Values) -> list[int]:
    """Return the number of surfaces on each grid with which no mean has a larger variance.

    `largest_variance` has the variances that are allowed, (m,). For each answer the numbers are
    those that cost least; each grid takes the largest of them.
    """
    parts = _parts_of_means(levels)
    costs = np.array(_costs(levels))
    variances = np.array([part.variance for part in parts])
    counted = np.isfinite(largest_variance) & np.isfinite(variances).all(axis=0)
    if not counted.any():
        return [level.surface_count for level in levels]
    variances = variances[:, counted]
    sums = (np.sqrt(variances) * np.sqrt(costs)[:, None]).sum(axis=0)
    numbers = np.sqrt(variances / costs[:, None]) * sums / largest_variance[counted]
    return [math.ceil(number) for number in numbers.max(axis=1).tolist()]
