"""The commands that compare models and their inputs, from `learn compare` to `importance`."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from gen.runtime.command_line import Trust, grouped
from gen.runtime.errors import InputError
from gen.runtime.files import check_folder, lock_folder
from gen.runtime.terminal import command_to_type, echo
from learn.commands.fit import (
    SEEDS,
    AreaMax,
    Features,
    Load,
    Normalise,
    TrainRows,
    request_of,
)

if TYPE_CHECKING:
    from learn.comparison.tables import Tables
    from learn.dataset import Request
    from learn.executor import Executor

Database = Annotated[
    Path, typer.Argument(metavar="FILE", help="A database made by gen (HDF5).")
]
Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="DIR", help="The comparison folder.")
]


class Selection(NamedTuple):
    """Models, and the rows and features that a comparison rests on; see the help of the options."""

    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="decision-tree, random-forest, adaboost, xgboost, gradient-boost, svm,"
            " gaussian-process, kernel-ridge or mlp, and population for scene features; may be"
            " repeated; if left out, all (importance: kernel-ridge).",
        ),
    ] = None
    target: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="area, force, both, or the column of another result that is stored, as mean_gap.",
        ),
    ] = "area"
    area_max: AreaMax = None
    features: Features = "paper"
    load: Load = ""
    normalise: Normalise = ""
    seed: Annotated[
        int, typer.Option(min=0, max=SEEDS, help="Seed of the split and of the models.")
    ] = 0
    train_rows: TrainRows = None
    again: Annotated[
        bool, typer.Option("--again", help="Measure again, also where a result is there.")
    ] = False
    trust: Trust = False


@grouped
def compare(file: Database, output: Output, *, selection: Selection) -> int:
    """Fit the models with their libraries' settings: errors and times beside the paper's Table 4.

    The Gaussian process has the paper's kernel, whose length is fixed; beside it stands its
    library's own, fitted to 1,000 rows at most.
    The fits run one after the other, so that their times are those of a process that works alone.
    """
    from learn.comparison import jobs

    return _led(jobs.compare, selection, file, output)


@grouped
def tune(
    file: Database,
    output: Output,
    budget: Annotated[
        str,
        typer.Option(
            metavar="TIME",
            help="Time of this call, as 2h or 30min: successive halving where a grid is too large"
            " for it, then five folds of all rows. Without it, whole grids.",
        ),
    ] = "",
    *,
    selection: Selection,
) -> int:
    """Search the grids of the paper's Table 2, and fit and time the winners.

    Five folds of all rows decide. Where no candidate is better than the baseline that `compare`
    fits, the baseline wins.

    Every finished fit is kept: interrupted or killed, the same command goes on. Started as
    `mpiexec -n 65 python -m mpi4py -m learn tune ...` rank 0 hands out the fits, the others do
    them.
    """
    began = time.time()
    from learn.comparison import jobs

    return _led(jobs.tune, selection, file, output, budget, began)


def show(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A comparison folder.")],
    pictures: Annotated[bool, typer.Option(help="Draw the pictures too.")] = True,
) -> None:
    """Print a comparison's tables beside the paper's; write them and the pictures into the folder.

    scores.csv and times.csv are the paper's Table 4, tuning.csv is its Table 3; parity.png is like
    its figures 8 and 10, scores.png and times.png are like its figure 9. Scores have 90 % intervals
    by a bootstrap of 1,000 resamples of the test rows' surfaces.
    """
    from learn.comparison.folder import targets

    targets(
        folder
    )  # refuses a folder that is none of ours, before anything is written into it
    with lock_folder(folder):
        _write_and_print(folder, pictures=pictures)


def _led(
    work: Callable[[Request, Executor], int],
    selection: Selection,
    file: Path,
    output: Path,
    budget: str = "",
    began: float = 0.0,
) -> int:
    """Do the work of a request on all processes, and print the tables; return the exit code.

    InputError is raised if a constant does as well as a tuned model. Of baselines the tables say
    so: they are what the libraries' settings give, whatever that is.
    """
    from learn.comparison import jobs, tables
    from learn.executor import led, seconds
    from learn.models import MODELS

    with led() as executor:
        check_folder(output)
        until = began + seconds(budget) if budget else inf
        request = request_of(selection, [file], output, selection.features, until=until)
        with lock_folder(output):
            if number := work(request, executor):
                name = signal.Signals(number).name
                echo(f"stopped by {name}; the same command goes on with what is left")
                return 128 + number
            shown = _write_and_print(output, pictures=False)
            echo(f"pictures: {command_to_type(f'learn show {output}')}")
            for each in shown if work is jobs.tune else ():
                for useless in tables.no_better_than_constant(each):
                    is_tuned = useless.row.kind == "tuned"
                    if is_tuned and useless.row.model in (request.models or MODELS):
                        raise InputError(
                            f"{each.folder.path}: {useless.message}; the tables are still written"
                        )
    return 0


def _write_and_print(folder: Path, *, pictures: bool) -> list[Tables]:
    from learn.comparison import plots, printing, tables
    from learn.comparison.folder import targets

    shown = [tables.read(part) for part in targets(folder)]
    for found in shown:
        tables.write(found)
        printing.show(found)
        for path in plots.draw(found) if pictures else ():
            echo(f"wrote {path}")
    return shown


@grouped
def importance(file: Database, output: Output, *, selection: Selection) -> None:
    """Rank the inputs by what shuffling each does to the error, and drop the weakest.

    With the settings that `tune` has found, if the folder holds them, else with the paper's
    optimum: DIR/TARGET/importance.csv, selection.csv and importance.png.
    """
    one = selection._replace(model=(selection.model or ["kernel-ridge"])[-1:])
    check_folder(output)
    request = request_of(one, [file], output, one.features)
    from learn.comparison.importance import write_report

    with lock_folder(output):
        for path in write_report(request, echo):
            echo(f"wrote {path}")
