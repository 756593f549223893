"""Write and read CSV tables, and JSON documents, which are checked when they are read."""

import csv
import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from gen.runtime.errors import InputError
from gen.runtime.files import read_bytes, write
from gen.runtime.terminal import quoted

if TYPE_CHECKING:
    from gen.arrays import Values

Row = dict[str, float | int | str]
"""One line of a table: the value of each cell, by the name of its column."""

FORMULAS = ("=", "+", "-", "@", "\t", "\r", "\n")
"""First characters of texts that a spreadsheet would take for a formula and compute."""


class Document(BaseModel):
    """Base class of the kinds of JSON documents.

    The fields of a subclass are the required keys of its documents, with their types and bounds. A
    document may have further keys.
    """

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)

    def content(self) -> dict[str, Any]:
        """Return all keys and values that the document was made with, further ones included."""
        return self.model_dump(exclude_unset=True)


Kind = TypeVar("Kind", bound=Document)


def cell(value: object) -> object:
    """Convert a value to the one that a cell of a CSV table holds.

    Parameters
    ----------
    value : object
        A number, a text, or any object that `str` turns into a text.

    Returns
    -------
    object
        "" for a float that is not finite. A text that begins with one of `FORMULAS` gets an
        apostrophe before it, as OWASP advises. Any other value is returned unchanged.
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
        At least one row. The columns are those of the first row, in its order. A row that lacks one
        of them gets an empty cell; no row may have further columns.

    Raises
    ------
    InputError
        If the file cannot be written.
    ValueError
        If a row has a column that the first row lacks.
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
        Values by key, as `json.dumps` takes them; all numbers must be finite.

    Returns
    -------
    str
        Indented text with a line end. Letters that UTF-8 cannot hold become "?".

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
    return text.encode(errors="replace").decode() + "\n"


def read(path: Path, kind: type[Kind]) -> Kind | None:
    """Read a JSON document if its file exists.

    Parameters
    ----------
    path : Path
        The file.
    kind : type of Document
        Subclass whose fields are the required keys.

    Returns
    -------
    Document or None
        The checked document, or None if there is no such file.

    Raises
    ------
    InputError
        If the file cannot be read, or is not a document of this kind.
    """
    try:
        content = read_bytes(path)
    except FileNotFoundError:
        return None
    return parse(path, content, kind)


def parse(path: Path | str, content: bytes, kind: type[Kind]) -> Kind:
    """Parse the content of a JSON document.

    Parameters
    ----------
    path : Path or str
        Name of the document, for messages.
    content : bytes
        Text of a JSON object.
    kind : type of Document
        Subclass whose fields are the required keys.

    Returns
    -------
    Document
        The checked document.

    Raises
    ------
    InputError
        If the content is not a document of this kind. The message names the first key that is wrong
        and its fault.
    """
    try:
        return kind.model_validate_json(content)
    except ValidationError as error:
        first_error = error.errors(include_url=False, include_input=False)[0]
    fault = str(first_error["msg"])
    key = ".".join(map(str, first_error["loc"]))
    if key:  # "" if the text is no JSON
        fault = f"{key}: {fault}"
    raise InputError(
        f"{path} is damaged: it cannot be read as what this program writes ({fault}):"
        " move it away"
    )


def read_columns(path: Path | str, *names: str) -> "Values":
    """Read some columns of numbers from a CSV table.

    Parameters
    ----------
    path : Path or str
        The table. Its first line has the names of its columns.
    *names : str
        Names of the columns to read, whose cells have to be finite numbers.

    Returns
    -------
    ndarray, shape (columns, rows)
        The numbers, one line for each of `names`, in their order; at least one row.

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
    # Without the "# " that `numpy.savetxt` writes in front of the first name.
    columns = [name.strip("# ") for name in reader.fieldnames or []]
    reader.fieldnames = columns
    missing = [name for name in names if name not in columns]
    if missing:
        raise InputError(
            f"{path}: has no column {', '.join(missing)}; it has {quoted(', '.join(columns))}"
        )
    rows = []
    for row in reader:
        numbers = _numbers(row, names)  # [NaN] if a cell is no number
        if not all(map(math.isfinite, numbers)):
            raise InputError(
                f"{path}, line {reader.line_num}: {', '.join(names)} have to be finite numbers"
            )
        rows.append(numbers)
    if not rows:
        raise InputError(f"{path}: has a header and no rows")
    return np.array(rows).T


def _numbers(row: dict[str, Any], names: Sequence[str]) -> list[float]:
    """Return the numbers in the columns `names` of a row, in their order.

    Returns a list of a single NaN if a cell is missing or is not a number.
    """
    try:
        return [float(row[name]) for name in names]
    except (TypeError, ValueError):
        return [math.nan]
