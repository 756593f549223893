"""`python -m bench peers`: the comparison as tables, a picture, and words on what to see in it."""

import io
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from bench.page import content
from bench.peers.accuracy import LOAD_ERROR, MISPLACED_SHARE
from bench.peers.compare import Row, compare
from bench.peers.sample import samples
from bench.picture import new_figure
from bench.report import Report
from bench.solvers.others import OTHERS, installed, missing
from bench.solvers.own import BEM, PAPERS
from bench.solvers.solver import REFERENCE_RTOL
from bench.style import STYLES
from bench.table import read_table
from gen.runtime.errors import InputError

OWN = (BEM, PAPERS)

_CONDITIONS = f"""\
Each at its loosest tolerance with the force, or the displacement where it is given the force,
within {LOAD_ERROR:g} and the nodes in contact within {100 * MISPLACED_SHARE:g} % (or one) of a
reference of residual {REFERENCE_RTOL:g}. Set-up, once a grid, is not in the times; ASPHER's nested
grids are set up in each solve.
"""


def report(
    nodes: Sequence[int],
    deltas: Sequence[float],
    rounds: int,
    announce: Callable[[str], None] = lambda line: None,
) -> Report:
    """Compare all solvers that are installed at equal accuracy.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side of the grids.
    deltas : sequence of float
        Displacements of the far field [um].
    rounds : int
        Turns in which each solver is timed.
    announce : callable
        Told what is missing, and what is being solved.

    Raises
    ------
    InputError
        If a grid or a displacement cannot be used.
    """
    for size in nodes:
        if size < 3 or (size - 1) & (size - 2):
            raise InputError(f"nodes {size}: give 2^k + 1, as 129, 257, 513")
    for delta in deltas:
        if not 0 < delta < float("inf"):
            raise InputError(f"delta {delta}: give a displacement above 0 um")
    for package, install in missing().items():
        announce(f"{package} is not installed and left out: {install}")
    rows = compare(samples(nodes, deltas), [*OWN, *installed()], rounds, announce)
    return Report({"peers": rows}, pictures={"peers": draw(rows)}, text=tables(rows))


def contents(folder: Path) -> list[content.Content]:
    """List what a folder of this report holds, with what to see in it."""
    table = folder / "peers.csv"
    solvers = {row["solver"] for row in read_table(table)[1]}
    there = {solver.package for solver in OTHERS if solver.name in solvers}
    absent = {solver.package: solver.install for solver in OTHERS if solver.package not in there}
    return [
        content.Figure(
            folder / "peers.png",
            "Processor time of a solve against the displacement, each solver at its loosest"
            " tolerance with the force within 1e-6 and the contact set within 0.05 %; below, over"
            " ours (1 is as fast). The paper's algorithm, non-negative least squares with a dense"
            " matrix, has its best where few nodes touch; its time grows with their cube.",
            data=(table,),
        ),
        content.Table(
            table,
            "The same as numbers.",
            columns=(
                "nodes", "hurst", "delta_um", "contact_nodes", "solver", "tolerance", "seconds",
                "times_ours", "load_error", "misplaced_nodes", "remark",
            ),
        ),
        *(content.Absent(package, how) for package, how in absent.items()),
    ]  # fmt: skip


def tables(rows: Sequence[Row]) -> str:
    """Return a table for each grid and Hurst exponent: time, and time over ours."""
    text = io.StringIO()
    console = Console(file=text, width=200)
    for group in _grouped(rows).values():
        console.print(_table(group))
        for row in group:
            if row.remark:
                text.write(f"{row.solver}, Delta = {row.delta:g}: {row.remark}\n")
    text.write(_CONDITIONS)
    return text.getvalue()


def draw(rows: Sequence[Row]) -> Any:
    """Draw time over the displacement above, over our time below; a column for each grid."""
    groups = _grouped(rows)
    figure = new_figure(2 + 4 * len(groups), 8)
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
    return figure


def _grouped(rows: Iterable[Row]) -> dict[tuple[int, float], list[Row]]:
    """Return the rows of each grid and Hurst exponent."""
    groups: dict[tuple[int, float], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.nodes, row.hurst), []).append(row)
    return groups


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
    """Return the time over ours of the fastest solver that is not ours nor the paper's."""
    own = {solver.name for solver in OWN}
    peers = [row.times_ours for row in rows if row.solver not in own and row.times_ours]
    return f"{min(peers):.2f}" if peers else "-"


def _milliseconds(seconds: float) -> str:
    """Three digits of it, or all before the point."""
    return f"{1e3 * seconds:.0f}" if seconds >= 0.1 else f"{1e3 * seconds:.3g}"
