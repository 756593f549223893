"""Real speed-up: the same rows alone, with one worker and with two, beside the machine's limit.

Two processors that share a clock, a cache or a memory bus are not twice as fast as one. So every
round also runs two copies side by side that know nothing of each other: together they do twice the
rows, and what they gain over one alone bounds what any farm could gain.

`python -m bench.farm.speedup SPEC`, alone or under mpiexec, is one generation, and prints its
seconds in JSON. Start-up is not in the time: all ranks are there and have solved a problem of the
same size. `busy` says how much of the machine others used meanwhile.
"""

import os
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from statistics import mean, median
from typing import Any

from bench.farm.launch import answer, launch
from bench.report import Report, remark
from gen.generation.run import Request, generate_database
from gen.generation.sample import compute_rows
from gen.runtime import farm
from gen.scene import load

# Runs of a round, and their ranks: 0 is without MPI; rank 0 of the others is the master.
RANKS = {"alone": 0, "1 worker": 2, "2 workers": 3}
COPIES = "2 copies"  # the run of two processes alone, side by side; its times are the means of both
# Generation times of one round by the name of the run, without start-up [s].
Turn = dict[str, float]

GAINS: dict[str, Callable[[Turn], float]] = {
    "2 workers over 1 worker": lambda turn: turn["1 worker"] / turn["2 workers"],
    "2 workers over a run alone": lambda turn: turn["alone"] / turn["2 workers"],
    "2 copies over one: the machine's bound": lambda turn: 2 * turn["alone"] / turn[COPIES],
    "2 workers over a run alone, of that bound": lambda turn: turn[COPIES] / turn["2 workers"] / 2,
}


def measure(rows: int, rounds: int) -> list[Turn]:
    """Generate the first rows of `paper` alone, with workers and in two copies, in turn."""
    runs: dict[str, Callable[[], tuple[float, float]]] = {
        name: partial(generate, ranks, rows) for name, ranks in RANKS.items()
    }
    runs[COPIES] = partial(_side_by_side, rows)
    turns = []
    for number in range(rounds):
        found = {name: runs[name]() for name in list(runs)[:: (-1) ** number]}
        times = (f"{name} {found[name][0]:.2f} s ({found[name][1]:.0%} busy)" for name in runs)
        turns.append({name: wall for name, (wall, _) in found.items()})
        over_worker, over_alone, bound, _ = (gain(turns[-1]) for gain in GAINS.values())
        remark(
            f"{', '.join(times)}: speed-up {over_worker:.2f} over 1 worker, {over_alone:.2f} over"
            f" alone, of {bound:.2f}"
        )
    return turns


def summary(turns: list[Turn]) -> str:
    """Return medians and extremes in one line each."""
    lines = []
    for what, gain in GAINS.items():
        ratios = [gain(turn) for turn in turns]
        lines.append(
            f"{what}: {median(ratios):.2f} (median of {len(ratios)} rounds,"
            f" {min(ratios):.2f} to {max(ratios):.2f})"
        )
    return "\n".join(lines)


def speedup(rows: int, rounds: int) -> Report:
    """Report times of each run [s], and their speed-ups; the arguments are those of `measure`."""
    turns = measure(rows, rounds)
    names = {name: f"{name.replace(' ', '_')}_s" for name in turns[0]}
    found = [
        {"round": number, **{names[name]: seconds for name, seconds in turn.items()}}
        | {what.partition(":")[0]: gain(turn) for what, gain in GAINS.items()}
        for number, turn in enumerate(turns, 1)
    ]
    return Report({"speedup": found}, text=summary(turns))


def generate(
    ranks: int, rows: int, meeting: str = "", folder: Path | None = None
) -> tuple[float, float]:
    """Generate rows on some ranks; return the wall time [s], and how busy the machine was [1]."""
    with tempfile.TemporaryDirectory() as name:
        home = folder or Path(name)
        (home / "scene.toml").write_text(f"samples = {rows}\n")
        found = launch(ranks, "bench.farm.speedup", {"meeting": meeting}, home)
    return float(found["wall"]), float(found["busy"])


def _side_by_side(rows: int) -> tuple[float, float]:
    """Generate twice without MPI, beginning together; return the means."""
    with tempfile.TemporaryDirectory() as meeting, ThreadPoolExecutor(2) as pool:
        both = list(pool.map(lambda _: generate(0, rows, meeting), range(2)))
    wall, busy = zip(*both, strict=True)
    return mean(wall), mean(busy)


def _generation(arguments: dict[str, Any], world: farm.World) -> dict[str, float]:
    """Generate the scene of this folder, once both copies have met where they are to meet."""
    compute_rows(load("scene.toml"), 0, 1)
    world.broadcast(None)
    if arguments["meeting"]:
        folder = Path(arguments["meeting"])
        (folder / str(os.getpid())).touch()
        while len(list(folder.iterdir())) < 2:  # whoever started them bounds the wait
            time.sleep(0.001)
    before, began = _jiffies(), time.perf_counter()
    generate_database(Request("scene.toml", Path("rows.h5")), world)
    wall = time.perf_counter() - began
    busy = (_jiffies() - before) / os.sysconf("SC_CLK_TCK") / wall / (os.cpu_count() or 1)
    return {"wall": wall, "busy": busy}


def _jiffies() -> int:
    """Read how long all processors have been busy, or were taken away, since the start."""
    fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    user, nice, system, _, _, interrupts, soft, steal = (int(field) for field in fields[:8])
    return user + nice + system + interrupts + soft + steal


if __name__ == "__main__":
    answer(_generation)
