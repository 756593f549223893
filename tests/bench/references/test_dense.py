"""Contact by dense matrices: elastic, with a hardness, without edges; the paper's algorithm."""

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.optimize import nnls

import bem
import bem.influence
from bem.bodies import KERNELS
from bench.references import dense, half_space
from bench.references.edgeless import Patch
from bench.references.surfaces import SURFACES, surface


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
    heights = 5 * surface("white noise", (9, 11), seed)
    matrix = dense.influence_matrix(heights.shape, kernel)
    interference = (heights - heights.max()).reshape(-1) + 0.5 * (seed + 1)
    factor = np.linalg.cholesky(matrix)
    expected, _ = nnls(factor.T, np.linalg.solve(factor, interference), maxiter=10_000)
    for start in (None, np.full(heights.size, -1), np.zeros(heights.size, int)):
        found = dense.solve(matrix, interference, start)
        np.testing.assert_allclose(found, expected, atol=1e-10 * expected.max())


def test_dense_solve_certifies_what_it_returns(monkeypatch):
    heights = 5 * surface("white noise", (9, 11))
    monkeypatch.setattr(dense, "EXCHANGES", 1)
    with pytest.raises(ArithmeticError, match="still wrong"):
        dense.press(heights, 1.0, "uniform-pressure")
    monkeypatch.undo()
    monkeypatch.setattr(dense, "cho_solve", lambda _factor, values: values)
    with pytest.raises(ArithmeticError, match="gap of"):
        dense.press(np.zeros((3, 3)), 1.0, "uniform-pressure")


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("delta", [0.5, 5.0])
def test_pressure_is_that_of_the_solver_and_of_the_dense_reference(delta, kernel):
    heights = 10 * surface("random walk", (33, 33))
    pressure = dense.press_by_nnls(heights, delta, kernel=kernel, rtol=1e-12)
    contact = bem.solve(heights, 320.0, delta, kernel=kernel, rtol=1e-12)
    expected, _ = dense.press(heights, delta, kernel)
    np.testing.assert_allclose(pressure, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        pressure * delta / 10.0, contact.pressure, rtol=0, atol=1e-9
    )


@pytest.mark.parametrize("share", [0.9, 0.1])
@pytest.mark.parametrize("kind", SURFACES)
def test_conditions_of_contact_hold(kind, share):
    contact = surface(kind, (9, 7), seed=3), 0.6
    hardness = share * dense.press_yielding(*contact, 1e3, KERNELS[0])[0].max()
    pressure, gap = dense.press_yielding(*contact, hardness, KERNELS[0])
    yielded = pressure == hardness
    assert yielded.any()
    assert (pressure >= 0).all()
    assert pressure.max() <= hardness
    assert gap[pressure == 0].min(initial=0.0) >= -1e-11
    assert gap[yielded].max() <= 1e-11
    assert np.abs(gap[(pressure > 0) & ~yielded]).max(initial=0.0) < 1e-11


SIDES = (3.0, 5.0)


@pytest.mark.parametrize("shape", [(6, 7), (5, 8), (1, 4), (9, 1), (1, 1)])
def test_periodic_matrix_is_a_product_of_transforms(shape):
    pressure = np.random.default_rng(0).random(shape)
    found = Patch(pressure, SIDES, "periodic").matrix @ pressure.reshape(-1)
    axes = [
        np.fft.fftfreq(nodes, side / nodes)
        for nodes, side in zip(shape, SIDES, strict=True)
    ]
    wave_numbers = 2 * np.pi * np.hypot.outer(*axes)
    wave_numbers[0, 0] = np.inf
    moved = np.fft.ifft2(np.fft.fft2(pressure) * (2 / wave_numbers)).real
    np.testing.assert_allclose(found.reshape(shape), moved, atol=1e-14)


@pytest.mark.parametrize("ratio", [2.0, None])
@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize("kind", SURFACES)
def test_conditions_of_contact_without_edges_hold(kind, boundary, ratio):
    """The hardness is over the mean pressure."""
    shape = (9, 6)
    load = 0.1 * max(Patch(surface(kind, shape), SIDES, boundary).full_contact_load, 1.0)
    hardness = np.inf if ratio is None else ratio * load / 54
    patch = Patch(surface(kind, shape), SIDES, boundary, hardness)
    pressure = patch.press(load).reshape(-1)
    assert pressure.sum() == pytest.approx(load, rel=1e-11)
    assert 0 <= pressure.min() <= pressure.max() <= hardness
    gap = patch.matrix @ pressure - patch.below
    touching, yielded = pressure > 0, pressure >= hardness
    # Gaps from the displacement on: at most 0 under pressure, at least 0 where nothing yields.
    assert gap[touching].max() <= gap[~yielded].min(initial=np.inf) + 1e-10
