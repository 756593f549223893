"""Damage to a file, in its bytes and in its structure: deterministic, from a seed and a number.

No coverage guides it: most code that reads files is HDF5 and NumPy, of which it sees nothing.
"""

import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np

Random = np.random.Generator
Mutator = Callable[[bytes, Random], bytes]

MOST = 4
"""Mutations of one file at most: more would hide each other."""

ODD: tuple[Any, ...] = (
    *(None, True, False, [], {}, [[]], [None], {"": None}, float("nan"), float("inf")),
    *(0, -1, 1, 2**31, 2**63, 10**30, 10**400, 0.5, -0.0, 1e-320, 1e308, 4097, 10**9),
    *("", "x", "\x1b[31mred", "\x00", "é" * 300, "=1+1", "../../x", "9" * 5000, "nan", "\udcff"),
)
"""Values that stand in for others."""

INTERESTING = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1)
"""Numbers at which types end."""

WORD = re.compile(rb"[A-Za-z_][A-Za-z0-9_/.]{3,31}")
NUMBER = re.compile(rb"-?\d+(\.\d+)?([eE][-+]?\d+)?")


def flipped(data: bytes, random: Random) -> bytes:
    """Flip one bit."""
    place, bit = _place(data, random), int(random.integers(8))
    return data[:place] + bytes([data[place] ^ (1 << bit)]) + data[place + 1 :]


def overwritten(data: bytes, random: Random) -> bytes:
    """Write a number at which a type ends over one, two, four or eight bytes."""
    length = int(random.choice((1, 2, 4, 8)))
    value = INTERESTING[int(random.integers(len(INTERESTING)))] % (1 << 8 * length)
    place = _place(data, random)
    return data[:place] + value.to_bytes(length, "little") + data[place + length :]


def linked(data: bytes, random: Random) -> bytes:
    """Copy eight bytes over eight others: in HDF5, an address over another, or a length."""
    source, target = 8 * (_place(data, random) // 8), 8 * (_place(data, random) // 8)
    return data[:target] + data[source : source + 8] + data[target + 8 :]


def renamed(data: bytes, random: Random) -> bytes:
    """Write the beginning of one name that stands in the file over another."""
    words = list(WORD.finditer(data))
    if len(words) < 2:
        return flipped(data, random)
    one, other = (words[int(place)] for place in random.choice(len(words), 2, replace=False))
    name = other[0][: len(one[0])].ljust(len(one[0]), b"_")
    return data[: one.start()] + name + data[one.end() :]


def cut(data: bytes, random: Random) -> bytes:
    """Lose the end."""
    return data[: _place(data, random)]


def shifted(data: bytes, random: Random) -> bytes:
    """Lose a piece in the midst, have it twice, or have zeros in its place."""
    start = _place(data, random)
    stop = min(len(data), start + int(random.integers(1, 65)))
    middle = (b"", 2 * data[start:stop], bytes(stop - start))[int(random.integers(3))]
    return data[:start] + middle + data[stop:]


def renumbered(data: bytes, random: Random) -> bytes:
    """Have an odd text in place of a number."""
    numbers = list(NUMBER.finditer(data))
    if not numbers:
        return shifted(data, random)
    found = numbers[int(random.integers(len(numbers)))]
    return data[: found.start()] + _text(random) + data[found.end() :]


def relined(data: bytes, random: Random) -> bytes:
    """Lose a line, have it twice, or have an odd value after its equals sign or comma."""
    lines = data.split(b"\n")
    place = int(random.integers(len(lines)))
    name, sign, _ = lines[place].partition(b"=" if b"=" in lines[place] else b",")
    changed: tuple[list[bytes], ...] = (
        [],
        2 * [lines[place]],
        [name + sign + b" " + _text(random)],
    )
    return b"\n".join([*lines[:place], *changed[int(random.integers(3))], *lines[place + 1 :]])


def restructured(data: bytes, random: Random) -> bytes:
    """Change one value of a JSON document: another type, missing, renamed, nested, too deep."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        return shifted(data, random)
    places = list(_places(document))
    if not places:
        return data + b" "
    parent, key = places[int(random.integers(len(places)))]
    how = int(random.integers(6))
    if how == 0:
        del parent[key]
    elif how == 1 and isinstance(parent, dict):
        parent[str(key) + "_"] = parent.pop(key)
    elif how == 2:
        parent[key] = [parent[key]]
    else:
        parent[key] = "deep" if how == 3 else ODD[int(random.integers(len(ODD)))]
    return json.dumps(document).replace('"deep"', "[" * 3000 + "]" * 3000).encode()


BYTES: tuple[Mutator, ...] = (flipped, overwritten, cut, shifted)
BY_ENDING: dict[str, tuple[Mutator, ...]] = {
    ".h5": (*BYTES, linked, linked, renamed, renamed, renumbered),
    ".json": (restructured, restructured, restructured, renumbered, *BYTES),
    ".toml": (relined, relined, renumbered, renumbered, renamed, *BYTES),
    ".npy": (renumbered, renamed, *BYTES),
    **dict.fromkeys((".jsonl", ".csv", ".txt"), (relined, renumbered, renamed, *BYTES)),
}
"""What is done to a file, by the ending of its name; to others, bytes are changed."""


def damaged(data: bytes, name: str, random: Random) -> bytes:
    """Damage the content of a file with a name; `random` decides everything."""
    mutators = BY_ENDING.get(name[name.rfind(".") :], BYTES)
    for _ in range(int(random.integers(1, MOST + 1))):
        if data:
            data = mutators[int(random.integers(len(mutators)))](data, random)
    return data


def _place(data: bytes, random: Random) -> int:
    return int(random.integers(len(data)))


def _text(random: Random) -> bytes:
    """An odd value as a text."""
    value = ODD[int(random.integers(len(ODD)))]
    text = value if isinstance(value, str) else json.dumps(value)
    return text.encode(errors="surrogatepass")


def _places(document: Any) -> Any:
    """Every container of a document with each of its keys."""
    keys = document.keys() if isinstance(document, dict) else range(len(document))
    for key in list(keys):
        yield document, key
        if isinstance(document[key], dict | list):
            yield from _places(document[key])
