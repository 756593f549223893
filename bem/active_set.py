"""Complementarity of pressure and gap: primal-dual active set with preconditioned gradients.

Contacts of few nodes are left to dense algebra (`bem.first_contact`). Elsewhere the active set is
fast but can cycle, above all on a compliant far field, where sets that are too large are nearly
singular. Then projected gradients, slow but certain to descend, take over for a while, and for
twice as long each time; under a given load the caller has another way out.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bem.first_contact import settle_few, take_first_steps
from bem.iterate import Iterate, Nodes, Operators, Values, inner, rescale

# What a residual reduction is multiplied with whenever sets taken so soon raise the energy.
TIGHTENING = 0.5

# A residual kept up in working precision is not believed below this share of its last exact value.
ROUNDING = 1e-6

# Rounds in a row without a step, and exact residuals in a row that do not halve the smallest one,
# after which rounding has the last word.
IDLE_ROUNDS = 4
IDLE_RENEWALS = 5

# Contact sets in a row without a new smallest violation that count as cycling, and the projected
# gradients that follow the first time.
PATIENCE = 8
SAFE_STEPS = 32


@dataclass(frozen=True)
class Pace:
    """How soon contact sets are changed, and by how much.

    Attributes
    ----------
    first_steps : projected steps before the first contact set is taken: fewer near the solution
    inner_reduction : of the residual, asked of conjugate gradients before the set is looked at
        again: more where sets are better
    advance : share of the preconditioned residual taken when tension is cut off; the preconditioner
        is too large rather than too small: a whole step would put too many nodes into contact
    """

    first_steps: int
    inner_reduction: float
    advance: float


# From no pressure at all: the fewest convolutions a solve on the paper's distribution
# (`pytest bench -k solve_paper` records them), of 3 to 5 steps, reductions of 0.3 to 0.55 and
# advances of 0.3 to 0.5. And from a pressure that is near.
FROM_SCRATCH = Pace(first_steps=4, inner_reduction=0.4, advance=0.5)
FROM_NEAR = replace(FROM_SCRATCH, first_steps=0)


def solve_complementarity(
    operators: Operators,
    interference: Values,
    *,
    rtol: float,
    max_iterations: int,
    start: Iterate | None = None,
    pace: Pace = FROM_SCRATCH,
) -> tuple[Iterate, bool]:
    """Find p >= 0 with w = H p - u >= 0 and p w = 0.

    A semi-smooth Newton method: nodes under pressure and nodes that would penetrate are held in
    contact, the equations on them are solved loosely, tension is cut off, and so on until the
    set stands (Hintermueller, Ito and Kunisch 2002; inexact and preconditioned here).

    Parameters
    ----------
    operators : see there; positive definite on every contact set met
    interference : (m,) u [unit of displacement]
    rtol : largest violation accepted
    max_iterations : bound on the steps of conjugate gradients and contact sets of dense algebra,
        those of the start included
    start : a pressure to start from with its residual, which is not taken for converged before it
        has been recomputed; improved in place
    pace : see there

    Returns
    -------
    (iterate, converged) : the solution, or the best that the bound or rounding allowed; its
        residual has been recomputed from the pressure. Under a given load, contact sets that cycle
        end it too
    """
    iterate = start or Iterate(np.zeros_like(interference), interference.copy())
    iterate.exact = start is None
    _take_first_contact(operators, interference, iterate, pace, (rtol, max_iterations))
    violation = iterate.violation()
    renewed = violation if iterate.exact else 1.0
    progress, safe_steps = _Progress(iterate), SAFE_STEPS
    energy, reduction, following = np.inf, pace.inner_reduction, None
    while True:
        if progress.cycles() and operators.load is None:
            steps = min(safe_steps, max_iterations - iterate.iterations)
            descend(operators, interference, iterate, steps)
            violation, safe_steps = iterate.violation(), 2 * safe_steps
            progress.begin_again()
        floor = max(rtol, ROUNDING * renewed)
        ended = progress.stalls() or progress.cycles() or iterate.iterations >= max_iterations
        if ended or not violation > floor:  # not a number ends it too
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
        progress.step(iterate.iterations, violation)


def _take_first_contact(
    operators: Operators,
    interference: Values,
    iterate: Iterate,
    pace: Pace,
    bounds: tuple[float, int],
) -> None:
    """Find the first contact set: by projected steps, and by dense algebra where it is small.

    Parameters
    ----------
    bounds : tolerance and bound on iterations of the solve
    """
    rtol, max_iterations = bounds
    take_first_steps(operators, interference, iterate, pace.first_steps)
    settle_few(operators, interference, iterate, rtol, max_iterations - iterate.iterations)
    if operators.load is not None and not iterate.pressure.any():  # something has to carry it
        iterate.pressure[:] = operators.load / iterate.pressure.size
        iterate.renew(operators, interference)


class _Progress:
    """Whether contact sets still come nearer to equilibrium."""

    def __init__(self, iterate: Iterate) -> None:
        self._iterations = iterate.iterations
        self._idle_rounds = self._idle_renewals = 0
        self._smallest_renewed = np.inf
        self.begin_again()

    def begin_again(self) -> None:
        """Forget the contact sets so far."""
        self._smallest, self._patience = np.inf, PATIENCE

    def step(self, iterations: int, violation: float) -> None:
        """Take note of a contact set that was solved on."""
        self._idle_rounds = 0 if iterations > self._iterations else self._idle_rounds + 1
        self._iterations = iterations
        self._patience = PATIENCE if violation < self._smallest else self._patience - 1
        self._smallest = min(self._smallest, violation)

    def renew(self, violation: float) -> None:
        """Take note of an exact residual, where the one kept up had become small enough."""
        smaller = violation < self._smallest_renewed / 2
        self._idle_renewals = 0 if smaller else self._idle_renewals + 1
        self._smallest_renewed = min(self._smallest_renewed, violation)

    def cycles(self) -> bool:
        """Whether contact sets recur."""
        return self._patience == 0

    def stalls(self) -> bool:
        """Whether rounding has the last word."""
        return self._idle_rounds >= IDLE_ROUNDS or self._idle_renewals >= IDLE_RENEWALS


def _solve_in_contact(
    operators: Operators,
    interference: Values,
    contact: Nodes,
    iterate: Iterate,
    goals: tuple[float, float],
    max_iterations: int,
) -> None:
    """Conjugate gradients on the nodes in contact until their set has to change.

    The set is looked at whenever the residual has fallen by the first of the goals, and left for
    good below the second. The residual is kept up on all nodes, where the convolution gives it for
    nothing.
    """
    iterate.exact = False
    deflate = _deflation(operators, interference, contact, iterate)
    pressure = iterate.pressure[contact]
    known = pressure.copy()
    outside = np.ones(iterate.pressure.size, dtype=bool)
    outside[contact] = False
    residual = iterate.residual[contact]
    reduction, floor = goals
    largest = float(np.abs(residual).max(initial=0.0))
    goal = max(reduction * largest, floor)
    precondition = operators.approximate_inverse(contact)
    direction, previous = np.zeros_like(pressure), np.inf
    while iterate.iterations < max_iterations and largest > floor:
        correction = deflate(precondition(residual), residual)
        product = inner(residual, correction)
        direction = correction + (product / previous) * direction
        previous = product
        image = operators.displace_some(contact, direction)
        stiffness = inner(direction, image[contact])
        iterate.convolutions += 1
        if not (product > 0 and stiffness > 0):  # nothing is left but rounding
            break
        step = product / stiffness
        pressure += step * direction
        iterate.residual -= step * image
        iterate.iterations += 1
        if operators.load is not None:
            iterate.level(known, iterate.residual[contact])
        residual = iterate.residual[contact]
        largest = float(np.abs(residual).max())
        if largest > goal:
            continue
        if pressure.min() < 0 or np.any(iterate.residual[outside] > floor):
            break
        goal = max(reduction * goal, floor)
    iterate.pressure[contact] = pressure


def _deflation(
    operators: Operators, interference: Values, contact: Nodes, iterate: Iterate
) -> Callable[[Values, Values], Values]:
    """Scale the pressure to the least energy, and keep all corrections conjugate to it.

    Tension that was cut off leaves too much load, by which all of the contact is then off: the
    pressure, whose image is known, takes that out for nothing (deflation: Nicolaides 1987). What
    rounding puts back into the residual along it is taken out again with each correction (A-DEF2
    of Tang, Nabben, Vuik and Erlangga 2009); else long stages would come to stand on it and part.
    On a compliant far field the scale is what the contact set hangs on most, and is left to the
    rest. A given load fixes the scale: corrections carry nothing in all, and the pressure takes
    the place of a constraint (projected conjugate gradients: Gould, Hribar and Nocedal 2001).
    """
    if operators.softening > 0:
        return lambda correction, _: correction
    rescale(operators, interference, iterate)
    if operators.load is not None:
        share = iterate.pressure[contact] / operators.load
        return lambda correction, _: correction - float(correction.sum()) * share
    known, image = iterate.pressure[contact], (interference - iterate.residual)[contact]
    stiffness = inner(known, image)
    if not stiffness > 0:
        return lambda correction, _: correction

    def deflate(correction: Values, residual: Values) -> Values:
        along = (inner(residual, known) - inner(correction, image)) / stiffness
        return correction + along * known

    return deflate


def _cut_off_tension(
    operators: Operators,
    interference: Values,
    contact: Nodes,
    iterate: Iterate,
    advance: float,
    renewing: bool,
) -> Nodes | None:
    """Set negative pressures to zero, and step ahead on the next contact set.

    Both for one convolution: of the change, or of the whole pressure where that renews a residual
    which working precision could not carry to the end.
    """
    tension = contact[iterate.pressure[contact] < 0]
    if not tension.size:
        return None
    before = iterate.pressure.copy()
    iterate.pressure[tension] = 0
    following = np.flatnonzero((iterate.pressure > 0) | ((iterate.residual > 0) & (before == 0)))
    step = advance * operators.approximate_inverse(following)(iterate.residual[following])
    iterate.pressure[following] = np.maximum(iterate.pressure[following] + step, 0)
    if renewing:
        iterate.renew(operators, interference)
    else:
        change = iterate.pressure - before
        changed = np.flatnonzero(change)
        iterate.residual -= operators.displace_some(changed, change[changed])
        iterate.convolutions += 1
    if operators.load is not None:
        rescale(operators, interference, iterate)
        return following
    return None


def descend(operators: Operators, interference: Values, iterate: Iterate, steps: int) -> None:
    """Lower the energy by modified proportioning with reduced gradient projections.

    Conjugate gradients while they stay in p >= 0, else to the bound and on by a short projected
    step; nodes are released when their gradient outweighs that of the nodes in contact (Dostal and
    Schoeberl 2005, algorithm 2 with Gamma = 1). Converges from any start.
    """
    length = 1 / operators.norm
    everywhere = np.arange(iterate.pressure.size)
    last, iterate.exact = iterate.iterations + steps, False
    direction = _free_gradient(iterate)
    while iterate.iterations < last and iterate.violation() > 0:
        free = _free_gradient(iterate)
        released = np.where(iterate.pressure > 0, 0.0, np.maximum(iterate.residual, 0))
        reduced = np.maximum(free, -iterate.pressure / length)
        proportional = inner(released, released) <= inner(reduced, free)
        if not proportional:
            direction = released
        image = operators.displace_some(everywhere, direction)
        stiffness = inner(direction, image)
        if not stiffness > 0:  # nothing is left to descend but rounding
            return
        step = inner(iterate.residual, direction) / stiffness
        shrinking = direction < 0
        room = np.min(-iterate.pressure[shrinking] / direction[shrinking], initial=np.inf)
        iterate.pressure += min(step, room) * direction
        iterate.residual -= min(step, room) * image
        iterate.iterations += 1
        iterate.convolutions += 1
        if step > room:
            np.maximum(iterate.pressure, 0, out=iterate.pressure)
            np.maximum(iterate.pressure + length * _free_gradient(iterate), 0, out=iterate.pressure)
            iterate.residual = interference - operators.displace(iterate.pressure)
            iterate.convolutions += 1
            direction = _free_gradient(iterate)
        elif proportional:
            free = _free_gradient(iterate)
            direction = free - inner(free, image) / stiffness * direction
        else:
            direction = _free_gradient(iterate)


def _free_gradient(iterate: Iterate) -> Values:
    """The downhill gradient of the energy on the nodes under pressure."""
    return np.where(iterate.pressure > 0, iterate.residual, 0.0)
