"""Contact of a body that yields: no pressure is negative, and none exceeds the hardness.

Besides the contact set there is a second set, the yielded nodes. Their pressure is the hardness, so
that they are known loads and leave the linear system. Changing both sets after a loose solve takes
few convolutions, but can cycle. Then the yielded set only grows, each time from the one-sided
solution on the other nodes. This ends wherever taking load off a node lowers the displacement of
all nodes, as it does on a free patch: no yielded node then ever has to be released.
"""

from dataclasses import replace

import numpy as np

from bem.active_set import (
    FROM_NEAR,
    FROM_SCRATCH,
    IDLE_RENEWALS,
    ROUNDING,
    TIGHTENING,
    Pace,
    solve_complementarity,
)
from bem.arrays import Nodes, Values
from bem.first_contact import far_field_law, take_first_steps
from bem.gradients import run_stage
from bem.iterate import (
    CONVOLUTION,
    ITERATION,
    Effort,
    Iterate,
    Operators,
    YieldingIterate,
    inner,
    rescale,
    scaled_to_carry,
)
from bem.sections import on_one_blas_thread

# Share of the load above the hardness up to which the elastic solution is the better start.
MOSTLY_ELASTIC = 0.02

# Relative distance from the hardness at which a node of a start counts as yielded.
AT_HARDNESS = 1e-9

# Capped steps before the first sets are taken.
FIRST_STEPS = 4

# Share of a step's load on nodes at the hardness from which the step is damped. Below, it is
# scaled as a whole, as an elastic one is.
DAMPED = 0.9

# Smallest factor of that scaling; one is the largest.
SMALLEST_SCALE = 0.8

# Factor by which conjugate gradients reduce the residual before both sets are checked.
REDUCTION = 0.5

# Share of the preconditioned residual that is added when a set changes.
ADVANCE = 0.5

# Largest factor by which free pressures grow to carry what capping takes off their neighbours.
LARGEST_SCALE = 2.0

# Share of the free nodes under tension up to which yielded nodes may be released: more tension
# means too much load, under which gaps open everywhere.
FEW_IN_TENSION = 0.1

# Least gap of yielded nodes that are released, as a share of the largest gap: releasing all of them
# at once raises the load too far, and the sets cycle.
RELEASED = 0.4

# The same where the last changes of the sets gained too little.
RELEASED_SLOWLY = 0.8

# Free nodes, as a share of `few_nodes`, up to which a factor replaces conjugate gradients.
FEW_FREE = 0.4

# Changes of the sets in a row, none of which lowers the smallest violation enough, that count as
# cycling.
PATIENCE = 12

# The share of the smallest violation that is low enough.
LOWER = 0.9

# Changes of the sets in all that count as cycling however slowly the violation falls.
MOST_CHANGES = 40

# Residual asked of the first one-sided solves while the yielded set grows.
LOOSEST = 1e-1

# Tolerance [unit of displacement] to which the yielded set grows under a load before both sets are
# changed once more.
GROWN_RTOL = 1e-2

# Factor on that residual each time that the set stands.
STRICTER = 0.1

# Times that nodes may be released from the growing set all the same.
RELEASES = 50


def solve_within(
    operators: Operators,
    interference: Values,
    hardness: float,
    *,
    rtol: float,
    max_iterations: int,
    start: Iterate | None = None,
    pace: Pace = FROM_SCRATCH,
) -> tuple[Iterate, bool]:
    """Find 0 <= p <= P with w >= 0 where p = 0, w = 0 between, and w <= 0 where p = P.

    Parameters
    ----------
    operators : Operators
        The influence matrix H of w = H p - u, on a rigid far field.
    interference : ndarray, shape (m,)
        Interference u [unit of displacement].
    hardness : float
        Largest pressure P, inf for an elastic body [reduced].
    rtol, max_iterations, start, pace
        As in `bem.active_set.solve_complementarity`.

    Returns
    -------
    iterate : Iterate
        The solution, a `YieldingIterate` where nodes have yielded; otherwise the elastic solution,
        the same to the last bit as without a hardness. Or the best that was reached.
    converged : bool
        Whether the tolerance is met. Under a given load, cycling sets end the solve of a free patch
        too.
    """
    if hardness == np.inf:
        return solve_complementarity(
            operators,
            interference,
            rtol=rtol,
            max_iterations=max_iterations,
            start=start,
            pace=pace,
        )
    bounds = rtol, max_iterations
    near = None if start is None else _copied(start)
    iterate, converged = _solve_elastically(operators, interference, hardness, bounds, start, pace)
    if converged and not iterate.pressure.max(initial=0.0) > hardness:
        return iterate, True
    capped = YieldingIterate.above(iterate, hardness)
    if not iterate.pressure.any():
        _take_capped_steps(operators, interference, capped)
    _cap(operators, capped)
    converged = _exchange_sets(operators, interference, capped, rtol, max_iterations)
    if not converged and operators.edgeless and operators.load and not capped.stalled:
        _grow_yielded(operators, interference, capped, GROWN_RTOL, max_iterations)
        converged = _exchange_sets(operators, interference, capped, rtol, max_iterations)
    grow = operators.load is None or operators.edgeless
    if not converged and grow and not capped.stalled:
        converged = _grow_yielded(operators, interference, capped, rtol, max_iterations)
    np.minimum(capped.pressure, hardness, out=capped.pressure)  # rounding of a balance
    if not converged or capped.depth() > rtol:
        return capped, converged
    return _elastic_after_all(operators, interference, capped, bounds, near, pace)


def _elastic_after_all(
    operators: Operators,
    interference: Values,
    capped: YieldingIterate,
    bounds: tuple[float, int],
    near: Iterate | None,
    pace: Pace,
) -> tuple[Iterate, bool]:
    """Solve again without the hardness where no node is certain to have yielded.

    The elastic solution is then the answer to the last bit, unless a pressure in it exceeds the
    hardness by what rounding hides.
    """
    start = None if near is None else replace(near, effort=Effort())
    iterate, converged = solve_complementarity(
        operators, interference, rtol=bounds[0], max_iterations=bounds[1], start=start, pace=pace
    )
    if converged and not iterate.pressure.max(initial=0.0) > capped.hardness:
        iterate.effort += capped.effort
        return iterate, True
    capped.effort += iterate.effort
    return capped, True


def _copied(start: Iterate) -> Iterate:
    """Copy an iterate that a solve is about to change."""
    return replace(start, pressure=start.pressure.copy(), residual=start.residual.copy())


def excess_share(pressure: Values, hardness: float) -> float:
    """Return the share of the load that exceeds the hardness [1]."""
    load = float(pressure.sum())
    return float((pressure[pressure > hardness] - hardness).sum()) / load if load > 0 else 0.0


def _solve_elastically(
    operators: Operators,
    interference: Values,
    hardness: float,
    bounds: tuple[float, int],
    start: Iterate | None,
    pace: Pace,
) -> tuple[Iterate, bool]:
    """Solve without the hardness until its excess shows; take the steps of an elastic solve."""
    iterate = start or Iterate.from_zero(interference)
    if start is None:
        contact = iterate.contact()
        first = operators.approximate_inverse(contact)(interference[contact])
        if excess_share(np.maximum(first, 0), hardness) > MOSTLY_ELASTIC:
            return iterate, False
        take_first_steps(operators, interference, iterate, range(pace.first_steps))
    elif iterate.pressure.max(initial=0.0) > hardness * (1 - AT_HARDNESS):
        return iterate, False
    if excess_share(iterate.pressure, hardness) > MOSTLY_ELASTIC:
        return iterate, False
    begun = start is not None or iterate.effort.convolutions > 0
    return solve_complementarity(
        operators,
        interference,
        rtol=bounds[0],
        max_iterations=bounds[1],
        start=iterate if begun else None,
        pace=replace(pace, first_steps=0) if begun and start is None else pace,
        hardness=hardness,
    )


def _take_capped_steps(
    operators: Operators, interference: Values, iterate: YieldingIterate
) -> None:
    """Take preconditioned steps, cut off at zero and at the hardness, for a convolution each.

    Scaling corrects the load that cutting off has left wrong, unless most of the load is at the
    hardness already. Then the step is damped so that the energy falls the most.
    """
    hardness = iterate.hardness
    for step in range(FIRST_STEPS):
        free = iterate.contact()
        pressure = np.where(iterate.yielded, hardness, iterate.pressure)
        pressure[free] += operators.approximate_inverse(free)(iterate.residual[free])
        np.clip(pressure, 0, hardness, out=pressure)
        capped = pressure >= hardness
        damped = hardness * np.count_nonzero(capped) > DAMPED * pressure.sum()
        change = pressure - iterate.pressure if damped else pressure
        changed = np.flatnonzero(change)
        image = operators.displace_some(changed, change[changed])
        stiffness = inner(change, image)
        if not stiffness > 0:
            return
        iterate.effort += CONVOLUTION
        iterate.exact = False
        if damped:
            scale = min(max(inner(iterate.residual, change) / stiffness, 0.0), 1.0)
            iterate.residual = iterate.residual - scale * image
            iterate.pressure = iterate.pressure + scale * change
            capped &= iterate.pressure > hardness * (1 - 1e-12)
        else:
            scale = inner(interference, pressure) / stiffness
            if capped.any():
                last = step == FIRST_STEPS - 1
                scale = 1.0 if last else min(max(scale, SMALLEST_SCALE), 1.0)
            iterate.residual = interference - scale * image
            iterate.pressure = scale * pressure
        iterate.yielded = capped & (iterate.residual > 0)


def _cap(operators: Operators, iterate: YieldingIterate) -> None:
    """Set pressures above the hardness to it, and let the free nodes carry what a load leaves."""
    before = iterate.pressure.copy()
    iterate.yielded = iterate.pressure >= iterate.hardness * (1 - AT_HARDNESS)
    iterate.pressure[iterate.yielded] = iterate.hardness
    if operators.load is not None:
        iterate.balance(operators.load)
    _displace_change(operators, iterate, before)


def _displace_change(operators: Operators, iterate: YieldingIterate, before: Values) -> None:
    """Update the residual for a change of the pressure, by one convolution."""
    change = iterate.pressure - before
    changed = np.flatnonzero(change)
    if changed.size:
        iterate.residual -= operators.displace_some(changed, change[changed])
        iterate.effort += CONVOLUTION
        iterate.exact = False
    iterate.follow(operators)


def _exchange_sets(
    operators: Operators,
    interference: Values,
    iterate: YieldingIterate,
    rtol: float,
    max_iterations: int,
) -> bool:
    """Solve loosely on the free nodes and change both sets, until they stand or cycle."""
    reduction, energy = REDUCTION, np.inf
    renewed = iterate.violation() if iterate.exact else 1.0
    progress, few_in_tension = _Progress(), False
    while True:
        least = RELEASED_SLOWLY if progress.slows() else RELEASED
        iterate.release(rtol, least=least, at_once=few_in_tension)
        violation = iterate.violation()
        progress.step(violation + iterate.excess())
        floor = max(rtol, ROUNDING * renewed)
        out_of_steps = iterate.effort.iterations >= max_iterations
        ended = progress.cycles() or progress.stalls() or out_of_steps
        if ended or not (violation > floor or iterate.excess() > 0):
            if iterate.exact:
                iterate.stalled = progress.stalls()
                return violation <= rtol and not iterate.excess() > 0
            iterate.renew(operators, interference)
            renewed = iterate.violation()
            progress.renew(renewed)
            continue
        free, before = iterate.contact(), iterate.pressure.copy()
        few = len(free) <= FEW_FREE * operators.few_nodes
        if not (few and _solve_exactly(operators, iterate, free)):
            goals = reduction, floor / 2
            _solve_loosely(operators, iterate, free, goals, max_iterations)
            before, few = iterate.pressure.copy(), False
        in_tension = int(np.count_nonzero(iterate.pressure < 0))
        _change_sets(operators, iterate, before, 0.0 if few else ADVANCE)
        few_in_tension = in_tension <= FEW_IN_TENSION * len(free)
        energy, last = iterate.energy(interference), energy
        if energy > last:
            reduction *= TIGHTENING


class _Progress:
    """Records whether changes of the sets still come nearer to equilibrium."""

    def __init__(self) -> None:
        self._smallest, self._patience, self._changes = np.inf, PATIENCE, 0
        self._smallest_renewed, self._idle_renewals = np.inf, 0

    def step(self, violation: float) -> None:
        """Record the violation after a change of the sets."""
        self._changes += 1
        if self._patience > 0:
            lower = violation < LOWER * self._smallest
            self._patience = PATIENCE if lower else self._patience - 1
        self._smallest = min(self._smallest, violation)

    def renew(self, violation: float) -> None:
        """Record the violation of an exact residual."""
        smaller = violation < self._smallest_renewed / 2
        self._idle_renewals = 0 if smaller else self._idle_renewals + 1
        self._smallest_renewed = min(self._smallest_renewed, violation)
        if self._patience > 0:
            self._smallest, self._patience = np.inf, PATIENCE

    def slows(self) -> bool:
        """Return whether the last changes of the sets gained too little."""
        return self._patience <= PATIENCE // 2

    def cycles(self) -> bool:
        """Return whether the sets recur."""
        return self._patience == 0 or self._changes >= MOST_CHANGES

    def stalls(self) -> bool:
        """Return whether only rounding is left."""
        return self._idle_renewals >= IDLE_RENEWALS


def _solve_exactly(operators: Operators, iterate: YieldingIterate, free: Nodes) -> bool:
    """Solve on few free nodes by a factor of their matrix; the residual is left as it is."""
    law = far_field_law(0.0, 0.0, None if operators.load is None else 0.0)
    try:
        with on_one_blas_thread(), np.errstate(over="raise"):
            change = operators.factor(free).correct(iterate.residual[free], 0.0, law)
    except (np.linalg.LinAlgError, FloatingPointError):
        return False
    iterate.pressure[free] += change
    iterate.effort += ITERATION
    return True


def _solve_loosely(
    operators: Operators,
    iterate: YieldingIterate,
    free: Nodes,
    goals: tuple[float, float],
    max_iterations: int,
) -> None:
    """Run conjugate gradients on the free nodes until a set has to change."""
    iterate.exact = False
    outside = ~iterate.yielded
    outside[free] = False
    precondition = operators.approximate_inverse(free)
    known = iterate.pressure[free]
    weights = known if known.any() else np.ones_like(known)
    share = None if operators.load is None else weights / float(weights.sum())
    if share is not None and operators.edgeless:  # yielded nodes may have been released since
        iterate.level(weights, iterate.residual[free])

    def correct(residual: Values) -> Values:
        correction = precondition(residual)
        if share is not None:  # corrections carry no load in all
            correction = correction - float(correction.sum()) * share
        return correction

    def has_to_change(pressure: Values, largest: float) -> bool:
        if pressure.min() < 0 or pressure.max() > iterate.hardness:
            return True
        if iterate.opening() > max(goals[1], largest):
            return True
        return bool(np.any(iterate.residual[outside] > goals[1]))

    run_stage(operators, iterate, free, correct, has_to_change, goals, max_iterations)


def _change_sets(
    operators: Operators, iterate: YieldingIterate, before: Values, advance: float
) -> None:
    """Cut off tension, let nodes above the hardness yield, and step ahead on the next free set.

    Parameters
    ----------
    operators : Operators
        The influence matrix.
    iterate : YieldingIterate
        Changed in place; its residual is that of `before`.
    before : ndarray, shape (m,)
        Pressure to which the residual belongs.
    advance : float
        Share of the preconditioned residual that is added.
    """
    free = ~iterate.yielded
    carried = float(iterate.pressure[free].sum())
    left = iterate.pressure < 0
    changed = bool(left.any()) or iterate.excess() > 0
    iterate.pressure[left] = 0
    if changed:
        iterate.pressure[free] = scaled_to_carry(
            iterate.pressure[free], carried, iterate.hardness, LARGEST_SCALE
        )
        iterate.join()
        entering = (iterate.residual > 0) & (iterate.pressure == 0) & ~left
        following = np.flatnonzero(((iterate.pressure > 0) | entering) & ~iterate.yielded)
        if following.size and advance:
            step = advance * operators.approximate_inverse(following)(iterate.residual[following])
            iterate.pressure[following] = np.maximum(iterate.pressure[following] + step, 0)
        if operators.load is not None:
            iterate.balance(operators.load)
    if changed or not advance:
        _displace_change(operators, iterate, before)


def _grow_yielded(
    operators: Operators,
    interference: Values,
    iterate: YieldingIterate,
    rtol: float,
    max_iterations: int,
) -> bool:
    """Let the yielded set grow from one-sided solution to one-sided solution.

    At a given displacement it begins with the nodes that penetrate under the hardness on all nodes:
    these yield for certain. Loose solves may add a node wrongly, which is released when its gap
    opens.
    """
    iterate.yielded = np.zeros(interference.size, dtype=bool)
    if operators.load is None:
        everywhere = np.full(interference.size, iterate.hardness)
        iterate.yielded = interference > operators.displace(everywhere)
        iterate.effort += CONVOLUTION
    goal, releases = LOOSEST, RELEASES
    while iterate.effort.iterations < max_iterations:
        wanted = max(goal, rtol / 2)
        _solve_rest(operators, interference, iterate, wanted, max_iterations)
        if iterate.excess() > 0:
            iterate.join()
            continue
        iterate.renew(operators, interference)
        if iterate.violation() <= rtol:
            return True
        opened = iterate.yielded & (iterate.residual < -wanted)
        if opened.any() and releases:
            iterate.yielded = iterate.yielded & ~opened
            releases -= 1
        elif goal < rtol * STRICTER:
            return False
        else:
            goal *= STRICTER
    if operators.load is not None:  # the last change may have left another load
        iterate.renew(operators, interference)
    return False


def _solve_rest(
    operators: Operators,
    interference: Values,
    iterate: YieldingIterate,
    rtol: float,
    max_iterations: int,
) -> None:
    """Solve the one-sided problem of the nodes that have not yielded, the others being loads."""
    rest = np.flatnonzero(~iterate.yielded)
    loads = np.where(iterate.yielded, iterate.hardness, 0.0)
    left = (interference - operators.displace(loads))[rest]
    near = np.clip(iterate.pressure[rest], 0, iterate.hardness)
    iterate.pressure = loads
    iterate.effort += CONVOLUTION
    iterate.exact = False
    if not rest.size:
        return
    among = operators.among(rest)
    start = Iterate(near, left - among.displace(near), iterate.effort + CONVOLUTION)
    if operators.load is not None:
        among = among.under(max(operators.load - float(loads.sum()), ROUNDING * operators.load))
        rescale(among, left, start)
    solved, _ = solve_complementarity(
        among, left, rtol=rtol, max_iterations=max_iterations, start=start, pace=FROM_NEAR
    )
    iterate.pressure[rest] = solved.pressure
    iterate.effort, iterate.shift = solved.effort, solved.shift
