"""Our own solvers: the same answer in both precisions."""

import numpy as np
import pytest

import bem
from bench.solvers.own import DOUBLE, MIXED
from bench.work_precision.studies import paper_case


def test_both_precisions_end_in_the_same_answer() -> None:
    small = paper_case(0, 33)
    mixed, double = MIXED.solve(small, 1e-12), DOUBLE.solve(small, 1e-12)
    assert mixed.pressure == pytest.approx(double.pressure, rel=0, abs=1e-11)
    np.testing.assert_array_equal(mixed.pressure > 0, double.pressure > 0)
    whole = bem.solve(small.heights, small.side, small.delta, rtol=1e-12)
    assert double.pressure == pytest.approx(whole.pressure, rel=0, abs=1e-11)
