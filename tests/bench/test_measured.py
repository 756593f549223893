"""Tables of what other programs have measured: benchmarks run for real, errors of models."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from pytest_benchmark.utils import get_machine_id

from bench.commands import main
from bench.contents import Table
from bench.measured import models
from bench.report import part_of
from gen.runtime.errors import InputError

ROOT = Path(__file__).resolve().parents[2]


def measure(*arguments, folder=ROOT):
    done = subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=folder,
        env={name: value for name, value in os.environ.items() if "PYTEST" not in name},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.long
def test_benchmarks_are_a_table_and_can_be_saved_and_compared(tmp_path):
    measure("bench", "benchmarks", "--only", "contact and 10-smoke", "-o", str(tmp_path))
    (table,) = part_of("benchmarks").show(tmp_path)
    assert isinstance(table, Table)
    with table.data.open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert set(table.columns) <= row.keys()
    assert (row["suite"], row["case"], row["size"]) == (
        "solver",
        "solve at contact: 10",
        "smoke",
    )
    assert 0 < float(row["median_ms"]) < 60_000
    assert float(row["convolutions"]) > 0
    assert 0 < float(row["residual"]) < 1e-6
    suite = [
        "pytest",
        "bench/suites/test_solver.py",
        "-q",
        "--benchmark-only",
        "-k",
        "10-smoke",
    ]
    suite += [f"--benchmark-storage={tmp_path / 'saved'}", "--benchmark-max-time=0.01"]
    measure(*suite, "--benchmark-save=before")
    assert "(0001_before)" in measure(*suite, "--benchmark-compare")


@pytest.mark.parametrize("saved", [None, {"cpu": {"hz_actual": [1, 0]}}])
def test_saved_benchmarks_of_another_machine_or_none_are_a_warning(tmp_path, saved):
    """Of a clock that is 1 Hz off too; pytest-benchmark compares while pytest starts."""
    if saved is not None:
        folder = tmp_path / "saved" / get_machine_id()
        folder.mkdir(parents=True)
        content = {
            "machine_info": saved,
            "benchmarks": [],
            "commit_info": {},
            "version": "5",
        }
        (folder / "0001_before.json").write_text(json.dumps(content))
    settings = ["-c", str(ROOT / "pyproject.toml"), "--markers"]
    storage = ["--benchmark-storage=saved", "--benchmark-compare"]
    told = measure("pytest", *settings, *storage, folder=tmp_path)
    assert "PytestBenchmarkWarning" in told
    assert (
        "No benchmark files" in told
        if saved is None
        else "machine_info is different" in told
    )


@pytest.fixture
def comparison(tmp_path):
    """Three models as `learn show` writes them: one tuned too, one failed."""
    folder = tmp_path / "comparison" / "area"
    folder.mkdir(parents=True)
    (folder / "scores.csv").write_text(
        "model,result,nmae,r2,failure\n"
        "decision-tree,baseline,15,92,\n"
        "kernel-ridge,baseline,27,80,\n"
        "kernel-ridge,tuned,4,99,\n"
        "svm,baseline,,,no memory\n"
    )
    (folder / "times.csv").write_text(
        "model,result,fit_s,fits,predict_test_s,predict_row_s\n"
        "decision-tree,baseline,1,3,1,0.001\n"
        "kernel-ridge,baseline,20,3,1,0.002\n"
        "kernel-ridge,tuned,10,3,1,0.003\n"
    )
    (folder / "tuning-times.csv").write_text(
        "model,fit_seconds,paper_s\nkernel-ridge,500,2599\n"
    )
    return folder.parent


def test_errors_and_times_are_those_of_the_comparison(comparison):
    tree, untuned, tuned = models(comparison)
    assert tree["model"] == "decision-tree"
    assert (tree["nmae"], tree["fit_s"], tree["search_s"]) == (15, 1, None)
    assert (tuned["result"], tuned["search_s"], tuned["predict_s"]) == (
        "tuned",
        500,
        0.003,
    )
    fronts = [each["front"] for each in (tree, untuned, tuned)]
    assert fronts == ["predict fit", "", "predict fit search"]


def test_what_is_no_comparison_is_refused(tmp_path, comparison, capfd):
    assert main(["models", str(tmp_path), "-o", str(tmp_path)]) == 2
    assert "give a folder of learn compare or learn tune" in capfd.readouterr().err
    (comparison / "area" / "times.csv").write_text("model,result\n")
    with pytest.raises(InputError, match="no scores and times of area"):
        models(comparison)
