"""Contacts of one measured surface under one load or several, and rows of its tables."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gen.material import Bodies
from gen.measured.areal import PARAMETERS
from gen.measured.outcome import NOTHING, Wanted, answers
from gen.measured.preparation import is_tilted
from gen.measured.self_affine import LAW, SelfAffineFit
from gen.measured.topography import Topography
from gen.runtime import memory
from gen.runtime.errors import InputError
from gen.runtime.files import Row, write
from gen.runtime.numbers import values_from
from gen.schema import statistics_columns

if TYPE_CHECKING:
    from bem import Contact
    from gen.statistics import Description

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


def statistics_row(
    topography: Topography, description: Description, warnings: Sequence[str]
) -> Row:
    """Return the row of a table of statistics: values, grid, steps of preparation, warnings."""
    nx, ny = topography.heights.shape
    return {
        **description.values,
        "nodes_x": nx,
        "nodes_y": ny,
        "side_x_um": topography.sides[0],
        "side_y_um": topography.sides[1],
        **_boundary(topography),
        "prepared": "; ".join(topography.steps),
        "warnings": "; ".join(warnings),
    }


def areal_row(areal: Description, depth: float | None, fit: SelfAffineFit | str) -> Row:
    """Return the further cells of a table of statistics: ISO 25178, and the self-affine law."""
    row: Row = {**areal.values, **({} if depth is None else {"Smr_depth": depth})}
    if isinstance(fit, str):
        return {**row, **dict.fromkeys(LAW, ""), "law": f"none: {fit}"}
    return {**row, **fit.values, "law": "; ".join(fit.remarks)}


def units_of(names: Iterable[str]) -> str:
    """Return the units of columns of a table of statistics, as "Sa um; Sk um"."""
    units = {column.name: column.unit for column in statistics_columns()}
    units |= {name: unit for name, unit, _ in PARAMETERS} | LAW | {"Smr_depth": "um"}
    return "; ".join(f"{name} {units[name]}" for name in names if name in units)


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
        **_boundary(topography),
        **yielding,
        **{answer.column: answer.value for answer in answers(contact, wanted)},
        "residual": contact.residual,
        "prepared": "; ".join(topography.steps),
        "warnings": "; ".join(warnings),
    }


def _boundary(topography: Topography) -> Row:
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
