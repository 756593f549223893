"""Another spacing for a map without holes: splines between its nodes, means where it is coarser."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gen.arrays import Heights
from gen.measured.topography import Sides, Topography, intervals
from gen.runtime.errors import InputError

SAME = 1e-3
"""Relative difference of two spacings that are the same but for an instrument's rounding."""


def is_same(one: float, other: float) -> bool:
    """Tell whether two spacings differ by no more than an instrument's rounding [um]."""
    return abs(one - other) <= SAME * max(one, other)


def resampled(topography: Topography, spacing: tuple[float, float]) -> Topography:
    """Give a map another spacing, axis by axis.

    Cubic splines through the nodes are evaluated where the new nodes are closer. Where they are
    further apart, the splines are averaged over the new cells: values at the new nodes would fold
    short waves back into long ones. An axis keeps its nodes if the two spacings are the same but
    for rounding, see `SAME`.

    Parameters
    ----------
    topography : Topography
        Surface without holes.
    spacing : tuple of float
        Distance of the new nodes along x and y [um].

    Returns
    -------
    Topography
        Surface with exactly these spacings; the step is recorded if nodes changed.

    Raises
    ------
    InputError
        If fewer than 2 x 2 nodes are left, or the map has fewer than four along such an axis.
    """
    heights = topography.heights
    for axis in (0, 1):
        heights = _along(topography, heights, axis, spacing[axis])
    nx, ny = heights.shape
    if min(nx, ny) < 2:
        raise InputError(
            f"{topography.name}: a spacing of {_words(spacing)} leaves {nx} x {ny} nodes, give one"
            " that leaves 2 x 2 or more"
        )
    sides = tuple(
        intervals(nodes, topography.boundary) * step
        for nodes, step in zip(heights.shape, spacing, strict=True)
    )
    steps = topography.steps
    if heights is not topography.heights:
        steps = (*steps, f"resampled to {nx} x {ny} nodes every {_words(spacing)} by cubic splines")
    return replace(topography, heights=heights, sides=(sides[0], sides[1]), steps=steps)


def _along(topography: Topography, heights: Heights, axis: int, new: float) -> Heights:
    """Resample heights along one axis to a spacing [um]."""
    from scipy.interpolate import make_interp_spline

    old, nodes = topography.spacing[axis], heights.shape[axis]
    if is_same(old, new):
        return heights
    if nodes < 4:
        raise InputError(f"{topography.name}: {nodes} nodes along an axis, resampling needs 4")
    length = (nodes - 1) * old / new * (1 + 1e-12)
    spline: Any = make_interp_spline(old * np.arange(nodes), heights, k=3, axis=axis)
    if new < old:
        places = new * np.arange(int(length) + 1)
        values = spline(np.minimum(places, (nodes - 1) * old))
    else:
        edges = np.minimum(new * np.arange(int(length) + 1), (nodes - 1) * old)
        values = np.diff(spline.antiderivative()(edges), axis=axis) / new
    return np.ascontiguousarray(values)


def _words(spacing: Sides) -> str:
    """Write two spacings as one if they are equal."""
    x, y = spacing
    return f"{x:g} um" if x == y else f"{x:g} x {y:g} um"
