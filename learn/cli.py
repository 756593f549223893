"""The commands of `python -m learn`. Each imports what it needs, and only that."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gen.runtime import command_line, farm
from gen.runtime.output import check_folder
from gen.runtime.terminal import echo
from learn import commands
from learn.options import (
    Again,
    AreaMax,
    Comparison,
    Database,
    Features,
    Models,
    Normalise,
    Output,
    Seed,
    Target,
    TrainRows,
)

if TYPE_CHECKING:
    from learn.request import Request

app = typer.Typer(add_completion=False, rich_markup_mode=None)

for _command in (commands.fit, commands.card, commands.predict, commands.law):
    app.command()(_command)


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code."""
    together = ["fit", "compare", "tune", "estimate"]
    return command_line.main(app, "learn", arguments, together=together)


@app.callback()
def describe_program() -> None:
    """Surrogates of contact databases: nine models compared, tuned, and judged by their errors."""


@app.command()
def compare(
    file: Database,
    output: Output,
    model: Models = None,
    target: Target = "area",
    area_max: AreaMax = None,
    features: Features = "paper",
    normalise: Normalise = "",
    seed: Seed = 0,
    train_rows: TrainRows = None,
    again: Again = False,
) -> int:
    """Fit the models with their libraries' settings: errors and times beside the paper's Table 4.

    The fits run one after the other, so that their times are those of a process that works alone.
    """
    from learn.comparison import jobs

    request = _request(
        file, output, model, target, area_max, features, normalise, seed, train_rows, again
    )
    world = farm.this_world()
    ended = jobs.compare(request, world)
    return _show(request, world, ended.signal)


@app.command()
def tune(
    file: Database,
    output: Output,
    model: Models = None,
    budget: Annotated[
        str,
        typer.Option(
            metavar="TIME",
            help="Time for the searches, as 2h or 30min: successive halving where a grid is too"
            " large for it. Without it, whole grids.",
        ),
    ] = "",
    target: Target = "area",
    area_max: AreaMax = None,
    features: Features = "paper",
    normalise: Normalise = "",
    seed: Seed = 0,
    train_rows: TrainRows = None,
    again: Again = False,
) -> int:
    """Search the grids of the paper's Table 2, and fit and time the winners.

    Every finished fit is kept: interrupted or killed, the same command goes on. Started as
    `mpiexec -n 65 python -m mpi4py -m learn tune ...` rank 0 hands out the fits, the others do
    them.
    """
    from learn.comparison import jobs
    from learn.comparison.budget import seconds

    limit = seconds(budget) if budget else None
    request = _request(
        file, output, model, target, area_max, features, normalise, seed, train_rows, again, limit
    )
    world = farm.this_world()
    ended = jobs.tune(request, world)
    return _show(request, world, ended.signal)


@app.command()
def estimate(
    file: Database,
    output: Output,
    model: Models = None,
    budget: Annotated[
        str, typer.Option(metavar="TIME", help="Time for all models together, as 1h or 90min.")
    ] = "1h",
    target: Target = "area",
    area_max: AreaMax = None,
    features: Features = "paper",
    normalise: Normalise = "",
    seed: Seed = 0,
    train_rows: TrainRows = None,
) -> int:
    """Estimate what tuning over whole grids takes, from fits drawn at random and done here.

    The times are those of one thread: divide by the workers. What is fitted is kept, and need not
    be done again by `tune` on the same folder.
    """
    from learn.comparison import jobs
    from learn.comparison.budget import seconds

    limit = seconds(budget)
    request = _request(
        file, output, model, target, area_max, features, normalise, seed, train_rows, False, limit
    )
    world = farm.this_world()
    ended = jobs.estimate(request, world)
    return _show(request, world, ended.signal)


@app.command()
def show(
    folder: Comparison,
    pictures: Annotated[bool, typer.Option(help="Draw the pictures too.")] = True,
) -> None:
    """Print a comparison's tables beside the paper's; write them and the pictures into the folder.

    scores.csv and times.csv are the paper's Table 4, tuning.csv is its Table 3; parity.png is like
    its figures 8 and 10, scores.png and times.png are like its figure 9.
    """
    _write_and_print(folder, pictures=pictures)


@app.command()
def importance(
    file: Database,
    output: Output,
    model: Annotated[str, typer.Option(metavar="NAME", help="The model to ask.")] = "kernel-ridge",
    target: Target = "area",
    area_max: AreaMax = None,
    features: Features = "paper",
    normalise: Normalise = "",
    seed: Seed = 0,
    train_rows: TrainRows = None,
) -> None:
    """Rank the inputs by what shuffling each does to the error, and drop the weakest.

    With the settings that `tune` has found, if the folder holds them, else with the paper's
    optimum: DIR/TARGET/importance.csv, selection.csv and importance.png.
    """
    request = _request(
        file, output, [model], target, area_max, features, normalise, seed, train_rows, False
    )
    from learn.comparison.importance import write_report

    for path in write_report(request, echo):
        echo(f"wrote {path}")


@app.command()
def appendix(
    file: Database,
    output: Output,
    area_max: AreaMax = None,
    features: Features = "paper",
    normalise: Normalise = "",
    seed: Seed = 0,
    train_rows: TrainRows = None,
) -> None:
    """Compare Gaussian process and kernel ridge with equal kernels, as the paper's Appendix A.

    DIR/area/appendix.csv and appendix.png.
    """
    request = _request(
        file, output, None, "area", area_max, features, normalise, seed, train_rows, False
    )
    from learn.comparison.appendix import write_report

    for path in write_report(request, echo):
        echo(f"wrote {path}")


def _request(
    file: Path,
    output: Path,
    models: list[str] | None,
    target: str,
    area_max: float | None,
    features: str,
    normalise: str,
    seed: int,
    train_rows: int | None,
    again: bool,
    limit: float | None = None,
) -> Request:
    """Put the options together."""
    from learn.features import chosen
    from learn.request import Request

    if farm.this_world().is_master:
        check_folder(output)
    normalise = normalise or chosen(features).normalisation
    return Request(
        database=file,
        output=output,
        targets=("area", "force") if target == "both" else (target,),
        models=tuple(models or ()),
        area_max=area_max,
        normalisation=normalise,
        features=features,
        seed=seed,
        train_rows=train_rows,
        again=again,
        limit=limit,
    )


def _show(request: Request, world: Any, signal: int) -> int:
    """Print what there is after a job; 128 and the signal's number if it was stopped."""
    if signal:
        if world.is_master:
            import signal as signals

            name = signals.Signals(signal).name
            echo(f"stopped by {name}; the same command goes on with what is left")
        return 128 + signal
    if world.is_master:
        _write_and_print(request.output, pictures=False)
        echo(f"pictures: python -m learn show {request.output}")
    return 0


def _write_and_print(folder: Path, *, pictures: bool) -> None:
    from learn.comparison import tables
    from learn.comparison.folder import targets

    for part in targets(folder):
        tables.write(part)
        tables.show(part)
        if pictures:
            from learn.comparison.pictures import draw

            for path in draw(part):
                echo(f"wrote {path}")
