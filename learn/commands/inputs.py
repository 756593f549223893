"""`learn importance` and `appendix`: reports about the inputs and about two kernel methods."""

from typing import Annotated

import typer

from gen.runtime.command_line import grouped
from gen.runtime.lock import lock_folder
from gen.runtime.terminal import echo
from learn.commands.options import Database, Output, Selection, Target, requested


@grouped
def importance(
    file: Database,
    output: Output,
    model: Annotated[str, typer.Option(metavar="NAME", help="The model to ask.")] = "kernel-ridge",
    target: Target = "area",
    *,
    selection: Selection,
) -> None:
    """Rank the inputs by what shuffling each does to the error, and drop the weakest.

    With the settings that `tune` has found, if the folder holds them, else with the paper's
    optimum: DIR/TARGET/importance.csv, selection.csv and importance.png.
    """
    request = requested(file, output, [model], target, selection)
    from learn.comparison.importance import write_report

    with lock_folder(request.output):
        for path in write_report(request, echo):
            echo(f"wrote {path}")


@grouped
def appendix(
    file: Database,
    output: Output,
    *,
    selection: Selection,
) -> None:
    """Compare Gaussian process and kernel ridge with equal kernels, as the paper's Appendix A.

    DIR/area/appendix.csv and appendix.png.
    """
    request = requested(file, output, None, "area", selection)
    from learn.comparison.appendix import write_report

    with lock_folder(request.output):
        for path in write_report(request, echo):
            echo(f"wrote {path}")
