"""Pits and spikes are named, and natural surfaces have neither them nor codes."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from bench.made_maps import KINDS, MadeMap, surface
from gen.maps.codes import find_codes
from gen.maps.outliers import find_outliers
from gen.maps.settings import Reading
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.surface import generate
from tests.maps import rough_heights, warnings_of

NODES = 80


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("node", [(30, 40), (0, 12), (79, 79)])
@pytest.mark.parametrize("depth", [3.0, 20.0])
def test_a_pit_is_named_as_a_spike_is(sign, node, depth):
    heights = rough_heights()
    heights[node] = sign * (np.abs(heights).max() + depth)
    for settings, end in ((Reading(), sign), (Reading(invert=True), -sign)):
        word = {-1: "lowest node {} is a pit", 1: "highest node {} is a spike"}[end]
        [warning] = warnings_of(heights, settings)
        assert word.format(node) in warning
        assert "--mask " in warning
        assert "--despike 7 replaces it" in warning


def test_a_pit_under_a_tilt_is_found_whether_the_tilt_is_out_or_not():
    """No mask tells it from the lower end of the map: it is taken before levels."""
    heights = rough_heights() + 0.5 * np.arange(NODES)[:, None]
    heights[60, 40] -= 6.0
    for settings, words in (
        (Reading(level="plane"), "the lowest node"),
        (Reading(), "the node"),
    ):
        [warning] = [line for line in warnings_of(heights, settings) if "a pit" in line]
        assert f"{words} (60, 40) is a pit, " in warning
        assert "--mask" not in warning
        assert "--despike 7" in warning


def test_spikes_of_an_end_are_counted():
    heights = rough_heights()
    for place, height in enumerate(np.linspace(2.5, 4.0, 5)):
        heights[10 * place + 5, 20] = height
    [warning] = warnings_of(heights)
    assert "the highest node (45, 20) is a spike" in warning
    assert "and 4 more nodes are such" in warning


def _pitted(seed):
    """A plane with many pits that are a few nodes wide, as of graphite or pores."""
    random = np.random.default_rng(seed)
    pores = gaussian_filter(random.normal(size=(200, 200)), 1.5 + seed / 3)
    pits = 8 * np.minimum(0, pores - np.quantile(pores, 0.1))
    return pits - 0.05 * gaussian_filter(random.normal(size=(200, 200)), 1)


X, Y = np.meshgrid(np.linspace(-1, 1, 101), np.linspace(-1, 1, 91), indexing="ij")
NATURAL = {
    **{kind: surface(MadeMap(kind, 1, (160, 140), 1.0, 40.0)) for kind in KINDS},
    **{f"pitted {seed}": _pitted(seed) for seed in (0, 3, 6, 9)},
    "diamond-square": generate(
        "diamond-square", 129, 0.5, 12.5, np.random.default_rng(0)
    ),
    "midpoint": generate("midpoint", 129, 0.8, 12.5, np.random.default_rng(0)),
    "lay": generate_spectral(
        (96, 96),
        96.0,
        SelfAffineSpectrum(0.7, 40.0, 8.0, 0.3),
        np.random.default_rng(0),
        rms_slope=0.1,
    ),
    "paraboloid": -(X**2) - Y**2,
    "sphere": np.sqrt(4 - X**2 - Y**2),
    "cap": np.maximum(0.3 - X**2 - Y**2, 0),
    "waves": np.sin(9 * X) * np.cos(7 * Y),
    "grating": np.sign(np.sin(12 * X)) + 0 * Y,
    "pillars": 1.0 * ((np.sin(22 * X) > 0.5) & (np.sin(22 * Y) > 0.5)),
    "wedge": -np.abs(X) + 0 * Y,
    "plane": 0.3 * X + Y,
    "noise": np.random.default_rng(0).normal(size=(100, 100)),
}


@pytest.mark.parametrize("name", NATURAL)
def test_natural_and_made_surfaces_have_nothing_apart(name):
    for heights in (NATURAL[name], -NATURAL[name]):
        assert not find_codes(heights)
        assert find_outliers(heights, 1) is None
        assert find_outliers(heights, -1) is None
