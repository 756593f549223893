"""Rough surfaces: two kinds of random midpoint displacement, and heights from files."""

import math
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gen.measured import text
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file

Heights = NDArray[np.float64]
Generator = Callable[[int, float, float, np.random.Generator], Heights]

CONTROL_CHARACTERS = bytes({*range(32)} - {*b"\t\n\v\f\r"})
"""Bytes that no text has."""


def generate(
    generator: str, nodes: int, hurst: float, sigma0: float, random: np.random.Generator
) -> Heights:
    """Random self-affine surface above its lowest node.

    Parameters
    ----------
    generator : a name of `GENERATORS`
    nodes : nodes a side, 2^k + 1 with k of 1 or more
    hurst : Hurst exponent, 0 to 1
    sigma0 : standard deviation of the first displacement [um]
    random : source of the displacements; the same seed gives the same coarse nodes, up to the
        lowest height, for every number of nodes

    Returns
    -------
    (nodes, nodes) heights, the lowest 0 [um]

    Raises
    ------
    InputError : another generator, number of nodes or Hurst exponent, a sigma0 that is negative or
        whose heights no number holds

    Source: section 2.2 (sec_rmd) of the paper; the definitions stand at each generator.
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


def diamond_square(nodes: int, hurst: float, sigma0: float, random: np.random.Generator) -> Heights:
    """Displacement in two steps a level, centres then edges: MIRCO's, and the default.

    The centre of a square is the mean of its 4 corners + N(0, a^2), then the midpoint of an edge
    is the mean of its 4 neighbours, 3 at the border, + N(0, a^2). a starts at `sigma0` and is
    divided by 2^(hurst / 2) after either step.

    Parameters and result as for `generate`, unchecked and with the corners at 0.

    Source: MIRCO's generator; its statistics are those of the paper's Table 1.
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
    """Displacement in one step a level, from corners alone: the paper's text.

    The centre of a square is the mean of its 4 corners and the midpoint of an edge that of its 2,
    both + N(0, s^2) with s = sigma0 2^(-hurst level), the first level being 0.

    Parameters and result as for `generate`, unchecked and with the corners at 0.

    Source: section 2.2 (sec_rmd) of the paper.
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
    """Mean of the 4 corners of each square: (m + 1, m + 1) to (m, m)."""
    pairs = corners[:-1] + corners[1:]
    return 0.25 * (pairs[:, :-1] + pairs[:, 1:])


def _edge_means(corners: Heights, centres: Heights) -> Heights:
    """Mean round the midpoint of each edge along axis 0, of 2 corners and 1 or 2 centres.

    From (m + 1, m + 1) corners and (m, m) centres to (m, m + 1).
    """
    means = corners[:-1] + corners[1:]
    means[:, 1:] += centres
    means[:, :-1] += centres
    means[:, 1:-1] *= 0.25
    means[:, :: len(centres)] /= 3.0  # the border's two columns
    return means


def _displaced(means: Heights, amplitude: float, random: np.random.Generator) -> Heights:
    """Means plus independent normal numbers of standard deviation `amplitude`."""
    displacements = random.standard_normal(means.shape)
    displacements *= amplitude
    displacements += means
    return displacements


def _refined(corners: Heights, centres: Heights, edges_x: Heights, edges_y: Heights) -> Heights:
    """Surface of half the spacing.

    Parameters
    ----------
    corners : (m + 1, m + 1) nodes that stay
    centres : (m, m) of the squares
    edges_x : (m, m + 1) midpoints of the edges along x (axis 0)
    edges_y : (m + 1, m) midpoints of the edges along y (axis 1)

    Returns
    -------
    (2 m + 1, 2 m + 1) heights
    """
    nodes = 2 * len(centres) + 1
    heights = np.empty((nodes, nodes))
    heights[::2, ::2] = corners
    heights[1::2, 1::2] = centres
    heights[1::2, ::2] = edges_x
    heights[::2, 1::2] = edges_y
    return heights


def load(path: Path, *, holes: bool = False) -> Heights:
    """Heights from a file, as they stand there.

    Parameters
    ----------
    path : a .npy file, or text with a row of numbers a line, separated by `;`, commas or
        whitespace (one of them a line, `;` before comma before whitespace), comments after `#`;
        of several matrices under headers, the first
    holes : allow NaN where nothing was measured

    Returns
    -------
    (rows, columns) heights, C-contiguous, not shifted [um]

    Raises
    ------
    InputError : what cannot be read, or is not a 2-D array of 2 x 2 finite numbers or more

    Source: the text format is that of MIRCO's topologies (.dat, a `;` after each number).
    """
    [matrix] = read(path)[:1]
    return checked(matrix.numbers, path, holes=holes)


def read(path: Path) -> list[text.Matrix]:
    """Read the matrices of a .npy or text file, which has more than one where headers say so.

    Raises
    ------
    InputError : for what cannot be read
    """
    require_file(path)
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        fault = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{path}: cannot be read ({fault}); give a .npy or text file") from error
    if path.suffix.lower() == ".npy" or content.startswith(np.lib.format.MAGIC_PREFIX):
        return [text.Matrix(_from_npy(content, path))]
    if any(character in content for character in CONTROL_CHARACTERS):
        raise InputError(f"{path}: is neither .npy nor text; give one of them")
    return text.matrices(content, path)


def checked(heights: Heights, path: Path, *, holes: bool) -> Heights:
    """Return 2-D heights, 2 x 2 or more, finite unless `holes` allows NaN; refuse others."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        shape = " x ".join(str(length) for length in heights.shape) or "a single number"
        found = shape if heights.size else "no heights"
        raise InputError(f"{path}: holds {found}; give 2-D heights, 2 x 2 or more")
    good = ~np.isinf(heights) if holes else np.isfinite(heights)
    bad = heights.size - int(np.count_nonzero(good))
    if bad:
        what = "infinite" if holes else "NaN or infinite"
        raise InputError(f"{path}: {bad} of {heights.size} heights are {what}; give finite")
    return heights


def _from_npy(content: bytes, path: Path) -> Heights:
    """Real numbers of any shape from the bytes of a .npy file; objects are never unpickled."""
    try:
        array = np.lib.format.read_array(BytesIO(content), allow_pickle=False)
    except Exception as error:  # a broken header makes numpy raise nearly anything
        fault = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: not a whole .npy file ({fault}); save real numbers") from error
    if array.dtype.kind not in "iuf":
        raise InputError(f"{path}: holds {array.dtype} values; save real numbers (float64)")
    with np.errstate(over="ignore"):  # wider floats become infinite, and are counted by `load`
        return np.asarray(array, dtype=np.float64, order="C")
