"""`learn grow`: generate rows and fit until a surrogate is as accurate as asked for."""

from __future__ import annotations

import time
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from gen.runtime.command_line import Trust, grouped
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import echo
from learn.commands.fit import SEEDS, Blocks, Load, note, request_of

if TYPE_CHECKING:
    from gen.scene import Scene
    from learn.dataset import Request

SceneName = Annotated[
    str, typer.Argument(metavar="SCENE", help="A shipped scene, or a TOML file.")
]
SurrogateFile = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="The surrogate to write; the database and a picture are written beside it.",
    ),
]

LARGEST_NMAE = 1000.0
"""Largest error that a growth may have as its goal [%]. A surrogate that always answers 0 has an
error of 100 %."""


class Goal(NamedTuple):
    """The options about the surrogate and about the largest cost of its growth; see their help."""

    nmae: Annotated[
        float,
        typer.Option(
            "--nmae",
            metavar="PERCENT",
            help="Largest mean error over the mean, of every target.",
        ),
    ] = 2.0
    budget: Annotated[
        str,
        typer.Option(
            metavar="TIME", help="Wall-clock time of this call, as 10min or 2h; no limit"
        ),
    ] = ""
    rows: Annotated[
        int, typer.Option(min=10, metavar="N", help="Most rows of the database.")
    ] = 20_000
    target: Annotated[
        str, typer.Option(metavar="NAME", help="Targets, as for learn fit.")
    ] = "both"
    features: Annotated[
        str, typer.Option(metavar="SET", help="Features, as for learn fit.")
    ] = "hybrid"
    load: Load = ""
    blocks: Blocks = None
    model: Annotated[
        str, typer.Option(metavar="NAME", help="Model, as for learn fit.")
    ] = ""
    seed: Annotated[int, typer.Option(min=0, max=SEEDS, help="Seed of the model.")] = 0


@grouped
def grow(
    scene: SceneName, output: SurrogateFile, *, goal: Goal, trust: Trust = False
) -> int:
    """Generate rows of a scene and fit to them until a surrogate is as accurate as asked for.

    A fifth of the surfaces (of maps: of their tiles) is held out for tests. Each round says how
    many rows the learning curve asks for. Interrupted or killed, the same command goes on. Started
    as `mpiexec -n 9 python -m mpi4py -m learn grow ...`, the workers compute the rows. An ordinary
    database (.h5) and a picture of the learning curve and the predictions (.png) are written beside
    the surrogate.
    """
    from learn.executor import led, seconds

    with led() as executor:
        from gen.runtime.farm import Interruption
        from gen.runtime.figure import new_figure, save
        from gen.scene import load
        from learn.grow.rounds import Growth, draw, show
        from learn.surrogate.fitting import require_better

        until = inf
        if goal.budget:
            until = time.time() + seconds(goal.budget)
        database = _beside(output, ".h5")
        picture = _beside(output, ".png")
        outputs = [
            Output(output, "--output", "surrogate"),
            Output(picture, "--output", "picture"),
        ]
        scene_is_file = Path(scene).is_file()  # otherwise it is a shipped one
        check_outputs(outputs, [scene] if scene_is_file else [])
        _require_own(database, output, picture)
        figure = new_figure(10.0, 4.6, dpi=110)
        with Interruption(listening=True) as interruption:
            scene_to_grow = load(scene)
            request = _request(output, goal, scene_to_grow)
            growth = Growth(
                request=request,
                mark=goal.nmae,
                row_limit=goal.rows,
                scene=scene_to_grow,
                executor=executor,
                say=note,
                stopping=interruption.requested,
                until=until,
            )
            ending, last = growth.grow()
        if ending == "interrupted" or last is None:
            note(f"stopped; {database} is kept, the same command goes on")
            return 128 + interruption.signal
        show(growth, ending, last)
        draw(figure, last)
        echo(f"wrote {output}, {database} and {save(figure, picture)}")
        require_better(last.surrogate, str(output))
        return 0


def _require_own(database: Path, surrogate: Path, picture: Path) -> None:
    """Raise InputError if one of the files exists that no growth with this output has written.

    A growth writes its database first, then its surrogate, and its picture last. A surrogate
    without a database, or a picture without a surrogate, is therefore another command's. If there
    is a database without a surrogate, a line on standard error says that its rows are used.
    """
    for earlier, later in ((database, surrogate), (surrogate, picture)):
        if later.exists() and not earlier.exists():
            raise InputError(
                f"--output {surrogate}: {later} is there already, but not {earlier},"
                " which would have been written before it: give another name"
            )
    if database.exists() and not surrogate.exists():
        note(f"{database}: is there already; its rows count, and more are added to it")


def _request(output: Path, goal: Goal, scene: Scene) -> Request:
    """Return the request for the surrogate of a growth, whose database is beside `output`.

    Raises InputError if the accepted error, the model or another option is not allowed for a
    growth.
    """
    from learn.features.scene import SCENE, load_of
    from learn.models import POPULATION, default_model, models_named

    if not 0 < goal.nmae <= LARGEST_NMAE:
        raise InputError(
            f"--nmae {goal.nmae:g}: give an error above 0 % and up to {LARGEST_NMAE:g}"
            " %, as 2"
        )
    of_scene = goal.features == SCENE
    (model,) = models_named([goal.model or default_model(goal.features)], goal.features)
    if of_scene and model.name != POPULATION.name:
        raise InputError(
            f"--model {goal.model}: of {SCENE} features, {POPULATION.name} alone knows"
            " the error of its mean: leave that out"
        )
    load: Any = goal.load
    if of_scene and not load:
        load = load_of(scene)
    options = goal._replace(model=model.name, load=load)
    database = _beside(output, ".h5")
    return request_of(options, [database], output, goal.features, roots=True)


def _beside(output: Path, suffix: str) -> Path:
    """Return the path of a surrogate with this suffix.

    Raises InputError for a path without a name, and for one with a suffix of the other files.
    """
    if not output.name or output.suffix in {".h5", ".png", ".toml"}:
        raise InputError(
            f"--output {output}: give the name of a surrogate, as my.surrogate"
        )
    return output.with_suffix(suffix)
