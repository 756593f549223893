"""Scenes: the tables of a TOML file that describe a database, and differences of two scenes."""

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
from gen.generators import GENERATORS, TAGS, Surface
from gen.quantities import LAYER_MODULUS
from gen.runtime.errors import InputError
from gen.runtime.files import read_bytes
from gen.runtime.terminal import printable
from gen.scene.accuracy import Accuracy, completed_for_accuracy
from gen.scene.expect import MEANS, Expect
from gen.scene.faults import Location, dotted, first_fault, shown
from gen.scene.tables import UNITS, Contact, Delta, Load, Piece, Quantity, Store
from gen.surface import DisplacedSurface, GeneratedSurface, Grid, Patch

THINNEST = 0.2
"""Least thickness of a layer on a free patch, over the larger spacing of the nodes [1]."""

INERT = {"samples", "title", "creator", "licence", "expect"}
"""Keys of a scene that change no row of its database."""

LARGEST_FILE = 200_000
"""Largest size of a scene's file [bytes]. Most files have some hundred bytes."""

DEFAULT_GENERATOR = GENERATORS[0].NAMES[0]
"""Generator of a scene that names none."""

SLOW_KEY = re.compile(r"(?:\.[^=.,\n]*+){100}")
"""Pattern of a key with 100 dots. The time to parse TOML grows with the square of their number."""

SOURCE_HASHES: set[Location] = {("surface", "source"), ("store", "source")}
"""Locations of the hashes of a user's source. Messages do not show these values."""


class Scene(Table):
    """Description of a database: the surfaces, the contact, the loads and the number of rows.

    Only `samples` has no default. The defaults describe the database of the paper. The keys of
    `INERT` change no result, so that a row is the same in a database with more samples.
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
    # One of the two tables has the loads. The other one is None, and is not written.
    delta: Delta | None = Field(default=None, description="a table [delta]")
    load: Load | None = Field(default=None, description="a table [load]")
    contact: Contact = Field(default=Contact(), description="a table [contact]")
    # Without this table the nodes and the tolerance are those that the scene gives.
    accuracy: Accuracy | None = Field(default=None, description="a table [accuracy]")
    store: Store = Field(default=Store(), description="a table [store]")
    # Means that `gen check` compares with the rows. The text of a scene leaves out None.
    expect: Expect | None = Field(default=None, description=MEANS)

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, content: Any) -> Any:
        """Fill in the defaults of a scene that depend on its other keys, which pydantic cannot.

        They are the generator of a table `[surface]` that names none, the boundary of surfaces that
        follow maps, and the spacing of patches without edges. A scene without loads gets the table
        `[delta]`, unless its surfaces follow maps: then the user has to give its loads. A table
        `[accuracy]` stores the columns whose errors it asks for, and gives a finest grid.
        """
        # a Scene, or content that pydantic will refuse
        if not isinstance(content, dict):
            return content
        completed = dict(content)
        surface = completed.get("surface")
        if isinstance(surface, dict):
            surface = {"generator": DEFAULT_GENERATOR, **surface}
            completed["surface"] = surface
        follows_maps = _follows_maps(surface)
        contact = completed.get("contact", {})
        if isinstance(contact, dict):
            completed["contact"] = _completed_contact(contact, mirrored=follows_maps)
        has_loads = "delta" in completed or "load" in completed
        if not follows_maps and not has_loads:
            completed["delta"] = Delta()
        if completed.get("accuracy") is not None:
            completed = completed_for_accuracy(completed)
        return completed

    @model_validator(mode="after")
    def _require_what_goes_together(self) -> Self:
        """Refuse loads that the contact cannot have, and surfaces that cannot be made."""
        self._require_one_table_of_loads()
        is_displacement = self.quantity.startswith("delta")
        if self.contact.far_field == "compliant" and not is_displacement:
            raise conflict(
                f"load.quantity = '{self.quantity}' needs contact.far_field = 'rigid', not"
                " 'compliant'"
            )
        self._require_one_modulus_for_relative_loads()
        self._require_what_goes_with_an_accuracy()
        if not self.surface.is_complete:
            # The grid is known when a run has found the files. Then the scene is checked again.
            return self
        self._require_nodes_of_surfaces()
        fault = self.surface.fault_on(self.made_grid)
        if fault:
            raise conflict(f"surface: {fault}")
        self._require_loads_that_yielding_bodies_carry()
        self._require_layers_that_free_patches_have()
        return self

    def fault_of_layer(self) -> str:
        """Tell why a layer is too thin for the cells of a free patch.

        Returns
        -------
        str
            The reason; "" if no layer is too thin for the grid of the contacts.
        """
        layer = self.contact.layer
        if layer is None or self.contact.boundary != "free":
            return ""
        thinnest_allowed = THINNEST * max(self.grid.spacing)
        thinnest = limits(layer.thickness).smallest
        if thinnest >= thinnest_allowed:
            return ""
        return (
            f"contact.layer.thickness goes down to {thinnest:g} um: on a free patch a layer has"
            f" {thinnest_allowed:g} um at least, {THINNEST:g} of a cell; give"
            " contact.boundary = 'periodic' or 'mirror'"
        )

    def _require_layers_that_free_patches_have(self) -> None:
        """Refuse layers that are too thin for the cells of a free patch."""
        fault = self.fault_of_layer()
        if fault:
            raise conflict(fault)

    def _require_one_modulus_for_relative_loads(self) -> None:
        """Refuse loads over E* if every sample has an E* of its own."""
        layer = self.contact.layer
        is_relative = self.quantity == "pressure/(E* slope_rms)"
        if layer is not None and is_relative and LAYER_MODULUS in layer.drawn:
            raise conflict(
                f"load.quantity = '{self.quantity}' needs one E*, and contact.layer.modulus is"
                " drawn: give 'pressure'"
            )

    def _require_what_goes_with_an_accuracy(self) -> None:
        """Refuse a table `[accuracy]` beside surfaces and contacts whose errors are not known."""
        if self.accuracy is None:
            return
        fault = self.surface.fault_of_accuracy()
        if fault:
            raise conflict(f"accuracy: {fault}")
        for key, needed in (("kernel", "uniform-pressure"), ("far_field", "rigid")):
            value = getattr(self.contact, key)
            if value != needed:
                raise conflict(
                    f"accuracy needs contact.{key} = '{needed}', not '{value}', which is a"
                    " statement about one grid"
                )

    def _require_nodes_of_surfaces(self) -> None:
        """Refuse a recorded grid that is finer than the one on which surfaces are made."""
        shape_made = self.made_grid.shape
        nodes = self.grid.shape
        if nodes[0] > shape_made[0] or nodes[1] > shape_made[1]:
            raise conflict(
                f"accuracy.found.nodes are {nodes[0]} x {nodes[1]}, the surfaces are made on"
                f" {shape_made[0]} x {shape_made[1]}: give no more"
            )

    def _require_one_table_of_loads(self) -> None:
        """Refuse a scene with both tables of loads, or with none."""
        if self.delta is None and self.load is None:
            raise conflict(
                "surfaces that follow maps need loads: give [load], as"
                " quantity = 'pressure/(E* slope_rms)' and range = { log_uniform = [0.003, 0.1] }"
            )
        if self.delta is not None and self.load is not None:
            raise conflict(
                "[delta] and [load] both say what the loads are: give one of them"
            )

    def _require_loads_that_yielding_bodies_carry(self) -> None:
        """Refuse pressures or forces that are all too large even for the largest hardness.

        The mean pressure on a patch of bodies that yield is below the hardness.
        """
        hardness_limits = self.contact.hardness_limits
        if hardness_limits is None or self.quantity not in {"pressure", "force"}:
            return
        _, largest_hardness = hardness_limits
        bound = largest_hardness  # of the loads, in their unit
        if self.quantity == "force":
            area = math.prod((*self.grid.shape, *self.grid.spacing))  # of all nodes [um2]
            bound *= area
        smallest = min(limits(piece.range).smallest for piece in self.pieces)
        if smallest >= bound:
            raise conflict(
                f"load: every {self.quantity} is {smallest:g} {self.load_unit} or more; the patch"
                f" with a hardness of up to {largest_hardness:g} MPa carries less than"
                f" {bound:g} {self.load_unit}"
            )

    @model_serializer(mode="wrap")
    def _without_absent_keys(
        self, handler: SerializerFunctionWrapHandler
    ) -> dict[str, Any]:
        """Return the content of a scene without keys that are None.

        A free boundary is left out too where it is the default, so that older scenes keep their
        fingerprints. If surfaces follow maps, the default is a mirror.
        """
        content: dict[str, Any] = handler(self)
        if self.contact.boundary == "free" and not self.surface.FOLLOWS_MAPS:
            content.get("contact", {}).pop("boundary", None)
        return {name: value for name, value in content.items() if value is not None}

    @property
    def quantity(self) -> Quantity:
        """The quantity in which the loads are given: a displacement, a pressure or a force."""
        return "delta" if self.load is None else self.load.quantity

    @property
    def load_unit(self) -> str:
        """Unit of the loads."""
        return UNITS[self.quantity]

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """The pieces of the distribution of loads."""
        loads = self.delta if self.load is None else self.load
        assert loads is not None  # `_require_one_table_of_loads` has checked this
        return loads.pieces

    @property
    def grid(self) -> Grid:
        """The grid on which contacts are solved.

        With the spacing "side/n", which all patches without edges have, each node has a cell of its
        own inside the sides. With "side/(n-1)" the sides reach from the first node to the last one.

        If a trial has found the nodes for an accuracy, the grid has these nodes. Surfaces that are
        not the same on any grid are then read on cells that cover the patch of `made_grid`.
        """
        if self.accuracy is None or self.accuracy.found is None:
            return self.made_grid
        nodes = self.accuracy.found.nodes
        grid_made = self._grid_of(self._patch)
        if self.surface.ON_ANY_GRID:
            return self._grid_of(Patch(nodes=nodes, sides=grid_made.sides))
        spacing = [
            step * count / fewer
            for step, count, fewer in zip(
                grid_made.spacing, grid_made.shape, nodes, strict=True
            )
        ]
        intervals = nodes if self.has_cells else (nodes[0] - 1, nodes[1] - 1)
        return Grid(
            shape=nodes,
            sides=(spacing[0] * intervals[0], spacing[1] * intervals[1]),
            spacing=(spacing[0], spacing[1]),
            boundary=grid_made.boundary,
        )

    @property
    def made_grid(self) -> Grid:
        """The grid on which surfaces are made.

        It is the one on which contacts are solved, unless a trial has found fewer nodes for
        surfaces that are not the same on any grid.
        """
        has_found = self.accuracy is not None and self.accuracy.found is not None
        if self.surface.ON_ANY_GRID and has_found:
            return self.grid
        return self._grid_of(self._patch)

    @property
    def has_cells(self) -> bool:
        """Whether each node of the grid has a cell of its own inside the sides."""
        return self.contact.boundary != "free" or self.contact.spacing == "side/n"

    @property
    def _patch(self) -> Patch:
        """The patch of the table `[surface]`."""
        return self.surface.patch(self.contact.boundary, cells=self.has_cells)

    def _grid_of(self, patch: Patch) -> Grid:
        """Return the grid of a patch."""
        shape, sides = patch
        intervals = [nodes if self.has_cells else nodes - 1 for nodes in shape]
        spacing = (sides[0] / intervals[0], sides[1] / intervals[1])
        return Grid(
            shape=shape, sides=sides, spacing=spacing, boundary=self.contact.boundary
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
        """Distances of neighbouring nodes along x and y [um]."""
        return self.grid.spacing

    def resolved(self, home: Path | None = None) -> Self:
        """Complete a scene by the hashes of the files on which its surfaces depend.

        The files are maps or the source of a user's generator. Maps are read, and prepared maps are
        written into `home`.

        Parameters
        ----------
        home : Path, optional
            Folder for the prepared maps, which all processes share: that of the database. Without
            it they are written into a temporary folder.

        Returns
        -------
        Scene
            The scene as a database records it. It is this scene itself if its surfaces depend on no
            file.

        Raises
        ------
        InputError
            If a file is missing or cannot be used, or the completed scene breaks a rule.
        """
        surface = self.surface.resolved(home)
        if surface is self.surface:
            return self
        # Some rules need properties of the files, as the spacing of maps: check the scene again.
        text = self.model_copy(update={"surface": surface}).text()
        return self.from_text(text, "the scene with its maps")

    @property
    def drawn_parameters(self) -> dict[str, Distribution]:
        """Distributions of the surface's parameters by the names of their keys."""
        return self.surface.drawn()

    def with_parameters(
        self,
        values: Mapping[str, float],
        *,
        nodes: int | list[int] | None = None,
        seed: int | None = None,
    ) -> Self:
        """Return a copy of the scene with fixed values of parameters.

        Parameters
        ----------
        values : mapping of str to float
            Values by the names in `drawn_parameters`. Parameters without a value stay as they are.
        nodes : int or list of int, optional
            Nodes along both axes, or along x and y. By default they stay as they are.
        seed : int, optional
            Seed of the copy. By default it stays as it is.

        Returns
        -------
        Scene
            The copy, which has been checked like a scene from a file.

        Raises
        ------
        InputError
            If a value is not allowed. The message names its key.
        """
        content = json.loads(self.text())
        surface = content["surface"]
        # The parameters of a user's generator are in a table of their own.
        parameters = surface.get("parameters", surface)
        parameters.update(values)
        if nodes is not None:
            surface["nodes"] = nodes
            content.pop("accuracy", None)  # the user has chosen the grid
        if values or nodes is not None:
            content.pop("expect", None)  # the population is another one
        if seed is not None:
            content["seed"] = seed
        return self.from_text(json.dumps(content), "the values asked for")

    def with_powers_of(self, recorded: Self) -> Self:
        """Return a copy of the scene with the powers of a user's outputs from another scene.

        Parameters
        ----------
        recorded : Scene
            The scene that a database has recorded, with the powers that were measured for it.

        Returns
        -------
        Scene
            The copy, or this scene itself if it has these powers already.
        """
        if self.store.powers == recorded.store.powers:
            return self
        store = self.store.model_copy(update={"powers": recorded.store.powers})
        return self.model_copy(update={"store": store})

    def with_accuracy_of(self, recorded: Self) -> Self:
        """Return a copy of the scene with the grid and tolerance that another scene has recorded.

        Parameters
        ----------
        recorded : Scene
            The scene that a database has recorded.

        Returns
        -------
        Scene
            The copy, or this scene itself if one of the two has no table `[accuracy]`. Errors that
            are asked for stay as they are, so that `differences` lists those that differ.
        """
        if self.accuracy is None or recorded.accuracy is None:
            return self
        found = recorded.accuracy.found
        return self.model_copy(
            update={
                "accuracy": self.accuracy.model_copy(update={"found": found}),
                "contact": self.contact.model_copy(
                    update={"rtol": recorded.contact.rtol}
                ),
            }
        )

    def report_of_accuracy(self) -> list[str]:
        """Return lines about the errors asked for, the grid that was found and its trial.

        Returns
        -------
        list of str
            The lines; none if the scene asks for no errors.
        """
        if self.accuracy is None:
            return []
        return self.accuracy.report(self.contact.rtol)

    @property
    def needs_trial(self) -> bool:
        """Whether a trial has to find the grid before the first row."""
        return self.accuracy is not None and self.accuracy.found is None

    @property
    def surfaces(self) -> int:
        """Number of surfaces for all samples; the last surface may have fewer samples."""
        return -(-self.samples // self.samples_per_surface)  # rounded up

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
            Folder to which the names of maps are relative. By default the names stay as they are.

        Returns
        -------
        Scene
            The scene that the text describes.

        Raises
        ------
        InputError
            If the text is not TOML or is nested too deeply, if a key is missing, or if a key or a
            value is not allowed.
        """
        if SLOW_KEY.search(text):
            raise InputError(f"{source}: not TOML of a scene: it has a key of 100 dots")
        try:
            content = tomllib.loads(text)
        except (ValueError, RecursionError) as error:
            # A ValueError may be a fault of TOML, or a whole number of over 4,300 digits.
            raise InputError(printable(f"{source}: not TOML: {error}")) from None
        _refuse_tolerance_beside_accuracy(content, source)
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
            If the text is not JSON, if a key is missing, or if a key or a value is not allowed.
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
        """Make a scene from nested tables, or raise InputError with their first fault.

        `source` is the name of the scene in the message. `folder` is the folder to which names of
        maps are relative; with None they stay as they are.
        """
        context = None if folder is None else {"folder": folder}
        try:
            return cls.model_validate(content, context=context)
        except ValidationError as error:
            raise InputError(printable(f"{source}: {first_fault(error, cls)}")) from None

    def text(self) -> str:
        """Return the canonical text of the scene: JSON in one line with sorted keys.

        Keys with default values are written too. Keys that are None and free boundaries are left
        out as in `_without_absent_keys`. Equal scenes have equal texts, which `from_text` reads.

        Returns
        -------
        str
            The JSON text, on one line.
        """
        return json.dumps(self.model_dump(exclude_none=True), sort_keys=True)

    def fingerprint(self) -> str:
        """Compute the SHA-256 of the keys that change results, see `relevant`.

        The keys of `[store]` are included although they change no number: a database gets its
        columns when it is created, so that a scene with more columns needs a new database. Default
        values are included, so that a changed default changes the hash. Keys that are None are left
        out, so that a new key of this kind does not change the hashes of older scenes.

        Returns
        -------
        str
            The hash in hexadecimal digits.
        """
        text = json.dumps(self.relevant(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def relevant(self) -> dict[str, Any]:
        """Return the keys that change results, with their values.

        Returns
        -------
        dict
            The tables of the scene as nested dictionaries.
        """
        content = self.model_dump(exclude=INERT, exclude_none=True)
        # Powers are measured, and follow from the other keys.
        content["store"].pop("powers", None)
        content["surface"] = self.surface.relevant(content["surface"])
        if self.accuracy is not None and self.accuracy.found is not None:
            # The errors of the trial are measured too.
            content["accuracy"]["found"] = {"nodes": self.accuracy.found.nodes}
        return content


def _refuse_tolerance_beside_accuracy(content: dict[str, Any], source: str) -> None:
    """Raise InputError if a user's scene, read from TOML, asks for an error and gives a tolerance.

    The default tolerance is allowed, because a scene that was written with all its keys has it. Any
    tolerance is allowed beside a grid in `accuracy.found`, because the trial has found both.
    """
    accuracy = content.get("accuracy")
    contact = content.get("contact")
    if not isinstance(accuracy, dict) or not isinstance(contact, dict):
        return
    rtol = contact.get("rtol", Contact().rtol)
    if rtol != Contact().rtol and "found" not in accuracy:
        raise InputError(
            printable(
                f"{source}: contact.rtol = {shown(rtol)}: [accuracy] finds the"
                " tolerance; leave out one of them"
            )
        )


def _follows_maps(surface: object) -> bool:
    """Tell whether surfaces follow from measured maps.

    `surface` is the content of a table `[surface]` with the key `generator`, a checked table, or
    None for the default table.
    """
    if isinstance(surface, dict):
        name = surface["generator"]
        return isinstance(name, str) and name in TAGS and TAGS[name].FOLLOWS_MAPS
    return isinstance(surface, GeneratedSurface) and surface.FOLLOWS_MAPS


def _completed_contact(contact: dict[str, Any], *, mirrored: bool) -> dict[str, Any]:
    """Return the content of `[contact]` with its defaults for patches without edges.

    With `mirrored` the boundary is a mirror by default. Patches without edges have the spacing
    "side/n".
    """
    completed = dict(contact)
    if mirrored:
        completed.setdefault("boundary", "mirror")
    if completed.get("boundary", "free") != "free":
        completed.setdefault("spacing", "side/n")
    return completed


def preset_names() -> tuple[str, ...]:
    """Return the names of the presets, the scenes in `gen/scenes`, in alphabetical order."""
    file_names = [entry.name for entry in (files("gen") / "scenes").iterdir()]
    presets = [
        name.removesuffix(".toml") for name in file_names if name.endswith(".toml")
    ]
    return tuple(sorted(presets))


def load(name_or_path: str) -> Scene:
    """Read a preset by its name, or a scene from a TOML file.

    Parameters
    ----------
    name_or_path : str
        One of `preset_names`, or the path of a file. A preset takes precedence over a file of the
        same name.

    Returns
    -------
    Scene
        The scene. In a scene from a file, names of maps are relative to the folder of the file.

    Raises
    ------
    InputError
        If there is no such scene, the file cannot be read, or the scene is not valid. The message
        is one line. For a wrong value it names the file, the key, the value and the allowed values.
    """
    preset = files("gen") / "scenes" / f"{name_or_path}.toml"
    is_name = re.fullmatch(r"[\w-]+", name_or_path)
    if is_name and preset.is_file():
        return Scene.parse(preset.read_text(encoding="utf-8"), f"scene {name_or_path}")
    try:
        path = Path(name_or_path)
        # The codec utf-8-sig leaves out the byte-order mark with which some editors begin a file.
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
    """Say why a scene's file cannot be read, from a FileNotFoundError or a ValueError.

    A ValueError is a UnicodeDecodeError, or its message is the reason: the path is no regular file,
    or the file is too large.
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
    """List the keys that change results and have different values in two scenes.

    Parameters
    ----------
    in_file : Scene
        The first scene.
    asked_for : Scene
        The second scene.
    places : tuple of two str
        Words after a value of the first scene and after a value of the second one.

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
            in_first, in_second = places
            change = f"{shown(first)} {in_first}, {shown(second)} {in_second}"
        lines.append(f"{dotted(location)}: {change}")
    return lines


def _leaves(value: object, location: Location = ()) -> Iterator[tuple[Location, object]]:
    """Yield the location and the value of every key or element that is no table and no array.

    `value` is a table, an array or a single value, and `location` is its own location.
    """
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(inner, (*location, name))
    elif isinstance(value, tuple):
        for index, inner in enumerate(value):
            yield from _leaves(inner, (*location, index))
    else:
        yield location, value
