"""Contacts of one surface under one load or several: solve them and read their answers."""

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
from gen.material import LAYER_COLUMNS, loads_from, require_within
from gen.quantities import (
    AREA,
    CONDUCTANCE,
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
from gen.runtime.errors import InputError, input_errors
from gen.runtime.terminal import RunProgress, quoted

if TYPE_CHECKING:
    from bem import Body, Contact
    from bem.budget import ErrorParts


@dataclass(frozen=True)
class AnswerOptions:
    """Options of `gen contact` that add answers to those that are always given.

    Each field but `errors` has the name of a `gen.quantities.Quantity.option`; an option that is
    set adds the answers about the quantities with this option.
    """

    # whether to estimate the area in the continuum and the error of the grid
    grid_error: bool = False
    spots: bool = False  # whether to count the spots of contact
    flow: bool = False  # whether to solve the flow through the gap along x and along y
    stiffness: bool = False  # whether to solve for the stiffness
    # thermal conductivities of the first and of the second body [W/(m K)], with which the
    # conductance is computed; None for no conductance
    conductivities: tuple[float, float] | None = None
    # Largest relative errors of answers, by their names in `bem.accuracy.ANSWERS` [1], for which
    # contacts are solved on the coarsest grid that gives them; None for the grid of the map.
    errors: Mapping[str, float] | None = None

    @property
    def names(self) -> list[str]:
        """Names of the options whose quantities are shown, "always" first, in their order."""
        chosen = [field.name for field in fields(self) if getattr(self, field.name)]
        return ["always", *chosen]


class Answer(NamedTuple):
    """A number or word about a contact: a line of a report, and a cell of a table."""

    column: str  # name of the column in tables
    value: float | int | str  # the answer, a number in `unit`; "" if it is not known
    label: str  # name for people
    unit: str  # unit for people, followed by a remark if the answer needs one; "" for neither
    # Error of the value, in `unit`. The text for people ends at the second digit of the error, or
    # has six digits if the error is 0 or infinite.
    error: float = 0.0
    is_detail: bool = False  # whether only files have it, because another line states it

    @property
    def shown(self) -> str:
        """The value as text for people, "-" if it is not known."""
        if not isinstance(self.value, float):
            return str(self.value) or "-"
        if not 0 < self.error < math.inf:
            return f"{self.value:.6g}"
        place_of_first_digit = math.floor(math.log10(self.error))
        decimals = max(1 - place_of_first_digit, 0)
        return f"{self.value:.{decimals}f}"


def require_conductivities(conductivities: Sequence[float]) -> tuple[float, float]:
    """Check the thermal conductivities of both bodies, and return one for each body.

    Parameters
    ----------
    conductivities : sequence of float
        Values of the option --conductivity, at least one: one for both bodies, or one for each
        [W/(m K)].

    Returns
    -------
    tuple of float
        Conductivities of the first and of the second body [W/(m K)].

    Raises
    ------
    InputError
        If there are more than two, or a value is outside the range of physical numbers.
    """
    if len(conductivities) > 2:
        raise InputError(
            f"--conductivity was given {len(conductivities)} times: give it once or twice"
        )
    for conductivity in conductivities:
        require_within("--conductivity", conductivity, "W/(m K)")
    return conductivities[0], conductivities[-1]


def answers(contact: Contact, options: AnswerOptions) -> list[Answer]:
    """List the answers about a solved contact.

    Some options need further solutions (as of linear systems, or of flow), which are computed here.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.
    options : AnswerOptions
        Answers besides those that are always given.

    Returns
    -------
    list of Answer
        One for each cell of a table: quantities by option, with E*, boundary and hardness after
        those that are always given, then the grid and the errors that were asked for, if any, and
        the residual last.

    Raises
    ------
    InputError
        If a linear solve, or the flow through the gap, does not converge.
    """
    media = Media(options.conductivities)
    answers_of_contact: list[Answer] = []
    try:
        for option in options.names:
            answers_of_contact += _answers_of_option(option, contact, media)
            if option == "always":
                answers_of_contact += _about_the_bodies(contact)
        if options.conductivities is not None:
            answers_of_contact.append(_conductance_per_area(contact, media))
        if options.errors is not None:
            answers_of_contact += _about_the_grid(contact)
            answers_of_contact += _about_the_errors(contact, options.errors)
    except ArithmeticError as error:
        raise InputError(str(error)) from None
    residual = Answer(
        column="residual",
        value=contact.residual,
        label="residual",
        unit="of Delta",
    )
    answers_of_contact.append(residual)
    return answers_of_contact


def _answers_of_option(option: str, contact: Contact, media: Media) -> list[Answer]:
    """Return the answers about all quantities with an option, as "always" or "spots".

    Quantities that need a hardness are left out if the bodies are elastic.
    """
    elastic = contact.problem.hardness is None
    answers_of_option: list[Answer] = []
    for quantity in QUANTITIES.values():
        if quantity.option != option:
            continue
        if quantity.needs_hardness and elastic:
            continue
        answers_of_option += _answers_of_quantity(quantity, contact, media)
    return answers_of_option


def _about_the_bodies(contact: Contact) -> list[Answer]:
    """Return the answers about E*, a layer, the boundary unless it is free, and the hardness."""
    problem = contact.problem
    modulus = Answer(
        column="modulus_MPa",
        value=problem.modulus,
        label="modulus E*",
        unit="MPa",
    )
    about_the_bodies = [modulus, *_about_the_layer(problem.body)]
    if problem.boundary != "free":
        boundary = Answer(
            column="boundary",
            value=problem.boundary,
            label="boundary",
            unit="",
        )
        about_the_bodies.append(boundary)
    if problem.hardness is not None:
        hardness = Answer(
            column="hardness_MPa",
            value=problem.hardness,
            label="hardness",
            unit="MPa",
        )
        about_the_bodies.append(hardness)
    return about_the_bodies


def _about_the_layer(body: Body) -> list[Answer]:
    """Return the answers about the layer of a body and about its base; none for half-spaces."""
    from bem.bodies import HalfSpace, Layered, Pair

    if isinstance(body, Pair):  # the layer is that of the first body
        body = body.first
    if not isinstance(body, Layered):
        return []
    values: dict[str, float | str] = {
        "layer_thickness_um": body.thickness,
        "layer_young_MPa": body.modulus,
        "layer_poisson": body.poisson,
        "base": "rigid",
    }
    if isinstance(body.base, HalfSpace):
        values |= {
            "base": "elastic",
            "base_young_MPa": body.base.modulus,
            "base_poisson": body.base.poisson,
        }
    return [
        Answer(column=column, value=value, label=label, unit=unit)
        for column, (label, unit) in LAYER_COLUMNS.items()
        if (value := values.get(column)) is not None
    ]


def _answers_of_quantity(
    quantity: Quantity, contact: Contact, media: Media
) -> list[Answer]:
    """Return the answer about a quantity as a list (of three for the area in the continuum)."""
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
    answer = Answer(
        column=quantity.in_tables,
        value=value,
        label=quantity.noun,
        unit=separator.join(words),
    )
    return [answer]


def _sides_in_words(code: int) -> str:
    """Return the axes whose opposite sides are connected, as "x and y", "x", "y" or "no".

    The code is a sum of the numbers of `gen.quantities.SIDES`.
    """
    axes = [axis for axis, side in zip("xy", SIDES, strict=True) if code & side]
    return " and ".join(axes) or "no"


def _about_the_continuum(contact: Contact, area: float) -> list[Answer]:
    """Return three answers: area in the continuum, its error, and whether the grid resolves it.

    `area` is the area in the continuum [%]. The error [%] is "" if the grid does not resolve it.
    """
    error = contact.grid_error()
    error_percent = error.area_percent
    known_error: float | str
    if error.verdicts["area"]:
        unit = f"+- {error_percent:.2g} %, in 9 of 10 cases"
        known_error = error_percent
        resolved = "yes"
    else:
        unit = "% on this grid"
        known_error = ""
        resolved = "no"
    return [
        Answer(
            column=CONTINUUM.in_tables,
            value=area,
            label=CONTINUUM.noun,
            unit=unit,
            error=error_percent,
        ),
        Answer(
            column=CONTINUUM_ERROR,
            value=known_error,
            label="its error",
            unit="%",
            error=error_percent,
        ),
        Answer(
            column="resolved",
            value=resolved,
            label="resolved by the grid",
            unit=error.reason,
        ),
    ]


def _about_the_grid(contact: Contact) -> list[Answer]:
    """Return two answers, the numbers of nodes along x and y of the grid that was solved."""
    return [
        Answer(
            column=f"solved_nodes_{axis}",
            value=nodes,
            label=f"nodes along {axis}",
            unit="",
        )
        for axis, nodes in zip("xy", contact.pressure.shape, strict=True)
    ]


def _about_the_errors(contact: Contact, errors: Mapping[str, float]) -> list[Answer]:
    """Return five answers for each error that was asked for.

    They are the error that was reached, the one that was asked for, and three parts of the first.

    Parameters
    ----------
    contact : bem.Contact
        A contact from `bem.solve_within`. Without a load it has no parts of errors: all are 0.
    errors : mapping from str to float
        The largest relative errors, by the names of their answers [1].
    """
    from bem.budget import ErrorParts

    assert contact.budget is not None  # `solve_within` sets it
    about_the_errors: list[Answer] = []
    for name, asked_error in errors.items():
        exact = ErrorParts(asked_error=asked_error, grid=0.0, waves=0.0, solver=0.0)
        parts = contact.budget.errors.get(name, exact)
        about_the_errors += _about_an_error(name, parts)
    return about_the_errors


def _about_an_error(name: str, parts: ErrorParts) -> list[Answer]:
    """Return five answers [%]: the error that was reached, the one asked for, and three parts.

    `name` is the name of the answer in `bem.accuracy.ANSWERS`. Only files have the last four,
    because the first one states them in its unit.
    """
    quantity = CONTINUUM if name == "area" else QUANTITIES[name]
    column = f"{name}{RELATIVE_ERROR}"
    error = 100 * parts.total
    remark = (
        f"% of it at 95 %, asked {_percent(parts.asked_error)}: grid {_percent(parts.grid)},"
        f" dropped waves {_percent(parts.waves)}, solver {_percent(parts.solver)}"
    )
    about_the_error = [
        Answer(
            column=f"{column}percent",
            value=error,
            label=f"error of {quantity.noun}",
            unit=remark,
            error=error,  # the error's own size, so that it is shown with two digits
        )
    ]
    details = {
        "asked": parts.asked_error,
        "from_grid": parts.grid,
        "from_waves": parts.waves,
        "from_solver": parts.solver,
    }
    for detail, share in details.items():
        answer = Answer(
            column=f"{column}{detail}_percent",
            value=100 * share,
            label=detail.replace("_", " "),
            unit="%",
            is_detail=True,
        )
        about_the_error.append(answer)
    return about_the_error


def _percent(share: float) -> str:
    """Write a share [1] with two digits in percent; rounding errors become 0."""
    return f"{round(100 * share, 4):.2g} %"


def _remark(quantity: Quantity, contact: Contact) -> str:
    """Return the remark for people that follows the unit of a quantity, "" for none."""
    nx, ny = contact.pressure.shape
    cell = math.prod(contact.problem.spacing)  # area of the cell of a node [um2]
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
    """Return a remark on the stiffness of the interface, "" for none.

    It says that the interface is closed, or that a constriction is left out.
    """
    if contact.interface_stiffness == math.inf:
        return "full contact, in which nothing but the bodies is left"
    if contact.problem.boundary == "free":
        return "without the patch's own constriction"
    return ""


def _conductance_per_area(contact: Contact, media: Media) -> Answer:
    """Return the answer about the interface's conductance per nominal area [W/(m2 K)]."""
    value = 1e12 * CONDUCTANCE.of(contact, media) / nominal_area(contact)  # um2 to m2
    unit = "W/(m2 K)"
    remark = _about_the_interface(contact)
    if remark:
        unit += f", {remark}"
    return Answer(
        column="interface_conductance_W_per_m2_K",
        value=value,
        label="per nominal area",
        unit=unit,
    )


CONTINUUM_ERROR = f"{CONTINUUM.name.removesuffix('_percent')}_error_percent"
"""Name of the column that holds the error of the area in the continuum."""

RELATIVE_ERROR = "_relative_error_"
"""Part of the names of columns with the errors that a user asked for and with their parts."""

# share of the lines of nodes on each side of a patch that `border_remark` counts as border
OUTER = 0.05


def load_in_words(load: str, value: float) -> str:
    """Write a load with its unit.

    Parameters
    ----------
    load : {"delta", "force", "pressure"}
        Quantity of the load.
    value : float
        Value of this quantity [um, uN or MPa].

    Returns
    -------
    str
        "Delta = 2 um", "2 uN" or "2 MPa".
    """
    text = f"{value:.6g} {LOADS[load].unit}"
    return f"Delta = {text}" if load == "delta" else text


def is_detail(column: str) -> bool:
    """Tell whether a column has an error that was asked for, or a part of the error that was got.

    Only files have these columns, see `Answer.is_detail`.

    Parameters
    ----------
    column : str
        Name of a column of answers.

    Returns
    -------
    bool
        True if it has one.
    """
    _, separator, ending = column.partition(RELATIVE_ERROR)
    return bool(separator) and ending != "percent"


class ChosenLoad(NamedTuple):
    """The load that a user chose by one of the options --delta, --force and --pressure."""

    name: str  # "delta", "force" or "pressure"
    values: list[float]  # one load or more, in the order given [um, uN or MPa]


def chosen_load(texts: Mapping[str, str]) -> ChosenLoad:
    """Return the loads that the user gave by one of the options --delta, --force and --pressure.

    Parameters
    ----------
    texts : mapping from str to str
        Text of each option by the keys "delta", "force" and "pressure"; "" for an option that is
        left out.

    Returns
    -------
    ChosenLoad
        Name and values of the loads.

    Raises
    ------
    InputError
        If not exactly one option has a text, or the text is no number, list or series of loads.
    """
    names = [name for name in LOADS if texts[name]]
    if len(names) != 1:
        options = " and ".join(f"--{name}" for name in names) or "no load"
        raise InputError(f"{options} given: give one of --delta, --force and --pressure")
    [name] = names
    advice = "give a number, several as 1,2,5, or start:stop:count[:log]"
    return ChosenLoad(name=name, values=loads_from(name, texts[name], advice))


def errors_from(text: str) -> dict[str, float]:
    """Return the errors that the user gave by the option --error.

    Parameters
    ----------
    text : str
        An error of the area in the continuum, as "3%" or "0.03", or errors of answers by name with
        commas between them, as "area=1%,mean_gap=2%".

    Returns
    -------
    dict from str to float
        Largest relative errors, by the names of the answers in `bem.accuracy.ANSWERS` [1].

    Raises
    ------
    InputError
        If a part of the text is no error, a name is unknown or is given twice, or an error is not
        above 0 and below 1.
    """
    from bem.accuracy import checked_errors

    place = f"--error {quoted(text)}"
    errors: dict[str, float] = {}
    for part in text.split(","):
        before, separator, number = part.rpartition("=")
        name = before.strip() if separator else "area"
        if name in errors:
            raise InputError(f"{place}: gives the error of {name} twice")
        is_percent = number.strip().endswith("%")
        try:
            value = float(number.strip().removesuffix("%"))
        except ValueError:
            raise InputError(
                f"{place}: give an error, as 3% or 0.03, or several as area=1%,mean_gap=2%"
            ) from None
        errors[name] = value / 100 if is_percent else value
    with input_errors(place):
        return checked_errors(errors)


@dataclass(frozen=True, eq=False)
class LoadSolution:
    """The contact under one load, or the reason why it was not solved."""

    # the solved contact; None if the solver did not converge, or no grid gives the errors
    contact: Contact | None
    fault: str = ""  # reason why there is no contact; "" if there is one


def solve_loads(
    topography: Topography,
    load: str,
    values: Sequence[float],
    *,
    errors: Mapping[str, float] | None = None,
    **settings: Any,
) -> Iterator[LoadSolution]:
    """Solve the contact of a surface with a plane under one load after another.

    If there are several loads, the largest one is checked before the first one is solved. If the
    solver does not converge under one load, or no grid gives the errors that are asked for, the
    others are still solved.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    load : {"delta", "force", "pressure"}
        Quantity of the loads.
    values : sequence of float
        One load or more, in any order [um, uN or MPa].
    errors : mapping from str to float, optional
        Largest relative errors of answers, by their names in `bem.accuracy.ANSWERS` [1]. If they
        are given, the contact under each load is solved on the coarsest grid that gives them.
    **settings : object
        Further settings of `bem.ladder`, as modulus [MPa] and hardness [MPa]; with `errors` those
        of `bem.Surface`.

    Yields
    ------
    LoadSolution
        The contact under each load, or why it was not solved, in the order of `values`.

    Raises
    ------
    InputError
        If a number is not allowed, there is no equilibrium, or memory is too short; at the last
        load, if no load was solved.
    """
    settings |= {"boundary": topography.boundary, "spacing": topography.exact_spacing}
    try:
        if len(values) > 1:
            _check_load(topography, load, max(values), settings)
        contacts = _contacts(topography, load, values, errors, settings)
        yield from _solutions(contacts, load, values)
    except ValueError as error:
        raise InputError(f"{topography.name}: {error}") from None
    except MemoryError:
        shortage = memory.too_little_for_solve(topography.heights.shape)
        raise InputError(f"{topography.name}: {shortage}") from None


def _check_load(
    topography: Topography, load: str, value: float, settings: Mapping[str, Any]
) -> None:
    """Raise ValueError if a load [um, uN or MPa] is not allowed or has no equilibrium.

    Nothing is solved.
    """
    from bem.problem import pose

    # `pose` has no default for delta.
    loads: dict[str, Any] = {"delta": None, load: value}
    pose(topography.heights, topography.sides, **loads, **settings)


def _contacts(
    topography: Topography,
    load: str,
    values: Sequence[float],
    errors: Mapping[str, float] | None,
    settings: Mapping[str, Any],
) -> Iterator[Contact]:
    """Return the contacts under all loads, each solved when it is taken.

    The parameters are those of `solve_loads`. Taking a contact raises the errors of `bem.ladder`,
    or with `errors` those of `bem.Surface.solve_within`, and InputError if a linear solve for an
    answer does not converge. The contact under the next load can be taken after any of them.
    """
    import bem

    heights = topography.heights
    sides = topography.sides
    if errors is None:
        loads: dict[str, Any] = {f"{load}s": values}
        return bem.ladder(heights, sides, **loads, **settings)

    surface = bem.Surface(heights, sides, **settings)

    def solved_within(value: float) -> Contact:
        """Solve under a load on the coarsest grid that gives the errors."""
        one_load: dict[str, Any] = {load: value}
        try:
            return surface.solve_within(errors, **one_load)
        except (bem.NotReachable, bem.OutOfRange):
            raise
        except (
            ArithmeticError
        ) as failure:  # a linear solve for an answer does not converge
            raise InputError(str(failure)) from None

    return map(solved_within, values)


def _solutions(
    contacts: Iterator[Contact], load: str, values: Sequence[float]
) -> Iterator[LoadSolution]:
    """Yield the solution under each load; raise ValueError at the last one if none is solved.

    `contacts` are those of `_contacts`. A solution without a contact says why, and under which load
    if there are several.
    """
    import bem

    solved = False
    for value in values:
        try:
            solution = LoadSolution(contact=next(contacts))
            solved = True
        except (bem.NotConverged, bem.NotReachable) as error:
            fault = str(error)
            if len(values) > 1:
                fault = f"{load_in_words(load, value)}: {fault}"
            if not solved and value == values[-1]:
                raise ValueError(fault) from None
            solution = LoadSolution(contact=None, fault=fault)
        yield solution


@dataclass(frozen=True, eq=False)
class SolvedLoads:
    """The answers about one surface under all loads, and the last contact."""

    rows: list[list[Answer]]  # for each contact that was solved, the answers about it
    last: Contact  # contact under the last load under which one was solved
    faults: list[str]  # one line for each load under which none was solved
    seconds: float  # time of the solution under the last load, solved or not [s]


def solve_all(
    solutions: Iterator[LoadSolution], number: int, options: AnswerOptions
) -> SolvedLoads:
    """Advance an iterator of solutions to its end, and keep the answers and the last contact.

    The progress is shown on the terminal if there are several loads.

    Parameters
    ----------
    solutions : iterator of LoadSolution
        Result of `solve_loads`, which solves under a load when it is advanced.
    number : int
        Number of loads.
    options : AnswerOptions
        Answers besides those that are always given.

    Returns
    -------
    SolvedLoads
        Answers, last contact, faults and time.

    Raises
    ------
    InputError
        As `solve_loads` and `answers` do.
    """
    rows: list[list[Answer]] = []
    faults: list[str] = []
    last: Contact | None = None
    seconds = 0.0
    # RunProgress prints nothing before a load is done: the loads may be refused before that.
    context: AbstractContextManager[RunProgress | None] = nullcontext()
    if number > 1:
        context = RunProgress(number, "loads")
    with context as progress:
        for _ in range(number):
            start = time.perf_counter()
            solution = next(solutions)
            seconds = time.perf_counter() - start
            failed = 0
            if solution.contact is None:
                failed = 1
                faults.append(f"not solved, left out: {solution.fault}")
            else:
                rows.append(answers(solution.contact, options))
                last = solution.contact
            if progress is not None:
                progress.advance(rows=1, failed=failed)
    assert last is not None  # `solve_loads` raises at the last load if none is solved
    return SolvedLoads(rows=rows, last=last, faults=faults, seconds=seconds)


def pressed_contacts(rows: Sequence[Mapping[str, Any]]) -> list[Pressed]:
    """Return the numbers of solved contacts that `gen.doubts.contact_doubts` needs.

    Parameters
    ----------
    rows : sequence of mapping
        A row for each contact: the values of its answers by column.

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
            is_full=row[AREA.in_tables] == 100,
        )
        for row in rows
    ]


def border_remark(topography: Topography, contact: Contact, loads: int) -> str:
    """Write the share of the force that the borders of a free patch carry.

    The borders are the outer lines of nodes, `OUTER` of all lines on each side. The remark advises
    a mirror boundary unless the map is tilted.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    contact : bem.Contact
        Contact of this surface under the last load.
    loads : int
        Number of loads.

    Returns
    -------
    str
        One line; "" for a patch without edges, with fewer nodes than a border needs, or without
        contact.
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
    if is_tilted(topography):  # Mirroring would make a ridge of its higher border.
        return remark
    return f"{remark}: if this is a piece of a larger surface, --boundary mirror leaves no edges"
