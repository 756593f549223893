"""The active set against a dense reference, and its end where rounding stops it."""

import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

import bem
from bem.active_set import FROM_NEAR, descend, solve_complementarity
from bem.factor import ContactFactor
from bem.far_field import critical_delta
from bem.influence import Kernel
from bem.iterate import Iterate
from bem.selection import PlainImage
from bench.references import dense
from bench.references.surfaces import SURFACES, Shape, surface
from gen.runtime.signals import at_most

pytestmark = pytest.mark.usefixtures("both_ways")

KERNELS: list[Kernel] = ["uniform-pressure", "concentrated-force"]
RTOL = 1e-10
UNDECIDED = 1e-8  # reduced pressure and gap below which a node may count as in contact or not


def reduced(contact: bem.Contact) -> np.ndarray:
    """Return the pressure in the units of the dense reference."""
    problem = contact.problem
    return contact.pressure * problem.spacing[0] / (problem.delta * problem.modulus)


def assert_is_the_solution(contact: bem.Contact) -> None:
    """Compare contact nodes and force; nodes with neither pressure nor gap are not compared."""
    problem = contact.problem
    pressure, gap = dense.press(problem.heights, problem.delta, problem.kernel, problem.aspect)
    decided = (pressure > UNDECIDED) | (gap > UNDECIDED)
    np.testing.assert_array_equal((contact.pressure > 0)[decided], (pressure > UNDECIDED)[decided])
    assert reduced(contact).sum() == pytest.approx(pressure.sum(), rel=1e-8)


@settings(max_examples=40)
@given(kind=st.sampled_from(list(SURFACES)), seed=st.integers(0, 2**32 - 1), data=st.data())
def test_dense_reference_is_least_squares(kind: str, seed: int, data: st.DataObject) -> None:
    """SciPy solves the same problem as nonnegative least squares on the Cholesky factor."""
    shape = data.draw(st.tuples(st.integers(1, 8), st.integers(1, 8)))
    kernel = data.draw(st.sampled_from(KERNELS))
    heights = surface(kind, shape, seed)
    nodes = heights.size
    matrix = dense.influence_matrix(shape, kernel).reshape(nodes, nodes)
    interference = (heights - heights.max()).reshape(-1) + data.draw(st.floats(0.01, 3))
    factor = np.linalg.cholesky(matrix)
    expected, _ = nnls(factor.T, np.linalg.solve(factor, interference), maxiter=100 * nodes)
    pressure = dense.solve(matrix, interference)
    np.testing.assert_allclose(pressure, expected, rtol=0, atol=1e-10 * expected.max())


@settings(max_examples=150)
@given(
    kind=st.sampled_from(list(SURFACES)),
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(1, 33), st.integers(1, 33)),
    kernel=st.sampled_from(KERNELS),
    depth=st.one_of(st.floats(-0.1, 0), st.floats(1e-300, 1), st.floats(1, 100)),
)
def test_any_surface_is_solved_as_the_dense_reference_does(
    kind: str, seed: int, shape: Shape, kernel: Kernel, depth: float
) -> None:
    """From no contact to full contact and beyond: depth is Delta over the range of heights."""
    heights = surface(kind, shape, seed)
    delta = depth * (np.ptp(heights) or 1.0)
    contact = bem.solve(heights, 1.0, delta, spacing=0.5, kernel=kernel, rtol=RTOL)
    if delta <= 0:
        assert contact.contact_nodes == contact.force == 0
    else:
        assert_is_the_solution(contact)


@settings(max_examples=40)
@given(
    kind=st.sampled_from(list(SURFACES)),
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(1, 25), st.integers(1, 25)),
    aspect=st.sampled_from([2.0, 0.5, 7.3, 1 / 64]),
    depth=st.floats(0.01, 3),
)
def test_oblong_cells_are_solved_as_the_dense_reference_does(
    kind: str, seed: int, shape: Shape, aspect: float, depth: float
) -> None:
    heights = surface(kind, shape, seed)
    delta = depth * (np.ptp(heights) or 1.0)
    contact = bem.solve(heights, 1.0, delta, spacing=(0.5, 0.5 * aspect), rtol=RTOL)
    assert_is_the_solution(contact)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("depth", [0.05, 0.3, 0.7])
@pytest.mark.parametrize("kind", ["random walk", "self-affine", "paraboloid"])
def test_65_nodes_a_side(kind: str, depth: float, kernel: Kernel) -> None:
    heights = surface(kind, (65, 65), seed=7)
    delta = depth * np.ptp(heights)
    assert_is_the_solution(bem.solve(heights, 1000.0, delta, kernel=kernel, rtol=RTOL))


@pytest.mark.parametrize("side", [(3.0, 1.0), (1.0, 1.0), (1.0, 20.0)])
@pytest.mark.parametrize("shape", [(32, 20), (16, 33), (2, 3)])
def test_patches_with_two_sides(shape: Shape, side: tuple[float, float]) -> None:
    heights = surface("self-affine", shape)
    contact = bem.solve(heights, side, 0.4 * np.ptp(heights), rtol=RTOL)
    assert contact.problem.spacing == (side[0] / (shape[0] - 1), side[1] / (shape[1] - 1))
    assert_is_the_solution(contact)


class Dense:
    """Operators with every entry written out, and a preconditioner that knows the diagonal only."""

    def __init__(self, matrix: np.ndarray) -> None:
        self._matrix = matrix
        self.softening = 0.0
        self.load = None
        self.norm = float(np.abs(matrix).sum(axis=1).max())
        self.few_nodes = 0

    def displace(self, pressure: np.ndarray) -> np.ndarray:
        return self._matrix @ pressure

    def displace_some(self, nodes: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        return self._matrix[:, nodes] @ pressure

    def image_of(self, nodes: np.ndarray, pressure: np.ndarray) -> PlainImage:
        return PlainImage(self.displace_some(nodes, pressure), nodes)

    def approximate_inverse(self, nodes: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return lambda residual: residual / self._matrix.diagonal()[nodes]

    def factor(self, nodes: np.ndarray) -> ContactFactor:
        raise AssertionError("no set is few")


@settings(max_examples=30)
@given(kind=st.sampled_from(list(SURFACES)), seed=st.integers(0, 2**32 - 1), data=st.data())
def test_other_operators_have_the_same_solution(kind: str, seed: int, data: st.DataObject) -> None:
    """By the active set, and by the projected gradients that break its cycles."""
    shape = data.draw(st.tuples(st.integers(1, 12), st.integers(1, 12)))
    kernel = data.draw(st.sampled_from(KERNELS))
    heights = surface(kind, shape, seed).reshape(-1)
    matrix = dense.influence_matrix(shape, kernel).reshape(heights.size, heights.size)
    delta = data.draw(st.floats(0.01, 3)) * (np.ptp(heights) or 1.0)
    interference = (heights - heights.max()) / delta + 1
    expected = dense.solve(matrix, interference)
    operators = Dense(matrix)
    iterate, converged = solve_complementarity(
        operators, interference, rtol=1e-12, max_iterations=2000
    )
    assert converged
    np.testing.assert_allclose(iterate.pressure, expected, rtol=0, atol=1e-9)
    slow = Iterate(np.zeros_like(interference), interference.copy())
    while slow.violation() > 1e-12:
        descend(operators, interference, slow, steps=8)
    np.testing.assert_allclose(slow.pressure, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_first_step_from_a_start_is_the_best_in_its_plane(seed: int) -> None:
    """Least energy among all sums of the start and the preconditioned residual: deflation."""
    random = np.random.default_rng(seed)
    matrix = dense.influence_matrix((5, 6), "uniform-pressure").reshape(30, 30)
    interference = matrix @ random.uniform(1, 2, 30)  # so that all nodes are in contact
    near = random.uniform(1, 2, 30)
    residual = interference - (near @ interference) / (near @ matrix @ near) * matrix @ near
    plane = np.array([near, residual / matrix.diagonal()]).T
    best = plane @ np.linalg.solve(plane.T @ matrix @ plane, plane.T @ interference)
    assert best.min() > 0
    start = Iterate(near.copy(), interference - matrix @ near)
    iterate, converged = solve_complementarity(
        Dense(matrix), interference, rtol=1e-12, max_iterations=1, start=start, pace=FROM_NEAR
    )
    assert not converged
    np.testing.assert_allclose(iterate.pressure, best, rtol=0, atol=1e-12)
    assert near @ iterate.residual == pytest.approx(0, abs=1e-12)


class Rounded(Dense):
    """Search directions in single precision; counts the products in double precision."""

    exact = 0

    def displace(self, pressure: np.ndarray) -> np.ndarray:
        self.exact += 1
        return super().displace(pressure)

    def displace_some(self, nodes: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        return super().displace_some(nodes, pressure).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("rtol", [1e-4, 2e-7, 1e-11])
@pytest.mark.parametrize("depth", [0.2, 0.5, 5.0])
def test_few_exact_products_are_enough(depth: float, rtol: float) -> None:
    """One product confirms the solution; tight tolerances need one or two before it."""
    shape = (20, 20)
    matrix = dense.influence_matrix(shape, "uniform-pressure").reshape(400, 400)
    heights = surface("self-affine", shape, seed=3).reshape(-1)
    interference = (heights - heights.max()) / (depth * np.ptp(heights)) + 1
    operators = Rounded(matrix)
    iterate, converged = solve_complementarity(
        operators, interference, rtol=rtol, max_iterations=500
    )
    assert converged
    assert iterate.exact
    assert operators.exact <= (1 if rtol == 1e-4 else 3)
    residual = interference - matrix @ iterate.pressure
    np.testing.assert_allclose(iterate.residual, residual, rtol=0, atol=1e-14)
    assert residual.max() <= rtol
    assert np.abs(residual[iterate.pressure > 0]).max() <= rtol


class Spoiled(Dense):
    """Operators whose exact displacements differ from those in conjugate gradients."""

    def __init__(self, matrix: np.ndarray, spoil: Callable[[np.ndarray], np.ndarray]) -> None:
        super().__init__(matrix)
        self._spoil = spoil
        self.applied = 0

    def displace(self, pressure: np.ndarray) -> np.ndarray:
        self.applied += 1
        return self._spoil(super().displace(pressure))

    def displace_some(self, nodes: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        return np.asarray(self._matrix[:, nodes] @ pressure)


def spoiled(spoil: Callable[[np.ndarray], np.ndarray]) -> tuple[Iterate, bool, Spoiled]:
    """Solve with exact residuals that differ from those in conjugate gradients."""
    heights = surface("self-affine", (9, 9))
    operators = Spoiled(dense.influence_matrix((9, 9), "uniform-pressure").reshape(81, 81), spoil)
    overlap = (heights - heights.max()).reshape(-1) / 0.4 + 1
    with at_most(20):
        iterate, converged = solve_complementarity(
            operators, overlap, rtol=1e-9, max_iterations=10**6
        )
    return iterate, converged, operators


def test_residuals_that_rounding_keeps_up_end_the_solve() -> None:
    """Recomputed residuals are off by some 1e-6; no step corrects that, and the solve ends."""
    random = np.random.default_rng(0)
    iterate, converged, operators = spoiled(
        lambda displacement: displacement + 1e-6 * random.random(81)
    )
    assert not converged
    assert iterate.stalled
    assert operators.applied < 20
    assert iterate.violation() < 1e-5


def test_residuals_that_are_nan_end_the_solve() -> None:
    iterate, converged, operators = spoiled(lambda exact: exact * np.nan)
    assert not converged
    assert operators.applied < 5
    assert np.isnan(iterate.residual).all()


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_tolerance_below_rounding_is_named_as_the_cause(kernel: Kernel) -> None:
    """The message does not ask for more iterations where rounding ends the solve."""
    heights = surface("self-affine", (33, 33))
    delta = 0.999 * critical_delta(heights, kernel)
    settings = {"kernel": kernel, "far_field": "compliant", "max_iterations": 3000}
    with pytest.raises(bem.NotConverged, match="rounding leaves no smaller one; raise rtol") as end:
        bem.solve(heights, 1.0, delta, rtol=1.1e-15, **settings)
    assert end.value.stalled
    assert end.value.contact.iterations < 1000
    assert end.value.contact.residual < 1e-12
    copied = pickle.loads(pickle.dumps(end.value))
    assert (str(copied), copied.stalled) == (str(end.value), True)


def test_default_tolerance_finds_the_nodes_in_contact() -> None:
    """Databases need the force to 1e-5 and the area to the last node."""
    for seed in range(5):
        heights = surface("self-affine", (33, 33), seed)
        delta = 0.4 * np.ptp(heights)
        loose = bem.solve(heights, 1.0, delta)
        tight = bem.solve(heights, 1.0, delta, rtol=RTOL)
        assert loose.contact_nodes == tight.contact_nodes
        assert loose.force == pytest.approx(tight.force, rel=1e-5)


def test_threads_do_not_disturb_one_another() -> None:
    """Filters are scratch space too, so that every thread has its own."""
    surfaces = [surface("self-affine", (33, 33), seed) for seed in range(12)]

    def force(heights: np.ndarray) -> float:
        return bem.solve(heights, 1.0, 0.4 * np.ptp(heights)).force

    alone = [force(heights) for heights in surfaces]
    with ThreadPoolExecutor(2) as pool:
        for _ in range(5):
            assert list(pool.map(force, surfaces)) == alone
