"""Made maps that look like measured ones: machined surfaces of five kinds, with faults.

The faults are those of an instrument. A map depends on nothing but its entry in
`surrogates/maps.toml`. SurfaceTopography writes maps in three formats, which `gen` reads like the
files of an instrument.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import TypeAdapter

from bench.files import read_toml
from gen.arrays import Heights
from gen.runtime.files import make_folder
from gen.spectral import SelfAffineSpectrum, generate_spectral

Kind = Literal["turned", "ground", "sandblasted", "honed", "fractal"]
"""How the surface was machined."""

Format = Literal["x3p", "nc", "gwy"]
"""Format of a file, which is also the suffix of its name."""

SEED = 2611
"""First word of the seed of every map."""

FAULTS = 1
"""Last word of the seed of faults. With it, faults do not change the surface of a map."""

SPIKE = 8.0
"""Lowest height of a spike [rms height of the map]; the highest is twice as high."""

BLUR = 4
"""Shortest wavelength of self-affine roughness, as if optics blurred it [larger spacing]."""


@dataclass(frozen=True)
class Faults:
    """The tilt and the faults that an instrument adds to a map."""

    spikes: int = 0  # number of single nodes that are far above the surface
    holes: int = 0  # number of round patches without heights, which may overlap
    # Jump of the height at a line of constant y, as between two images [um].
    step: float = 0.0
    # Slopes along x and y of a plane that is added [1].
    tilt: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class MadeMap:
    """Description of one map."""

    kind: Kind
    number: int  # number among the maps of its kind, a word of its seed
    shape: tuple[int, int]  # nodes along x and y
    rms: float  # rms height without faults [um]
    # Characteristic length [um]. It is the feed of a turned map, the longest wavelength across the
    # lay of a ground map, the largest diameter of craters of a sandblasted map, the mean distance
    # of the grooves of a honed map, or the roll-off wavelength of a fractal map.
    length: float
    spacing: tuple[float, float] = (1.0, 1.0)  # spacing of the nodes along x and y [um]
    faults: Faults = Faults()
    format: Format = "x3p"

    @property
    def name(self) -> str:
        """Name of the map, which is also that of its file without the suffix."""
        return f"{self.kind}-{self.number}"


def surface(description: MadeMap) -> Heights:
    """Make the surface of a map, without faults.

    Parameters
    ----------
    description : MadeMap
        Description of the map.

    Returns
    -------
    ndarray, shape `description.shape`
        Heights of zero mean [um].
    """
    heights = KINDS[description.kind](description, _random(description))
    heights -= heights.mean()
    return np.asarray(heights * (description.rms / heights.std()))


def window(
    shape: tuple[int, int],
    spacing: tuple[float, float],
    rng: np.random.Generator,
    rms: float,
    length: float,
) -> Heights:
    """Cut a window out of a ground map. Scenes may name this function as their generator.

    Parameters
    ----------
    shape : (int, int)
        Nodes along x and y.
    spacing : (float, float)
        Spacing of the nodes along x and y [um].
    rng : numpy.random.Generator
        Source of random numbers, whose state moves. It gives the number of the map and the place of
        the window.
    rms : float
        Rms height of the map [um].
    length : float
        Longest wavelength across the lay [um].

    Returns
    -------
    ndarray, shape `shape`
        Heights [um].
    """
    rows, columns = shape
    number = int(rng.integers(2**31))
    row = rng.integers(0, rows)
    column = rng.integers(0, columns)
    larger = MadeMap(
        kind="ground",
        number=number,
        shape=(2 * rows, 2 * columns),
        rms=rms,
        length=length,
        spacing=spacing,
    )
    heights = surface(larger)
    return heights[row : row + rows, column : column + columns]


def measured(description: MadeMap) -> Heights:
    """Make a map as an instrument would measure it, with its faults.

    Parameters
    ----------
    description : MadeMap
        Description of the map.

    Returns
    -------
    ndarray, shape `description.shape`
        Heights [um]; NaN in holes.
    """
    heights = surface(description)
    faults = description.faults
    random = _random(description, FAULTS)
    x, y = _coordinates(description)
    tilt_x, tilt_y = faults.tilt
    heights += tilt_x * x + tilt_y * y
    step_column = int(random.uniform(0.3, 0.7) * description.shape[1])
    heights[:, step_column:] += faults.step
    spikes = random.choice(heights.size, faults.spikes, replace=False)
    spike_heights = random.uniform(SPIKE, 2 * SPIKE, faults.spikes)
    heights.reshape(-1)[spikes] += description.rms * spike_heights
    rows, columns = np.indices(description.shape, sparse=True)
    for _ in range(faults.holes):
        row = random.uniform(0, description.shape[0])
        column = random.uniform(0, description.shape[1])
        radius = random.uniform(1.5, 6.0)  # [nodes]
        squares = (rows - row) ** 2 + (columns - column) ** 2
        heights[squares <= radius**2] = np.nan
    return heights


def write(description: MadeMap, folder: Path) -> Path:
    """Write a map as an instrument would measure it, in the map's format.

    The file has the name of the map. An existing file of this name is replaced.

    Parameters
    ----------
    description : MadeMap
        Description of the map.
    folder : Path
        Folder of the file, which has to exist.

    Returns
    -------
    Path
        The file.
    """
    from SurfaceTopography import Topography

    path = folder / f"{description.name}.{description.format}"
    heights = np.ma.masked_invalid(measured(description))
    nx, ny = description.shape
    dx, dy = description.spacing
    sides = (nx * dx, ny * dy)
    topography = Topography(heights, sides, unit="um")
    writers = {"x3p": "to_x3p", "nc": "to_netcdf", "gwy": "to_gwy"}
    getattr(topography, writers[description.format])(str(path))
    return path


def write_all(folder: Path, maps: Iterable[MadeMap] | None = None) -> list[Path]:
    """Write maps as an instrument would measure them into a folder, which is made if needed.

    Parameters
    ----------
    folder : Path
        The folder.
    maps : iterable of MadeMap, optional
        Descriptions of the maps; `MAPS` by default.

    Returns
    -------
    list of Path
        The files, in the order of the maps.
    """
    make_folder(folder)
    if maps is None:
        maps = MAPS
    return [write(description, folder) for description in maps]


def _random(description: MadeMap, *key: int) -> np.random.Generator:
    """Return a random generator, seeded by the kind and number of a map and by further words."""
    words = (list(KINDS).index(description.kind), description.number, *key)
    seed = np.random.SeedSequence(SEED, spawn_key=words)
    return np.random.Generator(np.random.PCG64(seed))


def _coordinates(description: MadeMap) -> tuple[Heights, Heights]:
    """Return the coordinates x and y of the nodes, of shapes (nx, 1) and (1, ny) [um]."""
    nx, ny = description.shape
    dx, dy = description.spacing
    x = dx * np.arange(nx, dtype=float)
    y = dy * np.arange(ny, dtype=float)
    return x[:, None], y[None, :]


def _self_affine(
    description: MadeMap,
    random: np.random.Generator,
    roll_off: float,
    hurst: float,
    stretch: float = 1.0,
) -> Heights:
    """Return a self-affine surface with an rms height of 1 on the nodes of a map.

    `roll_off` is the roll-off wavelength along x [um]. Wavelengths along x are those along y times
    `stretch`, which is at most 1. The surface is cut out of a larger periodic one, so that it is
    not periodic itself.
    """
    nx, ny = description.shape
    dx, dy = description.spacing
    rows = nx + nx // 2
    columns = ny + ny // 2
    cut_off = BLUR * max(description.spacing) / stretch
    longest = max(roll_off / stretch, cut_off)
    spectrum = SelfAffineSpectrum(hurst, longest, cut_off, stretch)
    larger = generate_spectral(
        (rows, columns),
        (rows * dx, columns * dy),
        spectrum,
        random,
        rms_height=1.0,
    )
    heights = larger[:nx, :ny]
    return np.asarray(heights / heights.std())


def _turned(description: MadeMap, random: np.random.Generator) -> Heights:
    """Return the heights of a turned surface: round grooves along y with sharp ridges between them.

    They have no unit, as the heights of all kinds: `surface` scales them. The depths of grooves
    vary at random, and gentle self-affine waves are added.
    """
    x, y = _coordinates(description)
    # The grooves are slightly wavy along y.
    period = random.uniform(150, 400)  # [um]
    amplitude = 0.06 * description.length
    waviness = amplitude * np.sin(2 * np.pi * y / period)
    phase = random.uniform()
    position = (x + waviness) / description.length + phase
    groove = np.floor(position).astype(int)  # number of the groove at each node
    across = position - groove - 0.5  # place in the groove, -0.5 to 0.5 of its width
    # Depth of each groove; its ridges are 1 above its middle.
    depths = random.normal(0, 0.12, groove.max() + 1)
    grooves = 4 * across**2 - depths[groove]
    along = _self_affine(description, random, description.length / 2, 0.6, stretch=0.1)
    return np.asarray(grooves / grooves.std() + 0.25 * along)


def _ground(description: MadeMap, random: np.random.Generator) -> Heights:
    """Return the heights of a ground surface: scratches along y on a finer isotropic roughness.

    The waves of the scratches are 12 times as long along y as along x.
    """
    scratches = _self_affine(description, random, description.length, 0.7, stretch=1 / 12)
    rough = _self_affine(description, random, description.length / 4, 0.7)
    return np.asarray(scratches + 0.15 * rough)


def _sandblasted(description: MadeMap, random: np.random.Generator) -> Heights:
    """Return the heights of a sandblasted surface: overlapping round craters of random diameters.

    An isotropic roughness is added.
    """
    heights = np.zeros(description.shape)
    nx, ny = description.shape
    dx, dy = description.spacing
    area = nx * dx * ny * dy
    for _ in range(int(14 * area / description.length**2)):
        radius = description.length / 2 * random.uniform(0.3, 1.0)
        middle_x = random.uniform(0, nx * dx)
        middle_y = random.uniform(0, ny * dy)
        first_row = max(0, int((middle_x - radius) / dx))
        first_column = max(0, int((middle_y - radius) / dy))
        last_row = int((middle_x + radius) / dx) + 2
        last_column = int((middle_y + radius) / dy) + 2
        patch = heights[first_row:last_row, first_column:last_column]  # a view
        rows = first_row + np.arange(patch.shape[0])
        columns = first_column + np.arange(patch.shape[1])
        x = dx * rows[:, None] - middle_x
        y = dy * columns[None, :] - middle_y
        depth = radius - (x**2 + y**2) / radius
        patch -= np.maximum(depth, 0.0)
    rough = _self_affine(description, random, description.length / 3, 0.8)
    return np.asarray(heights / heights.std() + 0.2 * rough)


def _honed(description: MadeMap, random: np.random.Generator) -> Heights:
    """Return the heights of a honed surface: a fine plateau with deep grooves that cross."""
    x, y = _coordinates(description)
    heights = 0.35 * _self_affine(description, random, description.length / 2, 0.6)
    angle = np.radians(random.uniform(25, 40))
    for direction in (angle, -angle):
        across = x * np.cos(direction) + y * np.sin(direction)
        low = float(across.min())
        high = float(across.max())
        # The mean distance of the grooves of a direction is `description.length`.
        for _ in range(int((high - low) / description.length)):
            centre = random.uniform(low, high)
            width = random.uniform(0.06, 0.16) * description.length
            depth = random.gamma(3.0, 0.9)
            form = 1 - ((across - centre) / width) ** 2
            valley = -depth * np.maximum(form, 0.0)  # 0 beside the groove
            # In a groove, the roughness of the plateau is reduced to 0.3 of it.
            cut = np.minimum(heights, valley + 0.3 * heights)
            heights = np.where(valley < 0, cut, heights)
    return np.asarray(heights)


def _fractal(description: MadeMap, random: np.random.Generator) -> Heights:
    """Return an isotropic self-affine surface with a random Hurst exponent."""
    return _self_affine(
        description, random, description.length, random.uniform(0.6, 0.95)
    )


KINDS: dict[Kind, Callable[[MadeMap, np.random.Generator], Heights]] = {
    "turned": _turned,
    "ground": _ground,
    "sandblasted": _sandblasted,
    "honed": _honed,
    "fractal": _fractal,
}
"""Function that makes the surface of each kind, with heights in any unit.

The order of the kinds is part of the seeds of maps.
"""

MAPS = TypeAdapter(tuple[MadeMap, ...]).validate_python(
    read_toml("surrogates/maps")["maps"]
)
"""The maps: 20 of one instrument, with nodes 1 um apart, and four of other instruments."""

ONE_INSTRUMENT: tuple[MadeMap, ...] = tuple(
    description for description in MAPS if description.spacing == (1.0, 1.0)
)
"""The maps of one instrument, with nodes 1 um apart along both axes."""
