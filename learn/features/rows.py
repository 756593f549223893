"""The numbers of rows from which features, and the scales of targets, are computed.

The scan length L of an oblong patch is the geometric mean of both sides, as that of a square of
equal area. No feature tells the shape of the patch, because all rows of a database have one shape.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from gen.arrays import Values
from gen.runtime.errors import InputError
from gen.statistics import rms_slope_of
from learn.features.columns import HEIGHTS, STATISTICS
from learn.features.layers import Layers, joined_layers

# Positions in `STATISTICS` of the statistics that are heights.
HEIGHT_PLACES = [STATISTICS.index(name) for name in HEIGHTS]

# Statistics from which the rms slope follows.
OF_SLOPE = ("height_rms", "peak_density", "bandwidth_x", "bandwidth_y")

Remark = TypeVar("Remark")  # type of the remarks on rows: a note (str) or a `Grid`


class Grid(NamedTuple):
    """The grid of a surface."""

    shape: tuple[int, ...]  # nodes along both axes
    sides: tuple[float, ...]  # scan lengths along both axes [um]


@dataclass(frozen=True, eq=False)
class Rows:
    """The numbers of n rows from which features, and the scales of targets, are computed."""

    # (n, 22), in the order and units of `STATISTICS`
    statistics: Values
    # (n,), far-field displacement Delta, or the length that replaces it (`by_pressure`) [um]
    delta: Values
    # scan length L, the geometric mean of both sides, one number or (n,) [um]
    length: Values | float
    # hardness over E*, one number or (n,); infinite or None for elastic bodies
    hardness_ratio: Values | float | None = None
    # nodes along a side, the geometric mean of both axes, one number or (n,); None if unknown
    nodes: Values | float | None = None
    # (n, 18), columns of `HYBRID`; None if the coarse solve was not computed
    hybrid: Values | None = None
    # reasons why rows have no answer, "" for rows with one: empty, one for all rows, or n
    notes: tuple[str, ...] = ()
    # numbers of the scene by name, (n,) each: parameters that it draws, hardnesses and loads
    scene_numbers: Mapping[str, Values] = field(default_factory=dict)
    # one grid for all rows, or n; empty if unknown
    grids: tuple[Grid, ...] = ()
    layers: Layers | None = None  # layers of n rows; None for half-spaces

    def under(self, pressure: Values, e_star: Values | float) -> "Rows":
        """Return the rows with Delta replaced by the length p L / E* of pressures (`by_pressure`).

        Parameters
        ----------
        pressure : ndarray, shape (n,)
            Nominal pressures [MPa].
        e_star : float or ndarray, shape (n,)
            E* [MPa].

        Returns
        -------
        Rows
            The rows, with the pressures also as "pressure" in `scene_numbers`.
        """
        numbers = {**self.scene_numbers, "pressure": pressure}
        delta = by_pressure(pressure, self.length, e_star)
        return replace(self, delta=delta, scene_numbers=numbers)

    @property
    def coarse(self) -> Values:
        """Columns of the coarse solve, (n, 18); raises InputError if they were not computed."""
        if self.hybrid is None:
            raise InputError(
                "hybrid features need the surface, not its statistics alone: give its heights, or"
                " fit with --features dimensionless"
            )
        return self.hybrid

    @cached_property
    def height_unit(self) -> Values:
        """Height h: root of the sum of the squares of Delta and of the `HEIGHTS`, (n,) [um].

        The heights are divided by a power of two first, so that no square overflows or underflows.
        """
        columns = [self.delta]
        columns += [self.statistics[:, place] for place in HEIGHT_PLACES]
        heights = np.column_stack(columns)
        with np.errstate(invalid="ignore"):
            _, exponents = np.frexp(np.max(np.abs(heights), axis=1))
            scaled = np.ldexp(heights, -exponents[:, None])  # the largest is 0.5 to 1
            roots = np.sqrt(np.einsum("ij,ij->i", scaled, scaled))
            return np.asarray(np.ldexp(roots, exponents))

    @property
    def nodes_per_side(self) -> Values:
        """Nodes along a side, (n,); raises InputError if they are unknown."""
        if self.nodes is None or not np.greater(self.nodes, 0).all():
            raise InputError(
                "names no nodes_x and nodes_y, which the surrogate was trained with as a feature"
            )
        return np.ones(len(self.delta)) * self.nodes

    @property
    def hardness_ratios(self) -> Values:
        """Hardness over E*, (n,), infinite for elastic bodies."""
        ratio = self.hardness_ratio
        if ratio is None:
            ratio = np.inf
        return np.ones(len(self.delta)) * ratio

    @property
    def required_layers(self) -> Layers:
        """The layers of the n rows. Raises InputError for half-spaces."""
        if self.layers is None:
            raise InputError("the surrogate was trained on layers: give the layer")
        return self.layers

    @property
    def wave_number(self) -> Values:
        """Wave number of the surfaces, their rms slope over their rms height, (n,) [1/um].

        It follows from the statistics (`gen.statistics.rms_slope_of`) and the spacing of the nodes.
        Raises InputError if the nodes are unknown.
        """
        spacing = self.length / self.nodes_per_side
        of_slope = {name: self.statistics[:, STATISTICS.index(name)] for name in OF_SLOPE}
        slope = rms_slope_of(of_slope, (spacing, spacing))
        return np.asarray(slope / of_slope["height_rms"])

    def capped(self) -> "Rows":
        """Return the rows with hardnesses limited to a ceiling that no elastic contact reaches.

        The ceiling is E* Delta n / L with n nodes along a side. The pressures of the other nodes
        displace a node downwards, too. Its own pressure is therefore at most its interference over
        its own influence coefficient: p <= E* Delta / (1.12 spacing) in square cells, which is
        below the ceiling. Bodies of a hardness above the ceiling stay elastic. Limited to it, their
        hardness makes no difference to the features, as it makes none to the contact. Raises
        InputError if the nodes are unknown.
        """
        ceiling = self.delta * self.nodes_per_side / self.length
        ratios = np.minimum(self.hardness_ratios, ceiling)
        return replace(self, hardness_ratio=ratios)


def by_pressure(
    pressure: Values, length: Values | float, modulus: Values | float
) -> Values:
    """Return the length p L / E*, which replaces Delta in features of surfaces under a pressure.

    If heights are scaled by a and sides by b, the pressures of equal contacts are a / b times as
    large. This length is then a times as large, as Delta is. Hybrid features use the Delta of their
    coarse solve instead.

    Parameters
    ----------
    pressure : ndarray, shape (n,)
        Nominal pressures p [MPa].
    length : float or ndarray, shape (n,)
        Scan length L [um].
    modulus : float or ndarray, shape (n,)
        E* [MPa].

    Returns
    -------
    ndarray, shape (n,)
        Lengths [um].
    """
    return np.asarray(pressure * length / modulus)


def joined(parts: Sequence[Rows]) -> Rows:
    """Join the rows of several surfaces, surface by surface.

    Parameters
    ----------
    parts : sequence of Rows
        Rows of each surface, one part or more, for one feature set. The names in `scene_numbers`
        are equal in all parts.

    Returns
    -------
    Rows
        All rows. Hardness, nodes and grids are each left out for all rows if one part lacks them.
    """
    if len(parts) == 1:
        return parts[0]
    sizes = [len(part.delta) for part in parts]
    lengths = [np.ones(len(part.delta)) * part.length for part in parts]
    notes: tuple[str, ...] = ()
    if any(part.notes for part in parts):
        notes = _repeated([part.notes or ("",) for part in parts], sizes)
    grids: tuple[Grid, ...] = ()
    if all(part.grids for part in parts):
        grids = _repeated([part.grids for part in parts], sizes)
    hybrid: Values | None = None
    coarse = [part.hybrid for part in parts if part.hybrid is not None]
    if coarse:  # all parts have it, or none
        hybrid = np.concatenate(coarse)
    return Rows(
        statistics=np.concatenate([part.statistics for part in parts]),
        delta=np.concatenate([part.delta for part in parts]),
        length=np.concatenate(lengths),
        hardness_ratio=_joined_numbers([part.hardness_ratio for part in parts], sizes),
        nodes=_joined_numbers([part.nodes for part in parts], sizes),
        hybrid=hybrid,
        notes=notes,
        scene_numbers=_joined_scene_numbers(parts),
        grids=grids,
        layers=joined_layers([part.layers for part in parts], sizes),
    )


def _joined_scene_numbers(parts: Sequence[Rows]) -> dict[str, Values]:
    """Return the joined numbers of the scene by name, for the names of the first part."""
    return {
        name: np.concatenate([part.scene_numbers[name] for part in parts])
        for name in parts[0].scene_numbers
    }


def _joined_numbers(
    numbers: Sequence[Values | float | None], sizes: Sequence[int]
) -> Values | None:
    """Return one number for each row of all parts; None if the entry of any part is None.

    The entry of a part is one number for all its rows, or one for each row; `sizes` are the numbers
    of rows of the parts.
    """
    arrays = []
    for number, size in zip(numbers, sizes, strict=True):
        if number is None:
            return None
        arrays.append(np.full(size, number))
    return np.concatenate(arrays)


def _repeated(
    remarks: Sequence[tuple[Remark, ...]], sizes: Sequence[int]
) -> tuple[Remark, ...]:
    """Return one remark for each row of all parts.

    The tuple of a part has one remark for all its rows, or one for each row; `sizes` are the
    numbers of rows of the parts.
    """
    joint: list[Remark] = []
    for of_part, size in zip(remarks, sizes, strict=True):
        if len(of_part) == 1:
            joint += of_part * size
        else:
            joint += of_part
    return tuple(joint)
