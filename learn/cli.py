"""The command line of `python -m learn`. Its commands are functions of `learn.commands`."""

from functools import partial

import typer

from gen.runtime import command_line
from learn.commands.comparison import compare, importance, show, tune
from learn.commands.fit import fit
from learn.commands.grow import grow
from learn.commands.predict import card, law, predict

app = typer.Typer(add_completion=False, rich_markup_mode=None)

COMMANDS = (fit, grow, card, predict, law, compare, tune, show, importance)
"""The commands in the order of the help."""

COLLECTIVE = ("fit", "grow", "compare", "tune")
"""Names of the commands in which all processes of an MPI run take part."""

for _command in COMMANDS:
    app.command(cls=command_line.Command)(_command)

app.callback(
    help="Surrogates of contact databases: nine models compared, tuned, and judged by their errors."
)(command_line.take_version)

main = partial(command_line.main, app, name="learn", collective=COLLECTIVE)
"""Run a command line of learn, and return its exit code.

It is called with the sequence of words after the program's name; `name` is the name in messages.
"""
