"""The picture of a database: the sample with the median area, and its titles."""

from pathlib import Path

import numpy as np
import pytest

from gen import cli
from gen.database import Reader

pytest.importorskip("matplotlib", reason="needs the extra plot")

from gen import picture


@pytest.mark.parametrize("hardness", ["", "hardness = [0.01, 0.05]", "hardness_ratio = 0.03"])
def test_a_database_shows_its_median_area(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hardness: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text(f"samples = 15\n[surface]\nnodes = 17\n[contact]\n{hardness}")
    assert cli.main(["run", "small.toml", "-o", "small.h5"]) == 0
    figures = []
    monkeypatch.setattr(picture, "save", lambda figure, _: figures.append(figure))
    assert cli.main(["plot", "small.h5", "-o", "small.png"]) == 0
    with Reader(Path("small.h5")) as reader:
        areas = reader.column("area_percent")
    (figure,) = figures
    assert figure.get_suptitle() == "small.h5"
    titles = [" ".join(axis.get_title(loc="left").split()) for axis in figure.axes]
    (title,) = (title for title in titles if title.startswith("contact at"))
    assert f"{np.median(areas):.3g} % of 289 nodes, the median of rows done" in title
    assert ("hardness 0.0" in title) == ("% yielded (cyan)" in title) == bool(hardness)


def test_times_beyond_the_picture_are_counted() -> None:
    axis = picture.new_figure(4, 3, dpi=50).subplots()
    seconds = np.append(np.full(300, 0.01), [0.5, 0.7, np.nan])
    columns = {"solve_seconds": seconds, "area_percent": np.linspace(0, 9, seconds.size)}
    picture._draw_times(axis, columns)
    (note,) = axis.texts
    assert note.get_text() == "2 above, up to 700 ms"
    assert axis.get_ylim()[1] < 500
