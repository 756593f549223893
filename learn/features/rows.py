"""The numbers of rows that features, and the scales of targets, are computed from.

The scan length L of an oblong patch is the geometric mean of both sides, so that a square of the
same area has the same L. Models learn the shape of the patch from no feature, because all rows of a
database share it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from gen.arrays import Values
from gen.runtime.errors import InputError
from learn.features.columns import HEIGHTS, STATISTICS

# places of the statistics in um
HEIGHT_PLACES = [STATISTICS.index(name) for name in HEIGHTS]

Remark = TypeVar("Remark")


class Grid(NamedTuple):
    """The grid of a surface."""

    shape: tuple[int, ...]  # nodes along both axes
    sides: tuple[float, ...]  # scan lengths along both axes [um]


@dataclass(frozen=True, eq=False)
class Rows:
    """The numbers of n rows that features, and the scales of targets, are computed from."""

    # (n, 22), in the order and units of `STATISTICS`
    statistics: Values
    # (n,), far-field displacement, or what stands for it (`by_pressure`) [um]
    delta: Values
    # scan length L, the geometric mean of both sides, one number or (n,) [um]
    length: Values | float
    # hardness over E*, one number or (n,); infinite or None for elastic bodies
    hardness_ratio: Values | float | None = None
    # nodes along a side, the geometric mean of both axes, one number or (n,)
    nodes: Values | float | None = None
    # (n, 18), columns of `HYBRID`
    hybrid: Values | None = None
    # why rows have no answer: none, one for all rows, or n
    notes: tuple[str, ...] = ()
    # (n,) each, numbers of the scene by name: parameters that it draws, hardnesses and loads
    scene_numbers: Mapping[str, Values] = field(default_factory=dict)
    # one for all rows, or n; none if unknown
    grids: tuple[Grid, ...] = ()

    def under(self, pressure: Values, e_star: float) -> "Rows":
        """Return the rows under pressures, which stand for Delta; see `by_pressure`.

        Parameters
        ----------
        pressure : ndarray, shape (n,)
            Nominal pressures [MPa].
        e_star : float
            E* [MPa].

        Returns
        -------
        Rows
            The rows, with the pressures among the numbers of the scene.
        """
        numbers = {**self.scene_numbers, "pressure": pressure}
        delta = by_pressure(pressure, self.length, e_star)
        return replace(self, delta=delta, scene_numbers=numbers)

    @property
    def coarse(self) -> Values:
        """The columns of the coarse solve, (n, 18); InputError if they were not computed."""
        if self.hybrid is None:
            raise InputError(
                "hybrid features need the surface, not its statistics alone: give its heights, or"
                " fit with --features dimensionless"
            )
        return self.hybrid

    @cached_property
    def height_unit(self) -> Values:
        """The height h, the root of the sum of squares of Delta and the statistics in um, (n,).

        The sum is taken of numbers near 1, after division by a power of two, so that no square
        overflows or underflows.
        """
        columns = [self.delta]
        columns += [self.statistics[:, place] for place in HEIGHT_PLACES]
        heights = np.column_stack(columns)
        with np.errstate(invalid="ignore"):
            _, exponent = np.frexp(np.max(np.abs(heights), axis=1))
            scaled = np.ldexp(heights, -exponent[:, None])
            roots = np.sqrt(np.einsum("ij,ij->i", scaled, scaled))
            return np.asarray(np.ldexp(roots, exponent))

    @property
    def nodes_per_side(self) -> Values:
        """Nodes along a side, (n,); InputError if they are unknown."""
        if self.nodes is None or not np.greater(self.nodes, 0).all():
            raise InputError(
                "names no nodes_x and nodes_y, which the surrogate was trained with as a feature"
            )
        return np.ones(len(self.delta)) * self.nodes

    @property
    def hardness_ratios(self) -> Values:
        """The hardness over E*, (n,), infinite for elastic bodies."""
        ratio = self.hardness_ratio
        if ratio is None:
            ratio = np.inf
        return np.ones(len(self.delta)) * ratio

    def capped(self) -> "Rows":
        """Return the rows with a hardness that no elastic contact reaches instead of larger ones.

        All pressures push a node down, so its own is at most the interference over its own
        influence coefficient: p <= E* Delta / (1.12 spacing) in square cells, less than E* Delta n
        / L. Harder bodies are elastic: with this ceiling, rows with the same contact have the same
        feature.
        """
        ceiling = self.delta * self.nodes_per_side / self.length
        ratios = np.minimum(self.hardness_ratios, ceiling)
        return replace(self, hardness_ratio=ratios)


def by_pressure(pressure: Values, length: Values | float, modulus: float) -> Values:
    """Return p L / E*, which stands for Delta in features of surfaces under a pressure.

    Like Delta, it grows with heights and does not change with L. Hybrid features have the Delta of
    their coarse solve instead.

    Parameters
    ----------
    pressure : ndarray, shape (n,)
        Nominal pressures p [MPa].
    length : float or ndarray, shape (n,)
        Scan length L [um].
    modulus : float
        E* [MPa].

    Returns
    -------
    ndarray, shape (n,)
        Lengths [um].
    """
    return np.asarray(pressure * length / modulus)


def joined(parts: Sequence[Rows]) -> Rows:
    """Join rows of several surfaces, of one feature set, in their order.

    Parameters
    ----------
    parts : sequence of Rows
        Rows of each surface, one part or more, with the same numbers of the scene.

    Returns
    -------
    Rows
        All rows. A number that one part does not know is unknown for all rows.
    """
    if len(parts) == 1:
        return parts[0]
    sizes = [len(part.delta) for part in parts]
    notes: tuple[str, ...] = ()
    if any(part.notes for part in parts):
        notes = _repeated([part.notes or ("",) for part in parts], sizes)
    grids: tuple[Grid, ...] = ()
    if all(part.grids for part in parts):
        grids = _repeated([part.grids for part in parts], sizes)
    hybrid = [part.hybrid for part in parts if part.hybrid is not None]
    return Rows(
        statistics=np.concatenate([part.statistics for part in parts]),
        delta=np.concatenate([part.delta for part in parts]),
        length=np.concatenate([np.ones(len(part.delta)) * part.length for part in parts]),
        hardness_ratio=_joined_numbers([part.hardness_ratio for part in parts], sizes),
        nodes=_joined_numbers([part.nodes for part in parts], sizes),
        hybrid=np.concatenate(hybrid) if hybrid else None,
        notes=notes,
        scene_numbers=_joined_scene_numbers(parts),
        grids=grids,
    )


def _joined_scene_numbers(parts: Sequence[Rows]) -> dict[str, Values]:
    """Join the numbers of the scene, by name, that all parts have."""
    return {
        name: np.concatenate([part.scene_numbers[name] for part in parts])
        for name in parts[0].scene_numbers
    }


def _joined_numbers(
    numbers: Sequence[Values | float | None], sizes: Sequence[int]
) -> Values | None:
    """Join numbers of parts, one for all rows of a part or one for each row; None if one lacks."""
    arrays = []
    for number, size in zip(numbers, sizes, strict=True):
        if number is None:
            return None
        arrays.append(np.full(size, number))
    return np.concatenate(arrays)


def _repeated(
    remarks: Sequence[tuple[Remark, ...]], sizes: Sequence[int]
) -> tuple[Remark, ...]:
    """Join remarks of parts, one for all rows of a part or one for each row."""
    joint: list[Remark] = []
    for of_part, size in zip(remarks, sizes, strict=True):
        joint += of_part * size if len(of_part) == 1 else of_part
    return tuple(joint)
