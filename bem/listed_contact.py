"""Elastic contact of a patch without edges under a small load: the steps on lists of nodes.

Where few nodes touch, nearly all entries of a whole field are zeros. Pressures, directions and
corrections are therefore lists of the nodes in contact here; only transforms and the residual,
which shows where further nodes come to touch, take the whole patch.
"""

from contextlib import suppress

import numpy as np

from bem.arrays import Nodes, Real, Values
from bem.factor import CONTACT_SETS, ContactFactor
from bem.first_contact import OUTSIDE, RENEWALS, far_field_law
from bem.interface import InterfaceMatrix
from bem.iterate import CONVOLUTION, Effort, inner
from bem.sections import on_one_blas_thread
from bem.under_load import ADVANCE, APPROACH
from bem.vectors import SHORT, Pass, each
from bem.whole_patch import Pressed, WholePatch, cut_to_load, displaced_by

# Largest gap of a node that is factorised with the contact set, over the violation: the set may
# lack some nodes.
MARGIN = 0.3


class OnLists:
    """The steps of a solve on lists of nodes, as `bem.under_load.Steps` describes them.

    Parameters
    ----------
    patch : WholePatch
        The influence matrix under the load.
    pressed : Pressed
        A start, improved in place; its pressure is out of date until `finish`.

    Attributes
    ----------
    exact : bool
        Whether the residual has been recomputed in double precision from the pressure.
    """

    def __init__(self, patch: WholePatch, pressed: Pressed) -> None:
        self._patch, self.pressed = patch, pressed
        self._residual: Real = pressed.residual.reshape(-1)
        self._spread = np.zeros(self._residual.size)
        pressure = pressed.pressure.reshape(-1)
        self._nodes: Nodes = (pressure > 0).nonzero()[0]
        self._values: Values = pressure[self._nodes]
        self._stepped = self.exact = False

    def violation(self) -> float:
        """Return the largest penetration, or gap under pressure."""
        gaps = self._residual[self._nodes] * (self._values > 0)
        return max(float(self._residual.max()), -float(gaps.min()), 0.0)

    def touching(self) -> int:
        """Count the nodes that are under pressure or would penetrate."""
        touching = self._residual > 0
        touching[self._nodes[self._values > 0]] = True
        return int(np.count_nonzero(touching))

    def factorise(self, few: int, most_sets: int, rtol: float) -> None:
        """Solve by dense algebra on the contact set, and on nodes that are nearly in contact.

        Nodes that the set lacks penetrate then; further steps take them in.

        Parameters
        ----------
        few : int
            Largest set worth factorising.
        most_sets : int
            Bound on the contact sets, which count as iterations.
        rtol : float
            Violation, over the displacement, down to half of which rounding is corrected [1].
        """
        violation, pressed = self.violation(), self.pressed
        before = self._nodes, self._values, pressed.residual, pressed.shift
        near = self._residual > -MARGIN * violation
        near[self._nodes[self._values > 0]] = True
        nodes: Nodes = near.nonzero()[0]
        if not 0 < len(nodes) <= few or most_sets < 1:
            return
        # Steps solve nearly singular matrices and depths beyond single precision.
        with suppress(np.linalg.LinAlgError, FloatingPointError), np.errstate(over="raise"):
            self._solve_on(nodes, min(most_sets, CONTACT_SETS), rtol)
        if not self.violation() <= violation:
            self._nodes, self._values, pressed.residual, pressed.shift = before
            self._residual, self.exact = pressed.residual.reshape(-1), False

    @on_one_blas_thread()
    def _solve_on(self, nodes: Nodes, most_sets: int, rtol: float) -> None:
        """Solve on some nodes alone; correct rounding where no node outside penetrates."""
        self._spread[self._nodes] = self._values
        order = np.lexsort((-self._residual[nodes], -self._spread[nodes]))
        self._spread[self._nodes] = 0
        some, load = nodes[order], self._patch.load
        factor = ContactFactor(InterfaceMatrix(*self._patch.patch, "float32"), some)
        law = far_field_law(0.0, 0.0, load)
        solved, sets = factor.solve(self._patch.below.reshape(-1)[some], law, most_sets)
        self.pressed.effort += Effort(iterations=sets)
        violation = np.inf
        for _ in range(RENEWALS):
            if not solved.any():
                raise np.linalg.LinAlgError
            solved *= load / float(solved.sum())
            self._nodes, self._values = nodes, np.empty(len(nodes))
            self._values[order] = solved
            self.renew()
            last, violation = violation, self.violation()
            accepted = rtol * self.pressed.shift / 2
            if violation <= accepted or not violation < last / 2:
                break
            residual = self._residual[some].astype(np.float64)
            if float(self._residual.max()) > max(accepted, float(residual.max()), OUTSIDE):
                break
            solved += factor.correct(residual, accepted, far_field_law(0.0, 0.0, 0.0))
            np.maximum(solved, 0, out=solved)

    def renew(self) -> None:
        """Recompute the residual in double precision."""
        pressed, patch = self.pressed, self._patch
        under = self._values > 0
        self._nodes, self._values = self._nodes[under], self._values[under]
        self._values *= patch.load / float(self._values.sum())
        pressed.residual, pressed.shift = patch.press_on(self._nodes, self._values)
        pressed.effort += CONVOLUTION
        self._residual = pressed.residual.reshape(-1)
        self._stepped, self.exact = False, True

    def _whole(self) -> Values:
        """Return the pressure on the whole patch."""
        whole: Values = np.zeros(self._patch.below.shape)
        whole.reshape(-1)[self._nodes] = self._values
        return whole

    def finish(self) -> None:
        """Put the pressure back on the whole patch."""
        self.pressed.pressure = self._whole()

    def energy(self) -> float:
        """Compute p H p / 2 - p u, which is least for the solution under the load."""
        depth = self._patch.below.reshape(-1)[self._nodes] + self._residual[self._nodes]
        return -inner(self._values, depth) / 2 + self.pressed.shift * self._patch.load / 2

    def open_stage(self) -> None:
        """Take the next contact set, unless the last stage has stepped ahead on it."""
        if not self._stepped:
            self._exchange(self._nodes[self._values > 0])
        self._weights = self._values.astype(np.float32)
        self._carried = float(self._weights.sum(dtype=np.float64))
        self._inside = self._residual[self._nodes]
        self._direction, self._change = (np.zeros_like(self._weights) for _ in range(2))

    def _exchange(self, kept: Nodes) -> None:
        """Keep some nodes of the contact set, and take in those without pressure that penetrate."""
        touching = self._residual > 0
        touching[self._nodes[self._values < 0]] = False
        touching[kept] = True
        spread, before = self._spread, self._nodes
        spread[before] = self._values
        self._nodes = touching.nonzero()[0]
        self._values = spread[self._nodes]
        spread[before] = 0
        self._correct = self._patch.preconditioner.restricted_to(self._nodes)

    def largest(self) -> float:
        """Return the largest residual in contact."""
        return max(float(self._inside.max()), -float(self._inside.min()))

    def has_to_change(self, small: float) -> bool:
        """Return whether tension has come up, or penetration outside that is not small."""
        if (self._weights + self._change).min() < 0:
            return True
        self._residual[self._nodes] = 0
        penetration = float(self._residual.max())
        self._residual[self._nodes] = self._inside
        return penetration > small

    def turn(self, previous: float) -> float:
        """Find the next direction; return the product of residual and correction."""
        correction = self._correct(self._inside)
        correction -= float(correction.sum()) / self._carried * self._weights
        product = inner(self._inside, correction)
        self._direction *= np.float32(product / previous)
        self._direction += correction
        return product

    def stiffness(self) -> float:
        """Compute the displacement by the direction; return the product of both."""
        self._image = self._displace((self._nodes, self._direction))
        self._moved = self._image[self._nodes]
        return inner(self._direction, self._moved)

    def _displace(self, *loads: tuple[Nodes, Real]) -> Real:
        """Compute the displacement of the whole patch by pressures on lists of nodes."""
        return displaced_by(self._patch.working, *loads).reshape(-1)

    def step(self, length: np.float32) -> None:
        """Take a step of a length along the direction, whose displacement is spoilt."""
        self._change += length * self._direction
        self._inside -= length * self._moved
        shift = -inner(self._weights, self._inside) / self._carried
        self._inside += np.float32(shift)
        self._move(length, shift)
        self._residual[self._nodes] = self._inside

    def _move(self, length: np.float32, shift: float) -> None:
        """Subtract a length times the image from the residual, and move the far field."""
        residual, image = self._residual, self._image

        def move(some: slice) -> None:
            here = image[some]
            here *= length
            here -= np.float32(shift)
            residual[some] -= here

        _run(move, residual.size)
        self.pressed.shift += shift

    def close_stage(self) -> None:
        """Add the change of the stage; cut off tension, and step ahead on the next contact set."""
        self._values = self._values + self._change
        self._stepped = bool(self._values.min() < 0)
        if self._stepped:
            self._cut_off_tension()

    def _cut_off_tension(self) -> None:
        """Set negative pressures to zero, step ahead on the next contact set, and keep the load."""
        before, values = self._nodes, self._values
        self._exchange(before[values > 0])
        pressure = np.maximum(self._values, 0)
        pressure += ADVANCE * self._correct(self._residual[self._nodes])
        np.maximum(pressure, 0, out=pressure)
        carried = float(pressure.sum())
        if not carried > 0:
            pressure, carried = np.ones_like(pressure), float(pressure.size)
        pressure *= self._patch.load / carried
        self._take_over(before, values, pressure)

    def _take_over(self, before: Nodes, values: Values, pressure: Values) -> None:
        """Replace the pressure on the last contact set by that on the present one."""
        self.exact = False
        spread, after = self._spread, self._nodes
        spread[before] = -values
        spread[after] += pressure
        self._image = self._displace((before, spread[before]), (after, spread[after]))
        spread[before] = spread[after] = 0
        self._values = pressure
        self.pressed.effort += CONVOLUTION
        moved = self._residual[after] - self._image[after]
        self._move(np.float32(1), -inner(pressure, moved) / self._patch.load)

    def approach_step(self) -> None:
        """Take a projected step of the approximate inverse."""
        before, values = self._nodes, self._values
        self._exchange(before[values > 0])
        pressure = self._values + APPROACH * self._correct(self._residual[self._nodes])
        self._take_over(before, values, cut_to_load(pressure, self._patch.load))
        self._stepped = False


def _run(run: Pass, size: int) -> None:
    """Run a pass over a field, on the threads of the solve if it is large."""
    if size < SHORT:
        run(slice(0, size))
    else:
        each(run, size)
