"""`gen check` finds what was spoilt, and nothing in a sound file."""

import shutil

import h5py
import numpy as np
import pytest

from gen import cli
from gen.generation.check import faults

SCENE = "samples = 20\nsamples_per_surface = 3\n[surface]\nnodes = 17\n[store]\npressure = true\n"


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A database of the scene, computed once."""
    folder = tmp_path_factory.mktemp("solved")
    (folder / "scene.toml").write_text(SCENE)
    assert cli.main(["run", str(folder / "scene.toml"), "-o", str(folder / "rows.h5")]) == 0
    return folder / "rows.h5"


@pytest.fixture
def database(solved, tmp_path, monkeypatch):
    """A copy that a test may spoil."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE)
    return shutil.copy(solved, tmp_path / "rows.h5")


def spoil(path, column, row, value):
    with h5py.File(path, "r+") as file:
        file[column][row] = value


def test_a_sound_database_has_no_faults(database, capsys):
    assert list(faults(database, recompute=20)) == []
    assert cli.main(["check", "rows.h5"]) == 0
    assert "sound" in capsys.readouterr().out


def test_pending_rows_are_no_faults(database, capsys):
    assert cli.main(["run", "scene.toml", "-o", "part.h5", "--rows", "0:9"]) == 0
    assert list(faults(database.with_name("part.h5"), recompute=20)) == []


@pytest.mark.parametrize(
    ("column", "value", "fault"),
    [
        ("status", 7, "status"),
        ("reason", 1, "reason"),
        ("surface", 99, "surface"),
        ("hurst", 0.51, "hurst"),
        ("delta", 7.0, "delta"),
        ("peak_mean", np.nan, "peak_mean is not finite"),
        ("area_percent", 100.5, "area"),
        ("area_percent", 3.0, "share of contact nodes"),
        ("force", -1.0, "force is negative"),
        ("force", 0.0, "force"),
        ("residual", 0.5, "residual"),
    ],
)
def test_a_spoilt_value_is_found_without_recomputing(database, capsys, column, value, fault):
    spoil(database, column, 4, value)
    found = list(faults(database, recompute=0))
    assert found
    assert all(line.startswith("row 4") for line in found)
    assert any(fault in line for line in found)
    assert cli.main(["check", "rows.h5"]) == 1
    assert fault in capsys.readouterr().out


@pytest.mark.parametrize("column", ["height_mean", "iterations", "pressure"])
def test_a_changed_bit_is_found_by_recomputing(database, column):
    with h5py.File(database, "r+") as file:
        value = file[column][4]
        file[column][4] = value + 1 if column == "iterations" else np.nextafter(value, np.inf)
    assert list(faults(database, recompute=0)) == []
    found = list(faults(database, recompute=20))
    assert len(found) == 1
    assert column in found[0]


@pytest.fixture
def yielding(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = "samples = 12\n[surface]\nnodes = 17\n[contact]\nhardness = [0.01, 0.05]\n"
    (tmp_path / "scene.toml").write_text(text)
    assert cli.main(["run", "scene.toml", "-o", "rows.h5"]) == 0
    return tmp_path / "rows.h5"


def test_a_sound_database_of_bodies_that_yield_has_no_faults(yielding):
    assert list(faults(yielding, recompute=12)) == []


@pytest.mark.parametrize(
    ("column", "value", "fault"),
    [
        ("hardness", 0.02, "hardness is not the plan's"),
        ("yielded_percent", 99.0, "more nodes have yielded than are in contact"),
        ("yielded_percent", -1.0, "more nodes have yielded"),
        ("force", 1e9, "force above what the hardness bears"),
    ],
)
def test_a_spoilt_value_of_a_body_that_yields_is_found(yielding, column, value, fault):
    spoil(yielding, column, 4, value)
    lines = list(faults(yielding, recompute=0))
    assert lines
    assert all(line.startswith("row 4") for line in lines)
    assert any(fault in line for line in lines)


def test_failed_rows_need_a_reason(database):
    spoil(database, "status", 4, 2)
    assert list(faults(database, recompute=0)) == ["row 4: failed without a known reason"]


def test_the_same_seed_chooses_the_same_rows(database, monkeypatch):
    import gen.generation.check

    chosen = []
    monkeypatch.setattr(
        gen.generation.check,
        "_recomputed_faults",
        lambda reader, row: chosen.append(row) or iter(()),
    )
    for seed in (1, 1, 2):
        list(faults(database, recompute=5, seed=seed))
    assert chosen[:5] == chosen[5:10] != chosen[10:]


def test_a_database_of_patches_without_edges_is_checked_like_any_other(folder_of_cells, capsys):
    assert list(faults(folder_of_cells / "rows.h5", recompute=12)) == []
    with h5py.File(folder_of_cells / "rows.h5", "r+") as file:
        assert file["pressure"].shape == (12, 16, 16)
        file["pressure"][3] = 0.0
    (fault,) = faults(folder_of_cells / "rows.h5", recompute=12)
    assert "row 3: pressure" in fault


@pytest.fixture
def folder_of_cells(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = "samples = 12\n[surface]\nnodes = 17\n[contact]\nboundary = 'mirror'\n"
    text += "[delta]\npieces = [{share = 1.0, range = [0.5, 4.0]}]\n[store]\npressure = true\n"
    (tmp_path / "scene.toml").write_text(text)
    assert cli.main(["run", "scene.toml", "-o", "rows.h5"]) == 0
    return tmp_path
