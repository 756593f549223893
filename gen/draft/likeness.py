"""Propose self-affine surfaces like a measured map: fit a law to its spectrum, and try the law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gen.arrays import Heights
from gen.draft.proposal import with_chosen_steps
from gen.draft.survey import MapSurvey, measure, require_usable, survey_maps
from gen.maps.areal import areal_parameters
from gen.maps.read import Sides, Topography
from gen.maps.settings import Reading
from gen.maps.texture import SelfAffineFit, fit_self_affine, radial_spectrum
from gen.runtime.errors import InputError
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.statistics import rms_slope

NODES = 128  # nodes along each side of the surfaces
# Largest factor by which the spectrum may be off its law, and by which the rms height of generated
# surfaces may be off the map's, without a doubt. Generated isotropic maps have 1.1.
UNLIKE = 1.4
LAY = 1.25  # smallest ratio of the rms slopes along both axes with which a map has a lay
TRIAL_SURFACES = 8  # number of surfaces that are generated and compared with the map
# Period of the generated surfaces in sides of the patch: the generator's default on patches whose
# boundary is not periodic, as the scene has it.
PERIOD = 2
# shortest wavelength of the spectrum in distances of the nodes; the generator needs 2 or more
SHORTEST = 2.02


class NoLaw(InputError):
    """No self-affine law fits a map."""


@dataclass(frozen=True)
class MedianRoughness:
    """The rms height and the rms slope of several surfaces, as medians."""

    rms_height: float  # median [um]
    rms_slope: float  # median; slopes are those between neighbouring nodes [1]


@dataclass(frozen=True)
class Likeness:
    """A self-affine law for a map, and the roughness of surfaces that follow the law."""

    survey: MapSurvey  # survey of the prepared map
    topography: Topography  # the prepared map
    reading: Reading  # how the map is read and prepared
    fit: SelfAffineFit  # fit of the law to the map's spectrum
    # the law in round numbers for the generator, with the stretch of a map that has a lay
    spectrum: SelfAffineSpectrum
    spacing: float  # distance of the nodes of generated surfaces along both axes [um]
    # Value of the generator's parameter: the rms slope of all waves [1]. With it, the rms slope
    # between the nodes of generated surfaces is that of the map's windows.
    rms_slope: float
    windows: MedianRoughness  # roughness of windows of the map
    rms_height: float  # median of the rms heights of generated surfaces with this `rms_slope` [um]
    doubt: str  # why the generated surfaces may not be like the map; "" without such a reason

    def generate(self, shape: tuple[int, int], random: np.random.Generator) -> Heights:
        """Generate a surface of the law at the map's spacing.

        Parameters
        ----------
        shape : tuple of int
            Nodes (nx, ny).
        random : numpy.random.Generator
            Source of the phases. The call moves its state.

        Returns
        -------
        ndarray, shape (nx, ny)
            Heights [um], cut out of a larger period.

        Raises
        ------
        InputError
            If the map's grid is too coarse for the law's waves.
        """
        nx, ny = (PERIOD * nodes for nodes in shape)
        dx, dy = self.topography.spacing
        period = generate_spectral(
            (nx, ny), (nx * dx, ny * dy), self.spectrum, random, rms_slope=self.rms_slope
        )
        return period[: shape[0], : shape[1]]


def propose_like(path: Path, reading: Reading) -> Likeness:
    """Fit a self-affine law to a map, and compare a few surfaces of this law with the map.

    Parameters
    ----------
    path : Path
        File of the map.
    reading : Reading
        Unit, lengths and channel, if the file does not determine them. Steps of the preparation
        that it lacks are chosen for the map.

    Returns
    -------
    Likeness
        The law, and the roughness of windows of the map and of surfaces that follow the law.

    Raises
    ------
    InputError
        If the map cannot be used.
    NoLaw
        If no self-affine law fits it. It is a kind of InputError.
    """
    [survey] = require_usable(survey_maps([path], reading))
    reading = with_chosen_steps(reading, [survey])
    prepared = measure(survey, reading)
    topography = prepared.topography
    if topography is None:
        raise InputError(f"no map can be used: {path}: {prepared.survey.fault}")
    stretch = _stretch(topography)
    fit = _fitted(path, topography, stretch)
    spacing = rounded(min(topography.spacing), 6)
    spectrum = _for_generator(fit.spectrum, stretch, spacing)
    windows = _roughness(_windows(topography.heights), topography.spacing)
    # These surfaces are generated from waves with an rms slope of 1. Their heights and their slopes
    # between nodes are proportional to the slope of the waves.
    unscaled = _roughness(_generated(spectrum, spacing), (spacing, spacing))
    slope_of_waves = windows.rms_slope / unscaled.rms_slope
    rms_height = unscaled.rms_height * slope_of_waves
    return Likeness(
        survey=prepared.survey,
        topography=topography,
        reading=reading,
        fit=fit,
        spectrum=spectrum,
        spacing=spacing,
        rms_slope=rounded(slope_of_waves, 3),
        windows=windows,
        rms_height=rms_height,
        doubt=_doubt(rms_height, windows.rms_height, fit),
    )


def _stretch(topography: Topography) -> float:
    """Estimate wavelengths along x over wavelengths along y from the slopes of a map [1].

    Return 1 for a map without a lay, and for a map that is flat along one axis, whose wavelengths
    along that axis are unknown.
    """
    dx, dy = topography.spacing
    # An infinite spacing makes the slopes along the other axis 0.
    along_x = rms_slope(topography.heights, (dx, math.inf))
    along_y = rms_slope(topography.heights, (math.inf, dy))
    if along_x == 0.0 or along_y == 0.0:
        return 1.0
    ratio = along_y / along_x
    if 1 / LAY < ratio < LAY:
        return 1.0
    return rounded(ratio)


def _fitted(path: Path, topography: Topography, stretch: float) -> SelfAffineFit:
    """Fit a law to a map after dividing its lengths along x by a stretch [1].

    Raise NoLaw, which names the file `path`, if no law fits.
    """
    length, width = topography.sides
    isotropic = replace(topography, sides=(length / stretch, width))
    aspect = areal_parameters(isotropic).values["Str"]
    fit = fit_self_affine(isotropic, radial_spectrum(isotropic), aspect)
    if isinstance(fit, str):  # the reason why no law fits
        if stretch != 1.0:
            fit += (
                f" (lengths along x divided by {stretch:.3g}, because the map has a lay)"
            )
        raise NoLaw(f"{path}: no self-affine law fits it: {fit}")
    return fit


def _for_generator(
    law: SelfAffineSpectrum, stretch: float, spacing: float
) -> SelfAffineSpectrum:
    """Return a law in round numbers with a stretch, for a grid with a spacing [um].

    The cut-off is raised if the grid cannot hold it.
    """
    # A stretch below 1 shortens the waves along x.
    shortest = SHORTEST * spacing * max(1.0, 1 / stretch)
    cut_off = rounded(max(law.cut_off, shortest), 3)
    # Rounding must not put the roll-off below the cut-off.
    roll_off = max(rounded(law.roll_off, 3), cut_off)
    return SelfAffineSpectrum(
        hurst=rounded(law.hurst), roll_off=roll_off, cut_off=cut_off, stretch=stretch
    )


def _generated(spectrum: SelfAffineSpectrum, spacing: float) -> list[Heights]:
    """Generate a few surfaces [um] as the scene will, but with waves of an rms slope of 1.

    `spacing` is the distance of the nodes along both axes [um]. Each surface is cut out of a
    larger period.
    """
    nodes = PERIOD * NODES
    surfaces = []
    for seed in range(TRIAL_SURFACES):
        random = np.random.default_rng(seed)
        period = generate_spectral(
            (nodes, nodes), nodes * spacing, spectrum, random, rms_slope=1.0
        )
        surfaces.append(period[:NODES, :NODES])
    return surfaces


def _windows(heights: Heights) -> list[Heights]:
    """Cut a map [um] into windows side by side of `NODES` x `NODES` nodes.

    Along an axis with fewer nodes there is one window with all of them.
    """
    nx, ny = heights.shape
    starts_x = range(0, max(1, nx - NODES + 1), NODES)
    starts_y = range(0, max(1, ny - NODES + 1), NODES)
    return [heights[i : i + NODES, j : j + NODES] for i in starts_x for j in starts_y]


def _roughness(surfaces: Sequence[Heights], spacing: Sides) -> MedianRoughness:
    """Return the medians of the rms heights and the rms slopes of surfaces.

    `surfaces` are heights [um] on nodes with the distances `spacing` along x and y [um].
    """
    heights = [surface.std() for surface in surfaces]
    slopes = [rms_slope(surface, spacing) for surface in surfaces]
    return MedianRoughness(
        rms_height=float(np.median(heights)), rms_slope=float(np.median(slopes))
    )


def _doubt(generated: float, measured: float, fit: SelfAffineFit) -> str:
    """Say why generated surfaces may not be like the map; return "" without such a reason.

    `generated` and `measured` are rms heights of generated surfaces and of windows of the map [um].
    """
    factor = max(generated / measured, measured / generated)
    if factor > UNLIKE:
        return f"rms heights of generated surfaces are off the map's by a factor of {factor:.2g}"
    if fit.scatter > UNLIKE:
        return f"the map's spectrum is off the law by a factor of {fit.scatter:.2g}"
    return ""


def rounded(value: float, digits: int = 2) -> float:
    """Round a number to a number of significant digits.

    Parameters
    ----------
    value : float
        The number, in any unit.
    digits : int
        Number of significant decimal digits.

    Returns
    -------
    float
        The rounded number, in the same unit.
    """
    return float(f"{value:.{digits}g}")
