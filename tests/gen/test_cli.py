"""Commands as a user types them, serially; tests/mpi has several ranks."""

import numpy as np
import pytest
from launch import launch

from bem.operators import patch
from gen import cli
from gen.scene.columns import columns_for, markdown_table

SMALL = "samples = 24\n[surface]\nnodes = 17\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(SMALL)
    x = np.linspace(-500, 500, 33)
    np.save("paraboloid.npy", -(x[:, None] ** 2 + x**2) / 10000)
    return tmp_path


def test_run_info_and_plot(folder, capsys):
    assert cli.main(["run", "small.toml", "-o", "small.h5"]) == 0
    assert "24 rows done, 0 failed, 0 pending" in capsys.readouterr().out
    assert cli.main(["info", "small.h5"]) == 0
    text = capsys.readouterr().out
    assert "24 done" in text
    for column in columns_for(small_scene(folder)):
        if not column.group and column.name not in {"status", "reason"}:
            assert column.name in text
    assert cli.main(["plot", "small.h5", "-o", "small.png"]) == 0
    assert (folder / "small.png").read_bytes().startswith(b"\x89PNG")


def small_scene(folder):
    from gen.scene import load

    return load(str(folder / "small.toml"))


def test_failed_rows_warn_and_say_why(folder, capsys, monkeypatch):
    monkeypatch.setattr(patch, "FEW_FREE", ((0.0, 1.0),))  # contact sets may do with one iteration
    deep = "[contact]\nmax_iterations = 1\n[delta]\npieces = [{ share = 1.0, range = [30, 45] }]\n"
    (folder / "starved.toml").write_text(SMALL + deep)
    assert cli.main(["run", "starved.toml", "-o", "starved.h5"]) == 0
    assert "warning: 24 rows failed" in capsys.readouterr().out
    assert cli.main(["info", "starved.h5"]) == 0
    assert "24 failed: not converged" in capsys.readouterr().out
    assert cli.main(["plot", "starved.h5", "-o", "no.png"]) == 2
    assert not (folder / "no.png").exists()


def test_contact_is_hertz(folder, capsys):
    assert cli.main(["contact", "paraboloid.npy", "--side", "1000", "--delta", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    force = float(next(line for line in lines if line.startswith("force")).split()[1])
    assert force == pytest.approx(4 / 3 * np.sqrt(5000.0), rel=0.05)


def test_a_fresh_interpreter_pins_its_threads_and_exits_with_the_code(folder):
    good = launch(0, "columns", folder=folder)
    assert good.returncode == 0
    assert good.stdout.strip() == markdown_table()
    bad = launch(0, "info", "missing.h5", folder=folder)
    assert (bad.returncode, bad.stderr.count("\n"), bad.stdout) == (2, 1, "")
    assert "Traceback" not in bad.stderr
