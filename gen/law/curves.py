"""The numbers of a contact law: points of one surface, and curves with a band and slopes.

`Points` are the contacts of one surface. `tabulated` puts those of one surface or of many into a
table of `Curves` over Delta or over pressure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.doubts import modulus_in_words
from gen.law.bands import Band, further_surface
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

if TYPE_CHECKING:
    from bem.budget import Budget

Entry = TypeVar("Entry")

OUTSIDE_SHARE = 0.5
"""Largest share of the surfaces that may be outside a surrogate's training at a row of a table. A
row with a larger share is flagged, because it tells nothing about the interface."""

APART = 1e-9
"""Relative difference up to which two numbers are taken to be equal, as rounding explains it."""

OUTSIDE_WEIGHT = 1e-9
"""Weight of a point outside the training when curves are made monotone; a point inside has 1."""


@dataclass(frozen=True, eq=False)
class Points:
    """Contacts of one surface under k loads, ascending; every array has shape (k,).

    The dictionaries have the names of quantities in laws, `gen.quantities.IN_LAWS`, as keys.
    """

    values: dict[str, Values]
    # Ends of the intervals of the values; quantities without intervals are left out.
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    # For each load, why it is outside the training; "" where it is inside.
    reasons: tuple[str, ...] = ()
    # For each load inside the training without an interval, why it has none; "" for other loads.
    # Empty if all loads have one.
    why_no_interval: tuple[str, ...] = ()
    # For each load, why the grid does not resolve the contact, where the area in the continuum is
    # then not known; "" where it does. Empty if that was not judged.
    unresolved: tuple[str, ...] = ()
    # For each load, the budget of the errors that were asked for; None at first touch. Empty if no
    # error was asked for.
    budgets: tuple[Budget | None, ...] = ()

    def changed(
        self, change: Callable[[str, Values], Values], reasons: tuple[str, ...]
    ) -> Points:
        """Return points with new values and intervals.

        Parameters
        ----------
        change : callable
            Function of the name of a quantity and of its values, or one end of its intervals, (k,).
            It returns the new ones, (m,).
        reasons : tuple of str
            For each of the m new loads, why it is outside the training, or "".

        Returns
        -------
        Points
            New points under m loads, without `why_no_interval`, `unresolved` and `budgets`.
        """

        def all_changed(arrays: dict[str, Values]) -> dict[str, Values]:
            """Return the new arrays of all quantities, by their names."""
            return {name: change(name, array) for name, array in arrays.items()}

        return Points(
            values=all_changed(self.values),
            low=all_changed(self.low),
            high=all_changed(self.high),
            reasons=reasons,
        )

    def chosen(self, places: NDArray[np.bool_] | NDArray[np.int64]) -> Points:
        """Return the points at some of the loads; `why_no_interval` is dropped.

        Parameters
        ----------
        places : ndarray
            Mask of the loads, shape (k,), or indices of them.

        Returns
        -------
        Points
            The points at these loads, in the order of the indices.
        """
        reasons = entries_at(self.reasons, places)
        points = self.changed(lambda _, array: array[places], reasons)
        if self.unresolved:
            points = replace(points, unresolved=entries_at(self.unresolved, places))
        if self.budgets:
            points = replace(points, budgets=entries_at(self.budgets, places))
        return points

    def from_rest(self, at_rest: Mapping[str, float]) -> Points:
        """Put first touch, Delta = 0, before all loads; `why_no_interval` is dropped.

        Parameters
        ----------
        at_rest : mapping
            Values at first touch by names in laws; those left out are 0.

        Returns
        -------
        Points
            Points under k + 1 loads. First touch is inside the training and resolved.
        """
        points = self.changed(
            lambda name, array: np.append(at_rest.get(name, 0.0), array),
            ("", *self.reasons),
        )
        if self.unresolved:
            points = replace(points, unresolved=("", *self.unresolved))
        if self.budgets:
            points = replace(points, budgets=(None, *self.budgets))
        return points


def entries_at(
    entries: Sequence[Entry], places: NDArray[np.bool_] | NDArray[np.int64]
) -> tuple[Entry, ...]:
    """Choose some of the entries that belong to points or rows.

    Parameters
    ----------
    entries : sequence
        k texts, or k other entries.
    places : ndarray
        Mask of shape (k,), or indices.

    Returns
    -------
    tuple
        The entries at these places.
    """
    indices = np.arange(len(entries))[places]
    return tuple(entries[index] for index in indices)


@dataclass(frozen=True, eq=False)
class Curve:
    """One quantity of a law at k arguments, which `Curves.at` has; arrays are in its law's unit."""

    value: Values  # of the surface, or the mean over a population, (k,)
    low: Values  # lower end of the band, NaN where there is none, (k,)
    high: Values  # upper end of the band, NaN where there is none, (k,)
    slope: Values  # derivative of the value, per unit of the argument, (k,)
    # Values of each of the K surfaces of a population, (K, k); None for one surface.
    surfaces: Values | None = None

    @property
    def std(self) -> Values:
        """Standard deviation over the surfaces, by K - 1, (k,); NaN for one surface."""
        if self.surfaces is None:
            return np.full(self.value.size, np.nan)
        # Infinite stiffnesses have the deviation NaN.
        with np.errstate(invalid="ignore"):
            return np.asarray(self.surfaces.std(axis=0, ddof=1))

    @property
    def banded(self) -> NDArray[np.bool_]:
        """True where there is a band, (k,)."""
        return ~(np.isnan(self.low) | np.isnan(self.high))


@dataclass(frozen=True, eq=False)
class Curves:
    """One table of a law: curves at k arguments."""

    against: str  # name of the argument: "delta_um" or "pressure_MPa"
    at: Values  # ascending arguments [um or MPa], (k,)
    curves: dict[str, Curve]  # by the name of the quantity, in the order of `LAW_COLUMNS`
    outside: Values  # share of the surfaces outside the surrogate's training, (k,)
    # For each argument, why there is no band, or what is outside the training; else "".
    reasons: tuple[str, ...]
    # Values at first touch, where the curves begin, by names in laws; those left out are 0.
    at_rest: Mapping[str, float]
    # True where most surfaces are outside a surrogate's training, (k,).
    flagged: NDArray[np.bool_]
    # For each argument, why the grid does not resolve the contact, where the area in the continuum
    # is then not known; "" where it does. A population is judged on its first surface. Empty
    # if that was not judged.
    unresolved: tuple[str, ...] = ()
    # For each argument, the budgets of the errors that were asked for, one for each surface; () at
    # first touch. Empty if no error was asked for.
    budgets: tuple[tuple[Budget, ...], ...] = ()

    def fewest_nodes(self, nodes: int) -> Indices:
        """Return on how many nodes contacts are solved, of all surfaces the fewest.

        Parameters
        ----------
        nodes : int
            Number of nodes of the smallest surface. Contacts within errors are solved on fewer.

        Returns
        -------
        ndarray of int, shape (k,)
            The numbers of nodes at the arguments.
        """
        fewest = np.full(self.at.size, nodes)
        for place, budgets in enumerate(self.budgets):
            if budgets:
                fewest[place] = min(math.prod(budget.nodes) for budget in budgets)
        return fewest

    @property
    def resolved(self) -> NDArray[np.bool_] | None:
        """True where the grid resolves the contact, (k,); None if that was not judged."""
        if not self.unresolved:
            return None
        return np.array([not reason for reason in self.unresolved])

    @property
    def resolved_somewhere(self) -> bool:
        """True if the grid resolves the contact at one argument above 0 or more."""
        resolved = self.resolved
        return resolved is not None and bool((resolved & (self.at > 0)).any())

    @property
    def banded(self) -> bool:
        """True if any value has a band. The band of the area in the continuum is not considered."""
        return any(
            bool(curve.banded.any())
            for name, curve in self.curves.items()
            if name != CONTINUUM.in_laws
        )

    @property
    def conductance_name(self) -> str:
        """Name of the conductance of the interface; "" if there is none.

        It is that of spots and gas together, else that of the spots, else that of the gas.
        """
        for quantity in (JOINT, CONDUCTANCE, GAS):
            if quantity.in_laws in self.curves:
                return quantity.in_laws
        return ""

    def chosen(self, places: NDArray[np.bool_]) -> Curves:
        """Return the table at some of its arguments, with the slopes through the points there.

        Parameters
        ----------
        places : ndarray of bool, shape (k,)
            True at the arguments to keep; none may be kept.

        Returns
        -------
        Curves
            The shorter table. Slopes are those of the cubics through its own points, so they
            differ from the slopes of this table.
        """
        at = self.at[places]
        unresolved = self.unresolved
        if unresolved:
            unresolved = entries_at(unresolved, places)
        budgets = self.budgets
        if budgets:
            budgets = entries_at(budgets, places)
        curves: dict[str, Curve] = {}
        for name, curve in self.curves.items():
            value = curve.value[places]
            surfaces = curve.surfaces
            if surfaces is not None:
                surfaces = surfaces[:, places]
            curves[name] = Curve(
                value=value,
                low=curve.low[places],
                high=curve.high[places],
                slope=slopes(at, value, self.at_rest.get(name, 0.0)),
                surfaces=surfaces,
            )
        return replace(
            self,
            at=at,
            curves=curves,
            outside=self.outside[places],
            reasons=entries_at(self.reasons, places),
            flagged=self.flagged[places],
            unresolved=unresolved,
            budgets=budgets,
        )

    def below_full_contact(self, bodies: Bodies, *, required: bool) -> BelowFullContact:
        """End the table below full contact, in which there is no interface any more.

        Full contact is where every node touches, or where the stiffness is infinite, as it is if
        one surface of a population is in full contact. Flagged arguments, at which most surfaces
        are outside a surrogate's training, are not considered.

        Parameters
        ----------
        bodies : Bodies
            Material of the bodies, for the message of an error.
        required : bool
            True if the table has to have a load above 0.

        Returns
        -------
        BelowFullContact
            The table up to full contact.

        Raises
        ------
        InputError
            If the first argument is in full contact already, or if a required table has no argument
            above 0 below full contact.
        """
        full = self.curves[AREA.in_laws].value >= 100
        if STIFFNESS.in_laws in self.curves:
            full |= ~np.isfinite(self.curves[STIFFNESS.in_laws].value)
        full &= ~self.flagged
        if not full.any():
            return BelowFullContact(curves=self)
        end = int(np.argmax(full))
        start = f"full contact from {self.at[end]:.4g} {IN_LAWS[self.against].unit} on"
        loaded = bool((self.at[:end] > 0).any())
        if end == 0 or (required and not loaded):
            raise InputError(
                f"{start}: no law is left below it: give smaller loads; {modulus_in_words(bodies)}"
            )
        return BelowFullContact(
            curves=self.chosen(np.arange(self.at.size) < end),
            remark=f"{start}: the table against {self.against} ends below it",
        )

    def with_conductance(self, per_stiffness: float) -> Curves:
        """Add the conductance of the spots, which is proportional to the stiffness (Barber 2003).

        Parameters
        ----------
        per_stiffness : float
            Conductivity of both bodies over E* [W / (m K MPa)].

        Returns
        -------
        Curves
            The table with a conductance [W / (mm2 K)]; the same table if it has no stiffness.
        """
        if STIFFNESS.in_laws not in self.curves:
            return self
        stiffness = self.curves[STIFFNESS.in_laws]
        surfaces = None
        if stiffness.surfaces is not None:
            surfaces = per_stiffness * stiffness.surfaces
        conductance = Curve(
            value=per_stiffness * stiffness.value,
            low=per_stiffness * stiffness.low,
            high=per_stiffness * stiffness.high,
            slope=per_stiffness * stiffness.slope,
            surfaces=surfaces,
        )
        curves = {**self.curves, CONDUCTANCE.in_laws: conductance}
        columns = [name for name in LAW_COLUMNS[self.against] if name in curves]
        return replace(self, curves={name: curves[name] for name in columns})


@dataclass(frozen=True, eq=False)
class BelowFullContact:
    """A table that ends below full contact."""

    curves: Curves
    remark: str = ""  # sentence that the table was cut, and where; "" if it was not


def tabulated(
    against: str,
    at: Values,
    parts: Sequence[Points],
    level: float,
    at_rest: Mapping[str, float],
) -> Curves:
    """Put the points of one surface or of many into one table.

    The table of one surface has its values and intervals. The table of a population has the mean
    over the surfaces at each argument, and the band of a further surface (`gen.law.bands`).

    There is no band outside a surrogate's training. One surface has none at points with a reason. A
    population has none where a larger share of the surfaces is outside than the band leaves out on
    each side. Where more than `OUTSIDE_SHARE` of the surfaces is outside, derived quantities, such
    as the stiffness and the conductance, are NaN.

    Parameters
    ----------
    against : str
        Name of the argument in laws, a key of `gen.quantities.LAW_COLUMNS`.
    at : ndarray, shape (k,)
        Ascending arguments [um or MPa].
    parts : sequence of Points
        Points of each surface at these arguments. Each load has an entry in `reasons`.
    level : float
        Chance that a further surface is inside the band, between 0 and 1.
    at_rest : mapping
        Values at first touch by names in laws; those left out are 0.

    Returns
    -------
    Curves
        The table, with all quantities that every surface has, with the budgets of the points, and
        without `unresolved`.

    Raises
    ------
    InputError
        If a mean is not finite, although the quantity is finite at full contact.
    """
    flags = [[bool(reason) for reason in part.reasons] for part in parts]
    outside = np.array(flags).mean(axis=0)
    withheld = outside > (1 - level) / 2  # where there is no band
    if len(parts) == 1:
        reasons = _reasons_of_one_surface(parts[0])
        # Points inside the training without an interval have a reason, too.
        if parts[0].why_no_interval:
            withheld |= np.array(reasons, dtype=bool)
    else:
        reasons = _reasons_of_population(parts)
    curves: dict[str, Curve] = {}
    for name in LAW_COLUMNS[against]:
        if not all(name in part.values for part in parts):
            continue
        curve = _curve(name, at, parts, level, at_rest.get(name, 0.0))
        curve = _without_band(curve, withheld)
        if _is_derived(name):
            # Its error is larger than that of the predicted quantities that it follows from.
            curve = _without_value(curve, outside > OUTSIDE_SHARE)
        curves[name] = curve
    return Curves(
        against=against,
        at=at,
        curves=curves,
        outside=outside,
        reasons=tuple(reasons),
        at_rest=at_rest,
        flagged=outside > OUTSIDE_SHARE,
        budgets=_budgets_of_surfaces(parts),
    )


def _budgets_of_surfaces(parts: Sequence[Points]) -> tuple[tuple[Budget, ...], ...]:
    """Return for each load the budgets of all surfaces; () if no error was asked for."""
    if not all(part.budgets for part in parts):
        return ()
    return tuple(
        tuple(budget for budget in budgets if budget is not None)
        for budgets in zip(*(part.budgets for part in parts), strict=True)
    )


def _reasons_of_one_surface(points: Points) -> list[str]:
    """Return for each load why it is outside the training, or else why it has no interval."""
    if not points.why_no_interval:
        return list(points.reasons)
    pairs = zip(points.reasons, points.why_no_interval, strict=True)
    return [why_outside or why_no_interval for why_outside, why_no_interval in pairs]


def _reasons_of_population(parts: Sequence[Points]) -> list[str]:
    """Return for each load how many surfaces are outside the training, and the first reason.

    The text is "" where all are inside.
    """
    texts: list[str] = []
    for place in range(len(parts[0].reasons)):
        reasons = [part.reasons[place] for part in parts if part.reasons[place]]
        if not reasons:
            texts.append("")
            continue
        first = reasons[0].partition("; ")[0]
        texts.append(f"{len(reasons)} of {len(parts)} surfaces, the first: {first}")
    return texts


def _curve(
    name: str, at: Values, parts: Sequence[Points], level: float, first_touch: float
) -> Curve:
    """Return the curve of a quantity at arguments, (k,).

    Its band is widened to contain the value, and NaN where an end is not finite. `first_touch` is
    the value at first touch. Raises InputError for means that should be finite and are not.
    """
    of_surfaces = np.stack([part.values[name] for part in parts])
    value = of_surfaces.mean(axis=0)
    if not IN_LAWS[name].diverges and not np.isfinite(value).all():
        raise InputError(
            f"{name} of the law has values that are not finite: no law holds here"
        )
    surfaces: Values | None = None
    band = _interval(name, parts[0])
    if len(parts) > 1:
        surfaces = of_surfaces
        band = _band(name, at, of_surfaces, level)
    low = np.minimum(band.low, value)
    high = np.maximum(band.high, value)
    curve = Curve(
        value=value,
        low=low,
        high=high,
        slope=slopes(at, value, first_touch),
        surfaces=surfaces,
    )
    return _without_band(curve, ~np.isfinite(low + high))


def _interval(name: str, points: Points) -> Band:
    """Return the interval of a quantity of one surface as a band, (k,); NaN if it has none."""
    nowhere = np.full(points.values[name].size, np.nan)
    return Band(low=points.low.get(name, nowhere), high=points.high.get(name, nowhere))


def _band(name: str, at: Values, of_surfaces: Values, level: float) -> Band:
    """Return the band of a quantity, (k,), from its values on K surfaces, (K, k).

    At first touch, where all surfaces have the value 0, both ends are 0.
    """
    percent = name.endswith("_percent")
    band = further_surface(of_surfaces, level, percent=percent)
    touching = (at == 0) & (of_surfaces == 0).all(axis=0)
    band.low[touching] = 0.0
    band.high[touching] = 0.0
    return band


def _without_band(curve: Curve, places: NDArray[np.bool_]) -> Curve:
    """Return a curve with NaN as both ends of its band at some places, (k,)."""
    return replace(
        curve,
        low=np.where(places, np.nan, curve.low),
        high=np.where(places, np.nan, curve.high),
    )


def _without_value(curve: Curve, places: NDArray[np.bool_]) -> Curve:
    """Return a curve with NaN as value and slope at some places, (k,), on every surface too."""
    surfaces = curve.surfaces
    if surfaces is not None:
        surfaces = np.where(places, np.nan, surfaces)
    return replace(
        curve,
        value=np.where(places, np.nan, curve.value),
        slope=np.where(places, np.nan, curve.slope),
        surfaces=surfaces,
    )


def _is_derived(name: str) -> bool:
    """Return whether surrogates compute a quantity of laws from predicted ones."""
    law = IN_LAWS[name].law
    return law is not None and law.derived


def trend(name: str) -> Trend:
    """Return how a quantity changes with the load.

    Parameters
    ----------
    name : str
        Name of the quantity in laws.

    Returns
    -------
    {"rises", "falls", "turns"}
        The trend; a quantity that "turns" may both rise and fall.
    """
    law = IN_LAWS[name].law
    if law is None:
        return "turns"
    return law.trend


@dataclass(frozen=True, eq=False)
class Monotone:
    """Points of one surface whose curves are monotone."""

    points: Points
    corrections: dict[str, Values]  # new values minus old values, (k,), by names in laws


def monotone(points: Points) -> Monotone:
    """Make the curves of one surface monotone by least squares.

    Delta, quantities that turn, and quantities with a value that is not finite stay unchanged.
    Points outside the training have a small weight, so that they hardly move the points inside.
    `why_no_interval` and `unresolved` are dropped.

    Parameters
    ----------
    points : Points
        Points at ascending loads, (k,).

    Returns
    -------
    Monotone
        The new points, and the corrections. Ends of intervals are made monotone, too, and are moved
        to the value if the value would lie beyond them.
    """
    from scipy.optimize import isotonic_regression

    weights = np.array([OUTSIDE_WEIGHT if reason else 1.0 for reason in points.reasons])

    def smooth(name: str, values: Values) -> Values:
        """Return the monotone values of a quantity that are nearest, or the values unchanged."""
        if name == DELTA.in_laws or trend(name) == "turns":
            return values
        if not np.isfinite(values).all():
            return values
        rises = trend(name) == "rises"
        regression = isotonic_regression(values, weights=weights, increasing=rises)
        return np.asarray(regression.x)

    smoothed = points.changed(smooth, points.reasons)
    values = smoothed.values
    low = {name: np.minimum(end, values[name]) for name, end in smoothed.low.items()}
    high = {name: np.maximum(end, values[name]) for name, end in smoothed.high.items()}
    corrections = {name: values[name] - points.values[name] for name in values}
    new_points = replace(smoothed, low=low, high=high)
    return Monotone(points=new_points, corrections=corrections)


def continued(points: Points, larger: Points) -> Points:
    """Append points at larger loads, and replace values that turn back by `without_reversals`.

    The ends of intervals are made monotone, too.

    Parameters
    ----------
    points : Points
        Points of one surface, under k loads.
    larger : Points
        Points of the same surface and quantities, under m larger loads.

    Returns
    -------
    Points
        Points under k + m loads, with neither `why_no_interval` nor `unresolved`.
    """

    def appended(
        arrays: dict[str, Values], at_larger: dict[str, Values]
    ) -> dict[str, Values]:
        """Return the arrays with those at larger loads behind them, without reversals."""
        return {
            name: without_reversals(name, np.append(array, at_larger[name]))
            for name, array in arrays.items()
        }

    return Points(
        values=appended(points.values, larger.values),
        low=appended(points.low, larger.low),
        high=appended(points.high, larger.high),
        reasons=points.reasons + larger.reasons,
    )


def without_reversals(name: str, values: Values) -> Values:
    """Replace each value that turns back by the extreme of the values before it.

    Parameters
    ----------
    name : str
        Name of the quantity in laws.
    values : ndarray, shape (k,)
        Its values at ascending loads.

    Returns
    -------
    ndarray, shape (k,)
        Values that nowhere fall, or nowhere rise. Values of a quantity that turns are returned as
        they are, as the conductance of a gas, which falls where contact takes the place of the gap.
    """
    match trend(name):
        case "rises":
            return np.maximum.accumulate(values)
        case "falls":
            return np.minimum.accumulate(values)
    return values


def risen(values: Values, apart: float = APART) -> NDArray[np.bool_]:
    """Find values that are above 0 and above all values before them.

    Parameters
    ----------
    values : ndarray, shape (k,)
        Numbers in any order.
    apart : float
        Relative distance by which a value has to be above the last value that was found.

    Returns
    -------
    ndarray of bool, shape (k,)
        True at these values.
    """
    rising = np.zeros(values.size, dtype=bool)
    last = 0.0
    for place, value in enumerate(values.tolist()):
        if value > last * (1 + apart):
            rising[place] = True
            last = value
    return rising


def slopes(at: Values, values: Values, first_touch: float) -> Values:
    """Compute the slopes of the monotone cubic through values (scipy's PCHIP).

    Parameters
    ----------
    at : ndarray, shape (k,)
        Ascending arguments, 0 or more.
    values : ndarray, shape (k,)
        Values at these arguments.
    first_touch : float
        Value at the argument 0. The cubic begins there even if 0 is not among the arguments.

    Returns
    -------
    ndarray, shape (k,)
        Slopes at the arguments. They are NaN where values are not finite. Each run of finite values
        has a cubic of its own; a run of one value has the slope 0.
    """
    from scipy.interpolate import PchipInterpolator

    starts_later = at.size > 0 and at[0] > 0
    if starts_later:
        at = np.append(0.0, at)
        values = np.append(first_touch, values)
    slope = np.full(at.size, np.nan)
    # Indices at which runs of finite values begin and end, in turn.
    edges = np.flatnonzero(np.diff(np.isfinite(values), prepend=False, append=False))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        slope[first:end] = 0.0
        if end - first > 1:
            part = PchipInterpolator(at[first:end], values[first:end])
            slope[first:end] = part.derivative()(at[first:end])
    if starts_later:  # without the point at 0 that was added
        return slope[1:]
    return slope
