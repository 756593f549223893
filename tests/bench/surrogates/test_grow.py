"""Growths to an error beside the truth."""

import numpy as np
import pytest

from bench.report import part_of
from bench.surrogates import grow as study
from bench.surrogates.grow import Population, grow
from gen.database import Reader
from gen.runtime.errors import InputError
from learn.grow.accuracy import SHARE, drawn_for_holdout
from learn.split import TILE

SMALL = "[surface]\nnodes = 17\n"


def test_too_few_fresh_rows_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"--fresh 19: give 20 or more"):
        grow(tmp_path, 19, 1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("grow")


@pytest.fixture(scope="module")
def report(folder):
    """A growth of a small scene and one of windows of the made maps, to large errors."""
    windows = study.POPULATIONS[1].scene.replace("nodes = 64", "nodes = 16")
    populations = (
        Population(name="small", scene=SMALL, mark=40.0, first_seed=5),
        Population(name="maps", scene=windows, mark=60.0, first_seed=5),
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "POPULATIONS", populations)
        return grow(folder, 60, 1)


@pytest.mark.long
def test_each_growth_is_judged_on_fresh_surfaces(report, tmp_path):
    rows = report.tables["grow"]
    assert [(row["population"], row["target"]) for row in rows] == [
        ("small", "area"),
        ("small", "force"),
        ("maps", "area"),
        ("maps", "force"),
    ]
    for row in rows:
        assert row["ending"] == "met"
        assert row["nmae"] <= row["at_most"] <= row["asked"]
        assert 0 < row["fresh_nmae"] < 2 * row["asked"]
    assert rows[0]["fresh_surfaces"] == 60
    assert rows[2]["fresh_surfaces"] < 60  # tiles that the growth has held out
    paths = report.write(tmp_path, part_of("grow").contents)
    assert [path.name for path in paths] == ["grow.csv", "small.png", "maps.png"]


@pytest.mark.long
def test_rows_in_tiles_that_train_do_not_judge(report, folder):
    with Reader(folder / "databases" / "maps-fresh.h5") as reader:
        tiles = np.asarray(reader.column(TILE), dtype=np.int64)
        scene = reader.scene
    length = min(SHARE, scene.surface.tile_groups())
    held_out = set(tiles[drawn_for_holdout(tiles, 5, length)])
    assert 0 < len(held_out) < len(set(tiles))
    # The number of judging tiles; some windows are not usable.
    assert 0 < report.tables["grow"][2]["fresh_surfaces"] <= len(held_out)
