"""The maps of a scene: found by their names, prepared once for all processes, cut into windows.

Prepared maps lie in a file that the ranks of a machine map into their memory. It begins with a
fixed line and the place, length and SHA-256 of its table, a JSON text at the end that holds the
key of what was prepared, and place, shape and SHA-256 of each map. Heights are 64-bit numbers in
the machine's order of bytes. A file that is damaged in any way is made anew.

A window lies in one tile of a map. Rows of one tile stay together in every split of a database, so
that a model is never tested on a node that it was trained on. A window follows from a surface's
stream of random numbers and the shapes of the maps alone: no height is needed to know where it is.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import sys
import tempfile
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import accumulate, product
from pathlib import Path
from typing import Any

import numpy as np

from gen.arrays import Heights
from gen.maps.filters import is_same, resampled
from gen.maps.prepare import prepare
from gen.maps.read import Sides, files_in, in_words, read
from gen.maps.settings import Reading, in_scene_words
from gen.runtime.errors import InputError
from gen.runtime.files import MAPS, atomic, digest
from gen.runtime.installation import versions

Shape = tuple[int, int]  # nodes along x and y


def map_files(patterns: Sequence[str], folder: Path) -> list[Path]:
    """Find the files that a scene names by names, folders and patterns; refuse one without any."""
    found: dict[Path, None] = {}
    for pattern in patterns:
        try:
            own = Path(pattern).expanduser()
            if (
                "\0" in pattern
            ):  # no name of a file has one, and Python 3.13 does not look for it
                here = []
            elif (folder / own).is_file() or (folder / own).is_dir():
                here = files_in(folder / own)
            else:
                start = Path(own.anchor) if own.anchor else folder
                inside = start.glob(str(own.relative_to(own.anchor)))
                here = sorted(each for each in inside if each.is_file())
        except (OSError, ValueError, RuntimeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"files {pattern!r}: {reason}") from None
        if not here:
            raise InputError(
                f"files {pattern!r}: no file or folder is called so in {folder}"
            )
        found |= dict.fromkeys(path.resolve() for path in here)
    return list(found)


def digests(paths: Iterable[Path]) -> list[str]:
    """Compute the SHA-256 of files; refuse two of one content: their tiles would share nodes."""
    found: dict[str, Path] = {}
    for path in paths:
        sha256 = digest(path)
        if sha256 in found:
            raise InputError(
                f"{path} and {found[sha256]} are the same map: leave one out, or a surrogate would"
                " be tested on nodes that it was trained on"
            )
        found[sha256] = path
    return list(found)


def located(recorded: Path, sha256: str, beside: Path | None) -> Path:
    """Find a map of a database again by its content: where it was, or beside the database."""
    places = [recorded, *([] if beside is None else [beside / recorded.name])]
    present = [path for path in places if path.is_file()]
    for path in present:
        if digest(path) == sha256:
            return path
    if present:
        raise InputError(
            f"{present[0]}: is not the map that the database was made of: its SHA-256 was"
            f" {sha256[:12]}...; a changed map is another scene"
        )
    raise InputError(
        f"{recorded}: the map is gone that the database was made of; put it back there or beside"
        f" the database (SHA-256 {sha256[:12]}...)"
    )


# number of this way to read and prepare: raised whenever the code gives other heights or warnings
READER = 3


@dataclass(frozen=True)
class Wanted:
    """How the files of a scene are to be read and prepared."""

    window: Shape  # nodes of a window along x and y, which every map has to hold
    # sides along x and y to resample the maps to [um]; None takes that of the first map, which the
    # others have to share
    spacing: Sides | None = None
    reading: Reading = field(
        default_factory=Reading
    )  # how the files are read and prepared

    def key(self, sha256s: Sequence[str]) -> str:
        """Return the name of the library that files of these contents make: a SHA-256.

        The versions of the libraries that read and prepare count, the window does not.
        """
        content = {
            "reader": READER,
            "versions": versions(("asperity", "numpy", "scipy", "SurfaceTopography")),
            "maps": list(sha256s),
            "spacing": self.spacing,
            **{table: self.reading.of(table) for table in ("preparation", "reading")},
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class Library:
    """Prepared maps in shared memory."""

    maps: tuple[PreparedMap, ...]  # the maps in the order of their files
    spacing: Sides  # distance of the nodes along x and y [um]
    file: Path  # file that holds them

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Nodes of each map along x and y."""
        return tuple((each.heights.shape[0], each.heights.shape[1]) for each in self.maps)


def prepared(
    paths: Sequence[Path], sha256s: Sequence[str], wanted: Wanted, folder: Path | None
) -> Library:
    """Return the prepared maps of files; prepare them unless a file has them already."""
    library = opened(sha256s, wanted, folder, verify=True)
    if library is None:
        own = folder is not None and os.access(folder, os.W_OK | os.X_OK)
        if (home := folder if own else _temporary_folder(make=True)) is None:
            raise InputError(
                f"there is no folder for prepared maps: {folder or tempfile.gettempdir()} cannot be"
                " written to; set TMPDIR to a folder of yours"
            )
        key = wanted.key(sha256s)
        path = home / f"asperity-{key[:16]}.maps"
        write_maps(
            path, key, _each(paths, wanted), replace=path.exists()
        )  # a damaged one
        library = stored_maps(path, key, verify=False)
        if library is None:
            raise InputError(
                f"{path}: was damaged while it was written; delete it and try again"
            )
    for path, shape in zip(paths, library.shapes, strict=True):
        _require_window(path, shape, wanted.window)
    return library


def opened(
    sha256s: Sequence[str], wanted: Wanted, folder: Path | None, *, verify: bool
) -> Library | None:
    """Return prepared maps from the file that holds them, read to the end to `verify`, or None."""
    key = wanted.key(sha256s)
    for place in (folder, _temporary_folder(make=False)):
        if place is not None:
            stored = stored_maps(place / f"asperity-{key[:16]}.maps", key, verify=verify)
            if stored is not None:
                return stored
    return None


def _square(spacing: Sides) -> Sides:
    """Round two spacings to 12 digits, and make them equal if they nearly are."""
    x, y = (float(f"{step:.12g}") for step in spacing)
    return (x, x) if is_same(x, y) else (x, y)


def _each(paths: Sequence[Path], wanted: Wanted) -> Iterator[tuple[PreparedMap, Sides]]:
    """Read and prepare one map after the other; all have the spacing of the first."""
    spacing, first = wanted.spacing, None
    for path in paths:
        try:
            topography = read(path, wanted.reading, for_windows=True)
            topography = prepare(topography, wanted.reading)
        except InputError as error:
            message = in_scene_words(str(error), path)
            named = "" if str(path) in message else f"{path}: "
            raise InputError(f"{named}{message}") from None
        if wanted.spacing is not None:
            topography = resampled(topography, wanted.spacing)
        elif spacing is None or first is None:
            spacing, first = _square(topography.spacing), path
        elif not all(map(is_same, topography.spacing, spacing)):
            raise InputError(
                f"{path} has a node every {in_words(topography.spacing)} um, {first} every"
                f" {in_words(spacing)} um: give spacing, to which all are resampled, or downsample"
            )
        _require_window(path, topography.heights.shape, wanted.window)
        remarks = tuple(in_scene_words(line, path) for line in topography.warnings)
        yield (
            PreparedMap(topography.heights, remarks),
            _square(spacing or (1.0, 1.0)),
        )


def _require_window(path: Path, shape: tuple[int, ...], window: Shape) -> None:
    """Refuse a map that is smaller than the window."""
    (nx, ny), (wx, wy) = shape, window
    if nx < wx or ny < wy:
        raise InputError(
            f"{path}: has {nx} x {ny} nodes after its preparation, less than the window of"
            f" {wx} x {wy}: give fewer nodes, or leave the map out"
        )


def _temporary_folder(*, make: bool) -> Path | None:
    """Return this user's temporary folder, None unless nobody else may write to it."""
    folder = Path(tempfile.gettempdir()) / f"asperity-{os.getuid()}"
    with suppress(OSError):
        if make:
            folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid():
            return None if found.st_mode & 0o022 else folder
    return None


PAGE = 4096  # alignment of the maps in the file, that of pages in memory [bytes]


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """One prepared map."""

    heights: Heights  # heights without holes, read-only [um], shape (nx, ny)
    remarks: tuple[str, ...] = ()  # one line for each reason to distrust the heights


def write_maps(
    path: Path,
    key: str,
    maps: Iterable[tuple[PreparedMap, tuple[float, float]]],
    *,
    replace: bool,
) -> None:
    """Write maps, with their common spacing [um], of which only one is in memory at a time."""
    table: dict[str, Any] = {"key": key, "byteorder": sys.byteorder, "maps": []}
    with atomic(path, "maps", replace=replace) as file:
        file.write(bytes(PAGE))
        for prepared, spacing in maps:
            table["spacing"] = spacing
            content = (
                np.ascontiguousarray(prepared.heights, dtype=np.float64).reshape(-1).data
            )
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
        place, text = file.tell(), json.dumps(table).encode()
        file.write(text)
        file.seek(0)
        file.write(
            MAPS + f"{place} {len(text)} {hashlib.sha256(text).hexdigest()}\n".encode()
        )


def stored_maps(path: Path, key: str, *, verify: bool) -> Library | None:
    """Map a file of prepared maps into memory; None if it is damaged or holds something else."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        if not path.is_file():  # a pipe would never answer
            return None
        with path.open("rb") as file:
            start = file.read(len(MAPS))
            place, length, sha256 = file.readline(200).decode().split()
            file.seek(int(place))
            text = file.read(int(length) + 1)
        whole = len(text) == int(length) and hashlib.sha256(text).hexdigest() == sha256
        if start != MAPS or not whole:
            return None
        table, maps = json.loads(text), []
        if table["key"] != key or table["byteorder"] != sys.byteorder:
            return None
        for entry in table["maps"]:
            (nx, ny), offset = entry["shape"], entry["place"]
            heights = np.memmap(
                path, dtype=np.float64, mode="r", offset=offset, shape=(nx, ny)
            )
            if (
                verify
                and hashlib.sha256(heights.reshape(-1).data).hexdigest()
                != entry["sha256"]
            ):
                return None
            maps.append(PreparedMap(heights, tuple(entry["remarks"])))
        dx, dy = table["spacing"]
        return Library(tuple(maps), (dx, dy), path)
    return None


WIDE = (
    2  # side of a tile over that of the window, at least, where the map is large enough
)
# tiles along an axis that a map has at least, where it holds that many windows side by side
FEWEST = 2


@dataclass(frozen=True)
class Tiling:
    """The tiles of several maps for windows of one shape."""

    shapes: tuple[Shape, ...]  # nodes of each map along x and y
    window: Shape  # nodes of a window along x and y
    square: bool = (
        False  # whether a window has the symmetries of the square, not the rectangle's
    )

    @cached_property
    def tiles(self) -> list[list[tuple[Shape, Shape]]]:
        """The tiles of each map: the first node and one past the last, along x and along y."""
        return [
            list(product(_cut(shape[0], self.window[0]), _cut(shape[1], self.window[1])))
            for shape in self.shapes
        ]

    @cached_property
    def starts(self) -> list[int]:
        """Number of each map's first tile, and that of all tiles at the end."""
        return list(accumulate(map(len, self.tiles), initial=0))

    @property
    def total(self) -> int:
        """Number of tiles of all maps."""
        return self.starts[-1]


tiled = lru_cache(maxsize=8)(Tiling)  # the same tiles for every surface of a run


def _cut(nodes: int, width: int) -> list[Shape]:
    """Cut an axis into tiles twice as wide as a window, or two narrower ones, or a single one."""
    count = max(nodes // (WIDE * width), min(FEWEST, nodes // width))
    return [
        (place * nodes // count, (place + 1) * nodes // count) for place in range(count)
    ]


DRAWS = 5  # random numbers of a window: map, tile, two for the place, symmetry
TRANSPOSED = (
    4  # symmetries from this number on swap the axes: they are those of the square alone
)


@dataclass(frozen=True)
class Window:
    """Place of a surface in the maps."""

    map: int  # index of the map
    tile: int  # number of the tile, counted over all maps
    corner: tuple[int, int]  # first node along x and y, in the map
    # symmetry of the rectangle, from 0 to 3, or of the square, to 7: 1 mirrors x, 2 mirrors y, 4
    # swaps the axes thereafter
    symmetry: int


def drawn(
    random: np.random.Generator, tiling: Tiling, facing: Sequence[int] | None = None
) -> Window:
    """Draw a window: all maps alike, all tiles of a map, all places in a tile, all symmetries.

    Of a second body all its tiles that may be `facing` the first one's are alike.
    """
    numbers = random.random(DRAWS)
    if facing is None:
        index = _among(numbers[0], len(tiling.shapes))
        tile = tiling.starts[index] + _among(numbers[1], len(tiling.tiles[index]))
    else:
        tile = facing[_among(numbers[0], len(facing))]
        index = bisect_right(tiling.starts, tile) - 1
    ends = tiling.tiles[index][tile - tiling.starts[index]]
    x, y = (
        start + _among(number, stop - start - nodes + 1)
        for number, (start, stop), nodes in zip(
            numbers[2:4], ends, tiling.window, strict=True
        )
    )
    symmetry = _among(numbers[4], 2 * TRANSPOSED if tiling.square else TRANSPOSED)
    return Window(index, tile, (x, y), symmetry)


def cut(heights: Heights, window: Window, shape: tuple[int, int]) -> Heights:
    """Cut a window out of its map and turn it round."""
    (x, y), (nx, ny) = window.corner, shape
    patch, symmetry = heights[x : x + nx, y : y + ny], window.symmetry
    patch = patch[:: -1 if symmetry & 1 else 1, :: -1 if symmetry & 2 else 1]
    patch = patch.T if symmetry & TRANSPOSED else patch
    return np.ascontiguousarray(patch - patch.min())


def _among(number: float, count: int) -> int:
    """Turn a number in [0, 1) into one of 0, ..., count - 1."""
    return min(int(number * count), count - 1)
