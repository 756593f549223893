"""Texture of a surface: its power spectrum, its lay, and the self-affine law of its spectrum.

The law is that of `gen.spectral`: the spectral density is constant up to the roll-off and falls as
|q|^(-2 - 2 H) from there to the cut-off. It is fitted by least squares to the logarithm of the
radially averaged spectrum, where it is a level and a straight fall. `ROLL_OFFS` roll-offs and all
cut-offs at the end of a bin are tried; level and fall follow in closed form for each pair. A bin
beyond the cut-off costs as much as a bin whose density is off the law by a factor of `OUTLYING`, so
that the law ends where the spectrum leaves it for good. Above a floor of noise the spectrum
flattens gradually, which makes the Hurst exponent up to 0.1 too low: filter noise first.
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
from gen.self_affine import SelfAffineSpectrum
from gen.statistics import rms_slope

# ratio of the largest to the smallest wavenumber of a bin; bins of long waves are wider, since a
# bin is at least as wide as the step between the wavenumbers of the shorter side
BIN_RATIO = 1.05
# factor between spectrum and law that is assumed in each bin beyond the cut-off
OUTLYING = 1.3
# scatter of the logarithm of the density that stays with any number of waves, because no surface
# follows a law exactly
MISFIT = 0.1
FEWEST_BINS = 4  # fewest bins between roll-off and cut-off
# root mean square factor between spectrum and law above which no law is returned
LARGEST_SCATTER = 2.0
# fewest decades between roll-off and cut-off: shorter pieces of any spectrum are straight
LEAST_DECADES = 1.0
# A surface is directional if its rms slope along a lay is less than this share of the rms slope
# across the lay, or if Str is less than the second number. Generated isotropic surfaces have at
# least 0.8 and 0.27, even with few long waves and without a roll-off.
DIRECTIONAL_SLOPES = 0.5
DIRECTIONAL_STR = 0.2
LAW_UNITS = {
    "hurst": "1",
    "roll_off": "um",
    "cut_off": "um",
    "law_decades": "1",
    "law_scatter": "1",
}
"""Units of the numbers in `SelfAffineFit.values`, by name; "1" for pure numbers."""

# share of the mean square slope that the waves called roughness have together, the longest first
ROUGHNESS = 0.99
# nodes in the shortest wave that give the area in the continuum within 1 %, at mean pressures of at
# least 0.05 E* times the rms slope (`bench resolution`)
WELL_RESOLVED = 4
ROLL_OFFS = 400  # number of roll-offs that are tried
# exponent 2 + 2 H of the fall of the spectral density for Hurst exponents of 1 and of 0
STEEPEST = 4.0
FLATTEST = 2.0


@dataclass(frozen=True, eq=False)
class RadialWaves:
    """The waves of a surface in bins of wavenumbers, averaged over their directions."""

    # geometric mean of the wavenumbers of each bin [1/um], shape (bins,)
    wavenumbers: Values
    edges: Values  # smallest and largest wavenumber of each bin [1/um], shape (bins, 2)
    # mean spectral density C of each bin [um^4], shape (bins,); the mean square height is the
    # integral of C over the wavevectors, divided by (2 pi)^2
    density: Values
    # number of waves in each bin, where two opposite wavevectors are one wave, shape (bins,)
    waves: Values


@dataclass(frozen=True, eq=False)
class RadialSpectrum(RadialWaves):
    """Power spectrum of a surface, averaged over directions, with those of its profiles."""

    # mean spectral density of the profiles along x, and along y, in each bin [um^3], shape (bins,);
    # NaN in a bin without a wave along this axis. The mean square height of the profiles is the
    # integral of the density over wavenumbers of both signs, divided by 2 pi.
    along_x: Values
    along_y: Values

    def rows(self) -> list[Row]:
        """Return the table of the spectrum: a row for each bin, from column name to number.

        Column names end with their units.
        """
        columns = {
            "wavenumber_per_um": self.wavenumbers,
            "wavelength_um": 2 * math.pi / self.wavenumbers,
            "density_um4": self.density,
            "waves": self.waves,
            "density_x_um3": self.along_x,
            "density_y_um3": self.along_y,
        }
        return [
            {name: float(column[place]) for name, column in columns.items()}
            for place in range(self.wavenumbers.size)
        ]


@dataclass(frozen=True)
class SelfAffineFit:
    """Self-affine law that was fitted to the spectrum of a surface."""

    # Hurst exponent, roll-off and cut-off, as the generator `spectral` takes them
    spectrum: SelfAffineSpectrum
    rms_height: float  # rms height of the surface about its mean [um]
    level: float  # spectral density C of the flat part, up to the roll-off [um^4]
    # longest wavelength of the spectrum [um]; equal to `spectrum.roll_off` if no roll-off was found
    longest: float
    scatter: float  # root mean square factor between spectrum and law, 1 or more [1]
    # one short text for each number that the spectrum does not determine, such as a roll-off
    remarks: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        """The numbers of the law by the names of `LAW_UNITS`, in these units."""
        return {
            "hurst": self.spectrum.hurst,
            "roll_off": self.spectrum.roll_off,
            "cut_off": self.spectrum.cut_off,
            "law_decades": self.decades,
            "law_scatter": self.scatter,
        }

    @property
    def decades(self) -> float:
        """Decades of wavelengths between roll-off and cut-off, where the spectrum falls [1]."""
        return math.log10(self.spectrum.roll_off / self.spectrum.cut_off)


def radial_spectrum(topography: Topography, ends: Values | None = None) -> RadialSpectrum:
    """Compute the power spectrum of a surface and average it over directions.

    If the patch is not periodic, its heights are multiplied by a Hann window, because steps between
    opposite borders would add waves.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    ends : ndarray, shape (bins + 1,), optional
        Rising wavenumbers at which bins end [1/um]; by default they suit the map.

    Returns
    -------
    RadialSpectrum
        The spectrum. Bins without a wave are left out; there is no bin (arrays of length 0) if the
        map has too few nodes for one.
    """
    waves = radial_waves(topography, ends)
    return RadialSpectrum(
        wavenumbers=waves.wavenumbers,
        edges=waves.edges,
        density=waves.density,
        waves=waves.waves,
        along_x=_profile_density(topography, axis=0, edges=waves.edges),
        along_y=_profile_density(topography, axis=1, edges=waves.edges),
    )


def radial_waves(topography: Topography, ends: Values | None = None) -> RadialWaves:
    """Compute the power spectrum of a surface without those of its profiles.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    ends : ndarray, shape (bins + 1,), optional
        Rising wavenumbers at which bins end [1/um]; by default they suit the map.

    Returns
    -------
    RadialWaves
        The waves, as in `radial_spectrum`.
    """
    if ends is None:
        ends = _bin_ends(topography)
    if ends.size < 2:
        empty = np.empty(0)
        return RadialWaves(
            wavenumbers=empty, edges=np.empty((0, 2)), density=empty, waves=empty
        )
    waves = _waves(topography).between(ends[0], ends[-1])
    places = np.searchsorted(ends, waves.wavenumbers, side="right") - 1
    bins = ends.size - 1
    numbers = np.bincount(places, waves.numbers, bins).astype(np.float64)
    summed_densities = np.bincount(places, waves.numbers * waves.densities, bins)
    logarithms = np.log(waves.wavenumbers)
    summed_logarithms = np.bincount(places, waves.numbers * logarithms, bins)
    occupied = numbers > 0
    edges = np.column_stack((ends[:-1], ends[1:]))[occupied]
    waves_of_bins = numbers[occupied]
    return RadialWaves(
        wavenumbers=np.exp(summed_logarithms[occupied] / waves_of_bins),
        edges=edges,
        density=summed_densities[occupied] / waves_of_bins,
        waves=waves_of_bins,
    )


def _bin_ends(topography: Topography) -> Values:
    """Return the rising wavenumbers at which bins end [1/um], shape (bins + 1,).

    The last one is below the largest wavenumber that both axes have, pi over the larger spacing.
    """
    sides = np.multiply(topography.heights.shape, topography.spacing)
    step = 2 * math.pi / float(sides.min())
    # A Hann window mixes the first wave of each axis with the mean, so bins begin beyond this wave.
    # The first end, in steps:
    first = 0.5 if topography.boundary == "periodic" else 1.5
    largest = math.pi / max(topography.spacing)
    ends = [first * step]
    while ends[-1] < largest:
        wide_enough = ends[-1] + step
        ends.append(max(wide_enough, ends[-1] * BIN_RATIO))
    return np.array(ends[:-1])


@dataclass(frozen=True, eq=False)
class _Waves:
    """Entries of the Fourier transform of a surface: arrays of shape (entries,)."""

    wavenumbers: Values  # length of the wavevector [1/um]
    densities: Values  # spectral density [um^4]
    # number of waves that an entry counts for: 0.5 if the transform also has the entry of the
    # opposite wavevector, otherwise 1
    numbers: Values

    def between(self, smallest: float, largest: float) -> _Waves:
        """Return the entries with smallest <= wavenumber < largest [1/um]."""
        inside = (self.wavenumbers >= smallest) & (self.wavenumbers < largest)
        return _Waves(
            wavenumbers=self.wavenumbers[inside],
            densities=self.densities[inside],
            numbers=self.numbers[inside],
        )


def _waves(topography: Topography) -> _Waves:
    """Return the Fourier transform of the heights about their mean.

    If the patch is not periodic, mean and heights are weighted by a Hann window. Densities are
    infinite or NaN for heights whose squares overflow.
    """
    heights = topography.heights
    nx, ny = heights.shape
    dx, dy = topography.spacing
    window: Values = np.ones(heights.shape)
    if topography.boundary != "periodic":
        window = np.outer(_hann(nx), _hann(ny))
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        mean = np.average(heights, weights=window)
        windowed = window * (heights - mean)
        powers = np.abs(np.fft.rfft2(windowed)) ** 2
        densities = powers * (dx * dy) / np.sum(window**2)
    qx = 2 * math.pi * np.fft.fftfreq(nx, dx)
    qy = 2 * math.pi * np.fft.rfftfreq(ny, dy)
    wavenumbers = np.hypot(qx[:, None], qy[None, :])
    # rfft2 leaves out wavevectors with negative qy. So only the column qy = 0 and, for an even ny,
    # that of the largest qy hold both of two opposite wavevectors.
    numbers = np.ones(densities.shape)
    numbers[:, 0] = 0.5
    if ny % 2 == 0:
        numbers[:, -1] = 0.5
    return _Waves(
        wavenumbers=wavenumbers.ravel(),
        densities=densities.ravel(),
        numbers=numbers.ravel(),
    )


def _hann(nodes: int) -> Values:
    """Return the Hann window at the nodes of an axis, shape (nodes,).

    It is zero half a spacing beyond the outer nodes.
    """
    places = np.arange(nodes) + 0.5
    return np.asarray(np.sin(math.pi * places / nodes) ** 2)


def _profile_density(topography: Topography, axis: int, edges: Values) -> Values:
    """Compute the mean spectral density of the profiles along an axis in bins of wavenumbers.

    The mean of each profile is subtracted. If the patch is not periodic, mean and profile are
    weighted by a Hann window.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    axis : {0, 1}
        Axis along which the profiles run.
    edges : ndarray, shape (bins, 2)
        Smallest and largest wavenumber of each bin [1/um].

    Returns
    -------
    ndarray, shape (bins,)
        Density, averaged over all profiles and over the waves of each bin [um^3]; NaN in a bin
        without a wave along the axis.
    """
    profiles = np.moveaxis(topography.heights, axis, -1)
    step = topography.spacing[axis]
    nodes = profiles.shape[-1]
    window = np.ones(nodes)
    if topography.boundary != "periodic":
        window = _hann(nodes)
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        means = np.average(profiles, axis=-1, weights=window)
        windowed = window * (profiles - means[:, None])
        powers = np.abs(np.fft.rfft(windowed, axis=-1)) ** 2
        density = powers.mean(axis=0) * step / np.sum(window**2)
    wavenumbers = 2 * math.pi * np.fft.rfftfreq(nodes, step)
    first, end = np.searchsorted(wavenumbers, edges).T
    cumulative = np.concatenate(([0.0], np.cumsum(density)))
    summed = cumulative[end] - cumulative[first]
    with np.errstate(invalid="ignore"):  # 0 / 0 in bins without a wave
        return np.asarray(summed / (end - first))


@dataclass(frozen=True)
class ProfileRoughness:
    """Roughness by ISO 21920-2 of all profiles along one axis, taken together."""

    rms_height: float  # Rq, where each profile counts from its own mean [um]
    rms_slope: float  # Rdq, between neighbouring nodes [1]

    @property
    def wavelength(self) -> float:
        """Mean wavelength, 2 pi rms height / rms slope [um]; NaN if all profiles are flat."""
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
        Roughness of the profiles along x, then of the profiles along y.
    """
    heights = topography.heights
    dx, dy = topography.spacing
    # An infinite spacing along the other axis leaves out the slopes along that axis.
    along_x = ProfileRoughness(
        rms_height=_rms_of_profiles(heights, axis=0),
        rms_slope=rms_slope(heights, (dx, math.inf)),
    )
    along_y = ProfileRoughness(
        rms_height=_rms_of_profiles(heights, axis=1),
        rms_slope=rms_slope(heights, (math.inf, dy)),
    )
    return along_x, along_y


def _rms_of_profiles(heights: Heights, axis: int) -> float:
    """Return the rms height [um] of all profiles along an axis, each about its own mean."""
    means = heights.mean(axis=axis, keepdims=True)
    return float(np.std(heights - means))


def nodes_a_wave(spectrum: RadialWaves, spacing: tuple[float, float]) -> float:
    """Compute the number of nodes in the shortest wave that carries roughness.

    The waves that are shorter have 1 % of the mean square slope together (1 - `ROUGHNESS`).

    Parameters
    ----------
    spectrum : RadialWaves
        Spectrum of the surface.
    spacing : tuple of float
        Distance of the nodes along x and y [um].

    Returns
    -------
    float
        Length of that wave over the larger spacing, 2 or more [1]; NaN if the surface has no wave,
        or its slopes are beyond what numbers hold.
    """
    # contribution of each bin to the mean square slope, but for a factor that all bins share
    slopes = spectrum.waves * spectrum.density * spectrum.wavenumbers**2
    total = slopes.sum()
    if not 0.0 < total < math.inf:
        return math.nan
    place = int(np.searchsorted(np.cumsum(slopes), ROUGHNESS * total))
    shortest = float(2 * math.pi / spectrum.edges[place, 1])
    return shortest / max(spacing)


def fit_self_affine(
    topography: Topography, spectrum: RadialSpectrum, aspect: float = math.nan
) -> SelfAffineFit | str:
    """Fit the self-affine law to the radial power spectrum of a surface.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    spectrum : RadialSpectrum
        Spectrum of this surface, from `radial_spectrum`.
    aspect : float, optional
        Texture aspect ratio Str of this surface, NaN if it is not known [1].

    Returns
    -------
    SelfAffineFit or str
        The law. If the surface has no law, the reason in words, which end the sentence "no
        self-affine law: ...".
    """
    reason = _reason_without_fit(topography, spectrum, aspect)
    if reason:
        return reason
    return fit_spectrum(spectrum, float(np.std(topography.heights)))


def fit_spectrum(spectrum: RadialSpectrum, rms_height: float) -> SelfAffineFit | str:
    """Fit the self-affine law to a radial power spectrum alone.

    Parameters
    ----------
    spectrum : RadialSpectrum
        The spectrum of a surface without a lay, with a density above 0.
    rms_height : float
        The rms height of the surface about its mean [um].

    Returns
    -------
    SelfAffineFit or str
        The law, or the reason why there is none, as of `fit_self_affine`.
    """
    if spectrum.wavenumbers.size <= FEWEST_BINS:
        return f"its spectrum has {spectrum.wavenumbers.size} bins, too few for a law"
    law = _log_spectrum(spectrum).best_law()
    scatter = math.exp(law.scatter)
    if scatter > LARGEST_SCATTER:
        return f"the spectrum is off the nearest one by a factor of {scatter:.2g}"
    fit = _fit_of(law, rms_height, spectrum)
    if fit.decades < LEAST_DECADES:
        return (
            f"the spectrum follows a power law over {fit.decades:.3g} decades of"
            f" wavelengths, {fit.spectrum.roll_off:.4g} to {fit.spectrum.cut_off:.4g} um;"
            f" a Hurst exponent needs {LEAST_DECADES:g} or more"
        )
    if law.fall <= FLATTEST:
        return "the spectrum is flatter than any Hurst exponent's, as of noise"
    return fit


def _log_spectrum(spectrum: RadialSpectrum) -> _LogSpectrum:
    """Return the logarithms of a spectrum whose largest density is finite and positive."""
    largest = float(spectrum.density.max())
    # A density of 0 has no logarithm.
    positive = np.maximum(spectrum.density, 1e-30 * largest)
    # The logarithm of a mean over n waves has the variance 1 / n.
    variances = 1.0 / spectrum.waves + MISFIT**2
    return _LogSpectrum(
        wavenumbers=np.log(spectrum.wavenumbers),
        densities=np.log(positive / largest),
        weights=1.0 / variances,
    )


def _reason_without_fit(
    topography: Topography, spectrum: RadialSpectrum, aspect: float
) -> str:
    """Return why no law is fitted, "" if one can be.

    Reasons are flat heights, heights that are lost in rounding, a spectrum of too few bins or with
    infinite densities, and a lay (`lay_of`). `aspect` is the texture aspect ratio Str of the
    surface [1], NaN if it is not known.
    """
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
    """Say that a surface is directional and by which numbers.

    A surface is directional if the ratio of its slopes along and across a lay is below
    `DIRECTIONAL_SLOPES`, or its texture aspect ratio below `DIRECTIONAL_STR`.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.
    aspect : float, optional
        Texture aspect ratio Str of the surface, NaN if it is not known [1].

    Returns
    -------
    str
        A sentence with the numbers; "" if the surface is not directional, is flat, or has lost its
        heights in rounding.
    """
    heights = topography.heights
    lowest = float(heights.min())
    highest = float(heights.max())
    if lowest == highest or is_lost(heights):
        return ""
    half_span = 0.5 * highest - 0.5 * lowest
    scaled = heights / half_span  # squares of tiny slopes would be 0
    ratio = _slope_ratio(scaled, topography.spacing)
    slopes_are_alike = ratio >= DIRECTIONAL_SLOPES
    lengths_differ = aspect < DIRECTIONAL_STR  # false for NaN
    if slopes_are_alike and not lengths_differ:
        return ""
    numbers = f"slopes along its lay {ratio:.2g} of those across it"
    if not math.isnan(aspect):
        numbers = f"Str {aspect:.2g}, {numbers}"
    return f"the surface is directional ({numbers}), and its spectrum depends on the direction"


def _slope_ratio(heights: Heights, spacing: tuple[float, float]) -> float:
    """Return the rms slope along the direction where it is least, over that across it [1].

    The slope across it is the largest. Heights are of shape (nx, ny), in any unit, and not flat.
    """
    dx, dy = spacing
    along_x = np.diff(heights, axis=0) / dx
    along_y = np.diff(heights, axis=1) / dy
    # twice the mean slopes of the cells: the factor leaves the ratio as it is
    cells_along_x = along_x[:, 1:] + along_x[:, :-1]
    cells_along_y = along_y[1:] + along_y[:-1]
    slopes = np.stack([cells_along_x.ravel(), cells_along_y.ravel()])
    least_square, largest_square = np.linalg.eigvalsh(np.cov(slopes))
    return math.sqrt(max(least_square, 0.0) / largest_square)


@dataclass(frozen=True)
class _LogLaw:
    """A self-affine law in natural logarithms: a level up to the roll-off, then a straight fall."""

    roll_off: float  # logarithm of the wavenumber of the roll-off
    level: float  # logarithm of the density up to the roll-off over the largest density
    # decrease of the logarithm of the density per logarithm of the wavenumber, positive
    fall: float
    bins: int  # number of bins up to the cut-off
    scatter: float  # weighted rms difference of the logarithms of spectrum and law in these bins
    # weighted sum of the squared differences, with `OUTLYING` in the bins beyond the cut-off
    cost: float


@dataclass(frozen=True, eq=False)
class _LogSpectrum:
    """A radial spectrum in natural logarithms: arrays of shape (bins,)."""

    wavenumbers: Values  # logarithms of the wavenumbers, rising
    densities: Values  # logarithms of the densities over the largest density
    weights: Values  # inverse variances of the logarithms of the densities

    def best_law(self) -> _LogLaw:
        """Return the law with the least cost of all roll-offs and cut-offs that are tried.

        Of laws with equal costs, it is the one whose roll-off has the longest wavelength.
        """
        last = self.wavenumbers[-FEWEST_BINS]
        roll_offs = np.linspace(self.wavenumbers[0], last, ROLL_OFFS)
        laws = (self._law_from(roll_off) for roll_off in roll_offs.tolist())
        return min(laws, key=lambda law: law.cost)

    def _law_from(self, roll_off: float) -> _LogLaw:
        """Return the law with the least cost among all cut-offs, for a roll-off.

        `roll_off` is the logarithm of a wavenumber. The law is y = level - fall x, where x is the
        logarithm of the wavenumber beyond the roll-off (0 before it) and y that of the density.
        Cumulative sums over the bins give level and fall by least squares for each cut-off.
        """
        x = np.maximum(self.wavenumbers - roll_off, 0.0)
        y = self.densities
        sum_weights = np.cumsum(self.weights)
        sum_x = np.cumsum(self.weights * x)
        sum_xx = np.cumsum(self.weights * x**2)
        sum_y = np.cumsum(self.weights * y)
        sum_xy = np.cumsum(self.weights * (x * y))
        sum_yy = np.cumsum(self.weights * y**2)
        valid = self._cut_offs_beyond(roll_off)
        spread = np.where(valid, sum_xx - sum_x**2 / sum_weights, 1.0)
        falls = (sum_x * sum_y / sum_weights - sum_xy) / spread
        falls = np.where(valid, falls, FLATTEST)
        falls = np.clip(falls, FLATTEST, STEEPEST)
        levels = (sum_y + falls * sum_x) / sum_weights
        # sums of (y - level + fall x)^2
        squares = sum_yy + falls**2 * sum_xx + levels**2 * sum_weights
        squares += 2 * (falls * sum_xy - levels * sum_y - levels * falls * sum_x)
        weight_beyond = self.weights.sum() - sum_weights
        outlying = math.log(OUTLYING) ** 2 * weight_beyond
        costs = np.where(valid, squares + outlying, math.inf)
        best = int(np.argmin(costs))
        mean_square = max(squares[best] / sum_weights[best], 0.0)
        return _LogLaw(
            roll_off=roll_off,
            level=float(levels[best]),
            fall=float(falls[best]),
            bins=best + 1,
            scatter=math.sqrt(mean_square),
            cost=float(costs[best]),
        )

    def _cut_offs_beyond(self, roll_off: float) -> NDArray[np.bool_]:
        """Return whether each bin may be the last one of a law, shape (bins,).

        A law needs `FEWEST_BINS` bins between its roll-off (logarithm of a wavenumber) and its
        cut-off, the last bin included.
        """
        first_beyond = np.searchsorted(self.wavenumbers, roll_off)
        earliest = first_beyond + FEWEST_BINS - 1
        return np.arange(self.wavenumbers.size) >= earliest


def _fit_of(law: _LogLaw, rms_height: float, spectrum: RadialSpectrum) -> SelfAffineFit:
    """Convert a law in logarithms into lengths [um] and densities [um^4], with remarks."""
    first, second = np.log(spectrum.wavenumbers[:2]).tolist()
    longest = float(2 * math.pi / spectrum.wavenumbers[0])
    cut_off = float(2 * math.pi / spectrum.edges[law.bins - 1, 1])
    roll_off = 2 * math.pi / math.exp(law.roll_off)
    log_level = law.level
    remarks = []
    if law.roll_off <= second:
        # A single flat bin shows no roll-off. The law begins at the longest wave, and its level is
        # raised to where its fall meets this wave.
        roll_off = longest
        log_level += law.fall * (law.roll_off - first)
        remarks.append("no roll-off within the patch")
    if law.bins == spectrum.wavenumbers.size:
        remarks.append("no cut-off above two nodes a wavelength")
    if law.fall >= STEEPEST:
        remarks.append("steeper than any Hurst exponent: held at 1")
    law_spectrum = SelfAffineSpectrum(
        hurst=law.fall / 2 - 1,
        roll_off=max(roll_off, cut_off),
        cut_off=cut_off,
    )
    return SelfAffineFit(
        spectrum=law_spectrum,
        rms_height=rms_height,
        level=float(spectrum.density.max()) * math.exp(log_level),
        longest=longest,
        scatter=math.exp(law.scatter),
        remarks=tuple(remarks),
    )
