"""Tests of the files of maps: how they are named, known and found again."""

import hashlib

import pytest

from gen.maps.files import digests, located, map_files
from gen.runtime.errors import InputError


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
        (["scans/[bc].*"], "b.x3p c.nc"),
        (["./scans/../scans/a.x3p"], "a.x3p"),
    ],
)
def test_files_folders_and_patterns(folder, patterns, names):
    expected = [folder / "scans" / name for name in names.split()]
    assert map_files(patterns, folder) == expected
    absolute = [str(folder / pattern) for pattern in patterns]
    assert map_files(absolute, folder / "elsewhere") == expected


@pytest.mark.parametrize(
    ("pattern", "message"),
    [
        ("none", "there is no file or folder"),
        ("scans/*.sur", "no file in .* is called so"),
        ("empty", "the folder .* holds no map"),
        ("a\0b", r"there is no file or folder .*a\\x00b"),
        ("x" * 5000, "File name too long|no file"),
    ],
)
def test_names_without_a_file_are_refused_in_one_line(folder, pattern, message):
    (folder / "empty").mkdir()
    with pytest.raises(InputError, match=message) as refusal:
        map_files([pattern], folder)
    assert len(str(refusal.value).splitlines()) == 1


def test_content_names_a_map_and_no_two_are_alike(folder):
    paths = map_files(["scans"], folder)
    assert digests(paths) == [hashlib.sha256(path.name.encode()).hexdigest() for path in paths]
    (folder / "scans" / "z.x3p").write_text("a.x3p")
    with pytest.raises(InputError, match=r"z\.x3p and .*a\.x3p are the same map"):
        digests(map_files(["scans"], folder))


def test_a_map_is_found_where_it_was_or_beside_the_database(folder):
    path = folder / "scans" / "a.x3p"
    (sha256,) = digests([path])
    assert located(path, sha256, folder) == path
    moved = path.rename(folder / "a.x3p")
    assert located(path, sha256, folder) == moved
    path.write_text("another map")
    assert located(path, sha256, folder) == moved
    moved.unlink()
    with pytest.raises(InputError, match="is not the map that the database was made of"):
        located(path, sha256, folder)
    path.unlink()
    with pytest.raises(InputError, match="the map is gone that the database was made of"):
        located(path, sha256, folder)
