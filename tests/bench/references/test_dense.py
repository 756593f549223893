"""The references that the solver is held against, held against SciPy and against each other."""

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.optimize import nnls

import bem.influence
from bem.influence import KERNELS, Kernel
from bench.references import dense, half_space

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


@pytest.mark.parametrize(("kernel", "smallest"), [(KERNELS[0], 0.58), (KERNELS[1], 0.08)])
def test_how_well_a_kernel_resists_short_waves(kernel: Kernel, smallest: float) -> None:
    """The figures that the stability table gives as a reason."""
    eigenvalues = np.linalg.eigvalsh(dense.influence_matrix((33, 33), kernel))
    assert eigenvalues[0] == pytest.approx(smallest, abs=0.005)


@pytest.mark.parametrize("aspect", [1.0, 5.0])
def test_flat_punch_moves_all_nodes_by_one(aspect: float) -> None:
    punch = half_space.flat_punch((7, 12), "uniform-pressure", aspect)
    moved = dense.influence_matrix((7, 12), "uniform-pressure", aspect) @ punch.reshape(-1)
    np.testing.assert_allclose(moved, 1, rtol=1e-11)


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
