"""The feature sets: named columns, each computed by one formula from the numbers of a row.

The equations of the half-space are linear in displacements, and pressures scale with E* / L. By
dimensional analysis the contact area therefore depends only on ratios of heights and Delta, and not
on L. Sets without units divide heights and Delta by h, the root of the sum of their squares. The
paper's scaling of rows to unit length is similar, but changes with the units. (With heights over
the rms height, which is small for some surfaces, the error of kernel ridge is 1.5 times as large.)
Curvatures are multiplied by L^2 / h. Curvatures and bandwidths are taken as logarithms, because
they span decades. Densities are per node, and the other features are pure numbers.

Bodies that yield have one feature more. Pressures scale with E* h / L, and the feature is the
logarithm of the hardness over this pressure. (With this ratio itself, or the hardness over E*,
errors are larger.) Bodies with a layer have one or two features more (`learn.features.layers`).

The hybrid set adds columns from the heights and from a coarse contact solve. With 2,540 training
rows of the paper preset, the nMSE of the area is 0.28 % with the columns `COARSE`, 0.26 % with
their roots, and 0.14 % with the columns `LOCAL`.
"""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.quantities import Powers
from gen.ranges import margins, outside
from gen.runtime.errors import InputError
from gen.scene import Scene
from learn.features import scene as scenic
from learn.features.columns import (
    BANDWIDTHS,
    BASE_RATIO,
    BLOCK_COUNTS,
    BLOCKS,
    COARSE,
    CURVATURES,
    FORCE,
    HARDNESS,
    HEIGHTS,
    HYBRID,
    LAYER_DEPTH,
    LOCAL,
    NODES,
    PLASTIC,
    ROOT,
    ROOTED,
    ROOTED_LOCAL,
    SCALED_HARDNESS,
    STATISTICS,
    UNITS,
    WITHOUT_UNITS,
)
from learn.features.layers import TrainedLayers
from learn.features.rows import Rows
from learn.features.scene import SCENE

# Type of a function that takes n rows and returns one feature of them, (n,).
Formula = Callable[[Rows], Values]


# Features without a margin beyond their training ranges: they do not scatter from surface to
# surface, because a user chooses them.
EXACT = (NODES, HARDNESS, BASE_RATIO)


def _statistic(number: int, rows: Rows) -> Values:
    """Return one of `STATISTICS`, by its number there, (n,), in its unit."""
    return rows.statistics[:, number]


def _over_height(number: int, rows: Rows) -> Values:
    """Return one of `STATISTICS` that is a height, by its number there, over h, (n,)."""
    return rows.statistics[:, number] / rows.height_unit


def _logarithm_of_curvature(number: int, rows: Rows) -> Values:
    """Return the logarithm of a curvature over h / L^2, by its number in `STATISTICS`, (n,)."""
    curvature = rows.statistics[:, number]
    return np.log(curvature * rows.length * rows.length / rows.height_unit)


def _logarithm(number: int, rows: Rows) -> Values:
    """Return the logarithm of one of `STATISTICS`, by its number there, (n,)."""
    return np.log(rows.statistics[:, number])


def _coarse(number: int, rows: Rows) -> Values:
    """Return one of the columns `HYBRID` of the coarse solve, by its number there, (n,)."""
    return rows.coarse[:, number]


def _root_of_coarse(number: int, rows: Rows) -> Values:
    """Return the square root of one of the columns `HYBRID`, by its number there, (n,)."""
    return np.sqrt(rows.coarse[:, number])


def _scaled_hardness(rows: Rows) -> Values:
    """Return the logarithm of the hardness over the pressure E* h / L, (n,)."""
    return np.log(rows.hardness_ratios * rows.length / rows.height_unit)


def _plastic(rows: Rows) -> Values:
    """Return the root of the share of the patch at the hardness under the coarse force, (n,).

    See `learn.features.columns.PLASTIC`.
    """
    scaled_force = rows.coarse[:, HYBRID.index(FORCE)]  # over E* L Delta
    share = scaled_force * rows.delta / (rows.length * rows.hardness_ratios)
    return np.sqrt(share)


def _layer_depth(rows: Rows) -> Values:
    """Return the logarithm of the thickness of the layers times the wave number, (n,)."""
    depth = rows.required_layers.thickness * rows.wave_number
    return np.asarray(np.log(depth))


def _base_ratio(rows: Rows) -> Values:
    """Return the logarithm of E* of the bases over that of the layers, (n,)."""
    ratio = np.broadcast_to(rows.required_layers.base_ratio, len(rows.delta))
    return np.asarray(np.log(ratio))


def _formulas() -> dict[str, Formula]:
    """Return the formula of every feature of a surface by the name of its column."""
    formulas: dict[str, Formula] = {
        "delta": lambda rows: rows.delta,
        "delta/h": lambda rows: rows.delta / rows.height_unit,
        ROOT: lambda rows: np.sqrt(rows.delta / rows.height_unit),
        HARDNESS: lambda rows: rows.hardness_ratios,
        SCALED_HARDNESS: _scaled_hardness,
        PLASTIC: _plastic,
        NODES: lambda rows: np.log2(rows.nodes_per_side),
        LAYER_DEPTH: _layer_depth,
        BASE_RATIO: _base_ratio,
    }
    for number, name in enumerate(STATISTICS):
        formulas[name] = partial(_statistic, number)
        if name in HEIGHTS:
            formulas[f"{name}/h"] = partial(_over_height, number)
        if name in CURVATURES:
            formulas[f"log({name}.L2/h)"] = partial(_logarithm_of_curvature, number)
        if name in BANDWIDTHS:
            formulas[f"log({name})"] = partial(_logarithm, number)
    for number, name in enumerate(HYBRID):
        formulas[name] = partial(_coarse, number)
        if name in {*ROOTED, *ROOTED_LOCAL}:
            formulas[f"sqrt({name})"] = partial(_root_of_coarse, number)
    return formulas


FORMULAS: Mapping[str, Formula] = _formulas()
"""The formula of every feature of a surface by the name of its column."""


@dataclass(frozen=True)
class FeatureSet(ABC):
    """A named set of features: `OfSurface` or `OfScene`."""

    name: str  # name on the command line and in files
    columns: tuple[str, ...]  # names of the d features in their order
    normalisation: str  # default of the `normalisation` of `learn.models.pipeline`
    # "delta" or "pressure" for features of a surface; one of `learn.features.scene.LOADS` for those
    # of a scene, or "" before scenes are known
    load: str = "delta"
    # True if features have no units, and targets are divided by `scale`
    scaled: bool = False
    needs_surface: bool = False  # True if the features need the heights of the surface
    # blocks per side of the coarse solve; 0 unless `LOCAL` is among the features
    blocks: int = 0
    # True if some rows are of elastic bodies and others of bodies that yield
    elastic: bool = False

    of_scene: ClassVar[bool]
    """True if the features are numbers of a scene, False if they are those of a surface."""

    @property
    @abstractmethod
    def units(self) -> tuple[str, ...]:
        """Units of the numbers in `names`, in their order."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the d features of a surface, or of the d numbers behind those of a scene."""

    @property
    @abstractmethod
    def by_pressure(self) -> bool:
        """True if the features are those of a surface under a pressure."""

    @property
    def rooted(self) -> bool:
        """True if square roots of columns are among the features, as for surrogates."""
        return ROOT in self.columns or f"sqrt({ROOTED[0]})" in self.columns

    @abstractmethod
    def of(self, rows: Rows) -> Values:
        """Compute the features of rows.

        Parameters
        ----------
        rows : Rows
            n rows.

        Returns
        -------
        ndarray, shape (n, d)
            Features in the order of `columns`. Undefined features are NaN or infinite.

        Raises
        ------
        InputError
            If a feature needs a number of the scene, the coarse solve or the number of nodes, and
            the rows do not have it.
        """

    @abstractmethod
    def shown(self, features: Values) -> Values:
        """Turn features into the numbers in `names`: those of a scene have no logarithms.

        Parameters
        ----------
        features : ndarray, shape (..., d)
            Features in the order of `columns`.

        Returns
        -------
        ndarray, shape (..., d)
            Numbers in the order and the units of `names`.
        """

    @abstractmethod
    def ranges(self, scenes: Sequence[Scene], inputs: Values) -> scenic.Ranges:
        """Return the ranges of the features that a training covers.

        Parameters
        ----------
        scenes : sequence of Scene
            Scenes of the training rows.
        inputs : ndarray, shape (n, d)
            Features of the training rows.

        Returns
        -------
        Ranges
            Smallest and largest features of the rows; for a number of a scene whose limits all
            scenes define, these limits.
        """

    @abstractmethod
    def margins(self, low: Values, high: Values) -> Values:
        """Return how far beyond its training range each feature is not flagged.

        Parameters
        ----------
        low, high : ndarray, shape (d,)
            Smallest and largest value of each feature in the training.

        Returns
        -------
        ndarray, shape (d,)
            Margins in the units of the features, see `gen.ranges`; 0 for features without one.
        """

    def is_outside(
        self, features: Values, low: Values, high: Values
    ) -> NDArray[np.bool_]:
        """Tell which features are beyond their training ranges and the margins.

        Parameters
        ----------
        features : ndarray, shape (n, d)
            Features in the order of `columns`.
        low, high : ndarray, shape (d,)
            Smallest and largest value of each feature in the training.

        Returns
        -------
        ndarray of bool, shape (n, d)
            True for features by which a row is flagged.
        """
        return outside(features, low, high, self.margins(low, high))

    def scale(self, powers: Powers | None, rows: Rows, modulus: Values | float) -> Values:
        """Return the numbers by which a target is divided before it is learnt.

        The quotient has no unit. For a target that is proportional to E*, the height in the divisor
        is Delta, because the target vanishes with Delta. For other targets the height is h, as in
        the features.

        Parameters
        ----------
        powers : Powers or None
            Powers of heights, lengths and E* to which the target is proportional; None if it is not
            proportional to any.
        rows : Rows
            n rows.
        modulus : float or ndarray, shape (n,)
            E* of half-spaces [MPa]. Rows with layers have the E* of their layers instead.

        Returns
        -------
        ndarray, shape (n,)
            Divisors in the unit of the target; 1 without powers, and for features with units.
        """
        ones = np.ones(len(rows.delta))
        if not self.scaled or powers is None:
            return ones
        heights = rows.delta if powers.modulus else rows.height_unit
        length = np.asarray(rows.length, dtype=np.float64)  # one number, or (n,)
        if rows.layers is not None:
            modulus = rows.layers.e_star
        scale = modulus ** float(powers.modulus) * length ** float(powers.lengths)
        scale = scale * heights ** float(powers.heights) * ones
        return np.asarray(scale, dtype=np.float64)


class OfSurface(FeatureSet):
    """A set of features of one surface under a load."""

    of_scene = False

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the features."""
        return tuple(UNITS.get(column, "1") for column in self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features: `columns`, with "pressure.L/E*" if this length replaces Delta.

        It does so under pressures, unless a coarse solve gives the Delta of the pressure.
        """
        if self.needs_surface or not self.by_pressure:
            return self.columns
        return tuple(
            re.sub(r"\bdelta\b", "pressure.L/E*", column) for column in self.columns
        )

    @property
    def by_pressure(self) -> bool:
        """True if the load is a pressure."""
        return self.load == "pressure"

    def of(self, rows: Rows) -> Values:
        """Compute the features of n rows, (n, d); undefined features are NaN or infinite."""
        rows_with_finite_hardness = rows
        if self.elastic:
            # Elastic bodies have an infinite hardness, which is no number for a model.
            rows_with_finite_hardness = rows.capped()
        features = []
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for column in self.columns:
                formula = FORMULAS[column]
                if column == PLASTIC:
                    # This feature is 0 for elastic bodies, computed from their infinite hardness.
                    features.append(formula(rows))
                else:
                    features.append(formula(rows_with_finite_hardness))
        return np.column_stack(features)

    def shown(self, features: Values) -> Values:
        """Return the features as they are."""
        return features

    def ranges(self, scenes: Sequence[Scene], inputs: Values) -> scenic.Ranges:
        """Return the smallest and the largest features of the rows."""
        return scenic.Ranges(low=inputs.min(axis=0), high=inputs.max(axis=0))

    def margins(self, low: Values, high: Values) -> Values:
        """Return margins, (d,), that are relative to the ends of the ranges.

        Features in `EXACT` have no margin.
        """
        is_logarithm = np.array([column.startswith("log(") for column in self.columns])
        relative = margins(low, high, is_logarithm)
        return np.where(np.isin(self.columns, EXACT), 0.0, relative)


class OfScene(FeatureSet):
    """A set of the numbers that a scene draws for a row, and its load."""

    of_scene = True

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the scene's numbers."""
        return tuple(scenic.unit_of(column) for column in self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the scene's numbers, without "log()"."""
        return tuple(scenic.plain(column) for column in self.columns)

    @property
    def by_pressure(self) -> bool:
        """False: the load of a scene is a feature of its own."""
        return False

    def of(self, rows: Rows) -> Values:
        """Compute the features of n rows, (n, d); undefined features are NaN or infinite.

        Raises InputError if the rows lack a number of the scene.
        """
        if not rows.scene_numbers.keys() >= set(self.names):
            raise InputError(
                f"a surrogate of a scene asks for {', '.join(self.names)} instead"
            )
        with np.errstate(divide="ignore", invalid="ignore"):
            return scenic.inputs(self.columns, rows.scene_numbers)

    def shown(self, features: Values) -> Values:
        """Return the scene's numbers, (..., d)."""
        return scenic.shown(self.columns, features)

    def ranges(self, scenes: Sequence[Scene], inputs: Values) -> scenic.Ranges:
        """Return the limits that all scenes define; for other features those of the rows."""
        return scenic.training_ranges(scenes, self.columns, inputs)

    def margins(self, low: Values, high: Values) -> Values:
        """Return margins of 0, (d,), because a scene defines the limits of its numbers."""
        return np.zeros(len(low))


@dataclass(frozen=True)
class Scaling:
    """A change of scale of the target: models learn (target - mean) / deviation.

    If `root` is set, the square root of the target takes its place. `learn.models.scaling_of` makes
    scalings. For features without units, mean and deviation are those of the training rows, as they
    are for some surrogates of other features. Otherwise they are 0 and 1, as in the paper, with two
    exceptions. A mean that is far larger than the deviation is subtracted. A target that is far
    larger or smaller than an area in percent is divided by a power of two, because splits of trees,
    tubes of support vectors and steps of perceptrons have absolute thresholds.
    """

    mean: float = 0.0  # in the unit of the target, or of its root
    deviation: float = 1.0  # in the unit of the target, or of its root
    root: bool = False  # True if models learn the square root of the target

    def scaled(self, target: Values) -> Values:
        """Return the values on which a model is trained.

        Parameters
        ----------
        target : ndarray, shape (n,)
            Targets, 0 or more if their roots are learnt.

        Returns
        -------
        ndarray, shape (n,)
            Targets, or their roots, on the scale of the training.
        """
        values = target
        if self.root:
            values = np.sqrt(target)
        return (values - self.mean) / self.deviation

    def restored(self, predicted: Values) -> Values:
        """Return targets from a model's predictions.

        Parameters
        ----------
        predicted : ndarray, shape (n,)
            Predictions on the scale of the training.

        Returns
        -------
        ndarray, shape (n,)
            Targets; a negative predicted root gives 0.
        """
        values = self.mean + self.deviation * np.asarray(predicted, dtype=np.float64)
        if self.root:
            return np.maximum(values, 0.0) ** 2
        return values


PAPER = OfSurface(name="paper", columns=("delta", *STATISTICS), normalisation="l2")
DIMENSIONLESS = OfSurface(
    name="dimensionless",
    columns=WITHOUT_UNITS,
    normalisation="standard",
    scaled=True,
)
HYBRID_SET = OfSurface(
    name="hybrid",
    columns=(*WITHOUT_UNITS, *COARSE),
    normalisation="standard",
    scaled=True,
    needs_surface=True,
)
SCENE_SET = OfScene(name=SCENE, columns=(), normalisation="standard")

SETS: Mapping[str, FeatureSet] = {
    features.name: features for features in (PAPER, DIMENSIONLESS, HYBRID_SET, SCENE_SET)
}
"""The feature sets by name, for elastic bodies on equal grids and without roots."""

# Names of the sets whose features are those of a surface.
OF_SURFACES = tuple(name for name, features in SETS.items() if not features.of_scene)


def chosen(
    name: str,
    scenes: Sequence[Scene] = (),
    *,
    roots: bool = False,
    blocks: int | None = None,
    load: str = "",
) -> FeatureSet:
    """Return the feature set of a name, with the columns that the rows of some scenes need.

    If bodies yield, a set without units has a column of the hardness; a set with units has it if
    the hardness varies. (Without units, a constant hardness differs between surfaces, because the
    pressure over which it is taken depends on the heights.) If the scenes differ in their number of
    nodes, this is a column. The set `scene` consists of the numbers that vary over the rows, and
    the load.

    Parameters
    ----------
    name : str
        One of `SETS`.
    scenes : sequence of Scene
        Scenes of the rows. Without scenes, bodies are elastic and grids equal, and the set `scene`
        has no columns.
    roots : bool
        True for the columns that surrogates see: with square roots, and all of the coarse solve.
    blocks : int, optional
        Blocks per side of the coarse solve, one of `BLOCK_COUNTS`; `BLOCKS` if left out.
    load : str
        "delta" or "pressure" for features of a surface, and "delta" if left out. For the set
        `scene` one of `learn.features.scene.LOADS`, and the load of the first scene if left out.

    Returns
    -------
    FeatureSet
        The set with all its columns.

    Raises
    ------
    InputError
        If no set has this name, the set does not take this load or these blocks, only some of the
        scenes define a number, or a relative load is not that of all scenes.
    """
    if name not in SETS:
        raise InputError(f"--features {name!r}: give one of {', '.join(SETS)}")
    features = SETS[name]
    _require_blocks(features, blocks)
    if features.of_scene:
        return _chosen_of_scene(features, scenes, load)
    if load not in {"", "delta", "pressure"}:
        raise InputError(f"--load {load}: --features {name} take delta or pressure")
    hardness = _hardness_columns(features, scenes)
    added = [
        *_root_columns(features, roots=roots),
        *hardness,
        *_node_columns(scenes),
        *_layer_columns(features, scenes),
    ]
    has_local_columns = roots and features.needs_surface
    blocks_per_side = 0
    if has_local_columns:
        blocks_per_side = blocks or BLOCKS
    return replace(
        features,
        columns=(*features.columns, *added),
        blocks=blocks_per_side,
        elastic=bool(hardness) and _some_are_elastic(scenes),
        load=load or "delta",
    )


def _some_are_elastic(scenes: Sequence[Scene]) -> bool:
    """Tell whether the bodies of at least one scene are elastic."""
    return any(scene.contact.hardness_limits is None for scene in scenes)


def _require_blocks(features: FeatureSet, blocks: int | None) -> None:
    """Refuse blocks for a set without a coarse solve, and numbers not in `BLOCK_COUNTS`.

    None, for the default, is never refused.
    """
    if blocks is None:
        return
    if not features.needs_surface:
        raise InputError(
            f"--blocks {blocks}: only hybrid features have blocks: add --features hybrid"
        )
    if blocks not in BLOCK_COUNTS:
        offered = " or ".join(map(str, BLOCK_COUNTS))
        raise InputError(f"--blocks {blocks}: give {offered}, the blocks along a side")


def _chosen_of_scene(
    features: FeatureSet, scenes: Sequence[Scene], load: str
) -> FeatureSet:
    """Return the set `scene` with the columns of scenes; without scenes it has no columns."""
    if not scenes:
        return replace(features, load=load)
    columns = scenic.columns_of(scenes, load)
    return replace(features, columns=columns, load=scenic.plain(columns[-1]))


def _root_columns(features: FeatureSet, *, roots: bool) -> list[str]:
    """Return the columns that surrogates see in addition, if `roots` is set.

    These are square roots and, for a set with a coarse solve, the columns `LOCAL`.
    """
    if not roots:
        return []
    if features.needs_surface:
        roots_of_coarse = [f"sqrt({column})" for column in ROOTED]
        roots_of_local = [f"sqrt({column})" for column in ROOTED_LOCAL]
        return [*roots_of_coarse, *LOCAL, *roots_of_local]
    if features.scaled:
        return [ROOT]
    return []


def _hardness_columns(features: FeatureSet, scenes: Sequence[Scene]) -> list[str]:
    """Return the columns of the hardness that a set needs for some scenes.

    The list is empty if all bodies are elastic, and for a set with units if the hardness of the
    bodies that yield is constant. If only some bodies are elastic, hybrid features have `PLASTIC`
    in addition.
    """
    limits = limits_of(scenes)
    if limits is None:
        return []
    smallest, largest = limits
    if features.scaled:
        if features.needs_surface and _some_are_elastic(scenes):
            return [SCALED_HARDNESS, PLASTIC]
        return [SCALED_HARDNESS]
    if smallest < largest:
        return [HARDNESS]
    return []


def _node_columns(scenes: Sequence[Scene]) -> list[str]:
    """Return the column of the number of nodes if scenes differ in it, otherwise no column."""
    sizes = {math.prod(scene.grid.shape) for scene in scenes}
    if len(sizes) > 1:
        return [NODES]
    return []


def _layer_columns(features: FeatureSet, scenes: Sequence[Scene]) -> list[str]:
    """Return the columns of layers that a set needs for scenes; none for half-spaces.

    Sets with units have no such columns, and hold for one layer only. Raises InputError for a set
    with units if the layers of the scenes differ.
    """
    layers = TrainedLayers.of_scenes(scenes)
    if layers is None:
        return []
    if not features.scaled:
        if layers.only is None:
            raise InputError(
                f"--features {features.name}: have no layers, which differ here ({layers.text}):"
                " give --features dimensionless, hybrid or scene"
            )
        return []
    if layers.base_ratio is not None and layers.base_ratio[0] < layers.base_ratio[1]:
        return [LAYER_DEPTH, BASE_RATIO]
    return [LAYER_DEPTH]


def limits_of(scenes: Sequence[Scene]) -> tuple[float, float] | None:
    """Return the smallest and the largest hardness over E* of some scenes.

    Parameters
    ----------
    scenes : sequence of Scene
        Scenes of elastic bodies or of bodies that yield.

    Returns
    -------
    (float, float) or None
        Smallest and largest ratio for the bodies that yield; None if all bodies are elastic.
    """
    ratios: list[float] = []
    for scene in scenes:
        limits = scene.contact.hardness_limits
        if limits is None:
            continue
        softest, stiffest = scene.contact.e_star_limits
        ratios += [limits[0] / stiffest, limits[1] / softest]
    if not ratios:
        return None
    return min(ratios), max(ratios)
