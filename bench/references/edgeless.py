"""Contact of patches without edges, by a dense matrix that is made of sines and cosines.

A periodic patch repeats itself; its modes along an axis are the sines and cosines of its period. A
mirrored patch is continued by its mirror images; its modes along an axis are cosines. A mode of
wave number |q| has the compliance of the body, 2 / (E* |q|) for a half-space, and the constant mode
has the compliance 0. To make
the matrix positive definite, the patch also rests on a spring. `Patch.press` finds the displacement
of the spring that belongs to the load.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.optimize import brentq

from bench.references import dense
from bench.references.half_space import Field

Boundary = Literal["periodic", "mirror"]
"""How a patch is continued beyond its edges."""

CLOSE = 4 * np.finfo(float).eps
"""Relative accuracy to which the displacement of the spring is found [1]."""


@dataclass(frozen=True, eq=False)
class AxisModes:
    """The waves of the cells along one axis."""

    wave_numbers: Field  # shape (n,) [rad/um]
    # Shape (n, n): values of a mode at the nodes in each row. The rows are orthonormal.
    modes: Field


def axis_modes(nodes: int, side: float, boundary: Boundary) -> AxisModes:
    """Compute the waves along an axis.

    Parameters
    ----------
    nodes : int
        Number n of nodes, each in its cell.
    side : float
        Length of all cells together [um].
    boundary : {"periodic", "mirror"}
        How the patch is continued.

    Returns
    -------
    AxisModes
        Wave numbers and modes; the first mode is constant.
    """
    cells = np.arange(nodes)
    number = np.arange(nodes)[:, None]
    if boundary == "mirror":
        order = number
        angles = np.pi * number * (cells + 0.5) / nodes
        waves = np.cos(angles)
        unit = np.pi / side
    else:
        order = (number + 1) // 2  # 0, 1, 1, 2, 2 ...: a cosine and a sine of each order
        angles = 2 * np.pi * order * cells / nodes
        is_cosine = number % 2 == 1
        waves = np.where(is_cosine, np.cos(angles), np.sin(angles))
        waves[0] = 1
        unit = 2 * np.pi / side
    squares = np.square(waves).sum(axis=1, keepdims=True)
    waves /= np.sqrt(squares)
    wave_numbers = unit * order[:, 0]
    return AxisModes(np.asarray(wave_numbers), np.asarray(waves))


def half_space(wave_numbers: Field) -> Field:
    """Compute the compliance of a half-space of E* = 1 MPa for waves of pressure.

    Parameters
    ----------
    wave_numbers : ndarray
        Wave numbers, above 0 [rad/um].

    Returns
    -------
    ndarray
        Displacement over pressure [um/MPa].
    """
    compliance: Field = 2 / wave_numbers
    return compliance


class Patch:
    """A surface on an elastic body, without edges.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the m = nx ny nodes [um].
    sides : (float, float)
        Lengths of nx and of ny cells [um].
    boundary : {"periodic", "mirror"}
        How the patch is continued.
    hardness : float
        Largest pressure [MPa]; infinite for elastic bodies.
    compliance : callable
        Function from wave numbers above 0 [rad/um] to the displacement by waves of pressure
        [um/MPa]; by default that of a half-space of E* = 1 MPa.

    Attributes
    ----------
    below : ndarray, shape (m,)
        Heights less that of the highest node, at most 0 [um].
    modes : ndarray, shape (m, m)
        Modes of the patch, one in each row, orthonormal; the first one is constant.
    compliances : ndarray, shape (m,)
        Displacement over pressure of each mode; that of the spring for the first mode [um/MPa].
    spring : float
        Displacement of the spring over the sum of the nodes' pressures [um/MPa].
    """

    def __init__(
        self,
        heights: Field,
        sides: tuple[float, float],
        boundary: Boundary,
        hardness: float = np.inf,
        compliance: Callable[[Field], Field] = half_space,
    ) -> None:
        self.hardness = hardness
        rows, columns = heights.shape
        self.shape = (rows, columns)
        self.below = (heights - heights.max()).reshape(-1)
        along = axis_modes(rows, sides[0], boundary)
        across = axis_modes(columns, sides[1], boundary)
        by_axes = np.hypot.outer(along.wave_numbers, across.wave_numbers)
        wave_numbers = by_axes.reshape(-1)  # of the modes of the patch
        modes = np.kron(along.modes, across.modes)
        self.modes: Field = np.asarray(modes, np.float64)
        self.compliances = np.ones(heights.size)
        self.compliances[1:] = compliance(wave_numbers[1:])
        # The spring is as compliant as the most compliant wave. Results do not depend on it.
        self.compliances[0] = self.compliances[1:].max(initial=1.0)
        self.spring = float(self.compliances[0]) / heights.size

    @cached_property
    def sprung(self) -> Field:
        """Displacement of each node by unit pressure on each node, that of the spring included.

        It has the shape (m, m) [um/MPa].
        """
        matrix: Field = (self.modes.T * self.compliances) @ self.modes
        return matrix

    @property
    def matrix(self) -> Field:
        """Displacement of each node without the spring by unit pressure on each node.

        Its mean over the patch is 0. It has the shape (m, m) [um/MPa].
        """
        return self.sprung - self.spring

    @property
    def full_contact_delta(self) -> float:
        """Displacement at which elastic contact is full; a larger load does not raise it [um]."""
        return -float(self.below.mean())

    @cached_property
    def full_contact_load(self) -> float:
        """Smallest sum of the nodes' pressures at which elastic contact is full [MPa]."""
        # Amplitudes of the modes of the pressure of zero mean that flattens the surface.
        amplitudes: Field = self.modes @ self.below / self.compliances
        amplitudes[0] = 0
        pressure: Field = amplitudes @ self.modes
        # A mean pressure is added, so that the lowest pressure becomes 0.
        return -float(pressure.min()) * pressure.size

    def press(self, load: float) -> Field:
        """Find the pressure of the contact under a load.

        Parameters
        ----------
        load : float
            Sum of the nodes' pressures [MPa], below the hardness times the number of nodes.

        Returns
        -------
        ndarray, shape (nx, ny)
            Pressure [MPa].

        Raises
        ------
        ArithmeticError
            If `dense.solve` finds no solution.
        """

        def solve(sprung: float) -> Field:
            """Return the pressure, (m,), if the patch moves by `sprung` with its spring [um]."""
            return dense.solve(self.sprung, self.below + sprung, hardness=self.hardness)

        def excess(sprung: float) -> float:
            """Return the sum of pressures less the load [MPa]."""
            return float(solve(sprung).sum()) - load

        # Without the spring, no load has to move the patch by more than the range of its heights.
        span = -float(self.below.min())
        largest = 1.001 * (self.spring * load + span)
        sprung = float(brentq(excess, 0.0, largest, xtol=CLOSE * largest, rtol=CLOSE))
        return solve(sprung).reshape(self.shape)
