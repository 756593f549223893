"""Random surfaces of every kind, on any grid, for properties that hold on all of them."""

from collections.abc import Callable

import numpy as np

from bench.references.half_space import Field

Random = np.random.Generator
Shape = tuple[int, int]


def self_affine(random: Random, shape: Shape) -> Field:
    """Random phases under a power law, Hurst exponent 0.7; periodic, so cut from a larger one."""
    periods = 2 * shape[0], 2 * shape[1]
    frequency = np.hypot(np.fft.fftfreq(periods[0])[:, None], np.fft.rfftfreq(periods[1]))
    frequency[0, 0] = np.inf
    noise = np.fft.rfft2(random.standard_normal(periods))
    heights = np.fft.irfft2(noise * frequency ** -(1 + 0.7), s=periods)
    return np.asarray(heights[: shape[0], : shape[1]])


def paraboloid(random: Random, shape: Shape) -> Field:
    """A body of revolution, its tip anywhere on the patch."""
    (x, y), tip = np.ogrid[: shape[0], : shape[1]], random.uniform(0, shape)
    return np.asarray(-((x - tip[0]) ** 2) - (y - tip[1]) ** 2)


def tilted_plane(random: Random, shape: Shape) -> Field:
    """A plane of any slope."""
    (x, y), slope = np.ogrid[: shape[0], : shape[1]], random.standard_normal(2)
    return np.asarray(slope[0] * x + slope[1] * y)


def waves(random: Random, shape: Shape) -> Field:
    """Crossed or parallel ridges, down to two nodes a wave."""
    along, across = random.uniform(0, np.pi, 2) * random.integers(0, 2, 2)
    x, y = np.ogrid[: shape[0], : shape[1]]
    return np.asarray(np.cos(along * x) + np.cos(across * y))


def spikes(random: Random, shape: Shape) -> Field:
    """A few nodes of various heights on a plain."""
    return np.where(random.random(shape) < 0.1, random.random(shape), 0.0)


def plateaus(random: Random, shape: Shape) -> Field:
    """Two heights with straight borders and corners."""
    rows, columns = (np.cumsum(random.random(nodes) < 0.3) % 2 for nodes in shape)
    return (rows[:, None] ^ columns).astype(float)


SURFACES: dict[str, Callable[[Random, Shape], Field]] = {
    "white noise": Random.standard_normal,
    "integer ties": lambda random, shape: random.integers(0, 4, shape).astype(float),
    "one height": lambda random, shape: np.full(shape, random.standard_normal()),
    "random walk": lambda random, shape: (
        random.standard_normal(shape).cumsum(0).cumsum(1)
    ),
    "self-affine": self_affine,
    "paraboloid": paraboloid,
    "tilted plane": tilted_plane,
    "waves": waves,
    "spikes": spikes,
    "pits": lambda random, shape: -spikes(random, shape),
    "plateaus": plateaus,
}


def surface(kind: str, shape: Shape, seed: int = 0) -> Field:
    """(nx, ny) heights with a range of 1, or of 0 where the kind has none."""
    heights = SURFACES[kind](np.random.default_rng(seed), shape)
    return heights / (np.ptp(heights) or 1.0)
