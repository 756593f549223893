"""The ranking of inputs, fits without the weakest, and two models with equal kernels."""

import pytest
from comparisons import run, table


def test_importance_drops_the_weakest(work):
    assert run("importance", "database.h5", "-o", "out") == 0
    ranked = table("out/area/importance.csv")
    assert len(ranked) == 23
    losses = [float(row["r2_loss_percent"]) for row in ranked]
    assert losses == sorted(losses, reverse=True)
    assert ranked[0]["input"] in {"delta", "height_max", "height_mean"}
    kept = table("out/area/selection.csv")
    assert [row["inputs"] for row in kept][:2] == ["23", "20"]
    assert kept[1]["dropped"].split()[-1] in {row["input"] for row in ranked[-3:]}
    assert (work / "out/area/importance.png").read_bytes().startswith(b"\x89PNG")


def test_appendix_a_holds_for_both_of_its_cases(work):
    assert run("appendix", "database.h5", "-o", "out") == 0
    first, second = table("out/area/appendix.csv")
    # Case 1 is conditioned like 1e12: the tolerance is what double precision leaves.
    assert float(first["largest_difference"]) < 1e-5
    assert float(second["largest_difference"]) < 1e-10
    assert float(first["gp_r2"]) > float(second["gp_r2"])
    assert float(first["gp_r2"]) == pytest.approx(float(first["ridge_r2"]), abs=1e-3)
    assert (work / "out/area/appendix.png").read_bytes().startswith(b"\x89PNG")
