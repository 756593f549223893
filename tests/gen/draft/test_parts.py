"""Parts of maps that are not the same everywhere."""

from dataclasses import replace

import numpy as np
import pytest

from gen.draft.parts import MOST_OUTSIDE, compare_ranges, cut_parts, patches_of
from gen.draft.populations import fit_population
from gen.population import Population, generate_like
from gen.spectral import SelfAffineSpectrum
from tests.gen.draft.test_populations import as_map, made

NODES = 32
SPACING = (1.0, 1.0)
FINE = SelfAffineSpectrum(hurst=0.5, roll_off=12.0, cut_off=3.0)
SMOOTH = SelfAffineSpectrum(hurst=0.8, roll_off=24.0, cut_off=8.0)


def patchwork():
    """A map of which one half is smooth, and the other half finer and rougher."""
    heights = 0.3 * made(SMOOTH, seed=3)
    heights[80:] = made(FINE, seed=4)[80:]
    return heights - heights.mean()


def fitted_with_parts(heights):
    return fit_population([as_map(heights)], "not at all", NODES)


@pytest.fixture(scope="module")
def of_patchwork():
    """A population of the patchwork."""
    return fitted_with_parts(patchwork())


@pytest.mark.long
def test_a_map_that_is_the_same_everywhere_has_no_parts():
    assert fitted_with_parts(made(FINE, seed=5)).parts is None


def test_parts_overlap_by_half_and_reach_all_borders():
    heights = np.arange(80.0 * 40.0).reshape(80, 40)
    parts = cut_parts(heights, 32)
    assert {part.shape for part in parts} == {(32, 32)}
    assert parts[0][0, 0] == heights[0, 0]
    assert parts[-1][-1, -1] == heights[-1, -1]
    assert len(parts) == 4 * 2  # from 0, 16, 32 and 48 along x, from 0 and 8 along y


def test_patches_with_parts_hold_the_parts_of_the_map(of_patchwork):
    """Without them, the ranges of the patches would flag most parts of the map."""
    windows = cut_parts(patchwork(), NODES)
    without = replace(of_patchwork, parts=None)
    flagged = [
        compare_ranges(windows, patches_of(population, NODES, 300), SPACING).share
        for population in (without, of_patchwork)
    ]
    assert flagged[0] > 0.5
    assert flagged[1] <= 2 * MOST_OUTSIDE


def test_surfaces_of_another_kind_are_beyond_the_ranges(of_patchwork):
    """Waves that are twice as long as the longest ones of the map."""
    longer = SelfAffineSpectrum(hurst=0.8, roll_off=80.0, cut_off=24.0)
    other = cut_parts(made(longer, seed=6), NODES)
    patches = patches_of(of_patchwork, NODES, 100)
    assert compare_ranges(other, patches, SPACING).share == 1.0


def test_a_patch_has_the_heights_of_a_part(of_patchwork):
    """Its rms height is that of one of the parts, within 5 %."""
    rms_heights = np.array([part.std() for part in cut_parts(patchwork(), NODES)])
    for patch in patches_of(of_patchwork, NODES, 20):
        assert np.abs(patch.std() / rms_heights - 1).min() < 0.05


def test_surfaces_of_another_size_are_like_the_whole_map(of_patchwork):
    without = replace(of_patchwork, parts=None)
    surfaces = [
        generate_like(population, (48, 48), (64, 64), np.random.default_rng(1))
        for population in (of_patchwork, without)
    ]
    assert np.array_equal(*surfaces)


def test_parts_are_in_the_file_of_the_population(of_patchwork):
    assert Population.parse(of_patchwork.text, "p.json") == of_patchwork
    without = replace(of_patchwork, parts=None)
    assert "parts" not in without.text
