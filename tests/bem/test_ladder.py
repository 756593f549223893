"""Ladders of loads, against single solves at the same loads."""

from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import bem
from bem import equilibrium
from bem.equilibrium import Equilibrium, Start
from bem.influence import KERNELS, Kernel
from bem.problem import FAR_FIELDS, FarField
from gen.surface import generate

pytestmark = pytest.mark.usefixtures("both_ways")

ROUGH = generate("diamond-square", 65, 0.65, 12.5, np.random.default_rng(4))


@pytest.mark.parametrize("deltas", [np.linspace(-1, 45, 24), [30.0, 30.0, 3.0, 44.0], [7.0]])
@pytest.mark.parametrize("kernel", KERNELS)
def test_a_ladder_gives_what_single_solves_give(deltas: list[float], kernel: Kernel) -> None:
    ladder = list(bem.ladder(ROUGH, 1000.0, deltas, modulus=2.0, kernel=kernel, rtol=1e-9))
    assert len(ladder) == len(deltas)
    for contact, delta in zip(ladder, deltas, strict=True):
        alone = bem.solve(ROUGH, 1000.0, delta, modulus=2.0, kernel=kernel, rtol=1e-9)
        assert contact.delta == delta
        assert contact.contact_nodes == alone.contact_nodes
        assert contact.force == pytest.approx(alone.force, rel=1e-8)
        np.testing.assert_allclose(
            contact.pressure, alone.pressure, rtol=0, atol=1e-6 * alone.pressure.max(initial=1e-300)
        )


def test_a_ladder_on_a_compliant_far_field() -> None:
    for contact in bem.ladder(ROUGH, 1000.0, [5.0, 10.0, 15.0], far_field="compliant"):
        alone = bem.solve(ROUGH, 1000.0, contact.delta, far_field="compliant")
        assert contact.force == pytest.approx(alone.force, rel=1e-7)


def test_a_ladder_stops_at_the_delta_that_is_to_blame() -> None:
    rungs = bem.ladder(ROUGH, 1000.0, [5.0, np.nan])
    next(rungs)
    with pytest.raises(ValueError, match="delta = nan"):
        next(rungs)


def test_a_ladder_of_small_steps_saves_convolutions() -> None:
    deltas = np.linspace(15, 45, 31)
    ladder = sum(c.convolutions for c in bem.ladder(ROUGH, 1000.0, deltas))
    single = sum(bem.solve(ROUGH, 1000.0, delta).convolutions for delta in deltas)
    assert ladder < 0.65 * single


@pytest.mark.parametrize("far_field", FAR_FIELDS)
@pytest.mark.parametrize("loads", [np.geomspace(1e-4, 0.1, 16), [0.02, 0.0, 0.02, 0.001], [0.01]])
@pytest.mark.parametrize("name", ["forces", "pressures"])
def test_ladders_of_forces_and_pressures(
    name: str, loads: list[float], far_field: FarField
) -> None:
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


def test_a_ladder_of_pressures_saves_convolutions() -> None:
    pressures = np.linspace(0.02, 0.1, 31)
    ladder = sum(c.convolutions for c in bem.ladder(ROUGH, 1000.0, pressures=pressures))
    single = sum(bem.solve(ROUGH, 1000.0, pressure=p).convolutions for p in pressures)
    assert ladder < 0.75 * single


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "no loads given"),
        ({"deltas": [1.0], "forces": [1.0]}, "deltas and forces given"),
        ({"forces": [1.0], "pressures": [1.0]}, "forces and pressures given"),
        ({"pressures": [-1.0]}, "pressure = -1.0: must be at least 0 MPa"),
    ],
)
def test_a_ladder_has_one_kind_of_load(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        list(bem.ladder(ROUGH, 1000.0, **given))


def test_a_load_that_is_not_solved_from_the_contacts_before_is_solved_from_scratch(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def spoilt(problem: bem.Problem, near: Start | None, **how: Any) -> Equilibrium | None:
        few = problem if near is None else replace(problem, max_iterations=1)
        return equilibrium.equilibrium_of(few, near, **how)

    monkeypatch.setattr(import_module("bem.solving"), "equilibrium_of", spoilt)
    for contact in bem.ladder(ROUGH, 1000.0, [20.0, 25.0, 30.0, 35.0]):
        assert contact.force == bem.solve(ROUGH, 1000.0, contact.delta).force


def test_a_ladder_goes_on_after_a_load_that_could_not_be_solved() -> None:
    few = {"max_iterations": 2, "boundary": "mirror"}
    rungs = bem.ladder(ROUGH, 1000.0, [0.01, 10.0, np.nan, 0.02], **few)
    assert next(rungs).delta == 0.01
    with pytest.raises(bem.NotConverged, match=r"raise max_iterations \(2\)$"):
        next(rungs)
    with pytest.raises(ValueError, match="delta = nan"):
        next(rungs)
    assert [contact.delta for contact in rungs] == [0.02]


def violation(contact: bem.Contact) -> float:
    """Largest |gap| in contact or penetration outside, over Delta, by a convolution of its own."""
    gap = np.where(contact.pressure > 0, np.abs(contact.gap), -contact.gap)
    return float(gap.max() / contact.delta)


@pytest.mark.parametrize("deltas", [np.linspace(5, 45, 15), np.linspace(45, 5, 15), [30.0] * 3])
@pytest.mark.parametrize("rtol", [1e-4, 2e-7, 1e-11])
def test_every_rung_is_certified_anew(deltas: list[float], rtol: float) -> None:
    """The residual is recomputed from the pressure, whatever the start was."""
    for contact in bem.ladder(ROUGH, 1000.0, deltas, rtol=rtol):
        assert contact.residual == pytest.approx(violation(contact), rel=1e-3, abs=1e-14)
        assert contact.residual <= rtol
