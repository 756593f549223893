"""Flow of a thin fluid through gaps, beside closed forms, exact elimination and another solver."""

import numpy as np
import pytest

import bem
from bem.derived import flow
from bem.derived.flow import flows_through
from bem.problem import OutOfRange
from gen.spectral import SelfAffineSpectrum, generate_spectral

AXES_AND_BORDERS = [(axis, periodic) for axis in (0, 1) for periodic in (False, True)]

# Flows of `waves` along x by reynoldsflow 0.1.3 with rtol 1e-14, by level and nodes. It has patches
# that repeat themselves, and strips that do so across the flow: those have a closed last line here.
OTHERS = {
    (0.6, 40): (0.21574809177471388, 0.20703501021134477),
    (0.1, 40): (0.004590655828437064, 0.006641141092485436),
    (0.1, 64): (0.005264899326932438, 0.007701579475751482),
    (-0.05, 64): (0.00012879937251391443, 0.0006586882052816042),
}


def flow_through(gap, spacing, axis, *, periodic):
    return flows_through(gap, spacing, [axis], periodic=periodic)[0]


def waves(level, nodes):
    x, y = np.mgrid[:nodes, :nodes] * (2 * np.pi / nodes)
    mixed = np.cos(2 * x + y) * np.cos(x - 3 * y) + 0.5 * np.cos(5 * x + 1) * np.cos(
        4 * y - x
    )
    return np.maximum(level + mixed, 0.0)


def exactly(gap, spacing):
    """Eliminate cell after cell between two reservoirs, by star and mesh: nothing is subtracted."""
    nx, ny = gap.shape
    conductances = np.zeros((gap.size + 2,) * 2)
    padded = np.pad(gap, ((1, 1), (0, 0)), constant_values=np.inf)
    cells = np.pad(np.arange(gap.size).reshape(gap.shape), ((1, 1), (0, 0)))
    cells[0], cells[-1] = gap.size, gap.size + 1
    ratio = spacing[1] / spacing[0]
    steps = (
        (padded[:-1], padded[1:], cells[:-1], cells[1:], ratio),
        (*(gap[:, :-1], gap[:, 1:], cells[1:-1, :-1], cells[1:-1, 1:], 1 / ratio),),
    )
    for one, other, first, second, each in steps:
        with np.errstate(divide="ignore"):
            means = 2 * each / (one**-3.0 + other**-3.0)
        conductances[first, second] += means
        conductances[second, first] += means
    for cell in range(gap.size):
        star = conductances[cell].copy()
        star[: cell + 1] = 0
        if star.any():
            conductances += np.outer(star, star) / star.sum()
    return conductances[-1, -2] * nx / (ny * ratio)


def flow_along(axis, gap, *, periodic):
    """Return the flow along an axis through a gap whose first axis is that of the flow."""
    turned = gap if axis == 0 else gap.T
    return flow_through(turned, (2.0, 0.5), axis, periodic=periodic)


@pytest.mark.parametrize(("axis", "periodic"), AXES_AND_BORDERS)
def test_flow_between_parallel_plates_is_uniform(axis, periodic):
    plates = flow_along(axis, np.full((6, 8), 0.3), periodic=periodic)
    assert plates.factor == pytest.approx(1.0, rel=1e-14)
    assert plates.aperture == pytest.approx(0.3, rel=1e-14)
    np.testing.assert_allclose(plates.flux[axis], 0.027, rtol=1e-13)
    np.testing.assert_allclose(plates.flux[1 - axis], 0, atol=1e-15)


WIDTHS = np.array([1e-12, 0.0, 1.0, 1.0, 0.2, 1e-5])


@pytest.mark.parametrize(("axis", "periodic"), AXES_AND_BORDERS)
def test_cubes_of_parallel_channels_have_the_arithmetic_mean(axis, periodic):
    flow = flow_along(axis, np.tile(WIDTHS, (6, 1)), periodic=periodic)
    assert flow.aperture**3 == pytest.approx((WIDTHS**3).mean(), rel=1e-13)


@pytest.mark.parametrize(("axis", "periodic"), AXES_AND_BORDERS)
def test_cubes_of_channels_in_series_have_the_harmonic_mean(axis, periodic):
    widths = WIDTHS[WIDTHS > 0]
    flow = flow_along(axis, np.tile(widths[:, None], (1, 4)), periodic=periodic)
    assert flow.aperture**3 == pytest.approx(1 / (widths**-3).mean(), rel=1e-13)


@pytest.fixture
def channelled():
    """A gap with one channel along the first axis, and islands beside it."""
    gap = np.zeros((9, 11))
    gap[:, 4] = 1e-3  # the channel
    gap[2:5, 7:10] = 5.0  # a pool that nothing leads to
    gap[0:4, 0:2] = 5.0  # a bay that ends
    return gap


@pytest.mark.parametrize("periodic", [False, True])
def test_one_open_channel_of_one_node_is_found_and_islands_are_not(channelled, periodic):
    flow = flow_through(channelled, (1.0, 1.0), 0, periodic=periodic)
    assert flow.aperture**3 == pytest.approx(1e-9 / 11, rel=1e-12)
    assert np.flatnonzero(abs(flow.flux[0]).max(axis=0) > 1e-24).tolist() == [4]
    assert flow_through(channelled, (1.0, 1.0), 1, periodic=periodic).factor == 0


def test_nothing_flows_through_a_channel_that_is_blocked(channelled):
    channelled[5, 4] = 0
    flow = flow_through(channelled, (1.0, 1.0), 0, periodic=False)
    assert (flow.factor, flow.aperture) == (0, 0)
    assert not flow.flux.any()


def test_a_spiral_around_a_patch_that_repeats_flows_along_both_axes():
    gap = np.eye(5) + np.roll(np.eye(5), 1, axis=1)
    for axis in (0, 1):
        flow = flow_through(gap, (1.0, 1.0), axis, periodic=True)
        assert flow.aperture**3 == pytest.approx(0.1)
        assert flow_through(np.eye(5), (1.0, 1.0), axis, periodic=True).factor == 0


@pytest.mark.parametrize("trials", [100, pytest.param(1000, marks=pytest.mark.long)])
def test_gaps_of_many_decades_are_solved_to_rounding(trials):
    random, flowing = np.random.default_rng(7), 0
    for trial in range(trials):
        shape = random.integers(1, 11, 2)
        gap = 10 ** random.uniform((-12, -30)[trial % 5 == 0], 0, shape)
        gap[random.random(shape) < (0.0, 0.3, 0.5, 0.2)[trial % 4]] = 0.0
        spacing = tuple(random.uniform(0.5, 2.0, 2))
        expected = exactly(gap, spacing) if gap.any() else 0.0
        flow = flow_through(gap, spacing, 0, periodic=False)
        assert flow.aperture**3 == pytest.approx(expected, rel=1e-12, abs=0)
        np.testing.assert_allclose(flow.flux[0].mean(axis=1), expected, rtol=1e-12)
        flowing += flow.factor > 0
        for axis in (0, 1):
            flow = flow_through(gap, spacing, axis, periodic=True)
            means = flow.flux[axis].mean(axis=1 - axis)
            np.testing.assert_allclose(means, flow.aperture**3, rtol=1e-12)
    assert 0.4 < flowing / trials < 0.8


@pytest.mark.parametrize("periodic", [False, True])
def test_the_field_of_flux_does_not_depend_on_the_levels_of_pockets(
    monkeypatch, periodic
):
    random = np.random.default_rng(3)
    for _ in range(20):
        gap = 10 ** random.uniform(-12, 0, (12, 12))
        fields = []
        for step in (flow.STEP, 0.1):
            monkeypatch.setattr(flow, "STEP", step)
            fields += [flow_through(gap, (1.0, 1.0), 0, periodic=periodic).flux]
        assert abs(fields[1] - fields[0]).max() < 1e-10 * abs(fields[1]).max()
        monkeypatch.undo()


@pytest.mark.parametrize(("level", "nodes"), OTHERS)
def test_another_solver_finds_the_same_flow(level, nodes):
    gap = waves(level, nodes)
    repeated, closed = OTHERS[level, nodes]
    flow = flow_through(gap, (1.0, 1.0), 0, periodic=True)
    assert flow.aperture**3 == pytest.approx(repeated, rel=1e-8)
    gap[:, -1] = 0.0
    flow = flow_through(gap, (1.0, 1.0), 0, periodic=False)
    assert flow.aperture**3 == pytest.approx(closed, rel=1e-8)


def spectral(nodes, seed, roll_off=4):
    """Make a surface without edges, whose shortest waves have 8 nodes [um]."""
    cut_off = 8 / nodes
    spectrum = SelfAffineSpectrum(0.8, roll_off * cut_off, cut_off)
    random = np.random.default_rng(seed)
    return generate_spectral((nodes, nodes), 1.0, spectrum, random, rms_slope=0.1)


BOUNDARIES = ["free", "periodic", "mirror"]


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_a_light_contact_leaks_through_its_open_gap(boundary):
    contact = bem.solve(
        spectral(65, 2), 1.0, pressure=0.002, boundary=boundary, spacing=1 / 64
    )
    for axis in (0, 1):
        flow = contact.flow(axis)
        assert 0.2 < flow.factor < 1
        mean_cube = flow.factor * contact.mean_gap**3
        assert flow.aperture**3 == pytest.approx(mean_cube, rel=1e-3)
        assert not flow.flux[:, contact.pressure > 0].any()
        assert flow is contact.flow(axis), "computed once"


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_a_heavy_contact_seals(boundary):
    contact = bem.solve(
        spectral(65, 2), 1.0, pressure=0.05, boundary=boundary, spacing=1 / 64
    )
    for axis in (0, 1):
        assert contact.flow(axis).factor == 0
        assert contact.spots.gap_connects[axis] is False


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_flow_at_first_touch_and_in_full_contact(boundary):
    touching = bem.solve(spectral(65, 2), 1.0, 0.0, boundary=boundary)
    assert 0.5 < touching.flow().factor < 1
    full = bem.solve(spectral(65, 2), 1.0, pressure=1e3, boundary=boundary)
    assert full.flow().aperture == 0


@pytest.mark.long
def test_the_gap_of_spectral_surfaces_seals_at_an_area_of_two_fifths():
    sealing = []
    for seed in range(20):
        heights = spectral(512, seed)
        for axis in (0, 1):
            loads, areas = [0.015, 0.04], [0.0, 0.0]
            for _ in range(6):
                load = float(np.prod(loads)) ** 0.5
                contact = bem.solve(
                    heights, 1.0, pressure=load, boundary="periodic", rtol=1e-4
                )
                sealed = not contact.spots.gap_connects[axis]
                loads[sealed], areas[sealed] = load, contact.continuum_area_percent
            sealing.append(np.mean(areas))
            if not seed:  # what the flow itself says
                assert contact.flow(axis).factor < 1e-3
                assert (contact.flow(axis).factor == 0) == sealed
    assert np.mean(sealing) == pytest.approx(41.5, abs=2.0)
    assert np.mean(sealing) == pytest.approx(
        40.6, abs=0.1
    )  # as docs/how-to/interfaces.md says
    assert np.ptp(sealing) < 10


def test_bodies_that_have_yielded_seal_where_elastic_ones_leak():
    heights = spectral(65, 2)
    elastic, yielded = (
        bem.solve(heights, 1.0, pressure=0.015, boundary="periodic", hardness=hardness)
        for hardness in (None, 0.03)
    )
    assert elastic.flow().factor > 0
    assert yielded.flow().factor < elastic.flow().factor


def test_axes_that_there_are_not_and_gaps_beyond_double_precision_are_refused():
    with pytest.raises(ValueError, match="axis 2: give 0"):
        bem.solve(np.zeros((4, 4)), 1.0, force=1.0).flow(2)
    for widest in (1e-85, 1e85):
        flow = flow_through(np.full((4, 4), widest), (1.0, 1.0), 0, periodic=True)
        assert flow.aperture == pytest.approx(widest)
        beyond = np.full((4, 4), widest ** (120 / 85))
        with pytest.raises(OutOfRange, match="widest gap = 1e"):
            flow_through(beyond, (1.0, 1.0), 0, periodic=True)
