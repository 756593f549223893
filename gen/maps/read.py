"""Read measured topographies: heights and lengths of an instrument's file, converted to um.

`gen.maps.text` reads text, SurfaceTopography, whose home is here, the files of instruments.
`gen.maps.scan` tells whether the numbers are heights.
"""

from __future__ import annotations

import logging
import re
import warnings
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile, ZipFile

import numpy as np

from gen.arrays import Heights
from gen.maps.scan import Channel, Scan, arranged, choose_channel
from gen.maps.settings import Asked, Reading, numbers_in, said
from gen.maps.text import decoded, matrices
from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from gen.runtime.numbers import MAGNITUDES, magnitude

if TYPE_CHECKING:  # surfaces are described without the solver
    from bem.problem import Boundary

Sides = tuple[float, float]

METRIC = {"m": 1e6, "cm": 1e4, "mm": 1e3, "um": 1.0, "µm": 1.0, "μm": 1.0, "nm": 1e-3, "pm": 1e-6}
UNITS = METRIC | {"A": 1e-4, "Å": 1e-4, "inch": 25.4e3}  # length of each unit [um]
# units by other names in the singular; those in metres are read by their prefix
WORDS = {"micron": "um", "angstrom": "A", "ångström": "A", "in": "inch", '"': "inch"}
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
    # whether the file says that its map is periodic; the boundary is what the user says
    repeats: bool = False
    asked: Asked = "option"  # who asks, for the words of messages

    @property
    def spacing(self) -> Sides:
        """Distance of the nodes along x and y [um]; the rule of `bem`, without loading it."""
        nx, ny = (nodes - (self.boundary == "free") for nodes in self.heights.shape)
        return self.sides[0] / nx, self.sides[1] / ny

    @property
    def missing(self) -> int:
        """Number of nodes without a height."""
        return int(np.count_nonzero(np.isnan(self.heights)))


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
    overrule, side, unit = (said(key, reading.asked) for key in ("override_scale", "side", "unit"))
    if reading.override_scale and not (reading.side or reading.unit):
        raise InputError(f"{overrule}: give {side}, {unit} or both, to overrule the file's")
    scan = _scan(path, reading)
    overruled: list[str] = []
    heights_unit = _agreed_unit(path, scan, reading, overruled)
    sides = _agreed_sides(path, scan, heights_unit, reading, boundary, overruled)
    with np.errstate(over="ignore"):
        heights = scan.heights * (UNITS[_unit(heights_unit)] if heights_unit else 1.0)
    if np.isnan(heights).all():
        raise InputError(f"{path}: all of its {heights.size} heights are missing; measure again")
    if np.nanmax(np.abs(heights)) > MAGNITUDES[1]:
        raise InputError(
            f"{path}: heights of {np.nanmax(np.abs(heights)):.3g} um; check their unit"
        )
    if not all(0 < length < np.inf for length in sides):
        raise InputError(f"{path}: its lengths are beyond what numbers hold; give others")
    units = f"heights in {heights_unit}" if heights_unit else "heights taken as um"
    if scan.widths is not None:
        units = f"lengths in {heights_unit}"
        if scan.length_unit not in {None, heights_unit}:
            units = f"lengths in {scan.length_unit}, heights in {heights_unit}"
    found = Topography(
        name=str(path),
        heights=heights,
        sides=sides,
        boundary=boundary,
        unit=heights_unit or "",
        asked=reading.asked,
        repeats=scan.repeats,
    )
    (nx, ny), holes = heights.shape, found.missing
    span = float(np.nanmax(heights)) - float(np.nanmin(heights))
    share = f"{holes} missing ({100 * holes / heights.size:.3g} %)"
    steps = [f"read {nx} x {ny} nodes{scan.origin}, {units}, {share}"]
    steps += [f"OVERRULED by {overrule}: {change}" for change in overruled]
    distrust = [f"the file's own scale is overruled: {change}" for change in overruled]
    distrust += [
        f"the file says {remark!r}, which is not read: check {side} and {unit} against it"
        for remark in scan.remarks
    ]
    numbers = {step: f"its nodes are {step:.3g} um apart" for step in found.spacing}
    numbers[span] = f"its heights span {span:.3g} um"
    distrust += [
        f"{absurd}, which no instrument measures; compare with the instrument's own display, and"
        f" overrule the file by {side} or {unit} with {overrule}"
        for number, absurd in numbers.items()
        if number and not NEAREST <= number <= WIDEST
    ]
    return replace(found, steps=tuple(steps), warnings=tuple(distrust))


def sides_from(text: str, asked: Asked = "option") -> Sides:
    """Return the scan lengths along x and y [um] from "1000" or "1000,500".

    Raises InputError if the text is anything else, or a length is not above 0.
    """
    lengths = numbers_in(text)
    if len(lengths) not in {1, 2} or not all(map(magnitude, lengths)):
        raise InputError(
            f"{said('side', asked)} {text!r}: give the scan length in um, a number above 0, or two"
            " as 1000,500"
        )
    return lengths[0], lengths[-1]


def _factor(unit: str, name: str, advice: str = "give") -> float:
    """Return the length of a unit [um]; with an unknown unit, give this advice."""
    if _unit(unit) not in UNITS:
        raise InputError(f"{name} {unit!r}: {advice} one of {', '.join(UNITS)}")
    return UNITS[_unit(unit)]


def _unit(name: str) -> str:
    """Return the key of `UNITS` for a unit by one of its names; other names as they are."""
    word = name.lower().removesuffix("s").removesuffix("e")
    metres = re.fullmatch("(p|n|m|c|)(?:ico|ano|illi|enti|)(micro|)met(?:er|r)", word)
    if metres:
        return ("u" if metres[2] else metres[1]) + "m"
    known = word in UNITS and len(word) > 1  # M and a are no units of length
    return name if name in UNITS else WORDS.get(word, word if known else name)


def _agreed_unit(path: Path, scan: Scan, reading: Reading, overruled: list[str]) -> str | None:
    """Return the unit of the heights, from the file or the user; None if it is um by default."""
    own, given, named = scan.unit, reading.unit, said("unit", reading.asked)
    factor = _factor(given, named) if given else None
    if not own:
        if not given and (scan.widths is not None or own is None):
            raise InputError(f"{path}: names no unit; give {named}, one of {', '.join(UNITS)}")
        return given or None
    if not given or factor == UNITS.get(_unit(own)):
        _factor(own, f"{path}: unit")
        return given or own
    if not reading.override_scale:
        raise InputError(
            f"{path}: its {'lengths' if scan.length_unit is None else 'heights'} are in {own},"
            f" {named} says {given}; leave that out, or overrule the file by"
            f" {said('override_scale', reading.asked)}"
        )
    overruled.append(f"unit {own}, taken as {given}")
    return given


def _agreed_sides(
    path: Path,
    scan: Scan,
    unit: str | None,
    reading: Reading,
    boundary: Boundary,
    overruled: list[str],
) -> Sides:
    """Return the lengths of the patch [um], from the file or the user."""
    side, named, own_scale = reading.side, said("side", reading.asked), ""
    overrule, nodes = said("override_scale", reading.asked), scan.heights.shape
    lengths = [nodes[axis] - (boundary == "free") for axis in (0, 1)]  # in spacings
    if scan.widths is not None:
        length_unit = scan.length_unit or unit or "um"
        own_scale = f"lengths in {length_unit}"
        if not side or not reading.override_scale or _unit(length_unit) in UNITS:
            advice = f"give {named} with {overrule}, or lengths in"
            factor = _factor(length_unit, f"{path}: unit of lengths", advice)
            x, y = (w * n / of for w, n, of in zip(scan.widths, lengths, nodes, strict=True))
            own = x * factor, y * factor
            if not side or np.allclose(sides_from(side, reading.asked), own, rtol=1e-3):
                return own
            own_scale = f"{own[0]:.6g} x {own[1]:.6g} um"
        if not reading.override_scale:
            raise InputError(
                f"{path}: is {own_scale}, {named} says {side}; leave that out, or overrule the file"
                f" by {overrule}"
            )
    if not side:
        hint = "".join(f" (it says {remark!r})" for remark in scan.remarks[:1])
        raise InputError(f"{path}: holds no lengths; give {named}, the scan length in um{hint}")
    given = sides_from(side, reading.asked)
    if nodes[0] != nodes[1] and "," not in side:
        square = given[0] / lengths[0] * lengths[1]
        raise InputError(
            f"{path}: has {nodes[0]} x {nodes[1]} nodes; give {named} two lengths,"
            f" {given[0]:g},{square:g} for square cells or {given[0]:g},{given[0]:g} for a square"
            " patch"
        )
    if own_scale:
        overruled.append(f"{own_scale}, taken as {given[0]:g} x {given[1]:g} um")
    return given


def _scan(path: Path, reading: Reading) -> Scan:
    """Read a .npy or text file, whatever its suffix, or a file of an instrument."""
    own, reason = path.suffix.lower() in OWN_SUFFIXES, ""
    try:
        found = matrices_in(path)
        if found and not own:
            checked(found[0].heights, path)
    except InputError as error:
        if own:
            raise
        found, reason = [], str(error)
    if not found:
        if own and path.suffix.lower() != ".dat":
            raise InputError(f"{path}: is neither .npy nor text; give one of them")
        scan = _instruments_scan(path, reading, reason)
        return arranged(path, replace(scan, heights=checked(scan.heights, path)))
    overruled = reading.override_scale and bool(reading.unit)  # its unit need not be a length
    channels = [
        Channel(
            place,
            each.channel or f"matrix {place}",
            not each.unit or overruled or _unit(each.unit) in UNITS,
            each.unit or "",
        )
        for place, each in enumerate(found)
    ]
    taken, origin = 0, ""
    if reading.channel or len(found) > 1 or not channels[0].heights:
        taken, origin = choose_channel(path, channels, reading)
    scan = found[taken]
    heights, widths = checked(scan.heights, path), scan.widths
    x_unit, y_unit = scan.length_unit or "", scan.y_unit
    differ = bool(y_unit) and _unit(y_unit) != _unit(x_unit)
    if widths is not None:
        if differ:
            ratio = _factor(y_unit, f"{path}: unit") / _factor(x_unit, f"{path}: unit")
            widths = widths[0], widths[1] * ratio
        heights = np.ascontiguousarray(heights.T)
        origin += " under a header, x along its lines"
    elif differ:
        raise InputError(f"{path}: has x in {x_unit} and y in {y_unit}; give both in one unit")
    scan = arranged(path, replace(scan, heights=heights, widths=widths, origin=origin))
    # An overflow is refused by `read`; a signalling NaN is a hole like every NaN.
    with np.errstate(over="ignore", invalid="ignore"):
        return replace(scan, heights=scan.factor * scan.heights)


def matrices_in(path: Path) -> list[Scan]:
    """Read the matrices of a .npy or text file, none of another one; never unpickle objects."""
    require_file(path)
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        fault = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{path}: cannot be read ({fault}); give a .npy or text file") from error
    if path.suffix.lower() != ".npy" and not content.startswith(np.lib.format.MAGIC_PREFIX):
        words = decoded(content)
        return [] if words is None else matrices(words, path)
    try:
        with np.errstate(all="ignore"):  # of the numbers of nodes in a broken header
            array = np.lib.format.read_array(BytesIO(content), allow_pickle=False)
    except Exception as error:  # a broken header makes numpy raise nearly anything
        fault = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: not a whole .npy file ({fault}); save real numbers") from error
    if array.dtype.kind not in "iuf":
        raise InputError(f"{path}: holds {array.dtype} values; save real numbers (float64)")
    with np.errstate(over="ignore"):  # wider floats become infinite, and `checked` counts them
        return [Scan(np.asarray(array, dtype=np.float64, order="C"), unit="")]


def checked(heights: Heights, path: Path) -> Heights:
    """Refuse heights that are not 2-D, 2 x 2 or more, and finite or NaN."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        shape = " x ".join(str(length) for length in heights.shape) or "a single number"
        content = shape if heights.size else "no heights"
        raise InputError(f"{path}: holds {content}; give 2-D heights, 2 x 2 or more")
    refused = int(np.count_nonzero(np.isinf(heights)))
    if refused:
        raise InputError(
            f"{path}: {refused} of {heights.size} heights are infinite; give finite heights"
        )
    return heights


# spacing of the nodes above which a NanoFocus file was read in the wrong unit [um]
WIDEST_NMS = 1e3
# readers of tables of numbers, which `gen.maps.text` reads: they take points for heights
TABLES = {"asc", "xyz"}
# errors of damaged, encrypted and foreign ZIP archives
DAMAGED = (OSError, EOFError, RuntimeError, BadZipFile, zlib.error)
# readers that take any file for theirs: they are tried for files of their suffix only
GUESSING = {"nms", "hgt"}
# revision of an x3p file with any dash; SurfaceTopography knows it with one dash only
REVISION = re.compile(
    rb"(Revision>)\s*ISO ?5436\s*(?:-|\xe2\x80[\x90-\x95]|\x96|\x97|&#(?:8211|x2013);)\s*2000"
    rb"\s*(</)"
)


def _instruments_scan(path: Path, reading: Reading, reason: str) -> Scan:
    """Read the map of a channel from an instrument's file by SurfaceTopography."""
    try:
        import SurfaceTopography  # noqa: F401
    except ImportError:
        from gen.runtime.installation import command_for

        raise InputError(
            f"{path}: only .npy and text can be read without SurfaceTopography:"
            f" {command_for('instruments')}"
        ) from None
    if not require_file(path).is_file():
        raise InputError(f"{path}: is no file that could be read")
    if not path.stat().st_size:
        raise InputError(f"{path}: is empty; give a file with a map of heights")
    logged = logging.root.manager.disable
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # every reader that is tried warns about foreign formats
        logging.disable()
        try:
            return _map_of(path, reading, *_opened(path, reason))
        except InputError:
            raise
        except Exception as error:  # a broken file makes its readers raise nearly anything
            raise InputError(f"{path}: SurfaceTopography cannot read it: {error!r:.600}") from None
        finally:
            logging.disable(logged)


def _opened(path: Path, reason: str) -> tuple[Any, str]:
    """Return the first reader that finds a map in a file, and what was mended in it, in words."""
    from SurfaceTopography.IO import MagicMatch, open_topography, readers

    suffix = path.suffix.lower().removeprefix(".")
    with path.open("rb") as file:
        start = file.read(512)
    named = [each for each in readers if suffix in {each.format(), *each.file_extensions()}]
    others = [each for each in readers if each.can_read(start) != MagicMatch.NO]
    tried = [*named, *(each for each in others if each.format() not in GUESSING)]
    reasons, scans = [], False
    for kind in dict.fromkeys(each for each in tried if each.format() not in TABLES):
        fault = "it holds no map"
        for content, remark in _contents(path, kind.format()):
            try:
                reader = open_topography(content, format=kind.format())
                dimensions = {channel.dim for channel in reader.channels}
            except Exception as error:  # a foreign file makes readers raise nearly anything
                fault = f"{error!r:.600}"  # it may quote the file
                continue
            if 2 in dimensions:
                return reader, remark
            scans |= 1 in dimensions
        if kind in named and not scans:
            reasons.append(f"SurfaceTopography cannot read it as {kind.name()}: {fault}")
    if scans:
        raise InputError(f"{path}: it holds line scans only; give a map of heights")
    unknown = f"{path}: no reader of SurfaceTopography knows its format; export it in another one"
    raise InputError(f"{path}: {'; '.join(reasons)}" if reasons else reason or unknown)


def _contents(path: Path, kind: str) -> Iterator[tuple[str | BytesIO, str]]:
    """Yield a file and, if it is of another program's x3p, a mended copy with a remark on it."""
    yield str(path), ""
    if kind != "x3p":
        return
    with suppress(*DAMAGED), ZipFile(path) as archive:
        names = archive.namelist()
        main = min((each for each in names if Path(each).name == "main.xml"), key=len, default="")
        folder = main.removesuffix("main.xml")
        text = archive.read(main) if main else b""
        mended = REVISION.sub(rb"\1ISO5436 - 2000\2", text)
        remarks = [f"its entries lie in the folder {folder[:-1]!r}"] if folder else []
        remarks += ["its revision is written with another dash"] if mended != text else []
        if remarks:
            copy = BytesIO()
            with ZipFile(copy, "w") as whole:
                for name in names:
                    if name.startswith(folder) and name != folder:
                        content = mended if name == main else archive.read(name)
                        whole.writestr(name.removeprefix(folder), content)
            yield copy, f" ({' and '.join(remarks)})"


def _map_of(path: Path, reading: Reading, reader: Any, remark: str) -> Scan:
    """Read the wanted map of an open file."""
    maps = {channel.index: channel for channel in reader.channels if channel.dim == 2}
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
    taken, words = choose_channel(path, channels, reading)
    channel = maps[taken]
    nx, ny = channel.nb_grid_pts
    if min(nx, ny) < 2:
        raise InputError(f"{path}: holds {nx} x {ny} heights; give 2-D heights, 2 x 2 or more")
    given = {} if channel.physical_sizes is not None else {"physical_sizes": channel.nb_grid_pts}
    topography = reader.topography(channel_index=taken, **given)
    heights = np.ma.filled(np.ma.asarray(topography.heights(), dtype=np.float64), np.nan)
    origin, widths = words + remark, None
    if channel.physical_sizes is not None:
        width, length = (float(size) for size in topography.physical_sizes)
        widths = width, length
        if reader.format() == "nms" and width / nx > WIDEST_NMS:
            widths = 1e-6 * width, 1e-6 * length
            origin += " with the spacing in its header in nm (SurfaceTopography takes it for mm)"
    repeats = bool(topography.is_periodic)
    return Scan(heights, widths, topography.unit, origin=origin, repeats=repeats)


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
    inside = [each for each in sorted(path.iterdir()) if each.is_file() and each.name[0] != "."]
    found = [each for each in inside if each.suffix.lower() not in OTHERS]
    if not found:
        raise InputError(f"{path}: the folder holds no map")
    return found
