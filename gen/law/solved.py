"""Laws from the solver: every value is that of a contact solved under the given load."""

from collections.abc import Iterable, Sequence

import numpy as np

from gen.arrays import Values
from gen.law.curves import Curves, held, tabulated
from gen.law.points import Points, solved
from gen.law.subjects import Load, Subject
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.progress import RunProgress

MARGIN = 1e-9
"""Relative distance to the hardness within which a mean pressure is it: every node yields."""

ARGUMENTS: dict[Load, str] = {"delta": "delta_um", "pressure": "pressure_MPa"}


def tables(
    surfaces: Sequence[Subject],
    deltas: Values | None,
    pressures: Values | None,
    level: float,
    bodies: Bodies,
    *,
    stiffness: bool = False,
) -> tuple[Curves, Curves, list[str]]:
    """Solve all surfaces under the given loads; tabulate against Delta and against pressure.

    If one kind of load is given, the other table of one surface has the same contacts. For a
    population further contacts are solved for it: a given Delta leads to a pressure on each
    surface, and the second table is at the means of these pressures; likewise the other way round.

    Parameters
    ----------
    surfaces : sequence of Subject
        One surface or more.
    deltas : ndarray, shape (k,) or None
        Ascending displacements above 0, or None [um].
    pressures : ndarray, shape (m,) or None
        Ascending pressures of 0 or more, or None; one of both has to be given [MPa].
    level : float
        Coverage of a population's band.
    bodies : Bodies
        E* and hardness.
    stiffness : bool
        Whether to solve for the stiffness of the interface too.

    Returns
    -------
    over_delta, over_pressure : Curves
        Tables against Delta and against pressure.
    warnings : list of str
        Warnings, one line each.

    Raises
    ------
    InputError
        If a load has no solution, or the solver does not converge.
    """
    asked: dict[Load, Values | None] = {"delta": deltas, "pressure": pressures}

    def solve(load: Load, loads: Values) -> list[Points]:
        return _each(surfaces, load, loads, bodies, stiffness=stiffness)

    solutions = {load: solve(load, loads) for load, loads in asked.items() if loads is not None}
    made: dict[Load, Curves] = {}
    rest = float(np.mean([surface.gap_at_rest for surface in surfaces]))
    both: tuple[tuple[Load, Load], ...] = ("delta", "pressure"), ("pressure", "delta")
    for load, other in both:
        loads, argument = asked[load], ARGUMENTS[load]
        parts = solutions.get(load, solutions.get(other, []))
        if loads is None and len(surfaces) > 1:
            loads = _means(parts, argument)
            possible = _possible_deltas if load == "delta" else _possible_pressures
            loads = possible(loads, surfaces, bodies)
            parts = solve(load, loads)
        if loads is None:
            parts = [_ascending(part, argument) for part in parts]
            loads = parts[0].values[argument]
        if load == "delta" or asked[load] is None:  # pressures that were given stay alone
            parts = [part.from_rest(each) for part, each in zip(parts, surfaces, strict=True)]
            loads = np.append(0.0, loads)
        made[load] = tabulated(argument, loads, [held(part) for part in parts], level, rest)
    return made["delta"], made["pressure"], _warnings(solutions.values())


def _warnings(solutions: Iterable[Sequence[Points]]) -> list[str]:
    """Return the warnings: all of one surface, or the number of surfaces and those of the first."""
    lines: dict[str, None] = {}
    for parts in solutions:
        warned = [part for part in parts if part.warnings]
        many = f"{len(warned)} of {len(parts)} surfaces, the first: " if len(parts) > 1 else ""
        for part in warned[:1]:
            lines |= dict.fromkeys(f"warning: {many}{line}" for line in part.warnings)
    return list(lines)


def _each(
    surfaces: Sequence[Subject], load: Load, loads: Values, bodies: Bodies, *, stiffness: bool
) -> list[Points]:
    """Solve every surface under the same loads."""
    points = []
    with RunProgress(len(surfaces), f"surfaces at given {load}") as progress:
        for surface in surfaces:
            points.append(solved(surface, load, loads.tolist(), bodies, stiffness=stiffness))
            progress.advance(1, 0)
    return points


def _means(parts: Sequence[Points], argument: str) -> Values:
    """Return the ascending means over the surfaces of one quantity, where they are above 0."""
    means = np.unique(np.mean([part.values[argument] for part in parts], axis=0))
    return means[means > 0]


def _possible_deltas(deltas: Values, surfaces: Sequence[Subject], bodies: Bodies) -> Values:
    """Return the displacements that have an equilibrium on every surface [um].

    Elastic bodies without edges are in full contact at a displacement of the mean gap at rest,
    under every pressure that is large enough.
    """
    full = [each.gap_at_rest for each in surfaces if each.boundary != "free"]
    if not full or bodies.hardness is not None:
        return deltas
    possible = deltas[deltas < min(full)]
    if not possible.size:
        raise InputError(
            f"full contact at {min(full):.4g} um on one of the surfaces: give smaller pressures"
        )
    return possible


def _possible_pressures(pressures: Values, _: Sequence[Subject], bodies: Bodies) -> Values:
    """Return the pressures below the hardness, at which every node would yield [MPa]."""
    if bodies.hardness is None:
        return pressures
    possible = pressures[pressures < (1 - MARGIN) * bodies.hardness]
    if not possible.size:
        raise InputError(
            f"every node yields: the pressure is the hardness, {bodies.hardness:.4g} MPa, at all"
            " displacements: give smaller ones"
        )
    return possible


def _ascending(part: Points, argument: str) -> Points:
    """Return the contacts under load, with the argument ascending."""
    values, places = np.unique(part.values[argument], return_index=True)
    return part.chosen(places[values > 0])
