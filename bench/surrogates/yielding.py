"""A surrogate of bodies that yield: area, force and yielded nodes, as `learn fit` makes it."""

from pathlib import Path
from typing import Any

from bench.databases import generated, shipped
from bench.report import Report
from bench.table import formatted
from gen.runtime.errors import InputError
from learn import Surrogate
from learn.cli import main as learn

Row = dict[str, Any]

SCENE = "paper-yielding"
TARGETS = ("area", "force", "yielded_percent")
LEVEL = 0.9  # of the intervals whose coverage is told

COLUMNS = {
    "target": "{target}",
    "nMAE [%]": "{nmae:.2f}",
    "R2 [%]": "{r2:.3f}",
    "in the 90 % interval": "{covered:.1%}",
}


def measure(folder: Path, rows: int) -> list[Row]:
    """Generate the first rows of the scene into DIR/databases, fit, and read the scores.

    Returns
    -------
    list of dict
        For each target its largest and smallest value among the test rows, rows that trained and
        that judged, nMAE and R2 [%], and the share of test rows in their interval [1].
    """
    path = folder / "databases" / "yielding.surrogate"
    database = generated(folder / "databases", SCENE, shipped(SCENE, rows))
    arguments = ["fit", str(database), "--features", "hybrid", "--target", ",".join(TARGETS)]
    if learn([*arguments, "-o", str(path)]):
        raise InputError(f"{database}: no surrogate could be fitted")
    card = Surrogate.load(path).card
    return [_row(name, card["targets"][name], card["rows"]) for name in TARGETS]


def _row(name: str, target: dict[str, Any], rows: dict[str, Any]) -> Row:
    (interval,) = (each for each in target["intervals"] if each["level"] == LEVEL)
    low, high = target["range"]
    return {
        "target": name,
        "least": low,
        "most": high,
        "trained": rows["train"],
        "judged": rows["test"],
        "nmae": target["scores"]["nmae"],
        "r2": target["scores"]["r2"],
        "covered": interval["coverage"],
    }


def report(rows: list[Row]) -> Report:
    """Make a report of the rows of `measure`."""
    return Report({"yielding-surrogate": rows}, text=formatted(COLUMNS, rows))
