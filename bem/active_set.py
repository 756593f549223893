"""One active set for all contacts: 0 <= p <= P at a given displacement, or under a given load.

The gap is w = H p - u - s, with the interference u and the displacement s of the far field, and the
residual -w is the penetration. Where p = 0 the gap is open, w >= 0; between the bounds it is
closed, w = 0; and where p is the hardness P the body has yielded, w <= 0. Elastic bodies have P =
inf. This is a semi-smooth Newton method (Hintermueller, Ito and Kunisch 2002): the equations of the
free nodes are solved loosely by preconditioned conjugate gradients, pressures are brought back
between the bounds, and the sets are taken anew, until they stand.

A given load fixes the sum of all corrections, and s follows from the balance of the free nodes
(projected conjugate gradients: Gould, Hribar and Nocedal 2001). At a given displacement corrections
are kept conjugate to the pressure (deflation: Nicolaides 1987). Sets that no longer come nearer are
damped by the energy p H p / 2 - p u, which the solution has least. Where that is not enough,
projected gradients lower it for certain (Bertsekas 1976), so that every solve ends.
"""

import math
from collections.abc import Callable
from itertools import count
from typing import NamedTuple

import numpy as np

from bem.arrays import Field, Mask, Nodes, Real, Values
from bem.dense import MOST_SETS, ContactFactor
from bem.operators.filters import filtered
from bem.operators.patch import Patch
from bem.sections import on_one_blas_thread

# Factor by which conjugate gradients reduce the residual before the sets are checked, and the
# factor on it whenever new sets have raised the energy: the last ones were then left too early.
# Reductions from 0.3 to 0.55 take nearly the same convolutions on the paper's distribution (`pytest
# bench -k solve_paper`).
REDUCTION, TIGHTENING = 0.4, 0.5

# Share of the preconditioned residual that is added when pressures are brought back between the
# bounds: a whole step would put too many nodes into contact. Bodies that yield change a second set
# with it.
ADVANCE, ADVANCE_YIELDING = 0.5, 0.5

# Shares of the tolerance that solves aim at, and that conjugate gradients reach.
AIM, REACHED = 0.9, 0.8

# Share of its last exact value below which a residual updated in single precision is not trusted:
# single precision carries about seven digits.
ROUNDING = 1e-6

# Violation, over the displacement, from which a round is ended by an exact residual instead of one
# in single precision, where that is needed next.
POLISHED = 0.02

# Share of the contact that leaves in one round at most where a displacement barely fixes the load.
MOST_LEAVING = 0.4

# Exact residuals in a row, none below half of the smallest, after which only rounding is left.
IDLE = 5

# Rounds in a row without a smaller violation from which the energy damps them, and after which
# projected gradients take over, for this many steps; and rounds in all after which they do.
DAMPED, PATIENCE, SAFE_STEPS, ROUNDS = 3, 12, 4, 40

# Least gap of yielded nodes that are freed, as a share of the largest: freeing all of them at once
# raises the load too far, and the sets cycle. The second share is for sets that gain too little.
FREED, FREED_SLOWLY = 0.1, 0.7

# Share of the contact under tension up to which yielded nodes are freed before the free ones are
# nearer to equilibrium: more tension means too much load, under which gaps open everywhere.
LITTLE_TENSION = 0.1

# Largest pressure of free nodes, over the hardness, after a step ahead: such steps overestimate,
# and conjugate gradients decide which nodes yield.
BELOW_HARDNESS = 0.9999

# Largest factor on the free pressures for the load that capping takes off their neighbours.
LARGEST_SCALE = 2.0

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

# Nodes outside with the smallest gaps that are factorised with a contact set, as its share, and the
# exact residuals that are computed before iterations take over.
SPARE, RENEWALS = 0.08, 5

# Share of the largest set worth factorising up to which the factor is in double precision, which
# saves a convolution at the end (`pytest bench -k few_in_contact`).
DOUBLE_SHARE = 0.5

# Solves on nodes that are given: the factor by which the residual falls between looks at it, and
# exact residuals at most.
LINEAR_REDUCTION, LINEAR_RENEWALS = 0.1, 8

# Free nodes of bodies that yield, as a share of the largest set worth factorising, up to which a
# factor replaces conjugate gradients.
FEW_FREE = 0.4

# Splitting: the share of the new waves, the rest being the pressure between the bounds, that is cut
# off; passes between two checks; and passes at most for each iteration that a problem allows: one
# takes about a quarter of a step of conjugate gradients with its preconditioner.
OVER, CHECKED, PASSES = 1.6, 10, 4

# Distance from zero or the hardness, over the hardness, at which a pressure of a start or of a
# splitting is taken to be there.
CLOSE = 1e-9

# Share of a load that is lost to rounding.
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
        """The largest of them."""
        return max(self)


class ActiveSet:
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
        work = _inner(self.pressure, self.below + self.shift)
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
        return -_inner(self.pressure, self.below + self.residual) / 2 - self.shift * carried / 2

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
            weights = self._free_pressure()
            carried = float(weights.sum())
            if carried > 0:
                self.shift = -float(np.einsum("ij,ij->", weights, gaps)) / carried
            else:
                self.shift = -float(gaps[self.pressure > 0].min())
        self.residual = (gaps + self.shift).astype(np.float32)
        self.exact = True

    def _level(self, weights: Real, carried: float) -> None:
        """Shift the far field so that the weighted mean of the residual is zero."""
        mean = _inner(weights, self.residual) / carried
        self.residual -= np.float32(mean)
        self.shift -= mean

    def _balance(self) -> None:
        """Shift the far field under a load so that the free nodes are in balance.

        Where all nodes in contact have yielded, more than one displacement is: the least one that
        leaves no gap there is taken.
        """
        if self.load is None:
            return
        weights = self._free_pressure()
        carried = float(weights.sum())
        if carried > 0:
            self._level(weights, carried)
        else:
            least = float(self.residual[self.pressure > 0].min())
            self.residual -= np.float32(least)
            self.shift -= least

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
        gaps, most = -self.residual.reshape(-1)[below], math.ceil(missing / self.hardness)
        most += np.count_nonzero(pressure[below])
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
        stiffness = _inner(self.pressure, interference - self.residual)
        work = _inner(self.pressure, interference)
        if not (stiffness > 0 and work > 0):
            return
        factor = work / stiffness
        self.pressure = factor * self.pressure
        self.residual = (interference * (1 - factor) + factor * self.residual).astype(np.float32)

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
            stiffness = _inner(change, image)
            if not stiffness > 0:
                return
            if damped:
                scale = min(max(_inner(self.residual, change) / stiffness, 0.0), 1.0)
                self.residual = self.residual - np.float32(scale) * image
                self.pressure = self.pressure + scale * change
            else:
                scale = _inner(interference, pressure) / stiffness
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

    # Dense algebra

    @on_one_blas_thread()
    def settle_few(self) -> bool:
        """Solve by dense algebra if few nodes are in contact; return whether the tolerance is
        met.
        """
        nodes = np.flatnonzero(self.touching())
        few = 0 < nodes.size <= self.patch.few
        if self._yields or not few or self.effort.iterations >= self.most:
            return False
        gaps = np.where(self.touching(), np.inf, -self.residual).reshape(-1)
        many = min(int(math.ceil(SPARE * nodes.size)), gaps.size - nodes.size)
        spare: Nodes = np.argpartition(gaps, many)[:many] if many < gaps.size else nodes[:0]
        before = self.pressure, self.residual, self.shift, self.exact, self.violation().largest
        try:
            with np.errstate(over="raise"):
                settled = self._settle(np.concatenate([nodes, spare]))
        except (np.linalg.LinAlgError, FloatingPointError):
            settled = False
        if not settled and not self.violation().largest <= before[-1]:
            self.pressure, self.residual, self.shift, self.exact, _ = before
        return settled and not self._exceeds()

    def _entries(self, nodes: Nodes, dtype: str) -> Real:
        """Return the lower triangle of the matrix of some nodes, in Fortran's order."""
        entries = self.patch.entries(nodes, dtype)
        if self._give:
            entries = np.asfortranarray(np.tril(entries) - entries.dtype.type(self._give))
        return entries

    def _settle(self, nodes: Nodes) -> bool:
        """Solve on the candidate set, then check all nodes.

        If nodes outside penetrate, enlarge the set and factorise again; otherwise correct rounding.
        """
        factor, interference = (
            None,
            (self.below + (self.shift if self.load is None else 0)).reshape(-1),
        )
        for _ in range(RENEWALS):
            if factor is None:
                if nodes.size > self.patch.few or self.effort.iterations >= self.most:
                    return False
                order = np.lexsort((-self.residual.flat[nodes], -self.pressure.flat[nodes]))
                precision = "float64" if nodes.size <= DOUBLE_SHARE * self.patch.few else "float32"
                factor = ContactFactor(
                    lambda some, dtype=precision: self._entries(some, dtype),
                    nodes[order],
                )
                sets = min(MOST_SETS, self.most - self.effort.iterations)
                solution = factor.solve(interference, self.load, sets)
                self.effort += Effort(iterations=solution.sets)
                values = solution.pressure
                if not solution.settled:
                    return False
            else:
                values = self.pressure.reshape(-1)[factor.nodes]
                values = values + factor.correct(
                    self.residual.reshape(-1), None if self.load is None else 0.0
                )
            self.pressure = np.zeros(self.below.shape)
            self.pressure.reshape(-1)[factor.nodes] = np.maximum(values, 0)
            self.renew()
            if self.violation().largest <= self.tolerance:
                return True
            touching = np.flatnonzero(self.touching())
            if not np.isin(touching, factor.nodes, assume_unique=True).all():
                nodes, factor = touching, None
        return False

    # Rounds

    def run(self) -> bool:
        """Solve from the pressure that there is; return whether the tolerance is met.

        The residual has then been recomputed from the pressure.
        """
        violation = self.violation()
        renewed = violation.largest if self.exact else 1.0
        energy, reduction, following = math.inf, REDUCTION, False
        smallest, patience, smallest_renewed, idle = math.inf, PATIENCE, math.inf, 0
        for rounds in count():
            certain = violation.largest <= CERTAIN * max(self.shift, self._least)
            if certain and self._exceeds():
                self._let_yield()
                violation, renewed = self.violation(), 1.0
                energy, smallest, patience, following = math.inf, math.inf, PATIENCE, False
            floor = max(AIM * self.tolerance, ROUNDING * renewed)
            out_of_steps = max(self.effort.iterations, rounds) >= self.most
            if not violation.largest > floor or out_of_steps:
                if not self.exact:
                    self.renew()
                    violation = self.violation()
                    renewed = violation.largest
                    idle = 0 if renewed < smallest_renewed / 2 else idle + 1
                    smallest_renewed = min(smallest_renewed, renewed)
                    smallest, patience = math.inf, PATIENCE
                self.stalled = idle >= IDLE
                met = violation.largest <= self.tolerance
                if met or self.stalled or out_of_steps or math.isnan(violation.largest):
                    return met
                continue
            if patience <= 0 or rounds % ROUNDS == ROUNDS - 1:
                if not self._split():
                    self._descend()
                smallest, patience, following = math.inf, PATIENCE, False
            yielded = self._take_sets(violation, floor, following, slowly=patience <= PATIENCE // 2)
            polishing = ROUNDING * renewed > self.tolerance / 2 and violation.largest <= POLISHED
            damped = self._soft or patience <= PATIENCE - DAMPED
            following = self._round(yielded, (reduction, REACHED * floor), damped, polishing)
            energy, last = self._energy(), energy
            reduction *= TIGHTENING if energy > last else 1.0
            violation = self.violation()
            renewed = violation.largest if self.exact else renewed
            patience = PATIENCE if violation.largest < smallest else patience - 1
            smallest = min(smallest, violation.largest)

    def _take_sets(
        self, violation: Violation, floor: float, following: bool, *, slowly: bool
    ) -> Mask | None:
        """Take the free nodes for conjugate gradients, and return the yielded ones.

        After a step ahead on a set, no other nodes join it, so that sets do not flicker.
        """
        if not self._yields:
            if not (following and self.load is not None):
                self.patch.take_contact(self.touching())
                self._rescale()
            return None
        yielded: Mask = self.pressure >= self.hardness
        nearer = violation.opening >= max(violation.penetration, violation.gap)
        if violation.opening > floor and (nearer or self._tension <= LITTLE_TENSION):
            share = FREED_SLOWLY if slowly else FREED
            yielded &= self.residual >= -np.float32(share * violation.opening)
        free = self.touching() & ~yielded
        if following:
            free &= (self.patch.contact > 0) | (self.pressure > 0)
        self.patch.take_contact(free)
        if not yielded.any():
            self._rescale()
        return yielded

    def _round(
        self, yielded: Mask | None, goals: tuple[float, float], damped: bool, polishing: bool
    ) -> bool:
        """Solve loosely on the free nodes and bring their pressure back between the bounds.

        Returns whether a step ahead was taken on the next set.
        """
        start = self.pressure, self.residual.copy(), self.shift
        energy = self._energy() if damped else 0.0
        dense = self._yields and self._solve_few_free()
        solved = self.pressure
        if not dense:
            self._solve_free(yielded, goals)
            if self._soft:
                self._hold_back(*start[:2])
            solved = self.pressure
        ahead = self._between_bounds(yielded, 0.0 if dense else 1.0)
        changed = ahead is not None
        if not (changed or dense):
            return False
        ahead = self.pressure if ahead is None else ahead
        self.pressure = ahead
        if dense:
            solved = start[0]
        if polishing and not self._yields:
            self.renew()
            return True
        self.residual -= self._displace(ahead - solved)
        if self._soft:
            self._rescale()
        if damped and self._energy() > energy:
            self._shorten(*start, self.pressure if dense else solved)
        self._balance()
        return changed

    def solve_on(self, nodes: Mask, rtol: float) -> float:
        """Solve the equations of some nodes alone, whatever the bounds; return the residual left.

        Parameters
        ----------
        nodes : ndarray, shape (nx, ny)
            The nodes that are displaced by u + s; the pressure of the others is zero.
        rtol : float
            Largest residual wanted [unit of displacement].
        """
        self.patch.take_contact(nodes)
        left = math.inf
        for _ in range(LINEAR_RENEWALS):
            self._solve_free(None, (LINEAR_REDUCTION, rtol / 2), checked=False)
            self.renew()
            left = float(np.abs(self.residual[nodes]).max())
            if not left > rtol:  # also where it is nan
                break
        return left

    def _solve_free(
        self, yielded: Mask | None, goals: tuple[float, float], *, checked: bool = True
    ) -> None:
        """Run conjugate gradients on the free nodes until their set has to change.

        The set is checked whenever the residual has fallen by the first of the goals; a residual
        below the second ends the stage. The residual of all nodes is updated, because the
        convolution yields it at no extra cost. On all nodes of a patch without edges a uniform
        pressure displaces nothing, so that a stage ends with the first pressure out of bounds.
        """
        patch, residual, (reduction, floor) = self.patch, self.residual, goals
        base = patch.in_contact(self.pressure).astype(np.float32)
        if self.load is not None and not base.any():
            base = patch.in_contact(np.ones_like(residual))
        carried = float(base.sum(dtype=np.float64)) if self.load is not None else 0.0
        image, stiffness = self._deflation(base, yielded)
        direction, change = np.zeros_like(base), np.zeros_like(base)
        previous, goal, mean = math.inf, 0.0, 0.0
        singular = self.load is None and patch.singular
        bounded = self._yields and singular
        while self.effort.iterations < self.most:
            here = patch.in_contact(residual)
            if carried:
                mean = _inner(base, here) / carried
                here -= np.float32(mean) if here.ndim == 1 else np.float32(mean) * patch.contact
            largest = max(float(here.max()), -float(here.min())) if here.size else 0.0
            if not largest > floor:
                break
            goal = goal or reduction * largest
            if largest <= goal:
                if checked and self._has_to_change(base + change, yielded, floor, largest, mean):
                    break
                goal = max(reduction * goal, floor)
            along = _inner(here, base) if stiffness else 0.0
            correction = patch.correct(here)
            if carried:  # corrections carry no load in all
                correction -= np.float32(correction.sum(dtype=np.float64) / carried) * base
            elif stiffness:  # corrections are conjugate to the pressure
                along -= _inner(correction, image)
                correction += np.float32(along / stiffness) * base
            product = _inner(here, correction)
            direction *= np.float32(product / previous)
            direction += correction
            previous = product
            moved = self._displace(direction, patch.displace_by)
            curvature = _inner(direction, patch.in_contact(moved))
            if not (product > 0 and curvature > 0):  # only rounding is left
                break
            length = np.float32(product / curvature)
            limit = np.float32(self.hardness / np.abs(direction).max()) if bounded else length
            length = min(length, limit)
            moved *= length
            residual -= moved
            change += length * direction
            self.effort += Effort(iterations=1)
            if singular and (length < product / curvature * 0.999 or (base + change).min() < 0):
                break
        if carried:
            mean = _inner(base, patch.in_contact(residual)) / carried
            residual -= np.float32(mean)
            self.shift -= mean
        self.pressure = self.pressure.copy()
        patch.add_to(self.pressure, change)

    def _deflation(self, weights: Real, yielded: Mask | None) -> tuple[Real, float]:
        """Return the displacement by an elastic pressure on the free nodes, and their product.

        Rounding puts errors along the pressure back into the residual, and every correction removes
        them again (A-DEF2 of Tang, Nabben, Vuik and Erlangga 2009). The product is 0 where the
        displacement is not known, or the load is given.
        """
        if self.load is not None or (yielded is not None and yielded.any()):
            return weights, 0.0
        interference = self.patch.in_contact(self.below + self.shift)
        image = (interference - self.patch.in_contact(self.residual)).astype(np.float32)
        stiffness = _inner(weights, image)
        return image, stiffness if stiffness > 0 else 0.0

    def _has_to_change(
        self, pressure: Real, yielded: Mask | None, floor: float, largest: float, mean: float
    ) -> bool:
        """Return whether a set has to change: by tension, penetration outside, excess or
        opening.

        The residual is above its true value by the mean.
        """
        if pressure.min() < 0:
            return True
        outside = self.residual * self.patch.outside
        if yielded is None:
            return bool(outside.max() > floor + mean)
        if pressure.max() > self.hardness:
            return True
        if -float((outside * yielded).min()) > max(floor, largest) - mean:
            return True
        return bool((outside * ~yielded).max() > floor + mean)

    @on_one_blas_thread()
    def _solve_few_free(self) -> bool:
        """Solve for few free nodes by dense algebra; the residual is left as it is."""
        if not 0 < self.patch.count <= FEW_FREE * self.patch.few:
            return False
        nodes = np.flatnonzero(self.patch.contact)
        try:
            with np.errstate(over="raise"):
                factor = ContactFactor(lambda some: self._entries(some, "float64"), nodes)
                change = factor.correct(
                    self.residual.reshape(-1).astype(np.float64), None if self.load is None else 0.0
                )
        except (np.linalg.LinAlgError, FloatingPointError):
            return False
        self.pressure = self.pressure.copy()
        self.pressure.reshape(-1)[nodes] += change
        self.effort += Effort(iterations=1)
        return True

    def _between_bounds(self, yielded: Mask | None, share: float) -> Field | None:
        """Cut off tension, cap pressures at the hardness, and step ahead on the next set.

        Returns the pressure, or None where none is out of bounds. The share is that of a step
        ahead.
        """
        patch, pressure = self.patch, self.pressure
        tension = pressure < 0
        excess = self._yields and bool((pressure > self.hardness).any())
        pulled = np.count_nonzero(tension)
        self._tension = pulled / max(patch.count, 1)
        if not (pulled or excess):
            return None
        ahead = np.maximum(pressure, 0)
        if excess and yielded is not None:
            ahead = self._capped(ahead, float(pressure.sum()), yielded)
        following = ((ahead > 0) | (self.residual > 0)) & ~tension
        if self._yields:
            following &= ahead < self.hardness
        patch.take_contact(following)
        if share:
            share *= ADVANCE_YIELDING if self._yields else ADVANCE
            residual = patch.in_contact(self.residual)
            patch.add_to(ahead, np.float32(share) * patch.correct(residual))
            np.maximum(ahead, 0, out=ahead)
        if self._yields:
            np.minimum(ahead, np.maximum(pressure, BELOW_HARDNESS * self.hardness), out=ahead)
        self._carry(ahead)
        return ahead

    def _capped(self, pressure: Field, carried: float, yielded: Mask) -> Field:
        """Cap pressures at the hardness, and put the load that this takes off on the free nodes.

        Parameters
        ----------
        pressure : ndarray, shape (nx, ny)
            Pressure, not negative.
        carried : float
            Load to carry, as far as scaling allows.
        yielded : ndarray, shape (nx, ny)
            Nodes at the hardness before.
        """
        free = np.where(yielded, 0.0, pressure) if yielded.any() else pressure
        left, factor = carried - self.hardness * np.count_nonzero(yielded), 1.0
        for _ in range(4):  # each time more nodes are capped; a few rounds come near enough
            capped = free >= self.hardness / factor
            rest = float((free * ~capped).sum())
            missing = left - self.hardness * np.count_nonzero(capped)
            if not (rest > 0 and missing > 0):
                break
            last, factor = factor, min(max(missing / rest, 1.0), LARGEST_SCALE)
            if factor == last:
                break
        return np.minimum(np.where(yielded, self.hardness, factor * free), self.hardness)

    def _hold_back(self, pressure: Field, residual: Real) -> None:
        """Go back towards an earlier pressure until no more than a share of the contact leaves.

        Where a displacement barely fixes the load, equations on a set that is too large let all of
        it go.
        """
        leaving = self.pressure < 0
        most = int(MOST_LEAVING * self.patch.count)
        if np.count_nonzero(leaving) <= most:
            return
        before, after = pressure[leaving], self.pressure[leaving]
        step = float(np.partition(before / (before - after), most)[most])
        self.pressure = pressure + step * (self.pressure - pressure)
        self.residual = residual + np.float32(step) * (self.residual - residual)

    def _shorten(self, pressure: Field, residual: Real, shift: float, solved: Field) -> None:
        """Take a shorter step from an earlier pressure towards the one that equations gave.

        Its length is that of the least energy on the line to the present pressure, but it goes
        along the bounds, so that nodes leave the contact.
        """
        change, image = self.pressure - pressure, residual - self.residual
        if self.load is not None:
            image = image + np.float32(self.shift - shift)
        slope, curvature = _inner(residual, change), _inner(change, image)
        step = min(max(slope / curvature, 0.0), 1.0) if curvature > 0 else 1.0
        self.pressure = np.clip(pressure + step * (solved - pressure), 0, self._most_pressure)
        self._carry(self.pressure)
        self._snap()
        self.shift = shift
        self.residual = residual - self._displace(self.pressure - pressure)
        if self._soft:
            self._rescale()

    def _snap(self, share: float = LOST) -> None:
        """Take pressures that rounding left just beside zero or the hardness to it."""
        if self._yields:
            self.pressure[self.pressure < share * self.hardness] = 0
            self.pressure[self.pressure > (1 - share) * self.hardness] = self.hardness

    def _descend(self) -> None:
        """Take projected gradients, of which each lowers the energy for certain."""
        for _ in range(SAFE_STEPS):
            ahead = self._projected(self.pressure + self.residual / self.patch.norm)
            change = ahead - self.pressure
            image = self._displace(change)
            if not (_inner(self.residual, change) > 0 and _inner(change, image) > 0):
                return
            self.residual -= image
            self.pressure = ahead
            self._balance()

    def _split(self) -> bool:
        """Solve by waves and bounds in turn, without edges; return whether the patch allows it.

        The alternating direction method of multipliers has no sets that could cycle. It minimises
        the same energy: in turn over all pressures, which waves do by one transform each way, and
        over those between the bounds. It converges from any start because the energy is convex
        (Boyd, Parikh, Chu, Peleato and Eckstein 2011, Foundations and Trends in Machine Learning 3,
        sections 3.2 and 3.4.3).
        """
        splitting = self.patch.splitting()
        if splitting is None:
            return False
        inverse, penalty = splitting
        interference = self.below + (self.shift if self.load is None else 0.0)
        within, price = self.pressure, self.residual / penalty
        for number in range(1, PASSES * self.most + 1):
            free = filtered(inverse, interference + penalty * (within - price))
            if self.load is not None:
                free = free + (self.load / free.size - free.mean())
            mixed = OVER * free + (1 - OVER) * within
            within = np.clip(mixed + price, 0, self._most_pressure)
            price = price + mixed - within
            if number % CHECKED == 0 and within.any():
                self.effort += Effort(convolutions=CHECKED)
                self.pressure = within.copy()
                self._snap(CLOSE)
                self.renew()
                if self.violation().largest <= self.tolerance:
                    break
        return True

    def _projected(self, pressure: Field) -> Field:
        """Return the nearest pressure between the bounds that carries the load."""
        if self.load is None:
            return np.clip(pressure, 0, self._most_pressure)
        cut = cut_to_load(pressure, self.load, self._most_pressure)
        self._carry(cut)
        return cut


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


def _inner(a: Real, b: Real) -> float:
    """Compute an inner product of fields without BLAS, row by row, then in double precision."""
    if a.ndim == 1:
        return float((a * b).sum(dtype=np.float64))
    return float(np.einsum("ij,ij->i", a, b).sum(dtype=np.float64))
