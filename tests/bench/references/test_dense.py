"""Contact by the dense matrix: elastic, with a hardness, and the paper's algorithm."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad
from scipy.optimize import nnls
from scipy.optimize import nnls as scipy_nnls

import bem
import bem.influence
from bem.influence import KERNELS, Kernel
from bench.references import dense, half_space
from bench.references.surfaces import SURFACES, surface

Shape = tuple[int, int]


def random_heights(shape: Shape = (9, 11), seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(shape)


@pytest.mark.parametrize("aspect", [1.0, 64.0, 0.3])
@pytest.mark.parametrize("offset", [(1, 0), (0, 2), (3, 1), (4, 5)])
def test_coefficients_are_the_integral_over_a_cell(offset: Shape, aspect: float) -> None:
    x, y = offset[0], offset[1] * aspect
    expected, _ = dblquad(
        lambda v, u: 1 / (np.pi * np.hypot(x - u, y - v)),
        *(-0.5, 0.5, -0.5 * aspect, 0.5 * aspect),
        epsabs=0,
        epsrel=1e-10,
    )
    table = half_space.influence_coefficients((5, 6), "uniform-pressure", aspect)
    assert table[offset] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("kernel", KERNELS)
def test_coefficients_agree_with_those_of_the_solver(kernel: Kernel) -> None:
    """Which integrates by quadrature from three cells on, where this cancels."""
    ours = half_space.influence_coefficients((129, 129), kernel)
    np.testing.assert_allclose(ours, bem.influence.influence_coefficients((129, 129), kernel), 1e-9)


@pytest.mark.parametrize("kernel", KERNELS)
def test_convolution_is_the_product_with_the_matrix(kernel: Kernel) -> None:
    pressure = random_heights()
    moved = dense.influence_matrix(pressure.shape, kernel) @ pressure.reshape(-1)
    convolved = half_space.displacement(pressure, kernel)
    np.testing.assert_allclose(convolved.reshape(-1), moved, atol=1e-13)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("seed", range(10))
def test_dense_solve_is_nonnegative_least_squares(seed: int, kernel: Kernel) -> None:
    heights = random_heights(seed=seed)
    matrix = dense.influence_matrix(heights.shape, kernel)
    interference = (heights - heights.max()).reshape(-1) + 0.5 * (seed + 1)
    factor = np.linalg.cholesky(matrix)
    expected, _ = nnls(factor.T, np.linalg.solve(factor, interference), maxiter=10_000)
    for start in (None, np.full(heights.size, -1), np.zeros(heights.size, int)):
        found = dense.solve(matrix, interference, start)
        np.testing.assert_allclose(found, expected, atol=1e-10 * expected.max())


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("share", [0.2, 0.9, 0.999])
def test_compliant_far_field_is_a_rigid_one_at_its_own_approach(
    share: float, kernel: Kernel
) -> None:
    heights = random_heights()
    delta = share * half_space.critical_delta(heights, kernel)
    pressure, gap = dense.press_compliant(heights, delta, kernel)
    stiffness = half_space.flat_punch(heights.shape, kernel).sum()
    approach = 1 + pressure.sum() / stiffness
    rigid, rigid_gap = dense.press(heights, delta * approach, kernel)
    np.testing.assert_allclose(pressure, rigid * approach, atol=1e-9 * pressure.max())
    np.testing.assert_allclose(gap, rigid_gap * approach, atol=1e-9 * pressure.max())


def test_full_contact_begins_at_its_delta() -> None:
    heights = random_heights()
    delta = dense.full_contact_delta(heights, "uniform-pressure")
    short, _ = dense.press(heights, delta * (1 - 1e-6), "uniform-pressure")
    beyond, _ = dense.press(heights, delta * (1 + 1e-6), "uniform-pressure")
    assert np.count_nonzero(short) == heights.size - 1
    assert np.count_nonzero(beyond) == heights.size


def test_dense_solve_certifies_what_it_returns(monkeypatch: pytest.MonkeyPatch) -> None:
    heights = random_heights()
    monkeypatch.setattr(dense, "EXCHANGES", 1)
    with pytest.raises(ArithmeticError, match="still wrong"):
        dense.press(heights, 1.0, "uniform-pressure")
    monkeypatch.undo()
    monkeypatch.setattr(dense, "cho_solve", lambda _factor, values: values)
    with pytest.raises(ArithmeticError, match="gap of"):
        dense.press(np.zeros((3, 3)), 1.0, "uniform-pressure")


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
    pressure, _ = dense.press_by_nnls(heights, delta, kernel=kernel, rtol=1e-12)
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
    pressure, _ = dense.solve_by_nnls(matrix, interference, rtol=1e-12)
    factor = np.linalg.cholesky(matrix)
    expected, _ = scipy_nnls(factor.T, np.linalg.solve(factor, interference))
    assert (pressure >= 0).all()
    np.testing.assert_allclose(pressure, expected, rtol=1e-7, atol=1e-10)


def test_matrices_that_are_not_positive_definite_are_refused() -> None:
    with pytest.raises(ArithmeticError, match="positive definite"):
        dense.solve_by_nnls(np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([1.0, 0.5]))


SHAPE = (9, 7)


def press(kind: str, hardness: float, delta: float = 0.6, kernel: Kernel = "uniform-pressure"):
    heights = surface(kind, SHAPE, seed=3)
    return heights, *dense.press_yielding(heights, delta, hardness, kernel)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("kind", SURFACES)
def test_a_hardness_above_all_pressures_gives_the_elastic_solution(
    kind: str, kernel: Kernel
) -> None:
    heights, pressure, _ = press(kind, 1e3, kernel=kernel)
    elastic, _ = dense.press(heights, 0.6, kernel)
    np.testing.assert_allclose(pressure, 0.6 * elastic, atol=1e-9)


@pytest.mark.parametrize("kind", SURFACES)
def test_a_vanishing_hardness_gives_the_bearing_area(kind: str) -> None:
    heights, pressure, gap = press(kind, 1e-9)
    bearing = heights > heights.max() - 0.6
    np.testing.assert_array_equal(pressure, np.where(bearing, 1e-9, 0.0))
    np.testing.assert_allclose(-gap, heights - heights.max() + 0.6, atol=1e-7)


@pytest.mark.parametrize("share", [0.9, 0.5, 0.1])
@pytest.mark.parametrize("kind", SURFACES)
def test_conditions_of_contact_hold(kind: str, share: float) -> None:
    elastic = press(kind, 1e3)[1].max()
    _, pressure, gap = press(kind, share * elastic)
    yielded = pressure == share * elastic
    assert yielded.any()
    assert (pressure >= 0).all()
    assert pressure.max() <= share * elastic
    assert gap[pressure == 0].min(initial=0.0) >= -1e-11
    assert gap[yielded].max() <= 1e-11
    assert np.abs(gap[(pressure > 0) & ~yielded]).max(initial=0.0) < 1e-11


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("kind", SURFACES)
def test_growing_the_yielded_set_is_least_squares(kind: str, kernel: Kernel) -> None:
    heights = surface(kind, SHAPE, seed=4)
    for hardness in (0.02, 0.1, 0.4):
        expected, _ = dense.press_yielding(heights, 1.5, hardness, kernel)
        found, _ = dense.press_yielding(heights, 1.5, hardness, kernel, 1.0, dense.by_growth)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_a_solution_that_breaks_them_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dense, "cho_solve", lambda _factor, values: values)
    with pytest.raises(ArithmeticError, match="dense solve: "):
        press("white noise", 0.3, 2.0)
