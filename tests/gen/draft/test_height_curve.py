"""The curves from normal scores to heights of made translation fields, whose curve is known."""

import numpy as np
import pytest

from gen.draft.curve_choice import nearest_population
from gen.draft.height_curve import HeightCurve
from gen.population import generate_like
from tests.gen.draft.test_populations import LAW, made
from tests.like_maps import population

UNIT = (1.0, 1.0)


def by_slopes(heights, spacing=UNIT):
    return HeightCurve.by_slopes([heights], spacing)


@pytest.mark.parametrize("curve", [lambda u: u, lambda u: np.exp(0.5 * u)])
def test_slopes_give_the_curve_of_a_translation_field(curve):
    """Within 4 % of the rms height. Quantiles are off by 7 and 19 %, for lack of long waves."""
    field = made(LAW, seed=4, nodes=256)
    field /= field.std()
    heights = curve(field)
    fitted = by_slopes(heights - heights.mean())
    inside = np.abs(fitted.scores) < 2.5
    expected = curve(fitted.scores) - heights.mean()
    errors = (fitted.heights - expected) / heights.std()
    assert np.sqrt(np.mean(errors[inside] ** 2)) < 0.04


def test_the_spacing_is_that_of_each_axis():
    heights = made(seed=4)
    fitted = by_slopes(heights, (1.0, 2.0))
    turned = by_slopes(heights.T, (2.0, 1.0))
    np.testing.assert_allclose(fitted.heights, turned.heights, rtol=1e-9)
    isotropic = by_slopes(heights)
    assert np.abs(fitted.heights - isotropic.heights).max() > 1e-3


def test_curves_agree_up_to_a_difference_of_the_highest_nodes():
    curve = HeightCurve.by_quantiles([made(seed=4)])
    for factor, agrees in ((1.1, True), (1.2, False)):
        other = HeightCurve(scores=curve.scores, heights=factor * curve.heights)
        assert other.has_bearing_heights_of(curve) == agrees


def test_a_map_that_is_flat_at_a_height_has_no_curve_by_slopes():
    heights = made()
    heights[:, :40] = heights.max() + 1.0
    assert by_slopes(heights - heights.mean()) is None


def test_the_contact_chooses_the_population():
    """The map is a surface of the second population, whose summits are half as high."""
    low = population(lambda scores: 0.3 * np.minimum(scores, scores / 2))
    high = population(lambda scores: 0.3 * scores)
    surface = generate_like(low, (96, 96), (96, 96), np.random.default_rng(5))
    assert nearest_population([high, low], [surface]) is low
    assert nearest_population([low, high], [surface]) is low
