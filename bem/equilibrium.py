"""From a checked problem to its equilibrium: units, starts, and parts of the grid.

Displacements are in units of a length of the problem. Pressures are in units of this length times
E* over the first side of a cell; pressures and loads in these units are called reduced. Few nodes
that may touch are solved by dense algebra alone. Every other problem is solved by one active set
(`bem.active_set`), which begins from a pressure near the solution, from a loose solution on a
coarser grid, or from a first guess.

Constants say how far they move the counts of the ledger, see `bem.active_set`.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bem.active_set import ActiveSet
from bem.arrays import Field, Nodes, Values
from bem.bodies import WithoutMean
from bem.dense import MOST_SETS, ContactFactor, DenseSolution
from bem.far_field import critical_delta, give_of
from bem.influence import InfluenceMatrix
from bem.iterate import Effort, Iterate, cut_to_load
from bem.operators.patch import Patch
from bem.problem import Overlap, Problem, overlap
from bem.threads import on_one_blas_thread

# Largest number of nodes that may touch for which dense algebra alone is faster than convolutions
# (`pytest bench -k few_candidates`). It is chosen by the time: solves take up to 33 % fewer
# convolutions if it is halved, and up to 18 % more if it is doubled
# (`python -m tests.ledger --halved bem.equilibrium.FEW_NODES`).
FEW_NODES = 250

# Least number of nodes a side of grids whose solve starts from a loose solve on a coarser grid.
# Solves of large grids take up to 30 % more iterations if it is doubled
# (`python -m tests.ledger --doubled bem.equilibrium.NESTED`).
NESTED = 500

# `NESTED` under a load without edges [nodes]: a start on the grid itself is nearer to the solution
# there than on a free patch. This number matters in rare cases.
NESTED_EDGELESS = 700

# `NESTED` where few nodes come into contact [nodes]: a coarser grid then saves work on larger grids
# only. This number matters little.
NESTED_FAINT = 1000

# Tolerance of the loose solve, over the displacement [1]. This number matters little.
NESTED_RTOL = 6e-2

# Mean pressure, over E* times the rms slope, below which few nodes come into contact [1]. This and
# `FAINT_DELTA` were measured on diamond-square surfaces of 512 and 513 nodes a side. This number
# matters in rare cases.
FAINT_PRESSURE = 4e-3

# Delta, over the mean depth of the surface, below which few nodes come into contact [1]. Solves of
# large grids take up to 25 % more iterations if it is doubled
# (`python -m tests.ledger --doubled bem.equilibrium.FAINT_DELTA`).
FAINT_DELTA = 0.6

# Mean pressure, over E* times the rms slope, at or above which no coarser grid of a patch without
# edges is solved for a start [1]: the pressure of full contact is then nearer to the solution. It
# was measured on spectral and diamond-square surfaces of 512 and 1,024 nodes a side. This number
# matters in rare cases.
NESTED_FULL = 1.1

# Largest Delta at which the coarser grid is solved, over the coarser grid's Delta of full contact
# or Delta* [1]. At or beyond this Delta the coarser grid has no equilibrium, although the finer
# grid still may have one. This number matters in rare cases.
NESTED_BELOW = 0.9999

# Largest contact set for which no first step is taken before dense algebra, over the largest set
# worth factorising, on free patches from a first guess [1]. This number matters little.
ENOUGH_FREE = 0.5

# `ENOUGH_FREE` for all other starts, where a step gains less [1]. Ladders take up to 11 % more
# iterations if it is doubled (`python -m tests.ledger --doubled bem.equilibrium.ENOUGH`).
ENOUGH = 0.6

# Mean pressure, over E* times the rms slope, up to which a start on the highest nodes of a patch
# without edges is nearer to the solution than a start from full contact [1]. Solves without edges
# take up to 19 % fewer iterations if it is halved
# (`python -m tests.ledger --halved bem.equilibrium.LIGHT`).
LIGHT = 0.1

# Share of the nodes that a start on the highest nodes takes, over the mean pressure divided by E*
# times the rms slope [1]. Solves under a load take up to 26 % more iterations if it is halved, and
# from 19 % fewer to 13 % more if it is doubled
# (`python -m tests.ledger --halved bem.equilibrium.PEAKS`).
PEAKS = 8.0

# Distance, in nodes, of the rows and columns from which the rms slope is computed. This number
# matters little.
SAMPLED = 16

# Least share of the nodes of a free patch that overlap under a light load, over the mean pressure
# divided by E* times the rms slope [1]. Shares from 6 to 30 were seen on diamond-square surfaces of
# 129 to 513 nodes a side. This number matters in rare cases.
LEAST_OVERLAPPING = 6.0

# Share of the nodes that are solved first under a light load, over the mean pressure divided by E*
# times the rms slope [1]. Ladders take up to 16 % more convolutions if it is halved
# (`python -m tests.ledger --halved bem.equilibrium.OVERLAPPING`).
OVERLAPPING = 20.0

# Share of overlapping nodes above which the whole grid is solved [1]. This number matters little.
MOST_OVERLAPPING = 0.3

# Factor on a displacement that is known from a coarser grid, or from a part that was too small [1].
# This number matters in rare cases.
FURTHER = 1.1

# Unit of length under the smallest loads, over the displacement of one cell that carries all of the
# load [1]. Single precision holds pressures and depths at once only where they are not too far
# apart. This number matters in rare cases.
REACH = 1e3

# Displacement, over the unit of length, that the tolerance refers to as long as the displacement
# under a load is not above zero [1]. This number matters in rare cases.
LEAST = 1e-3

# Delta, over Delta of full contact, at or above which a start from full contact is better than a
# start without any pressure [1]. This number matters in rare cases.
NEARLY_FULL = 0.9

# Largest number of constants that are tried in `_begun_nearly_full`. This number matters in rare
# cases.
CONSTANTS = 4

# Least mean gap that these trials aim at, over Delta of full contact [1]. This number matters in
# rare cases.
LEAST_GAP = 1e-6

# Largest violation of a start that is better than no pressure [Delta]. This number matters in rare
# cases.
FARTHEST = 10.0


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The solver's result for a whole grid.

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure [length E* / first side of a cell].
    length : float
        Unit of reduced displacements [um].
    delta : float
        Far-field displacement Delta [um].
    approach : float
        Total displacement of the far field [um].
    violation : float
        Largest violation of complementarity, over the approach, or over Delta if that is given
        [1].
    effort : Effort
        Work that the solve took.
    converged : bool
        Whether the tolerance is met.
    stalled : bool
        Whether rounding leaves no step that would come nearer to equilibrium.
    displacement : ndarray, shape (nx, ny), or None
        Displacement of the half-space under that pressure, nan outside the box that was solved;
        None if it is not known. Under a given force, the displacement by the mean pressure is left
        out [length].
    presumably_elastic : bool
        Whether a hardness was taken into account that no node is certain to have reached.
    """

    pressure: Field
    length: float
    delta: float
    approach: float
    violation: float
    effort: Effort
    converged: bool
    stalled: bool = False
    displacement: Field | None = None
    presumably_elastic: bool = False


@dataclass(frozen=True, eq=False)
class Start:
    """A pressure near the solution, from which a solve begins.

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure, nowhere negative [E*].
    displacement : ndarray, shape (nx, ny), or None
        Displacement under that pressure, nan where it is unknown; it saves a convolution [um].
    spent : int
        Convolutions that the pressure took; above 0 only if it was interpolated from a coarser
        grid.
    reach : float or None
        Displacement beyond which no node is likely to touch, None if it is unknown [um].
    """

    pressure: Field
    displacement: Field | None = None
    spent: int = 0
    reach: float | None = None


def equilibrium_of(problem: Problem, near: Start | None = None) -> Equilibrium | None:
    """Solve a checked problem.

    Parameters
    ----------
    problem : Problem
        The problem.
    near : Start, optional
        A pressure to start from.

    Returns
    -------
    Equilibrium or None
        The equilibrium, whose `converged` tells whether it meets the tolerance; None if the bodies
        are apart or just touch.

    Raises
    ------
    BeyondCriticalDelta
        If Delta is at or beyond Delta* on a compliant far field; it is a NoSolution.
    ArithmeticError
        If the flat punch of a compliant far field is not solved.
    """
    if not _is_loaded(problem):
        return None
    if problem.mean_displacement > 0:
        return _beside_mean_displacement(problem, near)
    compliant = problem.far_field == "compliant"
    give = 0.0
    if compliant:
        give = give_of(problem)
    solution = None
    if problem.touches_by_overlap:
        solution = _on_few_nodes(problem, give)
    if solution is None:
        solution = _on_many_nodes(problem, near, give)
    if solution.presumably_elastic and _has_elastic(problem):
        solution = _elastic_after_all(problem, solution, near)
    if compliant and problem.delta is None:
        given_way = give * _reduced_load(problem)
        delta = max(solution.approach - given_way, 0.0)
        solution = replace(solution, delta=delta)
    return solution


def _beside_mean_displacement(problem: Problem, near: Start | None) -> Equilibrium | None:
    """Solve under a force whose mean pressure displaces all nodes of the patch by the same amount.

    This displacement follows from the force alone. The patch is solved without it, and it is added
    to Delta and to the approach afterwards, but not to the displacement field. Tolerances and
    starts are therefore those of the rough surface, however thick the layer is.
    """
    relative = replace(problem, body=WithoutMean(problem.body))
    solution = equilibrium_of(relative, near)
    if solution is None:
        return None
    return replace(
        solution,
        delta=solution.delta + problem.mean_displacement,
        approach=solution.approach + problem.mean_displacement,
    )


def _is_loaded(problem: Problem) -> bool:
    """Return whether the force or the displacement is above zero."""
    if problem.delta is None:
        return bool(problem.force)
    return problem.delta > 0


def _on_many_nodes(problem: Problem, near: Start | None, give: float) -> Equilibrium:
    """Solve by one active set, from a given start, one from a coarser grid, or a first guess.

    `give` is the compliance of the far field, 0 if it is rigid [first side of a cell / E*].
    """
    # Starts are made in the call, so that the callee alone holds them and can free their memory.
    if problem.delta is None:
        return _under_load(problem, _start_of(problem, near))
    return _at_displacement(problem, _start_of(problem, near), give)


def _start_of(problem: Problem, near: Start | None) -> Start | None:
    """Return the given start, else one from a coarser grid if the grid is large, else None.

    None is also returned where a coarser grid would not help, see `_on_coarser_grid`.
    """
    least_nodes = NESTED
    if problem.boundary != "free" and problem.delta is None:
        least_nodes = NESTED_EDGELESS
    if near is None and min(problem.heights.shape) >= least_nodes:
        return _on_coarser_grid(problem)
    return near


def _has_elastic(problem: Problem) -> bool:
    """Return whether elastic bodies have an equilibrium at the displacement or under the force."""
    if problem.delta is None or not problem.has_most_delta:
        return True
    return problem.delta < _mean_depth(problem.heights)


def _elastic_after_all(
    problem: Problem, yielding: Equilibrium, near: Start | None
) -> Equilibrium:
    """Solve without the hardness, and return this solution unless it exceeds the hardness.

    A hardness that is never reached therefore changes no bit of the result. `yielding` is the
    solution with the hardness, which is returned otherwise. The efforts of both are added up.
    """
    elastic = equilibrium_of(replace(problem, hardness=None), near)
    assert elastic is not None
    effort = yielding.effort + elastic.effort
    largest = float(elastic.pressure.max())
    if elastic.converged and not largest > problem.reduced_hardness(elastic.length):
        return replace(elastic, effort=effort)
    return replace(yielding, effort=effort)


def _reduced_load(problem: Problem) -> float:
    """Return the force over E* and the second side of a cell [um]."""
    assert problem.force is not None
    return problem.force / problem.modulus / problem.spacing[1]


def _mean_depth(heights: Field) -> float:
    """Return the mean depth of a surface below its highest node [um]."""
    return float((heights.max() - heights).mean())


# Few nodes that may touch


def _on_few_nodes(problem: Problem, give: float) -> Equilibrium | None:
    """Solve by dense algebra where few nodes of a free patch may touch; None if more may.

    Nothing touches where the undeformed bodies do not overlap, because pressure displaces every
    node downwards. `give` is the compliance of the far field, 0 if it is rigid
    [first side of a cell / E*].
    """
    delta = problem.delta
    if delta is None:
        overlapping = LEAST_OVERLAPPING * _relative_load(problem) * problem.heights.size
        if overlapping > FEW_NODES:
            return None
    if delta is None or problem.far_field == "compliant":  # the far field may go further
        delta = _depth_of_few(problem.heights)
        if not delta > 0:
            return None
    touching = overlap(problem, delta)
    if np.count_nonzero(touching.below > -1) > FEW_NODES:
        return None
    if problem.delta is None:
        give = 0.0  # a force is carried by the same pressure on either far field
    return _solve_densely(problem, touching, delta, give)


def _depth_of_few(heights: Field) -> float:
    """Return the depth of the node with the rank `FEW_NODES` + 1 from the top [um].

    It counts from the highest node. On smaller grids it is the depth of the lowest node.
    """
    flat = heights.reshape(-1)
    rank = min(FEW_NODES + 1, flat.size)
    return float(flat.max() - np.partition(flat, -rank)[-rank])


@on_one_blas_thread()
def _solve_densely(
    problem: Problem, touching: Overlap, length: float, give: float
) -> Equilibrium | None:
    """Solve by dense algebra on all nodes that may touch.

    `touching` is the box of these nodes. `length` is the unit of its heights, and the depth down to
    which nodes may touch [um]. `give` is the compliance of the far field, 0 if it is rigid
    [first side of a cell / E*]. Return None if the load needs more nodes, or no solution meets the
    tolerance.
    """
    hardness = problem.reduced_hardness(length)
    matrix = InfluenceMatrix(touching.below.shape, problem.reduced_body, problem.aspect)
    below = touching.below.reshape(-1)
    nodes = np.flatnonzero(below > -1)
    nodes = nodes[np.argsort(-below[nodes], kind="stable")]  # highest first
    shift = (problem.delta or 0.0) / length
    solution = _dense_solution(problem, matrix, nodes, below + shift, length, give)
    if solution is None:
        return None
    if problem.delta is None:
        shift = solution.shift
    approach = shift + give * float(solution.pressure.sum())
    if not solution.settled or not 0 < approach <= 1:  # beyond 1, more nodes may touch
        return None
    values = np.zeros(below.size)
    values[solution.nodes] = solution.pressure
    pressure = values[nodes]
    entries = matrix.between(nodes, nodes)
    residual = below[nodes] + approach - np.einsum("ij,j->i", entries, pressure)
    # Departures from equilibrium: gap or penetration in contact, penetration of nodes without
    # pressure, and the gap of yielded nodes.
    departures = np.where(pressure > 0, np.abs(residual), residual)
    yielded = pressure >= hardness
    departures[yielded] = -residual[yielded]
    violation = max(float(departures.max()), 0.0) / shift
    if not violation <= problem.rtol:
        return None
    delta = problem.delta
    if delta is None:
        delta = shift * length
    return Equilibrium(
        pressure=touching.unfolded(values.reshape(touching.below.shape)),
        length=length,
        delta=delta,
        approach=approach * length,
        violation=violation,
        effort=Effort(iterations=solution.sets, convolutions=solution.sets),
        converged=True,
    )


def _dense_solution(
    problem: Problem,
    matrix: InfluenceMatrix,
    nodes: Nodes,
    interference: Values,
    length: float,
    give: float,
) -> DenseSolution | None:
    """Solve densely for elastic bodies, and again for yielding ones if the hardness is exceeded.

    `nodes` are flat indices of the box, highest first. `interference` is flat, of the whole box
    [length]; it contains the displacement if that is given. `length` is in um, and `give`, the
    compliance of the far field, in first sides of a cell over E*. The solution may not have
    settled. Return None if a matrix is not positive definite, or numbers overflow.
    """
    load = None
    if problem.delta is None:
        load = _reduced_load(problem) / length
    hardness = problem.reduced_hardness(length)
    sets = min(MOST_SETS, problem.max_iterations)
    try:
        with np.errstate(over="raise"):
            factor = ContactFactor(lambda among: matrix.among(among, give), nodes)
            solution = factor.solve(interference, load, sets)
            if float(solution.pressure.max()) > hardness:
                factor = ContactFactor(matrix.among, nodes, hardness)
                solution = factor.solve(interference, load, sets)
    except (np.linalg.LinAlgError, FloatingPointError):
        return None
    return solution


# At a given displacement


def _at_displacement(problem: Problem, near: Start | None, give: float) -> Equilibrium:
    """Solve at a given displacement, from a start if there is one.

    Delta is the unit of displacement. Without a start, or with a poor one, begin from full contact
    if Delta is near it, else from no pressure. `give` is the compliance of the far field, 0 if it
    is rigid [first side of a cell / E*].
    """
    delta = problem.delta
    assert delta is not None
    edgeless = problem.boundary != "free"
    if edgeless and problem.hardness is not None:
        pressed_in = problem.hardness * problem.body.mean_compliance
        if np.ptp(problem.heights) + pressed_in <= delta:
            return _all_yielded(problem, delta)
    reached = delta
    if give > 0 or not problem.touches_by_overlap:  # all nodes may touch
        reached = math.inf
    touching = overlap(problem, reached, delta)
    iterate = _new(problem, touching, delta, give=give)
    # A start may overflow: it is then found to be poor.
    with np.errstate(over="ignore", invalid="ignore"):
        if near is not None:
            _begin_from(iterate, problem, near, touching, delta)
            is_poor = iterate.worthless(FARTHEST)
        else:
            is_poor = edgeless and not _begun_nearly_full(iterate)
    if is_poor:
        iterate = _new(problem, touching, delta, give=give)
    spent = 0
    if near is not None:
        spent = near.spent
    del near  # its memory is free again
    if edgeless and problem.hardness is not None:
        iterate.expect_yielding()  # elastic contacts may be full before this displacement
    if not iterate.pressure.any():
        iterate.take_first_steps(iterate.patch.few / 2)
    elif spent:
        iterate.approach(iterate.patch.few / 2, interpolated=True)
    return _solved(problem, iterate, touching, delta, spent)


def _begun_nearly_full(iterate: Iterate) -> bool:
    """Begin at a given Delta from the pressure of full contact plus a constant, cut off below zero.

    The patch has no edges, and the iterate's unit of displacement is Delta. The mean gap falls
    nearly exponentially with the constant (Persson 2007); trials tell how fast. Return whether the
    iterate now has a useful start. If Delta is not below that of full contact, or below the share
    `NEARLY_FULL` of it, return False and leave the iterate as it is.
    """
    below = iterate.below
    full_delta = -float(below.mean())  # Delta of full contact, over Delta
    if iterate.patch.mean_compliance > 0:
        return _begun_beyond_mean_depth(iterate, full_delta)
    if full_delta < 1 or 1 / full_delta < NEARLY_FULL:
        return False
    full = iterate.patch.zero_mean_pressure(below)
    # Gaps are means, as a share of Delta of full contact: a pressure in balance at a displacement s
    # leaves 1 - s / full_delta, because it does not move the mean of the surface.
    wanted_gap = max(1 - 1 / full_delta, LEAST_GAP)
    scale = float(full.std()) / 2  # gap = exp(-constant / scale), a first guess
    for _ in range(CONSTANTS):
        constant = -scale * math.log(wanted_gap)
        pressure = np.maximum(full + constant, 0)
        iterate.begin(pressure)
        penetration = float(iterate.residual.mean(where=pressure > 0))
        # Less the mean penetration, Delta is the displacement at which the pressure is in balance.
        gap = 1 - (1 - penetration) / full_delta
        # Nodes that penetrate have too little pressure, which is safe to begin from. Of a gap out
        # of range there is no logarithm for the next trial.
        if penetration > 0 or not 0 < gap < 1:
            break
        scale = constant / -math.log(gap)
    return not iterate.worthless(math.inf)


def _begun_beyond_mean_depth(iterate: Iterate, mean_depth: float) -> bool:
    """Begin at a given Delta from the pressure of full contact, cut off below zero.

    It serves bodies with a mean compliance, on which full contact has a pressure at every Delta.
    `mean_depth` is the mean depth of the surface [Delta]. Return whether the iterate now has a
    useful start; if Delta is below this depth, return False and leave the iterate as it is.
    """
    if mean_depth > 1:
        return False
    full = iterate.patch.zero_mean_pressure(iterate.below)
    uniform = (1 - mean_depth) / iterate.patch.mean_compliance
    iterate.begin(np.maximum(full + uniform, 0))
    return not iterate.worthless(math.inf)


def _begin_from(
    iterate: Iterate, problem: Problem, near: Start, touching: Overlap, length: float
) -> None:
    """Begin an iterate from a start on the whole grid.

    `touching` is the part that is solved, and `length` the unit of length [um]. The start's
    displacement is used only if all of its pressure is in this part.
    """
    pressure = near.pressure[touching.box] * (problem.spacing[0] / length)
    displacement = None
    inside = np.count_nonzero(pressure) == np.count_nonzero(near.pressure)
    if near.displacement is not None and inside:
        displacement = near.displacement[touching.box] / length
    iterate.begin(pressure, displacement)


def _all_yielded(problem: Problem, delta: float) -> Equilibrium:
    """Return the equilibrium with the hardness on all nodes.

    It is the solution without edges if all of the surface still penetrates at `delta` [um].
    """
    return Equilibrium(
        pressure=np.full(problem.heights.shape, problem.reduced_hardness(delta)),
        length=delta,
        delta=delta,
        approach=delta,
        violation=0.0,
        effort=Effort(),
        converged=True,
    )


def _new(
    problem: Problem,
    touching: Overlap,
    length: float,
    *,
    load: float | None = None,
    give: float = 0.0,
) -> Iterate:
    """Return an iterate without any pressure for the part `touching` of a problem.

    `length` is the unit of length [um]. If `load` is None, the displacement is given and is the
    unit of length. `load` is reduced. `give` is the compliance of the far field, 0 if it is rigid
    [first side of a cell / E*].
    """
    shape = touching.below.shape[0], touching.below.shape[1]
    patch = Patch(shape, problem.boundary, problem.reduced_body, problem.aspect, give)
    return Iterate(
        patch,
        touching.below,
        shift=1.0 if load is None else None,
        load=load,
        hardness=problem.reduced_hardness(length),
        rtol=problem.rtol,
        max_iterations=problem.max_iterations,
        least_displacement=LEAST,
    )


def _solved(
    problem: Problem, iterate: Iterate, touching: Overlap, length: float, spent: int
) -> Equilibrium:
    """Take an iterate to equilibrium, or as near as it comes, and put the result on the whole grid.

    `touching` is the part of the grid that is solved, `length` the unit of length [um], and `spent`
    the number of convolutions that the start took.
    """
    active_set = ActiveSet(iterate)
    if not active_set.settle_few():
        active_set.run()
    if not iterate.exact:
        iterate.renew()
    assert iterate.displacement is not None
    unit = 1.0
    if iterate.load is not None:  # as `Iterate.tolerance`
        unit = LEAST
        if iterate.shift > 0:
            unit = iterate.shift
    exact_residual = iterate.below + iterate.shift
    exact_residual -= iterate.displacement
    violation = iterate.violation(exact_residual).largest / unit
    give = iterate.patch.give
    given_way = 0.0
    if give:
        given_way = give * float(iterate.pressure.sum())
    delta = problem.delta
    if delta is None:
        delta = iterate.shift * length
    displacement = iterate.displacement.copy()  # the next solve overwrites the original
    return Equilibrium(
        pressure=touching.unfolded(iterate.pressure),
        length=length,
        delta=delta,
        approach=(iterate.shift + given_way) * length,
        violation=violation,
        effort=Effort(
            iterations=iterate.iterations,
            convolutions=iterate.patch.convolutions + spent,
        ),
        converged=violation <= problem.rtol,
        stalled=active_set.stalled,
        displacement=touching.unfolded(displacement, np.nan),
        presumably_elastic=iterate.yields and not _is_certain_to_yield(iterate),
    )


def _is_certain_to_yield(iterate: Iterate) -> bool:
    """Return whether a node at the hardness still penetrates by more than the tolerance."""
    yielded = iterate.pressure >= iterate.hardness
    return float((iterate.residual * yielded).max()) > iterate.tolerance


# Under a given load


def _under_load(problem: Problem, near: Start | None) -> Equilibrium:
    """Solve under a given force; the displacement follows from the balance of the free nodes.

    A light load presses on a few summits of a free patch. Therefore only the part of the grid that
    overlaps at a guess of the displacement is solved. If the displacement turns out to be larger,
    the part that overlaps at this displacement is solved next, from the pressure so far. This part
    suffices, because fewer nodes are pressed deeper: the displacement of a part is never below the
    displacement of the whole grid.
    """
    load = _reduced_load(problem)
    depth = _mean_depth(problem.heights)
    length = min(depth or problem.spacing[0], REACH * load)
    reached = _reach(problem, near)
    touching = overlap(problem, reached, length)
    iterate = _new(problem, touching, length, load=load / length)
    if near is not None and near.pressure[touching.box].any():
        _begin_from(iterate, problem, near, touching, length)
    else:
        guess = _first_guess(problem, iterate, load / length)
        if guess.is_solution:
            return _full_contact(problem, guess.pressure, length)
        iterate.begin(guess.pressure)
        del guess  # `begin` has copied it
    spent = 0
    enough = ENOUGH_FREE if problem.boundary == "free" else ENOUGH
    if near is not None:
        spent = near.spent
        if not spent > 0:  # a contact near the solution, not a first guess
            enough = ENOUGH
    enough *= iterate.patch.few
    del near  # its memory is free again
    iterate.approach(enough, interpolated=spent > 0)
    solution = _solved(problem, iterate, touching, length, spent)
    on_all_nodes = iterate.below.shape == problem.heights.shape
    if on_all_nodes or not solution.delta > reached:
        return solution
    pressure = solution.pressure * (length / problem.spacing[0])
    larger = _under_load(problem, Start(pressure, reach=FURTHER * solution.delta))
    return replace(larger, effort=solution.effort + larger.effort)


def _reach(problem: Problem, near: Start | None) -> float:
    """Return the displacement beyond which no node is likely to touch, inf if unknown [um]."""
    if not problem.touches_by_overlap:
        return math.inf
    if near is not None and near.reach is not None:
        return near.reach
    return _guessed_reach(problem)


def _guessed_reach(problem: Problem) -> float:
    """Guess generously the displacement under a load [um].

    It is infinite if more than `MOST_OVERLAPPING` of the nodes may overlap, or the highest nodes
    are level.
    """
    size = problem.heights.size
    # Mean pressure over hardness: the share of the nodes that has to carry the load at least.
    least_yielded = _reduced_load(problem) / size / problem.reduced_hardness(1.0)
    share = OVERLAPPING * _relative_load(problem) + least_yielded
    number = FEW_NODES + math.ceil(min(share, 1.0) * size)
    if not (share < MOST_OVERLAPPING and number < size):
        return math.inf
    foot = np.partition(problem.heights, size - number, axis=None)[size - number]
    depth = float(problem.heights.max() - foot)
    if not depth > 0:
        return math.inf
    return math.nextafter(depth, math.inf)  # nodes of this height overlap too


class Guess(NamedTuple):
    """A first pressure that carries a load.

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure, nowhere negative [reduced].
    is_solution : bool
        Whether it is the pressure of full contact within its bounds, and so the solution.
    """

    pressure: Field
    is_solution: bool


def _first_guess(problem: Problem, iterate: Iterate, load: float) -> Guess:
    """Guess a pressure that carries a load [reduced], from full contact or on the summits.

    A guess on the summits changes the patch's contact set.
    """
    relative_load = _relative_load(problem)
    full = _full_pressure(problem, iterate, relative_load)
    if full is None:
        summits = _pressure_on_summits(problem, iterate, relative_load)
        return Guess(summits, is_solution=False)
    if full.min() >= 0 and full.max() <= iterate.hardness:
        return Guess(full, is_solution=True)
    return Guess(cut_to_load(full, load), is_solution=False)


def _full_pressure(
    problem: Problem, iterate: Iterate, relative_load: float
) -> Field | None:
    """Return the pressure of full contact under the load; it may be negative at places [reduced].

    Its projection onto pressures that are not negative is near the solution under larger loads.
    Return None on free patches, where it is not known, and if `relative_load` is below `LIGHT` (see
    `_relative_load`).
    """
    if problem.boundary == "free" or not relative_load >= LIGHT:
        return None
    assert iterate.load is not None
    zero_mean_pressure = iterate.patch.zero_mean_pressure(iterate.below)
    mean_pressure = iterate.load / iterate.below.size
    return zero_mean_pressure + mean_pressure


def _pressure_on_summits(
    problem: Problem, iterate: Iterate, relative_load: float
) -> Field:
    """Guess a pressure on the highest nodes that carries the load [reduced].

    These nodes are pressed as deep as a plane at the lowest of them would press them. A constant is
    then subtracted from their pressure so that it carries the load. `relative_load` (see
    `_relative_load`) sets the number of these nodes, which become the patch's contact set.
    """
    patch = iterate.patch
    below = iterate.below
    assert iterate.load is not None
    share = min(PEAKS * relative_load, 1.0)
    number = min(int(share * problem.heights.size) + 1, below.size)
    foot = np.partition(below, -number, axis=None)[-number]
    high = below >= foot
    patch.take_contact(high)
    pressure: Field = np.zeros(below.shape)
    patch.add_to(pressure, patch.correct(patch.in_contact(below - foot)))
    pressure[high] = cut_to_load(pressure[high], iterate.load)
    if not pressure.any():  # rounding has left none
        pressure[high] = 1.0
    return pressure


def _relative_load(problem: Problem) -> float:
    """Return the mean pressure under the given force over E* h' [1].

    h' is the rms slope on every row and column with a number divisible by `SAMPLED`. The result is
    infinite for surfaces without a slope.
    """
    # Heights over their range, so that no square overflows.
    height_range = float(np.ptp(problem.heights))
    if not height_range > 0:
        return math.inf
    along = np.diff(problem.heights[:, ::SAMPLED], axis=0) / height_range
    across = np.diff(problem.heights[::SAMPLED], axis=1) / height_range
    # Slope and pressure over E* are both multiplied by the first side of a cell over this range.
    slope = math.sqrt(_mean_square(along) + _mean_square(across) / problem.aspect**2)
    pressure = _reduced_load(problem) / problem.heights.size / height_range
    if not slope > 0:
        return math.inf
    return pressure / slope


def _mean_square(differences: Field) -> float:
    """Return the mean square of an array, 0 of an empty one."""
    return float((differences * differences).sum()) / max(differences.size, 1)


def _full_contact(problem: Problem, pressure: Field, length: float) -> Equilibrium:
    """Return the equilibrium of full contact on a patch without edges.

    `pressure` is its pressure, within bounds [reduced], and `length` the unit of length [um].
    """
    below = (problem.heights - problem.heights.max()) / length
    depth = -float(below.mean()) * length
    return Equilibrium(
        pressure=pressure,
        length=length,
        delta=depth,
        approach=depth,
        violation=0.0,
        effort=Effort(convolutions=1),
        converged=True,
        displacement=below - below.mean(),
    )


# Starts on coarser grids


def _on_coarser_grid(problem: Problem) -> Start | None:
    """Return a start from a loose solve on a grid with twice the spacing.

    Its pressure is interpolated to the nodes of the problem. Return None where it would save no
    work, or the coarser grid has no equilibrium. ArithmeticError passes through, see
    `equilibrium_of`.
    """
    coarse = None
    if _gains_by_nesting(problem):
        coarse = _coarse_problem(problem)
    if coarse is None:
        return None
    loose = equilibrium_of(coarse)
    assert loose is not None
    pressure = loose.pressure * (loose.length / coarse.spacing[0])
    free = problem.boundary == "free"
    if free:
        for axis, nodes in enumerate(problem.heights.shape):
            pressure = _between(pressure, axis, nodes)
    else:  # each coarse cell covers two by two cells
        pressure = pressure.repeat(2, axis=0).repeat(2, axis=1)
    reach = None
    if free and coarse.delta is None:
        # The coarser grid may leave out the highest node.
        lost_height = float(problem.heights.max() - coarse.heights.max())
        reach = FURTHER * (loose.delta + lost_height)
    share = coarse.heights.size / problem.heights.size
    spent = math.ceil(share * loose.effort.convolutions)
    return Start(pressure, spent=spent, reach=reach)


def _gains_by_nesting(problem: Problem) -> bool:
    """Return whether a start on a coarser grid saves work.

    It saves none where few nodes come into contact, unless the grid is large, nor under a load near
    full contact without edges. Without edges, it cannot be made if a side has an odd number of
    nodes.
    """
    rows, columns = problem.heights.shape
    if min(rows, columns) < NESTED_FAINT and _is_faint(problem):
        return False
    if problem.boundary == "free":
        return True
    if rows % 2 or columns % 2:
        return False
    return problem.delta is not None or not _relative_load(problem) >= NESTED_FULL


def _coarse_problem(problem: Problem) -> Problem | None:
    """Return the problem on a grid with twice the spacing; None if it has no equilibrium.

    Free patches leave out every second row and column, whose outer nodes stay on the border.
    Without edges, heights are means over cells of two by two nodes.
    """
    rows, columns = problem.heights.shape
    free = problem.boundary == "free"
    if free:
        heights = problem.heights[::2, ::2]
    else:
        cells = problem.heights.reshape(rows // 2, 2, columns // 2, 2)
        heights = cells.mean(axis=(1, 3))
    delta = problem.delta
    if delta is not None:
        # Delta counts from the highest node of the coarser grid.
        delta -= float(problem.heights.max() - heights.max())
        end = math.inf
        if problem.far_field == "compliant":
            end = critical_delta(heights, problem.reduced_body, problem.aspect)
        elif problem.has_most_delta and problem.hardness is None:
            end = _mean_depth(heights)
        if delta <= 0 or delta >= NESTED_BELOW * end:
            return None
    return replace(
        problem,
        heights=heights,
        spacing=(2 * problem.spacing[0], 2 * problem.spacing[1]),
        delta=delta,
        rtol=NESTED_RTOL,
    )


def _is_faint(problem: Problem) -> bool:
    """Return whether the load or the displacement is likely to bring few nodes into contact."""
    if problem.delta is None:
        return _relative_load(problem) < FAINT_PRESSURE
    return problem.delta < FAINT_DELTA * _mean_depth(problem.heights)


def _between(values: Field, axis: int, nodes: int) -> Field:
    """Insert the means of neighbours along an axis, so that it has `nodes` nodes.

    `values` has (nodes + 1) // 2 nodes along the axis. If `nodes` is even, the last of them has no
    neighbour beyond it, and its value is repeated.
    """
    coarse = np.moveaxis(values, axis, 0)
    filled = np.empty((nodes, *coarse.shape[1:]))
    filled[::2] = coarse
    filled[1::2] = coarse[: nodes // 2]
    inner = (nodes - 1) // 2
    filled[1 : 2 * inner : 2] += coarse[1 : inner + 1]
    filled[1 : 2 * inner : 2] /= 2
    return np.moveaxis(filled, 0, axis)
