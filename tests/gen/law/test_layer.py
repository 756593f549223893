"""Laws of layered bodies: their limits, full contact on a rigid base, and the layer in files."""

import re
from pathlib import Path

import numpy as np
import pytest
from strict import json_of
from waves_scene import SCENE as WAVES

import bem
from bem.derived.stiffness import patch_stiffness
from gen import cli
from gen.law import Order, by_means
from gen.maps.settings import Reading
from gen.material import Bodies, ElasticBody, Layer
from tests.bem.waves import random_waves
from tests.maps import waves

THICKNESS = 5.0
RUBBER = ElasticBody(10.0, 0.3)
STEEL = ElasticBody(200.0, 0.3)
COMPLIANCE = THICKNESS * 1.3 * 0.4 / (0.7 * 10.0)  # of the layer under a uniform pressure
PRESSURES = np.array([0.01, 0.1, 0.5, 3.0])
LAYER = ["--layer-thickness", "5", "--layer-young", "10", "--layer-poisson", "0.3"]
ON_STEEL = [*LAYER, "--young", "200", "--poisson", "0.3"]
THIN = ["--layer-thickness", "0.5", "--layer-young", "10", "--layer-base", "rigid"]
ON_RIGID = [*LAYER, "--layer-base", "rigid"]
FOR_PROGRAMS = [
    "law.h",
    "law-calculix.inp",
    "law-abaqus.inp",
    "law_4c.py",
    "moose.csv",
    "ansys.inp",
    "comsol.txt",
]


def bodies(thickness=THICKNESS, material=RUBBER, base=STEEL):
    """Bodies with a layer on an elastic base, or on a rigid one, which is None."""
    layer = Layer(thickness, material, on_rigid=base is None)
    young = []
    poisson = []
    if base is not None:
        young = [base.young]
        poisson = [base.poisson]
    return Bodies.with_layer(layer, young, poisson, e_star=None, hardness=None)


@pytest.fixture
def law_on(here, make):
    """Make the law of a surface of 100 um on layered bodies, at some pressures."""
    np.save("s0.npy", waves(20, 0))

    def made(on, **order):
        settings = {"pressure": "0.01,0.1,0.5,3", **order}
        return make(
            "s0.npy",
            e_star=on.e_star,
            layered=on.layered,
            stiffness=True,
            reading=Reading(side="100"),
            **settings,
        )

    return made


def curves_of(law):
    """Values of the curves of a law over pressure, by their names."""
    curves = law.over_pressure.curves
    return {name: curve.value for name, curve in curves.items()}


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("boundary", "base"),
    [("mirror", None), ("free", None), ("mirror", STEEL), ("free", STEEL)],
)
def test_rows_of_a_law_are_the_contacts_of_its_body(law_on, base, boundary):
    on = bodies(base=base)
    curves = curves_of(law_on(on, boundary=boundary))
    contacts = list(
        bem.ladder(
            np.load("s0.npy"),
            100.0,
            pressures=PRESSURES[: curves["delta_um"].size],
            body=on.layered.body,
            boundary=boundary,
        )
    )
    area = 100.0**2
    if boundary == "free":
        area *= (20 / 19) ** 2
    deltas = np.array([contact.delta for contact in contacts])
    np.testing.assert_allclose(curves["delta_um"], deltas, rtol=1e-9)
    stiffness = [contact.interface_stiffness / area for contact in contacts]
    np.testing.assert_allclose(curves["stiffness_MPa_per_um"], stiffness, rtol=1e-9)
    punch = area / patch_stiffness(contacts[0].problem)
    closures = deltas - punch * PRESSURES[: deltas.size]
    np.testing.assert_allclose(curves["closure_um"], closures, rtol=1e-7)


@pytest.mark.parametrize(
    ("thickness", "material", "half_space"),
    [(1e-6, RUBBER, STEEL), (1e7, RUBBER, RUBBER), (5.0, STEEL, STEEL)],
    ids=["thin", "thick", "one material"],
)
def test_limits_of_laws_on_layers_are_laws_of_half_spaces(
    law_on, thickness, material, half_space
):
    on_layer = curves_of(law_on(bodies(thickness, material)))
    plain = Bodies.of([half_space.young], [half_space.poisson], None, None)
    on_half_space = curves_of(law_on(plain))
    for name, values in on_half_space.items():
        np.testing.assert_allclose(on_layer[name], values, rtol=2e-5, err_msg=name)


def test_a_law_on_a_rigid_base_goes_through_full_contact_with_the_layer(law_on):
    """All nodes touch: Delta is the mean gap at first touch, and the compression of the layer."""
    law = law_on(bodies(base=None), layer_in="law", pressure="0.1,3,30")
    curves = curves_of(law)
    heights = np.load("s0.npy")
    full = curves["area_percent"] == 100
    assert full.tolist() == [False, True, True]
    flat = heights.max() - heights.mean() + COMPLIANCE * law.over_pressure.at[full]
    np.testing.assert_allclose(curves["delta_um"][full], flat, rtol=1e-6)
    np.testing.assert_allclose(curves["stiffness_MPa_per_um"][full], 1 / COMPLIANCE)
    np.testing.assert_allclose(curves["closure_um"], curves["delta_um"], rtol=1e-12)


def test_a_law_over_delta_goes_through_full_contact_with_the_layer(law_on):
    heights = np.load("s0.npy")
    flat = heights.max() - heights.mean()
    law = law_on(bodies(base=None), layer_in="law", delta="0.5,4", pressure="")
    table = law.over_delta
    expected = (4 - flat) / COMPLIANCE
    assert table.at.tolist() == [0, 0.5, 4]
    assert table.curves["pressure_MPa"].value[-1] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("base", [STEEL, None])
def test_a_law_for_a_meshed_layer_ends_below_full_contact(law_on, base):
    law = law_on(bodies(base=base), pressure="0.1,0.2,100")
    assert law.over_pressure.at.tolist() == [0.1, 0.2]
    assert any(note.startswith("full contact from 100 MPa on") for note in law.notes)


@pytest.mark.parametrize("base", [STEEL, None])
def test_a_layer_in_the_law_is_in_series_with_the_interface(law_on, base):
    on = bodies(base=base)
    meshed = curves_of(law_on(on, pressure="0.01,0.1"))
    together = curves_of(law_on(on, pressure="0.01,0.1", layer_in="law"))
    closures = meshed["closure_um"] + COMPLIANCE * PRESSURES[:2]
    np.testing.assert_allclose(together["closure_um"], closures, rtol=1e-12)
    stiffness = 1 / (1 / meshed["stiffness_MPa_per_um"] + COMPLIANCE)
    np.testing.assert_allclose(together["stiffness_MPa_per_um"], stiffness, rtol=1e-12)
    for name in ("delta_um", "area_percent", "mean_gap_um"):
        np.testing.assert_array_equal(together[name], meshed[name])


def test_an_incompressible_layer_adds_nothing_to_a_law(law_on):
    on = bodies(material=ElasticBody(10.0, 0.5), base=None)
    laws = [law_on(on, layer_in=layer_in) for layer_in in ("mesh", "law")]
    meshed, together = map(curves_of, laws)
    for name, values in meshed.items():
        np.testing.assert_array_equal(together[name], values)
    assert any("the layer is incompressible" in note for note in laws[1].notes)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folders "mesh" and "law" with the files of laws of a sheet on a rigid base."""
    folder = tmp_path_factory.mktemp("layers")
    np.save(folder / "s0.npy", waves(20, 0))
    command = ["law", folder / "s0.npy", "--side", "100", "--pressure", "0.1,0.5,3,30"]
    for layer_in in ("mesh", "law"):
        (folder / layer_in).mkdir()
        words = [*command, *ON_RIGID, "--layer-in", layer_in]
        words += ["-o", folder / layer_in / "law"]
        for program in ("moose.csv", "ansys.inp", "comsol.txt"):
            words += [f"--{program.split('.')[0]}", folder / layer_in / program]
        assert cli.main([str(word) for word in words]) == 0
    return folder


def flat_text(path):
    """Return the text of a file without marks of comments and line ends."""
    return re.sub(r"\s+", " ", re.sub(r"(?m)^\s*(\*\*|\*|#|!|%)", " ", path.read_text()))


@pytest.mark.parametrize("layer_in", ["mesh", "law"])
@pytest.mark.parametrize("name", FOR_PROGRAMS)
def test_heads_of_files_say_whether_the_closure_has_the_layer(written, layer_in, name):
    text = flat_text(written / layer_in / name)
    assert "5 um of 10 MPa (Poisson's ratio 0.3) on a rigid base" in text
    advice = {"mesh": "mesh the layer, or", "law": "leave the layer out of the mesh"}
    assert advice[layer_in] in text
    assert f"{COMPLIANCE:.4g} um/MPa" in text


@pytest.mark.parametrize("program", ["abaqus", "calculix"])
def test_tables_of_programs_are_the_closed_form_in_full_contact(written, program):
    """The last points, at 3 and 30 MPa and beyond, in mm."""
    lines = (written / "law" / f"law-{program}.inp").read_text().splitlines()
    start = lines.index("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR") + 1
    points = np.array([line.split(",") for line in lines[start:]], dtype=float)
    pressures, overclosures = points[points[:, 0] >= 3].T
    heights = np.load(written / "s0.npy")
    flat = heights.max() - heights.mean() + COMPLIANCE * pressures
    assert pressures.size >= 2
    np.testing.assert_allclose(1000 * overclosures, flat, rtol=1e-6)


def test_documents_of_a_law_have_its_layer(written):
    layer = json_of(written / "law" / "law.json")["layer"]
    assert layer == {
        "layer_thickness_um": 5.0,
        "layer_young_MPa": 10.0,
        "layer_poisson": 0.3,
        "base": "rigid",
        "compression_um_per_MPa": pytest.approx(COMPLIANCE),
        "compression_is_in": "law",
    }


def test_rows_of_a_law_have_its_layer(written):
    head, row, *_ = (written / "mesh" / "law.csv").read_text().splitlines()
    cells = dict(zip(head.split(","), row.split(","), strict=False))
    assert (cells["layer_thickness_um"], cells["base"]) == ("5.0", "rigid")
    assert cells["layer_in"] == "mesh"


SCENE = """
samples = 9
[surface]
nodes = 17
[contact]
boundary = "mirror"
spacing = "side/n"
modulus = 200.0
poisson = 0.3
[contact.layer]
thickness = {thickness}
modulus = 10.0
poisson = 0.3
[load]
quantity = "pressure"
range = [0.01, 1.0]
"""


def test_a_scene_gives_the_layer_of_its_law(here, make):
    Path("layer.toml").write_text(SCENE.format(thickness="5.0"))
    order = {"pressure": "0.1,1", "surfaces": 2}
    of_scene = make("layer.toml", **order)
    on = bodies()
    assert of_scene.bodies.layered == on.layered
    of_options = make("layer.toml", e_star=on.e_star, layered=on.layered, **order)
    for name, values in curves_of(of_options).items():
        np.testing.assert_array_equal(curves_of(of_scene)[name], values)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("s0.npy", *ON_STEEL, "--conductivity", "50"), "on half-spaces only"),
        (("s0.npy", *THIN, "--error", "3%"), "no smaller than the layer"),
        (
            ("s0.npy", *ON_STEEL, "--friction", "0.3"),
            "from normal contacts on half-spaces",
        ),
        (("s0.npy", "--layer-in", "law"), "--layer-in law: there is no layer"),
        (("s0.npy", "--layer-young", "3"), "a layer needs --layer-thickness"),
        (("s0.npy", *LAYER), "give --young of the body below the layer"),
        (("layer.toml", "--e-star", "5"), "the scene has a layer of 5 um of 10 MPa"),
        (("layer.toml", "s0.npy"), "a layer that not all inputs have"),
        (("layer.toml", "--conductivity", "50"), "--conductivity: leave it out"),
        (("drawn.toml",), "draws its layers, and a law is that of one"),
    ],
)
def test_laws_that_layers_do_not_have_are_refused(here, capsys, arguments, message):
    np.save("s0.npy", waves(20, 0))
    Path("layer.toml").write_text(SCENE.format(thickness="5.0"))
    Path("drawn.toml").write_text(SCENE.format(thickness="[4.0, 5.0]"))
    words = ["law", *arguments, "--pressure", "0.1"]
    if "s0.npy" in arguments:  # scenes have a side of their own
        words += ["--side", "100"]
    assert cli.main(words) == 2
    assert message in capsys.readouterr().err


OF_WAVES = (
    WAVES
    + """
[contact.layer]
thickness = {thickness}
modulus = 1.0
base = "rigid"
"""
)


def test_means_of_a_scene_have_the_compression_of_a_layer_on_each_surface(here):
    """Without the layer, each closure is smaller by the compression at the pressure, 200 um/MPa."""
    Path("waves.toml").write_text(OF_WAVES.format(thickness="200.0"))
    laws = [
        by_means(
            Order(
                inputs=("waves.toml",),
                errors={"area": 0.3},
                pressure="0.01",
                boundary="periodic",
                layer_in=layer_in,
                both_tables=False,
            )
        )
        for layer_in in ("mesh", "law")
    ]
    meshed, together = map(curves_of, laws)
    np.testing.assert_allclose(
        together["closure_um"], meshed["closure_um"] + 200 * 0.01, rtol=1e-9
    )
    np.testing.assert_allclose(together["delta_um"], together["closure_um"], rtol=1e-9)
    np.testing.assert_array_equal(together["area_percent"], meshed["area_percent"])


def test_layers_that_coarser_grids_do_not_resolve_have_no_error(here, capsys):
    Path("waves.toml").write_text(OF_WAVES.format(thickness="20.0"))
    assert cli.main(["law", "waves.toml", "--pressure", "0.01", "--error", "9%"]) == 2
    assert "a cell is no smaller than the layer" in capsys.readouterr().err


@pytest.mark.parametrize("layer_in", ["mesh", "law"])
def test_a_law_on_a_layer_has_the_errors_that_were_asked_for(here, make, layer_in):
    """The band of the closure is as wide as the error of Delta, which has the compression."""
    np.save("fine.npy", 1000 * random_waves(1, 6, 0.8, 1)(96))
    on = bodies(thickness=40.0, base=None)
    settings = {
        "pressure": "0.02,0.1",
        "e_star": on.e_star,
        "layered": on.layered,
        "layer_in": layer_in,
        "stiffness": True,
        "reading": Reading(side="1000"),
        "boundary": "periodic",
        "grid_error": True,
    }
    full = make("fine.npy", **settings).over_pressure
    law = make("fine.npy", errors={"area": 0.05, "delta": 0.02}, **settings)
    within = law.over_pressure
    assert (within.fewest_nodes(96**2)[1:] < 96**2).all()  # all but first touch
    for name in ("continuum_area_percent", "closure_um"):
        curve = within.curves[name]
        assert (full.curves[name].value >= curve.low).all()
        assert (full.curves[name].value <= curve.high).all()
