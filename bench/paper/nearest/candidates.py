"""The readings of what the paper leaves open: a level of each factor, and its scene."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from bench.files import read_toml
from gen.scene import Scene


@dataclass(frozen=True)
class Factor:
    """Something that the paper does not say.

    Attributes
    ----------
    name : str
        Name in tables.
    levels : tuple
        What it may be, values of TOML.
    key : str
        Key of a scene that it sets, with dots; empty for what no scene says.
    """

    name: str
    levels: tuple[Any, ...]
    key: str = ""


def factors() -> tuple[Factor, ...]:
    """Return the factors of `bench/paper/candidates.toml`."""
    found = read_toml("paper/candidates")["factors"]
    return tuple(Factor(**{**each, "levels": tuple(each["levels"])}) for each in found)


@dataclass(frozen=True)
class Candidate:
    """One reading: the number of a level for each factor, in their order."""

    factors: tuple[Factor, ...]
    levels: tuple[int, ...]

    def value(self, name: str) -> Any:
        """Return the value of a factor by its name."""
        return self._values()[name]

    def texts(self) -> dict[str, str]:
        """Return the value of each factor as JSON, by its name: columns of a table."""
        return {name: json.dumps(value) for name, value in self._values().items()}

    def scene(self, samples: int) -> Scene:
        """Return the scene of this reading: the paper preset with the factors' values."""
        content: dict[str, Any] = {"title": "A reading of the paper", "samples": samples}
        for factor, value in zip(self.factors, self._values().values(), strict=True):
            table, _, key = factor.key.rpartition(".")
            if key:
                (content.setdefault(table, {}) if table else content)[key] = value
        return Scene.from_text(json.dumps(content))

    def __hash__(self) -> int:
        """Return the same for equal readings of the same factors."""
        return hash(self.levels)

    def neighbours(self, factor: int) -> Iterator["Candidate"]:
        """Yield the readings that differ in one factor, given by its place."""
        for level in range(len(self.factors[factor].levels)):
            if level != self.levels[factor]:
                levels = (*self.levels[:factor], level, *self.levels[factor + 1 :])
                yield replace(self, levels=levels)

    def _values(self) -> dict[str, Any]:
        pairs = zip(self.factors, self.levels, strict=True)
        return {factor.name: factor.levels[level] for factor, level in pairs}


def first(of: tuple[Factor, ...]) -> Candidate:
    """Return the reading with the first level of each factor."""
    return Candidate(of, (0,) * len(of))
