"""The commands that compare models: wrong input in one line, help without numerics."""

import contextlib
import io

import pytest
from comparisons import run, table
from databases import database_of

from gen.runtime.files import lock_folder
from learn import cli

ONE_INPUT = "samples = 60\n[surface]\nnodes = 9\nhurst = 0.7\nsigma0 = 12.0\n"
WRONG = [
    (["compare", "scene.toml", "-o", "x"], "scene.toml"),
    (["compare", "database.h5", "-o", "x", "--target", "mean_gap"], "stores area, force"),
    (["compare", "database.h5", "-o", "x", "--train-rows", "1"], "--train-rows 1"),
    (["compare", "database.h5", "-o", "scene.toml"], "scene.toml"),
    (["tune", "database.h5", "-o", "x", "--budget", "soon"], "--budget 'soon'"),
    (["tune", "database.h5", "-o", "x", "--train-rows", "7"], "5 folds of 2 rows"),
    (["show", "x"], "holds no comparison"),
    (["importance", "database.h5", "-o", "x", "--model", "x"], "--model 'x'"),
]


@pytest.mark.parametrize(("arguments", "word"), WRONG)
def test_wrong_input_is_one_line_and_code_2(work, refused, arguments, word):
    (work / "scene.toml").write_text("samples = 3\n")
    before = sorted(work.iterdir())
    assert word in refused(cli, *arguments)
    assert sorted(work.iterdir()) == before, "nothing was written"


@pytest.mark.parametrize("command", ["compare", "tune", "importance", "show"])
def test_one_process_at_a_time_writes_a_folder(work, capsys, command):
    line = [
        command,
        *(["x"] if command == "show" else ["database.h5", "-o", "x", "--seed", "1"]),
    ]
    (work / "x" / "area").mkdir(parents=True)
    (work / "x" / "area" / "comparison.json").write_text("{}")
    with lock_folder(work / "x"):
        before = sorted(work.rglob("*"))
        assert cli.main(line) == 2
        assert "x is being written by host" in capsys.readouterr().err
        assert sorted(work.rglob("*")) == before


def test_hybrid_features_go_through_compare_and_importance(work, capsys):
    both = ["--model", "kernel-ridge", "--model", "gaussian-process"]
    assert run("compare", "database.h5", "-o", "out", "--features", "hybrid", *both) == 0
    assert "hybrid features" in capsys.readouterr().err
    rows = [row for row in table("out/area/scores.csv") if row["result"] == "baseline"]
    assert len(rows) == len(both) / 2
    for row in rows:  # the library's own kernel is fitted since scikit-learn 1.9 only
        assert float(row["r2"]) > 40, (
            "a linear model has its intercept, a kernel a length of use"
        )
    assert run("importance", "database.h5", "-o", "out", "--features", "hybrid") == 0
    assert len(table("out/area/importance.csv")) == 30
    assert run("compare", "database.h5", "-o", "out", "--model", "kernel-ridge") == 2
    assert "features 'hybrid', not 'paper'" in capsys.readouterr().err


@pytest.fixture(scope="module")
def report(solved, tmp_path_factory):
    """A folder with the report on the importance of the inputs, and what the command has told."""
    folder = tmp_path_factory.mktemp("importance")
    with contextlib.redirect_stdout(io.StringIO()) as told:
        assert run("importance", solved, "-o", folder / "out") == 0
    (folder / "told.txt").write_text(told.getvalue())
    return folder


@pytest.fixture(scope="module")
def ranked(report):
    """The inputs, from the most to the least important one."""
    return table(report / "out/area/importance.csv")


def test_importance_ranks_all_inputs_by_their_loss(ranked):
    assert len(ranked) == 23
    losses = [float(row["r2_loss_percent"]) for row in ranked]
    assert losses == sorted(losses, reverse=True)
    assert ranked[0]["input"] in {"delta", "height_max", "height_mean"}


def test_importance_drops_the_weakest(report, ranked):
    kept = table(report / "out/area/selection.csv")
    assert [row["inputs"] for row in kept][:2] == ["23", "20"]
    assert kept[1]["dropped"].split()[-1] in {row["input"] for row in ranked[-3:]}


def test_a_single_input_of_unit_length_is_left_out_as_a_constant(report):
    kept = table(report / "out/area/selection.csv")
    assert kept[-1]["inputs"] == "2"
    told = (report / "told.txt").read_text()
    assert "1 input: left out, because in rows of unit length" in told


def test_importance_is_drawn(report):
    picture = (report / "out/area/importance.png").read_bytes()
    assert picture.startswith(b"\x89PNG")


@pytest.mark.long
def test_importance_fits_a_single_input_that_is_standardised(work):
    standard = ["--normalise", "standard", "--model", "decision-tree"]
    assert run("importance", "database.h5", "-o", "out", *standard) == 0
    *_, two, one = table("out/area/selection.csv")
    assert (two["inputs"], one["inputs"]) == ("2", "1")
    assert float(one["r2"]) > 10


def test_importance_of_one_input_of_unit_length_is_refused(work, capsys):
    database_of(work, ONE_INPUT, "one")
    scene = ["--features", "scene", "--normalise", "l2"]
    assert run("importance", "one.h5", "-o", "out", *scene) == 2
    assert "log(delta) is the only input" in capsys.readouterr().err
