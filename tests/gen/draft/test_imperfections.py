"""Pits, dust and scratches are separated from the texture of made maps."""

import numpy as np
import pytest

from gen.draft.imperfections import SQUARE, separate_imperfections
from gen.draft.populations import Roughness
from gen.population import Population
from gen.spectral import SelfAffineSpectrum
from tests.gen.draft.test_populations import LAW, fitted_to, made, surfaces_of

SMOOTH = SelfAffineSpectrum(1.0, 60.0, 50.0)
LAY = SelfAffineSpectrum(0.8, 40.0, 30.0, stretch=0.1)


def with_pits(heights, depth=6.0):
    """Return heights with two pits of 6 x 6 nodes, each in the middle of a square."""
    pitted = heights.copy()
    for x, y in ((37, 53), (117, 101)):
        pitted[x : x + 6, y : y + 6] -= depth
    return pitted


@pytest.mark.parametrize(
    "heights",
    [made(), np.exp(0.7 * made(seed=1)), made(SMOOTH, seed=2), made(LAY, seed=3)],
    ids=["gaussian", "lognormal", "smooth", "directional"],
)
def test_a_texture_has_no_imperfections(heights):
    separated = separate_imperfections(heights, (1.0, 1.0))
    assert separated.imperfections == ()
    assert separated.texture is heights


def test_pits_are_imperfections():
    """The texture is the surface without pits, but smooth in their squares."""
    heights = made()
    separated = separate_imperfections(with_pits(heights), (1.0, 1.0))
    assert len(separated.imperfections) == 2
    assert all(pit.shape == (SQUARE, SQUARE) for pit in separated.imperfections)
    assert all(pit.min() < -5.0 for pit in separated.imperfections)
    is_other = separated.texture != heights
    assert np.count_nonzero(is_other) <= 2 * SQUARE**2
    assert np.abs(separated.texture - heights).max() < 3.0


def test_more_heights_than_a_file_holds_are_not_separated():
    heights = with_pits(made())
    separated = separate_imperfections(heights, (1.0, 1.0), 2 * SQUARE**2 - 1)
    assert separated.imperfections == ()
    assert separated.texture is heights


def test_a_few_squares_tell_no_usual_slope():
    heights = made(nodes=7 * SQUARE)
    heights[20:26, 20:26] -= 6.0
    assert separate_imperfections(heights, (1.0, 1.0)).imperfections == ()


def test_many_steep_squares_are_the_texture():
    heights = made()
    heights[:20] *= 10
    assert separate_imperfections(heights, (1.0, 1.0)).imperfections == ()


def test_surfaces_have_the_texture_and_the_pits_of_the_map():
    """Their rms slope, and the median slope, which pits hardly change, are within 10 %."""
    heights = with_pits(made(LAW), depth=10.0)
    fitted = fitted_to(heights)
    assert len(fitted.imperfections) == 2
    assert Population.parse(fitted.text, "") == fitted
    surfaces = surfaces_of(fitted)
    of_map = Roughness.of([heights], (1.0, 1.0))
    of_surfaces = Roughness.of(surfaces, (1.0, 1.0))
    assert of_surfaces.slope == pytest.approx(of_map.slope, rel=0.1)
    medians = [
        np.median(np.abs(np.diff(surface, axis=0))) for surface in [heights, *surfaces]
    ]
    assert medians[1:] == pytest.approx([medians[0]] * len(surfaces), rel=0.1)
    assert all(np.count_nonzero(surface < -6.0) > 40 for surface in surfaces)
