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

import numpy as np

from bem.arrays import Field, Mask, Nodes, Real
from bem.dense import MOST_SETS, ContactFactor
from bem.iterate import (
    BELOW_HARDNESS,
    CERTAIN,
    CLOSE,
    Iterate,
    Violation,
    cut_to_load,
    inner,
)
from bem.operators.filters import filtered
from bem.threads import on_one_blas_thread

# Factor by which conjugate gradients reduce the residual before the sets are checked, and the
# factor on it whenever new sets have raised the energy: the last ones were then left too early.
# Reductions from 0.3 to 0.55 take nearly the same convolutions on the paper's distribution (`pytest
# bench -k solve_paper`).
REDUCTION, TIGHTENING = 0.4, 0.5

# Share of the preconditioned residual that is added when pressures are brought back between the
# bounds: a whole step would put too many nodes into contact.
ADVANCE = 0.5

# Shares of the tolerance that solves aim at, and that conjugate gradients reach.
AIM, REACHED = 0.9, 0.8

# Share of its last exact value below which a residual updated in single precision is not trusted:
# single precision carries about seven digits.
ROUNDING = 1e-6

# Steps of conjugate gradients without a smaller residual after which single precision leaves none:
# each step gains a factor of 2 or so.
STAGNANT = 30

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

# Largest factor on the free pressures for the load that capping takes off their neighbours.
LARGEST_SCALE = 2.0

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


class ActiveSet(Iterate):
    """Takes an `Iterate` to equilibrium: by dense algebra on few nodes, or in rounds."""

    # Dense algebra

    def settle_few(self) -> bool:
        """Solve by dense algebra if few nodes are in contact; return whether that succeeded."""
        touching = self.touching()
        number = np.count_nonzero(touching)
        if self.yields or self.iterations >= self.most:
            return False
        if number * (1 + SPARE) > self.patch.few:
            if self.load is None and number > self.patch.few:
                return False
            touching = self.pressure > 0  # under a load, most others will leave again
        nodes = np.flatnonzero(touching)
        many = min(math.ceil(SPARE * nodes.size), touching.size - nodes.size)
        if not 0 < nodes.size <= self.patch.few - many:
            return False
        gaps = np.where(touching, np.inf, -self.residual).reshape(-1)
        spare: Nodes = (
            np.argpartition(gaps, many)[:many] if many < gaps.size else nodes[:0]
        )
        before, largest = (
            (self.pressure, self.residual, self.shift),
            max(self.violation()),
        )
        try:
            with on_one_blas_thread(), np.errstate(over="raise"):
                settled = self._settle(np.concatenate([nodes, spare]))
        except (np.linalg.LinAlgError, FloatingPointError):
            settled = False
        if not settled and not max(self.violation()) <= largest:
            (self.pressure, self.residual, self.shift), self.exact = before, False
        return settled and not self.pressure.max() > self.hardness

    def _settle(self, nodes: Nodes) -> bool:
        """Solve on the candidate set, then check all nodes.

        If nodes outside penetrate, enlarge the set and factorise again; otherwise correct rounding.
        """
        factor, shift = None, self.shift if self.load is None else 0.0
        interference = (self.below + shift).reshape(-1)
        for _ in range(RENEWALS):
            if factor is None:
                if nodes.size > self.patch.few or self.iterations >= self.most:
                    return False
                order = np.lexsort(
                    (-self.residual.flat[nodes], -self.pressure.flat[nodes])
                )
                precision = (
                    "float64"
                    if nodes.size <= DOUBLE_SHARE * self.patch.few
                    else "float32"
                )
                factor = ContactFactor(
                    lambda some, dtype=precision: self.patch.entries(some, dtype),  # type: ignore[misc]
                    nodes[order],
                )
                sets = min(MOST_SETS, self.most - self.iterations)
                solution = factor.solve(interference, self.load, sets)
                self.iterations += solution.sets
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
            if max(self.violation()) <= self.tolerance:
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
        largest = max(violation)
        renewed = largest if self.exact else 1.0
        energy, reduction, following = math.inf, REDUCTION, False
        smallest, patience, smallest_renewed, idle = math.inf, PATIENCE, math.inf, 0
        rounds = -1
        while True:
            rounds += 1
            certain = largest <= CERTAIN * max(self.shift, self.least)
            elastic = self.hardness < math.inf and not self.yields  # so far
            if certain and elastic and self.pressure.max() > self.hardness:
                self._let_yield()
                violation, renewed = self.violation(), 1.0
                largest = max(violation)
                energy, smallest, patience, following = (
                    math.inf,
                    math.inf,
                    PATIENCE,
                    False,
                )
            floor = max(AIM * self.tolerance, ROUNDING * renewed)
            out_of_steps = max(self.iterations, rounds) >= self.most
            if not largest > floor or out_of_steps:
                if not self.exact:
                    self.renew()
                    violation = self.violation()
                    renewed = largest = max(violation)
                    idle = 0 if renewed < smallest_renewed / 2 else idle + 1
                    smallest_renewed = min(smallest_renewed, renewed)
                    smallest, patience = math.inf, PATIENCE
                self.stalled = idle >= IDLE
                met = largest <= self.tolerance
                if met or self.stalled or out_of_steps or math.isnan(largest):
                    return met
                continue
            if patience <= 0 or rounds % ROUNDS == ROUNDS - 1:
                if not self._split():
                    self._descend()
                smallest, patience, following = math.inf, PATIENCE, False
            yielded = self._take_sets(
                violation, floor, following, slowly=patience <= PATIENCE // 2
            )
            polishing = ROUNDING * renewed > self.tolerance / 2 and largest <= POLISHED
            damped = self._soft or patience <= PATIENCE - DAMPED
            following = self._round(
                yielded, (reduction, REACHED * floor), damped, polishing
            )
            energy, last = self._energy(), energy
            reduction *= TIGHTENING if energy > last else 1.0
            violation = self.violation()
            largest = max(violation)
            renewed = largest if self.exact else renewed
            patience = PATIENCE if largest < smallest else patience - 1
            smallest = min(smallest, largest)

    def _take_sets(
        self, violation: Violation, floor: float, following: bool, *, slowly: bool
    ) -> Mask | None:
        """Take the free nodes for conjugate gradients, and return the yielded ones.

        After a step ahead on a set, no other nodes join it, so that sets do not flicker.
        """
        if not self.yields:
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
            free &= self.patch.contact | (self.pressure > 0)
        self.patch.take_contact(free)
        if not yielded.any():
            self._rescale()
        return yielded

    def _round(
        self,
        yielded: Mask | None,
        goals: tuple[float, float],
        damped: bool,
        polishing: bool,
    ) -> bool:
        """Solve loosely on the free nodes and bring their pressure back between the bounds.

        Where the free nodes meet the tolerance, the round is likely to be the last, so that its
        residual is computed in double precision at once. Returns whether a step ahead was taken on
        the next set.
        """
        before, shift, residual, energy = self.pressure, self.shift, self.residual, 0.0
        self.exact = False
        if damped:  # else nothing is kept, to save memory
            residual, energy = residual.copy(), self._energy()
            self.pressure = before.copy()
        dense, left = self.yields and self._solve_few_free(), math.inf
        if not dense:
            left = self._solve_free(yielded, goals)
            if self._soft:
                self._hold_back(before, residual)
        solved = before if dense else self.pressure
        ahead = self._between_bounds(yielded, onwards=not dense)
        changed = ahead is not None
        if not (changed or dense):
            return False
        ahead = self.pressure if ahead is None else ahead
        self.pressure = ahead
        last = left <= self.tolerance and not damped
        if (polishing or last) and not self.yields:
            self.renew()
            return True
        change = np.subtract(ahead, solved, out=None if damped or dense else solved)
        self.residual -= self.patch.displace(change)
        if self._soft:
            self._rescale()
        if damped and self._energy() > energy:
            self._shorten(before, residual, shift, self.pressure if dense else solved)
        if self.load is not None:
            self._balance(self.residual)
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
    ) -> float:
        """Run conjugate gradients on the free nodes until their set has to change.

        Returns the largest residual left of them.

        The set is checked whenever the residual has fallen by the first of the goals; a residual
        below the second ends the stage. The residual of all nodes is updated, because the
        convolution yields it at no extra cost. On all nodes of a patch without edges a uniform
        pressure displaces nothing, so that a stage ends with the first pressure out of bounds.
        """
        patch, residual, (reduction, floor) = self.patch, self.residual, goals
        base, carried, deflation = self._constraint(yielded)
        direction, change = (
            np.zeros(base.shape, np.float32),
            np.zeros(base.shape, np.float32),
        )
        previous, goal, mean = math.inf, 0.0, 0.0
        least, last = math.inf, self.iterations
        largest, singular = math.inf, self.load is None and patch.singular
        while self.iterations < self.most:
            here = patch.in_contact(residual)
            if carried:
                mean = inner(base, here) / carried
                here -= (
                    np.float32(mean)
                    if here.ndim == 1
                    else np.float32(mean) * patch.within
                )
            largest = max(float(here.max()), -float(here.min())) if here.size else 0.0
            least, last = min((largest, self.iterations), (least, last))
            if not largest > floor or self.iterations - last >= STAGNANT:
                break
            goal = goal or reduction * largest
            if largest <= goal:
                if checked and self._has_to_change(
                    base + change, yielded, floor, largest, mean
                ):
                    break
                goal = max(reduction * goal, floor)
            correction = self._constrained(
                patch.correct(here), here, base, carried, deflation
            )
            product = inner(here, correction)
            direction *= np.float32(product / previous)
            direction += correction
            previous = product
            moved = patch.displace(direction)
            curvature = inner(direction, patch.in_contact(moved))
            if not (product > 0 and curvature > 0):  # only rounding is left
                break
            length = np.float32(product / curvature)
            if singular and self.yields:
                length = min(length, np.float32(self.hardness / np.abs(direction).max()))
            moved *= length
            residual -= moved
            change += length * direction
            self.iterations += 1
            if singular and (
                length < product / curvature * 0.999 or (base + change).min() < 0
            ):
                break
        if carried:
            mean = inner(base, patch.in_contact(residual)) / carried
            residual -= np.float32(mean)
            self.shift -= mean
        patch.add_to(self.pressure, change)
        return largest

    def _constraint(self, yielded: Mask | None) -> tuple[Real, float, tuple[Real, float]]:
        """Return a pressure on the free nodes, the load that it carries, and its deflation.

        The load is 0 at a given displacement. The deflation is the displacement by an elastic
        pressure and their product: rounding puts errors along the pressure back into the residual,
        and every correction removes them again (A-DEF2 of Tang, Nabben, Vuik and Erlangga 2009).
        The product is 0 where the displacement is not known, or the load is given.
        """
        patch = self.patch
        base = patch.in_contact(self.pressure)
        if self.load is not None:
            if not base.any():
                base = patch.in_contact(np.ones_like(self.residual))
            return base, float(base.sum(dtype=np.float64)), (base, 0.0)
        if yielded is not None and yielded.any():
            return base, 0.0, (base, 0.0)
        image = patch.in_contact(self.below) - patch.in_contact(self.residual)
        image += np.float32(self.shift) * (1 if image.ndim == 1 else patch.within)
        stiffness = inner(base, image)
        return base, 0.0, (image, stiffness if stiffness > 0 else 0.0)

    def _constrained(
        self,
        correction: Real,
        here: Real,
        base: Real,
        carried: float,
        by: tuple[Real, float],
    ) -> Real:
        """Return a correction that carries no load in all, or is conjugate to the pressure."""
        image, stiffness = by
        if carried:
            correction -= np.float32(correction.sum(dtype=np.float64) / carried) * base
        elif stiffness:
            along = inner(here, base) - inner(correction, image)
            correction += np.float32(along / stiffness) * base
        return correction

    def _has_to_change(
        self,
        pressure: Real,
        yielded: Mask | None,
        floor: float,
        largest: float,
        mean: float,
    ) -> bool:
        """Return whether a set has to change: by tension, penetration outside, excess or
        opening.

        The residual is above its true value by the mean.
        """
        if pressure.min() < 0:
            return True
        outside = self.residual * ~self.patch.contact
        if yielded is None:
            return bool(outside.max() > floor + mean)
        if pressure.max() > self.hardness:
            return True
        if -float((outside * yielded).min()) > max(floor, largest) - mean:
            return True
        return bool((outside * ~yielded).max() > floor + mean)

    def _solve_few_free(self) -> bool:
        """Solve for few free nodes by dense algebra; the residual is left as it is."""
        if not 0 < self.patch.count <= FEW_FREE * self.patch.few:
            return False
        nodes = np.flatnonzero(self.patch.contact)
        try:
            with on_one_blas_thread(), np.errstate(over="raise"):
                factor = ContactFactor(
                    lambda some: self.patch.entries(some, "float64"), nodes
                )
                change = factor.correct(
                    self.residual.reshape(-1).astype(np.float64),
                    None if self.load is None else 0.0,
                )
        except (np.linalg.LinAlgError, FloatingPointError):
            return False
        self.pressure = self.pressure.copy()
        self.pressure.reshape(-1)[nodes] += change
        self.iterations += 1
        return True

    def _between_bounds(self, yielded: Mask | None, *, onwards: bool) -> Field | None:
        """Cut off tension, cap pressures at the hardness, and step ahead on the next set.

        Load that capping takes off goes on the free nodes, as far as scaling them allows. Returns
        the pressure, or None where none is out of bounds.
        """
        patch, pressure = self.patch, self.pressure
        tension = pressure < 0
        excess = self.yields and bool((pressure > self.hardness).any())
        pulled = np.count_nonzero(tension)
        self._tension = pulled / max(patch.count, 1)
        if not (pulled or excess):
            return None
        ahead = np.maximum(pressure, 0)
        if excess and yielded is not None:
            free, factor = np.where(yielded, 0.0, ahead) if yielded.any() else ahead, 1.0
            carried = float(pressure.sum()) - self.hardness * np.count_nonzero(yielded)
            for _ in range(
                4
            ):  # each time more nodes are capped; a few rounds come near enough
                capped = free >= self.hardness / factor
                rest = float((free * ~capped).sum())
                missing = carried - self.hardness * np.count_nonzero(capped)
                if not (rest > 0 and missing > 0):
                    break
                last, factor = factor, min(max(missing / rest, 1.0), LARGEST_SCALE)
                if factor == last:
                    break
            ahead = np.minimum(
                np.where(yielded, self.hardness, factor * free), self.hardness
            )
        following = ((ahead > 0) | (self.residual > 0)) & ~tension
        if self.yields:
            following &= ahead < self.hardness
        patch.take_contact(following)
        if onwards:
            residual = patch.in_contact(self.residual)
            patch.add_to(ahead, np.float32(ADVANCE) * patch.correct(residual))
            np.maximum(ahead, 0, out=ahead)
        if self.yields:
            np.minimum(
                ahead, np.maximum(pressure, BELOW_HARDNESS * self.hardness), out=ahead
            )
        self._admit(ahead)
        return ahead

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

    def _shorten(
        self, pressure: Field, residual: Real, shift: float, solved: Field
    ) -> None:
        """Take a shorter step from an earlier pressure towards the one that equations gave.

        Its length is that of the least energy on the line to the present pressure, but it goes
        along the bounds, so that nodes leave the contact.
        """
        change, image = self.pressure - pressure, residual - self.residual
        if self.load is not None:
            image = image + np.float32(self.shift - shift)
        slope, curvature = inner(residual, change), inner(change, image)
        step = min(max(slope / curvature, 0.0), 1.0) if curvature > 0 else 1.0
        self.pressure = np.clip(pressure + step * (solved - pressure), 0, self.limit)
        self._admit(self.pressure)
        self.shift = shift
        self.residual = residual - self.patch.displace(self.pressure - pressure)
        if self._soft:
            self._rescale()

    def _descend(self) -> None:
        """Take projected gradients, of which each lowers the energy for certain."""
        self.exact = False
        for _ in range(SAFE_STEPS):
            ahead = self._projected(self.pressure + self.residual / self.patch.norm)
            change = ahead - self.pressure
            image = self.patch.displace(change)
            if not (inner(self.residual, change) > 0 and inner(change, image) > 0):
                return
            self.residual -= image
            self.pressure = ahead
            if self.load is not None:
                self._balance(self.residual)

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
            within = np.clip(mixed + price, 0, self.limit)
            price = price + mixed - within
            if number % CHECKED == 0 and within.any():
                self.patch.convolutions += CHECKED
                self.pressure = within.copy()
                if self.yields:
                    self._snap(self.pressure, CLOSE)
                self.renew()
                if max(self.violation()) <= self.tolerance:
                    break
        return True

    def _projected(self, pressure: Field) -> Field:
        """Return the nearest pressure between the bounds that carries the load."""
        if self.load is None:
            return np.clip(pressure, 0, self.limit)
        cut = cut_to_load(pressure, self.load, self.limit)
        self._admit(cut)
        return cut
