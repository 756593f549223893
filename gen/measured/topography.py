"""Read measured topographies: heights and lengths of an instrument's file, converted to um.

`gen.measured.grid_file` reads .npy files and text; SurfaceTopography, whose home is here, reads all
further formats.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.arrays import Heights
from gen.measured import grid_file, text
from gen.measured.channel import Channel, choice_in_words, choose_channel
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file
from gen.runtime.numbers import magnitude

if TYPE_CHECKING:  # surfaces are described without the solver
    from bem.spacing import Boundary

Sides = tuple[float, float]

UNITS = {"m": 1e6, "mm": 1e3, "um": 1.0, "µm": 1.0, "μm": 1.0, "nm": 1e-3, "A": 1e-4, "Å": 1e-4}
"""Length of each unit [um]."""
CHANCE = 8
"""Numbers that hardly ever rise or fall throughout, unless they are coordinates."""
STRIP = 100
"""Rows from which two or three columns are a list of points rather than a narrow map."""
OWN_SUFFIXES = {".npy", ".txt", ".dat", ".csv", ".asc", ""}
"""Suffixes of files that need no SurfaceTopography."""


@dataclass(frozen=True, eq=False)
class Topography:
    """A surface from a file.

    Attributes
    ----------
    name : str
        Name of the file.
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um].
    sides : tuple of float
        Lengths of the patch along x and y [um].
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch: the outer nodes of a free one lie on its border, and a patch without
        edges is made of cells.
    steps : tuple of str
        One line for each step from the file to these heights.
    warnings : tuple of str
        One line for each reason to distrust the heights.
    unit : str
        Unit of the heights in the file, "" if it names none and they are taken as um.
    followed : frozenset of str
        Options of the preparation, which no warning advises again: "--crop", "--level plane".
    repeats : bool
        Whether the file says that its map is periodic; the boundary is what the user says.
    """

    name: str
    heights: Heights
    sides: Sides
    steps: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    boundary: Boundary = "free"
    unit: str = ""
    followed: frozenset[str] = frozenset()
    repeats: bool = False

    @property
    def spacing(self) -> Sides:
        """Distance of the nodes along x and y [um]."""
        nx, ny = (intervals(nodes, self.boundary) for nodes in self.heights.shape)
        return self.sides[0] / nx, self.sides[1] / ny

    @property
    def missing(self) -> int:
        """Number of nodes without a height."""
        return int(np.count_nonzero(np.isnan(self.heights)))


def intervals(nodes: int, boundary: Boundary) -> int:
    """Return the length of a patch in spacings of its nodes, along one axis.

    The rule is that of `bem.spacing.node_spacing`, without loading the solver.
    """
    return nodes - 1 if boundary == "free" else nodes


@dataclass(frozen=True, eq=False)
class _Scan:
    """A map in the file's own units.

    Attributes
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [unit].
    lengths : tuple of float, optional
        Lengths of the patch along x and y [length_unit]; None if the file has none.
    unit : str, optional
        Unit of the heights, None if the file names none.
    length_unit : str, optional
        Unit of the lengths, None for that of the heights.
    origin : str
        Channel and header that were read, in words.
    remarks : tuple of str
        Comments of the file that we do not understand and that name a unit of length.
    repeats : bool
        Whether the file says that its map is periodic.
    """

    heights: Heights
    lengths: Sides | None = None
    unit: str | None = None
    length_unit: str | None = None
    origin: str = ""
    remarks: tuple[str, ...] = ()
    repeats: bool = False


def read(
    path: Path,
    side: str = "",
    unit: str = "",
    *,
    channel: str = "",
    override_scale: bool = False,
    boundary: Boundary = "free",
) -> Topography:
    """Read a surface from a file.

    Lengths and unit are to be given if the file lacks them; otherwise they are refused.

    Parameters
    ----------
    path : Path
        File: .npy, text, or a format that SurfaceTopography reads (x3p, sur, al3d, opd, plu, gwy
        and more).
    side : str
        Scan length, or two of them with a comma [um], for files without lengths.
    unit : str
        Unit of the heights, and of the lengths of the file, for files that name none; .npy and
        text are in um by default.
    channel : str
        Name or index of the channel to read; the first one with heights by default.
    override_scale : bool
        Let `side` and `unit` overrule those of the file, with a warning.
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch: without edges a scan length is that of all pixels, and free patches
        end at the outer nodes. The size of a pixel that the file states is kept in either case.

    Returns
    -------
    Topography
        Surface in um, with holes if the file has any.

    Raises
    ------
    InputError
        If the file cannot be read or holds no map of heights, its channel is unknown, or a length
        or unit is missing, wrong, or given although the file has it.
    """
    if override_scale and not (side or unit):
        raise InputError("--override-scale: give --side, --unit or both, to overrule the file's")
    own = path.suffix.lower() in OWN_SUFFIXES and not _is_foreign(path)
    scan = (_own_scan if own else _instrument_scan)(path, channel, boundary)
    _check(path, scan.heights)
    overruled: list[str] = []
    heights_unit = _agreed_unit(path, scan, unit, overruled if override_scale else None)
    allowed = overruled if override_scale else None
    sides = _agreed_sides(path, scan, heights_unit, side, boundary, allowed)
    with np.errstate(over="ignore"):
        heights = scan.heights * _factor(heights_unit or "um", "--unit")
    if np.isinf(heights).any() or not all(0 < length < np.inf for length in sides):
        raise InputError(
            f"{path}: its heights or lengths are beyond what numbers hold; give others"
        )
    steps = [_first_step(scan, heights, heights_unit)]
    steps += [f"OVERRULED by --override-scale: {change}" for change in overruled]
    distrust = [f"the file's own scale is overruled: {change}" for change in overruled]
    distrust += [
        f"the file says {remark!r}, which is not read: check --side and --unit against it"
        for remark in scan.remarks
    ]
    return Topography(
        name=str(path),
        heights=heights,
        sides=sides,
        steps=tuple(steps),
        warnings=tuple(distrust),
        boundary=boundary,
        unit=heights_unit or "",
        repeats=scan.repeats,
    )


def _first_step(scan: _Scan, heights: Heights, unit: str | None) -> str:
    """Describe the map that was read in one line: nodes, channel, units, holes."""
    nx, ny = heights.shape
    units = f"heights in {unit}" if unit else "heights taken as um"
    if scan.lengths is not None:
        units = f"lengths in {unit}"
        if scan.length_unit not in {None, unit}:
            units = f"lengths in {scan.length_unit}, heights in {unit}"
    holes = int(np.count_nonzero(np.isnan(heights)))
    share = f"{holes} missing ({100 * holes / heights.size:.3g} %)"
    return f"read {nx} x {ny} nodes{scan.origin}, {units}, {share}"


def sides_from(text: str) -> Sides:
    """Return the scan lengths along x and y [um] from "1000" or "1000,500".

    Raises
    ------
    InputError
        If the text is anything else, or a length is not above 0.
    """
    try:
        lengths = [float(part) for part in text.split(",")]
    except ValueError:
        lengths = []
    if len(lengths) not in {1, 2} or not all(map(magnitude, lengths)):
        raise InputError(
            f"--side {text!r}: give the scan length in um, a number above 0, or two as 1000,500"
        )
    return lengths[0], lengths[-1]


def _check(path: Path, heights: Heights) -> None:
    """Refuse heights that are no map of at least 2 x 2 nodes, or all missing."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        shape = " x ".join(str(length) for length in heights.shape)
        raise InputError(f"{path}: holds {shape} heights; give 2-D heights, 2 x 2 or more")
    if np.isnan(heights).all():
        raise InputError(f"{path}: all of its {heights.size} heights are missing; measure again")


def _factor(unit: str, name: str) -> float:
    """Return the length of a unit [um]."""
    if unit not in UNITS:
        raise InputError(f"{name} {unit!r}: give one of {', '.join(UNITS)}")
    return UNITS[unit]


def _agreed_unit(path: Path, scan: _Scan, given: str, overruled: list[str] | None) -> str | None:
    """Return the unit of the heights, from the file or the user; None if it is um by default.

    If the user's unit overrules the file's, that is appended to `overruled`; None forbids it.
    """
    own = scan.unit
    if given:
        _factor(given, "--unit")
    if own is None:
        if not given and (scan.lengths is not None or path.suffix.lower() not in OWN_SUFFIXES):
            raise InputError(f"{path}: names no unit; give --unit, one of {', '.join(UNITS)}")
        return given or None
    if not given or UNITS[given] == UNITS.get(own):
        _factor(own, f"{path}: unit")
        return given or own
    if overruled is None:
        raise InputError(
            f"{path}: its lengths are in {own}, --unit says {given}; leave that out, or overrule"
            " the file by --override-scale"
        )
    overruled.append(f"unit {own}, taken as {given}")
    return given


def _agreed_sides(
    path: Path,
    scan: _Scan,
    unit: str | None,
    side: str,
    boundary: Boundary,
    overruled: list[str] | None,
) -> Sides:
    """Return the lengths of the patch [um], from the file or the user.

    If the user's lengths overrule the file's, that is appended to `overruled`; None forbids it.
    """
    if scan.lengths is None:
        if not side:
            hint = "".join(f" (it says {remark!r})" for remark in scan.remarks[:1])
            raise InputError(f"{path}: holds no lengths; give --side, the scan length in um{hint}")
        return _sides_of(path, scan.heights.shape, side, boundary)
    factor = _factor(scan.length_unit or unit or "um", f"{path}: unit")
    own = scan.lengths[0] * factor, scan.lengths[1] * factor
    if not side:
        return own
    given = sides_from(side)
    if np.allclose(given, own, rtol=1e-3):
        return own
    if overruled is None:
        raise InputError(
            f"{path}: is {own[0]:.6g} x {own[1]:.6g} um, --side says {side}; leave that out, or"
            " overrule the file by --override-scale"
        )
    given = _sides_of(path, scan.heights.shape, side, boundary)
    overruled.append(f"{own[0]:.6g} x {own[1]:.6g} um, taken as {given[0]:g} x {given[1]:g} um")
    return given


def _sides_of(path: Path, shape: tuple[int, ...], side: str, boundary: Boundary) -> Sides:
    """Return the lengths from --side [um]; require both for a map that is not square."""
    lengths = sides_from(side)
    nx, ny = shape
    if nx != ny and "," not in side:
        square = lengths[0] / intervals(nx, boundary) * intervals(ny, boundary)
        raise InputError(
            f"{path}: has {nx} x {ny} nodes; give --side two lengths, {lengths[0]:g},{square:g} for"
            f" square cells or {lengths[0]:g},{lengths[0]:g} for a square patch"
        )
    return lengths


def _own_scan(path: Path, wanted: str, boundary: Boundary) -> _Scan:
    """Read the map in a .npy or text file, with the entries of its header."""
    matrices = grid_file.read(path)
    units = [matrix.value_unit for matrix in matrices]
    channels = [
        Channel(place, matrix.channel or f"matrix {place}", not unit or unit in UNITS, unit)
        for place, (matrix, (_, unit)) in enumerate(zip(matrices, units, strict=True))
    ]
    taken = choose_channel(path, channels, wanted).index
    matrix, (factor, unit) = matrices[taken], units[taken]
    # An overflow is refused by `read`; a signalling NaN is a hole like every NaN.
    with np.errstate(over="ignore", invalid="ignore"):
        heights = factor * grid_file.checked(matrix.numbers, path, holes=True)
    widths, remarks = matrix.widths, matrix.remarks
    origin = choice_in_words(channels, taken)
    if widths is None:
        _refuse_points(path, heights)
        return _Scan(heights, unit=unit or None, origin=origin, remarks=remarks)
    (width, length_unit), (length, other_unit) = widths
    if other_unit != length_unit:
        length *= _factor(other_unit, f"{path}: unit") / _factor(length_unit, f"{path}: unit")
    heights = np.ascontiguousarray(heights.T)
    nx, ny = heights.shape
    return _Scan(
        heights=heights,
        lengths=(width * intervals(nx, boundary) / nx, length * intervals(ny, boundary) / ny),
        unit=unit or None,
        length_unit=length_unit or None,
        origin=f"{origin} under a header, x along its lines",
        remarks=remarks,
    )


def _refuse_points(path: Path, heights: Heights) -> None:
    """Refuse two or three columns that are coordinates rather than a narrow map of heights."""
    for columns, direction in ((heights, "columns"), (heights.T, "rows")):
        points, axes = columns.shape
        if axes > 3 or points < 3:
            continue
        rising = _is_axis(columns[:, 0])
        kind = "a profile, x and z," if axes == 2 else "a list of points, x, y and z,"
        if (points > axes and (rising or (axes == 3 and _is_grid(columns)))) or points >= STRIP:
            raise InputError(
                f"{path}: holds {points} x {axes} numbers in {direction}: looks like {kind} not a"
                f" map of heights; {text.POINTS}"
            )


def _is_axis(values: Heights) -> bool:
    """Tell whether numbers rise or fall like coordinates: many of them, or in even steps."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(values)
        even = np.allclose(steps, steps[0], rtol=1e-3, atol=0)
    return bool((steps > 0).all() or (steps < 0).all()) and (even or values.size >= CHANCE)


def _is_grid(columns: Heights) -> bool:
    """Tell whether the first two columns hold every node of a rectangular grid once."""
    x, y = np.unique(columns[:, 0]), np.unique(columns[:, 1])
    pairs = np.unique(columns[:, :2], axis=0)
    return min(x.size, y.size) > 1 and x.size * y.size == len(columns) == len(pairs)


def _is_foreign(path: Path) -> bool:
    """Tell whether a .dat file is an instrument's binary one rather than text."""
    try:
        with require_file(path).open("rb") as file:
            start = file.read(1024)
    except (OSError, ValueError):
        return False
    binary = any(character in start for character in grid_file.CONTROL_CHARACTERS)
    return path.suffix.lower() == ".dat" and binary and not start.startswith(b"\x93NUMPY")


def _instrument_scan(path: Path, wanted: str, boundary: Boundary) -> _Scan:
    """Read the wanted map of an instrument's file."""
    try:
        from SurfaceTopography import open_topography
    except ImportError:
        from gen.runtime.installing import command_for

        raise InputError(
            f"{path}: only .npy and text can be read without SurfaceTopography:"
            f" {command_for('instruments')}"
        ) from None
    if not require_file(path).is_file():
        raise InputError(f"{path}: is no file that could be read")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore"
            )  # every reader that is tried warns about foreign formats
            return _scan_of(path, open_topography(str(path)), wanted, boundary)
    except InputError:
        raise
    except Exception as error:  # a broken file makes its readers raise nearly anything
        fault = " ".join(str(error).split())[:80]
        raise InputError(
            f"{path}: SurfaceTopography cannot read it ({type(error).__name__}: {fault})"
        ) from None


def _scan_of(path: Path, reader: Any, wanted: str, boundary: Boundary) -> _Scan:
    """Read the wanted map of an open file, with NaN at holes and lengths of the patch."""
    maps = {channel.index: channel for channel in reader.channels if channel.dim == 2}
    if not maps:
        raise InputError(f"{path}: it holds line scans only; give a map of heights")
    channels = [
        # Older readers of SurfaceTopography have no such attribute, and return heights only.
        Channel(
            index=index,
            name=str(channel.name),
            heights=bool(getattr(channel, "is_height_channel", True)),
            unit=str(getattr(channel, "data_unit", None) or ""),
        )
        for index, channel in maps.items()
    ]
    taken = choose_channel(path, channels, wanted).index
    channel = maps[taken]
    given = {} if channel.physical_sizes is not None else {"physical_sizes": channel.nb_grid_pts}
    topography = reader.topography(channel_index=taken, **given)
    heights = np.ma.filled(np.ma.asarray(topography.heights(), dtype=np.float64), np.nan)
    lengths = None
    if channel.physical_sizes is not None:
        nx, ny = heights.shape
        width, length = (float(size) for size in topography.physical_sizes)
        lengths = width * intervals(nx, boundary) / nx, length * intervals(ny, boundary) / ny
    origin, repeats = choice_in_words(channels, taken), bool(topography.is_periodic)
    return _Scan(heights, lengths, topography.unit, origin=origin, repeats=repeats)
