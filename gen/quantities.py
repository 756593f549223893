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
Mechanics, 1985, section 3.3). The thickness of a layer has to be multiplied by b, and the moduli of
the layer and of its base by c: `OF_LAYERS` has these powers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from gen.shear import SHARES, Sheared

if TYPE_CHECKING:
    from bem import Contact
    from bem.problem import Problem
    from gen.material import Friction, Gas

SHARE = (0.0, 100.0)
"""Bounds of a share in percent."""

AMOUNT = (0.0, math.inf)
"""Bounds of an amount."""

SIDES = (1, 2)
"""Codes for opposite sides that are connected along x, and along y. If both are, the code is the
sum."""

Cost = Literal[
    "",
    "a linear solve",
    "a solve on a coarser grid",
    "the flow through the gap",
    "contacts under smaller loads",
]
"""Computation that a quantity needs besides the contact; "" if it needs none."""

Trend = Literal["rises", "falls", "turns"]
"""How a quantity changes as the load rises; one that "turns" may both rise and fall."""


class Powers(NamedTuple):
    """Powers of heights, lengths and E* that a quantity is proportional to."""

    heights: int
    lengths: int
    modulus: int


PURE = Powers(heights=0, lengths=0, modulus=0)
LIKE_HEIGHTS = Powers(heights=1, lengths=0, modulus=0)
LIKE_LENGTHS = Powers(heights=0, lengths=1, modulus=0)
LIKE_AREAS = Powers(heights=0, lengths=2, modulus=0)
LIKE_PRESSURES = Powers(heights=1, lengths=-1, modulus=1)
LIKE_FORCES = Powers(heights=1, lengths=1, modulus=1)
LIKE_STIFFNESSES = Powers(heights=0, lengths=1, modulus=1)
LIKE_MODULI = Powers(heights=0, lengths=0, modulus=1)

LAYER_THICKNESS = "layer_thickness"
LAYER_MODULUS = "layer_modulus"
"""Names of the numbers of a layer that scenes can draw for every sample."""

OF_LAYERS: dict[str, Powers] = {
    LAYER_THICKNESS: LIKE_LENGTHS,
    LAYER_MODULUS: LIKE_MODULI,
}
"""Powers of the numbers of a layer. A contact stays the same if they follow its scale."""


@dataclass(frozen=True)
class Media:
    """What conducts heat through an interface and what rubs in it, for quantities that need it.

    Attributes
    ----------
    conductivities : tuple of two float or None
        Conductivities of both bodies [W/(m K)]; None if no conductance is read.
    gas : Gas or None
        Gas in the gap; None if there is none.
    friction : Friction or None
        Friction of bodies of like elastic constants; None if no quantity of shear is read.
    """

    conductivities: tuple[float, float] | None = None
    gas: Gas | None = None
    friction: Friction | None = None


BODIES_ALONE = Media()


@dataclass(frozen=True)
class InLaw:
    """Form of a quantity in contact laws.

    Attributes
    ----------
    short : str
        Name in the functions of a C header.
    trend : {"rises", "falls", "turns"}
        How the quantity changes as the load rises; one that "turns" may both rise and fall.
    per_area : str
        Unit in laws, if laws divide the quantity by the nominal area; "" if they do not.
    factor : float
        Value of 1 unit of the quantity per um2, in the unit `per_area`.
    noun : str
        Name on the axes of laws; the noun of the quantity if left out.
    key : str
        Name of the column, with its unit; that of the quantity if left out.
    goes_on : bool
        True if functions of a C header follow its last slope beyond the last point of a table;
        otherwise they stay at the last value.
    derived : bool
        True if surrogates compute it from predicted quantities, so that its errors are larger than
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
        Function of a solved contact and the media of its interface. It returns the value in `unit`.
    powers : Powers or None
        Powers of heights, lengths and E* that it is proportional to; None if it is not proportional
        to any, as the conductance of a gas.
    noun : str
        Name in `gen contact` and on the axes of pictures.
    remark : str
        Remark that `gen contact` prints after the unit.
    key : str
        Name with the unit, in tables; `NAME_UNIT` if left out.
    stored : str
        When databases have the column: "always"; "hardness", for bodies that yield; "asked", if
        the scene has the key in `[store]`; "" if they never have it.
    early : bool
        True for the oldest keys of `[store]`, which scenes write even if they are off.
    option : str
        When `gen contact` shows it: "always"; "" for never; otherwise the name of the field of
        `gen.maps.answers.AnswerOptions` that has to be given.
    cost : str
        Computation that the quantity needs besides the contact; "" for none.
    needs_hardness : bool
        True if only bodies that yield have it.
    dtype : str
        Type of the column, in numpy's notation.
    bounds : tuple of float
        Least and largest value.
    paper_range : tuple of float or None
        Range in the paper's database, if the paper states it.
    per_node : bool
        True if it is a field of shape (nx, ny).
    code : bool
        True if its numbers are codes for words. Codes are neither learnt nor drawn as a curve.
    counts_nodes : bool
        True if it is the number or the share of nodes in contact. Both begin at 0 with an
        infinite slope, so that surrogates learn their square root.
    single : bool
        True if `gen contact` prints it for a single load only, because tables of several loads
        would become too wide.
    at_rest : callable or None
        Function of a posed problem and the media. It returns the value at first touch in `unit`.
        None if the value is 0.
    at_full : callable or None
        Function of a posed problem. It returns the value at full contact in `unit`. None if the
        value depends on the load.
    law : InLaw or None
        Form in contact laws; None if they never have it.
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
            The value in `law_unit`. Laws divide some quantities by the nominal area. A value
            beyond `bounds`, as rounding may give, is replaced by the bound.

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
            If the quantity depends on a medium that `media` lacks. OutOfRange, a ValueError, if it
            is an aperture and the widest gap is outside 1e-90 to 1e90 um.
        ArithmeticError
            If the flow through the gap does not converge.
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
            True if it is infinite; False also if its value at full contact depends on the load.
        """
        return self.at_full is not None and math.isinf(self.at_full(problem))

    @property
    def diverges(self) -> bool:
        """True if the quantity is infinite at full contact of some problems."""
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
        """Unit in laws, per nominal area if laws divide the quantity by it."""
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
    """Append a unit to a name, as in mean_gap_um.

    Names of pure numbers and of percentages are returned as they are.
    """
    ending = unit_in_names(unit)
    return f"{name}_{ending}" if ending else name


def unit_in_names(unit: str) -> str:
    """Write a unit as it ends the names of columns.

    Parameters
    ----------
    unit : str
        Unit of a quantity, for example N/m or W/(mm2 K).

    Returns
    -------
    str
        The unit in letters and underscores, for example N_per_m or W_per_mm2_K; "" for pure numbers
        and percentages.
    """
    if unit in {"1", "%"}:
        return ""
    with_words = unit.replace("/", "_per_").replace(" ", "_")
    return re.sub("[()]", "", with_words)


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
    with_micro = re.sub(r"\bu(?=[mN])", "µ", unit)
    return re.sub(r"m2\b", "m²", with_micro)


def nominal_area(contact: Contact) -> float:
    """Return the area of a patch over which nominal pressures are means.

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


# Functions that read a quantity off a contact, if it is not just one property of the contact.


def _nominal_pressure(contact: Contact, _: Media) -> float:
    """Return the force over the nominal area [MPa]."""
    return contact.force / nominal_area(contact)


def _closure(contact: Contact, media: Media) -> float:
    """Return Delta less the displacement of the patch by a uniform pressure [um].

    See `patch_compliance`. It is 0 if rounding makes the difference negative.
    """
    compliance = patch_compliance(contact.problem)
    return max(contact.delta - compliance * _nominal_pressure(contact, media), 0.0)


def patch_compliance(problem: Problem) -> float:
    """Compute the displacement of a flat punch of the size of the patch, per nominal pressure.

    With a rigid far field, Delta of a free patch includes this displacement of the half-space. The
    mesh of a finite-element model adds it by itself. Delta does not include it with a compliant far
    field, nor for a patch without edges, unless the body is a layer on a rigid base, which a
    uniform pressure compresses.

    Parameters
    ----------
    problem : bem.problem.Problem
        A posed problem; its heights and its load do not matter.

    Returns
    -------
    float
        Compliance [um / MPa]; 0 if Delta does not include it.
    """
    if problem.boundary != "free":
        return problem.body.mean_compliance
    if problem.far_field != "rigid":
        return 0.0
    from bem.derived.stiffness import patch_stiffness

    nominal = problem.heights.size * math.prod(problem.spacing)
    return nominal / patch_stiffness(problem)


def _code_of_sides(connected: tuple[bool, bool]) -> int:
    """Return the sum of the codes `SIDES` of the axes whose opposite sides are connected.

    `connected` is whether they are along x, and along y.
    """
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

    The mean conductivity k = 2 k1 k2 / (k1 + k2) is in W/(m K), so that the result is in 1e-6 W/K.
    Raises ValueError without conductivities.
    """
    from bem.contact import mean_conductivity

    if media.conductivities is None:
        raise ValueError("a conductance needs the conductivities of both bodies")
    conductivity = mean_conductivity(*media.conductivities)
    return conductivity / contact.problem.modulus * stiffness


def _gas_conductance(contact: Contact, media: Media) -> float:
    """Return the conductance of the gas in the open gap, per nominal area [W/(mm2 K)].

    Raises ValueError without a gas.
    """
    import numpy as np

    if media.gas is None:
        raise ValueError("the conductance of a gas needs a gas")
    # The solver leaves gaps within its tolerance at nodes in contact.
    gap = np.where(contact.pressure > 0, 0.0, contact.gap)
    return media.gas.conductance(gap)


def _joint_conductance(contact: Contact, media: Media) -> float:
    """Return the conductance of spots and gas together, per nominal area [W/(mm2 K)].

    Raises ValueError without conductivities or without a gas.
    """
    # 1e-6 W/K over um2 is W/(mm2 K).
    per_stiffness = _conductance(1.0, contact, media) / nominal_area(contact)
    spots = per_stiffness * contact.interface_stiffness
    return spots + _gas_conductance(contact, media)


def _required_friction(media: Media) -> Friction:
    """Return the friction of an interface; raise ValueError without one."""
    if media.friction is None:
        raise ValueError("a quantity of shear needs a coefficient of friction")
    return media.friction


# Functions that return a value at first touch of a problem. The load of the problem is not used.


def _undeformed_gap(problem: Problem) -> Any:
    """Return the gap to a plane that rests on the highest node [um], shape (nx, ny)."""
    return problem.heights.max() - problem.heights


def _mean_gap_at_rest(problem: Problem, _: Media) -> float:
    """Return the mean gap to a plane that rests on the highest node [um]."""
    return float(problem.heights.max()) - float(problem.heights.mean())


def _gas_at_rest(problem: Problem, media: Media) -> float:
    """Return the conductance of the gas in the undeformed gap, per nominal area [W/(mm2 K)].

    Raises ValueError without a gas.
    """
    if media.gas is None:
        raise ValueError("the conductance of a gas needs a gas")
    return media.gas.conductance(_undeformed_gap(problem))


def _aperture_at_rest(axis: int) -> Callable[[Problem, Media], float]:
    """Make the function that returns the hydraulic aperture at first touch [um].

    The flow is along x for `axis` 0, and along y for 1.
    """

    def aperture(problem: Problem, _: Media) -> float:
        """Return the hydraulic aperture of the gap between the undeformed bodies [um].

        Raise OutOfRange, which is a ValueError and an ArithmeticError, if the widest gap is outside
        1e-90 to 1e90 um. Raise ArithmeticError if the flow does not converge.
        """
        from bem.derived.flow import flows_through

        periodic = problem.boundary == "periodic"
        flows = flows_through(
            _undeformed_gap(problem), problem.spacing, (axis,), periodic=periodic
        )
        return float(flows[0].aperture)

    return aperture


# Functions that return a value at full contact of a problem. The load of the problem is not used.


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

    It is infinite for a patch without edges, because all nodes of it sink alike, unless the body
    lies on a rigid base.
    """
    if problem.has_most_delta:
        return math.inf
    from bem.derived.stiffness import patch_stiffness

    return patch_stiffness(problem)


def _interface_at_full(_: Problem) -> float:
    """Return infinity, because in full contact the interface adds no compliance to the bodies."""
    return math.inf


DIVERGING = (_stiffness_at_full, _interface_at_full)
"""Functions for `Quantity.at_full` whose values are infinite for some problems."""

_CONNECTS = "opposite sides that contact connects: 0 none, 1 along x, 2 along y, 3 both"
_APERTURE = "distance of plates with the same flow along {} as the gap, 0 where it seals"


def _flow_factor(axis: int) -> Quantity:
    """Make the record of the flow factor along axis 0 (x) or 1 (y)."""
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
    """Make the record of the hydraulic aperture along axis 0 (x) or 1 (y)."""
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
        law=InLaw(short=f"hydraulic_aperture_{name}", trend="falls"),
    )


def _sheared(
    axis: int, answer: Callable[[Sheared], float]
) -> Callable[[Contact, Media], float]:
    """Return the function that shears a contact along axis 0 (x) or 1 (y) and reads an answer.

    It raises ValueError for media without friction.
    """
    return lambda contact, media: answer(
        Sheared(contact, _required_friction(media), axis)
    )


def _shear_quantities(axis: int) -> tuple[Quantity, ...]:
    """Make the records of shear along axis 0 (x) or 1 (y)."""
    axis_name = "xy"[axis]
    stiffness = Quantity(
        name=f"shear_stiffness_{axis_name}",
        unit="N/m",
        words=f"stiffness of the interface in shear along {axis_name}, where nothing slips",
        read=_sheared(axis, lambda sheared: sheared.interface_stiffness),
        powers=LIKE_STIFFNESSES,
        noun=f"shear stiffness along {axis_name}",
        remark="of the interface, before slip",
        option="friction",
        cost="a linear solve",
        at_full=_interface_at_full,
        law=InLaw(
            short=f"shear_stiffness_{axis_name}",
            per_area="MPa/um",
            key=f"shear_stiffness_{axis_name}_MPa_per_um",
        ),
    )
    slip = Quantity(
        name=f"elastic_slip_{axis_name}",
        unit="um",
        words=f"friction times force over the shear stiffness along {axis_name}",
        read=_sheared(axis, lambda sheared: sheared.elastic_slip),
        powers=LIKE_HEIGHTS,
        noun=f"elastic slip along {axis_name}",
        remark="friction times pressure over that stiffness",
        option="friction",
        cost="a linear solve",
        at_full=_nothing,
        law=InLaw(short=f"elastic_slip_{axis_name}", trend="turns"),
    )
    shifts = [_shift_quantity(axis, share) for share in SHARES]
    losses = [_loss_quantity(axis, share) for share in SHARES]
    return (stiffness, slip, *shifts, *losses)


def _shift_quantity(axis: int, share: float) -> Quantity:
    """Make the record of the shift at a share of the sliding force, one of `SHARES`."""
    axis_name = "xy"[axis]
    percent = f"{100 * share:.0f}"
    name = f"shift_{axis_name}_{percent}"
    return Quantity(
        name=name,
        unit="um",
        words=f"shift of the interface along {axis_name} at {percent} % of the sliding force",
        read=_sheared(axis, lambda sheared: sheared.shift(share)),
        powers=LIKE_HEIGHTS,
        noun=f"shift along {axis_name} at {percent} % of sliding",
        cost="contacts under smaller loads",
        at_full=_nothing,
        law=InLaw(short=name, trend="turns"),
    )


def _loss_quantity(axis: int, share: float) -> Quantity:
    """Make the record of the loss of a cycle up to a share of the sliding force."""
    axis_name = "xy"[axis]
    percent = f"{100 * share:.0f}"
    name = f"loss_{axis_name}_{percent}"
    return Quantity(
        name=name,
        unit="pJ",
        words=f"loss of a cycle along {axis_name} up to {percent} % of the sliding force",
        read=_sheared(axis, lambda sheared: sheared.loss(share)),
        powers=Powers(heights=2, lengths=1, modulus=1),
        noun=f"loss along {axis_name} up to {percent} % of sliding",
        cost="contacts under smaller loads",
        at_full=_nothing,
        law=InLaw(short=name, trend="turns", per_area="J/m2", key=f"{name}_J_per_m2"),
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
        law=InLaw(short="delta", goes_on=True),
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
        law=InLaw(short="area"),
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
        law=InLaw(short="force", goes_on=True),
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
        law=InLaw(short="pressure", goes_on=True),
    ),
    Quantity(
        name="closure",
        unit="um",
        words="Delta less what a uniform pressure displaces the whole patch",
        read=_closure,
        powers=LIKE_HEIGHTS,
        noun="closure",
        cost="a linear solve",
        law=InLaw(short="closure", goes_on=True, derived=True),
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
        law=InLaw(short="contact_nodes"),
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
        law=InLaw(short="yielded"),
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
        law=InLaw(short="largest_yielded_depth"),
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
        law=InLaw(short="mean_gap", trend="falls"),
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
        law=InLaw(short="largest_pressure"),
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
        law=InLaw(short="perimeter", trend="turns"),
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
            short="stiffness",
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
            short="conductance",
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
        law=InLaw(short="gas_conductance", trend="turns"),
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
        law=InLaw(short="joint_conductance", trend="turns", derived=True),
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
        law=InLaw(short="spots", trend="turns"),
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
        law=InLaw(short="mean_spot", trend="turns"),
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
        law=InLaw(short="largest_spot", trend="turns"),
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
        law=InLaw(short="largest_spot_share", trend="turns"),
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
        law=InLaw(short="continuum_area"),
    ),
    _flow_factor(0),
    _hydraulic_aperture(0),
    _flow_factor(1),
    _hydraulic_aperture(1),
    *_shear_quantities(0),
    *_shear_quantities(1),
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
SHEAR_STIFFNESSES = (QUANTITIES["shear_stiffness_x"], QUANTITIES["shear_stiffness_y"])
ELASTIC_SLIPS = (QUANTITIES["elastic_slip_x"], QUANTITIES["elastic_slip_y"])
SLIP_CURVES = tuple(
    quantity for quantity in RECORDS if quantity.name.startswith(("shift_", "loss_"))
)
"""Shifts and losses along x and y, at shear forces up to sliding."""

OF_SHEAR = tuple(
    quantity
    for quantity in RECORDS
    if quantity in {*SHEAR_STIFFNESSES, *ELASTIC_SLIPS, *SLIP_CURVES}
)
"""Quantities that need the friction of an interface, in the order of the columns."""

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

_WITH_OPTIONS = (STIFFNESS, CONDUCTANCE, GAS, JOINT, CONTINUUM, *APERTURES, *OF_SHEAR)
"""Quantities that a law has if options of their own ask for them, apart from `--also`."""

ALSO: dict[str, Quantity] = {
    quantity.name: quantity
    for quantity in RECORDS
    if quantity.law is not None and quantity not in (*ALWAYS_IN_LAWS, *_WITH_OPTIONS)
}
"""Quantities that a law has only if `gen law --also` names them, by these names."""


def _columns_against(*first: Quantity) -> tuple[str, ...]:
    """Return the names of the columns of a law's table.

    The quantities `first` come first, then those with options of their own, then those of `--also`.
    """
    columns = (*first, *_WITH_OPTIONS, *ALSO.values())
    return tuple(quantity.in_laws for quantity in columns)


LAW_COLUMNS: dict[str, tuple[str, ...]] = {
    DELTA.in_laws: _columns_against(AREA, FORCE, MEAN_GAP, PRESSURE, CLOSURE),
    PRESSURE.in_laws: _columns_against(DELTA, CLOSURE, AREA, MEAN_GAP),
}
"""Columns of quantities that a table of a law can have, in order, by the column of its loads."""


def stored_quantities() -> tuple[Quantity, ...]:
    """Return the quantities that databases can have, in the order of the file."""
    return tuple(quantity for quantity in RECORDS if quantity.stored)
