"""Surrogates of bodies with a layer: features, questions, and answers at other scales."""

import json
import re
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pandas as pd
import pytest
from databases import database_of
from learnt_rows import read
from pages import ROOT

import bem
from asperity.functions import SceneFunction, SurrogateFunction
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene
from learn import Surrogate, dataset
from learn import cli as learn_cli
from learn.dataset import Request
from learn.features import SurfaceFeatures, chosen, sets
from learn.features.columns import BASE_RATIO, LAYER_DEPTH
from learn.features.layers import TrainedLayers
from learn.features.sets import FORMULAS
from learn.features.surface import CoarseMaterial
from learn.surrogate.card import lines

SCENE = """samples = {samples}
[surface]
generator = "spectral"
nodes = 24
side = 48.0
hurst = [0.5, 0.9]
roll_off = 24.0
cut_off = 6.0
rms_height = [0.5, 1.0]
[load]
quantity = "pressure"
range = {{ log_uniform = [0.5, 20.0] }}
[contact]
boundary = "periodic"
{contact}
[contact.layer]
{layer}
"""
STEEL = "modulus = 200.0\npoisson = 0.3"
DRAWN = """thickness = { log_uniform = [2.0, 16.0] }
modulus = { log_uniform = [20.0, 800.0] }
poisson = 0.25"""
FIXED = "thickness = 5.0\nmodulus = 50.0\npoisson = 0.25"
BODY = bem.Layered(5.0, 50.0, 0.25, bem.HalfSpace(200.0, 0.3))
SIDE = 48.0
OPTIONS_OF_BODY = [
    *("--layer-thickness", "5", "--layer-young", "50", "--layer-poisson", "0.25"),
    *("--young", "200", "--poisson", "0.3"),
]
NEW_LAYER = ["--layer-thickness", "5", "--layer-young", "9"]


def scene_of(layer, contact=STEEL, samples=40):
    return SCENE.format(samples=samples, contact=contact, layer=layer)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with databases of drawn layers and of one layer, and a surrogate of each."""
    directory = tmp_path_factory.mktemp("layers")
    for name, layer in {"drawn": DRAWN, "fixed": FIXED}.items():
        database = str(database_of(directory, scene_of(layer), name))
        file = str(directory / f"{name}.surrogate")
        line = ["fit", database, "--features", "dimensionless", "--load", "pressure"]
        assert learn_cli.main([*line, "--target", "area,delta", "-o", file]) == 0
    return directory


@pytest.fixture(scope="module")
def drawn(folder):
    return Surrogate.load(folder / "drawn.surrogate")


@pytest.fixture(scope="module")
def fixed(folder):
    return Surrogate.load(folder / "fixed.surrogate")


@pytest.fixture(scope="module")
def heights():
    scene = Scene.parse(scene_of(FIXED), "test")
    return surface_of(scene, parameters(scene, 0, 1), 0)


@pytest.fixture
def question(heights, tmp_path):
    """Words of the command line that ask for a surface at 5 MPa."""
    path = tmp_path / "map.npy"
    np.save(path, heights)
    return [str(path), "--side", "48", "--pressure", "5"]


def test_answers_are_those_of_the_scale(drawn, heights):
    """Lengths are doubled, heights times 3 and moduli times 4: pressures are 6 times as large."""
    usual = drawn.predict(heights, SIDE, pressure=[2.0, 8.0], body=BODY)
    scaled = drawn.predict(
        3 * heights,
        2 * SIDE,
        pressure=[12.0, 48.0],
        body=BODY.scaled(lengths=2.0, moduli=4.0),
    )
    np.testing.assert_allclose(scaled.area, usual.area, rtol=1e-9)
    np.testing.assert_allclose(
        scaled.values["delta"], 3 * usual.values["delta"], rtol=1e-9
    )
    np.testing.assert_allclose(scaled.high["delta"], 3 * usual.high["delta"], rtol=1e-9)
    assert scaled.reasons == usual.reasons


def test_scaled_contacts_are_copies(heights):
    usual = bem.solve(heights, SIDE, pressure=5.0, body=BODY, boundary="periodic")
    scaled = bem.solve(
        3 * heights,
        2 * SIDE,
        pressure=30.0,
        body=BODY.scaled(lengths=2.0, moduli=4.0),
        boundary="periodic",
    )
    assert scaled.contact_nodes == usual.contact_nodes
    assert scaled.delta == pytest.approx(3 * usual.delta, rel=1e-6)


@pytest.mark.parametrize("features", ["dimensionless", "hybrid"])
def test_features_are_those_of_the_scale(features, heights):
    scene = Scene.parse(scene_of(DRAWN), "test")
    columns = chosen(features, [scene], roots=True, load="pressure")
    assert {LAYER_DEPTH, BASE_RATIO} < set(columns.columns)
    rows = [
        SurfaceFeatures(
            factor * heights, (side, side), (side / 24, side / 24), boundary="periodic"
        ).rows(columns, np.array([pressure]), bodies=[body])
        for factor, side, pressure, body in [
            (1.0, SIDE, 5.0, BODY),
            (3.0, 2 * SIDE, 30.0, BODY.scaled(lengths=2.0, moduli=4.0)),
        ]
    ]
    usual, scaled = (columns.of(row) for row in rows)
    np.testing.assert_allclose(scaled, usual, rtol=1e-6, atol=1e-9)


def test_thicker_layers_are_deeper_by_the_ratio(heights):
    scene = Scene.parse(scene_of(DRAWN), "test")
    columns = chosen("dimensionless", [scene], load="pressure")
    surface = SurfaceFeatures(heights, (SIDE, SIDE), (2.0, 2.0), boundary="periodic")
    bodies = [BODY, replace(BODY, thickness=10.0)]
    rows = surface.rows(columns, np.array([5.0, 5.0]), bodies=bodies)
    thin, thick = FORMULAS[LAYER_DEPTH](rows)
    assert thick - thin == pytest.approx(np.log(2))
    ratio = (200.0 / (1 - 0.3**2)) / (50.0 / (1 - 0.25**2))
    assert FORMULAS[BASE_RATIO](rows) == pytest.approx(np.log([ratio, ratio]))


def test_rows_of_a_database_have_the_features_of_their_surfaces(folder):
    rows_of_database = read(
        folder / "drawn.h5", "delta", features="hybrid", load="pressure", roots=True
    )
    scene = rows_of_database.origins[0].scene
    plan = parameters(scene, 0, 40)
    surface = SurfaceFeatures(
        surface_of(scene, plan, 7), (SIDE, SIDE), (2.0, 2.0), boundary="periodic"
    )
    body = scene.contact.body(plan.layer_of(7))
    with h5py.File(folder / "drawn.h5") as file:
        pressure = file["load"][7]
        delta = file["delta"][7]
    rows = surface.rows(rows_of_database.features, np.array([pressure]), bodies=[body])
    np.testing.assert_allclose(
        rows_of_database.features.of(rows)[0], rows_of_database.inputs[7], rtol=1e-9
    )
    # The grid has no more nodes than blocks, so that the coarse solve is exact but for its rtol.
    assert rows.delta == pytest.approx(delta, rel=1e-2)


@pytest.mark.parametrize("thickness", [0.5, 4.0])
def test_a_thin_layer_on_a_free_patch_has_features(thickness):
    """Blocks of a free patch are larger than its cells, for which a layer may be thick enough."""
    text = scene_of(DRAWN).replace('boundary = "periodic"', "").replace("= 24", "= 72")
    scene = Scene.parse(text, "test")
    heights = surface_of(scene, parameters(scene, 0, 1), 0)
    surface = SurfaceFeatures(heights, scene.grid.sides, scene.grid.spacing)
    columns = chosen("hybrid", [scene], roots=True)
    body = replace(BODY, thickness=thickness)
    rows = surface.rows(columns, np.array([0.5]), bodies=[body])
    assert np.isfinite(columns.of(rows)).all()


def test_a_compressed_layer_has_an_equilibrium_at_any_delta(heights):
    scene = Scene.parse(scene_of(f"{FIXED}\nbase = 'rigid'", contact=""), "test")
    columns = chosen("hybrid", [scene], roots=True)
    assert BASE_RATIO not in columns.columns
    surface = SurfaceFeatures(heights, (SIDE, SIDE), (2.0, 2.0), boundary="periodic")
    rows = surface.rows(columns, np.array([20.0]), bodies=[replace(BODY, base="rigid")])
    assert rows.notes == ()
    assert columns.of(rows)[0, columns.columns.index("coarse_area_percent")] == 100


def test_a_surrogate_of_one_layer_answers_for_it_unless_another_is_given(fixed, heights):
    by_default = fixed.predict(heights, SIDE, pressure=5.0)
    with_body = fixed.predict(heights, SIDE, pressure=5.0, body=BODY)
    assert with_body.area == by_default.area
    thick = fixed.predict(heights, SIDE, pressure=5.0, body=replace(BODY, thickness=50.0))
    assert f"{LAYER_DEPTH} " in thick.reasons[0]
    stiff = replace(BODY, base=bem.HalfSpace(400.0, 0.3))
    outside = fixed.predict(heights, SIDE, pressure=5.0, body=stiff)
    assert "base's E*/E* 8.242 outside 4.121 to 4.121" in outside.reasons[0]


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("drawn", [], "give --layer-thickness and --layer-young (in Python: body)"),
        ("drawn", ["--young", "200"], "trained on layers of 2 to 16 um of 20 to 800 MPa"),
        (
            "drawn",
            [*NEW_LAYER, "--layer-base", "rigid"],
            "on a rigid base: the surrogate was trained on layers with Poisson's ratio 0.25",
        ),
        (
            "drawn",
            [*NEW_LAYER, "--young", "200", "--young", "1"],
            "--young was given twice",
        ),
        ("drawn", ["--layer-thickness", "5"], "a layer needs --layer-young, too"),
    ],
)
def test_questions_without_a_layer_of_the_kind_are_one_line(
    folder, question, capsys, name, options, message
):
    line = ["predict", str(folder / f"{name}.surrogate"), *question, *options]
    assert learn_cli.main(line) == 2
    output = capsys.readouterr()
    assert message in output.err
    assert output.err.strip().count("\n") == 0


def test_the_command_line_answers_for_a_layer(drawn, folder, question, heights, tmp_path):
    table = tmp_path / "answers.csv"
    line = ["predict", str(folder / "drawn.surrogate"), *question, *OPTIONS_OF_BODY]
    assert learn_cli.main([*line, "-o", str(table)]) == 0
    answers = np.genfromtxt(table, names=True, delimiter=",", dtype=None, encoding=None)
    in_python = drawn.predict(heights, SIDE, pressure=5.0, body=BODY)
    assert answers["area_percent"] == pytest.approx(in_python.area[0])


def test_a_layer_for_a_surrogate_of_half_spaces_is_refused(solved, tmp_path, heights):
    file = str(tmp_path / "half.surrogate")
    assert learn_cli.main(["fit", str(solved), "-o", file]) == 0
    with pytest.raises(
        InputError, match="was trained on half-spaces: leave out the layer"
    ):
        Surrogate.load(file).predict(heights, SIDE, 1.0, body=BODY)


def test_features_of_the_paper_hold_for_one_layer_alone(folder, heights):
    with pytest.raises(
        InputError, match="--features paper: have no layers, which differ"
    ):
        read(folder / "drawn.h5")
    file = str(folder / "paper.surrogate")
    line = ["fit", str(folder / "fixed.h5"), "--load", "pressure", "--target", "area"]
    assert learn_cli.main([*line, "--features", "paper", "-o", file]) == 0
    surrogate = Surrogate.load(file)
    assert surrogate.learnt["area"].powers is None
    with pytest.raises(InputError, match="holds for a layer of 5 um of 50 MPa"):
        surrogate.predict(heights, SIDE, pressure=5.0, body=BODY.scaled(lengths=2.0))


def test_a_surrogate_of_a_scene_takes_the_numbers_of_its_layer(folder):
    file = str(folder / "scene.surrogate")
    line = ["fit", str(folder / "drawn.h5"), "--features", "scene"]
    assert learn_cli.main([*line, "--target", "area", "-o", file]) == 0
    function = SurrogateFunction(file)
    assert function.inputs.layer == ("layer_thickness", "layer_modulus")
    numbers = {"hurst": 0.7, "rms_height": 0.8, "pressure": 5.0}
    soft = function(**numbers, layer_thickness=8.0, layer_modulus=20.0)
    hard = function(**numbers, layer_thickness=8.0, layer_modulus=800.0)
    assert soft > 2 * hard


def test_layers_are_inputs_of_functions(folder, drawn):
    scene = Scene.parse(scene_of(DRAWN), "test")
    solver = SceneFunction(scene, ("area_percent",))
    learnt = SurrogateFunction(folder / "drawn.surrogate", ("area",))
    assert solver.names == learnt.names
    assert solver.inputs.sizes == [2, 1, 2]
    numbers = {"hurst": 0.7, "rms_height": 0.8, "pressure": 5.0}
    numbers |= {"layer_thickness": 5.0, "layer_modulus": np.array([50.0, 400.0])}
    # The tolerance, in percent of the patch, is that of a surrogate of 40 rows.
    np.testing.assert_allclose(learnt(**numbers), solver(**numbers), atol=6.0)
    with pytest.raises(
        InputError, match="layer_thickness = -1; allowed: a number above 0"
    ):
        solver(**numbers | {"layer_thickness": -1.0})


def test_cards_say_for_which_layers_they_hold(drawn, fixed):
    texts = "\n".join(lines(drawn.card))
    assert "a layer of 2 to 16 um of 20 to 800 MPa (Poisson's ratio 0.25)" in texts
    assert "at any scale of lengths and moduli" in texts
    layers = fixed.training.layers
    assert layers.only == BODY
    assert TrainedLayers.of_card(json.loads(json.dumps(layers.entry))) == layers


def test_databases_of_layers_are_learnt_together_if_their_kinds_are_alike(folder):
    both = [str(folder / f"{name}.h5") for name in ("drawn", "fixed")]
    file = str(folder / "both.surrogate")
    line = ["fit", *both, "--features", "dimensionless", "--load", "pressure"]
    assert learn_cli.main([*line, "--target", "area", "-o", file]) == 0
    assert Surrogate.load(file).training.layers.thickness == (2.0, 16.0)
    rigid = database_of(folder, scene_of(f"{FIXED}\nbase = 'rigid'", contact=""), "rigid")
    unlike = Request((folder / "fixed.h5", rigid), features="dimensionless")
    with pytest.raises(
        InputError, match=r"rigid\.h5: contact\.layer is .* on a rigid base"
    ):
        dataset.read(unlike)


def test_laws_are_those_of_a_given_layer(drawn, folder, question, heights, tmp_path):
    table = tmp_path / "law.csv"
    words = [*question[:3], "--pressure", "2,5,8", *OPTIONS_OF_BODY]
    line = ["law", str(folder / "drawn.surrogate"), *words, "--csv", str(table)]
    assert learn_cli.main(line) == 0
    law = pd.read_csv(table)
    areas = law[law["against"] == "pressure_MPa"]["area_percent"].to_numpy()
    predicted = drawn.predict(heights, SIDE, pressure=[2.0, 5.0, 8.0], body=BODY)
    np.testing.assert_allclose(areas[-3:], predicted.area, rtol=1e-6)


def without_layers(monkeypatch):
    """Compute features and coarse solves as on half-spaces, so that no model sees the layer."""
    monkeypatch.setattr(sets, "_layer_columns", lambda *_: [])
    monkeypatch.setattr(
        CoarseMaterial, "of", lambda hardness_ratio, _: CoarseMaterial(hardness_ratio)
    )


@pytest.fixture(scope="module")
def coatings(tmp_path_factory):
    """A database of 1,000 coatings on steel, of the scene in docs/how-to/layers.md."""
    page = (ROOT / "docs/how-to/layers.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```toml\n(samples.*?)```", page, re.DOTALL)
    return database_of(tmp_path_factory.mktemp("coatings"), text, "coatings")


@pytest.mark.long
@pytest.mark.parametrize(
    ("features", "error", "ratio"), [("dimensionless", 3.3, 2.9), ("hybrid", 1.0, 10.0)]
)
def test_the_area_is_learnt_with_the_features_of_layers(
    coatings, tmp_path, monkeypatch, features, error, ratio
):
    """The error is the nMAE of the area on rows that were left out [%]."""
    errors = []
    for name in ("with", "without"):
        if name == "without":
            without_layers(monkeypatch)
        database = shutil.copy(coatings, tmp_path / f"{name}.h5")
        file = tmp_path / f"{name}.surrogate"
        line = ["fit", str(database), "--features", features, "--load", "pressure"]
        assert learn_cli.main([*line, "-o", str(file)]) == 0
        errors.append(Surrogate.load(file).card["targets"]["area"]["scores"]["nmae"])
    assert errors[0] < error, errors
    assert errors[1] > ratio * errors[0], errors
