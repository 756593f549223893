"""Errors of models against their times: read from a comparison, the front marked."""

from pathlib import Path

import pytest

from bench.__main__ import main
from bench.surrogates.models import models
from gen.runtime.errors import InputError


@pytest.fixture
def comparison(tmp_path: Path) -> Path:
    """Three models as `learn show` writes them: one tuned too, one failed."""
    folder = tmp_path / "comparison" / "area"
    folder.mkdir(parents=True)
    (folder / "scores.csv").write_text(
        "model,result,nmae,r2,failure\n"
        "decision-tree,baseline,15,92,\n"
        "kernel-ridge,baseline,27,80,\n"
        "kernel-ridge,tuned,4,99,\n"
        "svm,baseline,,,no memory\n"
    )
    (folder / "times.csv").write_text(
        "model,result,fit_s,fits,predict_test_s,predict_row_s\n"
        "decision-tree,baseline,1,3,1,0.001\n"
        "kernel-ridge,baseline,20,3,1,0.002\n"
        "kernel-ridge,tuned,10,3,1,0.003\n"
    )
    (folder / "tuning-times.csv").write_text("model,fit_seconds,paper_s\nkernel-ridge,500,2599\n")
    return folder.parent


def test_errors_and_times_are_those_of_the_comparison(comparison: Path) -> None:
    tree, untuned, tuned = models(comparison)
    assert tree["model"] == "decision-tree"
    assert (tree["nmae"], tree["fit_s"], tree["search_s"]) == (15, 1, None)
    assert (tuned["result"], tuned["search_s"], tuned["predict_s"]) == ("tuned", 500, 0.003)
    fronts = [each["front"] for each in (tree, untuned, tuned)]
    assert fronts == ["predict fit", "", "predict fit search"]


def test_what_is_no_comparison_is_refused(
    tmp_path: Path, comparison: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["models", str(tmp_path), "-o", str(tmp_path)]) == 2
    assert "give a folder of learn compare or learn tune" in capfd.readouterr().err
    (comparison / "area" / "times.csv").write_text("model,result\n")
    with pytest.raises(InputError, match="no scores and times of area"):
        models(comparison)
