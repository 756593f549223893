"""Compare and tune: what decides, their results, what they repeat, and how they are stopped."""

import contextlib
import io
import json
import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

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


class Printed(NamedTuple):
    """The lines that a command has printed."""

    out: str
    err: str


def printed(*arguments):
    """Run a command line that succeeds; return what it prints."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        assert run(*arguments) == 0
    return Printed(out.getvalue(), err.getvalue())


class Compared(NamedTuple):
    """Two models that were compared, one of which was tuned, and what the commands printed."""

    folder: Path
    compare: Printed
    tune: Printed

    def table(self, name):
        """Read a table of the target."""
        return table(self.folder / "area" / name)


@pytest.fixture(scope="module")
def compared(solved, tmp_path_factory):
    folder = tmp_path_factory.mktemp("compared") / "out"
    ridge = ["--model", "kernel-ridge"]
    compare = printed("compare", solved, "-o", folder, *TREE, *ridge)
    tune = printed("tune", solved, "-o", folder, *ridge)
    return Compared(folder, compare, tune)


def test_the_numbers_of_rows_are_said(compared):
    assert "72 training rows, 18 test rows" in compared.compare.err


def test_the_paper_s_numbers_stand_beside_ours(compared):
    assert "(8.99)" in compared.compare.out


def test_tune_says_which_fits_there_are_to_do(compared):
    assert "160 candidates, 88 differ, 55 fits, 55 to do" in compared.tune.err


def test_show_draws_pictures(compared):
    assert run("show", compared.folder) == 0
    for name in ("parity.png", "scores.png", "times.png"):
        picture = compared.folder / "area" / name
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_every_result_has_scores(compared):
    scores = compared.table("scores.csv")
    assert [(row["model"], row["result"]) for row in scores] == [
        ("decision-tree", "baseline"),
        ("kernel-ridge", "baseline"),
        ("kernel-ridge", "tuned"),
    ]


def test_a_winner_of_a_search_is_better_than_the_baseline(compared):
    _, baseline, tuned = compared.table("scores.csv")
    assert float(tuned["r2"]) > float(baseline["r2"])


def test_a_decision_tree_knows_its_training_rows_by_heart(compared):
    assert compared.table("scores.csv")[0]["train_r2"] == "100.0"


def test_fits_are_timed(compared):
    assert compared.table("times.csv")[0]["fits"] != "0"


def test_a_table_of_searches_counts_candidates_and_fits(compared):
    (found,) = compared.table("tuning.csv")
    assert int(found["candidates"]) >= 160, (
        "and those beyond the end at which the winner lay"
    )
    assert int(found["fits_nominal"]) == 5 * int(found["candidates"])


def test_a_comparison_records_its_data_and_versions(compared):
    record = json.loads((compared.folder / "area/comparison.json").read_text())
    assert record["scene"]["samples"] == 90
    assert record["conditions"]["versions"] == nine.versions()
    assert len(record["conditions"]["database_sha256"]) == 64


def test_a_comparison_records_the_part_of_each_row(compared):
    parts = [row["part"] for row in compared.table("rows.csv")]
    assert (parts.count("train"), parts.count("test")) == (72, 18)


def test_both_targets_have_folders_and_force_has_no_nmse(work):
    arguments = ["--model", "kernel-ridge", "--target", "both"]
    assert run("compare", "database.h5", "-o", "out", *arguments) == 0
    assert "nmse" in table("out/area/scores.csv")[0]
    assert not {"nmse", "paper_r2"} & table("out/force/scores.csv")[0].keys()


@pytest.fixture(scope="module")
def failing(solved, tmp_path_factory):
    """The folder of two models, of which the first fails, and what `compare` printed."""
    from sklearn.tree import DecisionTreeRegressor

    def refuse(self, *arguments, **named):
        raise ValueError("no tree today")

    folder = tmp_path_factory.mktemp("failing") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DecisionTreeRegressor, "fit", refuse)
        said = printed("compare", solved, "-o", folder, *TREE, "--model", "kernel-ridge")
    return folder, said


def test_a_model_that_fails_is_reported(failing):
    _, said = failing
    assert "warning: Decision Tree, baseline: no tree today" in said.err
    assert "Decision Tree, baseline: no tree today" in said.out


def test_models_after_one_that_fails_go_on(failing):
    folder, _ = failing
    failed, next_model = table(folder / "area/scores.csv")
    assert failed["failure"] == "no tree today"
    assert float(next_model["r2"]) > 0


def test_a_comparison_with_a_model_that_failed_is_shown(failing):
    assert run("show", failing[0]) == 0


def test_no_file_has_nan_for_a_fit_that_failed(failing):
    for file in failing[0].rglob("*.json"):  # RFC 8259 knows no NaN
        json.loads(file.read_text(), parse_constant=pytest.fail)


def huge(file):
    file["height_max"][:] *= 1e12


def spoilt(file):
    file["asperity_density"][:] = 0.1
    for name in (*SETS["paper"].columns, "area_percent"):
        file[name][40:70] = file[name][0:30]
    file["delta"][80] = np.nan
    file["area_percent"][81] = np.nan


ODD = {
    huge: ["height_max is "],
    spoilt: [
        "constant over all rows, so of no use to a model: asperity_density",
        "30 rows repeat others",
        "left out 1 rows: target not finite",
        "left out 1 rows: input not finite",
    ],
}
"""Changes of a database, and what is said of it then."""


class Odd(NamedTuple):
    """A comparison of all models on odd data."""

    change: Callable[[Any], None]
    scores: list[dict[str, str]]
    said: str


@pytest.fixture(scope="module", params=list(ODD))
def odd(request, solved, tmp_path_factory):
    folder = tmp_path_factory.mktemp("odd")
    database = shutil.copy(solved, folder / "database.h5")
    with h5py.File(database, "r+") as file:
        request.param(file)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jobs, "FITS", jobs.Repetitions(1, 1))
        said = printed("compare", database, "-o", folder / "out").err
    return Odd(request.param, table(folder / "out/area/scores.csv"), said)


@pytest.mark.few(1)
def test_odd_data_are_said(odd):
    for words in ODD[odd.change]:
        assert words in odd.said


@pytest.mark.few(1)
def test_all_nine_models_survive_odd_data(odd):
    assert len(odd.scores) == 10, "nine models, and a library's own Gaussian process"
    for row in odd.scores:
        assert row["failure"] == ""
        assert np.isfinite(float(row["r2"])), row["model"]


@pytest.mark.few(1)
def test_models_learn_from_the_rows_that_are_not_odd(odd):
    least = 90 if odd.change is spoilt else -np.inf
    assert max(float(row["r2"]) for row in odd.scores) > least


def test_a_search_in_which_every_fit_fails_says_why(work, capsys, monkeypatch):
    monkeypatch.setitem(paper.SPACES, "svm", {"C": [-1.0, -2.0]})
    assert run("tune", "database.h5", "-o", "out", "--model", "svm") == 0
    assert "'C' parameter" in capsys.readouterr().err
    assert run("show", "out") == 0
    assert "SVM Regressor, tuned: " in capsys.readouterr().out
    assert "'C' parameter" in table("out/area/scores.csv")[0]["failure"]


def begin(folder):
    """Start a search in a folder, and wait until some of its fits are on disk."""
    arguments = ["tune", "database.h5", "-o", "cut", *TREE]
    started = launch.begin(0, *arguments, folder=folder, module="learn")
    trials = folder / "cut/area/trials/decision-tree.jsonl"
    limit = time.monotonic() + TIMEOUT
    while not trials.exists() or trials.read_bytes().count(b"\n") < 12:
        assert time.monotonic() < limit
        assert started.poll() is None, started.communicate()
        time.sleep(0.01)
    return started


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


class Stopped(NamedTuple):
    """A search that a signal stopped, and that the same command finished."""

    folder: Path
    code: int  # exit code of the process that was stopped
    out: str  # what this process printed
    had_winner: bool  # whether it left a result
    said: str  # what the second process said of the fits


@pytest.fixture(scope="module", params=[signal.SIGKILL, signal.SIGTERM])
def stopped(request, solved, tmp_path_factory):
    folder = tmp_path_factory.mktemp("stopped")
    shutil.copy(solved, folder / "database.h5")
    started = begin(folder)
    started.send_signal(request.param)
    out, err = started.communicate(timeout=TIMEOUT)
    if request.param == signal.SIGTERM:
        assert started.returncode == 128 + request.param, err
    had_winner = (folder / "cut/area/tuned").exists()
    with contextlib.chdir(folder):
        said = printed("tune", "database.h5", "-o", "cut", *TREE).err
    return Stopped(folder / "cut/area", started.returncode, out, had_winner, said)


@pytest.mark.long
def test_a_search_that_was_stopped_has_no_winner_and_says_how_it_goes_on(stopped):
    assert not stopped.had_winner
    if stopped.code == 128 + signal.SIGTERM:
        assert "stopped by SIGTERM; the same command goes on" in stopped.out


@pytest.mark.long
def test_a_search_that_was_stopped_goes_on(stopped):
    assert "550 fits" in stopped.said
    assert "550 fits, 550 to do" not in stopped.said


@pytest.mark.long
@pytest.mark.parametrize("name", ["scores.csv", "tuning.csv"])
def test_a_search_that_was_stopped_ends_with_the_same_tables(stopped, undisturbed, name):
    assert (stopped.folder / name).read_bytes() == (undisturbed / name).read_bytes()


@pytest.mark.long
def test_a_search_that_was_stopped_ends_with_the_same_scores(stopped, undisturbed):
    scores = scores_of(stopped.folder, "decision-tree")
    assert scores == scores_of(undisturbed, "decision-tree")


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


@pytest.fixture(scope="module")
def tuned_stumps(solved, tmp_path_factory):
    """The folder of a search that the baseline has won."""
    folder = tmp_path_factory.mktemp("stumps") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(paper.SPACES, "decision-tree", STUMPS)
        printed("tune", solved, "-o", folder, *TREE)
    return folder


@pytest.fixture(scope="module", params=[[], ["--budget", "1h"]])
def outdone(request, solved, tmp_path_factory):
    """A comparison in which the baseline wins the search, and what was printed."""
    folder = tmp_path_factory.mktemp("outdone") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(paper.SPACES, "decision-tree", STUMPS)
        patch.setattr(search, "LEAST_ROWS", 20)
        compare = printed("compare", solved, "-o", folder, *TREE)
        tune = printed("tune", solved, "-o", folder, *TREE, *request.param)
    return Compared(folder, compare, tune)


@pytest.mark.few(1)
def test_that_the_baseline_wins_is_said(outdone):
    line = "Decision Tree: the baseline wins, no candidate is better over five folds of all rows"
    assert line in outdone.tune.err
    assert line in outdone.tune.out
    assert "tuned: baseline" in outdone.tune.out


@pytest.mark.few(1)
def test_the_table_of_searches_names_the_baseline_that_wins(outdone):
    (found,) = outdone.table("tuning.csv")
    assert found["winner"] == "baseline"
    assert found["settings"] == "those of the library"
    assert found["optimum_r2"] == "", "the grid lacks it"


@pytest.mark.few(1)
def test_the_table_of_searches_has_the_score_of_the_baseline_that_wins(outdone):
    (found,) = outdone.table("tuning.csv")
    assert float(found["baseline_r2"]) == float(found["winner_r2"])
    assert float(found["baseline_r2"]) > float(found["grid_r2"])


@pytest.mark.few(1)
def test_the_table_of_scores_has_those_of_the_baseline_that_wins_twice(outdone):
    baseline, tuned = outdone.table("scores.csv")
    assert (baseline["winner"], tuned["winner"]) == ("", "baseline")
    for name in ("nmse", "nmae", "nmaxe", "r2"):
        assert tuned[name] == baseline[name], "the same model, fitted to the same rows"


@pytest.mark.few(1)
def test_the_result_of_a_search_has_the_folds_of_the_baseline_that_wins(outdone):
    result = Folder(outdone.folder / "area").result("tuned", "decision-tree")
    assert result.settings == {}
    assert len(result.search.baseline_r2_folds) == 5


@pytest.mark.few(1)
def test_pictures_of_a_search_that_the_baseline_wins_are_drawn(outdone):
    assert run("show", outdone.folder) == 0


@pytest.fixture
def copied_stumps(tuned_stumps, solved, tmp_path):
    """A copy of the folder of `tuned_stumps`, and the options that fit its winner."""
    folder = shutil.copytree(tuned_stumps, tmp_path / "out")
    file = tmp_path / "t.surrogate"
    return folder, [solved, "--from", folder, "--target", "area", "-o", file, *TREE]


def test_a_surrogate_of_a_search_that_the_baseline_won_is_the_baseline(copied_stumps):
    folder, options = copied_stumps
    assert run("fit", *options) == 0
    area = Surrogate.load(options[-3]).card["targets"]["area"]
    assert area["settings_from"] == f"the baseline, by {folder}/area"
    assert area["comparison"] == f"{folder}/area"


def test_edited_settings_of_a_baseline_that_won_are_refused(copied_stumps):
    folder, options = copied_stumps
    path = folder / "area/tuned/decision-tree.json"
    edited = json.loads(path.read_text()) | {"settings": {"max_depth": 5}}
    path.write_text(json.dumps(edited))
    assert run("fit", *options) == 2


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
