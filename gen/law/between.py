"""Contacts between the loads of a law, for tables whose points are joined by programs.

A law bends most towards full contact, where the conductance diverges, and on a grid the conductance
of one surface is a staircase: it jumps where asperities touch or merge. So contacts are solved
between the loads of the law, first until the curve through them foresees the next ones, and then
where straight lines of a table with little room may be far from the conductance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.law.curves import (
    Curve,
    Curves,
    entries_at,
    risen,
    slopes,
    without_reversals,
)
from gen.law.lines import LEVEL, Column, curve_through
from gen.quantities import AREA, CLOSURE, PRESSURE

if TYPE_CHECKING:
    from bem.budget import Budget

Solve = Callable[[Values], Curves]
"""Solver of contacts at ascending loads, (m,) [um or MPa]. It returns the table of the contacts
that were solved, which may be fewer, or none."""

ENOUGH = 30
"""Fewest nodes in contact where points are laid closely: with fewer, each node is a step."""

MOST_AREA = 90.0
"""Largest share of the nodes in contact where points are laid closely [%]."""

FORESEEN = 0.01
"""Largest relative distance of a solved contact from the curve at which it is foreseen. No contacts
are solved beside a foreseen one."""

ROUNDS = 5
"""Largest number of times that an interval between two loads is halved."""

LINE_ROUNDS = 2
"""Largest number of times that an interval is halved before contacts for straight lines are
solved."""

NEAR = 1.5
"""Ratio of the middle to the lower load above which an interval is halved even if its middle is
foreseen."""

CALCULIX_POINTS = 20
"""Number of points that a table has room for in CalculiX."""

POSSIBLE = 0.05
"""Largest relative distance that lines may have from the conductance between two contacts before a
further contact is solved between them."""

IMPROVEMENTS = 6
"""Largest number of rounds in which lines are laid, and contacts solved where they may be off."""

MOST_CONTACTS = 500
"""Number of contacts between the loads of a law at which the improvement of lines ends."""

CLOSEST = 1.003
"""Ratio of neighbouring loads below which a jump of the conductance is not resolved further."""

CHECKS = 20
"""Largest number of checks of a table: contacts with which its lines are compared, and which had no
part in laying them."""

CHECK_AT = (5**0.5 - 1) / 2
"""Place of a check in the interval between two loads, as a share of the interval on a logarithmic
scale. It is the golden section, so that no halving has solved a contact there."""


def in_range(curves: Curves, nodes: int) -> NDArray[np.bool_]:
    """Find where the lines of a law have to follow it closely.

    Parameters
    ----------
    curves : Curves
        Table of the law, with the area, (k,).
    nodes : int
        Number of nodes of its smallest surface.

    Returns
    -------
    ndarray of bool, shape (k,)
        True where at least `ENOUGH` nodes and at most `MOST_AREA` per cent touch.
    """
    return _touching(curves, nodes, enough=ENOUGH, most_area=MOST_AREA)


def _touching(
    curves: Curves, nodes: int, enough: float, most_area: float
) -> NDArray[np.bool_]:
    """Return True where at least `enough` nodes and at most `most_area` per cent touch, (k,)."""
    area = curves.curves[AREA.in_laws].value  # in percent
    touching = area * curves.fewest_nodes(nodes)  # in hundredths of a node
    return np.asarray((touching >= 100 * enough) & (area <= most_area))


def solve_between(
    table: Curves, nodes: int, solve: Solve, rounds: int = ROUNDS
) -> Curves | None:
    """Solve contacts between the loads of a table until they are foreseen.

    Parameters
    ----------
    table : Curves
        Table of a law, against Delta or pressure, (k,).
    nodes : int
        Number of nodes of its smallest surface.
    solve : callable
        Solver of further contacts, see `Solve`.
    rounds : int
        Largest number of times that an interval is halved; 1 solves one contact in each.

    Returns
    -------
    Curves or None
        The further contacts; None without any.
    """
    solved = _usable(table)
    low = solved.at[:-1]
    high = solved.at[1:]
    between: Curves | None = None
    for _ in range(rounds):
        if not low.size:
            break
        middles = np.sqrt(low * high)
        contacts = solve(middles)
        if not contacts.at.size:
            break
        # A wider range than `in_range`, so that the intervals at its ends are foreseen too.
        near = _touching(
            contacts, nodes, enough=ENOUGH / 2, most_area=(MOST_AREA + 100) / 2
        )
        unforeseen = contacts.at[near & (_missed(solved, contacts) > FORESEEN)]
        solved = merged(solved, contacts)
        between = contacts if between is None else merged(between, contacts)
        was_solved = np.isin(middles, contacts.at)
        wide = middles > NEAR * low
        halved = was_solved & (wide | np.isin(middles, unforeseen))
        low, high = _halves(low[halved], middles[halved], high[halved])
    return between


def _halves(low: Values, middles: Values, high: Values) -> tuple[Values, Values]:
    """Return the lower and the upper ends of both halves of k intervals, (2 k,) each, ascending."""
    lower = np.append(low, middles)
    upper = np.append(middles, high)
    return np.sort(lower), np.sort(upper)


def solve_for_lines(table: Curves, nodes: int, solve: Solve) -> Curves | None:
    """Solve contacts between the loads of a table whose points are joined by straight lines.

    Between two contacts the conductance is between its values at both. So the two values bound how
    far lines of `CALCULIX_POINTS` points are off. Where the bound exceeds `POSSIBLE`, a contact is
    solved in the middle, and new lines are laid. A table without a conductance is solved by
    `solve_between` alone.

    Parameters
    ----------
    table : Curves
        Table of a law against pressure, (k,).
    nodes : int
        Number of nodes of its smallest surface.
    solve : callable
        Solver of further contacts, see `Solve`.

    Returns
    -------
    Curves or None
        The further contacts; None without any.
    """
    if not table.conductance_name:
        return solve_between(table, nodes, solve)
    between = solve_between(table, nodes, solve, rounds=LINE_ROUNDS)
    if between is None:
        return None  # the table has fewer than two usable loads, or no contact was solved
    for _ in range(IMPROVEMENTS):
        solved = merged(_usable(table), between)
        middles = _doubtful(solved, np.isin(solved.at, table.at), nodes)
        contacts_left = max(MOST_CONTACTS - between.at.size, 0)
        middles = np.sort(middles[:contacts_left])
        if not middles.size:
            break
        contacts = solve(middles)
        if not contacts.at.size:
            break
        between = merged(between, contacts)
    return between


def _doubtful(solved: Curves, at_loads: NDArray[np.bool_], nodes: int) -> Values:
    """Return the middles of intervals between contacts in which lines may be too far off [MPa].

    The interval with the largest possible distance comes first. `at_loads` is True at the contacts
    at loads of the law, (k,).
    """
    pressures = solved.at
    conductances = solved.curves[solved.conductance_name].value
    close = in_range(solved, nodes)
    at_rest = solved.at_rest.get(solved.conductance_name, 0.0)
    # First touch, at a pressure of 0, comes before the contacts.
    column = Column.through(
        at=np.append(0.0, pressures),
        values=np.append(at_rest, conductances),
        at_loads=np.append(True, at_loads),
        inside=np.append(False, close),
        power_law=True,
    )
    line = column.laid(CALCULIX_POINTS)
    line_values = np.interp(pressures, line.at, line.values)
    # Values at both ends of each interval, (2, k - 1).
    ends = np.stack([conductances[:-1], conductances[1:]])
    line_ends = np.stack([line_values[:-1], line_values[1:]])
    with np.errstate(divide="ignore", invalid="ignore"):  # conductances may be 0
        above = line_ends.max(axis=0) / ends.min(axis=0) - 1
        below = 1 - line_ends.min(axis=0) / ends.max(axis=0)
    possible = np.fmax(above, below)
    close_at_an_end = close[:-1] | close[1:]
    wide = pressures[1:] > CLOSEST * pressures[:-1]
    doubtful = close_at_an_end & wide & (possible > POSSIBLE)
    middles = np.sqrt(pressures[:-1] * pressures[1:])[doubtful]
    furthest_first = np.argsort(-possible[doubtful], kind="stable")
    return np.asarray(middles[furthest_first])


def check_loads(table: Curves) -> Values:
    """Choose loads at which the lines of a table are compared with contacts.

    Parameters
    ----------
    table : Curves
        Table of a law, against Delta or pressure, (k,).

    Returns
    -------
    ndarray, shape (m,)
        At most `CHECKS` loads between loads of the table [um or MPa]. None if fewer than two loads
        of the table are above 0 and inside a surrogate's training.
    """
    at = _usable(table).at
    if at.size < 2:
        return np.empty(0)
    between = at[:-1] * (at[1:] / at[:-1]) ** CHECK_AT
    places = np.linspace(0, between.size - 1, CHECKS).round().astype(int)
    return np.asarray(between[np.unique(places)])


def _usable(table: Curves) -> Curves:
    """Return a table without first touch and without loads outside a surrogate's training."""
    return table.chosen((table.at > 0) & ~table.flagged)


def _missed(solved: Curves, contacts: Curves) -> Values:
    """Return the relative distances of contacts from the curves through a table, (m,).

    Each contact has two distances: from the curve of the pressure over the closure and, if the
    table has a conductance, from its curve over the pressure. The larger one is returned. All are 0
    for a table over Delta, whose intervals are halved by width alone.
    """
    missed = np.zeros(contacts.at.size)
    if solved.against != PRESSURE.in_laws:
        return missed
    closures = solved.curves[CLOSURE.in_laws].value
    kept = risen(closures, LEVEL)
    if np.count_nonzero(kept) > 1:
        foreseen = curve_through(closures[kept], solved.at[kept])
        at = contacts.curves[CLOSURE.in_laws].value
        missed = np.maximum(missed, np.abs(foreseen(at) / contacts.at - 1))
    if name := solved.conductance_name:
        foreseen = curve_through(solved.at, solved.curves[name].value, power_law=True)
        values = contacts.curves[name].value
        with np.errstate(divide="ignore", invalid="ignore"):
            missed = np.fmax(missed, np.abs(foreseen(contacts.at) / values - 1))
    return missed


def merged(first: Curves, second: Curves) -> Curves:
    """Join two tables of one law, sorted by argument.

    Values that turn back are replaced by `without_reversals`, and slopes are computed anew.

    Parameters
    ----------
    first, second : Curves
        Tables against the same quantity, without common arguments.

    Returns
    -------
    Curves
        The table at the arguments of both tables, with the quantities that both tables have. Values
        of single surfaces and `unresolved` are dropped, and budgets unless both tables have them.
    """
    at = np.append(first.at, second.at)
    order = np.argsort(at, kind="stable")
    curves: dict[str, Curve] = {}
    for name, curve in first.curves.items():
        if name in second.curves:
            at_rest = first.at_rest.get(name, 0.0)
            curves[name] = _joined(name, curve, second.curves[name], at, order, at_rest)
    reasons = entries_at([*first.reasons, *second.reasons], order)
    budgets: tuple[tuple[Budget, ...], ...] = ()
    if first.budgets and second.budgets:
        budgets = entries_at([*first.budgets, *second.budgets], order)
    return replace(
        first,
        at=at[order],
        curves=curves,
        outside=np.append(first.outside, second.outside)[order],
        reasons=reasons,
        flagged=np.append(first.flagged, second.flagged)[order],
        unresolved=(),
        budgets=budgets,
    )


def _joined(
    name: str,
    first: Curve,
    second: Curve,
    at: Values,
    order: NDArray[np.int64],
    at_rest: float,
) -> Curve:
    """Join two curves of a quantity, without the values of single surfaces.

    `at` has the arguments of the first curve, then the arguments of the second one. `order` are the
    indices that sort `at`. `at_rest` is the value at first touch.
    """
    parts: dict[str, Values] = {}
    for part in ("value", "low", "high"):
        values = np.append(getattr(first, part), getattr(second, part))[order]
        if np.isfinite(values).all():  # NaN would spread to all later values
            values = without_reversals(name, values)
        parts[part] = values
    return Curve(**parts, slope=slopes(at[order], parts["value"], at_rest))
