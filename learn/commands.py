"""The commands of surrogates in use: fit, card, predict, law. Each imports what it needs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.output import Output, check_outputs, kind_of
from gen.runtime.terminal import echo
from learn.options import (
    SEEDS,
    Channel,
    Coverage,
    Crop,
    Deltas,
    EStar,
    File,
    Fill,
    FillMost,
    Inputs,
    Invert,
    Level,
    OverrideScale,
    Poisson,
    Side,
    Unit,
    Young,
    modulus_from,
    typed,
)


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
    from learn.features import chosen
    from learn.models import chosen as chosen_models
    from learn.request import Request
    from learn.surrogate import training
    from learn.surrogate.settings import normalisation_of

    world = farm.this_world()
    if world.is_master:
        wanted = Output(output, "--output", "surrogate")
        check_outputs([wanted], [file] if source is None else [file, source])
    chosen_models([model])
    given = {"features": features, "area_max": area_max, "seed": seed, "normalisation": normalise}
    given = {name: value for name, value in given.items() if value not in {"", None}}
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
    if source is not None and world.is_master:
        request = training.request_from(request, source, given)
    request = world.broadcast(request)
    with Interruption(listening=world.is_master) as interruption:
        surrogate = training.fit(
            request, world, _say, source=source, stopping=interruption.requested
        )
        signal = int(world.broadcast(interruption.signal))
    if surrogate is not None:
        surrogate.save(output)
        echo(f"wrote {output}: python -m learn card {output}")
        return 0
    if signal and world.is_master:
        _say("stopped; the same command goes on with what is left")
    return 128 + signal if signal else 0


def card(file: File) -> None:
    """Print a surrogate's model card: what it was made of, its scores, intervals and ranges."""
    from learn.surrogate import Surrogate
    from learn.surrogate.card import show

    show(Surrogate.load(file))


def predict(
    file: File,
    inputs: Inputs,
    delta: Deltas = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="CSV", help="Write all rows.")
    ] = None,
    interval: Coverage = 0.9,
    side: Side = "",
    unit: Unit = "",
    channel: Channel = "",
    override_scale: OverrideScale = False,
    fill: Fill = False,
    fill_most: FillMost = False,
    level: Level = "",
    crop: Crop = "",
    invert: Invert = False,
    young: Young = None,
    poisson: Poisson = None,
    e_star: EStar = None,
) -> None:
    """Predict area and force of surfaces, with intervals, and a flag for what is unknown ground."""
    from gen.runtime.progress import RunProgress
    from gen.runtime.table import Row, write_csv
    from learn.surrogate import Surrogate
    from learn.surrogate.answers import Question, answers, show
    from learn.surrogate.conformal import checked_level
    from learn.surrogate.sources import Options, deltas_from

    check_outputs([Output(output, "--output")], [file, *inputs])
    surrogate = Surrogate.load(file)
    question = Question(
        deltas=deltas_from(delta) if delta else None,
        e_star=modulus_from(young, poisson, e_star),
        level=checked_level(interval),
        options=Options(
            side=side,
            unit=unit,
            channel=channel,
            override_scale=override_scale,
            fill=fill,
            fill_most=fill_most,
            level=level,
            crop=crop,
            invert=invert,
        ),
    )
    rows: list[Row] = []
    with RunProgress(len(inputs), "inputs") as progress:
        for path in inputs:
            rows += answers(surrogate, [path], question, progress.say)
            progress.advance(1, 0)
    show(rows, interval, question.e_star or surrogate.modulus)
    if output is not None:
        write_csv(output, rows)
        echo(f"wrote {output}")


def law(
    context: typer.Context,
    inputs: Annotated[
        list[str],
        typer.Argument(
            metavar="[SURROGATE] INPUT...",
            help="A surrogate made by learn fit, which --solver does not need; then one surface, or"
            " folders of them, databases or scenes: a population.",
        ),
    ],
    delta: Deltas = "",
    pressure: Annotated[
        str,
        typer.Option(metavar="MPA", help="Nominal pressures: 2, 1,2,5 or start:stop:count."),
    ] = "",
    table: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="Write the table.")
    ] = None,
    header: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a C header for finite elements.")
    ] = None,
    solver: Annotated[
        bool, typer.Option("--solver", help="Solve every contact instead of predicting it.")
    ] = False,
    surfaces: Annotated[
        int,
        typer.Option(min=2, max=10_000, help="Surfaces of a database's or scene's population."),
    ] = 50,
    interval: Coverage = 0.9,
    side: Side = "",
    unit: Unit = "",
    channel: Channel = "",
    override_scale: OverrideScale = False,
    fill: Fill = False,
    fill_most: FillMost = False,
    level: Level = "",
    crop: Crop = "",
    invert: Invert = False,
    young: Young = None,
    poisson: Poisson = None,
    e_star: EStar = None,
) -> None:
    """Tabulate area, force and mean gap against Delta and nominal pressure, monotone, with slopes.

    Bands are the surrogate's intervals for one surface, and quantiles over the surfaces of a
    population; one surface that is solved has none, nor has ground that the surrogate does not
    know. The solver solves at the Delta or pressures given; its E* is 1 MPa, a scene's, or that of
    the surrogate's training unless given.
    """
    from learn.surrogate import Surrogate
    from learn.surrogate.conformal import checked_level
    from learn.surrogate.law import Order, make
    from learn.surrogate.law.table import show, write
    from learn.surrogate.sources import Options

    check_outputs([Output(table, "--csv"), Output(header, "--header")], inputs)
    file, wanted = _surrogate_and_inputs(inputs, solver=solver)
    order = Order(
        inputs=tuple(wanted),
        delta=delta,
        pressure=pressure,
        solver=solver,
        surfaces=surfaces,
        level=checked_level(interval),
        e_star=modulus_from(young, poisson, e_star),
        options=Options(
            side=side,
            unit=unit,
            channel=channel,
            override_scale=override_scale,
            fill=fill,
            fill_most=fill_most,
            level=level,
            crop=crop,
            invert=invert,
        ),
        command=typed(context),
    )
    surrogate = None if file is None else Surrogate.load(file)
    found = make(surrogate, order, _say)
    show(found)
    for written in write(found, table, header):
        echo(f"wrote {written}")


def _surrogate_and_inputs(given: list[str], *, solver: bool) -> tuple[Path | None, list[str]]:
    """The surrogate, and the surfaces after it; the solver may go without a surrogate."""
    first, *others = given
    if solver and not (Path(first).is_file() and kind_of(Path(first)) == "surrogate"):
        return None, given
    if not others:
        raise InputError(
            f"{first}: nothing else given: give a surrogate and then surfaces, or surfaces and"
            " --solver"
        )
    return Path(first), others


def _targets(text: str) -> tuple[str, ...]:
    """Targets from "both" or "area,force,mean_gap"."""
    found = ("area", "force") if text == "both" else tuple(text.split(","))
    if len(set(found)) < len(found) or not all(found):
        raise InputError(f"--target {text!r}: give each once, as area,force")
    return found


def _say(line: str) -> None:
    echo(line, err=True)
