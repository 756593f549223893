"""Surfaces and arguments of the solver's cases."""

from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import bem
from bem.analytic import Indenter, distances_to_centre
from bem.bodies import Kernel
from bem.problem import MAX_ITERATIONS, Boundary, FarField, node_spacing
from bench.references.half_space import Field
from gen.generation.plan import parameters, surface_random
from gen.scene import load
from gen.surface import generate

NODES = 129
"""Nodes a side of surfaces, unless a case is about another grid."""

SMALL = 33
"""Nodes a side of cases in which all nodes may touch, or that need the dense matrix."""

SIDE = 1000.0
"""Scan length of the paper's surfaces [um]."""

CELL = SIDE / (NODES - 1)
"""Spacing of `NODES` nodes on the paper's surfaces [um]."""

DELTA = 25.0
"""Displacement of an ordinary contact, unless a case is about another displacement [um]."""

Lengths = float | tuple[float, float]
"""Lengths along x and y, or one length for both axes [um]."""


@lru_cache(maxsize=16)
def paper(
    nodes: int = NODES, hurst: float | None = None, sigma0: float | None = None
) -> Field:
    """Generate the surface of the first row of the paper preset.

    Grids of other sizes show one surface: the heights of two grids at equal places differ by a
    constant only. Calls with equal arguments return one array.

    Parameters
    ----------
    nodes : int
        Nodes a side, 2^k + 1.
    hurst : float, optional
        Hurst exponent; by default that of the row [1].
    sigma0 : float, optional
        Standard deviation of the first displacement; by default that of the row [um].

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights, read-only [um].
    """
    scene = load("paper")
    row = parameters(scene, 0, 1)
    if hurst is None:
        hurst = float(row.drawn["hurst"][0])
    if sigma0 is None:
        sigma0 = float(row.drawn["sigma0"][0])
    random = surface_random(scene, 0)
    heights = generate(scene.surface.generator, nodes, hurst, sigma0, random)
    heights.setflags(write=False)
    return heights


def cropped_paper(shape: tuple[int, int]) -> Field:
    """Return a corner of the paper's surface on the smallest grid that holds the corner.

    The grid has 2^k + 1 nodes a side. The result has heights only: callers choose the spacing.

    Parameters
    ----------
    shape : (int, int)
        Nodes along x and y.

    Returns
    -------
    ndarray, shape `shape`
        Heights of a corner, read-only [um].
    """
    rows, columns = shape
    # The generator needs 2 steps (3 nodes) or more.
    steps = max(rows - 1, columns - 1, 2)
    # 2^k is the smallest power of two that is at least `steps`.
    k = (steps - 1).bit_length()
    return paper(2**k + 1)[:rows, :columns]


def terraces(nodes: int = NODES) -> Field:
    """Round the paper's surface to steps of 10 um, so that many neighbours are exactly as high.

    Parameters
    ----------
    nodes : int
        Nodes a side, 2^k + 1.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um].
    """
    return np.asarray(np.round(paper(nodes) / 10.0) * 10.0)


def flat(nodes: int = NODES) -> Field:
    """Make a flat surface.

    Parameters
    ----------
    nodes : int
        Nodes a side.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights of zero [um].
    """
    return np.zeros((nodes, nodes))


def with_middle_at(height: float, base: Field) -> Field:
    """Copy a surface with its middle node at another height: a spike, a needle or a pit.

    Parameters
    ----------
    height : float
        Height of the middle node [um].
    base : ndarray, shape (n, n)
        Heights of the surface [um], which are not changed.

    Returns
    -------
    ndarray, shape (n, n)
        Heights [um].
    """
    heights = base.copy()
    middle = len(base) // 2
    heights[middle, middle] = height
    return heights


def checkerboard(nodes: int = NODES) -> Field:
    """Make a checkerboard of heights 1 and 0, which holds the shortest waves of a grid.

    Parameters
    ----------
    nodes : int
        Nodes a side.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um]; the first corner is high.
    """
    x, y = np.indices((nodes, nodes))
    is_high = (x + y) % 2 == 0
    return np.where(is_high, 1.0, 0.0)


def step(nodes: int = NODES) -> Field:
    """Make a step: the half of the patch with smaller x is 1 um above the other half.

    Parameters
    ----------
    nodes : int
        Nodes a side.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um].
    """
    x, _ = np.indices((nodes, nodes))
    is_high = x < nodes // 2
    return np.where(is_high, 1.0, 0.0)


def white_noise(nodes: int = NODES) -> Field:
    """Draw independent normal heights of unit variance, always the same ones.

    Parameters
    ----------
    nodes : int
        Nodes a side.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um].
    """
    return np.random.default_rng(0).standard_normal((nodes, nodes))


def indenter(body: Indenter, nodes: int = NODES) -> Field:
    """Make the surface of a body of revolution with its tip at the centre of the patch.

    Parameters
    ----------
    body : Indenter
        The body.
    nodes : int
        Nodes a side.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um]. The tip is at height 0; there may be no node at the tip.
    """
    return body.heights(distances_to_centre((nodes, nodes), SIDE))


@dataclass(frozen=True, eq=False)
class Setup:
    """A contact problem: the arguments of `bem.solve`, which documents them.

    A pressure or force other than 0 replaces `delta`. The fields have the names of the arguments.
    """

    heights: ArrayLike  # shape (nx, ny) [um]; other shapes belong to cases of wrong input
    delta: float = DELTA  # displacement from first touch [um]
    side: Lengths = SIDE  # scan length [um]
    spacing: Lengths | None = None  # spacing of the nodes, replaces `side` if given [um]
    modulus: float = 1.0  # Young's modulus [MPa]
    poisson: float = 0.0  # Poisson's ratio [1]
    kernel: Kernel = "uniform-pressure"
    far_field: FarField = "rigid"
    rtol: float = 1e-6  # tolerance [Delta]
    max_iterations: int = MAX_ITERATIONS
    hardness: float | None = None  # bound of the pressure [MPa]; None for elastic bodies
    pressure: float | None = None  # mean pressure on the patch [MPa]
    force: float | None = None  # normal force [uN]
    boundary: Boundary = "free"

    def solve(self) -> bem.Contact:
        """Solve the problem by `bem.solve`."""
        arguments: dict[str, Any] = {
            argument.name: getattr(self, argument.name) for argument in fields(self)
        }
        if self.pressure or self.force:
            arguments["delta"] = None
        return bem.solve(**arguments)

    @cached_property
    def surface(self) -> Field:
        """Heights in the form that the checks need, (nx, ny) [um]."""
        return np.asarray(self.heights, dtype=np.float64)

    @property
    def cell(self) -> tuple[float, float]:
        """Sides of a cell along x and y, which are the spacings of the nodes [um]."""
        if self.spacing is not None:
            return _pair(self.spacing)
        rows, columns = self.surface.shape
        sides = _pair(self.side)
        first = node_spacing(rows, sides[0], self.boundary)
        second = node_spacing(columns, sides[1], self.boundary)
        return first, second

    @property
    def cell_area(self) -> float:
        """Area of a cell [um2]."""
        return self.cell[0] * self.cell[1]

    @property
    def given_force(self) -> float:
        """The given force, or that of the given mean pressure [uN]; 0 if Delta is given."""
        if self.force:
            return self.force
        return (self.pressure or 0.0) * self.surface.size * self.cell_area

    @property
    def bound(self) -> float:
        """Largest pressure: the hardness, or infinity for elastic bodies [MPa]."""
        return np.inf if self.hardness is None else self.hardness

    @property
    def aspect(self) -> float:
        """Second side of a cell over its first [1]."""
        return self.cell[1] / self.cell[0]

    @property
    def compliance(self) -> float:
        """First side of a cell over E* = E / (1 - nu^2) [um / MPa]."""
        e_star = self.modulus / (1 - self.poisson**2)
        return self.cell[0] / e_star

    def describe(self) -> str:
        """Return the input in one line.

        The line has the grid, the range of heights [um], Delta [um], and all further fields whose
        values differ from their defaults.
        """
        heights = np.asarray(self.heights)
        parts = [" x ".join(str(nodes) for nodes in heights.shape)]
        if heights.size:
            lowest = heights.min()
            highest = heights.max()
            parts.append(f"z {lowest:.9g} to {highest:.9g}")
        parts.append(f"delta = {self.delta:.9g}")
        for argument in fields(self)[2:]:  # all fields after heights and delta
            value = getattr(self, argument.name)
            if value != argument.default:
                parts.append(f"{argument.name} = {value}")
        return ", ".join(parts)


def _pair(lengths: Lengths) -> tuple[float, float]:
    """Return the lengths along x and y [um]; a single length is for both."""
    if isinstance(lengths, tuple):
        return lengths
    return lengths, lengths
