"""`learn law`: tabulate contact laws, predicted or solved."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from gen.runtime.errors import InputError
from gen.runtime.output import Output, check_outputs, kind_of
from gen.runtime.terminal import echo
from learn.commands.option_groups import grouped
from learn.commands.options import Coverage, Deltas, Material, note, typed
from learn.reading import Reading

SurrogateAndInputs = Annotated[
    list[str],
    typer.Argument(
        metavar="[SURROGATE] INPUT...",
        help="A surrogate made by learn fit, which --solver does not need; then one surface, or"
        " folders of them, databases or scenes: a population.",
    ),
]
Pressures = Annotated[
    str, typer.Option(metavar="MPA", help="Nominal pressures: 2, 1,2,5 or start:stop:count.")
]
TableFile = Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the table.")]
HeaderFile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write a C header for finite elements.")
]
Solver = Annotated[
    bool, typer.Option("--solver", help="Solve every contact instead of predicting it.")
]
Surfaces = Annotated[
    int, typer.Option(min=2, max=10_000, help="Surfaces of a database's or scene's population.")
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
    pressure: Pressures = "",
    table: TableFile = None,
    header: HeaderFile = None,
    solver: Solver = False,
    surfaces: Surfaces = 50,
    boundary: LawBoundary = None,
    interval: Coverage = 0.9,
    *,
    reading: Reading,
    material: Material,
) -> None:
    """Tabulate area, force and mean gap against Delta and nominal pressure, monotone, with slopes.

    Bands are the surrogate's intervals for one surface, and quantiles over the surfaces of a
    population. There is none for one surface that is solved, or outside the surrogate's training.
    The solver solves at the given Delta or pressures; its E* is by default that of the surrogate's
    training or of a scene, else 1 MPa.
    """
    from learn.surrogate import Surrogate
    from learn.surrogate.conformal import checked_level
    from learn.surrogate.law import Order, make
    from learn.surrogate.law.table import show, write

    check_outputs([Output(table, "--csv"), Output(header, "--header")], inputs)
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
        reading=reading,
        command=typed(context),
    )
    surrogate = None if file is None else Surrogate.load(file)
    tables = make(surrogate, order, note)
    show(tables)
    for written in write(tables, table, header):
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
