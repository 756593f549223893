"""Commands on the farm and its database: speed-up, writing, outputs."""

from pathlib import Path

import typer

from bench.commands.options import (
    PAPER_DATABASE,
    Folder,
    FolderIfAny,
    numbers,
    option,
    require_place,
    tell,
)
from gen.runtime.errors import InputError


def writers(
    ranks: str = option("2,4,8", "Numbers of processes, in turn.", metavar="N,..."),
    rows: int = option(2000, "Rows of 129 x 129 nodes to write.", min=1),
    rounds: int = option(5, "Turns of each writer; medians count.", min=1),
    folder: Path | None = option(None, "Where to write: another file system, say.", metavar="DIR"),
    output: FolderIfAny = None,
) -> None:
    """Measure how fast rows with pressure fields are written, by rank 0 and by every worker.

    Starts mpiexec; the parallel writer is left out where h5py has no MPI. Prints a table, and
    writes writers.csv into the folder of --output.
    """
    from bench.writers import Spec, measure, report

    processes = numbers("ranks", ranks, int)
    if min(processes) < 2:
        raise InputError(f"ranks {ranks!r}: give 2 or more each, rank 0 is the master")
    if folder is not None and not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give one that exists")
    require_place(output, "writers.csv")
    spec = Spec(rows=rows, rounds=rounds)
    typer.echo(f"{rows} rows with pressure fields, {spec.megabytes:,.0f} MB; {rounds} rounds")
    tell(output, report(spec, measure(spec, processes, folder)))


def outputs(
    scene: str = typer.Argument("paper", help="Scene whose first rows are computed."),
    rounds: int = option(7, "Repetitions; medians count.", min=1),
    output: FolderIfAny = None,
) -> None:
    """Measure what each optional output of a database costs: a table, and DIR/outputs.csv."""
    from bench.outputs import measure, report

    require_place(output, "outputs.csv")
    tell(output, report(measure(scene, rounds)))


def speedup(
    rows: int = option(1000, "Rows of `paper` to generate.", min=1),
    rounds: int = option(5, "Repetitions; medians count.", min=1),
    output: FolderIfAny = None,
) -> None:
    """Generate the same rows alone, with one MPI worker and with two, in turn, and compare.

    Start-up is not in the times. Two copies side by side show what two processors of this machine
    gain at best. Each line says how busy the whole machine was: with other users on it, two workers
    do not get two processors. With -o, DIR/speedup.csv.
    """
    from bench.scale.speedup import measure, report

    require_place(output, "speedup.csv")
    tell(output, report(measure(rows, rounds)))


def databases(
    output: Folder,
    database: Path | None = PAPER_DATABASE,
    rows: int | None = option(None, "Rows of each; all if left out.", min=100),
) -> None:
    """Generate the databases that results rest on, and summarise them as `gen info` does.

    The scenes `paper`, `fine` and `paper-mirco`, and `paper` with concentrated forces, in DIR: goes
    on there after Ctrl-C. DIR/databases.csv and databases.txt.
    """
    from bench.databases import all_of_them, report

    require_place(output, "databases.csv", "databases.txt")
    tell(output, report(all_of_them(output, database, rows)))
