"""The file under a writer: locked by what it is, never another one's, owner and mode kept."""

import os
import shutil
import stat

import h5py
import pytest
from databases import deterministic_bytes

from gen import cli
from gen.database import Reader, Writer, create, extend, lock, open_or_create
from gen.database.held import HeldFile
from gen.runtime.errors import InputError
from gen.scene import Scene

SCENE = "samples = {}\nseed = {}\n[surface]\nnodes = 9\n"
SMALL = Scene.parse(SCENE.format(12, 0), "scene.toml")
LARGER = Scene.parse(SCENE.format(20, 0), "larger.toml")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gen.generation.run.BLOCK_ROWS", 1)
    (tmp_path / "scene.toml").write_text(SCENE.format(12, 0))
    (tmp_path / "larger.toml").write_text(SCENE.format(20, 0))
    create(tmp_path / "other.h5", Scene.parse(SCENE.format(12, 7), "other.toml"))
    return tmp_path


@pytest.fixture
def path(folder):
    create(folder / "some.h5", SMALL)
    return folder / "some.h5"


SUDDENLY = {
    "replaced": lambda folder: shutil.copy(folder / "other.h5", folder / "new").replace(
        folder / "some.h5"
    ),
    "moved": lambda folder: (folder / "some.h5").rename(folder / "away.h5"),
    "deleted": lambda folder: (folder / "some.h5").unlink(),
    "overwritten": lambda folder: shutil.copyfile(folder / "other.h5", folder / "some.h5"),
    "cut off": lambda folder: os.truncate(folder / "some.h5", 1000),
}


@pytest.mark.parametrize("when", [4, 12], ids=["midway", "at the end"])
@pytest.mark.parametrize("fate", SUDDENLY)
def test_a_file_that_is_another_ends_the_run(folder, monkeypatch, capsys, fate, when):
    write_block, newcomer, struck = Writer.write_block, [], []

    def write_then_suddenly(self, start, stop, columns):
        write_block(self, start, stop, columns)
        if stop >= when and not struck:
            struck.append(stop)
            SUDDENLY[fate](folder)
            newcomer.extend(each.read_bytes() for each in folder.glob("some.h5"))

    monkeypatch.setattr(Writer, "write_block", write_then_suddenly)
    assert cli.main(["run", "scene.toml", "-o", "some.h5"]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    word = {"deleted": "moved or deleted", "cut off": "overwritten"}.get(fate, fate)
    assert line.startswith("gen: some.h5 was ")
    assert word in line
    assert [each.read_bytes() for each in folder.glob("some.h5")] == newcomer
    if fate == "moved":
        with Reader(folder / "away.h5") as reader:
            assert reader.counts().done == struck[0]
    assert not list(folder.glob("some.h5.*"))


def test_the_next_run_goes_on_after_such_an_end(folder):
    create(folder / "some.h5", SMALL)
    with Writer(folder / "some.h5", SMALL) as writer:
        SUDDENLY["moved"](folder)
        with pytest.raises(InputError, match="moved or deleted"):
            writer.retry_failed()
    assert cli.main(["run", "scene.toml", "-o", "away.h5"]) == 0
    assert cli.main(["run", "scene.toml", "-o", "whole.h5"]) == 0
    assert deterministic_bytes(folder / "away.h5") == deterministic_bytes(folder / "whole.h5")


def test_an_extension_does_not_replace_what_has_come_meanwhile(path, folder, monkeypatch):
    def replace_meanwhile(*_arguments, **_settings):
        SUDDENLY["replaced"](folder)

    monkeypatch.setattr("gen.database.creation.fill", replace_meanwhile)
    with pytest.raises(InputError, match="replaced by another file"):
        extend(path, LARGER)
    assert path.read_bytes() == (folder / "other.h5").read_bytes()
    assert {each.name for each in folder.glob("some*")} == {"some.h5"}


def test_others_read_what_is_held(path):
    with HeldFile(path), h5py.File(path, locking=True) as file:  # HDF5's own lock, of all of it
        assert len(file["status"]) == 12


def make_link(path):
    path.with_name("precious").write_text("precious")
    path.symlink_to("precious")


FOREIGN = {
    "text": lambda path: path.write_text("precious"),
    "link": make_link,
    "FIFO": os.mkfifo,
    "folder": lambda path: path.mkdir(),
    "long": lambda path: path.write_text("host x, process 1, since " + 999 * "x"),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_users_own_file_is_no_lock(path, folder, capsys, kind):
    own = folder / "some.h5.lock"
    FOREIGN[kind](own)
    before = own.lstat(), own.read_bytes() if own.is_file() else b""
    assert cli.main(["run", "scene.toml", "-o", "some.h5"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{own} is there" in line
    assert (own.lstat(), own.read_bytes() if own.is_file() else b"") == before


def test_an_empty_file_is_locked_and_left(path, folder):
    own = folder / "some.h5.lock"
    own.touch()
    with lock(path), pytest.raises(InputError, match="is being written"), lock(path):
        pass
    assert own.read_bytes() == b""
    own.write_text("host elsewhere, process 1, since long ago\n")  # as a dead job leaves it
    with lock(path):
        pass
    assert not own.exists()


def test_a_lock_that_has_become_another_file_is_left(path, folder):
    with lock(path):
        (folder / "some.h5.lock").unlink()
        (folder / "some.h5.lock").write_text("precious")
    assert (folder / "some.h5.lock").read_text() == "precious"


@pytest.mark.parametrize("options", [["scene.toml"], ["larger.toml"]])
def test_a_read_only_file_stays_as_it_is(path, capsys, options):
    path.chmod(0o444)
    before = path.stat(), path.read_bytes()
    assert cli.main(["run", *options, "-o", "some.h5", "--retry-failed"]) == 2
    assert "some.h5 is read-only" in capsys.readouterr().err
    assert (path.stat().st_mtime_ns, path.read_bytes()) == (before[0].st_mtime_ns, before[1])


def test_an_extension_keeps_owner_group_and_mode(path):
    path.chmod(0o620)
    root = os.geteuid() == 0
    if root:
        os.chown(path, 1234, 4321)
    before = path.stat()
    assert open_or_create(path, LARGER).how == "extended"
    after = path.stat()
    assert stat.S_IMODE(after.st_mode) == 0o620
    assert (after.st_uid, after.st_gid) == (before.st_uid, before.st_gid)
    assert after.st_ino != before.st_ino


def test_a_file_whose_owner_cannot_be_kept_is_not_extended(path, monkeypatch):
    def refuse(*_arguments):
        raise PermissionError(1, "Operation not permitted")

    def of_another(self):
        found = list(os.fstat(self._descriptor))
        found[stat.ST_UID] += 1
        return os.stat_result(found)

    monkeypatch.setattr(os, "fchown", refuse)
    monkeypatch.setattr(HeldFile, "stat", of_another)
    before = path.read_bytes()
    with pytest.raises(InputError, match="belongs to user"):
        open_or_create(path, LARGER)
    assert path.read_bytes() == before
    assert {each.name for each in path.parent.glob("some*")} == {"some.h5"}


def test_a_file_in_the_making_is_closed_to_whom_the_old_one_is(path, monkeypatch):
    path.chmod(0o600)
    modes = []

    def note_modes(*_arguments, **_settings):
        modes.extend(stat.S_IMODE(each.stat().st_mode) for each in path.parent.glob("*.part"))

    monkeypatch.setattr("gen.database.creation.fill", note_modes)
    extend(path, LARGER)
    assert set(modes) == {0o600}
