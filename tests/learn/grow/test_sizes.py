"""Sizes of a growing database, and the risks of its looks."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from learn.grow.sizes import RISK, SMALLEST_SURFACES, Sizes, risk


@given(st.integers(1, 400))
def test_sizes_are_whole_surfaces_that_grow_by_about_the_square_root_of_two(per_surface):
    sizes = Sizes(per_surface)
    rows = [sizes.rows(number) for number in range(16)]
    assert rows[0] >= max(60, SMALLEST_SURFACES * per_surface)
    for small, large in itertools.pairwise(rows):
        assert large % per_surface == 0
        assert 1.2 < large / small < 1.65
    assert [sizes.number(each) for each in rows] == list(range(16))
    assert sizes.number(rows[3] + 1) == 4


def test_the_risks_of_all_looks_together_are_the_risk_that_is_stated():
    assert sum(risk(number) for number in range(10_000)) == pytest.approx(RISK, rel=1e-3)
    assert sum(risk(number) for number in range(10_000)) < RISK
