"""Areal parameters of surface texture by ISO 25178-2, as instruments' programs report them.

SurfaceTopography has Sq and Sdq of them only, with which the tests compare; the others follow the
definitions of the standard, whose clauses (edition of 2012) the functions name.
Heights count from their mean. No plane and no form is subtracted and no filter applied beyond the
preparation that the user asks for, which decides what these parameters are parameters of.
"""

import math
from typing import NamedTuple

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.read import Topography
from gen.statistics import LOST, Description

DECAY = 0.2
"""Value s to which the autocorrelation falls at Sal, the default of ISO 25178-3."""

CORE = 0.4
"""Share of the material ratio over which the core of the curve is sought (ISO 13565-2)."""

RAYS = 360
"""Directions over half a turn in which the autocorrelation is followed."""


class Parameter(NamedTuple):
    """Name, unit and meaning of an areal parameter."""

    name: str
    unit: str
    meaning: str


PARAMETERS = (
    Parameter("Sa", "um", "arithmetical mean height: mean distance from the mean"),
    Parameter("Sq", "um", "root mean square height"),
    Parameter("Sz", "um", "maximum height: Sp + Sv"),
    Parameter("Sp", "um", "maximum peak height above the mean"),
    Parameter("Sv", "um", "maximum pit height below the mean"),
    Parameter("Ssk", "1", "skewness of the heights: negative if pits prevail"),
    Parameter("Sku", "1", "kurtosis of the heights: 3 if they are normal"),
    Parameter("Sdq", "1", "root mean square gradient"),
    Parameter("Sdr", "%", "developed interfacial area ratio: area gained over a plane"),
    Parameter("Sal", "um", "autocorrelation length: fastest decay to 0.2"),
    Parameter("Str", "1", "texture aspect ratio: 1 isotropic, 0 one direction"),
    Parameter("Sk", "um", "core height, of the flattest 40 % of the material ratio curve"),
    Parameter("Spk", "um", "reduced peak height, above the core"),
    Parameter("Svk", "um", "reduced dale depth, below the core"),
    Parameter("Smr1", "%", "material ratio of the peaks"),
    Parameter("Smr2", "%", "material ratio above the dales"),
    Parameter("Smr", "%", "material ratio at the depth asked for, below the highest node"),
)
"""The parameters in the order in which they are printed and written."""


def areal_parameters(topography: Topography, depth: float | None = None) -> Description:
    """Compute the areal parameters of a surface by ISO 25178-2.

    Smr is left out without a depth below the highest node [um]. What a surface does not have is
    NaN: of a flat one all but the heights, and Sal and Str where the autocorrelation does not fall
    to `DECAY` within half of the sides; the reason says so.
    """
    heights, periodic = topography.heights, topography.boundary == "periodic"
    lowest, highest = float(heights.min()), float(heights.max())
    unit = 2.0 ** min(max(math.frexp(highest - lowest)[1], -1000), 1000)
    scaled = (heights - (lowest + 0.5 * (highest - lowest))) / unit
    scaled -= scaled.mean()
    values = {name: value * unit for name, value in _amplitudes(scaled).items()}
    shape = {name: math.nan for name, *_ in PARAMETERS[len(values) :]}
    if depth is None:
        del shape["Smr"]
    if lowest == highest:
        return Description(values | shape | {"Sdq": 0.0, "Sdr": 0.0}, "flat surface")
    if is_lost(heights):
        return Description(values | shape, "heights lost in rounding beside their offset")
    squares = scaled**2
    square = squares.mean()
    shape["Ssk"] = float(np.mean(squares * scaled) / square**1.5)
    shape["Sku"] = float(np.mean(squares**2) / square**2)
    shape["Sdq"], shape["Sdr"] = gradients(scaled * unit, topography.spacing, periodic=periodic)
    shape["Sal"], shape["Str"], reason = _lengths(scaled, topography.spacing, periodic=periodic)
    shape.update(_of_curve(scaled, unit, depth))
    return Description(values | shape, reason)


def is_lost(heights: Heights) -> bool:
    """Tell whether the offset of heights has left too few of their digits to have a shape."""
    largest = max(abs(float(heights.min())), abs(float(heights.max())))
    return float(np.std(heights / largest)) <= LOST * float(np.finfo(heights.dtype).eps)


def _amplitudes(heights: Heights) -> dict[str, float]:
    """Compute Sa, Sq, Sz, Sp and Sv of heights about their mean (ISO 25178-2:2012, 4.1)."""
    peak, pit = float(heights.max()), 0.0 - float(heights.min())
    rms = math.sqrt(np.mean(heights**2))
    return {"Sa": float(np.abs(heights).mean()), "Sq": rms, "Sz": peak + pit, "Sp": peak, "Sv": pit}


def _of_curve(heights: Heights, unit: float, depth: float | None) -> dict[str, float]:
    """Compute the parameters of the material ratio curve (ISO 25178-2:2012, 4.4; ISO 13565-2).

    The equivalent line is the least-squares line through the part of the curve over `CORE` of the
    material ratio that falls least, the first of several. Sk is its fall from 0 to 100 %; Spk and
    Svk are the heights of triangles over Smr1 and beyond Smr2 with the areas of the curve there.
    """
    falling = np.sort(heights, axis=None)[::-1]
    ratios = np.linspace(0.0, 100.0, falling.size)
    width = max(1, round(CORE * (falling.size - 1)))
    first = int(np.argmin(falling[:-width] - falling[width:]))
    start, at = float(falling[first]), ratios[first : first + width + 1]
    core = falling[first : first + width + 1] - start  # of a plateau exactly 0
    slope = float((at - at.mean()) @ core / np.sum((at - at.mean()) ** 2))
    top = start + (float(core.mean()) - slope * float(at.mean()))
    peaks, above = _reduced(falling, ratios, top)
    dales, below = _reduced(-falling[::-1], ratios, -(top + 100.0 * slope))
    found = {"Sk": -100.0 * slope * unit, "Spk": peaks * unit, "Svk": dales * unit}
    found |= {"Smr1": above, "Smr2": 100.0 - below}
    if depth is not None:
        found["Smr"] = float(np.interp(falling[0] - depth / unit, falling[::-1], ratios[::-1]))
    return found


def _reduced(falling: Values, ratios: Values, level: float) -> tuple[float, float]:
    """Return the reduced height of what a curve has above a level, and its material ratio [%]."""
    ratio = float(np.interp(level, falling[::-1], ratios[::-1]))
    nodes = int(np.count_nonzero(falling > level))
    above, at = np.append(falling[:nodes] - level, 0.0), np.append(ratios[:nodes], ratio)
    area = float(np.trapezoid(above, at))
    return (2.0 * area / ratio if ratio else 0.0), ratio


def gradients(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool
) -> tuple[float, float]:
    """Return Sdq [1] and Sdr [%], gradient and developed area (ISO 25178-2:2012, 4.3).

    Sdq^2 is the mean over the patch of the squared gradient, (dz/dx)^2 + (dz/dy)^2, and Sdr the
    mean of sqrt(1 + squared gradient) - 1. The surface is made of plane triangles: a cell is
    cut along one diagonal and along the other, and both count half.
    """
    closed = np.pad(heights, (0, 1), mode="wrap") if periodic else heights
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        along_x = np.abs(np.diff(closed, axis=0)) / spacing[0]
        along_y = np.abs(np.diff(closed, axis=1)) / spacing[1]
        largest = max(along_x.max(), along_y.max())
        squares, areas = 0.0, 0.0
        for edge_x in (along_x[:, :-1], along_x[:, 1:]):
            for edge_y in (along_y[:-1], along_y[1:]):
                gradient = np.hypot(edge_x, edge_y)
                squares += 0.25 * float(np.mean((gradient / (largest or 1.0)) ** 2))
                # sqrt(1 + square) - 1 without the cancellation of small gradients.
                areas += 0.25 * float(np.mean(gradient * (gradient / (1 + np.hypot(1, gradient)))))
        return float(largest * math.sqrt(squares)), 100.0 * areas


def _lengths(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool
) -> tuple[float, float, str]:
    """Compute Sal [um] and Str (ISO 25178-2:2012, 4.2), and the reason why one is NaN.

    Sal is the shortest distance from the origin at which the autocorrelation has fallen to
    `DECAY`, and Str the ratio of it to the longest distance of a point that a straight line of
    values above `DECAY` connects with the origin.
    """
    decays, reaches = decay_lengths(autocorrelation(heights, periodic=periodic), spacing)
    fallen = np.isfinite(decays)
    if not fallen.any():
        reason = f"the autocorrelation does not fall to {DECAY:g} within half of the sides"
        return math.nan, math.nan, reason
    shortest = float(decays[fallen].min())
    if fallen.all():
        return shortest, shortest / float(decays.max()), ""
    bound = min(shortest / float(reaches[~fallen].max()), 1.0)
    reason = (
        f"the autocorrelation does not fall to {DECAY:g} along all directions within half of the"
        f" sides, so Str is below {bound:.2g}"
    )
    return shortest, math.nan, reason


def autocorrelation(heights: Heights, *, periodic: bool) -> Values:
    """Compute the autocorrelation of heights for lags up to half of the sides."""
    nx, ny = heights.shape
    kx, ky = nx // 2, ny // 2
    # Lengths with small factors only, beyond which no wanted lag meets the next period.
    sizes = (nx, ny) if periodic else (32 * -(-(nx + kx) // 32), 32 * -(-(ny + ky) // 32))
    transform = np.fft.rfft2(heights, s=sizes)
    products = np.fft.irfft2(transform.real**2 + transform.imag**2, s=sizes)
    x, y = np.arange(kx + 1), np.arange(-ky, ky + 1)
    overlap = float(nx * ny) if periodic else np.outer(nx - x, ny - abs(y))
    means = products[np.ix_(x, y)] / overlap
    return np.asarray(means / means[0, ky])


def decay_lengths(correlation: Values, spacing: tuple[float, float]) -> tuple[Values, Values]:
    """Follow the autocorrelation from the origin in all directions until it has decayed.

    Return for each of `RAYS` directions the distance at which it first falls to `DECAY`, infinite
    if it does not, and the distance to the largest lag [um].
    """
    kx, ky = correlation.shape[0] - 1, correlation.shape[1] // 2
    decays, reaches = np.full(RAYS, math.inf), np.empty(RAYS)
    for index in range(RAYS):
        angle = math.pi * (index / RAYS - 0.5)
        x, y = math.cos(angle) / spacing[0], math.sin(angle) / spacing[1]
        farthest = min(
            kx / x if x > 1e-12 / spacing[0] else math.inf,
            ky / abs(y) if abs(y) > 1e-12 / spacing[1] else math.inf,
        )
        steps = 2 * math.ceil(farthest * max(x, abs(y)))  # half a cell each
        distances = np.linspace(0.0, farthest, steps + 1)
        values = _interpolated(correlation, distances * x, distances * y + ky)
        reaches[index] = farthest
        below = np.flatnonzero(values <= DECAY)
        if below.size:
            last = below[0]
            share = (values[last - 1] - DECAY) / (values[last - 1] - values[last])
            decays[index] = distances[last - 1] + share * (distances[last] - distances[last - 1])
    return decays, reaches


def _interpolated(field: Values, x: Values, y: Values) -> Values:
    """Interpolate a field bilinearly at places (count,), in nodes of its two axes."""
    left = np.clip(np.floor(x).astype(int), 0, field.shape[0] - 2)
    lower = np.clip(np.floor(y).astype(int), 0, field.shape[1] - 2)
    u, v = x - left, y - lower
    near = (1 - v) * field[left, lower] + v * field[left, lower + 1]
    far = (1 - v) * field[left + 1, lower] + v * field[left + 1, lower + 1]
    return np.asarray((1 - u) * near + u * far)
