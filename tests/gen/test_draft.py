"""A scene drafted for maps runs as it is, and what its comments state is true."""

import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.made_maps import MAPS, Faults, measured, write
from gen import cli
from gen.database import Reader
from gen.draft import quoted
from gen.draft import write as write_scene
from gen.draft.survey import find_spikes
from gen.runtime.errors import InputError
from gen.scene import load
from gen.schema import Status

pytest.importorskip("SurfaceTopography")

MADE = {made.name: made for made in MAPS}
SMALL = (
    replace(MADE["ground-3"], shape=(150, 140)),  # spikes and holes, .nc
    replace(MADE["fractal-2"], shape=(160, 140)),  # spikes and holes, .x3p
    replace(MADE["honed-1"], shape=(140, 150)),  # tilted, .nc
    replace(MADE["sandblasted-0"], shape=(160, 160)),  # .gwy
    replace(MADE["turned-4"], shape=(90, 90)),  # a node every 2 um
    replace(MADE["fractal-0"], shape=(20, 150), faults=Faults()),  # narrow
)
STEEL = ["--young", "210e3", "--poisson", "0.3", "--hardness", "2000"]


@pytest.fixture
def scans(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scans").mkdir()
    for made in SMALL:
        write(made, tmp_path / "scans")
    (tmp_path / "scans" / "notes.txt").write_text("Tuesday\n")
    return tmp_path / "scans"


def test_a_folder_of_maps_becomes_a_scene_that_runs(scans, capsys):
    assert cli.main(["scene", "scans", "-o", "mine.toml", *STEEL]) == 0
    said, text = capsys.readouterr().out, (scans.parent / "mine.toml").read_text()
    for made in SMALL:
        assert made.name in said
        assert made.name in text
    scene = load("mine.toml")
    surface = scene.surface
    assert surface.generator == "scans"
    assert (surface.nodes, surface.spacing) == (64, 1.0)
    assert [Path(name).stem for name in surface.files] == [
        "fractal-2",
        "ground-3",
        "honed-1",
        "sandblasted-0",
    ]
    for left, why in (
        ("fractal-0", "hold no window of 64 x 64"),
        ("turned-4", "a node every 2 um"),
        ("notes", "'Tuesday' is not a number"),
    ):
        assert re.search(rf'# "scans/{left}\.\w+" is left out: .*{re.escape(why)}', text)
    steps = surface.preparation
    spikes = sum(find_spikes(measured(made)).number for made in SMALL[:2])
    assert spikes >= 29  # of 31: holes may swallow some
    assert (steps.level, steps.fill) == ("plane", True)
    assert f"2 of 4 maps have spikes, {spikes} nodes in all" in text
    assert "2 of 4 maps have holes" in text
    assert (scene.contact.boundary, scene.contact.hardness) == ("mirror", 2000.0)
    small, large = re.search(r"bring about ([\d.]+) to ([\d.]+) % of a middling", text).groups()

    assert cli.main(["run", "mine.toml", "-o", "mine.h5", "--rows", "0:60"]) == 0
    with Reader(scans.parent / "mine.h5") as reader:
        assert reader.counts().done == 60
        done = reader.column("status") == Status.DONE
        areas, loads = (reader.column(name)[done] for name in ("area_percent", "load"))
    order = np.argsort(loads)
    assert np.median(areas[order[:8]]) < 3 * float(small)
    assert 0.5 * float(large) < areas[order[-1]] < 1.5 * float(large)


def test_the_command_in_the_scene_writes_the_same_scene(scans):
    assert cli.main(["scene", "scans", "-o", "mine.toml", *STEEL]) == 0
    text = (scans.parent / "mine.toml").read_text()
    (scans.parent / "mine.toml").rename(scans.parent / "kept.toml")
    [line] = [line for line in text.splitlines() if " -m gen scene " in line]
    assert cli.main(shlex.split(line)[4:]) == 0
    assert (scans.parent / "mine.toml").read_text() == text


def test_one_map_elastic_without_material(scans):
    assert cli.main(["scene", "scans/honed-1.nc", "-o", "mine.toml"]) == 0
    scene, text = load("mine.toml"), (scans.parent / "mine.toml").read_text()
    assert scene.surface.files == (str(scans / "honed-1.nc"),)
    assert scene.surface.spacing is None
    assert scene.quantity == "pressure/(E* slope_rms)"
    assert (scene.contact.modulus, scene.contact.hardness) == (1.0, None)
    assert "No map has spikes" in text
    assert "No map has holes" in text
    assert "That is few" in text  # tiles


def test_text_maps_are_read_as_the_options_say(scans):
    rough = np.random.default_rng(1).normal(size=(150, 150)).cumsum(0)
    np.savetxt(scans / "nm.txt", rough)
    arguments = ["scans/nm.txt", "-o", "mine.toml", "--side", "149", "--unit", "nm"]
    assert cli.main(["scene", *arguments]) == 0
    reading = load("mine.toml").surface.reading
    assert (reading.side, reading.unit) == ("149", "nm")
    assert cli.main(["run", "mine.toml", "-o", "mine.h5", "--rows", "0:2"]) == 0


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ("-o a.toml", "--like"),
        ("scans -o scene", ".toml"),
        ("scans -o there.toml", "there already"),
        ("scans/notes.txt -o a.toml", "'Tuesday'"),
        ("scans/fractal-0.nc -o a.toml", "too small"),
        ("scans --unit mile -o a.toml", "mile"),
    ],
)
def test_bad_command_lines_are_one_line_and_write_nothing(scans, capsys, arguments, word):
    (scans.parent / "there.toml").write_text("samples = 1\n")
    assert cli.main(["scene", *arguments.split()]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert word in captured.err
    assert {path.name for path in scans.parent.iterdir()} == {"scans", "there.toml"}
    assert (scans.parent / "there.toml").read_text() == "samples = 1\n"


def test_a_draft_with_a_slipped_unit_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    np.save("map.npy", np.random.default_rng(0).normal(size=(40, 40)))
    options = ["--side", "40", "--hardness", "2000"]
    for young, told in (("210", True), ("210e3", False)):
        assert (
            cli.main(["scene", "map.npy", *options, "--young", young, "-o", f"{young}.toml"]) == 0
        )
        assert ("is the modulus in GPa?" in capsys.readouterr().err) == told


TEXT = "# a row\nsamples = 1\n"


def test_a_scene_is_written_as_it_is_read(tmp_path):
    assert write_scene(tmp_path / "a.toml", TEXT).samples == 1
    assert (tmp_path / "a.toml").read_text() == "# a row\nsamples = 1\n"


@pytest.mark.parametrize("kind", ["file", "link to a file"])
def test_what_is_there_stays(tmp_path, kind):
    path = tmp_path / "a.toml"
    if kind == "file":
        path.write_text("mine")
    else:
        (tmp_path / "yours").write_text("mine")
        path.symlink_to("yours")
    with pytest.raises(InputError, match="is there already"):
        write_scene(path, TEXT)
    assert path.read_text() == "mine"


def test_what_is_no_scene_is_not_written(tmp_path):
    with pytest.raises(InputError, match="samples"):
        write_scene(tmp_path / "a.toml", "samples = -1")
    assert not list(tmp_path.iterdir())


def test_names_of_maps_stay_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = 'a"\n[contact] # \x7f.npy'
    (tmp_path / name).parent.mkdir(exist_ok=True)
    np.save(tmp_path / name, np.random.default_rng(1).normal(size=(70, 70)).cumsum(0))
    assert cli.main(["scene", name, "--side", "70", "-o", "mine.toml"]) == 0
    assert [Path(each).name for each in load("mine.toml").surface.files] == [name]
    with pytest.raises(InputError, match="rename"):
        quoted("scan-\udcff.x3p")
