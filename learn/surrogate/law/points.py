"""Points of one surface's contact law: predicted, or solved at the given loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gen.measured.single import contact_warnings, solve_loads
from gen.measured.topography import Topography
from gen.runtime.errors import InputError
from learn.arrays import Values
from learn.surrogate.bodies import Bodies
from learn.surrogate.law.subjects import Subject
from learn.surrogate.model import OnSurface

if TYPE_CHECKING:
    from bem import Contact


@dataclass(frozen=True, eq=False)
class Points:
    """Contacts of one surface under k loads, ascending.

    Attributes
    ----------
    values : dict of str to ndarray, shape (k,)
        Values by name: delta_um, area_percent, force_uN, mean_gap_um, pressure_MPa.
    low, high : dict of str to ndarray, shape (k,)
        Ends of the intervals by name; quantities without intervals are left out.
    reasons : tuple of str
        For each load, why it lies outside the training; "" if it does not.
    endless : tuple of str
        For each load inside the training, why it has no interval; "" if it has one. May be empty.
    warnings : tuple of str
        Warnings about the solved contacts of this surface.
    """

    values: dict[str, Values]
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    endless: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def chosen(self, places: NDArray[np.bool_] | NDArray[np.int64]) -> Points:
        """Return the points of some of the loads."""

        def some(part: dict[str, Values]) -> dict[str, Values]:
            return {name: each[places] for name, each in part.items()}

        reasons = tuple(np.array(self.reasons, dtype=object)[places])
        return Points(some(self.values), some(self.low), some(self.high), reasons)

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

    def from_rest(self, subject: Subject) -> Points:
        """Put first touch at Delta = 0, where no value is uncertain, before these loads."""
        rest = {name: np.zeros(1) for name in self.values}
        rest["mean_gap_um"] = np.array([subject.gap_at_rest])
        ends = {name: rest[name] for name in self.low}
        return Points(rest, ends, ends, ("",)).joined(self)


def predicted(
    on_surface: OnSurface, subject: Subject, deltas: Values, level: float, bodies: Bodies
) -> Points:
    """Predict the law of one surface.

    Parameters
    ----------
    on_surface : OnSurface
        The surrogate on the surface.
    subject : Subject
        The surface.
    deltas : ndarray, shape (k,)
        Ascending displacements above 0 [um].
    level : float
        Coverage of the intervals.
    bodies : Bodies
        E* and hardness.

    Raises
    ------
    InputError
        If a prediction is not finite.
    """
    e_star, hardness = bodies.e_star, bodies.hardness
    answer = on_surface.predict(deltas, e_star=e_star, hardness=hardness, level=level)
    for name, predictions in answer.values.items():
        if not np.isfinite(predictions).all():
            place = int(np.argmin(np.isfinite(predictions)))
            raise InputError(
                f"{subject.name}: the surrogate has no finite {name} at Delta ="
                f" {deltas[place]:.4g} um: no law can be made of it"
            )
    parts: list[dict[str, Values]] = []
    for ends in (answer.values, answer.low, answer.high):
        gap = ends.get("mean_gap")
        if gap is None:  # which rises with the force
            gap = _mean_gap(on_surface, deltas, ends["force"] / e_star, bodies)
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


def solved(subject: Subject, load: str, loads: Sequence[float], bodies: Bodies) -> Points:
    """Solve the law of one surface at the given loads; there are no intervals.

    Parameters
    ----------
    subject : Subject
        The surface.
    load : str
        Kind of load: "delta" [um] or "pressure" [MPa].
    loads : sequence of float
        Ascending loads, 0 or more.
    bodies : Bodies
        E* and hardness.

    Raises
    ------
    InputError
        If a load has no solution, or the solver does not converge.
    """
    topography = Topography(subject.name, subject.heights, subject.sides, boundary=subject.boundary)
    settings = {"modulus": bodies.e_star, **subject.settings}
    if bodies.hardness is not None:
        settings["hardness"] = bodies.hardness
    rows = []
    notable: dict[int, Contact] = {}  # the first with each number of warnings, which only rises
    for contact, _ in solve_loads(topography, load, loads, **settings):
        pressure = contact.force / subject.nominal
        area, gap = contact.area_percent, max(contact.mean_gap, 0.0)  # below 0 by rounding alone
        rows.append((contact.delta, area, contact.force, gap, pressure))
        notes = contact_warnings(topography, [contact], material=bodies.known)
        notable.setdefault(len(notes), contact)
    said = contact_warnings(topography, [*notable.values(), contact], material=bodies.known)
    names = "delta_um", "area_percent", "force_uN", "mean_gap_um", "pressure_MPa"
    columns = np.array(rows, dtype=np.float64).reshape(-1, len(names)).T
    values = dict(zip(names, columns, strict=True))
    return Points(values, reasons=("",) * len(rows), warnings=tuple(said))


def _mean_gap(on_surface: OnSurface, deltas: Values, force: Values, bodies: Bodies) -> Values:
    """Return the mean gap from forces over E*, (k,) [um]."""
    surface = on_surface.surface
    heights = surface.heights
    rest = float(heights.max()) - float(heights.mean())
    coarse = [surface.coarse_means(float(delta), bodies.hardness_ratio) for delta in deltas]
    compliance, yielded = np.array(coarse).reshape(-1, 2).T
    free = surface.boundary == "free"
    mean = compliance * force / surface.length if free else 0.0  # displacement
    return np.asarray(np.maximum(rest - deltas + mean + yielded, 0.0))
