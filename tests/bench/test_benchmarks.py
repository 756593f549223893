"""Benchmarks as a table: run once for real, and read."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bench.benchmarks import contents
from bench.contents import Table
from gen.runtime.errors import InputError

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parents[2]


def measure(*arguments: str) -> subprocess.CompletedProcess[str]:
    suite = ["-m", "pytest", "bench/suites/test_solver.py", "-q", "--benchmark-only"]
    rounds = ["--benchmark-min-rounds=1", "--benchmark-max-time=0.01"]
    return subprocess.run(
        [sys.executable, *suite, *rounds, "-k", "10-smoke", *arguments],
        cwd=ROOT,
        env={name: value for name, value in os.environ.items() if "PYTEST" not in name},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_saved_benchmarks_are_a_table_and_can_be_compared(tmp_path: Path) -> None:
    path, storage = tmp_path / "times.json", f"--benchmark-storage={tmp_path / 'saved'}"
    done = measure("--benchmark-json", str(path), storage, "--benchmark-save=before")
    assert done.returncode == 0, done.stdout + done.stderr
    (table,) = contents(tmp_path)
    assert isinstance(table, Table)
    with table.data.open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert set(table.columns) <= row.keys()
    assert (row["suite"], row["case"], row["size"]) == ("solver", "solve at contact: 10", "smoke")
    assert 0 < float(row["median_ms"]) < 60_000
    assert float(row["convolutions"]) > 0
    assert 0 < float(row["residual"]) < 1e-6
    path.unlink()
    assert contents(tmp_path) == [table], "what is committed is enough"
    after = measure(storage, "--benchmark-compare")
    assert after.returncode == 0, after.stdout + after.stderr
    assert "(0001_before)" in after.stdout
    (tmp_path / "times.json").write_text("{}")
    with pytest.raises(InputError, match="no JSON file of pytest-benchmark"):
        contents(tmp_path)
