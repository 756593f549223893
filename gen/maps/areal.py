"""Areal parameters of a surface by ISO 25178-2.

The parameters follow the definitions of the standard, whose clauses (edition of 2012) the functions
name. Heights count from their mean; nothing is subtracted beyond the preparation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.read import Topography
from gen.statistics import LOST, Description

# value s to which the autocorrelation falls at Sal, the default of ISO 25178-3
DECAY = 0.2
CORE = 0.4  # share of the material ratio over which the core of the curve is sought (ISO 13565-2)
RAYS = 360  # directions over half a turn in which the autocorrelation is followed


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
        Values of `PARAMETERS` by their names, in their units. A flat surface has NaN for all but
        the heights and gradients, and a surface whose heights are lost in rounding for all but the
        heights. Sal or Str are NaN if the autocorrelation does not fall to `DECAY` within half of
        the sides. The reason says which of these holds.
    """
    heights = topography.heights
    scaled = _scaled(heights)
    values = _amplitudes(scaled)
    for parameter in PARAMETERS:
        values.setdefault(parameter.name, math.nan)
    if depth is None:
        del values["Smr"]
    if heights.min() == heights.max():
        return Description(values | {"Sdq": 0.0, "Sdr": 0.0}, "flat surface")
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
    """Heights from their mean in a unit of their size, whose powers neither overflow nor vanish."""

    heights: Heights  # [unit]
    unit: float  # a power of two, so that scaling does not round [um]


def _scaled(heights: Heights) -> _ScaledHeights:
    """Return heights [um] from their mean, in a unit between their span and twice their span."""
    lowest = float(heights.min())
    highest = float(heights.max())
    exponent = math.frexp(highest - lowest)[1]
    unit = 2.0 ** min(max(exponent, -1000), 1000)
    scaled = (heights - (lowest + 0.5 * (highest - lowest))) / unit
    scaled -= scaled.mean()
    return _ScaledHeights(scaled, unit)


def _amplitudes(scaled: _ScaledHeights) -> dict[str, float]:
    """Compute the parameters of amplitude (ISO 25178-2:2012, 4.1) [um]."""
    heights = scaled.heights
    peak = float(heights.max())
    pit = 0.0 - float(heights.min())
    return {
        "Sa": float(np.abs(heights).mean()) * scaled.unit,
        "Sq": math.sqrt(np.mean(heights**2)) * scaled.unit,
        "Sz": (peak + pit) * scaled.unit,
        "Sp": peak * scaled.unit,
        "Sv": pit * scaled.unit,
    }


def _moments(heights: Heights) -> dict[str, float]:
    """Compute skewness and kurtosis of heights about their mean (ISO 25178-2:2012, 4.1) [1]."""
    squares = heights**2
    variance = squares.mean()
    return {
        "Ssk": float(np.mean(squares * heights) / variance**1.5),
        "Sku": float(np.mean(squares**2) / variance**2),
    }


def is_lost(heights: Heights) -> bool:
    """Tell whether the offset of heights has left too few of their digits to have a shape.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes, not all of them zero [um].

    Returns
    -------
    bool
        Whether their standard deviation is no more than `gen.statistics.LOST` roundings of the
        largest one.
    """
    largest = max(abs(float(heights.min())), abs(float(heights.max())))
    rounding = float(np.finfo(heights.dtype).eps)
    return float(np.std(heights / largest)) <= LOST * rounding


@dataclass(frozen=True, eq=False)
class _MaterialCurve:
    """Material ratio curve of a surface: heights over the share of nodes that are above them."""

    falling: Values  # heights of all nodes, the highest first, shape (nodes,)
    ratios: Values  # material ratio of each of these heights [%], shape (nodes,)

    def ratio_at(self, level: float) -> float:
        """Return the material ratio at a level [%]."""
        return float(np.interp(level, self.falling[::-1], self.ratios[::-1]))

    @property
    def turned_over(self) -> _MaterialCurve:
        """The curve of the surface upside down, whose peaks are the dales of this one."""
        return _MaterialCurve(-self.falling[::-1], self.ratios)


def _curve_parameters(scaled: _ScaledHeights, depth: float | None) -> dict[str, float]:
    """Compute the parameters of the material ratio curve (ISO 25178-2:2012, 4.4; ISO 13565-2).

    The equivalent line is the least-squares line through the part of the curve over `CORE` of the
    material ratio that falls least, the first of several. Sk is its fall from 0 to 100 %; Spk and
    Svk are the heights of triangles over Smr1 and beyond Smr2 with the areas of the curve there.
    Smr is that at a depth [um], and left out without one.
    """
    falling = np.sort(scaled.heights, axis=None)[::-1]
    curve = _MaterialCurve(falling, np.linspace(0.0, 100.0, falling.size))
    line = _equivalent_line(curve)
    peaks = _reduced(curve, line.top)
    dales = _reduced(curve.turned_over, -(line.top + 100.0 * line.slope))
    parameters = {
        "Sk": -100.0 * line.slope * scaled.unit,
        "Spk": peaks.height * scaled.unit,
        "Svk": dales.height * scaled.unit,
        "Smr1": peaks.ratio,
        "Smr2": 100.0 - dales.ratio,
    }
    if depth is not None:
        parameters["Smr"] = curve.ratio_at(falling[0] - depth / scaled.unit)
    return parameters


@dataclass(frozen=True)
class _EquivalentLine:
    """Straight line through the core of a material ratio curve."""

    top: float  # its height at a material ratio of 0
    slope: float  # its slope, negative or 0 [height / %]


def _equivalent_line(curve: _MaterialCurve) -> _EquivalentLine:
    """Fit a line to the part of a curve over `CORE` of the material ratio that falls least."""
    falling = curve.falling
    width = max(1, round(CORE * (falling.size - 1)))
    first = int(np.argmin(falling[:-width] - falling[width:]))
    start = float(falling[first])
    core = falling[first : first + width + 1] - start  # exactly 0 on a plateau
    ratios = curve.ratios[first : first + width + 1]
    from_mean = ratios - ratios.mean()
    slope = float(from_mean @ core / np.sum(from_mean**2))
    top = start + (float(core.mean()) - slope * float(ratios.mean()))
    return _EquivalentLine(top, slope)


@dataclass(frozen=True)
class _Reduced:
    """The peaks that a curve has above a level, as a triangle of the same area."""

    height: float  # height of the triangle, in the unit of the curve
    ratio: float  # material ratio at the level, its base [%]


def _reduced(curve: _MaterialCurve, level: float) -> _Reduced:
    """Return the triangle with the area that a curve has above a level."""
    ratio = curve.ratio_at(level)
    if not ratio:
        return _Reduced(0.0, ratio)
    nodes = int(np.count_nonzero(curve.falling > level))
    heights = np.append(curve.falling[:nodes] - level, 0.0)
    ratios = np.append(curve.ratios[:nodes], ratio)
    area = float(np.trapezoid(heights, ratios))
    return _Reduced(2.0 * area / ratio, ratio)


@dataclass(frozen=True)
class Gradients:
    """Gradients of a surface."""

    rms: float  # root mean square gradient Sdq [1]
    developed_percent: float  # area gained over a plane, Sdr [%]


def gradients(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool
) -> Gradients:
    """Compute the gradients of a surface (ISO 25178-2:2012, 4.3).

    Sdq^2 is the mean squared gradient, and Sdr the mean of sqrt(1 + squared gradient) - 1, of plane
    triangles: each cell is cut along one diagonal and along the other, and both count half.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    periodic : bool
        Whether cells beyond the last nodes, up to the first ones of the next period, count too.

    Returns
    -------
    Gradients
        Sdq and Sdr; infinite if they are beyond what numbers hold.
    """
    if periodic:
        heights = np.pad(heights, (0, 1), mode="wrap")
    squares = 0.0  # mean square of the gradients, in units of the largest slope
    areas = 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        along_x = np.abs(np.diff(heights, axis=0)) / spacing[0]
        along_y = np.abs(np.diff(heights, axis=1)) / spacing[1]
        largest = max(along_x.max(), along_y.max())
        for edges_x in (along_x[:, :-1], along_x[:, 1:]):
            for edges_y in (along_y[:-1], along_y[1:]):
                gradient = np.hypot(edges_x, edges_y)
                squares += 0.25 * float(np.mean((gradient / (largest or 1.0)) ** 2))
                # sqrt(1 + square) - 1 without the cancellation of small gradients
                gained = gradient * (gradient / (1 + np.hypot(1, gradient)))
                areas += 0.25 * float(np.mean(gained))
        return Gradients(float(largest * math.sqrt(squares)), 100.0 * areas)


@dataclass(frozen=True)
class _AutocorrelationLengths:
    """Lengths of the decay of the autocorrelation (ISO 25178-2:2012, 4.2)."""

    shortest: float  # Sal [um], NaN if the autocorrelation falls along no direction
    aspect: float  # Str [1], NaN if it does not fall along all directions
    reason: str  # why one of them is NaN, "" if none is


def _autocorrelation_lengths(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool
) -> _AutocorrelationLengths:
    """Compute Sal and Str of heights about their mean, with a spacing along x and y [um]."""
    correlation = autocorrelation(heights, periodic=periodic)
    decays = decay_lengths(correlation, spacing)
    fallen = np.isfinite(decays.lengths)
    reason = f"the autocorrelation does not fall to {DECAY:g} within half of the sides"
    if not fallen.any():
        return _AutocorrelationLengths(math.nan, math.nan, reason)
    shortest = float(decays.lengths[fallen].min())
    if fallen.all():
        longest = float(decays.lengths.max())
        return _AutocorrelationLengths(shortest, shortest / longest, "")
    bound = min(shortest / float(decays.reaches[~fallen].max()), 1.0)
    reason = f"{reason} along all directions, so Str is below {bound:.2g}"
    return _AutocorrelationLengths(shortest, math.nan, reason)


def autocorrelation(heights: Heights, *, periodic: bool) -> Values:
    """Compute the autocorrelation of heights for lags up to half of the sides.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights about their mean, not all of them zero, in any unit.
    periodic : bool
        Whether the surface is periodic; otherwise a lag has the mean over the nodes that have a
        partner at this lag.

    Returns
    -------
    ndarray, shape (nx // 2 + 1, 2 (ny // 2) + 1)
        Autocorrelation at lags from 0 along x, and from -(ny // 2) along y [1].
    """
    nx, ny = heights.shape
    largest_x = nx // 2
    largest_y = ny // 2
    sizes = (nx, ny)
    if not periodic:
        # Lengths with small factors only, beyond which no lag meets the next period.
        sizes = (_padded(nx + largest_x), _padded(ny + largest_y))
    transform = np.fft.rfft2(heights, s=sizes)
    products = np.fft.irfft2(transform.real**2 + transform.imag**2, s=sizes)
    lags_x = np.arange(largest_x + 1)
    lags_y = np.arange(-largest_y, largest_y + 1)
    pairs: float | Values = float(nx * ny)
    if not periodic:
        pairs = np.outer(nx - lags_x, ny - abs(lags_y))
    means = products[np.ix_(lags_x, lags_y)] / pairs
    return np.asarray(means / means[0, largest_y])


def _padded(nodes: int) -> int:
    """Return the next multiple of 32."""
    return 32 * math.ceil(nodes / 32)


@dataclass(frozen=True, eq=False)
class DecayLengths:
    """Decay of the autocorrelation to `DECAY` along `RAYS` directions over half a turn."""

    lengths: (
        Values  # lags at which it falls to this value, inf if not [um], shape (RAYS,)
    )
    reaches: Values  # largest lags that are known [um], shape (RAYS,)


def decay_lengths(correlation: Values, spacing: tuple[float, float]) -> DecayLengths:
    """Follow the autocorrelation along all directions until it falls to `DECAY`.

    Parameters
    ----------
    correlation : ndarray, shape (k + 1, 2 l + 1)
        Autocorrelation at lags from 0 along x, and from -l along y [1].
    spacing : tuple of float
        Distance of the nodes along x and y [um].

    Returns
    -------
    DecayLengths
        Lags at which it falls to `DECAY`.
    """
    lengths = np.full(RAYS, math.inf)
    reaches = np.empty(RAYS)
    for index in range(RAYS):
        angle = math.pi * (index / RAYS - 0.5)
        ray = _ray(correlation, spacing, angle)
        reaches[index] = ray.lags[-1]
        lengths[index] = ray.decay_length
    return DecayLengths(lengths, reaches)


@dataclass(frozen=True, eq=False)
class _Ray:
    """Autocorrelation along one direction."""

    lags: Values  # rising from 0 [um], shape (k,)
    values: Values  # autocorrelation at these lags [1], shape (k,)

    @property
    def decay_length(self) -> float:
        """Lag at which the autocorrelation first falls to `DECAY`, inf if it does not [um]."""
        below = np.flatnonzero(self.values <= DECAY)
        if not below.size:
            return math.inf
        last = below[0]
        first = last - 1
        fall = self.values[first] - self.values[last]
        share = (self.values[first] - DECAY) / fall
        return float(self.lags[first] + share * (self.lags[last] - self.lags[first]))


def _ray(correlation: Values, spacing: tuple[float, float], angle: float) -> _Ray:
    """Return the autocorrelation along a direction at an angle from the x axis [rad].

    It is interpolated at two lags in each cell that the direction crosses.
    """
    largest_x = correlation.shape[0] - 1
    largest_y = correlation.shape[1] // 2
    x = math.cos(angle) / spacing[0]  # steps along x in a lag of 1 um
    y = math.sin(angle) / spacing[1]
    reaches = []
    if x > 1e-12 / spacing[0]:
        reaches.append(largest_x / x)
    if abs(y) > 1e-12 / spacing[1]:
        reaches.append(largest_y / abs(y))
    farthest = min(reaches)
    steps = 2 * math.ceil(farthest * max(x, abs(y)))
    lags = np.linspace(0.0, farthest, steps + 1)
    return _Ray(lags, _bilinear(correlation, lags * x, lags * y + largest_y))


def _bilinear(values: Values, x: Values, y: Values) -> Values:
    """Interpolate values on a grid, shape (m, n), at places in spacings, shape (k,)."""
    nx, ny = values.shape
    i = np.clip(np.floor(x).astype(int), 0, nx - 2)
    j = np.clip(np.floor(y).astype(int), 0, ny - 2)
    u = x - i
    v = y - j
    near = (1 - v) * values[i, j] + v * values[i, j + 1]
    far = (1 - v) * values[i + 1, j] + v * values[i + 1, j + 1]
    return np.asarray((1 - u) * near + u * far)
