"""A contact within an error: the same surface on fewer nodes, answers within what was asked."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

import bem
from bem.accuracy import grids, on_coarser_map
from bem.answers import ANSWERS
from bem.bodies import ConcentratedForces
from bem.coarsening import Coarsening
from bem.problem import pose
from bem.solving import solve_posed
from tests.bem.waves import random_waves

BOUNDARIES = ("periodic", "mirror", "free")

WAVES = random_waves(2, 12, 0.7, 1)
"""Waves of which the shortest has a twelfth of the side."""


def map_of_waves(nodes, boundary):
    """A map of the waves; a patch that does not repeat itself has three quarters of its period."""
    if boundary == "periodic":
        return WAVES(nodes)
    return WAVES(4 * nodes // 3)[:nodes, :nodes]


def posed(heights, boundary, **load):
    load = load or {"force": 0.01}
    delta = load.pop("delta", None)
    problem = pose(heights, (2.0, 3.0), delta, boundary=boundary, **load)
    return replace(problem, datum=0.0)


def on_fewer(problem, nodes):
    """The problem on fewer nodes, and the share of the mean square slope that is dropped."""
    coarsening = Coarsening(problem.heights, problem.boundary, problem.aspect)
    fewer = coarsening.on(nodes)
    return on_coarser_map(problem, fewer), fewer.dropped


def test_grids_end_with_the_map_and_begin_with_those_whose_half_can_judge():
    sizes = list(grids((300, 200)))
    assert sizes[-1] == (300, 200)
    assert min(sizes[0]) >= 32
    assert sizes == sorted(sizes)
    assert list(grids((9, 9))) == [(9, 9)]


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("by", ["pressure", "delta", "force"])
def test_the_area_is_within_the_error_on_fewer_nodes(boundary, by):
    heights = map_of_waves(240, boundary)
    full = bem.solve(heights, 1.0, pressure=0.006, boundary=boundary)
    load = {"pressure": 0.006, "delta": full.delta, "force": full.force}[by]
    contact = bem.solve_within(heights, 1.0, 0.03, boundary=boundary, **{by: load})
    assert contact.pressure.size < heights.size / 2
    area = full.continuum_area_percent
    assert contact.continuum_area_percent == pytest.approx(area, rel=0.03)
    assert getattr(contact, "force" if by != "delta" else "delta") == pytest.approx(
        full.force if by != "delta" else full.delta, rel=1e-9
    )
    assert contact.delta == pytest.approx(full.delta, rel=0.02)
    assert contact.mean_gap == pytest.approx(full.mean_gap, rel=0.02)


@pytest.mark.parametrize("pressure", [0.12, 0.16])
def test_near_full_contact_the_gap_bounds_what_the_solver_leaves(pressure):
    """A tenth of the error would leave more than the gap: forces were off by 5 and by 34 %."""
    heights = WAVES(120)
    full = bem.solve(heights, 1.0, pressure=pressure, boundary="periodic")
    assert full.mean_gap < 1e-3 * full.delta
    contact = bem.solve_within(heights, 1.0, 0.03, delta=full.delta, boundary="periodic")
    assert contact.force == pytest.approx(full.force, rel=0.01)
    assert contact.problem.rtol < 0.003


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_delta_counts_from_the_highest_node_of_the_given_map(boundary):
    heights = map_of_waves(192, boundary)
    full = bem.solve(heights, 1.0, pressure=0.004, boundary=boundary)
    delta = full.delta
    problem = posed(heights, boundary, delta=delta)
    problem = replace(problem, spacing=full.problem.spacing)
    fewer, _ = on_fewer(problem, (48, 48))
    assert fewer.datum > 0
    contact = solve_posed(fewer)
    assert contact.delta == delta
    assert contact.approach == pytest.approx(delta)
    touching = contact.pressure > 0
    assert np.abs(contact.gap[touching]).max() <= 2 * problem.rtol * delta
    area = full.continuum_area_percent
    off = abs(contact.continuum_area_percent / area - 1)
    own = solve_posed(replace(fewer, datum=None))
    assert off < 0.03
    assert abs(own.continuum_area_percent / area - 1) > 2 * off
    # Under the force of that contact, Delta is the same again.
    again = solve_posed(replace(fewer, delta=None, force=contact.force))
    assert again.delta == pytest.approx(delta, rel=1e-5)


def test_a_datum_of_the_maps_own_highest_node_changes_no_contact():
    heights = map_of_waves(64, "periodic")
    delta = 0.3 * (heights.max() - heights.mean())
    contact = bem.solve(heights, 1.0, delta, boundary="periodic")
    same = solve_posed(replace(contact.problem, datum=0.0))
    assert (same.pressure == contact.pressure).all()
    assert (same.gap == contact.gap).all()


def test_a_small_delta_that_leaves_the_cut_surface_untouched_is_refined():
    heights = map_of_waves(192, "periodic")
    delta = 0.02 * (heights.max() - heights.mean())
    contact = bem.solve_within(heights, 1.0, 0.2, delta=delta, boundary="periodic")
    full = bem.solve(heights, 1.0, delta, boundary="periodic")
    assert not contact.budget.trials[0].meets_errors
    assert contact.continuum_area_percent == pytest.approx(
        full.continuum_area_percent, rel=0.2
    )


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_ripples_that_carry_the_slope_are_never_cut(boundary):
    """Waviness with ripples of 8 nodes a wave: cut, the area is off by several per cent."""
    nodes = 192
    turns = 2 * np.pi * np.arange(nodes) / nodes
    ripples = np.add.outer(np.cos(24 * turns), np.cos(24 * turns)) / 24
    heights = random_waves(1, 4, 0.8, 2)(nodes) + 0.03 / (2 * np.pi) * ripples
    full = bem.solve(heights, 1.0, pressure=0.01, boundary=boundary)
    try:
        contact = bem.solve_within(heights, 1.0, 0.04, pressure=0.01, boundary=boundary)
    except bem.NotReachable as refusal:
        trials = refusal.budget.trials
    else:
        trials = contact.budget.trials
        area = full.continuum_area_percent
        assert contact.continuum_area_percent == pytest.approx(area, rel=0.04)
    assert all(trial.nodes[0] > 48 for trial in trials)


def test_each_answer_has_an_error_of_its_own():
    heights = map_of_waves(192, "mirror")
    asked = {
        "area": 0.05,
        "mean_gap": 0.01,
        "stiffness": 0.1,
        "delta": 0.01,
        "force": 0.01,
    }
    contact = bem.solve_within(heights, 1.0, asked, pressure=0.01, boundary="mirror")
    full = bem.solve(heights, 1.0, pressure=0.01, boundary="mirror")
    answers = contact.budget.errors
    assert answers.keys() == asked.keys()
    for name, parts in answers.items():
        assert parts.asked_error == asked[name]
        assert parts.total == pytest.approx(
            math.hypot(parts.grid, parts.waves, parts.solver)
        )
        assert parts.total <= asked[name]
        attribute = "continuum_area_percent" if name == "area" else name
        assert getattr(contact, attribute) == pytest.approx(
            getattr(full, attribute), rel=asked[name]
        )
    assert answers["force"].grid == 0
    assert contact.problem.rtol == pytest.approx(0.001)


def test_a_map_of_a_few_nodes_is_refused_with_its_nodes():
    with pytest.raises(bem.NotReachable, match="2 x 2 nodes are too few"):
        bem.solve_within(np.zeros((2, 2)), 1.0, 0.1, force=0.1)


def test_the_part_of_the_solver_holds_what_its_tolerance_changes():
    asked = dict.fromkeys(("area", "mean_gap", "stiffness", "delta"), 0.3)
    inside = []
    for boundary in BOUNDARIES:
        heights = map_of_waves(96, boundary)
        for pressure in (0.003, 0.03):
            contact = bem.solve_within(
                heights, 1.0, asked, pressure=pressure, boundary=boundary
            )
            exact = solve_posed(replace(contact.problem, rtol=1e-12))
            for name, parts in contact.budget.errors.items():
                value = ANSWERS[name].value
                error = abs(value(contact) / value(exact) - 1)
                inside.append(error <= parts.solver + 1e-12)
    assert np.mean(inside) >= 0.9  # of 24, of which 95 % are promised


def test_the_budget_says_what_was_tried():
    contact = bem.solve_within(
        map_of_waves(192, "periodic"), 1.0, 0.02, pressure=0.01, boundary="periodic"
    )
    budget = contact.budget
    assert budget.map_nodes == (192, 192)
    assert budget.nodes == contact.pressure.shape == budget.trials[-1].nodes
    assert [trial.meets_errors for trial in budget.trials] == [False] * (
        len(budget.trials) - 1
    ) + [True]
    assert budget.work == pytest.approx(sum(trial.work for trial in budget.trials))
    assert 0 < budget.trials[-1].work < budget.trials[-1].convolutions
    assert budget.trials[-1].reason == contact.grid_error().reason


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_where_waves_have_many_nodes_two_trials_suffice(boundary):
    heights = map_of_waves(288, boundary)
    contact = bem.solve_within(heights, 1.0, 0.03, pressure=0.01, boundary=boundary)
    assert len(contact.budget.trials) <= 2
    assert contact.budget.nodes[0] < 144


def test_many_waves_on_a_patch_begin_on_fewer_nodes_in_a_wave():
    heights = random_waves(1, 6, 0.8, 0)(192)
    settings = {"pressure": 0.01, "boundary": "periodic"}
    alone = bem.solve_within(heights, 1.0, 0.01, **settings)
    of_sixteen = bem.solve_within(np.tile(heights, (4, 4)), 4.0, 0.01, **settings)
    first_nodes = alone.budget.trials[0].nodes[0]
    assert of_sixteen.budget.trials[0].nodes[0] < 4 * first_nodes


def test_a_map_that_is_far_from_the_error_is_refused_on_fewer_nodes():
    heights = random_waves(1, 6, 0.8, 0)(192)
    with pytest.raises(bem.NotReachable, match="all nodes were not expected") as info:
        bem.solve_within(heights, 1.0, 1e-6, pressure=0.01, boundary="periodic")
    assert max(trial.nodes[0] for trial in info.value.budget.trials) < 192


@pytest.mark.few(3)
@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize(
    "body",
    [
        bem.Layered(0.04, 0.02, 0.5, "rigid"),
        bem.Layered(0.3, 30.0, 0.3, bem.HalfSpace(1.0)),
        (bem.Layered(0.3, 0.1, 0.3, bem.HalfSpace(1.0)), bem.HalfSpace(0.2)),
    ],
)
def test_layers_are_answered_within_the_error(boundary, body):
    heights = map_of_waves(240, boundary)
    modulus = pose(heights, 1.0, 1.0, body=body).modulus
    setting = {"pressure": 0.006 * modulus, "body": body, "boundary": boundary}
    full = bem.solve(heights, 1.0, **setting)
    contact = bem.solve_within(heights, 1.0, 0.03, **setting)
    if boundary != "free":  # a free patch of hard layers may need all nodes
        assert contact.pressure.size < heights.size / 2
    area = full.continuum_area_percent
    assert contact.continuum_area_percent == pytest.approx(area, rel=0.03)


def test_a_layer_of_the_material_below_takes_the_grid_of_the_half_space():
    heights = map_of_waves(240, "mirror")
    setting = {"pressure": 0.006, "boundary": "mirror"}
    alone = bem.solve_within(heights, 1.0, 0.03, modulus=1.0, poisson=0.3, **setting)
    body = bem.Layered(0.05, 1.0, 0.3, bem.HalfSpace(1.0, 0.3))
    contact = bem.solve_within(heights, 1.0, 0.03, body=body, **setting)
    assert contact.budget.nodes == alone.budget.nodes
    assert contact.budget.errors["area"].waves == pytest.approx(
        alone.budget.errors["area"].waves
    )


def test_tolerances_are_tighter_where_a_free_patch_settles():
    """On a soft base the patch under a hard layer settles by far more than its roughness."""
    heights = map_of_waves(96, "free")
    body = bem.Layered(0.3, 30.0, 0.3, bem.HalfSpace(1.0))
    contact = bem.solve_within(heights, 1.0, {"delta": 0.03}, pressure=0.2, body=body)
    ratio = contact.problem.settlement_ratio
    assert ratio > 10
    assert contact.problem.rtol <= 0.003 / ratio
    assert contact.grid_error().coarse.problem.rtol <= 0.003 / ratio
    for other in (bem.HalfSpace(30.0), bem.Layered(0.3, 0.1, 0.3, "rigid")):
        assert replace(contact.problem, body=other).settlement_ratio == 1
    assert replace(contact.problem, boundary="mirror").settlement_ratio == 1


def test_grids_whose_cells_are_no_smaller_than_the_layer_are_not_solved(monkeypatch):
    heights = map_of_waves(240, "periodic")
    setting = {"pressure": 0.006, "boundary": "periodic"}
    body = bem.Layered(0.01, 30.0, 0.3, bem.HalfSpace(1.0))
    contact = bem.solve_within(heights, 1.0, 0.03, body=body, **setting)
    assert contact.problem.is_deeper_than_cells
    nodes = bem.solve_within(heights, 1.0, 0.03, **setting).budget.nodes
    spacing = 1 / nodes[0], 1 / nodes[1]
    assert not replace(contact.problem, spacing=spacing).is_deeper_than_cells
    monkeypatch.setattr("bem.accuracy.solve_posed", lambda *_: pytest.fail("a solve"))
    with pytest.raises(bem.NotReachable, match=r"a cell .* is no smaller than the layer"):
        bem.solve_within(
            heights, 1.0, 0.03, body=replace(body, thickness=1e-3), **setting
        )


def test_bodies_that_yield_are_answered():
    heights = map_of_waves(192, "periodic")
    setting = {"pressure": 0.006, "hardness": 0.05, "boundary": "periodic"}
    contact = bem.solve_within(heights, 1.0, 0.03, **setting)
    full = bem.solve(heights, 1.0, **setting)
    assert contact.pressure.size < heights.size
    assert contact.continuum_area_percent == pytest.approx(
        full.continuum_area_percent, rel=0.03
    )


@pytest.mark.parametrize("hurst", [0.2, 0.9])
def test_roughness_down_to_the_grid_is_refused_before_any_solve(hurst, monkeypatch):
    monkeypatch.setattr("bem.accuracy.solve_posed", lambda *_: pytest.fail("a solve"))
    heights = random_waves(1, 63, hurst, 0)(128)
    with pytest.raises(
        bem.NotReachable, match=r"area to 3 %.*waves go on down to the grid"
    ):
        bem.solve_within(heights, 1.0, 0.03, pressure=0.01, boundary="periodic")


def test_too_few_nodes_are_refused_with_the_best_bar():
    heights = random_waves(1, 12, 0.8, 0)(64)
    with pytest.raises(
        bem.NotReachable, match=r"the best is area to .* %, on .* nodes"
    ) as info:
        bem.solve_within(heights, 1.0, 0.001, pressure=0.01, boundary="periodic")
    refusal = info.value
    assert refusal.contact is not None
    assert refusal.budget.trials
    assert not any(trial.meets_errors for trial in refusal.budget.trials)


def test_few_nodes_in_contact_are_refused_with_the_reason():
    heights = 100 * random_waves(1, 4, 0.8, 1)(48)
    with pytest.raises(
        bem.NotReachable, match=r"no bar holds: .* as large as a cell"
    ) as info:
        bem.solve_within(heights, 100.0, 0.03, pressure=4e-9, boundary="mirror")
    again = pickle.loads(
        pickle.dumps(bem.NotReachable(str(info.value), info.value.budget))
    )
    assert str(again) == str(info.value)


@pytest.mark.parametrize("load", [{"delta": 0.0}, {"delta": -1.0}, {"force": 0.0}])
def test_bodies_without_a_load_are_exact(load):
    contact = bem.solve_within(map_of_waves(64, "free"), 1.0, 0.001, **load)
    assert contact.contact_nodes == contact.convolutions == 0
    assert contact.budget.trials == ()
    assert contact.budget.nodes == (64, 64)
    assert contact.budget.work == 0


@pytest.mark.parametrize(
    ("error", "settings", "message"),
    [
        (0.0, {}, "error of area = 0"),
        (1.0, {}, "error of area = 1"),
        ("1%", {}, "error of area"),
        ({}, {}, "empty"),
        ({"gap": 0.1}, {}, "answers with an error are area, mean_gap"),
        (0.1, {"rtol": 1e-3}, "rtol is given"),
        (0.1, {"near": None}, "near is given"),
        (0.1, {"kernel": "concentrated-force"}, "belongs to its grid"),
        (0.1, {"body": ConcentratedForces(1.0)}, "belongs to its grid"),
        (0.1, {"far_field": "compliant"}, "belongs to its grid"),
        (0.1, {"force": 1.0}, "force and pressure given"),
        (0.1, {"hardness": 0.001}, "mean pressure must stay below"),
    ],
)
def test_what_cannot_be_asked_is_refused(error, settings, message):
    with pytest.raises(ValueError, match=message):
        bem.solve_within(map_of_waves(32, "free"), 1.0, error, pressure=0.01, **settings)


def test_loads_on_one_prepared_surface_are_as_those_on_their_own():
    heights = map_of_waves(96, "mirror")
    settings = {"boundary": "mirror", "hardness": 0.2, "modulus": 2.0}
    surface = bem.Surface(heights, 1.0, **settings)
    for pressure in (0.02, 0.005, 0.02):
        contact = surface.solve_within(0.05, pressure=pressure)
        alone = bem.solve_within(heights, 1.0, 0.05, pressure=pressure, **settings)
        assert (contact.pressure == alone.pressure).all()
        assert contact.budget == alone.budget


def test_a_surface_is_prepared_without_a_load():
    with pytest.raises(ValueError, match="pressure is given: a surface is prepared"):
        bem.Surface(map_of_waves(32, "free"), 1.0, pressure=1.0)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_a_flat_map_without_edges_touches_everywhere(boundary):
    heights = np.zeros((96, 96))
    contact = bem.solve_within(heights, 1.0, 0.03, pressure=0.01, boundary=boundary)
    assert contact.continuum_area_percent == 100


def test_loads_on_one_prepared_surface_transform_its_map_once(monkeypatch):
    surface = bem.Surface(map_of_waves(96, "periodic"), 1.0, boundary="periodic")
    surface.solve_within(0.05, pressure=0.01)
    monkeypatch.setattr(
        "bem.coarsening.row_transform", lambda *_: pytest.fail("a transform")
    )
    surface.solve_within(0.05, pressure=0.012)


def test_without_an_error_nothing_is_judged(monkeypatch):
    monkeypatch.setattr("bem.accuracy.grids", lambda *_: pytest.fail("grids"))
    monkeypatch.setattr(
        "bem.contact.grid_error_of", lambda *_: pytest.fail("a coarser grid")
    )
    contact = bem.solve(
        map_of_waves(64, "periodic"), 1.0, pressure=0.01, boundary="periodic"
    )
    assert contact.budget is None
    assert contact.problem.datum is None
