"""Surfaces and arguments of the solver's cases."""

from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import bem
from bem.analytic import Indenter, distances_to_centre
from bem.influence import Kernel
from bem.problem import MAX_ITERATIONS, Boundary, FarField, node_spacing
from bench.references.half_space import Field
from gen.generation.plan import parameters, surface_random
from gen.scene import load
from gen.surface import generate

NODES = 129  # nodes a side, unless a case is about another grid
SMALL = 33  # nodes a side where all may touch and the dense matrix is to judge
SIDE = 1000.0  # scan length of the paper's surfaces [um]
CELL = SIDE / (NODES - 1)  # spacing of the nodes then [um]


@lru_cache(maxsize=16)
def paper(
    nodes: int = NODES, hurst: float | None = None, sigma0: float | None = None
) -> Field:
    """The surface of the paper preset's first row, read-only; its coarse nodes are always the same.

    Hurst exponent [1] and standard deviation of the first displacement [um] may replace the row's.
    """
    scene = load("paper")
    row = parameters(scene, 0, 1)
    heights = generate(
        scene.surface.generator,
        nodes,
        float(row.drawn["hurst"][0]) if hurst is None else hurst,
        float(row.drawn["sigma0"][0]) if sigma0 is None else sigma0,
        surface_random(scene, 0),
    )
    heights.setflags(write=False)
    return heights


def cropped_paper(shape: tuple[int, int]) -> Field:
    """A corner of the smallest of these surfaces that holds the grid."""
    nodes = 2 ** max(max(shape) - 2, 1).bit_length() + 1
    return paper(nodes)[: shape[0], : shape[1]]


def terraces(nodes: int = NODES) -> Field:
    """The paper's surface in steps of 10 um: plateaus of exact ties."""
    return np.asarray(np.round(paper(nodes) / 10.0) * 10.0)


def flat(nodes: int = NODES) -> Field:
    """All nodes at one height."""
    return np.zeros((nodes, nodes))


def with_middle_at(height: float, base: Field) -> Field:
    """The middle node at another height: a spike, a needle, a pit."""
    heights, middle = base.copy(), len(base) // 2
    heights[middle, middle] = height
    return heights


def checkerboard(nodes: int = NODES) -> Field:
    """Heights of 0 and 1 in turn, the shortest waves of a grid; the corners are high."""
    return np.where(np.indices((nodes, nodes)).sum(axis=0) % 2 == 0, 1.0, 0.0)


def step(nodes: int = NODES) -> Field:
    """One half of the patch 1 um above the other."""
    return np.where(np.indices((nodes, nodes))[0] < nodes // 2, 1.0, 0.0)


def white_noise(nodes: int = NODES) -> Field:
    """Independent normal heights of unit variance."""
    return np.random.default_rng(0).standard_normal((nodes, nodes))


def indenter(body: Indenter, nodes: int = NODES) -> Field:
    """A body of revolution over the centre of the patch, its tip at height 0."""
    return body.heights(distances_to_centre((nodes, nodes), SIDE))


DELTA = 25.0  # displacement of an ordinary contact, unless a case is about another [um]

Lengths = float | tuple[float, float]


@dataclass(frozen=True, eq=False)
class Setup:
    """The arguments of `bem.solve`, which says what they are; a given load replaces `delta`."""

    heights: ArrayLike
    delta: float = DELTA
    side: Lengths = SIDE
    spacing: Lengths | None = None
    modulus: float = 1.0
    poisson: float = 0.0
    kernel: Kernel = "uniform-pressure"
    far_field: FarField = "rigid"
    rtol: float = 1e-6
    max_iterations: int = MAX_ITERATIONS
    hardness: float | None = None
    pressure: float | None = None
    force: float | None = None
    boundary: Boundary = "free"

    def solve(self) -> bem.Contact:
        """The contact that `bem` computes."""
        given: dict[str, Any] = {
            each.name: getattr(self, each.name) for each in fields(self)
        }
        return bem.solve(
            **given | ({"delta": None} if self.pressure or self.force else {})
        )

    @cached_property
    def surface(self) -> Field:
        """(nx, ny) heights as the checks use them [um]."""
        return np.asarray(self.heights, dtype=np.float64)

    @property
    def cell(self) -> tuple[float, float]:
        """Sides of a cell [um]."""
        if self.spacing is not None:
            return _pair(self.spacing)
        pairs = zip(self.surface.shape, _pair(self.side), strict=True)
        first, second = (
            node_spacing(nodes, side, self.boundary) for nodes, side in pairs
        )
        return first, second

    @property
    def cell_area(self) -> float:
        """Area of a cell [um2]."""
        return self.cell[0] * self.cell[1]

    @property
    def given_force(self) -> float:
        """The force that is given, itself or as a mean pressure; 0 where Delta is given [uN]."""
        return self.force or (self.pressure or 0.0) * self.surface.size * self.cell_area

    @property
    def bound(self) -> float:
        """Largest pressure, the hardness or infinity [MPa]."""
        return np.inf if self.hardness is None else self.hardness

    @property
    def aspect(self) -> float:
        """Second side of a cell over its first [1]."""
        return self.cell[1] / self.cell[0]

    @property
    def compliance(self) -> float:
        """First side of a cell over E* = E / (1 - nu^2) [um / MPa]."""
        return self.cell[0] / (self.modulus / (1 - self.poisson**2))

    def describe(self) -> str:
        """Return the input in one line: grid, lengths in um, and what is not the default."""
        heights = np.asarray(self.heights)
        parts = [" x ".join(str(nodes) for nodes in heights.shape)]
        if heights.size:
            parts.append(f"z {heights.min():.9g} to {heights.max():.9g}")
        parts.append(f"delta = {self.delta:.9g}")
        for each in fields(self)[2:]:
            value = getattr(self, each.name)
            if value != each.default:
                parts.append(f"{each.name} = {value}")
        return ", ".join(parts)


def _pair(lengths: Lengths) -> tuple[float, float]:
    return lengths if isinstance(lengths, tuple) else (lengths, lengths)
