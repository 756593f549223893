"""What lies between the points of a law: further contacts, and straight lines that follow them.

Programs join the points of a table by straight lines, and a law bends most towards full contact,
where the conductance diverges. So contacts are solved between the loads of the law until the curve
through them foresees the next ones, and the points of a table are laid where lines follow this
curve best. The curve goes through the logarithms, as nearly powers and exponentials do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.law.curves import Curve, Curves, held, risen, slopes
from gen.quantities import AREA, CLOSURE, PRESSURE

ENOUGH = 30
"""Nodes in contact from which on points are laid closely: with fewer, each node is a step."""

MOST_AREA = 90.0
"""Share of the nodes in contact up to which points are laid closely [%]."""

FORESEEN = 0.01
"""Relative distance of a solved contact from the curve below which no more are solved beside it."""

ROUNDS = 5
"""How often an interval between two loads is halved at most."""

NEAR = 1.5
"""Ratio of neighbouring loads above which an interval is halved although its middle is foreseen."""

CHECKS = 20
"""Contacts at most that judge the lines of a table, and had no part in laying its points."""

CHECK_AT = (5**0.5 - 1) / 2
"""Place of these between two loads, which no halving meets: the golden section."""

FINE = 16
"""Parts of an interval of the law, at whose ends straight lines are set beside its curve."""

GOOD = 0.01
"""Relative distance of straight lines from the law below which no more points are laid."""

TOLERABLE = 0.05
"""The same up to which points of a table with little room lie on the law, its own among them."""

APART_WEIGHT = 0.25
"""Weight of a distance where few nodes or nearly all nodes touch, over one elsewhere."""

ANY = 1e6
"""Relative distance above which any line is near enough: a law may be 0 over a part."""

EXCHANGES = 12
"""How often a point of a table is exchanged for another to bring lines nearer to the law."""

LEAST_RISE = 0.1
"""Share of the rise between two points on the law that is left between points beside it."""

CLOSER = 1e-6  # relative rise below which two points are level


def in_range(
    curves: Curves, nodes: int, enough: float = ENOUGH, most_area: float = MOST_AREA
) -> NDArray[np.bool_]:
    """Return where a law of `nodes` nodes has neither too few nor nearly all in contact, (k,)."""
    area = curves.curves[AREA.in_laws].value
    return np.asarray((area * nodes >= 100 * enough) & (area <= most_area))


def solve_between(
    table: Curves, nodes: int, solve: Callable[[Values], Curves], rounds: int = ROUNDS
) -> Curves | None:
    """Solve contacts between the loads of a table until they are foreseen.

    Parameters
    ----------
    table : Curves
        Table of a law, against Delta or pressure, (k,).
    nodes : int
        Nodes of its smallest surface.
    solve : callable
        Solves contacts at ascending loads, (m,) [um or MPa], and returns those that were solved.
    rounds : int
        How often an interval is halved at most; 1 solves one contact in each.

    Returns
    -------
    Curves or None
        The further contacts; None without any.
    """
    known = table.chosen((table.at > 0) & ~table.flagged)
    low = known.at[:-1]
    high = known.at[1:]
    further: Curves | None = None
    for _ in range(rounds):
        if not low.size:
            break
        middles = np.sqrt(low * high)
        contacts = solve(middles)
        if not contacts.at.size:
            break
        # a little beyond the ends, so that the intervals there are known too
        here = in_range(contacts, nodes, ENOUGH / 2, (MOST_AREA + 100) / 2)
        unforeseen = contacts.at[here & (_missed(known, contacts) > FORESEEN)]
        known = merged(known, contacts)
        further = contacts if further is None else merged(further, contacts)
        solved = np.isin(middles, contacts.at)
        halved = solved & (np.isin(middles, unforeseen) | (middles > NEAR * low))
        lower = np.append(low[halved], middles[halved])
        upper = np.append(middles[halved], high[halved])
        low = np.sort(lower)
        high = np.sort(upper)
    return further


def check_loads(table: Curves) -> Values:
    """Return loads between those of a table at which its lines are judged, (m,) [um or MPa]."""
    at = table.at[(table.at > 0) & ~table.flagged]
    between = at[:-1] * (at[1:] / at[:-1]) ** CHECK_AT
    chosen = np.unique(
        np.linspace(0, max(between.size - 1, 0), CHECKS).round().astype(int)
    )
    return between[chosen] if between.size else between


def _missed(known: Curves, contacts: Curves) -> Values:
    """Return by which share the curve through a table misses contacts between its points, (k,)."""
    missed = np.zeros(contacts.at.size)
    if known.against != PRESSURE.in_laws:
        return missed
    closures = known.curves[CLOSURE.in_laws].value
    kept = risen(closures, CLOSER)
    if np.count_nonzero(kept) > 1:
        foreseen = curve_through(closures[kept], known.at[kept])
        at = contacts.curves[CLOSURE.in_laws].value
        missed = np.maximum(missed, np.abs(foreseen(at) / contacts.at - 1))
    if name := known.conducting:
        foreseen = curve_through(known.at, known.curves[name].value, powers=True)
        values = contacts.curves[name].value
        with np.errstate(divide="ignore", invalid="ignore"):
            missed = np.fmax(missed, np.abs(foreseen(contacts.at) / values - 1))
    return missed


def merged(one: Curves, other: Curves) -> Curves:
    """Join two tables of the same law at different arguments into one, in their order."""
    at = np.append(one.at, other.at)
    places = np.argsort(at, kind="stable")
    curves = {}
    for name in one.curves.keys() & other.curves.keys():
        parts = {}
        for part in ("value", "low", "high"):
            both = np.append(
                getattr(one.curves[name], part), getattr(other.curves[name], part)
            )
            values = both[places]
            parts[part] = held(name, values) if np.isfinite(values).all() else values
        slope = slopes(at[places], parts["value"], one.at_rest.get(name, 0.0))
        curves[name] = Curve(**parts, slope=slope)
    return replace(
        one,
        at=at[places],
        curves={name: curves[name] for name in one.curves if name in curves},
        outside=np.append(one.outside, other.outside)[places],
        reasons=tuple(np.array([*one.reasons, *other.reasons], dtype=object)[places]),
        flagged=np.append(one.flagged, other.flagged)[places],
        grid=(),
    )


def curve_through(
    at: Values, values: Values, *, powers: bool = False
) -> Callable[[Values], Values]:
    """Return the monotone cubic through the logarithms of values, at ascending arguments.

    Parameters
    ----------
    at, values : ndarray, shape (k,)
        Two points or more, whose arguments are above 0.
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


@dataclass(frozen=True, eq=False)
class Deviation:
    """Largest distances of the lines of a column from the law, as shares of the law."""

    inside: float  # where neither few nor nearly all nodes touch; NaN if that is nowhere
    outside: float  # elsewhere; NaN if that is nowhere

    def or_more(self, other: Deviation) -> Deviation:
        """Return the larger of two distances."""
        inside = float(np.fmax(self.inside, other.inside))
        return Deviation(inside, float(np.fmax(self.outside, other.outside)))


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

    at: Values  # ascending arguments, from 0 on, (FINE * k + 1,)
    curve: Values  # the law at these
    own: Indices  # places of the points at the loads that the law was asked for
    inside: NDArray[np.bool_]  # where neither few nor nearly all nodes touch

    @classmethod
    def through(
        cls,
        at: Values,
        values: Values,
        own: NDArray[np.bool_],
        inside: NDArray[np.bool_],
        *,
        powers: bool,
    ) -> Column:
        """Make a column of known points, (k + 1,), the first of which is at an argument of 0.

        `own` is where the points of the law are among them, for `powers` see `curve_through`.
        """
        last = at.size - 1
        steps = np.arange(FINE * last + 1) / FINE
        points = np.arange(last + 1)
        fine = np.interp(steps, points, at)
        if powers and last > 1:
            fine[FINE:] = np.exp(np.interp(steps[FINE:], points[1:], np.log(at[1:])))
        curve = np.interp(fine, at[:2], values[:2])
        curve[FINE:] = curve_through(at[1:], values[1:], powers=powers)(fine[FINE:])
        fine[::FINE] = at
        curve[::FINE] = values
        nearest = np.round(steps).astype(int)
        return cls(fine, curve, FINE * np.flatnonzero(own), inside[nearest])

    def off(self, line: Line) -> Values:
        """Return by which share of the law a line is off it, at the fine arguments."""
        lines = np.interp(self.at, line.at, line.values)
        return np.asarray(
            np.abs(lines - self.curve) / np.where(self.curve > 0, self.curve, np.inf)
        )

    def deviation(self, line: Line) -> Deviation:
        """Return how far a line is off the law at most, from the first load on."""
        return largest_of(self.off(line)[FINE:], self.inside[FINE:])

    def laid(self, room: int | None = None, *, filled: bool = False) -> Line:
        """Lay points so that straight lines follow the law best.

        Parameters
        ----------
        room : int or None
            Number of points that the table has room for, at least 3; None if it has no bound.
        filled : bool
            True to lay as many points as there is room for.

        Returns
        -------
        Line
            Points from an argument of 0 on. They lie on the law, whose own points are among them,
            unless lines then would be off by more than `TOLERABLE`. Otherwise they lie beside it,
            half as far as lines between points on the law would be off.
        """
        if room is None:
            return self._on_law(self._within(GOOD, self.own))
        if self.own.size <= room:
            places = self._nearest(room, self.own)
            if filled:
                places = self._with_further(places, room)
            line = self._on_law(places)
            if not self.deviation(line).inside > TOLERABLE:
                return line
        places = self._nearest(
            room, np.unique(self.own[[0, min(1, self.own.size - 1), -1]])
        )
        if filled:
            places = self._with_further(places, room)
        line = self._on_law(places)
        return (
            self._beside_law(places) if self.deviation(line).inside > TOLERABLE else line
        )

    def _on_law(self, places: Indices) -> Line:
        """Return the straight lines between some places on the law."""
        return Line(self.at[places], self.curve[places])

    def _beside_law(self, places: Indices) -> Line:
        """Lay points beside the law, and exchange some for others while lines come nearer."""
        best = self._balanced(places)
        least = self._furthest_off(best)
        for _ in range(EXCHANGES):
            off = self.off(best) * self._weights()
            off[:FINE] = 0.0
            worst = int(off.argmax())
            if worst in places:
                break
            places = self._exchanged(places, worst)
            line = self._balanced(places)
            if (furthest := self._furthest_off(line)) < least:
                best = line
                least = furthest
        return best

    def _furthest_off(self, line: Line) -> float:
        """Return the largest weighted distance of a line from the law."""
        return float((self.off(line) * self._weights())[FINE:].max())

    def _exchanged(self, places: Indices, new: int) -> Indices:
        """Add a place, and take out the one whose neighbours' line is nearest to the law."""
        more = np.sort(np.append(places, new))
        costs = np.full(more.size, np.inf)
        for number in range(2, more.size - 1):
            if more[number] != new and more[number - 1] >= FINE:
                ends = more[[number - 1, number + 1]]
                part = slice(ends[0], ends[1] + 1)
                line = np.interp(self.at[part], self.at[ends], self.curve[ends])
                off = np.abs(line - self.curve[part]) * self._weights()[part]
                costs[number] = (
                    off / np.where(self.curve[part] > 0, self.curve[part], 1)
                ).max()
        return np.delete(more, costs.argmin()) if np.isfinite(costs).any() else places

    def _balanced(self, places: Indices) -> Line:
        """Move points between the ends of the law up or down, until lines are off least.

        This is a linear program in the values at these places, and the distance, which is
        weighted as in `_line_is_near`. Values do not fall where those on the law do not.
        """
        from scipy.optimize import linprog

        points = places.size
        fine = np.arange(FINE, self.at.size)
        fine = fine[self.curve[fine] > 0]
        right = np.clip(np.searchsorted(places, fine), 1, points - 1)
        share = self.at[fine] - self.at[places[right - 1]]
        share /= self.at[places[right]] - self.at[places[right - 1]]
        lines = np.zeros((fine.size, points + 1))
        rows = np.arange(fine.size)
        lines[rows, right - 1] = (1 - share) / self.curve[fine]
        lines[rows, right] = share / self.curve[fine]
        distance = np.zeros_like(lines)
        distance[:, -1] = 1 / self._weights()[fine]
        rises = np.zeros((points - 1, points + 1))
        steps = np.arange(points - 1)
        rises[steps, steps] = 1.0
        rises[steps, steps + 1] = -1.0
        on_law = self.curve[places]
        least = LEAST_RISE * np.maximum(np.diff(on_law), 0)
        rising = np.diff(on_law) >= -CLOSER * on_law[1:]  # level within rounding
        bounds: list[tuple[float, float | None]] = [(0.0, None)] * (points + 1)
        for end in (0, int(np.searchsorted(places, FINE)), points - 1):
            bounds[end] = (float(on_law[end]), float(on_law[end]))
        one = np.ones(fine.size)
        program = linprog(
            np.append(np.zeros(points), 1.0),
            A_ub=np.vstack([lines - distance, -lines - distance, rises[rising]]),
            b_ub=np.concatenate([one, -one, -least[rising]]),
            bounds=bounds,
        )
        if program.x is None:
            return self._on_law(places)
        return Line(self.at[places], program.x[:points])

    def _with_further(self, places: Indices, room: int) -> Indices:
        """Add places, each where the straight lines are furthest off, until there is no room."""
        while places.size < min(room, self.at.size):
            off = self.off(self._on_law(places)) * self._weights()
            off[places] = -1.0
            places = np.sort(np.append(places, off.argmax()))
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
        for _ in range(12):
            middle = (low + high) / 2
            tried = self._within(middle, kept)
            if tried.size <= room:
                places = tried
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
        at = self.at[start : end + 1]
        curve = self.curve[start : end + 1]
        slope = (curve[-1] - curve[0]) / (at[-1] - at[0])
        off = np.abs(curve[0] + slope * (at - at[0]) - curve)
        weight = self._weights()[start : end + 1]
        return bool(
            (weight * off <= np.minimum(allowed, ANY) * curve).all() or allowed > ANY
        )

    def _weights(self) -> Values:
        """Return the weights of distances from the law at the fine arguments."""
        return np.where(self.inside, 1.0, APART_WEIGHT)


def largest_of(off: Values, inside: NDArray[np.bool_]) -> Deviation:
    """Return the largest of distances where the law is to be followed closely, and elsewhere."""
    return Deviation(
        float(off[inside].max()) if inside.any() else np.nan,
        float(off[~inside].max()) if (~inside).any() else np.nan,
    )
