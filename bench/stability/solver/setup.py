"""The solver's arguments in a case, and the numbers that its checks derive from them alone."""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import bem
from bem.influence import Kernel
from bem.problem import MAX_ITERATIONS, FarField
from bem.spacing import Boundary, node_spacing
from bench.references.half_space import Field
from bench.stability.solver.topographies import SIDE
from gen.material import plane_strain_modulus

DELTA = 25.0  # displacement of an ordinary contact, unless a case is about another [um]

SYMBOLS = {
    "modulus": "E",
    "poisson": "ν",
    "rtol": "rtol",
    "max_iterations": "iterations up to",
    "hardness": "H",
    "pressure": "p",
    "force": "F",
    "kernel": "",
    "far_field": "",
    "boundary": "",
}
"""Arguments that a description names if they are not the default."""

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
        given: dict[str, Any] = {each.name: getattr(self, each.name) for each in fields(self)}
        return bem.solve(**given | ({"delta": None} if self.pressure or self.force else {}))

    @cached_property
    def surface(self) -> Field:
        """(nx, ny) heights as the checks use them [um]."""
        return np.asarray(self.heights, dtype=np.float64)

    @property
    def cell(self) -> tuple[float, float]:
        """Sides of a cell [um]."""
        if self.spacing is not None:
            return _pair(self.spacing)
        (length, width), (rows, columns) = _pair(self.side), self.surface.shape
        return (
            node_spacing(rows, length, self.boundary),
            node_spacing(columns, width, self.boundary),
        )

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
        return self.cell[0] / plane_strain_modulus(self.modulus, self.poisson)

    def describe(self) -> str:
        """The input in one line: grid, lengths in um, and whatever else is not the default."""
        heights = np.asarray(self.heights)
        parts = [" x ".join(str(nodes) for nodes in heights.shape) or "no grid"]
        if heights.dtype != np.float64:
            parts.append(str(heights.dtype))
        elif heights.size and heights.min() < heights.max():
            parts.append(f"z {heights.min():.9g} to {heights.max():.9g}")
        lengths = _pair(self.spacing or self.side)
        text = " x ".join(f"{length:g}" for length in dict.fromkeys(lengths))
        parts += [f"{'g' if self.spacing else 'L'} = {text}", f"Δ = {self.delta:.9g}"]
        for name, symbol in SYMBOLS.items():
            value = getattr(self, name)
            if value != getattr(Setup, name):
                parts.append(f"{symbol} = {value:g}" if symbol else value)
        return ", ".join(parts)


def _pair(lengths: Lengths) -> tuple[float, float]:
    return lengths if isinstance(lengths, tuple) else (lengths, lengths)
