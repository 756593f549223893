"""Errors that a law is asked for: the bands, columns and notes about them.

With --error each contact of a law is solved on the coarsest grid of its surface that gives the
answers within these errors (`bem.accuracy`), and has a budget of its own. Columns about several
surfaces have the largest error of the surfaces, and notes the largest error over all loads.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gen.arrays import Values
from gen.law.curves import Curves, Points
from gen.law.lines import Deviation
from gen.law.order import Load
from gen.maps.accuracy import (
    NODES_X,
    NODES_Y,
    RELATIVE_ERROR,
    columns_of_error,
    columns_of_grid,
    exact_parts,
    is_detail,
    parts_in_words,
    parts_of,
    percent,
    quantity_of,
)
from gen.maps.limits import MapLimits
from gen.quantities import (
    CLOSURE,
    CONDUCTANCE,
    DELTA,
    IN_LAWS,
    LOADS,
    PRESSURE,
    STIFFNESS,
    Quantity,
)
from gen.runtime.documents import Row

if TYPE_CHECKING:
    from bem.budget import Budget, ErrorParts

Errors = Mapping[str, float]
"""Largest relative errors that were asked for, by the names of their answers [1]."""


def with_bands(points: Points, errors: Errors, load: Load) -> Points:
    """Give the quantities of one surface bands as wide as their errors.

    Parameters
    ----------
    points : Points
        Points with budgets, under k loads.
    errors : mapping
        Errors that were asked for.
    load : {"delta", "pressure"}
        Kind of the loads, which are exact.

    Returns
    -------
    Points
        Points with the intervals of these errors in place of any others.
    """
    low: dict[str, Values] = {}
    high: dict[str, Values] = {}
    for quantity, half_width in _half_widths(points, errors, load).items():
        value = points.values[quantity]
        low[quantity] = np.clip(value - half_width, *IN_LAWS[quantity].bounds)
        high[quantity] = np.clip(value + half_width, *IN_LAWS[quantity].bounds)
    return replace(points, low=low, high=high)


def _half_widths(points: Points, errors: Errors, load: Load) -> dict[str, Values]:
    """Return the half-widths of bands by the names of quantities in laws, each (k,).

    Closure and stiffness are those of the interface, without the half-space behind a free patch.
    Delta and the whole stiffness, of which errors are known, include the half-space. The relative
    errors of closure and stiffness are therefore larger than theirs.
    """
    values = points.values
    relative_errors = {LOADS[load].in_laws: np.zeros(values[DELTA.in_laws].size)}
    for name in errors:
        for quantity in _quantities_of(name):
            relative_errors[quantity.in_laws] = _relative_errors(points, name)
    half_widths = {
        column: errors_of_loads * np.abs(values[column])
        for column, errors_of_loads in relative_errors.items()
        if column in values and errors_of_loads.any()
    }
    # Displacement of the half-space behind a free patch [um].
    of_half_space = values[DELTA.in_laws] - values[CLOSURE.in_laws]
    if STIFFNESS.in_laws in half_widths:
        with np.errstate(divide="ignore", invalid="ignore"):  # without a load
            compliance = np.nan_to_num(of_half_space / values[PRESSURE.in_laws])
        half_widths[STIFFNESS.in_laws] *= 1 + compliance * values[STIFFNESS.in_laws]
    if DELTA.in_laws in relative_errors and PRESSURE.in_laws in relative_errors:
        half_widths[CLOSURE.in_laws] = (
            relative_errors[DELTA.in_laws] * values[DELTA.in_laws]
            + relative_errors[PRESSURE.in_laws] * of_half_space
        )
    return half_widths


def quantity_in_law(name: str) -> Quantity:
    """Return the quantity of laws that an error is about.

    Parameters
    ----------
    name : str
        Name of an answer in `bem.answers.ANSWERS`.

    Returns
    -------
    Quantity
        The quantity; for "stiffness" that of the interface.
    """
    return STIFFNESS if name == "stiffness" else quantity_of(name)


def _quantities_of(name: str) -> tuple[Quantity, ...]:
    """Return the quantities of laws that have the relative error of an answer."""
    quantity = quantity_in_law(name)
    match name:
        case "stiffness":
            return quantity, CONDUCTANCE
        case "force":
            return quantity, PRESSURE
    return (quantity,)


def _relative_errors(points: Points, name: str) -> Values:
    """Return the relative errors of an answer, (k,) [1]; 0 without a contact."""
    totals = [
        budget.errors[name].total if budget and budget.errors else 0.0
        for budget in points.budgets
    ]
    return np.array(totals)


def band_of_one_surface(errors: Errors) -> str:
    """Describe the band of one surface.

    Parameters
    ----------
    errors : mapping
        Errors that were asked for.

    Returns
    -------
    str
        Part of a line, without a full stop.
    """
    return f"the error, 19 times in 20, of the {_nouns(errors)}; one surface"


def _nouns(errors: Errors) -> str:
    """Return the names of answers for people, as "area in the continuum and Delta"."""
    *nouns, last = [quantity_of(name).noun for name in errors]
    if not nouns:
        return last
    return f"{', '.join(nouns)} and {last}"


def worst_parts(budgets: Sequence[Budget], errors: Errors) -> dict[str, ErrorParts]:
    """Return the largest error of each answer over some contacts.

    Parameters
    ----------
    budgets : sequence of Budget
        Budgets of the contacts; without any the errors are 0.
    errors : mapping
        Errors that were asked for.

    Returns
    -------
    dict of str to ErrorParts
        The largest errors by the names of the answers.
    """
    parts_of_budgets = [parts_of(budget, errors) for budget in budgets]
    return {
        name: max(
            (parts[name] for parts in parts_of_budgets),
            key=lambda parts: parts.total,
            default=exact_parts(asked_error),
        )
        for name, asked_error in errors.items()
    }


def cells(table: Curves, place: int, errors: Errors, surfaces: int) -> Row:
    """Return the cells about the errors at one argument of a table.

    Parameters
    ----------
    table : Curves
        Table of a law.
    place : int
        Index of the argument.
    errors : mapping
        Errors that were asked for.
    surfaces : int
        Number of surfaces of the law.

    Returns
    -------
    dict
        Nodes of the grid that was solved, and each error with its parts [%], by the columns of
        `gen.maps.accuracy`. Of several surfaces they are the coarsest grid and the largest errors,
        and each surface has columns of its own. All are "" at first touch.
    """
    budgets: tuple[Budget, ...] = ()  # of each surface
    if table.budgets:  # a table of first touch alone has none
        budgets = table.budgets[place]
    row = _cells(budgets, errors)
    if surfaces > 1:
        for number in range(1, surfaces + 1):
            of_surface = _cells(budgets[number - 1 : number], errors)
            row |= {
                f"{column}_surface_{number}": cell
                for column, cell in of_surface.items()
                if not is_detail(column)
            }
    return row


def _cells(budgets: Sequence[Budget], errors: Errors) -> Row:
    """Return the cells about contacts of some surfaces under one load, "" without a contact."""
    nodes = min((budget.nodes for budget in budgets), key=math.prod, default=(0, 0))
    row = columns_of_grid(nodes)
    for name, parts in worst_parts(budgets, errors).items():
        row |= columns_of_error(name, parts)
    return row if budgets else dict.fromkeys(row, "")


def shown_cells(row: Row) -> list[str]:
    """Return the grid and the errors of a row of `cells` as text for people.

    Parameters
    ----------
    row : dict
        Cells about the errors at one argument.

    Returns
    -------
    list of str
        Nodes as "64 x 64", then the errors with two digits, in the order of `shown_columns`; "-"
        at first touch.
    """
    if row[NODES_X] == "":
        return ["-" for _ in shown_columns(row)]
    errors = [f"{row[column]:.2g}" for column in shown_columns(row)[1:]]
    return [f"{row[NODES_X]} x {row[NODES_Y]}", *errors]


def shown_columns(row: Row) -> list[str]:
    """Return the titles of the columns of `shown_cells`.

    Parameters
    ----------
    row : dict
        Cells about the errors at one argument.

    Returns
    -------
    list of str
        "nodes", then the names of the columns of errors.
    """
    ending = f"{RELATIVE_ERROR}percent"
    return ["nodes", *(column for column in row if column.endswith(ending))]


def notes(
    tables: Sequence[Curves], errors: Errors, loads: Sequence[Load]
) -> Iterator[str]:
    """Yield lines on the errors that were asked for, those of the contacts, and their grids.

    Parameters
    ----------
    tables : sequence of Curves
        Tables of a law, with at least one load.
    errors : mapping
        Errors that were asked for.
    loads : sequence of {"delta", "pressure"}
        Kinds of the loads that the user gave.

    Yields
    ------
    str
        A line for each error, then one about the grids and one about all other quantities.
    """
    from bem.answers import ANSWERS

    budgets = _budgets(tables)
    for name, parts in worst_parts(budgets, errors).items():
        yield (
            f"{quantity_of(name).noun} within {percent(parts.total)} at 95 %, at each load by"
            f" itself; {parts_in_words(parts)}"
        )
    yield _grids_in_words(budgets)
    known = {*errors}  # answers whose errors were asked for, or are 0
    if "delta" not in loads:
        known.add("force")  # pressures are given
    if "pressure" not in loads:
        known.add("delta")
    unknown = [_with_followers(name) for name in ANSWERS if name not in known]
    if unknown:
        yield f"no error was asked for of {', '.join(unknown)}"


def _with_followers(name: str) -> str:
    """Return the name of an answer, with the quantity of a law that follows from it if any."""
    match name:
        case "delta":
            return f"{name} (the closure)"
        case "stiffness":
            return f"{name} (the conductance)"
    return name


def _grids_in_words(budgets: Sequence[Budget]) -> str:
    """Return the nodes of the coarsest and of the finest solved grid, and of the largest map."""
    # Without a load nothing is solved.
    grids = [budget.nodes for budget in budgets if budget.trials]
    coarsest = _size(min(grids, key=math.prod, default=(0, 0)))
    finest = _size(max(grids, key=math.prod, default=(0, 0)))
    text = f"solved on {coarsest} to {finest} nodes"
    if coarsest == finest:
        text = f"solved on {finest} nodes"
    largest_map = max((budget.map_nodes for budget in budgets), key=math.prod)
    return f"{text}, where the largest map has {_size(largest_map)}"


def note_on_contacts_between(tables: Sequence[Curves], errors: Errors) -> str:
    """Say which errors the contacts between the loads of a law have.

    Parameters
    ----------
    tables : sequence of Curves
        Tables of these contacts.
    errors : mapping
        Errors that were asked for.

    Returns
    -------
    str
        One line; "" without contacts.
    """
    budgets = _budgets(tables)
    if not budgets:
        return ""
    worst = [
        f"{quantity_of(name).noun} within {percent(parts.total)}"
        for name, parts in worst_parts(budgets, errors).items()
    ]
    return f"contacts between the loads: {', '.join(worst)} at 95 %"


def _budgets(tables: Sequence[Curves]) -> list[Budget]:
    """Return the budgets of all contacts of some tables."""
    return [budget for table in tables for budgets in table.budgets for budget in budgets]


def _size(nodes: tuple[int, int]) -> str:
    """Return the nodes of a grid as text, as "64 x 64"."""
    return f"{nodes[0]} x {nodes[1]}"


def deviations_with_errors(
    tables: Sequence[Curves | None],
    errors: Errors,
    deviations: Mapping[str, Deviation],
) -> str:
    """Add the errors of the points of a law to the distances of its curves, and say the sums.

    Parameters
    ----------
    tables : sequence of Curves or None
        Tables of the points, and of the contacts between them if there are any.
    errors : mapping
        Errors that were asked for.
    deviations : mapping
        Largest distances of the curves from contacts, by the names of columns or functions.

    Returns
    -------
    str
        A sentence with a blank before it; "" if no error was asked for of any of the curves.
    """
    errors_of_functions: dict[str, float] = {}
    budgets = _budgets([table for table in tables if table is not None])
    for answer, parts in worst_parts(budgets, errors).items():
        # A curve of the pressure over the closure has the error of the closure instead.
        if answer == "force":
            continue
        for quantity in _quantities_of(answer):
            assert quantity.law is not None  # as of all quantities of laws
            errors_of_functions[quantity.law.short] = parts.total
    texts: list[str] = []
    for name, deviation in deviations.items():
        error = errors_of_functions.get(name.removesuffix("_at_pressure"))
        distance = float(np.fmax(deviation.inside, deviation.outside))
        if error is not None and distance >= 0:
            texts.append(f"{name} {percent(error + distance)}")
    if not texts:
        return ""
    return f" With the errors of the contacts, at 95 %, these are at most: {', '.join(texts)}."


def limits_in_words(limits: Sequence[MapLimits]) -> str:
    """Write the limits of the maps of a law in a line.

    Parameters
    ----------
    limits : sequence of MapLimits
        Limits of each map.

    Returns
    -------
    str
        One line; for several maps it has the worst of each limit.
    """
    if len(limits) == 1:
        return f"limits of the map: {limits[0].text}"
    return f"limits of {len(limits)} maps, the worst of each: {worst_limits(limits).text}"


def worst_limits(limits: Sequence[MapLimits]) -> MapLimits:
    """Return the worst limits of several maps.

    Parameters
    ----------
    limits : sequence of MapLimits
        Limits of each map, one or more.

    Returns
    -------
    MapLimits
        The fewest nodes in the shortest wave, and the largest lengths of the instruments.
    """
    return functools.reduce(MapLimits.or_worse, limits)
