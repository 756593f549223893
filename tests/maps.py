"""Maps that repeat themselves, and maps read as a command does, whose messages name options."""

from pathlib import Path
from typing import Any

import numpy as np

from bem.arrays import Field
from bem.problem import Boundary
from gen.maps.prepare import prepare, surface_warnings
from gen.maps.read import Topography
from gen.maps.read import read as read_map
from gen.maps.settings import Reading
from gen.spectral import SelfAffineSpectrum, generate_spectral


def waves(nodes: int, seed: int) -> Field:
    """Return a sum of waves that repeats itself on nodes x nodes cells [um]."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(*[np.arange(nodes) / nodes * 2 * np.pi] * 2)
    heights = [
        np.cos(i * x + j * y + rng.uniform(0, 7)) / (i * i + j * j)
        for i in range(4)
        for j in range(4)
        if i + j
    ]
    return np.asarray(0.3 * sum(heights))


def read(
    path: Path,
    side: str = "",
    unit: str = "",
    *,
    boundary: Boundary = "free",
    **more: Any,
) -> Topography:
    """Read a map by the options `--side`, `--unit` and more."""
    return read_map(path, Reading(side=side, unit=unit, **more), boundary)


def rough_map(shape: tuple[int, int] = (96, 96), *, stretch: float = 1.0) -> Field:
    """Return a rough surface with nodes 1 um apart, of rms height 0.5 um and waves of 5 to 16 um.

    A `stretch` other than 1 gives it a lay.
    """
    spectrum = SelfAffineSpectrum(0.8, 16.0, 5.0, stretch)
    sides = (float(shape[0]), float(shape[1]))
    random = np.random.default_rng(1)
    return generate_spectral(shape, sides, spectrum, random, rms_height=0.5)


def rough_heights(seed: int = 0, nodes: int = 80, cut_off: float = 4.0) -> Field:
    """Return heights of a rough surface with nodes 1 um apart, of rms height 0.3 um [um]."""
    spectrum = SelfAffineSpectrum(0.8, nodes / 4, cut_off)
    random = np.random.default_rng(seed)
    sides = (float(nodes), float(nodes))
    return generate_spectral((nodes, nodes), sides, spectrum, random, rms_height=0.3)


def warnings_of(heights: Field, settings: Reading | None = None) -> list[str]:
    """Return the warnings about heights [um] with nodes 1 um apart, after a preparation."""
    sides = (heights.shape[0] - 1.0, heights.shape[1] - 1.0)
    topography = Topography("map", heights, sides)
    return surface_warnings(prepare(topography, settings or Reading()))
