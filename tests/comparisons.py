"""Command lines of learn in this process, and the tables that they write."""

import csv
from pathlib import Path

from learn import cli


def run(*arguments: object) -> int:
    """Run a command line; return its exit code."""
    return cli.main([str(argument) for argument in arguments])


def table(path: str | Path) -> list[dict[str, str]]:
    """Read a table (CSV)."""
    with Path(path).open(newline="") as file:
        return list(csv.DictReader(file))
