"""Every worker writes its own rows: the single writer's bytes, whatever happens on the way.

Where h5py has MPI, the other tests of this folder run with the parallel writer too, those of any
number of ranks, of growing, of signals and of a second writer among them.
"""

import shutil

import h5py
import numpy as np
import pytest
from databases import deterministic_bytes, status
from launch import launch

from gen import cli
from tests.faults.stage import columns_of, row_fault

HAS_MPI = bool(h5py.get_config().mpi)

pytestmark = pytest.mark.mpi
needs_parallel_hdf5 = pytest.mark.skipif(
    not HAS_MPI, reason="this h5py has no MPI: make test-parallel runs these"
)

SCENE = """samples = {}
samples_per_surface = 3
[surface]
nodes = 17
[store]
heights = true
pressure = true
perimeter = true
"""

DYING = """
import os, signal, sys
from gen import cli
from gen.database import Writer, writer
from gen.runtime import farm
writer.SYNC_SECONDS = 0.0
flushes = []
def die_between_columns_and_status(self):
    flushes.append(1)
    if farm.this_world().rank > 0 and len(flushes) == 3:  # whichever worker comes that far
        os.kill(os.getpid(), signal.SIGKILL)
Writer._flush = die_between_columns_and_status
sys.exit(cli.main(["run", "scene.toml", "-o", sys.argv[1]]))
"""


POWER_CUT = """
import os, sys
from pathlib import Path
from gen import cli
from gen.database import writer
from gen.generation import run
from gen.runtime import farm
rank = farm.this_world().rank
run.BLOCK_ROWS, run.ANSWER_NODES, writer.SYNC_SECONDS = 3, 0, 0.2
sync, write_block, written = os.fsync, writer.Writer.write_block, []
def fsync(descriptor):  # a copy of what is on the disk, as far as this rank has seen to it
    sync(descriptor)
    Path(f"disk-{rank}.h5").write_bytes(Path(f"/proc/self/fd/{descriptor}").read_bytes())
def write_and_perhaps_end(self, start, stop, columns):
    write_block(self, start, stop, columns)
    written.append(stop - start)
    if sum(written) > 12:
        farm.this_world().communicator.Abort(9)
os.fsync, writer.Writer.write_block = fsync, write_and_perhaps_end
sys.exit(cli.main(["run", "scene.toml", "-o", "cut.h5", "--writer", sys.argv[1]]))
"""


ELSEWHERE = """
import os, sys
from gen import cli
from gen.runtime import farm
if farm.this_world().rank == 1:
    os.chdir("elsewhere")
sys.exit(cli.main(["run", os.path.join(sys.path[0], "scene.toml"), "-o", "here.h5"]))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parallel")
    (folder / "scene.toml").write_text(SCENE.format(90))
    done = launch(0, "run", "scene.toml", "-o", "serial.h5", folder=folder)
    assert done.returncode == 0, done.stderr
    return folder


def run(folder, output, *options, ranks=4):
    done = launch(ranks, "run", "scene.toml", "-o", output, *options, folder=folder)
    assert done.returncode == 0, done.stderr
    return done.stderr


@needs_parallel_hdf5
@pytest.mark.parametrize(
    ("first", "second"), [("single", "parallel"), ("parallel", "single")]
)
def test_either_writer_goes_on_with_what_the_other_has_left(folder, first, second):
    output = f"{first}-{second}.h5"
    assert f"{first} writer" in run(folder, output, "--writer", first, "--rows", "0:40")
    assert np.count_nonzero(status(folder / output)) == 40
    told = run(folder, output, "--writer", second)
    assert "50 to do" in told
    assert f"{second} writer" in told
    assert deterministic_bytes(folder / output) == deterministic_bytes(
        folder / "serial.h5"
    )


@needs_parallel_hdf5
@pytest.mark.parametrize("writer", ["single", "parallel"])
def test_a_worker_that_dies_before_its_status_costs_its_rows_only(folder, writer):
    (folder / "dying.py").write_text(DYING)
    output = f"dying-{writer}.h5"
    done = launch(3, output, folder=folder, module="dying")
    assert done.returncode not in {0, 2}
    found = columns_of(folder / output)
    assert row_fault(None, found, columns_of(folder / "serial.h5")) == ""
    assert 0 < (found["status"] == 1).sum() < 90
    run(folder, output, "--writer", writer)
    assert deterministic_bytes(folder / output) == deterministic_bytes(
        folder / "serial.h5"
    )


@pytest.mark.parametrize("ranks", [3, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "writer", ["single", pytest.param("parallel", marks=needs_parallel_hdf5)]
)
def test_a_power_cut_costs_no_row_that_says_done(folder, tmp_path, writer, ranks):
    """The late writes of statuses are on the disk, those of data that were not synced are not."""
    (tmp_path / "power_cut.py").write_text(POWER_CUT)
    shutil.copy(folder / "scene.toml", tmp_path)
    done = launch(ranks, writer, folder=tmp_path, module="power_cut")
    assert done.returncode not in {0, 2}, done.stderr
    late, whole = columns_of(tmp_path / "cut.h5"), columns_of(folder / "serial.h5")
    finished = late["status"] != 0
    assert 0 < finished.sum() < 90
    for rank in np.unique(late["rank"][finished]).tolist():
        on_disk = columns_of(tmp_path / f"disk-{rank if writer == 'parallel' else 0}.h5")
        on_disk["status"] = np.where(late["rank"] == rank, late["status"], 0)
        assert row_fault(None, on_disk, whole) == ""
    assert (
        cli.main(["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "cut.h5")])
        == 0
    )
    assert deterministic_bytes(tmp_path / "cut.h5") == deterministic_bytes(
        folder / "serial.h5"
    )


@needs_parallel_hdf5
def test_a_path_that_leads_elsewhere_on_one_rank_is_refused(folder):
    (folder / "elsewhere").mkdir()
    (folder / "elsewhere.py").write_text(ELSEWHERE)
    done = launch(3, folder=folder, module="elsewhere")
    assert done.returncode == 2, done.stderr
    assert "rank 1 on" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list((folder / "elsewhere").iterdir())


@pytest.mark.long
@pytest.mark.skipif(HAS_MPI, reason="this h5py has MPI")
def test_without_mpi_in_h5py_the_parallel_writer_is_refused_and_auto_is_single(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.format(6))
    refused = launch(
        3, "run", "scene.toml", "-o", "x.h5", "--writer", "parallel", folder=tmp_path
    )
    assert refused.returncode == 2
    assert "needs an h5py with MPI" in refused.stderr
    assert refused.stderr.count("\n") == 1
    assert not (tmp_path / "x.h5").exists()
    assert "single writer" in run(tmp_path, "x.h5", ranks=2)
