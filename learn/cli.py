"""The command line of `python -m learn`: its commands, of which each has a home in `commands`."""

from collections.abc import Sequence

import typer

from gen.runtime import command_line
from learn.commands.comparison import compare, importance, show, tune
from learn.commands.fit import fit
from learn.commands.grow import grow
from learn.commands.predict import card, law, predict

app = typer.Typer(add_completion=False, rich_markup_mode=None)

COMMANDS = (fit, grow, card, predict, law, compare, tune, show, importance)
"""In the order of the help."""

TOGETHER = ("fit", "grow", "compare", "tune")
"""Commands that all processes of an MPI run take part in."""

for _command in COMMANDS:
    app.command()(_command)


def main(arguments: Sequence[str], name: str = "learn") -> int:
    """Run one command line; return its exit code."""
    return command_line.main(app, name, arguments, together=TOGETHER)


@app.callback()
def describe_program(*, version: command_line.Version = False) -> None:
    """Surrogates of contact databases: nine models compared, tuned, and judged by their errors."""
