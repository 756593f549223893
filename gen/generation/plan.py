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
another layout gives other surfaces and loads for the same scene.
"""

import zlib
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Columns, Values
from gen.distribution import log_within, quantiles
from gen.scene import Scene
from gen.schema import DRAWN_NAMES

SURFACES_PER_STREAM = 65_536
"""Surfaces that share a random stream: one stream a row would take minutes for millions of rows."""

OPPOSITE = 4
"""Second word of the key of a second rough body, which the keys of shared streams never have."""

# Second word of the keys of shared streams; behind OF_PARAMETER stands a number for the name.
OF_FRACTAL_AND_LOAD = 1
OF_HARDNESS = 2
OF_PARAMETER = 3

FRACTAL = ("hurst", "sigma0")
"""Parameters of the diamond-square generator, which have the first numbers of the load's stream."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The planned parameters of consecutive rows: arrays of shape (rows,)."""

    surface: NDArray[np.int64]  # index of the row's surface
    drawn: dict[str, Values]  # parameters of that surface by their names, as "hurst"
    load: Values  # in the scene's quantity, one of `gen.scene.tables.UNITS`
    hardness: Values | None = None  # of the softer body [MPa]; None for elastic bodies
    first: int = 0  # number of the first row
    # Where that surface was cut out of measured maps, by the names of the columns that store it.
    places: dict[str, NDArray[np.int32]] = field(default_factory=dict)

    def parameters_of(self, row: int) -> dict[str, float]:
        """Return the drawn parameters of the surface of a row.

        Parameters
        ----------
        row : int
            Position of the row, counted from the first one of these rows.

        Returns
        -------
        dict of str to float
            The parameters by their names.
        """
        return {name: float(values[row]) for name, values in self.drawn.items()}

    def hardness_of(self, row: int) -> float | None:
        """Return the hardness of a row.

        Parameters
        ----------
        row : int
            Position of the row, counted from the first one of these rows.

        Returns
        -------
        float or None
            Hardness of the softer body [MPa]; None for elastic bodies.
        """
        return None if self.hardness is None else float(self.hardness[row])


@dataclass(frozen=True)
class _Stream:
    """Random numbers of items in their order, surfaces or rows: one stream for each chunk of items.

    The stream of chunk c has the key (c, *key).
    """

    seed: int  # of the scene
    key: tuple[int, ...]
    chunk: int  # number of items that share a stream
    per_item: int = 1  # numbers of each item
    before: int = (
        0  # numbers at the beginning of each stream that are not for these items
    )

    def uniform(self, start: int, stop: int) -> Values:
        """Draw the numbers of the items start to stop - 1, shape (items, per_item), in [0, 1)."""
        numbers = np.empty((stop - start, self.per_item))
        begin = start
        while begin < stop:
            chunk, offset = divmod(begin, self.chunk)
            end = min(stop, (chunk + 1) * self.chunk)
            key = np.random.SeedSequence(self.seed, spawn_key=(chunk, *self.key))
            stream = np.random.PCG64(key)
            # Each number takes one step of PCG64: leap over those that belong to other items.
            stream.advance(self.before + offset * self.per_item)
            out = numbers[begin - start : end - start]
            np.random.Generator(stream).random(out=out)
            begin = end
        return numbers


def parameters(scene: Scene, start: int, stop: int) -> Plan:
    """Draw the parameters of consecutive rows.

    Parameters
    ----------
    scene : Scene
        The scene. The rows may be beyond its samples.
    start, stop : int
        Numbers of the first row and of the row behind the last one.

    Returns
    -------
    Plan
        Surfaces, loads and hardnesses of these rows; the same call returns the same numbers on
        every machine.
    """
    m = scene.samples_per_surface
    surface = np.arange(start, stop, dtype=np.int64) // m
    first = start // m
    last = -(-stop // m)  # behind the surface of the last row
    drawn = _drawn_parameters(scene, first, last)
    places = {}
    if scene.surface.PLACES:
        randoms = (surface_random(scene, number) for number in range(first, last))
        places = scene.surface.places(randoms)
    return Plan(
        surface=surface,
        drawn={name: values[surface - first] for name, values in drawn.items()},
        load=_loads(scene, start, stop),
        hardness=_hardness(scene, start, stop) if scene.contact.hardness_limits else None,
        first=start,
        places={name: values[surface - first] for name, values in places.items()},
    )


def _drawn_parameters(scene: Scene, first: int, last: int) -> dict[str, Values]:
    """Draw the parameters of the surfaces first to last - 1: arrays (surfaces,) by their names."""
    distributions = scene.surface.drawn()
    is_fractal = distributions.keys() == set(FRACTAL)
    drawn = {}
    for name, distribution in distributions.items():
        key: tuple[int, ...] = (OF_PARAMETER, zlib.crc32(name.encode()))
        before = 0
        if is_fractal:
            key = (OF_FRACTAL_AND_LOAD,)
            before = SURFACES_PER_STREAM * FRACTAL.index(name)
        stream = _Stream(scene.seed, key, SURFACES_PER_STREAM, before=before)
        uniform = stream.uniform(first, last)[:, 0]
        drawn[name] = quantiles(distribution, uniform)
    return drawn


def _loads(scene: Scene, start: int, stop: int) -> Values:
    """Draw the loads of the rows start to stop - 1 in the scene's quantity, shape (rows,)."""
    m = scene.samples_per_surface
    stream = _Stream(
        scene.seed,
        (OF_FRACTAL_AND_LOAD,),
        SURFACES_PER_STREAM,
        per_item=2 * m,
        before=len(FRACTAL) * SURFACES_PER_STREAM,
    )
    first = start // m
    pairs = stream.uniform(first, -(-stop // m)).reshape(-1, 2)
    pairs = pairs[start - first * m : stop - first * m]
    # The first number of a pair chooses the piece, the second the place in its range. The last
    # piece takes all numbers above its border: rounded shares cannot leave a gap below 1.
    borders = np.cumsum([piece.share for piece in scene.pieces])[:-1]
    chosen = np.searchsorted(borders, pairs[:, 0], side="right")
    load = np.empty(len(pairs))
    for number, piece in enumerate(scene.pieces):
        in_piece = chosen == number
        load[in_piece] = quantiles(piece.range, pairs[in_piece, 1])
    return load


def planned_columns(scene: Scene, plan: Plan) -> Columns:
    """Return the columns of a database that the plan decides.

    Parameters
    ----------
    scene : Scene
        Scene of the database.
    plan : Plan
        Parameters of some of its rows.

    Returns
    -------
    dict of str to ndarray, shape (rows,)
        Surface, drawn parameters, places, load and hardness by the names of their columns.
    """
    columns: Columns = {"surface": plan.surface}
    for name, values in plan.drawn.items():
        columns[DRAWN_NAMES.get(name, name)] = values
    columns |= plan.places
    columns["delta" if scene.quantity == "delta" else "load"] = plan.load
    if plan.hardness is not None and scene.contact.draws_hardness:
        columns["hardness"] = plan.hardness
    return columns


def surface_random(
    scene: Scene, surface: int | np.int64, *body: int
) -> np.random.Generator:
    """Make the random generator of a surface.

    Parameters
    ----------
    scene : Scene
        The scene, whose seed counts.
    surface : int
        Index of the surface, below 2^32.
    *body : int
        Nothing for the first body, `OPPOSITE` for the body that it is pressed against.

    Returns
    -------
    numpy.random.Generator
        A new generator, at the beginning of its stream.
    """
    key = np.random.SeedSequence(scene.seed, spawn_key=(int(surface), *body))
    # PCG64 is the kind that `default_rng` takes today.
    return np.random.Generator(np.random.PCG64(key))


def _hardness(scene: Scene, start: int, stop: int) -> Values:
    """Return the hardness of the rows start to stop - 1 [MPa], shape (rows,).

    The scene gives a hardness or its ratio to E*: a number for all rows, a pair of limits between
    which it is log-uniform, or a distribution.
    """
    contact = scene.contact
    limits = contact.hardness_limits
    distribution = contact.hardness or contact.hardness_ratio
    assert limits is not None
    assert distribution is not None
    if not contact.draws_hardness:
        return np.full(stop - start, limits[0])
    rows_per_stream = SURFACES_PER_STREAM * scene.samples_per_surface
    stream = _Stream(scene.seed, (OF_HARDNESS,), rows_per_stream)
    uniform = stream.uniform(start, stop)[:, 0]
    if isinstance(distribution, tuple):
        return log_within(*limits, uniform)
    return np.clip(quantiles(distribution, uniform) * contact.hardness_unit, *limits)
