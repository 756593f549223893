"""Choose the channel of a file that holds several maps, such as heights and phases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gen.maps.scan import UNITS, Scan, factor_of, unit_of
from gen.maps.settings import Reading
from gen.runtime.errors import InputError


@dataclass(frozen=True)
class Channel:
    """One map of a file."""

    index: int  # index of the map in the file
    name: str  # name of the map
    holds_heights: bool
    unit: str  # unit of its values, "" if unknown

    @property
    def label(self) -> str:
        """Index and name of the map; without heights also its unit, in brackets."""
        name = f"{self.index} {self.name!r}"
        if self.holds_heights:
            return name
        unit = f"in {self.unit}" if self.unit else "unit unknown"
        return f"{name} ({unit}, no heights)"


@dataclass(frozen=True)
class ChosenChannel:
    """The map that is to be read from a file."""

    index: int  # index of the map in the file
    # the choice in words, as " of channel 1 'Topo' (not 0 'Phase')"; "" if the file has one map
    origin: str


def choose_channel(
    path: Path, channels: Sequence[Channel], reading: Reading
) -> ChosenChannel:
    """Choose the channel that the reading names; if it names none, the first one with heights.

    Parameters
    ----------
    path : Path
        The file, for messages.
    channels : sequence of Channel
        The maps of the file.
    reading : Reading
        The settings. Only `channel` is used: the name or index of a map, or "".

    Returns
    -------
    ChosenChannel
        The map to read, which holds heights.

    Raises
    ------
    InputError
        If no map or several maps have this name, or the map holds no heights. Without a name, if no
        map holds heights.
    """
    if reading.channel:
        chosen = _named_channel(path, channels, reading.channel)
    else:
        with_heights = [channel for channel in channels if channel.holds_heights]
        if not with_heights:
            labels = _labels(channels)
            raise InputError(f"{path}: holds no heights; its channels are {labels}")
        chosen = with_heights[0]
    left_out = [channel for channel in channels if channel is not chosen]
    origin = ""
    if left_out:
        origin = f" of channel {chosen.index} {chosen.name!r} (not {_labels(left_out)})"
    return ChosenChannel(index=chosen.index, origin=origin)


def _named_channel(path: Path, channels: Sequence[Channel], name: str) -> Channel:
    """Return the channel with a name; if no channel has this name, the channel with this index.

    Raises InputError if there is no such channel, if several have the name, or if the channel holds
    no heights.
    """
    matches = [channel for channel in channels if channel.name == name]
    if not matches:
        matches = [channel for channel in channels if str(channel.index) == name]
    option = f"--channel {name!r}"
    holds = f"{path} holds {_labels(channels)}"
    if not matches:
        raise InputError(f"{option}: no such channel; {holds}")
    if len(matches) > 1:
        raise InputError(
            f"{option}: several channels have this name; give an index; {holds}"
        )
    if not matches[0].holds_heights:
        raise InputError(f"{option}: holds no heights; {holds}")
    return matches[0]


def _labels(channels: Sequence[Channel]) -> str:
    """Return the labels of channels as "0 'Topo', 1 'Phase' (in deg, no heights)"."""
    return ", ".join(channel.label for channel in channels)


def choose_matrix(path: Path, matrices: list[Scan], reading: Reading) -> Scan:
    """Choose the matrix of a channel, and transpose it if its header states lengths.

    In texts with such a header, x runs along the lines. In maps, x is axis 0.

    Parameters
    ----------
    path : Path
        The file, for messages.
    matrices : list of Scan
        The matrices of the file, at least one.
    reading : Reading
        The settings. `channel` names the matrix; if it is "", the first one with heights is chosen.
        If `override_scale` and `unit` are set, the matrices hold heights in that unit, whatever
        their own unit is.

    Returns
    -------
    Scan
        The matrix, transposed if it has `widths`: the lengths along x and y that its header states.
        Both are then in the unit of the length along x.

    Raises
    ------
    InputError
        If no matrix has heights. If the channel is unknown, is the name of several matrices, or
        holds no heights. If x and y have different units and the header states no lengths, which
        could be converted, or one of these units is unknown.
    """
    overruled = reading.override_scale and bool(reading.unit)
    channels = [
        _channel_of(index, scan, overruled=overruled)
        for index, scan in enumerate(matrices)
    ]
    # A single matrix of heights need not be chosen.
    chosen = ChosenChannel(index=0, origin="")
    if reading.channel or len(matrices) > 1 or not channels[0].holds_heights:
        chosen = choose_channel(path, channels, reading)
    scan = matrices[chosen.index]
    x_unit = scan.length_unit or ""
    y_unit = scan.y_unit or x_unit
    same_unit = unit_of(y_unit) == unit_of(x_unit)
    if scan.widths is None:
        if not same_unit:
            raise InputError(
                f"{path}: has x in {x_unit} and y in {y_unit}; give both in one unit"
            )
        return replace(scan, origin=chosen.origin)
    width, length = scan.widths
    if not same_unit:
        y_in_um = factor_of(y_unit, f"{path}: unit")
        x_in_um = factor_of(x_unit, f"{path}: unit")
        length *= y_in_um / x_in_um
    return replace(
        scan,
        heights=np.ascontiguousarray(scan.heights.T),
        widths=(width, length),
        origin=f"{chosen.origin} under a header, x along its lines",
    )


def _channel_of(index: int, scan: Scan, *, overruled: bool) -> Channel:
    """Describe a matrix as a channel.

    It holds heights if its unit is one of length, or missing, or `overruled` by the user.
    """
    return Channel(
        index=index,
        name=scan.channel or f"matrix {index}",
        holds_heights=not scan.unit or overruled or unit_of(scan.unit) in UNITS,
        unit=scan.unit or "",
    )
