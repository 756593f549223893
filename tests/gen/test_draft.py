"""Scenes drafted for maps: they run as they are, and what they state of the maps is true."""

import re
import shlex
import shutil
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from bench.made_maps import MAPS, Faults, measured, write
from gen import cli
from gen.database import Reader
from gen.maps.needs import find_spikes
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


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """A folder of maps, and a file that is none."""
    folder = tmp_path_factory.mktemp("maps")
    for made in SMALL:
        write(made, folder)
    (folder / "notes.txt").write_text("Tuesday\n")
    return folder


@pytest.fixture
def scans(here, maps):
    """The folder of maps as the folder `scans` of the one in which the test works."""
    shutil.copytree(maps, here / "scans")
    return here / "scans"


class Drafted:
    """A scene drafted for the maps, and what the command printed."""

    def __init__(self, folder, printed):
        self.folder = folder
        self.printed = printed
        self.text = (folder / "mine.toml").read_text()
        self.scene = load(str(folder / "mine.toml"))


@pytest.fixture(scope="module")
def drafted(maps, tmp_path_factory):
    """A scene of bodies that yield, drafted for all maps."""
    folder = tmp_path_factory.mktemp("drafted")
    shutil.copytree(maps, folder / "scans")
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as printed:
        patch.chdir(folder)
        assert cli.main(["scene", "scans", "-o", "mine.toml", *STEEL]) == 0
        return Drafted(folder, printed.getvalue())


@pytest.mark.parametrize("made", SMALL, ids=lambda made: made.name)
def test_the_table_and_the_scene_name_every_map(drafted, made):
    assert made.name in drafted.printed
    assert made.name in drafted.text


def test_a_folder_of_maps_becomes_a_scene_of_their_windows(drafted):
    surface = drafted.scene.surface
    assert surface.generator == "scans"
    assert (surface.nodes, surface.spacing) == (64, 1.0)
    names = [Path(name).stem for name in surface.files]
    assert names == ["fractal-2", "ground-3", "honed-1", "sandblasted-0"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("fractal-0", "hold no window of 64 x 64"),
        ("turned-4", "a node every 2 um"),
        ("notes", "'Tuesday' is not a number"),
    ],
)
def test_comments_say_why_a_map_is_left_out(drafted, name, reason):
    comment = rf'# "scans/{name}\.\w+" is left out: .*{re.escape(reason)}'
    assert re.search(comment, drafted.text)


def test_the_preparation_follows_from_spikes_and_holes(drafted):
    steps = drafted.scene.surface.preparation
    spikes = sum(find_spikes(measured(made)).number for made in SMALL[:2])
    assert spikes >= 29  # of 31: holes may swallow some
    assert (steps.level, steps.fill) == ("plane", True)
    assert f"2 of 4 maps have spikes, {spikes} nodes in all" in drafted.text
    assert "2 of 4 maps have holes" in drafted.text


def test_the_loads_bring_the_stated_areas_into_contact(drafted):
    contact = drafted.scene.contact
    assert (contact.boundary, contact.hardness) == ("mirror", 2000.0)
    stated = re.search(r"bring about ([\d.]+) to ([\d.]+) % of a middling", drafted.text)
    small, large = map(float, stated.groups())
    database = drafted.folder / "mine.h5"
    line = ["run", str(drafted.folder / "mine.toml"), "-o", str(database)]
    assert cli.main([*line, "--rows", "0:60"]) == 0
    with Reader(database) as reader:
        assert reader.counts().done == 60
        done = reader.column("status") == Status.DONE
        areas, loads = (reader.column(name)[done] for name in ("area_percent", "load"))
    order = np.argsort(loads)
    assert np.median(areas[order[:8]]) < 3 * small
    assert 0.5 * large < areas[order[-1]] < 1.5 * large


@pytest.mark.usefixtures("scans")
def test_the_command_in_the_scene_writes_the_same_scene(here):
    assert cli.main(["scene", "scans", "-o", "mine.toml", *STEEL]) == 0
    text = (here / "mine.toml").read_text()
    (here / "mine.toml").rename(here / "kept.toml")
    [line] = [line for line in text.splitlines() if " -m gen scene " in line]
    assert cli.main(shlex.split(line)[4:]) == 0
    assert (here / "mine.toml").read_text() == text


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


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ("-o a.toml", "--like"),
        ("scans -o there.toml", "there already"),
        ("scans/notes.txt -o a.toml", "'Tuesday'"),
        ("scans --unit mile -o a.toml", "mile"),
    ],
)
@pytest.mark.usefixtures("scans")
def test_bad_command_lines_are_one_line_and_write_nothing(here, refused, arguments, word):
    (here / "there.toml").write_text("samples = 1\n")
    assert word in refused(cli, "scene", *arguments.split())
    assert {path.name for path in here.iterdir()} == {"scans", "there.toml"}
    assert (here / "there.toml").read_text() == "samples = 1\n"


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("young", "is_doubted"), [("210", True), ("210e3", False)])
def test_a_draft_with_a_slipped_unit_says_so(capsys, young, is_doubted):
    np.save("map.npy", np.random.default_rng(0).normal(size=(40, 40)))
    options = ["--side", "40", "--hardness", "2000", "--young", young, "-o", "a.toml"]
    assert cli.main(["scene", "map.npy", *options]) == 0
    assert ("is the modulus in GPa?" in capsys.readouterr().err) == is_doubted


def test_names_of_maps_stay_names(here):
    name = 'a"\n[contact] # \x7f.npy'
    np.save(here / name, np.random.default_rng(1).normal(size=(70, 70)).cumsum(0))
    assert cli.main(["scene", name, "--side", "70", "-o", "mine.toml"]) == 0
    assert [Path(file).name for file in load("mine.toml").surface.files] == [name]
