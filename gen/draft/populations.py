"""Fit a population to maps: its spectrum, its distribution of heights, and what gives way.

The surfaces are translation fields, see `gen.population`. Three things are fitted, in this order:

- The curve to heights, from the maps' quantiles. It is smooth: with the exact heights of a map,
  short waves would be noise.
- The spectrum that surfaces shall have: that of the maps in bands, of which long waves, level and
  direction are corrected until the rms height and the rms slopes along both axes are the maps'.
- The spectrum of the Gaussian field. The curve distorts the autocorrelation of the field in a way
  that its Hermite polynomials tell [1]_, so that the spectrum of the surfaces is known without
  making one. The field's spectrum is multiplied in each band by what the surfaces' lacks [2]_.

References
----------
.. [1] M. Grigoriu, Simulation of stationary non-Gaussian translation processes, Journal of
   Engineering Mechanics 124, 121-126, 1998.
.. [2] M. D. Shields, G. Deodatis, P. Bocchini, A simple and efficient methodology to approximate a
   general non-Gaussian stationary stochastic process by a translation process, Probabilistic
   Engineering Mechanics 26, 511-519, 2011.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gen.arrays import Heights, Values
from gen.draft.bands import (
    BandSpectrum,
    WaveBands,
    WaveGrid,
    leaked,
    periodogram,
    smoothed,
)
from gen.draft.proposal import common_spacing, nodes_like, with_chosen_steps
from gen.draft.survey import MapSurvey, measure, require_usable, survey_maps
from gen.maps.filters import is_same
from gen.maps.read import Topography, spacing_text
from gen.maps.settings import Reading
from gen.maps.texture import nodes_a_wave, radial_spectrum
from gen.population import FORMAT, Population, SourceMap, generate_like
from gen.runtime.errors import InputError
from gen.runtime.files import digest

FEWEST_NODES = 16  # nodes along the shorter side of a map to which a population is fitted

KNOTS = (
    17  # number of normal scores at which the curve of heights is known, but for its ends
)
SPAN = 2.8  # largest of these scores
# A height of the curve is the mean of this share of all nodes.
SHARE_OF_A_KNOT = 1 / 200

# Waves of this number to a map's side count as long ones, whose power is known least.
LONG = 3.0
# largest factor by which the power of long waves is corrected
MOST_FOR_LONG = 4.0
MOST_FOR_SHORT = 3.0  # largest logarithm of a factor of the shortest waves
STEEPEST = 3.0  # largest exponent of the wavenumber by which the spectrum is corrected
MOST_DIRECTIONAL = 6.0  # largest exponent of a factor that differs along x and y

TERMS = 64  # number of Hermite polynomials of the curve of heights
ROUNDS = 20  # number of corrections of the Gaussian field's spectrum
ROUNDS_OF_MEANS = (
    6  # corrections by which an interpolated spectrum gets the means of its bands
)
STEP = 0.7  # exponent of a correction
MOST_OF_A_ROUND = 2.0  # largest change of a logarithm in one correction
ROUNDS_OF_ROUGHNESS = 3  # corrections of the wanted spectrum by the maps' roughness
# smallest logarithm of a density relative to the largest
LEAST = -60.0

TRIALS = 4  # surfaces that are compared with the maps
# largest relative difference between surfaces and maps that is not told
GIVES_WAY = 0.1


@dataclass(frozen=True, eq=False)
class FittedMap:
    """A prepared map, and where it comes from."""

    topography: Topography
    sha256: str  # hash of the content of the map's file


@dataclass(frozen=True)
class Roughness:
    """Numbers of surfaces that a population is to share with its maps."""

    rms_height: float  # [um]
    slope_x: float  # rms difference quotient along x [1]
    slope_y: float  # along y [1]
    curvature: float  # rms second difference quotient, along both axes together [1/um]

    @classmethod
    def of(cls, surfaces: Sequence[Heights], spacing: tuple[float, float]) -> Roughness:
        """Measure the root mean squares over several surfaces.

        Parameters
        ----------
        surfaces : sequence of ndarray, shape (nx, ny)
            Heights [um], of at least 3 nodes along both axes.
        spacing : tuple of float
            Distance of the nodes along x and y [um].

        Returns
        -------
        Roughness
            The numbers.
        """
        dx, dy = spacing
        variances = [surface.var() for surface in surfaces]
        slopes_x = [np.mean((np.diff(surface, axis=0) / dx) ** 2) for surface in surfaces]
        slopes_y = [np.mean((np.diff(surface, axis=1) / dy) ** 2) for surface in surfaces]
        curvatures = [
            np.mean((np.diff(surface, 2, axis=0) / dx**2) ** 2)
            + np.mean((np.diff(surface, 2, axis=1) / dy**2) ** 2)
            for surface in surfaces
        ]
        return cls(
            rms_height=math.sqrt(np.mean(variances)),
            slope_x=math.sqrt(np.mean(slopes_x)),
            slope_y=math.sqrt(np.mean(slopes_y)),
            curvature=math.sqrt(np.mean(curvatures)),
        )

    @property
    def slope(self) -> float:
        """The rms slope, along both axes together [1]."""
        return math.hypot(self.slope_x, self.slope_y)


@dataclass(frozen=True, eq=False)
class LikeMaps:
    """A population that was fitted to maps of one kind, and the maps."""

    surveys: list[MapSurvey]  # surveys of the prepared maps
    reading: Reading  # how the maps are read and prepared
    maps: list[FittedMap]
    population: Population
    nodes: int  # nodes along each side of the surfaces of a scene

    @property
    def scales(self) -> tuple[float, float]:
        """Smallest and largest rms height of the maps over that of the population [1]."""
        rms_heights = [one.rms_height for one in self.population.maps]
        middle = self.median_rms_height
        return min(rms_heights) / middle, max(rms_heights) / middle

    @property
    def median_rms_height(self) -> float:
        """Median of the rms heights of the maps, which is that of the population [um]."""
        return float(np.median([one.rms_height for one in self.population.maps]))


def propose_population(paths: Sequence[Path], reading: Reading) -> LikeMaps:
    """Read and prepare maps of one kind, and fit a population to them.

    Parameters
    ----------
    paths : sequence of Path
        Files of the maps, at least one.
    reading : Reading
        Unit, lengths and channel, if the files do not determine them. The steps of the preparation
        are chosen for the maps, whatever `reading` holds.

    Returns
    -------
    LikeMaps
        The population and the maps.

    Raises
    ------
    InputError
        If a map cannot be used, or no population can be fitted.
    """
    surveys = survey_maps(paths, reading)
    for survey in surveys:
        require_usable([survey])
    reading = with_chosen_steps(reading, surveys)
    spacing = common_spacing([survey.spacing for survey in surveys])
    measured = []
    maps = []
    for survey in surveys:
        prepared = measure(survey, reading, spacing)
        measured.append(prepared.survey)
        if prepared.topography is None:
            raise InputError(
                f"no map can be used: {survey.path}: {prepared.survey.fault}"
            )
        maps.append(FittedMap(prepared.topography, digest(survey.path)))
    steps = maps[0].topography.steps
    population = fit_population(maps, "; ".join(steps))
    lengths = [survey.length for survey in measured if not math.isnan(survey.length)]
    length = float(np.median(lengths)) if lengths else math.nan
    shape = _shape(maps[0].topography.heights)
    nodes = nodes_like(shape, length / max(population.spacing))
    return LikeMaps(
        surveys=measured,
        reading=reading,
        maps=maps,
        population=population,
        nodes=nodes,
    )


def fit_population(maps: Sequence[FittedMap], preparation: str) -> Population:
    """Fit a population to maps of one kind.

    Each map counts with its heights over its rms height; the rms height of the population is the
    median of theirs.

    Parameters
    ----------
    maps : sequence of FittedMap
        The maps, at least one.
    preparation : str
        How the maps were prepared, for the population's file.

    Returns
    -------
    Population
        The population.

    Raises
    ------
    InputError
        If a map is flat or has too few nodes, or the maps have different spacings.
    """
    _require_fitting(maps)
    units = [_standardised(one.topography.heights) for one in maps]
    spacing = maps[0].topography.spacing
    rms_heights = [float(one.topography.heights.std()) for one in maps]
    rms_height = float(np.median(rms_heights))
    shape = max((unit.shape for unit in units), key=math.prod)
    grid = WaveGrid(shape=shape, spacing=spacing)
    wanted = _wanted_spectrum(units, grid)
    independent = _independent_waves(wanted) * len(units)
    curve = _HeightCurve.of(units).without_chance(independent)
    wanted = wanted.with_variance(curve.variance)
    field = _spectrum_of_field(wanted, curve)
    bands_x, bands_y = wanted.bands.middles
    heights = curve.heights * rms_height
    population = Population(
        format=FORMAT,
        maps=tuple(
            SourceMap(
                name=Path(one.topography.name).name,
                sha256=one.sha256,
                nodes=_shape(one.topography.heights),
                rms_height=rms,
            )
            for one, rms in zip(maps, rms_heights, strict=True)
        ),
        preparation=preparation,
        spacing=(float(spacing[0]), float(spacing[1])),
        shortest=_shortest_wave(maps),
        remarks=(),
        bands_x=_rounded(bands_x, 12),
        bands_y=_rounded(bands_y, 12),
        logarithms=(_rows(field[0]), _rows(field[1])),
        scores=_rounded(curve.scores, 6),
        heights=_rounded(heights, 9),
    )
    surfaces = [
        generate_like(population, shape, shape, np.random.default_rng([TRIALS, number]))
        for number in range(TRIALS)
    ]
    of_maps = Roughness.of([unit * rms_height for unit in units], spacing)
    of_surfaces = [Roughness.of([surface], spacing) for surface in surfaces]
    remarks = _what_gives_way(of_surfaces, of_maps)
    return replace(population, remarks=tuple(remarks))


def _require_fitting(maps: Sequence[FittedMap]) -> None:
    """Raise InputError unless a population can be fitted to the maps."""
    first = maps[0].topography
    for one in maps:
        topography = one.topography
        nx, ny = topography.heights.shape
        if min(nx, ny) < FEWEST_NODES:
            raise InputError(
                f"{topography.name}: {nx} x {ny} nodes: surfaces like a map need at least"
                f" {FEWEST_NODES} along both axes"
            )
        deviation = float(topography.heights.std())
        if not 0.0 < deviation < math.inf:
            raise InputError(
                f"{topography.name}: its rms height is {deviation:g} um: no surface is like it"
            )
        same = [
            is_same(*pair) for pair in zip(topography.spacing, first.spacing, strict=True)
        ]
        if not all(same):
            raise InputError(
                f"{topography.name}: a node every {spacing_text(topography.spacing)} um,"
                f" {first.name} has one every {spacing_text(first.spacing)}: maps of one kind"
                " share their spacing"
            )


def _shape(heights: Heights) -> tuple[int, int]:
    """Return the nodes of a map along x and y."""
    nx, ny = heights.shape
    return nx, ny


def _standardised(heights: Heights) -> Heights:
    """Return heights about their mean, over their rms height [1]."""
    centred = heights - heights.mean()
    return np.asarray(centred / centred.std())


def _rounded(values: Values, digits: int) -> tuple[float, ...]:
    """Return numbers with a number of significant digits: a file needs no more."""
    return tuple(float(f"{value:.{digits}g}") for value in values)


def _rows(table: Values) -> tuple[tuple[float, ...], ...]:
    """Return the rows of a table of logarithms, to three decimals: densities to 0.05 %."""
    return tuple(tuple(round(float(value), 3) for value in row) for row in table)


def _shortest_wave(maps: Sequence[FittedMap]) -> float:
    """Return the shortest wavelength that carries roughness, in the finest of the maps [um]."""
    lengths = []
    for one in maps:
        spacing = one.topography.spacing
        nodes = nodes_a_wave(radial_spectrum(one.topography), spacing)
        if math.isnan(nodes):
            nodes = 2.0
        lengths.append(nodes * max(spacing))
    return float(f"{min(lengths):.4g}")


@dataclass(frozen=True, eq=False)
class _HeightCurve:
    """The rising curve from normal scores to heights of unit rms."""

    scores: Values  # rising normal scores, shape (knots,) [1]
    heights: Values  # heights at these scores, rising, shape (knots,) [1]

    @classmethod
    def of(cls, units: Sequence[Heights]) -> _HeightCurve:
        """Return the curve of maps with unit rms heights: each quantile is the mean of theirs."""
        curves = [_quantiles(unit) for unit in units]
        furthest = min(curve.scores[-1] for curve in curves)
        scores = np.concatenate(([-furthest], curves[0].scores[1:-1], [furthest]))
        if len(curves) > 1:
            limit = 0.9 * furthest
            inner = np.linspace(-min(SPAN, limit), min(SPAN, limit), KNOTS)
            scores = np.concatenate(([-furthest], inner, [furthest]))
        heights = np.mean(
            [np.interp(scores, curve.scores, curve.heights) for curve in curves], axis=0
        )
        return cls(scores=scores, heights=np.maximum.accumulate(heights))

    def __call__(self, scores: Values) -> Values:
        """Return the heights at normal scores [1]."""
        from gen.population import tabulated_curve

        places, heights = tabulated_curve(tuple(self.scores), tuple(self.heights))
        return np.interp(scores, places, heights)

    def without_chance(self, independent: float) -> _HeightCurve:
        """Return the curve less what of its bends may be chance.

        Heights of few waves are not normally distributed although their field is. The bends, which
        are distances from the straight line of normal heights, shrink by the share of their mean
        square that quantiles of a number of independent heights have by chance (James and Stein).
        """
        from scipy.special import ndtr

        scores = self.scores[1:-1]
        below = ndtr(scores)
        density = np.exp(-(scores**2) / 2) / math.sqrt(2 * math.pi)
        variances = below * (1 - below) / (independent * density**2)
        bends = self.heights[1:-1] - scores
        mean_square = float(np.mean(bends**2 / variances))
        share = max(0.0, 1.0 - 1.0 / max(mean_square, 1.0))
        return _HeightCurve(
            scores=self.scores, heights=self.scores + share * (self.heights - self.scores)
        )

    @property
    def hermite_powers(self) -> Values:
        """Powers of the curve's normalised Hermite polynomials, shape (`TERMS` + 1,).

        The power of degree k is the share in the variance of the heights that the autocorrelation
        of the Gaussian field enters by its k-th power. The last power is the rest.
        """
        scores = np.linspace(-8, 8, 4001)
        weights = np.exp(-(scores**2) / 2)
        weights /= weights.sum()
        heights = self(scores)
        heights -= weights @ heights
        before = np.zeros_like(scores)
        polynomial = np.ones_like(scores)
        powers = []
        for degree in range(TERMS):
            powers.append(float(weights @ (heights * polynomial)) ** 2)
            following = scores * polynomial - math.sqrt(degree) * before
            before = polynomial
            polynomial = following / math.sqrt(degree + 1)
        rest = float(weights @ heights**2) - sum(powers)
        return np.array([*powers, max(0.0, rest)])

    @property
    def variance(self) -> float:
        """Variance of the heights at normally distributed scores [1]."""
        return float(self.hermite_powers.sum())


def _quantiles(unit: Heights) -> _HeightCurve:
    """Return the smooth curve of the heights of one map with unit rms height."""
    from scipy.special import ndtri

    ordered = np.sort(unit, axis=None)
    scores = ndtri((np.arange(ordered.size) + 0.5) / ordered.size)
    span = min(SPAN, 0.9 * scores[-1])
    knots = np.linspace(-span, span, KNOTS)
    half = int(SHARE_OF_A_KNOT * ordered.size / 2)
    centres = np.searchsorted(scores, knots)
    means = [
        ordered[max(0, centre - half) : centre + half + 1].mean() for centre in centres
    ]
    heights = np.concatenate(([ordered[0]], means, [ordered[-1]]))
    return _HeightCurve(
        scores=np.concatenate(([scores[0]], knots, [scores[-1]])),
        heights=np.maximum.accumulate(heights),
    )


@dataclass(frozen=True, eq=False)
class _Wanted:
    """The spectrum that surfaces shall have."""

    grid: WaveGrid
    bands: WaveBands
    logarithms: Values  # logarithms of the density in bands [um^2: heights have no unit]

    def with_variance(self, variance: float) -> _Wanted:
        """Return the same spectrum for heights of another variance [1]."""
        total = self.grid.total(self.bands.spread(self.grid, self.logarithms))
        return replace(self, logarithms=self.logarithms + math.log(variance / total))


def _wanted_spectrum(units: Sequence[Heights], grid: WaveGrid) -> _Wanted:
    """Return the spectrum of maps with unit rms heights, of unit variance.

    The maps' periodograms tell its form. Its variance and the rms slopes along both axes over the
    rms height are those of the maps, which a window does not weigh.
    """
    bands = WaveBands.of(grid)
    spectrum = _mean_spectrum(units, grid, bands)
    roughness = Roughness.of(units, grid.spacing)
    correction = _Correction(
        grid=grid,
        bands=bands,
        logarithms=_with_means(bands, grid, smoothed(spectrum)),
        direction=_log_ratio(roughness.slope_x**2, roughness.slope_y**2),
        steepness=_log_ratio(roughness.slope**2, roughness.rms_height**2),
        sharpness=_log_ratio(roughness.curvature**2, roughness.slope**2),
    )
    wanted = _Wanted(grid=grid, bands=bands, logarithms=correction.corrected())
    return wanted.with_variance(1.0)


def _independent_waves(wanted: _Wanted) -> float:
    """Return the number of waves of equal power of which heights would scatter as much.

    It is the square of the sum of all powers over the sum of their squares.
    """
    densities = wanted.bands.spread(wanted.grid, wanted.logarithms)
    squares = wanted.grid.total(densities**2) / wanted.grid.area
    return wanted.grid.total(densities) ** 2 / squares


def _with_means(bands: WaveBands, grid: WaveGrid, means: Values) -> Values:
    """Return a spectrum in bands whose means over the waves of each band are the given ones.

    Both are logarithms. They differ where the spectrum is interpolated over a sharp bend.
    """
    logarithms = means.copy()
    for _ in range(ROUNDS_OF_MEANS):
        now = _log_means(bands.means(grid, bands.spread(grid, logarithms)))
        logarithms += np.clip(means - now, -MOST_OF_A_ROUND, MOST_OF_A_ROUND)
    return logarithms


def _mean_spectrum(
    units: Sequence[Heights], grid: WaveGrid, bands: WaveBands
) -> BandSpectrum:
    """Return the mean spectrum of maps in bands; a map counts in a band with its waves there."""
    powers = np.zeros(bands.shape)
    waves = np.zeros(bands.shape)
    for unit in units:
        of_map = WaveGrid(shape=_shape(unit), spacing=grid.spacing)
        spectrum = bands.means(of_map, periodogram(unit, of_map))
        powers += np.where(spectrum.waves > 0, spectrum.waves * spectrum.densities, 0.0)
        waves += spectrum.waves
    with np.errstate(invalid="ignore"):  # 0 / 0 in bands without waves
        return BandSpectrum(densities=powers / waves, waves=waves)


def _log_ratio(numerator: float, denominator: float) -> float:
    """Return the logarithm of a ratio; NaN unless both numbers are above 0."""
    if numerator > 0 and denominator > 0:
        return math.log(numerator / denominator)
    return math.nan


@dataclass(frozen=True, eq=False)
class _Correction:
    """Correction of a spectrum in bands by what is known of the heights without a window."""

    grid: WaveGrid
    bands: WaveBands
    logarithms: Values  # logarithms of the spectrum in bands
    direction: (
        float  # logarithm of the mean square slope along x over that along y; may be NaN
    )
    steepness: (
        float  # logarithm of the mean square slope over the variance of heights [1/um^2]
    )
    sharpness: (
        float  # logarithm of the mean square curvature over that of the slope [1/um^2]
    )

    def corrected(self) -> Values:
        """Return the logarithms with the wanted direction and steepness, as far as possible.

        First the power along x and y is changed, then that of long waves, which the window weighs
        most, the power of all waves by an exponent of their wavenumber, and at last that of short
        waves, for the curvature. A few rounds are enough, because these hardly change each other.
        """
        waves_x, waves_y = self._numbers_of_waves()
        number = np.hypot(waves_x, waves_y)
        is_long = 1 / (1 + (number / LONG) ** 4)
        qx, qy = self.bands.middles
        qx, qy = np.maximum(qx, qx[1] / 2)[:, None], np.maximum(qy, qy[1] / 2)[None, :]
        along = (qx**2 - qy**2) / (qx**2 + qy**2) * (1 - is_long)
        steep = np.log(np.maximum(number, 1.0))
        is_short = qx**2 / qx.max() ** 2 + qy**2 / qy.max() ** 2
        logarithms = self.logarithms
        for _ in range(ROUNDS_OF_ROUGHNESS):
            if not math.isnan(self.direction):
                logarithms = self._nearest(
                    logarithms, along, MOST_DIRECTIONAL, self._direction_fault
                )
            logarithms = self._nearest(
                logarithms, is_long, math.log(MOST_FOR_LONG), self._steepness_fault
            )
            logarithms = self._nearest(logarithms, steep, STEEPEST, self._steepness_fault)
            logarithms = self._nearest(
                logarithms, is_short, MOST_FOR_SHORT, self._sharpness_fault
            )
        return logarithms

    def _numbers_of_waves(self) -> tuple[Values, Values]:
        """Return the number of waves a side in each band along x and y, to broadcast."""
        qx, qy = self.bands.middles
        return (qx / qx[1])[:, None], (qy / qy[1])[None, :]

    def _nearest(
        self,
        logarithms: Values,
        pattern: Values,
        most: float,
        fault: Callable[[Values], float],
    ) -> Values:
        """Add the multiple of a pattern, up to `most`, that makes a fault 0, or else smallest."""
        from scipy.optimize import brentq

        def fault_of(multiple: float) -> float:
            return fault(logarithms + multiple * pattern)

        at_least = fault_of(-most)
        at_most = fault_of(most)
        if at_least * at_most < 0:
            multiple = float(brentq(fault_of, -most, most, xtol=1e-4))
        else:
            multiple = -most if abs(at_least) < abs(at_most) else most
            if abs(fault_of(0.0)) <= min(abs(at_least), abs(at_most)):
                multiple = 0.0
        return logarithms + multiple * pattern

    def _direction_fault(self, logarithms: Values) -> float:
        """Return by how much the logarithm of the slopes' ratio is off."""
        densities = self.bands.spread(self.grid, logarithms)
        along_x = self.grid.total(densities * self.grid.slopes_x)
        along_y = self.grid.total(densities * self.grid.slopes_y)
        return _log_ratio(along_x, along_y) - self.direction

    def _steepness_fault(self, logarithms: Values) -> float:
        """Return by how much the logarithm of mean square slope over variance is off."""
        densities = self.bands.spread(self.grid, logarithms)
        slopes = self.grid.slopes_x + self.grid.slopes_y
        slope = self.grid.total(densities * slopes)
        return _log_ratio(slope, self.grid.total(densities)) - self.steepness

    def _sharpness_fault(self, logarithms: Values) -> float:
        """Return by how much the logarithm of mean square curvature over slope is off."""
        densities = self.bands.spread(self.grid, logarithms)
        curvatures = self.grid.slopes_x**2 + self.grid.slopes_y**2
        slopes = self.grid.slopes_x + self.grid.slopes_y
        curvature = self.grid.total(densities * curvatures)
        slope = self.grid.total(densities * slopes)
        return _log_ratio(curvature, slope) - self.sharpness


def _spectrum_of_field(wanted: _Wanted, curve: _HeightCurve) -> Values:
    """Return logarithms of the Gaussian field's spectrum in bands, the largest one being 0.

    In each round the mean spectrum of the surfaces follows from the field's autocorrelation, and is
    compared with the wanted one through the window.
    """
    from scipy import fft

    grid = wanted.grid
    bands = wanted.bands
    correlations = np.linspace(-1, 1, 8001)
    covariances = np.polynomial.polynomial.polyval(correlations, curve.hermite_powers)
    covariances -= curve.hermite_powers[0]
    # What the window leaks is in the maps' periodograms, and in the wanted spectrum therefore.
    aim = _log_means(bands.means(grid, bands.spread(grid, wanted.logarithms)))
    field = wanted.logarithms.copy()
    for _ in range(ROUNDS):
        densities = bands.spread(grid, field)
        correlation = fft.irfft2(densities, s=grid.shape)
        correlation /= correlation[0, 0]
        covariance = np.interp(correlation, correlations, covariances)
        spectrum = fft.rfft2(covariance).real * math.prod(grid.spacing)
        np.maximum(spectrum, 0.0, out=spectrum)
        spectrum[0, 0] = 0.0
        lacks = aim - _log_means(bands.means(grid, leaked(spectrum)))
        field += STEP * np.clip(lacks, -MOST_OF_A_ROUND, MOST_OF_A_ROUND)
        field = np.maximum(field, field.max() + LEAST)
    return np.asarray(field - field.max())


def _log_means(spectrum: BandSpectrum) -> Values:
    """Return the logarithms of means in bands; 0 in bands without waves, which no round changes."""
    densities = np.where(spectrum.waves > 0, spectrum.densities, 1.0)
    return np.asarray(np.log(np.maximum(densities, 1e-300)))


def _what_gives_way(of_surfaces: Sequence[Roughness], of_maps: Roughness) -> list[str]:
    """Return sentences on numbers of the surfaces that are not those of the maps.

    The distribution of heights is kept. Where the spectrum cannot be had together with it, rms
    slope and curvature show it.
    """
    ratios = {
        "rms slope": [one.slope / of_maps.slope for one in of_surfaces],
        "rms curvature": [one.curvature / of_maps.curvature for one in of_surfaces],
        "rms height": [one.rms_height / of_maps.rms_height for one in of_surfaces],
    }
    medians = {name: float(np.median(values)) for name, values in ratios.items()}
    return [
        f"the {name} of surfaces is {ratio:.2f} of the maps': it gives way to the quantiles of"
        " their heights"
        for name, ratio in medians.items()
        if abs(ratio - 1) > GIVES_WAY
    ]
