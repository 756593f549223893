"""The rows of the report on orders of convergence, and the fit through them."""

import numpy as np
import pytest

import bem
from bem.analytic import distances_to_centre
from tests.bem import convergence as orders

SPHERE, *_, FLAT_PUNCH = orders.PROFILES


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0])
def test_powers_of_the_spacing_are_fitted_exactly(order: float) -> None:
    spacings = [0.3, 0.1, 0.07, 0.01]
    errors = [5 * spacing**order for spacing in spacings]
    assert orders.fitted_order(spacings, errors) == pytest.approx(order, rel=1e-12)


def test_rows_hold_the_errors_of_centred_indenters() -> None:
    rows = orders.convergence(SPHERE, (16, 33), placements=1)
    assert [row.nodes for row in rows] == [16, 33]
    for row in rows:
        heights = SPHERE.indenter.heights(distances_to_centre((row.nodes, row.nodes), orders.SIDE))
        contact = bem.solve(heights, orders.SIDE, SPHERE.delta + heights.max(), rtol=orders.RTOL)
        cell = contact.problem.spacing[0]
        assert row.spacing == pytest.approx(cell / orders.RADIUS, rel=1e-14)
        force_error = abs(contact.force / SPHERE.indenter.force(SPHERE.delta) - 1)
        assert row.force_error == pytest.approx(force_error, rel=1e-9)
        area = contact.area_percent / 100 * (row.nodes * cell) ** 2
        area_error = abs(area / (np.pi * orders.RADIUS**2) - 1)
        assert row.area_error == pytest.approx(area_error, rel=1e-9)


def test_errors_are_averaged_over_the_placements() -> None:
    (alone,) = orders.convergence(FLAT_PUNCH, [24], placements=1)
    (pair,) = orders.convergence(FLAT_PUNCH, [24], placements=2)
    (many,) = orders.convergence(FLAT_PUNCH, [24], placements=32)
    (more,) = orders.convergence(FLAT_PUNCH, [24], placements=64)
    assert pair.force_error >= alone.force_error / np.sqrt(2)
    assert more.force_error == pytest.approx(many.force_error, rel=0.1)


@pytest.mark.parametrize("profile", orders.PROFILES, ids=lambda profile: profile.name)
def test_contacts_have_one_radius(profile: orders.Profile) -> None:
    radius = profile.indenter.contact_radius(profile.delta)
    assert radius == pytest.approx(orders.RADIUS, rel=1e-12)
    assert 2 * radius < orders.SIDE


def test_kernels_have_different_orders() -> None:
    nodes = (16, 24, 32, 48)
    assert orders.force_order(orders.convergence(SPHERE, nodes)) > 1.7
    concentrated = orders.convergence(SPHERE, nodes, "concentrated-force")
    assert orders.force_order(concentrated) < 1.2
