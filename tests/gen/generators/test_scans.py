"""Tests of windows of maps as a scene's surfaces, from the files to the rows of a database."""

import re

import numpy as np
import pytest

from bench.made_maps import Faults, MadeMap, write_all
from gen import cli
from gen.database import Reader
from gen.generation.plan import parameters, surface_random
from gen.generation.sample import surface_of
from gen.generators import scans
from gen.generators.scans import RecordedMap, RecordedMaps, ScanSurface
from gen.maps.library import Tiling, cut_window, draw_window
from gen.maps.prepare import prepare
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.scene import Scene, differences, load
from tests.maps import read

MAPS = (
    MadeMap("honed", 0, (60, 41), 0.5, 15.0, faults=Faults(spikes=2, holes=2)),
    MadeMap(
        "turned", 0, (36, 64), 1.0, 20.0, format="nc", faults=Faults(tilt=(0.02, 0.0))
    ),
    MadeMap("fractal", 0, (40, 40), 0.5, 15.0, format="gwy"),
)
SCENE = """samples = {samples}
samples_per_surface = 2
[surface]
generator = "scans"
files = "maps"
nodes = {nodes}
{keys}
[surface.preparation]
despike = 7
level = "plane"
fill = true
[load]
quantity = "pressure/(E* slope_rms)"
range = [0.005, 0.05]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a scene, its maps in another one, and prepared maps of no other test."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setattr(scans, "_OPEN", {})
    write_all(tmp_path / "maps", MAPS)
    write_scene(tmp_path)
    return tmp_path


def write_scene(folder, samples=30, nodes="16", keys="", name="s.toml"):
    (folder / name).write_text(SCENE.format(samples=samples, nodes=nodes, keys=keys))


def scene_of(folder, name="s.toml"):
    return load(str(folder / name)).resolved(folder)


def run(*arguments):
    return cli.main([str(each) for each in arguments])


@pytest.mark.parametrize(("nodes", "symmetries"), [("16", 8), ("[16, 12]", 4)])
def test_a_surface_is_a_window_of_a_prepared_map(folder, nodes, symmetries):
    write_scene(folder, nodes=nodes, samples=120)
    scene = scene_of(folder)
    plan = parameters(scene, 0, scene.samples)
    asked = Reading(despike=7.0, level="plane", fill=True)
    files = sorted((folder / "maps").iterdir())
    maps = [prepare(read(path), asked).heights for path in files]
    assert scene.spacing == pytest.approx((1.0, 1.0), rel=1e-12)
    tiling = Tiling(
        tuple(each.shape for each in maps), scene.shape, square=symmetries == 8
    )
    seen = set()
    for row in range(0, scene.samples, 2):
        window = draw_window(surface_random(scene, row // 2), tiling)
        assert (plan.places["map"][row], plan.places["tile"][row]) == (
            window.map,
            window.tile,
        )
        own = cut_window(maps[window.map], window, scene.shape)
        assert np.array_equal(surface_of(scene, plan, row), own)
        seen.add(window.symmetry)
    assert seen == set(range(symmetries))


def test_a_run_is_checked_extended_and_resumed(folder, capsys):
    assert run("run", folder / "s.toml", "-o", folder / "a.h5") == 0
    said = capsys.readouterr()
    assert (
        "3 maps with a node every 1 um, 12 tiles; they are kept prepared in" in said.err
    )
    assert run("check", folder / "a.h5", "--recompute", 6) == 0
    write_scene(folder, samples=44)
    assert run("run", folder / "s.toml", "-o", folder / "a.h5") == 0
    assert len(list(folder.glob("*.maps"))) == 1
    assert run("check", folder / "a.h5", "--recompute", 44) == 0
    with Reader(folder / "a.h5") as reader:
        assert reader.counts().done == 44
        assert reader.scene.contact.boundary == "mirror"
    assert run("info", folder / "a.h5") == 0
    assert "map 2: 36 x 64 nodes, SHA-256" in capsys.readouterr().out


def test_a_check_needs_the_maps_themselves(folder, refused):
    run("run", folder / "s.toml", "-o", folder / "a.h5")
    path = folder / "maps" / "turned-0.nc"
    content = path.read_bytes()
    path.unlink()
    line = ["check", folder / "a.h5", "--recompute", 3]
    assert f"{path}: the map is gone that the database was made of" in refused(cli, *line)
    path.write_bytes(content + b"\0")
    assert "is not the map that the database was made of" in refused(cli, *line)
    path.unlink()
    (folder / "turned-0.nc").write_bytes(content)  # beside the database
    assert run(*line) == 0


SECOND = (
    MadeMap("ground", 3, (50, 50), 0.5, 15.0),
    MadeMap("sandblasted", 4, (70, 34), 0.5, 15.0, format="gwy"),
)
"""Maps of a second body: 4 + 4 tiles of 16 x 16 nodes or more; those of the first have 12."""


@pytest.fixture
def second(folder):
    write_all(folder / "second", SECOND)
    return folder


def nodes_of(window, shape):
    """The nodes (map, x, y) of a window."""
    (x, y), (nx, ny) = window.corner, shape
    return {(window.map, i, j) for i in range(x, x + nx) for j in range(y, y + ny)}


@pytest.mark.parametrize(
    "against", ['"another"', '"second"', '["second/*.x3p", "second/*.gwy"]']
)
def test_a_second_body_is_a_window_of_its_group_of_tiles(second, monkeypatch, against):
    write_scene(second, samples=400, keys=f"against = {against}")
    scene = scene_of(second)
    first = scene.model_copy(update={"surface": scene.surface.first_body()})
    windows = []
    cut_out = ScanSurface._cut

    def watched(made, window):
        windows.append(window)
        return cut_out(made, window)

    monkeypatch.setattr(ScanSurface, "_cut", watched)
    plan = parameters(scene, 0, scene.samples)
    groups: dict[tuple, int] = {}
    for row in range(0, scene.samples, 2):
        windows.clear()
        whole = surface_of(scene, plan, row)
        assert whole.shape == (16, 16)
        assert whole.min() == 0
        one, other = windows
        assert plan.places["map"][row] == one.map
        bodies = (0, 0) if "another" in against else (0, 1)
        for body, window in zip(bodies, (one, other), strict=True):
            for node in nodes_of(window, (16, 16)):
                group = groups.setdefault((body, *node), plan.places["tile"][row])
                assert group == plan.places["tile"][row], "parts of a split share a node"
        alone = surface_of(first, parameters(first, row, row + 1), 0)
        opposite = cut_out(scene.surface.second_body(), other)
        np.testing.assert_allclose(
            whole, alone + opposite - (alone + opposite).min(), atol=1e-12
        )
    tiles = (
        12
        if "another" in against
        else min(12, scene.surface.second_body()._tiling().total)
    )
    assert set(plan.places["tile"]) == set(range(tiles))


@pytest.mark.long
def test_a_run_with_two_sets_of_maps_is_checked_and_told(second, capsys, refused):
    write_scene(second, keys='against = "second"')
    assert run("run", second / "s.toml", "-o", second / "a.h5") == 0
    said = capsys.readouterr().err
    assert "body 1: 3 maps with a node every 1 um, 12 tiles" in said
    assert "body 2: 2 maps with a node every 1 um" in said
    assert len(list(second.glob("*.maps"))) == 2
    assert run("check", second / "a.h5", "--recompute", 30) == 0
    assert run("info", second / "a.h5") == 0
    assert "the second body's map 1: 70 x 34 nodes, SHA-256" in capsys.readouterr().out
    scans._OPEN.clear()
    (second / "second").rename(second / "moved")
    write_scene(second, samples=40, keys='against = "moved"')
    assert run("run", second / "s.toml", "-o", second / "a.h5") == 0
    with Reader(second / "a.h5") as reader:
        assert reader.counts().done == 40
    write_scene(second, samples=40)
    said = refused(cli, "run", second / "s.toml", "-o", second / "a.h5")
    assert "surface.against" in said
    (second / "moved" / "ground-3.x3p").unlink()
    said = refused(cli, "check", second / "a.h5", "--recompute", 3)
    assert "ground-3.x3p: the map is gone" in said


def test_maps_of_two_bodies_that_do_not_go_together_are_refused(second):
    write_scene(second, keys='against = ["second", "maps/turned-0.nc"]')
    with pytest.raises(InputError, match="is one of files and of against"):
        scene_of(second)
    write_all(second / "coarse", [MadeMap("honed", 7, (40, 40), 0.5, 15.0, (2.0, 2.0))])
    write_scene(second, keys='against = "coarse"')
    with pytest.raises(InputError, match="every 1 x 1 and 2 x 2 um: give"):
        scene_of(second)
    write_scene(second, keys='against = "coarse"\nspacing = 1.5')
    assert scene_of(second).surface.against_found.spacing == (1.5, 1.5)
    write_scene(second, keys='against = "none"')
    with pytest.raises(InputError, match="none"):
        scene_of(second)


def parsed(files='"maps"', more=""):
    text = SCENE.format(samples=10, nodes="[20, 30]", keys="").replace('"maps"', files)
    return Scene.parse(text + more, "a.toml")


def with_maps(made, *, folder="/here", spacing=(0.5, 0.5), sha256s=("a" * 64, "b" * 64)):
    maps = tuple(
        RecordedMap(file=f"{folder}/{n}", sha256=each, nodes=(90, 80 + n))
        for n, each in enumerate(sha256s)
    )
    found = RecordedMaps(spacing=spacing, maps=maps)
    return made.model_copy(
        update={"surface": made.surface.model_copy(update={"found": found})}
    )


def test_windows_are_mirrored_unless_the_scene_says_otherwise():
    assert parsed().contact.boundary == "mirror"
    assert parsed(more="[contact]\nmodulus = 7.0\n").contact.boundary == "mirror"
    for boundary in ("free", "periodic", "mirror"):
        given = parsed(more=f"[contact]\nboundary = '{boundary}'\n")
        assert given.contact.boundary == boundary
        again = Scene.from_text(given.text())
        assert again == given
        assert again.fingerprint() == given.fingerprint()
    assert Scene.parse("samples = 1", "a").contact.boundary == "free"


def test_moved_maps_are_the_same_scene_and_changed_ones_another():
    made = with_maps(parsed())
    assert (
        with_maps(parsed('"elsewhere"'), folder="/there").fingerprint()
        == made.fingerprint()
    )
    changed = with_maps(parsed(), sha256s=("a" * 64, "c" * 64))
    (difference,) = differences(made, changed)
    old, new = f"'{'b' * 64}, 90 x 81'", f"'{'c' * 64}, 90 x 81'"
    assert difference == f"surface.found.maps[1]: {old} in the file, {new} asked for"
    (fewer, *_) = differences(made, with_maps(parsed(), sha256s=("a" * 64,)))
    assert fewer == "surface.found.number: 2 in the file, 1 asked for"
    coarser = with_maps(parsed(), spacing=(1.0, 1.0))
    assert coarser.fingerprint() != made.fingerprint()


def test_files_start_from_the_folder_of_the_scene(tmp_path):
    text = SCENE.format(samples=10, nodes="9", keys="")
    (tmp_path / "a.toml").write_text(
        text.replace('"maps"', '["maps", "/abs/*.x3p", "~/b.nc"]')
    )
    found = load(str(tmp_path / "a.toml")).surface.files
    assert found == (f"{tmp_path}/maps", "/abs/*.x3p", "~/b.nc")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('files = "maps"\n', "", "surface.files is missing; allowed: a file"),
        ("nodes", "against = []\nnodes", "surface.against"),
        (
            "level",
            "form = 1.5\nlevel",
            "surface.preparation.form = 1.5; allowed: the degree",
        ),
        (
            "[load]",
            "[surface.reading]\nside = [9, true]\n[load]",
            "side = [9, True]; allowed: the",
        ),
    ],
)
def test_faults_are_one_line(old, new, message):
    text = SCENE.format(samples=10, nodes="[20, 30]", keys="")
    with pytest.raises(InputError, match=rf"^.*{re.escape(message)}.*$"):
        Scene.parse(text.replace(old, new, 1), "a.toml")
