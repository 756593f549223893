"""The description of one surface: a row of its numbers, and its picture."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.arrays import Heights
from gen.fields import FINE_HEIGHT, Map, axis_unit, draw_map
from gen.maps.areal import PARAMETERS
from gen.maps.contacts import boundary_cell
from gen.maps.read import Topography
from gen.maps.self_affine import LAW, RadialSpectrum, SelfAffineFit
from gen.runtime.documents import Row
from gen.runtime.figure import save
from gen.runtime.terminal import shortened
from gen.schema import statistics_columns

if TYPE_CHECKING:
    from gen.statistics import Description

BINS = 80
"""Number of bars of the height distribution."""

LETTERS = 110
"""Letters in a line of the spectrum's title."""

SLIVER = 4.0
"""Ratio of the sides beyond which the map fills its panel, as the title then says."""


def draw_surface(
    figure: Any,
    topography: Topography,
    spectrum: RadialSpectrum,
    fit: SelfAffineFit | str,
    picture: Path,
) -> None:
    """Draw the heights, the height distribution with the bearing curve, and the power spectrum.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty figure.
    topography : Topography
        Surface without holes.
    spectrum : RadialSpectrum
        Its radial power spectrum.
    fit : SelfAffineFit or str
        The law that fits it, or the reason why there is none.
    picture : Path
        Picture to write.
    """
    top, bottom = figure.subfigures(2, 1, height_ratios=[1.12, 1.0])
    left, right = top.subplots(1, 2, width_ratios=[1.15, 1.0])
    figure.suptitle(shortened(topography.name), fontsize=11, parse_math=False)
    heights = topography.heights
    title = f"heights, {heights.shape[0]} x {heights.shape[1]} nodes"
    draw_map(left, Map(heights, topography.sides, title, "height", "µm", "viridis"), 50)
    if max(topography.sides) > SLIVER * min(topography.sides):
        left.set_aspect("auto")
        left.set_title(f"{left.get_title(loc='left')}\nnot to scale", loc="left", fontsize=10)
    _draw_distribution(right, heights)
    _draw_spectrum(bottom.subplots(), spectrum, fit)
    save(figure, picture)


def _draw_distribution(axis: Any, heights: Heights) -> None:
    """Draw the share of the surface over the height, and the share that is above each height."""
    axis.set_title("height distribution and bearing curve", loc="left", fontsize=10)
    factor, unit = axis_unit(float(np.ptp(heights)), FINE_HEIGHT)
    axis.set_ylabel(f"height above the mean [{unit}]")
    axis.set_xlabel(f"share of the surface per {unit} [%]", color="tab:blue")
    above = factor * np.sort(heights.ravel() - heights.mean())[::-1]
    if above[0] == above[-1]:
        axis.text(0.5, 0.5, "flat surface", ha="center", transform=axis.transAxes)
        axis.set(xticks=[], yticks=[])
        return
    counts, edges = np.histogram(above, BINS)
    shares = 100.0 * counts / above.size / np.diff(edges)
    axis.stairs(shares, edges, orientation="horizontal", fill=True, color="tab:blue", alpha=0.35)
    axis.set_xlim(left=0.0)
    bearing = axis.twiny()
    places = np.unique(np.linspace(0, above.size - 1, 1000).astype(int))
    bearing.plot(100.0 * (places + 1) / above.size, above[places], color="tab:red", lw=1.5)
    bearing.set_xlim(0, 100)
    bearing.set_xlabel("bearing curve: share of the surface above [%]", color="tab:red")
    axis.axhline(0.0, color="k", lw=0.6, ls=":")


def _draw_spectrum(axis: Any, spectrum: RadialSpectrum, fit: SelfAffineFit | str) -> None:
    """Draw the radial power spectrum with the self-affine law over the range that it fits."""
    seen = np.isfinite(spectrum.density) & (spectrum.density > 0.0)
    axis.set_title(_spectrum_title(fit), loc="left", fontsize=10)
    axis.set(xlabel="wavenumber q [1/µm]", ylabel="radial power spectrum C [µm$^4$]")
    if not seen.any():
        axis.text(0.5, 0.5, "no wave", ha="center", transform=axis.transAxes)
        axis.set(xticks=[], yticks=[])
        return
    axis.set_xlim(spectrum.edges[0, 0], spectrum.edges[-1, 1])
    axis.loglog(spectrum.wavenumbers[seen], spectrum.density[seen], ".", color="0.45", ms=5)
    axis.grid(alpha=0.3)
    if isinstance(fit, str):
        return
    last = 2 * math.pi / fit.spectrum.cut_off
    axis.axvspan(spectrum.edges[0, 0], last, color="tab:orange", alpha=0.1, lw=0)
    q = np.geomspace(2 * math.pi / fit.longest, last, 300)
    law = fit.level * fit.spectrum.density(q, np.zeros(1))
    axis.loglog(q, law, color="tab:orange", lw=2, label="self-affine law, in the range of the fit")
    marks = [("cut-off", fit.spectrum.cut_off, "--")]
    if fit.spectrum.roll_off < fit.longest:
        marks.insert(0, ("roll-off", fit.spectrum.roll_off, ":"))
    for name, wavelength, style in marks:
        text = f"{name} {wavelength:.4g} µm"
        axis.axvline(2 * math.pi / wavelength, color="k", lw=0.9, ls=style, label=text)
    # Beyond a cut-off there may be nothing but rounding, which must not flatten the rest.
    axis.set_ylim(bottom=max(float(spectrum.density[seen].min()), 1e-3 * float(law.min())) / 2)
    longer = axis.secondary_xaxis("top", functions=(_opposite, _opposite))
    longer.set_xlabel("wavelength [µm]")
    shortest, longest = sorted(_opposite(np.array(axis.get_xlim())))
    ticks = [n * 10.0**k for k in range(-15, 16) for n in (1, 2, 5)]
    longer.set_xticks([tick for tick in ticks if shortest <= tick <= longest])
    longer.minorticks_off()
    longer.xaxis.set_major_formatter("{x:g}")
    axis.legend(loc="lower left", fontsize="small")


def _spectrum_title(fit: SelfAffineFit | str) -> str:
    """Return the title of the spectrum: the law's numbers, or why there is none."""
    if isinstance(fit, str):
        return textwrap.fill(f"radial power spectrum; no self-affine law: {fit}", LETTERS)
    numbers = f"Hurst exponent {fit.spectrum.hurst:.3g} over {fit.decades:.2g} decades, "
    numbers += f"rms height {fit.rms_height:.4g} µm"
    return "; ".join((f"radial power spectrum: {numbers}", *fit.remarks))


def _opposite(lengths: Any) -> Any:
    """Turn wavenumbers into wavelengths, or wavelengths into wavenumbers."""
    return 2 * math.pi / np.maximum(lengths, 1e-300)


def statistics_row(
    topography: Topography, description: Description, warnings: Sequence[str]
) -> Row:
    """Return the row of a table of statistics: values, grid, steps of preparation, warnings."""
    nx, ny = topography.heights.shape
    return {
        **description.values,
        "nodes_x": nx,
        "nodes_y": ny,
        "side_x_um": topography.sides[0],
        "side_y_um": topography.sides[1],
        **boundary_cell(topography),
        "prepared": "; ".join(topography.steps),
        "warnings": "; ".join(warnings),
    }


def areal_row(areal: Description, depth: float | None, fit: SelfAffineFit | str) -> Row:
    """Return the further cells of a table of statistics: ISO 25178, and the self-affine law."""
    row: Row = {**areal.values, **({} if depth is None else {"Smr_depth": depth})}
    if isinstance(fit, str):
        return {**row, **dict.fromkeys(LAW, ""), "law": f"none: {fit}"}
    return {**row, **fit.values, "law": "; ".join(fit.remarks)}


def units_of(names: Iterable[str]) -> str:
    """Return the units of columns of a table of statistics, as "Sa um; Sk um"."""
    units = {column.name: column.unit for column in statistics_columns()}
    units |= {name: unit for name, unit, _ in PARAMETERS} | LAW | {"Smr_depth": "um"}
    return "; ".join(f"{name} {units[name]}" for name in names if name in units)
