"""Self-affine surfaces like a map have its spectrum, height and slope."""

from pathlib import Path

import numpy as np
import pytest

from bench.made_maps import MAPS, write
from gen.draft import likeness, scene_text
from gen.draft.proposal import Material
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.spectral import SelfAffineSpectrum, generate_spectral

pytest.importorskip("SurfaceTopography")

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
    like = likeness.propose(path, READING, Material())
    scene = scene_text.write(tmp_path / "a.toml", likeness.keys(like, "a command", Path("a.toml")))
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
    like = likeness.propose(path, READING, Material())
    assert like.spectrum.stretch == pytest.approx(0.25, rel=0.15)
    assert like.spectrum.hurst == pytest.approx(0.7, abs=0.1)
    assert like.spectrum.roll_off == pytest.approx(60.0, rel=0.3)
    assert like.height == pytest.approx(like.windows[0], rel=0.25)
    scene_text.write(tmp_path / "a.toml", likeness.keys(like, "a command", Path("a.toml")))


def test_a_map_of_scratches_brings_a_doubt(tmp_path):
    [ground] = [each for each in MAPS if each.name == "ground-2"]
    like = likeness.propose(write(ground, tmp_path), Reading(), Material())
    assert like.doubt
    scene = tmp_path / "a.toml"
    scene_text.write(scene, likeness.keys(like, "a command", Path("a.toml")))
    assert "DOUBTFUL" in scene.read_text()


@pytest.mark.parametrize("name", ["honed-0", "turned-0", "ground-1"])
def test_a_law_over_less_than_a_decade_feeds_no_scene(tmp_path, name):
    [made_map] = [each for each in MAPS if each.name == name]
    with pytest.raises(InputError, match=r"no self-affine law fits it: .* over 0\.\d+ decades"):
        likeness.propose(write(made_map, tmp_path), Reading(), Material())


def test_a_map_that_follows_no_law_is_refused(tmp_path):
    x = np.sin(np.arange(400) / 3.0)
    with pytest.raises(InputError, match=r"scan\.npy: no self-affine law fits it"):
        likeness.propose(save(tmp_path, np.outer(x, x)), READING, Material())
