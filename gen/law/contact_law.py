"""Contact laws: closure, area, mean gap and conductance against Delta and nominal pressure.

A law is that of one surface, or the mean over the surfaces of a population with the band of a
further one. It has a table against Delta and one against the pressure. The patch is a piece of a
larger interface, and is continued by its mirror images unless the order has another boundary: the
displacement of a free patch as a whole belongs to the mesh of a finite-element model, not to its
interface.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bem.contact import mean_conductivity
from bem.problem import Boundary
from gen.arrays import Values
from gen.doubts import material_doubts
from gen.law.bands import assumption, described
from gen.law.between import check_loads, merged, solve_between, solve_for_lines
from gen.law.curves import APART, Curves, Points, held, risen, tabulated
from gen.law.order import ARGUMENTS, Load, Order
from gen.law.solver import LawSolver, SolvedLoads, ends_below
from gen.law.surfaces import LawSurfaces, Source, read_law_surfaces
from gen.material import Bodies
from gen.quantities import AREA
from gen.runtime.errors import InputError
from gen.runtime.terminal import shortened

FEW = 10  # nodes in contact below which a law shows the grid rather than the surface

STEPS = 40
"""Number of displacements over the range of a training, where no load is given."""

BETWEEN: Mapping[Load, str] = {
    "delta": "between the Deltas",
    "pressure": "between the pressures",
}
"""Which contacts the progress counts where they are solved between the loads of a table."""


@dataclass(frozen=True, eq=False)
class Tables:
    """Both tables of a law before they are cut at full contact."""

    over_delta: Curves
    over_pressure: Curves
    remarks: Sequence[str]  # about the contacts, one line each


@dataclass(frozen=True)
class Making:
    """How a law was made, in words for its readers."""

    method: str
    band: str  # description of its band if it has one surface


@dataclass(frozen=True, eq=False)
class Law:
    """Tables of a contact law."""

    order: Order
    over_delta: Curves  # begins at Delta = 0
    over_pressure: Curves  # Delta is among its curves
    bodies: Bodies
    boundary: Boundary
    band: str  # its description
    descriptions: tuple[str, ...]  # of the surfaces, one line for each input
    notes: tuple[str, ...]  # remarks about the making of the law, one line each
    title: str  # names of the surfaces, with those of the second bodies, on one line
    nodes: int  # of the smallest surface
    surface_names: tuple[str, ...]  # in the order of `Curve.surfaces`
    sources: tuple[Source, ...] = ()  # files of its surfaces and their preparation
    # Contacts between the points of `over_delta` and of `over_pressure`; None without any.
    between_deltas: Curves | None = None
    between_pressures: Curves | None = None
    checks: Curves | None = None  # contacts at pressures that judge straight lines


def by_solver(order: Order) -> Law:
    """Make a law with the solver, and print lines about each file on standard error.

    Parameters
    ----------
    order : Order
        The request, with the loads of one table or of both.

    Returns
    -------
    Law
        The law of all surfaces.

    Raises
    ------
    InputError
        If the order has no load, a surface or a load cannot be used, or no load is solved on every
        surface.
    """
    loads = order.loads()
    if not loads:
        raise InputError("give --delta or --pressure, the loads of the law")
    subjects = read_law_surfaces(order)
    bodies = _bodies(order, subjects)
    order.refuse_impossible(bodies.hardness)
    solver = LawSolver(order, subjects.surfaces, bodies)
    solved = {load: solver.solve(load, values) for load, values in loads.items()}
    tables = _tables(solver, solved)
    making = Making("solved contact by contact", _band_of_one_surface(tables))
    law = law_of(order, subjects, bodies, tables, making)
    if not order.between:
        return law
    return _with_contacts_between(law, solver)


def _bodies(order: Order, subjects: LawSurfaces) -> Bodies:
    """Return the bodies of an order, or those of its scenes; E* is 1 MPa if neither gives it."""
    e_star = order.e_star or subjects.modulus() or 1.0
    hardness = order.hardness
    if hardness is None:
        ratio = subjects.hardness_ratio()
        if ratio is not None:
            hardness = ratio * e_star
    return Bodies(e_star, hardness, has_modulus=order.e_star is not None)


def _band_of_one_surface(tables: Tables) -> str:
    """Describe the band of one surface: the error of the grid, where it resolves a contact."""
    for table in (tables.over_delta, tables.over_pressure):
        if table.resolved_somewhere:
            return "the error of the grid, 9 times in 10, of the area in the continuum; one surface"
    return "none, one surface was solved"


def law_of(
    order: Order,
    subjects: LawSurfaces,
    bodies: Bodies,
    tables: Tables,
    making: Making,
) -> Law:
    """Make a law of tables: end them below full contact, add conductances and all notes.

    Parameters
    ----------
    order : Order
        The request. A requested table has to have loads below full contact.
    subjects : LawSurfaces
        Surfaces of the law, all with one boundary.
    bodies : Bodies
        Material of the bodies [MPa].
    tables : Tables
        Both tables, with stiffnesses if conductivities are given.
    making : Making
        How the tables were made.

    Returns
    -------
    Law
        The law, without contacts between its loads.

    Raises
    ------
    InputError
        If nothing but first touch lies below full contact in a requested table, or nothing at all
        in the other table.
    """
    pressures = tables.over_pressure.below_full_contact(
        bodies, required="pressure" in order.requested
    )
    deltas = tables.over_delta.below_full_contact(
        bodies, required="delta" in order.requested
    )
    over_pressure = _with_conductance(pressures.curves, order, bodies)
    number = len(subjects.surfaces)
    notes = [_method(making, subjects.surfaces[0].boundary)]
    band = making.band
    if number > 1:
        band = described(number, order.coverage)
        notes.append(assumption(number, order.coverage))
    notes += [about.description for about in subjects.inputs if about.scene is not None]
    notes += subjects.doubts
    notes += [f"warning: {doubt}" for doubt in material_doubts(bodies)]
    notes += tables.remarks
    nodes = min(surface.heights.size for surface in subjects.surfaces)
    notes += [pressures.remark, deltas.remark, _few_nodes(over_pressure, nodes)]
    return Law(
        order=order,
        over_delta=_with_conductance(deltas.curves, order, bodies),
        over_pressure=over_pressure,
        bodies=bodies,
        boundary=subjects.surfaces[0].boundary,
        band=band,
        descriptions=tuple(subjects.descriptions),
        notes=tuple(note for note in notes if note),
        title=shortened("; ".join(subjects.descriptions)),
        nodes=nodes,
        sources=tuple(subjects.sources),
        surface_names=tuple(surface.name for surface in subjects.surfaces),
    )


def _method(making: Making, boundary: Boundary) -> str:
    """Say how a law was made, and which boundary its patches have if they are not free."""
    if boundary == "free":
        return making.method
    return f"{making.method}, patches without edges: {boundary} boundary"


def _with_conductance(table: Curves, order: Order, bodies: Bodies) -> Curves:
    """Add the conductance of the spots to a table with a stiffness, if bodies conduct heat."""
    if order.conductivities is None:
        return table
    return table.with_conductance(
        mean_conductivity(*order.conductivities) / bodies.e_star
    )


def _few_nodes(over_pressure: Curves, nodes: int) -> str:
    """Say up to which pressure too few of the nodes touch; "" if enough do everywhere."""
    touching = over_pressure.curves[AREA.in_laws].value * nodes / 100
    pressures = over_pressure.at[(touching > 0) & (touching < FEW)]
    if not pressures.size:
        return ""
    return (
        f"up to {pressures[-1]:.4g} MPa fewer than {FEW} nodes touch: there the grid decides the"
        " law, not the surface"
    )


def mean_at_rest(at_rest: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Take the mean of quantities at first touch over the surfaces of a law.

    Parameters
    ----------
    at_rest : sequence of mapping
        Values of the same quantities by names in laws, for each surface.

    Returns
    -------
    dict
        Their means by names in laws.
    """
    return {
        name: float(np.mean([values[name] for values in at_rest])) for name in at_rest[0]
    }


def _tables(solver: LawSolver, solved: Mapping[Load, SolvedLoads]) -> Tables:
    """Tabulate contacts against Delta and against pressure.

    If the order has no loads for one table, a population is solved at further loads for it. The
    table of one surface has the contacts of the other table.
    """
    order = solver.order
    contacts = dict(solved)
    for load in ARGUMENTS:
        if load not in solved:
            (other,) = solved.values()
            contacts[load] = _contacts_for_other_table(load, other, solver)
    at_rest = [
        surface.at_rest(order.quantities, order.media) for surface in solver.surfaces
    ]
    tables: dict[Load, Curves] = {}
    for load in ARGUMENTS:
        # Pressures that the user gave stay without first touch.
        from_rest = load == "delta" or load not in solved
        tables[load] = _table(load, contacts[load], at_rest, order, from_rest=from_rest)
    remarks = [line for answers in solved.values() for line in answers.warnings]
    remarks += [line for answers in contacts.values() for line in answers.remarks]
    return Tables(tables["delta"], tables["pressure"], list(dict.fromkeys(remarks)))


def _table(
    load: Load,
    contacts: SolvedLoads,
    at_rest: Sequence[Mapping[str, float]],
    order: Order,
    *,
    from_rest: bool,
) -> Curves:
    """Tabulate contacts against their loads; `from_rest` puts first touch before them.

    Values that turn back, which they do only within the tolerance of the solver, are replaced.
    """
    loads = contacts.loads
    parts = contacts.points
    if from_rest:
        loads = np.append(0.0, loads)
        pairs = zip(parts, at_rest, strict=True)
        parts = [part.from_rest(first_touch) for part, first_touch in pairs]
    parts = [_held(part) for part in parts]
    table = tabulated(
        ARGUMENTS[load], loads, parts, order.coverage, mean_at_rest(at_rest)
    )
    return replace(table, grid=parts[0].grid)


def _held(points: Points) -> Points:
    """Return points whose values do not turn back, with their intervals as they are."""
    values = {name: held(name, array) for name, array in points.values.items()}
    return replace(points, values=values)


def _same_contacts(points: Points, load: Load) -> SolvedLoads:
    """Return the contacts of one surface in the order of another load, where it rises."""
    argument = points.values[ARGUMENTS[load]]
    ascending = np.argsort(argument, kind="stable")
    places = ascending[risen(argument[ascending])]
    return SolvedLoads(argument[places], [points.chosen(places)])


def _contacts_for_other_table(
    load: Load, other: SolvedLoads, solver: LawSolver
) -> SolvedLoads:
    """Return contacts for the table of a load that the order does not give.

    Those of one surface are the contacts of the other table. A population is solved at the means of
    the load over the surfaces in the other table. Unlike surfaces may be pressed flat by the first
    mean displacement: then each displacement is the smallest of all surfaces. Loads that are not
    solved make the table shorter, perhaps empty; pressures are refused if all reach the hardness.
    """
    if len(solver.surfaces) == 1:
        return _same_contacts(other.points[0], load)
    of_surfaces = np.stack([part.values[ARGUMENTS[load]] for part in other.points])
    means = np.sort(of_surfaces.mean(axis=0))
    means = means[risen(means)]
    if load == "pressure":
        means = _below_hardness(means, solver.bodies)
        return solver.solve_some("pressure", means, other.points)
    contacts = solver.solve_some("delta", means, other.points)
    if not contacts.in_full_contact:
        return contacts
    smallest = np.sort(of_surfaces.min(axis=0))
    shorter = solver.solve_some("delta", smallest[risen(smallest)], other.points)
    remarks = contacts.remarks or [ends_below(means[0])]
    return replace(shorter, remarks=[*remarks, *shorter.remarks])


def _below_hardness(pressures: Values, bodies: Bodies) -> Values:
    """Return the pressures below the hardness [MPa], or refuse them if there are none."""
    if bodies.hardness is None:
        return pressures
    below = pressures[pressures < (1 - APART) * bodies.hardness]
    if not below.size:
        raise InputError(
            f"every node yields: the pressure is the hardness, {bodies.hardness:.4g} MPa, at all"
            " displacements: give smaller ones"
        )
    return below


def _with_contacts_between(law: Law, solver: LawSolver) -> Law:
    """Return a law with contacts between the points of the tables that its order names.

    An order for the pressures alone has quantities that tables of the pressure over the closure
    hold, and no others.
    """
    order = law.order
    over_delta = "delta" in order.between
    if not over_delta:
        order = replace(order, grid_error=False, flow=False)
    solver = replace(solver, order=order, judges=False, passes=BETWEEN)
    between = SolverBetween(law, solver)
    solve_pressures = solve_for_lines if order.straight else solve_between
    pressures = solve_pressures(law.over_pressure, law.nodes, between.at_pressures)
    checks: Curves | None = None
    if order.straight and pressures is not None:
        checks = between.at_checks(check_loads(law.over_pressure))
    deltas: Curves | None = None
    if over_delta and len(solver.surfaces) == 1:
        deltas = between.same_over_delta()
    elif over_delta:
        deltas = solve_between(law.over_delta, law.nodes, between.at_deltas, rounds=1)
    return replace(law, between_pressures=pressures, between_deltas=deltas, checks=checks)


class SolverBetween:
    """Solves contacts between the points of a law, as parts of its tables.

    Contacts at pressures are remembered: those of one surface are also contacts between Deltas.

    Parameters
    ----------
    law : Law
        The law.
    solver : LawSolver
        Solver of its surfaces.
    """

    def __init__(self, law: Law, solver: LawSolver) -> None:
        self.law = law
        self.solver = solver
        self.contacts_at_pressures: list[SolvedLoads] = []

    def at_pressures(self, pressures: Values) -> Curves:
        """Solve contacts at pressures, and remember them.

        Parameters
        ----------
        pressures : ndarray, shape (m,)
            Ascending pressures [MPa].

        Returns
        -------
        Curves
            The contacts below full contact, against pressure. Some may be left out.
        """
        contacts = self.solver.solve_some("pressure", pressures)
        if contacts.loads.size:
            self.contacts_at_pressures.append(contacts)
        return self._tabulated(self.law.over_pressure, contacts)

    def at_checks(self, pressures: Values) -> Curves:
        """Solve contacts that judge straight lines, and are no part of the law.

        Parameters
        ----------
        pressures : ndarray, shape (m,)
            Ascending pressures [MPa].

        Returns
        -------
        Curves
            The contacts below full contact, against pressure. Some may be left out.
        """
        contacts = self.solver.solve_some("pressure", pressures)
        return self._tabulated(self.law.over_pressure, contacts)

    def at_deltas(self, deltas: Values) -> Curves:
        """Solve contacts at displacements.

        Parameters
        ----------
        deltas : ndarray, shape (m,)
            Ascending displacements [um].

        Returns
        -------
        Curves
            The contacts below full contact, against Delta. Some may be left out.
        """
        contacts = self.solver.solve_some("delta", deltas)
        return self._tabulated(self.law.over_delta, contacts)

    def same_over_delta(self) -> Curves | None:
        """Return the remembered contacts of one surface against Delta; None without any."""
        tables: list[Curves] = []
        for contacts in self.contacts_at_pressures:
            same = _same_contacts(contacts.points[0], "delta")
            tables.append(self._tabulated(self.law.over_delta, same))
        if not tables:
            return None
        return functools.reduce(merged, tables)

    def _tabulated(self, table: Curves, contacts: SolvedLoads) -> Curves:
        """Tabulate contacts below full contact as those of a table of the law."""
        if not contacts.loads.size:
            return table.chosen(np.zeros(table.at.size, dtype=bool))
        order = self.solver.order
        between = tabulated(
            table.against, contacts.loads, contacts.points, order.coverage, table.at_rest
        )
        between = _with_conductance(between, order, self.law.bodies)
        below = between.curves[AREA.in_laws].value < 100
        for curve in between.curves.values():
            below &= np.isfinite(curve.value)
        return between.chosen(below)
