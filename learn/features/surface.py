"""Features of the hybrid set, from the heights of a surface and a coarse contact solve.

Bearing area and bearing interference are the share and the mean interference of the nodes that a
rigid plane would cut at Delta, if the surface did not deform. The coarse solve is a contact of 33 x
33 blocks (or 65 x 65), each a smooth body at the mean height of its nodes. It gives area, force and
a smooth displacement, which is interpolated to the nodes. The `refined` features count the nodes
above this displacement, because the highest nodes are lost in the means of their blocks. There are
none if each node is a block. Delta is measured from the highest node throughout.

Surrogates see further results of the coarse solve (`learn.features.columns.LOCAL`): the area in
contact inside the blocks by Persson's theory, the share of the nodes above shifted displacements,
and norms of their interference. The heights that the means of the blocks do not resolve have one
rms for the surface and one rms slope for each block. This slope and the pressure on the block
decide which share of the block is in contact.
"""

from __future__ import annotations  # so that help() shows the short names of types

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import bem
from bem.problem import Boundary
from gen.arrays import Values
from gen.runtime.errors import InputError
from gen.scene.scene import THINNEST
from gen.statistics import Description, describe
from learn.features.columns import BLOCKS, FACTORS, HYBRID, POWERS, SHIFTS
from learn.features.layers import Layers
from learn.features.rows import Grid, Rows, by_pressure
from learn.features.sets import FeatureSet

Sides = tuple[float, float]  # lengths along x and y [um]

# Largest depth of a coarse solve of elastic bodies without edges, over the depth of full contact.
# There is no equilibrium beyond full contact, which blocks may reach before the surface does.
NEARLY_FULL = 0.999
# Residual at which the coarse solve ends, over Delta. Features must be reproducible, not exact.
LOOSE = 1e-3
# Smallest rms of unresolved heights, over the range of all heights; a smaller one is only rounding.
ROUNDING = 1e-12
# Factor in Persson's share of the area in contact, erf(sqrt(2) p / (E* h')), with the pressure p
# and the rms slope h'.
PERSSON = math.sqrt(2.0)
# Smallest depth of a coarse solve for `SurfaceFeatures.means`, over Delta.
SMALLEST_DEPTH = 1e-3


@dataclass(frozen=True, eq=False)
class BlockEdges:
    """The blocks along one axis."""

    first: NDArray[np.int64]  # (b,), first node of each block
    sizes: NDArray[np.int64]  # (b,), nodes of each block

    def weights(self) -> Values:
        """Return the weights that interpolate linearly from b block centres to n nodes, (n, b)."""
        nodes = np.arange(self.sizes.sum())
        centres = self.first + (self.sizes - 1) / 2
        columns = [np.interp(nodes, centres, unit) for unit in np.eye(centres.size)]
        return np.stack(columns, axis=1)


@dataclass(frozen=True, eq=False)
class Blocks:
    """The blocks of a surface, each with the mean height of its nodes."""

    heights: Values  # (nx, ny) [um]
    steps: Sides  # spacing of the nodes along x and y [um]
    # largest number of blocks per side; along a side with fewer nodes, each node is a block
    limit: int

    @cached_property
    def means(self) -> Values:
        """Mean height of each block, (bx, by) [um]."""
        return self._over_blocks(self.heights)

    @cached_property
    def roughness(self) -> float:
        """Rms of the unresolved heights: heights less the interpolated means of the blocks [um]."""
        return float(self._unresolved.std())

    @cached_property
    def skewness(self) -> float:
        """Skewness of the unresolved heights [1]; 0 if these are zero but for rounding."""
        if self.roughness <= ROUNDING * float(np.ptp(self.heights)):
            return 0.0
        from_mean = self._unresolved - self._unresolved.mean()
        return float(np.mean((from_mean / self.roughness) ** 3))

    @cached_property
    def slopes(self) -> Values:
        """Rms slope of the unresolved heights inside each block, (bx, by) [1].

        It is 0 if each node is a block.
        """
        step_x, step_y = self.steps
        along_x = _squared_slopes(self._unresolved, step_x)
        along_y = _squared_slopes(self._unresolved.T, step_y).T
        return np.asarray(np.sqrt(self._over_blocks(along_x + along_y)))

    def interpolated(self, values: Values) -> Values:
        """Interpolate from the blocks' centres to the nodes.

        Values are constant from the outermost centres to the borders.

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
        """Return the share of the nodes in contact, with Persson's theory inside each block.

        A pressed block without slopes is in full contact.

        Source: B. N. J. Persson (2001), J. Chem. Phys. 115, 3840.

        Parameters
        ----------
        pressure : ndarray, shape (bx, by)
            Mean pressure on each block over E*.
        factor : float
            Factor by which the pressures are multiplied, one of `FACTORS`.

        Returns
        -------
        float
            Share of the nodes of the surface, 0 to 1.
        """
        from scipy.special import erf

        pressed = pressure > 0
        # A slope of 0 gives erf(inf) = 1.
        with np.errstate(divide="ignore", over="ignore"):
            shares = erf(factor * PERSSON * pressure[pressed] / self.slopes[pressed])
        nodes_in_contact = (self._sizes[pressed] * shares).sum()
        return float(nodes_in_contact) / self.heights.size

    @cached_property
    def _unresolved(self) -> Values:
        """Heights less the interpolated means, (nx, ny) [um]."""
        return np.asarray(self.heights - self.interpolated(self.means))

    def _over_blocks(self, values: Values) -> Values:
        """Return the means over each block, (bx, by), of values at the nodes, (nx, ny)."""
        along_x, along_y = self._edges
        sums_x = np.add.reduceat(values, along_x.first, axis=0)
        sums = np.add.reduceat(sums_x, along_y.first, axis=1)
        return np.asarray(sums / self._sizes)

    @cached_property
    def _sizes(self) -> NDArray[np.int64]:
        """Number of nodes of each block, (bx, by)."""
        along_x, along_y = self._edges
        return np.outer(along_x.sizes, along_y.sizes)

    @cached_property
    def _edges(self) -> list[BlockEdges]:
        """Blocks along x and along y, of sizes that differ by at most one node."""
        edges = []
        for nodes in self.heights.shape:
            number = min(nodes, self.limit)
            borders = np.arange(number + 1) * nodes // number
            edges.append(BlockEdges(borders[:-1], np.diff(borders)))
        return edges

    @cached_property
    def _weights(self) -> list[Values]:
        """Weights of the interpolation to the nodes along x, (nx, bx), and along y, (ny, by)."""
        return [along_axis.weights() for along_axis in self._edges]


def _squared_slopes(heights: Values, step: float) -> Values:
    """Return the squared slope along the first axis at each node, (nx, ny) [1].

    It is the mean over the two intervals beside the node. Heights, (nx, ny), and step are in um.
    """
    between = (np.diff(heights, axis=0) / step) ** 2
    # An outermost node has one interval, which counts twice.
    extended = np.concatenate([between[:1], between, between[-1:]])
    before = extended[:-1]
    after = extended[1:]
    return np.asarray((after + before) / 2)


@dataclass(frozen=True)
class CoarseMaterial:
    """Material of the bodies in a coarse solve, in which E* is 1 MPa."""

    hardness_ratio: float | None = None  # hardness over E*; None for elastic bodies
    # Body with a layer, of which all moduli are over E*; None for half-spaces.
    layer: bem.Layered | None = None

    @classmethod
    def of(cls, hardness_ratio: float | None, body: bem.Layered | None) -> CoarseMaterial:
        """Return the material of bodies.

        Parameters
        ----------
        hardness_ratio : float or None
            Hardness over E*; None for elastic bodies.
        body : bem.Layered or None
            Body with a layer; None for half-spaces.

        Returns
        -------
        CoarseMaterial
            The material, with all moduli over E*.
        """
        if body is None:
            return cls(hardness_ratio=hardness_ratio)
        layer = body.scaled(moduli=1 / body.e_star)
        return cls(hardness_ratio=hardness_ratio, layer=layer)

    @property
    def has_full_contact(self) -> bool:
        """Whether a patch without edges has a Delta of full contact.

        Beyond this Delta no equilibrium exists. Bodies that yield, or that a mean pressure
        compresses, have an equilibrium at any Delta.
        """
        if self.hardness_ratio is not None:
            return False
        return self.layer is None or not self.layer.mean_compliance

    def with_smallest_thickness(self, smallest: float) -> CoarseMaterial:
        """Return the material with a thinner layer thickened to the smallest thickness [um]."""
        if self.layer is None or self.layer.thickness >= smallest:
            return self
        return replace(self, layer=replace(self.layer, thickness=smallest))


ELASTIC = CoarseMaterial()


def _materials(
    hardness_ratio: Values | float | None, bodies: Sequence[bem.Layered], number: int
) -> list[CoarseMaterial]:
    """Return the materials of the coarse solves of a number of contacts.

    The hardness over E* is one number, one for each contact, or None. The bodies are those of the
    contacts, one body for all of them, or none for half-spaces.
    """
    ratios: list[float | None] = [None] * number
    if hardness_ratio is not None:
        ratios = np.broadcast_to(hardness_ratio, number).tolist()
    layers: list[bem.Layered | None] = [None] * number
    if len(bodies) == 1:
        layers = [bodies[0]] * number
    elif bodies:
        layers = list(bodies)
    return [
        CoarseMaterial.of(ratio, layer)
        for ratio, layer in zip(ratios, layers, strict=True)
    ]


class Undefined(InputError):
    """Raised for a surface for which any of the 22 statistics is undefined."""


class CoarseMeans(NamedTuple):
    """Means over the patch of a coarse contact solve."""

    # mean displacement over F / (E* L); 0 for a patch without edges [1]
    compliance: float
    # mean depth by which blocks have yielded; 0 for elastic bodies [um]
    yielded_depth: float


@dataclass(frozen=True, eq=False)
class SurfaceFeatures:
    """A surface, with methods that compute its features at any load."""

    heights: Values  # (nx, ny), 2 x 2 or more, finite [um]
    sides: Sides  # scan lengths along x and y [um]
    spacing: Sides  # distances of neighbouring nodes along x and y [um]
    name: str = "the surface"  # name in messages
    boundary: Boundary = "free"  # of the patch; the coarse solve has it, too
    # The surface in blocks, by the number of blocks per side; `_blocks` fills it.
    _in_blocks: dict[int, Blocks] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def length(self) -> float:
        """Scan length L, the geometric mean of both sides [um]."""
        return math.sqrt(math.prod(self.sides))

    @cached_property
    def description(self) -> Description:
        """The 22 statistics by name, and the reason if some are undefined, "" if none is."""
        return describe(self.heights, self.spacing)

    def rows(
        self,
        features: FeatureSet,
        loads: Values,
        hardness_ratio: Values | float | None = None,
        e_star: float = 1.0,
        bodies: Sequence[bem.Layered] = (),
    ) -> Rows:
        """Return the numbers from which features of a set are computed, one row for each load.

        Parameters
        ----------
        features : FeatureSet
            A set of features of surfaces.
        loads : ndarray, shape (k,)
            Displacements Delta [um], or nominal pressures [MPa] for a set by pressure.
        hardness_ratio : float or ndarray, shape (k,), optional
            Hardness over E*; bodies are elastic if left out.
        e_star : float
            E* of half-spaces [MPa], used for pressures only; layers have their own E*.
        bodies : sequence of bem.Layered
            Body of each row, or one body for all rows; empty for half-spaces.

        Returns
        -------
        Rows
            k rows, with the columns of the coarse solve if the set needs them. Under pressures,
            `delta` is the Delta of the coarse solve or, for a set without one, the length
            p L / E* (`by_pressure`). For elastic bodies under Deltas, a row with a Delta at which
            no equilibrium exists has a note; otherwise `notes` is empty.

        Raises
        ------
        Undefined
            If any of the 22 statistics is undefined for the surface.
        InputError
            If a load is not finite or not above 0, or a coarse solve fails.
        """
        layers: Layers | None = None
        e_star_of_bodies: Values | float = e_star
        if bodies:
            layers = Layers.of_bodies(bodies)
            e_star_of_bodies = layers.e_star
        # Delta, or the length p L / E* that replaces it under pressures.
        lengths = loads
        scene_numbers: dict[str, Values] = {}
        if features.by_pressure:
            lengths = by_pressure(loads, self.length, e_star_of_bodies)
            scene_numbers["pressure"] = loads
        self._require_usable(loads, lengths, are_pressures=features.by_pressure)
        notes: tuple[str, ...] = ()
        if not features.by_pressure and hardness_ratio is None:
            notes = self._notes_on_full_contact(loads, bodies)
        deltas = lengths
        hybrid: Values | None = None
        if features.needs_surface:
            materials = _materials(hardness_ratio, bodies, loads.size)
            if features.by_pressure:
                # The features are those at the Delta that the coarse solve reaches.
                deltas = self._reached_deltas(lengths, materials, features)
            hybrid = self._hybrid_rows(deltas, materials, features)
        statistics = list(self.description.values.values())
        return Rows(
            statistics=np.tile(statistics, (loads.size, 1)),
            delta=deltas,
            length=self.length,
            hardness_ratio=hardness_ratio,
            nodes=math.sqrt(self.heights.size),
            hybrid=hybrid,
            notes=notes,
            scene_numbers=scene_numbers,
            grids=(Grid(shape=self.heights.shape, sides=self.sides),),
            layers=layers,
        )

    def _require_usable(
        self, loads: Values, lengths: Values, *, are_pressures: bool
    ) -> None:
        """Refuse loads that are not finite and above 0, and surfaces with undefined statistics.

        The loads, (k,), are pressures [MPa] if `are_pressures` is True, otherwise Deltas [um]. The
        lengths, (k,) [um], are the Deltas or the lengths that replace the pressures; a pressure
        whose length overflows or underflows is refused, too.
        """
        usable = (lengths > 0) & (lengths < np.inf)  # False for NaN, too
        refused = loads[~usable]
        if refused.size:
            load = f"Delta {refused[0]:g} um"
            if are_pressures:
                load = f"pressure {refused[0]:g} MPa"
            raise InputError(f"{self.name}: {load}: give finite numbers above 0")
        if self.description.reason:
            raise Undefined(
                f"{self.name}: statistics undefined: {self.description.reason}"
            )

    def _notes_on_full_contact(
        self, deltas: Values, bodies: Sequence[bem.Layered]
    ) -> tuple[str, ...]:
        """Return for each Delta, (k,) [um], a note if the contact of elastic bodies is full.

        The note is "" below full contact. The tuple is empty if the contact has an equilibrium at
        any Delta: on a patch with edges, and on bodies that a mean pressure compresses.
        """
        if self.boundary == "free" or any(body.mean_compliance for body in bodies):
            return ()
        delta_of_full_contact = float((self.heights.max() - self.heights).mean())
        note = f"no equilibrium: the contact is full at delta = {delta_of_full_contact:.6g} um"
        return tuple(np.where(deltas >= delta_of_full_contact, note, "").tolist())

    def _reached_deltas(
        self, lengths: Values, materials: Sequence[CoarseMaterial], features: FeatureSet
    ) -> Values:
        """Return the Deltas, (k,) [um], at which coarse solves carry given pressures.

        `lengths`, (k,), are the pressures times L / E* [um]; `materials` are those of k contacts.
        """
        blocks = features.blocks or BLOCKS
        pairs = zip(lengths, materials, strict=True)
        return np.array(
            [self.reached(length, material, blocks) for length, material in pairs]
        )

    def _hybrid_rows(
        self, deltas: Values, materials: Sequence[CoarseMaterial], features: FeatureSet
    ) -> Values:
        """Return the columns of `HYBRID`, (k, 18), at each Delta, (k,) [um].

        `materials` are those of k contacts.
        """
        blocks = features.blocks or BLOCKS
        pairs = zip(deltas.tolist(), materials, strict=True)
        rows = [self.hybrid(delta, material, blocks) for delta, material in pairs]
        return np.array(rows).reshape(-1, len(HYBRID))

    def reached(
        self, scaled_pressure: float, material: CoarseMaterial, blocks: int
    ) -> float:
        """Return the Delta at which the coarse solve carries a pressure.

        Parameters
        ----------
        scaled_pressure : float
            Nominal pressure times L / E*, a length [um].
        material : CoarseMaterial
            Material of the bodies.
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
        # The coarse solve has E* = 1 MPa: its pressure is the pressure over E*.
        pressure = scaled_pressure / self.length
        contact = self._pressed(coarse, depth=None, material=material, pressure=pressure)
        # Its Delta is measured from the highest block, which is below the highest node.
        return contact.delta + self._height_above_blocks(coarse)

    def hybrid(
        self, delta: float, material: CoarseMaterial = ELASTIC, blocks: int = BLOCKS
    ) -> tuple[float, ...]:
        """Return the columns of the coarse solve at one Delta.

        Parameters
        ----------
        delta : float
            Displacement Delta, above 0 [um].
        material : CoarseMaterial
            Material of the bodies; elastic half-spaces if left out.
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
        if depth <= 0:
            # Delta does not reach the mean of any block: all results of the coarse solve are 0.
            # With a displacement of 0, the refined features are those of the rigid plane.
            return (
                *bearing,
                0.0,  # area
                0.0,  # force
                0.0,  # mean displacement
                *bearing,  # the refined features
                *[0.0] * len(FACTORS),  # local areas
                *_above_shifted(interference, delta, coarse.roughness),
                0.0,  # perimeter
                coarse.skewness,
            )
        contact = self._pressed(coarse, depth=depth, material=material)
        displacement = coarse.interpolated(contact.displacement)
        # The residual of the solve is subtracted: nodes within it are not above the displacement.
        above = interference - displacement - LOOSE * delta
        return (
            *bearing,
            contact.area_percent,
            contact.force / (self.length * delta),
            self._mean_displacement(contact) / delta,
            *_above(above, delta),
            *(coarse.local_area(contact.pressure, factor) for factor in FACTORS),
            *_above_shifted(above, delta, coarse.roughness),
            contact.perimeter / self.length,
            coarse.skewness,
        )

    def _pressed(
        self,
        coarse: Blocks,
        depth: float | None,
        material: CoarseMaterial,
        pressure: float | None = None,
    ) -> bem.Contact:
        """Solve the contact of the blocks with E* = 1 MPa; raise InputError if that fails.

        The load is a depth below the highest block [um] or, with depth None, a nominal pressure
        over E*. A depth of elastic bodies without edges is at most `NEARLY_FULL` times the depth at
        which the blocks are in full contact; larger ones are reduced to this. Bodies that a mean
        pressure compresses have no such limit. On a free patch, layers that are too thin for the
        blocks to be solved are replaced by layers of the smallest thickness that can be solved.
        """
        means = coarse.means
        step_x, step_y = self.spacing
        nodes_x, nodes_y = self.heights.shape
        blocks_x, blocks_y = means.shape
        # Mean distances of neighbouring blocks, whose sizes may differ by one node.
        steps = (step_x * nodes_x / blocks_x, step_y * nodes_y / blocks_y)
        if self.boundary == "free":
            material = material.with_smallest_thickness(THINNEST * max(steps))
        elif depth is not None and material.has_full_contact:
            depth_of_full_contact = float(means.max()) - float(means.mean())
            depth = min(depth, NEARLY_FULL * depth_of_full_contact)
        try:
            return bem.solve(
                means,
                self.sides,
                depth,
                pressure=pressure,
                spacing=steps,
                boundary=self.boundary,
                body=material.layer,
                hardness=material.hardness_ratio,
                rtol=LOOSE,
            )
        except (bem.NotConverged, ArithmeticError, ValueError) as error:
            raise InputError(f"{self.name}: coarse contact: {error}") from None

    def means(self, delta: float, hardness_ratio: float | None = None) -> CoarseMeans:
        """Return compliance and mean yielded depth of a coarse solve of half-spaces at one Delta.

        The mean displacement depends little on which single nodes carry the load. For a solve on
        all nodes with the force F it is therefore about compliance * F / (E* L) [um], with the
        compliance of the coarse solve.

        Parameters
        ----------
        delta : float
            Displacement Delta, above 0 [um].
        hardness_ratio : float, optional
            Hardness over E*; elastic bodies if left out.

        Returns
        -------
        CoarseMeans
            Both means, 0 for elastic bodies without edges.

        Raises
        ------
        InputError
            If the coarse solve fails.
        """
        if self.boundary != "free" and hardness_ratio is None:
            return CoarseMeans(compliance=0.0, yielded_depth=0.0)
        coarse = self._blocks(BLOCKS)
        # A Delta that reaches no block has the means of a very light contact.
        depth = max(self._depth(coarse, delta), SMALLEST_DEPTH * delta)
        material = CoarseMaterial(hardness_ratio=hardness_ratio)
        contact = self._pressed(coarse, depth=depth, material=material)
        # The coarse solve has E* = 1 MPa, so that F / (E* L) is its force over L.
        compliance = self._mean_displacement(contact) * self.length / contact.force
        yielded_depth = 0.0
        if hardness_ratio is not None:
            yielded_depth = float(contact.yielded_depth.mean())
        return CoarseMeans(compliance=compliance, yielded_depth=yielded_depth)

    def _mean_displacement(self, contact: bem.Contact) -> float:
        """Return the mean displacement of a coarse contact [um].

        It is 0 for a patch without edges, unless a mean pressure compresses the body.
        """
        if self.boundary != "free" and not contact.problem.body.mean_compliance:
            return 0.0
        return float(contact.displacement.mean())

    def _depth(self, coarse: Blocks, delta: float) -> float:
        """Return the depth of the rigid plane below the mean height of the highest block [um].

        It is negative if Delta, measured from the highest node, does not reach this height.
        """
        return delta - self._height_above_blocks(coarse)

    def _height_above_blocks(self, coarse: Blocks) -> float:
        """Return the height of the highest node above the mean of the highest block [um]."""
        return float(self.heights.max()) - float(coarse.means.max())

    def _blocks(self, number: int) -> Blocks:
        """Return the surface in `number` blocks per side, or one less if the patch has no edges.

        The blocks are kept in `_in_blocks`, and returned by further calls with this number.
        """
        if number not in self._in_blocks:
            limit = number
            if self.boundary != "free":
                # 32 and 64 blocks are of equal size on grids of 2^k nodes (`BLOCK_COUNTS`).
                limit -= 1
            self._in_blocks[number] = Blocks(self.heights, self.spacing, limit)
        return self._in_blocks[number]


def _above(interference: Values, delta: float) -> tuple[float, float]:
    """Return the share of the nodes with a positive interference, and its mean over Delta.

    The mean is over all nodes, with 0 for a negative interference. The interference, (nx, ny), and
    Delta are in um.
    """
    above = np.maximum(interference, 0.0)
    share = np.count_nonzero(above) / above.size
    return share, float(above.mean()) / delta


def _above_shifted(
    interference: Values, delta: float, roughness: float
) -> tuple[float, ...]:
    """Return the shares of nodes whose interference exceeds `SHIFTS`, and norms over Delta.

    The interference, (nx, ny) [um], is the height of the nodes above the displacement. The shifts
    are multiples of the roughness, the rms of the unresolved heights [um]. There is one norm for
    each of `POWERS`: (mean of interference^p)^(1/p) with 0 for a negative interference.
    """
    shares = []
    for shift in SHIFTS:
        number = np.count_nonzero(interference > shift * roughness)
        shares.append(number / interference.size)
    positive = np.maximum(interference, 0.0) / delta
    norms = []
    for power in POWERS:
        moment = float((positive**power).mean())
        norms.append(moment ** (1 / power))
    return (*shares, *norms)
