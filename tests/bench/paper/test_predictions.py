"""The models in pictures: only those that a comparison has."""

import learn.cli
from bench.paper import predictions


def test_kinds_that_were_not_made_are_left_out(preset, tmp_path):
    compared = [str(preset), "-o", str(tmp_path / "one"), "--area-max", "60"]
    assert learn.cli.main(["compare", *compared, "--model", "decision-tree"]) == 0
    assert predictions.tuned(tmp_path, tmp_path / "one") == []
    drawn, _ = predictions.baselines(tmp_path, tmp_path / "one")
    assert "The closest of these here: Decision Tree" in drawn.caption
