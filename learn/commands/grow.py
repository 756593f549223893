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
        help="The surrogate to write; database and picture stand beside it.",
    ),
]

LARGEST_NMAE = (
    1000.0  # largest error to grow to [%]; a surrogate that always answers 0 has 100 %
)


class Goal(NamedTuple):
    """Options of the surrogate, and the largest cost of its growth; see their help."""

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
    as `mpiexec -n 9 python -m mpi4py -m learn grow ...`, the workers compute the rows. Beside the
    surrogate stand an ordinary database (.h5) and a picture of the learning curve and the
    predictions (.png).
    """
    from learn.executor import led, seconds

    with led() as executor:
        from gen.runtime.farm import Interruption
        from gen.runtime.figure import new_figure, save
        from gen.scene import load
        from learn.grow.rounds import Growth, draw, show
        from learn.surrogate.fitting import require_better

        until = time.time() + seconds(goal.budget) if goal.budget else inf
        database, drawing = (_beside(output, suffix) for suffix in (".h5", ".png"))
        check_outputs(
            [
                Output(output, "--output", "surrogate"),
                Output(drawing, "--output", "picture"),
            ],
            [scene] if Path(scene).is_file() else [],
        )
        _require_own(database, output, drawing)
        figure = new_figure(10.0, 4.6, dpi=110)
        with Interruption(listening=True) as interruption:
            wanted = load(scene)
            request = _request(output, goal, wanted)
            how = executor, note, interruption.requested, until
            growth = Growth(request, goal.nmae, goal.rows, wanted, *how)
            ending, last = growth.grow()
        if ending == "interrupted" or last is None:
            note(f"stopped; {database} is kept, the same command goes on")
            return 128 + interruption.signal
        show(growth, ending, last)
        draw(figure, last)
        echo(f"wrote {output}, {database} and {save(figure, drawing)}")
        require_better(last.surrogate, str(output))
        return 0


def _require_own(database: Path, surrogate: Path, drawing: Path) -> None:
    """Refuse files that no growth to this surrogate can have written; say which rows are there.

    Its database is the first file that a growth writes, and its picture the last.
    """
    for before, after in ((database, surrogate), (surrogate, drawing)):
        if after.exists() and not before.exists():
            raise InputError(
                f"--output {surrogate}: {after} is there already, but not {before}, which would"
                " have been written before it: give another name"
            )
    if database.exists() and not surrogate.exists():
        note(f"{database}: is there already; its rows count, and more are added to it")


def _request(output: Path, goal: Goal, scene: Scene) -> Request:
    """Check the options, and return the request for a surrogate that they describe."""
    from learn.features.scene import SCENE, load_of
    from learn.models import POPULATION, default_model, models_named

    if not 0 < goal.nmae <= LARGEST_NMAE:
        raise InputError(
            f"--nmae {goal.nmae:g}: give an error above 0 % and up to {LARGEST_NMAE:g} %, as 2"
        )
    of_scene = goal.features == SCENE
    (model,) = models_named([goal.model or default_model(goal.features)], goal.features)
    if of_scene and model.name != POPULATION.name:
        raise InputError(
            f"--model {goal.model}: of {SCENE} features, {POPULATION.name} alone knows the error of"
            " its mean: leave that out"
        )
    drawn: Any = load_of(scene) if of_scene else ""
    options = goal._replace(model=model.name, load=goal.load or drawn)
    return request_of(
        options, [_beside(output, ".h5")], output, goal.features, roots=True
    )


def _beside(output: Path, suffix: str) -> Path:
    """Return the file of this suffix that stands beside a surrogate, which may not have it."""
    if not output.name or output.suffix in {".h5", ".png", ".toml"}:
        raise InputError(
            f"--output {output}: give the name of a surrogate, as my.surrogate"
        )
    return output.with_suffix(suffix)
