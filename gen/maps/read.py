"""Read measured topographies from files, with heights and lengths converted to um.

Files are .npy files, texts (read by `gen.maps.text`) or files of instruments (read by
`gen.maps.instruments`). `gen.maps.scan` then turns their numbers into a map of heights.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights
from gen.maps.channels import choose_matrix
from gen.maps.scan import (
    MOST_COLUMNS,
    NAMED_UNITS,
    UNITS,
    UNKNOWN,
    Instrument,
    Scan,
    arrange,
    factor_of,
    unit_of,
)
from gen.maps.settings import Reading, as_option
from gen.material import LARGEST, SMALLEST
from gen.runtime.errors import InputError
from gen.runtime.files import require_file

if TYPE_CHECKING:  # surfaces are described without the solver
    from bem.problem import Boundary

Sides = tuple[float, float]

# smallest and largest plausible spacing of the nodes of a measured map [um]: 1 pm and 1 cm
NEAREST = 1e-6
WIDEST = 1e4
# end of a warning about a length outside this range
BEYOND_INSTRUMENTS = (
    "which no instrument measures; compare with the instrument's own display, and"
    " overrule the file by --side or --unit with --override-scale"
)
# largest relative difference between the lengths of a file and those of `--side` that agree
AGREEING = 1e-3
# suffixes of .npy files and texts; .dat may also be an instrument's
PLAIN_SUFFIXES = {".npy", ".txt", ".dat", ".csv", ".asc", ""}


@dataclass(frozen=True)
class Remedy:
    """A setting that removes a fault of a map."""

    setting: str  # key of `Reading`, alone or with a value, as "level plane"
    effect: str  # effect of the setting, as "takes the tilt out"


@dataclass(frozen=True, eq=False)
class Topography:
    """A surface from a file, and how it was made from the file."""

    name: str  # name of the surface in messages, as the path of its file
    heights: Heights  # heights, NaN at holes [um], shape (nx, ny)
    sides: Sides  # lengths of the patch along x and y [um]
    steps: tuple[str, ...] = ()  # one line for each step from the file to these heights
    warnings: tuple[str, ...] = ()  # one line for each reason to distrust the heights
    # Boundary of the patch, "free", "periodic" or "mirror". The sides of a free patch reach from
    # its first to its last node; those of other patches are one spacing longer.
    boundary: Boundary = "free"
    # unit of the heights in the file, as the file or the user names it; "" if neither does, and the
    # heights are taken as um
    unit: str = ""
    # settings that the user has chosen and no warning advises again, as "crop" or "level plane"
    followed: frozenset[str] = frozenset()
    # spacing of the nodes along x and y [um]; None if it is computed from the sides
    exact_spacing: Sides | None = None
    # nodes that a warning calls codes, pits or spikes, shape (nx, ny); further warnings ignore them
    doubtful: NDArray[np.bool_] | None = None
    instrument: Instrument = UNKNOWN  # limits of the instrument, as the file states them

    @property
    def spacing(self) -> Sides:
        """Spacing of the nodes along x and y [um].

        It is `exact_spacing`, or else computed from the sides. The rule is that of `bem`, which is
        not imported because it loads slowly.
        """
        if self.exact_spacing is not None:
            return self.exact_spacing
        spacings_x, spacings_y = number_of_spacings(self.heights.shape, self.boundary)
        return self.sides[0] / spacings_x, self.sides[1] / spacings_y

    @property
    def missing(self) -> int:
        """Number of nodes without a height."""
        return int(np.count_nonzero(np.isnan(self.heights)))

    def changed(
        self, heights: Heights, step: str, spacing: Sides | None = None
    ) -> Topography:
        """Return the surface with new heights.

        Parameters
        ----------
        heights : ndarray, shape (nx, ny)
            The new heights [um]. If they have another shape than the old ones, `doubtful` becomes
            None, because its nodes are gone.
        step : str
            The step that led to the new heights, in words. It is added to `steps`, unless it is "".
        spacing : (float, float), optional
            New spacing of the nodes along x and y [um]. New sides are computed from it, and
            `exact_spacing` becomes None. Without it, `sides` and `exact_spacing` stay as they are.

        Returns
        -------
        Topography
            The new surface.
        """
        sides = self.sides
        exact_spacing = self.exact_spacing
        if spacing is not None:
            spacings_x, spacings_y = number_of_spacings(heights.shape, self.boundary)
            sides = (spacings_x * spacing[0], spacings_y * spacing[1])
            exact_spacing = None
        steps = self.steps
        if step:
            steps = (*steps, step)
        doubtful = self.doubtful
        if heights.shape != self.heights.shape:
            doubtful = None
        return replace(
            self,
            heights=heights,
            sides=sides,
            steps=steps,
            exact_spacing=exact_spacing,
            doubtful=doubtful,
        )

    def advised(self, fault: str, *remedies: Remedy) -> str:
        """Add remedies to the text of a fault, except for settings that the user has chosen.

        Parameters
        ----------
        fault : str
            The fault of the surface, in words.
        *remedies : Remedy
            Settings that may remove the fault.

        Returns
        -------
        str
            The fault, a colon, and the remedies as options with their effects; the fault alone if
            no remedy is left.
        """
        followed = {*self.followed, f"boundary {self.boundary}"}
        if self.unit:  # a unit that is known is not doubted
            followed.add("unit m")
        advice = [
            f"{as_option(remedy.setting)} {remedy.effect}"
            for remedy in remedies
            if remedy.setting not in followed
        ]
        if not advice:
            return fault
        return f"{fault}: {', '.join(advice)}"


def number_of_spacings(shape: tuple[int, ...], boundary: Boundary) -> tuple[int, int]:
    """Return how many spacings of its nodes each side of a patch is long.

    Parameters
    ----------
    shape : tuple of int
        Two numbers: the nodes along x and y.
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch. The sides of a free patch reach from its first to its last node;
        those of other patches are one spacing longer.

    Returns
    -------
    (int, int)
        Number of spacings along x and y.
    """
    nx, ny = shape
    if boundary == "free":
        return nx - 1, ny - 1
    return nx, ny


def spacing_text(spacing: Sides, digits: int = 6) -> str:
    """Return the text of the spacings along x and y; a single number if both look the same.

    Parameters
    ----------
    spacing : (float, float)
        Spacing of the nodes along x and y, in any unit.
    digits : int
        Number of significant digits.

    Returns
    -------
    str
        "0.5" or "0.5 x 0.25".
    """
    x = f"{spacing[0]:.{digits}g}"
    y = f"{spacing[1]:.{digits}g}"
    return x if x == y else f"{x} x {y}"


@dataclass(frozen=True)
class _FileLengths:
    """The lengths along x and y that a file states, measured in two ways."""

    patch: Sides  # sides of the patch [um]
    pixels: Sides  # widths of all pixels, which are longer than the sides of a free patch [um]

    @property
    def text(self) -> str:
        """The sides of the patch in words."""
        return f"{self.patch[0]:.6g} x {self.patch[1]:.6g} um"

    def agree_with(self, reading: Reading) -> bool:
        """Tell whether `--side` gives the sides of the patch, or else the widths of all pixels.

        The lengths may differ by `AGREEING`. With `--override-scale`, only the sides of the patch
        agree. InputError if `--side` holds no lengths.
        """
        sides = parse_sides(reading.side)
        if np.allclose(sides, self.patch, rtol=AGREEING):
            return True
        if reading.override_scale:
            return False
        return np.allclose(sides, self.pixels, rtol=AGREEING)


@dataclass(frozen=True)
class _AgreedUnit:
    """The unit of the heights, after comparing the file with the user's settings."""

    name: str  # "" if the heights are in um by default
    # what the user overrules, as "unit nm, taken as um"; "" for nothing
    overruled: str = ""


@dataclass(frozen=True)
class _AgreedSides:
    """The sides of the patch, after comparing the file with the user's settings."""

    sides: Sides  # sides along x and y [um]
    # what the user overrules, as "9 x 9 um, taken as 5 x 5 um"; "" for nothing
    overruled: str = ""


def read(
    path: Path,
    reading: Reading,
    boundary: Boundary = "free",
    *,
    for_windows: bool = False,
) -> Topography:
    """Read a surface from a file, with warnings if its scale is in doubt.

    The surface is not prepared: `gen.maps.prepare` does that.

    Parameters
    ----------
    path : Path
        The file: .npy, text, or an instrument's.
    reading : Reading
        The settings. `side`, `unit`, `channel` and `override_scale` are followed. `side` and `unit`
        have to be set if the file does not state them; only a .npy file or a text without lengths
        is in um by default. If the file states others, they are refused unless `override_scale` is
        set. `crop` only silences the warning about a period.
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch.
    for_windows : bool
        Whether windows are cut out of the map. If so, no warning says that the boundary ignores the
        period that the file states.

    Returns
    -------
    Topography
        The surface as it is in the file, in um, with its warnings.

    Raises
    ------
    InputError
        If the file cannot be read or holds no map of heights, its channel is unknown, or a length
        or unit is missing, wrong, or contradicts the file.
    """
    scan = _read_scan(path, reading)
    unit = _agreed_unit(path, scan, reading)
    patch = _agreed_sides(path, scan, unit.name, reading, boundary)
    heights = _heights_in_um(path, scan, unit.name)
    if not all(0 < length < np.inf for length in patch.sides):
        raise InputError(f"{path}: its lengths are beyond what numbers hold; give others")
    overruled = [text for text in (unit.overruled, patch.overruled) if text]
    steps = [_step_of_reading(scan, heights, unit.name)]
    steps += [f"OVERRULED by --override-scale: {text}" for text in overruled]
    topography = Topography(
        name=str(path),
        heights=heights,
        sides=patch.sides,
        steps=tuple(steps),
        boundary=boundary,
        unit=unit.name,
        instrument=scan.instrument,
    )
    warnings = [f"the file's own scale is overruled: {text}" for text in overruled]
    warnings += _doubts_about_scale(scan, topography)
    # A window or another part of a periodic map is not periodic.
    ignores_period = scan.repeats and boundary != "periodic"
    if ignores_period and not for_windows and not reading.crop:
        warnings.append(
            f"the file says that its map is periodic, and it is taken as a {boundary}"
            " patch: --boundary periodic of gen describe, contact and law follows the"
            " file"
        )
    return replace(topography, warnings=tuple(warnings))


def _heights_in_um(path: Path, scan: Scan, unit: str) -> Heights:
    """Return the heights of a scan in um; InputError if all of them are missing.

    `unit` is the unit of the heights in the file, "" for um.
    """
    unit_length = UNITS[unit_of(unit)] if unit else 1.0
    # Some NaNs, the signalling ones, would make numpy warn. All NaNs are holes.
    with np.errstate(over="ignore", invalid="ignore"):
        heights = scan.factor * scan.heights * unit_length
    if np.isnan(heights).all():
        raise InputError(
            f"{path}: all of its {heights.size} heights are missing; measure again"
        )
    return heights


def _step_of_reading(scan: Scan, heights: Heights, unit: str) -> str:
    """Return the line that describes the reading: nodes, origin, units and missing heights.

    `unit` is the unit of the heights in the file, "" for um by default.
    """
    units = f"heights in {unit}" if unit else "heights taken as um"
    if scan.widths is not None:
        # Without a unit of their own, the lengths are in that of the heights.
        if scan.length_unit in {None, unit}:
            units = f"lengths in {unit}"
        else:
            units = f"lengths in {scan.length_unit}, {units}"
    nx, ny = heights.shape
    holes = int(np.count_nonzero(np.isnan(heights)))
    share = 100 * holes / heights.size
    return (
        f"read {nx} x {ny} nodes{scan.origin}, {units}, {holes} missing ({share:.3g} %)"
    )


def _doubts_about_scale(scan: Scan, topography: Topography) -> list[str]:
    """Return warnings about comments that may state a scale, and about implausible spacings."""
    warnings = [
        f"the file says {remark!r}, which is not read: check --side and --unit against it"
        for remark in scan.remarks
    ]
    different_spacings = dict.fromkeys(topography.spacing)  # one entry if both are equal
    warnings += [
        f"its nodes are {spacing:.3g} um apart, {BEYOND_INSTRUMENTS}"
        for spacing in different_spacings
        if not NEAREST <= spacing <= WIDEST
    ]
    return warnings


def _agreed_unit(path: Path, scan: Scan, reading: Reading) -> _AgreedUnit:
    """Return the unit of the heights from the user or the file.

    InputError if neither names a known unit and um is not the default, or if they name different
    units and the user does not overrule the file.
    """
    if reading.override_scale and not reading.side and not reading.unit:
        raise InputError(
            "--override-scale: give --side, --unit or both, to overrule the file's"
        )
    if reading.unit:
        factor_of(reading.unit, "--unit")  # refuses an unknown unit
    # The file names no unit.
    if not scan.unit:
        um_by_default = scan.unit == "" and scan.widths is None
        if not reading.unit and not um_by_default:
            raise InputError(f"{path}: names no unit; give --unit, one of {NAMED_UNITS}")
        return _AgreedUnit(name=reading.unit)
    # The file alone names a unit.
    if not reading.unit:
        factor_of(scan.unit, f"{path}: unit")  # refuses an unknown unit
        return _AgreedUnit(name=scan.unit)
    # Both name a unit. That of the file may be unknown, and is then different.
    if UNITS.get(unit_of(scan.unit)) == UNITS[unit_of(reading.unit)]:
        return _AgreedUnit(name=reading.unit)
    if not reading.override_scale:
        numbers = "lengths" if scan.length_unit is None else "heights"
        raise InputError(
            f"{path}: its {numbers} are in {scan.unit}, --unit says {reading.unit}; leave"
            " that out, or overrule the file by --override-scale"
        )
    overruled = f"unit {scan.unit}, taken as {reading.unit}"
    return _AgreedUnit(name=reading.unit, overruled=overruled)


def _agreed_sides(
    path: Path, scan: Scan, unit: str, reading: Reading, boundary: Boundary
) -> _AgreedSides:
    """Return the sides of the patch from the file or, if it states none, from the user.

    Lengths of the file that have no unit are in `unit`, that of the heights ("" for um). InputError
    if `--side` is missing or wrong, or if it contradicts the file and does not overrule it.
    """
    if scan.widths is None:
        return _AgreedSides(sides=_sides_of_user(path, scan, reading, boundary))
    length_unit = scan.length_unit or unit or "um"
    overruling = reading.override_scale and bool(reading.side)
    # Lengths in an unknown unit cannot be compared with those of the user.
    if overruling and unit_of(length_unit) not in UNITS:
        overruled = f"lengths in {length_unit}"
    else:
        advice = "give --side with --override-scale, or lengths in"
        factor = factor_of(length_unit, f"{path}: unit of lengths", advice)
        stated = _lengths_of_file(scan.widths, scan.heights.shape, boundary, factor)
        if not reading.side or stated.agree_with(reading):
            return _AgreedSides(sides=stated.patch)
        if not overruling:
            raise _contradicted_sides(path, stated, reading, boundary)
        overruled = stated.text
    x, y = _sides_of_user(path, scan, reading, boundary)
    return _AgreedSides(sides=(x, y), overruled=f"{overruled}, taken as {x:g} x {y:g} um")


def _lengths_of_file(
    widths: Sides, shape: tuple[int, ...], boundary: Boundary, factor: float
) -> _FileLengths:
    """Convert the widths of all pixels of a file into lengths of the patch and of the pixels [um].

    `widths` are along x and y in the unit of the file, whose length is `factor` [um].
    """
    width, length = widths
    nx, ny = shape
    spacings_x, spacings_y = number_of_spacings(shape, boundary)
    return _FileLengths(
        patch=(width * spacings_x / nx * factor, length * spacings_y / ny * factor),
        pixels=(width * factor, length * factor),
    )


def _contradicted_sides(
    path: Path, stated: _FileLengths, reading: Reading, boundary: Boundary
) -> InputError:
    """Return the error for a `--side` that contradicts the lengths in the file."""
    scale = stated.text
    if boundary == "free":
        scale += " between its outer nodes"
    return InputError(
        f"{path}: is {scale}, --side says {reading.side}; leave that out, or overrule the"
        " file by --override-scale"
    )


def _sides_of_user(path: Path, scan: Scan, reading: Reading, boundary: Boundary) -> Sides:
    """Return the lengths that `--side` gives [um].

    InputError if `--side` is missing or wrong, or gives one length for a map that is not square.
    """
    if not reading.side:
        fault = f"{path}: holds no lengths; give --side, the scan length in um"
        if scan.remarks:
            fault += f" (it says {scan.remarks[0]!r})"
        raise InputError(fault)
    x, y = parse_sides(reading.side)
    nx, ny = scan.heights.shape
    if nx != ny and "," not in reading.side:
        spacings_x, spacings_y = number_of_spacings(scan.heights.shape, boundary)
        y_of_square_cells = x / spacings_x * spacings_y
        raise InputError(
            f"{path}: has {nx} x {ny} nodes; give --side two lengths,"
            f" {x:g},{y_of_square_cells:g} for square cells or {x:g},{x:g} for a square"
            " patch"
        )
    return x, y


def parse_sides(text: str) -> Sides:
    """Return the scan lengths that the option `--side` gives.

    Parameters
    ----------
    text : str
        One length for both axes, as "1000", or one for each axis, as "1000,500" [um].

    Returns
    -------
    (float, float)
        Lengths along x and y [um].

    Raises
    ------
    InputError
        If the text holds anything else, or a length that is not between `SMALLEST` and `LARGEST`
        of `gen.material`.
    """
    with suppress(ValueError):
        lengths = [float(part) for part in text.split(",")]
        inside = all(SMALLEST < length < LARGEST for length in lengths)
        if len(lengths) in {1, 2} and inside:
            return lengths[0], lengths[-1]
    raise InputError(
        f"--side {text!r}: give the scan length in um, a number from {SMALLEST:g} to"
        f" {LARGEST:g}, or two as 1000,500"
    )


def _read_scan(path: Path, reading: Reading) -> Scan:
    """Read the map of a file in the units of the file.

    The content tells whether the file is .npy, text or an instrument's. InputError if it cannot be
    read or holds no map of heights.
    """
    try:
        content = require_file(path).read_bytes()
    except (OSError, ValueError) as error:
        fault = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(
            f"{path}: cannot be read ({fault}); give a map of heights"
        ) from error
    is_npy = path.suffix.lower() == ".npy"
    if is_npy or content.startswith(np.lib.format.MAGIC_PREFIX):
        scan = choose_matrix(path, [_npy_scan(path, content)], reading)
    else:
        scan = _text_or_instruments_scan(path, content, reading)
    _require_map(path, scan.heights)
    if scan.widths is None and _may_hold_coordinates(scan):
        return arrange(path, scan)
    return scan


def _npy_scan(path: Path, content: bytes) -> Scan:
    """Return the real numbers of a .npy file as a scan, whose heights are in um by default.

    InputError if the file is broken or holds other values. Python objects are never unpickled.
    """
    try:
        with np.errstate(all="ignore"):  # a broken header may state huge numbers of nodes
            array = np.lib.format.read_array(BytesIO(content), allow_pickle=False)
    except Exception as error:  # a broken header makes numpy raise nearly anything
        fault = " ".join(str(error).split())[:120]
        raise InputError(
            f"{path}: not a whole .npy file ({fault}); save real numbers"
        ) from error
    if array.dtype.kind not in "iuf":
        raise InputError(
            f"{path}: holds {array.dtype} values; save real numbers (float64)"
        )
    # Numbers beyond the range of float64 become infinite, which `_require_map` refuses.
    with np.errstate(over="ignore"):
        heights = np.asarray(array, dtype=np.float64, order="C")
    return Scan(heights=heights, unit="")


def _text_or_instruments_scan(path: Path, content: bytes, reading: Reading) -> Scan:
    """Read the map of a text, or of an instrument's file if the content is no table of numbers.

    A file with a suffix of `PLAIN_SUFFIXES` is read as a text only, unless it is a .dat file.
    """
    # Most files are .npy files, which need neither of these modules.
    from gen.maps.instruments import instruments_scan
    from gen.maps.text import read_matrices

    suffix = path.suffix.lower()
    is_plain = suffix in PLAIN_SUFFIXES
    matrices: list[Scan] = []
    reason = ""
    try:
        matrices = read_matrices(content, path)
    except InputError as error:
        if is_plain:
            raise
        # Files of instruments may look like texts.
        reason = str(error)
    if matrices:
        return choose_matrix(path, matrices, reading)
    if is_plain and suffix != ".dat":
        raise InputError(f"{path}: is neither .npy nor text; give one of them")
    return instruments_scan(path, reading, reason)


def _require_map(path: Path, heights: Heights) -> None:
    """Raise InputError unless numbers are a matrix of 2 x 2 or more, none of them infinite."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        shape = " x ".join(map(str, heights.shape)) or "a single number"
        raise InputError(f"{path}: holds {shape}; give 2-D heights, 2 x 2 or more")
    infinite = int(np.count_nonzero(np.isinf(heights)))
    if infinite:
        raise InputError(
            f"{path}: {infinite} of {heights.size} heights are infinite; give finite"
            " heights"
        )


def _may_hold_coordinates(scan: Scan) -> bool:
    """Tell whether a table may hold coordinates: if not, all of its numbers are heights.

    It may if its columns have names, if it is narrow, or if its first row or column rises or falls
    throughout.
    """
    numbers = scan.heights
    if scan.names or min(numbers.shape) <= MOST_COLUMNS:
        return True
    first_row = numbers[0, 1:]
    first_column = numbers[1:, 0]
    with np.errstate(over="ignore", invalid="ignore"):
        steps_along_borders = [np.diff(first_row), np.diff(first_column)]
    return any((steps > 0).all() or (steps < 0).all() for steps in steps_along_borders)


# suffixes of files without a map, which a folder of maps may contain
NO_MAPS = {
    ".toml",
    ".md",
    ".rst",
    ".pdf",
    ".html",
    ".json",
    ".yaml",
    ".yml",
    ".log",
    ".lock",
    ".png",
    ".jpg",
    ".jpeg",
    ".svg",
    ".py",
    ".xlsx",
    ".docx",
    ".surrogate",
    ".maps",
}


def files_in(path: Path) -> list[Path]:
    """Return the files of a folder that may hold maps, or the file if a file is given.

    Parameters
    ----------
    path : Path
        A folder or a file.

    Returns
    -------
    list of Path
        The file, whatever its name; or the files of the folder, sorted, without hidden files and
        without files whose suffix is in `NO_MAPS`. Folders inside the folder are not searched.

    Raises
    ------
    InputError
        If the path is neither a file nor a folder, or the folder holds no such file.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise InputError(f"{path}: is neither a file nor a folder")
    files = [
        file
        for file in sorted(path.iterdir())
        if file.is_file() and file.name[0] != "." and file.suffix.lower() not in NO_MAPS
    ]
    if not files:
        raise InputError(f"{path}: the folder holds no map")
    return files
