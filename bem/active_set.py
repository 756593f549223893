"""Complementarity of pressure and gap: primal-dual active set with preconditioned gradients.

Dense algebra solves contacts of few nodes (`bem.first_contact`). Elsewhere the active set is fast
but can cycle, above all on a compliant far field, where sets that are too large are nearly
singular. Projected gradients, which are slow but certain to descend, then take over for a while,
and for twice as long the next time. Under a given load the caller handles cycles instead.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bem.arrays import Nodes, Values
from bem.first_contact import settle_few, take_first_steps
from bem.gradients import run_stage
from bem.iterate import CONVOLUTION, STEP, Iterate, Operators, inner, rescale
from bem.vectors import add_scaled, anywhere, combined, joined, keep_positive, put, take, where

# Factor on the wanted reduction of the residual whenever a new contact set raises the energy: the
# previous set was then left too early.
TIGHTENING = 0.5

# Share of its last exact value below which a residual updated in working precision is not trusted:
# single precision carries about seven digits.
ROUNDING = 1e-6

# Rounds in a row without a step after which only rounding is left to change.
IDLE_ROUNDS = 4

# Exact residuals in a row, none below half of the smallest, after which only rounding is left.
IDLE_RENEWALS = 5

# Largest violation at which a pressure above the hardness will stay above it, and an elastic solve
# is given up.
CERTAIN = 1e-2

# Contact sets in a row without a new smallest violation that count as cycling.
PATIENCE = 8

# Projected gradient steps after the first cycle: enough to leave it, few enough to lose little.
SAFE_STEPS = 32


@dataclass(frozen=True)
class Pace:
    """The settings that decide when and how far contact sets change.

    Attributes
    ----------
    first_steps : int
        Projected steps before the first contact set is taken; fewer are needed near the solution.
    inner_reduction : float
        Factor by which conjugate gradients reduce the residual before the set is checked again;
        it should be smaller where sets are better.
    advance : float
        Share of the preconditioned residual added when tension is cut off. The preconditioner
        tends to overestimate, and a whole step would put too many nodes into contact.
    """

    first_steps: int
    inner_reduction: float
    advance: float


# Pace of a solve from no pressure: of 3 to 5 steps, reductions of 0.3 to 0.55 and advances of 0.3
# to 0.5 these take the fewest convolutions on the paper's distribution, which
# `pytest bench -k solve_paper` records.
FROM_SCRATCH = Pace(first_steps=4, inner_reduction=0.4, advance=0.5)

# Pace of a solve from a pressure near the solution, whose contact set is already good.
FROM_NEAR = replace(FROM_SCRATCH, first_steps=0)


def solve_complementarity(
    operators: Operators,
    interference: Values,
    *,
    rtol: float,
    max_iterations: int,
    start: Iterate | None = None,
    pace: Pace = FROM_SCRATCH,
    hardness: float = np.inf,
) -> tuple[Iterate, bool]:
    """Find p >= 0 with w = H p - u >= 0 and p w = 0.

    This is a semi-smooth Newton method. Nodes under pressure and nodes that would penetrate form
    the contact set; the equations on it are solved loosely, tension is cut off, and the set is
    updated until it no longer changes (Hintermueller, Ito and Kunisch 2002; here inexact and
    preconditioned).

    Parameters
    ----------
    operators : Operators
        The influence matrix; it must be positive definite on every contact set that occurs.
    interference : ndarray, shape (m,)
        Interference u [unit of displacement].
    rtol : float
        Largest violation accepted [unit of displacement].
    max_iterations : int
        Bound on the steps of conjugate gradients and contact sets of dense algebra, including
        those that `start` has taken already.
    start : Iterate, optional
        Pressure and residual to start from, improved in place. It does not count as converged
        before its residual has been recomputed.
    pace : Pace
        When and how far contact sets change.
    hardness : float
        Pressure above which the elastic solution is not wanted: the solve ends as soon as it is
        certain enough that some node exceeds it.

    Returns
    -------
    iterate : Iterate
        The solution, or the best that the bound or rounding allowed. Its residual has been
        recomputed from the pressure.
    converged : bool
        Whether the tolerance is met. Under a given load, cycling contact sets end the solve too.
    """
    iterate = start or Iterate.from_zero(interference)
    iterate.exact = start is None
    _take_first_contact(operators, interference, iterate, pace, (rtol, max_iterations))
    violation = iterate.violation()
    renewed = violation if iterate.exact else 1.0
    progress, safe_steps = _Progress(iterate.effort.iterations), SAFE_STEPS
    energy, reduction, following = np.inf, pace.inner_reduction, None
    while True:
        if progress.cycles() and operators.load is None:
            steps = min(safe_steps, max_iterations - iterate.effort.iterations)
            descend(operators, interference, iterate, steps)
            violation, safe_steps = iterate.violation(), 2 * safe_steps
            progress.begin_again()
        certain = hardness < np.inf and violation <= CERTAIN
        if certain and iterate.pressure.max(initial=0.0) > hardness:
            return iterate, False
        floor = max(rtol, ROUNDING * renewed)
        ended = progress.ends() or iterate.effort.iterations >= max_iterations
        if ended or not violation > floor:  # a violation that is nan also ends the loop
            if iterate.exact:
                iterate.stalled = progress.stalls()
                return iterate, violation <= rtol
            iterate.renew(operators, interference)
            renewed = violation = iterate.violation()
            progress.renew(violation)
            continue
        contact = iterate.contact() if following is None else following
        goals = reduction, floor / 2
        _solve_in_contact(operators, interference, contact, iterate, goals, max_iterations)
        renewing = ROUNDING * renewed > rtol / 2 >= ROUNDING * iterate.violation()
        following = _cut_off_tension(
            operators, interference, contact, iterate, pace.advance, renewing
        )
        energy, last = iterate.energy(interference), energy
        if energy > last:
            reduction *= TIGHTENING
        violation = iterate.violation()
        renewed = violation if iterate.exact else renewed
        progress.step(iterate.effort.iterations, violation)


def _take_first_contact(
    operators: Operators,
    interference: Values,
    iterate: Iterate,
    pace: Pace,
    bounds: tuple[float, int],
) -> None:
    """Find the first contact set by projected steps, and by dense algebra if it is small.

    `bounds` are the tolerance of the solve and its bound on iterations.
    """
    rtol, max_iterations = bounds
    take_first_steps(operators, interference, iterate, range(pace.first_steps))
    settle_few(operators, interference, iterate, rtol, max_iterations - iterate.effort.iterations)
    if operators.load is not None and not iterate.pressure.any():  # some nodes must carry the load
        iterate.pressure[:] = operators.load / iterate.pressure.size
        iterate.renew(operators, interference)


class _Progress:
    """A record of violations that tells whether contact sets still approach equilibrium."""

    def __init__(self, iterations: int) -> None:
        self._iterations = iterations
        self._idle_rounds = self._idle_renewals = 0
        self._smallest_renewed = np.inf
        self.begin_again()

    def begin_again(self) -> None:
        """Forget the violations recorded so far."""
        self._smallest, self._patience = np.inf, PATIENCE

    def step(self, iterations: int, violation: float) -> None:
        """Record the violation after a solve on a contact set."""
        self._idle_rounds = 0 if iterations > self._iterations else self._idle_rounds + 1
        self._iterations = iterations
        self._patience = PATIENCE if violation < self._smallest else self._patience - 1
        self._smallest = min(self._smallest, violation)

    def renew(self, violation: float) -> None:
        """Record the violation of a residual recomputed in double precision."""
        smaller = violation < self._smallest_renewed / 2
        self._idle_renewals = 0 if smaller else self._idle_renewals + 1
        self._smallest_renewed = min(self._smallest_renewed, violation)

    def cycles(self) -> bool:
        """Return whether contact sets recur."""
        return self._patience == 0

    def ends(self) -> bool:
        """Return whether further contact sets would gain nothing."""
        return self.stalls() or self.cycles()

    def stalls(self) -> bool:
        """Return whether only rounding is left to change."""
        return self._idle_rounds >= IDLE_ROUNDS or self._idle_renewals >= IDLE_RENEWALS


def _solve_in_contact(
    operators: Operators,
    interference: Values,
    contact: Nodes,
    iterate: Iterate,
    goals: tuple[float, float],
    max_iterations: int,
) -> None:
    """Run conjugate gradients on the nodes in contact until their set has to change."""
    iterate.exact = False
    deflate = _deflation(operators, interference, contact, iterate)
    precondition = operators.approximate_inverse(contact)
    outside = np.ones(iterate.pressure.size, dtype=bool)
    outside[contact] = False

    def correct(residual: Values) -> Values:
        return deflate(precondition(residual), residual)

    def has_to_change(pressure: Values, _: float) -> bool:
        if pressure.min() < 0:
            return True
        residual, small = iterate.residual, goals[1]
        return anywhere(lambda piece: (residual[piece] > small) & outside[piece], residual.size)

    run_stage(operators, iterate, contact, correct, has_to_change, goals, max_iterations)


def _deflation(
    operators: Operators, interference: Values, contact: Nodes, iterate: Iterate
) -> Callable[[Values, Values], Values]:
    """Scale the pressure to the least energy, and keep all corrections conjugate to it.

    Cutting off tension leaves too much load, which shifts the residual of the whole contact. The
    image of the pressure is known, so that scaling the pressure removes this error at no cost
    (deflation: Nicolaides 1987). Rounding puts some of it back into the residual, and every
    correction removes that part again (A-DEF2 of Tang, Nabben, Vuik and Erlangga 2009); otherwise
    long stages would stagnate. On a compliant far field the contact set depends most on this
    scale, and conjugate gradients are left to find it. A given load fixes the scale: corrections
    add up to zero, with the pressure as the direction that absorbs their sum (projected conjugate
    gradients: Gould, Hribar and Nocedal 2001).
    """
    if operators.softening > 0:
        return lambda correction, _: correction
    rescale(operators, interference, iterate)
    if operators.load is not None:
        share = iterate.pressure[contact] / operators.load
        return lambda correction, _: correction - float(correction.sum()) * share
    known, image = take(iterate.pressure, contact), take(interference, contact)
    image -= take(iterate.residual, contact)
    stiffness = inner(known, image)
    if not stiffness > 0:
        return lambda correction, _: correction

    def deflate(correction: Values, residual: Values) -> Values:
        along = (inner(residual, known) - inner(correction, image)) / stiffness
        add_scaled(correction, along, known)
        return correction

    return deflate


def _cut_off_tension(
    operators: Operators,
    interference: Values,
    contact: Nodes,
    iterate: Iterate,
    advance: float,
    renewing: bool,
) -> Nodes | None:
    """Set negative pressures to zero, and take a step on the next contact set.

    No pressure outside the present contact set is negative.

    Both together cost one convolution. It is applied to the change of pressure, or to the whole
    pressure if the residual has to be recomputed because working precision no longer suffices.
    """
    pressure, residual = iterate.pressure, iterate.residual
    held = take(pressure, contact)
    pulled = where(lambda piece: held[piece] < 0, held.size)
    if not pulled.size:
        return None
    following = where(
        lambda piece: (pressure[piece] > 0) | ((residual[piece] > 0) & (pressure[piece] == 0)),
        pressure.size,
    )
    step = operators.approximate_inverse(following)(take(residual, following))
    before = take(pressure, following)
    advanced = before.copy()
    add_scaled(advanced, advance, step)
    keep_positive(advanced)
    tension = take(contact, pulled)
    pressure[tension] = 0
    put(advanced, following, pressure)
    if renewing:
        iterate.renew(operators, interference)
    else:
        changed = joined(following, tension)
        change = np.empty(changed.size)
        combined(np.subtract, advanced, before, change[: following.size])
        np.negative(take(held, pulled), out=change[following.size :])
        if operators.softening:  # the last bits of their sum depend on their order
            changed, change = _ascending(changed, change)
        operators.image_of(changed, change).add_to(residual, -1.0)
        iterate.effort += CONVOLUTION
    if operators.load is not None:
        rescale(operators, interference, iterate)
        return following
    return None


def _ascending(nodes: Nodes, values: Values) -> tuple[Nodes, Values]:
    """Return the nodes whose values are not zero, in ascending order, and their values."""
    order = np.argsort(nodes)
    order = order[values[order] != 0]
    return nodes[order], values[order]


def descend(operators: Operators, interference: Values, iterate: Iterate, steps: int) -> None:
    """Lower the energy by modified proportioning with reduced gradient projections.

    Conjugate gradients run while they stay in p >= 0; a step that would leave it goes to the
    bound, and a short projected step follows. Nodes are released when their gradient outweighs
    that of the nodes in contact (Dostal and Schoeberl 2005, algorithm 2 with Gamma = 1). The
    method converges from any start.

    Parameters
    ----------
    operators : Operators
        The influence matrix.
    interference : ndarray, shape (m,)
        Interference u [unit of displacement].
    iterate : Iterate
        Pressure and residual, improved in place.
    steps : int
        Number of steps to take.
    """
    length = 1 / operators.norm
    last, iterate.exact = iterate.effort.iterations + steps, False
    direction = _free_gradient(iterate)
    while iterate.effort.iterations < last and iterate.violation() > 0:
        free = _free_gradient(iterate)
        released = np.where(iterate.pressure > 0, 0.0, np.maximum(iterate.residual, 0))
        reduced = np.maximum(free, -iterate.pressure / length)
        proportional = inner(released, released) <= inner(reduced, free)
        if not proportional:
            direction = released
        image = operators.displace_some(slice(None), direction)
        stiffness = inner(direction, image)
        if not stiffness > 0:  # only rounding is left
            return
        step = inner(iterate.residual, direction) / stiffness
        shrinking = direction < 0
        room = np.min(-iterate.pressure[shrinking] / direction[shrinking], initial=np.inf)
        iterate.pressure += min(step, room) * direction
        iterate.residual -= min(step, room) * image
        iterate.effort += STEP
        if step > room:
            np.maximum(iterate.pressure, 0, out=iterate.pressure)
            np.maximum(iterate.pressure + length * _free_gradient(iterate), 0, out=iterate.pressure)
            iterate.residual = interference - operators.displace(iterate.pressure)
            iterate.effort += CONVOLUTION
            direction = _free_gradient(iterate)
        elif proportional:
            free = _free_gradient(iterate)
            direction = free - inner(free, image) / stiffness * direction
        else:
            direction = _free_gradient(iterate)


def _free_gradient(iterate: Iterate) -> Values:
    """Return the downhill gradient of the energy on the nodes under pressure."""
    return np.where(iterate.pressure > 0, iterate.residual, 0.0)
