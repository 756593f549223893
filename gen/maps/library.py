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
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights
from gen.maps.filters import is_same, resampled
from gen.maps.prepare import prepare
from gen.maps.read import Sides, Topography, files_in, read, spacing_text
from gen.maps.settings import PREPARED, READ, Reading, in_scene_words
from gen.runtime.errors import InputError
from gen.runtime.files import MAPS, atomic, digest
from gen.runtime.installation import versions

Shape = tuple[int, int]  # nodes along x and y


def map_files(patterns: Sequence[str], folder: Path) -> list[Path]:
    """Find the files that a scene names.

    Parameters
    ----------
    patterns : sequence of str
        Names of files and of folders, and patterns as "scans/*.x3p".
    folder : Path
        The folder that they start from.

    Returns
    -------
    list of Path
        The files without links in their paths, each once, in the order of the patterns and sorted
        within each of them.

    Raises
    ------
    InputError
        If a pattern names no file, or a folder cannot be read.
    """
    files: dict[Path, None] = {}
    for pattern in patterns:
        try:
            matches = _files_of_pattern(pattern, folder)
        except (OSError, ValueError, RuntimeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"files {pattern!r}: {reason}") from None
        if not matches:
            raise InputError(
                f"files {pattern!r}: no file or folder is called so in {folder}"
            )
        files |= dict.fromkeys(path.resolve() for path in matches)
    return list(files)


def _files_of_pattern(pattern: str, folder: Path) -> list[Path]:
    """Return the files that a name or a pattern stands for, sorted; none if there is no such file.

    Errors of the system are passed on, and an InputError if a folder holds no map.
    """
    # No name of a file has this letter, and Python 3.13 does not look for it.
    if "\0" in pattern:
        return []
    name = Path(pattern).expanduser()
    path = folder / name
    if path.is_file() or path.is_dir():
        return files_in(path)
    start = folder
    if name.anchor:
        start = Path(name.anchor)
    matches = start.glob(str(name.relative_to(name.anchor)))
    return sorted(match for match in matches if match.is_file())


def digests(paths: Iterable[Path]) -> list[str]:
    """Compute the SHA-256 of the maps of a scene.

    Parameters
    ----------
    paths : iterable of Path
        The files of the maps.

    Returns
    -------
    list of str
        The SHA-256 of each file.

    Raises
    ------
    InputError
        If two files have one content: their tiles would share nodes.
    """
    files: dict[str, Path] = {}
    for path in paths:
        sha256 = digest(path)
        if sha256 in files:
            raise InputError(
                f"{path} and {files[sha256]} are the same map: leave one out, or a"
                " surrogate would be tested on nodes that it was trained on"
            )
        files[sha256] = path
    return list(files)


def locate_map(recorded: Path, sha256: str, folder: Path | None) -> Path:
    """Find a map of a database again by its content.

    Parameters
    ----------
    recorded : Path
        The file of the map when the database was made.
    sha256 : str
        The SHA-256 of the map.
    folder : Path, optional
        The folder of the database, where the map is looked for, too.

    Returns
    -------
    Path
        The first of the two files with this content.

    Raises
    ------
    InputError
        If there is none.
    """
    places = [recorded]
    if folder is not None:
        places.append(folder / recorded.name)
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
        f"{recorded}: the map is gone that the database was made of; put it back there or"
        f" beside the database (SHA-256 {sha256[:12]}...)"
    )


# number of this way to read and prepare maps: raised whenever heights or warnings change
READER = 3


@dataclass(frozen=True)
class Recipe:
    """How the files of a scene are read and prepared."""

    window: Shape  # nodes of a window along x and y, which every map has to hold
    # distances of the nodes along x and y to resample the maps to [um]; None takes those of the
    # first map, which all maps have to have
    spacing: Sides | None = None
    # how the files are read and prepared
    reading: Reading = field(default_factory=Reading)

    def key(self, sha256s: Sequence[str]) -> str:
        """Return the name of the library that files make.

        Parameters
        ----------
        sha256s : sequence of str
            The SHA-256 of the files.

        Returns
        -------
        str
            A SHA-256 of these contents, this recipe without the window, and the versions of the
            libraries that read and prepare.
        """
        content = {
            "reader": READER,
            "versions": versions(("asperity", "numpy", "scipy", "SurfaceTopography")),
            "maps": list(sha256s),
            "spacing": self.spacing,
            PREPARED: self.reading.values_of(PREPARED),
            READ: self.reading.values_of(READ),
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """One prepared map."""

    heights: Heights  # heights without holes, read-only [um], shape (nx, ny)
    spacing: Sides  # distance of the nodes along x and y, the same for all maps [um]
    remarks: tuple[str, ...] = ()  # one line for each reason to distrust the heights


@dataclass(frozen=True, eq=False)
class Library:
    """Prepared maps in shared memory."""

    maps: tuple[PreparedMap, ...]  # the maps in the order of their files
    spacing: Sides  # distance of the nodes along x and y [um]
    file: Path  # file that holds them

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Nodes of each map along x and y."""
        return tuple(_shape(prepared.heights) for prepared in self.maps)


def _shape(heights: Heights) -> Shape:
    """Return the nodes of a map along x and y."""
    nx, ny = heights.shape
    return nx, ny


def prepared_maps(
    paths: Sequence[Path], sha256s: Sequence[str], recipe: Recipe, folder: Path | None
) -> Library:
    """Return the prepared maps of files; prepare them unless a file has them already.

    A file of prepared maps is written into the folder, or into this user's temporary folder if
    there is no folder or it cannot be written to.

    Parameters
    ----------
    paths : sequence of Path
        The files of the maps.
    sha256s : sequence of str
        Their SHA-256.
    recipe : Recipe
        How they are read and prepared.
    folder : Path, optional
        The folder for the prepared maps.

    Returns
    -------
    Library
        The maps, mapped into memory.

    Raises
    ------
    InputError
        If a map cannot be read or prepared, is smaller than the window, or has another spacing than
        the first one; or if no folder can be written to.
    """
    library = open_maps(sha256s, recipe, folder, verify=True)
    if library is None:
        library = _new_library(paths, recipe, recipe.key(sha256s), folder)
    for path, shape in zip(paths, library.shapes, strict=True):
        _require_window(path, shape, recipe.window)
    return library


def _new_library(
    paths: Sequence[Path], recipe: Recipe, key: str, folder: Path | None
) -> Library:
    """Prepare maps, write the file that holds them under a key, and map it into memory."""
    home = folder
    if home is None or not os.access(home, os.W_OK | os.X_OK):
        home = _temporary_folder(make=True)
    if home is None:
        raise InputError(
            f"there is no folder for prepared maps: {folder or tempfile.gettempdir()}"
            " cannot be written to; set TMPDIR to a folder of yours"
        )
    path = _file_of_key(home, key)
    damaged = path.exists()
    write_maps(path, key, _prepared_one_by_one(paths, recipe), replace=damaged)
    library = stored_maps(path, key, verify=False)
    if library is None:
        raise InputError(
            f"{path}: was damaged while it was written; delete it and try again"
        )
    return library


def open_maps(
    sha256s: Sequence[str], recipe: Recipe, folder: Path | None, *, verify: bool
) -> Library | None:
    """Open prepared maps, if a file in the folder or in this user's temporary one holds them.

    Parameters
    ----------
    sha256s : sequence of str
        The SHA-256 of the files of the maps.
    recipe : Recipe
        How they were read and prepared.
    folder : Path, optional
        The folder for prepared maps.
    verify : bool
        Whether all heights are read to find damage.

    Returns
    -------
    Library or None
        The maps, mapped into memory; None if no undamaged file holds them.
    """
    key = recipe.key(sha256s)
    for home in (folder, _temporary_folder(make=False)):
        if home is None:
            continue
        library = stored_maps(_file_of_key(home, key), key, verify=verify)
        if library is not None:
            return library
    return None


def _file_of_key(folder: Path, key: str) -> Path:
    """Return the file in a folder that the prepared maps of a key belong in."""
    return folder / f"asperity-{key[:16]}.maps"


def _rounded(spacing: Sides) -> Sides:
    """Round two spacings to 12 digits, and make them equal if they nearly are."""
    x = float(f"{spacing[0]:.12g}")
    y = float(f"{spacing[1]:.12g}")
    if is_same(x, y):
        return x, x
    return x, y


def _prepared_one_by_one(paths: Sequence[Path], recipe: Recipe) -> Iterator[PreparedMap]:
    """Read and prepare one map after the other; refuse one that does not have the spacing."""
    spacing = None if recipe.spacing is None else _rounded(recipe.spacing)
    for path in paths:
        topography = _prepared_map(path, recipe.reading)
        if recipe.spacing is not None:
            topography = resampled(topography, recipe.spacing)
        elif spacing is not None:
            _require_spacing(path, topography.spacing, paths[0], spacing)
        if spacing is None:
            spacing = _rounded(topography.spacing)
        _require_window(path, _shape(topography.heights), recipe.window)
        remarks = [in_scene_words(warning, path) for warning in topography.warnings]
        yield PreparedMap(topography.heights, spacing, tuple(remarks))


def _prepared_map(path: Path, reading: Reading) -> Topography:
    """Read and prepare a map; an InputError has the words of scenes and names the file."""
    try:
        return prepare(read(path, reading, for_windows=True), reading)
    except InputError as error:
        message = in_scene_words(str(error), path)
        if str(path) not in message:
            message = f"{path}: {message}"
        raise InputError(message) from None


def _require_spacing(path: Path, spacing: Sides, first: Path, expected: Sides) -> None:
    """Refuse a map with another spacing than the first map."""
    same_x = is_same(spacing[0], expected[0])
    same_y = is_same(spacing[1], expected[1])
    if not same_x or not same_y:
        raise InputError(
            f"{path} has a node every {spacing_text(spacing)} um, {first} every"
            f" {spacing_text(expected)} um: give spacing, to which all are resampled, or"
            " downsample"
        )


def _require_window(path: Path, shape: Shape, window: Shape) -> None:
    """Refuse a map that is smaller than the window."""
    if shape[0] < window[0] or shape[1] < window[1]:
        raise InputError(
            f"{path}: has {shape[0]} x {shape[1]} nodes after its preparation, less than"
            f" the window of {window[0]} x {window[1]}: give fewer nodes, or leave the"
            " map out"
        )


def _temporary_folder(*, make: bool) -> Path | None:
    """Return this user's temporary folder; None unless nobody else may write to it.

    With `make` the folder is made if there is none.
    """
    folder = Path(tempfile.gettempdir()) / f"asperity-{os.getuid()}"
    with suppress(OSError):
        if make:
            folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        is_mine = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
        shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if is_mine and not shared:
            return folder
    return None


PAGE = 4096  # alignment of the maps in the file, that of pages in memory [bytes]
LONGEST_START = 200  # most bytes of place, length and SHA-256 of the table


def write_maps(
    path: Path, key: str, maps: Iterable[PreparedMap], *, replace: bool
) -> None:
    """Write a file of prepared maps, of which only one is in memory at a time.

    Parameters
    ----------
    path : Path
        The file.
    key : str
        The key of what was prepared, from `Recipe.key`.
    maps : iterable of PreparedMap
        The maps, all of one spacing.
    replace : bool
        Whether the file replaces one that another process wrote meanwhile.
    """
    table: dict[str, Any] = {"key": key, "byteorder": sys.byteorder, "maps": []}
    with atomic(path, "maps", replace=replace) as file:
        file.write(bytes(PAGE))
        for prepared in maps:
            table["spacing"] = prepared.spacing
            heights = np.ascontiguousarray(prepared.heights, dtype=np.float64)
            table["maps"].append(
                {
                    "place": file.tell(),
                    "shape": heights.shape,
                    "sha256": _sha256(heights),
                    "remarks": prepared.remarks,
                }
            )
            file.write(heights.reshape(-1).data)
            file.write(bytes(-file.tell() % PAGE))
        place = file.tell()
        text = json.dumps(table).encode()
        sha256 = hashlib.sha256(text).hexdigest()
        file.write(text)
        file.seek(0)
        file.write(MAPS)
        file.write(f"{place} {len(text)} {sha256}\n".encode())


def _sha256(heights: Heights) -> str:
    """Return the SHA-256 of the numbers of a contiguous map."""
    return hashlib.sha256(heights.reshape(-1).data).hexdigest()


def stored_maps(path: Path, key: str, *, verify: bool) -> Library | None:
    """Map a file of prepared maps into memory.

    Parameters
    ----------
    path : Path
        The file.
    key : str
        The key of what was prepared, from `Recipe.key`.
    verify : bool
        Whether all heights are read to find damage.

    Returns
    -------
    Library or None
        The maps; None if there is no such file, it is damaged, or it holds something else.
    """
    with suppress(OSError, ValueError, KeyError, TypeError):
        if not path.is_file():  # a pipe would never answer
            return None
        with path.open("rb") as file:
            table = _table_of(file)
        if table is None or table["key"] != key or table["byteorder"] != sys.byteorder:
            return None
        dx, dy = table["spacing"]
        maps = []
        for entry in table["maps"]:
            heights = _mapped(path, entry)
            if verify and _sha256(heights) != entry["sha256"]:
                return None
            maps.append(PreparedMap(heights, (dx, dy), tuple(entry["remarks"])))
        return Library(tuple(maps), (dx, dy), path)
    return None


def _table_of(file: BinaryIO) -> Any:
    """Return the table of a file of prepared maps; None if the file is something else or damaged.

    A ValueError is passed on if the file does not begin as such a file does.
    """
    start = file.read(len(MAPS))
    place, length, sha256 = file.readline(LONGEST_START).decode().split()
    file.seek(int(place))
    text = file.read(int(length) + 1)
    if start != MAPS or len(text) != int(length):
        return None
    if hashlib.sha256(text).hexdigest() != sha256:
        return None
    return json.loads(text)


def _mapped(path: Path, entry: dict[str, Any]) -> NDArray[np.float64]:
    """Map the heights of an entry of the table into memory, read-only [um]."""
    nx, ny = entry["shape"]
    return np.memmap(
        path, dtype=np.float64, mode="r", offset=entry["place"], shape=(nx, ny)
    )


# smallest side of a tile over that of the window, where the map is large enough
WIDE = 2
# smallest number of tiles along an axis of a map that holds as many windows side by side
FEWEST = 2


@dataclass(frozen=True)
class Span:
    """Neighbouring nodes along one axis."""

    start: int  # index of the first node
    stop: int  # index after that of the last node

    @property
    def nodes(self) -> int:
        """Number of the nodes."""
        return self.stop - self.start


@dataclass(frozen=True)
class Tile:
    """A part of a map."""

    x: Span
    y: Span


@dataclass(frozen=True)
class Tiling:
    """The tiles of several maps for windows of one shape."""

    shapes: tuple[Shape, ...]  # nodes of each map along x and y
    window: Shape  # nodes of a window along x and y
    # whether a window has the eight symmetries of the square, or the four of the rectangle
    square: bool = False

    @cached_property
    def tiles(self) -> list[list[Tile]]:
        """The tiles of each map."""
        return [self._tiles_of(shape) for shape in self.shapes]

    def _tiles_of(self, shape: Shape) -> list[Tile]:
        """Return the tiles of a map of some shape."""
        along_x = _spans(shape[0], self.window[0])
        along_y = _spans(shape[1], self.window[1])
        return [Tile(x, y) for x, y in product(along_x, along_y)]

    @cached_property
    def starts(self) -> list[int]:
        """Number of each map's first tile, counted over all maps; at the end that of all tiles."""
        return list(accumulate(map(len, self.tiles), initial=0))

    @property
    def total(self) -> int:
        """Number of tiles of all maps."""
        return self.starts[-1]


tiled = lru_cache(maxsize=8)(Tiling)  # the same tiles for every surface of a run


def _spans(nodes: int, window: int) -> list[Span]:
    """Cut an axis into spans of at least two windows, or into two shorter ones, or a single one."""
    count = max(nodes // (WIDE * window), min(FEWEST, nodes // window))
    ends = [number * nodes // count for number in range(count + 1)]
    return [Span(ends[number], ends[number + 1]) for number in range(count)]


DRAWS = 5  # random numbers of a window: map, tile, two for the place, symmetry
# number of symmetries of the rectangle; those from this number on swap the axes of a square
TRANSPOSED = 4
# parts of the number of a symmetry
MIRRORED_X = 1
MIRRORED_Y = 2


@dataclass(frozen=True)
class Window:
    """Place of a surface in the maps."""

    map: int  # index of the map
    tile: int  # number of the tile, counted over all maps
    corner: tuple[int, int]  # first node along x and y, in the map
    # symmetry of the rectangle, from 0 to 3, or of the square, to 7: 1 mirrors x, 2 mirrors y, 4
    # swaps the axes thereafter
    symmetry: int


def draw_window(
    random: np.random.Generator, tiling: Tiling, tiles: Sequence[int] | None = None
) -> Window:
    """Draw a window; this moves the state of the generator by `DRAWS` numbers.

    Every map has the same probability, then every tile of the map, every place in the tile, and
    every symmetry.

    Parameters
    ----------
    random : numpy.random.Generator
        The stream of random numbers of the surface.
    tiling : Tiling
        The tiles of all maps.
    tiles : sequence of int, optional
        Numbers of the tiles to draw from, each with the same probability whatever its map. Without
        them all tiles can be drawn.

    Returns
    -------
    Window
        The window, which lies in one tile.
    """
    numbers = random.random(DRAWS)
    if tiles is None:
        index = _pick(numbers[0], len(tiling.shapes))
        number = tiling.starts[index] + _pick(numbers[1], len(tiling.tiles[index]))
    else:
        number = tiles[_pick(numbers[0], len(tiles))]
        index = bisect_right(tiling.starts, number) - 1
    tile = tiling.tiles[index][number - tiling.starts[index]]
    nx, ny = tiling.window
    x = tile.x.start + _pick(numbers[2], tile.x.nodes - nx + 1)
    y = tile.y.start + _pick(numbers[3], tile.y.nodes - ny + 1)
    symmetries = 2 * TRANSPOSED if tiling.square else TRANSPOSED
    return Window(index, number, (x, y), _pick(numbers[4], symmetries))


def cut_window(heights: Heights, window: Window, shape: Shape) -> Heights:
    """Cut a window out of its map and turn it by its symmetry.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the map [um].
    window : Window
        Place of the window in the map.
    shape : (int, int)
        Nodes of the window along x and y; equal ones if its symmetry swaps the axes.

    Returns
    -------
    ndarray
        Heights above the lowest node of the window, of this shape [um].
    """
    x, y = window.corner
    nx, ny = shape
    patch = heights[x : x + nx, y : y + ny]
    if window.symmetry & MIRRORED_X:
        patch = patch[::-1]
    if window.symmetry & MIRRORED_Y:
        patch = patch[:, ::-1]
    if window.symmetry & TRANSPOSED:
        patch = patch.T
    return np.ascontiguousarray(patch - patch.min())


def _pick(number: float, count: int) -> int:
    """Turn a number in [0, 1) into one of 0, ..., count - 1."""
    return min(int(number * count), count - 1)
