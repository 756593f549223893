"""Pictures of surfaces: maps with colour bars, of one surface, and of the contacts of one."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.contacts import AnswerOptions
from gen.maps.read import Sides, Topography
from gen.maps.texture import RadialSpectrum, SelfAffineFit
from gen.material import Bodies
from gen.quantities import AREA, DELTA, FORCE, LOADS, MEAN_GAP, nominal_area
from gen.runtime.figure import log_axis, save
from gen.runtime.terminal import shortened

if TYPE_CHECKING:
    from bem import Contact

LETTERS = 50  # letters in a line above a map that fills its half of a picture
UPPER_PERCENTILE = (
    99  # where a colour scale ends if a few outliers would otherwise take most of it
)
# colours of values below and above the ends of a colour scale, which it does not have itself
BEYOND = {"viridis": ("magenta", "red"), "inferno_r": ("deepskyblue", "limegreen")}
COLOURS = 20  # colours of spots, those of the colour map tab20
# ratio of the largest to the smallest load from which on axes of loads are logarithmic
DECADES = 99.0
OBLONG = (
    4.0  # ratio of the sides beyond which a map fills its panel, as its title then says
)
# colour of yielded nodes (red, green, blue): no colour map of these pictures has it
CYAN = (0.09, 0.75, 0.81)
# share of the lines at both borders that a section avoids, since pressures are high there
BORDER = 0.1
FAINT = 1e-4  # least flux that is drawn, over its mean
BINS = 80  # number of bars of the height distribution


@dataclass(frozen=True, eq=False)
class Map:
    """A field over a surface; without a quantity its values only number `COLOURS`."""

    field: Values  # masked where there is nothing to draw, shape (nx, ny) [unit]
    sides: Sides  # lengths of the patch along x and y [um]
    title: str
    quantity: str
    unit: str
    colours: str  # name of a colour map of matplotlib
    marked: NDArray[np.bool_] | None = (
        None  # nodes to draw in `CYAN` instead, shape (nx, ny)
    )


def load_text(contact: Contact, quantity: str) -> str:
    """Return the load of a contact: Delta, the force, or for other quantities the mean pressure."""
    if quantity.startswith("delta"):
        return f"Δ = {contact.delta:.4g} µm"
    if quantity == "force":
        return f"{contact.force:.4g} µN"
    return f"{contact.force / nominal_area(contact):.4g} MPa mean pressure"


def contact_maps(
    contact: Contact, height_title: str, pressure_title: str
) -> tuple[Map, Map]:
    """Return the maps of the heights and of the pressure of a contact; yielded nodes are marked."""
    heights, sides = contact.problem.heights, patch_sides(contact)
    yielded = contact.yielded
    pressure = np.ma.masked_where((contact.pressure == 0) | yielded, contact.pressure)
    if yielded.any():
        pressure_title += f", {contact.yielded_percent:.3g} % yielded (cyan)"
    return (
        Map(heights, sides, height_title, "height", "µm", "viridis"),
        Map(pressure, sides, pressure_title, "pressure", "MPa", "inferno_r", yielded),
    )


def gap_maps(contact: Contact, where: str, options: AnswerOptions) -> tuple[Map, Map]:
    """Return two maps: of the gap, the spots by size and, by decades, the flux over its mean."""
    found, sides = contact.spots, patch_sides(contact)
    crossing, apart = found.open_gap.any(), found.labels == 0
    state = (
        "connects opposite sides, closed pockets in cyan"
        if crossing
        else "connects no sides"
    )
    closed = apart & ~found.open_gap if crossing else None
    gap = np.ma.masked_where(~apart, contact.gap)
    open_gap = Map(gap, sides, f"gap: {state}{where}", "gap", "µm", "viridis", closed)
    title = (
        f"{found.number} spots, the largest with {100 * found.largest_share:.3g} % of the"
    )
    title += f" contact{where if options.flow else ''}"
    colours = np.ma.masked_where(apart, (found.labels - 1.0) % COLOURS)
    by_size = Map(colours, sides, title, "", "", "tab20")
    if not options.flow:
        return open_gap, by_size
    along_x = contact.flow(0)
    share = np.hypot(*along_x.flux) / (along_x.aperture**3 or 1.0)
    decades = np.ma.log10(np.ma.masked_less(share, FAINT))
    state = (
        f"flow factor {along_x.factor:.3g}"
        if along_x.factor
        else "no flow, the contact seals"
    )
    flux = Map(
        decades,
        sides,
        f"flux along x: {state}",
        "flux over its mean",
        "decades",
        "viridis",
    )
    return by_size if options.spots else open_gap, flux


def patch_sides(contact: Contact) -> tuple[float, float]:
    """Return the lengths of a contact's patch along x and y [um]."""
    (nx, ny), (dx, dy) = contact.pressure.shape, contact.problem.spacing
    outer = contact.problem.boundary == "free"
    return dx * (nx - outer), dy * (ny - outer)


@dataclass(frozen=True)
class ColourScale:
    """The ends of the colours of a map, beyond which a few outliers may lie."""

    low: float
    high: float
    extend: Literal["neither", "min", "max", "both"] = (
        "neither"  # ends beyond which values lie
    )
    remark: str = (
        ""  # the values that lie farthest beyond, and their colours, for the title
    )
    # nodes of these values by their colours: a large map would average a single one away
    farthest: Mapping[str, tuple[int, int]] = field(default_factory=dict)


def colour_scale(surface_map: Map) -> ColourScale:
    """Choose the ends of the colours of a map, so that a few outliers do not take most of them."""
    values = np.ma.compressed(surface_map.field)
    if not surface_map.quantity:
        return ColourScale(0.0, COLOURS - 1.0)
    if not values.size:
        return ColourScale(0.0, 1.0)
    least, most = float(values.min()), float(values.max())
    first, last = map(
        float, np.percentile(values, [100 - UPPER_PERCENTILE, UPPER_PERCENTILE])
    )
    under, over = BEYOND[surface_map.colours]
    remarks = []
    farthest: dict[str, tuple[int, int]] = {}
    low, high = least, most
    columns = surface_map.field.shape[1]
    if least < 1.5 * first - 0.5 * last:
        low = first
        farthest[under] = divmod(int(np.ma.argmin(surface_map.field)), columns)
        remarks.append(f"down to {least:.4g} {surface_map.unit} ({under})")
    if most > 1.5 * last - 0.5 * first:
        high = last
        farthest[over] = divmod(int(np.ma.argmax(surface_map.field)), columns)
        remarks.append(f"up to {most:.4g} {surface_map.unit} ({over})")
    if not remarks:
        return ColourScale(low, high)
    extend: Literal["min", "max", "both"] = "both"
    if len(remarks) == 1:
        extend = "min" if low > least else "max"
    remark = f"beyond the colours: {' and '.join(remarks)}"
    return ColourScale(low, high, extend, remark, farthest)


def plot_map(axis: Any, surface_map: Map, letters: int = LETTERS) -> None:
    """Draw a field to scale unless it is very oblong, under titles of lines of some letters."""
    nx, ny = surface_map.field.shape
    (width, length), field = surface_map.sides, surface_map.field
    scale = colour_scale(surface_map)
    oblong = max(width, length) > OBLONG * min(width, length)
    image = axis.imshow(
        field.T,
        origin="lower",
        extent=(0.0, width, 0.0, length),
        cmap=surface_map.colours,
        vmin=scale.low,
        vmax=scale.high,
        aspect="auto" if oblong else "equal",
    )
    if scale.extend != "neither":
        under, over = BEYOND[surface_map.colours]
        image.set_cmap(image.get_cmap().with_extremes(under=under, over=over))
    for colour, (row, column) in scale.farthest.items():
        x, y = (row + 0.5) * width / nx, (column + 0.5) * length / ny
        axis.plot(x, y, "o", ms=9, mfc="none", mec=colour, scalex=False, scaley=False)
    axis.set_facecolor("0.93")
    if surface_map.marked is not None and surface_map.marked.any():
        marks = np.zeros((ny, nx, 4))  # transparent
        marks[surface_map.marked.T] = (*CYAN, 1.0)
        settings = {"extent": image.get_extent(), "aspect": image.axes.get_aspect()}
        axis.imshow(marks, origin="lower", interpolation="nearest", **settings)
    if surface_map.quantity:
        beside = axis.inset_axes((1.03, 0.0, 0.04, 1.0))  # as high as the map
        label = f"{surface_map.quantity} [{surface_map.unit}]"
        axis.figure.colorbar(image, cax=beside, label=label, extend=scale.extend)
    lines = textwrap.wrap(surface_map.title, letters)
    lines += textwrap.wrap(scale.remark, letters)
    if oblong:
        lines.append("not to scale")
    axis.set_title("\n".join(lines), loc="left", fontsize=10, parse_math=False)
    axis.set(xlabel="x [µm]", ylabel="y [µm]")


def plot_surface(
    figure: Any,
    topography: Topography,
    spectrum: RadialSpectrum,
    fit: SelfAffineFit | str,
    picture: Path,
    *,
    directional: bool,
) -> None:
    """Draw the heights, their distribution with the bearing curve, and the spectrum.

    A `directional` surface has the spectra of its profiles along x and along y beside it.
    """
    top, bottom = figure.subfigures(2, 1, height_ratios=[1.12, 1.0])
    left, right = top.subplots(1, 2, width_ratios=[1.15, 1.0])
    figure.suptitle(shortened(topography.name), fontsize=11, parse_math=False)
    heights = topography.heights
    title = f"heights, {heights.shape[0]} x {heights.shape[1]} nodes"
    plot_map(left, Map(heights, topography.sides, title, "height", "µm", "viridis"))
    _plot_distribution(right, heights)
    if directional:
        radial, profiles = bottom.subplots(1, 2)
        _plot_spectrum(radial, spectrum, fit, LETTERS)
        _plot_profile_spectra(profiles, spectrum)
    else:
        _plot_spectrum(bottom.subplots(), spectrum, fit, 2 * LETTERS)
    save(figure, picture)


def _plot_distribution(axis: Any, heights: Heights) -> None:
    """Draw the share of the surface over the height, and the share that is above each height."""
    axis.set_title("height distribution and bearing curve", loc="left", fontsize=10)
    axis.set_ylabel("height above the mean [µm]")
    axis.set_xlabel("share of the surface per µm [%]", color="tab:blue")
    above = np.sort(heights.ravel() - heights.mean())[::-1]
    if above[0] == above[-1]:
        axis.text(0.5, 0.5, "flat surface", ha="center", transform=axis.transAxes)
        axis.set(xticks=[], yticks=[])
        return
    counts, edges = np.histogram(above, BINS)
    shares = 100.0 * counts / above.size / np.diff(edges)
    axis.stairs(
        shares, edges, orientation="horizontal", fill=True, color="tab:blue", alpha=0.35
    )
    axis.set_xlim(left=0.0)
    bearing = axis.twiny()
    places = np.unique(np.linspace(0, above.size - 1, 1000).astype(int))
    bearing.plot(
        100.0 * (places + 1) / above.size, above[places], color="tab:red", lw=1.5
    )
    bearing.set_xlim(0, 100)
    bearing.set_xlabel("bearing curve: share of the surface above [%]", color="tab:red")
    axis.axhline(0.0, color="k", lw=0.6, ls=":")


WAVENUMBER = "wavenumber q = 2π / wavelength [1/µm]"


def _plot_profile_spectra(axis: Any, spectrum: RadialSpectrum) -> None:
    """Draw the mean power spectra of the profiles along x and along y."""
    axis.set_title("power spectra of profiles", loc="left", fontsize=10)
    axis.set(xlabel=WAVENUMBER, ylabel="profiles' power spectrum [µm$^3$]")
    curves = {"along x": spectrum.along_x, "along y": spectrum.along_y}
    if not any((density > 0.0).any() for density in curves.values()):
        axis.text(0.5, 0.5, "no wave", ha="center", transform=axis.transAxes)
        axis.set(xticks=[], yticks=[])
        return
    for name, density in curves.items():
        seen = np.isfinite(density) & (density > 0.0)
        axis.loglog(
            spectrum.wavenumbers[seen], density[seen], ".-", ms=4, lw=1, label=name
        )
    axis.grid(alpha=0.3)
    axis.legend(loc="lower left", fontsize="small")


def _plot_spectrum(
    axis: Any, spectrum: RadialSpectrum, fit: SelfAffineFit | str, letters: int
) -> None:
    """Draw the radial power spectrum with the self-affine law over the range that it fits."""
    seen = np.isfinite(spectrum.density) & (spectrum.density > 0.0)
    title = textwrap.fill(f"radial power spectrum; no self-affine law: {fit}", letters)
    if not isinstance(fit, str):
        numbers = (
            f"Hurst exponent {fit.spectrum.hurst:.3g} over {fit.decades:.2g} decades"
        )
        numbers += f", rms height {fit.rms_height:.4g} µm"
        title = "; ".join((f"radial power spectrum: {numbers}", *fit.remarks))
    axis.set_title(title, loc="left", fontsize=10)
    axis.set(xlabel=WAVENUMBER, ylabel="radial power spectrum C [µm$^4$]")
    if not seen.any():
        axis.text(0.5, 0.5, "no wave", ha="center", transform=axis.transAxes)
        axis.set(xticks=[], yticks=[])
        return
    axis.set_xlim(spectrum.edges[0, 0], spectrum.edges[-1, 1])
    axis.loglog(
        spectrum.wavenumbers[seen], spectrum.density[seen], ".", color="0.45", ms=5
    )
    axis.grid(alpha=0.3)
    if isinstance(fit, str):
        return
    last = 2 * math.pi / fit.spectrum.cut_off
    axis.axvspan(spectrum.edges[0, 0], last, color="tab:orange", alpha=0.1, lw=0)
    q = np.geomspace(2 * math.pi / fit.longest, last, 300)
    law = fit.level * fit.spectrum.density(q, np.zeros(1))
    axis.loglog(
        q, law, color="tab:orange", lw=2, label="self-affine law, in the range of the fit"
    )
    marks = [("cut-off", fit.spectrum.cut_off, "--")]
    if fit.spectrum.roll_off < fit.longest:
        marks.insert(0, ("roll-off", fit.spectrum.roll_off, ":"))
    for name, wavelength, style in marks:
        text = f"{name} {wavelength:.4g} µm"
        axis.axvline(2 * math.pi / wavelength, color="k", lw=0.9, ls=style, label=text)
    # Beyond a cut-off there may be nothing but rounding, which must not flatten the rest.
    axis.set_ylim(
        bottom=max(float(spectrum.density[seen].min()), 1e-3 * float(law.min())) / 2
    )
    axis.legend(loc="lower left", fontsize="small")


def plot_contacts(
    figure: Any,
    last: Contact,
    rows: Sequence[Mapping[str, Any]],
    picture: Path,
    *,
    name: str,
    load: str,
    bodies: Bodies,
    warnings: Sequence[str],
    options: AnswerOptions,
) -> None:
    """Draw a surface, its contact and a section under the last load, and the law of several.

    `rows` are the numbers of each contact by the columns of `gen.maps.contacts.answers`. `load` is
    the quantity that was given: delta, force or pressure. If spots or flow are among the `options`,
    the spots, the open gap or the flux along x are drawn instead of heights and pressure.
    """
    law = len(rows) > 1
    panels = [["heights"] * 3 + ["contact"] * 3, ["section"] * 6]
    heights = [4.4, 2.6]
    if law:
        panels.append([each for each in ("area", "answer", "gap") for _ in range(2)])
        heights.append(2.8)
    figure.set_size_inches(11.0, sum(heights) + 0.8)
    axes = figure.subplot_mosaic(panels, height_ratios=heights)
    problem, pressed = last.problem, last.force / nominal_area(last)
    title = f"last of {len(rows)} loads: " if law else ""
    title += f"Δ = {last.delta:.4g} µm, force {last.force:.4g} µN, mean pressure {pressed:.4g} MPa"
    material = bodies.text + ", no material given" * (not bodies.has_modulus)
    material += "" if problem.boundary == "free" else f"; {problem.boundary} boundary"
    figure.suptitle(
        "\n".join((shortened(name), title, material)), fontsize=11, parse_math=False
    )
    if warnings:
        told = "\n".join(
            textwrap.fill(f"warning: {warning}", 160) for warning in warnings
        )
        figure.supxlabel(told, fontsize=8, color="tab:red", parse_math=False)
    where = f" at {load_text(last, load)}" if law else ""
    if options.spots or options.flow:
        first, second = gap_maps(last, where, options)
    else:
        share = f"{last.area_percent:.3g} % of {last.pressure.size} nodes"
        first, second = contact_maps(last, "heights", f"contact{where}: {share}")
    plot_map(axes["heights"], first)
    plot_map(axes["contact"], second)
    _plot_section(axes["section"], last, where)
    if law:
        _plot_law([axes[each] for each in ("area", "answer", "gap")], rows, load)
    save(figure, picture)


def _plot_section(axis: Any, contact: Contact, load: str) -> None:
    """Draw both bodies along the line with the largest force off the border, in the longer side."""
    sides, spacing = patch_sides(contact), contact.problem.spacing
    along = 0 if sides[0] >= sides[1] else 1
    forces = contact.pressure.sum(axis=along)
    margin = max(int(BORDER * forces.size), 1)
    inner = forces[margin : forces.size - margin]
    place = margin + int(inner.argmax()) if inner.any() else int(forces.argmax())
    line: tuple[Any, ...] = (slice(None), place) if along == 0 else (place, slice(None))
    first = (
        0.0 if contact.problem.boundary == "free" else 0.5
    )  # distance of nodes from the border
    position = spacing[along] * (first + np.arange(contact.pressure.shape[along]))
    # The half-space's surface is at 0 before contact, and the rough body comes down from above.
    deformed = -contact.displacement[line]
    rough = contact.gap[line] + deformed
    edge = 0.08 * float(np.ptp([deformed.min(), deformed.max(), rough.max(), 0.0]))
    top, bottom = max(float(rough.max()), 0.0) + edge, float(deformed.min()) - edge
    axis.fill_between(position, rough, top, color="0.8", label="rough body")
    axis.fill_between(
        position, bottom, deformed, color="tab:blue", alpha=0.4, label="half-space"
    )
    yielded = contact.yielded[line]
    touching = np.ma.masked_where((contact.pressure[line] == 0) | yielded, deformed)
    axis.plot(position, touching, ".", ms=4, color="tab:red", label="in contact")
    if yielded.any():
        yielding = np.ma.masked_where(~yielded, deformed)
        axis.plot(position, yielding, ".", ms=4, color=CYAN, label="yielded")
    axis.axhline(0, color="k", lw=0.6, ls=":")
    across = spacing[1 - along] * (first + place)
    where = f"section at {'yx'[along]} = {across:.4g} µm{load.replace(' at', ',', 1)}"
    axis.set_title(where, loc="left", fontsize=10)
    axis.set(xlabel=f"{'xy'[along]} [µm]", ylabel="z [µm], stretched")
    axis.set(xlim=(0, sides[along]), ylim=(bottom, top))
    axis.legend(
        loc="lower right", bbox_to_anchor=(1, 1), ncols=4, fontsize="small", frameon=False
    )


def _plot_law(axes: Sequence[Any], rows: Sequence[Mapping[str, Any]], load: str) -> None:
    """Draw area, force or far-field displacement, and mean gap over the load that was given."""
    given = LOADS[load]
    answer = FORCE if load == "delta" else DELTA
    rows = sorted(rows, key=lambda row: row[given.in_tables])
    loads = np.array([row[given.in_tables] for row in rows])
    decades = bool(loads[0] > 0 and loads[-1] >= DECADES * loads[0])
    answers = (AREA, answer, MEAN_GAP)
    colours = ("tab:blue", "tab:orange", "tab:green")
    for axis, quantity, colour in zip(axes, answers, colours, strict=True):
        values = np.array([row[quantity.in_tables] for row in rows])
        axis.plot(loads, values, ".-", color=colour)
        axis.grid(alpha=0.3)
        axis.set(xlabel=given.label, ylabel=quantity.label)
        if decades:
            log_axis(axis.xaxis)
        if decades and values.min() > 0 and values.max() >= 10 * values.min():
            log_axis(axis.yaxis)
        else:
            axis.set_ylim(0, 1.06 * float(values.max()) or 1.0)
