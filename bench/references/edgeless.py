"""Contact of patches without edges, by the dense matrix of sines and cosines written out.

Along each axis the modes are the sines and cosines that repeat with the patch, or the cosines of
the patch continued by its mirror images. A mode of wave number |q| has the compliance 2 / (E* |q|),
the mean has none; so the patch lies on a spring, too, whose displacement is found by the load.
"""

from functools import cached_property
from typing import Literal

import numpy as np
from scipy.optimize import brentq

from bench.references import dense
from bench.references.half_space import Field

Boundary = Literal["periodic", "mirror"]

CLOSE = 4 * np.finfo(float).eps  # relative accuracy of the spring's displacement


def axis_modes(nodes: int, side: float, boundary: Boundary) -> tuple[Field, Field]:
    """Return wave numbers, (n,) [1/um], and orthonormal modes, (n, n), of the cells of an axis."""
    cells, number = np.arange(nodes), np.arange(nodes)[:, None]
    if boundary == "mirror":
        order, waves = number, np.cos(np.pi * number * (cells + 0.5) / nodes)
    else:
        order = (number + 1) // 2  # 0, 1, 1, 2, 2 ...: a cosine and a sine each
        angles = 2 * np.pi * order * cells / nodes
        waves = np.where(number % 2 == 1, np.cos(angles), np.sin(angles))
        waves[0] = 1
    waves /= np.sqrt(np.square(waves).sum(axis=1, keepdims=True))
    unit = (np.pi if boundary == "mirror" else 2 * np.pi) / side
    return np.asarray(unit * order[:, 0]), np.asarray(waves)


class Patch:
    """A surface on a half-space of E* = 1 MPa, without edges.

    The heights, (nx, ny), and the sides, of as many cells as nodes, are in um; the hardness, in
    MPa, is infinite for elastic bodies.
    """

    def __init__(
        self,
        heights: Field,
        sides: tuple[float, float],
        boundary: Boundary,
        hardness: float = np.inf,
    ) -> None:
        self.below, self.hardness = (heights - heights.max()).reshape(-1), hardness
        self.shape: tuple[int, int] = heights.shape[0], heights.shape[1]
        along, across = (
            axis_modes(*axis, boundary) for axis in zip(self.shape, sides, strict=True)
        )
        wave_numbers = np.hypot.outer(along[0], across[0]).reshape(-1)
        self.modes: Field = np.asarray(np.kron(along[1], across[1]), np.float64)
        self.compliances = np.ones(heights.size)  # the spring's is the largest of a mode
        self.compliances[1:] = 2 / wave_numbers[1:]
        self.compliances[0] = self.compliances[1:].max(initial=1.0)
        self.spring = float(self.compliances[0]) / heights.size

    @cached_property
    def sprung(self) -> Field:
        """(m, m) displacement of each node, on the spring, by unit pressure on each [um/MPa]."""
        matrix: Field = (self.modes.T * self.compliances) @ self.modes
        return matrix

    @property
    def matrix(self) -> Field:
        """(m, m) the same without the spring, whose mean over the patch is zero [um/MPa]."""
        return self.sprung - self.spring

    @property
    def full_contact_delta(self) -> float:
        """Displacement at which elastic contact is full, whatever the load beyond [um]."""
        return -float(self.below.mean())

    @cached_property
    def full_contact_load(self) -> float:
        """Sum of the nodes' pressures from which on elastic contact is full [MPa]."""
        amplitudes: Field = self.modes @ self.below / self.compliances
        amplitudes[0] = 0
        pressure: Field = amplitudes @ self.modes
        return -float(pressure.min()) * pressure.size

    def press(self, load: float) -> Field:
        """Find the pressure [MPa] of a load, the sum of the nodes' pressures [MPa].

        The load is below the hardness on all nodes. ArithmeticError is raised if the conditions of
        contact are not fulfilled.
        """

        def solve(sprung: float) -> Field:
            return dense.solve(self.sprung, self.below + sprung, hardness=self.hardness)

        def excess(sprung: float) -> float:
            return float(solve(sprung).sum()) - load

        # No load takes more displacement than the range of heights.
        most = 1.001 * (self.spring * load - float(self.below.min()))
        sprung = float(brentq(excess, 0.0, most, xtol=CLOSE * most, rtol=CLOSE))
        return solve(sprung).reshape(self.shape)
