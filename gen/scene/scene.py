"""Scenes: the tables of a TOML file that describe a database, and what makes two of them differ."""

import hashlib
import json
import math
import re
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

from gen.distribution import Distribution, Table, conflict, limits
from gen.generators import GENERATORS, Surface
from gen.generators.scans import ScanSurface
from gen.runtime.errors import InputError
from gen.runtime.files import read_bytes
from gen.runtime.terminal import printable
from gen.scene.faults import Location, dotted, first_fault, shown
from gen.scene.tables import UNITS, Contact, Delta, Load, Piece, Quantity, Store
from gen.surface import DisplacedSurface, Grid

INERT = {"samples", "title", "creator", "licence"}
"""Keys of a scene that change no row."""

LARGEST_FILE = 200_000
"""Largest size of a scene's file [bytes]. Without a long title it has some hundreds."""

DEFAULT_GENERATOR = GENERATORS[0].NAMES[0]
"""Generator of a scene that names none."""

SLOW_KEY = re.compile(r"(?:\.[^=.,\n]*+){100}")
"""Pattern of a key with 100 dots. The parser of TOML takes a time that grows with their square."""

SOURCE_HASHES: set[Location] = {("surface", "source"), ("store", "source")}
"""Keys with the hash of the source of a user's function. Messages do not show their values."""


class Scene(Table):
    """Description of a database. Every key but `samples` has the paper's value as its default.

    The keys of `INERT` change no result: row i is the same in every database that is large enough
    to have it.
    """

    title: str = Field(default="", description="text in quotes")
    creator: str | None = Field(default=None, description="text in quotes")
    licence: str | None = Field(default=None, description="text in quotes")
    # Indices of surfaces stay below 2^32, as each is one word of a key: see `gen.generation.plan`.
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
    # The loads stand in one of the two tables. The other one is None, and is not written.
    delta: Delta | None = Field(default=None, description="a table [delta]")
    load: Load | None = Field(default=None, description="a table [load]")
    contact: Contact = Field(default=Contact(), description="a table [contact]")
    store: Store = Field(default=Store(), description="a table [store]")

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, content: Any) -> Any:
        """Return the content of a scene with the defaults that follow from its other keys."""
        if not isinstance(content, dict):
            return content
        completed = dict(content)
        surface = completed.get("surface")
        if isinstance(surface, dict):
            surface = {"generator": DEFAULT_GENERATOR, **surface}
            completed["surface"] = surface
        windows = _are_windows(surface)
        contact = completed.get("contact", {})
        if isinstance(contact, dict):
            completed["contact"] = _completed_contact(contact, windows=windows)
        if not windows and "delta" not in completed and "load" not in completed:
            completed["delta"] = Delta()
        return completed

    @model_validator(mode="after")
    def _require_what_goes_together(self) -> Self:
        """Refuse loads that the contact cannot have, and surfaces that cannot be made."""
        self._require_one_table_of_loads()
        if self.contact.far_field == "compliant" and not self.quantity.startswith(
            "delta"
        ):
            raise conflict(
                f"load.quantity = '{self.quantity}' needs contact.far_field = 'rigid', not"
                " 'compliant'"
            )
        if isinstance(self.surface, ScanSurface) and self.surface.found is None:
            return self  # a run has to find the maps before the grid is known
        fault = self.surface.fault_on(self.grid)
        if fault:
            raise conflict(f"surface: {fault}")
        self._require_loads_that_yielding_bodies_carry()
        return self

    def _require_one_table_of_loads(self) -> None:
        """Refuse a scene with both tables of loads, or with none."""
        if self.delta is None and self.load is None:
            raise conflict(
                "surfaces of scans need loads: give [load], as quantity = 'pressure/(E* slope_rms)'"
                " and range = { log_uniform = [0.003, 0.1] }"
            )
        if self.delta is not None and self.load is not None:
            raise conflict(
                "[delta] and [load] both say what the loads are: give one of them"
            )

    def _require_loads_that_yielding_bodies_carry(self) -> None:
        """Refuse pressures or forces that are all above what the largest hardness carries."""
        hardness = self.contact.hardness_limits
        if hardness is None or self.quantity not in {"pressure", "force"}:
            return
        carried = hardness[1]
        if self.quantity == "force":
            carried *= math.prod((*self.grid.shape, *self.grid.spacing))
        smallest = min(limits(piece.range)[0] for piece in self.pieces)
        if smallest >= carried:
            raise conflict(
                f"load: every {self.quantity} is {smallest:g} {self.load_unit} or more; the patch"
                f" with a hardness of up to {hardness[1]:g} MPa carries less than"
                f" {carried:g} {self.load_unit}"
            )

    @model_serializer(mode="wrap")
    def _without_absent_keys(
        self, handler: SerializerFunctionWrapHandler
    ) -> dict[str, Any]:
        """Return the keys of a scene without absent ones, and without free boundaries.

        A free boundary is written where it is not the default, which is on pieces of larger
        surfaces.
        """
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
        assert loads is not None  # `_require_one_table_of_loads` refuses it
        return loads.pieces

    @property
    def grid(self) -> Grid:
        """The grid that surfaces are made on.

        With the spacing side/n, which all patches without edges have, each node has a cell of its
        own inside the sides. Otherwise the sides reach from the first node to the last one.
        """
        boundary = self.contact.boundary
        cells = boundary != "free" or self.contact.spacing == "side/n"
        shape, sides = self.surface.patch(boundary, cells=cells)
        intervals = [nodes if cells else nodes - 1 for nodes in shape]
        spacing = (sides[0] / intervals[0], sides[1] / intervals[1])
        return Grid(shape, sides, spacing, boundary)

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

        The files are read, and what is prepared of them is written into `home`.

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
        # Some rules need what is known only now, as the spacing of maps: check the scene again.
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
        parameters = surface.get(
            "parameters", surface
        )  # a user's generator has such a table
        parameters.update(values)
        if nodes is not None:
            surface["nodes"] = nodes
        if seed is not None:
            content["seed"] = seed
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
        if SLOW_KEY.search(text):
            raise InputError(f"{source}: not TOML of a scene: it has a key of 100 dots")
        try:
            content = tomllib.loads(text)
        except (ValueError, RecursionError) as error:
            # ValueError is raised for whole numbers of over 4,300 digits too.
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
        """Make a scene of nested tables; raise InputError with the first fault of wrong ones.

        `source` is the scene's name in messages, `folder` the folder that names of maps start from.
        """
        context = None if folder is None else {"folder": folder}
        try:
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
        text = json.dumps(self.relevant(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def relevant(self) -> dict[str, Any]:
        """Return the keys that change results.

        Returns
        -------
        dict
            Tables and keys with their values.
        """
        content = self.model_dump(exclude=INERT, exclude_none=True)
        # Powers are measured, and follow from the other keys.
        content["store"].pop("powers", None)
        content["surface"] = self.surface.relevant(content["surface"])
        return content


def _are_windows(surface: object) -> bool:
    """Return whether the surfaces are windows of scans, which have no edges.

    `surface` is a table with its generator, a read surface, or None for the default.
    """
    if isinstance(surface, dict):
        return surface["generator"] in ScanSurface.NAMES
    return isinstance(surface, ScanSurface)


def _completed_contact(contact: dict[str, Any], *, windows: bool) -> dict[str, Any]:
    """Return the table of the contact with the defaults of windows and of patches without edges."""
    completed = dict(contact)
    if windows:
        completed.setdefault("boundary", "mirror")
    if completed.get("boundary", "free") != "free":
        completed.setdefault("spacing", "side/n")
    return completed


def preset_names() -> tuple[str, ...]:
    """Return the names of the scenes that are shipped in `gen/scenes`, in alphabetical order."""
    names = [entry.name for entry in (files("gen") / "scenes").iterdir()]
    scenes = [name.removesuffix(".toml") for name in names if name.endswith(".toml")]
    return tuple(sorted(scenes))


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
        path = Path(name_or_path)
        # Some editors begin a file with a mark, which utf-8-sig leaves out.
        text = read_bytes(path, LARGEST_FILE).decode("utf-8-sig")
    except (FileNotFoundError, ValueError) as error:
        presets = ", ".join(preset_names())
        raise InputError(
            printable(
                f"scene {name_or_path!r}: {_reason_of(error)}; give a preset ({presets}) or the"
                " path of a TOML file"
            )
        ) from None
    return Scene.parse(text, name_or_path, path.parent)


def _reason_of(error: Exception) -> str:
    """Say why the text of a scene's file cannot be read.

    A ValueError has the reason in its own words: the path is not that of a regular file, or the
    file is too large.
    """
    if isinstance(error, FileNotFoundError):
        return "neither a file nor a preset"
    if isinstance(error, UnicodeDecodeError):
        byte = error.object[error.start]
        return f"not UTF-8 text (byte {error.start} is {byte:#04x})"
    return str(error)


def differences(
    in_file: Scene,
    asked_for: Scene,
    places: tuple[str, str] = ("in the file", "asked for"),
) -> list[str]:
    """List the keys that change results and differ between two scenes.

    Parameters
    ----------
    in_file, asked_for : Scene
        The scenes.
    places : tuple of two str
        Where the values of the first and of the second scene stand, in words.

    Returns
    -------
    list of str
        A line for each key, as "seed: 1 in the file, 2 asked for".
    """
    first_values = dict(_leaves(in_file.relevant()))
    second_values = dict(_leaves(asked_for.relevant()))
    lines = []
    for location in first_values | second_values:
        first = first_values.get(location)
        second = second_values.get(location)
        if first == second:
            continue
        if location in SOURCE_HASHES and first is not None and second is not None:
            change = "the source of the function's module has changed"
        else:
            change = f"{shown(first)} {places[0]}, {shown(second)} {places[1]}"
        lines.append(f"{dotted(location)}: {change}")
    return lines


def _leaves(value: object, location: Location = ()) -> Iterator[tuple[Location, object]]:
    """Yield the location of every single value of nested tables and arrays, and the value."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(inner, (*location, name))
    elif isinstance(value, tuple):
        for index, inner in enumerate(value):
            yield from _leaves(inner, (*location, index))
    else:
        yield location, value
