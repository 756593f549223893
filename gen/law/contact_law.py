"""Contact laws: closure, area, mean gap and conductance against Delta and nominal pressure.

A law is that of one surface, or the mean over the surfaces of a population with the band of a
further one, at given Delta and at given pressure. The patch is a piece of a larger interface, so
that it is continued by its mirror images unless it is told otherwise: what a free patch gives way
as a whole belongs to the mesh of a finite-element model, not to its interface.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from bem.contact import mean_conductivity
from bem.problem import Boundary
from gen.arrays import Values
from gen.law.bands import assumption, described
from gen.law.curves import (
    APART,
    APERTURES,
    CONTINUUM,
    GAS,
    JOINT,
    NAMES,
    STIFFNESS,
    UNITS,
    Curves,
    Gas,
    Points,
    held,
    risen,
    tabulated,
)
from gen.law.surfaces import LawSurface, LawSurfaces, Load, read_subjects
from gen.maps.bodies import Opposite
from gen.maps.contacts import contact_warnings, solve_loads
from gen.maps.settings import Reading
from gen.material import Bodies, loads_from
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress, shortened

ARGUMENTS: dict[Load, str] = {"delta": "delta_um", "pressure": "pressure_MPa"}
"""Quantity of the arguments of a table by the kind of load."""

LONG = 10**6  # nodes of all contacts together from which on a law shows progress
FEW = 10  # nodes in contact below which a law shows the grid rather than the surface

USUAL_LEVEL = 0.9
"""Coverage of a band where nobody asks for another one."""

STEPS = 40
"""Number of displacements over the range of a training, where no load is given."""

Solved = tuple[Values, list[Points], list[str]]
"""Loads that were solved on all surfaces, the points of each surface, and warnings."""

Tables = tuple[Curves, Curves, list[str]]
"""Tables against Delta and against pressure, and remarks about them."""


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
    hardness: float | None = None  # of the softer body [MPa]; by default the scene's only one
    boundary: Boundary | None = None  # of the patches; None for the usual one
    conductivities: tuple[float, float] | None = None  # of both bodies [W/(m K)]
    gas: Gas | None = None  # in the gap
    stiffness: bool = False  # whether it is asked for; a conductance brings it along
    grid_error: bool = False  # whether the area in the continuum is, with the error of the grid
    flow: bool = False  # whether the hydraulic apertures of the gap are
    reading: Reading = field(default_factory=Reading)  # how files are read
    opposite: Opposite | None = None  # second rough body against surfaces from files
    command: str = ""  # command line, for the record

    @property
    def coverage(self) -> float:
        """Coverage of the band."""
        return USUAL_LEVEL if self.level is None else self.level

    def loads(self) -> tuple[Values | None, Values | None]:
        """Return ascending displacements [um] and pressures [MPa], each None if not given."""
        deltas = np.unique(loads_from("delta", self.delta)) if self.delta else None
        pressures = np.unique(loads_from("pressure", self.pressure)) if self.pressure else None
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
    title: str  # names of the surfaces, with those of the second bodies, on one line
    names: tuple[str, ...]  # of the surfaces one by one, in the order of `Curve.surfaces`


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
    bodies = Bodies(e_star, hardness, known=order.e_star is not None)
    lost: list[str] = []  # lines about loads that were not solved on every surface
    under = partial(_solved, order, subjects.surfaces, bodies, lost)
    asked: dict[Load, Values | None] = {"delta": deltas, "pressure": pressures}
    solved = {load: under(load, loads) for load, loads in asked.items() if loads is not None}
    over_delta, over_pressure = _tables(order, subjects.surfaces, bodies, solved, under)
    lines = [line for _, _, said in solved.values() for line in said]
    tables = over_delta, over_pressure, list(dict.fromkeys([*lines, *lost]))
    one = "none, one surface was solved"
    if order.grid_error and any(each.curves[CONTINUUM].banded.any() for each in tables[:2]):
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
    doubts += [*subjects.doubts, *(f"warning: {each}" for each in bodies.doubts)]
    notes = [how, *filter(None, [assumed]), *doubts, *remarks, *full, *also_full]
    nodes = min(each.heights.size for each in subjects.surfaces)
    touching = over_pressure.curves["area_percent"].value * nodes / 100
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
        names=tuple(each.name for each in subjects.surfaces),
    )


def _tables(
    order: Order,
    surfaces: Sequence[LawSurface],
    bodies: Bodies,
    solved: Mapping[Load, Solved],
    under: Callable[..., Solved],
) -> tuple[Curves, Curves]:
    """Tabulate what was solved against Delta and against pressure; solve further if need be."""
    made: dict[Load, Curves] = {}
    rests = [surface.at_rest(order) for surface in surfaces]
    rest = {name: float(np.mean([each[name] for each in rests])) for name in rests[0]}
    for load, argument in ARGUMENTS.items():
        loads, parts, _ = solved.get(load) or next(iter(solved.values()))
        if load not in solved and len(surfaces) > 1:  # solved at the means of the other one's
            means = np.sort(np.mean([part.values[argument] for part in parts], axis=0))
            means = means[risen(means)]
            if load == "pressure" and bodies.hardness is not None:
                means = means[means < (1 - APART) * bodies.hardness]
                if not means.size:
                    raise InputError(
                        f"every node yields: the pressure is the hardness, {bodies.hardness:.4g}"
                        " MPa, at all displacements: give smaller ones"
                    )
            loads, parts, _ = under(load, means)
        elif load not in solved:
            order_of = np.argsort(parts[0].values[argument], kind="stable")
            rising = order_of[risen(parts[0].values[argument][order_of])]
            parts = [parts[0].chosen(rising)]
            loads = parts[0].values[argument]
        if load == "delta" or load not in solved:  # pressures that were given stay alone
            parts = [part.from_rest(each) for part, each in zip(parts, rests, strict=True)]
            loads = np.append(0.0, loads)
        parts = [  # contacts turn back only within the tolerance of the solver
            replace(part, values={name: held(name, each) for name, each in part.values.items()})
            for part in parts
        ]
        made[load] = tabulated(argument, loads, parts, order.coverage, rest)
    return made["delta"], made["pressure"]


def _solved(
    order: Order,
    surfaces: Sequence[LawSurface],
    bodies: Bodies,
    lost: list[str],
    load: Load,
    loads: Values,
) -> Solved:
    """Solve every surface; return the loads solved on all, the points, and warnings."""
    if load == "delta" and bodies.hardness is None:
        loads = _below_full_contact(loads, surfaces, lost)
    points, faults_of, warned, notes = list[Points](), [], list[str](), list[str]()
    many, work = len(surfaces) > 1, len(surfaces) * loads.size
    long = work * surfaces[0].heights.size >= LONG
    with RunProgress(work, "contacts") if long else nullcontext() as told:
        for surface in surfaces:
            judged, found = order.grid_error and not points, []
            for each in _contacts(order, surface, bodies, load, loads, judged=judged):
                found.append(each)
                if told is not None:
                    told.advance(1, int(not each[0]))
            rows, bars, faults, doubts, pressed = zip(*found, strict=True)
            names = next(filter(None, rows))
            values = {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
            low, high = (
                {CONTINUUM: np.clip(values[CONTINUUM] + sign * np.array(bars), 0, 100)}
                if judged  # the band is the error of the grid
                else {}
                for sign in (-1, 1)
            )
            points.append(Points(values, low, high, ("",) * loads.size))
            faults_of.append(faults)
            if judged and (doubted := loads[np.array(doubts) != ""]).size:
                up_to = f"{doubted[-1]:.4g} {UNITS[ARGUMENTS[load]]}"
                at = f"{doubted.size} of {loads.size} loads, up to {up_to}; at the first"
                why = next(filter(None, doubts))
                notes.append(f"{surface.name}: the area is that of the grid at {at}, {why}")
            solved = [each for each in pressed if each]
            warned += list(contact_warnings(surface, bodies, load, solved))[:1]
    kept, before = np.ones(loads.size, dtype=bool), len(lost)
    for place, faults in enumerate(zip(*faults_of, strict=True)):
        failed = [f"{each.name}: {why}" for each, why in zip(surfaces, faults, strict=True) if why]
        if failed:
            kept[place] = False
            on = f" on {len(failed)} of {len(points)} surfaces" if many else ""
            lost.append(f"warning: not solved{on}, left out: {failed[0]}")
    if not kept.any():
        raise InputError(f"no load was solved on every surface; {lost[before]}")
    of = f"{len(warned)} of {len(points)} surfaces, the first: " if many else ""
    lines = [f"warning: {of}{line}" for line in warned[:1]]
    return loads[kept], [each.chosen(kept) for each in points], [*lines, *notes]


def _below_full_contact(loads: Values, surfaces: Sequence[LawSurface], lost: list[str]) -> Values:
    """Return the displacements [um] below full contact of elastic patches without edges."""
    edgeless = [each for each in surfaces if each.boundary != "free"]
    full = min((each.at_rest()["mean_gap_um"] for each in edgeless), default=np.inf)
    possible, beyond = loads[loads < (1 - APART) * full], f"full contact from {full:.4g} um on"
    if not possible.size:
        raise InputError(f"{beyond}: give smaller loads")
    if possible.size < loads.size:
        lost.append(f"{beyond}: the table against delta_um ends below it")
    return possible


def _contacts(
    order: Order, surface: LawSurface, bodies: Bodies, load: Load, loads: Values, *, judged: bool
) -> Iterator[tuple[dict[str, float], float, str, str, tuple[float, float, int] | None]]:
    """Yield quantities, the error of the grid, two faults, and what warnings take at each load."""
    settings = {"modulus": bodies.e_star, "hardness": bodies.hardness, **surface.settings}
    compliance = surface.patch_compliance(bodies.e_star)
    nominal = surface.nominal
    for contact, fault in solve_loads(surface, load, loads.tolist(), **settings):
        if contact is None:
            yield {}, np.nan, fault, "", None
            continue
        pressure = contact.force / nominal
        gap = max(contact.mean_gap, 0.0)  # below 0 by rounding alone
        closure = max(contact.delta - compliance * pressure, 0.0)
        known = contact.delta, contact.area_percent, contact.force, gap, pressure, closure
        row = dict(zip(NAMES, known, strict=True))
        try:
            if order.grid_error:
                row[CONTINUUM] = contact.continuum_area_percent
            if order.stiffness or order.conductivities:
                row[STIFFNESS] = contact.interface_stiffness / nominal
            if order.gas:
                # a node in contact has a gap of 0 within the tolerance of the solver alone
                open_gap = np.where(contact.pressure > 0, 0.0, contact.gap)
                row[GAS] = order.gas.conductance(open_gap)
            if order.gas and order.conductivities:
                spots = mean_conductivity(*order.conductivities) / bodies.e_star / nominal
                row[JOINT] = spots * contact.interface_stiffness + row[GAS]
            if order.flow:
                apertures = contact.flow(0).aperture, contact.flow(1).aperture
                row |= dict(zip(APERTURES, apertures, strict=True))
        except ArithmeticError as error:
            raise InputError(f"{surface.name}: {error}") from None
        grid = contact.grid_error() if judged else None
        bar = grid.area_percent if grid and grid.resolved else np.nan
        doubt = grid.reason if grid and not grid.resolved else ""
        pressed = contact.delta, contact.largest_pressure, contact.contact_nodes
        yield row, bar, "", doubt, pressed
