"""The cases differ from the shipped scene in what they say."""

from pathlib import Path

import pytest

from bench.databases import generated
from bench.paper.facts import AREA_MAX
from bench.paper.nearest import cases
from bench.paper.nearest.cases import CASES, LINES, NEAREST, measure, read, scene_of
from gen.scene import Scene, differences, load


def test_databases_differ_from_the_shipped_scene_in_one_line() -> None:
    shipped = load(NEAREST)
    made = {name: Scene.parse(scene_of(name, 77), name) for name in LINES}
    assert {scene.samples for scene in made.values()} == {77}
    assert made["as shipped"].fingerprint() == shipped.fingerprint()
    assert differences(shipped, made["10 loads a surface"]) == [
        "samples_per_surface: 1 in the file, 10 asked for"
    ]
    assert differences(shipped, made["Hurst exponents of 0.5 to 0.8"]) == [
        "surface.hurst[1]: 0.6 in the file, 0.8 asked for"
    ]
    assert differences(shipped, made["uniform pressure"]) == [
        "contact.kernel: 'concentrated-force' in the file, 'uniform-pressure' asked for"
    ]
    assert CASES[0] == ("as shipped", "surfaces")
    assert {case.database for case in CASES} == set(LINES)


def test_scores_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cases, "MODELS", ["decision-tree", "kernel-ridge"])
    scores, databases = measure(tmp_path, 60)
    assert len(scores) == 10
    assert len({row["r2"] for row in scores if row["model"] == "kernel-ridge"}) == 5
    monkeypatch.setattr(cases, "baseline", None)
    again, _ = measure(tmp_path, 60)
    assert [float(row["nmse"]) for row in again] == [row["nmse"] for row in scores]
    assert databases["as shipped"].target.max() <= AREA_MAX


def test_rows_above_the_papers_largest_area_are_left_out(tmp_path: Path) -> None:
    text = "samples = 20\n[surface]\nnodes = 17\n"
    rows = read(generated(tmp_path, "small", text))
    assert 0 < rows.target.size < 20
    assert rows.target.max() <= AREA_MAX
    assert rows.surface.size == rows.target.size == len(rows.inputs)
