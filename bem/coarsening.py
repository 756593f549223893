"""A map on fewer nodes: the same patch, the same waves, and the share of them that is lost.

The nodes of the coarser grid are the centres of larger cells that cover the same patch. The surface
is read there by its own waves: by Fourier's on a periodic patch, by cosines on a mirrored one. On a
free patch it is read by polynomials of the fifth degree between the nodes; where each larger cell
has an odd number of cells along both axes these are every third or every fifth node of the map.
"""

from __future__ import annotations  # short signatures in help()

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bem.arrays import Field, Nodes, Values
from bem.problem import Boundary
from bem.threads import computed_once

# Number of nodes along an axis from whose heights one between them is interpolated, on free maps.
NODES_BESIDE = 6

# Most lines of a map, about, on which slopes are measured along each axis.
LINES = 64

# Least share of the mean square slope that twice the spacing of a grid loses [1]: smaller ones are
# those of surfaces without waves.
LEAST_LOST = 1e-4


@dataclass(frozen=True, eq=False)
class CoarserMap:
    """A map on fewer nodes of the same patch.

    Attributes
    ----------
    heights : ndarray, shape (mx, my)
        Heights, read-only [um].
    dropped : float
        Share of the given map's mean square slope that is not on this one [1].
    """

    heights: Field
    dropped: float


class Coarsening:
    """A map that is read on fewer nodes, each grid once.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the map [um].
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.
    aspect : float
        Second side of a cell over its first [1].
    """

    def __init__(self, heights: Field, boundary: Boundary, aspect: float) -> None:
        self.heights = heights
        self.boundary = boundary
        self.aspect = aspect
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
                heights, dropped = _read_free(self.heights, nodes, self.aspect)
            else:
                heights, dropped = self._waves.cut(nodes)
                heights += self._mean
            heights.setflags(write=False)
            self._map_by_nodes[nodes] = CoarserMap(heights, dropped)
        return self._map_by_nodes[nodes]

    def lost_slope(self, nodes: tuple[int, ...]) -> float:
        """Return the share of the mean square slope that twice the spacing of a grid loses.

        Slopes are measured on some lines of the map, along the axis that loses more. The share
        is sin(pi / n)^2 where a wave has n nodes of the grid.

        Parameters
        ----------
        nodes : tuple of int
            Nodes (mx, my) of the grid, at most those of the map.

        Returns
        -------
        float
            Share, at least 1e-4 [1].
        """
        most_lost, share = 0.0, LEAST_LOST
        for axis, slopes in enumerate(self._slopes):
            step = self.heights.shape[axis] / nodes[axis]
            near, far = slopes.over(step), slopes.over(2 * step)
            if near - far > most_lost:
                most_lost, share = near - far, max(1 - far / near, LEAST_LOST)
        return share

    @computed_once
    def _slopes(self) -> tuple[_SlopesOverDistances, _SlopesOverDistances]:
        """Mean square slopes along both axes, in a common unit."""
        rows, columns = self.heights.shape
        along = self.heights[:, :: max(1, columns // LINES)]
        across = self.heights[:: max(1, rows // LINES)]
        return (
            _SlopesOverDistances.of(np.ascontiguousarray(along.T), 1.0),
            _SlopesOverDistances.of(across, self.aspect),
        )

    @computed_once
    def _mean(self) -> float:
        """Mean height of the map [um]."""
        return float(self.heights.mean())

    @computed_once
    def _waves(self) -> _Waves:
        """The waves of a patch without edges, by one transform."""
        heights = self.heights - self._mean
        if self.boundary == "periodic":
            return _Waves.periodic(heights, self.aspect)
        return _Waves.mirrored(heights, self.aspect)


@dataclass(frozen=True, eq=False)
class _SlopesOverDistances:
    """Mean square slopes between nodes of lines at distances of 1, 2, 4 and more nodes.

    Attributes
    ----------
    logarithms : ndarray, shape (k,)
        Natural logarithms of the mean square slopes over 2^0 to 2^(k-1) nodes.
    """

    logarithms: Values

    @classmethod
    def of(cls, lines: Field, spacing: float) -> _SlopesOverDistances:
        """Return the slopes along the second axis of lines of nodes at a spacing."""
        nodes = lines.shape[1]
        squares = []
        for power in range(max(nodes.bit_length() - 2, 1)):
            distance = 2**power
            rise = lines[:, distance:] - lines[:, :-distance]
            mean_square = 0.0
            if rise.size:
                mean_square = float(np.vdot(rise, rise)) / rise.size
            squares.append(mean_square / (distance * spacing) ** 2)
        return cls(np.log(np.maximum(squares, 1e-300)))

    def over(self, distance: float) -> float:
        """Return the mean square slope over a distance [nodes], interpolated between powers."""
        powers = np.arange(self.logarithms.size)
        return math.exp(np.interp(math.log2(distance), powers, self.logarithms))


@dataclass(frozen=True, eq=False)
class _Waves:
    """The waves of a patch without edges.

    The mean square slope of a wave is the square of its amplitude times the sum of a function of
    its first number and one of its second number, so that sums over many waves are products of
    matrices.

    Attributes
    ----------
    amplitudes : ndarray, shape (nx, ny // 2 + 1) or (nx, ny)
        Amplitudes of Fourier's waves of a periodic patch, or of the cosines of a mirrored one [um].
    along, across : ndarray of int, shape (nx,) and (ny // 2 + 1,) or (ny,)
        Waves in the patch, or half waves in a mirrored one; negative ones of the first axis of a
        periodic patch run the other way.
    times_along, times_across : ndarray, shapes of along and across
        Number of waves for which an amplitude stands, by axis: 2 if it stands also for the wave the
        other way [1].
    aspect : float
        Second side of a cell over its first [1].
    is_periodic : bool
        Whether the patch is periodic.
    """

    amplitudes: NDArray[Any]  # complex or real
    along: Nodes
    across: Nodes
    times_along: Values
    times_across: Values
    aspect: float
    is_periodic: bool

    @classmethod
    def periodic(cls, heights: Field, aspect: float) -> _Waves:
        """Return the waves of a periodic patch of cells with an aspect, second side over first."""
        from scipy import fft  # here, because few contacts need it

        rows, columns = heights.shape
        across = np.arange(columns // 2 + 1)
        stand_for_one = (across == 0) | (2 * across == columns)
        return cls(
            amplitudes=fft.rfft2(heights, norm="forward"),
            along=np.rint(fft.fftfreq(rows, 1 / rows)).astype(np.intp),
            across=across,
            times_along=np.ones(rows),
            times_across=np.where(stand_for_one, 1.0, 2.0),
            aspect=aspect,
            is_periodic=True,
        )

    @classmethod
    def mirrored(cls, heights: Field, aspect: float) -> _Waves:
        """Return the cosines of a mirrored patch; its nodes are the centres of cells."""
        from scipy import fft  # here, because few contacts need it

        rows, columns = heights.shape
        along = np.arange(rows)
        across = np.arange(columns)
        return cls(
            amplitudes=fft.dctn(heights, norm="forward"),
            along=along,
            across=across,
            times_along=np.where(along == 0, 1.0, 2.0),
            times_across=np.where(across == 0, 1.0, 2.0),
            aspect=aspect,
            is_periodic=False,
        )

    def cut(self, nodes: tuple[int, int]) -> tuple[Field, float]:
        """Return the heights of those waves that fewer nodes have, and the share of the others.

        Parameters
        ----------
        nodes : tuple of int
            Nodes (mx, my) of the coarser grid.

        Returns
        -------
        heights : ndarray, shape (mx, my)
            Heights on the coarser grid, of zero mean [um].
        dropped : float
            Share of the mean square slope of the waves that are cut [1].
        """
        from scipy import fft  # here, because few contacts need it

        half_waves = 2 if self.is_periodic else 1
        rows = np.flatnonzero(half_waves * np.abs(self.along) < nodes[0])
        columns = np.flatnonzero(half_waves * self.across < nodes[1])
        kept = self.amplitudes[np.ix_(rows, columns)]
        share = 1.0
        if self._mean_square_slope > 0:
            share = self._slope_of(kept, rows, columns) / self._mean_square_slope
        spectrum = (nodes[0], nodes[1] // 2 + 1) if self.is_periodic else nodes
        amplitudes = np.zeros(spectrum, dtype=self.amplitudes.dtype)
        amplitudes[np.ix_(self.along[rows], self.across[columns])] = kept
        heights: Field
        if self.is_periodic:
            heights = fft.irfft2(amplitudes, s=nodes, norm="forward")
        else:
            heights = fft.idctn(amplitudes, norm="forward")
        return np.ascontiguousarray(heights), max(1.0 - share, 0.0)

    @computed_once
    def _mean_square_slope(self) -> float:
        """Mean square slope of all waves, in an arbitrary unit."""
        rows, columns = self.amplitudes.shape
        return self._slope_of(self.amplitudes, np.arange(rows), np.arange(columns))

    def _slope_of(self, amplitudes: NDArray[Any], rows: Nodes, columns: Nodes) -> float:
        """Return the mean square slope of waves in the unit of `_mean_square_slope`.

        `amplitudes` are those of the given rows and columns of all amplitudes [um].
        """
        squares = amplitudes.real**2
        if self.is_periodic:  # amplitudes are complex
            squares += amplitudes.imag**2
        nodes_across = self.times_across.size
        if self.is_periodic:
            nodes_across = 2 * (nodes_across - 1)
        slope_along = (self.along[rows] / self.along.size) ** 2
        slope_across = (self.across[columns] / nodes_across / self.aspect) ** 2
        times_along = self.times_along[rows]
        times_across = self.times_across[columns]
        weights = np.stack([times_across, times_across * slope_across], axis=1)
        sums = squares @ weights
        part_along = (times_along * slope_along) @ sums[:, 0]
        part_across = times_along @ sums[:, 1]
        return float(part_along + part_across)


def _read_free(
    heights: Field, nodes: tuple[int, int], aspect: float
) -> tuple[Field, float]:
    """Return a free surface at the centres of larger cells.

    What the coarser grid has not is the difference to the surface that is read back from it by
    cubic splines. It is measured on some lines of the map.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um].
    nodes : tuple of int
        Nodes (mx, my) of the coarser grid.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    heights : ndarray, shape (mx, my)
        Heights on the coarser grid [um].
    dropped : float
        Share of the mean square slope of this difference, at least that of the waves that are lost
        [1].
    """
    places: list[Values] = []
    fewer = heights
    for axis in (0, 1):
        step = heights.shape[axis] / nodes[axis]
        places.append((np.arange(nodes[axis]) + 0.5) * step - 0.5)
        fewer = _interpolated(fewer, axis, places[axis])
    along = _squared_slopes_of_lines(heights, fewer, places)
    across = _squared_slopes_of_lines(heights.T, fewer.T, places[::-1])
    total = along.of_map + across.of_map / aspect**2
    lost = along.of_difference + across.of_difference / aspect**2
    return np.ascontiguousarray(fewer), lost / total if total > 0 else 0.0


def _interpolated(heights: Field, axis: int, places: Values) -> Field:
    """Return heights at places [spacing] along an axis, interpolated from the nodes around.

    Each is by Lagrange's polynomial through the `NODES_BESIDE` nodes around its place.

    Places at nodes give the heights of these nodes.
    """
    nodes = heights.shape[axis]
    beside = min(NODES_BESIDE, nodes)
    first = np.floor(places).astype(np.intp) - (beside // 2 - 1)
    first = np.clip(first, 0, nodes - beside)
    read_shape = list(heights.shape)
    read_shape[axis] = places.size
    read: Field = np.zeros(read_shape)
    from_first = places - first
    for number in range(beside):
        weight = np.ones_like(places)
        for other in range(beside):
            if other != number:
                weight *= (from_first - other) / (number - other)
        neighbours = heights.take(first + number, axis)
        read += neighbours * np.expand_dims(weight, 1 - axis)
    return read


@dataclass(frozen=True)
class _SquaredSlopes:
    """Mean squares of the slopes of lines along an axis [um2 / spacing2].

    Attributes
    ----------
    of_map : float
        Mean square slope of the map.
    of_difference : float
        Mean square slope of the map less the surface that is read back from fewer nodes.
    """

    of_map: float
    of_difference: float


def _squared_slopes_of_lines(
    heights: Field, fewer: Field, places: list[Values]
) -> _SquaredSlopes:
    """Return mean square slopes along the first axis, on some lines of a map.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the map [um].
    fewer : ndarray, shape (mx, my)
        Heights at the places [um].
    places : list of ndarray, shapes (mx,) and (my,)
        Places of the fewer nodes along both axes [spacing].
    """
    first, last = places[1][[0, -1]]
    within = np.arange(math.ceil(first), math.floor(last) + 1)
    lines = within[:: max(1, within.size // LINES)]
    first, last = places[0][[0, -1]]
    window = slice(math.ceil(first), math.floor(last) + 1)
    inner_nodes = np.arange(window.start, window.stop, dtype=np.float64)
    map_lines = heights[window, lines]
    read_back = _splined(fewer, 1, places[1], lines.astype(np.float64))
    read_back = _splined(read_back, 0, places[0], inner_nodes)
    slopes = np.diff(map_lines, axis=0)
    differences = np.diff(map_lines - read_back, axis=0)
    return _SquaredSlopes(float(np.mean(slopes**2)), float(np.mean(differences**2)))


def _splined(heights: Field, axis: int, nodes: Values, places: Values) -> Field:
    """Return heights at some places along an axis, by the cubic spline through those at nodes."""
    from scipy.interpolate import make_interp_spline  # here, because few contacts need it

    read: Field = make_interp_spline(nodes, heights, 3, axis=axis)(places)
    return read
