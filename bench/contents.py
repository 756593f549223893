"""What a report shows: pictures, tables and words, each with the files behind it.

The report's TOML file lists them as `contents`, each a figure, a table or words of a file with its
caption. The page of all reports and the manual render the same contents.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from bench.files import content_of, is_there, named, read_table
from gen.runtime.errors import InputError

DIGITS = 4  # significant digits of numbers that are shown; the files have more

PASSED = "passed"
SPECIAL = {"": "", "nan": "nan", "inf": "∞", "-inf": "-∞"}
# Last words of columns' names that are units.
UNITS = {"um": "µm", "s": "s", "seconds": "s", "ms": "ms", "percent": "%", "uN": "µN"}
UNITS |= {"MPa": "MPa", "K": "K"}


@dataclass(frozen=True)
class Figure:
    """A PNG file, a caption in plain text that says what to see in it, and the tables behind it."""

    picture: Path
    caption: str
    data: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Table:
    """A CSV file, with the names of its columns first, and a caption as that of a figure."""

    data: Path
    caption: str
    columns: tuple[str, ...] = ()  # that are shown, in this order; all of them if empty
    verdict: str = (
        ""  # the column whose value is `passed` where all is well: other rows are red
    )


@dataclass(frozen=True)
class Words:
    """A paragraph; its lines and blanks are kept if a program `typed` it."""

    text: str
    typed: bool = False


Content = Figure | Table | Words


def tables_of(content: Content) -> tuple[Path, ...]:
    """Return the CSV files of a content."""
    if isinstance(content, Figure):
        return content.data
    return (content.data,) if isinstance(content, Table) else ()


def contents_of(entries: Sequence[Mapping[str, Any]], folder: Path) -> list[Content]:
    """List what a folder holds of the contents that a report's file describes."""
    return [each for entry in entries for each in _contents(entry, folder)]


def _contents(entry: Mapping[str, Any], folder: Path) -> Iterator[Content]:
    """Yield the contents of an entry: one for each file that its name, with a *, may stand for.

    Words, names with a *, and what is `optional` are left out where no file is there.
    """
    (kind,) = entry.keys() & {"figure", "table", "words"}
    may_miss = kind == "words" or entry.get("optional", False)
    for path in named(folder, entry[kind]):
        caption = " ".join(
            entry.get("caption", "").replace("{target}", path.parent.name).split()
        )
        if may_miss and not is_there(path):
            continue
        if kind == "figure":
            data = (folder / each for each in entry.get("data", ()))
            yield Figure(path, caption, tuple(filter(is_there, data)))
        elif kind == "table":
            yield Table(
                path, caption, tuple(entry.get("columns", ())), entry.get("verdict", "")
            )
        else:
            text, typed = content_of(path).decode(), entry.get("typed", False)
            yield from [Words(text, typed)] if typed else map(Words, text.splitlines())


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
    """Read a table, and format it for readers: few digits, units in the titles."""
    header, lines = read_table(table.data)
    columns = table.columns or tuple(header)
    if missing := {*columns, table.verdict} - {"", *header}:
        raise InputError(f"{table.data}: has no column {', '.join(sorted(missing))}")
    rows = [[cell(line[name]) for name in columns] for line in lines]
    titles = []
    for place, name in enumerate(columns):
        *words, last = name.split("_")
        unit = f"[{UNITS[last]}]" if words and last in UNITS else last
        titles.append(
            Cell(" ".join([*words, unit]), all(row[place].number for row in rows))
        )
    failed = [line[table.verdict] != PASSED if table.verdict else None for line in lines]
    return Tabulated(titles, rows, failed)


def cell(text: str) -> Cell:
    """Return a value of a table as it is shown."""
    if text in SPECIAL:
        return Cell(SPECIAL[text], number=True)
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):  # a word: numbers that are written so are in SPECIAL
        return Cell(text, number=False)
    if value.is_integer() and abs(value) < 1e7:
        return Cell(f"{value:,.0f}" if abs(value) >= 1e4 else f"{value:.0f}", number=True)
    return Cell(f"{value:.{DIGITS}g}", number=True)
