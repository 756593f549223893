"""Tables as people read them: few digits, units in the titles, red where a verdict failed."""

import math
from typing import NamedTuple

from bench.page.content import Table
from bench.table import read_table
from gen.runtime.errors import InputError

DIGITS = 4  # significant digits of numbers on the page; the files have all of them

PASSED = "passed"
SPECIAL = {"": "", "nan": "nan", "inf": "∞", "-inf": "-∞"}
# Last words of columns' names that are units.
UNITS = {"um": "µm", "s": "s", "seconds": "s", "ms": "ms", "percent": "%", "uN": "µN"}
UNITS |= {"MPa": "MPa", "K": "K"}


class Cell(NamedTuple):
    """A title or a value as it is shown, and whether it is a number or the title of numbers."""

    text: str
    number: bool


class Tabulated(NamedTuple):
    """A table as it is shown; the verdict of each row says whether it failed, None without one."""

    titles: list[Cell]
    rows: list[list[Cell]]
    failed: list[bool | None]


def tabulated(table: Table) -> Tabulated:
    """Read a table, and format it for readers."""
    header, lines = read_table(table.data)
    columns = table.columns or tuple(header)
    if missing := {*columns, table.verdict} - {"", *header}:
        raise InputError(f"{table.data}: has no column {', '.join(sorted(missing))}")
    rows = [[_cell(line[name]) for name in columns] for line in lines]
    titles = [
        Cell(_title(name), all(row[place].number for row in rows))
        for place, name in enumerate(columns)
    ]
    failed = [line[table.verdict] != PASSED if table.verdict else None for line in lines]
    return Tabulated(titles, rows, failed)


def _title(name: str) -> str:
    """Return a column's name for people, its unit in brackets where it ends in one."""
    *words, last = name.split("_")
    return " ".join([*words, f"[{UNITS[last]}]" if words and last in UNITS else last])


def _cell(text: str) -> Cell:
    if text in SPECIAL:
        return Cell(SPECIAL[text], number=True)
    try:
        value = float(text)
    except ValueError:
        return Cell(text, number=False)
    if not math.isfinite(value):  # a word: numbers that are written so are in SPECIAL
        return Cell(text, number=False)
    if value.is_integer() and abs(value) < 1e7:
        return Cell(f"{value:,.0f}" if abs(value) >= 1e4 else f"{value:.0f}", number=True)
    return Cell(f"{value:.{DIGITS}g}", number=True)
