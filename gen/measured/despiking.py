"""Spikes of a measured map: nodes far from the median of their neighbourhood."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values

WINDOW = 5
"""Nodes along each side of the neighbourhood: its median ignores spikes of up to 3 x 4 nodes."""

ROWS = 64
"""Rows of nodes whose neighbourhoods are gathered at a time, which bounds the memory."""

ROUNDING = 1e-9
"""Scatter of the smoothest surfaces, as a share of the span of the heights: less is rounding."""


def without_spikes(heights: Heights, threshold: float) -> tuple[Heights, NDArray[np.bool_]]:
    """Replace nodes that are far from their local median by this median.

    Far is further than `threshold` times the scatter of these distances over the map, which is
    their median absolute deviation times 1.4826: the standard deviation if they are normal.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights with NaN in the holes, which are neither spikes nor part of a median [um].
    threshold : float
        Distance from which a node is a spike, in units of the scatter.

    Returns
    -------
    heights : ndarray, shape (nx, ny)
        Heights without spikes; all other nodes keep every bit [um].
    spikes : ndarray of bool, shape (nx, ny)
        Nodes that were replaced.
    """
    medians = local_medians(heights)
    with np.errstate(over="ignore"):  # a bound beyond all numbers leaves no spike
        spikes = np.abs(heights - medians) > threshold * _scatter(heights, medians)
    return np.where(spikes, medians, heights), spikes


def scaled_distances(heights: Heights) -> Values:
    """Compute the distance of each node from its local median in units of their scatter.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights with NaN in the holes, not all equal [um].

    Returns
    -------
    ndarray, shape (nx, ny)
        Distances, NaN in the holes; `without_spikes` compares them with its threshold [1].
    """
    medians = local_medians(heights)
    return np.asarray((heights - medians) / _scatter(heights, medians))


def _scatter(heights: Heights, medians: Heights) -> float:
    """Return the scatter of the distances from local medians, at least that of rounding [um]."""
    distances = heights - medians
    measured = distances[~np.isnan(distances)]
    scatter = 1.4826 * float(np.median(np.abs(measured - np.median(measured))))
    return max(scatter, ROUNDING * float(np.nanmax(heights) - np.nanmin(heights)))


def local_medians(heights: Heights) -> Heights:
    """Compute the median of the measured nodes around each node, itself included, on their slope.

    Beside a hole, a spike or the border, a slope would shift the median. So the plane through the
    node whose slopes are the medians of those in its neighbourhood is taken out before.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights with NaN in the holes [um].

    Returns
    -------
    ndarray, shape (nx, ny)
        Medians over `WINDOW` x `WINDOW` nodes, NaN where all of these are missing [um].
    """
    padded = np.pad(heights, WINDOW // 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (WINDOW, WINDOW))
    steps = np.arange(WINDOW) - WINDOW // 2
    medians = np.empty(heights.shape)
    for first in range(0, len(heights), ROWS):
        block = windows[first : first + ROWS].reshape(-1, WINDOW, WINDOW)
        along_x, along_y = (
            np.nan_to_num(_medians(np.diff(block, axis=axis)), copy=False)[:, None, None]
            for axis in (1, 2)
        )
        level = block - along_x * steps[:, None] - along_y * steps
        medians[first : first + ROWS] = _medians(level).reshape(-1, heights.shape[1])
    return medians


def _medians(values: Values) -> Values:
    """Return the median of the numbers of each entry of the first axis, NaN if it has none."""
    each = values.reshape(len(values), -1)
    ordered = np.sort(each, axis=1)  # NaN come last
    count = np.count_nonzero(~np.isnan(each), axis=1)
    entries = np.arange(len(each))
    lower, upper = (
        ordered[entries, np.maximum(place, 0)] for place in ((count - 1) // 2, count // 2)
    )
    return np.asarray(np.where(count % 2 == 1, lower, lower / 2 + upper / 2))
