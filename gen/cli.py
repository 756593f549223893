"""Commands of `python -m gen`; a command imports only the modules that it needs."""

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import typer

from gen import options
from gen.option_groups import Against, Files, Reading
from gen.runtime import command_line, farm, overtime
from gen.runtime.errors import InputError
from gen.runtime.numbers import require_share, rows_from, shown
from gen.runtime.option_groups import grouped, typed
from gen.runtime.output import Output, check_outputs
from gen.runtime.terminal import echo

app = typer.Typer(add_completion=False, rich_markup_mode=None)


def main(arguments: Sequence[str], name: str = "gen") -> int:
    """Run one command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str
        Command, arguments and options, without the name of the program.
    name : str
        Name of the program as the user typed it, for messages.
    """
    return command_line.main(app, name, arguments, together=["run"])


@app.callback()
def describe_program(*, version: command_line.Version = False) -> None:
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
            from gen.generation.completion import completed
            from gen.generation.forecast import plan_of
            from gen.scene import load

            display.print_plan(plan_of(completed(load(scene))), output)
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
    against: options.Against = None,
    against_options: options.AgainstOptions = None,
    turned: options.Turned = "",
    shift: options.Shift = "",
    boundary: options.Boundary = "free",
    kernel: options.Kernel = "uniform-pressure",
    far_field: options.FarField = "rigid",
    rtol: options.Tolerance = 2e-7,
    max_iterations: options.MaxIterations = 1000,
    spots: options.Spots = False,
    stiffness: options.Stiffness = False,
    conductivity: options.Conductivity = None,
    threads: options.Threads = None,
    table: options.Table = None,
    picture: options.Picture = None,
    flattened: options.Flattened = None,
) -> None:
    """Solve contact problems of one surface: area, force, pressure, gap, yielding, residual.

    With --spots, --stiffness and --conductivity also spots, stiffness and conductance.

    Give one of --delta, --force and --pressure: a number, or for a law start:stop:count, with :log
    for an even ratio, or several numbers with commas.
    """
    from bem.workers import cores, default_threads, on_threads
    from gen import display
    from gen.material import combined_modulus, require_hardness
    from gen.measured import single
    from gen.measured.outcome import Wanted, require_conductivities
    from gen.measured.preparation import surface_warnings
    from gen.measured.settings import Preparation
    from gen.measured.source import Source, surface_of
    from gen.runtime.table import write_csv

    load, values = single.chosen_load({"delta": delta, "force": force, "pressure": pressure})
    single.require_yielding(flattened, hardness)
    wanted = Wanted(spots, stiffness, require_conductivities(conductivity or []))
    inputs = [surface] if against is None else [surface, against]
    figure = _try_contact_outputs(inputs, table, picture, flattened)
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
    source = Source(surface, side, unit, channel, override_scale, preparation)
    opposite = _opposite(source, against, against_options, turned, shift)
    topography, _ = surface_of(source, opposite, boundary)
    with on_threads(threads or default_threads(cores())):
        contacts, warnings = display.follow_contacts(
            topography,
            surface_warnings(topography),
            single.solve_loads(topography, load, values, **settings),
            len(values),
            wanted=wanted,
            material=material,
        )
    if table is not None:
        rows = [single.contact_row(topography, each, warnings, wanted) for each in contacts]
        write_csv(table, rows)
    if flattened is not None:
        single.write_flattened(flattened, contacts[-1])
    if picture is not None:
        from gen.measured.contact_picture import Subject, draw_contacts

        subject = Subject(topography.name, load, material, warnings, spots=spots)
        draw_contacts(figure, contacts, subject, picture)


def _try_contact_outputs(
    inputs: list[Path], table: Path | None, picture: Path | None, flattened: Path | None
) -> Any:
    """Refuse outputs of `contact` before anything is solved; return the figure to draw into."""
    outputs = [
        Output(table, "--csv"),
        Output(picture, "--plot", "picture"),
        Output(flattened, "--flattened", "heights"),
    ]
    check_outputs(outputs, inputs)
    return _try_picture(picture, 11, 8.2)


def _opposite(source: Any, against: Path | None, text: str | None, turned: str, shift: str) -> Any:
    """Return the second body that the options name, None if they name none."""
    from gen.measured.composite import Placement
    from gen.measured.source import Opposite

    if against is None:
        given = {"--against-options": text is not None, "--turned": turned, "--shift": shift}
        for option in (name for name, value in given.items() if value):
            raise InputError(f"{option}: needs --against, the second rough body")
        return None
    placement = Placement.parse(turned, shift)
    if text is None:
        return Opposite(replace(source, path=against), placement)
    return Opposite(_source_of(against, text), placement, shared=False)


def _source_of(path: Path, text: str) -> Any:
    """Return a surface that is read and prepared by the options in a text."""
    from gen.measured.source import READING, STEPS, Source

    named = f"--against-options {shown(text)}"
    command: Any = typer.main.get_command(app)
    parser = command.commands["describe"]
    try:
        arguments = [str(path.absolute()), *shlex.split(text)]
        context = parser.make_context("describe", arguments, help_option_names=[])
    except command_line.CommandLineError as error:
        raise InputError(f"{named}: {error.format_message()}") from None
    except ValueError as error:  # a quotation mark that is not closed
        raise InputError(f"{named}: {error}") from None
    for option in parser.params:
        typed = context.get_parameter_source(option.name).name == "COMMANDLINE"
        if typed and option.name not in {"surface", *READING, *STEPS}:
            raise InputError(f"{named}: {option.opts[0]} is not for one body alone")
    return Source.of_options(path, context.params)


def _try_picture(picture: Path | None, width: float, height: float) -> Any:
    """Refuse a picture of no known format; return the figure to draw into, sides in inches."""
    if picture is None:
        return None
    from gen.runtime.figure import new_figure, require_picture_name

    require_picture_name(picture)
    return new_figure(width, height, dpi=110)


@app.command()
@grouped
def law(
    context: typer.Context,
    inputs: options.Surfaces,
    delta: options.Deltas = "",
    pressure: options.Pressures = "",
    young: options.Young = None,
    poisson: options.Poisson = None,
    e_star: options.EStar = None,
    hardness: options.Hardness = None,
    conductivity: options.Conductivity = None,
    boundary: options.LawBoundary = "mirror",
    surfaces: options.Population = 50,
    band: options.Band = 0.9,
    output: options.LawFiles = None,
    *,
    files: Files,
    reading: Reading,
    facing: Against,
) -> None:
    """Tabulate the law of an interface: closure, area, gap, conductance over nominal pressure.

    The solver presses one surface, or a population, whose means and quantiles the tables then hold.
    The patch is a piece of a larger interface, continued by its mirror images, so that the closure
    is the interface's alone: what a mesh adds to the bodies' own deformation.
    """
    from gen.law import Order, by_solver
    from gen.law.table import show
    from gen.law.writers import write
    from gen.material import combined_modulus, require_hardness
    from gen.measured.outcome import require_conductivities
    from gen.measured.source import Source

    files = files.filled(output)
    check_outputs(files.outputs, [*inputs, *([facing.against] if facing.against else [])])
    figure = files.empty_figure()
    material = bool(young) or e_star is not None
    known = material or bool(poisson)
    order = Order(
        inputs=tuple(inputs),
        delta=delta,
        pressure=pressure,
        surfaces=surfaces,
        level=require_share("--band", band),
        e_star=combined_modulus(young or [], poisson or [], e_star) if known else None,
        hardness=require_hardness(hardness, material=material),
        boundary=boundary,
        conductivities=require_conductivities(conductivity or []),
        stiffness=True,
        reading=reading,
        opposite=_opposite(Source.of_options(Path(), reading._asdict()), *facing),
        command=typed(context, "gen"),
    )
    made = by_solver(order, lambda line: echo(line, err=True))
    show(made)
    for written in write(made, files, figure):
        echo(f"wrote {written}")


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
    against: options.Against = None,
    against_options: options.AgainstOptions = None,
    turned: options.Turned = "",
    shift: options.Shift = "",
    boundary: options.Boundary = "free",
    table: options.Table = None,
    picture: options.SurfacePicture = None,
) -> None:
    """Print the 22 roughness statistics and the parameters of ISO 25178 with their units."""
    from gen import display
    from gen.measured import single
    from gen.measured.areal import areal_parameters
    from gen.measured.preparation import surface_warnings, tilt
    from gen.measured.settings import Preparation
    from gen.measured.source import Source, surface_of
    from gen.runtime.table import write_csv

    inputs = [surface] if against is None else [surface, against]
    check_outputs([Output(table, "--csv"), Output(picture, "--plot", "picture")], inputs)
    figure = _try_picture(picture, 10.5, 8.6)
    preparation = Preparation(
        crop, invert, mask, despike, level, form, fill, fill_most, filter_, downsample
    )
    source = Source(surface, side, unit, channel, override_scale, preparation)
    opposite = _opposite(source, against, against_options, turned, shift)
    topography, measured = surface_of(source, opposite, boundary)
    warnings = surface_warnings(topography)
    display.print_preparation(topography, warnings)
    description = single.describe(topography)
    slopes = None if measured is None else tilt(measured)
    display.print_statistics(topography.heights, topography.spacing, slopes, description)
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
    from gen.export.about import About
    from gen.export.folder import export as export_to
    from gen.runtime.memory import size

    with Reader(file) as reader:
        about = About.of(reader, title, creator, licence, doi)
        exported = export_to(reader, output, about)
    left_out = f"; {exported.left_out} failed or pending" if exported.left_out else ""
    echo(f"{output}: {exported.rows} rows{left_out}, {size(exported.size_bytes)}")


@app.command()
def estimate(
    scene: options.SceneName,
    ranks: options.Ranks = 1,
) -> None:
    """Measure a few samples and predict time, memory and disk space of a run."""
    from gen import display
    from gen.generation import forecast
    from gen.generation.completion import completed
    from gen.scene import load

    loaded = completed(load(scene))
    display.print_estimate(forecast.plan_of(loaded), forecast.estimate(loaded, ranks))


@app.command()
def scene(
    context: typer.Context,
    inputs: options.Maps = None,
    *,
    output: options.NewScene,
    like: options.Like = None,
    young: options.Young = None,
    poisson: options.Poisson = None,
    e_star: options.EStar = None,
    hardness: options.Hardness = None,
    side: options.Side = "",
    unit: options.Unit = "",
    channel: options.Channel = "",
) -> None:
    """Look at measured maps and write a scene of their windows, or of surfaces like one map.

    Comments in the scene say why it has its values. It runs as it is, and is meant to be edited.
    """
    from gen.draft.drafting import Order, draft
    from gen.draft.loads import Material
    from gen.scans.library import Reading

    material = Material.of_options(young or [], poisson or [], e_star, hardness)
    reading = Reading(side, unit, channel)
    draft(Order(inputs or [], like, output, reading, material, typed(context, "gen")))
