"""Equilibrium under a given force: the displacement that it takes, for about one solve's cost."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from bem.active_set import FROM_NEAR, FROM_SCRATCH, solve_complementarity
from bem.direct import FEW_NODES, solve_directly
from bem.displacement_control import on_rigid_far_field
from bem.equilibrium import Equilibrium, Start, overlap, started, unfold
from bem.far_field import flat_punch
from bem.first_contact import take_first_steps
from bem.half_space import HalfSpace
from bem.influence import InfluenceMatrix
from bem.iterate import Iterate
from bem.problem import Problem

# Looser residuals leave displacements from which no better one can be guessed.
LOOSEST_RTOL = 1e-2

# The displacement is guessed on every fourth node, as long as there are so many a side, and below
# on so few that dense linear algebra gives it. It may be larger than guessed by MARGIN: the nodes
# that may touch are taken from there.
COARSEST = 200
STRIDE = 4
GUESS_RTOL = 2e-2
GUESS_MARGIN = 1.5
MARGIN = 1.1

# Guesses of the displacement that are tried, each from the equilibrium of the last one.
GUESSES = 8

# Brent's method ends where double precision can tell displacements apart no more.
ROOT_RTOL = 4e-15


def under_given_force(problem: Problem, near: Start | None = None) -> Equilibrium:
    """Find the displacement of the far field that leaves the force to the pressure.

    A compliant far field gives way by F / K besides, whatever the contact is.

    Parameters
    ----------
    problem : its displacement is left aside
    near : what to start from; of no use without its approach
    """
    assert problem.force is not None
    load = problem.force / problem.modulus / problem.spacing[1]
    problem = replace(problem, rtol=min(problem.rtol, LOOSEST_RTOL))
    found = _on_few_nodes_or_all(problem, load, near)
    if not found.converged and found.iterate.iterations < problem.max_iterations:
        found = _by_root(problem, load, found)
    if problem.far_field == "rigid":
        return found
    punch = flat_punch(problem.heights.shape, problem.kernel, problem.aspect)
    return replace(found, delta=max(found.approach - load / float(punch.sum()), 0.0))


def _on_few_nodes_or_all(problem: Problem, load: float, near: Start | None) -> Equilibrium:
    """Solve on few nodes if the force is so small, else from a guess of the displacement."""
    if near is None or near.approach is None or not near.approach > 0:
        guess, near = _guess(problem, load), None
    else:
        guess = near.approach
    if guess < MARGIN * _displacement_of_few(problem):
        found = _on_few_nodes(problem, load)
        if found is not None:
            return found
    return _from_guess(problem, load, guess, MARGIN, near)


def _displacement_of_few(problem: Problem) -> float:
    """The largest displacement at which no more than `FEW_NODES` nodes may touch [um]."""
    heights = problem.heights.reshape(-1)
    highest = np.sort(np.partition(heights, -min(FEW_NODES + 1, heights.size))[-FEW_NODES - 1 :])
    return float(highest[-1] - highest[0])


def _on_few_nodes(problem: Problem, load: float) -> Equilibrium | None:
    """Solve by dense linear algebra if the force is so small; None if it is not."""
    delta = _displacement_of_few(problem)
    if delta == 0:
        return None
    box, nodes, interference = overlap(problem, delta)
    shape = box[0].stop - box[0].start, box[1].stop - box[1].start
    if len(nodes) > FEW_NODES:
        return None
    iterate, moved, converged = solve_directly(
        InfluenceMatrix(shape, problem.kernel, problem.aspect),
        nodes,
        (interference - 1) * delta,
        rtol=problem.rtol,
        max_iterations=problem.max_iterations,
        load=load,
    )
    if not converged or not 0 < moved <= delta:
        return None
    iterate.pressure /= moved
    iterate.residual /= moved
    return unfold(problem, moved, box, nodes, iterate)


def _from_guess(
    problem: Problem, load: float, guess: float, margin: float, near: Start | None = None
) -> Equilibrium:
    """Solve from a displacement [um]; again, from there, where it was guessed wrong."""
    spent = Iterate(np.zeros(0), np.zeros(0))
    for _ in range(GUESSES):
        found, arrived = _at_guess(problem, guess, load, margin, near, spent)
        if not arrived or (found.converged and found.approach < margin * guess):
            return found
        near = Start(found.pressure * (found.length / problem.spacing[0]))
        spent = found.iterate
        guess *= min(max(found.approach / guess, 0.1), 10.0)
    return replace(found, converged=False)


def _guess(problem: Problem, load: float) -> float:
    """A displacement near the one that the force takes [um], from coarser and coarser grids."""
    if min(problem.heights.shape) < COARSEST:
        return _guess_on_few_nodes(problem, load)
    coarse, left = _coarsened(problem, STRIDE)
    guess = _guess(coarse, load / STRIDE)
    found = _from_guess(coarse, load / STRIDE, guess, GUESS_MARGIN)
    return left + (found.approach if found.converged and found.approach > 0 else guess)


def _guess_on_few_nodes(problem: Problem, load: float) -> float:
    """The displacement of every so many-th node, by dense linear algebra [um]."""
    shape, stride = problem.heights.shape, 1
    while math.prod(-(-nodes // stride) for nodes in shape) > FEW_NODES:
        stride += 1
    coarse, left = _coarsened(problem, stride)
    below = (coarse.heights - coarse.heights.max()).reshape(-1)
    _, moved, _ = solve_directly(
        InfluenceMatrix(coarse.heights.shape, problem.kernel, problem.aspect),
        np.arange(below.size),
        below,
        rtol=GUESS_RTOL,
        max_iterations=problem.max_iterations,
        load=load / stride,
    )
    sides = [nodes * step for nodes, step in zip(shape, problem.spacing, strict=True)]
    least, most = (
        load * problem.spacing[1] * c / s for c, s in ((0.25, max(sides)), (1.5, min(sides)))
    )
    largest = float(np.ptp(problem.heights)) + most
    return float(min(max(moved + left, least), largest))


def _coarsened(problem: Problem, stride: int) -> tuple[Problem, float]:
    """Every so many-th node, and by how much the highest of all is above them [um]."""
    heights = problem.heights[::stride, ::stride]
    spacing = stride * problem.spacing[0], stride * problem.spacing[1]
    coarse = replace(problem, heights=heights, spacing=spacing, rtol=GUESS_RTOL)
    return coarse, float(problem.heights.max() - heights.max())


def _at_guess(
    problem: Problem,
    guess: float,
    load: float,
    margin: float,
    near: Start | None,
    spent: Iterate,
) -> tuple[Equilibrium, bool]:
    """Equilibrium under a force, and whether the solver arrived, reduced by a guess.

    Parameters
    ----------
    guess : of the displacement [um]
    load : force / E* / second side of a cell [um]
    margin : by how much the displacement may be larger than guessed
    near : what to start from, if there is anything
    spent : counts the iterations and convolutions so far
    """
    box, nodes, interference = overlap(problem, guess * margin)
    interference = interference * margin - margin + 1
    shape = box[0].stop - box[0].start, box[1].stop - box[1].start
    rigid = HalfSpace(shape, problem.kernel, problem.aspect, nodes)
    if near is None:
        start = Iterate(np.zeros_like(interference), interference.copy())
        take_first_steps(rigid, interference, start, FROM_SCRATCH.first_steps)
    else:
        pressure = near.pressure[box].reshape(-1)[nodes] * (problem.spacing[0] / guess)
        start = started(rigid, interference, pressure)
    start.iterations += spent.iterations
    start.convolutions += spent.convolutions
    iterate, converged = solve_complementarity(
        rigid.under(load / guess),
        interference,
        rtol=problem.rtol / margin,
        max_iterations=problem.max_iterations,
        start=start,
        pace=FROM_NEAR,
    )
    return _moved(unfold(problem, guess, box, nodes, iterate), problem.rtol), converged


def _moved(found: Equilibrium, rtol: float) -> Equilibrium:
    """Take what the far field moved besides the guess into the unit of length."""
    change = 1 + found.iterate.moved
    found.iterate.residual /= change
    found.iterate.pressure /= change
    displacement = found.length * change
    return replace(
        found,
        pressure=found.pressure / change,
        length=displacement,
        delta=displacement,
        approach=displacement,
        converged=found.iterate.violation() <= rtol,
    )


def _by_root(problem: Problem, load: float, failed: Equilibrium) -> Equilibrium:
    """Solve from the displacement at which a rigid far field carries the force, by Brent's method.

    Rigid solves are certain to arrive, where the displacement that follows the load may cycle.
    """
    spent = Iterate(np.zeros(0), np.zeros(0))
    spent.iterations, spent.convolutions = failed.iterate.iterations, failed.iterate.convolutions
    last: list[Equilibrium] = []

    @cache
    def excess(delta: float) -> float:
        left = problem.max_iterations - spent.iterations
        if left < 1:
            raise _OutOfIterations
        near = [Start(each.pressure * (each.length / problem.spacing[0])) for each in last]
        found = on_rigid_far_field(replace(problem, max_iterations=left), delta, *near)
        spent.iterations += found.iterate.iterations
        spent.convolutions += found.iterate.convolutions
        last[:] = [found]
        return float(found.pressure.sum()) * delta / load - 1

    from scipy.optimize import brentq  # a quarter of a worker's start-up; most runs never need it

    low = high = failed.approach
    try:
        while excess(low) > 0:
            low /= 2
        while excess(high) < 0:
            high *= 2
        brentq(excess, low, high, xtol=1e-300, rtol=max(problem.rtol / 10, ROOT_RTOL))
    except _OutOfIterations:
        iterations, convolutions = spent.iterations, spent.convolutions
        failed.iterate.iterations, failed.iterate.convolutions = iterations, convolutions
        return failed
    near = Start(last[0].pressure * (last[0].length / problem.spacing[0]))
    return _at_guess(problem, last[0].approach, load, MARGIN, near, spent)[0]


class _OutOfIterations(Exception):
    """The bound on iterations is used up."""
