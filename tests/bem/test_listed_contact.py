"""The steps of a solve on lists of nodes: those on whole fields, for small contacts."""

from typing import Any

import numpy as np
import pytest

import bem
from bem import elastic_load
from bem.listed_contact import OnLists
from bem.spacing import Boundary
from bem.under_load import OnFields, Steps, approach, press_under_load
from bem.whole_patch import Pressed, WholePatch, cut_to_load, touching_nodes

EDGELESS: list[Boundary] = ["periodic", "mirror"]
SHAPES = [(48, 60), (31, 75)]


def rough(shape: tuple[int, int]) -> np.ndarray:
    """Return heights that are smooth over some cells, less the highest."""
    random = np.random.default_rng(shape)
    waves = np.fft.rfft2(random.standard_normal(shape))
    orders = np.hypot.outer(np.fft.fftfreq(shape[0]), np.fft.rfftfreq(shape[1]))
    heights = np.fft.irfft2(waves / (0.05 + orders) ** 2, s=shape) / 100
    return np.asarray(heights - heights.max())


def started(shape: tuple[int, int], boundary: Boundary, share: float) -> tuple[WholePatch, Pressed]:
    """Return a patch under a load that a share of the nodes would carry alone, and a start."""
    below = rough(shape)
    patch = WholePatch(below, boundary, 1.0, share * 0.05 * below.size)
    return patch, patch.start(patch.full_contact())


def violation(patch: WholePatch, pressed: Pressed) -> float:
    """Return the violation of a pressure, over the displacement, from a convolution of its own."""
    fresh = patch.press(pressed.pressure, pressed.effort)
    return fresh.violation() / fresh.shift


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("share", [0.004, 0.04, 0.4])
@pytest.mark.parametrize("shape", SHAPES)
def test_lists_and_fields_lead_to_the_same_contact(
    shape: tuple[int, int], share: float, boundary: Boundary
) -> None:
    patch, pressed = started(shape, boundary, share)
    copy = Pressed(pressed.pressure.copy(), pressed.residual.copy(), pressed.shift, pressed.effort)
    steps: list[Steps] = [OnLists(patch, pressed), OnFields(patch, copy)]
    for way in steps:
        approach(way)
        assert press_under_load(way, rtol=1e-9, least=1.0, max_iterations=1000)
        assert violation(patch, way.pressed) <= 1.01e-9
        assert way.pressed.pressure.min() >= 0
        assert way.pressed.pressure.sum() == pytest.approx(patch.load, rel=1e-12)
    np.testing.assert_array_equal(pressed.pressure > 0, copy.pressure > 0)
    assert pressed.shift == pytest.approx(copy.shift, rel=1e-9)
    largest = copy.pressure.max()
    np.testing.assert_allclose(pressed.pressure, copy.pressure, atol=1e-7 * largest)


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("kind", [OnLists, OnFields])
def test_a_projected_step_knows_its_residual(boundary: Boundary, kind: Any) -> None:
    patch, pressed = started((48, 60), boundary, 0.05)
    steps = kind(patch, pressed)
    before = steps.violation()
    for _ in range(3):
        steps.approach_step()
    steps.finish()
    assert steps.violation() < 0.5 * before
    fresh = patch.press(pressed.pressure, pressed.effort)
    assert fresh.shift == pytest.approx(pressed.shift, rel=1e-5)
    np.testing.assert_allclose(pressed.residual, fresh.residual, atol=1e-5 * fresh.shift)
    assert pressed.pressure.sum() == pytest.approx(patch.load, rel=1e-6)


@pytest.mark.parametrize("boundary", EDGELESS)
def test_dense_algebra_solves_on_the_set_that_it_is_given(boundary: Boundary) -> None:
    patch, pressed = started((48, 60), boundary, 0.01)
    steps = OnLists(patch, pressed)
    approach(steps)
    assert 0 < steps.touching() <= 300
    before = steps.violation()
    steps.factorise(few=300, most_sets=20, rtol=1e-9)
    steps.finish()
    assert steps.exact
    assert steps.violation() < before
    under = pressed.pressure > 0
    assert np.abs(pressed.residual[under]).max() <= 1e-9 * pressed.shift
    assert pressed.effort.iterations >= 1


@pytest.mark.parametrize(("few", "most_sets"), [(3, 20), (300, 0)])
def test_large_sets_and_bounded_solves_are_left_as_they_are(few: int, most_sets: int) -> None:
    patch, pressed = started((48, 60), "periodic", 0.01)
    steps = OnLists(patch, pressed)
    approach(steps)
    before, effort = steps.violation(), pressed.effort
    steps.factorise(few, most_sets, 1e-9)
    assert steps.violation() == before
    assert pressed.effort == effort
    assert not steps.exact


def test_a_singular_matrix_is_left_to_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    patch, pressed = started((48, 60), "periodic", 0.01)
    steps = OnLists(patch, pressed)
    approach(steps)
    before = steps.violation()

    def fail(*_: Any) -> None:
        raise np.linalg.LinAlgError

    monkeypatch.setattr(OnLists, "_solve_on", fail)
    steps.factorise(300, 20, 1e-9)
    assert steps.violation() == before
    assert press_under_load(steps, rtol=1e-9, least=1.0, max_iterations=1000)


@pytest.mark.parametrize("listed", [0.0, 1.0])
@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("pressure", [0.001, 0.01, 0.1])
def test_the_choice_of_lists_or_fields_changes_no_contact(
    pressure: float, boundary: Boundary, listed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings: dict[str, Any] = {"spacing": 1.0, "boundary": boundary, "pressure": pressure}
    heights = rough((60, 44))
    usual = bem.solve(heights, 1.0, rtol=1e-10, **settings)
    monkeypatch.setattr(elastic_load, "LISTED", listed)
    monkeypatch.setattr(elastic_load, "few_nodes", lambda _: 0)
    other = bem.solve(heights, 1.0, rtol=1e-10, **settings)
    assert other.contact_nodes == usual.contact_nodes
    assert other.delta == pytest.approx(usual.delta, rel=1e-9)
    largest = usual.largest_pressure
    np.testing.assert_allclose(other.pressure, usual.pressure, atol=1e-8 * largest)


@pytest.mark.parametrize("load", [1e-6, 1.0, 3e2, 1e5])
def test_a_constant_that_is_guessed_from_a_sample_leaves_the_load(load: float) -> None:
    pressure = np.random.default_rng(8).standard_normal((120, 130))
    cut = cut_to_load(pressure, load)
    assert cut.sum() == pytest.approx(load, rel=1e-13)
    pressed = cut > 0
    constants = pressure[pressed] - cut[pressed]
    np.testing.assert_allclose(constants, constants[0], atol=1e-11 * max(load, 1))
    assert pressure[~pressed].max(initial=-np.inf) <= constants[0] + 1e-11


def test_touching_nodes_are_those_under_pressure_or_that_penetrate() -> None:
    patch, pressed = started((48, 60), "mirror", 0.05)
    steps = OnLists(patch, pressed)
    assert steps.touching() == touching_nodes(pressed)
