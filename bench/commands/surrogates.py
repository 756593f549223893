"""Commands on surrogates: their errors, and their costs."""

from pathlib import Path
from typing import Annotated

import typer

from bench.commands.options import (
    AREA_MAX,
    PAPER_DATABASE,
    PAPER_ROWS,
    Folder,
    FolderIfAny,
    numbers,
    option,
    require_place,
    tell,
)
from gen.runtime.errors import InputError


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


def tolerance(
    output: Folder,
    rows: int = option(600, "Rows of the paper preset; the paper has 15,878.", min=1),
    tolerances: str = option("", "Relative tolerances of the solver.", metavar="RTOL,..."),
    area_max: float = AREA_MAX,
) -> None:
    """Measure what the solver's tolerance does to surrogates that learn from its areas.

    The same rows at each tolerance: time of the database, errors of its areas, and errors of kernel
    ridge trained on them and tested on rows solved tightly: DIR/tolerance.csv, .txt and .png. Two
    minutes; goes on after Ctrl-C.
    """
    from bench.surrogates.tolerance import TOLERANCES, report
    from bench.surrogates.tolerance import tolerance as measure

    require_place(output, "tolerance.csv", "tolerance.txt", "tolerance.png")
    asked = numbers("tolerances", tolerances, float) if tolerances else TOLERANCES
    found = measure(output, rows, tolerances=asked, area_max=area_max)
    tell(output, report(found))


def generalisation(
    output: Folder,
    rows: int = PAPER_ROWS,
    database: Path | None = PAPER_DATABASE,
    model: list[str] | None = option(None, "May be repeated; kernel-ridge.", metavar="NAME"),
    area_max: float = AREA_MAX,
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


def grow(
    output: Folder,
    rows: int = option(500, "Fresh rows that judge each surrogate.", min=10),
    seeds: int = option(3, "Growths of each population.", min=1),
    population: list[str] | None = option(
        None, "`quick` or `maps`; may be repeated; both if left out.", metavar="NAME"
    ),
) -> None:
    """Grow surrogates to an error as `learn grow` does, and compare its promise with the truth.

    The scene `quick` to 3 %, windows of made maps to 5 %, each with several seeds. Databases are
    kept in DIR, and growths go on there after Ctrl-C; DIR/grow.csv, .txt and a picture of each
    population. A quarter of an hour.
    """
    from bench.populations.grow import MARKS, report
    from bench.populations.grow import grow as measure

    asked = population or list(MARKS)
    if unknown := set(asked) - MARKS.keys():
        raise InputError(f"--population {min(unknown)!r}: give {' or '.join(MARKS)}")
    require_place(output, "grow.csv", "grow.txt", *(f"{name}.png" for name in asked))
    tell(output, report(measure(output, rows, seeds, {name: MARKS[name] for name in asked})))


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


def throughput(
    surrogate: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[SURROGATE]...", help="Files of learn fit; kernel ridge if none."),
    ] = None,
    rows: int = option(2000, "Rows of the paper preset to fit to, where none is given.", min=50),
    database: Path | None = PAPER_DATABASE,
    surfaces: int = option(16, "Surfaces of the paper preset.", min=1),
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


def yielding_surrogate(
    output: Folder,
    rows: int = option(3000, "Rows of the scene paper-yielding.", min=100),
) -> None:
    """Measure what a surrogate of bodies that yield is worth: DIR/yielding-surrogate.csv.

    Generates a database in DIR/databases, goes on there after Ctrl-C, and fits it as `learn fit`
    does. Minutes.
    """
    from bench.surrogates.yielding import measure, report

    require_place(output, "yielding-surrogate.csv")
    tell(output, report(measure(output, rows)))


def memory(
    output: FolderIfAny = None,
    model: list[str] | None = option(
        None, "May be repeated; all nine if left out.", metavar="NAME"
    ),
    rows: int = option(12_703, "Training rows; the paper's are 12,703.", min=10),
) -> None:
    """Measure what fits of the nine models take at their peak, the dearest of each search space.

    Prints a table and writes DIR/memory.csv if asked to.
    """
    from bench.memory import measure, report

    require_place(output, "memory.csv")
    tell(output, report(measure(model or [], rows)))
