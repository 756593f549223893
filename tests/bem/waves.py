"""Rough surfaces: random waves with a shortest one, the same on any grid."""

from collections.abc import Callable

import numpy as np

from bem.arrays import Field
from bench import resolution


def random_waves(
    longest: int, shortest: int, hurst: float, seed: int
) -> Callable[[int], Field]:
    """Return heights of those of `resolution`, of slope 0.1 on a side of one, by nodes a side."""
    surface = resolution.random_waves(
        longest, shortest, hurst, np.random.default_rng(seed)
    )
    return lambda nodes: surface(np.arange(nodes) / nodes)
