"""New files: nothing is overwritten, nothing is left of killed or refused attempts."""

import pytest
from small_databases import NO_ROOM, run, small

from gen import database
from gen.database import create
from gen.runtime.errors import InputError
from gen.scene import Scene, Store


def test_creation_never_overwrites(path):
    path.write_text("precious")
    with pytest.raises(InputError, match="exists"):
        create(path, small())
    assert path.read_text() == "precious"


def test_creation_never_overwrites_what_appears_meanwhile(path, monkeypatch):
    monkeypatch.setattr(database.creation, "fill", lambda *_, **__: path.write_text("precious"))
    with pytest.raises(InputError, match="meanwhile"):
        create(path, small())
    assert path.read_text() == "precious"


def test_leftover_of_a_killed_creation_is_removed_and_the_users_files_stay(path):
    left = [path.with_name(f"some.h5.{name}.part") for name in ("0" * 16, "0123456789abcdef")]
    for each, content in zip(left, (b"", b"\x89HDF\r\n\x1a\nhalf a file"), strict=True):
        each.write_bytes(content)
    precious = path.with_name("precious")
    own = [
        path.with_name(f"some.h5.{name}") for name in ("part", "1.part", f"{'1' * 16}.part", "bak")
    ]
    for each in (precious, *own):
        each.write_text("precious")
    link = path.with_name(f"some.h5.{'2' * 16}.part")
    link.symlink_to(precious)
    create(path, small())
    assert set(path.parent.iterdir()) == {path, precious, *own, link}
    assert {each.read_text() for each in (precious, *own, link)} == {"precious"}


def test_creation_without_room_leaves_nothing(path):
    action = "forbid_growth_beyond(200_000); create(path, Scene(samples=10_000))"
    result = run(NO_ROOM.format(action=action), path)
    assert "disk is full" in result.stdout
    assert "nothing was changed" in result.stdout
    assert (result.returncode, result.stderr) == (0, "")
    assert list(path.parent.iterdir()) == []


def test_creation_that_cannot_fit_does_not_start(path):
    with pytest.raises(InputError, match=r"need [\d,.]+ TB, [\d,.]+ [GT]B are free"):
        create(path, Scene(samples=10**9, store=Store(heights=True)))
    assert list(path.parent.iterdir()) == []
