"""`python -m bench peers`: the comparison, its tables and its pictures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import pandas as pd

from bench.page.content import Absent, Content
from bench.page.parts import contents_of
from bench.peers.compare import LOAD_ERROR, MISPLACED_SHARE, Row, compare
from bench.peers.loads import up_to_full_contact
from bench.peers.sample import samples
from bench.picture import STYLES, new_figure
from bench.report import Report, remark
from bench.solvers.others import OTHERS, installed, missing
from bench.solvers.own import BEM, PAPERS
from bench.solvers.solver import REFERENCE_RTOL
from bench.table import read_table
from gen.runtime.errors import InputError


def report(
    nodes: Sequence[int],
    deltas: Sequence[float],
    rounds: int,
    hardnesses: Sequence[float] = (),
) -> Report:
    """Compare all solvers that are installed at equal accuracy.

    The arguments are those of the command: nodes a side, displacements [um], turns, and hardnesses
    over E*. With hardnesses, those solvers that know one are compared on bodies that yield, elastic
    ones beside them, and pressed by loads up to full contact.

    Raises
    ------
    InputError
        If a grid, a displacement or a hardness cannot be used.
    """
    _check(nodes, deltas, hardnesses)
    for package, install in missing().items():
        remark(f"{package} is not installed and left out: {install}")
    solvers = [BEM, PAPERS, *installed()]
    if not hardnesses:
        rows = compare(samples(nodes, deltas), solvers, rounds)
        pictures = {"peers": draw(rows, LOADS)}
        return Report({"peers": rows}, pictures=pictures, text=tables(rows, LOADS))
    plastic = [solver for solver in solvers if solver.plastic]
    rows = compare(samples(nodes, deltas, hardnesses), plastic, rounds)
    pressed = [row for size in nodes for row in up_to_full_contact(size)]
    return Report(
        {"hardness": rows, "hardness-loads": pressed},
        pictures={"hardness": draw(rows, HARDNESSES)},
        text=tables(rows, HARDNESSES) + loads_table(pressed),
    )


def _check(nodes: Sequence[int], deltas: Sequence[float], hardnesses: Sequence[float]) -> None:
    for size in nodes:
        if size < 3 or (size - 1) & (size - 2):
            raise InputError(f"nodes {size}: give 2^k + 1, as 129, 257, 513")
    for name, values, wanted in (
        ("delta", deltas, "a displacement above 0 um"),
        ("hardness", hardnesses, "a share of E* above 0"),
    ):
        for value in values:
            if not 0 < value < float("inf"):
                raise InputError(f"{name} {value}: give {wanted}")


def contents(folder: Path) -> list[Content]:
    """List what a folder of this report holds, and the solvers that took no part."""
    shown = contents_of("peers", folder)
    solvers = {row["solver"] for row in read_table(folder / "peers.csv")[1]}
    there = {solver.package for solver in OTHERS if solver.name in solvers}
    absent = {solver.package: solver.install for solver in OTHERS if solver.package not in there}
    return [*shown, *(Absent(package, how) for package, how in absent.items())]


@dataclass(frozen=True)
class Layout:
    """How rows are shown: a table, and a column of the picture, for each title."""

    title: str  # format of the name by which rows belong together
    detail: str  # format of what a setting makes of a contact
    setting: Callable[[Row], float | str]  # returns the quantity that varies below a title
    axis: str  # label of that quantity's axis

    def parts(self, rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
        """Return the rows below each title."""
        titled = groupby(rows, lambda row: self.title.format(**row))
        return [(title, list(part)) for title, part in titled]


LOADS = Layout(
    title="{nodes} × {nodes} nodes, H = {hurst}",
    detail="{contact_nodes} nodes",
    setting=lambda row: row["delta_um"],
    axis="far-field displacement Δ [µm]",
)
HARDNESSES = Layout(
    title="{nodes} × {nodes} nodes, Δ = {delta_um:g} µm",
    detail="{contact_nodes} nodes, {yielded_nodes} yielded",
    setting=lambda row: "elastic" if row["hardness"] is None else f"{row['hardness']:g}",
    axis="hardness over E*",
)

CONDITIONS = f"""\
Each at its loosest tolerance with the force, or the displacement where it is given the force,
within {LOAD_ERROR:g} and the nodes in contact within {100 * MISPLACED_SHARE:g} % (or one) of a
reference of residual {REFERENCE_RTOL:g}. Set-up, once a grid, is not in the times; ASPHER's nested
grids are set up in each solve.
"""


def tables(rows: Sequence[Row], layout: Layout) -> str:
    """Return a table for each title, solvers down and settings across, and remarks on gaps."""
    texts = []
    for title, part in layout.parts(rows):
        cells: dict[str, Row] = {row["solver"]: {} for row in part}
        cells["fastest peer over ours"] = {"set-up": ""}
        for row in part:
            setting = f"{layout.setting(row)}: {layout.detail.format(**row)}"
            cells[row["solver"]].setdefault("set-up", _milliseconds(row["set_up_seconds"]))
            cells[row["solver"]][setting] = _cell(row)
            beside = [other for other in part if layout.setting(other) == layout.setting(row)]
            cells["fastest peer over ours"][setting] = _fastest_peer(beside)
        what = "CPU time in ms, over ours, convolutions where they are known"
        texts += [f"{title}: {what}", pd.DataFrame(cells).T.to_string(), ""]
        texts += [f"{r['solver']}, {layout.setting(r)}: {r['remark']}" for r in part if r["remark"]]
    return "\n".join([*texts, CONDITIONS])


def loads_table(rows: Sequence[Row]) -> str:
    """Return a table of the loads up to full contact."""
    table = pd.DataFrame(rows).to_string(index=False, na_rep="-", float_format="{:.4g}".format)
    return f"Pressed up to full contact\n{table}\n"


def draw(rows: Sequence[Row], layout: Layout) -> Any:
    """Draw time above, time over ours below; a column for each title."""
    parts = layout.parts(rows)
    figure = new_figure(2 + 4 * len(parts), 8)
    panels = figure.subplots(2, len(parts), squeeze=False, sharex="col")
    names = dict.fromkeys(row["solver"] for row in rows)
    for (times, ratios), (title, part) in zip(panels.T, parts, strict=True):
        for name, style in zip(names, STYLES, strict=False):
            known = [row for row in part if row["solver"] == name and row["times_ours"]]
            places = [layout.setting(row) for row in known]
            times.plot(places, [1e3 * row["seconds"] for row in known], label=name, **style)
            ratios.plot(places, [row["times_ours"] for row in known], label=name, **style)
        times.set(yscale="log", title=title)
        ratios.set(yscale="log", xlabel=layout.axis)
    panels[0, 0].set_ylabel("CPU time of a solve [ms]")
    panels[1, 0].set_ylabel("CPU time over ours")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _cell(row: Row) -> str:
    if not row["times_ours"]:
        return "-"
    convolutions = "" if row["convolutions"] is None else f"  {row['convolutions']}"
    return f"{_milliseconds(row['seconds'])}  {row['times_ours']:6.2f}{convolutions}"


def _fastest_peer(rows: Sequence[Row]) -> str:
    """Return the time over ours of the fastest solver that is not ours nor the paper's."""
    own = BEM.name, PAPERS.name
    peers = [row["times_ours"] for row in rows if row["solver"] not in own and row["times_ours"]]
    return f"{min(peers):.2f}" if peers else "-"


def _milliseconds(seconds: float) -> str:
    """Three digits of it, or all before the point."""
    return f"{1e3 * seconds:.0f}" if seconds >= 0.1 else f"{1e3 * seconds:.3g}"
