"""The contact problem that a user states, checked before anything is computed."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from bem.arrays import Field, Mask
from bem.checks import LARGEST, Range, real_array, real_number, refuse_masked, shown
from bem.influence import KERNELS, Kernel

Boundary = Literal["free", "periodic", "mirror"]
BOUNDARIES: tuple[Boundary, ...] = get_args(Boundary)
FarField = Literal["rigid", "compliant"]
FAR_FIELDS: tuple[FarField, ...] = get_args(FarField)

# Default tolerance: the loosest of a ladder that counts the contact nodes of 99.9 % of the paper
# preset's samples exactly (`python -m bench default-tolerance`).
RTOL = 2e-7

# Default bound on iterations, far above the needs of all but nearly singular contacts.
MAX_ITERATIONS = 1000

# Depth, in units of the displacement, that deeper nodes count as: they stay open whatever the
# surface, and products of two such depths have to stay within single precision.
DEEPEST = 1e10


BELOW_ZERO = math.nextafter(0, -1)
ARGUMENTS: dict[str, Range | tuple[str, ...]] = {
    "side": Range(0, math.inf, "above 0 um"),
    "spacing": Range(0, math.inf, "above 0 um"),
    "delta": Range(-math.inf, math.inf, "a finite number of um"),
    "force": Range(BELOW_ZERO, math.inf, "at least 0 uN"),
    "pressure": Range(BELOW_ZERO, math.inf, "at least 0 MPa"),
    "modulus": Range(0, math.inf, "above 0 MPa"),
    "poisson": Range(-1, math.nextafter(0.5, 1), "above -1 and at most 0.5"),
    "hardness": Range(0, math.inf, "above 0 MPa, and finite"),
    "rtol": Range(1e-15, 1, "between 1e-15 and 1, both excluded"),
    "max_iterations": Range(0, math.inf, "a whole number of at least 1", whole=True),
    "threads": Range(0, math.inf, "a whole number of at least 1", whole=True),
    "kernel": KERNELS,
    "far_field": FAR_FIELDS,
    "boundary": BOUNDARIES,
}
"""What the arguments of `bem.solve` may be: a number in a range, or one of some names."""

# Bounds of numbers in um, MPa and uN, with a margin to the range of double precision.
NUMBERS = (1e-305, 1e305)

# The number that may be zero: flat surfaces have no span. Sums over all nodes have to be finite.
SPAN = "height range times nodes [um]"

# Tighter bounds of dimensionless ratios, which enter products with further numbers.
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
        Far-field displacement from first touch on, None if the force is given [um].
    force : float or None
        Normal force, None if the displacement is given [uN].
    spacing : tuple of float
        Distance of the nodes along the first and the second axis [um].
    modulus : float
        Plane-strain modulus E* = E / (1 - nu^2) [MPa].
    kernel : str
        Influence coefficients, see `bem.solve`.
    far_field : str
        "rigid" or "compliant", see `bem.solve`.
    hardness : float or None
        Largest contact pressure, None for bodies that never yield [MPa].
    rtol : float
        Largest violation of complementarity accepted [Delta].
    max_iterations : int
        Bound on the steps of conjugate gradients and contact sets of dense algebra.
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.
    datum : float or None
        Height above the highest node from which Delta counts, None for the highest node itself. On
        fewer nodes of a surface it is the highest node of all of them, so that Delta stays the
        same displacement; it is below 0 where a wave rises between the nodes of the surface [um].
    """

    heights: Field = field(repr=False)
    delta: float | None
    force: float | None
    spacing: tuple[float, float]
    modulus: float
    kernel: Kernel
    far_field: FarField
    hardness: float | None
    rtol: float
    max_iterations: int
    boundary: Boundary = "free"
    datum: float | None = None

    @property
    def datum_height(self) -> float:
        """Height at which Delta is zero [um]."""
        return float(self.heights.max()) + (self.datum or 0.0)

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
    """Return the distance between neighbouring nodes along one axis of a patch [um].

    The outer nodes of a free patch lie on its border. A patch without edges is made of cells, whose
    centres are the nodes: the last cell is followed by the first one, or by its own mirror image.

    Parameters
    ----------
    nodes : int
        Nodes along the axis, at least two for a free patch.
    side : float
        Length of the patch along the axis [um].
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.
    """
    return side / (nodes - 1) if boundary == "free" else side / nodes


class NoSolution(ValueError):
    """A load that no equilibrium carries."""


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
    boundary: Boundary = "free",
    hardness: float | None = None,
    rtol: float = RTOL,
    max_iterations: int = MAX_ITERATIONS,
) -> Problem:
    """Check the arguments of `bem.solve`, which describes them.

    Raises
    ------
    ValueError
        One line that says what was given and what is allowed.
    NoSolution
        If the load is more than the hardness on all nodes carries, or the displacement of elastic
        bodies on a patch without edges is that of full contact or more.
    """
    surface = checked_heights(heights)
    boundary = checked("boundary", boundary)
    cells = _checked_spacing(surface.shape, side, spacing, boundary)
    loads: dict[str, Any] = {"delta": delta, "force": force, "pressure": pressure}
    given = {name: load for name, load in loads.items() if load is not None}
    if len(given) != 1:
        raise ValueError(
            f"{' and '.join(given) or 'no load'} given: give one of delta [um], force [uN] and"
            " pressure [MPa]"
        )
    [(name, load)] = given.items()
    load = checked(name, load)
    if name == "pressure" and load:
        load = max(surface.size * cells[0] * cells[1] * load, math.ulp(0.0))
    problem = Problem(
        heights=surface,
        delta=load if name == "delta" else None,
        force=None if name == "delta" else load,
        spacing=cells,
        modulus=checked("modulus", modulus) / (1 - checked("poisson", poisson) ** 2),
        kernel=checked("kernel", kernel),
        far_field=checked("far_field", far_field),
        hardness=None if hardness is None else checked("hardness", hardness),
        rtol=checked("rtol", rtol),
        max_iterations=checked("max_iterations", max_iterations),
        boundary=boundary,
    )
    check_solvable(problem, pressure)
    return problem


def check_solvable(problem: Problem, pressure: float | None = None) -> None:
    """Refuse settings that are not solved together, and loads without an equilibrium.

    Parameters
    ----------
    problem : Problem
        The problem.
    pressure : float, optional
        The mean pressure that its force was given by [MPa].

    Raises
    ------
    ValueError
        One line that says what was given and what is allowed.
    NoSolution
        If no equilibrium carries the load, or has the displacement.
    """
    _check_range(problem)
    edgeless, force, hardness = (
        problem.boundary != "free",
        problem.force,
        problem.hardness,
    )
    settings = f"boundary = {problem.boundary!r}" if edgeless else "hardness"
    if problem.kernel == "concentrated-force" and (edgeless or problem.aspect != 1):
        with_what = f"is not solved with {settings}"
        cells = f"needs square cells, spacing is {problem.spacing} um"
        raise ValueError(
            f"kernel = 'concentrated-force' {with_what if edgeless else cells}:"
            " use kernel = 'uniform-pressure'"
        )
    if problem.far_field == "compliant" and (edgeless or hardness is not None):
        raise ValueError(
            f"far_field = 'compliant' is not solved with {settings}: use far_field = 'rigid'"
        )
    if problem.delta is not None and edgeless and hardness is None:
        depth = float((problem.datum_height - problem.heights).mean())
        if problem.delta >= max(depth, 1e-300):
            raise NoSolution(
                f"delta = {problem.delta:g} um has no equilibrium on a patch without edges: the"
                f" contact is full at {depth:.10g} um: give a smaller delta, or the force or"
                " pressure"
            )
    if hardness is None or force is None:
        return
    if pressure is not None and pressure >= hardness:
        raise NoSolution(
            f"pressure = {pressure:g} MPa has no equilibrium: the mean pressure must stay below"
            f" the hardness, {hardness:g} MPa"
        )
    largest = hardness * problem.heights.size * problem.spacing[0] * problem.spacing[1]
    if force >= largest:
        raise NoSolution(
            f"force = {force:g} uN has no equilibrium: it must stay below {largest:g} uN, the"
            f" hardness of {hardness:g} MPa on all nodes"
        )


def checked_start(near: ArrayLike, problem: Problem) -> Field:
    """Return a pressure to start from, or refuse it.

    Parameters
    ----------
    near : array_like, shape (nx, ny)
        Finite pressures, none negative [MPa].
    problem : Problem
        The problem, whose heights have the same shape.

    Raises
    ------
    ValueError
        If the shape is another one, or a number is negative or not finite.
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
    """Refuse numbers that would overflow or vanish between reduced units and um, MPa and uN."""
    if problem.delta is not None and problem.delta <= 0:
        return
    heights, (along, across) = problem.heights, problem.spacing
    depth = along if problem.delta is None else problem.delta
    load = problem.force if problem.force else depth * problem.modulus * along
    half = float(heights.max() / 2 - heights.min() / 2)
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
        if not (-1.0 if name == SPAN else low) < number < high:
            raise OutOfRange(
                f"{name} = {number:g}: sides, heights, load and modulus must keep it between"
                f" {low:g} and {high:g}, within double precision"
            )


def checked_heights(heights: ArrayLike) -> Field:
    """Return a copy of the heights as (nx, ny) finite floats, or refuse them."""
    surface: Field = real_array("heights", heights)
    if surface.ndim != 2 or surface.size == 0:
        raise ValueError(
            f"heights have shape {surface.shape}: a grid of nodes (nx, ny) is needed"
        )
    holes = surface.size - int(np.count_nonzero(np.isfinite(surface)))
    if holes:
        raise ValueError(
            f"heights hold {holes} values that are not finite: fill or crop them"
        )
    surface.setflags(write=False)
    return surface


def _checked_spacing(
    shape: tuple[int, ...], side: Any, spacing: Any, boundary: Boundary
) -> tuple[float, float]:
    """Return the spacing along both axes, from the sides unless it is given."""
    for name, given in (("side", side), ("spacing", spacing)):
        if name == "side" or given is not None:
            refuse_masked(name, given)
            single = isinstance(given, str) or np.ndim(given) == 0
            pair = (given, given) if single else tuple(given)
            if len(pair) != 2:
                raise ValueError(
                    f"{name} = {shown(given)}: one length or two are needed, in um"
                )
            lengths = checked(name, pair[0]), checked(name, pair[1])
    if spacing is not None:
        return lengths
    if min(shape) < 2 and boundary == "free":
        raise ValueError(
            f"a grid of {shape[0]} x {shape[1]} nodes has no side / (nodes - 1): give the spacing"
        )
    cells = tuple(map(node_spacing, shape, lengths, (boundary, boundary)))
    if np.ndim(side) == 0 and shape[0] != shape[1]:
        other = lengths[1] * cells[0] / cells[1]
        raise ValueError(
            f"side = {side!r} for {shape[0]} x {shape[1]} nodes: give two,"
            f" ({lengths[0]:g}, {other:g}) for square cells or ({lengths[0]:g}, {lengths[0]:g}) for"
            " a square patch"
        )
    return cells[0], cells[1]


def checked(name: str, value: Any) -> Any:
    """Return the value of an argument as a number, or the name that it is, or refuse it."""
    allowed = ARGUMENTS[name]
    if not isinstance(allowed, Range):
        if not isinstance(value, str) or value not in allowed:
            raise ValueError(
                f"{name} = {shown(value)}: must be one of {', '.join(allowed)}"
            )
        return value
    return real_number(name, value, allowed)


class Overlap(NamedTuple):
    """The part of a grid in which the undeformed bodies overlap at a displacement.

    Attributes
    ----------
    grid : tuple of int
        Nodes (nx, ny) of the grid.
    box : tuple of slice
        Rows and columns of a box that holds these nodes.
    below : ndarray, shape of the box
        Heights less the highest [displacement].
    """

    grid: tuple[int, ...]
    box: tuple[slice, slice]
    below: Field

    def unfolded(self, values: Field, beyond: float = 0.0) -> Field:
        """Put the values of the box back on the grid, unless they are on all of it."""
        if values.shape == self.grid:
            return values
        whole = np.full(self.grid, beyond)
        whole[self.box] = values
        return whole


def overlap(problem: Problem, delta: float, length: float | None = None) -> Overlap:
    """Find the part that may touch at a displacement, inf for the whole grid [um].

    The displacement is the unit of length, unless another one is given [um].
    """
    length = delta if length is None else length
    below = problem.heights - problem.heights.max()
    box, grid = boxed(below > -delta) if delta < math.inf else np.s_[:, :], below.shape
    below = np.maximum(below[box], -DEEPEST * length)
    below /= length
    return Overlap(grid, box, below)


def boxed(marked: Mask) -> tuple[slice, slice]:
    """Find a small box that holds some nodes of a grid, with lengths that transforms reuse.

    Parameters
    ----------
    marked : ndarray of bool, shape (nx, ny)
        The nodes, at least one.

    Returns
    -------
    tuple of slice
        Rows and columns of the box.
    """
    spans = []
    for axis, size in enumerate(marked.shape):
        inside = np.flatnonzero(marked.any(axis=1 - axis))
        first, length = int(inside[0]), int(inside[-1] - inside[0])
        unit = 2 ** max(length.bit_length() - 3, 0)  # nodes are 1 + (4, 5, 6, 7) unit
        nodes = min(-(-length // unit) * unit + 1, size)
        start = min(first, size - nodes)
        spans.append(slice(start, start + nodes))
    return spans[0], spans[1]
