"""Read the files of instruments by SurfaceTopography, and help its readers over known faults.

Errors of its readers become one line that names the file, and nothing that they log is shown.
"""

from __future__ import annotations

import logging
import re
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np

from gen.maps.scan import Channel, Scan, choose_channel
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.runtime.files import LARGEST
from gen.runtime.memory import format_bytes
from gen.runtime.terminal import printable

# spacing of the nodes above which a NanoFocus file was read in the wrong unit [um]
WIDEST_NMS = 1e3
# spacing of such a file in um over that which SurfaceTopography reads
NM_FOR_MM = 1e-6
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

# A file of some kB can hold GB of zeros. What it holds is read up to `LARGEST` bytes, or up to this
# many times the size of the file; maps that were measured are packed by a factor below ten.
PACKED = 100
# most bytes of an archive's text, more than any describes a map with: it is parsed slowly
LONGEST_TEXT = 2**22
# most letters of a reader's error, which may quote the file
LONGEST_FAULT = 600


def instruments_scan(path: Path, reading: Reading, reason: str) -> Scan:
    """Read the map of a channel from an instrument's file.

    Parameters
    ----------
    path : Path
        The file.
    reading : Reading
        The settings, of which `channel` names the map; without it the first one with heights is
        read.
    reason : str
        Why the file is no text, for the message if no reader knows its format; "" if it does not
        look like text.

    Returns
    -------
    Scan
        The map in the units of the file, with its lengths if the file has them.

    Raises
    ------
    InputError
        If SurfaceTopography is not installed or cannot read the file, the file is empty or holds
        too many bytes for its size, or it has no such map of heights.
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
        except Exception as error:  # a broken file makes readers raise nearly anything
            fault = repr(error)[:LONGEST_FAULT]
            raise InputError(
                f"{path}: SurfaceTopography cannot read it: {fault}"
            ) from None


@contextmanager
def _silent() -> Iterator[None]:
    """Show no warnings and no logs: every reader that is tried warns about foreign formats."""
    level = logging.root.manager.disable
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logging.disable()
        try:
            yield
        finally:
            logging.disable(level)


def _check_members(path: Path) -> None:
    """Refuse an archive whose members are too large to be those of a measured map."""
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
    """Refuse a file that holds too many bytes for its own size."""
    packed = path.stat().st_size
    allowed = max(LARGEST, PACKED * packed)
    if unpacked > allowed:
        raise InputError(
            f"{path}: holds {format_bytes(unpacked)} in a file of {format_bytes(packed)};"
            f" at most {format_bytes(allowed)} are read of it"
        )


@dataclass(frozen=True)
class _OpenFile:
    """A file that a reader of SurfaceTopography understands."""

    reader: Any  # the reader, an instance of a class of SurfaceTopography
    remark: str  # what was mended in the file, in words; "" for nothing


@dataclass
class _Attempt:
    """What came of reading a file in one format."""

    file: _OpenFile | None = None  # the file, if it holds a map in this format
    line_scans: bool = False  # whether it holds line scans in this format
    fault: str = "it holds no map"  # why there is no map


def _open(path: Path, reason: str) -> _OpenFile:
    """Return a file with the first reader that finds a map in it; `reason` is why it is no text."""
    has_line_scans = False
    reasons = []
    for kind in _readers(path):
        attempt = _attempt(path, kind)
        if attempt.file is not None:
            return attempt.file
        has_line_scans = has_line_scans or attempt.line_scans
        if _has_suffix(path, kind) and not has_line_scans:
            reasons.append(
                f"SurfaceTopography cannot read it as {kind.name()}: {attempt.fault}"
            )
    if has_line_scans:
        raise InputError(f"{path}: it holds line scans only; give a map of heights")
    if reasons:
        raise InputError(f"{path}: {'; '.join(reasons)}")
    raise InputError(
        reason
        or f"{path}: no reader of SurfaceTopography knows its format; export it in another one"
    )


def _readers(path: Path) -> list[Any]:
    """Return the readers to try: first those of the suffix, then those that know the first bytes.

    They are classes of SurfaceTopography, each of them once.
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
    """Tell whether the suffix of a file is one of a reader's format."""
    suffix = path.suffix.lower().removeprefix(".")
    return suffix in {kind.format(), *kind.file_extensions()}


def _attempt(path: Path, kind: Any) -> _Attempt:
    """Try a reader on a file, and on a mended copy if the file has a known fault."""
    from SurfaceTopography.IO import open_topography

    attempt = _Attempt()
    for content in _contents(path, kind.format()):
        try:
            reader = open_topography(content.file, format=kind.format())
            dimensions = {channel.dim for channel in reader.channels}
        except Exception as error:  # a foreign file makes readers raise nearly anything
            attempt.fault = repr(error)[:LONGEST_FAULT]
            continue
        if 2 in dimensions:
            attempt.file = _OpenFile(reader, content.remark)
            break
        if 1 in dimensions:
            attempt.line_scans = True
    return attempt


@dataclass(frozen=True)
class _Content:
    """A file for a reader."""

    file: str | BytesIO  # path of the file, or a mended copy of it
    remark: str = ""  # what was mended, in words; "" for nothing


def _contents(path: Path, kind: str) -> Iterator[_Content]:
    """Yield a file and, if it is an x3p of another program, a mended copy of it."""
    yield _Content(str(path))
    if kind != "x3p":
        return
    with suppress(*DAMAGED), ZipFile(path) as archive:
        mended = _mended_x3p(archive)
        if mended is not None:
            yield mended


def _mended_x3p(archive: ZipFile) -> _Content | None:
    """Return a copy of an x3p file with its entries and revision as expected; None if they are."""
    names = archive.namelist()
    main_names = [name for name in names if Path(name).name == "main.xml"]
    main = min(main_names, key=len, default="")
    folder = main.removesuffix("main.xml")
    text = b""
    if main:
        text = archive.read(main)
    mended = REVISION.sub(rb"\1ISO5436 - 2000\2", text)
    remarks = []
    if folder:
        remarks.append(f"its entries lie in the folder {folder[:-1]!r}")
    if mended != text:
        remarks.append("its revision is written with another dash")
    if not remarks:
        return None
    copy = BytesIO()
    with ZipFile(copy, "w") as new_archive:
        for name in names:
            if name.startswith(folder) and name != folder:
                content = archive.read(name)
                if name == main:
                    content = mended
                new_archive.writestr(name.removeprefix(folder), content)
    return _Content(copy, f" ({' and '.join(remarks)})")


def _map_of(path: Path, reading: Reading, file: _OpenFile) -> Scan:
    """Read the map of a file that the reading names; refuse one that is too large for the file."""
    maps = {
        channel.index: channel for channel in file.reader.channels if channel.dim == 2
    }
    channels = [_channel(index, channel) for index, channel in maps.items()]
    chosen = choose_channel(path, channels, reading)
    channel = maps[chosen.index]
    nx, ny = channel.nb_grid_pts
    _check_size(path, np.dtype(np.float64).itemsize * nx * ny)
    has_lengths = channel.physical_sizes is not None
    lengths = {}
    if not has_lengths:  # the reader needs some, which are not used
        lengths["physical_sizes"] = channel.nb_grid_pts
    topography = file.reader.topography(channel_index=chosen.index, **lengths)
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
    )


def _channel(index: int, channel: Any) -> Channel:
    """Describe a channel of a reader of SurfaceTopography.

    Older versions of their channels do not tell whether they hold heights: they all do.
    """
    return Channel(
        index=index,
        name=str(channel.name),
        heights=bool(getattr(channel, "is_height_channel", True)),
        unit=str(getattr(channel, "data_unit", None) or ""),
    )
