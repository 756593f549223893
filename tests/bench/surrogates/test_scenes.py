"""Reports on surrogates of generated scenes: own numbers, mixed grids, windows of maps."""

import numpy as np
import pytest

from bench.made_maps import MAPS
from bench.surrogates import mixed
from bench.surrogates import scans as study
from bench.surrogates.scans import Judged
from bench.surrogates.scenes import SCENES, scene_surrogate, solved
from gen.database import Reader
from gen.scene import Scene


@pytest.mark.long
def test_every_scene_is_judged_by_fresh_surfaces(tmp_path):
    report = scene_surrogate(tmp_path, 160, 3, 4)
    rows = report.tables["scene-surrogate"]
    assert [(row["scene"], row["target"]) for row in rows[::2]] == [
        (name, "area") for name in SCENES
    ]
    for row in rows:
        assert row["nmae"] > 0
        assert 0 <= row["inside"] <= 1
        assert row["mean_width"] < row["width"]
    models = {row["model"] for row in report.tables["scene-models"]}
    assert models == {"population", "kernel-ridge", "gaussian-process"}


@pytest.mark.long
def test_the_same_numbers_are_asked_and_solved():
    scene = Scene.parse(f"samples = 8\n{SCENES['spectral']}", "scene")
    names = "hurst", "rms_height", "roll_off", "hardness", "pressure"
    asked, truth = solved(scene, names, 2, 2)
    assert tuple(asked) == names
    assert truth["area_percent"].shape == (2, 2)
    patch = float(np.prod(scene.sides))
    assert truth["force"][:, 0] == pytest.approx(asked["pressure"] * patch, rel=1e-6)


@pytest.mark.long
def test_every_set_of_grids_is_judged_with_both_areas(tmp_path, monkeypatch):
    monkeypatch.setattr(mixed, "GRIDS", (17, 33, 65))
    rows = mixed.mixed(tmp_path, 50)
    of_scene = [
        (row["trained_on"], row["judged_on"])
        for row in rows
        if row["features"] == "scene"
    ]
    every = "17 33 65"
    assert of_scene == [
        *(("17", "17"), ("33", "33"), ("65", "65")),
        *((every, "17"), (every, "33"), (every, "65"), ("17 33", "65")),
    ]
    unseen = {row["features"]: row for row in rows if row["trained_on"] == "17 33"}
    assert (
        unseen["hybrid"]["continuum_nmae_percent"]
        < unseen["scene"]["continuum_nmae_percent"]
    )
    biased = unseen["scene"]
    assert biased["count_bias_percent"] > biased["continuum_bias_percent"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with the study of few small windows, and what it found."""
    folder = tmp_path_factory.mktemp("scans")
    with pytest.MonkeyPatch.context() as few:
        few.setattr(study, "ONE_INSTRUMENT", [each for each in MAPS if each.number == 0])
        found = []
        few.setattr(study, "picture", found.extend)
        study.scans(folder, 200, [32], 0)
        return folder, found


@pytest.mark.long
def test_every_row_is_judged_once_by_surrogates_of_the_others(made):
    folder, (tiles, maps) = made
    assert (tiles.left_out, maps.left_out) == ("unseen tiles", "maps left out")
    with Reader(folder / "databases" / "windows-32.h5") as reader:
        area, tile, index = (
            reader.column(name) for name in ("area_percent", "tile", "map")
        )
    assert np.array_equal(tiles.truth, maps.truth)
    assert set(tiles.truth) <= set(area)
    request = study.request_for(
        folder / "databases/windows-32.h5", "kernel-ridge", "hybrid", None
    )
    rows = study.read(request)
    for by_map in (False, True):
        tested = list(study._tests(rows, index[rows.rows], by_map=by_map))
        assert np.array_equal(np.sort(np.concatenate(tested)), np.arange(rows.size))
        for test in tested:
            kept = np.setdiff1d(np.arange(rows.size), test)
            train, folds = study._ordered(rows, kept)
            places = [set(tile[rows.rows[part]]) for part in (test, train)]
            assert not places[0] & places[1]
            assert np.array_equal(np.sort(train), kept)
            for tiled in np.unique(rows.groups[train]):
                assert np.unique(folds[rows.groups[train] == tiled]).size == 1
            assert set(folds) == set(range(study.FOLDS))
            if by_map:
                assert np.unique(index[rows.rows[test]]).size == 1


@pytest.mark.long
def test_scores_are_those_of_the_rows():
    truth = np.array([1.0, 4.0, 9.0, 16.0])
    root = np.array([1.1, 2.1, 3.15, 4.25])  # off by 1, 1, 1.5 and 2.5 half widths
    low, high = (root - 0.1) ** 2, (root + 0.1) ** 2
    low[:2] -= 1e-9
    flagged = np.array([1, 0, 1, 0], dtype=bool)
    maps = np.array([0, 0, 1, 1])
    judged = Judged(
        9, "maps left out", maps, ("a", "b"), truth, root**2, low, high, flagged
    )
    row, first, second = judged.rows()
    assert row["nmae"] == pytest.approx(
        100 * np.abs(root**2 - truth).mean() / truth.mean()
    )
    assert (row["covered"], row["flagged"], row["covered_unflagged"]) == (0.5, 0.5, 0.5)
    assert row["width"] == pytest.approx(0.4 * root.mean())
    assert row["outside_flagged"] == 0.5
    assert (row["wrong"], row["wrong_flagged"]) == (1, 0.0)
    assert np.isnan(first["wrong_flagged"]), "nothing is wrong"
    assert second["covered"] == 0.0
