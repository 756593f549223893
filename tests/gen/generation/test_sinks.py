"""Who writes the rows of a run, and what the master is sent of them."""

from pathlib import Path

import numpy as np
import pytest
from databases import block, small

from gen import database
from gen.database import Reader, Writer, create, disk, writer
from gen.generation.sinks import ParallelSink, SingleSink, Sink, in_parallel, open_sink
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.schema import Status

ALONE, MANY = farm.World(), farm.World(0, 9)

MOUNTS = r"""
22 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw
31 22 0:50 / /home rw,relatime shared:2 master:1 - nfs4 server:/home rw
32 31 0:51 / /home/on\040lustre rw - lustre 10.0.0.1@tcp:/scratch rw
33 22 0:52 / /homely rw - tmpfs tmpfs rw
"""


@pytest.fixture
def mounts(tmp_path, monkeypatch):
    (tmp_path / "mountinfo").write_text(MOUNTS.strip())
    monkeypatch.setattr(disk, "MOUNTS", tmp_path / "mountinfo")


@pytest.mark.parametrize(
    ("path", "answer"),
    [("/home/x.h5", False), ("/home/on lustre/x.h5", True), ("/homely/x.h5", True)],
)
def test_network_file_systems_are_known_by_their_mounts(mounts, path, answer):
    assert database.coherent(Path(path)) is answer


@pytest.mark.parametrize(
    ("choice", "path", "world", "has_mpi", "answer"),
    [
        ("auto", "/x.h5", MANY, True, True),
        ("auto", "/x.h5", MANY, False, False),
        ("auto", "/home/x.h5", MANY, True, False),
        ("single", "/x.h5", MANY, True, False),
        ("parallel", "/home/x.h5", MANY, True, True),
    ],
)
def test_who_writes(mounts, monkeypatch, choice, path, world, has_mpi, answer):
    monkeypatch.setattr(database, "parallel_hdf5", lambda: has_mpi)
    assert in_parallel(choice, Path(path), world) is answer


@pytest.mark.parametrize(
    ("world", "has_mpi", "words"),
    [(MANY, False, "h5py with MPI"), (ALONE, True, "processes")],
)
def test_a_parallel_writer_that_cannot_be_is_refused(monkeypatch, world, has_mpi, words):
    monkeypatch.setattr(database, "parallel_hdf5", lambda: has_mpi)
    with pytest.raises(InputError, match=words) as caught:
        in_parallel("parallel", Path("x.h5"), world)
    assert "\n" not in str(caught.value)


ROWS = range(2, 5)


@pytest.fixture
def rows():
    return block(small(), ROWS.start, ROWS.stop)


@pytest.fixture
def open_database(path):
    """A database of 10 pending rows, open for writing."""
    create(path, small())
    with Writer(path, small()) as opened:
        yield opened


def test_a_worker_without_the_file_sends_all_columns(rows):
    assert Sink().deliver(ROWS, rows) is rows


def test_a_single_writer_writes_what_the_master_receives(open_database, rows):
    sink = SingleSink(open_database)
    assert sink.deliver(ROWS, rows) is rows
    assert open_database.pending() == [range(10)]
    sink.receive(ROWS, rows)
    assert open_database.pending() == [range(2), range(5, 10)]


def test_a_parallel_writer_writes_before_it_sends_the_statuses(open_database, rows):
    sent = ParallelSink(open_database).deliver(ROWS, rows)
    assert open_database.pending() == [range(2), range(5, 10)]
    assert sent.keys() == {"status"}
    np.testing.assert_array_equal(sent["status"], Status.DONE)


def test_what_a_parallel_writer_has_written_is_not_written_again(
    open_database, monkeypatch
):
    monkeypatch.setattr(open_database, "write_block", None)
    ParallelSink(open_database).receive(ROWS, {"status": np.ones(3, "u1")})


def test_sinks_of_the_file_finish_rows_and_notice_another_file(
    open_database, rows, monkeypatch
):
    monkeypatch.setattr(writer, "SYNC_SECONDS", 0.0)
    sink = SingleSink(open_database)
    sink.receive(ROWS, rows)
    sink.sync_when_due()
    assert open_database.counts().done == 3
    open_database.path.unlink()
    with pytest.raises(InputError, match="moved or deleted"):
        sink.confirm()


def test_the_master_opens_the_file_of_a_single_writer_and_no_worker_does(path, rows):
    with open_sink(path, small(), farm.World(1, 3), parallel=False) as sink:
        assert type(sink) is Sink
    create(path, small())
    with open_sink(path, small(), farm.World(0, 3), parallel=False) as sink:
        sink.receive(ROWS, rows)
    with Reader(path) as reader:
        assert reader.counts().done == 3
