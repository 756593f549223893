"""The plan: the parameters of each row of a database, a pure function of the scene and the row.

With m samples per surface, row i belongs to surface i // m. The Hurst exponent, sigma0 and the
loads come from one random stream per chunk of 65,536 surfaces, laid out as

    hurst (65536), sigma0 (65536), load (65536, m, 2: which piece, where in its range)

the hardness from a second stream per chunk, one number for each sample,

    hardness (65536, m)

the parameters of every other generator from a stream for each chunk and name, one number for each
surface, and the random numbers of surface s itself from a stream of its own, as do those of the
second rough body that it is pressed against, if the scene has one. None of them depends on the
number of samples, on ranks, on order or on restarts. This layout is part of a database's physics:
another one gives other surfaces and loads for the same scene.
"""

import functools
import zlib
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Columns, Values
from gen.distribution import log_within, quantiles
from gen.scene import Scene
from gen.schema import DRAWN_NAMES

CHUNK = 65_536  # surfaces that share a stream: one a row would take minutes for millions of rows
OPPOSITE = (
    4  # second word of the key of a second rough body, which a chunk's key never has
)


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters of consecutive rows: arrays of shape (rows,)."""

    surface: NDArray[np.int64]  # index of the row's surface
    drawn: dict[str, Values]  # parameters of that surface by their names, as "hurst"
    load: Values  # in the scene's quantity, one of `gen.scene.tables.UNITS`
    hardness: Values | None = None  # of the softer body [MPa]; None for elastic bodies
    first: int = 0  # number of the first row
    places: dict[str, NDArray[np.int32]] = field(
        default_factory=dict
    )  # of the row's surface

    def parameters_of(self, row: int) -> dict[str, float]:
        """Return the parameters of a row's surface, counted from the first of these rows."""
        return {name: float(values[row]) for name, values in self.drawn.items()}

    def hardness_of(self, row: int) -> float | None:
        """Return the hardness of a row, counted from the first of these [MPa], or None."""
        return None if self.hardness is None else float(self.hardness[row])


def parameters(scene: Scene, start: int, stop: int) -> Parameters:
    """Draw the parameters of the rows start to stop - 1; those beyond `scene.samples` exist too."""
    m = scene.samples_per_surface
    first, last = start // m, -(-stop // m)
    draw = functools.partial(_drawn, scene.seed, first, last, CHUNK)
    pairs = draw((1,), per=2 * m, before=2 * CHUNK).reshape(-1, 2)
    pairs = pairs[start - first * m : stop - first * m]
    # Of two numbers one chooses the piece, the other the place in it. The last piece takes the
    # rest: rounded shares cannot leave a gap below 1.
    borders = np.cumsum([piece.share for piece in scene.pieces])[:-1]
    chosen, load = (
        np.searchsorted(borders, pairs[:, 0], side="right"),
        np.empty(len(pairs)),
    )
    for number, piece in enumerate(scene.pieces):
        load[chosen == number] = quantiles(piece.range, pairs[chosen == number, 1])
    surface = np.arange(start, stop, dtype=np.int64) // m
    distributions, drawn = scene.surface.drawn(), {}
    for name, distribution in distributions.items():
        if distributions.keys() == {"hurst", "sigma0"}:
            uniform = draw((1,), before=CHUNK * (name == "sigma0"))[:, 0]
        else:
            uniform = draw((3, zlib.crc32(name.encode())))[:, 0]
        drawn[name] = quantiles(distribution, uniform)[surface - first]
    taken = {}
    if scene.surface.PLACES:
        taken = scene.surface.places(
            surface_random(scene, each) for each in range(first, last)
        )
    return Parameters(
        surface=surface,
        drawn=drawn,
        load=load,
        hardness=_hardness(scene, start, stop) if scene.contact.hardness_limits else None,
        first=start,
        places={name: values[surface - first] for name, values in taken.items()},
    )


def planned_columns(scene: Scene, plan: Parameters) -> Columns:
    """Return the columns of a scene's database that its plan decides."""
    drawn = {DRAWN_NAMES.get(name, name): values for name, values in plan.drawn.items()}
    columns: Columns = {"surface": plan.surface, **drawn, **plan.places}
    columns["delta" if scene.quantity == "delta" else "load"] = plan.load
    if plan.hardness is not None and scene.contact.draws_hardness:
        columns["hardness"] = plan.hardness
    return columns


def surface_random(
    scene: Scene, surface: int | np.int64, *body: int
) -> np.random.Generator:
    """Make the random generator of a surface, below 2^32, or of the body that it is pressed on."""
    key = (int(surface), *body)  # PCG64 is the kind that `default_rng` takes today
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(scene.seed, spawn_key=key))
    )


def _drawn(
    seed: int,
    start: int,
    stop: int,
    chunk: int,
    key: tuple[int, ...],
    *,
    per: int = 1,
    before: int = 0,
) -> Values:
    """Draw `per` numbers in [0, 1) for each item from streams of `chunk` items, past `before`."""
    uniform = np.empty((stop - start, per))
    begin = start
    while begin < stop:
        number, offset = divmod(begin, chunk)
        end = min(stop, (number + 1) * chunk)
        stream = np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(number, *key)))
        # Each number takes one step of PCG64: leap over those that belong to other items.
        stream.advance(before + offset * per)
        np.random.Generator(stream).random(out=uniform[begin - start : end - start])
        begin = end
    return uniform


def _hardness(scene: Scene, start: int, stop: int) -> Values:
    """Draw the hardness of the rows start to stop - 1 [MPa]; a pair of limits is log-uniform."""
    contact = scene.contact
    given, limits = contact.hardness or contact.hardness_ratio, contact.hardness_limits
    assert given is not None
    assert limits is not None
    if not contact.draws_hardness:
        return np.full(stop - start, limits[0])
    chunk = CHUNK * scene.samples_per_surface
    uniform = _drawn(scene.seed, start, stop, chunk, (2,))[:, 0]
    if isinstance(given, tuple):
        return log_within(*limits, uniform)
    return np.clip(quantiles(given, uniform) * contact.hardness_unit, *limits)
