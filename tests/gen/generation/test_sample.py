"""Rows against their own parts: plan, surface, statistics and solver called one by one."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

import bem
from gen.generation.completion import SampleProblem
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows, solve_contact, surface_of
from gen.quantities import Powers
from gen.runtime.errors import InputError
from gen.scene import Scene, columns_for
from gen.schema import Reason, Status
from gen.statistics import describe

STORE_ALL = (
    "{mean_gap=true, largest_pressure=true, perimeter=true, heights=true, pressure=true}"
)


def scene(text="", samples=12):
    return Scene.parse(f"samples = {samples}\n{text}\n[surface]\nnodes = 17\n", "test")


def test_a_row_is_what_its_parts_say():
    made = scene(f"samples_per_surface = 3\nstore = {STORE_ALL}")
    rows = compute_rows(made, 3, 9, rank=7)
    assert rows.keys() == {column.name for column in columns_for(made)}
    plan = parameters(made, 3, 9)
    for row in range(6):
        heights = surface_of(made, plan, row)
        contact = bem.solve(heights, 1000.0, plan.load[row])
        assert rows["area_percent"][row] == contact.area_percent
        assert rows["force"][row] == contact.force
        assert rows["mean_gap"][row] == contact.mean_gap
        assert rows["perimeter"][row] == contact.perimeter
        assert rows["largest_pressure"][row] == contact.pressure.max()
        np.testing.assert_array_equal(rows["pressure"][row], contact.pressure)
        np.testing.assert_array_equal(rows["heights"][row], heights)
        for name, value in describe(heights, made.spacing).values.items():
            assert rows[name][row] == value
    np.testing.assert_array_equal(rows["surface"], [1, 1, 1, 2, 2, 2])
    assert set(rows["status"]) == {Status.DONE}
    assert set(rows["rank"]) == {7}


SPECTRAL = """
samples = 60
[surface]
generator = "spectral"
nodes = [32, 24]
side = [64.0, 48.0]
roll_off = 16.0
cut_off = 6.0
rms_height = [0.5, 1.5]
"""
AGAINST = "against = 'another'\n"


@pytest.mark.parametrize(
    ("text", "boundary"),
    [(SPECTRAL, "mirror"), ("samples = 60\n[surface]\nnodes = 17\n", "free")],
)
def test_two_rough_bodies_are_the_sum_of_two_surfaces(text, boundary):
    contact = f"[contact]\nboundary = '{boundary}'\n"
    alone, pair = (Scene.parse(text + key + contact, "test") for key in ("", AGAINST))
    assert alone.fingerprint() != pair.fingerprint()
    plans = [parameters(made, 0, 60) for made in (alone, pair)]
    for name, values in plans[0].drawn.items():
        np.testing.assert_array_equal(values, plans[1].drawn[name])
    np.testing.assert_array_equal(plans[0].load, plans[1].load)
    firsts, seconds = [], []
    for row in range(60):
        first, composite = (
            surface_of(made, plan, row)
            for made, plan in zip((alone, pair), plans, strict=True)
        )
        assert composite.min() == 0
        firsts.append(first)
        seconds.append(composite - first)
    likeness = [
        np.corrcoef(*map(np.ravel, both))[0, 1]
        for both in zip(firsts, seconds, strict=True)
    ]
    assert abs(np.mean(likeness)) < 3 * np.std(likeness) / np.sqrt(60)  # none
    assert np.std(seconds) == pytest.approx(np.std(firsts), rel=0.2)


@pytest.mark.parametrize(
    "error",
    [OverflowError, np.linalg.LinAlgError, TypeError, ValueError],
    ids=lambda e: e.__name__,
)
def test_numerical_errors_are_rows_and_bugs_are_not(monkeypatch, error):
    monkeypatch.setattr(bem, "solve", mock.Mock(side_effect=error("no")))
    if error in {TypeError, ValueError}:
        with pytest.raises(error):
            compute_rows(scene(), 0, 2)
    else:
        assert set(compute_rows(scene(), 0, 2)["reason"]) == {Reason.ARITHMETIC}


def test_a_spacing_beyond_all_statistics_is_a_reason():
    made = Scene.parse("samples = 2\n[surface]\nnodes = 9\nside = 1e300", "test")
    assert set(compute_rows(made, 0, 2)["reason"]) == {Reason.ARITHMETIC}


DECIDED = (
    "{stiffness=true, interface_stiffness=true, contact_spots=true, largest_spot_percent=true,"
    " largest_spot_area=true,"
    " contact_connects=true, gap_connects=true, continuum_area_percent=true,"
    " hydraulic_aperture_x=true, hydraulic_aperture_y=true}"
)


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
def test_what_contact_decides_is_what_the_contact_says(boundary):
    pressed = f"contact = {{boundary = '{boundary}', hardness = 0.02}}"
    made = scene(f"store = {DECIDED}\n{pressed}\n", samples=4)
    rows = compute_rows(made, 0, 4)
    plan = parameters(made, 0, 4)
    for row in range(4):
        contact = solve_contact(made, surface_of(made, plan, row), plan.load[row], 0.02)
        for name in ("stiffness", "interface_stiffness", "continuum_area_percent"):
            assert rows[name][row] == getattr(contact, name)
        spots = contact.spots
        assert rows["contact_spots"][row] == spots.number
        assert rows["largest_spot_percent"][row] == 100 * spots.largest_share
        assert rows["largest_spot_area"][row] == (spots.areas[0] if spots.number else 0)
        for name in ("contact_connects", "gap_connects"):
            along, across = getattr(spots, name)
            assert rows[name][row] == along + 2 * across
        for axis, name in enumerate(("hydraulic_aperture_x", "hydraulic_aperture_y")):
            assert rows[name][row] == contact.flow(axis).aperture
    assert set(rows["status"]) == {Status.DONE}


LOADED = """samples = 6
samples_per_surface = 2
[surface]
generator = "spectral"
nodes = [14, 17]
side = [70.0, 60.0]
roll_off = 40.0
cut_off = 14.0
rms_slope = [0.05, 0.2]
[load]
quantity = "{}"
range = {}
[contact]
modulus = 3.0
poisson = 0.3
boundary = "{}"
{}
"""


YIELDS = "hardness = { normal = [0.3, 0.03] }"


@pytest.mark.parametrize(
    ("quantity", "span", "boundary", "further"),
    [
        ("delta", "[0.0, 1.0]", "free", YIELDS),
        ("delta/height_rms", "[0.0, 1.0]", "mirror", ""),
        ("pressure", "{ log_uniform = [1e-3, 0.03] }", "periodic", YIELDS),
        ("pressure/(E* slope_rms)", "[0.0, 0.05]", "free", ""),
        ("force", "{ choice = [0.0, 5.0, 60.0] }", "mirror", YIELDS),
    ],
)
def test_loads_in_every_quantity_are_those_of_bem_solve(
    boundary, quantity, span, further
):
    """Against the surface pressed by `bem.solve`, loads worked out here from the heights."""
    scene = Scene.parse(LOADED.format(quantity, span, boundary, further), "test")
    rows, plan = compute_rows(scene, 0, 6), parameters(scene, 0, 6)
    assert set(rows["status"].tolist()) == {Status.DONE}
    modulus = 3.0 / (1 - 0.3**2)
    for row in range(6):
        heights, load = surface_of(scene, plan, row), plan.load[row]
        slopes = (np.diff(heights, axis=axis) / scene.spacing[axis] for axis in (0, 1))
        slope = np.sqrt(sum(np.mean(along**2) for along in slopes))
        pressed = {
            "delta": {"delta": load},
            "delta/height_rms": {"delta": load * heights.std()},
            "pressure": {"pressure": load},
            "pressure/(E* slope_rms)": {"pressure": load * modulus * slope},
            "force": {"force": load},
        }[quantity]
        body = {"modulus": 3.0, "poisson": 0.3, "hardness": plan.hardness_of(row)}
        contact = bem.solve(heights, scene.sides, boundary=boundary, **body, **pressed)
        assert rows["delta"][row] == pytest.approx(contact.delta, rel=1e-5, abs=1e-9)
        assert rows["force"][row] == pytest.approx(contact.force, rel=1e-5, abs=1e-9)
        assert rows["contact_nodes"][row] == contact.contact_nodes


def test_rows_fail_by_their_load_alone_and_their_surface_is_described():
    text = LOADED.format("pressure", "{ choice = [1e-3, 9.0] }", "free", "hardness = 1.0")
    rows = compute_rows(Scene.parse(text, "test"), 0, 6)
    beyond = rows["load"] == 9.0
    assert beyond.any()
    assert not beyond.all()
    assert (rows["status"] == np.where(beyond, Status.FAILED, Status.DONE)).all()
    assert (rows["reason"][beyond] == Reason.BEYOND_HARDNESS).all()
    assert np.isnan(rows["delta"][beyond]).all()
    assert np.isfinite(rows["height_rms"]).all()


BEYOND = "[delta]\npieces = [{{ share = 1.0, range = [{0}, {0}] }}]\n[contact]\n"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (BEYOND.format(300.0) + "boundary = 'mirror'", Reason.FULL_CONTACT),
        (BEYOND.format(300.0) + "far_field = 'compliant'", Reason.NO_SOLUTION),
        (BEYOND.format(9e9) + "modulus = 1e308", Reason.ARITHMETIC),
    ],
)
def test_a_contact_without_a_solution_is_a_row_with_a_reason(text, reason):
    rows = compute_rows(scene(text), 0, 2)
    assert set(rows["status"]) == {Status.FAILED}
    assert set(rows["reason"]) == {reason}
    assert np.isnan(rows["area_percent"]).all()
    assert not np.isnan(rows["height_rms"]).any()


def test_a_force_that_is_no_number_is_a_row_with_a_reason(monkeypatch):
    solve = bem.solve
    monkeypatch.setattr(
        bem, "solve", lambda *a, **k: replace(solve(*a, **k), force=np.nan)
    )
    rows = compute_rows(scene(), 0, 2)
    assert set(rows["status"]) == {Status.FAILED}
    assert set(rows["reason"]) == {Reason.NOT_FINITE}


LAYERED = """
samples = 8
[surface]
generator = "spectral"
nodes = 24
side = 48.0
roll_off = 16.0
cut_off = 6.0
rms_height = 1.0
[load]
quantity = "pressure"
range = [0.01, 0.1]
[contact]
boundary = "periodic"
{material}
[contact.layer]
{layer}
"""


def layered(layer, material="modulus = 200.0\npoisson = 0.3"):
    return Scene.parse(LAYERED.format(layer=layer, material=material), "test")


@pytest.mark.parametrize("base", ["elastic", "rigid"])
def test_rows_of_a_layer_are_those_of_its_body(base):
    material = "modulus = 200.0\npoisson = 0.3" if base == "elastic" else ""
    made = layered(
        f"thickness = [2.0, 8.0]\nmodulus = {{ log_uniform = [1.0, 9.0] }}\nbase = '{base}'",
        material,
    )
    plan, rows = parameters(made, 0, 8), compute_rows(made, 0, 8)
    thickness, modulus = rows["layer_thickness"], rows["layer_modulus"]
    assert ((thickness >= 2) & (thickness <= 8)).all()
    assert ((modulus >= 1) & (modulus <= 9)).all()
    assert len(set(thickness)) == len(set(modulus)) == 8
    for row in (0, 5):
        below = bem.HalfSpace(200.0, 0.3) if base == "elastic" else "rigid"
        body = bem.Layered(thickness[row], modulus[row], 0.0, below)
        heights, pressure = surface_of(made, plan, row), plan.load[row]
        contact = bem.solve(
            heights, 48.0, pressure=pressure, body=body, boundary="periodic"
        )
        assert rows["delta"][row] == contact.delta
        again = solve_contact(made, heights, pressure=pressure, layer=plan.layer_of(row))
        assert again.delta == contact.delta
    with pytest.raises(ValueError, match="every sample of this scene has a layer"):
        solve_contact(made, heights, pressure=pressure)


def test_layers_leave_surfaces_and_loads_as_they_are():
    made = layered("thickness = [2.0, 8.0]\nmodulus = 3.0")
    bare = Scene.parse(
        LAYERED.format(layer="", material="").replace("[contact.layer]", ""), "test"
    )
    for name in ("load", "height_rms"):
        with_layer, without = (compute_rows(each, 0, 8)[name] for each in (made, bare))
        np.testing.assert_array_equal(with_layer, without)
    assert "layer_modulus" not in compute_rows(made, 0, 1)  # all samples share it


@pytest.mark.parametrize(
    ("layer", "material", "message"),
    [
        ("thickness = 0.0\nmodulus = 1.0", "", "contact.layer.thickness = 0"),
        ("modulus = 1.0", "", "contact.layer.thickness"),
        ("thickness = 1.0\nmodulus = 1.0\npoisson = 0.6", "", "contact.layer.poisson"),
        ("thickness = 1.0\nmodulus = 1.0\nbase = 'soft'", "", "contact.layer.base"),
        ("thickness = 1.0\nmodulus = 1.0\nbase = 'rigid'", "modulus = 2.0", "leave out"),
        (
            "thickness = 1.0\nmodulus = [1.0, 2.0]",
            "hardness_ratio = 0.1",
            "hardness_ratio needs one E",
        ),
    ],
)
def test_layers_that_are_refused(layer, material, message):
    with pytest.raises(InputError, match=message):
        layered(layer, material)


def test_a_layer_under_mircos_forces_is_refused():
    text = LAYERED.format(layer="thickness = 1.0\nmodulus = 1.0", material="")
    forces = '"free"\nkernel = "concentrated-force"'
    with pytest.raises(InputError, match="a layer needs kernel = 'uniform-pressure'"):
        Scene.parse(text.replace('"periodic"', forces), "test")


def test_layers_too_thin_for_a_free_patch_are_refused():
    text = LAYERED.format(layer="thickness = [0.3, 1.0]\nmodulus = 1.0", material="")
    with pytest.raises(InputError, match=r"on a free patch a layer has 0\.417391 um at"):
        Scene.parse(text.replace('"periodic"', '"free"'), "test")


def test_a_relative_load_needs_one_modulus():
    text = LAYERED.format(layer="thickness = 1.0\nmodulus = [1.0, 2.0]", material="")
    with pytest.raises(InputError, match="give 'pressure'"):
        Scene.parse(text.replace('"pressure"', "'pressure/(E* slope_rms)'"), "test")


def test_outputs_of_a_layer_are_measured_with_lengths_and_moduli_together():
    """Twice the lengths make twice the thickness; twice E*, all moduli. Then forces scale."""
    made = layered("thickness = [2.0, 8.0]\nmodulus = 3.0")
    plan = parameters(made, 0, 1)
    problem = SampleProblem(
        scene=made,
        row=0,
        heights=surface_of(made, plan, 0),
        load=float(plan.load[0]),
        hardness=None,
        layer=plan.layer_of(0),
    )
    one = problem.solve()
    for doubled in (Powers(1, 0, 0), Powers(0, 1, 0), Powers(0, 0, 1)):
        twice = problem.solve(doubled)
        assert twice.contact_nodes == one.contact_nodes
        assert twice.force == pytest.approx(2 * one.force, rel=1e-9)
        assert twice.delta == pytest.approx(2.0**doubled.heights * one.delta, rel=1e-6)
