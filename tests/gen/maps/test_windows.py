"""Tests of the tiles of maps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.maps.windows import DRAWS, Tiling, cut, drawn, turned

windows = st.tuples(st.integers(2, 12), st.integers(2, 12))


@st.composite
def tilings(draw):
    """Tilings of up to four maps, each as large as the window at least."""
    window = draw(windows)
    maps = draw(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 50)), min_size=1, max_size=4))
    return Tiling(tuple((window[0] + x, window[1] + y) for x, y in maps), window)


@given(tilings())
def test_tiles_cover_each_map_once_and_hold_a_window(tiling):
    for index, shape in enumerate(tiling.shapes):
        covered = np.zeros(shape, dtype=int)
        for number, (x0, x1), (y0, y1) in tiling.tiles[index]:
            assert number == index
            assert x1 - x0 >= tiling.window[0]
            assert y1 - y0 >= tiling.window[1]
            covered[x0:x1, y0:y1] += 1
        assert (covered == 1).all()


@pytest.mark.parametrize(
    ("nodes", "window", "tiles"),
    [(129, 129, 1), (257, 129, 1), (258, 129, 2), (515, 129, 2), (516, 129, 2), (774, 129, 3)],
)
def test_tiles_are_twice_as_wide_as_the_window_where_two_of_them_fit(nodes, window, tiles):
    assert Tiling(((nodes, nodes),), (window, window)).total == tiles**2


def stream(seed, surface):
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(surface,))))


def window_nodes(window, shape):
    """The nodes (map, x, y) of a window before it is turned round."""
    (x, y), (nx, ny) = window.corner, shape
    return {(window.map, i, j) for i in range(x, x + nx) for j in range(y, y + ny)}


@given(tilings(), st.integers(0, 2**63 - 1), st.lists(st.integers(0, 10**6), max_size=20))
def test_windows_of_different_tiles_share_no_node(tiling, seed, surfaces):
    """Rows are split by tile: whatever the parts of a split are, they share no node of a map."""
    taken: dict[tuple[int, int, int], int] = {}
    for surface in surfaces:
        window = drawn(stream(seed, surface), tiling, square=False)
        for node in window_nodes(window, tiling.window):
            assert taken.setdefault(node, window.tile) == window.tile


@given(tilings(), st.integers(0, 2**63 - 1), st.booleans())
def test_a_window_lies_in_its_tile(tiling, seed, square):
    window = drawn(stream(seed, 3), tiling, square=square)
    assert window == drawn(stream(seed, 3), tiling, square=square)
    _, *ends = tiling.tiles[window.map][window.tile - tiling.starts[window.map]]
    for corner, nodes, (start, stop) in zip(window.corner, tiling.window, ends, strict=True):
        assert start <= corner <= corner + nodes <= stop
    assert 0 <= window.symmetry < (8 if square else 4)


def test_maps_tiles_places_and_symmetries_are_uniform():
    """Counts of 20,000 draws within four standard deviations."""
    tiling = Tiling(((8, 8), (21, 10)), (5, 5))
    random = np.random.default_rng(5)
    draws = [drawn(random, tiling, square=True) for _ in range(20_000)]

    def check(values, share):
        _, counts = np.unique(values, return_counts=True, axis=0)
        assert counts.size == round(1 / share)
        expected = len(values) * share
        assert np.abs(counts - expected).max() < 4 * np.sqrt(expected)

    check([each.map for each in draws], 1 / 2)
    check([each.symmetry for each in draws], 1 / 8)
    check([each.corner for each in draws if each.map == 0], 1 / 16)
    wide = [each for each in draws if each.map == 1]
    check([each.tile for each in wide], 1 / 4)
    first = [each.corner for each in wide if each.tile == 1]
    check(first, 1 / 6)  # 10 x 5 nodes


def test_a_window_takes_as_many_numbers_as_it_says():
    one, other = np.random.default_rng(1), np.random.default_rng(1)
    drawn(one, Tiling(((9, 9),), (3, 3)), square=True)
    other.random(DRAWS)
    assert one.random() == other.random()


def test_the_eight_symmetries_are_those_of_the_square():
    patch = np.arange(9.0).reshape(3, 3) ** 2
    made = {turned(patch, symmetry).tobytes() for symmetry in range(8)}
    known = {np.rot90(side, k).tobytes() for k in range(4) for side in (patch, patch.T)}
    assert made == known
    assert len(made) == 8


@given(tilings(), st.integers(0, 2**32))
def test_a_window_holds_the_map_heights_above_its_lowest_node(tiling, seed):
    random = np.random.default_rng(seed)
    maps = [random.normal(size=shape) for shape in tiling.shapes]
    window = drawn(random, tiling, square=tiling.window[0] == tiling.window[1])
    heights = cut(maps[window.map], window, tiling.window)
    assert heights.shape == tiling.window
    assert heights.min() == 0.0
    assert heights.flags.c_contiguous
    (x, y), (nx, ny) = window.corner, tiling.window
    own = maps[window.map][x : x + nx, y : y + ny]
    assert np.array_equal(np.sort(heights, axis=None), np.sort(own - own.min(), axis=None))
