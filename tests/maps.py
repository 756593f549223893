"""Maps that repeat themselves, and maps read as a command does, whose messages name options."""

from pathlib import Path
from typing import Any

import numpy as np

from bem.arrays import Field
from bem.problem import Boundary
from gen.maps.read import Topography
from gen.maps.read import read as read_map
from gen.maps.settings import Reading


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
