"""Many loads on one surface, each solved from the last ones."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bem.contact import Contact, solve
from bem.problem import Field


def ladder(
    heights: ArrayLike,
    side: float | tuple[float, float],
    deltas: Iterable[float],
    **settings: Any,
) -> Iterator[Contact]:
    """Press a surface further and further, each contact started from those before it.

    The start carries the pressure's change with Delta on from the last three contacts. Results are
    those of `solve` within its tolerance, for fewer convolutions the smaller the steps are
    (`pytest bench -k ladder`). Any order of Delta is allowed.

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
    last: list[Contact] = []
    for delta in deltas:
        contact = solve(heights, side, delta, near=_carried_on(last, delta), **settings)
        yield contact
        last = [*[other for other in last if other.delta != delta][-2:], contact]


def _carried_on(last: list[Contact], delta: float) -> Field | None:
    """Pressure on the parabola in Delta through the last contacts, never negative [MPa].

    None after a single contact: its own pressure would be a worse start than none.
    """
    if len(last) < 2 or last[-1].force == 0:
        return None
    start = np.zeros_like(last[-1].pressure)
    with np.errstate(over="ignore", invalid="ignore"):
        for contact in last:
            weight = 1.0
            for other in last:
                if other is not contact:
                    weight *= (delta - other.delta) / (contact.delta - other.delta)
            start += weight * contact.pressure
    start = np.maximum(start, 0)
    return start if np.isfinite(start).all() else last[-1].pressure
