"""Lines of a scan that stand at different heights: warned of, and shifted to each other."""

import numpy as np
import pytest
from maps import rough_map

import bem
from gen import cli
from gen.maps.lines import judge_lines, shifts_of_lines, steps_of_lines
from gen.maps.prepare import prepare
from gen.maps.read import Topography
from gen.maps.settings import Reading
from gen.spectral import SelfAffineSpectrum, generate_spectral

RANDOM = np.random.default_rng(3)
OFFSETS = RANDOM.normal(size=96)
"""Heights by which 96 lines are off, of rms 1."""


def topography(heights):
    return Topography("scan", heights, (95.0, 95.0))


def surface(hurst, cut_off, stretch):
    """A surface with a roll-off at half its side, of rms height 1 um."""
    spectrum = SelfAffineSpectrum(hurst, 48.0, cut_off, stretch)
    random = np.random.default_rng(7)
    return generate_spectral((96, 96), (96.0, 96.0), spectrum, random, rms_height=1.0)


CLEAN = [
    *[(hurst, cut, 1.0) for hurst in (0.2, 0.8) for cut in (2.05, 6.0, 16.0)],
    *[(hurst, cut, 4.0) for hurst in (0.2, 0.8) for cut in (2.05, 6.0, 16.0)],
    *[(hurst, 16.0, 0.25) for hurst in (0.2, 0.8)],
]


@pytest.mark.parametrize(("hurst", "cut_off", "stretch"), CLEAN)
def test_clean_surfaces_have_no_streaks(hurst, cut_off, stretch):
    """Also those with grooves along x, and those with waves of two nodes."""
    heights = surface(hurst, cut_off, stretch)
    assert not judge_lines(heights).are_streaks


def test_noise_a_step_a_tilt_and_a_curvature_are_no_streaks():
    noise = np.random.default_rng(1).normal(size=(96, 96))
    step = noise + 50.0 * (np.arange(96) > 40)
    bowl = rough_map() + 1e-2 * (np.arange(96) - 20.0) ** 2
    for heights in (noise, step, bowl, np.zeros((96, 96))):
        assert not judge_lines(heights).are_streaks


@pytest.mark.parametrize("offsets", [OFFSETS, np.cumsum(OFFSETS)])
@pytest.mark.parametrize("size", [0.1, 0.5])
def test_lines_that_are_off_or_drift_are_streaks(offsets, size):
    """Offsets of a fifth of the rms height and more, at random and as a random walk."""
    assert judge_lines(rough_map() + size * offsets).are_streaks


def test_a_warning_names_the_level_that_mends_it():
    streaky = topography(rough_map() + 0.2 * OFFSETS)
    [warning] = prepare(streaky, Reading(level="plane")).warnings
    assert "lines along x stand at different heights" in warning
    assert warning.endswith("--level lines shifts lines by their median differences")
    assert prepare(streaky, Reading(level="lines")).warnings == ()


def test_lines_along_y_and_small_maps_are_not_judged():
    across = topography(rough_map() + 0.2 * OFFSETS[:, None])
    assert prepare(across, Reading(level="plane")).warnings == ()
    small = Topography("scan", (rough_map() + 0.2 * OFFSETS)[:20, :20], (19.0, 19.0))
    assert not any("lines" in warning for warning in prepare(small, Reading()).warnings)


def test_the_level_gives_the_surface_without_offsets_back():
    """Offsets of any size leave the same surface, which lacks the waves along y alone."""
    heights = rough_map()
    clean = prepare(topography(heights), Reading(level="lines")).heights
    tilted = heights + 0.3 * OFFSETS + 0.2 * np.arange(96)[:, None]
    streaky = prepare(topography(tilted), Reading(level="lines")).heights
    np.testing.assert_allclose(streaky, clean, atol=1e-12)
    lost = heights - heights.mean() - clean
    assert lost.std() < 0.15  # of an rms height of 0.5 um


def test_median_steps_are_0_after_the_shift_and_holes_are_kept():
    heights = rough_map() + OFFSETS
    heights[:, 5] = np.nan
    heights[10:80, 20:23] = np.nan
    shifted = heights - shifts_of_lines(heights)
    np.testing.assert_allclose(steps_of_lines(shifted), 0, atol=1e-12)
    assert np.array_equal(np.isnan(shifted), np.isnan(heights))


def test_shifts_are_those_of_an_independent_library():
    """SurfaceTopography matches the medians of lines: the same where lines differ by offsets."""
    surface_topography = pytest.importorskip("SurfaceTopography")
    profile = rough_map()[:, :1]
    heights = profile + OFFSETS
    peer = surface_topography.Topography(heights, (96.0, 96.0)).scan_line_align(degree=0)
    off = peer.heights() - (heights - shifts_of_lines(heights))
    assert np.ptp(off) < 1e-12


def test_the_contact_of_a_levelled_map_is_that_of_the_surface():
    heights = rough_map()
    levelled = prepare(topography(heights + 0.3 * OFFSETS), Reading(level="lines"))
    load = {"side": 95.0, "pressure": 0.01, "modulus": 1.0}
    area = bem.solve(heights, **load).area_percent
    streaky = bem.solve(heights + 0.3 * OFFSETS, **load).area_percent
    assert bem.solve(levelled.heights, **load).area_percent == pytest.approx(
        area, rel=0.1
    )
    assert streaky < 0.7 * area


def test_a_form_may_follow_lines_but_no_other_level(here, refused):
    np.savetxt(here / "scan.txt", (rough_map() + 0.2 * OFFSETS).T)
    line = ("describe", "scan.txt", "--side", "95", "--unit", "um", "--form", "2")
    assert cli.main([*line, "--level", "lines"]) == 0
    assert "--level plane and --form 2 given" in refused(cli, *line, "--level", "plane")
