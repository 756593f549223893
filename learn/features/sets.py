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

The hybrid set adds columns from the heights themselves and from a coarse contact solve. On 2,540
training rows of the paper preset those of `COARSE` have an nMSE of the area of 0.28 %, with roots
0.26 %, with `LOCAL` 0.14 %.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from gen.arrays import Values
from gen.quantities import Powers
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import TABLE_1
from learn.features import scene as scenic
from learn.features.scene import SCENE

# the 22 statistics, in the order of the paper's Table 1
STATISTICS: tuple[str, ...] = tuple(column.name for column in TABLE_1)
_UNITS = {"delta": "um"} | {column.name: column.unit for column in TABLE_1}
HEIGHTS = tuple(name for name in STATISTICS if _UNITS[name] == "um")
OF_HEIGHTS = [STATISTICS.index(name) for name in HEIGHTS]
CURVATURES = tuple(name for name in STATISTICS if _UNITS[name] == "um-1")
BANDWIDTHS = ("bandwidth_x", "bandwidth_y")
PURE = tuple(
    name for name in STATISTICS if name not in {*HEIGHTS, *CURVATURES, *BANDWIDTHS}
)

ROOT = "sqrt(delta/h)"  # further input of surrogates without units, beside the root of the area
HARDNESS = "hardness/E*"  # the hardness as a feature of sets with units
SCALED_HARDNESS = (
    "log(hardness.L/(E*.h))"  # the hardness as a feature of sets without units
)
# square root of the share of the patch that carries the coarse solve's force at the hardness: no
# contact of bodies that yield has a smaller area; 0 for elastic bodies
PLASTIC = "sqrt(coarse_force/(hardness.L2))"
# nodes along a side, where grids differ; the geometric mean of both axes. A coarser grid leaves out
# short waves, and counts a contact in larger cells.
NODES = "log2(nodes)"

BLOCKS = 33  # blocks per side; on a surface with fewer nodes every node is a block
# Those that a user can choose from. A patch without edges has one less: blocks of 2^k nodes a side
# are then equal, and transforms of their number fast.
BLOCK_COUNTS = (BLOCKS, 65)

FORCE = "coarse_force/(E*.L.delta)"
# columns that comparisons of models add; all are pure numbers, as are the others
COARSE = (
    "bearing_share",
    "bearing_interference/delta",
    "coarse_area_percent",
    FORCE,
    "coarse_displacement/delta",
    "refined_share",
    "refined_interference/delta",
)

# Multiples of the coarse pressures from which the area inside the blocks is estimated: real local
# contacts lie on other curves than Persson's, which models find between these.
FACTORS = (0.5, 1.0, 2.0)
# shifts of the displacement above which nodes are counted, over the rms s of the heights that the
# blocks do not resolve
SHIFTS = (-1.0, -0.5, 0.5, 1.0)
POWERS = (
    2,
    3,
)  # powers of the mean interference of the nodes that stand above the displacement
# skewness of the heights that the blocks do not resolve, 0 where every node is a block: those of
# self-affine surfaces are as high as deep; those of scratches, pits and worn peaks are not
SKEWNESS = "unresolved_skewness"
# columns of `LOCAL` whose square roots surrogates see too
ROOTED_LOCAL = (
    *(f"local_area({factor:g}p)" for factor in FACTORS),
    *(f"refined_share({shift:+g}s)" for shift in SHIFTS),
)
# columns of the same solve that surrogates see too
LOCAL = (
    *ROOTED_LOCAL,
    *(f"refined_interference_{power}/delta" for power in POWERS),
    "coarse_perimeter/L",
    SKEWNESS,
)
HYBRID = (*COARSE, *LOCAL)  # all columns, in the order of `SurfaceFeatures.hybrid`
# columns of `COARSE` whose square roots surrogates see too: like the area they begin at first touch
# and span decades, and the roots tell small values apart
ROOTED = ("bearing_share", "coarse_area_percent", FORCE, *COARSE[-2:])

Sides = tuple[float, float]
Grid = tuple[tuple[int, ...], tuple[float, ...]]  # nodes along both axes, and sides [um]


@dataclass(frozen=True, eq=False)
class Rows:
    """The numbers of n rows that features, and the scales of targets, are computed from."""

    statistics: Values  # (n, 22), in the order and units of `STATISTICS`
    delta: (
        Values  # (n,), far-field displacement, or what stands for it (`by_pressure`) [um]
    )
    length: (
        Values | float
    )  # scan length L, the geometric mean of both sides, or (n,) [um]
    hardness_ratio: Values | float | None = (
        None  # over E*; infinite or None for elastic bodies
    )
    nodes: Values | float | None = None  # along a side, the geometric mean of both axes
    hybrid: Values | None = None  # (n, 18), columns of `HYBRID`
    notes: tuple[str, ...] = ()  # why rows have no answer: none, one for all rows, or n
    given: Mapping[str, Values] = field(
        default_factory=dict
    )  # (n,) each, what the scene gives
    grids: tuple[Grid, ...] = ()  # one for all rows, or n; none if unknown

    def under(self, pressure: Values, e_star: float) -> "Rows":
        """Return the rows under pressures, (n,) [MPa], which stand for Delta; see `by_pressure`."""
        delta = by_pressure(pressure, self.length, e_star)
        return replace(self, delta=delta, given={**self.given, "pressure": pressure})

    @property
    def coarse(self) -> Values:
        """The columns of the coarse solve, (n, 18)."""
        if self.hybrid is None:
            raise InputError(
                "hybrid features need the surface, not its statistics alone: give its heights, or"
                " fit with --features dimensionless"
            )
        return self.hybrid

    @cached_property
    def unit(self) -> Values:
        """The height h, the root of the sum of squares of Delta and the statistics in um, (n,).

        The sum is taken of numbers near 1, after division by a power of two, so that no square
        overflows or underflows.
        """
        heights = np.column_stack(
            [self.delta, *(self.statistics[:, place] for place in OF_HEIGHTS)]
        )
        with np.errstate(invalid="ignore"):
            _, exponent = np.frexp(np.max(np.abs(heights), axis=1))
            scaled = np.ldexp(heights, -exponent[:, None])
            return np.asarray(
                np.ldexp(np.sqrt(np.einsum("ij,ij->i", scaled, scaled)), exponent)
            )

    @property
    def grid(self) -> Values:
        """Nodes along a side, (n,)."""
        if self.nodes is None or not np.greater(self.nodes, 0).all():
            raise InputError(
                "names no nodes_x and nodes_y, which the surrogate was trained with as a feature"
            )
        return np.ones(len(self.delta)) * self.nodes

    @property
    def ratio(self) -> Values:
        """The hardness over E*, (n,), infinite for elastic bodies."""
        given = np.inf if self.hardness_ratio is None else self.hardness_ratio
        return np.ones(len(self.delta)) * given

    def capped(self) -> "Rows":
        """Return the rows with a hardness that no elastic contact reaches instead of larger ones.

        All pressures push a node down, so its own is at most the interference over its own
        influence coefficient: p <= E* Delta / (1.12 spacing) in square cells, less than E* Delta n
        / L. Harder bodies are elastic: with this ceiling, rows with the same contact have the same
        feature.
        """
        ceiling = self.delta * self.grid / self.length
        return replace(self, hardness_ratio=np.minimum(self.ratio, ceiling))


def joined(parts: Sequence[Rows]) -> Rows:
    """Join rows of several surfaces, of one feature set, in their order.

    Parameters
    ----------
    parts : sequence of Rows
        Rows of each surface, one or more of them.

    Returns
    -------
    Rows
        All rows.
    """
    if len(parts) == 1:
        return parts[0]
    sizes = [len(part.delta) for part in parts]

    def numbers(name: str) -> Values | None:
        """Join an attribute that is one number, or one for each row."""
        values = [getattr(part, name) for part in parts]
        if any(value is None for value in values):
            return None
        return np.concatenate([np.full(n, v) for n, v in zip(sizes, values, strict=True)])

    def repeated(name: str, missing: Any) -> tuple[Any, ...]:
        """Join an attribute that is nothing, one for all rows of a part, or one for each row."""
        every: list[Any] = []
        for size, part in zip(sizes, parts, strict=True):
            values = getattr(part, name) or (missing,)
            every += values * size if len(values) == 1 else values
        return tuple(every)

    hybrid = [part.hybrid for part in parts if part.hybrid is not None]
    return Rows(
        statistics=np.concatenate([part.statistics for part in parts]),
        delta=np.concatenate([part.delta for part in parts]),
        length=np.concatenate([np.ones(len(part.delta)) * part.length for part in parts]),
        hardness_ratio=numbers("hardness_ratio"),
        nodes=numbers("nodes"),
        hybrid=np.concatenate(hybrid) if hybrid else None,
        notes=repeated("notes", "") if any(part.notes for part in parts) else (),
        given={
            name: np.concatenate([part.given[name] for part in parts])
            for name in parts[0].given
        },
        grids=repeated("grids", None) if all(part.grids for part in parts) else (),
    )


Formula = Callable[[Rows], Values]


def _each(
    pattern: str,
    names: Sequence[str],
    formula: Callable[[int, Rows], Values],
    among: Sequence[str] = STATISTICS,
) -> dict[str, Formula]:
    """Give one formula to features of the columns of some names, whose places it takes."""
    return {pattern.format(name): partial(formula, among.index(name)) for name in names}


FORMULAS: Mapping[str, Formula] = {
    "delta": lambda rows: rows.delta,
    **_each("{}", STATISTICS, lambda place, rows: rows.statistics[:, place]),
    "delta/h": lambda rows: rows.delta / rows.unit,
    **_each("{}/h", HEIGHTS, lambda place, rows: rows.statistics[:, place] / rows.unit),
    **_each(
        "log({}.L2/h)",
        CURVATURES,
        lambda place, r: np.log(r.statistics[:, place] * r.length * r.length / r.unit),
    ),
    **_each("log({})", BANDWIDTHS, lambda place, rows: np.log(rows.statistics[:, place])),
    **_each("{}", HYBRID, lambda place, rows: rows.coarse[:, place], HYBRID),
    **_each(
        "sqrt({})",
        (*ROOTED, *ROOTED_LOCAL),
        lambda place, rows: np.sqrt(rows.coarse[:, place]),
        HYBRID,
    ),
    ROOT: lambda rows: np.sqrt(rows.delta / rows.unit),
    HARDNESS: lambda rows: rows.ratio,
    SCALED_HARDNESS: lambda rows: np.log(rows.ratio * rows.length / rows.unit),
    PLASTIC: lambda r: np.sqrt(
        r.coarse[:, HYBRID.index(FORCE)] * r.delta / (r.length * r.ratio)
    ),
    NODES: lambda rows: np.log2(rows.grid),
}
"""Every feature by its name, (n,)."""


@dataclass(frozen=True)
class FeatureSet:
    """A named set of features, of which each has a formula."""

    name: str  # on the command line and in files
    columns: tuple[str, ...]  # names of the features, in order
    normalisation: str  # the default of `learn.models.pipeline`
    scaled: bool  # True if features and targets have no units (`scale`)
    needs_surface: bool = False  # True if the features need the heights of the surface
    blocks: int = 0  # per side of the coarse solve, if `LOCAL` is among the features
    elastic: bool = False  # True if elastic bodies are among those that yield
    load: str = (
        "delta"  # the load of surfaces, or "pressure"; the last of a scene's features
    )

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the features, or of the numbers that a scene's are of."""
        if self.name == SCENE:
            return tuple(map(scenic.unit_of, self.columns))
        return tuple(_UNITS.get(name, "1") for name in self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features, or of the numbers that a scene's are of."""
        if self.name == SCENE:
            return tuple(map(scenic.plain, self.columns))
        delta = "delta" if self.needs_surface or self.load == "delta" else "pressure.L/E*"
        return tuple(re.sub(r"\bdelta\b", delta, column) for column in self.columns)

    @property
    def rooted(self) -> bool:
        """True if square roots of some columns are among the features."""
        return bool({ROOT, f"sqrt({ROOTED[0]})"} & set(self.columns))

    def of(self, rows: Rows) -> Values:
        """Return the features of n rows, (n, d), NaN or infinite where they are undefined."""
        if self.name == SCENE:
            if not {*self.names} <= rows.given.keys():
                raise InputError(
                    f"a surrogate of a scene asks for {', '.join(self.names)} instead"
                )
            with np.errstate(divide="ignore", invalid="ignore"):
                return scenic.inputs(self.columns, rows.given)
        capped = rows.capped() if self.elastic else rows
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            every = [
                FORMULAS[name](rows if name == PLASTIC else capped)
                for name in self.columns
            ]
        return np.column_stack(every)

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
        heights = rows.delta if powers.modulus else rows.unit
        length = np.asarray(rows.length, dtype=np.float64)
        scale = modulus**powers.modulus * length ** float(powers.lengths)
        return np.asarray(
            scale * heights ** float(powers.heights) * ones, dtype=np.float64
        )


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
        """Return the values that a model is trained on, (n,)."""
        values = np.sqrt(target) if self.root else target
        return (values - self.mean) / self.deviation

    def restored(self, predicted: Values) -> Values:
        """Return targets, (n,), from a model's predictions on the scale of the training."""
        values = self.mean + self.deviation * np.asarray(predicted, dtype=np.float64)
        return np.maximum(values, 0.0) ** 2 if self.root else values


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
        FeatureSet(
            "hybrid",
            (*_WITHOUT_UNITS, *COARSE),
            "standard",
            scaled=True,
            needs_surface=True,
        ),
        FeatureSet(SCENE, (), "standard", scaled=False),
    )
}
OF_SURFACES = tuple(
    name for name in SETS if name != SCENE
)  # sets whose features a surface has


def chosen(
    name: str,
    scenes: Sequence[Scene] = (),
    *,
    roots: bool = False,
    blocks: int | None = None,
    load: str = "",
) -> FeatureSet:
    """Return the feature set of a name for the rows of one or more scenes.

    Bodies that yield add the hardness: to a set with units if it varies; to one without always,
    because its other features lack the scale of the heights, and with it the pressure. Patches that
    differ in their nodes add the number of these. With `roots` it is the set that surrogates see,
    with a number of blocks per side of the coarse solve, `BLOCKS` if left out. A scene's own set
    takes the scene's load, or one of `learn.features.scene.LOADS`; the others take Delta, or a
    pressure. InputError is raised if no set has this name or takes this load, or its coarse solve
    not this number of blocks.
    """
    if name not in SETS:
        raise InputError(f"--features {name!r}: give one of {', '.join(SETS)}")
    if blocks is not None and not SETS[name].needs_surface:
        raise InputError(
            f"--blocks {blocks}: only hybrid features have blocks: add --features hybrid"
        )
    if blocks not in {None, *BLOCK_COUNTS}:
        known = " or ".join(map(str, BLOCK_COUNTS))
        raise InputError(f"--blocks {blocks}: give {known}, the blocks along a side")
    features, limits = SETS[name], limits_of(scenes)
    if name == SCENE:
        columns = scenic.columns_of(scenes, load) if scenes else ()
        return replace(
            features, columns=columns, load=scenic.plain(columns[-1]) if columns else load
        )
    if load not in {"", "delta", "pressure"}:
        raise InputError(f"--load {load}: --features {name} take delta or pressure")
    local = roots and features.needs_surface
    added: list[str] = []
    if local:
        added = [f"sqrt({column})" for column in ROOTED]
        added += [*LOCAL, *(f"sqrt({column})" for column in ROOTED_LOCAL)]
    elif roots and features.scaled:
        added = [ROOT]
    elastic = False
    if limits is not None and (features.scaled or limits[0] < limits[1]):
        elastic = any(scene.contact.hardness_limits is None for scene in scenes)
        added.append(SCALED_HARDNESS if features.scaled else HARDNESS)
        added += [PLASTIC] if elastic and features.needs_surface else []
    added += [NODES] if len({math.prod(scene.grid.shape) for scene in scenes}) > 1 else []
    columns = (*features.columns, *added)
    return replace(
        features,
        columns=columns,
        blocks=(blocks or BLOCKS) if local else 0,
        elastic=elastic,
        load=load or "delta",
    )


def by_pressure(pressure: Values, length: Values | float, modulus: float) -> Values:
    """Return p L / E*, (n,) [um], which stands for Delta in features of surfaces under a pressure.

    As Delta does, it grows with heights, and does not change with L. Hybrid features have the Delta
    of their coarse solve instead.
    """
    return np.asarray(pressure * length / modulus)


def limits_of(scenes: Sequence[Scene]) -> tuple[float, float] | None:
    """Return the smallest and largest hardness over E* of scenes; None if all are elastic."""
    ends = [
        end / contact.e_star
        for contact in (scene.contact for scene in scenes)
        for end in contact.hardness_limits or ()
    ]
    return (min(ends), max(ends)) if ends else None
