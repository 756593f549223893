"""Surfaces made by a function that the user writes, and the patterns of its name in scenes."""

import re
from pathlib import Path
from typing import Annotated, Literal, Self, TypeVar

import numpy as np
from pydantic import AfterValidator, Field

from gen.arrays import Heights
from gen.distribution import AnyNumber, Distribution
from gen.runtime.errors import InputError, SourceError
from gen.runtime.user_code import (
    TRUSTED,
    load_function,
    source_errors,
    source_hash,
    source_of,
)
from gen.surface import Grid, GridSurface, Parameters, Random

T = TypeVar("T")

NAMED = re.compile(r"[a-z][a-z0-9_]{0,39}")
"""Pattern of the names of a user's parameters and outputs, which become names of columns."""

FUNCTION_WORDS = "text, 'module:function', as 'my_surfaces:waves'"
FUNCTION_PATTERN = r"^[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*$"
Function = Annotated[str, Field(max_length=200, pattern=FUNCTION_PATTERN)]
Hash = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


def checked_names(values: dict[str, T]) -> dict[str, T]:
    """Check the names in a table of a user's numbers, and sort the table by name.

    The order of the numbers in a scene has no meaning.

    Parameters
    ----------
    values : dict of str to any
        The values by their names.

    Returns
    -------
    dict of str to any
        The given values, in the alphabetical order of their names.

    Raises
    ------
    ValueError
        If a name does not match `NAMED`.
    """
    for name in values:
        if not NAMED.fullmatch(name):
            raise ValueError(
                f"{name!r}: a name has up to 40 lower case letters, digits and underscores"
            )
    return dict(sorted(values.items()))


class PythonSurface(GridSurface):
    """Surfaces made by a function that the user writes.

    The function is called as function(shape, spacing, rng, **parameters).
    """

    generator: Literal["python"]
    function: Function = Field(description=FUNCTION_WORDS)
    parameters: Annotated[dict[str, AnyNumber], AfterValidator(checked_names)] = Field(
        default={},
        description="a table of numbers, [low, high] and distributions by their names",
    )
    # None in the user's scene; a run writes it when it begins.
    source: Hash | None = Field(
        default=None, description="the SHA-256 of the module's source"
    )

    def drawn(self) -> dict[str, Distribution]:
        """Return the distributions of the user's parameters by their names."""
        return dict(self.parameters)

    def sources(self) -> list[Path]:
        """Return the file of the function's module; empty unless the user trusts the functions."""
        if not TRUSTED.get():
            return []
        return [source_of(self.function)]

    def resolved(self, home: Path | None) -> Self:
        """Return the table with the hash of the source of the function's module.

        A table that has a hash is returned as it is.
        """
        if self.source is not None:
            return self
        return self.model_copy(update={"source": source_hash(self.function)})

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Override `GeneratedSurface.heights`: call the function, and shift the lowest node to 0.

        SourceError if the source has changed, the function fails, or it returns anything but real
        numbers of the shape of the grid. InputError if they are not finite, or if the user does
        not trust the functions.
        """
        place = f"{self.function}, surface {surface}"
        function = load_function(self.function, self.source)
        with source_errors(place):
            returned = function(grid.shape, grid.spacing, random, **parameters)
            heights = _heights_of(returned, place)
        if heights.shape != grid.shape:
            raise SourceError(
                f"{place}: heights are of shape {heights.shape}, not {grid.shape}"
            )
        if not np.isfinite(heights).all():
            raise InputError(f"{place}: heights are not finite")
        heights -= heights.min()
        return heights


def _heights_of(returned: object, place: str) -> Heights:
    """Return a copy of the heights [um] that a user's function has returned; any shape passes.

    SourceError, with a message that begins with `place`, if they are no array of real numbers.
    """
    array = np.asarray(returned)
    if array.dtype.kind not in "fiub":
        kind = f"a {type(returned).__name__}"
        if returned is None:
            kind = "nothing"
        raise SourceError(f"{place}: returned {kind}, not heights [um]")
    # A copy, because the function may keep the array.
    return np.array(array, dtype=np.float64)
