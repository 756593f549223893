"""The command line of `python -m gen`; the functions of its commands are in `gen.commands`."""

from functools import partial

import typer

from gen.commands.databases import (
    check,
    columns,
    estimate,
    export,
    info,
    merge,
    plot,
    run,
)
from gen.commands.surfaces import contact, describe, law, scene
from gen.runtime import command_line

app = typer.Typer(add_completion=False, rich_markup_mode=None)

COMMANDS = (
    run,
    info,
    contact,
    law,
    describe,
    plot,
    columns,
    check,
    merge,
    export,
    estimate,
    scene,
)
"""Functions of the commands, in the order in which the help lists them."""

for _command in COMMANDS:
    app.command(cls=command_line.Command)(_command)

app.callback(
    help="Generate databases of rough-surface contact, inspect them, and solve single problems."
)(command_line.take_version)

main = partial(command_line.main, app, name="gen", collective=["run"])
"""Run a command line, given as a sequence of words, and return its exit code.

See `gen.runtime.command_line.main`. The name of the program in messages is "gen"; the argument
`name` replaces it, for example by "asperity gen".
"""
