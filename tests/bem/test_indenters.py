"""Indenters against their closed forms: force, area and pressure on odd and even grids."""

import numpy as np
import pytest

import bem
from bem.analytic import Cone, FlatPunch, Indenter, Paraboloid, distances_to_centre
from bem.influence import Kernel

pytestmark = pytest.mark.usefixtures("both_ways")

SIDE = 1000.0  # um; with R, the example of the paper's section 2.4
SPHERE = Paraboloid(5000.0)


def solved(
    indenter: Indenter, nodes: int, delta: float, kernel: Kernel = "uniform-pressure"
) -> bem.Contact:
    heights = indenter.heights(distances_to_centre((nodes, nodes), SIDE))
    return bem.solve(heights, SIDE, delta, kernel=kernel, rtol=1e-9)


def indentation(contact: bem.Contact) -> float:
    """From the tip, which lies above the highest nodes where no node is on the axis [um]."""
    return contact.problem.delta - float(contact.problem.heights.max())


def area(contact: bem.Contact) -> float:
    """Area of the cells under pressure [um^2]."""
    return contact.contact_nodes * contact.problem.spacing[0] ** 2


@pytest.mark.parametrize("nodes", [128, 129, 256, 257])
@pytest.mark.parametrize("delta", [0.25, 0.5, 0.75, 1.0])
def test_uniform_pressure_meets_hertz(nodes: int, delta: float) -> None:
    """The paper's example: force within 1 %, area within a ring of cells, above it at the end."""
    contact = solved(SPHERE, nodes, delta)
    radius = SPHERE.contact_radius(indentation(contact))
    ring = 2 * np.pi * radius * contact.problem.spacing[0]
    assert contact.force == pytest.approx(SPHERE.force(indentation(contact)), rel=1e-2)
    assert abs(area(contact) - np.pi * radius**2) < ring
    assert delta < 1 or area(contact) > np.pi * radius**2


@pytest.mark.parametrize(("nodes", "excess"), [(128, 0.03), (129, 0.03), (256, 0.02), (257, 0.02)])
def test_concentrated_force_is_stiff_as_in_the_papers_figure(nodes: int, excess: float) -> None:
    """At Delta = 1 the force is 1 to 3 % high and the area low, both less so on a finer grid."""
    contact = solved(SPHERE, nodes, 1.0, "concentrated-force")
    radius = SPHERE.contact_radius(indentation(contact))
    assert 0.01 < contact.force / SPHERE.force(indentation(contact)) - 1 < excess
    assert area(contact) < np.pi * radius**2
    assert contact.area_percent < 100 * np.pi * radius**2 / SIDE**2


@pytest.mark.parametrize(
    ("kernel", "accepted"), [("uniform-pressure", 0.005), ("concentrated-force", 0.06)]
)
@pytest.mark.parametrize("nodes", [128, 129, 256, 257])
def test_pressure_profile_is_hertz(nodes: int, kernel: Kernel, accepted: float) -> None:
    """As a share of the largest pressure, but for the last two cells before the edge."""
    contact = solved(SPHERE, nodes, 1.0, kernel)
    spacing = contact.problem.spacing[0]
    distance = distances_to_centre((nodes, nodes), SIDE)
    exact = SPHERE.pressure(distance, indentation(contact))
    radius = SPHERE.contact_radius(indentation(contact))
    inside = distance < radius - 2 * spacing
    assert np.abs(contact.pressure - exact)[inside].max() < accepted * exact.max()
    assert (contact.pressure[distance > radius + spacing] == 0).all()


def force_errors(indenter: Indenter, delta: float) -> list[float]:
    """Relative error of the force on 33, 65, 129 and 257 nodes a side."""
    contacts = [solved(indenter, nodes, delta) for nodes in (33, 65, 129, 257)]
    return [abs(contact.force / indenter.force(delta) - 1) for contact in contacts]


@pytest.mark.parametrize(
    ("indenter", "delta", "coarse", "fine"),
    [(SPHERE, 1.0, 0.02, 3e-4), (Cone(0.01), 3.0, 2e-3, 3e-5), (FlatPunch(200.0), 1.0, 0.02, 3e-3)],
    ids=["sphere", "cone", "flat punch"],
)
def test_force_converges_under_refinement(
    indenter: Indenter, delta: float, coarse: float, fine: float
) -> None:
    errors = force_errors(indenter, delta)
    assert errors == sorted(errors, reverse=True)
    assert errors[0] < coarse
    assert errors[-1] < fine


def test_cone_meets_its_closed_form() -> None:
    """Area within half a ring of cells; pressure within 0.5 % of E* slope but for tip and edge."""
    cone, delta = Cone(0.01), 3.0
    contact = solved(cone, 129, delta)
    spacing, radius = contact.problem.spacing[0], cone.contact_radius(delta)
    distance = distances_to_centre((129, 129), SIDE)
    exact = cone.pressure(distance, delta)
    between = (distance > 2 * spacing) & (distance < radius - 2 * spacing)
    assert np.abs(contact.pressure - exact)[between].max() < 0.005 * 0.01
    assert abs(area(contact) - np.pi * radius**2) < np.pi * radius * spacing


def test_flat_punch_meets_its_closed_form() -> None:
    """Contact on its face alone; pressure within 1 % up to three quarters of its radius."""
    punch = FlatPunch(200.0)
    contact = solved(punch, 129, 1.0)
    distance = distances_to_centre((129, 129), SIDE)
    np.testing.assert_array_equal(contact.pressure > 0, distance <= 200.0)
    within = distance < 150.0
    exact = punch.pressure(distance, 1.0)
    assert contact.pressure[within] == pytest.approx(exact[within], rel=1e-2)


@pytest.mark.parametrize("shape", [(65, 129), (90, 65)])
def test_spheres_are_round_on_oblong_patches_and_cells(shape: tuple[int, int]) -> None:
    side = (300.0, 400.0)
    heights = SPHERE.heights(distances_to_centre(shape, side))
    contact = bem.solve(heights, side, 1.0)
    assert contact.force == pytest.approx(SPHERE.force(indentation(contact)), rel=1e-2)
    assert contact.largest_pressure == pytest.approx(
        2 / np.pi * np.sqrt(indentation(contact) / 5000), rel=1e-2
    )
