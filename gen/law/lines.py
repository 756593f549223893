"""Straight lines that follow a law: where a table has its points.

Programs join the points of a table by straight lines, and a law bends most towards full contact,
where the conductance diverges. Between known points the law is taken as the monotone cubic through
the logarithms, as it is nearly powers and exponentials there. A table without a bound has points on
this curve. A table with room for few points has them beside the curve, so that lines are off by the
same share above and below it: half as far as lines between points on the curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values

FINE = 16
"""Number of parts of an interval between two known points, at whose ends lines are compared."""

GOOD = 0.01
"""Relative distance from the law up to which lines of a table without a bound are long."""

NEAR = 0.025
"""Relative distance up to which points of a table with little room lie on the law.

The slopes of such lines change as smoothly as those of the law, so that solvers converge."""

TOLERABLE = 0.04
"""Relative distance up to which lines with little room go through the points asked for."""

FAR_WEIGHT = 0.25
"""Weight of a distance where few or nearly all nodes touch; it is 1 elsewhere."""

ANY = 1e6
"""Relative distance above which any line is near enough, because a law may be 0 over a part."""

HALVINGS = 7
"""Number of halvings by which the least distance is searched for."""

MOST_WIDTH = 10.0
"""Half width of a corridor, as a share of the law, in which a path is looked for at most."""

PART_RISE = 0.03
"""Relative rise of the law from one place to the next at which a path is compared with it."""

LEVELS = np.linspace(-1, 1, 7)
"""Heights of a vertex in a corridor, in shares of the corridor's half width."""

LEVEL = 1e-6
"""Relative rise below which two points are level."""

LEAST_RISE = 0.1
"""Share of the rise between two points on the law that is left between points beside it."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """Largest distances of the lines of a column from the law, as shares of the law."""

    inside: float  # where neither few nor nearly all nodes touch; NaN if that is nowhere
    outside: float  # elsewhere; NaN if that is nowhere

    @classmethod
    def of(cls, distances: Values, inside: NDArray[np.bool_]) -> Deviation:
        """Return the largest distances inside and outside the range that is followed closely.

        Parameters
        ----------
        distances : ndarray, shape (k,)
            Relative distances of lines from the law.
        inside : ndarray of bool, shape (k,)
            True where neither few nor nearly all nodes touch.

        Returns
        -------
        Deviation
            The largest distances.
        """
        outside = ~inside
        return cls(
            inside=float(distances[inside].max()) if inside.any() else np.nan,
            outside=float(distances[outside].max()) if outside.any() else np.nan,
        )

    def or_more(self, other: Deviation) -> Deviation:
        """Return the larger of two deviations, range by range.

        Parameters
        ----------
        other : Deviation
            Another deviation of the same column.

        Returns
        -------
        Deviation
            The larger distances; NaN only where both are.
        """
        return Deviation(
            inside=float(np.fmax(self.inside, other.inside)),
            outside=float(np.fmax(self.outside, other.outside)),
        )


@dataclass(frozen=True, eq=False)
class Line:
    """Points that are joined by straight lines."""

    at: Values  # ascending arguments, (m,)
    values: Values  # (m,)


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a table that is straight between its points, and the law that it follows.

    Places are indices into the fine arguments, which have `FINE` parts between two known points.
    From 0 to the first load nothing was computed, and the law is a straight line.
    """

    at: Values  # ascending fine arguments, from 0 on, (FINE * k + 1,)
    curve: Values  # the law at these
    at_loads: Indices  # places of the points at the loads that the law was asked for
    inside: NDArray[np.bool_]  # where neither few nor nearly all nodes touch

    @classmethod
    def through(
        cls,
        at: Values,
        values: Values,
        at_loads: NDArray[np.bool_],
        inside: NDArray[np.bool_],
        *,
        powers: bool,
    ) -> Column:
        """Make a column of known points, of which the first is at an argument of 0.

        Parameters
        ----------
        at, values : ndarray, shape (k + 1,)
            Known points, at ascending arguments.
        at_loads : ndarray of bool, shape (k + 1,)
            True at the loads that the law was asked for.
        inside : ndarray of bool, shape (k + 1,)
            True where neither few nor nearly all nodes touch.
        powers : bool
            True if the law is a power of its argument rather than an exponential of it.

        Returns
        -------
        Column
            The column.
        """
        last = at.size - 1
        points = np.arange(last + 1)
        steps = np.arange(FINE * last + 1) / FINE
        fine = np.interp(steps, points, at)
        if powers and last > 1:
            fine[FINE:] = np.exp(np.interp(steps[FINE:], points[1:], np.log(at[1:])))
        curve = np.interp(fine, at[:2], values[:2])
        curve[FINE:] = curve_through(at[1:], values[1:], powers=powers)(fine[FINE:])
        fine[::FINE] = at
        curve[::FINE] = values
        close = inside.copy()  # with the intervals that lead there
        close[:-1] |= inside[1:]
        close[1:] |= inside[:-1]
        before = np.floor(steps).astype(int)
        after = np.ceil(steps).astype(int)
        return cls(
            at=fine,
            curve=curve,
            at_loads=FINE * np.flatnonzero(at_loads),
            inside=close[before] & close[after],
        )

    @property
    def weights(self) -> Values:
        """Weights of distances from the law at the fine arguments."""
        return np.where(self.inside, 1.0, FAR_WEIGHT)

    def distances(self, line: Line) -> Values:
        """Return how far a line is off the law.

        Parameters
        ----------
        line : Line
            Points from an argument of 0 to the last one.

        Returns
        -------
        ndarray, shape (FINE * k + 1,)
            Distances at the fine arguments as shares of the law; 0 where the law is 0.
        """
        lines = np.interp(self.at, line.at, line.values)
        unit = np.where(self.curve > 0, self.curve, np.inf)
        return np.asarray(np.abs(lines - self.curve) / unit)

    def deviation(self, line: Line) -> Deviation:
        """Return how far a line is off the law at most, from the first load on.

        Parameters
        ----------
        line : Line
            Points from an argument of 0 to the last one.

        Returns
        -------
        Deviation
            The largest distances.
        """
        return Deviation.of(self.distances(line)[FINE:], self.inside[FINE:])

    def laid(self, room: int | None = None, *, filled: bool = False) -> Line:
        """Lay points so that straight lines follow the law best.

        Without a bound the points lie on the law. With room for few they do if lines are then off
        by `NEAR` at most, and otherwise lie beside the law. Lines go through the points at the
        loads of the law unless they were off by more than `TOLERABLE`.

        Parameters
        ----------
        room : int or None
            Number of points that the table has room for, at least 3; None if it has no bound.
        filled : bool
            True to lay as many points as there is room for.

        Returns
        -------
        Line
            Points from an argument of 0 on. The first two and the last lie on the law.
        """
        if room is None:
            return self._on_law(self._within(GOOD, self.at_loads))
        if self.at_loads.size <= room:
            places = self._nearest(room, self.at_loads)
            if filled:
                places = self._with_further(places, room)
            line = self._on_law(places)
            if not self.deviation(line).inside > NEAR:
                return line
            line = self._beside_law(room, self.at_loads, filled=filled)
            if not self.deviation(line).inside > TOLERABLE:
                return line
        ends = np.unique(self.at_loads[[0, min(1, self.at_loads.size - 1), -1]])
        return self._beside_law(room, ends, filled=filled)

    def _on_law(self, places: Indices) -> Line:
        """Return the straight lines between some places on the law."""
        return Line(self.at[places], self.curve[places])

    def _beside_law(self, room: int, kept: Indices, *, filled: bool) -> Line:
        """Lay points where a path of few lines through the kept places stays nearest to the law."""
        places = self._path_within_room(room, kept)
        if places is None:
            return self._on_law(self._nearest(room, kept))
        if filled:
            places = self._with_further(places, room)
        return self._balanced(places, kept)

    def _path_within_room(self, room: int, kept: Indices) -> Indices | None:
        """Return the places of the nearest path to the law of at most `room` points, or None."""
        high = GOOD
        path = self._path(high, kept)
        while path is None or path.size > room:
            high *= 2
            if high > MOST_WIDTH:
                return None
            path = self._path(high, kept)
        best = path
        low = high / 2
        if high == GOOD:
            low = GOOD / 4
        for _ in range(HALVINGS):
            middle = float(np.sqrt(low * high))
            path = self._path(middle, kept)
            if path is not None and path.size <= room:
                best = path
                high = middle
            else:
                low = middle
        return best

    def _path(self, allowed: float, kept: Indices) -> Indices | None:
        """Return the places of the fewest points whose lines are off by what is allowed at most."""
        places = self._places_of_paths()
        curve = self.curve[places]
        width = allowed * curve / self.weights[places]
        width[np.isin(places, kept)] = 0.0
        path = shortest_path(self.at[places], curve, width)
        return None if path is None else np.append(0, places[path])

    def _places_of_paths(self) -> Indices:
        """Return the known points from the first load on, with some between where the law rises."""
        knots = self.curve[FINE::FINE]
        larger = np.maximum(knots[1:], knots[:-1])
        rises = np.abs(np.diff(knots)) / np.where(larger > 0, larger, 1.0)
        halvings = np.ceil(np.log2(np.maximum(rises / PART_RISE, 1.0)))
        strides = FINE // np.minimum(2**halvings, FINE).astype(int)
        places = np.arange(FINE, self.at.size - 1)
        chosen = places % strides[places // FINE - 1] == 0
        return np.append(places[chosen], self.at.size - 1)

    def _balanced(self, places: Indices, kept: Indices) -> Line:
        """Return the lines between some places that are off least and go through the kept places.

        The values at the places, and the weighted distance, are the unknowns of a linear program.
        """
        from scipy.optimize import linprog

        fine = np.arange(FINE, self.at.size)
        fine = fine[self.curve[fine] > 0]
        lines = self._shares(places, fine) / self.curve[fine, None]
        ones = np.ones(fine.size)
        distance = -1 / self.weights[fine, None]
        falls, least_falls = self._falls(places)
        no_distance = np.zeros((falls.shape[0], 1))
        through = self._shares(places, kept)
        program = linprog(
            np.append(np.zeros(places.size), 1.0),
            A_ub=np.block([[lines, distance], [-lines, distance], [falls, no_distance]]),
            b_ub=np.concatenate([ones, -ones, least_falls]),
            A_eq=np.column_stack([through, np.zeros(kept.size)]),
            b_eq=self.curve[kept],
        )
        if program.x is None:
            return self._on_law(places)
        return Line(self.at[places], program.x[:-1])

    def _shares(self, places: Indices, fine: Indices) -> Values:
        """Return the shares of values at m places in lines at k fine arguments, (k, m)."""
        right = np.clip(np.searchsorted(places, fine), 1, places.size - 1)
        before = right - 1
        start = self.at[places[before]]
        share = (self.at[fine] - start) / (self.at[places[right]] - start)
        shares = np.zeros((fine.size, places.size))
        rows = np.arange(fine.size)
        shares[rows, before] = 1 - share
        shares[rows, right] = share
        return shares

    def _falls(self, places: Indices) -> tuple[Values, Values]:
        """Return what values at m places fall by, as rows of m shares, and the most they may fall.

        Where the law rises from one place to the next, values rise by `LEAST_RISE` of it at least.
        """
        on_law = self.curve[places]
        rises = np.diff(on_law)
        steps = np.flatnonzero(rises >= -LEVEL * on_law[1:])
        falls = np.zeros((steps.size, places.size))
        rows = np.arange(steps.size)
        falls[rows, steps] = 1.0
        falls[rows, steps + 1] = -1.0
        return falls, -LEAST_RISE * np.maximum(rises[steps], 0)

    def _with_further(self, places: Indices, room: int) -> Indices:
        """Add places, each where the straight lines are furthest off, until there is no room."""
        while places.size < min(room, self.at.size):
            distances = self.distances(self._on_law(places)) * self.weights
            distances[places] = -1.0
            places = np.sort(np.append(places, distances.argmax()))
        return places

    def _nearest(self, room: int, kept: Indices) -> Indices:
        """Return places that fit into the room, with the kept ones, whose lines are off least."""
        places = self._within(GOOD, kept)
        if places.size <= room:
            return places
        low = GOOD
        high = 2 * GOOD
        while (places := self._within(high, kept)).size > room:
            low = high
            high *= 2
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            fewer = self._within(middle, kept)
            if fewer.size <= room:
                places = fewer
                high = middle
            else:
                low = middle
        return places

    def _within(self, allowed: float, kept: Indices) -> Indices:
        """Return the fewest places, with the kept ones, whose lines are off by what is allowed."""
        places = [0]
        for end in kept[kept > 0].tolist():
            if end <= FINE:  # the law is straight up to its first load
                places.append(end)
            while places[-1] < end:
                places.append(self._furthest(places[-1], end, allowed))
        return np.array(places)

    def _furthest(self, start: int, end: int, allowed: float) -> int:
        """Return the last place up to which one line from a start is off by what is allowed."""
        good = start + 1
        step = 1
        while good < end and self._line_is_near(start, min(good + step, end), allowed):
            good = min(good + step, end)
            step *= 2
        bad = min(good + step, end + 1)
        while bad - good > 1:
            middle = (good + bad) // 2
            if self._line_is_near(start, middle, allowed):
                good = middle
            else:
                bad = middle
        return good

    def _line_is_near(self, start: int, end: int, allowed: float) -> bool:
        """Tell whether one line is off by what is allowed at most; more is allowed outside."""
        if allowed > ANY:
            return True
        part = slice(start, end + 1)
        at = self.at[part]
        curve = self.curve[part]
        slope = (curve[-1] - curve[0]) / (at[-1] - at[0])
        distances = np.abs(curve[0] + slope * (at - at[0]) - curve)
        return bool((self.weights[part] * distances <= allowed * curve).all())


def curve_through(
    at: Values, values: Values, *, powers: bool = False
) -> Callable[[Values], Values]:
    """Return the monotone cubic through the logarithms of values, at ascending arguments.

    Parameters
    ----------
    at, values : ndarray, shape (k,)
        One point or more, whose arguments are above 0.
    powers : bool
        True to take the logarithms of the arguments too.

    Returns
    -------
    callable
        The curve as a function of arguments. Where a value is 0, it is the cubic of the values.
    """
    from scipy.interpolate import PchipInterpolator

    if at.size < 2:
        return lambda places: np.full(places.shape, values[0])
    if not (values > 0).all():
        plain = PchipInterpolator(at, values)
        return lambda places: np.asarray(plain(places))
    if powers:
        power = PchipInterpolator(np.log(at), np.log(values))
        return lambda places: np.asarray(np.exp(power(np.log(places))))
    exponential = PchipInterpolator(at, np.log(values))
    return lambda places: np.asarray(np.exp(exponential(places)))


def shortest_path(at: Values, curve: Values, width: Values) -> Indices | None:
    """Find a path of the fewest straight lines that stays in a corridor around a curve.

    The vertices of the path lie at some of the arguments, and at `LEVELS` of the corridor. A line
    rises where the curve rises between its ends. The search goes once over all arguments: a vertex
    needs one line more than the best of those before it from which it is seen.

    Parameters
    ----------
    at, curve : ndarray, shape (k,)
        The curve at ascending arguments.
    width : ndarray, shape (k,)
        Half width of the corridor; 0 at both ends, where the path begins and ends.

    Returns
    -------
    ndarray of int or None
        Indices of the vertices, with both ends; None if there is no path.
    """
    levels = LEVELS.size
    heights = curve[:, None] + width[:, None] * LEVELS
    slack = 1 + 1e-9
    low = curve - slack * width
    high = curve + slack * width
    unseen = at.size  # more lines than any path has
    lines = np.full(at.size * levels, unseen)
    lines[:levels] = 0
    origins = np.zeros(at.size * levels, dtype=np.int64)
    for place in range(at.size - 1):
        vertices = np.arange(levels * place, levels * (place + 1))
        ahead = slice(place + 1, None)
        run = at[ahead] - at[place]
        start = heights[place][:, None]
        lowest = np.maximum.accumulate((low[ahead] - start) / run, axis=1)
        highest = np.minimum.accumulate((high[ahead] - start) / run, axis=1)
        open_to = np.count_nonzero((lowest <= highest).any(axis=0))
        ahead = slice(place + 1, place + 1 + open_to)
        slopes = (heights[ahead] - start[:, :, None]) / run[:open_to, None]
        seen = slopes >= lowest[:, :open_to, None]
        seen &= slopes <= highest[:, :open_to, None]
        falling = curve[ahead] < curve[place]
        seen &= (slopes >= 0) | falling[:, None]
        needed = np.where(seen, lines[vertices, None, None] + 1, unseen)
        fewest = needed.min(axis=0).ravel()
        best = vertices[needed.argmin(axis=0).ravel()]
        targets = slice(levels * (place + 1), levels * (place + 1 + open_to))
        better = fewest < lines[targets]
        lines[targets][better] = fewest[better]
        origins[targets][better] = best[better]
    end = lines.size - 1
    if at.size > 1 and lines[end] == unseen:
        return None
    path = [end]
    while path[-1] >= levels:
        path.append(int(origins[path[-1]]))
    return np.array(path[::-1]) // levels
