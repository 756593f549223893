"""The simulation beside real runs on this machine."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from bench.scale.costs import Costs
from bench.scale.launch import launch
from bench.scale.simulation import simulate
from gen.database import Reader
from gen.generation import plan
from gen.generation.run import blocks_of

TOLERANCE = 0.25
"""Relative error of the simulated time that is still right; on a machine with no other users."""


@dataclass(frozen=True)
class Case:
    """A farm of sleeping workers.

    Attributes
    ----------
    workers : how many
    rows : of a block at most; the blocks shrink to the end as they always do
    total : rows in all
    milliseconds : that a row takes [ms]
    write : whether the master writes
    """

    workers: int
    rows: int
    total: int
    milliseconds: float
    write: bool


CASES = (
    Case(2, 64, 1500, 4.0, write=True),
    Case(7, 64, 6000, 4.0, write=True),
    Case(15, 64, 12_000, 4.0, write=True),
    Case(15, 16, 6000, 4.0, write=True),
    Case(15, 4, 4000, 4.0, write=False),
    Case(15, 1, 1500, 4.0, write=False),
    Case(15, 1, 800, 4.0, write=True),
)
"""From workers that are always busy to a master that is."""


@dataclass(frozen=True)
class Comparison:
    """A real run and its simulation [s]."""

    run: str
    real_seconds: float
    simulated_seconds: float

    @property
    def error(self) -> float:
        """How far the simulated time is off [1]."""
        return self.simulated_seconds / self.real_seconds - 1.0


def compare(
    costs: Costs, cases: Sequence[Case] = CASES, remark: Callable[[str], None] = lambda line: None
) -> list[Comparison]:
    """Run and simulate all cases, and a real generation with two workers.

    Parameters
    ----------
    costs : measured on this machine
    cases : of sleeping workers, so that there may be more of them than processors
    remark : told of each comparison
    """
    done = []
    acts: list[Callable[[Costs], list[Comparison]]] = [partial(_sleeping, case) for case in cases]
    acts.append(partial(_generating, 1000))
    for act in acts:
        for comparison in act(costs):
            remark(
                f"{comparison.run}: {comparison.real_seconds:.2f} s, simulated"
                f" {comparison.simulated_seconds:.2f} s ({comparison.error:+.0%})"
            )
            done.append(comparison)
    return done


def _sleeping(case: Case, costs: Costs) -> list[Comparison]:
    """Workers that sleep for as long as their rows take: the whole time, and the master's work.

    The latter is processor time, which other users of the machine disturb less.
    """
    blocks = list(
        plan.blocks(
            [(0, case.total)],
            samples=case.total,
            samples_per_surface=1,
            workers=case.workers,
            largest=case.rows,
        )
    )
    seconds = [1e-3 * case.milliseconds * (stop - start) for start, stop in blocks]
    output = "rows.h5" if case.write else ""
    arguments = {"blocks": blocks, "seconds": seconds, "output": output}
    with tempfile.TemporaryDirectory() as folder:
        timings = launch(case.workers + 1, "bench.scale.probe", arguments, Path(folder))
    rows = np.full(case.total, 1e-3 * case.milliseconds)
    simulated = simulate(
        blocks, rows, case.workers, costs, write="master" if case.write else "nobody"
    )
    what = (
        f"{case.workers} workers asleep, {case.total} rows of {case.milliseconds:g} ms in blocks of"
        f" {case.rows} at most, {'written' if case.write else 'not written'}"
    )
    return [
        Comparison(what, float(timings[0]["wall"]), simulated.makespan),
        Comparison(
            "the master's work therein",
            float(timings[0]["master"]),
            simulated.busy * simulated.makespan,
        ),
    ]


def _generating(rows: int, costs: Costs) -> list[Comparison]:
    """Two workers that solve, simulated with the times that the rows themselves took."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.toml").write_text(f"samples = {rows}\n")
        arguments = {"scene": "scene.toml", "output": "rows.h5"}
        answer = launch(3, "bench.scale.generation", arguments, folder)
        with Reader(folder / "rows.h5") as reader:
            scene = reader.scene
            seconds = reader.column("solve_seconds") + reader.column("surface_seconds")
    blocks = blocks_of(scene, [(0, rows)], 2)
    simulated = simulate(blocks, seconds, 2, costs, write="master")
    what = f"2 workers at work, {rows} rows of the paper's scene"
    return [Comparison(what, float(answer["wall"]), simulated.makespan)]
