"""Equilibrium at a given displacement of the far field, which is rigid or compliant."""

from dataclasses import replace
from functools import partial

import numpy as np

from bem.active_set import FROM_NEAR, FROM_SCRATCH, solve_complementarity
from bem.arrays import Field
from bem.direct import FEW_NODES, solve_directly
from bem.equilibrium import (
    BeyondCriticalDelta,
    Equilibrium,
    Overlap,
    Start,
    overlap,
    started,
    unfold,
)
from bem.far_field import critical_delta, flat_punch
from bem.half_space import HalfSpace
from bem.influence import InfluenceMatrix
from bem.iterate import Effort, Iterate
from bem.problem import Problem
from bem.yielding import solve_within

# Iterations with the compliant far field in the operator after which rigid solves approach it: most
# problems need fewer.
DIRECT_ITERATIONS = 150

# Accuracy of that approach, over the approach: the active set arrives from there.
APPROACH_RTOL = 1e-2

# Rigid solves of the approach at most; secants need far fewer.
APPROACH_STEPS = 40

# Longest step of the approach between two rigid solves, over the approach.
LONGEST_ADVANCE = 0.5

# Nodes a side from which on a solve starts from a loose solve on every second node, which saves
# more than it costs (`python -m bench growth`).
NESTED = 1000

# Nodes a side from which on that loose solve starts from one on a yet coarser grid, if more than a
# share of the nodes of its box overlap; with fewer it gains nothing.
NESTED_AGAIN = 250
NEARLY_ALL = 0.9

# Tolerance of those loose solves.
NESTED_RTOL = 1e-1

# Pace after that loose solve: its contact set is good except along its borders.
NESTED_PACE = replace(FROM_SCRATCH, first_steps=1, advance=0.3)

# Largest residual [Delta] of a start that is better than no pressure at all.
FARTHEST = 10.0


def on_rigid_far_field(
    problem: Problem,
    delta: float,
    near: Start | None = None,
    *,
    keep_displacement: bool = False,
    loose: bool = False,
) -> Equilibrium:
    """Solve on the smallest box that holds every node at which the undeformed bodies overlap.

    Parameters
    ----------
    problem : Problem
        The problem, whose own displacement or force is ignored.
    delta : float
        Displacement of the far field, above 0 [um].
    near : Start, optional
        A pressure to start from.
    keep_displacement : bool
        Whether the result has the displacement of the half-space, unless dense algebra found it.
    loose : bool
        Whether another solve is to start from the result.
    """
    touching, hardness = overlap(problem, delta), problem.reduced_hardness(delta)
    if len(touching.nodes) <= FEW_NODES:
        iterate, converged = solve_directly(
            InfluenceMatrix(touching.shape, problem.kernel, problem.aspect),
            touching.nodes,
            touching.interference,
            rtol=problem.rtol,
            max_iterations=problem.max_iterations,
            hardness=hardness,
        )
        if converged:
            return unfold(problem, delta, touching, iterate)
    pace, spent = FROM_NEAR, Effort()
    if near is None and min(touching.shape) >= _nested_from(touching, loose=loose):
        near, spent = _on_coarser_grid(problem, delta)
        pace = NESTED_PACE
    operators = HalfSpace(
        touching.shape,
        problem.kernel,
        problem.aspect,
        touching.nodes,
        keep_field=keep_displacement,
    )
    start = _usable_start(problem, operators, touching, delta, near)
    del near  # as large as the grid
    if start is None:
        pace = FROM_SCRATCH
    else:
        start.effort += spent
    iterate, converged = solve_within(
        operators,
        touching.interference,
        hardness,
        rtol=problem.rtol,
        max_iterations=problem.max_iterations,
        start=start,
        pace=pace,
    )
    return unfold(
        problem, delta, touching, iterate, converged=converged, displacement=operators.field
    )


def _nested_from(touching: Overlap, *, loose: bool) -> int:
    """Return the nodes a side from which on a solve, or a loose one, starts from a coarser grid."""
    all_overlap = len(touching.nodes) > NEARLY_ALL * touching.shape[0] * touching.shape[1]
    return min(NESTED, NESTED_AGAIN) if loose and all_overlap else NESTED


def _usable_start(
    problem: Problem, operators: HalfSpace, touching: Overlap, delta: float, near: Start | None
) -> Iterate | None:
    """Return the start on the nodes that may touch, or None if it is too far from equilibrium."""
    if near is None:
        return None
    pressure = touching.select(near.pressure) * (problem.spacing[0] / delta)
    displacement = None
    all_inside = np.count_nonzero(pressure) == np.count_nonzero(near.pressure)
    if near.displacement is not None and all_inside:
        displacement = touching.select(near.displacement) / delta
    start = started(operators, touching.interference, pressure, displacement)
    return start if start.violation() <= FARTHEST else None


def _on_coarser_grid(problem: Problem, delta: float) -> tuple[Start | None, Effort]:
    """Solve on every second node and interpolate the pressure; None if those nodes do not touch.

    The effort is in convolutions of the whole grid.
    """
    heights = problem.heights[::2, ::2]
    coarse_delta = delta - float(problem.heights.max() - heights.max())
    if coarse_delta <= 0:
        return None, Effort()
    spacing = 2 * problem.spacing[0], 2 * problem.spacing[1]
    coarse = replace(problem, heights=heights, spacing=spacing, rtol=NESTED_RTOL)
    loose = on_rigid_far_field(coarse, coarse_delta, loose=True)
    pressure = loose.pressure * (loose.length / spacing[0])
    for axis, nodes in enumerate(problem.heights.shape):
        pressure = _between(pressure, axis, nodes)
    convolutions = loose.iterate.effort.convolutions
    whole = -(-convolutions * heights.size // problem.heights.size)
    return Start(pressure), Effort(convolutions=whole)


def _between(values: Field, axis: int, nodes: int) -> Field:
    """Insert means of neighbours along an axis; repeat the last value if it has no neighbour."""
    here = np.moveaxis(values, axis, 0)
    filled = np.empty((nodes, *here.shape[1:]))
    filled[::2] = here
    filled[1::2] = here[: nodes // 2]
    inner = (nodes - 1) // 2
    filled[1 : 2 * inner : 2] += here[1 : inner + 1]
    filled[1 : 2 * inner : 2] /= 2
    return np.moveaxis(filled, 0, axis)


def on_compliant_far_field(problem: Problem, delta: float) -> Equilibrium:
    """Solve with the far field's compliance in the operator; any node may come to touch.

    The operator is nearly singular on contact sets much larger than the solution's, on which the
    active set can cycle. If it has not converged soon, rigid solves bring it near from below.

    Parameters
    ----------
    problem : Problem
        The problem, whose own displacement or force is ignored.
    delta : float
        Displacement of the far field, above 0 [um].

    Raises
    ------
    BeyondCriticalDelta
        If delta is Delta* or more.
    """
    critical = critical_delta(problem.heights, problem.kernel, problem.aspect)
    if delta >= critical:
        raise BeyondCriticalDelta(delta, critical)
    shape = problem.heights.shape
    depth = ((problem.heights - problem.heights.max()) / delta).reshape(-1)
    softening = 1 / float(flat_punch(shape, problem.kernel, problem.aspect).sum())
    rigid = HalfSpace(shape, problem.kernel, problem.aspect, np.arange(depth.size))
    solve_here = partial(
        solve_complementarity, rigid.through(softening), depth + 1, rtol=problem.rtol
    )
    soon = min(DIRECT_ITERATIONS, problem.max_iterations)
    iterate, converged = solve_here(max_iterations=soon)
    if not converged and soon < problem.max_iterations:
        left = problem.max_iterations - iterate.effort.iterations
        near = _approach_from_below(left, rigid, depth, softening)
        near.effort += iterate.effort
        iterate, converged = solve_here(
            max_iterations=problem.max_iterations, start=near, pace=FROM_NEAR
        )
    reduced = iterate.pressure.reshape(shape)
    return Equilibrium(
        pressure=reduced,
        length=delta,
        delta=delta,
        approach=delta * (1 + softening * float(reduced.sum())),
        iterate=iterate,
        converged=converged,
    )


def _approach_from_below(
    max_iterations: int, rigid: HalfSpace, depth: Field, softening: float
) -> Iterate:
    """Find a pressure near equilibrium on the compliant far field, with its residual there.

    The remaining approach, 1 + softening sum(p) - approach in units of Delta, falls and is convex
    in the approach: secants through its values never pass the solution.
    """
    solve_rigid = partial(
        solve_complementarity,
        rigid,
        rtol=APPROACH_RTOL / 10,
        max_iterations=max_iterations,
    )
    approach, advance, before = 1.0, 0.0, 0.0
    iterate, converged = solve_rigid(depth + approach)
    for _ in range(APPROACH_STEPS):
        left = 1 + softening * float(iterate.pressure.sum()) - approach
        slope = (left - before) / advance if advance else -1.0
        # Near Delta* the slope is nearly zero and made of rounding: limit the step.
        advance = min(left / min(max(-slope, 1e-3), 1.0), LONGEST_ADVANCE * approach)
        if abs(advance) <= APPROACH_RTOL * approach or not converged:
            break
        before = left
        approach += advance
        iterate.residual += advance
        iterate, converged = solve_rigid(depth + approach, start=iterate, pace=FROM_NEAR)
    iterate.residual += 1 + softening * float(iterate.pressure.sum()) - approach
    return iterate
