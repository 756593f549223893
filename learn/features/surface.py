"""Features of the hybrid set, from the heights of a surface and a coarse contact solve.

Bearing area and bearing interference are those of a surface that does not deform. A contact solve
on 33 x 33 blocks (or 65 x 65), each with the mean height of its nodes, gives area, force and a
smooth displacement. The displacement is interpolated to the nodes; the `refined` features count the
nodes that stand above it, so that the highest nodes are not lost in the means of their blocks.
No node stands above it where every node is a block. Delta is measured from the highest node
throughout.

Surrogates see more of the same solve (`learn.features.columns.LOCAL`): the area in contact inside
the blocks by Persson's theory, the share of the nodes above shifted displacements, and their
interference. The blocks are pressed as if each were smooth. The heights that their means do not
resolve are described by their rms and, for each block, by their rms slope inside it; this slope and
the pressure on a block decide the share of it that is in contact.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import bem
from bem.problem import Boundary
from gen.arrays import Values
from gen.runtime.errors import InputError
from gen.statistics import Description, describe
from learn.features.columns import BLOCKS, FACTORS, HYBRID, POWERS, SHIFTS
from learn.features.rows import Grid, Rows, by_pressure
from learn.features.sets import FeatureSet

Sides = tuple[float, float]

# Largest displacement of a coarse solve without edges, over that of full contact. Elastic bodies
# have no equilibrium from full contact on, and blocks of unequal sizes reach it early.
NEARLY_FULL = 0.999
# residual of the coarse solve, over Delta: features need be reproducible, not exact
LOOSE = 1e-3
# smallest rms of the heights that the blocks do not resolve, over the range of all heights
ROUNDING = 1e-12
# Persson's share of the area in contact is erf(sqrt(2) p / (E* h')), with the pressure p and the
# rms slope h'
PERSSON = math.sqrt(2.0)


@dataclass(frozen=True, eq=False)
class BlockEdges:
    """The blocks along one axis."""

    first: NDArray[np.int64]  # (b,), first node of each block
    sizes: NDArray[np.int64]  # (b,), nodes of each block

    def weights(self) -> Values:
        """Return the weights that interpolate from the blocks' centres to the nodes, (n, b)."""
        nodes = np.arange(self.sizes.sum())
        centres = self.first + (self.sizes - 1) / 2
        columns = [np.interp(nodes, centres, unit) for unit in np.eye(centres.size)]
        return np.stack(columns, axis=1)


@dataclass(frozen=True, eq=False)
class Blocks:
    """The blocks of a surface, each with the mean height of its nodes."""

    heights: Values  # (nx, ny) [um]
    steps: tuple[float, float]  # spacing of the nodes along x and y [um]
    # largest number of blocks per side; with fewer nodes every node is a block
    limit: int

    @cached_property
    def means(self) -> Values:
        """Mean height of each block, (bx, by) [um]."""
        return self._over_blocks(self.heights)

    @cached_property
    def roughness(self) -> float:
        """Rms of the heights that the means, interpolated to the nodes, do not resolve [um]."""
        return float(self._unresolved.std())

    @cached_property
    def skewness(self) -> float:
        """Skewness of the heights that the means do not resolve; 0 if there are none [1]."""
        if self.roughness <= ROUNDING * float(np.ptp(self.heights)):
            return 0.0
        from_mean = self._unresolved - self._unresolved.mean()
        return float(np.mean((from_mean / self.roughness) ** 3))

    @cached_property
    def slopes(self) -> Values:
        """Rms slope of the unresolved heights inside each block, (bx, by) [1].

        It is 0 where a block is one node.
        """
        step_x, step_y = self.steps
        along_x = _squared_slopes(self._unresolved, step_x)
        along_y = _squared_slopes(self._unresolved.T, step_y).T
        return np.asarray(np.sqrt(self._over_blocks(along_x + along_y)))

    def interpolated(self, values: Values) -> Values:
        """Interpolate from the blocks' centres to the nodes, constant outside the outer centres.

        Parameters
        ----------
        values : ndarray, shape (bx, by)
            Values of the blocks.

        Returns
        -------
        ndarray, shape (nx, ny)
            Values at the nodes.
        """
        weights_x, weights_y = self._weights
        return np.asarray(weights_x @ values @ weights_y.T)

    def local_area(self, pressure: Values, factor: float) -> float:
        """Return the share of the nodes in contact by Persson's theory, inside each block.

        Pressed blocks without slopes count in full. Source: B. N. J. Persson (2001), J. Chem. Phys.
        115, 3840.

        Parameters
        ----------
        pressure : ndarray, shape (bx, by)
            Mean pressure on each block over E*.
        factor : float
            Factor on the pressures.

        Returns
        -------
        float
            Share of the nodes of the surface, 0 to 1.
        """
        from scipy.special import erf

        pressed = pressure > 0
        with np.errstate(divide="ignore", over="ignore"):
            shares = erf(factor * PERSSON * pressure[pressed] / self.slopes[pressed])
        touching = (self._sizes[pressed] * shares).sum()
        return float(touching) / self.heights.size

    @cached_property
    def _unresolved(self) -> Values:
        """Heights less the interpolated means, (nx, ny) [um]."""
        return np.asarray(self.heights - self.interpolated(self.means))

    def _over_blocks(self, values: Values) -> Values:
        """Return means of nodes, (nx, ny), over each block, (bx, by)."""
        along_x, along_y = self._edges
        sums_x = np.add.reduceat(values, along_x.first, axis=0)
        sums = np.add.reduceat(sums_x, along_y.first, axis=1)
        return np.asarray(sums / self._sizes)

    @cached_property
    def _sizes(self) -> NDArray[np.int64]:
        """Nodes of each block, (bx, by)."""
        along_x, along_y = self._edges
        return np.outer(along_x.sizes, along_y.sizes)

    @cached_property
    def _edges(self) -> list[BlockEdges]:
        """The blocks along x and along y."""
        edges = []
        for nodes in self.heights.shape:
            number = min(nodes, self.limit)
            borders = np.arange(number + 1) * nodes // number
            edges.append(BlockEdges(borders[:-1], np.diff(borders)))
        return edges

    @cached_property
    def _weights(self) -> list[Values]:
        """Weights of the interpolation to the nodes, (nx, bx) and (ny, by)."""
        return [along.weights() for along in self._edges]


def _squared_slopes(heights: Values, step: float) -> Values:
    """Return the squared slope along the first axis at each node, the mean of both its sides."""
    between = (np.diff(heights, axis=0) / step) ** 2
    # At the ends both sides of a node are the same one.
    extended = np.concatenate([between[:1], between, between[-1:]])
    before = extended[:-1]
    after = extended[1:]
    return np.asarray((after + before) / 2)


class Undefined(InputError):
    """Features that need statistics which the surface does not define."""


class CoarseMeans(NamedTuple):
    """Means over the patch of a coarse contact."""

    compliance: float  # mean displacement over F / (E* L), 0 without edges [1]
    # mean depth by which nodes have yielded, 0 for elastic bodies [um]
    yielded_depth: float


@dataclass(frozen=True, eq=False)
class SurfaceFeatures:
    """A surface whose features can be computed at any Delta."""

    heights: Values  # (nx, ny), 2 x 2 or more, finite [um]
    sides: Sides  # scan lengths along x and y [um]
    spacing: Sides  # of the nodes along x and y [um]
    name: str = "the surface"  # in messages
    boundary: Boundary = "free"  # of the patch, also in the coarse solve
    _in_blocks: dict[int, Blocks] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def length(self) -> float:
        """Scan length L, the geometric mean of both sides [um]."""
        return math.sqrt(math.prod(self.sides))

    @cached_property
    def description(self) -> Description:
        """The 22 statistics by name, and why some of them are undefined."""
        return describe(self.heights, self.spacing)

    def rows(
        self,
        features: FeatureSet,
        loads: Values,
        hardness_ratio: Values | float | None = None,
        e_star: float = 1.0,
    ) -> Rows:
        """Return the numbers that features of a set are computed from, one row a load.

        Parameters
        ----------
        features : FeatureSet
            A set of features of surfaces.
        loads : ndarray, shape (k,)
            Displacements Delta [um]; nominal pressures [MPa] if the set is for these.
        hardness_ratio : float or ndarray, shape (k,), optional
            Hardness over E*; elastic bodies if left out.
        e_star : float
            E* of pressures [MPa].

        Returns
        -------
        Rows
            k rows, with the columns of the coarse solve if the set needs them.

        Raises
        ------
        Undefined
            If the surface does not define a statistic.
        InputError
            If a load is not finite and above 0, or a coarse solve fails.
        """
        deltas = loads
        if features.by_pressure:
            deltas = by_pressure(loads, self.length, e_star)
        self._require_usable(deltas)
        notes: tuple[str, ...] = ()
        if not features.by_pressure and hardness_ratio is None:
            notes = self._notes_on_full_contact(deltas)
        hybrid: Values | None = None
        if features.needs_surface:
            ratios: list[float | None] = [None] * deltas.size
            if hardness_ratio is not None:
                ratios = np.broadcast_to(hardness_ratio, deltas.shape).tolist()
            if features.by_pressure:
                deltas = self._reached_deltas(deltas, ratios, features)
            hybrid = self._hybrid_rows(deltas, ratios, features)
        statistics = list(self.description.values.values())
        return Rows(
            statistics=np.tile(statistics, (deltas.size, 1)),
            delta=deltas,
            length=self.length,
            hardness_ratio=hardness_ratio,
            nodes=math.sqrt(self.heights.size),
            hybrid=hybrid,
            notes=notes,
            scene_numbers={"pressure": loads} if features.by_pressure else {},
            grids=(Grid(self.heights.shape, self.sides),),
        )

    def _require_usable(self, deltas: Values) -> None:
        """Refuse displacements that are not finite and above 0, and undefined statistics."""
        wrong = deltas[~((deltas > 0) & (deltas < np.inf))]
        if wrong.size:
            raise InputError(
                f"{self.name}: Delta {wrong[0]:g} um: give finite numbers above 0"
            )
        if self.description.reason:
            raise Undefined(
                f"{self.name}: statistics undefined: {self.description.reason}"
            )

    def _notes_on_full_contact(self, deltas: Values) -> tuple[str, ...]:
        """Return a note for each Delta at which elastic bodies without edges touch everywhere.

        The other notes are empty. There are no notes for a patch with edges.
        """
        if self.boundary == "free":
            return ()
        limit = float((self.heights.max() - self.heights).mean())
        full = f"no equilibrium: the contact is full at delta = {limit:.6g} um"
        return tuple(full if delta >= limit else "" for delta in deltas)

    def _reached_deltas(
        self, loads: Values, ratios: list[float | None], features: FeatureSet
    ) -> Values:
        """Return the Deltas, (k,) [um], at which coarse solves carry pressures times L / E*."""
        blocks = features.blocks or BLOCKS
        pairs = zip(loads, ratios, strict=True)
        return np.array([self.reached(load, ratio, blocks) for load, ratio in pairs])

    def _hybrid_rows(
        self, deltas: Values, ratios: list[float | None], features: FeatureSet
    ) -> Values:
        """Return the columns of `HYBRID` at each Delta, (k, 18)."""
        blocks = features.blocks or BLOCKS
        pairs = zip(deltas.tolist(), ratios, strict=True)
        rows = [self.hybrid(delta, ratio, blocks) for delta, ratio in pairs]
        return np.array(rows).reshape(-1, len(HYBRID))

    def reached(self, load: float, hardness_ratio: float | None, blocks: int) -> float:
        """Return the Delta at which the coarse solve carries a pressure.

        Parameters
        ----------
        load : float
            Nominal pressure times L / E* [um].
        hardness_ratio : float or None
            Hardness over E*; None for elastic bodies.
        blocks : int
            Blocks per side of the coarse solve.

        Returns
        -------
        float
            Delta from the highest node [um].

        Raises
        ------
        InputError
            If the coarse solve fails.
        """
        coarse = self._blocks(blocks)
        contact = self._pressed(coarse, None, hardness_ratio, pressure=load / self.length)
        return contact.delta - self._depth(coarse, 0.0)

    def hybrid(
        self, delta: float, hardness_ratio: float | None = None, blocks: int = BLOCKS
    ) -> tuple[float, ...]:
        """Return the columns that the hybrid set adds, at one Delta.

        Parameters
        ----------
        delta : float
            Displacement Delta, above 0 [um].
        hardness_ratio : float, optional
            Hardness over E*; elastic bodies if left out.
        blocks : int
            Blocks per side of the coarse solve.

        Returns
        -------
        tuple of float
            The 18 columns of `HYBRID` in their order.

        Raises
        ------
        InputError
            If the coarse solve fails.
        """
        interference = self.heights - (float(self.heights.max()) - delta)
        bearing = _above(interference, delta)
        coarse = self._blocks(blocks)
        depth = self._depth(coarse, delta)
        if depth <= 0:  # Delta does not reach the mean of any block
            area = force = mean_displacement = perimeter = 0.0
            return (
                *bearing,
                area,
                force,
                mean_displacement,
                *bearing,
                *(0.0 for _ in FACTORS),
                *_above_shifted(interference, delta, coarse.roughness),
                perimeter,
                coarse.skewness,
            )
        contact = self._pressed(coarse, depth, hardness_ratio)
        # Only nodes count that stand above the displacement by more than the solve's residual.
        displacement = coarse.interpolated(contact.displacement)
        standing = interference - displacement - LOOSE * delta
        return (
            *bearing,
            contact.area_percent,
            contact.force / (self.length * delta),
            self._mean_displacement(contact) / delta,
            *_above(standing, delta),
            *(coarse.local_area(contact.pressure, factor) for factor in FACTORS),
            *_above_shifted(standing, delta, coarse.roughness),
            contact.perimeter / self.length,
            coarse.skewness,
        )

    def _pressed(
        self,
        coarse: Blocks,
        depth: float | None,
        hardness_ratio: float | None,
        pressure: float | None = None,
    ) -> bem.Contact:
        """Solve the contact of the block means with E* = 1 MPa.

        The load is either a depth below the highest block [um] or a nominal pressure [MPa].
        """
        means = coarse.means
        step_x, step_y = self.spacing
        nodes_x, nodes_y = self.heights.shape
        blocks_x, blocks_y = means.shape
        steps = (step_x * nodes_x / blocks_x, step_y * nodes_y / blocks_y)
        if self.boundary != "free" and hardness_ratio is None and depth is not None:
            full = float(means.max()) - float(means.mean())
            depth = min(depth, NEARLY_FULL * full)
        try:
            return bem.solve(
                means,
                self.sides,
                depth,
                pressure=pressure,
                spacing=steps,
                boundary=self.boundary,
                hardness=hardness_ratio,
                rtol=LOOSE,
            )
        except (bem.NotConverged, ArithmeticError, ValueError) as error:
            raise InputError(f"{self.name}: coarse contact: {error}") from None

    def means(self, delta: float, hardness_ratio: float | None = None) -> CoarseMeans:
        """Return means of the coarse solve that belong to the patch as a whole.

        The compliance times F / (E* L), with the force of a finer solve, gives the mean
        displacement of that solve: it depends on the distribution of the load over the patch, and
        hardly on its distribution over single nodes.

        Parameters
        ----------
        delta : float
            Displacement Delta, above 0 [um].
        hardness_ratio : float, optional
            Hardness over E*; elastic bodies if left out.

        Returns
        -------
        CoarseMeans
            Both means; they are 0 for elastic bodies without edges.

        Raises
        ------
        InputError
            If the coarse solve fails.
        """
        if self.boundary != "free" and hardness_ratio is None:
            return CoarseMeans(0.0, 0.0)
        coarse = self._blocks(BLOCKS)
        depth = max(self._depth(coarse, delta), 1e-3 * delta)
        contact = self._pressed(coarse, depth, hardness_ratio)
        compliance = self._mean_displacement(contact) * self.length / contact.force
        if hardness_ratio is None:
            return CoarseMeans(compliance, 0.0)
        return CoarseMeans(compliance, float(contact.yielded_depth.mean()))

    def _mean_displacement(self, contact: bem.Contact) -> float:
        """Return the mean displacement of a coarse contact, which is 0 without edges [um]."""
        if self.boundary != "free":
            return 0.0
        return float(contact.displacement.mean())

    def _depth(self, coarse: Blocks, delta: float) -> float:
        """Return how far Delta reaches below the highest block [um]."""
        highest_node = float(self.heights.max())
        highest_block = float(coarse.means.max())
        return delta - (highest_node - highest_block)

    def _blocks(self, number: int) -> Blocks:
        """Return the surface in a number of blocks per side, one less without edges.

        The blocks are kept for the next call.
        """
        if number not in self._in_blocks:
            limit = number if self.boundary == "free" else number - 1
            self._in_blocks[number] = Blocks(self.heights, self.spacing, limit)
        return self._in_blocks[number]


def _above(interference: Values, delta: float) -> tuple[float, float]:
    """Return the share of nodes above 0, and the mean of the positive part over Delta."""
    above = np.maximum(interference, 0.0)
    share = np.count_nonzero(above) / above.size
    return share, float(above.mean()) / delta


def _above_shifted(
    interference: Values, delta: float, roughness: float
) -> tuple[float, ...]:
    """Return the shares of nodes above shifted displacements, and norms of the positive part.

    The interference is that of the heights above the displacement [um], the roughness the rms of
    the heights that the blocks do not resolve [um]; the norms are over Delta.
    """
    shares = []
    for shift in SHIFTS:
        number = np.count_nonzero(interference > shift * roughness)
        shares.append(number / interference.size)
    above = np.maximum(interference, 0.0) / delta
    norms = [float((above**power).mean()) ** (1 / power) for power in POWERS]
    return (*shares, *norms)
