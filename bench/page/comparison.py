"""What a page shows of a folder of `learn compare`, `learn tune` and `learn estimate`."""

from pathlib import Path

from bench.page.content import Absent, Content, Table
from bench.table import read_table


def scores(folder: Path) -> list[Content]:
    """List scores and times of the nine models, for every target."""
    found = sorted(folder.glob("*/scores.csv"))
    return [content for table in found for content in _target(table.parent)]


def searches(folder: Path) -> list[Content]:
    """List the searches for settings, for every target."""
    return [_searches(table) for table in sorted(folder.glob("*/tuning.csv"))]


def whole_grids(folder: Path) -> list[Content]:
    """List the times that whole grids take, for every target."""
    return [_whole_grids(table) for table in sorted(folder.glob("*/whole-grids.csv"))]


def _target(folder: Path) -> list[Content]:
    return [
        Table(
            folder / "scores.csv",
            f"{folder.name}: scores on the test rows [%], the paper's Table 4 beside ours.",
            columns=(
                "model", "result", "nmse", "nmae", "nmaxe", "r2", "paper_nmse", "paper_nmae",
                "paper_nmaxe", "paper_r2", "failure",
            ),
        ),
        Table(
            folder / "times.csv",
            "Times of fits made alone, on one thread, and of predictions [s].",
        ),
    ]  # fmt: skip


def _searches(table: Path) -> Content:
    if read_table(table)[1]:
        caption = f"{table.parent.name}: what was searched, of which grid, and what was found."
        return Table(table, caption)
    return Absent("tuned models", f"python -m learn tune DATABASE -o {table.parent.parent}")


def _whole_grids(table: Path) -> Content:
    if not read_table(table)[1]:
        return Absent("whole grids", f"python -m learn estimate DATABASE -o {table.parent.parent}")
    return Table(
        table,
        f"{table.parent.name}: what searching the whole grid takes on one thread [s], and the"
        " standard error of that; so many fits of all were timed on all rows. Where they are fewer,"
        " fits drawn at random were done on few rows, and as many as there was time for on more, up"
        " to the rows given; the paper's time beside it.",
    )
