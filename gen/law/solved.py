"""Laws from the solver: every value is that of a contact solved under the given load."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gen.arrays import Values
from gen.law.curves import APART, NAMES, STIFFNESS, Curves, Points, held, risen, tabulated
from gen.law.surfaces import LawSurface, Load
from gen.maps.contacts import contact_warnings, solve_loads
from gen.maps.read import Topography
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress

if TYPE_CHECKING:
    from bem import Contact

ARGUMENTS: dict[Load, str] = {"delta": "delta_um", "pressure": "pressure_MPa"}


def tables(
    surfaces: Sequence[LawSurface],
    deltas: Values | None,
    pressures: Values | None,
    level: float,
    bodies: Bodies,
    *,
    stiffness: bool = False,
) -> tuple[Curves, Curves, list[str]]:
    """Solve all surfaces under the given loads; tabulate against Delta and against pressure.

    If one kind of load is given, the other table of one surface has the same contacts. For a
    population further contacts are solved for it: a given Delta leads to a pressure on each
    surface, and the second table is at the means of these pressures; likewise the other way round.
    Loads are ascending displacements [um] and pressures [MPa], one of which may be None; `level` is
    the coverage of a population's band.

    Loads under which the solver did not converge on every surface are left out of the tables and
    named among the lines that are returned with them. Raise InputError if a load has no solution,
    or the solver converges under none.
    """
    asked: dict[Load, Values | None] = {"delta": deltas, "pressure": pressures}
    lost: list[str] = []

    def under(load: Load, loads: Values) -> tuple[Values, list[Points]]:
        if load == "delta":
            loads = _possible_deltas(loads, surfaces, bodies, lost)
        return _each(surfaces, load, loads, bodies, lost, stiffness=stiffness)

    solutions = {load: under(load, loads) for load, loads in asked.items() if loads is not None}
    made: dict[Load, Curves] = {}
    rest = float(np.mean([surface.gap_at_rest for surface in surfaces]))
    both: tuple[tuple[Load, Load], ...] = ("delta", "pressure"), ("pressure", "delta")
    for load, other in both:
        argument = ARGUMENTS[load]
        loads, parts = solutions.get(load) or solutions[other]
        if load not in solutions and len(surfaces) > 1:
            means = _means(parts, argument)
            loads, parts = under(load, means if load == "delta" else _below(means, bodies))
        elif load not in solutions:
            parts = [_ascending(part, argument) for part in parts]
            loads = parts[0].values[argument]
        if load == "delta" or load not in solutions:  # pressures that were given stay alone
            parts = [
                part.from_rest(each.gap_at_rest) for part, each in zip(parts, surfaces, strict=True)
            ]
            loads = np.append(0.0, loads)
        made[load] = tabulated(argument, loads, [held(part) for part in parts], level, rest)
    warnings = _warnings(parts for _, parts in solutions.values())
    return made["delta"], made["pressure"], [*warnings, *dict.fromkeys(lost)]


def _warnings(solutions: Iterable[Sequence[Points]]) -> list[str]:
    """Return the warnings: all of one surface, or the number of surfaces and those of the first."""
    lines: dict[str, None] = {}
    for parts in solutions:
        warned = [part for part in parts if part.warnings]
        many = f"{len(warned)} of {len(parts)} surfaces, the first: " if len(parts) > 1 else ""
        for part in warned[:1]:
            lines |= dict.fromkeys(f"warning: {many}{line}" for line in part.warnings)
    return list(lines)


def _each(
    surfaces: Sequence[LawSurface],
    load: Load,
    loads: Values,
    bodies: Bodies,
    lost: list[str],
    *,
    stiffness: bool,
) -> tuple[Values, list[Points]]:
    """Solve every surface under the same loads; return those solved on all, and say the others."""
    points = []
    with RunProgress(len(surfaces), f"surfaces at given {load}") as progress:
        for surface in surfaces:
            points.append(solve(surface, load, loads.tolist(), bodies, stiffness=stiffness))
            progress.advance(1, 0)
    kept, before = np.ones(loads.size, dtype=bool), len(lost)
    for place, faults in enumerate(zip(*(part.faults for part in points), strict=True)):
        failed = [f"{each.name}: {why}" for each, why in zip(surfaces, faults, strict=True) if why]
        if failed:
            kept[place] = False
            many = f" on {len(failed)} of {len(points)} surfaces" if len(points) > 1 else ""
            lost.append(f"warning: not solved{many}, left out: {failed[0]}")
    if not kept.any():
        raise InputError(f"no load was solved on every surface; {lost[before]}")
    return loads[kept], [part.chosen(kept) for part in points]


def _means(parts: Sequence[Points], argument: str) -> Values:
    """Return the rising means over the surfaces of one quantity, where they are above 0."""
    means = np.sort(np.mean([part.values[argument] for part in parts], axis=0))
    return means[risen(means)]


def _possible_deltas(
    deltas: Values, surfaces: Sequence[LawSurface], bodies: Bodies, lost: list[str]
) -> Values:
    """Return the displacements [um] below full contact of elastic bodies without edges.

    They are in full contact at a displacement of the mean gap at rest.
    """
    full = [each.gap_at_rest for each in surfaces if each.boundary != "free"]
    if not full or bodies.hardness is not None:
        return deltas
    possible = deltas[deltas < (1 - APART) * min(full)]
    beyond = f"full contact from {min(full):.4g} um on"
    if not possible.size:
        raise InputError(f"{beyond}: give smaller loads")
    if possible.size < deltas.size:
        lost.append(f"{beyond}: the table against delta_um ends below it")
    return possible


def _below(pressures: Values, bodies: Bodies) -> Values:
    """Return the pressures below the hardness, at which every node would yield [MPa]."""
    if bodies.hardness is None:
        return pressures
    possible = pressures[pressures < (1 - APART) * bodies.hardness]
    if not possible.size:
        raise InputError(
            f"every node yields: the pressure is the hardness, {bodies.hardness:.4g} MPa, at all"
            " displacements: give smaller ones"
        )
    return possible


def _ascending(part: Points, argument: str) -> Points:
    """Return the contacts under load whose argument rises."""
    order = np.argsort(part.values[argument], kind="stable")
    return part.chosen(order[risen(part.values[argument][order])])


def solve(
    subject: LawSurface,
    load: str,
    loads: Sequence[float],
    bodies: Bodies,
    *,
    stiffness: bool = False,
) -> Points:
    """Solve the law of one surface at ascending loads of 0 or more: "delta" [um] or "pressure"
    [MPa].

    Points are NaN where the solver did not converge. Raise InputError if a load has no solution, or
    the solver converges under none of them.
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
        if stiffness:
            try:
                row.append(contact.interface_stiffness / subject.nominal)
            except ArithmeticError as error:
                raise InputError(f"{subject.name}: {error}") from None
        rows.append(row)
        notes = contact_warnings(topography, [contact], material=bodies.known)
        notable.setdefault(len(notes), contact)
    assert last is not None
    said = contact_warnings(topography, [*notable.values(), last], material=bodies.known)
    columns = np.array(rows, dtype=np.float64).reshape(-1, len(names)).T
    values = dict(zip(names, columns, strict=True))
    return Points(values, reasons=("",) * len(rows), warnings=tuple(said), faults=tuple(faults))
