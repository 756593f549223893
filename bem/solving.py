"""Contact problems solved: from heights and a load to a `Contact`, and ladders of loads."""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bem.arrays import Field
from bem.checks import refuse_masked, shown
from bem.contact import Contact
from bem.equilibrium import Equilibrium, Start, equilibrium_of
from bem.influence import Kernel
from bem.problem import (
    MAX_ITERATIONS,
    RTOL,
    Boundary,
    FarField,
    Problem,
    checked,
    checked_heights,
    checked_start,
    pose,
)
from bem.threads import on_threads

# Sides of a cell, the longer over the shorter, up to which patches without edges were tested: all
# of 3,000 random problems are solved (`pytest -m "long or not long" tests/bem/test_edgeless.py`).
OBLONG = 100

# Relative distance below which a pressure is the hardness: a few roundings.
ULPS = 1e-15


# A load and its equilibrium.
Rung = tuple[float, Equilibrium]


class NotConverged(ArithmeticError):
    """The tolerance was not met; `contact` carries the numbers that were reached.

    Attributes
    ----------
    contact : Contact
        The contact reached, whose residual is above the tolerance of its problem.
    stalled : bool
        Whether rounding left no step that would come nearer, so that more iterations would change
        nothing; otherwise the bound on iterations was met.
    """

    def __init__(self, contact: Contact, stalled: bool = False) -> None:
        self.contact = contact
        self.stalled = stalled
        problem, remedy = contact.problem, ""
        if problem.boundary != "free" and problem.elongation > OBLONG:
            remedy = f": cells of 1:{problem.elongation:.4g} are beyond 1:{OBLONG}, the most tested"
        elif stalled:
            remedy = ": rounding leaves no smaller one; raise rtol"
        elif (
            contact.iterations >= problem.max_iterations
            and (
                problem.max_iterations < MAX_ITERATIONS
                or problem.far_field == "compliant"
            )
        ):  # with the default, raising it was seen to help near the Delta* of such a far field only
            remedy = f": raise max_iterations ({problem.max_iterations})"
        super().__init__(
            f"residual {contact.residual:.1e} after {contact.iterations} iterations, asked for"
            f" {problem.rtol:.1e}{remedy}"
        )

    def __reduce__(self) -> tuple[type[NotConverged], tuple[Contact, bool]]:
        """Let the error be pickled, so that worker processes can raise it."""
        return NotConverged, (self.contact, self.stalled)


def solve(
    heights: ArrayLike,
    side: float | tuple[float, float],
    delta: float | None = None,
    *,
    force: float | None = None,
    pressure: float | None = None,
    spacing: float | tuple[float, float] | None = None,
    modulus: float = 1.0,
    poisson: float = 0.0,
    kernel: Kernel = "uniform-pressure",
    far_field: FarField = "rigid",
    boundary: Boundary = "free",
    hardness: float | None = None,
    rtol: float = RTOL,
    max_iterations: int = MAX_ITERATIONS,
    near: Field | None = None,
    threads: int | None = None,
) -> Contact:
    """Press a rigid rough surface into an elastic half-space, without friction or adhesion.

    Finds the pressure p >= 0 with gap w = H p - (z - z_max + Delta) >= 0 and p w = 0 (paper,
    section 2.4). With a hardness P the softer body yields: p <= P, and w <= 0 where p = P, by the
    depth that it has yielded there (Almqvist, Sahlin, Larsson and Glavatskih 2007, Tribology
    International 40). The body neither hardens nor piles up, and P is the same everywhere.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Heights z of the surface; the highest node touches at Delta = 0 [um].
    side : float or tuple of float
        Scan length L, one for a square grid or one for each axis [um].
    delta : float, optional
        Far-field displacement Delta; at 0 or below nothing carries load [um]. Exactly one of
        `delta`, `force` and `pressure` is needed.
    force : float, optional
        Total normal force F, from which Delta follows [uN].
    pressure : float, optional
        Mean pressure over the cells of all nodes, in contact or not [MPa].
    spacing : float or tuple of float, optional
        Distance of the nodes, one or one for each axis. By default side / (nodes - 1) with free
        boundaries (MIRCO uses side / nodes there), and side / nodes with the others [um].
    modulus : float
        Young's modulus E [MPa].
    poisson : float
        Poisson's ratio nu, in (-1, 0.5] [1].
    kernel : str
        "uniform-pressure" (Love 1929), or "concentrated-force", which reproduces MIRCO's results
        (see `bem.influence.influence_coefficients`) and needs square cells.
    far_field : str
        "rigid": Delta as it is given. "compliant": Delta + F / K with the stiffness K of a flat
        punch that fills the patch (MIRCO).
    boundary : str
        "free": the patch is all that there is, as in the paper. "periodic": the patch repeats
        itself along both axes without end. "mirror": its mirror images continue it, which leaves
        no step at its borders whatever the surface is. The last two stand for a piece of a larger
        interface: waves of pressure p(q) of wavenumber q displace the half-space by
        2 p(q) / (E* q) (Johnson 1985, section 13.2), with zero mean, from which Delta is counted.
        They have no kernel to choose, and a rigid far field only. Tested are cells of 1:1 to
        1:100; longer ones are tried, and may end as NotConverged.
    hardness : float, optional
        Largest contact pressure P, the hardness of the softer body [MPa]; on a rigid far field
        only. Without it the bodies are elastic.
    rtol : float
        Largest absolute gap in contact, or penetration outside, that is accepted, over Delta
        [1]. The default is the loosest of a ladder that counts the contact nodes of 99.9 % of the
        paper preset's samples exactly.
    max_iterations : int
        Bound on the steps of conjugate gradients and contact sets of dense algebra. Where contact
        sets cycle on a patch without edges, four times as many cheaper passes may follow.
    near : ndarray, shape (nx, ny), optional
        Pressure near the solution to start from, as `ladder` does [MPa].
    threads : int, optional
        Threads that share the work of grids with some 500 nodes a side or more; smaller ones take
        one. The results are the same to the last bit on any number. By default as many as the
        environment variable OMP_NUM_THREADS says, or one.

    Returns
    -------
    Contact
        Pressure, area, force and the other results.

    Raises
    ------
    ValueError
        For input that no contact problem can have; the message names what was given and what is
        allowed. OutOfRange, a ValueError, where double precision could not hold the results.
    NoSolution
        For a compliant far field with Delta at or beyond Delta*, for a patch without edges with
        Delta at or beyond that of full contact, and for a mean pressure that is not below the
        hardness.
    NotConverged
        If `max_iterations` did not suffice, or `rtol` is below what rounding allows. It carries
        the numbers that were reached.
    """
    problem = pose(
        heights,
        side,
        delta,
        force=force,
        pressure=pressure,
        spacing=spacing,
        modulus=modulus,
        poisson=poisson,
        kernel=kernel,
        far_field=far_field,
        boundary=boundary,
        hardness=hardness,
        rtol=rtol,
        max_iterations=max_iterations,
    )
    start = (
        None if near is None else Start(checked_start(near, problem) / problem.modulus)
    )
    with on_threads(None if threads is None else checked("threads", threads)):
        return contact_of(problem, equilibrium_of(problem, start))


def solve_posed(problem: Problem, near: Field | None = None) -> Contact:
    """Solve a problem that was checked, from a pressure near the solution [MPa] if there is one.

    Raises
    ------
    NotConverged
        If the tolerance is not met.
    """
    start = None if near is None else Start(near / problem.modulus)
    if problem.datum is None:
        return contact_of(problem, equilibrium_of(problem, start))
    by_own_node = replace(problem, datum=None)
    if problem.delta is not None:
        by_own_node = replace(by_own_node, delta=problem.delta - problem.datum)
    contact = contact_of(by_own_node, equilibrium_of(by_own_node, start))
    return replace(
        contact,
        problem=problem,
        delta=contact.delta + problem.datum,
        approach=contact.approach + problem.datum,
    )


def contact_of(problem: Problem, equilibrium: Equilibrium | None) -> Contact:
    """Convert an equilibrium from reduced units to a `Contact`.

    Parameters
    ----------
    problem : Problem
        The problem that was solved.
    equilibrium : Equilibrium or None
        Its equilibrium; None if the bodies are apart or just touch.

    Raises
    ------
    NotConverged
        If the equilibrium does not meet the tolerance of the problem.
    """
    if equilibrium is None:
        return _untouched(problem)
    unit = equilibrium.length / problem.spacing[0] * problem.modulus
    touching = int(np.count_nonzero(equilibrium.pressure > 0))
    pressure = equilibrium.pressure * unit
    if problem.hardness is not None:  # units may have cost the last digit
        pressure[np.abs(pressure - problem.hardness) <= ULPS * problem.hardness] = (
            problem.hardness
        )
    pressure.setflags(write=False)
    contact = Contact(
        problem=problem,
        pressure=pressure,
        force=float(equilibrium.pressure.sum())
        * unit
        * (problem.spacing[0] * problem.spacing[1]),
        area_percent=100.0 * touching / equilibrium.pressure.size,
        contact_nodes=touching,
        delta=equilibrium.delta,
        approach=equilibrium.approach,
        residual=equilibrium.violation,
        iterations=equilibrium.effort.iterations,
        convolutions=equilibrium.effort.convolutions,
        again=solve_posed,
    )
    if equilibrium.converged:
        return contact
    # Without convergence, nodes that the solver left aside count too.
    unit = problem.delta or contact.approach
    contact = replace(
        contact, residual=_violation(contact) / unit if unit > 0 else math.inf
    )
    exceeded = (
        problem.hardness is not None and contact.largest_pressure > problem.hardness
    )
    if (
        exceeded or not contact.residual <= problem.rtol
    ):  # a residual that is nan is refused too
        raise NotConverged(contact, equilibrium.stalled)
    return contact


def _violation(contact: Contact) -> float:
    """Compute the largest |gap| in contact or penetration outside, by one convolution [um]."""
    violations = np.where(contact.pressure > 0, np.abs(contact.gap), -contact.gap)
    return max(float(violations.max()), 0.0)


def _untouched(problem: Problem) -> Contact:
    """Return the contact of bodies that are apart or just touch."""
    pressure = np.zeros(problem.heights.shape)
    pressure.setflags(write=False)
    return Contact(
        problem=problem,
        pressure=pressure,
        force=0.0,
        area_percent=0.0,
        contact_nodes=0,
        delta=problem.delta or 0.0,
        approach=problem.delta or 0.0,
        residual=0.0,
        iterations=0,
        convolutions=0,
        again=solve_posed,
    )


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
    given = {"delta": deltas, "force": forces, "pressure": pressures}
    chosen = [(name, loads) for name, loads in given.items() if loads is not None]
    if len(chosen) != 1:
        said = " and ".join(f"{name}s" for name, _ in chosen) or "no loads"
        raise ValueError(
            f"{said} given: give one of deltas [um], forces [uN] and pressures [MPa]"
        )
    name, loads = chosen[0]
    refuse_masked(f"{name}s", loads)
    scalar = isinstance(loads, np.ndarray) and loads.ndim == 0
    if scalar or isinstance(loads, str) or not isinstance(loads, Iterable):
        raise ValueError(f"{name}s = {shown(loads)}: a sequence of loads is needed")
    loads = loads.copy() if isinstance(loads, np.ndarray) else loads
    side, settings = deepcopy((side, settings))  # arrays that the caller may fill anew
    if threads is not None:
        threads = checked("threads", threads)
    return _Ladder(checked_heights(heights), side, name, iter(loads), threads, settings)


@dataclass
class _Ladder(Iterator[Contact]):
    """The contacts of `ladder`. Unlike a generator, it goes on after a load that failed."""

    _heights: Field
    _side: float | tuple[float, float]
    _name: str
    _loads: Iterator[float]
    _threads: int | None
    _settings: dict[str, Any]
    _last: list[Rung] = field(default_factory=list)

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


def _extrapolated(last: list[Rung], load: float, spacing: float) -> Start | None:
    """Extrapolate the last equilibria by a parabola in the load, and cut off negative pressure.

    The displacement is linear in the pressure and lies on the same parabola, unless pressure was
    cut off. After a single equilibrium the result is None, which is the better start then.
    """
    if len(last) < 2:
        return None
    weighted = [
        (
            math.prod(
                (load - other) / (mine - other) for other, _ in last if other != mine
            ),
            equilibrium,
        )
        for mine, equilibrium in last
    ]
    nothing = np.zeros_like(last[0][1].pressure)
    with np.errstate(over="ignore", invalid="ignore"):
        pressure = sum(
            (each.length * weight / spacing * each.pressure for weight, each in weighted),
            nothing,
        )
        if not np.isfinite(pressure).all():
            nearest = last[-1][1]
            return Start(nearest.pressure * (nearest.length / spacing))
        if pressure.min() < 0 or any(each.displacement is None for _, each in last):
            return Start(np.maximum(pressure, 0))
        moved = (
            each.length * weight * displacement
            for weight, each in weighted
            if (displacement := each.displacement) is not None
        )
        return Start(pressure, sum(moved, nothing))
