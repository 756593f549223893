"""The contents of a report: the pictures, tables and words that are shown, with their files.

The report's TOML file lists them as `contents`: each entry is a figure, a table or the words of a
file, with a caption. The page of all reports and the manual show the same contents.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from bench.files import content_of, is_there, named, read_table
from gen.quantities import RECORDS, typographic, unit_in_names
from gen.runtime.errors import InputError
from gen.units import readable_unit

DIGITS = 4
"""Significant digits of a number that is shown; the files have more."""

PASSED = "passed"
"""The verdict of a row whose check passed."""

SPECIAL = {"": "", "nan": "nan", "inf": "∞", "-inf": "-∞"}
"""Texts that are shown for numbers that are missing, NaN or infinite, by their texts in a table."""

UNITS = {
    "s": "s",
    "seconds": "s",
    "ms": "ms",
    "percent": "%",
    "N": "N",
    "GPa": "GPa",
    "K": "K",
    "MB": "MB",
    **{
        unit_in_names(unit): typographic(unit)
        for quantity in RECORDS
        for unit in (quantity.unit, quantity.law_unit)
        if unit_in_names(unit)
    },
}
"""Units as they are shown, by the last words of a column's name. Those of quantities are among
them."""


@dataclass(frozen=True)
class Figure:
    """A picture with its caption."""

    picture: Path  # PNG file
    caption: str  # plain text
    data: tuple[Path, ...] = ()  # CSV files that the picture is drawn from


@dataclass(frozen=True)
class Table:
    """A table with its caption."""

    data: Path  # CSV file
    caption: str  # plain text
    # Names of the columns to show, in this order; empty for all columns.
    columns: tuple[str, ...] = ()
    # Name of the column of verdicts. A row without the verdict `PASSED` is shown in red. Empty if
    # the table has no verdicts.
    verdict: str = ""


@dataclass(frozen=True)
class Words:
    """A paragraph of text, or a text that a program printed."""

    text: str
    # True if a program printed the text, so that its line breaks and blanks are kept.
    typed: bool = False


Content = Figure | Table | Words
"""One content of a report."""


def tables_of(content: Content) -> tuple[Path, ...]:
    """Return the CSV files of a content.

    Parameters
    ----------
    content : Figure, Table or Words
        The content.

    Returns
    -------
    tuple of Path
        The file of a table, or the files that a figure is drawn from; empty for words.
    """
    if isinstance(content, Figure):
        return content.data
    if isinstance(content, Table):
        return (content.data,)
    return ()


def contents_of(entries: Sequence[Mapping[str, Any]], folder: Path) -> list[Content]:
    """List the contents of a folder that the entries of a report's TOML file describe.

    Files of words and of `optional` entries are left out if they do not exist. Other files are
    listed even if they do not exist. A name with a `*` lists only files that exist.

    Parameters
    ----------
    entries : sequence of mappings
        The entries `contents` of the TOML file.
    folder : Path
        The folder of the report.

    Returns
    -------
    list of Figure, Table and Words
        The contents, in the order of the entries.
    """
    contents: list[Content] = []
    for entry in entries:
        contents += _contents_of_entry(entry, folder)
    return contents


def _contents_of_entry(entry: Mapping[str, Any], folder: Path) -> list[Content]:
    """Return the contents of one entry: those of each file that its name matches.

    The key of the name is the kind of the entry: `figure`, `table` or `words`.
    """
    (kind,) = entry.keys() & {"figure", "table", "words"}
    may_be_missing = kind == "words" or entry.get("optional", False)
    contents: list[Content] = []
    for path in named(folder, entry[kind]):
        if may_be_missing and not is_there(path):
            continue
        if kind == "figure":
            contents.append(_figure(entry, folder, path))
        elif kind == "table":
            contents.append(_table(entry, path))
        else:
            contents += _words(entry, path)
    return contents


def _figure(entry: Mapping[str, Any], folder: Path, path: Path) -> Figure:
    """Return the figure of a picture, with the tables that it is drawn from whose files exist."""
    data = [folder / name for name in entry.get("data", ())]
    return Figure(
        picture=path,
        caption=_caption(entry, path),
        data=tuple(table for table in data if is_there(table)),
    )


def _table(entry: Mapping[str, Any], path: Path) -> Table:
    """Return the table of a CSV file."""
    return Table(
        data=path,
        caption=_caption(entry, path),
        columns=tuple(entry.get("columns", ())),
        verdict=entry.get("verdict", ""),
    )


def _words(entry: Mapping[str, Any], path: Path) -> list[Words]:
    """Return the words of a text file: one item for a printed text, else one for each line.

    Raises InputError if the file cannot be read.
    """
    text = content_of(path).decode()
    if entry.get("typed", False):
        return [Words(text, typed=True)]
    return [Words(line) for line in text.splitlines()]


def _caption(entry: Mapping[str, Any], path: Path) -> str:
    """Return the caption of an entry on one line; the name of the file's folder fills {target}."""
    caption = entry.get("caption", "").replace("{target}", path.parent.name)
    return " ".join(caption.split())


class Cell(NamedTuple):
    """A title or a value of a table, as it is shown."""

    text: str
    number: bool  # True for a number, and for the title of a column of numbers only


class TableToShow(NamedTuple):
    """A table as it is shown."""

    titles: list[Cell]  # titles of the columns
    rows: list[list[Cell]]  # cells of each row, in the order of the titles
    # For each row: True if its verdict is not `PASSED`; None in a table without verdicts.
    failed: list[bool | None]


def tabulated(table: Table) -> TableToShow:
    """Read a table, and format it for readers.

    Parameters
    ----------
    table : Table
        The table.

    Returns
    -------
    TableToShow
        Titles with units, and numbers of `DIGITS` significant digits.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks a column that is to be shown or has the verdicts.
    """
    header, lines = read_table(table.data)
    columns = table.columns or tuple(header)
    required = {*columns, table.verdict} - {""}
    missing = required - {*header}
    if missing:
        raise InputError(f"{table.data}: has no column {', '.join(sorted(missing))}")
    titles = []
    columns_of_cells = []
    for name in columns:
        column = _column([line[name] for line in lines], name)
        columns_of_cells.append(column.cells)
        titles.append(column.title)
    rows = [list(cells) for cells in zip(*columns_of_cells, strict=True)]
    failed: list[bool | None] = [None] * len(lines)
    if table.verdict:
        failed = [line[table.verdict] != PASSED for line in lines]
    return TableToShow(titles=titles, rows=rows, failed=failed)


class Column(NamedTuple):
    """A column of a table, as it is shown."""

    title: Cell
    cells: list[Cell]


def _column(texts: Sequence[str], name: str) -> Column:
    """Format a column, in a larger unit if its largest number would have an exponent.

    `texts` are the values as the CSV file has them.
    """
    unit = _unit_of(name)
    numbers = [abs(number) for number in map(_number, texts) if number is not None]
    largest = max(numbers, default=0.0)
    readable = readable_unit(unit, largest, DIGITS)
    if readable.name != unit:
        name = name.removesuffix(unit) + readable.name
        texts = [_in_unit(text, readable.size) for text in texts]
    cells = [cell(text) for text in texts]
    only_numbers = all(shown.number for shown in cells)
    return Column(title=Cell(text=_title(name), number=only_numbers), cells=cells)


def _number(text: str) -> float | None:
    """Return a finite number of a CSV file; None for any other text."""
    with suppress(ValueError):
        number = float(text)
        if math.isfinite(number):
            return number
    return None


def _in_unit(text: str, size: float) -> str:
    """Return a text with its number divided by the size of a unit; other texts unchanged."""
    number = _number(text)
    return text if number is None else repr(number / size)


def _title(column: str) -> str:
    """Return the title of a column: the words of its name, and its unit in brackets.

    "gap_um" becomes "gap [µm]".
    """
    unit = _unit_of(column)
    if not unit:
        return column.replace("_", " ")
    words = column.removesuffix(f"_{unit}").replace("_", " ")
    return f"{words} [{UNITS[unit]}]"


def _unit_of(column: str) -> str:
    """Return the unit at the end of a column's name, a key of `UNITS`; "" if it has none.

    It is the longest one, as "MPa_per_um" of "stiffness_MPa_per_um". A name of one word has none.
    """
    units = [unit for unit in UNITS if column.endswith(f"_{unit}")]
    return max(units, key=len, default="")


def cell(text: str) -> Cell:
    """Format a value of a table for readers.

    Parameters
    ----------
    text : str
        The value, as the CSV file has it.

    Returns
    -------
    Cell
        A number with `DIGITS` significant digits; whole numbers below 1e7 keep all of their digits.
        A text that is no number is unchanged. An empty text is a missing number.
    """
    if text in SPECIAL:
        return Cell(text=SPECIAL[text], number=True)
    # Tables write infinite numbers only as the keys of `SPECIAL`: other words are no numbers.
    value = _number(text)
    if value is None:
        return Cell(text=text, number=False)
    if value.is_integer() and abs(value) < 1e7:
        # Whole numbers of up to four digits, for example nodes a side, get no comma.
        form = ",.0f" if abs(value) >= 1e4 else ".0f"
        return Cell(text=format(value, form), number=True)
    return Cell(text=f"{value:.{DIGITS}g}", number=True)
