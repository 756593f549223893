"""Draw contacts of one surface: heights, contact spots, a section through the contact, the law."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.arrays import Values
from gen.maps import pictures
from gen.runtime.figure import log_axis, save
from gen.runtime.terminal import shortened

if TYPE_CHECKING:
    from bem import Contact

OBLONG = 1.8
"""Ratio of the sides from which the two maps stand side by side, or one below the other."""
SLIVER = 9.0
"""Ratio of the sides beyond which the shorter side is stretched, as the title then says."""
LETTERS = 105
"""Letters of load and material that stand in one line of the title."""
BORDER = 0.1
"""Share of the lines at both borders that a section avoids, since pressures are high there."""
WIDTH = 11.0
"""Width of a picture whose section is below the maps [inches]."""
SECTION = 6.0
"""Width of a section beside the maps [inches]."""


@dataclass(frozen=True)
class Subject:
    """Surface, load and material of a picture of contacts."""

    name: str  # name of the surface
    load: str  # {"delta", "force", "pressure"}: quantity that was given
    material: bool  # whether the user gave a modulus
    warnings: Sequence[str]  # one line for each reason to distrust the contacts
    spots: bool = False  # whether to draw spots and the open gap instead of heights and pressure


def draw_contacts(
    figure: Any, contacts: Sequence[Contact], subject: Subject, picture: Path
) -> None:
    """Draw a surface, its contact and a section under the last load, and the law of several
    loads.
    """
    last = contacts[-1]
    axes, letters = _panels(figure, pictures.patch_sides(last), law=len(contacts) > 1)
    figure.suptitle(_title(contacts, subject), fontsize=11, parse_math=False)
    if subject.warnings:
        lines = [textwrap.fill(f"warning: {warning}", 160) for warning in subject.warnings]
        figure.supxlabel("\n".join(lines), fontsize=8, color="tab:red", parse_math=False)
    where = f" at {pictures.load_text(last, subject.load)}" if len(contacts) > 1 else ""
    spots = f"contact{where}: {last.area_percent:.3g} % of {last.pressure.size} nodes"
    if subject.spots:
        heights_map, pressure_map = pictures.spot_maps(last)
        heights_map = replace(heights_map, title=f"{heights_map.title}{where}")
    else:
        heights_map, pressure_map = pictures.contact_maps(last, "heights", spots)
    pictures.draw_map(axes["heights"], heights_map, letters)
    pictures.draw_map(axes["spots"], pressure_map, letters)
    _stretch(axes, pictures.patch_sides(last))
    _draw_section(axes["section"], last, where)
    if len(contacts) > 1:
        _draw_law([axes[name] for name in ("area", "answer", "gap")], contacts, subject.load)
    save(figure, picture)


def _panels(figure: Any, sides: tuple[float, float], *, law: bool) -> tuple[dict[str, Any], int]:
    """Place the panels to suit the shape of the surface."""
    ratio = min(max(sides[1] / sides[0], 1 / SLIVER), SLIVER)
    if ratio > OBLONG:
        height = min(max(3.6 * ratio, 8.0), 9.5) if law else 6.0
        column = 0.75 * height / ratio + 2.4  # plus the colour bar and its label
        figure.set_size_inches(2 * column + SECTION, height)
        left, right = figure.subfigures(1, 2, width_ratios=[2 * column, SECTION])
        pair = left.subplots(1, 2)
        shares = [1.5, 1, 1, 1] if law else [1]
        below = np.atleast_1d(right.subplots(len(shares), 1, height_ratios=shares))
        letters = int(9 * column)
    else:
        wide = ratio < 1 / OBLONG
        map_height = (0.82 if wide else 0.31) * WIDTH * ratio + 1.1
        heights = [2 * map_height if wide else map_height, 2.6, *([2.8] if law else [])]
        figure.set_size_inches(WIDTH, sum(heights) + 0.8)
        top, middle, *bottom = figure.subfigures(len(heights), 1, height_ratios=heights)
        pair = top.subplots(2, 1) if wide else top.subplots(1, 2)
        below = np.array([middle.subplots(), *(bottom[0].subplots(1, 3) if law else [])])
        letters = 120 if wide else 56
    names = ("heights", "spots", "section", "area", "answer", "gap")
    return dict(zip(names, [*pair, *below], strict=False)), letters


def _stretch(axes: dict[str, Any], sides: tuple[float, float]) -> None:
    """Let very narrow maps fill their panels, and say so in their titles."""
    if max(sides) < SLIVER * min(sides):
        return
    for name in ("heights", "spots"):
        axes[name].set_aspect("auto")
        axes[name].set_title(
            f"{axes[name].get_title(loc='left')}\nnot to scale", loc="left", fontsize=10
        )


def _title(contacts: Sequence[Contact], subject: Subject) -> str:
    """Return the title: file, load and material in lines that fit."""
    last = contacts[-1]
    load = (
        f"Δ = {pictures.metric(1e-6 * last.delta, 'm')},"
        f" force {pictures.metric(1e-6 * last.force, 'N')},"
        f" mean pressure {pictures.metric(1e6 * last.force / pictures.nominal_area(last), 'Pa')}"
    )
    if len(contacts) > 1:
        load = f"last of {len(contacts)} loads: {load}"
    material = f"E* = {pictures.metric(1e6 * last.problem.modulus, 'Pa')}"
    if last.problem.hardness is not None:
        material += f", hardness {pictures.metric(1e6 * last.problem.hardness, 'Pa')}"
    if not subject.material:
        material += ", no material given"
    if last.problem.boundary != "free":
        material += f"; {last.problem.boundary} boundary"
    between = "; " if len(load) + len(material) < LETTERS else "\n"
    return f"{shortened(subject.name)}\n{load}{between}{material}"


def section_line(contact: Contact) -> tuple[int, int]:
    """Choose the line of nodes along which to draw a section.

    Among the lines along the longer side, the one with the largest force is chosen; if these
    have no contact off the border, the one with the largest force along the shorter side.
    """
    sides = pictures.patch_sides(contact)
    longer = 0 if sides[0] >= sides[1] else 1
    for along in (longer, 1 - longer):
        forces = contact.pressure.sum(axis=along)
        margin = max(int(BORDER * forces.size), 1)
        inner = forces[margin : forces.size - margin]
        if inner.max(initial=0.0) > 0:
            return along, margin + int(inner.argmax())
    return longer, int(contact.pressure.sum(axis=longer).argmax())


def _first_node(contact: Contact) -> float:
    """Return the distance from the border to the first node along an axis [spacing]."""
    return 0.0 if contact.problem.boundary == "free" else 0.5


def _draw_section(axis: Any, contact: Contact, load: str) -> None:
    """Draw both bodies along a line through the contact; the title says at which load."""
    along, place = section_line(contact)
    line: tuple[Any, ...] = (slice(None), place) if along == 0 else (place, slice(None))
    spacing, first = contact.problem.spacing, _first_node(contact)
    per_um, unit = pictures.axis_unit(max(pictures.patch_sides(contact)), pictures.FINE_SIDE)
    position = per_um * spacing[along] * (first + np.arange(contact.pressure.shape[along]))
    # The half-space's surface is at 0 before contact, and the rough body comes down from above.
    surfaces = -contact.displacement[line], contact.gap[line] - contact.displacement[line]
    factor, height_unit = pictures.axis_unit(float(np.ptp(surfaces)), pictures.FINE_HEIGHT)
    deformed, rough = (factor * heights for heights in surfaces)
    margin = 0.08 * float(np.ptp([deformed.min(), deformed.max(), rough.max(), 0.0]))
    top = max(float(rough.max()), 0.0) + margin
    bottom = float(deformed.min()) - margin
    axis.fill_between(position, rough, top, color="0.8", label="rough body")
    axis.fill_between(position, bottom, deformed, color="tab:blue", alpha=0.4, label="half-space")
    yielded = pictures.yielded_nodes(contact)[line]
    touching = np.ma.masked_where((contact.pressure[line] == 0) | yielded, deformed)
    axis.plot(position, touching, ".", ms=4, color="tab:red", label="in contact")
    if yielded.any():
        yielding = np.ma.masked_where(~yielded, deformed)
        axis.plot(position, yielding, ".", ms=4, color=pictures.CYAN, label="yielded")
    axis.axhline(0, color="k", lw=0.6, ls=":")
    names = "xy"
    across = per_um * spacing[1 - along] * (first + place)
    where = f"section at {names[1 - along]} = {across:.4g} {unit}{load.replace(' at', ',', 1)}"
    axis.set_title(where, loc="left", fontsize=10, pad=20)
    axis.set(xlabel=f"{names[along]} [{unit}]", ylabel=f"z [{height_unit}], stretched")
    axis.set(xlim=(0, per_um * pictures.patch_sides(contact)[along]), ylim=(bottom, top))
    axis.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=4,
        fontsize="small",
        frameon=False,
        borderaxespad=0.1,
        columnspacing=1.0,
        handlelength=1.2,
    )


def _draw_law(axes: Sequence[Any], contacts: Sequence[Contact], load: str) -> None:
    """Draw area, force or far-field displacement, and mean gap over the load that was given."""
    cells = pictures.nominal_area(contacts[0])
    displacements = _lengths([contact.delta for contact in contacts], "displacement Δ")
    quantities = {
        "delta": displacements,
        "force": ([contact.force for contact in contacts], "normal force [µN]"),
        "pressure": ([contact.force / cells for contact in contacts], "mean pressure [MPa]"),
    }
    given, label = quantities[load]
    order = np.argsort(given)
    loads = np.array(given)[order]
    decades = bool(loads[0] > 0 and loads[-1] >= pictures.DECADES * loads[0])
    answers = (
        ([contact.area_percent for contact in contacts], "contact area [%]"),
        quantities["force" if load == "delta" else "delta"],
        _lengths([contact.mean_gap for contact in contacts], "mean gap"),
    )
    for axis, (numbers, name), colour in zip(
        axes, answers, ("tab:blue", "tab:orange", "tab:green"), strict=True
    ):
        _draw_curve(axis, loads, np.array(numbers)[order], decades=decades, color=colour)
        axis.set(xlabel=label, ylabel=name)


def _lengths(values: Sequence[float], name: str) -> tuple[list[float], str]:
    """Return lengths [um] in the unit of their axis, and the label of that axis."""
    factor, unit = pictures.axis_unit(max(values), pictures.FINE_HEIGHT)
    return [factor * value for value in values], f"{name} [{unit}]"


def _draw_curve(
    axis: Any,
    loads: Values,
    answers: Values,
    *,
    decades: bool,
    color: str,
) -> None:
    """Draw one quantity over the loads, on axes from 0 or over decades."""
    axis.plot(loads, answers, ".-", color=color)
    axis.grid(alpha=0.3)
    if decades:
        log_axis(axis.xaxis)
    if decades and answers.min() > 0 and answers.max() >= 10 * answers.min():
        log_axis(axis.yaxis)
    else:
        axis.set_ylim(0, 1.06 * float(answers.max()) or 1.0)
