"""Commands on surrogates: their errors, and their costs."""

from pathlib import Path
from typing import Annotated

import typer

from bench.commands.options import (
    AREA_MAX,
    PAPER_DATABASE,
    PAPER_ROWS,
    Folder,
    numbers,
    option,
    require_place,
    tell,
)


def models(
    comparison: Annotated[Path, typer.Argument(help="Folder of learn compare and learn tune.")],
    output: Folder,
    target: str = option("area", "`area` or `force`."),
) -> None:
    """Set the errors of the nine models against the times of prediction, fit and search.

    With the Pareto front marked: DIR/models.csv and DIR/models.png.
    """
    from bench.surrogates.models import costs, report

    require_place(output, "models.csv", "models.png")
    tell(output, report(costs(comparison, target)))


def features(
    output: Folder,
    rows: int = PAPER_ROWS,
    database: Path | None = PAPER_DATABASE,
    seeds: str = option("0,1,2", "Seeds of the split.", metavar="N,..."),
    of: list[str] | None = option(
        None, "May be repeated; all sets if left out.", "--features", metavar="SET"
    ),
    area_max: float = AREA_MAX,
    surfaces: int = option(16, "Surfaces that are timed.", min=2),
) -> None:
    """Measure what each feature set is worth: errors, small areas, intervals, and its cost.

    Kernel ridge on the paper preset, on several seeds of the split: DIR/features.csv, coverage.csv,
    features.txt and features.png. Takes long with all rows, fewer give a look; goes on after
    Ctrl-C.
    """
    from bench.surrogates.features import features as measure
    from bench.surrogates.features import report, times_in_solves

    require_place(output, "features.csv", "coverage.csv", "features.txt", "features.png")
    asked = numbers("seeds", seeds, int)
    names = of or ["paper", "dimensionless", "hybrid"]
    judged = measure(output, rows, given=database, seeds=asked, names=names, area_max=area_max)
    tell(output, report(judged, times_in_solves(surfaces)))


def coverage(
    output: Folder,
    rows: int = option(1500, "Rows of the paper preset, and of each broad scene.", min=1),
    seeds: int = option(3, "Draws of the training rows.", min=1),
) -> None:
    """Count which rows that a surrogate does not flag lie inside their interval of 90 %.

    Trained on the paper preset, alone and with 20 rows of a finer grid, and on the broad scenes;
    tested on unseen Hurst exponents, generators, grids and hardnesses. Generates databases in
    DIR/databases, goes on there after Ctrl-C; DIR/coverage.csv, coverage-seeds.csv and
    coverage.txt. Ten minutes; fewer rows give a look.
    """
    from bench.surrogates.coverage import coverage as measure
    from bench.surrogates.coverage import report

    require_place(output, "coverage.csv", "coverage-seeds.csv", "coverage.txt")
    tell(output, report(measure(output, rows, seeds)))


def scans(
    output: Folder,
    rows: int = option(3000, "Rows of each size of the windows.", min=1),
    nodes: str = option("64,128", "Nodes a side of the windows.", metavar="N,..."),
    seed: int = option(0, "Seed of the fifths of the tiles.", min=0),
) -> None:
    """Test surrogates on windows of maps: on parts of maps that they have not seen, and other maps.

    Writes twenty made maps into DIR/maps, generates databases of their windows in DIR/databases,
    goes on there after Ctrl-C; DIR/scans.csv, .txt and .png. Twenty minutes; fewer rows give a
    look.
    """
    from bench.populations.scans import report
    from bench.populations.scans import scans as measure

    require_place(output, "scans.csv", "scans.txt", "scans.png")
    tell(output, report(measure(output, rows, numbers("nodes", nodes, int), seed)))


def cost(
    output: Folder,
    rows: int = PAPER_ROWS,
    database: Path | None = PAPER_DATABASE,
    comparison: Path | None = option(
        None, "Folder of learn tune: the time of its search is t_h, else 0.", metavar="DIR"
    ),
    area_max: float = AREA_MAX,
    surfaces: int = option(32, "Surfaces that are timed.", min=2),
) -> None:
    """Measure what a surrogate costs in all, and from how many queries on it pays (section 4.4).

    Database, tuning, fit and prediction, for the paper's solver and for ours, with each feature set
    of a kernel ridge surrogate, and its learning curves: DIR/cost.csv, learning.csv, cost.txt and
    cost.png. Takes long with all rows; fewer give a look.
    """
    from bench.surrogates.cost import cost as measure
    from bench.surrogates.cost import report

    require_place(output, "cost.csv", "learning.csv", "cost.txt", "cost.png")
    given = {"given": database, "comparison": comparison}
    tell(output, report(measure(output, rows, **given, area_max=area_max, surfaces=surfaces)))
