"""What the border of contact tells of errors: counts, sums and independent pieces."""

import math

import numpy as np
import pytest

from bem.derived.border_signs import border_signs

BOUNDARIES = ("free", "periodic", "mirror")


def spot(nodes, *, seed=0):
    """Pressure, gap and heights of a square spot of 3 x 3 nodes on random heights."""
    random = np.random.default_rng(seed)
    pressure = np.zeros((nodes, nodes))
    pressure[2:5, 2:5] = random.uniform(1, 2, (3, 3))
    gap = np.where(pressure > 0, 0.0, random.uniform(1, 2, (nodes, nodes)))
    return pressure, gap, random.normal(size=(nodes, nodes))


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_a_single_node_works_against_the_four_gaps_around_it(boundary):
    pressure = np.zeros((5, 6))
    gap = np.zeros((5, 6))
    pressure[2, 3] = 7.0
    gap[1, 3], gap[3, 3], gap[2, 2], gap[2, 4] = 1.0, 2.0, 3.0, 4.0
    signs = border_signs(pressure, gap, np.zeros((5, 6)), boundary)
    assert signs.share == 4
    assert signs.gap == pytest.approx(2.5)
    assert signs.work == pytest.approx(10.0)
    assert signs.outer == 0


def test_edges_across_the_border_count_on_periodic_patches_alone():
    pressure = np.zeros((4, 4))
    pressure[0] = 1.0
    gap = 1.0 - pressure
    heights = np.zeros((4, 4))
    assert border_signs(pressure, gap, heights, "periodic").share == 2
    assert border_signs(pressure, gap, heights, "mirror").share == 1
    assert border_signs(pressure, gap, heights, "free").share == 1


def test_a_straight_border_has_a_piece_for_each_of_its_lines():
    pressure = np.zeros((12, 12))
    pressure[3:6] = 1.0
    heights = np.repeat(np.arange(12.0)[:, None], 12, axis=1)
    signs = border_signs(pressure, 1 - pressure, heights, "periodic")
    assert signs.share == pytest.approx(24 / 36)
    assert signs.scatter == pytest.approx(signs.share / math.sqrt(2))


def test_a_border_of_long_steps_has_as_many_pieces_as_corners():
    pressure, gap, heights = spot(8)
    signs = border_signs(pressure, gap, heights, "free")
    assert signs.scatter == pytest.approx(signs.share / 2)  # the corners of a square


def test_spots_that_repeat_themselves_scatter_like_one():
    pressure, gap, heights = spot(8)
    alone = border_signs(pressure, gap, heights, "periodic")
    repeated = [np.tile(field, (2, 2)) for field in (pressure, gap, heights)]
    four = border_signs(*repeated, "periodic")
    random = np.random.default_rng(1)
    others = border_signs(
        repeated[0], repeated[1], random.normal(size=(16, 16)), "periodic"
    )
    assert four.share == pytest.approx(alone.share)
    assert four.work == pytest.approx(alone.work)
    assert others.scatter == pytest.approx(alone.scatter / 2)
    # A spot has 8 nodes at its border and 4 corners; four spots have 8 heights and 16 corners.
    assert four.scatter == pytest.approx(alone.scatter / math.sqrt(2))


def test_two_nodes_on_a_diagonal_have_two_corners_between_them():
    pressure = np.zeros((6, 6))
    pressure[2, 2] = pressure[3, 3] = 1.0
    random = np.random.default_rng(0)
    heights = random.normal(size=(6, 6))
    signs = border_signs(pressure, 1 - pressure, heights, "free")
    assert signs.scatter == pytest.approx(signs.share / math.sqrt(2))  # of two nodes


def test_outer_nodes_are_a_sign_on_free_patches_alone():
    pressure = np.ones((5, 7))
    zeros = np.zeros((5, 7))
    free = border_signs(pressure, zeros, zeros, "free")
    assert free.outer == pytest.approx(20 / 35)
    assert free.share == free.scatter == free.work == free.gap == 0
    assert border_signs(pressure, zeros, zeros, "mirror").outer == 0


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_without_contact_there_is_no_sign(boundary):
    zeros = np.zeros((4, 4))
    signs = border_signs(zeros, zeros + 1, zeros, boundary)
    assert signs.share == signs.scatter == signs.work == signs.gap == signs.outer == 0
