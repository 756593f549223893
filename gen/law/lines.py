"""Straight lines that follow a law: where a table has its points.

Programs join the points of a table by straight lines, and a law bends most towards full contact,
where the conductance diverges. Between known points the law is taken to be the monotone cubic
through the logarithms, because it is nearly a power or an exponential there. A table without a
bound has its points on this curve. A table with room for few points may have them beside the curve.
Then lines deviate by equal shares above and below the curve. Each of these shares is half the
deviation of lines between points on the curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values

FINE = 16
"""Number of parts of each interval between known points; lines are compared with the law at the
ends of the parts."""

GOOD = 0.01
"""Largest relative distance from the law that lines of a table without a bound may have."""

NEAR = 0.025
"""Largest relative distance at which a table with little room still has its points on the law.

The slopes of lines between points on the law change as smoothly as the law's, so that solvers
converge."""

TOLERABLE = 0.04
"""Largest relative distance at which a table with little room still has the law's values at all
loads that the user gave."""

FAR_WEIGHT = 0.25
"""Weight of a distance where few or nearly all nodes touch; the weight elsewhere is 1. So 1 /
FAR_WEIGHT times the distance is allowed there."""

ANY = 1e6
"""Allowed relative distance above which every line is accepted. Otherwise a search would not end
where the law is 0, at which no relative distance is allowed."""

HALVINGS = 7
"""Number of steps of the bisection that searches for the smallest distance that fits the room."""

MOST_WIDTH = 10.0
"""Largest half width of a corridor, as a share of the law, in which a path is searched for."""

PART_RISE = 0.03
"""Approximate relative rise of the law between neighbouring places at which a path is compared with
the law."""

LEVELS = np.linspace(-1, 1, 7)
"""Heights above the law at which a path may have vertices, as shares of the corridor's half
width."""

LEVEL = 1e-6
"""Relative rise up to which two points are taken to be level."""

LEAST_RISE = 0.1
"""Smallest rise between neighbouring points beside the law, as a share of the law's rise there."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """Largest relative distances of the lines of a column from the law, in two ranges of loads."""

    inside: float  # where neither few nor nearly all nodes touch; NaN without loads there
    outside: float  # at all other loads; NaN without any

    @classmethod
    def of(cls, distances: Values, inside: NDArray[np.bool_]) -> Deviation:
        """Make a deviation of distances, by taking the largest of each range.

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
        distances_inside = distances[inside]
        distances_outside = distances[~inside]
        largest_inside = largest_outside = np.nan
        if distances_inside.size:
            largest_inside = float(distances_inside.max())
        if distances_outside.size:
            largest_outside = float(distances_outside.max())
        return cls(inside=largest_inside, outside=largest_outside)

    def or_more(self, other: Deviation) -> Deviation:
        """Return the larger of two deviations, range by range.

        Parameters
        ----------
        other : Deviation
            Another deviation of the same column.

        Returns
        -------
        Deviation
            The larger distance of each range. A number replaces NaN.
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
    """The law that one column of a table follows by straight lines, given at fine arguments.

    The law has k + 1 known points, the first at the argument 0. The fine arguments divide each of
    the k intervals into `FINE` parts. "Places" are indices of fine arguments. From 0 to the second
    point, the first load, nothing was computed, and the law is taken to be a straight line.
    """

    at: Values  # ascending fine arguments, the first is 0, (FINE * k + 1,)
    curve: Values  # the law at the fine arguments, (FINE * k + 1,)
    at_loads: Indices  # places of 0 and of the loads that the user gave
    # True where neither few nor nearly all nodes touch, (FINE * k + 1,).
    inside: NDArray[np.bool_]

    @classmethod
    def through(
        cls,
        at: Values,
        values: Values,
        at_loads: NDArray[np.bool_],
        inside: NDArray[np.bool_],
        *,
        power_law: bool,
    ) -> Column:
        """Make a column of known points, of which the first is at the argument 0.

        Parameters
        ----------
        at : ndarray, shape (k + 1,)
            Ascending arguments of the points.
        values : ndarray, shape (k + 1,)
            Values of the law at the points.
        at_loads : ndarray of bool, shape (k + 1,)
            True at the first point and at the loads that the law was asked for.
        inside : ndarray of bool, shape (k + 1,)
            True where neither few nor nearly all nodes touch.
        power_law : bool
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
        if power_law and last > 1:  # parts of even ratio, but for the interval at 0
            fine[FINE:] = np.exp(np.interp(steps[FINE:], points[1:], np.log(at[1:])))
        curve = np.interp(fine, at[:2], values[:2])  # right up to the first load
        curve[FINE:] = curve_through(at[1:], values[1:], power_law=power_law)(fine[FINE:])
        # Remove the rounding of the logarithms at the known points.
        fine[::FINE] = at
        curve[::FINE] = values
        # An interval with one end inside is inside, and its other end with it.
        close = inside.copy()
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
        """Weights of distances from the law at the fine arguments, (FINE * k + 1,)."""
        return np.where(self.inside, 1.0, FAR_WEIGHT)

    def distances(self, line: Line) -> Values:
        """Compute the relative distances of a line from the law.

        Parameters
        ----------
        line : Line
            Points from the argument 0 to the last argument of the column.

        Returns
        -------
        ndarray, shape (FINE * k + 1,)
            Distances at the fine arguments as shares of the law, 0 or more. They are 0 where the
            law is 0.
        """
        lines = np.interp(self.at, line.at, line.values)
        unit = np.where(self.curve > 0, self.curve, np.inf)
        return np.asarray(np.abs(lines - self.curve) / unit)

    def deviation(self, line: Line) -> Deviation:
        """Compute the largest relative distances of a line from the law.

        They are taken at the first load and above. Below it, the law is a straight line itself.

        Parameters
        ----------
        line : Line
            Points from the argument 0 to the last argument of the column.

        Returns
        -------
        Deviation
            The largest distances.
        """
        return Deviation.of(self.distances(line)[FINE:], self.inside[FINE:])

    def laid(self, room: int | None = None, *, filled: bool = False) -> Line:
        """Lay points so that straight lines follow the law best.

        Without a bound the points lie on the law, and include all loads that the user gave. With a
        bound the first of these that applies is taken:

        1. Points on the law, if lines then deviate by `NEAR` at most.
        2. Points beside the law except at 0 and at the user's loads, if lines then deviate by
           `TOLERABLE` at most.
        3. Points beside the law except at 0, at the first load and at the last load.

        The first two need room for all loads. Deviations count only where neither few nor nearly
        all nodes touch.

        Parameters
        ----------
        room : int or None
            Largest number of points of the table, at least 3; None if there is no bound.
        filled : bool
            True to lay as many points as there is room for; ignored without a bound.

        Returns
        -------
        Line
            Points, the first at the argument 0. The points at 0, at the first load and at the last
            load are on the law.
        """
        if room is None:
            return self._on_law(self._within(GOOD, self.at_loads))
        if self.at_loads.size <= room:
            places = self._nearest(room, self.at_loads)
            if filled:
                places = self._with_further(places, room)
            line = self._on_law(places)
            if not self.deviation(line).inside > NEAR:  # also if it is NaN
                return line
            line = self._beside_law(room, self.at_loads, filled=filled)
            if not self.deviation(line).inside > TOLERABLE:
                return line
        second = min(1, self.at_loads.size - 1)
        ends = np.unique(self.at_loads[[0, second, -1]])
        return self._beside_law(room, ends, filled=filled)

    def _on_law(self, places: Indices) -> Line:
        """Return the line whose points are the law at some places."""
        return Line(self.at[places], self.curve[places])

    def _beside_law(self, room: int, kept: Indices, *, filled: bool) -> Line:
        """Lay at most `room` points beside the law, but on it at the kept places.

        If there is no path of so few points, all points are on the law.
        """
        places = self._path_within_room(room, kept)
        if places is None:
            return self._on_law(self._nearest(room, kept))
        if filled:
            places = self._with_further(places, room)
        return self._balanced(places, kept)

    def _path_within_room(self, room: int, kept: Indices) -> Indices | None:
        """Return the places of a path of at most `room` points that stays nearest to the law.

        The path goes through the kept places. Return None if no corridor up to a half width
        of `MOST_WIDTH` has a path of so few points.
        """
        high = GOOD
        path = self._path(high, kept)
        while path is None or path.size > room:
            high *= 2
            if high > MOST_WIDTH:
                return None  # the widest corridor has no such path
            path = self._path(high, kept)
        best = path
        # Search between the last width that failed and the first that fitted.
        low = high / 2
        if high == GOOD:  # the first width fitted: a quarter of it is near enough
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
        """Return the places of the fewest points whose lines deviate by `allowed` at most, or None.

        `allowed` is relative to the law, and divided by the weights. The points may lie beside the
        law, but at the kept places they are on it.
        """
        places = self._places_of_paths()
        curve = self.curve[places]
        width = allowed * curve / self.weights[places]
        width[np.isin(places, kept)] = 0.0
        path = shortest_path(self.at[places], curve, width)
        return None if path is None else np.append(0, places[path])

    def _places_of_paths(self) -> Indices:
        """Return places of a path above 0: the known points, and some between them.

        Neighbouring places are so close that the law changes by about `PART_RISE` at most, if
        `FINE` allows it. Each interval is halved until this is so.
        """
        knots = self.curve[FINE::FINE]
        larger = np.maximum(knots[1:], knots[:-1])
        rises = np.abs(np.diff(knots)) / np.where(larger > 0, larger, 1.0)
        halvings = np.ceil(np.log2(np.maximum(rises / PART_RISE, 1.0)))
        # Number of parts between neighbouring places in each interval, a power of two.
        strides = FINE // np.minimum(2**halvings, FINE).astype(int)
        places = np.arange(FINE, self.at.size - 1)
        chosen = places % strides[places // FINE - 1] == 0
        return np.append(places[chosen], self.at.size - 1)

    def _balanced(self, places: Indices, kept: Indices) -> Line:
        """Return the line with points at some places that deviates least from the law.

        It goes through the law at the kept places. The unknowns of a linear program are the values
        at the places and the largest weighted relative distance, which it minimises.
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
            c=np.append(np.zeros(places.size), 1.0),  # minimise the distance alone
            A_ub=np.block([[lines, distance], [-lines, distance], [falls, no_distance]]),
            b_ub=np.concatenate([ones, -ones, least_falls]),
            A_eq=np.column_stack([through, np.zeros(kept.size)]),
            b_eq=self.curve[kept],
        )
        if program.x is None:  # no solution was found
            return self._on_law(places)
        return Line(self.at[places], program.x[:-1])

    def _shares(self, places: Indices, fine: Indices) -> Values:
        """Return the matrix (k, m) that takes values at m places to a line at k fine arguments."""
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
        """Return the matrix of falls between m neighbouring values, and the largest falls allowed.

        A row of the matrix, (r, m), takes the values to the fall from one place to the next. Where
        the law rises, values have to rise by `LEAST_RISE` of it: the largest fall, (r,), is then
        negative. Steps at which the law falls have no row.
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
        """Add places until there are `room`, each where the lines on the law deviate most."""
        while places.size < min(room, self.at.size):
            distances = self.distances(self._on_law(places)) * self.weights
            distances[places] = -1.0  # never the largest
            places = np.sort(np.append(places, distances.argmax()))
        return places

    def _nearest(self, room: int, kept: Indices) -> Indices:
        """Return `room` places at most, the kept ones included, whose lines are nearest."""
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
        """Return places, with the kept ones, whose lines on the law deviate by `allowed` at most.

        `allowed` is relative to the law, and divided by the weights. Each line is made long by
        `_furthest`.
        """
        places = [0]
        for end in kept[kept > 0].tolist():
            if end <= FINE:  # the law is straight up to its first load
                places.append(end)
            while places[-1] < end:
                places.append(self._furthest(places[-1], end, allowed))
        return np.array(places)

    def _furthest(self, start: int, end: int, allowed: float) -> int:
        """Return the end of a long line from `start` that deviates by `allowed` at most.

        The end is at most `end`. Steps double until a line is too far off, then the end is found
        within the last step by bisection.
        """
        good = start + 1  # a line to the next place is always accepted
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
        """Return whether the line between two places on the law deviates by `allowed` at most.

        `allowed` is relative to the law. Where few or nearly all nodes touch, 1 / FAR_WEIGHT times
        as much is allowed.
        """
        if allowed > ANY:
            return True  # any line is near enough
        part = slice(start, end + 1)
        at = self.at[part]
        curve = self.curve[part]
        slope = (curve[-1] - curve[0]) / (at[-1] - at[0])
        distances = np.abs(curve[0] + slope * (at - at[0]) - curve)
        return bool((self.weights[part] * distances <= allowed * curve).all())


def curve_through(
    at: Values, values: Values, *, power_law: bool = False
) -> Callable[[Values], Values]:
    """Return the monotone cubic through the logarithms of values.

    Parameters
    ----------
    at : ndarray, shape (k,)
        Ascending arguments above 0, at least one.
    values : ndarray, shape (k,)
        Values at the arguments, 0 or more.
    power_law : bool
        True to take the logarithms of the arguments too: values are powers of them, not
        exponentials.

    Returns
    -------
    callable
        The curve as a function of an array of arguments. It is the cubic through the values
        themselves if one of them is 0, and constant if there is one point.
    """
    from scipy.interpolate import PchipInterpolator

    if at.size < 2:
        return lambda places: np.full(places.shape, values[0])
    if not (values > 0).all():
        plain = PchipInterpolator(at, values)
        return lambda places: np.asarray(plain(places))
    if power_law:
        power = PchipInterpolator(np.log(at), np.log(values))
        return lambda places: np.asarray(np.exp(power(np.log(places))))
    exponential = PchipInterpolator(at, np.log(values))
    return lambda places: np.asarray(np.exp(exponential(places)))


def shortest_path(at: Values, curve: Values, width: Values) -> Indices | None:
    """Find a path of the fewest straight lines that stays in a corridor around a curve.

    The vertices of the path lie at some of the arguments, and at `LEVELS` of the corridor. A line
    does not fall unless the curve falls between the ends of the line. A vertex sees another one
    if the straight line between them stays in the corridor. The search goes once over all
    arguments: to reach a vertex takes one line more than to reach the best vertex that sees it.

    Parameters
    ----------
    at : ndarray, shape (k,)
        Ascending arguments.
    curve : ndarray, shape (k,)
        The curve at the arguments.
    width : ndarray, shape (k,)
        Half width of the corridor. It is 0 at both ends, where the path begins and ends.

    Returns
    -------
    ndarray of int or None
        Indices of the vertices, with both ends; None if there is no path.
    """
    levels = LEVELS.size
    heights = curve[:, None] + width[:, None] * LEVELS
    slack = 1 + 1e-9  # so that rounding does not close the corridor
    low = curve - slack * width
    high = curve + slack * width
    unseen = at.size  # more lines than any path has
    # A vertex has the index levels * place + level. `lines` is how many lines reach it, `origins`
    # the vertex before it.
    lines = np.full(at.size * levels, unseen)
    lines[:levels] = 0
    origins = np.zeros(at.size * levels, dtype=np.int64)
    for place in range(at.size - 1):
        vertices = np.arange(levels * place, levels * (place + 1))
        ahead = slice(place + 1, None)
        run = at[ahead] - at[place]
        start = heights[place][:, None]
        # Slopes of lines from each vertex here that stay in the corridor up to each place ahead.
        lowest = np.maximum.accumulate((low[ahead] - start) / run, axis=1)
        highest = np.minimum.accumulate((high[ahead] - start) / run, axis=1)
        # Number of the places ahead, beginning with the next one, that any line from here reaches.
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
    end = lines.size - 1  # all levels are one point at both ends
    if at.size > 1 and lines[end] == unseen:
        return None
    path = [end]
    while path[-1] >= levels:  # back to a vertex of the first place
        path.append(int(origins[path[-1]]))
    return np.array(path[::-1]) // levels
