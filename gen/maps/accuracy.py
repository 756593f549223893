"""Errors that a user asks for, and the columns and words that say which ones a contact has.

`gen contact --error` and `gen law --error` solve each contact on the coarsest grid whose answers
have these errors, see `bem.accuracy`. Both write the same columns: the nodes of that grid and, for
each answer, its error with the parts of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from gen.quantities import CONTINUUM, QUANTITIES, Quantity
from gen.runtime.documents import Row
from gen.runtime.errors import InputError, input_errors
from gen.runtime.terminal import quoted

if TYPE_CHECKING:  # errors are parsed without the solver
    from bem.budget import Budget, ErrorParts

RELATIVE_ERROR = "_relative_error_"
"""Part of the names of columns with an error of an answer, or with a part of it."""

NODES_X = "solved_nodes_x"
NODES_Y = "solved_nodes_y"
"""Names of the columns with the numbers of nodes along x and y of the grid that was solved."""


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
        Largest relative errors, by the names of the answers in `bem.answers.ANSWERS` [1].

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
        is_percent = number.strip().endswith("%")
        try:
            value = float(number.strip().removesuffix("%"))
        except ValueError:
            raise InputError(
                f"{place}: give an error, as 3% or 0.03, or several as area=1%,mean_gap=2%"
            ) from None
        if name in errors:
            raise InputError(f"{place}: gives the error of {name} twice")
        errors[name] = value / 100 if is_percent else value
    with input_errors(place):
        return checked_errors(errors)


def quantity_of(name: str) -> Quantity:
    """Return the quantity that an error is about.

    Parameters
    ----------
    name : str
        Name of an answer in `bem.answers.ANSWERS`.

    Returns
    -------
    Quantity
        The quantity; for "area" the area in the continuum.
    """
    return CONTINUUM if name == "area" else QUANTITIES[name]


def parts_of(budget: Budget, errors: Mapping[str, float]) -> dict[str, ErrorParts]:
    """Return the parts of each error that was asked for.

    Parameters
    ----------
    budget : Budget
        Budget of a contact from `bem.solve_within`. Without a load it has no parts of errors, and
        all parts are 0.
    errors : mapping from str to float
        Largest relative errors, by the names of their answers [1].

    Returns
    -------
    dict of str to ErrorParts
        The parts by the names of the answers.
    """
    return {
        name: budget.errors.get(name, exact_parts(asked_error))
        for name, asked_error in errors.items()
    }


def exact_parts(asked_error: float) -> ErrorParts:
    """Return the error of an answer that is exact, as without a load.

    Parameters
    ----------
    asked_error : float
        The error that was asked for [1].

    Returns
    -------
    ErrorParts
        An error whose parts are 0.
    """
    from bem.budget import ErrorParts

    return ErrorParts(asked_error=asked_error, grid=0.0, waves=0.0, solver=0.0)


def columns_of_grid(nodes: tuple[int, int]) -> Row:
    """Return the cells with the numbers of nodes along x and y of the grid that was solved.

    Parameters
    ----------
    nodes : tuple of int
        Nodes (mx, my).

    Returns
    -------
    dict
        Two numbers, by the names of their columns.
    """
    return {NODES_X: nodes[0], NODES_Y: nodes[1]}


def columns_of_error(name: str, parts: ErrorParts) -> dict[str, float]:
    """Return the cells about an error: its size, the one that was asked for, and its parts.

    Parameters
    ----------
    name : str
        Name of the answer in `bem.answers.ANSWERS`.
    parts : ErrorParts
        The error of this answer.

    Returns
    -------
    dict
        Five numbers, by the names of their columns [%].
    """
    shares = {
        "": parts.total,
        "asked_": parts.asked_error,
        "from_grid_": parts.grid,
        "from_waves_": parts.waves,
        "from_solver_": parts.solver,
    }
    return {
        f"{name}{RELATIVE_ERROR}{part}percent": 100 * share
        for part, share in shares.items()
    }


def is_detail(column: str) -> bool:
    """Tell whether a column has an error that was asked for, or a part of the error that was got.

    Only files have these columns, see `gen.maps.answers.Answer.is_detail`.

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


def parts_in_words(parts: ErrorParts) -> str:
    """Write the error that was asked for, and the parts of the error that was got.

    Parameters
    ----------
    parts : ErrorParts
        The error of one answer.

    Returns
    -------
    str
        As "asked 3 %: grid 2.1 %, dropped waves 0.5 %, solver 0.3 %".
    """
    return (
        f"asked {percent(parts.asked_error)}: grid {percent(parts.grid)},"
        f" dropped waves {percent(parts.waves)}, solver {percent(parts.solver)}"
    )


def percent(share: float) -> str:
    """Write a share in percent with two digits; rounding errors become 0.

    Parameters
    ----------
    share : float
        The share [1].

    Returns
    -------
    str
        As "2.1 %".
    """
    return f"{round(100 * share, 4):.2g} %"
