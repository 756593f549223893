"""`gen describe`, `contact`, `law`, `scene`: commands about surfaces and maps."""

from __future__ import annotations

import typer

from gen import options
from gen.maps.settings import FileReading, Reading
from gen.material import Bodies, Gas
from gen.runtime.command_line import Trust, grouped, recorded_command_line
from gen.runtime.errors import InputError
from gen.runtime.figure import figure_for
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import echo


@grouped
def describe(
    context: typer.Context,
    surfaces: options.SurfaceFiles,
    *,
    reading: Reading,
    facing: options.Against,
    boundary: options.Boundary = "free",
    depth: options.Depth = None,
    table: options.Table = None,
    json: options.Json = None,
    spectrum: options.SpectrumTable = None,
    picture: options.SurfacePicture = None,
) -> None:
    """Print the 22 roughness statistics, the parameters of ISO 25178 and the self-affine law.

    Several files or folders have a row for each map, then mean and standard deviation. A map that
    cannot be read is named and costs no other.
    """
    from gen.commands.looks import LookFiles, Looking, look_at_one, look_at_several
    from gen.maps import several

    outputs = [
        Output(table, "--csv"),
        Output(json, "--json"),
        Output(spectrum, "--spectrum"),
    ]
    outputs.append(Output(picture, "--plot", "picture"))
    check_outputs(outputs, filter(None, [*surfaces, facing.against]))
    files = LookFiles(
        table, json, spectrum, picture, command=recorded_command_line(context, "gen")
    )
    looking = Looking(reading, boundary, facing.second_body(reading), depth)
    if several.are_several(surfaces):
        look_at_several(looking, surfaces, files)
    else:
        look_at_one(looking, surfaces[0], files)


@grouped
def contact(
    context: typer.Context,
    surfaces: options.SurfaceFiles,
    *,
    delta: options.Delta = "",
    force: options.NormalForce = "",
    pressure: options.Pressure = "",
    material: options.Material,
    reading: Reading,
    facing: options.Against,
    boundary: options.Boundary = "free",
    kernel: options.Kernel = "uniform-pressure",
    far_field: options.FarField = "rigid",
    rtol: options.Tolerance = 2e-7,
    max_iterations: options.MaxIterations = 1000,
    grid_error: options.GridError = True,
    spots: options.Spots = False,
    flow: options.Flow = False,
    stiffness: options.Stiffness = False,
    conductivity: options.Conductivity = None,
    threads: options.Threads = None,
    table: options.Table = None,
    json: options.Json = None,
    picture: options.Picture = None,
    flattened: options.Flattened = None,
) -> None:
    """Solve contact problems of one surface: area, force, pressure, gap, yielding, residual.

    The area comes as a share of nodes, and in the continuum with the error of the grid.
    With --spots, --flow, --stiffness and --conductivity also spots, the flow of a fluid through
    the gap, stiffness and conductance.

    Give one of --delta, --force and --pressure: a number, or for a law start:stop:count, with :log
    for an even ratio, or several numbers with commas.

    Several files or folders have a row for each map and load, then mean and standard deviation. A
    map that cannot be read or solved is named and costs no other.
    """
    from bem.threads import cores, default_threads, on_threads
    from gen.commands.pressings import ContactFiles, Pressing, press_one, press_several
    from gen.maps import contacts, several

    load, values = contacts.chosen_load(
        {"delta": delta, "force": force, "pressure": pressure}
    )
    if flattened is not None and material.hardness is None:
        raise InputError(
            "--flattened needs --hardness: elastic bodies keep their surface"
        )
    if flattened is not None and flattened.suffix.lower() != ".npy":
        raise InputError(f"--flattened {flattened}: give a name that ends in .npy")
    pair = contacts.require_conductivities(conductivity) if conductivity else None
    outputs = [
        Output(table, "--csv"),
        Output(json, "--json"),
        Output(picture, "--plot", "picture"),
    ]
    outputs.append(Output(flattened, "--flattened", "heights"))
    check_outputs(outputs, filter(None, [*surfaces, facing.against]))
    bodies = Bodies.of(*material)
    settings = {"modulus": bodies.e_star, "hardness": bodies.hardness, "kernel": kernel}
    settings |= {"far_field": far_field, "rtol": rtol, "max_iterations": max_iterations}
    pressing = Pressing(
        reading=reading,
        boundary=boundary,
        body=facing.second_body(reading),
        load=load,
        values=values,
        wanted=contacts.AnswerOptions(grid_error, spots, flow, stiffness, pair),
        bodies=bodies,
        settings=settings,
    )
    files = ContactFiles(
        table, json, picture, flattened, command=recorded_command_line(context, "gen")
    )
    with on_threads(threads or default_threads(cores())):
        if several.are_several(surfaces):
            press_several(pressing, surfaces, files)
        else:
            press_one(pressing, surfaces[0], files)


@grouped
def law(
    context: typer.Context,
    inputs: options.Surfaces,
    *,
    delta: options.Delta = "",
    pressure: options.Pressure = "",
    material: options.Material,
    conductivity: options.Conductivity = None,
    gas_conductivity: options.GasConductivity = None,
    jump_distance: options.JumpDistance = None,
    boundary: options.Boundary = "mirror",
    surfaces: options.Population = 50,
    band: options.Band = 0.9,
    grid_error: options.GridError = True,
    flow: options.Flow = False,
    also: options.Also = None,
    output: options.LawFiles = None,
    trust: Trust = False,
    files: options.LawOutputs,
    reading: Reading,
    facing: options.Against,
) -> None:
    """Tabulate the law of an interface: closure, area, gap, conductance over nominal pressure.

    The solver presses one surface, or a population. The tables then hold means, and a band in which
    a further surface lies, at each load by itself.
    The patch is a piece of a larger interface, continued by its mirror images, so that the closure
    is the interface's alone: what a mesh adds to the bodies' own deformation.
    """
    from gen.law import Order, by_solver
    from gen.law.files import show, write_files
    from gen.law.order import require_also
    from gen.law.surfaces import files_read
    from gen.maps.contacts import require_conductivities

    files = files.resolved(output, [*files_read(inputs), *filter(None, [facing.against])])
    if not 0 < band < 1:
        raise InputError(f"--band {band:g}: give a share between 0 and 1, as 0.9")
    figure = files.picture and figure_for(files.picture, 12.0, 7.0)
    bodies = Bodies.of(*material)
    gas = None
    if gas_conductivity is not None or jump_distance is not None:
        gas = Gas.of_options(gas_conductivity, jump_distance)
    order = Order(
        inputs=tuple(inputs),
        delta=delta,
        pressure=pressure,
        surfaces=surfaces,
        level=band,
        e_star=bodies.e_star if bodies.has_modulus or material.poisson else None,
        hardness=bodies.hardness,
        boundary=boundary,
        conductivities=require_conductivities(conductivity) if conductivity else None,
        gas=gas,
        stiffness=True,
        grid_error=grid_error,
        flow=flow,
        also=require_also(also or []),
        reading=reading,
        opposite=facing.second_body(reading),
        between=files.refined_tables,
        straight=files.straight_lines,
        command=recorded_command_line(context, "gen"),
    )
    made = by_solver(order)
    show(made)
    for written in write_files(made, files, figure):
        echo(f"wrote {written}")


@grouped
def scene(
    context: typer.Context,
    inputs: options.Maps = None,
    *,
    output: options.NewScene,
    like: options.Like = None,
    material: options.Material,
    reading: FileReading,
) -> None:
    """Look at measured maps and write a scene of their windows, or of surfaces like one map.

    Comments in the scene say why it has its values. It runs as it is, and is meant to be edited.
    """
    from gen.draft import draft

    how = Reading(**vars(reading))
    draft(
        inputs or [],
        like,
        output,
        how,
        Bodies.of(*material),
        recorded_command_line(context, "gen"),
    )
