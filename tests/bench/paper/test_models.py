"""The nine models beside the paper's: what separates them, and pictures of what there is."""

import learn.cli
from bench.paper import models
from bench.paper.facts import why
from learn.metrics import Scores


def test_why_says_what_is_known():
    alike = models._why(Scores(1.16, 3.07, 9.84, 99.52), 1.2, 3.6)
    assert alike == "R2 alike; nMSE x 1.5 by the areas' spread"
    assert models._why(Scores(16.71, 12.8, 25.03, 90.71), 2.7, 3.6) == (
        f"worse R2: not explained; {why('two-spreads')}"
    )


def test_without_a_comparison_search_spaces_are_shown_alone(tmp_path):
    (table,) = models.table_2(tmp_path)
    assert "Not searched here: Decision Tree" in table.caption


def test_kinds_that_were_not_made_are_left_out(preset, tmp_path):
    compared = [str(preset), "-o", str(tmp_path / "one"), "--area-max", "60"]
    assert learn.cli.main(["compare", *compared, "--model", "decision-tree"]) == 0
    assert models.tuned(tmp_path, tmp_path / "one") == []
    drawn, _ = models.baselines(tmp_path, tmp_path / "one")
    assert "The closest of these here: Decision Tree" in drawn.caption
