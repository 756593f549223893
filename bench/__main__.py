"""`python -m bench`: reports on how exact and how fast the packages are."""

import sys
from collections.abc import Sequence

import typer

from bench.commands import farm, page, solver, surrogates
from gen.runtime import command_line
from gen.runtime import farm as processes

app = typer.Typer(add_completion=False, rich_markup_mode=None)

COMMANDS = (
    *(page.run, page.page, page.publish, page.paper),
    *(solver.solver, solver.peers, solver.growth),
    *(solver.threads, solver.hertz, solver.theory, solver.calculix, solver.stability),
    *(surrogates.models, surrogates.features, surrogates.cost),
    *(surrogates.coverage, surrogates.scans),
    *(farm.speedup, farm.writers, farm.outputs, farm.databases),
)

for _command in COMMANDS:
    app.command()(_command)


@app.callback()
def describe_program(*, version: command_line.Version = False) -> None:
    """Reports on exactness and speed, each as a table (CSV) and a picture (PNG)."""


def main(arguments: Sequence[str], name: str = "bench") -> int:
    """Run one command line; return its exit code."""
    return command_line.main(app, name, arguments, alone=True)


if __name__ == "__main__":
    command_line.start(default_sigint=False)
    code = main(sys.argv[1:])
    processes.leave()
    sys.exit(code)
