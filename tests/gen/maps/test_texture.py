"""Spectra, lays and self-affine laws of surfaces that have them by construction."""

import math
import re
from contextlib import redirect_stdout
from io import StringIO

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter

from gen import cli
from gen.maps.areal import areal_parameters
from gen.maps.read import Topography
from gen.maps.texture import (
    SelfAffineFit,
    fit_self_affine,
    nodes_a_wave,
    radial_spectrum,
)
from gen.spectral import SelfAffineSpectrum, generate_spectral
from tests.bem.waves import random_waves
from tests.maps import rough_map

SIDE = 1000.0  # [um]


@pytest.fixture(scope="module")
def wide(tmp_path_factory):
    """The file of a map with a self-affine law of Hurst exponent 0.7."""
    path = tmp_path_factory.mktemp("wide") / "wide.npy"
    law = SelfAffineSpectrum(0.7, 250.0, 16.5)
    random = np.random.default_rng(1)
    np.save(path, generate_spectral((129, 129), SIDE, law, random, rms_height=2.0))
    return path


@pytest.fixture(scope="module")
def law_of_wide(wide):
    """The row of its table and the printed text."""
    table = wide.with_name("row.csv")
    command = ["describe", str(wide), "--side", "1000", "--boundary", "periodic"]
    printed = StringIO()
    with redirect_stdout(printed):
        assert cli.main([*command, "--csv", str(table)]) == 0
    return pd.read_csv(table).iloc[0], printed.getvalue()


def test_the_law_is_in_the_table(law_of_wide):
    row, _ = law_of_wide
    assert row.hurst == pytest.approx(0.7, abs=0.05)
    assert row.law_decades == pytest.approx(math.log10(row.roll_off / row.cut_off))


def test_the_law_is_printed_with_its_range(law_of_wide):
    row, printed = law_of_wide
    law = f"over {row.law_decades:.2g} decades, from {row.roll_off:.4g} to"
    assert law in printed


def test_the_exponents_that_generators_need_are_printed_beside_the_law(law_of_wide):
    _, printed = law_of_wide
    advice = "diamond-square and midpoint need a hurst that is 0.07 to 0.16 larger"
    assert advice in printed


REFUSED = {
    "a depth above the surface": (["wide.npy", "--depth", "-1"], "--depth"),
    "a spectrum that does not exist": (
        ["few.npy", "--spectrum", "s.csv"],
        "--spectrum s.csv: there is none, too few nodes",
    ),
    "an output that is the input": (
        ["wide.npy", "--spectrum", "wide.npy"],
        "is an input: not replaced",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_described_is_one_line(case, wide, capsys, monkeypatch):
    monkeypatch.chdir(wide.parent)
    np.save("few.npy", np.random.default_rng(0).normal(size=(4, 4)))
    arguments, message = REFUSED[case]
    assert cli.main(["describe", *arguments, "--side", "1000"]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(
    ("nodes", "periods", "hurst"), [(128, (4, 0.45), 0.3), (1000, (10, 0.125), 0.5)]
)
def test_a_law_is_found_again(nodes, periods, hurst):
    law = SelfAffineSpectrum(hurst, SIDE / periods[0], SIDE / (periods[1] * nodes))
    random = np.random.default_rng(0)
    heights = generate_spectral((nodes, nodes), SIDE, law, random, rms_height=3.0)
    fit = fit_self_affine(*_with_spectrum(heights))
    assert isinstance(fit, SelfAffineFit), fit
    assert fit.spectrum.hurst == pytest.approx(hurst, abs=0.05)
    assert fit.spectrum.roll_off == pytest.approx(law.roll_off, rel=0.2)
    assert fit.spectrum.cut_off == pytest.approx(law.cut_off, rel=0.05)
    assert fit.rms_height == pytest.approx(3.0, rel=1e-9)
    assert fit.scatter < 1.06
    assert not fit.remarks


@pytest.mark.parametrize("exponent", [0.0, 1.0, 6.0])
def test_slopes_of_no_hurst_exponent_are_refused_or_held_at_the_nearest(exponent):
    frequencies = np.hypot(np.fft.fftfreq(256)[:, None], np.fft.rfftfreq(256)[None, :])
    frequencies[0, 0] = 1.0
    phases = np.exp(2j * math.pi * np.random.default_rng(1).random(frequencies.shape))
    heights = np.fft.irfft2(phases * frequencies ** (-exponent / 2), s=(256, 256))
    fit = fit_self_affine(*_with_spectrum(heights))
    if isinstance(fit, str):
        assert re.search("off the nearest one|flatter than|decades", fit)
    else:
        assert exponent == 6.0
        assert fit.spectrum.hurst == 1.0
        assert any("held at 1" in remark for remark in fit.remarks)


LAYS = {
    "blobs": (
        gaussian_filter(np.random.default_rng(4).normal(size=(128, 128)), 6),
        "decades",
    ),
    "ground": (
        gaussian_filter(np.random.default_rng(4).normal(size=(256, 256)), (1.5, 40)),
        r"directional \(Str 0.0[456].*, slopes along its lay 0.03.* of those across",
    ),
    "at 45 degrees": (
        np.cumsum(np.random.default_rng(1).normal(size=511))[
            np.arange(256)[:, None] + np.arange(256)
        ],
        "directional",
    ),
}


@pytest.mark.parametrize("boundary", ["free", "periodic"])
@pytest.mark.parametrize("name", LAYS)
def test_what_no_exponent_describes_is_refused_with_the_reason(name, boundary):
    heights, reason = LAYS[name]
    topography, spectrum = _with_spectrum(heights, boundary)
    fit = fit_self_affine(
        topography, spectrum, areal_parameters(topography).values["Str"]
    )
    assert isinstance(fit, str), fit
    assert re.search(reason, fit)


SPACING = (0.5, 2.0)  # [um]


def profiles_of(heights, boundary):
    """The spectrum of a map with nodes 0.5 x 2 um apart."""
    nx, ny = heights.shape
    sides = (nx * SPACING[0], ny * SPACING[1])
    return radial_spectrum(Topography("made", heights, sides, boundary=boundary))


@pytest.mark.parametrize("boundary", ["periodic", "free"])
@pytest.mark.parametrize("shape", [(96, 96), (64, 97)])
def test_profiles_of_white_noise_have_its_variance_times_the_spacing(shape, boundary):
    spectrum = profiles_of(np.random.default_rng(0).normal(size=shape), boundary)
    for density, step in ((spectrum.along_x, 0.5), (spectrum.along_y, 2.0)):
        np.testing.assert_allclose(np.nanmean(density), step, rtol=0.1)


@pytest.mark.parametrize("shape", [(96, 96), (64, 97)])
def test_profiles_along_a_sine_have_its_mean_square_in_one_bin(shape):
    side = shape[1] * SPACING[1]
    wavenumbers = 2 * math.pi * np.arange(shape[1] // 2 + 1) / side
    wave = 2.0 * np.sin(2 * math.pi * 8 * np.arange(shape[1]) / shape[1])
    spectrum = profiles_of(np.tile(wave, (shape[0], 1)), "periodic")
    first, last = spectrum.edges.T
    [bin_of_wave] = np.flatnonzero((first <= wavenumbers[8]) & (wavenumbers[8] < last))
    assert np.argmax(np.nan_to_num(spectrum.along_y)) == bin_of_wave
    waves = np.count_nonzero(
        (first[bin_of_wave] <= wavenumbers) & (wavenumbers < last[bin_of_wave])
    )
    # a mean square of 2 is the sum over both signs of the density over the length
    density = spectrum.along_y[bin_of_wave]
    assert 2 * waves * density / side == pytest.approx(2.0)
    assert np.nanmax(spectrum.along_x) < 1e-20


def described(heights, capsys):
    """The lines that `gen describe` prints of a map with nodes 1 um apart."""
    np.save("map.npy", heights)
    assert cli.main(["describe", "map.npy", "--side", "95"]) == 0
    return capsys.readouterr().out.splitlines()


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("axis", "name"), [(0, "x"), (1, "y")])
def test_a_directional_surface_gets_both_of_its_profiles(axis, name, capsys):
    ground = rough_map(stretch=0.42)
    lines = described(ground, capsys)
    assert any("the surface is directional" in line for line in lines)
    profile = next(line for line in lines if line.startswith(f"along {name}"))
    rms_height, rms_slope, wavelength = map(float, profile.split()[2:])
    deviation = (ground - ground.mean(axis=axis, keepdims=True)).std()
    slope = np.sqrt(np.mean(np.diff(ground, axis=axis) ** 2))
    assert rms_height == pytest.approx(deviation, rel=1e-5)
    assert rms_slope == pytest.approx(slope, rel=1e-5)
    assert wavelength == pytest.approx(2 * math.pi * deviation / slope, rel=1e-5)


@pytest.mark.usefixtures("here")
def test_an_isotropic_surface_gets_no_profiles(capsys):
    lines = described(rough_map(), capsys)
    assert not any("Rq um" in line for line in lines)


def _with_spectrum(heights, boundary="periodic"):
    topography = Topography("made", heights, (SIDE, SIDE), boundary=boundary)
    return topography, radial_spectrum(topography)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
@pytest.mark.parametrize("nodes", [4, 8, 16])
def test_the_nodes_of_the_shortest_wave_are_counted(boundary, nodes):
    heights = random_waves(1, 192 // nodes, 0.5, 3)(192)
    topography = Topography("waves", heights, (192.0, 192.0), boundary=boundary)
    counted = nodes_a_wave(radial_spectrum(topography), topography.spacing)
    assert counted == pytest.approx(nodes, rel=0.15)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_a_flat_surface_has_no_shortest_wave(boundary):
    flat = Topography("flat", np.zeros((32, 32)), (1.0, 1.0), boundary=boundary)
    assert math.isnan(nodes_a_wave(radial_spectrum(flat), flat.spacing))
