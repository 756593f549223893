"""Windows of measured maps as the surfaces of a scene.

Every process opens the maps of a scene once. The place of a window is drawn from the numbers of
nodes of the maps alone. The scene of a database records these numbers, so that places are known
without opening a map.
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

# Prepared maps that this process has opened. A key is the table of one body (`first_body` of the
# table of a scene) with its recorded maps.
_OPEN: dict[ScanSurface, library.Library] = {}

MOST_PATTERNS = 1000  # largest number of names in the list of files
LONGEST_TEXT = 200  # largest number of letters of a text in a table
# largest scan length that a table accepts [um]; `parse_sides` allows less when a map is read
LONGEST_SIDE = 1e300


def _files(value: object, info: ValidationInfo) -> tuple[str, ...]:
    """Validate the key `files`: return the paths and patterns from a text or a list of texts.

    Relative paths start from the folder of the scene's file, if the context of the validation has
    the key "folder". PydanticCustomError for any other value, and for an empty or too long list.
    """
    names = (value,) if isinstance(value, str) else value
    if not isinstance(names, list | tuple) or not 1 <= len(names) <= MOST_PATTERNS:
        raise PydanticCustomError("files", "not a name or a list of names")
    if not all(isinstance(name, str) and name.strip() for name in names):
        raise PydanticCustomError("files", "not a name or a list of names")
    if info.context is None:
        return tuple(names)
    # "~" is replaced where the files are looked for.
    folder = info.context["folder"].absolute()
    return tuple(name if name.startswith("~") else str(folder / name) for name in names)


Files = Annotated[tuple[str, ...], PlainValidator(_files)]
# what `files` may hold, for messages and the manual
FILES = "a file, a folder or a pattern as 'scans/*.x3p', or a list of these"


def _another_or_files(value: object, info: ValidationInfo) -> str | tuple[str, ...]:
    """Validate the key `against`: return "another", or the files of `_files`."""
    if value == ANOTHER:
        return ANOTHER
    return _files(value, info)


AnotherOrFiles = Annotated[str | tuple[str, ...], PlainValidator(_another_or_files)]

Text = Annotated[str, Field(max_length=LONGEST_TEXT)]


def _lengths(value: object) -> str:
    """Validate scan lengths and return them as the text of `Reading.side`, as "1000,500" [um].

    A number or a pair of numbers is allowed, or a text, which `parse_sides` checks later.
    PydanticCustomError for anything else.
    """
    if isinstance(value, str) and len(value) <= LONGEST_TEXT:
        return value
    lengths = one_or_two(float, LONGEST_SIDE)(value)
    numbers = lengths if isinstance(lengths, tuple) else (lengths,)
    return ",".join(repr(number).removesuffix(".0") for number in numbers)


Lengths = Annotated[str, PlainValidator(_lengths)]


def _table(name: str) -> type[Table]:
    """Make the pydantic class of the scene table `name`, which is `READ` or `PREPARED`.

    Its keys are the fields of `Reading` that belong to this table. Each is optional: None is the
    default, with which the field of `Reading` keeps its own default.
    """
    # Scenes also accept numbers for the side, which is a text in commands.
    types: dict[str, Any] = get_type_hints(Reading) | {"side": Lengths}
    fields: dict[str, Any] = {}
    for key_name, key in keys(name).items():
        kind: Any = types[key_name]
        if kind is str:
            kind = Text
        checked_kind: Any = Annotated[kind, AfterValidator(_check_of(key))]
        default = Field(default=None, description=key.allowed)
        fields[key_name] = (checked_kind | None, default)
    return create_model(f"{name.capitalize()}Table", __base__=Table, **fields)


def _check_of(key: Key) -> Callable[[Any], Any]:
    """Return the validator of a key: a function that returns a value that the key allows.

    It raises PydanticCustomError for other values.
    """

    def check(value: Any) -> Any:
        if not key.suits(value):
            raise PydanticCustomError("key", "not allowed")
        return value

    return check


# Type checkers cannot use classes that are made when the program runs.
if TYPE_CHECKING:
    ReadingTable: TypeAlias = Table
    PreparationTable: TypeAlias = Table
else:
    ReadingTable = _table(READ)
    PreparationTable = _table(PREPARED)


class RecordedMap(Table):
    """A map that a run has used.

    Its content identifies it: the file may be moved.
    """

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
        """The values that identify the maps: their spacing, number, contents and nodes.

        The paths of the files are left out.
        """
        maps = tuple(
            f"{recorded.sha256}, {recorded.nodes[0]} x {recorded.nodes[1]}"
            for recorded in self.maps
        )
        return {"spacing": self.spacing, "number": len(maps), "maps": maps}


class ScanSurface(GeneratedSurface):
    """Windows of measured maps, as one rough body or as two.

    If there is one rough body, `against` and `against_found` are None. The maps are recorded when
    `found` is set. Private methods work on the first body unless they say otherwise.
    """

    FOLLOWS_MAPS: ClassVar[bool] = True

    PLACES: ClassVar[Mapping[str, str]] = {
        "map": "index of the surface's map",
        # Among the tiles of all maps; with maps of a second body, among groups of tiles of both
        # bodies (`tile_groups`).
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
    # None in the user's scene; a run writes the next two keys when it begins.
    found: RecordedMaps | None = Field(
        default=None, description="the maps that a run has found"
    )
    against_found: RecordedMaps | None = Field(
        default=None, description="the maps of the second body that a run has found"
    )

    @property
    def is_complete(self) -> bool:
        """Override `GeneratedSurface.is_complete`: whether the maps are recorded."""
        return self.found is not None

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Override `GeneratedSurface.patch`: return the nodes and sides [um] of a window.

        InputError unless the maps are recorded.
        """
        dx, dy = self.recorded_maps().spacing
        nx, ny = pair(self.nodes)
        if cells:
            return Patch(nodes=(nx, ny), sides=(dx * nx, dy * ny))
        return Patch(nodes=(nx, ny), sides=(dx * (nx - 1), dy * (ny - 1)))

    def recorded_maps(self) -> RecordedMaps:
        """Return the maps of the first body that a run has recorded in this table.

        Returns
        -------
        RecordedMaps
            Spacing, files, contents and nodes of the maps.

        Raises
        ------
        InputError
            If no run has recorded maps in this table.
        """
        if self.found is None:
            raise InputError("the maps of this scene have not been looked for")
        return self.found

    def first_body(self) -> Self:
        """Return the table of the windows of the first body alone.

        Returns
        -------
        ScanSurface
            This table, with `against` and `against_found` of None.
        """
        return self.model_copy(update={"against": None, "against_found": None})

    def second_body(self) -> Self:
        """Return the table of the windows of the second body alone.

        The scene has to have a second body.

        Returns
        -------
        ScanSurface
            The table of the first body, if the second one is "another" window of the same maps.
            Otherwise this table with the files and recorded maps of the second body in `files` and
            `found`.
        """
        if self.against == ANOTHER:
            return self.first_body()
        maps = {"files": self.against, "found": self.against_found}
        return self.first_body().model_copy(update=maps)

    @property
    def _has_maps_of_second_body(self) -> bool:
        """Whether there is a second body with maps other than those of the first one."""
        return isinstance(self.against, tuple)

    def relevant(self, content: dict[str, Any]) -> dict[str, Any]:
        """Return the keys and values on which results depend: contents of maps, not their paths.

        `found` and `against` then hold `RecordedMaps.contents`. `files` and `against_found` are
        left out. If no maps are recorded, all keys are returned as they are.
        """
        if self.found is None:
            return content
        kept = {key: content[key] for key in content.keys() - {"files", "against_found"}}
        kept["found"] = self.found.contents
        if self.against_found is not None:
            kept["against"] = self.against_found.contents
        return kept

    def sources(self) -> list[Path]:
        """Return the files of the maps of both bodies.

        If no maps are recorded, they are the files that the patterns name now. InputError if a
        pattern names no file.
        """
        if self.found is None:
            patterns = [*self.files]
            if isinstance(self.against, tuple):
                patterns += self.against
            return library.map_files(patterns, Path.cwd())
        recorded = [*self.found.maps]
        if self.against_found is not None:
            recorded += self.against_found.maps
        return [Path(recorded_map.file) for recorded_map in recorded]

    def resolved(self, home: Path | None) -> Self:
        """Return the table with the maps that its patterns name, prepared and opened.

        A table with recorded maps is returned as it is, after its files are checked and its maps
        opened. Prepared maps are kept in `home`, the folder of the database, or if that is None or
        cannot be written to, in the temporary folder of this user. InputError if a map cannot be
        used, or the maps of both bodies do not fit together.
        """
        if self.found is not None:
            self.make_ready(home, sources=True)
            return self
        first = self._search(home)
        if not self._has_maps_of_second_body:
            return self.model_copy(update={"found": first})
        second = self.second_body()._search(home)
        _require_compatible(first, second)
        return self.model_copy(update={"found": first, "against_found": second})

    def _search(self, home: Path | None) -> RecordedMaps:
        """Search for the maps of the first body, prepare them, and open them for this process.

        `home` is the folder in which the prepared maps are kept; None for the temporary folder. The
        result has the files, contents and nodes of the maps. InputError if a map cannot be used.
        """
        paths = library.map_files(self.files, Path.cwd())
        sha256s = library.hashes_of_maps(paths)
        maps = library.prepared_maps(paths, sha256s, self._recipe(), home)
        recorded_maps = tuple(
            RecordedMap(file=str(path), sha256=sha256, nodes=shape)
            for path, sha256, shape in zip(paths, sha256s, maps.shapes, strict=True)
        )
        recorded = RecordedMaps(spacing=maps.spacing, maps=recorded_maps)
        table = self.first_body().model_copy(update={"found": recorded})
        _OPEN[table] = maps
        return recorded

    def make_ready(
        self, home: Path | None, *, sources: bool = False, verify: bool = True
    ) -> None:
        """Override `GeneratedSurface.make_ready`: open the recorded maps of both bodies.

        They stay open in this process, in `_OPEN`. If they are open already, nothing is done unless
        the original files are needed.
        """
        if self._has_maps_of_second_body:
            self.second_body().make_ready(home, sources=sources, verify=verify)
        body = self.first_body()
        if body in _OPEN and not sources:
            return
        maps = self._opened(home, sources=sources, verify=verify)
        recorded = self.recorded_maps()
        shapes = tuple(recorded_map.nodes for recorded_map in recorded.maps)
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
        """Open the recorded maps of the first body, or prepare them anew if no file holds them.

        With `sources` the original files are needed in any case. SourceError if an original file is
        needed, but missing or changed, or cannot be prepared.
        """
        recorded = self.recorded_maps().maps
        sha256s = [recorded_map.sha256 for recorded_map in recorded]
        try:
            recipe = self._recipe()
            if not sources:
                maps = library.open_maps(sha256s, recipe, home, verify=verify)
                if maps is not None:
                    return maps
            paths = [
                library.locate_map(Path(recorded_map.file), recorded_map.sha256, home)
                for recorded_map in recorded
            ]
            return library.prepared_maps(paths, sha256s, recipe, home)
        except InputError as error:
            raise SourceError(str(error)) from None

    def _recipe(self) -> library.Recipe:
        """Return how the files are to be read and prepared, and the nodes of a window."""
        spacing = None
        if self.spacing is not None:
            spacing = pair(self.spacing)
        values = {**self.reading.model_dump(), **self.preparation.model_dump()}
        stated = {name: value for name, value in values.items() if value is not None}
        reading = Reading(**stated)
        return library.Recipe(window=pair(self.nodes), spacing=spacing, reading=reading)

    def remarks(self) -> list[str]:
        """Return lines for the user about the maps: numbers, prepared file and warnings."""
        if not self._has_maps_of_second_body:
            return self.first_body()._remarks_on_body("")
        return [
            *self.first_body()._remarks_on_body("body 1: "),
            *self.second_body()._remarks_on_body("body 2: "),
        ]

    def _remarks_on_body(self, name: str) -> list[str]:
        """Return lines about the maps of this table, which describes one body.

        `make_ready` has opened the maps before. Each line begins with `name`; in a warning, `name`
        follows "warning: ".
        """
        maps = _OPEN[self]
        recorded = self.recorded_maps()
        spacing = spacing_text(recorded.spacing)
        size = f"{len(maps.maps)} maps with a node every {spacing} um"
        tiles = self._tiling().total
        lines = [f"{name}{size}, {tiles} tiles; they are kept prepared in {maps.file}"]
        for recorded_map, prepared in zip(recorded.maps, maps.maps, strict=True):
            file = Path(recorded_map.file).name
            lines += [f"warning: {name}{file}: {remark}" for remark in prepared.remarks]
        return lines

    def places(self, randoms: Iterable[Random]) -> dict[str, NDArray[np.int32]]:
        """Return the map and the group of tiles of each surface, by the names of `PLACES`.

        The call moves the state of every generator of `randoms`.
        """
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
        """Return the number of groups of tiles.

        Tile t of either body is in the group t % number, and the column `tile` has the group of
        each surface. Both windows of a surface come from tiles of one group, and each group has
        tiles of both bodies. So rows of different groups share no node of either body.

        Returns
        -------
        int
            The number of tiles of the first body, or of the second one if that has fewer.
        """
        tiles = self._tiling().total
        if self.against is None:
            return tiles
        return min(tiles, self.second_body()._tiling().total)

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Cut a window out of the maps of the first body; see `GeneratedSurface.heights`."""
        return self._cut(library.draw_window(random, self._tiling()))

    def opposite_heights(
        self,
        grid: Grid,
        surface: int,
        parameters: Parameters,
        first: Random,
        random: Random,
    ) -> Heights:
        """Cut the window of the second body out of a tile in the group of the first body's tile.

        See `GeneratedSurface.opposite_heights`.
        """
        body = self.second_body()
        tiling = body._tiling()
        groups = self.tile_groups()
        first_tile = library.draw_window(first, self._tiling()).tile
        tiles_of_group = range(first_tile % groups, tiling.total, groups)
        return body._cut(library.draw_window(random, tiling, tiles_of_group))

    def _cut(self, window: library.Window) -> Heights:
        """Cut a window out of the maps of the first body: its heights above its lowest node [um].

        The maps are opened first if this process has not opened them.
        """
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
        shapes = tuple(recorded_map.nodes for recorded_map in recorded.maps)
        return library.tiled(shapes, window=(nx, ny), square=nx == ny and dx == dy)


def _require_compatible(first: RecordedMaps, second: RecordedMaps) -> None:
    """Raise InputError if the maps of two bodies differ in spacing, or share a map."""
    if first.spacing != second.spacing:
        spacings = " and ".join(
            f"{maps.spacing[0]:g} x {maps.spacing[1]:g}" for maps in (first, second)
        )
        raise InputError(
            f"the maps of both bodies have a node every {spacings} um: give"
            " surface.spacing, to which all are resampled"
        )
    sha256s_of_first = {recorded_map.sha256 for recorded_map in first.maps}
    for recorded_map in second.maps:
        if recorded_map.sha256 in sha256s_of_first:
            raise InputError(
                f"{recorded_map.file}: is one of files and of against: against = 'another'"
                " takes a second window of the same map, otherwise a surrogate would be"
                " tested on nodes that it was trained on"
            )
