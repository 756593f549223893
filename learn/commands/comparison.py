"""`learn compare`, `tune` and `show`: compare the nine models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gen.runtime import farm
from gen.runtime.command_line import grouped
from gen.runtime.errors import InputError
from gen.runtime.lock import lock_folder
from gen.runtime.terminal import echo, to_type
from learn.commands.options import (
    Again,
    Comparison,
    Database,
    Models,
    Output,
    Selection,
    Target,
    requested,
)

if TYPE_CHECKING:
    from learn.dataset import Request
    from learn.executor import Executor


@grouped
def compare(
    file: Database,
    output: Output,
    model: Models = None,
    target: Target = "area",
    *,
    selection: Selection,
    again: Again = False,
) -> int:
    """Fit the models with their libraries' settings: errors and times beside the paper's Table 4.

    The fits run one after the other, so that their times are those of a process that works alone.
    """
    from learn.comparison import jobs
    from learn.executor import lead

    def job(executor: Executor) -> int:
        request = requested(file, output, model, target, selection, again=again)
        with lock_folder(request.output):
            return _show(request, jobs.compare(request, executor))

    return lead(job, farm.this_world())


@grouped
def tune(
    file: Database,
    output: Output,
    model: Models = None,
    budget: Annotated[
        str,
        typer.Option(
            metavar="TIME",
            help="Time of this call, as 2h or 30min: successive halving where a grid is too large"
            " for it, then five folds of all rows. Without it, whole grids.",
        ),
    ] = "",
    target: Target = "area",
    *,
    selection: Selection,
    again: Again = False,
) -> int:
    """Search the grids of the paper's Table 2, and fit and time the winners.

    Five folds of all rows decide. Where no candidate is better than the baseline that `compare`
    fits, the baseline wins.

    Every finished fit is kept: interrupted or killed, the same command goes on. Started as
    `mpiexec -n 65 python -m mpi4py -m learn tune ...` rank 0 hands out the fits, the others do
    them.
    """
    from learn.bounded import seconds
    from learn.comparison import jobs
    from learn.executor import lead

    def job(executor: Executor) -> int:
        limit = seconds(budget) if budget else None
        request = requested(file, output, model, target, selection, again=again, limit=limit)
        with lock_folder(request.output):
            return _show(request, jobs.tune(request, executor), tuned=True)

    return lead(job, farm.this_world())


def show(
    folder: Comparison,
    pictures: Annotated[bool, typer.Option(help="Draw the pictures too.")] = True,
) -> None:
    """Print a comparison's tables beside the paper's; write them and the pictures into the folder.

    scores.csv and times.csv are the paper's Table 4, tuning.csv is its Table 3; parity.png is like
    its figures 8 and 10, scores.png and times.png are like its figure 9. Scores have 90 % intervals
    by a bootstrap of 1,000 resamples of the test rows' surfaces.
    """
    from learn.comparison.folder import targets

    targets(folder)  # refuses a folder that is none of ours, before anything is written into it
    with lock_folder(folder):
        _write_and_print(folder, pictures=pictures)


def _show(request: Request, signal: int, *, tuned: bool = False) -> int:
    """Print the tables after a job, or that a signal stopped it; return the exit code.

    InputError is raised if a constant does as well as a tuned model. Of baselines the tables say
    so: they are what the libraries' settings give, whatever that is.
    """
    from learn.comparison import tables
    from learn.comparison.folder import targets
    from learn.models import MODELS

    if signal:
        import signal as signals

        name = signals.Signals(signal).name
        echo(f"stopped by {name}; the same command goes on with what is left")
        return 128 + signal
    _write_and_print(request.output, pictures=False)
    echo(f"pictures: {to_type(f'learn show {request.output}')}")
    for part in targets(request.output):
        for model, kind, said in tables.no_better_than_constant(part):
            if tuned and kind == "tuned" and model in (request.models or MODELS):
                raise InputError(f"{part.path}: {said}; the tables are still written")
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
