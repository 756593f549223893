"""The solver of a contact law: contacts of all its surfaces under the same loads."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from bem import Budget, Contact, Surface
from gen.arrays import Values
from gen.doubts import Pressed, contact_doubts
from gen.law.accuracy import with_bands
from gen.law.curves import APART, Points
from gen.law.layer import compliance_in_law, with_compression
from gen.law.order import Load, Order
from gen.law.surfaces import LawSurface
from gen.maps.contacts import prepared_surface, solve_loads
from gen.material import Bodies
from gen.quantities import AREA, CONTINUUM, LOADS, MEAN_GAP
from gen.runtime.errors import InputError, input_errors
from gen.runtime.terminal import RunProgress

LONG = 10**6
"""Smallest number of nodes of all contacts together for which the progress is printed."""

PASSES: Mapping[Load, str] = {"delta": "over Delta", "pressure": "over pressure"}
"""Name of a pass in the progress; a population is solved in one pass for each table."""

BETWEEN: Mapping[Load, str] = {
    "delta": "between the Deltas",
    "pressure": "between the pressures",
}
"""Name of the contacts between the loads of a table, as the display of the progress has it."""

NOT_SOLVED = "warning: not solved"
"""Beginning of a remark on loads that are left out of a law."""


@dataclass(frozen=True, eq=False)
class SolvedContact:
    """One contact of a surface under one load, or the reason why it was not solved."""

    quantities: dict[str, float]  # by names in laws; empty if the contact was not solved
    fault: str = ""  # why it was not solved; "" if it was
    grid_error: float = np.nan  # of the area in the continuum [%]; NaN if not resolved
    # Why the grid does not resolve it; "" if the grid does, or is not judged.
    unresolved: str = ""
    # Delta, pressure and nodes, from which warnings follow; None if it was not solved.
    pressed: Pressed | None = None
    # Errors that were asked for; None if none was, or if it was not solved.
    budget: Budget | None = None


@dataclass(frozen=True, eq=False)
class SolvedSurface:
    """Contacts of one surface under k loads."""

    name: str
    points: Points  # NaN at loads that were not solved
    faults: tuple[str, ...]  # for each load why it was not solved; "" where it was
    doubts: list[str]  # the first reason to distrust the contacts, if there is one
    remarks: list[str]  # a line on loads at which the grid does not resolve the contact


@dataclass(frozen=True, eq=False)
class SolvedLoads:
    """Contacts of all surfaces of a law under the same loads."""

    loads: Values  # ascending loads that were solved on every surface [um or MPa], (k,)
    points: list[Points]  # of each surface, k contacts each
    warnings: list[str] = field(default_factory=list)  # reasons to distrust the contacts
    remarks: list[str] = field(default_factory=list)  # loads that were left out

    @property
    def begins_in_full_contact(self) -> bool:
        """True if the first load brings a surface into full contact, or no load was solved."""
        if not self.loads.size:
            return True
        return any(bool(part.values[AREA.in_laws][0] >= 100) for part in self.points)


@dataclass(frozen=True, eq=False)
class PossibleLoads:
    """Loads that are below full contact, and a remark if some were not."""

    loads: Values  # ascending [um or MPa]
    remarks: list[str]  # one line or none
    full_contact: float = np.inf  # smallest displacement that was left out [um]


class LastPrepared:
    """The surface that was last prepared for contacts within errors.

    The surface of a law of one is solved at its loads and then many times between them, while many
    prepared surfaces would take much memory.
    """

    def __init__(self) -> None:
        self.surface: LawSurface | None = None
        self.prepared: Surface | None = None

    def of(self, surface: LawSurface, settings: Mapping[str, Any]) -> Surface:
        """Return a prepared surface, and prepare it unless it is the last one.

        Parameters
        ----------
        surface : LawSurface
            A surface.
        settings : mapping
            Settings of `bem.Surface` with their values, the same for all calls.

        Returns
        -------
        bem.Surface
            The prepared surface.

        Raises
        ------
        InputError
            If a number is not allowed, or memory is too short.
        """
        if self.prepared is None or self.surface is not surface:
            self.prepared = prepared_surface(surface, **settings)
            self.surface = surface
        return self.prepared


@dataclass(frozen=True, eq=False)
class LawSolver:
    """The solver of all surfaces of a law, under one load after another."""

    order: Order
    surfaces: Sequence[LawSurface]
    bodies: Bodies
    # False to leave out the error of the grid even if the order asks for it. The error is computed
    # on the first surface alone.
    judges: bool = True
    # What the progress counts, by the kind of the loads.
    passes: Mapping[Load, str] = field(default_factory=lambda: PASSES)
    last_prepared: LastPrepared = field(default_factory=LastPrepared)

    @property
    def has_one_surface(self) -> bool:
        """True if the law is that of one surface, whose contacts serve both tables."""
        return len(self.surfaces) == 1

    def for_loads_between(self, order: Order) -> Self:
        """Return a solver of contacts between the loads of a law.

        The error of the grid is not judged there: it has been judged at the loads.

        Parameters
        ----------
        order : Order
            The request, with the quantities of these contacts.

        Returns
        -------
        LawSolver
            The solver, whose progress names these contacts.
        """
        return replace(self, order=order, judges=False, passes=BETWEEN)

    def solve(self, load: Load, loads: Values) -> SolvedLoads:
        """Solve every surface under loads that the user gave, and print the progress if it is long.

        Two kinds of loads are left out with a remark: loads that are not solved on every surface,
        and displacements that press an elastic patch without edges flat (full contact).

        Parameters
        ----------
        load : {"delta", "pressure"}
            Kind of the loads.
        loads : ndarray, shape (k,)
            Ascending loads, one or more [um or MPa].

        Returns
        -------
        SolvedLoads
            Contacts under at least one load.

        Raises
        ------
        InputError
            If a load is not allowed, if no load is solved on every surface, or if a quantity of a
            contact overflows.
        """
        possible = self._below_full_contact(load, loads)
        if not possible.loads.size:
            raise InputError(
                f"full contact from {possible.full_contact:.4g} um on: give smaller loads"
            )
        return self._solve(load, possible)

    def solve_some(
        self, load: Load, loads: Values, like: Sequence[Points] = ()
    ) -> SolvedLoads:
        """Solve every surface as `solve` does, and return no contacts where `solve` would fail.

        Where `solve` would raise InputError, the result has contacts under no load, with the reason
        as a remark. So one load that is not allowed leaves out all loads.

        Parameters
        ----------
        load : {"delta", "pressure"}
            Kind of the loads.
        loads : ndarray, shape (k,)
            Ascending loads [um or MPa].
        like : sequence of Points
            Earlier points of each surface. They give the names of the quantities of the result if
            no load is solved.

        Returns
        -------
        SolvedLoads
            Contacts under all or some of the loads, or under none. Under none, `points` has an
            element for each element of `like`: without `like` it is the empty list.
        """
        possible = self._below_full_contact(load, loads)
        remarks = possible.remarks
        if possible.loads.size:
            try:
                return self._solve(load, possible)
            except InputError as error:
                # This remark replaces the one on full contact: now no load is left.
                remarks = [f"{NOT_SOLVED}, left out: {error}"]
        nowhere = np.empty(0, dtype=np.int64)
        points = [part.chosen(nowhere) for part in like]
        return SolvedLoads(loads=np.empty(0), points=points, remarks=remarks)

    def _below_full_contact(self, load: Load, loads: Values) -> PossibleLoads:
        """Leave out displacements at which an elastic patch without edges is in full contact.

        Such a patch is in full contact at a Delta that is its mean gap at first touch, and the
        solver has no solution beyond, unless a uniform pressure displaces the bodies.
        """
        if load != "delta" or self.bodies.hardness is not None:
            return PossibleLoads(loads, remarks=[])
        with input_errors():  # from a body that does not go with a surface
            gaps = [
                surface.at_rest()[MEAN_GAP.in_laws]
                for surface in self.surfaces
                if surface.posed(self.bodies).has_most_delta
            ]
        full = min(gaps, default=np.inf)
        possible = loads[loads < (1 - APART) * full]
        if possible.size == loads.size:
            return PossibleLoads(loads, remarks=[])
        return PossibleLoads(possible, remarks=[ends_below(full)], full_contact=full)

    def _solve(self, load: Load, possible: PossibleLoads) -> SolvedLoads:
        """Solve every surface under loads, of which there is one or more; see `solve`."""
        loads = possible.loads
        judges = self.order.grid_error and self.judges
        solved: list[SolvedSurface] = []
        with self._progress(load, loads) as progress:
            for number, surface in enumerate(self.surfaces):
                judged = judges and number == 0
                contacts = self._contacts(surface, load, loads, judged=judged)
                counted = list(_counted(contacts, progress))
                solved.append(
                    self._solved_surface(surface, load, loads, counted, judged=judged)
                )
        left_out = [_left_out(solved, place) for place in range(loads.size)]
        remarks = [line for line in left_out if line]
        kept = np.array([not line for line in left_out])
        if not kept.any():
            raise InputError(f"no load was solved on every surface; {remarks[0]}")
        return SolvedLoads(
            loads=loads[kept],
            points=[surface.points.chosen(kept) for surface in solved],
            warnings=_warnings(solved),
            remarks=[*possible.remarks, *remarks],
        )

    def _progress(
        self, load: Load, loads: Values
    ) -> AbstractContextManager[RunProgress | None]:
        """Return a context with the progress of all contacts, with None if they are soon solved."""
        contacts = len(self.surfaces) * loads.size
        if contacts * self.surfaces[0].heights.size < LONG:
            return nullcontext()
        return RunProgress(contacts, f"contacts {self.passes[load]}")

    def _contacts(
        self, surface: LawSurface, load: Load, loads: Values, *, judged: bool
    ) -> Iterator[SolvedContact]:
        """Solve a surface and yield its contact at each load, with the grid's error if `judged`.

        InputError is raised if a quantity of a contact overflows.
        """
        settings = {
            **self.bodies.elastic_settings,
            "hardness": self.bodies.hardness,
            **surface.settings,
        }
        prepared: Surface | None = None
        if self.order.errors is not None:
            prepared = self.last_prepared.of(surface, settings)
        solutions = solve_loads(
            surface,
            load,
            loads.tolist(),
            errors=self.order.errors,
            prepared=prepared,
            **settings,
        )
        for solution in solutions:
            contact = solution.contact
            if contact is None:
                yield SolvedContact(quantities={}, fault=solution.fault)
                continue
            try:
                quantities = {
                    quantity.in_laws: quantity.in_law(contact, self.order.media)
                    for quantity in self.order.quantities
                }
            except ArithmeticError as error:
                raise InputError(f"{surface.name}: {error}") from None
            yield _solved_contact(contact, quantities, judged=judged)

    def _solved_surface(
        self,
        surface: LawSurface,
        load: Load,
        loads: Values,
        contacts: Sequence[SolvedContact],
        *,
        judged: bool,
    ) -> SolvedSurface:
        """Put the contacts of one surface into arrays, with its first doubt and remarks.

        At least one of the contacts is solved. If `judged`, the area in the continuum has a band:
        the area minus and plus the error of the grid. If errors were asked for, the bands are these
        errors instead.
        """
        pressed = [contact.pressed for contact in contacts if contact.pressed is not None]
        doubts = contact_doubts(surface.heights, self.bodies, load, pressed)
        points = _points(contacts)
        remarks: list[str] = []
        if judged:
            points = _with_grid_error(points, contacts)
            remarks = _unresolved_remark(surface, load, loads, contacts)
        if self.order.errors is not None:
            points = with_bands(points, self.order.errors, load)
        points = with_compression(points, compliance_in_law(self.order, self.bodies))
        return SolvedSurface(
            name=surface.name,
            points=points,
            faults=tuple(contact.fault for contact in contacts),
            doubts=doubts[:1],
            remarks=remarks,
        )


def ends_below(full: float) -> str:
    """Say that the table against Delta ends at full contact.

    Parameters
    ----------
    full : float
        Displacement of full contact [um].

    Returns
    -------
    str
        One line.
    """
    return f"full contact from {full:.4g} um on: the table against delta_um ends below it"


def _counted(
    contacts: Iterator[SolvedContact], progress: RunProgress | None
) -> Iterator[SolvedContact]:
    """Yield contacts, and count each of them in the progress if there is one."""
    for contact in contacts:
        yield contact
        if progress is not None:
            is_unsolved = contact.pressed is None
            progress.advance(rows=1, failed=int(is_unsolved))


def _left_out(solved: Sequence[SolvedSurface], place: int) -> str:
    """Say on how many surfaces the load at a place was not solved, and why on the first of them.

    The line is "" if the load was solved on all surfaces.
    """
    faults = [
        f"{surface.name}: {surface.faults[place]}"
        for surface in solved
        if surface.faults[place]
    ]
    if not faults:
        return ""
    where = ""
    if len(solved) > 1:
        where = f" on {len(faults)} of {len(solved)} surfaces"
    return f"{NOT_SOLVED}{where}, left out: {faults[0]}"


def _warnings(solved: Sequence[SolvedSurface]) -> list[str]:
    """Return a warning with the first doubt and the number of doubtful surfaces, then the remarks.

    There is no warning without a doubt. The remarks are about the error of the grid.
    """
    doubts = [doubt for surface in solved for doubt in surface.doubts]
    remarks = [remark for surface in solved for remark in surface.remarks]
    if not doubts:
        return remarks
    share = ""
    if len(solved) > 1:
        share = f"{len(doubts)} of {len(solved)} surfaces, the first: "
    return [f"warning: {share}{doubts[0]}", *remarks]


def _solved_contact(
    contact: Contact, quantities: dict[str, float], *, judged: bool
) -> SolvedContact:
    """Return a contact with its quantities and, if it is judged, the error of the grid."""
    pressed = Pressed(
        delta=contact.delta,
        largest_pressure=contact.largest_pressure,
        is_full=contact.contact_nodes == contact.pressure.size,
    )
    solved = SolvedContact(quantities, pressed=pressed, budget=contact.budget)
    if not judged:
        return solved
    error = contact.grid_error()
    if not error.verdicts["area"]:
        return replace(solved, unresolved=error.reason)
    return replace(solved, grid_error=error.area_percent)


def _points(contacts: Sequence[SolvedContact]) -> Points:
    """Put the quantities of the contacts of one surface into arrays, NaN where one was not solved.

    At least one contact was solved: it names the quantities.
    """
    names = next(contact.quantities for contact in contacts if contact.quantities)
    values = {
        name: np.array([contact.quantities.get(name, np.nan) for contact in contacts])
        for name in names
    }
    budgets: tuple[Budget | None, ...] = ()
    if any(contact.budget is not None for contact in contacts):
        budgets = tuple(contact.budget for contact in contacts)
    return Points(values, reasons=("",) * len(contacts), budgets=budgets)


def _with_grid_error(points: Points, contacts: Sequence[SolvedContact]) -> Points:
    """Return points whose area in the continuum has a band, and why the grid does not resolve it.

    The band is the area minus and plus the error of the grid, and NaN where the grid does not
    resolve the contact. The contacts are in the order of the points.
    """
    name = CONTINUUM.in_laws
    area = points.values[name]
    error = np.array([contact.grid_error for contact in contacts])
    return replace(
        points,
        low={name: np.clip(area - error, *CONTINUUM.bounds)},
        high={name: np.clip(area + error, *CONTINUUM.bounds)},
        unresolved=tuple(contact.unresolved for contact in contacts),
    )


def _unresolved_remark(
    surface: LawSurface, load: Load, loads: Values, contacts: Sequence[SolvedContact]
) -> list[str]:
    """Return a list with a line on the loads at which the grid does not resolve the contact.

    The list is empty if the grid resolves the contact at all loads.
    """
    reasons = [contact.unresolved for contact in contacts]
    unresolved = loads[[bool(reason) for reason in reasons]]
    if not unresolved.size:
        return []
    up_to = f"up to {unresolved[-1]:.4g} {LOADS[load].unit}"
    where = f"at {unresolved.size} of {loads.size} loads, {up_to}"
    first = next(reason for reason in reasons if reason)
    return [
        f"{surface.name}: the area is that of the grid {where}; at the first, {first}"
    ]
