"""Forecasts of a run: what an estimate measures, and the loads of the plan."""

import re

import pytest

from gen import cli
from gen.generation import forecast
from gen.generation.forecast import measured_time, planned_loads
from gen.generation.plan import parameters
from gen.scene import Scene

SCENE = "samples = {}\nsamples_per_surface = {}\n[surface]\nnodes = 17\n"


def test_an_estimate_measures(here, capsys):
    (here / "scene.toml").write_text(SCENE.format(40, 2))
    assert cli.main(["estimate", "scene.toml", "--ranks", "5"]) == 0
    text = capsys.readouterr().out
    assert re.search(r"time +[0-9.e-]+ s on 4 workers", text), (
        "less than a minute in seconds"
    )
    assert "mean of 32 measured" in text


@pytest.mark.parametrize(
    ("samples", "per_surface", "rows"),
    [
        (1, 1, [(0, 1)]),
        (40, 20, [(0, 4), (20, 24)]),  # of both surfaces the first loads
        (5, 3, [(0, 3), (3, 5)]),  # the last surface has fewer samples
    ],
)
def test_few_samples_on_each_surface_are_measured(
    monkeypatch, samples, per_surface, rows
):
    computed = []
    monkeypatch.setattr(
        forecast, "compute_rows", lambda _, start, stop: computed.append((start, stop))
    )
    scene = Scene.parse(SCENE.format(samples, per_surface), "test")
    assert measured_time(scene).samples == sum(stop - start for start, stop in rows)
    assert computed == [(0, 1), *rows]


def test_planned_loads_are_those_of_the_first_rows(monkeypatch):
    monkeypatch.setattr(forecast, "COUNTED_ROWS", 30)
    scene = Scene.parse(SCENE.format(40, 1), "test")
    load = parameters(scene, 0, 30).load
    assert planned_loads(scene) == (load.min(), load.mean(), load.max())
