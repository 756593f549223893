"""The feature sets: names of columns, of which each has one formula from the numbers of a row.

The scan length L of an oblong patch is the geometric mean of both sides, so that a square of the
same area has the same L; models learn the shape of the patch from no feature, as all rows of a
database share it.

By dimensional analysis the contact area depends on heights and Delta only through their ratios, and
not on L: the equations of the half-space are linear in displacements, and pressures scale with E* /
L. Heights and Delta are therefore divided by h, the root of the sum of their squares. This is like
the paper's scaling of rows to unit length, but exact under a change of units. (Divided by the rms
height, which is small for some surfaces, the error of kernel ridge is half as large again.)
Curvatures are multiplied by L^2 / h and, like the bandwidths, taken as logarithms, because they
span decades. Densities are per node; the other features are pure numbers.

The hardness adds one number: pressures scale with E* h / L, so the feature is the logarithm of the
hardness over this pressure. (With the number itself, or the hardness over E*, errors are larger.)

The hybrid set adds columns from the heights themselves and from a coarse contact solve. Of 4,000
rows of the paper preset (kernel ridge, areas to 16.56 %, 2,540 rows train, three splits) those of
`COARSE` have an nMSE of the area of 0.28 %, with roots 0.26 %. `LOCAL` makes this 0.14 %; the
shares by Persson's theory alone make it 0.16 %.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from gen.arrays import Values
from gen.material import plane_strain_modulus
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import statistics_columns

STATISTICS: tuple[str, ...] = tuple(column.name for column in statistics_columns())
"""The 22 statistics, in the order of the paper's Table 1."""

_UNITS = {"delta": "um"} | {column.name: column.unit for column in statistics_columns()}
HEIGHTS = tuple(name for name in STATISTICS if _UNITS[name] == "um")
CURVATURES = tuple(name for name in STATISTICS if _UNITS[name] == "um-1")
BANDWIDTHS = ("bandwidth_x", "bandwidth_y")
PURE = tuple(name for name in STATISTICS if name not in {*HEIGHTS, *CURVATURES, *BANDWIDTHS})

ROOT = "sqrt(delta/h)"
"""Further input of surrogates with dimensionless features, beside the root of the area."""

HARDNESS = "hardness/E*"
"""The hardness as a feature of sets with units."""

SCALED_HARDNESS = "log(hardness.L/(E*.h))"
"""The hardness as a feature of sets without units."""

PLASTIC = "sqrt(coarse_force/(hardness.L2))"
"""Square root of the share of the patch that carries the coarse solve's force at the hardness. No
contact of bodies that yield has a smaller area; it is 0 for elastic bodies.
"""

NODES = "log2(nodes)"
"""The nodes along a side as a feature, where grids differ; the geometric mean of both axes. A
coarser grid leaves out short waves, and counts a contact in larger cells."""

BLOCKS = 33
"""Blocks per side; on a surface with fewer nodes every node is a block."""

BLOCK_COUNTS = (BLOCKS, 65)
"""Blocks per side that a user can choose from. A patch without edges has one less: those of 2^k
nodes a side are then equal, and transforms of their number fast."""

FORCE = "coarse_force/(E*.L.delta)"

COARSE = (
    "bearing_share",
    "bearing_interference/delta",
    "coarse_area_percent",
    FORCE,
    "coarse_displacement/delta",
    "refined_share",
    "refined_interference/delta",
)
"""Columns that comparisons of models add; all are pure numbers, as are the others."""

FACTORS = (0.5, 1.0, 2.0)
"""Multiples of the coarse pressures from which the area inside the blocks is estimated: real local
contacts lie on other curves than Persson's, which models find between these."""

SHIFTS = (-1.0, -0.5, 0.5, 1.0)
"""Shifts of the displacement, over the rms s of the heights that the blocks do not resolve, above
which nodes are counted."""

POWERS = (2, 3)
"""Powers of the mean interference of the nodes that stand above the displacement."""

ROOTED_LOCAL = (
    *(f"local_area({factor:g}p)" for factor in FACTORS),
    *(f"refined_share({shift:+g}s)" for shift in SHIFTS),
)
"""Columns of `LOCAL` whose square roots surrogates see too."""

LOCAL = (
    *ROOTED_LOCAL,
    *(f"refined_interference_{power}/delta" for power in POWERS),
    "coarse_perimeter/L",
)
"""Columns of the same solve that surrogates see too."""

HYBRID = (*COARSE, *LOCAL)
"""All columns, in the order in which `SurfaceFeatures.hybrid` returns them."""

ROOTED = ("bearing_share", "coarse_area_percent", FORCE, *COARSE[-2:])
"""Columns of `COARSE` whose square roots surrogates see too: like the area they begin at first
touch and span decades, and the roots tell small values apart."""

Limits = tuple[float, float]


@dataclass(frozen=True, eq=False)
class _Rows:
    """The numbers of n rows that features are computed from; see `build`."""

    statistics: Values
    delta: Values
    length: Values | float
    hybrid: Values | None
    hardness_ratio: Values | float | None
    nodes: Values | float | None
    elastic: bool

    def statistic(self, name: str) -> Values:
        """Return a statistic, (n,)."""
        return np.asarray(self.statistics[:, STATISTICS.index(name)])

    def coarse(self, name: str) -> Values:
        """Return a column of the coarse solve, (n,)."""
        if self.hybrid is None:
            raise ValueError("these features need the surface")
        return np.asarray(self.hybrid[:, HYBRID.index(name)])

    @cached_property
    def unit(self) -> Values:
        """The height h, (n,) [um]."""
        return height_unit(self.statistics, self.delta)

    @property
    def grid(self) -> Values:
        """Nodes along a side, (n,)."""
        if self.nodes is None:
            raise ValueError("these features need the number of nodes")
        return np.ones(len(self.delta)) * self.nodes

    @property
    def ratio(self) -> Values:
        """The hardness over E*, (n,), infinite for elastic bodies among those that yield."""
        if self.hardness_ratio is None and not self.elastic:
            raise ValueError("these features need the hardness")
        given = np.inf if self.hardness_ratio is None else self.hardness_ratio
        return np.ones(len(self.delta)) * given

    @property
    def capped_ratio(self) -> Values:
        """The same, up to a hardness that no elastic contact reaches, if there are any."""
        if not self.elastic:
            return self.ratio
        return np.minimum(self.ratio, no_yield(self.delta, self.length, self.grid))


Formula = Callable[[_Rows], Values]


def _each(
    pattern: str, names: Sequence[str], formula: Callable[[str, _Rows], Values]
) -> dict[str, Formula]:
    """Give one formula to features that are made of some statistics or columns alike."""
    return {pattern.format(name): partial(formula, name) for name in names}


FORMULAS: Mapping[str, Formula] = {
    "delta": lambda rows: rows.delta,
    **_each("{}", STATISTICS, lambda name, rows: rows.statistic(name)),
    "delta/h": lambda rows: rows.delta / rows.unit,
    **_each("{}/h", HEIGHTS, lambda name, rows: rows.statistic(name) / rows.unit),
    **_each(
        "log({}.L2/h)",
        CURVATURES,
        lambda name, rows: np.log(rows.statistic(name) * rows.length * rows.length / rows.unit),
    ),
    **_each("log({})", BANDWIDTHS, lambda name, rows: np.log(rows.statistic(name))),
    **_each("{}", HYBRID, lambda name, rows: rows.coarse(name)),
    **_each("sqrt({})", (*ROOTED, *ROOTED_LOCAL), lambda name, rows: np.sqrt(rows.coarse(name))),
    ROOT: lambda rows: np.sqrt(rows.delta / rows.unit),
    HARDNESS: lambda rows: rows.capped_ratio,
    SCALED_HARDNESS: lambda rows: np.log(rows.capped_ratio * rows.length / rows.unit),
    PLASTIC: lambda rows: np.sqrt(rows.coarse(FORCE) * rows.delta / (rows.length * rows.ratio)),
    NODES: lambda rows: np.log2(rows.grid),
}
"""Every feature by its name, (n,)."""


@dataclass(frozen=True)
class FeatureSet:
    """A named set of features, of which each has a formula."""

    name: str  # on the command line and in files
    columns: tuple[str, ...]  # names of the features, in order
    normalisation: str  # the default, of `learn.models.NORMALISATIONS`
    scaled: bool  # True if features and targets have no units (`target_scale`)
    blocks: int = 0  # per side of the coarse solve, if `LOCAL` is among the features
    elastic: bool = False  # True if elastic bodies are among those that yield

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the features."""
        return tuple(_UNITS.get(name, "1") for name in self.columns)

    @property
    def needs_surface(self) -> bool:
        """True if the features need the heights of the surface."""
        return COARSE[0] in self.columns

    @property
    def rooted(self) -> bool:
        """True if square roots of some columns are among the features."""
        return bool({ROOT, f"sqrt({ROOTED[0]})"} & set(self.columns))

    @property
    def solved_blocks(self) -> int:
        """Blocks per side of the coarse solve that the features need."""
        return self.blocks or BLOCKS

    @property
    def needs_hardness(self) -> bool:
        """True if the hardness is one of the features."""
        return bool({HARDNESS, SCALED_HARDNESS} & set(self.columns))

    @property
    def needs_nodes(self) -> bool:
        """True if the number of nodes is one of the features."""
        return NODES in self.columns

    @property
    def needs_grid(self) -> bool:
        """True if the features depend on the number of nodes."""
        return self.needs_nodes or self.elastic


_WITHOUT_UNITS = (
    *(f"{name}/h" for name in ("delta", *HEIGHTS)),
    *(f"log({name}.L2/h)" for name in CURVATURES),
    *(f"log({name})" for name in BANDWIDTHS),
    *PURE,
)

SETS: Mapping[str, FeatureSet] = {
    each.name: each
    for each in (
        FeatureSet("paper", ("delta", *STATISTICS), "l2", scaled=False),
        FeatureSet("dimensionless", _WITHOUT_UNITS, "standard", scaled=True),
        FeatureSet("hybrid", (*_WITHOUT_UNITS, *COARSE), "standard", scaled=True),
    )
}


def chosen(
    name: str,
    hardness_ratio: Limits | None = None,
    *,
    roots: bool = False,
    blocks: int = BLOCKS,
    elastic: bool = False,
    nodes: bool = False,
) -> FeatureSet:
    """Return the feature set of a name, with what rows and models need besides.

    Bodies that yield have limits of their hardness over E*, perhaps with `elastic` ones among them.
    A set with units gains the hardness if it varies; one without always does, because its other
    features lack the scale of the heights, and with it the pressure. With `roots` it is the set
    that surrogates see, with a number of blocks per side of the coarse solve (0: without `LOCAL`);
    with `nodes` their number is a feature. InputError is raised if no set has this name, or no
    coarse solve this number of blocks.
    """
    if blocks not in {0, *BLOCK_COUNTS}:
        known = " or ".join(map(str, BLOCK_COUNTS))
        raise InputError(f"--blocks {blocks}: give {known}, the blocks along a side")
    if name not in SETS:
        raise InputError(f"--features {name!r}: give one of {', '.join(SETS)}")
    features = SETS[name]
    blocks = blocks if roots and features.needs_surface else 0
    added: list[str] = []
    if roots and features.needs_surface:
        added += [f"sqrt({column})" for column in ROOTED]
        if blocks:
            added += [*LOCAL, *(f"sqrt({column})" for column in ROOTED_LOCAL)]
    elif roots and features.scaled:
        added.append(ROOT)
    yields = hardness_ratio is not None and (
        features.scaled or hardness_ratio[0] < hardness_ratio[1]
    )
    if yields:
        added.append(SCALED_HARDNESS if features.scaled else HARDNESS)
        added += [PLASTIC] if elastic and features.needs_surface else []
    added += [NODES] if nodes else []
    columns = (*features.columns, *added)
    return replace(features, columns=columns, blocks=blocks, elastic=yields and elastic)


def patch_length(sides: tuple[float, float]) -> float:
    """Return the scan length L of a patch, the geometric mean of its sides along x and y [um]."""
    return sides[0] if sides[0] == sides[1] else math.sqrt(sides[0] * sides[1])


def build(
    features: FeatureSet,
    statistics: Values,
    delta: Values,
    length: Values | float,
    hybrid: Values | None = None,
    hardness_ratio: Values | float | None = None,
    nodes: Values | float | None = None,
) -> Values:
    """Turn n rows of statistics into the features of a set, (n, d), NaN or infinite if undefined.

    Statistics, (n, 22), are in the order and units of `STATISTICS`; Delta, (n,), and the scan
    length L, one for all rows or (n,), in um. Sets that need the surface need columns of `HYBRID`,
    (n, 17). The hardness over E* and the nodes along a side, geometric means of both axes, are for
    sets that need them; the hardness is infinite, or None, for elastic bodies among those that
    yield.
    """
    rows = _Rows(statistics, delta, length, hybrid, hardness_ratio, nodes, features.elastic)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.column_stack([FORMULAS[name](rows) for name in features.columns])


def no_yield(delta: Values, length: Values | float, nodes: Values) -> Values:
    """Return a hardness over E* that no elastic contact reaches with `nodes` along a side, (n,).

    All pressures push a node down, so its own is at most the interference over its own influence
    coefficient: p <= E* Delta / (1.12 spacing) in square cells, less than E* Delta n / L. Harder
    bodies are elastic: with this ceiling, rows with the same contact have the same feature.
    """
    return np.asarray(delta * nodes / length)


def height_unit(statistics: Values, delta: Values) -> Values:
    """Return the height h, the root of the sum of squares of Delta and the statistics in um, (n,).

    The sum is taken of numbers near 1, after division by a power of two, so that no square
    overflows or underflows.
    """
    heights = np.column_stack([delta, *(statistics[:, STATISTICS.index(name)] for name in HEIGHTS)])
    with np.errstate(invalid="ignore"):
        _, exponent = np.frexp(np.max(np.abs(heights), axis=1))
        scaled = np.ldexp(heights, -exponent[:, None])
        return np.asarray(np.ldexp(np.sqrt(np.einsum("ij,ij->i", scaled, scaled)), exponent))


def target_scale(
    features: FeatureSet,
    target: str,
    statistics: Values,
    delta: Values,
    length: Values | float,
    modulus: float,
) -> Values:
    """Return the divisor, (n,), of a target before it is learnt, so that it has no unit.

    It is in the unit of the target's column, and 1 for features with units. Statistics, Delta and
    length are those of `build`; E* is in MPa.
    """
    ones = np.ones(len(delta))
    if not features.scaled:
        return ones
    scales = {
        "force": modulus * length * delta,
        "mean_gap": height_unit(statistics, delta),
        "largest_pressure": modulus * delta / length,
        "perimeter": length * ones,
        "stiffness": modulus * length * ones,
        "interface_stiffness": modulus * length * ones,
    }
    return np.asarray(scales.get(target, ones), dtype=np.float64)


def modulus(scene: Scene) -> float:
    """Return the E* of a scene [MPa]."""
    return plane_strain_modulus(scene.contact.modulus, scene.contact.poisson)


def limits_of(scenes: Sequence[Scene]) -> Limits | None:
    """Return the smallest and largest hardness over E* of scenes; None if all are elastic."""
    ends = [end / modulus(scene) for scene in scenes for end in scene.contact.hardness_limits or ()]
    return (min(ends), max(ends)) if ends else None


def features_of(
    scenes: Sequence[Scene], name: str, *, roots: bool, blocks: int = BLOCKS
) -> FeatureSet:
    """Return the feature set for rows of one or more scenes; see `chosen`.

    Bodies that yield add the hardness, patches that differ in their nodes the number of these.
    """
    elastic = len({scene.contact.hardness_limits is None for scene in scenes}) > 1
    nodes = len({node_count(scene) for scene in scenes}) > 1
    limits = limits_of(scenes)
    return chosen(name, limits, roots=roots, blocks=blocks, elastic=elastic, nodes=nodes)


def node_count(scene: Scene) -> float:
    """Return the nodes of a scene's patches along a side, the geometric mean of both axes."""
    nx, ny = scene.shape
    return math.sqrt(nx * ny)
