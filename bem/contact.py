"""The contact of a rigid rough surface with an elastic body, as `solve` returns it."""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bem.arrays import Field, Mask
from bem.budget import Budget
from bem.checks import LARGEST, Range, real_number
from bem.derived.border import continuum_nodes
from bem.derived.grid_error import GridError, grid_error_of
from bem.derived.spots import Spots, spots_of
from bem.derived.stiffness import Punch, patch_stiffness, punch_of, without_patch
from bem.operators.displacement import displacement_filter
from bem.operators.filters import filtered
from bem.problem import Problem
from bem.threads import computed_once

if TYPE_CHECKING:
    from bem.derived.flow import Flow
    from bem.derived.gradient import LinearContact

# Conductivities of a body that are allowed, besides infinity.
CONDUCTIVITIES = Range(0, LARGEST, f"above 0 and below {LARGEST:g}, or infinite")


@dataclass(frozen=True, eq=False)
class Contact:
    """The equilibrium of a `Problem`, as `solve` returns it.

    Fields that need further work are computed when they are first read, and kept.

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
        Far-field displacement Delta, the given or the computed one [um]. Where every node in
        contact has yielded, the same pressure is in balance at every Delta until the next node
        touches; under a given load, Delta is the smallest of them.
    approach : float
        Total displacement of the far field: Delta, plus F / K if the far field is compliant [um].
    residual : float
        Largest absolute gap in contact, or penetration outside. It is relative to Delta; if the
        force is given, to the approach without the displacement by the mean pressure [1].
    iterations : int
        Number of steps of conjugate gradients, plus contact sets tried by dense algebra.
    convolutions : int
        Number of applications of the influence matrix. One on a coarser grid counts as its share of
        the nodes.
    again : callable
        Function that solves another problem: `bem.solving.solve_posed`, which this file cannot
        import. It takes the problem, and a pressure near its solution or None [MPa], and returns
        its contact.
    budget : Budget or None
        Errors of the answers by their causes; None unless `solve_within` made the contact.
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
    again: Callable[[Problem, Field | None], Contact] = field(repr=False)
    budget: Budget | None = field(default=None, repr=False)
    _kept: dict[str | int, Any] = field(default_factory=dict, init=False, repr=False)

    @computed_once
    def displacement(self) -> Field:
        """Normal displacement of the body's surface, (nx, ny), by one convolution [um]."""
        problem = self.problem
        operator = displacement_filter(
            self.pressure.shape,
            problem.boundary,
            problem.reduced_body,
            problem.aspect,
            "float64",
        )
        unit = problem.spacing[0] / problem.modulus
        displacement: Field = filtered(operator, self.pressure) * unit
        displacement.setflags(write=False)
        return displacement

    @computed_once
    def gap(self) -> Field:
        """Distance left between the surfaces, (nx, ny), zero in contact [um]."""
        heights = self.problem.heights
        interference = (heights - self.problem.datum_height) + self.approach
        gap: Field = self.displacement - interference
        if self.problem.hardness is not None:  # yielded nodes penetrate by their depth
            gap = np.where(self.yielded, np.maximum(gap, 0.0), gap)
        gap.setflags(write=False)
        return gap

    @computed_once
    def yielded_depth(self) -> Field:
        """Depth by which the softer body has yielded, (nx, ny), zero without a hardness [um]."""
        heights = self.problem.heights
        interference = (heights - self.problem.datum_height) + self.approach
        depth = np.where(
            self.yielded, np.maximum(interference - self.displacement, 0.0), 0.0
        )
        depth.setflags(write=False)
        return depth

    @property
    def flattened(self) -> Field:
        """Heights of the surface after yielding and unloading, (nx, ny) [um].

        The highest node yields first, so that Delta of another contact of this surface is measured
        from a lower node than Delta of this contact. Contacts under given loads need no correction.
        """
        heights: Field = self.problem.heights - self.yielded_depth
        return heights

    @property
    def yielded_percent(self) -> float:
        """Share of all nodes whose pressure is the hardness; 0 without a hardness [%]."""
        return 100.0 * int(np.count_nonzero(self.yielded)) / self.pressure.size

    @property
    def yielded(self) -> Mask:
        """Mask of the nodes whose pressure is the hardness, (nx, ny)."""
        if self.problem.hardness is None:
            return np.zeros(self.pressure.shape, bool)
        yielded: Mask = self.pressure >= self.problem.hardness
        return yielded

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

        A patch that repeats itself has no border, so that edges between its opposite sides are
        included.
        """
        crossed_along_x, crossed_along_y = self.border_edges
        dx, dy = self.problem.spacing
        return float(crossed_along_x * dy + crossed_along_y * dx)

    @property
    def border_edges(self) -> tuple[int, int]:
        """Numbers of cell edges between contact and gap that lines along x and along y cross.

        The patch's border is not counted, see `perimeter`.
        """
        touching = self.pressure > 0
        along = touching
        across = touching
        if self.problem.boundary == "periodic":
            wrapped = np.pad(touching, ((0, 1), (0, 1)), mode="wrap")
            along = wrapped[:, :-1]
            across = wrapped[:-1]
        crossed_along_x = int(np.count_nonzero(along[1:] != along[:-1]))
        crossed_along_y = int(np.count_nonzero(across[:, 1:] != across[:, :-1]))
        return crossed_along_x, crossed_along_y

    @computed_once
    def continuum_area_percent(self) -> float:
        """Area of contact in the continuum, as a share of the area of all cells [%].

        The effective area A_e consists of the cells of contact nodes, which reach beyond the border
        of contact. It is too large by about 0.1 of the perimeter times the spacing. Pressures and
        gaps beside the border tell its place between the nodes (`bem.derived.border`). Where waves
        have 8 nodes and more, this area is right within 1 % (`asperity bench resolution`). Where
        roughness goes down to the grid, the continuum has no area: see `grid_error`. No contact
        stays 0 %, full contact 100 %.
        """
        depth = None
        if self.problem.hardness is not None:
            depth = self.yielded_depth
        cells = continuum_nodes(self.problem, self.pressure, self.gap, depth)
        return 100.0 * cells / self.pressure.size

    def with_budget(self, budget: Budget) -> Contact:
        """Return this contact with a budget of errors, and with all answers computed so far.

        Parameters
        ----------
        budget : Budget
            Errors of the answers.

        Returns
        -------
        Contact
            A copy that shares all arrays.
        """
        contact = copy(self)
        object.__setattr__(contact, "budget", budget)  # the class is frozen for its users
        return contact

    def grid_error(self, coarse: Contact | None = None) -> GridError:
        """Estimate the errors that the grid makes, by solving the same contact on a coarser one.

        The coarser grid has about every second node. Its contact is solved once; the answer is
        kept. See `bem.derived.grid_error`.

        Parameters
        ----------
        coarse : Contact, optional
            The same contact on about every second node if it is known; by default it is solved.

        Returns
        -------
        GridError
            Half-widths of 90 % bars of the answers, and whether they hold.
        """
        if "grid_error" not in self._kept:
            self._kept["grid_error"] = grid_error_of(self, coarse)
        return cast("GridError", self._kept["grid_error"])

    @computed_once
    def spots(self) -> Spots:
        """The connected regions of contact, and whether contact and gap cross the patch."""
        along, across = self.problem.spacing
        periodic = self.problem.boundary == "periodic"
        return spots_of(self.pressure > 0, along * across, periodic=periodic)

    def flow(self, axis: int = 0) -> Flow:
        """Compute the flow of a fluid through the gap by Reynolds' equation.

        The answer is kept. Nodes in contact are closed. A patch that repeats itself is driven by a
        mean gradient. Any other patch is between two reservoirs, and its sides along the axis are
        closed. Where contact seals the patch, the flow factor is 0.

        Parameters
        ----------
        axis : int
            0 for flow along x, 1 for flow along y.

        Returns
        -------
        Flow
            Flow factor, hydraulic aperture and field of flux, see `bem.derived.flow`.

        Raises
        ------
        ValueError
            If the axis is neither 0 nor 1.
        ArithmeticError
            If the equations are not solved to 1e-9.
        """
        # Imported here, because few contacts need it.
        from bem.derived.flow import flows_through

        if axis not in self._kept:
            gap = np.where(self.pressure > 0, 0.0, np.maximum(self.gap, 0.0))
            periodic = self.problem.boundary == "periodic"
            axes: tuple[int, ...] = (axis,)
            if periodic:  # one factorisation serves both axes
                axes = (axis, 1 - axis)
            flows = flows_through(gap, self.problem.spacing, axes, periodic=periodic)
            self._kept.update(zip(axes, flows, strict=True))
        return cast("Flow", self._kept[axis])

    @computed_once
    def punch(self) -> Punch:
        """The flat punch whose face is the contact set, by one linear solve."""
        return punch_of(self.problem, np.flatnonzero(self.pressure > 0))

    @property
    def stiffness(self) -> float:
        """Stiffness S of unloading, which is that of the contact set as a flat punch [MPa um].

        Yielded nodes also unload elastically. For an elastic contact on a rigid far field, S is
        also dF/dDelta. A full contact without edges is infinitely stiff.

        Raises
        ------
        ArithmeticError
            If the linear solve does not converge.
        """
        return self.punch.stiffness

    @property
    def interface_stiffness(self) -> float:
        """Stiffness of the interface alone, without the compliance of the patch [MPa um].

        The contact of a free patch is in series with the half-space behind the patch. The
        interface has the compliance 1/S - 1/S(patch), where S(patch) is the stiffness of a flat
        punch that fills the patch. It is infinitely stiff at full contact, and the difference loses
        its digits near it. A patch without edges has no compliance, so that this is S, except on a
        layer with a rigid base, which a uniform pressure compresses.

        Raises
        ------
        ArithmeticError
            If a linear solve does not converge.
        """
        if self.problem.has_most_delta:
            return self.stiffness
        return without_patch(self.stiffness, patch_stiffness(self.problem))

    @computed_once
    def loading_stiffness(self) -> float:
        """Stiffness dF/dDelta of further loading, as long as the contact set stays [MPa um].

        Yielded nodes keep their pressure, so that this is the flat punch of all other nodes in
        contact. On a compliant far field, it is the stiffness of the interface.

        Raises
        ------
        ArithmeticError
            If a linear solve does not converge.
        """
        if self.problem.far_field == "compliant":  # Delta excludes the patch's compliance
            return self.interface_stiffness
        return self._elastic_punch.stiffness

    @computed_once
    def _elastic_punch(self) -> Punch:
        """The flat punch of the nodes in contact that are below the hardness."""
        yielded = self.yielded
        if not yielded.any():
            return self.punch
        elastic = np.flatnonzero((self.pressure > 0) & ~yielded)
        return punch_of(self.problem, elastic)

    def gradient(self, of: str) -> Field:
        """Differentiate an answer of this contact by the heights of its surface.

        The derivatives hold as long as the contact set stays. Yielded nodes keep their pressure,
        so that their heights have no influence, except the height of the highest node: Delta counts
        from it. See `bem.derived.gradient`.

        Parameters
        ----------
        of : str
            "force", at a given Delta; "delta", at a given force or pressure; or "mean_gap", at the
            given load or Delta of the problem.

        Returns
        -------
        ndarray, shape (nx, ny)
            Derivatives: of the force [uN / um], of Delta and of the mean gap [1].

        Raises
        ------
        ValueError
            If the answer has no gradient, such as a count of nodes; if several nodes are the
            highest, for derivatives of Delta or at a given Delta; if the contact is one of
            `solve_within`, whose heights come from another grid; if a full contact is infinitely
            stiff, for the force; or, for Delta and at a given load, if no node in contact is below
            the hardness.
        ArithmeticError
            If a linear solve does not converge.
        """
        from bem.derived.gradient import gradient_of  # few contacts need it

        return gradient_of(self._linear, of)

    @computed_once
    def mean_gap_slope(self) -> float:
        """Derivative of the mean gap by Delta, as long as the contact set stays [1].

        It is -1 for elastic bodies on a patch without edges. Divided by `loading_stiffness`, it is
        the derivative by the force.

        Raises
        ------
        ArithmeticError
            If a linear solve does not converge.
        """
        from bem.derived.gradient import mean_gap_slope_of  # few contacts need it

        return mean_gap_slope_of(self._linear)

    @property
    def _linear(self) -> LinearContact:
        """The contact with its sets of nodes held, for derivatives."""
        from bem.derived.gradient import LinearContact  # few contacts need it

        touching = self.pressure > 0
        return LinearContact(
            problem=self.problem,
            elastic=touching & ~self.yielded,
            is_open=~touching,
            punch=self._elastic_punch,
        )

    def conductance(self, k1: float, k2: float) -> float:
        """Compute the conductance of the contact between two half-spaces for heat or current.

        It is k S / E* with k = 2 k1 k2 / (k1 + k2). This is exact where spots conduct and the gap
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
            If a conductivity is not above 0, or both are infinite, or a body is layered.
        ArithmeticError
            If the linear solve does not converge.
        """
        self._refuse_layers()
        return mean_conductivity(k1, k2) * self.stiffness / self.problem.modulus

    def interface_conductance(self, k1: float, k2: float) -> float:
        """Compute the conductance of the interface alone, without the resistance of the patch.

        It follows from `interface_stiffness` as `conductance` does from the stiffness.

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
            If a conductivity is not above 0, or both are infinite, or a body is layered.
        ArithmeticError
            If the linear solve does not converge.
        """
        self._refuse_layers()
        return mean_conductivity(k1, k2) * self.interface_stiffness / self.problem.modulus

    def _refuse_layers(self) -> None:
        """Refuse the conductance of a body that is not a half-space."""
        if not self.problem.body.is_homogeneous:
            raise ValueError(
                "the conductance follows from the stiffness on half-spaces only (Barber 2003): a"
                " layered body has another one, which is not computed"
            )


def mean_conductivity(k1: float, k2: float) -> float:
    """Compute 2 k1 k2 / (k1 + k2), the conductivity of two bodies in series.

    Parameters
    ----------
    k1, k2 : float
        Conductivities of the bodies, above 0 and below 1e38; one may be infinite [any unit].

    Returns
    -------
    float
        Conductivity [unit of k1].

    Raises
    ------
    ValueError
        If a conductivity is not in this range, or both are infinite.
    """
    low, high = sorted((_conductivity(k1), _conductivity(k2)))
    if low == math.inf:
        raise ValueError(f"conductivities {k1:g} and {k2:g}: one must be finite")
    return 2 * low / (1 + low / high)


def _conductivity(value: float) -> float:
    """Return the conductivity of a body as a float, which may be inf.

    Raise ValueError if it is neither infinite nor in the range of `CONDUCTIVITIES`.
    """
    if isinstance(value, float) and value == math.inf:
        return value
    return real_number("conductivities: one", value, CONDUCTIVITIES)
