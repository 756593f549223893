"""The report on surrogates of scenes' own numbers: what is asked, solved and counted."""

import numpy as np
import pytest

from bench.surrogates.scenes import SCENES, scene_surrogate, solved
from gen.scene import Scene

pytestmark = pytest.mark.long


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


def test_the_same_numbers_are_asked_and_solved():
    scene = Scene.parse(f"samples = 8\n{SCENES['spectral']}", "scene")
    names = "hurst", "rms_height", "roll_off", "hardness", "pressure"
    asked, truth = solved(scene, names, 2, 2)
    assert tuple(asked) == names
    assert truth["area_percent"].shape == (2, 2)
    patch = float(np.prod(scene.sides))
    assert truth["force"][:, 0] == pytest.approx(asked["pressure"] * patch, rel=1e-6)
