"""Windows that are proposed for maps: their spacing and their size."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.draft.proposal import SIZES, common_spacing, window_nodes

SHAPES = st.lists(
    st.tuples(st.integers(4, 2000), st.integers(4, 2000)), min_size=1, max_size=30
)


@pytest.mark.parametrize(
    ("spacings", "chosen"),
    [
        ([1.0, 1.0, 1.0004], None),
        ([1.0] * 20 + [2.0], 1.0),  # one of many maps does not coarsen all others
        ([1.0] * 3 + [2.0], 2.0),
        ([1.0, 1.0, 30.0], 1.0),  # another instrument altogether
    ],
)
def test_the_common_spacing(spacings, chosen):
    assert common_spacing([(step, step) for step in spacings]) == chosen


@given(SHAPES, st.floats(1.0, 1000.0) | st.just(math.nan))
def test_most_maps_hold_the_windows_and_twice_if_any_size_fits_twice(shapes, length):
    nodes = window_nodes(shapes, length)
    sides = [min(shape) for shape in shapes if min(shape) >= SIZES[-1]]
    twice = sum(side >= 2 * SIZES[-1] for side in sides) >= 0.75 * len(sides)
    assert (nodes is None) == (not sides)
    if nodes is None:
        return
    assert nodes in SIZES
    assert sum(side >= (1 + twice) * nodes for side in sides) >= 0.75 * len(sides)
