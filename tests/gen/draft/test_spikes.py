"""Spikes of measured maps are parted from their surfaces."""

import math

import numpy as np
import pytest

from bench.populations.made_maps import MAPS, measured
from gen.draft.spikes import Spikes, common_threshold, find_spikes
from gen.measured.despiking import without_spikes

SOME = [made for made in MAPS if made.number in {2, 3}]
NONE = np.empty(0)


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


def test_maps_without_spikes_need_no_threshold():
    assert common_threshold([Spikes(20.0, math.inf, 0, NONE)] * 3) is None


def test_where_no_number_parts_them_the_spikes_decide():
    ridges, spiky = Spikes(90.0, math.inf, 0, NONE), Spikes(8.0, 60.0, 3, NONE)
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
