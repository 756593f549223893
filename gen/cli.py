"""The commands of `python -m gen`. Each imports what it needs, and only that."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from gen.runtime import command_line, farm, overtime
from gen.runtime.errors import InputError
from gen.runtime.numbers import rows_from
from gen.runtime.output import Output, check_outputs
from gen.runtime.terminal import echo

app = typer.Typer(add_completion=False, rich_markup_mode=None)

Database = Annotated[Path, typer.Argument(metavar="FILE", help="A database (HDF5).")]
SurfaceFile = Annotated[
    Path,
    typer.Argument(
        metavar="SURFACE",
        help="Heights: .npy, text, or an instrument's file (x3p, sur, al3d, opd, plu, gwy ...).",
    ),
]
Side = Annotated[
    str,
    typer.Option(
        metavar="UM",
        help="Scan length in um where the file has none; two for an oblong patch: 1000,500.",
    ),
]
Unit = Annotated[
    str, typer.Option(metavar="UNIT", help="Of the file where it says none: m, mm, um, nm or A.")
]
Channel = Annotated[
    str, typer.Option(metavar="NAME", help="Channel of a file with several, or its index.")
]
OverrideScale = Annotated[
    bool, typer.Option("--override-scale", help="Let --side and --unit overrule the file's own.")
]
Fill = Annotated[bool, typer.Option("--fill", help="Close holes harmonically.")]
FillMost = Annotated[
    bool, typer.Option("--fill-most", help="Fill even if more than half is missing.")
]
Level = Annotated[
    str, typer.Option(metavar="HOW", help="Take away the mean, the plane or the quadratic fit.")
]
Crop = Annotated[
    str, typer.Option(metavar="X0:X1,Y0:Y1", help="Keep this part only, in um from the first node.")
]
Invert = Annotated[
    bool, typer.Option("--invert", help="Turn upside down: heights point into the material.")
]
Table = Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write a table too.")]


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code."""
    return command_line.main(app, "gen", arguments, together=["run"])


@app.callback()
def describe_program() -> None:
    """Databases of rough-surface contact: generate them, look into them, try one problem."""


@app.command()
def run(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="quick, paper, fine, paper-mirco, extreme, or the path of a TOML file.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The database to write.")
    ],
    rows: Annotated[
        str, typer.Option(metavar="A:B", help="Only the rows A to B - 1: a job array's share.")
    ] = "",
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Compute failed rows again.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Go on with a file of another physics number.")
    ] = False,
    sample_limit: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Leave samples pending that take longer; which do depends on the machine.",
        ),
    ] = None,
    writer: Annotated[
        Literal["auto", "single", "parallel"],
        typer.Option(
            help="Who writes: rank 0 (single), every worker its own rows (parallel, where h5py"
            " has MPI), or the latter where it can be had (auto)."
        ),
    ] = "auto",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be generated, and write nothing.")
    ] = False,
) -> int:
    """Generate a database, or go on where an earlier run stopped.

    Alone it works serially; started as `mpiexec -n 9 python -m mpi4py -m gen run ...` rank 0 hands
    out the samples, the others compute, and either of them write. Interrupted, it finishes what is
    in flight; the same command goes on.
    """
    world = farm.this_world()
    share = rows_from(rows)
    if sample_limit is not None and not 0 < sample_limit <= overtime.LONGEST:
        raise InputError(
            f"--sample-limit {sample_limit:g}: give seconds, a number above 0, at most"
            f" {overtime.LONGEST:g}"
        )
    if dry_run:
        if world.is_master:
            from gen import display
            from gen.generation.forecast import plan_of
            from gen.scene import load

            display.print_plan(plan_of(load(scene)), output)
        return 0
    from gen.generation.run import Request, generate_database

    request = Request(scene, output, share, retry_failed, force, sample_limit, writer)
    outcome = generate_database(request, world)
    if world.is_master:
        from gen import display

        display.print_outcome(output, outcome)
    return 128 + outcome.signal if outcome.signal and outcome.counts.pending else 0


@app.command()
def info(file: Database) -> None:
    """Show what a database holds: rows, ranges beside the paper's, times, scene, versions."""
    from gen import display
    from gen.database import Reader

    with Reader(file) as reader:
        display.print_database(reader)


@app.command()
def contact(
    surface: SurfaceFile,
    side: Side = "",
    delta: Annotated[
        str, typer.Option(metavar="UM", help="Far-field displacement from first touch in um.")
    ] = "",
    force: Annotated[str, typer.Option(metavar="UN", help="Or the normal force in uN.")] = "",
    pressure: Annotated[
        str, typer.Option(metavar="MPA", help="Or the mean pressure over the whole patch in MPa.")
    ] = "",
    young: Annotated[
        list[float] | None,
        typer.Option(metavar="MPA", help="Young's modulus, twice for two elastic bodies [1]."),
    ] = None,
    poisson: Annotated[
        list[float] | None, typer.Option(metavar="NU", help="Poisson's ratio, as often [0].")
    ] = None,
    e_star: Annotated[
        float | None, typer.Option(metavar="MPA", help="Or E* of both bodies together.")
    ] = None,
    unit: Unit = "",
    channel: Channel = "",
    override_scale: OverrideScale = False,
    fill: Fill = False,
    fill_most: FillMost = False,
    level: Level = "",
    crop: Crop = "",
    invert: Invert = False,
    kernel: Annotated[
        str, typer.Option(help="uniform-pressure or concentrated-force.")
    ] = "uniform-pressure",
    far_field: Annotated[str, typer.Option(help="rigid or compliant.")] = "rigid",
    rtol: Annotated[float, typer.Option(help="Residual to reach, over Delta.")] = 2e-7,
    max_iterations: Annotated[int, typer.Option(help="Bound on the solver's iterations.")] = 1000,
    table: Table = None,
    picture: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE", help="Draw heights, spots, a section.")
    ] = None,
) -> None:
    """Solve contact problems of one surface: area, force, pressure, gap, residual.

    Give one of --delta, --force and --pressure: a number, or for a law start:stop:count or several
    with commas.
    """
    from gen import display
    from gen.measured import single
    from gen.measured.material import combined_modulus
    from gen.measured.preparation import prepare, warnings_about
    from gen.measured.topography import read
    from gen.runtime.table import write_csv

    load, values = single.chosen_load({"delta": delta, "force": force, "pressure": pressure})
    check_outputs([Output(table, "--csv"), Output(picture, "--plot", "picture")], [surface])
    if picture is not None:
        from gen.measured.contact_picture import Subject, draw_contacts
        from gen.picture import new_figure

        figure = new_figure(picture)
    settings: dict[str, Any] = {
        "modulus": combined_modulus(young or [], poisson or [], e_star),
        "kernel": kernel,
        "far_field": far_field,
        "rtol": rtol,
        "max_iterations": max_iterations,
    }
    topography = prepare(
        read(surface, side, unit, channel=channel, override_scale=override_scale),
        crop=crop,
        invert=invert,
        level=level,
        fill=fill,
        fill_most=fill_most,
    )
    material = bool(young or e_star)
    contacts, warnings = display.followed(
        topography,
        warnings_about(topography),
        single.solve_loads(topography, load, values, **settings),
        len(values),
        material=material,
    )
    if table is not None:
        rows = [single.contact_row(topography, contact, warnings) for contact in contacts]
        write_csv(table, rows)
    if picture is not None:
        subject = Subject(topography.name, load, material, warnings)
        draw_contacts(figure, contacts, subject, picture)


@app.command()
def describe(
    surface: SurfaceFile,
    side: Side = "",
    unit: Unit = "",
    channel: Channel = "",
    override_scale: OverrideScale = False,
    fill: Fill = False,
    fill_most: FillMost = False,
    level: Level = "",
    crop: Crop = "",
    invert: Invert = False,
    table: Table = None,
) -> None:
    """Print the 22 roughness statistics of a surface, with their units."""
    from gen import display
    from gen.measured import single
    from gen.measured.preparation import prepare, tilt, warnings_about
    from gen.measured.topography import read
    from gen.runtime.table import write_csv

    check_outputs([Output(table, "--csv")], [surface])
    measured = read(surface, side, unit, channel=channel, override_scale=override_scale)
    topography = prepare(
        measured, crop=crop, invert=invert, level=level, fill=fill, fill_most=fill_most
    )
    warnings = warnings_about(topography)
    display.print_preparation(topography, warnings)
    description = single.describe(topography)
    display.print_statistics(topography.heights, topography.spacing, tilt(measured), description)
    if table is not None:
        write_csv(table, [single.statistics_row(topography, description, warnings)])


@app.command()
def plot(
    file: Database,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="PNG", help="The picture to write.")
    ],
) -> None:
    """Draw what a database holds: one surface, its pressure, the areas, the solve times."""
    from gen.picture import draw_database

    check_outputs([Output(output, "--output", "picture")], [file])
    draw_database(file, output)
    echo(f"wrote {output}")


@app.command()
def columns() -> None:
    """Print the table of columns of a database, in Markdown."""
    from gen.schema import markdown_table

    for line in markdown_table().splitlines():
        echo(line)


@app.command()
def check(
    file: Database,
    recompute: Annotated[
        int, typer.Option(metavar="N", min=0, help="Rows to compute again, bit for bit.")
    ] = 16,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the choice of rows.")] = 0,
) -> int:
    """Check a database: statuses, values, its plan, and N random rows computed again.

    Exit code 0 if all is well, 1 if not.
    """
    from gen.database import Reader
    from gen.generation.check import faults

    count = 0
    for fault in faults(file, recompute, seed):
        count += 1
        echo(f"{file}: {fault}")
    if not count:
        with Reader(file) as reader:
            pending, done, failed = reader.counts()
        again = min(recompute, done + failed)
        echo(
            f"{file}: sound; {done} rows done, {failed} failed, {pending} pending; {again} of them"
            " computed again, equal bit for bit"
        )
    return 1 if count else 0


@app.command()
def merge(
    files: Annotated[list[Path], typer.Argument(metavar="FILES", help="Databases of one scene.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The database to write.")
    ],
) -> None:
    """Join databases whose rows were computed by different jobs."""
    from gen import database

    pending, done, failed = database.merge(output, files)
    echo(f"{output}: {done} rows done, {failed} failed, {pending} pending")


@app.command()
def estimate(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene's name, or a TOML file.")],
    ranks: Annotated[
        int, typer.Option(min=1, help="Processes of the run; rank 0 computes nothing.")
    ] = 1,
) -> None:
    """Measure a few samples and say what the run takes: time, memory, disk."""
    from gen import display
    from gen.generation import forecast
    from gen.scene import load

    asked_for = load(scene)
    display.print_estimate(forecast.plan_of(asked_for), forecast.estimate(asked_for, ranks))
