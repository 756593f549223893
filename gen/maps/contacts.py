"""Contacts of one surface under one load or several: solutions, answers, rows."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
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
class AnswerOptions:
    """Options of `gen contact` that add answers to area, force and gap.

    Each field has the name of an option of quantities, see `gen.quantities.Quantity.option`.
    """

    # whether to estimate the area in the continuum and the error of the grid
    grid_error: bool = False
    spots: bool = False  # whether to count the spots of contact
    flow: bool = (
        False  # whether to solve the flow of a fluid through the gap along x and y
    )
    stiffness: bool = False  # whether to solve for the stiffness
    # thermal conductivities of both bodies [W/(m K)], with which the conductance is solved for
    conductivities: tuple[float, float] | None = None

    @property
    def names(self) -> list[str]:
        """Names of the options whose quantities are shown, in the order of the answers."""
        chosen = [field.name for field in fields(self) if getattr(self, field.name)]
        return ["always", *chosen]


class Answer(NamedTuple):
    """One number of a contact, as a line of a report and as a cell of a table."""

    column: str  # name of the column in tables
    value: float | int | str  # value in `unit`; "" if the contact has none
    label: str  # name for people
    unit: str  # unit for people, followed by a remark if the value needs one
    # error of the value, which is shown to the second digit of its error; 0 shows six digits
    error: float = 0.0

    @property
    def shown(self) -> str:
        """The value as text for people, with as many digits as are true."""
        if not isinstance(self.value, float):
            return str(self.value) or "-"
        if not 0 < self.error < math.inf:
            return f"{self.value:.6g}"
        decimals = max(1 - math.floor(math.log10(self.error)), 0)
        return f"{self.value:.{decimals}f}"


def require_conductivities(conductivities: Sequence[float]) -> tuple[float, float]:
    """Return the thermal conductivities of both bodies.

    Parameters
    ----------
    conductivities : sequence of float
        Values of the option --conductivity, one for both bodies or one for each [W/(m K)].

    Returns
    -------
    tuple of float
        Conductivities of the first and of the second body [W/(m K)].

    Raises
    ------
    InputError
        If there are more than two, or one is outside the range of physical numbers.
    """
    if len(conductivities) > 2:
        raise InputError(
            f"--conductivity was given {len(conductivities)} times: give it once or twice"
        )
    for conductivity in conductivities:
        require_within("--conductivity", conductivity, "W/(m K)")
    return conductivities[0], conductivities[-1]


def answers(contact: Contact, options: AnswerOptions) -> list[Answer]:
    """Read the answers off a solved contact, and solve for those that need more.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.
    options : AnswerOptions
        Answers beside the quantities that are always shown.

    Returns
    -------
    list of Answer
        One for each line of a report.

    Raises
    ------
    InputError
        If a linear solve, or the flow through the gap, does not converge.
    """
    media = Media(options.conductivities)
    rows: list[Answer] = []
    try:
        for option in options.names:
            rows += _answers_of_option(option, contact, media)
            if option == "always":
                rows += _about_the_bodies(contact)
        if options.conductivities is not None:
            rows.append(_conductance_per_area(contact, media))
    except ArithmeticError as error:
        raise InputError(str(error)) from None
    rows.append(Answer("residual", contact.residual, "residual", "of Delta"))
    return rows


def _answers_of_option(option: str, contact: Contact, media: Media) -> list[Answer]:
    """Return the answers about the quantities that an option shows of a contact."""
    elastic = contact.problem.hardness is None
    rows: list[Answer] = []
    for quantity in QUANTITIES.values():
        if quantity.option != option:
            continue
        if quantity.needs_hardness and elastic:
            continue
        rows += _answers_of_quantity(quantity, contact, media)
    return rows


def _about_the_bodies(contact: Contact) -> list[Answer]:
    """Return the answers about E*, a boundary that is not free, and a hardness."""
    problem = contact.problem
    rows = [Answer("modulus_MPa", problem.modulus, "modulus E*", "MPa")]
    if problem.boundary != "free":
        rows.append(Answer("boundary", problem.boundary, "boundary", ""))
    if problem.hardness is not None:
        rows.append(Answer("hardness_MPa", problem.hardness, "hardness", "MPa"))
    return rows


def _answers_of_quantity(
    quantity: Quantity, contact: Contact, media: Media
) -> list[Answer]:
    """Return one answer about a quantity; the area in the continuum has three, with its error."""
    value = quantity.of(contact, media)
    if quantity.code:
        value = _sides_in_words(int(value))
    if quantity is CONTINUUM:
        return _about_the_continuum(contact, value)
    words = []
    if quantity.unit != "1":
        words.append(quantity.unit)
    remark = _remark(quantity, contact)
    if remark:
        words.append(remark)
    separator = " " if quantity.unit == "%" else ", "
    unit = separator.join(words)
    return [Answer(quantity.in_tables, value, quantity.noun, unit)]


def _sides_in_words(code: int) -> str:
    """Return the axes whose opposite sides are connected, from a code of `gen.quantities.SIDES`."""
    axes = [axis for axis, side in zip("xy", SIDES, strict=True) if code & side]
    return " and ".join(axes) or "no"


def _about_the_continuum(contact: Contact, area: float) -> list[Answer]:
    """Return the answers about the area in the continuum [%] and the error of the grid [%]."""
    error = contact.grid_error()
    bar = error.area_percent
    known_error: float | str
    if error.resolved:
        unit = f"+- {bar:.2g} %, in 9 of 10 cases"
        known_error = bar
        resolved = "yes"
    else:
        unit = "% on this grid"
        known_error = ""
        resolved = "no"
    return [
        Answer(CONTINUUM.in_tables, area, CONTINUUM.noun, unit, bar),
        Answer(CONTINUUM_ERROR, known_error, "its error", "%", bar),
        Answer("resolved", resolved, "resolved by the grid", error.reason),
    ]


def _remark(quantity: Quantity, contact: Contact) -> str:
    """Return a remark on the value of a quantity for people, "" without one."""
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
    """Return what the stiffness of an interface leaves out, "" for nothing."""
    if contact.interface_stiffness == math.inf:
        return "full contact, in which nothing but the bodies is left"
    if contact.problem.boundary == "free":
        return "without the patch's own constriction"
    return ""


def _conductance_per_area(contact: Contact, media: Media) -> Answer:
    """Return the conductance of the interface per nominal area [W/(m2 K)]."""
    value = 1e12 * CONDUCTANCE.of(contact, media) / nominal_area(contact)
    unit = "W/(m2 K)"
    remark = _about_the_interface(contact)
    if remark:
        unit += f", {remark}"
    return Answer("interface_conductance_W_per_m2_K", value, "per nominal area", unit)


CONTINUUM_ERROR = f"{CONTINUUM.name.removesuffix('_percent')}_error_percent"
"""Column of the error of the area in the continuum."""

OUTER = (
    0.05  # share of the lines of nodes that `border_remark` counts as border on each side
)


def load_in_words(load: str, value: float) -> str:
    """Write a load as messages do.

    Parameters
    ----------
    load : {"delta", "force", "pressure"}
        Quantity of the load.
    value : float
        Its value [um, uN or MPa].

    Returns
    -------
    str
        "Delta = 2 um", "2 uN" or "2 MPa".
    """
    text = f"{value:.6g} {LOADS[load].unit}"
    return f"Delta = {text}" if load == "delta" else text


class ChosenLoad(NamedTuple):
    """The load that a user chose by one of the options --delta, --force and --pressure."""

    name: str  # "delta", "force" or "pressure"
    values: list[float]  # [um, uN or MPa]


def chosen_load(texts: Mapping[str, str]) -> ChosenLoad:
    """Return the load that the user gave by one of its options.

    Parameters
    ----------
    texts : mapping of str
        Value of the options --delta, --force and --pressure by "delta", "force" and "pressure";
        "" for an option that is left out.

    Returns
    -------
    ChosenLoad
        Name and values of the load.

    Raises
    ------
    InputError
        If not exactly one option has a value, or its value is no load.
    """
    names = [name for name in LOADS if texts[name]]
    if len(names) != 1:
        options = " and ".join(f"--{name}" for name in names) or "no load"
        raise InputError(f"{options} given: give one of --delta, --force and --pressure")
    [name] = names
    advice = "give a number, several as 1,2,5, or start:stop:count[:log]"
    return ChosenLoad(name, loads_from(name, texts[name], advice))


@dataclass(frozen=True, eq=False)
class LoadSolution:
    """The contact under one load, or the reason why it was not solved."""

    contact: Contact | None  # None if the solver did not converge
    fault: str = ""  # reason why there is no contact, "" if there is one


def solve_loads(
    topography: Topography, load: str, values: Sequence[float], **settings: Any
) -> Iterator[LoadSolution]:
    """Solve a surface under one load after another.

    A load under which the solver does not converge costs no other load; only if none converges,
    that of the last one is raised. The largest load is checked before the first one is solved.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    load : {"delta", "force", "pressure"}
        Quantity of the loads.
    values : sequence of float
        One load or more, in any order [um, uN or MPa].
    **settings : object
        Further settings of `bem.ladder`, as modulus [MPa] and hardness [MPa].

    Yields
    ------
    LoadSolution
        One for each load, in their order.

    Raises
    ------
    InputError
        If a number is not allowed, there is no equilibrium, no load converges, or memory is
        too short.
    """
    settings |= {"boundary": topography.boundary, "spacing": topography.exact_spacing}
    try:
        if len(values) > 1:
            _check_load(topography, load, max(values), settings)
        yield from _solutions(topography, load, values, settings)
    except ValueError as error:
        raise InputError(f"{topography.name}: {error}") from None
    except MemoryError:
        shortage = memory.too_little_for_solve(topography.heights.shape)
        raise InputError(f"{topography.name}: {shortage}") from None


def _check_load(
    topography: Topography, load: str, value: float, settings: Mapping[str, Any]
) -> None:
    """Raise ValueError if a load [um, uN or MPa] is not allowed or has no equilibrium."""
    from bem.problem import pose

    loads: dict[str, Any] = {"delta": None, load: value}
    pose(topography.heights, topography.sides, **loads, **settings)


def _solutions(
    topography: Topography,
    load: str,
    values: Sequence[float],
    settings: Mapping[str, Any],
) -> Iterator[LoadSolution]:
    """Yield the solution under each load; raise ValueError at the last one if none converges."""
    import bem

    loads: dict[str, Any] = {f"{load}s": values}
    contacts = bem.ladder(topography.heights, topography.sides, **loads, **settings)
    solved = False
    for value in values:
        try:
            solution = LoadSolution(next(contacts))
            solved = True
        except bem.NotConverged as error:
            fault = str(error)
            if len(values) > 1:
                fault = f"{load_in_words(load, value)}: {fault}"
            if not solved and value == values[-1]:
                raise ValueError(fault) from None
            solution = LoadSolution(None, fault)
        yield solution


@dataclass(frozen=True, eq=False)
class SolvedLoads:
    """The answers about one surface under all loads, with the last contact itself."""

    rows: list[list[Answer]]  # answers about each contact that was solved
    last: Contact  # contact under the last load that was solved
    faults: list[str]  # one line for each load that was not solved
    seconds: float  # time of the last solve [s]


def solve_all(
    solutions: Iterator[LoadSolution], number: int, options: AnswerOptions
) -> SolvedLoads:
    """Solve a surface under all loads, and show the progress if there are several.

    No contact but the last one is kept in memory. The progress is printed on the terminal.

    Parameters
    ----------
    solutions : iterator of LoadSolution
        Iterator of `solve_loads`, which solves for a load when it is advanced.
    number : int
        Number of loads.
    options : AnswerOptions
        Answers beside the quantities that are always shown.

    Returns
    -------
    SolvedLoads
        Answers, last contact and faults.

    Raises
    ------
    InputError
        As `solve_loads` and `answers` do.
    """
    rows: list[list[Answer]] = []
    faults: list[str] = []
    last: Contact | None = None
    seconds = 0.0
    # Nothing is printed before the first contact is solved, since its load may be refused.
    context: AbstractContextManager[RunProgress | None] = nullcontext()
    if number > 1:
        context = RunProgress(number, "loads")
    with context as progress:
        for _ in range(number):
            start = time.perf_counter()
            solution = next(solutions)
            seconds = time.perf_counter() - start
            if solution.contact is None:
                faults.append(f"not solved, left out: {solution.fault}")
            else:
                rows.append(answers(solution.contact, options))
                last = solution.contact
            if progress is not None:
                progress.advance(1, failed=int(solution.contact is None))
    assert last is not None  # `solve_loads` raises at the last load if none is solved
    return SolvedLoads(rows, last, faults, seconds)


def pressed_contacts(rows: Sequence[Mapping[str, Any]]) -> list[Pressed]:
    """Return the numbers of contacts that `gen.doubts.contact_doubts` needs.

    Parameters
    ----------
    rows : sequence of mapping
        Values of the answers of each contact by their columns.

    Returns
    -------
    list of Pressed
        One for each row.
    """
    largest_pressure = QUANTITIES["largest_pressure"]
    return [
        Pressed(
            delta=row[DELTA.in_tables],
            largest_pressure=row[largest_pressure.in_tables],
            contact_nodes=row[CONTACT_NODES.in_tables],
        )
        for row in rows
    ]


def border_remark(topography: Topography, contact: Contact, loads: int) -> str:
    """Write which share of the force the borders of a free patch carry.

    Borders are the outer 5 % of the lines of nodes on each side.

    Parameters
    ----------
    topography : Topography
        The surface.
    contact : bem.Contact
        Its contact under the last load.
    loads : int
        Number of loads.

    Returns
    -------
    str
        One line; "" for a patch without edges, with too few nodes or without contact.
    """
    pressure = contact.pressure
    nx, ny = pressure.shape
    outer_x = int(OUTER * nx)
    outer_y = int(OUTER * ny)
    if topography.boundary != "free" or not pressure.any():
        return ""
    if min(outer_x, outer_y) < 1:
        return ""
    inner = pressure[outer_x : nx - outer_x, outer_y : ny - outer_y]
    force_percent = 100 * (1 - float(inner.sum() / pressure.sum()))
    nodes_percent = 100 * (1 - inner.size / pressure.size)
    force = "last force" if loads > 1 else "force"
    remark = (
        f"the outer 5 % on each side ({nodes_percent:.2g} % of the nodes) carry"
        f" {force_percent:.3g} % of the {force}"
    )
    if is_tilted(topography):  # mirror images of a tilted map are tilted too
        return remark
    return f"{remark}: if this is a piece of a larger surface, --boundary mirror leaves no edges"
