"""How the cost of a solve grows with the grid, and how area and mean pressure depend on the grid.

Nested surfaces, each with half the spacing of the coarser one, are pressed until the same share of
their nodes is in contact. Convolutions are counted without dense algebra. It would save
convolutions on small grids alone, which have few nodes in contact, so that the number would seem to
grow.

Then the same surfaces are pressed by the same mean pressure. Slopes grow whenever the spacing is
halved, so that the elastic area falls, until a hardness limits the pressure.
"""

import time
import tracemalloc
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from unittest import mock

import numpy as np
from scipy import optimize

import bem
from bem.operators import patch
from bem.operators.displacement import fast_period
from bench.files import Row
from bench.report import Report, remark
from gen.arrays import Heights
from gen.quantities import AREA, YIELDED
from gen.runtime.errors import InputError
from gen.surface import generate

SIDE = 1000.0
"""Scan length [um]."""

HURST = 0.65
"""The generator's Hurst exponent."""

SIGMA0 = 12.5
"""Standard deviation of the generator's first displacement [um]."""

PERCENTS = (1.0, 10.0, 50.0)
"""Shares of the nodes in contact [%]."""

RTOL = 1e-6
"""Relative tolerance of the measured solves."""

SEEKING_RTOL = 1e-2
"""Relative tolerance of the solves on small grids by which Delta is found."""

SEEKING_NODES = (65, 129)
"""Nodes a side of the two small grids on which Delta is found."""

PRESSURE = 2e-3
"""Mean pressure on the patch over E* [1]."""

HARDNESSES = (None, 0.1, 0.05, 0.02)
"""Hardnesses over E* [1]; None for elastic bodies."""


def growth(nodes: Sequence[int], surfaces: int) -> Report:
    """Measure cost at given shares of contact, and area and pressure under one load, on all grids.

    Progress is printed on standard error.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side of the grids, 2^k + 1 each, the coarsest one first.
    surfaces : int
        Number of surfaces.

    Returns
    -------
    Report
        Tables `growth`, from `cost`, and `yielding`, from `pressures`.

    Raises
    ------
    InputError
        If a number of nodes is not 2^k + 1, or is smaller than the first of `SEEKING_NODES`.
    """
    require_nested(nodes)
    return Report(
        {"growth": cost(nodes, surfaces), "yielding": pressures(nodes, surfaces)}
    )


def require_nested(nodes: Sequence[int]) -> None:
    """Raise an error if nodes a side are not those of grids on which surfaces are nested.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side.

    Raises
    ------
    InputError
        If a number is not 2^k + 1, or is smaller than the first of `SEEKING_NODES`.
    """
    for size in nodes:
        cells = size - 1
        is_power_of_two = not cells & (cells - 1)  # only one bit is set
        if size < SEEKING_NODES[0] or not is_power_of_two:
            raise InputError(f"nodes {size}: give 2^k + 1, {SEEKING_NODES[0]} or more")


def cost(
    nodes: Sequence[int], surfaces: int, percents: Sequence[float] = PERCENTS
) -> list[Row]:
    """Measure the cost of solves at shares of contact.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side of the grids, the coarsest one first.
    surfaces : int
        Number of surfaces.
    percents : sequence of float
        Shares of the nodes in contact [%].

    Returns
    -------
    list of Row
        One row for each share and grid, with the values of `_solve` averaged over the surfaces;
        `padded_arrays` is the largest value instead. `growth` is the factor by which the
        convolutions grow for each doubling of the cells a side, averaged since the coarsest grid.
    """
    rows: list[Row] = []
    coarsest_convolutions = 1.0
    for percent, size in product(percents, nodes):
        solves = [_solve_in_new_thread(size, seed, percent) for seed in range(surfaces)]
        row: Row = {"percent": percent, "nodes": size}
        for name in solves[0]:
            row[name] = float(np.mean([solve[name] for solve in solves]))
        row["padded_arrays"] = max(solve["padded_arrays"] for solve in solves)
        if size == nodes[0]:  # the first grid of each share
            coarsest_convolutions = row["convolutions"]
        factor = row["convolutions"] / coarsest_convolutions
        # The coarsest grid has no doubling: with 1 instead of 0 its growth is 1.
        doublings = max(np.log2((size - 1) / (nodes[0] - 1)), 1.0)
        row["growth"] = float(factor ** (1 / doublings))
        remark(f"{percent:g} %, {size} nodes: {row['seconds']:.2f} s")
        rows.append(row)
    return rows


def _solve_in_new_thread(nodes: int, seed: int, percent: float) -> dict[str, float]:
    """Measure a solve as `_solve` does, in a thread that has no tables of earlier solves."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(_solve, nodes, seed, percent).result()


def pressures(nodes: Sequence[int], surfaces: int) -> list[Row]:
    """Press the same surfaces with the same mean pressure on each grid.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side of the grids.
    surfaces : int
        Number of surfaces.

    Returns
    -------
    list of Row
        One row for each of `HARDNESSES` and each grid, with means over the surfaces: the shares of
        the area in contact and of the yielded area [%], `mean_pressure`, the mean pressure in
        contact over E*, and the convolutions.
    """
    rows = []
    for hardness, size in product(HARDNESSES, nodes):
        contacts = [
            bem.solve(surface(size, seed), SIDE, pressure=PRESSURE, hardness=hardness)
            for seed in range(surfaces)
        ]
        row: Row = {"hardness": hardness, "nodes": size}
        for name in (AREA.name, YIELDED.name):
            row[name] = float(np.mean([getattr(contact, name) for contact in contacts]))
        pressures_in_contact = [
            100 * PRESSURE / contact.area_percent for contact in contacts
        ]
        row["mean_pressure"] = float(np.mean(pressures_in_contact))
        row["convolutions"] = float(
            np.mean([contact.convolutions for contact in contacts])
        )
        remark(f"hardness {hardness}, {size} nodes: {row['area_percent']:.3g} %")
        rows.append(row)
    return rows


def surface(nodes: int, seed: int) -> Heights:
    """Generate one of the surfaces.

    Parameters
    ----------
    nodes : int
        Nodes a side, 2^k + 1.
    seed : int
        Number of the surface. A finer grid of the same seed keeps the nodes of a coarser one.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um].
    """
    return generate("diamond-square", nodes, HURST, SIGMA0, np.random.default_rng(seed))


def displacement_at(nodes: int, seed: int, percent: float) -> float:
    """Estimate the Delta that brings a share of the nodes into contact.

    Delta is found on two small grids. The ratio of both is assumed for each further doubling of the
    cells a side.

    Parameters
    ----------
    nodes : int
        Nodes a side of the grid.
    seed : int
        Number of the surface.
    percent : float
        Share of the nodes in contact [%].

    Returns
    -------
    float
        Delta [um].
    """

    def excess(delta: float, heights: Heights) -> float:
        """Return the share in contact at a Delta [um] less the wanted share [%]."""
        return bem.solve(heights, SIDE, delta, rtol=SEEKING_RTOL).area_percent - percent

    deltas = []
    for small in SEEKING_NODES:
        heights = surface(small, seed)
        deepest = 3 * float(np.ptp(heights))
        deltas.append(optimize.brentq(excess, 0.0, deepest, args=(heights,), xtol=1e-2))
    coarse, fine = deltas
    doublings = np.log2((nodes - 1) / (SEEKING_NODES[-1] - 1))
    return float(fine * (fine / coarse) ** doublings)


def _solve(nodes: int, seed: int, percent: float) -> dict[str, float]:
    """Return area [%], convolutions, time [s], and the memory of a solve, by column names.

    The memory is divided by that of a padded field of doubles. It is the peak of the first solve,
    which makes tables and plans. The time is that of the second solve. Area and convolutions are of
    the second solve too, or of a third one without dense algebra if the second one used it.
    """
    heights = surface(nodes, seed)
    delta = displacement_at(nodes, seed, percent)
    tracemalloc.start()
    try:
        bem.solve(heights, SIDE, delta, rtol=RTOL)
        memory = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    began = time.perf_counter()
    contact = bem.solve(heights, SIDE, delta, rtol=RTOL)
    seconds = time.perf_counter() - began
    # `FEW_FREE` bounds the number of nodes in contact for which the solver uses dense algebra.
    ((factor, power),) = patch.FEW_FREE
    most_for_dense = factor * heights.size**power
    if contact.contact_nodes <= most_for_dense:
        never = ((0.0, 1.0),)
        with mock.patch.object(patch, "FEW_FREE", never):
            contact = bem.solve(heights, SIDE, delta, rtol=RTOL)
    return {
        "area_percent": contact.area_percent,
        "convolutions": contact.convolutions,
        "seconds": seconds,
        "padded_arrays": memory / (8 * fast_period(nodes) ** 2),  # 8 bytes a double
    }
