"""What large grids need: a start from a coarser one, and memory for little more than the fields."""

import tracemalloc

import numpy as np
import pytest

import bem
from bem import displacement_control
from bem.convolution import fast_period
from bem.influence import KERNELS, Kernel
from bench.references.surfaces import SURFACES, surface
from gen.surface import generate

pytestmark = pytest.mark.usefixtures("both_ways")

SIDE = 1000.0


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
    monkeypatch.setattr(displacement_control, "NESTED", 9)
    nested = bem.solve(heights, SIDE, delta, **settings)  # type: ignore[arg-type]
    assert nested.residual <= 1e-9
    assert nested.force == pytest.approx(plain.force, rel=1e-7)
    scale = plain.pressure.max()
    np.testing.assert_allclose(nested.pressure, plain.pressure, rtol=0, atol=1e-5 * scale)


def test_a_peak_between_the_coarser_nodes_starts_from_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    heights = np.zeros((41, 41))
    heights[20:23, 20:23] = 1.0
    heights[21, 21] = 3.0  # odd in both directions: every second node misses it
    heights -= np.random.default_rng(0).random(heights.shape) / 10
    monkeypatch.setattr(displacement_control, "NESTED", 3)
    monkeypatch.setattr(displacement_control, "FEW_NODES", 0)
    contact = bem.solve(heights, 40.0, 1.5)
    assert contact.contact_nodes == 1


@pytest.mark.parametrize("nodes", range(1, 10))
@pytest.mark.parametrize("axis", [0, 1])
def test_between_nodes_straight_lines_stay_straight(nodes: int, axis: int) -> None:
    coarse = np.zeros((3, 3)).take(np.zeros((nodes + 1) // 2, int), axis)
    line = np.arange((nodes + 1) // 2) * 2.0 + 1
    coarse += np.expand_dims(line, 1 - axis)
    filled = np.moveaxis(displacement_control._between(coarse, axis, nodes), axis, 0)
    expected = np.minimum(np.arange(nodes) + 1, line[-1])
    assert filled.shape == (nodes, 3)
    assert np.array_equal(filled, np.tile(expected[:, None], 3))


@pytest.mark.parametrize("percent", [1, 10, 50])
def test_memory_is_at_most_twelve_padded_arrays(percent: int) -> None:
    nodes = 239 + 2 * percent  # odd sizes of their own: nothing is kept from another test
    heights = generate("diamond-square", 513, 0.65, 12.5, np.random.default_rng(1))[:nodes, :nodes]
    delta = float(np.quantile(heights.max() - heights, min(3.5 * percent / 100, 1.0)))
    tracemalloc.start()
    try:
        contact = bem.solve(heights, SIDE, delta)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 0.3 * percent < contact.area_percent < 2 * percent
    assert peak <= 12 * 8 * fast_period(nodes) ** 2
