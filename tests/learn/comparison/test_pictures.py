"""Scores whose bars differ, and predictions none of which hides another."""

import csv
from pathlib import Path

import pytest

from learn.cli import main

pytest.importorskip("matplotlib", reason="needs the extra plot")

from learn.comparison import pictures
from learn.comparison.folder import Folder


def test_r2_is_drawn_as_what_is_left_of_it_and_baselines_as_circles(work, monkeypatch):
    chosen = ["--model", "kernel-ridge"]
    for command in ("compare", "tune"):
        assert main([command, "database.h5", "-o", "out", *chosen]) == 0
    figures = {}
    monkeypatch.setattr(
        pictures, "save", lambda figure, path: figures.setdefault(path.name, figure)
    )
    pictures.draw(Folder(Path("out/area")))
    left = next(axis for axis in figures["scores.png"].axes if axis.get_ylabel() == "1 - R2 [%]")
    assert left.get_yscale() == "log"
    with Path("out/area/scores.csv").open(encoding="utf-8") as file:
        r2 = [float(row["r2"]) for row in csv.DictReader(file)]
    assert [bar.get_height() for bar in left.patches] == pytest.approx([100 - each for each in r2])
    parity = figures["parity.png"].axes[0]
    line, baseline, tuned = parity.lines
    assert baseline.get_markerfacecolor() == "none"
    assert baseline.get_markersize() > tuned.get_markersize()
    assert len(baseline.get_xdata()) == len(tuned.get_xdata()) == 18
    assert list(line.get_xdata()) == list(line.get_ydata())
