"""What is seen in files of maps, and what is wrong with them."""

import math

import numpy as np
import pytest

from bench.made_maps import MAPS, measured, write
from gen.draft.survey import Spikes, common_threshold, find_spikes, remarks, survey, with_texture
from gen.maps.filters import without_spikes
from gen.maps.settings import Reading

pytest.importorskip("SurfaceTopography")

HERE = Reading.of_options()
MADE = {made.name: made for made in MAPS}


@pytest.fixture
def saved(tmp_path):
    """Save heights as a text file, whose side is given, and look at it."""

    def look(heights, side="10"):
        path = tmp_path / "scan.txt"
        np.savetxt(path, heights)
        return survey([path], Reading.of_options(side=side))[0]

    return look


@pytest.mark.parametrize("name", ["turned-3", "ground-3", "honed-4"])
def test_a_made_map_is_seen_as_it_was_made(tmp_path, name):
    made = MADE[name]
    [look] = survey([write(made, tmp_path)], HERE)
    assert (look.fault, look.shape, look.unit != "") == ("", made.shape, True)
    assert look.spacing == pytest.approx(made.spacing)
    assert (look.holes > 0) == (made.faults.holes > 0)
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
    looks = survey([tmp_path / name for name in names], Reading.of_options(side="10"))
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
    flat = saved(1e-9 * rough)
    assert "check the unit" in with_texture(flat, Reading.of_options(side="10"), None).fault


def test_a_bowl_has_a_form_and_a_wave_has_none(saved):
    x, y = np.mgrid[-1:1:40j, -1:1:40j]
    rough = np.random.default_rng(3).normal(size=x.shape)
    assert saved(30 * (x**2 + y**2) + rough).form > 0.95
    assert saved(30 * np.sin(2 * math.pi * x) + rough).form < 0.9
    assert remarks(saved(30 * (x**2 + y**2) + rough)) == ["curved form"]


SOME = [made for made in MAPS if made.number in {2, 3}]


@pytest.mark.parametrize("made", SOME, ids=lambda made: made.name)
def test_all_spikes_of_made_maps_are_found_and_nothing_else(made):
    found = find_spikes(measured(made))
    assert found.number == made.faults.spikes
    assert found.surface < found.nearest


def test_the_threshold_takes_out_the_spikes_of_all_maps_and_nothing_else():
    maps = [measured(made) for made in SOME]
    threshold = common_threshold([find_spikes(heights) for heights in maps])
    assert threshold is not None
    for made, heights in zip(SOME, maps, strict=True):
        _, spikes = without_spikes(heights, threshold)
        assert np.count_nonzero(spikes) == made.faults.spikes


def test_where_no_number_parts_them_the_spikes_decide():
    assert common_threshold([Spikes(20.0, math.inf, 0)] * 3) is None
    ridges, spiky = Spikes(90.0, math.inf, 0), Spikes(8.0, 60.0, 3)
    threshold = common_threshold([ridges, spiky])
    assert threshold is not None
    assert 0.9 * 60 < threshold < 60


def test_many_spikes_and_those_that_no_gap_parts_are_found():
    random = np.random.default_rng(5)
    rough = random.normal(size=(200, 200))
    many = rough.copy()
    many.flat[random.choice(many.size, 300, replace=False)] += 40.0
    assert find_spikes(many).number == 300
    tail = rough.copy()
    tail.flat[random.choice(tail.size, 8, replace=False)] = 10.0 * 1.7 ** np.arange(8)
    assert find_spikes(tail).number >= 5
    assert find_spikes(rough).number == 0


def test_a_map_of_half_flat_parts_has_no_division_by_zero():
    heights = np.zeros((40, 40))
    heights[20:] = 1.0
    heights[5, 5] = 30.0
    assert find_spikes(heights).number == 1
