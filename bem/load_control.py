"""Equilibrium under a given force: its displacement is found at about the cost of one solve."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from bem.active_set import FROM_NEAR, FROM_SCRATCH
from bem.direct import FEW_NODES, solve_directly
from bem.displacement_control import on_rigid_far_field
from bem.equilibrium import Equilibrium, Start, overlap, started, unfold
from bem.far_field import flat_punch
from bem.half_space import HalfSpace
from bem.influence import InfluenceMatrix
from bem.iterate import Effort
from bem.problem import Problem
from bem.yielding import solve_within

# Largest tolerance used: looser residuals leave displacements that no better guess follows from.
LOOSEST_RTOL = 1e-2

# Tolerance of the dense solve that guesses the displacement.
GUESS_RTOL = 2e-2

# Ratio by which the displacement may exceed a guess: nodes that may touch are taken from there.
MARGIN = 1.1

# Guesses of the displacement at most, each from the equilibrium of the one before.
GUESSES = 8

# Relative distance of displacements that double precision can just tell apart.
ROOT_RTOL = 4e-15

# Iterations from a guess after which bodies that yield are solved at given displacements instead:
# arriving under a load takes fewer.
YIELDING_ITERATIONS = 100

# Relative distance of displacements between which a start under the load usually arrives.
LOOSE_ROOT = 1e-3

# First step, relative to the displacement, in search of a bracket; later steps are four times the
# one before, up to a factor of two.
FIRST_BRACKET = 0.01


def under_given_force(problem: Problem, near: Start | None = None) -> Equilibrium:
    """Find the displacement of the far field at which the pressure carries the force.

    A compliant far field moves by F / K in addition, whatever the contact is.

    Parameters
    ----------
    problem : Problem
        The problem, whose displacement is ignored.
    near : Start, optional
        A pressure to start from; it is ignored if it has no approach.
    """
    assert problem.force is not None
    load = problem.force / problem.modulus / problem.spacing[1]
    problem = replace(problem, rtol=min(problem.rtol, LOOSEST_RTOL))
    equilibrium = _on_few_nodes_or_all(problem, load, near)
    if not equilibrium.converged and equilibrium.iterate.effort.iterations < problem.max_iterations:
        equilibrium = _by_root(problem, load, equilibrium)
    if problem.far_field == "rigid":
        return equilibrium
    punch = flat_punch(problem.heights.shape, problem.kernel, problem.aspect)
    delta = max(equilibrium.approach - load / float(punch.sum()), 0.0)
    return replace(equilibrium, delta=delta)


def _on_few_nodes_or_all(problem: Problem, load: float, near: Start | None) -> Equilibrium:
    """Solve on few nodes if the force is small enough, else from a guess of the displacement."""
    if near is None or near.approach is None or not near.approach > 0:
        guess, near = _guess(problem, load), None
    else:
        guess = near.approach
    if guess < MARGIN * _displacement_of_few(problem):
        equilibrium = _on_few_nodes(problem, load)
        if equilibrium is not None:
            return equilibrium
    return _from_guess(problem, load, guess, near)


def _displacement_of_few(problem: Problem) -> float:
    """Return the largest displacement at which at most `FEW_NODES` nodes may touch [um]."""
    heights = problem.heights.reshape(-1)
    highest = np.sort(np.partition(heights, -min(FEW_NODES + 1, heights.size))[-FEW_NODES - 1 :])
    return float(highest[-1] - highest[0])


def _on_few_nodes(problem: Problem, load: float) -> Equilibrium | None:
    """Solve by dense linear algebra; return None if the force needs more than few nodes."""
    delta = _displacement_of_few(problem)
    if delta == 0:
        return None
    touching = overlap(problem, delta)
    if len(touching.nodes) > FEW_NODES:
        return None
    iterate, converged = solve_directly(
        InfluenceMatrix(touching.shape, problem.kernel, problem.aspect),
        touching.nodes,
        (touching.interference - 1) * delta,
        rtol=problem.rtol,
        max_iterations=problem.max_iterations,
        load=load,
        hardness=problem.reduced_hardness(1.0),
    )
    displacement = iterate.shift
    if not converged or not 0 < displacement <= delta:
        return None
    iterate.pressure /= displacement
    iterate.residual /= displacement
    return unfold(problem, displacement, touching, iterate)


def _from_guess(problem: Problem, load: float, guess: float, near: Start | None) -> Equilibrium:
    """Solve from a guess of the displacement [um]; if it was too small, again from the result."""
    spent = Effort()
    guess = max(guess, _least_displacement(problem, load))
    for _ in range(GUESSES):
        equilibrium, arrived = _at_guess(problem, guess, load, near, spent)
        within = equilibrium.converged and equilibrium.approach < MARGIN * guess
        if within:
            return equilibrium
        if not arrived:  # sets that cycle leave any displacement, which is worse than the guess
            yielding = problem.hardness is not None
            return replace(equilibrium, approach=guess) if yielding else equilibrium
        near = _start_from(problem, equilibrium)
        spent = equilibrium.iterate.effort
        guess *= min(max(equilibrium.approach / guess, 0.1), 10.0)
    return replace(equilibrium, converged=False)


def _least_displacement(problem: Problem, load: float) -> float:
    """Return the displacement below which too few nodes overlap to carry the load [um].

    No node carries more than the hardness.
    """
    needed = int(min(load / problem.reduced_hardness(1.0), problem.heights.size - 1))
    if not needed:
        return 0.0
    heights = problem.heights.reshape(-1)
    last = float(np.partition(heights, -needed - 1)[-needed - 1])
    return math.nextafter(float(heights.max()) - last, math.inf)


def _start_from(problem: Problem, equilibrium: Equilibrium) -> Start:
    """Return the pressure of an equilibrium as a start."""
    return Start(equilibrium.pressure * (equilibrium.length / problem.spacing[0]))


def _guess(problem: Problem, load: float) -> float:
    """Guess the displacement by dense linear algebra on a coarse subset of the nodes [um]."""
    shape, stride = problem.heights.shape, 1
    while math.prod(-(-nodes // stride) for nodes in shape) > FEW_NODES:
        stride += 1
    coarse, lost_height = _coarsened(problem, stride)
    below = (coarse.heights - coarse.heights.max()).reshape(-1)
    iterate, _ = solve_directly(
        InfluenceMatrix(coarse.heights.shape, problem.kernel, problem.aspect),
        np.arange(below.size),
        below,
        rtol=GUESS_RTOL,
        max_iterations=problem.max_iterations,
        load=load / stride,
        hardness=coarse.reduced_hardness(1.0),
    )
    sides = [nodes * step for nodes, step in zip(shape, problem.spacing, strict=True)]
    least, most = (
        load * problem.spacing[1] * c / s for c, s in ((0.25, max(sides)), (1.5, min(sides)))
    )
    largest = float(np.ptp(problem.heights)) + most
    return float(min(max(iterate.shift + lost_height, least), largest))


def _coarsened(problem: Problem, stride: int) -> tuple[Problem, float]:
    """Subsample by `stride`; also return the height lost at the peak [um]."""
    heights = problem.heights[::stride, ::stride]
    spacing = stride * problem.spacing[0], stride * problem.spacing[1]
    coarse = replace(problem, heights=heights, spacing=spacing, rtol=GUESS_RTOL)
    return coarse, float(problem.heights.max() - heights.max())


def _at_guess(
    problem: Problem,
    guess: float,
    load: float,
    near: Start | None,
    spent: Effort,
) -> tuple[Equilibrium, bool]:
    """Solve under a load in units of a guessed displacement.

    Parameters
    ----------
    problem : Problem
        The problem, whose own load is ignored.
    guess : float
        Guess of the displacement [um].
    load : float
        Force over E* and the second side of a cell [um].
    near : Start or None
        A pressure to start from.
    spent : Effort
        Work so far, to which this solve adds.

    Returns
    -------
    equilibrium : Equilibrium
        In units of its own displacement, which may lie beyond `MARGIN`.
    arrived : bool
        Whether the solver met its tolerance.
    """
    touching = overlap(problem, guess * MARGIN)
    interference = touching.interference * MARGIN - MARGIN + 1
    rigid = HalfSpace(touching.shape, problem.kernel, problem.aspect, touching.nodes)
    left, start = problem.max_iterations - spent.iterations, None
    if near is None and problem.hardness is not None:
        left = min(left, YIELDING_ITERATIONS)
    if near is not None:
        pressure = touching.select(near.pressure) * (problem.spacing[0] / guess)
        start = started(rigid, interference, pressure)
    iterate, arrived = solve_within(
        rigid.under(load / guess),
        interference,
        problem.reduced_hardness(guess),
        rtol=problem.rtol / MARGIN,
        max_iterations=max(left, 1),
        start=start,
        pace=FROM_SCRATCH if start is None else FROM_NEAR,
    )
    iterate.effort += spent
    equilibrium = unfold(problem, guess, touching, iterate)
    return _in_own_displacement(equilibrium, problem.rtol), arrived


def _in_own_displacement(equilibrium: Equilibrium, rtol: float) -> Equilibrium:
    """Make the displacement that was found the unit of length, instead of the guess."""
    change = 1 + equilibrium.iterate.shift
    equilibrium.iterate.residual /= change
    equilibrium.iterate.pressure /= change
    displacement = equilibrium.length * change
    return replace(
        equilibrium,
        pressure=equilibrium.pressure / change,
        length=displacement,
        delta=displacement,
        approach=displacement,
        converged=equilibrium.iterate.violation() <= rtol,
    )


def _by_root(problem: Problem, load: float, failed: Equilibrium) -> Equilibrium:
    """Find the displacement at which a rigid far field carries the force, by Brent's method.

    Solves at a given displacement are certain to arrive. Where the displacement follows from the
    load, sets of nodes may cycle, and a force many decades below the guess's may leave no digits. A
    loose root is often near enough for a start under the load; otherwise the root is refined.
    """
    equilibrium = failed
    for rtol in (LOOSE_ROOT, max(problem.rtol / 10, ROOT_RTOL)):
        try:
            root, spent = _root(problem, load, equilibrium, rtol)
        except _OutOfIterations as bound:
            failed.iterate.effort = bound.spent
            return failed
        start = _start_from(problem, root)
        equilibrium, _ = _at_guess(problem, root.approach, load, start, spent)
        if equilibrium.converged:
            return equilibrium
        carried = float(root.pressure.sum()) * root.length
        if abs(carried / load - 1) <= ROOT_RTOL and root.iterate.violation() <= problem.rtol:
            root.iterate.effort = equilibrium.iterate.effort
            return root  # where all nodes in contact yield, more than one displacement carries it
    return equilibrium


def _root(
    problem: Problem, load: float, near: Equilibrium, rtol: float
) -> tuple[Equilibrium, Effort]:
    """Solve on a rigid far field whose displacement carries the force to a relative tolerance.

    Returns
    -------
    root : Equilibrium
        The last solve.
    spent : Effort
        Work so far, that of `near` included.
    """
    spent = near.iterate.effort
    last: list[Equilibrium] = []
    loose = replace(problem, rtol=max(problem.rtol, rtol / 10))

    @cache
    def excess(delta: float) -> float:
        nonlocal spent
        left = problem.max_iterations - spent.iterations
        if left < 1:
            raise _OutOfIterations(spent)
        start = [_start_from(problem, equilibrium) for equilibrium in last]
        last[:] = [on_rigid_far_field(replace(loose, max_iterations=left), delta, *start)]
        spent += last[0].iterate.effort
        return float(last[0].pressure.sum()) * delta / load - 1

    from scipy.optimize import brentq  # a quarter of a worker's start-up; most runs never need it

    low = high = near.approach
    step = FIRST_BRACKET
    while excess(low) > 0:
        low, step = low / (1 + step), min(4 * step, 1.0)
    step = FIRST_BRACKET
    while excess(high) < 0:
        high, step = high * (1 + step), min(4 * step, 1.0)
    brentq(excess, low, high, xtol=1e-300, rtol=rtol)
    return last[0], spent


class _OutOfIterations(Exception):
    """The bound on iterations is used up.

    Attributes
    ----------
    spent : Effort
        Work so far.
    """

    def __init__(self, spent: Effort) -> None:
        super().__init__()
        self.spent = spent
