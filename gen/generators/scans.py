"""Windows of measured maps: how files are read and prepared, and windows cut out of them.

The maps of a scene are opened once by every process. A window's place needs the numbers of the
maps' nodes only, which the scene of a database holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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
from gen.maps.read import in_words
from gen.maps.settings import Key, Reading, keys
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

_OPEN: dict[
    ScanSurface, library.Library
] = {}  # prepared maps of the scenes of this process

MOST_PATTERNS = 1000  # largest number of names in the list of files


def files(value: object, given: ValidationInfo) -> tuple[str, ...]:
    """Accept a name or a list of names, which start from the folder of the scene's file."""
    names = (value,) if isinstance(value, str) else value
    if (
        not isinstance(names, list | tuple)
        or not 1 <= len(names) <= MOST_PATTERNS
        or not all(isinstance(name, str) and name.strip() for name in names)
    ):
        raise PydanticCustomError("files", "not a name or a list of names")
    if given.context is None:
        return tuple(names)
    folder = given.context["folder"].absolute()
    return tuple(name if name.startswith("~") else str(folder / name) for name in names)


Files = Annotated[tuple[str, ...], PlainValidator(files)]
FILES = "a file, a folder or a pattern as 'scans/*.x3p', or a list of these"

Text = Annotated[str, Field(max_length=200)]


def lengths(value: object) -> str:
    """Accept scan lengths as a text, a number, or a pair of numbers, and return their text."""
    if isinstance(value, str) and len(value) <= 200:
        return value  # checked where the maps are looked for
    read = one_or_two(float, 1e300)(value)
    numbers = read if isinstance(read, tuple) else (read,)
    return ",".join(repr(each).removesuffix(".0") for each in numbers)


Lengths = Annotated[str, PlainValidator(lengths)]


def _table(name: str) -> type[Table]:
    """Make a table of the keys of `gen.maps.settings.Reading`."""
    rules: dict[str, Any] = get_type_hints(Reading) | {"side": Lengths}
    made: dict[str, Any] = {}
    for key, told in keys(name).items():

        def suiting(value: Any, told: Key = told) -> Any:
            if not told.suits(value):
                raise PydanticCustomError("key", "not allowed")
            return value

        rule = Text if rules[key] is str else rules[key]
        rule = Annotated[rule, AfterValidator(suiting)]
        made[key] = (rule | None, Field(default=None, description=told.allowed))
    return create_model(f"{name.capitalize()}Table", __base__=Table, **made)


if TYPE_CHECKING:
    ReadingTable: TypeAlias = Table
    PreparationTable: TypeAlias = Table
else:
    ReadingTable, PreparationTable = _table("reading"), _table("preparation")


class ScannedMap(Table):
    """A map as a run has found it, known by its content: its file may move."""

    file: str = Field(description="text, the path of the file")
    sha256: Hash = Field(description="the SHA-256 of the file's content")
    nodes: Annotated[tuple[int, int], Strict(False)] = Field(
        description="nodes along x and y after the preparation"
    )


class Found(Table):
    """The maps of a scene as a run has found them."""

    spacing: Annotated[tuple[Positive, Positive], Strict(False)] = Field(
        description="distance of the nodes along x and y [um]"
    )
    maps: Annotated[tuple[ScannedMap, ...], Strict(False), Field(min_length=1)] = Field(
        description="the maps in the order of their indices"
    )

    @property
    def contents(self) -> dict[str, Any]:
        """What identifies the maps: their spacing, contents and nodes, not their places."""
        maps = tuple(
            f"{each.sha256}, {each.nodes[0]} x {each.nodes[1]}" for each in self.maps
        )
        return {"spacing": self.spacing, "number": len(maps), "maps": maps}


AnotherOrFiles = Annotated[
    str | tuple[str, ...],
    PlainValidator(
        lambda value, given: value if value == ANOTHER else files(value, given)
    ),
]


class ScanSurface(GeneratedSurface):
    """Windows of measured maps."""

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
    found: Found | None = Field(default=None, description="the maps that a run has found")
    against_found: Found | None = Field(
        default=None, description="the maps of the second body that a run has found"
    )

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return nodes and sides of a window; the maps have to be known."""
        (x, y), (nx, ny) = self.known().spacing, pair(self.nodes)
        return Patch((nx, ny), (x * (nx - (not cells)), y * (ny - (not cells))))

    def known(self) -> Found:
        """Return the maps that a run has found; unknown before a run."""
        if self.found is None:
            raise InputError("the maps of this scene have not been looked for")
        return self.found

    def alone(self) -> Self:
        """Return the table of the first body's windows."""
        return self.model_copy(update={"against": None, "against_found": None})

    def opposite(self) -> Self:
        """Return the table of the second body's windows; there has to be one."""
        if self.against == ANOTHER:
            return self.alone()
        other = {"files": self.against, "found": self.against_found}
        return self.alone().model_copy(update=other)

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
        if self.found is not None:
            maps = [
                *self.found.maps,
                *(self.against_found.maps if self.against_found else ()),
            ]
            return [Path(each.file) for each in maps]
        others = self.against if isinstance(self.against, tuple) else ()
        return library.map_files([*self.files, *others], Path.cwd())

    def resolved(self, home: Path | None) -> Self:
        """Search for the maps, and prepare them unless that has been done."""
        if self.found is not None:
            self.make_ready(home, sources=True)
            return self
        known = self.model_copy(update={"found": self._search(home)})
        if isinstance(self.against, tuple):
            other = self.opposite()._search(home)
            _require_company(known.known(), other)
            known = known.model_copy(update={"against_found": other})
        return known

    def _search(self, home: Path | None) -> Found:
        """Search for the maps of one body, and prepare them unless that has been done."""
        paths = library.map_files(self.files, Path.cwd())
        sha256s = library.digests(paths)
        maps = library.prepared(paths, sha256s, self._wanted(), home)
        scanned = tuple(
            ScannedMap(file=str(path), sha256=sha256, nodes=shape)
            for path, sha256, shape in zip(paths, sha256s, maps.shapes, strict=True)
        )
        found = Found(spacing=maps.spacing, maps=scanned)
        _OPEN[self.alone().model_copy(update={"found": found})] = maps
        return found

    def make_ready(
        self, home: Path | None, *, sources: bool = False, verify: bool = True
    ) -> None:
        """Open the maps of a database in this process; see `GeneratedSurface.make_ready`."""
        if isinstance(self.against, tuple):
            self.opposite().make_ready(home, sources=sources, verify=verify)
        alone = self.alone()
        if alone in _OPEN and not sources:
            return
        found = self.known()
        sha256s = [each.sha256 for each in found.maps]
        try:
            wanted = self._wanted()
            maps = (
                None if sources else library.opened(sha256s, wanted, home, verify=verify)
            )
            if maps is None:
                paths = [
                    library.located(Path(each.file), each.sha256, home)
                    for each in found.maps
                ]
                maps = library.prepared(paths, sha256s, wanted, home)
        except InputError as error:
            raise SourceError(str(error)) from None
        shapes = tuple(each.nodes for each in found.maps)
        if maps.shapes != shapes or maps.spacing != found.spacing:
            raise SourceError(
                "the maps are read with other nodes or another spacing than when the database was"
                f" made: {maps.shapes} every {maps.spacing} um, {shapes} every {found.spacing} um"
                " then"
            )
        _OPEN[alone] = maps

    def _wanted(self) -> library.Wanted:
        """Return how the files are to be read and prepared."""
        spacing = None if self.spacing is None else pair(self.spacing)
        given = {**self.reading.model_dump(), **self.preparation.model_dump()}
        given = {name: value for name, value in given.items() if value is not None}
        return library.Wanted(pair(self.nodes), spacing, Reading(**given))

    def remarks(self) -> list[str]:
        """Return lines about the maps for the user of a run: numbers, place and warnings."""
        bodies = [
            self.alone(),
            *([self.opposite()] if isinstance(self.against, tuple) else []),
        ]
        lines = []
        for number, body in enumerate(bodies, start=1):
            place = f"body {number}: " if len(bodies) > 1 else ""
            maps, found = _OPEN[body], body.known()
            size = f"{len(maps.maps)} maps with a node every {in_words(found.spacing)} um"
            tiles = body._tiling().total
            lines.append(
                f"{place}{size}, {tiles} tiles; they are kept prepared in {maps.file}"
            )
            for each, prepared in zip(found.maps, maps.maps, strict=True):
                name = Path(each.file).name
                lines += [
                    f"warning: {place}{name}: {remark}" for remark in prepared.remarks
                ]
        return lines

    def places(self, randoms: Iterable[Random]) -> dict[str, NDArray[np.int32]]:
        """Return the maps and tiles of surfaces, from the random numbers of each."""
        groups, tiling = self.tile_groups(), self._tiling()
        windows = [library.drawn(random, tiling) for random in randoms]
        return {
            "map": np.array([window.map for window in windows], dtype=np.int32),
            "tile": np.array(
                [window.tile % groups for window in windows], dtype=np.int32
            ),
        }

    def tile_groups(self) -> int:
        """Return the number of groups of tiles, the values that the column `tile` can have.

        Windows of two bodies come from one group, which has tiles of both: a split along groups
        shares no node of either body.
        """
        first = self._tiling().total
        return (
            first if self.against is None else min(first, self.opposite()._tiling().total)
        )

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Cut a window out; see `GeneratedSurface.heights`."""
        return self._cut(library.drawn(random, self._tiling()))

    def opposite_heights(
        self,
        grid: Grid,
        surface: int,
        parameters: Parameters,
        first: Random,
        random: Random,
    ) -> Heights:
        """Cut the second body's window out of a tile that is paired with the first body's."""
        other, groups = self.opposite(), self.tile_groups()
        tiling = other._tiling()
        tile = library.drawn(first, self._tiling()).tile
        tiles = range(tile % groups, tiling.total, groups)
        return other._cut(library.drawn(random, tiling, tiles))

    def _cut(self, window: library.Window) -> Heights:
        """Cut a window of the first body's maps out."""
        alone = self.alone()
        if alone not in _OPEN:
            alone.make_ready(None)
        heights = _OPEN[alone].maps[window.map].heights
        return library.cut(heights, window, pair(self.nodes))

    def _tiling(self) -> library.Tiling:
        """Return the tiles of the first body's maps."""
        (nx, ny), (dx, dy), found = pair(self.nodes), self.known().spacing, self.known()
        return library.tiled(
            tuple(each.nodes for each in found.maps), (nx, ny), nx == ny and dx == dy
        )


def _require_company(first: Found, second: Found) -> None:
    """Refuse maps of two bodies with other spacings, and maps that both have."""
    if first.spacing != second.spacing:
        spacings = " and ".join(
            "{:g} x {:g}".format(*each.spacing) for each in (first, second)
        )
        raise InputError(
            f"the maps of both bodies have a node every {spacings} um: give surface.spacing, to"
            " which all are resampled"
        )
    known = {each.sha256 for each in first.maps}
    for each in second.maps:
        if each.sha256 in known:
            raise InputError(
                f"{each.file}: is one of files and of against: against = 'another' takes a second"
                " window of the same map, otherwise a surrogate would be tested on nodes that it"
                " was trained on"
            )
