"""The commands compare, tune, estimate and show: wrong input in one line, help without numerics."""

import subprocess
import sys

import pytest
from launch import launch, mpiexec

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
    (["importance", "database.h5", "-o", "x", "--model", "x"], "--model 'x'"),
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
