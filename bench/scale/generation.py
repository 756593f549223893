"""`python -m bench.scale.generation SPEC`: generate a database and say how long that took.

Alone or under mpiexec. Start-up is not in the time: all ranks are there and have solved a problem
of the same size. `busy` says how much of the machine others used meanwhile.
"""

import os
import time
from pathlib import Path
from typing import Any

from bench.scale.launch import answer
from gen.generation.run import Request, generate_database
from gen.generation.sample import compute_rows
from gen.runtime import farm
from gen.scene import load


def main(arguments: dict[str, Any], world: farm.World) -> dict[str, float]:
    """Generate the scene into the output, once all peers have met where they are to meet."""
    compute_rows(load(arguments["scene"]), 0, 1)
    world.broadcast(None)
    if arguments.get("meeting"):
        _meet(Path(arguments["meeting"]), arguments["peers"])
    before, began = _jiffies(), time.perf_counter()
    generate_database(Request(arguments["scene"], Path(arguments["output"])), world)
    wall = time.perf_counter() - began
    busy = (_jiffies() - before) / os.sysconf("SC_CLK_TCK") / wall / (os.cpu_count() or 1)
    return {"wall": wall, "busy": busy}


def _meet(folder: Path, peers: int) -> None:
    """Wait until all peers are here; whoever started them bounds the wait."""
    (folder / str(os.getpid())).touch()
    while len(list(folder.iterdir())) < peers:
        time.sleep(0.001)


def _jiffies() -> int:
    """Time that all processors have been busy since the machine started, or were taken away."""
    fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    user, nice, system, _, _, interrupts, soft, steal = (int(field) for field in fields[:8])
    return user + nice + system + interrupts + soft + steal


if __name__ == "__main__":
    answer(main)
