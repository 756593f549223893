"""The comparison as a picture."""

from collections.abc import Sequence
from typing import Any

from bench.peers.compare import Row
from bench.peers.table import grouped
from bench.style import STYLES


def draw(figure: Any, rows: Sequence[Row]) -> None:
    """Time over the displacement above, over our time below; a column for each grid."""
    groups = grouped(rows)
    figure.set_size_inches(2 + 4 * len(groups), 8)
    panels = figure.subplots(2, len(groups), squeeze=False, sharex="col")
    names = list(dict.fromkeys(row.solver for row in rows))
    for column, ((nodes, hurst), group) in enumerate(groups.items()):
        times, ratios = panels[:, column]
        for number, name in enumerate(names):
            known = [r for r in group if r.solver == name and r.seconds and r.times_ours]
            style = {**STYLES[number], "label": name}
            deltas = [row.delta for row in known]
            times.plot(deltas, [1e3 * (row.seconds or 0) for row in known], **style)
            ratios.plot(deltas, [row.times_ours for row in known], **style)
        times.set(yscale="log", title=f"{nodes} × {nodes} nodes, H = {hurst}")
        ratios.set(yscale="log", xlabel="far-field displacement Δ [µm]")
    panels[0, 0].set_ylabel("CPU time of a solve [ms]")
    panels[1, 0].set_ylabel("CPU time over ours")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
