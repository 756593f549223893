"""The feature sets: their columns, and how Delta and the 22 statistics become features.

By dimensional analysis the contact area depends on heights and Delta through their ratios alone,
and not on L: the equations of the half-space are linear in displacements, and pressures scale with
E* / L. So heights and Delta are taken over h, the root of the sum of their squares: like the
paper's scaling of rows to unit length, but exact under a change of units. (Over the rms height
alone, which is small for some surfaces, kernel ridge is half as accurate again.) Curvatures are
multiplied by L^2 / h and, as the bandwidths, taken as logarithms: they span decades. Densities are
per node, the rest are pure numbers.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.runtime.errors import InputError
from gen.schema import statistics_columns

Values = NDArray[np.float64]

STATISTICS: tuple[str, ...] = tuple(column.name for column in statistics_columns())
"""The 22 statistics, in the order of the paper's Table 1."""

_UNITS = {column.name: column.unit for column in statistics_columns()}
HEIGHTS = tuple(name for name in STATISTICS if _UNITS[name] == "um")
CURVATURES = tuple(name for name in STATISTICS if _UNITS[name] == "um-1")
BANDWIDTHS = ("bandwidth_x", "bandwidth_y")
PURE = tuple(name for name in STATISTICS if name not in {*HEIGHTS, *CURVATURES, *BANDWIDTHS})

PRESSED = (
    "bearing_share",
    "bearing_interference/delta",
    "coarse_area_percent",
    "coarse_force/(E*.L.delta)",
    "coarse_displacement/delta",
    "refined_share",
    "refined_interference/delta",
)
"""What the hybrid set adds, from `learn.features.surface`; pure numbers all."""


@dataclass(frozen=True)
class FeatureSet:
    """One choice of inputs.

    Attributes
    ----------
    name : on the command line and in files
    columns : names of its features, in order
    units : their units
    normalisation : how they are scaled unless asked otherwise, of `learn.models.NORMALISATIONS`
    scaled : True if it is free of units: then so are the targets (`target_scale`)
    needs_surface : True if the statistics do not suffice
    """

    name: str
    columns: tuple[str, ...]
    units: tuple[str, ...]
    normalisation: str
    scaled: bool
    needs_surface: bool


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
            (*_WITHOUT_UNITS, *PRESSED),
            ("1",) * (len(_WITHOUT_UNITS) + len(PRESSED)),
            "standard",
            scaled=True,
            needs_surface=True,
        ),
    )
}


def chosen(name: str) -> FeatureSet:
    """Find a feature set by its name.

    Raises
    ------
    InputError
        If there is none.
    """
    if name not in SETS:
        raise InputError(f"--features {name!r}: give one of {', '.join(SETS)}")
    return SETS[name]


def build(
    features: FeatureSet,
    statistics: Values,
    delta: Values,
    length: Values | float,
    pressed: Values | None = None,
) -> Values:
    """Turn rows of statistics into features.

    Parameters
    ----------
    features : which
    statistics : (n, 22) in the order of `STATISTICS`, in their units
    delta : (n,) far-field displacement [um]
    length : scan length L, the geometric mean of both sides, one or (n,) [um]
    pressed : (n, 7) `PRESSED`, for sets that need the surface

    Returns
    -------
    (n, d) features, NaN or infinite where the statistics are undefined
    """
    if features.name == "paper":
        return np.column_stack([delta, statistics])
    column = {name: statistics[:, place] for place, name in enumerate(STATISTICS)}
    unit = height_unit(statistics, delta)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        parts = [delta / unit, *(column[name] / unit for name in HEIGHTS)]
        parts += [np.log(column[name] * length * length / unit) for name in CURVATURES]
        parts += [np.log(column[name]) for name in BANDWIDTHS]
    parts += [column[name] for name in PURE]
    if features.needs_surface:
        if pressed is None:
            raise ValueError(f"{features.name} features need the surface")
        parts += list(pressed.T)
    return np.column_stack(parts)


def height_unit(statistics: Values, delta: Values) -> Values:
    """(n,) the height h: root of the sum of squares of Delta and all statistics that are heights.

    The unit is a power of two times a number near 1 whatever the heights' scale, so that none of
    the squares over- or underflows.
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
    """What a target is divided by before it is learnt, so that it is free of units too.

    Parameters
    ----------
    features, statistics, delta, length : see `build`
    target : name of its column
    modulus : E* [MPa]

    Returns
    -------
    (n,) in the target's unit; 1 for features in um
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
