"""Tables of what was asked and what was got, by kind of surface and by answer."""

from collections.abc import Callable, Iterable, Sequence
from statistics import median

from bench.accuracy.asked import ENOUGH_IN_WAVE
from bench.files import Row

ROUNDING = 1e-4
"""Part of a value by which a bar of a map is widened, for the tolerances of both solves [%]."""


def by_kind(rows: Sequence[Row]) -> list[Row]:
    """Summarise the areas that were asked for alone, for each error and kind.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `asked_and_got`.

    Returns
    -------
    list of Row
        A row for each error and kind, and one for all kinds of each error. Columns are those of
        `share_row`.
    """
    of_area = [row for row in rows if row["asked_for"] == "area"]
    return _tabulated(of_area, "asked_percent", "kind")


def by_answer(rows: Sequence[Row]) -> list[Row]:
    """Summarise the answers that were asked for together, for each error and answer.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `asked_and_got`.

    Returns
    -------
    list of Row
        A row for each error and answer; columns as in `share_row`.
    """
    of_all = [row for row in rows if row["asked_for"] == "all"]
    return _tabulated(of_all, "asked_percent", "answer")


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
    """Return a row for each value of two columns, and one for all values of the inner one."""
    table = []
    for outer_value in _values(rows, outer):
        group = [row for row in rows if row[outer] == outer_value]
        for inner_value in _values(group, inner):
            subgroup = [row for row in group if row[inner] == inner_value]
            begin = {outer: outer_value, inner: inner_value}
            table.append(begin | share_row(subgroup))
        if inner == "kind":
            table.append({outer: outer_value, inner: "all"} | share_row(group))
    return table


def _values(rows: Iterable[Row], column: str) -> list[object]:
    """Return the values of a column, each once, in the order of the rows."""
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
        The number of answers and the share that was answered; of these the share within what was
        asked, the share inside its bar, the median ratio of bar and error, the median and the
        largest error. A value without answers is None.
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
