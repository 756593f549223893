"""Measured maps in a scene: how files are read and prepared, and the maps found by a run."""

import sys
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, Strict
from pydantic_core import PydanticCustomError

from gen.scene.table import Positive, Table

MOST_PATTERNS = 1000
"""Largest number of names in the list of files."""


def files(value: object) -> tuple[str, ...]:
    """Accept a name or a list of names."""
    names = (value,) if isinstance(value, str) else value
    if (
        not isinstance(names, list | tuple)
        or not 1 <= len(names) <= MOST_PATTERNS
        or not all(isinstance(name, str) and name.strip() for name in names)
    ):
        raise PydanticCustomError("files", "not a name or a list of names")
    return tuple(names)


Files = Annotated[tuple[str, ...], PlainValidator(files)]
FILES = "a file, a folder or a pattern as 'scans/*.x3p', or a list of these"

LONGEST = 200
"""Largest length of a text."""

Text = Annotated[str, Field(max_length=LONGEST)]


def lengths(value: object) -> str:
    """Accept scan lengths as a text, a number, or a pair of numbers, and return their text."""
    if isinstance(value, str) and len(value) <= LONGEST:
        return value  # checked where the maps are looked for
    pair = isinstance(value, list | tuple) and len(value) == 2
    numbers: list[Any] = list(value) if pair else [value]  # type: ignore[call-overload]
    if not all(type(each) in {int, float} and 0 < each <= sys.float_info.max for each in numbers):
        raise PydanticCustomError("lengths", "not a length or a pair of lengths")
    return ",".join(repr(float(each)).removesuffix(".0") for each in numbers)


Lengths = Annotated[str, PlainValidator(lengths)]


class Reading(Table):
    """How files of maps are read: the options of `gen contact`, for files that do not say it."""

    side: Lengths | None = Field(
        default=None, description="the scan length in um, or two as [1000, 500] or '1000,500'"
    )
    unit: Text | None = Field(default=None, description="text, the unit of the heights, as 'nm'")
    channel: Text | None = Field(default=None, description="text, a channel's name or its index")

    def given(self) -> dict[str, Any]:
        """Return the keys that are given, with their values."""
        return {name: value for name, value in self if value is not None}


class Preparation(Table):
    """How maps are prepared before windows are cut out: the options of `gen contact`.

    Texts, and keys that exclude each other, are checked where the maps are looked for.
    """

    crop: Text | None = Field(default=None, description="text, 'x0:x1,y0:y1' [um]")
    invert: bool | None = Field(default=None, description="true or false")
    mask: Text | None = Field(default=None, description="text, 'below:above' [um]")
    despike: Positive | None = Field(default=None, description="a number above 0, as 7")
    level: Literal["mean", "plane", "quadratic"] | None = Field(
        default=None, description="'mean', 'plane' or 'quadratic'"
    )
    form: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="the degree of a polynomial, a whole number from 1 on"
    )
    fill: bool | None = Field(default=None, description="true or false")
    fill_most: bool | None = Field(default=None, description="true or false")
    filter: Text | None = Field(default=None, description="text, 'short:long' [um]")
    downsample: Annotated[int, Field(ge=2)] | None = Field(
        default=None, description="a whole number of 2 or more"
    )

    def given(self) -> dict[str, Any]:
        """Return the keys that are given, with their values."""
        return {name: value for name, value in self if value is not None}


class ScannedMap(Table):
    """A map as a run has found it.

    Its file does not count in the scene's fingerprint: a map may move.
    """

    file: str = Field(description="text, the path of the file")
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")] = Field(
        description="the SHA-256 of the file's content"
    )
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
