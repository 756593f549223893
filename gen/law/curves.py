"""The numbers of a contact law: points of one surface, and curves with a band and slopes.

`Points` are the contacts of one surface. `tabulated` puts those of one surface or many into a table
of monotone `Curves` over Delta or over pressure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.doubts import modulus_in_words
from gen.law.bands import further_surface
from gen.material import Bodies
from gen.quantities import (
    AREA,
    CONDUCTANCE,
    CONTINUUM,
    DELTA,
    GAS,
    IN_LAWS,
    JOINT,
    LAW_COLUMNS,
    STIFFNESS,
    Trend,
)
from gen.runtime.errors import InputError

MOST = 0.5
"""Share of surfaces outside the training above which a row tells nothing about an interface."""

APART = (
    1e-9  # relative distance within which two numbers are one: rounding lies between them
)

OUTSIDE_WEIGHT = 1e-9
"""Weight of a point outside the training, over one inside, where curves are made monotone."""


@dataclass(frozen=True, eq=False)
class Points:
    """Contacts of one surface under k loads, ascending; every array has shape (k,)."""

    values: dict[
        str, Values
    ]  # by the names of quantities in laws, `gen.quantities.IN_LAWS`
    # Ends of the intervals; quantities without intervals are left out.
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    # For each load, why it is outside the training, and why it has no interval inside; "" where
    # that is not so. The last one may be empty.
    reasons: tuple[str, ...] = ()
    endless: tuple[str, ...] = ()
    # For each load, why the area is that of the grid; "" where the grid resolves the contact, and
    # no entries where that was not judged.
    grid: tuple[str, ...] = ()

    def changed(self, change: Callable[[str, Values], Values], *reasons: str) -> Points:
        """Return points with all arrays changed by the names of their quantities, and reasons."""
        values, low, high = (
            {name: change(name, each) for name, each in part.items()}
            for part in (self.values, self.low, self.high)
        )
        return Points(values, low, high, reasons)

    def chosen(self, places: NDArray[np.bool_] | NDArray[np.int64]) -> Points:
        """Return the points of some of the loads."""
        reasons = np.array(self.reasons, dtype=object)[places]
        chosen = self.changed(lambda _, each: each[places], *reasons)
        if not self.grid:
            return chosen
        return replace(chosen, grid=tuple(np.array(self.grid, dtype=object)[places]))

    def from_rest(self, rest: Mapping[str, float]) -> Points:
        """Put first touch, Delta = 0 with these values (others are 0), before these loads."""
        points = self.changed(
            lambda name, each: np.append(rest.get(name, 0.0), each),
            "",
            *self.reasons,
        )
        return replace(points, grid=("", *self.grid) if self.grid else ())


@dataclass(frozen=True, eq=False)
class Curve:
    """One quantity against k arguments; low and high are NaN where there is no band."""

    value: Values
    low: Values
    high: Values
    slope: Values  # per unit of the argument
    surfaces: Values | None = None  # of each of the K surfaces of a population, (K, k)

    @property
    def std(self) -> Values:
        """Standard deviation over the surfaces, by K - 1, (k,); NaN for one surface."""
        if self.surfaces is None:
            return np.full(self.value.size, np.nan)
        with np.errstate(invalid="ignore"):  # of infinite stiffnesses, which have none
            return np.asarray(self.surfaces.std(axis=0, ddof=1))

    @property
    def banded(self) -> NDArray[np.bool_]:
        """True where there is a band, (k,)."""
        return ~(np.isnan(self.low) | np.isnan(self.high))


@dataclass(frozen=True, eq=False)
class Curves:
    """One table of a law."""

    against: str  # "delta_um" or "pressure_MPa"
    at: Values  # ascending arguments [um or MPa], (k,)
    curves: dict[str, Curve]  # by the name of the quantity, in the order of `LAW_COLUMNS`
    outside: Values  # share of the surfaces outside the surrogate's training, (k,)
    reasons: tuple[
        str, ...
    ]  # why there is no band, or what lies outside the training; else ""
    rest: Mapping[
        str, float
    ]  # where the curves begin, at first touch; those left out at 0
    flagged: NDArray[
        np.bool_
    ]  # where most surfaces are outside a surrogate's training, (k,)
    # Why the area is that of the grid, of a population on its first surface; "" where the grid
    # resolves the contact, and no entries where that was not judged.
    grid: tuple[str, ...] = ()

    @property
    def resolved(self) -> NDArray[np.bool_] | None:
        """True where the grid resolves the contact, (k,); None where that was not judged."""
        return np.array(self.grid) == "" if self.grid else None

    @property
    def resolved_somewhere(self) -> bool:
        """True if the grid resolves the contact under a load."""
        resolved = self.resolved
        return resolved is not None and bool((resolved & (self.at > 0)).any())

    @property
    def banded(self) -> bool:
        """True if any value has a band, beside that of the grid."""
        return any(
            bool(curve.banded.any())
            for name, curve in self.curves.items()
            if name != CONTINUUM.in_laws
        )

    def chosen(self, places: NDArray[np.bool_]) -> Curves:
        """Return the table at some of its arguments, with the slopes through what is left."""
        at, curves = self.at[places], {}
        for name, curve in self.curves.items():
            value, low, high = (
                part[places] for part in (curve.value, curve.low, curve.high)
            )
            slope = slopes(at, value, self.rest.get(name, 0.0))
            surfaces = None if curve.surfaces is None else curve.surfaces[:, places]
            curves[name] = Curve(value, low, high, slope, surfaces)
        reasons = tuple(np.array(self.reasons, dtype=object)[places])
        outside, flagged = self.outside[places], self.flagged[places]
        grid = tuple(np.array(self.grid, dtype=object)[places]) if self.grid else ()
        return replace(
            self,
            at=at,
            curves=curves,
            outside=outside,
            reasons=reasons,
            flagged=flagged,
            grid=grid,
        )

    def below_full_contact(
        self, bodies: Bodies, *, required: bool
    ) -> tuple[Curves, list[str]]:
        """Return the table up to full contact, where nothing is left of an interface, and a line.

        Full contact is where every node touches, or where the stiffness of one surface is infinite.
        A table that is `required` is refused if nothing is left of it but first touch.
        """
        full = self.curves[AREA.in_laws].value >= 100
        if STIFFNESS.in_laws in self.curves:
            full |= ~np.isfinite(self.curves[STIFFNESS.in_laws].value)
        full &= ~self.flagged
        if not full.any():
            return self, []
        end = int(np.argmax(full))
        text = f"full contact from {self.at[end]:.4g} {IN_LAWS[self.against].unit} on"
        if end == 0 or (required and not (self.at[:end] > 0).any()):
            raise InputError(
                f"{text}: no law is left below it: give smaller loads; {modulus_in_words(bodies)}"
            )
        said = f"{text}: the table against {self.against} ends below it"
        return self.chosen(np.arange(self.at.size) < end), [said]

    def with_conductance(self, per_stiffness: float) -> Curves:
        """Add the conductance: the stiffness by the conductivity over E* [W / (m K MPa)]."""
        if STIFFNESS.in_laws not in self.curves:
            return self
        own = self.curves[STIFFNESS.in_laws]
        conductance = Curve(
            value=per_stiffness * own.value,
            low=per_stiffness * own.low,
            high=per_stiffness * own.high,
            slope=per_stiffness * own.slope,
            surfaces=None if own.surfaces is None else per_stiffness * own.surfaces,
        )
        more = {**self.curves, CONDUCTANCE.in_laws: conductance}
        return replace(
            self,
            curves={
                name: more[name] for name in LAW_COLUMNS[self.against] if name in more
            },
        )

    @property
    def conducting(self) -> str:
        """Name of the conductance of all parts that are known; "" if none is."""
        names = [quantity.in_laws for quantity in (JOINT, CONDUCTANCE, GAS)]
        return next((name for name in names if name in self.curves), "")


def tabulated(
    against: str,
    at: Values,
    parts: Sequence[Points],
    level: float,
    rest: Mapping[str, float],
) -> Curves:
    """Put the points of one surface or many, at the same ascending arguments (k,), into one table.

    The values and intervals of one surface are those of its points. Those of a population are the
    mean over the surfaces at the same argument, and the band of a further surface with a chance of
    `level` (`gen.law.bands`). There is no band outside the surrogate's training: for one surface at
    points with a reason, for a population where more surfaces are outside than the band leaves out
    on each side. Where most are, closure, stiffness and conductance are NaN. A value that is not
    finite is refused.
    """
    outside = np.array(
        [[bool(reason) for reason in part.reasons] for part in parts]
    ).mean(axis=0)
    reasons = []  # of one surface all; of many how many are outside, and the first of its reasons
    for each in zip(*(part.reasons for part in parts), strict=True):
        given = list(filter(None, each))
        first = given[0].partition("; ")[0] if given else ""
        many = (
            f"{len(given)} of {len(each)} surfaces, the first: {first}" if given else ""
        )
        reasons.append(many if len(parts) > 1 else each[0])
    withheld = outside > (1 - level) / 2
    if len(parts) == 1 and parts[0].endless:
        reasons = [
            one or other for one, other in zip(reasons, parts[0].endless, strict=True)
        ]
        withheld |= np.array(reasons, dtype=bool)
    curves = {}
    for name in LAW_COLUMNS[against]:
        if not all(name in part.values for part in parts):
            continue
        whole = np.stack([part.values[name] for part in parts])
        value, nowhere = whole.mean(axis=0), np.full(at.size, np.nan)
        if not IN_LAWS[name].diverges and not np.isfinite(value).all():
            raise InputError(
                f"{name} of the law has values that are not finite: no law holds here"
            )
        low, high = (each.get(name, nowhere) for each in (parts[0].low, parts[0].high))
        if len(parts) > 1:
            low, high = further_surface(whole, level, percent=name.endswith("_percent"))
            touching = (at == 0) & (whole == 0).all(
                axis=0
            )  # first touch is 0 on all surfaces
            low[touching] = 0.0
            high[touching] = 0.0
        low, high = np.minimum(low, value), np.maximum(high, value)
        slope = slopes(at, value, rest.get(name, 0.0))
        unknown = withheld | ~np.isfinite(
            low + high
        )  # an interval without an end is none
        low[unknown], high[unknown] = np.nan, np.nan
        # Those that follow from predicted ones miss by more, and are not given outside at all.
        if _is_derived(name):
            value, slope, whole = (
                np.where(outside > MOST, np.nan, each) for each in (value, slope, whole)
            )
        surfaces = whole if len(parts) > 1 else None
        curves[name] = Curve(value, low, high, slope, surfaces)
    return Curves(against, at, curves, outside, tuple(reasons), rest, outside > MOST)


def _is_derived(name: str) -> bool:
    """Return whether a quantity of laws follows from predicted ones."""
    law = IN_LAWS[name].law
    return law is not None and law.derived


def trend(name: str) -> Trend:
    """Return how a quantity of laws changes with the load: it rises, falls or turns."""
    law = IN_LAWS[name].law
    return "turns" if law is None else law.trend


def monotone(points: Points) -> tuple[Points, Points]:
    """Make the curves of one surface monotone, by least squares; return the changes too.

    Quantities that turn, and those that are not finite throughout, stay as they are. Points outside
    the training follow those inside, which they hardly move.
    """
    from scipy.optimize import isotonic_regression

    weights = np.array([OUTSIDE_WEIGHT if reason else 1.0 for reason in points.reasons])

    def smooth(name: str, values: Values) -> Values:
        if (
            name == DELTA.in_laws
            or trend(name) == "turns"
            or not np.isfinite(values).all()
        ):
            return values
        rising = trend(name) == "rises"
        return np.asarray(
            isotonic_regression(values, weights=weights, increasing=rising).x
        )

    found = points.changed(smooth, *points.reasons)
    values, low, high = found.values, found.low, found.high
    for name in low:
        low[name] = np.minimum(low[name], values[name])
        high[name] = np.maximum(high[name], values[name])
    return found, Points({name: values[name] - points.values[name] for name in values})


def continued(points: Points, further: Points) -> Points:
    """Append points at larger Delta, without turning back."""
    values, low, high = (
        {name: held(name, np.append(each, more[name])) for name, each in one.items()}
        for one, more in (
            (points.values, further.values),
            (points.low, further.low),
            (points.high, further.high),
        )
    )
    return Points(values, low, high, points.reasons + further.reasons)


def held(name: str, values: Values) -> Values:
    """Replace values that turn back by the extreme value before them.

    Some quantities do turn: a gas conducts less where contact has taken its place.
    """
    match trend(name):
        case "rises":
            return np.maximum.accumulate(values)
        case "falls":
            return np.minimum.accumulate(values)
    return values


def risen(values: Values, apart: float = APART) -> NDArray[np.bool_]:
    """Return where values are above 0 and, by a relative distance, above all before them, (k,)."""
    kept, last = np.zeros(values.size, dtype=bool), 0.0
    for place, value in enumerate(values.tolist()):
        if value > last * (1 + apart):
            kept[place], last = True, value
    return kept


def slopes(at: Values, values: Values, rest: float) -> Values:
    """Return the slopes of the monotone cubic through values at ascending arguments, (k,).

    `rest` is the value at the argument 0, where the curve begins if it is not among the arguments.
    Values that are not finite have no slope, and the cubic begins anew behind them.
    """
    from scipy.interpolate import PchipInterpolator

    before = int(at.size > 0 and at[0] > 0)
    whole, heights = (
        np.concatenate([[start] * before, part])
        for start, part in ((0.0, at), (rest, values))
    )
    found = np.full(whole.size, np.nan)
    edges = np.flatnonzero(np.diff(np.isfinite(heights), prepend=False, append=False))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        found[first:end] = 0.0
        if end - first > 1:
            part = PchipInterpolator(whole[first:end], heights[first:end])
            found[first:end] = part.derivative()(whole[first:end])
    return found[before:]
