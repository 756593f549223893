"""Channels of a file that holds several maps: which one is read, and how that is said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gen.runtime.errors import InputError


@dataclass(frozen=True)
class Channel:
    """One map of a file, with its index there and the unit of its values ("" if unknown)."""

    index: int
    name: str
    heights: bool
    unit: str

    @property
    def listed(self) -> str:
        """Index and name, and why it has no heights where it has none."""
        values = "" if self.heights else f" (in {self.unit or 'no length'}, no heights)"
        return f"{self.index} {self.name!r}{values}"


def chosen(path: Path, channels: Sequence[Channel], wanted: str) -> Channel:
    """The channel of a name or index, or the first one with heights."""
    listed = ", ".join(channel.listed for channel in channels)
    if not wanted:
        first = next((channel for channel in channels if channel.heights), None)
        if first is None:
            raise InputError(f"{path}: holds no heights; its channels are {listed}")
        return first
    found = [channel for channel in channels if channel.name == wanted]
    found = found or [channel for channel in channels if str(channel.index) == wanted]
    if len(found) != 1:
        why = "several channels have this name; give an index" if found else "no such channel"
        raise InputError(f"--channel {wanted!r}: {why}; {path} holds {listed}")
    if not found[0].heights:
        raise InputError(f"--channel {wanted!r}: holds no heights; {path} holds {listed}")
    return found[0]


def named(channels: Sequence[Channel], taken: int) -> str:
    """Which channel was taken, for files that hold several."""
    if len(channels) == 1:
        return ""
    name = next(channel.name for channel in channels if channel.index == taken)
    others = ", ".join(channel.listed for channel in channels if channel.index != taken)
    return f" of channel {taken} {name!r} (not {others})"
