"""Features of one surface, computed once for any number of displacements.

The hybrid set looks at the surface itself. Bearing area and interference are what would touch if
nothing deformed. A contact solve on 33 x 33 blocks, each as high as the mean of its nodes, gives
area, force and a smooth deflection; interpolated to the nodes, the deflection says which of them
stand clear above it (`refined`: none where nodes are blocks), so that the highest nodes are not
lost in their blocks' means. Delta counts from the highest node throughout.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

import bem
from gen.runtime.errors import InputError
from gen.statistics import describe
from learn.features.sets import FeatureSet, build

Values = NDArray[np.float64]
Sides = tuple[float, float]

BLOCKS = 33
"""Blocks a side; a surface of fewer nodes is its own coarse surface."""

LOOSE = 1e-3
"""Residual of the coarse solve, over Delta: a feature need not be exact, only always the same."""


@dataclass(frozen=True, eq=False)
class SurfaceFeatures:
    """A surface, ready to be asked for its features at any Delta.

    Parameters
    ----------
    heights : (nx, ny) heights, 2 x 2 or more, finite [um]
    sides : scan lengths along x and y [um]
    spacing : of the nodes along x and y; sides / (nodes - 1) unless given [um]
    name : what messages call it
    """

    heights: Values
    sides: Sides
    spacing: Sides | None = None
    name: str = "the surface"

    @property
    def steps(self) -> Sides:
        """Spacing of the nodes along x and y [um]."""
        if self.spacing is not None:
            return self.spacing
        nx, ny = self.heights.shape
        return self.sides[0] / (nx - 1), self.sides[1] / (ny - 1)

    @property
    def length(self) -> float:
        """Scan length L, the geometric mean of both sides [um]."""
        return math.sqrt(self.sides[0] * self.sides[1])

    @cached_property
    def statistics(self) -> Values:
        """(22,) statistics, in the order of Table 1.

        Raises
        ------
        InputError
            If the surface does not define them all.
        """
        description = describe(self.heights, self.steps)
        if description.reason:
            raise InputError(f"{self.name}: statistics undefined: {description.reason}")
        return np.array(list(description.values.values()))

    def features(self, features: FeatureSet, deltas: Values) -> Values:
        """Features at each displacement.

        Parameters
        ----------
        features : which
        deltas : (k,) far-field displacements, above 0 [um]

        Returns
        -------
        (k, d)

        Raises
        ------
        InputError
            If a Delta is not above 0, the statistics are undefined, or numbers overflow.
        """
        deltas = np.asarray(deltas, dtype=np.float64).reshape(-1)
        wrong = deltas[~((deltas > 0) & (deltas < np.inf))]
        if wrong.size:
            raise InputError(f"{self.name}: Delta {wrong[0]:g} um: give numbers above 0")
        pressed = None
        if features.needs_surface:
            pressed = np.array([self.pressed(float(delta)) for delta in deltas]).reshape(-1, 7)
        rows = np.repeat(self.statistics[None], deltas.size, axis=0)
        found = build(features, rows, deltas, self.length, pressed)
        if not np.isfinite(found).all():
            raise InputError(f"{self.name}: its features are not finite numbers")
        return found

    def pressed(self, delta: float) -> tuple[float, ...]:
        """What the hybrid set adds at one Delta [um], in the order of `sets.PRESSED`."""
        interference = self.heights - (self._highest - delta)
        bearing = _above(interference, delta)
        depth = delta - (self._highest - float(self._coarse.max()))
        if depth <= 0:  # not one block's mean is reached
            return *bearing, 0.0, 0.0, 0.0, *bearing
        contact = self.coarse_contact(depth)
        across, along = self._interpolation
        deflection = across @ contact.displacement @ along.T
        return (
            *bearing,
            contact.area_percent,
            contact.force / (self.length * delta),
            float(contact.displacement.mean()) / delta,
            # Only what stands clear of it by more than the coarse solve's own residual.
            *_above(interference - deflection - LOOSE * delta, delta),
        )

    def coarse_contact(self, depth: float) -> bem.Contact:
        """Solve the contact of the block means, `depth` below the highest of them, E* = 1 MPa."""
        (step_x, step_y), (nx, ny) = self.steps, self.heights.shape
        blocks_x, blocks_y = self._coarse.shape
        steps = step_x * nx / blocks_x, step_y * ny / blocks_y
        try:
            return bem.solve(self._coarse, self.sides, depth, spacing=steps, rtol=LOOSE)
        except (bem.NotConverged, ArithmeticError, ValueError) as error:
            raise InputError(f"{self.name}: coarse contact: {error}") from None

    def compliance(self, delta: float) -> float:
        """Mean displacement over F / (E* L) at some Delta [1], from the coarse solve.

        The mean displacement of the surface is this times F / (E* L) for the force of any better
        solve: where the load sits on the patch, not how it is shared by single nodes, decides it.
        """
        depth = delta - (self._highest - float(self._coarse.max()))
        contact = self.coarse_contact(max(depth, 1e-3 * delta))
        return float(contact.displacement.mean()) * self.length / contact.force

    @cached_property
    def _highest(self) -> float:
        return float(self.heights.max())

    @cached_property
    def _coarse(self) -> Values:
        """Means of the blocks' nodes (33, 33), or fewer where there are fewer nodes [um]."""
        (rows, sizes_x), (columns, sizes_y) = (_blocks(nodes) for nodes in self.heights.shape)
        sums = np.add.reduceat(np.add.reduceat(self.heights, rows, axis=0), columns, axis=1)
        return np.asarray(sums / np.outer(sizes_x, sizes_y))

    @cached_property
    def _interpolation(self) -> tuple[Values, Values]:
        """Linear interpolation from the blocks' centres to the nodes, constant outside."""
        nx, ny = self.heights.shape
        return _interpolation(nx), _interpolation(ny)


def _above(interference: Values, delta: float) -> tuple[float, float]:
    """Share of nodes above 0, and the mean of what stands above over Delta."""
    above = np.maximum(interference, 0.0)
    return np.count_nonzero(above) / above.size, float(above.mean()) / delta


def _blocks(nodes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First node and size of each block along an axis."""
    blocks = min(nodes, BLOCKS)
    edges = np.arange(blocks + 1) * nodes // blocks
    return edges[:-1], np.diff(edges)


def _interpolation(nodes: int) -> Values:
    """(nodes, blocks) weights."""
    first, sizes = _blocks(nodes)
    centres = first + (sizes - 1) / 2
    unit = np.eye(centres.size)
    return np.stack([np.interp(np.arange(nodes), centres, each) for each in unit], axis=1)
