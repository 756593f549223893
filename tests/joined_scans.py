"""Scans of one made surface at three magnifications, whose spectrum is known."""

import numpy as np

from gen.maps.read import Topography
from gen.spectral import SelfAffineSpectrum, generate_spectral

PERIOD = 1024  # nodes and um
SPECTRUM = SelfAffineSpectrum(0.8, 200.0, 3.0)
MAGNIFIED = {"coarse": 6, "middle": 3, "fine": 1}
"""Distance of the nodes of each scan [um]; each has 160 x 160 nodes."""


def surface(seed=0, spectrum=SPECTRUM):
    """Make a periodic surface with a node every um, of rms height 1 um."""
    sides = (float(PERIOD), float(PERIOD))
    random = np.random.default_rng(seed)
    return generate_spectral((PERIOD, PERIOD), sides, spectrum, random, rms_height=1.0)


HEIGHTS = surface()


def scan(name, heights=HEIGHTS, nodes=160):
    """Cut a scan out of a surface, less its mean."""
    step = MAGNIFIED[name]
    cut = heights[20 : 20 + nodes * step : step, 40 : 40 + nodes * step : step]
    side = (nodes - 1.0) * step
    return Topography(name, cut - cut.mean(), (side, side))


def scans(heights=HEIGHTS):
    """Cut the three scans out of a surface."""
    return [scan(name, heights) for name in MAGNIFIED]


def save_scans(folder):
    """Save the scans as texts with lengths, and return the names of the files."""
    for name, step in MAGNIFIED.items():
        length = 160 * step
        header = f"Width: {length} um\nHeight: {length} um\nValue units: um"
        np.savetxt(folder / f"{name}.txt", scan(name).heights.T, header=header)
    return [f"{name}.txt" for name in MAGNIFIED]
