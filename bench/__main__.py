"""`python -m bench`: reports on how exact and how fast the packages are."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from gen import command_line

app = typer.Typer(add_completion=False, rich_markup_mode=None)

Folder = Annotated[
    Path, typer.Option("--output", "-o", metavar="DIR", help="The folder to write into.")
]


@app.callback()
def describe_program() -> None:
    """Reports on exactness and speed, each as a table (CSV) and a picture (PNG)."""


@app.command()
def hertz(output: Folder) -> None:
    """Press a paraboloid and compare with Hertz.

    Force and area against the displacement, for the closed form and for both kernels on 128 and on
    256 nodes a side, as in section 2.4 of the paper: DIR/hertz.csv and DIR/hertz.png.
    """
    from bench.hertz import write_report

    for path in write_report(output):
        typer.echo(path)


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code."""
    return command_line.call(app, "bench", arguments)


if __name__ == "__main__":
    # One thread, as in production: more would blur every time.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    sys.exit(main(sys.argv[1:]))
