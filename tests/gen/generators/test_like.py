"""Surfaces of a population in scenes and databases, which keep it."""

import json
import shutil

import numpy as np
import pytest

from gen import cli
from gen.database import Reader
from gen.generation.plan import parameters, surface_random
from gen.generation.sample import surface_of
from gen.population import generate_like
from gen.runtime.errors import InputError
from gen.scene import Scene, load
from tests.like_maps import population

SCENE = """samples = {samples}
samples_per_surface = 2
[surface]
generator = "like"
population = "p.json"
nodes = {nodes}
{keys}
[load]
quantity = "pressure/(E* slope_rms)"
range = [0.005, 0.05]
"""


@pytest.fixture
def folder(here):
    (here / "p.json").write_text(population(np.exp, spacing=(0.5, 1.0)).text)
    write_scene(here)
    return here


def write_scene(folder, samples=6, nodes="[40, 48]", keys="", name="s.toml"):
    (folder / name).write_text(SCENE.format(samples=samples, nodes=nodes, keys=keys))


def run(*arguments):
    return cli.main([str(argument) for argument in arguments])


def rows(name):
    """Bytes of all columns of numbers."""
    with Reader(name) as reader:
        return {
            column.name: reader.column(column.name).tobytes()
            for column in reader.columns()
            if column.deterministic
        }


def test_a_surface_is_one_of_the_population(folder):
    """At its spacing, cut out of a period as long as its maps, and scaled."""
    write_scene(folder, keys="scale = [0.5, 2.0]")
    scene = load("s.toml").resolved()
    assert scene.grid.spacing == (0.5, 1.0)
    fitted = population(np.exp, spacing=(0.5, 1.0))
    assert fitted.nodes == (82, 82)
    period = scene.surface.period_nodes(scene.grid)
    # at most two patches, otherwise as long as the maps, with fast transforms
    assert period == (80, 90)
    heights = generate_like(fitted, (40, 48), period, surface_random(scene, 1))
    made = surface_of(scene, parameters(scene, 0, 6), 2)  # a row of the second surface
    assert made.min() == 0.0
    ratio = made / (heights - heights.min() + 1e-300)
    assert np.ptp(ratio[made > 0]) < 1e-9 * ratio.max()
    assert 0.5 < ratio.max() < 2.0


def test_a_law_of_patches_that_are_smaller_than_the_maps_has_a_warning(folder, capsys):
    """The summits of patches are lower, so that the joint of the maps is less stiff."""
    law = ["law", "s.toml", "--surfaces", "2", "--pressure", "0.01", "--no-check"]
    write_scene(folder, nodes="10")
    assert run(*law, "--csv", "patches.csv") == 0
    printed = capsys.readouterr()
    warning = "nodes = [82, 82] in [surface] gives those of surfaces as large as the maps"
    assert warning in printed.out + printed.err
    write_scene(folder, nodes="82")
    assert run(*law, "--csv", "maps.csv") == 0
    printed = capsys.readouterr()
    assert "as large as the maps" not in printed.out + printed.err


def test_a_database_needs_neither_the_file_nor_the_maps(folder, capsys):
    assert run("run", "s.toml", "-o", "a.h5") == 0
    assert "surfaces like made.npy" in capsys.readouterr().err
    (folder / "p.json").unlink()
    assert run("check", "a.h5", "--recompute", "6") == 0
    assert run("info", "a.h5") == 0
    printed = capsys.readouterr().out
    assert "population: SHA-256" in printed
    assert "logarithms" not in printed
    with Reader("a.h5") as reader:
        surface = reader.scene.surface
    assert surface.recorded_population() == population(np.exp, spacing=(0.5, 1.0))


def test_more_samples_extend_a_database_and_another_population_does_not(folder, refused):
    assert run("run", "s.toml", "-o", "a.h5") == 0
    shutil.move("p.json", "elsewhere.json")
    write_scene(folder, samples=8)
    text = (folder / "s.toml").read_text().replace("p.json", "elsewhere.json")
    (folder / "s.toml").write_text(text)
    assert run("run", "s.toml", "-o", "a.h5") == 0
    assert len(rows("a.h5")["load"]) == 8 * 8
    (folder / "elsewhere.json").write_text(population(spacing=(0.5, 1.0)).text)
    assert "surface.found.sha256" in refused(cli, "run", "s.toml", "-o", "a.h5")


def test_a_periodic_patch_is_its_own_period_and_a_larger_one_is_told(folder):
    write_scene(folder, nodes="[90, 90]")
    surface = load("s.toml").resolved().surface
    assert any("continued flat" in remark for remark in surface.remarks())
    text = (folder / "s.toml").read_text() + '[contact]\nboundary = "periodic"\n'
    (folder / "s.toml").write_text(text)
    scene = load("s.toml").resolved()
    assert scene.surface.period_nodes(scene.grid) == (90, 90)
    small = SCENE.format(samples=1, nodes="40", keys="")
    (folder / "s.toml").write_text(small)
    remarks = load("s.toml").resolved().surface.remarks()
    assert not any("continued flat" in remark for remark in remarks)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("p.json", "none.json", "there is no such file"),
        ("p.json", "s.toml", "no population that"),
        ('"p.json"', "3", "surface.population"),
        (
            "nodes = [40, 48]",
            "nodes = [3, 3]\n[contact]\nboundary = 'periodic'",
            "no wave",
        ),
        ("nodes = [40, 48]", "scale = 0", "surface.scale"),
        ("nodes = [40, 48]", "side = 3", "surface.side"),
        ("range = [0.005, 0.05]", "", "load"),
    ],
)
def test_scenes_that_cannot_be_made_are_one_line(folder, refused, old, new, words):
    text = (folder / "s.toml").read_text()
    assert old in text
    (folder / "s.toml").write_text(text.replace(old, new))
    assert words in refused(cli, "run", "s.toml", "-o", "a.h5")
    assert not (folder / "a.h5").exists()


def test_a_scene_has_to_give_its_loads(folder):
    text = (folder / "s.toml").read_text()
    with pytest.raises(InputError, match="surfaces that follow maps need loads"):
        Scene.parse(text[: text.index("[load]")], "s.toml")


def test_a_database_with_another_population_than_its_hash_is_refused(folder):
    content = json.loads(load("s.toml").resolved().text())
    content["surface"]["found"]["text"] = population().text
    with pytest.raises(InputError, match="not that of its SHA-256"):
        Scene.from_text(json.dumps(content))
