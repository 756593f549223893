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


@app.command()
def outputs(
    scene: Annotated[str, typer.Argument(help="Scene whose first rows are computed.")] = "paper",
    rounds: Annotated[int, typer.Option(min=1, help="Repetitions; medians count.")] = 7,
) -> None:
    """Measure what each optional output of a database costs, and print it as a table."""
    from bench.outputs import markdown_table, measure

    typer.echo(markdown_table(measure(scene, rounds=rounds)))


@app.command()
def faults(
    rounds: Annotated[int, typer.Option(min=1, help="Runs to interrupt.")] = 30,
    seed: Annotated[int, typer.Option(min=0, help="Seed of victims and moments.")] = 0,
) -> int:
    """Kill runs at random moments and see whether anything is lost, wrong or done twice.

    Exit code 0 if nothing was, 1 otherwise.
    """
    import tempfile

    from bench.faults import campaign

    with tempfile.TemporaryDirectory() as folder:
        faulty = 0
        for number, result in enumerate(campaign(Path(folder), rounds, seed), start=1):
            verdict = result.fault or "ok"
            typer.echo(
                f"{number:3} {result.signal:8} to {result.victim:8} after {result.delay:4.1f} s:"
                f" {result.before:5} -> {result.after:5} rows, exit code {result.code:4}: {verdict}"
            )
            faulty += bool(result.fault)
    typer.echo(f"{rounds} interrupted runs, {faulty} with a fault")
    return 1 if faulty else 0


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code."""
    return command_line.call(app, "bench", arguments)


if __name__ == "__main__":
    # One thread, as in production: more would blur every time.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    sys.exit(main(sys.argv[1:]))
