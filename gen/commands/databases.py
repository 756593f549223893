"""Commands about databases: `gen run estimate info plot columns check merge export`."""

import re
import resource
import signal
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from gen import options
from gen.runtime import farm
from gen.runtime.command_line import Trust
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs, require_writable
from gen.runtime.terminal import command_to_type, echo, quoted

if TYPE_CHECKING:  # each command imports no more than it needs
    from collections.abc import Mapping, Sequence

    from gen.generation.check import Fault
    from gen.generation.means import PopulationMean
    from gen.generation.run import RunResult
    from gen.scene import ExpectedMean


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
    it has begun. The same command continues the run.
    """
    world = farm.this_world()
    row_numbers = _row_numbers(rows)
    _require_sample_limit(sample_limit)
    if dry_run:  # the other processes have nothing to do
        if world.is_master:
            _print_plan(scene, output)
        return 0
    from gen.generation.run import generate_database

    result = generate_database(
        scene,
        output,
        world,
        rows=row_numbers,
        retry_failed=retry_failed,
        force=force,
        limit=sample_limit,
        writer=writer,
    )
    if world.is_master:
        _print_result(result, output)
    if result.signal and result.counts.pending:
        # A shell gives this exit code to a process that a signal has ended.
        return 128 + result.signal
    return 0


def _row_numbers(text: str) -> range | None:
    """Return the rows A to B - 1 of the value "A:B" of the option --rows.

    Return None, for all rows, if the text is "". Raises InputError for any other text.
    """
    if not text:
        return None
    ends = re.fullmatch(r"([0-9]{1,18}):([0-9]{1,18})", text)
    if ends is None:
        raise InputError(f"--rows {quoted(text)}: give two row numbers, as 0:1000")
    return range(int(ends[1]), int(ends[2]))


def _require_sample_limit(seconds: float | None) -> None:
    """Refuse a time limit [s] of 0 or less, or above `farm.LONGEST_LIMIT`; None means no limit."""
    if seconds is not None and not 0 < seconds <= farm.LONGEST_LIMIT:
        raise InputError(
            f"--sample-limit {seconds:g}: give seconds, a number above 0, at most"
            f" {farm.LONGEST_LIMIT:g}"
        )


def _print_plan(scene: str, output: Path) -> None:
    """Print what a run of a scene, named or in a TOML file, would compute and write to `output`."""
    from gen.commands import printer
    from gen.generation.completion import completed, load_scene, recorded_scene

    loaded = load_scene(scene)
    recorded = recorded_scene(output, loaded)
    printer.print_plan(completed(loaded, recorded=recorded, watched=True), output)


def _print_result(result: "RunResult", output: Path) -> None:
    """Print how many rows of a database are done, failed and pending after a run.

    Warnings say how to learn why rows failed, and how pending rows can be computed.
    """
    counts = result.counts
    echo(
        f"{output}: {counts.done} rows done, {counts.failed} failed, {counts.pending} pending"
    )
    if counts.failed:
        info_command = command_to_type(f"gen info {output}")
        echo(f"warning: {counts.failed} rows failed; why: {info_command}")
    if result.overdue:
        echo(
            f"warning: {result.overdue} rows took longer than --sample-limit and are pending;"
            " the same command with a larger limit, or without one, computes them"
        )
    if counts.pending and result.signal:
        name = signal.Signals(result.signal).name
        echo(
            f"stopped by {name}; the same command goes on with the rows that are pending"
        )


def estimate(
    scene: options.Scene, ranks: options.Ranks = 1, trust: Trust = False
) -> None:
    """Measure a few samples and predict time, memory and disk space of a run."""
    from gen.commands import printer
    from gen.generation.completion import completed, load_scene
    from gen.generation.forecast import measured_time
    from gen.runtime.memory import format_bytes
    from gen.units import time_with_unit

    completed_scene = completed(load_scene(scene), watched=True)
    measured = measured_time(completed_scene)
    printer.print_plan(completed_scene)
    # Of several ranks, rank 0 is the master and computes nothing.
    workers = max(ranks - 1, 1)
    noun = "worker" if workers == 1 else "workers"
    time = _duration(completed_scene.samples * measured.mean / workers)
    echo(
        f"  time      {time} on {workers} {noun}: {time_with_unit(measured.mean)} a sample, mean"
        f" of {measured.samples} measured here"
    )
    # This process has worked as a worker does. A master takes less memory than a worker.
    peak_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # Linux counts in KiB
    memory = peak_kib * 1024 * ranks  # [bytes]
    echo(f"  memory    {format_bytes(memory)} on all ranks")


def _duration(seconds: float) -> str:
    """Write a duration as "1:02:03 h", or as seconds, such as "5.3 s", below a minute."""
    if seconds < 60:
        return f"{seconds:.2g} s"
    minutes, full_seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{full_seconds:02} h"


def info(file: options.Database) -> None:
    """Summarise a database: rows, ranges, times, scene, versions."""
    from gen.commands import printer
    from gen.database import Reader

    with Reader(file) as reader:
        printer.print_database(reader)


def plot(
    file: options.Database, output: options.NewPicture, trust: Trust = False
) -> None:
    """Draw one surface of a database and its pressure, and areas and solve times of all rows."""
    from gen.commands.picture import plot_database

    check_outputs([Output(output, "--output", kind="picture")], inputs=[file])
    plot_database(file, output)
    echo(f"wrote {output}")
    _print_doubts(file)


def columns() -> None:
    """Print the columns of a database as a table in Markdown."""
    from gen.scene import markdown_of_columns

    for line in markdown_of_columns():
        echo(line)


def check(
    context: typer.Context,
    file: options.DatabaseOrScene,
    recompute: options.Recompute = 16,
    seed: options.Seed = 0,
    repair: options.Repair = False,
    surfaces: options.FirstSurfaces = 64,
    expect: options.Expect = False,
    trust: Trust = False,
) -> int:
    """Check the statuses, checksums, values and plan of all rows, and compute N rows again.

    The means of all done rows are compared with those in the table [expect] of the scene, if it has
    one. FILE may also be a scene, whose first surfaces are computed and compared. The exit code is
    0 if the database has no fault or all faults have been repaired, and all means are as expected;
    otherwise 1.
    """
    if _is_scene(file):
        options.refuse(context, options.NOT_WITH_SCENE, "a scene")
        return _check_scene(file, surfaces, expect=expect)
    options.refuse(context, options.NOT_WITH_DATABASE, "a database")
    return _check_database(Path(file), recompute, seed, repair=repair, expect=expect)


def _is_scene(text: str) -> bool:
    """Tell whether a word names a TOML file, or a shipped scene and no file."""
    from gen.scene import preset_names

    path = Path(text)
    if path.suffix.lower() == ".toml":
        return True
    return text in preset_names() and not path.exists()


def _check_scene(name: str, surfaces: int, *, expect: bool) -> int:
    """Compute the first surfaces of a scene, and compare means with its table `[expect]`.

    With `expect`, print the means as such a table. Return the exit code. Raises InputError if
    there is nothing to compare and no table to print.
    """
    from gen.generation.completion import completed, load_scene
    from gen.generation.means import means_of_scene, proposed_columns

    scene = load_scene(name)
    if scene.expect is None and not expect:
        raise InputError(
            f"{name}: the scene has no table [expect], with which its means are compared; --expect"
            " prints one"
        )
    scene = completed(scene, watched=True)
    proposed = proposed_columns(scene) if expect else []
    names = list(dict.fromkeys([*(scene.expect or {}), *proposed]))
    means = means_of_scene(scene, surfaces, names)
    is_met = _print_compared(name, scene.expect, means)
    if expect:
        _print_table_of(means, proposed)
    return 0 if is_met else 1


def _check_database(
    file: Path, recompute: int, seed: int, *, repair: bool, expect: bool
) -> int:
    """Check a database as `check` says, and return the exit code."""
    from gen.database import Reader, lock
    from gen.schema import made_by_other_solver

    with ExitStack() as stack:
        if repair:
            stack.enter_context(lock(file))
        with Reader(file) as reader:
            other_solver = made_by_other_solver(int(reader.attributes["physics"]))
            counts = reader.counts()
        # The reader comes first: its error for a file of another kind is clearer than this one.
        if repair:
            require_writable(file)
        if other_solver and recompute:
            echo(
                f"{file}: {other_solver}: of rows computed again, only the surfaces are compared"
            )
        faults = _print_faults(file, recompute, seed)
        if faults and repair:
            return _repair(file, faults, other_solver)
    if not faults:
        compared = min(recompute, counts.done + counts.failed)
        equal = "with the same surfaces" if other_solver else "equal bit for bit"
        echo(
            f"{file}: sound; {counts.done} rows done, {counts.failed} failed, {counts.pending}"
            f" pending; {compared} of them computed again, {equal}"
        )
    is_met = _print_means(file, expect=expect)
    _print_doubts(file)
    return 0 if is_met and not faults else 1


def _print_means(file: Path, *, expect: bool) -> bool:
    """Compare means of a database with those that its scene expects, and tell whether they agree.

    With `expect`, the means are printed as a table `[expect]` too.
    """
    from gen.database import Reader
    from gen.generation.means import means_of_database, proposed_columns
    from gen.scene import require_expected_columns

    with Reader(file) as reader:
        scene = reader.scene
        if scene.expect is None and not expect:
            return True
        require_expected_columns(scene)
        proposed = proposed_columns(scene) if expect else []
        names = list(dict.fromkeys([*(scene.expect or {}), *proposed]))
        means = means_of_database(reader, names)
    is_met = _print_compared(file, scene.expect, means)
    if expect:
        _print_table_of(means, proposed)
    return is_met


def _print_compared(
    place: Path | str,
    expected: "Mapping[str, ExpectedMean] | None",
    means: "Sequence[PopulationMean]",
) -> bool:
    """Print each expected mean beside the one of the rows, and tell whether all agree.

    `place` is the file or scene that the lines name.
    """
    from gen.generation.means import compared_means

    compared = compared_means(expected or {}, means)
    for mean in compared:
        echo(f"{place}: {mean.in_words}")
    return all(mean.is_met for mean in compared)


def _print_table_of(means: "Sequence[PopulationMean]", names: "Sequence[str]") -> None:
    """Print those of the means that have these names as a table `[expect]` in TOML."""
    from gen.generation.means import toml_of

    for line in toml_of([mean for mean in means if mean.column in names]):
        echo(line)


def _print_faults(file: Path, recompute: int, seed: int) -> "list[Fault]":
    """Print each fault of a database as soon as it is known, and return all faults.

    `recompute` rows are chosen by a random generator with this `seed`, and computed again.
    """
    from gen.generation.check import faults

    printed = []
    for fault in faults(file, recompute, seed):
        echo(f"{file}: {fault}")
        printed.append(fault)
    return printed


def _repair(file: Path, faults: "list[Fault]", other_solver: str) -> int:
    """Make damaged rows pending, and print how many became pending and how many stay faulty.

    If another solver computed the rows, all of them stay, and `other_solver` says so in words; it
    is "" if this version's solver computed them. Return the exit code: 0 if every faulty row is
    pending now, else 1.
    """
    from gen.generation.check import repair

    repaired = repair(file, faults)
    if repaired.pending.size:
        run_command = command_to_type("gen run")
        echo(
            f"{file}: {_rows_are(repaired.pending.size)} pending now; the same {run_command}"
            " computes them again"
        )
    if not repaired.left_faulty.size:
        return 0
    reason = "the bytes are those that were written, perhaps by another machine"
    if other_solver:
        reason = other_solver
    echo(f"{file}: {_rows_are(repaired.left_faulty.size)} left as before: {reason}")
    return 1


def _rows_are(number: int) -> str:
    """Return "1 row is", or "2 rows are" for any other number."""
    return f"{number} row is" if number == 1 else f"{number} rows are"


def _print_doubts(file: Path) -> None:
    """Print doubts about the results in a database, as part of the report on standard output.

    Each doubt is a line. It is a warning about the physics, not a fault of the file.
    """
    from gen.database import Reader
    from gen.generation.trial import doubts_after

    with Reader(file) as reader:
        for doubt in doubts_after(reader):
            echo(f"{file}: warning: {doubt}")


def merge(files: options.Databases, output: options.NewDatabase) -> None:
    """Join databases of one scene whose rows were computed by different jobs."""
    from gen import database

    counts = database.merge(output, files)
    echo(
        f"{output}: {counts.done} rows done, {counts.failed} failed, {counts.pending} pending"
    )
    with database.Reader(output) as reader:
        damage = reader.damage()
        if damage:
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

    The same command continues an interrupted export. It also renews an export whose database has
    grown since.
    """
    from gen.database import Reader
    from gen.export import About
    from gen.export import export as export_to
    from gen.runtime.memory import format_bytes

    with Reader(file) as reader:
        about = About.of(reader, title, creator, licence, doi)
        exported = export_to(reader, output, about)
        damage = reader.damage()
    remark = f"; {exported.left_out} failed or pending" if exported.left_out else ""
    echo(f"{output}: {exported.rows} rows{remark}, {format_bytes(exported.size)}")
    if damage:
        echo(f"warning: {file}: {damage}", err=True)
