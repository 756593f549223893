"""Tests of windows of maps as a scene's surfaces, from the files to the rows of a database."""

import contextlib
import io
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

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


@dataclass(frozen=True)
class Run:
    """A folder with a scene, its maps and the database `a.h5` of a run."""

    folder: Path
    messages: str  # what the run said on standard error

    @property
    def database(self):
        return self.folder / "a.h5"

    def copy(self):
        """Return a copy of the database, to be extended."""
        return shutil.copy(self.database, self.folder / "copy.h5")


def fill(folder, monkeypatch):
    """Write a scene and its maps, and keep prepared maps of other tests away."""
    (folder / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(folder / "temporary"))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setattr(scans, "_OPEN", {})
    write_all(folder / "maps", MAPS)
    write_scene(folder)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a scene, its maps in another one, and prepared maps of no other test."""
    fill(tmp_path, monkeypatch)
    return tmp_path


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A database of one body."""
    folder = tmp_path_factory.mktemp("run")
    with pytest.MonkeyPatch.context() as monkeypatch:
        fill(folder, monkeypatch)
        yield made_run(folder)


def made_run(folder):
    """Run the scene of a folder."""
    messages = io.StringIO()
    with contextlib.redirect_stderr(messages):
        assert run("run", folder / "s.toml", "-o", folder / "a.h5") == 0
    return Run(folder, messages.getvalue())


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


def test_a_run_says_what_its_maps_are(made):
    words = "3 maps with a node every 1 um, 12 tiles; they are kept prepared in"
    assert words in made.messages


def test_rows_of_maps_are_computed_again(made):
    assert run("check", made.database, "--recompute", 6) == 0


def test_windows_of_a_database_are_mirrored(made):
    with Reader(made.database) as reader:
        assert reader.scene.contact.boundary == "mirror"


def test_a_database_names_its_maps(made, capsys):
    assert run("info", made.database) == 0
    assert "map 2: 36 x 64 nodes, SHA-256" in capsys.readouterr().out


def test_a_database_is_extended_by_windows_of_the_same_prepared_maps(made):
    database = made.copy()
    write_scene(made.folder, samples=44, name="longer.toml")
    assert run("run", made.folder / "longer.toml", "-o", database) == 0
    assert len(list(made.folder.glob("*.maps"))) == 1
    assert run("check", database, "--recompute", 44) == 0
    with Reader(database) as reader:
        assert reader.counts().done == 44


@pytest.fixture
def turned(made):
    """The file of a map of the database, which tests may change or delete."""
    path = made.folder / "maps" / "turned-0.nc"
    content = path.read_bytes()
    yield path
    path.write_bytes(content)


def test_a_check_needs_the_maps(made, turned, refused):
    turned.unlink()
    message = refused(cli, "check", made.database, "--recompute", 3)
    assert f"{turned}: the map is gone that the database was made of" in message


def test_a_check_refuses_changed_maps(made, turned, refused):
    turned.write_bytes(turned.read_bytes() + b"\0")
    message = refused(cli, "check", made.database, "--recompute", 3)
    assert "is not the map that the database was made of" in message


def test_a_check_takes_maps_that_lie_beside_the_database(made, turned):
    beside = made.folder / turned.name
    turned.rename(beside)
    try:
        assert run("check", made.database, "--recompute", 3) == 0
    finally:
        beside.unlink()


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


@pytest.fixture(scope="module")
def two_bodies(tmp_path_factory):
    """A database of two bodies with maps of their own."""
    folder = tmp_path_factory.mktemp("two")
    with pytest.MonkeyPatch.context() as monkeypatch:
        fill(folder, monkeypatch)
        write_all(folder / "second", SECOND)
        write_scene(folder, keys='against = "second"')
        yield made_run(folder)


def test_a_run_says_what_the_maps_of_both_bodies_are(two_bodies):
    words = "body 1: 3 maps with a node every 1 um, 12 tiles"
    assert words in two_bodies.messages
    assert "body 2: 2 maps with a node every 1 um" in two_bodies.messages
    assert len(list(two_bodies.folder.glob("*.maps"))) == 2


def test_rows_of_two_bodies_are_computed_again(two_bodies):
    assert run("check", two_bodies.database, "--recompute", 30) == 0


def test_a_database_names_the_maps_of_its_second_body(two_bodies, capsys):
    assert run("info", two_bodies.database) == 0
    words = "the second body's map 1: 70 x 34 nodes, SHA-256"
    assert words in capsys.readouterr().out


@pytest.fixture
def moved(two_bodies):
    """The maps of the second body in another folder, and none of them open."""
    place = two_bodies.folder / "moved"
    scans._OPEN.clear()
    (two_bodies.folder / "second").rename(place)
    yield place
    place.rename(two_bodies.folder / "second")


def test_a_database_is_extended_by_maps_of_a_second_body_that_were_moved(
    two_bodies, moved
):
    database = two_bodies.copy()
    keys = f'against = "{moved.name}"'
    write_scene(two_bodies.folder, samples=40, keys=keys, name="moved.toml")
    assert run("run", two_bodies.folder / "moved.toml", "-o", database) == 0
    with Reader(database) as reader:
        assert reader.counts().done == 40


def test_a_database_of_two_bodies_is_not_extended_by_one(two_bodies, refused):
    write_scene(two_bodies.folder, samples=40, name="one.toml")
    scene = two_bodies.folder / "one.toml"
    message = refused(cli, "run", scene, "-o", two_bodies.copy())
    assert "surface.against" in message


def test_a_check_needs_the_maps_of_the_second_body(two_bodies, moved, refused):
    message = refused(cli, "check", two_bodies.database, "--recompute", 3)
    assert "ground-3.x3p: the map is gone" in message


def test_a_map_of_both_bodies_is_refused(second):
    write_scene(second, keys='against = ["second", "maps/turned-0.nc"]')
    with pytest.raises(InputError, match="is one of files and of against"):
        scene_of(second)


@pytest.fixture
def coarse(second):
    """A folder whose second body has nodes that are twice as far apart."""
    write_all(second / "coarse", [MadeMap("honed", 7, (40, 40), 0.5, 15.0, (2.0, 2.0))])
    return second


def test_two_bodies_with_different_spacings_are_refused(coarse):
    write_scene(coarse, keys='against = "coarse"')
    with pytest.raises(InputError, match="every 1 x 1 and 2 x 2 um: give"):
        scene_of(coarse)


def test_two_bodies_are_resampled_to_the_spacing_of_the_scene(coarse):
    write_scene(coarse, keys='against = "coarse"\nspacing = 1.5')
    assert scene_of(coarse).surface.against_found.spacing == (1.5, 1.5)


def test_a_second_body_without_maps_is_refused(second):
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


def test_windows_are_mirrored_by_default():
    assert parsed().contact.boundary == "mirror"
    assert parsed(more="[contact]\nmodulus = 7.0\n").contact.boundary == "mirror"
    assert Scene.parse("samples = 1", "a").contact.boundary == "free"


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
def test_the_boundary_of_windows_is_that_of_the_scene(boundary):
    scene = parsed(more=f"[contact]\nboundary = '{boundary}'\n")
    assert scene.contact.boundary == boundary
    again = Scene.from_text(scene.text())
    assert again == scene
    assert again.fingerprint() == scene.fingerprint()


def test_moved_maps_are_the_same_scene():
    moved = with_maps(parsed('"elsewhere"'), folder="/there")
    assert moved.fingerprint() == with_maps(parsed()).fingerprint()


def test_changed_maps_are_another_scene():
    changed = with_maps(parsed(), sha256s=("a" * 64, "c" * 64))
    (difference,) = differences(with_maps(parsed()), changed)
    old = f"'{'b' * 64}, 90 x 81'"
    new = f"'{'c' * 64}, 90 x 81'"
    assert difference == f"surface.found.maps[1]: {old} in the file, {new} asked for"


def test_fewer_maps_are_another_scene():
    fewer = with_maps(parsed(), sha256s=("a" * 64,))
    (difference, *_) = differences(with_maps(parsed()), fewer)
    assert difference == "surface.found.number: 2 in the file, 1 asked for"


def test_maps_with_another_spacing_are_another_scene():
    coarser = with_maps(parsed(), spacing=(1.0, 1.0))
    assert coarser.fingerprint() != with_maps(parsed()).fingerprint()


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
