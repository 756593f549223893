"""Surfaces of many kinds for the report `accuracy`, each known between the nodes of its map.

A surface is a function of places, so that it can be read on any grid: on the map that a user would
have, and on the finer grid that gives the true answers. Its random numbers have seeds of their own.
The weights of the bars of `bem` were fitted on other seeds.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import gaussian_filter

from bem import HalfSpace, Layered
from bem.problem import Boundary
from bench.made_maps import KINDS as MACHINED
from bench.made_maps import MadeMap
from bench.made_maps import surface as made_surface
from bench.report import remark
from bench.resolution import Surface, random_waves
from gen.arrays import Heights, Values
from gen.maps.bodies import read_surface
from gen.maps.read import files_in
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.surface import generate

NODES = (64, 96, 128, 144)
"""Nodes a side of the maps, from which one number is drawn."""

FEWEST_IN_WAVE = 4.0
"""Fewest nodes in the shortest wave of a map."""

MOST_IN_WAVE = 64.0
"""Most nodes in the shortest wave of a map, before the number of waves is rounded down."""

FEWEST_WAVES = 3
"""Fewest periods of the shortest wave on a side."""

FINER = 4
"""Spacing of a map over that of its exact grid, where the exact grid is not too large."""

CREASES_FINER = 8
"""Spacing of a map with creases over that of its exact grid: its errors fall more slowly."""

FINEST = 576
"""Most nodes a side of an exact grid; such a grid is at least three times as fine as its map."""

MARGIN = 4
"""Nodes of a measured map that are kept outside each border of a window, for interpolation."""

SPIKE = 6.0
"""Bound of spikes in measured maps, as of `--despike` [1]."""

MOST_LAYER_RATIO = 100.0
"""Largest modulus of a layer over that of its base, and of the base over that of the layer [1]."""

LAYER_THICKNESSES = 0.3, 30.0
"""Smallest and largest thickness of a layer [shortest wave]."""

RIGID = 0.15
"""Share of the layers whose base is rigid [1]."""

GAUSSIAN = math.sqrt(math.log(2) / 2) / math.pi
"""Standard deviation of a Gaussian filter over its cut-off wavelength (ISO 16610-61) [1]."""


@dataclass(frozen=True)
class Sample:
    """A surface on a patch whose side along x is the unit of length."""

    boundary: Boundary
    # function of n places along both axes, (n,) [side of the patch], to the heights, (n, n) [side]
    surface: Surface
    nodes: int  # nodes a side of the map that is given
    # Nodes of the map in the shortest wave; 0 at creases, infinite without waves, NaN if not known.
    nodes_in_wave: float
    aspect: float = 1.0  # spacing along y over that along x [1]
    finer: int = FINER  # wanted spacing of the map over that of the exact grid
    has_limit: bool = True  # whether the area has a limit on finer and finer grids
    # Body with a layer of the modulus E* = 1 MPa [side]; None for a half-space of this modulus.
    body: Layered | None = None

    @property
    def exact_nodes(self) -> int:
        """Nodes a side of the exact grid."""
        finer = self.finer
        while finer > 3 and finer * self.nodes > FINEST:
            finer -= 1
        return finer * self.nodes

    def heights(self, nodes: int) -> Heights:
        """Return the heights on a grid whose cells cover the patch.

        Parameters
        ----------
        nodes : int
            Nodes a side.

        Returns
        -------
        ndarray, shape (nodes, nodes)
            Heights [side]. Nodes are at the centres of the cells; on a periodic patch they are at
            the corners.
        """
        return self.surface(places(nodes, self.boundary))


Draw = Callable[[np.random.Generator], Sample]
"""A function that draws a sample of its kind; it moves the state of the random generator."""


def places(nodes: int, boundary: Boundary) -> Values:
    """Return the places of the nodes of a grid along an axis.

    Parameters
    ----------
    nodes : int
        Nodes along the axis.
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch.

    Returns
    -------
    ndarray, shape (nodes,)
        Places [side of the patch]: the corners of cells on a periodic patch, otherwise the centres.
    """
    offset = 0.0 if boundary == "periodic" else 0.5
    return (np.arange(nodes) + offset) / nodes


def mirrored(surface: Surface) -> Surface:
    """Return the sum of a surface of period one and its mirror images, on half of the period.

    Parameters
    ----------
    surface : callable
        The surface.

    Returns
    -------
    callable
        A surface whose continuation by mirror images is smooth.
    """

    def heights(x: Values) -> Heights:
        """Return the heights, (n, n), at n places along both axes."""
        all_quarters = surface(np.concatenate([x / 2, -x / 2]))
        quarters = all_quarters.reshape(2, len(x), 2, len(x))
        return np.asarray(quarters.sum(axis=(0, 2)) / 2)

    return heights


@dataclass(frozen=True)
class _Map:
    """A map of self-affine waves: its nodes, its shortest wave and its Hurst exponent."""

    nodes: int  # nodes a side
    waves: int  # periods of the shortest wave on a side
    hurst: float


def _draw_map(random: np.random.Generator) -> _Map:
    """Draw the nodes of a map, the shortest wave on it and the Hurst exponent.

    The number of nodes in the shortest wave is log-uniform, but at least `FEWEST_WAVES` periods of
    the wave are on a side.
    """
    nodes = int(random.choice(NODES))
    log_nodes = random.uniform(math.log(FEWEST_IN_WAVE), math.log(MOST_IN_WAVE))
    waves = max(int(nodes / math.exp(log_nodes)), FEWEST_WAVES)
    return _Map(nodes=nodes, waves=waves, hurst=random.uniform(0.2, 0.9))


def _draw_boundary(random: np.random.Generator) -> Boundary:
    """Draw one of the three boundaries."""
    boundaries: Sequence[Boundary] = ("free", "periodic", "mirror")
    return boundaries[int(random.integers(len(boundaries)))]


def _rough(
    random: np.random.Generator,
    boundary: Boundary | None = None,
    *,
    aspect: float = 1.0,
) -> Sample:
    """Draw self-affine waves. The boundary is drawn too if it is None.

    A wave along y is `aspect` times as long as the wave of the same amplitude along x. A free patch
    is a window of a longer surface.
    """
    if boundary is None:
        boundary = _draw_boundary(random)
    drawn = _draw_map(random)
    if boundary == "mirror":
        twice = random_waves(2, 2 * drawn.waves, drawn.hurst, random, aspect)
        surface = mirrored(twice)
        return Sample(boundary, surface, drawn.nodes, drawn.nodes / drawn.waves)
    longest = int(random.choice([1, 2]))
    surface = random_waves(longest, drawn.waves, drawn.hurst, random, aspect)
    if boundary == "periodic":
        return Sample(boundary, surface, drawn.nodes, drawn.nodes / drawn.waves)
    width = random.uniform(0.6, 0.9)  # of the window [period]
    first = random.uniform(0, 1)
    window = partial(_window_of, surface, first, width)
    return Sample(boundary, window, drawn.nodes, drawn.nodes / (drawn.waves * width))


def _window_of(surface: Surface, first: float, width: float, x: Values) -> Heights:
    """Return the heights of the window of a surface that begins at a place and has a width."""
    return surface(first + width * x)


def _directional(random: np.random.Generator) -> Sample:
    """Draw waves that are 2 to 6 times longer along one axis."""
    return _rough(random, aspect=random.uniform(2, 6))


def _reshaped(
    random: np.random.Generator, reshape: Callable[[Heights], Heights]
) -> Sample:
    """Draw self-affine waves whose heights a function reshapes.

    `nodes_in_wave` of the sample is that of the surface before it is reshaped.
    """
    base = _rough(random)
    return Sample(
        base.boundary,
        lambda x: reshape(base.surface(x)),
        base.nodes,
        base.nodes_in_wave,
    )


def _lognormal(random: np.random.Generator) -> Sample:
    """Draw a surface with high peaks and shallow valleys: the exponential of waves."""
    scale = random.uniform(0.015, 0.04)  # [side of the patch]
    return _reshaped(random, lambda heights: scale * np.exp(heights / scale))


def _plateaus(random: np.random.Generator) -> Sample:
    """Draw a surface whose peaks are worn off, but not flat: a smooth minimum with a level."""
    base = _rough(random)
    typical = base.heights(128)
    level = float(np.quantile(typical, random.uniform(0.5, 0.85)))
    width = random.uniform(0.2, 0.5) * float(typical.std())

    def worn(x: Values) -> Heights:
        """Return the heights, (n, n), at n places along both axes."""
        below = (level - base.surface(x)) / width
        return np.asarray(level - width * np.logaddexp(0, below))

    return Sample(base.boundary, worn, base.nodes, base.nodes_in_wave)


def _two_scales(random: np.random.Generator) -> Sample:
    """Draw gentle waves with ripples of 6 to 16 nodes a wave, which carry much of the slope."""
    boundary = _draw_boundary(random)
    nodes = int(random.choice(NODES))
    gentle = random_waves(1, 4, 0.8, random)
    if boundary == "mirror":
        gentle = mirrored(random_waves(2, 8, 0.8, random))
    ripples = int(nodes / random.choice([6, 8, 12, 16]))  # periods on a side
    amplitude = random.uniform(0.2, 1) * 0.1 / (2 * np.pi * ripples)

    def heights(x: Values) -> Heights:
        """Return the heights, (n, n), at n places along both axes."""
        line = np.cos(2 * np.pi * ripples * x)
        return np.asarray(gentle(x) + amplitude * np.add.outer(line, line))

    return Sample(boundary, heights, nodes, nodes / ripples)


def _regular(random: np.random.Generator, directions: Sequence[float]) -> Sample:
    """Draw equal waves on a periodic patch, one for each direction [multiple of pi].

    Their wavevectors are the nearest ones that fit on the patch.
    """
    nodes = int(random.choice(NODES))
    number = random.uniform(1, nodes / 10)  # periods on a side
    angle = random.uniform(0, np.pi)
    waves = []  # wavevector [1/side] and phase of each wave
    for direction in directions:
        turned = angle + np.pi * direction
        along = round(number * math.cos(turned))
        across = round(number * math.sin(turned))
        if along == across == 0:
            along = 1
        waves.append((along, across, random.uniform(0, 2 * np.pi)))

    def heights(x: Values) -> Heights:
        """Return the heights, (n, n), at n places along both axes."""
        total = np.zeros((x.size, x.size))
        for along, across, phase in waves:
            turns = np.add.outer(along * x, across * x)
            total += np.cos(2 * np.pi * turns + phase)
        return 0.01 * total

    shortest = 1 / max(math.hypot(along, across) for along, across, _ in waves)
    return Sample("periodic", heights, nodes, nodes * shortest)


def _caps(random: np.random.Generator, most_oblong: float) -> Sample:
    """Draw a paraboloid on a free patch, up to `most_oblong` times as long as it is wide."""
    nodes = int(random.choice(NODES))
    radii = random.uniform(1, 6) * np.ones(2)  # of curvature along x and y [side]
    radii[1] *= random.uniform(1, most_oblong)
    tip = random.uniform(0.4, 0.6, 2)

    def heights(x: Values) -> Heights:
        """Return the heights, (n, n), at n places along both axes."""
        along = (x - tip[0]) ** 2 / radii[0]
        across = (x - tip[1]) ** 2 / radii[1]
        return np.asarray(-np.add.outer(along, across) / 2)

    return Sample("free", heights, nodes, math.inf)


def _bumps(random: np.random.Generator) -> Sample:
    """Draw round bumps of one width and random heights at random places on a free patch."""
    nodes = int(random.choice(NODES))
    width = random.uniform(5, 16) / nodes  # standard deviation of a bump [side]
    number = int(random.integers(5, 60))
    tips = random.uniform(0.05, 0.95, (number, 2))
    tops = 0.1 * width * random.uniform(0.5, 1.5, number)

    def heights(x: Values) -> Heights:
        """Return the heights, (n, n), at n places along both axes."""
        along = np.exp(-(((x[:, None] - tips[:, 0]) / width) ** 2) / 2)
        across = np.exp(-(((x[:, None] - tips[:, 1]) / width) ** 2) / 2)
        return np.asarray((along * tops) @ across.T)

    # A wave whose top has the same curvature as a bump has a wavelength of 2 pi widths.
    return Sample("free", heights, nodes, 2 * np.pi * width * nodes)


def _turned(random: np.random.Generator) -> Sample:
    """Draw grooves along y as a round tool leaves them, with sharp ridges, on gentle waves."""
    nodes = int(random.choice([64, 96]))
    grooves = int(random.choice([2, 3, 4, 6]))
    phase = random.uniform()
    waves = random_waves(1, 4, 0.8, random)
    amplitude = random.uniform(0, 0.3)

    def heights(x: Values) -> Heights:
        """Return the heights, (n, n), at n places along both axes."""
        from_middle = (x * grooves + phase) % 1 - 0.5  # [width of a groove]
        groove = 0.2 / grooves * from_middle**2
        return np.asarray(groove[:, None] + amplitude * waves(x))

    return Sample("periodic", heights, nodes, 0.0, finer=CREASES_FINER)


def _ridges(random: np.random.Generator) -> Sample:
    """Draw straight ridges with flat flanks at an angle to the grid, on gentle waves."""
    nodes = int(random.choice([64, 96]))
    along, across = random.integers(2, 6, 2)  # ridges on each side
    phase = random.uniform()
    waves = random_waves(1, 4, 0.8, random)
    amplitude = random.uniform(0, 0.3)

    def heights(x: Values) -> Heights:
        """Return the heights, (n, n), at n places along both axes."""
        turns = np.add.outer(x * along, x * across) + phase
        return np.asarray(-0.1 / along * np.abs(turns % 1 - 0.5) + amplitude * waves(x))

    return Sample("periodic", heights, nodes, 0.0, finer=CREASES_FINER)


def _oblong(random: np.random.Generator) -> Sample:
    """Draw self-affine waves on a patch whose cells are 1.5 to 6 times as long as wide."""
    base = _rough(random)
    aspect = random.uniform(1.5, 6)
    return Sample(base.boundary, base.surface, base.nodes, base.nodes_in_wave, aspect)


def _layers(random: np.random.Generator) -> Sample:
    """Draw self-affine waves on a layer, which is harder or softer than its base."""
    base = _rough(random)
    thinnest, thickest = LAYER_THICKNESSES
    thickness = math.exp(random.uniform(math.log(thinnest), math.log(thickest)))
    thickness *= base.nodes_in_wave / base.nodes  # [side]
    ratio = MOST_LAYER_RATIO ** random.uniform(-1, 1)
    poisson = random.uniform(0, 0.5)
    below = HalfSpace(1 / ratio)
    body = Layered(thickness, 1 - poisson**2, poisson, below)
    if random.random() < RIGID:
        body = replace(body, base="rigid")
    return replace(base, body=body)


def _machined(random: np.random.Generator) -> Sample:
    """Draw a window of a made map of a machined surface.

    Such maps have 4 nodes in the shortest wave, unless a filter removes more waves.
    """
    nodes = int(random.choice(NODES))
    shape = (nodes + 2 * MARGIN, nodes + 2 * MARGIN)
    description = MadeMap(
        kind=random.choice(sorted(set(MACHINED) - {"fractal"})),
        number=int(random.integers(10_000, 100_000)),
        shape=shape,
        rms=random.uniform(0.3, 2.0),
        length=random.uniform(15, 40),
    )
    heights = made_surface(description)
    return _window(heights, _draw_cutoff(random), nodes_in_wave=4.0)


def _draw_cutoff(random: np.random.Generator) -> float:
    """Draw the cut-off wavelength of a filter [spacing]; 0 for none, in half of the cases."""
    if random.random() < 0.5:
        return 0.0
    return math.exp(random.uniform(math.log(4), math.log(24)))


def _window(heights: Heights, cutoff: float, nodes_in_wave: float) -> Sample:
    """Return a window of a map as a sample on a free patch, less `MARGIN` nodes on each side.

    Parameters
    ----------
    heights : ndarray, shape (nodes + 2 MARGIN, nodes + 2 MARGIN)
        Heights of the map [spacing].
    cutoff : float
        Cut-off wavelength of a Gaussian filter that removes shorter waves [spacing]; 0 for none.
    nodes_in_wave : float
        Nodes in the shortest wave before the filter.
    """
    if cutoff:
        heights = gaussian_filter(heights, GAUSSIAN * cutoff, mode="nearest")
        nodes_in_wave = cutoff
    nodes = len(heights) - 2 * MARGIN
    node_places = (np.arange(len(heights)) - MARGIN + 0.5) / nodes
    spline = RectBivariateSpline(node_places, node_places, heights / nodes, kx=5, ky=5)
    return Sample("free", lambda x: np.asarray(spline(x, x)), nodes, nodes_in_wave)


@dataclass(frozen=True)
class MeasuredMap:
    """A measured map, levelled and without spikes."""

    heights: Heights  # (nx, ny) [spacing along x]
    aspect: float  # spacing along y over that along x [1]


def read_maps(folder: Path) -> list[MeasuredMap]:
    """Read and prepare all maps of a folder.

    Maps that cannot be read or are too small are left out, and named on standard error.

    Parameters
    ----------
    folder : Path
        Folder with files of instruments, or with .npy or text files.

    Returns
    -------
    list of MeasuredMap
        The maps, in the order of the names of their files.

    Raises
    ------
    InputError
        If the folder does not exist, or no file in it can be read.
    """
    maps = []
    reading = Reading(level="plane", despike=SPIKE, fill=True)
    for path in files_in(folder):
        try:
            topography, _ = read_surface(path, reading)
        except InputError as error:
            remark(f"left out: {error}")
            continue
        if min(topography.heights.shape) < NODES[0] + 2 * MARGIN:
            remark(
                f"left out: {path}: fewer than {NODES[0] + 2 * MARGIN} nodes along an axis"
            )
            continue
        along, across = topography.spacing
        maps.append(MeasuredMap(topography.heights / along, across / along))
    if not maps:
        raise InputError(f"--maps {folder}: no map of it can be read")
    return maps


def window_of_map(maps: Sequence[MeasuredMap], random: np.random.Generator) -> Sample:
    """Draw a window of one of the measured maps; a filter smoothes it in half of the cases.

    Parameters
    ----------
    maps : sequence of MeasuredMap
        The maps.
    random : numpy.random.Generator
        Source of random numbers, whose state moves.

    Returns
    -------
    Sample
        The window, on a free patch. Between the nodes it is a spline of the fifth degree.
    """
    chosen = maps[int(random.integers(len(maps)))]
    heights = chosen.heights
    largest = min(heights.shape) - 2 * MARGIN
    nodes = min(int(random.choice(NODES)), largest)
    first = [
        int(random.integers(size - nodes - 2 * MARGIN + 1)) for size in heights.shape
    ]
    along, across = (slice(start, start + nodes + 2 * MARGIN) for start in first)
    window = _window(heights[along, across], _draw_cutoff(random), math.nan)
    return replace(window, aspect=chosen.aspect)


def _fractal(random: np.random.Generator) -> Sample:
    """Draw self-affine waves that go on below the grid of the map."""
    nodes = int(random.choice([64, 96, 128]))
    surface = random_waves(1, 2 * nodes, random.uniform(0.2, 0.9), random)
    return Sample("periodic", surface, nodes, 0.5, has_limit=False)


def _midpoint(random: np.random.Generator) -> Sample:
    """Draw a surface by midpoint displacement, whose waves go on below the grid of the map."""
    hurst = random.uniform(0.2, 0.9)
    finest = generate("diamond-square", 513, hurst, sigma0=0.01, random=random)

    def heights(x: Values) -> Heights:
        """Return the heights, (n, n), of the nodes next to n places along both axes."""
        nearest = np.minimum((x * 512).astype(int), 511)
        return np.asarray(finest[np.ix_(nearest, nearest)])

    return Sample("free", heights, 128, 0.5, has_limit=False)


KINDS: Mapping[str, Draw] = {
    "waves without edges": partial(_rough, boundary="periodic"),
    "mirrored waves": partial(_rough, boundary="mirror"),
    "free waves": partial(_rough, boundary="free"),
    "two scales": _two_scales,
    "directional": _directional,
    "lognormal": _lognormal,
    "plateaus": _plateaus,
    "one wave": partial(_regular, directions=(0.0,)),
    "crossed waves": partial(_regular, directions=(0.0, 1 / 2)),
    "hexagonal waves": partial(_regular, directions=(0.0, 1 / 3, 2 / 3)),
    "spheres": partial(_caps, most_oblong=1.0),
    "ellipses": partial(_caps, most_oblong=8.0),
    "bumps": _bumps,
    "oblong cells": _oblong,
    "machined maps": _machined,
    "turned": _turned,
    "ridges": _ridges,
    "no shortest wave": _fractal,
    "midpoint displacement": _midpoint,
}
"""Function that draws a sample of each kind, by the name of the kind in the tables."""

MEASURED = "measured maps"
"""Name of the kind whose samples are windows of a user's maps."""

LATER_KINDS: Mapping[str, Draw] = {"layers": _layers}
"""Kinds that were added after the measured maps, and have the seeds after theirs."""
