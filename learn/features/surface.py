"""Features of the hybrid set, from the heights of a surface and a coarse contact solve.

Bearing area and bearing interference are those of a surface that does not deform. A contact solve
on 33 x 33 blocks (or 65 x 65), each with the mean height of its nodes, gives area, force and a
smooth displacement. The displacement is interpolated to the nodes; the `refined` features count the
nodes that stand above it, so that the highest nodes are not lost in the means of their blocks
(there are none where every node is a block). Delta is measured from the highest node throughout.

Surrogates see more of the same solve (`learn.features.sets.LOCAL`): the area in contact inside the
blocks by Persson's theory, the nodes that stand above shifted displacements, and how far. The
blocks are pressed as if each were smooth. What their means do not resolve is described by its rms
height and, for each block, by the rms slope inside it; from this slope and the pressure on a block
follows the share of it that is in contact.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

import bem
from bem.problem import Boundary
from gen.arrays import Values
from gen.runtime.errors import InputError
from gen.statistics import Description, describe
from learn.features.sets import (
    BLOCKS,
    FACTORS,
    HYBRID,
    POWERS,
    SHIFTS,
    FeatureSet,
    Rows,
    Sides,
    by_pressure,
)

# largest displacement of a coarse solve without edges, over that of full contact: elastic bodies
# have no equilibrium from full contact on, and blocks of unequal sizes come to it early
NEARLY_FULL = 0.999
LOOSE = 1e-3  # residual of the coarse solve, over Delta: features need be reproducible, not exact
ROUNDING = 1e-12  # least rms of the heights that the blocks do not resolve, over the range of all
# Persson's share of the area in contact is erf(sqrt(2) p / (E* h')), with the pressure p and the
# rms slope h'
PERSSON = math.sqrt(2.0)


@dataclass(frozen=True, eq=False)
class Blocks:
    """The blocks of a surface."""

    heights: Values  # (nx, ny) [um]
    steps: tuple[float, float]  # spacing of the nodes along x and y [um]
    most: int  # blocks per side at most; with fewer nodes every node is a block

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
        """Skewness of these heights; 0 where there are none [1]."""
        if self.roughness <= ROUNDING * float(np.ptp(self.heights)):
            return 0.0
        rest = self._unresolved - self._unresolved.mean()
        return float(np.mean((rest / self.roughness) ** 3))

    @cached_property
    def slopes(self) -> Values:
        """Rms slope of these heights inside each block, (bx, by); 0 where it is one node [1]."""
        rest, (step_x, step_y) = self._unresolved, self.steps
        squares = _squares(rest, step_x) + _squares(rest.T, step_y).T
        return np.asarray(np.sqrt(self._over_blocks(squares)))

    def interpolated(self, values: Values) -> Values:
        """Interpolate from the blocks' centres to the nodes, (nx, ny), constant outside."""
        across, along = self._weights
        return np.asarray(across @ values @ along.T)

    def local_area(self, pressure: Values, factor: float) -> float:
        """Return the share of the nodes in contact by Persson's theory, inside each block.

        The pressure on each block is over E*, and multiplied by the factor. Blocks without slopes
        count in full where they are pressed. Source: B. N. J. Persson (2001), J. Chem. Phys. 115,
        3840.
        """
        from scipy.special import erf

        pressed = pressure > 0
        with np.errstate(divide="ignore", over="ignore"):
            shares = erf(factor * PERSSON * pressure[pressed] / self.slopes[pressed])
        (_, sizes_x), (_, sizes_y) = self._along
        return (
            float((np.outer(sizes_x, sizes_y)[pressed] * shares).sum())
            / self.heights.size
        )

    @cached_property
    def _unresolved(self) -> Values:
        """Heights less the interpolated means, (nx, ny) [um]."""
        return np.asarray(self.heights - self.interpolated(self.means))

    def _over_blocks(self, values: Values) -> Values:
        """Return means of nodes over each block, (bx, by)."""
        (rows, sizes_x), (columns, sizes_y) = self._along
        sums = np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
        return np.asarray(sums / np.outer(sizes_x, sizes_y))

    @cached_property
    def _along(self) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """First node and size of each block, along x and along y."""
        numbers = [min(nodes, self.most) for nodes in self.heights.shape]
        edges = [
            np.arange(n + 1) * nodes // n
            for n, nodes in zip(numbers, self.heights.shape, strict=True)
        ]
        return [(each[:-1], np.diff(each)) for each in edges]

    @cached_property
    def _weights(self) -> list[Values]:
        """Weights of this interpolation, (nx, bx) and (ny, by)."""
        weights = []
        for first, sizes in self._along:
            nodes, centres = np.arange(sizes.sum()), first + (sizes - 1) / 2
            unit = [np.interp(nodes, centres, each) for each in np.eye(centres.size)]
            weights.append(np.stack(unit, axis=1))
        return weights


def _squares(heights: Values, step: float) -> Values:
    """Return the squared slope along the first axis at each node, the mean of both sides of it."""
    between = (np.diff(heights, axis=0) / step) ** 2
    ends = np.concatenate([between[:1], between, between[-1:]])
    return np.asarray((ends[1:] + ends[:-1]) / 2)


class Undefined(InputError):
    """Features that need statistics which the surface does not define."""


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
        """Return the numbers that features of a set are computed from, at k loads.

        Loads are displacements [um], or pressures [MPa] on bodies of an E* [MPa] if the set is for
        these. The hardness over E* is one number, or (k,). `Undefined` is raised if a statistic is
        missing, InputError if a load is not above 0.
        """
        pressed, length = features.load == "pressure", math.sqrt(math.prod(self.sides))
        deltas = by_pressure(loads, length, e_star) if pressed else loads
        wrong = deltas[~((deltas > 0) & (deltas < np.inf))]
        if wrong.size:
            raise InputError(
                f"{self.name}: Delta {wrong[0]:g} um: give finite numbers above 0"
            )
        described, notes, hybrid = self.description, tuple[str, ...](), None
        if described.reason:
            raise Undefined(f"{self.name}: statistics undefined: {described.reason}")
        if self.boundary != "free" and hardness_ratio is None and not pressed:
            limit = float((self.heights.max() - self.heights).mean())
            full = f"no equilibrium: the contact is full at delta = {limit:.6g} um"
            notes = tuple(full * bool(each >= limit) for each in deltas)
        if features.needs_surface:
            blocks = features.blocks or BLOCKS
            ratios = [None] * deltas.size
            if hardness_ratio is not None:
                ratios = np.broadcast_to(hardness_ratio, deltas.shape).tolist()
            if pressed:
                pairs = zip(deltas, ratios, strict=True)
                deltas = np.array(
                    [self.reached(delta, ratio, blocks) for delta, ratio in pairs]
                )
            pairs = zip(deltas.tolist(), ratios, strict=True)
            every = [self.hybrid(delta, ratio, blocks) for delta, ratio in pairs]
            hybrid = np.array(every).reshape(-1, len(HYBRID))
        statistics = np.tile(list(described.values.values()), (deltas.size, 1))
        own = length, hardness_ratio, math.sqrt(self.heights.size), hybrid, notes
        grid = self.heights.shape, self.sides
        return Rows(
            statistics, deltas, *own, {"pressure": loads} if pressed else {}, (grid,)
        )

    def reached(self, load: float, hardness_ratio: float | None, blocks: int) -> float:
        """Return the Delta at which the coarse solve carries a pressure times L / E* [um]."""
        contact = self._pressed(
            self._blocks(blocks), None, hardness_ratio, load / self.length
        )
        return contact.delta - self._depth(self._blocks(blocks), 0.0)

    def hybrid(
        self, delta: float, hardness_ratio: float | None = None, blocks: int = BLOCKS
    ) -> tuple[float, ...]:
        """Return the columns of `HYBRID`, which the hybrid set adds, at one Delta above 0 [um]."""
        interference = self.heights - (float(self.heights.max()) - delta)
        bearing, coarse = _above(interference, delta), self._blocks(blocks)
        depth = self._depth(coarse, delta)
        if depth <= 0:  # not one block's mean is reached
            counted = *bearing, 0.0, 0.0, 0.0, *bearing
            shares = (0.0,) * len(FACTORS)
            shifted = _shifted(interference, delta, coarse.roughness)
            return *counted, *shares, *shifted, 0.0, coarse.skewness
        contact = self._pressed(coarse, depth, hardness_ratio)
        # Only nodes that stand above it by more than the residual of the coarse solve.
        stands = interference - coarse.interpolated(contact.displacement) - LOOSE * delta
        return (
            *bearing,
            contact.area_percent,
            contact.force / (self.length * delta),
            self._mean_displacement(contact) / delta,
            *_above(stands, delta),
            *(coarse.local_area(contact.pressure, factor) for factor in FACTORS),
            *_shifted(stands, delta, coarse.roughness),
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
        """Solve the contact of the block means with E* = 1 MPa."""
        means, (step_x, step_y), (nx, ny) = coarse.means, self.spacing, self.heights.shape
        blocks_x, blocks_y = means.shape
        steps = step_x * nx / blocks_x, step_y * ny / blocks_y
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

    def means(
        self, delta: float, hardness_ratio: float | None = None
    ) -> tuple[float, float]:
        """Return the coarse solve's mean displacement over F / (E* L) and mean yielded depth [um].

        Multiplied by F / (E* L) with the force of a finer solve, the first gives the mean
        displacement of that solve: it depends on the distribution of the load over the patch, and
        hardly on its distribution over single nodes. Without edges the mean displacement is 0.
        """
        if self.boundary != "free" and hardness_ratio is None:
            return 0.0, 0.0
        coarse = self._blocks(BLOCKS)
        depth = max(self._depth(coarse, delta), 1e-3 * delta)
        contact = self._pressed(coarse, depth, hardness_ratio)
        compliance = self._mean_displacement(contact) * self.length / contact.force
        if hardness_ratio is None:
            return compliance, 0.0
        return compliance, float(contact.yielded_depth.mean())

    def _mean_displacement(self, contact: bem.Contact) -> float:
        """Return the mean displacement of a coarse contact, which is 0 without edges [um]."""
        return float(contact.displacement.mean()) if self.boundary == "free" else 0.0

    def _depth(self, coarse: Blocks, delta: float) -> float:
        """Return how far Delta reaches below the highest block [um]."""
        return delta - (float(self.heights.max()) - float(coarse.means.max()))

    def _blocks(self, number: int) -> Blocks:
        """Return the surface in a number of blocks per side, one less without edges."""
        if number not in self._in_blocks:
            most = number if self.boundary == "free" else number - 1
            self._in_blocks[number] = Blocks(self.heights, self.spacing, most)
        return self._in_blocks[number]


def _above(interference: Values, delta: float) -> tuple[float, float]:
    """Return the share of nodes above 0, and the mean of the positive part over Delta."""
    above = np.maximum(interference, 0.0)
    return np.count_nonzero(above) / above.size, float(above.mean()) / delta


def _shifted(interference: Values, delta: float, roughness: float) -> tuple[float, ...]:
    """Return the shares of nodes above shifted displacements, and norms of the positive part.

    The interference is that of the heights above the displacement [um], the roughness the rms of
    the heights that the blocks do not resolve [um].
    """
    shares = [np.count_nonzero(interference > shift * roughness) for shift in SHIFTS]
    above = np.maximum(interference, 0.0) / delta
    norms = [float((above**power).mean()) ** (1 / power) for power in POWERS]
    return *(share / interference.size for share in shares), *norms
