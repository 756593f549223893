"""Bodies that yield: limits, closed forms and properties of the capped contact."""

import itertools

import numpy as np
import pytest

import bem
from bem import equilibrium
from bem.analytic import PowerLaw
from bem.problem import BOUNDARIES
from bench.references.surfaces import SURFACES

SIDE = 100.0
RTOL = 1e-8
LOADS = ("delta", "force", "pressure")


def self_affine(seed, nodes=33):
    return SURFACES["self-affine"](np.random.default_rng(seed), (nodes, nodes)) * 4.0


def loads_of(contact):
    """Every way to ask for one contact."""
    nodes = contact.pressure.size
    cell = contact.problem.spacing[0] * contact.problem.spacing[1]
    force = contact.force
    return {"delta": contact.delta, "force": force, "pressure": force / (nodes * cell)}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("above", [1 + 1e-9, 1e6])
def test_a_hardness_above_all_pressures_changes_no_byte(seed, load, above):
    heights = self_affine(seed)
    amount = loads_of(bem.solve(heights, SIDE, 0.4 * np.ptp(heights)))[load]
    elastic = bem.solve(heights, SIDE, **{load: amount})
    hardness = above * elastic.largest_pressure
    contact = bem.solve(heights, SIDE, hardness=hardness, **{load: amount})
    assert contact.pressure.tobytes() == elastic.pressure.tobytes()
    assert (contact.delta, contact.force) == (elastic.delta, elastic.force)
    assert contact.gap.tobytes() == elastic.gap.tobytes()
    assert contact.yielded_percent == 0
    assert not contact.yielded_depth.any()


@pytest.mark.parametrize("few", [0, 10_000])
@pytest.mark.parametrize("seed", range(3))
def test_vanishing_hardness_leaves_the_bearing_area(seed, few, monkeypatch):
    monkeypatch.setattr(equilibrium, "FEW_NODES", few)
    heights = self_affine(seed, 25)
    delta = 0.3 * np.ptp(heights)
    contact = bem.solve(heights, SIDE, delta, hardness=1e-9)
    bearing = heights > heights.max() - delta
    np.testing.assert_array_equal(contact.pressure > 0, bearing)
    np.testing.assert_array_equal(contact.pressure[bearing], 1e-9)
    assert contact.yielded_percent == contact.area_percent


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("hardness", [0.003, 0.02, 0.1])
def test_loading_again_after_yielding_is_elastic(seed, hardness):
    """The same pressure at the same place of the far field, for which the datum is lower."""
    heights = self_affine(seed)
    first = bem.solve(heights, SIDE, 0.4 * np.ptp(heights), hardness=hardness, rtol=RTOL)
    assert first.yielded_percent > 0
    flattened = first.flattened
    lower = heights.max() - flattened.max()
    again = bem.solve(flattened, SIDE, first.delta - lower, rtol=RTOL)
    tolerance = 1e-4 * hardness
    np.testing.assert_allclose(again.pressure, first.pressure, atol=tolerance)
    under_force = bem.solve(flattened, SIDE, force=first.force, rtol=RTOL)
    np.testing.assert_allclose(under_force.pressure, first.pressure, atol=tolerance)


def test_a_sphere_yields_first_at_the_hertz_pressure_and_ends_at_the_hardness():
    """The cap's own criterion: p0 = H, instead of 1.6 H below the surface of real metals."""
    nodes, side, radius = 129, 2.0, 10.0
    x = np.linspace(-side / 2, side / 2, nodes)
    sphere = PowerLaw(1 / (2 * radius), 2.0)
    heights = sphere.heights(np.hypot(*np.meshgrid(x, x, indexing="ij")))
    delta = 0.02
    largest = 2 / np.pi * np.sqrt(delta / radius)  # Hertz: p0 / E*
    spacing = side / (nodes - 1)
    grid = 1.5 * (spacing / sphere.contact_radius(delta)) ** 2  # a cell's mean pressure
    assert (
        bem.solve(heights, side, delta, hardness=largest * (1 + grid)).yielded_percent
        == 0
    )
    assert (
        bem.solve(heights, side, delta, hardness=largest * (1 - 3 * grid)).yielded_percent
        > 0
    )
    hardness = 0.01 * largest
    contact = bem.solve(heights, side, delta, hardness=hardness)
    mean = contact.force / (contact.contact_nodes * spacing**2)
    assert mean == pytest.approx(hardness, rel=0.02)
    # All of it yields: the bearing circle, a^2 = 2 R delta, to a ring of cells.
    circle = np.pi * 2 * radius * delta
    assert contact.contact_nodes * spacing**2 == pytest.approx(circle, rel=0.05)


def test_a_large_grid_starts_from_a_coarser_one_that_yields_too(monkeypatch):
    heights = self_affine(4, 97)
    delta = 0.4 * np.ptp(heights)
    plain = bem.solve(heights, SIDE, delta, hardness=0.02)
    for least in ("NESTED", "NESTED_FAINT"):
        monkeypatch.setattr(f"bem.equilibrium.{least}", 50)
    nested = bem.solve(heights, SIDE, delta, hardness=0.02)
    assert nested.force == pytest.approx(plain.force, rel=1e-6)
    np.testing.assert_array_equal(nested.pressure > 0, plain.pressure > 0)


@pytest.mark.parametrize("load", [{"pressure": 50.0}, {"force": 1e9}])
def test_a_load_beyond_the_hardness_has_no_solution(load):
    with pytest.raises(bem.NoSolution, match=r"(50 MPa|1e\+09 uN) has no equilibrium: "):
        bem.solve(self_affine(0), SIDE, modulus=2e5, hardness=50.0, **load)


@pytest.mark.parametrize("share", [0.9, 0.999, 1 - 1e-7])
def test_loads_just_below_the_hardness_are_carried(share):
    contact = bem.solve(self_affine(0), SIDE, pressure=share * 0.01, hardness=0.01)
    assert contact.force == pytest.approx(share * 0.01 * (SIDE * 33 / 32) ** 2, rel=1e-12)
    assert contact.yielded_percent > 85


ROUND = (1, 2, 5, 10, 20, 50, 100, 200, 250, 400, 500, 800, 1000, 1500, 2000, 3000)
LONG = pytest.mark.long
ROUND_GRIDS = [
    ("self-affine", (16, 16), 3),
    *(
        pytest.param(kind, shape, 1, marks=LONG)
        for kind in ("self-affine", "white noise", "plateaus")
        for shape in ((20, 20), (25, 40), (50, 50))
    ),
]


@pytest.mark.parametrize(("kind", "shape", "every"), ROUND_GRIDS)
def test_round_loads_are_carried(kind, shape, every):
    """Loads that are whole multiples of hardness times cell, alone and in ladders; 2,600 in all."""
    heights = 0.3 * SURFACES[kind](np.random.default_rng(shape[1]), shape)
    for hardness, boundary in itertools.product(
        (500.0, 1000.0, 2000.0, 4000.0), BOUNDARIES
    ):
        body = {"modulus": 2.1e5, "poisson": 0.3, "spacing": 1.0, "hardness": hardness}
        pressures = [pressure for pressure in ROUND[::every] if pressure < hardness]
        alone = [
            bem.solve(heights, 1, pressure=p, boundary=boundary, **body)
            for p in pressures
        ]
        rungs = bem.ladder(heights, 1, pressures=pressures, boundary=boundary, **body)
        for pressure, *contacts in zip(pressures, alone, rungs, strict=True):
            for contact in contacts:
                assert contact.force == pytest.approx(pressure * heights.size, rel=1e-11)
                assert contact.largest_pressure <= hardness
                assert contact.residual <= 2e-7


@pytest.mark.parametrize("nodes", [40, 65])
@pytest.mark.parametrize("many", [0.3, 1.0, 1.28, 2.0, 260.5])
def test_a_load_beyond_the_one_summit_of_a_plateau_is_carried(nodes, many):
    """The nodes that are equally high as the last one of the guessed part belong to it."""
    heights = np.zeros((nodes, nodes))
    heights[nodes // 3, nodes // 2] = 1.0
    contact = bem.solve(heights, 1, force=many, spacing=1.0, hardness=1.0, modulus=2.1e5)
    assert contact.force == pytest.approx(many, rel=1e-11)
    assert contact.largest_pressure <= 1.0
    assert contact.residual <= 2e-7


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("many", [1, 7, 45])
def test_where_all_that_touches_yields_the_displacement_is_the_smallest(boundary, many):
    """The same nodes carry the load at every displacement until the next node touches."""
    heights = np.sort(np.random.default_rng(many).uniform(0, 3, 100)).reshape(10, 10)
    heights.flat[-many:] += 50.0
    contact = bem.solve(
        heights, 10, force=many * 1e-3, boundary=boundary, hardness=1e-3, spacing=1
    )
    np.testing.assert_array_equal(contact.pressure.flat[-many:], 1e-3)
    assert contact.contact_nodes == many
    shallowest = contact.yielded_depth.flat[-many:].min()
    assert shallowest == pytest.approx(0, abs=2e-7 * contact.delta)


def test_a_start_with_yielded_nodes_is_taken():
    heights = self_affine(5, 65)
    contact = bem.solve(heights, SIDE, 0.4 * np.ptp(heights), hardness=0.02)
    again = bem.solve(heights, SIDE, contact.delta, hardness=0.02, near=contact.pressure)
    assert again.convolutions < contact.convolutions
    np.testing.assert_array_equal(again.pressure > 0, contact.pressure > 0)
