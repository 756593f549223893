"""Nearly full contact with few gaps, solved by dense algebra on the nodes that are open.

`bem.nearly_full` states the problem. Hardly any entry off the diagonal of K is positive, so that an
open gap pulls at the nodes beside it. Whatever is under tension at full contact opens therefore,
and the set of open nodes grows from there until no tension is left: it takes two to four sets.
"""

from typing import NamedTuple

import numpy as np

from bem.arrays import Nodes, Real
from bem.factor import routines
from bem.interface import InterfaceMatrix
from bem.sections import on_one_blas_thread
from bem.spectrum import inverse_filter
from bem.vectors import SHORT
from bem.whole_patch import WholePatch, displaced_by

# Largest set of open nodes for which this takes less time than sparse algebra on neighbours.
FEW_OPEN = 400

# Sets of open nodes that are tried at most, with a transform each.
OPEN_SETS = 12


class Opened(NamedTuple):
    """The gaps of a contact that is nearly full.

    Attributes
    ----------
    nodes : ndarray, shape (a,)
        Flat indices of the nodes that are open.
    change : ndarray, shape (nx, ny)
        Change of the pressure of full contact by their gaps.
    transforms : int
        Transforms that this took.
    """

    nodes: Nodes
    change: Real
    transforms: int


@on_one_blas_thread()
def open_few(whole: WholePatch, full: Real, accuracy: float) -> Opened | None:
    """Open the nodes where full contact would pull, and solve, until no tension is left.

    Parameters
    ----------
    whole : WholePatch
        The influence matrix under the load.
    full : ndarray, shape (nx, ny)
        Pressure of full contact under the load, in single precision.
    accuracy : float
        Tension, or pressure on open gaps, that may be left.

    Returns
    -------
    Opened or None
        The open nodes; None if more than `FEW_OPEN` nodes open, if the sets do not come to an end,
        or if the grid is so large that a table of its coefficients does not pay.
    """
    nodes: Nodes = (full < 0).reshape(-1).nonzero()[0]
    if len(nodes) > FEW_OPEN or full.size >= SHORT:
        return None
    matrix = InterfaceMatrix(*whole.patch, "float32", inverse=True)
    inverse = inverse_filter(*whole.patch, "float32")
    pressure, values = full.reshape(-1), np.zeros(len(nodes), np.float32)
    for transforms in range(1, OPEN_SETS + 1):
        solved = routines("s").posv(matrix.among(nodes), pressure[nodes], lower=1, overwrite_a=1)
        if solved[2]:  # not positive definite in single precision
            return None
        values = values - solved[1]
        opened = values > 0
        nodes, values = nodes[opened], values[opened]
        change = displaced_by(inverse, (nodes, values))
        pressure = (full + change).reshape(-1)
        left = pressure[nodes]
        pressure[nodes] = 0
        if max(float(np.abs(left).max(initial=0)), -float(pressure.min())) <= accuracy:
            return Opened(nodes, change.copy(), transforms)
        more: Nodes = (pressure < 0).nonzero()[0]
        pressure[nodes] = left
        nodes, values = (
            np.append(nodes, more),
            np.append(values, np.zeros_like(full, shape=len(more))),
        )
        if len(nodes) > FEW_OPEN:
            return None
    return None
