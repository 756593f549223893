"""Contact laws: closure, area, mean gap and conductance against Delta and nominal pressure.

A law is that of one surface, or the mean and quantiles over the surfaces of a population, at given
Delta and at given pressure. The patch is a piece of a larger interface, so that it is continued by
its mirror images unless it is told otherwise: what a free patch gives way as a whole belongs to the
mesh of a finite-element model, not to its interface.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from bem.problem import Boundary
from gen.arrays import Values
from gen.law import solved
from gen.law.curves import Curves, with_conductance
from gen.law.surfaces import LawSurfaces, read_subjects
from gen.maps.bodies import Opposite
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.numbers import MAGNITUDES, magnitude, shown, values_from
from gen.runtime.terminal import shortened

FEW = 10
"""Nodes in contact below which a law shows the grid rather than the surface."""

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
    conductivities: tuple[float, float] | None = (
        None  # of both bodies, for the conductance [W/(m K)]
    )
    stiffness: bool = False  # whether it is asked for; a conductance brings it along
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
    tables = solved.tables(subjects.surfaces, *loads, order.level, bodies, stiffness=stiffness)
    one = "none, one surface was solved"
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
