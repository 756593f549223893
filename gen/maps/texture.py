"""Texture of a surface: its power spectrum, its lay, and the self-affine law of its spectrum.

The law is that of `gen.spectral`: constant up to the roll-off, then |q|^(-2 - 2 H), up to the
cut-off. It is fitted as a piecewise straight line to the logarithm of the radially averaged
spectrum by least squares: all roll-offs and ends of the law are tried, and the constant and the
slope follow in closed form. A bin beyond the end costs as much as one that is off by a factor of
`OUTLYING`, so that the law ends where the spectrum leaves it for good. Towards a floor of noise
the spectrum flattens before, and the Hurst exponent is up to 0.1 too low: filter noise first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.areal import is_lost
from gen.maps.read import Topography
from gen.runtime.documents import Row
from gen.spectral import SelfAffineSpectrum
from gen.statistics import rms_slope

# ratio of the ends of a bin of wavenumbers, unless one wave along an axis is wider
BIN_RATIO = 1.05
OUTLYING = 1.3  # factor by which bins beyond the end of the law count as off it
# scatter of the logarithm that no number of waves averages out, as no surface follows a law
MISFIT = 0.1
FEWEST_BINS = 4  # in the power law
# root mean square factor between spectrum and law beyond which there is no law
LARGEST_SCATTER = 2.0
# decades that a law has to hold over: shorter pieces of any spectrum are straight
LEAST_DECADES = 1.0
# slopes along a lay over those across it, and Str, below which a surface is directional: isotropic
# made surfaces have 0.8 and 0.27 or more, with few long waves and without a roll-off
DIRECTIONAL_SLOPES = 0.5
DIRECTIONAL_STR = 0.2
LAW_UNITS = {
    "hurst": "1",
    "roll_off": "um",
    "cut_off": "um",
    "law_decades": "1",
    "law_scatter": "1",
}
"""Units of the numbers of a law by their names in tables."""

ROUGHNESS = 0.99  # share of the mean square slope of the waves that carry roughness
# nodes in the shortest wave from which on the area in the continuum is right to 1 %, from a mean
# pressure of 0.05 E* times the rms slope on (`bench resolution`)
WELL_RESOLVED = 4
ROLL_OFFS = 400  # number of roll-offs that are tried
STEEPEST = 4.0  # fall of the logarithm of the spectrum for a Hurst exponent of 1
FLATTEST = 2.0  # the same for a Hurst exponent of 0


@dataclass(frozen=True, eq=False)
class RadialSpectrum:
    """Power spectrum of a surface, averaged over directions."""

    # geometric mean of the wavenumbers of each bin [1/um], shape (bins,)
    wavenumbers: Values
    edges: Values  # smallest and largest wavenumber of each bin [1/um], shape (bins, 2)
    # mean spectral density C; the mean square height is its integral over the wavevectors, divided
    # by (2 pi)^2 [um^4], shape (bins,)
    density: Values
    waves: Values  # number of waves, opposite ones counted once, shape (bins,)
    # mean spectral density of the profiles along x and along y in the same bins; the mean square
    # height of profiles is its integral over wavenumbers of both signs, divided by 2 pi [um^3],
    # NaN in a bin without a wave along this axis, shape (bins,)
    along_x: Values
    along_y: Values

    def rows(self) -> list[Row]:
        """Return a row of a table for each bin, with the units in the names."""
        columns = {
            "wavenumber_per_um": self.wavenumbers,
            "wavelength_um": 2 * math.pi / self.wavenumbers,
            "density_um4": self.density,
            "waves": self.waves,
            "density_x_um3": self.along_x,
            "density_y_um3": self.along_y,
        }
        return [
            {name: float(values[place]) for name, values in columns.items()}
            for place in range(self.wavenumbers.size)
        ]


@dataclass(frozen=True)
class SelfAffineFit:
    """Self-affine law of a surface, in the terms of the generator `spectral`."""

    spectrum: SelfAffineSpectrum  # Hurst exponent, roll-off and cut-off
    rms_height: float  # root mean square of the heights of the surface [um]
    level: float  # spectral density of the flat part [um^4]
    # longest wavelength of the spectrum [um]; a roll-off of this length was not found
    longest: float
    scatter: float  # root mean square factor between spectrum and law [1]
    remarks: tuple[str, ...]  # what the fit could not find, one short text for each

    @property
    def values(self) -> dict[str, float]:
        """The numbers of the law by their names, in the units of `LAW_UNITS`."""
        return {
            "hurst": self.spectrum.hurst,
            "roll_off": self.spectrum.roll_off,
            "cut_off": self.spectrum.cut_off,
            "law_decades": self.decades,
            "law_scatter": self.scatter,
        }

    @property
    def decades(self) -> float:
        """Decades of wavelengths between roll-off and cut-off, on which the exponent rests."""
        return math.log10(self.spectrum.roll_off / self.spectrum.cut_off)


def radial_spectrum(topography: Topography) -> RadialSpectrum:
    """Compute the power spectrum of a surface and average it over directions.

    A patch that is not periodic is multiplied by a Hann window, because its borders would add
    waves.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.

    Returns
    -------
    RadialSpectrum
        The spectrum in bins of wavenumbers that hold a wave; without bins if there are too few
        nodes for two of them.
    """
    ends = _bin_ends(topography)
    if ends.size < 2:
        none = np.empty(0)
        return RadialSpectrum(none, np.empty((0, 2)), none, none, none, none)
    waves = _waves(topography).between(ends[0], ends[-1])
    places = np.searchsorted(ends, waves.wavenumbers, side="right") - 1
    bins = ends.size - 1
    numbers = np.bincount(places, waves.numbers, bins).astype(np.float64)
    powers = np.bincount(places, waves.numbers * waves.densities, bins)
    logarithms = np.bincount(places, waves.numbers * np.log(waves.wavenumbers), bins)
    full = numbers > 0
    edges = np.column_stack((ends[:-1], ends[1:]))[full]
    return RadialSpectrum(
        wavenumbers=np.exp(logarithms[full] / numbers[full]),
        edges=edges,
        density=powers[full] / numbers[full],
        waves=numbers[full],
        along_x=_profile_density(topography, 0, edges),
        along_y=_profile_density(topography, 1, edges),
    )


def _bin_ends(topography: Topography) -> Values:
    """Return the ends of the bins of wavenumbers, from the longest wave to the shortest [1/um]."""
    sides = np.multiply(topography.heights.shape, topography.spacing)
    step = 2 * math.pi / float(sides.min())
    first = 0.5 if topography.boundary == "periodic" else 1.5
    ends = [first * step]
    while ends[-1] < math.pi / max(topography.spacing):
        ends.append(max(ends[-1] + step, ends[-1] * BIN_RATIO))
    return np.array(ends[:-1])


@dataclass(frozen=True, eq=False)
class _Waves:
    """Waves of a surface: arrays of shape (waves,)."""

    wavenumbers: Values  # [1/um]
    densities: Values  # spectral density [um^4]
    # 0.5 for each of two opposite waves that the transform both has, 1 for all other waves
    numbers: Values

    def between(self, smallest: float, largest: float) -> _Waves:
        """Return the waves from a smallest wavenumber to below a largest one [1/um]."""
        inside = (self.wavenumbers >= smallest) & (self.wavenumbers < largest)
        return _Waves(
            self.wavenumbers[inside], self.densities[inside], self.numbers[inside]
        )


def _waves(topography: Topography) -> _Waves:
    """Transform the heights of a surface, windowed unless it is periodic, into waves."""
    heights = topography.heights
    nx, ny = heights.shape
    dx, dy = topography.spacing
    window: Values = np.ones(heights.shape)
    if topography.boundary != "periodic":
        window = np.outer(_hann(nx), _hann(ny))
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        centred = window * (heights - np.average(heights, weights=window))
        powers = np.abs(np.fft.rfft2(centred)) ** 2
        densities = powers * (dx * dy) / np.sum(window**2)
    qx = 2 * math.pi * np.fft.fftfreq(nx, dx)
    qy = 2 * math.pi * np.fft.rfftfreq(ny, dy)
    # The transform has one of two opposite waves, but both in its first and in its middle column.
    numbers = np.ones(densities.shape)
    numbers[:, 0] = 0.5
    if ny % 2 == 0:
        numbers[:, -1] = 0.5
    wavenumbers = np.hypot(qx[:, None], qy[None, :])
    return _Waves(wavenumbers.ravel(), densities.ravel(), numbers.ravel())


def _hann(nodes: int) -> Values:
    """Return the Hann window of an axis, which is zero half a node beyond the outer nodes."""
    return np.asarray(np.sin(math.pi * (np.arange(nodes) + 0.5) / nodes) ** 2)


def _profile_density(topography: Topography, axis: int, edges: Values) -> Values:
    """Compute the mean spectral density of the profiles along an axis in bins of wavenumbers.

    Each profile counts from its mean, and is windowed unless the patch is periodic.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    axis : {0, 1}
        Axis of the profiles.
    edges : ndarray, shape (bins, 2)
        Smallest and largest wavenumber of each bin [1/um].

    Returns
    -------
    ndarray, shape (bins,)
        Density of the profiles [um^3], NaN in a bin without a wave along the axis.
    """
    profiles = np.moveaxis(topography.heights, axis, -1)
    step = topography.spacing[axis]
    nodes = profiles.shape[-1]
    window = np.ones(nodes)
    if topography.boundary != "periodic":
        window = _hann(nodes)
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        centred = profiles - np.average(profiles, axis=-1, weights=window)[:, None]
        powers = np.abs(np.fft.rfft(window * centred, axis=-1)) ** 2
        density = powers.mean(axis=0) * step / np.sum(window**2)
    wavenumbers = 2 * math.pi * np.fft.rfftfreq(nodes, step)
    first, last = np.searchsorted(wavenumbers, edges).T
    sums = np.concatenate(([0.0], np.cumsum(density)))
    with np.errstate(invalid="ignore"):  # bins without a wave
        return np.asarray((sums[last] - sums[first]) / (last - first))


@dataclass(frozen=True)
class ProfileRoughness:
    """Roughness of the profiles along an axis, after ISO 21920-2, from all of them together."""

    rms_height: float  # Rq, about the mean of each profile [um]
    rms_slope: float  # Rdq, between neighbouring nodes [1]

    @property
    def wavelength(self) -> float:
        """Mean wavelength, 2 pi rms height / rms slope [um]; NaN of flat profiles."""
        if not self.rms_slope:
            return math.nan
        return 2 * math.pi * self.rms_height / self.rms_slope


def profile_roughness(
    topography: Topography,
) -> tuple[ProfileRoughness, ProfileRoughness]:
    """Measure the roughness of the profiles of a surface.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.

    Returns
    -------
    tuple of ProfileRoughness
        Roughness of the profiles along x, and of those along y.
    """
    heights = topography.heights
    dx, dy = topography.spacing
    slope_x = rms_slope(heights, (dx, math.inf))
    slope_y = rms_slope(heights, (math.inf, dy))
    return (
        ProfileRoughness(_rms_of_profiles(heights, 0), slope_x),
        ProfileRoughness(_rms_of_profiles(heights, 1), slope_y),
    )


def _rms_of_profiles(heights: Heights, axis: int) -> float:
    """Return the rms height of the profiles along an axis about their means [um]."""
    return float(np.std(heights - heights.mean(axis=axis, keepdims=True)))


def nodes_a_wave(spectrum: RadialSpectrum, spacing: tuple[float, float]) -> float:
    """Count the nodes in the shortest wave that carries roughness.

    Shorter waves carry 1 % of the mean square slope together.

    Parameters
    ----------
    spectrum : RadialSpectrum
        Spectrum of the surface.
    spacing : tuple of float
        Distance of the nodes along x and y [um].

    Returns
    -------
    float
        Number of nodes, 2 at least; NaN if the surface has no wave.
    """
    slopes = spectrum.waves * spectrum.density * spectrum.wavenumbers**2
    if not 0.0 < slopes.sum() < math.inf:
        return math.nan
    place = int(np.searchsorted(np.cumsum(slopes), ROUGHNESS * slopes.sum()))
    return float(2 * math.pi / spectrum.edges[place, 1]) / max(spacing)


def fit_self_affine(
    topography: Topography, spectrum: RadialSpectrum, aspect: float = math.nan
) -> SelfAffineFit | str:
    """Fit the self-affine law to the radial power spectrum of a surface.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    spectrum : RadialSpectrum
        Its spectrum.
    aspect : float, optional
        Its texture aspect ratio Str, NaN if it is not known [1].

    Returns
    -------
    SelfAffineFit or str
        The law, or the reason why there is none.
    """
    reason = _without_law(topography, spectrum, aspect)
    if reason:
        return reason
    largest = float(spectrum.density.max())
    logarithms = _LogSpectrum(
        wavenumbers=np.log(spectrum.wavenumbers),
        densities=np.log(np.maximum(spectrum.density, 1e-30 * largest) / largest),
        weights=1.0 / (1.0 / spectrum.waves + MISFIT**2),
    )
    law = logarithms.best_law()
    scatter = math.exp(law.scatter)
    if scatter > LARGEST_SCATTER:
        return f"the spectrum is off the nearest one by a factor of {scatter:.2g}"
    fit = _fit_of(law, topography, spectrum)
    if fit.decades < LEAST_DECADES:
        return (
            f"the spectrum follows a power law over {fit.decades:.3g} decades of"
            f" wavelengths, {fit.spectrum.roll_off:.4g} to {fit.spectrum.cut_off:.4g} um;"
            f" a Hurst exponent needs {LEAST_DECADES:g} or more"
        )
    if law.fall <= FLATTEST:
        return "the spectrum is flatter than any Hurst exponent's, as of noise"
    return fit


def _without_law(topography: Topography, spectrum: RadialSpectrum, aspect: float) -> str:
    """Return why a surface has no law, because of its spectrum or a lay; "" if it may have one."""
    heights = topography.heights
    if np.ptp(heights) == 0.0:
        return "flat surface"
    if is_lost(heights):
        return "heights lost in rounding beside their offset"
    if spectrum.wavenumbers.size <= FEWEST_BINS:
        return "too few nodes: give 16 x 16 or more"
    if not 0.0 < float(spectrum.density.max()) < math.inf:
        return "its power spectrum is beyond what numbers hold"
    return lay_of(topography, aspect)


def lay_of(topography: Topography, aspect: float = math.nan) -> str:
    """Explain why a surface is directional, by its slopes and its texture aspect ratio.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    aspect : float, optional
        Its texture aspect ratio Str, NaN if it is not known [1].

    Returns
    -------
    str
        Why it is directional, "" if it is not.
    """
    heights = topography.heights
    lowest = float(heights.min())
    highest = float(heights.max())
    if lowest == highest or is_lost(heights):
        return ""
    scaled = heights / (0.5 * highest - 0.5 * lowest)  # squares of tiny slopes would be 0
    ratio = _slope_ratio(scaled, topography.spacing)
    if ratio >= DIRECTIONAL_SLOPES and not aspect < DIRECTIONAL_STR:
        return ""
    numbers = f"slopes along its lay {ratio:.2g} of those across it"
    if not math.isnan(aspect):
        numbers = f"Str {aspect:.2g}, {numbers}"
    return f"the surface is directional ({numbers}), and its spectrum depends on the direction"


def _slope_ratio(heights: Heights, spacing: tuple[float, float]) -> float:
    """Return the least rms slope along any direction over the largest, across it [1]."""
    dx, dy = spacing
    along_x = np.diff(heights, axis=0) / dx
    along_y = np.diff(heights, axis=1) / dy
    at_cells = np.stack(
        [
            (along_x[:, 1:] + along_x[:, :-1]).ravel(),
            (along_y[1:] + along_y[:-1]).ravel(),
        ]
    )
    low, high = np.linalg.eigvalsh(np.cov(at_cells))
    return math.sqrt(max(low, 0.0) / high)


@dataclass(frozen=True)
class _LogLaw:
    """A self-affine law in logarithms: level up to the roll-off, then a straight fall."""

    roll_off: float  # logarithm of the wavenumber of the roll-off [1/um]
    level: float  # logarithm of the density of the flat part over the largest one
    fall: float  # of the logarithm of the density with that of the wavenumber, positive
    bins: int  # number of bins up to the cut-off
    scatter: float  # root mean square difference of the logarithms
    cost: float  # weighted sum of their squares, bins beyond the cut-off included


@dataclass(frozen=True, eq=False)
class _LogSpectrum:
    """A radial spectrum in logarithms: arrays of shape (bins,)."""

    wavenumbers: Values  # logarithms, rising
    densities: Values  # logarithms of the densities over the largest one
    weights: Values  # inverse variances of these logarithms

    def best_law(self) -> _LogLaw:
        """Return the law with the least cost over all roll-offs, the first of several."""
        roll_offs = np.linspace(
            self.wavenumbers[0], self.wavenumbers[-FEWEST_BINS], ROLL_OFFS
        )
        laws = (self._law_from(roll_off) for roll_off in roll_offs.tolist())
        return min(laws, key=lambda law: law.cost)

    def _law_from(self, roll_off: float) -> _LogLaw:
        """Return the law with the least cost for the logarithm of a roll-off's wavenumber.

        The sums over the bins up to each possible cut-off give the least squares in closed form.
        """
        beyond = np.maximum(self.wavenumbers - roll_off, 0.0)
        densities = self.densities
        weight = np.cumsum(self.weights)
        sum_x = np.cumsum(self.weights * beyond)
        sum_xx = np.cumsum(self.weights * beyond**2)
        sum_y = np.cumsum(self.weights * densities)
        sum_xy = np.cumsum(self.weights * (beyond * densities))
        sum_yy = np.cumsum(self.weights * densities**2)
        valid = self._cut_offs_beyond(roll_off)
        spread = np.where(valid, sum_xx - sum_x**2 / weight, 1.0)
        falls = (sum_x * sum_y / weight - sum_xy) / spread
        falls = np.clip(np.where(valid, falls, FLATTEST), FLATTEST, STEEPEST)
        levels = (sum_y + falls * sum_x) / weight
        squares = sum_yy + falls**2 * sum_xx + levels**2 * weight
        squares += 2 * (falls * sum_xy - levels * sum_y - levels * falls * sum_x)
        outlying = math.log(OUTLYING) ** 2 * (self.weights.sum() - weight)
        costs = np.where(valid, squares + outlying, math.inf)
        last = int(np.argmin(costs))
        return _LogLaw(
            roll_off=roll_off,
            level=float(levels[last]),
            fall=float(falls[last]),
            bins=last + 1,
            scatter=math.sqrt(max(squares[last] / weight[last], 0.0)),
            cost=float(costs[last]),
        )

    def _cut_offs_beyond(self, roll_off: float) -> NDArray[np.bool_]:
        """Return which bins may be the last of a law with a roll-off, shape (bins,)."""
        first = np.searchsorted(self.wavenumbers, roll_off)
        return np.arange(self.wavenumbers.size) >= first + FEWEST_BINS - 1


def _fit_of(
    law: _LogLaw, topography: Topography, spectrum: RadialSpectrum
) -> SelfAffineFit:
    """Return a law of the logarithms of a spectrum in the terms of the generator `spectral`.

    A roll-off in the first bin was not found: it is put at the longest wave of the spectrum.
    """
    first, second = np.log(spectrum.wavenumbers[:2]).tolist()
    longest = float(2 * math.pi / spectrum.wavenumbers[0])
    cut_off = float(2 * math.pi / spectrum.edges[law.bins - 1, 1])
    roll_off = 2 * math.pi / math.exp(law.roll_off)
    level = law.level
    remarks = []
    if law.roll_off <= second:
        roll_off = longest
        level += law.fall * (law.roll_off - first)
        remarks.append("no roll-off within the patch")
    if law.bins == spectrum.wavenumbers.size:
        remarks.append("no cut-off above two nodes a wavelength")
    if law.fall >= STEEPEST:
        remarks.append("steeper than any Hurst exponent: held at 1")
    return SelfAffineFit(
        spectrum=SelfAffineSpectrum(law.fall / 2 - 1, max(roll_off, cut_off), cut_off),
        rms_height=float(np.std(topography.heights)),
        level=float(spectrum.density.max()) * math.exp(level),
        longest=longest,
        scatter=math.exp(law.scatter),
        remarks=tuple(remarks),
    )
