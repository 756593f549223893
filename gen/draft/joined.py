"""The directional spectrum of a surface in bands, joined from scans at different magnifications.

`gen.maps.joining` determines which waves each scan knows. The densities of longer waves are those
of the scan with the longest waves, and the densities of shorter waves those of the finest scan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gen.arrays import Heights, Values
from gen.draft.bands import WaveBands, WaveGrid, periodogram, smoothed, with_means
from gen.maps.joining import JoinedSpectrum, ScanSpectrum
from gen.maps.texture import RadialSpectrum
from gen.population import Population, densities_at, generate_like

# Largest number of nodes along each side of the period of a joined population. Longer waves are
# left out.
MOST_NODES = 1024
# Largest number of nodes along each side of a surface that is made for the comparison with a scan.
MOST_NODES_OF_A_SCAN = 2048
ROUNDS = 3  # number of corrections of the spectrum by the joined radial spectrum


@dataclass(frozen=True, eq=False)
class JoinedBands:
    """A joined spectrum in bands of the waves of a period."""

    grid: WaveGrid  # the waves of the period, at the spacing of the finest scan
    bands: WaveBands
    logarithms: Values  # logarithms of the density in the bands [um^4]
    longest: float  # longest wave that the scans know [um]

    @property
    def rms_height(self) -> float:
        """The rms height of surfaces of one period with this spectrum [um]."""
        densities = self.bands.spread(self.grid, self.logarithms)
        return math.sqrt(self.grid.total(densities))

    @property
    def remarks(self) -> list[str]:
        """A list with one sentence if the scans know waves longer than the period, else empty."""
        sides = np.multiply(self.grid.shape, self.grid.spacing)
        period = float(sides.min())
        if self.longest <= period:
            return []
        sentence = (
            f"waves of {period:.3g} to {self.longest:.3g} um are left out: a surface with the"
            f" finest scan's spacing would need more than {MOST_NODES} nodes a side"
        )
        return [sentence]


def join_in_bands(joined: JoinedSpectrum) -> JoinedBands:
    """Join the directional spectra of scans.

    The mean of the result over all directions is the joined radial spectrum.

    Parameters
    ----------
    joined : JoinedSpectrum
        The scans, with the waves that they know.

    Returns
    -------
    JoinedBands
        The spectrum.
    """
    scans = joined.scans
    finest = joined.finest.topography
    spacing = finest.spacing
    longest = scans[0].range.longest
    nodes_x, nodes_y = (
        min(MOST_NODES, max(nodes, round(longest / step)))
        for nodes, step in zip(finest.heights.shape, spacing, strict=True)
    )
    grid = WaveGrid(shape=(nodes_x, nodes_y), spacing=spacing)
    bands = WaveBands.of(grid)
    middles_x, middles_y = bands.middles
    wavenumbers = np.hypot(middles_x[:, None], middles_y[None, :])
    weighted = np.zeros(bands.shape)
    weights = np.zeros(bands.shape[1:])
    for scan, weight in zip(scans, _weights(joined, wavenumbers), strict=True):
        weighted += weight * _logarithms_at(scan, middles_x, middles_y)
        weights += weight
    logarithms = weighted / weights
    for _ in range(ROUNDS):
        correction = _correction(joined.spectrum, grid, bands.spread(grid, logarithms))
        logarithms += correction.at(wavenumbers)
    return JoinedBands(grid=grid, bands=bands, logarithms=logarithms, longest=longest)


@dataclass(frozen=True, eq=False)
class _RadialCorrection:
    """A factor by which a directional spectrum is corrected, as a function of the wavenumber."""

    wavenumbers: Values  # rising, shape (bins,) [1/um]
    logarithms: Values  # logarithms of the factor at them, shape (bins,)

    def at(self, wavenumbers: Values) -> Values:
        """Interpolate the logarithm at wavenumbers [1/um]; beyond the ends it is constant."""
        positive = np.maximum(wavenumbers, self.wavenumbers[0])
        logarithms = np.interp(
            np.log(positive), np.log(self.wavenumbers), self.logarithms
        )
        return np.asarray(logarithms)


def _correction(
    spectrum: RadialSpectrum, grid: WaveGrid, densities: Values
) -> _RadialCorrection:
    """Return the ratio of a radial spectrum to the mean of densities over all directions.

    The densities are those of all waves of the grid, shape (nx, ny // 2 + 1) [um^4].
    """
    wavenumbers = np.hypot(grid.qx[:, None], grid.qy[None, :])
    first, last = spectrum.edges.T
    bins = np.searchsorted(first, wavenumbers, side="right") - 1
    inside = (bins >= 0) & (wavenumbers < last[bins]) & (densities > 0)
    counts = np.bincount(bins[inside], minlength=first.size)
    sums = np.bincount(bins[inside], densities[inside], first.size)
    occupied = counts > 0
    means = sums[occupied] / counts[occupied]
    return _RadialCorrection(
        wavenumbers=spectrum.wavenumbers[occupied],
        logarithms=np.log(spectrum.density[occupied] / means),
    )


def _weights(joined: JoinedSpectrum, wavenumbers: Values) -> list[Values]:
    """Return the weight of each scan at wavenumbers: its area where it knows the waves, else 0.

    The area is the weight, because the number of waves between two wavenumbers is proportional to
    it. In a gap between two scans, the scan with the shorter waves has its area as weight.
    """
    weights = []
    shortest_before = math.inf  # shortest wave of the scans with longer waves [um]
    for scan in joined.scans:
        smallest = scan.range.smallest
        largest = scan.range.largest
        if math.isinf(shortest_before):
            smallest = 0.0
        elif shortest_before > scan.range.longest:
            smallest = 2 * math.pi / shortest_before
        if scan is joined.finest:
            largest = math.inf
        inside = (wavenumbers >= smallest) & (wavenumbers < largest)
        area = math.prod(scan.topography.sides)
        weights.append(np.where(inside, area, 0.0))
        shortest_before = min(shortest_before, scan.range.shortest)
    return weights


def _logarithms_at(scan: ScanSpectrum, qx: Values, qy: Values) -> Values:
    """Return the logarithms of a scan's smoothed spectrum at other bands than its own [um^4].

    `qx` and `qy` are the middles of these bands [1/um]. The result is a table over them, of the
    shape (2, bands along x, bands along y).
    """
    topography = scan.topography
    nx, ny = topography.heights.shape
    grid = WaveGrid(shape=(nx, ny), spacing=topography.spacing)
    bands = WaveBands.of(grid)
    spectrum = bands.means(grid, periodogram(topography.heights, grid))
    logarithms = with_means(bands, grid, smoothed(spectrum))
    # For the two parts of the table: components of equal and of opposite signs.
    along_x = np.concatenate((qx, -qx))
    densities = densities_at(logarithms, bands.middles, along_x, qy)
    # `densities_at` returns 0 for the mean of heights, whose logarithm would be infinite.
    densities[np.ix_(along_x == 0, qy == 0)] = math.exp(logarithms[0, 0, 0])
    return np.log(densities).reshape(2, qx.size, qy.size)


def judged_scan(joined: JoinedSpectrum) -> ScanSpectrum:
    """Return the widest scan of whose size a surface can be made at the spacing of the finest scan.

    Parameters
    ----------
    joined : JoinedSpectrum
        The scans.

    Returns
    -------
    ScanSpectrum
        The scan; the finest one if surfaces of the size of any other would have too many nodes.
    """
    finest = joined.finest
    for scan in joined.scans:
        nodes = np.divide(scan.topography.sides, finest.topography.spacing)
        if nodes.max() <= MOST_NODES_OF_A_SCAN:
            return scan
    return finest


def surface_at_nodes(
    population: Population,
    shape: tuple[int, int],
    spacing: tuple[float, float],
    random: np.random.Generator,
) -> Heights:
    """Make a surface of a population and take its heights at nodes with another spacing.

    Between nodes of the population's spacing, heights are interpolated linearly.

    Parameters
    ----------
    population : Population
        The population.
    shape : tuple of int
        Nodes of the result along x and y.
    spacing : tuple of float
        Distance of these nodes along x and y [um].
    random : numpy.random.Generator
        Source of the surface. The call moves its state.

    Returns
    -------
    ndarray, shape `shape`
        Heights [um].
    """
    positions_x, positions_y = (
        np.arange(float(nodes)) * (step / fine_step)
        for nodes, step, fine_step in zip(shape, spacing, population.spacing, strict=True)
    )
    nodes_x, nodes_y = population.nodes
    # Heights at the last position are interpolated between the two nodes around it.
    fine_x = int(positions_x[-1]) + 2
    fine_y = int(positions_y[-1]) + 2
    period = (max(fine_x, nodes_x), max(fine_y, nodes_y))
    surface = generate_like(population, (fine_x, fine_y), period, random)
    along_x = _at_positions(surface, positions_x)
    return _at_positions(along_x.T, positions_y).T


def _at_positions(heights: Heights, positions: Values) -> Heights:
    """Interpolate heights [um] linearly at positions along x, which are counted in nodes."""
    below = positions.astype(np.int64)
    share = (positions - below)[:, None]
    return np.asarray((1 - share) * heights[below] + share * heights[below + 1])
