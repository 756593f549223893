"""Lines that tell how far a report is, beside its output."""

import typer


def remark(line: str) -> None:
    """Print a line to standard error."""
    typer.echo(line, err=True)
