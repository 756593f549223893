"""The spacing and the windows that are proposed for maps of several sizes."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.draft.windows import SIZES, WIDER, common_spacing, window_nodes

SHAPES = st.lists(st.tuples(st.integers(4, 2000), st.integers(4, 2000)), min_size=1, max_size=30)


@pytest.mark.parametrize(
    ("spacings", "chosen"),
    [
        ([1.0, 1.0, 1.0004], None),
        ([0.5, 1.0], 1.0),
        ([1.0] * 20 + [2.0], 1.0),  # one of many maps does not coarsen all others
        ([1.0] * 3 + [2.0], 2.0),
        ([1.0, 1.0, 30.0], 1.0),  # another instrument altogether
        ([0.3, 0.4, 0.5, 0.6], 0.6),
    ],
)
def test_the_common_spacing(spacings, chosen):
    assert common_spacing([(each, each) for each in spacings]) == chosen


def test_oblong_cells_are_kept_if_all_maps_have_them():
    assert common_spacing([(0.8, 1.0)] * 3) is None
    assert common_spacing([(0.8, 1.0), (1.0, 1.0)]) == 1.0


@given(SHAPES, st.floats(1.0, 1000.0) | st.just(math.nan))
def test_most_maps_hold_the_windows_and_twice_if_any_size_fits_twice(shapes, length):
    nodes = window_nodes(shapes, length)
    sides = [min(shape) for shape in shapes if min(shape) >= SIZES[-1]]
    twice = sum(side >= 2 * SIZES[-1] for side in sides) >= 0.75 * len(sides)
    assert (nodes is None) == (not sides)
    if nodes is None:
        return
    assert nodes in (*SIZES, *WIDER)
    assert sum(side >= (1 + twice) * nodes for side in sides) >= 0.75 * len(sides)


def test_long_waves_ask_for_wider_windows():
    assert window_nodes([(1000, 1000)], 10.0) == 128
    assert window_nodes([(1000, 1000)], 35.0) == 192
    assert window_nodes([(1000, 1000)], 200.0) == 256
    assert window_nodes([(400, 400)], 200.0) == 192
    assert window_nodes([(300, 300)], 200.0) == 128
