"""Equilibrium under a given force: the displacement that it takes, for about one solve's cost."""

from dataclasses import replace

import numpy as np
from scipy import optimize

from bem.direct import FEW_NODES, influence_matrix, solve_directly
from bem.equilibrium import Equilibrium, on_rigid_far_field, overlap, started, unfold
from bem.far_field import flat_punch
from bem.half_space import HalfSpace
from bem.problem import Field, Problem
from bem.solver import FIRST_STEPS, Iterate, solve_complementarity

# The force pushes through a spring that gives by this many displacements: the softer it is, the
# less the force depends on the displacement found.
SPRING = 1e6

# The displacement is guessed from that of a few nodes, on which the force grows like a power of it,
# then by a solve to GUESS_RTOL. The nodes that may touch are taken from a larger displacement.
GROWTH = 1.7
GUESS_RTOL = 2e-2
MARGINS = {"first": 1.4, "last": 1.02}

# Iterations after which a solve through the spring is given up for a root of the force.
SPRING_ITERATIONS = 100
ROOT_RTOL = 1e-9


def under_given_force(problem: Problem) -> Equilibrium:
    """Push through a soft spring: a rigid far field whose displacement the force decides.

    With a spring of compliance c the operator is H + c 1 1^T and the displacement what the spring
    leaves of its own. A compliant far field gives way by F / K besides, whatever the contact is.
    """
    assert problem.force is not None
    load = problem.force / problem.modulus / problem.spacing[1]
    found = _on_few_nodes(problem, load)
    if found is None:
        found = _through_springs(problem, load)
    if not found.converged and found.iterate.iterations < problem.max_iterations:
        found = _by_root(problem, load, found)
    if problem.far_field == "rigid":
        return found
    punch = flat_punch(problem.heights.shape, problem.kernel, problem.aspect)
    return replace(found, delta=found.approach - load / float(punch.sum()))


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
    matrix = influence_matrix(nodes, shape, problem.kernel, problem.aspect)
    compliance = SPRING * delta / load
    iterate, converged = solve_directly(
        matrix + compliance,
        interference + SPRING,
        rtol=problem.rtol,
        max_iterations=problem.max_iterations,
    )
    found = _displaced(unfold(problem, delta, box, nodes, iterate), load)
    enough = converged and found.approach <= delta
    # What is accepted counts in the displacement found, not in the larger one.
    if not enough or iterate.violation() * delta > problem.rtol * found.approach:
        return None
    return found


def _through_springs(problem: Problem, load: float) -> Equilibrium:
    """Guess the displacement, solve loosely, then to the end near what was found."""
    guess, margin = _guess(problem, load), MARGINS["first"]
    rtol, near, spent = max(GUESS_RTOL, problem.rtol), None, Iterate(np.zeros(0), np.zeros(0))
    while True:
        found = _through_spring(problem, guess, load, (rtol, margin), near, spent)
        ratio = found.approach / guess
        known = 1 / MARGINS["first"] ** 2 < ratio < margin
        settled = known and margin == MARGINS["last"] and rtol == problem.rtol
        if not found.converged or (settled and abs(ratio - 1) < 2 * GUESS_RTOL):
            return found
        spent, near = found.iterate, found.pressure * (found.length / problem.spacing[0])
        guess *= min(max(ratio, 0.1), 10.0)
        margin = MARGINS["last"] if known else MARGINS["first"]
        rtol = problem.rtol if known else rtol


def _guess(problem: Problem, load: float) -> float:
    """A displacement near the one that the force takes [um]."""
    sides = (n * step for n, step in zip(problem.heights.shape, problem.spacing, strict=True))
    flat = load * problem.spacing[1] / min(sides)
    largest: float = problem.heights.max() - problem.heights.min() + 1.5 * flat
    few = _displacement_of_few(problem)
    if few == 0:
        return float(largest)
    touching = on_rigid_far_field(replace(problem, rtol=GUESS_RTOL), few)
    carried = float(touching.pressure.sum()) * few
    return float(min(few * (load / carried) ** (1 / GROWTH), largest))


def _through_spring(
    problem: Problem,
    guess: float,
    load: float,
    accuracy: tuple[float, float],
    near: Field | None,
    spent: Iterate,
) -> Equilibrium:
    """Equilibrium under a force, reduced by a guess of the displacement.

    Parameters
    ----------
    guess : of the displacement [um]
    load : force / E* / second side of a cell [um]
    accuracy : rtol, and how much larger than guessed the displacement may be
    near : (nx, ny) pressure to start from [E*]
    spent : counts the iterations and convolutions so far
    """
    rtol, margin = accuracy
    box, nodes, interference = overlap(problem, guess * margin)
    interference = interference * margin - margin + 1 + SPRING
    shape = box[0].stop - box[0].start, box[1].stop - box[1].start
    operators = HalfSpace(shape, problem.kernel, problem.aspect, nodes, -SPRING * guess / load)
    if near is None:
        pressure = np.full(len(nodes), load / guess / len(nodes))
    else:
        pressure = near[box].reshape(-1)[nodes] * (problem.spacing[0] / guess)
    start = started(operators, interference, pressure)
    start.iterations += spent.iterations
    start.convolutions += spent.convolutions
    iterate, converged = solve_complementarity(
        operators,
        interference,
        rtol=rtol,
        max_iterations=min(problem.max_iterations, SPRING_ITERATIONS),
        start=start,
        first_steps=FIRST_STEPS if near is None else 0,
    )
    return _displaced(unfold(problem, guess, box, nodes, iterate, converged), load)


def _displaced(found: Equilibrium, load: float) -> Equilibrium:
    """With the displacement that the spring leaves."""
    carried = float(found.pressure.sum()) * found.length
    displacement = found.length * (1 + SPRING * (1 - carried / load))
    return replace(found, delta=displacement, approach=displacement)


def _by_root(problem: Problem, load: float, failed: Equilibrium) -> Equilibrium:
    """The displacement at which a rigid far field carries the force, by Brent's method."""
    solved: list[Equilibrium] = []

    def excess(delta: float) -> float:
        near = solved[-1].pressure * solved[-1].length / problem.spacing[0] if solved else None
        solved.append(on_rigid_far_field(problem, delta, near))
        return float(solved[-1].pressure.sum()) * delta / load - 1

    low = high = _guess(problem, load)
    while excess(low) > 0:
        low /= 2
    while excess(high) < 0:
        high *= 2
    optimize.brentq(excess, low, high, xtol=1e-300, rtol=ROOT_RTOL)
    found = solved[-1]
    for earlier in [failed, *solved[:-1]]:
        found.iterate.iterations += earlier.iterate.iterations
        found.iterate.convolutions += earlier.iterate.convolutions
    return found
