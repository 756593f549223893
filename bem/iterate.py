"""A pressure on its way to equilibrium: what it displaces, what it violates, and first steps.

The gap is w = H p - u - s, with the interference u and the displacement s of the far field; the
residual is -w. Energies, balances and bounds here serve the rounds of `bem.active_set`.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bem.arrays import Field, Mask, Real, Values
from bem.operators.patch import Patch

# Largest pressure of free nodes, over the hardness, after a step ahead: such steps overestimate,
# and conjugate gradients decide which nodes yield.
BELOW_HARDNESS = 0.9999

# Share of a step's load at the hardness from which a first step is damped instead of scaled.
MOSTLY_CAPPED = 0.9

# Share of a first pressure's load above the hardness up to which bodies count as elastic, and the
# violation, over the displacement, at which a pressure above the hardness will stay there.
MOSTLY_ELASTIC, CERTAIN = 0.02, 1e-2

# Violation, over the displacement, from which no further first step is taken, and the share of the
# last one below which another one follows: each costs a convolution, a stage about twice as much.
NEAR, NEARER, FIRST_STEPS = 5e-3, 0.7, 4

# Share of the preconditioned residual that a first step under a load adds: eigenvalues between 1
# and 2 then leave a third of an error at most.
APPROACH = 0.55

# Distance from zero or the hardness, over the hardness, at which a pressure of a start or of a
# splitting is taken to be there.
CLOSE = 1e-9

# Share of a load, or of the hardness, below which a difference counts as rounding.
LOST = 1e-11


class Effort(NamedTuple):
    """The work that a solve has taken; efforts add up.

    Attributes
    ----------
    iterations : int
        Steps of conjugate gradients, and sets of dense algebra.
    convolutions : int
        Applications of the influence matrix.
    """

    iterations: int = 0
    convolutions: int = 0

    def __add__(self, other: "Effort") -> "Effort":  # type: ignore[override]
        """Return the sum of both efforts."""
        return Effort(self.iterations + other.iterations, self.convolutions + other.convolutions)


class Violation(NamedTuple):
    """The largest departures from equilibrium [unit of displacement].

    Attributes
    ----------
    penetration : float
        Of nodes below the hardness.
    gap : float
        Of nodes under pressure below the hardness.
    opening : float
        Gap of nodes at the hardness, whose pressure ought to be lower.
    """

    penetration: float
    gap: float
    opening: float

    @property
    def largest(self) -> float:
        """The largest of the three departures."""
        return max(self)


class Iterate:
    """A pressure on all nodes of a grid on its way to equilibrium.

    Parameters
    ----------
    patch : Patch
        The influence matrix.
    below : ndarray, shape (nx, ny)
        Interference u at s = 0: heights less the highest [unit of displacement].
    shift : float or None
        Displacement s of the far field, None if the load is given.
    load : float or None
        Sum of the pressure, above 0, None if the displacement is given [reduced].
    hardness : float
        Largest pressure P, inf for elastic bodies [reduced].
    rtol : float
        Largest violation accepted, over the displacement s.
    most : int
        Bound on the iterations.
    least : float
        Displacement that the tolerance refers to while a load has brought none.
    give : float
        How far a compliant far field gives way under a unit load, 0 if it is rigid: one term of
        the matrix, H - give [unit of displacement / reduced load].

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure, between the bounds whenever a method returns.
    residual : ndarray of float32, shape (nx, ny)
        u + s - H p: zero in contact, negative where a gap is open.
    shift : float
        Displacement s of the far field.
    displacement : ndarray, shape (nx, ny), or None
        H p of the last exact residual.
    effort : Effort
        Work so far.
    exact : bool
        Whether the residual was computed in double precision from this pressure.
    stalled : bool
        Whether rounding leaves no step that would come nearer to equilibrium.
    """

    def __init__(
        self,
        patch: Patch,
        below: Field,
        *,
        shift: float | None = None,
        load: float | None = None,
        hardness: float = math.inf,
        rtol: float,
        most: int,
        least: float = 0.0,
        give: float = 0.0,
    ) -> None:
        self.patch, self.below, self.load, self.hardness = patch, below, load, hardness
        self.rtol, self.most, self._least, self._give = rtol, most, least, give
        self._yields = False  # bodies count as elastic until the hardness is certain to be exceeded
        self.pressure = np.zeros(below.shape)
        self.shift = 0.0 if shift is None else shift
        self.residual: Real = (below + self.shift).astype(np.float32)
        self.displacement: Field | None = None
        self.effort = Effort()
        self.exact, self.stalled = False, False
        self._tension = 0.0

    @property
    def _most_pressure(self) -> float:
        """Largest pressure allowed now."""
        return self.hardness if self._yields else math.inf

    @property
    def _soft(self) -> bool:
        """Whether a displacement barely fixes the load: on a compliant far field near Delta*, or
        without edges near full contact.
        """
        rigid = self._give == 0 and self.patch.boundary == "free"
        return self.load is None and not self._yields and not rigid

    # What there is

    @property
    def tolerance(self) -> float:
        """Largest violation accepted [unit of displacement]."""
        return self.rtol * (self.shift if self.shift > 0 else self._least)

    def exact_violation(self) -> Violation:
        """Measure the departures in double precision, after `renew`."""
        assert self.displacement is not None
        given_way = self._give * float(self.pressure.sum())
        return self._violation_of(self.below + (self.shift + given_way) - self.displacement)

    def violation(self) -> Violation:
        """Measure the departures from equilibrium."""
        return self._violation_of(self.residual)

    def _violation_of(self, residual: Real) -> Violation:
        """Measure the departures from equilibrium that a residual shows."""
        loaded = self.pressure > 0
        if not self._yields:
            gap = -float((residual * loaded).min())
            return Violation(max(float(residual.max()), 0.0), max(gap, 0.0), 0.0)
        yielded = self.pressure >= self.hardness
        gap = -float((residual * (loaded & ~yielded)).min())
        opening = -float((residual * yielded).min())
        penetration = float((residual * ~yielded).max())
        return Violation(max(penetration, 0.0), max(gap, 0.0), max(opening, 0.0))

    def worthless(self, farthest: float) -> bool:
        """Return whether no pressure at all is a better start than this one.

        Parameters
        ----------
        farthest : float
            Largest violation of a start that is better than none [unit of displacement].
        """
        work = inner(self.pressure, self.below + self.shift)
        return not (work > 0 and self.violation().largest <= farthest)

    def depth(self) -> float:
        """Return the largest penetration of a node at the hardness: the depth that it has
        yielded.
        """
        return max(float((self.residual * (self.pressure >= self.hardness)).max()), 0.0)

    def presumably_elastic(self) -> bool:
        """Return whether bodies may yield, and no node is certain to have yielded."""
        return self._yields and self.depth() <= self.tolerance

    def touching(self) -> Mask:
        """Return the nodes that are under pressure or would penetrate."""
        touching: Mask = (self.pressure > 0) | (self.residual > 0)
        return touching

    def _energy(self) -> float:
        """Compute p H p / 2 - p u, which is least for the solution."""
        carried = float(self.pressure.sum()) if self.load is None else -self.load
        return -inner(self.pressure, self.below + self.residual) / 2 - self.shift * carried / 2

    def _free_pressure(self) -> Field:
        """Return the pressure of the nodes below the hardness, and zero at the others."""
        if not self._yields:
            return self.pressure
        return np.where(self.pressure < self.hardness, self.pressure, 0.0)

    # Pressures and what they displace

    def _displace(self, change: Real, by: Callable[[Real], Real] | None = None) -> Real:
        """Compute a displacement to 1e-7; the next call overwrites it."""
        self.effort += Effort(convolutions=1)
        self.exact = False
        displaced = (by or self.patch.displace_roughly)(change)
        if self._give:
            displaced -= np.float32(self._give * float(change.sum(dtype=np.float64)))
        return displaced

    def begin(self, pressure: Field, displacement: Field | None = None) -> None:
        """Start from a pressure that is not negative, brought to the bounds and to the load.

        Parameters
        ----------
        pressure : ndarray, shape (nx, ny)
            Pressure.
        displacement : ndarray, shape (nx, ny), optional
            Displacement by it, nan where it is not known; it saves a convolution.
        """
        at_hardness = float(pressure.max()) >= self.hardness * (1 - CLOSE)
        if self._excess(pressure) > MOSTLY_ELASTIC or at_hardness:
            self._yields = True
        self.pressure = np.minimum(pressure, self._most_pressure)
        self._snap()
        carried = float(self.pressure.sum())
        self._carry(self.pressure)
        if displacement is None or self._yields or not np.isfinite(displacement).all():
            displacement = self._displace(self.pressure)
        elif self.load is not None:
            displacement = displacement * (self.load / carried)
        elif self._give:
            displacement = displacement - self._give * carried
        self.residual = (self.below - displacement).astype(np.float32)
        if self.load is None:
            self.residual += np.float32(self.shift)
        else:
            self.shift = 0.0
            self._balance()

    def _excess(self, pressure: Real) -> float:
        """Return the share of a pressure's load that exceeds the hardness [1]."""
        if self.hardness == math.inf:
            return 0.0
        carried = float(pressure.sum())
        over = float(np.maximum(pressure - self.hardness, 0).sum())
        return over / carried if carried > 0 else 0.0

    def _exceeds(self) -> bool:
        """Return whether bodies that counted as elastic exceed the hardness."""
        return not self._yields and float(self.pressure.max()) > self.hardness

    def _correction(self) -> Field:
        """Return the preconditioned residual on the set that was taken last, zero elsewhere."""
        correction = np.zeros_like(self.residual)
        self.patch.spread(self.patch.correct(self.patch.in_contact(self.residual)), correction)
        return correction

    def expect_yielding(self) -> None:
        """Let bodies yield from the start, whatever their first pressures are."""
        self._yields = True

    def _let_yield(self) -> None:
        """Take pressures to the hardness, and let bodies yield from now on."""
        self._yields = True
        before, self.pressure = self.pressure, np.minimum(self.pressure, self.hardness)
        self._carry(self.pressure)
        self.residual = self.residual - self._displace(self.pressure - before)
        self._balance()

    def renew(self) -> None:
        """Bring the pressure to the load, and compute the residual in double precision."""
        self._carry(self.pressure)
        self._snap()
        self.displacement = self.patch.displace(self.pressure).copy()
        self.effort += Effort(convolutions=1)
        gaps = self.below - self.displacement
        if self._give:
            gaps += self._give * float(self.pressure.sum())
        if self.load is not None:
            self.shift = -self._imbalance(gaps)
        self.residual = (gaps + self.shift).astype(np.float32)
        self.exact = True

    def _level(self, mean: float) -> None:
        """Shift the far field by a mean of the residual, which is zero from then."""
        self.residual -= np.float32(mean)
        self.shift -= mean

    def _balance(self) -> None:
        """Shift the far field under a load so that the free nodes are in balance."""
        if self.load is not None:
            self._level(self._imbalance(self.residual))

    def _imbalance(self, residual: Real) -> float:
        """Return the mean of a residual that a shift of the far field takes away under a load.

        It is weighted by the pressure of the free nodes. Where all nodes in contact have yielded,
        more than one displacement is in balance, and the least one that leaves no gap there is
        taken; unless nodes outside would penetrate, which then have to exchange load with them.
        """
        weights = self._free_pressure()
        carried = float(weights.sum())
        if carried > 0:
            return inner(weights, residual) / carried
        loaded = self.pressure > 0
        inside = float(residual.min(where=loaded, initial=math.inf))
        outside = float(residual.max(where=~loaded, initial=-math.inf))
        return inside if outside <= inside else (inside + outside) / 2

    def _carry(self, pressure: Field) -> None:
        """Scale a pressure in place so that it carries the load, between the bounds."""
        if self.load is None:
            return
        carried = float(pressure.sum())
        if not carried > 0:
            pressure[:] = self.load / pressure.size
        elif not self._yields:
            pressure *= self.load / carried
        else:
            self._carry_within(pressure)

    def _carry_within(self, pressure: Field) -> None:
        """Scale the free pressures; all of them where the yielded nodes alone carry too much."""
        assert self.load is not None
        limit, flat = BELOW_HARDNESS * self.hardness, pressure.reshape(-1)
        loaded = np.flatnonzero(flat)
        values = flat[loaded]
        for _ in range(6):  # each time more nodes are at the limit
            yielded = values >= self.hardness
            fixed = self.hardness * np.count_nonzero(yielded)
            before = values[~yielded]
            free = float(before.sum())
            left = self.load - fixed
            if left < 0:
                order = np.argsort(self.residual.reshape(-1)[loaded], kind="stable")
                over, taken = fixed + free - self.load, values[order]
                values[order] -= np.minimum(taken, np.maximum(over - (np.cumsum(taken) - taken), 0))
                flat[loaded] = values
                return
            if not free > 0:
                break
            scaled = before * (left / free)
            values[~yielded] = np.minimum(scaled, np.maximum(before, limit))
            if not (scaled > np.maximum(before, limit)).any():
                flat[loaded] = values
                return
        flat[loaded] = values
        missing = self.load - float(values.sum())
        if missing > LOST * self.load:
            self._load_next(flat, missing)

    def _load_next(self, pressure: Values, missing: float) -> None:
        """Put load that is missing on the nodes next to touch, as far as the hardness allows."""
        below = np.flatnonzero(pressure < self.hardness)
        gaps = -self.residual.reshape(-1)[below]
        most = math.ceil(missing / self.hardness) + int(np.count_nonzero(pressure[below]))
        if most < below.size:
            below = below[np.argpartition(gaps, most)[: most + 1]]
            gaps = -self.residual.reshape(-1)[below]
        order = below[np.argsort(gaps, kind="stable")]
        room = self.hardness - pressure[order]
        pressure[order] += np.minimum(room, np.maximum(missing - (np.cumsum(room) - room), 0))

    def _rescale(self) -> None:
        """Scale an elastic pressure at a given displacement to the least energy.

        Cutting off tension leaves too much load, which shifts the residual of the whole contact.
        The displacement by the pressure is known, so that scaling it costs no convolution.
        """
        if self.load is not None:
            return
        interference = self.below + self.shift
        stiffness = inner(self.pressure, interference - self.residual)
        work = inner(self.pressure, interference)
        if not (stiffness > 0 and work > 0):
            return
        factor = work / stiffness
        self.pressure = factor * self.pressure
        self.residual = (interference * (1 - factor) + factor * self.residual).astype(np.float32)

    def _snap(self, share: float = LOST) -> None:
        """Take pressures that rounding left just beside zero or the hardness to it."""
        if self._yields:
            self.pressure[self.pressure < share * self.hardness] = 0
            self.pressure[self.pressure > (1 - share) * self.hardness] = self.hardness

    # First steps

    def take_first_steps(self, enough: float = 0.0) -> None:
        """Take preconditioned steps between the bounds, from no pressure at a given displacement.

        They find most of the nodes out of contact for one convolution a step. None is taken once
        the contact set is as small as `enough`.
        """
        interference = (self.below + self.shift).astype(np.float32)
        for step in range(FIRST_STEPS):
            touching = self.touching()
            if np.count_nonzero(touching) <= enough:
                return
            free = touching & (self.pressure < self._most_pressure)
            self.patch.take_contact(free)
            pressure = np.maximum(self.pressure + self._correction(), 0)
            if step == 0 and self._excess(pressure) > MOSTLY_ELASTIC:
                self._yields = True
            limit = self._most_pressure
            np.minimum(pressure, limit, out=pressure)
            capped = pressure >= limit
            damped = float(pressure[capped].sum()) > MOSTLY_CAPPED * float(pressure.sum())
            change = pressure - self.pressure if damped else pressure
            image = self._displace(change)
            stiffness = inner(change, image)
            if not stiffness > 0:
                return
            if damped:
                scale = min(max(inner(self.residual, change) / stiffness, 0.0), 1.0)
                self.residual = self.residual - np.float32(scale) * image
                self.pressure = self.pressure + scale * change
            else:
                scale = inner(interference, pressure) / stiffness
                if not scale > 0:
                    return
                if capped.any():
                    scale = 1.0 if step == FIRST_STEPS - 1 else min(max(scale, 0.8), 1.0)
                self.residual = interference - np.float32(scale) * image
                self.pressure = scale * pressure
        self._cap()

    def _cap(self) -> None:
        """Take pressures above the hardness, or above it but for rounding, to it."""
        if not self._yields:
            return
        close = self.pressure > self.hardness * (1 - LOST)
        before = self.pressure.copy()
        self.pressure[close] = self.hardness
        if (self.pressure < before).any():
            self.residual -= self._displace(self.pressure - before)

    def approach(self, enough: float = 0.0) -> None:
        """Take preconditioned steps between the bounds under a load, while they come nearer fast.

        None is taken once the contact set is as small as `enough`.
        """
        largest = self.violation().largest
        for _ in range(FIRST_STEPS):
            if largest <= NEAR * self.shift or np.count_nonzero(self.touching()) <= enough:
                return
            last, before = largest, self.pressure
            self.patch.take_contact(self.touching() & (before < self._most_pressure))
            ahead = before + np.float32(APPROACH) * self._correction()
            ahead = np.clip(ahead, 0, self._most_pressure)
            self._carry(ahead)
            self.pressure = ahead
            self.residual -= self._displace(ahead - before)
            self._balance()
            largest = self.violation().largest
            if not largest < NEARER * last:
                return


def cut_to_load(pressure: Field, load: float, hardness: float = math.inf) -> Field:
    """Return p - c between zero and the hardness with the constant c that leaves a load.

    The load falls with c along straight lines between the pressures, and those less the hardness.
    """
    values = np.sort(pressure, axis=None)[::-1]
    sums = np.cumsum(values)
    # With c at the k-th largest pressure and no hardness, the larger ones carry this load.
    carried = sums - values * np.arange(1, values.size + 1)
    many = int(np.searchsorted(carried, load, side="right"))
    low = (float(sums[many - 1]) - load) / many
    if hardness < math.inf:
        low, high = float(values[-1]) - hardness, low
        for _ in range(60):
            middle = (low + high) / 2
            if not low < middle < high:
                break
            if np.clip(pressure - middle, 0, hardness).sum() > load:
                low = middle
            else:
                high = middle
    return np.clip(pressure - low, 0, hardness)


def inner(a: Real, b: Real) -> float:
    """Compute an inner product of fields without BLAS, row by row, then in double precision."""
    if a.ndim == 1:
        return float((a * b).sum(dtype=np.float64))
    return float(np.einsum("ij,ij->i", a, b).sum(dtype=np.float64))
