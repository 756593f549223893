"""`python -m tests.ledger`: counts of work and of results beside those of the ledger."""

import sys
from collections.abc import Mapping
from typing import Annotated

import typer

from gen.runtime import command_line, farm
from gen.runtime.errors import InputError
from tests.ledger.constants import largest_change, multiply_constant
from tests.ledger.counts import (
    LEDGER,
    Entry,
    Key,
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
    halved: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Count solves with a constant halved, as bem.active_set.ADVANCE.",
        ),
    ] = None,
    doubled: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Count solves with a constant doubled."),
    ] = None,
) -> int:
    """Compare counts of convolutions, contact nodes, rows, bytes and fits with the committed ones.

    The counts do not depend on the machine's load. The exit code is 1 if work rises by more than
    2 %, or results change by more than 0.1 %. With --halved or --doubled it is 0: the table then
    shows which counts of solves a constant of the solver moves.
    """
    if [update, halved, doubled].count(None) < 2:
        raise InputError("give one of --update, --halved and --doubled")
    if update is not None and not update.strip():
        raise InputError("--update: give the reason of the change")
    entries = read()
    if halved is not None:
        _show_dependence(entries, halved, 0.5)
        return 0
    if doubled is not None:
        _show_dependence(entries, doubled, 2.0)
        return 0
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


def _show_dependence(entries: Mapping[Key, Entry], name: str, factor: float) -> None:
    """Count solves with a constant multiplied by a factor, and print them beside the ledger."""
    change = multiply_constant(name, factor)
    counts = solve_counts()
    typer.echo(text_table(entries, counts))
    typer.echo(change)
    typer.echo(largest_change(entries, counts))


if __name__ == "__main__":
    with farm.process():
        code = command_line.main(app, sys.argv[1:], "ledger", single_process=True)
    sys.exit(code)
