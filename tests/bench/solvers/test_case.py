"""Exact solutions of the cases that solvers are measured on, and their margins."""

from dataclasses import replace

import numpy as np
import pytest

from bench.peers import sample
from bench.references.dense import press
from bench.solvers import case as cases
from bench.solvers.case import Case, find_exact
from bench.work_precision import paper_case


@pytest.fixture(scope="module")
def small() -> Case:
    return paper_case(0, 33)


@pytest.fixture(scope="module")
def case() -> Case:
    return sample(33, 25.0)


@pytest.mark.parametrize("kernel", ["uniform-pressure", "concentrated-force"])
def test_exact_solutions_are_exact(kernel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    case = paper_case(3, 17, kernel)
    dense, _ = press(case.heights, case.delta, case.kernel)
    exact = find_exact(case)
    assert exact.method == "dense"
    assert exact.pressure == pytest.approx(dense * case.delta / case.spacing, rel=0, abs=1e-12)
    assert exact.contact_share == np.count_nonzero(dense) / dense.size
    monkeypatch.setattr(cases, "DENSE_NODES", 0)
    tight = find_exact(replace(case))  # another object: not found in the cache
    assert tight.method == "rtol 1e-14"
    assert tight.pressure == pytest.approx(exact.pressure, rel=0, abs=1e-12)
    assert tight.force == pytest.approx(exact.force, rel=1e-13)


def test_exact_solutions_are_proved(small: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """A guess of the contact nodes that is one node off is found out, and corrected, either way."""
    right, nobody = find_exact(small).pressure, np.zeros(small.heights.shape, bool)
    for node in (np.argmax(right > 0), np.argmin(right > 0)):
        wrong = (right > 0).reshape(-1)
        wrong[node] = not wrong[node]
        guess = wrong.reshape(right.shape)
        found = cases.proved_pressure(small, guess, nobody) * (small.delta / small.spacing)
        np.testing.assert_allclose(found, right, rtol=0, atol=1e-13)
    monkeypatch.setattr(cases, "CORRECTIONS", 1)
    with pytest.raises(ArithmeticError, match="paper 0, uniform-pressure: no exact solution"):
        cases.proved_pressure(small, np.zeros_like(nobody), nobody)
