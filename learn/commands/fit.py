"""`learn fit`: fit a surrogate to one or more databases."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer

from gen.runtime.command_line import Trust, grouped
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import command_to_type, echo

if TYPE_CHECKING:
    from learn.dataset import Request

SEEDS = 2**32 - 1  # the largest seed that all libraries of models take

AreaMax = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT", help="Leave larger areas out; 16.56 is the paper's range."
    ),
]
Features = Annotated[
    str,
    typer.Option(
        metavar="SET",
        help="paper (Delta and the 22 statistics), dimensionless (the same without units: any scan"
        " length), hybrid (with a coarse contact solve of each surface, which it needs: most"
        " exact), or scene (what the scene draws, and its load).",
    ),
]
Blocks = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Blocks along a side of the hybrid features' coarse solve: 33, or 65: more exact, and"
        " slower [33].",
    ),
]
Normalise = Annotated[
    Literal["", "l2", "standard", "min-max", "none"],
    typer.Option(
        metavar="HOW",
        help="l2 (each row to unit length, the paper's), standard, min-max or none; l2 for paper"
        " features and standard for others if left out.",
    ),
]
TrainRows = Annotated[
    int | None,
    typer.Option(metavar="N", help="Train on N rows at most, drawn with the seed."),
]
Databases = Annotated[
    list[Path],
    typer.Argument(metavar="FILE...", help="One or more databases made by gen (HDF5)."),
]
SurrogateFile = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="The surrogate to write.")
]
Load = Annotated[
    Literal["", "delta", "pressure", "force", "relative_delta", "relative_pressure"],
    typer.Option(
        metavar="NAME",
        help="The load: delta or pressure; of scene features also force, or a relative one that the"
        " scene draws. What it draws for these if left out, else delta.",
    ),
]


class Choice(NamedTuple):
    """Model, features, targets and rows of a surrogate; see the help of the options."""

    model: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="One of the nine models, as in learn compare, or population, for scene features;"
            " population there if left out, else kernel-ridge.",
        ),
    ] = ""
    features: Features = ""
    load: Load = ""
    blocks: Blocks = None
    target: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="area, force, both, or the column of another result that is stored, as mean_gap"
            " or an output of your own; several with commas. At a pressure, both are area and"
            " delta.",
        ),
    ] = "both"
    source: Annotated[
        Path | None,
        typer.Option(
            "--from", metavar="DIR", help="Use the winner of learn tune in this folder."
        ),
    ] = None
    area_max: AreaMax = None
    normalise: Normalise = ""
    seed: Annotated[
        int | None,
        typer.Option(min=0, max=SEEDS, help="Seed of the split and the model [0]."),
    ] = None
    train_rows: TrainRows = None
    calibrate_on: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A database whose rows calibrate the intervals; rows of the first if left out.",
        ),
    ] = None


@grouped
def fit(
    files: Databases, output: SurrogateFile, *, choice: Choice, trust: Trust = False
) -> int:
    """Fit a surrogate: area and force with intervals, in one file that holds its own model card.

    Features are dimensionless ones if left out.
    Several databases are learnt together; where their grids differ, the number of nodes is an
    input.

    The training rows calibrate the intervals, each predicted by a model that has not seen its
    surface, or its map. The test rows give the scores. Started as
    `mpiexec -n 9 python -m mpi4py -m learn fit ...`, the workers generate surfaces.
    """
    from gen.runtime.farm import Interruption
    from learn.executor import led
    from learn.models import default_model, models_named
    from learn.surrogate import fitting

    with led() as executor:
        wanted = Output(output, "--output", "surrogate")
        given = (*files, choice.source, choice.calibrate_on)
        check_outputs([wanted], [each for each in given if each is not None])
        # The settings of a comparison were tuned without what surrogates see besides.
        own = {"roots": choice.source is None, "calibrate_on": choice.calibrate_on}
        features = choice.features or "dimensionless"
        asked = choice._replace(model=choice.model or default_model(features))
        request = request_of(asked, files, output, features, **own)
        models_named(list(request.models), features)
        if choice.source is not None:
            request = fitting.with_conditions(request, choice)
        with Interruption(listening=True) as interruption:
            surrogate = fitting.fit(request, executor, note, interruption.requested)
        if surrogate is None:
            note("stopped; the same command goes on with what is left")
            return 128 + interruption.signal
        surrogate.save(output)
        echo(f"wrote {output}: {command_to_type(f'learn card {output}')}")
    return 0


def request_of(
    options: Any, files: Sequence[Path], output: Path, features: str, **own: Any
) -> Request:
    """Return the request of a command's options, a named tuple, and of what is its own.

    Both targets are area and force; at some loads area and Delta. InputError is raised if an option
    has no meaning.
    """
    from learn.dataset import Request, load_drawn
    from learn.features import chosen
    from learn.features.scene import BY_FORCE, SCENE

    given, text = options._asdict(), options.target
    blocks, load = given.get("blocks"), given.get("load", "")
    wanted = chosen(features, roots=True, blocks=blocks, load=load)
    load = load or (load_drawn(files[0]) if features == SCENE else "")
    both = "area", "delta" if load in BY_FORCE else "force"
    targets = both if text == "both" else tuple(text.split(","))
    if len(set(targets)) < len(targets) or not all(targets):
        raise InputError(f"--target {text!r}: give each once, as area,force")
    return Request(
        databases=tuple(files),
        output=output,
        targets=targets,
        models=tuple(
            [given["model"]] if isinstance(given["model"], str) else given["model"] or ()
        ),
        area_max=given.get("area_max"),
        normalisation=given.get("normalise") or wanted.normalisation,
        features=features,
        seed=options.seed or 0,
        train_rows=given.get("train_rows"),
        again=given.get("again", False),
        blocks=blocks,
        load=load,
        **own,
    )


note = partial(echo, err=True)  # print a line for the user on standard error
