"""`gen describe`, `contact`, `law`, `scene`: commands about surfaces and maps."""

from __future__ import annotations

from typing import Any

import typer

from gen import options
from gen.maps.settings import FileReading, Reading
from gen.material import Bodies
from gen.runtime.command_line import Trust, grouped, typed
from gen.runtime.errors import InputError
from gen.runtime.figure import empty_figure
from gen.runtime.files import Output, atomic, check_outputs
from gen.runtime.terminal import echo


@grouped
def describe(
    surface: options.SurfaceFile,
    *,
    reading: Reading,
    facing: options.Against,
    boundary: options.Boundary = "free",
    depth: options.Depth = None,
    table: options.Table = None,
    spectrum: options.SpectrumTable = None,
    picture: options.SurfacePicture = None,
) -> None:
    """Print the 22 roughness statistics, the parameters of ISO 25178 and the self-affine law."""
    from gen import statistics
    from gen.commands import printer
    from gen.maps import pictures, texture
    from gen.maps.prepare import read_surface
    from gen.runtime.documents import write_csv
    from gen.schema import TABLE_1

    outputs = [Output(table, "--csv"), Output(spectrum, "--spectrum")]
    outputs.append(Output(picture, "--plot", "picture"))
    check_outputs(outputs, filter(None, [surface, facing.against]))
    figure = empty_figure(picture, 10.5, 8.6)
    topography, warnings = read_surface(surface, reading, boundary, facing.body(reading))
    printer.print_preparation(topography, warnings)
    description = statistics.describe(topography.heights, topography.spacing)
    areal = texture.areal_parameters(topography, depth)
    printer.print_statistics(topography, description, areal)
    radial = texture.radial_spectrum(topography)
    fit = texture.fit_self_affine(topography, radial, areal.values["Str"])
    nodes = texture.nodes_a_wave(radial, topography.spacing)
    directional = bool(texture.lay_of(topography, areal.values["Str"]))
    if directional:
        printer.print_profiles(texture.profile_roughness(topography))
    printer.print_spectrum(fit, nodes)
    if spectrum is not None and not radial.wavenumbers.size:
        raise InputError(f"--spectrum {spectrum}: there is none, {fit}")
    if table is not None:
        edgeless = {} if topography.boundary == "free" else {"boundary": topography.boundary}
        row = {
            **description.values,
            **dict(zip(("nodes_x", "nodes_y"), topography.heights.shape, strict=True)),
            **dict(zip(("side_x_um", "side_y_um"), topography.sides, strict=True)),
            **edgeless,
            "prepared": "; ".join(topography.steps),
            "warnings": "; ".join(warnings),
            **areal.values,
            **({} if depth is None else {"Smr_depth": depth}),
            **(dict.fromkeys(texture.LAW, "") if isinstance(fit, str) else fit.values),
            "law": f"none: {fit}" if isinstance(fit, str) else "; ".join(fit.remarks),
            "nodes_a_wave": nodes,
        }
        units = {column.name: column.unit for column in TABLE_1}
        units |= {name: unit for name, unit, _ in texture.PARAMETERS} | texture.LAW
        units |= {"Smr_depth": "um", "nodes_a_wave": "1"}
        known = "; ".join(f"{name} {units[name]}" for name in row if name in units)
        write_csv(table, [{**row, "units": known}])
    if spectrum is not None:
        write_csv(spectrum, radial.rows())
    if picture is not None:
        pictures.draw_surface(figure, topography, radial, fit, picture, directional=directional)


@grouped
def contact(
    surface: options.SurfaceFile,
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
    picture: options.Picture = None,
    flattened: options.Flattened = None,
) -> None:
    """Solve contact problems of one surface: area, force, pressure, gap, yielding, residual.

    The area comes as a share of nodes, and in the continuum with the error of the grid.
    With --spots, --flow, --stiffness and --conductivity also spots, the flow of a fluid through
    the gap, stiffness and conductance.

    Give one of --delta, --force and --pressure: a number, or for a law start:stop:count, with :log
    for an even ratio, or several numbers with commas.
    """
    import numpy as np

    from bem.threads import cores, default_threads, on_threads
    from gen.commands import printer
    from gen.maps import contacts
    from gen.maps.prepare import read_surface
    from gen.runtime.documents import write_csv

    load, values = contacts.chosen_load({"delta": delta, "force": force, "pressure": pressure})
    if flattened is not None and material.hardness is None:
        raise InputError("--flattened needs --hardness: elastic bodies keep their surface")
    if flattened is not None and flattened.suffix.lower() != ".npy":
        raise InputError(f"--flattened {flattened}: give a name that ends in .npy")
    pair = contacts.require_conductivities(conductivity) if conductivity else None
    wanted = contacts.Wanted(spots, stiffness, pair, grid_error, flow)
    outputs = [Output(table, "--csv"), Output(picture, "--plot", "picture")]
    outputs.append(Output(flattened, "--flattened", "heights"))
    check_outputs(outputs, filter(None, [surface, facing.against]))
    figure = empty_figure(picture, 11, 8.2)
    bodies = Bodies.of(*material)
    topography, doubts = read_surface(surface, reading, boundary, facing.body(reading))
    settings = {"modulus": bodies.e_star, "hardness": bodies.hardness, "kernel": kernel}
    settings |= {"far_field": far_field, "rtol": rtol, "max_iterations": max_iterations}
    solutions = contacts.solve_loads(topography, load, values, **settings)
    with on_threads(threads or default_threads(cores())):
        found, last, faults, seconds = contacts.follow(solutions, len(values), wanted)
    rows: list[dict[str, Any]] = [{each.column: each.value for each in row} for row in found]
    solved = [(row["delta_um"], row["largest_pressure_MPa"], row["contact_nodes"]) for row in rows]
    warnings = [*bodies.doubts, *doubts]
    warnings += contacts.contact_warnings(topography, bodies, load, solved)
    warnings += faults
    printer.print_preparation(topography, warnings)
    printer.print_contacts(found, last, seconds)
    if remark := contacts.border_remark(topography, last, len(found)):
        echo(f"{topography.name}: {remark}")
    if table is not None:
        said = {"prepared": "; ".join(topography.steps), "warnings": "; ".join(warnings)}
        write_csv(table, [{**row, **said} for row in rows])
    if flattened is not None:
        if faults:
            raise InputError(f"--flattened {flattened}: not written, as not every load was solved")
        with atomic(flattened, "heights") as file:
            np.save(file, last.flattened)
    if picture is not None:
        from gen.maps.pictures import draw_contacts

        draw_contacts(
            figure,
            last,
            rows,
            picture,
            name=topography.name,
            load=load,
            bodies=bodies,
            warnings=warnings,
            wanted=wanted,
        )


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
    output: options.LawFiles = None,
    trust: Trust = False,
    files: options.LawOutputs,
    reading: Reading,
    facing: options.Against,
) -> None:
    """Tabulate the law of an interface: closure, area, gap, conductance over nominal pressure.

    The solver presses one surface, or a population, whose means and quantiles the tables then hold.
    The patch is a piece of a larger interface, continued by its mirror images, so that the closure
    is the interface's alone: what a mesh adds to the bodies' own deformation.
    """
    from gen.law import Order, by_solver
    from gen.law.curves import Gas
    from gen.law.files import show, write_files
    from gen.law.surfaces import files_read
    from gen.maps.contacts import require_conductivities

    files = files.ready(output, [*files_read(inputs), *filter(None, [facing.against])])
    if not 0 < band < 1:
        raise InputError(f"--band {band:g}: give a share between 0 and 1, as 0.9")
    figure = files.picture and empty_figure(files.picture, 12.0, 7.0)
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
        e_star=bodies.e_star if bodies.known or material.poisson else None,
        hardness=bodies.hardness,
        boundary=boundary,
        conductivities=require_conductivities(conductivity) if conductivity else None,
        gas=gas,
        stiffness=True,
        grid_error=grid_error,
        flow=flow,
        reading=reading,
        opposite=facing.body(reading),
        command=typed(context, "gen"),
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
    draft(inputs or [], like, output, how, Bodies.of(*material), typed(context, "gen"))
