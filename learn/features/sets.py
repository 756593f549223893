"""The feature sets: their columns, and the formulas from Delta and the 22 statistics to features.

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

The hardness adds one number: pressures scale with E* h / L, so the feature is the hardness over
this pressure. Its logarithm is taken, because it spans decades: on 3,000 rows of the paper's
surfaces with a hardness from 0.003 to 0.1 E*, kernel ridge without hybrid features then has an nMAE
of the area of 7.5 %; with the number itself it is 9.1 %, with the logarithm of the hardness over E*
8.1 %.

The hybrid set adds columns from the heights themselves and from a coarse contact solve. Of 4,000
rows of the paper preset (kernel ridge, areas to 16.56 %, 2,540 rows train, three splits) those of
`COARSE` have an nMSE of the area of 0.28 %, with roots 0.26 %. `LOCAL` makes this 0.14 %; the
shares by Persson's theory alone make it 0.16 %. The number of spots and bearing shares at parts of
Delta changed nothing and are left out.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gen.arrays import Values
from gen.material import plane_strain_modulus
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import statistics_columns

STATISTICS: tuple[str, ...] = tuple(column.name for column in statistics_columns())
"""The 22 statistics, in the order of the paper's Table 1."""

_UNITS = {column.name: column.unit for column in statistics_columns()}
HEIGHTS = tuple(name for name in STATISTICS if _UNITS[name] == "um")
CURVATURES = tuple(name for name in STATISTICS if _UNITS[name] == "um-1")
BANDWIDTHS = ("bandwidth_x", "bandwidth_y")
PURE = tuple(name for name in STATISTICS if name not in {*HEIGHTS, *CURVATURES, *BANDWIDTHS})

ROOT = "sqrt(delta/h)"
"""Further inputs of surrogates with dimensionless features, beside the root of the area."""

HARDNESS = "hardness/E*"
"""The hardness as a feature of sets with units."""

SCALED_HARDNESS = "log(hardness.L/(E*.h))"
"""The hardness as a feature of sets without units."""

PLASTIC = "sqrt(coarse_force/(hardness.L2))"
"""Square root of the share of the patch that carries the coarse solve's force at the hardness. No
contact of bodies that yield has a smaller area; it is 0 for elastic bodies.
"""

NODES = "log2(nodes)"
"""The nodes along a side as a feature, where grids differ; the geometric mean of both axes."""

BLOCKS = 33
"""Blocks per side; on a surface with fewer nodes every node is a block."""

BLOCK_COUNTS = (BLOCKS, 65)
"""Blocks per side that a user can choose from. A patch without edges has one less: those of 2^k
nodes a side are then equal, and transforms of their number fast."""

COARSE = (
    "bearing_share",
    "bearing_interference/delta",
    "coarse_area_percent",
    "coarse_force/(E*.L.delta)",
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

_LOCAL_AREAS = tuple(f"local_area({factor:g}p)" for factor in FACTORS)
_SHIFTED_SHARES = tuple(f"refined_share({shift:+g}s)" for shift in SHIFTS)

LOCAL = (
    *_LOCAL_AREAS,
    *_SHIFTED_SHARES,
    *(f"refined_interference_{power}/delta" for power in POWERS),
    "coarse_perimeter/L",
)
"""Columns of the same solve that surrogates see too."""

HYBRID = (*COARSE, *LOCAL)
"""All columns, in the order in which `SurfaceFeatures.hybrid` returns them."""

ROOTED = (
    "bearing_share",
    "coarse_area_percent",
    "coarse_force/(E*.L.delta)",
    "refined_share",
    "refined_interference/delta",
)
"""Columns of `COARSE` whose square roots surrogates see too: like the area they begin at first
touch and span decades, and the roots tell small values apart."""

ROOTED_LOCAL = (*_LOCAL_AREAS, *_SHIFTED_SHARES)
"""Columns of `LOCAL` whose square roots surrogates see too."""

Limits = tuple[float, float]


def _coarse_names(*, roots: bool, blocks: int) -> tuple[str, ...]:
    """Name the columns that a set adds for a surface; parameters as of `_coarse_values`."""
    found: tuple[str, ...] = COARSE
    if roots:
        found += tuple(f"sqrt({name})" for name in ROOTED)
    if blocks:
        found += (*LOCAL, *(f"sqrt({name})" for name in ROOTED_LOCAL))
    return found


def _coarse_values(hybrid: Values, *, roots: bool, blocks: int) -> Values:
    """Return the columns that a set adds, (n, d), of the columns of `HYBRID`, (n, 17).

    Square roots of `ROOTED` are added with `roots`, the columns of `LOCAL` with `blocks`.
    """

    def column(name: str) -> Values:
        return hybrid[:, HYBRID.index(name)]

    parts = [column(name) for name in COARSE]
    if roots:
        parts += [np.sqrt(column(name)) for name in ROOTED]
    if blocks:
        parts += [column(name) for name in LOCAL]
        parts += [np.sqrt(column(name)) for name in ROOTED_LOCAL]
    return np.column_stack(parts)


@dataclass(frozen=True)
class FeatureSet:
    """A named set of features."""

    name: str  # on the command line and in files
    columns: tuple[str, ...]  # names of the features, in order
    units: tuple[str, ...]  # of the features
    normalisation: str  # the default, of `learn.models.NORMALISATIONS`
    scaled: bool  # True if features and targets have no units (`target_scale`)
    needs_surface: bool  # True if the features need the heights of the surface
    rooted: bool = False  # True if square roots of some columns follow the other features
    blocks: int = 0  # per side of the coarse solve, if `LOCAL` follows; else 0
    elastic: bool = False  # True if elastic bodies are among those that yield

    def with_roots(self, blocks: int = BLOCKS) -> "FeatureSet":
        """Return the set that surrogates see; itself if it has units.

        With 0 blocks per side of the coarse solve it has no columns of `LOCAL`.
        """
        if not self.scaled:
            return self
        columns, blocks = (*self.columns, ROOT), blocks if self.needs_surface else 0
        if self.needs_surface:
            columns = (*_WITHOUT_UNITS, *_coarse_names(roots=True, blocks=blocks))
        return replace(
            self, columns=columns, units=("1",) * len(columns), rooted=True, blocks=blocks
        )

    @property
    def solved_blocks(self) -> int:
        """Blocks per side of the coarse solve that the features need."""
        return self.blocks or BLOCKS

    @property
    def needs_hardness(self) -> bool:
        """True if the hardness is one of the features."""
        return bool({HARDNESS, SCALED_HARDNESS} & set(self.columns))

    def with_hardness(self, limits: Limits | None, *, elastic: bool = False) -> "FeatureSet":
        """Return the set for bodies that yield at these limits of the hardness over E*.

        A set with units gains the hardness if it varies. A set without units always gains it,
        because its other features lack the scale of the heights, and with it the pressure;
        `elastic` says that elastic bodies are among its rows. Without limits all bodies are
        elastic.
        """
        if limits is None or not (self.scaled or limits[0] < limits[1]):
            return self
        column = SCALED_HARDNESS if self.scaled else HARDNESS
        added = (column, PLASTIC) if elastic and self.needs_surface else (column,)
        columns, units = (*self.columns, *added), (*self.units, *("1",) * len(added))
        return replace(self, columns=columns, units=units, elastic=elastic)

    @property
    def needs_nodes(self) -> bool:
        """True if the number of nodes is one of the features."""
        return NODES in self.columns

    @property
    def needs_grid(self) -> bool:
        """True if the features depend on the number of nodes."""
        return self.needs_nodes or self.elastic

    def with_nodes(self) -> "FeatureSet":
        """Return the set for patches of different grids: the number of nodes is the last feature.

        A coarser grid leaves out short waves, and counts a contact in larger cells: a surface that
        is described by the same statistics has another area there.
        """
        return replace(self, columns=(*self.columns, NODES), units=(*self.units, "1"))


_WITHOUT_UNITS = (
    *(f"{name}/h" for name in ("delta", *HEIGHTS)),
    *(f"log({name}.L2/h)" for name in CURVATURES),
    *(f"log({name})" for name in BANDWIDTHS),
    *PURE,
)

SETS: Mapping[str, FeatureSet] = {
    each.name: each
    for each in (
        FeatureSet(
            "paper",
            ("delta", *STATISTICS),
            ("um", *(_UNITS[name] for name in STATISTICS)),
            "l2",
            scaled=False,
            needs_surface=False,
        ),
        FeatureSet(
            "dimensionless",
            _WITHOUT_UNITS,
            ("1",) * len(_WITHOUT_UNITS),
            "standard",
            scaled=True,
            needs_surface=False,
        ),
        FeatureSet(
            "hybrid",
            (*_WITHOUT_UNITS, *COARSE),
            ("1",) * (len(_WITHOUT_UNITS) + len(COARSE)),
            "standard",
            scaled=True,
            needs_surface=True,
        ),
    )
}


def chosen(
    name: str,
    hardness_ratio: Limits | None = None,
    *,
    roots: bool = False,
    blocks: int = BLOCKS,
    elastic: bool = False,
) -> FeatureSet:
    """Return the feature set of a name.

    Bodies that yield have limits of their hardness over E*, perhaps with `elastic` ones among them.
    With `roots` it is the set that surrogates see, with a number of blocks per side of the coarse
    solve. InputError is raised if no set has this name, or no coarse solve this number of blocks.
    """
    if blocks not in {0, *BLOCK_COUNTS}:
        known = " or ".join(map(str, BLOCK_COUNTS))
        raise InputError(f"--blocks {blocks}: give {known}, the blocks along a side")
    if name not in SETS:
        raise InputError(f"--features {name!r}: give one of {', '.join(SETS)}")
    features = SETS[name].with_roots(blocks) if roots else SETS[name]
    return features.with_hardness(hardness_ratio, elastic=elastic)


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
    """Turn n rows of statistics into features, (n, d), NaN or infinite where they are undefined.

    Parameters
    ----------
    features : FeatureSet
        The set to build.
    statistics : ndarray, shape (n, 22)
        Statistics in the order and units of `STATISTICS`.
    delta : ndarray, shape (n,)
        Far-field displacement [um].
    length : ndarray or float
        Scan length L, the geometric mean of both sides; one for all rows, or shape (n,) [um].
    hybrid : ndarray, shape (n, 17), optional
        Columns of `HYBRID`, for sets that need the surface.
    hardness_ratio : ndarray, shape (n,), or float, optional
        Hardness over E*, for sets with this feature; infinite, or None, for elastic bodies among
        those that yield.
    nodes : ndarray, shape (n,), or float, optional
        Nodes along a side, the geometric mean of both axes, for sets that need them.

    Returns
    -------
    ndarray, shape (n, d)
        The features.
    """
    given, ratio = _hardness(features, delta, length, hardness_ratio, nodes)
    grid = np.empty((len(delta), 0))
    if features.needs_nodes:
        if nodes is None:
            raise ValueError(f"{features.name} features need the number of nodes")
        grid = np.ones((len(delta), 1)) * np.log2(np.reshape(nodes, (-1, 1)))
    if not features.scaled:
        return np.column_stack([delta, statistics, ratio, grid])
    column = {name: statistics[:, place] for place, name in enumerate(STATISTICS)}
    unit = height_unit(statistics, delta)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        parts = [delta / unit, *(column[name] / unit for name in HEIGHTS)]
        parts += [np.log(column[name] * length * length / unit) for name in CURVATURES]
        parts += [np.log(column[name]) for name in BANDWIDTHS]
    parts += [column[name] for name in PURE]
    if features.needs_surface:
        if hybrid is None:
            raise ValueError(f"{features.name} features need the surface")
        added = _coarse_values(hybrid, roots=features.rooted, blocks=features.blocks)
        parts += list(added.T)
    elif features.rooted:
        parts.append(np.sqrt(delta / unit))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        parts += list(np.log(ratio.T * length / unit))
    if PLASTIC in features.columns:
        assert hybrid is not None  # refused above
        force = hybrid[:, HYBRID.index("coarse_force/(E*.L.delta)")]
        parts.append(np.sqrt(force * delta / (length * given[:, 0])))
    return np.column_stack([*parts, grid])


def _hardness(
    features: FeatureSet,
    delta: Values,
    length: Values | float,
    hardness_ratio: Values | float | None,
    nodes: Values | float | None,
) -> tuple[Values, Values]:
    """Return the hardness over E* as given, and up to that of `no_yield`, each (n, 0 or 1)."""
    given = np.ones((len(delta), int(features.needs_hardness)))
    if not features.needs_hardness:
        return given, given
    if hardness_ratio is None and not features.elastic:
        raise ValueError(f"{features.name} features need the hardness")
    given *= np.reshape(np.inf if hardness_ratio is None else hardness_ratio, (-1, 1))
    return given, np.minimum(given, no_yield(delta, length, nodes)) if features.elastic else given


def no_yield(delta: Values, length: Values | float, nodes: Values | float | None) -> Values:
    """Return a hardness over E* that no elastic contact reaches with `nodes` along a side, (n, 1).

    All pressures push a node down, so its own is at most the interference over its own influence
    coefficient: p <= E* Delta / (1.12 spacing) in square cells, less than E* Delta n / L. Harder
    bodies are elastic: with this ceiling, rows with the same contact have the same feature.
    """
    if nodes is None:
        raise ValueError("features of elastic bodies among others need the number of nodes")
    return np.reshape(delta * nodes / length, (-1, 1))


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
    """Return the scale that a target is divided by before it is learnt, so that it has no unit.

    It is in the unit of the target's column, (n,), and 1 for features with units. Statistics, Delta
    and length are those of `build`; E* is in MPa.
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
    wanted = chosen(name, limits_of(scenes), roots=roots, blocks=blocks, elastic=elastic)
    return wanted.with_nodes() if len({node_count(scene) for scene in scenes}) > 1 else wanted


def node_count(scene: Scene) -> float:
    """Return the nodes of a scene's patches along a side, the geometric mean of both axes."""
    nx, ny = scene.shape
    return math.sqrt(nx * ny)
