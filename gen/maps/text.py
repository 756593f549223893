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
from dataclasses import replace
from pathlib import Path

import numpy as np

from gen.maps.scan import UNITS, Channel, Scan, choose_channel, factor_of, unit_of
from gen.maps.settings import Reading
from gen.runtime.errors import InputError

# labels of a header, in lower case, for each quantity that we read from it
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
# quantity of each label
MEANINGS = {
    word: meaning for meaning, words in LABELS.items() for word in words.split("|")
}

ENTRY = re.compile(r"(?P<label>[^:=：]{1,40}?)\s*[:=：]\s*(?P<value>.*)")
QUANTITY = re.compile(
    r"(?P<number>[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>.*)"
)
# name of a column with its unit: `x`, `X [mm]`, `Z_(microns)`, `y/um`, `x in nm`
NAME = re.compile(
    r"\W*(?P<name>[^\W\d_]+)[^\[(/]*?(?:(?:[\[(/]|\bin )\s*(?P<unit>[^\])]*)\W*)?"
)
HEIGHT = {"z", "h", "height", "heights"}  # names of columns of heights
# beginning of a field that is a number, or meant to be one
BEGINS = re.compile(r"\W*(\d|(nan|inf)\b)", re.IGNORECASE)
# control characters, none of which stands in a text file
CONTROL_CHARACTERS = re.compile("[\0-\x08\x0e-\x1f]")
WITH_COMMA = re.compile(r"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")  # number with a decimal comma
# both parts of such a number, split at its comma
WHOLE, DECIMALS = re.compile(r"[-+]?(0|[1-9]\d*)"), re.compile(r"\d+([eE][-+]?\d+)?")
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
# unit of length in a comment that we do not understand; the user is warned of it
SAYS_LENGTHS = re.compile(
    r"\b(mm|um|µm|μm|nm|microns?|micromet\w+|nanomet\w+|\d\s*m)\b|Å"
)


def _decoded(content: bytes) -> str | None:
    """Decode text in UTF-8 or UTF-16, of other encodings without foreign letters; else None."""
    encoding = "utf-8-sig"
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    elif b"\0" in content[:2]:
        encoding = "utf-16-be" if content[:1] == b"\0" else "utf-16-le"
    # The first letters are enough to tell the binary files of instruments, which may be large.
    if CONTROL_CHARACTERS.search(content[:4096].decode(encoding, errors="replace")):
        return None
    text = content.decode(encoding, errors="replace")
    return None if CONTROL_CHARACTERS.search(text) else text


def matrices(content: bytes, path: Path) -> list[Scan]:
    """Read the numbers of a text: a matrix, or one for each header of a channel; [] of no text."""
    if (text := _decoded(content)) is None:
        return []
    read: list[Scan] = []
    rows: list[list[float]] = []
    entries: dict[str, str] = {}
    remarks: list[str] = []
    for number, comment, fields in _lines(text, path):
        stated = _stated(comment)
        if rows and stated.keys() & {"channel", "width"}:
            read.append(_matrix(path, rows, entries, remarks))
            rows, entries, remarks = [], {}, []
        named = {} if rows or fields or stated else _columns(comment)
        if stated or named:
            entries = (stated or named) | entries
        elif SAYS_LENGTHS.search(comment):
            remarks.append(" ".join(comment.split())[:60])
        if fields:
            rows.append(_row(fields, path, number, rows))
    if rows or not read:  # a header at the end of a file has no numbers
        read.append(_matrix(path, rows, entries, remarks))
    return read


def _stated(comment: str) -> dict[str, str]:
    """Return the values of a line of a header by the quantities of `LABELS` that we know."""
    match = ENTRY.fullmatch(comment)
    if match is None:
        return {}
    meaning = MEANINGS.get(match["label"].lower(), "")
    return {meaning: match["value"].strip()} if meaning else {}


def chosen(path: Path, found: list[Scan], reading: Reading) -> Scan:
    """Return the matrix of the channel asked for, or the first with heights, x along axis 0."""
    overruled = reading.override_scale and bool(
        reading.unit
    )  # its unit need not be a length
    channels = [
        Channel(
            place,
            each.channel or f"matrix {place}",
            not each.unit or overruled or unit_of(each.unit) in UNITS,
            each.unit or "",
        )
        for place, each in enumerate(found)
    ]
    taken, origin = 0, ""
    if reading.channel or len(found) > 1 or not channels[0].heights:
        taken, origin = choose_channel(path, channels, reading)
    scan = found[taken]
    heights, widths, x_unit, y_unit = (
        scan.heights,
        scan.widths,
        scan.length_unit or "",
        scan.y_unit,
    )
    differ = bool(y_unit) and unit_of(y_unit) != unit_of(x_unit)
    if widths is not None:
        if differ:
            ratio = factor_of(y_unit, f"{path}: unit") / factor_of(
                x_unit, f"{path}: unit"
            )
            widths = widths[0], widths[1] * ratio
        heights = np.ascontiguousarray(heights.T)
        origin += " under a header, x along its lines"
    elif differ:
        raise InputError(
            f"{path}: has x in {x_unit} and y in {y_unit}; give both in one unit"
        )
    return replace(scan, heights=heights, widths=widths, origin=origin)


def _columns(line: str, place: str = "") -> dict[str, str]:
    """Return names and units of columns x, y and z as entries of a header; refuse a profile's."""
    words = _fields(re.sub(r"\s+(?=[\[(])", "", line))  # units set off by a blank
    matches = [NAME.fullmatch(word.strip()) for word in words]
    stated = [
        (match["name"].lower(), match["unit"]) if match else ("", "") for match in matches
    ]
    axes = [
        "z" if name in HEIGHT else name if name in {"x", "y"} else ""
        for name, _ in stated
    ]
    if sorted(filter(None, axes)) == ["x", "y", "z"]:
        keys = {"x": "x unit", "y": "y unit", "z": "value unit", "": "other unit"}
        units = {
            keys[axis]: unit for axis, (_, unit) in zip(axes, stated, strict=True) if unit
        }
        return units | {"columns of points": ",".join(axes)}
    if place and "x" in axes and 2 <= len(axes) <= 3:
        raise InputError(
            f"{place}: {', '.join(words)[:40]}: looks like the columns of a profile or of a list of"
            " points; give a map of heights, or points in columns x, y and z"
        )
    return {}


def _lines(content: str, path: Path) -> Iterator[tuple[int, str, list[str]]]:
    """Yield number, comment and fields of every line; words above the numbers are comments."""
    lines = LINE_END.split(content)
    first = next((line for line in lines if line.strip()), "")
    koala = KOALA.fullmatch(first) is not None
    bare, begun, titles = koala or BARE.match(first) is not None, False, 0
    for number, line in enumerate(lines, start=1):
        text, _, comment = line.partition("#")
        fields = _fields(text.strip())
        if bare and not all(map(_is_number, fields)):
            comment, fields = line, []
            if koala and not begun:
                yield from ((number, entry, []) for entry in _koala_entries(line))
                continue
        elif fields and not (
            begun or ENTRY.fullmatch(text.strip()) or any(map(BEGINS.match, fields))
        ):
            _columns(text, f"{path}, line {number}")
            comment, fields, titles = text, [], titles or number
        if "," in text and _are_split(fields):
            raise InputError(
                f"{path}, line {number}: {text.strip()[:20]!r}: its commas look like decimal commas"
                " as well as separators; separate the numbers by ';', tabs or blanks"
            )
        begun = begun or bool(fields)
        if fields or comment.strip():
            yield number, comment.strip(), fields
    if titles and not begun:  # words alone
        raise _no_number(lines[titles - 1].split()[0], path, titles)


def _koala_entries(line: str) -> Iterator[str]:
    """Yield the entries of a line of Koala's header under the labels of `LABELS`."""
    if KOALA.fullmatch(line):
        for label, count in KOALA_COUNT.findall(line):
            yield f"{'y' if label.lower() == 'h' else 'x'}-pixels = {count}"
        return
    match = ENTRY.fullmatch(line.strip())
    label = match["label"].lower() if match else ""
    if match and label == "pixel size":
        yield f"scale x = {match['value']}"
        yield f"scale y = {match['value']}"
    elif match and (factor := KOALA_FACTOR.fullmatch(label)):
        yield f"conversion factor = {match['value']} {factor['unit']}"
    else:
        yield line.strip()


def _matrix(
    path: Path, rows: list[list[float]], entries: dict[str, str], remarks: list[str]
) -> Scan:
    """Return the numbers under a header; refuse more or fewer of them than it states."""
    numbers = np.array(rows, dtype=np.float64)
    found = numbers.shape
    if min(found) < 2:
        held = " x ".join(map(str, found)) if rows else "no"
        raise InputError(f"{path}: holds {held} heights; give 2-D heights, 2 x 2 or more")
    widths, axis_units = _widths(entries, found)
    if widths is None:  # for example, one of the two lengths is missing
        halves = [
            f"{name}: {entries[name]}" for name in ("width", "height") if name in entries
        ]
        remarks = halves + remarks
    stated = [_quantity(entries.get(name, ""))[0] for name in ("lines", "columns")]
    # Without lengths the header may be somebody's own, with x down the columns, as in our files.
    allowed = [found] if widths else [found, found[::-1]]
    if not any(
        all(a in {0, b} for a, b in zip(stated, shape, strict=True)) for shape in allowed
    ):
        lines, columns = (f"{length:g}" if length else "?" for length in stated)
        raise InputError(
            f"{path}: its header states {lines} lines of {columns} numbers, it holds"
            f" {' of '.join(map(str, found))}; give the whole file"
        )
    if entries.get("to be scaled", "").lower() in {"yes", "1", "true"}:
        raise InputError(
            f"{path}: its header says that its numbers are to be scaled (DataScaleNeeded), which is"
            " not read; give heights in units of length"
        )
    factor, unit = _scale(path, entries)
    names = (
        tuple(entries["columns of points"].split(","))
        if "columns of points" in entries
        else ()
    )
    x_unit, y_unit = axis_units
    return Scan(
        numbers,
        widths,
        unit,
        x_unit or None,
        remarks=tuple(remarks[:3]),
        channel=entries.get("channel", ""),
        factor=factor,
        names=names,
        y_unit=y_unit,
    )


def _scale(path: Path, entries: dict[str, str]) -> tuple[float, str]:
    """Return the factor of the numbers, and the unit of the heights that they then are."""
    if "conversion" in entries:
        factor, unit = _quantity(entries["conversion"])
        data_unit = _unit(entries.get("data unit", ""))
        if unit_of(data_unit) in UNITS and factor != 1.0:
            raise InputError(
                f"{path}: its header states numbers in {data_unit} as well as a height conversion"
                f" factor of {factor:g}; delete the line that does not hold"
            )
        return factor or 1.0, unit
    if "value unit" in entries:
        return 1.0, _unit(entries["value unit"])
    if "nm per value" in entries:
        return _quantity(entries["nm per value"])[0] or 1.0, "nm"
    return 1.0, _unit(entries.get("data unit", ""))


def _widths(
    entries: dict[str, str], shape: tuple[int, ...]
) -> tuple[tuple[float, float] | None, tuple[str, str]]:
    """Return the lengths along the lines and across them, None if one is missing; their units."""
    spaced = "x spacing" in entries
    names = ("x spacing", "y spacing") if spaced else ("width", "height")
    (width, x_unit), (height, y_unit) = (
        _quantity(entries.get(name, "")) for name in names
    )
    if not (0 < width < math.inf and 0 < height < math.inf):
        return None, (entries.get("x unit", ""), entries.get("y unit", ""))
    if spaced:
        width, height = width * shape[1], height * shape[0]
    usual = "nm" if "format" in entries else ""  # SPIP states no unit of lengths
    x_unit = x_unit or _unit(entries.get("x unit", "")) or usual
    y_unit = y_unit or _unit(entries.get("y unit", "")) or x_unit
    return (width, height), (x_unit, y_unit)


def _quantity(text: str) -> tuple[float, str]:
    """Return number and unit of a value in a header, (0, "") if it holds no number."""
    match = QUANTITY.fullmatch(text)
    if match is None:
        return 0.0, ""
    return float(match["number"].replace(",", ".")), _unit(match["unit"])


def _unit(text: str) -> str:
    """Strip brackets from a unit, and mend a micro sign in a foreign encoding."""
    return text.strip(" []()").replace("\ufffdm", "µm")


def _row(
    fields: list[str], path: Path, line: int, above: list[list[float]]
) -> list[float]:
    """Return the numbers of one line, as many as in those above; a corner may be a word."""
    if not above and len(fields) > 3 and all(map(_is_number, fields[1:])):
        fields = [fields[0] if _is_number(fields[0]) else "nan", *fields[1:]]
    try:
        row = [float(field) for field in fields]
    except ValueError:
        wrong = next(field for field in fields if not _is_number(field))
        text = " ".join(fields)
        if not above and wrong == fields[0] and ENTRY.fullmatch(text):
            raise InputError(
                f"{path}, line {line}: {text[:40]!r} belongs to a header that is not known; put #"
                " before the lines of the header, and state lengths and units as options"
            ) from None
        raise _no_number(wrong, path, line) from None
    if above and len(row) != len(above[0]):
        raise InputError(
            f"{path}, line {line}: {len(row)} numbers where the first row has {len(above[0])};"
            " give rows of equal length"
        )
    return row


def _fields(line: str) -> list[str]:
    """Split a line into fields; a separator may end the line, and commas may be decimal."""
    words = line.removesuffix(";").split(";") if ";" in line else line.split()
    if "," not in line:
        return words
    decimal = all(
        WITH_COMMA.fullmatch(each.strip()) or _is_number(each) for each in words
    )
    if ";" not in line and not (decimal and len(words) > 1):
        return line.removesuffix(",").split(",")
    return [each.replace(",", ".") for each in words] if decimal else words


def _are_split(fields: list[str]) -> bool:
    """Tell whether fields are numbers split at their decimal commas, as `0,05,-0,5` is."""
    wholes, decimals = fields[::2], fields[1::2]
    return (
        len(wholes) == len(decimals)
        and all(map(WHOLE.fullmatch, wholes))
        and all(map(DECIMALS.fullmatch, decimals))
        and ("-0" in wholes or any(re.match(r"0\d|\d+[eE]", part) for part in decimals))
    )


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _no_number(field: str, path: Path, line: int) -> InputError:
    """Return the error for a field that is not a number."""
    return InputError(
        f"{path}, line {line}: {repr(field.strip())[:40]} is not a number; give numbers separated"
        " by whitespace, commas or ';', and nan for a missing height"
    )
