"""Measured topographies: heights and lengths from an instrument's file, in um, whatever it says.

Our own formats are read by `gen.surface`; all others by SurfaceTopography, whose home is here.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen import surface
from gen.errors import InputError

Heights = NDArray[np.float64]
Sides = tuple[float, float]

UNITS = {"m": 1e6, "mm": 1e3, "um": 1.0, "µm": 1.0, "μm": 1.0, "nm": 1e-3, "A": 1e-4, "Å": 1e-4}
"""um in each unit of length."""
OWN_SUFFIXES = {".npy", ".txt", ".dat", ".csv", ".asc", ""}


@dataclass(frozen=True, eq=False)
class Topography:
    """A surface from a file, in um.

    Attributes
    ----------
    name : of the file
    heights : (nx, ny), NaN where nothing was measured [um]
    sides : lengths from the first to the last node along x and y [um]
    steps : what it is and what was done to it, a line each
    """

    name: str
    heights: Heights
    sides: Sides
    steps: tuple[str, ...] = ()

    @property
    def spacing(self) -> Sides:
        """Distance of the nodes along x and y [um]."""
        nx, ny = self.heights.shape
        return self.sides[0] / (nx - 1), self.sides[1] / (ny - 1)

    @property
    def missing(self) -> int:
        """Nodes without a height."""
        return int(np.count_nonzero(np.isnan(self.heights)))


def read(path: Path, side: str = "", unit: str = "") -> Topography:
    """Read a file; lengths that it does not hold have to be given, and only those.

    Parameters
    ----------
    path : .npy, text, or what SurfaceTopography reads (x3p, sur, al3d, opd, plu, gwy, nc ...)
    side : scan length, or two separated by a comma [um]; for files that hold no lengths
    unit : of the heights where the file does not say, and of its lengths if it holds some; .npy
        and text are in um unless it is given

    Raises
    ------
    InputError
        If the file cannot be read, a length or unit is missing, wrong, or given twice
    """
    factor = _factor(unit, "--unit") if unit else None
    if path.suffix.lower() in OWN_SUFFIXES and not _is_foreign(path):
        heights = surface.load(path, holes=True)
        if not side:
            raise InputError(f"{path}: holds no lengths; give --side, the scan length in um")
        found = heights * (factor or 1.0), sides_from(side)
        said = f"heights in {unit}" if unit else "heights taken as um"
    else:
        heights, lengths, own_unit = _measured(path)
        factor = _agreed_factor(path, own_unit, unit)
        found = heights * factor, _agreed_sides(path, lengths, factor, side)
        said = f"lengths in {own_unit or unit}"
    topography = Topography(str(path), *found)
    _check(path, topography.heights)
    nx, ny = topography.heights.shape
    holes = topography.missing
    share = f"{holes} missing ({100 * holes / topography.heights.size:.3g} %)"
    return Topography(str(path), *found, steps=(f"read {nx} x {ny} nodes, {said}, {share}",))


def sides_from(text: str) -> Sides:
    """Scan lengths along x and y from "1000" or "1000,500" [um]."""
    try:
        lengths = [float(part) for part in text.split(",")]
    except ValueError:
        lengths = []
    if len(lengths) not in {1, 2} or not all(0 < length < np.inf for length in lengths):
        raise InputError(
            f"--side {text!r}: give the scan length in um, a number above 0, or two as 1000,500"
        )
    return lengths[0], lengths[-1]


def _check(path: Path, heights: Heights) -> None:
    """Two rows and two columns at least, and some height."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        shape = " x ".join(str(length) for length in heights.shape)
        raise InputError(f"{path}: holds {shape} heights; give 2-D heights, 2 x 2 or more")
    if np.isnan(heights).all():
        raise InputError(f"{path}: all of its {heights.size} heights are missing; measure again")


def _factor(unit: str, name: str) -> float:
    """um in a unit of length."""
    if unit not in UNITS:
        raise InputError(f"{name} {unit!r}: give one of {', '.join(UNITS)}")
    return UNITS[unit]


def _agreed_factor(path: Path, own: str | None, given: str) -> float:
    """um in the unit of a file that may name it."""
    if own is None:
        if not given:
            raise InputError(f"{path}: names no unit; give --unit, one of {', '.join(UNITS)}")
        return _factor(given, "--unit")
    if given and _factor(given, "--unit") != _factor(own, f"{path}: unit"):
        raise InputError(f"{path}: its lengths are in {own}, --unit says {given}; leave that out")
    return _factor(own, f"{path}: unit")


def _agreed_sides(path: Path, lengths: Sides | None, factor: float, side: str) -> Sides:
    """Lengths between the outermost nodes of a file that may hold them [um]."""
    if lengths is None:
        if not side:
            raise InputError(f"{path}: holds no lengths; give --side, the scan length in um")
        return sides_from(side)
    own = lengths[0] * factor, lengths[1] * factor
    if side and not np.allclose(sides_from(side), own, rtol=1e-3):
        raise InputError(
            f"{path}: is {own[0]:.6g} x {own[1]:.6g} um, --side says {side}; leave that out"
        )
    return own


def _is_foreign(path: Path) -> bool:
    """Whether a file with one of our endings is binary all the same, as an instrument's .dat."""
    try:
        with path.open("rb") as file:
            start = file.read(1024)
    except (OSError, ValueError):
        return False
    binary = any(character in start for character in surface.CONTROL_CHARACTERS)
    return path.suffix.lower() == ".dat" and binary and not start.startswith(b"\x93NUMPY")


def _measured(path: Path) -> tuple[Heights, Sides | None, str | None]:
    """Heights with NaN in holes, lengths between the outermost nodes, and their unit."""
    try:
        from SurfaceTopography import open_topography
    except ImportError:
        raise InputError(
            f"{path}: only .npy and text can be read without SurfaceTopography:"
            " pip install 'asperity[instruments]'"
        ) from None
    if not path.is_file():
        raise InputError(f"{path}: is no file that could be read")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # readers complain about each other's formats
            return _first_channel(open_topography(str(path)))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # a broken file makes its readers raise nearly anything
        fault = " ".join(str(error).split())[:80]
        raise InputError(
            f"{path}: SurfaceTopography cannot read it ({type(error).__name__}: {fault})"
        ) from None


def _first_channel(reader: Any) -> tuple[Heights, Sides | None, str | None]:
    """The first two-dimensional channel of heights."""
    channels = [channel for channel in reader.channels if channel.dim == 2]
    if not channels:
        raise InputError("it holds line scans only; give a map of heights")
    channel = channels[0]
    given = {} if channel.physical_sizes is not None else {"physical_sizes": channel.nb_grid_pts}
    topography = reader.topography(channel_index=channel.index, **given)
    heights = np.ma.filled(np.ma.asarray(topography.heights(), dtype=np.float64), np.nan)
    if channel.physical_sizes is None:
        return heights, None, topography.unit
    nx, ny = heights.shape
    width, length = (float(size) for size in topography.physical_sizes)
    return heights, (width * (nx - 1) / nx, length * (ny - 1) / ny), topography.unit
