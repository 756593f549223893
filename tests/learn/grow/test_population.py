"""Scenes of growths: shipped ones, files, folders of maps."""

from pathlib import Path

import pytest
from small_populations import MAPS

from gen.draft.proposal import Material
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.scene import load
from learn.grow.population import Population, scene_of


def population(name, *given, hardness=None):
    material = Material(young=1000.0, hardness=hardness, known=True)
    return Population(str(name), Reading("", "", ""), material, given, "python -m learn grow")


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    from bench.made_maps import write_all

    folder = tmp_path_factory.mktemp("maps")
    write_all(folder / "maps", MAPS)
    return folder / "maps"


def test_shipped_scenes_and_files_are_read(tmp_path):
    assert scene_of(population("quick"), tmp_path / "my.toml", print) == load("quick")
    (tmp_path / "mine.toml").write_text("samples = 3\n[surface]\nnodes = 9\n")
    found = scene_of(population(tmp_path / "mine.toml"), tmp_path / "my.toml", print)
    assert found.samples == 3
    assert not (tmp_path / "my.toml").exists()


def test_options_of_maps_are_refused_for_scenes():
    with pytest.raises(InputError, match="--young: is for a folder of maps"):
        population("quick", "--young").check(Path("my.surrogate"))


def test_the_scene_of_a_folder_is_written_once_and_is_the_same_again(maps, tmp_path):
    file, said = tmp_path / "my.toml", []
    first = scene_of(population(maps), file, said.append)
    written = file.read_bytes()
    assert first.surface.generator == "scans"
    assert first.contact.modulus == 1000.0
    assert scene_of(population(maps), file, said.append) == first
    assert file.read_bytes() == written
    assert "as before" in said[-1]


def test_other_options_or_maps_are_refused_and_an_edited_scene_is_taken(maps, tmp_path):
    file = tmp_path / "my.toml"
    scene_of(population(maps), file, print)
    written = file.read_text()
    with pytest.raises(InputError, match="give it as SCENE"):
        scene_of(population(maps, hardness=5.0), file, print)
    assert file.read_text() == written
    file.write_text(written.replace("seed = 2025", "seed = 1"))
    assert scene_of(population(maps), file, print).seed == 1
    file.write_text("samples = 3\n")
    with pytest.raises(InputError, match="give it as SCENE"):
        scene_of(population(maps), file, print)
    assert file.read_text() == "samples = 3\n"
