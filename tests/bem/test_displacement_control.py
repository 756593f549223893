"""A given displacement: starts from a coarser grid and from a pressure nearby."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import bem
from bem import convolution, displacement_control, equilibrium
from bem.influence import KERNELS, Kernel
from bem.problem import Problem, pose
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
    monkeypatch.setattr(displacement_control, "NESTED", 9)
    nested = bem.solve(heights, SIDE, delta, **settings)  # type: ignore[arg-type]
    assert nested.residual <= 1e-9
    assert nested.force == pytest.approx(plain.force, rel=1e-7)
    scale = plain.pressure.max()
    np.testing.assert_allclose(nested.pressure, plain.pressure, rtol=0, atol=1e-5 * scale)


def test_a_grid_that_starts_from_coarser_ones_keeps_its_own_filters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They take longest to make, and a second load needs them again."""
    monkeypatch.setattr(displacement_control, "NESTED", 20)
    monkeypatch.setattr(displacement_control, "FEW_NODES", 0)
    monkeypatch.setattr(convolution, "KEPT_BYTES", 0)
    monkeypatch.setattr(convolution, "KEPT_LARGEST", 0)

    def kept_by_a_solve() -> list[tuple[int, int]]:
        bem.solve(ROUGH, SIDE, 2 * float(ROUGH.max() - ROUGH.min()))
        return [arguments[0] for _, *arguments in convolution._FILTERS._kept.filters]

    with ThreadPoolExecutor(1) as fresh:  # it keeps no filters of earlier tests
        shapes = fresh.submit(kept_by_a_solve).result()
    assert shapes.count((65, 65)) == 2  # in both precisions
    assert {shape[1] for shape in shapes} == {65}


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


@pytest.mark.parametrize(
    ("share", "grids"), [(1.0, [65, 33, 17]), (0.95, [65, 33, 17]), (0.85, [65, 33])]
)
def test_loose_solves_start_from_coarser_grids_where_nearly_all_nodes_overlap(
    monkeypatch: pytest.MonkeyPatch, share: float, grids: list[int]
) -> None:
    monkeypatch.setattr(displacement_control, "NESTED", 50)
    monkeypatch.setattr(displacement_control, "NESTED_AGAIN", 20)
    monkeypatch.setattr(displacement_control, "FEW_NODES", 0)
    heights = np.random.default_rng(4).random((65, 65)) / 100
    heights[np.random.default_rng(5).random(heights.shape) > share] = -5.0  # out of reach
    solved: list[int] = []
    solve = displacement_control.on_rigid_far_field

    def watched(problem: Problem, *arguments: Any, **settings: Any) -> Any:
        solved.append(len(problem.heights))
        return solve(problem, *arguments, **settings)

    monkeypatch.setattr(displacement_control, "on_rigid_far_field", watched)
    assert watched(pose(heights, 64.0, 1.0), 1.0).converged
    assert solved == grids


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


def test_a_start_that_claims_to_be_the_solution_is_found_out() -> None:
    """No solve converges on a displacement that it was given: a convolution confirms it."""
    alone = bem.solve(ROUGH, 1000.0, 30.0)
    claimed = ROUGH - ROUGH.max() + 30.0  # as if every node were in contact
    near = 0.9 * alone.pressure
    start = equilibrium.Start(near, claimed)
    reached = displacement_control.on_rigid_far_field(pose(ROUGH, 1000.0, 30.0), 30.0, start)
    assert reached.converged
    assert reached.iterate.effort.convolutions > 1
    np.testing.assert_array_equal(reached.pressure > 0, alone.pressure > 0)


@pytest.mark.parametrize("amount", [1e50, 1e300])
def test_a_start_beyond_all_bounds_is_left_aside(amount: float) -> None:
    heights = surface("white noise", (65, 65))
    with at_most(20):
        contact = bem.solve(heights, 1.0, 0.3, near=np.full((65, 65), amount))
    assert contact.force == bem.solve(heights, 1.0, 0.3).force
