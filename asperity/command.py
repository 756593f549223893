"""The command `asperity`: the programs of `gen`, `learn` and `bench` under one name.

A program is imported only when its command line runs or is completed, so that `asperity --help` and
`asperity --version` are quick.
"""

import os
import sys
from importlib import import_module
from typing import Any, NamedTuple

import typer
from typer.core import TyperGroup

from gen.runtime import command_line, farm

COMPLETING = "_ASPERITY_COMPLETE"  # environment variable by which a shell asks for completions


class Program(NamedTuple):
    """A program: the module of its `app` and `main`, whether Ctrl-C ends it at once, its help."""

    module: str
    default_sigint: bool
    summary: str


PROGRAMS = {
    "gen": Program(
        "gen.cli",
        True,
        "Surfaces, contacts, laws of interfaces, and databases of contact problems.",
    ),
    "learn": Program(
        "learn.cli", True, "Surrogates of databases: fit, predict, laws, nine models compared."
    ),
    "bench": Program(
        "bench.__main__", False, "Reports on exactness and speed (needs the extra 'bench')."
    ),
    "serve": Program(
        "asperity.serving.cli",
        False,
        "A server of solver and surrogates for UM-Bridge's clients (needs the extra 'serve').",
    ),
}
"""The programs by their names, in the order of the help."""


class Programs(TyperGroup):
    """A group of programs, each of which is imported only when its own words are looked at."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return name, command and remaining words; the command is the program's own group."""
        name, _, rest = super().resolve_command(ctx, args)
        program = import_module(PROGRAMS[str(name)].module)
        return name, typer.main.get_command(program.app), rest


app = typer.Typer(cls=Programs, rich_markup_mode=None)


app.callback(help="Contact of rough surfaces: solve it, make databases of it, learn from them.")(
    command_line.take_version
)


def _stand_in() -> None:
    """Stand for a program in the help; `Programs` puts the program itself in its place."""


for _name, _program in PROGRAMS.items():
    app.command(_name, help=_program.summary)(_stand_in)


def main() -> int:
    """Run this process's command line and return its exit code, the same one on all MPI ranks."""
    name, *rest = sys.argv[1:] or [""]
    program = PROGRAMS.get(name)
    if COMPLETING in os.environ:  # print the words that can complete a command line, and end
        command: Any = typer.main.get_command(app)
        command(prog_name="asperity")
    with farm.process(default_sigint=program is None or program.default_sigint):
        if program:
            code: int = import_module(program.module).main(rest, name=f"asperity {name}")
        else:
            code = command_line.main(app, sys.argv[1:], "asperity")
    return code
