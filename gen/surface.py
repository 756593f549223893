"""Rough surfaces: the interface of all generators, and two kinds of random midpoint displacement.

A generator is one class in one file. The class has the keys of the table `[surface]`, says which of
the keys are drawn and become columns, and makes the heights of a surface.
`gen.generators.GENERATORS` lists the classes.
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
# value of the key `against` for a second rough body of the same population
ANOTHER = "another"


def one_or_two(
    kind: type[int] | type[float], largest: float, above: float = 0.0
) -> Callable[[Any], Any]:
    """Return the validator of a key whose value is a number for both axes or a pair of numbers.

    Parameters
    ----------
    kind : type
        `int` if only whole numbers are allowed, otherwise `float`.
    largest : float
        Largest number that is allowed.
    above : float
        Largest number that is not allowed: every number has to exceed it.

    Returns
    -------
    callable
        Function of a value of any type. It returns a number or a tuple of two numbers, converted to
        `kind`, and raises PydanticCustomError for any other value.
    """
    allowed_types = (int,) if kind is int else (int, float)

    def is_allowed(number: Any) -> bool:
        """Tell whether a value is a number inside the limits; bool is no number."""
        return type(number) in allowed_types and above < number <= largest

    def validated(value: Any) -> Any:
        """Return the number or the pair of numbers of a scene."""
        is_pair = isinstance(value, list | tuple) and len(value) == 2
        numbers = tuple(value) if is_pair else (value,)
        if not all(is_allowed(number) for number in numbers):
            raise PydanticCustomError("pair", "not a number or a pair of them")
        if is_pair:
            return tuple(kind(number) for number in numbers)
        return kind(value)

    return validated


Nodes = Annotated[
    int | tuple[int, int], PlainValidator(one_or_two(int, MOST_NODES, above=1))
]
Side = Annotated[float | tuple[float, float], PlainValidator(one_or_two(float, 1e300))]
NODES = f"a whole number from 2 to {MOST_NODES}, or one for each axis, [nx, ny]"
SIDE = "a finite number above 0, or one for each axis, [x, y] [um]"

Parameters = Mapping[str, float]
"""Values of the parameters that were drawn for a surface, by the names of the parameters. The
generator's `PARAMETERS` have their units."""

Random = np.random.Generator


class Patch(NamedTuple):
    """Size of the patch that is solved."""

    nodes: tuple[int, int]  # nodes along x and y
    sides: tuple[float, float]  # lengths along x and y [um]


class Grid(NamedTuple):
    """The grid on which a scene's surfaces are made."""

    shape: tuple[int, int]  # nodes along x and y
    # Lengths of the patch along x and y [um]. If each node has a cell of its own, they are lengths
    # of all cells, otherwise distances from the first node to the last one.
    sides: tuple[float, float]
    spacing: tuple[float, float]  # distances of neighbouring nodes along x and y [um]
    boundary: str  # "free", "periodic" or "mirror"


class Drawn(NamedTuple):
    """Description of a parameter that is drawn for each surface, for its column."""

    unit: str  # "1" for pure numbers
    long_name: str  # meaning of the parameter, in words
    # range in the paper's Table 1; None for a parameter that is not in the table
    paper_range: tuple[float, float] | None = None
    scales_heights: bool = False  # True if all heights are proportional to the parameter


Hurst = Annotated[FromZeroToOne, Drawn("1", "Hurst exponent of the surface", (0.5, 0.8))]


class GeneratedSurface(Table):
    """The table `[surface]` of a scene, and the surfaces that it describes.

    Each generator is a subclass. A field that is annotated by `Drawn` is a parameter: its value is
    drawn for each surface, and is a column of the database.
    """

    NAMES: ClassVar[tuple[str, ...]] = ()
    """Values of the key `generator` that select this class."""

    PARAMETERS: ClassVar[Mapping[str, Drawn]] = {}
    """Descriptions of the parameters, by their keys in the table."""

    PLACES: ClassVar[Mapping[str, str]] = {}
    """Meanings of the columns that say where each surface was cut out of a larger one, by the names
    of the columns. The mapping is empty for generators that do not cut surfaces out."""

    ON_ANY_GRID: ClassVar[bool] = False
    """Whether the surfaces have the same waves on every grid that `fault_on` allows. If they have
    not, they are made on their own nodes and read on fewer where a scene asks for an error."""

    FOLLOWS_MAPS: ClassVar[bool] = False
    """Whether the surfaces follow from measured maps. A patch is then mirrored by default, the grid
    is known only when a run has found the maps, and a scene has to give its loads."""

    @property
    def is_complete(self) -> bool:
        """Whether the table has recorded the files on which the grid depends, if there are any."""
        return True

    @property
    def cuts_windows(self) -> bool:
        """Whether surfaces are windows that are cut out of larger ones."""
        return bool(self.PLACES)

    # Without this key the other body is flat.
    against: Literal["another"] | None = Field(
        default=None,
        description="'another', for a second rough body: another surface of the same parameters",
    )
    generator: str

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Set `NAMES` and `PARAMETERS` of a new subclass from its fields."""
        cls.NAMES = get_args(cls.model_fields["generator"].annotation)
        parameters = {}
        for name, field in cls.model_fields.items():
            for annotation in field.metadata:
                if type(annotation) is Drawn:
                    parameters[name] = annotation
        cls.PARAMETERS = parameters

    def drawn(self) -> dict[str, Distribution]:
        """Return the distributions of the parameters by their keys; keys not set are left out."""
        values = {name: getattr(self, name) for name in self.PARAMETERS}
        return {name: value for name, value in values.items() if value is not None}

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return the nodes and the sides of the patch that is solved.

        Parameters
        ----------
        boundary : {"free", "periodic", "mirror"}
            Boundary of the patch.
        cells : bool
            True if each node has a cell of its own inside the sides; False if the sides reach from
            the first node to the last one.

        Returns
        -------
        Patch
            Nodes and sides [um].

        Raises
        ------
        InputError
            If nodes and sides follow from files that have not been read yet.
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
            The surface's stream of random numbers. The call moves its state.

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
        """Make the surface of the second rough body, as a pure function of arguments and table.

        By default it is another surface with the parameters of the first body. The heights point
        out of the second body.

        Parameters
        ----------
        grid : Grid
            The grid of the scene.
        surface : int
            Index of the surface in the scene.
        parameters : mapping of str to float
            Parameters that were drawn for the surface.
        first : numpy.random.Generator
            The first body's stream of random numbers, in the state before the first surface was
            made. Generators use it if the second surface has to differ from the first one.
        random : numpy.random.Generator
            The second body's stream of random numbers. The call moves its state.

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
        """Say why surfaces of this table, or some of them, cannot be made on a grid.

        Parameters
        ----------
        grid : Grid
            The grid of the scene.

        Returns
        -------
        str
            The reason, and advice on what to change; "" if all surfaces can be made.
        """
        return ""

    def fault_of_accuracy(self) -> str:
        """Say why no grid gives contacts of these surfaces within an error, whatever it is.

        Returns
        -------
        str
            The reason, and advice on what to change; "" if there may be such a grid.
        """
        return ""

    def relevant(self, content: dict[str, Any]) -> dict[str, Any]:
        """Return the part of the table on which results depend.

        Parameters
        ----------
        content : dict
            The keys of this table and their values.

        Returns
        -------
        dict
            The keys and values that change results; by default all of them. Scenes that differ in
            this part have different databases.
        """
        return content

    def places(self, randoms: Iterable[Random]) -> dict[str, NDArray[np.int32]]:
        """Return the places at which surfaces are cut out of a larger one.

        Parameters
        ----------
        randoms : iterable of numpy.random.Generator
            The stream of random numbers of each surface, in its first state.

        Returns
        -------
        dict of str to ndarray, shape (surfaces,)
            Values of the columns in `PLACES` by the names of the columns; empty if surfaces are not
            cut out.
        """
        return {}

    def resolved(self, home: Path | None) -> Self:
        """Complete the table by hashes of the files that its surfaces depend on.

        Parameters
        ----------
        home : Path, optional
            Folder of the database, in which files may be kept.

        Returns
        -------
        GeneratedSurface
            The completed table; by default this table itself. See `Scene.resolved`.

        Raises
        ------
        InputError
            If a file is missing or cannot be used.
        """
        return self

    def make_ready(
        self, home: Path | None, *, sources: bool = False, verify: bool = True
    ) -> None:
        """Open, in this process, the files from which surfaces are made.

        By default there are none, and nothing is done.

        Parameters
        ----------
        home : Path, optional
            Folder of the database, in which copies of the files may be kept.
        sources : bool
            Whether the original files are needed too, besides the copies that are kept.
        verify : bool
            Whether to check the kept copies for damage. It is enough if one of several processes
            does this.

        Raises
        ------
        SourceError
            If a file is missing, or has changed since the database was made.
        """

    def sources(self) -> list[Path]:
        """Return the files from which surfaces are made, so that no output replaces them.

        By default there are none. InputError if a file that the scene names is missing.
        """
        return []

    def remarks(self) -> list[str]:
        """Return lines about the source of the surfaces, which a run prints for its user."""
        return []


def pair(value: T | tuple[T, T]) -> tuple[T, T]:
    """Return a value for each axis.

    Parameters
    ----------
    value : number or pair of number
        One value for both axes, or a tuple of the values along x and y.

    Returns
    -------
    pair of number
        The values along x and y.
    """
    if isinstance(value, tuple):
        return value
    return value, value


class GridSurface(GeneratedSurface):
    """A table of surfaces on a rectangular grid, with keys for its nodes and sides."""

    nodes: Nodes = Field(default=128, description=NODES)
    side: Side = Field(default=1000.0, description=SIDE)

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return the nodes and the sides [um] of the table; see `GeneratedSurface.patch`."""
        return Patch(nodes=pair(self.nodes), sides=pair(self.side))


GENERATORS = ("diamond-square", "midpoint")
"""Generators of `generate` by the names that scenes use."""


def generate(
    generator: str, nodes: int, hurst: float, sigma0: float, random: Random
) -> Heights:
    """Generate a random self-affine surface by displacing midpoints, level by level.

    Each level adds the centres of all squares and the midpoints of all edges. The height of a new
    node is a mean of its neighbours plus a random number from a normal distribution with the mean 0
    and a standard deviation that falls from level to level.

    "diamond-square", MIRCO's generator, first adds the centres: the mean is over the 4 corners of
    the square. Then it adds the midpoints of the edges: the mean is over 4 neighbours, which are 2
    corners and 2 centres, or over 3 at the border. The standard deviation starts at `sigma0` and is
    divided by 2^(hurst / 2) after each of these two steps. The statistics of its surfaces have the
    ranges of the paper's Table 1.

    "midpoint" is the generator that the text of the paper describes. The mean is over the 4 corners
    of a square and over the 2 corners of an edge. The standard deviation of a level is
    sigma0 2^(-hurst level) for both; the first level is 0.

    Parameters
    ----------
    generator : str
        One of the names in `GENERATORS`.
    nodes : int
        Nodes along each side: 2^k + 1 with k of 1 or more.
    hurst : float
        Hurst exponent of the displacements, from 0 to 1. The Hurst exponent of the power spectrum
        is smaller, in particular on coarse grids (`examples/hurst.py`).
    sigma0 : float
        Standard deviation of the first displacement [um].
    random : numpy.random.Generator
        Source of the displacements. The call moves its state. For one seed, the nodes of a coarse
        grid have the same heights on a finer grid, apart from the shift of the lowest node to 0.

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
    intervals = nodes - 1
    is_power_of_two = intervals & (intervals - 1) == 0
    if nodes < 3 or not is_power_of_two:
        raise InputError(f"nodes {nodes}: give 2^k + 1, as 3, 5, 9, ..., 129, 257")
    if not 0.0 <= hurst <= 1.0:
        raise InputError(f"hurst {hurst}: give a Hurst exponent from 0 to 1")
    if not 0.0 <= sigma0 < math.inf:
        raise InputError(f"sigma0 {sigma0}: give a standard deviation of 0 um or more")
    diamonds = generator == "diamond-square"
    with np.errstate(over="ignore", invalid="ignore"):  # reported below
        heights = _displaced(nodes, hurst, sigma0, random, diamonds=diamonds)
        heights -= heights.min()
    if not math.isfinite(heights.max()):
        raise InputError(
            f"sigma0 {sigma0:g}: its heights are beyond what numbers hold; give less"
        )
    return heights


def without_last_nodes(heights: Heights) -> Heights:
    """Leave out the last row and the last column, for a patch without edges.

    `generate` makes 2^k + 1 nodes a side, but transforms of 2^k numbers are faster, in particular
    because 257 is a prime number. For 257 x 257 numbers, FFTW's Fourier transform takes 11 times as
    long as for 256 x 256, and the cosine transform 4 times. A contact takes 3.0 times as long on a
    periodic patch, and 2.4 times on a mirrored one.

    Parameters
    ----------
    heights : ndarray, shape (n + 1, n + 1)
        Heights of a generated surface [um].

    Returns
    -------
    ndarray, shape (n, n)
        A copy of the heights of the other nodes, above the lowest of them [um].

    Raises
    ------
    InputError
        If a height is masked.
    """
    refuse_masked("heights", heights)
    cells = heights[:-1, :-1]
    return np.ascontiguousarray(cells - cells.min())


def _displaced(
    nodes: int, hurst: float, sigma0: float, random: Random, *, diamonds: bool
) -> Heights:
    """Return heights [um] of random midpoint displacement, whose lowest node is not at 0.

    `diamonds` selects the generator "diamond-square", otherwise the generator is "midpoint"; see
    `generate`. `sigma0` is the standard deviation of the first displacement [um].
    """
    # "diamond-square" divides the amplitude twice in each level.
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
    """Return the heights of the centres of all squares [um], shape (n - 1, n - 1).

    `heights` are the corners [um], shape (n, n), and `amplitude` is the standard deviation of the
    displacements [um].
    """
    squares = len(heights) - 1
    sums_along_x = heights[:-1] + heights[1:]
    sums_of_corners = sums_along_x[:, :-1] + sums_along_x[:, 1:]
    centres = amplitude * random.standard_normal((squares, squares))
    centres += 0.25 * sums_of_corners
    return centres


def _refined(
    heights: Heights,
    centres: Heights,
    amplitude: float,
    random: Random,
    *,
    diamonds: bool,
) -> Heights:
    """Return the heights of the next level [um], shape (2 n - 1, 2 n - 1).

    They are the `heights` of this level, shape (n, n), the `centres` of its squares, and the
    midpoints of its edges, which this function displaces. `amplitude` is the standard deviation of
    these displacements [um].
    """
    squares = len(centres)
    finer = np.empty((2 * squares + 1, 2 * squares + 1))
    finer[::2, ::2] = heights
    finer[1::2, 1::2] = centres
    for axis in (0, 1):
        # Exchanging the axes makes edges along y look like edges along x.
        means = _edge_means(
            heights.swapaxes(0, axis), centres.swapaxes(0, axis), diamonds=diamonds
        )
        displacements = random.standard_normal(means.swapaxes(0, axis).shape)
        displacements *= amplitude
        edges = finer.swapaxes(0, axis)[1::2, ::2]
        edges[:] = displacements.swapaxes(0, axis) + means
    return finer


def _edge_means(heights: Heights, centres: Heights, *, diamonds: bool) -> Heights:
    """Return the mean of the neighbours of the midpoint of each edge along axis 0 [um].

    `heights` are the corners, shape (n, n); the result has the shape (n - 1, n). The neighbours are
    both corners of the edge, and with `diamonds` also the `centres` on both sides, of which there
    is only one at the border.
    """
    means = heights[:-1] + heights[1:]
    if not diamonds:
        means *= 0.5
        return means
    means[:, 1:] += centres
    means[:, :-1] += centres
    means[:, 1:-1] *= 0.25
    means[:, :: len(centres)] /= 3.0  # the first and the last column
    return means


class DisplacedSurface(GridSurface):
    """Surfaces of random midpoint displacement.

    `hurst` is the parameter of `generate`. The Hurst exponent of a surface's power spectrum is
    smaller; `bench/results/hurst/hurst.csv` lists it for several grids.

    The defaults are the values of the paper (section 3.2, Table 1), except that of `sigma0`, which
    the paper does not give: it is chosen so that the 22 statistics have the ranges of Table 1.
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
        Drawn(
            "um",
            "standard deviation of the generator's first displacement",
            scales_heights=True,
        ),
    ] = Field(default=(10.0, 15.0), description=f"{SPANNED} [um]")

    def patch(self, boundary: str, *, cells: bool) -> Patch:
        """Return 2^k nodes a side for a patch without edges, otherwise 2^k + 1, and the sides [um].

        See `GeneratedSurface.patch`.
        """
        nodes = self.nodes if boundary == "free" else self.nodes - 1
        return Patch(nodes=(nodes, nodes), sides=(self.side, self.side))

    def fault_of_accuracy(self) -> str:
        """Say that every finer grid has shorter waves; see `GeneratedSurface`."""
        return (
            f"'{self.generator}' adds shorter waves on every finer grid, so that the area has no"
            " limit: give generator = 'spectral' with a cut_off, or leave out [accuracy]"
        )

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Return a surface of `generate`, without its last nodes on a patch without edges.

        See `GeneratedSurface.heights`.
        """
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
