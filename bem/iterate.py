"""A pressure on its way to equilibrium: its residual, its violations, its bounds, first steps.

The gap is w = H p - u - s, with the influence matrix H, the pressure p, the interference u and the
displacement s of the far field. The residual is -w: penetration where it is positive. An `Iterate`
holds a pressure with its residual. It brings pressures to bounds and load, balances the far field,
and takes the first steps. `bem.active_set` takes it to equilibrium.

Constants say how far they move the counts of the ledger, see `bem.active_set`.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bem.arrays import Field, Mask, Nodes, Real, Values
from bem.operators.patch import Patch

# Largest pressure that adding a preconditioned residual, or scaling to a load, gives to a node that
# has not yielded, over the hardness [1]. Both overestimate pressures; conjugate gradients decide
# which nodes yield. Solves with a hardness take up to 14 % more iterations if it is halved or
# doubled (`python -m tests.ledger --halved bem.iterate.BELOW_HARDNESS`).
BELOW_HARDNESS = 0.9999

# Share of a first step's load on nodes at the hardness above which the step is damped instead of
# scaled [1]. Solves with a hardness take up to 6 % fewer iterations if it is halved
# (`python -m tests.ledger --halved bem.iterate.MOSTLY_CAPPED`).
MOSTLY_CAPPED = 0.9

# Least factor by which a first step with nodes at the hardness is scaled [1]: a smaller one would
# take these nodes too far below the hardness. Solves with a hardness take up to 16 % more
# iterations if it is doubled (`python -m tests.ledger --doubled bem.iterate.LEAST_SCALE`).
LEAST_SCALE = 0.8

# Largest share of the first step's load above the hardness with which bodies are still taken for
# elastic [1]. This number matters little.
MOSTLY_ELASTIC = 0.02

# Largest violation, over the displacement s, at which a pressure above the hardness is certain to
# stay there [1]. Bodies that were taken for elastic then yield. This number matters little.
CERTAIN = 1e-2

# Violation, over the displacement s, at or below which `Iterate.approach` ends [1]. Ladders take up
# to 8 % fewer iterations if it is halved, and up to 11 % more if it is doubled
# (`python -m tests.ledger --halved bem.iterate.NEAR`).
NEAR = 5e-3

# Another step of `Iterate.approach` is taken only if a step leaves less than this share of the
# violation [1]. Each step costs a convolution, and a stage of conjugate gradients about twice as
# much. Solves under a load take up to 43 % more iterations if it is halved, and up to 15 % more
# convolutions if it is doubled (`python -m tests.ledger --halved bem.iterate.NEARER`).
NEARER = 0.8

# Largest number of first steps. Solves take up to 56 % more iterations if it is halved, and up to
# 66 % more convolutions if it is doubled
# (`python -m tests.ledger --halved bem.iterate.FIRST_STEPS`).
FIRST_STEPS = 4

# Largest number of first steps from an interpolated pressure. Solves of large grids take up to 17 %
# more iterations if it is halved, and up to 11 % more convolutions if it is doubled
# (`python -m tests.ledger --halved bem.iterate.INTERPOLATED_STEPS`).
INTERPOLATED_STEPS = 3

# Share of the preconditioned residual that a first step from a given pressure adds on a free patch
# [1]. Solves under a load take up to 18 % more iterations if it is halved, and up to 55 % more if
# it is doubled (`python -m tests.ledger --halved bem.iterate.APPROACH_FREE`).
APPROACH_FREE = 0.55

# `APPROACH_FREE` for a patch without edges, in the limit of a small contact [1]; larger contacts
# interpolate between this and `APPROACH_FULL`. Solves under a load take up to 8 % more iterations
# if it is halved, and up to 36 % more if it is doubled
# (`python -m tests.ledger --halved bem.iterate.APPROACH_SMALL`).
APPROACH_SMALL = 0.6

# `APPROACH_FREE` for a patch without edges with a full contact [1]. Solves near full contact take
# up to 19 % more convolutions if it is halved, and up to 42 % more iterations if it is doubled
# (`python -m tests.ledger --halved bem.iterate.APPROACH_FULL`).
APPROACH_FULL = 0.8

# Distance from the hardness, over the hardness, within which a start lets bodies yield, and a
# pressure of splitting is set to the hardness [1]. A pressure of splitting that is this near to
# zero is set to zero. This number matters in rare cases.
CLOSE = 1e-9

# Share of a load, or of the hardness, below which a difference from it is taken for rounding [1].
# This number matters little.
LOST = 1e-11

# Largest number of passes that scale the free pressures to a load: each pass takes more nodes to
# the limit `BELOW_HARDNESS`. This number matters little.
SCALINGS = 6

# Largest number of bisections for the constant that `cut_to_load` subtracts: enough for all digits
# of double precision. This number matters in rare cases.
BISECTIONS = 60


@dataclass(frozen=True)
class Effort:
    """The work that a solve has taken.

    Attributes
    ----------
    iterations : int
        Number of steps of conjugate gradients, plus sets tried by dense algebra.
    convolutions : int
        Number of applications of the influence matrix.
    """

    iterations: int = 0
    convolutions: int = 0

    def __add__(self, other: "Effort") -> "Effort":
        """Return the sum of both efforts."""
        return Effort(
            iterations=self.iterations + other.iterations,
            convolutions=self.convolutions + other.convolutions,
        )


class Violation(NamedTuple):
    """The largest departures of a pressure from equilibrium, none negative [unit of displacement].

    Attributes
    ----------
    penetration : float
        Largest penetration of nodes below the hardness.
    gap : float
        Largest gap of nodes that are under pressure and below the hardness.
    opening : float
        Largest gap of nodes at the hardness, whose pressure ought to be lower.
    """

    penetration: float
    gap: float
    opening: float

    @property
    def largest(self) -> float:
        """Largest of the three departures [unit of displacement]."""
        return max(self.penetration, self.gap, self.opening)


@dataclass(frozen=True, eq=False)
class State:
    """A pressure with its residual and shift, to which a solve may go back.

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure [reduced].
    residual : ndarray of float32, shape (nx, ny)
        Its residual [unit of displacement].
    shift : float
        Displacement s of the far field [unit of displacement].
    """

    pressure: Field
    residual: Real
    shift: float


class Iterate:
    """A pressure on all nodes of a grid on its way to equilibrium.

    Displacements have any unit of length. Pressures are reduced: in this unit times E* over the
    first side of a cell.

    Parameters
    ----------
    patch : Patch
        The influence matrix.
    below : ndarray, shape (nx, ny)
        Interference u at s = 0: heights less the highest one [unit of displacement].
    shift : float or None
        Displacement s of the far field; None if the load is given [unit of displacement].
    load : float or None
        Sum of the pressure, above 0; None if the displacement is given [reduced].
    hardness : float
        Largest pressure P, inf for elastic bodies [reduced].
    rtol : float
        Largest violation that is accepted, over the displacement s [1].
    max_iterations : int
        Bound on the iterations.
    least_displacement : float
        Displacement that the tolerance refers to as long as s is not above zero
        [unit of displacement].

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure, between the bounds whenever a method of this class returns [reduced].
    residual : ndarray of float32, shape (nx, ny)
        u + s - H p: zero in contact, negative where a gap is open [unit of displacement].
    shift : float
        Displacement s of the far field [unit of displacement].
    yields : bool
        Whether bodies may yield. Until this is set they are taken for elastic, and pressures may
        exceed the hardness.
    limit : float
        Upper bound of the pressure now: the hardness if `yields`, else inf [reduced].
    displacement : ndarray, shape (nx, ny), or None
        H p of the last exact residual, to be read only while `exact` [unit of displacement]. It is
        a view into the buffer of the patch's filter: the next exact displacement by this patch, or
        by another one with the same filter, overwrites it. Copy it to keep it.
    iterations : int
        Number of steps of conjugate gradients, plus sets tried by dense algebra.
    exact : bool
        Whether the residual was computed in double precision from this pressure.
    soft : bool
        Whether the displacement may barely fix the load, so that steps have to be damped. False
        under a given load, and once bodies may yield.
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
        max_iterations: int,
        least_displacement: float = 0.0,
    ) -> None:
        self.patch = patch
        self.below = below
        self.load = load
        self.hardness = hardness
        self.rtol = rtol
        self.max_iterations = max_iterations
        self.least_displacement = least_displacement
        self.yields = False
        self.limit = math.inf
        self.soft = load is None and patch.soft
        self.pressure = np.zeros(below.shape)
        self.shift = shift or 0.0
        self.residual: Real = np.add(
            below, self.shift, dtype=np.float32, casting="same_kind"
        )
        self.displacement: Field | None = None
        self.iterations = 0
        self.exact = False

    def expect_yielding(self) -> None:
        """Let bodies yield from now on: set `yields` and `limit`, unset `soft`.

        The pressure is not cut off.
        """
        self.yields = True
        self.limit = self.hardness
        self.soft = False

    # Measures of the present pressure

    @property
    def tolerance(self) -> float:
        """Largest violation that is accepted [unit of displacement].

        It is relative to s, or to `least_displacement` as long as s is not above zero.
        """
        if self.shift > 0:
            return self.rtol * self.shift
        return self.rtol * self.least_displacement

    @property
    def given_shift(self) -> float:
        """Displacement s of the far field if it is given, else 0 [unit of displacement]."""
        return self.shift if self.load is None else 0.0

    @property
    def load_of_change(self) -> float | None:
        """Load that changes of pressure carry: 0 under a given load, else None [reduced]."""
        return None if self.load is None else 0.0

    def violation(self, residual: Real | None = None) -> Violation:
        """Measure the departures of the pressure from equilibrium.

        Parameters
        ----------
        residual : ndarray, shape (nx, ny), optional
            A residual of this pressure in double precision; by default the attribute `residual`,
            in single precision [unit of displacement].

        Returns
        -------
        Violation
            The largest departure of each kind; a nan of the residual may make any of them nan.
        """
        if residual is None:
            residual = self.residual
        loaded = self.pressure > 0
        opening = 0.0
        if self.yields:
            yielded = self.pressure >= self.hardness
            opening = -float((residual * yielded).min())
            penetration = float((residual * ~yielded).max())
            loaded &= ~yielded
        else:
            penetration = float(residual.max())
        gap = -float((residual * loaded).min())
        return Violation(
            penetration=max(penetration, 0.0),
            gap=max(gap, 0.0),
            opening=max(opening, 0.0),
        )

    def worthless(self, farthest: float) -> bool:
        """Return whether zero pressure is a better start than this pressure.

        Parameters
        ----------
        farthest : float
            Largest violation of a start that is better than zero pressure [unit of displacement].

        Returns
        -------
        bool
            True if the pressure does no work on the interference, violates equilibrium by more than
            `farthest`, or is not finite.
        """
        is_useful = self._work() > 0 and self.violation().largest <= farthest
        return not is_useful  # nan is not useful

    def touching(self) -> Mask:
        """Return the (nx, ny) mask of nodes that are under pressure or would penetrate."""
        touching: Mask = (self.pressure > 0) | (self.residual > 0)
        return touching

    def energy(self) -> float:
        """Compute the energy, which is least for the solution [reduced].

        It is p H p / 2 - p u under a given load, and p H p / 2 - p (u + s) at a given displacement.
        """
        # With the residual r = u + s - H p, the energy is
        # -(p u + p r + p s) / 2 at a given displacement, and
        # -(p u + p r - p s) / 2 under a given load, where p s is the load times s.
        far_field_work = self.shift * float(self.pressure.sum())
        if self.load is not None:
            far_field_work = -self.shift * self.load
        work = inner(self.pressure, self.below) + inner(self.pressure, self.residual)
        return -(work + far_field_work) / 2

    def state(self) -> State:
        """Return the pressure, its residual and the shift, as references to the present arrays."""
        return State(pressure=self.pressure, residual=self.residual, shift=self.shift)

    def restore(self, state: State) -> None:
        """Go back to a state; its arrays must not have been overwritten since. Unset `exact`."""
        self.pressure = state.pressure
        self.residual = state.residual
        self.shift = state.shift
        self.exact = False

    def _work(self) -> float:
        """Return p (u + s), the work of the pressure on the interference [reduced]."""
        work = inner(self.pressure, self.below)
        return work + self.shift * float(self.pressure.sum())

    def _excess(self, pressure: Real) -> float:
        """Return the share of a pressure's load above the hardness [1].

        It is 0 if there is no hardness, or no load above 0.
        """
        if self.hardness == math.inf:
            return 0.0
        carried = float(pressure.sum())
        if not carried > 0:
            return 0.0
        return float(np.maximum(pressure - self.hardness, 0).sum()) / carried

    # Starts, exact residuals, and the far field that balances a load

    def begin(self, pressure: Field, displacement: Field | None = None) -> None:
        """Start from a pressure: bring it to the bounds and to the load, and compute its residual.

        Bodies may yield from now on if the pressure reaches the hardness somewhere. Under a given
        load, the shift follows from the balance of the free nodes. `exact` is unset.

        Parameters
        ----------
        pressure : ndarray, shape (nx, ny)
            Pressure, nowhere negative; it is copied [reduced].
        displacement : ndarray, shape (nx, ny), optional
            Displacement H p by this pressure, which saves a convolution if all of it is finite and
            bodies do not yield. If it is passed under a given load, the pressure must be above
            zero somewhere [unit of displacement].
        """
        if float(pressure.max()) >= self.hardness * (1 - CLOSE):
            self.expect_yielding()
        self.exact = False
        self.pressure = np.minimum(pressure, self.limit)
        carried = float(self.pressure.sum())
        self.admit(self.pressure)
        if displacement is None or self.yields or not np.isfinite(displacement).all():
            displacement = self.patch.displace(self.pressure)
        elif self.load is not None:  # `admit` has scaled the pressure by this factor
            displacement = displacement * (self.load / carried)
        self.residual = np.empty(self.below.shape, np.float32)
        np.subtract(self.below, displacement, out=self.residual, casting="same_kind")
        if self.load is None:
            self.residual += np.float32(self.shift)
        else:
            self.shift = 0.0
            self.balance(self.residual)

    def renew(self) -> None:
        """Bring the pressure to the load, and compute its residual in double precision.

        The pressure is changed in place; it has to be between the bounds. Under a given load, the
        shift follows from the balance of the free nodes. `displacement` and `exact` are set, and
        the displacement of earlier calls is overwritten.
        """
        self.admit(self.pressure)
        self.displacement = self.patch.displace(self.pressure, exactly=True)
        residual = self.below - self.displacement
        if self.load is None:
            residual += self.shift
        else:
            self.shift = 0.0
            self.balance(residual)
        self.residual = residual.astype(np.float32)
        self.exact = True

    def let_yield(self) -> None:
        """Let bodies yield from now on: cut the pressure off, and bring it to the load.

        Set `yields` and `limit`, and unset `soft` and `exact`. The residual is updated by one
        convolution, and the shift too if the load is given.
        """
        self.expect_yielding()
        before = self.pressure
        self.pressure = np.minimum(self.pressure, self.hardness)
        self.admit(self.pressure)
        self.residual = self.residual - self.patch.displace(self.pressure - before)
        self.exact = False
        if self.load is not None:
            self.balance(self.residual)

    def balance(self, residual: Real) -> None:
        """Shift the far field under a given load so that the free nodes are in balance.

        The mean of the residual, weighted by the pressure of the free nodes, is subtracted from the
        residual, in place, and from `shift`.

        Where all nodes in contact have yielded, more than one displacement is in balance, and the
        least one without a gap in contact is taken. If nodes outside the contact would penetrate
        there, yielded nodes have to give load to them. The displacement is then halfway between
        this one and the one at which no node outside penetrates.

        Parameters
        ----------
        residual : ndarray, shape (nx, ny)
            Residual of the present pressure, in any precision [unit of displacement].
        """
        weights = self.pressure
        if self.yields:
            weights = np.where(weights < self.hardness, weights, 0.0)
        carried = float(weights.sum())
        if carried > 0:
            mean = inner(weights, residual) / carried
        else:  # all nodes in contact have yielded
            loaded = self.pressure > 0
            least_inside = float(residual.min(where=loaded, initial=math.inf))
            largest_outside = float(residual.max(where=~loaded, initial=-math.inf))
            mean = least_inside
            if largest_outside > least_inside:
                mean = (least_inside + largest_outside) / 2
        residual -= residual.dtype.type(mean)
        self.shift -= mean

    # Pressures between the bounds that carry the load

    def admit(self, pressure: Field) -> None:
        """Bring a pressure to the load if one is given, in place.

        If the pressure is zero everywhere, the load is spread evenly over all nodes. Elastic
        pressures are scaled. If bodies may yield, only the pressures of free nodes are scaled, and
        load that they cannot take is moved to the smallest gaps of the present `residual`, which
        may belong to an earlier pressure. Pressures within rounding of zero or of the hardness are
        then set to this bound.

        Parameters
        ----------
        pressure : ndarray, shape (nx, ny)
            Pressure between the bounds [reduced].
        """
        if self.load is not None:
            carried = float(pressure.sum())
            if not carried > 0:
                pressure[:] = self.load / pressure.size
            elif self.yields:
                self._carry_within(pressure, self.load)
            else:
                pressure *= self.load / carried
        if self.yields:
            self.snap(pressure, LOST)

    def snap(self, pressure: Field, share: float) -> None:
        """Set pressures near zero or below to zero, and others near the hardness or above to it.

        The pressure is changed in place.

        Parameters
        ----------
        pressure : ndarray, shape (nx, ny)
            Pressure [reduced].
        share : float
            Distance that is near, over the hardness [1].
        """
        pressure[pressure < share * self.hardness] = 0
        pressure[pressure > (1 - share) * self.hardness] = self.hardness

    def _carry_within(self, pressure: Field, load: float) -> None:
        """Bring a pressure to a load by scaling its free nodes, in place.

        Yielded nodes stay at the hardness, unless they carry too much alone. Load that the free
        nodes cannot take is added where gaps are smallest.
        """
        flat = pressure.reshape(-1)
        loaded = np.flatnonzero(flat)
        values = self._scaled(flat[loaded], loaded, load)
        flat[loaded] = values
        missing = load - float(values.sum())
        if missing > LOST * load:
            self._add_next(flat, missing)

    def _scaled(self, values: Values, nodes: Nodes, load: float) -> Values:
        """Scale the pressures of free nodes so that all values carry a load, in place.

        Scaling takes a free node at most to `BELOW_HARDNESS`. Yielded nodes stay at the hardness;
        where they carry too much alone, load is taken off all values instead, at the widest gaps
        first.

        Parameters
        ----------
        values : ndarray, shape (n,)
            Pressures of free and yielded nodes, all above zero; overwritten [reduced].
        nodes : ndarray, shape (n,)
            Flat indices of their nodes.
        load : float
            Sum that the pressures are to have [reduced].

        Returns
        -------
        ndarray, shape (n,)
            `values`. Their sum is below the load if the free nodes cannot take all of it.
        """
        limit = BELOW_HARDNESS * self.hardness
        for _ in range(SCALINGS):
            yielded = values >= self.hardness
            load_of_yielded = self.hardness * np.count_nonzero(yielded)
            free = values[~yielded]
            load_of_free = float(free.sum())
            remaining = load - load_of_yielded
            if remaining < 0:  # the yielded nodes alone carry too much
                self._take_off(values, nodes, load_of_yielded + load_of_free - load)
                break
            if not load_of_free > 0:  # no node is free
                break
            scaled = free * (remaining / load_of_free)
            highest = np.maximum(free, limit)
            values[~yielded] = np.minimum(scaled, highest)
            if not (scaled > highest).any():  # the load is reached
                break
        return values

    def _take_off(self, values: Values, nodes: Nodes, excess: float) -> None:
        """Take the load `excess` off the (n,) pressures of some nodes, in place.

        Nodes with the widest gaps lose all of their pressure before the next ones lose any.
        `nodes` are flat indices.
        """
        order = np.argsort(self.residual.reshape(-1)[nodes], kind="stable")
        ordered = values[order]
        taken_before = np.cumsum(ordered) - ordered
        values[order] -= np.minimum(ordered, np.maximum(excess - taken_before, 0))

    def _add_next(self, flat: Values, missing: float) -> None:
        """Add the load `missing` to a flat pressure, in place, on nodes below the hardness.

        Nodes with the smallest gaps are loaded up to the hardness before the next ones take any.
        """
        not_yielded = np.flatnonzero(flat < self.hardness)
        gaps = -self.residual.reshape(-1)[not_yielded]
        # Nodes without pressure take the whole hardness; nodes under pressure may take little.
        number_loaded = int(np.count_nonzero(flat[not_yielded]))
        enough = math.ceil(missing / self.hardness) + number_loaded
        if enough < not_yielded.size:  # do not sort all nodes of the grid
            not_yielded = not_yielded[np.argpartition(gaps, enough)[: enough + 1]]
            gaps = -self.residual.reshape(-1)[not_yielded]
        order = not_yielded[np.argsort(gaps, kind="stable")]
        room = self.hardness - flat[order]
        room_before = np.cumsum(room) - room
        flat[order] += np.minimum(room, np.maximum(missing - room_before, 0))

    def rescale(self) -> None:
        """Scale an elastic pressure at a given displacement to the least energy, and its residual.

        Cutting off tension leaves too much load, which shifts the residual of the whole contact.
        The displacement by the pressure follows from the residual, so that this costs no
        convolution. Both arrays are changed in place. Nothing changes under a given load, or where
        no positive factor has the least energy.
        """
        if self.load is not None:
            return
        work = self._work()
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

        Each step costs one convolution. Together they take most nodes that will not touch out of
        contact. Bodies may yield from now on if more than the share `MOSTLY_ELASTIC` of the first
        step's load exceeds the hardness.

        Parameters
        ----------
        enough : float
            Number of nodes in contact up to which no further step is taken.
        """
        residual_of_none = self.residual  # no pressure yet; never changed in place
        for step in range(FIRST_STEPS):
            touching = self.touching()
            if np.count_nonzero(touching) <= enough:
                return
            target = self._corrected(touching)
            if step == 0 and self._excess(target) > MOSTLY_ELASTIC:
                self.expect_yielding()
            np.minimum(target, self.limit, out=target)
            is_last = step == FIRST_STEPS - 1
            if not self._take_first_step(target, residual_of_none, is_last=is_last):
                return
        if self.yields:
            self._cap()

    def _corrected(self, touching: Mask) -> Field:
        """Return the present pressure plus the preconditioned residual, without tension.

        The residual is corrected on the touching nodes that have not yielded, which become the
        patch's contact set. The result is a new array, and may exceed the hardness.
        """
        self.patch.take_contact(touching & (self.pressure < self.limit))
        correction = self.patch.correct(self.patch.in_contact(self.residual))
        corrected = self.pressure.copy()
        self.patch.add_to(corrected, correction)
        return np.maximum(corrected, 0, out=corrected)

    def _take_first_step(
        self, target: Field, residual_of_none: Real, *, is_last: bool
    ) -> bool:
        """Step to the pressure `target`, scaled or damped to the least energy.

        If most of the load of `target` is on nodes at the hardness, the step from the present
        pressure is damped, otherwise `target` is scaled. `residual_of_none` is the residual of zero
        pressure. Return whether there is a step that lowers the energy; else nothing changes.
        """
        load_at_hardness = 0.0
        if self.yields:
            load_at_hardness = float(target.sum(where=target >= self.limit))
        if load_at_hardness > MOSTLY_CAPPED * float(target.sum()):
            return self._step_towards(target)
        least_scale = None
        if load_at_hardness:  # in the last step, nodes at the hardness stay there
            least_scale = 1.0 if is_last else LEAST_SCALE
        return self._scale_to(target, residual_of_none, least_scale)

    def _step_towards(self, target: Field) -> bool:
        """Go to the least energy between the present pressure and the pressure `target`.

        Pressure and residual are replaced. Return False, and change nothing, where rounding leaves
        no step.
        """
        change = target - self.pressure
        image = self.patch.displace(change)
        stiffness = inner(change, image)
        work = inner(self.residual, change)
        if not stiffness > 0:
            return False
        scale = min(max(work / stiffness, 0.0), 1.0)
        self.residual = self.residual - np.float32(scale) * image
        self.pressure = self.pressure + scale * change
        return True

    def _scale_to(
        self, target: Field, residual_of_none: Real, least_scale: float | None
    ) -> bool:
        """Replace the pressure by the multiple of `target` with the least energy.

        The residual follows from `residual_of_none`, the residual of zero pressure. If
        `least_scale` is not None, the factor is kept between it and 1. Return False, and change
        nothing, if no positive factor has the least energy.
        """
        image = self.patch.displace(target)
        stiffness = inner(target, image)
        work = inner(residual_of_none, target)
        if not (stiffness > 0 and work > 0):
            return False
        scale = work / stiffness
        if least_scale is not None:
            scale = min(max(scale, least_scale), 1.0)
        self.residual = residual_of_none - np.float32(scale) * image
        self.pressure = scale * target
        return True

    def _cap(self) -> None:
        """Cut the pressure off at the hardness, in place, and update the residual.

        Pressures that rounding has put below the hardness are set to it. This is too small a change
        for the residual, so that no convolution is needed unless a pressure has been cut off.
        """
        before = self.pressure.copy()
        at_hardness = self.pressure > self.hardness * (1 - LOST)
        self.pressure[at_hardness] = self.hardness
        if (self.pressure < before).any():
            self.residual -= self.patch.displace(self.pressure - before)

    def approach(self, enough: float = 0.0, *, interpolated: bool = False) -> None:
        """Take preconditioned steps between the bounds from the pressure that `begin` was given.

        Steps end when the violation is small, or no longer falls fast. Each step costs one
        convolution, and keeps the load if it is given.

        Parameters
        ----------
        enough : float
            Number of nodes in contact up to which no further step is taken.
        interpolated : bool
            Whether the pressure was interpolated from a coarser grid, so that it is above zero on
            too many nodes. Steps are then taken on the nodes under pressure alone. They continue
            where violations rise, because at first they may.
        """
        largest = self.violation().largest
        steps = INTERPOLATED_STEPS if interpolated else FIRST_STEPS
        for _ in range(steps):
            touching = self.pressure > 0 if interpolated else self.touching()
            if largest <= NEAR * self.shift or np.count_nonzero(touching) <= enough:
                return
            self._approach_on(touching)
            largest_before = largest
            largest = self.violation().largest
            falls_fast = largest < NEARER * largest_before
            if not (interpolated or falls_fast):
                return

    def _approach_on(self, touching: Mask) -> None:
        """Take one preconditioned step on the nodes of an (nx, ny) mask that have not yielded.

        These nodes become the patch's contact set. Pressure, residual and shift are updated.
        """
        patch = self.patch
        before = self.pressure
        patch.take_contact(touching & (before < self.limit))
        share = APPROACH_FREE
        if patch.boundary != "free":
            share = np.interp(
                patch.count, (0, before.size), (APPROACH_SMALL, APPROACH_FULL)
            )
        after = before.copy()
        correction = patch.correct(patch.in_contact(self.residual))
        patch.add_to(after, np.float32(share) * correction)
        self.pressure = np.clip(after, 0, self.limit, out=after)
        self.admit(after)
        change = np.subtract(after, before, out=before)
        self.residual -= patch.displace(change)
        if self.load is not None:
            self.balance(self.residual)
        elif not self.yields:
            self.rescale()


def cut_to_load(pressure: Field, load: float, hardness: float = math.inf) -> Field:
    """Return a pressure less a constant, cut off at the bounds, so that it carries a load.

    Without a hardness, the constant is computed for all nodes, then for the nodes that it leaves
    above zero, and so on until no node drops out (Michelot 1986, Journal of Optimization Theory and
    Applications 50). With a hardness, the constant is found by bisection.

    Parameters
    ----------
    pressure : ndarray of any shape
        Pressure, of any sign [reduced].
    load : float
        Sum of the pressure that is returned, above 0 and below the hardness on all nodes [reduced].
    hardness : float
        Upper bound of the pressure that is returned [reduced].

    Returns
    -------
    ndarray, shape of `pressure`
        Pressure between zero and the hardness [reduced].
    """
    remaining = pressure.reshape(-1)
    while True:
        constant = (float(remaining.sum()) - load) / remaining.size
        above = remaining[remaining > constant]
        if above.size in {0, remaining.size}:
            break
        remaining = above
    if hardness < math.inf:
        constant = _bisected(pressure, load, hardness, constant)
    return np.clip(pressure - constant, 0, hardness)


def _bisected(pressure: Field, load: float, hardness: float, high: float) -> float:
    """Return the constant with which the result of `cut_to_load` carries the load [reduced].

    `high` is an upper bound: the constant without a hardness.
    """
    low = float(pressure.min()) - hardness
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        if not low < middle < high:  # they are neighbouring numbers
            break
        if np.clip(pressure - middle, 0, hardness).sum() > load:
            low = middle
        else:
            high = middle
    return low


def inner(a: Real, b: Real) -> float:
    """Compute the inner product of two arrays, equal to the last bit on any number of threads.

    Fields are summed row by row without BLAS, then over the rows in double precision.

    Parameters
    ----------
    a, b : ndarray, shape (n,) or (nx, ny)
        Arrays of one shape, in any precision.

    Returns
    -------
    float
        Sum of the products of their entries.
    """
    if a.ndim == 1:
        return float(np.add.reduce(a * b, dtype=np.float64))
    products = np.einsum("ij,ij->i", a, b)
    return float(np.add.reduce(products, dtype=np.float64))
