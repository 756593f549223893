"""`python -m tests.faults`: the fault campaign, from 112 faults down to a single kind."""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from bench.files import write_rows
from gen.runtime import command_line, farm
from tests.faults.campaign import ROUNDS, by_kind, campaign, summary
from tests.faults.kinds import KINDS

app = typer.Typer(add_completion=False, rich_markup_mode=None)


@app.command()
def faults(
    rounds: Annotated[
        int | None, typer.Option(min=1, help="Faults to inject, 112 unless given.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of kinds, victims and moments.")] = 0,
    minutes: Annotated[float, typer.Option(min=0.0, help="No round begins later.")] = 30.0,
    only: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="A kind of the table, alone.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Write faults.csv there.")
    ] = None,
) -> int:
    """Disturb runs at random and see whether anything is lost, wrong or done twice.

    Signals to a run alone, to worker, master and mpiexec; full disks, files cut off or replaced,
    second writers; samples that fail, never end, have a bug. Exit code 0 if as many faults as asked
    for were injected and nothing was wrong, 1 otherwise.
    """
    wanted, done = rounds or ROUNDS, []
    with tempfile.TemporaryDirectory() as folder:
        for interrupted in campaign(
            Path(folder),
            wanted,
            seed=seed,
            kinds=only or tuple(KINDS),
            minutes=minutes,
            remark=lambda words: typer.echo(words, err=True),
        ):
            done.append(interrupted)
            typer.echo(f"{len(done):3} {interrupted.line()}")
    typer.echo(summary(done))
    if output is not None:
        write_rows(output / "faults.csv", by_kind(done))
    missed = wanted - sum(interrupted.found.hit for interrupted in done)
    if missed > 0:
        typer.echo(f"{missed} of {wanted} faults could not be injected")
    return 1 if missed > 0 or any(interrupted.found.fault for interrupted in done) else 0


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code."""
    return command_line.main(app, "faults", arguments, alone=True)


if __name__ == "__main__":
    command_line.start(default_sigint=False)
    code = main(sys.argv[1:])
    farm.leave()
    sys.exit(code)
