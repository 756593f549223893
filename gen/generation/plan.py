"""The plan: the parameters of each row of a database, a pure function of the scene and the row.

With m samples per surface, row i belongs to surface i // m. The Hurst exponent, sigma0 and the
far-field displacements come from one random stream per chunk of 65,536 surfaces, laid out as

    hurst (65536), sigma0 (65536), delta (65536, m, 2: which piece, where in its range)

the hardness from a second stream per chunk, one number for each sample,

    hardness (65536, m)

and the displacements of surface s from a stream of its own. None of them depends on the number of
samples, on ranks, on order or on restarts. This layout is part of a database's physics: another
layout gives other surfaces and loads for the same scene.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Columns, Values
from gen.scene import Piece, Scene

CHUNK = 65_536
"""Surfaces that share a stream: one stream per row would take minutes for millions of rows."""

DIGITS = 53
"""Binary digits of a random number in [0, 1)."""


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters of consecutive rows.

    Attributes
    ----------
    surface : ndarray of int, shape (rows,)
        Index of the row's surface.
    hurst : ndarray, shape (rows,)
        Hurst exponent of the row's surface [1].
    sigma0 : ndarray, shape (rows,)
        Standard deviation of the surface's first displacements [um].
    delta : ndarray, shape (rows,)
        Far-field displacement [um].
    hardness : ndarray, shape (rows,), or None
        Hardness of the softer body [MPa]; None for elastic bodies.
    """

    surface: NDArray[np.int64]
    hurst: NDArray[np.float64]
    sigma0: NDArray[np.float64]
    delta: NDArray[np.float64]
    hardness: NDArray[np.float64] | None = None

    def hardness_of(self, row: int) -> float | None:
        """Return the hardness of a row, counted from the first of these [MPa], or None."""
        return None if self.hardness is None else float(self.hardness[row])


def parameters(scene: Scene, start: int, stop: int) -> Parameters:
    """Draw the parameters of the rows start to stop - 1, a slice of the whole plan.

    Parameters
    ----------
    scene : Scene
        Description of the samples.
    start, stop : int
        First row, and one past the last. Rows beyond `scene.samples` are those that more samples
        of the same scene would add.

    Returns
    -------
    dataclass of ndarray
        The values of stop - start rows, see `Parameters`.

    Raises
    ------
    ValueError
        Unless 0 <= start <= stop.
    """
    if not 0 <= start <= stop:
        raise ValueError(f"rows {start} to {stop}: wanted 0 <= start <= stop")
    m = scene.samples_per_surface
    first, last = start // m, -(-stop // m)
    hurst, sigma0, delta = _uniform_numbers(scene.seed, m, first, last)
    surface = np.arange(start, stop, dtype=np.int64) // m
    rows = slice(start - first * m, stop - first * m)
    return Parameters(
        surface=surface,
        hurst=_within(*scene.surface.hurst, hurst)[surface - first],
        sigma0=_within(*scene.surface.sigma0, sigma0)[surface - first],
        delta=_displacement(scene.delta.pieces, delta.reshape(-1, 2)[rows]),
        hardness=_hardness(scene, start, stop),
    )


def planned_columns(scene: Scene, plan: Parameters) -> Columns:
    """Return the columns of a scene's database that its plan decides.

    Parameters
    ----------
    scene : Scene
        Description of the samples.
    plan : Parameters
        Parameters of some rows of the scene.

    Returns
    -------
    Columns
        The values of these rows for each planned column.
    """
    return {
        name: getattr(plan, name)
        for name in ("surface", "hurst", "sigma0", "delta", "hardness")
        if name != "hardness" or scene.contact.draws_hardness
    }


def surface_random(scene: Scene, surface: int | np.int64) -> np.random.Generator:
    """Make the random generator of one surface's displacements.

    Parameters
    ----------
    scene : Scene
        Description of the samples, of which only the seed counts.
    surface : int
        Index of the surface, below 2^32.
    """
    return np.random.Generator(_stream(scene.seed, int(surface)))


def blocks(
    pending: Iterable[tuple[int, int]],
    *,
    samples: int,
    samples_per_surface: int,
    workers: int,
    largest: int,
    smallest: int = 1,
) -> Iterator[tuple[int, int]]:
    """Cut pending rows into blocks, the tasks of workers, which become smaller towards the end.

    Guided self-scheduling (Polychronopoulos and Kuck, 1987): a block is a third of one worker's
    share of the remaining rows, so that a slow block at the end delays the run little. A block
    ends with a surface if possible, so that few surfaces are generated twice.

    Parameters
    ----------
    pending : iterable of (int, int)
        Ranges (start, stop) of rows, ascending, without overlap.
    samples : int
        Number of planned rows, which no block exceeds.
    samples_per_surface : int
        Rows of one surface.
    workers : int
        Number of workers that share the blocks.
    largest : int
        Largest number of rows of a block.
    smallest : int
        Smallest number of rows of a block while that many rows are left: one master cannot serve
        many workers row by row.

    Yields
    ------
    tuple of int and int
        Ranges (start, stop) of rows, ascending, that hold every pending row once and no other.

    Raises
    ------
    ValueError
        If the ranges are not ascending within 0..samples, or a number is below 1.
    """
    if min(samples_per_surface, workers, largest, smallest) < 1:
        raise ValueError(
            f"{samples_per_surface=}, {workers=}, {largest=}, {smallest=}: wanted 1 or more"
        )
    ranges = _ascending(list(pending), samples)
    remaining = sum(stop - start for start, stop in ranges)
    for start, stop in ranges:
        position = start
        while position < stop:
            rows = min(max(smallest, remaining // (3 * workers)), largest)
            border = _border(position, rows, samples_per_surface, largest)
            border = min(border, stop)
            yield position, border
            remaining -= border - position
            position = border


def _border(position: int, rows: int, samples_per_surface: int, largest: int) -> int:
    """Return the end of a block of `rows` rows: that of a surface if `largest` allows it."""
    aligned = (position + rows) // samples_per_surface * samples_per_surface
    if aligned > position:
        return aligned
    following = aligned + samples_per_surface
    return following if following - position <= largest else position + rows


def _ascending(ranges: list[tuple[int, int]], samples: int) -> list[tuple[int, int]]:
    """Refuse ranges that do not ascend within the plan."""
    previous = 0
    for start, stop in ranges:
        if not previous <= start <= stop <= samples:
            raise ValueError(
                f"pending rows {start} to {stop}: wanted ascending ranges in {previous}..{samples}"
            )
        previous = stop
    return ranges


def _stream(seed: int, *key: int) -> np.random.PCG64:
    """Make an independent stream for a key.

    The bit generator is named because NumPy may change the one that `default_rng` takes.
    """
    return np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key))


def _uniform_numbers(
    seed: int, samples_per_surface: int, first: int, last: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Draw numbers in [0, 1) for the surfaces first to last - 1 from their chunks' streams.

    Returns
    -------
    hurst, sigma0 : ndarray, shape (last - first,)
        One number for each surface.
    delta : ndarray, shape (last - first, samples_per_surface, 2)
        Two numbers for each sample.
    """
    hurst, sigma0 = np.empty(last - first), np.empty(last - first)
    delta = np.empty((last - first, samples_per_surface, 2))
    per_delta = 2 * samples_per_surface
    begin = first
    while begin < last:
        chunk, offset = divmod(begin, CHUNK)
        end = min(last, (chunk + 1) * CHUNK)
        here, passed = slice(begin - first, end - first), CHUNK - (end - begin)
        # A surface's key is one word, a chunk's two: no surface shares a stream with a chunk.
        stream = _stream(seed, chunk, 1)
        random = np.random.Generator(stream)
        # Each number takes one step of PCG64: leap over those that belong to other surfaces.
        stream.advance(offset)
        random.random(out=hurst[here])
        stream.advance(passed)
        random.random(out=sigma0[here])
        stream.advance(passed - offset + offset * per_delta)
        random.random(out=delta[here])
        begin = end
    return hurst, sigma0, delta


def _within(
    low: NDArray[np.float64] | float,
    high: NDArray[np.float64] | float,
    uniform: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Map numbers in [0, 1) linearly to [low, high].

    Rounding cannot exceed the upper end: the largest number, 1 - 2^-53, takes off as much as the
    rounding of high - low can add.
    """
    return low + (high - low) * uniform


def _hardness(scene: Scene, start: int, stop: int) -> Values | None:
    """Draw the hardness of the rows start to stop - 1 [MPa]; None for elastic bodies.

    Returns
    -------
    ndarray, shape (stop - start,), or None
        The scene's hardness, or log-uniform numbers from its range.
    """
    limits = scene.contact.hardness_limits
    if limits is None:
        return None
    if not scene.contact.draws_hardness:
        return np.full(stop - start, limits[0])
    uniform = np.empty(stop - start)
    rows = CHUNK * scene.samples_per_surface
    begin = start
    while begin < stop:
        chunk, offset = divmod(begin, rows)
        end = min(stop, (chunk + 1) * rows)
        stream = _stream(scene.seed, chunk, 2)
        stream.advance(offset)
        np.random.Generator(stream).random(out=uniform[begin - start : end - start])
        begin = end
    return _log_within(*limits, uniform)


def _log_within(low: float, high: float, uniform: Values) -> Values:
    """Map numbers in [0, 1) logarithmically to [low, high].

    Each binary digit of a number multiplies by a root of high / low. Roots and products are rounded
    alike on every processor, which logarithms and exponentials are not: a plan must not differ.
    """
    values = np.full(uniform.shape, low)
    factor = math.sqrt(high) / math.sqrt(low)
    rest = uniform.copy()
    for _ in range(DIGITS):
        rest *= 2.0
        digit = rest >= 1.0
        values[digit] *= factor
        rest -= digit
        factor = math.sqrt(factor)
    np.minimum(values, high, out=values)
    return values


def _displacement(pieces: tuple[Piece, ...], uniform: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn pairs of numbers in [0, 1) into displacements: one chooses the piece, one the place.

    Parameters
    ----------
    pieces : tuple of Piece
        Shares, and ranges [um].
    uniform : ndarray, shape (rows, 2)
        The pairs of numbers.

    Returns
    -------
    ndarray, shape (rows,)
        Far-field displacements [um].
    """
    # The last piece takes the rest: rounded shares cannot leave a gap below 1.
    borders = np.cumsum([piece.share for piece in pieces])[:-1]
    ranges = np.array([piece.range for piece in pieces])
    low, high = ranges[np.searchsorted(borders, uniform[:, 0], side="right")].T
    return _within(low, high, uniform[:, 1])
