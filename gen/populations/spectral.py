"""Self-affine surfaces with a given power spectrum for scenes."""

from collections.abc import Mapping

import numpy as np

from gen.arrays import Heights
from gen.scene import Scene, SpectralSurface
from gen.spectral import SelfAffineSpectrum, generate_spectral


def surface_heights(
    scene: Scene, surface: int, parameters: Mapping[str, float], random: np.random.Generator
) -> Heights:
    """Add waves up; parameters and result are those of `gen.populations.surface_heights`.

    A surface on a periodic patch has the patch as its period. Any other one is a window of a
    surface whose period is longer, so that its opposite borders have nothing to do with each other.
    """
    settings = scene.surface
    assert isinstance(settings, SpectralSurface)
    spectrum = SelfAffineSpectrum(
        parameters["hurst"], parameters["roll_off"], parameters["cut_off"], parameters["stretch"]
    )
    nodes = settings.period_nodes(scene.contact.boundary)
    whole = generate_spectral(
        nodes,
        (nodes[0] * scene.spacing[0], nodes[1] * scene.spacing[1]),
        spectrum,
        random,
        rms_height=parameters.get("rms_height"),
        rms_slope=parameters.get("rms_slope"),
    )
    heights = whole[: scene.shape[0], : scene.shape[1]]
    return np.ascontiguousarray(heights - heights.min())
