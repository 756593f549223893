"""Pictures of surfaces: fields to scale with a colour bar, and the picture of one surface."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.read import Topography
from gen.maps.self_affine import RadialSpectrum, SelfAffineFit
from gen.runtime.figure import save
from gen.runtime.terminal import shortened

if TYPE_CHECKING:
    from bem import Contact

UPPER_PERCENTILE = 99
"""Where a colour scale ends if a few outliers would otherwise take most of it."""

COLOURS = 20
"""Colours of spots, those of the colour map tab20."""

FINE_SIDE, FINE_HEIGHT = 5.0, 1.0
"""Spans of positions and of heights below which axes are in nm [um]."""

DECADES = 99.0
"""Ratio of the largest to the smallest load from which on axes of loads are logarithmic."""

COARSE = 2000.0
"""Span from which on axes are in mm [um]."""

CYAN = (0.09, 0.75, 0.81)
"""Colour of yielded nodes (red, green, blue): no colour map of these pictures has it."""


@dataclass(frozen=True, eq=False)
class Map:
    """A field over a surface with the texts and colours to draw it with."""

    # values of the field [unit], masked where there is nothing to draw, shape (nx, ny)
    field: Values
    sides: tuple[float, float]  # lengths of the patch along x and y [um]
    title: str  # title of the map
    # name and unit of the field. Both are empty where the values only number colours: then the
    # scale holds all `COLOURS` of them, and there is no colour bar
    quantity: str
    unit: str
    colours: str  # name of a colour map of matplotlib
    # nodes to draw in the colour `CYAN` instead of the field's; None for no such node, shape (nx,
    # ny)
    marked: NDArray[np.bool_] | None = None


def axis_unit(span: float, fine: float) -> tuple[float, str]:
    """Return the unit of an axis of lengths, whose ticks have few decimals then.

    Also return the number of these units in a um. Spans below `fine` [um] are in nm.
    """
    if 0.0 < span < fine:
        return 1e3, "nm"
    return (1e-3, "mm") if span >= COARSE else (1.0, "µm")


def metric(value: float, unit: str) -> str:
    """Format a number of an SI unit with four digits and a metric prefix."""
    power = 0 if value == 0 else min(max(math.floor(math.log10(abs(value)) / 3), -4), 4)
    prefix = ("p", "n", "µ", "m", "", "k", "M", "G", "T")[power + 4]
    return f"{value / 1000.0**power:.4g} {prefix}{unit}"


def load_text(contact: Contact, quantity: str) -> str:
    """Return the load of a contact: Delta, the force, or for other quantities the mean pressure."""
    if quantity.startswith("delta"):
        return f"Δ = {metric(1e-6 * contact.delta, 'm')}"
    if quantity == "force":
        return metric(1e-6 * contact.force, "N")
    return f"{metric(1e6 * contact.force / nominal_area(contact), 'Pa')} mean pressure"


def nominal_area(contact: Contact) -> float:
    """Return the area of the cells of all nodes, over which a mean pressure is taken [um2]."""
    return contact.pressure.size * math.prod(contact.problem.spacing)


def contact_maps(contact: Contact, height_title: str, pressure_title: str) -> tuple[Map, Map]:
    """Return the maps of the heights and of the pressure of a contact; yielded nodes are marked."""
    heights, sides = contact.problem.heights, patch_sides(contact)
    yielded = yielded_nodes(contact)
    pressure = np.ma.masked_where((contact.pressure == 0) | yielded, contact.pressure)
    if yielded.any():
        pressure_title += f", {contact.yielded_percent:.3g} % yielded (cyan)"
    return (
        Map(heights, sides, height_title, "height", "µm", "viridis"),
        Map(pressure, sides, pressure_title, "pressure", "MPa", "inferno_r", yielded),
    )


def spot_maps(contact: Contact) -> tuple[Map, Map]:
    """Return the maps of the gap, open or closed, and of the spots by size."""
    spots, sides = contact.spots, patch_sides(contact)
    gap = np.ma.masked_where(spots.labels > 0, contact.gap)
    crossing = spots.open_gap.any()
    closed = (spots.labels == 0) & ~spots.open_gap if crossing else None
    state = "connects opposite sides, closed pockets in cyan" if crossing else "connects no sides"
    colours = np.ma.masked_where(spots.labels == 0, (spots.labels - 1.0) % COLOURS)
    title = (
        f"{spots.number} spots, the largest with {100 * spots.largest_share:.3g} % of the contact"
    )
    return (
        Map(gap, sides, f"gap: {state}", "gap", "µm", "viridis", closed),
        Map(colours, sides, title, "", "", "tab20"),
    )


def patch_sides(contact: Contact) -> tuple[float, float]:
    """Return the lengths of a contact's patch along x and y [um].

    A free patch ends at its outer nodes; one without edges is made of cells.
    """
    (nx, ny), (dx, dy) = contact.pressure.shape, contact.problem.spacing
    outer = contact.problem.boundary == "free"
    return dx * (nx - outer), dy * (ny - outer)


def yielded_nodes(contact: Contact) -> NDArray[np.bool_]:
    """Return the mask of the nodes whose pressure is the hardness, shape (nx, ny)."""
    hardness = contact.problem.hardness
    if hardness is None:
        return np.zeros(contact.pressure.shape, dtype=bool)
    return contact.pressure >= hardness


def draw_map(axis: Any, surface_map: Map, letters: int) -> None:
    """Draw a field; its colour bar, if it has a quantity, is not stretched by a few outliers."""
    nx, ny = surface_map.field.shape
    per_um, of_sides = axis_unit(max(surface_map.sides), FINE_SIDE)
    width, length = (per_um * side for side in surface_map.sides)
    field, unit = surface_map.field, surface_map.unit
    if unit == "µm" and np.ma.count(field):
        factor, unit = axis_unit(float(np.ptp(np.ma.compressed(field))), FINE_HEIGHT)
        field = factor * field
    if surface_map.quantity:
        (low, high), extend, remark = _scale(np.ma.compressed(field), unit)
    else:
        (low, high), extend, remark = (0.0, COLOURS - 1.0), "neither", ""
    image = axis.imshow(
        field.T,
        origin="lower",
        extent=(0.0, width, 0.0, length),
        cmap=surface_map.colours,
        vmin=low,
        vmax=high,
    )
    axis.set_facecolor("0.93")
    if surface_map.marked is not None and surface_map.marked.any():
        marks = np.zeros((ny, nx, 4))  # transparent
        marks[surface_map.marked.T] = (*CYAN, 1.0)
        axis.imshow(marks, origin="lower", extent=image.get_extent(), interpolation="nearest")
    if surface_map.quantity:
        # As high as the map; the width varies little between tall and oblong maps.
        thickness = 0.045 * min(max(np.sqrt(length / width), 1 / 3), 3.0)
        beside = axis.inset_axes((1 + thickness, 0.0, thickness, 1.0))
        label = f"{surface_map.quantity} [{unit}]"
        axis.figure.colorbar(image, cax=beside, label=label, extend=extend)
    lines = [*textwrap.wrap(surface_map.title, letters), *textwrap.wrap(remark, letters)]
    axis.set_title("\n".join(lines), loc="left", fontsize=10, parse_math=False)
    axis.set(xlabel=f"x [{of_sides}]", ylabel=f"y [{of_sides}]")


def _scale(values: Values, unit: str) -> tuple[tuple[float, float], str, str]:
    """Return the limits of a colour scale, its open ends, and a remark about them.

    The scale spans all values, unless those beyond a percentile would take more than half as much
    of it as the rest.
    """
    if not values.size:
        return (0.0, 1.0), "neither", ""
    low, high = float(values.min()), float(values.max())
    percentiles = np.percentile(values, [100 - UPPER_PERCENTILE, UPPER_PERCENTILE])
    first, last = (float(value) for value in percentiles)
    room = 0.5 * (last - first)
    below, above = low < first - room, high > last + room
    extend = ("both" if above else "min") if below else ("max" if above else "neither")
    remarks = []
    if below:
        remarks.append(
            f"from the {100 - UPPER_PERCENTILE}st percentile (smallest {low:.4g} {unit})"
        )
    if above:
        remarks.append(f"to the {UPPER_PERCENTILE}th percentile (largest {high:.4g} {unit})")
    limits = first if below else low, last if above else high
    return limits, extend, f"colours {' '.join(remarks)}" if remarks else ""


BINS = 80
"""Number of bars of the height distribution."""

SPECTRUM_LETTERS = 110
"""Letters in a line of the spectrum's title."""

WIDEST_TO_SCALE = 4.0
"""Ratio of the sides beyond which the map fills its panel, as the title then says."""


def draw_surface(
    figure: Any,
    topography: Topography,
    spectrum: RadialSpectrum,
    fit: SelfAffineFit | str,
    picture: Path,
) -> None:
    """Draw the heights, the height distribution with the bearing curve, and the power spectrum."""
    top, bottom = figure.subfigures(2, 1, height_ratios=[1.12, 1.0])
    left, right = top.subplots(1, 2, width_ratios=[1.15, 1.0])
    figure.suptitle(shortened(topography.name), fontsize=11, parse_math=False)
    heights = topography.heights
    title = f"heights, {heights.shape[0]} x {heights.shape[1]} nodes"
    draw_map(left, Map(heights, topography.sides, title, "height", "µm", "viridis"), 50)
    if max(topography.sides) > WIDEST_TO_SCALE * min(topography.sides):
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
        return textwrap.fill(f"radial power spectrum; no self-affine law: {fit}", SPECTRUM_LETTERS)
    numbers = f"Hurst exponent {fit.spectrum.hurst:.3g} over {fit.decades:.2g} decades, "
    numbers += f"rms height {fit.rms_height:.4g} µm"
    return "; ".join((f"radial power spectrum: {numbers}", *fit.remarks))


def _opposite(lengths: Any) -> Any:
    """Turn wavenumbers into wavelengths, or wavelengths into wavenumbers."""
    return 2 * math.pi / np.maximum(lengths, 1e-300)
