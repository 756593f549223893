"""Elastic contact of a patch without edges under a load: an active set on whole fields.

The method is that of `bem.active_set`. Here all nodes may touch, so that sets are masks: no field
is gathered or scattered, as lists of nodes would need it. Search directions and residuals are in
single precision; they refine a pressure in double precision.
"""

from dataclasses import dataclass

import numpy as np

from bem.active_set import IDLE_RENEWALS, PATIENCE, ROUNDING, TIGHTENING
from bem.arrays import Field, Real
from bem.convolution import kept_filter
from bem.interface import make_means
from bem.iterate import CONVOLUTION, ITERATION, Effort
from bem.preconditioner import BLOCK, VACANT, block_sums, whole_blocks
from bem.spacing import Boundary
from bem.spectrum import inverse_filter, spectral_filter

# Share of nodes under pressure after the first projected step from which a second gains nothing.
LARGE_CONTACT = 0.35

# Shares of the tolerance at which the far field is in balance, and that conjugate gradients reach.
BALANCED, REACHED = 0.9, 0.55

# Factor by which conjugate gradients reduce the residual before the contact set is checked.
REDUCTION = 0.45

# Share of the preconditioned residual that is added when tension is cut off. Reductions from 0.15
# to 0.45 and shares from 0.6 to 1 take nearly the same number of convolutions.
ADVANCE = 0.85


@dataclass
class Pressed:
    """A pressure on the whole patch that carries a load, on its way to equilibrium.

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure [reduced].
    residual : ndarray, shape (nx, ny)
        Penetration, negative where a gap is open.
    shift : float
        Displacement of the far field.
    effort : Effort
        Work so far.
    """

    pressure: Field
    residual: Real
    shift: float
    effort: Effort

    def violation(self) -> float:
        """Return the largest penetration, or gap under pressure."""
        gap = -float((self.residual * (self.pressure > 0)).min())
        return max(float(self.residual.max()), gap, 0.0)


class WholePatch:
    """The influence matrix of a patch without edges under a load, for whole fields.

    Parameters
    ----------
    below : ndarray, shape (nx, ny)
        Heights less the highest [unit of displacement].
    boundary : str
        "periodic" or "mirror".
    aspect : float
        Second side of a cell over its first [1].
    load : float
        Sum of the pressure, above 0 [reduced].

    Attributes
    ----------
    displacement : ndarray, shape (nx, ny), or None
        Displacement under the last pressure whose residual is exact.
    """

    def __init__(self, below: Field, boundary: Boundary, aspect: float, load: float) -> None:
        shape: tuple[int, int] = below.shape[0], below.shape[1]
        patch = whole_blocks(shape[0]), whole_blocks(shape[1])
        self.below, self.load = below, load
        self.displacement: Field | None = None
        self._patch = shape, boundary, aspect
        self._double = spectral_filter(shape, boundary, aspect)
        self._working = spectral_filter(shape, boundary, aspect, "float32")
        self._inverse = inverse_filter(patch, boundary, aspect, "float32")
        self._means = kept_filter(make_means, patch, boundary, aspect)
        self._grid = slice(0, shape[0]), slice(0, shape[1])

    def press(self, pressure: Field, effort: Effort) -> Pressed:
        """Scale a pressure to the load, and compute its residual in double precision."""
        pressure = pressure * (self.load / float(pressure.sum()))
        self.displacement = self._double(pressure)
        return self._pressed(pressure, self.displacement, effort + CONVOLUTION)

    def _pressed(self, pressure: Field, displacement: Real, effort: Effort) -> Pressed:
        """Return a pressure and its residual, which is rounded once the far field is in balance."""
        pressed = Pressed(pressure, self.below - displacement, 0.0, effort)
        self.level(pressed, pressure)
        pressed.residual = pressed.residual.astype(np.float32)
        return pressed

    def start(self) -> Pressed:
        """Take projected steps from the pressure of full contact.

        The projection subtracts a constant before it cuts off tension, so that the rest carries the
        load: under a small load only the highest pressures stay.

        Returns
        -------
        Pressed
            The solution if the contact is full.
        """
        pressure = inverse_filter(*self._patch)(self.below)
        pressure += self.load / pressure.size
        if pressure.min() >= 0:
            flat = np.zeros(pressure.shape, np.float32)
            self.displacement = self.below - self.below.mean()
            return Pressed(pressure, flat, -float(self.below.mean()), CONVOLUTION)
        effort = CONVOLUTION
        for step in range(2):
            pressure = cut_to_load(pressure, self.load)
            effort += CONVOLUTION
            pressed = self._pressed(pressure, self.displace(pressure), effort)
            if step or np.count_nonzero(pressure) > LARGE_CONTACT * pressure.size:
                break
            touching = (pressure > 0) | (pressed.residual > 0)
            self.set_contact(touching.astype(np.float32))
            pressure = pressure + self.correct(pressed.residual)
        return pressed

    def displace(self, pressure: Real) -> Real:
        """Compute a displacement in single precision; the next call spoils it."""
        self._working.field[:] = pressure
        self._working.transform()
        displacement: Real = self._working.field
        return displacement

    def level(self, pressed: Pressed, weights: Real) -> None:
        """Shift the far field so that the weighted mean of the residual is zero."""
        mean = total(weights, pressed.residual) / float(weights.sum(dtype=np.float64))
        pressed.residual -= mean
        pressed.shift -= mean

    def set_contact(self, contact: Real) -> None:
        """Take a contact set, one in contact and zero elsewhere, for `correct`."""
        self._contact = contact
        self._outside = np.ones(self._inverse.field.shape, np.float32)
        self._outside[self._grid] -= contact
        self._means.field[:] = BLOCK**2 - block_sums(self._outside)
        self._means.transform()
        self._weights = 1 / (self._means.field + np.float32(VACANT))

    def correct(self, residual: Real) -> Real:
        """Apply the approximate inverse of `bem.preconditioner` on the contact set."""
        field, means = self._inverse.field, self._means
        field.fill(0)
        np.multiply(residual, self._contact, out=field[self._grid])
        means.field[:] = block_sums(field)
        means.transform()
        _rows(field)[:] += _rows(self._outside) * _columns(self._weights * means.field)
        self._inverse.transform()
        np.multiply(self._weights, block_sums(field * self._outside), out=means.field)
        means.transform()
        _rows(field)[:] += _columns(means.field)
        correction: Real = field[self._grid] * self._contact
        return correction


def _rows(field: Real) -> Real:
    """View rows of a field by blocks, (nx / BLOCK, BLOCK, ny)."""
    return field.reshape(-1, BLOCK, field.shape[1])


def _columns(blocks: Real) -> Real:
    """Repeat the values of blocks along their columns, for `_rows`."""
    repeated: Real = np.repeat(blocks, BLOCK, axis=1)[:, np.newaxis]
    return repeated


def cut_to_load(pressure: Field, load: float) -> Field:
    """Return max(p - c, 0) with the constant c that leaves a load."""
    above = pressure.reshape(-1)
    constant = (float(above.sum()) - load) / above.size
    for _ in range(50):  # each time from fewer nodes, so that the constant only rises
        left = above[above > constant]
        if len(left) in {0, len(above)}:  # none, where the load is lost to rounding
            break
        above = left
        constant = (float(above.sum()) - load) / len(above)
    cut: Field = np.maximum(pressure - constant, 0)
    if not cut.any():
        cut.reshape(-1)[np.argmax(pressure)] = load
    cut *= load / float(cut.sum())
    return cut


def total(a: Real, b: Real) -> float:
    """Compute an inner product of fields, summed in double precision."""
    return float((a * b).sum(dtype=np.float64))


def press_under_load(
    patch: WholePatch, pressed: Pressed, *, rtol: float, least: float, max_iterations: int
) -> bool:
    """Solve for the elastic contact under a load.

    Parameters
    ----------
    patch : WholePatch
        The influence matrix.
    pressed : Pressed
        A start, improved in place until its exact residual meets the tolerance.
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
    exact, renewed, smallest_renewed, idle = False, np.inf, np.inf, 0
    smallest, patience = np.inf, PATIENCE
    reduction, energy = REDUCTION, np.inf
    following: Real | None = None
    violation = pressed.violation()
    while True:
        wanted = rtol * (pressed.shift if pressed.shift > 0 else least)
        floor = max(BALANCED * wanted, ROUNDING * min(renewed, 1.0))
        ended = patience == 0 or pressed.effort.iterations >= max_iterations
        if violation <= floor or ended:
            if exact:
                return violation <= rtol * pressed.shift
            _renew(patch, pressed)
            exact, violation = True, pressed.violation()
            renewed = violation
            if renewed <= rtol * pressed.shift:
                return True
            idle = 0 if renewed < smallest_renewed / 2 else idle + 1
            smallest_renewed = min(smallest_renewed, renewed)
            if idle >= IDLE_RENEWALS or ended:
                return False
            smallest, patience = np.inf, PATIENCE
            continue
        contact = following
        if contact is None:
            contact = ((pressed.pressure > 0) | (pressed.residual > 0)).astype(np.float32)
            patch.set_contact(contact)
        exact = False
        _run_stage(patch, pressed, contact, (reduction, REACHED * floor), max_iterations)
        following = _cut_off_tension(patch, pressed, contact)
        last, energy = energy, _energy(patch, pressed)
        reduction *= TIGHTENING if energy > last else 1.0
        violation = pressed.violation()
        patience = PATIENCE if violation < smallest else patience - 1
        smallest = min(smallest, violation)


def _renew(patch: WholePatch, pressed: Pressed) -> None:
    """Recompute the residual in double precision."""
    fresh = patch.press(pressed.pressure, pressed.effort)
    pressed.pressure, pressed.shift, pressed.effort = fresh.pressure, fresh.shift, fresh.effort
    pressed.residual = fresh.residual


def _energy(patch: WholePatch, pressed: Pressed) -> float:
    """Compute p H p / 2 - p u, which is least for the solution under the load."""
    plain = -total(pressed.pressure, patch.below + pressed.residual) / 2
    return plain + pressed.shift * patch.load / 2


def _run_stage(
    patch: WholePatch,
    pressed: Pressed,
    contact: Real,
    goals: tuple[float, float],
    max_iterations: int,
) -> None:
    """Run conjugate gradients in contact until the set has to change, as `bem.gradients` does."""
    weights = pressed.pressure.astype(np.float32)
    carried = float(weights.sum(dtype=np.float64))
    residual = pressed.residual
    direction, change = np.zeros_like(weights), np.zeros_like(weights)
    previous, goal = np.inf, 0.0
    while pressed.effort.iterations < max_iterations:
        here = residual * contact
        largest = max(float(here.max()), -float(here.min()))
        if largest <= goals[1]:
            break
        goal = goal or goals[0] * largest
        if largest <= goal:
            if (weights + change).min() < 0 or float((residual - here).max()) > goals[1]:
                break
            goal = max(goals[0] * goal, goals[1])
        correction = patch.correct(here)
        correction -= np.float32(float(correction.sum(dtype=np.float64)) / carried) * weights
        product = total(here, correction)
        direction *= np.float32(product / previous)
        direction += correction
        previous = product
        image = patch.displace(direction)
        stiffness = total(direction, image)
        pressed.effort += CONVOLUTION
        if not (product > 0 and stiffness > 0):  # only rounding is left
            break
        step = np.float32(product / stiffness)
        image *= step
        residual -= image
        change += step * direction
        pressed.effort += ITERATION
        patch.level(pressed, weights)
    pressed.pressure += change


def _cut_off_tension(patch: WholePatch, pressed: Pressed, contact: Real) -> Real | None:
    """Set negative pressures to zero, step ahead on the next contact set, and keep the load."""
    tension = pressed.pressure < 0
    if not tension.any():
        return None
    before = pressed.pressure
    pressure = np.where(tension, 0.0, before)
    touching = (pressure > 0) | ((pressed.residual > 0) & (before == 0))
    following: Real = touching.astype(np.float32)
    patch.set_contact(following)
    pressure += np.float32(ADVANCE) * patch.correct(pressed.residual)
    np.maximum(pressure, 0, out=pressure)
    carried = float(pressure.sum())
    if not carried > 0:
        pressure, carried = np.ones_like(pressure), float(pressure.size)
    pressed.pressure = pressure * (patch.load / carried)
    pressed.residual -= patch.displace(pressed.pressure - before)
    pressed.effort += CONVOLUTION
    patch.level(pressed, pressed.pressure)
    return following
