"""The numbers of a contact law: points of one surface, and curves with a band and slopes.

`Points` are the contacts of one surface. `tabulated` puts those of one surface or many into a table
of monotone `Curves` over Delta or over pressure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.material import Bodies, require_within
from gen.runtime.errors import InputError

NAMES = ("delta_um", "area_percent", "force_uN", "mean_gap_um", "pressure_MPa", "closure_um")
"""Quantities of every point. The closure is what the interface alone gives way from first touch on:
Delta, less what the half-space behind a free patch gives way, which a mesh has already."""

STIFFNESS = "stiffness_MPa_per_um"
"""Stiffness of the interface alone, of unloading, per nominal area."""

CONTINUUM = "continuum_area_percent"
"""Area in the continuum; of one solved surface its band is the error of the grid."""

QUANTITIES = ("area_percent", "force_uN", "mean_gap_um", "pressure_MPa", "closure_um")
CONDUCTANCE = "conductance_W_per_mm2_K"  # of the spots of contact
GAS = "gas_conductance_W_per_mm2_K"  # of a gas in the gap
JOINT = "joint_conductance_W_per_mm2_K"  # of both
APERTURES = ("hydraulic_aperture_x_um", "hydraulic_aperture_y_um")  # of the gap, along both axes
COLUMNS = {
    "delta_um": (*QUANTITIES, STIFFNESS, CONDUCTANCE, GAS, JOINT, CONTINUUM, *APERTURES),
    "pressure_MPa": (
        *("delta_um", "closure_um", "area_percent", "mean_gap_um"),
        *(STIFFNESS, CONDUCTANCE, GAS, JOINT, CONTINUUM, *APERTURES),
    ),
}
"""Quantities of a table by what they are tabulated against; the last seven only where asked for."""


class Quantity(NamedTuple):
    """How programs and pictures call a quantity, and how it changes with the load."""

    short: str  # in the names of functions of a C header
    label: str = ""  # in pictures
    falls: bool = False  # with the load
    resting: bool = False  # whether it is not 0 at first touch
    infinite: bool = False  # at full contact


KNOWN = {
    "delta_um": Quantity("delta"),
    "closure_um": Quantity("closure", "closure [µm]"),
    "area_percent": Quantity("area", "contact area [%]"),
    "force_uN": Quantity("force"),
    "mean_gap_um": Quantity("mean_gap", falls=True, resting=True),
    "pressure_MPa": Quantity("pressure"),
    STIFFNESS: Quantity("stiffness", "stiffness [MPa/µm]", infinite=True),
    CONDUCTANCE: Quantity("conductance", "conductance [W/(mm² K)]", infinite=True),
    GAS: Quantity("gas_conductance", "conductance of the gas [W/(mm² K)]", resting=True),
    JOINT: Quantity(
        "joint_conductance",
        "conductance of spots and gas [W/(mm² K)]",
        resting=True,
        infinite=True,
    ),
    CONTINUUM: Quantity("continuum_area", "area in the continuum [%]"),
    APERTURES[0]: Quantity("hydraulic_aperture_x", falls=True, resting=True),
    APERTURES[1]: Quantity("hydraulic_aperture_y", falls=True, resting=True),
}

MOST = 0.5
"""Share of surfaces outside the training above which a row tells nothing about an interface."""

UNITS = {"delta_um": "um", "pressure_MPa": "MPa"}  # of a table's arguments
APART = 1e-9  # relative distance within which two numbers are one: rounding lies between them

OUTSIDE_WEIGHT = 1e-9
"""Weight of a point outside the training, over one inside, where curves are made monotone."""


class Gas(NamedTuple):
    """A gas that fills the gap and conducts heat."""

    conductivity: float  # [W/(m K)]
    # Jump distance [um]: what the gap is wider by for a gas whose molecules fly as far as it is.
    jump_distance: float

    @classmethod
    def of_options(cls, conductivity: float | None, jump_distance: float | None) -> Gas:
        """Return the gas of the options of `gen law`, which needs both."""
        given = {"--gas-conductivity": conductivity, "--jump-distance": jump_distance}
        for (option, value), unit in zip(given.items(), ("W/(m K)", "um"), strict=True):
            if value is None:
                raise InputError(f"a gas needs {' and '.join(given)}: {option} is missing")
            require_within(option, value, unit)
        return cls(conductivity, jump_distance)  # type: ignore[arg-type]

    def conductance(self, gap: Heights) -> float:
        """Return the mean over all nodes, where a gap [um] is open, of k / (gap + M) [W/(mm2 K)].

        Where bodies touch, the gap is 0 and the heat that passes is that of the spots.
        """
        conducting = self.conductivity / (gap + self.jump_distance)
        return float(np.where(gap > 0, conducting, 0.0).mean())


@dataclass(frozen=True, eq=False)
class Points:
    """Contacts of one surface under k loads, ascending; every array has shape (k,)."""

    values: dict[str, Values]  # by `NAMES`, and by `STIFFNESS` where it is known
    # Ends of the intervals; quantities without intervals are left out.
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    # For each load, why it is outside the training, and why it has no interval inside; "" where
    # that is not so. The last one may be empty.
    reasons: tuple[str, ...] = ()
    endless: tuple[str, ...] = ()

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
        return self.changed(lambda _, each: each[places], *reasons)

    def from_rest(self, rest: Mapping[str, float]) -> Points:
        """Put first touch, Delta = 0 with these values (others are 0), before these loads."""
        return self.changed(
            lambda name, each: np.append(rest.get(name, 0.0), each),
            *("", *self.reasons),
        )


@dataclass(frozen=True, eq=False)
class Curve:
    """One quantity against k arguments; low and high are NaN where there is no band."""

    value: Values
    low: Values
    high: Values
    slope: Values  # per unit of the argument

    @property
    def banded(self) -> NDArray[np.bool_]:
        """True where there is a band, (k,)."""
        return ~(np.isnan(self.low) | np.isnan(self.high))


@dataclass(frozen=True, eq=False)
class Curves:
    """One table of a law."""

    against: str  # "delta_um" or "pressure_MPa"
    at: Values  # ascending arguments [um or MPa], (k,)
    curves: dict[str, Curve]  # by the name of the quantity, in the order of `COLUMNS`
    outside: Values  # share of the surfaces outside the surrogate's training, (k,)
    reasons: tuple[str, ...]  # why there is no band, or what lies outside the training; else ""
    rest: Mapping[str, float]  # where the curves begin, at first touch; those left out at 0
    flagged: NDArray[np.bool_]  # where most surfaces are outside a surrogate's training, (k,)

    @property
    def banded(self) -> bool:
        """True if any value has a band, beside that of the grid."""
        return any(
            bool(curve.banded.any()) for name, curve in self.curves.items() if name != CONTINUUM
        )

    def chosen(self, places: NDArray[np.bool_]) -> Curves:
        """Return the table at some of its arguments, with the slopes through what is left."""
        at, curves = self.at[places], {}
        for name, curve in self.curves.items():
            value, low, high = (part[places] for part in (curve.value, curve.low, curve.high))
            slope = slopes(at, value, self.rest.get(name, 0.0))
            curves[name] = Curve(value, low, high, slope)
        reasons = tuple(np.array(self.reasons, dtype=object)[places])
        outside, flagged = self.outside[places], self.flagged[places]
        return replace(
            self, at=at, curves=curves, outside=outside, reasons=reasons, flagged=flagged
        )

    def below_full_contact(self, bodies: Bodies) -> tuple[Curves, list[str]]:
        """Return the table up to full contact, where nothing is left of an interface, and a line.

        Full contact is where every node touches, or where the stiffness of one surface is infinite.
        """
        full = self.curves["area_percent"].value >= 100
        if STIFFNESS in self.curves:
            full |= ~np.isfinite(self.curves[STIFFNESS].value)
        full &= ~self.flagged
        if not full.any():
            return self, []
        end = int(np.argmax(full))
        text = f"full contact from {self.at[end]:.4g} {UNITS[self.against]} on"
        if not (self.at[:end] > 0).any():
            raise InputError(
                f"{text}: no law is left below it: give smaller loads; {bodies.stated}"
            )
        said = f"{text}: the table against {self.against} ends below it"
        return self.chosen(np.arange(self.at.size) < end), [said]

    def with_conductance(self, per_stiffness: float) -> Curves:
        """Add the conductance: the stiffness by the conductivity over E* [W / (m K MPa)]."""
        if STIFFNESS not in self.curves:
            return self
        own = self.curves[STIFFNESS]
        parts = (per_stiffness * part for part in (own.value, own.low, own.high, own.slope))
        more = {**self.curves, CONDUCTANCE: Curve(*parts)}
        return replace(
            self, curves={name: more[name] for name in COLUMNS[self.against] if name in more}
        )

    @property
    def conducting(self) -> str:
        """Name of the conductance of all parts that are known; "" if none is."""
        return next((name for name in (JOINT, CONDUCTANCE, GAS) if name in self.curves), "")


def tabulated(
    against: str, at: Values, parts: Sequence[Points], level: float, rest: Mapping[str, float]
) -> Curves:
    """Put the points of one surface or many, at the same ascending arguments (k,), into one table.

    The values and intervals of one surface are those of its points. Those of a population are mean
    and quantiles over the surfaces at the same argument, with a share `level` between them. There
    is no band outside the surrogate's training: for one surface at points with a reason, for a
    population where more surfaces are outside than the band leaves out on each side. Where most
    are, closure, stiffness and conductance are NaN. A value that is not finite is refused.
    """
    outside = np.array([[bool(reason) for reason in part.reasons] for part in parts]).mean(axis=0)
    reasons = []  # of one surface all; of many how many are outside, and the first of its reasons
    for each in zip(*(part.reasons for part in parts), strict=True):
        given = list(filter(None, each))
        first = given[0].partition("; ")[0] if given else ""
        many = f"{len(given)} of {len(each)} surfaces, the first: {first}" if given else ""
        reasons.append(many if len(parts) > 1 else each[0])
    withheld = outside > (1 - level) / 2
    if len(parts) == 1 and parts[0].endless:
        reasons = [one or other for one, other in zip(reasons, parts[0].endless, strict=True)]
        withheld |= np.array(reasons, dtype=bool)
    curves = {}
    for name in COLUMNS[against]:
        if not all(name in part.values for part in parts):
            continue
        whole = np.stack([part.values[name] for part in parts])
        value, nowhere = whole.mean(axis=0), np.full(at.size, np.nan)
        if not KNOWN[name].infinite and not np.isfinite(value).all():
            raise InputError(f"{name} of the law has values that are not finite: no law holds here")
        low, high = (each.get(name, nowhere) for each in (parts[0].low, parts[0].high))
        if len(parts) > 1:
            with np.errstate(invalid="ignore"):  # of infinite stiffnesses, which leave no band
                low, high = np.quantile(whole, [(1 - level) / 2, (1 + level) / 2], axis=0)
        low, high = np.minimum(low, value), np.maximum(high, value)
        slope = slopes(at, value, rest.get(name, 0.0))
        unknown = withheld | ~np.isfinite(low + high)  # an interval without an end is none
        low[unknown], high[unknown] = np.nan, np.nan
        # Those that follow from predicted ones miss by more, and are not given outside at all.
        if name == "closure_um" or KNOWN[name].infinite:
            value, slope = (np.where(outside > MOST, np.nan, each) for each in (value, slope))
        curves[name] = Curve(value, low, high, slope)
    return Curves(against, at, curves, outside, tuple(reasons), rest, outside > MOST)


def monotone(points: Points) -> tuple[Points, Points]:
    """Make the curves of one surface monotone, by least squares; return the changes too.

    The mean gap falls with Delta, and all other quantities rise. Points outside the training follow
    those inside, which they hardly move.
    """
    from scipy.optimize import isotonic_regression

    weights = np.array([OUTSIDE_WEIGHT if reason else 1.0 for reason in points.reasons])

    def smooth(name: str, values: Values) -> Values:
        if name == "delta_um" or not np.isfinite(values).all():
            return values
        rising = name != "mean_gap_um"
        return np.asarray(isotonic_regression(values, weights=weights, increasing=rising).x)

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

    The gas conducts less where contact has taken its place, and may turn.
    """
    if name in {GAS, JOINT}:
        return values
    return (np.minimum if KNOWN[name].falls else np.maximum).accumulate(values)


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

    before = int(at[0] > 0)
    whole, heights = (
        np.concatenate([[start] * before, part]) for start, part in ((0.0, at), (rest, values))
    )
    found = np.full(whole.size, np.nan)
    edges = np.flatnonzero(np.diff(np.isfinite(heights), prepend=False, append=False))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        found[first:end] = 0.0
        if end - first > 1:
            part = PchipInterpolator(whole[first:end], heights[first:end])
            found[first:end] = part.derivative()(whole[first:end])
    return found[before:]
