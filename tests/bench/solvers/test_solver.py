"""Exact solutions of the cases that solvers are measured on, and their margins."""

from dataclasses import replace

import numpy as np
import pytest

from bench.peers import sample
from bench.references.dense import press
from bench.solvers.solver import EXACT_RTOL, Case, find_exact
from bench.work_precision import paper_case


@pytest.mark.parametrize("kernel", ["uniform-pressure", "concentrated-force"])
def test_exact_solutions_are_exact(kernel):
    case = paper_case(3, 17, kernel)
    dense, _ = press(case.heights, case.delta, case.kernel)
    exact = find_exact(case)
    assert exact.pressure == pytest.approx(dense * case.delta / case.spacing, rel=0, abs=1e-12)
    assert exact.contact_share == np.count_nonzero(dense) / dense.size


@pytest.mark.parametrize("hardness", [None, 0.05])
def test_exact_solutions_are_proved(hardness):
    """A solve that is off by a relative error of 1e-8 is found out."""
    case = replace(sample(33, 25.0, hardness))  # another object: not found in the cache
    right = case.solve(EXACT_RTOL)
    wrong = replace(right, pressure=right.pressure * (1 - 1e-8))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Case, "solve", lambda *_: wrong)
        with pytest.raises(ArithmeticError, match="uniform-pressure: no exact solution"):
            find_exact(case)
    assert find_exact(case).rtol == EXACT_RTOL
