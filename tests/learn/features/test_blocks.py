"""A surface in blocks: means, what they leave out, and Persson's area inside them."""

import numpy as np
import pytest
from scipy.special import erf

from learn.features.blocks import Blocks


def test_means_and_slopes_are_those_of_the_nodes_of_each_block():
    z = np.random.default_rng(0).normal(size=(12, 8))
    blocks = Blocks(z, (0.5, 2.0), 4)
    assert blocks.means.shape == (4, 4)
    assert blocks.means[1, 2] == pytest.approx(z[3:6, 4:6].mean())
    rest = z - blocks.interpolated(blocks.means)
    assert blocks.roughness == pytest.approx(rest.std())
    along_x = np.diff(rest[2:7, 4:6], axis=0) / 0.5
    along_y = np.diff(rest[3:6, 3:7], axis=1) / 2.0
    squares = (along_x[:-1] ** 2 + along_x[1:] ** 2) / 2
    squares = squares + (along_y[:, :-1] ** 2 + along_y[:, 1:] ** 2) / 2
    assert blocks.slopes[1, 2] == pytest.approx(np.sqrt(squares.mean()))


def test_an_inclined_plane_is_resolved_but_at_its_border():
    """Interpolation is linear between the blocks' centres."""
    blocks = Blocks(np.add.outer(np.arange(32.0), 2 * np.arange(32.0)), (1.0, 1.0), 8)
    assert np.abs(blocks.slopes[1:-1, 1:-1]).max() < 1e-12
    assert blocks.slopes[0, 4] > 0


def test_where_every_node_is_a_block_nothing_is_left_out():
    z = np.random.default_rng(0).normal(size=(7, 9))
    blocks = Blocks(z, (1.0, 1.0), 33)
    assert blocks.means.tobytes() == z.tobytes()
    assert blocks.roughness == 0.0
    pressure = np.maximum(z, 0.0)
    assert blocks.local_area(pressure, 1.0) == np.count_nonzero(pressure) / z.size


def test_the_area_inside_the_blocks_is_perssons():
    z = np.random.default_rng(1).normal(size=(40, 30))
    blocks = Blocks(z, (1.0, 1.0), 10)
    pressure = np.zeros((10, 10))
    pressure[3, 5], pressure[8, 8] = 0.2, 1.5
    for factor in (0.5, 1.0, 2.0):
        shares = erf(np.sqrt(2) * factor * pressure / blocks.slopes)
        assert blocks.local_area(pressure, factor) == pytest.approx(shares.mean())
    assert blocks.local_area(1e6 * np.ones((10, 10)), 1.0) == pytest.approx(1.0)
    assert blocks.local_area(np.zeros((10, 10)), 1.0) == 0.0
