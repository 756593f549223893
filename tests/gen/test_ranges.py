"""The flag of values beyond a range, and its margin."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.ranges import MARGIN, margins, outside

NUMBER = np.array([False])
LOGARITHM = np.array([True])


def is_flagged(value, low, high, is_logarithm=NUMBER):
    ends = np.array([low]), np.array([high])
    margin = margins(*ends, is_logarithm)
    return bool(outside(np.array([[value]]), *ends, margin)[0, 0])


@given(
    st.floats(1e-6, 1e6),
    st.floats(1.0, 100.0),
    st.sampled_from([1.0, -1.0]),
)
def test_a_value_is_flagged_if_it_is_beyond_by_more_than_the_margin(low, ratio, sign):
    """The margin is relative to the value, however narrow the range is."""
    ends = sorted((sign * low, sign * low * ratio))
    largest = low * ratio
    assert not is_flagged(sign * largest * (1 + 0.9 * MARGIN), *ends)
    assert is_flagged(sign * largest * (1 + 1.1 * MARGIN), *ends)


@given(st.floats(-20.0, 20.0), st.floats(0.0, 5.0))
def test_the_margin_of_a_logarithm_is_that_of_its_number(low, width):
    high = low + width
    within = np.log1p(0.9 * MARGIN)
    beyond = np.log1p(1.1 * MARGIN)
    for value, flagged in (
        (high + within, False),
        (high + beyond, True),
        (low - within, False),
        (low - beyond, True),
    ):
        assert is_flagged(value, low, high, LOGARITHM) is flagged


@pytest.mark.parametrize(("value", "flagged"), [(0.0, False), (1e-300, True)])
def test_a_feature_that_is_0_everywhere_has_no_margin(value, flagged):
    assert is_flagged(value, 0.0, 0.0) is flagged


def test_undefined_values_are_not_flagged():
    assert not is_flagged(np.nan, 1.0, 2.0)
