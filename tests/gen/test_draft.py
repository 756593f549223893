"""Scenes drafted for maps: they run as they are, and what they state of the maps is true."""

import math
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.made_maps import MAPS, Faults, measured, write
from gen import cli
from gen.database import Reader
from gen.draft import quoted, scene_like
from gen.draft import write as write_scene
from gen.draft.proposal import (
    SIZES,
    common_spacing,
    common_threshold,
    find_spikes,
    measure,
    propose_like,
    survey,
    window_nodes,
)
from gen.maps.prepare import despiked
from gen.maps.read import Topography
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.scene import load
from gen.schema import Status
from gen.spectral import SelfAffineSpectrum, generate_spectral

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
def scans(here):
    (here / "scans").mkdir()
    for made in SMALL:
        write(made, here / "scans")
    (here / "scans" / "notes.txt").write_text("Tuesday\n")
    return here / "scans"


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
    names = [Path(name).stem for name in surface.files]
    assert names == ["fractal-2", "ground-3", "honed-1", "sandblasted-0"]
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
    small, large = re.search(
        r"bring about ([\d.]+) to ([\d.]+) % of a middling", text
    ).groups()
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


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ("-o a.toml", "--like"),
        ("scans -o there.toml", "there already"),
        ("scans/notes.txt -o a.toml", "'Tuesday'"),
        ("scans --unit mile -o a.toml", "mile"),
    ],
)
def test_bad_command_lines_are_one_line_and_write_nothing(
    scans, refused, arguments, word
):
    (scans.parent / "there.toml").write_text("samples = 1\n")
    assert word in refused(cli, "scene", *arguments.split())
    assert {path.name for path in scans.parent.iterdir()} == {"scans", "there.toml"}
    assert (scans.parent / "there.toml").read_text() == "samples = 1\n"


@pytest.mark.usefixtures("here")
def test_a_draft_with_a_slipped_unit_says_so(capsys):
    np.save("map.npy", np.random.default_rng(0).normal(size=(40, 40)))
    options = ["--side", "40", "--hardness", "2000"]
    for young, told in (("210", True), ("210e3", False)):
        given = [*options, "--young", young, "-o", f"{young}.toml"]
        assert cli.main(["scene", "map.npy", *given]) == 0
        assert ("is the modulus in GPa?" in capsys.readouterr().err) == told


def test_names_of_maps_stay_names(here):
    name = 'a"\n[contact] # \x7f.npy'
    np.save(here / name, np.random.default_rng(1).normal(size=(70, 70)).cumsum(0))
    assert cli.main(["scene", name, "--side", "70", "-o", "mine.toml"]) == 0
    assert [Path(each).name for each in load("mine.toml").surface.files] == [name]
    with pytest.raises(InputError, match="rename"):
        quoted("scan-\udcff.x3p")


SHAPES = st.lists(
    st.tuples(st.integers(4, 2000), st.integers(4, 2000)), min_size=1, max_size=30
)


@pytest.mark.parametrize(
    ("spacings", "chosen"),
    [
        ([1.0, 1.0, 1.0004], None),
        ([1.0] * 20 + [2.0], 1.0),  # one of many maps does not coarsen all others
        ([1.0] * 3 + [2.0], 2.0),
        ([1.0, 1.0, 30.0], 1.0),  # another instrument altogether
    ],
)
def test_the_common_spacing(spacings, chosen):
    assert common_spacing([(each, each) for each in spacings]) == chosen


@given(SHAPES, st.floats(1.0, 1000.0) | st.just(math.nan))
def test_most_maps_hold_the_windows_and_twice_if_any_size_fits_twice(shapes, length):
    nodes = window_nodes(shapes, length)
    sides = [min(shape) for shape in shapes if min(shape) >= SIZES[-1]]
    twice = sum(side >= 2 * SIZES[-1] for side in sides) >= 0.75 * len(sides)
    assert (nodes is None) == (not sides)
    if nodes is None:
        return
    assert nodes in SIZES
    assert sum(side >= (1 + twice) * nodes for side in sides) >= 0.75 * len(sides)


def proposed(folder, spectrum):
    """What is proposed for a window of 400 nodes every 0.5 um of a larger surface, tilted."""
    random = np.random.default_rng(0)
    whole = generate_spectral((600, 600), 300.0, spectrum, random, rms_slope=0.1)
    np.save(folder / "scan.npy", whole[:400, :400] + 0.01 * np.arange(400))
    return propose_like(folder / "scan.npy", Reading(side="199.5"))


@pytest.mark.parametrize("hurst", [0.5, 0.8])
def test_the_scene_holds_the_law_that_the_map_was_made_by(tmp_path, hurst):
    like = proposed(tmp_path, SelfAffineSpectrum(hurst, 30.0, 2.5))
    text = scene_like(like, Bodies(1.0), "a command", Path("a.toml"))
    scene = write_scene(tmp_path / "a.toml", text)
    surface = scene.surface
    assert surface.generator == "spectral"
    assert surface.hurst[0] < hurst < surface.hurst[1]
    assert surface.roll_off[0] < 30.0 < surface.roll_off[1]
    assert surface.cut_off == pytest.approx(2.5, rel=0.1)
    assert surface.rms_slope[0] < 0.1 < surface.rms_slope[1]
    assert (scene.spacing[0], surface.stretch) == (pytest.approx(0.5), 1.0)
    assert scene.contact.boundary == "mirror"
    assert like.height == pytest.approx(like.windows[0], rel=0.25)
    assert like.slope == pytest.approx(0.1, rel=0.05)
    assert not like.doubt


def test_a_lay_becomes_a_stretch(tmp_path):
    like = proposed(tmp_path, SelfAffineSpectrum(0.7, 60.0, 4.2, stretch=0.25))
    assert like.spectrum.stretch == pytest.approx(0.25, rel=0.15)
    assert like.spectrum.hurst == pytest.approx(0.7, abs=0.1)
    assert like.spectrum.roll_off == pytest.approx(60.0, rel=0.3)
    assert like.height == pytest.approx(like.windows[0], rel=0.25)
    text = scene_like(like, Bodies(1.0), "a command", Path("a.toml"))
    write_scene(tmp_path / "a.toml", text)


def test_a_map_of_scratches_brings_a_doubt(tmp_path):
    like = propose_like(write(MADE["ground-2"], tmp_path), Reading())
    assert like.doubt
    scene = tmp_path / "a.toml"
    write_scene(scene, scene_like(like, Bodies(1.0), "a command", Path("a.toml")))
    assert "DOUBTFUL" in scene.read_text()


def test_a_law_over_less_than_a_decade_feeds_no_scene(tmp_path):
    with pytest.raises(
        InputError, match=r"no self-affine law fits it: .* over 0\.\d+ decades"
    ):
        propose_like(write(MADE["honed-0"], tmp_path), Reading())


@pytest.fixture
def saved(tmp_path):
    """Save heights as a text file, whose side is given, and look at it."""

    def look(heights, side="10"):
        path = tmp_path / "scan.txt"
        np.savetxt(path, heights)
        return survey([path], Reading(side=side))[0]

    return look


@pytest.mark.parametrize("name", ["turned-3", "ground-3", "honed-4"])
def test_a_made_map_is_seen_as_it_was_made(tmp_path, name):
    made = MADE[name]
    [look] = survey([write(made, tmp_path)], Reading())
    assert (look.fault, look.shape, look.unit != "") == ("", made.shape, True)
    assert look.spacing == pytest.approx(made.spacing)
    assert (look.missing > 0) == (made.faults.holes > 0)
    assert look.spikes is not None
    assert look.spikes.number == made.faults.spikes
    assert look.tilt == pytest.approx(made.faults.tilt, abs=3e-3)
    assert look.form < 0.9


def test_files_that_are_no_use_say_why(tmp_path):
    (tmp_path / "notes.txt").write_text("once upon a time")
    (tmp_path / "noise.x3p").write_bytes(b"PK no map")
    np.savetxt(tmp_path / "a.txt", np.random.default_rng(1).normal(size=(20, 20)))
    np.savetxt(tmp_path / "b.txt", np.random.default_rng(1).normal(size=(20, 20)))
    names = ["notes.txt", "noise.x3p", "a.txt", "b.txt", "none.txt"]
    looks = survey([tmp_path / name for name in names], Reading(side="10"))
    faults = [look.fault for look in looks]
    assert "number" in faults[0]
    assert faults[1]
    assert faults[2:4] == ["", "the same map as a.txt"]
    assert "No such file" in faults[4]
    assert not any(str(tmp_path) in fault for fault in faults)


def test_maps_without_heights_are_left_out(saved):
    rough = np.random.default_rng(2).normal(size=(20, 20))
    assert "missing" in saved(np.where(rough > -0.5, np.nan, rough)).fault
    assert saved(np.ones((20, 20))).fault == "all its heights are equal"
    assert saved(rough[:3, :3]).fault == "3 x 3 nodes are too few"
    flat = saved(1e-9 * rough)
    measure(flat, Reading(side="10"), None)
    assert "check the unit" in flat.fault


SOME = [made for made in MAPS if made.number in {2, 3}]


def test_the_threshold_takes_out_the_spikes_of_all_maps_and_nothing_else():
    maps = [measured(made) for made in SOME]
    threshold = common_threshold([find_spikes(heights) for heights in maps])
    assert threshold is not None
    for made, heights in zip(SOME, maps, strict=True):
        clear = despiked(Topography("map", heights, (1.0, 1.0)), threshold)
        moved = (clear.heights != heights) & ~np.isnan(heights)
        assert np.count_nonzero(moved) == made.faults.spikes


def test_many_spikes_and_those_that_no_gap_parts_are_found():
    random = np.random.default_rng(5)
    rough = random.normal(size=(200, 200))
    many = rough.copy()
    many.flat[random.choice(many.size, 300, replace=False)] += 40.0
    assert find_spikes(many).number == 300
    tail = rough.copy()
    tail.flat[random.choice(tail.size, 8, replace=False)] = 10.0 * 1.7 ** np.arange(8)
    assert find_spikes(tail).number >= 5
    assert find_spikes(rough).number == 0


def test_a_map_of_half_flat_parts_has_no_division_by_zero():
    heights = np.zeros((40, 40))
    heights[20:] = 1.0
    heights[5, 5] = 30.0
    assert find_spikes(heights).number == 1
