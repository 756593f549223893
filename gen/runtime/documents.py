"""Tables (CSV) for other programs, and JSON documents, which are checked before they are used."""

import csv
import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, ValidationError

from gen.runtime.errors import InputError
from gen.runtime.files import read_bytes, write
from gen.runtime.terminal import quoted

if TYPE_CHECKING:
    from gen.arrays import Values

Row = dict[str, float | int | str]
"""One line of a table: for each column's name the value of its cell."""

FORMULAS = ("=", "+", "-", "@", "\t", "\r", "\n")
"""Beginnings of texts that a spreadsheet would compute."""


class Document(BaseModel):
    """Kind of a JSON document: its fields are the required keys, with their types and bounds.

    A document may have further keys.
    """

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)


def cell(value: object) -> object:
    """Return a value as a cell of a CSV table holds it.

    Parameters
    ----------
    value : object
        Number, text or anything else with a text.

    Returns
    -------
    object
        An empty text for a number that is not finite. A text that a spreadsheet would compute gets
        an apostrophe before it, as OWASP advises. Any other value is returned unchanged.
    """
    if isinstance(value, float) and not math.isfinite(value):
        return ""
    if isinstance(value, str) and value.startswith(FORMULAS):
        return f"'{value}"
    return value


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as a CSV table with a header; the file is written as by `files.write`.

    Parameters
    ----------
    path : Path
        The file.
    rows : sequence of Row
        One row or more. The first one gives the columns, and all have the same.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]))
    writer.writeheader()
    for row in rows:
        writer.writerow({name: cell(value) for name, value in row.items()})
    write(path, text.getvalue())


def json_text(content: dict[str, Any]) -> str:
    """Return the text of a JSON document.

    Parameters
    ----------
    content : dict
        Keys and values; all numbers are finite.

    Returns
    -------
    str
        Indented text with a line end; letters that UTF-8 cannot hold are "?".

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
    return text.encode(errors="replace").decode() + "\n"


def read(path: Path, kind: type[Document]) -> dict[str, Any] | None:
    """Read a JSON document, which may be missing.

    Parameters
    ----------
    path : Path
        The file.
    kind : type of Document
        Keys that the document has to have.

    Returns
    -------
    dict or None
        All keys and values of the document, or None if there is no such file.

    Raises
    ------
    InputError
        If the file cannot be read, or is no document of this kind.
    """
    try:
        content = read_bytes(path)
    except FileNotFoundError:
        return None
    return parse(path, content, kind)


def parse(path: Path | str, content: bytes, kind: type[Document]) -> dict[str, Any]:
    """Parse the content of a JSON document.

    Parameters
    ----------
    path : Path or str
        Name of the document, for the message of an error.
    content : bytes
        Text of a JSON object.
    kind : type of Document
        Keys that the document has to have.

    Returns
    -------
    dict
        All keys and values of the document.

    Raises
    ------
    InputError
        If the content is no document of this kind; the message has the key and its fault.
    """
    try:
        document = kind.model_validate_json(content)
    except ValidationError as error:
        fault = error.errors(include_url=False, include_input=False)[0]
    else:
        return document.model_dump(exclude_unset=True)
    words = str(fault["msg"])
    key = ".".join(map(str, fault["loc"]))
    if key:
        words = f"{key}: {words}"
    raise InputError(
        f"{path} is damaged: it cannot be read as what this program writes ({words}):"
        " move it away"
    )


def read_columns(path: Path | str, *names: str) -> "Values":
    """Read columns of finite numbers of a CSV table whose first line has their names.

    Parameters
    ----------
    path : Path or str
        The table; it may have further columns.
    *names : str
        Names of the columns.

    Returns
    -------
    ndarray, shape (columns, rows)
        The numbers, of one row at least.

    Raises
    ------
    InputError
        If the table cannot be read, lacks a column or any row, or a cell is no finite number.
    FileNotFoundError
        If there is no such file.
    """
    import numpy as np  # here, so that --help does not wait for it

    lines = read_bytes(Path(path)).decode("utf-8-sig", errors="replace").splitlines()
    reader = csv.DictReader(lines, skipinitialspace=True)
    # np.savetxt writes "# " before the first name.
    columns = [name.strip("# ") for name in reader.fieldnames or []]
    reader.fieldnames = columns
    missing = [name for name in names if name not in columns]
    if missing:
        raise InputError(
            f"{path}: has no column {', '.join(missing)}; it has {quoted(', '.join(columns))}"
        )
    rows = []
    for row in reader:
        numbers = _numbers(row, names)
        if not all(map(math.isfinite, numbers)):
            raise InputError(
                f"{path}, line {reader.line_num}: {', '.join(names)} have to be finite numbers"
            )
        rows.append(numbers)
    if not rows:
        raise InputError(f"{path}: has a header and no rows")
    return np.array(rows).T


def _numbers(row: dict[str, Any], names: Sequence[str]) -> list[float]:
    """Return the numbers in some columns of a row, or a single NaN if a cell is missing or none."""
    try:
        return [float(row[name]) for name in names]
    except (TypeError, ValueError):
        return [math.nan]
