"""Choose the steps of the preparation that a map needs: despiking, levelling, filling.

`gen scene` chooses them for all of its maps together. The option `--prepare` of other commands
chooses them for each map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.filters import fitted_polynomial
from gen.maps.outliers import local_medians, scatter_of
from gen.maps.settings import SPIKE, Reading

# Smallest share of the variance about the mean plane that a quadratic surface explains in a curved
# map. A smaller share may come from a long wave of the roughness.
FORM = 0.9
# share of all nodes above which nodes that were replaced as spikes are probably part of the surface
MANY_SPIKES = 0.01
# fewest nodes along the shorter side of a map whose spikes and form are looked for
FEWEST_NODES_A_SIDE = 4

# Up to a share `MANY_SPIKES` of the nodes are spikes if they are beyond a gap: the distances of the
# nearest spike and of the furthest other node have more than this ratio.
GAP = 2.0
# Without this gap, up to this share of the nodes are spikes if the furthest is far away.
FEW_SPIKES = 1e-3
# Then the distance of the furthest spike is above this multiple of the distance that a share
# `FEW_SPIKES` of all nodes exceeds.
FAR_SPIKE = 2.5


@dataclass(frozen=True)
class Spikes:
    """The spikes of a map. Distances are from the local median, in units of the scatter [1]."""

    surface: float  # largest distance of the nodes that are no spikes; at least `SPIKE`
    nearest: float  # smallest distance of a spike; infinite if there is none
    number: int  # number of spikes


@dataclass(frozen=True)
class MapNeeds:
    """Faults of a map before its preparation, for which steps of the preparation are chosen."""

    spikes: Spikes | None = None  # None if they were not looked for
    # share of the variance about the mean plane that a quadratic surface explains [1]
    form: float = 0.0
    missing: int = 0  # number of nodes without a height

    @classmethod
    def of(cls, heights: Heights) -> Self:
        """Find the faults of a map.

        Parameters
        ----------
        heights : ndarray, shape (nx, ny)
            Heights, NaN where they are missing [um].

        Returns
        -------
        MapNeeds
            The faults. Spikes and form are not looked for if all heights are equal, or the map has
            fewer than `FEWEST_NODES_A_SIDE` nodes along a side.
        """
        missing = int(np.count_nonzero(np.isnan(heights)))
        is_flat = np.nanmax(heights) == np.nanmin(heights)
        if is_flat or min(heights.shape) < FEWEST_NODES_A_SIDE:
            return cls(missing=missing)
        return cls(
            spikes=find_spikes(heights), form=share_of_form(heights), missing=missing
        )

    @property
    def is_curved(self) -> bool:
        """Whether the map has a form that a quadratic surface explains."""
        return self.form > FORM


def with_needed_steps(settings: Reading, maps: Sequence[MapNeeds]) -> Reading:
    """Choose the steps that maps need, except for steps that the user has given.

    Parameters
    ----------
    settings : Reading
        Settings of the user.
    maps : sequence of MapNeeds
        The faults of the maps, which are prepared alike.

    Returns
    -------
    Reading
        A copy of the settings. If the user has not given `despike`, it is a threshold, or None if
        no map has spikes. If the user has not given `level`, it is "quadratic" if a map is curved,
        otherwise "plane"; it stays "" if the user has given a form. `fill` is on if the user has
        given it, or a map has holes.
    """
    despike = settings.despike
    if despike is None:
        spikes = [needs.spikes for needs in maps if needs.spikes is not None]
        despike = common_threshold(spikes)
    level = settings.level
    if not level and settings.form is None:
        level = "plane"
        if any(needs.is_curved for needs in maps):
            level = "quadratic"
    fill = settings.fill or any(needs.missing > 0 for needs in maps)
    return replace(settings, despike=despike, level=level, fill=fill)


def share_of_form(heights: Heights) -> float:
    """Return the share of the variance about the mean plane that a quadratic surface explains.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of at least 3 nodes along both axes, NaN where they are missing [um].

    Returns
    -------
    float
        The share [1]; 0 for a plane.
    """
    plane = fitted_polynomial(heights, degree=1)
    quadratic = fitted_polynomial(heights, degree=2)
    about_plane = float(np.nanvar(heights - plane))
    about_quadratic = float(np.nanvar(heights - quadratic))
    if about_plane == 0.0:
        return 0.0
    return 1.0 - about_quadratic / about_plane


def find_spikes(heights: Heights) -> Spikes:
    """Find the spikes of a map by the distances of its nodes from their local medians.

    Spikes are the nodes beyond the widest gap in the sorted distances, where the width of a gap is
    the ratio of the distances on both sides. The gap has to be wide, unless the spikes are few and
    one of them is far from the surface.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN where they are missing [um].

    Returns
    -------
    Spikes
        The number of spikes, and the distances on both sides of the gap, in units of the scatter of
        all distances. Distances below `SPIKE` are taken as `SPIKE`.
    """
    from_medians = heights - local_medians(heights)
    distances = np.abs(from_medians / scatter_of(from_medians, heights))
    without_holes = distances[~np.isnan(distances)]
    # A smaller distance than `SPIKE` never makes a spike.
    falling = np.maximum(np.sort(without_holes)[::-1], SPIKE)
    number = _number_beyond_gap(falling, share=MANY_SPIKES, smallest_ratio=GAP)
    distance_of_few = falling[int(FEW_SPIKES * falling.size)]
    if number == 0 and falling[0] > FAR_SPIKE * distance_of_few:
        number = _number_beyond_gap(falling, share=FEW_SPIKES, smallest_ratio=1.0)
    nearest = math.inf
    if number > 0:
        nearest = float(falling[number - 1])
    return Spikes(surface=float(falling[number]), nearest=nearest, number=number)


def _number_beyond_gap(falling: Values, share: float, smallest_ratio: float) -> int:
    """Return how many distances, sorted from the largest down, are beyond the widest gap.

    The gap is looked for in the given share of the distances, from the largest down. The number is
    0 unless the distances on both sides of the gap have a ratio above `smallest_ratio`.
    """
    largest_number = max(1, int(share * falling.size))
    first = falling[: largest_number + 1]
    ratios = first[:-1] / first[1:]
    gap = int(np.argmax(ratios))
    if ratios[gap] <= smallest_ratio:
        return 0
    return gap + 1


def common_threshold(spikes: Sequence[Spikes]) -> float | None:
    """Choose one threshold that removes the spikes of all maps.

    Parameters
    ----------
    spikes : sequence of Spikes
        The spikes of each map.

    Returns
    -------
    float or None
        Value of the key `despike`: a distance from the local median in units of the scatter. It is
        between the surfaces of all maps and the nearest spike of all maps. If a surface of one map
        reaches beyond the nearest spike of another, it is just below that spike. None if no map has
        spikes.
    """
    nearest = min((of_map.nearest for of_map in spikes), default=math.inf)
    if math.isinf(nearest):
        return None
    surface = max(of_map.surface for of_map in spikes)
    threshold = 0.98 * nearest
    if surface < nearest:
        threshold = math.sqrt(surface * nearest)
    # A number of two digits is easier to read in the scene, but only a separating one may be taken.
    two_digits = float(f"{threshold:.2g}")
    if surface < two_digits < nearest:
        return two_digits
    return threshold
