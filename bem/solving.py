"""Solve contact problems: from heights and a load to a `Contact`, or along a ladder of loads."""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field, replace
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bem.arrays import Field
from bem.bodies import Body, Kernel
from bem.checks import refuse_masked, shown
from bem.contact import Contact
from bem.equilibrium import Equilibrium, Start, equilibrium_of
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

# Largest ratio of a cell's longer side to its shorter one for which patches without edges were
# tested [1]: all of 3,000 random problems are solved (`pytest -m "long or not long"
# tests/bem/test_edgeless.py`).
OBLONG = 100

# Relative distance from the hardness below which a pressure is set to it [1]: a few roundings, by
# which the conversion of units may miss it.
ULPS = 1e-15

# Largest number of contacts of a ladder from whose pressures the start of the next contact is
# extrapolated.
EXTRAPOLATED = 3

# Names of the further arguments that `ladder` takes: the arguments of `pose` except the surface and
# the load.
SETTINGS = signature(pose).parameters.keys() - {
    "heights",
    "side",
    "delta",
    "force",
    "pressure",
}


@dataclass(frozen=True, eq=False)
class Rung:
    """A load of a ladder that has been solved.

    Attributes
    ----------
    load : float
        Load, in the unit of the ladder's quantity.
    equilibrium : Equilibrium
        The equilibrium under this load.
    """

    load: float
    equilibrium: Equilibrium


class NotConverged(ArithmeticError):
    """The error that the tolerance is not met; it carries the numbers that were reached.

    Attributes
    ----------
    contact : Contact
        The contact that was reached, whose residual is above the tolerance of its problem.
    stalled : bool
        Whether rounding left no step that would come nearer, so that more iterations would change
        nothing. Otherwise the bound on iterations was reached.
    """

    def __init__(self, contact: Contact, stalled: bool = False) -> None:
        self.contact = contact
        self.stalled = stalled
        super().__init__(
            f"residual {contact.residual:.1e} after {contact.iterations} iterations, asked for"
            f" {contact.problem.rtol:.1e}{_remedy(contact, stalled)}"
        )

    def __reduce__(self) -> tuple[type[NotConverged], tuple[Contact, bool]]:
        """Let the error be pickled, so that worker processes can raise it."""
        return NotConverged, (self.contact, self.stalled)


def _remedy(contact: Contact, stalled: bool) -> str:
    """Return the end of `NotConverged`'s message: the cause or a remedy; "" if neither is known."""
    problem = contact.problem
    if problem.boundary != "free" and problem.elongation > OBLONG:
        return f": cells of 1:{problem.elongation:.4g} are beyond 1:{OBLONG}, the most tested"
    if stalled:
        return ": rounding leaves no smaller one; raise rtol"
    if contact.iterations < problem.max_iterations:
        return ""
    # Raising the default was seen to help only near the Delta* of a compliant far field.
    if problem.max_iterations < MAX_ITERATIONS or problem.far_field == "compliant":
        return f": raise max_iterations ({problem.max_iterations})"
    return ""


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
    body: Body | tuple[Body, Body] | None = None,
    boundary: Boundary = "free",
    hardness: float | None = None,
    rtol: float = RTOL,
    max_iterations: int = MAX_ITERATIONS,
    near: Field | None = None,
    threads: int | None = None,
) -> Contact:
    """Press a rigid rough surface into an elastic half-space, without friction or adhesion.

    Find the pressure p >= 0 with the gap w = H p - (z - z_max + Delta) >= 0 and p w = 0 (paper,
    section 2.4). With a hardness P the softer body yields: p <= P, and where p = P, -w >= 0 is the
    depth by which it has yielded (Almqvist, Sahlin, Larsson and Glavatskih 2007, Tribology
    International 40). The body neither hardens nor piles up, and P is uniform.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Heights z of the surface; the highest node touches at Delta = 0 [um].
    side : float or tuple of float
        Scan length L: one for a square grid, or one for each axis [um].
    delta : float, optional
        Far-field displacement Delta; at 0 or below nothing carries load [um]. Exactly one of
        `delta`, `force` and `pressure` is needed.
    force : float, optional
        Total normal force F, from which Delta follows [uN].
    pressure : float, optional
        Mean pressure over the cells of all nodes, in contact or not [MPa].
    spacing : float or tuple of float, optional
        Distance of the nodes: one for both axes, or one for each. By default it is
        side / (nodes - 1) with free boundaries, where MIRCO uses side / nodes, and side / nodes
        with the other boundaries [um].
    modulus : float
        Young's modulus E [MPa].
    poisson : float
        Poisson's ratio nu, in (-1, 0.5] [1].
    kernel : str
        "uniform-pressure" (Love 1929), or "concentrated-force", which reproduces MIRCO's results
        (see `bem.influence.influence_coefficients`) and needs square cells.
    far_field : str
        "rigid": the far field moves by Delta. "compliant": it moves by Delta + F / K with the
        stiffness K of a flat punch that fills the patch (MIRCO).
    body : Body or tuple of two Body, optional
        The elastic body in place of `modulus`, `poisson`, `kernel` and `far_field`: a
        `bem.HalfSpace`, a `bem.Layered`, or two, (a, b), whose compliances add. E* is that of the
        material at the surface. On a patch without edges the mean pressure displaces a layer on a
        rigid base as well, which is part of Delta. On a free patch a layer has at least a fifth of
        the thickness of a cell, and other bodies than these two are refused.
    boundary : str
        "free": nothing surrounds the patch, as in the paper. "periodic": the patch repeats itself
        along both axes without end. "mirror": its mirror images continue it, which leaves no step
        at its borders whatever the surface is. "periodic" and "mirror" model a piece of a larger
        interface: waves of pressure p(q) of wavenumber q displace a half-space by 2 p(q) / (E* q)
        (Johnson 1985, section 13.2). The mean pressure displaces no half-space: Delta counts from
        the mean of the deformed surface. They have no choice of kernel, and a rigid far field only.
        Cells of 1:1 to 1:100 are tested; longer cells may raise NotConverged.
    hardness : float, optional
        Largest contact pressure P, the hardness of the softer body, on a rigid far field only
        [MPa]. Without it the bodies are elastic.
    rtol : float
        Largest absolute gap in contact, or penetration outside, that is accepted. It is relative to
        Delta; if the force is given, to the approach without the displacement by the mean pressure
        [1]. Of the tolerances tried, the default is the loosest with which 99.9 % of the paper
        preset's samples have exactly the right contact nodes.
    max_iterations : int
        Bound on the steps of conjugate gradients and the contact sets of dense algebra. Where
        contact sets cycle on a patch without edges, up to four times this number of cheaper passes
        may follow.
    near : ndarray, shape (nx, ny), optional
        Pressure near the solution, from which the solve starts [MPa].
    threads : int, optional
        Number of threads that share the work of grids with about 500 nodes a side or more; smaller
        grids take one. The results are the same to the last bit on any number. By default it is
        the number that the environment variable OMP_NUM_THREADS holds, or one.

    Returns
    -------
    Contact
        Pressure, force, area, gap, and the results that follow from them.

    Raises
    ------
    ValueError
        If an argument is not allowed; the message shows its value and the allowed ones. It is an
        OutOfRange, which is a ValueError, if double precision could not hold the results.
    NoSolution
        If Delta is at or beyond Delta* on a compliant far field, or at or beyond full contact of
        elastic bodies on a patch without edges; or if the mean pressure is not below the hardness.
    NotConverged
        If `max_iterations` did not suffice, or rounding does not allow `rtol`. It carries
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
        body=body,
        boundary=boundary,
        hardness=hardness,
        rtol=rtol,
        max_iterations=max_iterations,
    )
    start = None
    if near is not None:
        start = Start(checked_start(near, problem) / problem.modulus)  # [E*]
    if threads is not None:
        threads = checked("threads", threads)
    with on_threads(threads):
        return contact_of(problem, equilibrium_of(problem, start))


def solve_posed(problem: Problem, near: Field | None = None) -> Contact:
    """Solve a problem that has been checked.

    Where the problem has a datum, it is solved with Delta from its own highest node, and Delta and
    the approach are converted back.

    Parameters
    ----------
    problem : Problem
        The problem.
    near : ndarray, shape (nx, ny), optional
        Pressure near the solution, from which the solve starts. It is not checked: it has to be
        finite and nowhere negative [MPa].

    Returns
    -------
    Contact
        The contact, see `solve`.

    Raises
    ------
    NoSolution
        If Delta is at or beyond Delta* on a compliant far field (BeyondCriticalDelta).
    NotConverged
        If the tolerance is not met.
    ArithmeticError
        If the flat punch of a compliant far field is not solved.
    """
    start = None
    if near is not None:
        start = Start(near / problem.modulus)  # [E*]
    if problem.datum is None:
        return contact_of(problem, equilibrium_of(problem, start))
    from_highest_node = replace(problem, datum=None)
    if problem.delta is not None:
        delta = problem.delta - problem.datum
        from_highest_node = replace(from_highest_node, delta=delta)
    contact = contact_of(from_highest_node, equilibrium_of(from_highest_node, start))
    return replace(
        contact,
        problem=problem,
        delta=contact.delta + problem.datum,
        approach=contact.approach + problem.datum,
    )


def contact_of(problem: Problem, equilibrium: Equilibrium | None) -> Contact:
    """Convert an equilibrium from reduced units to a `Contact`, or refuse it.

    Parameters
    ----------
    problem : Problem
        The problem that was solved.
    equilibrium : Equilibrium or None
        Its equilibrium; None if the bodies are apart or just touch.

    Returns
    -------
    Contact
        The contact in um, MPa and uN, its pressure read-only.

    Raises
    ------
    NotConverged
        If the equilibrium does not meet the tolerance of the problem.
    """
    if equilibrium is None:
        return _untouched(problem)
    contact = _converted(problem, equilibrium)
    if equilibrium.converged:
        return contact
    # Measure the violation on all nodes, because the solver may have computed only some of them.
    unit = problem.delta or (contact.approach - problem.mean_displacement)
    residual = math.inf
    if unit > 0:
        residual = _violation(contact) / unit
    contact = replace(contact, residual=residual)
    hardness = problem.hardness
    exceeded = hardness is not None and contact.largest_pressure > hardness
    if exceeded or not contact.residual <= problem.rtol:  # also a residual that is nan
        raise NotConverged(contact, equilibrium.stalled)
    return contact


def _converted(problem: Problem, equilibrium: Equilibrium) -> Contact:
    """Return an equilibrium as a contact in um, MPa and uN, whether or not it has converged."""
    unit = equilibrium.length / problem.spacing[0] * problem.modulus  # of pressure [MPa]
    touching = int(np.count_nonzero(equilibrium.pressure > 0))
    pressure = equilibrium.pressure * unit
    if problem.hardness is not None:
        at_hardness = np.abs(pressure - problem.hardness) <= ULPS * problem.hardness
        pressure[at_hardness] = problem.hardness
    pressure.setflags(write=False)
    cell_area = problem.spacing[0] * problem.spacing[1]
    return Contact(
        problem=problem,
        pressure=pressure,
        force=float(equilibrium.pressure.sum()) * unit * cell_area,
        area_percent=100.0 * touching / equilibrium.pressure.size,
        contact_nodes=touching,
        delta=equilibrium.delta,
        approach=equilibrium.approach,
        residual=equilibrium.violation,
        iterations=equilibrium.effort.iterations,
        convolutions=equilibrium.effort.convolutions,
        again=solve_posed,
    )


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
    """Solve under many loads on one surface, each from a start that earlier contacts give.

    The start extrapolates the change of pressure with the load from the last three contacts.
    Results equal those of `solve` within its tolerance. The smaller the steps are, the fewer
    convolutions a contact takes (`pytest bench -k ladder`). The loads may have any order; ascending
    loads take the fewest convolutions.

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
        Number of threads that share the work, see `solve`.
    **settings
        Further arguments of `solve`, except `near`.

    Returns
    -------
    iterator of Contact
        The contacts in the order of the loads, each solved when it is taken. An error belongs to
        one load: whoever catches it can go on with ``next`` to the next load, so that no contact is
        lost.

    Raises
    ------
    TypeError
        If `settings` has a name that is none of these arguments, at once.
    ValueError, NoSolution, NotConverged
        As `solve` raises them: for the heights, the number of threads and the form of the loads at
        once, else at the load that causes them. NotConverged comes only after the load has also
        been tried without a start.
    """
    unknown = sorted(settings.keys() - SETTINGS)
    if unknown:
        raise TypeError(
            f"ladder() takes no argument {unknown[0]}: it takes {', '.join(sorted(SETTINGS))}"
        )
    by_quantity = {"delta": deltas, "force": forces, "pressure": pressures}
    passed = {name: loads for name, loads in by_quantity.items() if loads is not None}
    if len(passed) != 1:
        names = " and ".join(f"{name}s" for name in passed) or "no loads"
        raise ValueError(
            f"{names} given: give one of deltas [um], forces [uN] and pressures [MPa]"
        )
    [(name, loads)] = passed.items()
    refuse_masked(f"{name}s", loads)
    scalar = isinstance(loads, np.ndarray) and loads.ndim == 0
    if scalar or isinstance(loads, str) or not isinstance(loads, Iterable):
        raise ValueError(f"{name}s = {shown(loads)}: a sequence of loads is needed")
    if threads is not None:
        threads = checked("threads", threads)
    # Arrays are copied, because the caller may fill them anew before the contacts are taken.
    if isinstance(loads, np.ndarray):
        loads = loads.copy()
    return _Ladder(
        _heights=checked_heights(heights),
        _side=deepcopy(side),
        _quantity=name,
        _loads=iter(loads),
        _threads=threads,
        _settings=deepcopy(settings),
    )


@dataclass
class _Ladder(Iterator[Contact]):
    """The contacts of `ladder`. Unlike a generator, it goes on after a load that failed.

    Attributes
    ----------
    _heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    _side : float or tuple of float
        Scan length [um].
    _quantity : str
        Argument of `solve` that the loads are: "delta", "force" or "pressure".
    _loads : iterator of float
        Loads that are still to be solved [um, uN or MPa].
    _threads : int or None
        Number of threads, see `on_threads`.
    _settings : dict
        Further arguments of `pose`.
    _last : list of Rung
        The last rungs that were solved, at most `EXTRAPOLATED`, of different loads.
    """

    _heights: Field
    _side: float | tuple[float, float]
    _quantity: str
    _loads: Iterator[float]
    _threads: int | None
    _settings: dict[str, Any]
    _last: list[Rung] = field(default_factory=list)

    def __next__(self) -> Contact:
        """Solve for the next load, and keep its equilibrium for the next start.

        If the solve from the extrapolated start does not converge, solve again without a start. The
        equilibrium of a load that fails or touches nothing is not kept.
        """
        load = next(self._loads)
        # `pose` requires delta; the load replaces it if delta is the quantity.
        loads: dict[str, Any] = {"delta": None, self._quantity: load}
        problem = pose(self._heights, self._side, **loads, **self._settings)
        near = _extrapolated(self._last, load, problem.spacing[0])
        with on_threads(self._threads):
            equilibrium = equilibrium_of(problem, near)
            if near is not None and equilibrium is not None and not equilibrium.converged:
                equilibrium = equilibrium_of(problem, None)
        contact = contact_of(problem, equilibrium)
        if equilibrium is not None:
            kept = [rung for rung in self._last if rung.load != load]
            kept.append(Rung(load, equilibrium))
            self._last = kept[-EXTRAPOLATED:]
        return contact


def _extrapolated(last: list[Rung], load: float, spacing: float) -> Start | None:
    """Extrapolate the last equilibria by a parabola in the load, and cut off negative pressure.

    The displacement is linear in the pressure and follows the same parabola, unless pressure was
    cut off. Where the parabola overflows, the last pressure is the start. After fewer than two
    equilibria the result is None, because a solve without a start is cheaper then. `load` has the
    unit of the ladder's quantity; `spacing` is the spacing along the first axis [um].
    """
    if len(last) < 2:
        return None
    equilibria = [rung.equilibrium for rung in last]
    weights = _weights([rung.load for rung in last], load)
    pressure = np.zeros_like(equilibria[0].pressure)
    with np.errstate(over="ignore", invalid="ignore"):
        for weight, equilibrium in zip(weights, equilibria, strict=True):
            factor = equilibrium.length * weight / spacing
            pressure += factor * equilibrium.pressure
        if not np.isfinite(pressure).all():
            return Start(equilibria[-1].pressure * (equilibria[-1].length / spacing))
        if pressure.min() < 0:
            return Start(np.maximum(pressure, 0))
        displacement = np.zeros_like(pressure)
        for weight, equilibrium in zip(weights, equilibria, strict=True):
            if equilibrium.displacement is None:
                return Start(np.maximum(pressure, 0))
            factor = equilibrium.length * weight
            displacement += factor * equilibrium.displacement
    return Start(pressure, displacement)


def _weights(loads: list[float], load: float) -> list[float]:
    """Return Lagrange's weights of values at different loads for the value at another load [1]."""
    return [
        math.prod((load - other) / (node - other) for other in loads if other != node)
        for node in loads
    ]
