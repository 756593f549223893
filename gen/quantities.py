"""The quantities of a contact: one record for each, which everything else takes from here.

A record says what a quantity is: its name, unit and words, its least and largest value, the powers
of heights, lengths and E* that it scales with, how it is read off a solved contact and what that
costs, what it is at first touch and at full contact, and how it changes with the load. From these
records come the columns of databases and the keys of `[store]`, the rows of `gen contact`, the
curves of contact laws, the scales of surrogates, and the outputs of functions and of the server.
A new quantity is one more record in `RECORDS`.

Lengths are in um, pressures and moduli in MPa, forces in uN. Multiply the heights of a contact by
a, its sides by b and its modulus E* by c, and press it by a times the Delta: the contact is the
same. Displacements are proportional to p L / E*, so that pressures are c a / b times as large, and
forces a b c times. A hardness has to be multiplied as pressures are (K. L. Johnson, Contact
Mechanics, 1985, section 3.3).
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

SHARE = (0.0, 100.0)
"""Bounds of a share in percent."""

AMOUNT = (0.0, math.inf)
"""Bounds of an amount."""

SIDES = (1, 2)
"""Codes of opposite sides that are connected along x and along y; the code of both is their sum."""

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
    """What conducts heat through an interface, for the quantities that depend on it.

    Attributes
    ----------
    conductivities : tuple of two float or None
        Conductivities of both bodies [W/(m K)]; None if no conductance is read.
    gas : Gas or None
        Gas in the gap; None if there is none.
    """

    conductivities: tuple[float, float] | None = None
    gas: Gas | None = None


BODIES_ALONE = Media()


@dataclass(frozen=True)
class InLaw:
    """How a quantity stands in contact laws.

    Attributes
    ----------
    short : str
        Name in the functions of a C header.
    trend : {"rises", "falls", "turns"}
        How the quantity changes with the load; one that turns may do both.
    per_area : str
        Unit of the quantity over the nominal area, if laws have it so; "" if they do not.
    factor : float
        Factor from the quantity's unit over um2 to `per_area`.
    noun : str
        Name on the axes of laws; the noun of the quantity if left out.
    key : str
        Name of the column, with its unit; that of the quantity if left out.
    goes_on : bool
        Whether functions of a C header continue it with its last slope beyond the last point of a
        table.
    derived : bool
        Whether surrogates compute it from predicted quantities, so that its errors are larger than
        theirs.
    """

    short: str
    trend: Trend = "rises"
    per_area: str = ""
    factor: float = 1.0
    noun: str = ""
    key: str = ""
    goes_on: bool = False
    derived: bool = False


@dataclass(frozen=True)
class Quantity:
    """One quantity of a contact.

    Attributes
    ----------
    name : str
        Name in Python, of the column of databases, and of the key of `[store]`.
    unit : str
        Unit of the column; "1" for pure numbers.
    words : str
        Meaning of the quantity, in databases and exports.
    read : callable
        Function of a solved contact and the media of its interface, which returns the value.
    powers : Powers or None
        Powers of heights, lengths and E* that it scales with; None if it scales with none.
    noun : str
        Name in `gen contact` and on the axes of pictures.
    remark : str
        Text that `gen contact` prints behind the unit.
    key : str
        Name with the unit, in tables; `NAME_UNIT` if left out.
    stored : str
        When databases have the column: "always"; "hardness", for bodies that yield; "asked", if
        the scene has the key in `[store]`; "" if they never have it.
    early : bool
        Whether scenes write the key of `[store]` also where it is off, as they do for the oldest
        keys.
    option : str
        When `gen contact` shows it: "always", with a field of `gen.maps.contacts.AnswerOptions`, or
        "" for never.
    cost : str
        Computation that the quantity needs besides the contact; "" for none.
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
        Whether its numbers stand for words. Such numbers are neither learnt nor drawn as a curve.
    counts_nodes : bool
        Whether it is the number or the share of nodes in contact. These begin at 0 with an
        infinite slope, so that surrogates learn their square root.
    single : bool
        Whether `gen contact` prints it for a single load only. Tables of several loads would
        become too wide.
    at_rest : callable or None
        Function of a posed problem and the media, which returns the value at first touch; None for
        0.
    at_full : callable or None
        Function of a posed problem, which returns the value at full contact; None if it depends on
        the load.
    law : InLaw or None
        How it stands in contact laws; None if they never have it.
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
            Conductivities of the bodies and the gas. Only conductances need them.

        Returns
        -------
        float, int or ndarray
            The value in `unit`; shape (nx, ny) for a field.

        Raises
        ------
        ArithmeticError
            If a linear solve, or the flow through the gap, does not converge.
        ValueError
            If the quantity depends on a medium that `media` lacks.
        """
        return self.read(contact, media)

    def in_law(self, contact: Contact, media: Media = BODIES_ALONE) -> float:
        """Read the quantity off a contact for a contact law.

        Parameters
        ----------
        contact : bem.Contact
            A solved contact.
        media : Media
            Conductivities of the bodies and the gas. Only conductances need them.

        Returns
        -------
        float
            The value in `law_unit`, per nominal area if laws have it so. Values that rounding puts
            beyond the bounds are those of the bounds.

        Raises
        ------
        ArithmeticError
            If a linear solve, or the flow through the gap, does not converge.
        ValueError
            If the quantity depends on a medium that `media` lacks.
        """
        low, high = self.bounds
        value = min(max(float(self.of(contact, media)), low), high)
        if self.law is not None and self.law.per_area:
            return self.law.factor * value / nominal_area(contact)
        return value

    def resting(self, problem: Problem, media: Media = BODIES_ALONE) -> float:
        """Return the value at first touch of a problem.

        Parameters
        ----------
        problem : bem.problem.Problem
            A posed problem; its load does not matter.
        media : Media
            Conductivities of the bodies and the gas. Only conductances need them.

        Returns
        -------
        float
            The value in `unit`.

        Raises
        ------
        ValueError
            If the quantity depends on a medium that `media` lacks.
        """
        if self.at_rest is None:
            return 0.0
        return self.at_rest(problem, media)

    def is_infinite_at_full_contact(self, problem: Problem) -> bool:
        """Return whether the quantity is infinite at full contact of a problem.

        Parameters
        ----------
        problem : bem.problem.Problem
            A posed problem; its load does not matter.

        Returns
        -------
        bool
            Whether it is infinite; False for a quantity that depends on the load at full contact.
        """
        return self.at_full is not None and math.isinf(self.at_full(problem))

    @property
    def diverges(self) -> bool:
        """Whether the quantity is infinite at full contact of some problems."""
        return self.at_full in DIVERGING

    @property
    def in_tables(self) -> str:
        """Name of its column in tables of single contacts, with the unit."""
        return self.key or _with_unit(self.name, self.unit)

    @property
    def in_laws(self) -> str:
        """Name of its column in the tables of laws, with the unit."""
        if self.law is not None and self.law.key:
            return self.law.key
        return self.in_tables

    @property
    def law_unit(self) -> str:
        """Unit in laws."""
        if self.law is not None and self.law.per_area:
            return self.law.per_area
        return self.unit

    @property
    def label(self) -> str:
        """Label of an axis of a law's picture, with the unit as it is printed."""
        noun = self.noun
        if self.law is not None and self.law.noun:
            noun = self.law.noun
        return f"{noun.replace('Delta', 'Δ')} [{typographic(self.law_unit)}]"


def _with_unit(name: str, unit: str) -> str:
    """Append a unit to a name, as in mean_gap_um; pure numbers and percentages stay as they are."""
    if unit in {"1", "%"}:
        return name
    return f"{name}_{unit.replace('/', '_per_')}"


def typographic(unit: str) -> str:
    """Write a unit for pictures, with the signs of printed texts.

    Parameters
    ----------
    unit : str
        Unit as in tables, for example um or mm2.

    Returns
    -------
    str
        The unit with µ for the prefix u and ² for squares, for example µm or mm².
    """
    return re.sub(r"m2\b", "m²", re.sub(r"\bu(?=[mN])", "µ", unit))


def nominal_area(contact: Contact) -> float:
    """Return the area of a patch that mean pressures refer to.

    Parameters
    ----------
    contact : bem.Contact
        A solved contact.

    Returns
    -------
    float
        Area of the cells of all nodes [um2].
    """
    return contact.pressure.size * math.prod(contact.problem.spacing)


# Quantities that are more than one property of a contact.


def _nominal_pressure(contact: Contact, _: Media) -> float:
    """Return the force over the nominal area [MPa]."""
    return contact.force / nominal_area(contact)


def _closure(contact: Contact, media: Media) -> float:
    """Return Delta without the displacement of the half-space behind a free patch [um].

    Rounding may make the difference negative: then it is 0.
    """
    compliance = patch_compliance(contact.problem)
    return max(contact.delta - compliance * _nominal_pressure(contact, media), 0.0)


def patch_compliance(problem: Problem) -> float:
    """Compute the displacement of a flat punch of the size of the patch per nominal pressure.

    On a rigid far field Delta includes this displacement of the half-space, which the mesh of a
    finite-element model adds by itself. There is none for a patch without edges, nor on a compliant
    far field, whose Delta leaves it out.

    Parameters
    ----------
    problem : bem.problem.Problem
        A posed problem; its heights and its load do not matter.

    Returns
    -------
    float
        Compliance [um / MPa]; 0 if Delta does not include it.
    """
    if problem.boundary != "free" or problem.far_field != "rigid":
        return 0.0
    from bem.derived.stiffness import patch_stiffness

    nominal = problem.heights.size * math.prod(problem.spacing)
    return nominal / patch_stiffness(problem)


def _code_of_sides(connected: tuple[bool, bool]) -> int:
    """Return the sum of the codes of the axes, x and y, whose opposite sides are connected."""
    code = 0
    if connected[0]:
        code += SIDES[0]
    if connected[1]:
        code += SIDES[1]
    return code


def _largest_spot(contact: Contact, _: Media) -> float:
    """Return the area of the largest spot of contact, 0 without contact [um2]."""
    if not contact.spots.number:
        return 0.0
    return float(contact.spots.areas[0])


def _mean_spot(contact: Contact, _: Media) -> float:
    """Return the mean area of the spots of contact, 0 without contact [um2]."""
    if not contact.spots.number:
        return 0.0
    return float(contact.spots.areas.mean())


def _conductance(stiffness: float, contact: Contact, media: Media) -> float:
    """Return the conductance k S / E* of both bodies for a stiffness S [uN/um] (Barber 2003).

    The mean conductivity k counts in W/(m K), so that the result has the unit W/(m K) um, 1e-6 W/K.
    """
    from bem.contact import mean_conductivity

    if media.conductivities is None:
        raise ValueError("a conductance needs the conductivities of both bodies")
    return mean_conductivity(*media.conductivities) / contact.problem.modulus * stiffness


def _gas_conductance(contact: Contact, media: Media) -> float:
    """Return the conductance of the gas where the gap is open, per nominal area [W/(mm2 K)]."""
    import numpy as np

    if media.gas is None:
        raise ValueError("the conductance of a gas needs a gas")
    # Nodes in contact have a gap of 0 only within the tolerance of the solver.
    return media.gas.conductance(np.where(contact.pressure > 0, 0.0, contact.gap))


def _joint_conductance(contact: Contact, media: Media) -> float:
    """Return the conductance of spots and gas together, per nominal area [W/(mm2 K)]."""
    spots = _conductance(1.0, contact, media) / nominal_area(contact)
    return spots * contact.interface_stiffness + _gas_conductance(contact, media)


# Values at first touch, of a problem whose load does not matter.


def _undeformed_gap(problem: Problem) -> Any:
    """Return the gap to a plane that rests on the highest node [um], shape (nx, ny)."""
    return problem.heights.max() - problem.heights


def _mean_gap_at_rest(problem: Problem, _: Media) -> float:
    """Return the mean gap to a plane that rests on the highest node [um]."""
    return float(problem.heights.max()) - float(problem.heights.mean())


def _gas_at_rest(problem: Problem, media: Media) -> float:
    """Return the conductance of the gas in the undeformed gap, per nominal area [W/(mm2 K)]."""
    if media.gas is None:
        raise ValueError("the conductance of a gas needs a gas")
    return media.gas.conductance(_undeformed_gap(problem))


def _aperture_at_rest(axis: int) -> Callable[[Problem, Media], float]:
    """Return a function for the hydraulic aperture of the undeformed gap along axis 0 or 1 [um]."""

    def aperture(problem: Problem, _: Media) -> float:
        """Return the aperture [um], or raise ArithmeticError if the flow does not converge."""
        from bem.derived.flow import flows_through

        periodic = problem.boundary == "periodic"
        flows = flows_through(
            _undeformed_gap(problem), problem.spacing, (axis,), periodic=periodic
        )
        return float(flows[0].aperture)

    return aperture


# Values at full contact, of a problem whose load does not matter.


def _everything(_: Problem) -> float:
    """Return 100 %, for a share of the nodes."""
    return 100.0


def _nothing(_: Problem) -> float:
    """Return 0, for a quantity that vanishes at full contact."""
    return 0.0


def _all_nodes(problem: Problem) -> float:
    """Return the number of nodes."""
    return float(problem.heights.size)


def _stiffness_at_full(problem: Problem) -> float:
    """Return the stiffness of a flat punch of the size of the patch [N/m].

    It is infinite for a patch without edges, on which full contact moves as one.
    """
    if problem.boundary != "free":
        return math.inf
    from bem.derived.stiffness import patch_stiffness

    return patch_stiffness(problem)


def _interface_at_full(_: Problem) -> float:
    """Return infinity: at full contact the interface adds no compliance to the half-spaces'."""
    return math.inf


DIVERGING = (_stiffness_at_full, _interface_at_full)
"""Functions of values at full contact that are infinite for some problems."""

_CONNECTS = "opposite sides that contact connects: 0 none, 1 along x, 2 along y, 3 both"
_APERTURE = "distance of plates with the same flow along {} as the gap, 0 where it seals"


def _flow_factor(axis: int) -> Quantity:
    """Make the record of the flow factor along axis 0 or 1."""
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
    """Make the record of the hydraulic aperture along axis 0 or 1."""
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
        read=lambda contact, _: _code_of_sides(contact.spots.contact_connects),
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
        read=lambda contact, _: _code_of_sides(contact.spots.gap_connects),
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
UNLOADING = QUANTITIES["stiffness"]  # the stiffness of the whole patch
STIFFNESS = QUANTITIES["interface_stiffness"]
CONDUCTANCE = QUANTITIES["interface_conductance"]
GAS = QUANTITIES["gas_conductance"]
JOINT = QUANTITIES["joint_conductance"]
CONTINUUM = QUANTITIES["continuum_area_percent"]
APERTURES = (QUANTITIES["hydraulic_aperture_x"], QUANTITIES["hydraulic_aperture_y"])

USUAL = (AREA.name, FORCE.name, DELTA.name)
"""Default outputs of functions and of the server."""

LOADS = {"delta": DELTA, "pressure": PRESSURE, "force": FORCE}
"""Quantities in which the load of a contact can be given, by the names of the loads."""

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
"""Quantities that a law has only if `gen law --also` names them, by these names."""


def _columns_against(*first: Quantity) -> tuple[str, ...]:
    """Return the names of the columns of a law's table; those of `--also` come last."""
    columns = (*first, *_WITH_OPTIONS, *ALSO.values())
    return tuple(quantity.in_laws for quantity in columns)


LAW_COLUMNS: dict[str, tuple[str, ...]] = {
    DELTA.in_laws: _columns_against(AREA, FORCE, MEAN_GAP, PRESSURE, CLOSURE),
    PRESSURE.in_laws: _columns_against(DELTA, CLOSURE, AREA, MEAN_GAP),
}
"""Columns that the tables of a law can have, by the column of the loads that they begin with."""


def stored_quantities() -> tuple[Quantity, ...]:
    """Return the quantities that databases can have, in the order of the file."""
    return tuple(quantity for quantity in RECORDS if quantity.stored)
