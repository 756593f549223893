"""`python -m bench unstated`: its tables, its picture, and words on what to see in them."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.page.content import Content, Figure, Table
from bench.paper.unstated import early_stop, effects, readings
from bench.picture import new_figure
from bench.remarks import remark
from bench.report import Report
from bench.style import STYLES
from gen.scene import load

SURFACES = 200
"""Surfaces that readings of Table 1 are tried on."""

LIMITED = 8
"""Surfaces that are pressed to shares of their limits."""

SHARES = (0.5, 0.8, 0.9, 0.95, 0.98, 1.0, 1.05)
"""Displacements over Delta*."""

PANELS: Mapping[str, Mapping[str, str | None]] = {
    "times the preset's": {"area_times": "mean area", "force_times": "mean force"},
    "R2 [%]": {"r2": "kernel ridge", "tree_r2": "decision tree"},
    "off Table 1's ranges\n[% of their widths]": {"table_1": None},
}
"""Columns of each panel, with their names."""

TICKS = (0.5, 1.0, 2.0, 5.0)
"""Of areas and forces over the preset's."""


def report(folder: Path, rows: int) -> Report:
    """Try the readings, stop iterations early, and measure the effect of every choice.

    The databases, of so many rows each, go to the folder's own folder `databases`.
    """
    remark("readings of Table 1")
    ranges = list(readings.compare(load("paper"), SURFACES))
    remark("iterations that stop early")
    stopped = list(early_stop.compare(load("paper-mirco"), LIMITED, SHARES))
    rows_of_choices = list(effects.measure(folder / "databases", rows))
    tables: Mapping[str, Iterable[Any]] = {
        "readings": ranges,
        "early-stop": stopped,
        "unstated": rows_of_choices,
    }
    return Report(tables, pictures={"unstated": _picture(rows_of_choices)})


def contents(folder: Path) -> Sequence[Content]:
    """List what a folder of this report holds, with what to see in it."""
    return [
        Figure(
            folder / "unstated.png",
            "What the paper does not say, and what it does to the result: one choice at a time"
            " against the preset (first line). Left, mean area and force over the preset's, on rows"
            " that both have solved; middle, R2 of kernel ridge and of decision trees on the test"
            " rows, as many training rows for all; right, how far the ranges of the 22 statistics"
            " are from Table 1's. The second line is another seed, other surfaces and loads:"
            " choices that change surfaces or loads, and R2, have to move more than that to mean"
            " anything. Influence coefficients, far field and spacing are compared on the same"
            " surfaces.",
            data=(folder / "unstated.csv",),
        ),
        Table(
            folder / "unstated.csv",
            "The same as numbers [%], times for areas and forces. Spread is the variance of the"
            " test areas over their mean, to which nMSE is proportional at equal R2.",
            columns=(
                "choice", "ours", "other", "done", "area_mean", "area_times", "force_times",
                "area_largest", "kept", "table_1", "nmse", "nmae", "r2", "tree_r2", "spread",
            ),
        ),
        Table(
            folder / "readings.csv",
            f"Readings of Table 1 that its names allow, on {SURFACES} surfaces: ranges beside the"
            " paper's; distance is that of the ends, in per cent of the paper's width.",
        ),
        Table(
            folder / "early-stop.csv",
            "A far field that gives way, iterated as MIRCO does until the force changes by less"
            " than 1 %, at shares of the displacement Delta* beyond which there is no equilibrium:"
            " how many iterations stop, after how many solves, and how much too low [%] area and"
            " force are where they do. From 1 on, what stops reports an answer that does not"
            " exist.",
        ),
    ]  # fmt: skip


def _picture(rows: Sequence[dict[str, Any]]) -> Any:
    """Draw dots over the choices: areas and forces, scores, and the distance from Table 1."""
    figure = new_figure(12, 0.9 + 0.36 * len(rows))
    labels = [f"{row['choice']}: {row['other']}".removesuffix(": ") for row in rows]
    places = range(len(rows))[::-1]
    panels = figure.subplots(1, 3, sharey=True, width_ratios=(3, 2, 2))
    for panel, (label, columns) in zip(panels, PANELS.items(), strict=True):
        for style, (column, name) in zip(STYLES, columns.items(), strict=False):
            values = [row[column] for row in rows]
            panel.plot(values, places, **style, linestyle="none", label=name)
            panel.axvline(values[0], color="0.7", lw=1, zorder=0)
        panel.set(xlabel=label)
        panel.grid(visible=True, axis="y", color="0.92")
    panels[0].set_yticks(places, labels)
    panels[0].set(xscale="log")
    panels[0].minorticks_off()
    panels[0].set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
    for panel in panels[:2]:
        panel.legend()
    return figure
