"""Contact laws: closure, area, mean gap and conductance against Delta and nominal pressure.

A law is that of one surface, or the mean over the surfaces of a population with the band of a
further one, at given Delta and at given pressure. The patch is a piece of a larger interface, so
that it is continued by its mirror images unless it is told otherwise: what a free patch gives way
as a whole belongs to the mesh of a finite-element model, not to its interface.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace

import numpy as np

from bem.contact import mean_conductivity
from bem.problem import Boundary
from gen.arrays import Values
from gen.doubts import Pressed, contact_doubts, material_doubts
from gen.law.bands import assumption, described
from gen.law.between import (
    LINE_ROUNDS,
    ROUNDS,
    check_loads,
    merged,
    solve_beside_lines,
    solve_between,
)
from gen.law.curves import (
    APART,
    Curves,
    Points,
    held,
    risen,
    tabulated,
)
from gen.law.surfaces import LawSurface, LawSurfaces, Load, Origin, read_subjects
from gen.maps.bodies import Opposite
from gen.maps.contacts import solve_loads
from gen.maps.settings import Reading
from gen.material import Bodies, Gas, loads_from
from gen.quantities import (
    ALSO,
    ALWAYS_IN_LAWS,
    APERTURES,
    AREA,
    CONTINUUM,
    DELTA,
    GAS,
    JOINT,
    LOADS,
    MEAN_GAP,
    PRESSURE,
    STIFFNESS,
    Media,
    Quantity,
)
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress, shortened, shown

ARGUMENTS: dict[Load, str] = {"delta": DELTA.in_laws, "pressure": PRESSURE.in_laws}
"""Quantity of the arguments of a table by the kind of load."""

FEW = 10  # nodes in contact below which a law shows the grid rather than the surface
LONG = 10**6  # nodes of all contacts together from which on a law shows progress

PASSES: Mapping[Load, str] = {"delta": "over Delta", "pressure": "over pressure"}
"""Which contacts the progress counts: a population has one pass for each table."""

BETWEEN: Mapping[Load, str] = {
    "delta": "between the Deltas",
    "pressure": "between the pressures",
}
"""The same where contacts are solved between the loads of a table."""

USUAL_LEVEL = 0.9
"""Coverage of a band where nobody asks for another one."""

STEPS = 40
"""Number of displacements over the range of a training, where no load is given."""

Tables = tuple[Curves, Curves, list[str]]
"""Tables against Delta and against pressure, and remarks about them."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Contacts of all surfaces of a law under the same loads."""

    loads: Values  # ascending loads that were solved on every surface [um or MPa], (k,)
    points: list[Points]  # of each surface, k contacts each
    warnings: list[str] = field(default_factory=list)  # reasons to distrust the contacts
    remarks: list[str] = field(default_factory=list)  # loads that were left out

    @property
    def full(self) -> bool:
        """True if a surface is in full contact under the first load, or no load was solved."""
        return not self.loads.size or any(
            bool(part.values[AREA.in_laws][0] >= 100) for part in self.points
        )


@dataclass(frozen=True)
class Order:
    """A request for a law."""

    inputs: tuple[str, ...]  # surfaces, folders of them, databases or scenes
    # Loads as text; an empty one stands for those at the other, both for a surrogate's range.
    delta: str = ""
    pressure: str = ""
    surfaces: int = 50  # number of a database's or scene's population
    level: float | None = None  # coverage of the band; None for the usual one
    e_star: float | None = None  # [MPa]; by default that of the scene, else 1
    hardness: float | None = (
        None  # of the softer body [MPa]; by default the scene's only one
    )
    boundary: Boundary | None = None  # of the patches; None for the usual one
    conductivities: tuple[float, float] | None = None  # of both bodies [W/(m K)]
    gas: Gas | None = None  # in the gap
    stiffness: bool = False  # whether it is asked for; a conductance brings it along
    grid_error: bool = (
        False  # whether the area in the continuum is, with the error of the grid
    )
    flow: bool = False  # whether the hydraulic apertures of the gap are
    also: tuple[
        str, ...
    ] = ()  # further quantities by their names, of `gen.quantities.ALSO`
    reading: Reading = field(default_factory=Reading)  # how files are read
    opposite: Opposite | None = None  # second rough body against surfaces from files
    # Tables between whose loads further contacts are solved, for files whose programs join them.
    between: tuple[Load, ...] = ()
    # Whether straight lines between the pressures are judged by contacts of their own.
    straight: bool = False
    command: str = ""  # command line, for the record

    @property
    def coverage(self) -> float:
        """Coverage of the band."""
        return USUAL_LEVEL if self.level is None else self.level

    def loads(self) -> tuple[Values | None, Values | None]:
        """Return ascending displacements [um] and pressures [MPa], each None if not given."""
        deltas = np.unique(loads_from("delta", self.delta)) if self.delta else None
        pressures = (
            np.unique(loads_from("pressure", self.pressure)) if self.pressure else None
        )
        return deltas, pressures

    @property
    def media(self) -> Media:
        """What conducts through the interface."""
        return Media(self.conductivities, self.gas)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities that are read off each contact; the conductance follows from the stiffness."""
        chosen = [*ALWAYS_IN_LAWS]
        if self.grid_error:
            chosen.append(CONTINUUM)
        if self.stiffness or self.conductivities:
            chosen.append(STIFFNESS)
        if self.gas:
            chosen.append(GAS)
        if self.gas and self.conductivities:
            chosen.append(JOINT)
        if self.flow:
            chosen += APERTURES
        return (*chosen, *(ALSO[name] for name in self.also))

    def refuse_impossible(self, hardness: float | None) -> None:
        """Refuse further quantities that no contact of bodies of a hardness [MPa] has."""
        for name in self.also:
            if ALSO[name].needs_hardness and hardness is None:
                raise InputError(
                    f"--also {name}: elastic bodies have none: give --hardness"
                )


def require_also(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of further quantities of a law, each once.

    Parameters
    ----------
    names : sequence of str
        Names, several in one text with commas between them.

    Returns
    -------
    tuple of str
        Names of `gen.quantities.ALSO`.

    Raises
    ------
    InputError
        If no law has a quantity of a name.
    """
    chosen = [name.strip() for text in names for name in text.split(",")]
    for name in chosen:
        if name not in ALSO:
            raise InputError(f"--also {shown(name)}: give one of {', '.join(ALSO)}")
    return tuple(dict.fromkeys(chosen))


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
    title: str  # names of the surfaces, with those of the second bodies, on one line
    nodes: int  # of the smallest surface
    names: tuple[str, ...]  # of the surfaces one by one, in the order of `Curve.surfaces`
    sources: tuple[
        Origin, ...
    ] = ()  # the files of its surfaces, and what was done to them
    between_deltas: Curves | None = (
        None  # further contacts between the points of `over_delta`
    )
    between_pressures: Curves | None = (
        None  # the same of `over_pressure`; None without any
    )
    checks: Curves | None = None  # contacts at pressures that judge straight lines


def by_solver(order: Order) -> Law:
    """Make a law with the solver; lines about each file go to standard error."""
    deltas, pressures = order.loads()
    if deltas is None and pressures is None:
        raise InputError("give --delta or --pressure, the loads of the law")
    subjects = read_subjects(order)
    e_star = order.e_star or subjects.modulus() or 1.0
    hardness, ratio = order.hardness, None
    if hardness is None and (ratio := subjects.hardness_ratio()) is not None:
        hardness = ratio * e_star
    order.refuse_impossible(hardness)
    bodies = Bodies(e_star, hardness, known=order.e_star is not None)
    solver = Solver(order, subjects.surfaces, bodies)
    solved: dict[Load, Solved] = {}
    if deltas is not None:
        solved["delta"] = solver.solve("delta", deltas)
    if pressures is not None:
        solved["pressure"] = solver.solve("pressure", pressures)
    over_delta, over_pressure, further = _tables(solver, solved)
    lines = [line for each in solved.values() for line in each.warnings]
    lines += [line for each in [*solved.values(), *further] for line in each.remarks]
    tables = over_delta, over_pressure, list(dict.fromkeys(lines))
    one = "none, one surface was solved"
    if over_delta.resolved_somewhere or over_pressure.resolved_somewhere:
        one = "the error of the grid, 9 times in 10, of the area in the continuum; one surface"
    law = law_of(order, subjects, bodies, tables, ("solved contact by contact", one))
    return _with_contacts_between(law, solver) if order.between else law


def law_of(
    order: Order,
    subjects: LawSurfaces,
    bodies: Bodies,
    tables: Tables,
    said: tuple[str, str],
) -> Law:
    """Make a law of tables and the remarks on them.

    `said` is how the law was made, and what its band is if it has one surface.
    """
    over_delta, over_pressure, remarks = tables
    by_pressure = bool(order.pressure)
    by_delta = bool(order.delta) or not by_pressure
    over_pressure, full = over_pressure.below_full_contact(bodies, required=by_pressure)
    over_delta, also_full = over_delta.below_full_contact(bodies, required=by_delta)
    if order.conductivities is not None:
        factor = mean_conductivity(*order.conductivities) / bodies.e_star
        over_delta = over_delta.with_conductance(factor)
        over_pressure = over_pressure.with_conductance(factor)
    how, band = said
    boundary = subjects.surfaces[0].boundary
    if boundary != "free":
        how += f", patches without edges: {boundary} boundary"
    assumed = ""
    if len(subjects.surfaces) > 1:
        band = described(len(subjects.surfaces), order.coverage)
        assumed = assumption(len(subjects.surfaces), order.coverage)
    doubts = [each for each in subjects.origins if ": " in each]  # those of scenes
    doubts += [
        *subjects.doubts,
        *(f"warning: {each}" for each in material_doubts(bodies)),
    ]
    notes = [how, *filter(None, [assumed]), *doubts, *remarks, *full, *also_full]
    nodes = min(each.heights.size for each in subjects.surfaces)
    touching = over_pressure.curves[AREA.in_laws].value * nodes / 100
    few = over_pressure.at[(touching > 0) & (touching < FEW)]
    if few.size:
        to = f"up to {few[-1]:.4g} MPa fewer than {FEW} nodes touch"
        notes.append(f"{to}: there the grid decides the law, not the surface")
    return Law(
        order=order,
        over_delta=over_delta,
        over_pressure=over_pressure,
        bodies=bodies,
        boundary=boundary,
        band=band,
        origins=tuple(subjects.origins),
        notes=tuple(notes),
        title=shortened("; ".join(subjects.origins)),
        nodes=nodes,
        sources=tuple(subjects.sources),
        names=tuple(each.name for each in subjects.surfaces),
    )


@dataclass(frozen=True)
class Solver:
    """The solver of all surfaces of a law, one load after another."""

    order: Order
    surfaces: Sequence[LawSurface]
    bodies: Bodies
    judges: bool = (
        True  # whether the error of the grid is computed, where it is asked for
    )
    passes: Mapping[Load, str] = field(
        default_factory=lambda: PASSES
    )  # words of the progress

    def solve(self, load: Load, loads: Values) -> Solved:
        """Solve every surface; keep the loads that are solved on all of them.

        Parameters
        ----------
        load : {"delta", "pressure"}
            Kind of the loads.
        loads : ndarray, shape (k,)
            Ascending loads [um or MPa].

        Returns
        -------
        Solved
            Contacts under at least one load.

        Raises
        ------
        InputError
            If a load is not allowed, or none is solved on every surface.
        """
        remarks: list[str] = []
        if load == "delta" and self.bodies.hardness is None:
            loads, remarks = self._below_full_contact(loads)
            if not loads.size:
                raise InputError(f"{remarks[0].partition(':')[0]}: give smaller loads")
        return self._solve(load, loads, remarks)

    def solve_some(self, load: Load, loads: Values, other: Solved) -> Solved:
        """Solve every surface as `solve` does, but leave out all loads that are refused.

        There may be no load left, and then there are no contacts of the kind of the `other` ones.
        """
        remarks: list[str] = []
        if load == "delta" and self.bodies.hardness is None:
            loads, remarks = self._below_full_contact(loads)
        if loads.size:
            try:
                return self._solve(load, loads, remarks)
            except InputError as error:
                remarks = [f"warning: not solved, left out: {error}"]
        nothing = np.empty(0, dtype=np.int64)
        points = [part.chosen(nothing) for part in other.points]
        return Solved(np.empty(0), points, remarks=remarks)

    def _below_full_contact(self, loads: Values) -> tuple[Values, list[str]]:
        """Return displacements below full contact of elastic patches without edges, and a line."""
        edgeless = [each for each in self.surfaces if each.boundary != "free"]
        full = min(
            (each.at_rest()[MEAN_GAP.in_laws] for each in edgeless), default=np.inf
        )
        possible = loads[loads < (1 - APART) * full]
        if possible.size == loads.size:
            return loads, []
        line = f"full contact from {full:.4g} um on: the table against delta_um ends below it"
        return possible, [line]

    def _solve(self, load: Load, loads: Values, remarks: list[str]) -> Solved:
        """Solve every surface under loads that are allowed; see `solve`."""
        order, surfaces, bodies = self.order, self.surfaces, self.bodies
        points: list[Points] = []
        faults_of = []
        warned: list[str] = []
        notes: list[str] = []
        many = len(surfaces) > 1
        work = len(surfaces) * loads.size
        long = work * surfaces[0].heights.size >= LONG
        progress = (
            RunProgress(work, f"contacts {self.passes[load]}") if long else nullcontext()
        )
        with progress as shown:
            for surface in surfaces:
                judged = order.grid_error and self.judges and not points
                contacts = []
                for contact in _contacts(
                    order, surface, bodies, load, loads, judged=judged
                ):
                    contacts.append(contact)
                    if shown is not None:
                        shown.advance(1, int(not contact[0]))
                rows, bars, faults, doubts, pressed = zip(*contacts, strict=True)
                names = next(filter(None, rows))
                values = {
                    name: np.array([row.get(name, np.nan) for row in rows])
                    for name in names
                }
                low: dict[str, Values] = {}
                high: dict[str, Values] = {}
                grid: tuple[str, ...] = ()
                if judged:  # the band is the error of the grid
                    area = CONTINUUM.in_laws
                    bar = np.array(bars)
                    low[area] = np.clip(values[area] - bar, *CONTINUUM.bounds)
                    high[area] = np.clip(values[area] + bar, *CONTINUUM.bounds)
                    grid = tuple(doubts)
                points.append(Points(values, low, high, ("",) * loads.size, grid=grid))
                faults_of.append(faults)
                if judged and (doubted := loads[np.array(doubts) != ""]).size:
                    up_to = f"{doubted[-1]:.4g} {LOADS[load].unit}"
                    at = f"{doubted.size} of {loads.size} loads, up to {up_to}; at the first"
                    why = next(filter(None, doubts))
                    notes.append(
                        f"{surface.name}: the area is that of the grid at {at}, {why}"
                    )
                solved = [each for each in pressed if each]
                warned += contact_doubts(surface.heights, bodies, load, solved)[:1]
        kept = np.ones(loads.size, dtype=bool)
        lost = []
        for place, faults in enumerate(zip(*faults_of, strict=True)):
            failed = [
                f"{one.name}: {why}"
                for one, why in zip(surfaces, faults, strict=True)
                if why
            ]
            if failed:
                kept[place] = False
                on = f" on {len(failed)} of {len(points)} surfaces" if many else ""
                lost.append(f"warning: not solved{on}, left out: {failed[0]}")
        if not kept.any():
            raise InputError(f"no load was solved on every surface; {lost[0]}")
        of = f"{len(warned)} of {len(points)} surfaces, the first: " if many else ""
        warnings = [f"warning: {of}{line}" for line in warned[:1]]
        chosen = [part.chosen(kept) for part in points]
        return Solved(loads[kept], chosen, [*warnings, *notes], [*remarks, *lost])


def _tables(
    solver: Solver, solved: Mapping[Load, Solved]
) -> tuple[Curves, Curves, list[Solved]]:
    """Tabulate what was solved against Delta and against pressure; solve further if need be.

    The last item returned is what was solved for a table that was not asked for.
    """
    order, surfaces = solver.order, solver.surfaces
    further: list[Solved] = []
    made: dict[Load, Curves] = {}
    rests = [surface.at_rest(order.quantities, order.media) for surface in surfaces]
    rest = {name: float(np.mean([each[name] for each in rests])) for name in rests[0]}
    for load, argument in ARGUMENTS.items():
        contacts = solved.get(load)
        if contacts is None:
            (other,) = solved.values()
            if len(surfaces) > 1:
                contacts = _at_loads_of_other_table(load, other, solver)
                further.append(contacts)
            else:
                contacts = _same_contacts(other.points[0], argument)
        loads, parts = contacts.loads, contacts.points
        if load == "delta" or load not in solved:  # pressures that were given stay alone
            parts = [
                part.from_rest(each) for part, each in zip(parts, rests, strict=True)
            ]
            loads = np.append(0.0, loads)
        parts = [  # contacts turn back only within the tolerance of the solver
            replace(
                part,
                values={name: held(name, each) for name, each in part.values.items()},
            )
            for part in parts
        ]
        table = tabulated(argument, loads, parts, order.coverage, rest)
        made[load] = replace(table, grid=parts[0].grid)
    return made["delta"], made["pressure"], further


def _same_contacts(part: Points, argument: str) -> Solved:
    """Return the contacts of one surface in the order of another argument."""
    ascending = np.argsort(part.values[argument], kind="stable")
    chosen = part.chosen(ascending[risen(part.values[argument][ascending])])
    return Solved(chosen.values[argument], [chosen])


def _at_loads_of_other_table(load: Load, other: Solved, solver: Solver) -> Solved:
    """Solve a population for the table that was not asked for.

    Its loads are the means over the surfaces in the table that was asked for. Unlike surfaces may
    be pressed flat by the first mean displacement: then the displacements are those of the surface
    that gives way least. No load is refused here: the table becomes shorter.

    Parameters
    ----------
    load : {"delta", "pressure"}
        Kind of the loads of the table that was not asked for.
    other : Solved
        Contacts of each surface at the loads asked for.
    solver : Solver
        Solver of the same surfaces.

    Returns
    -------
    Solved
        Contacts of each surface under these loads, of which there may be none.
    """
    every = np.stack([part.values[ARGUMENTS[load]] for part in other.points])
    means = np.sort(every.mean(axis=0))
    means = means[risen(means)]
    hardness = solver.bodies.hardness
    if load == "pressure" and hardness is not None:
        means = means[means < (1 - APART) * hardness]
        if not means.size:
            raise InputError(
                f"every node yields: the pressure is the hardness, {hardness:.4g} MPa, at all"
                " displacements: give smaller ones"
            )
    contacts = solver.solve_some(load, means, other)
    if load == "pressure" or not contacts.full:
        return contacts
    least = np.sort(every.min(axis=0))
    shorter = solver.solve_some(load, least[risen(least)], other)
    end = f"full contact from {means[0]:.4g} um on: the table against delta_um ends below it"
    return replace(shorter, remarks=[*(contacts.remarks or [end]), *shorter.remarks])


def _with_contacts_between(law: Law, solver: Solver) -> Law:
    """Return a law with contacts between the points of the tables that its order names."""
    order = law.order
    both = "delta" in order.between
    if not both:  # only what tables of the pressure over the closure hold
        order = replace(order, grid_error=False, flow=False)
    between = SolverBetween(
        law, replace(solver, order=order, judges=False, passes=BETWEEN)
    )
    table = law.over_pressure
    rounds = LINE_ROUNDS if order.straight and table.conducting else ROUNDS
    contacts = solve_between(table, law.nodes, between.at_pressures, rounds)
    if order.straight and contacts is not None:
        contacts = solve_beside_lines(table, contacts, law.nodes, between.at_pressures)
        checks = between.at_pressures(check_loads(table), judging=True)
        law = replace(law, checks=checks)
    law = replace(law, between_pressures=contacts)
    if not both:
        return law
    if len(solver.surfaces) > 1:
        between_deltas = solve_between(
            law.over_delta, law.nodes, between.at_deltas, rounds=1
        )
    else:
        between_deltas = between.same_over_delta()
    return replace(law, between_deltas=between_deltas)


class SolverBetween:
    """Solves contacts between the points of a law, as parts of its tables.

    Parameters
    ----------
    law : Law
        The law.
    solver : Solver
        Solver of its surfaces.
    """

    def __init__(self, law: Law, solver: Solver) -> None:
        self.law = law
        self.solver = solver
        self.contacts: list[Solved] = []  # at pressures

    def at_pressures(self, pressures: Values, *, judging: bool = False) -> Curves:
        """Solve contacts at ascending pressures, (m,) [MPa], some of which may be left out.

        Those for `judging` lines are no part of the law.
        """
        contacts = self.solver.solve_some("pressure", pressures, Solved(pressures, []))
        if contacts.loads.size and not judging:
            self.contacts.append(contacts)
        return self._tabulated(self.law.over_pressure, contacts)

    def at_deltas(self, deltas: Values) -> Curves:
        """Solve contacts at ascending displacements, (m,) [um], some of which may be left out."""
        contacts = self.solver.solve_some("delta", deltas, Solved(deltas, []))
        return self._tabulated(self.law.over_delta, contacts)

    def same_over_delta(self) -> Curves | None:
        """Return the contacts at pressures of one surface against Delta; None without any."""
        table: Curves | None = None
        for contacts in self.contacts:
            again = _same_contacts(contacts.points[0], DELTA.in_laws)
            further = self._tabulated(self.law.over_delta, again)
            table = further if table is None else merged(table, further)
        return table

    def _tabulated(self, table: Curves, contacts: Solved) -> Curves:
        """Tabulate contacts below full contact as those of a table of the law."""
        if not contacts.loads.size:
            return table.chosen(np.zeros(table.at.size, dtype=bool))
        order = self.solver.order
        parts = contacts.points
        further = tabulated(
            table.against, contacts.loads, parts, order.coverage, table.rest
        )
        if order.conductivities is not None:
            factor = mean_conductivity(*order.conductivities) / self.law.bodies.e_star
            further = further.with_conductance(factor)
        below = further.curves[AREA.in_laws].value < 100
        for curve in further.curves.values():
            below &= np.isfinite(curve.value)
        return further.chosen(below)


def _contacts(
    order: Order,
    surface: LawSurface,
    bodies: Bodies,
    load: Load,
    loads: Values,
    *,
    judged: bool,
) -> Iterator[tuple[dict[str, float], float, str, str, Pressed | None]]:
    """Yield quantities, the error of the grid, two faults, and what warnings take at each load."""
    settings = {"modulus": bodies.e_star, "hardness": bodies.hardness, **surface.settings}
    for contact, fault in solve_loads(surface, load, loads.tolist(), **settings):
        if contact is None:
            yield {}, np.nan, fault, "", None
            continue
        try:
            row = {
                quantity.in_laws: quantity.in_law(contact, order.media)
                for quantity in order.quantities
            }
        except ArithmeticError as error:
            raise InputError(f"{surface.name}: {error}") from None
        grid = contact.grid_error() if judged else None
        bar = grid.area_percent if grid and grid.resolved else np.nan
        doubt = grid.reason if grid and not grid.resolved else ""
        pressed = Pressed(contact.delta, contact.largest_pressure, contact.contact_nodes)
        yield row, bar, "", doubt, pressed
