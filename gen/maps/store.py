"""A file of prepared maps, which the ranks of a machine map into their memory.

The file begins with a fixed line and the place, length and SHA-256 of its table, a JSON text at the
end that holds the key of what was prepared, and place, shape and SHA-256 of each map. Heights are
64-bit numbers in the machine's order of bytes. A file that is damaged in any way is made anew.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from gen.arrays import Heights
from gen.runtime.files import MAPS, atomic

PAGE = 4096
"""Alignment of the maps in the file, that of pages in memory [bytes]."""


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """One prepared map.

    Attributes
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes, read-only [um].
    remarks : tuple of str
        One line for each reason to distrust the heights.
    """

    heights: Heights
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Stored:
    """Content of a file of prepared maps.

    Attributes
    ----------
    maps : tuple of PreparedMap
        The maps, mapped into memory.
    spacing : tuple of float
        Distance of their nodes along x and y [um].
    """

    maps: tuple[PreparedMap, ...]
    spacing: tuple[float, float]


def write(
    path: Path, key: str, maps: Iterable[tuple[PreparedMap, tuple[float, float]]], *, replace: bool
) -> None:
    """Write prepared maps one by one, so that only one of them is in memory at a time.

    Parameters
    ----------
    path : Path
        File to make.
    key : str
        Name of what was prepared, and how.
    maps : iterable of (PreparedMap, (float, float))
        Maps with their common spacing along x and y [um].
    replace : bool
        Whether to replace a file of that name, one that is damaged.

    Raises
    ------
    InputError
        If the file cannot be written, or is there and of another kind.
    """
    table: dict[str, Any] = {"key": key, "byteorder": sys.byteorder, "maps": []}
    with atomic(path, "maps", replace=replace) as file:
        file.write(bytes(PAGE))
        for prepared, spacing in maps:
            table["spacing"] = spacing
            content = np.ascontiguousarray(prepared.heights, dtype=np.float64).reshape(-1).data
            table["maps"].append(
                {
                    "place": file.tell(),
                    "shape": prepared.heights.shape,
                    "sha256": hashlib.sha256(content).hexdigest(),
                    "remarks": prepared.remarks,
                }
            )
            file.write(content)
            file.write(bytes(-file.tell() % PAGE))
        _finish(file, json.dumps(table).encode())


def _finish(file: IO[bytes], table: bytes) -> None:
    """Write the table to the end of the file, and its place to the beginning."""
    place = file.tell()
    file.write(table)
    file.seek(0)
    file.write(MAPS + f"{place} {len(table)} {hashlib.sha256(table).hexdigest()}\n".encode())


def opened(path: Path, key: str, *, verify: bool) -> Stored | None:
    """Map a file of prepared maps into memory.

    Parameters
    ----------
    path : Path
        The file.
    key : str
        Name of what it has to hold.
    verify : bool
        Whether to compare the heights with their SHA-256, which reads the whole file. One process
        of a run does so, the others follow it.

    Returns
    -------
    Stored or None
        The maps; None if there is no such file, or it is damaged or holds something else.
    """
    with suppress(OSError, ValueError, KeyError, TypeError):
        table = _table(path)
        if table["key"] == key and table["byteorder"] == sys.byteorder:
            maps = tuple(_mapped(path, entry, verify=verify) for entry in table["maps"])
            dx, dy = table["spacing"]
            return Stored(maps, (dx, dy))
    return None


def _table(path: Path) -> dict[str, Any]:
    """Read the table of a file; raise ValueError if it is damaged."""
    if not path.is_file():  # a pipe would never answer
        raise ValueError("no file")
    with path.open("rb") as file:
        if file.read(len(MAPS)) != MAPS:
            raise ValueError("no file of prepared maps")
        place, length, sha256 = file.readline(200).decode().split()
        file.seek(int(place))
        text = file.read(int(length) + 1)
    if len(text) != int(length) or hashlib.sha256(text).hexdigest() != sha256:
        raise ValueError("damaged table")
    table: dict[str, Any] = json.loads(text)
    return table


def _mapped(path: Path, entry: dict[str, Any], *, verify: bool) -> PreparedMap:
    """Map one map into memory; raise ValueError if it is damaged."""
    nx, ny = entry["shape"]
    heights = np.memmap(path, dtype=np.float64, mode="r", offset=entry["place"], shape=(nx, ny))
    if verify and hashlib.sha256(heights.reshape(-1).data).hexdigest() != entry["sha256"]:
        raise ValueError("damaged map")
    return PreparedMap(heights, tuple(entry["remarks"]))
