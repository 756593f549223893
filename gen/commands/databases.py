"""`gen run`, `estimate`, `info`, `plot`, `columns`, `check`, `merge`, `export`: databases."""

import re
import resource
import signal
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from gen import options
from gen.runtime import farm
from gen.runtime.command_line import Trust
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs, require_writable
from gen.runtime.terminal import command_to_type, echo, quoted

if TYPE_CHECKING:  # each command imports no more than it needs
    from gen.generation.check import Fault


def run(
    scene: options.Scene,
    output: options.NewDatabase,
    rows: options.Rows = "",
    retry_failed: options.RetryFailed = False,
    force: options.Force = False,
    sample_limit: options.SampleLimit = None,
    writer: options.Writer = "auto",
    dry_run: options.DryRun = False,
    trust: Trust = False,
) -> int:
    """Generate a database, or continue an interrupted run.

    A single process works serially. Under `mpiexec -n 9 python -m mpi4py -m gen run ...` rank 0
    hands out the samples and 8 workers compute them. An interrupted run finishes the samples that
    it has begun; the same command continues it.
    """
    world = farm.this_world()
    ends = re.fullmatch(r"([0-9]{1,18}):([0-9]{1,18})", rows)
    if rows and not ends:
        raise InputError(f"--rows {quoted(rows)}: give two row numbers, as 0:1000")
    if sample_limit is not None and not 0 < sample_limit <= farm.LONGEST_LIMIT:
        raise InputError(
            f"--sample-limit {sample_limit:g}: give seconds, a number above 0, at most"
            f" {farm.LONGEST_LIMIT:g}"
        )
    if dry_run:
        if world.is_master:
            from gen.commands import printer
            from gen.generation.completion import completed
            from gen.scene import load

            printer.print_plan(completed(load(scene)), output)
        return 0
    from gen.generation.run import generate_database

    result = generate_database(
        scene,
        output,
        world,
        rows=range(int(ends[1]), int(ends[2])) if ends else None,
        retry_failed=retry_failed,
        force=force,
        limit=sample_limit,
        writer=writer,
    )
    if world.is_master:
        pending, done, failed = result.counts
        echo(f"{output}: {done} rows done, {failed} failed, {pending} pending")
        if failed:
            echo(
                f"warning: {failed} rows failed; why: {command_to_type(f'gen info {output}')}"
            )
        if result.overdue:
            echo(
                f"warning: {result.overdue} rows took longer than --sample-limit and are pending;"
                " the same command with a larger one, or without, goes on with them"
            )
        if pending and result.signal:
            stop = signal.Signals(result.signal).name
            echo(
                f"stopped by {stop}; the same command goes on with the rows that are pending"
            )
    return 128 + result.signal if result.signal and result.counts.pending else 0


def estimate(
    scene: options.Scene, ranks: options.Ranks = 1, trust: Trust = False
) -> None:
    """Measure a few samples and predict time, memory and disk space of a run."""
    from gen.commands import printer
    from gen.generation.completion import completed
    from gen.generation.forecast import measured_time
    from gen.runtime.memory import format_bytes
    from gen.scene import load

    loaded = completed(load(scene))
    mean, measured = measured_time(loaded)
    printer.print_plan(loaded)
    workers = max(ranks - 1, 1)
    seconds = loaded.samples * mean / workers
    hours, rest = divmod(round(seconds), 3600)
    time = (
        f"{hours}:{rest // 60:02}:{rest % 60:02} h"
        if seconds >= 60
        else f"{seconds:.2g} s"
    )
    echo(
        f"  time      {time} on {workers} {'workers' if workers > 1 else 'worker'}:"
        f" {1e3 * mean:.2f} ms a sample, mean of {measured} measured here"
    )
    # Linux counts the largest resident set in KiB. A master holds less than a worker.
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 * ranks
    echo(f"  memory    {format_bytes(memory)} on all ranks")


def info(file: options.Database) -> None:
    """Summarise a database: rows, ranges, times, scene, versions."""
    from gen.commands import printer
    from gen.database import Reader

    with Reader(file) as reader:
        printer.print_database(reader)


def plot(
    file: options.Database, output: options.NewPicture, trust: Trust = False
) -> None:
    """Draw a database: one surface and its pressure, all areas, all solve times."""
    from gen.commands.picture import draw_database

    check_outputs([Output(output, "--output", "picture")], [file])
    draw_database(file, output)
    echo(f"wrote {output}")
    _echo_doubts(file)


def columns() -> None:
    """Print the columns of a database as a table in Markdown."""
    from gen.scene import markdown_of_columns

    for line in markdown_of_columns():
        echo(line)


def check(
    file: options.Database,
    recompute: options.Recompute = 16,
    seed: options.Seed = 0,
    repair: options.Repair = False,
    trust: Trust = False,
) -> int:
    """Check a database: statuses, checksums, values and plan of all rows, and N rows recomputed.

    The exit code is 0 if everything is right or has been repaired, 1 if not.
    """
    from gen.database import Reader, lock
    from gen.generation.check import faults
    from gen.schema import made_by_another

    with ExitStack() as stack:
        if repair:
            stack.enter_context(lock(file))
        with Reader(file) as reader:
            another = made_by_another(int(reader.attributes["physics"]))
            pending, done, failed = reader.counts()
        if repair:
            require_writable(file)
        if another and recompute:
            echo(
                f"{file}: {another}: of rows computed again, only the surfaces are compared"
            )
        found = []
        for fault in faults(file, recompute, seed):
            found.append(fault)
            echo(f"{file}: {fault}")
        if found and repair:
            return _repair(file, found, another)
    if not found:
        again = min(recompute, done + failed)
        equal = "with the same surfaces" if another else "equal bit for bit"
        echo(
            f"{file}: sound; {done} rows done, {failed} failed, {pending} pending; {again} of them"
            f" computed again, {equal}"
        )
    _echo_doubts(file)
    return 1 if found else 0


def _repair(file: Path, faults: "list[Fault]", another: str) -> int:
    """Make damaged rows pending, and say so; return 0 if no other row has a fault."""
    from gen.generation.check import repair

    pending, left = repair(file, faults)
    if pending.size:
        rows = "row is" if pending.size == 1 else "rows are"
        run = command_to_type("gen run")
        echo(
            f"{file}: {pending.size} {rows} pending now; the same {run} computes them again"
        )
    if left.size:
        rows = "row is" if left.size == 1 else "rows are"
        reason = (
            another or "the bytes are those that were written, perhaps by another machine"
        )
        echo(f"{file}: {left.size} {rows} left as before: {reason}")
    return 1 if left.size else 0


def _echo_doubts(file: Path) -> None:
    """Print the doubts about a database by its rows, which are no faults of the file."""
    from gen.database import Reader
    from gen.generation.trial import doubts_after

    with Reader(file) as reader:
        for doubt in doubts_after(reader):
            echo(f"{file}: warning: {doubt}")


def merge(files: options.Databases, output: options.NewDatabase) -> None:
    """Join databases with rows of one scene that different jobs computed."""
    from gen import database

    pending, done, failed = database.merge(output, files)
    echo(f"{output}: {done} rows done, {failed} failed, {pending} pending")
    with database.Reader(output) as reader:
        if damage := reader.damage():
            echo(f"warning: {damage}", err=True)


def export(
    file: options.Database,
    output: options.ExportFolder,
    title: options.Title = "",
    creator: options.Creator = "",
    licence: options.Licence = "",
    doi: options.Doi = "",
) -> None:
    """Write a database as Parquet files with a data card and Croissant's description.

    The same command continues an interrupted export, and renews one of a database that has grown.
    """
    from gen.database import Reader
    from gen.export import About
    from gen.export import export as export_to
    from gen.runtime.memory import format_bytes

    with Reader(file) as reader:
        about = About.of(reader, title, creator, licence, doi)
        rows, rest, count = export_to(reader, output, about)
        damage = reader.damage()
    left_out = f"; {rest} failed or pending" if rest else ""
    echo(f"{output}: {rows} rows{left_out}, {format_bytes(count)}")
    if damage:
        echo(f"warning: {file}: {damage}", err=True)
