"""
The farm on this machine: its own work, real speed-up, and how fast rows are written.

`python -m mpi4py -m bench.farm PROGRAM SPEC` runs a program on some ranks, started by `launch` with
a time limit, and prints its result in JSON:

- `generation`: one generation; all ranks are there and have solved a problem of the same size. Two
  processors may share a clock, a cache or a memory bus. So every round of `speedup` also runs two
  copies side by side that know nothing of each other: their gain bounds that of any farm.
- `writing`: rows with fields that cost nothing to compute, with each writer in turn: through MPI to
  the master and into the file, or from each worker into the file; to the disk, as each writer syncs
  what it has written.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np

from bench.files import Row
from bench.report import remark
from gen import database
from gen.arrays import Columns
from gen.generation.run import blocks_of, generate_database
from gen.generation.sample import compute_rows
from gen.generation.sinks import open_sink
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.installation import command_for
from gen.scene import Scene, columns_for, load, row_bytes
from gen.schema import Status

TIMEOUT = 300.0  # seconds after which a measurement counts as hanging

OPEN_MPI = (
    "ALLOW_RUN_AS_ROOT",
    "ALLOW_RUN_AS_ROOT_CONFIRM",
    "MCA_rmaps_base_oversubscribe",
)
ENVIRONMENT = {
    **{f"OMPI_{name}": "1" for name in OPEN_MPI},
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "PYTHONPATH": str(Path(__file__).resolve().parents[1]),
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
"""Open MPI as root and on few cores; one thread a rank."""


def launch(ranks: int, program: str, arguments: dict[str, Any], folder: Path) -> Any:
    """Run a program in a folder and return what it prints in its last line, in JSON.

    Its arguments are written down for it in JSON. 0 ranks run alone, without MPI.

    An InputError is raised if there is no mpiexec, or the program fails.
    """
    specification = folder / "specification.json"
    specification.write_text(json.dumps(arguments))
    command = [sys.executable, "-m", "bench.farm", program, str(specification)]
    if ranks:
        command = [
            _mpiexec(),
            "-n",
            str(ranks),
            sys.executable,
            "-m",
            "mpi4py",
            *command[1:],
        ]
    kept = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(("PMI", "OMPI"))
    }
    settings: dict[str, Any] = {
        "cwd": folder,
        "env": kept | ENVIRONMENT,
        "timeout": TIMEOUT,
    }
    done = subprocess.run(
        command, **settings, capture_output=True, text=True, check=False
    )
    if done.returncode:
        reason = f"exit code {done.returncode}: {done.stderr.strip()[-500:]}"
        raise InputError(f"{program} on {ranks} ranks fails with {reason}")
    return json.loads(done.stdout.splitlines()[-1])


def _mpiexec() -> str:
    """Find the launcher that belongs to this environment's MPI."""
    beside = Path(sys.executable).with_name("mpiexec")
    found = str(beside) if beside.exists() else shutil.which("mpiexec")
    if found is None:
        raise InputError(f"no mpiexec: {command_for('mpich')}")
    return found


def speedup(rows: int, rounds: int) -> list[Row]:
    """Generate the first rows of `paper` alone, with one worker, with two, and in two copies.

    Return the times of each round without start-up [s], of two copies the mean, and speed-ups.
    """
    runs: dict[str, Callable[[], float]] = {
        "alone_s": partial(generate, 0, rows),  # without MPI
        "1_worker_s": partial(generate, 2, rows),  # beside the master, rank 0
        "2_workers_s": partial(generate, 3, rows),
        "2_copies_s": partial(_side_by_side, rows),
    }
    found = []
    for number in range(rounds):
        taken = {name: runs[name]() for name in list(runs)[:: (-1) ** number]}
        row: Row = {"round": number + 1, **{name: taken[name] for name in runs}}
        alone, one, two, copies = (taken[name] for name in runs)
        row["2 workers over 1 worker"] = one / two
        row["2 workers over a run alone"] = alone / two
        row["2 copies over one"] = 2 * alone / copies  # the machine's bound
        row["2 workers over a run alone, of that bound"] = copies / two / 2
        remark(", ".join(f"{name} {seconds:.2f}" for name, seconds in taken.items()))
        found.append(row)
    return found


def generate(ranks: int, rows: int) -> float:
    """Generate rows on some ranks; return the wall time [s]."""
    with tempfile.TemporaryDirectory() as name:
        (Path(name) / "scene.toml").write_text(f"samples = {rows}\n")
        return float(launch(ranks, "generation", {}, Path(name)))


def _side_by_side(rows: int) -> float:
    """Generate twice without MPI, at the same time; return the mean time [s]."""
    with ThreadPoolExecutor(2) as pool:
        return mean(pool.map(generate, (0, 0), (rows, rows)))


def _generation(world: farm.World) -> float:
    """Generate the scene of this folder; return the wall time without start-up [s]."""
    compute_rows(load("scene.toml"), 0, 1)
    world.broadcast(None)
    began = time.perf_counter()
    generate_database("scene.toml", Path("rows.h5"), world)
    return time.perf_counter() - began


@dataclass(frozen=True)
class Spec:
    """Rows with pressure fields on a grid, and how often each writer writes them."""

    rows: int = 2000
    nodes: int = 129
    rounds: int = 5

    @property
    def scene(self) -> Scene:
        """The scene of the rows."""
        surface = f"samples = {self.rows}\n[surface]\nnodes = {self.nodes}\n"
        return Scene.parse(
            f"{surface}[store]\npressure = true\n", "the benchmark's scene"
        )

    @property
    def megabytes(self) -> float:
        """Size of all rows [MB]."""
        return self.rows * row_bytes(self.scene) / 1e6


Seconds = dict[str, list[float]]  # times of the rounds by the writer's name [s]


def writers(
    ranks: Sequence[int], rows: int, rounds: int, folder: Path | None
) -> list[Row]:
    """Measure both writers under mpiexec, or the single one alone where h5py has no MPI.

    Takes numbers of processes, 2 or more each, of which rank 0 is the master, and the folder on the
    file system of interest, None for a temporary one. Returns times of each writer [s] and its rate
    [MB/s], medians and extremes.

    An InputError is raised if there is no mpiexec, or a measurement fails.
    """
    if min(ranks) < 2:
        raise InputError(f"ranks {min(ranks)}: give 2 or more each, rank 0 is the master")
    if folder is not None and not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give one that exists")
    spec, found = Spec(rows=rows, rounds=rounds), list[Row]()
    remark(f"{rows} rows with pressure fields, {spec.megabytes:,.0f} MB; {rounds} rounds")
    with tempfile.TemporaryDirectory(dir=folder) as temporary:
        for number in ranks:
            taken = launch(number, "writing", asdict(spec), Path(temporary))
            for writer, times in taken.items():
                rates = (spec.megabytes / of(times) for of in (median, max, min))
                names = ("rate_MB_s", "lowest_MB_s", "highest_MB_s")
                row = {
                    "ranks": number,
                    "writer": writer,
                    "rows": rows,
                    "megabytes": spec.megabytes,
                }
                row |= {"median_s": median(times), **dict(zip(names, rates, strict=True))}
                found.append(row)
    return found


def time_writers(spec: Spec, path: Path, world: farm.World) -> Seconds:
    """Write files with each writer in turn; every process of the world has to call it."""
    writers = ["single", "parallel"] if database.parallel_hdf5() else ["single"]
    seconds: Seconds = {writer: [] for writer in writers}
    blocks = list(blocks_of(spec.scene, [range(spec.rows)], world.workers))
    template = template_of(spec.scene, blocks)
    for number in range(spec.rounds):
        for writer in writers[:: (-1) ** number]:  # A B B A: drifts cancel
            if world.is_master:
                path.unlink(missing_ok=True)
                database.create(path, spec.scene)
            world.broadcast(None)
            own = writer == "parallel"
            seconds[writer].append(
                write(path, spec.scene, blocks, template, world, parallel=own)
            )
            if world.is_master:
                require_rows(path, blocks, template)
    return seconds


def write(
    path: Path,
    scene: Scene,
    blocks: Sequence[range],
    template: Columns,
    world: farm.World,
    *,
    parallel: bool = False,
) -> float:
    """Write the rows of a template into a file that is there; every process has to call it.

    Return the time from the first task to the closed file [s].
    """
    with open_sink(path, scene, world, parallel=parallel) as sink:

        def work(block: range) -> Columns:
            rows = {name: values[: len(block)] for name, values in template.items()}
            return sink.deliver(block, rows)

        world.broadcast(None)
        began = time.perf_counter()
        farm.run(work, iter(blocks), sink.receive, world)
    return time.perf_counter() - began


def template_of(scene: Scene, blocks: Sequence[range]) -> Columns:
    """Return rows for the largest block; the fields are random, as zeros could be cheaper."""
    count = max(map(len, blocks))
    rows = {
        column.name: np.full(column.shape(count, scene.shape), column.fill, column.dtype)
        for column in columns_for(scene)
    }
    rows["status"][:] = Status.DONE
    rows["pressure"] = np.random.default_rng(0).normal(size=rows["pressure"].shape)
    return rows


def require_rows(path: Path, blocks: Sequence[range], template: Columns) -> None:
    """Raise ValueError unless all rows have arrived, each in its place."""
    with database.Reader(path) as reader:
        if reader.counts().done != len(reader.column("status")):
            raise ValueError(f"rows are missing: {reader.counts()}")
        for block in blocks:
            row = block[-1]
            (last,) = reader.column("pressure", row, row + 1)
            if not np.array_equal(last, template["pressure"][len(block) - 1]):
                raise ValueError(f"row {row} is not what was written")


def main(program: str, specification: str) -> None:
    """Run a program on this rank, and print the master's result in JSON."""
    world = farm.this_world()
    arguments = json.loads(Path(specification).read_text(encoding="utf-8"))
    if program == "generation":
        result: Any = _generation(world)
    else:
        result = time_writers(Spec(**arguments), Path("writers.h5"), world)
    if world.is_master:
        sys.stdout.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
