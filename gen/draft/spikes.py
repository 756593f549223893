"""Find the threshold that parts the spikes of measured maps from their surfaces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gen.arrays import Heights, Values
from gen.measured.despiking import scaled_distances
from gen.measured.settings import SPIKE
from gen.measured.steps import MANY_SPIKES

GAP = 2.0
"""Ratio of the nearest spike's distance to that of the furthest other node which tells spikes from
a surface whatever their number."""

FEW = 1e-3
"""Largest share of the nodes that may be spikes if no gap separates them from the other nodes."""

APART = 2.5
"""Distance of the furthest of such spikes over that of the furthest share `FEW` of all nodes, at
least: on made maps without spikes the ratio is at most 2 (sharp ridges)."""


class Spikes(NamedTuple):
    """Distances from the local median on both sides of the gap between surface and spikes.

    Attributes
    ----------
    surface : float
        Largest distance of a node of the surface, in units of the scatter.
    nearest : float
        Smallest distance of a spike, infinite if there is none.
    number : int
        Number of spikes.
    distances : ndarray, shape (further,)
        The distances above `SPIKE`, falling.
    """

    surface: float
    nearest: float
    number: int
    distances: Values


def find_spikes(heights: Heights) -> Spikes:
    """Part the spikes of a map from its surface at the largest gap between their distances.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights with NaN in the holes [um].

    Returns
    -------
    Spikes
        Distances from the local median, in units of their scatter.
    """
    distances = np.abs(scaled_distances(heights))
    distances = np.sort(distances[~np.isnan(distances)])[::-1]
    high = np.maximum(distances, SPIKE)
    number = _before_gap(high, MANY_SPIKES, GAP)
    few = int(FEW * high.size)
    if not number and high[0] > APART * high[few]:
        number = _before_gap(high, FEW, 1.0)
    nearest = float(high[number - 1]) if number else math.inf
    return Spikes(float(high[number]), nearest, number, distances[distances > SPIKE])


def _before_gap(high: Values, share: float, least: float) -> int:
    """Return how many distances are before their largest gap, 0 if its ratio is too small.

    Parameters
    ----------
    high : ndarray, shape (nodes,)
        Distances, falling.
    share : float
        Share of them that may be before the gap.
    least : float
        Smallest ratio of the distances at the gap.
    """
    ahead = high[: max(1, int(share * high.size)) + 1]
    ratios = ahead[:-1] / ahead[1:]
    place = int(np.argmax(ratios))
    return place + 1 if ratios[place] > least else 0


def common_threshold(found: Sequence[Spikes]) -> float | None:
    """Choose one threshold for several maps.

    Parameters
    ----------
    found : sequence of Spikes
        Spikes of each map.

    Returns
    -------
    float or None
        Threshold between all surfaces and all spikes, in the middle of their logarithms. Where no
        number parts them it is just below the nearest spike, and some nodes of other maps are taken
        for spikes. None if no map has a spike.
    """
    nearest = min((each.nearest for each in found), default=math.inf)
    if math.isinf(nearest):
        return None
    surface = max(each.surface for each in found)
    middle = math.sqrt(surface * nearest) if surface < nearest else 0.98 * nearest
    return float(f"{middle:.2g}") if surface < float(f"{middle:.2g}") < nearest else middle
