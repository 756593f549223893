"""Databases that results rest on are generated once and summarised."""

from pathlib import Path

import pytest

from bench.databases import all_of_them, outputs, shipped, summaries
from bench.files import read_table
from gen.scene import flags


def test_all_databases_are_summarised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small = "\n[surface]\nnodes = 9\n"
    monkeypatch.setattr("bench.databases.shipped", lambda _, rows: f"samples = {rows}{small}")
    paths = all_of_them(tmp_path / "databases", None, 6)
    before = [path.stat().st_mtime_ns for path in paths]
    assert all_of_them(tmp_path / "databases", None, 6) == paths
    assert [path.stat().st_mtime_ns for path in paths] == before
    summaries(tmp_path / "databases", None, 6).write(tmp_path)
    rows = read_table(tmp_path / "databases.csv")[1]
    assert [row["scene"] for row in rows] == ["paper", "fine", "paper-mirco", "concentrated"]
    assert all(int(row["done"]) == int(row["rows"]) == 6 for row in rows)
    told = (tmp_path / "databases.txt").read_text()
    assert told.count("6 done, 0 failed, 0 pending") == 4


def test_a_shipped_scene_has_other_rows_if_they_are_given() -> None:
    assert "\nsamples = 800 " in shipped("fine")
    assert "\nsamples = 12 " in shipped("fine", 12)


def test_every_optional_output_has_its_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.databases.SAMPLES", 2)
    rows = outputs("quick", 1)
    assert [row["column"] for row in rows] == list(flags())
    assert all(row["ratio"] > 0 and row["bytes"] > 0 for row in rows)
