"""A pressure on its way to equilibrium: what it displaces, what it violates, and first steps.

The gap is w = H p - u - s, with the interference u and the displacement s of the far field; the
residual is -w. Energies, balances and bounds here serve the rounds of `bem.active_set`.
"""

import math
from typing import NamedTuple

import numpy as np

from bem.arrays import Field, Mask, Real
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
NEAR, NEARER, FIRST_STEPS, INTERPOLATED_STEPS = 5e-3, 0.8, 4, 3

# Shares of the preconditioned residual that a first step under a load adds, on a free patch, and on
# one without edges for a small contact and for a full one: they take the fewest convolutions.
APPROACH_FREE, APPROACH_SMALL, APPROACH_FULL = 0.55, 0.6, 0.8

# Distance from zero or the hardness, over the hardness, at which a pressure of a start or of a
# splitting is taken to be there.
CLOSE = 1e-9

# Share of a load, or of the hardness, below which a difference counts as rounding.
LOST = 1e-11


class Effort(NamedTuple):
    """The work that a solve has taken.

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
        return Effort(
            self.iterations + other.iterations, self.convolutions + other.convolutions
        )


class Violation(NamedTuple):
    """The departures from equilibrium, none negative; the largest counts [unit of displacement].

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

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure, between the bounds whenever a method returns.
    residual : ndarray of float32, shape (nx, ny)
        u + s - H p: zero in contact, negative where a gap is open.
    shift : float
        Displacement s of the far field.
    yields : bool
        Whether bodies may yield: they count as elastic until the hardness is certain to be
        exceeded.
    limit : float
        Largest pressure allowed now: the hardness once bodies may yield, else inf.
    displacement : ndarray, shape (nx, ny), or None
        H p of the last exact residual, while `exact`.
    iterations : int
        Steps of conjugate gradients, and sets of dense algebra.
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
    ) -> None:
        self.patch, self.below, self.load, self.hardness = patch, below, load, hardness
        self.rtol, self.most, self.least = rtol, most, least
        self.yields, self.limit = False, math.inf
        self._soft = load is None and patch.soft
        self.pressure = np.zeros(below.shape)
        self.shift = 0.0 if shift is None else shift
        self.residual: Real = np.add(
            below, self.shift, dtype=np.float32, casting="same_kind"
        )
        self.displacement: Field | None = None
        self.iterations, self.exact, self.stalled = 0, False, False
        self._tension = 0.0

    def expect_yielding(self) -> None:
        """Let bodies yield from now on, whatever their pressures are."""
        self.yields, self.limit, self._soft = True, self.hardness, False

    # What there is

    @property
    def tolerance(self) -> float:
        """Largest violation accepted [unit of displacement]."""
        return self.rtol * (self.shift if self.shift > 0 else self.least)

    def violation(self, residual: Real | None = None) -> Violation:
        """Measure the departures from equilibrium that the residual, or a better one, shows."""
        residual = self.residual if residual is None else residual
        loaded, opening = self.pressure > 0, 0.0
        if self.yields:
            yielded = self.pressure >= self.hardness
            opening = -float((residual * yielded).min())
            penetration = float((residual * ~yielded).max())
            loaded &= ~yielded
        else:
            penetration = float(residual.max())
        gap = -float((residual * loaded).min())
        return Violation(max(penetration, 0.0), max(gap, 0.0), max(opening, 0.0))

    def worthless(self, farthest: float) -> bool:
        """Return whether no pressure at all is a better start than this one.

        Parameters
        ----------
        farthest : float
            Largest violation of a start that is better than none [unit of displacement].
        """
        work = inner(self.pressure, self.below) + self.shift * float(self.pressure.sum())
        return not (work > 0 and max(self.violation()) <= farthest)

    def touching(self) -> Mask:
        """Return the nodes that are under pressure or would penetrate."""
        touching: Mask = (self.pressure > 0) | (self.residual > 0)
        return touching

    def _energy(self) -> float:
        """Compute p H p / 2 - p u, which is least for the solution."""
        carried = float(self.pressure.sum()) if self.load is None else -self.load
        work = inner(self.pressure, self.below) + inner(self.pressure, self.residual)
        return -(work + self.shift * carried) / 2

    # Pressures between the bounds, and the far field that balances them

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
        if at_hardness or self._excess(pressure) > MOSTLY_ELASTIC:
            self.expect_yielding()
        self.pressure = np.minimum(pressure, self.limit)
        carried = float(self.pressure.sum())
        self._admit(self.pressure)
        if displacement is None or self.yields or not np.isfinite(displacement).all():
            displacement = self.patch.displace(self.pressure)
        elif self.load is not None:
            displacement = displacement * (self.load / carried)
        self.residual = np.empty(self.below.shape, np.float32)
        np.subtract(self.below, displacement, out=self.residual, casting="same_kind")
        if self.load is None:
            self.residual += np.float32(self.shift)
        else:
            self.shift = 0.0
            self._balance(self.residual)

    def renew(self) -> None:
        """Bring the pressure to the load, and compute the residual in double precision."""
        self._admit(self.pressure)
        self.displacement = self.patch.displace(self.pressure, exactly=True)
        gaps = self.below - self.displacement
        if self.load is None:
            gaps += self.shift
        else:
            self.shift = 0.0
            self._balance(gaps)
        self.residual, self.exact = gaps.astype(np.float32), True

    def _excess(self, pressure: Real) -> float:
        """Return the share of a pressure's load that exceeds the hardness [1]."""
        if self.hardness == math.inf:
            return 0.0
        carried = float(pressure.sum())
        over = float(np.maximum(pressure - self.hardness, 0).sum())
        return over / carried if carried > 0 else 0.0

    def _let_yield(self) -> None:
        """Take pressures to the hardness, and let bodies yield from now on."""
        self.expect_yielding()
        before, self.pressure = self.pressure, np.minimum(self.pressure, self.hardness)
        self._admit(self.pressure)
        self.residual = self.residual - self.patch.displace(self.pressure - before)
        self.exact = False
        if self.load is not None:
            self._balance(self.residual)

    def _balance(self, residual: Real) -> None:
        """Shift the far field under a load so that the free nodes are in balance.

        The mean that it takes off the residual is weighted by the pressure of the free nodes. Where
        all nodes in contact have yielded, more than one displacement is in balance, and the least
        one that leaves no gap there is taken; unless nodes outside would penetrate, which then have
        to exchange load with them.
        """
        weights = self.pressure
        if self.yields:
            weights = np.where(weights < self.hardness, weights, 0.0)
        if (carried := float(weights.sum())) > 0:
            mean = inner(weights, residual) / carried
        else:
            loaded = self.pressure > 0
            inside = float(residual.min(where=loaded, initial=math.inf))
            outside = float(residual.max(where=~loaded, initial=-math.inf))
            mean = inside if outside <= inside else (inside + outside) / 2
        residual -= residual.dtype.type(mean)
        self.shift -= mean

    def _admit(self, pressure: Field) -> None:
        """Bring a pressure in place to the load, and to a bound where rounding left it beside."""
        if self.load is not None:
            carried = float(pressure.sum())
            if not carried > 0:
                pressure[:] = self.load / pressure.size
            elif self.yields:
                self._carry_within(pressure, self.load)
            else:
                pressure *= self.load / carried
        if self.yields:
            self._snap(pressure)

    def _snap(self, pressure: Field, share: float = LOST) -> None:
        """Take pressures just beside zero or the hardness to it, in place."""
        pressure[pressure < share * self.hardness] = 0
        pressure[pressure > (1 - share) * self.hardness] = self.hardness

    def _carry_within(self, pressure: Field, load: float) -> None:
        """Scale the free pressures; all of them where the yielded nodes alone carry too much.

        Load that is then missing goes on the nodes next to touch, as far as the hardness allows.
        """
        limit, flat = BELOW_HARDNESS * self.hardness, pressure.reshape(-1)
        loaded = np.flatnonzero(flat)
        values = flat[loaded]
        for _ in range(6):  # each time more nodes are at the limit
            yielded = values >= self.hardness
            fixed = self.hardness * np.count_nonzero(yielded)
            before = values[~yielded]
            free = float(before.sum())
            left = load - fixed
            if left < 0:
                order = np.argsort(self.residual.reshape(-1)[loaded], kind="stable")
                over, taken = fixed + free - load, values[order]
                values[order] -= np.minimum(
                    taken, np.maximum(over - (np.cumsum(taken) - taken), 0)
                )
                break
            if not free > 0:
                break
            scaled = before * (left / free)
            values[~yielded] = np.minimum(scaled, np.maximum(before, limit))
            if not (scaled > np.maximum(before, limit)).any():
                break
        flat[loaded] = values
        missing = load - float(values.sum())
        if not missing > LOST * load:
            return
        below = np.flatnonzero(flat < self.hardness)
        gaps = -self.residual.reshape(-1)[below]
        most = math.ceil(missing / self.hardness) + int(np.count_nonzero(flat[below]))
        if most < below.size:
            below = below[np.argpartition(gaps, most)[: most + 1]]
            gaps = -self.residual.reshape(-1)[below]
        order = below[np.argsort(gaps, kind="stable")]
        room = self.hardness - flat[order]
        flat[order] += np.minimum(room, np.maximum(missing - (np.cumsum(room) - room), 0))

    def _rescale(self) -> None:
        """Scale an elastic pressure at a given displacement to the least energy.

        Cutting off tension leaves too much load, which shifts the residual of the whole contact.
        The displacement by the pressure is known, so that scaling it costs no convolution.
        """
        if self.load is not None:
            return
        work = inner(self.pressure, self.below) + self.shift * float(self.pressure.sum())
        stiffness = work - inner(self.pressure, self.residual)
        if not (stiffness > 0 and work > 0):
            return
        factor = work / stiffness
        self.pressure *= factor
        self.residual *= np.float32(factor)
        self.residual += np.multiply(
            self.below, 1 - factor, dtype=np.float32, casting="same_kind"
        )
        self.residual += np.float32((1 - factor) * self.shift)

    # First steps

    def take_first_steps(self, enough: float = 0.0) -> None:
        """Take preconditioned steps between the bounds, from no pressure at a given displacement.

        They find most of the nodes out of contact for one convolution a step. None is taken once
        the contact set is as small as `enough`.
        """
        patch, interference = self.patch, self.residual
        for step in range(FIRST_STEPS):
            touching = self.touching()
            if np.count_nonzero(touching) <= enough:
                return
            patch.take_contact(touching & (self.pressure < self.limit))
            ahead = self.pressure.copy()
            patch.add_to(ahead, patch.correct(patch.in_contact(self.residual)))
            np.maximum(ahead, 0, out=ahead)
            if (
                step == 0
                and self.hardness < math.inf
                and self._excess(ahead) > MOSTLY_ELASTIC
            ):
                self.expect_yielding()
            np.minimum(ahead, self.limit, out=ahead)
            capped = float(ahead.sum(where=ahead >= self.limit)) if self.yields else 0.0
            damped = capped > MOSTLY_CAPPED * float(ahead.sum())
            change = ahead - self.pressure if damped else ahead
            image = patch.displace(change)
            stiffness = inner(change, image)
            work = inner(self.residual if damped else interference, change)
            if not (stiffness > 0 and (damped or work > 0)):
                return
            scale = work / stiffness
            if damped:
                scale = min(max(scale, 0.0), 1.0)
                self.residual = self.residual - np.float32(scale) * image
                self.pressure = self.pressure + scale * change
                continue
            if capped:
                scale = 1.0 if step == FIRST_STEPS - 1 else min(max(scale, 0.8), 1.0)
            self.residual = interference - np.float32(scale) * image
            self.pressure = scale * ahead
        if self.yields:
            self._cap()

    def _cap(self) -> None:
        """Take pressures above the hardness, or above it but for rounding, to it."""
        before = self.pressure.copy()
        self.pressure[self.pressure > self.hardness * (1 - LOST)] = self.hardness
        if (self.pressure < before).any():
            self.residual -= self.patch.displace(self.pressure - before)

    def approach(self, enough: float = 0.0, *, interpolated: bool = False) -> None:
        """Take preconditioned steps between the bounds, while they come nearer fast.

        None is taken once the contact set is as small as `enough`. A pressure that was interpolated
        from a coarser grid touches on too many nodes: the steps then take those under pressure
        alone, and violations may rise at first.
        """
        patch, largest = self.patch, max(self.violation())
        for _ in range(INTERPOLATED_STEPS if interpolated else FIRST_STEPS):
            touching = self.pressure > 0 if interpolated else self.touching()
            if largest <= NEAR * self.shift or np.count_nonzero(touching) <= enough:
                return
            last, before = largest, self.pressure
            patch.take_contact(touching & (before < self.limit))
            ahead, correction = (
                before.copy(),
                patch.correct(patch.in_contact(self.residual)),
            )
            share = APPROACH_FREE
            if patch.boundary != "free":
                share = np.interp(
                    patch.count, (0, before.size), (APPROACH_SMALL, APPROACH_FULL)
                )
            patch.add_to(ahead, np.float32(share) * correction)
            self.pressure = np.clip(ahead, 0, self.limit, out=ahead)
            self._admit(ahead)
            self.residual -= patch.displace(np.subtract(ahead, before, out=before))
            if self.load is not None:
                self._balance(self.residual)
            elif not self.yields:
                self._rescale()
            largest = max(self.violation())
            if not (interpolated or largest < NEARER * last):
                return


def cut_to_load(pressure: Field, load: float, hardness: float = math.inf) -> Field:
    """Return p - c between zero and the hardness with the constant c that leaves a load.

    Without a hardness, c is that of all nodes, then of those that it leaves above zero, and so on
    (Michelot 1986, Journal of Optimization Theory and Applications 50). With one, it is bisected.
    """
    left = pressure.reshape(-1)
    while True:
        low = (float(left.sum()) - load) / left.size
        above = left[left > low]
        if above.size in {0, left.size}:
            break
        left = above
    if hardness < math.inf:
        low, high = float(pressure.min()) - hardness, low
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
    products = a * b if a.ndim == 1 else np.einsum("ij,ij->i", a, b)
    return float(np.add.reduce(products, dtype=np.float64))
