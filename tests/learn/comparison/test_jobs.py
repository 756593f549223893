"""Compare and tune: what decides, their results, what they repeat, and how they are stopped."""

import json
import signal
import time
from pathlib import Path

import h5py
import launch
import numpy as np
import pytest
from comparisons import run, table
from launch import TIMEOUT, walk

from learn import Surrogate
from learn import models as nine
from learn.comparison import jobs, paper, search
from learn.comparison.folder import Folder
from learn.features import SETS

TREE = ["--model", "decision-tree"]
STUMPS = {"max_depth": [1, 2], "min_samples_leaf": [30]}
"""Trees that the library's own outdoes."""


def test_compare_tune_and_show(work, capsys):
    models = ["--model", "decision-tree", "--model", "kernel-ridge"]
    assert run("compare", "database.h5", "-o", "out", *models) == 0
    said = capsys.readouterr()
    assert "72 training rows, 18 test rows" in said.err
    assert "(8.99)" in said.out, "the paper's number stands beside ours"
    assert run("tune", "database.h5", "-o", "out", "--model", "kernel-ridge") == 0
    said = capsys.readouterr()
    assert "160 candidates, 88 differ, 55 fits, 55 to do" in said.err
    assert run("show", "out") == 0
    for name in ("parity.png", "scores.png", "times.png"):
        assert (work / "out/area" / name).read_bytes().startswith(b"\x89PNG")
    scores = table("out/area/scores.csv")
    assert [(row["model"], row["result"]) for row in scores] == [
        ("decision-tree", "baseline"),
        ("kernel-ridge", "baseline"),
        ("kernel-ridge", "tuned"),
    ]
    assert float(scores[2]["r2"]) > float(scores[1]["r2"])
    assert scores[0]["train_r2"] == "100.0"
    assert table("out/area/times.csv")[0]["fits"] != "0"
    (found,) = table("out/area/tuning.csv")
    assert int(found["candidates"]) >= 160, (
        "and those beyond the end at which the winner lay"
    )
    assert int(found["fits_nominal"]) == 5 * int(found["candidates"])
    record = json.loads((work / "out/area/comparison.json").read_text())
    assert record["scene"]["samples"] == 90
    assert record["conditions"]["versions"] == nine.versions()
    assert len(record["conditions"]["database_sha256"]) == 64
    parts = [row["part"] for row in table("out/area/rows.csv")]
    assert (parts.count("train"), parts.count("test")) == (72, 18)


def test_both_targets_have_folders_and_force_has_no_nmse(work):
    arguments = ["--model", "kernel-ridge", "--target", "both"]
    assert run("compare", "database.h5", "-o", "out", *arguments) == 0
    assert "nmse" in table("out/area/scores.csv")[0]
    assert not {"nmse", "paper_r2"} & table("out/force/scores.csv")[0].keys()


def test_a_model_that_fails_is_reported_and_the_others_go_on(work, capsys, monkeypatch):
    from sklearn.tree import DecisionTreeRegressor

    def refuse(self, *arguments, **named):
        raise ValueError("no tree today")

    monkeypatch.setattr(DecisionTreeRegressor, "fit", refuse)
    models = ["--model", "decision-tree", "--model", "kernel-ridge"]
    assert run("compare", "database.h5", "-o", "out", *models) == 0
    said = capsys.readouterr()
    assert "warning: Decision Tree, baseline: no tree today" in said.err
    assert "Decision Tree, baseline: no tree today" in said.out
    assert run("show", "out") == 0
    assert table("out/area/scores.csv")[0]["failure"] == "no tree today"
    assert float(table("out/area/scores.csv")[1]["r2"]) > 0
    for file in Path("out").rglob("*.json"):  # RFC 8259 knows no NaN
        json.loads(file.read_text(), parse_constant=pytest.fail)


def huge(file):
    file["height_max"][:] *= 1e12


def spoilt(file):
    file["asperity_density"][:] = 0.1
    for name in (*SETS["paper"].columns, "area_percent"):
        file[name][40:70] = file[name][0:30]
    file["delta"][80] = np.nan
    file["area_percent"][81] = np.nan


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (huge, ["height_max is "]),
        (
            spoilt,
            [
                "constant over all rows, so of no use to a model: asperity_density",
                "30 rows repeat others",
                "left out 1 rows: target not finite",
                "left out 1 rows: input not finite",
            ],
        ),
    ],
)
def test_all_nine_models_survive_odd_data(work, change, words, capsys, monkeypatch):
    monkeypatch.setattr(jobs, "FITS", jobs.Repetitions(1, 1))
    with h5py.File("database.h5", "r+") as file:
        change(file)
    assert run("compare", "database.h5", "-o", "out") == 0
    said = capsys.readouterr().err
    for word in words:
        assert word in said
    scores = table("out/area/scores.csv")
    assert len(scores) == 10, "nine models, and a library's own Gaussian process"
    for row in scores:
        assert row["failure"] == ""
        assert np.isfinite(float(row["r2"])), row["model"]
    if change is spoilt:
        assert max(float(row["r2"]) for row in scores) > 90


def test_a_search_in_which_every_fit_fails_says_why(work, capsys, monkeypatch):
    monkeypatch.setitem(paper.SPACES, "svm", {"C": [-1.0, -2.0]})
    assert run("tune", "database.h5", "-o", "out", "--model", "svm") == 0
    assert "'C' parameter" in capsys.readouterr().err
    assert run("show", "out") == 0
    assert "SVM Regressor, tuned: " in capsys.readouterr().out
    assert "'C' parameter" in table("out/area/scores.csv")[0]["failure"]


def begin(work):
    """Start a search and wait until some of its fits are on disk."""
    arguments = ["tune", "database.h5", "-o", "cut", "--model", "decision-tree"]
    started = launch.begin(0, *arguments, folder=work, module="learn")
    trials = work / "cut/area/trials/decision-tree.jsonl"
    limit = time.monotonic() + TIMEOUT
    while not trials.exists() or trials.read_bytes().count(b"\n") < 12:
        assert time.monotonic() < limit
        assert started.poll() is None, started.communicate()
        time.sleep(0.01)
    return started, arguments


def scores_of(folder, model):
    """Every score of a search, by candidate, fold and rows."""
    _, *lines = (folder / f"trials/{model}.jsonl").read_text().splitlines()
    trials = map(json.loads, lines)
    return {
        (each["candidate"], each["fold"], each["rows"]): each["r2"] for each in trials
    }


@pytest.fixture(scope="module")
def undisturbed(solved, tmp_path_factory):
    """The folder of a search that nothing stopped."""
    path = tmp_path_factory.mktemp("undisturbed") / "whole"
    assert run("tune", solved, "-o", path, "--model", "decision-tree") == 0
    return path / "area"


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_search_that_was_stopped_goes_on_and_ends_with_the_same_tables(
    work, undisturbed, number, capsys
):
    started, arguments = begin(work)
    started.send_signal(number)
    out, err = started.communicate(timeout=TIMEOUT)
    if number == signal.SIGTERM:
        assert started.returncode == 128 + number, err
        assert "stopped by SIGTERM; the same command goes on" in out
    assert not (work / "cut/area/tuned").exists()
    assert run(*arguments) == 0
    said = capsys.readouterr().err
    assert "550 fits" in said
    assert "550 fits, 550 to do" not in said
    for name in ("scores.csv", "tuning.csv"):
        assert (work / "cut/area" / name).read_bytes() == (
            undisturbed / name
        ).read_bytes()
    assert scores_of(work / "cut/area", "decision-tree") == scores_of(
        undisturbed, "decision-tree"
    )


@pytest.mark.long
@pytest.mark.mpi
def test_tables_do_not_depend_on_the_number_of_ranks(work):
    models = ["--model", "kernel-ridge"]
    for verb in ("compare", "tune"):
        assert run(verb, "database.h5", "-o", "r0", *models) == 0
    verbs = [
        ["learn", verb, "database.h5", "-o", "r3", *models]
        for verb in ("compare", "tune")
    ]
    for ends in walk(3, verbs, work):
        assert [end.code for end in ends] == [0, 0, 0], ends
    names = ("scores.csv", "tuning.csv", "rows.csv")
    predictions = ("baseline/kernel-ridge.csv", "tuned/kernel-ridge.csv")
    for name in (*names, *predictions):
        assert (work / "r0/area" / name).read_bytes() == (
            work / "r3/area" / name
        ).read_bytes()
    ours, theirs = (
        scores_of(work / name / "area", "kernel-ridge") for name in ("r0", "r3")
    )
    assert ours == theirs


@pytest.fixture
def stumps(monkeypatch):
    """A grid of trees that the baseline outdoes, in place of Table 2's."""
    monkeypatch.setitem(paper.SPACES, "decision-tree", STUMPS)


@pytest.mark.few(1)
@pytest.mark.usefixtures("stumps")
@pytest.mark.parametrize("limit", [[], ["--budget", "1h"]])
def test_where_the_baseline_wins_every_table_and_picture_names_it(
    work, limit, capsys, monkeypatch
):
    monkeypatch.setattr(search, "LEAST_ROWS", 20)
    assert run("compare", "database.h5", "-o", "out", *TREE) == 0
    assert run("tune", "database.h5", "-o", "out", *TREE, *limit) == 0
    said = capsys.readouterr()
    line = "Decision Tree: the baseline wins, no candidate is better over five folds of all rows"
    assert line in said.err
    assert line in said.out
    assert "tuned: baseline" in said.out
    (found,) = table("out/area/tuning.csv")
    assert found["winner"] == "baseline"
    assert found["settings"] == "those of the library"
    assert (
        float(found["baseline_r2"]) == float(found["winner_r2"]) > float(found["grid_r2"])
    )
    assert found["optimum_r2"] == "", "the grid lacks it"
    baseline, tuned = table("out/area/scores.csv")
    assert (baseline["winner"], tuned["winner"]) == ("", "baseline")
    for name in ("nmse", "nmae", "nmaxe", "r2"):
        assert tuned[name] == baseline[name], "the same model, fitted to the same rows"
    result = Folder(work / "out/area").result("tuned", "decision-tree")
    assert result.settings == {}
    assert len(result.search.baseline_r2_folds) == 5
    assert run("show", "out") == 0


@pytest.mark.usefixtures("stumps")
def test_a_surrogate_of_a_search_that_the_baseline_won_is_the_baseline(work):
    assert run("tune", "database.h5", "-o", "out", *TREE) == 0
    arguments = ["--from", "out", "--target", "area", "-o", "t.surrogate", *TREE]
    assert run("fit", "database.h5", *arguments) == 0
    card = Surrogate.load("t.surrogate").card
    assert card["targets"]["area"]["settings_from"] == "the baseline, by out/area"
    path = work / "out/area/tuned/decision-tree.json"
    edited = json.loads(path.read_text()) | {"settings": {"max_depth": 5}}
    path.write_text(json.dumps(edited))
    assert run("fit", "database.h5", *arguments) == 2


def test_a_budget_too_small_for_the_baseline_gives_no_result_and_says_so(work, capsys):
    assert run("tune", "database.h5", "-o", "out", *TREE, "--budget", "0.001s") == 0
    said = "not searched: the baseline was not finished on 5 folds within the time"
    assert said in capsys.readouterr().err
    assert run("show", "out", "--no-pictures") == 0
    assert said in capsys.readouterr().out


def test_perceptrons_are_scored_as_they_are_fitted_in_the_end(work, monkeypatch):
    """Search and last fit build the same estimator: epochs, seed, early stopping."""
    from sklearn.neural_network import MLPRegressor

    fit, seen = MLPRegressor.fit, []

    def watched(self, inputs, target):
        seen.append((len(target), self.get_params()))
        return fit(self, inputs, target)

    monkeypatch.setattr(MLPRegressor, "fit", watched)
    monkeypatch.setattr(jobs, "FITS", jobs.Repetitions(1, 1))
    space = {"hidden_layer_sizes": [(5,)], "solver": ["lbfgs"], "tol": [1e-2]}
    monkeypatch.setitem(paper.SPACES, "mlp", space)
    assert run("tune", "database.h5", "-o", "out", "--model", "mlp", "--seed", "3") == 0
    (found,) = table("out/area/tuning.csv")
    assert found["winner"] == "grid"
    searched = [
        params for rows, params in seen if rows < 72 and params["solver"] == "lbfgs"
    ]
    refitted = [params for rows, params in seen if rows == 72]
    assert len(searched) == 5
    assert all(params == searched[0] for params in [*searched, *refitted])
    assert (searched[0]["max_iter"], searched[0]["random_state"]) == (20_000, 3)


def test_a_damaged_result_is_measured_again_if_that_is_asked_for(work):
    asked = ["compare", "database.h5", "-o", "out", "--model", "decision-tree"]
    assert run(*asked, "--target", "area") == 0
    result = work / "out/area/baseline/decision-tree.json"
    result.write_text('{"broken')
    assert run(*asked, "--target", "area") == 2
    assert run(*asked, "--target", "area", "--again") == 0
    assert json.loads(result.read_text())["model"] == "decision-tree"
