"""Rough surfaces from a power spectrum: self-affine, periodic, with random phases."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from gen.arrays import Heights, Values
from gen.distribution import AboveZero, AtLeastZero, conflict, limits
from gen.runtime.errors import InputError
from gen.surface import (
    MOST_NODES,
    Drawn,
    Grid,
    GridSurface,
    Hurst,
    Parameters,
    Random,
    pair,
)

# largest roll-off over the longest wave, beyond which its powers overflow
FARTHEST = 1e30
MOST_PERIOD_NODES = 4 * MOST_NODES  # of a period along an axis, whose waves take 10 GB

ROUNDING = 1e-12  # share by which a wave may be beyond the cut-off because of rounding


@dataclass(frozen=True)
class SelfAffineSpectrum:
    """Shape of a power spectrum: flat, then a power law, then nothing.

    The spectral density is constant up to the roll-off, falls as q^(-2 - 2 hurst) up to the
    cut-off and is zero beyond.

    Attributes
    ----------
    hurst : float
        Hurst exponent, from 0 to 1.
    roll_off : float
        Longest wavelength of the power law [um]; with one beyond the surface's side the spectrum
        has no flat part.
    cut_off : float
        Shortest wavelength of all [um].
    stretch : float
        Ratio of wavelengths along x (axis 0) to those along y (axis 1) [1]; roll-off and cut-off
        are wavelengths along y.

    Raises
    ------
    InputError
        If one of them is outside its range.
    """

    hurst: float
    roll_off: float
    cut_off: float
    stretch: float = 1.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0.0 <= self.hurst <= 1.0:
            raise InputError(f"hurst {self.hurst}: give a Hurst exponent from 0 to 1")
        if not 0.0 < self.cut_off < math.inf:
            raise InputError(f"cut-off {self.cut_off}: give a wavelength above 0 um")
        if not self.cut_off <= self.roll_off < math.inf:
            raise InputError(
                f"roll-off {self.roll_off}: give a wavelength of at least the cut-off,"
                f" {self.cut_off:g} um"
            )
        if not 0.0 < self.stretch < math.inf:
            raise InputError(f"stretch {self.stretch}: give a ratio above 0")

    def density(self, qx: Values, qy: Values) -> Values:
        """Compute the spectral density at wavevectors, as a share of that of the flat part.

        Parameters
        ----------
        qx, qy : ndarray
            Components of the wavevectors, of shapes that broadcast together [1/um].

        Returns
        -------
        ndarray, common shape of qx and qy
            Relative spectral density [1].
        """
        # Squares, relative to the roll-off's: roots would take as long as the power.
        unit = self.roll_off / (2 * math.pi)
        squares = (self.stretch * unit * qx) ** 2 + (unit * qy) ** 2
        largest = (self.roll_off / self.cut_off * (1 + ROUNDING)) ** 2
        return np.where(
            squares <= largest, np.maximum(squares, 1.0) ** (-1 - self.hurst), 0.0
        )


def generate_spectral(
    shape: tuple[int, int],
    side: float | tuple[float, float],
    spectrum: SelfAffineSpectrum,
    random: np.random.Generator,
    *,
    rms_height: float | None = None,
    rms_slope: float | None = None,
) -> Heights:
    """Generate a periodic random surface with a given power spectrum.

    The surface is a sum of all waves that the sides hold, with amplitudes from the spectrum and
    random phases, so that every surface has the spectrum and the rms height or slope exactly. The
    phases depend on the sides and the cut-off, but not on the grid: the same seed gives the same
    surface on all grids with more than two nodes in the shortest wavelength.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny), at least 2 along both axes.
    side : float or tuple of float
        Period of the surface, one or one per axis; the nodes are side / nodes apart [um].
    spectrum : SelfAffineSpectrum
        Shape of the power spectrum.
    random : numpy.random.Generator
        Source of the phases.
    rms_height : float, optional
        Root mean square of the heights [um]; either this or `rms_slope` is given.
    rms_slope : float, optional
        Root mean square of the gradient's modulus, that of the waves and not of differences
        between nodes [1].

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights about their mean [um].

    Raises
    ------
    InputError
        If the grid is too coarse for the cut-off, the sides hold no wave, or not exactly one rms
        value of 0 or more is given.
    """
    rms = _only_rms(rms_height, rms_slope)
    sides = pair(side)
    _refuse_grid(shape, sides, spectrum)
    waves = _waves(shape, sides, spectrum)
    powers = _relative_powers(waves, spectrum)
    if rms_slope is None:
        total = float(powers.sum())
    else:
        total = float((powers * (waves.qx**2 + waves.qy**2)).sum())
    if total == 0.0:
        raise InputError(
            "no wave between the cut-off and the sides: give a shorter cut-off"
        )
    powers *= rms**2 / total  # mean square height of each wave [um^2]
    phases = random.uniform(0.0, 2 * math.pi, powers.shape)
    return _synthesis(np.sqrt(powers / 2), phases, shape)


def _only_rms(rms_height: float | None, rms_slope: float | None) -> float:
    """Return the rms value; raise InputError unless exactly one, of 0 or more, is given."""
    if rms_height is not None and rms_slope is None:
        return _require_rms("height", rms_height)
    if rms_slope is not None and rms_height is None:
        return _require_rms("slope", rms_slope)
    raise InputError("give either an rms height or an rms slope")


def _require_rms(name: str, rms: float) -> float:
    """Return an rms height [um] or slope [1]; raise InputError if it is negative or infinite."""
    if not 0.0 <= rms < math.inf:
        raise InputError(f"rms {name} {rms}: give 0 or more")
    return rms


def _refuse_grid(
    shape: tuple[int, int], sides: tuple[float, float], spectrum: SelfAffineSpectrum
) -> None:
    """Raise InputError if nodes and sides [um] are no grid, or too coarse for the cut-off."""
    nx, ny = shape
    if min(shape) < 2:
        raise InputError(f"nodes {nx} x {ny}: give at least 2 along both axes")
    for length in sides:
        if not 0.0 < length < math.inf:
            raise InputError(f"side {length}: give a length above 0 um")
    finest = max(2 * sides[0] / nx / spectrum.stretch, 2 * sides[1] / ny)
    if spectrum.cut_off * (1 + ROUNDING) < finest:
        raise InputError(
            f"cut-off {spectrum.cut_off:g}: give at least {finest:.6g} um,"
            " two nodes a wavelength along both axes, or a finer grid"
        )


class Waves(NamedTuple):
    """Wavevectors of half of all waves that a period holds; the other half are their opposites."""

    qx: Values  # components along x, first those from 0 on, shape (2 kx + 1, 1) [1/um]
    qy: Values  # components along y, from 0 on, shape (1, ky + 1) [1/um]


def _waves(
    shape: tuple[int, int], sides: tuple[float, float], spectrum: SelfAffineSpectrum
) -> Waves:
    """Return the waves down to the cut-off of a spectrum that a grid with such sides [um] holds."""
    kx = _most_periods(shape[0], sides[0], spectrum.cut_off * spectrum.stretch)
    ky = _most_periods(shape[1], sides[1], spectrum.cut_off)
    numbers_x = np.fft.ifftshift(np.arange(-kx, kx + 1)).reshape(-1, 1)
    numbers_y = np.arange(ky + 1).reshape(1, -1)
    qx = 2 * math.pi / sides[0] * numbers_x
    qy = 2 * math.pi / sides[1] * numbers_y
    return Waves(np.asarray(qx, dtype=np.float64), np.asarray(qy, dtype=np.float64))


def _most_periods(nodes: int, length: float, shortest: float) -> int:
    """Return how many periods of the shortest wave [um] a length [um] and its nodes hold.

    A wave of exactly two nodes is left out: the grid does not hold its phase.
    """
    return min(math.floor(length / shortest * (1 + ROUNDING)), (nodes - 1) // 2)


def _longest_wave(nodes: int, spacing: float) -> float:
    """Return the longest wave [um] of a period of nodes with a spacing [um]; 0 if there is none."""
    if nodes <= 2:
        return 0.0
    return nodes * spacing


def _relative_powers(waves: Waves, spectrum: SelfAffineSpectrum) -> Values:
    """Return the power of each wave (2 kx + 1, ky + 1) as a share of the flat part's [1].

    The mean has none, and neither has the second of two opposite waves in the column qy = 0.
    """
    count = len(waves.qx) // 2 + 1  # of the waves with qx from 0 on
    first = spectrum.density(waves.qx[:count], waves.qy)
    powers = np.concatenate((first, first[:0:-1]))  # the same along -x
    powers[count:, 0] = 0.0
    powers[0, 0] = 0.0
    return powers


def _synthesis(amplitudes: Values, phases: Values, shape: tuple[int, int]) -> Heights:
    """Sum waves of amplitudes [um] and phases (2 kx + 1, ky + 1) on the nodes of a grid [um]."""
    # Single precision is enough for phases that are random; the moduli of the amplitudes are exact.
    angles = phases.astype(np.float32)
    cosines = np.cos(angles).astype(np.float64)
    sines = np.sin(angles).astype(np.float64)
    amplitudes = amplitudes / np.sqrt(cosines**2 + sines**2)
    waves: NDArray[np.complex128] = np.empty(phases.shape, dtype=complex)
    np.multiply(amplitudes, cosines, out=waves.real)
    np.multiply(amplitudes, sines, out=waves.imag)
    waves *= math.prod(shape)
    kx = len(waves) // 2
    columns = waves.shape[1]
    transform = np.zeros((shape[0], shape[1] // 2 + 1), dtype=complex)
    transform[: kx + 1, :columns] = waves[: kx + 1]
    if kx > 0:
        transform[-kx:, :columns] = waves[kx + 1 :]
        transform[-kx:, 0] = np.conj(waves[kx:0:-1, 0])
    return np.fft.irfft2(transform, s=shape)


# end of what a drawn parameter may be
OR_DRAWN = ", [low, high] or a distribution of these"


class SpectralSurface(GridSurface):
    """Self-affine surfaces with a given power spectrum and random phases."""

    generator: Literal["spectral"]
    hurst: Hurst = Field(default=0.8, description=f"a number from 0 to 1{OR_DRAWN}")
    roll_off: Annotated[AboveZero, Drawn("um", "longest wavelength of the power law")] = (
        Field(description=f"a wavelength above 0{OR_DRAWN} [um]")
    )
    cut_off: Annotated[AboveZero, Drawn("um", "shortest wavelength")] = Field(
        description=f"a wavelength above 0{OR_DRAWN} [um]"
    )
    rms_height: Annotated[
        AtLeastZero | None, Drawn("um", "rms height drawn for the spectrum")
    ] = Field(default=None, description=f"a number from 0 on{OR_DRAWN} [um]")
    rms_slope: Annotated[
        AtLeastZero | None, Drawn("1", "rms slope drawn for the spectrum")
    ] = Field(default=None, description=f"a number from 0 on{OR_DRAWN}")
    stretch: Annotated[
        AboveZero, Drawn("1", "wavelengths along x over those along y")
    ] = Field(
        default=1.0,
        description=f"a number above 0{OR_DRAWN}: wavelengths along x over those along y",
    )
    # Scenes that do not give it take 1 on periodic patches, otherwise 2.
    period: Annotated[float, Field(ge=1, le=16)] | None = Field(
        default=None,
        description="the surface's period in sides of the patch, from 1 to 16",
    )

    @model_validator(mode="after")
    def _require_one_rms(self) -> Self:
        """Refuse surfaces without a height, or with two, and a cut-off beyond the roll-off."""
        if (self.rms_height is None) == (self.rms_slope is None):
            raise conflict("give either rms_height or rms_slope")
        cut_off = limits(self.cut_off).largest
        roll_off = limits(self.roll_off).smallest
        if cut_off > roll_off:
            raise conflict(
                f"cut_off is up to {cut_off:g} um and roll_off from {roll_off:g} um on: the cut-off"
                " is the shorter wavelength"
            )
        return self

    def period_nodes(self, grid: Grid) -> tuple[int, int]:
        """Return the nodes of a surface's period; one beyond the patch suits Fourier transforms.

        Parameters
        ----------
        grid : Grid
            The grid of the patch.

        Returns
        -------
        tuple of int
            Nodes along x and y.
        """
        from scipy.fft import next_fast_len

        periods = self.period
        if periods is None:
            periods = 1.0 if grid.boundary == "periodic" else 2.0
        if periods == 1.0:
            return grid.shape
        nx, ny = grid.shape
        return (
            next_fast_len(math.ceil(periods * nx), real=True),
            next_fast_len(math.ceil(periods * ny), real=True),
        )

    def fault_on(self, grid: Grid) -> str:
        """Return why a wave may be too short for the grid, or too long for the period, or ""."""
        nx, ny = self.period_nodes(grid)
        if max(nx, ny) > MOST_PERIOD_NODES:
            return (
                f"its period has {nx} x {ny} nodes: give a shorter period, at most"
                f" {MOST_PERIOD_NODES} nodes"
            )
        return self._fault_of_short_waves(grid) or self._fault_of_long_waves(grid)

    def _fault_of_short_waves(self, grid: Grid) -> str:
        """Return why the shortest waves may be too short for the grid, or ""."""
        dx, dy = grid.spacing
        shortest = limits(self.cut_off).smallest
        finest = max(2 * dx / limits(self.stretch).smallest, 2 * dy)
        if shortest * (1 + ROUNDING) >= finest:
            return ""
        return (
            f"cut_off is from {shortest:g} um on; this grid holds waves of {finest:.6g} um"
            " and more: give a longer cut_off, more nodes or a shorter side"
        )

    def _fault_of_long_waves(self, grid: Grid) -> str:
        """Return why the cut-off may be beyond all waves, or the roll-off be too long, or ""."""
        nx, ny = self.period_nodes(grid)
        dx, dy = grid.spacing
        along_x = _longest_wave(nx, dx) / limits(self.stretch).largest
        along_y = _longest_wave(ny, dy)
        longest = max(along_x, along_y)
        cut_off = limits(self.cut_off).largest
        if cut_off > longest * (1 + ROUNDING):
            return (
                f"cut_off is up to {cut_off:g} um and the longest wave of the period {longest:.6g}"
                " um: give a shorter cut_off"
            )
        roll_off = limits(self.roll_off).largest
        if roll_off > FARTHEST * longest:
            return f"roll_off is up to {roll_off:g} um: give at most {FARTHEST * longest:g} um"
        return ""

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Add waves up; see `GeneratedSurface.heights`.

        Unless the patch is periodic, a surface is a window of one with a longer period, so that
        opposite borders of the patch differ.
        """
        nx, ny = self.period_nodes(grid)
        dx, dy = grid.spacing
        spectrum = SelfAffineSpectrum(
            hurst=parameters["hurst"],
            roll_off=parameters["roll_off"],
            cut_off=parameters["cut_off"],
            stretch=parameters["stretch"],
        )
        period = generate_spectral(
            (nx, ny),
            (nx * dx, ny * dy),
            spectrum,
            random,
            rms_height=parameters.get("rms_height"),
            rms_slope=parameters.get("rms_slope"),
        )
        heights = period[: grid.shape[0], : grid.shape[1]]
        return np.ascontiguousarray(heights - heights.min())
