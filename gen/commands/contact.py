"""`gen contact`: solve contact problems of one surface."""

from gen import options
from gen.maps.settings import Reading
from gen.runtime.command_line import grouped
from gen.runtime.figure import empty_figure
from gen.runtime.files import Output, check_outputs


@grouped
def contact(
    surface: options.SurfaceFile,
    *,
    delta: options.Delta = "",
    force: options.NormalForce = "",
    pressure: options.Pressure = "",
    young: options.Young = None,
    poisson: options.Poisson = None,
    e_star: options.EStar = None,
    hardness: options.Hardness = None,
    reading: Reading,
    facing: options.Against,
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
    from gen.display.surfaces import follow_contacts
    from gen.maps.bodies import surface_of
    from gen.maps.contacts import (
        Wanted,
        chosen_load,
        contact_row,
        require_conductivities,
        require_yielding,
        solve_loads,
        write_flattened,
    )
    from gen.maps.doubts import surface_warnings
    from gen.material import Bodies
    from gen.runtime.documents import write_csv

    load, values = chosen_load({"delta": delta, "force": force, "pressure": pressure})
    require_yielding(flattened, hardness)
    wanted = Wanted(spots, stiffness, require_conductivities(conductivity or []))
    outputs = [Output(table, "--csv"), Output(picture, "--plot", "picture")]
    outputs.append(Output(flattened, "--flattened", "heights"))
    check_outputs(outputs, facing.with_first(surface))
    figure = empty_figure(picture, 11, 8.2)
    bodies = Bodies.of_options(young or [], poisson or [], e_star, hardness)
    topography = surface_of(surface, reading, facing.body(reading), boundary)
    with on_threads(threads or default_threads(cores())):
        contacts, warnings = follow_contacts(
            topography,
            [*bodies.doubts, *surface_warnings(topography)],
            solve_loads(
                topography,
                load,
                values,
                modulus=bodies.e_star,
                hardness=bodies.hardness,
                kernel=kernel,
                far_field=far_field,
                rtol=rtol,
                max_iterations=max_iterations,
            ),
            len(values),
            wanted=wanted,
            material=bodies.known,
        )
    if table is not None:
        rows = [contact_row(topography, each, warnings, wanted) for each in contacts]
        write_csv(table, rows)
    if flattened is not None:
        write_flattened(flattened, contacts, len(values))
    if picture is not None:
        from gen.maps.contact_picture import Subject, draw_contacts

        subject = Subject(topography.name, load, bodies.known, warnings, spots=spots)
        draw_contacts(figure, contacts, subject, picture)
