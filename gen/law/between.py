"""Contacts between the loads of a law, for tables whose points are joined by programs.

A law bends most towards full contact, where the conductance diverges, and on a grid the conductance
of one surface is a staircase: it jumps where asperities touch or merge. So contacts are solved
between the loads of the law, first until the curve through them foresees the next ones, and then
where straight lines of a table with little room may be far from the conductance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.law.curves import Curve, Curves, held, risen, slopes
from gen.law.lines import LEVEL, Column, curve_through
from gen.quantities import AREA, CLOSURE, PRESSURE

Solve = Callable[[Values], Curves]
"""Solves contacts at ascending loads, (m,) [um or MPa], and returns those that were solved."""

ENOUGH = 30
"""Nodes in contact from which on points are laid closely: with fewer, each node is a step."""

MOST_AREA = 90.0
"""Share of the nodes in contact up to which points are laid closely [%]."""

FORESEEN = 0.01
"""Relative distance of a solved contact from the curve below which no more are solved beside it."""

ROUNDS = 5
"""Number of times that an interval between two loads is halved at most."""

LINE_ROUNDS = 2
"""The same number where straight lines are improved afterwards."""

NEAR = 1.5
"""Ratio of neighbouring loads above which an interval is halved although its middle is foreseen."""

CALCULIX_POINTS = 20
"""Number of points that a table has room for in CalculiX."""

POSSIBLE = 0.05
"""Relative distance of lines that may lie between two contacts without a further contact."""

IMPROVEMENTS = 6
"""Number of times that contacts are solved beside lines, which are laid anew each time."""

MOST_CONTACTS = 500
"""Number of contacts between the loads of a law up to which lines are improved."""

CLOSEST = 1.003
"""Ratio of neighbouring loads below which a jump of the conductance is not resolved further."""

CHECKS = 20
"""Number of contacts at most that judge the lines of a table and had no part in laying them."""

CHECK_AT = (5**0.5 - 1) / 2
"""Place of these between two loads, which no halving meets: the golden section."""


def in_range(curves: Curves, nodes: int) -> NDArray[np.bool_]:
    """Return where the lines of a law are to follow it closely.

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
    return _touching(curves, nodes, ENOUGH, MOST_AREA)


def _touching(
    curves: Curves, nodes: int, enough: float, most_area: float
) -> NDArray[np.bool_]:
    """Return where at least so many nodes and at most such a share [%] touch, (k,)."""
    area = curves.curves[AREA.in_laws].value
    return np.asarray((area * nodes >= 100 * enough) & (area <= most_area))


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
        Number of times that an interval is halved at most; 1 solves one contact in each.

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
        # A little beyond the ends, so that the intervals there are foreseen too.
        near = _touching(contacts, nodes, ENOUGH / 2, (MOST_AREA + 100) / 2)
        unforeseen = contacts.at[near & (_missed(solved, contacts) > FORESEEN)]
        solved = merged(solved, contacts)
        between = contacts if between is None else merged(between, contacts)
        answered = np.isin(middles, contacts.at)
        halved = answered & (np.isin(middles, unforeseen) | (middles > NEAR * low))
        low, high = _halves(low[halved], middles[halved], high[halved])
    return between


def _halves(low: Values, middles: Values, high: Values) -> tuple[Values, Values]:
    """Return the lower and the upper ends of both halves of intervals, ascending."""
    lower = np.append(low, middles)
    upper = np.append(middles, high)
    return np.sort(lower), np.sort(upper)


def solve_for_lines(table: Curves, nodes: int, solve: Solve) -> Curves | None:
    """Solve contacts between the loads of a table whose points are joined by straight lines.

    Between two contacts the conductance lies between its values there. Where lines with the room of
    CalculiX may thus be further off than `POSSIBLE`, the interval is halved, and lines are laid
    anew. A table without a conductance is solved by `solve_between` alone.

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
    if not table.conducting:
        return solve_between(table, nodes, solve)
    between = solve_between(table, nodes, solve, LINE_ROUNDS)
    if between is None:
        return None
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
    """Return pressures between contacts where lines may be too far off, the furthest first [MPa].

    `at_loads` is where the contacts are at loads of the law.
    """
    pressures = solved.at
    conductances = solved.curves[solved.conducting].value
    close = in_range(solved, nodes)
    at_rest = solved.at_rest.get(solved.conducting, 0.0)
    line = Column.through(
        np.append(0.0, pressures),
        np.append(at_rest, conductances),
        np.append(True, at_loads),
        np.append(False, close),
        powers=True,
    ).laid(CALCULIX_POINTS)
    lines = np.interp(pressures, line.at, line.values)
    ends = np.stack([conductances[:-1], conductances[1:]])
    line_ends = np.stack([lines[:-1], lines[1:]])
    with np.errstate(divide="ignore", invalid="ignore"):
        above = line_ends.max(axis=0) / ends.min(axis=0) - 1
        below = 1 - line_ends.min(axis=0) / ends.max(axis=0)
    possible = np.fmax(above, below)
    doubtful = (close[:-1] | close[1:]) & (possible > POSSIBLE)
    doubtful &= pressures[1:] > CLOSEST * pressures[:-1]
    middles = np.sqrt(pressures[:-1] * pressures[1:])[doubtful]
    furthest_first = np.argsort(-possible[doubtful], kind="stable")
    return np.asarray(middles[furthest_first])


def check_loads(table: Curves) -> Values:
    """Return loads at which the lines of a table are judged.

    Parameters
    ----------
    table : Curves
        Table of a law, against Delta or pressure, (k,).

    Returns
    -------
    ndarray, shape (m,)
        At most `CHECKS` loads between those of the table [um or MPa].
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
    """Return by which share the curve through a table misses contacts between its points, (k,)."""
    missed = np.zeros(contacts.at.size)
    if solved.against != PRESSURE.in_laws:
        return missed
    closures = solved.curves[CLOSURE.in_laws].value
    kept = risen(closures, LEVEL)
    if np.count_nonzero(kept) > 1:
        foreseen = curve_through(closures[kept], solved.at[kept])
        at = contacts.curves[CLOSURE.in_laws].value
        missed = np.maximum(missed, np.abs(foreseen(at) / contacts.at - 1))
    if name := solved.conducting:
        foreseen = curve_through(solved.at, solved.curves[name].value, powers=True)
        values = contacts.curves[name].value
        with np.errstate(divide="ignore", invalid="ignore"):
            missed = np.fmax(missed, np.abs(foreseen(contacts.at) / values - 1))
    return missed


def merged(first: Curves, second: Curves) -> Curves:
    """Join two tables of the same law at different arguments.

    Parameters
    ----------
    first, second : Curves
        Tables against the same quantity.

    Returns
    -------
    Curves
        The table at all arguments, ascending, of the quantities that both have.
    """
    at = np.append(first.at, second.at)
    order = np.argsort(at, kind="stable")
    curves: dict[str, Curve] = {}
    for name, curve in first.curves.items():
        if name in second.curves:
            at_rest = first.at_rest.get(name, 0.0)
            curves[name] = _joined(name, curve, second.curves[name], at, order, at_rest)
    reasons = np.array([*first.reasons, *second.reasons], dtype=object)
    return replace(
        first,
        at=at[order],
        curves=curves,
        outside=np.append(first.outside, second.outside)[order],
        reasons=tuple(reasons[order]),
        flagged=np.append(first.flagged, second.flagged)[order],
        grid=(),
    )


def _joined(
    name: str,
    first: Curve,
    second: Curve,
    at: Values,
    order: NDArray[np.int64],
    at_rest: float,
) -> Curve:
    """Join two curves of a quantity, whose arguments `at` ascend in an order."""
    parts: dict[str, Values] = {}
    for part in ("value", "low", "high"):
        values = np.append(getattr(first, part), getattr(second, part))[order]
        if np.isfinite(values).all():
            values = held(name, values)
        parts[part] = values
    return Curve(**parts, slope=slopes(at[order], parts["value"], at_rest))
