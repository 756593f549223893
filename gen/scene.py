"""Scenes: the TOML files that say what to generate, read and checked in this one place."""

import difflib
import hashlib
import json
import re
import tomllib
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict, ValidationError

from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file

T = TypeVar("T")

MOST_BYTES = 1_000_000
"""Size of a scene's file at most; a title apart, a few hundred bytes say all there is to say."""

DEEPEST = 16
"""Tables and arrays within each other at most; a scene has four."""

TEXTS = re.compile(
    r'''"""(?:\\.|[^\\])*?(?:"""|\\?\Z)|\'\'\'.*?(?:\'\'\'|\Z)|"(?:\\.|[^"\\\n])*"?|'[^'\n]*'?|\#[^\n]*''',
    re.DOTALL,
)
"""Texts and comments of TOML, in which dots and brackets mean nothing; also texts without an end,
so that no text is looked through twice."""

DOTTED = re.compile(r"[^=,\[\]{}\n]*")
"""What may be one key, with its dots."""


def _without_negative_zero(number: float) -> float:
    """Equal scenes must have equal texts: -0.0 == 0.0, yet they are written differently."""
    return number + 0.0


def _ascending(limits: tuple[float, float]) -> tuple[float, float]:
    low, high = limits
    if low > high:
        raise ValueError(f"{low!r} is above {high!r}")
    return limits


def _power_of_two_plus_one(nodes: int) -> int:
    if (nodes - 1) & (nodes - 2):
        raise ValueError(f"{nodes} - 1 is not a power of two")
    return nodes


Number = Annotated[float, AfterValidator(_without_negative_zero)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
UnitInterval = Annotated[Number, Field(ge=0, le=1)]
# TOML and JSON have arrays, Python's models have tuples: strict about everything but that.
Range = Annotated[tuple[T, T], Strict(False), AfterValidator(_ascending)]


class Table(BaseModel):
    """What all tables of a scene share: unknown keys refused, no conversions, immutable.

    A field's description is what an error message names as allowed.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Surface(Table):
    """Rough surfaces: the generator, the grid and the ranges that each surface is drawn from.

    The defaults are the paper's: section 3.2 and Table 1 (`hurst`, `side`); `sigma0`, which the
    paper does not give, is calibrated against Table 1's ranges of the 22 statistics.
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
    total = sum(piece.share for piece in pieces)
    if abs(total - 1.0) > 1e-9:
        raise ValueError(f"the shares sum to {total:.10g}")
    return pieces


class Delta(Table):
    """The far-field displacement's distribution: controlled sampling (section 3.2)."""

    pieces: Annotated[tuple[Piece, ...], Strict(False), AfterValidator(_whole)] = Field(
        default=(Piece(share=0.75, range=(5.0, 25.0)), Piece(share=0.25, range=(25.0, 45.0))),
        description="one or more { share = ..., range = [low, high] }, their shares sum to 1",
    )


class Contact(Table):
    """The half-space, how its contact is discretised, and how exactly it is solved."""

    kernel: Literal["uniform-pressure", "concentrated-force"] = Field(
        default="uniform-pressure", description="'uniform-pressure' or 'concentrated-force'"
    )
    far_field: Literal["rigid", "compliant"] = Field(
        default="rigid", description="'rigid' or 'compliant'"
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


class Store(Table):
    """What is stored besides area, force and the statistics."""

    mean_gap: bool = Field(default=False, description="true or false")
    largest_pressure: bool = Field(default=False, description="true or false")
    perimeter: bool = Field(default=False, description="true or false")
    heights: bool = Field(default=False, description="true or false")
    pressure: bool = Field(default=False, description="true or false")


class Scene(Table):
    """What to generate: every key but `samples` may be left out and then has the paper's value.

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
    def shape(self) -> tuple[int, int]:
        """Nodes along x and y."""
        return (self.surface.nodes, self.surface.nodes)

    @property
    def spacing(self) -> float:
        """Distance of neighbouring nodes [um]: side/(n-1), or MIRCO's side/n."""
        intervals = self.surface.nodes - (self.contact.spacing == "side/(n-1)")
        return self.surface.side / intervals

    @property
    def surfaces(self) -> int:
        """Number of surfaces that the samples need; the last may serve fewer samples."""
        return -(-self.samples // self.samples_per_surface)

    @classmethod
    def parse(cls, text: str, source: str) -> Self:
        """Read a scene from TOML.

        Parameters
        ----------
        text : the file's content
        source : what error messages call it, usually the file's name

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
        """Read a scene from its canonical text, as `text` wrote it.

        Parameters
        ----------
        text : JSON
        source : what error messages call it, usually the database's name

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
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            raise InputError(_one_line(f"{source}: {_first_fault(error)}")) from None

    def text(self) -> str:
        """Canonical text: JSON in one line, every key with its value, in alphabetical order."""
        return json.dumps(self.model_dump(), sort_keys=True)

    def fingerprint(self) -> str:
        """SHA-256, in hexadecimal, of the keys that change results: all but title and samples.

        The keys of [store] count, although they change no number: the columns of a database are
        made when it is created, so a scene that stores more cannot continue one that stores less.
        Defaults count as if they were written: a changed default is another scene.
        """
        return hashlib.sha256(json.dumps(self._relevant(), sort_keys=True).encode()).hexdigest()

    def _relevant(self) -> dict[str, Any]:
        """The keys that `fingerprint` and `differences` are about."""
        return self.model_dump(exclude={"title", "samples"})


def preset_names() -> tuple[str, ...]:
    """Names of the scenes that are shipped in `gen/scenes`, in alphabetical order."""
    names = (entry.name for entry in (files("gen") / "scenes").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def load(name_or_path: str) -> Scene:
    """Read a shipped scene by its name, or any other from a TOML file.

    Parameters
    ----------
    name_or_path : one of `preset_names`, which goes before a file of that name, or a path

    Raises
    ------
    InputError
        If there is no such scene, the file cannot be read, or it does not hold a valid scene; in
        one line: the file, the key, its value and what is allowed.
    """
    if name_or_path in preset_names():
        preset = files("gen") / "scenes" / f"{name_or_path}.toml"
        return Scene.parse(preset.read_text(encoding="utf-8"), f"scene {name_or_path}")
    return Scene.parse(_read(name_or_path), name_or_path)


def differences(in_file: Scene, asked_for: Scene) -> list[str]:
    """Result-relevant keys in which two scenes differ, with both values.

    Parameters
    ----------
    in_file : the scene that a database was made with
    asked_for : the scene that it is to be continued with

    Returns
    -------
    One string a key, such as "contact.rtol: 2e-07 in the file, 1e-08 asked for"; none where the
    fingerprints agree.
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
    """Every single value of nested tables and arrays, with its location."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(inner, (*location, name))
    elif isinstance(value, tuple):
        for index, inner in enumerate(value):
            yield from _leaves(inner, (*location, index))
    else:
        yield location, value


def _read(path: str) -> str:
    """Content of a scene's file; a byte order mark, which some editors write, is dropped."""
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
    """Refuse what would keep a parser of TOML busy for minutes: deep arrays, keys of many dots."""
    bare = TEXTS.sub("", text)
    depth = deepest = 0
    for bracket in re.findall(r"[\[\]{}]", bare):
        depth += 1 if bracket in "[{" else -1
        deepest = max(deepest, depth)
    if deepest > DEEPEST or any(key.count(".") > DEEPEST for key in DOTTED.findall(bare)):
        raise InputError(_one_line(f"{source}: not TOML of a scene: over {DEEPEST} levels deep"))


def _first_fault(error: ValidationError) -> str:
    """The first of a scene's faults, and how many more there are."""
    faults = error.errors(include_url=False)
    # A misspelt key makes others look missing: what it should have been is the better news.
    fault = min(faults, key=lambda fault: fault["type"] != "extra_forbidden")
    location, value = fault["loc"], _shown(fault["input"])
    key = _dotted(location)
    if fault["type"] == "extra_forbidden":
        text = f"unknown key {key} = {value}; the closest known key is {_closest_key(location)}"
    elif fault["type"] == "missing":
        text = f"{key} is missing; allowed: {_allowed(location)}"
    elif not location:
        text = f"a scene is a table of keys, not {value}"
    else:
        text = f"{key} = {value}; allowed: {_allowed(location)}"
    if fault["type"] == "value_error":
        text += f" ({fault['ctx']['error']})"
    return text if len(faults) == 1 else f"{text} (and {len(faults) - 1} more)"


def _known_keys(table: type[Table] = Scene, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Every key of a scene, dotted and without indices, with what is allowed for it."""
    for name, field in table.model_fields.items():
        yield prefix + name, field.description or ""
        for kind in (field.annotation, *get_args(field.annotation)):
            if isinstance(kind, type) and issubclass(kind, Table):
                yield from _known_keys(kind, f"{prefix}{name}.")


def _allowed(location: Location) -> str:
    """What is allowed for the key that a location belongs to."""
    return dict(_known_keys())[_dotted(part for part in location if isinstance(part, str))]


def _closest_key(location: Location) -> str:
    """The known key that an unknown one resembles most: by its own name, in whichever table."""
    keys = {key.rpartition(".")[2]: key for key, _ in _known_keys()}
    return keys[difflib.get_close_matches(str(location[-1]), keys, n=1, cutoff=0.0)[0]]


def _dotted(location: Iterator[str] | Location) -> str:
    """A key as a reader of the file would name it, such as "delta.pieces[0].share"."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return "".join(parts).removeprefix(".")


def _shown(value: object) -> str:
    """A value for a message: short, and as TOML would have it."""
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
    """Messages quote what was given: nothing in it may break the line or drive a terminal."""
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in message
    )
