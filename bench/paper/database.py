"""The paper's database beside ours: solve times, distributions, and Table 1."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.page.content import Content, Figure, Table
from bench.paper import deviations
from bench.paper.deviations import short
from bench.paper.facts import AREA_MAX, LONGEST_SOLVE, RANGES
from bench.picture import new_figure, save
from bench.style import COLOURS
from bench.surrogates.break_even import PAPER_ROWS, PAPER_SOLVE
from bench.table import write_table
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.schema import COLUMNS, Column, Status, statistics_columns

Values = NDArray[np.float64]

ENOUGH_INSIDE = 99.0
"""Share of rows inside the paper's range from which on only its ends differ [%]."""

UNEXPLAINED = {"bandwidth_x", "bandwidth_y"}
"""Columns that the paper defines otherwise."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The finished rows of a database.

    Attributes
    ----------
    columns : dict of str to ndarray, shape (n,)
        Values by column: the columns with a range in Table 1, and the solve time.
    rows : ndarray of int, shape (n,)
        Places in the database.
    failed : int
        Number of failed rows.
    """

    columns: dict[str, Values]
    rows: NDArray[np.int64]
    failed: int

    def __getitem__(self, name: str) -> Values:
        """(n,) values of a column."""
        return self.columns[name]


def read(path: Path) -> Rows:
    """Read the finished rows that are drawn here.

    Raises
    ------
    InputError
        If the database has no two finished rows.
    """
    with Reader(path) as reader:
        status = reader.column("status")
        done = np.flatnonzero(status == Status.DONE)
        if done.size < 2:
            raise InputError(f"{path} has {done.size} finished rows: two at least are needed")
        columns = {name: reader.column(name)[done] for name in (*RANGES, "solve_seconds")}
    return Rows(columns, done, int((status == Status.FAILED).sum()))


def solve_times(folder: Path, database: Path) -> list[Content]:
    """Draw the time of a solve against displacement and area (section 2.4)."""
    rows = read(database)
    figure = new_figure(10.5, 4.4)
    axes = figure.subplots(1, 2, sharey=True)
    seconds = rows["solve_seconds"]
    for axis, name, label in (
        (axes[0], "delta", "far-field displacement Δ [µm]"),
        (axes[1], "area_percent", "effective contact area [%]"),
    ):
        shown = axis.scatter(rows[name], seconds, s=2, c=rows["hurst"], rasterized=True)
        axis.axhline(PAPER_SOLVE, color=COLOURS[1], ls="--")
        axis.axhline(LONGEST_SOLVE, color="k", ls=":")
        axis.set(xlabel=label, yscale="log", ylim=(seconds.min() / 2, 3 * LONGEST_SOLVE))
    left = float(rows["delta"].min())
    for height, text in (
        (PAPER_SOLVE, f"the paper's mean, {PAPER_SOLVE:g} s"),
        (LONGEST_SOLVE, f"the paper's longest, about {LONGEST_SOLVE:g} s"),
    ):
        axes[0].annotate(text, (left, height), (0, -12), textcoords="offset points", fontsize=9)
    axes[0].set(ylabel="time of a solve [s]", title="(a) against the displacement")
    axes[1].set(title="(b) against the area")
    figure.colorbar(shown, ax=axes, label="Hurst exponent H")
    growth = [_growth(rows, name) for name in ("delta", "area_percent")]
    caption = (
        f"Section 2.4, solve times on 128 x 128 cells: {rows.rows.size:,} contacts of ours as dots"
        f" ({1000 * seconds.mean():.3g} ms in the mean, {1000 * seconds.max():.3g} ms at most, wall"
        " time as measured while the database was made), the paper's as lines:"
        f" {PAPER_SOLVE / seconds.mean():,.0f} times longer in the mean. As there, time grows with"
        f" displacement and area: from the tenth of the rows with the least to that with the most"
        f" {growth[0]:.2g}-fold and {growth[1]:.2g}-fold. {deviations.SOLVER}."
    )
    picture = save(figure, folder / "solve-times.png")
    return [Figure(picture, caption, data=(_times_table(folder, rows), _rows(folder, rows)))]


def _growth(rows: Rows, name: str) -> float:
    """Mean time of the tenth of the rows with the largest values over that with the smallest."""
    first, *_, last = np.array_split(np.argsort(rows[name]), min(10, rows.rows.size))
    seconds = rows["solve_seconds"]
    return float(seconds[last].mean() / seconds[first].mean())


def _times_table(folder: Path, rows: Rows) -> Path:
    """Times by displacement and by area, in bins of as many rows."""
    found = []
    for name in ("delta", "area_percent"):
        for part in np.array_split(np.argsort(rows[name]), min(10, rows.rows.size)):
            seconds = 1000 * rows["solve_seconds"][part]
            values = (rows[name][part].min(), rows[name][part].max())
            times = (seconds.mean(), np.median(seconds), seconds.max())
            found.append((name, *map(short, values), part.size, *map(short, times)))
    header = ("against", "from", "to", "rows", "mean_ms", "median_ms", "longest_ms")
    return write_table(folder / "solve-times.csv", header, found)


def _rows(folder: Path, rows: Rows) -> Path:
    """The points of the pictures."""
    columns = ("delta", "area_percent", "hurst", "solve_seconds")
    values = zip(rows.rows.tolist(), *(rows[name].tolist() for name in columns), strict=True)
    found = ((row, *(f"{value:.5g}" for value in rest)) for row, *rest in values)
    header = ("row", "delta_um", "area_percent", "hurst", "solve_s")
    return write_table(folder / "rows.csv", header, found)


def distributions(folder: Path, database: Path) -> list[Content]:
    """Draw the distribution of the displacement, and area against it (section 3.2)."""
    rows = read(database)
    figure = new_figure(10.5, 4.2)
    left, right = figure.subplots(1, 2)
    low, high = RANGES["delta"]
    bins = np.linspace(low, high, 41)
    left.hist(rows["delta"], bins, color=COLOURS[0], edgecolor="w", lw=0.5)
    left.set(
        title="(a) displacements", xlabel="far-field displacement Δ [µm]", ylabel="number of rows"
    )
    area = rows["area_percent"]
    shown = right.scatter(rows["delta"], area, s=2, c=rows["hurst"], rasterized=True)
    limit = f"largest area of the paper, {AREA_MAX:g} %"
    right.axhline(AREA_MAX, color=COLOURS[1], ls="--", lw=2, label=limit)
    right.legend(loc="upper left", fontsize=9)
    right.set(
        title="(b) areas",
        xlabel="far-field displacement Δ [µm]",
        ylabel="effective contact area [%]",
    )
    figure.colorbar(shown, ax=right, label="Hurst exponent H")
    below = 100 * float((area <= AREA_MAX).mean())
    caption = (
        f"Section 3.2, the database ({rows.rows.size:,} rows; the paper has {PAPER_ROWS:,}): (a)"
        " more rows at small displacements, as in the paper; (b) areas at one displacement differ"
        f" with the surface, smooth ones have more. {below:.1f} % of ours lie below the paper's"
        f" largest area, the others reach {area.max():.1f} %: {deviations.AREAS.format(AREA_MAX)}."
    )
    picture = save(figure, folder / "database.png")
    return [Figure(picture, caption, data=(_rows(folder, rows),))]


def table_1(folder: Path, database: Path) -> list[Content]:
    """Tabulate the ranges of all parameters, and draw their distributions."""
    rows = read(database)
    columns = [column for column in COLUMNS if column.name in RANGES]
    table = write_table(
        folder / "table-1.csv",
        (
            "parameter",
            "unit",
            "ours_low",
            "ours_high",
            "paper_low",
            "paper_high",
            "ours_inside_percent",
            "deviation",
            "explanation",
        ),
        [_range(column, rows[column.name]) for column in columns],
    )
    picture = save(_histograms(rows), folder / "statistics.png")
    outside = [
        column.long_name for column in columns if _inside(column, rows[column.name]) < ENOUGH_INSIDE
    ]
    return [
        Table(
            table,
            "Table 1, ranges of the raw database, ours beside the paper's. Deviation: how far our"
            " ends lie above the paper's, in per cent of its range. More than one row in a hundred"
            f" lies outside in: {', '.join(outside) or 'none'}.",
        ),
        Figure(
            picture,
            "Table 1 as a picture: how the parameters of our database are distributed; between the"
            " dashed lines is the paper's range. They fill it, but for the bandwidths (logarithmic"
            " here), whose definition the paper leaves open, and the area, which goes on.",
            data=(table,),
        ),
    ]


def _inside(column: Column, values: Values) -> float:
    """Share of the rows inside the paper's range [%]."""
    low, high = RANGES[column.name]
    return 100 * float(((values >= low) & (values <= high)).mean())


def _range(column: Column, values: Values) -> tuple[str, ...]:
    """A row of Table 1."""
    low, high = RANGES[column.name]
    ends = float(values.min()), float(values.max())
    inside = _inside(column, values)
    apart = [deviations.shift(*pair, high - low) for pair in zip(ends, (low, high), strict=True)]
    numbers = (*map(short, ends), short(low), short(high), f"{inside:.1f}")
    long_name = column.long_name
    return (long_name, column.unit, *numbers, ", ".join(apart), _why(column.name))


def _why(name: str) -> str:
    if name in UNEXPLAINED:
        return deviations.BANDWIDTH
    if name == "area_percent":
        return deviations.AREAS.format(AREA_MAX)
    return "" if name in {"hurst", "delta"} else deviations.EXTREMES


def _histograms(rows: Rows) -> Any:
    """Every parameter of Table 1 with the paper's range."""
    columns = [column for column in COLUMNS if column.name in RANGES]
    figure = new_figure(11, 10.5)
    axes = figure.subplots(-(-len(columns) // 5), 5).ravel()
    statistics = {column.name for column in statistics_columns()}
    for axis, column in zip(axes, columns, strict=False):
        values, (low, high) = rows[column.name], RANGES[column.name]
        ends = min(low, values.min()), max(high, values.max())
        if column.name in UNEXPLAINED:
            bins = np.geomspace(*ends, 31)
            axis.set_xscale("log")
        else:
            bins = np.linspace(*ends, 31)
        colour = COLOURS[0] if column.name in statistics else COLOURS[2]
        axis.hist(values, bins, color=colour)
        for end in (low, high):
            axis.axvline(end, color=COLOURS[1], ls="--", lw=1.5)
        unit = {"1": "", "um": " [µm]", "um-1": " [1/µm]"}.get(column.unit, f" [{column.unit}]")
        name = column.name.replace("_percent", "").replace("_", " ")
        axis.set_title(name.replace(" curvature", "\ncurvature", 1) + unit, fontsize=9)
        axis.set_yticks([])
        axis.tick_params(labelsize=8)
    for axis in axes[len(columns) :]:
        axis.set_axis_off()
    return figure
