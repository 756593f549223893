"""Laws from the solver: every value is that of a contact solved under the load asked for."""

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gen.runtime.progress import RunProgress
from learn.surrogate.law.curves import Curves, held, tabulated
from learn.surrogate.law.points import Points, solved
from learn.surrogate.law.subjects import Subject

Values = NDArray[np.float64]
Load = Literal["delta", "pressure"]

ARGUMENTS: dict[Load, str] = {"delta": "delta_um", "pressure": "pressure_MPa"}


def tables(
    surfaces: Sequence[Subject],
    deltas: Values | None,
    pressures: Values | None,
    level: float,
    e_star: float,
    *,
    material: bool,
) -> tuple[Curves, Curves, list[str]]:
    """Solve all surfaces under the loads asked for; tabulate against Delta and against pressure.

    Where one kind of load was asked for, the other table of one surface has the same contacts. That
    of a population has contacts solved for it, at the means over the surfaces of what the first
    kind of load led to.

    Parameters
    ----------
    surfaces : one or more
    deltas : (k,) ascending, above 0, or None [um]
    pressures : (m,) ascending, 0 or more, or None; not both are None [MPa]
    level : coverage of a population's band
    e_star : E* [MPa]
    material : whether that is a material's, so that pressures mean something

    Returns
    -------
    Both tables, and what to beware of, a line each

    Raises
    ------
    InputError
        If a load has no solution, or the solver does not arrive at one.
    """
    asked: dict[Load, Values | None] = {"delta": deltas, "pressure": pressures}

    def solve(load: Load, loads: Values) -> list[Points]:
        return _each(surfaces, load, loads, e_star, material=material)

    found = {load: solve(load, loads) for load, loads in asked.items() if loads is not None}
    made: dict[Load, Curves] = {}
    both: tuple[tuple[Load, Load], ...] = ("delta", "pressure"), ("pressure", "delta")
    for load, other in both:
        loads, argument = asked[load], ARGUMENTS[load]
        parts = found.get(load, found.get(other, []))
        if loads is None and len(surfaces) > 1:
            loads = _means(parts, argument)
            parts = solve(load, loads)
        if loads is None:
            parts = [_ascending(part, argument) for part in parts]
            loads = parts[0].values[argument]
        if load == "delta" or asked[load] is None:  # pressures that were given stay alone
            parts = [part.from_rest(each) for part, each in zip(parts, surfaces, strict=True)]
            loads = np.append(0.0, loads)
        made[load] = tabulated(argument, loads, [held(part) for part in parts], level)
    return made["delta"], made["pressure"], _warnings(found.values())


def _warnings(solutions: Iterable[Sequence[Points]]) -> list[str]:
    """What to beware of: of one surface all, of many how many there are and the first one's."""
    lines: dict[str, None] = {}
    for parts in solutions:
        warned = [part for part in parts if part.warnings]
        many = f"{len(warned)} of {len(parts)} surfaces, the first: " if len(parts) > 1 else ""
        for part in warned[:1]:
            lines |= dict.fromkeys(f"warning: {many}{line}" for line in part.warnings)
    return list(lines)


def _each(
    surfaces: Sequence[Subject], load: Load, loads: Values, e_star: float, *, material: bool
) -> list[Points]:
    """Solve every surface under the same loads."""
    found = []
    with RunProgress(len(surfaces), "surfaces") as progress:
        for surface in surfaces:
            found.append(solved(surface, load, loads.tolist(), e_star, material=material))
            progress.advance(1, 0)
    return found


def _means(parts: Sequence[Points], argument: str) -> Values:
    """(k,) means over the surfaces of what loads led to, above 0 and ascending."""
    means = np.unique(np.mean([part.values[argument] for part in parts], axis=0))
    return means[means > 0]


def _ascending(part: Points, argument: str) -> Points:
    """The contacts under load, with the argument ascending."""
    values, places = np.unique(part.values[argument], return_index=True)
    return part.chosen(places[values > 0])
