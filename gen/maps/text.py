"""Read tables of numbers from texts, with the headers that programs of microscopes write.

Headers of Gwyddion's ASCII export (in all its languages), of SPIP, Attocube, Nova, WSxM and Koala
are understood. In texts with these headers, x runs along the lines. Later, `gen.maps.scan` tells
whether the numbers are heights or coordinates.
"""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gen.maps.scan import UNITS, Scan, unit_of
from gen.runtime.errors import InputError

# labels in headers, in lower case and separated by |, by the quantity that they label
LABELS = {
    "channel": "channel|channel name|display|kanál|kanal|canal|canale|チャネル|채널|канал",
    "width": "width|x-length|x amplitude|šířka|breite|anchura|largeur|larghezza|largura"
    "|幅|폭|ширина",
    "height": "height|y-length|y amplitude|výška|höhe|altura|hauteur|altezza|高さ|높이|высота",
    "value unit": "value units|z-unit|unit data|jednotky hodnot|einheiten|unités|unità valore"
    "|unidades de valor|値の単位|값 단위|единицы измерения",
    "x unit": "x-unit|unit x|lateral units",
    "y unit": "y-unit|unit y",
    "columns": "x-pixels|nx",
    "lines": "y-pixels|ny",
    "x spacing": "scale x",
    "y spacing": "scale y",
    "nm per value": "bit2nm",
    "conversion": "conversion factor",
    "data unit": "data unit",
    "to be scaled": "datascaleneeded",
    "format": "file format",
}
# quantity in `LABELS` by each of its labels
MEANINGS = {
    label: meaning for meaning, labels in LABELS.items() for label in labels.split("|")
}

# entry of a header, as `Width: 10 um`
ENTRY = re.compile(r"(?P<label>[^:=：]{1,40}?)\s*[:=：]\s*(?P<value>.*)")
# value of an entry that begins with a number, as `10 um`
QUANTITY = re.compile(
    r"(?P<number>[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>.*)"
)
# blanks between the name of a column and the bracket with its unit
UNIT_SET_OFF = re.compile(r"\s+(?=[\[(])")
# name of a column, with or without its unit: `x`, `X [mm]`, `Z_(microns)`, `y/um`, `x in nm`
NAME = re.compile(
    r"\W*(?P<name>[^\W\d_]+)[^\[(/]*?(?:(?:[\[(/]|\bin )\s*(?P<unit>[^\])]*)\W*)?"
)
HEIGHT = {"z", "h", "height", "heights"}  # names of a column of heights, in lower case
# beginning of a field that is a number or was meant to be one, as `1e` or `(2`
BEGINS = re.compile(r"\W*(\d|(nan|inf)\b)", re.IGNORECASE)
# largest number of letters of a comment that a warning quotes
QUOTED = 60
# largest number of comments that are quoted
MOST_REMARKS = 3
# control characters that no text file contains
CONTROL_CHARACTERS = re.compile("[\0-\x08\x0e-\x1f]")
# whole number, or number with a decimal comma
WITH_COMMA = re.compile(r"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")
# parts of a number in front of its decimal comma and behind it
WHOLE = re.compile(r"[-+]?(0|[1-9]\d*)")
DECIMALS = re.compile(r"\d+([eE][-+]?\d+)?")
# beginning of decimals, as 05 or 5e3, with which no whole number begins
PLAIN_DECIMALS = re.compile(r"0\d|\d+[eE]")
# first line of files whose header has no `#` in front
BARE = re.compile(r"\s*(File Format\s*=|WSxM file)", re.IGNORECASE)
# first line of Koala's header: `h=305 w=400` for 305 lines of 400 numbers
KOALA = re.compile(r"\s*[hw]\s*=\s*\d+(\s+[hw]\s*=\s*\d+)?\s*", re.IGNORECASE)
# letter and number of each count in the first line of Koala's header
KOALA_COUNT = re.compile(r"([hw])\s*=\s*(\d+)", re.IGNORECASE)
# label of Koala's conversion factor, which contains a unit of length
KOALA_FACTOR = re.compile(
    r"height conversion factor \(->\s*(?P<unit>[^)]+)\)", re.IGNORECASE
)
# end of a line as editors count lines; some programs write two carriage returns in front of "\n"
LINE_END = re.compile(r"\r*\n|\r")
# unit of length; the user is warned of comments that contain one but are not understood
SAYS_LENGTHS = re.compile(
    r"\b(mm|um|µm|μm|nm|microns?|micromet\w+|nanomet\w+|\d\s*m)\b|Å"
)


class _Line(NamedTuple):
    """A line of a text, split into its parts; a plain tuple for speed, as texts have many lines."""

    number: int  # number of the line in the file, from 1
    # comment, entry of a header, or title, without blanks around it; "" if none
    comment: str
    fields: list[str]  # fields that should be numbers; empty if the line has none


@dataclass
class _Block:
    """The numbers under one header, and the content of the header."""

    rows: list[list[float]] = field(default_factory=list)
    # values of the header by the quantities of `LABELS`, and the entries of `_column_entries`
    entries: dict[str, str] = field(default_factory=dict)
    # comments that name a unit of length, but are not understood
    remarks: list[str] = field(default_factory=list)

    def add_comment(self, line: _Line, entry: dict[str, str]) -> None:
        """Record the comment of a line.

        An entry of the header goes to `entries`, unless an earlier line has stated its quantity.
        Names of columns go there too, if no numbers have come before them. Any other comment goes
        to `remarks`, shortened, if it names a unit of length, and is dropped if it does not.

        Parameters
        ----------
        line : _Line
            The line, which has a comment.
        entry : dict
            The entry in the comment, from `_entry`; empty if the comment is none.
        """
        if not entry and not self.rows and not line.fields:
            entry = _column_entries(_columns(line.comment))
        if entry:
            self.entries = entry | self.entries
        elif SAYS_LENGTHS.search(line.comment):
            self.remarks.append(" ".join(line.comment.split())[:QUOTED])


@dataclass(frozen=True)
class _Quantity:
    """A number with a unit, from the value of an entry in a header."""

    number: float = 0.0  # 0 if the value holds no number
    unit: str = ""  # "" if the value names no unit


@dataclass(frozen=True)
class _Extent:
    """The lengths of a map that a header states."""

    # lengths along the lines [x_unit] and across them [y_unit]; None unless both are stated
    widths: tuple[float, float] | None
    x_unit: str  # "" if the header names none
    y_unit: str  # "" if the header names none


def read_matrices(content: bytes, path: Path) -> list[Scan]:
    """Read the numbers of a text as one matrix, or as one for each channel with a header.

    Parameters
    ----------
    content : bytes
        The content of the file.
    path : Path
        The file, for messages.

    Returns
    -------
    list of Scan
        The matrices, whose axis 0 counts the lines, with the lengths and units that their headers
        state. An empty list if the content is no text.

    Raises
    ------
    InputError
        If a field is no number, rows differ in length, a matrix is smaller than 2 x 2, columns are
        named as those of a profile, or a header contradicts its numbers or says that they are to be
        scaled.
    """
    text = _decoded(content)
    if text is None:
        return []
    scans: list[Scan] = []
    block = _Block()
    for line in _lines(text, path):
        if line.comment:
            entry = _entry(line.comment)
            # Below numbers, this entry begins the header of the next channel.
            if block.rows and entry.keys() & {"channel", "width"}:
                scans.append(_matrix(path, block))
                block = _Block()
            block.add_comment(line, entry)
        if line.fields:
            block.rows.append(_row(line, path, block.rows))
    # Ignore a header without numbers at the end. `_matrix` refuses a text without any numbers.
    if block.rows or not scans:
        scans.append(_matrix(path, block))
    return scans


def _decoded(content: bytes) -> str | None:
    """Decode a text in UTF-8, UTF-16 or an encoding that extends ASCII; None if it is no text.

    If the text is neither UTF-8 nor UTF-16, its letters outside ASCII become U+FFFD.
    """
    # UTF-16 usually begins with a mark of its byte order. If it does not, a zero byte beside its
    # first letter shows it, provided that this letter is ASCII.
    encoding = "utf-8-sig"
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    elif content[:1] == b"\0":
        encoding = "utf-16-be"
    elif content[1:2] == b"\0":
        encoding = "utf-16-le"
    # Binary files of instruments may be large: most of them are known by their first bytes.
    if CONTROL_CHARACTERS.search(content[:4096].decode(encoding, errors="replace")):
        return None
    text = content.decode(encoding, errors="replace")
    if CONTROL_CHARACTERS.search(text):
        return None
    return text


def _entry(comment: str) -> dict[str, str]:
    """Return a comment that is a known entry as {quantity of `LABELS`: value}, any other as {}."""
    match = ENTRY.fullmatch(comment)
    if match is None:
        return {}
    meaning = MEANINGS.get(match["label"].lower())
    if meaning is None:
        return {}
    return {meaning: match["value"].strip()}


@dataclass(frozen=True)
class _Column:
    """The name of a column of numbers."""

    text: str  # the name as it is in the file
    axis: str  # coordinate that the name stands for: "x", "y", "z", or "" for another quantity
    unit: str  # unit in the name; "" if it has none


def _columns(line: str) -> list[_Column]:
    """Take every word of a line as the name of a column, and return these columns."""
    words = _fields(UNIT_SET_OFF.sub("", line))
    return [_column(word) for word in words]


def _column(word: str) -> _Column:
    """Take a word, as "X[mm]", as the name of a column, and return the column."""
    match = NAME.fullmatch(word.strip())
    if match is None:
        return _Column(text=word, axis="", unit="")
    name = match["name"].lower()
    axis = ""
    if name in HEIGHT:
        axis = "z"
    elif name in {"x", "y"}:
        axis = name
    return _Column(text=word, axis=axis, unit=match["unit"] or "")


# quantity of `LABELS` that is the unit of a coordinate
UNIT_ENTRIES = {"x": "x unit", "y": "y unit", "z": "value unit"}


def _column_entries(columns: list[_Column]) -> dict[str, str]:
    """Return the names of columns as entries of a header; {} unless x, y and z are there once each.

    The entries are the units of x, y and z, by the quantities of `LABELS`, and "columns of points":
    the coordinates of all columns, as "x,y,z,", in which a column of another quantity is empty.
    """
    axes = [column.axis for column in columns]
    if sorted(axis for axis in axes if axis) != ["x", "y", "z"]:
        return {}
    entries = {"columns of points": ",".join(axes)}
    for column in columns:
        if column.axis and column.unit:
            entries[UNIT_ENTRIES[column.axis]] = column.unit
    return entries


def _refuse_profile(line: str, place: str) -> None:
    """Raise InputError if a title names x and one or two other columns, but not x, y and z.

    These are the columns of a profile or of an incomplete list of points. The message begins with
    `place`, the file and the number of the line.
    """
    columns = _columns(line)
    axes = [column.axis for column in columns if column.axis]
    if sorted(axes) == ["x", "y", "z"]:
        return
    if "x" in axes and 2 <= len(columns) <= 3:
        names = ", ".join(column.text for column in columns)[:40]
        raise InputError(
            f"{place}: {names}: looks like the columns of a profile or of a list of"
            " points; give a map of heights, or points in columns x, y and z"
        )


def _lines(content: str, path: Path) -> Iterator[_Line]:
    """Yield the lines of a text that are not empty; lines of its header have a comment only.

    The first line tells how the header is marked.
    """
    lines = LINE_END.split(content)
    first = next((line for line in lines if line.strip()), "")
    if KOALA.fullmatch(first):
        yield from _koala_lines(lines, path)
    elif BARE.match(first):
        yield from _bare_lines(lines, path)
    else:
        yield from _marked_lines(lines, path)


def _marked_lines(lines: list[str], path: Path) -> Iterator[_Line]:
    """Yield the lines of a text whose comments begin with #; titles become comments, too.

    A title is a line of words above the numbers. A comment behind a title is left out. InputError
    if a text has a title but no numbers, or if a title names the columns of a profile.
    """
    has_numbers = False
    first_title = 0  # number of the line; 0 if there is no title
    for number, text in enumerate(lines, start=1):
        line = _split_line(number, text, path)
        if line.fields and not has_numbers:
            words = text.partition("#")[0]
            if _is_title(words.strip(), line.fields):
                _refuse_profile(words, f"{path}, line {number}")
                line = _Line(number=number, comment=words.strip(), fields=[])
                first_title = first_title or number
            else:
                has_numbers = True
        if line.fields or line.comment:
            yield line
    if first_title and not has_numbers:
        word = lines[first_title - 1].split()[0]
        raise _no_number(word, path, first_title)


def _is_title(text: str, fields: list[str]) -> bool:
    """Tell whether a line, split into its fields, is a title.

    An entry of a header, as `Width: 10 um`, is none, and no field of a title begins like a number.
    """
    if ENTRY.fullmatch(text):
        return False
    return not any(BEGINS.match(word) for word in fields)


def _bare_lines(lines: list[str], path: Path) -> Iterator[_Line]:
    """Yield the lines of a text whose header has no # in front.

    A line with a field that is no number belongs to the header: it becomes a comment.
    """
    for number, text in enumerate(lines, start=1):
        line = _split_line(number, text, path)
        if not _are_numbers(line.fields):
            line = _Line(number=number, comment=text.strip(), fields=[])
        if line.fields or line.comment:
            yield line


def _koala_lines(lines: list[str], path: Path) -> Iterator[_Line]:
    """Yield the lines of a text of Koala, with the header rewritten by `_koala_entries`."""
    has_numbers = False
    for line in _bare_lines(lines, path):
        has_numbers = has_numbers or bool(line.fields)
        text = lines[line.number - 1]
        # A comment behind # is no line of Koala's header.
        if has_numbers or text.lstrip().startswith("#"):
            yield line
            continue
        for entry in _koala_entries(text):
            yield _Line(number=line.number, comment=entry, fields=[])


def _koala_entries(line: str) -> list[str]:
    """Rewrite a line of Koala's header as lines "label = value" with labels of `LABELS`.

    Lines that are not understood are returned as they are.
    """
    # The first line counts the lines (h) and the numbers in each of them (w).
    if KOALA.fullmatch(line):
        counts = KOALA_COUNT.findall(line)
        axes = {"h": "y", "w": "x"}
        return [f"{axes[letter.lower()]}-pixels = {count}" for letter, count in counts]
    match = ENTRY.fullmatch(line.strip())
    if match is None:
        return [line.strip()]
    label = match["label"].lower()
    # Pixels are square.
    if label == "pixel size":
        return [f"scale x = {match['value']}", f"scale y = {match['value']}"]
    # The label contains the unit that the factor leads to.
    factor = KOALA_FACTOR.fullmatch(label)
    if factor:
        return [f"conversion factor = {match['value']} {factor['unit']}"]
    return [line.strip()]


def _split_line(number: int, line: str, path: Path) -> _Line:
    """Split a line into its fields and the comment behind #.

    `number` is that of the line in the file. InputError if the commas of the line seem both to
    separate numbers and to mark decimals.
    """
    text, _, comment = line.partition("#")
    text = text.strip()
    fields = _fields(text)
    if "," in text and _are_split(fields):
        raise InputError(
            f"{path}, line {number}: {text[:20]!r}: its commas look like decimal commas"
            " as well as separators; separate the numbers by ';', tabs or blanks"
        )
    return _Line(number=number, comment=comment.strip(), fields=fields)


def _matrix(path: Path, block: _Block) -> Scan:
    """Return the numbers of a block, with the lengths, units and names that its header states.

    Axis 0 counts the lines. InputError if there are fewer than 2 x 2 numbers, more or fewer than
    the header states, or if the header says that they are to be scaled.
    """
    entries = block.entries
    numbers = np.array(block.rows, dtype=np.float64)
    if min(numbers.shape) < 2:
        count = "no"
        if block.rows:
            count = " x ".join(map(str, numbers.shape))
        raise InputError(
            f"{path}: holds {count} heights; give 2-D heights, 2 x 2 or more"
        )
    extent = _extent(entries, numbers.shape)
    _require_counts(path, entries, numbers.shape, has_lengths=extent.widths is not None)
    if entries.get("to be scaled", "").lower() in {"yes", "1", "true"}:
        raise InputError(
            f"{path}: its header says that its numbers are to be scaled"
            " (DataScaleNeeded), which is not read; give heights in units of length"
        )
    # A length cannot be used without the other one: the user is told of it.
    unused_lengths = []
    if extent.widths is None:
        unused_lengths = [
            f"{name}: {entries[name]}" for name in ("width", "height") if name in entries
        ]
    remarks = unused_lengths + block.remarks
    names: tuple[str, ...] = ()
    if "columns of points" in entries:
        names = tuple(entries["columns of points"].split(","))
    scale = _scale(path, entries)
    return Scan(
        heights=numbers,
        widths=extent.widths,
        unit=scale.unit,
        length_unit=extent.x_unit or None,
        remarks=tuple(remarks[:MOST_REMARKS]),
        channel=entries.get("channel", ""),
        factor=scale.number,
        names=names,
        y_unit=extent.y_unit,
    )


def _require_counts(
    path: Path, entries: dict[str, str], shape: tuple[int, ...], *, has_lengths: bool
) -> None:
    """Raise InputError unless a matrix has the numbers of lines and columns that its header states.

    A header without lengths may be written by the user, for a matrix with x down the columns, as in
    .npy files: then both numbers may also be exchanged.
    """
    # A number that the header does not state is 0.
    stated_lines = _quantity(entries.get("lines", "")).number
    stated_columns = _quantity(entries.get("columns", "")).number
    allowed = [shape] if has_lengths else [shape, shape[::-1]]
    for lines, columns in allowed:
        if stated_lines in {0, lines} and stated_columns in {0, columns}:
            return
    raise InputError(
        f"{path}: its header states {_count_text(stated_lines)} lines of"
        f" {_count_text(stated_columns)} numbers, it holds {shape[0]} of {shape[1]}; give"
        " the whole file"
    )


def _count_text(count: float) -> str:
    """Return the text of a count, or "?" for 0, which means that the header does not state it."""
    return f"{count:g}" if count else "?"


def _scale(path: Path, entries: dict[str, str]) -> _Quantity:
    """Return the factor from the numbers of a text to heights, with the unit of these heights.

    The unit is "" if the header names none. A factor that the header does not state is 1.
    InputError if the header states a unit of length for the numbers and a conversion factor too.
    """
    data_unit = _unit(entries.get("data unit", ""))
    if "conversion" in entries:
        conversion = _quantity(entries["conversion"])
        factor = conversion.number
        if unit_of(data_unit) in UNITS and factor != 1.0:
            raise InputError(
                f"{path}: its header states numbers in {data_unit} as well as a height"
                f" conversion factor of {factor:g}; delete the line that does not hold"
            )
        return _Quantity(number=factor or 1.0, unit=conversion.unit)
    if "value unit" in entries:
        return _Quantity(number=1.0, unit=_unit(entries["value unit"]))
    if "nm per value" in entries:
        factor = _quantity(entries["nm per value"]).number
        return _Quantity(number=factor or 1.0, unit="nm")
    return _Quantity(number=1.0, unit=data_unit)


def _extent(entries: dict[str, str], shape: tuple[int, ...]) -> _Extent:
    """Return the lengths that a header states for a matrix of shape (lines, columns).

    Spacings of the nodes, if it states them, are multiplied by the numbers of columns and lines.
    """
    x_unit = entries.get("x unit", "")
    y_unit = entries.get("y unit", "")
    if "x spacing" in entries:
        along_lines = _quantity(entries["x spacing"])
        across_lines = _quantity(entries.get("y spacing", ""))
        lines, columns = shape
        width = along_lines.number * columns
        length = across_lines.number * lines
    else:
        along_lines = _quantity(entries.get("width", ""))
        across_lines = _quantity(entries.get("height", ""))
        width = along_lines.number
        length = across_lines.number
    # A value that is missing or no number is 0.
    if not (0 < along_lines.number < math.inf and 0 < across_lines.number < math.inf):
        return _Extent(widths=None, x_unit=x_unit, y_unit=y_unit)
    default_unit = ""
    if "format" in entries:  # of SPIP, which states no unit of lengths
        default_unit = "nm"
    x_unit = along_lines.unit or _unit(x_unit) or default_unit
    y_unit = across_lines.unit or _unit(y_unit) or x_unit
    return _Extent(widths=(width, length), x_unit=x_unit, y_unit=y_unit)


def _quantity(text: str) -> _Quantity:
    """Split a value of a header into number and unit.

    Without a number at its beginning, the number is 0 and the unit "".
    """
    match = QUANTITY.fullmatch(text)
    if match is None:
        return _Quantity()
    number = float(match["number"].replace(",", "."))  # the comma may mark decimals
    return _Quantity(number=number, unit=_unit(match["unit"]))


def _unit(text: str) -> str:
    """Strip brackets from a unit, and restore the micro sign of um in an unknown encoding."""
    return text.strip(" []()").replace("\ufffdm", "µm")


def _row(line: _Line, path: Path, rows: list[list[float]]) -> list[float]:
    """Return the fields of a line as numbers; `rows` are the rows above it.

    In a first row of more than three fields, a word in front of numbers becomes NaN: it is the
    corner of a table with coordinates or row numbers. InputError if another field is no number, or
    the line has more or fewer numbers than the first row.
    """
    fields = line.fields
    may_have_corner = not rows and len(fields) > 3
    if may_have_corner and not _is_number(fields[0]) and _are_numbers(fields[1:]):
        fields = ["nan", *fields[1:]]
    try:
        row = [float(number) for number in fields]
    except ValueError:
        raise _fault_of_row(line, path, is_first=not rows) from None
    if rows and len(row) != len(rows[0]):
        raise InputError(
            f"{path}, line {line.number}: {len(row)} numbers where the first row has"
            f" {len(rows[0])}; give rows of equal length"
        )
    return row


def _fault_of_row(line: _Line, path: Path, *, is_first: bool) -> InputError:
    """Return the error for a line with a field that is no number.

    A first row that reads "label: value" is called a part of an unknown header.
    """
    word = next(text for text in line.fields if not _is_number(text))
    text = " ".join(line.fields)
    if is_first and word == line.fields[0] and ENTRY.fullmatch(text):
        return InputError(
            f"{path}, line {line.number}: {text[:40]!r} belongs to a header that is not"
            " known; put # before the lines of the header, and state lengths and units as"
            " options"
        )
    return _no_number(word, path, line.number)


def _fields(line: str) -> list[str]:
    """Split a line into fields, and replace decimal commas in them by points.

    Fields are separated by semicolons if there are any, otherwise by blanks or by commas. One more
    separator may end the line.
    """
    has_semicolons = ";" in line
    words = line.removesuffix(";").split(";") if has_semicolons else line.split()
    if "," not in line:
        return words
    have_decimal_commas = all(
        WITH_COMMA.fullmatch(word.strip()) or _is_number(word) for word in words
    )
    # A single word, as 1,2, is a row of two numbers.
    commas_separate = not have_decimal_commas or len(words) < 2
    if commas_separate and not has_semicolons:
        return line.removesuffix(",").split(",")
    if not have_decimal_commas:
        return words
    return [word.replace(",", ".") for word in words]


def _are_split(fields: list[str]) -> bool:
    """Tell whether fields are numbers that were split at their decimal commas, as `0,05,-0,5` is.

    They alternate between whole numbers and decimals. As `1,2,3,4` may also be four whole numbers,
    one field at least has to be impossible as a whole number: -0, 05 or 5e3.
    """
    whole_parts = fields[::2]
    decimals = fields[1::2]
    if len(whole_parts) != len(decimals):
        return False
    if not all(WHOLE.fullmatch(digits) for digits in whole_parts):
        return False
    if not all(DECIMALS.fullmatch(digits) for digits in decimals):
        return False
    if "-0" in whole_parts:
        return True
    return any(PLAIN_DECIMALS.match(digits) for digits in decimals)


def _are_numbers(fields: list[str]) -> bool:
    """Tell whether all fields are numbers; True for no field."""
    return all(_is_number(text) for text in fields)


def _is_number(field: str) -> bool:
    """Tell whether a field is a number in the notation of Python; nan and inf are numbers."""
    try:
        float(field)
    except ValueError:
        return False
    return True


def _no_number(field: str, path: Path, line: int) -> InputError:
    """Return the error for a field that is not a number, in the line with this number."""
    return InputError(
        f"{path}, line {line}: {repr(field.strip())[:40]} is not a number; give numbers"
        " separated by whitespace, commas or ';', and nan for a missing height"
    )
