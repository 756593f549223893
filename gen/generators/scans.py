"""Windows of measured maps as the surfaces of a scene.

The maps of a scene are opened once by every process. The place of a window follows from the numbers
of nodes of the maps, which the scene of a database holds: it needs no height.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    Self,
    TypeAlias,
    get_type_hints,
)

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    Field,
    PlainValidator,
    Strict,
    ValidationInfo,
    create_model,
)
from pydantic_core import PydanticCustomError

from gen.arrays import Heights
from gen.distribution import Positive, Table
from gen.generators.function import Hash
from gen.maps import library
from gen.maps.read import spacing_text
from gen.maps.settings import PREPARED, READ, Key, Reading, keys
from gen.runtime.errors import InputError, SourceError
from gen.surface import (
    ANOTHER,
    NODES,
    SIDE,
    GeneratedSurface,
    Grid,
    Nodes,
    Parameters,
    Patch,
    Random,
    Side,
    one_or_two,
    pair,
)

# prepared maps of the scenes of this process, by the tables of their bodies
_OPEN: dict[ScanSurface, library.Library] = {}

MOST_PATTERNS = 1000  # largest number of names in the list of files
LONGEST_TEXT = 200  # most letters of a text in a table


def _files(value: object, info: ValidationInfo) -> tuple[str, ...]:
    """Accept a name or a list of names, and let them start from the folder of the scene's file."""
    names = (value,) if isinstance(value, str) else value
    if not isinstance(names, list | tuple) or not 1 <= len(names) <= MOST_PATTERNS:
        raise PydanticCustomError("files", "not a name or a list of names")
    if not all(isinstance(name, str) and name.strip() for name in names):
        raise PydanticCustomError("files", "not a name or a list of names")
    if info.context is None:
        return tuple(names)
    folder = info.context["folder"].absolute()
    return tuple(name if name.startswith("~") else str(folder / name) for name in names)


Files = Annotated[tuple[str, ...], PlainValidator(_files)]
FILES = "a file, a folder or a pattern as 'scans/*.x3p', or a list of these"


def _another_or_files(value: object, info: ValidationInfo) -> str | tuple[str, ...]:
    """Accept "another", or what `_files` accepts."""
    if value == ANOTHER:
        return ANOTHER
    return _files(value, info)


AnotherOrFiles = Annotated[str | tuple[str, ...], PlainValidator(_another_or_files)]

Text = Annotated[str, Field(max_length=LONGEST_TEXT)]


def _lengths(value: object) -> str:
    """Accept scan lengths as a text, a number, or a pair of numbers, and return their text."""
    if isinstance(value, str) and len(value) <= LONGEST_TEXT:
        return value  # checked where the maps are looked for
    lengths = one_or_two(float, 1e300)(value)
    numbers = lengths if isinstance(lengths, tuple) else (lengths,)
    return ",".join(repr(number).removesuffix(".0") for number in numbers)


Lengths = Annotated[str, PlainValidator(_lengths)]


def _table(name: str) -> type[Table]:
    """Make the table of scenes that has the keys of `Reading` with this table name."""
    types: dict[str, Any] = get_type_hints(Reading) | {"side": Lengths}
    columns: dict[str, Any] = {}
    for key_name, key in keys(name).items():
        kind: Any = Text if types[key_name] is str else types[key_name]
        kind = Annotated[kind, AfterValidator(_check_of(key))]
        columns[key_name] = (kind | None, Field(default=None, description=key.allowed))
    return create_model(f"{name.capitalize()}Table", __base__=Table, **columns)


def _check_of(key: Key) -> Callable[[Any], Any]:
    """Return the function that refuses values which do not suit a key, and returns the others."""

    def check(value: Any) -> Any:
        if not key.suits(value):
            raise PydanticCustomError("key", "not allowed")
        return value

    return check


if TYPE_CHECKING:
    ReadingTable: TypeAlias = Table
    PreparationTable: TypeAlias = Table
else:
    ReadingTable = _table(READ)
    PreparationTable = _table(PREPARED)


class RecordedMap(Table):
    """A map that a run has used, known by its content: its file may move."""

    file: str = Field(description="text, the path of the file")
    sha256: Hash = Field(description="the SHA-256 of the file's content")
    nodes: Annotated[tuple[int, int], Strict(False)] = Field(
        description="nodes along x and y after the preparation"
    )


class RecordedMaps(Table):
    """The maps of one body that a run has used."""

    spacing: Annotated[tuple[Positive, Positive], Strict(False)] = Field(
        description="distance of the nodes along x and y [um]"
    )
    maps: Annotated[tuple[RecordedMap, ...], Strict(False), Field(min_length=1)] = Field(
        description="the maps in the order of their indices"
    )

    @property
    def contents(self) -> dict[str, Any]:
        """What identifies the maps: their spacing, contents and nodes, not their places."""
        maps = tuple(
            f"{recorded.sha256}, {recorded.nodes[0]} x {recorded.nodes[1]}"
            for recorded in self.maps
        )
        return {"spacing": self.spacing, "number": len(maps), "maps": maps}


class ScanSurface(GeneratedSurface):
    """Windows of measured maps, of one rough body or of two."""

    PLACES: ClassVar[Mapping[str, str]] = {
        "map": "index of the surface's map",
        "tile": "index of the tile of all maps, or of paired tiles",
    }

    generator: Literal["scans"]
    files: Files = Field(description=FILES)
    nodes: Nodes = Field(default=128, description=NODES)
    spacing: Side | None = Field(default=None, description=SIDE)
    reading: ReadingTable = Field(
        default=ReadingTable(), description="a table of options as unit = 'nm'"
    )
    preparation: PreparationTable = Field(
        default=PreparationTable(), description="a table of steps as level = 'plane'"
    )
    against: AnotherOrFiles | None = Field(  # type: ignore[assignment]
        default=None,
        description=f"'another', for a second window of a tile, or maps of another body: {FILES}",
    )
    # Written when a run begins, as the hash of a user's function.
    found: RecordedMaps | None = Field(
        default=None, description="the maps that a run has found"
    )
    against_found: RecordedMaps | None = Field(
        default=None, description="the maps of the second body that a run has found"
    )

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return nodes and sides of a window; the maps have to be recorded."""
        dx, dy = self.recorded_maps().spacing
        nx, ny = pair(self.nodes)
        if cells:
            return Patch((nx, ny), (dx * nx, dy * ny))
        return Patch((nx, ny), (dx * (nx - 1), dy * (ny - 1)))

    def recorded_maps(self) -> RecordedMaps:
        """Return the maps of the first body that the run has found.

        Returns
        -------
        RecordedMaps
            Files, contents and nodes of the maps.

        Raises
        ------
        InputError
            If no run has looked for them.
        """
        if self.found is None:
            raise InputError("the maps of this scene have not been looked for")
        return self.found

    def first_body(self) -> Self:
        """Return the table of the first body's windows.

        Returns
        -------
        ScanSurface
            This table without a second body.
        """
        return self.model_copy(update={"against": None, "against_found": None})

    def second_body(self) -> Self:
        """Return the table of the second body's windows; there has to be a second body.

        Returns
        -------
        ScanSurface
            The table of the same maps for a second window of a tile, otherwise that of the maps of
            the second body.
        """
        if self.against == ANOTHER:
            return self.first_body()
        maps = {"files": self.against, "found": self.against_found}
        return self.first_body().model_copy(update=maps)

    @property
    def _has_maps_of_second_body(self) -> bool:
        """Whether the second body has maps of its own."""
        return isinstance(self.against, tuple)

    def relevant(self, content: dict[str, Any]) -> dict[str, Any]:
        """Leave out where the maps are, once they are known by their contents."""
        if self.found is None:
            return content
        kept = {key: content[key] for key in content.keys() - {"files", "against_found"}}
        kept["found"] = self.found.contents
        if self.against_found is not None:
            kept["against"] = self.against_found.contents
        return kept

    def sources(self) -> list[Path]:
        """Return the files of the maps, of both bodies."""
        if self.found is None:
            patterns = [*self.files]
            if isinstance(self.against, tuple):
                patterns += self.against
            return library.map_files(patterns, Path.cwd())
        recorded = [*self.found.maps]
        if self.against_found is not None:
            recorded += self.against_found.maps
        return [Path(scanned.file) for scanned in recorded]

    def resolved(self, home: Path | None) -> Self:
        """Search for the maps, and prepare them unless that has been done."""
        if self.found is not None:
            self.make_ready(home, sources=True)
            return self
        first = self._search(home)
        if not self._has_maps_of_second_body:
            return self.model_copy(update={"found": first})
        second = self.second_body()._search(home)
        _require_company(first, second)
        return self.model_copy(update={"found": first, "against_found": second})

    def _search(self, home: Path | None) -> RecordedMaps:
        """Search for the maps of the first body, and prepare and open them for this process."""
        paths = library.map_files(self.files, Path.cwd())
        sha256s = library.digests(paths)
        maps = library.prepared_maps(paths, sha256s, self._recipe(), home)
        scanned = tuple(
            RecordedMap(file=str(path), sha256=sha256, nodes=shape)
            for path, sha256, shape in zip(paths, sha256s, maps.shapes, strict=True)
        )
        recorded = RecordedMaps(spacing=maps.spacing, maps=scanned)
        _OPEN[self.first_body().model_copy(update={"found": recorded})] = maps
        return recorded

    def make_ready(
        self, home: Path | None, *, sources: bool = False, verify: bool = True
    ) -> None:
        """Open the maps of a database in this process; see `GeneratedSurface.make_ready`."""
        if self._has_maps_of_second_body:
            self.second_body().make_ready(home, sources=sources, verify=verify)
        body = self.first_body()
        if body in _OPEN and not sources:
            return
        maps = self._opened(home, sources=sources, verify=verify)
        recorded = self.recorded_maps()
        shapes = tuple(scanned.nodes for scanned in recorded.maps)
        if maps.shapes != shapes or maps.spacing != recorded.spacing:
            raise SourceError(
                "the maps are read with other nodes or another spacing than when the"
                f" database was made: {maps.shapes} every {maps.spacing} um, {shapes}"
                f" every {recorded.spacing} um then"
            )
        _OPEN[body] = maps

    def _opened(
        self, home: Path | None, *, sources: bool, verify: bool
    ) -> library.Library:
        """Open the recorded maps of the first body; prepare them anew if no file holds them.

        With `sources` their files have to be there too. SourceError if a map is not.
        """
        recorded = self.recorded_maps().maps
        sha256s = [scanned.sha256 for scanned in recorded]
        try:
            recipe = self._recipe()
            if not sources:
                maps = library.open_maps(sha256s, recipe, home, verify=verify)
                if maps is not None:
                    return maps
            paths = [
                library.locate_map(Path(scanned.file), scanned.sha256, home)
                for scanned in recorded
            ]
            return library.prepared_maps(paths, sha256s, recipe, home)
        except InputError as error:
            raise SourceError(str(error)) from None

    def _recipe(self) -> library.Recipe:
        """Return how the files are to be read and prepared."""
        spacing = None
        if self.spacing is not None:
            spacing = pair(self.spacing)
        settings = {**self.reading.model_dump(), **self.preparation.model_dump()}
        stated = {name: value for name, value in settings.items() if value is not None}
        return library.Recipe(pair(self.nodes), spacing, Reading(**stated))

    def remarks(self) -> list[str]:
        """Return lines about the maps for the user of a run: numbers, place and warnings."""
        if not self._has_maps_of_second_body:
            return self.first_body()._remarks_on_body("")
        return [
            *self.first_body()._remarks_on_body("body 1: "),
            *self.second_body()._remarks_on_body("body 2: "),
        ]

    def _remarks_on_body(self, name: str) -> list[str]:
        """Return lines about the open maps of a table of one body; its name begins each of them."""
        maps = _OPEN[self]
        recorded = self.recorded_maps()
        size = (
            f"{len(maps.maps)} maps with a node every {spacing_text(recorded.spacing)} um"
        )
        tiles = self._tiling().total
        lines = [f"{name}{size}, {tiles} tiles; they are kept prepared in {maps.file}"]
        for scanned, prepared in zip(recorded.maps, maps.maps, strict=True):
            file = Path(scanned.file).name
            lines += [f"warning: {name}{file}: {remark}" for remark in prepared.remarks]
        return lines

    def places(self, randoms: Iterable[Random]) -> dict[str, NDArray[np.int32]]:
        """Return the maps and tiles of surfaces; this moves the state of their generators."""
        tiling = self._tiling()
        groups = self.tile_groups()
        windows = [library.draw_window(random, tiling) for random in randoms]
        maps = [window.map for window in windows]
        tiles = [window.tile % groups for window in windows]
        return {
            "map": np.array(maps, dtype=np.int32),
            "tile": np.array(tiles, dtype=np.int32),
        }

    def tile_groups(self) -> int:
        """Return the number of groups of tiles, the values that the column `tile` can have.

        Windows of two bodies come from one group, which has tiles of both: a split along groups
        shares no node of either body.

        Returns
        -------
        int
            The number of tiles of the body that has fewer.
        """
        tiles = self._tiling().total
        if self.against is None:
            return tiles
        return min(tiles, self.second_body()._tiling().total)

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Cut a window out; see `GeneratedSurface.heights`."""
        return self._cut(library.draw_window(random, self._tiling()))

    def opposite_heights(
        self,
        grid: Grid,
        surface: int,
        parameters: Parameters,
        first: Random,
        random: Random,
    ) -> Heights:
        """Cut the second body's window out of a tile that is paired with the first body's."""
        body = self.second_body()
        tiling = body._tiling()
        groups = self.tile_groups()
        first_tile = library.draw_window(first, self._tiling()).tile
        tiles = range(first_tile % groups, tiling.total, groups)
        return body._cut(library.draw_window(random, tiling, tiles))

    def _cut(self, window: library.Window) -> Heights:
        """Cut a window of the first body's maps out, and open the maps if need be [um]."""
        body = self.first_body()
        if body not in _OPEN:
            body.make_ready(None)
        heights = _OPEN[body].maps[window.map].heights
        return library.cut_window(heights, window, pair(self.nodes))

    def _tiling(self) -> library.Tiling:
        """Return the tiles of the first body's recorded maps."""
        recorded = self.recorded_maps()
        nx, ny = pair(self.nodes)
        dx, dy = recorded.spacing
        shapes = tuple(scanned.nodes for scanned in recorded.maps)
        return library.tiled(shapes, (nx, ny), nx == ny and dx == dy)


def _require_company(first: RecordedMaps, second: RecordedMaps) -> None:
    """Refuse maps of two bodies with different spacings, and a map that both bodies have."""
    if first.spacing != second.spacing:
        spacings = " and ".join(
            f"{maps.spacing[0]:g} x {maps.spacing[1]:g}" for maps in (first, second)
        )
        raise InputError(
            f"the maps of both bodies have a node every {spacings} um: give"
            " surface.spacing, to which all are resampled"
        )
    of_first = {scanned.sha256 for scanned in first.maps}
    for scanned in second.maps:
        if scanned.sha256 in of_first:
            raise InputError(
                f"{scanned.file}: is one of files and of against: against = 'another'"
                " takes a second window of the same map, otherwise a surrogate would be"
                " tested on nodes that it was trained on"
            )
