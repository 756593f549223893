"""Kinds of surfaces by which intervals and flags are judged: none of them trains a surrogate.

Each is a function for the scene's generator "python". Its numbers are drawn with the surface.
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
    *(
        "turned",
        "ground",
        "honed",
        "sandblasted",
        "one_to_five",
        "one_to_ten",
        "sine",
        "egg_box",
    ),
    *(
        "lognormal",
        "pitted",
        "bumps",
        "spheres",
        "worn",
        "two_scales",
        "grains",
        "scratched",
    ),
    *("stepped", "patchy", "brushed", "holed", "weibull", "truncated", "liner", "pores"),
)

Shape = tuple[int, int]
Spacing = tuple[float, float]


def _self_affine(
    shape: Shape,
    spacing: Spacing,
    rng: np.random.Generator,
    *,
    longest: float = 0.5,
    **given: float,
) -> Heights:
    """Make a window of a self-affine surface, rms 1; `longest` is the roll-off over the side."""
    larger = 2 * shape[0], 2 * shape[1]
    sides = larger[0] * spacing[0], larger[1] * spacing[1]
    stretch, cut_off = given.get("stretch", 1.0), 2.1 * max(spacing)
    roll_off = max(longest * shape[0] * spacing[0], 1.2 * cut_off)
    hurst = given.get("hurst", rng.uniform(0.5, 0.9))
    spectrum = SelfAffineSpectrum(hurst, roll_off / stretch, cut_off / stretch, stretch)
    whole = generate_spectral(larger, sides, spectrum, rng, rms_height=1.0)
    return _scaled(whole[: shape[0], : shape[1]])


def _scaled(heights: Heights) -> Heights:
    return np.asarray((heights - heights.mean()) / heights.std())


def _sized(heights: Heights, rng: np.random.Generator) -> Heights:
    """Give the surface an rms height of 2 to 12 um."""
    return np.asarray(_scaled(heights) * np.exp(rng.uniform(np.log(2.0), np.log(12.0))))


def _axes(shape: Shape) -> tuple[Heights, Heights]:
    """Return coordinates over the side, of shapes (nx, 1) and (1, ny)."""
    return np.linspace(0, 1, shape[0])[:, None], np.linspace(0, 1, shape[1])[None, :]


def _made(
    kind: Kind, shape: Shape, spacing: Spacing, rng: np.random.Generator
) -> Heights:
    """Make a map of `bench.made_maps` of this shape."""
    made = MadeMap(
        kind, int(rng.integers(2**31)), shape, 1.0, shape[0] * rng.uniform(0.12, 0.4)
    )
    return _sized(surface(made), rng)


turned, ground = partial(_made, "turned"), partial(_made, "ground")
honed, sandblasted = partial(_made, "honed"), partial(_made, "sandblasted")


def _long(
    most: float, stretch: float, shape: Shape, spacing: Spacing, rng: np.random.Generator
) -> Heights:
    """Make waves that are longer along y than along x."""
    longest = rng.uniform(0.1, most)
    return _sized(
        _self_affine(shape, spacing, rng, longest=longest, stretch=stretch), rng
    )


one_to_five, one_to_ten = partial(_long, 0.4, 0.2), partial(_long, 0.2, 0.1)


def _exponential(
    sign: int, shape: Shape, spacing: Spacing, rng: np.random.Generator
) -> Heights:
    """Make peaks or pits: the exponential of a self-affine surface, or less that."""
    return _sized(
        sign * np.exp(rng.uniform(0.3, 1.0) * _self_affine(shape, spacing, rng)), rng
    )


lognormal, pitted = partial(_exponential, 1), partial(_exponential, -1)


def sine(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A wave along one direction, with self-affine noise of 0.1 to 0.4 of its rms height."""
    (x, y), angle = _axes(shape), rng.uniform(0, np.pi)
    phase = (
        2
        * np.pi
        * (rng.uniform(3, 10) * (x * np.cos(angle) + y * np.sin(angle)) + rng.uniform())
    )
    noise = _self_affine(shape, spacing, rng)
    return _sized(np.sqrt(2) * np.sin(phase) + rng.uniform(0.1, 0.4) * noise, rng)


def egg_box(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Waves along both axes, with very little noise."""
    (x, y), waves = _axes(shape), rng.uniform(2, 8, 2)
    both = np.sin(2 * np.pi * (waves[0] * x + rng.uniform())) + np.sin(
        2 * np.pi * (waves[1] * y + rng.uniform())
    )
    return _sized(both + 0.03 * rng.normal(size=shape), rng)


def bumps(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Paraboloids of random places, radii and heights on a fine noise."""
    (x, y), heights = _axes(shape), 0.02 * rng.normal(size=shape)
    for _ in range(int(rng.integers(20, 120))):
        at, radius, height = (
            rng.uniform(size=2),
            rng.uniform(0.04, 0.15),
            rng.uniform(0.5, 1.0),
        )
        cap = height * (1 - ((x - at[0]) ** 2 + (y - at[1]) ** 2) / radius**2)
        heights = np.maximum(heights, cap)
    return _sized(heights, rng)


def spheres(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A hexagonal packing of spheres whose heights differ a little."""
    (x, y), pitch = _axes(shape), 1 / rng.uniform(4, 10)
    heights, rows = np.full(shape, -pitch), int(1 / (pitch * 0.866)) + 2
    shift = rng.uniform(0, pitch, 2)
    for row in range(-1, rows):
        for column in range(-1, int(1 / pitch) + 2):
            at = (
                shift[0] + (column + 0.5 * (row % 2)) * pitch,
                shift[1] + row * 0.866 * pitch,
            )
            square = (pitch / 2) ** 2 - (x - at[0]) ** 2 - (y - at[1]) ** 2
            top = np.sqrt(np.maximum(square, 0.0)) + 0.05 * pitch * rng.normal()
            heights = np.maximum(heights, np.where(square > 0, top, -pitch / 2))
    return _sized(heights, rng)


def worn(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A self-affine surface whose highest parts are worn to a nearly flat plateau."""
    heights = _self_affine(shape, spacing, rng)
    level = np.quantile(heights, rng.uniform(0.4, 0.9))
    plateau = level + 0.05 * _self_affine(shape, spacing, rng)
    return _sized(np.minimum(heights, plateau), rng)


def two_scales(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Long waves, and a fine roughness with nothing between."""
    coarse = _self_affine(shape, spacing, rng, longest=1.0, hurst=1.0)
    fine = _self_affine(shape, spacing, rng, longest=0.06, hurst=0.8)
    return _sized(coarse + rng.uniform(0.1, 0.6) * fine, rng)


def grains(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Facets of grains, each flat and tilted."""
    (x, y), number = _axes(shape), int(rng.integers(20, 150))
    at = rng.uniform(size=(number, 2))
    squares = (x[..., None] - at[:, 0]) ** 2 + (y[..., None] - at[:, 1]) ** 2
    own = squares.argmin(axis=-1)
    tilts = rng.normal(0, 3.0, (number, 2))
    inside = tilts[own, 0] * (x - at[own, 0]) + tilts[own, 1] * (y - at[own, 1])
    return _sized(
        rng.normal(size=number)[own] + inside + 0.02 * rng.normal(size=shape), rng
    )


def scratched(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A self-affine surface with straight scratches of random directions."""
    (x, y), heights = _axes(shape), _self_affine(shape, spacing, rng)
    for _ in range(int(rng.integers(5, 30))):
        angle = rng.uniform(0, np.pi)
        across = (x - rng.uniform()) * np.cos(angle) + (y - rng.uniform()) * np.sin(angle)
        heights = heights - rng.uniform(0.5, 2.0) * np.exp(
            -((across / rng.uniform(0.01, 0.04)) ** 2)
        )
    return _sized(heights, rng)


def weibull(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """Heights of a Weibull distribution, skewed to either side."""
    drawn = (-log_ndtr(_self_affine(shape, spacing, rng))) ** (1 / rng.uniform(1.0, 3.0))
    return _sized(rng.choice([-1.0, 1.0]) * drawn, rng)


def truncated(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A self-affine surface whose peaks are cut off, with very little noise."""
    heights = _self_affine(shape, spacing, rng)
    cut = np.minimum(heights, np.quantile(heights, rng.uniform(0.6, 0.98)))
    return _sized(cut + 0.01 * rng.normal(size=shape), rng)


def liner(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A self-affine surface, slightly worn, with crossing scratches of two widths."""
    (x, y), heights, angle = (
        _axes(shape),
        _self_affine(shape, spacing, rng),
        rng.uniform(0.3, 1.2),
    )
    heights = np.where(heights > 0, rng.uniform(0.3, 1.0) * heights, heights)
    for number in range(int(rng.integers(8, 40))):
        along, wide = angle * (-1) ** number, number % 4 == 0
        across = (x - rng.uniform()) * np.cos(along) + (y - rng.uniform()) * np.sin(along)
        width = rng.uniform(0.03, 0.06) if wide else rng.uniform(0.008, 0.015)
        heights = heights - rng.uniform(0.2, 2.0 if wide else 1.0) * np.exp(
            -((across / width) ** 2)
        )
    return _sized(heights, rng)


def pores(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A self-affine surface with round pores of random sizes."""
    (x, y), heights = _axes(shape), _self_affine(shape, spacing, rng)
    for _ in range(int(rng.integers(5, 60))):
        at, radius = rng.uniform(size=2), rng.uniform(0.01, 0.05)
        square = ((x - at[0]) ** 2 + (y - at[1]) ** 2) / radius**2
        heights = heights - rng.uniform(0.5, 3.0) * np.maximum(1 - square, 0.0)
    return _sized(heights, rng)


def _midpoint(shape: Shape, rng: np.random.Generator) -> Heights:
    """Make a surface as the paper preset has them: random midpoint displacement."""
    return generate(
        "diamond-square", shape[0], rng.uniform(0.5, 0.8), rng.uniform(10, 15), rng
    )


def stepped(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A surface of the paper preset with a step along a straight line."""
    heights, (x, y), angle = (
        _midpoint(shape, rng),
        _axes(shape),
        rng.uniform(0, 2 * np.pi),
    )
    beyond = (x - rng.uniform(0.2, 0.8)) * np.cos(angle) + (y - 0.5) * np.sin(angle) > 0
    return np.asarray(heights + rng.uniform(0.1, 1.5) * heights.std() * beyond)


def patchy(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A surface of the paper preset whose roughness varies over the patch."""
    heights, (x, y) = _midpoint(shape, rng), _axes(shape)
    wave = np.sin(2 * np.pi * (x + rng.uniform())) * np.sin(
        2 * np.pi * (y + rng.uniform())
    )
    return np.asarray(heights * np.exp(rng.uniform(0.1, 1.0) * wave))


def brushed(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A surface of the paper preset, smoothed along x by means over five nodes."""
    heights, weight = _midpoint(shape, rng), rng.uniform(0.1, 1.0)
    return np.asarray(
        (1 - weight) * heights + weight * uniform_filter1d(heights, 5, axis=0)
    )


def holed(shape: Shape, spacing: Spacing, rng: np.random.Generator) -> Heights:
    """A surface of the paper preset with deep holes of a node each."""
    heights = _midpoint(shape, rng)
    holes = rng.uniform(size=shape) < rng.uniform(0.001, 0.02)
    return np.asarray(
        np.where(holes, heights - rng.uniform(1, 4) * heights.std(), heights)
    )
