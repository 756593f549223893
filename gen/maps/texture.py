"""Texture of a surface: areal parameters by ISO 25178-2, and the self-affine law of its spectrum.

The parameters follow the definitions of the standard, whose clauses (edition of 2012) the functions
name. Heights count from their mean; nothing is subtracted beyond the preparation.

The law is that of `gen.spectral`: constant up to the roll-off, then |q|^(-2 - 2 H), up to the
cut-off. It is fitted as a piecewise straight line to the logarithm of the radially averaged
spectrum by least squares: all roll-offs and ends of the law are tried, and the constant and the
slope follow in closed form. A bin beyond the end costs as much as one that is off by a factor of
`OUTLYING`, so that the law ends where the spectrum leaves it for good. Towards a floor of noise
the spectrum flattens before, and the Hurst exponent is up to 0.1 too low: filter noise first.
"""

import math
from dataclasses import dataclass

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.read import Topography
from gen.runtime.documents import Row
from gen.spectral import SelfAffineSpectrum
from gen.statistics import LOST, Description, rms_slope

DECAY = (
    0.2  # value s to which the autocorrelation falls at Sal, the default of ISO 25178-3
)
CORE = 0.4  # share of the material ratio over which the core of the curve is sought (ISO 13565-2)
RAYS = 360  # directions over half a turn in which the autocorrelation is followed


# names, units and meanings of the parameters in the order in which they are printed and written
PARAMETERS = (
    ("Sa", "um", "arithmetical mean height: mean distance from the mean"),
    ("Sq", "um", "root mean square height"),
    ("Sz", "um", "maximum height: Sp + Sv"),
    ("Sp", "um", "maximum peak height above the mean"),
    ("Sv", "um", "maximum pit height below the mean"),
    ("Ssk", "1", "skewness of the heights: negative if pits prevail"),
    ("Sku", "1", "kurtosis of the heights: 3 if they are normal"),
    ("Sdq", "1", "root mean square gradient"),
    ("Sdr", "%", "developed interfacial area ratio: area gained over a plane"),
    ("Sal", "um", "autocorrelation length: fastest decay to 0.2"),
    ("Str", "1", "texture aspect ratio: 1 isotropic, 0 one direction"),
    ("Sk", "um", "core height, of the flattest 40 % of the material ratio curve"),
    ("Spk", "um", "reduced peak height, above the core"),
    ("Svk", "um", "reduced dale depth, below the core"),
    ("Smr1", "%", "material ratio of the peaks"),
    ("Smr2", "%", "material ratio above the dales"),
    ("Smr", "%", "material ratio at the depth asked for, below the highest node"),
)


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
    peak, pit = float(scaled.max()), 0.0 - float(scaled.min())  # ISO 25178-2:2012, 4.1
    rms = math.sqrt(np.mean(scaled**2))
    amplitudes = float(np.abs(scaled).mean()), rms, peak + pit, peak, pit
    names = [name for name, *_ in PARAMETERS]
    values = {name: value * unit for name, value in zip(names, amplitudes, strict=False)}
    shape = dict.fromkeys(names[len(values) :], math.nan)
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
    shape["Sdq"], shape["Sdr"] = gradients(
        scaled * unit, topography.spacing, periodic=periodic
    )
    shape["Sal"], shape["Str"], reason = _lengths(
        scaled, topography.spacing, periodic=periodic
    )
    shape.update(_of_curve(scaled, unit, depth))
    return Description(values | shape, reason)


def is_lost(heights: Heights) -> bool:
    """Tell whether the offset of heights has left too few of their digits to have a shape."""
    largest = max(abs(float(heights.min())), abs(float(heights.max())))
    return float(np.std(heights / largest)) <= LOST * float(np.finfo(heights.dtype).eps)


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
        found["Smr"] = float(
            np.interp(falling[0] - depth / unit, falling[::-1], ratios[::-1])
        )
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

    Sdq^2 is the mean squared gradient, and Sdr the mean of sqrt(1 + squared gradient) - 1, of plane
    triangles: a cell is cut along one diagonal and along the other, and both count half.
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
                areas += 0.25 * float(
                    np.mean(gradient * (gradient / (1 + np.hypot(1, gradient))))
                )
        return float(largest * math.sqrt(squares)), 100.0 * areas


def _lengths(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool
) -> tuple[float, float, str]:
    """Compute Sal [um] and Str (ISO 25178-2:2012, 4.2), and the reason why one is NaN."""
    decays, reaches = decay_lengths(autocorrelation(heights, periodic=periodic), spacing)
    fallen = np.isfinite(decays)
    reason = f"the autocorrelation does not fall to {DECAY:g} within half of the sides"
    if not fallen.any():
        return math.nan, math.nan, reason
    shortest = float(decays[fallen].min())
    if fallen.all():
        return shortest, shortest / float(decays.max()), ""
    bound = min(shortest / float(reaches[~fallen].max()), 1.0)
    return (
        shortest,
        math.nan,
        f"{reason} along all directions, so Str is below {bound:.2g}",
    )


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


def decay_lengths(
    correlation: Values, spacing: tuple[float, float]
) -> tuple[Values, Values]:
    """Return how far the autocorrelation decays to `DECAY` along `RAYS` directions, and can [um].

    The distance is infinite where it does not within the largest lag.
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
        at_x, at_y = distances * x, distances * y + ky
        left = np.clip(np.floor(at_x).astype(int), 0, kx - 1)
        lower = np.clip(np.floor(at_y).astype(int), 0, correlation.shape[1] - 2)
        u, v = at_x - left, at_y - lower  # places in a cell, in which values are bilinear
        near = (1 - v) * correlation[left, lower] + v * correlation[left, lower + 1]
        far = (1 - v) * correlation[left + 1, lower] + v * correlation[
            left + 1, lower + 1
        ]
        values = (1 - u) * near + u * far
        reaches[index] = farthest
        below = np.flatnonzero(values <= DECAY)
        if below.size:
            last = below[0]
            share = (values[last - 1] - DECAY) / (values[last - 1] - values[last])
            decays[index] = distances[last - 1] + share * (
                distances[last] - distances[last - 1]
            )
    return decays, reaches


# ratio of the ends of a bin of wavenumbers where it holds more than one wave along an axis
RATIO = 1.05
OUTLYING = 1.3  # factor by which bins beyond the end of the law count as off it
# scatter of the logarithm that no number of waves averages out, as no surface follows a law
MISFIT = 0.1
LEAST = 4  # smallest number of bins in the power law
LARGEST_SCATTER = (
    2.0  # root mean square factor between spectrum and law beyond which there is none
)
# decades that a law has to hold over: shorter pieces of any spectrum are straight
LEAST_DECADES = 1.0
# slopes along a lay over those across it, and Str, below which a surface is directional: isotropic
# made surfaces have 0.8 and 0.27 or more, with few long waves and without a roll-off
DIRECTIONAL = (0.5, 0.2)
# units of the numbers of a law, by their names in tables
LAW = {
    "hurst": "1",
    "roll_off": "um",
    "cut_off": "um",
    "law_decades": "1",
    "law_scatter": "1",
}
ROUGHNESS = 0.99  # share of the mean square slope of the waves that carry roughness
# nodes in the shortest wave from which on the area in the continuum is right to 1 %, from a mean
# pressure of 0.05 E* times the rms slope on (`bench resolution`)
WELL_RESOLVED = 4
ROLL_OFFS = 400  # number of roll-offs that are tried


@dataclass(frozen=True, eq=False)
class RadialSpectrum:
    """Power spectrum of a surface, averaged over directions."""

    wavenumbers: (
        Values  # geometric mean of the wavenumbers of each bin [1/um], shape (bins,)
    )
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
        bins = zip(*(column.tolist() for column in columns.values()), strict=True)
        return [dict(zip(columns, each, strict=True)) for each in bins]


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

    A patch that is not periodic is multiplied by a Hann window, or its borders would add waves.
    """
    heights, spacing = topography.heights, topography.spacing
    periodic = topography.boundary == "periodic"
    # Hann windows along both axes are zero half a node beyond the outer nodes.
    hann = (
        np.sin(math.pi * (np.arange(nodes) + 0.5) / nodes) ** 2 for nodes in heights.shape
    )
    window = np.ones(heights.shape) if periodic else np.outer(*hann)
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        heights = window * (heights - np.average(heights, weights=window))
        density = (
            np.abs(np.fft.rfft2(heights)) ** 2 * math.prod(spacing) / np.sum(window**2)
        )
    qx, qy = (
        2 * math.pi * frequencies(nodes, length)
        for frequencies, nodes, length in zip(
            (np.fft.fftfreq, np.fft.rfftfreq), heights.shape, spacing, strict=True
        )
    )
    step = 2 * math.pi / min(n * d for n, d in zip(heights.shape, spacing, strict=True))
    ends = [(0.5 if periodic else 1.5) * step]
    while ends[-1] < math.pi / max(spacing):  # one wave of the shorter side wide at first
        ends.append(max(ends[-1] + step, ends[-1] * RATIO))
    edges = np.array(ends[:-1])
    if edges.size < 2:
        empty = np.empty(0)
        return RadialSpectrum(empty, np.empty((0, 2)), empty, empty, empty, empty)
    wavenumbers = np.hypot(qx[:, None], qy[None, :]).ravel()
    # All waves of a real transform but those of the first and of the middle column have opposites.
    count = np.ones(density.shape)
    count[:, 0] = 0.5
    if heights.shape[1] % 2 == 0:
        count[:, -1] = 0.5
    places = np.searchsorted(edges, wavenumbers, side="right") - 1
    inside = (places >= 0) & (places < edges.size - 1)
    places, count = places[inside], count.ravel()[inside]
    bins = edges.size - 1
    waves = np.bincount(places, count, minlength=bins).astype(np.float64)
    power = np.bincount(places, count * density.ravel()[inside], minlength=bins)
    logs = np.bincount(places, count * np.log(wavenumbers[inside]), minlength=bins)
    full, both = waves > 0, np.column_stack((edges[:-1], edges[1:]))
    waves = waves[full]
    along_x, along_y = (
        _profile_density(topography, axis, both[full], periodic=periodic)
        for axis in (0, 1)
    )
    return RadialSpectrum(
        np.exp(logs[full] / waves),
        both[full],
        power[full] / waves,
        waves,
        along_x,
        along_y,
    )


def _profile_density(
    topography: Topography, axis: int, edges: Values, *, periodic: bool
) -> Values:
    """Compute the mean spectral density of the profiles along an axis in bins of wavenumbers.

    Each profile counts from its mean, and is windowed unless the patch is periodic.

    Parameters
    ----------
    edges : ndarray, shape (bins, 2)
        Smallest and largest wavenumber of each bin [1/um].

    Returns
    -------
    ndarray, shape (bins,)
        Density of the profiles [um^3], NaN in a bin without a wave along the axis.
    """
    profiles, step = np.moveaxis(topography.heights, axis, -1), topography.spacing[axis]
    nodes = profiles.shape[-1]
    hann = np.sin(math.pi * (np.arange(nodes) + 0.5) / nodes) ** 2
    window = np.ones(nodes) if periodic else hann
    with np.errstate(over="ignore", invalid="ignore"):  # heights of 1e300 um
        centred = profiles - np.average(profiles, axis=-1, weights=window)[:, None]
        powers = np.abs(np.fft.rfft(window * centred, axis=-1)) ** 2
        density = powers.mean(axis=0) * step / np.sum(window**2)
    wavenumbers = 2 * math.pi * np.fft.rfftfreq(nodes, step)
    first, last = np.searchsorted(wavenumbers, edges).T
    sums = np.concatenate(([0.0], np.cumsum(density)))
    with np.errstate(invalid="ignore"):
        return np.asarray((sums[last] - sums[first]) / (last - first))


@dataclass(frozen=True)
class ProfileRoughness:
    """Roughness of the profiles along an axis, after ISO 21920-2, from all of them together."""

    rms_height: float  # Rq, about the mean of each profile [um]
    rms_slope: float  # Rdq, between neighbouring nodes [1]

    @property
    def wavelength(self) -> float:
        """Mean wavelength, 2 pi rms height / rms slope [um]; NaN of flat profiles."""
        return (
            2 * math.pi * self.rms_height / self.rms_slope if self.rms_slope else math.nan
        )


def profile_roughness(
    topography: Topography,
) -> tuple[ProfileRoughness, ProfileRoughness]:
    """Measure the roughness of the profiles along x and along y."""
    heights, (dx, dy) = topography.heights, topography.spacing
    slopes = rms_slope(heights, (dx, math.inf)), rms_slope(heights, (math.inf, dy))
    deviations = (heights - heights.mean(axis=axis, keepdims=True) for axis in (0, 1))
    along_x, along_y = (
        ProfileRoughness(float(np.std(each)), slope)
        for each, slope in zip(deviations, slopes, strict=True)
    )
    return along_x, along_y


def nodes_a_wave(spectrum: RadialSpectrum, spacing: tuple[float, float]) -> float:
    """Return how many nodes the shortest wave has that carries roughness, at least 2.

    Shorter waves carry 1 % of the mean square slope together. NaN is returned without a spectrum.
    """
    slopes = spectrum.waves * spectrum.density * spectrum.wavenumbers**2
    if not 0.0 < slopes.sum() < math.inf:
        return math.nan
    place = int(np.searchsorted(np.cumsum(slopes), ROUGHNESS * slopes.sum()))
    return float(2 * math.pi / spectrum.edges[place, 1]) / max(spacing)


def fit_self_affine(
    topography: Topography, spectrum: RadialSpectrum, aspect: float = math.nan
) -> SelfAffineFit | str:
    """Fit the self-affine law to the radial power spectrum of a surface."""
    if reason := _without_law(topography, spectrum, aspect):
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
    missing = {  # what the fit could not find
        "no roll-off within the patch": roll <= q[1],
        "no cut-off above two nodes a wavelength": bins == q.size,
        "steeper than any Hurst exponent: held at 1": slope >= 4.0,
    }
    fit = SelfAffineFit(
        SelfAffineSpectrum(float(slope / 2 - 1), max(roll_off, cut_off), cut_off),
        float(np.std(topography.heights)),
        largest * math.exp(level),
        longest,
        math.exp(error),
        tuple(text for text, found in missing.items() if found),
    )
    if fit.decades < LEAST_DECADES:
        said = f"the spectrum follows a power law over {fit.decades:.3g} decades of wavelengths"
        ends = f"{roll_off:.4g} to {cut_off:.4g} um"
        return f"{said}, {ends}; a Hurst exponent needs {LEAST_DECADES:g} or more"
    return (
        fit
        if slope > 2.0
        else "the spectrum is flatter than any Hurst exponent's, as of noise"
    )


def _without_law(topography: Topography, spectrum: RadialSpectrum, aspect: float) -> str:
    """Say why a surface has no law: no spectrum to fit, or a lay; "" if it may have one."""
    heights = topography.heights
    if np.ptp(heights) == 0.0:
        return "flat surface"
    if is_lost(heights):
        return "heights lost in rounding beside their offset"
    if spectrum.wavenumbers.size <= LEAST:
        return "too few nodes: give 16 x 16 or more"
    if not 0.0 < float(spectrum.density.max()) < math.inf:
        return "its power spectrum is beyond what numbers hold"
    return lay_of(topography, aspect)


def lay_of(topography: Topography, aspect: float = math.nan) -> str:
    """Say why a surface is directional, by its slopes and the aspect ratio Str; "" if it is not."""
    heights, (dx, dy) = topography.heights, topography.spacing
    lowest, highest = float(heights.min()), float(heights.max())
    if lowest == highest or is_lost(heights):
        return ""
    heights = heights / (
        0.5 * highest - 0.5 * lowest
    )  # squares of tiny slopes would be 0
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


def _best_law(
    q: Values, c: Values, weights: Values
) -> tuple[float, float, float, int, float]:
    """Find the law with the least squares."""
    best = (math.inf, 0.0, 0.0, 0.0, 0, 0.0)
    outside = math.log(OUTLYING) ** 2 * (weights.sum() - np.cumsum(weights))
    for roll in np.linspace(q[0], q[-LEAST], ROLL_OFFS):
        fall = np.maximum(q - roll, 0.0)
        w, wf, wff, wc, wfc, wcc = (
            np.cumsum(weights * term)
            for term in (1 + 0 * q, fall, fall**2, c, fall * c, c**2)
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
