"""Channels of a file that holds several maps: choosing one, telling the user which, and its map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gen.arrays import Heights
from gen.runtime.errors import InputError


@dataclass(frozen=True, eq=False)
class Scan:
    """The map of a channel in the file's own units.

    Attributes
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [unit].
    widths : tuple of float, optional
        Lengths along x and y, which count whole pixels [length_unit]; None if the file has none.
    unit : str, optional
        Unit of the heights; if the file names none, "" for one in um by default, else None.
    length_unit : str, optional
        Unit of the lengths, None for that of the heights.
    origin : str
        What was read, in words.
    remarks : tuple of str
        Comments of the file that we do not understand and that name a unit of length.
    repeats : bool
        Whether the file calls the map one period of a periodic surface.
    """

    heights: Heights
    widths: tuple[float, float] | None = None
    unit: str | None = None
    length_unit: str | None = None
    origin: str = ""
    remarks: tuple[str, ...] = ()
    repeats: bool = False


@dataclass(frozen=True)
class Channel:
    """One map of a file.

    Attributes
    ----------
    index : int
        Index of the map in the file.
    name : str
        Name of the map.
    heights : bool
        Whether the map holds heights.
    unit : str
        Unit of its values, "" if unknown.
    """

    index: int
    name: str
    heights: bool
    unit: str

    @property
    def label(self) -> str:
        """Index and name, followed by the unit if the map holds no heights."""
        values = "" if self.heights else f" (in {self.unit or 'no length'}, no heights)"
        return f"{self.index} {self.name!r}{values}"


def choose_channel(path: Path, channels: Sequence[Channel], wanted: str) -> Channel:
    """Return the channel with a name or index; by default the first one with heights.

    Parameters
    ----------
    path : Path
        File, for messages.
    channels : sequence of Channel
        All channels of the file.
    wanted : str
        Name or index of a channel, "" for the default.

    Raises
    ------
    InputError
        If there is no such channel, it holds no heights, or several have the name.
    """
    labels = ", ".join(channel.label for channel in channels)
    if not wanted:
        first = next((channel for channel in channels if channel.heights), None)
        if first is None:
            raise InputError(f"{path}: holds no heights; its channels are {labels}")
        return first
    matches = [channel for channel in channels if channel.name == wanted]
    matches = matches or [channel for channel in channels if str(channel.index) == wanted]
    if len(matches) != 1:
        why = "several channels have this name; give an index" if matches else "no such channel"
        raise InputError(f"--channel {wanted!r}: {why}; {path} holds {labels}")
    if not matches[0].heights:
        raise InputError(f"--channel {wanted!r}: holds no heights; {path} holds {labels}")
    return matches[0]


def choice_in_words(channels: Sequence[Channel], index: int) -> str:
    """Say which channel was read and which were not; "" for a file with only one.

    Parameters
    ----------
    channels : sequence of Channel
        All channels of the file.
    index : int
        Index of the channel that was read.
    """
    if len(channels) == 1:
        return ""
    name = next(channel.name for channel in channels if channel.index == index)
    rest = ", ".join(channel.label for channel in channels if channel.index != index)
    return f" of channel {index} {name!r} (not {rest})"
