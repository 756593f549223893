"""Surfaces of a population: their spectrum, their heights, and the file of the population."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import bem
from gen.population import Population, densities_at, generate_like
from gen.runtime.errors import InputError
from tests.like_maps import population


def generated(fitted, number=40, shape=(64, 96)):
    """Surfaces that are periods of their own."""
    return [
        generate_like(fitted, shape, shape, np.random.default_rng(seed))
        for seed in range(number)
    ]


def parts_of(**changed):
    """Return the content of one part of 64 x 96 nodes, as in a population's file."""
    content = {
        "waves": [0.1, 1.0],
        "scores": [-3.0, 3.0],
        "ratios_x": [0.0, 0.0],
        "ratios_y": [0.0, 0.0],
        "heights": [-3.0, 3.0],
    } | changed
    keys_of_parts = ("waves", "scores")
    parts = {key: content.pop(key) for key in keys_of_parts}
    return {"nodes": [64, 96], "members": [content], **parts}


def with_part(**changed):
    """Return a population with one part."""
    content = json.loads(population().text) | {"parts": parts_of(**changed)}
    return Population.parse(json.dumps(content), "p.json")


def mean_square_slopes(fitted, number=20):
    """Mean square slopes along x and y of surfaces over their variance."""
    surfaces = generated(fitted, number)
    variance = np.mean([surface.var() for surface in surfaces])
    return [
        np.mean([np.mean(np.diff(surface, axis=axis) ** 2) for surface in surfaces])
        / variance
        for axis in (0, 1)
    ]


def test_a_part_without_a_spectrum_of_its_own_has_that_of_the_population():
    """Slopes within 10 %; heights have exactly the mean and the deviation of the part."""
    fitted = with_part(heights=[-6.0, 6.0])
    assert mean_square_slopes(fitted) == pytest.approx(
        mean_square_slopes(population()), rel=0.1
    )
    for surface in generated(fitted, number=3):
        assert surface.mean() == pytest.approx(0.0, abs=1e-9)
        assert surface.std() == pytest.approx(2.0, rel=1e-9)


def test_a_part_has_its_short_waves_along_the_axes():
    """Along x they have a tenth of the power, along y that of the population."""
    along_x, along_y = mean_square_slopes(population())
    smooth_x, smooth_y = mean_square_slopes(
        with_part(ratios_x=[-2.3, -2.3], waves=[0.05, 1.0])
    )
    assert smooth_x < 0.6 * along_x
    assert smooth_y > 1.2 * along_y


def test_a_population_is_its_file():
    fitted = population(np.exp)
    parsed = Population.parse(fitted.text, "p.json")
    assert parsed == fitted
    assert hash(parsed) == hash(fitted)  # so that a cache finds it


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "asperity population 2"}, "format"),
        ({"spacing": [1.0, 0.0]}, "spacing"),
        ({"code": "print()"}, "code"),
        ({"heights": [0.0] * 33}, "heights: do not rise"),
        ({"scores": [0.0, 1.0]}, "not of one length"),
        ({"bands_x": [0.5 + 0.1 * i for i in range(40)]}, "begin at 0"),
        ({"logarithms": [[[0.0]], [[0.0]]]}, "not a table over the bands"),
        ({"parts": parts_of(waves=[0.2, 0.1])}, "parts.waves: do not rise"),
        ({"parts": parts_of(ratios_x=[0.0])}, "not as many ratios as waves"),
        ({"parts": parts_of(heights=[0.0])}, "parts"),
        ({"parts": parts_of(heights=[1.0, 0.0])}, "heights do not rise"),
        ({"parts": parts_of() | {"members": []}}, "parts.members"),
        ({"remarks": None}, "remarks"),
        ({"imperfections": [[[1.0, 2.0], [3.0]]]}, "not rectangles"),
        ({"imperfections": [[[1e999]]]}, "imperfections"),
    ],
)
def test_other_files_are_refused_in_one_line(change, words):
    content = json.loads(population().text) | change
    with pytest.raises(InputError, match=words) as refusal:
        Population.parse(json.dumps(content), "p.json")
    assert str(refusal.value).startswith("p.json: ")
    assert "\n" not in str(refusal.value)


def test_densities_are_those_of_bands_between_them_and_beyond():
    """In the middles of bands, on the straight line between two, and constant after the last."""
    bands = np.array([0.0, 1.0, 3.0, 7.0])  # equal steps of log(1 + q)
    table = np.arange(32.0).reshape(2, 4, 4) / 10
    densities = densities_at(
        table, (bands, bands), np.array([1.0, -3.0, 0.0, 99.0]), np.array([0.0, 7.0])
    )
    expected = [
        [table[0, 1, 0], table[0, 1, 3]],
        [table[1, 2, 0], table[1, 2, 3]],
        [-math.inf, table[0, 0, 3]],  # the mean has no power
        [table[0, 3, 0], table[0, 3, 3]],
    ]
    with np.errstate(divide="ignore"):
        assert np.log(densities) == pytest.approx(np.array(expected))


def test_the_gaussian_field_has_unit_variance_and_its_spectrum():
    """Against the autocorrelation of the spectrum, exp(-(0.3 r)^2 / 2) for unit spacing."""
    surfaces = generated(population())
    assert [surface.std() for surface in surfaces] == pytest.approx([1.0] * 40, rel=1e-5)
    for axis in (0, 1):
        for nodes in (1, 4):
            shifted = [np.roll(surface, nodes, axis) for surface in surfaces]
            correlation = np.mean(
                [np.mean(a * b) for a, b in zip(surfaces, shifted, strict=True)]
            )
            assert correlation == pytest.approx(
                math.exp(-0.5 * (0.3 * nodes) ** 2), abs=0.02
            )


def test_waves_along_x_may_be_longer_than_along_y():
    surfaces = generated(population(wide=3.0))
    slopes = [np.mean([np.diff(s, axis=axis).std() for s in surfaces]) for axis in (0, 1)]
    assert slopes[1] / slopes[0] == pytest.approx(3.0, rel=0.1)


def test_heights_follow_the_curve():
    """Quantiles of lognormal heights over all surfaces, each of which has few independent ones."""
    heights = np.ravel(generated(population(np.exp)))
    shares = [0.1, 0.5, 0.9]
    scores = np.array([-1.2816, 0.0, 1.2816])
    assert np.quantile(heights, shares) == pytest.approx(np.exp(scores), rel=0.05)


def test_a_made_surface_has_an_area_within_an_error():
    """Its waves are long enough for `solve_within`."""
    [heights] = generated(population(), number=1, shape=(128, 128))
    contact = bem.solve_within(
        heights, 128.0, {"area": 0.05}, pressure=0.05, boundary="periodic"
    )
    exact = bem.solve(heights, 128.0, pressure=0.05, boundary="periodic")
    assert contact.area_percent == pytest.approx(exact.area_percent, rel=0.05)


PIT = ((-1.0, -2.0), (-3.0, -4.0), (-5.0, -6.0))


def pits_of(pitted, shape, period, seed):
    """Return the heights of a surface above its texture [um]."""
    without = replace(pitted, imperfections=())
    with_pits, texture = (
        generate_like(of_kind, shape, period, np.random.default_rng(seed))
        for of_kind in (pitted, without)
    )
    return with_pits - texture


def test_imperfections_are_copied_to_random_places():
    """A period as large as the map has one copy, which may cross the border of the period."""
    pitted = replace(population(), imperfections=(PIT,))
    period = pitted.nodes
    places = set()
    for seed in range(8):
        pits = pits_of(pitted, period, period, seed)
        place = np.unravel_index(np.argmin(pits), pits.shape)
        # The last node of the pit is the deepest one.
        rolled = np.roll(pits, (2 - place[0], 1 - place[1]), axis=(0, 1))
        assert rolled[:3, :2] == pytest.approx(np.array(PIT))
        assert np.count_nonzero(np.abs(pits) > 1e-12) == 6
        places.add(place)
    assert len(places) == 8


def test_a_corner_has_its_share_of_imperfections():
    """Of 82 x 82 nodes of the map a corner of 41 x 41 has a quarter: 50 of 200, +- 4 sigma."""
    pitted = replace(population(), imperfections=(PIT[:1],))
    corner = (41, 41)
    number = sum(
        np.any(np.abs(pits_of(pitted, corner, corner, seed)) > 1e-12)
        for seed in range(200)
    )
    assert 26 <= number <= 74


def test_an_imperfection_may_be_larger_than_the_period():
    pitted = replace(population(), imperfections=(((1.0,) * 50,) * 50,))
    small = (8, 8)
    surfaces = [
        generate_like(pitted, small, small, np.random.default_rng(seed))
        for seed in range(200)
    ]
    assert all(np.isfinite(surface).all() for surface in surfaces)
