"""Surfaces that a function of the user's makes, and how scenes name such functions."""

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
"""Names of a user's parameters and outputs, which become columns."""

FUNCTION_WORDS = "text, 'module:function', as 'my_surfaces:waves'"
FUNCTION = r"^[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*$"
Function = Annotated[str, Field(max_length=200, pattern=FUNCTION)]
Hash = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


def named(values: dict[str, T]) -> dict[str, T]:
    """Refuse names that cannot be those of columns; sort the others, whose order means nothing."""
    for name in values:
        if not NAMED.fullmatch(name):
            raise ValueError(
                f"{name!r}: a name has up to 40 lower case letters, digits and underscores"
            )
    return dict(sorted(values.items()))


class PythonSurface(GridSurface):
    """Surfaces that a function of the user's makes: (shape, spacing, rng, **parameters)."""

    generator: Literal["python"]
    function: Function = Field(description=FUNCTION_WORDS)
    parameters: Annotated[dict[str, AnyNumber], AfterValidator(named)] = Field(
        default={},
        description="a table of numbers, [low, high] and distributions by their names",
    )
    # Written when a run begins: the SHA-256 of the module's source.
    source: Hash | None = Field(
        default=None, description="the SHA-256 of the module's source"
    )

    def drawn(self) -> dict[str, Distribution]:
        """Return the user's parameters."""
        return dict(self.parameters)

    def sources(self) -> list[Path]:
        """Return the file of the function's module, where it is trusted."""
        return [source_of(self.function)] if TRUSTED.get() else []

    def resolved(self, home: Path | None) -> Self:
        """Complete the table by the hash of the source of the function's module."""
        if self.source is not None:
            return self
        return self.model_copy(update={"source": source_hash(self.function)})

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Call the function; see `GeneratedSurface.heights`."""
        place = f"{self.function}, surface {surface}"
        function = load_function(self.function, self.source)
        with source_errors(place):
            made = function(grid.shape, grid.spacing, random, **parameters)
            heights = np.asarray(made)
            if heights.dtype.kind not in "fiub":
                kind = "nothing" if made is None else f"a {type(made).__name__}"
                raise SourceError(f"{place}: returned {kind}, not heights [um]")
            heights = np.array(
                heights, dtype=np.float64
            )  # a copy: the function may keep its own
        if heights.shape != grid.shape:
            raise SourceError(
                f"{place}: heights are of shape {heights.shape}, not {grid.shape}"
            )
        if not np.isfinite(heights).all():
            raise InputError(f"{place}: heights are not finite")
        heights -= heights.min()
        return heights
