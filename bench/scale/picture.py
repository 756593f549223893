"""The simulated runs as a picture."""

from collections.abc import Sequence
from typing import Any

from bench.scale.studies import GOAL_RANKS, WANTED, Point


def draw(figure: Any, points: Sequence[Point]) -> None:
    """Efficiency over ranks above, how busy the master is below; a column for each grid."""
    grids = sorted({point.nodes for point in points})
    figure.set_size_inches(5 * len(grids), 7)
    figure.suptitle("Simulation of the farm, from measured costs")
    panels = figure.subplots(2, len(grids), squeeze=False, sharex=True, sharey="row")
    own = [point for point in points if not point.largest]
    for column, nodes in enumerate(grids):
        efficiency, busy = panels[:, column]
        here = [point for point in own if point.nodes == nodes]
        for number, rows in enumerate(sorted({point.rows for point in here})):
            for writer, style in (("single", "o-"), ("parallel", "s--")):
                mine = [p for p in here if p.rows == rows and p.writer == writer]
                ranks = [point.ranks for point in mine]
                label = f"{rows:.0e} rows, {writer} writer"
                look = {"color": f"C{number}", "markersize": 3, "label": label}
                efficiency.plot(ranks, [point.efficiency for point in mine], style, **look)
                busy.plot(ranks, [point.busy for point in mine], style, **look)
        efficiency.axhline(WANTED, color="0.7", linewidth=0.8)
        efficiency.axvline(GOAL_RANKS, color="0.7", linewidth=0.8)
        efficiency.set(xscale="log", title=f"{nodes} × {nodes} nodes")
        busy.set(xlabel="ranks")
    panels[0, 0].set_ylabel("efficiency of the workers")
    panels[1, 0].set_ylabel("share of time the master works")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
