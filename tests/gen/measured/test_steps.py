"""Steps of a preparation: block means, lengths, masks, and what is said about them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bem.spacing import Boundary
from gen.measured import steps
from gen.measured.topography import Topography
from gen.runtime.errors import InputError


def topography(heights: np.ndarray, boundary: Boundary = "free") -> Topography:
    """A map with a spacing of 0.5 x 2 um."""
    nx, ny = (nodes - (boundary == "free") for nodes in heights.shape)
    return Topography("scan", heights, (0.5 * nx, 2.0 * ny), boundary=boundary)


@given(
    st.integers(4, 30),
    st.integers(4, 30),
    st.sampled_from(["free", "periodic", "mirror"]),
    st.integers(0, 2**32 - 1),
)
def test_means_of_blocks_are_exact(nx: int, ny: int, boundary: Boundary, seed: int) -> None:
    nodes = 2 + seed % (min(nx, ny) // 2 - 1)
    heights = np.random.default_rng(seed).integers(-512, 512, (nx, ny)).astype(float)
    coarse = steps.downsampled(topography(heights, boundary), nodes)
    assert coarse.heights.shape == (nx // nodes, ny // nodes)
    for (i, j), mean in np.ndenumerate(coarse.heights):
        block = heights[i * nodes : (i + 1) * nodes, j * nodes : (j + 1) * nodes]
        assert mean == block.sum() / nodes**2
    assert coarse.spacing == pytest.approx((0.5 * nodes, 2.0 * nodes))
    assert coarse.boundary == boundary
    assert ("left out" in coarse.steps[-1]) == bool(nx % nodes or ny % nodes)


@given(st.integers(0, 2**32 - 1), st.floats(-3, 0), st.floats(0.1, 3))
def test_heights_outside_a_mask_become_holes(seed: int, below: float, above: float) -> None:
    heights = np.random.default_rng(seed).normal(size=(9, 12))
    heights[3, 4], heights[0, 0] = np.nan, 0.05
    masked = steps.masked(topography(heights), (below, above))
    kept = (heights >= below) & (heights <= above)
    assert np.array_equal(masked.heights[kept], heights[kept])
    assert np.isnan(masked.heights[~kept]).all()
    outside = int(((heights < below) | (heights > above)).sum())
    assert masked.steps[-1].startswith(f"masked {outside} node")


def test_the_number_of_spikes_is_said_and_many_are_warned_of() -> None:
    heights = np.random.default_rng(0).normal(size=(20, 31))
    heights[4, 5] = heights[19, 30] = -500
    clean = steps.despiked(topography(heights), 20)
    expected = "despiked: 2 nodes (0.323 %) further than 20 times the scatter from their local"
    assert clean.steps == (f"{expected} median",)
    assert not clean.warnings
    [warning] = steps.despiked(topography(heights), 0.5).warnings
    assert "raise --despike" in warning


@pytest.mark.parametrize("shape", [(30, 41), (20, 20), (21, 9)])
def test_a_form_is_taken_out_and_holes_stay(shape: tuple[int, int]) -> None:
    x, y = np.meshgrid(*(np.linspace(-1, 1, nodes) for nodes in shape), indexing="ij")
    heights = 5 + x**3 * y - 4 * y**4 + x
    heights[3, 4] = np.nan
    rest = steps.without_form(topography(heights), 4)
    assert np.isnan(rest.heights[3, 4])
    assert np.nanmax(np.abs(rest.heights)) < 1e-13
    assert "degree 4" in rest.steps[-1]


@pytest.mark.parametrize("boundary", ["free", "mirror"])
def test_both_filters_leave_the_band_between_them(boundary: Boundary) -> None:
    x = 0.5 * np.arange(801)
    short, band, long = (np.cos(2 * np.pi * x / length) for length in (3.0, 32.0, 380.0))
    heights = np.repeat((short + band + long)[:, None], 61, axis=1)
    filtered = steps.filtered(topography(heights, boundary), 10.0, 100.0)
    passed = 0.5 ** (100 / 1024) * (1 - 0.5 ** (10_000 / 1024))
    middle = slice(250, 550)
    rest = filtered.heights[middle, 30] - passed * band[middle]
    assert np.abs(rest).max() < 0.06
    assert "S-filter 10 um, L-filter 100 um" in filtered.steps[-1]
    assert filtered.steps[-1].endswith("mirrored at the borders") == (boundary == "mirror")
    assert filtered.sides == topography(heights, boundary).sides


def test_a_cut_off_of_four_spacings_is_one_though_lengths_are_rounded() -> None:
    """0.7 - 0.3 is less than 0.4 by rounding, and an instrument's spacing may be too."""
    heights = np.random.default_rng(0).normal(size=(30, 30))
    cut = replace(topography(heights), sides=(29 * 0.1 * (1 + 1e-15), 29 * 0.1))
    assert "S-filter 0.4 um" in steps.filtered(cut, 0.4, None).steps[-1]
    with pytest.raises(InputError, match=r"0\.399 um, is outside 0\.4 to 2\.9 um"):
        steps.filtered(cut, 0.399, None)


def test_steps_that_do_not_suit_the_map_are_refused() -> None:
    plane = topography(np.add.outer(np.arange(9.0), np.arange(7.0)))
    with pytest.raises(InputError, match=r"scan: --mask 50:60 leaves no height, they are 0 to 14"):
        steps.masked(plane, (50, 60))
    with pytest.raises(InputError, match="scan: --downsample 4 leaves fewer than 2 x 2 of 9 x 7"):
        steps.downsampled(plane, 4)
    with pytest.raises(InputError, match="scan: --form 7 has 36 coefficients, too many for 63 hei"):
        steps.without_form(plane, 7)
    few = np.full((9, 7), np.nan)
    few[::2, ::3] = 1.0
    with pytest.raises(InputError, match="--form 4 has 15 coefficients, too many for 15 heights"):
        steps.without_form(topography(few), 4)
    for cutoffs in ((1.0, None), (None, 9.0), (9.0, None)):
        with pytest.raises(InputError, match=r"-filter's cut-off, .* um, is outside 8 to 4 um, fo"):
            steps.filtered(plane, *cutoffs)
    with pytest.raises(InputError, match=r"scan: heights of 1e\+70 um; check their unit"):
        steps.require_useful_heights(topography(np.full((3, 3), -1e70)))
