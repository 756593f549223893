"""A map on fewer nodes: the same waves at the same places, and the share of them that is lost."""

import numpy as np
import pytest
from scipy import fft

from bem import HalfSpace, Layered
from bem.coarsening import Coarsening, sampled_lines

BOUNDARIES = ("periodic", "mirror", "free")


def places_of(shape, boundary):
    """Places of the nodes along both axes, from the beginning of the first cell or node [side]."""
    offset = 0.0 if boundary == "periodic" else 0.5
    return [(np.arange(nodes) + offset) / nodes for nodes in shape]


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("nodes", [(96, 99), (60, 90)])
def test_fewer_nodes_read_the_same_surface(boundary, nodes):
    turns = np.pi if boundary == "mirror" else 2 * np.pi

    def surface(shape):
        x, y = places_of(shape, boundary)
        return np.multiply.outer(np.cos(3 * turns * x), np.cos(2 * turns * y))

    fewer = Coarsening(surface((180, 198)), boundary, 1.4).on(nodes)
    assert fewer.dropped == pytest.approx(0, abs=1e-6)
    error = 1e-5 if boundary == "free" else 1e-12
    assert fewer.heights == pytest.approx(surface(nodes), abs=error)


def test_larger_cells_of_an_odd_number_of_cells_take_nodes_of_a_free_map():
    heights = np.random.default_rng(0).normal(size=(45, 60))
    fewer = Coarsening(heights, "free", 1.0).on((15, 12))
    assert fewer.heights == pytest.approx(heights[1::3, 2::5])
    assert fewer.dropped > 0.5  # of white noise


@pytest.mark.parametrize(("boundary", "nodes"), [("periodic", 72), ("mirror", 36)])
def test_the_dropped_share_is_that_of_the_mean_square_slope(boundary, nodes):
    """Two waves of 5 and 40 periods, whose slopes are as 1 to 2, of which the second is cut."""
    turns = np.pi if boundary == "mirror" else 2 * np.pi
    x, _ = places_of((128, 96), boundary)
    line = np.cos(5 * turns * x) + 2 / 8 * np.cos(40 * turns * x)
    coarsening = Coarsening(np.add.outer(line, np.zeros(96)), boundary, 1.5)
    assert coarsening.on((nodes, 96)).dropped == pytest.approx(0.8)


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("modulus", [0.03, 30.0])
def test_the_dropped_share_is_weighted_by_the_pressure_that_flattens(boundary, modulus):
    """Two waves of 5 and 40 periods with equal slopes, on a soft and on a hard layer."""
    turns = np.pi if boundary == "mirror" else 2 * np.pi
    x, _ = places_of((256, 96), boundary)
    line = np.cos(5 * turns * x) + np.cos(40 * turns * x) / 8
    body = Layered(3.0, modulus, 0.3, HalfSpace(1.0))
    dropped = Coarsening(np.add.outer(line, np.zeros(96)), boundary, 1.5, body)
    pressure = body.stiffness(turns / 256 * np.array([5.0, 40.0])) * np.array([1, 1 / 8])
    expected = pressure[1] ** 2 / (pressure**2).sum()
    # Slopes of a free map are those between neighbouring nodes of some lines.
    precise = 0.25 if boundary == "free" else 1e-9
    nodes = 72 if boundary != "mirror" else 36
    assert dropped.on((nodes, 96)).dropped == pytest.approx(expected, rel=precise)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_white_noise_is_cut_as_by_a_transform_of_all_waves(boundary):
    """Nothing may be left out of the transform of a surface that has all waves."""
    heights = np.random.default_rng(1).normal(size=(60, 48))
    fewer = Coarsening(heights, boundary, 1.0).on((30, 24))
    if boundary == "mirror":
        expected = fft.idctn(fft.dctn(heights, norm="forward")[:30, :24], norm="forward")
    else:
        waves = fft.fftshift(fft.fft2(heights, norm="forward"))
        kept = np.zeros((30, 24), dtype=complex)
        kept[1:, 1:] = waves[16:45, 13:36]  # waves -14 to 14, and -11 to 11
        expected = fft.ifft2(fft.ifftshift(kept), norm="forward").real
    assert fewer.heights == pytest.approx(expected, abs=1e-13)
    assert fewer.dropped == pytest.approx(15 / 16, abs=0.02)


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_ripples_in_a_corner_count_as_dropped(boundary):
    """A few nodes of short waves, between the lines that are sampled."""
    x, y = places_of((256, 256), boundary)
    heights = np.multiply.outer(np.cos(2 * np.pi * x), np.cos(2 * np.pi * y))
    heights[1:4, 1:4] += 0.5 * (-1) ** np.add.outer(np.arange(3), np.arange(3))
    assert Coarsening(heights, boundary, 1.0).on((64, 64)).dropped > 0.05


@pytest.mark.parametrize("nodes_in_wave", [6, 8, 16])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_lost_slope_of_a_wave_follows_from_its_nodes(nodes_in_wave, axis):
    line = np.cos(2 * np.pi * np.arange(384) / (4 * nodes_in_wave))
    heights = np.moveaxis(np.add.outer(line, np.zeros(192)), 0, axis)
    nodes = tuple(np.array(heights.shape) // 4)
    lost = Coarsening(heights, "periodic", 1.0).lost_slope(nodes)
    assert lost == pytest.approx(np.sin(np.pi / nodes_in_wave) ** 2, rel=0.25)


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("unit", [1e-200, 1e200])
def test_heights_whose_squares_are_out_of_range_are_cut_all_the_same(boundary, unit):
    heights = np.random.default_rng(2).normal(size=(24, 20))
    fewer = Coarsening(unit * heights, boundary, 1.0).on((12, 10))
    expected = Coarsening(heights, boundary, 1.0).on((12, 10))
    assert fewer.heights / unit == pytest.approx(expected.heights)


def test_flat_maps_lose_next_to_nothing():
    coarsening = Coarsening(np.zeros((64, 48)), "mirror", 1.0)
    assert coarsening.lost_slope((32, 24)) <= 1e-3
    assert coarsening.on((32, 24)).dropped == 0


def test_sampled_lines_are_lines_of_the_map_along_both_axes():
    heights = np.random.default_rng(0).normal(size=(200, 30))
    along, across = sampled_lines(heights)
    assert (along == heights).all()
    assert (across == heights[::3].T).all()
