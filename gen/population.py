"""Surfaces like measured maps: a spectrum in bands, a distribution of heights, and new phases.

The texture of a surface is a translation field g(u): u is a Gaussian random field with the spectrum
of the population, and g a rising curve from normal scores to heights [1]_ [2]_. Copies of the maps'
imperfections (pits, dust and scratches) are added to it at random places. `gen.draft.populations`
fits a population to maps. Its file is JSON and holds plain numbers.

References
----------
.. [1] F. Yamazaki, M. Shinozuka, Digital generation of non-Gaussian stochastic fields, Journal of
   Engineering Mechanics 114, 1183-1197, 1988.
.. [2] M. Grigoriu, Simulation of stationary non-Gaussian translation processes, Journal of
   Engineering Mechanics 124, 121-126, 1998.
"""

from __future__ import annotations

import functools
import json
import math
from dataclasses import asdict, dataclass
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError, with_config

from gen.arrays import Heights, Values
from gen.runtime.errors import InputError
from gen.runtime.terminal import printable

FORMAT: Literal["asperity population 1"] = "asperity population 1"
"""First value of the file of a population: its kind and the number of its layout."""

LARGEST_FILE = 2_000_000
"""Largest size of the file of a population [bytes]. Most have 10 to 60 kB without imperfections."""

MOST_BANDS = 200
"""Largest number of bands along an axis. A map of 4,097 nodes has 62."""

LARGEST_IMPERFECTION = 100_000
"""Largest number of nodes along an axis of an imperfection."""

MOST_PARTS = 100
"""Largest number of parts of the maps that a population keeps."""

# number of normal scores at which the curve of heights is tabulated
TABULATED = 2001
# largest position in the table that is below its last entry
BEFORE_LAST_ENTRY = float(np.nextafter(TABULATED - 1, 0))
FURTHEST_SCORE = 8.0
"""Largest tabulated score. A share of 1e-15 of all nodes is beyond it, so none of a surface is."""

Number = Annotated[float, Field(allow_inf_nan=False)]
Above0 = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=2, le=10**6)]
Row = Annotated[tuple[Number, ...], Field(max_length=MOST_BANDS)]
Bands = Annotated[tuple[Number, ...], Field(min_length=2, max_length=MOST_BANDS)]
Curve = Annotated[tuple[Number, ...], Field(min_length=2, max_length=1000)]
Line = Annotated[tuple[Number, ...], Field(min_length=1, max_length=LARGEST_IMPERFECTION)]
Imperfection = Annotated[
    tuple[Line, ...], Field(min_length=1, max_length=LARGEST_IMPERFECTION)
]


@with_config(ConfigDict(extra="forbid"))
@dataclass(frozen=True)
class SourceMap:
    """A map to which a population was fitted."""

    name: Annotated[str, Field(max_length=1000)]  # name of its file
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]  # hash of the file's content
    nodes: tuple[Count, Count]  # nodes along x and y after the preparation
    rms_height: Above0  # after the preparation [um]


@with_config(ConfigDict(extra="forbid"))
@dataclass(frozen=True)
class Part:
    """What a part of a map has of its own."""

    # logarithms of its spectral density over that of the population, at `Parts.waves`, for waves
    # along x and along y [1]
    ratios_x: Row
    ratios_y: Row
    heights: Curve  # its heights about their mean at `Parts.scores`, rising [um]


@with_config(ConfigDict(extra="forbid"))
@dataclass(frozen=True)
class Parts:
    """Parts of maps that differ from each other more than surfaces of the population do."""

    nodes: tuple[Count, Count]  # nodes of each part along x and y
    waves: Bands  # rising wavenumbers [1/um]
    scores: Curve  # rising normal scores [1]
    members: Annotated[tuple[Part, ...], Field(min_length=1, max_length=MOST_PARTS)]


@with_config(ConfigDict(extra="forbid"))
@dataclass(frozen=True)
class Population:
    """Surfaces of one kind: spectrum of a Gaussian field, curve to heights, and imperfections.

    The spectrum is a table over bands of waves along both axes. It has two parts, for waves whose
    components have equal and opposite signs, so that a lay may have any direction.
    """

    format: Literal["asperity population 1"]
    maps: Annotated[tuple[SourceMap, ...], Field(min_length=1, max_length=1000)]
    preparation: Annotated[str, Field(max_length=10_000)]  # how the maps were prepared
    spacing: tuple[Above0, Above0]  # distance of the nodes along x and y [um]
    # shortest wavelength that carries roughness [um]: waves that are shorter have 1 % of the mean
    # square slope together
    shortest: Above0
    # sentences on properties of the maps that the surfaces do not have
    remarks: Annotated[tuple[str, ...], Field(max_length=20)]
    bands_x: Bands  # middle of each band along x, rising from 0 [1/um]
    bands_y: Bands  # middle of each band along y, rising from 0 [1/um]
    # logarithm of the relative spectral density of the Gaussian field, shape (2, bands along x,
    # bands along y): first for waves whose components have equal signs, then for opposite signs
    logarithms: tuple[
        Annotated[tuple[Row, ...], Field(max_length=MOST_BANDS)],
        Annotated[tuple[Row, ...], Field(max_length=MOST_BANDS)],
    ]
    scores: Curve  # rising normal scores [1]
    heights: Curve  # heights at these scores, rising [um]
    # heights of each imperfection of the maps above the texture, row by row along x [um]
    imperfections: Annotated[tuple[Imperfection, ...], Field(max_length=1000)] = ()
    # Parts of the maps, if the population alone does not have their scatter. A surface with the
    # nodes of the parts is like one of them.
    parts: Parts | None = None

    @classmethod
    def parse(cls, text: str, source: str) -> Self:
        """Read a population from the content of its file.

        Parameters
        ----------
        text : str
            The content, JSON as `text` writes it.
        source : str
            Name of the file, for messages.

        Returns
        -------
        Population
            The population.

        Raises
        ------
        InputError
            If the text is not that of a population.
        """
        try:
            population = TypeAdapter(cls).validate_json(text)
        except ValidationError as error:
            fault = error.errors(include_url=False, include_input=False)[0]
            place = ".".join(str(part) for part in fault["loc"][:2])
            raise InputError(
                printable(
                    f"{source}: no population that `gen scene --like` wrote:"
                    f" {place or 'JSON'}: {fault['msg']}"
                )
            ) from None
        population._require_consistency(source)
        return population

    def _require_consistency(self, source: str) -> None:
        """Raise InputError, which names the file `source`, if numbers do not fit together."""
        self._require_table(source)
        self._require_rising_numbers(source)
        if self.bands_x[0] != 0 or self.bands_y[0] != 0:
            raise InputError(f"{source}: bands: do not begin at 0")
        for imperfection in self.imperfections:
            if len({len(line) for line in imperfection}) > 1:
                raise InputError(f"{source}: imperfections: not rectangles of nodes")
        if self.parts is not None:
            _require_consistent_parts(self.parts, source)

    def _require_table(self, source: str) -> None:
        """Raise InputError unless logarithms are a table over the bands, scores over heights."""
        shape = (2, len(self.bands_x), len(self.bands_y))
        rows = {len(row) for part in self.logarithms for row in part}
        is_table = {len(part) for part in self.logarithms} == {shape[1]}
        if not is_table or rows != {shape[2]}:
            raise InputError(f"{source}: logarithms: not a table over the bands")
        if len(self.scores) != len(self.heights):
            raise InputError(f"{source}: scores and heights: not of one length")

    def _require_rising_numbers(self, source: str) -> None:
        """Raise InputError unless bands, scores and heights rise."""
        for name in ("bands_x", "bands_y", "scores"):
            if (np.diff(getattr(self, name)) <= 0).any():
                raise InputError(f"{source}: {name}: do not rise")
        if (np.diff(self.heights) < 0).any() or self.heights[0] == self.heights[-1]:
            raise InputError(f"{source}: heights: do not rise")

    @functools.cached_property
    def text(self) -> str:
        """The content of the population's file: JSON, a line for each key."""
        content = asdict(self)
        if self.parts is None:
            del content["parts"]
        lines = [
            f"  {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}"
            for key, value in content.items()
        ]
        return "{\n" + ",\n".join(lines) + "\n}\n"

    @property
    def longest(self) -> tuple[float, float]:
        """Longest waves in the spectrum of the maps, along x and y [um]."""
        return (2 * math.pi / self.bands_x[1], 2 * math.pi / self.bands_y[1])

    @property
    def nodes(self) -> tuple[int, int]:
        """Nodes along x and y of a period as long as the longest waves of the maps."""
        length_x, length_y = self.longest
        dx, dy = self.spacing
        return (round(length_x / dx), round(length_y / dy))

    @functools.cached_property
    def summit(self) -> float:
        """Height of the highest node of the maps' texture above its mean [um]."""
        from scipy.special import ndtri

        shares = (np.arange(TABULATED) + 0.5) / TABULATED
        return self.heights[-1] - float(self.heights_of(ndtri(shares)).mean())

    @functools.cached_property
    def imperfection_heights(self) -> tuple[Heights, ...]:
        """Heights of each imperfection above the texture [um], each of shape (nx, ny)."""
        return tuple(np.array(imperfection) for imperfection in self.imperfections)

    def __hash__(self) -> int:
        """Return a hash of the maps and the curve: one of all numbers would take long.

        A cache looks a population up by its hash for each surface.
        """
        return hash((self.maps, self.scores, self.heights))

    def mean_copies_on(self, period: tuple[int, int]) -> float:
        """Return the mean number of copies of each imperfection on a period.

        Parameters
        ----------
        period : tuple of int
            Nodes along x and y of the period.

        Returns
        -------
        float
            The nodes of the period over those of all maps together.
        """
        of_maps = sum(math.prod(source.nodes) for source in self.maps)
        return math.prod(period) / of_maps

    def heights_of(self, scores: Values) -> Heights:
        """Return the heights at normal scores.

        Parameters
        ----------
        scores : ndarray, any shape
            Normal scores [1].

        Returns
        -------
        ndarray, shape of `scores`
            Heights [um].
        """
        return _on_curve(self.scores, self.heights, scores)

    def part_of(self, shape: tuple[int, int], random: np.random.Generator) -> Part | None:
        """Draw the part of the maps that a surface is like.

        Parameters
        ----------
        shape : tuple of int
            Nodes (nx, ny) of the surface.
        random : numpy.random.Generator
            Source of the choice. The call moves its state if there are parts of this shape.

        Returns
        -------
        Part or None
            The part; None if the population has no parts with these nodes.
        """
        if self.parts is None or self.parts.nodes != shape:
            return None
        members = self.parts.members
        return members[int(random.integers(len(members)))]


def _require_consistent_parts(parts: Parts, source: str) -> None:
    """Raise InputError, which names the file `source`, if numbers of parts do not fit together."""
    for name, numbers in (("waves", parts.waves), ("scores", parts.scores)):
        if (np.diff(numbers) <= 0).any() or (name == "waves" and numbers[0] <= 0):
            raise InputError(f"{source}: parts.{name}: do not rise")
    for part in parts.members:
        if {len(part.ratios_x), len(part.ratios_y)} != {len(parts.waves)}:
            raise InputError(f"{source}: parts: not as many ratios as waves")
        if len(part.heights) != len(parts.scores):
            raise InputError(f"{source}: parts: not as many heights as scores")
        if (np.diff(part.heights) < 0).any() or part.heights[0] == part.heights[-1]:
            raise InputError(f"{source}: parts: heights do not rise")


def _on_curve(
    knots: tuple[float, ...], heights_of_knots: tuple[float, ...], scores: Values
) -> Heights:
    """Return the heights [um] of a curve at normal scores, of any shape.

    The curve has the heights `heights_of_knots` [um] at the scores `knots`.
    """
    _, heights = tabulated_curve(knots, heights_of_knots)
    # The table has equal steps, so that its entries need no search.
    steps_of_a_score = (TABULATED - 1) / (2 * FURTHEST_SCORE)
    positions = scores + FURTHEST_SCORE
    positions *= steps_of_a_score
    np.clip(positions, 0.0, BEFORE_LAST_ENTRY, out=positions)
    # `take` is fastest with indices of the size of a pointer that it does not check.
    below = positions.astype(np.intp)
    positions -= below  # share of the step above the entry
    rises = np.diff(heights).take(below, mode="clip")
    rises *= positions
    rises += heights.take(below, mode="clip")
    return np.asarray(rises)


def total_power(densities: Values) -> float:
    """Sum a spectral density over all waves of a period.

    Parameters
    ----------
    densities : ndarray, shape (nx, ny // 2 + 1)
        Density of each wave in the layout of `rfft2`; 0 for waves of two nodes along y.

    Returns
    -------
    float
        The sum, in the unit of the density.
    """
    # The transform holds one of two opposite waves, but both in the column of qy = 0.
    return float(2 * densities[:, 1:].sum() + densities[:, 0].sum())


def densities_at(
    logarithms: Values, bands: tuple[Values, Values], qx: Values, qy: Values
) -> Values:
    """Interpolate a spectral density in bands between the middles of the bands.

    Its logarithm is interpolated, and is constant beyond the last band.

    Parameters
    ----------
    logarithms : ndarray, shape (2, bands along x, bands along y)
        Logarithms of the density for waves whose components have equal and opposite signs.
    bands : pair of ndarray
        Middles of the bands along x and along y, rising from 0 [1/um].
    qx : ndarray, shape (n,)
        Components of wavevectors along x [1/um].
    qy : ndarray, shape (m,)
        Components of wavevectors along y, all of 0 or more [1/um].

    Returns
    -------
    ndarray, shape (n, m)
        The density, in its unit. It is 0 where both components are 0: the mean of heights is no
        wave.
    """
    along_x = _band_weights(bands[0], np.abs(qx))
    along_y = _band_weights(bands[1], qy)
    is_opposite = qx < 0
    interpolated = along_x @ logarithms[0] @ along_y.T
    interpolated[is_opposite] = along_x[is_opposite] @ logarithms[1] @ along_y.T
    densities: Values = np.exp(interpolated)
    densities[np.ix_(qx == 0, qy == 0)] = 0.0
    return densities


def _band_weights(bands: Values, wavenumbers: Values) -> Values:
    """Return weights of bands, by which a table over bands is interpolated at wavenumbers.

    `bands` are the middles of the bands, rising from 0 [1/um], and `wavenumbers` have the shape
    (n,) and the unit 1/um. The result has the shape (n, bands); the weights of a wavenumber have
    the sum 1. They interpolate linearly in log(1 + q / q1), where q1 is the middle of the second
    band: nearly linearly in the wavenumber q below q1, and in its logarithm above.
    """
    places = np.log1p(bands / bands[1])
    logarithms = np.log1p(wavenumbers / bands[1])
    positions = np.interp(logarithms, places, np.arange(bands.size))
    below = np.minimum(positions.astype(np.int64), bands.size - 2)
    share = positions - below
    rows = np.arange(wavenumbers.size)
    weights = np.zeros((wavenumbers.size, bands.size))
    weights[rows, below] = 1.0 - share
    weights[rows, below + 1] = share
    return weights


@functools.lru_cache(maxsize=MOST_PARTS + 8)
def tabulated_curve(
    scores: tuple[float, ...], heights: tuple[float, ...]
) -> tuple[Values, Heights]:
    """Tabulate the curve from normal scores to heights, for linear interpolation.

    Between the given scores the curve is smooth and rises (piecewise cubic, without overshoot).
    Beyond them it has the constant mean slope of the first or last interval.

    Parameters
    ----------
    scores : tuple of float
        Rising normal scores, at least two [1].
    heights : tuple of float
        Heights at these scores, rising, in any unit.

    Returns
    -------
    scores : ndarray, shape (`TABULATED`,)
        Normal scores of equal steps from -`FURTHEST_SCORE` to `FURTHEST_SCORE` [1].
    heights : ndarray, shape (`TABULATED`,)
        The heights at these scores, in the unit of the given heights.
    """
    from scipy.interpolate import PchipInterpolator

    knots = np.array(scores)
    heights_of_knots = np.array(heights)
    places = np.linspace(-FURTHEST_SCORE, FURTHEST_SCORE, TABULATED)
    inside = np.clip(places, knots[0], knots[-1])
    curve = PchipInterpolator(knots, heights_of_knots)(inside)
    slopes = np.diff(heights_of_knots) / np.diff(knots)
    beyond = places - inside
    curve += beyond * np.where(beyond < 0, slopes[0], slopes[-1])
    return places, curve


@functools.lru_cache(maxsize=4)
def _amplitudes(population: Population, period: tuple[int, int]) -> Values:
    """Return moduli of the transform of a Gaussian field with unit variance on a period [1].

    The shape is that of `rfft2` of a field with the nodes `period`. Waves of two nodes are left
    out, because two nodes do not determine their phase.
    """
    nx, ny = period
    dx, dy = population.spacing
    numbers_x = np.fft.fftfreq(nx, 1 / nx)
    numbers_y = np.arange(ny // 2 + 1)
    qx = np.asarray(2 * math.pi / (nx * dx) * numbers_x, dtype=np.float64)
    qy = np.asarray(2 * math.pi / (ny * dy) * numbers_y, dtype=np.float64)
    bands = (np.array(population.bands_x), np.array(population.bands_y))
    powers = densities_at(np.array(population.logarithms), bands, qx, qy)
    powers[2 * np.abs(numbers_x) == nx] = 0.0
    powers[:, 2 * numbers_y == ny] = 0.0
    return np.asarray(nx * ny * np.sqrt(powers / total_power(powers)))


@dataclass(frozen=True, eq=False)
class _PartWaves:
    """Where the waves of a period are in the tables of `Parts`, each of the shape of `rfft2`."""

    below: NDArray[
        np.intp
    ]  # number of the last wavenumber of the table that is not larger
    share: Values  # share of the step to the next one, in the logarithm of the wavenumber [1]
    along_x: Values  # square of the cosine of the angle between wavevector and x [1]

    def interpolated(self, part: Part) -> Values:
        """Return logarithms of the ratio of a part's spectral density to the population's [1].

        They are interpolated between those along x and along y by the square of the cosine.
        """
        ratios_x = self._at_wavenumbers(part.ratios_x)
        ratios_y = self._at_wavenumbers(part.ratios_y)
        ratios_x -= ratios_y
        ratios_x *= self.along_x
        ratios_x += ratios_y
        return ratios_x

    def _at_wavenumbers(self, table: tuple[float, ...]) -> Values:
        """Interpolate a table over `Parts.waves` at the wavenumbers of all waves."""
        numbers = np.array(table)
        steps = np.diff(numbers)
        interpolated = steps.take(self.below)
        interpolated *= self.share
        interpolated += numbers.take(self.below)
        return np.asarray(interpolated)


@functools.lru_cache(maxsize=4)
def _part_waves(
    wavenumbers: tuple[float, ...], spacing: tuple[float, float], period: tuple[int, int]
) -> _PartWaves:
    """Find the waves of a period with the nodes `period` in a table over wavenumbers [1/um].

    `spacing` is the distance of the nodes along x and y [um].
    """
    qx = 2 * math.pi * np.fft.fftfreq(period[0], spacing[0])[:, None]
    qy = 2 * math.pi * np.fft.rfftfreq(period[1], spacing[1])[None, :]
    # The mean of the heights is no wave: any number above 0 stands for its wavenumber.
    lengths = np.maximum(np.hypot(qx, qy), math.ulp(0.0))
    positions = np.interp(
        np.log(lengths), np.log(wavenumbers), np.arange(len(wavenumbers))
    )
    below = np.minimum(positions.astype(np.intp), len(wavenumbers) - 2)
    return _PartWaves(below=below, share=positions - below, along_x=(qx / lengths) ** 2)


def _field(
    amplitudes: Values, period: tuple[int, int], random: np.random.Generator
) -> Values:
    """Return a Gaussian field on a period, with random phases of its waves.

    `amplitudes` are moduli of the transform of the field, in the layout of `rfft2`. The call moves
    the state of `random`.
    """
    # Single precision is enough for random phases; moduli are off by 1e-7.
    phases = random.random(amplitudes.shape, dtype=np.float32) * np.float32(2 * math.pi)
    waves: NDArray[np.complex128] = np.empty(amplitudes.shape, dtype=complex)
    np.multiply(amplitudes, np.cos(phases), out=waves.real)
    np.multiply(amplitudes, np.sin(phases), out=waves.imag)
    # The transform of real heights has conjugate values at opposite wavevectors.
    half = (period[0] - 1) // 2
    waves[-half:, 0] = np.conj(waves[half:0:-1, 0])
    return np.fft.irfft2(waves, s=period)


def generate_like(
    population: Population,
    shape: tuple[int, int],
    period: tuple[int, int],
    random: np.random.Generator,
) -> Heights:
    """Generate a surface of a population: its texture, and copies of the imperfections.

    If the population has parts with the nodes of the surface, the surface is like one of them,
    which is drawn: it has the spectrum and the distribution of heights of that part.

    Parameters
    ----------
    population : Population
        The population.
    shape : tuple of int
        Nodes (nx, ny) of the surface.
    period : tuple of int
        Nodes of the period out of whose corner the surface is cut, at least those of the shape and
        at least 4. On every period the Gaussian field has exactly the population's spectrum, the
        mean 0 and the variance 1. That of a part has them on the surface.
    random : numpy.random.Generator
        Source of the part, the phases of the waves and the places of imperfections. The call moves
        its state.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights [um]. The nodes have the spacing of the population.
    """
    amplitudes = _amplitudes(population, period)
    part = population.part_of(shape, random)
    if part is None or population.parts is None:
        field = _field(amplitudes, period, random)
        heights = population.heights_of(field[: shape[0], : shape[1]])
    else:
        heights = _like_part(population, population.parts, part, period, random)
    mean_copies = population.mean_copies_on(period)
    for imperfection in population.imperfection_heights:
        # one of the two whole numbers next to the mean, so that copies have this mean
        copies = int(mean_copies + random.random())
        for _ in range(copies):
            place = (int(random.integers(period[0])), int(random.integers(period[1])))
            _add_imperfection(heights, imperfection, place, period)
    return heights


def _like_part(
    population: Population,
    parts: Parts,
    part: Part,
    period: tuple[int, int],
    random: np.random.Generator,
) -> Heights:
    """Return a texture [um] with the nodes, the spectrum and the heights of a part of the maps.

    It is cut out of a period with the nodes `period`. The call moves the state of `random`.
    """
    logarithms = _part_waves(parts.waves, population.spacing, period).interpolated(part)
    amplitudes = _amplitudes(population, period) * np.exp(logarithms / 2)
    nx, ny = parts.nodes
    field = _field(amplitudes, period, random)[:nx, :ny]
    scores = (field - field.mean()) / field.std()
    return _on_curve(parts.scores, part.heights, scores)


def _add_imperfection(
    heights: Heights,
    imperfection: Heights,
    place: tuple[int, int],
    period: tuple[int, int],
) -> None:
    """Add an imperfection [um] to heights [um], in place.

    The imperfection begins at the node `place` of a period with the nodes `period`, and continues
    on the other side of the period if it crosses the border. The heights are the corner of the
    period at its first node; nodes of the imperfection outside of this corner are left out. If
    several nodes of the imperfection are at one node of the period, the last of them is added.
    """
    nodes_x, nodes_y = (
        (first + np.arange(size)) % size_of_period
        for first, size, size_of_period in zip(
            place, imperfection.shape, period, strict=True
        )
    )
    is_inside_x = nodes_x < heights.shape[0]
    is_inside_y = nodes_y < heights.shape[1]
    inside = np.ix_(nodes_x[is_inside_x], nodes_y[is_inside_y])
    heights[inside] += imperfection[np.ix_(is_inside_x, is_inside_y)]
