"""What decides a search: five folds of all rows, beside the baseline, which may win."""

import json
import shutil

import pytest
from comparisons import run, table

from learn import Surrogate
from learn.comparison import timing
from learn.comparison.folder import Folder
from learn.comparison.search import budget, spaces
from learn.comparison.search.grid_search import GridSearch

TREE = ["--model", "decision-tree"]
STUMPS = {"max_depth": [1, 2], "min_samples_leaf": [30]}
"""Trees that the library's own outdoes."""


@pytest.fixture
def few(monkeypatch):
    """Twelve trees in place of Table 2's."""
    space = {"max_depth": [2, 4, 8, 16], "min_samples_leaf": [1, 3, 6]}
    monkeypatch.setitem(spaces.SPACES, "decision-tree", space)


@pytest.fixture
def stumps(monkeypatch):
    """A grid of trees that the baseline outdoes, in place of Table 2's."""
    monkeypatch.setitem(spaces.SPACES, "decision-tree", STUMPS)


@pytest.mark.usefixtures("stumps")
@pytest.mark.parametrize("limit", [[], ["--budget", "1h"]])
def test_where_the_baseline_wins_every_table_and_picture_names_it(work, limit, capsys, monkeypatch):
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    monkeypatch.setitem(budget.GROWTH, "decision-tree", 99.0)
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
    assert float(found["baseline_r2"]) == float(found["winner_r2"]) > float(found["grid_r2"])
    assert found["optimum_r2"] == "", "the grid lacks it"
    baseline, tuned = table("out/area/scores.csv")
    assert (baseline["winner"], tuned["winner"]) == ("", "baseline")
    for name in ("nmse", "nmae", "nmaxe", "r2"):
        assert tuned[name] == baseline[name], "the same model, fitted to the same rows"
    result = Folder(work / "out/area").result("tuned", "decision-tree")
    assert result["settings"] == {}
    assert len(result["search"]["baseline_r2_folds"]) == 5
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


def test_tuned_models_are_never_worse_over_the_folds_than_their_baselines(work):
    """On so few rows that a grid's best on them need not be better than the baseline."""
    names = ["decision-tree", "gaussian-process"]
    models = [word for name in names for word in ("--model", name)]
    assert run("tune", "database.h5", "-o", "out", *models, "--budget", "8s") == 0
    found = table("out/area/tuning.csv")
    assert [row["model"] for row in found] == sorted(names, key=list(spaces.SPACES).index)
    for row in found:
        assert float(row["winner_r2"]) >= float(row["baseline_r2"]), row["model"]
        assert "and the baseline on 72 rows" in row["searched"] or row["searched"] == "whole grid"


def test_a_budget_too_small_for_the_baseline_gives_no_result_and_says_so(work, capsys, monkeypatch):
    monkeypatch.setattr(budget, "seconds", lambda text: 1e-9)
    assert run("tune", "database.h5", "-o", "out", *TREE, "--budget", "1s") == 0
    said = "neither baseline nor candidate was finished on 5 folds within the time"
    assert said in capsys.readouterr().err
    assert run("show", "out", "--no-pictures") == 0
    assert said in capsys.readouterr().out


@pytest.mark.usefixtures("few")
def test_a_baseline_beside_which_nothing_was_judged_is_not_said_to_be_better(
    work, monkeypatch, capsys
):
    monkeypatch.setattr(GridSearch, "tasks", lambda *arguments: [])
    assert run("tune", "database.h5", "-o", "out", *TREE, "--budget", "1h") == 0
    said = "Decision Tree: the baseline stays, no candidate was finished on five folds"
    shown = capsys.readouterr()
    assert said in shown.out
    assert said in shown.err
    (found,) = table("out/area/tuning.csv")
    assert (found["winner"], found["grid_r2"], found["candidates_scored"]) == ("baseline", "", "0")


@pytest.mark.usefixtures("few")
def test_a_search_within_a_time_goes_on_where_it_was_and_decides_alike(work, monkeypatch, capsys):
    from learn.comparison.search.trials import Trials

    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    monkeypatch.setitem(budget.GROWTH, "decision-tree", 99.0)
    arguments = ["tune", "database.h5", *TREE, "--budget", "1h"]
    assert run(*arguments, "-o", "whole") == 0
    add, left = Trials.add, [40]

    def until_killed(self, trials):
        add(self, trials)
        left[0] -= 1
        if not left[0]:
            raise KeyboardInterrupt

    monkeypatch.setattr(Trials, "add", until_killed)
    assert run(*arguments, "-o", "cut") != 0
    monkeypatch.setattr(Trials, "add", add)
    assert not (work / "cut/area/tuned").exists()
    assert run(*arguments, "-o", "cut") == 0
    for name in ("scores.csv", "tuning.csv", "tuned/decision-tree-grid.csv"):
        assert (work / "cut/area" / name).read_bytes() == (work / "whole/area" / name).read_bytes()


def aged(folder):
    """Make a comparison what it was before: a winner of few rows, rows without their surfaces."""
    path = folder / "tuned/decision-tree.json"
    result = json.loads(path.read_text())
    for name in ("winner", "grid_r2_folds", "optimum_r2_folds", "baseline_r2_folds"):
        del result["search"][name]
    result["search"]["how"] = "successive halving: 110 candidates on 24 rows, 1 fold"
    path.write_text(json.dumps(result | {"refit": {}}))
    rows = [line.rpartition(",")[0] for line in (folder / "rows.csv").read_text().splitlines()]
    (folder / "rows.csv").write_text("\n".join(rows) + "\n")


@pytest.mark.usefixtures("few")
def test_older_folders_are_shown_with_the_commands_that_make_them_anew(work, capsys):
    assert run("tune", "database.h5", "-o", "out", *TREE) == 0
    shutil.copytree(work / "out", work / "new")
    aged(work / "out/area")
    capsys.readouterr()
    assert run("show", "out") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "chosen before baselines were judged beside a search (decision-tree)" in said
    assert "learn tune DATABASE -o out --model decision-tree decides anew" in said
    assert "names no surfaces: " in said
    assert "learn compare DATABASE -o out" in said
    (row,) = table("out/area/scores.csv")
    assert (row["winner"], row["r2_low"]) == ("", "")
    assert float(row["variance_over_mean"]) > 0
    assert run("tune", "database.h5", "-o", "out", *TREE) == 0
    assert "60 fits, 0 to do, 0 of the baseline" in capsys.readouterr().err
    for name in ("rows.csv", "scores.csv", "tuning.csv"):
        assert (work / "out/area" / name).read_bytes() == (work / "new/area" / name).read_bytes()


def test_boosting_that_a_search_cannot_serve_is_one_line_and_code_2(work, capsys, monkeypatch):
    space = {"booster": ["gbtree", "dart"], "n_estimators": [10, 50]}
    monkeypatch.setitem(spaces.SPACES, "xgboost", space)
    for verb in ("tune", "estimate"):
        assert run(verb, "database.h5", "-o", "out", "--model", "xgboost") == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "xgboost: booster='dart' cannot be searched" in said
        assert not (work / "out").exists()


def test_perceptrons_are_scored_as_they_are_fitted_in_the_end(work, monkeypatch):
    """Search and last fit build the same estimator: epochs, seed, early stopping."""
    from sklearn.neural_network import MLPRegressor

    fit, seen = MLPRegressor.fit, []

    def watched(self, inputs, target):
        seen.append((len(target), self.get_params()))
        return fit(self, inputs, target)

    monkeypatch.setattr(MLPRegressor, "fit", watched)
    monkeypatch.setattr(timing, "FITS", (1, 1))
    space = {"hidden_layer_sizes": [(5,)], "solver": ["lbfgs"], "tol": [1e-2]}
    monkeypatch.setitem(spaces.SPACES, "mlp", space)
    assert run("tune", "database.h5", "-o", "out", "--model", "mlp", "--seed", "3") == 0
    (found,) = table("out/area/tuning.csv")
    assert found["winner"] == "grid"
    searched = [params for rows, params in seen if rows < 72 and params["solver"] == "lbfgs"]
    refitted = [params for rows, params in seen if rows == 72]
    assert len(searched) == 5
    assert all(params == searched[0] for params in [*searched, *refitted])
    assert (searched[0]["max_iter"], searched[0]["random_state"]) == (20_000, 3)
