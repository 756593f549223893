"""One surface from a file: its contact under one load or many, its statistics."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.measured.topography import Topography
from gen.runtime import memory
from gen.runtime.errors import InputError
from gen.runtime.numbers import values_from
from gen.runtime.table import Row

if TYPE_CHECKING:
    from bem import Contact
    from gen.statistics import Description

LOADS = ("delta", "force", "pressure")
ADVICE = "give a number, several as 1,2,5, or start:stop:count"

# Hardness is rarely above a hundredth of E*: steel of 2 GPa has 230 GPa, and only glasses,
# ceramics and rubber bear more.
YIELDING = 100


def chosen_load(given: dict[str, str]) -> tuple[str, list[float]]:
    """The one load that was given, and its values.

    Parameters
    ----------
    given : text of each option, "" where it was not: a number, start:stop:count, or several with
        commas

    Raises
    ------
    InputError
        For none of them, several, or text that is no number
    """
    chosen = [name for name in LOADS if given[name]]
    if len(chosen) != 1:
        said = " and ".join(f"--{name}" for name in chosen) or "no load"
        raise InputError(f"{said} given: give one of --delta, --force and --pressure")
    name = chosen[0]
    return name, values_from(given[name], f"--{name}", ADVICE)


def solve_loads(
    topography: Topography, load: str, values: Sequence[float], **settings: Any
) -> Iterator[tuple[Contact, float]]:
    """Solve the contact problem of a surface under one load after another.

    Parameters
    ----------
    topography : without holes
    load : "delta" [um], "force" [uN] or "pressure" [MPa]
    values : of the load
    settings : what else `bem.solve` takes

    Yields
    ------
    (contact, seconds) : each solution and the time it took

    Raises
    ------
    InputError
        If a number is not allowed, or there is no solution
    """
    import bem

    memory.require_for_contacts(len(values), topography.heights.shape)
    began = time.perf_counter()
    try:
        for contact in _contacts(topography, load, values, settings):
            yield contact, time.perf_counter() - began
            began = time.perf_counter()
    except (bem.NotConverged, ValueError) as error:
        raise InputError(f"{topography.name}: {error}") from None
    except MemoryError:
        fault = memory.too_little_for_solve(topography.heights.shape)
        raise InputError(f"{topography.name}: {fault}") from None


def warnings_about(
    topography: Topography, contacts: Sequence[Contact], *, material: bool
) -> list[str]:
    """What a user should know before trusting contacts of this surface, a line each.

    Parameters
    ----------
    topography : the surface
    contacts : of it, one or more
    material : whether the modulus is that of a material, so that pressures mean something
    """
    notes = []
    full = [contact.delta for contact in contacts if contact.contact_nodes == contact.pressure.size]
    if full:
        span = f"{np.ptp(topography.heights):.4g}"
        notes.append(
            f"from Delta = {min(full):.4g} um on every node touches, the heights span {span} um:"
            " check the load and the unit of the heights"
        )
    limit = contacts[0].problem.modulus / YIELDING
    over = [contact for contact in contacts if contact.largest_pressure > limit]
    if over and material:
        largest = max(contact.largest_pressure for contact in over)
        begun = f"from Delta = {min(contact.delta for contact in over):.4g} um on, "
        notes.append(
            f"{begun if len(contacts) > 1 else ''}the largest pressure ({largest:.4g} MPa) is above"
            f" E*/{YIELDING:g} = {limit:.4g} MPa, where most materials yield: the true contact area"
            " is larger than this elastic one"
        )
    return notes


def describe(topography: Topography) -> Description:
    """The 22 statistics of a surface without holes."""
    from gen import statistics

    return statistics.describe(topography.heights, topography.spacing)


def statistics_row(
    topography: Topography, description: Description, warnings: Sequence[str]
) -> Row:
    """What `--csv` writes and `learn predict` takes: statistics, grid, steps and warnings."""
    nx, ny = topography.heights.shape
    return {
        **description.values,
        "nodes_x": nx,
        "nodes_y": ny,
        "side_x_um": topography.sides[0],
        "side_y_um": topography.sides[1],
        "prepared": "; ".join(topography.steps),
        "warnings": "; ".join(warnings),
    }


def contact_row(topography: Topography, contact: Contact, warnings: Sequence[str]) -> Row:
    """One line of a law: the load, all that the contact says in numbers, and all warnings."""
    problem = contact.problem
    cells = contact.pressure.size * problem.spacing[0] * problem.spacing[1]
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
        "residual": contact.residual,
        "prepared": "; ".join(topography.steps),
        "warnings": "; ".join(warnings),
    }


def _contacts(
    topography: Topography, load: str, values: Iterable[float], settings: dict[str, Any]
) -> Iterator[Contact]:
    import bem

    loads: dict[str, Any] = {f"{load}s": values}
    return bem.ladder(topography.heights, topography.sides, **loads, **settings)
