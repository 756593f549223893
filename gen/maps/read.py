"""Read measured topographies: heights and lengths of a file, converted to um.

The numbers are those of a .npy file, of a text (`gen.maps.text`) or of an instrument's file
(`gen.maps.instruments`); `gen.maps.scan` tells whether they are heights, and knows the units.
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
from gen.maps.scan import (
    MOST_COLUMNS,
    NAMED_UNITS,
    UNITS,
    Scan,
    arranged,
    factor_of,
    unit_of,
)
from gen.maps.settings import Asked, Reading, said
from gen.material import LARGEST, SMALLEST
from gen.runtime.errors import InputError
from gen.runtime.files import require_file

if TYPE_CHECKING:  # surfaces are described without the solver
    from bem.problem import Boundary

Sides = tuple[float, float]

# spacings of the nodes of a measured map, at least and at most [um]: 1 pm and 1 cm
NEAREST, WIDEST = 1e-6, 1e4
# suffixes of files that need no SurfaceTopography
OWN_SUFFIXES = {".npy", ".txt", ".dat", ".csv", ".asc", ""}


@dataclass(frozen=True, eq=False)
class Topography:
    """A surface from a file."""

    name: str  # name of the file
    heights: Heights  # heights, NaN at holes [um], shape (nx, ny)
    sides: Sides  # lengths of the patch along x and y [um]
    steps: tuple[str, ...] = ()  # one line for each step from the file to these heights
    warnings: tuple[str, ...] = ()  # one line for each reason to distrust the heights
    # {"free", "periodic", "mirror"}: boundary of the patch: the outer nodes of a free one lie on
    # its border, and a patch without edges is made of cells
    boundary: Boundary = "free"
    unit: str = ""  # unit of the heights in the file, "" if it names none and they are taken as um
    # steps of the preparation, which no warning advises again: "crop", "level plane"
    followed: frozenset[str] = frozenset()
    asked: Asked = "option"  # who asks, for the words of messages
    apart: Sides | None = (
        None  # distance of the nodes [um], where it is not that of the sides
    )
    # nodes that a warning calls codes, pits or spikes, which other warnings leave out
    doubtful: NDArray[np.bool_] | None = None

    @property
    def spacing(self) -> Sides:
        """Distance of the nodes along x and y [um]; the rule of `bem`, without loading it."""
        if self.apart is not None:
            return self.apart
        nx, ny = (nodes - (self.boundary == "free") for nodes in self.heights.shape)
        return self.sides[0] / nx, self.sides[1] / ny

    @property
    def missing(self) -> int:
        """Number of nodes without a height."""
        return int(np.count_nonzero(np.isnan(self.heights)))

    def changed(
        self, heights: Heights, step: str, spacing: Sides | None = None
    ) -> Topography:
        """Return it with new heights, perhaps of a new spacing [um], and a step more."""
        (x, y), apart = self.sides, self.apart
        if spacing is not None:
            apart = None
            (nx, ny), (dx, dy), outer = heights.shape, spacing, self.boundary == "free"
            x, y = (nx - outer) * dx, (ny - outer) * dy
        steps = (*self.steps, *filter(None, [step]))
        doubtful = self.doubtful if heights.shape == self.heights.shape else None
        return replace(
            self,
            heights=heights,
            sides=(x, y),
            steps=steps,
            apart=apart,
            doubtful=doubtful,
        )

    def advised(self, fault: str, *remedies: tuple[str, str]) -> str:
        """Add remedies to a fault, each a step and what it does, but none that is followed."""
        followed = {*self.followed, f"boundary {self.boundary}"}
        followed |= {"unit m"} if self.unit else set()
        left = [
            f"{said(step, self.asked)} {does}"
            for step, does in remedies
            if step not in followed
        ]
        return f"{fault}: {', '.join(left)}" if left else fault


def in_words(spacing: Sides, digits: int = 6) -> str:
    """Write two spacings to some digits, once if they are the same."""
    x, y = (f"{step:.{digits}g}" for step in spacing)
    return x if x == y else f"{x} x {y}"


def read(path: Path, reading: Reading, boundary: Boundary = "free") -> Topography:
    """Read a surface from a file.

    Lengths and unit are to be given if the file lacks them; otherwise they are refused. Raises
    InputError if the file cannot be read or holds no map of heights, its channel is unknown, or
    a length or unit is missing, wrong, or given although the file has it.
    """
    asked, overruled, scan = reading.asked, list[str](), _scan(path, reading)
    unit = _agreed_unit(path, scan, reading, overruled)
    sides = _agreed_sides(path, scan, unit, reading, boundary, overruled)
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # a signalling NaN is a hole like any other
        heights = scan.factor * scan.heights * (UNITS[unit_of(unit)] if unit else 1.0)
    holes = int(np.count_nonzero(np.isnan(heights)))
    if holes == heights.size:
        raise InputError(f"{path}: all of its {holes} heights are missing; measure again")
    if not all(0 < length < np.inf for length in sides):
        raise InputError(f"{path}: its lengths are beyond what numbers hold; give others")
    units = f"heights in {unit}" if unit else "heights taken as um"
    if scan.widths is not None:
        apart = scan.length_unit not in {None, unit}
        units = (
            f"lengths in {scan.length_unit}, {units}" if apart else f"lengths in {unit}"
        )
    (nx, ny), share = heights.shape, 100 * holes / heights.size
    steps = [
        f"read {nx} x {ny} nodes{scan.origin}, {units}, {holes} missing ({share:.3g} %)"
    ]
    steps += [
        f"OVERRULED by {said('override_scale', asked)}: {each}" for each in overruled
    ]
    found = Topography(
        str(path), heights, sides, tuple(steps), (), boundary, unit, asked=asked
    )
    doubts = [f"the file's own scale is overruled: {each}" for each in overruled]
    doubts += [
        f"the file says {remark!r}, which is not read: check {said('side', asked)} and"
        f" {said('unit', asked)} against it"
        for remark in scan.remarks
    ]
    doubts += [
        f"its nodes are {step:.3g} um apart, {beyond_instruments(asked)}"
        for step in dict.fromkeys(found.spacing)
        if not NEAREST <= step <= WIDEST
    ]
    if scan.repeats and boundary != "periodic" and asked == "option" and not reading.crop:
        doubts.append(
            f"the file says that its map is periodic, and it is taken as a {boundary} patch:"
            " --boundary periodic of gen describe, contact and law follows the file"
        )
    return replace(found, warnings=tuple(doubts))


def beyond_instruments(asked: Asked) -> str:
    """Return what is said of a length that no instrument measures."""
    return (
        "which no instrument measures; compare with the instrument's own display, and overrule the"
        f" file by {said('side', asked)} or {said('unit', asked)} with"
        f" {said('override_scale', asked)}"
    )


def _agreed_unit(path: Path, scan: Scan, reading: Reading, overruled: list[str]) -> str:
    """Return the unit of the heights, from the file or the user; "" if it is um by default."""
    own, given, asked = scan.unit, reading.unit, reading.asked
    if reading.override_scale and not (reading.side or given):
        overrule, side, unit = (
            said(key, asked) for key in ("override_scale", "side", "unit")
        )
        raise InputError(
            f"{overrule}: give {side}, {unit} or both, to overrule the file's"
        )
    factor = factor_of(given, said("unit", asked)) if given else None
    if not own:
        if not given and (scan.widths is not None or own is None):
            named = f"{said('unit', asked)}, one of {NAMED_UNITS}"
            raise InputError(f"{path}: names no unit; give {named}")
        return given
    if not given or factor == UNITS.get(unit_of(own)):
        factor_of(own, f"{path}: unit")
        return given or own
    if not reading.override_scale:
        raise InputError(
            f"{path}: its {'lengths' if scan.length_unit is None else 'heights'} are in {own},"
            f" {said('unit', asked)} says {given}; leave that out, or overrule the file by"
            f" {said('override_scale', asked)}"
        )
    overruled.append(f"unit {own}, taken as {given}")
    return given


def _agreed_sides(
    path: Path,
    scan: Scan,
    unit: str,
    reading: Reading,
    boundary: Boundary,
    overruled: list[str],
) -> Sides:
    """Return the lengths of the patch [um], from the file or the user."""
    side, asked, nodes, own_scale = reading.side, reading.asked, scan.heights.shape, ""
    lengths = [nodes[axis] - (boundary == "free") for axis in (0, 1)]  # in spacings
    between = ""
    if scan.widths is not None:
        length_unit = scan.length_unit or unit or "um"
        own_scale = f"lengths in {length_unit}"
        if not side or not reading.override_scale or unit_of(length_unit) in UNITS:
            override = said("override_scale", asked)
            advice = f"give {said('side', asked)} with {override}, or lengths in"
            factor = factor_of(length_unit, f"{path}: unit of lengths", advice)
            x, y = (
                w * n / of for w, n, of in zip(scan.widths, lengths, nodes, strict=True)
            )
            own = x * factor, y * factor
            whole = tuple(width * factor for width in scan.widths)
            known = [own] if reading.override_scale else [own, whole]
            if not side or any(
                np.allclose(sides_from(side, asked), each, 1e-3) for each in known
            ):
                return own
            own_scale = f"{own[0]:.6g} x {own[1]:.6g} um"
            between = " between its outer nodes" if boundary == "free" else ""
        if not reading.override_scale:
            raise InputError(
                f"{path}: is {own_scale}{between}, {said('side', asked)} says {side}; leave that"
                f" out, or overrule the file by {said('override_scale', asked)}"
            )
    if not side:
        hint = "".join(f" (it says {remark!r})" for remark in scan.remarks[:1])
        named = said("side", asked)
        raise InputError(
            f"{path}: holds no lengths; give {named}, the scan length in um{hint}"
        )
    given = sides_from(side, asked)
    if nodes[0] != nodes[1] and "," not in side:
        square = given[0] / lengths[0] * lengths[1]
        raise InputError(
            f"{path}: has {nodes[0]} x {nodes[1]} nodes; give {said('side', asked)} two lengths,"
            f" {given[0]:g},{square:g} for square cells or {given[0]:g},{given[0]:g} for a square"
            " patch"
        )
    if own_scale:
        overruled.append(f"{own_scale}, taken as {given[0]:g} x {given[1]:g} um")
    return given


def sides_from(text: str, asked: Asked = "option") -> Sides:
    """Return the scan lengths along x and y [um] from "1000" or "1000,500".

    Raises InputError if the text is anything else, or a length is below `SMALLEST` or above
    `LARGEST`.
    """
    with suppress(ValueError):
        lengths = [float(part) for part in text.split(",")]
        if len(lengths) in {1, 2} and all(SMALLEST < each < LARGEST for each in lengths):
            return lengths[0], lengths[-1]
    raise InputError(
        f"{said('side', asked)} {text!r}: give the scan length in um, a number from"
        f" {SMALLEST:g} to {LARGEST:g}, or two as 1000,500"
    )


def _scan(path: Path, reading: Reading) -> Scan:
    """Read a .npy or text file, whatever its suffix, or a file of an instrument.

    Objects are never unpickled.
    """
    try:
        content = require_file(path).read_bytes()
    except (OSError, ValueError) as error:
        fault = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(
            f"{path}: cannot be read ({fault}); give a map of heights"
        ) from error
    if path.suffix.lower() != ".npy" and not content.startswith(
        np.lib.format.MAGIC_PREFIX
    ):
        scan = _of_text_or_instrument(path, content, reading)
    else:
        try:
            with np.errstate(all="ignore"):  # of the numbers of nodes in a broken header
                array = np.lib.format.read_array(BytesIO(content), allow_pickle=False)
        except Exception as error:  # a broken header makes numpy raise nearly anything
            fault = " ".join(str(error).split())[:120]
            message = f"{path}: not a whole .npy file ({fault}); save real numbers"
            raise InputError(message) from error
        if array.dtype.kind not in "iuf":
            raise InputError(
                f"{path}: holds {array.dtype} values; save real numbers (float64)"
            )
        with np.errstate(
            over="ignore"
        ):  # wider floats become infinite, and are counted below
            scan = Scan(np.asarray(array, dtype=np.float64, order="C"), unit="")
        if reading.channel:
            from gen.maps.text import chosen

            scan = chosen(path, [scan], reading)
    heights = scan.heights
    if heights.ndim != 2 or min(heights.shape) < 2:
        shape = " x ".join(map(str, heights.shape)) or "a single number"
        raise InputError(f"{path}: holds {shape}; give 2-D heights, 2 x 2 or more")
    if refused := int(np.count_nonzero(np.isinf(heights))):
        raise InputError(
            f"{path}: {refused} of {heights.size} heights are infinite; give finite heights"
        )
    # Only a narrow table, or one whose first row or column rises or falls throughout, can hold
    # anything but heights.
    with np.errstate(over="ignore", invalid="ignore"):
        axes = [np.diff(heights[0, 1:]), np.diff(heights[1:, 0])]
    steady = any((each > 0).all() or (each < 0).all() for each in axes)
    if scan.widths is None and (
        scan.names or steady or min(heights.shape) <= MOST_COLUMNS
    ):
        return arranged(path, scan)
    return scan


def _of_text_or_instrument(path: Path, content: bytes, reading: Reading) -> Scan:
    """Read the map of a text, or of an instrument's file if it is none."""
    from gen.maps.text import chosen, matrices

    own, found, reason = path.suffix.lower() in OWN_SUFFIXES, list[Scan](), ""
    try:
        found = matrices(content, path)
    except InputError as error:
        if own:
            raise
        reason = str(error)
    if found:
        return chosen(path, found, reading)
    if own and path.suffix.lower() != ".dat":
        raise InputError(f"{path}: is neither .npy nor text; give one of them")
    from gen.maps.instruments import instruments_scan

    return instruments_scan(path, reading, reason)


# suffixes of files that stand in folders of maps and hold none
OTHERS = {
    *(".toml", ".md", ".rst", ".pdf", ".html", ".json", ".yaml", ".yml", ".log", ".lock"),
    *(".png", ".jpg", ".jpeg", ".svg", ".py", ".xlsx", ".docx", ".surrogate", ".maps"),
}


def files_in(path: Path) -> list[Path]:
    """Return the files of a folder that may hold maps, sorted, or the file itself."""
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise InputError(f"{path}: is neither a file nor a folder")
    inside = [
        each for each in sorted(path.iterdir()) if each.is_file() and each.name[0] != "."
    ]
    found = [each for each in inside if each.suffix.lower() not in OTHERS]
    if not found:
        raise InputError(f"{path}: the folder holds no map")
    return found
