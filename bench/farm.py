"""The farm on this machine: the time that it adds, its speed-up, and how fast rows are written.

`python -m mpi4py -m bench.farm PROGRAM SPECIFICATION` runs a program on some ranks, and prints its
result in JSON. `launch` starts it with a time limit. The programs are:

- `generation`: one generation. It is timed after all ranks have started and solved a problem of its
  size. Two processors may share a clock, a cache or a memory bus, so that no farm can be twice as
  fast with two workers. Every round of `speedup` therefore also runs two copies side by side that
  do not communicate: the speed-up by these is the largest that any farm can reach.
- `writing`: rows whose fields cost nothing to compute, by each writer in turn. With the single
  writer, rows go through MPI to the master, and the master writes the file. With the parallel
  writer, each worker writes into the file. Each writer waits until its rows are on the disk.
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

TIMEOUT = 300.0
"""Wall time after which a program is ended, as it hangs [s]."""

OPEN_MPI = (
    "ALLOW_RUN_AS_ROOT",
    "ALLOW_RUN_AS_ROOT_CONFIRM",
    "MCA_rmaps_base_oversubscribe",
)
"""Names of settings with which Open MPI runs as root, and with more ranks than cores."""

ENVIRONMENT = {
    **{f"OMPI_{name}": "1" for name in OPEN_MPI},
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "PYTHONPATH": str(Path(__file__).resolve().parents[1]),
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
"""Environment variables of a program: any MPI runs on few cores, and each rank has one thread."""


def launch(ranks: int, program: str, arguments: dict[str, Any], folder: Path) -> Any:
    """Run a program of this module in a folder, in processes of its own, and return its result.

    Writes the arguments into `folder/specification.json`.

    Parameters
    ----------
    ranks : int
        Number of processes; 0 for one process without MPI.
    program : {"generation", "writing"}
        The program.
    arguments : dict
        Arguments of the program, as values that JSON knows.
    folder : Path
        Folder that the program runs in.

    Returns
    -------
    object
        The JSON in the last line that the program prints.

    Raises
    ------
    InputError
        If there is no mpiexec (with ranks), or the program fails.
    subprocess.TimeoutExpired
        If the program takes longer than `TIMEOUT`.
    """
    specification = folder / "specification.json"
    specification.write_text(json.dumps(arguments))
    words = ["-m", "bench.farm", program, str(specification)]
    if ranks:
        # Run by `-m mpi4py`, all ranks end if one of them fails.
        words = ["-m", "mpi4py", *words]
        command = [_mpiexec(), "-n", str(ranks), sys.executable, *words]
    else:
        command = [sys.executable, *words]
    # If this process runs under an MPI itself, its variables would confuse the new one.
    inherited = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PMI", "OMPI"))
    }
    done = subprocess.run(
        command,
        cwd=folder,
        env=inherited | ENVIRONMENT,
        timeout=TIMEOUT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        errors = done.stderr.strip()[-500:]
        reason = f"exit code {done.returncode}: {errors}"
        raise InputError(f"{program} on {ranks} ranks fails with {reason}")
    return json.loads(done.stdout.splitlines()[-1])


def _mpiexec() -> str:
    """Return the path of mpiexec, preferably that of this Python environment.

    Raises InputError if there is none.
    """
    of_environment = Path(sys.executable).with_name("mpiexec")
    if of_environment.exists():
        return str(of_environment)
    installed = shutil.which("mpiexec")
    if installed is None:
        raise InputError(f"no mpiexec: {command_for('mpich')}")
    return installed


def speedup(rows: int, rounds: int) -> list[Row]:
    """Time how long the first rows of `paper` take alone, with one worker, two, and in two copies.

    Prints the times of each round on standard error.

    Parameters
    ----------
    rows : int
        Number of rows.
    rounds : int
        Number of rounds; the order of the runs is reversed in every second round.

    Returns
    -------
    list of Row
        A row for each round: its number, the wall times without start-up [s], for two copies their
        mean, and the speed-ups by two workers and by two copies [1]. The last column is the
        speed-up by two workers over the speed-up by two copies, both against a run alone [1].

    Raises
    ------
    InputError
        If there is no mpiexec, or a generation fails.
    subprocess.TimeoutExpired
        If a generation takes longer than `TIMEOUT`.
    """
    runs: dict[str, Callable[[], float]] = {
        "alone_s": partial(generate, ranks=0, rows=rows),  # without MPI
        "1_worker_s": partial(generate, ranks=2, rows=rows),  # rank 0 is the master
        "2_workers_s": partial(generate, ranks=3, rows=rows),
        "2_copies_s": partial(_side_by_side, rows),
    }
    table: list[Row] = []
    for number in range(rounds):
        order = list(runs)
        if number % 2:
            order.reverse()
        times = {name: runs[name]() for name in order}
        alone = times["alone_s"]
        one_worker = times["1_worker_s"]
        two_workers = times["2_workers_s"]
        copies = times["2_copies_s"]
        table.append(
            {
                "round": number + 1,
                **{name: times[name] for name in runs},
                "2 workers over 1 worker": one_worker / two_workers,
                "2 workers over a run alone": alone / two_workers,
                # The speed-up that two workers could reach at most on this machine.
                "2 copies over one": 2 * alone / copies,
                "2 workers over a run alone, of that bound": copies / two_workers / 2,
            }
        )
        texts = [f"{name} {seconds:.2f}" for name, seconds in times.items()]
        remark(", ".join(texts))
    return table


def generate(ranks: int, rows: int) -> float:
    """Time a generation of the first rows of `paper`, in a temporary folder.

    Parameters
    ----------
    ranks : int
        Number of processes; 0 for one process without MPI.
    rows : int
        Number of rows.

    Returns
    -------
    float
        Wall time without start-up [s].

    Raises
    ------
    InputError
        If there is no mpiexec (with ranks), or the generation fails.
    subprocess.TimeoutExpired
        If the generation takes longer than `TIMEOUT`.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.toml").write_text(f"samples = {rows}\n")
        return float(launch(ranks, "generation", {}, folder))


def _side_by_side(rows: int) -> float:
    """Run two generations side by side, without MPI; return the mean of their wall times [s]."""
    ranks = (0, 0)
    with ThreadPoolExecutor(2) as pool:
        return mean(pool.map(generate, ranks, (rows, rows)))


def _generation(world: farm.World) -> float:
    """Generate `scene.toml` of the current folder into `rows.h5`; collective over the ranks.

    Returns the wall time without start-up [s].
    """
    # One row is computed first, to load libraries and plan transforms.
    compute_rows(load("scene.toml"), 0, 1)
    world.broadcast(None)  # waits until all ranks have computed a row
    began = time.perf_counter()
    generate_database("scene.toml", Path("rows.h5"), world)
    return time.perf_counter() - began


@dataclass(frozen=True)
class Spec:
    """The rows with pressure fields that are written, and how often each writer writes them."""

    rows: int = 2000  # number of rows
    nodes: int = 129  # nodes a side of a field
    rounds: int = 5  # number of turns of each writer

    @property
    def scene(self) -> Scene:
        """The scene of the rows."""
        text = (
            f"samples = {self.rows}\n"
            f"[surface]\nnodes = {self.nodes}\n"
            "[store]\npressure = true\n"
        )
        return Scene.parse(text, "the benchmark's scene")

    @property
    def megabytes(self) -> float:
        """Size of all rows [MB]."""
        return self.rows * row_bytes(self.scene) / 1e6


Seconds = dict[str, list[float]]
"""Times of the rounds by the name of the writer [s]."""


def writers(
    ranks: Sequence[int], rows: int, rounds: int, folder: Path | None
) -> list[Row]:
    """Measure both writers under mpiexec, or only the single writer if h5py has no MPI.

    Parameters
    ----------
    ranks : sequence of int
        Numbers of processes, each at least 2, of which rank 0 is the master.
    rows : int
        Number of rows to write.
    rounds : int
        Number of turns of each writer.
    folder : Path or None
        Existing folder on the file system that is measured, in which a temporary folder is made.
        None for the system's folder for temporary files.

    Returns
    -------
    list of Row
        A row for each number of ranks and writer: the median time [s], and the median, lowest and
        highest rate [MB/s].

    Raises
    ------
    InputError
        If there are fewer than 2 ranks, the folder or mpiexec is missing, or a measurement fails.
    subprocess.TimeoutExpired
        If the writers take longer than `TIMEOUT` on a number of ranks.
    """
    if min(ranks) < 2:
        raise InputError(f"ranks {min(ranks)}: give 2 or more each, rank 0 is the master")
    if folder is not None and not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give one that exists")
    spec = Spec(rows=rows, rounds=rounds)
    remark(f"{rows} rows with pressure fields, {spec.megabytes:,.0f} MB; {rounds} rounds")
    table: list[Row] = []
    with tempfile.TemporaryDirectory(dir=folder) as temporary:
        for number in ranks:
            seconds = launch(number, "writing", asdict(spec), Path(temporary))
            for writer, times in seconds.items():
                table.append(
                    {
                        "ranks": number,
                        "writer": writer,
                        "rows": rows,
                        "megabytes": spec.megabytes,
                        "median_s": median(times),
                        "rate_MB_s": spec.megabytes / median(times),
                        "lowest_MB_s": spec.megabytes / max(times),
                        "highest_MB_s": spec.megabytes / min(times),
                    }
                )
    return table


def time_writers(spec: Spec, path: Path, world: farm.World) -> Seconds:
    """Write a file with each writer in turn; collective over the ranks.

    Parameters
    ----------
    spec : Spec
        The rows and the number of rounds.
    path : Path
        The file, which is replaced in every turn.
    world : World
        The ranks.

    Returns
    -------
    dict
        Wall times of the rounds on this rank, by the name of the writer [s].

    Raises
    ------
    ValueError
        If rows are missing or in a wrong place after a turn; only on the master.
    """
    writers = ["single"]
    if database.parallel_hdf5():
        writers.append("parallel")
    seconds: Seconds = {writer: [] for writer in writers}
    blocks = list(blocks_of(spec.scene, [range(spec.rows)], world.workers))
    template = template_of(spec.scene, blocks)
    for number in range(spec.rounds):
        order = list(writers)
        if number % 2:  # A B B A, so that a machine that becomes slower favours no writer
            order.reverse()
        for writer in order:
            if world.is_master:
                path.unlink(missing_ok=True)
                database.create(path, spec.scene)
            world.broadcast(None)  # waits for the new file
            taken = write(
                path, spec.scene, blocks, template, world, parallel=writer == "parallel"
            )
            seconds[writer].append(taken)
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
    """Write copies of template rows into an existing file; collective over the ranks.

    Parameters
    ----------
    path : Path
        The file of the scene.
    scene : Scene
        The scene.
    blocks : sequence of range
        Rows of each task.
    template : dict of ndarray
        Columns with the number of rows of the largest block. Each block takes the first rows.
    world : World
        The ranks.
    parallel : bool
        Whether the workers write into the file. If not, the master does.

    Returns
    -------
    float
        Wall time from the first task to the closed file [s].
    """
    with open_sink(path, scene, world, parallel=parallel) as sink:

        def work(block: range) -> Columns:
            """Give the rows of a block to the sink; return the columns that the master receives."""
            rows = {name: values[: len(block)] for name, values in template.items()}
            return sink.deliver(block, rows)

        world.broadcast(None)  # waits until all ranks have opened the file
        began = time.perf_counter()
        farm.run(work, iter(blocks), sink.receive, world)
    return time.perf_counter() - began


def template_of(scene: Scene, blocks: Sequence[range]) -> Columns:
    """Make columns of rows that are done, with random pressure fields.

    Fields of zeros could take less time to write.

    Parameters
    ----------
    scene : Scene
        The scene of the rows.
    blocks : sequence of range
        Rows of each task.

    Returns
    -------
    dict of ndarray
        Columns with the number of rows of the largest block.
    """
    count = max(map(len, blocks))
    rows = {
        column.name: np.full(column.shape(count, scene.shape), column.fill, column.dtype)
        for column in columns_for(scene)
    }
    rows["status"][:] = Status.DONE
    rows["pressure"] = np.random.default_rng(0).normal(size=rows["pressure"].shape)
    return rows


def require_rows(path: Path, blocks: Sequence[range], template: Columns) -> None:
    """Check that all rows are in a file, and that the last row of each block is in its place.

    Parameters
    ----------
    path : Path
        The file.
    blocks : sequence of range
        Rows of each task.
    template : dict of ndarray
        Columns that were written, from `template_of`.

    Raises
    ------
    ValueError
        If a row is missing, or the last row of a block has another pressure.
    """
    with database.Reader(path) as reader:
        if reader.counts().done != len(reader.column("status")):
            raise ValueError(f"rows are missing: {reader.counts()}")
        for block in blocks:
            row = block[-1]
            (pressure,) = reader.column("pressure", row, row + 1)
            if not np.array_equal(pressure, template["pressure"][len(block) - 1]):
                raise ValueError(f"row {row} is not what was written")


def main(program: str, specification: str) -> None:
    """Run a program on this rank; the master prints the result in JSON, in one line.

    It works in the current folder.

    - `generation` reads `scene.toml` and writes `rows.h5`. It takes no arguments, and its result is
      the time [s].
    - `writing` takes the fields of `Spec`, and writes `writers.h5`. Its result is that of
      `time_writers`.

    Parameters
    ----------
    program : {"generation", "writing"}
        The program.
    specification : str
        Path of the JSON file with the arguments of the program, an object.
    """
    world = farm.this_world()
    arguments = json.loads(Path(specification).read_text(encoding="utf-8"))
    result: Any
    if program == "generation":
        result = _generation(world)
    else:
        result = time_writers(Spec(**arguments), Path("writers.h5"), world)
    if world.is_master:
        sys.stdout.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
