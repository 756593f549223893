"""`python -m tests.fuzz`: commands on damaged files, for as many minutes as there are."""

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from gen.runtime import command_line, farm
from gen.runtime.errors import InputError
from tests.fuzz import search
from tests.fuzz.corpus import KINDS

app = typer.Typer(add_completion=False, rich_markup_mode=None)


@app.command()
def fuzz(
    minutes: Annotated[float, typer.Option(min=0.0, help="No case begins later.")] = 10.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all damage.")] = 0,
    cases: Annotated[
        int | None, typer.Option(min=1, help="Number of cases at most; no bound unless given.")
    ] = None,
    first: Annotated[int, typer.Option(min=0, help="Number of the first case.")] = 0,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND", help="scene, database, surrogate, surface, comparison or page, alone."
        ),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Where findings are written.")
    ] = Path("fuzz-findings"),
) -> int:
    """Damage files at random, run commands on them, and see that none crashes, hangs or babbles.

    Right are success, or exit code 2 with one clear line (of `gen check`, 1 too). What else happens
    is kept with its command, DIR/NNN-KIND, and makes the exit code 1. The same seed and number of a
    case do the same damage.
    """
    if output.exists():
        raise InputError(f"{output} exists: give a new folder")
    found, began = search.Findings(output), time.monotonic()
    last = None if cases is None else first + cases
    with tempfile.TemporaryDirectory() as folder:
        for case in search.fuzz(
            Path(folder),
            seed=seed,
            kinds=only or tuple(KINDS),
            seconds=60.0 * minutes,
            first=first,
            last=last,
        ):
            if line := found.add(case, Path(folder) / "case"):
                typer.echo(line, err=True)
    typer.echo(found.summary(time.monotonic() - began))
    return 1 if found.signatures else 0


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code."""
    return command_line.main(app, "fuzz", arguments, alone=True)


if __name__ == "__main__":
    command_line.start(default_sigint=False)
    code = main(sys.argv[1:])
    farm.leave()
    sys.exit(code)
