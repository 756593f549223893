"""The report on the paper's paraboloid: its numbers, its files, and what it refuses."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from launch import launch

from bench import hertz
from bench.__main__ import main
from gen.runtime.installation import command_for

Curves = dict[tuple[str, int | str], pd.DataFrame]


@pytest.fixture(scope="module")
def curves() -> Curves:
    return dict(iter(hertz.compare(steps=2).groupby(["solution", "nodes"], sort=False)))


def test_forces_of_the_papers_example(curves: Curves) -> None:
    """At Delta = 1; other numbers mean that solver or kernels have changed."""
    forces = {key: float(curve["force_uN"].iloc[-1]) for key, curve in curves.items()}
    exact = 4 / 3 * np.sqrt(5000)
    assert forces["hertz", ""] == pytest.approx(exact, rel=1e-14)
    shares = {
        ("uniform-pressure", 128): 1.0011112,
        ("uniform-pressure", 256): 1.0002409,
        ("concentrated-force", 128): 1.0268076,
        ("concentrated-force", 256): 1.0129298,
    }
    for key, share in shares.items():
        assert forces[key] / exact == pytest.approx(share, abs=1e-6)


def test_areas_of_the_papers_example(curves: Curves) -> None:
    """The concentrated force makes them small, less so on the finer grid."""
    areas = {key: float(curve["area_percent"].iloc[-1]) for key, curve in curves.items()}
    concentrated = [areas["concentrated-force", nodes] for nodes in (128, 256)]
    assert concentrated[0] < concentrated[1] < areas["hertz", ""]
    assert areas["uniform-pressure", 256] == pytest.approx(areas["hertz", ""], rel=0.02)


def test_nothing_is_carried_at_first_touch(curves: Curves) -> None:
    for curve in curves.values():
        assert curve["delta_um"].tolist() == [0.0, 0.5, 1.0]
        assert curve["force_uN"].iloc[0] == curve["area_percent"].iloc[0] == 0
        assert (np.diff(curve["force_uN"]) > 0).all()


def test_command_writes_table_and_picture(tmp_path: Path) -> None:
    done = launch(0, "hertz", "-o", "new/reports", folder=tmp_path, module="bench")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == ["new/reports/hertz.csv", "new/reports/hertz.png"]
    folder = tmp_path / "new" / "reports"
    assert (folder / "hertz.png").read_bytes().startswith(b"\x89PNG")
    with (folder / "hertz.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 5 * (hertz.STEPS + 1)
    exact = [row for row in rows if row["solution"] == "hertz"]
    assert {row["nodes"] for row in exact} == {""}
    assert float(exact[-1]["delta_um"]) == 1
    assert float(exact[-1]["force_uN"]) == pytest.approx(94.2809, abs=1e-4)
    assert float(exact[-1]["area_percent"]) == pytest.approx(1.5708, abs=1e-4)


@pytest.mark.parametrize("folder", ["taken", "taken/below", "/proc/nowhere"])
def test_folders_that_cannot_be_written_are_refused(folder: str, tmp_path: Path) -> None:
    (tmp_path / "taken").touch()
    done = launch(0, "hertz", "-o", folder, folder=tmp_path, module="bench")
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"bench: {folder} ")
    assert [entry.name for entry in tmp_path.iterdir()] == ["taken"]


def test_missing_matplotlib_is_said_before_anything_is_solved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.setattr(hertz, "compare", lambda: pytest.fail("solved"))
    assert main(["hertz", "-o", str(tmp_path / "new")]) == 2
    assert f"drawing needs matplotlib: {command_for('plot')}" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("arguments", [["--help"], ["hertz", "--help"]])
def test_help_imports_no_numerics(arguments: list[str], tmp_path: Path) -> None:
    code = f"import sys; from bench.__main__ import main; assert main({arguments}) == 0;"
    code += "assert not {'numpy', 'scipy', 'pyfftw', 'h5py', 'matplotlib'} & sys.modules.keys()"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
