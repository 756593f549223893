"""The programs of `gen`, `learn` and `bench` under the name of one command, `asperity`.

A program is imported only when its command line runs or is completed, so that `asperity --help` and
`asperity --version` are quick.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple

import typer
from typer.core import TyperGroup

from gen.runtime import command_line


class Program(NamedTuple):
    """A program: the module of its `app` and `main`, and its help."""

    module: str
    summary: str


PROGRAMS = {
    "gen": Program(
        "gen.cli",
        "Surfaces, contacts, laws of interfaces, and databases of contact problems.",
    ),
    "learn": Program(
        "learn.cli", "Surrogates of databases: fit, predict, laws, nine models compared."
    ),
    "bench": Program(
        "bench.commands", "Reports on exactness and speed (needs the extra 'bench')."
    ),
    "serve": Program(
        "asperity.serving.cli",
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


app.callback(
    help="Contact of rough surfaces: solve it, make databases of it, learn from them."
)(command_line.take_version)


def _stand_in() -> None:
    """Stand for a program in the help; `Programs` puts the program itself in its place."""


for _name, _program in PROGRAMS.items():
    app.command(_name, help=_program.summary)(_stand_in)


def run(arguments: Sequence[str]) -> int:
    """Run a command line in a `gen.runtime.farm.process`; return its exit code."""
    name, *rest = arguments or [""]
    if program := PROGRAMS.get(name):
        code: int = import_module(program.module).main(rest, name=f"asperity {name}")
        return code
    return command_line.main(app, arguments, "asperity")


def complete() -> None:
    """Print the words that can complete the command line of a shell, and end this process."""
    command: Any = typer.main.get_command(app)
    command(prog_name="asperity")
