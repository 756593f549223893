"""Equilibrium of a patch without edges: one that repeats itself or is mirrored without end.

All nodes may touch, because the displacement has no mean: where the contact presses, the surface
beside it rises. A given load is the natural problem here. Its start is the pressure of full
contact, which a transform yields. A given displacement is solved at once if the first steps come
near, as they do while the contact is small; otherwise loads are tried until the displacement
follows.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from bem.active_set import FROM_NEAR, FROM_SCRATCH, Pace
from bem.edgeless_patch import REACH, Patch, cannot_yield, reduced_load
from bem.elastic_load import Coarser, press_elastic
from bem.equilibrium import Equilibrium, Start
from bem.first_contact import take_first_steps
from bem.iterate import CONVOLUTION, Effort, Iterate, YieldingIterate, rescale
from bem.problem import Problem
from bem.splitting import split
from bem.yielding import excess_share, solve_within

# Cells a side from which on a solve starts from a loose solve for the means of two by two cells,
# and the tolerance of that one.
NESTED = 500
NESTED_RTOL = 3e-2

# Share of the displacement or of the nodes of full contact from which that gains nothing.
NEARLY_FULL = 0.97

# Projected steps from no pressure at a given displacement.
FIRST_STEPS = range(4)

# Largest violation [Delta] after these steps from which a given displacement is solved at once.
NEAR = 0.15

# Iterations of that solve, far more than it needs unless contact sets cycle.
NEAR_ITERATIONS = 25

# Pace under a load: the preconditioner's eigenvalues are good enough for nearly whole steps.
LOADED = Pace(first_steps=0, inner_reduction=0.2, advance=0.7)

# Tolerance, over the displacement, of the elastic solution from which bodies begin to yield.
ELASTIC_RTOL = 1e-2

# Share of a trial load above the hardness up to which the next one begins without the hardness.
MOSTLY_ELASTIC = 0.1

# Times that the tolerance follows the displacement that a load turns out to need.
TIGHTENINGS = 8

# Tolerance [Delta] of solves under trial loads, and the distance [Delta] from the displacement from
# which it is solved for.
TRIAL_RTOL = 2e-2
CLOSE = 1e-3

# Trial loads at most, and the longest step of the logarithm of the load between two of them.
TRIALS = 60
LONGEST_STEP = 1.0

# Share of the load under which all nodes yield from which what is left of it tells the next trial.
NEARLY_ALL = 0.9


def without_edges(
    problem: Problem, near: Start | None = None, *, keep_displacement: bool = False
) -> Equilibrium:
    """Solve a problem whose boundary is "periodic" or "mirror" and whose load is above 0.

    Parameters
    ----------
    problem : Problem
        The problem.
    near : Start, optional
        A pressure to start from.
    keep_displacement : bool
        Whether the result has the displacement of the half-space.
    """
    depth = float((problem.heights.max() - problem.heights).mean())
    length = problem.delta or depth or problem.spacing[0]
    if cannot_yield(problem):
        length = min(length, REACH * reduced_load(problem))
    spent = Effort()
    if near is None and problem.delta is not None and _nests(problem):
        near, spent = _on_coarser_cells(problem)
    patch = Patch.of(problem, length, keep_displacement=keep_displacement)
    if problem.delta is None:
        iterate, converged = _under_load(patch, reduced_load(problem) / length, near)
    else:
        iterate, converged = _at_displacement(patch, near)
    iterate.effort += spent
    return _on_grid(patch, iterate, converged)


def _nests(problem: Problem) -> bool:
    """Return whether a solve gains from one on coarser cells; bodies that yield do not."""
    rows, columns = problem.heights.shape
    return (
        problem.hardness is None and min(rows, columns) >= NESTED and not (rows % 2 or columns % 2)
    )


def _coarser(problem: Problem) -> Coarser | None:
    """Return what finds a start on coarser cells under the load of a problem, if that gains."""
    if problem.delta is not None or not _nests(problem):
        return None
    return partial(_on_coarser_cells, problem)


def _on_coarser_cells(problem: Problem) -> tuple[Start | None, Effort]:
    """Solve loosely for the means of two by two cells; None for a contact that is nearly full.

    The effort is in convolutions of the whole grid.
    """
    rows, columns = problem.heights.shape
    heights = problem.heights.reshape(rows // 2, 2, columns // 2, 2).mean(axis=(1, 3))
    delta = problem.delta
    if delta is not None:
        delta -= float(problem.heights.max() - heights.max())
        if not 0 < delta < NEARLY_FULL * float((heights.max() - heights).mean()):
            return None, Effort()
    spacing = 2 * problem.spacing[0], 2 * problem.spacing[1]
    coarse = replace(problem, heights=heights, spacing=spacing, delta=delta, rtol=NESTED_RTOL)
    loose = without_edges(coarse)
    pressure = loose.pressure * (loose.length / spacing[0])
    convolutions = -(-loose.iterate.effort.convolutions // 4)
    if np.count_nonzero(pressure) > NEARLY_FULL * pressure.size:
        return None, Effort(convolutions=convolutions)
    return Start(pressure.repeat(2, axis=0).repeat(2, axis=1)), Effort(convolutions=convolutions)


def _on_grid(patch: Patch, iterate: Iterate, converged: bool) -> Equilibrium:
    """Put the pressure on the grid; make a displacement that followed from a load the unit."""
    problem, length = patch.problem, patch.length
    delta = problem.delta
    displacement = patch.operators.field if patch.keep_displacement else None
    if delta is None:
        delta = iterate.shift * length
        unit = iterate.shift if iterate.shift > 0 else 1.0
        iterate.residual /= unit
        iterate.pressure /= unit
        length *= unit
        displacement = None if displacement is None else displacement / unit
    return Equilibrium(
        pressure=iterate.pressure.reshape(problem.heights.shape),
        length=length,
        delta=delta,
        approach=delta,
        iterate=iterate,
        converged=converged,
        displacement=displacement,
    )


def _under_load(patch: Patch, load: float, near: Start | None) -> tuple[Iterate, bool]:
    """Solve for a pressure that adds up to a load; its displacement is the iterate's shift."""
    start = None if near is None else _start_of(patch, near)
    return _settle_under(patch, load, start, patch.problem.rtol)


def _settle_under(
    patch: Patch, load: float, start: Iterate | None, rtol: float
) -> tuple[Iterate, bool]:
    """Solve under a load from a start or none, to a tolerance relative to the displacement."""
    excess = 1.0
    if start is not None:
        start = Iterate(start.pressure, start.residual, start.effort, shift=start.shift)
        rescale(patch.operators.under(load), patch.below, start)
        excess = excess_share(start.pressure, patch.hardness)
    iterate, converged = start, False
    if start is None or excess <= MOSTLY_ELASTIC:
        elastic = patch.problem.hardness is None
        coarser = _coarser(patch.problem) if start is None else None
        iterate, converged = press_elastic(
            patch, load, start, rtol if elastic else ELASTIC_RTOL, coarser
        )
    assert iterate is not None
    if converged and (patch.problem.hardness is None or _is_full(iterate, patch.hardness)):
        return iterate, True
    iterate, converged = _settle(patch, load, iterate, rtol)
    if converged or patch.problem.hardness is None:
        return iterate, converged
    return split(patch, load, iterate, rtol)


def _is_full(iterate: Iterate, hardness: float) -> bool:
    """Return whether all gaps are closed by pressures between zero and the hardness."""
    closed = not iterate.residual.any()
    return closed and bool(iterate.pressure.min() >= 0 and iterate.pressure.max() <= hardness)


def _settle(patch: Patch, load: float, iterate: Iterate, rtol: float) -> tuple[Iterate, bool]:
    """Solve under a load on lists of nodes, as bodies that yield need it."""
    for _ in range(TIGHTENINGS):
        iterate, converged = solve_within(
            patch.operators.under(load),
            patch.below,
            patch.hardness,
            rtol=rtol * (iterate.shift if iterate.shift > 0 else 1e-3 * patch.depth) / 2,
            max_iterations=patch.problem.max_iterations,
            start=iterate,
            pace=LOADED,
        )
        settled = iterate.violation() <= rtol * iterate.shift
        if settled or not converged:
            return iterate, settled
    return iterate, False


def _start_of(patch: Patch, near: Start) -> Iterate | None:
    """Return a start with its residual; None if it carries no load."""
    pressure = near.pressure.reshape(-1) * (patch.problem.spacing[0] / patch.length)
    if not pressure.any():
        return None
    known = near.displacement
    if known is not None and np.isfinite(known).all():
        return Iterate(pressure, patch.below - known.reshape(-1) / patch.length)
    with np.errstate(over="ignore", invalid="ignore"):
        residual = patch.below - patch.operators.displace_some(slice(None), pressure)
    return Iterate(pressure, residual, CONVOLUTION)


def _at_displacement(patch: Patch, near: Start | None) -> tuple[Iterate, bool]:
    """Solve at a displacement of one, directly if the first steps come near, else through loads."""
    if float(patch.below.min()) + 1 >= 0 and patch.hardness < np.inf:
        return _all_yielded(patch), True
    start = None if near is None else _start_of(patch, near)
    if start is not None:
        start.residual += 1
    if start is None or not start.violation() <= NEAR:
        interference = patch.below + 1
        start = Iterate.from_zero(interference)
        take_first_steps(patch.operators, interference, start, FIRST_STEPS)
    yielding = start.pressure.max(initial=0.0) > patch.hardness
    if yielding or start.violation() <= NEAR:
        iterate, converged = _solve_at(patch, None if yielding else start, NEAR_ITERATIONS)
        if converged or iterate.effort.iterations >= patch.problem.max_iterations:
            return iterate, converged
        start = iterate
    return _through_loads(patch, start)


def _all_yielded(patch: Patch) -> Iterate:
    """Return the hardness on all nodes, which displaces nothing: all of the surface penetrates."""
    pressure = np.full_like(patch.below, patch.hardness)
    residual, yielded = patch.below + 1, np.ones(len(pressure), dtype=bool)
    return YieldingIterate(pressure, residual, exact=True, hardness=patch.hardness, yielded=yielded)


def _solve_at(patch: Patch, start: Iterate | None, most: int) -> tuple[Iterate, bool]:
    """Solve at a displacement of one, from a start near it or none, in some iterations more."""
    spent = 0 if start is None else start.effort.iterations
    return solve_within(
        patch.operators,
        patch.below + 1,
        patch.hardness,
        rtol=patch.problem.rtol,
        max_iterations=min(spent + most, patch.problem.max_iterations),
        start=start,
        pace=FROM_SCRATCH if start is None else FROM_NEAR,
    )


def _through_loads(patch: Patch, start: Iterate) -> tuple[Iterate, bool]:
    """Find the load whose displacement is one by secants, with the load on a logarithmic scale.

    The displacement rises with the load. Once a load comes close, the rest is solved for at the
    displacement itself, unless contact sets cycle there.
    """
    loads = _Loads(patch, float(start.pressure.sum()))
    spent, rtol, close = start.effort, TRIAL_RTOL, CLOSE
    iterate, _ = _settle_under(patch, loads.load, None, rtol)
    iterate.effort += spent
    for trial in range(TRIALS):
        if trial:
            iterate, _ = _settle_under(patch, loads.load, iterate, rtol)
        excess = iterate.shift - 1
        at = _at_one(iterate)
        if abs(excess) <= close or _stays(patch, at):
            solved, converged = _solve_at(patch, at, NEAR_ITERATIONS)
            if converged:
                return solved, True
            iterate.effort, close = solved.effort, close / 100
        rtol = min(rtol, max(abs(excess) / 10, patch.problem.rtol / 4))
        if iterate.effort.iterations >= patch.problem.max_iterations or not loads.follow(
            excess, iterate.violation()
        ):
            break
    at = _at_one(iterate)
    solved, converged = _solve_at(patch, at, patch.problem.max_iterations)
    if converged:
        return solved, True
    at.effort = solved.effort
    return split(patch, None, at, patch.problem.rtol)


def _at_one(iterate: Iterate) -> Iterate:
    """Move the far field of an iterate under a load to a displacement of one."""
    residual = iterate.residual - (iterate.shift - 1)
    return Iterate(iterate.pressure.copy(), residual, iterate.effort)


def _stays(patch: Patch, at: Iterate) -> bool:
    """Return whether all nodes under pressure have yielded, and none opens or comes to touch.

    Then one load has more than one displacement, of which this is one.
    """
    touching = at.pressure > 0
    if not (at.pressure[touching] >= patch.hardness).all():
        return False
    return bool((at.residual[touching] >= 0).all() and (at.residual[~touching] <= 0).all())


class _Loads:
    """Trial loads, each from the displacements of those before.

    Attributes
    ----------
    load : float
        The load to try next [reduced].
    """

    def __init__(self, patch: Patch, load: float) -> None:
        self._elastic_depth = patch.depth if patch.problem.hardness is None else math.inf
        self._hardness, self._most = patch.hardness, patch.hardness * len(patch.below)
        self._low, self._high = 0.0, self._most
        self._slope = float(patch.below.std()) / 2
        if self._elastic_depth < math.inf:
            self._slope /= self._elastic_depth - 1
        self._last: tuple[float, float] | None = None
        self._least = math.inf
        self.load = load if 0 < load < self._high else min(self._high, 1.0) / 2

    def _scaled(self, excess: float) -> float:
        """Return an excess on a scale on which it rises nearly as the logarithm of the load.

        The mean gap of elastic bodies falls exponentially with the load (Persson 2007).
        """
        if self._elastic_depth == math.inf:
            return excess
        share = 1 - excess / (self._elastic_depth - 1)
        return -math.log(share) if share > 0 else math.inf

    def _middle(self) -> float:
        """Return a load between the bounds, or where all contact may yield, if that is near.

        Where nearly all nodes yield, it is the load that is left to all of them that halves on a
        logarithmic scale.
        """
        low, high, unit = self._low, self._high, self._hardness
        if unit < math.inf:
            whole = math.floor(high / unit) * unit
            if low < whole < high <= low + unit:
                return whole
            fewer = self._most - round(math.sqrt(max(self._most - low, 0.0) / unit)) * unit
            if high == self._most and NEARLY_ALL * self._most < low < fewer:
                return fewer
        return math.sqrt(low * high) if low else high / 2

    def follow(self, excess: float, error: float) -> bool:
        """Choose the next load; return False if no other is left.

        Parameters
        ----------
        excess : float
            Displacement under the last load less the one wanted [the one wanted].
        error : float
            Largest violation under that load: a smaller excess does not tell on which side the
            load is.
        """
        here, value = self.load, self._scaled(excess)
        if excess > error:
            self._high = min(self._high, here)
        elif excess < -error:
            self._low = max(self._low, here)
        if self._last is not None and math.isfinite(value) and math.log(here) != self._last[0]:
            slope = (value - self._last[1]) / (math.log(here) - self._last[0])
            self._slope = slope if slope > 0 else self._slope
        if math.isfinite(value):
            self._last = math.log(here), value
        step = value / self._slope if self._slope > 0 else math.copysign(math.inf, value)
        self.load = here * math.exp(-min(max(step, -LONGEST_STEP), LONGEST_STEP))
        slow = abs(excess) > self._least / 2
        self._least = min(self._least, abs(excess))
        between = self._low > 0 and self._high < math.inf
        if not self._low < self.load < self._high or (slow and between):
            self.load = self._middle() if self._high < math.inf else 2 * self._low
        return self.load != here and self._low < self.load < self._high
