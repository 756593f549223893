"""The errors of a grid: bars that hold true errors, and surfaces that no grid resolves."""

import math
from dataclasses import replace

import numpy as np
import pytest

import bem
from bem.bodies import HALF_SPACE
from bem.derived.bar_weights import WEIGHTS
from bem.derived.coarser import at_coarser_nodes, coarser
from bem.derived.grid_error import slope_order
from bem.far_field import critical_delta
from bem.problem import pose
from bem.solving import solve_posed
from tests.bem.waves import random_waves


def fractal(nodes, hurst, seed):
    return random_waves(1, nodes // 2 - 1, hurst, seed)(nodes)


@pytest.mark.parametrize("boundary", ["periodic", "mirror", "free"])
@pytest.mark.parametrize("nodes", [16, 17, 23, 24, 40])
def test_the_coarser_grid_reads_the_same_surface(boundary, nodes):
    """Waves far from the grid's own are the same wherever they are read."""
    problem = pose(
        np.zeros((nodes, nodes + 1)), (2.0, 3.0), None, force=0.1, boundary=boundary
    )

    def surface(shape, spacing):
        ends = 0.5 if boundary == "mirror" else 0.0
        x, y = ((np.arange(n) + ends) * h for n, h in zip(shape, spacing, strict=True))
        turns = (np.pi, np.pi / 3) if boundary == "mirror" else (np.pi, 2 * np.pi / 3)
        return np.cos(turns[0] * x)[:, None] * np.cos(turns[1] * y)

    fine = surface(problem.heights.shape, problem.spacing)
    problem = pose(fine, (2.0, 3.0), None, force=0.1, boundary=boundary)
    half = coarser(problem)
    nearest = at_coarser_nodes(problem, fine)
    assert nearest == pytest.approx(half.heights, abs=2 * max(half.spacing))
    assert half.heights.shape == ((nodes + 1) // 2, (nodes + 2) // 2)
    sides = [n - (boundary == "free") for n in half.heights.shape]
    lengths = [n * h for n, h in zip(sides, half.spacing, strict=True)]
    assert lengths == pytest.approx([2.0, 3.0])
    error = 0.01 if boundary == "free" else 1e-12
    assert half.heights == pytest.approx(
        surface(half.heights.shape, half.spacing), abs=error
    )


@pytest.mark.parametrize("boundary", ["free", "periodic"])
@pytest.mark.parametrize("hardness", [None, 0.05])
def test_bars_hold_the_errors_of_resolved_surfaces(boundary, hardness):
    inside = []
    for seed in range(4):
        surface = random_waves(1, 8, 0.7, seed)
        problem = {"boundary": boundary, "hardness": hardness}
        if boundary == "free":
            fine, coarse = surface(384)[:193, :193], surface(128)[:65, :65]
        else:
            fine, coarse = surface(256), surface(64)
        for force in (0.001, 0.01):
            truth = bem.solve(fine, 1.0, force=force, **problem)
            contact = bem.solve(coarse, 1.0, force=force, **problem)
            error = contact.grid_error()
            assert error.resolved, error.reason
            cells = contact.pressure.size * np.prod(contact.problem.spacing)
            whole = truth.pressure.size * np.prod(truth.problem.spacing)
            area = truth.continuum_area_percent * whole / cells
            for name, true in (
                ("area_percent", area - contact.continuum_area_percent),
                ("delta", truth.delta - contact.delta),
                ("mean_gap", truth.mean_gap - contact.mean_gap),
                ("stiffness", truth.stiffness - contact.stiffness),
            ):
                inside.append(abs(true) <= getattr(error, name))
            assert error.area_percent < 0.1 * contact.continuum_area_percent
            assert error.force == 0
    assert np.mean(inside) >= 0.85  # of 32, of which nine in ten are promised


def quadric(nodes):
    """Return a round summit of height 0 between the nodes, with axes at an angle to the grid."""
    x = np.arange(nodes) - 0.37 - nodes // 2
    y = np.arange(nodes) + 0.21 - nodes // 2
    heights = -(np.add.outer(2 * x**2, 3 * y**2) + 1.5 * np.outer(x, y))
    return 1e-3 * heights


def test_the_summit_of_a_quadric_is_between_its_nodes():
    heights = quadric(17)
    error = bem.solve(heights, 16.0, force=1e-3).grid_error()
    assert error.summit == pytest.approx(-heights.max(), rel=1e-9)


def test_a_ridge_between_nodes_is_a_summit_too():
    x = np.arange(32) / 32
    heights = np.cos(2 * np.pi * np.add.outer(x + 0.01, x))
    error = bem.solve(heights, 1.0, pressure=0.1, boundary="periodic").grid_error()
    assert error.summit == pytest.approx(1 - heights.max(), rel=0.05)


def test_the_bar_of_a_displacement_holds_the_height_of_the_summit_and_little_more():
    """Delta counts from the summit; the two differ by the summit's height and little else."""
    heights = quadric(65)
    contact = bem.solve(heights, 64.0, force=0.2)
    error = contact.grid_error()
    assert error.summit < error.delta < 3 * error.summit
    known = replace(contact.problem, datum=error.summit)
    assert solve_posed(known).grid_error().delta < error.delta


def test_a_given_displacement_leaves_the_force_uncertain():
    surface = random_waves(1, 8, 0.7, 3)
    contact = bem.solve(surface(64), 1.0, 0.01, boundary="periodic")
    truth = bem.solve(surface(512), 1.0, 0.01, boundary="periodic")
    error = contact.grid_error()
    assert error.resolved
    assert error.delta == 0
    assert abs(truth.force - contact.force) < error.force < 0.2 * contact.force


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
@pytest.mark.parametrize("yields", [False, True])
@pytest.mark.parametrize("share", [0.1, 0.4, 0.8])
def test_a_higher_summit_is_in_the_bars_at_a_given_displacement(boundary, yields, share):
    """What it changes follows from the work of the load; another solve tells it within a half."""
    heights = random_waves(1, 8, 0.7, 3)(64)
    depth = float((heights.max() - heights).mean())
    mean = bem.solve(heights, 1.0, share * depth, boundary=boundary).force
    setting = {"boundary": boundary, "hardness": 8 * mean if yields else None}
    contact = bem.solve(heights, 1.0, share * depth, **setting)
    error = contact.grid_error()
    raised = bem.solve(heights, 1.0, share * depth + error.summit, **setting)
    for name in ("force", "continuum_area_percent", "mean_gap"):
        bar = getattr(error, name.removeprefix("continuum_"))
        assert abs(getattr(raised, name) - getattr(contact, name)) < 1.5 * bar, name


def test_a_displacement_beyond_the_critical_one_of_half_of_the_nodes_is_the_reason():
    """On a compliant far field, half of the nodes are not in full contact, but in none at all."""
    heights = fractal(17, 0.8, 0)
    delta = 0.99 * critical_delta(heights, HALF_SPACE)
    error = bem.solve(heights, 1.0, delta, far_field="compliant").grid_error()
    assert not error.resolved
    assert "Delta*" in error.reason
    assert "full contact" not in error.reason
    assert error.coarse is None
    assert error.force == math.inf


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.9])
def test_fractals_down_to_the_grid_are_not_resolved(hurst):
    for seed in range(3):
        contact = bem.solve(
            fractal(128, hurst, seed), 1.0, pressure=0.01, boundary="periodic"
        )
        error = contact.grid_error()
        assert not error.resolved
        assert "no limit" in error.reason
        assert error.order < 0.4


def test_the_area_of_bodies_that_yield_everywhere_is_known_on_any_grid():
    """Fractal or not: the hardness bears the load on no less."""
    contact = bem.solve(
        fractal(128, 0.5, 0), 1.0, pressure=1e-4, boundary="periodic", hardness=5e-4
    )
    error = contact.grid_error()
    assert error.verdicts["area"]
    assert error.reason.startswith("yielding decides it")
    least = 100 * 1e-4 / 5e-4
    assert (
        least - 1e-9
        <= contact.continuum_area_percent
        <= least + error.area_percent + 1e-9
    )
    assert error.area_percent < 0.05 * least


def test_yielding_that_decides_the_area_vouches_for_no_stiffness():
    contact = bem.solve(
        fractal(64, 0.5, 0), 1.0, pressure=1e-4, boundary="periodic", hardness=5e-4
    )
    error = contact.grid_error()
    assert error.verdicts == {
        "area": True,
        "delta": True,
        "force": True,
        "mean_gap": True,
        "stiffness": False,
    }
    assert not error.resolved


def grooves(nodes, phase):
    """Grooves of a round tool along y, with sharp ridges between them."""
    from_middle = (4 * np.arange(nodes) / nodes + phase) % 1 - 0.5
    return np.repeat(0.05 * from_middle[:, None] ** 2, nodes, axis=1)


@pytest.mark.parametrize("pressure", [0.003, 0.01])
def test_no_bar_at_creases_holds_where_areas_of_two_grids_agree_by_chance(pressure):
    """Ridges with cusps at seven places within a cell, whose areas are off by up to 130 %."""
    truth = bem.solve(grooves(512, 0.02), 1.0, pressure=pressure, boundary="periodic")
    true_area = truth.continuum_area_percent
    for phase in np.linspace(0, 0.06, 7):
        heights = grooves(64, phase)
        contact = bem.solve(heights, 1.0, pressure=pressure, boundary="periodic")
        error = contact.grid_error()
        assert error.creased
        is_inside = abs(contact.continuum_area_percent - true_area) <= error.area_percent
        assert is_inside or not error.resolved


def test_full_contact_of_ridges_with_cusps_is_not_resolved():
    """Between the nodes of the finer grid their grooves are open."""
    heights = grooves(64, 0.02)
    contact = bem.solve(heights, 1.0, pressure=10.0, boundary="periodic")
    assert contact.continuum_area_percent == 100
    assert not contact.grid_error().resolved


def test_blunt_creases_are_told_from_waves_of_six_nodes():
    """Both bend as much more over two nodes than over one; waves bend no further over four."""
    x = np.arange(96) / 96
    gentle = 0.2 * np.sin(2 * np.pi * x)
    waves = np.add.outer(gentle + 0.01 * np.sin(2 * np.pi * 16 * x), gentle)
    ridges_between_nodes = grooves(96, 1 / 48)
    are_creased = [
        bem.solve(heights, 1.0, pressure=10.0, boundary="periodic").grid_error().creased
        for heights in (waves, ridges_between_nodes)
    ]
    assert are_creased == [False, True]


@pytest.mark.parametrize("boundary", ["periodic", "mirror", "free"])
def test_waves_of_many_nodes_have_no_creases(boundary):
    contact = bem.solve(
        random_waves(1, 8, 0.7, 3)(96), 1.0, pressure=0.01, boundary=boundary
    )
    assert not contact.grid_error().creased


def test_what_opens_between_the_nodes_of_a_full_contact_is_in_its_bars():
    """The tension is in spots of less than a cell, which both grids miss."""
    x = np.arange(24) / 24
    phase = 2 * np.pi * (3 * x - 3 / 48)
    heights = np.add.outer(np.cos(phase), np.cos(phase))
    full = bem.solve(heights, 1.0, pressure=1e3, boundary="periodic")
    waves = full.pressure - full.pressure.mean()
    load = -float(waves.min()) * (1 + 1e-6)  # no node is pulled
    contact = bem.solve(heights, 1.0, pressure=load, boundary="periodic")
    fine = 2 * np.pi * (3 * np.arange(384) / 384 - 3 / 48)
    truth = bem.solve(
        np.add.outer(np.cos(fine), np.cos(fine)), 1.0, pressure=load, boundary="periodic"
    )
    error = contact.grid_error()
    assert contact.continuum_area_percent == 100
    assert truth.continuum_area_percent < 100
    assert error.area_percent >= 100 - truth.continuum_area_percent
    assert error.mean_gap >= truth.mean_gap
    assert not error.verdicts["stiffness"]


def test_what_opens_at_the_edges_of_a_full_contact_is_in_its_bars():
    """The corners of a free patch, which both grids press flat, are open on a finer grid."""

    def cap(nodes):
        x = (np.arange(nodes) + 0.5) / nodes - 0.5
        heights = -np.add.outer(x**2 / 4, x**2 / 6)
        problem = pose(heights, 1.0, None, force=0.15, spacing=1 / nodes)
        return solve_posed(replace(problem, datum=0.0))

    contact = cap(16)
    error = contact.grid_error()
    assert error.coarse.contact_nodes == error.coarse.pressure.size
    open_percent = 100 - cap(64).continuum_area_percent
    assert 0 < open_percent <= error.area_percent


def test_open_scatter_is_the_scatter_of_the_border_among_the_open_nodes():
    """Where the place of the border scatters, a share of the open area opens or closes."""
    surface = random_waves(1, 8, 0.7, 3)(96)
    loaded = bem.solve(surface, 1.0, pressure=0.02, boundary="periodic")
    error = loaded.grid_error()
    nodes = loaded.contact_nodes
    least = WEIGHTS["edgeless"]["delta"].open_scatter * loaded.mean_gap
    least *= error.border.scatter * nodes / (surface.size - nodes)
    assert least <= error.delta <= 100 * least


def test_smooth_surfaces_have_the_order_two_and_edges_the_order_one():
    x = np.arange(64) / 64
    wave = np.add.outer(np.cos(2 * np.pi * x), np.cos(4 * np.pi * x))
    assert slope_order(wave, "periodic") == pytest.approx(2, abs=0.1)
    edge = np.add.outer(np.abs((7 * x + 0.3) % 1 - 0.5), np.zeros(64))
    assert slope_order(edge, "periodic") == pytest.approx(1, abs=0.4)
    assert slope_order(np.zeros((64, 64)), "free") == math.inf


def test_a_contact_smaller_than_a_cell_is_not_resolved():
    """No area within the border on either grid is no area without an error."""
    heights = 100 * random_waves(1, 4, 0.8, 1)(48)
    contact = bem.solve(heights, 100.0, pressure=4e-9, boundary="mirror")
    assert contact.contact_nodes == 1
    assert contact.continuum_area_percent == 0
    assert not contact.grid_error().resolved
    assert "as large as a cell" in contact.grid_error().reason


WAVE = np.cos(2 * np.pi * np.arange(16) / 16)
WAVES = np.add.outer(WAVE, WAVE)


def test_no_contact_has_no_error():
    error = bem.solve(WAVES, 1.0, 0.0).grid_error()
    assert error.resolved
    assert error.area_percent == 0


def test_full_contact_has_no_error():
    error = bem.solve(WAVES, 1.0, pressure=100.0, boundary="periodic").grid_error()
    assert error.area_percent == 0
    assert error.resolved
    with np.errstate(all="raise"):
        huge = bem.solve(WAVES, 1.0, pressure=1e30, boundary="mirror").grid_error()
    assert huge.area_percent == 0


def test_border_cells_of_the_coarser_grid_count_as_far_as_those_of_the_finer_one():
    plate = bem.solve(np.zeros((33, 33)), 1.0, force=1.0)
    assert plate.grid_error().area_percent < 1


def test_few_nodes_are_not_compared():
    error = bem.solve(WAVES[:5], 1.0, 0.5, spacing=1.0).grid_error()
    assert not error.resolved
    assert error.reason == "5 x 16 nodes are too few to tell"
    assert error.area_percent == math.inf


@pytest.mark.parametrize("hardness", [None, 1e-90, 1e90])
@pytest.mark.parametrize("delta", [1e-200, 1e200])
def test_bars_at_displacements_far_from_one_stay_within_double_precision(delta, hardness):
    heights = random_waves(1, 8, 0.7, 3)(33)
    error = bem.solve(heights, 1.0, delta, hardness=hardness).grid_error()
    for bar in (error.area_percent, error.force, error.mean_gap):
        assert math.isfinite(bar)


def test_nothing_is_solved_unless_it_is_asked_for(monkeypatch):
    monkeypatch.setattr(
        "bem.derived.grid_error.coarser", lambda *_: pytest.fail("a coarser grid")
    )
    contact = bem.solve(fractal(32, 0.8, 0), 1.0, pressure=0.01, boundary="periodic")
    assert contact.continuum_area_percent > 0
    with pytest.raises(pytest.fail.Exception):
        contact.grid_error()


def test_bars_hold_the_area_of_waves_along_an_axis():
    """All edges of a straight border have the same place in their cells (Westergaard 1939)."""
    inside = []
    for load in (0.05, 0.2, 0.5, 0.8):
        exact_percent = 200 / math.pi * math.asin(math.sqrt(load))
        for phase in np.linspace(0, 2 * np.pi, 8, endpoint=False):
            turns = 2 * np.pi * np.arange(24) / 24 + phase
            heights = 0.01 * np.cos(turns)[:, None] * np.ones(24)
            pressure = (
                load * math.pi * 0.01
            )  # mean pressure of full contact times the share
            contact = bem.solve(heights, 1.0, pressure=pressure, boundary="periodic")
            error = contact.grid_error()
            off = abs(contact.continuum_area_percent - exact_percent)
            inside.append(off <= error.area_percent)
    assert np.mean(inside) >= 0.9  # of 32
