"""The plan: the parameters of each row of a database, a pure function of the scene and the row.

With m samples per surface, row i belongs to surface i // m. Surfaces are counted in chunks of
65,536. The random numbers of a plan come from these streams:

- For each chunk one stream with the Hurst exponents and sigma0, the standard deviation of the first
  displacements, of the generators by midpoint displacement, and with the loads of every generator.
  Its numbers are laid out in this order and shape:

      hurst (65536), sigma0 (65536), load (65536, m, 2: which piece, place in its range)

- For each chunk a second stream with the hardnesses, one for each sample: hardness (65536, m). For
  each chunk and each drawn number of a layer another one, alike.
- For each chunk and each parameter of any other generator one stream, with one number for each
  surface.
- For each surface one stream with the random numbers of its heights. The surface of a second rough
  body has a stream of its own.

No number depends on the number of samples, on ranks, on the order of computation or on restarts.
This layout is part of a database's physics: another layout gives other surfaces and loads for the
same scene.
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
"""Number of surfaces of a chunk, which share a stream: with a stream for each row, the plan of
millions of rows would take minutes."""

# The key of a stream is a tuple of whole numbers. It is (s,) for the heights of surface s,
# (s, OPPOSITE) for the heights of its second body, and (c, kind) for a stream of chunk c. The kind
# is one of the following three; after OF_PARAMETER the key has a third number, which is computed
# from the name of the parameter.
OF_FRACTAL_AND_LOAD = 1
OF_HARDNESS = 2
OF_PARAMETER = 3

OPPOSITE = 4
"""Second number in the key of the stream of a second rough body; it differs from the three kinds of
shared streams."""

FRACTAL = ("hurst", "sigma0")
"""Parameters of the generators by midpoint displacement: the Hurst exponent, and the standard
deviation of the first displacements. Their numbers precede the loads in a stream."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The planned parameters of consecutive rows of a scene; each array has the shape (rows,)."""

    surface: NDArray[np.int64]  # index of the surface of each row
    drawn: dict[str, Values]  # parameters of this surface by their names, such as "hurst"
    load: Values  # in the scene's quantity, one of `gen.scene.tables.UNITS`
    hardness: Values | None = None  # of the softer body [MPa]; None for elastic bodies
    first: int = 0  # number of the first row
    # Places where the surface was cut out of measured maps, by the names of their columns. Empty
    # for generators that do not cut surfaces out.
    places: dict[str, NDArray[np.int32]] = field(default_factory=dict)
    # Numbers of the layer that are drawn, by the names of their columns.
    layer: dict[str, Values] = field(default_factory=dict)

    def parameters_of(self, row: int) -> dict[str, float]:
        """Return the drawn parameters of the surface of a row.

        Parameters
        ----------
        row : int
            Position of the row in this plan; 0 is the first row.

        Returns
        -------
        dict of str to float
            The parameters by their names.
        """
        return {name: float(values[row]) for name, values in self.drawn.items()}

    def layer_of(self, row: int) -> dict[str, float]:
        """Return the drawn numbers of the layer of a row.

        Parameters
        ----------
        row : int
            Position of the row in this plan; 0 is the first row.

        Returns
        -------
        dict of str to float
            Numbers by the names of their columns; empty if none is drawn.
        """
        return {name: float(values[row]) for name, values in self.layer.items()}

    def hardness_of(self, row: int) -> float | None:
        """Return the hardness of a row.

        Parameters
        ----------
        row : int
            Position of the row in this plan; 0 is the first row.

        Returns
        -------
        float or None
            Hardness of the softer body [MPa]; None for elastic bodies.
        """
        if self.hardness is None:
            return None
        return float(self.hardness[row])


@dataclass(frozen=True)
class _Stream:
    """The random numbers of one purpose for all items, which are surfaces or rows.

    Each chunk of consecutive items has a stream with the key (index of the chunk, *key). In this
    stream the items follow each other, each with `per_item` numbers.
    """

    seed: int  # seed of the scene
    key: tuple[int, ...]  # key without its first number, the index of the chunk
    chunk: int  # number of items in a chunk
    per_item: int = 1  # number of random numbers for each item
    before: int = 0  # count of the numbers that precede the first item in each stream

    def uniform(self, start: int, stop: int) -> Values:
        """Return the numbers of the items start to stop - 1, shape (items, per_item), in [0, 1)."""
        numbers = np.empty((stop - start, self.per_item))
        begin = start  # first item whose numbers are not drawn yet
        while begin < stop:
            chunk, offset = divmod(begin, self.chunk)
            end = min(stop, (chunk + 1) * self.chunk)
            key = np.random.SeedSequence(self.seed, spawn_key=(chunk, *self.key))
            stream = np.random.PCG64(key)
            # Skip the numbers of earlier items. Each number takes one step of PCG64.
            stream.advance(self.before + offset * self.per_item)
            out = numbers[begin - start : end - start]
            np.random.Generator(stream).random(out=out)
            begin = end
        return numbers


def parameters(scene: Scene, start: int, stop: int) -> Plan:
    """Draw the planned parameters of consecutive rows.

    The result depends only on the scene and the numbers of the rows, and is equal on every machine.

    Parameters
    ----------
    scene : Scene
        The scene. The rows may be beyond its samples.
    start, stop : int
        Numbers of the first row and of the row behind the last one.

    Returns
    -------
    Plan
        Surfaces, parameters, loads, hardnesses and places of these rows.
    """
    per_surface = scene.samples_per_surface
    surface = np.arange(start, stop, dtype=np.int64) // per_surface
    first = start // per_surface  # first surface
    # The surface behind the last one: the quotient is rounded up.
    last = -(-stop // per_surface)
    drawn = _drawn_parameters(scene, first, last)
    places = {}
    if scene.surface.cuts_windows:
        randoms = (surface_random(scene, number) for number in range(first, last))
        places = scene.surface.places(randoms)
    hardness = None
    if scene.contact.hardness_limits is not None:
        hardness = _hardness(scene, start, stop)
    # Parameters and places were drawn for each surface; its rows repeat them.
    index = surface - first
    return Plan(
        surface=surface,
        drawn={name: values[index] for name, values in drawn.items()},
        load=_loads(scene, start, stop),
        hardness=hardness,
        first=start,
        places={name: values[index] for name, values in places.items()},
        layer=_layer_numbers(scene, start, stop),
    )


def _drawn_parameters(scene: Scene, first: int, last: int) -> dict[str, Values]:
    """Draw the parameters of the surfaces first to last - 1.

    Return an array of shape (surfaces,) for each parameter, by its name.
    """
    distributions = scene.surface.drawn()
    is_fractal = distributions.keys() == set(FRACTAL)
    drawn = {}
    for name, distribution in distributions.items():
        # A number for the name, so that further parameters leave the numbers of this one unchanged.
        key: tuple[int, ...] = (OF_PARAMETER, zlib.crc32(name.encode()))
        before = 0
        if is_fractal:
            key = (OF_FRACTAL_AND_LOAD,)
            before = SURFACES_PER_STREAM * FRACTAL.index(name)
        stream = _Stream(
            seed=scene.seed, key=key, chunk=SURFACES_PER_STREAM, before=before
        )
        uniform = stream.uniform(first, last)[:, 0]
        drawn[name] = quantiles(distribution, uniform)
    return drawn


def _loads(scene: Scene, start: int, stop: int) -> Values:
    """Draw the loads of the rows start to stop - 1 in the scene's quantity, shape (rows,)."""
    per_surface = scene.samples_per_surface
    # Two numbers for each row; the items of the stream are surfaces.
    stream = _Stream(
        seed=scene.seed,
        key=(OF_FRACTAL_AND_LOAD,),
        chunk=SURFACES_PER_STREAM,
        per_item=2 * per_surface,
        before=len(FRACTAL) * SURFACES_PER_STREAM,
    )
    first = start // per_surface  # first surface
    # The surface behind the last one: the quotient is rounded up.
    last = -(-stop // per_surface)
    # The numbers of all rows of these surfaces, shape (rows, 2), then of the wanted rows.
    pairs = stream.uniform(first, last).reshape(-1, 2)
    first_row = first * per_surface
    pairs = pairs[start - first_row : stop - first_row]
    # The first number of a pair chooses the piece, the second one the place in its range. The last
    # piece has no upper border, because the rounded sum of the shares may be below 1.
    borders = np.cumsum([piece.share for piece in scene.pieces])[:-1]
    chosen = np.searchsorted(borders, pairs[:, 0], side="right")
    load = np.empty(len(pairs))
    for number, piece in enumerate(scene.pieces):
        in_piece = chosen == number
        load[in_piece] = quantiles(piece.range, pairs[in_piece, 1])
    return load


def planned_columns(scene: Scene, plan: Plan) -> Columns:
    """Return the columns of a database that hold the plan.

    Parameters
    ----------
    scene : Scene
        Scene of the database.
    plan : Plan
        Parameters of some of its rows.

    Returns
    -------
    dict of str to ndarray, shape (rows,)
        Surface, drawn parameters, places, load, hardness and layer of these rows by the names of
        their columns. The load is the column "delta" if the scene gives Delta, otherwise "load". A
        hardness that all rows share has no column.
    """
    columns: Columns = {"surface": plan.surface}
    for name, values in plan.drawn.items():
        columns[DRAWN_NAMES.get(name, name)] = values
    columns |= plan.places
    if scene.quantity == "delta":
        columns["delta"] = plan.load
    else:
        columns["load"] = plan.load
    if plan.hardness is not None and scene.contact.draws_hardness:
        columns["hardness"] = plan.hardness
    columns |= plan.layer
    return columns


def surface_random(
    scene: Scene, surface: int | np.int64, *body: int
) -> np.random.Generator:
    """Make the generator of the random numbers of one surface.

    Parameters
    ----------
    scene : Scene
        The scene, of which only the seed is used.
    surface : int
        Index of the surface, below 2^32.
    *body : int
        No argument for the surface itself; `OPPOSITE` for the surface of the second rough body that
        it is pressed against.

    Returns
    -------
    numpy.random.Generator
        A new generator in its first state.
    """
    key = np.random.SeedSequence(scene.seed, spawn_key=(int(surface), *body))
    # `default_rng` takes PCG64 today, and may take another kind in future versions of NumPy.
    return np.random.Generator(np.random.PCG64(key))


def _layer_numbers(scene: Scene, start: int, stop: int) -> dict[str, Values]:
    """Draw the numbers of the layers of the rows start to stop - 1, (rows,) each, by column."""
    layer = scene.contact.layer
    if layer is None:
        return {}
    rows_per_stream = SURFACES_PER_STREAM * scene.samples_per_surface
    numbers = {}
    for name, distribution in layer.drawn.items():
        key = (OF_PARAMETER, zlib.crc32(name.encode()))
        stream = _Stream(seed=scene.seed, key=key, chunk=rows_per_stream)
        numbers[name] = quantiles(distribution, stream.uniform(start, stop)[:, 0])
    return numbers


def _hardness(scene: Scene, start: int, stop: int) -> Values:
    """Return the hardnesses of the rows start to stop - 1 [MPa], shape (rows,).

    The scene must have a hardness, in MPa or as a ratio to E*. It is a number, which all rows
    share, a pair of limits, between which hardnesses are log-uniform, or a distribution.
    """
    contact = scene.contact
    limits = contact.hardness_limits
    distribution = contact.hardness or contact.hardness_ratio
    # The caller has checked that the scene has a hardness.
    assert limits is not None
    assert distribution is not None
    if not contact.draws_hardness:
        return np.full(stop - start, limits[0])
    rows_per_stream = SURFACES_PER_STREAM * scene.samples_per_surface
    stream = _Stream(seed=scene.seed, key=(OF_HARDNESS,), chunk=rows_per_stream)
    uniform = stream.uniform(start, stop)[:, 0]
    if isinstance(distribution, tuple):
        return log_within(*limits, uniform)
    # Rounding in the change of the unit must not lead beyond the limits.
    return np.clip(quantiles(distribution, uniform) * contact.hardness_unit, *limits)
