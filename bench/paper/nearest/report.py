"""`python -m bench nearest`: the search, and both tables of its result beside the paper's."""

import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.paper.facts import RANGES
from bench.paper.nearest import cases
from bench.paper.nearest.candidates import factors
from bench.paper.nearest.distance import QUANTITIES, of_table_1, of_table_4
from bench.paper.nearest.population import Rows
from bench.paper.nearest.search import Search
from bench.paper.unstated.readings import range_distance
from bench.picture import STYLES, new_figure
from bench.report import Report, remark
from gen.schema import COLUMNS
from learn.metrics import Scores, spread
from learn.models import MODELS


def report(folder: Path, rows: int, surfaces: int, minutes: float) -> Report:
    """Measure the shipped scene and what it costs to leave it; then search for some minutes."""
    scores, databases = cases.measure(folder, rows)
    search = Search(folder, rows, surfaces, time.monotonic() + 60 * minutes)
    best, settled = search.nearest(factors())
    remark(f"nearest{'' if settled else ' so far, the time is over'}: {best.texts()}")
    tables: Mapping[str, Iterable[Any]] = {
        "baselines": [_named(row) for row in scores[: len(MODELS)]],
        "costs": list(_costs(scores, databases)),
        "finalists": search.finalists(),
        "ranges": list(_ranges(databases[cases.CASES[0].database])),
    }
    return Report(tables, pictures={"nearest": _picture(scores)})


def _named(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a model's scores beside the paper's, under its title."""
    return {"model": MODELS[row["model"]].title} | {
        f"{end}{name}": round(float(row[f"{end}{name}"]), 2)
        for name in cases.ERRORS
        for end in ("", "paper_")
    }


def _costs(
    scores: Sequence[Mapping[str, Any]], databases: Mapping[str, Rows]
) -> Iterable[dict[str, Any]]:
    """Yield areas, distances from both tables and nMSE of all models, of each case."""
    for case in cases.CASES:
        own = [
            row for row in scores if (row["database"], row["split"]) == (case.database, case.split)
        ]
        found = {row["model"]: Scores(*(float(row[name]) for name in cases.ERRORS)) for row in own}
        rows = databases[case.database]
        yield {
            "database": case.database,
            "split": case.split,
            "rows": rows.target.size,
            "area_mean": float(rows.target.mean()),
            "area_deviation": float(rows.target.std()),
            "spread": spread(rows.target),
            "table_1": of_table_1(rows.columns),
            "table_4": of_table_4(found),
            **{f"{model}_nmse": found[model].nmse for model in MODELS},
        }


def _ranges(rows: Rows) -> Iterable[dict[str, Any]]:
    """Yield the range of each quantity of Table 1 beside the paper's."""
    names = {column.name: (column.long_name, column.unit) for column in COLUMNS}
    for name, (low, high) in RANGES.items():
        values = rows.columns[name]
        quantity, unit = names[name]
        yield {
            "quantity": quantity,
            "unit": unit,
            "low": float(f"{np.nanmin(values):.3g}"),
            "high": float(f"{np.nanmax(values):.3g}"),
            "paper_low": low,
            "paper_high": high,
            "distance": round(range_distance(values, name), 1),
            "counts": "yes" if name in QUANTITIES else "no",
        }


def _picture(scores: Sequence[Mapping[str, Any]]) -> Any:
    """Draw nMSE of the models in all cases, and the paper's."""
    figure = new_figure(9, 4.4)
    axis = figure.subplots()
    titles = [model.title for model in MODELS.values()]
    drawn = {"the paper": [float(row["paper_nmse"]) for row in scores[: len(MODELS)]]}
    for number, case in enumerate(cases.CASES):
        own = scores[number * len(MODELS) : (number + 1) * len(MODELS)]
        drawn[f"{case.database}, split by {case.split}"] = [float(row["nmse"]) for row in own]
    for style, (label, values) in zip(STYLES, drawn.items(), strict=False):
        axis.plot(titles, values, **style, linestyle="none", label=label)
    axis.set(yscale="log", ylabel="nMSE of baselines [%]")
    axis.tick_params(axis="x", rotation=25)
    axis.grid(visible=True, axis="y", color="0.92")
    axis.legend(fontsize=8)
    return figure
