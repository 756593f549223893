"""Compare what `bem.solve_within` promises with the numbers that the report `accuracy` measures."""

from collections.abc import Sequence

from bench.accuracy.summary import (
    bar_holds,
    bar_over_error,
    is_answered,
    is_fine,
    is_within,
    percent,
)
from bench.files import Row

ENOUGH_CONTACTS = 30
"""Fewest contacts of a kind whose share of bars that hold is judged."""

ALONE = {"area": "alone", "all": "with the others"}
"""How an answer was asked for, in words, by the column `asked_for`."""

JUDGED = 1.0
"""Error of the area at which other solvers are judged [%]."""


def promises(
    rows: Sequence[Row], ratios: Sequence[Row], medians: Sequence[Row]
) -> list[Row]:
    """Return the promises with the measured numbers.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `asked.asked_and_got`; empty if nothing was asked.
    ratios : sequence of Row
        Rows of `times.ratios`.
    medians : sequence of Row
        Rows of `full_grid.medians`.

    Returns
    -------
    list of Row
        A row for each promise: its words, its bounds, the measured value, the number of contacts,
        kinds, surfaces or maps behind the value, and whether the promise is kept. Promises without
        measurements are left out.
    """
    return [
        *_of_asked(rows),
        *_of_bars(rows),
        *_of_peers(ratios),
        *_of_full_grids(medians),
    ]


def _promise(
    words: str,
    measured: float | None,
    number: int,
    *,
    least: float | None = None,
    most: float | None = None,
) -> list[Row]:
    """Return a list with the row of a promise; an empty list if nothing was measured."""
    if measured is None:
        return []
    is_above = least is None or measured >= least
    is_below = most is None or measured <= most
    return [
        {
            "promise": words,
            "least": least,
            "most": most,
            "measured": measured,
            "number": number,
            "kept": "yes" if is_above and is_below else "no",
        }
    ]


def _of_asked(rows: Sequence[Row]) -> list[Row]:
    """Return the promises about errors that were asked for."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        if row["answered"] and row["asked_for"] in ALONE:
            alone = ALONE[row["asked_for"]]
            words = f"{row['answer']} {alone}, asked to {row['asked_percent']:g} %"
            groups.setdefault(words, []).append(row)
    table = []
    for words, group in groups.items():
        measured = percent(group, is_within)
        table += _promise(f"{words}: within [%]", measured, len(group), least=95.0)
    at_3_percent = [
        row for row in rows if row["asked_for"] == "area" and row["asked_percent"] == 3.0
    ]
    fine = [row for row in at_3_percent if is_fine(row)]
    table += _promise(
        "8 nodes and more in the shortest wave, asked to 3 %: answered [%]",
        percent(fine, is_answered),
        len(fine),
        least=90.0,
    )
    limitless = [
        row for row in at_3_percent if not row["has_limit"] and not row["yields"]
    ]
    table += _promise(
        "elastic surfaces whose area has no limit: answered [%]",
        percent(limitless, is_answered),
        len(limitless),
        most=0.0,
    )
    return table


def _of_bars(rows: Sequence[Row]) -> list[Row]:
    """Return the promises about the 90 % bars of maps."""
    table = []
    of_maps = [row for row in rows if row["asked_for"] == "map" and row["answered"]]
    for answer in dict.fromkeys(row["answer"] for row in of_maps):
        bars = [row for row in of_maps if row["answer"] == answer]
        words = f"bars of maps, {answer}: bar over error, median"
        table += _promise(words, bar_over_error(bars), len(bars), most=5.0)
        words = f"bars of maps, {answer}: inside [%]"
        inside = percent(bars, bar_holds)
        table += _promise(words, inside, len(bars), least=90.0, most=97.0)
        shares = _shares_of_kinds(bars)
        if shares:
            words = f"bars of maps, {answer}: inside, the worst kind [%]"
            table += _promise(words, min(shares), len(shares), least=85.0)
    return table


def _shares_of_kinds(bars: Sequence[Row]) -> list[float]:
    """Return the share of bars that hold of each kind with enough contacts [%]."""
    shares = []
    for kind in dict.fromkeys(row["kind"] for row in bars):
        of_kind = [row for row in bars if row["kind"] == kind]
        share = percent(of_kind, bar_holds)
        if share is not None and len(of_kind) >= ENOUGH_CONTACTS:
            shares.append(share)
    return shares


def _of_peers(ratios: Sequence[Row]) -> list[Row]:
    """Return the promises about other solvers, each of which is judged."""
    table = []
    for row in ratios:
        if row["within_percent"] != JUDGED:
            continue
        for kind, least in (("measured", 30.0), ("extrapolated", 100.0)):
            words = f"area within 1 %, p = 0.05 E* h': time of {row['way']}, {kind}"
            times_ours = row[f"{kind}_times_ours"]
            number = row[f"{kind}_surfaces"]
            table += _promise(words, times_ours, number, least=least)
    return table


def _of_full_grids(medians: Sequence[Row]) -> list[Row]:
    """Return the promises about full grids."""
    table = []
    for percent_asked, least in ((3.0, 20.0), (1.0, 8.0)):
        for row in medians:
            if row["nodes"] == "all" and row["asked_percent"] == percent_asked:
                words = f"full grid with its bar over ours, asked to {percent_asked:g} %: time"
                table += _promise(words, row["times"], row["answered"], least=least)
    return table
