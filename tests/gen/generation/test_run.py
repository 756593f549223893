"""The life of a database on the command line: extension, retries, a dry run, a full disk."""

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
from gen import cli
from gen.scene import markdown_of_columns
from gen.schema import Reason, Status

SAMPLE = Path(__file__).resolve().parents[3] / "examples" / "sample.h5"
SCENE = "samples = {}\nsamples_per_surface = 2\n{}\n[surface]\nnodes = 17\n"


@pytest.fixture
def folder(here):
    (here / "scene.toml").write_text(SCENE.format(40, ""))
    return here


def run(*arguments):
    return cli.main(["run", *arguments])


@pytest.mark.few(2)
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


@pytest.fixture
def sample(folder):
    """The shipped sample, made before scenes knew a hardness, and scenes of it."""
    for samples in (200, 203):
        (folder / f"{samples}.toml").write_text(f"samples = {samples}")
    return shutil.copy(SAMPLE, folder / "sample.h5")


def test_a_run_of_the_whole_shipped_sample_leaves_its_bytes(sample, capsys):
    content = sample.read_bytes()
    assert run("200.toml", "-o", "sample.h5") == 0
    assert sample.read_bytes() == content
    assert "200 rows done, 0 failed, 0 pending" in capsys.readouterr().out


def test_the_extended_shipped_sample_keeps_its_rows_and_is_sound(sample):
    before = deterministic_bytes(sample)
    assert run("203.toml", "-o", "sample.h5") == 0
    after = deterministic_bytes(sample)
    assert after.keys() == before.keys()
    for name, values in before.items():
        assert after[name].startswith(values), name
    assert cli.main(["check", "sample.h5", "--recompute", "0"]) == 0


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    return database_of(tmp_path_factory.mktemp("computed"), SCENE.format(40, ""))


@pytest.fixture
def with_failures(computed, folder):
    """A database whose rows 5, 6 and 30 have failed."""
    path = shutil.copy(computed, folder / "rows.h5")
    with h5py.File(path, "r+") as file:
        for row in (5, 6, 30):
            file["status"][row] = Status.FAILED
            file["reason"][row] = Reason.NOT_CONVERGED
            file["force"][row] = np.nan
    return path


def test_failed_rows_stay_failed_unless_the_user_asks(with_failures):
    assert run("scene.toml", "-o", "rows.h5") == 0
    assert status(with_failures)[5] == Status.FAILED


def test_retrying_rows_leaves_the_failures_among_other_rows(with_failures, capsys):
    assert run("scene.toml", "-o", "rows.h5", "--retry-failed", "--rows", "0:10") == 0
    assert "2 to do, 2 failed ones among them" in capsys.readouterr().err
    assert status(with_failures)[30] == Status.FAILED


def test_retrying_computes_failed_rows_again(with_failures, computed):
    assert run("scene.toml", "-o", "rows.h5", "--retry-failed") == 0
    assert deterministic_bytes(with_failures) == deterministic_bytes(computed)


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


STARVED = """samples = 24
[surface]
nodes = 17
[contact]
max_iterations = 1
[delta]
pieces = [{ share = 1.0, range = [30, 45] }]
"""


@pytest.fixture
def starved(here, monkeypatch):
    """A database whose rows have all failed for want of iterations."""
    # The solver of contact sets may do with one iteration: it is never chosen.
    monkeypatch.setattr(patch, "FEW_FREE", ((0.0, 1.0),))
    return database_of(here, STARVED, "starved")


def test_a_run_warns_of_failed_rows(capsys, starved):
    assert starved.exists()
    assert "warning: 24 rows failed" in capsys.readouterr().out


@pytest.mark.usefixtures("starved")
def test_info_says_why_rows_failed(capsys):
    assert cli.main(["info", "starved.h5"]) == 0
    assert "24 failed: not converged" in capsys.readouterr().out


def test_a_database_without_a_done_row_is_not_drawn(starved):
    assert cli.main(["plot", str(starved), "-o", "no.png"]) == 2
    assert not starved.with_name("no.png").exists()


@pytest.mark.few(1)
def test_a_fresh_interpreter_pins_its_threads_and_exits_with_the_code(tmp_path):
    good = launch(0, "columns", folder=tmp_path)
    assert good.returncode == 0
    assert good.stdout.splitlines() == markdown_of_columns()
    bad = launch(0, "info", "missing.h5", folder=tmp_path)
    assert (bad.returncode, bad.stderr.count("\n"), bad.stdout) == (2, 1, "")
    assert "Traceback" not in bad.stderr
