"""Pictures of contacts: heights, pressure, gap, spots, flux, a section, and the law of loads."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.maps.contacts import AnswerOptions
from gen.maps.pictures import COLOURS, CYAN, Map, plot_map
from gen.maps.read import Sides
from gen.material import Bodies
from gen.quantities import AREA, DELTA, FORCE, LOADS, MEAN_GAP, Quantity, nominal_area
from gen.runtime.figure import log_axis, save
from gen.runtime.terminal import shortened

if TYPE_CHECKING:
    from bem import Contact

# ratio of the largest to the smallest load from which on axes of loads are logarithmic
DECADES = 99.0
# share of the lines at both borders that a section avoids, since pressures are high there
BORDER = 0.1
FAINT = 1e-4  # least flux that is drawn, over its mean
WIDE_LINE = 160  # letters in a line below a picture


def load_text(contact: Contact, quantity: str) -> str:
    """Write the load of a contact in the quantity that the load was given in.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.
    quantity : str
        "force", a quantity whose name begins with "delta", or any other one for the mean pressure.

    Returns
    -------
    str
        The load with its unit.
    """
    if quantity.startswith("delta"):
        return f"Δ = {contact.delta:.4g} µm"
    if quantity == "force":
        return f"{contact.force:.4g} µN"
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
        Titles of both maps.

    Returns
    -------
    tuple of Map
        The map of the heights and that of the pressure.
    """
    sides = patch_sides(contact)
    yielded = contact.yielded
    pressure = np.ma.masked_where((contact.pressure == 0) | yielded, contact.pressure)
    if yielded.any():
        pressure_title += f", {contact.yielded_percent:.3g} % yielded (cyan)"
    return (
        Map(
            field=contact.problem.heights,
            sides=sides,
            title=height_title,
            quantity="height",
            unit="µm",
            colours="viridis",
        ),
        Map(
            field=pressure,
            sides=sides,
            title=pressure_title,
            quantity="pressure",
            unit="MPa",
            colours="inferno_r",
            marked=yielded,
        ),
    )


def gap_maps(contact: Contact, at_load: str, options: AnswerOptions) -> tuple[Map, Map]:
    """Return two maps that show the answers about spots and flow.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.
    at_load : str
        End of the titles of maps of the contact, as " at Δ = 1 µm", or "".
    options : AnswerOptions
        Whether spots and flow are among the answers, one of them at least.

    Returns
    -------
    tuple of Map
        Of the spots the gap and the spots by size; of the flow the gap and the flux along x; of
        both the spots by size and the flux.
    """
    if not options.flow:
        return _gap_map(contact, at_load), _spots_map(contact, "")
    if options.spots:
        return _spots_map(contact, at_load), _flux_map(contact)
    return _gap_map(contact, at_load), _flux_map(contact)


def _gap_map(contact: Contact, at_load: str) -> Map:
    """Return the map of the gap; if it connects opposite sides, closed pockets are marked."""
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
    """Return the map of the spots of contact, in colours by their rank of size."""
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
    """Return the map of the flux along x over its mean, by decades."""
    flow = contact.flow(0)
    share = np.hypot(*flow.flux) / (flow.aperture**3 or 1.0)
    state = "no flow, the contact seals"
    if flow.factor:
        state = f"flow factor {flow.factor:.3g}"
    return Map(
        field=np.ma.log10(np.ma.masked_less(share, FAINT)),
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
    """What a picture of contacts says in words, and what it shows."""

    name: str  # name of the surface
    load: str  # quantity that the loads were given in: "delta", "force" or "pressure"
    bodies: Bodies  # E* and hardness [MPa]
    warnings: Sequence[str]  # one line for each reason to distrust the contacts
    options: AnswerOptions  # answers that are shown beside area, force and gap


def plot_contacts(
    figure: Any,
    last: Contact,
    rows: Sequence[Mapping[str, Any]],
    picture: Path,
    captions: ContactCaptions,
) -> None:
    """Draw a surface, its contact and a section under the last load, and the law of several loads.

    If spots or flow are among the answers, the spots, the gap or the flux along x are drawn
    instead of heights and pressure. The picture is written, and replaces one of before.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure, still empty; its size is set.
    last : bem.Contact
        Contact under the last load.
    rows : sequence of mapping
        Values of each contact by the columns of `gen.maps.contacts.answers`.
    picture : Path
        File of the picture.
    captions : ContactCaptions
        Words of the picture.

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
    if captions.warnings:
        lines = [
            textwrap.fill(f"warning: {warning}", WIDE_LINE)
            for warning in captions.warnings
        ]
        figure.supxlabel("\n".join(lines), fontsize=8, color="tab:red", parse_math=False)
    at_load = f" at {load_text(last, captions.load)}" if several else ""
    first_map, second_map = _maps_of(last, at_load, captions.options)
    plot_map(axes["heights"], first_map)
    plot_map(axes["contact"], second_map)
    _plot_section(axes["section"], last, at_load)
    if several:
        law_axes = LawAxes(axes["area"], axes["answer"], axes["gap"])
        _plot_law(law_axes, rows, captions.load)
    save(figure, picture)


def _contact_title(last: Contact, loads: int, captions: ContactCaptions) -> str:
    """Return the title of a picture of contacts: name, last of some loads, and bodies."""
    pressure = last.force / nominal_area(last)
    load = (
        f"Δ = {last.delta:.4g} µm, force {last.force:.4g} µN,"
        f" mean pressure {pressure:.4g} MPa"
    )
    if loads > 1:
        load = f"last of {loads} loads: {load}"
    bodies = captions.bodies.text
    if not captions.bodies.has_modulus:
        bodies += ", no material given"
    if last.problem.boundary != "free":
        bodies += f"; {last.problem.boundary} boundary"
    return "\n".join((shortened(captions.name), load, bodies))


def _maps_of(contact: Contact, at_load: str, options: AnswerOptions) -> tuple[Map, Map]:
    """Return the two maps of a picture of contacts, by the answers that it shows."""
    if options.spots or options.flow:
        return gap_maps(contact, at_load, options)
    share = f"{contact.area_percent:.3g} % of {contact.pressure.size} nodes"
    return contact_maps(contact, "heights", f"contact{at_load}: {share}")


@dataclass(frozen=True, eq=False)
class _Section:
    """Both bodies along a line of nodes of a contact: arrays of shape (n,)."""

    axis: int  # axis of the line: 0 for x, 1 for y
    across: float  # place of the line along the other axis [um]
    places: Values  # of the nodes along the line [um]
    # surface of the half-space, which is at 0 before the contact, and the rough body above it [um]
    deformed: Values
    rough: Values
    touching: NDArray[np.bool_]  # nodes in contact that have not yielded
    yielded: NDArray[np.bool_]


def _section_of(contact: Contact) -> _Section:
    """Return the section along the longer side, in the most loaded line off the border."""
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
    # distance of the first node from the border, in spacings
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
    """Return the line of nodes with the largest sum of pressures, off the border if it can be."""
    margin = max(int(BORDER * pressures.size), 1)
    inner = pressures[margin : pressures.size - margin]
    if inner.any():
        return margin + int(inner.argmax())
    return int(pressures.argmax())


def _plot_section(axis: Any, contact: Contact, at_load: str) -> None:
    """Draw both bodies along the line of `_section_of`, the rough one above."""
    section = _section_of(contact)
    deformed = section.deformed
    rough = section.rough
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
    """Axes of matplotlib for the law of several loads."""

    area: Any
    answer: (
        Any  # for the far-field displacement, or the force if displacements were given
    )
    gap: Any


def _plot_law(axes: LawAxes, rows: Sequence[Mapping[str, Any]], load: str) -> None:
    """Draw area, force or far-field displacement, and mean gap over the load that was given."""
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
    """Draw a quantity over another one of rising rows, with logarithmic axes over decades."""
    loads = np.array([row[over.in_tables] for row in rows])
    values = np.array([row[quantity.in_tables] for row in rows])
    axis.plot(loads, values, ".-", color=colour)
    axis.grid(alpha=0.3)
    axis.set(xlabel=over.label, ylabel=quantity.label)
    decades = bool(loads[0] > 0 and loads[-1] >= DECADES * loads[0])
    if decades:
        log_axis(axis.xaxis)
    if decades and values.min() > 0 and values.max() >= 10 * values.min():
        log_axis(axis.yaxis)
    else:
        axis.set_ylim(0, 1.06 * float(values.max()) or 1.0)
