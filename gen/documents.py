"""JSON documents that programs write for programs: checked before anything in them is used.

Somebody may have edited them, or sent them: a key that is missing, a text where a number should be
or a number that is none has to be named where it stands, not where it does its harm.
"""

import json
import os
import stat
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from gen.errors import InputError

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
        # A named pipe would be waited for: this opens it at once, and it is refused.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(descriptor, "rb") as file:
            found = os.fstat(descriptor)
            if not stat.S_ISREG(found.st_mode):
                raise InputError(f"{path} is no regular file")
            if found.st_size > largest:
                raise InputError(
                    f"{path} has {found.st_size} bytes; at most {largest} are read: move it away"
                )
            return file.read()
    except FileNotFoundError:
        raise
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        fault = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{path} cannot be read: {fault}") from None


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
    check(path, content, *kinds)
    # What was checked as JSON can be read as JSON, with the keys in their order.
    found: dict[str, Any] = json.loads(content)
    return found


def check(path: Path | str, content: bytes, *kinds: type[Document]) -> None:
    """Refuse JSON that holds none of some kinds; see `read`."""
    faults = []
    for kind in kinds:
        try:
            kind.model_validate_json(content)
        except ValidationError as error:
            faults.append(error.errors(include_url=False, include_input=False)[0])
        else:
            return
    key = ".".join(map(str, faults[0]["loc"]))
    where = f"{key}: " if key else ""
    raise InputError(
        f"{path} is damaged, or not written by this program ({where}{faults[0]['msg']}): move it"
        " away"
    )
