"""`learn fit`: fit a surrogate to a database."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.output import Output, check_outputs
from gen.runtime.terminal import echo
from learn.commands.option_groups import grouped
from learn.commands.options import SEEDS, AreaMax, Database, note

if TYPE_CHECKING:
    from learn.executor import Executor
    from learn.request import Request

SurrogateFile = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="The surrogate to write.")
]


class Choice(NamedTuple):
    """Model, features, targets and rows of a surrogate.

    Attributes
    ----------
    model : str
        Name of the model.
    features : str
        Name of the feature set, "" for the dimensionless one.
    target : str
        Names of targets with commas, or "both".
    source : Path, optional
        Comparison folder whose tuned settings are used.
    area_max : float, optional
        Largest area that is kept [%].
    normalise : str
        Name of the scaling, "" for that of the features.
    seed : int, optional
        Seed of the split and of the model.
    train_rows : int, optional
        Largest number of rows to train on and to calibrate with.
    """

    model: Annotated[
        str, typer.Option(metavar="NAME", help="One of the nine models, as in learn compare.")
    ] = "kernel-ridge"
    features: Annotated[
        str,
        typer.Option(
            metavar="SET",
            help="paper, dimensionless (any scan length) or hybrid (most exact; needs surfaces);"
            " dimensionless if left out.",
        ),
    ] = ""
    target: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="area, force, both, or yielded_percent, mean_gap, largest_pressure, perimeter if"
            " they are stored; several with commas.",
        ),
    ] = "both"
    source: Annotated[
        Path | None,
        typer.Option("--from", metavar="DIR", help="Use the winner of learn tune in this folder."),
    ] = None
    area_max: AreaMax = None
    normalise: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="l2, standard, min-max or none; l2 for paper features, standard for other sets.",
        ),
    ] = ""
    seed: Annotated[
        int | None, typer.Option(min=0, max=SEEDS, help="Seed of the split and the model [0].")
    ] = None
    train_rows: Annotated[
        int | None, typer.Option(metavar="N", help="Train and calibrate on N rows at most.")
    ] = None


@grouped
def fit(file: Database, output: SurrogateFile, *, choice: Choice) -> int:
    """Fit a surrogate: area and force with intervals, in one file that holds its own model card.

    A tenth of the training rows calibrates the intervals; the test rows give the scores. Started as
    `mpiexec -n 9 python -m mpi4py -m learn fit ...`, the workers generate surfaces.
    """
    from learn.executor import lead

    def job(executor: Executor) -> int:
        wanted = Output(output, "--output", "surrogate")
        check_outputs([wanted], [each for each in (file, choice.source) if each is not None])
        return _fit(_request(file, output, choice), choice.source, executor)

    return lead(job, farm.this_world())


def _request(file: Path, output: Path, choice: Choice) -> Request:
    """Return the request; a comparison folder adds the rows and the seed of its winner."""
    from learn.features import chosen
    from learn.models import models_named
    from learn.request import Request
    from learn.surrogate import training
    from learn.surrogate.settings import normalisation_of

    models_named([choice.model])
    features = chosen(choice.features or "dimensionless")
    request = Request(
        database=file,
        output=output,
        targets=_targets(choice.target),
        models=(choice.model,),
        area_max=choice.area_max,
        normalisation=normalisation_of(features.normalisation, choice.normalise),
        features=features.name,
        seed=choice.seed or 0,
        train_rows=choice.train_rows,
    )
    if choice.source is None:
        return request
    stated = {
        "features": choice.features,
        "area_max": choice.area_max,
        "seed": choice.seed,
        "normalisation": choice.normalise,
    }
    stated = {name: value for name, value in stated.items() if value not in {"", None}}
    return training.request_from(request, choice.source, stated)


def _fit(request: Request, source: Path | None, executor: Executor) -> int:
    """Fit and save a surrogate; return the exit code."""
    from gen.runtime.interruption import Interruption
    from learn.surrogate import training

    with Interruption(listening=True) as interruption:
        stopping = interruption.requested
        surrogate = training.fit(request, executor, note, source=source, stopping=stopping)
    if surrogate is None:
        note("stopped; the same command goes on with what is left")
        return 128 + interruption.signal
    surrogate.save(request.output)
    echo(f"wrote {request.output}: python -m learn card {request.output}")
    return 0


def _targets(text: str) -> tuple[str, ...]:
    """Parse targets, "both" or "area,force,mean_gap"."""
    targets = ("area", "force") if text == "both" else tuple(text.split(","))
    if len(set(targets)) < len(targets) or not all(targets):
        raise InputError(f"--target {text!r}: give each once, as area,force")
    return targets
