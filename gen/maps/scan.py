"""Turn the numbers of a file into a map: tell heights from points.

`arrange` takes a table of numbers from any file. The table holds heights, heights with coordinates
in the first row and column, or a list of points. A list of points on a grid becomes a map with
holes at the nodes without a point. All other lists are refused. The units of length are defined
here, too.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.runtime.errors import InputError

# length of each metric unit by its symbol [um]
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
# length of each unit by its name [um]
UNITS = METRIC | {"A": 1e-4, "Å": 1e-4, "inch": 25.4e3}
# units that messages name
NAMED_UNITS = ", ".join(unit for unit in UNITS if unit.isascii())
# further names of units, in lower case and in the singular, and their keys in `UNITS`
WORDS = {"micron": "um", "angstrom": "A", "ångström": "A", "in": "inch", '"': "inch"}
# written-out name of a metric unit, as "nanometer", in lower case and without "e" and "s" at its
# end. The first group is the letter of its prefix; the second is "micro", whose letter is u.
METRES = re.compile("(p|n|m|c|)(?:ico|ano|illi|enti|)(micro|)met(?:er|r)")


def factor_of(unit: str, name: str, advice: str = "give") -> float:
    """Return the length of a unit.

    Parameters
    ----------
    unit : str
        The unit by any of its names.
    name : str
        Name of the option or of the entry in a file that holds the unit, as "--unit". The message
        of the error begins with it.
    advice : str
        Beginning of the advice in the message of the error; the known units follow it.

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
        The key of `UNITS`; the name itself if it names no known unit of length.
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
    # A single letter is not lowered: M and a are no units of length, but m and A are.
    if word in UNITS and len(word) > 1:
        return word
    return name


@dataclass(frozen=True)
class Instrument:
    """The limits of an instrument, as the file of a map states them; None for those it does not."""

    cut_off: float | None = (
        None  # length below which the instrument resolves nothing [um]
    )
    tip_radius: float | None = None  # radius of the tip that traced the surface [um]

    def or_worse(self, other: Instrument) -> Instrument:
        """Return the limits of the sum of two surfaces.

        Parameters
        ----------
        other : Instrument
            Limits of the instrument of the other surface.

        Returns
        -------
        Instrument
            The larger length of each kind.
        """
        return Instrument(
            cut_off=_larger(self.cut_off, other.cut_off),
            tip_radius=_larger(self.tip_radius, other.tip_radius),
        )


UNKNOWN = Instrument()
"""An instrument of which the file says nothing."""


def _larger(first: float | None, second: float | None) -> float | None:
    """Return the larger length of those that are known, None if neither is."""
    return max((length for length in (first, second) if length is not None), default=None)


@dataclass(frozen=True, eq=False)
class Scan:
    """The numbers of a channel, and what the file says of them, in the units of the file."""

    # Numbers; times `factor` they are heights in `unit`. NaN at holes. Axis 0 is x in a map. In a
    # text, and in any table before `arrange`, it counts the lines.
    heights: Heights
    # lengths of the map along x and y, each the number of nodes times their spacing
    # [length_unit]; None if the file states none
    widths: tuple[float, float] | None = None
    # unit of the heights. If the file names none: "" in a .npy file or a text, which may be in um,
    # and None in an instrument's file.
    unit: str | None = None
    # unit of the lengths; None if it is the unit of the heights
    length_unit: str | None = None
    # which part of the file was read, in words, as " of channel 1 'Topo'"
    origin: str = ""
    # comments of the file that name a unit of length, but are not understood
    remarks: tuple[str, ...] = ()
    # whether the file calls the map one period of a periodic surface
    repeats: bool = False
    channel: str = ""  # name of the channel in a text; "" if it has none
    factor: float = 1.0  # factor from the numbers to heights in `unit`
    # meaning of each column of a list of points: "x", "y", "z", or "" for another quantity; () if
    # the file does not name the columns
    names: tuple[str, ...] = ()
    # unit of the length along y, which is across the lines of a text; "" if it is `length_unit`
    y_unit: str = ""
    instrument: Instrument = UNKNOWN  # limits of the instrument


# largest number of columns of a list of points: three coordinates and three further numbers
MOST_COLUMNS = 6
# A table of two to four columns is a list of points if it has at least `STRIP` rows, and at least
# `SLENDER` rows for each column.
STRIP = 50
SLENDER = 12
# A table of five or six columns is such a list only if one of its columns scatters more than this
# many times as much as another one.
UNLIKE = 8
# Heights rise steadily or form a grid by chance only if they are fewer than about this count.
CHANCE = 8
EVEN = 0.02  # largest distance of points or coordinates from an even grid [spacing]
# largest relative difference between the steps along the first row of a map and the steps that the
# next two rows predict for it
ALIKE = 0.25
COVERED = 0.5  # smallest share of the nodes of a grid that the points of a map cover
ADVICE = "give the heights as a grid, one row of them a line, or x, y and z of points on a grid"


def arrange(path: Path, scan: Scan) -> Scan:
    """Turn a table of numbers into a map of heights.

    The lengths of the map follow from the coordinates in the first row and column of the table, or
    from the coordinates of its points.

    Parameters
    ----------
    path : Path
        The file of the table, for messages.
    scan : Scan
        The table, with at least 2 x 2 numbers and no lengths. It holds heights alone, heights with
        coordinates in the first row and column, or points as its rows or as its columns.

    Returns
    -------
    Scan
        The map. A table of heights alone is returned as it is.

    Raises
    ------
    InputError
        If the table holds a profile, points that make no map, coordinates along one axis only, or
        coordinates that are not evenly spaced.
    """
    numbers = scan.heights
    # The header names the columns of a list of points.
    if len(scan.names) == numbers.shape[1]:
        places = [scan.names.index(axis) for axis in "xyz"]
        return _map_of_points(path, scan, numbers[:, places], "columns")
    if _is_list(numbers):
        return _map_of_points(path, scan, numbers, "columns")
    if _is_list(numbers.T):
        return _map_of_points(path, scan, numbers.T, "rows")
    # In a table as small as this, coordinates cannot be told from heights.
    if min(numbers.shape) < 4:
        return scan
    first_row = _border(numbers)
    first_column = _border(numbers.T)
    both_are_even = first_row.kind == "even" and first_column.kind == "even"
    # Both borders of a smaller table may be even by chance.
    if both_are_even and min(numbers.shape) > CHANCE / 2:
        return _between_coordinates(scan, first_row.numbers, first_column.numbers)
    _refuse_coordinates(path, first_row, first_column, numbers[0, 0])
    return scan


@dataclass(frozen=True, eq=False)
class _Border:
    """The first row or column of a table, without the number in the corner."""

    numbers: Values
    # "even" or "uneven" for coordinates, by their spacing; "" for heights
    kind: str

    @property
    def coordinates(self) -> str:
        """The word for a message in front of "coordinates", as "evenly spaced" or "no"."""
        return f"{self.kind}ly spaced" if self.kind else "no"


def _border(numbers: Values) -> _Border:
    """Return the first row of a table without its corner, and whether it holds coordinates.

    The table has at least 3 rows. For the first column, its transpose is given.
    """
    first, second, third = numbers[:3, 1:]
    if _is_axis(first, evenly=True):
        # Rows of a tilted map have even steps, too, but continue the rows below them linearly.
        steps = np.diff(first)
        predicted = np.diff(2 * second - third)
        alike = np.abs(steps - predicted) / np.abs(steps) <= ALIKE
        if np.count_nonzero(alike) > first.size / 2:
            return _Border(numbers=first, kind="")
        return _Border(numbers=first, kind="even")
    # Few heights rise by chance. On a slope, the second row rises as well.
    rising = first.size >= 2 * CHANCE and _is_axis(first, evenly=False)
    if rising and not _is_axis(second, evenly=False):
        return _Border(numbers=first, kind="uneven")
    return _Border(numbers=first, kind="")


def _between_coordinates(scan: Scan, x: Values, y: Values) -> Scan:
    """Return the map inside a first row `x` and a first column `y` of evenly spaced coordinates.

    Axis 0 of the map is x. Axes with falling coordinates are reversed. The map gets its lengths
    from the coordinates, unless they only number the rows and columns from 0 or 1.
    """
    dx = float(np.diff(x).mean())
    dy = float(np.diff(y).mean())
    heights = scan.heights[1:, 1:].T
    if dx < 0:
        heights = heights[::-1]
    if dy < 0:
        heights = heights[:, ::-1]
    heights = np.ascontiguousarray(heights)
    border = "in its first row and column, x along its lines"
    steps_are_one = np.allclose((dx, dy), 1, rtol=1e-9)
    if steps_are_one and {x[0], y[0]} <= {0, 1}:
        origin = f"{scan.origin} without the row and column numbers {border}"
        return replace(scan, heights=heights, origin=origin)
    nx, ny = heights.shape
    widths = (abs(dx) * nx, abs(dy) * ny)
    origin = f"{scan.origin} between coordinates {border}"
    return replace(scan, heights=heights, widths=widths, origin=origin)


def _refuse_coordinates(
    path: Path, first_row: _Border, first_column: _Border, corner: float
) -> None:
    """Raise InputError if the first row or column of a table holds coordinates that cannot be used.

    `arrange` has already used evenly spaced coordinates along both axes. Refused are other
    coordinates along both axes, and evenly spaced ones along a single axis. Unevenly spaced ones
    along a single axis are accepted, as they may be heights. Fewer than `CHANCE` numbers in a row
    may rise by chance: they count as coordinates only if the corner of the table holds no number.
    """
    borders = (first_row, first_column)
    not_by_chance = any(
        border.kind and (border.numbers.size >= CHANCE or np.isnan(corner))
        for border in borders
    )
    all_are_coordinates = all(border.kind for border in borders)
    any_is_even = any(border.kind == "even" for border in borders)
    if not_by_chance and (all_are_coordinates or any_is_even):
        raise InputError(
            f"{path}: its first row holds {first_row.coordinates} coordinates, its first"
            f" column {first_column.coordinates} coordinates; leave both out, or give"
            " both in even steps"
        )


def _is_list(rows: Values) -> bool:
    """Tell whether every row of a table is a point, rather than a line of a narrow map.

    `rows` has the shape (points, numbers of a point).
    """
    points, width = rows.shape
    if not 2 <= width <= MOST_COLUMNS or points < 3:
        return False
    # Long tables are lists, but one of five or six columns may be a strip of a map.
    if points >= max(STRIP, SLENDER * width):
        return width <= 4 or _are_unlike(rows)
    # A table that is not longer than wide is a map.
    if points <= width:
        return False
    # The first column of a profile or of sorted points rises. Fewer than `CHANCE` heights may also
    # rise by chance, but rarely in even steps.
    if width <= 3 and _is_axis(rows[:, 0], evenly=points < CHANCE):
        return True
    # Points in any order are known by their grid.
    return _lies_on_grid(rows)


def _are_unlike(columns: Values) -> bool:
    """Tell whether one column scatters more than `UNLIKE` times as much as another one.

    Columns of heights scatter alike; coordinates and heights do not.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        deviations = np.ma.masked_invalid(columns).std(axis=0)
    scatter = deviations.compressed()  # of the columns that hold a number
    return bool((scatter > UNLIKE * scatter[:, None]).any())


def _lies_on_grid(columns: Values) -> bool:
    """Tell whether two neighbouring columns hold x and y of points on a grid.

    They are the first two columns; of four columns or more, they may also be the second and third.
    Few points form a grid by chance: up to `CHANCE` points have to cover all of its nodes, and to
    have x, y and z alone.
    """
    points, width = columns.shape
    if points > CHANCE:
        smallest_share = COVERED
    elif width == 3:
        smallest_share = 1.0
    else:
        return False
    for first in range(min(width - 2, 2)):
        grid = _grid(columns[:, first], columns[:, first + 1])
        if grid is None or grid.covered < smallest_share:
            continue
        # In a list of points, up to a tenth of the points may repeat a node. Heights that are taken
        # for coordinates repeat more.
        if 10 * grid.repeated <= points:
            return True
    return False


def _map_of_points(path: Path, scan: Scan, columns: Values, direction: str) -> Scan:
    """Turn a list of points into a map, with holes at the nodes without a point.

    `columns` has the shape (points, numbers of a point). `direction` tells in a message whether
    these numbers are the "columns" or the "rows" of the file. A first column of four that numbers
    the points is left out. InputError if the columns are not x, y and z, or the points make no map.
    """
    points, width = columns.shape
    if width == 4 and (columns[:, 0] == columns[0, 0] + np.arange(points)).all():
        columns = columns[:, 1:]
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
    """Return words for a list of points with `width` numbers each, as "a profile, x and z".

    `_fault_of_grid` continues the words for three numbers.
    """
    if width == 2:
        return "a profile, x and z"
    if width == 3:
        return "a list of points, x, y and z, "
    return (
        f"a list of points with {width} numbers each (leave all but x, y and z out, or"
        " name the columns in a first line, as x,y,z,quality)"
    )


def _fault_of_grid(grid: _Grid | None) -> str:
    """Return why points make no map, as the end of a message; "" if they make one.

    `grid` is None if the points are on no grid.
    """
    if grid is None:
        return f"on no regular grid within {100 * EVEN:g} % of its spacing"
    if grid.repeated:
        return f"{grid.repeated} of which lie where others do"
    if grid.covered < COVERED:
        nodes = " x ".join(map(str, grid.shape))
        return f"on {100 * grid.covered:.3g} % of the nodes of a grid of {nodes}"
    return ""


def _is_axis(values: Values, *, evenly: bool) -> bool:
    """Tell whether numbers rise throughout, or fall throughout.

    With `evenly` they also have to do so in steps that differ from their mean by at most `EVEN`.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(values)
        if not ((steps > 0).all() or (steps < 0).all()):
            return False
        if not evenly:
            return True
        mean = steps.mean()
        uneven = np.abs(steps - mean) > EVEN * abs(mean)
    return not uneven.any()


@dataclass(frozen=True, eq=False)
class _Places:
    """The nodes of points along one axis of a grid."""

    # index of the node of each point; 0 for the node with the lowest coordinate
    nodes: NDArray[np.intp]
    count: int  # number of nodes along the axis
    spacing: float  # distance of the nodes, in the unit of the coordinates


@dataclass(frozen=True, eq=False)
class _Grid:
    """A grid of points, and how the points cover it."""

    x: _Places
    y: _Places
    repeated: int  # number of points on a node that has an earlier point
    covered: float  # share of the nodes that have a point, up to 1

    @property
    def shape(self) -> tuple[int, int]:
        """Number of nodes along x and y."""
        return self.x.count, self.y.count


def _grid(x: Values, y: Values) -> _Grid | None:
    """Return the grid of points with these coordinates; None if they are on no even grid."""
    along_x = _places(x)
    along_y = _places(y)
    if along_x is None or along_y is None:
        return None
    flat_indices = along_x.nodes * along_y.count + along_y.nodes
    covered_nodes = int(np.unique(flat_indices).size)
    return _Grid(
        x=along_x,
        y=along_y,
        repeated=flat_indices.size - covered_nodes,
        covered=covered_nodes / (along_x.count * along_y.count),
    )


def _places(coordinates: Values) -> _Places | None:
    """Return the nodes of points along an axis; None if the coordinates are not on even nodes.

    Each step between neighbouring coordinates counts as the whole multiple of the median step that
    is nearest to it: multiples above 1 pass nodes without a point. With the mean spacing that
    follows, all coordinates have to be nearer than `EVEN` spacings to their nodes.
    """
    distinct = np.unique(coordinates)
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(distinct)
        if not steps.size or not np.isfinite(steps).all():
            return None
        # Coordinates of one node may differ by rounding: keep the lowest of them. A step between
        # nodes is more than a tenth of `EVEN` of the largest step.
        are_apart = steps > EVEN / 10 * steps.max()
        distinct = distinct[np.append(True, are_apart)]
        steps = np.diff(distinct)
        nodes_passed = np.rint(steps / np.median(steps))
        indices = np.append(0, np.cumsum(nodes_passed))
        # An axis has two nodes or more, and not more nodes than there are points.
        if not 1 <= indices[-1] < coordinates.size:
            return None
        spacing = float((distinct[-1] - distinct[0]) / indices[-1])
        # the last distinct coordinate that is not above the coordinate of the point
        nearest = np.searchsorted(distinct, coordinates, side="right") - 1
        nodes = indices[nearest].astype(np.intp)
        distance = np.abs((coordinates - distinct[0]) / spacing - nodes)
        if not (distance <= EVEN).all():
            return None
    return _Places(nodes=nodes, count=int(nodes.max()) + 1, spacing=spacing)
