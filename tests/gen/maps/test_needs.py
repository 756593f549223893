"""Steps of the preparation that a map needs, and the same steps in every command."""

import numpy as np
import pytest
from maps import rough_map

from bench.made_maps import MAPS, measured
from gen import cli
from gen.maps.needs import MapNeeds, common_threshold, find_spikes, with_needed_steps
from gen.maps.prepare import despiked, prepare
from gen.maps.read import Topography
from gen.maps.settings import Reading

TWO_MAPS = [made for made in MAPS if made.number in {2, 3}]


@pytest.mark.long
def test_the_threshold_takes_out_the_spikes_of_all_maps_and_nothing_else():
    maps = [measured(made) for made in TWO_MAPS]
    threshold = common_threshold([find_spikes(heights) for heights in maps])
    assert threshold is not None
    for made, heights in zip(TWO_MAPS, maps, strict=True):
        clear = despiked(Topography("map", heights, (1.0, 1.0)), threshold)
        moved = (clear.heights != heights) & ~np.isnan(heights)
        assert np.count_nonzero(moved) == made.faults.spikes


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


@pytest.fixture
def faulty(here):
    """Save a map of 96 x 96 nodes every um with spikes, a tilt and holes, as text."""
    heights = rough_map() + 0.2 * np.arange(96)[:, None]
    heights[10, 20] = heights[50, 60] = 40.0
    heights[70:73, 30:33] = np.nan
    np.savetxt(here / "faulty.txt", heights.T)
    return "faulty.txt"


def test_steps_are_chosen_for_spikes_form_and_holes():
    heights = rough_map() + 1e-2 * (np.arange(96) - 40.0)[:, None] ** 2
    assert with_needed_steps(Reading(), [MapNeeds.of(rough_map())]) == Reading(
        level="plane"
    )
    heights[3, 4] = 60.0
    heights[70, 30] = np.nan
    steps = with_needed_steps(Reading(), [MapNeeds.of(heights)])
    assert (steps.level, steps.fill) == ("quadratic", True)
    assert steps.despike is not None


def test_steps_of_the_user_overrule_those_that_are_chosen():
    needs = MapNeeds.of(rough_map())
    settings = Reading(despike=9.0, level="mean")
    assert with_needed_steps(settings, [needs]) == settings
    assert with_needed_steps(Reading(form=3), [needs]) == Reading(form=3)


@pytest.mark.parametrize("heights", [np.ones((9, 9)), np.eye(3), np.eye(2)])
def test_flat_and_tiny_maps_are_prepared(heights):
    prepared = prepare(Topography("map", heights, (1.0, 1.0)), Reading(prepare=True))
    assert np.isfinite(prepared.heights).all()


def test_prepare_takes_the_steps_that_a_scene_of_the_map_names(faulty, capsys):
    """The options that `gen scene` prints give the same numbers as `--prepare`."""
    size = ("--side", "95", "--unit", "um")
    scene = ("scene", faulty, *size, "--e-star", "1e5", "-o", "windows.toml")
    assert cli.main(scene) == 0
    line = next(
        line for line in capsys.readouterr().out.splitlines() if "prepared by" in line
    )
    options = line.removeprefix("prepared by ").partition(";")[0].split()
    described = []
    for steps in (options, ["--prepare"]):
        assert cli.main(["describe", faulty, *size, *steps]) == 0
        output = capsys.readouterr().out
        described.append(output[output.index("statistic") :])
    assert described[0] == described[1]


def test_prepare_says_what_its_steps_change(faulty, capsys):
    line = ("contact", faulty, "--side", "95", "--unit", "um", "--delta", "1")
    assert cli.main([*line, "--prepare"]) == 0
    output = capsys.readouterr().out
    assert "despiked: 2 nodes" in output
    assert "these steps change the rms height from" in output


def test_a_description_says_what_prepare_would_change(faulty, capsys):
    line = ("describe", faulty, "--side", "95", "--unit", "um", "--fill")
    assert cli.main(line) == 0
    assert "with --prepare (--despike" in capsys.readouterr().out
    assert cli.main([*line, "--prepare"]) == 0
    assert "with --prepare" not in capsys.readouterr().out
