"""How far surrogates may be taken: other lengths, grids and exponents, by feature set."""

import pytest

from bench.surrogates import generalisation as study
from bench.surrogates.generalisation import generalisation
from gen.runtime.errors import InputError
from gen.scene import Scene, differences, load


def test_scenes_that_judge_differ_from_the_preset_in_what_their_names_say():
    changed = {
        name: {
            line.split("=")[0].split(":")[0].strip()
            for line in differences(Scene.parse(text, name), load("paper"))
        }
        for name, text in study.SCENES.items()
    }
    assert changed["fine grid (257)"] != changed["midpoint generator"]
    assert len(changed) == len({*study.SCENES}) == 5


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
