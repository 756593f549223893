"""Areal parameters and self-affine laws against closed forms, definitions and other programs."""

import math
import re

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter

from gen import cli
from gen.maps.read import Topography
from gen.maps.texture import (
    LAW,
    PARAMETERS,
    SelfAffineFit,
    areal_parameters,
    autocorrelation,
    fit_self_affine,
    nodes_a_wave,
    radial_spectrum,
)
from gen.spectral import SelfAffineSpectrum, generate_spectral
from tests.bem.waves import random_waves

NAMES = [name for name, *_ in PARAMETERS if name != "Smr"]


def values_of(heights, spacing=(1.0, 1.0), boundary="periodic", depth=None):
    cells = [n - (boundary == "free") for n in heights.shape]
    sides = (cells[0] * spacing[0], cells[1] * spacing[1])
    return areal_parameters(Topography("made", heights, sides, boundary=boundary), depth)


def rough(shape=(96, 96), spacing=1.0, seed=1, stretch=1.0):
    sides = (shape[0] * spacing, shape[1] * spacing)
    spectrum = SelfAffineSpectrum(0.8, 16 * spacing, 5 * spacing, stretch)
    random = np.random.default_rng(seed)
    return generate_spectral(shape, sides, spectrum, random, rms_height=0.5)


def test_a_sine_has_its_closed_forms():
    wavelength, amplitude, nodes = 64.0, 2.0, 256
    wave = amplitude * np.sin(2 * math.pi * np.arange(nodes) / wavelength)
    found = values_of(7.0 + np.repeat(wave[:, None], 32, axis=1))
    slope = 2 * math.pi * amplitude / wavelength
    expected = {
        "Sa": 2 * amplitude / math.pi,
        "Sq": amplitude / math.sqrt(2),
        "Sp": amplitude,
        "Sv": amplitude,
        "Sz": 2 * amplitude,
        "Sku": 1.5,
        "Sdq": slope / math.sqrt(2),
        "Sal": wavelength * math.acos(0.2) / (2 * math.pi),
    }
    for name, value in expected.items():
        assert found.values[name] == pytest.approx(value, rel=2e-3), name
    assert found.values["Ssk"] == pytest.approx(0.0, abs=1e-12)
    places = (np.arange(100000) + 0.5) / 100000
    mean = np.mean(np.sqrt(1 + (slope * np.cos(2 * math.pi * places)) ** 2))
    assert found.values["Sdr"] == pytest.approx(100 * (mean - 1), rel=2e-3)
    assert math.isnan(found.values["Str"])  # never falls along the crests
    assert "along all directions" in found.reason


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_the_autocorrelation_is_its_definition(boundary):
    heights = np.random.default_rng(5).normal(size=(7, 10))
    heights -= heights.mean()
    found = autocorrelation(heights, periodic=boundary == "periodic")
    assert found.shape == (4, 11)
    for i, j in ((0, 0), (2, 3), (3, -5), (1, -1)):
        if boundary == "periodic":
            mean = np.mean(heights * np.roll(heights, (-i, -j), axis=(0, 1)))
        else:
            pairs = (
                heights[x, y] * heights[x + i, y + j]
                for x in range(7 - i)
                for y in range(max(-j, 0), min(10 - j, 10))
            )
            mean = sum(pairs) / ((7 - i) * (10 - abs(j)))
        assert found[i, j + 5] == pytest.approx(mean / np.mean(heights**2), abs=1e-12)


OF_SURFALIZE = {
    "normal": (2.62203, 0.95356, 0.93786, 9.13373, 90.63665),
    "exponential": (1.26847, 1.94605, 0.0, 28.66794, 100.0),
}
"""Sk, Spk, Svk, Smr1 and Smr2 that surfalize 0.19.2 gives for the heights below."""


@pytest.mark.parametrize("name", OF_SURFALIZE)
def test_another_program_finds_the_same_core(name):
    """It takes 10,000 points of the curve: its numbers are within 0.2 %, and 1e-3 of 100 %."""
    random = np.random.default_rng(1)
    normal = random.normal(size=(100, 100))
    random.normal(size=(100, 100))
    heights = {"normal": normal, "exponential": random.exponential(size=(100, 100))}[name]
    found = values_of(heights).values
    expected = dict(
        zip(("Sk", "Spk", "Svk", "Smr1", "Smr2"), OF_SURFALIZE[name], strict=True)
    )
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, rel=2e-3, abs=1e-9), key


CURVE = {"Sk", "Spk", "Svk", "Smr1", "Smr2"}
UNDEFINED = {
    "flat": (np.full((20, 30), 3.0), {"Ssk", "Sku", "Sal", "Str"} | CURVE),
    "lost": (
        1e9 + 1e-6 * np.random.default_rng(0).normal(size=(20, 20)),
        {"Ssk", "Sku", "Sdq", "Sdr", "Sal", "Str"} | CURVE,
    ),
    "along x": (np.sin(np.arange(60.0))[:, None] + np.zeros(40), {"Str"}),
    "huge": (1e300 * rough(), set()),
    "tiny": (1e-300 * rough(), set()),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", UNDEFINED)
def test_what_a_surface_does_not_define_is_nan_with_a_reason(case):
    heights, undefined = UNDEFINED[case]
    found = values_of(heights, boundary="free")
    assert list(found.values) == NAMES
    assert {
        name for name, value in found.values.items() if math.isnan(value)
    } == undefined
    assert bool(found.reason) == bool(undefined)


@pytest.mark.usefixtures("here")
def test_describe_prints_and_writes_them_after_the_statistics(capsys):
    np.save("rough.npy", rough())
    ask = ["describe", "rough.npy", "--side", "95", "--depth", "0.5", "--csv", "row.csv"]
    assert cli.main([*ask, "--spectrum", "spectrum.csv"]) == 0
    lines = capsys.readouterr().out.splitlines()
    expected = values_of(rough(), boundary="free", depth=0.5).values
    for name, unit, meaning in PARAMETERS:
        line = next(line for line in lines if line.startswith(f"{name} "))
        assert line.split()[2] == unit
        assert meaning in line
        assert float(line.split()[1]) == pytest.approx(expected[name], rel=1e-5)
    table = pd.read_csv("row.csv")
    further = ["Smr", "Smr_depth", *LAW, "law", "nodes_a_wave", "units"]
    start = list(table.columns).index("warnings") + 1
    assert list(table.columns[start:]) == [*NAMES, *further]
    row = table.iloc[0]
    assert row.Sal == pytest.approx(expected["Sal"])
    assert row.Smr == pytest.approx(expected["Smr"])
    units = dict(each.rsplit(" ", 1) for each in row.units.split("; "))
    told = {
        "nodes_x",
        "nodes_y",
        "side_x_um",
        "side_y_um",
        "prepared",
        "warnings",
        "law",
        "units",
    }
    assert set(units) == set(table.columns) - told
    assert (units["Smr1"], units["height_rms"], units["roll_off"]) == ("%", "um", "um")
    assert row.law.startswith("none: the spectrum follows a power law over 0.")
    spectrum = pd.read_csv("spectrum.csv")
    made = radial_spectrum(Topography("made", rough(), (95.0, 95.0)))
    np.testing.assert_allclose(spectrum.density_um4, made.density, rtol=1e-12)
    np.testing.assert_allclose(spectrum.density_x_um3, made.along_x, rtol=1e-12)
    np.testing.assert_allclose(spectrum.density_y_um3, made.along_y, rtol=1e-12)
    np.testing.assert_allclose(
        spectrum.wavelength_um * spectrum.wavenumber_per_um, 2 * math.pi
    )


@pytest.mark.usefixtures("here")
def test_the_law_is_in_the_table_and_what_cannot_be_is_one_line(capsys):
    law = SelfAffineSpectrum(0.7, 250.0, 16.5)
    random = np.random.default_rng(1)
    np.save(
        "wide.npy", generate_spectral((129, 129), 1000.0, law, random, rms_height=2.0)
    )
    np.save("few.npy", np.random.default_rng(0).normal(size=(4, 4)))
    ask = [
        "describe",
        "wide.npy",
        "--side",
        "1000",
        "--boundary",
        "periodic",
        "--csv",
        "row.csv",
    ]
    assert cli.main(ask) == 0
    row = pd.read_csv("row.csv").iloc[0]
    assert row.hurst == pytest.approx(0.7, abs=0.05)
    assert row.law_decades == pytest.approx(math.log10(row.roll_off / row.cut_off))
    said = capsys.readouterr().out
    assert f"over {row.law_decades:.2g} decades, from {row.roll_off:.4g} to" in said
    assert (
        "diamond-square and midpoint give it if they are asked for 0.07 to 0.16 more"
        in said
    )
    for options, told in (
        (["wide.npy", "--depth", "-1"], "--depth"),
        (
            ["few.npy", "--spectrum", "s.csv"],
            "--spectrum s.csv: there is none, too few nodes",
        ),
        (["wide.npy", "--spectrum", "wide.npy"], "is an input: not replaced"),
    ):
        assert cli.main(["describe", *options, "--side", "1000"]) == 2
        assert told in capsys.readouterr().err.splitlines()[-1]


SIDE = 1000.0


@pytest.mark.parametrize(
    ("nodes", "periods", "hurst"), [(128, (4, 0.45), 0.3), (1000, (10, 0.125), 0.5)]
)
def test_a_law_is_found_again(nodes, periods, hurst):
    asked = SelfAffineSpectrum(hurst, SIDE / periods[0], SIDE / (periods[1] * nodes))
    random = np.random.default_rng(0)
    heights = generate_spectral((nodes, nodes), SIDE, asked, random, rms_height=3.0)
    fit = fit_self_affine(*_with_spectrum(heights))
    assert isinstance(fit, SelfAffineFit), fit
    assert fit.spectrum.hurst == pytest.approx(hurst, abs=0.05)
    assert fit.spectrum.roll_off == pytest.approx(asked.roll_off, rel=0.2)
    assert fit.spectrum.cut_off == pytest.approx(asked.cut_off, rel=0.05)
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


@pytest.mark.parametrize("shape", [(96, 96), (64, 97)])
def test_spectra_of_profiles_hold_their_mean_squares(shape):
    """White noise has the density of its variance times the spacing, and a sine its own bin."""
    spacing = (0.5, 2.0)
    sides = (shape[0] * spacing[0], shape[1] * spacing[1])
    noise = np.random.default_rng(0).normal(size=shape)
    for boundary in ("periodic", "free"):
        spectrum = radial_spectrum(Topography("noise", noise, sides, boundary=boundary))
        for density, step in ((spectrum.along_x, 0.5), (spectrum.along_y, 2.0)):
            known = density[np.isfinite(density)]
            np.testing.assert_allclose(np.mean(known), step, rtol=0.1)
    wave = 2.0 * np.sin(2 * math.pi * 8 * np.arange(shape[1]) / shape[1])
    tall = Topography("wave", np.tile(wave, (shape[0], 1)), sides, boundary="periodic")
    spectrum = radial_spectrum(tall)
    q = 2 * math.pi * 8 / sides[1]
    inside = (spectrum.edges[:, 0] <= q) & (q < spectrum.edges[:, 1])
    assert np.argmax(np.nan_to_num(spectrum.along_y)) == np.flatnonzero(inside)[0]
    count = np.count_nonzero(
        (
            spectrum.edges[inside][0, 0]
            <= 2 * math.pi * np.arange(shape[1] // 2 + 1) / sides[1]
        )
        & (
            2 * math.pi * np.arange(shape[1] // 2 + 1) / sides[1]
            < spectrum.edges[inside][0, 1]
        )
    )
    # a mean square of 2 is the sum over both signs of the density over the length
    assert 2 * count * spectrum.along_y[inside][0] / sides[1] == pytest.approx(2.0)
    assert np.nanmax(spectrum.along_x) < 1e-20


@pytest.mark.usefixtures("here")
def test_a_directional_surface_gets_both_of_its_profiles(capsys):
    ground = rough((96, 96), stretch=0.42)
    np.save("ground.npy", ground)
    assert cli.main(["describe", "ground.npy", "--side", "95"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any("the surface is directional" in line for line in lines)
    for axis, name in enumerate("xy"):
        _, rq, rdq, wavelength = (
            next(line for line in lines if line.startswith(f"along {name}"))
            .removeprefix("along")
            .split()
        )
        expected = ground - ground.mean(axis=axis, keepdims=True)
        assert float(rq) == pytest.approx(expected.std(), rel=1e-5)
        slope = np.sqrt(np.mean(np.diff(ground, axis=axis) ** 2))
        assert float(rdq) == pytest.approx(slope, rel=1e-5)
        assert float(wavelength) == pytest.approx(
            2 * math.pi * expected.std() / slope, rel=1e-5
        )
    np.save("even.npy", rough())
    assert cli.main(["describe", "even.npy", "--side", "95"]) == 0
    assert "Rq um" not in capsys.readouterr().out


def _with_spectrum(heights, boundary="periodic"):
    topography = Topography("made", heights, (SIDE, SIDE), boundary=boundary)
    return topography, radial_spectrum(topography)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
@pytest.mark.parametrize("nodes", [4, 8, 16])
def test_the_nodes_of_the_shortest_wave_are_counted(boundary, nodes):
    heights = random_waves(1, 192 // nodes, 0.5, 3)(192)
    topography = Topography("waves", heights, (192.0, 192.0), boundary=boundary)
    found = nodes_a_wave(radial_spectrum(topography), topography.spacing)
    assert found == pytest.approx(nodes, rel=0.15)
    flat = Topography("flat", np.zeros((32, 32)), (1.0, 1.0), boundary=boundary)
    assert math.isnan(nodes_a_wave(radial_spectrum(flat), flat.spacing))
