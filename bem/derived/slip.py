"""Partial slip of a contact under a constant normal load, from normal contacts alone.

Two bodies of like elastic constants are pressed together by P and then sheared by Q < f P with the
coefficient of friction f. The traction is f times the difference of the pressures at the loads P
and P - Q / f, the contact at P - Q / f sticks, and the shift of the bodies is f times the ratio of
tangential to normal compliance times the difference of both displacements (Jaeger 1998, Archive of
Applied Mechanics 68; Ciavarella 1998, Journal of Applied Mechanics 65, 998). This is exact for
nu = 0. At nu = 0.3 the shear forces are within 2 % of a vector solve of Coulomb's law
(`pytest tests/bem/derived/test_slip.py -k coulombs_law`). The ratio of compliances comes from a
linear solve in shear on the contact set, because it depends on the direction of the shear where
contacts are oblong.

Further branches of a loop follow by Masing's rule: after a reversal, the curve is the first one
scaled by two.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from bem.arrays import Mask, Values
from bem.bodies import HALF_SPACE
from bem.checks import LARGEST, Range, real_array, real_number, shown
from bem.far_field import flat_punch
from bem.operators.displacement import shear_filter
from bem.operators.filters import filtered
from bem.problem import Boundary, Problem, boxed, checked

if TYPE_CHECKING:
    from bem.contact import Contact

# Relative residual of the linear solve in shear [1]. The relative error of the stiffness is about
# the square of this residual.
SHEAR_RTOL = 1e-6

# Largest number of steps of conjugate gradients of the linear solve in shear.
MOST_STEPS = 2000

# Coefficients of friction that are allowed.
FRICTIONS = Range(0, LARGEST, f"above 0 and below {LARGEST:g}")


@dataclass(frozen=True, eq=False)
class PartialSlip:
    """A contact that is sheared along one axis, at n shear forces.

    On a free patch, shift and stiffness include the deformation of the half-space behind the patch.

    Attributes
    ----------
    contact : Contact
        The contact under its whole normal load.
    friction : float
        Coefficient of friction f [1].
    axis : int
        0 for shear along x, 1 for shear along y.
    shears : ndarray, shape (n,)
        Shear forces Q [uN].
    first_stiffness : float
        Tangential stiffness of the contact before anything slips [MPa um].
    sticking : tuple of Contact
        For each shear force, the contact under the normal load P - Q / f.
    """

    contact: "Contact" = field(repr=False)
    friction: float
    axis: int
    shears: Values
    first_stiffness: float
    sticking: "tuple[Contact, ...]" = field(repr=False)

    @property
    def _compliance_ratio(self) -> float:
        """Tangential compliance over the normal one, before anything slips [1]."""
        return self.contact.stiffness / self.first_stiffness

    @property
    def shift(self) -> Values:
        """Tangential displacement of the bodies far from the contact, (n,) [um]."""
        removed = self.contact.delta - self._deltas
        return self.friction * self._compliance_ratio * removed

    @property
    def _deltas(self) -> Values:
        """Delta of the contacts that stick, (n,) [um]."""
        return np.array([stuck.delta for stuck in self.sticking])

    @property
    def stiffness(self) -> Values:
        """Tangent stiffness dQ / dshift, (n,), by a linear solve for each force [MPa um].

        Raises
        ------
        ArithmeticError
            If a linear solve does not converge.
        """
        normal = np.array([stuck.stiffness for stuck in self.sticking])
        return normal / self._compliance_ratio

    @property
    def stick_percent(self) -> Values:
        """Area in the continuum that sticks, as a share of the area of all cells, (n,) [%]."""
        return np.array([stuck.continuum_area_percent for stuck in self.sticking])

    @property
    def loss(self) -> Values:
        """Energy that a cycle between Q and -Q dissipates, (n,) [pJ = uN um]."""
        energies = np.array([_complementary_energy(stuck) for stuck in self.sticking])
        # Integral of Delta over the force between both loads, less that of a straight line: the
        # area between a curve and its chord, of which Masing's loop has two that are scaled by two.
        bulge = _complementary_energy(self.contact) - energies
        bulge -= (self.contact.delta + self._deltas) / 2 * (self.shears / self.friction)
        bulge = np.maximum(bulge, 0.0)  # below 0 by rounding only
        return 8 * self.friction**2 * self._compliance_ratio * bulge


def partial_slip(
    contact: "Contact",
    friction: float,
    shears: ArrayLike,
    *,
    poisson: float,
    axis: int = 0,
) -> PartialSlip:
    """Shear a contact by forces below friction times its normal load.

    Parameters
    ----------
    contact : Contact
        An elastic contact on half-spaces, whose force is the normal load.
    friction : float
        Coefficient of friction f, above 0 [1].
    shears : array_like, shape (n,)
        Shear forces, from 0 to below friction times the normal load [uN].
    poisson : float
        Poisson's ratio of both bodies, whose elastic constants are alike. For a rigid body on an
        elastic one it has to be 0.5, where normal and tangential displacements are independent.
    axis : int
        0 for shear along x, 1 for shear along y.

    Returns
    -------
    PartialSlip
        The sheared contact, whose answers have a value for each shear force.

    Raises
    ------
    ValueError
        If an argument is not allowed, bodies yield, or the contact is not one of half-spaces on a
        rigid far field.
    ArithmeticError
        If a linear solve does not converge.
    NotConverged
        If a contact under a smaller load does not converge.
    """
    friction = real_number("friction", friction, FRICTIONS)
    poisson = checked("poisson", poisson)
    if axis not in (0, 1):
        raise ValueError(f"axis = {shown(axis)}: must be 0 for x or 1 for y")
    _check_contact(contact)
    forces = _checked_shears(shears, friction * contact.force)
    return PartialSlip(
        contact=contact,
        friction=friction,
        axis=axis,
        shears=forces,
        first_stiffness=shear_stiffness(contact, poisson, axis),
        sticking=_sticking_contacts(contact, contact.force - forces / friction),
    )


def _check_contact(contact: "Contact") -> None:
    """Refuse a contact to which the rule of Jaeger and Ciavarella does not apply."""
    problem = contact.problem
    if problem.hardness is not None:
        raise ValueError(
            f"hardness = {problem.hardness:g} MPa: partial slip is that of elastic bodies, solve"
            " without a hardness"
        )
    if problem.kernel != "uniform-pressure" or problem.far_field != "rigid":
        raise ValueError(
            f"kernel = {problem.kernel!r}, far_field = {problem.far_field!r}: partial slip needs"
            " kernel = 'uniform-pressure' and far_field = 'rigid'"
        )
    if not problem.body.is_homogeneous:
        raise ValueError(
            "partial slip follows from normal contacts on half-spaces only: a layered body has"
            " another compliance in shear, which is not computed"
        )
    if contact.force == 0:
        raise ValueError(
            "the normal load is 0: nothing holds the bodies when they are sheared"
        )
    if contact.contact_nodes == contact.pressure.size and problem.boundary != "free":
        raise ValueError(
            "the contact is full and infinitely stiff in shear: give a smaller load"
        )


def _checked_shears(shears: ArrayLike, sliding: float) -> Values:
    """Return shear forces as an array, (n,), or refuse them.

    They have to be from 0 to below the force `sliding` [uN].
    """
    forces: Values = np.atleast_1d(real_array("shears", shears))
    if forces.ndim != 1:
        raise ValueError(f"shears have shape {forces.shape}: a row of forces is needed")
    wrong = forces[~((forces >= 0) & (forces < sliding))]
    if wrong.size:
        raise ValueError(
            f"a shear force is {wrong[0]:g} uN: it must be at least 0 and below {sliding:g} uN,"
            " friction times the normal load, at which the bodies slide"
        )
    return forces


def _sticking_contacts(contact: "Contact", loads: Values) -> "tuple[Contact, ...]":
    """Solve the contact under smaller normal loads, (n,) [uN]; the results are in this order.

    Each contact starts from the pressure of the next larger load.
    """
    sticking = {contact.force: contact}
    largest_first = sorted(set(loads.tolist()), reverse=True)
    larger = contact
    for load in largest_first:
        if load == contact.force:
            continue
        problem = replace(contact.problem, delta=None, force=load)
        larger = contact.again(problem, larger.pressure)
        sticking[load] = larger
    return tuple(sticking[load] for load in loads.tolist())


def _complementary_energy(contact: "Contact") -> float:
    """Return the integral of Delta over the force from 0 to the force of an elastic contact [pJ].

    It is F Delta less the elastic energy, the sum of p u / 2. In contact u is z - z_0 + Delta.
    """
    problem = contact.problem
    touching = contact.pressure > 0
    pressure = contact.pressure[touching]
    below = problem.heights[touching] - problem.datum_height
    energy = (contact.displacement[touching] / 2 - below) * pressure
    return float(energy.sum()) * problem.spacing[0] * problem.spacing[1]


def shear_stiffness(contact: "Contact", poisson: float, axis: int = 0) -> float:
    """Compute the stiffness in shear of a contact where nothing slips, by a linear solve.

    Parameters
    ----------
    contact : Contact
        The contact, not a full one without edges.
    poisson : float
        Poisson's ratio of both bodies, see `partial_slip`.
    axis : int
        0 for shear along x, 1 for shear along y.

    Returns
    -------
    float
        Force per shift, 0 without contact [MPa um].

    Raises
    ------
    ArithmeticError
        If conjugate gradients do not reach `SHEAR_RTOL`.
    """
    problem = contact.problem
    touching = contact.pressure > 0
    if not touching.any():
        return 0.0
    # The traction is nearly proportional to the pressure of the normal punch.
    start = np.zeros(touching.shape)
    start[touching] = contact.punch.pressure * (problem.spacing[0] / problem.modulus)
    if problem.boundary == "free":  # the rest of a free patch carries nothing
        box = boxed(touching)
        touching = touching[box]
        start = start[box]
    sheared = Sheared(touching, problem.boundary, problem.aspect, poisson, axis)
    reduced = sheared.stiffness(start[touching] * isotropic_ratio(poisson))
    return reduced * problem.modulus * problem.spacing[1]


def isotropic_ratio(poisson: float) -> float:
    """Compute the stiffness in shear over the normal stiffness of an isotropic contact.

    Parameters
    ----------
    poisson : float
        Poisson's ratio nu of both bodies [1].

    Returns
    -------
    float
        2 (1 - nu) / (2 - nu) (Mindlin 1949, Journal of Applied Mechanics 16, 259) [1].
    """
    return 2 * (1 - poisson) / (2 - poisson)


def shear_patch_stiffness(problem: Problem, poisson: float, axis: int = 0) -> float:
    """Compute the stiffness in shear of all nodes of a free patch together.

    It belongs to the half-space behind the patch: the compliance of the interface alone is that of
    the contact less that of the patch.

    Parameters
    ----------
    problem : Problem
        A problem on a free patch.
    poisson : float
        Poisson's ratio of both bodies, see `partial_slip`.
    axis : int
        0 for shear along x, 1 for shear along y.

    Returns
    -------
    float
        Stiffness [MPa um].

    Raises
    ------
    ArithmeticError
        If conjugate gradients do not reach `SHEAR_RTOL`.
    """
    reduced = _reduced_patch_stiffness(
        problem.heights.shape, problem.aspect, poisson, axis
    )
    return reduced * problem.modulus * problem.spacing[1]


@lru_cache(maxsize=8)
def _reduced_patch_stiffness(
    shape: tuple[int, int], aspect: float, poisson: float, axis: int
) -> float:
    """Return the stiffness in shear of all nodes of a free patch [E* x second side of a cell]."""
    everywhere = np.ones(shape, dtype=bool)
    normal = flat_punch(shape, HALF_SPACE, aspect)
    sheared = Sheared(everywhere, "free", aspect, poisson, axis)
    return sheared.stiffness(normal.ravel() * isotropic_ratio(poisson))


@dataclass(frozen=True, eq=False)
class Sheared:
    """Nodes of a patch that stick together, and are sheared along one axis.

    Attributes
    ----------
    sticking : ndarray of bool, shape (nx, ny)
        Mask of the a nodes.
    boundary : str
        "free", "periodic" or "mirror".
    aspect : float
        Second side of a cell over its first [1].
    poisson : float
        Poisson's ratio of both bodies [1].
    axis : int
        0 for shear along x, 1 for shear along y.
    """

    sticking: Mask
    boundary: Boundary
    aspect: float
    poisson: float
    axis: int

    def stiffness(self, start: Values) -> float:
        """Solve for the traction that shifts the nodes by one first side of a cell; return its sum.

        Parameters
        ----------
        start : ndarray, shape (a,)
            Traction to start from [E*].

        Returns
        -------
        float
            Sum over the cells, which is the force per shift [E* x second side of a cell].

        Raises
        ------
        ArithmeticError
            If conjugate gradients do not reach `SHEAR_RTOL`.
        """
        # Imported here, because few contacts need it.
        from scipy.sparse.linalg import LinearOperator, cg

        rows, columns = self.sticking.shape
        operator = shear_filter(
            (rows, columns), self.boundary, self.aspect, self.poisson, self.axis
        )
        tractions = np.zeros((rows, columns))

        def displaced(traction: Values) -> Values:
            """Return the displacements of the nodes by a traction on them, both (a,)."""
            tractions[self.sticking] = traction
            displacement: Values = filtered(operator, tractions)[self.sticking]
            return displacement

        nodes = start.size
        matrix = LinearOperator((nodes, nodes), matvec=displaced, dtype=float)
        ones = np.ones(nodes)
        traction, failure = cg(
            matrix, ones, x0=start, rtol=SHEAR_RTOL, maxiter=MOST_STEPS
        )
        if failure:
            raise ArithmeticError(
                f"stiffness in shear of {nodes} nodes in contact: not solved to"
                f" {SHEAR_RTOL:g} in {MOST_STEPS} iterations"
            )
        # As for the normal punch, the error of this sum is that of the residual squared.
        residual = ones - displaced(traction)
        return float((traction * (1 + residual)).sum())
