"""Theories of random rough contact beside contacts on patches without edges.

Surfaces with a power spectrum, so many that waves of one length have all phases, are pressed by
ever larger loads. Everything is dimensionless: pressures over E* h', with h' the rms of the
gradient's modulus, and lengths over the rms height.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

import bem
from bem.analytic import BUSH_GIBSON_THOMAS, PERSSON, PerssonInterface, area_share
from bench.picture import STYLES, new_figure
from bench.report import Report, remark
from gen.arrays import Heights, Values
from gen.spectral import SelfAffineSpectrum, generate_spectral

Row = dict[str, Any]

SIDE = 1.0  # um
RMS_SLOPE = 0.1  # which drops out of all ratios
NODES_PER_WAVE = 8  # in the shortest one
# Hurst exponents, and roll-off over cut-off wavelength.
SPECTRA = ((0.8, 1), (0.8, 4), (0.8, 16), (0.5, 16), (0.3, 16))
PRESSURES = np.geomspace(0.005, 1.0, 14)  # E* h'
STEP = 1.03  # ratio of the two loads about each pressure, whose difference gives the stiffness


def compare(nodes: int, surfaces: int) -> list[Row]:
    """Measure area, mean gap and stiffness for all spectra, as means over surfaces of each."""
    rows = []
    for hurst, band in SPECTRA:
        cut_off = NODES_PER_WAVE * SIDE / nodes
        spectrum = SelfAffineSpectrum(hurst, band * cut_off, cut_off)
        heights = [surface(spectrum, nodes, seed) for seed in range(surfaces)]
        measured = np.mean([press(each) for each in heights], axis=0)
        theory = persson(spectrum)
        rms = float(np.mean([each.std() for each in heights]))
        rows += _rows(measured, theory, rms)
        for row in rows[-len(PRESSURES) :]:
            row |= {"hurst": hurst, "band": band, "nayak": nayak(theory), "nodes": nodes}
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
    return [
        {name: float(values[load]) for name, values in columns.items()}
        for load in range(len(PRESSURES))
    ]


def report(rows: Sequence[Row]) -> Report:
    """Make a report of the rows of `compare`."""
    table = pd.DataFrame(rows)
    pressure, names = table["pressure"], zip(table["hurst"], table["band"], strict=True)
    table["spectrum"] = [f"H = {hurst:g}, band {band:g}" for hurst, band in names]
    table["slope"] = table["corrected_percent"] / 100 / pressure
    table["counted_slope"] = table["area_percent"] / 100 / pressure
    table["ratio"] = table["stiffness"] / pressure
    table["persson_ratio"] = table["persson_stiffness"] / pressure
    pictures = {"area": _area_picture(table), "gap": _gap_picture(table)}
    return Report({"theory": rows}, pictures=pictures)


def _area_picture(table: pd.DataFrame) -> Any:
    """Draw the area, and its ratio to the reduced pressure, over the reduced pressure."""
    figure = new_figure(11, 4.4)
    area, slope = figure.subplots(1, 2)
    _curves(area, table, "corrected_percent")
    _curves(slope, table, "slope", dashed="counted_slope", named=False)
    fine = np.geomspace(PRESSURES[0], PRESSURES[-1], 200)
    for kappa, line, name in ((PERSSON, "k-", "Persson"), (2.0, "k:", "erf with slope 2")):
        share = area_share(fine, kappa)
        area.plot(fine, 100 * share, line, label=name)
        slope.plot(fine, share / fine, line)
    slope.axhline(BUSH_GIBSON_THOMAS, color="0.5", label="Bush, Gibson, Thomas: √(2π)")
    slope.axhline(PERSSON, color="k", ls="--", label="Persson: √(8/π)")
    area.legend()
    slope.legend(loc="lower left")
    area.set(ylabel="contact area [%]", xlim=(0, None), ylim=(0, 100), title="(a) contact area")
    slope.set(ylabel="area share / (p / E* h′)", xscale="log", title="(b) slope κ", ylim=(0.5, 3))
    return figure


def _gap_picture(table: pd.DataFrame) -> Any:
    """Draw mean gap and stiffness over the reduced pressure, Persson's dashed."""
    figure = new_figure(11, 4.4)
    gap, stiffness = figure.subplots(1, 2)
    for panel, column in ((gap, "mean_gap"), (stiffness, "ratio")):
        _curves(panel, table, column, dashed=f"persson_{column}")
        panel.set(xscale="log")
    gap.set(ylabel="mean gap / rms height", ylim=(0, None), title="(a) mean gap")
    stiffness.set(ylabel="dp/dΔ × rms height / p", yscale="log", title="(b) stiffness")
    gap.legend()
    return figure


def _curves(
    panel: Any, table: pd.DataFrame, column: str, *, dashed: str = "", named: bool = True
) -> None:
    """Draw a column over the pressure for each spectrum, and another one beside it, dashed."""
    for style, (name, own) in zip(STYLES, table.groupby("spectrum", sort=False), strict=False):
        panel.plot(own["pressure"], own[column], label=name if named else "", **style)
        if dashed:
            panel.plot(own["pressure"], own[dashed], color=style["color"], ls="--", lw=1)
    panel.set(xlabel="mean pressure p / (E* h′)")
