"""Command lines of learn in this process, the tables that they write, and surrogates as numbers."""

import csv
from pathlib import Path

import numpy as np

from learn import Surrogate, cli


def run(*arguments: object) -> int:
    """Run a command line; return its exit code."""
    return cli.main([str(argument) for argument in arguments])


def table(path: str | Path) -> list[dict[str, str]]:
    """Read a table (CSV)."""
    with Path(path).open(newline="") as file:
        return list(csv.DictReader(file))


def numbers_of(path: Path | str) -> str:
    """Training ranges, and predictions with their intervals at places between their ends."""
    found = Surrogate.load(path)
    shares = np.random.default_rng(0).uniform(-0.2, 1.2, (50, found.low.size))
    inputs = found.low + shares * (found.high - found.low)
    numbers = [found.low, found.high, found.distance.of(inputs)]
    for learnt in found.learnt.values():
        raw = learnt.raw(inputs)
        numbers += [raw, *learnt.calibration.ends(raw, 0.5, inputs)]
    return repr([each.tolist() for each in numbers])
