"""The comparison as tables for people."""

import io
from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from bench.peers.accuracy import LOAD_ERROR, MISPLACED_SHARE
from bench.peers.compare import Row
from bench.peers.own import Ours, PapersAlgorithm
from bench.peers.peer import REFERENCE_RTOL

OWN = (Ours().name, PapersAlgorithm().name)

_CONDITIONS = f"""\
Each at its loosest tolerance with the force, or the displacement where it is given the force,
within {LOAD_ERROR:g} and the nodes in contact within {100 * MISPLACED_SHARE:g} % (or one) of a
reference of residual {REFERENCE_RTOL:g}. Set-up, once a grid, is not in the times; ASPHER's nested
grids are set up in each solve.
"""


def grouped(rows: Iterable[Row]) -> dict[tuple[int, float], list[Row]]:
    """The rows of each grid and Hurst exponent."""
    groups: dict[tuple[int, float], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.nodes, row.hurst), []).append(row)
    return groups


def tables(rows: Sequence[Row]) -> str:
    """A table for each grid and Hurst exponent: time, and time over ours."""
    text = io.StringIO()
    console = Console(file=text, width=200)
    for group in grouped(rows).values():
        console.print(_table(group))
        for row in group:
            if row.remark:
                text.write(f"{row.solver}, Delta = {row.delta:g}: {row.remark}\n")
    text.write(_CONDITIONS)
    return text.getvalue()


def _table(rows: Sequence[Row]) -> Table:
    """Solvers down, displacements across."""
    deltas = sorted({row.delta for row in rows})
    nodes, hurst = rows[0].nodes, rows[0].hurst
    title = f"{nodes} x {nodes} nodes, H = {hurst}: CPU time in ms, and over ours"
    table = Table("", "set-up", title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for delta in deltas:
        touching = next(row.contact_nodes for row in rows if row.delta == delta)
        table.add_column(f"Delta = {delta:g}\n{touching} nodes", justify="right")
    for solver in dict.fromkeys(row.solver for row in rows):
        mine = {row.delta: row for row in rows if row.solver == solver}
        set_up = _milliseconds(mine[deltas[0]].set_up_seconds)
        table.add_row(solver, set_up, *(_cell(mine[delta]) for delta in deltas))
    table.add_section()
    fastest = [_fastest_peer([row for row in rows if row.delta == delta]) for delta in deltas]
    table.add_row("fastest peer over ours", "", *fastest)
    return table


def _cell(row: Row) -> str:
    if row.seconds is None or row.times_ours is None:
        return "-"
    return f"{_milliseconds(row.seconds)}  {row.times_ours:6.2f}"


def _fastest_peer(rows: Iterable[Row]) -> str:
    """How often our time fits into that of the fastest solver that is not ours nor the paper's."""
    peers = [row.times_ours for row in rows if row.solver not in OWN and row.times_ours]
    return f"{min(peers):.2f}" if peers else "-"


def _milliseconds(seconds: float) -> str:
    """Three digits of it, or all before the point."""
    return f"{1e3 * seconds:.0f}" if seconds >= 0.1 else f"{1e3 * seconds:.3g}"
