"""Ladders of loads, given forces, and starts from a coarser grid or a pressure nearby."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem import dense, equilibrium
from bem.bodies import KERNELS
from bem.operators import filters
from bem.problem import FAR_FIELDS
from bench.references.surfaces import SURFACES, surface
from gen.runtime.farm import time_limit
from gen.surface import generate

pytestmark = pytest.mark.usefixtures("both_ways")

ROUGH = generate("diamond-square", 65, 0.65, 12.5, np.random.default_rng(4))


@pytest.mark.parametrize(
    "deltas", [np.linspace(-1, 45, 24), [30.0, 30.0, 3.0, 44.0], [7.0]]
)
@pytest.mark.parametrize("kernel", KERNELS)
def test_a_ladder_gives_what_single_solves_give(deltas, kernel):
    ladder = list(
        bem.ladder(ROUGH, 1000.0, deltas, modulus=2.0, kernel=kernel, rtol=1e-9)
    )
    assert len(ladder) == len(deltas)
    for contact, delta in zip(ladder, deltas, strict=True):
        alone = bem.solve(ROUGH, 1000.0, delta, modulus=2.0, kernel=kernel, rtol=1e-9)
        assert contact.delta == delta
        assert contact.residual <= 1e-9
        assert contact.contact_nodes == alone.contact_nodes
        assert contact.force == pytest.approx(alone.force, rel=1e-8)
        np.testing.assert_allclose(
            contact.pressure,
            alone.pressure,
            rtol=0,
            atol=1e-6 * alone.pressure.max(initial=1e-300),
        )


@pytest.mark.few(8)
@pytest.mark.parametrize("far_field", FAR_FIELDS)
@pytest.mark.parametrize(
    "loads", [np.geomspace(1e-4, 0.1, 16), [0.02, 0.0, 0.02, 0.001], [0.01]]
)
@pytest.mark.parametrize("name", ["forces", "pressures"])
def test_ladders_of_forces_and_pressures(name, loads, far_field):
    unit = 1e6 * (65 / 64) ** 2 if name == "forces" else 1.0  # um2 of all cells
    settings: dict[str, Any] = {"modulus": 2.0, "far_field": far_field, "rtol": 1e-9}
    given: dict[str, Any] = {name: [unit * load for load in loads]}
    contacts = list(bem.ladder(ROUGH, 1000.0, **given, **settings))
    assert len(contacts) == len(loads)
    for contact, load in zip(contacts, loads, strict=True):
        alone = bem.solve(ROUGH, 1000.0, pressure=load, **settings)
        assert contact.contact_nodes == alone.contact_nodes
        assert contact.force == pytest.approx(1e6 * (65 / 64) ** 2 * load, rel=2e-6)
        assert contact.approach == pytest.approx(alone.approach, rel=1e-7)
        assert contact.residual <= 1e-9


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "no loads given"),
        ({"deltas": [1.0], "forces": [1.0]}, "deltas and forces given"),
        ({"forces": [1.0], "pressures": [1.0]}, "forces and pressures given"),
        ({"pressures": [-1.0]}, "pressure = -1.0: must be at least 0 MPa"),
    ],
)
def test_a_ladder_has_one_kind_of_load(given, told):
    with pytest.raises(ValueError, match=told):
        list(bem.ladder(ROUGH, 1000.0, **given))


def test_a_load_that_is_not_solved_from_the_contacts_before_is_solved_from_scratch(
    monkeypatch,
):
    def spoilt(problem, near, **how):
        few = problem if near is None else replace(problem, max_iterations=1)
        return equilibrium.equilibrium_of(few, near, **how)

    monkeypatch.setattr(import_module("bem.solving"), "equilibrium_of", spoilt)
    for contact in bem.ladder(ROUGH, 1000.0, [20.0, 25.0, 30.0, 35.0]):
        assert contact.force == bem.solve(ROUGH, 1000.0, contact.delta).force


def test_a_ladder_goes_on_after_a_load_that_could_not_be_solved():
    few = {"max_iterations": 2, "boundary": "mirror"}
    rungs = bem.ladder(ROUGH, 1000.0, [0.01, 10.0, np.nan, 0.02], **few)
    assert next(rungs).delta == 0.01
    with pytest.raises(bem.NotConverged, match=r"raise max_iterations \(2\)$"):
        next(rungs)
    with pytest.raises(ValueError, match="delta = nan"):
        next(rungs)
    assert [contact.delta for contact in rungs] == [0.02]


@pytest.mark.parametrize("name", ["near", "moduls", "force"])
def test_a_ladder_refuses_unknown_arguments_at_once(name):
    with pytest.raises(TypeError, match=rf"^ladder\(\) takes no argument {name}: "):
        bem.ladder(ROUGH, 1000.0, [0.01, 0.02], **{name: 1.0})


def test_a_residual_that_is_no_number_is_refused(monkeypatch):
    monkeypatch.setattr(
        import_module("bem.solving"), "_violation", lambda contact: np.nan
    )
    with pytest.raises(bem.NotConverged):
        bem.solve(ROUGH, 1000.0, 10.0, boundary="mirror", max_iterations=2)


RTOL = 1e-9


@settings(max_examples=60)
@given(
    kind=st.sampled_from(list(SURFACES)),
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(2, 24), st.integers(2, 24)),
    kernel=st.sampled_from(KERNELS),
    share=st.floats(0.01, 3.0),
)
def test_force_and_displacement_lead_to_one_another(kind, seed, shape, kernel, share):
    heights = surface(kind, shape, seed)
    side = (10.0 * (shape[0] - 1), 10.0 * (shape[1] - 1))
    delta = share * (float(np.ptp(heights)) or 1.0)
    given_delta = bem.solve(heights, side, delta, modulus=7.0, kernel=kernel, rtol=RTOL)
    given_force = bem.solve(
        heights, side, force=given_delta.force, modulus=7.0, kernel=kernel, rtol=RTOL
    )
    assert given_force.force == pytest.approx(given_delta.force, rel=2e-6)
    assert given_force.delta == pytest.approx(delta, rel=1e-5)
    largest = given_delta.pressure.max()
    assert np.abs(given_force.pressure - given_delta.pressure).max() < 1e-4 * largest
    assert given_force.residual <= RTOL


@pytest.mark.parametrize("nodes", [1, 9])
def test_flat_surfaces_and_single_nodes_have_a_displacement(nodes):
    flat = np.zeros((nodes, nodes))
    delta = bem.solve(flat, 1.0, force=5.0, spacing=2.0).delta
    assert bem.solve(flat, 1.0, delta, spacing=2.0).force == pytest.approx(5.0, rel=1e-5)


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("pressure", [1e-30, 1e-24, 1e-15, 1e-6])
def test_forces_far_below_any_guess_are_carried(pressure):
    """The highest node of the grid is not among those that the displacement is guessed on."""
    heights = generate("diamond-square", 513, 0.7, 12.5, np.random.default_rng(0))
    contact = bem.solve(heights, 1.0, pressure=pressure, spacing=1.0)
    assert contact.pressure.mean() == pytest.approx(pressure, rel=1e-6)
    assert 0 < contact.delta < 1


@pytest.mark.parametrize(
    ("shape", "row", "columns", "pressure", "rtol"),
    [
        ((19, 28), 9, [14], 0.018963090011501784, 1e-12),
        *(((12, 37), row, [], 0.030927496547942784, 1e-10) for row in range(6)),
    ],
)
def test_ties_under_tight_tolerances_end(shape, row, columns, pressure, rtol):
    """Rounding in the displacement of the far field must not add to the residual."""
    heights = np.zeros(shape)
    heights[row] = heights[:, columns] = 1
    with time_limit(20):
        contact = bem.solve(heights, 1.0, pressure=pressure, spacing=1.0, rtol=rtol)
    assert contact.residual <= rtol
    assert contact.iterations < 60


@pytest.mark.parametrize(
    ("side", "scale", "load"),
    [(1e50, 1.0, {"force": 1e-300}), (1.0, 1e200, {"force": 1e-150})],
)
def test_forces_that_would_vanish_or_overflow_are_refused(side, scale, load):
    with pytest.raises(bem.OutOfRange, match="double precision"):
        bem.solve(scale * ROUGH[:20, :20], side, **load)


@pytest.mark.few(40)
@pytest.mark.parametrize("shape", [(65, 65), (64, 66), (70, 41), (37, 90)])
@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", SURFACES)
def test_a_nested_start_changes_no_answer(name, kernel, shape, monkeypatch):
    heights = surface(name, shape, seed=3)
    delta = 0.6 * float(heights.max() - heights.min())
    settings = {"spacing": 1.0, "kernel": kernel, "rtol": 1e-9}
    plain = bem.solve(heights, 1000.0, delta, **settings)  # type: ignore[arg-type]
    for least in ("NESTED", "NESTED_FAINT"):
        monkeypatch.setattr(f"bem.equilibrium.{least}", 9)
    nested = bem.solve(heights, 1000.0, delta, **settings)  # type: ignore[arg-type]
    assert nested.residual <= 1e-9
    assert nested.force == pytest.approx(plain.force, rel=1e-7)
    scale = plain.pressure.max()
    np.testing.assert_allclose(nested.pressure, plain.pressure, rtol=0, atol=1e-5 * scale)


def test_a_grid_that_starts_from_coarser_ones_keeps_its_own_filters(monkeypatch):
    """They take longest to make, and a second load needs them again."""
    for least in ("NESTED", "NESTED_FAINT"):
        monkeypatch.setattr(f"bem.equilibrium.{least}", 20)
    monkeypatch.setattr(equilibrium, "FEW_NODES", 0)
    monkeypatch.setattr(filters, "KEPT_BYTES", 0)
    monkeypatch.setattr(filters, "KEPT_LARGEST", 0)

    def kept_by_a_solve():
        bem.solve(ROUGH, 1000.0, 2 * float(ROUGH.max() - ROUGH.min()))
        return [arguments[0] for _, *arguments in filters._KEPT.filters]

    with ThreadPoolExecutor(1) as fresh:  # it keeps no filters of earlier tests
        shapes = fresh.submit(kept_by_a_solve).result()
    assert (
        shapes.count((65, 65)) == 4
    )  # both precisions, the inverse, and means over blocks
    assert {shape[1] for shape in shapes} == {65}


def test_a_peak_between_the_coarser_nodes_starts_from_nothing(monkeypatch):
    heights = np.zeros((41, 41))
    heights[20:23, 20:23] = 1.0
    heights[21, 21] = 3.0  # odd in both directions: every second node misses it
    heights -= np.random.default_rng(0).random(heights.shape) / 10
    for least in ("NESTED", "NESTED_FAINT"):
        monkeypatch.setattr(f"bem.equilibrium.{least}", 3)
    monkeypatch.setattr(equilibrium, "FEW_NODES", 0)
    contact = bem.solve(heights, 40.0, 1.5)
    assert contact.contact_nodes == 1


@pytest.mark.parametrize("amount", [1e50, 1e300])
def test_a_start_beyond_all_bounds_is_left_aside(amount):
    heights = surface("white noise", (65, 65))
    with time_limit(20):
        contact = bem.solve(heights, 1.0, 0.3, near=np.full((65, 65), amount))
    assert contact.force == bem.solve(heights, 1.0, 0.3).force


def test_sets_that_cycle_are_left_to_iterations(monkeypatch):
    monkeypatch.setattr(dense.ContactFactor.solve, "__defaults__", (1,))
    heights = surface("self-affine", (9, 9), 1)
    contact = bem.solve(heights, 8.0, 0.7 * float(np.ptp(heights)))
    assert contact.residual <= 1e-6
    assert contact.iterations > 1
