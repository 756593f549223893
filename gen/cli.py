"""Commands of `python -m gen`; a command imports only the modules that it needs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from gen import options
from gen.runtime import command_line, farm, overtime
from gen.runtime.errors import InputError
from gen.runtime.numbers import rows_from
from gen.runtime.output import Output, check_outputs
from gen.runtime.terminal import echo

app = typer.Typer(add_completion=False, rich_markup_mode=None)


def main(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str
        Command, arguments and options, without the name of the program.
    """
    return command_line.main(app, "gen", arguments, together=["run"])


@app.callback()
def describe_program() -> None:
    """Generate databases of rough-surface contact, inspect them, and solve single problems."""


@app.command()
def run(
    scene: options.Scene,
    output: options.NewDatabase,
    rows: options.Rows = "",
    retry_failed: options.RetryFailed = False,
    force: options.Force = False,
    sample_limit: options.SampleLimit = None,
    writer: options.Writer = "auto",
    dry_run: options.DryRun = False,
) -> int:
    """Generate a database, or continue an interrupted run.

    A single process works serially. Under `mpiexec -n 9 python -m mpi4py -m gen run ...` rank 0
    hands out the samples and 8 workers compute them. An interrupted run finishes the samples that
    it has begun; the same command continues it.
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
    result = generate_database(request, world)
    if world.is_master:
        from gen import display

        display.print_result(output, result)
    return 128 + result.signal if result.signal and result.counts.pending else 0


@app.command()
def info(file: options.Database) -> None:
    """Summarise a database: rows, ranges beside the paper's, times, scene, versions."""
    from gen import display
    from gen.database import Reader

    with Reader(file) as reader:
        display.print_database(reader)


@app.command()
def contact(
    surface: options.SurfaceFile,
    side: options.Side = "",
    delta: options.Delta = "",
    force: options.NormalForce = "",
    pressure: options.Pressure = "",
    young: options.Young = None,
    poisson: options.Poisson = None,
    e_star: options.EStar = None,
    hardness: options.Hardness = None,
    unit: options.Unit = "",
    channel: options.Channel = "",
    override_scale: options.OverrideScale = False,
    fill: options.Fill = False,
    fill_most: options.FillMost = False,
    level: options.Level = "",
    crop: options.Crop = "",
    invert: options.Invert = False,
    mask: options.Mask = "",
    despike: options.Despike = None,
    form: options.Form = None,
    filter_: options.Filter = "",
    downsample: options.Downsample = None,
    boundary: options.Boundary = "free",
    kernel: options.Kernel = "uniform-pressure",
    far_field: options.FarField = "rigid",
    rtol: options.Tolerance = 2e-7,
    max_iterations: options.MaxIterations = 1000,
    table: options.Table = None,
    picture: options.Picture = None,
    flattened: options.Flattened = None,
) -> None:
    """Solve contact problems of one surface: area, force, pressure, gap, yielding, residual.

    Give one of --delta, --force and --pressure: a number, or for a law start:stop:count or several
    numbers with commas.
    """
    from gen import display
    from gen.material import combined_modulus, require_hardness
    from gen.measured import single
    from gen.measured.preparation import prepare, surface_warnings
    from gen.measured.settings import Preparation
    from gen.measured.topography import read
    from gen.runtime.table import write_csv

    load, values = single.chosen_load({"delta": delta, "force": force, "pressure": pressure})
    single.require_yielding(flattened, hardness)
    figure = _try_contact_outputs(surface, table, picture, flattened)
    material = bool(young or e_star)
    settings: dict[str, Any] = {
        "modulus": combined_modulus(young or [], poisson or [], e_star),
        "hardness": require_hardness(hardness, material=material),
        "kernel": kernel,
        "far_field": far_field,
        "rtol": rtol,
        "max_iterations": max_iterations,
    }
    preparation = Preparation(
        crop, invert, mask, despike, level, form, fill, fill_most, filter_, downsample
    )
    measured = read(
        surface, side, unit, channel=channel, override_scale=override_scale, boundary=boundary
    )
    topography = prepare(measured, preparation)
    contacts, warnings = display.follow_contacts(
        topography,
        surface_warnings(topography),
        single.solve_loads(topography, load, values, **settings),
        len(values),
        material=material,
    )
    if table is not None:
        write_csv(table, [single.contact_row(topography, solved, warnings) for solved in contacts])
    if flattened is not None:
        single.write_flattened(flattened, contacts[-1])
    if picture is not None:
        from gen.measured.contact_picture import Subject, draw_contacts

        subject = Subject(topography.name, load, material, warnings)
        draw_contacts(figure, contacts, subject, picture)


def _try_contact_outputs(
    surface: Path, table: Path | None, picture: Path | None, flattened: Path | None
) -> Any:
    """Refuse outputs of `contact` before anything is solved; return the figure to draw into."""
    outputs = [
        Output(table, "--csv"),
        Output(picture, "--plot", "picture"),
        Output(flattened, "--flattened", "heights"),
    ]
    check_outputs(outputs, [surface])
    return _try_picture(picture, 11, 8.2)


def _try_picture(picture: Path | None, width: float, height: float) -> Any:
    """Refuse a picture of no known format; return the figure to draw into, sides in inches."""
    if picture is None:
        return None
    from gen.runtime.figure import new_figure, require_picture_name

    require_picture_name(picture)
    return new_figure(width, height, dpi=110)


@app.command()
def describe(
    surface: options.SurfaceFile,
    side: options.Side = "",
    unit: options.Unit = "",
    channel: options.Channel = "",
    override_scale: options.OverrideScale = False,
    fill: options.Fill = False,
    fill_most: options.FillMost = False,
    level: options.Level = "",
    crop: options.Crop = "",
    invert: options.Invert = False,
    mask: options.Mask = "",
    despike: options.Despike = None,
    form: options.Form = None,
    filter_: options.Filter = "",
    downsample: options.Downsample = None,
    boundary: options.Boundary = "free",
    table: options.Table = None,
    picture: options.SurfacePicture = None,
) -> None:
    """Print the 22 roughness statistics and the parameters of ISO 25178 with their units."""
    from gen import display
    from gen.measured import single
    from gen.measured.areal import areal_parameters
    from gen.measured.preparation import prepare, surface_warnings, tilt
    from gen.measured.settings import Preparation
    from gen.measured.topography import read
    from gen.runtime.table import write_csv

    check_outputs([Output(table, "--csv"), Output(picture, "--plot", "picture")], [surface])
    figure = _try_picture(picture, 10.5, 8.6)
    preparation = Preparation(
        crop, invert, mask, despike, level, form, fill, fill_most, filter_, downsample
    )
    measured = read(
        surface, side, unit, channel=channel, override_scale=override_scale, boundary=boundary
    )
    topography = prepare(measured, preparation)
    warnings = surface_warnings(topography)
    display.print_preparation(topography, warnings)
    description = single.describe(topography)
    display.print_statistics(topography.heights, topography.spacing, tilt(measured), description)
    areal = areal_parameters(topography)
    display.print_areal(areal)
    if table is not None:
        row = single.statistics_row(topography, description, warnings)
        write_csv(table, [{**row, **areal.values}])
    if picture is not None:
        _draw_description(figure, topography, picture)


def _draw_description(figure: Any, topography: Any, picture: Path) -> None:
    """Fit the self-affine law to a surface, print it, and draw both."""
    from gen import display
    from gen.measured.self_affine import fit_self_affine, radial_spectrum
    from gen.measured.surface_picture import draw_surface

    spectrum = radial_spectrum(topography)
    fit = fit_self_affine(topography, spectrum)
    display.print_self_affine(fit)
    draw_surface(figure, topography, spectrum, fit, picture)


@app.command()
def plot(
    file: options.Database,
    output: options.NewPicture,
) -> None:
    """Draw a database: one surface and its pressure, all areas, all solve times."""
    from gen.picture import draw_database

    check_outputs([Output(output, "--output", "picture")], [file])
    draw_database(file, output)
    echo(f"wrote {output}")


@app.command()
def columns() -> None:
    """Print the columns of a database as a table in Markdown."""
    from gen.schema import markdown_table

    for line in markdown_table().splitlines():
        echo(line)


@app.command()
def check(
    file: options.Database,
    recompute: options.Recompute = 16,
    seed: options.Seed = 0,
) -> int:
    """Check a database: statuses, values and plan, and recompute N random rows.

    The exit code is 0 if everything is right, 1 if not.
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
    files: options.Databases,
    output: options.NewDatabase,
) -> None:
    """Join databases with rows of one scene that different jobs computed."""
    from gen import database

    pending, done, failed = database.merge(output, files)
    echo(f"{output}: {done} rows done, {failed} failed, {pending} pending")


@app.command()
def estimate(
    scene: options.SceneName,
    ranks: options.Ranks = 1,
) -> None:
    """Measure a few samples and predict time, memory and disk space of a run."""
    from gen import display
    from gen.generation import forecast
    from gen.scene import load

    loaded = load(scene)
    display.print_estimate(forecast.plan_of(loaded), forecast.estimate(loaded, ranks))
