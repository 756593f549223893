"""How the cost of a solve grows with the grid, and how area and mean pressure depend on it.

Nested surfaces, each with twice the nodes a side of the one before, are pressed until the same
share of their nodes is in contact. Counts of applications of the influence matrix are those of
iterations alone: dense algebra, for which only small grids have few enough nodes in contact, would
pass for growth. Then the same surfaces are pressed by the same mean pressure: with every halving of
the spacing slopes grow, and the elastic area falls, until a hardness bounds the pressure.
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
from bem.operators.patch import fast_period
from bench.files import Row
from bench.report import Report, remark
from gen.arrays import Heights
from gen.quantities import AREA, YIELDED
from gen.runtime.errors import InputError
from gen.surface import generate

SIDE = 1000.0  # um
HURST, SIGMA0 = 0.65, 12.5  # 1, um
PERCENTS = (1.0, 10.0, 50.0)
RTOL = 1e-6
SEEKING_RTOL = 1e-2  # of the solves on small grids that find Delta
SEEKING_NODES = (65, 129)
PRESSURE = 2e-3  # on the patch [E*]
HARDNESSES = (None, 0.1, 0.05, 0.02)  # E*


def growth(nodes: Sequence[int], surfaces: int) -> Report:
    """Measure the cost of solves, and area and pressure under one load.

    An InputError is raised for nodes a side that are not 2^k + 1, or too few.
    """
    for size in nodes:
        if size < SEEKING_NODES[0] or size - 1 & size - 2:
            raise InputError(f"nodes {size}: give 2^k + 1, {SEEKING_NODES[0]} or more")
    return Report(
        {"growth": cost(nodes, surfaces), "yielding": pressures(nodes, surfaces)}
    )


def cost(
    nodes: Sequence[int], surfaces: int, percents: Sequence[float] = PERCENTS
) -> list[Row]:
    """Measure the cost of solves at shares of contact on grids, as means over surfaces."""
    rows: list[Row] = []
    fewest = 1.0
    for percent, size in product(percents, nodes):
        solves = []
        for seed in range(surfaces):
            with ThreadPoolExecutor(
                1
            ) as fresh:  # it keeps no tables of the solves before
                solves.append(fresh.submit(_solve, size, seed, percent).result())
        means = {
            name: float(np.mean([each[name] for each in solves])) for name in solves[0]
        }
        fewest = means["convolutions"] if size == nodes[0] else fewest
        doublings = max(np.log2((size - 1) / (nodes[0] - 1)), 1.0)
        growth = float((means["convolutions"] / fewest) ** (1 / doublings))
        most = {"padded_arrays": max(each["padded_arrays"] for each in solves)}
        rows.append(
            {"percent": percent, "nodes": size, **means, **most, "growth": growth}
        )
        remark(f"{percent:g} %, {size} nodes: {means['seconds']:.2f} s")
    return rows


def pressures(nodes: Sequence[int], surfaces: int) -> list[Row]:
    """Press the same surfaces with the same mean pressure on each grid, as means over surfaces."""
    rows = []
    for hardness, size in product(HARDNESSES, nodes):
        contacts = [
            bem.solve(surface(size, seed), SIDE, pressure=PRESSURE, hardness=hardness)
            for seed in range(surfaces)
        ]
        row: Row = {"hardness": hardness, "nodes": size}
        for name in (AREA.name, YIELDED.name):
            row[name] = float(np.mean([getattr(contact, name) for contact in contacts]))
        row["mean_pressure"] = float(
            np.mean([100 * PRESSURE / c.area_percent for c in contacts])
        )
        row["convolutions"] = float(
            np.mean([contact.convolutions for contact in contacts])
        )
        remark(f"hardness {hardness}, {size} nodes: {row['area_percent']:.3g} %")
        rows.append(row)
    return rows


def surface(nodes: int, seed: int) -> Heights:
    """Generate one of the surfaces; grids of one seed hold each other's nodes."""
    return generate("diamond-square", nodes, HURST, SIGMA0, np.random.default_rng(seed))


def displacement_at(nodes: int, seed: int, percent: float) -> float:
    """Find the Delta of a share of contact [%] from its growth on small grids [um]."""

    def excess(delta: float, heights: Heights) -> float:
        return bem.solve(heights, SIDE, delta, rtol=SEEKING_RTOL).area_percent - percent

    found = []
    for small in SEEKING_NODES:
        heights = surface(small, seed)
        deepest = 3 * float(np.ptp(heights))
        found.append(optimize.brentq(excess, 0.0, deepest, args=(heights,), xtol=1e-2))
    doublings = np.log2((nodes - 1) / (SEEKING_NODES[-1] - 1))
    return float(found[-1] * (found[-1] / found[-2]) ** doublings)


def _solve(nodes: int, seed: int, percent: float) -> dict[str, float]:
    """Return area, convolutions, seconds, and memory over that of a padded double field.

    The first solve of a size needs most memory, tables and plans included; then time and counts.
    """
    heights, delta = surface(nodes, seed), displacement_at(nodes, seed, percent)
    tracemalloc.start()
    try:
        bem.solve(heights, SIDE, delta, rtol=RTOL)
        memory = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    began = time.perf_counter()
    contact = bem.solve(heights, SIDE, delta, rtol=RTOL)
    seconds = time.perf_counter() - began
    ((factor, power),) = patch.FEW_FREE
    if contact.contact_nodes <= factor * heights.size**power:
        with mock.patch.object(patch, "FEW_FREE", ((0.0, 1.0),)):
            contact = bem.solve(heights, SIDE, delta, rtol=RTOL)
    found = {"area_percent": contact.area_percent, "convolutions": contact.convolutions}
    return {
        **found,
        "seconds": seconds,
        "padded_arrays": memory / (8 * fast_period(nodes) ** 2),
    }
