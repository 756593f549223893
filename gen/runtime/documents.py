"""Tables (CSV) for other programs, and JSON documents, which are checked before they are used.

Somebody may have edited or sent a document. A missing key, a text in place of a number or a number
that is not finite is named here, before it can do harm.
"""

import csv
import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from gen.runtime.errors import InputError
from gen.runtime.files import require_file, write

LARGEST = 64 * 2**20
"""Most bytes of a document; those of this project have some thousands."""

Row = dict[str, float | int | str]
"""One line of a table: values by the names of the columns."""

FORMULAS = ("=", "+", "-", "@", "\t", "\r", "\n")
"""First characters of a text that a spreadsheet would compute."""


class Document(BaseModel):
    """The required keys of a document; values are neither converted nor NaN, further keys allowed.

    Subclasses declare the keys with their types and bounds.
    """

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)


def cell(value: object) -> object:
    """Return a value for a cell: no formula, and nothing for a number that is not finite.

    Parameters
    ----------
    value : object
        Number or text. Texts that look like formulas get an apostrophe, which is OWASP's advice for
        texts from strangers.
    """
    if isinstance(value, float) and not math.isfinite(value):
        return ""
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULAS) else value


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV under a header with their names.

    Parameters
    ----------
    path : Path
        File to write.
    rows : sequence of dict
        Rows with the same names, at least one.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]))
    writer.writeheader()
    writer.writerows({name: cell(value) for name, value in row.items()} for row in rows)
    write(path, text.getvalue())


def text_of(content: dict[str, Any]) -> str:
    """Return the text of a document that strict readers take (RFC 8259).

    Names of files may hold bytes that are no UTF-8: each becomes a question mark.

    Parameters
    ----------
    content : dict
        Keys and values.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
    return text.encode(errors="replace").decode() + "\n"


def read_bytes(path: Path, largest: int = LARGEST) -> bytes:
    """Read a whole regular file.

    Parameters
    ----------
    path : Path
        File to read.
    largest : int
        Largest size that is accepted [bytes].

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    InputError
        If the path is no regular file, the file is larger, or it cannot be read.
    """
    try:
        size = require_file(path).stat().st_size
        if size > largest:
            raise InputError(f"{path} has {size} bytes; at most {largest} are read: move it away")
        return path.read_bytes()
    except OSError as error:
        if isinstance(error, FileNotFoundError):
            raise
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None


def read(path: Path, *kinds: type[Document]) -> dict[str, Any] | None:
    """Read a document and check it.

    Parameters
    ----------
    path : Path
        File with a JSON object.
    *kinds : type of Document
        Accepted kinds of documents; one of them has to fit.

    Returns
    -------
    dict, optional
        Keys and values of the document; None if the file does not exist.

    Raises
    ------
    InputError
        If the file cannot be read, or none of the kinds fits; the message names the key and the
        fault for the first kind.
    """
    try:
        content = read_bytes(path)
    except FileNotFoundError:
        return None
    return checked(path, content, *kinds)


def checked(path: Path | str, content: bytes, *kinds: type[Document]) -> dict[str, Any]:
    """Parse a JSON object and check it against the accepted kinds.

    Parameters
    ----------
    path : Path or str
        Name of the document, for messages.
    content : bytes
        JSON object.
    *kinds : type of Document
        Accepted kinds of documents; one of them has to fit.

    Returns
    -------
    dict
        Keys and values, numbers of the declared types.

    Raises
    ------
    InputError
        If none of the kinds fits.
    """
    faults = []
    for kind in kinds:
        try:
            document = kind.model_validate_json(content)
        except ValidationError as error:
            faults.append(error.errors(include_url=False, include_input=False)[0])
        else:
            return document.model_dump(exclude_unset=True)
    key = ".".join(map(str, faults[0]["loc"]))
    where = f"{key}: " if key else ""
    raise InputError(
        f"{path} is damaged: it cannot be read as what this program writes"
        f" ({where}{faults[0]['msg']}): move it away"
    )
