"""The simulation beside real runs on this machine."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.report import remark
from bench.scale.costs import Costs
from bench.scale.launch import launch
from bench.scale.simulation import Writer, simulate
from bench.scale.speedup import generate
from gen.database import Reader
from gen.generation import plan
from gen.generation.run import blocks_of

# Relative error of the simulated time that is still right; on a machine with no other users.
TOLERANCE = 0.25
MILLISECONDS = 4.0  # that a row of the sleeping workers takes [ms]
ROWS = 1000  # rows of the real generation

CASES = (
    (2, 64, 1500, True),
    (7, 64, 6000, True),
    (15, 64, 12_000, True),
    (15, 16, 6000, True),
    (15, 4, 4000, False),
    (15, 1, 1500, False),
    (15, 1, 800, True),
)
"""Workers that sleep, rows of a block at most (blocks shrink to the end as they always do), rows in
all, and whether the master writes: from workers that are always busy to a master that is."""


def compare(costs: Costs) -> list[dict[str, Any]]:
    """Run and simulate workers that sleep, and a real generation with two workers [s]."""
    rows = []
    pairs = [pair for case in CASES for pair in _sleeping(costs, *case)]
    for run, real, simulated in [*pairs, _generating(costs)]:
        error = simulated / real - 1.0
        remark(f"{run}: {real:.2f} s, simulated {simulated:.2f} s ({error:+.0%})")
        times = {"real_seconds": real, "simulated_seconds": simulated}
        rows.append({"run": run, **times, "relative_error": error})
    return rows


def _sleeping(
    costs: Costs, workers: int, largest: int, total: int, write: bool
) -> list[tuple[str, float, float]]:
    """Let workers sleep for as long as their rows take: the whole time, and the master's work.

    The latter is processor time, which other users of the machine disturb less.
    """
    ranges = [(0, total)]
    blocks = list(
        plan.blocks(ranges, samples=total, samples_per_surface=1, workers=workers, largest=largest)
    )
    each = 1e-3 * MILLISECONDS
    tasks = [(block, each * (block[1] - block[0])) for block in blocks]
    arguments = {"tasks": tasks, "output": "rows.h5" if write else ""}
    with tempfile.TemporaryDirectory() as folder:
        (timing,) = launch(workers + 1, "bench.scale.probe", arguments, Path(folder))
    writer: Writer = "master" if write else "nobody"
    simulated = simulate(blocks, np.full(total, each), workers, costs, write=writer)
    what = (
        f"{workers} workers asleep, {total} rows of {MILLISECONDS:g} ms in blocks of"
        f" {largest} at most, {'written' if write else 'not written'}"
    )
    master = simulated.busy * simulated.makespan
    return [
        (what, timing["wall"], simulated.makespan),
        ("the master's work therein", timing["master"], master),
    ]


def _generating(costs: Costs) -> tuple[str, float, float]:
    """Let two workers solve; simulate with the times that the rows themselves took."""
    with tempfile.TemporaryDirectory() as name:
        wall, _ = generate(3, ROWS, folder=Path(name))
        with Reader(Path(name) / "rows.h5") as reader:
            scene = reader.scene
            seconds = reader.column("solve_seconds") + reader.column("surface_seconds")
    blocks = blocks_of(scene, [(0, ROWS)], 2)
    simulated = simulate(blocks, seconds, 2, costs, write="master")
    return f"2 workers at work, {ROWS} rows of the paper's scene", wall, simulated.makespan
