"""Closed forms and theories beside contacts: Hertz's paraboloid, and random surfaces without edges.

`hertz` is the paper's first check (section 2.4): both kernels on the paper's two grids, beside the
closed form, for E* = 1 MPa. The displacement counts from the paraboloid's tip, which on an even
number of nodes lies a little above the highest of them.

`theory` presses surfaces with a power spectrum by ever larger loads. Everything is dimensionless:
pressures over E* h', with h' the rms of the gradient's modulus, and lengths over the rms height.
`conductance` presses the same surfaces of bodies that yield, beside Cooper, Mikic and Yovanovich:
h = 1.25 k (m / sigma) (p / H)^0.95, with sigma the rms height and m the mean absolute slope of a
profile, which of a Gaussian surface is h' / sqrt(pi).
"""

import math
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

import bem
from bem.analytic import Paraboloid, PerssonInterface, area_share, distances_to_centre
from bem.influence import KERNELS, Kernel
from bench.files import Row
from bench.report import Report, remark
from gen.arrays import Heights, Values
from gen.quantities import AREA, FORCE, MEAN_GAP, UNLOADING
from gen.spectral import SelfAffineSpectrum, generate_spectral

SPHERE = Paraboloid(5000.0)
PATCH = 1000.0  # um
NODES = (128, 256)
LARGEST_DELTA = 1.0  # um
STEPS = 50


def pressed(kernel: Kernel | None, nodes: int, delta: float) -> tuple[float, float]:
    """Return force [uN] and area [% of the patch], by Hertz without a kernel."""
    if kernel is None:
        return SPHERE.force(delta), 100 * np.pi * SPHERE.contact_radius(
            delta
        ) ** 2 / PATCH**2
    heights = SPHERE.heights(distances_to_centre((nodes, nodes), PATCH))
    contact = bem.solve(heights, PATCH, delta + float(heights.max()), kernel=kernel)
    return contact.force, contact.area_percent


def hertz(steps: int = STEPS) -> list[Row]:
    """Compute the closed form first, then every kernel on every grid, at `steps` displacements.

    A row names the solution, "hertz" or the kernel, and its nodes a side, "" for the closed form.
    Deviations of force and area are in per cent of Hertz's at the largest displacement.
    """
    deltas = np.linspace(0, LARGEST_DELTA, steps + 1).tolist()
    exact = [pressed(None, 0, each) for each in deltas]
    rows: list[Row] = []
    cases: list[tuple[Kernel | None, int]] = [(None, 0), *product(KERNELS, NODES)]
    for kernel, nodes in cases:
        for delta, right in zip(deltas, exact, strict=True):
            force, area = pressed(kernel, nodes, delta)
            row: Row = {
                "solution": kernel or "hertz",
                "nodes": nodes or "",
                "delta_um": delta,
            }
            row |= {FORCE.in_tables: force, AREA.name: area}
            row["force_off_percent"] = 100 * (force - right[0]) / exact[-1][0]
            rows.append(
                row | {"area_off_percent": 100 * (area - right[1]) / exact[-1][1]}
            )
    return rows


SIDE = 1.0  # um
RMS_SLOPE = 0.1  # which drops out of all ratios
NODES_PER_WAVE = 8  # in the shortest one
# Hurst exponents, and roll-off over cut-off wavelength.
SPECTRA = ((0.8, 1), (0.8, 4), (0.8, 16), (0.5, 16), (0.3, 16))
PRESSURES = np.geomspace(0.005, 1.0, 14)  # E* h'
SOFT = 0.1  # hardness [E* h'] of bodies that yield nearly wherever they touch
LIGHT = np.geomspace(0.003, 0.1, 8)  # their pressures over the hardness
STEP = 1.03  # ratio of the two loads about each pressure, whose difference gives the stiffness


def theory(nodes: int, surfaces: int) -> Report:
    """Measure area, mean gap and stiffness for all spectra, as means over surfaces of each.

    Of the spectra with the first Hurst exponent, the conductance of bodies that yield too.
    """
    rows, yielding = [], []
    for hurst, band in SPECTRA:
        cut_off = NODES_PER_WAVE * SIDE / nodes
        spectrum = SelfAffineSpectrum(hurst, band * cut_off, cut_off)
        heights = [random_surface(spectrum, nodes, seed) for seed in range(surfaces)]
        if hurst == SPECTRA[0][0]:
            found = conductance(heights)
            yielding += [
                {**row, "hurst": hurst, "band": band, "nodes": nodes} for row in found
            ]
        measured = np.mean([press(each) for each in heights], axis=0)
        expected = persson(spectrum)
        rms = float(np.mean([each.std() for each in heights]))
        rows += _rows(measured, expected, rms)
        for row in rows[-len(PRESSURES) :]:
            row |= {
                "hurst": hurst,
                "band": band,
                "nayak": nayak(expected),
                "nodes": nodes,
            }
        remark(f"H = {hurst:g}, band {band:g}: {surfaces} surfaces")
    return Report({"theory": rows, "conductance": yielding})


def conductance(heights: Sequence[Heights]) -> list[Row]:
    """Return the mean conductance h sigma / (k m) over the pressure, and the fitted exponent."""
    hardness = SOFT * RMS_SLOPE
    settings: dict[str, Any] = {"pressures": hardness * LIGHT, "boundary": "periodic"}
    unit = RMS_SLOPE / math.sqrt(math.pi) * SIDE**2
    stiffnesses = [
        [
            each.interface_stiffness
            for each in bem.ladder(own, SIDE, hardness=hardness, **settings)
        ]
        for own in heights
    ]
    measured = (
        np.array([own.std() for own in heights]) @ stiffnesses / (unit * len(heights))
    )
    exponent, _ = np.polyfit(np.log(LIGHT), np.log(measured), 1)
    found = np.stack([LIGHT, measured, 1.25 * LIGHT**0.95], axis=1).tolist()
    names = "pressure_over_hardness", "conductance", "cooper_mikic_yovanovich"
    return [
        {**dict(zip(names, row, strict=True)), "exponent": float(exponent)}
        for row in found
    ]


def random_surface(spectrum: SelfAffineSpectrum, nodes: int, seed: int) -> Heights:
    """Generate one of the surfaces, (nodes, nodes) [um]."""
    random = np.random.default_rng(seed)
    return generate_spectral((nodes, nodes), SIDE, spectrum, random, rms_slope=RMS_SLOPE)


def press(heights: Heights) -> Values:
    """Return area [%], area in the continuum [%], mean gap [um] and compliance, (4, loads).

    Each load is the middle of two: values are their means, the compliance -d(mean gap)/dp [um/MPa]
    their difference.
    """
    loads = RMS_SLOPE * np.outer(PRESSURES, [STEP**-0.5, STEP**0.5])
    contacts = bem.ladder(heights, SIDE, pressures=loads.ravel(), boundary="periodic")
    values = [
        (each.area_percent, each.continuum_area_percent, each.mean_gap)
        for each in contacts
    ]
    pairs = np.array(values).reshape(len(loads), 2, 3)
    compliance = -np.diff(pairs[:, :, 2]) / np.diff(loads)
    return np.concatenate([pairs.mean(axis=1), compliance], axis=1).T


def persson(spectrum: SelfAffineSpectrum) -> PerssonInterface:
    """Return Persson's interface with the rms slope of the surfaces.

    The longest wave makes its ring, with all shorter ones, as large as the plane of wavevectors
    less the cell of the one that the patch does not hold, that of infinite length.
    """
    wavenumbers = np.geomspace(
        2 * math.sqrt(math.pi) / SIDE, 2 * math.pi / spectrum.cut_off, 4000
    )
    density = spectrum.density(wavenumbers, np.zeros_like(wavenumbers))
    scale = RMS_SLOPE / PerssonInterface(wavenumbers, density).rms_slope()
    return PerssonInterface(wavenumbers, scale**2 * density)


def nayak(theory: PerssonInterface) -> float:
    """Return Nayak's bandwidth parameter alpha = m0 m4 / m2^2 [1]."""
    q, density = theory.wavenumbers, theory.spectrum
    moments = [
        np.trapezoid(2 * np.pi * q ** (power + 1) * density, q) for power in (0, 2, 4)
    ]
    return float(1.5 * moments[0] * moments[2] / moments[1] ** 2)


def _rows(measured: Values, theory: PerssonInterface, rms: float) -> list[Row]:
    """Return a row for each load; `measured` as `press` returns it, rms height in um."""
    loads, unit = PRESSURES * RMS_SLOPE, RMS_SLOPE / rms
    columns = {
        "pressure": PRESSURES,
        AREA.name: measured[0],
        "corrected_percent": measured[1],
        "persson_percent": 100 * area_share(PRESSURES),
        MEAN_GAP.name: measured[2] / rms,
        "persson_mean_gap": theory.mean_gap(loads) / rms,
        UNLOADING.name: 1 / measured[3] / unit,
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
