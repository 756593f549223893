"""Tests of the tiles of maps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.scans.tiles import Pairing, Tiling, tiles_along

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
        for place in range(tiling.number(index)):
            (x0, x1), (y0, y1) = tiling.bounds(index, place)
            assert x1 - x0 >= tiling.window[0]
            assert y1 - y0 >= tiling.window[1]
            covered[x0:x1, y0:y1] += 1
        assert (covered == 1).all()


@given(tilings())
def test_tiles_are_numbered_over_all_maps(tiling):
    numbers = [
        tiling.first(index) + place
        for index in range(len(tiling.shapes))
        for place in range(tiling.number(index))
    ]
    assert numbers == list(range(tiling.total))


@pytest.mark.parametrize(
    ("nodes", "window", "tiles"),
    [(129, 129, 1), (257, 129, 1), (258, 129, 2), (515, 129, 2), (516, 129, 2), (774, 129, 3)],
)
def test_tiles_are_twice_as_wide_as_the_window_where_two_of_them_fit(nodes, window, tiles):
    assert tiles_along(nodes, window) == tiles


def test_a_map_smaller_than_the_window_has_no_tiles():
    with pytest.raises(ValueError, match=r"\(9, 5\) nodes holds no window of \(9, 6\)"):
        Tiling(((20, 20), (9, 5)), (9, 6))


@given(st.integers(1, 60), st.integers(1, 60))
def test_tiles_of_two_sets_are_in_one_group_each(first, second):
    pairing = Pairing(first, second)
    faced: dict[int, int] = {}
    for tile in range(first):
        partners = pairing.partners(tile)
        assert len(partners) >= 1
        for partner in partners:
            assert faced.setdefault(partner, pairing.group(tile)) == pairing.group(partner)
    assert set(faced) == set(range(second)), "every tile of the second set is taken"
    assert {pairing.group(tile) for tile in range(first)} == set(range(min(first, second)))


def test_a_tile_of_the_same_maps_faces_itself():
    pairing = Pairing(7, 7)
    assert [list(pairing.partners(tile)) for tile in range(7)] == [[tile] for tile in range(7)]


@given(tilings())
def test_every_tile_has_its_map(tiling):
    for index in range(len(tiling.shapes)):
        for place in range(tiling.number(index)):
            assert tiling.map_of(tiling.first(index) + place) == index
