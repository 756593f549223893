"""Where the nodes of a grid lie in the wider field of a filter."""

from functools import lru_cache
from typing import Any

import numpy as np

from bem.arrays import Nodes
from bem.vectors import SHORT, each


def is_whole(shape: tuple[int, int], nodes: Nodes) -> bool:
    """Return whether a list of nodes is that of the whole grid, in its order."""
    size = shape[0] * shape[1]
    return nodes.size == size and bool((nodes == np.arange(size)).all())


def node_places(shape: tuple[int, int], across: int, nodes: Nodes) -> Nodes:
    """Return the indices of nodes of (nx, ny) in a flat field with `across` columns."""
    if shape[0] * across < SHORT:
        return _all_places(shape, across)[nodes]
    places = np.empty_like(nodes)
    short = _short_integers(shape[0] * across)

    def run(piece: slice) -> None:
        here = nodes[piece].astype(short)
        rows = here // short(shape[1])
        rows *= short(across - shape[1])
        here += rows
        places[piece] = here

    each(run, nodes.size)
    return places


def places_and_blocks(
    shape: tuple[int, int], across: int, nodes: Nodes, block: int
) -> tuple[Nodes, Nodes]:
    """Return the places of nodes, and the blocks of the field that they lie in.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    across : int
        Columns of the field, a whole number of blocks.
    nodes : ndarray, shape (a,)
        Flat indices of the nodes.
    block : int
        Nodes a side of a block, a power of two.

    Returns
    -------
    places, blocks : ndarray, shape (a,)
        Flat indices of the entries of the field, and of their blocks.
    """
    places, blocks = np.empty_like(nodes), np.empty_like(nodes)
    short, shift = _short_integers(shape[0] * across), block.bit_length() - 1

    def run(piece: slice) -> None:
        here = nodes[piece].astype(short)
        rows = here // short(shape[1])
        step = rows * short(across - shape[1])
        step += here
        places[piece] = step
        np.multiply(rows, short(shape[1]), out=step)
        here -= step  # the columns
        here >>= shift
        rows >>= shift
        rows *= short(across >> shift)
        rows += here
        blocks[piece] = rows

    each(run, nodes.size)
    return places, blocks


def _short_integers(largest: int) -> type[np.signedinteger[Any]]:
    """Return the shorter integers that hold a number: vectors of them are divided much faster."""
    return np.int32 if largest <= np.iinfo(np.int32).max else np.int64


@lru_cache(maxsize=16)
def _all_places(shape: tuple[int, int], across: int) -> Nodes:
    """Tabulate the places of all nodes of a small grid."""
    return np.arange(shape[0] * across).reshape(shape[0], across)[:, : shape[1]].reshape(-1)
