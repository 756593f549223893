"""What a contact decides, as far as it is asked for: spots, stiffness, conductance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from bem import Contact
    from bem.derived.spots import Connects

DIRECTIONS = {
    (False, False): "no",
    (True, False): "x",
    (False, True): "y",
    (True, True): "x and y",
}
"""Along which axes opposite sides of a patch are connected."""


@dataclass(frozen=True)
class Wanted:
    """Answers that are asked for beside area, force and gap.

    Attributes
    ----------
    spots : bool
        Whether spots are counted, and the area is corrected for their perimeter.
    stiffness : bool
        Whether the stiffness is solved for.
    conductivities : tuple of float, optional
        Conductivities of both bodies, which ask for the conductance [W/(m K)].
    """

    spots: bool = False
    stiffness: bool = False
    conductivities: tuple[float, float] | None = None


NOTHING = Wanted()
"""No further answer."""


class Answer(NamedTuple):
    """One answer, as a line of a report and as a cell of a table.

    Attributes
    ----------
    column : str
        Name of the column in tables.
    value : float, int or str
        Value in `unit`; "" where there is none.
    label, unit : str
        Name and unit for people, with a remark where one is due.
    """

    column: str
    value: float | int | str
    label: str
    unit: str

    @property
    def shown(self) -> str:
        """The value as text for people."""
        return f"{self.value:.6g}" if isinstance(self.value, float) else str(self.value) or "-"


def require_conductivities(given: Sequence[float]) -> tuple[float, float] | None:
    """Return the conductivities of both bodies, the same for both if one is given.

    Parameters
    ----------
    given : sequence of float
        What the user gave [W/(m K)]; None is returned if it is empty.

    Raises
    ------
    InputError
        If there are more than two, or one is not above 0 and finite.
    """
    if not given:
        return None
    if len(given) > 2:
        raise InputError(
            f"--conductivity was given {len(given)} times: give it once for two bodies of one"
            " material, or twice"
        )
    for conductivity in given:
        if not 0 < conductivity < math.inf:
            raise InputError(f"--conductivity {conductivity:g}: must be above 0 W/(m K), finite")
    return given[0], given[-1]


def answers(contact: Contact, wanted: Wanted) -> list[Answer]:
    """Compute the answers that are asked for.

    Parameters
    ----------
    contact : bem.Contact
        The contact.
    wanted : Wanted
        What is asked for.

    Raises
    ------
    InputError
        If the linear solve for the stiffness does not converge.
    """
    found = _spots(contact) if wanted.spots else []
    try:
        if wanted.stiffness:
            found += _stiffness(contact)
        if wanted.conductivities is not None:
            found += _conductance(contact, *wanted.conductivities)
    except ArithmeticError as error:
        raise InputError(str(error)) from None
    return found


def _spots(contact: Contact) -> list[Answer]:
    """Return the answers about spots of contact."""
    spots, cell = contact.spots, math.prod(contact.problem.spacing)
    largest = float(spots.areas[0]) if spots.number else 0.0
    share = 100 * spots.largest_share
    return [
        Answer("spots", spots.number, "spots of contact", "nodes that touch along their sides"),
        Answer("mean_spot_um2", float(spots.areas.mean()) if spots.number else 0.0, "mean spot",
               f"um2, a node has {cell:.4g}"),
        Answer("largest_spot_um2", largest, "largest spot", f"um2, {share:.4g} % of the contact"),
        Answer("largest_spot_percent", share, "its share", "% of the contact area"),
        Answer("contact_connects", _directions(spots.contact_connects), "contact connects sides",
               "along x, y"),
        Answer("gap_connects", _directions(spots.gap_connects), "gap connects sides", "along x, y"),
        _corrected_area(contact),
    ]  # fmt: skip


def _directions(connects: Connects) -> str:
    """Say along which axes opposite sides of the patch are connected."""
    return DIRECTIONS[connects]


def _corrected_area(contact: Contact) -> Answer:
    """Return the corrected area; none for oblong cells."""
    column, label = "corrected_area_percent", "area in the continuum"
    try:
        return Answer(column, contact.corrected_area_percent, label, "%, edges counted in part")
    except ValueError:
        return Answer(column, "", label, "needs square cells")


def _stiffness(contact: Contact) -> list[Answer]:
    """Return the answers about stiffness; MPa um are N/m."""
    found = [Answer("stiffness_N_per_m", contact.stiffness, "stiffness", "N/m, of unloading")]
    if contact.problem.hardness is not None:
        loading = contact.loading_stiffness
        found.append(
            Answer("loading_stiffness_N_per_m", loading, "stiffness of loading", "N/m, dF/dDelta")
        )
    return [
        *found,
        Answer("interface_stiffness_N_per_m", contact.interface_stiffness,
               "interface's stiffness", _alone("N/m", contact)),
    ]  # fmt: skip


def _conductance(contact: Contact, k1: float, k2: float) -> list[Answer]:
    """Return the answers about conductance; conductivities times um are uW/K."""
    nominal = contact.pressure.size * math.prod(contact.problem.spacing)
    interface = contact.interface_conductance(k1, k2)
    return [
        Answer("conductance_W_per_K", 1e-6 * contact.conductance(k1, k2), "conductance", "W/K"),
        Answer("interface_conductance_W_per_K", 1e-6 * interface, "interface's conductance",
               _alone("W/K", contact)),
        Answer("interface_conductance_W_per_m2_K", 1e6 * interface / nominal, "per nominal area",
               _alone("W/(m2 K)", contact)),
    ]  # fmt: skip


def _alone(unit: str, contact: Contact) -> str:
    """Return a unit with a remark on what the interface leaves out."""
    if contact.interface_stiffness == math.inf:
        return f"{unit}: full contact, in which nothing but the bodies is left"
    if contact.problem.boundary == "free":
        return f"{unit}, without the patch's own constriction"
    return unit
