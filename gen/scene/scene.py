"""Scenes: the tables of a TOML file that describe a database, and the columns that it gets."""

import hashlib
import json
import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)

from gen.distribution import Distribution, Table, conflict, limits
from gen.generators import GENERATORS, Surface
from gen.generators.scans import ScanSurface
from gen.quantities import Powers, stored_quantities
from gen.runtime.errors import InputError
from gen.runtime.files import read_bytes
from gen.runtime.terminal import printable
from gen.scene.faults import DOTTED, first_fault
from gen.scene.tables import UNITS, Contact, Delta, Load, Piece, Quantity, Store
from gen.schema import CHECKSUM, COLUMNS, DRAWN_NAMES, REASON, RUNTIME, Column
from gen.surface import DisplacedSurface, GeneratedSurface, Grid

INERT = {"samples", "title", "creator", "licence"}  # keys of a scene that change no row

MOST_BYTES = (
    200_000  # largest size of a scene's file, which has some hundreds but for its title
)


class Scene(Table):
    """Description of a database. Every key but `samples` has the paper's value as its default.

    The keys of `INERT` change no result: row i is the same in every database that is large enough
    to have it.
    """

    title: str = Field(default="", description="text in quotes")
    creator: str | None = Field(default=None, description="text in quotes")
    licence: str | None = Field(default=None, description="text in quotes")
    # Surface indices stay below 2^32, one word of a seed sequence's key: see `gen.generation.plan`.
    samples: Annotated[int, Field(ge=1, le=10**9)] = Field(
        description="the number of rows, a whole number from 1 to 1000000000"
    )
    samples_per_surface: Annotated[int, Field(ge=1, le=10_000)] = Field(
        default=1, description="a whole number from 1 to 10000"
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(
        default=2025, description="a whole number from 0 to 2^63 - 1"
    )
    surface: Surface = Field(default=DisplacedSurface(), description="a table [surface]")
    # One of the two is None, which is never written: the other one has the loads.
    delta: Delta | None = Field(default=None, description="a table [delta]")
    load: Load | None = Field(default=None, description="a table [load]")
    contact: Contact = Field(default=Contact(), description="a table [contact]")
    store: Store = Field(default=Store(), description="a table [store]")

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, content: Any) -> Any:
        """Complete a scene by what follows from its other keys."""
        if not isinstance(content, dict):
            return content
        content, generator = dict(content), GENERATORS[0].NAMES[0]
        if isinstance(surface := content.get("surface"), dict):
            content["surface"] = surface = {"generator": generator, **surface}
            generator = surface["generator"]
        # A window is a piece of a larger surface: it has no edges.
        windows = generator in ScanSurface.NAMES or isinstance(surface, ScanSurface)
        if isinstance(contact := content.get("contact", {}), dict):
            contact = {"boundary": "mirror", **contact} if windows else contact
            edgeless = contact.get("boundary", "free") != "free"
            content["contact"] = {"spacing": "side/n", **contact} if edgeless else contact
        if not windows and content.keys().isdisjoint({"delta", "load"}):
            content["delta"] = Delta()
        return content

    @model_validator(mode="after")
    def _require_what_goes_together(self) -> Self:
        """Refuse loads that the contact cannot have, and surfaces that cannot be made."""
        if self.delta is None and self.load is None:
            raise conflict(
                "surfaces of scans need loads: give [load], as quantity = 'pressure/(E* slope_rms)'"
                " and range = { log_uniform = [0.003, 0.1] }"
            )
        if (self.delta is None) == (self.load is None):
            raise conflict(
                "[delta] and [load] both say what the loads are: give one of them"
            )
        if self.contact.far_field == "compliant" and not self.quantity.startswith(
            "delta"
        ):
            raise conflict(
                f"load.quantity = '{self.quantity}' needs contact.far_field = 'rigid', not"
                " 'compliant'"
            )
        if isinstance(self.surface, ScanSurface) and self.surface.found is None:
            return self  # a run has to find the maps first
        if fault := self.surface.fault_on(self.grid):
            raise conflict(f"surface: {fault}")
        hardness = self.contact.hardness_limits
        if hardness is None or self.quantity not in {"pressure", "force"}:
            return self
        patch = (
            math.prod((*self.grid.shape, *self.grid.spacing))
            if self.quantity == "force"
            else 1.0
        )
        least = min(limits(piece.range)[0] for piece in self.pieces)
        if least >= hardness[1] * patch:
            raise conflict(
                f"load: every {self.quantity} is {least:g} {self.load_unit} or more; the patch with"
                f" a hardness of up to {hardness[1]:g} MPa carries less than"
                f" {hardness[1] * patch:g} {self.load_unit}"
            )
        return self

    @model_serializer(mode="wrap")
    def _without_absent_keys(
        self, handler: SerializerFunctionWrapHandler
    ) -> dict[str, Any]:
        """Leave out absent keys, and free boundaries unless another one is the default."""
        content: dict[str, Any] = handler(self)
        if self.contact.boundary == "free" and not self.surface.PLACES:
            content.get("contact", {}).pop("boundary", None)
        return {name: value for name, value in content.items() if value is not None}

    @property
    def quantity(self) -> Quantity:
        """The quantity that the loads are given in."""
        return "delta" if self.load is None else self.load.quantity

    @property
    def load_unit(self) -> str:
        """Unit of the loads."""
        return UNITS[self.quantity]

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """The pieces of the distribution of loads."""
        loads = self.delta if self.load is None else self.load
        assert loads is not None  # refused above
        return loads.pieces

    @property
    def grid(self) -> Grid:
        """The grid that surfaces are made on; only free patches may have MIRCO's side/n."""
        boundary, spacing = self.contact.boundary, self.contact.spacing
        cells = boundary != "free" or spacing == "side/n"
        (nx, ny), (x, y) = self.surface.patch(boundary, cells=cells)
        return Grid(
            (nx, ny), (x, y), (x / (nx - (not cells)), y / (ny - (not cells))), boundary
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Nodes along x and y."""
        return self.grid.shape

    @property
    def sides(self) -> tuple[float, float]:
        """Lengths of the patch along x and y [um]."""
        return self.grid.sides

    @property
    def spacing(self) -> tuple[float, float]:
        """Distances between neighbouring nodes along x and y [um]."""
        return self.grid.spacing

    def resolved(self, home: Path | None = None) -> Self:
        """Complete a scene by hashes of the files and sources that its surfaces depend on.

        Parameters
        ----------
        home : Path, optional
            Folder of the database, for what is prepared once for all processes; a temporary folder
            if it is left out.

        Returns
        -------
        Scene
            The scene as a database records it; the same one if everything stands in the scene.

        Raises
        ------
        InputError
            If something that the scene names is missing, or does not go with the rest of it.
        """
        surface = self.surface.resolved(home)
        if surface is self.surface:
            return self
        # Read anew: some rules of a scene need what has been found, as the spacing of maps.
        text = self.model_copy(update={"surface": surface}).text()
        return self.from_text(text, "the scene with its maps")

    @property
    def drawn_parameters(self) -> dict[str, Distribution]:
        """Distributions of the surface's parameters by their names, which are columns."""
        return self.surface.drawn()

    def with_parameters(
        self,
        values: Mapping[str, float],
        *,
        nodes: int | list[int] | None = None,
        seed: int | None = None,
    ) -> Self:
        """Return the scene whose surfaces all have the given parameters.

        Parameters
        ----------
        values : mapping of str to float
            Parameters by their names in `drawn_parameters`; the others stay as they are.
        nodes, seed : optional
            Nodes of the grid and seed; those of this scene if left out.

        Returns
        -------
        Scene
            The scene, checked as one that is read from a file.

        Raises
        ------
        InputError
            If a value is not allowed; the message names it.
        """
        content = json.loads(self.text())
        surface = content["surface"]
        surface.get("parameters", surface).update(values)
        surface |= {} if nodes is None else {"nodes": nodes}
        content |= {} if seed is None else {"seed": seed}
        return self.from_text(json.dumps(content), "the values asked for")

    def with_powers_of(self, recorded: Self) -> Self:
        """Return the scene with the powers of outputs that a database of it has recorded.

        Parameters
        ----------
        recorded : Scene
            The scene of the database.

        Returns
        -------
        Scene
            This scene, whose outputs scale as those of the database.
        """
        if self.store.powers == recorded.store.powers:
            return self
        store = self.store.model_copy(update={"powers": recorded.store.powers})
        return self.model_copy(update={"store": store})

    @property
    def surfaces(self) -> int:
        """Number of surfaces that the samples need; the last one may have fewer samples."""
        return -(-self.samples // self.samples_per_surface)

    @classmethod
    def parse(cls, text: str, source: str, folder: Path | None = None) -> Self:
        """Read a scene from TOML.

        Parameters
        ----------
        text : str
            Content of the file.
        source : str
            Name of the scene in error messages, usually that of the file.
        folder : Path, optional
            Folder that the files of maps start from; names stay as they are if it is left out.

        Returns
        -------
        Scene
            The scene that the text describes.

        Raises
        ------
        InputError
            If the text is not TOML, is empty or nested too deeply, or has a key or a value that is
            not allowed.
        """
        if DOTTED.search(text):
            raise InputError(f"{source}: not TOML of a scene: it has a key of 100 dots")
        try:
            content = tomllib.loads(text)
        except (
            ValueError,
            RecursionError,
        ) as error:  # whole numbers of over 4,300 digits too
            raise InputError(printable(f"{source}: not TOML: {error}")) from None
        return cls._validated(content, source, folder)

    @classmethod
    def from_text(cls, text: str, source: str = "the scene's text") -> Self:
        """Read a scene from the canonical text that the method `text` writes.

        Parameters
        ----------
        text : str
            The scene as JSON.
        source : str
            Name of the scene in error messages, usually that of the database.

        Returns
        -------
        Scene
            The scene that the text describes.

        Raises
        ------
        InputError
            If the text is not JSON, or has a key or a value that is not allowed.
        """
        try:
            content = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise InputError(
                printable(f"{source}: not a scene's text: {error}")
            ) from None
        return cls._validated(content, source)

    @classmethod
    def _validated(cls, content: object, source: str, folder: Path | None = None) -> Self:
        """Make a scene of nested tables, and name the first fault if that is impossible."""
        try:
            context = None if folder is None else {"folder": folder}
            return cls.model_validate(content, context=context)
        except ValidationError as error:
            raise InputError(printable(f"{source}: {first_fault(error, cls)}")) from None

    def text(self) -> str:
        """Write the canonical text: JSON in one line, keys with values in alphabetical order.

        Keys without a value, which are keys without a default that the scene does not set, are left
        out.

        Returns
        -------
        str
            The scene as JSON, which `from_text` reads.
        """
        return json.dumps(self.model_dump(exclude_none=True), sort_keys=True)

    def fingerprint(self) -> str:
        """Compute the SHA-256 of all keys that change results, see `relevant`.

        The keys of [store] count although they change no number: a database gets its columns when
        it is created, so a scene that stores more cannot continue it. Default values count as if
        they were written in the file: with a changed default it is another scene. Keys without a
        default that the scene does not set are left out: a new key of this kind changes no other
        scene.

        Returns
        -------
        str
            The hash in hexadecimal digits.
        """
        return hashlib.sha256(
            json.dumps(self.relevant(), sort_keys=True).encode()
        ).hexdigest()

    def relevant(self) -> dict[str, Any]:
        """Return the keys that change results.

        Returns
        -------
        dict
            Tables and keys with their values.
        """
        content = self.model_dump(exclude=INERT, exclude_none=True)
        content["store"].pop(
            "powers", None
        )  # they are measured, and follow from the other keys
        return {**content, "surface": self.surface.relevant(content["surface"])}


def preset_names() -> tuple[str, ...]:
    """Return the names of the scenes that are shipped in `gen/scenes`, in alphabetical order."""
    names = (entry.name for entry in (files("gen") / "scenes").iterdir())
    return tuple(
        sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))
    )


def load(name_or_path: str) -> Scene:
    """Read a shipped scene by its name, or a scene from a TOML file.

    Parameters
    ----------
    name_or_path : str
        One of `preset_names` or the path of a file; the name of a preset takes precedence.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    InputError
        If there is no such scene, the file cannot be read, or the scene is not valid. The message
        is one line with the file, the key, its value and the values that are allowed.
    """
    preset = files("gen") / "scenes" / f"{name_or_path}.toml"
    if re.fullmatch(r"[\w-]+", name_or_path) and preset.is_file():
        return Scene.parse(preset.read_text(encoding="utf-8"), f"scene {name_or_path}")
    try:
        text = read_bytes(Path(name_or_path), MOST_BYTES).decode(
            "utf-8-sig"
        )  # some editors' mark
    except FileNotFoundError:
        reason = "neither a file nor a preset"
    except UnicodeDecodeError as error:
        reason = (
            f"not UTF-8 text (byte {error.start} is {error.object[error.start]:#04x})"
        )
    except (
        ValueError
    ) as error:  # no regular file, too large, a null character in the path
        reason = str(error)
    else:
        return Scene.parse(text, name_or_path, Path(name_or_path).parent)
    presets = f"give a preset ({', '.join(preset_names())}) or the path of a TOML file"
    raise InputError(printable(f"scene {name_or_path!r}: {reason}; {presets}"))


ARGUMENTS = (
    "shape",
    "spacing",
    "rng",
)  # of a user's generator, no names of its parameters

TAKEN = "is the name of something else; give a name of your own"


def columns_of_generators(
    generators: Sequence[type[GeneratedSurface]] = GENERATORS,
) -> tuple[Column, ...]:
    """Return the columns of generators: where surfaces were taken from, and parameters.

    Parameters
    ----------
    generators : sequence of type
        Tables of surfaces; all that there are by default.

    Returns
    -------
    tuple of Column
        A column for each name, with the words of the first generator that has it.

    Raises
    ------
    ValueError
        If two generators share a name, and state two units for it.
    """
    columns: dict[str, Column] = {}
    owners: dict[str, list[str]] = {}
    for table in generators:
        for column in _columns_of(table):
            first = columns.setdefault(column.name, column)
            if (column.unit, column.dtype) != (first.unit, first.dtype):
                raise ValueError(
                    f"the generators {owners[column.name][0]} and `{table.NAMES[0]}` share the"
                    f" parameter {column.name}, one in {first.unit!r}, the other in"
                    f" {column.unit!r}: give it one unit, or two names"
                )
            owners.setdefault(column.name, []).extend(f"`{name}`" for name in table.NAMES)
    for name, column in columns.items():
        *others, last = owners[name]
        condition = f"the generator {last}"
        if others:
            condition = f"the generators {', '.join(others)} and {last}"
        columns[name] = replace(column, optional=condition)
    return tuple(sorted(columns.values(), key=lambda column: column.dtype != "i4"))


def _columns_of(table: type[GeneratedSurface]) -> Iterator[Column]:
    """Yield the columns of one generator."""
    for name, words in table.PLACES.items():
        yield Column(name, "i4", "1", words)
    for name, (unit, words, span) in table.PARAMETERS.items():
        yield Column(DRAWN_NAMES.get(name, name), "f8", unit, words, paper_range=span)


_PLACE = [column.name for column in COLUMNS].index("surface") + 1
ALL_COLUMNS = (*COLUMNS[:_PLACE], *columns_of_generators(), *COLUMNS[_PLACE:])
"""Every column that a database can have, in the order of the file."""


def markdown_of_columns() -> list[str]:
    """Return the lines of a table of all columns, with their units and meanings, in Markdown."""
    lines = ["| Column | Unit | Meaning | Paper's range |", "|---|---|---|---|"]
    for each in ALL_COLUMNS:
        span = "{:g} to {:g}".format(*each.paper_range) if each.paper_range else ""
        nodes = ", nx x ny per sample" if each.shape_of else ""
        cost = f", costs {each.cost}" if each.cost else ""
        condition = f" (with {each.optional}{cost})" if each.optional else ""
        meaning = each.long_name + nodes + condition
        lines.append(f"| `{each.path}` | {each.unit} | {meaning} | {span} |")
    return lines


RESERVED = frozenset(
    (
        *(column.name for column in ALL_COLUMNS),
        *DRAWN_NAMES,
        RUNTIME,
        "sample",
        "x",
        "y",
        "area",
    )
)
"""Names that outputs of a user's function cannot have: columns, dimensions, groups and targets."""


def columns_for(scene: Scene) -> tuple[Column, ...]:
    """Return the columns that a scene's rows are computed with: common, asked for, the user's own.

    They are in the order of the file, which has the rows' checksums besides: see `stored_columns`.
    """
    store, contact = scene.store, scene.contact
    parameters = [DRAWN_NAMES.get(name, name) for name in scene.surface.drawn()]
    asked_for = {*parameters, *scene.surface.PLACES}
    asked_for |= {name for name, wanted in store if wanted is True}
    asked_for |= {"load"} if scene.quantity != "delta" else set()
    if contact.hardness_limits is not None:
        asked_for |= {
            quantity.name for quantity in stored_quantities() if quantity.needs_hardness
        }
        asked_for |= {"hardness"} if contact.draws_hardness else set()
    words = {column.name: column for column in _columns_of(type(scene.surface))}
    chosen = []
    for column in ALL_COLUMNS:
        if column.optional and column.name not in asked_for:
            continue
        if column.name == "load":
            chosen.append(replace(column, unit=scene.load_unit, long_name=scene.quantity))
        elif column.name in words:  # other generators may say it in other words
            chosen.append(replace(words[column.name], optional=column.optional))
        else:
            chosen.append(column)
    names = [column.name for column in chosen]
    own = tuple(
        Column(name, "f8", "1", f"parameter of {scene.surface.generator}")
        for name in parameters
        if name not in names
    )
    place = names.index("surface") + 1
    last = next(index for index, column in enumerate(chosen) if column.group)
    outputs = _columns_of_outputs(store)
    return (*chosen[:place], *own, *chosen[place:last], *outputs, *chosen[last:])


def _columns_of_outputs(store: Store) -> tuple[Column, ...]:
    """Return the columns of the outputs of a user's function."""
    powers = store.powers or {}
    return tuple(
        Column(
            name,
            "f8",
            unit,
            f"output of {store.function}",
            bounds=store.bounds(name),
            powers=Powers(*powers[name]) if name in powers else None,
            measured=True,
        )
        for name, unit in (store.outputs or {}).items()
    )


def stored_columns(scene: Scene, *, checksums: bool = True) -> tuple[Column, ...]:
    """Return the columns of a scene's database in the file's order.

    Parameters
    ----------
    scene : Scene
        Scene of the database.
    checksums : bool
        Whether the database has a checksum for each row: new ones do, older ones do not.

    Returns
    -------
    tuple of Column
        Those of `columns_for`, with the checksum behind the reason.
    """
    columns = columns_for(scene)
    if not checksums:
        return columns
    place = columns.index(REASON) + 1
    return (*columns[:place], CHECKSUM, *columns[place:])


def parameter_columns(scene: Scene) -> dict[str, str]:
    """Return the columns of the parameters of a scene's surfaces, by the parameters' names."""
    return {name: DRAWN_NAMES.get(name, name) for name in scene.surface.drawn()}


def require_own_names(scene: Scene) -> None:
    """Refuse parameters and outputs of a user's functions that have the names of other columns."""
    known = {name for table in GENERATORS for name in table.PARAMETERS}
    for name in scene.surface.drawn():
        if name in RESERVED - known or name in ARGUMENTS:
            raise InputError(f"surface.parameters.{name}: {name} {TAKEN}, as own_{name}")
    for name in scene.store.outputs or ():
        if name in RESERVED or name in scene.drawn_parameters:
            raise InputError(f"store.outputs.{name}: {name} {TAKEN}, as own_{name}")
    outputs = scene.store.outputs
    for name in (*(scene.store.least or ()), *(scene.store.most or ())):
        if outputs is not None and name not in outputs:
            raise InputError(
                f"store: {name} has bounds; the outputs are {', '.join(outputs)}"
            )


def row_bytes(scene: Scene) -> int:
    """Return the size of one row of a scene's new database, all columns together [bytes]."""
    grid = scene.grid.shape
    return sum(column.row_bytes(grid) for column in stored_columns(scene))
