"""What fails on one rank alone, before the farm starts and inside it: all ranks end."""

import json

import pytest
from launch import launch, mpiexec

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'"),
]

FAILING = """
import contextlib, errno, faulthandler, io, json, os, sys
from unittest.mock import patch
from mpi4py import MPI
from gen import cli
from gen.generation import run
from gen.runtime.errors import InputError
faulthandler.dump_traceback_later(60, exit=True)
world = MPI.COMM_WORLD
full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "disk")
missing = ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib")
FAULTS = {
    "a disk full while rows come in": (0, run.Delivery, "take", full),
    "a package that is missing": (0, run, "blocks_of", missing),
    "an error of the system at the start": (0, run, "_Job", full),
    "a refusal after the start": (0, run, "Delivery", InputError("no delivery")),
    "a worker alone": (1, run, "Delivery", InputError("no delivery")),
}
for name, (rank, home, attribute, error) in FAULTS.items():
    err = io.StringIO() if name != "a worker alone" else sys.stderr
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stderr(err))
        if world.rank == rank:
            stack.enter_context(patch.object(home, attribute, side_effect=error))
        code = cli.main(["run", "scene.toml", "-o", "rows.h5", "--writer", "single"])
    ends = world.gather((code, err.getvalue()))
    if world.rank == 0:
        print(json.dumps([name, ends]), flush=True)
"""


def test_what_fails_on_one_rank_ends_all(tmp_path):
    (tmp_path / "scene.toml").write_text("samples = 200\n[surface]\nnodes = 9\n")
    (tmp_path / "failing.py").write_text(FAILING)
    done = launch(3, folder=tmp_path, module="failing")
    ended = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    assert len(ended) == 4, done.stderr
    for name, ends in ended:
        (_, said), *others = ends
        assert [code for code, _ in ends] == [2, 2, 2], (name, ends)
        assert [words for _, words in others] == ["", ""], (name, ends)
        assert sum(line.startswith("gen: ") for line in said.splitlines()) == 1, (name, said)
    # A worker that fails where the others go on: nobody waits for it.
    assert done.returncode not in {0, 1}
    assert "gen: no delivery (rank 1)" in done.stderr
    assert "Traceback" not in done.stderr
