"""What a contact tells: one record for each quantity, which everything else takes from here.

A record says what a quantity is: its name, unit and words, its least and largest value, the powers
of heights, lengths and E* that it scales with, how it is read off a solved contact and what that
costs, what it is at first touch and at full contact, and how it changes with the load. From these
records come the columns of databases and the keys of `[store]`, the rows of `gen contact`, the
curves of contact laws, the scales of surrogates, and the outputs of functions and of the server.
A new quantity is one more record in `QUANTITIES`.

Lengths are in um, pressures and moduli in MPa, forces in uN. A contact of heights z, sides L and
modulus E* is the same as one of a z, b L and c E* under a Delta of a times its own: displacements
are proportional to p L / E*, so that pressures scale with c a / b, and forces with a b c. A
hardness has to scale as pressures do (K. L. Johnson, Contact Mechanics, 1985, section 3.3).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:
    from bem import Contact
    from bem.problem import Problem
    from gen.material import Gas

SHARE, AMOUNT = (
    (0.0, 100.0),
    (0.0, math.inf),
)  # bounds of shares in percent, and of amounts
SIDES = (1, 2)  # codes of opposite sides along x and y; that of both is their sum

Cost = Literal[
    "", "a linear solve", "a solve on a coarser grid", "the flow through the gap"
]
Trend = Literal["rises", "falls", "turns"]


class Powers(NamedTuple):
    """Powers of heights, lengths and E* that a quantity is proportional to."""

    heights: int
    lengths: int
    modulus: int


PURE = Powers(0, 0, 0)
LIKE_HEIGHTS = Powers(1, 0, 0)
LIKE_LENGTHS = Powers(0, 1, 0)
LIKE_AREAS = Powers(0, 2, 0)
LIKE_PRESSURES = Powers(1, -1, 1)
LIKE_FORCES = Powers(1, 1, 1)
LIKE_STIFFNESSES = Powers(0, 1, 1)


@dataclass(frozen=True)
class Media:
    """What conducts through an interface, for the quantities that ask for it."""

    conductivities: tuple[float, float] | None = None  # of both bodies [W/(m K)]
    gas: Gas | None = None  # in the gap


BODIES_ALONE = Media()


@dataclass(frozen=True)
class InLaw:
    """How contact laws have a quantity."""

    short: str  # name in the functions of a C header
    trend: Trend = "rises"  # with the load; a quantity that turns may do both
    # Unit of the quantity over the nominal area, where laws have it so; "" where they do not.
    per_area: str = ""
    factor: float = 1.0  # of that unit, in the quantity's own over um2
    noun: str = ""  # what the axes of laws call it; the noun of the quantity if left out
    key: str = ""  # name of the column, with its unit; that of the quantity if left out
    # Whether functions of a C header go on with its last slope beyond the last point of a table.
    goes_on: bool = False
    # Whether it follows from predicted quantities, and misses by more than these do.
    derived: bool = False


@dataclass(frozen=True)
class Quantity:
    """One quantity that a contact tells.

    Attributes
    ----------
    name : str
        Name in Python, of the column of databases, and of the key of `[store]`.
    unit : str
        Unit of the column; "1" for pure numbers.
    words : str
        What it is, in databases and exports.
    read : callable
        Reads the value off a solved contact, with the media of its interface.
    powers : Powers or None
        Powers of heights, lengths and E* that it scales with; None if it scales with none.
    noun : str
        What people call it, in `gen contact` and on the axes of pictures.
    remark : str
        What `gen contact` prints behind the unit.
    key : str
        Name with the unit, in tables; `NAME_UNIT` if left out.
    stored : str
        When databases have it: "always", "hardness" for bodies that yield, "asked" with its key in
        `[store]`; "" if they never do.
    early : bool
        Whether scenes write the key of `[store]` also where it is off, as the first keys did.
    option : str
        What shows it in `gen contact`: "always", a field of `gen.maps.contacts.AnswerOptions`, or
        "" if nothing does.
    cost : str
        What is computed for it beside the contact; "" for nothing.
    needs_hardness : bool
        Whether only bodies that yield have it.
    dtype : str
        Type of the column, in numpy's notation.
    bounds : tuple of float
        Least and largest value.
    paper_range : tuple of float or None
        Range in the paper's database, if the paper states it.
    per_node : bool
        Whether it is a field of shape (nx, ny).
    code : bool
        Whether its numbers stand for words, so that they are neither learnt nor drawn as a curve.
    counts_nodes : bool
        Whether it is the number of nodes in contact or its share, which begins at 0 with an
        infinite slope: surrogates learn its square root.
    single : bool
        Whether people see it of a single load alone, as tables of several would not fit.
    at_rest : callable or None
        Value at first touch of a posed problem; None where it is 0.
    at_full : callable or None
        Value at full contact of a posed problem; None where it depends on the load.
    law : InLaw or None
        How laws have it; None if they never do.
    """

    name: str
    unit: str
    words: str
    read: Callable[[Contact, Media], Any]
    powers: Powers | None
    noun: str = ""
    remark: str = ""
    key: str = ""
    stored: Literal["always", "hardness", "asked", ""] = ""
    early: bool = False
    option: str = ""
    cost: Cost = ""
    needs_hardness: bool = False
    dtype: str = "f8"
    bounds: tuple[float, float] = AMOUNT
    paper_range: tuple[float, float] | None = None
    per_node: bool = False
    code: bool = False
    counts_nodes: bool = False
    single: bool = False
    at_rest: Callable[[Problem, Media], float] | None = None
    at_full: Callable[[Problem], float] | None = None
    law: InLaw | None = None

    def of(self, contact: Contact, media: Media = BODIES_ALONE) -> Any:
        """Read the quantity off a contact.

        Parameters
        ----------
        contact : bem.Contact
            A solved contact.
        media : Media
            Conductivities and gas, for the conductances.

        Returns
        -------
        float, int or ndarray
            The value in `unit`; shape (nx, ny) for a field.

        Raises
        ------
        ArithmeticError
            If a linear solve, or the flow through the gap, does not converge.
        """
        return self.read(contact, media)

    def in_law(self, contact: Contact, media: Media = BODIES_ALONE) -> float:
        """Read the quantity off a contact as laws have it: within its bounds, and per area."""
        low, high = self.bounds  # left by rounding alone
        value = min(max(float(self.of(contact, media)), low), high)
        if self.law is not None and self.law.per_area:
            return self.law.factor * value / nominal_area(contact)
        return value

    def resting(self, problem: Problem, media: Media = BODIES_ALONE) -> float:
        """Return the value at first touch of a problem."""
        return 0.0 if self.at_rest is None else self.at_rest(problem, media)

    def is_infinite_at_full_contact(self, problem: Problem) -> bool:
        """Return whether full contact of a problem makes it infinite."""
        return self.at_full is not None and math.isinf(self.at_full(problem))

    @property
    def diverges(self) -> bool:
        """Whether full contact may make it infinite, depending on the problem."""
        return self.at_full in DIVERGING

    @property
    def in_tables(self) -> str:
        """Name of its column in tables of single contacts, with the unit."""
        return self.key or _with_unit(self.name, self.unit)

    @property
    def in_laws(self) -> str:
        """Name of its column in the tables of laws, with the unit."""
        return (self.law.key if self.law else "") or self.in_tables

    @property
    def law_unit(self) -> str:
        """Unit in laws."""
        return (self.law.per_area if self.law else "") or self.unit

    @property
    def label(self) -> str:
        """Label of an axis of a law's picture, with the unit as it is printed."""
        noun = (self.law.noun if self.law else "") or self.noun
        return f"{noun.replace('Delta', 'Δ')} [{typographic(self.law_unit)}]"


def _with_unit(name: str, unit: str) -> str:
    """Append a unit to a name, as um to mean_gap; names that end in percent have theirs."""
    if unit in {"1", "%"}:
        return name
    return f"{name}_{unit.replace('/', '_per_')}"


def typographic(unit: str) -> str:
    """Write a unit with its signs, for pictures: um as µm, mm2 as mm²."""
    return re.sub(r"m2\b", "m²", re.sub(r"\bu(?=[mN])", "µ", unit))


def nominal_area(contact: Contact) -> float:
    """Return the area of the cells of all nodes, over which a mean pressure is taken [um2]."""
    return contact.pressure.size * math.prod(contact.problem.spacing)


# Readings of a contact that are more than one of its properties.


def _nominal_pressure(contact: Contact, _: Media) -> float:
    return contact.force / nominal_area(contact)


def _closure(contact: Contact, media: Media) -> float:
    """Take what the half-space behind a free patch gives way out of Delta."""
    compliance = patch_compliance(contact.problem)
    return max(contact.delta - compliance * _nominal_pressure(contact, media), 0.0)


def patch_compliance(problem: Problem) -> float:
    """Compute how far a flat punch that fills the patch sinks per nominal pressure.

    Delta on a rigid far field includes it, and so does the mesh of a finite-element model. A patch
    without edges has none, and a compliant far field has taken it out of Delta.

    Parameters
    ----------
    problem : bem.problem.Problem
        A posed problem; its heights and its load do not matter.

    Returns
    -------
    float
        Compliance [um / MPa].
    """
    if problem.boundary != "free" or problem.far_field != "rigid":
        return 0.0
    from bem.derived.stiffness import patch_stiffness

    nominal = problem.heights.size * math.prod(problem.spacing)
    return nominal / patch_stiffness(problem)


def _sides_connected(connects: tuple[bool, bool]) -> int:
    return sum(code for code, along in zip(SIDES, connects, strict=True) if along)


def _largest_spot(contact: Contact, _: Media) -> float:
    return float(contact.spots.areas[0]) if contact.spots.number else 0.0


def _mean_spot(contact: Contact, _: Media) -> float:
    return float(contact.spots.areas.mean()) if contact.spots.number else 0.0


def _conductance(stiffness: float, contact: Contact, media: Media) -> float:
    """Return k S / E* of both bodies (Barber 2003) [W/(m K) um]."""
    from bem.contact import mean_conductivity

    if media.conductivities is None:
        raise ValueError("a conductance needs the conductivities of both bodies")
    return mean_conductivity(*media.conductivities) / contact.problem.modulus * stiffness


def _gas_conductance(contact: Contact, media: Media) -> float:
    """Return the conductance of a gas where the gap is open [W/(mm2 K)]."""
    import numpy as np

    if media.gas is None:
        raise ValueError("the conductance of a gas needs a gas")
    # A node in contact has a gap of 0 within the tolerance of the solver alone.
    return media.gas.conductance(np.where(contact.pressure > 0, 0.0, contact.gap))


def _joint_conductance(contact: Contact, media: Media) -> float:
    """Return the conductance of spots and gas together [W/(mm2 K)]."""
    spots = _conductance(1.0, contact, media) / nominal_area(contact)
    return spots * contact.interface_stiffness + _gas_conductance(contact, media)


# Values at first touch, of a problem whose load does not matter.


def _undeformed_gap(problem: Problem) -> Any:
    return problem.heights.max() - problem.heights


def _mean_gap_at_rest(problem: Problem, _: Media) -> float:
    return float(problem.heights.max()) - float(problem.heights.mean())


def _gas_at_rest(problem: Problem, media: Media) -> float:
    if media.gas is None:
        raise ValueError("the conductance of a gas needs a gas")
    return media.gas.conductance(_undeformed_gap(problem))


def _aperture_at_rest(axis: int) -> Callable[[Problem, Media], float]:
    def aperture(problem: Problem, _: Media) -> float:
        from bem.derived.flow import flows_through

        periodic = problem.boundary == "periodic"
        flows = flows_through(
            _undeformed_gap(problem), problem.spacing, (axis,), periodic=periodic
        )
        return float(flows[0].aperture)

    return aperture


# Values at full contact, of a problem whose load does not matter.


def _everything(_: Problem) -> float:
    return 100.0


def _nothing(_: Problem) -> float:
    return 0.0


def _all_nodes(problem: Problem) -> float:
    return float(problem.heights.size)


def _stiffness_at_full(problem: Problem) -> float:
    """Return the stiffness of the patch as a flat punch; no edge, no limit."""
    if problem.boundary != "free":
        return math.inf
    from bem.derived.stiffness import patch_stiffness

    return patch_stiffness(problem)


def _interface_at_full(_: Problem) -> float:
    """Return the stiffness of an interface of which nothing but the half-spaces is left."""
    return math.inf


DIVERGING = (_stiffness_at_full, _interface_at_full)
"""Values at full contact that are infinite for some problems."""

_CONNECTS = "opposite sides that contact connects: 0 none, 1 along x, 2 along y, 3 both"
_APERTURE = "distance of plates with the same flow along {} as the gap, 0 where it seals"


def _flow_factor(axis: int) -> Quantity:
    name = "xy"[axis]
    return Quantity(
        name=f"flow_factor_{name}",
        unit="1",
        words=f"flow along {name} over that through the mean gap",
        read=lambda contact, _: contact.flow(axis).factor,
        powers=PURE,
        noun=f"flow factor along {name}",
        remark="of the flow through the mean gap",
        option="flow",
        cost="the flow through the gap",
    )


def _hydraulic_aperture(axis: int) -> Quantity:
    name = "xy"[axis]
    return Quantity(
        name=f"hydraulic_aperture_{name}",
        unit="um",
        words=_APERTURE.format(name),
        read=lambda contact, _: contact.flow(axis).aperture,
        powers=LIKE_HEIGHTS,
        noun=f"hydraulic aperture along {name}",
        stored="asked",
        option="flow",
        cost="the flow through the gap",
        at_rest=_aperture_at_rest(axis),
        law=InLaw(f"hydraulic_aperture_{name}", "falls"),
    )


RECORDS: tuple[Quantity, ...] = (
    Quantity(
        name="delta",
        unit="um",
        words="far-field displacement Delta",
        read=lambda contact, _: contact.delta,
        powers=LIKE_HEIGHTS,
        noun="displacement Delta",
        stored="always",
        option="always",
        paper_range=(5.0, 45.0),
        law=InLaw("delta", goes_on=True),
    ),
    Quantity(
        name="approach",
        unit="um",
        words="displacement of the far field, with its own compliance",
        read=lambda contact, _: contact.approach,
        powers=LIKE_HEIGHTS,
        noun="far-field displacement",
        remark="Delta and the compliance of the far field",
        option="always",
        single=True,
    ),
    Quantity(
        name="area_percent",
        unit="%",
        words="effective contact area",
        read=lambda contact, _: contact.area_percent,
        powers=PURE,
        noun="contact area",
        remark="of the nodes",
        stored="always",
        option="always",
        bounds=SHARE,
        paper_range=(0.01, 16.56),
        counts_nodes=True,
        at_full=_everything,
        law=InLaw("area"),
    ),
    Quantity(
        name="force",
        unit="uN",
        words="normal force at the scene's modulus (1 uN = 1 MPa um2)",
        read=lambda contact, _: contact.force,
        powers=LIKE_FORCES,
        noun="normal force",
        stored="always",
        option="always",
        law=InLaw("force", goes_on=True),
    ),
    Quantity(
        name="nominal_pressure",
        unit="MPa",
        words="force over the area of the whole patch",
        read=_nominal_pressure,
        powers=LIKE_PRESSURES,
        noun="nominal pressure",
        remark="force over the whole patch",
        key="pressure_MPa",
        option="always",
        law=InLaw("pressure", goes_on=True),
    ),
    Quantity(
        name="closure",
        unit="um",
        words="Delta without what the half-space behind a free patch gives way",
        read=_closure,
        powers=LIKE_HEIGHTS,
        noun="closure",
        cost="a linear solve",
        law=InLaw("closure", goes_on=True, derived=True),
    ),
    Quantity(
        name="contact_nodes",
        unit="1",
        words="nodes under pressure",
        read=lambda contact, _: contact.contact_nodes,
        powers=PURE,
        noun="contact nodes",
        stored="always",
        option="always",
        single=True,
        dtype="i4",
        counts_nodes=True,
        at_full=_all_nodes,
        law=InLaw("contact_nodes"),
    ),
    Quantity(
        name="yielded_percent",
        unit="%",
        words="share of nodes at the hardness",
        read=lambda contact, _: contact.yielded_percent,
        powers=PURE,
        noun="yielded nodes",
        remark="of all nodes",
        stored="hardness",
        option="always",
        needs_hardness=True,
        bounds=SHARE,
        law=InLaw("yielded"),
    ),
    Quantity(
        name="largest_yielded_depth",
        unit="um",
        words="largest depth by which the softer body has yielded",
        read=lambda contact, _: float(contact.yielded_depth.max()),
        powers=LIKE_HEIGHTS,
        noun="largest yielded depth",
        option="always",
        needs_hardness=True,
        law=InLaw("largest_yielded_depth"),
    ),
    Quantity(
        name="mean_gap",
        unit="um",
        words="mean gap over all nodes",
        read=lambda contact, _: contact.mean_gap,
        powers=LIKE_HEIGHTS,
        noun="mean gap",
        stored="asked",
        early=True,
        option="always",
        at_rest=_mean_gap_at_rest,
        at_full=_nothing,
        law=InLaw("mean_gap", "falls"),
    ),
    Quantity(
        name="largest_pressure",
        unit="MPa",
        words="largest pressure",
        read=lambda contact, _: contact.largest_pressure,
        powers=LIKE_PRESSURES,
        noun="largest pressure",
        stored="asked",
        early=True,
        option="always",
        law=InLaw("largest_pressure"),
    ),
    Quantity(
        name="perimeter",
        unit="um",
        words="length of the contact's edges",
        read=lambda contact, _: contact.perimeter,
        powers=LIKE_LENGTHS,
        noun="contact perimeter",
        stored="asked",
        early=True,
        option="always",
        single=True,
        at_full=_nothing,
        law=InLaw("perimeter", "turns"),
    ),
    Quantity(
        name="stiffness",
        unit="N/m",
        words="stiffness of unloading, infinite at full contact without edges",
        read=lambda contact, _: contact.stiffness,
        powers=LIKE_STIFFNESSES,
        noun="stiffness",
        remark="of unloading",
        stored="asked",
        option="stiffness",
        cost="a linear solve",
        at_full=_stiffness_at_full,
    ),
    Quantity(
        name="loading_stiffness",
        unit="N/m",
        words="stiffness of further loading, while the contact set stands",
        read=lambda contact, _: contact.loading_stiffness,
        powers=LIKE_STIFFNESSES,
        noun="stiffness of loading",
        remark="dF/dDelta",
        option="stiffness",
        cost="a linear solve",
        needs_hardness=True,
        at_full=_stiffness_at_full,
    ),
    Quantity(
        name="interface_stiffness",
        unit="N/m",
        words="the same without the patch's own compliance, infinite at full contact",
        read=lambda contact, _: contact.interface_stiffness,
        powers=LIKE_STIFFNESSES,
        noun="interface's stiffness",
        stored="asked",
        option="stiffness",
        cost="a linear solve",
        at_full=_interface_at_full,
        law=InLaw(
            "stiffness",
            per_area="MPa/um",
            noun="stiffness",
            key="stiffness_MPa_per_um",
            derived=True,
        ),
    ),
    Quantity(
        name="conductance",
        unit="W/K",
        words="conductance of the contact for heat",
        read=lambda contact, media: (
            1e-6 * _conductance(contact.stiffness, contact, media)
        ),
        powers=LIKE_LENGTHS,
        noun="conductance",
        option="conductivities",
        cost="a linear solve",
        at_full=_stiffness_at_full,
    ),
    Quantity(
        name="interface_conductance",
        unit="W/K",
        words="conductance of the interface alone for heat",
        read=lambda contact, media: (
            1e-6 * _conductance(contact.interface_stiffness, contact, media)
        ),
        powers=LIKE_LENGTHS,
        noun="interface's conductance",
        option="conductivities",
        cost="a linear solve",
        at_full=_interface_at_full,
        law=InLaw(
            "conductance",
            per_area="W/(mm2 K)",
            factor=1e6,
            noun="conductance",
            key="conductance_W_per_mm2_K",
            derived=True,
        ),
    ),
    Quantity(
        name="gas_conductance",
        unit="W/(mm2 K)",
        words="conductance of a gas in the gap per nominal area",
        read=_gas_conductance,
        powers=None,
        noun="conductance of the gas",
        key="gas_conductance_W_per_mm2_K",
        at_rest=_gas_at_rest,
        law=InLaw("gas_conductance", "turns"),
    ),
    Quantity(
        name="joint_conductance",
        unit="W/(mm2 K)",
        words="conductance of spots and gas per nominal area",
        read=_joint_conductance,
        powers=None,
        noun="conductance of spots and gas",
        key="joint_conductance_W_per_mm2_K",
        cost="a linear solve",
        at_rest=_gas_at_rest,
        at_full=_interface_at_full,
        law=InLaw("joint_conductance", "turns", derived=True),
    ),
    Quantity(
        name="contact_spots",
        unit="1",
        words="spots of contact",
        read=lambda contact, _: contact.spots.number,
        powers=PURE,
        noun="spots of contact",
        remark="nodes that touch along their sides",
        key="spots",
        stored="asked",
        option="spots",
        dtype="i4",
        law=InLaw("spots", "turns"),
    ),
    Quantity(
        name="mean_spot_area",
        unit="um2",
        words="mean area of the spots of contact",
        read=_mean_spot,
        powers=LIKE_AREAS,
        noun="mean spot",
        key="mean_spot_um2",
        option="spots",
        law=InLaw("mean_spot", "turns"),
    ),
    Quantity(
        name="largest_spot_area",
        unit="um2",
        words="area of the largest spot of contact",
        read=_largest_spot,
        powers=LIKE_AREAS,
        noun="largest spot",
        key="largest_spot_um2",
        stored="asked",
        option="spots",
        law=InLaw("largest_spot", "turns"),
    ),
    Quantity(
        name="largest_spot_percent",
        unit="%",
        words="share of the contact area in the largest spot",
        read=lambda contact, _: 100 * contact.spots.largest_share,
        powers=PURE,
        noun="its share",
        remark="of the contact area",
        stored="asked",
        option="spots",
        bounds=SHARE,
        law=InLaw("largest_spot_share", "turns"),
    ),
    Quantity(
        name="contact_connects",
        unit="1",
        words=_CONNECTS,
        read=lambda contact, _: _sides_connected(contact.spots.contact_connects),
        powers=PURE,
        noun="contact connects sides",
        stored="asked",
        option="spots",
        dtype="u1",
        bounds=(-math.inf, math.inf),
        code=True,
    ),
    Quantity(
        name="gap_connects",
        unit="1",
        words="opposite sides that the gap connects, in the same way",
        read=lambda contact, _: _sides_connected(contact.spots.gap_connects),
        powers=PURE,
        noun="gap connects sides",
        stored="asked",
        option="spots",
        dtype="u1",
        bounds=(-math.inf, math.inf),
        code=True,
    ),
    Quantity(
        name="continuum_area_percent",
        unit="%",
        words="contact area in the continuum: less what the grid adds along its borders",
        read=lambda contact, _: contact.continuum_area_percent,
        powers=PURE,
        noun="area in the continuum",
        stored="asked",
        option="grid_error",
        bounds=SHARE,
        at_full=_everything,
        law=InLaw("continuum_area"),
    ),
    _flow_factor(0),
    _hydraulic_aperture(0),
    _flow_factor(1),
    _hydraulic_aperture(1),
    Quantity(
        name="heights",
        unit="um",
        words="surface heights",
        read=lambda contact, _: contact.problem.heights,
        powers=LIKE_HEIGHTS,
        stored="asked",
        early=True,
        bounds=(-math.inf, math.inf),
        per_node=True,
    ),
    Quantity(
        name="pressure",
        unit="MPa",
        words="contact pressure",
        read=lambda contact, _: contact.pressure,
        powers=LIKE_PRESSURES,
        stored="asked",
        early=True,
        bounds=(-math.inf, math.inf),
        per_node=True,
    ),
)
"""All quantities, in the order in which databases and tables have them."""

QUANTITIES: dict[str, Quantity] = {quantity.name: quantity for quantity in RECORDS}
"""All quantities by their names."""

DELTA = QUANTITIES["delta"]
AREA = QUANTITIES["area_percent"]
FORCE = QUANTITIES["force"]
CONTACT_NODES = QUANTITIES["contact_nodes"]
YIELDED = QUANTITIES["yielded_percent"]
PRESSURE = QUANTITIES["nominal_pressure"]
CLOSURE = QUANTITIES["closure"]
MEAN_GAP = QUANTITIES["mean_gap"]
UNLOADING = QUANTITIES["stiffness"]  # of the whole patch
STIFFNESS = QUANTITIES["interface_stiffness"]
CONDUCTANCE = QUANTITIES["interface_conductance"]
GAS = QUANTITIES["gas_conductance"]
JOINT = QUANTITIES["joint_conductance"]
CONTINUUM = QUANTITIES["continuum_area_percent"]
APERTURES = (QUANTITIES["hydraulic_aperture_x"], QUANTITIES["hydraulic_aperture_y"])

USUAL = (AREA.name, FORCE.name, DELTA.name)
"""Outputs of functions and of the server, unless others are asked for."""

LOADS = {"delta": DELTA, "pressure": PRESSURE, "force": FORCE}
"""Quantities that a contact is solved at, by the names of the loads."""

IN_LAWS: dict[str, Quantity] = {
    quantity.in_laws: quantity for quantity in RECORDS if quantity.law is not None
}
"""Quantities of contact laws by the names of their columns."""

ALWAYS_IN_LAWS = (DELTA, AREA, FORCE, MEAN_GAP, PRESSURE, CLOSURE)
"""Quantities that every point of a law has."""

_WITH_OPTIONS = (STIFFNESS, CONDUCTANCE, GAS, JOINT, CONTINUUM, *APERTURES)

ALSO: dict[str, Quantity] = {
    quantity.name: quantity
    for quantity in RECORDS
    if quantity.law is not None and quantity not in (*ALWAYS_IN_LAWS, *_WITH_OPTIONS)
}
"""Quantities that a law has only where they are asked for by name, by these names."""


def _columns_against(*first: Quantity) -> tuple[str, ...]:
    """Return the names of the columns of a law's table, those that are asked for by name last."""
    columns = (*first, *_WITH_OPTIONS, *ALSO.values())
    return tuple(quantity.in_laws for quantity in columns)


LAW_COLUMNS: dict[str, tuple[str, ...]] = {
    DELTA.in_laws: _columns_against(AREA, FORCE, MEAN_GAP, PRESSURE, CLOSURE),
    PRESSURE.in_laws: _columns_against(DELTA, CLOSURE, AREA, MEAN_GAP),
}
"""Columns that the tables of a law can have, by what they are tabulated against."""


def stored_quantities() -> tuple[Quantity, ...]:
    """Return the quantities that databases can have, in the order of the file."""
    return tuple(quantity for quantity in RECORDS if quantity.stored)
