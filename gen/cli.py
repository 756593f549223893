"""The command line of `python -m gen`: its commands, of which each has a home in `commands`."""

from collections.abc import Sequence

import typer

from gen.commands.databases import check, columns, estimate, export, info, merge, plot, run
from gen.commands.surfaces import contact, describe, law, scene
from gen.runtime import command_line

app = typer.Typer(add_completion=False, rich_markup_mode=None)

COMMANDS = (
    *(run, info, contact, law, describe, plot, columns, check, merge, export, estimate, scene),
)
"""In the order of the help."""

for _command in COMMANDS:
    app.command()(_command)


def main(arguments: Sequence[str], name: str = "gen") -> int:
    """Run one command line, as of a program of this name, and return its exit code."""
    return command_line.main(app, name, arguments, together=["run"])


@app.callback()
def describe_program(*, version: command_line.Version = False) -> None:
    """Generate databases of rough-surface contact, inspect them, and solve single problems."""
