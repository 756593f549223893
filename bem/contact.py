"""Press a rigid rough surface into an elastic half-space: `solve` and the `Contact` it returns."""

from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bem.convolution import displacement_filter
from bem.far_field import critical_delta, flat_punch
from bem.half_space import HalfSpace
from bem.influence import Kernel
from bem.problem import FarField, Field, Problem, pose
from bem.solver import Iterate, solve_complementarity

# Iterations after which a compliant far field is approached by rigid solves, how near they have to
# come over what they have approached, how many they may be, and the longest step between two.
DIRECT_ITERATIONS = 150
APPROACH_RTOL = 1e-2
APPROACH_STEPS = 40
LONGEST_ADVANCE = 0.5


@dataclass(frozen=True, eq=False)
class Contact:
    """Equilibrium of a `Problem`: what `solve` returns.

    Attributes
    ----------
    problem : what was solved
    pressure : (nx, ny) contact pressure, zero out of contact [MPa]
    force : total normal force [uN = MPa um^2]
    area_percent : effective contact area A_e, the share of nodes under pressure [%]
    contact_nodes : number of nodes under pressure
    approach : displacement of the far field in all: Delta, plus F / K if it is compliant [um]
    residual : largest |gap| in contact or penetration outside, over Delta [1]
    iterations : steps of conjugate gradients
    convolutions : applications of the influence matrix
    """

    problem: Problem = field(repr=False)
    pressure: Field = field(repr=False)
    force: float
    area_percent: float
    contact_nodes: int
    approach: float
    residual: float
    iterations: int
    convolutions: int

    @cached_property
    def displacement(self) -> Field:
        """(nx, ny) normal displacement of the half-space's surface [um], one convolution."""
        problem = self.problem
        operator = displacement_filter(self.pressure.shape, problem.kernel, problem.aspect)
        moved: Field = operator(self.pressure) * (problem.spacing[0] / problem.modulus)
        return moved

    @cached_property
    def gap(self) -> Field:
        """(nx, ny) distance left between the surfaces, zero in contact [um]."""
        heights = self.problem.heights
        gap: Field = self.displacement - ((heights - heights.max()) + self.approach)
        return gap

    @property
    def mean_gap(self) -> float:
        """Mean distance between the deformed surfaces over the patch [um]."""
        return float(self.gap.mean())

    @property
    def largest_pressure(self) -> float:
        """Largest contact pressure [MPa]."""
        return float(self.pressure.max())

    @property
    def perimeter(self) -> float:
        """Length of the cell edges between contact and gap; the patch's border is none [um]."""
        touching = self.pressure > 0
        along = np.count_nonzero(touching[1:] != touching[:-1]) * self.problem.spacing[1]
        across = np.count_nonzero(touching[:, 1:] != touching[:, :-1]) * self.problem.spacing[0]
        return float(along + across)


class NotConverged(ArithmeticError):
    """The bound on iterations was met first; `contact` carries the best that was reached."""

    def __init__(self, contact: Contact) -> None:
        self.contact = contact
        super().__init__(
            f"residual {contact.residual:.1e} after {contact.iterations} iterations, asked for"
            f" {contact.problem.rtol:.1e}: raise max_iterations"
            f" ({contact.problem.max_iterations}) or rtol"
        )


class NoSolution(ValueError):
    """A compliant far field at or beyond Delta*, where the force has no bound."""

    def __init__(self, delta: float, critical: float) -> None:
        self.delta = delta
        self.critical_delta = critical
        super().__init__(
            f"delta = {delta:g} um has no equilibrium on a compliant far field: on this surface"
            f" it must stay below Delta* = {critical:.10g} um"
        )


def solve(
    heights: ArrayLike,
    side: float | tuple[float, float],
    delta: float,
    *,
    spacing: float | tuple[float, float] | None = None,
    modulus: float = 1.0,
    poisson: float = 0.0,
    kernel: Kernel = "uniform-pressure",
    far_field: FarField = "rigid",
    rtol: float = 1e-6,
    max_iterations: int = 1000,
) -> Contact:
    """Press a rigid rough surface into an elastic half-space, without friction or adhesion.

    Finds the pressure p >= 0 with gap w = H p - (z - z_max + Delta) >= 0 and p w = 0 (paper,
    section 2.4).

    Parameters
    ----------
    heights : (nx, ny) surface z; its highest node touches at Delta = 0 [um]
    side : scan length L, one for a square patch or one per axis [um]
    delta : far-field displacement Delta; at 0 or below nothing carries load [um]
    spacing : of the nodes, one or one per axis; side / (nodes - 1) unless given, as MIRCO's
        side / nodes [um]
    modulus : Young's modulus E [MPa]
    poisson : Poisson's ratio nu, in (-1, 0.5] [1]
    kernel : "uniform-pressure" (Love 1929), or "concentrated-force", with which MIRCO's results
        are reproduced (see `bem.influence.influence_coefficients`; square cells only)
    far_field : "rigid", Delta as it stands, or "compliant", Delta + F / K with the stiffness K of
        a flat punch that fills the patch (MIRCO)
    rtol : largest |gap| in contact or penetration outside that is accepted, over Delta [1]
    max_iterations : bound on the steps of conjugate gradients, the same on every machine

    Returns
    -------
    Contact

    Raises
    ------
    ValueError
        for input that no contact problem can have; the message names what was given and what is
        allowed
    NoSolution
        for a compliant far field with Delta at or beyond Delta*
    NotConverged
        when `max_iterations` did not suffice; carries the numbers reached
    """
    problem = pose(
        heights,
        side,
        delta,
        spacing=spacing,
        modulus=modulus,
        poisson=poisson,
        kernel=kernel,
        far_field=far_field,
        rtol=rtol,
        max_iterations=max_iterations,
    )
    if problem.delta <= 0:
        return _untouched(problem)
    return _solve_compliant(problem) if far_field == "compliant" else _solve_rigid(problem)


def _solve_rigid(problem: Problem) -> Contact:
    """Solve on the smallest box that holds every node which the undeformed bodies overlap."""
    box = _bounding_box((problem.heights - problem.heights.max()) + problem.delta > 0)
    overlap = ((problem.heights[box] - problem.heights.max()) + problem.delta) / problem.delta
    nodes = np.flatnonzero(overlap > 0)
    operators = HalfSpace(overlap.shape, problem.kernel, problem.aspect, nodes)
    iterate, converged = solve_complementarity(
        operators,
        overlap.reshape(-1)[nodes],
        rtol=problem.rtol,
        max_iterations=problem.max_iterations,
    )
    values = np.zeros(overlap.size)
    values[nodes] = iterate.pressure
    reduced = np.zeros(problem.heights.shape)
    reduced[box] = values.reshape(overlap.shape)
    return _contact(problem, reduced, problem.delta, iterate, converged)


def _solve_compliant(problem: Problem) -> Contact:
    """Solve with the far field inside the operator; any node may come to touch.

    That operator is nearly singular on contact sets much larger than the solution's, on which the
    active set can cycle. If it has not arrived soon, rigid solves bring it near from below.
    """
    critical = critical_delta(problem.heights, problem.kernel, problem.aspect)
    if problem.delta >= critical:
        raise NoSolution(problem.delta, critical)
    shape = problem.heights.shape
    depth = ((problem.heights - problem.heights.max()) / problem.delta).reshape(-1)
    softening = 1 / float(flat_punch(shape, problem.kernel, problem.aspect).sum())
    settings = shape, problem.kernel, problem.aspect, np.arange(depth.size)
    solve_here = partial(
        solve_complementarity, HalfSpace(*settings, softening), depth + 1, rtol=problem.rtol
    )
    soon = min(DIRECT_ITERATIONS, problem.max_iterations)
    iterate, converged = solve_here(max_iterations=soon)
    if not converged and soon < problem.max_iterations:
        left = problem.max_iterations - iterate.iterations
        near = _approach_from_below(left, HalfSpace(*settings), depth, softening)
        near.iterations += iterate.iterations
        near.convolutions += iterate.convolutions
        iterate, converged = solve_here(max_iterations=problem.max_iterations, start=near)
    reduced = iterate.pressure.reshape(shape)
    approach = problem.delta * (1 + softening * float(reduced.sum()))
    return _contact(problem, reduced, approach, iterate, converged)


def _approach_from_below(
    max_iterations: int, rigid: HalfSpace, depth: Field, softening: float
) -> Iterate:
    """A pressure near equilibrium on the compliant far field, with its residual there.

    What is left to approach, 1 + softening sum(p) - approach in units of Delta, falls and is
    convex in the approach: secants through its values never pass the solution.
    """
    solve_rigid = partial(
        solve_complementarity,
        rigid,
        rtol=APPROACH_RTOL / 10,
        max_iterations=max_iterations,
    )
    approach, advance, before = 1.0, 0.0, 0.0
    iterate, converged = solve_rigid(depth + approach)
    for _ in range(APPROACH_STEPS):
        left = 1 + softening * float(iterate.pressure.sum()) - approach
        slope = (left - before) / advance if advance else -1.0
        # Near Delta* the slope is nearly zero and made of rounding: no step may be trusted far.
        advance = min(left / min(max(-slope, 1e-3), 1.0), LONGEST_ADVANCE * approach)
        if abs(advance) <= APPROACH_RTOL * approach or not converged:
            break
        before = left
        approach += advance
        iterate.residual += advance
        iterate, converged = solve_rigid(depth + approach, start=iterate)
    iterate.residual += 1 + softening * float(iterate.pressure.sum()) - approach
    return iterate


def _contact(
    problem: Problem, reduced: Field, approach: float, iterate: Iterate, converged: bool
) -> Contact:
    """Give a reduced pressure its units back; refuse to pass an unconverged one as a result."""
    cell = problem.spacing[0] * problem.spacing[1]
    pressure = reduced * (problem.delta / problem.spacing[0] * problem.modulus)
    touching = int(np.count_nonzero(reduced > 0))
    contact = Contact(
        problem=problem,
        pressure=pressure,
        force=float(reduced.sum()) * (problem.delta / problem.spacing[0] * problem.modulus) * cell,
        area_percent=100.0 * touching / reduced.size,
        contact_nodes=touching,
        approach=approach,
        residual=iterate.violation(),
        iterations=iterate.iterations,
        convolutions=iterate.convolutions,
    )
    if not converged:
        raise NotConverged(contact)
    return contact


def _untouched(problem: Problem) -> Contact:
    """The bodies are apart, or just touch."""
    return Contact(
        problem=problem,
        pressure=np.zeros(problem.heights.shape),
        force=0.0,
        area_percent=0.0,
        contact_nodes=0,
        approach=problem.delta,
        residual=0.0,
        iterations=0,
        convolutions=0,
    )


def _bounding_box(touching: NDArray[np.bool_]) -> tuple[slice, slice]:
    """The smallest box round the true nodes whose sides are on a ladder, so that plans recur."""
    rows, columns = np.nonzero(touching)
    return _span(rows, touching.shape[0]), _span(columns, touching.shape[1])


def _span(indices: NDArray[np.intp], size: int) -> slice:
    """The range of the indices, widened to 1 + (4, 5, 6, 7) 2^j nodes inside the grid."""
    first, last = int(indices.min()), int(indices.max())
    unit = 2 ** max((last - first).bit_length() - 3, 0)
    nodes = -(-(last - first) // unit) * unit + 1
    if nodes >= size:
        return slice(0, size)
    start = min(first, size - nodes)
    return slice(start, start + nodes)
