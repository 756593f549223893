"""Summarise the errors that were asked for and got, by kind of surface and by answer."""

from collections.abc import Callable, Iterable, Sequence
from statistics import median

from bench.accuracy.asked import ENOUGH_IN_WAVE
from bench.files import Row

ROUNDING = 1e-4
"""Error of a value that the tolerances of both solves may cause [% of the value].

A bar holds if the error exceeds it by no more than this, and smaller errors are rounded up to it
before a bar is divided by them.
"""


def by_error(rows: Sequence[Row], asked_for: str, column: str) -> list[Row]:
    """Summarise answers that were asked for, for each error and each value of a column.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `asked_and_got`.
    asked_for : {"area", "all"}
        Whether rows of the area alone are summarised, or those of all answers together.
    column : {"kind", "answer"}
        Column that has a row for each of its values.

    Returns
    -------
    list of Row
        A row for each error and value, with the columns of `share_row`. By "kind", each error has
        a further row for all kinds.
    """
    selected = [row for row in rows if row["asked_for"] == asked_for]
    return _tabulated(selected, "asked_percent", column)


def bars_of_maps(rows: Sequence[Row]) -> list[Row]:
    """Summarise the 90 % bars of the maps, for each answer and kind.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `asked_and_got`.

    Returns
    -------
    list of Row
        A row for each answer and kind, and one for all kinds of each answer; columns as in
        `share_row`, less those about what was asked.
    """
    of_maps = [row for row in rows if row["asked_for"] == "map"]
    table = _tabulated(of_maps, "answer", "kind")
    for row in table:
        del row["within_percent"]
        row["resolved_percent"] = row.pop("answered_percent")
    return table


def _tabulated(rows: Sequence[Row], outer: str, inner: str) -> list[Row]:
    """Return a row of `share_row` for each value of a column `outer` and each of `inner`.

    If `inner` is "kind", each value of `outer` has a further row for all kinds.
    """
    table = []
    for outer_value in _values(rows, outer):
        group = [row for row in rows if row[outer] == outer_value]
        for inner_value in _values(group, inner):
            subgroup = [row for row in group if row[inner] == inner_value]
            names = {outer: outer_value, inner: inner_value}
            table.append(names | share_row(subgroup))
        if inner == "kind":
            table.append({outer: outer_value, inner: "all"} | share_row(group))
    return table


def _values(rows: Iterable[Row], column: str) -> list[object]:
    """Return the distinct values of a column, in the order of the rows."""
    return list(dict.fromkeys(row[column] for row in rows))


def share_row(rows: Sequence[Row]) -> Row:
    """Summarise answers.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `asked_and_got`.

    Returns
    -------
    Row
        The number of rows, and the share that has an answer [%]. Of the answers: the share within
        the error that was asked for and the share within their bars [%], the median ratio of bar
        and error [1], the median and the largest error [%]. These are None without answers.
    """
    answered = [row for row in rows if row["answered"]]
    return {
        "contacts": len(rows),
        "answered_percent": percent(rows, is_answered),
        "within_percent": percent(answered, is_within),
        "bar_holds_percent": percent(answered, bar_holds),
        "bar_over_error": bar_over_error(answered),
        "median_off_percent": _median_error(answered),
        "largest_off_percent": max(
            (row["off_percent"] for row in answered), default=None
        ),
    }


def percent(rows: Sequence[Row], condition: Callable[[Row], bool]) -> float | None:
    """Return the share of rows for which a condition holds [%]; None without rows.

    Parameters
    ----------
    rows : sequence of Row
        The rows.
    condition : callable
        Function of a row.
    """
    if not rows:
        return None
    return 100 * sum(map(condition, rows)) / len(rows)


def is_answered(row: Row) -> bool:
    """Return whether an answer was given.

    Parameters
    ----------
    row : Row
        Row of `asked_and_got`.
    """
    return bool(row["answered"])


def is_within(row: Row) -> bool:
    """Return whether an answer is within the error that was asked for.

    Parameters
    ----------
    row : Row
        Row of an answer that was given.
    """
    return bool(row["off_percent"] <= row["asked_percent"])


def bar_holds(row: Row) -> bool:
    """Return whether the error of an answer is at most its bar.

    Parameters
    ----------
    row : Row
        Row of an answer that was given.
    """
    return bool(row["off_percent"] <= row["bar_percent"] + ROUNDING)


def bar_over_error(rows: Sequence[Row]) -> float | None:
    """Return the median ratio of bar and error; None without rows.

    Parameters
    ----------
    rows : sequence of Row
        Rows of answers that were given.
    """
    if not rows:
        return None
    return float(
        median(row["bar_percent"] / max(row["off_percent"], ROUNDING) for row in rows)
    )


def _median_error(rows: Sequence[Row]) -> float | None:
    """Return the median error [%]; None without rows."""
    if not rows:
        return None
    return float(median(row["off_percent"] for row in rows))


def is_fine(row: Row) -> bool:
    """Return whether a map has waves of enough nodes, so that its area should be answered.

    Parameters
    ----------
    row : Row
        Row of `asked_and_got`. Surfaces with creases, and maps whose shortest wave is not known,
        are not fine.
    """
    return bool(row["nodes_in_wave"] >= ENOUGH_IN_WAVE)
