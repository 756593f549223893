"""Fit a population to maps: its spectrum, its distribution of heights, and its imperfections.

Imperfections of the maps are separated first, see `gen.draft.imperfections`. A map without its
imperfections is its texture. A translation field, see `gen.population`, is fitted to the textures
in three steps:

- The curve from normal scores to heights follows from the textures' heights or from their slopes,
  see `gen.draft.height_curve`. The contact chooses, see `gen.draft.curve_choice`.
- The target spectrum of the surfaces is that of the textures in bands. It is corrected until rms
  slopes along both axes and rms curvature, over the rms height, are those of the textures.
- The spectrum of the Gaussian field follows from both. The Hermite polynomials of the curve
  determine how it distorts the autocorrelation of the field [1]_, so that the spectrum of the
  surfaces is computed without making one. In each round the field's spectrum is multiplied in each
  band by a power of the ratio of the target spectrum to that of the surfaces [2]_.

Some combinations of curve and spectrum are not possible. The population's remarks name the rms
values of its surfaces that are not those of the maps.

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
    MOST_OF_A_ROUND,
    BandSpectrum,
    WaveBands,
    WaveGrid,
    leaked,
    log_means,
    periodogram,
    smoothed,
    with_means,
)
from gen.draft.curve_choice import nearest_population
from gen.draft.height_curve import HeightCurve
from gen.draft.imperfections import MOST_HEIGHTS, separate_imperfections
from gen.draft.joined import join_in_bands
from gen.draft.likeness import rounded
from gen.draft.parts import with_parts
from gen.draft.proposal import common_spacing, nodes_like, with_chosen_steps
from gen.draft.survey import MapSurvey, measure, require_usable, survey_maps
from gen.maps.filters import is_same
from gen.maps.joining import JoinedSpectrum, join
from gen.maps.read import Topography, spacing_text
from gen.maps.settings import Reading
from gen.maps.texture import nodes_a_wave, radial_spectrum
from gen.population import FORMAT, Population, SourceMap, generate_like
from gen.runtime.errors import InputError
from gen.runtime.files import digest

FEWEST_NODES = 16  # nodes along the shorter side of a map to which a population is fitted

# Waves with at most about this number of periods on a side of the map are long ones. Their power is
# less certain than that of shorter waves, because a map holds few of them.
PERIODS_OF_LONG = 3.0
# largest factor by which the power of long waves is corrected
MOST_FOR_LONG = 4.0
MOST_FOR_SHORT = 3.0  # largest logarithm of a factor of the shortest waves
STEEPEST = 3.0  # largest exponent of the wavenumber by which the spectrum is corrected
MOST_DIRECTIONAL = 6.0  # largest exponent of a factor that differs along x and y

ROUNDS_OF_FIELD = 20  # number of corrections of the Gaussian field's spectrum
DAMPING = 0.7  # exponent of the ratio of spectra in one of these corrections
CORRELATIONS = 8001  # number of correlations at which the covariance is tabulated
# number of corrections of the target spectrum by the maps' roughness
ROUNDS_OF_ROUGHNESS = 3
# smallest logarithm of a density of the field over the largest one
SMALLEST_LOGARITHM = -60.0

COMPARED = 4  # number of surfaces that are compared with the maps
# largest relative difference between surfaces and maps without a remark
WITHOUT_REMARK = 0.1


@dataclass(frozen=True, eq=False)
class FittedMap:
    """A prepared map, and where it comes from."""

    topography: Topography
    sha256: str  # hash of the content of the map's file


@dataclass(frozen=True)
class Roughness:
    """Rms values of surfaces, which a population is to share with its maps."""

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
            The root mean squares.
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
    maps: list[FittedMap]  # the maps by which the population is judged
    population: Population
    nodes: int  # nodes along each side of the surfaces of a scene
    # the joined spectrum of scans of one surface; None for maps of one kind
    joined: JoinedSpectrum | None = None

    @property
    def scales(self) -> tuple[float, float]:
        """Smallest and largest rms height of the maps over their median [1]."""
        rms_heights = [source.rms_height for source in self.population.maps]
        median = self.median_rms_height
        return min(rms_heights) / median, max(rms_heights) / median

    @property
    def median_rms_height(self) -> float:
        """Median of the rms heights of the maps [um].

        It is the rms height of a population that is fitted to maps of one kind.
        """
        return float(np.median([source.rms_height for source in self.population.maps]))


def propose_population(paths: Sequence[Path], reading: Reading) -> LikeMaps:
    """Read and prepare maps of one kind, and fit a population to them.

    Parameters
    ----------
    paths : sequence of Path
        Files of the maps, at least one.
    reading : Reading
        Unit, lengths and channel, if the files do not determine them. Steps of the preparation
        that it lacks are chosen for the maps.

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
    prepared = [_prepared(survey, reading, spacing) for survey in surveys]
    maps = [prepared_map.fitted_map for prepared_map in prepared]
    topography = maps[0].topography
    lengths = _autocorrelation_lengths(prepared)
    length = float(np.median(lengths)) if lengths else math.nan
    shape = _shape(topography.heights)
    nodes = nodes_like(shape, length / max(topography.spacing))
    population = fit_population(maps, "; ".join(topography.steps), nodes)
    return LikeMaps(
        surveys=[prepared_map.survey for prepared_map in prepared],
        reading=reading,
        maps=maps,
        population=population,
        nodes=nodes,
    )


def propose_joined(paths: Sequence[Path], reading: Reading) -> LikeMaps:
    """Read and prepare scans of one surface, and fit a population to their joined spectrum.

    Parameters
    ----------
    paths : sequence of Path
        Files of the scans, at least two.
    reading : Reading
        Unit, lengths and channel, if the files do not determine them. Steps of the preparation
        that it lacks are chosen for each scan.

    Returns
    -------
    LikeMaps
        The population. Its only map in `maps` is the scan with the shortest waves.

    Raises
    ------
    InputError
        If a scan cannot be used, or no population can be fitted.
    """
    scans = []
    for survey in survey_maps(paths, reading):
        require_usable([survey])
        scans.append(_prepared(survey, with_chosen_steps(reading, [survey])))
    joined = join([scan.fitted_map.topography for scan in scans])
    [finest] = [
        scan for scan in scans if scan.fitted_map.topography is joined.finest.topography
    ]
    population = fit_joined([scan.fitted_map for scan in scans], joined)
    length = max(_autocorrelation_lengths(scans), default=math.nan)
    return LikeMaps(
        surveys=[scan.survey for scan in scans],
        reading=finest.reading,
        maps=[finest.fitted_map],
        population=population,
        nodes=nodes_like(population.nodes, length / max(population.spacing)),
        joined=joined,
    )


@dataclass(frozen=True, eq=False)
class _PreparedMap:
    """A map that is prepared for a population."""

    survey: MapSurvey  # survey of the prepared map
    reading: Reading  # how the map was read and prepared
    fitted_map: FittedMap


def _prepared(
    survey: MapSurvey, reading: Reading, spacing: float | None = None
) -> _PreparedMap:
    """Read and prepare a map; resample it to a spacing [um] if there is one.

    InputError if the prepared map cannot be used.
    """
    measured = measure(survey, reading, spacing)
    if measured.topography is None:
        raise InputError(f"no map can be used: {survey.path}: {measured.survey.fault}")
    return _PreparedMap(
        survey=measured.survey,
        reading=reading,
        fitted_map=FittedMap(measured.topography, digest(survey.path)),
    )


def _autocorrelation_lengths(maps: Sequence[_PreparedMap]) -> list[float]:
    """Return the autocorrelation lengths of the maps of which they are known [um]."""
    lengths = [prepared_map.survey.length for prepared_map in maps]
    return [length for length in lengths if not math.isnan(length)]


def fit_joined(maps: Sequence[FittedMap], joined: JoinedSpectrum) -> Population:
    """Fit a population to the joined spectrum of scans of one surface.

    The distribution of heights is that of the scan with the longest waves, and the rms height is
    that of all waves of the spectrum. Imperfections are not separated.

    Parameters
    ----------
    maps : sequence of FittedMap
        The scans.
    joined : JoinedSpectrum
        Their joined spectrum.

    Returns
    -------
    Population
        The population, at the spacing of the scan with the shortest waves.
    """
    spectrum = join_in_bands(joined)
    widest = joined.scans[0].topography.heights
    curve = HeightCurve.by_quantiles([(widest - widest.mean()) / widest.std()])
    target = _TargetSpectrum(
        grid=spectrum.grid,
        bands=spectrum.bands,
        logarithms=spectrum.logarithms,
        is_windowed=False,
    ).with_variance(curve.variance)
    finest = joined.finest.topography
    finest_maps = [fitted_map for fitted_map in maps if fitted_map.topography is finest]
    preparations = []
    for fitted_map in maps:
        topography = fitted_map.topography
        steps = "; ".join(topography.steps)
        preparations.append(f"{Path(topography.name).name}: {steps}")
    return _population(
        maps=maps,
        preparation=" | ".join(preparations),
        shortest=_shortest_wave(finest_maps),
        target=target,
        curve=curve,
        rms_height=spectrum.rms_height,
        imperfections=(),
        remarks=(*joined.warnings, *spectrum.remarks),
    )


def fit_population(
    maps: Sequence[FittedMap], preparation: str, nodes: int | None = None
) -> Population:
    """Fit a population to maps of one kind.

    The heights of each map are divided by its rms height. The rms height of the population is the
    median of the maps' rms heights.

    Parameters
    ----------
    maps : sequence of FittedMap
        The maps, at least one.
    preparation : str
        How the maps were prepared, for the population's file.
    nodes : int, optional
        Nodes along each side of the patches of a scene. If the maps differ from place to place, the
        population has parts of this size, see `gen.draft.parts`.

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
    heights_of_maps = [fitted_map.topography.heights for fitted_map in maps]
    spacing = maps[0].topography.spacing
    rms_heights = [float(heights.std()) for heights in heights_of_maps]
    rms_height = float(np.median(rms_heights))
    most_heights = MOST_HEIGHTS // len(maps)
    separated = [
        separate_imperfections(heights, spacing, most_heights)
        for heights in heights_of_maps
    ]
    textures = [
        (separated_map.texture - separated_map.texture.mean()) / rms_height_of_map
        for separated_map, rms_height_of_map in zip(separated, rms_heights, strict=True)
    ]
    shape = max((texture.shape for texture in textures), key=math.prod)
    grid = WaveGrid(shape=shape, spacing=spacing)
    target = _target_spectrum(textures, grid)
    imperfections = tuple(
        _heights_in_rows(imperfection / rms_height_of_map * rms_height)
        for separated_map, rms_height_of_map in zip(separated, rms_heights, strict=True)
        for imperfection in separated_map.imperfections
    )
    curves = [HeightCurve.by_quantiles(textures)]
    by_slopes = HeightCurve.by_slopes(textures, spacing)
    if by_slopes is not None and by_slopes.has_bearing_heights_of(curves[0]):
        curves.append(by_slopes)
    populations = [
        _population(
            maps=maps,
            preparation=preparation,
            shortest=_shortest_wave(maps),
            target=target.with_variance(curve.variance),
            curve=curve,
            rms_height=rms_height,
            imperfections=imperfections,
            remarks=(),
        )
        for curve in curves
    ]
    scaled_maps = [
        heights * (rms_height / rms_height_of_map)
        for heights, rms_height_of_map in zip(heights_of_maps, rms_heights, strict=True)
    ]
    population = nearest_population(populations, scaled_maps)
    of_maps = Roughness.of(scaled_maps, spacing)
    remarks = _remarks_on_roughness(population, shape, of_maps)
    population = replace(population, remarks=tuple(remarks))
    if nodes is None:
        return population
    return with_parts(population, [rms_height * texture for texture in textures], nodes)


def _population(
    *,
    maps: Sequence[FittedMap],
    preparation: str,
    shortest: float,
    target: _TargetSpectrum,
    curve: HeightCurve,
    rms_height: float,
    imperfections: tuple[tuple[tuple[float, ...], ...], ...],
    remarks: tuple[str, ...],
) -> Population:
    """Return the population whose surfaces have a target spectrum and a curve of heights.

    Heights of `target` and `curve` have no unit; times `rms_height` [um] they are in um. `shortest`
    is the shortest wavelength that carries roughness [um], and imperfections are in um.
    """
    field = _spectrum_of_field(target, curve)
    bands_x, bands_y = target.bands.middles
    dx, dy = target.grid.spacing
    return Population(
        format=FORMAT,
        maps=tuple(
            SourceMap(
                name=Path(fitted_map.topography.name).name,
                sha256=fitted_map.sha256,
                nodes=_shape(fitted_map.topography.heights),
                rms_height=float(fitted_map.topography.heights.std()),
            )
            for fitted_map in maps
        ),
        preparation=preparation,
        spacing=(float(dx), float(dy)),
        shortest=shortest,
        remarks=remarks,
        bands_x=_rounded(bands_x, 12),
        bands_y=_rounded(bands_y, 12),
        logarithms=(_rows(field[0]), _rows(field[1])),
        scores=_rounded(curve.scores, 6),
        heights=_rounded(curve.heights * rms_height, 9),
        imperfections=imperfections,
    )


def _require_fitting(maps: Sequence[FittedMap]) -> None:
    """Raise InputError unless a population can be fitted to the maps."""
    first = maps[0].topography
    for fitted_map in maps:
        topography = fitted_map.topography
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
        spacings = zip(topography.spacing, first.spacing, strict=True)
        if not all(is_same(spacing, of_first) for spacing, of_first in spacings):
            raise InputError(
                f"{topography.name}: a node every {spacing_text(topography.spacing)} um,"
                f" {first.name} has one every {spacing_text(first.spacing)}: maps of one kind"
                " share their spacing"
            )


def _shape(heights: Heights) -> tuple[int, int]:
    """Return the nodes of a map along x and y."""
    nx, ny = heights.shape
    return nx, ny


def _heights_in_rows(heights: Heights) -> tuple[tuple[float, ...], ...]:
    """Return the rows of heights [um], to four significant digits of the largest."""
    largest = float(np.abs(heights).max())
    decimals = 3 - math.floor(math.log10(largest)) if largest > 0 else 0
    return tuple(tuple(row) for row in np.round(heights, decimals).tolist())


def _rounded(values: Values, digits: int) -> tuple[float, ...]:
    """Return numbers with a number of significant digits: a file needs no more."""
    return tuple(rounded(value, digits) for value in values)


def _rows(table: Values) -> tuple[tuple[float, ...], ...]:
    """Return the rows of a table of logarithms, to three decimals: densities to 0.05 %."""
    return tuple(tuple(round(float(value), 3) for value in row) for row in table)


def _shortest_wave(maps: Sequence[FittedMap]) -> float:
    """Return the shortest wavelength that carries roughness, in the finest of the maps [um]."""
    lengths = []
    for fitted_map in maps:
        topography = fitted_map.topography
        nodes = nodes_a_wave(radial_spectrum(topography), topography.spacing)
        if math.isnan(nodes):  # not known: the shortest wave of the grid is taken
            nodes = 2.0
        lengths.append(nodes * max(topography.spacing))
    return rounded(min(lengths), 4)


@dataclass(frozen=True, eq=False)
class _TargetSpectrum:
    """The spectrum that the heights of surfaces over an rms height are to have."""

    grid: WaveGrid
    bands: WaveBands
    logarithms: Values  # logarithms of the density in bands [um^2]
    # whether it is a spectrum through a Hann window as long as the period, as periodograms are,
    # which leaks power to neighbouring waves
    is_windowed: bool

    def with_variance(self, variance: float) -> _TargetSpectrum:
        """Return the spectrum times the factor that gives the heights a variance [1]."""
        total = self.grid.total(self.bands.spread(self.grid, self.logarithms))
        return replace(self, logarithms=self.logarithms + math.log(variance / total))


def _target_spectrum(textures: Sequence[Heights], grid: WaveGrid) -> _TargetSpectrum:
    """Return the target spectrum for textures of maps, of unit variance.

    Its form follows from the textures' periodograms. It is then corrected until rms slopes and rms
    curvature, over the rms height, are those of the textures, which are measured without a window.
    """
    bands = WaveBands.of(grid)
    spectrum = _mean_spectrum(textures, grid, bands)
    roughness = Roughness.of(textures, grid.spacing)
    correction = _Correction(
        grid=grid,
        bands=bands,
        logarithms=with_means(bands, grid, smoothed(spectrum)),
        direction=_log_ratio(roughness.slope_x**2, roughness.slope_y**2),
        steepness=_log_ratio(roughness.slope**2, roughness.rms_height**2),
        sharpness=_log_ratio(roughness.curvature**2, roughness.slope**2),
    )
    target = _TargetSpectrum(
        grid=grid, bands=bands, logarithms=correction.corrected(), is_windowed=True
    )
    return target.with_variance(1.0)


def _mean_spectrum(
    textures: Sequence[Heights], grid: WaveGrid, bands: WaveBands
) -> BandSpectrum:
    """Return the mean spectrum of maps in bands.

    The weight of a map in a band is the number of its waves there.
    """
    powers = np.zeros(bands.shape)
    waves = np.zeros(bands.shape)
    for texture in textures:
        of_map = WaveGrid(shape=_shape(texture), spacing=grid.spacing)
        spectrum = bands.means(of_map, periodogram(texture, of_map))
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
    """Correction of a spectrum in bands by the roughness of maps, measured without a window."""

    grid: WaveGrid
    bands: WaveBands
    logarithms: Values  # logarithms of the spectrum in bands
    # wanted logarithm of the mean square slope along x over that along y; NaN if one of them is 0
    direction: float
    # wanted logarithm of the mean square slope over the variance of the heights [1/um^2]
    steepness: float
    # wanted logarithm of the mean square curvature over the mean square slope [1/um^2]
    sharpness: float

    def corrected(self) -> Values:
        """Return the logarithms with wanted direction, steepness and sharpness if possible.

        Four changes follow each other: of the power of waves along x against that of waves along
        y; of the power of long waves, which the window changes most; of the power of all waves by
        a power of their wavenumber; and of the power of short waves, for the curvature. A few
        rounds are enough, because a change hardly undoes the other three.
        """
        bands_x, bands_y = self.bands.middles
        # number of periods of a band's waves on the map, along their wavevector
        periods = np.hypot(
            (bands_x / bands_x[1])[:, None], (bands_y / bands_y[1])[None, :]
        )
        # Multiples of the following four patterns are added to the logarithms.
        long_waves = 1 / (1 + (periods / PERIODS_OF_LONG) ** 4)
        qx = np.maximum(bands_x, bands_x[1] / 2)[:, None]
        qy = np.maximum(bands_y, bands_y[1] / 2)[None, :]
        along_x = (qx**2 - qy**2) / (qx**2 + qy**2) * (1 - long_waves)
        log_periods = np.log(np.maximum(periods, 1.0))
        short_waves = qx**2 / qx.max() ** 2 + qy**2 / qy.max() ** 2
        logarithms = self.logarithms
        for _ in range(ROUNDS_OF_ROUGHNESS):
            if not math.isnan(self.direction):
                logarithms = self._with_multiple(
                    logarithms, along_x, MOST_DIRECTIONAL, self._direction_fault
                )
            logarithms = self._with_multiple(
                logarithms, long_waves, math.log(MOST_FOR_LONG), self._steepness_fault
            )
            logarithms = self._with_multiple(
                logarithms, log_periods, STEEPEST, self._steepness_fault
            )
            logarithms = self._with_multiple(
                logarithms, short_waves, MOST_FOR_SHORT, self._sharpness_fault
            )
        return logarithms

    def _with_multiple(
        self,
        logarithms: Values,
        pattern: Values,
        most: float,
        fault: Callable[[Values], float],
    ) -> Values:
        """Add a multiple of a pattern to logarithms, so that a fault becomes 0.

        The multiple is between -most and most. If no such multiple makes the fault 0, it is the one
        of -most, 0 and most at which the size of the fault is smallest.
        """
        from scipy.optimize import brentq

        def fault_of(multiple: float) -> float:
            """Return the fault after a multiple of the pattern is added."""
            return fault(logarithms + multiple * pattern)

        fault_of_lowest = fault_of(-most)
        fault_of_highest = fault_of(most)
        if fault_of_lowest * fault_of_highest < 0:
            multiple = float(brentq(fault_of, -most, most, xtol=1e-4))
        else:
            multiple = most
            if abs(fault_of_lowest) < abs(fault_of_highest):
                multiple = -most
            if abs(fault_of(0.0)) <= min(abs(fault_of_lowest), abs(fault_of_highest)):
                multiple = 0.0
        return logarithms + multiple * pattern

    def _direction_fault(self, logarithms: Values) -> float:
        """Return the excess of a spectrum's direction, see `direction`, over the wanted one."""
        densities = self.bands.spread(self.grid, logarithms)
        along_x = self.grid.total(densities * self.grid.slopes_x)
        along_y = self.grid.total(densities * self.grid.slopes_y)
        return _log_ratio(along_x, along_y) - self.direction

    def _steepness_fault(self, logarithms: Values) -> float:
        """Return the excess of a spectrum's steepness, see `steepness`, over the wanted one."""
        densities = self.bands.spread(self.grid, logarithms)
        slopes = self.grid.slopes_x + self.grid.slopes_y
        slope = self.grid.total(densities * slopes)
        return _log_ratio(slope, self.grid.total(densities)) - self.steepness

    def _sharpness_fault(self, logarithms: Values) -> float:
        """Return the excess of a spectrum's sharpness, see `sharpness`, over the wanted one."""
        densities = self.bands.spread(self.grid, logarithms)
        curvatures = self.grid.slopes_x**2 + self.grid.slopes_y**2
        slopes = self.grid.slopes_x + self.grid.slopes_y
        curvature = self.grid.total(densities * curvatures)
        slope = self.grid.total(densities * slopes)
        return _log_ratio(curvature, slope) - self.sharpness


def _spectrum_of_field(target: _TargetSpectrum, curve: HeightCurve) -> Values:
    """Return logarithms of the Gaussian field's spectrum in bands, the largest one being 0.

    In each round the mean spectrum of the surfaces follows from the field's autocorrelation. If the
    target spectrum is one through a window, so is the one that is compared with it.
    """
    from scipy import fft

    grid = target.grid
    bands = target.bands
    correlations = np.linspace(-1, 1, CORRELATIONS)
    covariances = np.polynomial.polynomial.polyval(correlations, curve.hermite_powers)
    covariances -= curve.hermite_powers[0]
    target_means = log_means(bands.means(grid, bands.spread(grid, target.logarithms)))
    field = target.logarithms.copy()
    for _ in range(ROUNDS_OF_FIELD):
        densities = bands.spread(grid, field)
        correlation = fft.irfft2(densities, s=grid.shape)
        correlation /= correlation[0, 0]
        covariance = np.interp(correlation, correlations, covariances)
        spectrum = fft.rfft2(covariance).real * math.prod(grid.spacing)
        np.maximum(spectrum, 0.0, out=spectrum)
        spectrum[0, 0] = 0.0
        if target.is_windowed:
            spectrum = leaked(spectrum)
        lacking = target_means - log_means(bands.means(grid, spectrum))
        field += DAMPING * np.clip(lacking, -MOST_OF_A_ROUND, MOST_OF_A_ROUND)
        field = np.maximum(field, field.max() + SMALLEST_LOGARITHM)
    return np.asarray(field - field.max())


def _remarks_on_roughness(
    population: Population, shape: tuple[int, int], of_maps: Roughness
) -> list[str]:
    """Return sentences on rms values of a population's surfaces that are not those of the maps.

    Surfaces always have the distribution of heights of the population. If its spectrum is not
    possible together with it, rms values differ. They are compared on a few surfaces with the nodes
    `shape`.
    """
    of_surfaces = []
    for seed in range(COMPARED):
        random = np.random.default_rng([COMPARED, seed])
        surface = generate_like(population, shape, shape, random)
        of_surfaces.append(Roughness.of([surface], population.spacing))
    ratios = {
        "rms slope": [rough.slope / of_maps.slope for rough in of_surfaces],
        "rms curvature": [rough.curvature / of_maps.curvature for rough in of_surfaces],
        "rms height": [rough.rms_height / of_maps.rms_height for rough in of_surfaces],
    }
    medians = {name: float(np.median(values)) for name, values in ratios.items()}
    return [
        f"the {name} of surfaces is {ratio:.2f} of the maps': it gives way to the quantiles of"
        " their heights"
        for name, ratio in medians.items()
        if abs(ratio - 1) > WITHOUT_REMARK
    ]
