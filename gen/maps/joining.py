"""Join the power spectra of scans of one surface at different magnifications.

A scan knows the waves of a range: the longest one is a share of its side, the shortest one spans a
few nodes, or is the shortest one that the instrument resolves. Where several scans know a wave, the
joined density is the mean of their densities, weighted with their numbers of waves [1]_. Scans of
one surface agree there within chance. `join` warns of scans that disagree.

References
----------
.. [1] T. D. B. Jacobs, T. Junge, L. Pastewka, Quantitative characterization of surface topography
   using spectral analysis, Surface Topography: Metrology and Properties 5, 013001, 2017.
.. [2] A. Sanner, W. G. Noehring, L. A. Thimons, T. D. B. Jacobs, L. Pastewka, Scale-dependent
   roughness parameters for topography analysis, Applied Surface Science Advances 7, 100190, 2022.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.read import Topography
from gen.maps.texture import (
    MISFIT,
    RadialSpectrum,
    SelfAffineFit,
    fit_spectrum,
    lay_of,
    radial_spectrum,
)
from gen.runtime.documents import Row
from gen.runtime.errors import InputError

# Periods of the longest wave that a scan knows on its shorter side. Levelling takes power out of
# longer waves.
FEWEST_PERIODS = 3.0
# Nodes in the shortest wave that a scan knows. Waves that are too short for the nodes add their
# power to longer ones. On a self-affine surface without a shortest wave this is 5 % at 4 nodes and
# 18 % at 3 nodes for a Hurst exponent of 0.8, and 40 % and 85 % for an exponent of 0.3
# (`pytest tests/gen/maps/test_joining.py -k short_waves`).
FEWEST_NODES = 4.0
BIN_RATIO = 1.2  # ratio of the largest to the smallest wavenumber of a bin
# A tip rounds the summits of which the curvature is above this share of the tip's curvature [2].
TIP_CURVATURE = 0.5
# Two scans disagree if the mean ratio of their densities at common waves is above the factor
# `DISAGREEING`, and its logarithm is above `DEVIATIONS` standard deviations.
DISAGREEING = 1.5
DEVIATIONS = 3.0
# Share of the waves that are independent: the window of a scan mixes neighbouring waves.
INDEPENDENT = 0.5


@dataclass(frozen=True)
class WaveRange:
    """The waves that a scan knows."""

    shortest: float  # shortest wavelength [um]
    longest: float  # longest wavelength [um]
    limit: str  # what limits the shortest wave: "nodes", "resolution" or "tip"

    @property
    def smallest(self) -> float:
        """Smallest wavenumber [1/um]."""
        return 2 * math.pi / self.longest

    @property
    def largest(self) -> float:
        """Largest wavenumber [1/um]."""
        return 2 * math.pi / self.shortest


def wave_range(topography: Topography) -> WaveRange:
    """Return the waves that a scan knows.

    Parameters
    ----------
    topography : Topography
        The prepared scan, without holes.

    Returns
    -------
    WaveRange
        The range. It is empty (`shortest` is above `longest`) for scans of too few nodes, or if the
        instrument resolves no wave of the scan.
    """
    sides = np.multiply(topography.heights.shape, topography.spacing)
    shortest = FEWEST_NODES * max(topography.spacing)
    limit = "nodes"
    resolution = topography.instrument.cut_off
    if resolution is not None and resolution > shortest:
        shortest = resolution
        limit = "resolution"
    radius = topography.instrument.tip_radius
    if radius is not None:
        unrounded = shortest_by_tip(topography.heights, topography.spacing[0], radius)
        if unrounded > shortest:
            shortest = unrounded
            limit = "tip"
    longest = float(sides.min()) / FEWEST_PERIODS
    return WaveRange(shortest=shortest, longest=longest, limit=limit)


def shortest_by_tip(heights: Heights, spacing: float, radius: float) -> float:
    """Return the length of the shortest profiles along x whose summits a tip has not rounded.

    A profile of three equidistant nodes has the curvature of the parabola through them. Longer
    profiles have flatter summits.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um].
    spacing : float
        Distance of the nodes along x [um].
    radius : float
        Radius of the tip [um].

    Returns
    -------
    float
        Smallest length [um] over which the curvature of the sharpest summit is at most
        `TIP_CURVATURE` times that of the tip. It is 0 if three neighbouring nodes have such
        curvatures, and infinite if no length has them.
    """
    reach = 1  # distance of the outer nodes of a profile from its middle [nodes]
    while 2 * reach < len(heights):
        middle = heights[reach:-reach]
        curvatures = heights[2 * reach :] - 2 * middle + heights[: -2 * reach]
        sharpest = -float(curvatures.min()) / (reach * spacing) ** 2
        if sharpest <= TIP_CURVATURE / radius:
            if reach == 1:
                return 0.0
            return 2 * reach * spacing
        # Steps of an eighth take few rounds on large maps.
        reach += max(1, reach // 8)
    return math.inf


@dataclass(frozen=True, eq=False)
class ScanSpectrum:
    """A scan, the waves that it knows, and its spectrum."""

    topography: Topography
    range: WaveRange
    in_range: RadialSpectrum  # in the common bins within the range
    in_all_bins: RadialSpectrum  # in all common bins that contain waves of the scan

    @property
    def name(self) -> str:
        """Name of the scan, the path of its file."""
        return self.topography.name


@dataclass(frozen=True, eq=False)
class JoinedSpectrum:
    """The spectrum of a surface, joined from several scans."""

    scans: tuple[ScanSpectrum, ...]  # from the longest waves to the shortest
    spectrum: RadialSpectrum  # the joined spectrum; bins that no scan knows are left out
    # names of the scans that know each bin, in the order of the bins
    contributors: tuple[tuple[str, ...], ...]
    # a line for each pair of scans that disagree, and for each gap
    warnings: tuple[str, ...]

    @property
    def finest(self) -> ScanSpectrum:
        """The scan that knows the shortest waves."""
        return min(self.scans, key=lambda scan: scan.range.shortest)

    @property
    def rms_height(self) -> float:
        """The rms height of the waves in the spectrum [um]."""
        return math.sqrt(self._integral(power=1))

    @property
    def rms_slope(self) -> float:
        """The rms slope of the waves in the spectrum [1]."""
        return math.sqrt(self._integral(power=3))

    def _integral(self, power: int) -> float:
        """Return the integral of the density times q^power over q in all bins, over 2 pi.

        The powers 1 and 3 give the mean square height [um^2] and the mean square slope [1].
        """
        spectrum = self.spectrum
        first, last = spectrum.edges.T
        ends = power + 1
        weights = (last**ends - first**ends) / (2 * math.pi * ends)
        return float(np.sum(spectrum.density * weights))

    @property
    def fit(self) -> SelfAffineFit | str:
        """The self-affine law of the spectrum, or the reason why there is none."""
        for scan in self.scans:
            lay = lay_of(scan.topography)
            if lay:
                return f"{scan.name}: {lay}"
        return fit_spectrum(self.spectrum, self.rms_height)

    def rows(self) -> list[Row]:
        """Return the table of the spectrum: a row for each bin, with the names of its scans."""
        rows = []
        for row, names in zip(self.spectrum.rows(), self.contributors, strict=True):
            rows.append({**row, "scans": "; ".join(names)})
        return rows


def join(topographies: Sequence[Topography]) -> JoinedSpectrum:
    """Join the spectra of scans of one surface.

    Parameters
    ----------
    topographies : sequence of Topography
        The prepared scans, without holes; at least two.

    Returns
    -------
    JoinedSpectrum
        The spectrum, with warnings of scans that disagree and of waves that no scan knows.

    Raises
    ------
    InputError
        If a scan knows no wave.
    """
    ranges = [wave_range(topography) for topography in topographies]
    for topography, waves in zip(topographies, ranges, strict=True):
        _require_waves(topography, waves)
    smallest = min(waves.smallest for waves in ranges)
    largest = max(waves.largest for waves in ranges)
    number = max(1, round(math.log(largest / smallest) / math.log(BIN_RATIO)))
    ends = np.geomspace(smallest, largest, number + 1)
    scans = [
        ScanSpectrum(
            topography=topography,
            range=waves,
            in_range=radial_spectrum(topography, _ends_in(ends, waves)),
            in_all_bins=radial_spectrum(topography, ends),
        )
        for topography, waves in zip(topographies, ranges, strict=True)
    ]
    scans.sort(key=lambda scan: scan.range.smallest)
    spectrum = _mean_spectrum([scan.in_range for scan in scans])
    contributors = tuple(
        tuple(scan.name for scan in scans if first in scan.in_range.edges[:, 0])
        for first in spectrum.edges[:, 0]
    )
    return JoinedSpectrum(
        scans=tuple(scans),
        spectrum=spectrum,
        contributors=contributors,
        warnings=(*_disagreements(scans), *_gaps(scans)),
    )


def _require_waves(topography: Topography, waves: WaveRange) -> None:
    """Raise InputError if the range of a scan is empty, or the scan is flat."""
    nx, ny = topography.heights.shape
    if waves.shortest * BIN_RATIO > waves.longest:
        raise InputError(
            f"{topography.name}: {nx} x {ny} nodes with waves from {waves.shortest:.3g} um"
            f" ({waves.limit}) to {waves.longest:.3g} um (a third of its side): too few to join"
        )
    if np.ptp(topography.heights) == 0.0:
        raise InputError(f"{topography.name}: all its heights are equal")


def _ends_in(ends: Values, waves: WaveRange) -> Values:
    """Return the ends of the bins that are within a range of waves [1/um]."""
    rounding = 1e-9
    inside = (ends >= waves.smallest * (1 - rounding)) & (
        ends <= waves.largest * (1 + rounding)
    )
    return np.asarray(ends[inside])


def _mean_spectrum(spectra: Sequence[RadialSpectrum]) -> RadialSpectrum:
    """Return the mean of spectra in each bin, weighted with their numbers of waves in the bin."""
    edges = np.unique(np.concatenate([scan.edges for scan in spectra]), axis=0)
    waves = np.stack([_in_bins(edges, scan, scan.waves) for scan in spectra])
    logarithms = [_in_bins(edges, scan, np.log(scan.wavenumbers)) for scan in spectra]
    densities = [_in_bins(edges, scan, scan.density) for scan in spectra]
    along_x = [_in_bins(edges, scan, scan.along_x) for scan in spectra]
    along_y = [_in_bins(edges, scan, scan.along_y) for scan in spectra]
    return RadialSpectrum(
        wavenumbers=np.exp(_weighted_mean(np.stack(logarithms), waves)),
        edges=edges,
        density=_weighted_mean(np.stack(densities), waves),
        waves=waves.sum(axis=0),
        along_x=_weighted_mean(np.stack(along_x), waves),
        along_y=_weighted_mean(np.stack(along_y), waves),
    )


def _in_bins(edges: Values, spectrum: RadialSpectrum, values: Values) -> Values:
    """Return a value for each bin of `edges`: 0 in the bins that the spectrum does not have."""
    table = np.zeros(len(edges))
    table[np.searchsorted(edges[:, 0], spectrum.edges[:, 0])] = values
    return table


def _weighted_mean(tables: Values, waves: Values) -> Values:
    """Return means over scans, weighted with their numbers of waves; shape (bins,).

    Both arrays have the shape (scans, bins). The mean leaves out values that are NaN. It is NaN in
    a bin where no scan has a value.
    """
    weights = np.where(np.isnan(tables), 0.0, waves)
    with np.errstate(invalid="ignore"):  # 0 / 0 in bins without values
        return np.asarray(
            np.sum(weights * np.nan_to_num(tables), axis=0) / weights.sum(axis=0)
        )


def _disagreements(scans: Sequence[ScanSpectrum]) -> list[str]:
    """Return a line for each pair of scans whose densities differ where both know the waves."""
    lines = []
    for coarse, fine in combinations(scans, 2):
        ratio = _disagreeing_ratio(coarse.in_range, fine.in_range)
        if ratio is None:
            continue
        factor = max(ratio, 1 / ratio)
        first = max(coarse.range.shortest, fine.range.shortest)
        last = min(coarse.range.longest, fine.range.longest)
        lines.append(
            f"{coarse.name} and {fine.name} disagree by a factor of {factor:.2g} in waves of"
            f" {first:.3g} to {last:.3g} um, which both know: scans of one surface, prepared"
            " alike?"
        )
    return lines


def _disagreeing_ratio(coarse: RadialSpectrum, fine: RadialSpectrum) -> float | None:
    """Return the mean ratio of the densities of two scans if they disagree, otherwise None.

    Scans without a common bin do not disagree.
    """
    common, places, places_of_fine = np.intersect1d(
        coarse.edges[:, 0], fine.edges[:, 0], return_indices=True
    )
    if common.size == 0:
        return None
    logarithms = np.log(fine.density[places_of_fine] / coarse.density[places])
    independent = INDEPENDENT * coarse.waves[places]
    independent_of_fine = INDEPENDENT * fine.waves[places_of_fine]
    # The logarithm of a mean over n independent waves has the variance 1 / n.
    variances = 1 / independent + 1 / independent_of_fine + 2 * MISFIT**2
    weights = 1 / variances
    mean = float(np.average(logarithms, weights=weights))
    deviation = float(1 / np.sqrt(weights.sum()))
    if abs(mean) <= max(math.log(DISAGREEING), DEVIATIONS * deviation):
        return None
    return math.exp(mean)


def _gaps(scans: Sequence[ScanSpectrum]) -> list[str]:
    """Return a line for each gap: waves that no scan knows between the ranges of two scans."""
    lines = []
    shortest = scans[0].range.shortest
    for scan in scans[1:]:
        if scan.range.longest < shortest:
            lines.append(
                f"no scan knows waves of {scan.range.longest:.3g} to {shortest:.3g} um: the"
                " spectrum has a gap"
            )
        shortest = min(shortest, scan.range.shortest)
    return lines
