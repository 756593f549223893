"""How fast force and area approach the closed forms, on odd and on even grids."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem.analytic import PowerLaw, distances_to_centre
from tests.bem.convergence import (
    PROFILES,
    RADIUS,
    RTOL,
    SIDE,
    Profile,
    area_order,
    convergence,
    fitted_order,
    force_order,
)

GRIDS = {"odd": (17, 25, 33, 49, 65, 97, 129), "even": (16, 24, 32, 48, 64, 96, 128)}
*SMOOTH, FLAT_PUNCH = PROFILES
SPHERE = PROFILES[0]

smooth_profiles = pytest.mark.parametrize("profile", SMOOTH, ids=lambda profile: profile.name)
parities = pytest.mark.parametrize("grids", GRIDS.values(), ids=GRIDS)


@parities
@smooth_profiles
def test_smooth_profiles_have_force_of_order_2_and_area_of_order_1(
    profile: Profile, grids: tuple[int, ...]
) -> None:
    rows = convergence(profile, grids)
    assert 1.75 < force_order(rows) < 2.15
    assert 0.9 < area_order(rows) < 1.15
    assert all(row.force_error < 0.12 * row.spacing**2 for row in rows)
    assert all(row.area_error < 0.4 * row.spacing for row in rows)


@parities
def test_flat_punches_have_force_of_order_1_and_area_of_order_three_halves(
    grids: tuple[int, ...],
) -> None:
    """The singular pressure at the edge costs an order of the force."""
    rows = convergence(FLAT_PUNCH, grids)
    assert 0.85 < force_order(rows) < 1.2
    assert 1.2 < area_order(rows) < 1.75


@parities
@smooth_profiles
def test_the_concentrated_force_costs_an_order(profile: Profile, grids: tuple[int, ...]) -> None:
    rows = convergence(profile, grids, "concentrated-force")
    assert 0.95 < force_order(rows) < 1.15
    assert all(0.2 < row.force_error / row.spacing < 0.35 for row in rows)
    assert 0.5 < area_order(rows) < 0.9  # on its way to 1


@pytest.mark.parametrize("nodes", [16, 17, 32, 33, 64, 65, 128, 129])
@pytest.mark.parametrize("profile", SMOOTH, ids=lambda profile: profile.name)
def test_centred_indenters_stay_below_the_same_bounds(profile: Profile, nodes: int) -> None:
    """Where the tip is a node, and where it lies between four."""
    (row,) = convergence(profile, [nodes], placements=1)
    assert row.force_error < 0.2 * row.spacing**2
    assert row.area_error < 0.5 * row.spacing


@settings(max_examples=60)
@given(
    exponent=st.floats(1, 8),
    radius=st.floats(200, 400),
    shape=st.tuples(st.integers(24, 65), st.integers(24, 65)),
    second_side=st.floats(900, 1100),
    shares=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    modulus=st.floats(1e-3, 1e6),
)
def test_any_power_law_is_met_on_any_grid(
    exponent: float,
    radius: float,
    shape: tuple[int, int],
    second_side: float,
    shares: tuple[float, float],
    modulus: float,
) -> None:
    """Square cells or not, the axis anywhere in its cell: the radius to half a cell."""
    indenter = PowerLaw(1 / PowerLaw(1.0, exponent).indentation(radius), exponent)
    sides, delta = (1000.0, second_side), 1.0
    spacing = sides[0] / (shape[0] - 1), sides[1] / (shape[1] - 1)
    shift = shares[0] * spacing[0], shares[1] * spacing[1]
    heights = indenter.heights(distances_to_centre(shape, sides, shift))
    contact = bem.solve(heights, sides, delta + heights.max(), modulus=modulus, rtol=1e-8)
    cell = max(spacing) / radius
    assert contact.force == pytest.approx(indenter.force(delta, modulus), rel=0.3 * cell**2)
    area = contact.contact_nodes * spacing[0] * spacing[1]
    assert area == pytest.approx(np.pi * radius**2, rel=cell)


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0])
def test_powers_of_the_spacing_are_fitted_exactly(order: float) -> None:
    spacings = [0.3, 0.1, 0.07, 0.01]
    errors = [5 * spacing**order for spacing in spacings]
    assert fitted_order(spacings, errors) == pytest.approx(order, rel=1e-12)


def test_rows_hold_the_errors_of_centred_indenters() -> None:
    rows = convergence(SPHERE, (16, 33), placements=1)
    assert [row.nodes for row in rows] == [16, 33]
    for row in rows:
        heights = SPHERE.indenter.heights(distances_to_centre((row.nodes, row.nodes), SIDE))
        contact = bem.solve(heights, SIDE, SPHERE.delta + heights.max(), rtol=RTOL)
        cell = contact.problem.spacing[0]
        assert row.spacing == pytest.approx(cell / RADIUS, rel=1e-14)
        force_error = abs(contact.force / SPHERE.indenter.force(SPHERE.delta) - 1)
        assert row.force_error == pytest.approx(force_error, rel=1e-9)
        area = contact.area_percent / 100 * (row.nodes * cell) ** 2
        area_error = abs(area / (np.pi * RADIUS**2) - 1)
        assert row.area_error == pytest.approx(area_error, rel=1e-9)


def test_errors_are_averaged_over_the_placements() -> None:
    (alone,) = convergence(FLAT_PUNCH, [24], placements=1)
    (pair,) = convergence(FLAT_PUNCH, [24], placements=2)
    (many,) = convergence(FLAT_PUNCH, [24], placements=32)
    (more,) = convergence(FLAT_PUNCH, [24], placements=64)
    assert pair.force_error >= alone.force_error / np.sqrt(2)
    assert more.force_error == pytest.approx(many.force_error, rel=0.1)


@pytest.mark.parametrize("profile", PROFILES, ids=lambda profile: profile.name)
def test_contacts_have_one_radius(profile: Profile) -> None:
    radius = profile.indenter.contact_radius(profile.delta)
    assert radius == pytest.approx(RADIUS, rel=1e-12)
    assert 2 * radius < SIDE


def test_kernels_have_different_orders() -> None:
    nodes = (16, 24, 32, 48)
    assert force_order(convergence(SPHERE, nodes)) > 1.7
    concentrated = convergence(SPHERE, nodes, "concentrated-force")
    assert force_order(concentrated) < 1.2
