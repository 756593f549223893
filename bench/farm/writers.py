"""MB/s of both writers: rows with fields that cost nothing to compute, from workers into a file.

What counts is the way of the rows: through MPI to the master and into the file, or from each worker
into the file; to the kernel, where a killed run leaves them, not to the disk. The two writers take
turns on files of their own, created before the clock starts.

`python -m mpi4py -m bench.farm.writers SPEC` is one measurement, and prints seconds in JSON.
"""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from bench.farm.launch import answer, launch
from bench.files import Row
from bench.report import remark
from gen import database
from gen.arrays import Columns
from gen.generation.run import Block, Delivery, Target, blocks_of
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.scene.columns import columns_for, row_bytes
from gen.schema import Status

SCENE = "samples = {rows}\n[surface]\nnodes = {nodes}\n[store]\npressure = true\n"


@dataclass(frozen=True)
class Spec:
    """Rows with pressure fields on a grid, and how often each writer writes them."""

    rows: int = 2000
    nodes: int = 129
    rounds: int = 5

    @property
    def scene(self) -> Scene:
        """The scene of the rows."""
        return Scene.parse(SCENE.format(rows=self.rows, nodes=self.nodes), "the benchmark's scene")

    @property
    def megabytes(self) -> float:
        """Size of all rows [MB]."""
        return self.rows * row_bytes(self.scene) / 1e6


Seconds = dict[str, list[float]]  # times of the rounds by the writer's name [s]


def writers(ranks: Sequence[int], rows: int, rounds: int, folder: Path | None) -> list[Row]:
    """Measure both writers under mpiexec, or the single one alone where h5py has no MPI.

    Takes numbers of processes, 2 or more each, of which rank 0 is the master, and the folder on the
    file system of interest, None for a temporary one. Returns times of each writer [s] and its rate
    [MB/s], medians and extremes.

    Raises
    ------
    InputError
        If there is no mpiexec, or a measurement fails.
    """
    if min(ranks) < 2:
        raise InputError(f"ranks {min(ranks)}: give 2 or more each, rank 0 is the master")
    if folder is not None and not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give one that exists")
    spec, found = Spec(rows=rows, rounds=rounds), []
    remark(f"{rows} rows with pressure fields, {spec.megabytes:,.0f} MB; {rounds} rounds")
    with tempfile.TemporaryDirectory(dir=folder) as temporary:
        for number in ranks:
            taken = launch(number, "bench.farm.writers", asdict(spec), Path(temporary))
            found += [_row(spec, number, writer, times) for writer, times in taken.items()]
    return found


def _row(spec: Spec, ranks: int, writer: str, times: list[float]) -> Row:
    return {
        "ranks": ranks,
        "writer": writer,
        "rows": spec.rows,
        "megabytes": spec.megabytes,
        "median_s": median(times),
        "rate_MB_s": spec.megabytes / median(times),
        "lowest_MB_s": spec.megabytes / max(times),
        "highest_MB_s": spec.megabytes / min(times),
    }


def time_writers(spec: Spec, path: Path, world: farm.World) -> Seconds:
    """Write files with each writer in turn; every process of the world has to call it."""
    writers = ["single", "parallel"] if database.parallel_hdf5() else ["single"]
    seconds: Seconds = {writer: [] for writer in writers}
    blocks = list(blocks_of(spec.scene, [(0, spec.rows)], world.workers))
    template = template_of(spec.scene, blocks)
    for number in range(spec.rounds):
        for writer in writers[:: (-1) ** number]:  # A B B A: drifts cancel
            target = Target(path, spec.scene, parallel=writer == "parallel")
            if world.is_master:
                create(target)
            world.broadcast(None)
            seconds[writer].append(write(target, blocks, template, world))
            if world.is_master:
                require_rows(path, blocks, template)
    return seconds


def create(target: Target) -> None:
    """Create the file anew, without rows."""
    target.path.unlink(missing_ok=True)
    database.create(target.path, target.scene)


def write(target: Target, blocks: Sequence[Block], template: Columns, world: farm.World) -> float:
    """Write the rows of a template into a file that is there; every process has to call it.

    Returns
    -------
    float
        Time from the first task to the closed file [s].
    """

    def compute(block: Block) -> Columns:
        return {name: values[: block[1] - block[0]] for name, values in template.items()}

    with Delivery(target, world, compute) as delivered:

        def take(block: Block, result: Any) -> None:
            delivered.take(block, result)

        world.broadcast(None)
        began = time.perf_counter()
        farm.run(delivered.work, iter(blocks), take, world)
    return time.perf_counter() - began


def template_of(scene: Scene, blocks: Sequence[Block]) -> Columns:
    """Return rows for the largest block; the fields are random, as zeros could be cheaper."""
    count = max(stop - start for start, stop in blocks)
    rows = {
        column.name: np.full(column.shape(count, scene.shape), column.fill, column.dtype)
        for column in columns_for(scene)
    }
    rows["status"][:] = Status.DONE
    rows["pressure"] = np.random.default_rng(0).normal(size=rows["pressure"].shape)
    return rows


def require_rows(path: Path, blocks: Sequence[Block], template: Columns) -> None:
    """Raise ValueError unless all rows have arrived, each in its place."""
    with database.Reader(path) as reader:
        if reader.counts().done != len(reader.column("status")):
            raise ValueError(f"rows are missing: {reader.counts()}")
        for start, stop in blocks:
            (last,) = reader.column("pressure", stop - 1, stop)
            if not np.array_equal(last, template["pressure"][stop - 1 - start]):
                raise ValueError(f"row {stop - 1} is not what was written")


if __name__ == "__main__":
    answer(lambda spec, world: time_writers(Spec(**spec), Path("writers.h5"), world))
