"""`python -m bench.scale.generation SPEC`: generate a database and say how long that took.

Alone or under mpiexec. Start-up is not in the time: all ranks are there and have solved a problem
of the same size. `busy` says how much of the machine others used meanwhile.
"""

import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from gen.generation.run import Request, generate_database
from gen.generation.sample import compute_rows
from gen.runtime import farm
from gen.scene import load


def main(arguments: Sequence[str]) -> None:
    """Read the specification, a JSON file, and print the times as JSON.

    It names scene and output, and may name a folder in which so many peers meet before they begin.
    """
    content = json.loads(Path(arguments[0]).read_text())
    world = farm.this_world()
    compute_rows(load(content["scene"]), 0, 1)
    world.broadcast(None)
    if content.get("meeting"):
        _meet(Path(content["meeting"]), content["peers"])
    before, began = _jiffies(), time.perf_counter()
    generate_database(Request(content["scene"], Path(content["output"])), world)
    wall = time.perf_counter() - began
    busy = (_jiffies() - before) / os.sysconf("SC_CLK_TCK") / wall / (os.cpu_count() or 1)
    if world.is_master:
        sys.stdout.write(json.dumps({"wall": wall, "busy": busy}) + "\n")


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
    main(sys.argv[1:])
    farm.leave()
