"""The programs of `gen`, `learn` and `bench` under the name of one command, `asperity`.

A program is imported only when its command line runs or is completed, so that `asperity --help` and
`asperity --version` do not wait for it.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple

import typer
from typer.core import TyperGroup

from gen.runtime import command_line


class Program(NamedTuple):
    """A program of the command."""

    module: str  # dotted name of the module with its `app` and `main`
    summary: str  # line in the help of the command


PROGRAMS = {
    "gen": Program(
        module="gen.cli",
        summary="Surfaces, contacts, laws of interfaces, and databases of contact problems.",
    ),
    "learn": Program(
        module="learn.cli",
        summary="Surrogates of databases: fit, predict, laws, nine models compared.",
    ),
    "bench": Program(
        module="bench.commands",
        summary="Reports on exactness and speed (needs the extra 'bench').",
    ),
    "serve": Program(
        module="asperity.serving.cli",
        summary="A server of solver and surrogates for UM-Bridge's clients (needs the extra"
        " 'serve').",
    ),
}
"""The programs by their names, in the order of the help."""


class Programs(TyperGroup):
    """The group of all programs. It imports a program only to parse the words after its name.

    Typer uses it to complete command lines and to print the help; `run` runs programs without it.
    """

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the program's name, its group of commands, and the words after the name.

        `args` are the name of the program and the words after it. The method replaces that of
        Typer, which returns the command `_stand_in` in place of the program's group.
        """
        name, _, words = super().resolve_command(ctx, args)
        program = import_module(PROGRAMS[str(name)].module)
        return name, typer.main.get_command(program.app), words


app = typer.Typer(cls=Programs, rich_markup_mode=None)
app.callback(
    help="Contact of rough surfaces: solve it, make databases of it, learn from them."
)(command_line.take_version)


def _stand_in() -> None:
    """Do nothing. This command stands for a program in the help, and `Programs` replaces it."""


for _name, _program in PROGRAMS.items():
    app.command(_name, help=_program.summary)(_stand_in)


def run(arguments: Sequence[str]) -> int:
    """Run a command line of `asperity`.

    Parameters
    ----------
    arguments : sequence of str
        Words after the command's name, beginning with the program. The caller has entered
        `gen.runtime.farm.process`.

    Returns
    -------
    int
        Exit code, which is equal on all MPI ranks.
    """
    if arguments and arguments[0] in PROGRAMS:
        name, *words = arguments
        program = import_module(PROGRAMS[name].module)
        code: int = program.main(words, name=f"asperity {name}")
        return code
    # Print the help, the version, or an error about the words.
    return command_line.main(app, arguments, "asperity")


def complete() -> None:
    """Print the words that complete a shell's command line, and end this process.

    The command line is in environment variables that the shell has set.
    """
    command: Any = typer.main.get_command(app)
    command(prog_name="asperity")
