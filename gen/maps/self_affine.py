"""Radial power spectrum of a surface, and the self-affine law that fits it.

The law is that of `gen.spectral`: constant up to the roll-off, then |q|^(-2 - 2 H), up to the
cut-off. It is fitted as a piecewise straight line to the logarithm of the radially averaged
spectrum by least squares: all roll-offs and ends of the law are tried, and the constant and the
slope follow in closed form. A bin beyond the end costs as much as one that is off by a factor of
`OUTLYING`, so that the law ends where the spectrum leaves it for good: at a cut-off or in a floor
of noise. Towards a floor the spectrum flattens before it leaves the law, and the Hurst exponent is
up to 0.1 too low: filter noise first.
"""

import math
from dataclasses import dataclass

import numpy as np

from gen.arrays import Values
from gen.maps.areal import is_lost
from gen.maps.read import Topography
from gen.runtime.documents import Row
from gen.spectral import SelfAffineSpectrum

RATIO = 1.05
"""Ratio of the ends of a bin of wavenumbers where it holds more than one wave along an axis."""

OUTLYING = 1.3
"""Factor by which bins beyond the end of the law count as off it."""

MISFIT = 0.1
"""Scatter of the logarithm that no number of waves averages out, as no surface follows a law."""

LEAST = 4
"""Smallest number of bins in the power law."""

LARGEST_SCATTER = 2.0
"""Root mean square factor between spectrum and law beyond which there is none."""

LEAST_DECADES = 1.0
"""Decades that a law has to hold over: shorter pieces of any spectrum are straight."""

DIRECTIONAL = (0.5, 0.2)
"""Slopes along a lay over those across it, and Str, below which a surface is directional: isotropic
made surfaces have 0.8 and 0.27 or more, with few long waves and without a roll-off."""

LAW = {"hurst": "1", "roll_off": "um", "cut_off": "um", "law_decades": "1", "law_scatter": "1"}
"""Units of the numbers of a law, by their names in tables."""

ROLL_OFFS = 400
"""Number of roll-offs that are tried."""


@dataclass(frozen=True, eq=False)
class RadialSpectrum:
    """Power spectrum of a surface, averaged over directions."""

    wavenumbers: Values  # geometric mean of the wavenumbers of each bin [1/um], shape (bins,)
    edges: Values  # smallest and largest wavenumber of each bin [1/um], shape (bins, 2)
    # mean spectral density C; the mean square height is its integral over the wavevectors, divided
    # by (2 pi)^2 [um^4], shape (bins,)
    density: Values
    waves: Values  # number of waves, opposite ones counted once, shape (bins,)

    def rows(self) -> list[Row]:
        """Return a row of a table for each bin, with the units in the names."""
        names = "wavenumber_per_um", "wavelength_um", "density_um4", "waves"
        columns = self.wavenumbers, 2 * math.pi / self.wavenumbers, self.density, self.waves
        bins = zip(*(column.tolist() for column in columns), strict=True)
        return [dict(zip(names, each, strict=True)) for each in bins]


@dataclass(frozen=True)
class SelfAffineFit:
    """Self-affine law of a surface, in the terms of the generator `spectral`."""

    spectrum: SelfAffineSpectrum  # hurst exponent, roll-off and cut-off
    rms_height: float  # root mean square of the heights of the surface [um]
    level: float  # spectral density of the flat part [um^4]
    # longest wavelength of the spectrum [um]; a roll-off of this length was not found
    longest: float
    scatter: float  # root mean square factor between spectrum and law [1]
    remarks: tuple[str, ...]  # what the fit could not find, one short text each

    @property
    def values(self) -> dict[str, float]:
        """The numbers of the law, in the units of `LAW`."""
        law = self.spectrum
        numbers = law.hurst, law.roll_off, law.cut_off, self.decades, self.scatter
        return dict(zip(LAW, numbers, strict=True))

    @property
    def decades(self) -> float:
        """Decades of wavelengths between roll-off and cut-off, on which the exponent rests."""
        return math.log10(self.spectrum.roll_off / self.spectrum.cut_off)


def radial_spectrum(topography: Topography) -> RadialSpectrum:
    """Compute the power spectrum of a surface and average it over directions.

    A patch that is not periodic is multiplied by a Hann window along both axes, or its borders
    would add waves; the longest wave that is left is then half of the shorter side.
    """
    heights, spacing = topography.heights, topography.spacing
    periodic = topography.boundary == "periodic"
    window = np.ones(heights.shape) if periodic else _hann(heights.shape)
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        heights = window * (heights - np.average(heights, weights=window))
        density = np.abs(np.fft.rfft2(heights)) ** 2 * math.prod(spacing) / np.sum(window**2)
    qx, qy = (
        2 * math.pi * frequencies(nodes, length)
        for frequencies, nodes, length in zip(
            (np.fft.fftfreq, np.fft.rfftfreq), heights.shape, spacing, strict=True
        )
    )
    step = 2 * math.pi / min(n * d for n, d in zip(heights.shape, spacing, strict=True))
    edges = _edges(step, math.pi / max(spacing), 1 if periodic else 2)
    if edges.size < 2:
        empty = np.empty(0)
        return RadialSpectrum(empty, np.empty((0, 2)), empty, empty)
    return _averaged(np.hypot(qx[:, None], qy[None, :]), density, edges, heights.shape[1])


def _hann(shape: tuple[int, ...]) -> Values:
    """Return Hann windows along both axes, zero half a node beyond the outer nodes."""
    x, y = (np.sin(math.pi * (np.arange(nodes) + 0.5) / nodes) ** 2 for nodes in shape)
    return np.outer(x, y)


def _edges(step: float, largest: float, first: int) -> Values:
    """Return the ends of the bins: one wave of the shorter side wide at first, then by `RATIO`."""
    edges = [(first - 0.5) * step]
    while edges[-1] < largest:
        edges.append(max(edges[-1] + step, edges[-1] * RATIO))
    return np.array(edges[:-1])


def _averaged(wavenumbers: Values, density: Values, edges: Values, columns: int) -> RadialSpectrum:
    """Average the density of all waves between the ends of each bin."""
    # All waves of a real transform but those of the first and of the middle column have opposites.
    count = np.ones(density.shape)
    count[:, 0] = 0.5
    if columns % 2 == 0:
        count[:, -1] = 0.5
    places = np.searchsorted(edges, wavenumbers.ravel(), side="right") - 1
    inside = (places >= 0) & (places < edges.size - 1)
    places, count = places[inside], count.ravel()[inside]
    bins = edges.size - 1
    waves = np.bincount(places, count, minlength=bins).astype(np.float64)
    power = np.bincount(places, count * density.ravel()[inside], minlength=bins)
    logs = np.bincount(places, count * np.log(wavenumbers.ravel()[inside]), minlength=bins)
    full = waves > 0
    waves, ends = waves[full], np.column_stack((edges[:-1], edges[1:]))[full]
    return RadialSpectrum(np.exp(logs[full] / waves), ends, power[full] / waves, waves)


def fit_self_affine(
    topography: Topography, spectrum: RadialSpectrum, aspect: float = math.nan
) -> SelfAffineFit | str:
    """Fit the self-affine law to the radial power spectrum of a surface."""
    if reason := _without_law(topography, spectrum) or _lay(topography, aspect):
        return reason
    largest = float(spectrum.density.max())
    q = np.log(spectrum.wavenumbers)
    c = np.log(np.maximum(spectrum.density, 1e-30 * largest) / largest)
    weights = 1.0 / (1.0 / spectrum.waves + MISFIT**2)
    roll, level, slope, bins, error = _best_law(q, c, weights)
    if math.exp(error) > LARGEST_SCATTER:
        return f"the spectrum is off the nearest one by a factor of {math.exp(error):.2g}"
    longest = float(2 * math.pi / spectrum.wavenumbers[0])
    cut_off = float(2 * math.pi / spectrum.edges[bins - 1, 1])
    roll_off = longest if roll <= q[1] else 2 * math.pi / math.exp(roll)
    if roll <= q[1]:
        level += slope * (roll - q[0])
    fit = SelfAffineFit(
        SelfAffineSpectrum(float(slope / 2 - 1), max(roll_off, cut_off), cut_off),
        float(np.std(topography.heights)),
        largest * math.exp(level),
        longest,
        math.exp(error),
        _remarks(roll <= q[1], bins == q.size, slope),
    )
    if fit.decades < LEAST_DECADES:
        said = f"a power law would hold over {fit.decades:.3g} decades, from {roll_off:.4g} to"
        return f"{said} {cut_off:.4g} um, and a Hurst exponent takes one or more"
    return fit if slope > 2.0 else "the spectrum is flatter than any Hurst exponent's, as of noise"


def _without_law(topography: Topography, spectrum: RadialSpectrum) -> str:
    """Say why a spectrum cannot be fitted, "" if it can."""
    heights = topography.heights
    if np.ptp(heights) == 0.0:
        return "flat surface"
    if is_lost(heights):
        return "heights lost in rounding beside their offset"
    if spectrum.wavenumbers.size <= LEAST:
        return "too few nodes: give 16 x 16 or more"
    if not 0.0 < float(spectrum.density.max()) < math.inf:
        return "its power spectrum is beyond what numbers hold"
    return ""


def _lay(topography: Topography, aspect: float) -> str:
    """Say that a surface is directional, "" if it is not."""
    heights, (dx, dy) = topography.heights, topography.spacing
    along_x, along_y = np.diff(heights, axis=0) / dx, np.diff(heights, axis=1) / dy
    at_cells = along_x[:, 1:] + along_x[:, :-1], along_y[1:] + along_y[:-1]
    low, high = np.linalg.eigvalsh(np.cov(np.stack([each.ravel() for each in at_cells])))
    ratio = math.sqrt(max(low, 0.0) / high)
    if ratio >= DIRECTIONAL[0] and not aspect < DIRECTIONAL[1]:
        return ""
    known = "" if math.isnan(aspect) else f"Str {aspect:.2g}, "
    return (
        f"the surface is directional ({known}slopes along its lay {ratio:.2g} of those across it),"
        " and its spectrum depends on the direction"
    )


def _best_law(q: Values, c: Values, weights: Values) -> tuple[float, float, float, int, float]:
    """Find the law with the least squares."""
    best = (math.inf, 0.0, 0.0, 0.0, 0, 0.0)
    outside = math.log(OUTLYING) ** 2 * (weights.sum() - np.cumsum(weights))
    for roll in np.linspace(q[0], q[-LEAST], ROLL_OFFS):
        fall = np.maximum(q - roll, 0.0)
        w, wf, wff, wc, wfc, wcc = (
            np.cumsum(weights * term) for term in (1 + 0 * q, fall, fall**2, c, fall * c, c**2)
        )
        spread = wff - wf**2 / w
        valid = np.arange(q.size) >= np.searchsorted(q, roll) + LEAST - 1
        slopes = np.where(valid, (wf * wc / w - wfc) / np.where(valid, spread, 1.0), 2.0)
        slopes = np.clip(slopes, 2.0, 4.0)  # Hurst exponents from 0 to 1
        levels = (wc + slopes * wf) / w
        squares = wcc + slopes**2 * wff + levels**2 * w
        squares += 2 * (slopes * wfc - levels * wc - levels * slopes * wf)
        costs = np.where(valid, squares + outside, math.inf)
        end = int(np.argmin(costs))
        if costs[end] < best[0]:
            error = math.sqrt(max(squares[end] / w[end], 0.0))
            best = (costs[end], roll, levels[end], slopes[end], end + 1, error)
    return best[1:]


def _remarks(no_roll_off: bool, no_cut_off: bool, slope: float) -> tuple[str, ...]:
    """Say what the fit could not find."""
    texts = (
        (no_roll_off, "no roll-off within the patch"),
        (no_cut_off, "no cut-off above two nodes a wavelength"),
        (slope >= 4.0, "steeper than any Hurst exponent: held at 1"),
    )
    return tuple(text for found, text in texts if found)
