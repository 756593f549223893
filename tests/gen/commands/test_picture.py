"""The picture of a database: the sample with the median area, and its titles."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gen import cli
from gen.database import Reader

pytest.importorskip("matplotlib", reason="needs the extra plot")

from gen.commands import picture


def drawn(monkeypatch: pytest.MonkeyPatch, folder: Path, scene: str) -> Any:
    """Run a scene and return the figure that `gen plot` makes of its database, small.h5."""
    monkeypatch.chdir(folder)
    Path("small.toml").write_text(scene)
    assert cli.main(["run", "small.toml", "-o", "small.h5"]) == 0
    figures = []
    monkeypatch.setattr(picture, "save", lambda figure, _: figures.append(figure))
    assert cli.main(["plot", "small.h5", "-o", "small.png"]) == 0
    return figures[0]


@pytest.mark.parametrize("hardness", ["", "hardness = [0.01, 0.05]"])
def test_a_database_shows_its_median_area(tmp_path, monkeypatch, hardness):
    scene = f"samples = 15\n[surface]\nnodes = 17\n[contact]\n{hardness}"
    figure = drawn(monkeypatch, tmp_path, scene)
    with Reader(Path("small.h5")) as reader:
        areas = reader.column("area_percent")
    assert figure.get_suptitle() == "small.h5"
    titles = [" ".join(axis.get_title(loc="left").split()) for axis in figure.axes]
    (title,) = (title for title in titles if title.startswith("contact at"))
    assert f"{np.median(areas):.3g} % of 289 nodes, the median of rows done" in title
    assert ("hardness" in title) == ("% yielded (cyan)" in title) == bool(hardness)


@pytest.mark.parametrize(
    ("load", "quantity", "label"),
    [
        ('quantity = "force"\nrange = [1.0, 2000.0]', "force", "normal force [µN]"),
    ],
)
def test_areas_stand_over_the_load_that_was_drawn(tmp_path, monkeypatch, load, quantity, label):
    bodies = "[contact]\nmodulus = 2e5\nhardness = 2000.0"
    scene = f"samples = 6\n[surface]\nnodes = 17\n[load]\n{load}\n{bodies}"
    figure = drawn(monkeypatch, tmp_path, scene)
    areas = next(axis for axis in figure.axes if axis.get_title() == "6 samples")
    assert areas.get_xlabel() == label
    loads = areas.collections[0].get_offsets()[:, 0]
    with Reader(Path("small.h5")) as reader:
        forces, deltas = reader.column("force"), reader.column("delta")
    patch = (17 * 1000.0 / 16) ** 2
    expected = {"pressure": forces / patch, "force": forces, "delta": deltas}[quantity]
    np.testing.assert_allclose(loads, expected)
    titles = [" ".join(axis.get_title(loc="left").split()) for axis in figure.axes]
    (title,) = (title for title in titles if title.startswith("contact at"))
    said = {"pressure": "Pa mean pressure, E*", "force": "N, E*", "delta": "m, E*"}[quantity]
    assert said in title
    assert "E* = 200 GPa, hardness 2 GPa" in title
