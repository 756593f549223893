"""Contacts of one surface under one load or several: choose the loads and solve the contacts."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from gen.doubts import Pressed
from gen.maps.answers import Answer, AnswerOptions, answers
from gen.maps.prepare import is_tilted
from gen.maps.read import Topography
from gen.material import loads_from
from gen.quantities import AREA, DELTA, LOADS, QUANTITIES
from gen.runtime import memory
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress

if TYPE_CHECKING:
    from bem import Contact, Surface
    from gen.maps.limits import MapLimits


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
    prepared: Surface | None = None,
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
        Largest relative errors of answers, by their names in `bem.answers.ANSWERS` [1]. If they
        are given, the contact under each load is solved on the coarsest grid that gives them.
    prepared : bem.Surface, optional
        The surface from `prepared_surface` with the same settings, for contacts within errors; by
        default it is prepared here.
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
    grid = {"boundary": topography.boundary, "spacing": topography.exact_spacing}
    with _faults_of(topography):
        if len(values) > 1:
            _check_load(topography, load, max(values), settings | grid)
        if errors is None:
            contacts = _ladder(topography, load, values, settings | grid)
        else:
            prepared = prepared or prepared_surface(topography, **settings)
            contacts = _contacts_within(prepared, load, values, errors)
        yield from _solutions(contacts, load, values)


@contextmanager
def _faults_of(topography: Topography) -> Iterator[None]:
    """Turn ValueError and MemoryError of the solver into InputError with the name of a surface."""
    try:
        yield
    except ValueError as error:
        raise InputError(f"{topography.name}: {error}") from None
    except MemoryError:
        shortage = memory.too_little_for_solve(topography.heights.shape)
        raise InputError(f"{topography.name}: {shortage}") from None


def prepared_surface(topography: Topography, **settings: Any) -> Surface:
    """Prepare a surface once for contacts within errors under several loads.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    **settings : object
        Settings of `bem.Surface`, without those that the topography has.

    Returns
    -------
    bem.Surface
        The prepared surface.

    Raises
    ------
    InputError
        If a number is not allowed, or memory is too short.
    """
    import bem

    with _faults_of(topography):
        return bem.Surface(
            topography.heights,
            topography.sides,
            boundary=topography.boundary,
            spacing=topography.exact_spacing,
            **settings,
        )


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


def _ladder(
    topography: Topography,
    load: str,
    values: Sequence[float],
    settings: Mapping[str, Any],
) -> Iterator[Contact]:
    """Return the contacts under all loads on the grid of the surface, each solved when it is taken.

    Taking a contact raises the errors of `bem.ladder`. The contact under the next load can be taken
    after any of them.
    """
    import bem

    loads: dict[str, Any] = {f"{load}s": values}
    return bem.ladder(topography.heights, topography.sides, **loads, **settings)


def _contacts_within(
    surface: Surface, load: str, values: Sequence[float], errors: Mapping[str, float]
) -> Iterator[Contact]:
    """Return the contacts under all loads within errors, each solved when it is taken.

    Taking a contact raises the errors of `bem.Surface.solve_within`, and InputError if a linear
    solve for an answer does not converge. The contact under the next load can be taken after any of
    them.
    """
    import bem

    def solved_within(value: float) -> Contact:
        """Solve under a load on the coarsest grid that gives the errors."""
        one_load: dict[str, Any] = {load: value}
        try:
            return surface.solve_within(errors, **one_load)
        except (bem.NotReachable, bem.OutOfRange):
            raise
        except ArithmeticError as failure:  # a linear solve did not converge
            raise InputError(str(failure)) from None

    return map(solved_within, values)


def _solutions(
    contacts: Iterator[Contact], load: str, values: Sequence[float]
) -> Iterator[LoadSolution]:
    """Yield the solution under each load; raise ValueError at the last one if none is solved.

    `contacts` are solved when they are taken. A solution without a contact says why, and under
    which load if there are several.
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
    solutions: Iterator[LoadSolution],
    number: int,
    options: AnswerOptions,
    limits: MapLimits | None = None,
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
    limits : MapLimits, optional
        Limits of the map, which belong to errors that are asked for.

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
                rows.append(answers(solution.contact, options, limits))
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
