"""One active set for all contacts: 0 <= p <= P at a given displacement, or under a given load.

The gap is w = H p - u - s, with the interference u and the displacement s of the far field, and the
residual -w is the penetration. Where p = 0 the gap is open, w >= 0. Between the bounds it is
closed, w = 0. Where p is the hardness P the body has yielded, w <= 0. Elastic bodies have P = inf.

This is a semi-smooth Newton method (Hintermueller, Ito and Kunisch 2002) in rounds. Nodes are open,
free (between the bounds) or yielded. A round takes these sets from the present pressure and
residual, solves the equations of the free nodes loosely by preconditioned conjugate gradients, and
brings pressures back between the bounds. Rounds end when the sets no longer change and the residual
is small.

A given load fixes the sum of all corrections, and s follows from the balance of the free nodes
(projected conjugate gradients: Gould, Hribar and Nocedal 2001). At a given displacement corrections
are kept conjugate to the pressure (deflation: Nicolaides 1987).

The solution has the least energy: p H p / 2 - p u under a given load, p H p / 2 - p (u + s) at a
given displacement. Where rounds no longer come nearer to equilibrium, a round that would raise the
energy is shortened. Where this is not enough, projected gradients lower the energy for certain
(Bertsekas 1976), so that every solve ends.

Each constant says how far it moves the counts of the ledger when it is halved or doubled, with the
command that shows it. It "matters little" if no count moves by more than 5 %, and "matters in rare
cases" if no solve of the ledger depends on it.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from bem.arrays import Field, Mask, Nodes, Real, Values
from bem.dense import MOST_SETS, ContactFactor
from bem.iterate import (
    BELOW_HARDNESS,
    CERTAIN,
    CLOSE,
    Iterate,
    State,
    cut_to_load,
    inner,
)
from bem.operators.filters import filtered
from bem.progress import Progress
from bem.threads import on_one_blas_thread

# Share of the preconditioned residual that is added when pressures are brought back between the
# bounds [1]: all of it would put too many nodes into contact. Solves take up to 21 % more
# iterations if it is halved or doubled (`python -m tests.ledger --halved bem.active_set.ADVANCE`).
ADVANCE = 0.5

# Share of the tolerance that rounds aim at [1], so that an exact residual also meets it. Solves
# take up to 11 % more iterations if it is halved, and do not converge if it is doubled
# (`python -m tests.ledger --halved bem.active_set.AIM`).
AIM = 0.9

# Residual at which the conjugate gradients of a round end, over the violation that the round aims
# at [1]. Solves take up to 9 % more iterations if it is halved, and up to three times the
# convolutions if it is doubled (`python -m tests.ledger --doubled bem.active_set.REACHED`).
REACHED = 0.8

# Number of steps of conjugate gradients without a smaller residual after which a stage ends: single
# precision then allows no smaller one, because a step usually halves the residual. This number
# matters in rare cases.
STAGNANT = 30

# Largest violation before a round, in the unit of displacement, at which the round ends with an
# exact residual instead of one in single precision, if the exact one is needed next anyway. This
# number matters little.
POLISHED = 0.02

# Largest share of the contact nodes that may leave in one round where a displacement barely fixes
# the load [1]. This number matters in rare cases.
MOST_LEAVING = 0.4

# Largest number of steps of projected gradients between two rounds, where rounds no longer come
# nearer to equilibrium. This number matters in rare cases.
SAFE_STEPS = 4

# Least gap of yielded nodes that are freed, as a share of the largest gap of yielded nodes [1].
# Freeing all of them at once raises the load too far, and the sets cycle. Solves with a hardness
# take up to 8 % fewer iterations if it is halved, and up to 8 % more if it is doubled
# (`python -m tests.ledger --halved bem.active_set.FREED`).
FREED = 0.1

# `FREED` while rounds come nearer to equilibrium too slowly [1]. This number matters in rare cases.
FREED_SLOWLY = 0.7

# Largest share of the contact nodes under tension in the last round at which yielded nodes are
# freed although the free nodes are further from equilibrium [1]. More tension means too much load,
# under which gaps open everywhere. This number matters little.
LITTLE_TENSION = 0.1

# Largest factor on the free pressures, which makes up for the load that capping takes off the
# capped nodes [1]. This number matters little.
LARGEST_SCALE = 2.0

# Largest number of passes that scale the free pressures after capping: each pass caps more nodes,
# and a few passes come near enough to the load. This number matters little.
CAPPINGS = 4

# Number of open nodes, with the smallest gaps, that are factorised together with a contact set,
# over the number of nodes of this set [1]. Solves take up to 14 % more iterations if it is doubled
# (`python -m tests.ledger --doubled bem.active_set.SPARE`).
SPARE = 0.08

# Largest number of exact residuals that dense algebra computes before rounds take over. This number
# matters little.
RENEWALS = 5

# Largest set of nodes with a factor in double precision, over the largest set worth factorising
# [1]. Double precision saves a convolution at the end (`pytest bench -k few_in_contact`). This
# number matters little.
DOUBLE_SHARE = 0.5

# Factor by which `solve_on` reduces the residual between two checks of single precision [1]. This
# number matters in rare cases.
LINEAR_REDUCTION = 0.1

# Largest number of exact residuals that `solve_on` computes. This number matters in rare cases.
LINEAR_RENEWALS = 8

# Largest number of free nodes of bodies that yield, over the largest set worth factorising, for
# which a factor replaces conjugate gradients [1]. Solves with a hardness take up to 14 % more
# convolutions if it is halved, and up to 19 % fewer, but larger factors, if it is doubled (`python
# -m tests.ledger --halved bem.active_set.FEW_FREE`).
FEW_FREE = 0.4

# Over-relaxation of splitting: weight of its unbounded pressure in the mean with its pressure
# between the bounds, whose weight is 1 less this one, and so negative [1]. This number matters in
# rare cases.
OVER = 1.6

# Number of passes of splitting between two exact residuals. This number matters in rare cases.
CHECKED = 10

# Largest number of passes of splitting, over the bound on iterations [1]. A pass takes about a
# quarter of the time of a step of conjugate gradients with its preconditioner. This number matters
# in rare cases.
PASSES = 4


class Solved(NamedTuple):
    """Result of solving the equations of the free nodes, beside the iterate's new pressure.

    Attributes
    ----------
    pressure_of_residual : ndarray, shape (nx, ny)
        Pressure to which the iterate's residual belongs [reduced]. After dense algebra it is the
        pressure before, because dense algebra does not update the residual. Otherwise it is the
        iterate's pressure.
    remaining : float
        Largest residual of the free nodes; inf if it was not computed [unit of displacement].
    dense : bool
        Whether the equations were solved by dense algebra.
    """

    pressure_of_residual: Field
    remaining: float
    dense: bool


class Goals(NamedTuple):
    """Goals of a stage of conjugate gradients: when it checks its sets, and when it ends.

    Attributes
    ----------
    reduction : float
        Factor by which the residual falls between two checks of the sets [1].
    floor : float
        Residual at or below which the stage ends [unit of displacement].
    """

    reduction: float
    floor: float


@dataclass(frozen=True, eq=False)
class Constraint:
    """Condition on corrections of the pressure: keep the load, or be conjugate to the pressure.

    Without a load or an image, there is no condition. Arrays are values in contact, see
    `Patch.in_contact`.

    Attributes
    ----------
    base : ndarray of float32
        Pressure on the free nodes at the start of the stage [reduced]. If the load is given and
        this pressure is zero everywhere, 1 on each of these nodes.
    carried : float
        Sum of `base` if the load is given; 0 at a given displacement [reduced].
    image : ndarray of float32, or None
        Displacement by `base` [unit of displacement]; None if the load is given, the displacement
        is not known, or its inner product with `base` is not above 0.
    stiffness : float
        Inner product of `base` and `image`, above 0; 0 if `image` is None.
    """

    base: Real
    carried: float
    image: Real | None = None
    stiffness: float = 0.0

    @property
    def keeps_load(self) -> bool:
        """Whether the load is given, so that corrections have to carry no load in all."""
        return self.carried != 0

    def mean(self, residual: Real) -> float:
        """Compute the mean of a residual, weighted by `base`.

        Parameters
        ----------
        residual : ndarray of float32
            Residual in contact [unit of displacement].

        Returns
        -------
        float
            Mean under a given load, 0 at a given displacement [unit of displacement].
        """
        if not self.keeps_load:
            return 0.0
        return inner(self.base, residual) / self.carried

    def applied(self, correction: Real, residual: Real) -> Real:
        """Apply the constraint to a correction of the pressure, in place.

        Parameters
        ----------
        correction : ndarray of float32
            Correction in contact; overwritten [reduced].
        residual : ndarray of float32
            Residual in contact that the correction was made for [unit of displacement].

        Returns
        -------
        ndarray of float32
            `correction`. If the load is given, it now carries no load in all. At a given
            displacement it now removes the component of the residual along `base`, and is otherwise
            conjugate to `base`. If neither a load nor an image is known, it is unchanged.
        """
        if self.keeps_load:
            excess = correction.sum(dtype=np.float64) / self.carried
            correction -= np.float32(excess) * self.base
        elif self.image is not None:
            along = inner(residual, self.base) - inner(correction, self.image)
            correction += np.float32(along / self.stiffness) * self.base
        return correction


class _Directions:
    """Conjugate search directions of one stage, and the change of pressure along them.

    Arrays are values in contact, see `Patch.in_contact`.
    """

    def __init__(self, constraint: Constraint, *, singular: bool, longest: float) -> None:
        """Begin without a direction; no node may change by more than `longest` in a step.

        `longest` is a pressure [reduced], inf for no bound. `singular` says whether a uniform
        pressure of the free nodes displaces none of them.
        """
        self.constraint = constraint
        self.singular = singular
        self.longest = longest
        self.direction: Real = np.zeros(constraint.base.shape, np.float32)
        self.change: Real = np.zeros(constraint.base.shape, np.float32)
        # Product of the last residual and its correction. It is infinite before the first one, so
        # that no earlier direction is kept.
        self.product = math.inf
        self.shortened = False  # whether `longest` has cut off the last step

    @property
    def pressure(self) -> Real:
        """Pressure on the free nodes after the steps so far [reduced]."""
        pressure: Real = self.constraint.base + self.change
        return pressure

    def turn(self, correction: Real, residual: Real) -> None:
        """Replace the direction by a residual's correction, made conjugate to earlier directions.

        `residual` belongs to the free nodes. `correction` is the preconditioned residual, to which
        the constraint is applied in place.
        """
        correction = self.constraint.applied(correction, residual)
        product = inner(residual, correction)
        self.direction *= np.float32(product / self.product)
        self.direction += correction
        self.product = product

    def length(self, displaced: Real) -> np.float32 | None:
        """Return the length of the next step, in units of the direction; set `shortened`.

        It is the length of the least energy, cut off so that no node changes by more than
        `longest`. Return None, and leave `shortened` as it is, where the product or the curvature
        is not above 0, so that only rounding is left. `displaced` is the displacement by the
        direction, on the free nodes.
        """
        curvature = inner(self.direction, displaced)
        if not (self.product > 0 and curvature > 0):  # also where one is nan
            return None
        full = self.product / curvature
        length = np.float32(full)
        if self.longest < math.inf:
            length = min(length, np.float32(self.longest / np.abs(self.direction).max()))
        # By the factor 0.999, rounding to single precision is not taken for a cut.
        self.shortened = bool(length < full * 0.999)
        return length


def _largest(values: Real) -> float:
    """Return the largest absolute value of an array: 0 if it is empty, nan if it holds a nan."""
    if not values.size:
        return 0.0
    return max(float(values.max()), -float(values.min()))


class _Watch:
    """Decides by the residual when a stage ends, and when its sets are checked."""

    def __init__(self, goals: Goals, iterations: int) -> None:
        """Begin a stage; `iterations` is the solve's number of iterations before it."""
        self._goals = goals
        # Residual at which sets are checked next; None before the first residual.
        self._next_check: float | None = None
        self._least = math.inf  # smallest residual of the stage
        self._least_at = (
            iterations  # the solve's number of iterations when it was reached
        )

    def has_ended(self, largest: float, iterations: int) -> bool:
        """Note the largest residual of the free nodes, and return whether the stage has ended.

        It ends where this residual is at most the floor, is nan, or has not become smaller for
        `STAGNANT` iterations. `iterations` is the solve's number of iterations so far.
        """
        if largest < self._least:
            self._least = largest
            self._least_at = iterations
        above = largest > self._goals.floor  # False where the residual is nan
        return not above or iterations - self._least_at >= STAGNANT

    def is_due(self, largest: float) -> bool:
        """Return whether sets have to be checked now that the largest residual is `largest`.

        If so, set the residual of the next check. The first residual of a stage only sets it.
        """
        if self._next_check is None:
            self._next_check = self._goals.reduction * largest
        if largest > self._next_check:
            return False
        self._next_check = max(
            self._goals.reduction * self._next_check, self._goals.floor
        )
        return True


class ActiveSet:
    """Takes an `Iterate` to equilibrium: by dense algebra on few nodes, or in rounds.

    Parameters
    ----------
    iterate : Iterate
        The pressure to begin with. Solves change this object, and leave the result in it.

    Attributes
    ----------
    iterate : Iterate
        The present pressure.
    stalled : bool
        Whether `run` ended because rounding leaves no step that would come nearer to equilibrium.
    """

    def __init__(self, iterate: Iterate) -> None:
        self.iterate = iterate
        self.stalled = False
        self._patch = iterate.patch
        self._tension = 0.0  # share of the contact that the last round left under tension

    # Dense algebra

    def settle_few(self) -> bool:
        """Solve by dense algebra if few nodes are in contact and bodies have not yielded.

        Returns
        -------
        bool
            Whether the tolerance is met and no pressure exceeds the hardness. If the tolerance is
            not met, the iterate holds either the pressure before or the last one that was tried,
            whichever is nearer to equilibrium. If it is met, but a pressure exceeds the hardness,
            the iterate holds this elastic solution. False also if nothing was tried.
        """
        iterate = self.iterate
        if iterate.yields or iterate.iterations >= iterate.max_iterations:
            return False
        candidates = self._candidates()
        if candidates is None:
            return False
        before = iterate.state()
        largest = iterate.violation().largest
        try:
            with on_one_blas_thread(), np.errstate(over="raise"):
                settled = self._settle(candidates)
        except (np.linalg.LinAlgError, FloatingPointError):
            settled = False
        if not settled and not iterate.violation().largest <= largest:
            iterate.restore(before)
        return settled and not iterate.pressure.max() > iterate.hardness

    def _candidates(self) -> Nodes | None:
        """Return the (n,) flat indices of nodes that may be in contact; None if too many or none.

        They are the nodes that touch, followed by open nodes with the smallest gaps, whose number
        is set by `SPARE`. If all of these are too many to factorise, nodes that penetrate without
        any pressure are not taken for nodes that touch. At a given displacement, the result is None
        if the nodes that touch are too many even without the open ones.
        """
        iterate = self.iterate
        few = self._patch.few
        touching = iterate.touching()
        number = np.count_nonzero(touching)
        if number * (1 + SPARE) > few:
            if iterate.load is None and number > few:
                return None
            # Under a load, most nodes that penetrate without any pressure will leave again.
            touching = iterate.pressure > 0
        nodes = np.flatnonzero(touching)
        number_spare = min(math.ceil(SPARE * nodes.size), touching.size - nodes.size)
        if not 0 < nodes.size <= few - number_spare:
            return None
        gaps = np.where(touching, np.inf, -iterate.residual).reshape(-1)
        spare: Nodes = nodes[:0]
        if number_spare < gaps.size:
            spare = np.argpartition(gaps, number_spare)[:number_spare]
        return np.concatenate([nodes, spare])

    def _settle(self, nodes: Nodes) -> bool:
        """Solve on a set of nodes, then check all nodes; return whether the tolerance is met.

        If nodes outside the set penetrate, factorise again on all nodes that touch. Otherwise
        correct the rounding. The iterate then holds the last pressure that was tried. LinAlgError
        and FloatingPointError pass through.
        """
        iterate = self.iterate
        interference = (iterate.below + iterate.given_shift).reshape(-1)
        factor = None
        for _ in range(RENEWALS):
            if factor is None:
                if not self._may_factorise(nodes):
                    return False
                factor = self._factor(nodes)
                values = self._solved_densely(factor, interference)
                if values is None:
                    return False
            else:
                values = self._corrected_densely(factor)
            iterate.pressure = np.zeros(iterate.below.shape)
            iterate.pressure.reshape(-1)[factor.nodes] = np.maximum(values, 0)
            iterate.renew()
            if iterate.violation().largest <= iterate.tolerance:
                return True
            touching = np.flatnonzero(iterate.touching())
            if not np.isin(touching, factor.nodes, assume_unique=True).all():
                nodes = touching
                factor = None
        return False

    def _may_factorise(self, nodes: Nodes) -> bool:
        """Return whether `nodes` are few enough to factorise, and an iteration is left."""
        few_enough = nodes.size <= self._patch.few
        return few_enough and self.iterate.iterations < self.iterate.max_iterations

    def _factor(self, nodes: Nodes) -> ContactFactor:
        """Factorise the matrix of some nodes, in double precision if they are few.

        The nodes are ordered by falling pressure, then by falling penetration. Raise LinAlgError if
        the matrix is not positive definite in its precision.
        """
        iterate = self.iterate
        order = np.lexsort((-iterate.residual.flat[nodes], -iterate.pressure.flat[nodes]))
        precision = "float32"
        if nodes.size <= DOUBLE_SHARE * self._patch.few:
            precision = "float64"
        return ContactFactor(partial(self._patch.entries, dtype=precision), nodes[order])

    def _solved_densely(
        self, factor: ContactFactor, interference: Values
    ) -> Values | None:
        """Return the pressure on the nodes of a factor; None if its contact sets do not settle.

        The factor may lose nodes: the pressure belongs to `factor.nodes` after the call.
        `interference` is flat, of the whole grid. Each set that was tried is counted as an
        iteration. The solution's shift is not needed, because `Iterate.renew` balances anew.
        LinAlgError passes through.
        """
        iterate = self.iterate
        sets = min(MOST_SETS, iterate.max_iterations - iterate.iterations)
        solution = factor.solve(interference, iterate.load, sets)
        iterate.iterations += solution.sets
        if not solution.settled:
            return None
        return solution.pressure

    def _corrected_densely(self, factor: ContactFactor) -> Values:
        """Return the present pressure on the nodes of a factor, with its residual removed.

        LinAlgError passes through.
        """
        iterate = self.iterate
        pressure = iterate.pressure.reshape(-1)[factor.nodes]
        residual = iterate.residual.reshape(-1)
        return pressure + factor.correct(residual, iterate.load_of_change)

    # Rounds

    def run(self) -> bool:
        """Solve in rounds from the present pressure.

        The residual has been recomputed from the pressure when this returns.

        Returns
        -------
        bool
            Whether the tolerance is met. If not, there are three possible reasons: rounding allows
            no smaller violation (then `stalled` is True), the bound on iterations is reached, or
            numbers are nan.
        """
        iterate = self.iterate
        progress = Progress(iterate.violation())
        if iterate.exact:
            progress.renewed = progress.largest
        while True:
            if self._has_to_yield(progress.largest):
                iterate.let_yield()
                progress.note_yielding(iterate.violation())
            floor = max(AIM * iterate.tolerance, progress.resolved)
            # Rounds that take no iteration are bounded too.
            steps = max(iterate.iterations, progress.rounds)
            out_of_steps = steps >= iterate.max_iterations
            if progress.largest > floor and not out_of_steps:
                self._take_round(progress, floor)
            else:
                if not iterate.exact:
                    iterate.renew()
                    progress.note_renewal(iterate.violation())
                self.stalled = progress.stalled
                met = progress.largest <= iterate.tolerance
                if met or self.stalled or out_of_steps or math.isnan(progress.largest):
                    return met
            progress.rounds += 1

    def _has_to_yield(self, largest_violation: float) -> bool:
        """Return whether bodies that were taken for elastic are certain to exceed the hardness.

        They are as soon as the largest violation [unit of displacement] is so small that a pressure
        above the hardness will stay there.
        """
        iterate = self.iterate
        taken_for_elastic = iterate.hardness < math.inf and not iterate.yields
        displacement = max(iterate.shift, iterate.least_displacement)
        near_solution = largest_violation <= CERTAIN * displacement
        if not (taken_for_elastic and near_solution):
            return False
        return bool(iterate.pressure.max() > iterate.hardness)

    def _take_round(self, progress: Progress, floor: float) -> None:
        """Take one round, and note its results in `progress`.

        If rounds no longer come nearer to equilibrium, splitting or, on a free patch, projected
        gradients come first. `floor` is the largest violation that the round aims at
        [unit of displacement].
        """
        iterate = self.iterate
        if progress.impatient:
            if not self._split():
                self._descend()
            progress.restore_patience()
            progress.next_set_taken = False
        yielded = self._take_sets(progress, floor)
        # Single precision may not show that the tolerance is met.
        exact_is_next = progress.resolved > iterate.tolerance / 2
        next_set_taken = self._solve_round(
            yielded,
            Goals(reduction=progress.reduction, floor=REACHED * floor),
            damped=iterate.soft or progress.to_be_damped,
            polishing=exact_is_next and progress.largest <= POLISHED,
        )
        progress.note_round(
            iterate.violation(),
            energy=iterate.energy(),
            exact=iterate.exact,
            next_set_taken=next_set_taken,
        )

    def _take_sets(self, progress: Progress, floor: float) -> Mask | None:
        """Set the free nodes as the patch's contact set, and return the mask of the yielded nodes.

        The mask is None for elastic bodies. The last round may already have taken the next set
        (`progress.next_set_taken`). Elastic bodies under a given load then keep this set. Of
        yielding bodies, only nodes of this set and nodes under pressure are then free, so that sets
        do not flicker. Unless nodes have yielded, the pressure is rescaled for a new set
        (`Iterate.rescale`).

        Yielded nodes with the widest gaps become free if the gap of a yielded node exceeds `floor`
        [unit of displacement], and either this gap is the largest violation or little of the
        contact was under tension (`LITTLE_TENSION`).
        """
        iterate = self.iterate
        patch = self._patch
        if not iterate.yields:
            keeps_set = progress.next_set_taken and iterate.load is not None
            if not keeps_set:
                patch.take_contact(iterate.touching())
                iterate.rescale()
            return None
        violation = progress.violation
        yielded: Mask = iterate.pressure >= iterate.hardness
        opens_most = violation.opening >= max(violation.penetration, violation.gap)
        may_free = opens_most or self._tension <= LITTLE_TENSION
        if violation.opening > floor and may_free:  # free the nodes with the widest gaps
            share = FREED_SLOWLY if progress.slow else FREED
            yielded &= iterate.residual >= -np.float32(share * violation.opening)
        free = iterate.touching() & ~yielded
        if progress.next_set_taken:
            free &= patch.contact | (iterate.pressure > 0)
        patch.take_contact(free)
        if not yielded.any():
            iterate.rescale()
        return yielded

    def _solve_round(
        self, yielded: Mask | None, goals: Goals, *, damped: bool, polishing: bool
    ) -> bool:
        """Solve loosely on the free nodes, and bring their pressure back between the bounds.

        Return whether a pressure was out of bounds. Then the patch's contact set already is the set
        of the next round, else it is still the set of this one.

        The new residual is exact if bodies are elastic, a pressure was out of bounds, and either
        `polishing` is set or the round is likely the last. Otherwise it is in single precision, and
        with `damped` a step to a changed pressure is shortened if it raises the energy.
        """
        iterate = self.iterate
        before = None  # unless damped, nothing is kept, to save memory
        energy = 0.0
        if damped:
            before = self._copied_state()
            energy = iterate.energy()
        iterate.exact = False
        solved = self._solve_equations(yielded, goals, before)
        bounded = self._between_bounds(yielded, advances=not solved.dense)
        next_set_taken = bounded is not None
        if bounded is None:
            if not solved.dense:  # neither pressure nor residual have to change
                return False
            bounded = iterate.pressure
        iterate.pressure = bounded
        # The free nodes meet the tolerance; a damped step may yet be shortened.
        is_last = solved.remaining <= iterate.tolerance and not damped
        if (polishing or is_last) and not iterate.yields:
            iterate.renew()
            return next_set_taken
        self._update_residual(solved, free_memory=not (damped or solved.dense))
        if before is not None and iterate.energy() > energy:
            target = bounded if solved.dense else solved.pressure_of_residual
            self._shorten(before, target)
        if iterate.load is not None:
            iterate.balance(iterate.residual)
        return next_set_taken

    def _solve_equations(
        self, yielded: Mask | None, goals: Goals, before: State | None
    ) -> Solved:
        """Solve the equations of the free nodes, whatever the bounds; change the pressure.

        Few free nodes of bodies that yield are solved by dense algebra, all others loosely by
        conjugate gradients. Where the displacement barely fixes the load, and `before` is given, go
        back towards the state `before` if much of the contact would leave.
        """
        iterate = self.iterate
        pressure_before = iterate.pressure
        if iterate.yields and self._solve_few_free():
            return Solved(
                pressure_of_residual=pressure_before, remaining=math.inf, dense=True
            )
        remaining = self._solve_free(yielded, goals)
        if iterate.soft and before is not None:
            self._hold_back(before)
        return Solved(
            pressure_of_residual=iterate.pressure, remaining=remaining, dense=False
        )

    def _update_residual(self, solved: Solved, *, free_memory: bool) -> None:
        """Update the residual from `solved.pressure_of_residual` to the present pressure.

        This takes one convolution. With `free_memory`, `solved.pressure_of_residual` is overwritten
        to save memory. Where the displacement barely fixes the load, the pressure is rescaled too.
        """
        iterate = self.iterate
        buffer = None
        if free_memory:
            buffer = solved.pressure_of_residual
        change = np.subtract(iterate.pressure, solved.pressure_of_residual, out=buffer)
        iterate.residual -= self._patch.displace(change)
        if iterate.soft:
            iterate.rescale()

    def _copied_state(self) -> State:
        """Return the present state, and give the iterate copies of its arrays to change."""
        iterate = self.iterate
        state = State(
            pressure=iterate.pressure,
            residual=iterate.residual.copy(),
            shift=iterate.shift,
        )
        iterate.pressure = iterate.pressure.copy()
        return state

    def _hold_back(self, before: State) -> None:
        """Go back towards an earlier state until at most `MOST_LEAVING` of the contact leaves.

        Where a displacement barely fixes the load, the equations of a contact set that is too large
        may put all of it under tension. Pressure and residual are replaced.
        """
        iterate = self.iterate
        leaving = iterate.pressure < 0
        allowed = int(MOST_LEAVING * self._patch.count)
        if np.count_nonzero(leaving) <= allowed:
            return
        loaded = before.pressure[leaving]
        leaves_at = loaded / (loaded - iterate.pressure[leaving])  # share of the step
        step = float(np.partition(leaves_at, allowed)[allowed])
        iterate.pressure = before.pressure + step * (iterate.pressure - before.pressure)
        iterate.residual = before.residual + np.float32(step) * (
            iterate.residual - before.residual
        )

    def _shorten(self, before: State, target: Field) -> None:
        """Replace the present pressure by a shorter step from an earlier state towards `target`.

        The share of the step is that of the least energy on the line from the earlier to the
        present pressure. After conjugate gradients, `target` is their pressure, which may be out of
        bounds: the step is cut off at the bounds, so that nodes leave the contact. After dense
        algebra, `target` is between the bounds. Residual and shift are updated, by one convolution.
        """
        iterate = self.iterate
        change = iterate.pressure - before.pressure
        image = before.residual - iterate.residual
        if iterate.load is not None:
            image = image + np.float32(iterate.shift - before.shift)
        slope = inner(before.residual, change)
        curvature = inner(change, image)
        step = 1.0
        if curvature > 0:
            step = min(max(slope / curvature, 0.0), 1.0)
        shortened = before.pressure + step * (target - before.pressure)
        iterate.pressure = np.clip(shortened, 0, iterate.limit)
        iterate.admit(iterate.pressure)
        iterate.shift = before.shift
        iterate.residual = before.residual - self._patch.displace(
            iterate.pressure - before.pressure
        )
        if iterate.soft:
            iterate.rescale()

    # Equations of the free nodes

    def solve_on(self, nodes: Mask, atol: float) -> float:
        """Solve the equations of some nodes alone, whatever the bounds.

        The iterate then holds the pressure and its exact residual. The nodes become the patch's
        contact set.

        Parameters
        ----------
        nodes : ndarray of bool, shape (nx, ny)
            Mask of the nodes that are displaced by u + s. The pressure of all other nodes has to be
            zero, and stays so.
        atol : float
            Largest absolute residual that is accepted [unit of displacement].

        Returns
        -------
        float
            Largest absolute residual of these nodes; above `atol`, or nan, if the equations were
            not solved [unit of displacement].
        """
        goals = Goals(reduction=LINEAR_REDUCTION, floor=atol / 2)
        self._patch.take_contact(nodes)
        remaining = math.inf
        for _ in range(LINEAR_RENEWALS):
            self._solve_free(None, goals, checks_sets=False)
            self.iterate.renew()
            remaining = float(np.abs(self.iterate.residual[nodes]).max())
            if not remaining > atol:  # also where it is nan
                break
        return remaining

    def _solve_free(
        self, yielded: Mask | None, goals: Goals, *, checks_sets: bool = True
    ) -> float:
        """Run conjugate gradients on the free nodes, and change the iterate's pressure.

        They end by the goals, where only rounding is left, or when no iteration is left. With
        `checks_sets`, they also end where the sets have to change, which is checked whenever the
        residual has fallen by the goals' reduction. The residual of all nodes is updated, because
        the convolution yields it at no extra cost; under a given load the shift is updated too.

        Return the last residual of the free nodes that was measured, by its largest absolute value;
        inf if no iteration was left at the start [unit of displacement].
        """
        iterate = self.iterate
        constraint = self._constraint(yielded)
        # On all nodes of a patch without edges a uniform pressure displaces nothing. Unless the
        # load fixes the mean pressure, steps may go far, and are cut off at the hardness.
        singular = iterate.load is None and self._patch.singular
        longest = iterate.hardness if singular and iterate.yields else math.inf
        directions = _Directions(constraint, singular=singular, longest=longest)
        watch = _Watch(goals, iterate.iterations)
        largest = math.inf
        while iterate.iterations < iterate.max_iterations:
            free, mean = self._free_residual(constraint)
            largest = _largest(free)
            if watch.has_ended(largest, iterate.iterations):
                break
            is_due = watch.is_due(largest)
            if checks_sets and is_due:
                pressure = directions.pressure
                if self._has_to_change(pressure, yielded, goals.floor, largest, mean):
                    break
            if not self._step(directions, free):
                break
        if constraint.keeps_load:  # balance the free nodes
            mean = constraint.mean(self._patch.in_contact(iterate.residual))
            iterate.residual -= np.float32(mean)
            iterate.shift -= mean
        self._patch.add_to(iterate.pressure, directions.change)
        return largest

    def _step(self, directions: _Directions, free: Real) -> bool:
        """Take one step of conjugate gradients from the residual `free` of the free nodes.

        The step changes the iterate's residual and `directions.change`, and is an iteration. Return
        whether the stage goes on. It ends where rounding leaves no step. Where the matrix is
        singular, it also ends after a step that was cut off or has put nodes under tension.
        """
        iterate = self.iterate
        patch = self._patch
        directions.turn(patch.correct(free), free)
        displaced = patch.displace(directions.direction)
        length = directions.length(patch.in_contact(displaced))
        if length is None:
            return False
        displaced *= length
        iterate.residual -= displaced
        directions.change += length * directions.direction
        iterate.iterations += 1
        if not directions.singular:
            return True
        return not (directions.shortened or directions.pressure.min() < 0)

    def _free_residual(self, constraint: Constraint) -> tuple[Real, float]:
        """Return the residual of the free nodes less its mean, and this mean.

        The residual has the form of `Patch.in_contact`, and the mean is weighted by the pressure
        [unit of displacement]. At a given displacement nothing is subtracted: the mean is 0.
        """
        free = self._patch.in_contact(self.iterate.residual)
        mean = constraint.mean(free)
        if constraint.keeps_load:
            self._patch.add_constant(free, -np.float32(mean))
        return free, mean

    def _constraint(self, yielded: Mask | None) -> Constraint:
        """Return the constraint that corrections of the free pressures have to keep.

        At a given displacement, rounding puts errors along the pressure back into the residual.
        Every correction removes them again (A-DEF2 of Tang, Nabben, Vuik and Erlangga 2009). If
        nodes have yielded there is no condition, because the displacement by the free nodes alone
        is not known. Neither is there one where the pressure does no work above 0.
        """
        iterate = self.iterate
        patch = self._patch
        base = patch.in_contact(iterate.pressure)
        if iterate.load is not None:
            if not base.any():
                base = patch.in_contact(np.ones_like(iterate.residual))
            carried = float(base.sum(dtype=np.float64))
            return Constraint(base=base, carried=carried)
        if yielded is not None and yielded.any():
            return Constraint(base=base, carried=0.0)
        # H p is u + s less the residual.
        image = patch.in_contact(iterate.below) - patch.in_contact(iterate.residual)
        patch.add_constant(image, np.float32(iterate.shift))
        stiffness = inner(base, image)
        if not stiffness > 0:
            return Constraint(base=base, carried=0.0)
        return Constraint(base=base, carried=0.0, image=image, stiffness=stiffness)

    def _has_to_change(
        self,
        pressure: Real,
        yielded: Mask | None,
        floor: float,
        largest: float,
        mean: float,
    ) -> bool:
        """Return whether the sets have to change during a stage.

        They have to if a free node is under tension or beyond the hardness, if an open node
        penetrates by more than `floor`, or if a yielded node opens by more than both `floor` and
        `largest`. Under a given load, they also have to if `mean` is below -`floor` or, where
        bodies may yield, above both `floor` and `largest`.

        `pressure` is the pressure of the free nodes, in the form of `Patch.in_contact` [reduced].
        `largest` is the largest absolute residual of the free nodes, and `mean` the amount by which
        the iterate's residual exceeds the residual in balance. `floor`, `largest` and `mean` are in
        the unit of displacement.
        """
        if pressure.min() < 0:
            return True
        # It is zero on the free nodes, and these zeros take part in each maximum and minimum below.
        # So a `mean` far enough from 0 answers True even if no node outside is in the wrong set.
        outside = self.iterate.residual * ~self._patch.contact
        if yielded is None:
            return bool(outside.max() > floor + mean)
        if pressure.max() > self.iterate.hardness:
            return True
        if -float((outside * yielded).min()) > max(floor, largest) - mean:
            return True
        return bool((outside * ~yielded).max() > floor + mean)

    def _solve_few_free(self) -> bool:
        """Solve the equations of the free nodes by dense algebra if these nodes are few.

        Return whether they were solved, which is an iteration. If so, the iterate's pressure is a
        new array, and the iterate's residual still belongs to the old one.
        """
        iterate = self.iterate
        if not 0 < self._patch.count <= FEW_FREE * self._patch.few:
            return False
        nodes = np.flatnonzero(self._patch.contact)
        try:
            with on_one_blas_thread(), np.errstate(over="raise"):
                factor = ContactFactor(
                    partial(self._patch.entries, dtype="float64"), nodes
                )
                change = factor.correct(
                    iterate.residual.reshape(-1).astype(np.float64),
                    iterate.load_of_change,
                )
        except (np.linalg.LinAlgError, FloatingPointError):
            return False
        iterate.pressure = iterate.pressure.copy()
        iterate.pressure.reshape(-1)[nodes] += change
        iterate.iterations += 1
        return True

    # Bounds

    def _between_bounds(self, yielded: Mask | None, *, advances: bool) -> Field | None:
        """Return the present pressure brought between the bounds, as a new array.

        Return None where no pressure is out of bounds. Otherwise tension is cut off, pressures are
        capped at the hardness, and the next set becomes the patch's contact set. With `advances`,
        a share of the preconditioned residual on the next set is added (`ADVANCE`). The result
        carries the load if one is given. The iterate's pressure is not changed. `_tension` is set
        in any case.
        """
        iterate = self.iterate
        patch = self._patch
        pressure = iterate.pressure
        tension = pressure < 0
        excess = iterate.yields and bool((pressure > iterate.hardness).any())
        number_under_tension = np.count_nonzero(tension)
        self._tension = number_under_tension / max(patch.count, 1)
        if not (number_under_tension or excess):
            return None
        bounded = np.maximum(pressure, 0)
        if excess and yielded is not None:
            bounded = self._capped(bounded, yielded)
        next_set = ((bounded > 0) | (iterate.residual > 0)) & ~tension
        if iterate.yields:
            next_set &= bounded < iterate.hardness
        patch.take_contact(next_set)
        if advances:
            correction = patch.correct(patch.in_contact(iterate.residual))
            patch.add_to(bounded, np.float32(ADVANCE) * correction)
            np.maximum(bounded, 0, out=bounded)
        if iterate.yields:  # the added share makes no further node yield
            highest = np.maximum(pressure, BELOW_HARDNESS * iterate.hardness)
            np.minimum(bounded, highest, out=bounded)
        iterate.admit(bounded)
        return bounded

    def _capped(self, pressure: Field, yielded: Mask) -> Field:
        """Return a pressure, which is nowhere negative, capped at the hardness.

        The nodes of the mask `yielded` get the hardness. Load that capping takes off is moved to
        the free nodes, as far as scaling their pressures by at most `LARGEST_SCALE` allows.
        """
        iterate = self.iterate
        hardness = iterate.hardness
        free = pressure
        if yielded.any():
            free = np.where(yielded, 0.0, pressure)
        load_of_yielded = hardness * np.count_nonzero(yielded)
        load_of_free = float(iterate.pressure.sum()) - load_of_yielded
        factor = 1.0
        for _ in range(CAPPINGS):
            capped = free >= hardness / factor
            scaled_load = float((free * ~capped).sum())
            missing = load_of_free - hardness * np.count_nonzero(capped)
            if not (scaled_load > 0 and missing > 0):
                break
            last = factor
            factor = min(max(missing / scaled_load, 1.0), LARGEST_SCALE)
            if factor == last:
                break
        return np.minimum(np.where(yielded, hardness, factor * free), hardness)

    # Safe steps

    def _descend(self) -> None:
        """Take `SAFE_STEPS` steps of projected gradients, each of which lowers the energy.

        They end early where rounding leaves no step. Pressure, residual and shift are updated.
        """
        iterate = self.iterate
        iterate.exact = False
        for _ in range(SAFE_STEPS):
            # A step over the largest eigenvalue of H cannot go too far.
            projected = self._projected(
                iterate.pressure + iterate.residual / self._patch.norm
            )
            change = projected - iterate.pressure
            image = self._patch.displace(change)
            if not (inner(iterate.residual, change) > 0 and inner(change, image) > 0):
                return
            iterate.residual -= image
            iterate.pressure = projected
            if iterate.load is not None:
                iterate.balance(iterate.residual)

    def _projected(self, pressure: Field) -> Field:
        """Return the nearest pressure between the bounds, which carries the load if it is given."""
        iterate = self.iterate
        if iterate.load is None:
            return np.clip(pressure, 0, iterate.limit)
        projected = cut_to_load(pressure, iterate.load, iterate.limit)
        iterate.admit(projected)
        return projected

    def _split(self) -> bool:
        """Solve a patch without edges by splitting; do nothing on a free patch.

        Return whether the patch has no edges, not whether the tolerance is met.

        Splitting is the alternating direction method of multipliers, which has no sets that could
        cycle. It minimises the energy in turn over all pressures, by one Fourier transform each
        way, and over the pressures between the bounds. It converges from any start because the
        energy is convex (Boyd, Parikh, Chu, Peleato and Eckstein 2011, Foundations and Trends in
        Machine Learning 3, sections 3.2 and 3.4.3). It ends at the tolerance, or at a bound on the
        passes. The iterate then holds the pressure of the last check, with its exact residual; it
        is unchanged if there was no check.
        """
        splitting = self._patch.splitting()
        if splitting is None:
            return False
        inverse, penalty = splitting
        iterate = self.iterate
        interference = iterate.below + iterate.given_shift
        within = iterate.pressure  # between the bounds
        # Scaled multiplier of the equality unbounded = within.
        price = iterate.residual / penalty
        for number in range(1, PASSES * iterate.max_iterations + 1):
            unbounded = filtered(inverse, interference + penalty * (within - price))
            if iterate.load is not None:
                # A uniform pressure displaces nothing, so this is the minimum under the load.
                missing = iterate.load / unbounded.size - unbounded.mean()
                unbounded = unbounded + missing
            mixed = OVER * unbounded + (1 - OVER) * within
            within = np.clip(mixed + price, 0, iterate.limit)
            price = price + mixed - within
            # Zero pressure is no solution, because the load or the displacement is above zero.
            if number % CHECKED == 0 and within.any() and self._take_and_check(within):
                break
        return True

    def _take_and_check(self, within: Field) -> bool:
        """Give the iterate a pressure of splitting and its exact residual.

        The iterate holds a copy, and where bodies may yield pressures near a bound are set to it
        (`CLOSE`). Return whether the tolerance is met. The passes since the last call are counted
        as convolutions.
        """
        iterate = self.iterate
        self._patch.convolutions += CHECKED
        iterate.pressure = within.copy()
        if iterate.yields:
            iterate.snap(iterate.pressure, CLOSE)
        iterate.renew()
        return iterate.violation().largest <= iterate.tolerance
