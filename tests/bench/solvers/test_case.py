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
        with monkeypatch.context() as patched:
            patched.setattr(cases, "CORRECTIONS", 1)
            with pytest.raises(ArithmeticError, match="paper 0, uniform-pressure: no exact sol"):
                cases.proved_pressure(small, guess, nobody)


def test_a_coarser_grid_sees_means(small: Case) -> None:
    exact = find_exact(small)
    coarse = exact.on_grid(9)
    assert coarse.pressure.shape == (9, 9)
    assert (coarse.force, coarse.contact_share) == (exact.force, exact.contact_share)
    assert coarse.pressure.sum() * 16 == pytest.approx(exact.pressure.sum(), rel=1e-14)
    level = replace(exact, pressure=np.ones((33, 33))).on_grid(17).pressure
    assert level[1:-1, 1:-1] == pytest.approx(1.0, rel=1e-15)
    spot = np.zeros((33, 33))
    spot[6, 8] = 16.0  # on the border between the cells of the coarse nodes 1 and 2, in line with 2
    seen = replace(exact, pressure=spot).on_grid(9).pressure
    assert {(*map(int, node),): seen[tuple(node)] for node in np.argwhere(seen)} == {
        (1, 2): 0.5,
        (2, 2): 0.5,
    }
