"""`gen law`: tabulate the law of an interface by the solver."""

import typer

from gen import options
from gen.maps.settings import Reading
from gen.runtime.command_line import grouped, typed
from gen.runtime.figure import empty_figure
from gen.runtime.files import check_outputs
from gen.runtime.numbers import require_share
from gen.runtime.terminal import echo


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
    trust: options.Trust = False,
    *,
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
    from gen.law.files import show, write_files
    from gen.maps.contacts import require_conductivities
    from gen.material import Bodies

    files = files.filled(output)
    check_outputs(files.outputs, facing.with_first(*inputs))
    figure = empty_figure(files.picture, 12.0, 7.0)
    bodies = Bodies.of_options(young or [], poisson or [], e_star, hardness)
    order = Order(
        inputs=tuple(inputs),
        delta=delta,
        pressure=pressure,
        surfaces=surfaces,
        level=require_share("--band", band),
        e_star=bodies.e_star if bodies.known or poisson else None,
        hardness=bodies.hardness,
        boundary=boundary,
        conductivities=require_conductivities(conductivity or []),
        stiffness=True,
        reading=reading,
        opposite=facing.body(reading),
        command=typed(context, "gen"),
    )
    made = by_solver(order, lambda line: echo(line, err=True))
    show(made)
    for written in write_files(made, files, figure):
        echo(f"wrote {written}")
