"""Scenes that ask for an error: the grid that a trial finds, and where it is taken from."""

import json
from pathlib import Path

import numpy as np
import pytest
import user_functions
from databases import deterministic_bytes

import bem
from bem.accuracy import error_parts
from gen import cli
from gen.database import Reader
from gen.generation.accuracy import DRAWS, planned_contacts
from gen.generation.completion import completed
from gen.generation.plan import parameters
from gen.generation.sample import made_surface_of, settings_of, surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene

WAVES = """samples = 8
seed = 3
[surface]
generator = "spectral"
side = 100.0
hurst = 0.8
roll_off = 50.0
cut_off = [25.0, 30.0]
rms_slope = 0.1
"""
PRESSURES = """[load]
quantity = "pressure"
range = { log_uniform = [0.005, 0.02] }
"""
PERIODIC = '[contact]\nboundary = "periodic"\n'
ASKED = "[accuracy]\ncontinuum_area = 0.05\n"
SCENE = WAVES + PRESSURES + PERIODIC + ASKED

OWN = """
import numpy as np

def ridges(shape, spacing, rng, length):
    x, y = (np.arange(nodes) * step for nodes, step in zip(shape, spacing))
    first, second = rng.uniform(0, 2 * np.pi, 2)
    return np.cos(2 * np.pi * x / length + first)[:, None] * np.cos(2 * np.pi * y / length + second)

def noise(shape, spacing, rng, length):
    return rng.standard_normal(shape)
"""
OWN_SCENE = (
    'samples = 4\n[surface]\ngenerator = "python"\nfunction = "mine:{}"\n'
    "nodes = 128\nside = 100.0\n"
    "parameters = {{ length = {{ choice = [25.0, 50.0] }} }}\n"
) + PRESSURES.replace("{", "{{").replace("}", "}}")


def run(*arguments):
    return cli.main(["run", *arguments])


@pytest.fixture
def folder(here):
    """The current folder, with a scene that asks for an area to 5 %."""
    (here / "mine.toml").write_text(SCENE)
    return here


@pytest.fixture
def no_trial(monkeypatch):
    """From now on a trial fails the test."""

    def forbid():
        monkeypatch.setattr("gen.generation.completion.with_accuracy", None)

    return forbid


def found_grid(text, **keys):
    """The grid that a trial finds for a scene's text."""
    scene = completed(Scene.parse(text, "test").model_copy(update=keys))
    return scene.accuracy.found.nodes


def errors_of_rows(scene, finer=4):
    """Relative errors of the area in the continuum, to the same surfaces on a finer grid."""
    nodes = [finer * count for count in scene.grid.shape]
    fine = scene.with_parameters({}, nodes=nodes)
    plan = parameters(scene, 0, scene.samples)
    errors = []
    for row, load in enumerate(plan.load):
        areas = []
        for on in (scene, fine):
            settings = settings_of(on, plan.hardness_of(row), plan.layer_of(row))
            heights = surface_of(on, plan, row)
            contact = bem.solve(heights, on.grid.sides, pressure=load, **settings)
            areas.append(contact.continuum_area_percent)
        errors.append(areas[0] / areas[1] - 1)
    return np.abs(errors)


def test_rows_lie_within_the_error_of_a_finer_grid():
    scene = completed(Scene.parse(SCENE, "test"))
    errors = errors_of_rows(scene)
    assert np.mean(errors <= 0.05) >= 0.95


LAYER = """[contact.layer]
thickness = { log_uniform = [1.5, 20.0] }
modulus = [5.0, 20.0]
poisson = 0.3
"""
"""Layers that are harder than their base, on which the modulus of surfaces is not 1 MPa."""


@pytest.mark.long
def test_rows_on_layers_lie_within_the_error_and_their_cells_are_smaller_than_a_layer():
    text = SCENE.replace("[0.005, 0.02]", "[0.1, 0.3]") + LAYER
    scene = completed(Scene.parse(text, "test"))
    assert np.mean(errors_of_rows(scene) <= 0.05) >= 0.95
    planned = planned_contacts(scene.model_copy(update={"samples_per_surface": 1}))
    for row in range(planned.load.size):
        body = scene.contact.body(planned.layer_of(row))
        assert body.is_deeper_than_cells(scene.grid.spacing)
    thicknesses = planned.layer["layer_thickness"]
    assert thicknesses.min() < 1.7
    assert thicknesses.max() > 17


def test_a_layer_as_thin_as_the_finest_cells_is_refused():
    layer = LAYER.replace("{ log_uniform = [1.5, 20.0] }", "0.01")
    with pytest.raises(
        InputError, match="a cell of this grid is no smaller than the layer"
    ):
        completed(Scene.parse(SCENE + layer, "test"))


def test_the_grid_is_that_of_the_scene_without_its_seed_and_samples():
    assert found_grid(SCENE, seed=8, samples=1) == found_grid(SCENE)


@pytest.mark.long
def test_a_smaller_error_needs_more_nodes():
    assert found_grid(SCENE.replace("0.05\n", "0.005\n")) > found_grid(SCENE)


def test_nodes_of_the_scene_are_the_finest_grid():
    finest = SCENE.replace("side =", "nodes = 40\nside =")
    assert found_grid(finest) <= (40, 40)
    scene = Scene.parse(finest.replace("0.05\n", "0.001\n"), "test")
    with pytest.raises(InputError, match=r"0\.001 is not reached on 40 x 40 nodes"):
        completed(scene)


@pytest.mark.parametrize("bodies", ["hardness_ratio = [0.05, 0.5]\n", ""])
@pytest.mark.parametrize("boundary", ["mirror", "free"])
@pytest.mark.long
def test_all_bodies_and_boundaries_have_a_grid(boundary, bodies):
    text = WAVES.replace("rms_slope", 'against = "another"\nrms_slope') + (
        '[load]\nquantity = "delta/height_rms"\nrange = [1.0, 2.0]\n'
        f'[contact]\nboundary = "{boundary}"\n{bodies}[accuracy]\nforce = 0.2\nmean_gap = 0.1\n'
    )
    scene = completed(Scene.parse(text, "test"))
    errors = scene.accuracy.found.errors
    assert {name: error.total <= 0.2 for name, error in errors.items()} == {
        "force": True,
        "mean_gap": True,
    }
    assert scene.store.wants("mean_gap")


def test_the_contacts_of_a_trial_are_at_the_ends_and_between():
    scene = Scene.parse(SCENE, "test")
    plan = planned_contacts(scene)
    corners = plan.load.size - DRAWS
    assert corners == 2**2  # of cut_off and the load
    values = (plan.drawn["cut_off"], plan.load)
    assert (
        len(set(zip(*(value[:corners].tolist() for value in values), strict=True))) == 4
    )
    for value, (low, high) in zip(values, ((25, 30), (0.005, 0.02)), strict=True):
        assert low <= value.min() < value.max() <= high
        assert np.unique(value[:corners]).size == 2
    assert np.unique(plan.surface).size == plan.load.size


def test_of_many_drawn_quantities_some_corners_are_tried():
    names = "".join(f"{letter} = [1.0, 2.0]," for letter in "abcdefgh")
    text = OWN_SCENE.format("ridges").replace("length =", f"{names} length =") + ASKED
    plan = planned_contacts(Scene.parse(text, "test"))
    assert plan.load.size == 32 + DRAWS


def test_a_database_goes_on_without_another_trial(folder, no_trial, capsys):
    """The same command, more samples, further parts from the file itself, and its check."""
    assert run("mine.toml", "-o", "part.h5", "--rows", "0:3") == 0
    assert "48 x 48 nodes: 0 of 20 contacts beyond" in capsys.readouterr().err
    no_trial()
    assert run("part.h5", "-o", "other.h5", "--rows", "3:8") == 0
    assert run("mine.toml", "-o", "part.h5", "--rows", "0:5") == 0
    assert cli.main(["merge", "part.h5", "other.h5", "-o", "whole.h5"]) == 0
    (folder / "more.toml").write_text(SCENE.replace("samples = 8", "samples = 9"))
    assert run("more.toml", "-o", "part.h5") == 0
    assert cli.main(["check", "part.h5"]) == 0
    capsys.readouterr()
    assert run("more.toml", "-o", "part.h5", "--dry-run") == 0
    assert "continuum_area within 5 % in 95 % of rows: 48 x 48 nodes" in (
        capsys.readouterr().out
    )
    whole = deterministic_bytes(folder / "whole.h5")
    more = deterministic_bytes(folder / "part.h5")
    assert all(more[name].startswith(whole[name]) for name in whole)
    assert "continuum_area_percent" in whole
    with Reader(folder / "whole.h5") as reader:
        assert reader.scene.grid.shape == (48, 48)
        assert reader.scene.contact.rtol == 0.005


def test_another_scene_is_refused_without_a_trial(folder, no_trial, capsys):
    assert run("mine.toml", "-o", "a.h5", "--rows", "0:1") == 0
    no_trial()
    for changed, line in {
        SCENE.replace("0.05\n", "0.04\n"): "continuum_area: 0.05 in the file, 0.04 asked",
        SCENE.replace("seed = 3", "seed = 4"): "seed: 3 in the file, 4 asked for",
        SCENE.replace(ASKED, ""): "accuracy.continuum_area: 0.05 in the file, nothing",
    }.items():
        (folder / "other.toml").write_text(changed)
        assert run("other.toml", "-o", "a.h5") == 2
        assert line in capsys.readouterr().err


@pytest.mark.usefixtures("untrusted")
def test_outputs_without_trust_are_refused_before_a_trial(folder, no_trial, capsys):
    (folder / "own.py").write_text("raise MemoryError\n")
    (folder / "own.toml").write_text(SCENE + '[store]\nfunction = "own:outputs"\n')
    no_trial()
    assert run("own.toml", "-o", "own.h5") == 2
    assert "runs only with --trust" in capsys.readouterr().err


def test_an_accuracy_is_refused_for_a_database_without_one(folder, no_trial, capsys):
    (folder / "plain.toml").write_text(
        SCENE.replace(ASKED, "").replace("side", "nodes=48\nside")
    )
    assert run("plain.toml", "-o", "a.h5", "--rows", "0:1") == 0
    no_trial()
    assert run("mine.toml", "-o", "a.h5") == 2
    assert "accuracy.continuum_area: nothing in the file, 0.05" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "samples = 1\n" + ASKED,
            "'diamond-square' adds shorter waves on every finer grid",
        ),
        (SCENE.replace("[acc", "rtol = 1e-5\n[acc"), "[accuracy] finds the tolerance"),
        (
            WAVES
            + PRESSURES.replace("pressure", "delta")
            + '[contact]\nfar_field = "compliant"\n'
            + ASKED,
            "accuracy needs contact.far_field = 'rigid', not 'compliant'",
        ),
        (
            SCENE.replace(ASKED, "[accuracy]\n"),
            "accuracy: it asks for nothing: give at least",
        ),
        (SCENE.replace("0.05\n", "5\n"), "continuum_area = 5; allowed: a share above 0"),
        (
            SCENE.replace("continuum_area", "area"),
            "closest known key is accuracy.continuum_area",
        ),
    ],
)
def test_what_cannot_have_an_accuracy_is_refused_in_one_line(here, capsys, text, words):
    (here / "mine.toml").write_text(text)
    assert run("mine.toml", "-o", "a.h5") == 2
    message = capsys.readouterr().err
    assert words in message
    assert len(message.splitlines()) == 1
    assert [path.name for path in here.iterdir()] == ["mine.toml"]


def test_waves_down_to_the_finest_grid_are_refused_before_a_file_is_made(here, capsys):
    text = SCENE.replace("side =", "nodes = 48\nside =").replace("[25.0, 30.0]", "4.5")
    (here / "mine.toml").write_text(text)
    assert run("mine.toml", "-o", "a.h5") == 2
    message = capsys.readouterr().err.splitlines()[-1]
    assert "waves go on down to this grid" in message
    assert "0.05 is not reached on 48 x 48 nodes, the finest grid" in message
    assert [path.name for path in here.iterdir()] == ["mine.toml"]


def test_a_trial_that_is_interrupted_leaves_nothing(folder, monkeypatch):
    judged = []

    def interrupted(*arguments, **settings):
        judged.append(error_parts(*arguments, **settings))
        if len(judged) == 5:
            raise KeyboardInterrupt
        return judged[-1]

    monkeypatch.setattr("gen.generation.accuracy.error_parts", interrupted)
    with pytest.raises(KeyboardInterrupt):
        completed(Scene.parse(SCENE, "test"), folder)
    assert [path.name for path in folder.iterdir()] == ["mine.toml"]


@pytest.mark.parametrize("boundary", ["periodic", "mirror", "free"])
@pytest.mark.few(1)
def test_surfaces_of_your_own_are_read_on_fewer_nodes(tmp_path, monkeypatch, boundary):
    """Their cells cover the same patch; periodic waves have the heights of the function there."""
    text = OWN_SCENE.format("ridges") + (
        f'[contact]\nboundary = "{boundary}"\n' + ASKED.replace("0.05", "0.1")
    )
    with user_functions.inside(tmp_path, monkeypatch, text):
        (tmp_path / "mine.py").write_text(OWN)
        scene = completed(Scene.parse(text, "test"))
        made, grid = scene.made_grid, scene.grid
        assert grid.shape < made.shape == (128, 128)
        for axis in (0, 1):
            length = made.shape[axis] * made.spacing[axis]
            assert grid.shape[axis] * grid.spacing[axis] == pytest.approx(length)
        plan = parameters(scene, 0, 1)
        fewer = surface_of(scene, plan, 0)
        assert fewer.shape == grid.shape
        if boundary == "periodic":
            table = scene.surface.model_copy(update={"nodes": grid.shape[0]})
            there = scene.model_copy(update={"surface": table, "accuracy": None})
            expected = made_surface_of(there, plan, 0)
            assert fewer == pytest.approx(expected, abs=1e-12)


def test_noise_of_your_own_has_no_accuracy(tmp_path, monkeypatch):
    text = OWN_SCENE.format("noise") + ASKED
    with user_functions.inside(tmp_path, monkeypatch, text):
        (tmp_path / "mine.py").write_text(OWN)
        with pytest.raises(InputError, match="waves go on down to this grid"):
            completed(Scene.parse(text, "test"))


def test_windows_of_maps_are_never_finer_than_the_map(here, capsys):
    """And their database is computed again, bit for bit, from the maps."""
    random = np.random.default_rng(1)
    waves = np.zeros((160, 81), dtype=complex)
    waves[:5, :5] = random.normal(size=(5, 5)) + 1j * random.normal(size=(5, 5))
    np.save(here / "map.npy", 100 * np.fft.irfft2(waves, s=(160, 160)))
    text = (
        'samples = 3\n[surface]\ngenerator = "scans"\nfiles = "map.npy"\nnodes = 80\n'
        "[surface.reading]\nside = 160.0\nunit = 'um'\n"
        '[load]\nquantity = "pressure/(E* slope_rms)"\nrange = [0.05, 0.1]\n'
    )
    (here / "mine.toml").write_text(text + ASKED)
    assert run("mine.toml", "-o", "a.h5") == 0
    assert cli.main(["check", "a.h5"]) == 0
    with Reader(Path("a.h5")) as reader:
        nodes = reader.scene.grid.shape
        recorded = json.loads(reader.scene.text())
        assert recorded["surface"]["nodes"] == 80  # of a window
    assert nodes < (80, 80)
    (here / "mine.toml").write_text(text + ASKED.replace("0.05", "0.0001"))
    assert run("mine.toml", "-o", "b.h5") == 2
    assert "on 80 x 80 nodes, the finest grid" in capsys.readouterr().err
    assert not (here / "b.h5").exists()
