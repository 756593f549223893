"""The maps of a scene: found by their names, prepared once for all processes, cut into windows.

Prepared maps are kept in a file that the ranks of a machine map into their memory. The first line
of the file is `MAPS`. The second line holds the place, length and SHA-256 of the table, a JSON text
at the end of the file. The table holds the key of the prepared maps, and the place, shape and
SHA-256 of each map. Heights are 64-bit numbers in the byte order of the machine. A file that is
damaged in any way is written anew.

Every window is a part of one tile of a map. Rows of one tile stay together in every split of a
database, so that a model is never tested on a node that it was trained on. A window is drawn from
the random numbers of its surface and the shapes of the maps: its place is known without heights.
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
        The folder from which relative names and patterns start.

    Returns
    -------
    list of Path
        The files, each once, with links in their paths resolved. They have the order of the
        patterns; the files of one pattern are sorted.

    Raises
    ------
    InputError
        If a pattern names no file, or a folder holds no map or cannot be read.
    """
    files: dict[Path, None] = {}  # as keys, files are unique and keep their order
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
    """Return the files that a name or a pattern stands for, sorted; [] if there are none.

    InputError if a folder holds no map. OSError, ValueError or RuntimeError if the system cannot
    look the pattern up.
    """
    # No name of a file contains this character, on which some versions of Python fail.
    if "\0" in pattern:
        return []
    name = Path(pattern).expanduser()
    path = folder / name
    if path.is_file() or path.is_dir():
        return files_in(path)
    # An absolute pattern starts at its root.
    start = folder
    if name.anchor:
        start = Path(name.anchor)
    matches = start.glob(str(name.relative_to(name.anchor)))
    return sorted(match for match in matches if match.is_file())


def hashes_of_maps(paths: Iterable[Path]) -> list[str]:
    """Compute the SHA-256 of the files of a scene's maps, and refuse equal files.

    Parameters
    ----------
    paths : iterable of Path
        The files of the maps.

    Returns
    -------
    list of str
        The SHA-256 of each file, in the order of the files.

    Raises
    ------
    InputError
        If two files have the same content, because their tiles would share nodes.
    """
    path_of_hash: dict[str, Path] = {}
    for path in paths:
        sha256 = digest(path)
        if sha256 in path_of_hash:
            raise InputError(
                f"{path} and {path_of_hash[sha256]} are the same map: leave one out, or a"
                " surrogate would be tested on nodes that it was trained on"
            )
        path_of_hash[sha256] = path
    return list(path_of_hash)


def locate_map(recorded: Path, sha256: str, folder: Path | None) -> Path:
    """Find a map of a database, at its recorded path or beside the database.

    Parameters
    ----------
    recorded : Path
        The path of the map when the database was made.
    sha256 : str
        The SHA-256 of the map.
    folder : Path, optional
        The folder of the database.

    Returns
    -------
    Path
        The recorded path, if its file has this SHA-256. Otherwise the file of the same name in the
        folder of the database, if that has it.

    Raises
    ------
    InputError
        If neither file has this content.
    """
    candidates = [recorded]
    if folder is not None:
        candidates.append(folder / recorded.name)
    present = [path for path in candidates if path.is_file()]
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


# version of the reading and preparation of maps; raise it whenever their heights or warnings change
READER = 3


@dataclass(frozen=True)
class Recipe:
    """How the maps of a scene are read and prepared."""

    window: Shape  # nodes of a window along x and y; every map needs at least as many
    # spacing of the nodes along x and y to which all maps are resampled [um]; None resamples no
    # map, and refuses maps whose spacing is not that of the first one
    spacing: Sides | None = None
    # settings by which each file is read and prepared
    reading: Reading = field(default_factory=Reading)

    def key(self, sha256s: Sequence[str]) -> str:
        """Return the key that identifies the prepared maps of some files.

        Parameters
        ----------
        sha256s : sequence of str
            The SHA-256 of each file.

        Returns
        -------
        str
            A SHA-256 of the contents of the files, of this recipe without its window, and of the
            versions of the libraries that read and prepare maps.
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

    # heights without holes [um], shape (nx, ny); read-only in a `Library`
    heights: Heights
    # spacing of the nodes along x and y, equal for all maps of a library [um]
    spacing: Sides
    remarks: tuple[str, ...] = ()  # one line for each reason to distrust the heights


@dataclass(frozen=True, eq=False)
class Library:
    """Prepared maps, mapped into memory from the file that holds them."""

    maps: tuple[PreparedMap, ...]  # the maps in the order of their files
    spacing: Sides  # spacing of the nodes of all maps along x and y [um]
    file: Path  # file of the prepared maps

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
    """Open the prepared maps of a scene; if no file holds them, prepare them and write one.

    The file is written into the folder. If no folder is given, or it cannot be written to, the file
    is written into the temporary folder of this user.

    Parameters
    ----------
    paths : sequence of Path
        The files of the maps.
    sha256s : sequence of str
        The SHA-256 of each file.
    recipe : Recipe
        How the maps are read and prepared.
    folder : Path, optional
        The folder for the file of prepared maps.

    Returns
    -------
    Library
        The maps, mapped into memory.

    Raises
    ------
    InputError
        If a map cannot be read or prepared, is smaller than the window, or is not resampled and has
        another spacing than the first one. If no folder can be written to.
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
    """Prepare maps, write them into a file for this key, and map the file into memory.

    The file is in the folder, or else in the temporary folder of this user. InputError if neither
    can be written to, or if a map cannot be read or prepared.
    """
    home = folder
    if home is None or not os.access(home, os.W_OK | os.X_OK):
        home = _temporary_folder(make=True)
    if home is None:
        raise InputError(
            f"there is no folder for prepared maps: {folder or tempfile.gettempdir()}"
            " cannot be written to; set TMPDIR to a folder of yours"
        )
    path = _file_of_key(home, key)
    # A file of this name was not accepted before: it is damaged.
    damaged = path.exists()
    write_maps(path, key, _prepared_one_by_one(paths, recipe), replace=damaged)
    library = stored_maps(path, key, verify=False)  # heights were written a moment ago
    if library is None:
        raise InputError(
            f"{path}: was damaged while it was written; delete it and try again"
        )
    return library


def open_maps(
    sha256s: Sequence[str], recipe: Recipe, folder: Path | None, *, verify: bool
) -> Library | None:
    """Open prepared maps from a file in a folder, or else in the temporary folder of this user.

    Parameters
    ----------
    sha256s : sequence of str
        The SHA-256 of each file of a map.
    recipe : Recipe
        How the maps were read and prepared.
    folder : Path, optional
        The folder that is searched first.
    verify : bool
        Whether all heights are compared with their SHA-256, to find damage.

    Returns
    -------
    Library or None
        The maps, mapped into memory. None if neither folder has an undamaged file of them.
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
    """Return the path of the file in a folder that holds the prepared maps of a key."""
    return folder / f"asperity-{key[:16]}.maps"


def _rounded(spacing: Sides) -> Sides:
    """Round two spacings to 12 digits, and make them equal if they differ by rounding alone."""
    x = float(f"{spacing[0]:.12g}")
    y = float(f"{spacing[1]:.12g}")
    if is_same(x, y):
        return x, x
    return x, y


def _prepared_one_by_one(paths: Sequence[Path], recipe: Recipe) -> Iterator[PreparedMap]:
    """Read, prepare and yield one map after the other.

    InputError if a map cannot be read or prepared, is smaller than the window, or is not resampled
    and has another spacing than the first one.
    """
    # Every map is stored with the rounded spacing of the recipe or of the first map.
    spacing = None if recipe.spacing is None else _rounded(recipe.spacing)
    for path in paths:
        topography = _prepared_map(path, recipe.reading)
        if recipe.spacing is not None:
            topography = resampled(topography, recipe.spacing)
        elif spacing is not None:  # this is not the first map
            _require_spacing(path, topography.spacing, paths[0], spacing)
        if spacing is None:
            spacing = _rounded(topography.spacing)
        _require_window(path, _shape(topography.heights), recipe.window)
        remarks = [in_scene_words(warning, path) for warning in topography.warnings]
        yield PreparedMap(
            heights=topography.heights, spacing=spacing, remarks=tuple(remarks)
        )


def _prepared_map(path: Path, reading: Reading) -> Topography:
    """Read and prepare a map.

    The message of an InputError names keys as scenes do, and names the file.
    """
    try:
        return prepare(read(path, reading, for_windows=True), reading)
    except InputError as error:
        message = in_scene_words(str(error), path)
        if str(path) not in message:
            message = f"{path}: {message}"
        raise InputError(message) from None


def _require_spacing(path: Path, spacing: Sides, first: Path, expected: Sides) -> None:
    """Raise InputError if the spacing of a map differs from the `expected` one of the first map.

    Both spacings are along x and y [um]. `path` and `first` are the files of the two maps.
    """
    same_x = is_same(spacing[0], expected[0])
    same_y = is_same(spacing[1], expected[1])
    if not same_x or not same_y:
        raise InputError(
            f"{path} has a node every {spacing_text(spacing)} um, {first} every"
            f" {spacing_text(expected)} um: give spacing, to which all are resampled, or"
            " downsample"
        )


def _require_window(path: Path, shape: Shape, window: Shape) -> None:
    """Raise InputError if the shape of a map is smaller than that of the window along an axis."""
    if shape[0] < window[0] or shape[1] < window[1]:
        raise InputError(
            f"{path}: has {shape[0]} x {shape[1]} nodes after its preparation, less than"
            f" the window of {window[0]} x {window[1]}: give fewer nodes, or leave the"
            " map out"
        )


def _temporary_folder(*, make: bool) -> Path | None:
    """Return the temporary folder of this user; with `make`, make it if it is missing.

    None if the folder is missing, cannot be made, belongs to somebody else, or can be written to by
    somebody else, who could change maps in it.
    """
    folder = Path(tempfile.gettempdir()) / f"asperity-{os.getuid()}"
    with suppress(OSError):
        if make:
            folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        is_mine = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
        is_shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if is_mine and not is_shared:
            return folder
    return None


# Size of a page of memory [bytes]. Each map begins at a multiple of it in the file, because only
# whole pages can be mapped into memory.
PAGE = 4096
# largest length of the second line, with place, length and SHA-256 of the table [bytes]
LONGEST_START = 200


def write_maps(
    path: Path, key: str, maps: Iterable[PreparedMap], *, replace: bool
) -> None:
    """Write a file of prepared maps, while only one of the maps is in memory.

    Parameters
    ----------
    path : Path
        The file.
    key : str
        The key of the prepared maps, from `Recipe.key`.
    maps : iterable of PreparedMap
        The maps, all of one spacing.
    replace : bool
        Whether to replace a file that exists at this path when the new one is complete. If not,
        that file stays, and the new one is dropped.
    """
    table: dict[str, Any] = {"key": key, "byteorder": sys.byteorder, "maps": []}
    with atomic(path, "maps", replace=replace) as file:
        file.write(bytes(PAGE))  # room for the first two lines, which are written last
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
            bytes_to_next_page = -file.tell() % PAGE
            file.write(bytes(bytes_to_next_page))
        place = file.tell()
        text = json.dumps(table).encode()
        sha256 = hashlib.sha256(text).hexdigest()
        file.write(text)
        file.seek(0)
        file.write(MAPS)
        file.write(f"{place} {len(text)} {sha256}\n".encode())


def _sha256(heights: Heights) -> str:
    """Return the SHA-256 of the bytes of a contiguous array of heights."""
    return hashlib.sha256(heights.reshape(-1).data).hexdigest()


def stored_maps(path: Path, key: str, *, verify: bool) -> Library | None:
    """Map a file of prepared maps into memory.

    Parameters
    ----------
    path : Path
        The file.
    key : str
        The key of the prepared maps, from `Recipe.key`.
    verify : bool
        Whether all heights are compared with their SHA-256, to find damage.

    Returns
    -------
    Library or None
        The maps. None if the file is missing or damaged, or holds anything but maps of this key.
    """
    # A damaged file, or one of another kind, may raise any of these errors.
    with suppress(OSError, ValueError, KeyError, TypeError):
        if not path.is_file():  # to open a pipe would block
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
            remarks = tuple(entry["remarks"])
            maps.append(PreparedMap(heights, spacing=(dx, dy), remarks=remarks))
        return Library(maps=tuple(maps), spacing=(dx, dy), file=path)
    return None


def _table_of(file: BinaryIO) -> Any:
    """Return the table of a file of prepared maps, a dictionary from JSON.

    Return None if the first line is not `MAPS`, or the table is damaged. A damaged second line
    raises ValueError or OSError.
    """
    first_line = file.read(len(MAPS))
    if first_line != MAPS:
        return None
    place, length, sha256 = file.readline(LONGEST_START).decode().split()
    file.seek(int(place))
    text = file.read(int(length) + 1)  # one more byte, to find an excess at the end
    if len(text) != int(length):
        return None
    if hashlib.sha256(text).hexdigest() != sha256:
        return None
    return json.loads(text)


def _mapped(path: Path, entry: dict[str, Any]) -> NDArray[np.float64]:
    """Map the heights [um] of one map into memory, read-only.

    `entry` is the entry of the map in the table of the file `path`.
    """
    nx, ny = entry["shape"]
    return np.memmap(
        path, dtype=np.float64, mode="r", offset=entry["place"], shape=(nx, ny)
    )


# smallest length of a tile along an axis that is long enough for several tiles of this length
# [length of a window]
WIDE = 2
# number of tiles along a shorter axis, if it holds this number of windows side by side
FEWEST = 2


@dataclass(frozen=True)
class Span:
    """A range of neighbouring nodes along one axis."""

    start: int  # index of the first node
    stop: int  # index of the last node, plus 1

    @property
    def nodes(self) -> int:
        """Number of nodes in the range."""
        return self.stop - self.start


@dataclass(frozen=True)
class Tile:
    """A rectangular part of a map, from which windows are cut."""

    x: Span  # nodes of the map along x
    y: Span  # nodes of the map along y


@dataclass(frozen=True)
class Tiling:
    """The tiles of all maps of a body, for windows of one shape."""

    shapes: tuple[Shape, ...]  # nodes of each map along x and y
    window: Shape  # nodes of a window along x and y
    # whether windows are turned by the eight symmetries of the square, not the four of a rectangle
    square: bool = False

    @cached_property
    def tiles(self) -> list[list[Tile]]:
        """The tiles of each map, one list a map."""
        return [self._tiles_of(shape) for shape in self.shapes]

    def _tiles_of(self, shape: Shape) -> list[Tile]:
        """Cut a map of this shape into tiles, and return them row by row along x."""
        along_x = _spans(shape[0], self.window[0])
        along_y = _spans(shape[1], self.window[1])
        return [Tile(x=x, y=y) for x, y in product(along_x, along_y)]

    @cached_property
    def starts(self) -> list[int]:
        """Number of the first tile of each map, and at the end the number of all tiles.

        Tiles are numbered from 0 through all maps.
        """
        tiles_by_map = [len(tiles) for tiles in self.tiles]
        return list(accumulate(tiles_by_map, initial=0))

    @property
    def total(self) -> int:
        """Number of tiles of all maps."""
        return self.starts[-1]


# `Tiling` with its arguments, computed once for all surfaces of a run
tiled = lru_cache(maxsize=8)(Tiling)


def _spans(nodes: int, window: int) -> list[Span]:
    """Cut an axis of a map into spans of nearly equal length, for its tiles.

    `nodes` is the length of the axis and `window` that of a window along it, both in nodes; the
    axis holds at least one window. Spans hold `WIDE` windows or more each, if the axis is long
    enough for two of these spans. A shorter axis is cut into `FEWEST` spans of one window or more.
    An axis that holds only one window becomes a single span.
    """
    wide_spans = nodes // (WIDE * window)
    short_spans = min(FEWEST, nodes // window)
    count = max(wide_spans, short_spans)
    ends = [number * nodes // count for number in range(count + 1)]
    return [Span(start=ends[number], stop=ends[number + 1]) for number in range(count)]


# count of the random numbers that a window takes: for its map, its tile, its place along x, its
# place along y, and its symmetry
DRAWS = 5
# The number of a symmetry is the sum of these parts. A rectangle has the symmetries 0 to 3, a
# square also 4 to 7, which swap the axes after mirroring.
MIRRORED_X = 1
MIRRORED_Y = 2
TRANSPOSED = 4
SYMMETRIES_OF_RECTANGLE = 4
SYMMETRIES_OF_SQUARE = 8


@dataclass(frozen=True)
class Window:
    """The place of a surface in the maps of a body, and the symmetry by which it is turned."""

    map: int  # index of the map
    tile: int  # number of the tile, from 0 through all maps
    corner: tuple[int, int]  # indices of the first node along x and y, in the map
    # sum of `MIRRORED_X`, `MIRRORED_Y` and `TRANSPOSED`, each once or not at all
    symmetry: int


def draw_window(
    random: np.random.Generator, tiling: Tiling, tiles: Sequence[int] | None = None
) -> Window:
    """Draw a window, which takes `DRAWS` numbers from the generator of the surface.

    A map is drawn first, then a tile of the map, a place in the tile, and a symmetry. All choices
    of each draw have the same probability.

    Parameters
    ----------
    random : numpy.random.Generator
        The stream of random numbers of the surface.
    tiling : Tiling
        The tiles of all maps.
    tiles : sequence of int, optional
        Numbers of the tiles from which one is drawn directly, without drawing a map first. By
        default the tile is one of the drawn map.

    Returns
    -------
    Window
        The window, all of whose nodes are in one tile.
    """
    for_map, for_tile, for_x, for_y, for_symmetry = random.random(DRAWS)
    if tiles is None:
        map_index = _pick(for_map, len(tiling.shapes))
        tile_in_map = _pick(for_tile, len(tiling.tiles[map_index]))
        tile_number = tiling.starts[map_index] + tile_in_map
    else:
        # The first number draws the tile; the second one is not used.
        tile_number = tiles[_pick(for_map, len(tiles))]
        map_index = bisect_right(tiling.starts, tile_number) - 1
        tile_in_map = tile_number - tiling.starts[map_index]
    tile = tiling.tiles[map_index][tile_in_map]
    nx, ny = tiling.window
    x = tile.x.start + _pick(for_x, tile.x.nodes - nx + 1)
    y = tile.y.start + _pick(for_y, tile.y.nodes - ny + 1)
    symmetries = SYMMETRIES_OF_SQUARE if tiling.square else SYMMETRIES_OF_RECTANGLE
    return Window(
        map=map_index,
        tile=tile_number,
        corner=(x, y),
        symmetry=_pick(for_symmetry, symmetries),
    )


def cut_window(heights: Heights, window: Window, shape: Shape) -> Heights:
    """Cut a window out of its map and turn it by its symmetry.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the map [um].
    window : Window
        Place of the window in the map.
    shape : (int, int)
        Nodes of the window along x and y, which are equal if the symmetry swaps the axes.

    Returns
    -------
    ndarray
        Heights of the window above its lowest node, of the given shape [um].
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
    """Turn a random number in [0, 1) into one of the whole numbers 0, ..., count - 1."""
    return min(int(number * count), count - 1)
