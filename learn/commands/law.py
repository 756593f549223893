"""`learn law`: tabulate contact laws, predicted or solved."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from gen import options
from gen.maps.settings import Reading
from gen.runtime.command_line import grouped, typed
from gen.runtime.errors import InputError
from gen.runtime.figure import empty_figure
from gen.runtime.files import check_outputs, kind_of
from gen.runtime.terminal import echo
from learn.commands.options import Coverage, Deltas, Material, note

SurrogateAndInputs = Annotated[
    list[str],
    typer.Argument(
        metavar="[SURROGATE] INPUT...",
        help="A surrogate made by learn fit, which --solver does not need; then one surface, or"
        " folders of them, databases or scenes: a population.",
    ),
]
Solver = Annotated[
    bool, typer.Option("--solver", help="Solve every contact instead of predicting it.")
]
LawBoundary = Annotated[
    Literal["free", "periodic", "mirror"] | None,
    typer.Option(
        help="Boundary of the patches, see gen contact; that of the training or the scene if left"
        " out, else mirror."
    ),
]


@grouped
def law(
    context: typer.Context,
    inputs: SurrogateAndInputs,
    delta: Deltas = "",
    pressure: options.Pressures = "",
    conductivity: options.Conductivity = None,
    solver: Solver = False,
    surfaces: options.Population = 50,
    boundary: LawBoundary = None,
    interval: Coverage = 0.9,
    output: options.LawFiles = None,
    trust: options.Trust = False,
    *,
    files: options.LawOutputs,
    reading: Reading,
    material: Material,
) -> None:
    """Tabulate area, force, gap and closure against Delta and pressure, monotone, with slopes.

    Bands are the surrogate's intervals for one surface, and quantiles over the surfaces of a
    population. There is none for one surface that is solved, or outside the surrogate's training.
    The solver solves at the given Delta or pressures; its E* is by default that of the surrogate's
    training or of a scene, else 1 MPa. With --conductivity there is the conductance too. Surrogates
    that have not learnt the stiffness take it from the slope of the force, for elastic bodies only.
    """
    from gen.law.files import show, write_files
    from gen.maps.contacts import require_conductivities
    from learn.surrogate import Surrogate
    from learn.surrogate.interval import checked_level
    from learn.surrogate.law import Order, make
    from learn.surrogate.model import require_level

    files = files.filled(output)
    check_outputs(files.outputs, inputs)
    figure = empty_figure(files.picture, 12.0, 7.0)
    file, wanted = _surrogate_and_inputs(inputs, solver=solver)
    order = Order(
        inputs=tuple(wanted),
        delta=delta,
        pressure=pressure,
        solver=solver,
        surfaces=surfaces,
        level=checked_level(interval),
        e_star=material.modulus(),
        hardness=material.hardness,
        boundary=boundary,
        conductivities=require_conductivities(conductivity or []),
        reading=reading,
        command=typed(context, "learn"),
    )
    surrogate = None if file is None else Surrogate.load(file)
    if surrogate is not None and not solver:
        require_level(surrogate, order.level)
    tables = make(surrogate, order, note)
    show(tables)
    for written in write_files(tables, files, figure):
        echo(f"wrote {written}")


def _surrogate_and_inputs(given: list[str], *, solver: bool) -> tuple[Path | None, list[str]]:
    """Return the surrogate, which the solver does not need, and the inputs after it."""
    first, *others = given
    if solver and not (Path(first).is_file() and kind_of(Path(first)) == "surrogate"):
        return None, given
    if not others:
        raise InputError(
            f"{first}: nothing else given: give a surrogate and then surfaces, or surfaces and"
            " --solver"
        )
    return Path(first), others
