"""`python -m bench solver`: the table, work-precision diagrams, how and where they were made.

Diagrams have the error on x and the cost on y, both logarithmic, and a curve for each solver.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import pandas as pd

from bench.circumstances import circumstances
from bench.picture import STYLES, new_figure
from bench.report import Report, remark
from bench.work_precision.measurement import AREA_GATE, FORCE_GATE, PRESSURE_GATE, Row
from bench.work_precision.studies import FULL, QUICK, sweep
from gen.runtime.figure import log_axis

TITLES = {
    "tolerance": "Tolerance: 1e-1 (right) to 1e-12 (left), both kernels",
    "grid": "Grid: both kernels, nodes a side as labelled, against the default's finest grid",
    "peers": "Other solvers at tolerances of their own; no error in a force that was given",
    "hardness": "Bodies that yield, hardness over E* as named; others at tolerances of their own",
}

CURVES = {
    "tolerance": "{kernel}",
    "grid": "{kernel}",
    "peers": "{solver}",
    "hardness": "{solver}, {hardness:g}",
}
"""The column that tells the curves of a study apart."""

ERRORS = {
    "force_error": "relative error of the force [1]",
    "area_error_percent": "error of the area [% of the exact area]",
    "pressure_error": "relative error of the pressure, L2 [1]",
}
COSTS = {"seconds": "wall time a solve [s]", "convolutions": "applications of H"}


def draw(rows: Sequence[Row]) -> Any:
    """Draw a row of diagrams for each study and cost, over three kinds of error."""
    drawn = {study: means(study, rows) for study in TITLES if study in {r["study"] for r in rows}}
    costs = {study: _compared_costs(table) for study, table in drawn.items()}
    heights = [1.4 + 2.0 * len(names) for names in costs.values()]
    figure = new_figure(11, sum(heights))
    parts = figure.subfigures(len(drawn), 1, squeeze=False, height_ratios=heights)[:, 0]
    for letter, part, study in zip("abcdef", parts, drawn, strict=False):
        part.suptitle(f"({letter}) {TITLES[study]}", x=0.01, ha="left", fontweight="bold")
        _draw_study(part, study, drawn[study], costs[study])
    return figure


def means(study: str, rows: Sequence[Row]) -> Any:
    """Average a study's errors and costs over its cases on a grid.

    A setting at which a case is missing has no mean: it would be that of other cases. Nor has the
    grid that is its own reference, whose error is none of the grid's.

    Returns
    -------
    DataFrame
        Means, not a number where one is not known, by the names of `ERRORS` and `COSTS`. The index
        is the name of the curve, and the setting: nodes a side, or the tolerance.
    """
    named = [row | {"curve": CURVES[study].format(**row)} for row in rows if row["study"] == study]
    table = pd.DataFrame(named).astype(dict.fromkeys((*ERRORS, *COSTS), float))
    if study == "grid":
        table = table[table["nodes"] != table["reference_nodes"]]
    setting = ["curve", "nodes" if study == "grid" else "rtol"]
    there, wanted = (
        table.groupby(by, dropna=False)["case"].transform("nunique")
        for by in (setting, ["nodes", "hardness"])
    )
    groups = table[there == wanted].groupby(setting, sort=False)
    return groups[[*ERRORS, *COSTS]].agg(lambda values: values.mean(skipna=False))


def _compared_costs(table: Any) -> list[str]:
    """Return the costs by which curves can be told apart: those that two or more of them know."""
    known = table.groupby(level="curve").count().gt(0)
    return [cost for cost in COSTS if known[cost].sum() >= min(len(known), 2)]


def _draw_study(part: Any, study: str, table: Any, costs: Sequence[str]) -> None:
    panels = part.subplots(len(costs), len(ERRORS), sharex="col", sharey="row", squeeze=False)
    curves = list(table.groupby(level="curve", sort=False))
    for (row, cost), (column, error) in itertools.product(enumerate(costs), enumerate(ERRORS)):
        panel = panels[row, column]
        for style, (name, curve) in zip(itertools.cycle(STYLES), curves, strict=False):
            known = curve[[error, cost]].dropna()
            panel.plot(known[error], known[cost], label=name, markersize=4, **style)
            if study == "grid":
                for (_, nodes), *place in known.itertuples():
                    panel.annotate(
                        str(nodes), place, (5, 3), textcoords="offset points", fontsize=7
                    )
        panel.margins(x=0.1, y=0.12)
        panel.grid(visible=True, which="major", color="0.9")
    for column, (error, label) in zip(panels.T, ERRORS.items(), strict=True):
        _scale(column[0].xaxis, table[[error, costs[0]]].dropna()[error])
        column[-1].set_xlabel(label)
    for row, cost in zip(panels, costs, strict=True):
        _scale(row[0].yaxis, table[["pressure_error", cost]].dropna()[cost])
        row[0].set_ylabel(COSTS[cost])
    part.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _scale(axis: Any, values: Any) -> None:
    """Make an axis logarithmic, with a place for 0 if needed."""
    positive = values[values > 0]
    if positive.empty:
        return
    if len(positive) < len(values):
        floor = 10.0 ** math.floor(math.log10(positive.min()))
        # Errors stand on x: only they can be 0.
        axis.axes.set_xscale("symlog", linthresh=floor, linscale=0.5)
        axis.axes.set_xlim(-0.4 * floor, 2 * positive.max())
        return
    log_axis(axis)


def solver(*, quick: bool) -> Report:
    """Measure all studies, on small grids if that is to be `quick`."""
    extent = QUICK if quick else FULL
    rows = list(sweep(extent))
    points = [row for row in rows if "reason" not in row]
    left_out = [row for row in rows if "reason" in row]
    for row in left_out:
        remark(f"{row['study']}: left out {row['solver']}: {row['reason']}")
    record = {
        **circumstances(),
        "extent": asdict(extent),
        "gates": {"force": FORCE_GATE, "pressure": PRESSURE_GATE, "contact_nodes": AREA_GATE},
        "left_out": left_out,
    }
    return Report({"solver": points}, records={"solver": record}, pictures={"solver": draw(points)})
