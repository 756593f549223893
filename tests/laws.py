"""Contact laws by the command line, for tests: run a command, read the table that it wrote."""

import csv
from pathlib import Path

import numpy as np

from learn import cli

STEEL = ["--young", "210e3", "--poisson", "0.3"]
LOADS = ["--pressure", "100:2000:4"]


def run(*arguments, ends=0):
    """Run a command of learn; it has to end with this exit code."""
    assert cli.main([str(argument) for argument in arguments]) == ends


def rows_of(path, against=None):
    """Rows of a table, or those against one argument."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [row for row in rows if against is None or row["against"] == against]


def column(rows, name):
    """A column of numbers."""
    return np.array([float(row[name]) for row in rows])
