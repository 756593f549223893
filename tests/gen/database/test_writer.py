"""The writer: blocks of rows, their status last, pending rows found again."""

import errno
import os
import shutil
import signal
import stat
from pathlib import Path

import h5py
import numpy as np
import pytest
from databases import (
    NO_ROOM,
    block,
    database_of,
    deterministic_bytes,
    filled,
    run,
    small,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gen import cli, database
from gen.database import Reader, Writer, create, lock, open_or_create
from gen.database.disk import HeldFile
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import Status

KILLED_BEFORE_STATUS = """
    import os, signal, sys
    from pathlib import Path
    import numpy as np
    from gen.database import Reader, Writer
    path = Path(sys.argv[1])
    with Reader(path) as reader:
        scene = reader.scene
    writer = Writer(path, scene)
    names = [column.name for column in writer.columns()]
    block = {column.name: np.ones(4, column.dtype) for column in writer.columns()}
    writer.write_block(0, 4, block)
    sync = writer._held.sync
    def sync_and_die():
        sync()
        os.kill(os.getpid(), signal.SIGKILL)
    writer._held.sync = sync_and_die
    writer.write_block(4, 8, block)
    writer.close()
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """A database whose writer was killed between the columns and the statuses of rows."""
    path = tmp_path_factory.mktemp("killed") / "some.h5"
    create(path, small())
    assert run(KILLED_BEFORE_STATUS, path).returncode == -signal.SIGKILL
    return path


def test_rows_that_were_synced_before_a_kill_are_done(killed):
    with Reader(killed) as reader:
        assert reader.counts() == (6, 4, 0)
        assert (reader.column("force", 0, 4) == 1.0).all()


def test_kill_between_columns_and_status_leaves_rows_pending(killed):
    assert open_or_create(killed, small()) == "resumed"
    with Writer(killed, small()) as writer:
        assert writer.pending() == [range(4, 10)]


@pytest.mark.parametrize(("name", "rows"), [("weight", 3), ("force", 4)])
def test_broken_block_writes_nothing(path, name, rows):
    scene = small()
    create(path, scene)
    before = path.read_bytes()
    with Writer(path, scene) as writer, pytest.raises(ValueError, match=name):
        writer.write_block(0, 3, block(scene, 0, 3) | {name: np.ones(rows)})
    assert path.read_bytes() == before


@pytest.fixture(scope="module")
def twenty_rows(tmp_path_factory):
    scene = small(20)
    path = tmp_path_factory.mktemp("pending") / "twenty.h5"
    create(path, scene)
    with Writer(path, scene) as writer:
        yield writer


STATUSES = st.lists(st.integers(0, 2), min_size=20, max_size=20)
MANY_EXAMPLES = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@MANY_EXAMPLES
@given(
    statuses=STATUSES,
    first=st.integers(0, 20),
    last=st.none() | st.integers(0, 25),
    chunk=st.integers(1, 21),
)
def test_pending_is_what_a_plain_loop_finds(twenty_rows, statuses, first, last, chunk):
    twenty_rows._status[:] = statuses
    expected = []
    for row in range(first, min(20 if last is None else last, 20)):
        if statuses[row] == Status.PENDING:
            if expected and expected[-1].stop == row:
                expected[-1] = range(expected[-1].start, row + 1)
            else:
                expected.append(range(row, row + 1))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(database.reader, "CHUNK_BYTES", chunk)
        assert twenty_rows.pending(first, last) == expected


@MANY_EXAMPLES
@given(statuses=STATUSES, chunk=st.integers(1, 21))
def test_counts_are_those_of_all_chunks(twenty_rows, statuses, chunk):
    twenty_rows._status[:] = statuses
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(database.reader, "CHUNK_BYTES", chunk)
        tally = [statuses.count(status) for status in Status]
        assert list(twenty_rows.counts()) == tally


def test_writing_without_room_says_how_many_rows_are_safe(path):
    scene = Scene(samples=10_000)
    filled(path, scene, (0, 100, Status.DONE))
    action = """
        with Writer(path, Scene(samples=10_000)) as writer:
            block = {c.name: np.ones(50, c.dtype) for c in writer.columns()}
            forbid_growth_beyond(200_000)
            writer.write_block(9_000, 9_050, block)"""
    result = run(NO_ROOM.format(action=action), path)
    assert "disk is full" in result.stdout
    assert "100 rows are done and safe" in result.stdout
    assert (result.returncode, result.stderr) == (0, "")
    with Reader(path) as reader:
        assert reader.counts() == (9_900, 100, 0)


SCENE = "samples = {}\nseed = {}\n[surface]\nnodes = 9\n"
SMALL = Scene.parse(SCENE.format(12, 0), "scene.toml")
LARGER = Scene.parse(SCENE.format(20, 0), "larger.toml")


@pytest.fixture
def folder(here, monkeypatch):
    monkeypatch.setattr("gen.generation.run.BLOCK_ROWS", 1)
    monkeypatch.setattr("gen.generation.run.ANSWER_NODES", 0)
    (here / "scene.toml").write_text(SCENE.format(12, 0))
    (here / "larger.toml").write_text(SCENE.format(20, 0))
    create(here / "other.h5", Scene.parse(SCENE.format(12, 7), "other.toml"))
    return here


@pytest.fixture
def held(folder):
    create(folder / "some.h5", SMALL)
    return folder / "some.h5"


SUDDENLY = {
    "replaced": lambda folder: shutil.copy(folder / "other.h5", folder / "new").replace(
        folder / "some.h5"
    ),
    "moved": lambda folder: (folder / "some.h5").rename(folder / "away.h5"),
    "deleted": lambda folder: (folder / "some.h5").unlink(),
    "overwritten": lambda folder: shutil.copyfile(
        folder / "other.h5", folder / "some.h5"
    ),
    "cut off": lambda folder: os.truncate(folder / "some.h5", 1000),
}


@pytest.fixture
def strike(folder, monkeypatch):
    """Have something happen to the file of a run once a row is written."""

    def strike(fate, when):
        write_block = Writer.write_block
        struck = []

        def write_then_suddenly(self, start, stop, columns):
            write_block(self, start, stop, columns)
            if stop >= when and not struck:
                struck.append(stop)
                SUDDENLY[fate](folder)

        monkeypatch.setattr(Writer, "write_block", write_then_suddenly)

    return strike


WORDS = {"deleted": "moved or deleted", "cut off": "overwritten"}


@pytest.mark.parametrize(
    ("fate", "when"), [*((fate, 4) for fate in SUDDENLY), ("replaced", 12)]
)
def test_a_file_that_is_another_ends_the_run(folder, strike, capsys, fate, when):
    strike(fate, when)
    assert cli.main(["run", "scene.toml", "-o", "some.h5"]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("gen: some.h5 was ")
    assert WORDS.get(fate, fate) in line
    assert not list(folder.glob("some.h5.*"))


@pytest.mark.parametrize(("fate", "when"), [("replaced", 4), ("replaced", 12)])
def test_a_file_that_replaces_another_keeps_its_bytes(folder, strike, fate, when):
    strike(fate, when)
    assert cli.main(["run", "scene.toml", "-o", "some.h5"]) == 2
    assert (folder / "some.h5").read_bytes() == (folder / "other.h5").read_bytes()


def test_a_file_that_overwrites_another_keeps_its_bytes(folder, strike):
    strike("overwritten", 4)
    assert cli.main(["run", "scene.toml", "-o", "some.h5"]) == 2
    assert (folder / "some.h5").read_bytes() == (folder / "other.h5").read_bytes()


def test_a_file_that_was_cut_off_is_left_so(folder, strike):
    strike("cut off", 4)
    assert cli.main(["run", "scene.toml", "-o", "some.h5"]) == 2
    assert (folder / "some.h5").stat().st_size == 1000


@pytest.mark.parametrize("fate", ["moved", "deleted"])
def test_no_file_is_made_in_the_place_of_a_lost_one(folder, strike, fate):
    strike(fate, 4)
    assert cli.main(["run", "scene.toml", "-o", "some.h5"]) == 2
    assert not list(folder.glob("some.h5"))


def test_a_file_that_was_moved_has_its_rows_and_is_continued(folder, strike, monkeypatch):
    strike("moved", 4)
    assert cli.main(["run", "scene.toml", "-o", "some.h5"]) == 2
    with Reader(folder / "away.h5") as reader:
        assert reader.counts().done == 4
    monkeypatch.undo()
    monkeypatch.chdir(folder)
    assert cli.main(["run", "scene.toml", "-o", "away.h5"]) == 0


class PowerCut:
    """A disk that has what was synced, and a clock that goes on by a second a block."""

    def __init__(self, monkeypatch):
        self.on_disk, self.moment, self.syncs = {}, 0.0, []
        sync = os.fsync

        def fsync(descriptor):
            sync(descriptor)
            number = os.fstat(descriptor).st_ino
            self.on_disk[number] = Path(f"/proc/self/fd/{descriptor}").read_bytes()
            self.syncs.append(self.moment)

        monkeypatch.setattr(os, "fsync", fsync)
        monkeypatch.setattr(database.writer, "time", self)

    def monotonic(self):
        return self.moment

    def left_of(self, writer, name):
        """Write what a cut leaves at its worst: all late statuses, and no late data."""
        left = writer.path.with_name(name)
        left.write_bytes(self.on_disk[writer.path.stat().st_ino])
        with h5py.File(left, "r+") as file:
            file["status"][:] = writer.column("status")
        return left


class PowerCuts:
    """What would be on the disk if the power were cut, after each block of a run and at its end."""

    def __init__(self, folder, monkeypatch):
        self.folder = folder
        self.damaged = []  # numbers of damaged rows after each block
        self.lost = []  # numbers of rows that a cut costs
        write_block = Writer.write_block
        power = PowerCut(monkeypatch)

        def write_then_cut(writer, start, stop, columns):
            write_block(writer, start, stop, columns)
            left = power.left_of(writer, f"after-{stop}.h5")
            with Reader(left) as reader:
                self.damaged.append(reader.damaged_rows().size)
                self.lost.append(stop - reader.counts().done)
            power.moment += 1

        monkeypatch.setattr(Writer, "write_block", write_then_cut)
        assert cli.main(["run", "scene.toml", "-o", "some.h5"]) == 0
        self.syncs = power.syncs
        at_end = power.on_disk[(folder / "some.h5").stat().st_ino]
        (folder / "end.h5").write_bytes(at_end)
        monkeypatch.undo()


@pytest.fixture
def cuts(folder, monkeypatch):
    cuts = PowerCuts(folder, monkeypatch)
    monkeypatch.chdir(folder)
    return cuts


def test_a_power_cut_costs_five_seconds_and_damages_no_row(cuts):
    assert max(cuts.lost) <= 5
    assert not any(cuts.damaged)


def test_rows_are_synced_every_five_seconds_and_at_the_end(cuts):
    # The empty file, rows, and twice at the end.
    assert cuts.syncs == [0, 0, 5, 10, 12, 12]


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The bytes of all rows, from a run in which nothing happens."""
    path = database_of(tmp_path_factory.mktemp("whole"), SCENE.format(12, 0))
    return deterministic_bytes(path)


@pytest.mark.few(2)
@pytest.mark.parametrize("name", ["after-1.h5", "after-8.h5"])
def test_what_a_power_cut_leaves_is_continued(cuts, expected, name):
    assert cli.main(["run", "scene.toml", "-o", name]) == 0
    assert deterministic_bytes(cuts.folder / name) == expected


def test_all_rows_are_on_the_disk_as_a_run_ends(cuts, expected):
    assert deterministic_bytes(cuts.folder / "end.h5") == expected


def test_rows_are_finished_while_nothing_else_comes(path, monkeypatch):
    scene, power = small(), PowerCut(monkeypatch)
    create(path, scene)
    with Writer(path, scene) as writer:
        done = []
        for moment in (0, 1, 4, 6):
            power.moment = moment
            if moment < 2:
                writer.write_block(moment, moment + 1, block(scene, moment, moment + 1))
            writer.sync_when_due()
            done.append(writer.counts().done)
    assert done == [1, 1, 1, 2]


def failing_once(action, number):
    """An action that raises an error of the system the first time."""
    errors = [OSError(number, os.strerror(number))]

    def act(*arguments):
        if errors:
            raise errors.pop()
        return action(*arguments)

    return act


def test_rows_that_cannot_be_synced_stay_pending(path, monkeypatch):
    """After an error the kernel forgets what it could not write: a later sync would succeed."""
    scene = small()
    filled(path, scene, (0, 2, Status.DONE))
    with Writer(path, scene) as writer:
        monkeypatch.setattr(
            writer._held, "sync", failing_once(writer._held.sync, errno.EIO)
        )
        with pytest.raises(
            InputError, match=r"Input/output error; 2 rows are done and safe"
        ):
            writer.write_block(2, 6, block(scene, 2, 6))
    with Reader(path) as reader:
        assert reader.counts() == (8, 2, 0)


def test_rows_that_wait_for_a_sync_are_saved_when_the_disk_is_full(path, monkeypatch):
    scene = small()
    create(path, scene)
    with Writer(path, scene) as writer:
        for start in (0, 2):
            writer.write_block(start, start + 2, block(scene, start, start + 2))
        write = failing_once(database.writer.write_rows, errno.ENOSPC)
        monkeypatch.setattr(database.writer, "write_rows", write)
        with pytest.raises(InputError, match=r"disk is full .* 4 rows are done and safe"):
            writer.write_block(4, 6, block(scene, 4, 6))
    with Reader(path) as reader:
        assert reader.counts() == (6, 4, 0)


def test_an_extension_does_not_replace_what_has_come_meanwhile(held, folder, monkeypatch):
    def replace_meanwhile(*_arguments, **_settings):
        SUDDENLY["replaced"](folder)

    monkeypatch.setattr("gen.database.creation._merge_rows", replace_meanwhile)
    with pytest.raises(InputError, match="replaced by another file"):
        open_or_create(held, LARGER)
    assert held.read_bytes() == (folder / "other.h5").read_bytes()
    assert {each.name for each in folder.glob("some*")} == {"some.h5"}


@pytest.mark.parametrize("make", [lambda own: own.write_text("precious"), os.mkfifo])
def test_a_users_own_file_is_no_lock(held, folder, refused, make):
    own = folder / "some.h5.lock"
    make(own)
    before = own.lstat()
    assert f"{own} is there" in refused(cli, "run", "scene.toml", "-o", "some.h5")
    assert own.lstat() == before


@pytest.mark.parametrize("left", ["", "host elsewhere, process 1, since long ago\n"])
def test_the_lock_of_a_dead_job_is_taken_and_removed(held, folder, left):
    own = folder / "some.h5.lock"
    own.write_text(left)
    with lock(held), pytest.raises(InputError, match="is being written"), lock(held):
        pass
    assert not own.exists()


def test_others_read_what_is_held(held):
    with HeldFile(held), h5py.File(held, locking=True) as file:  # HDF5's own lock
        assert len(file["status"]) == 12


def test_a_lock_that_has_become_another_file_is_left(held, folder):
    with lock(held):
        (folder / "some.h5.lock").unlink()
        (folder / "some.h5.lock").write_text("precious")
    assert (folder / "some.h5.lock").read_text() == "precious"


@pytest.mark.parametrize("scene", ["scene.toml", "larger.toml"])
def test_a_read_only_file_stays_as_it_is(held, refused, scene):
    held.chmod(0o444)
    before = held.stat().st_mtime_ns, held.read_bytes()
    asked = ["run", scene, "-o", "some.h5", "--retry-failed"]
    assert "some.h5 is read-only" in refused(cli, *asked)
    assert (held.stat().st_mtime_ns, held.read_bytes()) == before


def test_an_extension_keeps_owner_group_and_mode(held):
    held.chmod(0o620)
    root = os.geteuid() == 0
    if root:
        os.chown(held, 1234, 4321)
    before = held.stat()
    assert open_or_create(held, LARGER) == "extended"
    after = held.stat()
    assert stat.S_IMODE(after.st_mode) == 0o620
    assert (after.st_uid, after.st_gid) == (before.st_uid, before.st_gid)
    assert after.st_ino != before.st_ino


def test_a_file_in_the_making_is_closed_to_whom_the_old_one_is(held, monkeypatch):
    held.chmod(0o600)
    modes = []

    def note_modes(*_arguments, **_settings):
        modes.extend(
            stat.S_IMODE(each.stat().st_mode) for each in held.parent.glob("*.part")
        )

    monkeypatch.setattr("gen.database.creation._merge_rows", note_modes)
    open_or_create(held, LARGER)
    assert set(modes) == {0o600}


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_a_file_whose_owner_cannot_be_kept_is_not_extended(held, monkeypatch):
    def refuse(*_arguments):
        raise PermissionError(1, "Operation not permitted")

    os.chown(held, 1234, 4321)
    monkeypatch.setattr(os, "fchown", refuse)
    before = held.read_bytes()
    with pytest.raises(InputError, match="belongs to user 1234"):
        open_or_create(held, LARGER)
    assert held.read_bytes() == before
    assert {each.name for each in held.parent.glob("some*")} == {"some.h5"}
