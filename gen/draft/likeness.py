"""Propose self-affine surfaces like a measured map: the law of its spectrum, and a trial of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gen.arrays import Heights
from gen.draft.proposal import with_steps
from gen.draft.survey import MapSurvey, measure, require_usable, survey_maps
from gen.maps.areal import areal_parameters
from gen.maps.read import Sides, Topography
from gen.maps.settings import Reading
from gen.maps.texture import SelfAffineFit, fit_self_affine, radial_spectrum
from gen.runtime.errors import InputError
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.statistics import rms_slope

NODES = 128  # nodes along each side of the surfaces
# factor by which a spectrum is off its law, or heights are off the map's, if the law is doubtful:
# isotropic made maps have 1.1
UNLIKE = 1.4
LAY = 1.25  # ratio of the slopes along both axes from which a map has a lay
TRIAL_SURFACES = 8  # surfaces that are generated to compare them with the map
# period of the surfaces in sides of the patch, the generator's for patches without a period
PERIOD = 2
# shortest wavelength that the generator takes, in distances of the nodes: a little over two
SHORTEST = 2.02


@dataclass(frozen=True)
class Roughness:
    """Medians over several surfaces."""

    rms_height: float  # [um]
    rms_slope: float  # between neighbouring nodes [1]


@dataclass(frozen=True)
class Likeness:
    """A self-affine law for a map, and surfaces that follow it."""

    survey: MapSurvey  # the map
    reading: Reading  # how it is read and prepared
    fit: SelfAffineFit  # law of its spectrum
    # the same law as the generator takes it, with the stretch of a lay
    spectrum: SelfAffineSpectrum
    step: float  # distance of the nodes [um]
    # rms slope of the waves with which generated surfaces have the map's slope between nodes [1]
    slope: float
    windows: Roughness  # of windows of the map
    height: float  # rms height of the generated surfaces, median [um]
    doubt: str  # why the surfaces are not like the map, "" if they are


def propose_like(path: Path, reading: Reading) -> Likeness:
    """Fit a self-affine law to a map, and generate a few surfaces to see how like they are.

    Parameters
    ----------
    path : Path
        File of the map.
    reading : Reading
        How the file is read where it does not say it itself.

    Returns
    -------
    Likeness
        The law, and the roughness of the map and of surfaces that follow the law.

    Raises
    ------
    InputError
        If the map cannot be used, or no self-affine law fits it.
    """
    [survey] = require_usable(survey_maps([path], reading))
    reading = with_steps(reading, [survey])
    prepared = measure(survey, reading)
    topography = prepared.topography
    if topography is None:
        raise InputError(f"no map can be used: {path}: {prepared.survey.fault}")
    stretch = _stretch(topography)
    fit = _fitted(path, topography, stretch)
    step = float(f"{min(topography.spacing):.6g}")
    spectrum = _for_generator(fit.spectrum, stretch, step)
    windows = _roughness(_windows(topography.heights), topography.spacing)
    unscaled = _roughness(_generated(spectrum, step), (step, step))
    # The waves of these surfaces have an rms slope of 1. Heights and slopes between nodes are
    # proportional to it: with this one the surfaces are as steep as windows of the map.
    slope = windows.rms_slope / unscaled.rms_slope
    height = unscaled.rms_height * slope
    return Likeness(
        survey=prepared.survey,
        reading=reading,
        fit=fit,
        spectrum=spectrum,
        step=step,
        slope=rounded(slope, 3),
        windows=windows,
        height=height,
        doubt=_doubt(height, windows.rms_height, fit),
    )


def _stretch(topography: Topography) -> float:
    """Return wavelengths along x over those along y by the slopes of a map, 1 without a lay."""
    dx, dy = topography.spacing
    along_x = rms_slope(topography.heights, (dx, math.inf))
    along_y = rms_slope(topography.heights, (math.inf, dy))
    if along_x == 0.0:
        return 1.0
    ratio = along_y / along_x
    if 1 / LAY < ratio < LAY:
        return 1.0
    return rounded(ratio)


def _fitted(path: Path, topography: Topography, stretch: float) -> SelfAffineFit:
    """Fit a law to a map whose stretch is taken out of x; raise InputError if none fits."""
    length, width = topography.sides
    isotropic = replace(topography, sides=(length / stretch, width))
    aspect = areal_parameters(isotropic).values["Str"]
    fit = fit_self_affine(isotropic, radial_spectrum(isotropic), aspect)
    if isinstance(fit, str):
        raise InputError(f"{path}: no self-affine law fits it: {fit}")
    return fit


def _for_generator(
    law: SelfAffineSpectrum, stretch: float, step: float
) -> SelfAffineSpectrum:
    """Return a law in round numbers, whose shortest waves a grid with a step [um] holds."""
    shortest = SHORTEST * step * max(1.0, 1 / stretch)
    cut_off = rounded(max(law.cut_off, shortest), 3)
    roll_off = max(rounded(law.roll_off, 3), cut_off)
    return SelfAffineSpectrum(rounded(law.hurst), roll_off, cut_off, stretch)


def _generated(spectrum: SelfAffineSpectrum, step: float) -> list[Heights]:
    """Generate surfaces [um] as the scene will, but with an rms slope of 1; `step` is in um."""
    nodes = PERIOD * NODES
    surfaces = []
    for seed in range(TRIAL_SURFACES):
        random = np.random.default_rng(seed)
        period = generate_spectral(
            (nodes, nodes), nodes * step, spectrum, random, rms_slope=1.0
        )
        surfaces.append(period[:NODES, :NODES])
    return surfaces


def _windows(heights: Heights) -> list[Heights]:
    """Cut a map into windows side by side, as wide as the surfaces; a small map is one window."""
    along_x, along_y = (range(0, max(1, n - NODES + 1), NODES) for n in heights.shape)
    return [heights[i : i + NODES, j : j + NODES] for i in along_x for j in along_y]


def _roughness(surfaces: Sequence[Heights], spacing: Sides) -> Roughness:
    """Return the medians of the rms heights and slopes of surfaces [um] with a spacing [um]."""
    heights = [surface.std() for surface in surfaces]
    slopes = [rms_slope(surface, spacing) for surface in surfaces]
    return Roughness(float(np.median(heights)), float(np.median(slopes)))


def _doubt(generated: float, measured: float, fit: SelfAffineFit) -> str:
    """Say why generated surfaces are not like the measured ones, or return an empty text.

    The first two parameters are rms heights [um].
    """
    factor = max(generated / measured, measured / generated)
    if factor > UNLIKE:
        return f"rms heights of generated surfaces are off the map's by a factor of {factor:.2g}"
    if fit.scatter > UNLIKE:
        return f"the map's spectrum is off the law by a factor of {fit.scatter:.2g}"
    return ""


def rounded(value: float, digits: int = 2) -> float:
    """Round a number to significant digits.

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
