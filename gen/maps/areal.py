"""Areal parameters of a surface by ISO 25178-2.

The docstrings name the clauses of the standard (edition of 2012) that define the parameters.
Heights are taken about their mean. Form and waves are not removed here: this is the user's choice
when the map is prepared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.read import Topography
from gen.statistics import LOST, Description

# autocorrelation at the lag Sal: the default of ISO 25178-3
DECAY = 0.2
# width of the core of the material ratio curve, as a share of all material ratios (ISO 13565-2)
CORE = 0.4
RAYS = 360  # number of directions over half a turn along which the autocorrelation is followed


class ArealParameter(NamedTuple):
    """A parameter of a surface, as tables and reports show it."""

    name: str
    unit: str  # "1" for pure numbers
    meaning: str


PARAMETERS = (
    ArealParameter("Sa", "um", "arithmetical mean height: mean distance from the mean"),
    ArealParameter("Sq", "um", "root mean square height"),
    ArealParameter("Sz", "um", "maximum height: Sp + Sv"),
    ArealParameter("Sp", "um", "maximum peak height above the mean"),
    ArealParameter("Sv", "um", "maximum pit height below the mean"),
    ArealParameter("Ssk", "1", "skewness of the heights: negative if pits prevail"),
    ArealParameter("Sku", "1", "kurtosis of the heights: 3 if they are normal"),
    ArealParameter("Sdq", "1", "root mean square gradient"),
    ArealParameter(
        "Sdr", "%", "developed interfacial area ratio: area gained over a plane"
    ),
    ArealParameter("Sal", "um", "autocorrelation length: fastest decay to 0.2"),
    ArealParameter("Str", "1", "texture aspect ratio: 1 isotropic, 0 one direction"),
    ArealParameter(
        "Sk", "um", "core height, of the flattest 40 % of the material ratio curve"
    ),
    ArealParameter("Spk", "um", "reduced peak height, above the core"),
    ArealParameter("Svk", "um", "reduced dale depth, below the core"),
    ArealParameter("Smr1", "%", "material ratio of the peaks"),
    ArealParameter("Smr2", "%", "material ratio above the dales"),
    ArealParameter(
        "Smr", "%", "material ratio at the depth asked for, below the highest node"
    ),
)
"""The parameters in the order in which they are printed and written."""


def areal_parameters(topography: Topography, depth: float | None = None) -> Description:
    """Compute the areal parameters of a surface by ISO 25178-2.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    depth : float, optional
        Depth below the highest node at which Smr is computed [um]; without it Smr is left out.

    Returns
    -------
    Description
        Values of `PARAMETERS` by name, in their units. A flat surface has NaN except for Sa, Sq,
        Sz, Sp, Sv, Sdq and Sdr. A surface whose heights are lost in rounding has NaN except for Sa,
        Sq, Sz, Sp and Sv. Sal or Str are NaN if the autocorrelation does not fall to `DECAY`
        within half of the sides. The reason says which of the three cases it is, "" if none.
    """
    heights = topography.heights
    scaled = _scaled(heights)
    values = _amplitudes(scaled)
    for parameter in PARAMETERS:
        values.setdefault(parameter.name, math.nan)
    if depth is None:
        del values["Smr"]
    if heights.min() == heights.max():
        values |= {"Sdq": 0.0, "Sdr": 0.0}
        return Description(values, "flat surface")
    if is_lost(heights):
        return Description(values, "heights lost in rounding beside their offset")
    periodic = topography.boundary == "periodic"
    centred = scaled.heights * scaled.unit
    gradient = gradients(centred, topography.spacing, periodic=periodic)
    lengths = _autocorrelation_lengths(
        scaled.heights, topography.spacing, periodic=periodic
    )
    values |= _moments(scaled.heights)
    values |= {"Sdq": gradient.rms, "Sdr": gradient.developed_percent}
    values |= {"Sal": lengths.shortest, "Str": lengths.aspect}
    values |= _curve_parameters(scaled, depth)
    return Description(values, lengths.reason)


@dataclass(frozen=True, eq=False)
class _ScaledHeights:
    """Heights about their mean, in a unit near their span.

    In this unit, powers of heights neither overflow nor vanish.
    """

    heights: Heights  # heights about their mean [unit], shape (nx, ny)
    unit: float  # a power of two, so that scaling does not round [um]


def _scaled(heights: Heights) -> _ScaledHeights:
    """Subtract the mean of heights given in um, and scale them by a power of two near their span.

    The unit is 1 to 2 times the span, but not below 2^-1000 um and not above 2^1000 um; it is 1 um
    for a flat surface.
    """
    lowest = float(heights.min())
    highest = float(heights.max())
    span = highest - lowest
    exponent = math.frexp(span)[1]
    unit = 2.0 ** min(max(exponent, -1000), 1000)
    # First subtract the middle, which cannot overflow; then the mean of the small numbers.
    middle = lowest + 0.5 * span
    scaled = (heights - middle) / unit
    scaled -= scaled.mean()
    return _ScaledHeights(heights=scaled, unit=unit)


def _amplitudes(scaled: _ScaledHeights) -> dict[str, float]:
    """Compute Sa, Sq, Sz, Sp and Sv by name [um] (ISO 25178-2:2012, 4.1)."""
    heights = scaled.heights
    unit = scaled.unit
    mean_distance = float(np.abs(heights).mean())
    rms_height = math.sqrt(np.mean(heights**2))
    peak = float(heights.max())
    pit = 0.0 - float(heights.min())  # 0, not -0, for a flat surface
    return {
        "Sa": mean_distance * unit,
        "Sq": rms_height * unit,
        "Sz": (peak + pit) * unit,
        "Sp": peak * unit,
        "Sv": pit * unit,
    }


def _moments(heights: Heights) -> dict[str, float]:
    """Compute the skewness Ssk and kurtosis Sku by name [1] (ISO 25178-2:2012, 4.1).

    The heights are counted from their mean, in any unit.
    """
    squares = heights**2
    variance = squares.mean()
    third_moment = np.mean(squares * heights)
    fourth_moment = np.mean(squares**2)
    return {
        "Ssk": float(third_moment / variance**1.5),
        "Sku": float(fourth_moment / variance**2),
    }


def is_lost(heights: Heights) -> bool:
    """Tell whether rounding has destroyed the shape of heights with a large offset.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes, not all of them zero [um].

    Returns
    -------
    bool
        Whether the standard deviation of the heights is at most `gen.statistics.LOST` times the
        rounding of the largest amount among them.
    """
    lowest = float(heights.min())
    highest = float(heights.max())
    largest = max(abs(lowest), abs(highest))
    rounding = float(np.finfo(heights.dtype).eps)  # relative
    relative_deviation = float(np.std(heights / largest))
    return relative_deviation <= LOST * rounding


@dataclass(frozen=True, eq=False)
class _MaterialCurve:
    """Material ratio curve: each height of a surface, and the share of the nodes above it."""

    falling: Values  # heights of all nodes, the highest first, shape (nodes,)
    ratios: Values  # material ratio at each of these heights, from 0 to 100 [%], shape (nodes,)

    def ratio_at(self, level: float) -> float:
        """Return the material ratio at a level, given in the unit of the heights [%]."""
        rising = self.falling[::-1]
        return float(np.interp(level, rising, self.ratios[::-1]))

    @property
    def turned_over(self) -> _MaterialCurve:
        """Curve of the surface turned upside down: its peaks are the dales of this curve."""
        return _MaterialCurve(falling=-self.falling[::-1], ratios=self.ratios)


def _curve_parameters(scaled: _ScaledHeights, depth: float | None) -> dict[str, float]:
    """Compute the parameters of the material ratio curve by name, in the units of `PARAMETERS`.

    The equivalent line gives Sk, its fall from 0 to 100 %. Smr1 and Smr2 are the material ratios
    at its upper and lower end. Spk and Svk are the heights of triangles that have the area of the
    curve above the upper end and below the lower end. Smr is the material ratio at a depth [um]
    below the highest node; it is left out if the depth is None. (ISO 25178-2:2012, 4.4;
    ISO 13565-2)
    """
    falling = np.sort(scaled.heights, axis=None)[::-1]
    curve = _MaterialCurve(falling, ratios=np.linspace(0.0, 100.0, falling.size))
    line = _equivalent_line(curve)
    bottom = line.top + 100.0 * line.slope
    peaks = _equal_triangle(curve, line.top)
    dales = _equal_triangle(curve.turned_over, -bottom)
    parameters = {
        "Sk": -100.0 * line.slope * scaled.unit,
        "Spk": peaks.height * scaled.unit,
        "Svk": dales.height * scaled.unit,
        "Smr1": peaks.ratio,
        "Smr2": 100.0 - dales.ratio,
    }
    if depth is not None:
        level = falling[0] - depth / scaled.unit
        parameters["Smr"] = curve.ratio_at(level)
    return parameters


@dataclass(frozen=True)
class _EquivalentLine:
    """Straight line through the core of a material ratio curve, in the unit of its heights."""

    top: float  # height of the line at a material ratio of 0
    slope: float  # change of height per percent of material ratio, negative or 0


def _equivalent_line(curve: _MaterialCurve) -> _EquivalentLine:
    """Fit a line to the core of a curve by least squares.

    The core is the part over `CORE` of the material ratio in which the curve falls least; if
    several parts fall equally, it is the highest of them.
    """
    falling = curve.falling
    width = max(1, round(CORE * (falling.size - 1)))
    falls = falling[:-width] - falling[width:]
    first = int(np.argmin(falls))
    part = slice(first, first + width + 1)
    start = float(falling[first])
    core = falling[part] - start  # exactly 0 on a plateau
    ratios = curve.ratios[part]
    mean_ratio = ratios.mean()
    from_mean = ratios - mean_ratio
    slope = float(from_mean @ core / np.sum(from_mean**2))
    top = start + (float(core.mean()) - slope * float(mean_ratio))
    return _EquivalentLine(top=top, slope=slope)


@dataclass(frozen=True)
class _Triangle:
    """Right triangle that stands for the peaks of a material ratio curve above a level."""

    height: float  # height of the triangle, in the unit of the curve
    ratio: float  # its base: material ratio of the curve at the level [%]


def _equal_triangle(curve: _MaterialCurve, level: float) -> _Triangle:
    """Return the triangle whose area is that of a curve above a level.

    The level has the unit of the curve's heights. The triangle is 0 high if nothing is above it.
    """
    ratio = curve.ratio_at(level)
    if not ratio:
        return _Triangle(height=0.0, ratio=ratio)
    nodes = int(np.count_nonzero(curve.falling > level))
    heights = np.append(curve.falling[:nodes] - level, 0.0)
    ratios = np.append(curve.ratios[:nodes], ratio)
    area = float(np.trapezoid(heights, ratios))
    return _Triangle(height=2.0 * area / ratio, ratio=ratio)


@dataclass(frozen=True)
class Gradients:
    """Parameters of the gradients of a surface (ISO 25178-2:2012, 4.3)."""

    rms: float  # root mean square gradient Sdq [1]
    developed_percent: float  # area of the surface beyond that of its projection, Sdr [%]


def gradients(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool
) -> Gradients:
    """Compute Sdq and Sdr of a surface (ISO 25178-2:2012, 4.3).

    The surface is taken as plane triangles. Sdq^2 is the mean of their squared gradients, and Sdr
    the mean of sqrt(1 + squared gradient) - 1. Each cell is cut into triangles twice, along either
    diagonal, and the mean of the two cuts is taken.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    periodic : bool
        Whether the surface is periodic; then the cells between its last and first nodes count too.

    Returns
    -------
    Gradients
        Sdq and Sdr; infinite or NaN if they are beyond what numbers hold.
    """
    if periodic:
        heights = np.pad(heights, (0, 1), mode="wrap")
    # mean square of the gradients, in units of the square of the largest slope: it cannot overflow
    mean_square = 0.0
    gained_area = 0.0  # over the projected area
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        along_x = np.abs(np.diff(heights, axis=0)) / spacing[0]
        along_y = np.abs(np.diff(heights, axis=1)) / spacing[1]
        largest = max(along_x.max(), along_y.max())
        unit = largest or 1.0  # 1 for a flat surface
        # Both cuts together have four triangles a cell, one for each edge along x with each edge
        # along y.
        for edges_x in (along_x[:, :-1], along_x[:, 1:]):
            for edges_y in (along_y[:-1], along_y[1:]):
                gradient = np.hypot(edges_x, edges_y)
                in_units = gradient / unit
                mean_square += 0.25 * float(np.mean(in_units**2))
                # sqrt(1 + square) - 1 without the cancellation of small gradients
                stretch = np.hypot(1, gradient)
                gained = gradient * (gradient / (1 + stretch))
                gained_area += 0.25 * float(np.mean(gained))
        return Gradients(
            rms=float(largest * math.sqrt(mean_square)),
            developed_percent=100.0 * gained_area,
        )


@dataclass(frozen=True)
class _AutocorrelationLengths:
    """Lengths over which the autocorrelation decays (ISO 25178-2:2012, 4.2)."""

    # Sal [um]; NaN if the autocorrelation falls to `DECAY` along no direction
    shortest: float
    # Str [1]; NaN unless the autocorrelation falls to `DECAY` along every direction
    aspect: float
    reason: str  # why a number is NaN, "" if none is


def _autocorrelation_lengths(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool
) -> _AutocorrelationLengths:
    """Compute Sal and Str of heights, shape (nx, ny), which are counted from their mean.

    The heights have any unit, and not all of them are 0. The spacing is that along x and y [um].
    """
    correlation = autocorrelation(heights, periodic=periodic)
    decays = decay_lengths(correlation, spacing)
    fallen = np.isfinite(decays.lengths)
    reason = f"the autocorrelation does not fall to {DECAY:g} within half of the sides"
    if not fallen.any():
        return _AutocorrelationLengths(shortest=math.nan, aspect=math.nan, reason=reason)
    shortest = float(decays.lengths[fallen].min())
    if fallen.all():
        aspect = shortest / float(decays.lengths.max())
        return _AutocorrelationLengths(shortest, aspect, reason="")
    # Along some direction the decay is longer than the lags that are known.
    longest_reach = float(decays.reaches[~fallen].max())
    bound = min(shortest / longest_reach, 1.0)
    reason = f"{reason} along all directions, so Str is below {bound:.2g}"
    return _AutocorrelationLengths(shortest, aspect=math.nan, reason=reason)


def autocorrelation(heights: Heights, *, periodic: bool) -> Values:
    """Compute the autocorrelation of heights for lags up to half of the sides.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights about their mean, not all of them zero, in any unit.
    periodic : bool
        Whether the surface is periodic. If not, the mean for each lag is taken over the pairs of
        nodes with this lag inside the map.

    Returns
    -------
    ndarray, shape (nx // 2 + 1, 2 (ny // 2) + 1)
        Autocorrelation, 1 at no lag [1]. Lags in nodes run from 0 to nx // 2 along x, and from
        -(ny // 2) to ny // 2 along y.
    """
    nx, ny = heights.shape
    largest_x = nx // 2
    largest_y = ny // 2
    sizes = (nx, ny)
    if not periodic:
        # Zeros beyond the map keep nodes from pairs with the next period of the transform.
        sizes = (_padded(nx + largest_x), _padded(ny + largest_y))
    transform = np.fft.rfft2(heights, s=sizes)
    power = transform.real**2 + transform.imag**2
    products = np.fft.irfft2(power, s=sizes)  # sums of products over all pairs
    lags_x = np.arange(largest_x + 1)
    lags_y = np.arange(-largest_y, largest_y + 1)
    pairs: float | Values = float(nx * ny)
    if not periodic:
        pairs = np.outer(nx - lags_x, ny - abs(lags_y))
    # Negative lags index the array from its end, where the transform has them.
    means = products[np.ix_(lags_x, lags_y)] / pairs
    variance = means[0, largest_y]
    return np.asarray(means / variance)


def _padded(nodes: int) -> int:
    """Return the next multiple of 32: transforms of such lengths are fast."""
    return 32 * math.ceil(nodes / 32)


@dataclass(frozen=True, eq=False)
class DecayLengths:
    """Decay of the autocorrelation to `DECAY` along `RAYS` directions over half a turn.

    Entry i of the arrays, shape (RAYS,), has the angle pi (i / `RAYS` - 1/2) from the x axis.
    """

    # lags at which the autocorrelation first falls to `DECAY`, else inf [um]
    lengths: Values
    reaches: Values  # largest lags at which the autocorrelation is known [um]


def decay_lengths(correlation: Values, spacing: tuple[float, float]) -> DecayLengths:
    """Follow the autocorrelation along all directions until it falls to `DECAY`.

    Parameters
    ----------
    correlation : ndarray, shape (k + 1, 2 l + 1)
        Autocorrelation from `autocorrelation` [1], at lags from 0 to k nodes along x and from -l
        to l nodes along y.
    spacing : tuple of float
        Distance of the nodes along x and y [um].

    Returns
    -------
    DecayLengths
        Lag of the decay and largest lag for each direction.
    """
    lengths = np.full(RAYS, math.inf)
    reaches = np.empty(RAYS)
    for index in range(RAYS):
        angle = math.pi * (index / RAYS - 0.5)
        ray = _ray(correlation, spacing, angle)
        reaches[index] = ray.lags[-1]
        lengths[index] = ray.decay_length
    return DecayLengths(lengths=lengths, reaches=reaches)


@dataclass(frozen=True, eq=False)
class _Ray:
    """Autocorrelation along one direction."""

    lags: Values  # rising from 0 [um], shape (k,)
    values: Values  # autocorrelation at these lags [1], shape (k,)

    @property
    def decay_length(self) -> float:
        """Lag at which the autocorrelation first falls to `DECAY` [um]; inf if it does not.

        It is interpolated between two lags.
        """
        below = np.flatnonzero(self.values <= DECAY)
        if not below.size:
            return math.inf
        last = below[0]  # 1 or more, because the autocorrelation is 1 at lag 0
        first = last - 1
        fall = self.values[first] - self.values[last]
        share = (self.values[first] - DECAY) / fall
        step = self.lags[last] - self.lags[first]
        return float(self.lags[first] + share * step)


def _ray(correlation: Values, spacing: tuple[float, float], angle: float) -> _Ray:
    """Return the autocorrelation along a direction, as far as it is known.

    The angle is -pi/2 to pi/2 from the x axis [rad]. Values are interpolated at about two lags for
    each line of nodes that the direction crosses.
    """
    largest_x = correlation.shape[0] - 1
    largest_y = correlation.shape[1] // 2
    nodes_x = math.cos(angle) / spacing[0]  # nodes along x in a lag of 1 um
    nodes_y = math.sin(angle) / spacing[1]  # nodes along y in a lag of 1 um
    # A direction along one axis, but for rounding, never leaves the grid along the other axis.
    reaches = []
    if nodes_x > 1e-12 / spacing[0]:
        reaches.append(largest_x / nodes_x)
    if abs(nodes_y) > 1e-12 / spacing[1]:
        reaches.append(largest_y / abs(nodes_y))
    farthest = min(reaches)
    steps = 2 * math.ceil(farthest * max(nodes_x, abs(nodes_y)))
    lags = np.linspace(0.0, farthest, steps + 1)
    # In the correlation, a lag of 0 along y has the index `largest_y`.
    values = _bilinear(correlation, lags * nodes_x, lags * nodes_y + largest_y)
    return _Ray(lags=lags, values=values)


def _bilinear(values: Values, x: Values, y: Values) -> Values:
    """Interpolate values on a grid, shape (m, n), bilinearly at k places.

    `x` and `y`, shape (k,), are the distances of the places from the first node, in nodes. Return
    the values at the places, shape (k,).
    """
    nx, ny = values.shape
    i = np.clip(np.floor(x).astype(int), 0, nx - 2)
    j = np.clip(np.floor(y).astype(int), 0, ny - 2)
    u = x - i  # place inside the cell, 0 to 1
    v = y - j
    near = (1 - v) * values[i, j] + v * values[i, j + 1]
    far = (1 - v) * values[i + 1, j] + v * values[i + 1, j + 1]
    return np.asarray((1 - u) * near + u * far)
