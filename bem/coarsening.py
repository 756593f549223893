"""A map on fewer nodes: the same patch, the same waves, and the share of them that is lost.

The nodes of the coarser grid are the centres of larger cells that cover the same patch. The surface
is interpolated there by its own waves: by Fourier's on a periodic patch, by cosines on a mirrored
one. On a free patch it is interpolated by polynomials of the fifth degree. Where a larger cell has
an odd number of the map's cells along both axes, its centre is a node of the map, whose height it
has.

How much a lost wave matters follows from the pressure that flattens it. On a half-space this
pressure is proportional to the slope of the wave. On other bodies, the squares of slopes are
weighted by the square of the body's stiffness over that of a half-space (Persson 2012, J. Phys.:
Condens. Matter 24, 095008). A hard coating bends under long waves at little pressure, so that short
waves matter more. A soft layer on a hard base resists long waves most, so that they matter less.
"""

from __future__ import annotations  # short signatures in help()

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bem.arrays import Field, Nodes, Values
from bem.bodies import HALF_SPACE, Body
from bem.derived.grid_error import FEWEST, order_of_slopes, slope_order_of_lines
from bem.operators.filters import row_transform
from bem.problem import Boundary
from bem.threads import computed_once

# Number of nodes along an axis from which a height between nodes is interpolated on free maps.
NODES_BESIDE = 6

# Number of lines of a map on which slopes are measured along each axis. Because lines are at equal
# distances, there may be up to twice as many; a map with fewer lines has all of them measured.
LINES = 64

# Number of rows of a map that are transformed at once.
ROWS_AT_ONCE = 32

# Number of all waves along an axis over the number of those that are expected to have a slope.
EXPECTED_SHARE = 4

# Largest share of the mean square slope of waves that are left out of a transform [1].
NEGLIGIBLE = 1e-9

# Least result of `Coarsening.lost_slope`, which surfaces without waves have [1].
LEAST_LOST = 1e-4


@dataclass(frozen=True, eq=False)
class CoarserMap:
    """A map on fewer nodes of the same patch.

    Attributes
    ----------
    heights : ndarray, shape (mx, my)
        Heights, read-only [um].
    dropped : float
        Share of the given map's mean square slope that this map lacks, weighted by the body [1].
    """

    heights: Field
    dropped: float


def sampled_lines(heights: Field) -> tuple[Field, Field]:
    """Return some lines of a map along both axes.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um].

    Returns
    -------
    along, across : ndarray, shapes (nx, k) and (ny, m)
        Lines along the first and along the second axis, fewer than 2 `LINES` each. The nodes of a
        line follow each other along the first axis of both arrays [um].
    """
    rows, columns = heights.shape
    along = heights[:, :: max(1, columns // LINES)]
    across = heights[:: max(1, rows // LINES)]
    return np.asfortranarray(along), across.T


class Coarsening:
    """A map that is read on coarser grids, on each of them once.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the map [um].
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.
    aspect : float
        Second side of a cell over its first [1].
    body : Body
        Elastic body in units of the first side of a cell and of its modulus E*, by default a
        half-space.
    """

    def __init__(
        self, heights: Field, boundary: Boundary, aspect: float, body: Body = HALF_SPACE
    ) -> None:
        self.heights = heights
        self.boundary = boundary
        self.aspect = aspect
        self.body = body
        self._map_by_nodes: dict[tuple[int, int], CoarserMap] = {}

    def on(self, nodes: tuple[int, int]) -> CoarserMap:
        """Return the map on fewer nodes.

        Parameters
        ----------
        nodes : tuple of int
            Nodes (mx, my), at most those of the map.

        Returns
        -------
        CoarserMap
            The same surface there; the map itself on its own nodes.
        """
        if nodes == self.heights.shape:
            return CoarserMap(self.heights, 0.0)
        if nodes not in self._map_by_nodes:
            if self.boundary == "free":
                heights = _read_free(self.heights, nodes)
                dropped = _dropped_from_free(
                    self.heights.shape,
                    heights / self._unit,
                    self._reduced_lines,
                    self.aspect,
                )
                dropped = min(dropped * self._weight_of_lost_waves(nodes), 1.0)
            else:
                heights, dropped = self._waves.cut(nodes)
                heights *= self._unit
                heights += self._mean
            heights.setflags(write=False)
            self._map_by_nodes[nodes] = CoarserMap(heights, dropped)
        return self._map_by_nodes[nodes]

    def lost_slope(self, nodes: tuple[int, ...]) -> float:
        """Return the share of a grid's mean square slope that is lost at twice its spacing.

        Slopes are those between neighbouring nodes along the axis that loses more, on some lines
        of a free map, and by the waves of others. For a wave with n nodes of the grid the share is
        sin(pi / n)^2.

        Parameters
        ----------
        nodes : tuple of int
            Nodes (mx, my) of the grid, at most those of the map.

        Returns
        -------
        float
            Share, at least 1e-4 [1].
        """
        most_lost = 0.0
        share = LEAST_LOST
        for axis, slopes in enumerate(self._slopes):
            step = self.heights.shape[axis] / nodes[axis]
            near = slopes.over(step)
            far = slopes.over(2 * step)
            if near - far > most_lost:
                most_lost = near - far
                share = max(1 - far / near, LEAST_LOST)
        return share

    def slope_order(self, nodes: tuple[int, int]) -> float:
        """Return the order in the spacing of the surface's mean square slope on a grid.

        Parameters
        ----------
        nodes : tuple of int
            Nodes (mx, my) of the grid, at most those of the map.

        Returns
        -------
        float
            The smaller order of both axes, see `bem.derived.grid_error.slope_order_of_lines` [1].
        """
        if self.boundary == "free":
            lines = self.lines
            if nodes != self.heights.shape:
                lines = sampled_lines(self.on(nodes).heights)
            return slope_order_of_lines(lines, self.boundary)
        orders = []
        for axis, slopes in enumerate(self._slopes_of_waves):
            if nodes[axis] >= FEWEST:
                step = self.heights.shape[axis] / nodes[axis]
                kept = slopes.kept_by(step)
                orders.append(
                    order_of_slopes(*(kept.over(times * step) for times in (1, 2, 4)))
                )
        return min(orders, default=math.inf)

    @computed_once
    def rms_slope(self) -> float:
        """Root mean square slope between neighbouring nodes [um over the first side of a cell]."""
        along, across = (slopes.over(1.0) for slopes in self._slopes)
        return math.sqrt(along + across) * self._unit

    @computed_once
    def lines(self) -> tuple[Field, Field]:
        """Some lines of the map along both axes, see `sampled_lines` [um]."""
        return sampled_lines(self.heights)

    @computed_once
    def _slopes(
        self,
    ) -> tuple[_SlopesOfLines | _SlopesOfWaves, _SlopesOfLines | _SlopesOfWaves]:
        """Mean square slopes along both axes, in a common unit."""
        if self.boundary == "free":
            along, across = self._reduced_lines
            return _SlopesOfLines(along, 1.0), _SlopesOfLines(across, self.aspect)
        return self._slopes_of_waves

    @computed_once
    def _slopes_of_waves(self) -> tuple[_SlopesOfWaves, _SlopesOfWaves]:
        """Mean square slopes along both axes of a patch without edges, in a common unit."""
        return self._waves.slopes(self.aspect)

    @computed_once
    def _unit(self) -> float:
        """Power of two in which squares of heights stay finite [um].

        It is near the range of some lines, or near the mean if a few nodes elsewhere are far above.
        """
        range_of_lines = float(
            np.ptp(self.heights[:: max(1, len(self.heights) // LINES)])
        )
        largest = max(range_of_lines, abs(self._mean - float(self.heights[0, 0])))
        return math.ldexp(1.0, math.frexp(largest)[1])

    @computed_once
    def _reduced_lines(self) -> tuple[Field, Field]:
        """The lines of the map along both axes in units of `_unit`."""
        along, across = self.lines
        return along / self._unit, across / self._unit

    @computed_once
    def _mean(self) -> float:
        """Mean height of the map [um]."""
        return float(self.heights.mean())

    @computed_once
    def _waves(self) -> _Waves:
        """The waves of the map in units of `_unit`, by one transform; cosines on a free patch."""
        return _Waves.of(
            self.heights,
            self.aspect,
            self.body,
            is_periodic=self.boundary == "periodic",
            mean=self._mean,
            unit=self._unit,
        )

    def _weight_of_lost_waves(self, nodes: tuple[int, int]) -> float:
        """Return the mean weight of the waves that a free map loses over that of all waves [1].

        It is 1 on half-spaces. On other bodies it is computed for the cosines of the map. They have
        kinks at the borders, but these hardly change a ratio of weights.
        """
        if self.body.is_homogeneous:
            return 1.0
        unweighted = replace(self._waves, weights=None).dropped(nodes)
        if unweighted == 0:
            return 1.0
        return self._waves.dropped(nodes) / unweighted


class _SlopesOfLines:
    """Mean square slopes between nodes of some lines of a map.

    Parameters
    ----------
    lines : ndarray, shape (n, k)
        Lines, whose nodes follow each other along the first axis [unit of heights].
    spacing : float
        Distance of the nodes [unit of slopes].
    """

    def __init__(self, lines: Field, spacing: float) -> None:
        self._lines = lines
        self._spacing = spacing
        self._logarithms: dict[int, float] = {}

    def over(self, distance: float) -> float:
        """Return the mean square slope over a distance [nodes], interpolated between powers of two.

        Distances are at most a quarter of the lines' length.
        """
        largest_exponent = max(self._lines.shape[0].bit_length() - 3, 0)
        exponent = min(math.log2(distance), largest_exponent)
        lower = math.floor(exponent)
        upper = math.ceil(exponent)
        share = exponent - lower
        return math.exp(
            (1 - share) * self._logarithm(lower) + share * self._logarithm(upper)
        )

    def _logarithm(self, power: int) -> float:
        """Return the natural logarithm of the mean square slope over a power of two of nodes."""
        if power not in self._logarithms:
            distance = 2**power
            rise = self._lines[distance:] - self._lines[:-distance]
            mean_square = 0.0
            if rise.size:
                mean_square = float(np.einsum("ij,ij->", rise, rise)) / rise.size
            squared_slope = mean_square / (distance * self._spacing) ** 2
            self._logarithms[power] = math.log(max(squared_slope, 1e-300))
        return self._logarithms[power]


@dataclass(frozen=True, eq=False)
class _SlopesOfWaves:
    """Mean square slopes between nodes along an axis, by the waves of a patch without edges.

    Attributes
    ----------
    mean_squares : ndarray, shape (k,)
        Mean squares of the waves of each number along the axis [square of unit of heights].
    wavenumbers : ndarray, shape (k,)
        Number of each wave in the unit of length [1 / unit of length].
    spacing : float
        Distance of the nodes [unit of length].
    """

    mean_squares: Values
    wavenumbers: Values
    spacing: float

    def kept_by(self, step: float) -> _SlopesOfWaves:
        """Return the slopes of the waves that nodes at the distance `step` [nodes] can carry."""
        kept = 2 * step * self.spacing * self.wavenumbers < 1
        return replace(
            self, mean_squares=self.mean_squares[kept], wavenumbers=self.wavenumbers[kept]
        )

    def over(self, distance: float) -> float:
        """Return the mean square slope over a distance [nodes], at least 1e-300."""
        length = distance * self.spacing
        # The mean square of the difference between two places of a wave, over its own mean square.
        factors = 4 * np.sin(math.pi * length * self.wavenumbers) ** 2
        return max(float(self.mean_squares @ factors) / length**2, 1e-300)


@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows of a patch without edges, transformed along the second axis.

    Attributes
    ----------
    amplitudes : ndarray, shape (nx, kept)
        Amplitudes of the lowest numbers of Fourier's waves of a periodic patch, or of the cosines
        of a mirrored one [unit of heights].
    mean_squares : ndarray, shape (ky,)
        Mean square amplitudes of all numbers [square of that unit].
    """

    amplitudes: NDArray[Any]  # complex or real
    mean_squares: Values

    @classmethod
    def of(
        cls, heights: Field, kept: int, *, is_periodic: bool, mean: float, unit: float
    ) -> _Rows:
        """Transform the rows of heights, (nx, ny), less their mean.

        The amplitudes of the `kept` lowest numbers are kept. `mean` and `unit` are in the unit of
        the heights. Rows are transformed in bands of
        `ROWS_AT_ONCE`, which fit into the processor's cache.
        """
        rows, columns = heights.shape
        transform = row_transform(ROWS_AT_ONCE, columns, is_periodic)
        amplitudes: list[NDArray[Any]] = []
        sums: list[Values] = []
        transform.band.fill(0)  # the last band may have fewer rows
        for first in range(0, rows, ROWS_AT_ONCE):
            number = min(ROWS_AT_ONCE, rows - first)
            band = transform.band[:number]
            np.subtract(heights[first : first + number], mean, out=band)
            band /= unit * transform.count
            waves = transform.waves()[:number]
            amplitudes.append(waves[:, :kept].copy())
            parts = waves.view(np.float64)  # real and imaginary ones beside each other
            sums.append(np.einsum("ij,ij->j", parts, parts))
        squares = np.sum(sums, axis=0)
        if is_periodic:
            squares = squares.reshape(-1, 2).sum(axis=1)
        return cls(np.concatenate(amplitudes), squares / rows)


@dataclass(frozen=True, eq=False)
class _Waves:
    """The waves of a patch without edges.

    The mean square slope of a wave is the square of its amplitude times the sum of two functions,
    one of its number along the first axis and one of its number along the second axis. Sums over
    many waves are therefore products of matrices.

    Attributes
    ----------
    amplitudes : ndarray, shape (nx, ky)
        Amplitudes of Fourier's waves of a periodic patch, or of the cosines of a mirrored one. The
        shortest waves along the second axis are left out where they have next to no slope, see
        `NEGLIGIBLE` [unit of heights].
    along, across : ndarray of int, shape (nx,) and (ky,)
        Numbers of the waves along both axes: waves in a periodic patch, or half waves in a mirrored
        one. Those along the first axis of a periodic patch have either sign.
    times_along, times_across : ndarray, shapes of along and across
        Number of waves that an amplitude represents, by axis: 2 if it represents the wave of the
        opposite sign as well [1].
    steepness_along, steepness_across : ndarray, shapes of along and across
        Mean square slopes of waves of a unit amplitude by their numbers, in an arbitrary unit.
    left_out : float
        Upper bound of the mean square slope of the waves that are left out, in the same unit.
    is_periodic : bool
        Whether the patch is periodic.
    weights : ndarray, shape (nx, ky), or None
        Weights by which the body multiplies the mean square slopes of the waves; None for
        half-spaces, where they are 1 [1].
    """

    amplitudes: NDArray[Any]  # complex or real
    along: Nodes
    across: Nodes
    times_along: Values
    times_across: Values
    steepness_along: Values
    steepness_across: Values
    left_out: float
    is_periodic: bool
    weights: Field | None

    @classmethod
    def of(
        cls,
        heights: Field,
        aspect: float,
        body: Body,
        *,
        is_periodic: bool,
        mean: float,
        unit: float,
    ) -> _Waves:
        """Transform the heights of a patch, (nx, ny), less their mean and in a unit.

        `aspect` is the second side of a cell over its first, which is the body's unit of length.
        The nodes of a mirrored patch are the centres of its cells.
        """
        from scipy import fft  # here, because few contacts need it

        rows, columns = heights.shape
        if is_periodic:
            along = np.rint(fft.fftfreq(rows, 1 / rows)).astype(np.intp)
            across = np.arange(columns // 2 + 1)
            times_along = np.ones(rows)
            is_single = (across == 0) | (2 * across == columns)
        else:
            along = np.arange(rows)
            across = np.arange(columns)
            times_along = np.where(along == 0, 1.0, 2.0)
            is_single = across == 0
        times_across = np.where(is_single, 1.0, 2.0)
        steepness_along = (along / rows) ** 2
        steepness_across = (across / columns / aspect) ** 2
        transform_rows = partial(
            _Rows.of, heights, is_periodic=is_periodic, mean=mean, unit=unit
        )
        of_rows = transform_rows(across.size // EXPECTED_SHARE)
        of_number = times_across * of_rows.mean_squares
        left_out = _steepest_from(of_number, steepness_across, steepness_along.max())
        # A lower bound of the mean square slope of all waves: as if each number across had only its
        # least steep wave.
        lower_bound = float(of_number @ np.append(1 / rows**2, steepness_across[1:]))
        kept = int(np.argmax(left_out <= NEGLIGIBLE * lower_bound))
        weights = None
        if not body.is_homogeneous:
            kept = across.size  # the body may give large weights to waves of little slope
            half_waves = 2 if is_periodic else 1
            numbers = np.sqrt(np.add.outer(steepness_along, steepness_across))
            weights = _weights(half_waves * math.pi * numbers, body)
        if kept > of_rows.amplitudes.shape[1]:
            of_rows = transform_rows(kept)
        transform: Any = fft.fft if is_periodic else fft.dct
        amplitudes = transform(of_rows.amplitudes[:, :kept], axis=0, norm="forward")
        return cls(
            amplitudes=amplitudes,
            along=along,
            across=across[:kept],
            times_along=times_along,
            times_across=times_across[:kept],
            steepness_along=steepness_along,
            steepness_across=steepness_across[:kept],
            left_out=float(left_out[kept]),
            is_periodic=is_periodic,
            weights=weights,
        )

    def slopes(self, aspect: float) -> tuple[_SlopesOfWaves, _SlopesOfWaves]:
        """Return the mean square slopes along both axes, in a common unit.

        `aspect` is the second side of a cell over its first.
        """
        squares = self._squares(self.amplitudes)
        waves_per_number = 0.5  # numbers count half waves in a mirrored patch
        if self.is_periodic:
            waves_per_number = 1.0
        # Waves of a number and of its opposite have the same slopes.
        mean_squares = np.bincount(
            np.abs(self.along), self.times_along * (squares @ self.times_across)
        ).astype(np.float64, copy=False)
        along = _SlopesOfWaves(
            mean_squares=mean_squares,
            wavenumbers=waves_per_number * np.arange(mean_squares.size) / self.along.size,
            spacing=1.0,
        )
        across = _SlopesOfWaves(
            mean_squares=self.times_across * (self.times_along @ squares),
            wavenumbers=waves_per_number * np.sqrt(self.steepness_across),
            spacing=aspect,
        )
        return along, across

    def cut(self, nodes: tuple[int, int]) -> tuple[Field, float]:
        """Return the heights by the waves that fewer nodes can have, and the share of the others.

        Parameters
        ----------
        nodes : tuple of int
            Nodes (mx, my) of the coarser grid.

        Returns
        -------
        heights : ndarray, shape (mx, my)
            Heights on the coarser grid, of zero mean [unit of heights].
        dropped : float
            Share of the weighted mean square slope of the waves that are cut [1].
        """
        from scipy import fft  # here, because few contacts need it

        rows, columns = self._numbers_on(nodes)
        kept = self.amplitudes[np.ix_(rows, columns)]
        spectrum = (nodes[0], nodes[1] // 2 + 1) if self.is_periodic else nodes
        amplitudes = np.zeros(spectrum, dtype=self.amplitudes.dtype)
        amplitudes[np.ix_(self.along[rows], self.across[columns])] = kept
        heights: Field
        if self.is_periodic:
            heights = fft.irfft2(amplitudes, s=nodes, norm="forward")
        else:
            heights = fft.idctn(amplitudes, norm="forward")
        return np.ascontiguousarray(heights), self._dropped(kept, rows, columns)

    def dropped(self, nodes: tuple[int, int]) -> float:
        """Return the share of the weighted mean square slope that fewer nodes, (mx, my), lack."""
        rows, columns = self._numbers_on(nodes)
        return self._dropped(self.amplitudes[np.ix_(rows, columns)], rows, columns)

    def _dropped(self, kept: NDArray[Any], rows: Nodes, columns: Nodes) -> float:
        """Return the share of the weighted mean square slope that is not in kept waves.

        `kept` are the amplitudes of the given rows and columns of all amplitudes.
        """
        if self._mean_square_slope == 0:
            return 0.0
        share = self._slope_of(kept, rows, columns) / self._mean_square_slope
        return max(1.0 - share, 0.0)

    def _numbers_on(self, nodes: tuple[int, int]) -> tuple[Nodes, Nodes]:
        """Return the indices along both axes of the waves that fewer nodes can have."""
        half_waves = 2 if self.is_periodic else 1
        rows = np.flatnonzero(half_waves * np.abs(self.along) < nodes[0])
        columns = np.flatnonzero(half_waves * self.across < nodes[1])
        return rows, columns

    @computed_once
    def _mean_square_slope(self) -> float:
        """Weighted mean square slope of all waves, in the unit of `steepness_along`."""
        rows, columns = self.amplitudes.shape
        kept = self._slope_of(self.amplitudes, np.arange(rows), np.arange(columns))
        return kept + self.left_out

    def _squares(self, amplitudes: NDArray[Any]) -> Field:
        """Return the squares of the absolute values of amplitudes, of their shape."""
        squares: Field = amplitudes.real**2
        if self.is_periodic:  # amplitudes are complex
            squares += amplitudes.imag**2
        return squares

    def _slope_of(self, amplitudes: NDArray[Any], rows: Nodes, columns: Nodes) -> float:
        """Return the weighted mean square slope of waves in the unit of `steepness_along`.

        `amplitudes` are those of the given rows and columns of all amplitudes.
        """
        squares = self._squares(amplitudes)
        if self.weights is not None:
            squares *= self.weights[np.ix_(rows, columns)]
        times_along = self.times_along[rows]
        times_across = self.times_across[columns]
        steepness_across = times_across * self.steepness_across[columns]
        sums = squares @ np.stack([times_across, steepness_across], axis=1)
        part_along = (times_along * self.steepness_along[rows]) @ sums[:, 0]
        part_across = times_along @ sums[:, 1]
        return float(part_along + part_across)


def _weights(wave_numbers: Field, body: Body) -> Field:
    """Return squares of a body's stiffness over a half-space's, shape of wave_numbers [1].

    The mean has no slope, and the weight 0.
    """
    weights = np.zeros_like(wave_numbers)
    is_wave = wave_numbers > 0
    weights[is_wave] = 1 / np.square(body.relative_compliance(wave_numbers[is_wave]))
    return weights


def _steepest_from(
    squares: Values, steepness_across: Values, steepest_along: float
) -> Values:
    """Return upper bounds of the mean square slopes of the waves that may be left out, (k,).

    For each number across, they are the waves with this number and all higher ones. The last bound
    is 0, that of no waves.

    Parameters
    ----------
    squares : ndarray, shape (k - 1,)
        Mean squares of the waves of each number across.
    steepness_across : ndarray, shape (k - 1,)
        Mean square slope across of a wave of a unit amplitude.
    steepest_along : float
        Mean square slope along of the shortest wave of a unit amplitude.
    """
    steepest = squares * (steepness_across + steepest_along)
    return np.append(np.cumsum(steepest[::-1])[::-1], 0.0)


def _read_free(heights: Field, nodes: tuple[int, int]) -> Field:
    """Interpolate the heights of a free map at the centres of larger cells, shape `nodes` [um]."""
    along, across = (
        _interpolation(all_nodes, _places(all_nodes, fewer))
        for all_nodes, fewer in zip(heights.shape, nodes, strict=True)
    )
    return np.ascontiguousarray((across @ (along @ heights).T).T)


def _places(nodes: int, fewer: int) -> Values:
    """Return the places of fewer nodes along an axis, at the centres of larger cells [spacing]."""
    return (np.arange(fewer, dtype=np.float64) + 0.5) * (nodes / fewer) - 0.5


def _interpolation(nodes: int, places: Values) -> Any:
    """Return the sparse matrix, (m, nodes), by which heights at nodes give heights at places, (m,).

    The places are in units of the spacing. Each height is on Lagrange's polynomial through the
    `NODES_BESIDE` nodes around its place. A place at a node has the height of this node.
    """
    from scipy.sparse import csr_array  # here, because few contacts need it

    number_of_nodes = min(NODES_BESIDE, nodes)
    first = np.floor(places).astype(np.intp) - (number_of_nodes // 2 - 1)
    first = np.clip(first, 0, nodes - number_of_nodes)
    from_first = places - first
    weights = np.ones((places.size, number_of_nodes))
    for number in range(number_of_nodes):
        for other in range(number_of_nodes):
            if other != number:
                weights[:, number] *= (from_first - other) / (number - other)
    columns = first[:, np.newaxis] + np.arange(number_of_nodes)
    ends = number_of_nodes * np.arange(places.size + 1)
    shape = (places.size, nodes)
    return csr_array((weights.ravel(), columns.ravel(), ends), shape=shape)


def _dropped_from_free(
    shape: tuple[int, ...], fewer: Field, lines: tuple[Field, Field], aspect: float
) -> float:
    """Return the share of a free map's mean square slope that fewer nodes lack [1].

    It is the share of the difference between the map and the surface that is interpolated back from
    fewer nodes, on some lines of the map. The waves that are lost are a part of this difference.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the map.
    fewer : ndarray, shape (mx, my)
        Heights on fewer nodes [unit of heights].
    lines : tuple of ndarray, shapes (nx, k) and (ny, m)
        Lines of the map, see `sampled_lines` [unit of heights].
    aspect : float
        Second side of a cell over its first [1].
    """
    along = _squared_slopes(lines[0], fewer, shape[1])
    across = _squared_slopes(lines[1], fewer.T, shape[0])
    total = along.of_map + across.of_map / aspect**2
    lost = along.of_difference + across.of_difference / aspect**2
    return lost / total if total > 0 else 0.0


@dataclass(frozen=True)
class _SquaredSlopes:
    """Mean squares of the slopes of lines along an axis [square of unit of heights over spacing].

    Attributes
    ----------
    of_map : float
        Mean square slope of the map.
    of_difference : float
        Mean square slope of the map less the surface that is read back from fewer nodes.
    """

    of_map: float
    of_difference: float


def _squared_slopes(lines: Field, fewer: Field, map_columns: int) -> _SquaredSlopes:
    """Compute mean square slopes of a map along lines, and of the map less that of fewer nodes.

    Only places between the outermost of the fewer nodes are compared.

    Parameters
    ----------
    lines : ndarray, shape (nx, k)
        Lines along the map's first axis at regular distances, beginning with its border
        [unit of heights].
    fewer : ndarray, shape (mx, my)
        Heights on fewer nodes [unit of heights].
    map_columns : int
        Nodes ny of the map along its second axis.
    """
    nodes = lines.shape[0]
    step = nodes / fewer.shape[0]
    step_of_columns = map_columns / fewer.shape[1]
    # Places of the map's nodes and of its lines, in spacings of the fewer nodes.
    places = (np.arange(nodes) + 0.5) / step - 0.5
    line_numbers = np.arange(lines.shape[1]) * max(1, map_columns // LINES)
    line_places = (line_numbers + 0.5) / step_of_columns - 0.5
    inside = (places >= 0) & (places <= fewer.shape[0] - 1)
    lines_inside = (line_places >= 0) & (line_places <= fewer.shape[1] - 1)
    on_lines = _interpolation(fewer.shape[1], line_places[lines_inside]) @ fewer.T
    read_back = _interpolation(fewer.shape[0], places[inside]) @ on_lines.T
    map_lines = lines[inside][:, lines_inside]
    slopes = np.diff(map_lines, axis=0)
    differences = np.diff(map_lines - read_back, axis=0)
    return _SquaredSlopes(
        of_map=float(np.mean(slopes**2)), of_difference=float(np.mean(differences**2))
    )
