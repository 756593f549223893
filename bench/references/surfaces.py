"""Random surfaces of many kinds, on any grid, to test properties that hold on all surfaces.

Each kind is a function of a random generator, whose state it moves, and of the shape. It returns
heights in any unit.
"""

from collections.abc import Callable

import numpy as np

from bench.references.half_space import Field

Random = np.random.Generator
"""A source of random numbers."""

Shape = tuple[int, int]
"""Nodes along x and y."""

HURST = 0.7
"""Hurst exponent of the self-affine surfaces [1]."""


def self_affine(random: Random, shape: Shape) -> Field:
    """Draw a self-affine surface: random waves whose amplitudes follow a power law.

    The waves are periodic on twice as many nodes a side. The surface is cut out of these, so that
    it is not periodic itself.

    Parameters
    ----------
    random : numpy.random.Generator
        Source of random numbers, whose state moves.
    shape : (int, int)
        Nodes along x and y.

    Returns
    -------
    ndarray, shape `shape`
        Heights.
    """
    rows, columns = shape
    periods = (2 * rows, 2 * columns)
    along = np.fft.fftfreq(2 * rows)[:, None]
    across = np.fft.rfftfreq(2 * columns)
    frequency = np.hypot(along, across)
    frequency[0, 0] = np.inf
    noise = np.fft.rfft2(random.standard_normal(periods))
    amplitudes = noise * frequency ** -(1 + HURST)
    heights = np.fft.irfft2(amplitudes, s=periods)
    return np.asarray(heights[:rows, :columns])


def paraboloid(random: Random, shape: Shape) -> Field:
    """Draw a paraboloid with its tip anywhere on the patch.

    Parameters
    ----------
    random : numpy.random.Generator
        Source of random numbers, whose state moves.
    shape : (int, int)
        Nodes along x and y.

    Returns
    -------
    ndarray, shape `shape`
        Heights.
    """
    rows, columns = shape
    x, y = np.ogrid[:rows, :columns]
    tip_x, tip_y = random.uniform(0, shape)
    along = x - tip_x
    across = y - tip_y
    return np.asarray(-(along**2) - across**2)


def tilted_plane(random: Random, shape: Shape) -> Field:
    """Draw a plane of any slope.

    Parameters
    ----------
    random : numpy.random.Generator
        Source of random numbers, whose state moves.
    shape : (int, int)
        Nodes along x and y.

    Returns
    -------
    ndarray, shape `shape`
        Heights.
    """
    rows, columns = shape
    x, y = np.ogrid[:rows, :columns]
    slope_x, slope_y = random.standard_normal(2)
    return np.asarray(slope_x * x + slope_y * y)


def waves(random: Random, shape: Shape) -> Field:
    """Draw the sum of a wave along x and one along y, each of which may be missing.

    The surface is flat if both are missing. The shortest waves have two nodes.

    Parameters
    ----------
    random : numpy.random.Generator
        Source of random numbers, whose state moves.
    shape : (int, int)
        Nodes along x and y.

    Returns
    -------
    ndarray, shape `shape`
        Heights.
    """
    # An axis has a wave or none, with equal probability.
    rows, columns = shape
    angles = random.uniform(0, np.pi, 2)
    along, across = angles * random.integers(0, 2, 2)
    x, y = np.ogrid[:rows, :columns]
    waves_x = np.cos(along * x)
    waves_y = np.cos(across * y)
    return np.asarray(waves_x + waves_y)


def spikes(random: Random, shape: Shape) -> Field:
    """Draw a plane from which about one node in ten rises to a random height.

    Parameters
    ----------
    random : numpy.random.Generator
        Source of random numbers, whose state moves.
    shape : (int, int)
        Nodes along x and y.

    Returns
    -------
    ndarray, shape `shape`
        Heights from 0 to 1.
    """
    is_spike = random.random(shape) < 0.1
    heights = random.random(shape)
    return np.where(is_spike, heights, 0.0)


def plateaus(random: Random, shape: Shape) -> Field:
    """Draw plateaus of two heights, whose borders are straight and along the axes.

    Parameters
    ----------
    random : numpy.random.Generator
        Source of random numbers, whose state moves.
    shape : (int, int)
        Nodes along x and y.

    Returns
    -------
    ndarray, shape `shape`
        Heights of 0 and 1.
    """
    # Along each axis the height changes at three nodes in ten.
    changes_x = random.random(shape[0]) < 0.3
    changes_y = random.random(shape[1]) < 0.3
    rows = np.cumsum(changes_x) % 2
    columns = np.cumsum(changes_y) % 2
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
"""Function that draws a surface of each kind, by the name of the kind."""


def surface(kind: str, shape: Shape, seed: int = 0) -> Field:
    """Draw a surface of a kind.

    Parameters
    ----------
    kind : str
        Name of the kind in `SURFACES`.
    shape : (int, int)
        Nodes along x and y.
    seed : int
        Seed of the surface.

    Returns
    -------
    ndarray, shape `shape`
        Heights with a range of 1, or of 0 if the surface is flat.
    """
    heights = SURFACES[kind](np.random.default_rng(seed), shape)
    return heights / (np.ptp(heights) or 1.0)
