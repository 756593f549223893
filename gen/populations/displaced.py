"""Surfaces of random midpoint displacement for scenes."""

from collections.abc import Mapping

import numpy as np

from gen.arrays import Heights
from gen.scene import DisplacedSurface, Scene
from gen.surface import generate, without_last_nodes


def surface_heights(
    scene: Scene, surface: int, parameters: Mapping[str, float], random: np.random.Generator
) -> Heights:
    """Displace midpoints; parameters and result are those of `gen.populations.surface_heights`."""
    settings = scene.surface
    assert isinstance(settings, DisplacedSurface)
    heights = generate(
        settings.generator, settings.nodes, parameters["hurst"], parameters["sigma0"], random
    )
    return without_last_nodes(heights) if scene.edgeless else heights
