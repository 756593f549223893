"""Multilevel Monte Carlo on made samples: sums, bounds, numbers, and what is promised."""

import math

import numpy as np
import pytest

from gen.law.multilevel import (
    GROWTH,
    PILOT,
    Completion,
    Level,
    Planner,
    Refinement,
    Sample,
    Sampling,
    Unreachable,
    means_of,
    students,
)

COSTS = (1.0, 2.0, 6.0, 22.0)
"""Costs of a sample on each of four grids."""


def made(values, coarser=None, order=2.0, dropped=0.0, cost=1.0):
    """A sample of the given answers."""
    if coarser is not None:
        coarser = np.atleast_1d(np.array(coarser, dtype=float))
    return Sample(
        values=np.atleast_1d(np.array(values, dtype=float)),
        coarser_values=coarser,
        waves_dropped=dropped,
        slope_order=order,
        cost=cost,
        coarser_cost=0.0 if coarser is None else cost / 4,
        convolutions=cost,
    )


def level(*samples):
    """A level of samples."""
    return Level((32, 32), list(samples))


def drawn(random, number, scatter=0.06, bias=0.03):
    """A sample on a grid by its number, of answers with a mean of 1 in the continuum."""
    surface = 1 + scatter * random.normal()
    errors = bias * (1 + 0.3 * random.normal(size=4)) / 4.0 ** np.arange(4)
    answers = surface + errors
    coarser = answers[number - 1] if number else None
    return made(answers[number], coarser, cost=COSTS[number])


def sampled(seed, error, finest=4, **settings):
    """Sample until an error is met; return the levels in the means, and the cost."""
    random = np.random.default_rng(seed)
    planner = Planner(np.array([error]), tolerance=error / 10)
    levels = [level(), level()]
    coarsest = 0
    for number in range(2):
        levels[number].samples = [drawn(random, number, **settings) for _ in range(PILOT)]
    while True:
        finer = COSTS[len(levels)] if len(levels) < finest else None
        step = planner.next_step(levels[coarsest:], finer)
        if isinstance(step, Completion):
            cost = sum(one.cost for each in levels for one in each.samples)
            return levels[coarsest:], cost
        assert not isinstance(step, Unreachable)
        counts = {len(levels): PILOT}
        if isinstance(step, Sampling):
            coarsest += step.coarsest
            counts = dict(enumerate(step.numbers, coarsest))
        else:
            levels.append(level())
        for number, count in counts.items():
            while levels[number].surface_count < count:
                levels[number].samples.append(drawn(random, number, **settings))


def test_the_mean_is_that_of_the_coarsest_grid_and_all_corrections():
    levels = [
        level(made(1.0), made(3.0)),
        level(made(2.0, 1.5), made(4.0, 3.0), made(3.0, 2.5)),
    ]
    means = means_of(levels, tolerance=0.0)
    assert means.mean == pytest.approx(2.0 + (0.5 + 1.0 + 0.5) / 3)
    of_corrections = np.var([0.5, 1.0, 0.5], ddof=1) / 3
    assert means.standard_error**2 == pytest.approx(2.0 / 2 + of_corrections)


def test_the_error_of_the_surfaces_is_students_interval():
    values = [1.0, 2.0, 4.0, 4.5]
    means = means_of([level(*map(made, values))], tolerance=0.0)
    factor = 3.182446  # of three degrees of freedom, from tables
    assert students(3) == pytest.approx(factor, rel=1e-6)
    expected = factor * np.std(values, ddof=1) / 2
    assert means.surfaces == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("order", "remaining"),
    [(2.0, 1.0), (1.0, 1.0), (0.5, 1 / (math.sqrt(2) - 1)), (-1, 2.5)],
)
def test_the_error_of_the_grid_is_the_last_correction_or_more(order, remaining):
    finest = level(*[made(1.1, 1.0, order) for _ in range(3)])
    means = means_of([level(made(1.0), made(1.0)), finest], tolerance=0.0)
    assert means.grid == pytest.approx(0.1 * remaining)


def test_a_correction_that_is_small_by_chance_counts_as_half_of_the_one_before():
    levels = [
        level(made(1.0), made(1.0)),
        level(made(1.4, 1.0), made(1.4, 1.0)),
        level(made(1.4, 1.4), made(1.4, 1.4)),
    ]
    assert means_of(levels, tolerance=0.0).grid == pytest.approx(0.2)


def test_without_a_coarser_grid_the_error_of_the_grid_is_unknown():
    means = means_of([level(made(1.0), made(2.0))], tolerance=0.0)
    assert np.isinf(means.grid)


def test_dropped_waves_and_the_solver_have_their_parts_and_what_is_given_has_none():
    samples = [made([value, 5.0], [value, 5.0], dropped=0.01) for value in (1.0, 3.0)]
    means = means_of([level(*samples), level(*samples)], tolerance=0.002)
    assert means.waves == pytest.approx([0.02, 0.0])
    assert means.solver == pytest.approx([0.004, 0.0])


def test_numbers_are_as_the_roots_of_variance_over_cost():
    signs = np.array([1, -1] * 50)
    coarse = level(*[made(1 + 0.3 * sign) for sign in signs])
    fine = level(*[made(1 + 0.03 * sign, 1.0, cost=16.0) for sign in signs[:8]])
    error = 0.06
    step = Planner(np.array([error]), 1e-6).next_step([coarse, fine])
    means = means_of([coarse, fine], 1e-6)
    factor = means.surfaces / means.standard_error
    variances = np.array([0.09 * 100 / 99, 0.0009 * 8 / 7])
    costs = np.array([1.0, 20.0])
    largest_variance = ((error * means.mean) ** 2 - means.bias**2) / factor**2
    optimum = np.sqrt(variances / costs) * np.sqrt(variances * costs).sum()
    assert isinstance(step, Sampling)
    assert step.numbers == tuple(
        np.maximum(np.ceil(optimum / largest_variance), [100, 8])
    )


def test_numbers_grow_by_steps_so_that_few_surfaces_do_not_decide_them():
    coarse = level(*[made(value) for value in (0.5, 1.0, 1.5)])
    fine = level(*[made(value, value) for value in (0.5, 1.0, 1.5)])
    step = Planner(np.array([0.01]), 1e-6).next_step([coarse, fine])
    assert step.numbers == (GROWTH * 3, 3)


def test_means_are_within_their_errors_for_less_than_plain_sampling():
    error = 0.02
    within = 0
    costs = []
    for seed in range(40):
        levels, cost = sampled(seed, error)
        means = means_of(levels, error / 10)
        assert means.total <= error * means.mean
        within += abs(means.mean[0] - 1) <= error
        costs.append(cost)
    assert within >= 36
    plain = (1.96 * 0.06 / error) ** 2 * COSTS[-1]
    assert np.mean(costs) < plain / 3


def test_a_grid_that_tells_nothing_of_the_next_one_is_left_out():
    random = np.random.default_rng(2)
    values = 1 + 0.1 * random.normal(size=(3, 2, 60))
    coarsest = level(*[made(value) for value in values[0, 0]])
    middle = level(*[made(*pair) for pair in values[1].T])
    finest = level(*[made(value, value + 1e-5, cost=8.0) for value in values[2, 0]])
    step = Planner(np.array([0.01]), 1e-6).next_step([coarsest, middle, finest])
    assert isinstance(step, Sampling)
    assert step.coarsest == 1


def test_a_grid_with_too_large_an_error_is_refined_or_refused():
    samples = [made(value, value + 0.1) for value in (0.99, 1.0, 1.01)]
    levels = [level(*samples), level(*samples)]
    planner = Planner(np.array([0.02]), 1e-6)
    assert isinstance(planner.next_step(levels, cost_of_finer=4.0), Refinement)
    assert isinstance(planner.next_step(levels), Unreachable)


def test_a_correction_that_may_be_smaller_takes_more_surfaces_before_it_is_refused():
    random = np.random.default_rng(3)
    samples = [made(1.0, 1.0 + 0.05 * random.normal()) for _ in range(PILOT)]
    levels = [level(*samples), level(*samples)]
    step = Planner(np.array([0.002]), 1e-6).next_step(levels)
    assert isinstance(step, Sampling)
    assert step.numbers[-1] == GROWTH * PILOT


@pytest.mark.parametrize("answer", [math.inf, math.nan])
def test_answers_that_are_not_finite_do_not_count(answer):
    samples = [made([1.0, answer], [1.0, answer]) for _ in range(3)]
    planner = Planner(np.array([0.02, 0.02]), 1e-6)
    step = planner.next_step([level(*samples), level(*samples)])
    assert isinstance(step, Completion)


def test_a_mean_of_0_has_no_relative_error():
    samples = [made(0.0, 0.0) for _ in range(3)]
    levels = [level(*samples), level(*samples)]
    assert isinstance(Planner(np.array([0.02]), 1e-6).next_step(levels), Unreachable)
    assert isinstance(Planner(np.array([math.inf]), 1e-6).next_step(levels), Completion)
