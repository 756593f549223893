"""The feature sets: named columns, each of which has one formula from the numbers of a row.

By dimensional analysis the contact area depends on heights and Delta only through their ratios, and
not on L: the equations of the half-space are linear in displacements, and pressures scale with E* /
L. Heights and Delta are therefore divided by h, the root of the sum of their squares. This is like
the paper's scaling of rows to unit length, but exact under a change of units. (Divided by the rms
height, which is small for some surfaces, the error of kernel ridge is half as large again.)
Curvatures are multiplied by L^2 / h and, like the bandwidths, taken as logarithms, because they
span decades. Densities are per node; the other features are pure numbers.

The hardness adds one number: pressures scale with E* h / L, so the feature is the logarithm of the
hardness over this pressure. (With the number itself, or the hardness over E*, errors are larger.)

The hybrid set adds columns from the heights themselves and from a coarse contact solve. On 2,540
training rows of the paper preset those of `COARSE` have an nMSE of the area of 0.28 %, with roots
0.26 %, with `LOCAL` 0.14 %.
"""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from gen.arrays import Values
from gen.quantities import Powers
from gen.runtime.errors import InputError
from gen.scene import Scene
from learn.features import scene as scenic
from learn.features.columns import (
    BANDWIDTHS,
    BLOCK_COUNTS,
    BLOCKS,
    COARSE,
    CURVATURES,
    FORCE,
    HARDNESS,
    HEIGHTS,
    HYBRID,
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
from learn.features.rows import Rows
from learn.features.scene import SCENE

Formula = Callable[[Rows], Values]


def _statistic(place: int, rows: Rows) -> Values:
    """Return the statistic at a place, (n,), in its unit."""
    return rows.statistics[:, place]


def _over_height(place: int, rows: Rows) -> Values:
    """Return the height at a place of the statistics over h, (n,)."""
    return rows.statistics[:, place] / rows.height_unit


def _logarithm_of_curvature(place: int, rows: Rows) -> Values:
    """Return the logarithm of the curvature at a place of the statistics, over h / L^2, (n,)."""
    curvature = rows.statistics[:, place]
    return np.log(curvature * rows.length * rows.length / rows.height_unit)


def _logarithm(place: int, rows: Rows) -> Values:
    """Return the logarithm of the statistic at a place, (n,)."""
    return np.log(rows.statistics[:, place])


def _coarse(place: int, rows: Rows) -> Values:
    """Return the column of the coarse solve at a place, (n,)."""
    return rows.coarse[:, place]


def _root_of_coarse(place: int, rows: Rows) -> Values:
    """Return the square root of the column of the coarse solve at a place, (n,)."""
    return np.sqrt(rows.coarse[:, place])


def _scaled_hardness(rows: Rows) -> Values:
    """Return the logarithm of the hardness over the pressure E* h / L, (n,)."""
    return np.log(rows.hardness_ratios * rows.length / rows.height_unit)


def _plastic(rows: Rows) -> Values:
    """Return the root of the share of the patch that carries the coarse force yielded, (n,)."""
    force = rows.coarse[:, HYBRID.index(FORCE)]
    return np.sqrt(force * rows.delta / (rows.length * rows.hardness_ratios))


def _formulas() -> dict[str, Formula]:
    """Return the formula of every feature of a surface by its column."""
    formulas: dict[str, Formula] = {
        "delta": lambda rows: rows.delta,
        "delta/h": lambda rows: rows.delta / rows.height_unit,
        ROOT: lambda rows: np.sqrt(rows.delta / rows.height_unit),
        HARDNESS: lambda rows: rows.hardness_ratios,
        SCALED_HARDNESS: _scaled_hardness,
        PLASTIC: _plastic,
        NODES: lambda rows: np.log2(rows.nodes_per_side),
    }
    for place, name in enumerate(STATISTICS):
        formulas[name] = partial(_statistic, place)
        if name in HEIGHTS:
            formulas[f"{name}/h"] = partial(_over_height, place)
        if name in CURVATURES:
            formulas[f"log({name}.L2/h)"] = partial(_logarithm_of_curvature, place)
        if name in BANDWIDTHS:
            formulas[f"log({name})"] = partial(_logarithm, place)
    for place, name in enumerate(HYBRID):
        formulas[name] = partial(_coarse, place)
        if name in {*ROOTED, *ROOTED_LOCAL}:
            formulas[f"sqrt({name})"] = partial(_root_of_coarse, place)
    return formulas


FORMULAS: Mapping[str, Formula] = _formulas()
"""The formula of every feature of a surface by its column; each returns (n,)."""


@dataclass(frozen=True)
class FeatureSet(ABC):
    """A named set of features: `OfSurface` or `OfScene`."""

    name: str  # on the command line and in files
    columns: tuple[str, ...]  # names of the features, in order
    normalisation: str  # the default of `learn.models.pipeline`
    # "delta" or "pressure" for a surface, one of `learn.features.scene.LOADS` for a scene;
    # "" for a scene's set without scenes
    load: str = "delta"
    scaled: bool = False  # True if features and targets have no units (`scale`)
    needs_surface: bool = False  # True if the features need the heights of the surface
    blocks: int = 0  # per side of the coarse solve, if `LOCAL` is among the features
    elastic: bool = False  # True if elastic bodies are among those that yield

    of_scene: ClassVar[bool]
    """True if the features are numbers of a scene, False if they are those of a surface."""

    @property
    @abstractmethod
    def units(self) -> tuple[str, ...]:
        """Units of the numbers in `names`, one each."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the features of a surface, or of the numbers whose features a scene has."""

    @property
    @abstractmethod
    def by_pressure(self) -> bool:
        """True if the features are those of a surface under a pressure."""

    @property
    def rooted(self) -> bool:
        """True if square roots of some columns are among the features."""
        return ROOT in self.columns or f"sqrt({ROOTED[0]})" in self.columns

    @abstractmethod
    def of(self, rows: Rows) -> Values:
        """Return the features of rows.

        Parameters
        ----------
        rows : Rows
            n rows.

        Returns
        -------
        ndarray, shape (n, d)
            Features in the order of `columns`, NaN or infinite where they are undefined.

        Raises
        ------
        InputError
            If the rows lack the numbers of the scene, the coarse solve or the nodes that a feature
            needs.
        """

    @abstractmethod
    def shown(self, features: Values) -> Values:
        """Return features as the numbers in `names`, without the logarithms of a scene.

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
            Ends of the rows' features, or those of what the scenes give.
        """

    def scale(self, powers: Powers | None, rows: Rows, modulus: float) -> Values:
        """Return the divisor of a target before it is learnt, so that it has no unit.

        What scales with E* vanishes with the load, so that its heights are counted in Delta; other
        heights are counted in h, as those of the features.

        Parameters
        ----------
        powers : Powers or None
            Powers of heights, lengths and E* that the target scales with; None if it has none.
        rows : Rows
            n rows.
        modulus : float
            E* [MPa].

        Returns
        -------
        ndarray, shape (n,)
            Divisors in the unit of the target; 1 without powers, and for features with units.
        """
        ones = np.ones(len(rows.delta))
        if not self.scaled or powers is None:
            return ones
        heights = rows.delta if powers.modulus else rows.height_unit
        length = np.asarray(rows.length, dtype=np.float64)
        scale = modulus**powers.modulus * length ** float(powers.lengths)
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
        """Names of the features: their columns, with the pressure where it stands for Delta."""
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
        """Return the features of n rows, (n, d), NaN or infinite where they are undefined."""
        capped = rows.capped() if self.elastic else rows
        features = []
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for column in self.columns:
                # The plastic area of elastic bodies is 0, which the ceiling would change.
                arguments = rows if column == PLASTIC else capped
                features.append(FORMULAS[column](arguments))
        return np.column_stack(features)

    def shown(self, features: Values) -> Values:
        """Return the features as they are."""
        return features

    def ranges(self, scenes: Sequence[Scene], inputs: Values) -> scenic.Ranges:
        """Return the ends of the rows' features."""
        return scenic.Ranges(inputs.min(axis=0), inputs.max(axis=0))


class OfScene(FeatureSet):
    """A set of the numbers that a scene draws for a row, and its load."""

    of_scene = True

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the scene's numbers."""
        return tuple(scenic.unit_of(column) for column in self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the scene's numbers, without logarithms."""
        return tuple(scenic.plain(column) for column in self.columns)

    @property
    def by_pressure(self) -> bool:
        """False: the load of a scene is a feature of its own."""
        return False

    def of(self, rows: Rows) -> Values:
        """Return the features of n rows, (n, d), NaN or infinite where they are undefined."""
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
        """Return the limits that all scenes give, and the rows' ends of other features."""
        return scenic.training_ranges(scenes, self.columns, inputs)


@dataclass(frozen=True)
class Scaling:
    """A map of the target: models are trained on (target - mean) / deviation, or on its root's.

    Where the features are free of units, and for Gaussian processes of surrogates, mean and
    deviation are those of the training rows. Elsewhere they are 0 and 1, as the paper trains, or a
    power of two for targets of another size than an area's: splits of trees, tubes of support
    vectors and steps of perceptrons have absolute thresholds.
    """

    mean: float = 0.0
    deviation: float = 1.0
    root: bool = False  # True if it is the square root that is learnt

    def scaled(self, target: Values) -> Values:
        """Return the values that a model is trained on.

        Parameters
        ----------
        target : ndarray, shape (n,)
            Targets, 0 or more if their roots are learnt.

        Returns
        -------
        ndarray, shape (n,)
            Targets, or their roots, on the scale of the training.
        """
        values = np.sqrt(target) if self.root else target
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
            Targets; 0 where a predicted root is negative.
        """
        values = self.mean + self.deviation * np.asarray(predicted, dtype=np.float64)
        if self.root:
            return np.maximum(values, 0.0) ** 2
        return values


PAPER = OfSurface("paper", ("delta", *STATISTICS), "l2")
DIMENSIONLESS = OfSurface("dimensionless", WITHOUT_UNITS, "standard", scaled=True)
HYBRID_SET = OfSurface(
    "hybrid", (*WITHOUT_UNITS, *COARSE), "standard", scaled=True, needs_surface=True
)
SCENE_SET = OfScene(SCENE, (), "standard")

SETS: Mapping[str, FeatureSet] = {
    features.name: features for features in (PAPER, DIMENSIONLESS, HYBRID_SET, SCENE_SET)
}
"""The feature sets by name, as they are without a hardness, roots or unequal grids."""

# names of the sets whose features a surface has
OF_SURFACES = tuple(name for name, features in SETS.items() if not features.of_scene)


def chosen(
    name: str,
    scenes: Sequence[Scene] = (),
    *,
    roots: bool = False,
    blocks: int | None = None,
    load: str = "",
) -> FeatureSet:
    """Return the feature set of a name for the rows of scenes.

    Bodies that yield add the hardness: to a set with units if it varies; to one without always,
    because its other features lack the scale of the heights, and with it the pressure. Patches that
    differ in their nodes add the number of these. A scene's own set has the numbers that the scenes
    draw, or differ in, and the load.

    Parameters
    ----------
    name : str
        One of `SETS`.
    scenes : sequence of Scene
        Scenes of the rows; without any, the set is that of elastic bodies on one grid, and a
        scene's own set has no columns.
    roots : bool
        True for the set that surrogates see: with square roots, and all of the coarse solve.
    blocks : int, optional
        Blocks per side of the coarse solve, one of `BLOCK_COUNTS`; `BLOCKS` if left out.
    load : str
        "delta" or "pressure" for features of a surface, Delta if left out; for a scene's own set
        one of `learn.features.scene.LOADS`, the scene's if left out.

    Returns
    -------
    FeatureSet
        The set with all its columns.

    Raises
    ------
    InputError
        If no set has this name, the set does not take this load or these blocks, or a number is
        given by some of the scenes only.
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
    added = [*_root_columns(features, roots=roots), *hardness, *_node_columns(scenes)]
    elastic_bodies = any(scene.contact.hardness_limits is None for scene in scenes)
    return replace(
        features,
        columns=(*features.columns, *added),
        blocks=(blocks or BLOCKS) if roots and features.needs_surface else 0,
        elastic=bool(hardness) and elastic_bodies,
        load=load or "delta",
    )


def _require_blocks(features: FeatureSet, blocks: int | None) -> None:
    """Refuse blocks for a set without a coarse solve, and a number of them that is not offered."""
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
    """Return a scene's own set with the numbers of scenes; without scenes, with the load alone."""
    if not scenes:
        return replace(features, load=load)
    columns = scenic.columns_of(scenes, load)
    return replace(features, columns=columns, load=scenic.plain(columns[-1]))


def _root_columns(features: FeatureSet, *, roots: bool) -> list[str]:
    """Return the columns that surrogates see in addition: roots, and more of the coarse solve."""
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
    """Return the columns of the hardness, if some bodies yield and it tells rows apart.

    Where some bodies are elastic, hybrid features have the plastic area too.
    """
    limits = limits_of(scenes)
    if limits is None:
        return []
    if not features.scaled:
        smallest, largest = limits
        return [HARDNESS] if smallest < largest else []
    elastic_bodies = any(scene.contact.hardness_limits is None for scene in scenes)
    if elastic_bodies and features.needs_surface:
        return [SCALED_HARDNESS, PLASTIC]
    return [SCALED_HARDNESS]


def _node_columns(scenes: Sequence[Scene]) -> list[str]:
    """Return the column of the number of nodes, if scenes differ in it."""
    sizes = {math.prod(scene.grid.shape) for scene in scenes}
    return [NODES] if len(sizes) > 1 else []


def limits_of(scenes: Sequence[Scene]) -> tuple[float, float] | None:
    """Return the limits of the hardness over E* in scenes.

    Parameters
    ----------
    scenes : sequence of Scene
        Scenes of elastic bodies, and of bodies that yield.

    Returns
    -------
    (float, float) or None
        Smallest and largest hardness over E* of those that yield; None if all are elastic.
    """
    ratios: list[float] = []
    for scene in scenes:
        limits = scene.contact.hardness_limits or ()
        ratios += [hardness / scene.contact.e_star for hardness in limits]
    if not ratios:
        return None
    return min(ratios), max(ratios)
