"""Contacts of one surface under one load or several: solutions, answers, rows."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, NamedTuple

from gen.doubts import Pressed
from gen.maps.prepare import is_tilted
from gen.maps.read import Topography
from gen.material import loads_from, require_within
from gen.quantities import (
    CONDUCTANCE,
    CONTACT_NODES,
    CONTINUUM,
    DELTA,
    LOADS,
    QUANTITIES,
    SIDES,
    Media,
    Quantity,
    nominal_area,
)
from gen.runtime import memory
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress

if TYPE_CHECKING:
    from bem import Contact


@dataclass(frozen=True)
class Wanted:
    """Answers that are asked for beside area, force and gap."""

    grid_error: bool = (
        False  # whether the area in the continuum comes with the grid's error
    )
    spots: bool = False  # whether spots are counted
    flow: bool = False  # whether a fluid flows through the gap, along either axis
    stiffness: bool = False  # whether the stiffness is solved for
    # conductivities of both bodies, which ask for the conductance [W/(m K)]
    conductivities: tuple[float, float] | None = None

    @property
    def options(self) -> list[str]:
        """Options that quantities are shown with, in the order of the answers."""
        return [
            "always",
            *(field.name for field in fields(self) if getattr(self, field.name)),
        ]


class Answer(NamedTuple):
    """One number of a contact, as a line of a report and as a cell of a table."""

    column: str  # name of the column in tables
    value: float | int | str  # value in `unit`; "" where there is none
    # name and unit for people, with a remark where one is due
    label: str
    unit: str
    error: float = (
        0.0  # of the value, from whose second digit on people see none; 0 for rounding
    )

    @property
    def shown(self) -> str:
        """The value as text for people, with as many digits as are true."""
        if not isinstance(self.value, float):
            return str(self.value) or "-"
        if not 0 < self.error < math.inf:
            return f"{self.value:.6g}"
        return f"{self.value:.{max(1 - math.floor(math.log10(self.error)), 0)}f}"


def require_conductivities(given: Sequence[float]) -> tuple[float, float]:
    """Return the conductivities of both bodies [W/(m K)], the same for both if one is given."""
    if len(given) > 2:
        raise InputError(
            f"--conductivity was given {len(given)} times: give it once or twice"
        )
    for conductivity in given:
        require_within("--conductivity", conductivity, "W/(m K)")
    return given[0], given[-1]


def answers(contact: Contact, wanted: Wanted) -> list[Answer]:
    """Read off a solved contact what is asked for, and compute what that needs.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.
    wanted : Wanted
        What is asked for beside the quantities that are always shown.

    Returns
    -------
    list of Answer
        One for each line of a report.

    Raises
    ------
    InputError
        If a linear solve, or the flow through the gap, does not converge.
    """
    media = Media(wanted.conductivities)
    problem = contact.problem
    rows: list[Answer] = []
    try:
        for option in wanted.options:
            for quantity in QUANTITIES.values():
                elastic = problem.hardness is None
                if quantity.option == option and not (
                    quantity.needs_hardness and elastic
                ):
                    rows += _answers_of(quantity, contact, media)
            if option == "always":
                rows += _about_the_bodies(contact)
        if wanted.conductivities is not None:
            rows.append(_conductance_per_area(contact, media))
    except ArithmeticError as error:
        raise InputError(str(error)) from None
    return [*rows, Answer("residual", contact.residual, "residual", "of Delta")]


def _about_the_bodies(contact: Contact) -> list[Answer]:
    """Return the answers about the bodies that were given."""
    problem = contact.problem
    rows = [Answer("modulus_MPa", problem.modulus, "modulus E*", "MPa")]
    if problem.boundary != "free":
        rows.append(Answer("boundary", problem.boundary, "boundary", ""))
    if problem.hardness is not None:
        rows.append(Answer("hardness_MPa", problem.hardness, "hardness", "MPa"))
    return rows


def _answers_of(quantity: Quantity, contact: Contact, media: Media) -> list[Answer]:
    """Return the answer about one quantity; that about the area in the continuum has an error."""
    value = quantity.of(contact, media)
    if quantity.code:
        value = _sides_in_words(int(value))
    if quantity is CONTINUUM:
        return _continuum(contact, value)
    remark = _remark(quantity, contact)
    unit = "" if quantity.unit == "1" else quantity.unit
    words = [unit, remark] if remark else [unit]
    separator = " " if quantity.unit == "%" else ", "
    shown = separator.join(filter(None, words))
    return [Answer(quantity.in_tables, value, quantity.noun, shown)]


def _sides_in_words(code: int) -> str:
    """Say which opposite sides are connected, of the codes of `gen.quantities.SIDES`."""
    axes = [axis for axis, side in zip("xy", SIDES, strict=True) if code & side]
    return " and ".join(axes) or "no"


def _continuum(contact: Contact, area: float) -> list[Answer]:
    """Return the answers about the area in the continuum and the error that the grid makes."""
    error = contact.grid_error()
    bar = error.area_percent
    unit = f"+- {bar:.2g} %, in 9 of 10 cases" if error.resolved else "% on this grid"
    resolved = "yes" if error.resolved else "no"
    return [
        Answer(CONTINUUM.in_tables, area, CONTINUUM.noun, unit, bar),
        Answer(CONTINUUM_ERROR, bar if error.resolved else "", "its error", "%", bar),
        Answer("resolved", resolved, "resolved by the grid", error.reason),
    ]


def _remark(quantity: Quantity, contact: Contact) -> str:
    """Return what a person should know about the value of a quantity beside its unit."""
    nx, ny = contact.pressure.shape
    cell = math.prod(contact.problem.spacing)
    match quantity.name:
        case "contact_nodes":
            return f"of {nx} x {ny}"
        case "mean_spot_area":
            return f"a node has {cell:.4g}"
        case "contact_connects" | "gap_connects":
            return "directions"
        case "flow_factor_x" | "flow_factor_y" if not quantity.of(contact):
            return "no flow: the contact seals"
        case "interface_stiffness" | "interface_conductance":
            return _about_the_interface(contact)
    return quantity.remark


def _about_the_interface(contact: Contact) -> str:
    """Say what is left out of the stiffness of an interface."""
    if contact.interface_stiffness == math.inf:
        return "full contact, in which nothing but the bodies is left"
    if contact.problem.boundary == "free":
        return "without the patch's own constriction"
    return ""


def _conductance_per_area(contact: Contact, media: Media) -> Answer:
    """Return the conductance of the interface per nominal area."""
    value = 1e12 * CONDUCTANCE.of(contact, media) / nominal_area(contact)
    remark = _about_the_interface(contact)
    unit = f"W/(m2 K), {remark}" if remark else "W/(m2 K)"
    return Answer("interface_conductance_W_per_m2_K", value, "per nominal area", unit)


CONTINUUM_ERROR = f"{CONTINUUM.name.removesuffix('_percent')}_error_percent"  # a column
OUTER = 0.05  # share of the lines of nodes on each side whose load is told apart
# how messages write a load
SHOWN = {
    load: f"{'Delta = ' if load == 'delta' else ''}{{:.6g}} {quantity.unit}"
    for load, quantity in LOADS.items()
}


def chosen_load(given: dict[str, str]) -> tuple[str, list[float]]:
    """Return the name and the values of the load that the user gave by one of the options."""
    chosen = [name for name in SHOWN if given[name]]
    if len(chosen) != 1:
        said = " and ".join(f"--{name}" for name in chosen) or "no load"
        raise InputError(f"{said} given: give one of --delta, --force and --pressure")
    name, advice = chosen[0], "give a number, several as 1,2,5, or start:stop:count[:log]"
    return name, loads_from(name, given[name], advice)


def solve_loads(
    topography: Topography, load: str, values: Sequence[float], **settings: Any
) -> Iterator[tuple[Contact | None, str]]:
    """Solve a surface under one load after another; yield no contact but a fault if one fails.

    A load under which the solver does not converge costs only itself, unless none does. Raises
    InputError if a number is not allowed, there is no solution, or memory is too short.
    """
    import bem
    from bem.problem import pose

    heights, sides = topography.heights, topography.sides
    settings |= {"boundary": topography.boundary, "spacing": topography.exact_spacing}
    loads: dict[str, Any] = {f"{load}s": values}
    solved = 0
    try:
        if len(values) > 1:  # the largest load is refused before the first is solved
            largest: dict[str, Any] = {"delta": None, load: max(values)}
            pose(heights, sides, **largest, **settings)
        contacts = bem.ladder(heights, sides, **loads, **settings)
        for value in values:
            try:
                yield next(contacts), ""
                solved += 1
            except bem.NotConverged as error:
                shown = f"{SHOWN[load].format(value)}: " if len(values) > 1 else ""
                if not solved and value == values[-1]:
                    raise ValueError(f"{shown}{error}") from None
                yield None, f"{shown}{error}"
    except ValueError as error:
        raise InputError(f"{topography.name}: {error}") from None
    except MemoryError:
        short = memory.too_little_for_solve(topography.heights.shape)
        raise InputError(f"{topography.name}: {short}") from None


def follow(
    solutions: Iterator[tuple[Contact | None, str]], many: int, wanted: Wanted
) -> tuple[list[list[Answer]], Contact, list[str], float]:
    """Solve under many loads and show the progress; the last contact alone is kept.

    Returns what is known of each contact, the last one, a line for each load that was not solved,
    and the time of the last solve [s].
    """
    rows, faults, seconds, last = [], [], 0.0, None
    with RunProgress(many, "loads") if many > 1 else nullcontext() as progress:
        # Nothing is printed before the first contact is solved, since its load may be refused.
        for _ in range(many):
            began = time.perf_counter()
            contact, fault = next(solutions)
            seconds = time.perf_counter() - began
            if contact is None:
                faults.append(f"not solved, left out: {fault}")
            else:
                rows.append(answers(contact, wanted))
                last = contact
            if progress is not None:
                progress.advance(1, contact is None)
    assert last is not None  # else the last load is refused
    return rows, last, faults, seconds


def judged(rows: Sequence[Mapping[str, Any]]) -> list[Pressed]:
    """Return what contacts are doubted by, from the cells of their answers."""
    return [
        Pressed(
            row[DELTA.in_tables],
            row[QUANTITIES["largest_pressure"].in_tables],
            row[CONTACT_NODES.in_tables],
        )
        for row in rows
    ]


def border_remark(topography: Topography, last: Contact, loads: int) -> str:
    """Say which share of the last force the borders of a free patch carry, if that is known."""
    pressure = last.pressure
    outer = [int(OUTER * nodes) for nodes in pressure.shape]
    if topography.boundary != "free" or min(outer) < 1 or not pressure.any():
        return ""
    (nx, ny), (x, y) = pressure.shape, outer
    share = 1 - float(pressure[x : nx - x, y : ny - y].sum() / pressure.sum())
    nodes = 1 - (nx - 2 * x) * (ny - 2 * y) / pressure.size
    said = (
        f"the outer 5 % on each side ({100 * nodes:.2g} % of the nodes) carry {100 * share:.3g} %"
        f" of the {'last ' if loads > 1 else ''}force"
    )
    if is_tilted(topography):  # whose mirror images are tilted too
        return said
    return f"{said}: if this is a piece of a larger surface, --boundary mirror leaves no edges"
