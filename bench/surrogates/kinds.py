"""Kinds of surfaces that judge the intervals and flags of surrogates, and train none of them.

Each kind is a function for the generator "python" of a scene. It takes the shape of the surface,
the spacing along x and y [um] and a random generator, from which it draws the parameters of the
kind; it returns the heights [um].

The surfaces of a seed depend on the order in which a function draws its numbers. In this file "the
side" is the length of the patch, and x and y over the side run from 0 to 1. `stepped`, `patchy`,
`brushed` and `holed` change a surface of the paper preset, whose heights are in um. Every other
function scales its heights to a drawn rms height at its end; until then, they have no unit.
"""

from functools import partial

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.special import log_ndtr

from bench.made_maps import Kind, MadeMap, surface
from gen.arrays import Heights
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.surface import generate

NAMES = (
    "turned",
    "ground",
    "honed",
    "sandblasted",
    "one_to_five",
    "one_to_ten",
    "sine",
    "egg_box",
    "lognormal",
    "pitted",
    "bumps",
    "spheres",
    "worn",
    "two_scales",
    "grains",
    "scratched",
    "stepped",
    "patchy",
    "brushed",
    "holed",
    "weibull",
    "truncated",
    "liner",
    "pores",
)
"""Names of the kinds, which are the names of their functions."""

Shape = tuple[int, int]
"""Nodes along x and along y."""

Spacing = tuple[float, float]
"""Distance between neighbouring nodes along x and along y [um]."""

HEXAGONAL = 0.866
"""Distance of neighbouring rows of a hexagonal packing over that of neighbouring spheres:
sqrt(3)/2 [1]."""


def _self_affine(
    shape: Shape,
    spacing: Spacing,
    rng: np.random.Generator,
    *,
    longest: float = 0.5,
    stretch: float = 1.0,
    hurst: float | None = None,
) -> Heights:
    """Make a window of a self-affine surface with a mean of 0 and an rms height of 1.

    The window is cut from a periodic surface of twice its length, so that its edges do not match.
    `longest` is the roll-off wavelength along x over the side. `stretch` is the ratio of
    wavelengths along x to wavelengths along y. The Hurst exponent is drawn from 0.5 to 0.9 if
    `hurst` is None.
    """
    larger = (2 * shape[0], 2 * shape[1])
    sides = (larger[0] * spacing[0], larger[1] * spacing[1])
    cut_off = 2.1 * max(spacing)
    roll_off = max(longest * shape[0] * spacing[0], 1.2 * cut_off)
    # Drawn in any case, so that later draws are the same with and without a given exponent.
    drawn_hurst = rng.uniform(0.5, 0.9)
    if hurst is None:
        hurst = drawn_hurst
    spectrum = SelfAffineSpectrum(hurst, roll_off / stretch, cut_off / stretch, stretch)
    heights = generate_spectral(larger, sides, spectrum, rng, rms_height=1.0)
    return _scaled(heights[: shape[0], : shape[1]])


def _scaled(heights: Heights) -> Heights:
    """Shift and scale heights to a mean of 0 and an rms of 1."""
    return np.asarray((heights - heights.mean()) / heights.std())


def _sized(heights: Heights, rng: np.random.Generator) -> Heights:
    """Shift heights to a mean of 0, and scale them to a drawn rms height.

    It is log-uniform from 2 to 12 um.
    """
    rms_height = np.exp(rng.uniform(np.log(2.0), np.log(12.0)))
    return np.asarray(_scaled(heights) * rms_height)


def _axes(shape: Shape) -> tuple[Heights, Heights]:
    """Return x, (nx, 1), and y, (1, ny), of the nodes over the side, 0 to 1."""
    x = np.linspace(0, 1, shape[0])
    y = np.linspace(0, 1, shape[1])
    return x[:, None], y[None, :]


def _across(x: Heights, y: Heights, angle: float, rng: np.random.Generator) -> Heights:
    """Return the signed distances of all nodes from a straight line, (nx, ny) [side].

    `x`, (nx, 1), and `y`, (1, ny), are the results of `_axes`. The line goes through a drawn point.
    `angle` is the angle from x towards y of the line's normal [rad].
    """
    along_x = (x - rng.uniform()) * np.cos(angle)
    along_y = (y - rng.uniform()) * np.sin(angle)
    return np.asarray(along_x + along_y)


def _made(
    kind: Kind, shape: Shape, spacing: Spacing, rng: np.random.Generator
) -> Heights:
    """Make a map of `bench.made_maps` [um], with a drawn length of its roughness."""
    seed = int(rng.integers(2**31))
    length = shape[0] * rng.uniform(0.12, 0.4)  # 0.12 to 0.4 of the side [nodes]
    made_map = MadeMap(kind, seed, shape, rms=1.0, length=length)
    return _sized(surface(made_map), rng)


# These names are the generators that scenes name; their functions take the remaining arguments.
turned = partial(_made, "turned")
ground = partial(_made, "ground")
honed = partial(_made, "honed")
sandblasted = partial(_made, "sandblasted")


def _long(
    largest: float,
    stretch: float,
    shape: Shape,
    spacing: Spacing,
    rng: np.random.Generator,
) -> Heights:
    """Make a self-affine surface [um] whose waves are longer along y than along x.

    The roll-off wavelength along x over the side is drawn from 0.1 to `largest`. `stretch` is the
    ratio of wavelengths along x to wavelengths along y, below 1.
    """
    longest = rng.uniform(0.1, largest)
    waves = _self_affine(shape, spacing, rng, longest=longest, stretch=stretch)
    return _sized(waves, rng)


one_to_five = partial(_long, 0.4, 0.2)
one_to_ten = partial(_long, 0.2, 0.1)


def _exponential(
    sign: int, shape: Shape, spacing: Spacing, rng: np.random.Generator
) -> Heights:
    """Make the exponential of a self-affine surface [um]: peaks with sign 1, pits with sign -1."""
    strength = rng.uniform(0.3, 1.0)
    heights = np.exp(strength * _self_affine(shape, spacing, rng))
    return _sized(sign * heights, rng)


lognormal = partial(_exponential, 1)
pitted = partial(_exponential, -1)


def sine(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a sine wave of random direction, with self-affine noise of 0.1 to 0.4 of its rms height.

    Parameters
    ----------
    shape : pair of int
        Nodes along x and along y.
    spacing : pair of float
        Distance between neighbouring nodes along x and along y [um].
    rng : Generator
        Source of the random numbers.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    x, y = _axes(shape)
    angle = rng.uniform(0, np.pi)
    waves = rng.uniform(3, 10)
    along = waves * (x * np.cos(angle) + y * np.sin(angle))
    phase = 2 * np.pi * (along + rng.uniform())
    wave = np.sqrt(2) * np.sin(phase)  # rms height of 1, like the noise
    noise = _self_affine(shape, spacing, rng)
    return _sized(wave + rng.uniform(0.1, 0.4) * noise, rng)


def egg_box(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make the sum of a sine wave along x and one along y, with very little white noise.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    x, y = _axes(shape)
    waves = rng.uniform(2, 8, 2)  # numbers of waves along x and y
    along_x = np.sin(2 * np.pi * (waves[0] * x + rng.uniform()))
    along_y = np.sin(2 * np.pi * (waves[1] * y + rng.uniform()))
    return _sized(along_x + along_y + 0.03 * rng.normal(size=shape), rng)


def bumps(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make paraboloids of random places, radii and heights on fine white noise.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    x, y = _axes(shape)
    heights = 0.02 * rng.normal(size=shape)
    for _ in range(int(rng.integers(20, 120))):
        centre = rng.uniform(size=2)
        radius = rng.uniform(0.04, 0.15)
        height = rng.uniform(0.5, 1.0)
        squared = (x - centre[0]) ** 2 + (y - centre[1]) ** 2
        heights = np.maximum(heights, height * (1 - squared / radius**2))
    return _sized(heights, rng)


def spheres(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a hexagonal packing of the upper halves of spheres, whose heights differ a little.

    The floor between them is half a pitch below their mean centres.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    x, y = _axes(shape)
    pitch = 1 / rng.uniform(4, 10)  # diameter of the spheres over the side
    shift = rng.uniform(0, pitch, 2)
    floor = -pitch / 2
    heights = np.full(shape, floor)
    # The packing extends beyond the surface on all sides.
    for row in range(-1, int(1 / (pitch * HEXAGONAL)) + 2):
        for column in range(-1, int(1 / pitch) + 2):
            centre_x = shift[0] + (column + 0.5 * (row % 2)) * pitch
            centre_y = shift[1] + row * HEXAGONAL * pitch
            # Square of the height above the centre; negative beside the sphere.
            squared = (pitch / 2) ** 2 - (x - centre_x) ** 2 - (y - centre_y) ** 2
            top = np.sqrt(np.maximum(squared, 0.0)) + 0.05 * pitch * rng.normal()
            heights = np.maximum(heights, np.where(squared > 0, top, floor))
    return _sized(heights, rng)


def worn(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a self-affine surface whose highest parts are worn to a nearly flat plateau.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    heights = _self_affine(shape, spacing, rng)
    level = np.quantile(heights, rng.uniform(0.4, 0.9))
    plateau = level + 0.05 * _self_affine(shape, spacing, rng)
    return _sized(np.minimum(heights, plateau), rng)


def two_scales(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make long waves and a fine roughness, without wavelengths between them.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    coarse = _self_affine(shape, spacing, rng, longest=1.0, hurst=1.0)
    fine = _self_affine(shape, spacing, rng, longest=0.06, hurst=0.8)
    return _sized(coarse + rng.uniform(0.1, 0.6) * fine, rng)


def grains(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make grains, each a flat and tilted facet at a random level, with very little white noise.

    The grains are the Voronoi cells of random centres.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    x, y = _axes(shape)
    number = int(rng.integers(20, 150))
    centres = rng.uniform(size=(number, 2))
    squares = (x[..., None] - centres[:, 0]) ** 2 + (y[..., None] - centres[:, 1]) ** 2
    grain = squares.argmin(axis=-1)  # number of the grain of each node
    tilts = rng.normal(0, 3.0, (number, 2))
    along_x = tilts[grain, 0] * (x - centres[grain, 0])
    along_y = tilts[grain, 1] * (y - centres[grain, 1])
    levels = rng.normal(size=number)[grain]
    noise = 0.02 * rng.normal(size=shape)
    return _sized(levels + (along_x + along_y) + noise, rng)


def scratched(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a self-affine surface with straight scratches of random directions, depths and widths.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    x, y = _axes(shape)
    heights = _self_affine(shape, spacing, rng)
    for _ in range(int(rng.integers(5, 30))):
        across = _across(x, y, rng.uniform(0, np.pi), rng)
        depth = rng.uniform(0.5, 2.0)  # over the rms height of the surface
        width = rng.uniform(0.01, 0.04)  # over the side
        heights = heights - depth * np.exp(-((across / width) ** 2))
    return _sized(heights, rng)


def weibull(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make heights of a Weibull distribution, skewed upwards or downwards at random.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    # Minus the logarithm of the normal distribution function is exponentially distributed; a power
    # of it has a Weibull distribution.
    exponential = -log_ndtr(_self_affine(shape, spacing, rng))
    heights = exponential ** (1 / rng.uniform(1.0, 3.0))
    sign = rng.choice([-1.0, 1.0])
    return _sized(sign * heights, rng)


def truncated(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a self-affine surface whose peaks are cut off, with very little white noise.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    heights = _self_affine(shape, spacing, rng)
    cut = np.minimum(heights, np.quantile(heights, rng.uniform(0.6, 0.98)))
    return _sized(cut + 0.01 * rng.normal(size=shape), rng)


def liner(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a slightly worn self-affine surface, with crossing scratches like a cylinder liner's.

    Every fourth scratch is wide, the others are narrow.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    x, y = _axes(shape)
    heights = _self_affine(shape, spacing, rng)
    angle = rng.uniform(0.3, 1.2)  # of the normals of the scratches from x [rad]
    # Wear makes the heights above the mean smaller.
    heights = np.where(heights > 0, rng.uniform(0.3, 1.0) * heights, heights)
    for number in range(int(rng.integers(8, 40))):
        # Successive scratches cross: their angles have opposite signs.
        across = _across(x, y, angle * (-1) ** number, rng)
        if number % 4 == 0:
            width = rng.uniform(0.03, 0.06)  # over the side
            depth = rng.uniform(
                0.2, 2.0
            )  # over the rms height of the self-affine surface
        else:
            width = rng.uniform(0.008, 0.015)
            depth = rng.uniform(0.2, 1.0)
        heights = heights - depth * np.exp(-((across / width) ** 2))
    return _sized(heights, rng)


def pores(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a self-affine surface with round pores of random places, radii and depths.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    x, y = _axes(shape)
    heights = _self_affine(shape, spacing, rng)
    for _ in range(int(rng.integers(5, 60))):
        centre = rng.uniform(size=2)
        radius = rng.uniform(0.01, 0.05)  # over the side
        squared = ((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / radius**2
        depth = rng.uniform(0.5, 3.0)  # over the rms height of the self-affine surface
        heights = heights - depth * np.maximum(1 - squared, 0.0)
    return _sized(heights, rng)


def _midpoint(shape: Shape, rng: np.random.Generator) -> Heights:
    """Make a surface like those of the paper preset [um]."""
    hurst = rng.uniform(0.5, 0.8)
    sigma0 = rng.uniform(10, 15)
    return generate("diamond-square", shape[0], hurst, sigma0, rng)


def stepped(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a surface of the paper preset with a step along a straight line.

    Parameters
    ----------
    shape, spacing, rng
        As in `sine`; the shape is square, with 2^k + 1 nodes a side.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    heights = _midpoint(shape, rng)
    x, y = _axes(shape)
    angle = rng.uniform(0, 2 * np.pi)
    across = (x - rng.uniform(0.2, 0.8)) * np.cos(angle) + (y - 0.5) * np.sin(angle)
    step = rng.uniform(0.1, 1.5) * heights.std()
    return np.asarray(heights + step * (across > 0))


def patchy(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a surface of the paper preset whose roughness varies over the patch.

    Parameters
    ----------
    shape, spacing, rng
        As in `stepped`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    heights = _midpoint(shape, rng)
    x, y = _axes(shape)
    along_x = np.sin(2 * np.pi * (x + rng.uniform()))
    along_y = np.sin(2 * np.pi * (y + rng.uniform()))
    factor = np.exp(rng.uniform(0.1, 1.0) * (along_x * along_y))
    return np.asarray(heights * factor)


def brushed(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a surface of the paper preset, mixed with its running mean over five nodes along x.

    Parameters
    ----------
    shape, spacing, rng
        As in `stepped`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    heights = _midpoint(shape, rng)
    weight = rng.uniform(0.1, 1.0)
    smooth = uniform_filter1d(heights, 5, axis=0)
    return np.asarray((1 - weight) * heights + weight * smooth)


def holed(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Make a surface of the paper preset with deep holes of one node each.

    Parameters
    ----------
    shape, spacing, rng
        As in `stepped`.

    Returns
    -------
    ndarray
        Heights [um] of this shape.
    """
    heights = _midpoint(shape, rng)
    is_hole = rng.uniform(size=shape) < rng.uniform(0.001, 0.02)
    depth = rng.uniform(1, 4) * heights.std()
    return np.asarray(np.where(is_hole, heights - depth, heights))
