"""Who writes: what a user asked for, what this h5py can, what the file system can stand."""

import subprocess
import sys
from pathlib import Path

import pytest

from gen import database
from gen.database import writer
from gen.generation.delivery import Block, Target, delivery, in_parallel
from gen.generation.sample import compute_rows
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.scene import DisplacedSurface, Scene

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
    monkeypatch.setattr(writer, "MOUNTS", tmp_path / "mountinfo")


@pytest.mark.parametrize(
    ("path", "answer"),
    [
        ("/x.h5", True),
        ("/home/x.h5", False),
        ("/home/on lustre/x.h5", True),
        ("/homely/x.h5", True),
    ],
)
def test_network_file_systems_are_known_by_their_mounts(mounts, path, answer):
    assert database.coherent(Path(path)) is answer


def test_without_a_list_of_mounts_the_answer_is_yes(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "MOUNTS", tmp_path / "missing")
    assert database.coherent(Path("/home/x.h5"))


@pytest.mark.parametrize(
    ("choice", "path", "world", "has_mpi", "answer"),
    [
        ("auto", "/x.h5", MANY, True, True),
        ("auto", "/x.h5", MANY, False, False),
        ("auto", "/x.h5", ALONE, True, False),
        ("auto", "/home/x.h5", MANY, True, False),
        ("single", "/x.h5", MANY, True, False),
        ("parallel", "/x.h5", MANY, True, True),
        ("parallel", "/home/x.h5", MANY, True, True),
    ],
)
def test_who_writes(mounts, monkeypatch, choice, path, world, has_mpi, answer):
    monkeypatch.setattr(database, "parallel_hdf5", lambda: has_mpi)
    assert in_parallel(choice, Path(path), world) is answer


@pytest.mark.parametrize(
    ("world", "has_mpi", "words"), [(MANY, False, "no MPI"), (ALONE, True, "one process")]
)
def test_a_parallel_writer_that_cannot_be_is_refused(monkeypatch, world, has_mpi, words):
    monkeypatch.setattr(database, "parallel_hdf5", lambda: has_mpi)
    with pytest.raises(InputError, match=words) as caught:
        in_parallel("parallel", Path("x.h5"), world)
    assert "\n" not in str(caught.value)


def test_rows_through_the_master_are_counted_and_written(tmp_path):
    scene = Scene(samples=10, surface=DisplacedSurface(nodes=5))
    path = tmp_path / "some.h5"
    database.create(path, scene)

    def compute(block: Block):
        rows = compute_rows(scene, *block)
        rows["status"][1], rows["status"][2] = 2, 0  # one that fails, one that takes too long
        return rows

    with delivery(Target(path, scene, parallel=False), ALONE, compute) as delivered:
        tally = delivered.take((4, 8), delivered.work((4, 8)))
    assert tally.overdue == 1
    assert tally.failed >= 1
    with database.Reader(path) as reader:
        finished = reader.column("status") != 0
    assert finished.tolist() == [False] * 4 + [True, True, False, True] + [False] * 2


def test_a_file_that_cannot_be_opened_is_refused(tmp_path):
    target = Target(tmp_path / "missing.h5", Scene(samples=1), parallel=False)
    with pytest.raises(InputError, match="does not exist"):
        delivery(target, ALONE, lambda block: {})


def test_a_worker_of_the_single_writer_loads_neither_hdf5_nor_a_progress_bar():
    code = (
        "import sys; from pathlib import Path\n"
        "import gen.generation.run; from gen.runtime import farm\n"
        "from gen.scene import Scene; from gen.generation.delivery import Target, delivery\n"
        "target = Target(Path('missing.h5'), Scene(samples=1), parallel=False)\n"
        "world = farm.World(1, 3)\n"
        "with delivery(target, world, lambda block: {}) as delivered:\n"
        "    assert delivered.work((0, 1)) == {}\n"
        "print(sorted({'h5py', 'rich', 'typer', 'mpi4py'} & sys.modules.keys()))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.stdout == "[]\n", done.stderr
