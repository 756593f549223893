"""The maps of a scene: found by name and content, prepared once, shared, refused if unfit."""

import hashlib
import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.made_maps import Faults, MadeMap, write_all
from gen.maps import library
from gen.maps.library import (
    DRAWS,
    PAGE,
    PreparedMap,
    Recipe,
    Tiling,
    Window,
    cut_window,
    draw_window,
    hashes_of_maps,
    map_files,
    open_maps,
    prepared_maps,
    write_maps,
)
from gen.maps.settings import Reading
from gen.runtime.errors import InputError

CLEAN = Reading(despike=7.0, level="plane", fill=True)
SMALL = (
    MadeMap("honed", 0, (40, 30), 0.5, 10.0, faults=Faults(spikes=2, holes=2)),
    MadeMap(
        "ground", 0, (36, 44), 0.5, 10.0, format="nc", faults=Faults(tilt=(0.1, 0.0))
    ),
    MadeMap("fractal", 0, (33, 33), 0.5, 10.0, format="gwy"),
)


@pytest.fixture
def paths(tmp_path):
    return write_all(tmp_path / "scans", SMALL)


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    monkeypatch.setattr("tempfile.tempdir", None)
    for name in ("temporary", "home"):
        (tmp_path / name).mkdir()
    return tmp_path / "home"


CLEANED = Recipe((9, 9), None, CLEAN)


def made(paths, home, wanted=CLEANED):
    return prepared_maps(paths, hashes_of_maps(paths), wanted, home)


def test_maps_are_prepared_once(paths, home, monkeypatch):
    first = made(paths, home)
    (file,) = home.iterdir()
    monkeypatch.setattr(
        library, "read", lambda *_, **__: pytest.fail("a map is read again")
    )
    for again in (
        made(paths, home),
        open_maps(hashes_of_maps(paths), CLEANED, home, verify=False),
    ):
        for one, other in zip(first.maps, again.maps, strict=True):
            assert np.array_equal(one.heights, other.heights)
    assert list(home.iterdir()) == [file]
    assert made(paths, home, Recipe((30, 30), None, CLEAN)).shapes == first.shapes


@pytest.mark.parametrize("place", [PAGE, -1])
def test_a_damaged_file_is_made_anew(paths, home, place):
    whole = made(paths, home).maps[0].heights.copy()
    (file,) = home.iterdir()
    content = bytearray(file.read_bytes())
    content[place] ^= 1
    file.write_bytes(content)
    assert np.array_equal(made(paths, home).maps[0].heights, whole)
    assert file.read_bytes() != bytes(content)
    file.write_bytes(content[: len(content) // 2])
    assert open_maps(hashes_of_maps(paths), CLEANED, home, verify=False) is None


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_a_pipe_or_a_folder_in_the_place_of_prepared_maps_is_refused(paths, home, make):
    made(paths, home)
    (file,) = home.iterdir()
    file.unlink()
    make(file)
    with pytest.raises(InputError, match=r"\.maps: is (no regular file|a folder)"):
        made(paths, home)
    assert file.exists()


def test_a_temporary_folder_of_somebody_else_is_not_used(
    paths, home, tmp_path, monkeypatch
):
    monkeypatch.setattr(os, "access", lambda folder, mode: folder != home)
    folder = tmp_path / "temporary" / f"asperity-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.raises(
        InputError, match=r"there is no folder for prepared maps: .* TMPDIR"
    ):
        made(paths, home)


def test_spacings_have_to_agree(tmp_path, home):
    other = MadeMap("fractal", 1, (60, 60), 0.5, 20.0, (0.5, 0.5))
    paths = write_all(tmp_path / "scans", (SMALL[2], other))
    with pytest.raises(InputError) as refusal:
        made(paths, home)
    assert str(refusal.value) == (
        f"{paths[1]} has a node every 0.5 um, {paths[0]} every 1 um: give spacing, to which all"
        " are resampled, or downsample"
    )
    assert not list(home.iterdir())
    found = made(paths, home, Recipe((9, 9), (1.0, 1.0), CLEAN))
    assert found.shapes == ((33, 33), (29, 29))


def test_a_map_smaller_than_the_window_is_refused(paths, home):
    message = "honed-0.x3p: has 40 x 30 nodes after its preparation, less than the window of 33 x"
    with pytest.raises(InputError, match=message):
        made(paths, home, Recipe((33, 33), None, CLEAN))
    made(paths, home)
    with pytest.raises(
        InputError, match=message
    ):  # also where the maps are prepared already
        made(paths, home, Recipe((33, 33), None, CLEAN))


MAPS = [
    PreparedMap(
        np.random.default_rng(1).normal(size=(30, 41)), (0.5, 0.5), ("a remark",)
    ),
    PreparedMap(np.asfortranarray(np.arange(12.0).reshape(3, 4)), (0.5, 0.5)),
]


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "a.maps"
    write_maps(path, "key", iter(MAPS), replace=False)
    return path


def test_a_file_that_another_process_made_meanwhile_stays(path):
    before = path.stat().st_ino
    write_maps(path, "key", iter(MAPS), replace=False)
    assert path.stat().st_ino == before, "others may have it in their memory"
    write_maps(path, "key", iter(MAPS), replace=True)
    assert path.stat().st_ino != before
    assert [each.name for each in path.parent.iterdir()] == [path.name]


@pytest.fixture
def folder(tmp_path):
    maps = tmp_path / "scans"
    (maps / "deep").mkdir(parents=True)
    for name in ("b.x3p", "a.x3p", "c.nc", ".hidden", "notes.md", "deep/d.x3p"):
        (maps / name).write_text(name)
    return tmp_path


@pytest.mark.parametrize(
    ("patterns", "names"),
    [
        (["scans"], "a.x3p b.x3p c.nc"),
        (["scans/*.x3p"], "a.x3p b.x3p"),
        (["scans/**/*.x3p"], "a.x3p b.x3p deep/d.x3p"),
        (["scans/c.nc", "scans"], "c.nc a.x3p b.x3p"),
    ],
)
def test_files_folders_and_patterns(folder, patterns, names):
    expected = [folder / "scans" / name for name in names.split()]
    assert map_files(patterns, folder) == expected
    absolute = [str(folder / pattern) for pattern in patterns]
    assert map_files(absolute, folder / "elsewhere") == expected


@pytest.mark.parametrize("pattern", ["none", "scans/*.sur", "a\0b"])
def test_names_without_a_file_are_refused_in_one_line(folder, pattern):
    with pytest.raises(InputError, match=r"^.*: no file or folder is called so in .*$"):
        map_files([pattern], folder)


def test_content_names_a_map_and_no_two_are_alike(folder):
    paths = map_files(["scans"], folder)
    assert hashes_of_maps(paths) == [
        hashlib.sha256(path.name.encode()).hexdigest() for path in paths
    ]
    (folder / "scans" / "z.x3p").write_text("a.x3p")
    with pytest.raises(InputError, match=r"z\.x3p and .*a\.x3p are the same map"):
        hashes_of_maps(map_files(["scans"], folder))


windows = st.tuples(st.integers(2, 12), st.integers(2, 12))


@st.composite
def tilings(draw):
    """Tilings of up to four maps, each as large as the window at least."""
    window = draw(windows)
    maps = draw(
        st.lists(
            st.tuples(st.integers(0, 50), st.integers(0, 50)), min_size=1, max_size=4
        )
    )
    return Tiling(tuple((window[0] + x, window[1] + y) for x, y in maps), window)


@given(tilings())
def test_tiles_cover_each_map_once_and_hold_a_window(tiling):
    for index, shape in enumerate(tiling.shapes):
        covered = np.zeros(shape, dtype=int)
        for tile in tiling.tiles[index]:
            assert tile.x.nodes >= tiling.window[0]
            assert tile.y.nodes >= tiling.window[1]
            covered[tile.x.start : tile.x.stop, tile.y.start : tile.y.stop] += 1
        assert (covered == 1).all()


@pytest.mark.parametrize(
    ("nodes", "window", "tiles"),
    [
        (129, 129, 1),
        (257, 129, 1),
        (258, 129, 2),
        (515, 129, 2),
        (516, 129, 2),
        (774, 129, 3),
    ],
)
def test_tiles_are_twice_as_wide_as_the_window_where_two_of_them_fit(
    nodes, window, tiles
):
    assert Tiling(((nodes, nodes),), (window, window)).total == tiles**2


def stream(seed, surface):
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(surface,)))
    )


@given(tilings(), st.integers(0, 2**63 - 1), st.booleans())
def test_a_window_lies_in_its_tile(tiling, seed, square):
    tiling = replace(tiling, square=square)
    window = draw_window(stream(seed, 3), tiling)
    assert window == draw_window(stream(seed, 3), tiling)
    tile = tiling.tiles[window.map][window.tile - tiling.starts[window.map]]
    spans = (tile.x, tile.y)
    for corner, nodes, span in zip(window.corner, tiling.window, spans, strict=True):
        assert span.start <= corner <= corner + nodes <= span.stop
    assert 0 <= window.symmetry < (8 if square else 4)


def test_maps_tiles_places_and_symmetries_are_uniform():
    """Counts of 20,000 draws within four standard deviations."""
    tiling = Tiling(((8, 8), (21, 10)), (5, 5), square=True)
    random = np.random.default_rng(5)
    draws = [draw_window(random, tiling) for _ in range(20_000)]

    def check(values, share):
        _, counts = np.unique(values, return_counts=True, axis=0)
        assert counts.size == round(1 / share)
        expected = len(values) * share
        assert np.abs(counts - expected).max() < 4 * np.sqrt(expected)

    check([each.map for each in draws], 1 / 2)
    check([each.symmetry for each in draws], 1 / 8)
    check([each.corner for each in draws if each.map == 0], 1 / 16)
    wide = [each for each in draws if each.map == 1]
    check([each.tile for each in wide], 1 / 4)
    first = [each.corner for each in wide if each.tile == 1]
    check(first, 1 / 6)  # 10 x 5 nodes


def test_a_window_takes_as_many_numbers_as_it_says():
    one, other = np.random.default_rng(1), np.random.default_rng(1)
    draw_window(one, Tiling(((9, 9),), (3, 3), square=True))
    other.random(DRAWS)
    assert one.random() == other.random()


def test_the_eight_symmetries_are_those_of_the_square():
    """Of the map's own heights there, above their lowest."""
    heights = np.arange(30.0).reshape(5, 6) ** 2
    patch = heights[1:4, 2:5] - heights[1, 2]
    windows = (Window(0, 0, (1, 2), symmetry) for symmetry in range(8))
    made = {cut_window(heights, window, (3, 3)).tobytes() for window in windows}
    known = {np.rot90(side, k).tobytes() for k in range(4) for side in (patch, patch.T)}
    assert made == known
    assert len(made) == 8
