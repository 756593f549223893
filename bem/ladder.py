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

    The start carries the pressure's change with Delta on from the last two contacts. Results are
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
        last = [*last[-1:], contact]


def _carried_on(last: list[Contact], delta: float) -> Field | None:
    """Pressure on a straight line in Delta through the last two contacts, never negative [MPa]."""
    if not last or last[-1].force == 0:
        return None
    now = last[-1].pressure
    if len(last) < 2 or last[0].delta == last[-1].delta:
        return now
    share = (delta - last[-1].delta) / (last[-1].delta - last[0].delta)
    with np.errstate(over="ignore", invalid="ignore"):
        start = np.asarray(np.maximum(now + share * (now - last[0].pressure), 0))
    return start if np.isfinite(start).all() else now
