"""Real speed-up: the same rows alone, with one worker and with two, in turn."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from bench.scale.launch import launch

RANKS = (0, 2, 3)
"""Alone; one worker; two workers: rank 0 is the master."""


@dataclass(frozen=True)
class Turn:
    """Generation times of one round, and how busy the machine was meanwhile.

    Attributes
    ----------
    wall : by ranks, time of the generation, without start-up [s]
    busy : by ranks, share of all processors in use, by this run and by others [1]
    """

    wall: dict[int, float]
    busy: dict[int, float]

    @property
    def speedup(self) -> float:
        """Two workers over one [1]."""
        return self.wall[2] / self.wall[3]

    @property
    def over_alone(self) -> float:
        """Two workers over a run without MPI [1]."""
        return self.wall[0] / self.wall[3]


def measure(
    rows: int = 1000, rounds: int = 5, remark: Callable[[str], None] = lambda line: None
) -> list[Turn]:
    """Generate the first rows of `paper` alone, with one and with two workers, in turn.

    Parameters
    ----------
    rows : of the database
    rounds : repetitions; each second one goes backwards
    remark : told of each round
    """
    turns = []
    for number in range(rounds):
        wall, busy = {}, {}
        for ranks in RANKS if number % 2 == 0 else RANKS[::-1]:
            wall[ranks], busy[ranks] = _generate(ranks, rows)
        turn = Turn(wall, busy)
        times = ", ".join(f"{wall[ranks]:.2f} s ({busy[ranks]:.0%} busy)" for ranks in RANKS)
        remark(
            f"alone, 1 worker, 2 workers: {times}; speed-up {turn.speedup:.2f} over 1 worker,"
            f" {turn.over_alone:.2f} over alone"
        )
        turns.append(turn)
    return turns


def summary(turns: list[Turn]) -> str:
    """Medians and extremes in one line each."""
    lines = []
    for what, ratios in (
        ("over 1 worker", [turn.speedup for turn in turns]),
        ("over a run alone", [turn.over_alone for turn in turns]),
    ):
        lines.append(
            f"2 workers {what}: {median(ratios):.2f} (median of {len(ratios)} rounds,"
            f" {min(ratios):.2f} to {max(ratios):.2f})"
        )
    return "\n".join(lines)


def _generate(ranks: int, rows: int) -> tuple[float, float]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.toml").write_text(f"samples = {rows}\n")
        arguments = {"scene": "scene.toml", "output": "rows.h5"}
        answer = launch(ranks, "bench.scale.generation", arguments, folder)
    return float(answer["wall"]), float(answer["busy"])
