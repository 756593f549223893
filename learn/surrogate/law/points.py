"""Points of one surface's contact law: predicted, or solved at the loads that were asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gen.measured.single import contact_warnings, solve_loads
from gen.measured.topography import Topography
from gen.runtime.errors import InputError
from learn.surrogate.law.subjects import Subject
from learn.surrogate.model import OnSurface

if TYPE_CHECKING:
    from bem import Contact

Values = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Points:
    """Contacts of one surface under k loads, ascending.

    Attributes
    ----------
    values : (k,) by name: delta_um, area_percent, force_uN, mean_gap_um, pressure_MPa
    low, high : (k,) ends of the intervals by name; a name without intervals is left out
    reasons : k texts: why a load is unknown ground, "" where it is not
    endless : k texts: why a load on known ground has no interval, "" where it has one; or no texts
    warnings : what to know before trusting solved contacts of this surface
    """

    values: dict[str, Values]
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    endless: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def chosen(self, places: NDArray[np.bool_] | NDArray[np.int64]) -> Points:
        """Some of the loads."""

        def some(part: dict[str, Values]) -> dict[str, Values]:
            return {name: each[places] for name, each in part.items()}

        reasons = tuple(np.array(self.reasons, dtype=object)[places])
        return Points(some(self.values), some(self.low), some(self.high), reasons)

    def joined(self, more: Points) -> Points:
        """These loads, then others."""

        def both(one: dict[str, Values], other: dict[str, Values]) -> dict[str, Values]:
            return {name: np.concatenate([each, other[name]]) for name, each in one.items()}

        return Points(
            both(self.values, more.values),
            both(self.low, more.low),
            both(self.high, more.high),
            self.reasons + more.reasons,
        )

    def from_rest(self, subject: Subject) -> Points:
        """First touch at Delta = 0, where all is known, then these loads."""
        rest = {name: np.zeros(1) for name in self.values}
        rest["mean_gap_um"] = np.array([subject.gap_at_rest])
        ends = {name: rest[name] for name in self.low}
        return Points(rest, ends, ends, ("",)).joined(self)


def predicted(
    pressed: OnSurface, subject: Subject, deltas: Values, level: float, e_star: float
) -> Points:
    """One surface's law from the surrogate.

    Parameters
    ----------
    pressed : the surrogate on the surface
    subject : the surface
    deltas : (k,) ascending, above 0 [um]
    level : coverage of the intervals
    e_star : E* [MPa]

    Raises
    ------
    InputError
        If a prediction is not finite.
    """
    answer = pressed.predict(deltas, e_star=e_star, level=level)
    for name, found in answer.values.items():
        if not np.isfinite(found).all():
            place = int(np.argmin(np.isfinite(found)))
            raise InputError(
                f"{subject.name}: the surrogate has no finite {name} at Delta ="
                f" {deltas[place]:.4g} um: no law can be made of it"
            )
    parts: list[dict[str, Values]] = []
    for ends in (answer.values, answer.low, answer.high):
        gap = ends.get("mean_gap")
        if gap is None:  # which rises with the force
            gap = _mean_gap(pressed, deltas, ends["force"] / e_star)
        parts.append(
            {
                "area_percent": ends["area"],
                "force_uN": ends["force"],
                "mean_gap_um": gap,
                "pressure_MPa": ends["force"] / subject.nominal,
            }
        )
    values, low, high = parts
    return Points({"delta_um": deltas, **values}, low, high, answer.reasons)


def solved(
    subject: Subject, load: str, loads: Sequence[float], e_star: float, *, material: bool
) -> Points:
    """One surface's law from the solver, at the loads themselves; without intervals.

    Parameters
    ----------
    subject : the surface
    load : "delta" [um] or "pressure" [MPa]
    loads : ascending, 0 or more
    e_star : E* [MPa]
    material : whether that is a material's, so that pressures mean something

    Raises
    ------
    InputError
        If a load has no solution, or the solver does not arrive at one.
    """
    topography = Topography(subject.name, subject.heights, subject.sides)
    settings = {"modulus": e_star, **subject.settings}
    rows = []
    notable: dict[int, Contact] = {}  # the first with each number of warnings, which only rises
    for contact, _ in solve_loads(topography, load, loads, **settings):
        pressure = contact.force / subject.nominal
        area, gap = contact.area_percent, max(contact.mean_gap, 0.0)  # below 0 by rounding alone
        rows.append((contact.delta, area, contact.force, gap, pressure))
        notes = contact_warnings(topography, [contact], material=material)
        notable.setdefault(len(notes), contact)
    said = contact_warnings(topography, [*notable.values(), contact], material=material)
    names = "delta_um", "area_percent", "force_uN", "mean_gap_um", "pressure_MPa"
    columns = np.array(rows, dtype=np.float64).reshape(-1, len(names)).T
    values = dict(zip(names, columns, strict=True))
    return Points(values, reasons=("",) * len(rows), warnings=tuple(said))


def _mean_gap(pressed: OnSurface, deltas: Values, force: Values) -> Values:
    """(k,) mean gap from forces over E* [um]."""
    surface = pressed.surface
    heights = surface.heights
    rest = float(heights.max()) - float(heights.mean())
    compliance = np.array([surface.compliance(float(delta)) for delta in deltas])
    return np.maximum(rest - deltas + compliance * force / surface.length, 0.0)
