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

Row = dict[
    str, float | int | str
]  # one line of a table: values by the names of the columns

FORMULAS = (
    "=",
    "+",
    "-",
    "@",
    "\t",
    "\r",
    "\n",
)  # beginnings that a spreadsheet would compute


class Document(BaseModel):
    """The required keys of a document, declared with types and bounds; others are allowed."""

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)


def cell(value: object) -> object:
    """Return a value for a cell: no number that is not finite, and no formula (OWASP's advice)."""
    if isinstance(value, float) and not math.isfinite(value):
        return ""
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULAS) else value


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write one row or more, which have the same names, as CSV under a header with these names."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]))
    writer.writeheader()
    writer.writerows({name: cell(value) for name, value in row.items()} for row in rows)
    write(path, text.getvalue())


def json_text(content: dict[str, Any]) -> str:
    """Return a JSON document with its keys and values, all of whose numbers must be finite."""
    text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
    return text.encode(errors="replace").decode() + "\n"


def read(path: Path, kind: type[Document]) -> dict[str, Any] | None:
    """Read a JSON document of a kind; None if there is no file. Errors as of `checked`."""
    try:
        content = read_bytes(path)
    except FileNotFoundError:
        return None
    return parse(path, content, kind)


def parse(path: Path | str, content: bytes, kind: type[Document]) -> dict[str, Any]:
    """Parse a JSON object of a kind; an InputError has the document's name, the key, its fault."""
    try:
        return kind.model_validate_json(content).model_dump(exclude_unset=True)
    except ValidationError as error:
        fault = error.errors(include_url=False, include_input=False)[0]
    key = ".".join(map(str, fault["loc"]))
    raise InputError(
        f"{path} is damaged: it cannot be read as what this program writes"
        f" ({f'{key}: ' if key else ''}{fault['msg']}): move it away"
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
    present = [
        name.strip("# ") for name in reader.fieldnames or []
    ]  # as np.savetxt writes them
    reader.fieldnames = present
    missing = [name for name in names if name not in present]
    if missing:
        raise InputError(
            f"{path}: has no column {', '.join(missing)}; it has {quoted(', '.join(present))}"
        )
    rows = []
    for row in reader:
        try:
            numbers = [float(row[name]) for name in names]
        except (TypeError, ValueError):
            numbers = [math.nan]
        if not all(map(math.isfinite, numbers)):
            raise InputError(
                f"{path}, line {reader.line_num}: {', '.join(names)} have to be finite numbers"
            )
        rows.append(numbers)
    if not rows:
        raise InputError(f"{path}: has a header and no rows")
    return np.array(rows).T
