"""`learn fit`: fit a surrogate to a database."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.output import Output, check_outputs
from gen.runtime.terminal import echo
from learn.commands.options import SEEDS, note


def fit(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A database made by gen (HDF5).")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The surrogate to write.")
    ],
    model: Annotated[
        str, typer.Option(metavar="NAME", help="One of the nine models, as in learn compare.")
    ] = "kernel-ridge",
    features: Annotated[
        str,
        typer.Option(
            metavar="SET",
            help="paper, dimensionless (any scan length) or hybrid (most exact; needs surfaces);"
            " dimensionless if left out.",
        ),
    ] = "",
    target: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="area, force, both, or mean_gap, largest_pressure, perimeter where they are"
            " stored; several with commas.",
        ),
    ] = "both",
    source: Annotated[
        Path | None,
        typer.Option("--from", metavar="DIR", help="Take the winner that learn tune found there."),
    ] = None,
    area_max: Annotated[
        float | None,
        typer.Option(metavar="PERCENT", help="Leave larger areas out; 16.56 is the paper's range."),
    ] = None,
    normalise: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="l2, standard, min-max or none; l2 for paper features, standard for others.",
        ),
    ] = "",
    seed: Annotated[
        int | None, typer.Option(min=0, max=SEEDS, help="Of the split and the model [0].")
    ] = None,
    train_rows: Annotated[
        int | None, typer.Option(metavar="N", help="Train and calibrate on N rows at most.")
    ] = None,
) -> int:
    """Fit a surrogate: area and force with intervals, in one file that holds its own model card.

    A tenth of the training rows calibrates the intervals; the test rows judge. Started as
    `mpiexec -n 9 python -m mpi4py -m learn fit ...`, the workers generate surfaces anew.
    """
    from gen.runtime.interruption import Interruption
    from learn.executor import Executor, lead
    from learn.features import chosen
    from learn.models import chosen as chosen_models
    from learn.request import Request
    from learn.surrogate import training
    from learn.surrogate.settings import normalisation_of

    def job(executor: Executor) -> int:
        wanted = Output(output, "--output", "surrogate")
        check_outputs([wanted], [file] if source is None else [file, source])
        chosen_models([model])
        taken = chosen(features or "dimensionless")
        request = Request(
            database=file,
            output=output,
            targets=_targets(target),
            models=(model,),
            area_max=area_max,
            normalisation=normalisation_of(taken.normalisation, normalise),
            features=taken.name,
            seed=seed or 0,
            train_rows=train_rows,
        )
        if source is not None:
            stated = {"features": features, "area_max": area_max, "seed": seed}
            stated |= {"normalisation": normalise}
            stated = {name: value for name, value in stated.items() if value not in {"", None}}
            request = training.request_from(request, source, stated)
        with Interruption(listening=True) as interruption:
            stopping = interruption.requested
            surrogate = training.fit(request, executor, note, source=source, stopping=stopping)
        if surrogate is None:
            note("stopped; the same command goes on with what is left")
            return 128 + interruption.signal
        surrogate.save(output)
        echo(f"wrote {output}: python -m learn card {output}")
        return 0

    return lead(job, farm.this_world())


def _targets(text: str) -> tuple[str, ...]:
    """Targets from "both" or "area,force,mean_gap"."""
    found = ("area", "force") if text == "both" else tuple(text.split(","))
    if len(set(found)) < len(found) or not all(found):
        raise InputError(f"--target {text!r}: give each once, as area,force")
    return found
