"""Rough surfaces: what every generator of them has, and two kinds of random midpoint displacement.

A generator is one class in one file: the keys of its table `[surface]`, which of them are drawn and
become columns, and the heights of a surface. `gen.generators.GENERATORS` lists the classes.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainValidator
from pydantic_core import PydanticCustomError

from gen.arrays import Heights
from gen.distribution import (
    SPANNED,
    AtLeastZero,
    Distribution,
    FromZeroToOne,
    Positive,
    Table,
)
from gen.runtime.errors import InputError
from gen.statistics import refuse_masked

T = TypeVar("T", int, float)

MOST_NODES = 4097  # largest number of nodes along an axis
ANOTHER = "another"  # second rough body of the same population


def one_or_two(kind: Any, most: float, least: float = 0.0) -> Callable[[Any], Any]:
    """Return what reads a number for both axes or one for each, above `least` and up to `most`."""
    kinds = (int,) if kind is int else (int, float)

    def read(value: Any) -> Any:
        several = isinstance(value, list | tuple)
        numbers = tuple(value) if several else (value, value)
        if len(numbers) != 2 or not all(
            type(each) in kinds and least < each <= most for each in numbers
        ):
            raise PydanticCustomError("pair", "not a number or a pair of them")
        return tuple(map(kind, numbers)) if several else kind(value)

    return read


Nodes = Annotated[
    int | tuple[int, int], PlainValidator(one_or_two(int, MOST_NODES, least=1))
]
Side = Annotated[float | tuple[float, float], PlainValidator(one_or_two(float, 1e300))]
NODES = f"a whole number from 2 to {MOST_NODES}, or one for each axis, [nx, ny]"
SIDE = "a finite number above 0, or one for each axis, [x, y] [um]"

Parameters = Mapping[
    str, float
]  # parameters that were drawn for a surface, by their names
Patch = tuple[
    tuple[int, int], tuple[float, float]
]  # nodes and lengths along x and y [um]
Random = np.random.Generator


class Grid(NamedTuple):
    """The grid that a scene's surfaces are made on."""

    shape: tuple[int, int]  # nodes along x and y
    sides: tuple[
        float, float
    ]  # lengths of the patch: of all cells, or between outer nodes [um]
    spacing: tuple[float, float]  # distances of neighbouring nodes along x and y [um]
    boundary: str  # "free", "periodic" or "mirror"


class Drawn(NamedTuple):
    """A parameter that is drawn for each surface: its unit and its meaning, as in its column."""

    unit: str  # "1" for pure numbers
    long_name: str
    paper_range: tuple[float, float] | None = None  # in the paper's Table 1


Hurst = Annotated[FromZeroToOne, Drawn("1", "Hurst exponent of the surface", (0.5, 0.8))]


class GeneratedSurface(Table):
    """A table of surfaces, whose fields with a `Drawn` are drawn for each surface, and columns."""

    NAMES: ClassVar[tuple[str, ...]] = ()
    """Names by which scenes ask for this generator."""

    PARAMETERS: ClassVar[Mapping[str, Drawn]] = {}
    """Parameters that every scene of this generator may draw, by their keys."""

    PLACES: ClassVar[Mapping[str, str]] = {}
    """Columns that say where in a larger surface each one was cut out, with their meanings; such
    pieces have no edges, and loads of their own."""

    # Without the key the other body is flat.
    against: Literal["another"] | None = Field(
        default=None,
        description="'another', for a second rough body: another surface of the same parameters",
    )
    generator: str

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """List the names and the parameters of a generator."""
        cls.NAMES = get_args(cls.model_fields["generator"].annotation)
        fields = cls.model_fields.items()
        cls.PARAMETERS = {
            name: each
            for name, field in fields
            for each in field.metadata
            if type(each) is Drawn
        }

    def drawn(self) -> dict[str, Distribution]:
        """Return the distributions of the parameters that are drawn for each surface."""
        values = {name: getattr(self, name) for name in self.PARAMETERS}
        return {name: value for name, value in values.items() if value is not None}

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return the nodes and the sides of the solved patch, which hold all cells or one less."""
        raise NotImplementedError

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Make a surface: heights above the lowest node [um], a pure function of these arguments.

        `surface` is its index, `random` a stream of its own. InputError if it cannot be made.
        """
        raise NotImplementedError

    def opposite_heights(
        self,
        grid: Grid,
        surface: int,
        parameters: Parameters,
        first: Random,
        random: Random,
    ) -> Heights:
        """Make the second rough body; `first` is the surface's own stream, `random` the body's."""
        return self.heights(grid, surface, parameters, random)

    def fault_on(self, grid: Grid) -> str:
        """Return why some surfaces cannot be made on a grid, or an empty text."""
        return ""

    def relevant(self, content: dict[str, Any]) -> dict[str, Any]:
        """Return the keys of the table that change results, given all its keys."""
        return content

    def places(self, randoms: Iterable[Random]) -> dict[str, NDArray[np.int32]]:
        """Return where surfaces are taken from, from the stream of random numbers of each."""
        return {}

    def resolved(self, home: Path | None) -> Self:
        """Complete the table by hashes of what its surfaces depend on; see `Scene.resolved`."""
        return self

    def make_ready(
        self, home: Path | None, *, sources: bool = False, verify: bool = True
    ) -> None:
        """Open the files that surfaces are made from; a SourceError names one that is not there.

        With `sources` the original files have to be there too; the master alone looks for damage in
        what `home` has (`verify`).
        """

    def sources(self) -> list[Path]:
        """Return the files that surfaces are made from, which no output may replace."""
        return []

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

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return the given nodes and sides."""
        return pair(self.nodes), pair(self.side)


GENERATORS = ("diamond-square", "midpoint")
"""Generators of `generate` by the names that scenes use."""


def generate(
    generator: str, nodes: int, hurst: float, sigma0: float, random: Random
) -> Heights:
    """Generate a random self-affine surface by displacing midpoints, level by level.

    "diamond-square", MIRCO's generator, displaces the centre of a square to the mean of its 4
    corners + N(0, a^2); then the midpoint of an edge to the mean of its 4 neighbours, 3 at the
    border, + N(0, a^2). The amplitude a starts at `sigma0` and is divided by 2^(hurst / 2) after
    each of the two steps. The statistics of its surfaces are those of the paper's Table 1.
    "midpoint" displaces centres and edges together, as the paper's text describes it: the centre of
    a square to the mean of its 4 corners and the midpoint of an edge to the mean of its 2 corners,
    both + N(0, s^2) with s = sigma0 2^(-hurst level); the first level is 0.

    Parameters
    ----------
    generator : str
        One of the names in `GENERATORS`.
    nodes : int
        Nodes a side: 2^k + 1 with k of 1 or more.
    hurst : float
        Hurst exponent, from 0 to 1; that of the power spectrum is smaller, the more so on coarse
        grids (`examples/hurst.py`).
    sigma0 : float
        Standard deviation of the first displacement [um].
    random : numpy.random.Generator
        Source of the displacements. The same seed gives the same coarse nodes for every number of
        nodes, apart from the shift of the lowest node to 0.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights above the lowest node [um].

    Raises
    ------
    InputError
        If the generator, the number of nodes or the Hurst exponent is not allowed, or sigma0 is
        negative or so large that heights exceed the largest number.

    References
    ----------
    Section 2.2 (sec_rmd) of the paper.
    """
    if generator not in GENERATORS:
        raise InputError(f"generator {generator!r}: give one of {', '.join(GENERATORS)}")
    if nodes < 3 or (nodes - 1) & (nodes - 2):
        raise InputError(f"nodes {nodes}: give 2^k + 1, as 3, 5, 9, ..., 129, 257")
    if not 0.0 <= hurst <= 1.0:
        raise InputError(f"hurst {hurst}: give a Hurst exponent from 0 to 1")
    if not 0.0 <= sigma0 < math.inf:
        raise InputError(f"sigma0 {sigma0}: give a standard deviation of 0 um or more")
    with np.errstate(over="ignore", invalid="ignore"):
        heights = _displaced(
            nodes, hurst, sigma0, random, diamonds=generator == "diamond-square"
        )
        heights -= heights.min()
    if not math.isfinite(heights.max()):
        raise InputError(
            f"sigma0 {sigma0:g}: its heights are beyond what numbers hold; give less"
        )
    return heights


def without_last_nodes(heights: Heights) -> Heights:
    """Leave out the last row and column, for a patch without edges.

    The generators make 2^k + 1 nodes a side, where 2^k cells suit transforms better: 257 is a prime
    number. FFTW takes 11 times as long for the Fourier transform of 257 x 257 numbers as for
    256 x 256, 4 times for the cosine transform; a contact takes 3.0 times as long on a periodic
    patch and 2.4 times on a mirrored one.

    Parameters
    ----------
    heights : ndarray, shape (n + 1, n + 1)
        Heights of a generated surface [um].

    Returns
    -------
    ndarray, shape (n, n)
        Heights above the lowest of these nodes [um].

    Raises
    ------
    InputError
        If heights are masked in places.
    """
    refuse_masked("heights", heights)
    cells = heights[:-1, :-1]
    return np.ascontiguousarray(cells - cells.min())


def _displaced(
    nodes: int, hurst: float, amplitude: float, random: Random, *, diamonds: bool
) -> Heights:
    """Displace centres and edges; with `diamonds` edges to the mean of their diamonds."""
    decay = 2.0 ** (-hurst / 2.0) if diamonds else 2.0**-hurst
    heights = np.zeros((2, 2))
    while len(heights) < nodes:
        squares = len(heights) - 1
        finer = np.empty((2 * squares + 1, 2 * squares + 1))
        finer[::2, ::2] = heights
        pairs = heights[:-1] + heights[1:]
        centres = amplitude * random.standard_normal((squares, squares))
        centres += 0.25 * (pairs[:, :-1] + pairs[:, 1:])
        finer[1::2, 1::2] = centres
        amplitude *= decay if diamonds else 1.0
        for axis in (0, 1):
            corners, beside, edges = (
                each.swapaxes(0, axis) for each in (heights, centres, finer)
            )
            means = corners[:-1] + corners[1:]
            if diamonds:
                means[:, 1:] += beside
                means[:, :-1] += beside
                means[:, 1:-1] *= 0.25
                means[:, ::squares] /= 3.0  # the border's two columns
            else:
                means *= 0.5
            displacements = random.standard_normal(means.swapaxes(0, axis).shape)
            displacements *= amplitude
            edges[1::2, ::2] = displacements.swapaxes(0, axis) + means
        amplitude *= decay
        heights = finer
    return heights


class DisplacedSurface(GridSurface):
    """Surfaces of random midpoint displacement.

    `hurst` is what the generator is asked for. The exponent of a surface's power spectrum is
    smaller; `bench/results/hurst/hurst.csv` has it for several grids.

    The defaults are the paper's (section 3.2, Table 1). The paper does not give `sigma0`: its
    default is calibrated so that the 22 statistics have the ranges of Table 1.
    """

    generator: Literal["diamond-square", "midpoint"] = "diamond-square"
    nodes: Literal[3, 5, 9, 17, 33, 65, 129, 257, 513, 1025, 2049, 4097] = Field(
        default=129, description="2^k + 1 nodes a side, a whole number from 3 to 4097"
    )
    side: Positive = Field(default=1000.0, description="a finite number above 0 [um]")
    hurst: Hurst = Field(
        default=(0.5, 0.8),
        description="two numbers [low, high] with 0 <= low <= high <= 1, one number, or a"
        " distribution",
    )
    sigma0: Annotated[
        AtLeastZero,
        Drawn("um", "standard deviation of the generator's first displacement"),
    ] = Field(default=(10.0, 15.0), description=f"{SPANNED} [um]")

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return 2^k nodes a side for a patch without edges, otherwise 2^k + 1."""
        nodes = self.nodes - (boundary != "free")
        return (nodes, nodes), (self.side, self.side)

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Displace midpoints; see `GeneratedSurface.heights`."""
        hurst, sigma0 = parameters["hurst"], parameters["sigma0"]
        heights = generate(self.generator, self.nodes, hurst, sigma0, random)
        return heights if grid.boundary == "free" else without_last_nodes(heights)
