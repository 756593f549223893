"""Theories of random rough contact beside contacts on patches without edges.

Surfaces with a power spectrum, so many that waves of one length have all phases, are pressed by
ever larger loads. Everything is dimensionless: pressures over E* h', with h' the rms of the
gradient's modulus, and lengths over the rms height.
"""

import math

import numpy as np

import bem
from bem.analytic import PerssonInterface, area_share
from bench.files import Row
from bench.report import remark
from gen.arrays import Heights, Values
from gen.spectral import SelfAffineSpectrum, generate_spectral

SIDE = 1.0  # um
RMS_SLOPE = 0.1  # which drops out of all ratios
NODES_PER_WAVE = 8  # in the shortest one
# Hurst exponents, and roll-off over cut-off wavelength.
SPECTRA = ((0.8, 1), (0.8, 4), (0.8, 16), (0.5, 16), (0.3, 16))
PRESSURES = np.geomspace(0.005, 1.0, 14)  # E* h'
STEP = 1.03  # ratio of the two loads about each pressure, whose difference gives the stiffness


def theory(nodes: int, surfaces: int) -> list[Row]:
    """Measure area, mean gap and stiffness for all spectra, as means over surfaces of each."""
    rows = []
    for hurst, band in SPECTRA:
        cut_off = NODES_PER_WAVE * SIDE / nodes
        spectrum = SelfAffineSpectrum(hurst, band * cut_off, cut_off)
        heights = [surface(spectrum, nodes, seed) for seed in range(surfaces)]
        measured = np.mean([press(each) for each in heights], axis=0)
        expected = persson(spectrum)
        rms = float(np.mean([each.std() for each in heights]))
        rows += _rows(measured, expected, rms)
        for row in rows[-len(PRESSURES) :]:
            row |= {"hurst": hurst, "band": band, "nayak": nayak(expected), "nodes": nodes}
        remark(f"H = {hurst:g}, band {band:g}: {surfaces} surfaces")
    return rows


def surface(spectrum: SelfAffineSpectrum, nodes: int, seed: int) -> Heights:
    """Generate one of the surfaces, (nodes, nodes) [um]."""
    random = np.random.default_rng(seed)
    return generate_spectral((nodes, nodes), SIDE, spectrum, random, rms_slope=RMS_SLOPE)


def press(heights: Heights) -> Values:
    """Return area [%], corrected area [%], mean gap [um] and compliance, (4, loads).

    Each load is the middle of two: values are their means, the compliance -d(mean gap)/dp [um/MPa]
    their difference.
    """
    loads = RMS_SLOPE * np.outer(PRESSURES, [STEP**-0.5, STEP**0.5])
    contacts = bem.ladder(heights, SIDE, pressures=loads.ravel(), boundary="periodic")
    values = [(each.area_percent, each.corrected_area_percent, each.mean_gap) for each in contacts]
    pairs = np.array(values).reshape(len(loads), 2, 3)
    compliance = -np.diff(pairs[:, :, 2]) / np.diff(loads)
    return np.concatenate([pairs.mean(axis=1), compliance], axis=1).T


def persson(spectrum: SelfAffineSpectrum) -> PerssonInterface:
    """Return Persson's interface with the rms slope of the surfaces.

    The longest wave makes its ring, with all shorter ones, as large as the plane of wavevectors
    less the cell of the one that the patch does not hold, that of infinite length.
    """
    wavenumbers = np.geomspace(2 * math.sqrt(math.pi) / SIDE, 2 * math.pi / spectrum.cut_off, 4000)
    density = spectrum.density(wavenumbers, np.zeros_like(wavenumbers))
    scale = RMS_SLOPE / PerssonInterface(wavenumbers, density).rms_slope()
    return PerssonInterface(wavenumbers, scale**2 * density)


def nayak(theory: PerssonInterface) -> float:
    """Return Nayak's bandwidth parameter alpha = m0 m4 / m2^2 [1]."""
    q, density = theory.wavenumbers, theory.spectrum
    moments = [np.trapezoid(2 * np.pi * q ** (power + 1) * density, q) for power in (0, 2, 4)]
    return float(1.5 * moments[0] * moments[2] / moments[1] ** 2)


def _rows(measured: Values, theory: PerssonInterface, rms: float) -> list[Row]:
    """Return a row for each load; `measured` as `press` returns it, rms height in um."""
    loads, unit = PRESSURES * RMS_SLOPE, RMS_SLOPE / rms
    columns = {
        "pressure": PRESSURES,
        "area_percent": measured[0],
        "corrected_percent": measured[1],
        "persson_percent": 100 * area_share(PRESSURES),
        "mean_gap": measured[2] / rms,
        "persson_mean_gap": theory.mean_gap(loads) / rms,
        "stiffness": 1 / measured[3] / unit,
        "persson_stiffness": theory.stiffness(loads) / unit,
    }
    for name in ("corrected", "area", "persson"):
        columns[f"{name}_slope"] = columns[f"{name}_percent"] / 100 / PRESSURES
    for name in ("stiffness", "persson_stiffness"):
        columns[f"{name}_over_pressure"] = columns[name] / PRESSURES
    return [
        {name: float(values[load]) for name, values in columns.items()}
        for load in range(len(PRESSURES))
    ]
