"""The commands of `python -m gen`. Each imports what it needs, and only that."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from gen import command_line, farm
from gen.errors import InputError

app = typer.Typer(add_completion=False, rich_markup_mode=None)

Database = Annotated[Path, typer.Argument(metavar="FILE", help="A database (HDF5).")]
SurfaceFile = Annotated[
    Path, typer.Argument(metavar="SURFACE", help="Heights in um: a .npy file, or text.")
]
Side = Annotated[
    str, typer.Option(help="Scan length in um; two for an oblong patch: 1000,500 (along x, y).")
]


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code."""
    world = farm.World()
    try:
        world = farm.this_world()
        return command_line.call(app, "gen", arguments, speaking=world.is_master)
    except InputError as error:
        typer.echo(f"gen: {error}", err=True)
        return 2
    except Exception:
        world.abort()


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
    force: Annotated[
        bool, typer.Option("--force", help="Go on with a file of another physics number.")
    ] = False,
) -> int:
    """Generate a database, or go on where an earlier run stopped.

    Alone it works serially; started as `mpiexec -n 9 python -m mpi4py -m gen run ...` rank 0 hands
    out the samples and writes, the others compute.
    """
    from gen.run import generate_database

    world = farm.this_world()
    outcome = generate_database(scene, output, world, force=force)
    if world.is_master:
        from gen import display

        display.print_outcome(output, outcome)
    return 128 + outcome.signal if outcome.signal and outcome.counts.pending else 0


@app.command()
def info(file: Database) -> None:
    """Show what a database holds: rows, ranges beside the paper's, times, scene, versions."""
    if not farm.this_world().is_master:
        return
    from gen import display
    from gen.database import Reader

    with Reader(file) as reader:
        display.print_database(reader)


@app.command()
def contact(
    surface: SurfaceFile,
    side: Side,
    delta: Annotated[float, typer.Option(help="Far-field displacement from first touch in um.")],
    young: Annotated[float, typer.Option(help="Young's modulus in MPa.")] = 1.0,
    poisson: Annotated[float, typer.Option(help="Poisson's ratio.")] = 0.0,
    kernel: Annotated[
        str, typer.Option(help="uniform-pressure or concentrated-force.")
    ] = "uniform-pressure",
    far_field: Annotated[str, typer.Option(help="rigid or compliant.")] = "rigid",
    rtol: Annotated[float, typer.Option(help="Residual to reach, over Delta.")] = 1e-6,
    max_iterations: Annotated[int, typer.Option(help="Bound on the solver's iterations.")] = 1000,
) -> None:
    """Solve one contact problem: area, force, pressure, gap, residual."""
    if not farm.this_world().is_master:
        return
    from gen import display
    from gen.single import solve_file

    settings: dict[str, Any] = {
        "modulus": young,
        "poisson": poisson,
        "kernel": kernel,
        "far_field": far_field,
        "rtol": rtol,
        "max_iterations": max_iterations,
    }
    solved, seconds = solve_file(surface, side, delta, **settings)
    display.print_contact(solved, seconds)


@app.command()
def describe(surface: SurfaceFile, side: Side) -> None:
    """Print the 22 roughness statistics of a surface, with their units."""
    if not farm.this_world().is_master:
        return
    from gen import display
    from gen.single import describe_file

    heights, spacing, description = describe_file(surface, side)
    display.print_statistics(heights, spacing, description)


@app.command()
def plot(
    file: Database,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="PNG", help="The picture to write.")
    ],
) -> None:
    """Draw what a database holds: one surface, its pressure, the areas, the solve times."""
    if not farm.this_world().is_master:
        return
    from gen.picture import draw_database

    draw_database(file, output)
    typer.echo(f"wrote {output}")


@app.command()
def columns() -> None:
    """Print the table of columns of a database, in Markdown."""
    if not farm.this_world().is_master:
        return
    from gen.schema import markdown_table

    typer.echo(markdown_table())
