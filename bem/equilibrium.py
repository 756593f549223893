"""From a checked problem to its equilibrium: units, starts, and the loads of given displacements.

Displacements are in units of a length of the problem, and pressures in units of this length times
E* over the cell's first side. Few nodes that may touch are solved by dense algebra alone. Every
other problem is solved by one active set (`bem.active_set`), which begins from a pressure near by,
from a loose solution on a coarser grid, or from a first guess.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bem.active_set import ActiveSet
from bem.arrays import Field
from bem.dense import MOST_SETS, ContactFactor
from bem.far_field import critical_delta, give_of
from bem.influence import InfluenceMatrix
from bem.iterate import Effort, cut_to_load
from bem.operators.patch import Patch
from bem.problem import Overlap, Problem, overlap
from bem.threads import on_one_blas_thread

# Largest number of nodes that may touch for which dense algebra alone is faster than convolutions
# (`pytest bench -k few_candidates`).
FEW_NODES = 250

# Nodes a side from which on a solve starts from a loose solve on a coarser grid, and the tolerance
# of that one. Under the mean pressure below, over E* times the rms slope, or at the Delta below,
# over the mean depth of the surface, little comes into contact and it pays from more nodes on (seen
# on diamond-square surfaces of 512 and 513 nodes a side).
NESTED, NESTED_FAINT, NESTED_RTOL = 500, 1000, 6e-2
FAINT_PRESSURE, FAINT_DELTA = 4e-3, 0.6

# Mean pressure, over E* times the rms slope, from which on a patch without edges starts from full
# contact on its own grid, which is then the nearer (seen on spectral and diamond-square surfaces of
# 512 and 1,024 nodes).
NESTED_FULL = 1.1

# The coarser grid is solved up to this share of its own largest Delta, that of full contact or
# Delta*: it has no equilibrium beyond it, where the finer one still may.
NESTED_BELOW = 0.9999

# Contact set up to which no first step is taken before dense algebra, as a share of the largest one
# worth factorising: on free patches from a first guess, and else, where a step gains less.
ENOUGH_FREE, ENOUGH = 0.5, 0.9

# Mean pressure, over E* times the rms slope, up to which a start on the highest nodes of a patch
# without edges is nearer to the solution than one from full contact; and the share of nodes that it
# takes, over this pressure. The slope is that of rows and columns some nodes apart.
LIGHT, PEAKS, SAMPLED = 0.1, 8.0, 16

# Nodes of a free patch that overlap at least and at most under a light load, as a share over the
# mean pressure divided by E* times the rms slope (seen are 6 to 30 on diamond-square surfaces of
# 129 to 513 nodes); the share from which the whole grid is solved; and the factor on a displacement
# that is known from a coarser grid, or from a part that was too small.
LEAST_OVERLAPPING, OVERLAPPING, MOST_OVERLAPPING, FURTHER = 6.0, 20.0, 0.3, 1.1

# Unit of length under the smallest loads, over the displacement of one cell that carries all of the
# load. Single precision holds pressures and depths at once only where they are not too far apart.
REACH = 1e3

# Displacement, over the unit of length, that the tolerance refers to while a load has brought none.
LEAST = 1e-3

# Share of the Delta of full contact from which a start from its pressure is the better one, the
# trials of the constant that is added to it, and the least mean gap over that Delta they aim at.
NEARLY_FULL, CONSTANTS, LEAST_GAP = 0.9, 4, 1e-6

# Largest residual [Delta] of a start that is better than none.
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
        Largest violation of complementarity, over the approach, or over Delta if that was given
        [1].
    effort : Effort
        Work that it took.
    converged : bool
        Whether the tolerance is met.
    stalled : bool
        Whether rounding leaves no step that would come nearer.
    displacement : ndarray, shape (nx, ny), or None
        Displacement of the half-space under that pressure, nan outside the box that was solved;
        None if it is not known [length].
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


class Start(NamedTuple):
    """A pressure near the solution, from which a solve begins.

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure [E*].
    displacement : ndarray, shape (nx, ny), or None
        Displacement under that pressure, nan where it is unknown; it saves a convolution [um].
    spent : int
        Convolutions that it took.
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
        None if the bodies are apart or just touch.
    """
    if not (problem.force if problem.delta is None else problem.delta > 0):
        return None
    compliant = problem.far_field == "compliant"
    give = give_of(problem) if compliant else 0.0
    found = _on_few_nodes(problem, give) if problem.boundary == "free" else None
    if found is None:
        at = _under_load if problem.delta is None else _at_displacement
        nested = near is None and min(problem.heights.shape) >= NESTED
        found = at(problem, _on_coarser_grid(problem) if nested else near, give)
    if found.presumably_elastic and (problem.delta is None or _has_elastic(problem)):
        found = _elastic_after_all(problem, found, near)
    if compliant and problem.delta is None:
        given_way = give * _reduced_load(problem)
        found = replace(found, delta=max(found.approach - given_way, 0.0))
    return found


def _has_elastic(problem: Problem) -> bool:
    """Return whether elastic bodies have an equilibrium at the displacement."""
    depth = float((problem.heights.max() - problem.heights).mean())
    return problem.boundary == "free" or (problem.delta or 0.0) < depth


def _elastic_after_all(
    problem: Problem, found: Equilibrium, near: Start | None
) -> Equilibrium:
    """Return the elastic solution, to the last bit, unless it exceeds the hardness."""
    elastic = equilibrium_of(replace(problem, hardness=None), near)
    assert elastic is not None
    effort = found.effort + elastic.effort
    largest = float(elastic.pressure.max())
    if elastic.converged and not largest > problem.reduced_hardness(elastic.length):
        return replace(elastic, effort=effort)
    return replace(found, effort=effort)


def _reduced_load(problem: Problem) -> float:
    """Return the force over E* and the second side of a cell [um]."""
    assert problem.force is not None
    return problem.force / problem.modulus / problem.spacing[1]


# Few nodes that may touch


def _on_few_nodes(problem: Problem, give: float) -> Equilibrium | None:
    """Solve by dense algebra where few nodes of a free patch may touch; None if more may.

    Nothing touches where the undeformed bodies do not overlap: pressure displaces every node
    downwards.
    """
    delta = problem.delta
    if (
        delta is None
        and LEAST_OVERLAPPING * _relative_load(problem) * problem.heights.size > FEW_NODES
    ):
        return None
    if delta is None or problem.far_field == "compliant":
        heights = problem.heights.reshape(-1)
        many = min(FEW_NODES + 1, heights.size)
        delta = float(heights.max() - np.partition(heights, -many)[-many])
        if not delta > 0:
            return None
    touching = overlap(problem, delta)
    if np.count_nonzero(touching.below > -1) > FEW_NODES:
        return None
    return _solve_densely(
        problem, touching, delta, 0.0 if problem.delta is None else give
    )


@on_one_blas_thread()
def _solve_densely(
    problem: Problem, touching: Overlap, delta: float, give: float
) -> Equilibrium | None:
    """Solve on all nodes that may touch; None if the load needs more, or no solution is found."""
    load = None if problem.delta is not None else _reduced_load(problem) / delta
    hardness = math.inf if problem.hardness is None else problem.reduced_hardness(delta)
    matrix = InfluenceMatrix(touching.below.shape, problem.kernel, problem.aspect)
    below = touching.below.reshape(-1)
    shift = 0.0 if problem.delta is None else problem.delta / delta
    interference = below + shift
    sets = min(MOST_SETS, problem.max_iterations)
    nodes = np.flatnonzero(below > -1)
    nodes = nodes[np.argsort(-below[nodes], kind="stable")]
    try:  # elastic bodies first, to the last bit
        with np.errstate(over="raise"):
            factor = ContactFactor(lambda some: matrix.among(some, give), nodes)
            solution = factor.solve(interference, load, sets)
            if float(solution.pressure.max()) > hardness:
                factor = ContactFactor(matrix.among, nodes, hardness)
                solution = factor.solve(interference, load, sets)
    except (np.linalg.LinAlgError, FloatingPointError):
        return None
    if load is not None:
        shift = solution.shift
    approach = shift + give * float(solution.pressure.sum())
    if not solution.settled or not 0 < approach <= 1:
        return None
    values = np.zeros(below.size)
    values[factor.nodes] = solution.pressure
    entries = matrix.between(nodes, nodes)
    residual = below[nodes] + approach - np.einsum("ij,j->i", entries, values[nodes])
    loaded, yielded = values[nodes] > 0, values[nodes] >= hardness
    wrong = np.where(loaded, np.abs(residual), residual)
    wrong[yielded] = -residual[yielded]
    violation = max(float(wrong.max()), 0.0) / shift
    if not violation <= problem.rtol:
        return None
    return Equilibrium(
        pressure=touching.unfolded(values.reshape(touching.below.shape)),
        length=delta,
        delta=shift * delta if problem.delta is None else problem.delta,
        approach=approach * delta,
        violation=violation,
        effort=Effort(solution.sets, solution.sets),
        converged=True,
    )


# At a given displacement


def _at_displacement(problem: Problem, near: Start | None, give: float) -> Equilibrium:
    """Solve at a given displacement; a compliant far field gives way under a unit load."""
    delta = problem.delta
    assert delta is not None
    whole = problem.boundary != "free"
    if whole and problem.hardness is not None and np.ptp(problem.heights) <= delta:
        return _all_yielded(problem, delta)
    touching = overlap(problem, math.inf if whole or give else delta, delta)
    solve = _new(problem, touching, delta, give=give)
    with np.errstate(over="ignore", invalid="ignore"):
        if near is not None:
            solve.begin(*_reduced(problem, near, touching, delta))
            poor = solve.worthless(FARTHEST)
        else:
            poor = whole and not _begun_nearly_full(solve)
    if poor:
        solve = _new(problem, touching, delta, give=give)
    spent = 0 if near is None else near.spent
    del near  # its memory is free again
    if whole and problem.hardness is not None:
        solve.expect_yielding()  # elastic contacts may be full before this displacement
    if not solve.pressure.any():
        solve.take_first_steps(solve.patch.few / 2)
    elif spent:
        solve.approach(solve.patch.few / 2, interpolated=True)
    if not solve.settle_few():
        solve.run()
    return _result(problem, solve, touching, delta, spent)


def _begun_nearly_full(solve: ActiveSet) -> bool:
    """Begin from the pressure of full contact plus a constant, cut off below zero.

    The mean gap falls nearly exponentially with the load (Persson 2007); trials tell how fast.
    Returns whether that is a start, which it is not too far from full contact.
    """
    below = solve.below
    depth = -float(below.mean())
    if depth < 1 or 1 / depth < NEARLY_FULL:
        return False
    full = solve.patch.unbalanced(below)
    scale = float(full.std()) / 2
    for _ in range(CONSTANTS):
        constant = -scale * math.log(max(1 - 1 / depth, LEAST_GAP))
        pressure = np.maximum(full + constant, 0)
        solve.begin(pressure)
        left = float(solve.residual.mean(where=pressure > 0))
        gap = 1 - (1 - left) / depth
        if left > 0 or not 0 < gap < 1:
            break
        scale = constant / -math.log(gap)
    return not solve.worthless(math.inf)


def _reduced(
    problem: Problem, near: Start, touching: Overlap, length: float
) -> tuple[Field, Field | None]:
    """Return a start's pressure and displacement in units of a length, in the part solved."""
    pressure = near.pressure[touching.box] * (problem.spacing[0] / length)
    inside = np.count_nonzero(pressure) == np.count_nonzero(near.pressure)
    if near.displacement is None or not inside:
        return pressure, None
    return pressure, near.displacement[touching.box] / length


def _all_yielded(problem: Problem, delta: float) -> Equilibrium:
    """Return the hardness on all nodes, which displaces nothing: all of the surface penetrates."""
    pressure = np.full(problem.heights.shape, problem.reduced_hardness(delta))
    return Equilibrium(pressure, delta, delta, delta, 0.0, Effort(), converged=True)


def _new(
    problem: Problem,
    touching: Overlap,
    length: float,
    *,
    load: float | None = None,
    give: float = 0.0,
) -> ActiveSet:
    """Return an active set for a problem in units of a length, without any pressure."""
    below = touching.below
    shape = below.shape[0], below.shape[1]
    return ActiveSet(
        Patch(shape, problem.boundary, problem.kernel, problem.aspect, give),
        below,
        shift=1.0 if load is None else None,
        load=load,
        hardness=math.inf
        if problem.hardness is None
        else problem.reduced_hardness(length),
        rtol=problem.rtol,
        most=problem.max_iterations,
        least=LEAST,
    )


def _result(
    problem: Problem, solve: ActiveSet, touching: Overlap, length: float, spent: int
) -> Equilibrium:
    """Put the result of an active set on the grid, and add the convolutions spent before it."""
    if not solve.exact:
        solve.renew()
    assert solve.displacement is not None
    unit = 1.0 if solve.load is None else solve.shift if solve.shift > 0 else LEAST
    exact = solve.below + solve.shift
    exact -= solve.displacement
    violation = max(solve.violation(exact)) / unit
    give, yielded = solve.patch.give, solve.pressure >= solve.hardness
    given_way = give * float(solve.pressure.sum()) if give else 0.0
    return Equilibrium(
        pressure=touching.unfolded(solve.pressure),
        length=length,
        delta=problem.delta if problem.delta is not None else solve.shift * length,
        approach=(solve.shift + given_way) * length,
        violation=violation,
        effort=Effort(solve.iterations, solve.patch.convolutions + spent),
        converged=violation <= problem.rtol,
        stalled=solve.stalled,
        displacement=touching.unfolded(solve.displacement.copy(), np.nan),
        presumably_elastic=solve.yields
        and not float((solve.residual * yielded).max()) > solve.tolerance,
    )


# Under a given load


def _under_load(problem: Problem, near: Start | None, _: float) -> Equilibrium:
    """Solve under a given force; the displacement follows from the balance of the free nodes.

    A light load presses on a few summits of a free patch, so that a part of the grid is solved, the
    one that overlaps at a guess of the displacement that is reached. Where the displacement turns
    out to be larger, a larger part is solved from there: one that overlaps at this displacement,
    which is never below that of the whole grid.
    """
    load = _reduced_load(problem)
    depth = float((problem.heights.max() - problem.heights).mean())
    length = min(depth or problem.spacing[0], REACH * load)
    reached = None if near is None else near.reach
    if reached is None:
        reached = _guessed_reach(problem) if problem.boundary == "free" else math.inf
    touching = overlap(problem, reached, length)
    solve = _new(problem, touching, length, load=load / length)
    if near is not None and near.pressure[touching.box].any():
        solve.begin(*_reduced(problem, near, touching, length))
    else:
        pressure, closed = _first_pressure(problem, solve)
        if closed:
            return _full_contact(problem, pressure, length)
        solve.begin(pressure)
    spent = 0 if near is None else near.spent
    first = problem.boundary == "free" and (near is None or spent > 0)
    enough = solve.patch.few * (ENOUGH_FREE if first else ENOUGH)
    del near  # its memory is free again
    solve.approach(enough, interpolated=spent > 0)
    if not solve.settle_few():
        solve.run()
    found = _result(problem, solve, touching, length, spent)
    if solve.below.shape == problem.heights.shape or not found.delta > reached:
        return found
    pressure = found.pressure * (length / problem.spacing[0])
    further = _under_load(problem, Start(pressure, reach=FURTHER * found.delta), _)
    return replace(further, effort=found.effort + further.effort)


def _guessed_reach(problem: Problem) -> float:
    """Guess generously the displacement under a load [um]; infinite if most nodes may overlap."""
    size = problem.heights.size
    share = OVERLAPPING * _relative_load(problem)
    share += _reduced_load(problem) / size / problem.reduced_hardness(1.0)
    number = FEW_NODES + math.ceil(min(share, 1.0) * size)
    if not (share < MOST_OVERLAPPING and number < size):
        return math.inf
    highest = np.partition(problem.heights, size - number, axis=None)[size - number]
    depth = float(problem.heights.max() - highest)
    return (
        math.nextafter(depth, math.inf) if depth > 0 else math.inf
    )  # equally high nodes too


def _first_pressure(problem: Problem, solve: ActiveSet) -> tuple[Field, bool]:
    """Guess a pressure that carries a load; also return whether it is that of full contact.

    Without edges, the pressure of full contact is known, and its projection onto pressures that are
    not negative is near under larger loads. Otherwise the highest nodes are pressed as deep as a
    plane at their foot would, and a constant is subtracted from their pressure until it carries the
    load.
    """
    patch, below, load = solve.patch, solve.below, solve.load
    assert load is not None
    light = _relative_load(problem)
    if problem.boundary != "free" and light >= LIGHT:
        full = patch.unbalanced(below) + load / below.size
        if full.min() >= 0 and full.max() <= solve.hardness:
            return full, True
        return cut_to_load(full, load), False
    number = min(int(min(PEAKS * light, 1.0) * problem.heights.size) + 1, below.size)
    foot = np.partition(below, -number, axis=None)[-number]
    high = below >= foot
    patch.take_contact(high)
    pressed: Field = np.zeros(below.shape)
    patch.add_to(pressed, patch.correct(patch.in_contact(below - foot)))
    pressed[high] = cut_to_load(pressed[high], load)
    if not pressed.any():
        pressed[high] = 1.0
    return pressed, False


def _relative_load(problem: Problem) -> float:
    """Return a load's mean pressure over E* times the rms slope of some rows and columns [1]."""
    unit = float(np.ptp(problem.heights))
    if not unit > 0:
        return math.inf
    along = np.diff(problem.heights[:, ::SAMPLED], axis=0) / unit
    across = np.diff(problem.heights[::SAMPLED], axis=1) / unit
    rows, columns = (float((d * d).sum()) / max(d.size, 1) for d in (along, across))
    slope = math.sqrt(rows + columns / problem.aspect**2)
    load = _reduced_load(problem) / problem.heights.size / unit
    return load / slope if slope > 0 else math.inf


def _full_contact(problem: Problem, pressure: Field, length: float) -> Equilibrium:
    """Return the pressure of full contact as the solution that it is where it pushes."""
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
    """Solve loosely on a grid with twice the spacing; None where that gains nothing."""
    rows, columns = problem.heights.shape
    if min(rows, columns) < NESTED_FAINT and _is_faint(problem):
        return None
    compliant = problem.far_field == "compliant"
    free = problem.boundary == "free"
    nearly_full = problem.delta is None and _relative_load(problem) >= NESTED_FULL
    if not free and (nearly_full or rows % 2 or columns % 2):
        return None
    if free:
        heights = problem.heights[::2, ::2]
    else:
        heights = problem.heights.reshape(rows // 2, 2, columns // 2, 2).mean(axis=(1, 3))
    delta = problem.delta
    if delta is not None:
        delta -= float(problem.heights.max() - heights.max())
        most = math.inf
        if compliant:
            most = critical_delta(heights, problem.kernel, problem.aspect)
        elif not free and problem.hardness is None:
            most = float((heights.max() - heights).mean())
        if delta <= 0 or delta >= NESTED_BELOW * most:
            return None
    spacing = 2 * problem.spacing[0], 2 * problem.spacing[1]
    coarse = replace(
        problem, heights=heights, spacing=spacing, delta=delta, rtol=NESTED_RTOL
    )
    loose = equilibrium_of(coarse)
    assert loose is not None
    pressure = loose.pressure * (loose.length / spacing[0])
    for axis, nodes in enumerate(problem.heights.shape):
        pressure = (
            _between(pressure, axis, nodes) if free else pressure.repeat(2, axis=axis)
        )
    share = heights.size / problem.heights.size
    reach = None
    if free and delta is None:
        reach = FURTHER * (loose.delta + float(problem.heights.max() - heights.max()))
    return Start(pressure, None, math.ceil(share * loose.effort.convolutions), reach)


def _is_faint(problem: Problem) -> bool:
    """Return whether a load or a displacement is likely to bring little into contact."""
    if problem.delta is None:
        return _relative_load(problem) < FAINT_PRESSURE
    depth = float((problem.heights.max() - problem.heights).mean())
    return problem.delta < FAINT_DELTA * depth


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
