"""Contacts at many loads on one surface, started from the contacts at the loads before."""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Iterable, Iterator
from copy import deepcopy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bem.arrays import Field, refuse_masked
from bem.contact import Contact
from bem.equilibrium import Equilibrium, Start, equilibrium_of
from bem.problem import checked_heights, pose
from bem.solving import contact_of
from bem.workers import checked_threads, on_threads

# A load and its equilibrium.
Rung = tuple[float, Equilibrium]


def ladder(
    heights: ArrayLike,
    side: float | tuple[float, float],
    deltas: Iterable[float] | None = None,
    *,
    forces: Iterable[float] | None = None,
    pressures: Iterable[float] | None = None,
    threads: int | None = None,
    **settings: Any,
) -> Iterator[Contact]:
    """Solve for many loads on one surface, each started from the contacts before.

    The start extrapolates the change of pressure with the load from the last three contacts.
    Results are those of `solve` within its tolerance. The smaller the steps are, the fewer
    convolutions a contact takes (`pytest bench -k ladder`). The loads may come in any order;
    ascending loads take the fewest convolutions.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Heights of the surface, see `solve` [um].
    side : float or tuple of float
        Scan length, see `solve` [um].
    deltas : iterable of float, optional
        Far-field displacements Delta [um].
    forces : iterable of float, optional
        Total normal forces instead [uN].
    pressures : iterable of float, optional
        Mean pressures over the cells of all nodes instead [MPa].
    threads : int, optional
        Threads that share the work, see `solve`.
    **settings
        Further arguments of `solve`.

    Returns
    -------
    iterator of Contact
        The contacts, each solved when it is asked for, in the order of the loads. An error belongs
        to one load: whoever catches it can go on with ``next`` to the contact at the next load, so
        that loads that were solved are never lost.

    Raises
    ------
    ValueError, NoSolution, NotConverged
        As `solve` raises them: for the heights at once, else at the load that causes them.
        A load that is not solved from the contacts before is tried from scratch first.
    """
    name, loads = _chosen(delta=deltas, force=forces, pressure=pressures)
    side, settings = deepcopy((side, settings))  # arrays that the caller may fill anew
    return _Ladder(checked_heights(heights), side, name, loads, checked_threads(threads), settings)


class _Ladder(Iterator[Contact]):
    """The contacts of `ladder`. Unlike a generator, it goes on after a load that failed."""

    def __init__(
        self,
        heights: Field,
        side: float | tuple[float, float],
        name: str,
        loads: Iterable[float],
        threads: int | None,
        settings: dict[str, Any],
    ) -> None:
        self._heights, self._side, self._settings = heights, side, settings
        self._name, self._loads, self._threads = name, iter(loads), threads
        self._last: list[Rung] = []

    def __next__(self) -> Contact:
        """Solve for the next load."""
        load = next(self._loads)
        given: dict[str, Any] = {"delta": None, self._name: load}
        problem = pose(self._heights, self._side, **given, **self._settings)
        near = _extrapolated(self._last, load, problem.spacing[0])
        with on_threads(self._threads):
            equilibrium = equilibrium_of(problem, near)
            if near is not None and equilibrium is not None and not equilibrium.converged:
                equilibrium = equilibrium_of(problem, None)
        contact = contact_of(problem, equilibrium)
        if equilibrium is not None:
            others = [rung for rung in self._last if rung[0] != load]
            self._last = [*others[-2:], (load, equilibrium)]
        return contact


def _chosen(**given: Iterable[float] | None) -> tuple[str, Iterable[float]]:
    """Return the name and the values of the one kind of load that was given."""
    chosen = [(name, loads) for name, loads in given.items() if loads is not None]
    if len(chosen) != 1:
        said = " and ".join(f"{name}s" for name, _ in chosen) or "no loads"
        raise ValueError(f"{said} given: give one of deltas [um], forces [uN] and pressures [MPa]")
    name, loads = chosen[0]
    refuse_masked(f"{name}s", loads)
    return name, loads.copy() if isinstance(loads, np.ndarray) else loads


def _extrapolated(last: list[Rung], load: float, spacing: float) -> Start | None:
    """Extrapolate the last equilibria by a parabola in the load, and cut off negative pressure.

    The displacement is linear in the pressure and lies on the same parabola, unless pressure was
    cut off. After a single equilibrium the result is None, which is the better start then.
    """
    if len(last) < 2:
        return None
    pressure, displacement = (np.zeros_like(last[-1][1].pressure) for _ in range(2))
    with np.errstate(over="ignore", invalid="ignore"):
        for mine, equilibrium in last:
            weight = equilibrium.length * math.prod(
                (load - other) / (mine - other) for other, _ in last if other != mine
            )
            pressure += weight / spacing * equilibrium.pressure
            known = equilibrium.displacement
            displacement += weight * (np.nan if known is None else known)
    if not np.isfinite(pressure).all():
        nearest = last[-1][1]
        return Start(nearest.pressure * (nearest.length / spacing))
    if pressure.min() >= 0:
        return Start(pressure, displacement)
    return Start(np.maximum(pressure, 0))
