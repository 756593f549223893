"""The ranking of inputs, and fits without the weakest."""

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
