"""Many loads on one surface, each solved from the last ones."""

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bem.contact import Contact, contact_of, equilibrium_of
from bem.equilibrium import Equilibrium
from bem.problem import Field, pose


def ladder(
    heights: ArrayLike,
    side: float | tuple[float, float],
    deltas: Iterable[float],
    **settings: Any,
) -> Iterator[Contact]:
    """Press a surface further and further, each contact started from those before it.

    The start carries the pressure's change with Delta on from the last three contacts. Results are
    those of `solve` within its tolerance, for fewer convolutions the smaller the steps are
    (`pytest bench -k ladder`). Any order of Delta is allowed; ascending, a start costs least.

    Parameters
    ----------
    heights, side, settings : see `solve`
    deltas : far-field displacements Delta [um]

    Yields
    ------
    Contact, one for each Delta

    Raises
    ------
    ValueError, NoSolution, NotConverged
        as `solve` does, at the Delta that is to blame
    """
    last: list[Equilibrium] = []
    for delta in deltas:
        problem = pose(heights, side, delta, **settings)
        found = equilibrium_of(problem, *_carried_on(last, delta, problem.spacing[0]))
        yield contact_of(problem, found)
        if found is not None:
            last = [*[other for other in last if other.delta != found.delta][-2:], found]


def _carried_on(
    last: list[Equilibrium], delta: float, spacing: float
) -> tuple[Field | None, Field | None]:
    """Pressure on the parabola in Delta through the last equilibria, never negative [E*].

    And the displacement under it [um], which is linear in the pressure and lies on the same
    parabola, where no pressure was cut off. Both None after a single equilibrium: its own pressure
    would be a worse start than none.
    """
    if len(last) < 2:
        return None, None
    start, moved = (np.zeros_like(last[-1].pressure) for _ in range(2))
    with np.errstate(over="ignore", invalid="ignore"):
        for found in last:
            weight = math.prod(
                (delta - other.delta) / (found.delta - other.delta)
                for other in last
                if other is not found
            )
            weight *= found.length
            start += weight / spacing * found.pressure
            moved += weight * (np.nan if found.displacement is None else found.displacement)
    if not np.isfinite(start).all():
        return last[-1].pressure * (last[-1].length / spacing), None
    return (start, moved) if start.min() >= 0 else (np.maximum(start, 0), None)
