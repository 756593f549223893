"""The commands that compare models and their inputs, from `learn compare` to `importance`."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Sequence
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


LEAST_CANDIDATES = 10
"""Smallest number of `--candidates`: `learn.comparison.grid.LEAST_JUDGED`, without its imports."""


class Selection(NamedTuple):
    """The options about models, rows and features of a comparison; see their help."""

    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="decision-tree, random-forest, adaboost, xgboost, gradient-boost, svm,"
            " gaussian-process, kernel-ridge or mlp, and population for scene features;"
            " may be repeated; if left out, all (importance: kernel-ridge).",
        ),
    ] = None
    target: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="area, force, both, or the column of another result that is stored, as"
            " mean_gap.",
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
        bool, typer.Option("--again", help="Measure again where the folder has a result.")
    ] = False
    trust: Trust = False


@grouped
def compare(file: Database, output: Output, *, selection: Selection) -> int:
    """Fit the models with their libraries' settings: errors and times beside the paper's Table 4.

    The Gaussian process has the paper's kernel, whose length is fixed. A second one has the default
    kernel of its library, and is fitted to 1,000 rows at most.
    The fits run one after the other, so that their times are those of a process that works alone.
    """
    from learn.comparison import jobs

    return _run_jobs(jobs.compare, selection, file, output)


@grouped
def tune(
    file: Database,
    output: Output,
    budget: Annotated[
        str,
        typer.Option(
            metavar="TIME",
            help="Time of this call, as 2h or 30min: successive halving where a grid is"
            " too large for it, then five folds of all rows. Without it, whole grids.",
        ),
    ] = "",
    candidates: Annotated[
        int | None,
        typer.Option(
            min=LEAST_CANDIDATES,
            metavar="N",
            help="Number of candidates of each model to judge, or a few more: successive halving"
            " chooses them. No fit is stopped.",
        ),
    ] = None,
    *,
    selection: Selection,
) -> int:
    """Search the grids of the paper's Table 2, and fit and time the winners.

    Five folds of all rows decide. Where no candidate is better than the baseline that `compare`
    fits, the baseline wins.

    With `--candidates` the paper's optimum is judged, too. Of candidates that take longer than five
    minutes of processor time, only the optimum and the best other one are judged.

    Every finished fit is kept: interrupted or killed, the same command goes on. Started as
    `mpiexec -n 65 python -m mpi4py -m learn tune ...` rank 0 hands out the fits, the others do
    them.
    """
    began = time.time()  # before slow imports, which are part of the budget
    from learn.comparison import jobs

    if budget and candidates is not None:
        raise InputError(
            f"--budget {budget} and --candidates {candidates}: give only one of them"
        )

    return _run_jobs(
        jobs.tune,
        selection,
        file,
        output,
        budget=budget,
        began=began,
        candidates=candidates,
        must_beat_constant=True,
    )


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

    # Refuses a folder that is no comparison, before anything is written into it.
    targets(folder)
    with lock_folder(folder):
        _write_and_print(folder, pictures=pictures)


def _run_jobs(
    jobs: Callable[[Request, Executor], int],
    selection: Selection,
    file: Path,
    output: Path,
    *,
    budget: str = "",
    began: float = 0.0,
    candidates: int | None = None,
    must_beat_constant: bool = False,
) -> int:
    """Run the jobs of a comparison on all processes of the run; write and print its tables.

    `jobs` is the function `compare` or `tune` of `learn.comparison.jobs`, which returns the number
    of the signal that stopped it, or 0. Return the exit code: 0, or 128 plus this number.

    `budget` is the text of the time that the command may take, "" for no limit. The time starts at
    `began` of `time.time` [s], which is not used without a budget. `candidates` is the smallest
    number of candidates to judge, or None.

    With `must_beat_constant`, InputError is raised at the end if a constant predicts as well as a
    tuned model. A baseline may be no better than a constant, because nobody has chosen its
    settings; the tables say so.
    """
    from learn.executor import led, seconds

    with led() as executor:
        check_folder(output)
        until = inf
        if budget:
            until = began + seconds(budget)
        request = request_of(
            selection,
            [file],
            output,
            selection.features,
            until=until,
            candidates=candidates,
        )
        with lock_folder(output):
            signal_number = jobs(request, executor)
            if signal_number:
                name = signal.Signals(signal_number).name
                echo(f"stopped by {name}; the same command goes on with what is left")
                return 128 + signal_number
            tables_of_targets = _write_and_print(output, pictures=False)
            echo(f"pictures: {command_to_type(f'learn show {output}')}")
            if must_beat_constant:
                _require_better_than_constant(tables_of_targets, request)
    return 0


def _require_better_than_constant(
    tables_of_targets: Sequence[Tables], request: Request
) -> None:
    """Raise InputError if a tuned model of a request is no better than a constant.

    The message names the first of these models. Tuned models of the folder that the request does
    not name are not checked.
    """
    from learn.comparison import tables
    from learn.models import MODELS

    models = request.models or MODELS  # Without names the request is for all models.
    for tables_of_target in tables_of_targets:
        for useless in tables.no_better_than_constant(tables_of_target):
            if useless.row.kind == "tuned" and useless.row.model in models:
                raise InputError(
                    f"{tables_of_target.folder.path}: {useless.message}; the tables are"
                    " still written"
                )


def _write_and_print(folder: Path, *, pictures: bool) -> list[Tables]:
    """Write the tables of each target of a comparison into its folder; print and return them.

    With `pictures`, also draw the pictures into the folder.
    """
    from learn.comparison import plots, printing, tables
    from learn.comparison.folder import targets

    tables_of_targets = [
        tables.read(folder_of_target) for folder_of_target in targets(folder)
    ]
    for tables_of_target in tables_of_targets:
        tables.write(tables_of_target)
        printing.show(tables_of_target)
        if pictures:
            for path in plots.draw(tables_of_target):
                echo(f"wrote {path}")
    return tables_of_targets


@grouped
def importance(file: Database, output: Output, *, selection: Selection) -> None:
    """Rank the inputs by what shuffling each does to the error, and drop the weakest.

    Models have the settings that `tune` has found, if the folder holds them, else the paper's
    optimum. Written are DIR/TARGET/importance.csv, selection.csv and importance.png.
    """
    models = selection.model or ["kernel-ridge"]
    # Of several names the last one is taken.
    selection_of_one = selection._replace(model=models[-1:])
    check_folder(output)
    request = request_of(selection_of_one, [file], output, selection.features)
    from learn.comparison.importance import write_report

    with lock_folder(output):
        for path in write_report(request, echo):
            echo(f"wrote {path}")
