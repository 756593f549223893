"""The plan: what each row of a database is about, a pure function of the scene and the row.

With m samples per surface, row i belongs to surface i // m. The Hurst exponent, sigma0 and the
far-field displacements come from one random stream per chunk of 65,536 surfaces, laid out as

    hurst (65536), sigma0 (65536), delta (65536, m, 2: which piece, where in its range)

and the noise of surface s from a stream of its own. Neither depends on the number of samples, on
ranks, on order or on restarts. This layout is part of a database's physics: another one gives
other surfaces and loads for the same scene.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.scene import Piece, Scene

CHUNK = 65_536
"""Surfaces that share a stream. One stream per row would take minutes for millions of rows."""


@dataclass(frozen=True, eq=False)
class Parameters:
    """What rows start..stop are to be generated with.

    Attributes
    ----------
    surface : (stop - start,) index of the row's surface [1]
    hurst : (stop - start,) Hurst exponent of the row's surface [1]
    sigma0 : (stop - start,) standard deviation of the first displacements of that surface [um]
    delta : (stop - start,) far-field displacement [um]
    """

    surface: NDArray[np.int64]
    hurst: NDArray[np.float64]
    sigma0: NDArray[np.float64]
    delta: NDArray[np.float64]


def parameters(scene: Scene, start: int, stop: int) -> Parameters:
    """Parameters of the rows start..stop, equal to this slice of the whole plan.

    Parameters
    ----------
    scene : what to generate
    start, stop : first row, and one past the last; rows past `scene.samples` are those that more
        samples of the same scene would add

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
    )


def surface_random(scene: Scene, surface: int | np.int64) -> np.random.Generator:
    """The random generator of one surface's noise.

    Parameters
    ----------
    scene : what to generate; only its seed counts
    surface : index of the surface, below 2^32
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
    """Cut pending rows into tasks, large at first and shrinking to the end.

    Guided self-scheduling (Polychronopoulos and Kuck, 1987): a block is a third of one worker's
    share of what remains, so that a slow block at the end keeps nobody waiting for long. A block
    ends with a surface where it can, so that few surfaces are generated twice.

    Parameters
    ----------
    pending : ranges (start, stop) of rows, ascending, without overlap
    samples : number of planned rows; no block goes beyond
    samples_per_surface : rows of one surface
    workers : number of workers that the blocks are for
    largest : number of rows that a block may have
    smallest : number of rows that a block should have, where so many are left: the master of many
        workers cannot write for each of them row by row

    Yields
    ------
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
    """Where a block of some rows ends: with a surface, unless one alone is more than `largest`."""
    aligned = (position + rows) // samples_per_surface * samples_per_surface
    if aligned > position:
        return aligned
    following = aligned + samples_per_surface
    return following if following - position <= largest else position + rows


def _ascending(ranges: list[tuple[int, int]], samples: int) -> list[tuple[int, int]]:
    """The ranges, if they ascend within the plan."""
    previous = 0
    for start, stop in ranges:
        if not previous <= start <= stop <= samples:
            raise ValueError(
                f"pending rows {start} to {stop}: wanted ascending ranges in {previous}..{samples}"
            )
        previous = stop
    return ranges


def _stream(seed: int, *key: int) -> np.random.PCG64:
    """An independent stream for each key; named, as NumPy may change what `default_rng` takes."""
    return np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key))


def _uniform_numbers(
    seed: int, samples_per_surface: int, first: int, last: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Numbers in [0, 1) for the surfaces first..last, cut from their chunks' streams.

    Returns
    -------
    hurst, sigma0 : (last - first,) [1]
    delta : (last - first, samples_per_surface, 2) [1]
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
    """Numbers in [0, 1) carried over to [low, high].

    Rounding cannot step over the end: the largest number, 1 - 2^-53, takes off as much as rounding
    high - low can have added.
    """
    return low + (high - low) * uniform


def _displacement(pieces: tuple[Piece, ...], uniform: NDArray[np.float64]) -> NDArray[np.float64]:
    """Far-field displacement from pairs of numbers in [0, 1): which piece, where in its range.

    Parameters
    ----------
    pieces : shares, and ranges [um]
    uniform : (rows, 2)

    Returns
    -------
    (rows,) far-field displacement [um]
    """
    # The last piece takes what is left: rounded shares cannot leave a gap below 1.
    borders = np.cumsum([piece.share for piece in pieces])[:-1]
    ranges = np.array([piece.range for piece in pieces])
    low, high = ranges[np.searchsorted(borders, uniform[:, 0], side="right")].T
    return _within(low, high, uniform[:, 1])
