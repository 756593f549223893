"""`learn fit`: fit a surrogate to one or more databases."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer

from gen.runtime.command_line import Trust, grouped
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import command_to_type, echo

if TYPE_CHECKING:
    from learn.dataset import Request

SEEDS = 2**32 - 1
"""Largest seed that all libraries of models accept."""

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
        help="paper (Delta and the 22 statistics), dimensionless (the same without"
        " units: any scan length), hybrid (with a coarse contact solve of each surface,"
        " which it needs: most exact), or scene (the numbers that the scene draws, and its"
        " load).",
    ),
]
Blocks = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Blocks along a side of the hybrid features' coarse solve: 33, or 65: more"
        " exact, and slower [33].",
    ),
]
Normalise = Annotated[
    Literal["", "l2", "standard", "min-max", "none"],
    typer.Option(
        metavar="HOW",
        help="l2 (each row to unit length, the paper's), standard, min-max or none. If"
        " left out: l2 for paper features, and standard for the other ones.",
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
        help="The load: delta or pressure; of scene features also force, or a relative"
        " one that the scene draws. If left out: delta, or the load that the scene draws.",
    ),
]


class Choice(NamedTuple):
    """The options about model, features, targets and rows of a surrogate; see their help."""

    model: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="One of the nine models, as in learn compare, or population, for scene"
            " features. If left out: population for scene features, else kernel-ridge.",
        ),
    ] = ""
    features: Features = ""
    load: Load = ""
    blocks: Blocks = None
    target: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="area, force, both, or the column of another result that is stored, as"
            " mean_gap or an output of your own; several with commas. At a pressure,"
            " both are area and delta.",
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
            help="A database whose rows calibrate the intervals; if left out, rows of"
            " the training do.",
        ),
    ] = None


@grouped
def fit(
    files: Databases, output: SurrogateFile, *, choice: Choice, trust: Trust = False
) -> int:
    """Fit a surrogate: area and force with intervals, in one file that holds its own model card.

    Without --features they are dimensionless. Several databases are learnt together; where their
    grids differ, the number of nodes is an input.

    The training rows calibrate the intervals, each predicted by a model that has not seen its
    surface, or its map. The test rows give the scores. Started as
    `mpiexec -n 9 python -m mpi4py -m learn fit ...`, the workers generate surfaces.
    """
    from gen.runtime.farm import Interruption
    from learn.executor import led
    from learn.models import default_model, models_named
    from learn.surrogate import fitting

    with led() as executor:
        further_inputs = [choice.source, choice.calibrate_on]
        input_files = [*files, *(path for path in further_inputs if path is not None)]
        check_outputs([Output(output, "--output", "surrogate")], input_files)
        features = choice.features or "dimensionless"
        model = choice.model or default_model(features)
        request = request_of(
            choice._replace(model=model),
            files,
            output,
            features,
            # Comparisons tune models without the square roots that other surrogates see.
            roots=choice.source is None,
            calibrate_on=choice.calibrate_on,
        )
        models_named(list(request.models), features)  # refuses unknown names
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
    options: Any, files: Sequence[Path], output: Path, features: str, **fields: Any
) -> Request:
    """Make the request of a command from its options.

    Parameters
    ----------
    options : NamedTuple
        Options of the command, with the fields `model`, `target` and `seed`. Further fields of
        `Choice` and of `learn.commands.comparison.Selection` are used if it has them; a field
        that is missing has the default of `Request`.
    files : sequence of Path
        Databases. A scene's load is read from the first one if `features` is "scene" and no load is
        given.
    output : Path
        A comparison folder, or the file of a surrogate.
    features : str
        Name of the feature set.
    **fields
        Fields of `Request` that are no options of the command.

    Returns
    -------
    Request
        The request. If `target` is "both", its targets are area and force, or area and Delta at a
        load at which Delta is a result.

    Raises
    ------
    InputError
        If the value of an option is not allowed, an option has no meaning for the features, or the
        load has to be read from a first file that is no database.
    """
    from learn.dataset import Request, load_drawn
    from learn.features import chosen
    from learn.features.scene import SCENE

    values = options._asdict()
    blocks = values.get("blocks")
    load = values.get("load", "")
    # This raises for unknown features, and for a load or blocks that they do not take.
    feature_set = chosen(features, blocks=blocks, load=load)
    if not load and features == SCENE:
        load = load_drawn(files[0])
    return Request(
        databases=tuple(files),
        output=output,
        targets=_targets(options.target, load),
        models=_models(options.model),
        area_max=values.get("area_max"),
        normalisation=values.get("normalise") or feature_set.normalisation,
        features=features,
        seed=options.seed or 0,
        train_rows=values.get("train_rows"),
        again=values.get("again", False),
        blocks=blocks,
        load=load,
        **fields,
    )


def _targets(text: str, load: str) -> tuple[str, ...]:
    """Return the targets that --target names.

    The word "both" names the area, and Delta or the force: the one that is a result under the load.
    `load` is the name of the load, "" for Delta. Raises InputError if a name is empty or is given
    twice.
    """
    from learn.features.scene import BY_FORCE

    if text == "both":
        if load in BY_FORCE:  # a pressure or a force, under which Delta is a result
            return ("area", "delta")
        return ("area", "force")
    targets = tuple(text.split(","))
    if len(set(targets)) < len(targets) or "" in targets:
        raise InputError(f"--target {text!r}: give each once, as area,force")
    return targets


def _models(names: str | Sequence[str] | None) -> tuple[str, ...]:
    """Return one name or several names of models as a tuple; () without a name, for all models."""
    if isinstance(names, str):
        return (names,)
    return tuple(names or ())


def note(line: str) -> None:
    """Print a line for the user on standard error.

    Parameters
    ----------
    line : str
        The line, without its end.
    """
    echo(line, err=True)
