"""The writer: blocks of rows, their status last, pending rows found again."""

import signal

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_databases import NO_ROOM, block, filled, run, small

from gen import database
from gen.database import Reader, Writer, create, open_or_create
from gen.scene import Scene, Store
from gen.scene.columns import columns_for
from gen.schema import Reason, Status

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
    flush = writer._flush
    def flush_and_die():
        flush()
        os.kill(os.getpid(), signal.SIGKILL)
    writer._flush = flush_and_die
    writer.write_block(4, 8, block)
"""

MILLION = """
    import resource, sys
    from pathlib import Path
    from gen.database import Reader, Writer, create
    from gen.scene import Scene
    path, scene = Path(sys.argv[1]), Scene(samples=1_000_000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    create(path, scene)
    with Writer(path, scene) as writer:
        assert writer.pending() == [(0, 1_000_000)]
    with Reader(path) as reader:
        assert reader.counts() == (1_000_000, 0, 0)
        assert set(map(str, reader.ranges()["force"])) == {"nan"}
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_written_rows_come_back(path):
    scene = small(store=Store(heights=True, perimeter=True))
    filled(path, scene, (2, 5, Status.DONE), (7, 8, Status.FAILED))
    wanted = block(scene, 2, 5)
    with Reader(path) as reader:
        for column in reader.columns():
            np.testing.assert_array_equal(reader.column(column.name, 2, 5), wanted[column.name])
        assert reader.counts() == (6, 3, 1)
        assert reader.reasons() == {Reason.NOT_CONVERGED: 1}
        assert reader.size_bytes == path.stat().st_size


def test_status_is_written_after_all_else_is_flushed(path, monkeypatch):
    scene = small()
    create(path, scene)
    seen = []
    write, flush = database.disk.write_rows, h5py.File.flush
    monkeypatch.setattr(
        database.writer,
        "write_rows",
        lambda dataset, *rest: (seen.append(dataset.name), write(dataset, *rest)),
    )
    monkeypatch.setattr(h5py.File, "flush", lambda file: (seen.append("flush"), flush(file)))
    with Writer(path, scene) as writer:
        writer.write_block(0, 3, block(scene, 0, 3))
    assert seen[-3:] == ["flush", "/status", "flush"]
    others = {f"/{column.path}" for column in columns_for(scene)} - {"/status"}
    assert len(seen) == len(others) + 3
    assert set(seen[:-3]) == others


def test_kill_between_columns_and_status_leaves_rows_pending(path):
    scene = small()
    create(path, scene)
    assert run(KILLED_BEFORE_STATUS, path).returncode == -signal.SIGKILL
    with Reader(path) as reader:
        assert reader.counts() == (6, 4, 0)
        assert (reader.column("force", 0, 4) == 1.0).all()
    assert open_or_create(path, scene) == ("resumed", 10)
    with Writer(path, scene) as writer:
        assert writer.pending() == [(4, 10)]


def broken_blocks():
    scene = small()
    whole = block(scene, 0, 3)
    yield 0, 3, {name: whole[name] for name in whole if name != "force"}, "force"
    yield 0, 3, whole | {"weight": np.ones(3)}, "weight"
    yield 0, 3, whole | {"force": np.ones(4)}, "force"
    yield 0, 3, whole | {"rank": np.ones(3)}, "rank"
    yield 0, 3, whole | {"status": np.zeros(3, dtype="u1")}, "finished"
    yield 8, 11, whole, "8 to 11"


@pytest.mark.parametrize(("start", "stop", "columns", "message"), [*broken_blocks()])
def test_broken_block_writes_nothing(path, start, stop, columns, message):
    scene = small()
    create(path, scene)
    before = path.read_bytes()
    with Writer(path, scene) as writer, pytest.raises(ValueError, match=message):
        writer.write_block(start, stop, columns)
    assert path.read_bytes() == before


def test_retry_makes_failed_rows_pending(path):
    scene = small()
    filled(path, scene, (0, 3, Status.FAILED), (3, 5, Status.DONE), (9, 10, Status.FAILED))
    with Writer(path, scene) as writer:
        assert writer.retry_failed() == 4
        assert writer.counts() == (8, 2, 0)
        assert writer.pending() == [(0, 3), (5, 10)]
        assert writer.retry_failed() == 0


@pytest.fixture(scope="module")
def twenty_rows(tmp_path_factory):
    scene = small(20)
    path = tmp_path_factory.mktemp("pending") / "twenty.h5"
    create(path, scene)
    with Writer(path, scene) as writer:
        yield writer


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    statuses=st.lists(st.integers(0, 2), min_size=20, max_size=20),
    first=st.integers(0, 20),
    last=st.none() | st.integers(0, 25),
    chunk=st.integers(1, 21),
)
def test_pending_is_what_a_plain_loop_finds(twenty_rows, statuses, first, last, chunk):
    twenty_rows._status[:] = statuses
    wanted = []
    for row in range(first, min(20 if last is None else last, 20)):
        if statuses[row] == Status.PENDING:
            if wanted and wanted[-1][1] == row:
                wanted[-1] = (wanted[-1][0], row + 1)
            else:
                wanted.append((row, row + 1))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(database.disk, "CHUNK_BYTES", chunk)
        assert twenty_rows.pending(first, last) == wanted
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


def test_a_million_rows_take_little_memory(path):
    result = run(MILLION, path)
    assert result.stderr == ""
    assert int(result.stdout) < 150_000  # kB; one column alone has 8 MB, the file 310 MB
