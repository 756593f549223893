"""The contact of a rigid rough surface with an elastic half-space: `solve` and its `Contact`."""

from __future__ import annotations  # short signatures in help()

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from bem.arrays import Field, Mask
from bem.convolution import FieldFilter, displacement_filter
from bem.derived.spots import Spots, spots_of
from bem.derived.stiffness import Punch, patch_stiffness, punch_of, without_patch
from bem.displacement_control import on_compliant_far_field, on_rigid_far_field
from bem.edgeless import without_edges
from bem.equilibrium import Equilibrium, Start
from bem.influence import Kernel
from bem.load_control import under_given_force
from bem.problem import (
    MAX_ITERATIONS,
    RTOL,
    FarField,
    Problem,
    checked_start,
    pose,
)
from bem.spacing import Boundary
from bem.spectrum import spectral_filter
from bem.workers import checked_threads, on_threads

# Relative distance below which a pressure is the hardness: a few roundings.
ULPS = 1e-15

# Relative difference of its sides up to which a cell is square.
SQUARE = 1e-9

# Share of perimeter times spacing by which counting nodes overrates the area of contact (Yastrebov,
# Anciaux and Molinari 2017, Tribology International 114).
PERIMETER_SHARE = (math.pi - 1 + math.log(2)) / 24


@dataclass(frozen=True, eq=False)
class Contact:
    """Equilibrium of a `Problem`, which `solve` returns.

    Attributes
    ----------
    problem : Problem
        The problem that was solved.
    pressure : ndarray, shape (nx, ny)
        Contact pressure, zero out of contact and never above the hardness [MPa].
    force : float
        Total normal force [uN = MPa um^2].
    area_percent : float
        Effective contact area A_e, the share of nodes under pressure [%].
    contact_nodes : int
        Number of nodes under pressure.
    delta : float
        Far-field displacement Delta, given or computed [um].
    approach : float
        Total displacement of the far field: Delta, plus F / K if it is compliant [um].
    residual : float
        Largest absolute gap in contact, or penetration outside, over Delta, or over the approach
        if the force was given [1].
    iterations : int
        Steps of conjugate gradients, and contact sets tried by dense algebra.
    convolutions : int
        Applications of the influence matrix. Those on a coarser grid count by its share of the
        nodes; those spent on guessing the displacement do not count.
    """

    problem: Problem = field(repr=False)
    pressure: Field = field(repr=False)
    force: float
    area_percent: float
    contact_nodes: int
    delta: float
    approach: float
    residual: float
    iterations: int
    convolutions: int

    @cached_property
    def displacement(self) -> Field:
        """Normal displacement of the half-space's surface, (nx, ny), by one convolution [um]."""
        problem = self.problem
        operator = _displacement_filter(problem)
        displacement: Field = operator(self.pressure) * (problem.spacing[0] / problem.modulus)
        displacement.setflags(write=False)
        return displacement

    @cached_property
    def gap(self) -> Field:
        """Distance left between the surfaces, (nx, ny), zero in contact [um]."""
        gap = self._elastic_gap
        if self.problem.hardness is not None:
            gap = gap + self.yielded_depth
        gap.setflags(write=False)
        return gap

    @cached_property
    def yielded_depth(self) -> Field:
        """Depth by which the softer body has yielded, (nx, ny), zero without a hardness [um]."""
        depth = np.where(self._yielded, np.maximum(-self._elastic_gap, 0.0), 0.0)
        depth.setflags(write=False)
        return depth

    @property
    def flattened(self) -> Field:
        """Heights of the surface after yielding, (nx, ny): what an unloaded patch looks like [um].

        The highest node yields first, so that Delta of another contact of this surface counts from
        a lower node than the one before. Loads need no such care.
        """
        heights: Field = self.problem.heights - self.yielded_depth
        return heights

    @property
    def yielded_percent(self) -> float:
        """Share of all nodes whose pressure is the hardness; 0 without a hardness [%]."""
        return 100.0 * int(np.count_nonzero(self._yielded)) / self.pressure.size

    @property
    def _yielded(self) -> Mask:
        """Nodes whose pressure is the hardness, (nx, ny)."""
        hardness = np.inf if self.problem.hardness is None else self.problem.hardness
        yielded: Mask = self.pressure >= hardness
        return yielded

    @property
    def _elastic_gap(self) -> Field:
        """Displacement less interference, (nx, ny), negative where a body has yielded [um]."""
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
        """Length of the cell edges between contact and gap, without the patch's border [um].

        A patch that repeats itself has no border: edges between its opposite sides count too.
        """
        touching = self.pressure > 0
        if self.problem.boundary == "periodic":
            touching = np.pad(touching, ((0, 1), (0, 1)), mode="wrap")
            along, across = touching[:, :-1], touching[:-1]
        else:
            along = across = touching
        edges = (
            np.count_nonzero(along[1:] != along[:-1]) * self.problem.spacing[1],
            np.count_nonzero(across[:, 1:] != across[:, :-1]) * self.problem.spacing[0],
        )
        return float(sum(edges))

    @property
    def corrected_area_percent(self) -> float:
        """Contact area less the share of it that cells along the perimeter add [%].

        A_e counts whole cells, of which those at the edges of spots touch in part (Yastrebov,
        Anciaux and Molinari 2017).

        Raises
        ------
        ValueError
            If the cells are not square.
        """
        along, across = self.problem.spacing
        if not math.isclose(along, across, rel_tol=SQUARE):
            raise ValueError(
                f"the area is corrected for square cells, the spacing is {along:g} x {across:g} um"
            )
        added = PERIMETER_SHARE * self.perimeter / (across * self.pressure.size)
        return self.area_percent - 100.0 * added

    @cached_property
    def spots(self) -> Spots:
        """Connected regions of contact, and whether contact and gap cross the patch."""
        along, across = self.problem.spacing
        periodic = self.problem.boundary == "periodic"
        return spots_of(self.pressure > 0, along * across, periodic=periodic)

    @cached_property
    def punch(self) -> Punch:
        """The flat punch of the contact set, by one linear solve."""
        return punch_of(self.problem, np.flatnonzero(self.pressure > 0))

    @property
    def stiffness(self) -> float:
        """Stiffness S of unloading: that of the contact set as a flat punch [MPa um].

        Bodies that have yielded unload elastically, the yielded nodes too. For an elastic contact
        on a rigid far field S is also dF/dDelta. A full contact without edges is infinitely stiff.

        Raises
        ------
        ArithmeticError
            If the linear solve does not converge.
        """
        return self.punch.stiffness

    @property
    def interface_stiffness(self) -> float:
        """Stiffness of the interface alone, without the patch's own compliance [MPa um].

        The contact of a free patch lies in series with the half-space behind the whole patch:
        1/S - 1/S(patch), with the flat punch that fills the patch. It is infinite at full contact,
        and loses its digits near it. Without edges the patch has no compliance of its own.

        Raises
        ------
        ArithmeticError
            If a linear solve does not converge.
        """
        return without_patch(self.stiffness, patch_stiffness(self.problem))

    @cached_property
    def loading_stiffness(self) -> float:
        """Stiffness dF/dDelta of further loading, while the contact set stands [MPa um].

        Yielded nodes keep their pressure, so that this is the flat punch of the others.

        Raises
        ------
        ArithmeticError
            If a linear solve does not converge.
        """
        if self.problem.far_field == "compliant":  # Delta leaves out what the patch gives way
            return self.interface_stiffness
        yielded = self._yielded
        if not yielded.any():
            return self.stiffness
        return punch_of(self.problem, np.flatnonzero((self.pressure > 0) & ~yielded)).stiffness

    def conductance(self, k1: float, k2: float) -> float:
        """Compute the conductance of the contact between two half-spaces for heat or current.

        It is k S / E* with k = 2 k1 k2 / (k1 + k2), exactly for spots that conduct and a gap that
        does not (Barber 2003).

        Parameters
        ----------
        k1, k2 : float
            Conductivities of the bodies, above 0; one may be infinite.

        Returns
        -------
        float
            Conductance [unit of k1 times um: 1e-6 W/K for W/(m K)].

        Raises
        ------
        ValueError
            If a conductivity is not above 0, or both are infinite.
        ArithmeticError
            If the linear solve does not converge.
        """
        return mean_conductivity(k1, k2) * self.stiffness / self.problem.modulus

    def interface_conductance(self, k1: float, k2: float) -> float:
        """Compute the conductance of the interface alone, see `interface_stiffness`.

        Parameters
        ----------
        k1, k2 : float
            Conductivities of the bodies, above 0; one may be infinite.

        Returns
        -------
        float
            Conductance of the interface [unit of k1 times um: 1e-6 W/K for W/(m K)].

        Raises
        ------
        ValueError
            If a conductivity is not above 0, or both are infinite.
        ArithmeticError
            If the linear solve does not converge.
        """
        return mean_conductivity(k1, k2) * self.interface_stiffness / self.problem.modulus


def mean_conductivity(k1: float, k2: float) -> float:
    """Compute 2 k1 k2 / (k1 + k2), the conductivity of two bodies in series.

    Raises
    ------
    ValueError
        If one is not above 0, or both are infinite.
    """
    if not (k1 > 0 and k2 > 0 and min(k1, k2) < math.inf):
        raise ValueError(f"conductivities {k1:g} and {k2:g}: both must be above 0, one finite")
    low, high = sorted((k1, k2))
    return 2 * low / (1 + low / high)


class NotConverged(ArithmeticError):
    """The tolerance was not met; `contact` carries the numbers that were reached.

    Attributes
    ----------
    contact : Contact
        The contact reached, whose residual is above the tolerance of its problem.
    stalled : bool
        Whether rounding left no step that would come nearer, so that more iterations would change
        nothing; otherwise the bound on iterations was met.
    """

    def __init__(self, contact: Contact, stalled: bool = False) -> None:
        self.contact = contact
        self.stalled = stalled
        problem = contact.problem
        remedy = f"raise max_iterations ({problem.max_iterations}) or rtol"
        if stalled:
            remedy = "rounding leaves no smaller one; raise rtol"
        super().__init__(
            f"residual {contact.residual:.1e} after {contact.iterations} iterations, asked for"
            f" {problem.rtol:.1e}: {remedy}"
        )

    def __reduce__(self) -> tuple[type[NotConverged], tuple[Contact, bool]]:
        """Let the error be pickled, so that worker processes can raise it."""
        return NotConverged, (self.contact, self.stalled)


def solve(
    heights: ArrayLike,
    side: float | tuple[float, float],
    delta: float | None = None,
    *,
    force: float | None = None,
    pressure: float | None = None,
    spacing: float | tuple[float, float] | None = None,
    modulus: float = 1.0,
    poisson: float = 0.0,
    kernel: Kernel = "uniform-pressure",
    far_field: FarField = "rigid",
    boundary: Boundary = "free",
    hardness: float | None = None,
    rtol: float = RTOL,
    max_iterations: int = MAX_ITERATIONS,
    near: Field | None = None,
    threads: int | None = None,
) -> Contact:
    """Press a rigid rough surface into an elastic half-space, without friction or adhesion.

    Finds the pressure p >= 0 with gap w = H p - (z - z_max + Delta) >= 0 and p w = 0 (paper,
    section 2.4). With a hardness P the softer body yields: p <= P, and w <= 0 where p = P, by the
    depth that it has yielded there (Almqvist, Sahlin, Larsson and Glavatskih 2007, Tribology
    International 40). The body neither hardens nor piles up, and P is the same everywhere.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Heights z of the surface; the highest node touches at Delta = 0 [um].
    side : float or tuple of float
        Scan length L, one for a square grid or one for each axis [um].
    delta : float, optional
        Far-field displacement Delta; at 0 or below nothing carries load [um]. Exactly one of
        `delta`, `force` and `pressure` is needed.
    force : float, optional
        Total normal force F, from which Delta follows [uN].
    pressure : float, optional
        Mean pressure over the cells of all nodes, in contact or not [MPa].
    spacing : float or tuple of float, optional
        Distance of the nodes, one or one for each axis. By default side / (nodes - 1) with free
        boundaries (MIRCO uses side / nodes there), and side / nodes with the others [um].
    modulus : float
        Young's modulus E [MPa].
    poisson : float
        Poisson's ratio nu, in (-1, 0.5] [1].
    kernel : str
        "uniform-pressure" (Love 1929), or "concentrated-force", which reproduces MIRCO's results
        (see `bem.influence.influence_coefficients`) and needs square cells.
    far_field : str
        "rigid": Delta as it is given. "compliant": Delta + F / K with the stiffness K of a flat
        punch that fills the patch (MIRCO).
    boundary : str
        "free": the patch is all that there is, as in the paper. "periodic": the patch repeats
        itself along both axes without end. "mirror": its mirror images continue it, which leaves
        no step at its borders whatever the surface is. The last two stand for a piece of a larger
        interface: waves of pressure p(q) of wavenumber q displace the half-space by
        2 p(q) / (E* q) (Johnson 1985, section 13.2), with zero mean, from which Delta is counted.
        They have no kernel to choose, and a rigid far field only.
    hardness : float, optional
        Largest contact pressure P, the hardness of the softer body [MPa]; on a rigid far field
        only. Without it the bodies are elastic.
    rtol : float
        Largest absolute gap in contact, or penetration outside, that is accepted, over Delta
        [1]. The default is the loosest of a ladder that counts the contact nodes of 99.9 % of the
        paper preset's samples exactly (`python -m bench solver --default-tolerance`).
    max_iterations : int
        Bound on the steps of conjugate gradients and contact sets of dense algebra.
    near : ndarray, shape (nx, ny), optional
        Pressure near the solution to start from, as `ladder` does [MPa]. A compliant far field
        and a given force do not use it.
    threads : int, optional
        Threads that share the work of grids with some 500 nodes a side or more; smaller ones take
        one. The results are the same to the last bit on any number. By default as many as the
        environment variable OMP_NUM_THREADS says, or one.

    Returns
    -------
    Contact
        Pressure, area, force and the other results.

    Raises
    ------
    ValueError
        For input that no contact problem can have; the message names what was given and what is
        allowed. OutOfRange, a ValueError, where double precision could not hold the results.
    NoSolution
        For a compliant far field with Delta at or beyond Delta*, for a patch without edges with
        Delta at or beyond that of full contact, and for a mean pressure that is not below the
        hardness.
    NotConverged
        If `max_iterations` did not suffice, or `rtol` is below what rounding allows. It carries
        the numbers that were reached.
    """
    problem = pose(
        heights,
        side,
        delta,
        force=force,
        pressure=pressure,
        spacing=spacing,
        modulus=modulus,
        poisson=poisson,
        kernel=kernel,
        far_field=far_field,
        boundary=boundary,
        hardness=hardness,
        rtol=rtol,
        max_iterations=max_iterations,
    )
    start = None if near is None else Start(checked_start(near, problem) / problem.modulus)
    with on_threads(checked_threads(threads)):
        return contact_of(problem, equilibrium_of(problem, start))


def equilibrium_of(
    problem: Problem, near: Start | None = None, *, keep_displacement: bool = False
) -> Equilibrium | None:
    """Solve a checked problem with the method that its load and far field need.

    Parameters
    ----------
    problem : Problem
        The problem.
    near : Start, optional
        A pressure to start from; it is ignored for a given Delta on a compliant far field.
    keep_displacement : bool
        Whether the result has the displacement of the half-space, where the solve yields it.

    Returns
    -------
    Equilibrium or None
        None if the bodies are apart or just touch.
    """
    if not (problem.force if problem.delta is None else problem.delta > 0):
        return None
    if problem.boundary != "free":
        return without_edges(problem, near, keep_displacement=keep_displacement)
    if problem.delta is None:
        return under_given_force(problem, near)
    if problem.far_field == "compliant":
        return on_compliant_far_field(problem, problem.delta)
    return on_rigid_far_field(problem, problem.delta, near, keep_displacement=keep_displacement)


def contact_of(problem: Problem, equilibrium: Equilibrium | None) -> Contact:
    """Convert an equilibrium from reduced units to a `Contact`.

    Parameters
    ----------
    problem : Problem
        The problem that was solved.
    equilibrium : Equilibrium or None
        Its equilibrium; None if the bodies are apart or just touch.

    Raises
    ------
    NotConverged
        If the equilibrium does not meet the tolerance of the problem.
    """
    if equilibrium is None:
        return _untouched(problem)
    unit = equilibrium.length / problem.spacing[0] * problem.modulus
    touching = int(np.count_nonzero(equilibrium.pressure > 0))
    pressure = equilibrium.pressure * unit
    if problem.hardness is not None:  # units may have cost the last digit
        pressure[np.abs(pressure - problem.hardness) <= ULPS * problem.hardness] = problem.hardness
    pressure.setflags(write=False)
    contact = Contact(
        problem=problem,
        pressure=pressure,
        force=float(equilibrium.pressure.sum()) * unit * (problem.spacing[0] * problem.spacing[1]),
        area_percent=100.0 * touching / equilibrium.pressure.size,
        contact_nodes=touching,
        delta=equilibrium.delta,
        approach=equilibrium.approach,
        residual=equilibrium.iterate.violation(),
        iterations=equilibrium.iterate.effort.iterations,
        convolutions=equilibrium.iterate.effort.convolutions,
    )
    if equilibrium.converged:
        return contact
    # Without convergence, nodes that the solver left aside count too.
    contact = replace(contact, residual=_violation(contact) / equilibrium.length)
    exceeded = problem.hardness is not None and contact.largest_pressure > problem.hardness
    if exceeded or not contact.residual <= problem.rtol:  # a residual that is nan is refused too
        raise NotConverged(contact, equilibrium.iterate.stalled)
    return contact


def _displacement_filter(problem: Problem) -> FieldFilter:
    """Return the influence matrix of the whole grid in double precision."""
    shape = problem.heights.shape
    if problem.boundary == "free":
        return displacement_filter(shape, problem.kernel, problem.aspect)
    return spectral_filter(shape, problem.boundary, problem.aspect)


def _violation(contact: Contact) -> float:
    """Compute the largest |gap| in contact or penetration outside, by one convolution [um]."""
    violations = np.where(contact.pressure > 0, np.abs(contact.gap), -contact.gap)
    return max(float(violations.max()), 0.0)


def _untouched(problem: Problem) -> Contact:
    """Return the contact of bodies that are apart or just touch."""
    pressure = np.zeros(problem.heights.shape)
    pressure.setflags(write=False)
    return Contact(
        problem=problem,
        pressure=pressure,
        force=0.0,
        area_percent=0.0,
        contact_nodes=0,
        delta=problem.delta or 0.0,
        approach=problem.delta or 0.0,
        residual=0.0,
        iterations=0,
        convolutions=0,
    )
