"""Populations that are fitted to made maps of which everything is known."""

import json

import numpy as np
import pytest

from gen import cli
from gen.draft.populations import FittedMap, Roughness, fit_population
from gen.maps.read import Topography
from gen.population import Population, generate_like
from gen.runtime.errors import InputError
from gen.scene import load
from gen.spectral import SelfAffineSpectrum, generate_spectral

LAW = SelfAffineSpectrum(hurst=0.8, roll_off=40.0, cut_off=4.0)


def made(spectrum=LAW, seed=0, nodes=160):
    """A window of a larger Gaussian surface of unit rms height, with nodes every um."""
    random = np.random.default_rng(seed)
    period = generate_spectral(
        (2 * nodes, 2 * nodes), 2.0 * nodes, spectrum, random, rms_height=1.0
    )
    window = period[:nodes, :nodes]
    return window - window.mean()


def as_map(heights, spacing=(1.0, 1.0), name="made.npy"):
    sides = tuple(np.multiply(spacing, heights.shape).tolist())
    topography = Topography(name, heights, sides, boundary="mirror")
    return FittedMap(topography, "0" * 64)


def fitted_to(*maps):
    return fit_population([as_map(heights) for heights in maps], "not at all")


def surfaces_of(fitted, number=6):
    shape = fitted.nodes
    return [
        generate_like(fitted, shape, shape, np.random.default_rng(seed))
        for seed in range(number)
    ]


@pytest.mark.parametrize(
    "heights",
    [
        made(),
        np.exp(0.5 * made(seed=1)),
        made(SelfAffineSpectrum(0.8, 40.0, 9.0, stretch=0.25), seed=2, nodes=200),
    ],
    ids=["gaussian", "lognormal", "directional"],
)
def test_surfaces_have_the_roughness_of_the_map(heights):
    """Rms height and slopes within 5 %, curvature within 10 %."""
    fitted = fitted_to(heights)
    spacing = fitted.spacing
    of_map = Roughness.of([heights], spacing)
    of_surfaces = Roughness.of(surfaces_of(fitted), spacing)
    assert of_surfaces.rms_height == pytest.approx(of_map.rms_height, rel=0.05)
    assert of_surfaces.slope_x == pytest.approx(of_map.slope_x, rel=0.05)
    assert of_surfaces.slope_y == pytest.approx(of_map.slope_y, rel=0.05)
    assert of_surfaces.curvature == pytest.approx(of_map.curvature, rel=0.1)
    assert fitted.remarks == ()


def test_surfaces_have_the_heights_of_the_map():
    heights = np.exp(0.5 * made(seed=1))
    surfaces = np.ravel(surfaces_of(fitted_to(heights)))
    shares = np.array([0.02, 0.1, 0.5, 0.9, 0.98])
    quantiles = np.quantile(heights, shares) - heights.mean()
    assert np.quantile(surfaces, shares) == pytest.approx(
        quantiles, abs=0.15 * heights.std()
    )


def test_the_shortest_wave_is_the_cut_off():
    assert fitted_to(made()).shortest == pytest.approx(4.0, rel=0.15)


def test_several_maps_are_one_population():
    """Its rms height is the median of the maps', which may have different shapes."""
    maps = [
        made(seed=1),
        1.3 * made(seed=2)[:120],
        0.8 * made(seed=3)[:, :130],
    ]
    fitted = fitted_to(*maps)
    rms_heights = [heights.std() for heights in maps]
    assert [source.rms_height for source in fitted.maps] == pytest.approx(rms_heights)
    rms_height = np.sqrt(np.mean([surface.var() for surface in surfaces_of(fitted)]))
    assert rms_height == pytest.approx(np.median(rms_heights), rel=0.05)
    slopes = [np.diff(heights, axis=0).std() / heights.std() for heights in maps]
    of_surfaces = [np.diff(s, axis=0).std() / s.std() for s in surfaces_of(fitted)]
    assert np.mean(of_surfaces) == pytest.approx(np.mean(slopes), rel=0.1)


@pytest.mark.parametrize(
    ("maps", "words"),
    [
        ([as_map(np.ones((20, 20)))], "rms height is 0 um"),
        ([as_map(made(nodes=32)[:15])], "15 x 32 nodes"),
        (
            [as_map(made(nodes=32)), as_map(made(nodes=32), (2.0, 1.0))],
            "share their spacing",
        ),
    ],
)
def test_maps_that_no_surface_is_like_are_refused(maps, words):
    with pytest.raises(InputError, match=words):
        fit_population(maps, "")


def steps(seed, nodes=48):
    """A map that no self-affine law fits: rough plateaus of two heights."""
    rough = 0.05 * np.random.default_rng(seed).standard_normal((nodes, nodes))
    return rough + np.tanh(4 * made(SelfAffineSpectrum(1.0, 20.0, 12.0), seed, nodes))


@pytest.mark.parametrize("number", [1, pytest.param(3, marks=pytest.mark.long)])
def test_the_command_writes_a_scene_and_its_population(here, capsys, number):
    options = []
    for seed in range(number):
        np.save(f"map{seed}.npy", (1 + seed) * steps(seed))
        options += ["--like", f"map{seed}.npy"]
    options += ["--generator", "like", "--side", "47"]
    assert cli.main(["scene", *options, "-o", "mine.toml"]) == 0
    assert "mine.population.json" in capsys.readouterr().out
    scene = load("mine.toml").resolved()
    recorded = Population.parse((here / "mine.population.json").read_text(), "")
    assert scene.surface.recorded_population() == recorded
    assert scene.contact.boundary == "mirror"
    assert scene.grid.spacing == pytest.approx((1.0, 1.0))
    assert len(json.loads(recorded.text)["maps"]) == number
    if number == 3:
        assert scene.surface.scale == pytest.approx((0.5, 1.5), rel=0.05)


def test_nothing_is_overwritten(here, refused):
    np.save("map.npy", steps(0))
    (here / "mine.population.json").write_text("mine")
    line = refused(cli, "scene", "--like", "map.npy", "--side", "95", "-o", "mine.toml")
    assert "mine.population.json: is there already" in line
    assert {path.name for path in here.iterdir()} == {"map.npy", "mine.population.json"}


def test_the_spectrum_of_waves_longer_than_the_map_is_continued_flat():
    """On a period of three maps a side, the rms slope over the rms height is that of the map."""
    heights = made()
    fitted = fitted_to(heights)
    period = (3 * fitted.nodes[0], 3 * fitted.nodes[1])
    surface = generate_like(fitted, period, period, np.random.default_rng(0))
    slope = np.diff(surface, axis=0).std() / surface.std()
    of_map = np.diff(heights, axis=0).std() / heights.std()
    assert slope == pytest.approx(of_map, rel=0.1)
