"""Read the files of instruments by SurfaceTopography, and mend known faults of files and readers.

An error of a reader becomes an InputError of one line that names the file. Warnings and logs of
readers are not shown.
"""

from __future__ import annotations

import logging
import math
import re
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np

from gen.maps.channels import Channel, choose_channel
from gen.maps.scan import UNITS, UNKNOWN, Instrument, Scan, unit_of
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.runtime.files import LARGEST
from gen.runtime.memory import format_bytes
from gen.runtime.terminal import printable

# A NanoFocus file (.nms) has been read in mm instead of nm if the spacing that SurfaceTopography
# finds is above this [um].
WIDEST_NMS = 1e3
# factor that corrects the lengths of a NanoFocus file that has been read in mm instead of nm
NM_FOR_MM = 1e-6
# formats of texts, which `gen.maps.text` reads instead: their readers take points for heights
TABLES = {"asc", "xyz"}
# errors that a damaged, encrypted or foreign ZIP archive raises
DAMAGED = (OSError, EOFError, RuntimeError, BadZipFile, zlib.error)
# formats whose readers accept any file: they are tried only on files with their suffix
GUESSING = {"nms", "hgt"}
# revision in an x3p file, written with any dash; SurfaceTopography accepts a plain hyphen only
REVISION = re.compile(
    rb"(Revision>)\s*ISO ?5436\s*(?:-|\xe2\x80[\x90-\x95]|\x96|\x97|&#(?:8211|x2013);)\s*2000"
    rb"\s*(</)"
)

# A packed file of some kB can hold GB of zeros. It is refused if it holds more than `LARGEST` bytes
# and more than this many times its own size. Measured maps are packed by a factor below ten.
PACKED = 100
# Largest size of an XML text in an archive [bytes]. Descriptions of maps are shorter, and longer
# texts would take long to parse.
LONGEST_TEXT = 2**22
# largest number of letters of a reader's error that are shown, as the error may quote the file
LONGEST_FAULT = 600


def instruments_scan(path: Path, reading: Reading, reason: str) -> Scan:
    """Read the map of a channel from an instrument's file.

    Parameters
    ----------
    path : Path
        The file.
    reading : Reading
        The settings. Only `channel` is used: it names the map. If it is "", the first map with
        heights is read.
    reason : str
        Message of the error that is raised if no reader knows the format of the file: why the file
        cannot be read as a text. With "", the message is a general one.

    Returns
    -------
    Scan
        The map in the units of the file, with its lengths if the file states them.

    Raises
    ------
    InputError
        If SurfaceTopography is not installed or cannot read the file. If the file is empty, holds
        too many bytes for its size, or holds no heights or no channel of this name.
    """
    try:
        import SurfaceTopography  # noqa: F401
    except ModuleNotFoundError:
        from gen.runtime.installation import command_for

        raise InputError(
            f"{path}: only .npy and text can be read without SurfaceTopography:"
            f" {command_for('instruments')}"
        ) from None
    if not path.stat().st_size:
        raise InputError(f"{path}: is empty; give a file with a map of heights")
    _check_members(path)
    with _silent():
        try:
            return _map_of(path, reading, _open(path, reason))
        except InputError:
            raise
        except Exception as error:  # on a broken file, readers raise nearly any error
            fault = repr(error)[:LONGEST_FAULT]
            raise InputError(
                f"{path}: SurfaceTopography cannot read it: {fault}"
            ) from None


@contextmanager
def _silent() -> Iterator[None]:
    """Show no warnings and no logs during the block.

    Every reader that is tried on a foreign format would warn about it.
    """
    level = logging.root.manager.disable
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logging.disable()
        try:
            yield
        finally:
            logging.disable(level)


def _check_members(path: Path) -> None:
    """Raise InputError if a ZIP archive holds too long an XML text, or too many bytes for its size.

    Files that are no ZIP archives pass.
    """
    with suppress(*DAMAGED), ZipFile(path) as archive:
        members = archive.infolist()
        for member in members:
            is_text = member.filename.lower().endswith(".xml")
            if is_text and member.file_size > LONGEST_TEXT:
                name = printable(member.filename)
                raise InputError(
                    f"{path}: its text {name} has {format_bytes(member.file_size)}; at"
                    f" most {format_bytes(LONGEST_TEXT)} are read"
                )
        _check_size(path, sum(member.file_size for member in members))


def _check_size(path: Path, unpacked: int) -> None:
    """Raise InputError if a file holds too many bytes for its own size; see `PACKED`.

    `unpacked` is the number of bytes that its content has when it is read into memory.
    """
    packed = path.stat().st_size
    allowed = max(LARGEST, PACKED * packed)
    if unpacked > allowed:
        raise InputError(
            f"{path}: holds {format_bytes(unpacked)} in a file of {format_bytes(packed)};"
            f" at most {format_bytes(allowed)} are read of it"
        )


@dataclass(frozen=True)
class _OpenFile:
    """A file that is opened by a reader of SurfaceTopography."""

    reader: Any  # the reader, an instance of a class of SurfaceTopography
    # what was mended in the file, in words with a blank in front; "" for nothing
    remark: str


@dataclass
class _Attempt:
    """The result of reading a file in one format, filled by `_attempt`."""

    file: _OpenFile | None = None  # the file, if a map was found in it
    line_scans: bool = False  # whether line scans were found in it
    fault: str = "it holds no map"  # why no map was found


def _open(path: Path, reason: str) -> _OpenFile:
    """Open a file with the first reader that finds a map in it.

    InputError if no reader does. If no reader knows the format, its message is `reason`.
    """
    has_line_scans = False
    faults = []
    for kind in _readers(path):
        attempt = _attempt(path, kind)
        if attempt.file is not None:
            return attempt.file
        has_line_scans = has_line_scans or attempt.line_scans
        # Faults of readers of other suffixes would only confuse.
        if _has_suffix(path, kind) and not has_line_scans:
            faults.append(
                f"SurfaceTopography cannot read it as {kind.name()}: {attempt.fault}"
            )
    if has_line_scans:
        raise InputError(f"{path}: it holds line scans only; give a map of heights")
    if faults:
        raise InputError(f"{path}: {'; '.join(faults)}")
    raise InputError(
        reason
        or f"{path}: no reader of SurfaceTopography knows its format; export it in another one"
    )


def _readers(path: Path) -> list[Any]:
    """Return the readers to try on a file, each once, as classes of SurfaceTopography.

    Readers for the suffix of the file come first, then readers that recognise its first bytes.
    """
    from SurfaceTopography.IO import MagicMatch, readers

    with path.open("rb") as file:
        start = file.read(512)
    by_suffix = [kind for kind in readers if _has_suffix(path, kind)]
    by_start = [
        kind
        for kind in readers
        if kind.can_read(start) != MagicMatch.NO and kind.format() not in GUESSING
    ]
    ordered = dict.fromkeys([*by_suffix, *by_start])
    return [kind for kind in ordered if kind.format() not in TABLES]


def _has_suffix(path: Path, kind: Any) -> bool:
    """Tell whether a file has a suffix of the format of the reader class `kind`."""
    suffix = path.suffix.lower().removeprefix(".")
    return suffix in {kind.format(), *kind.file_extensions()}


def _attempt(path: Path, kind: Any) -> _Attempt:
    """Try the reader class `kind` on a file, and then on a mended copy if there is one."""
    from SurfaceTopography.IO import open_topography

    attempt = _Attempt()
    for content in _contents(path, kind.format()):
        try:
            reader = open_topography(content.file, format=kind.format())
            dimensions = {channel.dim for channel in reader.channels}
        except Exception as error:  # on a foreign file, readers raise nearly any error
            attempt.fault = repr(error)[:LONGEST_FAULT]
            continue
        # A channel of two dimensions is a map, one of one dimension a line scan.
        if 2 in dimensions:
            attempt.file = _OpenFile(reader=reader, remark=content.remark)
            break
        if 1 in dimensions:
            attempt.line_scans = True
    return attempt


@dataclass(frozen=True)
class _Content:
    """A file as it is handed to a reader."""

    file: str | BytesIO  # path of the file, or a mended copy of it in memory
    remark: str = ""  # what was mended, in words with a blank in front; "" for nothing


def _contents(path: Path, kind: str) -> Iterator[_Content]:
    """Yield a file; then, if its format `kind` is x3p and it has a known fault, a mended copy."""
    yield _Content(file=str(path))
    if kind != "x3p":
        return
    with suppress(*DAMAGED), ZipFile(path) as archive:
        mended = _mended_x3p(archive)
        if mended is not None:
            yield mended


def _mended_x3p(archive: ZipFile) -> _Content | None:
    """Return a copy of an x3p archive with its known faults mended; None if it has none.

    The faults are members inside a folder, and a revision with a dash that the reader rejects.
    """
    names = archive.namelist()
    main_names = [name for name in names if Path(name).name == "main.xml"]
    main = min(main_names, key=len, default="")  # the outermost one; "" if there is none
    folder = main.removesuffix("main.xml")
    text = b""
    if main:
        text = archive.read(main)
    mended_text = REVISION.sub(rb"\1ISO5436 - 2000\2", text)
    remarks = []
    if folder:
        remarks.append(f"its entries lie in the folder {folder[:-1]!r}")
    if mended_text != text:
        remarks.append("its revision is written with another dash")
    if not remarks:
        return None
    copy = BytesIO()
    with ZipFile(copy, "w") as new_archive:
        for name in names:
            # Members outside the folder, and the folder itself, are left out.
            if name.startswith(folder) and name != folder:
                content = archive.read(name)
                if name == main:
                    content = mended_text
                new_archive.writestr(name.removeprefix(folder), content)
    return _Content(file=copy, remark=f" ({' and '.join(remarks)})")


def _map_of(path: Path, reading: Reading, file: _OpenFile) -> Scan:
    """Read the map of an open file that the reading names, or else the first one with heights.

    InputError if the file has no map of the reading's name, or none with heights, or if the map is
    too large for the size of the file.
    """
    maps = {
        channel.index: channel for channel in file.reader.channels if channel.dim == 2
    }
    channels = [_channel(index, channel) for index, channel in maps.items()]
    chosen = choose_channel(path, channels, reading)
    channel = maps[chosen.index]
    nx, ny = channel.nb_grid_pts
    _check_size(path, np.dtype(np.float64).itemsize * nx * ny)
    has_lengths = channel.physical_sizes is not None
    options = {}
    # The reader needs lengths. If the file has none, it gets some that are not used below.
    if not has_lengths:
        options["physical_sizes"] = channel.nb_grid_pts
    topography = file.reader.topography(channel_index=chosen.index, **options)
    heights = np.ma.asarray(topography.heights(), dtype=np.float64)
    origin = chosen.origin + file.remark
    widths = None
    if has_lengths:
        width, length = (float(side) for side in topography.physical_sizes)
        if file.reader.format() == "nms" and width / nx > WIDEST_NMS:
            width *= NM_FOR_MM
            length *= NM_FOR_MM
            origin += " with the spacing in its header in nm (SurfaceTopography takes it for mm)"
        widths = (width, length)
    return Scan(
        heights=np.ma.filled(heights, np.nan),
        widths=widths,
        unit=topography.unit,
        origin=origin,
        repeats=bool(topography.is_periodic),
        instrument=_instrument(topography.info),
    )


def _instrument(info: Mapping[str, Any]) -> Instrument:
    """Return the limits of the instrument that the metadata of a map state.

    SurfaceTopography keeps them under "instrument", "parameters": `resolution`, "a simple cutoff of
    lateral scales", and `tip_radius`, each with a value and a unit.
    """
    try:
        parameters = info["instrument"]["parameters"]
    except (KeyError, TypeError):  # the reader knows no instrument, or nothing of it
        return UNKNOWN
    return Instrument(
        cut_off=_length(parameters, "resolution"),
        tip_radius=_length(parameters, "tip_radius"),
    )


def _length(parameters: Any, name: str) -> float | None:
    """Return a length above 0 of an instrument [um]; None if it is missing or no such length."""
    try:
        value = float(parameters[name]["value"])
        length = value * UNITS[unit_of(str(parameters[name]["unit"]))]
    except (KeyError, TypeError, ValueError):
        return None
    return length if 0.0 < length < math.inf else None


def _channel(index: int, channel: Any) -> Channel:
    """Describe a channel of a reader of SurfaceTopography, which has this index in the file."""
    # In versions of SurfaceTopography without this attribute, every channel holds heights.
    is_height = bool(getattr(channel, "is_height_channel", True))
    return Channel(
        index=index,
        name=str(channel.name),
        holds_heights=is_height,
        unit=str(getattr(channel, "data_unit", None) or ""),
    )
