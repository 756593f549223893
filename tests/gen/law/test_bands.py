"""Where a further surface lies: ranks, Student's intervals, and how often they hold."""

import numpy as np
import pytest
from scipy.stats import t

from gen.law.bands import assumption, described, fewest_surfaces, further_surface


@pytest.mark.parametrize(("level", "number"), [(0.9, 19), (0.8, 9), (0.5, 3), (0.95, 39)])
def test_ranks_reach_a_level_from_some_number_of_surfaces_on(level, number):
    assert fewest_surfaces(level) == number
    assert (number - 1) / (number + 1) == pytest.approx(level)
    assert not assumption(number, level)
    assert f"{number} surfaces or more need no" in assumption(number - 1, level)
    assert "normal" not in described(number, level)
    assert "normal" in described(number - 1, level)


def test_many_surfaces_have_their_ranks_and_what_lies_between_them():
    """Rank p (K + 1) of ascending numbers that are their own ranks."""
    for number, low in ((19, 1.0), (24, 1.25), (39, 2.0)):
        ranks = np.arange(1.0, number + 1)
        band = further_surface(np.random.default_rng(0).permutation(ranks)[:, None], 0.9)
        assert band.low == pytest.approx([low])
        assert band.high == pytest.approx([number + 1 - low])


def test_few_surfaces_have_students_interval_of_the_logarithm_and_of_areas_the_logit():
    values = np.array([[1.0, 10.0], [3.0, 50.0], [4.0, 99.0]])
    reach = t.ppf(0.95, 2) * np.sqrt(1 + 1 / 3)
    for percent, scale in (
        (False, np.log),
        (True, lambda each: np.log(each / (100 - each))),
    ):
        band = further_surface(values, 0.9, percent=percent)
        numbers = scale(values)
        middle, deviation = numbers.mean(axis=0), numbers.std(axis=0, ddof=1)
        np.testing.assert_allclose(scale(band.low), middle - reach * deviation)
        np.testing.assert_allclose(scale(band.high), middle + reach * deviation)
        assert not percent or band.high.max() < 100


@pytest.mark.parametrize("number", [5, 30])
@pytest.mark.parametrize("odd", [0.0, np.inf, np.nan, -1.0])
def test_no_band_where_a_value_has_no_logarithm(number, odd):
    values = np.random.default_rng(0).uniform(1, 2, (number, 3))
    values[number // 2, 1] = odd
    band = further_surface(values, 0.9)
    assert (
        np.isnan(band.low).tolist()
        == np.isnan(band.high).tolist()
        == [False, True, False]
    )


def test_full_contact_of_one_surface_leaves_few_surfaces_no_band():
    values = np.linspace(90.0, 100.0, 20)[:, None]
    assert np.isnan(further_surface(values[-5:], 0.9, percent=True).low)
    assert further_surface(values, 0.9, percent=True).high == pytest.approx(
        [99.97], abs=0.01
    )


@pytest.mark.parametrize("number", [2, 5, 10, 20, 50])
def test_further_surfaces_lie_inside_at_the_level_that_is_said(number):
    """Logarithms are normal here; from 19 surfaces on they need not be."""
    random = np.random.default_rng(number)
    draws = random.lognormal(size=(number + 1, 20_000))
    if number >= fewest_surfaces(0.9):
        draws = random.beta(0.5, 0.3, size=draws.shape)
    band = further_surface(draws[:-1], 0.9)
    inside = (band.low <= draws[-1]) & (draws[-1] <= band.high)
    assert inside.mean() == pytest.approx(0.9, abs=0.015)
