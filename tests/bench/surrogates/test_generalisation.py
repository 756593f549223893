"""How far surrogates may be taken: other lengths, grids and exponents, by feature set."""

import re

import pytest

from bench.surrogates import generalisation as study
from bench.surrogates.generalisation import generalisation
from gen.runtime.errors import InputError
from gen.scene import Scene, differences, load

CHANGED = {
    "fine grid (257)": {"surface.nodes"},
    "midpoint generator": {"surface.generator"},
    "L = 300 um, scaled": {"surface.side", "surface.sigma0", "delta.pieces"},
    "L = 300 um, same heights": {"surface.side"},
    "L = 0.3 um, scaled": {"surface.side", "surface.sigma0", "delta.pieces"},
}
"""The keys in which each scene differs from the preset."""


def test_scenes_that_judge_differ_from_the_preset_in_what_their_names_say():
    preset = load("paper")
    changed = {}
    for name, text in study.SCENES.items():
        scene = Scene.parse(f"samples = {preset.samples}\n{text}", name)
        lines = differences(preset, scene)
        changed[name] = {re.split(r"[:\[]", line)[0] for line in lines}
    assert changed == CHANGED


def test_too_few_rows_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"--rows 199: give 200 or more"):
        generalisation(tmp_path, 199)


@pytest.mark.long
def test_features_without_units_hold_on_any_length_and_statistics_do_not(tmp_path):
    rows = generalisation(tmp_path, 200)
    errors = {(row["tested_on"], row["features"]): row["nmae"] for row in rows}
    flagged = {(row["tested_on"], row["features"]): row["flagged"] for row in rows}
    assert len(errors) == len(rows) == 3 * 8
    for features in ("dimensionless", "hybrid"):
        long = errors["L = 300 um, scaled", features]
        assert long == pytest.approx(errors["L = 0.3 um, scaled", features], rel=1e-6)
    assert errors["L = 0.3 um, scaled", "paper"] > 50
    for features in ("paper", "dimensionless", "hybrid"):
        assert flagged["fine grid (257)", features] == 1
        mended = errors["fine grid (257), some rows added", features]
        assert mended < errors["fine grid (257)", features]
