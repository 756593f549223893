"""Spectra of scans of one surface at different magnifications, joined to one."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from joined_scans import (
    HEIGHTS,
    MAGNIFIED,
    PERIOD,
    save_scans,
    scan,
    scans,
    surface,
)

from gen import cli
from gen.maps.joining import join, shortest_by_tip, wave_range
from gen.maps.read import Topography
from gen.maps.scan import Instrument
from gen.maps.texture import radial_waves
from gen.runtime.errors import InputError
from gen.spectral import SelfAffineSpectrum


def true_density(wavenumbers):
    """The density of the surface itself, whose waves have no windows [um^4]."""
    sides = (float(PERIOD), float(PERIOD))
    waves = radial_waves(Topography("all", HEIGHTS, sides, boundary="periodic"))
    logarithms = np.interp(
        np.log(wavenumbers), np.log(waves.wavenumbers), np.log(waves.density)
    )
    return np.exp(logarithms)


def test_three_scans_give_the_spectrum_of_the_surface_back():
    """Over 1.9 decades: within 10 % in the median bin, each bin within four times its chance.

    The logarithm of the mean of n independent densities has the variance 1 / n by chance; half of
    the waves are independent. Levelling and aliases of short waves add a tenth.
    """
    joined = join(scans())
    spectrum = joined.spectrum
    ratios = spectrum.density / true_density(spectrum.wavenumbers)
    assert joined.warnings == ()
    assert math.log10(spectrum.edges[-1, 1] / spectrum.edges[0, 0]) > 1.85
    assert np.median(np.abs(ratios - 1)) < 0.1
    chance = np.sqrt(2 / spectrum.waves + 0.1**2)
    assert (np.abs(np.log(ratios)) < 4 * chance).all()


def test_the_joined_roughness_is_that_of_the_waves_of_the_surface():
    joined = join(scans())
    largest = max(scan.range.largest for scan in joined.scans)
    assert joined.rms_height == pytest.approx(1.0, rel=0.15)
    wavenumbers = np.geomspace(2 * math.pi / 1024, largest, 400)
    density = true_density(wavenumbers)
    mean_square = np.trapezoid(density * wavenumbers**3, wavenumbers) / (2 * math.pi)
    assert joined.rms_slope == pytest.approx(math.sqrt(mean_square), rel=0.1)


def test_the_joined_law_is_that_of_the_surface_and_no_scan_knows_it_whole():
    fit = join(scans()).fit
    assert fit.spectrum.hurst == pytest.approx(0.8, abs=0.1)
    assert fit.decades > 1.4


@pytest.mark.parametrize(
    ("other", "factor"),
    [(2.0 * surface(), 4.0), (surface(1, SelfAffineSpectrum(0.3, 200.0, 3.0)), 2.0)],
)
def test_scans_that_disagree_are_named(other, factor):
    mixed = [*scans()[:2], scan("fine", other)]
    [warning] = [line for line in join(mixed).warnings if "middle and fine" in line]
    warned = float(warning.partition("by a factor of ")[2].split()[0])
    assert warned > factor / 1.5


def test_waves_that_no_scan_knows_are_named():
    [warning] = join([scan("coarse"), scan("fine", nodes=48)]).warnings
    assert "no scan knows waves of 16 to 24 um" in warning


def test_the_order_of_the_scans_does_not_matter():
    backwards = join(scans()[::-1])
    np.testing.assert_array_equal(
        backwards.spectrum.density, join(scans()).spectrum.density
    )
    assert [scan.name for scan in backwards.scans] == list(MAGNIFIED)


def test_resolution_and_tip_end_the_waves_that_a_scan_knows():
    fine = scan("fine")
    assert wave_range(fine).limit == "nodes"
    coarser = wave_range(replace(fine, instrument=Instrument(cut_off=9.0)))
    assert (coarser.shortest, coarser.limit) == (9.0, "resolution")
    blunt = wave_range(replace(fine, instrument=Instrument(tip_radius=30.0)))
    assert (blunt.limit, blunt.shortest > 4.0) == ("tip", True)


def test_the_tip_cannot_resolve_summits_as_sharp_as_itself():
    """A cosine of length 40 um and amplitude a has the curvature a q^2 at its summits."""
    x = np.arange(400.0)
    wave = 40.0
    sharpest = 0.1 * (2 * math.pi / wave) ** 2
    heights = 0.1 * np.cos(2 * math.pi * x / wave)[:, None] * np.ones(3)
    assert shortest_by_tip(heights, 1.0, 0.4 / sharpest) == 0.0
    blunt = shortest_by_tip(heights, 1.0, 1.0 / sharpest)
    # Over the reach r the curvature of a cosine is that of its summit times sinc(q r / 2)^2.
    share = np.sinc(blunt / 2 / wave) ** 2
    assert share == pytest.approx(0.5, abs=0.05)


@pytest.mark.long
def test_the_limit_of_the_tip_is_that_of_an_independent_library():
    """SurfaceTopography solves for the same length, between the nodes."""
    library = pytest.importorskip("SurfaceTopography")
    heights = scan("fine").heights
    peer = library.Topography(heights, (160.0, 160.0), unit="um")
    expected = peer.scanning_probe_reliability_cutoff(30.0)
    assert shortest_by_tip(heights, 1.0, 30.0) == pytest.approx(expected, rel=0.3)


def test_the_spectrum_of_profiles_is_that_of_an_independent_library():
    """SurfaceTopography averages the spectra of profiles of all scans in ten bins a decade."""
    library = pytest.importorskip("SurfaceTopography")
    container = pytest.importorskip("SurfaceTopography.Container.SurfaceContainer")
    peers = [
        library.Topography(of.heights, tuple(np.add(of.sides, of.spacing)), unit="um")
        for of in scans()
    ]
    wavenumbers, density = container.InMemorySurfaceContainer(peers).power_spectrum("um")
    defined = ~np.ma.getmaskarray(density)
    expected = np.interp(
        np.log(join(scans()).spectrum.wavenumbers),
        np.log(wavenumbers[defined]),
        np.log(density[defined]),
    )
    ours = np.log(join(scans()).spectrum.along_x)
    middle = slice(4, -4)
    assert np.nanmedian(np.abs(ours - expected)[middle]) < 0.25


@pytest.mark.parametrize(
    ("hurst", "nodes", "share"),
    [(0.8, 4, 0.05), (0.8, 3, 0.18), (0.3, 4, 0.4), (0.3, 3, 0.85)],
)
def test_short_waves_add_this_power_to_the_shortest_waves_of_a_scan(hurst, nodes, share):
    """The aliases of a wave along x with a number of nodes, on a power law without an end."""
    number = 200
    aliases = np.arange(-number, number + 1)
    along_x = 1 / nodes + aliases[:, None]
    powers = np.hypot(along_x, aliases[None, :]) ** -(2 + 2 * hurst)
    # The aliases beyond the square add about the integral beyond the circle in it.
    beyond = 2 * math.pi * number ** (-2 * hurst) / (2 * hurst)
    added = (powers.sum() - powers[number, number] + beyond) / powers[number, number]
    assert added == pytest.approx(share, rel=0.1)


def test_a_scan_without_waves_is_refused():
    with pytest.raises(InputError, match="12 x 12 nodes with waves from 4 um"):
        join([scan("coarse"), scan("fine", nodes=12)])
    flat = replace(scan("fine"), heights=np.zeros((160, 160)))
    with pytest.raises(InputError, match="all its heights are equal"):
        join([scan("coarse"), flat])


@pytest.fixture
def files(here):
    """The files coarse.txt, middle.txt and fine.txt."""
    return save_scans(here)


def test_the_command_writes_the_spectrum_with_the_scans_of_each_bin(files, capsys):
    pytest.importorskip("matplotlib")
    line = ["describe", *files, "--join", "--level", "plane"]
    assert cli.main([*line, "--spectrum", "joined.csv", "--plot", "joined.png"]) == 0
    output = capsys.readouterr().out
    assert "joined spectrum of waves of 320 to 4 um" in output
    assert "self-affine law over" in output
    with Path("joined.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["scans"] == "coarse.txt"
    assert {row["scans"] for row in rows} >= {"fine.txt", "coarse.txt; middle.txt"}
    assert Path("joined.png").stat().st_size > 20_000


def test_options_about_single_maps_are_refused(files, refused):
    line = ("describe", *files, "--join")
    assert "--csv" in refused(cli, *line, "--csv", "a.csv")
    assert "--depth" in refused(cli, *line, "--depth", "1")
    assert "give two or more scans" in refused(cli, *line[:2], "--join")
