"""What a case asks of the solver, and the numbers that its checks derive from that alone."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

import bem
from bem.influence import Kernel
from bem.problem import FarField
from bench.stability.solver.topographies import SIDE, Field
from gen.material import plane_strain_modulus

DELTA = 25.0
"""Displacement of an ordinary contact, unless a case is about another [um]."""

Lengths = float | tuple[float, float]


@dataclass(frozen=True, eq=False)
class Setup:
    """The arguments of `bem.solve`, which says what they are."""

    heights: ArrayLike
    delta: float = DELTA
    side: Lengths = SIDE
    spacing: Lengths | None = None
    modulus: float = 1.0
    poisson: float = 0.0
    kernel: Kernel = "uniform-pressure"
    far_field: FarField = "rigid"
    rtol: float = 1e-6
    max_iterations: int = 1000
    hardness: float | None = None
    pressure: float | None = None

    def solve(self) -> bem.Contact:
        """What `bem` makes of it."""
        return bem.solve(
            self.heights,
            self.side,
            None if self.pressure else self.delta,
            pressure=self.pressure,
            hardness=self.hardness,
            spacing=self.spacing,
            modulus=self.modulus,
            poisson=self.poisson,
            kernel=self.kernel,
            far_field=self.far_field,
            rtol=self.rtol,
            max_iterations=self.max_iterations,
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
        (length, width), (rows, columns) = _pair(self.side), self.surface.shape
        return length / (rows - 1), width / (columns - 1)

    @property
    def aspect(self) -> float:
        """Second side of a cell over its first [1]."""
        return self.cell[1] / self.cell[0]

    @property
    def plane_strain_modulus(self) -> float:
        """E* = E / (1 - nu^2) [MPa]."""
        return plane_strain_modulus(self.modulus, self.poisson)

    def describe(self) -> str:
        """The input in one line: grid, lengths in um, and whatever else is not the default."""
        heights = np.asarray(self.heights)
        parts = [" x ".join(str(nodes) for nodes in heights.shape) or "no grid"]
        if heights.dtype != np.float64:
            parts.append(str(heights.dtype))
        elif heights.size and heights.min() < heights.max():
            parts.append(f"z {heights.min():.9g} to {heights.max():.9g}")
        parts.append(f"g = {_text(self.spacing)}" if self.spacing else f"L = {_text(self.side)}")
        parts.append(f"Δ = {self.delta:.9g}")
        for symbol, value, default in (
            ("E", self.modulus, Setup.modulus),
            ("ν", self.poisson, Setup.poisson),
            ("rtol", self.rtol, Setup.rtol),
            ("iterations up to", self.max_iterations, Setup.max_iterations),
            ("H", self.hardness, Setup.hardness),
            ("p", self.pressure, Setup.pressure),
        ):
            if value != default:
                parts.append(f"{symbol} = {value:g}")
        parts += [text for text in (self.kernel, self.far_field) if text not in DEFAULT_CHOICES]
        return ", ".join(parts)


DEFAULT_CHOICES = Setup.kernel, Setup.far_field


def _pair(lengths: Lengths) -> tuple[float, float]:
    return lengths if isinstance(lengths, tuple) else (lengths, lengths)


def _text(lengths: Lengths) -> str:
    """One number where both are the same."""
    return " x ".join(f"{length:g}" for length in dict.fromkeys(_pair(lengths)))
