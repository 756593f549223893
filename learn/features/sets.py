"""The feature sets: their columns, and the formulas from Delta and the 22 statistics to features.

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
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gen.runtime.errors import InputError
from gen.schema import statistics_columns
from learn.arrays import Values

STATISTICS: tuple[str, ...] = tuple(column.name for column in statistics_columns())
"""The 22 statistics, in the order of the paper's Table 1."""

_UNITS = {column.name: column.unit for column in statistics_columns()}
HEIGHTS = tuple(name for name in STATISTICS if _UNITS[name] == "um")
CURVATURES = tuple(name for name in STATISTICS if _UNITS[name] == "um-1")
BANDWIDTHS = ("bandwidth_x", "bandwidth_y")
PURE = tuple(name for name in STATISTICS if name not in {*HEIGHTS, *CURVATURES, *BANDWIDTHS})

HYBRID = (
    "bearing_share",
    "bearing_interference/delta",
    "coarse_area_percent",
    "coarse_force/(E*.L.delta)",
    "coarse_displacement/delta",
    "refined_share",
    "refined_interference/delta",
)
"""Columns that the hybrid set adds, from `learn.features.surface`; all are pure numbers."""


HARDNESS = "hardness/E*"
"""The hardness as a feature of sets with units."""

SCALED_HARDNESS = "log(hardness.L/(E*.h))"
"""The hardness as a feature of sets without units."""

Limits = tuple[float, float]


@dataclass(frozen=True)
class FeatureSet:
    """A named set of features.

    Attributes
    ----------
    name : str
        Name on the command line and in files.
    columns : tuple of str
        Names of the features, in order.
    units : tuple of str
        Units of the features.
    normalisation : str
        Default scaling, a name of `learn.models.NORMALISATIONS`.
    scaled : bool
        True if features and targets have no units (`target_scale`).
    needs_surface : bool
        True if the features need the heights of the surface.
    """

    name: str
    columns: tuple[str, ...]
    units: tuple[str, ...]
    normalisation: str
    scaled: bool
    needs_surface: bool

    @property
    def needs_hardness(self) -> bool:
        """True if the hardness is one of the features."""
        return bool({HARDNESS, SCALED_HARDNESS} & set(self.columns))

    def with_hardness(self, limits: Limits | None) -> "FeatureSet":
        """Return the set for bodies that yield.

        Parameters
        ----------
        limits : tuple of float or None
            Smallest and largest hardness over E* of the rows; None for elastic bodies.

        Returns
        -------
        FeatureSet
            A set with units gains the hardness if it varies. A set without units always gains it,
            because its other features lack the scale of the heights, and with it the pressure.
        """
        if limits is None or not (self.scaled or limits[0] < limits[1]):
            return self
        column = SCALED_HARDNESS if self.scaled else HARDNESS
        return replace(self, columns=(*self.columns, column), units=(*self.units, "1"))


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
            (*_WITHOUT_UNITS, *HYBRID),
            ("1",) * (len(_WITHOUT_UNITS) + len(HYBRID)),
            "standard",
            scaled=True,
            needs_surface=True,
        ),
    )
}


def chosen(name: str, hardness_ratio: Limits | None = None) -> FeatureSet:
    """Return the feature set of a name.

    Parameters
    ----------
    name : str
        Name of the set.
    hardness_ratio : tuple of float, optional
        Smallest and largest hardness over E*, for bodies that yield.

    Raises
    ------
    InputError
        If no set has this name.
    """
    if name not in SETS:
        raise InputError(f"--features {name!r}: give one of {', '.join(SETS)}")
    return SETS[name].with_hardness(hardness_ratio)


def build(
    features: FeatureSet,
    statistics: Values,
    delta: Values,
    length: Values | float,
    hybrid: Values | None = None,
    hardness_ratio: Values | float | None = None,
) -> Values:
    """Turn rows of statistics into features.

    Parameters
    ----------
    features : FeatureSet
        The set to build.
    statistics : ndarray, shape (n, 22)
        Statistics in the order of `STATISTICS`, in their units.
    delta : ndarray, shape (n,)
        Far-field displacement [um].
    length : ndarray or float
        Scan length L, the geometric mean of both sides; one for all rows, or shape (n,) [um].
    hybrid : ndarray, shape (n, 7), optional
        Columns of `HYBRID`, for sets that need the surface.
    hardness_ratio : ndarray, shape (n,), or float, optional
        Hardness over E*, for sets with this feature.

    Returns
    -------
    ndarray, shape (n, d)
        Features, NaN or infinite where the statistics are undefined.
    """
    ratio = np.ones((len(delta), int(features.needs_hardness)))
    if features.needs_hardness:
        if hardness_ratio is None:
            raise ValueError(f"{features.name} features need the hardness")
        ratio *= np.reshape(hardness_ratio, (-1, 1))
    if not features.scaled:
        return np.column_stack([delta, statistics, ratio])
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
        parts += list(hybrid.T)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        parts += list(np.log(ratio.T * length / unit))
    return np.column_stack(parts)


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

    Parameters
    ----------
    features : FeatureSet
        The set that the models are given.
    target : str
        Name of the target's column.
    statistics, delta, length : ndarray
        See `build`.
    modulus : float
        E* [MPa].

    Returns
    -------
    ndarray, shape (n,)
        Scale in the unit of the target; 1 for features with units.
    """
    ones = np.ones(len(delta))
    if not features.scaled:
        return ones
    scales = {
        "force": modulus * length * delta,
        "mean_gap": height_unit(statistics, delta),
        "largest_pressure": modulus * delta / length,
        "perimeter": length * ones,
    }
    return np.asarray(scales.get(target, ones), dtype=np.float64)
