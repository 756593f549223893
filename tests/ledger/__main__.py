"""`python -m tests.ledger`: counts of work and of results beside those of the ledger."""

import sys
from typing import Annotated

import typer

from gen.runtime import command_line, farm
from gen.runtime.errors import InputError
from tests.ledger.counts import (
    LEDGER,
    faults,
    job_counts,
    read,
    solve_counts,
    text_table,
    updated,
    write_entries,
)

app = typer.Typer(add_completion=False, rich_markup_mode=None)


@app.command()
def ledger(
    update: Annotated[
        str | None,
        typer.Option(
            metavar="REASON", help="Write the new counts with the reason of the change."
        ),
    ] = None,
) -> int:
    """Compare counts of convolutions, contact nodes, rows, bytes and fits with the committed ones.

    The counts do not depend on the machine's load. The exit code is 1 if work rises by more than
    2 %, or results change by more than 0.1 %.
    """
    if update is not None and not update.strip():
        raise InputError("--update: give the reason of the change")
    entries = read()
    counts = solve_counts() | job_counts()
    typer.echo(text_table(entries, counts))
    if update is not None:
        write_entries(updated(entries, counts, update))
        typer.echo(f"wrote {LEDGER}")
        return 0
    found = list(faults(entries, counts))
    for fault in found:
        typer.echo(f"ledger: {fault}")
    if found:
        typer.echo("if wanted: python -m tests.ledger --update 'the reason'")
    return 1 if found else 0


if __name__ == "__main__":
    with farm.process():
        code = command_line.main(app, sys.argv[1:], "ledger", single_process=True)
    sys.exit(code)
