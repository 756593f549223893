"""The commands compare, tune, estimate and show: wrong input in one line, help without numerics."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest
from launch import launch, mpiexec

from gen.runtime.lock import lock_folder
from learn import cli


@pytest.fixture
def work(database, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


WRONG = [
    (["compare", "database.h5"], "--output"),
    (["compare", "missing.h5", "-o", "x"], "missing.h5"),
    (["compare", "scene.toml", "-o", "x"], "scene.toml"),
    (["compare", "database.h5", "-o", "x", "--model", "forest"], "random-forest"),
    (["compare", "database.h5", "-o", "x", "--target", "pressure"], "stores area, force"),
    (["compare", "database.h5", "-o", "x", "--target", "mean_gap"], "stores area, force"),
    (["compare", "database.h5", "-o", "x", "--target", "area,force"], "give one target alone"),
    (["compare", "database.h5", "-o", "x", "--normalise", "l1"], "min-max"),
    (["compare", "database.h5", "-o", "x", "--area-max", "0.001"], "0 usable rows"),
    (["compare", "database.h5", "-o", "x", "--area-max", "much"], "--area-max"),
    (["compare", "database.h5", "-o", "x", "--seed", "-1"], "--seed"),
    (["compare", "database.h5", "-o", "x", "--train-rows", "1"], "--train-rows 1"),
    (["compare", "database.h5", "-o", "scene.toml"], "scene.toml"),
    (["tune", "database.h5", "-o", "x", "--budget", "soon"], "--budget 'soon'"),
    (["tune", "database.h5", "-o", "x", "--train-rows", "7"], "5 folds of 2 rows"),
    (["tune", "database.h5", "-o", "x", "--model", "svr"], "svm"),
    (["show", "x"], "holds no comparison"),
    (["show"], "DIR"),
    (["frobnicate"], "frobnicate"),
]


@pytest.mark.parametrize(("arguments", "word"), WRONG)
def test_wrong_input_is_one_line_and_code_2(work, capsys, arguments, word):
    (work / "scene.toml").write_text("samples = 3\n")
    before = sorted(work.iterdir())
    assert cli.main(arguments) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1, said
    assert word in said
    assert sorted(work.iterdir()) == before, "nothing was written"


@pytest.mark.parametrize("command", ["compare", "tune", "show"])
def test_one_process_at_a_time_writes_a_folder(work, capsys, command):
    line = (
        [command, "x"] if command == "show" else [command, "database.h5", "-o", "x", "--seed", "1"]
    )
    (work / "x" / "area").mkdir(parents=True)
    (work / "x" / "area" / "comparison.json").write_text("{}")
    with lock_folder(work / "x"):
        before = sorted(work.rglob("*"))
        assert cli.main(line) == 2
        assert "x is being written by host" in capsys.readouterr().err
        assert sorted(work.rglob("*")) == before


@pytest.mark.long
def test_of_two_comparisons_at_once_one_is_refused(work):
    """Each with a seed of its own, into one new folder."""
    line = [sys.executable, "-m", "learn", "compare", "database.h5", "-o", "x"]
    both = [
        subprocess.Popen([*line, "--model", "kernel-ridge", "--seed", seed], stderr=subprocess.PIPE)
        for seed in "12"
    ]
    said = [each.communicate(timeout=120)[1].decode() for each in both]
    assert sorted(each.returncode for each in both) == [0, 2], said


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'")
def test_wrong_input_ends_three_ranks_with_code_2_and_one_line(work):
    """As tests/mpi/test_every_command.py has it of all commands, but by the launcher's code."""
    done = launch(
        3, "fit", "missing.h5", "--features", "hybrid", "-o", "x", folder=work, module="learn"
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert "missing.h5" in done.stderr


@pytest.mark.parametrize("arguments", [["--help"], ["tune", "--help"], ["show", "--help"]])
def test_help_imports_no_numerics(arguments, tmp_path):
    code = f"from learn import cli; assert cli.main({arguments!r}) == 0"
    code += "\nimport sys; print(sorted({name.partition('.')[0] for name in sys.modules}))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    loaded = done.stdout.splitlines()[-1]
    for library in ("numpy", "scipy", "sklearn", "xgboost", "h5py", "matplotlib", "mpi4py"):
        assert f"'{library}'" not in loaded


def run(*arguments):
    return cli.main([str(argument) for argument in arguments])


def table(path):
    with Path(path).open(newline="") as file:
        return list(csv.DictReader(file))


def test_hybrid_features_go_through_compare(work, capsys):
    both = ["--model", "kernel-ridge", "--model", "gaussian-process"]
    assert run("compare", "database.h5", "-o", "out", "--features", "hybrid", *both) == 0
    assert "hybrid features" in capsys.readouterr().err
    for row in table("out/area/scores.csv"):
        assert float(row["r2"]) > 40, "a linear model has its intercept, a kernel a length of use"
    assert run("compare", "database.h5", "-o", "out", "--model", "kernel-ridge") == 2
    assert "features 'hybrid', not 'paper'" in capsys.readouterr().err
