import fcntl
import os
import subprocess
import sys
import textwrap

import pytest

from gen.runtime.errors import InputError
from gen.runtime.lock import lock, lock_folder

HELD_ELSEWHERE = """
    import sys
    from pathlib import Path
    from gen.runtime.lock import lock
    with lock(Path(sys.argv[1])):
        print("held", flush=True)
        sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "some.h5"


def test_second_writer_is_told_who_writes(path, monkeypatch):
    command = [sys.executable, "-c", textwrap.dedent(HELD_ELSEWHERE), str(path)]
    monkeypatch.setenv("SLURM_JOB_ID", "4711")
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(InputError) as raised, lock(path):
            pass
        holder.kill()
    assert f"process {holder.pid}, job 4711, since 20" in str(raised.value)
    assert os.uname().nodename in str(raised.value)
    with lock(path):  # a killed holder holds nothing, though its file is still there
        assert f"process {os.getpid()}" in path.with_name("some.h5.lock").read_text()
    assert list(path.parent.iterdir()) == []


def test_lock_is_one_for_all_names_of_a_file(path, tmp_path):
    link = tmp_path / "link.h5"
    link.symlink_to(path)
    with lock(path), pytest.raises(InputError, match="is being written"), lock(link):
        pass


def test_lock_survives_a_rival_that_unlinks_in_between(path, monkeypatch):
    """The holder before us ends between our open and our lock: ours must not be of a ghost."""
    lock_path = path.with_name("some.h5.lock")
    flock = fcntl.flock
    opened = []

    def unlink_first_time(descriptor, operation):
        if not opened:
            lock_path.unlink()
        opened.append(descriptor)
        return flock(descriptor, operation)

    monkeypatch.setattr(fcntl, "flock", unlink_first_time)
    with lock(path):
        assert len(opened) == 2
        with pytest.raises(InputError, match="is being written"), lock(path):
            pass


def test_file_system_without_locks(path, monkeypatch):
    def refuse(_descriptor, _operation):
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.raises(InputError, match="HDF5_USE_FILE_LOCKING=FALSE"), lock(path):
        pass
    monkeypatch.setenv("HDF5_USE_FILE_LOCKING", "FALSE")
    with lock(path):
        pass


@pytest.mark.parametrize(
    "kind", ["new", "of several levels", "of the user's", "a link to a new one"]
)
def test_a_folder_is_made_held_and_removed_again_unless_it_was_there_or_is_used(tmp_path, kind):
    folder = tmp_path / "a" / "b" if kind == "of several levels" else tmp_path / "a"
    if kind == "of the user's":
        folder.mkdir()
    if kind == "a link to a new one":
        folder.symlink_to("place")
    again = pytest.raises(InputError, match="is being written by host")
    with lock_folder(folder), again, lock_folder(folder):
        pass
    left = {each.name for each in tmp_path.iterdir() if not each.is_symlink()}
    assert left == ({"a"} if kind == "of the user's" else set())
    with lock_folder(folder):
        (folder / "result").write_text("1")
    assert [each.name for each in folder.iterdir()] == ["result"]
