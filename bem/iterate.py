"""A pressure on its way to equilibrium, and the operators that the solver applies to it.

All arrays live on a list of m nodes that may touch, in reduced units: displacements are divided by
Delta, and pressures are scaled so that H maps a pressure to a displacement. Nodes outside the list
never carry pressure.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import NamedTuple, Protocol

import numpy as np

from bem.arrays import Mask, Nodes, Real, Values
from bem.factor import ContactFactor
from bem.vectors import combined, each_long, largest_of, room_for, sum_of, where


class Image(Protocol):
    """The (m,) displacement by pressure on some nodes, of which only some entries may be wanted.

    The next use of the operators that it comes from may overwrite it.
    """

    def on_nodes(self, out: Values) -> Values:
        """Return the displacement of the (a,) nodes under that pressure, in `out`."""

    def add_to(self, target: Values, factor: float) -> None:
        """Add a factor times the displacement to an (m,) target."""


class Operators(Protocol):
    """The influence matrix of the m nodes and its approximate inverse.

    Attributes
    ----------
    norm : float
        Upper bound of the matrix's largest eigenvalue.
    few_nodes : int
        Largest contact set whose matrix is worth factorising.
    softening : float
        Compliance of the far field: 0 where it is rigid, near the matrix's own stiffness where
        contacts are nearly singular.
    load : float or None
        Sum of the pressure if it is given, so that the displacement of the far field follows.
    edgeless : bool
        Whether a uniform pressure displaces nothing, so that less load on one node raises others.
    """

    norm: float
    softening: float
    few_nodes: int
    load: float | None
    edgeless: bool

    def among(self, some: Nodes) -> "Operators":
        """Return the operators of some of the nodes alone, on a rigid far field."""

    def under(self, load: float) -> "Operators":
        """Return the operators under a given load, above 0."""

    def displace(self, pressure: Values) -> Values:
        """Compute the (m,) displacement in double precision; it decides on convergence."""

    def displace_some(self, nodes: Nodes | slice, pressure: Values) -> Values:
        """Compute the (m,) displacement by (a,) pressure on some nodes, to 1e-7 or better.

        A slice takes some of the m nodes in their order. The next call may overwrite the result,
        and the list of nodes must not change before it.
        """

    def image_of(self, nodes: Nodes | slice, pressure: Values) -> Image:
        """Compute the same displacement without gathering it."""

    def approximate_inverse(self, nodes: Nodes) -> Callable[[Values], Values]:
        """Return a symmetric map (a,) -> (a,) near the inverse of the matrix on these nodes."""

    def factor(self, nodes: Nodes) -> ContactFactor:
        """Factorise the matrix of these nodes on a rigid far field.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the matrix is not positive definite in the precision chosen.
        """


class Effort(NamedTuple):
    """The work that a solve has taken; efforts add up.

    Attributes
    ----------
    iterations : int
        Steps of conjugate gradients, and contact sets of dense algebra.
    convolutions : int
        Applications of the influence matrix.
    """

    iterations: int = 0
    convolutions: int = 0

    def __add__(self, other: "Effort") -> "Effort":  # type: ignore[override]
        """Return the sum of both efforts."""
        return Effort(self.iterations + other.iterations, self.convolutions + other.convolutions)


ITERATION = Effort(iterations=1)
CONVOLUTION = Effort(convolutions=1)
STEP = ITERATION + CONVOLUTION

# Entries of a vector from which on inner products add up its pieces: shorter ones are single sums,
# whose last bits are those of before.
LONG = 10**6

# Share of a load that is lost to rounding when the nodes that carry it are counted.
ROUNDING = 1e-12


@dataclass
class Iterate:
    """A pressure on the nodes that may touch, and its distance from equilibrium.

    Attributes
    ----------
    pressure : ndarray, shape (m,)
        Reduced pressure, not negative between the steps.
    residual : ndarray, shape (m,)
        Interference plus `shift` less displacement: zero in contact, negative where a gap is open.
    effort : Effort
        Work so far.
    exact : bool
        Whether the residual has been recomputed in double precision from this pressure, rather
        than updated in working precision.
    shift : float
        Displacement of the far field in addition to the interference; 0 unless the load is given.
    stalled : bool
        Whether rounding leaves no step that would come nearer to equilibrium.
    """

    pressure: Values
    residual: Values
    effort: Effort = field(default_factory=Effort)
    exact: bool = False
    shift: float = 0.0
    stalled: bool = False

    @staticmethod
    def from_zero(interference: Values) -> "Iterate":
        """Return the iterate without any pressure, whose residual is the interference."""
        return Iterate(np.zeros_like(interference), interference.copy())

    def contact(self) -> Nodes:
        """Return the nodes under pressure and the nodes that would penetrate."""
        pressure, residual = self.pressure, self.residual
        return where(lambda piece: (pressure[piece] > 0) | (residual[piece] > 0), pressure.size)

    def energy(self, interference: Values) -> float:
        """Compute p H p / 2 - p u in reduced units.

        The solution has the least energy of all p >= 0, or of all that carry a given load.
        """
        energy = -_inner_with(self.pressure, np.add, interference, self.residual) / 2
        return energy + self.shift * float(self.pressure.sum()) / 2 if self.shift else energy

    def violation(self) -> float:
        """Return the largest |w| in contact or -w outside; it is zero for the exact solution."""

        def measure(piece: slice) -> float:
            residual = self.residual[piece]
            in_contact = residual * (self.pressure[piece] > 0)
            largest = np.maximum.reduce(residual, initial=0.0)
            return max(float(largest), -float(np.minimum.reduce(in_contact, initial=0.0)))

        return largest_of(measure, self.residual.size)

    def renew(self, operators: Operators, interference: Values) -> None:
        """Scale the pressure to the load if one is given, then recompute the residual."""
        carried = float(self.pressure.sum())
        if operators.load is not None and carried > 0:
            self.pressure *= operators.load / carried
        displacement = operators.displace(self.pressure)
        self.residual = combined(np.subtract, interference, displacement, displacement)
        self.shift = 0.0
        self.effort += CONVOLUTION
        self.exact = True
        if operators.load is not None and carried > 0:
            self.level(self.pressure, self.residual)

    def level(self, weights: Values, residual: Values) -> None:
        """Shift the far field so that the weighted mean of the residual is zero.

        With the pressure as weights, this is the displacement that leaves the least error in the
        energy for the present pressure.

        Parameters
        ----------
        weights, residual : ndarray, shape (a,)
            Weights and residual of the nodes in contact.
        """
        mean = inner(weights, residual) / float(weights.sum())
        self.residual -= mean
        self.shift -= mean


def rescale(operators: Operators, interference: Values, iterate: Iterate) -> None:
    """Multiply the pressure by the factor that gives the least energy, or the given load."""
    if operators.load is None:
        stiffness = _inner_with(iterate.pressure, np.subtract, interference, iterate.residual)
        if stiffness > 0:
            factor = inner(iterate.pressure, interference) / stiffness
            _scale(iterate, interference, factor)
        return
    image = interference - iterate.residual
    carried = float(iterate.pressure.sum())
    if not carried > 0:
        iterate.pressure[:] = operators.load / iterate.pressure.size
        iterate.renew(operators, interference)
        return
    factor = operators.load / carried
    iterate.pressure *= factor
    iterate.residual = interference - factor * (image + iterate.shift)
    iterate.shift = 0.0
    iterate.level(iterate.pressure, iterate.residual)


def inner(a: Real, b: Real) -> float:
    """Compute an inner product without BLAS, whose threads would change its last bits.

    That of long vectors adds up pieces, which do not depend on the number of threads.
    """
    if a.size < LONG:
        return float(np.einsum("i,i->", a, b))
    return sum_of(lambda piece: float(np.einsum("i,i->", a[piece], b[piece])), a.size)


def _inner_with(a: Values, by: np.ufunc, b: Values, c: Values) -> float:
    """Compute the inner product of a with a function of b and c, piece by piece if it is long."""
    if a.size < LONG:
        return inner(a, combined(by, b, c))

    def measure(piece: slice) -> float:
        both = room_for(piece)
        by(b[piece], c[piece], out=both)
        return float(np.einsum("i,i->", a[piece], both))

    return sum_of(measure, a.size)


def _scale(iterate: Iterate, interference: Values, factor: float) -> None:
    """Multiply the pressure by a factor, and update the residual."""
    pressure, residual = iterate.pressure, iterate.residual

    def run(piece: slice) -> None:
        here, image = residual[piece], room_for(piece)
        pressure[piece] *= factor
        np.subtract(interference[piece], here, out=image)
        image *= factor
        np.subtract(interference[piece], image, out=here)

    each_long(run, pressure.size)


@dataclass
class YieldingIterate(Iterate):
    """A pressure that a hardness bounds from above.

    Attributes
    ----------
    hardness : float
        Largest pressure [reduced].
    yielded : ndarray of bool, shape (m,)
        Nodes whose pressure is the hardness: known loads. The others are free.
    """

    hardness: float = np.inf
    yielded: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))

    @classmethod
    def above(cls, iterate: Iterate, hardness: float) -> "YieldingIterate":
        """Take over an elastic iterate, none of whose nodes has yielded yet."""
        taken = {name.name: getattr(iterate, name.name) for name in fields(Iterate)}
        yielded = np.zeros(iterate.pressure.size, dtype=bool)
        return cls(**taken, hardness=hardness, yielded=yielded)

    def contact(self) -> Nodes:
        """Return the free nodes that are under pressure or would penetrate."""
        return np.flatnonzero(((self.pressure > 0) | (self.residual > 0)) & ~self.yielded)

    def violation(self) -> float:
        """Return the largest |w| between the bounds, -w without pressure, or w at the hardness."""
        penetration = float(self.residual.max(initial=0.0, where=~self.yielded))
        gap = -float(self.residual.min(initial=0.0, where=self.pressure > 0))
        return max(penetration, gap)

    def opening(self) -> float:
        """Return the largest gap of a yielded node, whose pressure ought to be lower."""
        return -float(self.residual.min(initial=0.0, where=self.yielded))

    def depth(self) -> float:
        """Return the largest penetration of a yielded node, by which the body has yielded."""
        return float(self.residual.max(initial=0.0, where=self.yielded))

    def excess(self) -> float:
        """Return how far the free pressure exceeds the hardness, over the hardness [1]."""
        excess = float(self.pressure.max(initial=0.0, where=~self.yielded)) / self.hardness - 1
        return excess if excess > ROUNDING else 0.0

    def join(self) -> None:
        """Let the nodes at or above the hardness yield."""
        self.yielded = self.yielded | (self.pressure >= self.hardness)
        self.pressure[self.yielded] = self.hardness

    def release(self, rtol: float, *, least: float, at_once: bool) -> None:
        """Free the yielded nodes whose gap is open.

        Parameters
        ----------
        rtol : float
            Largest gap that is accepted.
        least : float
            Least gap of a node that is released, as a share of the largest.
        at_once : bool
            Whether not to wait until the free nodes are nearer to equilibrium than these.
        """
        opening = self.opening()
        if opening <= rtol:
            return
        penetration = float(self.residual.max(initial=0.0, where=~self.yielded))
        free_gap = -float(self.residual.min(initial=0.0, where=(self.pressure > 0) & ~self.yielded))
        settled = max(penetration, free_gap) <= opening and not self.excess() > 0
        if at_once or settled:
            self.yielded = self.yielded & (self.residual >= -least * opening)

    def balance(self, load: float) -> None:
        """Scale the free pressure so that all of the pressure adds up to a load.

        Where the yielded nodes alone carry the load or more, those that penetrate the least are
        freed until some load is left for the free nodes, which tell the displacement of the far
        field. So a load that is a whole multiple of the hardness keeps one node free, whose
        pressure may turn out to be the hardness. Where no free node is under pressure, those next
        to touch are given some.
        """
        most = math.ceil(load / self.hardness * (1 - ROUNDING)) - 1
        if np.count_nonzero(self.yielded) > most:
            deepest = np.argsort(np.where(self.yielded, -self.residual, np.inf), kind="stable")
            self.yielded = np.zeros_like(self.yielded)
            self.yielded[deepest[:most]] = True
        left = load - self.hardness * int(np.count_nonzero(self.yielded))
        left = self.hardness if abs(left - self.hardness) <= ROUNDING * load else left
        free = ~self.yielded
        carried = float(self.pressure[free].sum())
        if carried > 0:
            self.pressure[free] *= left / carried
        else:
            outside = np.flatnonzero(free)
            many = min(2 * int(left / self.hardness) + 1, outside.size)
            nearest = outside[np.argsort(-self.residual[outside], kind="stable")[:many]]
            self.pressure[nearest] = left / max(many, 1)

    def renew(self, operators: Operators, interference: Values) -> None:
        """Balance the pressure with the load if one is given, then recompute the residual."""
        if operators.load is not None:
            self.balance(operators.load)
        self.residual = interference - operators.displace(self.pressure)
        self.shift = 0.0
        self.effort += CONVOLUTION
        self.exact = True
        self.follow(operators)

    def follow(self, operators: Operators) -> None:
        """Shift the far field, under a given load, so that the free nodes are in balance."""
        if operators.load is not None:
            self.level(np.where(self.yielded, 0.0, np.maximum(self.pressure, 0)), self.residual)


def scaled_to_carry(pressure: Values, load: float, hardness: float, largest: float) -> Values:
    """Scale a pressure by a factor of at least one so that it carries a load although capped.

    Parameters
    ----------
    pressure : ndarray, shape (a,)
        Pressure, not negative.
    load : float
        Wanted sum of the capped pressure.
    hardness : float
        Largest pressure.
    largest : float
        Largest factor.

    Returns
    -------
    ndarray, shape (a,)
        The scaled and capped pressure.
    """
    factor = 1.0
    for _ in range(4):  # each time more nodes are capped; a few rounds come near enough
        capped = factor * pressure >= hardness
        rest = float(pressure[~capped].sum())
        left = load - hardness * int(np.count_nonzero(capped))
        if not (rest > 0 and left > 0):
            break
        factor = min(max(left / rest, 1.0), largest)
    return np.minimum(factor * pressure, hardness)
