"""The numbers of a file as a map: its channels, and whether the numbers are heights or points.

`arranged` turns heights, heights between coordinates, and lists of points into a map, whatever file
they come from. Lists of points on a grid become a map with holes at the nodes that no point lies
on; other lists are refused. Units of length have their home here too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

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
UNITS = METRIC | {"A": 1e-4, "Å": 1e-4, "inch": 25.4e3}  # length of each unit [um]
NAMED_UNITS = ", ".join(filter(str.isascii, UNITS))
# units by other names in the singular; those in metres are read by their prefix
WORDS = {"micron": "um", "angstrom": "A", "ångström": "A", "in": "inch", '"': "inch"}


def factor_of(unit: str, name: str, advice: str = "give") -> float:
    """Return the length of a unit [um]; with an unknown unit, give this advice."""
    if unit_of(unit) not in UNITS:
        raise InputError(f"{name} {unit!r}: {advice} one of {NAMED_UNITS}")
    return UNITS[unit_of(unit)]


def unit_of(name: str) -> str:
    """Return the key of `UNITS` for a unit by one of its names; other names as they are."""
    word = name.lower().removesuffix("s").removesuffix("e")
    metres = re.fullmatch("(p|n|m|c|)(?:ico|ano|illi|enti|)(micro|)met(?:er|r)", word)
    if metres:
        return ("u" if metres[2] else metres[1]) + "m"
    known = word in UNITS and len(word) > 1  # M and a are no units of length
    return name if name in UNITS else WORDS.get(word, word if known else name)


@dataclass(frozen=True, eq=False)
class Scan:
    """The map of a channel, or the table of numbers that holds it, in the file's own units."""

    heights: (
        Heights  # NaN at holes [factor unit], shape (nx, ny); of text (lines, columns)
    )
    # lengths along x and y, which count whole pixels [length_unit]; None if the file has none
    widths: tuple[float, float] | None = None
    # unit of the heights; if the file names none, "" for one in um by default, else None
    unit: str | None = None
    length_unit: str | None = None  # unit of the lengths, None for that of the heights
    origin: str = ""  # what was read, in words
    # comments of the file that we do not understand and that name a unit of length
    remarks: tuple[str, ...] = ()
    repeats: bool = (
        False  # whether the file calls the map one period of a periodic surface
    )
    channel: str = ""  # name of the channel in a text
    factor: float = 1.0  # of the numbers
    names: tuple[str, ...] = ()  # coordinate in each column, "" for another quantity
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
        values = "" if self.heights else f" (in {self.unit or 'no length'}, no heights)"
        return f"{self.index} {self.name!r}{values}"


def choose_channel(
    path: Path, channels: Sequence[Channel], reading: Reading
) -> tuple[int, str]:
    """Return the index of the channel asked for, or the first with heights, and words on it."""
    wanted = reading.channel
    named = f"--channel {wanted!r}"
    labels = ", ".join(channel.label for channel in channels)
    if wanted:
        matches = [channel for channel in channels if channel.name == wanted]
        matches = matches or [
            channel for channel in channels if str(channel.index) == wanted
        ]
        if len(matches) != 1:
            why = (
                "several channels have this name; give an index"
                if matches
                else "no such channel"
            )
            raise InputError(f"{named}: {why}; {path} holds {labels}")
        if not matches[0].heights:
            raise InputError(f"{named}: holds no heights; {path} holds {labels}")
    else:
        matches = [channel for channel in channels if channel.heights]
        if not matches:
            raise InputError(f"{path}: holds no heights; its channels are {labels}")
    taken = matches[0]
    rest = ", ".join(channel.label for channel in channels if channel is not taken)
    return (
        taken.index,
        f" of channel {taken.index} {taken.name!r} (not {rest})" if rest else "",
    )


# columns of a list of points, at most: the three coordinates with three more numbers
MOST_COLUMNS = 6
# rows, and rows for each column, from which a table of up to four columns is a list of points
STRIP, SLENDER = 50, 12
# ratio of the scatter of two columns from which a table of five or six holds not only heights
UNLIKE = 8
# numbers that hardly ever rise, fall or lie on a grid throughout, unless they are coordinates
CHANCE = 8
EVEN = 0.02  # largest distance of points or coordinates from an even grid [spacing]
# largest difference between the steps in a row of heights and those in the next rows [1]
ALIKE = 0.25
COVERED = 0.5  # smallest share of the nodes of a grid that points of a map lie on
ADVICE = "give the heights as a grid, one row of them a line, or x, y and z of points on a grid"


def arranged(path: Path, scan: Scan) -> Scan:
    """Turn a table of numbers into a map of heights, without coordinates in its border.

    A profile, points on no grid, and coordinates along one axis only are refused.
    """
    numbers = scan.heights
    if len(scan.names) == numbers.shape[1]:
        columns = numbers[:, [scan.names.index(axis) for axis in "xyz"]]
        return _from_points(path, scan, columns, "columns")
    for columns, direction in ((numbers, "columns"), (numbers.T, "rows")):
        if _is_list(columns):
            return _from_points(path, scan, columns, direction)
    kinds = "", ""  # of the coordinates in the first row, x, and in the first column, y
    if min(numbers.shape) >= 4:
        kinds = _first_row(numbers), _first_row(numbers.T)
    x, y = numbers[0, 1:], numbers[1:, 0]
    if kinds == ("even", "even") and min(numbers.shape) > CHANCE / 2:
        (dx, dy), heights = (
            (float(np.diff(axis).mean()) for axis in (x, y)),
            numbers[1:, 1:].T,
        )
        heights = np.ascontiguousarray(
            heights[:: 1 if dx > 0 else -1, :: 1 if dy > 0 else -1]
        )
        inside = "in its first row and column, x along its lines"
        if np.allclose((dx, dy), 1, rtol=1e-9) and {x[0], y[0]} <= {0, 1}:
            said = f"{scan.origin} without the row and column numbers {inside}"
            return replace(scan, heights=heights, origin=said)
        widths = abs(dx) * heights.shape[0], abs(dy) * heights.shape[1]
        said = f"{scan.origin} between coordinates {inside}"
        return replace(scan, heights=heights, widths=widths, origin=said)
    pairs = zip(kinds, (x, y), strict=True)
    alone = any(
        kind and (axis.size >= CHANCE or np.isnan(numbers[0, 0])) for kind, axis in pairs
    )
    if alone and (all(kinds) or "even" in kinds):
        row, column = (f"{kind}ly spaced" if kind else "no" for kind in kinds)
        raise InputError(
            f"{path}: its first row holds {row} coordinates, its first column {column} coordinates;"
            " leave both out, or give both in even steps"
        )
    return scan


def _is_list(columns: Values) -> bool:
    """Tell whether rows of two to six numbers are points rather than a narrow map of heights."""
    points, width = columns.shape
    if not 2 <= width <= MOST_COLUMNS or points < 3:
        return False
    if points >= max(STRIP, SLENDER * width):
        with np.errstate(over="ignore", invalid="ignore"):
            scatter = np.ma.masked_invalid(columns).std(axis=0).compressed()
        return width <= 4 or bool((scatter > UNLIKE * scatter[:, None]).any())
    if points <= width:
        return False
    if width <= 3 and _is_axis(columns[:, 0], even=points < CHANCE):
        return True
    grids = [
        _grid(*columns[:, first : first + 2].T) for first in range(min(width - 2, 2))
    ]
    least = COVERED if points > CHANCE else 1.0 if width == 3 else np.inf
    return any(
        each.covered >= least and 10 * each.repeated <= points for each in grids if each
    )


def _from_points(path: Path, scan: Scan, columns: Values, direction: str) -> Scan:
    """Lay points on their grid; refuse points on no grid, and columns that are not told."""
    points, width = columns.shape
    if width == 4 and (columns[:, 0] == columns[0, 0] + np.arange(points)).all():
        columns = columns[:, 1:]  # the numbers of the points
    looks = {2: "a profile, x and z", 3: "a list of points, x, y and z, "}.get(
        columns.shape[1],
        f"a list of points with {width} numbers each (leave all but x, y and z out, or name the"
        " columns in a first line, as x,y,z,quality)",
    )
    if columns.shape[1] == 3:
        grid = _grid(columns[:, 0], columns[:, 1])
        if grid is None:
            looks += f"on no regular grid within {100 * EVEN:g} % of its spacing"
        elif grid.repeated:
            looks += f"{grid.repeated} of which lie where others do"
        elif grid.covered < COVERED:
            nodes = " x ".join(map(str, grid.shape))
            looks += f"on {100 * grid.covered:.3g} % of the nodes of a grid of {nodes}"
        else:
            heights = np.full(grid.shape, np.nan)
            heights[grid.nodes] = columns[:, 2]
            widths = grid.spacing[0] * grid.shape[0], grid.spacing[1] * grid.shape[1]
            origin = f"{scan.origin} of {points} points on a grid"
            return replace(scan, heights=heights, widths=widths, origin=origin)
    raise InputError(
        f"{path}: holds {points} x {width} numbers in {direction}: looks like {looks}, not a map of"
        f" heights; {ADVICE}"
    )


def _first_row(numbers: Values) -> str:
    """Tell whether the first row, unlike the second, holds coordinates: "even", "uneven" or ""."""
    first, second, third = numbers[:3, 1:]
    if _is_axis(first, even=True):
        # Rows of tilted maps are even, too, but continue those below them.
        steps = np.diff(first)
        off = np.abs(steps - np.diff(2 * second - third)) / np.abs(steps)
        return "" if np.count_nonzero(off <= ALIKE) > first.size / 2 else "even"
    rising = first.size >= 2 * CHANCE and _is_axis(first, even=False)
    return "uneven" if rising and not _is_axis(second, even=False) else ""


def _is_axis(values: Values, *, even: bool) -> bool:
    """Tell whether numbers rise or fall throughout, in even steps if `even`."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(values)
        off = np.abs(steps - steps.mean()) > EVEN * abs(steps.mean())
    return bool((steps > 0).all() or (steps < 0).all()) and not (even and off.any())


class _Grid(NamedTuple):
    """A grid with the node of each point on it, its numbers of nodes, and how points cover them."""

    nodes: tuple[NDArray[np.intp], NDArray[np.intp]]
    shape: tuple[int, int]
    spacing: tuple[float, float]
    repeated: int
    covered: float  # share of the nodes


def _grid(x: Values, y: Values) -> _Grid | None:
    """Return the grid that points lie on with the share of nodes covered; None if there is none."""
    along_x, along_y = _nodes(x), _nodes(y)
    if along_x is None or along_y is None:
        return None
    (i, dx), (j, dy) = along_x, along_y
    nx, ny = int(i.max()) + 1, int(j.max()) + 1
    covered = int(np.unique(i * ny + j).size)
    return _Grid((i, j), (nx, ny), (dx, dy), i.size - covered, covered / (nx * ny))


def _nodes(values: Values) -> tuple[NDArray[np.intp], float] | None:
    """Return the even places of coordinates and their spacing; None if they are uneven."""
    places = np.unique(values)
    with np.errstate(over="ignore", invalid="ignore"):
        gaps = np.diff(places)
        if not gaps.size or not np.isfinite(gaps).all():
            return None
        # Coordinates of one place differ by rounding, much less than by the gap at missing places.
        places = places[np.append(True, gaps > EVEN / 10 * gaps.max())]
        gaps = np.diff(places)
        numbers = np.append(0, np.cumsum(np.rint(gaps / np.median(gaps))))
        if not 1 <= numbers[-1] < values.size:
            return None
        spacing = float((places[-1] - places[0]) / numbers[-1])
        node = numbers[np.searchsorted(places, values, side="right") - 1].astype(np.intp)
        even = bool((np.abs((values - places[0]) / spacing - node) <= EVEN).all())
    return (node, spacing) if even else None
