"""Tests of the file of prepared maps: whole, shared, and never trusted when it is damaged."""

import json

import numpy as np
import pytest

from gen.maps.store import PAGE, PreparedMap, opened, write
from gen.runtime.errors import InputError

MAPS = [
    (PreparedMap(np.random.default_rng(1).normal(size=(30, 41)), ("a remark",)), (0.5, 0.5)),
    (PreparedMap(np.asfortranarray(np.arange(12.0).reshape(3, 4))), (0.5, 0.5)),
]


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "a.maps"
    write(path, "key", iter(MAPS), replace=False)
    return path


def test_maps_come_back_bit_for_bit(path):
    stored = opened(path, "key", verify=True)
    assert stored.spacing == (0.5, 0.5)
    assert [each.remarks for each in stored.maps] == [("a remark",), ()]
    for each, (made, _) in zip(stored.maps, MAPS, strict=True):
        assert np.array_equal(each.heights, made.heights)
        assert isinstance(each.heights, np.memmap)
        assert not each.heights.flags.writeable


def test_another_key_or_machine_is_another_file(path, monkeypatch):
    assert opened(path, "other", verify=False) is None
    assert opened(path.with_name("none"), "key", verify=False) is None
    monkeypatch.setattr("sys.byteorder", "other")
    assert opened(path, "key", verify=False) is None


@pytest.mark.parametrize("share", np.linspace(0, 1, 15))
def test_damaged_first_lines_are_noticed(path, share):
    content = bytearray(path.read_bytes())
    lines = content.index(b"\n", content.index(b"\n") + 1)
    content[int(share * lines)] ^= 4
    path.write_bytes(content)
    assert opened(path, "key", verify=True) is None


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.9, 0.999])
def test_a_shortened_file_is_noticed(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    assert opened(path, "key", verify=False) is None


@pytest.mark.parametrize("place", [PAGE, PAGE + 30 * 41 * 8 - 1, -1, -40])
def test_damaged_heights_and_tables_are_noticed(path, place):
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)
    assert opened(path, "key", verify=True) is None


def test_a_table_that_says_nonsense_is_noticed(path):
    import hashlib

    content = path.read_bytes()
    for table in ([], {"key": "key"}, {"key": "key", "byteorder": "little", "maps": 3}):
        text = json.dumps(table).encode()
        line = f"{PAGE} {len(text)} {hashlib.sha256(text).hexdigest()}\n".encode()
        start = content[: content.index(b"\n") + 1] + line
        path.write_bytes(start + bytes(PAGE - len(start)) + text)
        assert opened(path, "key", verify=True) is None


def test_nothing_is_left_of_a_file_whose_maps_fail(tmp_path):
    def failing():
        yield MAPS[0]
        raise InputError("no map")

    with pytest.raises(InputError, match="no map"):
        write(tmp_path / "a.maps", "key", failing(), replace=False)
    assert not list(tmp_path.iterdir())


def test_a_file_that_another_process_made_meanwhile_stays(path):
    before = path.stat().st_ino
    write(path, "key", iter(MAPS), replace=False)
    assert path.stat().st_ino == before, "others may have it in their memory"
    write(path, "key", iter(MAPS), replace=True)
    assert path.stat().st_ino != before
    assert [each.name for each in path.parent.iterdir()] == [path.name]


def test_a_file_of_the_users_is_not_replaced(tmp_path):
    path = tmp_path / "a.maps"
    path.write_text("notes")
    with pytest.raises(InputError, match="holds text, not prepared maps: not replaced"):
        write(path, "key", iter(MAPS), replace=True)
    assert path.read_text() == "notes"
