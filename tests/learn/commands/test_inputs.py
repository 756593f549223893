"""`learn importance`, with hybrid features."""

import csv
from pathlib import Path

from learn import cli


def run(*arguments):
    return cli.main([str(argument) for argument in arguments])


def table(path):
    with Path(path).open(newline="") as file:
        return list(csv.DictReader(file))


def test_hybrid_features_go_through_compare_and_importance(work, capsys):
    options = ["--features", "hybrid", "--model", "kernel-ridge"]
    both = [*options, "--model", "gaussian-process"]
    assert run("compare", "database.h5", "-o", "out", *both) == 0
    assert "hybrid features" in capsys.readouterr().err
    for row in table("out/area/scores.csv"):
        assert float(row["r2"]) > 40, "a linear model has its intercept, a kernel a length of use"
    assert run("importance", "database.h5", "-o", "out", *options) == 0
    ranked = table("out/area/importance.csv")
    assert len(ranked) == 30
    assert run("compare", "database.h5", "-o", "out", "--model", "kernel-ridge") == 2
    assert "features 'hybrid', not 'paper'" in capsys.readouterr().err
