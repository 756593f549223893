"""Real speed-up: the same rows alone, with one worker and with two, and what the machine allows.

Two processors that share a clock, a cache or a memory bus are not twice as fast as one. So every
round also runs two copies side by side that know nothing of each other: together they do twice the
rows, and what they gain over one alone bounds what any farm could gain.
"""

import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median

from bench.scale.launch import launch

RANKS = {"alone": 0, "1 worker": 2, "2 workers": 3}
"""Runs of a round, and their ranks: 0 is without MPI; rank 0 of the others is the master."""

COPIES = "2 copies"
"""The run of two processes alone, side by side."""


@dataclass(frozen=True)
class Turn:
    """Generation times of one round, and how busy the machine was meanwhile.

    Attributes
    ----------
    wall : by run, time of the generation, without start-up [s]; of the copies, the mean of both
    busy : by run, share of all processors in use, by this run and by others [1]
    """

    wall: dict[str, float]
    busy: dict[str, float]

    @property
    def speedup(self) -> float:
        """Two workers over one [1]."""
        return self.wall["1 worker"] / self.wall["2 workers"]

    @property
    def over_alone(self) -> float:
        """Two workers over a run without MPI [1]."""
        return self.wall["alone"] / self.wall["2 workers"]

    @property
    def ceiling(self) -> float:
        """Two copies side by side over one: what two processors of this machine can do [1]."""
        return 2 * self.wall["alone"] / self.wall[COPIES]


def measure(
    rows: int = 1000, rounds: int = 5, remark: Callable[[str], None] = lambda line: None
) -> list[Turn]:
    """Generate the first rows of `paper` alone, with workers and in two copies, in turn.

    Parameters
    ----------
    rows : of the database
    rounds : repetitions; each second one goes backwards
    remark : told of each round
    """
    runs: dict[str, Callable[[], tuple[float, float]]] = {
        name: partial(_generate, ranks, rows) for name, ranks in RANKS.items()
    }
    runs[COPIES] = partial(_side_by_side, rows)
    turns = []
    for number in range(rounds):
        wall, busy = {}, {}
        for name in runs if number % 2 == 0 else reversed(runs):
            wall[name], busy[name] = runs[name]()
        turn = Turn(wall, busy)
        times = ", ".join(f"{name} {wall[name]:.2f} s ({busy[name]:.0%} busy)" for name in runs)
        remark(
            f"{times}: speed-up {turn.speedup:.2f} over 1 worker, {turn.over_alone:.2f} over alone,"
            f" of {turn.ceiling:.2f}"
        )
        turns.append(turn)
    return turns


def summary(turns: list[Turn]) -> str:
    """Medians and extremes in one line each."""
    lines = []
    for what, ratios in (
        ("2 workers over 1 worker", [turn.speedup for turn in turns]),
        ("2 workers over a run alone", [turn.over_alone for turn in turns]),
        ("2 copies over one: the machine's bound", [turn.ceiling for turn in turns]),
        ("2 workers over a run alone, of that bound", [t.over_alone / t.ceiling for t in turns]),
    ):
        lines.append(
            f"{what}: {median(ratios):.2f} (median of {len(ratios)} rounds,"
            f" {min(ratios):.2f} to {max(ratios):.2f})"
        )
    return "\n".join(lines)


def _generate(ranks: int, rows: int, meeting: str = "", peers: int = 1) -> tuple[float, float]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.toml").write_text(f"samples = {rows}\n")
        arguments = {
            "scene": "scene.toml",
            "output": "rows.h5",
            "meeting": meeting,
            "peers": peers,
        }
        answer = launch(ranks, "bench.scale.generation", arguments, folder)
    return float(answer["wall"]), float(answer["busy"])


def _side_by_side(rows: int) -> tuple[float, float]:
    """Two runs without MPI that begin together; mean time, and how busy the machine was."""
    with tempfile.TemporaryDirectory() as meeting, ThreadPoolExecutor(2) as pool:
        both = list(pool.map(lambda _: _generate(0, rows, meeting, 2), range(2)))
    (first, first_busy), (second, second_busy) = both
    return (first + second) / 2, (first_busy + second_busy) / 2
