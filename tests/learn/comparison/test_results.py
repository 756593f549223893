"""What decides a search: five folds of all rows, beside the baseline, which may win."""

import json

import pytest
from comparisons import run, table

from learn import Surrogate
from learn.comparison import paper, results, search
from learn.comparison.folder import Folder

TREE = ["--model", "decision-tree"]
STUMPS = {"max_depth": [1, 2], "min_samples_leaf": [30]}
"""Trees that the library's own outdoes."""


@pytest.fixture
def stumps(monkeypatch):
    """A grid of trees that the baseline outdoes, in place of Table 2's."""
    monkeypatch.setitem(paper.SPACES, "decision-tree", STUMPS)


@pytest.mark.usefixtures("stumps")
@pytest.mark.parametrize("limit", [[], ["--budget", "1h"]])
def test_where_the_baseline_wins_every_table_and_picture_names_it(work, limit, capsys, monkeypatch):
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
    monkeypatch.setattr(results, "FITS", (1, 1))
    space = {"hidden_layer_sizes": [(5,)], "solver": ["lbfgs"], "tol": [1e-2]}
    monkeypatch.setitem(paper.SPACES, "mlp", space)
    assert run("tune", "database.h5", "-o", "out", "--model", "mlp", "--seed", "3") == 0
    (found,) = table("out/area/tuning.csv")
    assert found["winner"] == "grid"
    searched = [params for rows, params in seen if rows < 72 and params["solver"] == "lbfgs"]
    refitted = [params for rows, params in seen if rows == 72]
    assert len(searched) == 5
    assert all(params == searched[0] for params in [*searched, *refitted])
    assert (searched[0]["max_iter"], searched[0]["random_state"]) == (20_000, 3)
