"""Features of one surface, computed once for any number of displacements.

The hybrid set uses the heights themselves. Bearing area and bearing interference are those of a
surface that does not deform. A contact solve on 33 x 33 blocks, each with the mean height of its
nodes, gives area, force and a smooth displacement. The displacement is interpolated to the nodes;
the `refined` features count the nodes that stand above it, so that the highest nodes are not lost
in the means of their blocks (there are none where every node is a block). Delta is measured from
the highest node throughout.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

import bem
from bem.spacing import Boundary, node_spacing
from gen.runtime.errors import InputError
from gen.statistics import describe
from learn.arrays import Values
from learn.features.sets import HYBRID, FeatureSet, build

Sides = tuple[float, float]

BLOCKS = 33
"""Blocks per side; on a surface with fewer nodes every node is a block."""

CELLS = 32
"""Blocks per side of a patch without edges: those of 2^k cells are then equal, and transforms of
their number fast."""

NEARLY_FULL = 0.999
"""Largest displacement of a coarse solve without edges, over that of full contact: elastic bodies
have no equilibrium from full contact on, and blocks of unequal sizes come to it early."""

LOOSE = 1e-3
"""Residual of the coarse solve, over Delta: a feature need not be exact, but reproducible."""


@dataclass(frozen=True, eq=False)
class SurfaceFeatures:
    """A surface whose features can be computed at any Delta.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, 2 x 2 or more, finite [um].
    sides : tuple of float
        Scan lengths along x and y [um].
    spacing : tuple of float, optional
        Spacing of the nodes along x and y; that of sides and boundary unless given [um].
    name : str
        Name of the surface in messages.
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch, also in the coarse solve.
    """

    heights: Values
    sides: Sides
    spacing: Sides | None = None
    name: str = "the surface"
    boundary: Boundary = "free"

    @property
    def steps(self) -> Sides:
        """Spacing of the nodes along x and y [um]."""
        if self.spacing is not None:
            return self.spacing
        (nx, ny), (width, length) = self.heights.shape, self.sides
        along_x = node_spacing(nx, width, self.boundary)
        return along_x, node_spacing(ny, length, self.boundary)

    @property
    def length(self) -> float:
        """Scan length L, the geometric mean of both sides [um]."""
        return math.sqrt(self.sides[0] * self.sides[1])

    @cached_property
    def statistics(self) -> Values:
        """The 22 statistics, in the order of Table 1.

        Raises
        ------
        InputError
            If one of them is undefined for this surface.
        """
        description = describe(self.heights, self.steps)
        if description.reason:
            raise InputError(f"{self.name}: statistics undefined: {description.reason}")
        return np.array(list(description.values.values()))

    def features(
        self, features: FeatureSet, deltas: Values, hardness_ratio: float | None = None
    ) -> Values:
        """Return the features at each displacement.

        Parameters
        ----------
        features : FeatureSet
            The set to compute.
        deltas : ndarray, shape (k,)
            Far-field displacements, above 0 [um].
        hardness_ratio : float, optional
            Hardness over E*; None for elastic bodies.

        Returns
        -------
        ndarray, shape (k, d)

        Raises
        ------
        InputError
            If a Delta is not above 0, the statistics are undefined, or numbers overflow.
        """
        deltas = np.asarray(deltas, dtype=np.float64).reshape(-1)
        wrong = deltas[~((deltas > 0) & (deltas < np.inf))]
        if wrong.size:
            raise InputError(f"{self.name}: Delta {wrong[0]:g} um: give numbers above 0")
        hybrid = None
        if features.needs_surface:
            every = [self.hybrid(float(delta), hardness_ratio) for delta in deltas]
            hybrid = np.array(every).reshape(-1, len(HYBRID))
        rows = np.repeat(self.statistics[None], deltas.size, axis=0)
        columns = build(features, rows, deltas, self.length, hybrid, hardness_ratio)
        if not np.isfinite(columns).all():
            raise InputError(f"{self.name}: its features are not finite numbers")
        return columns

    def hybrid(self, delta: float, hardness_ratio: float | None = None) -> tuple[float, ...]:
        """Return the columns of `HYBRID`, which the hybrid set adds, at one Delta [um]."""
        interference = self.heights - (self._highest - delta)
        bearing = _above(interference, delta)
        depth = delta - (self._highest - float(self._coarse.max()))
        if depth <= 0:  # not one block's mean is reached
            return *bearing, 0.0, 0.0, 0.0, *bearing
        contact = self.coarse_contact(depth, hardness_ratio)
        across, along = self._interpolation
        deflection = across @ contact.displacement @ along.T
        return (
            *bearing,
            contact.area_percent,
            contact.force / (self.length * delta),
            self._mean_displacement(contact) / delta,
            # Only nodes that stand above it by more than the residual of the coarse solve.
            *_above(interference - deflection - LOOSE * delta, delta),
        )

    @property
    def full_contact(self) -> float:
        """Displacement of full contact of elastic bodies, inf on a free patch [um].

        A patch without edges has no equilibrium from there on.
        """
        if self.boundary == "free":
            return math.inf
        return float((self.heights.max() - self.heights).mean())

    def coarse_contact(self, depth: float, hardness_ratio: float | None = None) -> bem.Contact:
        """Solve the contact of the block means, `depth` [um] below the highest, with E* = 1 MPa."""
        (step_x, step_y), (nx, ny) = self.steps, self.heights.shape
        blocks_x, blocks_y = self._coarse.shape
        steps = step_x * nx / blocks_x, step_y * ny / blocks_y
        if self.boundary != "free" and hardness_ratio is None:
            full = float(self._coarse.max()) - float(self._coarse.mean())
            depth = min(depth, NEARLY_FULL * full)
        try:
            return bem.solve(
                self._coarse,
                self.sides,
                depth,
                spacing=steps,
                boundary=self.boundary,
                hardness=hardness_ratio,
                rtol=LOOSE,
            )
        except (bem.NotConverged, ArithmeticError, ValueError) as error:
            raise InputError(f"{self.name}: coarse contact: {error}") from None

    def coarse_means(
        self, delta: float, hardness_ratio: float | None = None
    ) -> tuple[float, float]:
        """Return mean displacement over F / (E* L), and mean yielded depth, of the coarse solve.

        Multiplied by F / (E* L) with the force of a finer solve, the first gives the mean
        displacement of that solve: it depends on the distribution of the load over the patch, and
        hardly on its distribution over single nodes. Without edges the mean displacement is 0.

        Returns
        -------
        compliance : float
            Mean displacement over F / (E* L) [1].
        yielded : float
            Mean yielded depth; 0 for elastic bodies [um].
        """
        if self.boundary != "free" and hardness_ratio is None:
            return 0.0, 0.0
        depth = delta - (self._highest - float(self._coarse.max()))
        contact = self.coarse_contact(max(depth, 1e-3 * delta), hardness_ratio)
        compliance = self._mean_displacement(contact) * self.length / contact.force
        if hardness_ratio is None:
            return compliance, 0.0
        return compliance, float(contact.yielded_depth.mean())

    def _mean_displacement(self, contact: bem.Contact) -> float:
        """Return the mean displacement of a coarse contact, which is 0 without edges [um]."""
        return float(contact.displacement.mean()) if self.boundary == "free" else 0.0

    @cached_property
    def _highest(self) -> float:
        return float(self.heights.max())

    @cached_property
    def _coarse(self) -> Values:
        """Mean heights of the blocks: 33 x 33, or 32 x 32 without edges, or every node [um]."""
        (rows, sizes_x), (columns, sizes_y) = (
            _blocks(nodes, self._most_blocks) for nodes in self.heights.shape
        )
        sums = np.add.reduceat(np.add.reduceat(self.heights, rows, axis=0), columns, axis=1)
        return np.asarray(sums / np.outer(sizes_x, sizes_y))

    @cached_property
    def _interpolation(self) -> tuple[Values, Values]:
        """Linear interpolation from the blocks' centres to the nodes, constant outside."""
        nx, ny = self.heights.shape
        return _interpolation(nx, self._most_blocks), _interpolation(ny, self._most_blocks)

    @property
    def _most_blocks(self) -> int:
        """Largest number of blocks per side."""
        return BLOCKS if self.boundary == "free" else CELLS


def _above(interference: Values, delta: float) -> tuple[float, float]:
    """Return the share of nodes above 0, and the mean of the positive part over Delta."""
    above = np.maximum(interference, 0.0)
    return np.count_nonzero(above) / above.size, float(above.mean()) / delta


def _blocks(nodes: int, most: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first node and the size of each block along an axis."""
    blocks = min(nodes, most)
    edges = np.arange(blocks + 1) * nodes // blocks
    return edges[:-1], np.diff(edges)


def _interpolation(nodes: int, most: int) -> Values:
    """Return the weights of linear interpolation from blocks to nodes, (nodes, blocks)."""
    first, sizes = _blocks(nodes, most)
    centres = first + (sizes - 1) / 2
    unit = np.eye(centres.size)
    return np.stack([np.interp(np.arange(nodes), centres, each) for each in unit], axis=1)
