"""The file of a surrogate: a checksum, one text, and numbers; it names neither code nor types.

    asperity surrogate
    format 7
    sha256 of all that follows, in hexadecimal digits
    length of the text, 8 bytes, little endian
    text: JSON with the card, the parts of the models, type and shape of every array
    arrays, in their order, each from a multiple of 8 bytes on

The checksum detects damage. Against forged files the parts are checked by
`learn.surrogate.packing`. No part is larger in memory than in the file.
"""

import hashlib
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.runtime.errors import InputError
from gen.runtime.files import SURROGATE, atomic, require_file
from gen.runtime.terminal import printable, to_type

FORMAT = 7
"""Number of the layout that is written. A format number is raised whenever an older version would
misread a file: 4 has a pair of nodes, sides and spacings in the card, 5 features of the coarse
solve that 4 did not have, and intervals that are calibrated by groups, 6 moments that are held
inside their ranges, 7 distances from the nearest database, and intervals that grow with the
distance."""

PAIRED = 4
"""First format whose cards have pairs; those of format 3 have one number for both axes."""

READ = (3, 4, 5, 6, FORMAT)
"""Formats that are read."""

HEAD = re.compile(SURROGATE + rb"format (\d{1,9})\nsha256 ([0-9a-f]{64})\n")
OLDER = b"PK"
"""First bytes of formats 1 and 2, which were zip archives."""

PAIRS = ("nodes", "side", "spacing")
"""Entries of a card along x and y."""

KINDS = ("<f8", "<f4", "<i4")
"""Types of the arrays: double precision, single precision, whole numbers."""

STEP = 8
"""Arrays begin at multiples of this many bytes."""

LONGEST_TEXT = 2**24
"""Largest length of the text [bytes]; a card has some thousands."""

ARRAY = "array"
"""Key in the text that stands for an array; its value is the number of the array."""


def save(path: Path, card: dict[str, Any], parts: dict[str, Any]) -> None:
    """Write a surrogate, whole or not at all.

    Parameters
    ----------
    path : Path
        File to write; an older one is replaced only by a whole one.
    card : dict of str to object
        Texts, numbers, lists and dictionaries.
    parts : dict of str to object
        Numbers, lists and dictionaries, and arrays of the types of `KINDS`.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    arrays: list[NDArray[Any]] = []
    content = {"card": card, "parts": _without_arrays(parts, arrays)}
    text = json.dumps(content | {"arrays": [(each.dtype.str, each.shape) for each in arrays]})
    encoded = _padded(text.encode(), b" ")
    body = len(encoded).to_bytes(8, "little") + encoded
    body += b"".join(_padded(each.tobytes(), b"\0") for each in arrays)
    digest = hashlib.sha256(body).hexdigest()
    with atomic(path, "surrogate") as file:
        file.write(SURROGATE + f"format {FORMAT}\nsha256 {digest}\n".encode())
        file.write(body)


def _padded(data: bytes, filler: bytes) -> bytes:
    return data + filler * (-len(data) % STEP)


def _without_arrays(part: Any, arrays: list[NDArray[Any]]) -> Any:
    """Replace the arrays of a part by their numbers, and collect them."""
    if isinstance(part, dict):
        return {name: _without_arrays(each, arrays) for name, each in part.items()}
    if isinstance(part, list):
        return [_without_arrays(each, arrays) for each in part]
    if not isinstance(part, np.ndarray):
        return part
    kind = part.dtype.newbyteorder("<")
    if kind.str not in KINDS:
        raise TypeError(f"arrays of {part.dtype} are not kept")
    arrays.append(part.astype(kind, copy=False))
    return {ARRAY: len(arrays) - 1}


def load(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a surrogate's card and parts, without a check of their content.

    Raises
    ------
    InputError
        If the file is no surrogate, of another format, or damaged.
    """
    try:
        data = require_file(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    head = HEAD.match(data)
    if head is None or int(head[1]) not in READ:
        raise InputError(f"{path}: {_stranger(path, data, head)}")
    body = memoryview(data)[head.end() :]
    if hashlib.sha256(body).hexdigest() != head[2].decode():
        raise InputError(
            f"{path}: is damaged: its checksum is not that of its content; restore it from a copy"
            " or fit it anew"
        )
    try:
        card, parts = _read(body)
        return (card if int(head[1]) >= PAIRED else _with_pairs(card)), parts
    except (ValueError, TypeError, KeyError, IndexError, RecursionError, MemoryError) as error:
        fault = printable(f"{type(error).__name__}: {error}"[:100])
        raise InputError(f"{path}: is no surrogate that could be read ({fault})") from None


def _with_pairs(card: dict[str, Any]) -> dict[str, Any]:
    """Return a card of format 3 with pairs in place of numbers that held for both axes."""
    return card | {name: [card[name]] * 2 for name in PAIRS if name in card}


def _stranger(path: Path, data: bytes, head: re.Match[bytes] | None) -> str:
    """Describe a file that is no surrogate of this format."""
    from gen.database import is_database

    reads = f"{READ[0]} to {READ[-1]}"
    anew = f"fit it anew with {to_type('learn fit')}"
    if head is not None:
        return f"has format {int(head[1])}, this version reads {reads}: {anew}"
    if data.startswith(OLDER):
        return f"is no surrogate of the formats {reads}, which this version reads: {anew}"
    if is_database(path):
        return f"is no surrogate; it is a database: {to_type('learn fit')} makes a surrogate of it"
    return f"is no surrogate: make one with {to_type('learn fit')}"


def _read(body: memoryview) -> tuple[dict[str, Any], dict[str, Any]]:
    """Parse the content behind the checksum; any exception may be raised if it is not whole."""
    length = int.from_bytes(body[:8], "little")
    if length > min(LONGEST_TEXT, len(body) - 8):
        raise ValueError(f"a text of {length} bytes")
    text = json.loads(bytes(body[8 : 8 + length]))
    arrays, start = [], 8 + length
    for kind, shape in text["arrays"]:
        if kind not in KINDS or not all(type(size) is int and size >= 0 for size in shape):
            raise ValueError(f"an array of type {kind} and shape {shape}")
        stop = start + math.prod(shape) * np.dtype(kind).itemsize
        if stop > len(body):
            raise ValueError(f"an array of shape {shape} in {len(body) - start} bytes")
        flat = np.frombuffer(body[start:stop], dtype=kind)
        arrays.append(flat.reshape(shape).astype(np.dtype(kind).newbyteorder("=")))
        start = stop + -stop % STEP
    if start != len(body):
        raise ValueError(f"{len(body) - start} bytes too many")
    card, parts = text["card"], _with_arrays(text["parts"], arrays)
    if not isinstance(card, dict) or not isinstance(parts, dict):
        raise TypeError("no card or no models")
    return card, parts


def _with_arrays(part: Any, arrays: list[NDArray[Any]]) -> Any:
    """Put the arrays of a part back into their places."""
    if isinstance(part, dict):
        if part.keys() == {ARRAY}:
            return arrays[part[ARRAY]]
        return {name: _with_arrays(each, arrays) for name, each in part.items()}
    if isinstance(part, list):
        return [_with_arrays(each, arrays) for each in part]
    return part
