"""Rough surfaces: random waves with a shortest one, the same on any grid, and random walks."""

from collections.abc import Callable

import numpy as np

from bem.arrays import Field


def random_waves(longest: int, shortest: int, hurst: float, seed: int) -> Callable[..., Field]:
    """Return heights of a self-affine surface, of slope 0.1 on a side of one, by the grid's shape.

    Parameters
    ----------
    longest, shortest : int
        Periods per side of its longest and its shortest waves.
    hurst : float
        Its Hurst exponent.
    seed : int
        Seed of its phases.
    """
    random = np.random.default_rng(seed)
    k = np.arange(-shortest, shortest + 1)
    size = np.hypot(k[:, None], k)
    inside = (size >= longest) & (size <= shortest)
    amplitude = np.where(inside, np.where(size == 0, 1, size) ** -(hurst + 1.0), 0)
    waves = amplitude * np.exp(2j * np.pi * random.random(size.shape))
    slope = np.pi * np.sqrt(np.sum((size * np.abs(waves + np.conj(waves[::-1, ::-1]))) ** 2))
    waves *= 0.1 / slope

    def heights(rows: int, columns: int | None = None) -> Field:
        shape = rows, columns or rows
        spectrum = np.zeros(shape, complex)
        np.add.at(spectrum, (k[:, None] % shape[0], k % shape[1]), waves)
        surface: Field = np.fft.ifft2(spectrum).real * spectrum.size
        return surface

    return heights


def random_walk(shape: tuple[int, int], seed: int) -> Field:
    """Return heights of a random walk with some noise, whose range is 10."""
    random = np.random.default_rng(seed)
    walk = np.cumsum(np.cumsum(random.standard_normal(shape), axis=0), axis=1)
    walk += random.standard_normal(shape)
    heights: Field = 10 * walk / np.ptp(walk)
    return heights
