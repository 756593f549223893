"""Areal Gaussian filter after ISO 16610-61: long or short wavelengths of a map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from gen.arrays import Heights

if TYPE_CHECKING:  # surfaces are described without the solver
    from bem.spacing import Boundary

ALPHA = math.sqrt(math.log(2) / math.pi)
"""Constant of the standard's weighting function, for which half of a wave of the cut-off passes."""

REACH = 6.0
"""Reach of the weights in standard deviations, beyond which they are 1e-8 of the largest."""

FINEST = 4.0
"""Shortest cut-off in spacings: there the sampled weights let 50.2 % pass, at 3 spacings 56 %."""


def long_waves(
    heights: Heights,
    spacing: tuple[float, float],
    cutoff: float,
    boundary: Boundary = "free",
) -> Heights:
    """Smooth a map by the Gaussian weights of ISO 16610-61, normalised at the borders it has.

    Of a wave along any direction exp(-ln 2 (cutoff / wavelength)^2) passes, one half at the
    cut-off. Near the border of a free patch the weights inside the map are divided by their sum. A
    patch without edges goes on there, and so do the weights.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    cutoff : float
        Cut-off wavelength, at least `FINEST` spacings [um].
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch.

    Returns
    -------
    ndarray, shape (nx, ny)
        Waves that are longer than the cut-off [um].
    """
    from scipy.ndimage import gaussian_filter1d

    smooth, deviation = heights, ALPHA * cutoff / math.sqrt(2 * math.pi)
    for axis, (nodes, step) in enumerate(zip(heights.shape, spacing, strict=True)):
        sigma = deviation / step
        radius = math.ceil(REACH * sigma)
        if boundary != "free":
            mode: Literal["wrap", "reflect"] = "wrap" if boundary == "periodic" else "reflect"
            smooth = gaussian_filter1d(smooth, sigma, axis=axis, mode=mode, radius=radius)
            continue
        weights = {"sigma": sigma, "radius": min(radius, nodes - 1)}
        inside = gaussian_filter1d(np.ones(nodes), mode="constant", **weights)
        smooth = gaussian_filter1d(smooth, axis=axis, mode="constant", **weights)
        smooth = smooth / np.expand_dims(inside, 1 - axis)
    return smooth
