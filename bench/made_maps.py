"""Made maps that look like measured ones: five kinds of machined surfaces, an instrument's faults.

Every map follows from its entry in `surrogates/maps.toml` alone. SurfaceTopography writes them in
three formats, and the readers of `gen` open the files like those of an instrument.
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
Format = Literal["x3p", "nc", "gwy"]

SEED = 2611  # first word of the seed of every map
FAULTS = 1  # key of the stream of faults: a map with faults is the map without them, and the faults
SPIKE = 8.0  # height of the lowest spike in rms heights of the map; the highest is twice as high
BLUR = 4  # shortest wavelength of fine roughness in spacings, as an instrument's optics leave it


@dataclass(frozen=True)
class Faults:
    """The tilt, noise and faults that an instrument adds to a map."""

    spikes: int = 0  # single nodes that stand far above the surface
    holes: int = 0  # round patches without heights; they may overlap
    step: float = 0.0  # jump at a line of constant y, as between fields of view [um]
    tilt: tuple[float, float] = (
        0.0,
        0.0,
    )  # slopes of the plane that is added, along x and y [1]


@dataclass(frozen=True)
class MadeMap:
    """Description of one map.

    The length that rules a kind is its feed, the longest wavelength across the lay, the largest
    diameter of a crater, the mean distance of grooves, or the roll-off wavelength.
    """

    kind: Kind
    number: int  # among the maps of its kind, a word of its seed
    shape: tuple[int, int]  # nodes along x and y
    rms: float  # rms height without faults [um]
    length: float  # that rules the kind [um]
    spacing: tuple[float, float] = (1.0, 1.0)  # of the nodes along x and y [um]
    faults: Faults = Faults()
    format: Format = "x3p"

    @property
    def name(self) -> str:
        """Name of the map, and of its file without the suffix."""
        return f"{self.kind}-{self.number}"


def surface(made: MadeMap) -> Heights:
    """Make the surface of a map without faults: heights of the map's shape about 0 [um]."""
    heights = KINDS[made.kind](made, _random(made))
    heights -= heights.mean()
    return np.asarray(heights * (made.rms / heights.std()))


def window(
    shape: tuple[int, int],
    spacing: tuple[float, float],
    rng: np.random.Generator,
    rms: float,
    length: float,
) -> Heights:
    """Cut a window out of a ground map of some rms height and length [um], for a scene."""
    number, whole = int(rng.integers(2**31)), (2 * shape[0], 2 * shape[1])
    first = rng.integers(0, shape[0]), rng.integers(0, shape[1])
    heights = surface(MadeMap("ground", number, whole, rms, length, spacing))
    return heights[first[0] :, first[1] :][: shape[0], : shape[1]]


def measured(made: MadeMap) -> Heights:
    """Make a map as an instrument would: heights with the map's faults, NaN in holes [um]."""
    heights, faults, random = surface(made), made.faults, _random(made, FAULTS)
    x, y = _coordinates(made)
    heights += faults.tilt[0] * x + faults.tilt[1] * y
    heights[:, int(random.uniform(0.3, 0.7) * made.shape[1]) :] += faults.step
    spikes = random.choice(heights.size, faults.spikes, replace=False)
    heights.reshape(-1)[spikes] += made.rms * random.uniform(
        SPIKE, 2 * SPIKE, faults.spikes
    )
    rows, columns = np.indices(made.shape, sparse=True)
    for _ in range(faults.holes):
        row, column = random.uniform(0, made.shape[0]), random.uniform(0, made.shape[1])
        radius = random.uniform(1.5, 6.0)
        heights[(rows - row) ** 2 + (columns - column) ** 2 <= radius**2] = np.nan
    return heights


def write(made: MadeMap, folder: Path) -> Path:
    """Write a map to a folder, in the map's format, and return the file."""
    from SurfaceTopography import Topography

    heights, path = measured(made), folder / f"{made.name}.{made.format}"
    sides = tuple(
        nodes * step for nodes, step in zip(made.shape, made.spacing, strict=True)
    )
    topography = Topography(np.ma.masked_invalid(heights), sides, unit="um")
    writers = {"x3p": "to_x3p", "nc": "to_netcdf", "gwy": "to_gwy"}
    getattr(topography, writers[made.format])(str(path))
    return path


def write_all(folder: Path, maps: Iterable[MadeMap] | None = None) -> list[Path]:
    """Write maps to a folder, all of `MAPS` by default, and return the files in their order."""
    make_folder(folder)
    return [write(made, folder) for made in (MAPS if maps is None else maps)]


def _random(made: MadeMap, *key: int) -> np.random.Generator:
    """Return the source of random numbers of a map."""
    words = (list(KINDS).index(made.kind), made.number, *key)
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(SEED, spawn_key=words))
    )


def _coordinates(made: MadeMap) -> tuple[Heights, Heights]:
    """Return the coordinates of the nodes, of shapes (nx, 1) and (1, ny) [um]."""
    (nx, ny), (dx, dy) = made.shape, made.spacing
    return dx * np.arange(nx, dtype=float)[:, None], dy * np.arange(ny, dtype=float)[
        None, :
    ]


def _self_affine(
    made: MadeMap,
    random: np.random.Generator,
    roll_off: float,
    hurst: float,
    stretch: float = 1.0,
) -> Heights:
    """Make a window of a larger periodic surface, so that opposite borders differ; rms 1.

    The roll-off is that along x, where waves are shorter by the factor `stretch`, at most 1.
    """
    larger = tuple(nodes + nodes // 2 for nodes in made.shape)
    roll_off, cut_off = roll_off / stretch, BLUR * max(made.spacing) / stretch
    sides = (larger[0] * made.spacing[0], larger[1] * made.spacing[1])
    spectrum = SelfAffineSpectrum(hurst, max(roll_off, cut_off), cut_off, stretch)
    whole = generate_spectral(
        (larger[0], larger[1]), sides, spectrum, random, rms_height=1.0
    )
    heights = whole[: made.shape[0], : made.shape[1]]
    return np.asarray(heights / heights.std())


def _turned(made: MadeMap, random: np.random.Generator) -> Heights:
    """Make round grooves along y, which the tool's nose leaves, with sharp ridges between."""
    x, y = _coordinates(made)
    waver = 0.06 * made.length * np.sin(2 * np.pi * y / random.uniform(150, 400))
    position = (x + waver) / made.length + random.uniform()
    groove = np.floor(position).astype(int)
    across = position - groove - 0.5
    grooves = 4 * across**2 - random.normal(0, 0.12, groove.max() + 1)[groove]
    along = _self_affine(made, random, made.length / 2, 0.6, stretch=0.1)
    return np.asarray(grooves / grooves.std() + 0.25 * along)


def _ground(made: MadeMap, random: np.random.Generator) -> Heights:
    """Make long scratches of abrasive grains: waves along y are twelve times as long as along x."""
    texture = _self_affine(made, random, made.length, 0.7, stretch=1 / 12)
    return np.asarray(texture + 0.15 * _self_affine(made, random, made.length / 4, 0.7))


def _sandblasted(made: MadeMap, random: np.random.Generator) -> Heights:
    """Make overlapping craters, round bowls of random diameters that grains have hit."""
    heights = np.zeros(made.shape)
    (nx, ny), (dx, dy) = made.shape, made.spacing
    area = nx * dx * ny * dy
    for _ in range(int(14 * area / made.length**2)):
        radius = made.length / 2 * random.uniform(0.3, 1.0)
        at_x, at_y = random.uniform(0, nx * dx), random.uniform(0, ny * dy)
        rows = slice(max(0, int((at_x - radius) / dx)), int((at_x + radius) / dx) + 2)
        columns = slice(max(0, int((at_y - radius) / dy)), int((at_y + radius) / dy) + 2)
        patch = heights[rows, columns]
        x = dx * (rows.start + np.arange(patch.shape[0])[:, None]) - at_x
        y = dy * (columns.start + np.arange(patch.shape[1])[None, :]) - at_y
        patch -= np.maximum(radius - (x**2 + y**2) / radius, 0.0)
    rough = _self_affine(made, random, made.length / 3, 0.8)
    return np.asarray(heights / heights.std() + 0.2 * rough)


def _honed(made: MadeMap, random: np.random.Generator) -> Heights:
    """Make a plateau with two families of grooves that cross: deep scratches, fine land between."""
    x, y = _coordinates(made)
    heights = 0.35 * _self_affine(made, random, made.length / 2, 0.6)
    angle = np.radians(random.uniform(25, 40))
    for direction in (angle, -angle):
        across = x * np.cos(direction) + y * np.sin(direction)
        low, high = float(across.min()), float(across.max())
        for _ in range(int((high - low) / made.length)):
            centre, width = (
                random.uniform(low, high),
                random.uniform(0.06, 0.16) * made.length,
            )
            depth = random.gamma(3.0, 0.9)
            valley = -depth * np.maximum(1 - ((across - centre) / width) ** 2, 0.0)
            heights = np.where(
                valley < 0, np.minimum(heights, valley + 0.3 * heights), heights
            )
    return np.asarray(heights)


def _fractal(made: MadeMap, random: np.random.Generator) -> Heights:
    """Make an isotropic self-affine surface with a Hurst exponent of its own."""
    return _self_affine(made, random, made.length, random.uniform(0.6, 0.95))


KINDS: dict[Kind, Callable[[MadeMap, np.random.Generator], Heights]] = {
    "turned": _turned,
    "ground": _ground,
    "sandblasted": _sandblasted,
    "honed": _honed,
    "fractal": _fractal,
}
"""Function that makes the surface of each kind."""

MAPS = TypeAdapter(tuple[MadeMap, ...]).validate_python(
    read_toml("surrogates/maps")["maps"]
)
"""The maps: twenty of one instrument, with a node every um, and four of others."""

ONE_INSTRUMENT: tuple[MadeMap, ...] = tuple(
    made for made in MAPS if made.spacing == (1.0, 1.0)
)
"""The maps with a node every um."""
