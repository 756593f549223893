"""`python -m bench`: reports on how exact and how fast the packages are."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from gen import command_line
from gen.errors import InputError

Number = TypeVar("Number", int, float)

app = typer.Typer(add_completion=False, rich_markup_mode=None)

Folder = Annotated[
    Path, typer.Option("--output", "-o", metavar="DIR", help="The folder to write into.")
]


@app.callback()
def describe_program() -> None:
    """Reports on exactness and speed, each as a table (CSV) and a picture (PNG)."""


@app.command()
def hertz(output: Folder) -> None:
    """Press a paraboloid and compare with Hertz.

    Force and area against the displacement, for the closed form and for both kernels on 128 and on
    256 nodes a side, as in section 2.4 of the paper: DIR/hertz.csv and DIR/hertz.png.
    """
    from bench.hertz import write_report

    for path in write_report(output):
        typer.echo(path)


@app.command()
def outputs(
    scene: Annotated[str, typer.Argument(help="Scene whose first rows are computed.")] = "paper",
    rounds: Annotated[int, typer.Option(min=1, help="Repetitions; medians count.")] = 7,
) -> None:
    """Measure what each optional output of a database costs, and print it as a table."""
    from bench.outputs import markdown_table, measure

    typer.echo(markdown_table(measure(scene, rounds=rounds)))


@app.command()
def faults(
    rounds: Annotated[
        int | None, typer.Option(min=1, help="Faults to inject, 119 unless given.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of kinds, victims and moments.")] = 0,
    minutes: Annotated[float, typer.Option(min=0.0, help="No round begins later.")] = 30.0,
    only: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="A kind of the table, alone.")
    ] = None,
) -> int:
    """Disturb runs at random and see whether anything is lost, wrong or done twice.

    Signals to a run alone, to worker, master and mpiexec; full disks, files cut off, second
    writers; samples that raise, give NaN, do not converge, never end. Exit code 0 if as many faults
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
            remark=_remark,
        ):
            done.append(interrupted)
            typer.echo(line(len(done), interrupted))
    typer.echo(summary(done))
    missed = wanted - sum(interrupted.hit for interrupted in done)
    if missed > 0:
        typer.echo(f"{missed} of {wanted} faults could not be injected")
    return 1 if missed > 0 or any(interrupted.fault for interrupted in done) else 0


@app.command()
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

    numbers = _numbers("ranks", ranks, int)
    if min(numbers) < 2:
        raise InputError(f"ranks {ranks!r}: give 2 or more each, rank 0 is the master")
    if folder is not None and not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give one that exists")
    spec = Spec(rows=rows, rounds=rounds)
    typer.echo(f"{rows} rows with pressure fields, {spec.megabytes:,.0f} MB; {rounds} rounds")
    typer.echo(markdown_table(spec, measure(spec, numbers, folder)))


@app.command()
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

    paths, summary = write_report(output, costs, _remark, validate=validate)
    typer.echo(summary)
    for path in paths:
        typer.echo(path)


@app.command()
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

    typer.echo(summary(measure(rows, rounds, _remark)))


@app.command()
def memory(
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="The folder to write into."),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="May be repeated; all nine if left out."),
    ] = None,
    rows: Annotated[
        int, typer.Option(min=10, help="Training rows; the paper's are 12,703.")
    ] = 12_703,
) -> None:
    """Measure what fits of the nine models take at their peak, the dearest of each search space.

    Prints a table and writes DIR/memory.csv if asked to.
    """
    from bench.memory import measure, report

    typer.echo(report(measure(model or [], rows, _remark), output))


@app.command()
def stability(
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="The folder to write into."),
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="The slow cases too.")] = False,
    of: Annotated[
        list[str] | None,
        typer.Option(metavar="TABLE", help="solver, surfaces or models alone; may be repeated."),
    ] = None,
) -> int:
    """Ask for what is stiff and extreme, and check every answer independently.

    Of the solver, of surfaces (generators and statistics) and of the nine models with their
    features: prints a table each and writes DIR/stability.csv, surfaces.csv and models.csv if asked
    to. Exit code 0 if all cases passed, 1 otherwise.
    """
    from bench.stability.report import report

    return 0 if report(output, full=full, of=of or ()) else 1


@app.command()
def solver(
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="The folder to write into."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Small grids: a look in seconds.")] = False,
    default_tolerance: Annotated[
        bool, typer.Option("--default-tolerance", help="Print what the default's choice rests on.")
    ] = False,
    samples: Annotated[
        int, typer.Option(min=1, help="Rows of the paper preset for --default-tolerance.")
    ] = 1000,
) -> None:
    """Measure the solver's error against its cost.

    Force, area and pressure over wall time and over applications of the influence matrix, for the
    tolerance, the grid, both kernels, both precisions and other solvers where they are installed:
    DIR/solver.csv, DIR/solver.png, and DIR/solver.json for where and with what.
    """
    if default_tolerance:
        from bench.default_tolerance import markdown_table, right_counts

        typer.echo(markdown_table(right_counts(samples=samples)))
    elif output is None:
        raise InputError("solver: give -o DIR to write into, or --default-tolerance")
    else:
        from bench.work_precision.report import write_report
        from bench.work_precision.studies import FULL, QUICK

        for path in write_report(output, QUICK if quick else FULL, _remark):
            typer.echo(path)


@app.command()
def growth(
    output: Folder,
    nodes: Annotated[
        str, typer.Option(metavar="N,...", help="Nodes a side of the grids, each 2^k + 1.")
    ] = "129,257,513,1025",
    surfaces: Annotated[int, typer.Option(min=1, help="Surfaces, each of its own seed.")] = 3,
) -> None:
    """Measure how convolutions, time and memory of a solve grow with the grid.

    At 1, 10 and 50 % of the nodes in contact. Two minutes; with 2049 nodes a side and one surface
    some more. Prints a table, writes DIR/growth.csv and DIR/growth.png.
    """
    from bench.growth import growth, markdown_table, write_report

    rows = growth(_numbers("nodes", nodes, int), surfaces, remark=_remark)
    typer.echo(markdown_table(rows))
    for path in write_report(output, rows):
        typer.echo(path)


@app.command()
def peers(
    output: Folder,
    nodes: Annotated[
        str, typer.Option(metavar="N,...", help="Nodes a side of the grids, each 2^k + 1.")
    ] = "129,257",
    deltas: Annotated[
        str, typer.Option(metavar="UM,...", help="Displacements of the far field.")
    ] = "5,25,45",
    rounds: Annotated[int, typer.Option(min=1, help="Turns; medians count.")] = 4,
) -> None:
    """Compare with other solvers, and with the paper's algorithm, at equal accuracy.

    ContactMechanics, Tamaas and ASPHER where they are installed, on surfaces with H = 0.65 and
    sigma0 = 20 um: each at the loosest tolerance that gives force and contact well enough, timed
    in turn. Minutes at 129 and 257 nodes, much longer beyond. Prints tables, writes
    DIR/peers.csv and, where matplotlib is installed, DIR/peers.png.
    """
    from bench.peers.report import write_report

    sizes, loads = _numbers("nodes", nodes, int), _numbers("deltas", deltas, float)
    for path in write_report(output, sizes, loads, rounds, typer.echo):
        typer.echo(path)


PaperRows = Annotated[
    int, typer.Option(min=1, help="Rows of the paper preset; all of them unless given.")
]
PaperDatabase = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="A database of the paper preset, not generated anew."),
]
AreaMax = Annotated[
    float,
    typer.Option(metavar="PERCENT", help="Rows of larger area are left out; the paper's range."),
]


@app.command()
def generalisation(
    output: Folder,
    rows: PaperRows = 15_878,
    database: PaperDatabase = None,
    model: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="May be repeated; kernel-ridge.")
    ] = None,
    area_max: AreaMax = 16.56,
) -> None:
    """Test surrogates of the paper preset where they were not trained, as in section 4.3.

    A finer grid, unseen Hurst exponents, another generator, other scan lengths, with each feature
    set: scores, flagged rows, coverage of the 90 % intervals, and what mends a failure, which is
    tried. Generates databases in DIR/databases, goes on there after Ctrl-C; DIR/generalisation.csv
    and a picture for each model. Takes long with all rows; fewer give a look.
    """
    from bench.surrogates.generalisation import generalisation as measure
    from bench.surrogates.generalisation_report import show, write_report

    found = measure(
        output,
        rows,
        models=model or ["kernel-ridge"],
        given=database,
        area_max=area_max,
        remark=_remark,
    )
    show(found)
    for path in write_report(output, found):
        typer.echo(path)


@app.command()
def cost(
    output: Folder,
    rows: PaperRows = 15_878,
    database: PaperDatabase = None,
    comparison: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of learn tune: the time of its search is t_h, else 0."
        ),
    ] = None,
    area_max: AreaMax = 16.56,
    surfaces: Annotated[int, typer.Option(min=2, help="Surfaces that are timed.")] = 32,
) -> None:
    """Measure what a surrogate costs in all, and from how many queries on it pays (section 4.4).

    Database, tuning, fit and prediction, for the paper's solver and for ours, with each feature set
    of a kernel ridge surrogate, and its learning curves: DIR/cost.csv, learning.csv, cost.txt and
    cost.png. Takes long with all rows; fewer give a look.
    """
    from bench.surrogates.cost import cost as measure
    from bench.surrogates.cost_report import write_report

    found = measure(
        output,
        rows,
        given=database,
        comparison=comparison,
        area_max=area_max,
        surfaces=surfaces,
        remark=_remark,
    )
    paths, text = write_report(output, found)
    typer.echo(text)
    for path in paths:
        typer.echo(path)


@app.command()
def models(
    comparison: Annotated[Path, typer.Argument(help="Folder of learn compare and learn tune.")],
    output: Folder,
    target: Annotated[str, typer.Option(help="`area` or `force`.")] = "area",
) -> None:
    """Set the errors of the nine models against the times of prediction, fit and search.

    With the Pareto front marked: DIR/models.csv and DIR/models.png.
    """
    from bench.surrogates.models import costs, write_report

    for path in write_report(output, costs(comparison, target)):
        typer.echo(path)


@app.command()
def unstated(
    output: Folder,
    rows: Annotated[int, typer.Option(min=50, help="Rows of each database.")] = 1000,
) -> None:
    """Vary what the paper leaves unstated, one choice at a time, and show what that moves.

    Influence coefficients, far field, spacing, generator, sigma0, shares of Delta, simulations
    that were cut off; readings of bandwidth, peaks and asperities; an iteration that stops early.
    Generates a dozen databases in DIR/databases, goes on there after Ctrl-C; DIR/unstated.csv,
    readings.csv, early-stop.csv and unstated.png. Minutes.
    """
    from bench.unstated.report import write_report

    for path in write_report(output, rows, _remark):
        typer.echo(path)


@app.command()
def throughput(
    surrogate: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[SURROGATE]...", help="Files of learn fit; kernel ridge if none."),
    ] = None,
    rows: Annotated[
        int, typer.Option(min=50, help="Rows of the paper preset to fit to, where none is given.")
    ] = 2000,
    database: PaperDatabase = None,
    surfaces: Annotated[int, typer.Option(min=1, help="Surfaces of the paper preset.")] = 16,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="The folder to write into."),
    ] = None,
) -> None:
    """Measure contacts a second of surrogates, called in several ways, beside the solver's.

    Single calls and batches, with and without intervals; processor times. Prints a table and writes
    DIR/throughput.csv if asked to.
    """
    from bench.surrogates import throughput as calls

    asked = calls.loaded(surrogate) if surrogate else calls.fitted(database, rows, _remark)
    speeds = calls.throughput(asked, surfaces, _remark)
    typer.echo(calls.markdown_table(speeds))
    if output is not None:
        typer.echo(calls.write_report(output, speeds))


@app.command()
def tolerance(
    output: Folder,
    rows: Annotated[
        int, typer.Option(min=1, help="Rows of the paper preset; the paper has 15,878.")
    ] = 600,
    tolerances: Annotated[
        str, typer.Option(metavar="RTOL,...", help="Relative tolerances of the solver.")
    ] = "",
    area_max: AreaMax = 16.56,
) -> None:
    """Measure what the solver's tolerance does to surrogates that learn from its areas.

    The same rows at each tolerance: time of the database, errors of its areas, and errors of kernel
    ridge trained on them and tested on rows solved tightly: DIR/tolerance.csv, .txt and .png. Two
    minutes; goes on after Ctrl-C.
    """
    from bench.surrogates.tolerance import TOLERANCES
    from bench.surrogates.tolerance import tolerance as measure
    from bench.surrogates.tolerance_report import write_report

    asked = _numbers("tolerances", tolerances, float) if tolerances else TOLERANCES
    found = measure(output, rows, tolerances=asked, area_max=area_max, remark=_remark)
    paths, text = write_report(output, found)
    typer.echo(text)
    for path in paths:
        typer.echo(path)


@app.command()
def paper(
    output: Folder,
    rows: Annotated[
        int, typer.Option(min=100, help="Rows of the paper preset, where no database is given.")
    ] = 1000,
    database: PaperDatabase = None,
    fine: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A database on a finer grid, not generated anew."),
    ] = None,
    comparison: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of learn compare and learn tune, for the area."),
    ] = None,
    cost: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder of bench cost.")] = None,
) -> None:
    """Draw the paper's figures and tables anew, its numbers beside ours.

    What needs a comparison or costs is left out without them. Deviations are named, and explained
    where that is known. Goes on after Ctrl-C, and makes anew only what its inputs have changed.
    """
    from bench.paper.report import write_report

    given = {"--database": database, "--fine": fine, "--comparison": comparison, "--cost": cost}
    options = [f"{name} {path}" for name, path in given.items() if path is not None]
    command = " ".join(["python -m bench paper -o", str(output), *options])
    if database is None:
        command += f" --rows {rows}"
    for path in write_report(
        output,
        rows,
        given=database,
        finer=fine,
        comparison=comparison,
        costs=cost,
        command=command,
        remark=_remark,
    ):
        typer.echo(path)


@app.command()
def run(
    output: Folder,
    full: Annotated[
        bool, typer.Option("--full", help="Everything: hours. Else what fits into ten minutes.")
    ] = False,
    database: PaperDatabase = None,
    comparison: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of learn compare and tune; made if left out."),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="PART", help="May be repeated; all if left out.")
    ] = None,
) -> int:
    """Make all reports, and one page of them: DIR/index.html, which needs no network.

    Every part runs in turn as a command of its own, in DIR/PART, and is skipped where the same
    command of the same commit has made it before: after Ctrl-C the same command goes on. Exit code
    1 if a check failed or a part could not be made.
    """
    from bench.page.report import run as make

    path, outcome = make(
        output, _remark, full=full, database=database, comparison=comparison, only=only or ()
    )
    typer.echo(path)
    if outcome.signal:
        typer.echo("bench: interrupted; the same command goes on", err=True)
        return 128 + outcome.signal
    for name in outcome.failed:
        typer.echo(f"bench: {name} failed, see {path} or {output / name}", err=True)
    return 1 if outcome.failed else 0


@app.command()
def page(
    folder: Annotated[Path, typer.Argument(help="Folder of `bench run`.")],
    full: Annotated[bool, typer.Option("--full", help="It was made with --full.")] = False,
    comparison: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Comparison that it was made with.")
    ] = None,
) -> None:
    """Write the page of what a folder holds anew, and make nothing."""
    from bench.page.report import page as write

    typer.echo(write(folder, full=full, comparison=comparison))


def _numbers(name: str, text: str, kind: type[Number]) -> list[Number]:
    """Numbers with commas between them."""
    try:
        return [kind(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{name} {text!r}: give numbers with commas between them") from None


def _remark(line: str) -> None:
    """Tell how far a report is, beside its output."""
    typer.echo(line, err=True)


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code."""
    return command_line.call(app, "bench", arguments)


if __name__ == "__main__":
    # One thread, as in production: more would blur every time.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    sys.exit(main(sys.argv[1:]))
