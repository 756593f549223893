"""`python -m bench unstated`: its tables, its picture, and words on what to see in them."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.paper.unstated import early_stop, effects, readings
from bench.picture import STYLES, new_figure
from bench.report import Report, remark
from gen.scene import load

SURFACES = 200  # surfaces that readings of Table 1 are tried on
LIMITED = 8  # surfaces that are pressed to shares of their limits
SHARES = (0.5, 0.8, 0.9, 0.95, 0.98, 1.0, 1.05)  # displacements over Delta*

PANELS: Mapping[str, Mapping[str, str | None]] = {
    "times the preset's": {"area_times": "mean area", "force_times": "mean force"},
    "R2 [%]": {"r2": "kernel ridge", "tree_r2": "decision tree"},
    "off Table 1's ranges\n[% of their widths]": {"table_1": None},
}
"""Columns of each panel, with their names."""

TICKS = (0.5, 1.0, 2.0, 5.0)  # of areas and forces over the preset's


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
