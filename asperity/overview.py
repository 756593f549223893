"""Options of `asperity` itself: the list of programs, the version, completion in shells."""

from importlib import import_module
from typing import Any

import typer
from typer.core import TyperGroup

from asperity.programs import PROGRAMS
from gen.runtime.command_line import Version


class Programs(TyperGroup):
    """A group of programs, each of which is imported only when its own words are looked at."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return name, command and remaining words; the command is the program's own group."""
        name, _, rest = super().resolve_command(ctx, args)
        program = import_module(PROGRAMS[str(name)].module)
        return name, typer.main.get_command(program.app), rest


app = typer.Typer(cls=Programs, rich_markup_mode=None)


@app.callback()
def describe_program(*, version: Version = False) -> None:
    """Contact of rough surfaces: solve it, make databases of it, learn from them."""


def _stand_in() -> None:
    """Stand for a program in the help; `Programs` puts the program itself in its place."""


for _name, _program in PROGRAMS.items():
    app.command(_name, help=_program.summary)(_stand_in)
