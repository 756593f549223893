"""`learn fit`: with a tuned winner, and on several ranks."""

import csv
from pathlib import Path

import numpy as np
import pytest
from launch import launch, mpiexec

from learn import Surrogate, cli


def run(*arguments):
    return cli.main([str(argument) for argument in arguments])


def table(path):
    with Path(path).open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_tuned_winner_is_taken_with_what_it_rests_on(work, capsys, monkeypatch):
    from learn.comparison.search import spaces

    space = {"alpha": [1e-5, 1e-3], "gamma": [0.01], "kernel": ["rbf"]}
    monkeypatch.setitem(spaces.SCALED, "kernel-ridge", space)
    tune = ["tune", "database.h5", "-o", "out", "--model", "kernel-ridge", "--seed", "3"]
    assert run(*tune, "--features", "dimensionless", "--target", "area") == 0
    assert "for features without" in capsys.readouterr().out
    assert table("out/area/tuning.csv")[0]["grid"] == "for features without units"
    fit = ["fit", "database.h5", "--from", "out", "--target", "area", "-o", "t.surrogate"]
    assert run(*fit) == 0
    card = Surrogate.load("t.surrogate").card
    assert card["seed"] == 3
    assert card["features"] == "dimensionless"
    assert card["targets"]["area"]["settings_from"] == "tuned in out/area"
    assert card["targets"]["area"]["settings"]["gamma"] == "0.01"
    assert run(*fit, "--features", "paper") == 2
    assert "made with features 'dimensionless', not 'paper'" in capsys.readouterr().err
    assert run(*fit, "--model", "svm") == 2
    assert "no tuned svm" in capsys.readouterr().err


@pytest.mark.mpi
@pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'")
def test_workers_generate_the_surfaces_of_hybrid_features(made, database, tmp_path):
    arguments = ["fit", "database.h5", "--features", "hybrid", "-o", "r3.surrogate"]
    done = launch(3, *arguments, folder=tmp_path, module="learn")
    assert done.returncode == 0, done.stderr
    assert "generating 90 surfaces anew" in done.stderr
    with (
        np.load(tmp_path / "database.h5.pressed.npz") as ours,
        np.load(made / "database.h5.pressed.npz") as serial,
    ):
        np.testing.assert_array_equal(ours["values"], serial["values"])
    scores = [
        Surrogate.load(path).card["targets"]["area"]["scores"]
        for path in (tmp_path / "r3.surrogate", made / "hybrid.surrogate")
    ]
    assert scores[0] == scores[1]
