"""Points of one surface's contact law, and those that the solver finds at the given loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.law.subjects import LawSurface
from gen.maps.contacts import contact_warnings, solve_loads
from gen.maps.read import Topography
from gen.material import Bodies
from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from bem import Contact

NAMES = ("delta_um", "area_percent", "force_uN", "mean_gap_um", "pressure_MPa", "closure_um")
"""Quantities of every point. The closure is what the interface alone gives way from first touch on:
Delta, less what the half-space behind a free patch gives way, which a mesh has already."""

STIFFNESS = "stiffness_MPa_per_um"
"""Stiffness of the interface alone, of unloading, per nominal area."""


@dataclass(frozen=True, eq=False)
class Points:
    """Contacts of one surface under k loads, ascending.

    Attributes
    ----------
    values : dict of str to ndarray, shape (k,)
        Values by name: delta_um, area_percent, force_uN, mean_gap_um, pressure_MPa, closure_um,
        and stiffness_MPa_per_um where it is known.
    low, high : dict of str to ndarray, shape (k,)
        Ends of the intervals by name; quantities without intervals are left out.
    reasons : tuple of str
        For each load, why it lies outside the training; "" if it does not.
    endless : tuple of str
        For each load inside the training, why it has no interval; "" if it has one. May be empty.
    warnings : tuple of str
        Warnings about the solved contacts of this surface.
    faults : tuple of str
        For each load, why the solver has no values there, which are NaN; "" if it has. May be
        empty.
    """

    values: dict[str, Values]
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    endless: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()

    def chosen(self, places: NDArray[np.bool_] | NDArray[np.int64]) -> Points:
        """Return the points of some of the loads."""

        def some(part: dict[str, Values]) -> dict[str, Values]:
            return {name: each[places] for name, each in part.items()}

        reasons = tuple(np.array(self.reasons, dtype=object)[places])
        values, low, high = some(self.values), some(self.low), some(self.high)
        return replace(self, values=values, low=low, high=high, reasons=reasons, faults=())

    def joined(self, more: Points) -> Points:
        """Append the points of further loads."""

        def both(one: dict[str, Values], other: dict[str, Values]) -> dict[str, Values]:
            return {name: np.concatenate([each, other[name]]) for name, each in one.items()}

        return Points(
            both(self.values, more.values),
            both(self.low, more.low),
            both(self.high, more.high),
            self.reasons + more.reasons,
        )

    def from_rest(self, subject: LawSurface) -> Points:
        """Put first touch at Delta = 0, where no value is uncertain, before these loads."""
        rest = {name: np.zeros(1) for name in self.values}
        rest["mean_gap_um"] = np.array([subject.gap_at_rest])
        ends = {name: rest[name] for name in self.low}
        return Points(rest, ends, ends, ("",)).joined(self)


def solved(
    subject: LawSurface,
    load: str,
    loads: Sequence[float],
    bodies: Bodies,
    *,
    stiffness: bool = False,
) -> Points:
    """Solve the law of one surface at the given loads; there are no intervals.

    Parameters
    ----------
    subject : LawSurface
        The surface.
    load : str
        Kind of load: "delta" [um] or "pressure" [MPa].
    loads : sequence of float
        Ascending loads, 0 or more.
    bodies : Bodies
        E* and hardness.
    stiffness : bool
        Whether to solve for the stiffness of the interface too.

    Returns
    -------
    Points
        Points at all loads, NaN where the solver did not converge.

    Raises
    ------
    InputError
        If a load has no solution, or the solver converges under none of them.
    """
    topography = Topography(subject.name, subject.heights, subject.sides, boundary=subject.boundary)
    settings = {"modulus": bodies.e_star, **subject.settings}
    if bodies.hardness is not None:
        settings["hardness"] = bodies.hardness
    compliance = subject.patch_compliance(bodies.e_star)
    rows, faults, last = [], [], None
    notable: dict[int, Contact] = {}  # the first with each number of warnings, which only rises
    names = [*NAMES, *([STIFFNESS] if stiffness else [])]
    for contact, _, fault in solve_loads(topography, load, loads, **settings):
        faults.append(fault)
        if contact is None:
            rows.append([np.nan] * len(names))
            continue
        last = contact
        pressure = contact.force / subject.nominal
        area, gap = contact.area_percent, max(contact.mean_gap, 0.0)  # below 0 by rounding alone
        closure = contact.delta - compliance * pressure
        row = [contact.delta, area, contact.force, gap, pressure, max(closure, 0.0)]
        rows.append([*row, _stiffness(contact, subject)] if stiffness else row)
        notes = contact_warnings(topography, [contact], material=bodies.known)
        notable.setdefault(len(notes), contact)
    assert last is not None
    said = contact_warnings(topography, [*notable.values(), last], material=bodies.known)
    columns = np.array(rows, dtype=np.float64).reshape(-1, len(names)).T
    values = dict(zip(names, columns, strict=True))
    return Points(values, reasons=("",) * len(rows), warnings=tuple(said), faults=tuple(faults))


def _stiffness(contact: Contact, subject: LawSurface) -> float:
    """Return the interface's stiffness per nominal area [MPa / um]."""
    try:
        return contact.interface_stiffness / subject.nominal
    except ArithmeticError as error:
        raise InputError(f"{subject.name}: {error}") from None
