"""Read numbers from text, with the headers that microscopes' programs write above them.

Headers of Gwyddion's ASCII export (in all its languages), of SPIP, Attocube, Nova, WSxM and Koala
are understood. In all of these, x runs along the lines. `gen.maps.scan` tells whether the numbers
are heights or coordinates.
"""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gen.maps.scan import (
    UNITS,
    Channel,
    ChosenChannel,
    Scan,
    choose_channel,
    factor_of,
    unit_of,
)
from gen.maps.settings import Reading
from gen.runtime.errors import InputError

# labels of a header, in lower case, for each quantity that is read from it
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
# quantity of `LABELS` for each label
MEANINGS = {
    label: meaning for meaning, labels in LABELS.items() for label in labels.split("|")
}

ENTRY = re.compile(r"(?P<label>[^:=：]{1,40}?)\s*[:=：]\s*(?P<value>.*)")
QUANTITY = re.compile(
    r"(?P<number>[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>.*)"
)
# blanks in front of a bracket, which set off the unit of a column's name
UNIT_SET_OFF = re.compile(r"\s+(?=[\[(])")
# name of a column with its unit: `x`, `X [mm]`, `Z_(microns)`, `y/um`, `x in nm`
NAME = re.compile(
    r"\W*(?P<name>[^\W\d_]+)[^\[(/]*?(?:(?:[\[(/]|\bin )\s*(?P<unit>[^\])]*)\W*)?"
)
HEIGHT = {"z", "h", "height", "heights"}  # names of columns of heights
# beginning of a field that is a number, or meant to be one
BEGINS = re.compile(r"\W*(\d|(nan|inf)\b)", re.IGNORECASE)
# most letters of a comment that a warning quotes
QUOTED = 60
# most comments that warnings quote
MOST_REMARKS = 3
# control characters, none of which stands in a text file
CONTROL_CHARACTERS = re.compile("[\0-\x08\x0e-\x1f]")
WITH_COMMA = re.compile(r"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")  # number with a decimal comma
# both parts of such a number, split at its comma
WHOLE = re.compile(r"[-+]?(0|[1-9]\d*)")
DECIMALS = re.compile(r"\d+([eE][-+]?\d+)?")
# beginning of decimals, as 05 or 5e3, that no whole number has: their comma is a decimal one
PLAIN_DECIMALS = re.compile(r"0\d|\d+[eE]")
# first line of files whose header has no `#` in front
BARE = re.compile(r"\s*(File Format\s*=|WSxM file)", re.IGNORECASE)
# first line of Koala's header, with the numbers of lines and of values in a line: `h=305 w=400`
KOALA = re.compile(r"\s*[hw]\s*=\s*\d+(\s+[hw]\s*=\s*\d+)?\s*", re.IGNORECASE)
# parts of that line, and the unit of length in the label of Koala's conversion factor
KOALA_COUNT = re.compile(r"([hw])\s*=\s*(\d+)", re.IGNORECASE)
KOALA_FACTOR = re.compile(
    r"height conversion factor \(->\s*(?P<unit>[^)]+)\)", re.IGNORECASE
)
# ends of lines as editors count them: some programs write a second carriage return
LINE_END = re.compile(r"\r*\n|\r")
# unit of length in a comment that is not understood; the user is warned of it
SAYS_LENGTHS = re.compile(
    r"\b(mm|um|µm|μm|nm|microns?|micromet\w+|nanomet\w+|\d\s*m)\b|Å"
)


class _Line(NamedTuple):
    """A line of a text, split into what it holds; a plain tuple, as there are many."""

    number: int  # number of the line, as editors count
    comment: str  # comment, entry of a header, or words, without blanks around it
    fields: list[str]  # fields that are meant to be numbers


@dataclass
class _Block:
    """The numbers under one header, and what the header says."""

    rows: list[list[float]] = field(default_factory=list)
    # values by the quantities of `LABELS`; the first value of a quantity counts
    entries: dict[str, str] = field(default_factory=dict)
    # comments that name a unit of length and are not understood
    remarks: list[str] = field(default_factory=list)

    def add_comment(self, line: _Line, entry: dict[str, str]) -> None:
        """Add the entry of a line, the names of columns, or else a comment that names a length.

        Names of columns count only above the numbers, on a line without numbers.
        """
        if not entry and not self.rows and not line.fields:
            entry = _column_entries(_columns(line.comment))
        if entry:
            self.entries = entry | self.entries
        elif SAYS_LENGTHS.search(line.comment):
            self.remarks.append(" ".join(line.comment.split())[:QUOTED])


@dataclass(frozen=True)
class _Quantity:
    """A value of a header."""

    number: float = 0.0  # 0 if the value holds no number
    unit: str = ""  # "" if the value names none


@dataclass(frozen=True)
class _Extent:
    """What a header says of the lengths of a map."""

    # lengths along the lines and across them [x_unit, y_unit]; None if one is missing
    widths: tuple[float, float] | None
    x_unit: str  # "" if the header names none
    y_unit: str


def read_matrices(content: bytes, path: Path) -> list[Scan]:
    """Read the numbers of a text: one matrix, or one for each header of a channel.

    Parameters
    ----------
    content : bytes
        The content of the file.
    path : Path
        The file, for messages.

    Returns
    -------
    list of Scan
        The matrices, with lines along axis 0 and the lengths and units that their headers state;
        an empty list if the content is no text.

    Raises
    ------
    InputError
        If a field is no number, rows differ in length, a matrix is smaller than 2 x 2, or a header
        contradicts its numbers.
    """
    text = _decoded(content)
    if text is None:
        return []
    scans: list[Scan] = []
    block = _Block()
    for line in _lines(text, path):
        if line.comment:
            entry = _entry(line.comment)
            if block.rows and entry.keys() & {"channel", "width"}:
                scans.append(_matrix(path, block))
                block = _Block()
            block.add_comment(line, entry)
        if line.fields:
            block.rows.append(_row(line, path, block.rows))
    if block.rows or not scans:  # a header at the end of a file has no numbers
        scans.append(_matrix(path, block))
    return scans


def choose_matrix(path: Path, matrices: list[Scan], reading: Reading) -> Scan:
    """Choose the matrix of a channel, and transpose it if its header states lengths.

    In such texts x runs along the lines, in maps along axis 0.

    Parameters
    ----------
    path : Path
        The file, for messages.
    matrices : list of Scan
        The matrices of the file, at least one.
    reading : Reading
        The settings, of which `channel` names the matrix; without it the first one with heights is
        chosen. A unit that overrules the file's makes heights of any numbers.

    Returns
    -------
    Scan
        The matrix, with both lengths in the unit of the length along x.

    Raises
    ------
    InputError
        If no matrix has heights, the channel is unknown, or x and y have different units without
        lengths.
    """
    overruled = reading.override_scale and bool(reading.unit)
    channels = [
        _channel(index, scan, overruled=overruled) for index, scan in enumerate(matrices)
    ]
    chosen = ChosenChannel(0, "")
    if reading.channel or len(matrices) > 1 or not channels[0].heights:
        chosen = choose_channel(path, channels, reading)
    scan = matrices[chosen.index]
    x_unit = scan.length_unit or ""
    y_unit = scan.y_unit or x_unit
    same_unit = unit_of(y_unit) == unit_of(x_unit)
    if scan.widths is None:
        if not same_unit:
            raise InputError(
                f"{path}: has x in {x_unit} and y in {y_unit}; give both in one unit"
            )
        return replace(scan, origin=chosen.origin)
    width, length = scan.widths
    if not same_unit:
        in_um = factor_of(y_unit, f"{path}: unit")
        length *= in_um / factor_of(x_unit, f"{path}: unit")
    return replace(
        scan,
        heights=np.ascontiguousarray(scan.heights.T),
        widths=(width, length),
        origin=f"{chosen.origin} under a header, x along its lines",
    )


def _channel(index: int, scan: Scan, *, overruled: bool) -> Channel:
    """Describe a matrix as a channel; its unit need not be one of length if it is overruled."""
    is_height = not scan.unit or overruled or unit_of(scan.unit) in UNITS
    return Channel(index, scan.channel or f"matrix {index}", is_height, scan.unit or "")


def _decoded(content: bytes) -> str | None:
    """Decode a text in UTF-8, UTF-16 or an encoding that extends ASCII; None if it is no text.

    Letters that are not ASCII become U+FFFD in encodings other than UTF-8 and UTF-16.
    """
    encoding = "utf-8-sig"
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    elif content[:1] == b"\0":
        encoding = "utf-16-be"
    elif content[1:2] == b"\0":
        encoding = "utf-16-le"
    # The first letters are enough to tell the binary files of instruments, which may be large.
    if CONTROL_CHARACTERS.search(content[:4096].decode(encoding, errors="replace")):
        return None
    text = content.decode(encoding, errors="replace")
    if CONTROL_CHARACTERS.search(text):
        return None
    return text


def _entry(comment: str) -> dict[str, str]:
    """Return the value of a header's line by its quantity in `LABELS`; {} if it has none."""
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

    text: str  # the name as the file has it
    axis: str  # coordinate in the column: "x", "y" or "z"; "" for another quantity
    unit: str  # unit in the name, "" if there is none


def _columns(line: str) -> list[_Column]:
    """Return the columns that the words of a line may name."""
    words = _fields(UNIT_SET_OFF.sub("", line))
    return [_column(word) for word in words]


def _column(word: str) -> _Column:
    """Return the column that a word may name."""
    match = NAME.fullmatch(word.strip())
    if match is None:
        return _Column(word, "", "")
    name = match["name"].lower()
    axis = ""
    if name in HEIGHT:
        axis = "z"
    elif name in {"x", "y"}:
        axis = name
    return _Column(word, axis, match["unit"] or "")


# entry of a header for the unit of each kind of column
UNIT_ENTRIES = {"x": "x unit", "y": "y unit", "z": "value unit", "": "other unit"}


def _column_entries(columns: list[_Column]) -> dict[str, str]:
    """Return units and order of columns as entries of a header; {} unless they are x, y and z."""
    axes = [column.axis for column in columns]
    if sorted(axis for axis in axes if axis) != ["x", "y", "z"]:
        return {}
    entries = {
        UNIT_ENTRIES[column.axis]: column.unit for column in columns if column.unit
    }
    return entries | {"columns of points": ",".join(axes)}


def _refuse_profile(line: str, place: str) -> None:
    """Refuse a title with the columns of a profile or of an incomplete list of points."""
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
    """Yield every line that is not empty; words above the numbers are comments."""
    lines = LINE_END.split(content)
    first = next((line for line in lines if line.strip()), "")
    if KOALA.fullmatch(first):
        yield from _koala_lines(lines, path)
    elif BARE.match(first):
        yield from _bare_lines(lines, path)
    else:
        yield from _marked_lines(lines, path)


def _marked_lines(lines: list[str], path: Path) -> Iterator[_Line]:
    """Yield the lines of a text whose comments begin with #; words above the numbers are comments.

    A text that holds words alone is refused, with its first word.
    """
    has_numbers = False
    first_title = 0
    for number, text in enumerate(lines, start=1):
        line = _split_line(number, text, path)
        if line.fields and not has_numbers:
            words = text.partition("#")[0]
            if _is_title(words.strip(), line.fields):
                _refuse_profile(words, f"{path}, line {number}")
                line = _Line(number, words.strip(), [])
                first_title = first_title or number
            else:
                has_numbers = True
        if line.fields or line.comment:
            yield line
    if first_title and not has_numbers:
        word = lines[first_title - 1].split()[0]
        raise _no_number(word, path, first_title)


def _is_title(text: str, fields: list[str]) -> bool:
    """Tell whether a line is a title: no entry of a header, and no field begins as numbers do."""
    if ENTRY.fullmatch(text):
        return False
    return not any(BEGINS.match(word) for word in fields)


def _bare_lines(lines: list[str], path: Path) -> Iterator[_Line]:
    """Yield the lines of a text with a header that has no # in front.

    A line with a field that is no number belongs to the header.
    """
    for number, text in enumerate(lines, start=1):
        line = _split_line(number, text, path)
        if not _are_numbers(line.fields):
            line = _Line(number, text.strip(), [])
        if line.fields or line.comment:
            yield line


def _koala_lines(lines: list[str], path: Path) -> Iterator[_Line]:
    """Yield the lines of Koala's text: its entries under the labels of `LABELS`, then numbers."""
    has_numbers = False
    for line in _bare_lines(lines, path):
        has_numbers = has_numbers or bool(line.fields)
        text = lines[line.number - 1]
        if has_numbers or text.lstrip().startswith("#"):
            yield line
            continue
        for entry in _koala_entries(text):
            yield _Line(line.number, entry, [])


def _koala_entries(line: str) -> list[str]:
    """Return the entries of a line of Koala's header under the labels of `LABELS`."""
    if KOALA.fullmatch(line):
        counts = KOALA_COUNT.findall(line)
        axes = {"h": "y", "w": "x"}
        return [f"{axes[label.lower()]}-pixels = {count}" for label, count in counts]
    match = ENTRY.fullmatch(line.strip())
    if match is None:
        return [line.strip()]
    label = match["label"].lower()
    if label == "pixel size":
        return [f"scale x = {match['value']}", f"scale y = {match['value']}"]
    factor = KOALA_FACTOR.fullmatch(label)
    if factor:
        return [f"conversion factor = {match['value']} {factor['unit']}"]
    return [line.strip()]


def _split_line(number: int, line: str, path: Path) -> _Line:
    """Split a line into fields and a comment.

    Fields that commas separate although their decimals have commas, too, are refused.
    """
    text, _, comment = line.partition("#")
    text = text.strip()
    fields = _fields(text)
    if "," in text and _are_split(fields):
        raise InputError(
            f"{path}, line {number}: {text[:20]!r}: its commas look like decimal commas"
            " as well as separators; separate the numbers by ';', tabs or blanks"
        )
    return _Line(number, comment.strip(), fields)


def _matrix(path: Path, block: _Block) -> Scan:
    """Return the numbers under a header; refuse more or fewer numbers than it states."""
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
    remarks = block.remarks
    if extent.widths is None:  # for example, one of the two lengths is missing
        single = [name for name in ("width", "height") if name in entries]
        remarks = [f"{name}: {entries[name]}" for name in single] + remarks
    _require_counts(path, entries, numbers.shape, has_lengths=extent.widths is not None)
    if entries.get("to be scaled", "").lower() in {"yes", "1", "true"}:
        raise InputError(
            f"{path}: its header says that its numbers are to be scaled"
            " (DataScaleNeeded), which is not read; give heights in units of length"
        )
    scale = _scale(path, entries)
    names: tuple[str, ...] = ()
    if "columns of points" in entries:
        names = tuple(entries["columns of points"].split(","))
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
    """Refuse a matrix of another shape than its header states, if it states one.

    Without lengths the header may be somebody's own, with x down the columns as in .npy files, and
    counts may be the other way round.
    """
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
    """Write a number that a header states, "?" for one that it does not."""
    return f"{count:g}" if count else "?"


def _scale(path: Path, entries: dict[str, str]) -> _Quantity:
    """Return the factor of the numbers, and the unit of the heights that they then are."""
    data_unit = _unit(entries.get("data unit", ""))
    if "conversion" in entries:
        conversion = _quantity(entries["conversion"])
        factor = conversion.number
        if unit_of(data_unit) in UNITS and factor != 1.0:
            raise InputError(
                f"{path}: its header states numbers in {data_unit} as well as a height"
                f" conversion factor of {factor:g}; delete the line that does not hold"
            )
        return _Quantity(factor or 1.0, conversion.unit)
    if "value unit" in entries:
        return _Quantity(1.0, _unit(entries["value unit"]))
    if "nm per value" in entries:
        factor = _quantity(entries["nm per value"]).number
        return _Quantity(factor or 1.0, "nm")
    return _Quantity(1.0, data_unit)


def _extent(entries: dict[str, str], shape: tuple[int, ...]) -> _Extent:
    """Return the lengths of a matrix of (lines, columns), from lengths or spacings of a header."""
    x_unit = entries.get("x unit", "")
    y_unit = entries.get("y unit", "")
    if "x spacing" in entries:
        along = _quantity(entries["x spacing"])
        across = _quantity(entries.get("y spacing", ""))
        lines, columns = shape
    else:
        along = _quantity(entries.get("width", ""))
        across = _quantity(entries.get("height", ""))
        lines, columns = 1, 1
    if not (0 < along.number < math.inf and 0 < across.number < math.inf):
        return _Extent(None, x_unit, y_unit)
    usual = "nm" if "format" in entries else ""  # SPIP states no unit of lengths
    x_unit = along.unit or _unit(x_unit) or usual
    y_unit = across.unit or _unit(y_unit) or x_unit
    return _Extent((along.number * columns, across.number * lines), x_unit, y_unit)


def _quantity(text: str) -> _Quantity:
    """Return number and unit of a value in a header."""
    match = QUANTITY.fullmatch(text)
    if match is None:
        return _Quantity()
    return _Quantity(float(match["number"].replace(",", ".")), _unit(match["unit"]))


def _unit(text: str) -> str:
    """Strip brackets from a unit, and mend a micro sign in a foreign encoding."""
    return text.strip(" []()").replace("\ufffdm", "µm")


def _row(line: _Line, path: Path, rows: list[list[float]]) -> list[float]:
    """Return the numbers of a line, as many as in the rows above it; refuse words.

    In the first row, a word in the corner above row numbers or coordinates stands for no number.
    """
    fields = line.fields
    is_first_row = not rows and len(fields) > 3
    if is_first_row and not _is_number(fields[0]) and _are_numbers(fields[1:]):
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
    """Return the error for a line with a field that is no number, perhaps of an unknown header."""
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
    """Split a line into fields; a separator may end the line, and commas may be decimal."""
    words = line.removesuffix(";").split(";") if ";" in line else line.split()
    if "," not in line:
        return words
    decimal = all(
        WITH_COMMA.fullmatch(word.strip()) or _is_number(word) for word in words
    )
    commas_separate = not decimal or len(words) < 2
    if ";" not in line and commas_separate:
        return line.removesuffix(",").split(",")
    if not decimal:
        return words
    return [word.replace(",", ".") for word in words]


def _are_split(fields: list[str]) -> bool:
    """Tell whether fields are numbers split at their decimal commas, as `0,05,-0,5` is."""
    wholes = fields[::2]
    decimals = fields[1::2]
    if len(wholes) != len(decimals):
        return False
    if not all(WHOLE.fullmatch(digits) for digits in wholes):
        return False
    if not all(DECIMALS.fullmatch(digits) for digits in decimals):
        return False
    return "-0" in wholes or any(PLAIN_DECIMALS.match(digits) for digits in decimals)


def _are_numbers(fields: list[str]) -> bool:
    """Tell whether all fields are numbers."""
    return all(_is_number(text) for text in fields)


def _is_number(field: str) -> bool:
    """Tell whether a field is a number."""
    try:
        float(field)
    except ValueError:
        return False
    return True


def _no_number(field: str, path: Path, line: int) -> InputError:
    """Return the error for a field that is not a number."""
    return InputError(
        f"{path}, line {line}: {repr(field.strip())[:40]} is not a number; give numbers"
        " separated by whitespace, commas or ';', and nan for a missing height"
    )
