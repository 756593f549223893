"""Equilibrium of a checked problem, in reduced units, on a rigid or on a compliant far field."""

from dataclasses import replace
from functools import partial

import numpy as np

from bem.active_set import FROM_NEAR, FROM_SCRATCH, solve_complementarity
from bem.direct import FEW_NODES, solve_directly
from bem.equilibrium import Equilibrium, NoSolution, Start, overlap, started, unfold
from bem.far_field import critical_delta, flat_punch
from bem.half_space import HalfSpace
from bem.influence import InfluenceMatrix
from bem.iterate import Iterate
from bem.problem import Field, Problem

# Iterations after which a compliant far field is approached by rigid solves, how near they have to
# come over what they have approached, how many they may be, and the longest step between two.
DIRECT_ITERATIONS = 150
APPROACH_RTOL = 1e-2
APPROACH_STEPS = 40
LONGEST_ADVANCE = 0.5

# From so many nodes a side on, a solve starts from a loose one on every second node: it spares more
# than it costs (`python -m bench growth`).
NESTED = 1000
NESTED_RTOL = 3e-2
NESTED_PACE = replace(FROM_SCRATCH, first_steps=1, advance=0.3)

# A start whose residual is larger than that [Delta] is no better than no pressure at all.
FARTHEST = 10.0


def on_rigid_far_field(problem: Problem, delta: float, near: Start | None = None) -> Equilibrium:
    """Solve on the smallest box that holds every node which the undeformed bodies overlap.

    Parameters
    ----------
    problem : its displacement or force is left aside
    delta : above 0 [um]
    near : what to start from, if there is anything
    """
    box, nodes, interference = overlap(problem, delta)
    shape = box[0].stop - box[0].start, box[1].stop - box[1].start
    if len(nodes) <= FEW_NODES:
        iterate, _, converged = solve_directly(
            InfluenceMatrix(shape, problem.kernel, problem.aspect),
            nodes,
            interference,
            rtol=problem.rtol,
            max_iterations=problem.max_iterations,
        )
        if converged:
            return unfold(problem, delta, box, nodes, iterate)
    operators = HalfSpace(shape, problem.kernel, problem.aspect, nodes)
    pace, spent = FROM_NEAR, 0
    if near is None and min(shape) >= NESTED:
        near, spent = _on_coarser_grid(problem, delta)
        pace = NESTED_PACE
    start = None
    if near is None:
        pace = FROM_SCRATCH
    else:
        pressure = near.pressure[box].reshape(-1)[nodes] * (problem.spacing[0] / delta)
        displaced, whole = None, np.count_nonzero(pressure) == np.count_nonzero(near.pressure)
        if near.moved is not None and whole:
            displaced = near.moved[box].reshape(-1)[nodes] / delta
        start = started(operators, interference, pressure, displaced)
        start.convolutions += spent
        if not start.violation() <= FARTHEST:
            start, pace = None, FROM_SCRATCH
    iterate, converged = solve_complementarity(
        operators,
        interference,
        rtol=problem.rtol,
        max_iterations=problem.max_iterations,
        start=start,
        pace=pace,
    )
    return unfold(problem, delta, box, nodes, iterate, converged, operators.displaced)


def _on_coarser_grid(problem: Problem, delta: float) -> tuple[Start | None, int]:
    """Pressure near the solution from every second node, None where those do not touch.

    And what it cost, in applications of the influence matrix of the whole grid.
    """
    heights = problem.heights[::2, ::2]
    touching = delta - float(problem.heights.max() - heights.max())
    if touching <= 0:
        return None, 0
    spacing = 2 * problem.spacing[0], 2 * problem.spacing[1]
    coarse = replace(problem, heights=heights, spacing=spacing, rtol=NESTED_RTOL)
    found = on_rigid_far_field(coarse, touching)
    pressure = found.pressure * (found.length / spacing[0])
    for axis, nodes in enumerate(problem.heights.shape):
        pressure = _between(pressure, axis, nodes)
    return Start(pressure), -(-found.iterate.convolutions * heights.size // problem.heights.size)


def _between(values: Field, axis: int, nodes: int) -> Field:
    """Means of neighbours put between them along an axis; a last node without one repeats."""
    here = np.moveaxis(values, axis, 0)
    filled = np.empty((nodes, *here.shape[1:]))
    filled[::2] = here
    filled[1::2] = here[: nodes // 2]
    inner = (nodes - 1) // 2
    filled[1 : 2 * inner : 2] += here[1 : inner + 1]
    filled[1 : 2 * inner : 2] /= 2
    return np.moveaxis(filled, 0, axis)


def on_compliant_far_field(problem: Problem, delta: float) -> Equilibrium:
    """Solve with the far field inside the operator; any node may come to touch.

    That operator is nearly singular on contact sets much larger than the solution's, on which the
    active set can cycle. If it has not arrived soon, rigid solves bring it near from below.
    """
    critical = critical_delta(problem.heights, problem.kernel, problem.aspect)
    if delta >= critical:
        raise NoSolution(delta, critical)
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
        left = problem.max_iterations - iterate.iterations
        near = _approach_from_below(left, rigid, depth, softening)
        near.iterations += iterate.iterations
        near.convolutions += iterate.convolutions
        iterate, converged = solve_here(
            max_iterations=problem.max_iterations, start=near, pace=FROM_NEAR
        )
    reduced = iterate.pressure.reshape(shape)
    approach = delta * (1 + softening * float(reduced.sum()))
    return Equilibrium(reduced, delta, delta, approach, iterate, converged)


def _approach_from_below(
    max_iterations: int, rigid: HalfSpace, depth: Field, softening: float
) -> Iterate:
    """A pressure near equilibrium on the compliant far field, with its residual there.

    What is left to approach, 1 + softening sum(p) - approach in units of Delta, falls and is
    convex in the approach: secants through its values never pass the solution.
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
        # Near Delta* the slope is nearly zero and made of rounding: no step may be trusted far.
        advance = min(left / min(max(-slope, 1e-3), 1.0), LONGEST_ADVANCE * approach)
        if abs(advance) <= APPROACH_RTOL * approach or not converged:
            break
        before = left
        approach += advance
        iterate.residual += advance
        iterate, converged = solve_rigid(depth + approach, start=iterate, pace=FROM_NEAR)
    iterate.residual += 1 + softening * float(iterate.pressure.sum()) - approach
    return iterate
