"""Contacts of one surface under one load or several: solutions, answers, warnings, rows."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gen.maps.doubts import is_tilted
from gen.maps.read import Topography
from gen.material import Bodies
from gen.runtime import memory
from gen.runtime.documents import Row
from gen.runtime.errors import InputError
from gen.runtime.files import write
from gen.runtime.numbers import values_from

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
        Whether spots are counted, and the area in the continuum is given.
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
        Answer("continuum_area_percent", contact.continuum_area_percent, "area in the continuum",
               "%, edges counted in part"),
    ]  # fmt: skip


def _directions(connects: Connects) -> str:
    """Say along which axes opposite sides of the patch are connected."""
    return DIRECTIONS[connects]


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


LOADS = ("delta", "force", "pressure")
ADVICE = "give a number, several as 1,2,5, or start:stop:count[:log]"

OUTER = 0.05
"""Share of the lines of nodes on each side whose load is told apart."""

SHOWN = {"delta": "Delta = {:.6g} um", "force": "{:.6g} uN", "pressure": "{:.6g} MPa"}
"""How messages write a load."""

YIELDING = 100
"""E* over the pressure from which a warning is due: the hardness of steel is 2 GPa at 230 GPa, and
only glasses, ceramics and rubber bear more than a hundredth of E*."""


class Solution(NamedTuple):
    """What the solver found under one load.

    Attributes
    ----------
    contact : bem.Contact or None
        The contact; None if the solver did not converge.
    seconds : float
        Time that it took [s].
    fault : str
        The load and why it was not solved; "" if it was.
    """

    contact: Contact | None
    seconds: float
    fault: str = ""


def chosen_load(given: dict[str, str]) -> tuple[str, list[float]]:
    """Return the name and the values of the load that the user gave.

    Parameters
    ----------
    given : dict of str
        Text of each option of `LOADS`, "" if omitted: a number, start:stop:count[:log], or
        several numbers with commas.

    Returns
    -------
    name : str
        One of `LOADS`.
    values : list of float
        Values of the load, in the option's unit.

    Raises
    ------
    InputError
        If none or several of the options were given, or a text is not a number.
    """
    chosen = [name for name in LOADS if given[name]]
    if len(chosen) != 1:
        said = " and ".join(f"--{name}" for name in chosen) or "no load"
        raise InputError(f"{said} given: give one of --delta, --force and --pressure")
    name = chosen[0]
    return name, values_from(given[name], f"--{name}", ADVICE)


def solve_loads(
    topography: Topography, load: str, values: Sequence[float], **settings: Any
) -> Iterator[Solution]:
    """Solve the contact problem of a surface under one load after another.

    A load under which the solver does not converge costs only itself.

    Parameters
    ----------
    topography : Topography
        Surface without holes.
    load : {"delta", "force", "pressure"}
        Quantity that is given.
    values : sequence of float
        Its values: far-field displacement [um], normal force [uN] or mean pressure [MPa].
    **settings
        Further arguments of `bem.solve`.

    Yields
    ------
    Solution
        Solution under one load, in the order of the values.

    Raises
    ------
    InputError
        If a number is not allowed, there is no solution, none of the loads converges, or memory is
        too short.
    """
    import bem

    memory.require_for_contacts(len(values), topography.heights.shape)
    faults: list[str] = []
    try:
        if len(values) > 1:  # the largest load is refused before the first is solved
            _pose(topography, load, max(values), settings)
        contacts = _contacts(topography, load, values, settings)
        for value in values:
            began = time.perf_counter()
            try:
                contact = next(contacts)
            except bem.NotConverged as error:
                shown = f"{SHOWN[load].format(value)}: " if len(values) > 1 else ""
                faults.append(f"{shown}{error}")
                if len(faults) == len(values):
                    raise ValueError(faults[-1]) from None
                yield Solution(None, time.perf_counter() - began, faults[-1])
            else:
                yield Solution(contact, time.perf_counter() - began)
    except ValueError as error:
        raise InputError(f"{topography.name}: {error}") from None
    except MemoryError:
        short = memory.too_little_for_solve(topography.heights.shape)
        raise InputError(f"{topography.name}: {short}") from None


def contact_warnings(
    topography: Topography, contacts: Sequence[Contact], *, material: bool
) -> list[str]:
    """List reasons to distrust contacts of a surface: full contact, and pressures that yield.

    Parameters
    ----------
    topography : Topography
        The surface.
    contacts : sequence of bem.Contact
        At least one contact of the surface.
    material : bool
        Whether the user gave a modulus; without one, pressures are in units of E*.

    Returns
    -------
    list of str
        One line for each warning.
    """
    warnings = []
    problem = contacts[0].problem
    check = "check the load and the unit of the heights"
    if not material and problem.delta is None:
        check = Bodies(problem.modulus).stated
    full = [contact.delta for contact in contacts if contact.contact_nodes == contact.pressure.size]
    if full:
        span = f"{np.ptp(topography.heights):.4g}"
        warnings.append(
            f"from Delta = {min(full):.4g} um on every node touches, the heights span {span} um:"
            f" {check}"
        )
    elif contacts[-1].largest_pressure > problem.modulus and problem.delta is None and not material:
        warnings.append(f"the largest pressure is {contacts[-1].largest_pressure:.4g} MPa: {check}")
    limit = problem.modulus / YIELDING
    beyond = [contact for contact in contacts if contact.largest_pressure > limit]
    if beyond and material and problem.hardness is None:
        largest = max(contact.largest_pressure for contact in beyond)
        bears = (
            f"no solid bears {largest / problem.modulus:.2g} E*, and moduli count in MPa (210e3)"
        )
        start = f"from Delta = {min(contact.delta for contact in beyond):.4g} um on, "
        warnings.append(
            f"{start if len(contacts) > 1 else ''}the largest pressure ({largest:.4g} MPa) is above"
            f" E*/{YIELDING:g} = {limit:.4g} MPa: real metals and polymers would have yielded, and"
            " their contact area is larger than this elastic one; give --hardness"
            + (f", and check E*: {bears}" if largest > problem.modulus else "")
        )
    return warnings


def border_remark(topography: Topography, contacts: Sequence[Contact]) -> str:
    """Say which share of the force the borders of a free patch carry under the last load.

    Parameters
    ----------
    topography : Topography
        The surface.
    contacts : sequence of bem.Contact
        At least one contact of the surface.

    Returns
    -------
    str
        One line, which advises no boundary while the map is tilted; "" for a patch without edges
        or with too few nodes, and without a force.
    """
    pressure = contacts[-1].pressure
    outer = [int(OUTER * nodes) for nodes in pressure.shape]
    if topography.boundary != "free" or min(outer) < 1 or not pressure.any():
        return ""
    (nx, ny), (x, y) = pressure.shape, outer
    share = 1 - float(pressure[x : nx - x, y : ny - y].sum() / pressure.sum())
    nodes = 1 - (nx - 2 * x) * (ny - 2 * y) / pressure.size
    said = (
        f"the outer 5 % on each side ({100 * nodes:.2g} % of the nodes) carry {100 * share:.3g} %"
        f" of the {'last ' if len(contacts) > 1 else ''}force"
    )
    if is_tilted(topography):  # whose mirror images are tilted too
        return said
    return f"{said}: if this is a piece of a larger surface, --boundary mirror leaves no edges"


def contact_row(
    topography: Topography,
    contact: Contact,
    warnings: Sequence[str],
    wanted: Wanted = NOTHING,
) -> Row:
    """Return the row of a table of contacts: load, area, pressures, gap, residual, warnings.

    The columns about yielding are there if the problem has a hardness, the boundary if it is not
    free, and further answers if they are wanted.
    """
    problem = contact.problem
    cells = contact.pressure.size * problem.spacing[0] * problem.spacing[1]
    yielding: Row = {}
    if problem.hardness is not None:
        yielding = {
            "hardness_MPa": problem.hardness,
            "yielded_percent": contact.yielded_percent,
            "largest_yielded_depth_um": float(contact.yielded_depth.max()),
        }
    return {
        "delta_um": contact.delta,
        "approach_um": contact.approach,
        "force_uN": contact.force,
        "pressure_MPa": contact.force / cells,
        "area_percent": contact.area_percent,
        "contact_nodes": contact.contact_nodes,
        "largest_pressure_MPa": contact.largest_pressure,
        "mean_gap_um": contact.mean_gap,
        "perimeter_um": contact.perimeter,
        "modulus_MPa": problem.modulus,
        **boundary_cell(topography),
        **yielding,
        **{answer.column: answer.value for answer in answers(contact, wanted)},
        "residual": contact.residual,
        "prepared": "; ".join(topography.steps),
        "warnings": "; ".join(warnings),
    }


def boundary_cell(topography: Topography) -> Row:
    """Return the cell with the boundary of a patch without edges; nothing for a free patch."""
    return {} if topography.boundary == "free" else {"boundary": topography.boundary}


def require_yielding(flattened: Path | None, hardness: float | None) -> None:
    """Refuse to write a flattened surface of bodies that do not yield, or under another suffix.

    Parameters
    ----------
    flattened : Path or None
        File that the user named for the flattened surface, if any.
    hardness : float or None
        Hardness of the softer body [MPa]; None for elastic bodies.

    Raises
    ------
    InputError
        If a file is named and there is no hardness, or the file is not called .npy.
    """
    if flattened is None:
        return
    if hardness is None:
        raise InputError("--flattened needs --hardness: elastic bodies keep their surface")
    if flattened.suffix.lower() != ".npy":
        raise InputError(f"--flattened {flattened}: give a name that ends in .npy")


def write_flattened(path: Path, contacts: Sequence[Contact], loads: int) -> None:
    """Write the heights that the last load leaves when it is taken off [um] to a .npy file.

    Raises
    ------
    InputError
        If fewer contacts than loads were solved, so that the last load may be missing.
    """
    if len(contacts) < loads:
        raise InputError(f"--flattened {path}: not written, as not every load was solved")
    content = BytesIO()
    np.save(content, contacts[-1].flattened)
    write(path, content.getvalue(), "heights")


def _pose(topography: Topography, load: str, value: float, settings: dict[str, Any]) -> None:
    """Check one load as `bem.solve` does."""
    from bem.problem import pose

    loads: dict[str, Any] = {"delta": None, load: value}
    boundary = topography.boundary
    pose(topography.heights, topography.sides, **loads, boundary=boundary, **settings)


def _contacts(
    topography: Topography, load: str, values: Iterable[float], settings: dict[str, Any]
) -> Iterator[Contact]:
    import bem

    loads: dict[str, Any] = {f"{load}s": values}
    boundary = topography.boundary
    return bem.ladder(topography.heights, topography.sides, **loads, boundary=boundary, **settings)
