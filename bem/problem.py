"""The contact problem that a user states, checked before anything is computed."""

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from bem.arrays import Field, Mask
from bem.bodies import (
    HALF_SPACES,
    KERNELS,
    MODULI,
    POISSONS,
    Body,
    Kernel,
    checked_body,
)
from bem.checks import LARGEST, Range, real_array, real_number, refuse_masked, shown
from bem.influence import largest_wave_number
from bem.threads import computed_once

Boundary = Literal["free", "periodic", "mirror"]
BOUNDARIES: tuple[Boundary, ...] = get_args(Boundary)
FarField = Literal["rigid", "compliant"]
FAR_FIELDS: tuple[FarField, ...] = get_args(FarField)

# Default tolerance [Delta]. Of the tolerances tried, it is the loosest with which 99.9 % of the
# paper preset's samples have exactly the right contact nodes (`asperity bench default-tolerance`).
RTOL = 2e-7

# Default bound on iterations, far above the needs of all but nearly singular contacts.
MAX_ITERATIONS = 1000

# Largest depth below the highest node, over the unit of length [1]. Deeper nodes are raised to it:
# they stay open whatever the surface is, and products of two depths have to stay within single
# precision.
DEEPEST = 1e10

# Mean depth below the highest node that a flat surface is taken to have [um], so that a
# displacement of 0 is allowed.
FLATTEST = 1e-300

# Number of wave numbers, from the longest to the shortest wave, whose compliance is checked.
WAVES = 9

# Largest double below zero: ranges that exclude it include zero.
BELOW_ZERO = math.nextafter(0, -1)

# Allowed values of the arguments of `bem.solve`, by the argument's name: the range of a number, or
# the names to choose from.
ARGUMENTS: dict[str, Range | tuple[str, ...]] = {
    "side": Range(0, math.inf, "above 0 um"),
    "spacing": Range(0, math.inf, "above 0 um"),
    "delta": Range(-math.inf, math.inf, "a finite number of um"),
    "force": Range(BELOW_ZERO, math.inf, "at least 0 uN"),
    "pressure": Range(BELOW_ZERO, math.inf, "at least 0 MPa"),
    "modulus": MODULI,
    "poisson": POISSONS,
    "hardness": Range(0, math.inf, "above 0 MPa, and finite"),
    "rtol": Range(1e-15, 1, "between 1e-15 and 1, both excluded"),
    "max_iterations": Range(0, math.inf, "a whole number of at least 1", integer=True),
    "threads": Range(0, math.inf, "a whole number of at least 1", integer=True),
    "kernel": KERNELS,
    "far_field": FAR_FIELDS,
    "boundary": BOUNDARIES,
}

# Arguments that are refused beside a body, and their defaults.
WITHOUT_BODY: dict[str, Any] = {
    "modulus": 1.0,
    "poisson": 0.0,
    "kernel": "uniform-pressure",
    "far_field": "rigid",
}

# Bounds, both excluded, of all numbers in um, MPa and uN that `_check_range` lists. They leave a
# margin to the range of double precision.
NUMBERS = (1e-305, 1e305)

# Name of a number in the list of `_check_range`, the only one that may be zero, because flat
# surfaces have no height range. It bounds sums of heights over all nodes, which have to be finite.
SPAN = "height range times nodes [um]"

# Tighter bounds of dimensionless ratios in the list of `_check_range`, by their names. The solver
# multiplies these ratios with further numbers [1].
RATIOS = {
    "cell aspect ratio": (1e-12, 1e12),
    "reduced force over heights": (1e-200, LARGEST),
    "hardness over E*": (1e-100, 1e100),
}


@dataclass(frozen=True, eq=False)
class Problem:
    """A contact problem whose arguments have been checked.

    Attributes
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface, which is pressed down into the half-space [um].
    delta : float or None
        Far-field displacement since first touch, None if the force is given [um].
    force : float or None
        Normal force, None if the displacement is given [uN].
    spacing : tuple of float
        Distance of the nodes along the first and the second axis [um].
    body : Body
        The elastic body.
    far_field : str
        "rigid" or "compliant", see `bem.solve`.
    hardness : float or None
        Largest contact pressure, None for bodies that never yield [MPa].
    rtol : float
        Largest gap in contact, or penetration outside, that is accepted, see `bem.solve` [Delta].
    max_iterations : int
        Bound on the steps of conjugate gradients and the contact sets of dense algebra.
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.
    datum : float or None
        Height from which Delta counts, relative to the highest node; None for the highest node
        itself. On fewer nodes of a map, Delta counts from the highest node of the whole map, so
        that it is the same displacement on every grid. The datum is below 0 where the surface
        between the nodes of the map is higher than all of them [um].
    """

    heights: Field = field(repr=False)
    delta: float | None
    force: float | None
    spacing: tuple[float, float]
    body: Body
    far_field: FarField
    hardness: float | None
    rtol: float
    max_iterations: int
    boundary: Boundary = "free"
    datum: float | None = None

    @property
    def modulus(self) -> float:
        """Plane-strain modulus E* = E / (1 - nu^2) of the body's surface [MPa]."""
        return self.body.e_star

    @property
    def kernel(self) -> Kernel:
        """Influence coefficients on a free patch, see `bem.solve`."""
        return self.body.kernel

    @property
    def reduced_body(self) -> Body:
        """The body in units of the first side of a cell and of its modulus E*."""
        return self.body.reduced(self.spacing[0])

    @property
    def has_most_delta(self) -> bool:
        """Whether Delta of elastic bodies ends at full contact, as on half-spaces without edges.

        A uniform pressure displaces nothing there, so that more load changes Delta no further.
        """
        return self.boundary != "free" and not self.body.mean_compliance > 0

    @property
    def touches_by_overlap(self) -> bool:
        """Whether nodes whose undeformed surfaces do not overlap stay apart.

        On a free half-space a pressure displaces every node downwards. A layer may rise beside a
        load, and so does the surface of a patch without edges, whose mean stays in place.
        """
        return self.boundary == "free" and self.body.is_homogeneous

    @property
    def is_deeper_than_cells(self) -> bool:
        """Whether the surface's material decides the compliance of the grid's shortest waves."""
        return self.body.is_deeper_than_cells(self.spacing)

    @property
    def settlement_ratio(self) -> float:
        """Settlement under the whole patch over that of the surface's material alone, at least 1.

        Below a hard layer on a soft base a free patch settles by much more than its roughness.
        Tolerances are relative to Delta, which includes the settlement, so that loose ones have to
        be divided by this ratio. It is 1 on half-spaces and on patches without edges.
        """
        if self.boundary != "free" or self.body.is_homogeneous:
            return 1.0
        rows, columns = self.heights.shape
        side = max(rows * self.spacing[0], columns * self.spacing[1])
        # A wave of pressure of this number displaces as much as a uniform pressure on the patch.
        relative = np.ravel(self.body.relative_compliance(np.array([2 / side])))
        return max(float(relative[0]), 1.0)

    @property
    def mean_displacement(self) -> float:
        """Displacement of a patch without edges by the mean pressure of the given force [um].

        It is 0 if the displacement is given, and for bodies without a mean compliance.
        """
        if self.boundary == "free" or not self.force:
            return 0.0
        area = self.heights.size * self.spacing[0] * self.spacing[1]
        return self.force / area * self.body.mean_compliance

    @computed_once
    def highest(self) -> float:
        """Height of the highest node [um]."""
        return float(self.heights.max())

    @property
    def datum_height(self) -> float:
        """Height at which Delta is zero [um]."""
        return self.highest + (self.datum or 0.0)

    @property
    def aspect(self) -> float:
        """Second side of a cell over its first [1]."""
        return self.spacing[1] / self.spacing[0]

    @property
    def elongation(self) -> float:
        """Longer side of a cell over the shorter [1]."""
        return max(self.aspect, 1 / self.aspect)

    def reduced_hardness(self, length: float) -> float:
        """Return the hardness in units of length E* / first side of a cell, inf if there is none.

        Parameters
        ----------
        length : float
            Unit of reduced displacements [um].

        Returns
        -------
        float
            Reduced hardness [1].
        """
        if self.hardness is None:
            return math.inf
        return self.hardness / self.modulus * self.spacing[0] / length


def node_spacing(nodes: int, side: float, boundary: Boundary = "free") -> float:
    """Compute the distance between neighbouring nodes along one axis of a patch.

    The outer nodes of a free patch are on its border. A patch without edges is made of cells, whose
    centres are the nodes: the last cell is followed by the first one, or by its own mirror image.

    Parameters
    ----------
    nodes : int
        Nodes along the axis, at least two for a free patch.
    side : float
        Length of the patch along the axis [um].
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.

    Returns
    -------
    float
        Distance of the nodes [um].
    """
    return side / (nodes - 1) if boundary == "free" else side / nodes


class NoSolution(ValueError):
    """A load or a displacement without an equilibrium."""


class OutOfRange(ValueError, ArithmeticError):
    """Allowed numbers whose products double precision cannot hold."""


def pose(
    heights: ArrayLike,
    side: float | tuple[float, float],
    delta: float | None,
    *,
    force: float | None = None,
    pressure: float | None = None,
    spacing: float | tuple[float, float] | None = None,
    modulus: float = 1.0,
    poisson: float = 0.0,
    kernel: Kernel = "uniform-pressure",
    far_field: FarField = "rigid",
    body: Body | tuple[Body, Body] | None = None,
    boundary: Boundary = "free",
    hardness: float | None = None,
    rtol: float = RTOL,
    max_iterations: int = MAX_ITERATIONS,
) -> Problem:
    """Check the arguments of `bem.solve`, and make a problem of them.

    Parameters
    ----------
    heights, side, delta, force, pressure, spacing, modulus, poisson, kernel
        See `bem.solve`.
    far_field, body, boundary, hardness, rtol, max_iterations
        See `bem.solve`.

    Returns
    -------
    Problem
        The problem with a copy of the heights; a mean pressure has become a force, Young's modulus
        and Poisson's ratio a body.

    Raises
    ------
    ValueError
        If an argument is not allowed; one line shows its value and the allowed ones.
    NoSolution
        If the load is more than the hardness on all nodes carries, or the displacement of elastic
        bodies on a patch without edges is that of full contact or more.
    """
    surface = checked_heights(heights)
    if body is None:
        elastic: Body = HALF_SPACES[checked("kernel", kernel)](modulus, poisson)
    else:
        _refuse_beside_body(
            modulus=modulus, poisson=poisson, kernel=kernel, far_field=far_field
        )
        elastic = checked_body(body)
    boundary = checked("boundary", boundary)
    problem = Problem(
        heights=surface,
        delta=0.0,
        force=None,
        spacing=_checked_spacing(surface.shape, side, spacing, boundary),
        body=elastic,
        far_field=checked("far_field", far_field),
        hardness=None if hardness is None else checked("hardness", hardness),
        rtol=checked("rtol", rtol),
        max_iterations=checked("max_iterations", max_iterations),
        boundary=boundary,
    )
    return under_load(problem, delta, force=force, pressure=pressure)


def under_load(
    problem: Problem,
    delta: float | None,
    *,
    force: float | None = None,
    pressure: float | None = None,
) -> Problem:
    """Return a problem with another load, which is checked.

    Parameters
    ----------
    problem : Problem
        The problem with any load.
    delta, force, pressure
        The load, see `bem.solve`.

    Returns
    -------
    Problem
        The problem of the same bodies under the load; a mean pressure has become a force.

    Raises
    ------
    ValueError, NoSolution
        As `pose` raises them.
    """
    name, load = _only_load(delta=delta, force=force, pressure=pressure)
    load = checked(name, load)
    if name == "pressure" and load:  # the force of a tiny pressure must not become zero
        area = problem.heights.size * problem.spacing[0] * problem.spacing[1]
        load = max(area * load, math.ulp(0.0))
    if name == "delta":
        loaded = replace(problem, delta=load, force=None)
    else:
        loaded = replace(problem, delta=None, force=load)
    check_solvable(loaded, pressure)
    return loaded


def _refuse_beside_body(**arguments: Any) -> None:
    """Refuse arguments that differ from their defaults beside a body, which replaces them."""
    for name, value in arguments.items():
        if isinstance(value, np.ndarray) or value != WITHOUT_BODY[name]:
            raise ValueError(
                f"{name} = {shown(value)} beside a body: the body has its own material, and a rigid"
                " far field"
            )


def _only_load(**loads: Any) -> tuple[str, Any]:
    """Return name and value of the only load that is not None, or refuse the loads."""
    passed = [name for name, load in loads.items() if load is not None]
    if len(passed) != 1:
        raise ValueError(
            f"{' and '.join(passed) or 'no load'} given: give one of delta [um], force [uN] and"
            " pressure [MPa]"
        )
    return passed[0], loads[passed[0]]


def check_solvable(problem: Problem, pressure: float | None = None) -> None:
    """Refuse settings that are not solved together, and loads without an equilibrium.

    A displacement on a compliant far field is not checked: solving refuses it.

    Parameters
    ----------
    problem : Problem
        The problem.
    pressure : float, optional
        Mean pressure from which the force was computed, for messages; None if it was not [MPa].

    Raises
    ------
    ValueError
        If settings are not solved together; one line names them and a remedy.
    OutOfRange
        If products of the problem's numbers are beyond double precision.
    NoSolution
        If no equilibrium carries the load, or has the displacement.
    """
    _check_range(problem)
    _check_combinations(problem)
    _check_compliance(problem)
    if problem.delta is not None:
        _check_displacement(problem, problem.delta)
    elif problem.hardness is not None:
        _check_load(problem, problem.hardness, pressure)


def _check_combinations(problem: Problem) -> None:
    """Refuse a kernel or a far field that is not solved with the problem's other settings."""
    edgeless = problem.boundary != "free"
    settings = "hardness"
    if edgeless:
        settings = f"boundary = {problem.boundary!r}"
    if problem.kernel == "concentrated-force" and (edgeless or problem.aspect != 1):
        reason = f"needs square cells, spacing is {problem.spacing} um"
        if edgeless:
            reason = f"is not solved with {settings}"
        raise ValueError(
            f"kernel = 'concentrated-force' {reason}: use kernel = 'uniform-pressure'"
        )
    if problem.far_field == "compliant" and (edgeless or problem.hardness is not None):
        raise ValueError(
            f"far_field = 'compliant' is not solved with {settings}: use far_field = 'rigid'"
        )


def _check_compliance(problem: Problem) -> None:
    """Refuse a body whose compliance is out of range for a wave of the patch or the grid.

    On a free patch, also refuse a layer that is too thin for a table of influence coefficients.
    """
    if problem.body.is_homogeneous:
        return
    along, across = problem.spacing
    rows, columns = problem.heights.shape
    longest = 2 * max(rows * along, columns * across)
    wave_numbers = math.pi * np.geomspace(1 / longest, 2 / min(along, across), WAVES)
    compliances = problem.body.compliance(wave_numbers)
    numbers = [problem.body.mean_compliance + NUMBERS[0], *compliances.tolist()]
    for number in numbers:
        if not NUMBERS[0] <= number < NUMBERS[1]:
            raise OutOfRange(
                f"compliance of the body = {number:g} um/MPa: thickness and moduli must keep it"
                f" between {NUMBERS[0]:g} and {NUMBERS[1]:g}, within double precision"
            )
    is_free = problem.boundary == "free"
    if is_free and math.isinf(largest_wave_number(problem.reduced_body)):
        raise OutOfRange(
            "the body changes within a fifth of a cell below its surface, too thin a layer for"
            " boundary = 'free': use boundary = 'periodic' or 'mirror'"
        )


def _check_displacement(problem: Problem, delta: float) -> None:
    """Refuse a displacement [um] of full contact or more of elastic bodies without edges."""
    is_bounded = problem.has_most_delta and problem.hardness is None
    if not is_bounded or delta <= 0:
        return
    depth = float((problem.datum_height - problem.heights).mean())
    if delta >= max(depth, FLATTEST):
        raise NoSolution(
            f"delta = {delta:g} um has no equilibrium on a patch without edges: the"
            f" contact is full at {depth:.10g} um: give a smaller delta, or the force or"
            " pressure"
        )


def _check_load(problem: Problem, hardness: float, pressure: float | None) -> None:
    """Refuse a force that is not below the force of the hardness [MPa] on all nodes.

    The message names the mean pressure [MPa] if the force was computed from one.
    """
    if pressure is not None and pressure >= hardness:
        raise NoSolution(
            f"pressure = {pressure:g} MPa has no equilibrium: the mean pressure must stay below"
            f" the hardness, {hardness:g} MPa"
        )
    largest = hardness * problem.heights.size * problem.spacing[0] * problem.spacing[1]
    if problem.force is not None and problem.force >= largest:
        raise NoSolution(
            f"force = {problem.force:g} uN has no equilibrium: it must stay below {largest:g} uN,"
            f" the hardness of {hardness:g} MPa on all nodes"
        )


def checked_start(near: ArrayLike, problem: Problem) -> Field:
    """Check a pressure to start from.

    Parameters
    ----------
    near : array_like, shape (nx, ny)
        Finite pressures, none negative [MPa].
    problem : Problem
        The problem, whose heights have the shape (nx, ny).

    Returns
    -------
    ndarray, shape (nx, ny)
        A copy of the pressures [MPa].

    Raises
    ------
    ValueError
        If the shape differs from that of the heights, or a number is negative or not finite.
    """
    start = real_array("pressures of near", near)
    shape = problem.heights.shape
    if start.shape != shape or not np.isfinite(start).all() or (start < 0).any():
        raise ValueError(
            f"near has shape {start.shape}: finite pressures of shape {shape} are needed, none"
            " negative"
        )
    return start


def _check_range(problem: Problem) -> None:
    """Refuse numbers that would overflow or vanish between reduced units and um, MPa and uN.

    Raise OutOfRange with the name and the bounds of the first one. Bodies that are apart are never
    refused, because nothing is computed for them.
    """
    if problem.delta is not None and problem.delta <= 0:
        return
    heights = problem.heights
    along, across = problem.spacing
    depth = problem.delta or along
    load = problem.force or depth * problem.modulus * along
    half = problem.highest / 2 - float(heights.min()) / 2
    numbers = {
        "spacing [um]": min(along, across),
        "cell aspect ratio": across / max(along, NUMBERS[0]),
        "cell area [um2]": along * across,
        "pressure scale [MPa]": depth / max(along, NUMBERS[0]) * problem.modulus,
        "force scale [uN]": depth * across * problem.modulus,
        "force [uN]": load,
        "reduced force [um]": load / problem.modulus / max(across, NUMBERS[0]),
        "largest pressure [MPa]": load / max(along * across, NUMBERS[0]),
        "stiffness scale [MPa um]": max(along, across) * problem.modulus,
        "compliance scale [um / MPa]": along / problem.modulus,
        SPAN: half * heights.size,
    }
    if problem.force and half > 0:
        numbers["reduced force over heights"] = numbers["reduced force [um]"] / half
    if problem.hardness is not None:
        numbers["hardness over E*"] = problem.hardness / problem.modulus
        numbers["reduced hardness"] = problem.reduced_hardness(depth)
    for name, number in numbers.items():
        low, high = RATIOS.get(name, NUMBERS)
        excluded = low
        if name == SPAN:
            excluded = BELOW_ZERO
        if not excluded < number < high:
            raise OutOfRange(
                f"{name} = {number:g}: sides, heights, load and modulus must keep it between"
                f" {low:g} and {high:g}, within double precision"
            )


def checked_heights(heights: ArrayLike) -> Field:
    """Check the heights of a surface.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Heights, at least one node [um].

    Returns
    -------
    ndarray of float, shape (nx, ny)
        A copy, read-only [um].

    Raises
    ------
    ValueError
        If they have no two axes, are empty, masked or not real, or hold values that are not finite.
    """
    surface: Field = real_array("heights", heights)
    if surface.ndim != 2 or surface.size == 0:
        raise ValueError(
            f"heights have shape {surface.shape}: a grid of nodes (nx, ny) is needed"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        is_finite = math.isfinite(float(surface.sum()))  # faster than a look at each node
    if not is_finite and not np.isfinite(surface).all():
        holes = surface.size - int(np.count_nonzero(np.isfinite(surface)))
        raise ValueError(
            f"heights hold {holes} values that are not finite: fill or crop them"
        )
    surface.setflags(write=False)
    return surface


def _checked_spacing(
    shape: tuple[int, ...], side: Any, spacing: Any, boundary: Boundary
) -> tuple[float, float]:
    """Return the spacing along both axes: the one that is passed, else the one of the sides [um].

    Sides are checked even where the spacing is passed. Raise ValueError if a length is not allowed,
    a free patch with one node along an axis has no spacing, or one side is passed for a grid that
    is not square.
    """
    sides = _checked_lengths("side", side)
    if spacing is not None:
        return _checked_lengths("spacing", spacing)
    if min(shape) < 2 and boundary == "free":
        raise ValueError(
            f"a grid of {shape[0]} x {shape[1]} nodes has no side / (nodes - 1): give the spacing"
        )
    along = node_spacing(shape[0], sides[0], boundary)
    across = node_spacing(shape[1], sides[1], boundary)
    if np.ndim(side) == 0 and shape[0] != shape[1]:
        for_square_cells = sides[1] * along / across
        raise ValueError(
            f"side = {side!r} for {shape[0]} x {shape[1]} nodes: give two,"
            f" ({sides[0]:g}, {for_square_cells:g}) for square cells or ({sides[0]:g},"
            f" {sides[0]:g}) for a square patch"
        )
    return along, across


def _checked_lengths(name: str, value: Any) -> tuple[float, float]:
    """Return the lengths along both axes that an argument holds [um], or refuse it.

    A single length is that of both axes.
    """
    refuse_masked(name, value)
    pair: tuple[Any, ...] = (value, value)
    if not isinstance(value, str) and np.ndim(value) > 0:
        pair = tuple(value)
    if len(pair) != 2:
        raise ValueError(f"{name} = {shown(value)}: one length or two are needed, in um")
    return checked(name, pair[0]), checked(name, pair[1])


def checked(name: str, value: Any) -> Any:
    """Check the value of an argument by `ARGUMENTS`.

    Parameters
    ----------
    name : str
        Name of the argument, a key of `ARGUMENTS`.
    value : float or str
        What the caller passed.

    Returns
    -------
    float, int or str
        The number, or the name.

    Raises
    ------
    ValueError
        If the number is not in its range, or the name is not among the allowed ones.
    """
    allowed = ARGUMENTS[name]
    if isinstance(allowed, Range):
        return real_number(name, value, allowed)
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(f"{name} = {shown(value)}: must be one of {', '.join(allowed)}")
    return value


class Overlap(NamedTuple):
    """The part of a grid in which the undeformed bodies overlap at a displacement.

    Attributes
    ----------
    grid : tuple of int
        Nodes (nx, ny) of the grid.
    box : tuple of slice
        Rows and columns of a box that holds these nodes.
    below : ndarray, shape of the box
        Heights less the highest one of the grid [unit of length].
    """

    grid: tuple[int, ...]
    box: tuple[slice, slice]
    below: Field

    def unfolded(self, values: Field, beyond: float = 0.0) -> Field:
        """Put the values of the box back on the grid.

        Parameters
        ----------
        values : ndarray, shape of the box
            Values.
        beyond : float
            Value of all other nodes.

        Returns
        -------
        ndarray, shape (nx, ny)
            A new array; `values` itself if the box is the grid.
        """
        if values.shape == self.grid:
            return values
        filled = np.full(self.grid, beyond)
        filled[self.box] = values
        return filled


def overlap(problem: Problem, delta: float, length: float | None = None) -> Overlap:
    """Find the part of a grid that may touch at a displacement.

    Parameters
    ----------
    problem : Problem
        The problem.
    delta : float
        Displacement, above 0; inf for the whole grid [um].
    length : float, optional
        Unit of length of the result, by default the displacement [um].

    Returns
    -------
    Overlap
        A box that holds the nodes, and its heights in units of `length`.
    """
    if length is None:
        length = delta
    below = problem.heights - problem.heights.max()
    grid = below.shape
    box = np.s_[:, :]
    if delta < math.inf:
        box = boxed(below > -delta)
    below = np.maximum(below[box], -DEEPEST * length)
    below /= length
    return Overlap(grid, box, below)


def boxed(marked: Mask) -> tuple[slice, slice]:
    """Find a small box that holds some nodes of a grid.

    Its lengths are 1 + (4, 5, 6 or 7) 2^j nodes, or all of the grid's, so that solves of different
    surfaces can share plans of Fourier transforms.

    Parameters
    ----------
    marked : ndarray of bool, shape (nx, ny)
        Mask of the nodes, at least one.

    Returns
    -------
    tuple of slice
        Rows and columns of the box.
    """
    spans = []
    for axis, size in enumerate(marked.shape):
        inside = np.flatnonzero(marked.any(axis=1 - axis))  # indices along this axis
        first = int(inside[0])
        length = int(inside[-1] - inside[0])
        # The length is rounded up to 4, 5, 6 or 7 of these powers of two.
        unit = 2 ** max(length.bit_length() - 3, 0)
        nodes = min(-(-length // unit) * unit + 1, size)
        start = min(first, size - nodes)
        spans.append(slice(start, start + nodes))
    return spans[0], spans[1]
