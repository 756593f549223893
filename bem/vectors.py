"""Passes over long vectors, piece by piece, in place and on the threads of the solve.

A piece fits into a processor's cache, so that the steps of a pass read memory once. Each result is
that of the plain expression, to the last bit. Short vectors are one piece, and cost what the plain
expression does or less.
"""

import threading
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise

import numpy as np

from bem.arrays import Mask, Nodes, Real, Values
from bem.workers import workers

# Entries of a piece: long enough that threads hardly wait for the interpreter, which one of them
# holds at a time, and short enough for a cache (`python -m bench threads`).
PIECE = 2**16

# Entries of a vector from which on it is cut into pieces.
SHORT = 2 * PIECE

# Several threads also share shorter vectors, from this number of entries on, in these pieces.
SHARED, SHARED_PIECE = 2**15, 2**14

Pass = Callable[[slice], None]


def is_short(size: int) -> bool:
    """Return whether a plain gather takes less time than pieces of vectors of a size.

    Passes that read and write entries in their order take so little time up to `SHORT` entries that
    another thread would not have begun before they end.
    """
    return size < SHARED or (size < SHORT and workers().threads == 1)


def piece_length(size: int) -> int:
    """Return the entries of a piece of vectors of a size."""
    return PIECE if size >= SHORT else SHARED_PIECE


@lru_cache(maxsize=64)
def pieces(size: int, length: int) -> list[slice]:
    """Cut a vector of a size into slices of a length; the last one takes what is left too."""
    count = max(size // length, 1)
    bounds = [length * number for number in range(count)] + [size]
    return [slice(start, stop) for start, stop in pairwise(bounds)]


def each(run: Pass, size: int) -> None:
    """Run a pass over all pieces of vectors of a size."""
    workers().share(run, pieces(size, piece_length(size)))


def each_long(run: Pass, size: int) -> None:
    """Run a pass over all pieces of long vectors, and over short ones at once."""
    if size < SHORT:
        run(slice(0, size))
    else:
        each(run, size)


def each_row(run: Pass, rows: int, columns: int) -> None:
    """Run a pass over all pieces of an array's rows."""
    if rows * columns < SHORT:
        run(slice(0, rows))
    else:
        workers().share(run, pieces(rows, max(PIECE // columns, 1)))


def clear(field: Real) -> None:
    """Set a flat field to zero."""
    if field.size < SHORT:
        field.fill(0)
    else:
        each(lambda piece: field[piece].fill(0), field.size)


def combined(by: np.ufunc, a: Values, b: Values, out: Values | None = None) -> Values:
    """Return a function of two vectors entry by entry, in `out` if it is given."""
    if a.size < SHORT:
        result: Values = by(a, b, out=out)
        return result
    whole = np.empty_like(a) if out is None else out
    each(lambda piece: by(a[piece], b[piece], out=whole[piece]), a.size)
    return whole


def largest_of(measure: Callable[[slice], float], size: int) -> float:
    """Return the largest number that a measure finds in any piece; nan if there is one."""
    if size < SHORT:
        return measure(slice(0, size))
    found: list[float] = []
    each(lambda piece: found.append(measure(piece)), size)
    return float(np.max(found))


def sum_of(measure: Callable[[slice], float], size: int) -> float:
    """Add up the numbers that a measure finds in all pieces, in the order of the pieces."""
    found: dict[int, float] = {}

    def run(piece: slice) -> None:
        found[piece.start] = measure(piece)

    each(run, size)
    return sum(found[start] for start in sorted(found))


class _Scratch(threading.local):
    """Room for a piece in either precision, for each thread."""

    def __init__(self) -> None:
        self._rooms: dict[str, Real] = {}

    def room(self, size: int, dtype: str) -> Real:
        """Return room for some entries, which the next call on this thread takes again."""
        room = self._rooms.get(dtype)
        if room is None or room.size < size:
            room = self._rooms[dtype] = np.empty(max(size, 2**12), dtype)
        return room[:size]


_SCRATCH = _Scratch()


def room_for(piece: slice) -> Values:
    """Return room for a piece in double precision, which this thread's next pass takes again."""
    return _SCRATCH.room(piece.stop - piece.start, "d")


def take(values: Real, nodes: Nodes, out: Real | None = None) -> Real:
    """Return values[nodes], in `out` if it is given; the nodes must exist."""
    if is_short(nodes.size):
        if out is None or out.dtype == values.dtype:
            return values.take(nodes, out=out, mode="clip")
        out[:] = values.take(nodes, mode="clip")
        return out
    taken = np.empty(nodes.size, values.dtype) if out is None else out
    same = taken.dtype == values.dtype

    def run(piece: slice) -> None:
        here = nodes[piece]
        if same:
            np.take(values, here, out=taken[piece], mode="clip")
        else:
            room = _SCRATCH.room(here.size, values.dtype.char)
            np.take(values, here, out=room, mode="clip")
            taken[piece] = room

    each(run, nodes.size)
    return taken


def put(values: Real, places: Nodes, field: Real) -> None:
    """Set field[places] to values of either precision."""
    if is_short(places.size):
        field[places] = values if values.dtype == field.dtype else values.astype(field.dtype)
        return

    def run(piece: slice) -> None:
        here = values[piece]
        if here.dtype != field.dtype:
            room = _SCRATCH.room(here.size, field.dtype.char)
            room[:] = here
            here = room
        field[places[piece]] = here

    each(run, places.size)


def take_out(field: Real, places: Nodes, out: Values) -> None:
    """Move field[places] to `out` and leave zeros behind."""
    if is_short(places.size):
        out[:] = field.take(places, mode="clip")
        field[places] = 0
        return

    def run(piece: slice) -> None:
        here = places[piece]
        room = _SCRATCH.room(here.size, field.dtype.char)
        np.take(field, here, out=room, mode="clip")
        field[here] = 0
        out[piece] = room

    each(run, places.size)


def add_taken(target: Values, values: Real, nodes: Nodes) -> None:
    """Add values[nodes] to the target."""
    if is_short(nodes.size):
        target += values.take(nodes, mode="clip")
        return

    def run(piece: slice) -> None:
        here = nodes[piece]
        room = _SCRATCH.room(here.size, values.dtype.char)
        np.take(values, here, out=room, mode="clip")
        target[piece] += room

    each(run, nodes.size)


def add_scaled(target: Values, factor: float, values: Values) -> None:
    """Add factor times values to the target."""
    if target.size < SHORT:
        target += factor * values
        return

    def run(piece: slice) -> None:
        room = _SCRATCH.room(piece.stop - piece.start, "d")
        np.multiply(values[piece], factor, out=room)
        target[piece] += room

    each(run, target.size)


def add_product(target: Real, factor: float, values: Real) -> None:
    """Add factor times values of either precision to a target, both of them (rows, columns)."""

    def run(some: slice) -> None:
        here = values[some]
        room = _SCRATCH.room(here.size, "d").reshape(here.shape)
        room[:] = here
        room *= factor
        target[some] += room

    each_row(run, *target.shape)


def add_taken_product(target: Values, factor: float, values: Real, nodes: Nodes) -> None:
    """Add factor times values[nodes], of either precision, to the target."""
    if is_short(nodes.size):
        taken = values.take(nodes, mode="clip")
        target += np.multiply(taken, factor, dtype=np.float64)
        return

    def run(piece: slice) -> None:
        here = nodes[piece]
        taken = _SCRATCH.room(here.size, values.dtype.char)
        np.take(values, here, out=taken, mode="clip")
        if taken.dtype == target.dtype:
            taken *= factor
            target[piece] += taken
            return
        room = _SCRATCH.room(here.size, "d")
        room[:] = taken
        room *= factor
        target[piece] += room

    each(run, nodes.size)


def scale_and_add(target: Values, factor: float, values: Values) -> None:
    """Multiply the target by a factor and add values."""
    if target.size < SHORT:
        target *= factor
        target += values
        return

    def run(piece: slice) -> None:
        here = target[piece]
        here *= factor
        here += values[piece]

    each(run, target.size)


def keep_positive(target: Values) -> None:
    """Set negative entries to zero."""
    if target.size < SHORT:
        np.maximum(target, 0, out=target)
        return

    def run(piece: slice) -> None:
        np.maximum(target[piece], 0, out=target[piece])

    each(run, target.size)


def anywhere(test: Callable[[slice], Mask], size: int) -> bool:
    """Return whether a test of pieces holds at any position."""
    return largest_of(lambda piece: float(test(piece).any()), size) > 0


def largest_magnitude(values: Values) -> float:
    """Return the largest magnitude; nan if there is one, and 0 for no values."""

    def measure(piece: slice) -> float:
        here = values[piece]
        most, least = np.maximum.reduce(here, initial=0.0), np.minimum.reduce(here, initial=0.0)
        return max(float(most), -float(least))

    return largest_of(measure, values.size)


def where(test: Callable[[slice], Mask], size: int) -> Nodes:
    """Return the positions at which a test of pieces holds, in ascending order."""
    if is_short(size):
        nodes: Nodes = test(slice(0, size)).nonzero()[0]
        return nodes
    found: dict[int, Nodes] = {}

    def look(piece: slice) -> None:
        found[piece.start] = test(piece).nonzero()[0]

    each(look, size)
    starts = sorted(found)
    ends = np.cumsum([found[start].size for start in starts])
    positions = np.empty(ends[-1], np.intp)

    def collect(number: int) -> None:
        here = found[starts[number]]
        np.add(here, starts[number], out=positions[ends[number] - here.size : ends[number]])

    workers().share(collect, range(len(starts)))
    return positions


def joined(first: Nodes, second: Nodes) -> Nodes:
    """Return two lists of nodes as one."""
    if first.size < SHORT:
        return np.concatenate([first, second])
    whole = np.empty(first.size + second.size, np.intp)
    whole[first.size :] = second

    def run(piece: slice) -> None:
        whole[piece] = first[piece]

    each(run, first.size)
    return whole
