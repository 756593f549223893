"""Commands on the farm and its database: faults, scale, writing."""

from pathlib import Path
from typing import Annotated

import typer

from bench.commands.options import Folder, numbers, remark
from gen.runtime.errors import InputError


def faults(
    rounds: Annotated[
        int | None, typer.Option(min=1, help="Faults to inject, 168 unless given.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of kinds, victims and moments.")] = 0,
    minutes: Annotated[float, typer.Option(min=0.0, help="No round begins later.")] = 30.0,
    only: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="A kind of the table, alone.")
    ] = None,
) -> int:
    """Disturb runs at random and see whether anything is lost, wrong or done twice.

    Signals to a run alone, to worker, master and mpiexec; full disks, files cut off, second
    writers; files replaced, moved, made read-only; pipes, wrong options, a full disk under standard
    error; samples that raise, give NaN, do not converge, never end. Exit code 0 if as many faults
    as asked for were injected and nothing was wrong, 1 otherwise.
    """
    import tempfile

    from bench.faults.campaign import KINDS, ROUNDS, campaign
    from bench.faults.table import line, summary

    wanted, done = rounds or ROUNDS, []
    with tempfile.TemporaryDirectory() as folder:
        for interrupted in campaign(
            Path(folder),
            wanted,
            seed=seed,
            kinds=only or tuple(KINDS),
            minutes=minutes,
            remark=remark,
        ):
            done.append(interrupted)
            typer.echo(line(len(done), interrupted))
    typer.echo(summary(done))
    missed = wanted - sum(interrupted.hit for interrupted in done)
    if missed > 0:
        typer.echo(f"{missed} of {wanted} faults could not be injected")
    return 1 if missed > 0 or any(interrupted.fault for interrupted in done) else 0


def fuzz(
    minutes: Annotated[float, typer.Option(min=0.0, help="No case begins later.")] = 10.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all damage.")] = 0,
    cases: Annotated[
        int | None, typer.Option(min=1, help="Number of cases at most; no bound unless given.")
    ] = None,
    first: Annotated[int, typer.Option(min=0, help="Number of the first case.")] = 0,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND", help="scene, database, surrogate, surface, comparison or page, alone."
        ),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Where findings are written.")
    ] = Path("fuzz-findings"),
) -> int:
    """Damage files at random, run commands on them, and see that none crashes, hangs or babbles.

    Right are success, or exit code 2 with one clear line (of `gen check`, 1 too). What else happens
    is kept with its command, DIR/NNN-KIND, and makes the exit code 1. The same seed and number of a
    case do the same damage.
    """
    import tempfile
    import time

    from bench.fuzz.corpus import KINDS
    from bench.fuzz.findings import Findings
    from bench.fuzz.search import fuzz as search

    if output.exists():
        raise InputError(f"{output} exists: give a new folder")
    found, began = Findings(output), time.monotonic()
    last = None if cases is None else first + cases
    with tempfile.TemporaryDirectory() as folder:
        for case in search(
            Path(folder),
            seed=seed,
            kinds=only or tuple(KINDS),
            seconds=60.0 * minutes,
            first=first,
            last=last,
        ):
            if line := found.add(case, Path(folder) / "case"):
                remark(line)
    typer.echo(found.summary(time.monotonic() - began))
    return 1 if found.signatures else 0


def writers(
    ranks: Annotated[
        str, typer.Option(metavar="N,...", help="Numbers of processes, in turn.")
    ] = "2,4,8",
    rows: Annotated[int, typer.Option(min=1, help="Rows of 129 x 129 nodes to write.")] = 2000,
    rounds: Annotated[int, typer.Option(min=1, help="Turns of each writer; medians count.")] = 5,
    folder: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where to write: another file system, say.")
    ] = None,
) -> None:
    """Measure how fast rows with pressure fields are written, by rank 0 and by every worker.

    Starts mpiexec; the parallel writer is left out where h5py has no MPI. Prints a table.
    """
    from bench.writers import Spec, markdown_table, measure

    processes = numbers("ranks", ranks, int)
    if min(processes) < 2:
        raise InputError(f"ranks {ranks!r}: give 2 or more each, rank 0 is the master")
    if folder is not None and not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give one that exists")
    spec = Spec(rows=rows, rounds=rounds)
    typer.echo(f"{rows} rows with pressure fields, {spec.megabytes:,.0f} MB; {rounds} rounds")
    typer.echo(markdown_table(spec, measure(spec, processes, folder)))


def outputs(
    scene: Annotated[str, typer.Argument(help="Scene whose first rows are computed.")] = "paper",
    rounds: Annotated[int, typer.Option(min=1, help="Repetitions; medians count.")] = 7,
) -> None:
    """Measure what each optional output of a database costs, and print it as a table."""
    from bench.outputs import markdown_table, measure

    typer.echo(markdown_table(measure(scene, rounds=rounds)))


def scale(
    output: Folder,
    costs: Annotated[
        Path | None,
        typer.Option(
            metavar="JSON", help="DIR/costs.json of an earlier report, not measured anew."
        ),
    ] = None,
    validate: Annotated[
        bool, typer.Option("--validate", help="Compare with real runs on this machine first.")
    ] = False,
) -> None:
    """Simulate the farm on 10 to 10,000 ranks, from costs that are measured here.

    Costs of rows, messages, bookkeeping and writing: DIR/costs.json. Efficiency, idle tail and the
    master's memory for 1e4 to 1e7 rows, both writers and several sizes of blocks: DIR/scale.csv and
    DIR/scale.png. Some minutes.
    """
    from bench.scale.report import write_report

    paths, summary = write_report(output, costs, remark, validate=validate)
    typer.echo(summary)
    for path in paths:
        typer.echo(path)


def speedup(
    rows: Annotated[int, typer.Option(min=1, help="Rows of `paper` to generate.")] = 1000,
    rounds: Annotated[int, typer.Option(min=1, help="Repetitions; medians count.")] = 5,
) -> None:
    """Generate the same rows alone, with one MPI worker and with two, in turn, and compare.

    Start-up is not in the times. Two copies side by side show what two processors of this machine
    gain at best. Each line says how busy the whole machine was: with other users on it, two workers
    do not get two processors.
    """
    from bench.scale.speedup import measure, summary

    typer.echo(summary(measure(rows, rounds, remark)))
