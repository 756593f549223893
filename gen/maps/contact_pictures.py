"""Pictures of contacts: heights, pressure, gap, spots, flux, a section, and curves over loads."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.maps.answers import AnswerOptions
from gen.maps.pictures import COLOURS, CYAN, Map, plot_map
from gen.maps.read import Sides
from gen.material import Bodies
from gen.quantities import (
    AREA,
    DELTA,
    FORCE,
    LOADS,
    MEAN_GAP,
    Quantity,
    nominal_area,
    typographic,
)
from gen.runtime.figure import log_axis, save
from gen.runtime.terminal import shortened
from gen.units import with_unit

if TYPE_CHECKING:
    from bem import Contact

# least ratio of the largest to the smallest load with which axes of loads are logarithmic: just
# below two decades, because loads round
DECADES = 99.0
# share of the lines of nodes at each border that a section avoids, since pressures are high there
BORDER = 0.1
FAINT = 1e-4  # least flux that is drawn, over the mean flux
WIDE_LINE = 160  # largest number of letters in a line below a picture


def load_text(contact: Contact, quantity: str) -> str:
    """Write the load of a contact in the quantity that the load was given in.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.
    quantity : str
        Quantity to write: the far-field displacement if the name begins with "delta", the force for
        "force", the mean pressure for any other name.

    Returns
    -------
    str
        The load with its unit, as "Δ = 1 µm", "2 µN" or "3 MPa mean pressure".
    """
    if quantity.startswith("delta"):
        return f"Δ = {contact.delta:.4g} µm"
    if quantity == "force":
        return typographic(with_unit(contact.force, "uN"))
    return f"{contact.force / nominal_area(contact):.4g} MPa mean pressure"


def contact_maps(
    contact: Contact, height_title: str, pressure_title: str
) -> tuple[Map, Map]:
    """Return the maps of the heights and of the pressure of a contact.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact. Its yielded nodes are marked in the map of the pressure.
    height_title, pressure_title : str
        Titles of the maps. The share of the yielded nodes is added to that of the pressure.

    Returns
    -------
    tuple of Map
        The map of the heights, then the map of the pressure, which is masked where it is 0.
    """
    sides = patch_sides(contact)
    yielded = contact.yielded
    pressure = np.ma.masked_where((contact.pressure == 0) | yielded, contact.pressure)
    if yielded.any():
        pressure_title += f", {contact.yielded_percent:.3g} % yielded (cyan)"
    height_map = Map(
        field=contact.problem.heights,
        sides=sides,
        title=height_title,
        quantity="height",
        unit="µm",
        colours="viridis",
    )
    pressure_map = Map(
        field=pressure,
        sides=sides,
        title=pressure_title,
        quantity="pressure",
        unit="MPa",
        colours="inferno_r",
        marked=yielded,
    )
    return height_map, pressure_map


def gap_maps(contact: Contact, at_load: str, options: AnswerOptions) -> tuple[Map, Map]:
    """Return two maps that show the answers about spots and flow.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.
    at_load : str
        Last words of the first map's title, as " at Δ = 1 µm", or "".
    options : AnswerOptions
        Tells whether spots and flow are among the answers; one of them is.

    Returns
    -------
    tuple of Map
        Gap and spots, for spots alone; gap and flux along x, for flow alone; spots and flux along
        x, for both.
    """
    if not options.flow:
        return _gap_map(contact, at_load), _spots_map(contact, "")
    if options.spots:
        return _spots_map(contact, at_load), _flux_map(contact)
    return _gap_map(contact, at_load), _flux_map(contact)


def _gap_map(contact: Contact, at_load: str) -> Map:
    """Return the map of the gap, masked in contact.

    If the gap connects opposite sides, the pockets that are closed off are marked. `at_load` ends
    the title.
    """
    spots = contact.spots
    open_gap = spots.open_gap
    apart = spots.labels == 0
    state = "connects no sides"
    pockets = None
    if open_gap.any():
        state = "connects opposite sides, closed pockets in cyan"
        pockets = apart & ~open_gap
    return Map(
        field=np.ma.masked_where(~apart, contact.gap),
        sides=patch_sides(contact),
        title=f"gap: {state}{at_load}",
        quantity="gap",
        unit="µm",
        colours="viridis",
        marked=pockets,
    )


def _spots_map(contact: Contact, at_load: str) -> Map:
    """Return the map of the spots of contact, coloured by rank of size; `at_load` ends the title.

    Colours repeat after `COLOURS` spots.
    """
    spots = contact.spots
    largest = 100 * spots.largest_share
    return Map(
        field=np.ma.masked_where(spots.labels == 0, (spots.labels - 1.0) % COLOURS),
        sides=patch_sides(contact),
        title=f"{spots.number} spots, the largest with {largest:.3g} % of the contact{at_load}",
        quantity="",
        unit="",
        colours="tab20",
    )


def _flux_map(contact: Contact) -> Map:
    """Return the map of the decimal logarithm of the flux over its mean, for a flow along x.

    It is masked where the flux over its mean is below `FAINT`. The flow is solved here, unless the
    contact has been asked for it before.
    """
    flow = contact.flow(axis=0)
    mean = flow.aperture**3 or 1.0  # 1, to divide by, if the contact seals
    flux_over_mean = np.hypot(*flow.flux) / mean
    state = "no flow, the contact seals"
    if flow.factor:
        state = f"flow factor {flow.factor:.3g}"
    return Map(
        field=np.ma.log10(np.ma.masked_less(flux_over_mean, FAINT)),
        sides=patch_sides(contact),
        title=f"flux along x: {state}",
        quantity="flux over its mean",
        unit="decades",
        colours="viridis",
    )


def patch_sides(contact: Contact) -> Sides:
    """Return the lengths of the patch of a contact.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.

    Returns
    -------
    tuple of float
        Lengths along x and y [um].
    """
    nx, ny = contact.pressure.shape
    dx, dy = contact.problem.spacing
    if contact.problem.boundary == "free":
        return dx * (nx - 1), dy * (ny - 1)
    return dx * nx, dy * ny


@dataclass(frozen=True)
class ContactCaptions:
    """Words of a picture of contacts, and the choice of its maps."""

    name: str  # name of the surface
    load: str  # quantity in which the loads were given: "delta", "force" or "pressure"
    bodies: Bodies  # E* and hardness [MPa]
    warnings: Sequence[str]  # one line for each reason to distrust the contacts
    # whether spots and flow are shown instead of heights and pressure
    options: AnswerOptions


def plot_contacts(
    figure: Any,
    last: Contact,
    rows: Sequence[Mapping[str, Any]],
    picture: Path,
    captions: ContactCaptions,
) -> None:
    """Draw the contact under the last load, and curves over several loads, and write the picture.

    Heights and pressure are drawn, or the maps of `gap_maps` if spots or flow are among the
    answers, and a section through both bodies. With several loads, curves of area, of force or
    displacement, and of mean gap follow. An existing file is replaced.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure, which is drawn into and whose size is set.
    last : bem.Contact
        Contact under the last load.
    rows : sequence of mapping
        A row for each contact, in any order: the values of `gen.maps.answers.answers` by column.
    picture : Path
        File of the picture.
    captions : ContactCaptions
        Words of the picture, and the choice of its maps.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    several = len(rows) > 1
    panels = [
        ["heights", "heights", "heights", "contact", "contact", "contact"],
        ["section", "section", "section", "section", "section", "section"],
    ]
    heights = [4.4, 2.6]
    if several:
        panels.append(["area", "area", "answer", "answer", "gap", "gap"])
        heights.append(2.8)
    figure.set_size_inches(11.0, sum(heights) + 0.8)
    axes = figure.subplot_mosaic(panels, height_ratios=heights)
    title = _contact_title(last, len(rows), captions)
    figure.suptitle(title, fontsize=11, parse_math=False)
    _write_warnings(figure, captions.warnings)
    at_load = ""
    if several:
        at_load = f" at {load_text(last, captions.load)}"
    first_map, second_map = _maps_of(last, at_load, captions.options)
    plot_map(axes["heights"], first_map)
    plot_map(axes["contact"], second_map)
    _plot_section(axes["section"], last, at_load)
    if several:
        law_axes = LawAxes(axes["area"], axes["answer"], axes["gap"])
        _plot_law(law_axes, rows, captions.load)
    save(figure, picture)


def _write_warnings(figure: Any, warnings: Sequence[str]) -> None:
    """Write the warnings below a figure, if there are any."""
    if not warnings:
        return
    lines = [textwrap.fill(f"warning: {warning}", WIDE_LINE) for warning in warnings]
    figure.supxlabel("\n".join(lines), fontsize=8, color="tab:red", parse_math=False)


def _contact_title(last: Contact, loads: int, captions: ContactCaptions) -> str:
    """Return the title of a picture in three lines: surface, load of the last contact, bodies.

    `loads` is the number of loads.
    """
    pressure = last.force / nominal_area(last)
    force = typographic(with_unit(last.force, "uN"))
    load = f"Δ = {last.delta:.4g} µm, force {force}, mean pressure {pressure:.4g} MPa"
    if loads > 1:
        load = f"last of {loads} loads: {load}"
    bodies = captions.bodies.text
    if not captions.bodies.has_modulus:
        bodies += ", no material given"
    if last.problem.boundary != "free":
        bodies += f"; {last.problem.boundary} boundary"
    return "\n".join((shortened(captions.name), load, bodies))


def _maps_of(contact: Contact, at_load: str, options: AnswerOptions) -> tuple[Map, Map]:
    """Return the two maps of a picture: of spots and flow if asked for, else heights and pressure.

    `at_load` is as in `gap_maps`.
    """
    if options.spots or options.flow:
        return gap_maps(contact, at_load, options)
    share = f"{contact.area_percent:.3g} % of {contact.pressure.size} nodes"
    return contact_maps(contact, "heights", f"contact{at_load}: {share}")


@dataclass(frozen=True, eq=False)
class _Section:
    """Both bodies along a line of n nodes of a contact: arrays of shape (n,)."""

    axis: int  # axis along which the line runs: 0 for x, 1 for y
    across: float  # place of the line along the other axis [um]
    places: Values  # places of the nodes along the line [um]
    # height of the surface of the half-space, which is at 0 before the contact [um]
    deformed: Values
    rough: Values  # height of the rough surface above it [um]
    touching: NDArray[np.bool_]  # whether each node is in contact and has not yielded
    yielded: NDArray[np.bool_]  # whether each node has yielded


def _section_of(contact: Contact) -> _Section:
    """Return the section along the line of `_loaded_line`, parallel to the longer side."""
    sides = patch_sides(contact)
    dx, dy = contact.problem.spacing
    axis = 0 if sides[0] >= sides[1] else 1
    line = _loaded_line(contact.pressure.sum(axis=axis))
    nodes: tuple[Any, ...] = (slice(None), line)
    step = dx
    step_across = dy
    if axis == 1:
        nodes = (line, slice(None))
        step = dy
        step_across = dx
    # Distance of the first node from the border, in spacings: the nodes of a free patch reach its
    # border, those of other patches are in the middle of cells.
    first = 0.0 if contact.problem.boundary == "free" else 0.5
    deformed = -contact.displacement[nodes]
    yielded = contact.yielded[nodes]
    return _Section(
        axis=axis,
        across=step_across * (first + line),
        places=step * (first + np.arange(deformed.size)),
        deformed=deformed,
        rough=contact.gap[nodes] + deformed,
        touching=(contact.pressure[nodes] != 0) & ~yielded,
        yielded=yielded,
    )


def _loaded_line(pressures: Values) -> int:
    """Return the index of the line with the largest sum of pressures.

    `pressures`, shape (lines,), has the sum for each line. Lines at the border (`BORDER`) are left
    out if any inner line is loaded.
    """
    margin = max(int(BORDER * pressures.size), 1)
    inner = pressures[margin : pressures.size - margin]
    if inner.any():
        return margin + int(inner.argmax())
    return int(pressures.argmax())


def _plot_section(axis: Any, contact: Contact, at_load: str) -> None:
    """Draw both bodies of a contact along the line of `_section_of`, the rough one above.

    `at_load`, as " at Δ = 1 µm" or "", ends the title, with a comma instead of "at".
    """
    section = _section_of(contact)
    deformed = section.deformed
    rough = section.rough
    # from the lowest to the highest of both bodies and the undeformed half-space (0)
    span = np.ptp([deformed.min(), deformed.max(), rough.max(), 0.0])
    margin = 0.08 * float(span)
    top = max(float(rough.max()), 0.0) + margin
    bottom = float(deformed.min()) - margin
    places = section.places
    axis.fill_between(places, rough, top, color="0.8", label="rough body")
    axis.fill_between(
        places, bottom, deformed, color="tab:blue", alpha=0.4, label="half-space"
    )
    touching = np.ma.masked_where(~section.touching, deformed)
    axis.plot(places, touching, ".", ms=4, color="tab:red", label="in contact")
    if section.yielded.any():
        yielded = np.ma.masked_where(~section.yielded, deformed)
        axis.plot(places, yielded, ".", ms=4, color=CYAN, label="yielded")
    axis.axhline(0, color="k", lw=0.6, ls=":")
    along = "xy"[section.axis]
    across = "yx"[section.axis]
    load = at_load.replace(" at", ",", 1)
    title = f"section at {across} = {section.across:.4g} µm{load}"
    axis.set_title(title, loc="left", fontsize=10)
    axis.set(xlabel=f"{along} [µm]", ylabel="z [µm], stretched")
    axis.set(xlim=(0, patch_sides(contact)[section.axis]), ylim=(bottom, top))
    axis.legend(
        loc="lower right", bbox_to_anchor=(1, 1), ncols=4, fontsize="small", frameon=False
    )


@dataclass(frozen=True, eq=False)
class LawAxes:
    """Axes of matplotlib for the curves over several loads."""

    area: Any  # for the area in contact
    # for the force if far-field displacements were given, otherwise for the displacement
    answer: Any
    gap: Any  # for the mean gap


def _plot_law(axes: LawAxes, rows: Sequence[Mapping[str, Any]], load: str) -> None:
    """Draw a curve over the loads into each of the axes.

    `rows` has the answers of each contact by column, and `load` is the quantity in which the loads
    were given: "delta", "force" or "pressure".
    """
    over = LOADS[load]
    rows = sorted(rows, key=lambda row: row[over.in_tables])
    answer = FORCE if load == "delta" else DELTA
    _plot_curve(axes.area, rows, over, AREA, "tab:blue")
    _plot_curve(axes.answer, rows, over, answer, "tab:orange")
    _plot_curve(axes.gap, rows, over, MEAN_GAP, "tab:green")


def _plot_curve(
    axis: Any,
    rows: Sequence[Mapping[str, Any]],
    over: Quantity,
    quantity: Quantity,
    colour: str,
) -> None:
    """Draw a quantity over the load `over`; `rows` are sorted by this load.

    The axis of the load is logarithmic if loads span `DECADES`, and then the other axis, too, if
    the values span a decade.
    """
    loads = np.array([row[over.in_tables] for row in rows])
    values = np.array([row[quantity.in_tables] for row in rows])
    axis.plot(loads, values, ".-", color=colour)
    axis.grid(alpha=0.3)
    axis.set(xlabel=over.label, ylabel=quantity.label)
    loads_span_decades = bool(loads[0] > 0 and loads[-1] >= DECADES * loads[0])
    values_span_decade = values.min() > 0 and values.max() >= 10 * values.min()
    if loads_span_decades:
        log_axis(axis.xaxis)
    if loads_span_decades and values_span_decade:
        log_axis(axis.yaxis)
    else:
        axis.set_ylim(0, 1.06 * float(values.max()) or 1.0)
