"""The paper's algorithm as the benchmark runs it: exact, and one dense solve a node."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls as scipy_nnls

import bem
from bem.influence import KERNELS, Kernel
from bench.references import dense, nnls


def rough(nodes: int = 33, seed: int = 0) -> np.ndarray:
    """A random walk with a range of heights of 10."""
    random = np.random.default_rng(seed)
    walk = np.cumsum(np.cumsum(random.standard_normal((nodes, nodes)), axis=0), axis=1)
    return 10 * walk / np.ptp(walk)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("delta", [0.5, 2.0, 5.0])
def test_pressure_is_that_of_the_solver_and_of_the_dense_reference(
    delta: float, kernel: Kernel
) -> None:
    heights = rough()
    pressure, _ = nnls.press(heights, delta, kernel=kernel, rtol=1e-12)
    contact = bem.solve(heights, 320.0, delta, kernel=kernel, rtol=1e-12)
    expected, _ = dense.press(heights, delta, kernel)
    np.testing.assert_allclose(pressure, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(pressure * delta / 10.0, contact.pressure, rtol=0, atol=1e-9)


@settings(max_examples=50)
@given(seed=st.integers(0, 2**32 - 1), data=st.data())
def test_any_positive_definite_problem_is_solved(seed: int, data: st.DataObject) -> None:
    """Nodes that come into contact too early are released again."""
    random = np.random.default_rng(seed)
    size = data.draw(st.integers(1, 12))
    root = random.standard_normal((size + 4, size))
    matrix, interference = root.T @ root, random.standard_normal(size)
    pressure, _ = nnls.solve(matrix, interference, rtol=1e-12)
    factor = np.linalg.cholesky(matrix)
    expected, _ = scipy_nnls(factor.T, np.linalg.solve(factor, interference))
    assert (pressure >= 0).all()
    np.testing.assert_allclose(pressure, expected, rtol=1e-7, atol=1e-10)


def test_a_node_that_entered_too_early_is_released() -> None:
    """The stiff one overlaps most and enters first; the soft one pulls it off: three solves."""
    matrix = np.array([[4.0, 1.9], [1.9, 1.0]])
    pressure, solves = nnls.solve(matrix, np.array([1.0, 0.9]), rtol=1e-12)
    np.testing.assert_allclose(pressure, [0.0, 0.9], rtol=1e-14)
    assert solves == 3


def test_contacts_take_a_solve_for_each_node() -> None:
    """So the time grows with the fourth power of their number."""
    heights = rough(65, seed=3)
    pressure, solves = nnls.press(heights, 3.0)
    touching = np.count_nonzero(pressure)
    assert touching > 100
    assert touching <= solves < 1.2 * touching


def test_full_contact() -> None:
    matrix = dense.influence_matrix((3, 3), "uniform-pressure")
    pressure, solves = nnls.solve(matrix, np.ones(9))
    np.testing.assert_allclose(matrix @ pressure, 1.0, rtol=1e-13)
    assert solves == 9


def test_loose_tolerances_stop_early() -> None:
    heights = rough()
    loose, few = nnls.press(heights, 5.0, rtol=0.1)
    _, many = nnls.press(heights, 5.0, rtol=1e-8)
    assert few < many
    moved = dense.displace(loose, "uniform-pressure")
    gap = moved - ((heights - heights.max()) / 5.0 + 1)
    assert -0.1 <= gap.min() < 0


def test_matrices_that_are_not_positive_definite_are_refused() -> None:
    with pytest.raises(ArithmeticError, match="positive definite"):
        nnls.solve(np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([1.0, 0.5]))
