"""Elastic contact of a patch without edges under a load: an active set on whole fields.

The method is that of `bem.active_set`. Here all nodes may touch, so that sets are masks: no field
is gathered or scattered, as lists of nodes would need it. Search directions and residuals are in
single precision; they refine a pressure in double precision.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Protocol

import numpy as np

from bem.active_set import IDLE_RENEWALS, PATIENCE, ROUNDING, TIGHTENING
from bem.arrays import Field, Mask, Nodes, Real, Values
from bem.convolution import FieldFilter, kept_filter
from bem.interface import make_means
from bem.iterate import CONVOLUTION, ITERATION, Effort, inner
from bem.preconditioner import BLOCK, VACANT, Preconditioner, block_sums, whole_blocks
from bem.spacing import Boundary
from bem.spectrum import inverse_filter, spectral_filter
from bem.vectors import clear, each_row

# Share of the preconditioned residual that a projected step adds: eigenvalues between 1 and 2 then
# leave a third of an error at most.
APPROACH = 2 / 3

# Projected steps at most before conjugate gradients, the share of a violation below which another
# one follows, and the violation, over the displacement, from which none is taken.
APPROACH_STEPS, NEARER, NEAR = 4, 0.7, 5e-3

# Values from which the constant of `cut_to_load` is guessed first.
SAMPLE = 1024

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
        found: list[float] = []

        def measure(some: slice) -> None:
            residual = self.residual[some]
            gap = -float((residual * (self.pressure[some] > 0)).min())
            found.append(max(float(residual.max()), gap))

        each_row(measure, *self.residual.shape)
        return max(float(np.max(found)), 0.0)


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
    keep_displacement : bool
        Whether the displacement under an exact residual is wanted too.

    Attributes
    ----------
    patch : tuple
        Shape (nx, ny), boundary and aspect.
    displacement : ndarray, shape (nx, ny), or None
        Displacement under the last pressure whose residual is exact, if it is wanted.
    working : FieldFilter
        The influence matrix in single precision.
    outside : ndarray, shape (nx, ny)
        Zero on the contact set and one elsewhere.
    """

    def __init__(
        self,
        below: Field,
        boundary: Boundary,
        aspect: float,
        load: float,
        *,
        keep_displacement: bool = False,
    ) -> None:
        shape: tuple[int, int] = below.shape[0], below.shape[1]
        patch = whole_blocks(shape[0]), whole_blocks(shape[1])
        self.below, self.load = below, load
        self.displacement: Field | None = None
        self._keep_displacement = keep_displacement
        self.patch = shape, boundary, aspect
        self._double = spectral_filter(shape, boundary, aspect)
        self.working = spectral_filter(shape, boundary, aspect, "float32")
        self._inverse = inverse_filter(patch, boundary, aspect, "float32")
        self._means = kept_filter(make_means, patch, boundary, aspect)
        self._grid = slice(0, shape[0]), slice(0, shape[1])
        self._correction = np.zeros(patch, np.float32)
        self._contact = np.zeros(patch, np.float32)
        self._outside = np.ones(patch, np.float32)
        self.outside = self._outside[self._grid]

    @cached_property
    def preconditioner(self) -> Preconditioner:
        """The approximate inverse for contact sets that are lists of nodes."""
        return Preconditioner(self.patch[0], None, self._inverse, self._means)

    def press(self, pressure: Field, effort: Effort) -> Pressed:
        """Scale a pressure to the load, and compute its residual in double precision."""
        pressure = pressure * (self.load / float(pressure.sum()))
        displacement = self._double(pressure)
        self.displacement = displacement if self._keep_displacement else None
        return self._pressed(pressure, displacement, effort + CONVOLUTION)

    def press_on(self, nodes: Nodes, values: Values) -> tuple[Real, float]:
        """Compute the residual by a pressure on some nodes in double precision.

        Parameters
        ----------
        nodes : ndarray, shape (a,)
            Flat indices of the nodes.
        values : ndarray, shape (a,)
            Pressure on them, which carries the load.

        Returns
        -------
        residual : ndarray, shape (nx, ny)
            Residual once the far field is in balance, in single precision.
        shift : float
            Displacement of the far field.
        """
        displacement = displaced_by(self._double, (nodes, values))
        if self._keep_displacement:
            self.displacement = displacement.copy()
        return self._balanced(displacement, nodes, values)

    def _balanced(self, displacement: Real, nodes: Nodes, values: Values) -> tuple[Real, float]:
        """Return the residual once the far field is in balance with a pressure on some nodes."""
        here = self.below.reshape(-1)[nodes] - displacement.reshape(-1)[nodes]
        shift = -inner(values, here) / float(values.sum())
        residual = np.empty(self.below.shape, np.float32)

        def subtract(some: slice) -> None:
            rows = self.below[some] - displacement[some]
            np.add(rows, shift, out=residual[some], casting="same_kind")

        each_row(subtract, *residual.shape)
        return residual, shift

    def _pressed(self, pressure: Field, displacement: Real, effort: Effort) -> Pressed:
        """Return a pressure and its residual, which is rounded once the far field is in balance."""
        pressed = Pressed(pressure, self.below - displacement, 0.0, effort)
        self.level(pressed, pressure)
        pressed.residual = pressed.residual.astype(np.float32)
        return pressed

    def full_contact(self) -> Field:
        """Compute the pressure that closes all gaps, which is negative where it has to pull."""
        pressure = inverse_filter(*self.patch)(self.below)
        pressure += self.load / pressure.size
        return pressure

    def closed(self, pressure: Field) -> Pressed:
        """Return the pressure of full contact as the solution that it is where it pushes."""
        flat = np.zeros(pressure.shape, np.float32)
        self.displacement = self.below - self.below.mean()
        return Pressed(pressure, flat, -float(self.below.mean()), CONVOLUTION)

    def begin(self, pressure: Field, effort: Effort) -> Pressed:
        """Scale a pressure to the load, and compute its residual in single precision."""
        return self._loaded(pressure * (self.load / float(pressure.sum())), effort)

    def start(self, pressure: Field) -> Pressed:
        """Project the pressure of full contact onto pressures that carry the load.

        The projection subtracts a constant before it cuts off tension: under a small load only the
        highest pressures stay.
        """
        return self._loaded(cut_to_load(pressure, self.load), CONVOLUTION)

    def _loaded(self, pressure: Field, effort: Effort) -> Pressed:
        """Compute the residual of a pressure that carries the load in single precision."""
        nodes: Nodes = (pressure > 0).reshape(-1).nonzero()[0]
        values = pressure.reshape(-1)[nodes]
        displacement = displaced_by(self.working, (nodes, values))
        residual, shift = self._balanced(displacement, nodes, values)
        return Pressed(pressure, residual, shift, effort + CONVOLUTION)

    def displace(self, pressure: Real, less: Real | None = None) -> Real:
        """Compute a displacement in single precision; the next call spoils it.

        Parameters
        ----------
        pressure : ndarray, shape (nx, ny)
            Pressure.
        less : ndarray, shape (nx, ny), optional
            Pressure to subtract before.
        """
        field: Real = self.working.field

        def load(some: slice) -> None:
            field[some] = pressure[some] if less is None else pressure[some] - less[some]

        each_row(load, *field.shape)
        self.working.transform()
        return field

    def level(self, pressed: Pressed, weights: Real) -> None:
        """Shift the far field so that the weighted mean of the residual is zero."""
        shift_by(pressed, -total(weights, pressed.residual) / load_of(weights))

    def set_contact(self, touching: Callable[[slice], Mask]) -> None:
        """Take a contact set for `inside` and `correct`, as a test of rows of the grid."""
        contact, outside, (rows, columns) = self._contact, self._outside, self.below.shape

        def mark(some: slice) -> None:
            contact[some, :columns] = touching(some)
            np.subtract(1, contact[some], out=outside[some])

        each_row(mark, rows, columns)
        self._means.field[:] = BLOCK**2 - block_sums(outside)
        self._means.transform()
        self._weights = 1 / (self._means.field + np.float32(VACANT))

    def inside(self, residual: Real) -> float:
        """Keep the residual in contact for `correct`, and return its largest magnitude."""
        field, (rows, columns) = self._inverse.field, residual.shape
        field[rows:], field[:, columns:] = 0, 0
        found: list[float] = []

        def keep(some: slice) -> None:
            here = field[some, :columns]
            np.multiply(residual[some], self._contact[some, :columns], out=here)
            found.append(max(float(here.max()), -float(here.min())))

        each_row(keep, rows, columns)
        return float(np.max(found))

    def correct(self) -> Real:
        """Apply the approximate inverse of `bem.preconditioner` to the residual in contact.

        Returns
        -------
        ndarray, shape (nx, ny)
            Correction of the pressure, which the next call overwrites.
        """
        field, means = self._inverse.field, self._means
        blocks, outside, contact, corrections = (
            array.reshape(-1, BLOCK, field.shape[1])
            for array in (field, self._outside, self._contact, self._correction)
        )
        means.field[:] = block_sums(field)
        means.transform()
        np.multiply(means.field, self._weights, out=means.field)

        def extend(some: slice) -> None:
            blocks[some] += outside[some] * _columns(means.field[some])

        def finish(some: slice) -> None:
            np.add(blocks[some], _columns(means.field[some]), out=corrections[some])
            corrections[some] *= contact[some]

        each_row(extend, len(blocks), BLOCK * field.shape[1])
        self._inverse.transform()
        np.multiply(self._weights, block_sums(field, self._outside), out=means.field)
        means.transform()
        each_row(finish, len(blocks), BLOCK * field.shape[1])
        return self._correction[self._grid]


def _columns(blocks: Real) -> Real:
    """Repeat the values of blocks along their columns, for rows of blocks."""
    repeated: Real = np.repeat(blocks, BLOCK, axis=1)[:, np.newaxis]
    return repeated


def displaced_by(operator: FieldFilter, *loads: tuple[Nodes, Real]) -> Real:
    """Compute the displacement of a whole patch by pressures on lists of nodes.

    Parameters
    ----------
    operator : FieldFilter
        The influence matrix, whose field is as large as the patch.
    *loads : tuple of ndarray, shape (a,)
        Flat indices of nodes and the pressure on them; later lists take precedence.

    Returns
    -------
    ndarray, shape (nx, ny)
        Displacement, which the next use of the operator overwrites.
    """
    field = operator.field.reshape(-1)
    clear(field)
    for nodes, values in loads:
        field[nodes] = values
    operator.transform()
    return operator.field


def cut_to_load(pressure: Field, load: float) -> Field:
    """Return max(p - c, 0) with the constant c that leaves a load."""
    values = pressure.reshape(-1)
    constant = _bound(values, load)
    if values.size >= 8 * SAMPLE:
        some = values[:: values.size // SAMPLE]
        share = load * some.size / values.size
        high = values[values > _constant(some, share, _bound(some, share))]
        constant = max(constant, _bound(high, load))
    cut: Field = pressure - _constant(values, load, constant)
    np.maximum(cut, 0, out=cut)
    carried = float(cut.sum())
    if not carried > 0:
        cut.reshape(-1)[np.argmax(pressure)] = carried = load
    cut *= load / carried
    return cut


def _bound(values: Values, load: float) -> float:
    """Return the constant that leaves a load on all of these; that of `cut_to_load` is no lower."""
    return (float(values.sum()) - load) / values.size if values.size else -math.inf


def _constant(values: Values, load: float, bound: float) -> float:
    """Find the constant c with which max(p - c, 0) carries a load, from a bound below it."""
    above, constant = values, bound
    for _ in range(50):  # each time from fewer nodes, so that the constant only rises
        left = above[above > constant]
        if len(left) in {0, len(above)}:  # none, where the load is lost to rounding
            break
        above = left
        constant = _bound(above, load)
    return constant


def touching_nodes(pressed: Pressed) -> int:
    """Count the nodes that are under pressure or would penetrate."""
    return int(np.count_nonzero(_touching(pressed, slice(None))))


def _touching(pressed: Pressed, some: slice) -> Mask:
    """Return which nodes of some rows are under pressure or would penetrate."""
    touching: Mask = (pressed.pressure[some] > 0) | (pressed.residual[some] > 0)
    return touching


def total(a: Real, b: Real) -> float:
    """Compute an inner product of fields, row by row in their precision, then in double."""
    sums = np.empty(len(a))

    def add_up(some: slice) -> None:
        sums[some] = np.einsum("ij,ij->i", a[some], b[some])

    each_row(add_up, *a.shape)
    return float(sums.sum())


def load_of(field: Real) -> float:
    """Add up a field, row by row in its precision, then in double."""
    sums = np.empty(len(field))

    def add_up(some: slice) -> None:
        sums[some] = field[some].sum(axis=1)

    each_row(add_up, *field.shape)
    return float(sums.sum())


def shift_by(pressed: Pressed, shift: float) -> None:
    """Move the far field."""
    residual = pressed.residual

    def move(some: slice) -> None:
        residual[some] += shift

    each_row(move, *residual.shape)
    pressed.shift += shift


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
    """

    def __init__(self, patch: WholePatch, pressed: Pressed) -> None:
        self._patch, self.pressed = patch, pressed
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
        self._cut_off_tension(APPROACH)
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
            self._patch.set_contact(partial(_touching, self.pressed))
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
        patch.level(self.pressed, pressure)
