"""Commands that put the paper beside ours, and all reports on one page."""

from pathlib import Path

import typer

from bench.commands.options import PAPER_DATABASE, PARTS, Folder, option
from bench.report import remark


def run(
    output: Folder,
    full: bool = option(False, "Everything: hours. Else what fits into ten minutes.", "--full"),
    database: Path | None = PAPER_DATABASE,
    comparison: Path | None = option(
        None, "Folder of learn compare and tune; made if left out.", metavar="DIR"
    ),
    only: list[str] | None = PARTS,
    plan: bool = option(False, "List the parts with their times, and make nothing.", "--plan"),
) -> int:
    """Make all reports, and one page of them: DIR/index.html, which needs no network.

    Every part runs in turn as a command of its own, in DIR/PART, and stays where the same command
    has made it from the same inputs, with the same code and packages: after Ctrl-C the same
    command goes on. A short run leaves alone what a full one has made. Exit code 1 if a check
    failed or a part could not be made.
    """
    from bench.page.inputs import Inputs
    from bench.page.run import planned
    from bench.page.run import run as make

    if plan:
        typer.echo(planned(Inputs(output, database, comparison, full), only or ()))
        return 0
    path, outcome = make(Inputs(output, database, comparison, full), only or ())
    typer.echo(path)
    if outcome.signal:
        remark("bench: interrupted; the same command goes on")
        return 128 + outcome.signal
    for name in outcome.failed:
        remark(f"bench: {name} failed, see {path} or {output / name}")
    return 1 if outcome.failed else 0


def page(
    folder: Path = typer.Argument(help="Folder of `bench run`."),
    full: bool = option(False, "It was made with --full.", "--full"),
    comparison: Path | None = option(None, "Comparison that it was made with.", metavar="DIR"),
) -> None:
    """Write the page of what a folder holds anew, and make nothing."""
    from bench.page.inputs import Inputs
    from bench.page.run import page as write

    typer.echo(write(Inputs(folder, None, comparison, full)))


def publish(
    folder: Path = typer.Argument(help="Folder of `bench run --full`."),
    target: Path = typer.Argument(help="Folder of published results: bench/results."),
    comparison: Path | None = option(None, "Comparison that it was made with.", metavar="DIR"),
    mixed: bool = option(
        False, "Results of several states of the code may stand there.", "--mixed"
    ),
) -> None:
    """Copy what a run has made into the folder of published results.

    Tables, pictures, words and records of all finished parts, large tables compressed; folders all
    of whose parts were made lose their earlier files. Refused are parts that were not finished,
    results of several states of the code, and more than 6 MB.
    """
    from bench.page.inputs import Inputs
    from bench.page.parts import PARTS as ALL
    from bench.page.publish import publish as copy

    for path in copy(ALL, Inputs(folder, None, comparison, full=True), target, mixed=mixed):
        typer.echo(path)


def paper(
    output: Folder,
    rows: int = option(1000, "Rows of the paper preset, where no database is given.", min=100),
    database: Path | None = PAPER_DATABASE,
    fine: Path | None = option(
        None, "A database on a finer grid, not generated anew.", metavar="FILE"
    ),
    comparison: Path | None = option(
        None, "Folder of learn compare and learn tune, for the area.", metavar="DIR"
    ),
    cost: Path | None = option(None, "Folder of bench cost.", metavar="DIR"),
    only: list[str] | None = PARTS,
) -> None:
    """Draw the paper's figures and tables anew, its numbers beside ours.

    What needs a comparison or costs is left out without them. Deviations are named, and explained
    where that is known. A part stays where it was made from the same inputs, with the same code
    and packages: after Ctrl-C the same command goes on.
    """
    from bench.paper.report import write_report

    inputs = {"database": database, "fine": fine, "comparison": comparison, "cost": cost}
    given = {name: path for name, path in inputs.items() if path is not None}
    for path in write_report(output, given, rows, only=only or ()):
        typer.echo(path)
