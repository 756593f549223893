"""Contact laws: closure, area, mean gap and conductance against Delta and nominal pressure.

A law describes one surface, or the mean over the surfaces of a population with the band of a
further surface. It has a table against Delta and one against the pressure.

The patch is a piece of a larger interface. Its mirror images continue it unless the order has
another boundary, because the half-space sinks under a free patch: this belongs to the mesh of a
finite-element model, not to the interface.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bem.contact import mean_conductivity
from bem.problem import Boundary
from gen.arrays import Values
from gen.doubts import material_doubts
from gen.law import accuracy
from gen.law.bands import assumption, described
from gen.law.between import check_loads, merged, solve_between, solve_for_lines
from gen.law.curves import (
    APART,
    BelowFullContact,
    Curves,
    Points,
    risen,
    tabulated,
    without_reversals,
)
from gen.law.layer import check_layer, compliance_in_law, layer_in_words
from gen.law.order import ARGUMENTS, Load, Order
from gen.law.solver import LawSolver, SolvedLoads, ends_below
from gen.law.surfaces import LawSurfaces, Source, read_law_surfaces
from gen.maps.limits import MapLimits, limits_of
from gen.material import Bodies
from gen.quantities import AREA
from gen.runtime.errors import InputError
from gen.runtime.terminal import shortened

if TYPE_CHECKING:
    from gen.law.sampled import MeansSolver, SampledMeans

FEW = 10
"""Nodes in contact below which a law shows the grid rather than the surface."""

STEPS = 40
"""Number of displacements over the range of a surrogate's training, if no load is given."""


@dataclass(frozen=True, eq=False)
class Tables:
    """Both tables of a law before they are cut at full contact."""

    over_delta: Curves
    over_pressure: Curves
    remarks: Sequence[str]  # remarks and warnings about the contacts, one line each


@dataclass(frozen=True)
class Making:
    """How a law was made, in words for its readers."""

    method: str  # as "solved contact by contact"
    band: str  # description of the band of one surface; not used for a population


@dataclass(frozen=True, eq=False)
class Law:
    """A contact law: its tables, and how they were made."""

    order: Order
    over_delta: Curves  # begins at Delta = 0, first touch
    over_pressure: Curves  # has Delta among its curves
    bodies: Bodies
    boundary: Boundary
    band: str  # description of the band
    descriptions: tuple[str, ...]  # descriptions of the inputs, one line each
    notes: tuple[str, ...]  # remarks about the making of the law, one line each
    title: str  # names of the surfaces, with those of the second bodies, on one line
    nodes: int  # number of nodes of the smallest surface
    surface_names: tuple[str, ...]  # in the order of `Curve.surfaces`
    sources: tuple[Source, ...] = ()  # files of the surfaces, with their preparation
    # Contacts between the points of `over_delta` and of `over_pressure`; None without any.
    between_deltas: Curves | None = None
    between_pressures: Curves | None = None
    # Contacts at pressures that straight lines are compared with; None without any.
    checks: Curves | None = None
    # Errors of means over a population, and how it was sampled; None unless errors were asked for.
    sampled: SampledMeans | None = None
    limits: tuple[MapLimits, ...] = ()  # of each surface, if errors were asked for


def by_solver(order: Order) -> Law:
    """Make a law with the solver. The preparation of files is printed on standard error.

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
    bodies = bodies_of(order, subjects)
    order.refuse_impossible(bodies.hardness)
    check_layer(order, bodies)
    solver = LawSolver(order, subjects.surfaces, bodies)
    solved = {load: solver.solve(load, values) for load, values in loads.items()}
    tables = _tables(solver, solved)
    band = _band_of_one_surface(order, tables)
    making = Making(method="solved contact by contact", band=band)
    law = law_of(order, subjects, bodies, tables, making)
    if order.errors is not None:
        law = _with_accuracy(law, order.errors, subjects)
    if not order.between:
        return law
    return with_contacts_between(law, solver)


def bodies_of(order: Order, subjects: LawSurfaces) -> Bodies:
    """Return the bodies of a law: those of the order, or else those of its scenes.

    E* is 1 MPa if neither gives it. A hardness of scenes is scaled to the E* of the law.

    Parameters
    ----------
    order : Order
        The request.
    subjects : LawSurfaces
        Surfaces of the law.

    Returns
    -------
    Bodies
        The bodies [MPa].

    Raises
    ------
    InputError
        If the scenes have different moduli or layers or more than one hardness, or if the order
        replaces the modulus of a scene with a layer, but not the layer.
    """
    layered = order.layered
    if layered is None:
        layered = subjects.layered_body()
        if layered is not None and order.e_star is not None:
            raise InputError(
                f"the scene has a layer of {layered.text}: leave out --young and --e-star, or give"
                " --layer-thickness and --layer-young, too"
            )
    e_star = order.e_star or subjects.modulus() or 1.0
    if layered is not None:
        e_star = layered.e_star
    hardness = order.hardness
    if hardness is None:
        ratio = subjects.hardness_ratio()
        if ratio is not None:
            hardness = ratio * e_star
    return Bodies(
        e_star=e_star,
        hardness=hardness,
        has_modulus=order.e_star is not None,
        layered=layered,
    )


def _with_accuracy(law: Law, errors: Mapping[str, float], subjects: LawSurfaces) -> Law:
    """Return a law with the limits of its maps, and notes on the errors that were asked for."""
    limits = tuple(limits_of(surface) for surface in subjects.surfaces)
    method, *further = law.notes
    tables = (law.over_delta, law.over_pressure)
    about_errors = accuracy.notes(tables, errors, law.order.requested)
    about_limits = accuracy.limits_in_words(limits)
    return replace(
        law, limits=limits, notes=(method, *about_errors, about_limits, *further)
    )


def _band_of_one_surface(order: Order, tables: Tables) -> str:
    """Describe the band of one surface: the error of the grid, if the grid resolves a contact.

    The text says that there is no band if the grid resolves none, or was not judged. If errors were
    asked for, these are the band.
    """
    if order.errors is not None:
        return accuracy.band_of_one_surface(order.errors)
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
    """Make a law of tables: end them below full contact, and add conductances and all notes.

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
        If a requested table has no load above 0 below full contact, or the other table has no
        argument there at all.
    """
    # With the compression of a layer the closure rises in full contact, too.
    pressures = BelowFullContact(tables.over_pressure)
    deltas = BelowFullContact(tables.over_delta)
    if not compliance_in_law(order, bodies) > 0:
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
    notes += layer_in_words(order, bodies)
    if len(subjects.inputs) > 1:  # of a single input it is the title
        notes += [
            about.description for about in subjects.inputs if about.scene is not None
        ]
    notes += subjects.doubts
    notes += [f"warning: {doubt}" for doubt in material_doubts(bodies)]
    notes += tables.remarks
    nodes = min(surface.heights.size for surface in subjects.surfaces)
    # Each of these remarks is "" if there is nothing to say; `if note` below leaves it out.
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
    """Return a table with the conductance of the spots, too, if it can be known.

    That needs conductivities in the order and a stiffness in the table.
    """
    if order.conductivities is None:
        return table
    conductivity = mean_conductivity(*order.conductivities)
    return table.with_conductance(conductivity / bodies.e_star)


def _few_nodes(over_pressure: Curves, nodes: int) -> str:
    """Say up to which pressure fewer than `FEW` nodes touch; "" if no pressure has so few.

    `nodes` is the number of nodes of the smallest surface. `over_pressure` has the area [%] against
    the pressure [MPa].
    """
    area = over_pressure.curves[AREA.in_laws].value  # in percent of the nominal area
    touching = over_pressure.fewest_nodes(nodes) * area / 100  # nodes in contact
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
        For each surface, the values by names in laws. All surfaces have the same names.

    Returns
    -------
    dict of float
        Means by names in laws.
    """
    means: dict[str, float] = {}
    for name in at_rest[0]:
        of_surfaces = [values[name] for values in at_rest]
        means[name] = float(np.mean(of_surfaces))
    return means


def _tables(solver: LawSolver, solved: Mapping[Load, SolvedLoads]) -> Tables:
    """Tabulate contacts against Delta and against pressure.

    `solved` has the contacts at the loads of the order. If the order has loads for one table only,
    the other table of one surface has the same contacts; a population is solved at further loads.
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
        # The table against pressures that the user gave has these alone, without first touch.
        from_rest = load == "delta" or load not in solved
        tables[load] = table_of(load, contacts[load], at_rest, order, from_rest=from_rest)
    remarks = [line for answers in solved.values() for line in answers.warnings]
    remarks += [line for answers in contacts.values() for line in answers.remarks]
    return Tables(
        over_delta=tables["delta"],
        over_pressure=tables["pressure"],
        remarks=list(dict.fromkeys(remarks)),  # each once
    )


def table_of(
    load: Load,
    contacts: SolvedLoads,
    at_rest: Sequence[Mapping[str, float]],
    order: Order,
    *,
    from_rest: bool,
) -> Curves:
    """Tabulate contacts against their loads.

    Values that turn back are replaced by the extreme value before (`without_reversals`): they turn
    back only within the tolerance of the solver, or the error of means.

    Parameters
    ----------
    load : {"delta", "pressure"}
        Kind of the loads.
    contacts : SolvedLoads
        Contacts of each surface, or means over a population as those of one surface.
    at_rest : sequence of mapping
        Values at first touch of each surface, by names in laws.
    order : Order
        The request.
    from_rest : bool
        Whether to put first touch before the loads.

    Returns
    -------
    Curves
        The table.
    """
    loads = contacts.loads
    parts = contacts.points
    if from_rest:
        loads = np.append(0.0, loads)
        pairs = zip(parts, at_rest, strict=True)
        parts = [part.from_rest(first_touch) for part, first_touch in pairs]
    parts = [_without_reversals(part) for part in parts]
    table = tabulated(
        ARGUMENTS[load], loads, parts, order.coverage, mean_at_rest(at_rest)
    )
    # The grid is judged on the first surface alone.
    return replace(table, unresolved=parts[0].unresolved)


def _without_reversals(points: Points) -> Points:
    """Return points with the values of `without_reversals`, and with unchanged intervals."""
    values = {
        name: without_reversals(name, array) for name, array in points.values.items()
    }
    return replace(points, values=values)


def _same_contacts(points: Points, load: Load) -> SolvedLoads:
    """Return the contacts of one surface, sorted by their values of another load.

    Contacts at which this load is 0 or does not rise are left out.
    """
    argument = points.values[ARGUMENTS[load]]
    ascending = np.argsort(argument, kind="stable")
    places = ascending[risen(argument[ascending])]
    return SolvedLoads(loads=argument[places], points=[points.chosen(places)])


def _contacts_for_other_table(
    load: Load, other: SolvedLoads, solver: LawSolver
) -> SolvedLoads:
    """Return the contacts of the table against `load`, for which the order gives no loads.

    `other` has the contacts of the other table. One surface has these contacts in both tables. A
    population is solved again: at each load of the other table its surfaces have different values
    of `load`, and the mean of these is the new load. If the first mean displacement already presses
    a surface flat, or no mean is solved, the smallest displacement at each load of the other table
    takes the place of the mean. Loads that are not solved are left out, perhaps all. Raises
    InputError if all pressures reach the hardness.
    """
    order = solver.order
    if len(solver.surfaces) == 1:
        return _same_contacts(other.points[0], load)
    of_surfaces = np.stack([part.values[ARGUMENTS[load]] for part in other.points])
    means = np.sort(of_surfaces.mean(axis=0))
    means = means[risen(means)]
    if load == "pressure":
        means = _below_hardness(means, solver.bodies)
        return solver.solve_some("pressure", means, like=other.points)
    contacts = solver.solve_some("delta", means, like=other.points)
    if not contacts.begins_in_full_contact:
        return contacts
    goes_through_full_contact = compliance_in_law(order, solver.bodies) > 0
    if goes_through_full_contact and contacts.loads.size:
        return contacts
    # No mean displacement was solved, or the surfaces are so unlike that the first mean presses one
    # of them flat: take the smallest displacements.
    smallest = np.sort(of_surfaces.min(axis=0))
    shorter = solver.solve_some("delta", smallest[risen(smallest)], like=other.points)
    # If no displacement was left out, the first one is already that of full contact.
    remarks = contacts.remarks or [ends_below(means[0])]
    return replace(shorter, remarks=[*remarks, *shorter.remarks])


def _below_hardness(pressures: Values, bodies: Bodies) -> Values:
    """Return the pressures below the hardness [MPa]. Raises InputError if there are none."""
    if bodies.hardness is None:
        return pressures
    below = pressures[pressures < (1 - APART) * bodies.hardness]
    if not below.size:
        raise InputError(
            f"every node yields: the pressure is the hardness, {bodies.hardness:.4g} MPa, at all"
            " displacements: give smaller ones"
        )
    return below


def with_contacts_between(law: Law, solver: LawSolver | MeansSolver) -> Law:
    """Add contacts between the loads of a law, for programs that join its points.

    Contacts between the pressures are always solved, those between the Deltas only if
    `order.between` names "delta". Without "delta" the contacts serve tables of finite elements,
    which hold neither the area in the continuum nor apertures nor shear: these are not computed
    then.

    Parameters
    ----------
    law : Law
        The law.
    solver : LawSolver or MeansSolver
        Solver of its surfaces.

    Returns
    -------
    Law
        The law with these contacts.
    """
    order = law.order
    over_delta = "delta" in order.between
    if not over_delta:
        order = replace(order, grid_error=False, flow=False, friction=None)
    solver = solver.for_loads_between(order)
    between = SolverBetween(law, solver)
    solve_pressures = solve_for_lines if order.straight else solve_between
    pressures = solve_pressures(law.over_pressure, law.nodes, between.at_pressures)
    checks: Curves | None = None
    if order.straight and pressures is not None:
        checks = between.at_checks(check_loads(law.over_pressure))
    deltas: Curves | None = None
    if over_delta and solver.has_one_surface:
        # Contacts of one surface between pressures are contacts between Deltas too.
        deltas = between.same_over_delta()
    elif over_delta:
        deltas = solve_between(law.over_delta, law.nodes, between.at_deltas, rounds=1)
    notes = law.notes
    if order.errors is not None:
        solved = [table for table in (pressures, checks, deltas) if table is not None]
        note = accuracy.note_on_contacts_between(solved, order.errors)
        notes = (*notes, note) if note else notes
    return replace(
        law,
        between_pressures=pressures,
        between_deltas=deltas,
        checks=checks,
        notes=notes,
    )


class SolverBetween:
    """Solver of contacts between the points of a law, which it returns as tables.

    It remembers contacts at pressures: of one surface they are also contacts between Deltas.

    Parameters
    ----------
    law : Law
        The law.
    solver : LawSolver or MeansSolver
        Solver of its surfaces.
    """

    def __init__(self, law: Law, solver: LawSolver | MeansSolver) -> None:
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
        """Solve contacts to compare straight lines with, and do not remember them.

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
        """Return the remembered contacts of the only surface as a table against Delta.

        Returns
        -------
        Curves or None
            The contacts below full contact; None if none are remembered.
        """
        tables: list[Curves] = []
        for contacts in self.contacts_at_pressures:
            same = _same_contacts(contacts.points[0], "delta")
            tables.append(self._tabulated(self.law.over_delta, same))
        if not tables:
            return None
        return functools.reduce(merged, tables)

    def _tabulated(self, table: Curves, contacts: SolvedLoads) -> Curves:
        """Tabulate contacts like `table`, a table of the law.

        Contacts with a value that is not finite are left out, and those in full contact unless the
        closure has the compression of a layer.
        """
        if not contacts.loads.size:
            nowhere = np.zeros(table.at.size, dtype=bool)
            return table.chosen(nowhere)  # an empty table
        order = self.solver.order
        between = tabulated(
            against=table.against,
            at=contacts.loads,
            parts=contacts.points,
            level=order.coverage,
            at_rest=table.at_rest,
        )
        between = _with_conductance(between, order, self.law.bodies)
        below = between.curves[AREA.in_laws].value < 100
        if compliance_in_law(order, self.law.bodies) > 0:
            below = np.ones(between.at.size, dtype=bool)
        for curve in between.curves.values():
            below &= np.isfinite(curve.value)
        return between.chosen(below)
