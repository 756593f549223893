"""The same contact problem on about every second node of its surface."""

from dataclasses import replace

import numpy as np

from bem.arrays import Field, Values
from bem.problem import Boundary, Problem

# Least tolerance of the coarser contact [Delta]: the errors that it allows are far below the
# difference from the finer contact. On 1,100 contacts the bars hold as many true errors as with
# 1e-4 (`asperity bench grid-error`).
COARSE_RTOL = 3e-3


def coarser(problem: Problem) -> Problem:
    """Return the same problem on about every second node along each axis.

    The coarser grid consists of nodes of the finer one where every second node covers the patch:
    with an even number of nodes on a patch that repeats itself, with an odd one on a free patch.
    Otherwise the surface is read between its nodes: by its own waves where the patch has no edges,
    by cubic splines on free patches. The outer nodes of a free patch stay on its border, so that
    its outer cells reach further beyond it. Where the problem has a datum of its own, the cells of
    both grids cover the same patch instead, and Delta counts from the same height.

    Parameters
    ----------
    problem : Problem
        The problem.

    Returns
    -------
    Problem
        The problem on the coarser grid, with the same load. Its tolerance is at least `COARSE_RTOL`
        over the `Problem.settlement_ratio`.
    """
    heights = problem.heights
    spacing = list(problem.spacing)
    for axis in (0, 1):
        if heights.shape[axis] == 1:  # there is nothing to halve
            continue
        places = _coarser_places(problem, axis)
        heights = _read(heights, axis, places, problem.boundary)
        spacing[axis] *= places[1] - places[0]
    if problem.kernel == "concentrated-force":  # it needs square cells, to the last digit
        spacing = [float(np.sqrt(spacing[0] * spacing[1]))] * 2
    datum = None
    if problem.datum is not None:
        datum = problem.datum_height - float(heights.max())
    return replace(
        problem,
        heights=heights,
        spacing=(spacing[0], spacing[1]),
        rtol=max(problem.rtol, COARSE_RTOL / problem.settlement_ratio),
        datum=datum,
    )


def at_coarser_nodes(problem: Problem, pressure: Field) -> Field:
    """Return a pressure at the nodes of a grid that are nearest to those of the coarser grid.

    Parameters
    ----------
    problem : Problem
        The problem on the grid.
    pressure : ndarray, shape (nx, ny)
        Contact pressure at its nodes [MPa].

    Returns
    -------
    ndarray, shape of the coarser heights
        The pressure, see `coarser` [MPa].
    """
    for axis in (0, 1):
        if pressure.shape[axis] > 1:
            places = _coarser_places(problem, axis)
            pressure = pressure.take(np.rint(places).astype(np.intp), axis)
    return pressure


def _coarser_places(problem: Problem, axis: int) -> Values:
    """Return the places of the coarser grid's nodes along an axis, (m,) [spacing].

    The outer nodes of both grids are on the border of a free patch without a datum. On other
    patches all nodes are centres of cells that cover the same length; cells of a periodic patch
    begin at its first node.
    """
    nodes = problem.heights.shape[axis]
    number = (nodes + 1) // 2
    places: Values = np.arange(number, dtype=np.float64)
    if problem.boundary == "free" and problem.datum is None:
        places *= (nodes - 1) / (number - 1)
        return places
    step = nodes / number
    places *= step
    if problem.boundary != "periodic":
        places += 0.5 * step - 0.5
    return places


def _read(heights: Field, axis: int, places: Values, boundary: Boundary) -> Field:
    """Return the heights [um] at places [spacing] along one axis, which may be between nodes."""
    nodes = heights.shape[axis]
    indices = places.astype(np.intp)
    if np.array_equal(indices, places):  # all places are nodes
        return np.ascontiguousarray(heights.take(indices, axis=axis))
    if boundary == "free":
        # Imported here, because few grids need it.
        from scipy.interpolate import make_interp_spline

        spline = make_interp_spline(np.arange(nodes), heights, 3, axis=axis)
        return np.ascontiguousarray(spline(places))
    weights = _wave_interpolation(nodes, places, boundary)
    read: Field = np.moveaxis(np.tensordot(weights, heights, (1, axis)), 0, axis)
    return np.ascontiguousarray(read)


def _wave_interpolation(nodes: int, places: Values, boundary: Boundary) -> Field:
    """Return weights of the nodes in the values at places, by trigonometric interpolation, (m, n).

    The waves have the period of a patch that repeats itself, or are cosines on a mirrored one.
    """
    at_nodes = np.arange(nodes)
    weights: Field
    if boundary == "periodic":
        exponents = 2j * np.pi / nodes * (at_nodes - (nodes - 1) // 2)
        waves = np.exp(np.outer(places, exponents))
        node_waves = np.exp(np.outer(at_nodes, exponents))
        weights = (waves @ node_waves.conj().T).real / nodes
        return weights
    numbers = np.pi / nodes * at_nodes
    cosines = np.cos(np.outer(places + 0.5, numbers))
    node_cosines = np.cos(np.outer(at_nodes + 0.5, numbers))
    weights = (cosines * np.where(numbers == 0, 1.0, 2.0)) @ node_cosines.T / nodes
    return weights
