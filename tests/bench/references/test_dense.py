"""Contact by the dense matrix: elastic, with a hardness, and the paper's algorithm."""

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.optimize import nnls

import bem
import bem.influence
from bem.influence import KERNELS
from bench.references import dense, half_space
from bench.references.surfaces import SURFACES, surface

Shape = tuple[int, int]


def random_heights(shape=(9, 11), seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


@pytest.mark.parametrize("aspect", [1.0, 64.0])
@pytest.mark.parametrize("offset", [(1, 0), (3, 1)])
def test_coefficients_are_the_integral_over_a_cell(offset, aspect):
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
@pytest.mark.parametrize("seed", range(3))
def test_dense_solve_is_nonnegative_least_squares(seed, kernel):
    heights = random_heights(seed=seed)
    matrix = dense.influence_matrix(heights.shape, kernel)
    interference = (heights - heights.max()).reshape(-1) + 0.5 * (seed + 1)
    factor = np.linalg.cholesky(matrix)
    expected, _ = nnls(factor.T, np.linalg.solve(factor, interference), maxiter=10_000)
    for start in (None, np.full(heights.size, -1), np.zeros(heights.size, int)):
        found = dense.solve(matrix, interference, start)
        np.testing.assert_allclose(found, expected, atol=1e-10 * expected.max())


def test_dense_solve_certifies_what_it_returns(monkeypatch):
    heights = random_heights()
    monkeypatch.setattr(dense, "EXCHANGES", 1)
    with pytest.raises(ArithmeticError, match="still wrong"):
        dense.press(heights, 1.0, "uniform-pressure")
    monkeypatch.undo()
    monkeypatch.setattr(dense, "cho_solve", lambda _factor, values: values)
    with pytest.raises(ArithmeticError, match="gap of"):
        dense.press(np.zeros((3, 3)), 1.0, "uniform-pressure")


def rough(nodes=33, seed=0):
    """A random walk with a range of heights of 10."""
    random = np.random.default_rng(seed)
    walk = np.cumsum(np.cumsum(random.standard_normal((nodes, nodes)), axis=0), axis=1)
    return 10 * walk / np.ptp(walk)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("delta", [0.5, 5.0])
def test_pressure_is_that_of_the_solver_and_of_the_dense_reference(delta, kernel):
    heights = rough()
    pressure = dense.press_by_nnls(heights, delta, kernel=kernel, rtol=1e-12)
    contact = bem.solve(heights, 320.0, delta, kernel=kernel, rtol=1e-12)
    expected, _ = dense.press(heights, delta, kernel)
    np.testing.assert_allclose(pressure, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(pressure * delta / 10.0, contact.pressure, rtol=0, atol=1e-9)


SHAPE = (9, 7)


def press(kind, hardness, delta=0.6, kernel="uniform-pressure"):
    heights = surface(kind, SHAPE, seed=3)
    return heights, *dense.press_yielding(heights, delta, hardness, kernel)


@pytest.mark.parametrize("share", [0.9, 0.1])
@pytest.mark.parametrize("kind", SURFACES)
def test_conditions_of_contact_hold(kind, share):
    elastic = press(kind, 1e3)[1].max()
    _, pressure, gap = press(kind, share * elastic)
    yielded = pressure == share * elastic
    assert yielded.any()
    assert (pressure >= 0).all()
    assert pressure.max() <= share * elastic
    assert gap[pressure == 0].min(initial=0.0) >= -1e-11
    assert gap[yielded].max() <= 1e-11
    assert np.abs(gap[(pressure > 0) & ~yielded]).max(initial=0.0) < 1e-11
