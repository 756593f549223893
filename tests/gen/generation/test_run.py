"""The life of a database on the command line: shares, merging, extension, retries, a full disk."""

import re
import resource
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from databases import database_of, deterministic_bytes, status
from launch import TIMEOUT, command, environment, launch

from bem.operators import patch
from gen import cli, database
from gen.database import writer
from gen.generation.sinks import in_parallel
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.scene import markdown_of_columns

SAMPLE = Path(__file__).resolve().parents[3] / "examples" / "sample.h5"
SCENE = "samples = {}\nsamples_per_surface = 2\n{}\n[surface]\nnodes = 17\n"


@pytest.fixture
def folder(here):
    (here / "scene.toml").write_text(SCENE.format(40, ""))
    return here


def run(*arguments):
    return cli.main(["run", *arguments])


@pytest.mark.parametrize("block_rows", [1, 7])
@pytest.mark.parametrize("m", [1, 5])
def test_the_size_of_blocks_changes_no_byte(folder, monkeypatch, block_rows, m):
    (folder / "m.toml").write_text(
        SCENE.replace("surface = 2", f"surface = {m}").format(23, "")
    )
    assert run("m.toml", "-o", "usual.h5") == 0
    monkeypatch.setattr("gen.generation.run.BLOCK_ROWS", block_rows)
    assert run("m.toml", "-o", "other.h5") == 0
    assert deterministic_bytes(folder / "other.h5") == deterministic_bytes(
        folder / "usual.h5"
    )


def test_the_shipped_sample_is_resumed_and_extended_and_keeps_its_bytes(folder, capsys):
    """Files made before scenes knew a hardness go on and keep their bytes."""
    shutil.copy(SAMPLE, "sample.h5")
    before = deterministic_bytes(folder / "sample.h5")
    for samples in (200, 203):
        (folder / f"{samples}.toml").write_text(f"samples = {samples}")
    content = (folder / "sample.h5").read_bytes()
    assert run("200.toml", "-o", "sample.h5") == 0
    assert (folder / "sample.h5").read_bytes() == content
    assert "200 rows done, 0 failed, 0 pending" in capsys.readouterr().out
    assert run("203.toml", "-o", "sample.h5") == 0
    after = deterministic_bytes(folder / "sample.h5")
    assert after.keys() == before.keys()
    for name, values in before.items():
        assert after[name].startswith(values), name
    assert cli.main(["check", "sample.h5", "--recompute", "0"]) == 0


def test_retrying_computes_failed_rows_again(folder, capsys):
    assert run("scene.toml", "-o", "rows.h5") == 0
    whole = deterministic_bytes(folder / "rows.h5")
    with h5py.File("rows.h5", "r+") as file:
        for row in (5, 6, 30):
            file["status"][row], file["reason"][row], file["force"][row] = 2, 1, np.nan
    assert run("scene.toml", "-o", "rows.h5") == 0
    assert status(folder / "rows.h5")[5] == 2, "failed rows stay failed unless asked"
    capsys.readouterr()
    assert run("scene.toml", "-o", "rows.h5", "--retry-failed", "--rows", "0:10") == 0
    assert "2 to do, 2 failed ones among them" in capsys.readouterr().err
    assert status(folder / "rows.h5")[30] == 2, "a share leaves the failures of others"
    assert run("scene.toml", "-o", "rows.h5", "--retry-failed") == 0
    assert deterministic_bytes(folder / "rows.h5") == whole


def test_a_dry_run_writes_nothing(folder, capsys):
    before = sorted(folder.iterdir())
    assert run("paper", "-o", "paper.h5", "--dry-run") == 0
    assert "15878 samples on 15878 surfaces of 129 x 129 nodes" in capsys.readouterr().out
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("samples", [1, 60])
def test_a_dry_run_tells_the_size_of_the_whole_file(folder, capsys, samples):
    Path("small.toml").write_text(f"samples = {samples}\n[surface]\nnodes = 9\n")
    assert run("small.toml", "-o", "small.h5", "--dry-run") == 0
    (told,) = re.findall(r"file +([0-9.]+) kB", capsys.readouterr().out)
    assert run("small.toml", "-o", "small.h5") == 0
    assert float(told) == pytest.approx(
        (folder / "small.h5").stat().st_size / 1000, rel=0.03
    )


def test_an_estimate_measures(folder, capsys):
    assert cli.main(["estimate", "scene.toml", "--ranks", "5"]) == 0
    text = capsys.readouterr().out
    assert re.search(r"time +[0-9.e-]+ s on 4 workers", text), (
        "less than a minute in seconds"
    )
    assert "mean of 32 measured" in text


def test_a_file_that_may_not_grow_is_one_line_and_the_next_run_succeeds(folder):
    """A limit on file size, which the kernel reports as it does a full disk."""
    full = subprocess.run(
        command(0, "run", "scene.toml", "-o", "rows.h5"),
        env=environment() | {"PYTHONDONTWRITEBYTECODE": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8000, 8000)),
        capture_output=True,
        text=True,
        check=False,
        timeout=TIMEOUT,
    )
    assert full.returncode == 2
    assert full.stderr.count("\n") == 1
    assert "disk is full" in full.stderr
    assert [path.name for path in folder.iterdir()] == ["scene.toml"]
    assert run("scene.toml", "-o", "rows.h5") == 0
    assert (status(folder / "rows.h5") == 1).all()


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


def test_failed_rows_warn_and_say_why(here, capsys, monkeypatch):
    monkeypatch.setattr(
        patch, "FEW_FREE", ((0.0, 1.0),)
    )  # contact sets may do with one iteration
    deep = "[contact]\nmax_iterations = 1\n[delta]\npieces = [{ share = 1.0, range = [30, 45] }]\n"
    database_of(here, "samples = 24\n[surface]\nnodes = 17\n" + deep, "starved")
    assert "warning: 24 rows failed" in capsys.readouterr().out
    assert cli.main(["info", "starved.h5"]) == 0
    assert "24 failed: not converged" in capsys.readouterr().out
    assert cli.main(["plot", "starved.h5", "-o", "no.png"]) == 2
    assert not (here / "no.png").exists()


def test_a_fresh_interpreter_pins_its_threads_and_exits_with_the_code(tmp_path):
    good = launch(0, "columns", folder=tmp_path)
    assert good.returncode == 0
    assert good.stdout.splitlines() == markdown_of_columns()
    bad = launch(0, "info", "missing.h5", folder=tmp_path)
    assert (bad.returncode, bad.stderr.count("\n"), bad.stdout) == (2, 1, "")
    assert "Traceback" not in bad.stderr
