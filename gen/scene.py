"""Scenes: the TOML files that describe a database, read and checked in this one place."""

import difflib
import hashlib
import json
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    SerializerFunctionWrapHandler,
    Strict,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gen.material import plane_strain_modulus
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file

T = TypeVar("T")

MOST_BYTES = 1_000_000
"""Largest size of a scene's file: a scene takes a few hundred bytes, apart from its title."""

DEEPEST = 16
"""Largest depth of nested tables and arrays; a scene has four levels."""

TEXTS = re.compile(
    r'''"""(?:\\.|[^\\])*?(?:"""|\\?\Z)|\'\'\'.*?(?:\'\'\'|\Z)|"(?:\\.|[^"\\\n])*"?|'[^'\n]*'?|\#[^\n]*''',
    re.DOTALL,
)
"""Texts and comments of TOML, in which dots and brackets mean nothing. Unterminated texts match
too, so that the search never starts again inside one."""

DOTTED = re.compile(r"[^=,\[\]{}\n]*")
"""A stretch of TOML that may be one dotted key."""


def _without_negative_zero(number: float) -> float:
    """Turn -0.0 into 0.0: the two are equal, and equal scenes must have equal texts."""
    return number + 0.0


def _ascending(limits: tuple[float, float]) -> tuple[float, float]:
    """Refuse a range whose lower limit is above the upper one."""
    low, high = limits
    if low > high:
        raise ValueError(f"{low!r} is above {high!r}")
    return limits


def _power_of_two_plus_one(nodes: int) -> int:
    """Refuse a number of nodes that the generators cannot make."""
    if (nodes - 1) & (nodes - 2):
        raise ValueError(f"{nodes} - 1 is not a power of two")
    return nodes


def _positive_number_or_range(value: object) -> float | tuple[float, float]:
    """Accept a finite number above 0, or an ascending pair of them.

    Done in one function because an error message for a union of types would name its members.
    """
    limits = value if isinstance(value, list | tuple) else (value, value)
    if len(limits) != 2 or not all(
        isinstance(limit, int | float)
        and not isinstance(limit, bool)
        and 0 < limit <= sys.float_info.max
        for limit in limits
    ):
        raise PydanticCustomError("positive_number_or_range", "not a positive number or range")
    low, high = _ascending((float(limits[0]), float(limits[1])))
    return (low, high) if limits is value else low


Number = Annotated[float, AfterValidator(_without_negative_zero)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
UnitInterval = Annotated[Number, Field(ge=0, le=1)]
# TOML and JSON have arrays where the models have tuples: this conversion alone is allowed.
Range = Annotated[tuple[T, T], Strict(False), AfterValidator(_ascending)]
PositiveOrRange = Annotated[float | tuple[float, float], PlainValidator(_positive_number_or_range)]


class Table(BaseModel):
    """Rules for every table of a scene: no unknown keys, no conversions, no changes afterwards.

    The description of a field completes an error message: it says which values are allowed.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Surface(Table):
    """Rough surfaces: the generator, the grid and the ranges that parameters are drawn from.

    The defaults are the paper's (section 3.2, Table 1). The paper does not give `sigma0`: its
    default is calibrated so that the 22 statistics have the ranges of Table 1.
    """

    generator: Literal["diamond-square", "midpoint"] = Field(
        default="diamond-square", description="'diamond-square' or 'midpoint'"
    )
    nodes: Annotated[int, Field(ge=3, le=4097), AfterValidator(_power_of_two_plus_one)] = Field(
        default=129, description="2^k + 1 nodes a side, a whole number from 3 to 4097"
    )
    side: Positive = Field(default=1000.0, description="a finite number above 0 [um]")
    hurst: Range[UnitInterval] = Field(
        default=(0.5, 0.8), description="[low, high], two numbers with 0 <= low <= high <= 1"
    )
    sigma0: Range[NonNegative] = Field(
        default=(10.0, 15.0),
        description="[low, high], two finite numbers with 0 <= low <= high [um]",
    )


class Piece(Table):
    """One piece of the distribution of the far-field displacement: uniform over its range."""

    share: Annotated[Positive, Field(le=1)] = Field(
        description="the share of the samples in this range, a number above 0, at most 1"
    )
    range: Range[NonNegative] = Field(
        description="[low, high], two finite numbers with 0 <= low <= high [um]"
    )


def _whole(pieces: tuple[Piece, ...]) -> tuple[Piece, ...]:
    """Refuse pieces whose shares do not sum to 1."""
    total = sum(piece.share for piece in pieces)
    if abs(total - 1.0) > 1e-9:
        raise ValueError(f"the shares sum to {total:.10g}")
    return pieces


class Delta(Table):
    """Distribution of the far-field displacement: the paper's controlled sampling (section 3.2)."""

    pieces: Annotated[tuple[Piece, ...], Strict(False), AfterValidator(_whole)] = Field(
        default=(Piece(share=0.75, range=(5.0, 25.0)), Piece(share=0.25, range=(25.0, 45.0))),
        description="one or more { share = ..., range = [low, high] }, their shares sum to 1",
    )


class Contact(Table):
    """The half-space's material, the discretisation of its contact and the solver's accuracy."""

    kernel: Literal["uniform-pressure", "concentrated-force"] = Field(
        default="uniform-pressure", description="'uniform-pressure' or 'concentrated-force'"
    )
    far_field: Literal["rigid", "compliant"] = Field(
        default="rigid", description="'rigid' or 'compliant'"
    )
    # A free patch is never written: scenes without the key keep their texts and fingerprints.
    boundary: Literal["free", "periodic", "mirror"] = Field(
        default="free", description="'free', 'periodic' or 'mirror'"
    )
    spacing: Literal["side/(n-1)", "side/n"] = Field(
        default="side/(n-1)", description="'side/(n-1)' or 'side/n'"
    )
    modulus: Positive = Field(
        default=1.0, description="Young's modulus, a finite number above 0 [MPa]"
    )
    poisson: Annotated[Number, Field(gt=-1, le=0.5)] = Field(
        default=0.0, description="Poisson's ratio, a number above -1, at most 0.5"
    )
    rtol: Annotated[Number, Field(gt=1e-14, lt=1)] = Field(
        default=2e-7, description="a number between 1e-14 and 1"
    )
    max_iterations: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=1000, description="a whole number from 1 to 1000000"
    )
    # None stands for elastic bodies and is never written: scenes without a hardness keep their
    # texts and fingerprints.
    hardness: PositiveOrRange | None = Field(
        default=None,
        description="a finite number above 0, or [low, high] with 0 < low <= high [MPa]",
    )
    hardness_ratio: PositiveOrRange | None = Field(
        default=None,
        description="a finite number above 0, or [low, high] with 0 < low <= high [E*]",
    )

    @model_validator(mode="before")
    @classmethod
    def _follow_boundary(cls, content: Any) -> Any:
        """Let the spacing of a patch without edges be that of its cells unless it is given."""
        if isinstance(content, dict) and content.get("boundary", "free") != "free":
            return {"spacing": "side/n", **content}
        return content

    @model_validator(mode="after")
    def _require_free_patch(self) -> Self:
        """Refuse settings that a patch without edges does not have."""
        if self.boundary == "free":
            return self
        for name, allowed in (
            ("spacing", "side/n"),
            ("far_field", "rigid"),
            ("kernel", "uniform-pressure"),
        ):
            if (given := getattr(self, name)) != allowed:
                raise PydanticCustomError(
                    "conflict",
                    f"boundary = '{self.boundary}' needs {name} = '{allowed}', not '{given}'",
                )
        return self

    @model_serializer(mode="wrap")
    def _without_free_boundary(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out the boundary of a free patch."""
        content: dict[str, Any] = handler(self)
        if self.boundary == "free":
            del content["boundary"]
        return content

    @model_validator(mode="after")
    def _require_one_hardness(self) -> Self:
        """Refuse two hardnesses, and a hardness that the model or the numbers cannot have."""
        if self.hardness is not None and self.hardness_ratio is not None:
            raise PydanticCustomError(
                "conflict", "hardness [MPa] and hardness_ratio [E*] are both given: give one"
            )
        if (limits := self.hardness_limits) is None:
            return self
        if self.far_field == "compliant":
            raise PydanticCustomError(
                "conflict", "a hardness needs far_field = 'rigid', not 'compliant'"
            )
        if not all(sys.float_info.min <= limit <= sys.float_info.max for limit in limits):
            raise PydanticCustomError("conflict", "the hardness is beyond what numbers hold [MPa]")
        return self

    @property
    def hardness_limits(self) -> tuple[float, float] | None:
        """Smallest and largest hardness [MPa], equal for a fixed one; None for elastic bodies."""
        given = self.hardness if self.hardness_ratio is None else self.hardness_ratio
        if given is None:
            return None
        low, high = given if isinstance(given, tuple) else (given, given)
        if self.hardness_ratio is None:
            return low, high
        modulus = plane_strain_modulus(self.modulus, self.poisson)
        return low * modulus, high * modulus

    @property
    def draws_hardness(self) -> bool:
        """Whether every sample has a hardness of its own, drawn from a range."""
        return isinstance(self.hardness, tuple) or isinstance(self.hardness_ratio, tuple)


class Store(Table):
    """Optional columns, stored besides the area, the force and the statistics."""

    mean_gap: bool = Field(default=False, description="true or false")
    largest_pressure: bool = Field(default=False, description="true or false")
    perimeter: bool = Field(default=False, description="true or false")
    heights: bool = Field(default=False, description="true or false")
    pressure: bool = Field(default=False, description="true or false")


class Scene(Table):
    """Description of a database. Every key but `samples` has the paper's value as its default.

    Neither `title` nor `samples` changes a result: row i is the same in every database that is
    large enough to have it.
    """

    title: str = Field(default="", description="text in quotes")
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
    surface: Surface = Field(default=Surface(), description="a table [surface]")
    delta: Delta = Field(default=Delta(), description="a table [delta]")
    contact: Contact = Field(default=Contact(), description="a table [contact]")
    store: Store = Field(default=Store(), description="a table [store]")

    @property
    def nodes(self) -> int:
        """Nodes a side of the solved grid: 2^k on a patch without edges, otherwise 2^k + 1."""
        return self.surface.nodes - (self.contact.boundary != "free")

    @property
    def shape(self) -> tuple[int, int]:
        """Nodes along x and y."""
        return (self.nodes, self.nodes)

    @property
    def spacing(self) -> float:
        """Distance between neighbouring nodes [um].

        It follows from the boundary, apart from free patches with MIRCO's side/n.
        """
        from bem.spacing import node_spacing  # the solver's package, which few commands need

        boundary = self.contact.boundary
        if boundary == "free" and self.contact.spacing == "side/n":
            return self.surface.side / self.nodes
        return node_spacing(self.nodes, self.surface.side, boundary)

    @property
    def surfaces(self) -> int:
        """Number of surfaces that the samples need; the last one may have fewer samples."""
        return -(-self.samples // self.samples_per_surface)

    @property
    def optional_columns(self) -> frozenset[str]:
        """Names of the optional columns that this scene asks for."""
        names = {name for name, wanted in self.store if wanted}
        if self.contact.draws_hardness:
            names.add("hardness")
        if self.contact.hardness_limits is not None:
            names.add("yielded_percent")
        return frozenset(names)

    @classmethod
    def parse(cls, text: str, source: str) -> Self:
        """Read a scene from TOML.

        Parameters
        ----------
        text : str
            Content of the file.
        source : str
            Name of the scene in error messages, usually that of the file.

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
        _require_simple(text, source)
        try:
            content = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # whole numbers of over 4,300 digits too
            raise InputError(_one_line(f"{source}: not TOML: {error}")) from None
        if not content:
            raise InputError(_one_line(f"{source}: is empty; a scene says at least samples = ..."))
        return cls._validated(content, source)

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
            raise InputError(_one_line(f"{source}: not a scene's text: {error}")) from None
        return cls._validated(content, source)

    @classmethod
    def _validated(cls, content: object, source: str) -> Self:
        """Make a scene of nested tables, and name the first fault if that is impossible."""
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            raise InputError(_one_line(f"{source}: {_first_fault(error)}")) from None

    def text(self) -> str:
        """Write the canonical text: JSON in one line, keys with values in alphabetical order.

        Keys without a value, which are keys without a default that the scene does not set, are left
        out.
        """
        return json.dumps(self.model_dump(exclude_none=True), sort_keys=True)

    def fingerprint(self) -> str:
        """Compute the SHA-256 of all keys that change results: every key but title and samples.

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
        return self.model_dump(exclude={"title", "samples"}, exclude_none=True)


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
    return Scene.parse(_read(name_or_path), name_or_path)


def differences(in_file: Scene, asked_for: Scene) -> list[str]:
    """List the keys that change results and differ between two scenes, with both values.

    Parameters
    ----------
    in_file : Scene
        The scene that a database was made with.
    asked_for : Scene
        The scene that the database is to be continued with.

    Returns
    -------
    list of str
        One text for each key, for example "contact.rtol: 2e-07 in the file, 1e-08 asked for";
        empty if the fingerprints agree.
    """
    old = dict(_leaves(in_file._relevant()))
    new = dict(_leaves(asked_for._relevant()))
    return [
        f"{_dotted(key)}: {_shown(old.get(key))} in the file, {_shown(new.get(key))} asked for"
        for key in old | new
        if old.get(key) != new.get(key)
    ]


Location = tuple[int | str, ...]


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


def _read(path: str) -> str:
    """Read a scene's file; drop the byte order mark that some editors write."""
    try:
        with require_file(Path(path)).open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) <= MOST_BYTES:
            return content.decode("utf-8-sig")
        reason = f"over {MOST_BYTES:,} bytes"
    except InputError:
        raise
    except FileNotFoundError:
        reason = "neither a file nor a preset"
    except UnicodeDecodeError as error:
        reason = f"not UTF-8 text (byte {error.start} is {error.object[error.start]:#04x})"
    except OSError as error:
        reason = error.strerror or str(error)
    except ValueError as error:  # a null character in the path
        reason = str(error)
    presets = ", ".join(preset_names())
    raise InputError(
        _one_line(f"scene {path!r}: {reason}; give a preset ({presets}) or the path of a TOML file")
    )


def _require_simple(text: str, source: str) -> None:
    """Refuse texts that keep a TOML parser busy for minutes: deep arrays, keys of many dots."""
    bare = TEXTS.sub("", text)
    depth = deepest = 0
    for bracket in re.findall(r"[\[\]{}]", bare):
        depth += 1 if bracket in "[{" else -1
        deepest = max(deepest, depth)
    if deepest > DEEPEST or any(key.count(".") > DEEPEST for key in DOTTED.findall(bare)):
        raise InputError(_one_line(f"{source}: not TOML of a scene: over {DEEPEST} levels deep"))


def _first_fault(error: ValidationError) -> str:
    """Describe the first fault of a scene, and say how many more there are."""
    faults = error.errors(include_url=False)
    # A misspelt key makes another one look missing: the misspelt one is the better news.
    fault = min(faults, key=lambda fault: fault["type"] != "extra_forbidden")
    location, value = fault["loc"], _shown(fault["input"])
    key = _dotted(location)
    if fault["type"] == "extra_forbidden":
        text = f"unknown key {key} = {value}; the closest known key is {_closest_key(location)}"
    elif fault["type"] == "missing":
        text = f"{key} is missing; allowed: {_allowed(location)}"
    elif not location:
        text = f"a scene is a table of keys, not {value}"
    elif fault["type"] == "conflict":
        text = f"{key}: {fault['msg']}"
    else:
        text = f"{key} = {value}; allowed: {_allowed(location)}"
    if fault["type"] == "value_error":
        text += f" ({fault['ctx']['error']})"
    return text if len(faults) == 1 else f"{text} (and {len(faults) - 1} more)"


def _known_keys(table: type[Table] = Scene, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield every key of a scene, dotted and without indices, with its allowed values in words."""
    for name, field in table.model_fields.items():
        yield prefix + name, field.description or ""
        for kind in (field.annotation, *get_args(field.annotation)):
            if isinstance(kind, type) and issubclass(kind, Table):
                yield from _known_keys(kind, f"{prefix}{name}.")


def _allowed(location: Location) -> str:
    """Return the allowed values, in words, of the key that a location belongs to."""
    return dict(_known_keys())[_dotted(part for part in location if isinstance(part, str))]


def _closest_key(location: Location) -> str:
    """Return the known key whose last name resembles an unknown one most, in any table."""
    keys = {key.rpartition(".")[2]: key for key, _ in _known_keys()}
    return keys[difflib.get_close_matches(str(location[-1]), keys, n=1, cutoff=0.0)[0]]


def _dotted(location: Iterator[str] | Location) -> str:
    """Write a location as a dotted key, for example "delta.pieces[0].share"."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return "".join(parts).removeprefix(".")


def _shown(value: object) -> str:
    """Write a value for a message: short, and in TOML's notation."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    try:
        text = repr(value)
    except ValueError:  # Python refuses to write out whole numbers of over 4,300 digits
        text = "a number of thousands of digits"
    return text if len(text) <= 80 else f"{text[:76]} ..."


def _one_line(message: str) -> str:
    """Escape line breaks and control characters, which a message may quote from the input."""
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in message
    )
