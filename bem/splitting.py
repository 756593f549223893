"""The way that always ends on a patch without edges: waves and bounds in turn.

Sets of nodes that change by many nodes at once may cycle, above all on oblong cells, where a node
raises its neighbours along one axis more than it lowers those along the other. The alternating
direction method of multipliers has no sets. It minimises the same energy: in turn over all
pressures, which waves do by one transform each way, and over those within the bounds, which is
cutting off. It converges from any start because the energy is convex (Boyd, Parikh, Chu, Peleato
and Eckstein 2011, Foundations and Trends in Machine Learning 3, sections 3.2 and 3.4.3).
"""

import math

import numpy as np

from bem.arrays import Values
from bem.edgeless_patch import Patch
from bem.iterate import Effort, Iterate, YieldingIterate
from bem.spectrum import even_filter, wave_numbers

# Penalty for the distance of both pressures, over the geometric mean of the stiffest and the
# softest wave's compliance.
PENALTY = 0.5

# Over-relaxation: share of the new waves in what is cut off next, the rest being the pressure
# within the bounds (Boyd et al., section 3.4.3).
OVER = 1.6

# Passes between two checks, and passes at most for each iteration that a problem allows.
CHECKED, PASSES = 10, 4


def split(patch: Patch, load: float | None, start: Iterate, rtol: float) -> tuple[Iterate, bool]:
    """Solve under a load, or at a displacement of one, by waves and bounds in turn.

    Parameters
    ----------
    patch : Patch
        The problem.
    load : float or None
        Sum of the pressure [reduced]; None for a displacement of one.
    start : Iterate
        A pressure to start from, and its residual.
    rtol : float
        Largest violation accepted, over the displacement [1].

    Returns
    -------
    iterate : Iterate
        The solution, or where the passes ended.
    converged : bool
        Whether the tolerance is met.
    """
    problem = patch.problem
    shape, operators = problem.heights.shape, patch.operators
    interference = patch.below + (1.0 if load is None else 0.0)
    if load is not None:
        operators = operators.under(load)
    numbers = wave_numbers(shape, problem.boundary, problem.aspect)
    numbers[0, 0] = math.inf  # a uniform pressure displaces nothing
    compliance = 2 / numbers
    waves = compliance[compliance > 0]
    penalty = PENALTY * math.sqrt(waves.min() * waves.max()) if waves.size else 1.0
    inverse = even_filter(shape, problem.boundary, 1 / (compliance + penalty), "float64")
    iterate = _within(patch, start.pressure, start.effort)
    within, price = iterate.pressure, start.residual / penalty
    for number in range(1, PASSES * problem.max_iterations + 1):
        wanted = interference + penalty * (within - price)
        free = inverse(wanted.reshape(shape)).reshape(-1)
        if load is not None:
            free += load / free.size - free.mean()
        mixed = OVER * free + (1 - OVER) * within
        within = np.clip(mixed + price, 0, patch.hardness)
        price += mixed - within
        if number % CHECKED == 0:
            iterate = _within(patch, within, iterate.effort + Effort(convolutions=CHECKED))
            iterate.renew(operators, interference)
            unit = 1.0 if load is None else iterate.shift
            if iterate.violation() <= rtol * unit and (load is None or within.any()):
                return iterate, True
    return iterate, False


def _within(patch: Patch, pressure: Values, effort: Effort) -> Iterate:
    """Return a pressure within the bounds, whose nodes at the hardness have yielded."""
    pressure = np.clip(pressure, 0, patch.hardness)
    iterate = Iterate(pressure, np.zeros_like(pressure), effort)
    if patch.hardness == math.inf:
        return iterate
    capped = YieldingIterate.above(iterate, patch.hardness)
    capped.join()
    return capped
