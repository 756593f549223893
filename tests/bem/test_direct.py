"""Dense linear algebra on few candidate nodes: the same answers as iterations give."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem import direct, displacement_control
from bem.influence import KERNELS, Kernel
from bench.references.surfaces import SURFACES, surface
from gen.surface import generate

pytestmark = pytest.mark.usefixtures("both_ways")

ROUGH = generate("diamond-square", 65, 0.65, 12.5, np.random.default_rng(4))


@settings(max_examples=60)
@given(
    kind=st.sampled_from(list(SURFACES)),
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(1, 10), st.integers(1, 10)),
    kernel=st.sampled_from(KERNELS),
    share=st.floats(0.01, 3.0),
)
def test_few_nodes_are_solved_alike_by_both_methods(
    kind: str, seed: int, shape: tuple[int, int], kernel: Kernel, share: float
) -> None:
    """Dense linear algebra below `FEW_NODES` candidates, convolutions above."""
    heights = surface(kind, shape, seed)
    delta = share * (float(np.ptp(heights)) or 1.0)
    arguments = {"spacing": 1.0, "kernel": kernel, "rtol": 1e-12}
    exact = bem.solve(heights, 1.0, delta, **arguments)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(displacement_control, "FEW_NODES", 0)
        iterated = bem.solve(heights, 1.0, delta, **arguments)
    assert exact.iterations <= direct.CONTACT_SETS or kernel == "concentrated-force"
    largest = iterated.pressure.max()
    assert np.abs(exact.pressure - iterated.pressure).max() < 1e-8 * largest


def test_sets_that_cycle_are_left_to_the_iteration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(direct, "CONTACT_SETS", 1)
    heights = ROUGH[:9, :9]
    delta = 0.7 * float(np.ptp(heights))
    contact = bem.solve(heights, 8.0, delta)
    assert contact.residual <= 1e-6
    assert contact.iterations > 1
