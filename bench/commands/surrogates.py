"""Commands on surrogates: what they are worth, and what they cost."""

from pathlib import Path
from typing import Annotated

import typer

from bench.commands.options import (
    AreaMax,
    Folder,
    FolderIfAny,
    PaperDatabase,
    PaperRows,
    numbers,
    require_place,
    tell,
)


def models(
    comparison: Annotated[Path, typer.Argument(help="Folder of learn compare and learn tune.")],
    output: Folder,
    target: Annotated[str, typer.Option(help="`area` or `force`.")] = "area",
) -> None:
    """Set the errors of the nine models against the times of prediction, fit and search.

    With the Pareto front marked: DIR/models.csv and DIR/models.png.
    """
    from bench.surrogates.models import costs, report

    require_place(output, "models.csv", "models.png")
    tell(output, report(costs(comparison, target)))


def tolerance(
    output: Folder,
    rows: Annotated[
        int, typer.Option(min=1, help="Rows of the paper preset; the paper has 15,878.")
    ] = 600,
    tolerances: Annotated[
        str, typer.Option(metavar="RTOL,...", help="Relative tolerances of the solver.")
    ] = "",
    area_max: AreaMax = 16.56,
) -> None:
    """Measure what the solver's tolerance does to surrogates that learn from its areas.

    The same rows at each tolerance: time of the database, errors of its areas, and errors of kernel
    ridge trained on them and tested on rows solved tightly: DIR/tolerance.csv, .txt and .png. Two
    minutes; goes on after Ctrl-C.
    """
    from bench.surrogates.tolerance import TOLERANCES
    from bench.surrogates.tolerance import tolerance as measure
    from bench.surrogates.tolerance_report import report

    require_place(output, "tolerance.csv", "tolerance.txt", "tolerance.png")
    asked = numbers("tolerances", tolerances, float) if tolerances else TOLERANCES
    found = measure(output, rows, tolerances=asked, area_max=area_max)
    tell(output, report(found))


def generalisation(
    output: Folder,
    rows: PaperRows = 15_878,
    database: PaperDatabase = None,
    model: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="May be repeated; kernel-ridge.")
    ] = None,
    area_max: AreaMax = 16.56,
) -> None:
    """Test surrogates of the paper preset where they were not trained, as in section 4.3.

    A finer grid, unseen Hurst exponents, another generator, other scan lengths, with each feature
    set: scores, flagged rows, coverage of the 90 % intervals, and what mends a failure, which is
    tried. Generates databases in DIR/databases, goes on there after Ctrl-C; DIR/generalisation.csv
    and a picture for each model. Takes long with all rows; fewer give a look.
    """
    from bench.surrogates.generalisation import generalisation as measure
    from bench.surrogates.generalisation_report import report

    require_place(output, "generalisation.csv", "generalisation-kernel-ridge.png")
    names = model or ["kernel-ridge"]
    tell(output, report(measure(output, rows, models=names, given=database, area_max=area_max)))


def cost(
    output: Folder,
    rows: PaperRows = 15_878,
    database: PaperDatabase = None,
    comparison: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of learn tune: the time of its search is t_h, else 0."
        ),
    ] = None,
    area_max: AreaMax = 16.56,
    surfaces: Annotated[int, typer.Option(min=2, help="Surfaces that are timed.")] = 32,
) -> None:
    """Measure what a surrogate costs in all, and from how many queries on it pays (section 4.4).

    Database, tuning, fit and prediction, for the paper's solver and for ours, with each feature set
    of a kernel ridge surrogate, and its learning curves: DIR/cost.csv, learning.csv, cost.txt and
    cost.png. Takes long with all rows; fewer give a look.
    """
    from bench.surrogates.cost import cost as measure
    from bench.surrogates.cost_report import report

    require_place(output, "cost.csv", "learning.csv", "cost.txt", "cost.png")
    found = measure(
        output,
        rows,
        given=database,
        comparison=comparison,
        area_max=area_max,
        surfaces=surfaces,
    )
    tell(output, report(found))


def throughput(
    surrogate: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[SURROGATE]...", help="Files of learn fit; kernel ridge if none."),
    ] = None,
    rows: Annotated[
        int, typer.Option(min=50, help="Rows of the paper preset to fit to, where none is given.")
    ] = 2000,
    database: PaperDatabase = None,
    surfaces: Annotated[int, typer.Option(min=1, help="Surfaces of the paper preset.")] = 16,
    output: FolderIfAny = None,
) -> None:
    """Measure contacts a second of surrogates, called in several ways, beside the solver's.

    Single calls and batches, with and without intervals; processor times. Prints a table and writes
    DIR/throughput.csv if asked to.
    """
    from bench.surrogates import throughput as calls

    require_place(output, "throughput.csv")
    asked = calls.loaded(surrogate) if surrogate else calls.fitted(database, rows)
    tell(output, calls.report(calls.throughput(asked, surfaces)))


def memory(
    output: FolderIfAny = None,
    model: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="May be repeated; all nine if left out."),
    ] = None,
    rows: Annotated[
        int, typer.Option(min=10, help="Training rows; the paper's are 12,703.")
    ] = 12_703,
) -> None:
    """Measure what fits of the nine models take at their peak, the dearest of each search space.

    Prints a table and writes DIR/memory.csv if asked to.
    """
    from bench.memory import measure, report

    require_place(output, "memory.csv")
    tell(output, report(measure(model or [], rows)))
