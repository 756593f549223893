"""The report has both tables beside the paper's, and what is fair."""

import csv
from pathlib import Path

import pytest

from bench.__main__ import main
from bench.page.parts import contents_of
from bench.paper.nearest import cases, population, report, search
from learn.models import MODELS

FEW = {name: MODELS[name] for name in ("decision-tree", "kernel-ridge")}


def test_report_has_both_tables_beside_the_papers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    for module in (cases, report, search):
        monkeypatch.setattr(module, "MODELS", FEW)
    monkeypatch.setattr(search, "QUICK", dict.fromkeys(FEW))
    monkeypatch.setattr(population, "CHUNK", 10)
    arguments = ["nearest", "-o", str(tmp_path), "--rows", "100", "--minutes", "0"]
    assert main([*arguments, "--surfaces", "10"]) == 0
    assert len(capfd.readouterr().out.splitlines()) == 5
    tables = {}
    for name in ("baselines", "costs", "ranges", "search", "finalists"):
        with (tmp_path / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            tables[name] = list(csv.DictReader(file))
    assert [row["model"] for row in tables["baselines"]] == [each.title for each in FEW.values()]
    assert tables["baselines"][0]["paper_nmse"] == "8.99"
    assert len(tables["costs"]) == 5
    assert len(tables["ranges"]) == 25
    assert sum(row["counts"] == "yes" for row in tables["ranges"]) == 23
    assert len(tables["search"]) == 3
    assert len(tables["finalists"]) == 1
    assert (tmp_path / "nearest.png").read_bytes().startswith(b"\x89PNG")
    assert len(contents_of("paper/nearest", tmp_path)) == 6


def test_other_numbers_of_surfaces_are_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["nearest", "-o", str(tmp_path), "--surfaces", "51"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "multiple of 50" in line
