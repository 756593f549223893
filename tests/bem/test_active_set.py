"""The active set against a dense reference, and its end where rounding stops it."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem.active_set import ActiveSet
from bem.bodies import HALF_SPACE, KERNELS, REDUCED
from bem.far_field import critical_delta
from bem.iterate import Iterate
from bem.operators.patch import Patch
from bench.references import dense
from bench.references.surfaces import SURFACES, surface
from gen.runtime.farm import time_limit

pytestmark = pytest.mark.usefixtures("both_ways")

CELLS = [("concentrated-force", 1.0), *((KERNELS[0], a) for a in (1.0, 2.0, 0.5, 1 / 64))]
RTOL = 1e-10
UNDECIDED = (
    1e-8  # reduced pressure and gap below which a node may count as in contact or not
)


def reduced(contact):
    """Return the pressure in the units of the dense reference."""
    problem = contact.problem
    return contact.pressure * problem.spacing[0] / (problem.delta * problem.modulus)


def assert_is_the_solution(contact):
    """Compare contact nodes and force; nodes with neither pressure nor gap are not compared."""
    problem = contact.problem
    pressure, gap = dense.press(
        problem.heights, problem.delta, problem.kernel, problem.aspect
    )
    decided = (pressure > UNDECIDED) | (gap > UNDECIDED)
    np.testing.assert_array_equal(
        (contact.pressure > 0)[decided], (pressure > UNDECIDED)[decided]
    )
    assert reduced(contact).sum() == pytest.approx(pressure.sum(), rel=1e-8)


@settings(max_examples=100)
@given(
    kind=st.sampled_from(list(SURFACES)),
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(1, 33), st.integers(1, 33)),
    cells=st.sampled_from(CELLS),
    depth=st.one_of(st.floats(-0.1, 0), st.floats(1e-300, 1), st.floats(1, 100)),
)
def test_any_surface_is_solved_as_the_dense_reference_does(
    kind, seed, shape, cells, depth
):
    """From no contact to full contact and beyond: depth is Delta over the range of heights."""
    kernel, aspect = cells
    heights = surface(kind, shape, seed)
    delta = depth * (np.ptp(heights) or 1.0)
    settings = {"spacing": (0.5, 0.5 * aspect), "kernel": kernel, "rtol": RTOL}
    contact = bem.solve(heights, 1.0, delta, **settings)
    if delta <= 0:
        assert contact.contact_nodes == contact.force == 0
    else:
        assert_is_the_solution(contact)


def complementary(pressure, gaps, hardness):
    """Return the largest violation of a pressure between its bounds; gaps where nothing presses."""
    assert pressure.min() >= 0
    assert pressure.max() <= hardness
    gap = dense.displace(pressure, "uniform-pressure", 1.0) - gaps
    wrong = np.where(pressure > 0, np.abs(gap), -gap)
    return float(np.where(pressure >= hardness, gap, wrong).max())


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    share=st.floats(0.001, 0.99),
    whole=st.booleans(),
    hardness=st.sampled_from([np.inf, 3.0, 0.3, 0.01]),
)
def test_loads_are_carried_to_the_last_digit(seed, share, whole, hardness):
    """Whole multiples of the hardness on a node, too, are ordinary loads."""
    heights = surface("self-affine", (9, 8), seed)
    patch, below = Patch((9, 8), "free", HALF_SPACE, 1.0), heights - heights.max()
    load = share * 72 * min(hardness, 1.0)
    if whole and hardness < np.inf:
        load = hardness * max(round(share * 71), 1)
    iterate = Iterate(
        patch, below, load=load, hardness=hardness, rtol=1e-10, max_iterations=2000
    )
    iterate.begin(np.ones(below.shape))
    assert ActiveSet(iterate).run()
    assert iterate.pressure.sum() == pytest.approx(load, rel=1e-13)
    largest = complementary(iterate.pressure, below + iterate.shift, hardness)
    assert largest <= 1.1e-10 * iterate.shift


class Spoiled(Patch):
    """A matrix whose exact displacements differ from those in conjugate gradients."""

    def __init__(self, spoil):
        super().__init__((9, 9), "free", HALF_SPACE, 1.0)
        self._spoil, self.few, self.exact = spoil, 0, 0

    def displace(self, pressure, *, exactly=False):
        self.exact += exactly
        displacement = super().displace(pressure, exactly=exactly)
        return self._spoil(displacement) if exactly else displacement


def spoiled(spoil):
    """Solve with exact residuals that differ from those in conjugate gradients."""
    heights = surface("self-affine", (9, 9))
    below = (heights - heights.max()) / 0.4
    iterate = Iterate(Spoiled(spoil), below, shift=1.0, rtol=1e-9, max_iterations=10**6)
    solve = ActiveSet(iterate)
    with time_limit(20):
        return solve, solve.run()


def test_residuals_that_rounding_keeps_up_end_the_solve():
    """Recomputed residuals are off by some 1e-6; no step corrects that, and the solve ends."""
    random = np.random.default_rng(0)
    solve, converged = spoiled(
        lambda displacement: displacement + 1e-6 * random.random((9, 9))
    )
    assert not converged
    assert solve.stalled
    assert solve.iterate.patch.exact < 20  # type: ignore[attr-defined]
    assert solve.iterate.violation().largest < 1e-5


def test_residuals_that_are_nan_end_the_solve():
    solve, converged = spoiled(lambda exact: exact * np.nan)
    assert not converged
    assert solve.iterate.patch.exact < 8  # type: ignore[attr-defined]
    assert np.isnan(solve.iterate.residual).all()


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_tolerance_below_rounding_is_named_as_the_cause(kernel):
    """The message does not ask for more iterations where rounding ends the solve."""
    heights = surface("self-affine", (33, 33))
    delta = 0.999 * critical_delta(heights, REDUCED[kernel])
    settings = {"kernel": kernel, "far_field": "compliant", "max_iterations": 3000}
    with pytest.raises(
        bem.NotConverged, match="rounding leaves no smaller one; raise rtol"
    ) as end:
        bem.solve(heights, 1.0, delta, rtol=1.1e-15, **settings)
    assert end.value.stalled
    assert end.value.contact.iterations < 1000
    assert end.value.contact.residual < 1e-12
    copied = pickle.loads(pickle.dumps(end.value))
    assert (str(copied), copied.stalled) == (str(end.value), True)


def test_default_tolerance_finds_the_nodes_in_contact():
    """Databases need the force to 1e-5 and the area to the last node."""
    for seed in range(5):
        heights = surface("self-affine", (33, 33), seed)
        delta = 0.4 * np.ptp(heights)
        loose = bem.solve(heights, 1.0, delta)
        tight = bem.solve(heights, 1.0, delta, rtol=RTOL)
        assert loose.contact_nodes == tight.contact_nodes
        assert loose.force == pytest.approx(tight.force, rel=1e-5)
