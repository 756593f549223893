"""JSON documents that programs write for programs: checked before anything in them is used.

Somebody may have edited them, or sent them: a key that is missing, a text where a number should be
or a number that is none has to be named where it stands, not where it does its harm.
"""

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file

LARGEST = 64 * 2**20
"""Bytes of a document at most; those of this project have some thousands."""


class Document(BaseModel):
    """What a document has to hold, without conversions and NaN; it may have more keys.

    A class of this kind says which keys there are, of what type, and between which bounds.
    """

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)


def read_bytes(path: Path, largest: int = LARGEST) -> bytes:
    """Read a regular file whole.

    Raises
    ------
    FileNotFoundError
        If there is none.
    InputError
        If it is anything else than a regular file, larger, or cannot be read.
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
    """Read a document; None if there is none.

    Parameters
    ----------
    path : JSON, an object
    kinds : what it may hold: one of these

    Raises
    ------
    InputError
        If it cannot be read, or holds something else; in one line, with the key and what is wrong
        for the first of the kinds.
    """
    try:
        content = read_bytes(path)
    except FileNotFoundError:
        return None
    return checked(path, content, *kinds)


def checked(path: Path | str, content: bytes, *kinds: type[Document]) -> dict[str, Any]:
    """Return what JSON holds, numbers of the wanted types; refuse what is none of some kinds.

    Parameters
    ----------
    path : what messages call it
    content : JSON, an object
    kinds : see `read`

    Raises
    ------
    InputError
        See `read`.
    """
    faults = []
    for kind in kinds:
        try:
            found = kind.model_validate_json(content)
        except ValidationError as error:
            faults.append(error.errors(include_url=False, include_input=False)[0])
        else:
            return found.model_dump(exclude_unset=True)
    key = ".".join(map(str, faults[0]["loc"]))
    where = f"{key}: " if key else ""
    raise InputError(
        f"{path} is damaged: it cannot be read as what this program writes"
        f" ({where}{faults[0]['msg']}): move it away"
    )
