"""What a page shows of a folder of `learn compare`, `learn tune` and `learn estimate`."""

from pathlib import Path

from bench.page.content import Absent, Content, Table
from bench.table import read_table


def scores(folder: Path) -> list[Content]:
    """List scores and times of the nine models, for every target."""
    columns = ("nmse", "nmae", "nmaxe", "r2")
    theirs = (f"paper_{name}" for name in columns)
    shown = ("model", "result", *columns, *theirs, "failure")
    contents: list[Content] = []
    for path in sorted(folder.glob("*/scores.csv")):
        caption = (
            f"{path.parent.name}: scores on the test rows [%], the paper's Table 4 beside ours."
        )
        times = "Times of fits made alone, on one thread, and of predictions [s]."
        contents.append(Table(path, caption, columns=shown))
        contents.append(Table(path.with_name("times.csv"), times))
    return contents


def searches(folder: Path) -> list[Content]:
    """List the searches for settings, for every target."""
    caption = "what was searched, of which grid, and what was found."
    return _of_targets(folder, "tuning", caption, "tuned models", "tune")


def whole_grids(folder: Path) -> list[Content]:
    """List the times that whole grids take, for every target."""
    caption = (
        "what searching the whole grid takes on one thread [s], and the standard error of that;"
        " so many fits of all were timed on all rows. Where they are fewer, fits drawn at random"
        " were done on few rows, and as many as there was time for on more, up to the rows given;"
        " the paper's time beside it."
    )
    return _of_targets(folder, "whole-grids", caption, "whole grids", "estimate")


def _of_targets(folder: Path, name: str, caption: str, what: str, command: str) -> list[Content]:
    """List a table of each target, or the command of `learn` that fills it."""
    how = f"python -m learn {command} DATABASE -o {folder}"
    return [
        Table(path, f"{path.parent.name}: {caption}") if read_table(path)[1] else Absent(what, how)
        for path in sorted(folder.glob(f"*/{name}.csv"))
    ]
