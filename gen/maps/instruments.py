"""Read the files of instruments by SurfaceTopography, with what its readers have to be helped over.

Errors of its readers become one line that names the file, and nothing that they log is shown.
"""

from __future__ import annotations

import logging
import re
import warnings
import zlib
from collections.abc import Iterator
from contextlib import suppress
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


def instruments_scan(path: Path, reading: Reading, reason: str) -> Scan:
    """Read the map of a channel from an instrument's file; `reason` is why it is no text."""
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
    logged = logging.root.manager.disable
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # every reader that is tried warns about foreign formats
        logging.disable()
        try:
            return _map_of(path, reading, *_opened(path, reason))
        except InputError:
            raise
        except (
            Exception
        ) as error:  # a broken file makes its readers raise nearly anything
            raise InputError(
                f"{path}: SurfaceTopography cannot read it: {error!r:.600}"
            ) from None
        finally:
            logging.disable(logged)


def _check_members(path: Path) -> None:
    """Refuse an archive whose members are too large to be those of a measured map."""
    with suppress(*DAMAGED), ZipFile(path) as archive:
        members = archive.infolist()
        texts = [member for member in members if member.filename.lower().endswith(".xml")]
        for member in texts:
            if member.file_size > LONGEST_TEXT:
                name = printable(member.filename)
                raise InputError(
                    f"{path}: its text {name} has {format_bytes(member.file_size)}; at most"
                    f" {format_bytes(LONGEST_TEXT)} are read"
                )
        _check_size(path, sum(member.file_size for member in members))


def _check_size(path: Path, unpacked: int) -> None:
    """Refuse a file that holds too many bytes for its own size."""
    most = max(LARGEST, PACKED * path.stat().st_size)
    if unpacked > most:
        raise InputError(
            f"{path}: holds {format_bytes(unpacked)} in a file of"
            f" {format_bytes(path.stat().st_size)}; at most {format_bytes(most)} are read of it"
        )


def _opened(path: Path, reason: str) -> tuple[Any, str]:
    """Return the first reader that finds a map in a file, and what was mended in it, in words."""
    from SurfaceTopography.IO import MagicMatch, open_topography, readers

    suffix = path.suffix.lower().removeprefix(".")
    with path.open("rb") as file:
        start = file.read(512)
    named = [
        each for each in readers if suffix in {each.format(), *each.file_extensions()}
    ]
    others = [each for each in readers if each.can_read(start) != MagicMatch.NO]
    tried = [*named, *(each for each in others if each.format() not in GUESSING)]
    reasons, scans = [], False
    for kind in dict.fromkeys(each for each in tried if each.format() not in TABLES):
        fault = "it holds no map"
        for content, remark in _contents(path, kind.format()):
            try:
                reader = open_topography(content, format=kind.format())
                dimensions = {channel.dim for channel in reader.channels}
            except (
                Exception
            ) as error:  # a foreign file makes readers raise nearly anything
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
        main = min(
            (each for each in names if Path(each).name == "main.xml"), key=len, default=""
        )
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
    _check_size(path, np.dtype(np.float64).itemsize * nx * ny)
    given = (
        {}
        if channel.physical_sizes is not None
        else {"physical_sizes": channel.nb_grid_pts}
    )
    topography = reader.topography(channel_index=taken, **given)
    heights = np.ma.filled(np.ma.asarray(topography.heights(), dtype=np.float64), np.nan)
    origin, widths = words + remark, None
    if channel.physical_sizes is not None:
        width, length = (float(size) for size in topography.physical_sizes)
        widths = width, length
        if reader.format() == "nms" and width / channel.nb_grid_pts[0] > WIDEST_NMS:
            widths = 1e-6 * width, 1e-6 * length
            origin += " with the spacing in its header in nm (SurfaceTopography takes it for mm)"
    repeats = bool(topography.is_periodic)
    return Scan(heights, widths, topography.unit, origin=origin, repeats=repeats)
