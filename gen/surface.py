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


def one_or_two(
    kind: type[int] | type[float], largest: float, above: float = 0.0
) -> Callable[[Any], Any]:
    """Return the validator of a key that takes a number for both axes or one for each.

    Parameters
    ----------
    kind : type
        `int` for whole numbers alone, or `float`.
    largest : float
        Largest number that is allowed.
    above : float
        Number that all have to exceed.

    Returns
    -------
    callable
        Function of what a scene holds. It returns a number or a pair of them, of this kind, and
        raises PydanticCustomError for anything else.
    """
    kinds = (int,) if kind is int else (int, float)

    def is_allowed(number: Any) -> bool:
        return type(number) in kinds and above < number <= largest

    def read(value: Any) -> Any:
        is_pair = isinstance(value, list | tuple) and len(value) == 2
        numbers = tuple(value) if is_pair else (value,)
        if not all(is_allowed(number) for number in numbers):
            raise PydanticCustomError("pair", "not a number or a pair of them")
        if is_pair:
            return tuple(kind(number) for number in numbers)
        return kind(value)

    return read


Nodes = Annotated[
    int | tuple[int, int], PlainValidator(one_or_two(int, MOST_NODES, above=1))
]
Side = Annotated[float | tuple[float, float], PlainValidator(one_or_two(float, 1e300))]
NODES = f"a whole number from 2 to {MOST_NODES}, or one for each axis, [nx, ny]"
SIDE = "a finite number above 0, or one for each axis, [x, y] [um]"

Parameters = Mapping[str, float]
"""Parameters that were drawn for a surface, by their names, each in its own unit."""

Random = np.random.Generator


class Patch(NamedTuple):
    """Size of the patch that is solved."""

    nodes: tuple[int, int]  # nodes along x and y
    sides: tuple[float, float]  # lengths along x and y [um]


class Grid(NamedTuple):
    """The grid that a scene's surfaces are made on."""

    shape: tuple[int, int]  # nodes along x and y
    # lengths of the patch: of all cells, or between outer nodes [um]
    sides: tuple[float, float]
    spacing: tuple[float, float]  # distances of neighbouring nodes along x and y [um]
    boundary: str  # "free", "periodic" or "mirror"


class Drawn(NamedTuple):
    """A parameter that is drawn for each surface, as its column describes it."""

    unit: str  # "1" for pure numbers
    long_name: str  # its meaning
    paper_range: tuple[float, float] | None = None  # in the paper's Table 1


Hurst = Annotated[FromZeroToOne, Drawn("1", "Hurst exponent of the surface", (0.5, 0.8))]


class GeneratedSurface(Table):
    """The table `[surface]` of a scene, and the surfaces that it describes.

    A field that is annotated by `Drawn` is a parameter: it is drawn for each surface, and is a
    column of the database.
    """

    NAMES: ClassVar[tuple[str, ...]] = ()
    """Names by which scenes ask for this generator."""

    PARAMETERS: ClassVar[Mapping[str, Drawn]] = {}
    """Parameters that every scene of this generator may draw, by their keys."""

    PLACES: ClassVar[Mapping[str, str]] = {}
    """Names and meanings of the columns that say where in a larger surface each one was cut out.
    Generators whose surfaces are not cut out have none."""

    # Without the key the other body is flat.
    against: Literal["another"] | None = Field(
        default=None,
        description="'another', for a second rough body: another surface of the same parameters",
    )
    generator: str

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """List the names and the parameters of a generator in its class."""
        cls.NAMES = get_args(cls.model_fields["generator"].annotation)
        parameters = {}
        for name, field in cls.model_fields.items():
            for annotation in field.metadata:
                if type(annotation) is Drawn:
                    parameters[name] = annotation
        cls.PARAMETERS = parameters

    def drawn(self) -> dict[str, Distribution]:
        """Return the distributions of the parameters that are drawn for each surface."""
        values = {name: getattr(self, name) for name in self.PARAMETERS}
        return {name: value for name, value in values.items() if value is not None}

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return the nodes and the sides of the patch that is solved.

        Parameters
        ----------
        boundary : {"free", "periodic", "mirror"}
            Boundary of the patch.
        cells : bool
            Whether the sides hold a cell for each node, rather than one less, from the first node
            to the last one.

        Returns
        -------
        Patch
            Nodes and sides [um].

        Raises
        ------
        InputError
            If they are not known before a run has read the source of the surfaces.
        """
        raise NotImplementedError

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Make a surface, as a pure function of these arguments and the table.

        Parameters
        ----------
        grid : Grid
            The grid of the scene.
        surface : int
            Index of the surface in the scene.
        parameters : mapping of str to float
            Parameters that were drawn for the surface.
        random : numpy.random.Generator
            The surface's stream of random numbers, which the call moves on.

        Returns
        -------
        ndarray, shape of the grid
            Heights above the lowest node [um].

        Raises
        ------
        InputError
            If the surface cannot be made.
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
        """Make the second rough body, as a pure function of these arguments and the table.

        Parameters
        ----------
        grid : Grid
            The grid of the scene.
        surface : int
            Index of the surface in the scene.
        parameters : mapping of str to float
            Parameters that were drawn for the surface.
        first : numpy.random.Generator
            A new copy of the stream of the first body.
        random : numpy.random.Generator
            The second body's stream of random numbers, which the call moves on.

        Returns
        -------
        ndarray, shape of the grid
            Heights above the lowest node [um].

        Raises
        ------
        InputError
            If the surface cannot be made.
        """
        return self.heights(grid, surface, parameters, random)

    def fault_on(self, grid: Grid) -> str:
        """Say why some surfaces cannot be made on a grid.

        Parameters
        ----------
        grid : Grid
            The grid of the scene.

        Returns
        -------
        str
            The reason, and what to change; empty if all can be made.
        """
        return ""

    def relevant(self, content: dict[str, Any]) -> dict[str, Any]:
        """Return the part of the table on which results depend.

        Parameters
        ----------
        content : dict
            All keys of this table with their values.

        Returns
        -------
        dict
            The keys and values that tell databases with other results apart.
        """
        return content

    def places(self, randoms: Iterable[Random]) -> dict[str, NDArray[np.int32]]:
        """Return where surfaces are cut out of a larger one.

        Parameters
        ----------
        randoms : iterable of numpy.random.Generator
            The stream of random numbers of each surface, from its beginning.

        Returns
        -------
        dict of str to ndarray, shape (surfaces,)
            Values of the columns in `PLACES`; empty if surfaces are not cut out.
        """
        return {}

    def resolved(self, home: Path | None) -> Self:
        """Complete the table by hashes of the files that its surfaces depend on.

        Parameters
        ----------
        home : Path, optional
            The database, beside which files may be kept.

        Returns
        -------
        GeneratedSurface
            The completed table; see `Scene.resolved`.
        """
        return self

    def make_ready(
        self, home: Path | None, *, sources: bool = False, verify: bool = True
    ) -> None:
        """Open the files that surfaces are made from in this process.

        Parameters
        ----------
        home : Path, optional
            The database, beside which files may be kept.
        sources : bool
            Whether the original files are needed too, not only what is kept of them.
        verify : bool
            Whether to look for damage in what is kept; of several processes one is to do it.

        Raises
        ------
        SourceError
            If a file is missing or not what it was when the database was made.
        """

    def sources(self) -> list[Path]:
        """Return the files that surfaces are made from, which no output may replace."""
        return []

    def remarks(self) -> list[str]:
        """Return lines for the user of a run about the source of the surfaces."""
        return []


def pair(value: T | tuple[T, T]) -> tuple[T, T]:
    """Return a value for each axis.

    Parameters
    ----------
    value : number or pair of number
        One value for both axes, or the values along x and y.

    Returns
    -------
    pair of number
        The values along x and y.
    """
    if isinstance(value, tuple):
        return value
    return value, value


class GridSurface(GeneratedSurface):
    """A table of surfaces on any rectangular grid, whose nodes and sides the scene gives."""

    nodes: Nodes = Field(default=128, description=NODES)
    side: Side = Field(default=1000.0, description=SIDE)

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return the nodes and sides of the scene."""
        return Patch(pair(self.nodes), pair(self.side))


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
    nodes: int, hurst: float, sigma0: float, random: Random, *, diamonds: bool
) -> Heights:
    """Displace centres and edges, level by level, and return heights [um].

    With `diamonds` edges are displaced to the means of their diamonds, otherwise of their corners;
    see `generate`.
    """
    decay = 2.0 ** (-hurst / 2.0) if diamonds else 2.0**-hurst
    amplitude = sigma0
    heights = np.zeros((2, 2))
    while len(heights) < nodes:
        centres = _centres(heights, amplitude, random)
        if diamonds:
            amplitude *= decay
        heights = _refined(heights, centres, amplitude, random, diamonds=diamonds)
        amplitude *= decay
    return heights


def _centres(heights: Heights, amplitude: float, random: Random) -> Heights:
    """Return the heights of the centres of all squares, displaced by an amplitude [um]."""
    squares = len(heights) - 1
    pairs = heights[:-1] + heights[1:]
    centres = amplitude * random.standard_normal((squares, squares))
    centres += 0.25 * (pairs[:, :-1] + pairs[:, 1:])
    return centres


def _refined(
    heights: Heights,
    centres: Heights,
    amplitude: float,
    random: Random,
    *,
    diamonds: bool,
) -> Heights:
    """Return a grid of heights, their centres, and edges displaced by an amplitude [um]."""
    squares = len(centres)
    finer = np.empty((2 * squares + 1, 2 * squares + 1))
    finer[::2, ::2] = heights
    finer[1::2, 1::2] = centres
    for axis in (0, 1):
        # As seen along this axis: the same code takes edges along x, then along y.
        means = _edge_means(
            heights.swapaxes(0, axis), centres.swapaxes(0, axis), diamonds=diamonds
        )
        displacements = random.standard_normal(means.swapaxes(0, axis).shape)
        displacements *= amplitude
        edges = finer.swapaxes(0, axis)[1::2, ::2]
        edges[:] = displacements.swapaxes(0, axis) + means
    return finer


def _edge_means(heights: Heights, centres: Heights, *, diamonds: bool) -> Heights:
    """Return the mean of the neighbours of each edge's midpoint along axis 0 [um].

    The neighbours are both corners, and with `diamonds` also the centres on both sides.
    """
    means = heights[:-1] + heights[1:]
    if not diamonds:
        means *= 0.5
        return means
    means[:, 1:] += centres
    means[:, :-1] += centres
    means[:, 1:-1] *= 0.25
    means[:, :: len(centres)] /= 3.0  # the border's two columns
    return means


class DisplacedSurface(GridSurface):
    """Surfaces of random midpoint displacement.

    `hurst` is the parameter of the generator. The exponent of a surface's power spectrum is
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
        nodes = self.nodes if boundary == "free" else self.nodes - 1
        return Patch((nodes, nodes), (self.side, self.side))

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Displace midpoints; see `GeneratedSurface.heights`."""
        heights = generate(
            self.generator,
            self.nodes,
            parameters["hurst"],
            parameters["sigma0"],
            random,
        )
        if grid.boundary == "free":
            return heights
        return without_last_nodes(heights)
