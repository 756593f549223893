"""Spikes that are planted are found, and only they; everything else keeps every bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.measured import despiking
from gen.measured.despiking import WINDOW, local_medians, without_spikes
from gen.surface import generate


def planted_nodes(shape: tuple[int, int], random: np.random.Generator) -> np.ndarray:
    """Some nodes, alone in their neighbourhoods as dust is; borders and corners too."""
    nodes = np.zeros(shape, dtype=bool)
    for x in range(0, shape[0], WINDOW):
        for y in range(0, shape[1], WINDOW):
            nodes[x, y] = random.random() < 0.3
    return nodes


@given(st.integers(0, 2**32 - 1), st.integers(16, 40), st.integers(16, 41))
def test_planted_spikes_are_found_and_only_they(seed: int, nx: int, ny: int) -> None:
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    clean = random.normal(size=(nx, ny)) + random.normal() * 20 * x + random.normal() * 20 * y
    planted = planted_nodes((nx, ny), random)
    signs = random.choice([-1, 1], size=(nx, ny))
    heights = np.where(planted, clean + signs * 3000, clean)
    despiked, spikes = without_spikes(heights, 25)
    assert np.array_equal(spikes, planted)
    assert np.array_equal(despiked[~planted], clean[~planted])
    assert np.abs(despiked - clean)[planted].max(initial=0) < 300


@given(st.integers(0, 2**32 - 1))
def test_holes_are_neither_spikes_nor_neighbours(seed: int) -> None:
    random = np.random.default_rng(seed)
    heights = random.normal(size=(23, 30))
    heights[4:14, 6:20] = np.nan
    heights[random.random(heights.shape) < 0.2] = np.nan
    heights[3, 8] = 1000.0
    despiked, spikes = without_spikes(heights, 20)
    assert np.argwhere(spikes).tolist() == [[3, 8]]
    assert np.array_equal(np.isnan(despiked), np.isnan(heights))


@pytest.mark.parametrize("shape", [(9, 12), (12, 9), (7, 7), (2, 3)])
def test_medians_are_those_of_numpy_on_the_local_slope(shape: tuple[int, int]) -> None:
    random = np.random.default_rng(3)
    heights = np.where(random.random(shape) < 0.3, np.nan, random.normal(size=shape))
    heights[0, 0] = 1.0
    padded = np.pad(heights, 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (WINDOW, WINDOW))
    steps = np.arange(-2, 3)
    for (x, y), median in np.ndenumerate(local_medians(heights)):
        window = windows[x, y]
        slopes = [np.diff(window, axis=axis) for axis in (0, 1)]
        along_x, along_y = (0.0 if np.isnan(each).all() else np.nanmedian(each) for each in slopes)
        expected = np.nanmedian(window - along_x * steps[:, None] - along_y * steps)
        assert median == pytest.approx(expected, rel=1e-12)


def test_a_slope_with_holes_has_no_spikes() -> None:
    random = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(-80, 80, 61), np.linspace(-60, 60, 52), indexing="ij")
    heights = -(x**2 + y**2) / 10_000 + 0.01 * x + random.normal(0, 2e-4, x.shape)
    heights[random.random(x.shape) < 0.1] = np.nan
    heights[10:22, 30:41] = np.nan
    assert not without_spikes(heights, 15)[1].any()


@pytest.mark.parametrize("rows", [1, 3, 1000])
def test_medians_do_not_depend_on_the_rows_taken_together(
    monkeypatch: pytest.MonkeyPatch, rows: int
) -> None:
    heights = np.random.default_rng(0).normal(size=(65, 33))
    expected = local_medians(heights)
    monkeypatch.setattr(despiking, "ROWS", rows)
    assert np.array_equal(local_medians(heights), expected)


def test_planes_and_flat_maps_have_no_spikes_but_what_stands_out_of_them() -> None:
    for slope in (0.0, 0.3):
        plane = 1e3 + slope * np.add.outer(np.arange(11.0), 2 * np.arange(8.0))
        assert not without_spikes(plane, 7)[1].any()
        plane[5, 4] += 0.5
        despiked, spikes = without_spikes(plane, 7)
        assert np.argwhere(spikes).tolist() == [[5, 4]]
        assert despiked[5, 4] == pytest.approx(plane[5, 4] - 0.5)


@pytest.mark.parametrize("seed", range(20))
def test_fractal_surfaces_have_no_spikes(seed: int) -> None:
    rough = generate("diamond-square", 65, 0.65, 12.5, np.random.default_rng(seed))
    assert not without_spikes(rough, 7)[1].any()
