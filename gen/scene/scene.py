"""Scenes: the tables of a TOML file that describe a database, shipped ones and those in files."""

import hashlib
import json
import math
import tomllib
from collections.abc import Iterator, Mapping
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
from pydantic_core import PydanticCustomError

from gen.distribution import Distribution, Table, limits
from gen.generators import TAGS, DisplacedSurface, ScanSurface, Surface, tag_of
from gen.runtime.errors import InputError
from gen.runtime.files import read_bytes
from gen.runtime.terminal import printable
from gen.scene.faults import DOTTED, Location, dotted, first_fault, shown
from gen.scene.tables import UNITS, Contact, Delta, Load, Piece, Quantity, Store
from gen.surface import Grid

INERT = {"samples", "title", "creator", "licence"}  # keys of a scene that change no row

MOST_BYTES = 200_000
"""Largest size of a scene's file: a scene takes a few hundred bytes, apart from its title."""


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
        """Give a scene without loads the paper's displacements, and windows no edges.

        A window is a piece of a larger surface: a free patch would have edges where the surface has
        none.
        """
        if not isinstance(content, dict):
            return content
        if TAGS[tag_of(content.get("surface"))].WINDOWS:
            contact = content.get("contact", {})
            mirrored = {"boundary": "mirror", **contact} if isinstance(contact, dict) else contact
            return {**content, "contact": mirrored}
        if content.keys().isdisjoint({"delta", "load"}):
            return {**content, "delta": Delta()}
        return content

    @model_validator(mode="after")
    def _require_one_table_of_loads(self) -> Self:
        """Refuse two tables of loads, none, and loads that the contact cannot have."""
        if self.delta is None and self.load is None:
            raise PydanticCustomError(
                "conflict",
                "surfaces of scans need loads: give [load], as quantity = 'pressure/(E* slope_rms)'"
                " and range = { log_uniform = [0.003, 0.1] }",
            )
        if (self.delta is None) == (self.load is None):
            raise PydanticCustomError(
                "conflict", "[delta] and [load] both say what the loads are: give one of them"
            )
        if self.contact.far_field == "compliant" and not self.quantity.startswith("delta"):
            raise PydanticCustomError(
                "conflict",
                f"load.quantity = '{self.quantity}' needs contact.far_field = 'rigid', not"
                " 'compliant'",
            )
        return self

    @model_validator(mode="after")
    def _require_surfaces_and_solutions(self) -> Self:
        """Refuse surfaces that cannot be made, and loads all of which exceed the hardness.

        Those of maps are known once a run has found them. Corrected areas need square cells.
        """
        if isinstance(self.surface, ScanSurface) and self.surface.found is None:
            return self
        if fault := self.surface.fault_on(self.grid):
            raise PydanticCustomError("conflict", f"surface: {fault}")
        hardness = self.contact.hardness_limits
        if hardness is None or self.quantity not in {"pressure", "force"}:
            return self
        patch = math.prod(self.shape) * math.prod(self.spacing) if self.quantity == "force" else 1.0
        least = min(limits(piece.range)[0] for piece in self.pieces)
        if least >= hardness[1] * patch:
            raise PydanticCustomError(
                "conflict",
                f"load: every {self.quantity} is {least:g} {self.load_unit} or more; the patch with"
                f" a hardness of up to {hardness[1]:g} MPa carries less than"
                f" {hardness[1] * patch:g} {self.load_unit}",
            )
        return self

    @model_serializer(mode="wrap")
    def _without_absent_loads(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out the table of loads that the scene does not have."""
        content: dict[str, Any] = handler(self)
        if self.surface.WINDOWS:  # their boundary is not free by default
            content["contact"]["boundary"] = self.contact.boundary
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
    def edgeless(self) -> bool:
        """Whether the patch is periodic or surrounded by its mirror images."""
        return self.contact.boundary != "free"

    @property
    def grid(self) -> Grid:
        """The grid that surfaces are made on; only free patches may have MIRCO's side/n."""
        contact = self.contact
        return self.surface.grid(contact.boundary, cells=contact.spacing == "side/n")

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

    @property
    def surfaces(self) -> int:
        """Number of surfaces that the samples need; the last one may have fewer samples."""
        return -(-self.samples // self.samples_per_surface)

    @property
    def optional_columns(self) -> frozenset[str]:
        """Names of the optional columns that this scene asks for."""
        names = {name for name, wanted in self.store if wanted is True}
        names |= self.drawn_parameters.keys() | self.surface.PLACES.keys()
        if self.quantity != "delta":
            names.add("load")
        if self.contact.draws_hardness:
            names.add("hardness")
        if self.contact.hardness_limits is not None:
            names.add("yielded_percent")
        return frozenset(names)

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
        except (ValueError, RecursionError) as error:  # whole numbers of over 4,300 digits too
            raise InputError(printable(f"{source}: not TOML: {error}")) from None
        if not content:
            raise InputError(printable(f"{source}: is empty; a scene says at least samples = ..."))
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
            raise InputError(printable(f"{source}: not a scene's text: {error}")) from None
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
        """Compute the SHA-256 of all keys that change results: every key but those of `INERT`.

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
        return hashlib.sha256(json.dumps(self._relevant(), sort_keys=True).encode()).hexdigest()

    def _relevant(self) -> dict[str, Any]:
        """Return the keys that change results, with their values."""
        content = self.model_dump(exclude=INERT, exclude_none=True)
        return {**content, "surface": self.surface.relevant(content["surface"])}


def preset_names() -> tuple[str, ...]:
    """Return the names of the scenes that are shipped in `gen/scenes`, in alphabetical order."""
    names = (entry.name for entry in (files("gen") / "scenes").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


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
    if name_or_path in preset_names():
        preset = files("gen") / "scenes" / f"{name_or_path}.toml"
        return Scene.parse(preset.read_text(encoding="utf-8"), f"scene {name_or_path}")
    return Scene.parse(_read(name_or_path), name_or_path, Path(name_or_path).parent)


def _read(path: str) -> str:
    """Read a scene's file; drop the byte order mark that some editors write."""
    try:
        return read_bytes(Path(path), MOST_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        reason = "neither a file nor a preset"
    except UnicodeDecodeError as error:
        reason = f"not UTF-8 text (byte {error.start} is {error.object[error.start]:#04x})"
    except ValueError as error:  # no regular file, too large, a null character in the path
        reason = str(error)
    presets = ", ".join(preset_names())
    raise InputError(
        printable(f"scene {path!r}: {reason}; give a preset ({presets}) or the path of a TOML file")
    )


def differences(in_file: Scene, asked_for: Scene) -> list[str]:
    """List the keys that change results and differ between two scenes, with both values.

    Each is a text as "contact.rtol: 2e-07 in the file, 1e-08 asked for".
    """
    old = dict(_leaves(in_file._relevant()))
    new = dict(_leaves(asked_for._relevant()))
    hashes = {("surface", "source"), ("store", "source")}
    return [
        f"{dotted(key)}: the source of the function's module has changed"
        if key in hashes and key in old and key in new
        else f"{dotted(key)}: {shown(old.get(key))} in the file, {shown(new.get(key))} asked for"
        for key in old | new
        if old.get(key) != new.get(key)
    ]


def _leaves(value: object, location: Location = ()) -> Iterator[tuple[Location, object]]:
    """Yield every single value of nested tables and arrays with its location."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(inner, (*location, name))
    elif isinstance(value, tuple):
        for index, inner in enumerate(value):
            yield from _leaves(inner, (*location, index))
    else:
        yield location, value
