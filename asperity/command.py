"""The command `asperity`: the programs of `gen`, `learn` and `bench` under one name.

A program is imported only when its command line runs or is completed, so that `asperity --help` and
`asperity --version` are quick.
"""

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from asperity import neighbours
from asperity.programs import PROGRAMS

COMPLETING = "_ASPERITY_COMPLETE"
"""Environment variable by which a shell asks for completions."""


def main() -> int:
    """Run this process's command line and return its exit code, the same one on all MPI ranks."""
    arguments = sys.argv[1:]
    name = arguments[0] if arguments and arguments[0] in PROGRAMS else ""
    fault = neighbours.fault(*(PROGRAMS[name].packages if name else ("gen",)))
    if fault:
        sys.stderr.write(f"asperity: {fault}\n")
        return 2
    from gen.runtime import command_line, farm

    if COMPLETING in os.environ:
        _complete()
    command_line.start(default_sigint=not name or PROGRAMS[name].default_sigint)
    try:
        code = _run(name, arguments)
        farm.leave()
    except Exception:
        farm.abort_all()
    return code


def _run(name: str, arguments: Sequence[str]) -> int:
    """Run a program with the arguments that follow its name, or this command's own options."""
    if name:
        code: int = import_module(PROGRAMS[name].module).main(arguments[1:], f"asperity {name}")
        return code
    from asperity.overview import app
    from gen.runtime import command_line

    return command_line.main(app, "asperity", arguments)


def _complete() -> None:
    """Print the words that can complete a command line, and end; the shell has set variables."""
    import typer

    from asperity.overview import app

    command: Any = typer.main.get_command(app)
    command(prog_name="asperity")
