"""Random problems of a given load: surface, cells, kernel and tolerance drawn from a seed."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

import bem
from bem.influence import Kernel
from bench.references import surfaces
from bench.references.surfaces import Field, Random, Shape

NODES = (2, 40)
"""Fewest and most nodes a side."""

LARGEST_ASPECT = 1000.0
"""Of a cell, either way."""


def _ridges(random: Random, shape: Shape) -> Field:
    """One row, and often one column, above all the rest: ties without end."""
    heights = np.zeros(shape)
    heights[random.integers(shape[0])] = 1
    if random.random() < 0.5:
        heights[:, random.integers(shape[1])] = 1
    return heights


def _waves(random: Random, shape: Shape) -> Field:
    x, y = np.ogrid[: shape[0], : shape[1]]
    along, across = random.uniform(0, np.pi, 2)
    return np.asarray(np.cos(along * x) + np.cos(across * y))


SURFACES: dict[str, Callable[[Random, Shape], Field]] = {
    "white noise": surfaces.SURFACES["white noise"],
    "random walk": surfaces.random_walk,
    "integer ties": surfaces.SURFACES["integer ties"],
    "one height": lambda random, shape: np.zeros(shape),
    "ridges": _ridges,
    "checkerboard": lambda random, shape: np.indices(shape).sum(0) % 2.0,
    "spikes": lambda random, shape: (random.random(shape) < 0.1) * random.random(shape),
    "pits": lambda random, shape: (random.random(shape) < 0.1) * -random.random(shape),
    "waves": _waves,
    "paraboloid": surfaces.paraboloid,
}
"""Heights by their kind; made to range over 1 um."""


@dataclass(frozen=True)
class LoadProblem:
    """A force or mean pressure on a surface.

    Attributes
    ----------
    heights : (nx, ny) [um]
    spacing : of the nodes along both axes [um]
    quantity, load : what is given, and how much [uN or MPa]
    kernel, rtol : see `bem.solve`
    """

    heights: Field
    spacing: tuple[float, float]
    quantity: Literal["force", "pressure"]
    load: float
    kernel: Kernel
    rtol: float

    @property
    def force(self) -> float:
        """What the pressure has to add up to [uN]."""
        cells = self.heights.size * self.spacing[0] * self.spacing[1]
        return self.load if self.quantity == "force" else self.load * cells

    def solve(self) -> bem.Contact:
        """Press with E* = 1 MPa."""
        load: dict[str, float] = {self.quantity: self.load}
        return bem.solve(
            self.heights,
            1.0,
            None,
            force=load.get("force"),
            pressure=load.get("pressure"),
            spacing=self.spacing,
            kernel=self.kernel,
            rtol=self.rtol,
        )


def problem(seed: int, rtol: float) -> LoadProblem:
    """Draw a problem; three of five have oblong cells."""
    random = np.random.default_rng(seed)
    kind = list(SURFACES)[random.integers(len(SURFACES))]
    rows, columns = (int(nodes) for nodes in random.integers(NODES[0], NODES[1] + 1, 2))
    heights = SURFACES[kind](random, (rows, columns))
    heights = heights / (np.ptp(heights) or 1.0)
    oblong = random.random() < 0.6
    aspect = float(LARGEST_ASPECT ** random.uniform(-1, 1)) if oblong else 1.0
    concentrated = not oblong and random.random() < 0.3
    pressure = float(10 ** random.uniform(-5, 1))
    cells = rows * columns * aspect
    by_force = random.random() < 0.5
    return LoadProblem(
        heights=heights,
        spacing=(1.0, aspect),
        quantity="force" if by_force else "pressure",
        load=pressure * cells if by_force else pressure,
        kernel="concentrated-force" if concentrated else "uniform-pressure",
        rtol=rtol,
    )
