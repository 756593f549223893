"""Memory that contacts need: what does not fit is refused, and says what it needs."""

import os
import resource
import subprocess
import sys
from unittest import mock

import h5py
import numpy as np
import pytest
from databases import database_of
from launch import SECONDS, environment, mpiexec

from gen import cli
from gen.runtime import memory
from gen.schema import RUNTIME


@pytest.fixture
def no_memory(monkeypatch):
    """A context in which no solve has memory."""
    with monkeypatch.context() as patch:
        for name in ("solve", "ladder"):
            patch.setattr(f"bem.{name}", mock.Mock(side_effect=MemoryError))
        yield patch


def test_a_contact_that_is_out_of_memory_says_what_it_needs(here, no_memory, refused):
    np.save("surface.npy", np.arange(81.0).reshape(9, 9))
    line = refused(cli, *["contact", "surface.npy", "--side", "9", "--delta", "1"])
    assert "9 x 9 nodes does not fit into memory: it needs about 32.4 kB" in line


def test_a_run_that_is_out_of_memory_fails_no_row(here, no_memory, capsys):
    text = "samples = 3\n[surface]\nnodes = 9\n"
    (here / "rows.toml").write_text(text)
    assert cli.main(["run", "rows.toml", "-o", "rows.h5"]) == 2
    assert "9 x 9 nodes does not fit into memory" in capsys.readouterr().err
    no_memory.undo()
    database_of(here, text)
    assert "3 rows done, 0 failed" in capsys.readouterr().out


@pytest.mark.long
def test_a_picture_needs_no_times(here, capsys):
    database_of(here, "samples = 4\n[surface]\nnodes = 9\n")
    for rows in (slice(0, 1), slice(None)):
        with h5py.File("rows.h5", "r+") as file:
            file[RUNTIME]["solve_seconds"][rows] = np.nan
        assert cli.main(["plot", "rows.h5", "-o", "rows.png"]) == 0, (
            capsys.readouterr().err
        )


def hang():
    while True:
        pass


@pytest.mark.parametrize("fault", [hang, lambda: os._exit(1)], ids=["hangs", "ends"])
def test_blas_that_hangs_or_ends_the_process_does_so_in_a_child(fault, monkeypatch):
    """As OpenBLAS does without room for its buffers."""
    monkeypatch.setattr(memory, "BLAS_PATIENCE", 0.1)
    monkeypatch.setattr(memory, "_use_blas", fault)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (10**12, 10**12))
    with pytest.raises(MemoryError, match="no room for NumPy, SciPy and their buffers"):
        memory.require_blas()


def test_without_a_limit_blas_is_not_tried(monkeypatch):
    unlimited = resource.RLIM_INFINITY
    monkeypatch.setattr(resource, "getrlimit", lambda _: (unlimited, unlimited))
    monkeypatch.setattr(memory, "_use_blas", mock.Mock(side_effect=AssertionError))
    memory.require_blas()


def limited(megabytes, *words):
    """A command line whose process may take some address space [MB]."""
    limit = f'ulimit -v {1000 * megabytes}; exec "$@"'
    return ["sh", "-c", limit, "sh", sys.executable, *words]


def run(words, folder):
    return subprocess.run(
        words,
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )


@pytest.mark.few(1)
@pytest.mark.parametrize("megabytes", [100, 150, 200, 250, 300, 350, 400, 500, 600])
@pytest.mark.parametrize(
    "line", ["gen run rows.toml -o rows.h5", "learn card none.surrogate"]
)
def test_little_address_space_ends_with_a_line_or_suffices(megabytes, line, here):
    (here / "rows.toml").write_text("samples = 2\n[surface]\nnodes = 33\n")
    done = run(limited(megabytes, "-m", *line.split()), here)
    last = done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
    if done.returncode:
        assert done.returncode == 2
        assert "more memory than there is" in last or "none.surrogate" in last


@pytest.mark.mpi
@pytest.mark.parametrize("rank", [0, pytest.param(1, marks=pytest.mark.long)])
def test_one_of_three_ranks_with_little_address_space_ends_all(rank, here):
    (here / "rows.toml").write_text("samples = 9\n[surface]\nnodes = 33\n")
    words = ["-m", "mpi4py", "-m", "gen", "run", "rows.toml", "-o", "rows.h5"]
    ranks = [[sys.executable, *words] for _ in range(3)]
    ranks[rank] = limited(300, *words)
    together = [":", *(word for one in ranks for word in ("-n", "1", *one, ":"))][1:-1]
    done = run([str(mpiexec()), *together], here)
    assert done.returncode == 2
    assert "more memory than there is" in done.stderr
    assert "Traceback" not in done.stderr
