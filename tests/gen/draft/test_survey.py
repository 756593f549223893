"""Surveys of maps: what their files hold, and which of them can be used."""

import numpy as np
import pytest

from bench.made_maps import MAPS, write
from gen.draft.survey import measure, survey_maps
from gen.maps.settings import Reading

pytest.importorskip("SurfaceTopography")

MADE = {made.name: made for made in MAPS}


@pytest.fixture
def saved(tmp_path):
    """Save heights as a text file, whose side is given, and look at it."""

    def look(heights, side="10"):
        path = tmp_path / "scan.txt"
        np.savetxt(path, heights)
        return survey_maps([path], Reading(side=side))[0]

    return look


@pytest.mark.parametrize("name", ["turned-3", "ground-3", "honed-4"])
def test_a_made_map_is_seen_as_it_was_made(tmp_path, name):
    made = MADE[name]
    [look] = survey_maps([write(made, tmp_path)], Reading())
    assert (look.fault, look.shape, look.unit != "") == ("", made.shape, True)
    assert look.spacing == pytest.approx(made.spacing)
    assert (look.missing > 0) == (made.faults.holes > 0)
    assert look.spikes is not None
    assert look.spikes.number == made.faults.spikes
    assert look.tilt == pytest.approx(made.faults.tilt, abs=3e-3)
    assert look.form < 0.9


def test_files_that_are_no_use_say_why(tmp_path):
    (tmp_path / "notes.txt").write_text("once upon a time")
    (tmp_path / "noise.x3p").write_bytes(b"PK no map")
    np.savetxt(tmp_path / "a.txt", np.random.default_rng(1).normal(size=(20, 20)))
    np.savetxt(tmp_path / "b.txt", np.random.default_rng(1).normal(size=(20, 20)))
    names = ["notes.txt", "noise.x3p", "a.txt", "b.txt", "none.txt"]
    looks = survey_maps([tmp_path / name for name in names], Reading(side="10"))
    faults = [look.fault for look in looks]
    assert "number" in faults[0]
    assert faults[1]
    assert faults[2:4] == ["", "the same map as a.txt"]
    assert "No such file" in faults[4]
    assert not any(str(tmp_path) in fault for fault in faults)


def test_maps_without_heights_are_left_out(saved):
    rough = np.random.default_rng(2).normal(size=(20, 20))
    assert "missing" in saved(np.where(rough > -0.5, np.nan, rough)).fault
    assert saved(np.ones((20, 20))).fault == "all its heights are equal"
    assert saved(rough[:3, :3]).fault == "3 x 3 nodes are too few"


def test_a_map_without_roughness_is_left_out(saved):
    flat = saved(1e-9 * np.random.default_rng(2).normal(size=(20, 20)))
    measured_map = measure(flat, Reading(side="10"))
    assert measured_map.topography is None
    assert "check the unit" in measured_map.survey.fault
