"""Rows of the comparison as tables and pictures, by what varies among them."""

import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from bench.peers.accuracy import LOAD_ERROR, MISPLACED_SHARE
from bench.peers.compare import Row
from bench.peers.loads import Pressed
from bench.picture import new_figure
from bench.solvers.own import BEM, PAPERS
from bench.solvers.solver import REFERENCE_RTOL
from bench.style import STYLES


@dataclass(frozen=True)
class Layout:
    """How rows are shown: a table, and a column of the picture, for each group of them.

    Attributes
    ----------
    group : callable
        Returns the key by which rows belong together.
    title : callable
        Returns the name of a row's group.
    setting, detail : callable
        Return the quantity that varies within a group, and what it makes of the contact.
    axis : str
        Label of that quantity's axis.
    """

    group: Callable[[Row], tuple[float, ...]]
    title: Callable[[Row], str]
    setting: Callable[[Row], float | str]
    detail: Callable[[Row], str]
    axis: str


LOADS = Layout(
    group=lambda row: (row.nodes, row.hurst),
    title=lambda row: f"{row.nodes} × {row.nodes} nodes, H = {row.hurst}",
    setting=lambda row: row.delta,
    detail=lambda row: f"{row.contact_nodes} nodes",
    axis="far-field displacement Δ [µm]",
)
HARDNESSES = Layout(
    group=lambda row: (row.nodes, row.delta),
    title=lambda row: f"{row.nodes} × {row.nodes} nodes, Δ = {row.delta:g} µm",
    setting=lambda row: "elastic" if row.hardness is None else f"{row.hardness:g}",
    detail=lambda row: f"{row.contact_nodes} nodes, {row.yielded_nodes} yielded",
    axis="hardness over E*",
)

_CONDITIONS = f"""\
Each at its loosest tolerance with the force, or the displacement where it is given the force,
within {LOAD_ERROR:g} and the nodes in contact within {100 * MISPLACED_SHARE:g} % (or one) of a
reference of residual {REFERENCE_RTOL:g}. Set-up, once a grid, is not in the times; ASPHER's nested
grids are set up in each solve.
"""


def tables(rows: Sequence[Row], layout: Layout) -> str:
    """Return a table for each group: time, and time over ours."""
    text = io.StringIO()
    console = Console(file=text, width=200)
    for group in _grouped(rows, layout).values():
        console.print(_table(group, layout))
        for row in group:
            if row.remark:
                text.write(f"{row.solver}, {layout.setting(row)}: {row.remark}\n")
    text.write(_CONDITIONS)
    return text.getvalue()


def loads_table(rows: Sequence[Pressed]) -> str:
    """Return a table of the loads up to full contact."""
    text = io.StringIO()
    table = Table(
        *("nodes", "p / E*", "H / E*", "area %", "yielded %", "ours: convolutions", "residual"),
        *("theirs: converged", "convolutions", "difference / H"),
        title="Pressed up to full contact",
        title_justify="left",
        box=box.SIMPLE_HEAD,
    )
    for row in rows:
        difference = row.pressure_difference
        table.add_row(
            *(f"{each:g}" for each in (row.nodes, row.mean_pressure, row.hardness)),
            *(f"{each:.2f}" for each in (row.area_percent, row.yielded_percent)),
            f"{row.convolutions} {'' if row.converged else 'not converged'}",
            f"{row.residual:.1e}",
            row.theirs,
            "-" if row.their_convolutions is None else str(row.their_convolutions),
            "-" if difference is None else f"{difference:.1e}",
        )
    Console(file=text, width=200).print(table)
    return text.getvalue()


def draw(rows: Sequence[Row], layout: Layout) -> Any:
    """Draw time above, time over ours below; a column for each group."""
    groups = _grouped(rows, layout)
    figure = new_figure(2 + 4 * len(groups), 8)
    panels = figure.subplots(2, len(groups), squeeze=False, sharex="col")
    names = list(dict.fromkeys(row.solver for row in rows))
    for column, group in enumerate(groups.values()):
        times, ratios = panels[:, column]
        for number, name in enumerate(names):
            known = [r for r in group if r.solver == name and r.seconds and r.times_ours]
            style = {**STYLES[number], "label": name}
            places = [layout.setting(row) for row in known]
            times.plot(places, [1e3 * (row.seconds or 0) for row in known], **style)
            ratios.plot(places, [row.times_ours for row in known], **style)
        times.set(yscale="log", title=layout.title(group[0]))
        ratios.set(yscale="log", xlabel=layout.axis)
    panels[0, 0].set_ylabel("CPU time of a solve [ms]")
    panels[1, 0].set_ylabel("CPU time over ours")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _grouped(rows: Iterable[Row], layout: Layout) -> dict[tuple[float, ...], list[Row]]:
    """Return the rows of each group."""
    groups: dict[tuple[float, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(layout.group(row), []).append(row)
    return groups


def _table(rows: Sequence[Row], layout: Layout) -> Table:
    """Solvers down, settings across."""
    title = f"{layout.title(rows[0])}: CPU time in ms, over ours, convolutions where they are known"
    table = Table("", "set-up", title=title, title_justify="left", box=box.SIMPLE_HEAD)
    columns = {layout.setting(row): row for row in rows}
    for setting, row in columns.items():
        table.add_column(f"{setting}\n{layout.detail(row)}", justify="right")
    for solver in dict.fromkeys(row.solver for row in rows):
        mine = {layout.setting(row): row for row in rows if row.solver == solver}
        set_up = _milliseconds(next(iter(mine.values())).set_up_seconds)
        table.add_row(solver, set_up, *(_cell(mine[setting]) for setting in columns))
    table.add_section()
    fastest = [
        _fastest_peer([row for row in rows if layout.setting(row) == setting])
        for setting in columns
    ]
    table.add_row("fastest peer over ours", "", *fastest)
    return table


def _cell(row: Row) -> str:
    if row.seconds is None or row.times_ours is None:
        return "-"
    convolutions = "" if row.convolutions is None else f"  {row.convolutions}"
    return f"{_milliseconds(row.seconds)}  {row.times_ours:6.2f}{convolutions}"


def _fastest_peer(rows: Iterable[Row]) -> str:
    """Return the time over ours of the fastest solver that is not ours nor the paper's."""
    own = {solver.name for solver in (BEM, PAPERS)}
    peers = [row.times_ours for row in rows if row.solver not in own and row.times_ours]
    return f"{min(peers):.2f}" if peers else "-"


def _milliseconds(seconds: float) -> str:
    """Three digits of it, or all before the point."""
    return f"{1e3 * seconds:.0f}" if seconds >= 0.1 else f"{1e3 * seconds:.3g}"
