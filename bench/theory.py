"""Closed forms and theories beside contacts: Hertz's paraboloid, and random surfaces without edges.

`hertz` is the paper's first check (section 2.4). It presses a paraboloid with both kernels on the
paper's two grids, beside the closed form, for E* = 1 MPa. The displacement is measured from the tip
of the paraboloid, which on an even number of nodes is a little above the highest node.

`theory` presses surfaces with a power spectrum by rising loads, beside Persson's theory. All its
results are dimensionless. Pressures are divided by E* h', with the rms slope h' (the rms of the
gradient's modulus), and lengths by the rms height.

`conductance` presses these surfaces on bodies that yield, beside Cooper, Mikic and Yovanovich:
h = 1.25 k (m / sigma) (p / H)^0.95. Here sigma is the rms height, and m the mean absolute slope of
a profile, which is h' / sqrt(pi) for a Gaussian surface.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

import bem
from bem.analytic import Paraboloid, PerssonInterface, area_share, distances_to_centre
from bem.bodies import KERNELS, Kernel
from bench.files import Row
from bench.report import Report, remark
from gen.arrays import Heights, Values
from gen.quantities import AREA, FORCE, MEAN_GAP, UNLOADING
from gen.spectral import SelfAffineSpectrum, generate_spectral

SPHERE = Paraboloid(5000.0)
"""The paraboloid, with a radius of 5000 um at its tip."""

PATCH = 1000.0
"""Side of the patch that the paraboloid presses [um]."""

NODES = (128, 256)
"""Nodes a side of the paper's two grids."""

LARGEST_DELTA = 1.0
"""Largest displacement of the paraboloid [um]."""

STEPS = 50
"""Number of displacements above 0 with which the paraboloid is pressed."""


@dataclass(frozen=True)
class Pressed:
    """The contact of the paraboloid at a displacement."""

    force: float  # normal force [uN]
    area_percent: float  # contact area [% of the patch]


def pressed(kernel: Kernel | None, nodes: int, delta: float) -> Pressed:
    """Press the paraboloid by the solver, or by Hertz's closed form.

    Parameters
    ----------
    kernel : {"uniform-pressure", "concentrated-force"} or None
        Kernel of the solver; None for the closed form.
    nodes : int
        Nodes a side; not used by the closed form.
    delta : float
        Displacement from the touch of the tip, at least 0 [um].

    Returns
    -------
    Pressed
        Force and area.
    """
    if kernel is None:
        radius = SPHERE.contact_radius(delta)
        area_percent = 100 * np.pi * radius**2 / PATCH**2
        return Pressed(SPHERE.force(delta), area_percent)
    heights = SPHERE.heights(distances_to_centre((nodes, nodes), PATCH))
    below_tip = -float(heights.max())  # the tip is at height 0
    contact = bem.solve(heights, PATCH, delta - below_tip, kernel=kernel)
    return Pressed(contact.force, contact.area_percent)


def hertz(steps: int = STEPS) -> list[Row]:
    """Press the paraboloid by the closed form, then with every kernel on every grid.

    Parameters
    ----------
    steps : int
        Number of displacements above zero.

    Returns
    -------
    list of Row
        A row for each solution and displacement. The solution is "hertz" or the kernel; its nodes a
        side are "" for "hertz". Deviations of force and area from Hertz's are in per cent of
        Hertz's at the largest displacement.
    """
    deltas = np.linspace(0, LARGEST_DELTA, steps + 1).tolist()
    closed_form = [pressed(kernel=None, nodes=0, delta=delta) for delta in deltas]
    largest = closed_form[-1]
    solutions: list[tuple[Kernel | None, int]] = [(None, 0), *product(KERNELS, NODES)]
    rows: list[Row] = []
    for kernel, nodes in solutions:
        for delta, exact in zip(deltas, closed_form, strict=True):
            contact = pressed(kernel, nodes, delta)
            force_off = contact.force - exact.force
            area_off = contact.area_percent - exact.area_percent
            rows.append(
                {
                    "solution": kernel or "hertz",
                    "nodes": nodes or "",
                    "delta_um": delta,
                    FORCE.in_tables: contact.force,
                    AREA.name: contact.area_percent,
                    "force_off_percent": 100 * force_off / largest.force,
                    "area_off_percent": 100 * area_off / largest.area_percent,
                }
            )
    return rows


SIDE = 1.0
"""Side of the periodic patches of random surfaces [um]."""

RMS_SLOPE = 0.1
"""Rms slope h' of the random surfaces [1]; no result depends on it."""

NODES_PER_WAVE = 8
"""Nodes in the shortest wave, whose length is the cut-off wavelength."""

SPECTRA = (
    (0.8, 1),
    (0.8, 4),
    (0.8, 16),
    (0.5, 16),
    (0.3, 16),
)
"""Hurst exponent of each spectrum, and its band: roll-off over cut-off wavelength [1]."""

PRESSURES = np.geomspace(0.005, 1.0, 14)
"""Mean pressures [E* h']."""

SOFT = 0.1
"""Hardness in table `conductance`, at which nearly all of the contact yields [E* h']."""

LIGHT = np.geomspace(0.003, 0.1, 8)
"""Mean pressures on bodies that yield, divided by their hardness [1]."""

STEP = 1.03
"""Ratio of two loads about each pressure; the contacts under them give the stiffness [1]."""


def theory(nodes: int, surfaces: int) -> Report:
    """Press surfaces of all spectra, beside the theories, and print the progress.

    Parameters
    ----------
    nodes : int
        Nodes a side.
    surfaces : int
        Number of surfaces of each spectrum; results are means over them.

    Returns
    -------
    Report
        Table `theory` with area, mean gap and stiffness of elastic bodies, for all spectra. Table
        `conductance` of bodies that yield, for the spectra with the first Hurst exponent.
    """
    rows: list[Row] = []
    yielding: list[Row] = []
    for hurst, band in SPECTRA:
        cut_off = NODES_PER_WAVE * SIDE / nodes
        spectrum = SelfAffineSpectrum(hurst, band * cut_off, cut_off)
        heights = [random_surface(spectrum, nodes, seed) for seed in range(surfaces)]
        first_hurst, _ = SPECTRA[0]
        if hurst == first_hurst:
            columns: Row = {"hurst": hurst, "band": band, "nodes": nodes}
            yielding.extend({**row, **columns} for row in conductance(heights))
        interface = persson(spectrum)
        columns = {
            "hurst": hurst,
            "band": band,
            "nayak": nayak(interface),
            "nodes": nodes,
        }
        rows.extend({**row, **columns} for row in _rows(heights, interface))
        remark(f"H = {hurst:g}, band {band:g}: {surfaces} surfaces")
    return Report({"theory": rows, "conductance": yielding})


def conductance(heights: Sequence[Heights]) -> list[Row]:
    """Press bodies that yield at the pressures `LIGHT`, and compute their conductance.

    Parameters
    ----------
    heights : sequence of ndarray, shape (n, n)
        Heights of the surfaces [um].

    Returns
    -------
    list of Row
        A row for each pressure: the pressure over the hardness; the conductance h sigma / (k m),
        its mean over the surfaces; that of Cooper, Mikic and Yovanovich; and the exponent of the
        power law that fits the conductance at all pressures. All are dimensionless.
    """
    hardness = SOFT * RMS_SLOPE
    stiffnesses: list[list[float]] = []
    for surface in heights:
        contacts = bem.ladder(
            surface,
            SIDE,
            hardness=hardness,
            pressures=hardness * LIGHT,
            boundary="periodic",
        )
        stiffnesses.append([contact.interface_stiffness for contact in contacts])
    rms_heights = np.array([surface.std() for surface in heights])
    # The conductance of an interface is proportional to its stiffness: h = k S / (E* area).
    mean_slope = RMS_SLOPE / math.sqrt(math.pi)
    unit = mean_slope * SIDE**2
    # The product is a sum over the surfaces; dividing by their number makes it a mean.
    measured = rms_heights @ stiffnesses / (unit * len(heights))
    expected = 1.25 * LIGHT**0.95
    exponent, _ = np.polyfit(np.log(LIGHT), np.log(measured), 1)
    return [
        {
            "pressure_over_hardness": float(pressure),
            "conductance": float(measured[load]),
            "cooper_mikic_yovanovich": float(expected[load]),
            "exponent": float(exponent),
        }
        for load, pressure in enumerate(LIGHT)
    ]


def random_surface(spectrum: SelfAffineSpectrum, nodes: int, seed: int) -> Heights:
    """Generate a periodic surface with the rms slope `RMS_SLOPE`.

    Parameters
    ----------
    spectrum : SelfAffineSpectrum
        Power spectrum of the heights.
    nodes : int
        Nodes a side.
    seed : int
        Seed of the surface.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um].
    """
    random = np.random.default_rng(seed)
    return generate_spectral((nodes, nodes), SIDE, spectrum, random, rms_slope=RMS_SLOPE)


def press(heights: Heights) -> Values:
    """Press a surface by the mean pressures `PRESSURES`, for E* = 1 MPa.

    Each pressure is the geometric mean of two loads. Areas and mean gaps are means of both
    contacts. The compliance is minus the difference of the two mean gaps over the difference of the
    two loads.

    Parameters
    ----------
    heights : ndarray, shape (n, n)
        Heights of the surface [um].

    Returns
    -------
    ndarray, shape (4, len(PRESSURES))
        A row each for the area [%], the area in the continuum [%], the mean gap [um] and the
        compliance -d(mean gap)/dp [um/MPa].
    """
    ratios = [STEP**-0.5, STEP**0.5]
    loads = RMS_SLOPE * np.outer(PRESSURES, ratios)
    contacts = bem.ladder(heights, SIDE, pressures=loads.ravel(), boundary="periodic")
    values = [
        (contact.area_percent, contact.continuum_area_percent, contact.mean_gap)
        for contact in contacts
    ]
    pairs = np.array(values).reshape(len(loads), 2, 3)
    mean_gaps = pairs[:, :, 2]
    compliance = -np.diff(mean_gaps) / np.diff(loads)
    return np.concatenate([pairs.mean(axis=1), compliance], axis=1).T


def persson(spectrum: SelfAffineSpectrum) -> PerssonInterface:
    """Make Persson's interface with the rms slope of the surfaces.

    The wavevectors of a patch form a lattice with a cell about each. A surface has waves in all
    cells but that of the zero wavevector. The interface therefore has no waves in a disc with the
    area of this cell, and its wavenumbers begin at the radius of the disc.

    Parameters
    ----------
    spectrum : SelfAffineSpectrum
        Isotropic power spectrum of the heights.

    Returns
    -------
    PerssonInterface
        The interface, with wavenumbers in rad/um.
    """
    lowest = 2 * math.sqrt(math.pi) / SIDE
    highest = 2 * math.pi / spectrum.cut_off
    wavenumbers = np.geomspace(
        lowest, highest, 4000
    )  # dense enough for the trapezoidal rule
    density = spectrum.density(wavenumbers, np.zeros_like(wavenumbers))
    scale = RMS_SLOPE / PerssonInterface(wavenumbers, density).rms_slope()
    return PerssonInterface(wavenumbers, scale**2 * density)


def nayak(interface: PerssonInterface) -> float:
    """Compute Nayak's bandwidth parameter alpha = m0 m4 / m2^2 of profiles.

    Parameters
    ----------
    interface : PerssonInterface
        The interface, with an isotropic spectrum.

    Returns
    -------
    float
        The parameter [1].
    """
    q = interface.wavenumbers
    spectrum = interface.spectrum
    m0, m2, m4 = (
        np.trapezoid(2 * np.pi * q ** (power + 1) * spectrum, q) for power in (0, 2, 4)
    )
    # The parameter is that of profiles. If a surface has the moments m0, m2 and m4, its profiles
    # have m0, m2 / 2 and 3 m4 / 8.
    return float(1.5 * m0 * m4 / m2**2)


def _rows(heights: Sequence[Heights], interface: PerssonInterface) -> list[Row]:
    """Return a row for each of `PRESSURES`: means over the surfaces, beside Persson's interface.

    `heights` are in um. Areas are in per cent; the other columns are dimensionless, as the module
    says.
    """
    measured = np.mean([press(surface) for surface in heights], axis=0)
    area, continuum_area, mean_gap, compliance = measured
    rms = float(np.mean([surface.std() for surface in heights]))
    loads = PRESSURES * RMS_SLOPE
    unit = RMS_SLOPE / rms  # unit of the stiffness, E* h' over the rms height [MPa/um]
    persson_area = 100 * area_share(PRESSURES)
    stiffness = 1 / compliance / unit
    persson_stiffness = interface.stiffness(loads) / unit
    columns = {
        "pressure": PRESSURES,
        AREA.name: area,
        "corrected_percent": continuum_area,
        "persson_percent": persson_area,
        MEAN_GAP.name: mean_gap / rms,
        "persson_mean_gap": interface.mean_gap(loads) / rms,
        UNLOADING.name: stiffness,
        "persson_stiffness": persson_stiffness,
        "corrected_slope": continuum_area / 100 / PRESSURES,
        "area_slope": area / 100 / PRESSURES,
        "persson_slope": persson_area / 100 / PRESSURES,
        "stiffness_over_pressure": stiffness / PRESSURES,
        "persson_stiffness_over_pressure": persson_stiffness / PRESSURES,
    }
    return [
        {name: float(values[load]) for name, values in columns.items()}
        for load in range(len(PRESSURES))
    ]
