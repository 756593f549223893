"""The numbers of a file as a map: its channels, and whether the numbers are heights or points.

`arrange` turns heights, heights between coordinates, and lists of points into a map, whatever file
they come from. Lists of points on a grid become a map with holes at the nodes that no point lies
on. All other lists are refused. Units of length are defined here too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.settings import Reading
from gen.runtime.errors import InputError

METRIC = {
    "m": 1e6,
    "cm": 1e4,
    "mm": 1e3,
    "um": 1.0,
    "µm": 1.0,
    "μm": 1.0,
    "nm": 1e-3,
    "pm": 1e-6,
}
# length of each unit [um]
UNITS = METRIC | {"A": 1e-4, "Å": 1e-4, "inch": 25.4e3}
NAMED_UNITS = ", ".join(unit for unit in UNITS if unit.isascii())
# units by other names in the singular; those in metres are read by their prefix
WORDS = {"micron": "um", "angstrom": "A", "ångström": "A", "in": "inch", '"': "inch"}
# name of a unit in metres, in lower case and without "e" and "s" at its end; the first group is its
# prefix, the second stands for the prefix u
METRES = re.compile("(p|n|m|c|)(?:ico|ano|illi|enti|)(micro|)met(?:er|r)")


def factor_of(unit: str, name: str, advice: str = "give") -> float:
    """Return the length of a unit.

    Parameters
    ----------
    unit : str
        The unit by any of its names.
    name : str
        What the unit belongs to, as "--unit"; the message of an error begins with it.
    advice : str
        The beginning of the advice in the message, before the units that are known.

    Returns
    -------
    float
        The length of the unit [um].

    Raises
    ------
    InputError
        If the unit is unknown.
    """
    key = unit_of(unit)
    if key not in UNITS:
        raise InputError(f"{name} {unit!r}: {advice} one of {NAMED_UNITS}")
    return UNITS[key]


def unit_of(name: str) -> str:
    """Return the key of `UNITS` for a unit by any of its names.

    Parameters
    ----------
    name : str
        A name, as "um", "Micrometers" or "microns".

    Returns
    -------
    str
        The key of `UNITS`, or the name itself if it is no known unit of length.
    """
    word = name.lower().removesuffix("s").removesuffix("e")
    metres = METRES.fullmatch(word)
    if metres:
        if metres[2]:
            return "um"
        return f"{metres[1]}m"
    if name in UNITS:
        return name
    if word in WORDS:
        return WORDS[word]
    # M and a are no units of length.
    if word in UNITS and len(word) > 1:
        return word
    return name


@dataclass(frozen=True, eq=False)
class Scan:
    """The map of a channel, or the table of numbers that holds it, in the file's own units."""

    # numbers of shape (nx, ny), or (lines, columns) before `arrange` and in a text; NaN at holes
    # [factor unit]
    heights: Heights
    # lengths along x and y, which count whole pixels [length_unit]; None if the file has none
    widths: tuple[float, float] | None = None
    # unit of the heights; if the file names none, "" for one in um by default, else None
    unit: str | None = None
    length_unit: str | None = None  # unit of the lengths, None for that of the heights
    origin: str = ""  # what was read, in words
    # comments of the file that are not understood and that name a unit of length
    remarks: tuple[str, ...] = ()
    # whether the file calls the map one period of a periodic surface
    repeats: bool = False
    channel: str = ""  # name of the channel in a text
    factor: float = 1.0  # factor from the numbers to heights in `unit`
    # coordinate in each column, "" for another quantity; () if the columns have no names
    names: tuple[str, ...] = ()
    y_unit: str = ""  # unit of the length along y, or across the lines of a text


@dataclass(frozen=True)
class Channel:
    """One map of a file."""

    index: int  # index of the map in the file
    name: str  # name of the map
    heights: bool  # whether the map holds heights
    unit: str  # unit of its values, "" if unknown

    @property
    def label(self) -> str:
        """Index and name, followed by the unit if the map holds no heights."""
        name = f"{self.index} {self.name!r}"
        if self.heights:
            return name
        return f"{name} (in {self.unit or 'no length'}, no heights)"


@dataclass(frozen=True)
class ChosenChannel:
    """The map of a file that is read."""

    index: int  # index of the map in the file
    # " of channel 1 'Topo' (not 0 'Phase')"; "" if the file has no second map
    origin: str


def choose_channel(
    path: Path, channels: Sequence[Channel], reading: Reading
) -> ChosenChannel:
    """Choose the channel that the reading names, or else the first one with heights.

    Parameters
    ----------
    path : Path
        The file, for messages.
    channels : sequence of Channel
        The maps of the file.
    reading : Reading
        The settings, of which `channel` is the name or index of a map, or "".

    Returns
    -------
    ChosenChannel
        The map with heights to read.

    Raises
    ------
    InputError
        If no map or several maps match, or the map holds no heights.
    """
    if reading.channel:
        chosen = _named_channel(path, channels, reading.channel)
    else:
        with_heights = [channel for channel in channels if channel.heights]
        if not with_heights:
            labels = _labels(channels)
            raise InputError(f"{path}: holds no heights; its channels are {labels}")
        chosen = with_heights[0]
    left_out = [channel for channel in channels if channel is not chosen]
    origin = ""
    if left_out:
        origin = f" of channel {chosen.index} {chosen.name!r} (not {_labels(left_out)})"
    return ChosenChannel(chosen.index, origin)


def _named_channel(path: Path, channels: Sequence[Channel], name: str) -> Channel:
    """Return the only channel of a name or else of an index; refuse one without heights."""
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
    if not matches[0].heights:
        raise InputError(f"{option}: holds no heights; {holds}")
    return matches[0]


def _labels(channels: Sequence[Channel]) -> str:
    """List channels by index and name."""
    return ", ".join(channel.label for channel in channels)


# columns of a list of points, at most: the three coordinates with three more numbers
MOST_COLUMNS = 6
# rows, and rows for each column, from which a table of up to four columns is a list of points
STRIP = 50
SLENDER = 12
# ratio of the scatter of two columns from which a table of five or six holds not only heights
UNLIKE = 8
# numbers that hardly ever rise, fall or lie on a grid throughout, unless they are coordinates
CHANCE = 8
EVEN = 0.02  # largest distance of points or coordinates from an even grid [spacing]
# largest difference between the steps in a row of heights and those in the next rows [1]
ALIKE = 0.25
COVERED = 0.5  # smallest share of the nodes of a grid that points of a map lie on
ADVICE = "give the heights as a grid, one row of them a line, or x, y and z of points on a grid"


def arrange(path: Path, scan: Scan) -> Scan:
    """Turn a table of numbers into a map of heights, without coordinates in its border.

    Parameters
    ----------
    path : Path
        The file of the table, for messages.
    scan : Scan
        The table, with at least 2 x 2 numbers: heights, heights below a row and beside a column of
        coordinates, or points in rows or columns.

    Returns
    -------
    Scan
        The map. Heights without coordinates are returned as they are.

    Raises
    ------
    InputError
        If the table holds a profile, points on no grid, or coordinates along one axis only.
    """
    numbers = scan.heights
    if len(scan.names) == numbers.shape[1]:
        places = [scan.names.index(axis) for axis in "xyz"]
        return _map_of_points(path, scan, numbers[:, places], "columns")
    if _is_list(numbers):
        return _map_of_points(path, scan, numbers, "columns")
    if _is_list(numbers.T):
        return _map_of_points(path, scan, numbers.T, "rows")
    if min(numbers.shape) < 4:
        return scan
    first_row = _border(numbers)
    first_column = _border(numbers.T)
    large = min(numbers.shape) > CHANCE / 2
    if large and first_row.kind == first_column.kind == "even":
        return _between_coordinates(scan, first_row.numbers, first_column.numbers)
    _refuse_coordinates(path, first_row, first_column, numbers[0, 0])
    return scan


@dataclass(frozen=True, eq=False)
class _Border:
    """The first row or column of a table, without the corner."""

    numbers: Values
    kind: str  # spacing of the coordinates, "even" or "uneven"; "" if they are heights

    @property
    def coordinates(self) -> str:
        """The kind of the coordinates in words."""
        return f"{self.kind}ly spaced" if self.kind else "no"


def _border(numbers: Values) -> _Border:
    """Tell whether the first row of a table of 3 rows or more holds coordinates."""
    first, second, third = numbers[:3, 1:]
    if _is_axis(first, evenly=True):
        # Rows of tilted maps are even, too, but continue the rows below them.
        steps = np.diff(first)
        continued = np.diff(2 * second - third)
        alike = np.abs(steps - continued) / np.abs(steps) <= ALIKE
        if np.count_nonzero(alike) > first.size / 2:
            return _Border(first, "")
        return _Border(first, "even")
    rising = first.size >= 2 * CHANCE and _is_axis(first, evenly=False)
    if rising and not _is_axis(second, evenly=False):
        return _Border(first, "uneven")
    return _Border(first, "")


def _between_coordinates(scan: Scan, x: Values, y: Values) -> Scan:
    """Return the heights inside a border of even coordinates, with lengths unless they count."""
    dx = float(np.diff(x).mean())
    dy = float(np.diff(y).mean())
    heights = scan.heights[1:, 1:].T
    if dx < 0:
        heights = heights[::-1]
    if dy < 0:
        heights = heights[:, ::-1]
    heights = np.ascontiguousarray(heights)
    border = "in its first row and column, x along its lines"
    counted = np.allclose((dx, dy), 1, rtol=1e-9) and {x[0], y[0]} <= {0, 1}
    if counted:
        origin = f"{scan.origin} without the row and column numbers {border}"
        return replace(scan, heights=heights, origin=origin)
    nx, ny = heights.shape
    widths = (abs(dx) * nx, abs(dy) * ny)
    origin = f"{scan.origin} between coordinates {border}"
    return replace(scan, heights=heights, widths=widths, origin=origin)


def _refuse_coordinates(
    path: Path, first_row: _Border, first_column: _Border, corner: float
) -> None:
    """Refuse a first row and column with coordinates, unless both have even steps.

    A row or column of uneven steps alone counts as heights. Few numbers can rise by chance, and
    count as coordinates only beside a corner without a number.
    """
    borders = (first_row, first_column)
    certain = any(
        border.kind and (border.numbers.size >= CHANCE or np.isnan(corner))
        for border in borders
    )
    all_are_coordinates = all(border.kind for border in borders)
    any_is_even = any(border.kind == "even" for border in borders)
    if certain and (all_are_coordinates or any_is_even):
        raise InputError(
            f"{path}: its first row holds {first_row.coordinates} coordinates, its first"
            f" column {first_column.coordinates} coordinates; leave both out, or give"
            " both in even steps"
        )


def _is_list(columns: Values) -> bool:
    """Tell whether rows of two to six numbers are points rather than a narrow map of heights."""
    points, width = columns.shape
    if not 2 <= width <= MOST_COLUMNS or points < 3:
        return False
    if points >= max(STRIP, SLENDER * width):
        return width <= 4 or _are_unlike(columns)
    if points <= width:
        return False
    if width <= 3 and _is_axis(columns[:, 0], evenly=points < CHANCE):
        return True
    return _lies_on_grid(columns)


def _are_unlike(columns: Values) -> bool:
    """Tell whether one column scatters so much more than another that not all hold heights."""
    with np.errstate(over="ignore", invalid="ignore"):
        scatter = np.ma.masked_invalid(columns).std(axis=0).compressed()
    return bool((scatter > UNLIKE * scatter[:, None]).any())


def _lies_on_grid(columns: Values) -> bool:
    """Tell whether the first two columns, or the next two of four and more, are places on a grid.

    Few points can lie on one by chance: up to `CHANCE` points have to cover all of its nodes, and
    have no number beside x, y and z.
    """
    points, width = columns.shape
    if points > CHANCE:
        share = COVERED
    elif width == 3:
        share = 1.0
    else:
        return False
    for first in range(min(width - 2, 2)):
        grid = _grid(columns[:, first], columns[:, first + 1])
        if grid and grid.covered >= share and 10 * grid.repeated <= points:
            return True
    return False


def _map_of_points(path: Path, scan: Scan, columns: Values, direction: str) -> Scan:
    """Lay points on their grid; refuse points on no grid, and columns without clear names.

    `direction` tells whether the coordinates are the "columns" or the "rows" of the file.
    """
    points, width = columns.shape
    if width == 4 and (columns[:, 0] == columns[0, 0] + np.arange(points)).all():
        columns = columns[:, 1:]  # without the numbers of the points
    grid = None
    fault = ""
    if columns.shape[1] == 3:
        grid = _grid(columns[:, 0], columns[:, 1])
        fault = _fault_of_grid(grid)
    if grid is None or fault:
        looks = _words_for_columns(columns.shape[1])
        raise InputError(
            f"{path}: holds {points} x {width} numbers in {direction}: looks like"
            f" {looks}{fault}, not a map of heights; {ADVICE}"
        )
    heights = np.full(grid.shape, np.nan)
    heights[grid.x.nodes, grid.y.nodes] = columns[:, 2]
    widths = (grid.x.spacing * grid.x.count, grid.y.spacing * grid.y.count)
    origin = f"{scan.origin} of {points} points on a grid"
    return replace(scan, heights=heights, widths=widths, origin=origin)


def _words_for_columns(width: int) -> str:
    """Tell what a list with some number of columns looks like."""
    if width == 2:
        return "a profile, x and z"
    if width == 3:
        return "a list of points, x, y and z, "
    return (
        f"a list of points with {width} numbers each (leave all but x, y and z out, or"
        " name the columns in a first line, as x,y,z,quality)"
    )


def _fault_of_grid(grid: _Grid | None) -> str:
    """Return why points on a grid, or on none, make no map; "" if they make one."""
    if grid is None:
        return f"on no regular grid within {100 * EVEN:g} % of its spacing"
    if grid.repeated:
        return f"{grid.repeated} of which lie where others do"
    if grid.covered < COVERED:
        nodes = " x ".join(map(str, grid.shape))
        return f"on {100 * grid.covered:.3g} % of the nodes of a grid of {nodes}"
    return ""


def _is_axis(values: Values, *, evenly: bool) -> bool:
    """Tell whether numbers rise or fall throughout, and with `evenly` also in even steps."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(values)
        if not ((steps > 0).all() or (steps < 0).all()):
            return False
        deviations = np.abs(steps - steps.mean())
        uneven = bool((deviations > EVEN * abs(steps.mean())).any())
    return not (evenly and uneven)


@dataclass(frozen=True, eq=False)
class _Places:
    """The places of points along one axis of a grid."""

    nodes: NDArray[np.intp]  # number of each point's node, from 0 on
    count: int  # number of nodes along the axis
    spacing: float  # distance of the nodes, in the unit of the coordinates


@dataclass(frozen=True, eq=False)
class _Grid:
    """A grid that points lie on, and how they cover it."""

    x: _Places
    y: _Places
    repeated: int  # number of points on a node that an earlier point lies on
    covered: float  # share of the nodes that a point lies on

    @property
    def shape(self) -> tuple[int, int]:
        """Number of nodes along x and y."""
        return self.x.count, self.y.count


def _grid(x: Values, y: Values) -> _Grid | None:
    """Return the grid that points lie on; None if they lie on none."""
    along_x = _places(x)
    along_y = _places(y)
    if along_x is None or along_y is None:
        return None
    covered = int(np.unique(along_x.nodes * along_y.count + along_y.nodes).size)
    share = covered / (along_x.count * along_y.count)
    return _Grid(along_x, along_y, along_x.nodes.size - covered, share)


def _places(coordinates: Values) -> _Places | None:
    """Return the places of points along an axis; None if the coordinates are not even.

    Steps over missing places are whole multiples of the spacing, which is the median step.
    """
    steady = np.unique(coordinates)
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(steady)
        if not steps.size or not np.isfinite(steps).all():
            return None
        # Coordinates of one place differ by rounding, much less than by the step at missing places.
        steady = steady[np.append(True, steps > EVEN / 10 * steps.max())]
        steps = np.diff(steady)
        numbers = np.append(0, np.cumsum(np.rint(steps / np.median(steps))))
        if not 1 <= numbers[-1] < coordinates.size:
            return None
        spacing = float((steady[-1] - steady[0]) / numbers[-1])
        nearest = np.searchsorted(steady, coordinates, side="right") - 1
        nodes = numbers[nearest].astype(np.intp)
        off = np.abs((coordinates - steady[0]) / spacing - nodes)
        if not (off <= EVEN).all():
            return None
    return _Places(nodes, int(nodes.max()) + 1, spacing)
