"""Rough surfaces: two kinds of random midpoint displacement."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from gen.arrays import Heights, refuse_masked
from gen.runtime.errors import InputError

Generator = Callable[[int, float, float, np.random.Generator], Heights]


def generate(
    generator: str, nodes: int, hurst: float, sigma0: float, random: np.random.Generator
) -> Heights:
    """Generate a random self-affine surface.

    Parameters
    ----------
    generator : str
        One of the names in `GENERATORS`.
    nodes : int
        Nodes a side: 2^k + 1 with k of 1 or more.
    hurst : float
        Hurst exponent, from 0 to 1.
    sigma0 : float
        Standard deviation of the first displacement [um].
    random : numpy.random.Generator
        Source of the displacements. The same seed gives the same coarse nodes for every number of
        nodes, apart from the shift of the lowest node to 0.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights above the lowest node [um].

    Raises
    ------
    InputError
        If the generator, the number of nodes or the Hurst exponent is not allowed, or sigma0 is
        negative or so large that heights exceed the largest number.

    References
    ----------
    Section 2.2 (sec_rmd) of the paper; the definitions stand at each generator.
    """
    if generator not in GENERATORS:
        raise InputError(f"generator {generator!r}: give one of {', '.join(GENERATORS)}")
    if nodes < 3 or (nodes - 1) & (nodes - 2):
        raise InputError(f"nodes {nodes}: give 2^k + 1, as 3, 5, 9, ..., 129, 257")
    if not 0.0 <= hurst <= 1.0:
        raise InputError(f"hurst {hurst}: give a Hurst exponent from 0 to 1")
    if not 0.0 <= sigma0 < math.inf:
        raise InputError(f"sigma0 {sigma0}: give a standard deviation of 0 um or more")
    with np.errstate(over="ignore", invalid="ignore"):
        heights = GENERATORS[generator](nodes, hurst, sigma0, random)
        heights -= heights.min()
    if not math.isfinite(heights.max()):
        raise InputError(f"sigma0 {sigma0:g}: its heights are beyond what numbers hold; give less")
    return heights


def without_last_nodes(heights: Heights) -> Heights:
    """Leave out the last row and column, for a patch without edges.

    The generators make 2^k + 1 nodes a side, where 2^k cells suit transforms better: 257 is a prime
    number. FFTW takes 11 times as long for the Fourier transform of 257 x 257 numbers as for
    256 x 256, 4 times for the cosine transform; a contact takes 3.0 times as long on a periodic
    patch and 2.4 times on a mirrored one.

    Parameters
    ----------
    heights : ndarray, shape (n + 1, n + 1)
        Heights of a generated surface [um].

    Returns
    -------
    ndarray, shape (n, n)
        Heights above the lowest of these nodes [um].

    Raises
    ------
    InputError
        If heights are masked in places.
    """
    refuse_masked("heights", heights)
    cells = heights[:-1, :-1]
    return np.ascontiguousarray(cells - cells.min())


def diamond_square(nodes: int, hurst: float, sigma0: float, random: np.random.Generator) -> Heights:
    """Displace centres and then edges, level by level: MIRCO's generator, and the default.

    The centre of a square is the mean of its 4 corners + N(0, a^2); then the midpoint of an edge
    is the mean of its 4 neighbours, 3 at the border, + N(0, a^2). The amplitude a starts at
    `sigma0` and is divided by 2^(hurst / 2) after each of the two steps. The statistics of the
    surfaces are those of the paper's Table 1.

    Parameters
    ----------
    nodes : int
        Number of nodes along both axes, 2^k + 1.
    hurst : float
        Hurst exponent, from 0 to 1.
    sigma0 : float
        Standard deviation of the first displacement [um].
    random : numpy.random.Generator
        Source of the displacements.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights, not checked, with the corners at 0 [um].
    """
    heights = np.zeros((2, 2))
    amplitude, decay = sigma0, 2.0 ** (-hurst / 2.0)
    while len(heights) < nodes:
        centres = _displaced(_centre_means(heights), amplitude, random)
        amplitude *= decay
        edges_x = _displaced(_edge_means(heights, centres), amplitude, random)
        edges_y = _displaced(_edge_means(heights.T, centres.T).T, amplitude, random)
        amplitude *= decay
        heights = _refined(heights, centres, edges_x, edges_y)
    return heights


def midpoint(nodes: int, hurst: float, sigma0: float, random: np.random.Generator) -> Heights:
    """Displace centres and edges together, level by level, as the paper's text describes it.

    The centre of a square is the mean of its 4 corners and the midpoint of an edge the mean of its
    2 corners, both + N(0, s^2) with s = sigma0 2^(-hurst level); the first level is 0.

    Parameters
    ----------
    nodes : int
        Number of nodes along both axes, 2^k + 1.
    hurst : float
        Hurst exponent, from 0 to 1.
    sigma0 : float
        Standard deviation of the first displacement [um].
    random : numpy.random.Generator
        Source of the displacements.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights, not checked, with the corners at 0 [um].

    References
    ----------
    Section 2.2 (sec_rmd) of the paper.
    """
    heights = np.zeros((2, 2))
    amplitude, decay = sigma0, 2.0**-hurst
    while len(heights) < nodes:
        centres = _displaced(_centre_means(heights), amplitude, random)
        edges_x = _displaced(0.5 * (heights[:-1] + heights[1:]), amplitude, random)
        edges_y = _displaced(0.5 * (heights[:, :-1] + heights[:, 1:]), amplitude, random)
        amplitude *= decay
        heights = _refined(heights, centres, edges_x, edges_y)
    return heights


GENERATORS: Mapping[str, Generator] = MappingProxyType(
    {"diamond-square": diamond_square, "midpoint": midpoint}
)
"""Generators by the names that scenes use."""


def _centre_means(corners: Heights) -> Heights:
    """Average the 4 corners of each square: heights (m + 1, m + 1) give means (m, m)."""
    pairs = corners[:-1] + corners[1:]
    return 0.25 * (pairs[:, :-1] + pairs[:, 1:])


def _edge_means(corners: Heights, centres: Heights) -> Heights:
    """Average the 2 corners and the 1 or 2 centres around the midpoint of each edge along axis 0.

    Corners (m + 1, m + 1) and centres (m, m) give means (m, m + 1).
    """
    means = corners[:-1] + corners[1:]
    means[:, 1:] += centres
    means[:, :-1] += centres
    means[:, 1:-1] *= 0.25
    means[:, :: len(centres)] /= 3.0  # the border's two columns
    return means


def _displaced(means: Heights, amplitude: float, random: np.random.Generator) -> Heights:
    """Add independent normal numbers of standard deviation `amplitude` to the means."""
    displacements = random.standard_normal(means.shape)
    displacements *= amplitude
    displacements += means
    return displacements


def _refined(corners: Heights, centres: Heights, edges_x: Heights, edges_y: Heights) -> Heights:
    """Join the nodes, centres and edges of one level into a surface of half the spacing."""
    nodes = 2 * len(centres) + 1
    heights = np.empty((nodes, nodes))
    heights[::2, ::2] = corners
    heights[1::2, 1::2] = centres
    heights[1::2, ::2] = edges_x
    heights[::2, 1::2] = edges_y
    return heights
