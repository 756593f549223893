"""Self-affine surfaces that are proposed for a map: like it, or doubted, or refused."""

from pathlib import Path

import numpy as np
import pytest

from bench.made_maps import MAPS, write
from gen.draft.likeness import propose_like
from gen.draft.writing import scene_like
from gen.draft.writing import write as write_scene
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.spectral import SelfAffineSpectrum, generate_spectral

pytest.importorskip("SurfaceTopography")

MADE = {made.name: made for made in MAPS}


def proposed(folder, spectrum):
    """What is proposed for a window of 400 nodes every 0.5 um of a larger surface, tilted."""
    random = np.random.default_rng(0)
    surface = generate_spectral((600, 600), 300.0, spectrum, random, rms_slope=0.1)
    np.save(folder / "scan.npy", surface[:400, :400] + 0.01 * np.arange(400))
    return propose_like(folder / "scan.npy", Reading(side="199.5"))


@pytest.fixture(scope="module", params=[0.5, 0.8])
def isotropic(request, tmp_path_factory):
    """What is proposed for an isotropic map of a known Hurst exponent."""
    folder = tmp_path_factory.mktemp("isotropic")
    return proposed(folder, SelfAffineSpectrum(request.param, 30.0, 2.5)), request.param


def written(like, folder):
    """The scene of a likeness, as `gen run` reads it from its file."""
    text = scene_like(like, Bodies(1.0), "a command", Path("a.toml"))
    return write_scene(folder / "a.toml", text)


@pytest.mark.few(2)
def test_the_scene_holds_the_law_that_the_map_was_made_by(isotropic, tmp_path):
    like, hurst = isotropic
    scene = written(like, tmp_path)
    surface = scene.surface
    assert surface.generator == "spectral"
    assert surface.hurst[0] < hurst < surface.hurst[1]
    assert surface.roll_off[0] < 30.0 < surface.roll_off[1]
    assert surface.cut_off == pytest.approx(2.5, rel=0.1)
    assert surface.rms_slope[0] < 0.1 < surface.rms_slope[1]


def test_the_scene_has_the_spacing_of_the_map_and_mirrors_it(isotropic, tmp_path):
    like, _ = isotropic
    scene = written(like, tmp_path)
    assert (scene.spacing[0], scene.surface.stretch) == (pytest.approx(0.5), 1.0)
    assert scene.contact.boundary == "mirror"


def test_generated_surfaces_are_as_rough_as_the_map(isotropic):
    like, _ = isotropic
    assert like.rms_height == pytest.approx(like.windows.rms_height, rel=0.25)
    assert like.rms_slope == pytest.approx(0.1, rel=0.05)
    assert not like.doubt


def test_a_lay_becomes_a_stretch(tmp_path):
    like = proposed(tmp_path, SelfAffineSpectrum(0.7, 60.0, 4.2, stretch=0.25))
    assert like.spectrum.stretch == pytest.approx(0.25, rel=0.15)
    assert like.spectrum.hurst == pytest.approx(0.7, abs=0.1)
    assert like.spectrum.roll_off == pytest.approx(60.0, rel=0.3)
    assert like.rms_height == pytest.approx(like.windows.rms_height, rel=0.25)
    assert written(like, tmp_path).surface.stretch == like.spectrum.stretch


def test_a_map_of_scratches_brings_a_doubt(tmp_path):
    like = propose_like(write(MADE["ground-2"], tmp_path), Reading())
    assert like.doubt
    written(like, tmp_path)
    assert "DOUBTFUL" in (tmp_path / "a.toml").read_text()


def test_a_law_over_less_than_a_decade_feeds_no_scene(tmp_path):
    with pytest.raises(
        InputError, match=r"no self-affine law fits it: .* over 0\.\d+ decades"
    ):
        propose_like(write(MADE["honed-0"], tmp_path), Reading())


@pytest.mark.parametrize("axis", [0, 1])
def test_ridges_that_are_flat_along_one_axis_have_no_law(tmp_path, axis):
    profile = np.random.default_rng(1).normal(size=64).cumsum()
    heights = np.repeat(np.expand_dims(profile, axis), 64, axis=axis)
    np.save(tmp_path / "ridges.npy", heights)
    with pytest.raises(InputError, match="no self-affine law fits it"):
        propose_like(tmp_path / "ridges.npy", Reading(side="100"))
