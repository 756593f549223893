"""Many loads on one surface, each solved from the last ones."""

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bem.contact import Contact, contact_of, equilibrium_of
from bem.equilibrium import Equilibrium, Start
from bem.problem import pose

Rung = tuple[float, Equilibrium]  # a load, and what it led to


def ladder(
    heights: ArrayLike,
    side: float | tuple[float, float],
    deltas: Iterable[float] | None = None,
    *,
    forces: Iterable[float] | None = None,
    pressures: Iterable[float] | None = None,
    **settings: Any,
) -> Iterator[Contact]:
    """Press a surface further and further, each contact started from those before it.

    The start carries the pressure's change with the load on from the last three contacts. Results
    are those of `solve` within its tolerance, for fewer convolutions the smaller the steps are
    (`pytest bench -k ladder`). Any order of loads is allowed; ascending, a start costs least.

    Parameters
    ----------
    heights, side, settings : see `solve`
    deltas : far-field displacements Delta [um]
    forces : total normal forces instead [uN]
    pressures : mean pressures over the cells of all nodes instead [MPa]

    Yields
    ------
    Contact, one for each load

    Raises
    ------
    ValueError, NoSolution, NotConverged
        as `solve` does, at the load that is to blame
    """
    name, loads = _chosen(delta=deltas, force=forces, pressure=pressures)
    last: list[Rung] = []
    for load in loads:
        given: dict[str, Any] = {"delta": None, name: load}
        problem = pose(heights, side, **given, **settings)
        found = equilibrium_of(problem, _carried_on(last, load, problem.spacing[0]))
        yield contact_of(problem, found)
        if found is not None:
            last = [*[rung for rung in last if rung[0] != load][-2:], (load, found)]


def _chosen(**given: Iterable[float] | None) -> tuple[str, Iterable[float]]:
    """The one kind of load that was given."""
    chosen = [(name, loads) for name, loads in given.items() if loads is not None]
    if len(chosen) != 1:
        said = " and ".join(f"{name}s" for name, _ in chosen) or "no loads"
        raise ValueError(f"{said} given: give one of deltas [um], forces [uN] and pressures [MPa]")
    return chosen[0]


def _carried_on(last: list[Rung], load: float, spacing: float) -> Start | None:
    """The parabola in the load through the last equilibria, where pressure is never negative.

    The displacement under the pressure is linear in it and lies on the same parabola, where no
    pressure was cut off. None after a single equilibrium: it would be a worse start than none.
    """
    if len(last) < 2:
        return None
    pressure, moved = (np.zeros_like(last[-1][1].pressure) for _ in range(2))
    approach = 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        for mine, found in last:
            weight = math.prod(
                (load - other) / (mine - other) for other, _ in last if other != mine
            )
            approach += weight * found.approach
            weight *= found.length
            pressure += weight / spacing * found.pressure
            moved += weight * (np.nan if found.displacement is None else found.displacement)
    if not np.isfinite(pressure).all() or not math.isfinite(approach):
        nearest = last[-1][1]
        return Start(nearest.pressure * (nearest.length / spacing), None, nearest.approach)
    if pressure.min() >= 0:
        return Start(pressure, moved, approach)
    return Start(np.maximum(pressure, 0), None, approach)
