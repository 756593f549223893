"""Proposals for maps of several sizes, and surfaces that have the spectrum of a map."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bem
from bench.made_maps import MAPS, write
from gen.draft import scene_like
from gen.draft import write as write_scene
from gen.draft.proposal import (
    FEWEST_NODES,
    SIZES,
    choose_loads,
    common_spacing,
    propose_like,
    window_nodes,
)
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.statistics import rms_slope

SHAPES = st.lists(st.tuples(st.integers(4, 2000), st.integers(4, 2000)), min_size=1, max_size=30)


@pytest.mark.parametrize(
    ("spacings", "chosen"),
    [
        ([1.0, 1.0, 1.0004], None),
        ([1.0] * 20 + [2.0], 1.0),  # one of many maps does not coarsen all others
        ([1.0] * 3 + [2.0], 2.0),
        ([1.0, 1.0, 30.0], 1.0),  # another instrument altogether
    ],
)
def test_the_common_spacing(spacings, chosen):
    assert common_spacing([(each, each) for each in spacings]) == chosen


@given(SHAPES, st.floats(1.0, 1000.0) | st.just(math.nan))
def test_most_maps_hold_the_windows_and_twice_if_any_size_fits_twice(shapes, length):
    nodes = window_nodes(shapes, length)
    sides = [min(shape) for shape in shapes if min(shape) >= SIZES[-1]]
    twice = sum(side >= 2 * SIZES[-1] for side in sides) >= 0.75 * len(sides)
    assert (nodes is None) == (not sides)
    if nodes is None:
        return
    assert nodes in SIZES
    assert sum(side >= (1 + twice) * nodes for side in sides) >= 0.75 * len(sides)


def test_long_waves_ask_for_wider_windows():
    assert window_nodes([(1000, 1000)], 10.0) == 128
    assert window_nodes([(1000, 1000)], 35.0) == 192
    assert window_nodes([(1000, 1000)], 200.0) == 256
    assert window_nodes([(300, 300)], 200.0) == 128


STEEL = Bodies.of_options([210e3], [0.3], None, 2000.0)
NODES = 64


@pytest.fixture(scope="module")
def surface():
    spectrum = SelfAffineSpectrum(0.8, 20.0, 4.0)
    return generate_spectral(
        (NODES, NODES), 64.0, spectrum, np.random.default_rng(1), rms_slope=0.15
    )


@pytest.mark.parametrize(
    "material", [STEEL, Bodies.of_options([210e3], [0.3], None, None), Bodies(1.0)]
)
def test_areas_are_those_of_the_solver_within_a_half(surface, material):
    slope = rms_slope(surface, (1.0, 1.0))
    loads = choose_loads(material, [slope], surface.size)
    unit = 1.0 if loads.quantity == "pressure" else material.e_star * slope
    for load, expected in zip((loads.low, loads.high), loads.areas, strict=True):
        contact = bem.solve(
            surface,
            side=64.0,
            pressure=load * unit,
            modulus=(material.only or (1.0, 0.0))[0],
            poisson=(material.only or (1.0, 0.0))[1],
            hardness=material.hardness,
            boundary="periodic",
        )
        assert 0.5 * expected < contact.area_percent < 1.5 * expected
    assert loads.areas[0] == pytest.approx(100 * FEWEST_NODES / surface.size, rel=0.05)


READING = Reading(side="199.5")


def save(folder, heights):
    path = folder / "scan.npy"
    np.save(path, heights)
    return path


def made(spectrum, slope, seed=0):
    """A window of 400 nodes every 0.5 um of a larger surface, tilted."""
    whole = generate_spectral(
        (600, 600), 300.0, spectrum, np.random.default_rng(seed), rms_slope=slope
    )
    return whole[:400, :400] + 0.01 * np.arange(400)


@pytest.mark.parametrize("hurst", [0.5, 0.8])
def test_the_scene_holds_the_law_that_the_map_was_made_by(tmp_path, hurst):
    path = save(tmp_path, made(SelfAffineSpectrum(hurst, 30.0, 2.5), 0.1))
    like = propose_like(path, READING, Bodies(1.0))
    scene = write_scene(tmp_path / "a.toml", scene_like(like, "a command", Path("a.toml")))
    surface = scene.surface
    assert surface.generator == "spectral"
    assert surface.hurst[0] < hurst < surface.hurst[1]
    assert surface.roll_off[0] < 30.0 < surface.roll_off[1]
    assert surface.cut_off == pytest.approx(2.5, rel=0.1)
    assert surface.rms_slope[0] < 0.1 < surface.rms_slope[1]
    assert (scene.spacing[0], surface.stretch) == (pytest.approx(0.5), 1.0)
    assert scene.contact.boundary == "mirror"
    assert like.height == pytest.approx(like.windows[0], rel=0.25)
    assert like.slope == pytest.approx(0.1, rel=0.05)
    assert not like.doubt


def test_a_lay_becomes_a_stretch(tmp_path):
    path = save(tmp_path, made(SelfAffineSpectrum(0.7, 60.0, 4.2, stretch=0.25), 0.1))
    like = propose_like(path, READING, Bodies(1.0))
    assert like.spectrum.stretch == pytest.approx(0.25, rel=0.15)
    assert like.spectrum.hurst == pytest.approx(0.7, abs=0.1)
    assert like.spectrum.roll_off == pytest.approx(60.0, rel=0.3)
    assert like.height == pytest.approx(like.windows[0], rel=0.25)
    write_scene(tmp_path / "a.toml", scene_like(like, "a command", Path("a.toml")))


def test_a_map_of_scratches_brings_a_doubt(tmp_path):
    [ground] = [each for each in MAPS if each.name == "ground-2"]
    like = propose_like(write(ground, tmp_path), Reading(), Bodies(1.0))
    assert like.doubt
    scene = tmp_path / "a.toml"
    write_scene(scene, scene_like(like, "a command", Path("a.toml")))
    assert "DOUBTFUL" in scene.read_text()


@pytest.mark.parametrize("name", ["honed-0"])
def test_a_law_over_less_than_a_decade_feeds_no_scene(tmp_path, name):
    [made_map] = [each for each in MAPS if each.name == name]
    with pytest.raises(InputError, match=r"no self-affine law fits it: .* over 0\.\d+ decades"):
        propose_like(write(made_map, tmp_path), Reading(), Bodies(1.0))
