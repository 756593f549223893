"""A given displacement: starts from a coarser grid and from a pressure nearby."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import bem
from bem import equilibrium
from bem.influence import KERNELS, Kernel
from bem.operators import filters
from bench.references.surfaces import SURFACES, surface
from gen.runtime.signals import at_most
from gen.surface import generate

pytestmark = pytest.mark.usefixtures("both_ways")

SIDE = 1000.0
ROUGH = generate("diamond-square", 65, 0.65, 12.5, np.random.default_rng(4))


@pytest.mark.parametrize("shape", [(65, 65), (64, 66), (70, 41), (37, 90)])
@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", SURFACES)
def test_a_nested_start_changes_no_answer(
    name: str, kernel: Kernel, shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    heights = surface(name, shape, seed=3)
    delta = 0.6 * float(heights.max() - heights.min())
    settings = {"spacing": 1.0, "kernel": kernel, "rtol": 1e-9}
    plain = bem.solve(heights, SIDE, delta, **settings)  # type: ignore[arg-type]
    monkeypatch.setattr(equilibrium, "NESTED", 9)
    nested = bem.solve(heights, SIDE, delta, **settings)  # type: ignore[arg-type]
    assert nested.residual <= 1e-9
    assert nested.force == pytest.approx(plain.force, rel=1e-7)
    scale = plain.pressure.max()
    np.testing.assert_allclose(nested.pressure, plain.pressure, rtol=0, atol=1e-5 * scale)


def test_a_grid_that_starts_from_coarser_ones_keeps_its_own_filters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They take longest to make, and a second load needs them again."""
    monkeypatch.setattr(equilibrium, "NESTED", 20)
    monkeypatch.setattr(equilibrium, "FEW_NODES", 0)
    monkeypatch.setattr(filters, "KEPT_BYTES", 0)
    monkeypatch.setattr(filters, "KEPT_LARGEST", 0)

    def kept_by_a_solve() -> list[tuple[int, int]]:
        bem.solve(ROUGH, SIDE, 2 * float(ROUGH.max() - ROUGH.min()))
        return [arguments[0] for _, *arguments in filters._KEPT.filters]

    with ThreadPoolExecutor(1) as fresh:  # it keeps no filters of earlier tests
        shapes = fresh.submit(kept_by_a_solve).result()
    assert shapes.count((65, 65)) == 4  # both precisions, the inverse, and means over blocks
    assert {shape[1] for shape in shapes} == {65}


def test_a_peak_between_the_coarser_nodes_starts_from_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    heights = np.zeros((41, 41))
    heights[20:23, 20:23] = 1.0
    heights[21, 21] = 3.0  # odd in both directions: every second node misses it
    heights -= np.random.default_rng(0).random(heights.shape) / 10
    monkeypatch.setattr(equilibrium, "NESTED", 3)
    monkeypatch.setattr(equilibrium, "FEW_NODES", 0)
    contact = bem.solve(heights, 40.0, 1.5)
    assert contact.contact_nodes == 1


@pytest.mark.parametrize("nodes", range(1, 10))
@pytest.mark.parametrize("axis", [0, 1])
def test_between_nodes_straight_lines_stay_straight(nodes: int, axis: int) -> None:
    coarse = np.zeros((3, 3)).take(np.zeros((nodes + 1) // 2, int), axis)
    line = np.arange((nodes + 1) // 2) * 2.0 + 1
    coarse += np.expand_dims(line, 1 - axis)
    filled = np.moveaxis(equilibrium._between(coarse, axis, nodes), axis, 0)
    expected = np.minimum(np.arange(nodes) + 1, line[-1])
    assert filled.shape == (nodes, 3)
    assert np.array_equal(filled, np.tile(expected[:, None], 3))


@pytest.mark.parametrize("amount", [1e50, 1e300])
def test_a_start_beyond_all_bounds_is_left_aside(amount: float) -> None:
    heights = surface("white noise", (65, 65))
    with at_most(20):
        contact = bem.solve(heights, 1.0, 0.3, near=np.full((65, 65), amount))
    assert contact.force == bem.solve(heights, 1.0, 0.3).force
