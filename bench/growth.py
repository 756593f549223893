"""How the cost of a solve grows with the grid: the reason for a start from a coarser one.

`python -m bench growth` presses nested surfaces, each with twice the nodes a side of the one
before, until the same share of their nodes is in contact, and counts applications of the influence
matrix, seconds and memory. Counts do not depend on the machine's load, and are those of iterations
alone: dense algebra, which only small grids have few enough nodes in contact for, would pass for
growth. Seconds and memory are those of a solve as it comes.
"""

import time
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from scipy import optimize

import bem
from bem import half_space
from bem.convolution import fast_period
from bench.page.content import Content, Figure, Table
from bench.picture import new_figure
from bench.report import Report
from bench.style import STYLES
from bench.table import markdown
from gen.arrays import Heights
from gen.runtime.errors import InputError
from gen.surface import generate

SIDE = 1000.0  # um
HURST, SIGMA0 = 0.65, 12.5  # 1, um
PERCENTS = (1.0, 10.0, 50.0)
NODES = (129, 257, 513, 1025)
RTOL = 1e-6
SEEKING_RTOL = 1e-2  # of the solves on small grids that find Delta
SEEKING_NODES = (65, 129)
WANTED_GROWTH = 1.3
WANTED_MEMORY = 12.0


@dataclass(frozen=True)
class Row:
    """The cost of solves of one size, means over surfaces.

    Attributes
    ----------
    percent : share of the nodes in contact that was aimed at [%]
    nodes : nodes a side
    area_percent : share that was reached [%]
    convolutions : applications of the influence matrix without dense algebra, those on coarser
        grids by their share of the nodes
    growth : factor of `convolutions` per doubling of the nodes a side, from the smallest grid on
    seconds : wall time of a solve [s]
    padded_arrays : largest memory, tables and plans included, over that of one double-precision
        field on the doubled grid
    """

    percent: float
    nodes: int
    area_percent: float
    convolutions: float
    growth: float
    seconds: float
    padded_arrays: float


def growth(
    nodes: Sequence[int] = NODES,
    surfaces: int = 3,
    percents: Sequence[float] = PERCENTS,
    remark: Callable[[str], None] = lambda _: None,
) -> list[Row]:
    """Solve on ever finer grids.

    Parameters
    ----------
    nodes : nodes a side, each 2^k + 1, ascending
    surfaces : number of surfaces, each of its own seed
    percents : shares of the nodes in contact [%]
    remark : told about every solve

    Returns
    -------
    One row per share and grid

    Raises
    ------
    InputError
        For nodes that are not 2^k + 1, or too few
    """
    for size in nodes:
        if size < SEEKING_NODES[0] or size - 1 & size - 2:
            raise InputError(f"nodes {size}: give 2^k + 1, {SEEKING_NODES[0]} or more")
    rows = []
    for percent in percents:
        first: Row | None = None
        for size in nodes:
            solves = []
            for seed in range(surfaces):
                solves.append(_solve(size, seed, _displacement(size, seed, percent)))
                remark(f"{percent:g} %, {size} nodes, seed {seed}: {solves[-1][2]:.2f} s")
            area, convolutions, seconds, _ = np.mean(solves, axis=0).tolist()
            memory = max(solve[-1] for solve in solves)
            row = Row(percent, size, area, convolutions, 1.0, seconds, memory)
            first = first or row
            rows.append(replace(row, growth=_growth(first, row)))
    return rows


def report(rows: Sequence[Row]) -> Report:
    """Return the table, the picture and the words of a report."""
    return Report({"growth": rows}, pictures={"growth": _picture(rows)}, text=in_words(rows))


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that holds this report."""
    return [
        Figure(
            folder / "growth.png",
            "Convolutions, seconds and memory of a solve over the nodes a side, at 1, 10 and 50 %"
            " of the nodes in contact. Seconds grow with the nodes times their logarithm, and with"
            " the convolutions.",
            data=(folder / "growth.csv",),
        ),
        Table(
            folder / "growth.csv",
            "Growth is per doubling of the nodes a side, from the first grid on. Convolutions are"
            " those of iterations alone: dense algebra, for which only small grids have few enough"
            " nodes in contact, would pass for growth.",
        ),
    ]


def in_words(rows: Sequence[Row]) -> str:
    """Return lines of Markdown: a row per share and grid, and whether the marks are met."""
    table = markdown(
        ("contact", "nodes", "convolutions", "growth", "seconds", "memory"),
        (
            (
                *(f"{row.area_percent:.1f} %", f"{row.nodes}", f"{row.convolutions:.1f}"),
                *(f"{row.growth:.2f}", f"{row.seconds:.3g}", f"{row.padded_arrays:.1f}"),
            )
            for row in rows
        ),
    )
    largest = max(row.growth for row in rows if row.nodes == rows[-1].nodes)
    memory = max(row.padded_arrays for row in rows)
    verdict = (
        f"Growth per doubling up to {rows[-1].nodes} nodes: at most {largest:.2f}"
        f" (mark {WANTED_GROWTH:g}); memory: at most {memory:.1f} padded arrays"
        f" (mark {WANTED_MEMORY:g})."
    )
    return f"{table}\n\n{verdict}"


def _picture(rows: Sequence[Row]) -> Any:
    """Convolutions, seconds and memory over the nodes a side."""
    figure = new_figure(11, 3.6)
    panels = figure.subplots(1, 3)
    for panel, column, label in zip(
        panels,
        ("convolutions", "seconds", "padded_arrays"),
        ("applications of H", "wall time of a solve [s]", "memory [padded fields]"),
        strict=True,
    ):
        for number, percent in enumerate(dict.fromkeys(row.percent for row in rows)):
            mine = [row for row in rows if row.percent == percent]
            x, y = [row.nodes for row in mine], [getattr(row, column) for row in mine]
            panel.plot(x, y, label=f"{percent:g} % in contact", **STYLES[number % len(STYLES)])
        panel.set(xscale="log", ylabel=label, xlabel="nodes a side")
        nodes = sorted({row.nodes for row in rows})
        panel.set_xticks(nodes, [str(size) for size in nodes])
        panel.minorticks_off()
    panels[0].set(ylim=(0, None))
    panels[1].set(yscale="log")
    panels[2].axhline(WANTED_MEMORY, color="0.6", ls=":")
    panels[2].set(ylim=(0, None))
    panels[0].legend()
    return figure


def _growth(first: Row, row: Row) -> float:
    """Factor of the convolutions per doubling of the nodes a side [1]."""
    doublings = np.log2((row.nodes - 1) / (first.nodes - 1)) if row is not first else 1.0
    return float((row.convolutions / first.convolutions) ** (1 / doublings))


def surface(nodes: int, seed: int) -> Heights:
    """Generate one of the surfaces; grids of one seed hold each other's nodes."""
    return generate("diamond-square", nodes, HURST, SIGMA0, np.random.default_rng(seed))


def _displacement(nodes: int, seed: int, percent: float) -> float:
    """Delta that brings about such a share into contact, from its growth on small grids [um]."""

    def excess(delta: float, heights: Heights) -> float:
        return bem.solve(heights, SIDE, delta, rtol=SEEKING_RTOL).area_percent - percent

    found = []
    for small in SEEKING_NODES:
        heights = surface(small, seed)
        deepest = 3 * float(heights.max() - heights.min())
        found.append(optimize.brentq(excess, 0.0, deepest, args=(heights,), xtol=1e-2))
    doublings = np.log2((nodes - 1) / (SEEKING_NODES[-1] - 1))
    return float(found[-1] * (found[-1] / found[-2]) ** doublings)


def _solve(nodes: int, seed: int, delta: float) -> tuple[float, float, float, float]:
    """Area [%], convolutions, seconds and padded arrays of memory of a solve, see `Row`.

    Memory comes first, as the first solve of a size needs most of it; then time and counts.
    """
    heights = surface(nodes, seed)
    field_bytes = 8 * fast_period(nodes) ** 2
    tracemalloc.start()
    try:
        bem.solve(heights, SIDE, delta, rtol=RTOL)
        memory = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    began = time.perf_counter()
    contact = bem.solve(heights, SIDE, delta, rtol=RTOL)
    seconds = time.perf_counter() - began
    if contact.contact_nodes <= half_space.FEW_PER_ROOT * np.cbrt(heights.size):
        with mock.patch.object(half_space, "FEW_PER_ROOT", 0.0):
            contact = bem.solve(heights, SIDE, delta, rtol=RTOL)
    return contact.area_percent, contact.convolutions, seconds, memory / field_bytes
