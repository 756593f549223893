"""Rough surfaces from a power spectrum: self-affine, periodic, with random phases."""

import math
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from gen.arrays import Heights, Values
from gen.distribution import AboveZero, AtLeastZero, conflict, limits
from gen.runtime.errors import InputError
from gen.self_affine import ROUNDING, SelfAffineSpectrum
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

__all__ = ["SelfAffineSpectrum", "SpectralSurface", "generate_spectral"]

# largest ratio of the roll-off to the longest wave; beyond it powers of waves overflow
LARGEST_ROLL_OFF = 1e30
# Largest number of nodes of a period along an axis. The waves of such a period take 10 GB.
MOST_PERIOD_NODES = 4 * MOST_NODES


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

    The surface is a sum of the waves with a whole number of periods along both sides. Their
    amplitudes follow from the spectrum, and their phases are random, so that every surface has
    exactly this spectrum and this rms height or slope. The phases depend on the sides and the
    cut-off, but not on the grid: one seed gives one surface on all grids with more than two nodes
    in the shortest wavelength.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny), at least 2 along both axes.
    side : float or tuple of float
        Period of the surface: one for both axes, or one for each [um]. The distance of the nodes is
        side / nodes.
    spectrum : SelfAffineSpectrum
        Shape of the power spectrum.
    random : numpy.random.Generator
        Source of the phases. The call moves its state.
    rms_height : float, optional
        Root mean square of the heights [um]. Either `rms_height` or `rms_slope` is given.
    rms_slope : float, optional
        Root mean square of the gradient's modulus [1]. It is exact for the sum of waves, and a
        little larger than the slopes between nodes.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights about their mean [um].

    Raises
    ------
    InputError
        If the shape or a side is not allowed, the grid is too coarse for the cut-off, the sides
        hold no wave, or not exactly one rms value of 0 or more is given.
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
    """Return the rms value that is given: a height [um] or a slope [1].

    Raise InputError unless exactly one of them is given, finite, and at least 0.
    """
    if rms_height is not None and rms_slope is None:
        return _require_rms("height", rms_height)
    if rms_slope is not None and rms_height is None:
        return _require_rms("slope", rms_slope)
    raise InputError("give either an rms height or an rms slope")


def _require_rms(name: str, rms: float) -> float:
    """Return an rms value; raise InputError if it is negative or infinite.

    `name` is "height" or "slope".
    """
    if not 0.0 <= rms < math.inf:
        raise InputError(f"rms {name} {rms}: give 0 or more")
    return rms


def _refuse_grid(
    shape: tuple[int, int], sides: tuple[float, float], spectrum: SelfAffineSpectrum
) -> None:
    """Raise InputError if the nodes or the sides [um] are not allowed.

    The nodes along both axes also have to be close enough for the cut-off.
    """
    nx, ny = shape
    if min(shape) < 2:
        raise InputError(f"nodes {nx} x {ny}: give at least 2 along both axes")
    for length in sides:
        if not 0.0 < length < math.inf:
            raise InputError(f"side {length}: give a length above 0 um")
    # Shortest cut-off with two nodes a wavelength along both axes. The cut-off is a wavelength
    # along y; waves along x are longer by the stretch.
    shortest = max(2 * sides[0] / nx / spectrum.stretch, 2 * sides[1] / ny)
    if spectrum.cut_off * (1 + ROUNDING) < shortest:
        raise InputError(
            f"cut-off {spectrum.cut_off:g}: give at least {shortest:.6g} um,"
            " two nodes a wavelength along both axes, or a finer grid"
        )


class Waves(NamedTuple):
    """Components of wavevectors, which broadcast to one half of all waves that a period holds.

    The other half has the opposite wavevectors. kx and ky are the largest numbers of waves along
    the two sides.
    """

    # along x, shape (2 kx + 1, 1) [1/um]: 0, then rising positive ones, then rising negative ones
    qx: Values
    qy: Values  # along y, shape (1, ky + 1) [1/um]: 0, then rising positive ones


def _waves(
    shape: tuple[int, int], sides: tuple[float, float], spectrum: SelfAffineSpectrum
) -> Waves:
    """Return the waves that fit into the sides [um] and are not shorter than the cut-off.

    `shape` are the nodes along x and y.
    """
    cut_off_along_x = spectrum.cut_off * spectrum.stretch
    kx = _most_periods(shape[0], sides[0], cut_off_along_x)
    ky = _most_periods(shape[1], sides[1], spectrum.cut_off)
    numbers_x = np.fft.ifftshift(np.arange(-kx, kx + 1)).reshape(-1, 1)
    numbers_y = np.arange(ky + 1).reshape(1, -1)
    qx = 2 * math.pi / sides[0] * numbers_x
    qy = 2 * math.pi / sides[1] * numbers_y
    return Waves(qx=np.asarray(qx, dtype=np.float64), qy=np.asarray(qy, dtype=np.float64))


def _most_periods(nodes: int, length: float, shortest: float) -> int:
    """Return the largest number of periods along a side with a length [um] and a number of nodes.

    A period is not shorter than `shortest` [um], and takes more than two nodes, because two nodes
    do not determine the phase of a wave.
    """
    allowed_by_wavelength = math.floor(length / shortest * (1 + ROUNDING))
    allowed_by_nodes = (nodes - 1) // 2
    return min(allowed_by_wavelength, allowed_by_nodes)


def _longest_wave(nodes: int, spacing: float) -> float:
    """Return the length [um] of the longest wave along an axis of a period.

    The period has this number of nodes with this spacing [um]. Return 0 if it holds no wave.
    """
    if nodes <= 2:  # see `_most_periods`
        return 0.0
    return nodes * spacing


def _relative_powers(waves: Waves, spectrum: SelfAffineSpectrum) -> Values:
    """Return the power of each wave relative to a wave of the flat part, (2 kx + 1, ky + 1) [1].

    The mean of the heights has no power. In the column qy = 0, where `waves` has both of two
    opposite waves, only the wave with a positive qx has power.
    """
    kx = len(waves.qx) // 2
    without_negative_qx = spectrum.density(waves.qx[: kx + 1], waves.qy)
    negative_qx = without_negative_qx[:0:-1]  # the density is symmetric
    powers = np.concatenate((without_negative_qx, negative_qx))
    powers[kx + 1 :, 0] = 0.0
    powers[0, 0] = 0.0
    return powers


def _synthesis(amplitudes: Values, phases: Values, shape: tuple[int, int]) -> Heights:
    """Return heights [um] on a grid of the given shape: the sum of waves and their opposites.

    `amplitudes` [um] and `phases` [rad] have the shape (2 kx + 1, ky + 1) and the order of `Waves`.
    """
    # Single precision is enough for random phases. The division below makes the moduli of the
    # complex amplitudes exact again.
    angles = phases.astype(np.float32)
    cosines = np.cos(angles).astype(np.float64)
    sines = np.sin(angles).astype(np.float64)
    amplitudes = amplitudes / np.sqrt(cosines**2 + sines**2)
    waves: NDArray[np.complex128] = np.empty(phases.shape, dtype=complex)
    np.multiply(amplitudes, cosines, out=waves.real)
    np.multiply(amplitudes, sines, out=waves.imag)
    waves *= math.prod(shape)  # the inverse transform divides by the number of nodes
    kx = len(waves) // 2
    columns = waves.shape[1]
    transform = np.zeros((shape[0], shape[1] // 2 + 1), dtype=complex)
    transform[: kx + 1, :columns] = waves[: kx + 1]
    if kx > 0:
        transform[-kx:, :columns] = waves[kx + 1 :]
        # The transform of real heights has conjugate values at opposite wavevectors.
        transform[-kx:, 0] = np.conj(waves[kx:0:-1, 0])
    return np.fft.irfft2(transform, s=shape)


# end of the description of the values that a drawn parameter may have
OR_DRAWN = ", [low, high] or a distribution of these"


class SpectralSurface(GridSurface):
    """Self-affine surfaces with a given power spectrum and random phases."""

    ON_ANY_GRID: ClassVar[bool] = True

    generator: Literal["spectral"]
    hurst: Hurst = Field(default=0.8, description=f"a number from 0 to 1{OR_DRAWN}")
    roll_off: Annotated[AboveZero, Drawn("um", "longest wavelength of the power law")] = (
        Field(description=f"a wavelength above 0{OR_DRAWN} [um]")
    )
    cut_off: Annotated[AboveZero, Drawn("um", "shortest wavelength")] = Field(
        description=f"a wavelength above 0{OR_DRAWN} [um]"
    )
    rms_height: Annotated[
        AtLeastZero | None,
        Drawn("um", "rms height drawn for the spectrum", scales_heights=True),
    ] = Field(default=None, description=f"a number from 0 on{OR_DRAWN} [um]")
    rms_slope: Annotated[
        AtLeastZero | None,
        Drawn("1", "rms slope drawn for the spectrum", scales_heights=True),
    ] = Field(default=None, description=f"a number from 0 on{OR_DRAWN}")
    stretch: Annotated[
        AboveZero, Drawn("1", "wavelengths along x over those along y")
    ] = Field(
        default=1.0,
        description=f"a number above 0{OR_DRAWN}: wavelengths along x over those along y",
    )
    # Without this key the period is 1 on periodic patches, and otherwise 2.
    period: Annotated[float, Field(ge=1, le=16)] | None = Field(
        default=None,
        description="the surface's period in sides of the patch, from 1 to 16",
    )

    @model_validator(mode="after")
    def _require_consistent_keys(self) -> Self:
        """Refuse a table without exactly one rms value.

        Also refuse a cut-off that may exceed the roll-off.
        """
        if (self.rms_height is None) == (self.rms_slope is None):
            raise conflict("give either rms_height or rms_slope")
        largest_cut_off = limits(self.cut_off).largest
        smallest_roll_off = limits(self.roll_off).smallest
        if largest_cut_off > smallest_roll_off:
            raise conflict(
                f"cut_off is up to {largest_cut_off:g} um and roll_off from"
                f" {smallest_roll_off:g} um on: the cut-off is the shorter wavelength"
            )
        return self

    def period_nodes(self, grid: Grid) -> tuple[int, int]:
        """Return the nodes of a surface's period along both axes.

        A period longer than the patch is lengthened to numbers of nodes with fast Fourier
        transforms.

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

        period_in_sides = self.period
        if period_in_sides is None:
            period_in_sides = 1.0 if grid.boundary == "periodic" else 2.0
        if period_in_sides == 1.0:
            return grid.shape
        nx, ny = grid.shape
        return (
            next_fast_len(math.ceil(period_in_sides * nx), real=True),
            next_fast_len(math.ceil(period_in_sides * ny), real=True),
        )

    def fault_on(self, grid: Grid) -> str:
        """Say why the parameters' ranges do not suit the grid; return "" if they do.

        The period may have too many nodes, the cut-off may be too short for the grid or too long
        for the period, and the roll-off may be too long.
        """
        nx, ny = self.period_nodes(grid)
        if max(nx, ny) > MOST_PERIOD_NODES:
            return (
                f"its period has {nx} x {ny} nodes: give a shorter period, at most"
                f" {MOST_PERIOD_NODES} nodes"
            )
        return self._fault_of_short_waves(grid) or self._fault_of_long_waves(grid)

    def _fault_of_short_waves(self, grid: Grid) -> str:
        """Say why the cut-off may be too short for the grid; return "" if it cannot be."""
        dx, dy = grid.spacing
        shortest = limits(self.cut_off).smallest
        # A wave along either axis needs two nodes. Waves along x are longer by the stretch.
        finest = max(2 * dx / limits(self.stretch).smallest, 2 * dy)
        if shortest * (1 + ROUNDING) >= finest:
            return ""
        return (
            f"cut_off is from {shortest:g} um on; this grid holds waves of {finest:.6g} um"
            " and more: give a longer cut_off, more nodes or a shorter side"
        )

    def _fault_of_long_waves(self, grid: Grid) -> str:
        """Say why the cut-off may exceed all waves of the period, or the roll-off may be too long.

        Return "" if neither can be.
        """
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
        largest_roll_off = LARGEST_ROLL_OFF * longest
        if roll_off > largest_roll_off:
            return (
                f"roll_off is up to {roll_off:g} um: give at most {largest_roll_off:g} um"
            )
        return ""

    def heights(
        self, grid: Grid, surface: int, parameters: Parameters, random: Random
    ) -> Heights:
        """Return a sum of waves with random phases; see `GeneratedSurface.heights`.

        If the period is longer than the patch, the surface is a corner of the period, so that
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
            shape=(nx, ny),
            side=(nx * dx, ny * dy),
            spectrum=spectrum,
            random=random,
            rms_height=parameters.get("rms_height"),
            rms_slope=parameters.get("rms_slope"),
        )
        heights = period[: grid.shape[0], : grid.shape[1]]
        return np.ascontiguousarray(heights - heights.min())
