"""Elastic contact of a patch without edges under a load: an active set on whole fields or lists.

The method is that of `bem.active_set`, from projected steps on. `OnFields` keeps contact sets as
masks, `bem.listed_contact.OnLists` as lists of nodes. Search directions and residuals are in single
precision; they refine a pressure in double precision.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Protocol

import numpy as np

from bem.active_set import IDLE_RENEWALS, PATIENCE, ROUNDING, TIGHTENING
from bem.arrays import Mask
from bem.iterate import CONVOLUTION, ITERATION
from bem.vectors import each_row
from bem.whole_patch import Pressed, WholePatch, load_of, shift_by, total, touching_in

# Share of the preconditioned residual that a projected step adds: eigenvalues between 1 and 2 then
# leave a third of an error at most. After full contact, errors are long waves and few are near 2.
APPROACH, APPROACH_FROM_FULL = 2 / 3, 0.75

# Projected steps at most before conjugate gradients, the share of a violation below which another
# one follows, and the violation, over the displacement, from which none is taken.
APPROACH_STEPS, NEARER, NEAR = 4, 0.7, 5e-3

# Shares of the tolerance at which the far field is in balance, and that conjugate gradients reach.
BALANCED, REACHED = 0.9, 0.8

# Factor by which conjugate gradients reduce the residual before the contact set is checked.
REDUCTION = 0.45

# Share of the preconditioned residual that is added when tension is cut off. Reductions from 0.15
# to 0.45 and shares from 0.6 to 1 take nearly the same number of convolutions.
ADVANCE = 0.85


class Steps(Protocol):
    """The steps of a solve under a load, on whole fields or on lists of nodes.

    Attributes
    ----------
    pressed : Pressed
        The pressure that they improve.
    exact : bool
        Whether its residual has been recomputed in double precision.
    """

    pressed: Pressed
    exact: bool

    def violation(self) -> float:
        """Return the largest penetration, or gap under pressure."""

    def approach_step(self) -> None:
        """Take a projected step of the approximate inverse."""

    def renew(self) -> None:
        """Recompute the residual in double precision."""

    def open_stage(self) -> None:
        """Take the next contact set, for conjugate gradients on it."""

    def largest(self) -> float:
        """Return the largest residual in contact."""

    def has_to_change(self, small: float) -> bool:
        """Return whether tension has come up, or penetration outside that is not small."""

    def turn(self, previous: float) -> float:
        """Find the next direction; return the product of residual and correction."""

    def stiffness(self) -> float:
        """Compute the displacement by the direction; return the product of both."""

    def step(self, length: np.float32) -> None:
        """Take a step of a length along the direction."""

    def close_stage(self) -> None:
        """Add the change of the stage to the pressure, and cut off tension if there is any."""

    def energy(self) -> float:
        """Compute p H p / 2 - p u, which is least for the solution under the load."""

    def finish(self) -> None:
        """Put the pressure and the residual back on the whole patch."""


def approach(steps: Steps, enough: Callable[[float], bool] | None = None) -> None:
    """Take projected steps while they come nearer fast.

    Each one takes a convolution, a stage of conjugate gradients and what follows it twice as many.

    Parameters
    ----------
    steps : Steps
        The steps from a start, which is improved in place.
    enough : callable, optional
        Decides from the violation, over the displacement, to take no further step.
    """
    violation, pressed = steps.violation(), steps.pressed
    for _ in range(APPROACH_STEPS):
        relative = violation / pressed.shift if pressed.shift > 0 else math.inf
        if relative <= NEAR or (enough is not None and enough(relative)):
            break
        last = violation
        steps.approach_step()
        violation = steps.violation()
        if not violation < NEARER * last:
            break


def press_under_load(steps: Steps, *, rtol: float, least: float, max_iterations: int) -> bool:
    """Solve for the elastic contact under a load.

    Parameters
    ----------
    steps : Steps
        The steps from a start, which is improved in place until its exact residual meets the
        tolerance.
    rtol : float
        Largest violation accepted, over the displacement [1].
    least : float
        Displacement that the tolerance refers to while none is known.
    max_iterations : int
        Bound on the steps of conjugate gradients.

    Returns
    -------
    bool
        Whether the tolerance is met; False also if contact sets cycle.
    """
    converged = _press(steps, rtol, least, max_iterations)
    steps.finish()
    return converged


def _press(steps: Steps, rtol: float, least: float, max_iterations: int) -> bool:
    """Take the steps of `press_under_load`."""
    pressed, exact, renewed, smallest_renewed, idle = steps.pressed, steps.exact, np.inf, np.inf, 0
    smallest, patience = np.inf, PATIENCE
    reduction, energy = REDUCTION, np.inf
    violation = steps.violation()
    while True:
        wanted = rtol * (pressed.shift if pressed.shift > 0 else least)
        floor = max(BALANCED * wanted, ROUNDING * min(renewed, 1.0))
        ended = patience == 0 or pressed.effort.iterations >= max_iterations
        if violation <= floor or ended:
            if exact:
                return violation <= rtol * pressed.shift
            steps.renew()
            exact, violation = True, steps.violation()
            renewed = violation
            if renewed <= rtol * pressed.shift:
                return True
            idle = 0 if renewed < smallest_renewed / 2 else idle + 1
            smallest_renewed = min(smallest_renewed, renewed)
            if idle >= IDLE_RENEWALS or ended:
                return False
            smallest, patience = np.inf, PATIENCE
            continue
        exact = False
        _run_stage(steps, (reduction, REACHED * floor), max_iterations)
        last, energy = energy, steps.energy()
        reduction *= TIGHTENING if energy > last else 1.0
        violation = steps.violation()
        patience = PATIENCE if violation < smallest else patience - 1
        smallest = min(smallest, violation)


def _run_stage(steps: Steps, goals: tuple[float, float], max_iterations: int) -> None:
    """Run conjugate gradients in contact until the set has to change, as `bem.gradients` does."""
    steps.open_stage()
    pressed, previous, goal = steps.pressed, np.inf, 0.0
    while pressed.effort.iterations < max_iterations:
        largest = steps.largest()
        if largest <= goals[1]:
            break
        goal = goal or goals[0] * largest
        if largest <= goal:
            if steps.has_to_change(goals[1]):
                break
            goal = max(goals[0] * goal, goals[1])
        product = steps.turn(previous)
        previous = product
        stiffness = steps.stiffness()
        pressed.effort += CONVOLUTION
        if not (product > 0 and stiffness > 0):  # only rounding is left
            break
        steps.step(np.float32(product / stiffness))
        pressed.effort += ITERATION
    steps.close_stage()


class OnFields:
    """The steps of a solve on whole fields.

    Parameters
    ----------
    patch : WholePatch
        The influence matrix under the load.
    pressed : Pressed
        A start, improved in place.
    share : float
        Share of the preconditioned residual that a projected step adds [1].
    """

    def __init__(self, patch: WholePatch, pressed: Pressed, share: float = APPROACH) -> None:
        self._patch, self.pressed, self._share = patch, pressed, share
        self._stepped = self.exact = False
        self._sums = np.empty(len(patch.below))

    def violation(self) -> float:
        """Return the largest penetration, or gap under pressure."""
        return self.pressed.violation()

    def renew(self) -> None:
        """Recompute the residual in double precision."""
        pressed = self.pressed
        fresh = self._patch.press(pressed.pressure, pressed.effort)
        pressed.pressure, pressed.shift, pressed.effort = fresh.pressure, fresh.shift, fresh.effort
        pressed.residual = fresh.residual

    def finish(self) -> None:
        """Leave the pressure and the residual where they are."""

    def approach_step(self) -> None:
        """Take a projected step of the approximate inverse."""
        self._cut_off_tension(self._share)
        self._stepped = False

    def energy(self) -> float:
        """Compute p H p / 2 - p u, which is least for the solution under the load."""
        below, pressed, sums = self._patch.below, self.pressed, self._sums

        def add_up(some: slice) -> None:
            depth = below[some] + pressed.residual[some]
            sums[some] = np.einsum("ij,ij->i", pressed.pressure[some], depth)

        each_row(add_up, *below.shape)
        plain = -float(sums.sum()) / 2
        return plain + pressed.shift * self._patch.load / 2

    def open_stage(self) -> None:
        """Take the next contact set, unless the last stage has stepped ahead on it."""
        if not self._stepped:
            self._patch.set_contact(partial(touching_in, self.pressed))
        self._weights = self.pressed.pressure.astype(np.float32)
        self._carried = load_of(self._weights)
        self._direction, self._change = (np.zeros_like(self._weights) for _ in range(2))

    def largest(self) -> float:
        """Return the largest residual in contact."""
        return self._patch.inside(self.pressed.residual)

    def has_to_change(self, small: float) -> bool:
        """Return whether tension has come up, or penetration outside that is not small."""
        residual, outside = self.pressed.residual, self._patch.outside
        found: list[bool] = []

        def look(some: slice) -> None:
            tension = (self._weights[some] + self._change[some]).min() < 0
            found.append(bool(tension or (residual[some] * outside[some]).max() > small))

        each_row(look, *residual.shape)
        return any(found)

    def turn(self, previous: float) -> float:
        """Find the next direction; return the product of residual and correction."""
        correction, residual = self._patch.correct(), self.pressed.residual
        excess = np.float32(load_of(correction) / self._carried)

        def balance(some: slice) -> None:
            correction[some] -= excess * self._weights[some]  # both are zero out of contact
            self._sums[some] = np.einsum("ij,ij->i", residual[some], correction[some])

        each_row(balance, *correction.shape)
        product = float(self._sums.sum())

        def turn(some: slice) -> None:
            self._direction[some] *= np.float32(product / previous)
            self._direction[some] += correction[some]

        each_row(turn, *correction.shape)
        return product

    def stiffness(self) -> float:
        """Compute the displacement by the direction; return the product of both."""
        self._image = self._patch.displace(self._direction)
        return total(self._direction, self._image)

    def step(self, length: np.float32) -> None:
        """Take a step of a length along the direction, whose displacement is spoilt."""
        residual, image = self.pressed.residual, self._image

        def move(some: slice) -> None:
            image[some] *= length
            residual[some] -= image[some]
            self._change[some] += length * self._direction[some]
            self._sums[some] = np.einsum("ij,ij->i", self._weights[some], residual[some])

        each_row(move, *residual.shape)
        shift_by(self.pressed, -float(self._sums.sum()) / self._carried)

    def close_stage(self) -> None:
        """Add the change of the stage; cut off tension, and step ahead on the next contact set."""
        self.pressed.pressure += self._change
        self._stepped = bool(self.pressed.pressure.min() < 0)
        if self._stepped:
            self._cut_off_tension(ADVANCE)

    def _cut_off_tension(self, share: float) -> None:
        """Set negative pressures to zero, step ahead on the next contact set, and keep the load."""
        patch, before, residual = self._patch, self.pressed.pressure, self.pressed.residual

        def touching(some: slice) -> Mask:
            here = before[some]
            touches: Mask = (here > 0) | ((residual[some] > 0) & (here == 0))
            return touches

        patch.set_contact(touching)
        patch.inside(residual)
        correction, pressure = patch.correct(), np.empty_like(before)

        def advance(some: slice) -> None:
            here = pressure[some]
            np.maximum(before[some], 0, out=here)
            here += np.float32(share) * correction[some]
            np.maximum(here, 0, out=here)

        each_row(advance, *before.shape)
        carried = load_of(pressure)
        if not carried > 0:
            pressure, carried = np.ones_like(pressure), float(pressure.size)
        pressure *= patch.load / carried
        image = patch.displace(pressure, before)

        def move(some: slice) -> None:
            residual[some] -= image[some]

        each_row(move, *residual.shape)
        self.pressed.pressure = pressure
        self.pressed.effort += CONVOLUTION
        patch.level(self.pressed)
