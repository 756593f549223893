"""Contact laws: closure, area, mean gap and conductance against Delta and nominal pressure.

A law is that of one surface, or the mean and quantiles over the surfaces of a population, at given
Delta and at given pressure. The patch is a piece of a larger interface, so that it is continued by
its mirror images unless it is told otherwise: what a free patch gives way as a whole belongs to the
mesh of a finite-element model, not to its interface.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bem.problem import Boundary
from gen.arrays import Values
from gen.law.curves import (
    APART,
    CONTINUUM,
    NAMES,
    STIFFNESS,
    Curves,
    Points,
    held,
    risen,
    tabulated,
    with_conductance,
)
from gen.law.surfaces import LawSurface, LawSurfaces, Load, read_subjects
from gen.maps.bodies import Opposite
from gen.maps.contacts import contact_warnings, solve_loads
from gen.maps.read import Topography
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.numbers import MAGNITUDES, magnitude, shown, values_from
from gen.runtime.terminal import RunProgress, shortened

if TYPE_CHECKING:
    from bem import Contact

ARGUMENTS: dict[Load, str] = {"delta": "delta_um", "pressure": "pressure_MPa"}
"""Quantity of the arguments of a table by the kind of load."""

FEW = 10  # nodes in contact below which a law shows the grid rather than the surface

STEPS = 40
"""Number of displacements over the range of a scene or a training, where no load is given."""

Tables = tuple[Curves, Curves, list[str]]
"""Tables against Delta and against pressure, and remarks about them."""


@dataclass(frozen=True)
class Order:
    """A request for a law."""

    inputs: tuple[str, ...]  # surfaces, folders of them, databases or scenes
    # Loads as text; an empty one stands for those at the other, both for the usual range.
    delta: str = ""
    pressure: str = ""
    surfaces: int = 50  # number of a database's or scene's population
    level: float = 0.9  # coverage of the band
    e_star: float | None = None  # [MPa]; by default that of the scene, else 1
    hardness: float | None = None  # of the softer body [MPa]; by default the scene's only one
    boundary: Boundary | None = None  # of the patches; None for the usual one
    conductivities: tuple[float, float] | None = None  # of both bodies [W/(m K)]
    stiffness: bool = False  # whether it is asked for; a conductance brings it along
    grid_error: bool = False  # whether the area in the continuum is, with the error of the grid
    reading: Reading = field(default_factory=Reading)  # how files are read
    opposite: Opposite | None = None  # second rough body against surfaces from files
    command: str = ""  # command line, for the record

    def loads(self) -> tuple[Values | None, Values | None]:
        """Return ascending displacements [um] and pressures [MPa], each None if not given."""
        deltas = np.unique(deltas_from(self.delta)) if self.delta else None
        pressures = np.unique(pressures_from(self.pressure)) if self.pressure else None
        return deltas, pressures


@dataclass(frozen=True, eq=False)
class Law:
    """Tables of a contact law."""

    order: Order
    over_delta: Curves  # begins at Delta = 0
    over_pressure: Curves  # Delta is among its curves
    bodies: Bodies
    boundary: Boundary
    band: str  # its description
    origins: tuple[str, ...]  # surfaces of the law, one line for each input
    notes: tuple[str, ...]  # remarks about the making of the law, one line each

    @property
    def title(self) -> str:
        """Names of the surfaces, with those of the second bodies, on one line."""
        return shortened("; ".join(self.origins))


def by_solver(order: Order, say: Callable[[str], None]) -> Law:
    """Make a law with the solver; `say` is called with a line for the user about each file.

    Raise InputError for input that cannot be used, or a load without a solution.
    """
    deltas, pressures = order.loads()
    subjects = read_subjects(
        order.inputs,
        order.surfaces,
        order.reading,
        order.boundary or "mirror",
        say,
        only_boundary=False,
        opposite=order.opposite,
    )
    e_star = order.e_star or subjects.modulus() or 1.0
    hardness, ratio = order.hardness, None
    if hardness is None and (ratio := subjects.hardness_ratio()) is not None:
        hardness = ratio * e_star
    bodies = Bodies(e_star, hardness, known=order.e_star is not None)
    if deltas is None and pressures is None:
        deltas, pressures = usual_loads(subjects, e_star)
    return solved_law(order, subjects, bodies, (deltas, pressures))


def solved_law(
    order: Order, subjects: LawSurfaces, bodies: Bodies, loads: tuple[Values | None, Values | None]
) -> Law:
    """Solve the contacts of a law at ascending displacements [um] and pressures [MPa].

    One of both may be None.
    """
    stiffness = order.stiffness or order.conductivities is not None
    tables = _tables(
        subjects.surfaces,
        *loads,
        order.level,
        bodies,
        stiffness=stiffness,
        grid_error=order.grid_error,
    )
    one = "none, one surface was solved"
    if order.grid_error:
        one = "the error of the grid, 9 times in 10, of the area in the continuum; one surface"
    return law_of(order, subjects, bodies, tables, ("solved contact by contact", one))


def law_of(
    order: Order, subjects: LawSurfaces, bodies: Bodies, tables: Tables, said: tuple[str, str]
) -> Law:
    """Make a law of tables and the remarks on them.

    `said` is how the law was made, and what its band is if it has one surface.
    """
    over_delta, over_pressure, remarks = tables
    over_pressure, full = over_pressure.below_full_contact(bodies)
    over_delta, also_full = over_delta.below_full_contact(bodies)
    if order.conductivities is not None:
        from bem.contact import mean_conductivity

        factor = mean_conductivity(*order.conductivities) / bodies.e_star
        over_delta = with_conductance(over_delta, factor)
        over_pressure = with_conductance(over_pressure, factor)
    how, band = said
    boundary = subjects.surfaces[0].boundary
    if boundary != "free":
        how += f", patches without edges: {boundary} boundary"
    if len(subjects.surfaces) > 1:
        share = f"{100 * order.level:g} %"
        band = f"quantiles of {len(subjects.surfaces)} surfaces, {share} between them"
    doubts = [each for each in subjects.origins if ": " in each]  # those of scenes
    doubts += [*subjects.doubts, *(f"warning: {each}" for each in bodies.doubts)]
    nodes = min(each.heights.size for each in subjects.surfaces)
    return Law(
        order=order,
        over_delta=over_delta,
        over_pressure=over_pressure,
        bodies=bodies,
        boundary=boundary,
        band=band,
        origins=tuple(subjects.origins),
        notes=(how, *doubts, *remarks, *full, *also_full, *_few_nodes(over_pressure, nodes)),
    )


def _few_nodes(over_pressure: Curves, nodes: int) -> list[str]:
    """Say up to which pressure so few nodes touch that the law is that of the grid."""
    touching = over_pressure.curves["area_percent"].value * nodes / 100
    few = over_pressure.at[(touching > 0) & (touching < FEW)]
    if not few.size:
        return []
    return [f"up to {few[-1]:.4g} MPa fewer than {FEW} nodes touch: there the law is the grid's"]


def usual_loads(subjects: LawSurfaces, e_star: float) -> tuple[Values | None, Values | None]:
    """Return displacements [um] and pressures [MPa] over the scenes' range, one of which is None.

    Raise InputError if a surface comes from a file, the scenes give different loads, or press
    nothing.
    """
    usual = subjects.loads(STEPS, e_star)
    if usual is None:
        raise InputError("give --delta or --pressure: a surface from a file has no range of loads")
    kind, loads = usual
    loads = np.unique(loads[loads > 0])
    if not loads.size:
        raise InputError("give --delta or --pressure: the scene presses nothing")
    return (loads, None) if kind == "delta" else (None, loads)


def deltas_from(text: str) -> Values:
    """Parse displacements, as "2", "1,2,5" or "5:45:9" [um]; raise InputError for others."""
    advice = "give numbers above 0 um, as 2, 1,2,5 or 5:45:9"
    values = _finite(text, "--delta", advice)
    if not all(map(magnitude, values)):
        low, high = MAGNITUDES
        raise InputError(f"--delta {shown(text)}: give numbers from {low:g} to {high:g} um")
    return values


def pressures_from(text: str) -> Values:
    """Parse nominal pressures of 0 or more, not all 0, as "1:100:20" [MPa]."""
    advice = f"give pressures from 0 to {MAGNITUDES[1]:g} MPa, not all 0, as 0:100:20"
    values = _finite(text, "--pressure", advice)
    if not values.any() or not all(value == 0 or magnitude(value) for value in values):
        raise InputError(f"--pressure {shown(text)}: {advice}")
    return values


def _finite(text: str, option: str, advice: str) -> Values:
    """Parse finite numbers; raise InputError with the advice for others."""
    values = np.array(values_from(text, option, advice))
    if not np.isfinite(values).all():
        raise InputError(f"{option} {shown(text)}: {advice}")
    return values


def _tables(
    surfaces: Sequence[LawSurface],
    deltas: Values | None,
    pressures: Values | None,
    level: float,
    bodies: Bodies,
    *,
    stiffness: bool = False,
    grid_error: bool = False,
) -> tuple[Curves, Curves, list[str]]:
    """Solve all surfaces under the given loads; tabulate against Delta and against pressure.

    If one kind of load is given, the other table of one surface has the same contacts. For a
    population further contacts are solved for it: a given Delta leads to a pressure on each
    surface, and the second table is at the means of these pressures; likewise the other way round.
    Loads are ascending displacements [um] and pressures [MPa], one of which may be None; `level` is
    the coverage of a population's band. With the error of the grid the tables have the area in the
    continuum, and of one surface its error; of a population the first surface is judged.

    Loads under which the solver did not converge on every surface are left out of the tables and
    named among the lines that are returned with them. Raise InputError if a load has no solution,
    or the solver converges under none.
    """
    asked: dict[Load, Values | None] = {"delta": deltas, "pressure": pressures}
    lost: list[str] = []

    def under(load: Load, loads: Values) -> tuple[Values, list[Points]]:
        if load == "delta":
            loads = _possible_deltas(loads, surfaces, bodies, lost)
        return _each(
            surfaces, load, loads, bodies, lost, stiffness=stiffness, grid_error=grid_error
        )

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
        lines |= dict.fromkeys(note for part in parts for note in part.notes)
    return list(lines)


def _each(
    surfaces: Sequence[LawSurface],
    load: Load,
    loads: Values,
    bodies: Bodies,
    lost: list[str],
    *,
    stiffness: bool,
    grid_error: bool,
) -> tuple[Values, list[Points]]:
    """Solve every surface under the same loads; return those solved on all, and say the others."""
    points = []
    with RunProgress(len(surfaces), f"surfaces at given {load}") as progress:
        for number, surface in enumerate(surfaces):
            points.append(
                _solve(
                    surface,
                    load,
                    loads.tolist(),
                    bodies,
                    stiffness=stiffness,
                    continuum=grid_error,
                    judged=grid_error and number == 0,
                )
            )
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


def _solve(
    subject: LawSurface,
    load: str,
    loads: Sequence[float],
    bodies: Bodies,
    *,
    stiffness: bool = False,
    continuum: bool = False,
    judged: bool = False,
) -> Points:
    """Solve the law of one surface at ascending loads: "delta" [um] or "pressure" [MPa].

    Points are NaN where the solver did not converge. With `continuum` they have the area there, and
    where it is `judged` its interval by the error of the grid. Raise InputError if a load has no
    solution, or the solver converges under none of them.
    """
    topography = Topography(subject.name, subject.heights, subject.sides, boundary=subject.boundary)
    settings = {"modulus": bodies.e_star, **subject.settings}
    if bodies.hardness is not None:
        settings["hardness"] = bodies.hardness
    compliance = subject.patch_compliance(bodies.e_star)
    rows, faults, last = [], [], None
    notable: dict[int, Contact] = {}  # the first with each number of warnings, which only rises
    names = [*NAMES, *([STIFFNESS] if stiffness else []), *([CONTINUUM] if continuum else [])]
    bars, unresolved = [], ""
    for contact, _, fault in solve_loads(topography, load, loads, **settings):
        faults.append(fault)
        if contact is None:
            rows.append([np.nan] * len(names))
            bars.append(np.nan)
            continue
        last = contact
        row = _numbers(contact, subject, compliance, stiffness=stiffness)
        rows.append([*row, contact.continuum_area_percent] if continuum else row)
        if judged:
            grid = contact.grid_error()
            bars.append(grid.area_percent if grid.resolved else np.nan)
            unresolved = unresolved or ("" if grid.resolved else grid.reason)
        notes = contact_warnings(topography, [contact], material=bodies.known)
        notable.setdefault(len(notes), contact)
    assert last is not None
    said = contact_warnings(topography, [*notable.values(), last], material=bodies.known)
    columns = np.array(rows, dtype=np.float64).reshape(-1, len(names)).T
    values = dict(zip(names, columns, strict=True))
    low: dict[str, Values] = {}
    high: dict[str, Values] = {}
    if judged:
        low[CONTINUUM] = np.clip(values[CONTINUUM] - np.array(bars), 0, 100)
        high[CONTINUUM] = np.clip(values[CONTINUUM] + np.array(bars), 0, 100)
    said_of = (f"{subject.name}: the area is that of the grid: {unresolved}",) if unresolved else ()
    none, warnings = ("",) * len(rows), tuple(said)
    return Points(values, low, high, none, warnings=warnings, faults=tuple(faults), notes=said_of)


def _numbers(
    contact: "Contact", subject: LawSurface, compliance: float, *, stiffness: bool
) -> list[float]:
    """Return the numbers of one contact in the order of `NAMES`, and its stiffness if asked for."""
    pressure = contact.force / subject.nominal
    area, gap = contact.area_percent, max(contact.mean_gap, 0.0)  # below 0 by rounding alone
    closure = contact.delta - compliance * pressure
    numbers = [contact.delta, area, contact.force, gap, pressure, max(closure, 0.0)]
    if stiffness:
        try:
            numbers.append(contact.interface_stiffness / subject.nominal)
        except ArithmeticError as error:
            raise InputError(f"{subject.name}: {error}") from None
    return numbers
