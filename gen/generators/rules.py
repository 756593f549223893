"""What every generator of surfaces has: a table in a scene, parameters that are drawn, and heights.

A generator is one file of this folder with one class: the keys of its table `[surface]`, which of
them are drawn and become columns, and the heights of a surface. `gen.generators.GENERATORS` lists
the classes.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, Self, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainValidator
from pydantic_core import PydanticCustomError

from gen.arrays import Heights
from gen.distribution import Distribution, Table

T = TypeVar("T", int, float)

MOST_NODES = 4097
"""Largest number of nodes along an axis."""

ANOTHER = "another"
"""Second rough body of the same population."""


def _one_or_two(value: Any, kind: Any, most: float, least: float = 0.0) -> Any:
    """Accept a number for both axes or one for each, above `least` and up to `most`."""
    numbers: tuple[Any, ...] = tuple(value) if isinstance(value, list | tuple) else (value, value)
    if len(numbers) != 2 or not all(
        isinstance(each, kind) and not isinstance(each, bool) and least < each <= most
        for each in numbers
    ):
        raise PydanticCustomError("pair", "not a number or a pair of them")
    return numbers if isinstance(value, list | tuple) else numbers[0]


def _nodes(value: object) -> int | tuple[int, int]:
    """Accept a number of nodes for both axes, or one for each."""
    nodes: int | tuple[int, int] = _one_or_two(value, int, MOST_NODES, least=1)
    return nodes


def _side(value: object) -> float | tuple[float, float]:
    """Accept a length for both axes, or one for each."""
    sides = _one_or_two(value, int | float, 1e300)
    return (float(sides[0]), float(sides[1])) if isinstance(sides, tuple) else float(sides)


def _another(value: object) -> str | tuple[str, ...]:
    """Accept the only second body that most generators can make."""
    if value != ANOTHER:
        raise PydanticCustomError("another", "not the word")
    return ANOTHER


Nodes = Annotated[int | tuple[int, int], PlainValidator(_nodes)]
Side = Annotated[float | tuple[float, float], PlainValidator(_side)]
Another = Annotated[str | tuple[str, ...], PlainValidator(_another)]
NODES = f"a whole number from 2 to {MOST_NODES}, or one for each axis, [nx, ny]"
SIDE = "a finite number above 0, or one for each axis, [x, y] [um]"


class Grid(NamedTuple):
    """The grid that a scene's surfaces are made on.

    Attributes
    ----------
    shape : tuple of int
        Nodes along x and y.
    spacing : tuple of float
        Distances between neighbouring nodes along x and y [um].
    boundary : str
        "free", "periodic" or "mirror".
    """

    shape: tuple[int, int]
    spacing: tuple[float, float]
    boundary: str


class Drawn(NamedTuple):
    """A parameter that is drawn for each surface: its unit and its meaning, as in its column.

    Attributes
    ----------
    unit : str
        Unit; "1" for pure numbers.
    long_name : str
        Meaning in words.
    paper_range : tuple of float, optional
        Smallest and largest value in the paper's Table 1.
    """

    unit: str
    long_name: str
    paper_range: tuple[float, float] | None = None


class GeneratedSurface(Table):
    """A table of surfaces, which the plan and the solver rely on.

    Fields that are annotated with `Drawn` are drawn for each surface and become columns of its
    database.
    """

    PLACES: ClassVar[Mapping[str, str]] = {}
    """Columns that say where a surface was taken from, with their meanings."""

    WINDOWS: ClassVar[bool] = False
    """Whether surfaces are pieces of larger ones: without edges, and with loads of their own."""

    # Without the key the other body is flat.
    against: Another | None = Field(
        default=None,
        description="'another', for a second rough body: another surface of the same parameters",
    )
    generator: str

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names by which scenes ask for this generator."""
        return get_args(cls.model_fields["generator"].annotation)

    @classmethod
    def known_parameters(cls) -> dict[str, Drawn]:
        """Return the parameters that every scene of this generator may draw, by their keys."""
        fields = cls.model_fields.items()
        return {
            name: each for name, field in fields for each in field.metadata if type(each) is Drawn
        }

    def drawn(self) -> dict[str, Distribution]:
        """Return the distributions of the parameters that are drawn for each surface."""
        values = {name: getattr(self, name) for name in self.known_parameters()}
        return {name: value for name, value in values.items() if value is not None}

    def shape(self, *, edgeless: bool) -> tuple[int, int]:
        """Return the nodes along x and y of the solved grid."""
        raise NotImplementedError

    def sides(self, *, cells: bool) -> tuple[float, float]:
        """Return the patch's lengths along x and y [um], of all cells or between outer nodes."""
        raise NotImplementedError

    def heights(
        self,
        grid: Grid,
        surface: int,
        parameters: Mapping[str, float],
        random: np.random.Generator,
    ) -> Heights:
        """Make a surface: heights above the lowest node [um], a pure function of these arguments.

        `surface` is its index, `parameters` were drawn for it, and `random` is a stream of its own.
        An InputError says that it cannot be made, for example of a map that is gone.
        """
        raise NotImplementedError

    def opposite_heights(
        self,
        grid: Grid,
        surface: int,
        parameters: Mapping[str, float],
        first: np.random.Generator,
        random: np.random.Generator,
    ) -> Heights:
        """Make the second rough body that a surface is pressed against, of the same parameters.

        `first` is the surface's own stream of random numbers, `random` the second body's.
        """
        return self.heights(grid, surface, parameters, random)

    def has_sides(self) -> bool:
        """Tell whether the lengths of the patch are known."""
        return True

    def fault_on(self, grid: Grid) -> str:
        """Return why some surfaces cannot be made on a grid, or an empty text."""
        return ""

    def relevant(self, content: dict[str, Any]) -> dict[str, Any]:
        """Return the keys of the table that change results, given all its keys."""
        return content

    def places(self, randoms: Iterable[np.random.Generator]) -> dict[str, NDArray[np.int32]]:
        """Return where surfaces are taken from, from the stream of random numbers of each."""
        return {}

    def anchored(self, folder: Path) -> Self:
        """Let the files that the table names start from the folder of its scene."""
        return self

    def resolved(self, home: Path | None) -> Self:
        """Complete the table by hashes of the files and sources that its surfaces depend on.

        `home` is the folder of the database, for what is prepared once for all processes; None
        takes a temporary folder. An InputError names what is missing.
        """
        return self

    def make_ready(self, home: Path | None, *, sources: bool = False, verify: bool = True) -> None:
        """Open the files that surfaces are made from; a SourceError names one that is not there.

        With `sources` the original files have to be there, even if `home` has what was prepared
        of them. The master looks for damage in that (`verify`), and its workers follow it.
        """

    def remarks(self) -> list[str]:
        """Return lines for the user of a run about the source of the surfaces."""
        return []


def pair(value: T | tuple[T, T]) -> tuple[T, T]:
    """Return a value for each axis."""
    return value if isinstance(value, tuple) else (value, value)


class GridSurface(GeneratedSurface):
    """Rules of surfaces on any rectangular grid."""

    nodes: Nodes = Field(default=128, description=NODES)
    side: Side = Field(default=1000.0, description=SIDE)

    def shape(self, *, edgeless: bool) -> tuple[int, int]:
        """Return the given nodes along x and y."""
        return pair(self.nodes)

    def sides(self, *, cells: bool) -> tuple[float, float]:
        """Return the lengths of the patch along x and y [um]."""
        return pair(self.side)
