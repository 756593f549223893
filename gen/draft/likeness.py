"""Propose a scene of self-affine surfaces like a measured map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gen.arrays import Heights
from gen.draft.proposal import (
    Loads,
    Material,
    choose_loads,
    known_texture,
    require_used,
    rounded,
    with_steps,
)
from gen.draft.scene_text import Key, contact_keys, load_keys, number, quoted, span
from gen.draft.survey import MapSurvey, survey, with_texture
from gen.maps.areal import areal_parameters
from gen.maps.prepare import prepare
from gen.maps.read import Topography, read
from gen.maps.self_affine import SelfAffineFit, fit_self_affine, radial_spectrum
from gen.maps.settings import Reading, said
from gen.runtime.errors import InputError
from gen.runtime.terminal import to_type
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.statistics import rms_slope

NODES = 128
"""Nodes along each side of the surfaces."""

SURFACES = 600
"""Number of surfaces."""

LOADS_PER_SURFACE = 5
"""Loads of each surface."""

AROUND = 1.25
"""Factor by which the lengths and the slope of the population differ from the map's, at most."""

EXPONENTS = 0.05
"""Distance of the population's Hurst exponents from the map's, at most."""

UNLIKE = 1.4
"""Factor by which a spectrum is off its law, or heights are off the map's, if the law is doubtful:
isotropic made maps have 1.1."""

LAY = 1.25
"""Ratio of the slopes along both axes from which a map has a lay."""

TRIED = 8
"""Surfaces that are generated to compare them with the map."""

PERIOD = 2
"""Period of the surfaces in sides of the patch, the generator's for patches without a period."""


@dataclass(frozen=True)
class Likeness:
    """A self-affine law for a map, and surfaces that follow it."""

    look: MapSurvey  # the map
    reading: Reading  # how it is read and prepared
    fit: SelfAffineFit  # law of its spectrum
    # the same law as the generator takes it, with the stretch of a lay
    spectrum: SelfAffineSpectrum
    step: float  # distance of the nodes [um]
    # rms slope of the waves with which generated surfaces have the map's slope between nodes [1]
    slope: float
    # rms height [um] and rms slope between nodes [1] of windows of the map, medians
    windows: tuple[float, float]
    height: float  # rms height of the generated surfaces, median [um]
    loads: Loads  # loads of the scene
    material: Material  # elastic constants and hardness

    @property
    def doubt(self) -> str:
        """Why the surfaces are not like the map, "" if they are."""
        off = max(self.height / self.windows[0], self.windows[0] / self.height)
        if off > UNLIKE:
            return (
                f"rms heights of the generated surfaces are off the map's by a factor of {off:.2g}"
            )
        if self.fit.scatter > UNLIKE:
            return f"the map's spectrum is off the law by a factor of {self.fit.scatter:.2g}"
        return ""


def propose(path: Path, reading: Reading, material: Material) -> Likeness:
    """Fit a self-affine law to a map, and generate a few surfaces to see how like they are.

    Raises InputError if the map cannot be read, or no self-affine law fits its spectrum.
    """
    [look] = require_used(survey([path], reading))
    reading = with_steps(reading, [look])
    [look] = require_used([with_texture(look, reading, None)])
    topography = prepare(read(path, reading), reading)
    stretch = _stretch(topography)
    fit = _fit(topography, stretch)
    if isinstance(fit, str):
        raise InputError(f"{path}: no self-affine law fits it: {fit}")
    step = float(f"{min(topography.spacing):.6g}")
    spectrum = _on_grid(fit.spectrum, stretch, step)
    windows = _medians(_windows(topography.heights), topography.spacing)
    height, unscaled = _medians(_generated(spectrum, step), (step, step))
    slope = windows[1] / unscaled  # of the waves, where that between nodes is the map's
    return Likeness(
        look=look,
        reading=reading,
        fit=fit,
        spectrum=spectrum,
        step=step,
        slope=rounded(slope, 3),
        windows=windows,
        height=slope * height,
        loads=choose_loads(material, [known_texture(look).rms_slope], NODES**2),
        material=material,
    )


def _windows(heights: Heights) -> list[Heights]:
    """Cut a map into windows of the surfaces' nodes; a smaller map is one window."""
    x, y = (range(0, max(1, nodes - NODES + 1), NODES) for nodes in heights.shape)
    return [heights[i : i + NODES, j : j + NODES] for i in x for j in y]


def _generated(spectrum: SelfAffineSpectrum, step: float) -> list[Heights]:
    """Generate some surfaces as the scene will, whose waves have an rms slope of 1."""
    nodes = PERIOD * NODES
    whole = (
        generate_spectral(
            (nodes, nodes), nodes * step, spectrum, np.random.default_rng(seed), rms_slope=1.0
        )
        for seed in range(TRIED)
    )
    return [surface[:NODES, :NODES] for surface in whole]


def _stretch(topography: Topography) -> float:
    """Return wavelengths along x over those along y, from the rms slopes; 1 if it is near that."""
    heights, spacing = topography.heights, topography.spacing
    along_x, along_y = (
        float(np.sqrt(np.mean((np.diff(heights, axis=axis) / spacing[axis]) ** 2)))
        for axis in (0, 1)
    )
    lay = along_y / along_x if along_x else 1.0
    return 1.0 if 1 / LAY < lay < LAY else rounded(lay)


def _fit(topography: Topography, stretch: float) -> SelfAffineFit | str:
    """Fit the law to a map whose lengths along x are divided by the stretch: it has no lay.

    Wavelengths of a stretched spectrum are those along y, which stay as they are.
    """
    sides = (topography.sides[0] / stretch, topography.sides[1])
    isotropic = replace(topography, sides=sides)
    aspect = areal_parameters(isotropic).values["Str"]
    return fit_self_affine(isotropic, radial_spectrum(isotropic), aspect)


def _on_grid(law: SelfAffineSpectrum, stretch: float, step: float) -> SelfAffineSpectrum:
    """Give a law a stretch, and no waves that the grid does not hold."""
    shortest = 2.02 * step * max(1.0, 1 / stretch)
    cut_off = rounded(max(law.cut_off, shortest), 3)
    roll_off = max(rounded(law.roll_off, 3), cut_off)
    return SelfAffineSpectrum(rounded(law.hurst), roll_off, cut_off, stretch)


def _medians(surfaces: list[Heights], spacing: tuple[float, float]) -> tuple[float, float]:
    """Return the medians of rms height [um] and rms slope."""
    return (
        float(np.median([surface.std() for surface in surfaces])),
        float(np.median([rms_slope(surface, spacing) for surface in surfaces])),
    )


def keys(likeness: Likeness, command: str, output: Path) -> Iterator[Key]:
    """Yield the keys of a scene with their comments."""
    name = likeness.look.path.name
    yield Key(
        f"Self-affine surfaces around {name}, a start for a population of your own. Written by\n"
        f"    {command}\nThe map was {_prepared(likeness.reading)}. Then\n"
        f"    {to_type(f'gen estimate {output}')}\n"
        f"    {to_type('gen run')} {output} -o {output.with_suffix('.h5')}"
    )
    yield Key("", "title", quoted(f"Self-affine surfaces like {name}"))
    yield Key(
        f"{SURFACES} surfaces, each under {LOADS_PER_SURFACE} loads. A database can grow: raise"
        " samples, and run again.",
        "samples",
        str(SURFACES * LOADS_PER_SURFACE),
    )
    yield Key("", "samples_per_surface", str(LOADS_PER_SURFACE))
    yield Key("Another seed draws other surfaces and loads.", "seed", "2025")
    yield from _surface_keys(likeness)
    yield from load_keys(likeness.loads, likeness.material)
    yield from contact_keys(
        likeness.material,
        'As for windows of maps, which surrogates of this scene can then predict. "periodic" would'
        " make each surface its own period.",
    )


def _prepared(steps: Reading) -> str:
    """Say how the map was prepared, in words of the options of `gen contact`."""
    taken = [f"despike {steps.despike:g}"] if steps.despike is not None else []
    taken += [f"level {steps.level}"] + ["fill"] * steps.fill
    return f"prepared by {' '.join(said(each, 'option') for each in taken)}"


def _surface_keys(likeness: Likeness) -> Iterator[Key]:
    """Yield the table of the surfaces."""
    fit, spectrum = likeness.fit, likeness.spectrum
    side = NODES * likeness.step
    yield Key("", "[surface]")
    yield Key("", "generator", quoted("spectral"))
    yield Key(f"The map's spacing, {likeness.step:g} um.", "nodes", str(NODES))
    yield Key("um, nodes times spacing.", "side", number(rounded(side, 6)))
    remarks = f" The fit says: {'; '.join(fit.remarks)}." if fit.remarks else ""
    yield Key(
        f"The fit to the map's radial power spectrum: Hurst exponent {fit.spectrum.hurst:.2f},"
        f" roll-off {fit.spectrum.roll_off:.3g} um, cut-off {fit.spectrum.cut_off:.3g} um,"
        f" {fit.decades:.2g} decades; the spectrum is off the law by a factor of"
        f" {fit.scatter:.2g} (rms).{remarks}"
        f" Ranges around it, by {EXPONENTS:g} and a factor of {AROUND:g}, give a surrogate"
        " something to tell apart; single numbers give one spectrum.",
        "hurst",
        span(
            rounded(max(0.0, spectrum.hurst - EXPONENTS), 3),
            rounded(min(1.0, spectrum.hurst + EXPONENTS), 3),
        ),
    )
    low = max(spectrum.roll_off / AROUND, spectrum.cut_off)
    yield Key(
        "um, the longest wavelength of the power law; longer waves have the same density.",
        "roll_off",
        span(rounded(low, 4), rounded(spectrum.roll_off * AROUND, 4)),
    )
    yield Key("um, the shortest wavelength of all.", "cut_off", number(spectrum.cut_off))
    yield Key(_slope_words(likeness), "rms_slope", span(*_around(likeness.slope)))
    if spectrum.stretch != 1.0:
        yield Key(
            "The map has a lay: wavelengths along x over those along y, from its slopes along both"
            " axes. The wavelengths above are those along y.",
            "stretch",
            number(spectrum.stretch),
        )


def _slope_words(likeness: Likeness) -> str:
    """Compare windows of the map with generated surfaces."""
    height, slope = likeness.windows
    said = (
        f"With {likeness.slope:.3g}, {TRIED} generated surfaces have the map's rms slope between"
        f" nodes, {slope:.3g}, and an rms height of {likeness.height:.3g} um, where windows of the"
        f" map have {height:.3g} um (medians)."
    )
    if likeness.doubt:
        said += f" DOUBTFUL: {likeness.doubt}. Windows of the map are safer: `gen scene MAP`."
    return said


def _around(value: float) -> tuple[float, float]:
    """Return a range around a value."""
    return rounded(value / AROUND, 3), rounded(value * AROUND, 3)
