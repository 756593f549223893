"""What a whole grid takes, on fits whose times are known exactly, and by the command."""

import pytest
from comparisons import run, table

from learn.comparison import grid as grids
from learn.comparison import search as searches
from learn.comparison.estimate import cost, draw
from learn.comparison.fits import Trial
from learn.comparison.grid import Task, expected_work
from learn.split import FOLDS

SPACE = {"max_depth": [2, 5, 9], "min_samples_leaf": [1, 4], "max_features": [1.0, 0.5]}


def add(search, places, rows, rate):
    """Finish fits that take `rate` seconds for a unit of work."""
    for family, fold in places:
        settings = search.grid.served_by(family)
        seconds = rate * expected_work(Task(search.model.name, settings, 0, rows))
        for each in settings:
            named = {"candidate": grids.key(each), "fold": fold, "rows": rows, "r2": 0.5}
            search.trials.add([Trial(**named, seconds=seconds / len(settings))])


def test_the_estimate_is_exact_where_times_follow_the_expected_work(searching, monkeypatch):
    monkeypatch.setattr(searches, "LEAST_ROWS", 20)  # rungs of 26 and of all 80 rows
    search = searching("decision-tree", SPACE)
    drawn = draw(search)
    assert sorted(drawn) == [(f, k) for f in range(len(search.grid.families)) for k in range(FOLDS)]
    assert cost(search) is None
    add(search, drawn[-9:], 80, 1e-9)  # what a search picked by its scores does not count
    add(search, drawn[:7], 26, 1e-6)
    few = cost(search)
    assert (few.fits, few.of, few.rows, few.error) == (0, search.fits, 26, None)
    add(search, drawn[:3], 80, 2e-6)
    assert cost(search).rows == 26, "three fits of all rows say less"
    add(search, drawn[:6], 80, 2e-6)
    some = cost(search)
    assert (some.fits, some.rows) == (6, 80)
    add(search, drawn, 80, 2e-6)
    whole = cost(search)
    assert whole.fits == whole.of
    assert whole.error == 0
    taken = sum(trial.seconds for (*_, n), trial in search.trials.finished.items() if n == 80)
    assert whole.seconds == pytest.approx(taken, rel=1e-9)
    assert some.seconds == pytest.approx(taken, rel=1e-9)
    assert some.error == pytest.approx(0, abs=1e-9 * taken)


def test_the_command_says_which_fits_ended_and_keeps_them(work, capsys, monkeypatch):
    def within(fit, training, task, *_):
        """Perceptrons take longer than the time, all others none."""
        return None if task.model == "mlp" else fit(training, task)

    monkeypatch.setattr(searches, "within", within)
    models = ["--model", "mlp", "--model", "decision-tree", "--model", "kernel-ridge"]
    assert run("estimate", "database.h5", "-o", "out", *models, "--budget", "1d") == 0
    said = capsys.readouterr().out
    assert "Whole grids" in said
    assert "MLP Regressor: too few fits" in said
    tree, ridge = table("out/area/whole-grids.csv")
    assert [tree["model"], ridge["model"]] == ["decision-tree", "kernel-ridge"]
    assert (tree["of"], ridge["of"]) == ("555", "60")
    assert float(tree["seconds"]) > 0
    trials = (work / "out/area/trials/decision-tree.jsonl").read_text(encoding="utf-8")
    assert len(trials.splitlines()) > 40, "fits of all rows, which a search need not repeat"
