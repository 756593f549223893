"""What other programs have measured, as tables: times of pytest-benchmark, errors of nine models.

Times of single steps are read from pytest-benchmark's JSON file. Errors of the models, and the
times that predictions, fits and searches take, are read from a folder of `learn compare` and `learn
tune`, whose fits were timed alone, on one thread.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bench.files import Row, read_table
from bench.report import Report
from gen.runtime.errors import InputError

SUITES = Path(__file__).with_name("suites")
SIZES = ("smoke", "paper", "large")


def benchmarks(only: str) -> Report:
    """Run the benchmarks, all or those with a word in their names, and return their times."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "times.json"
        command = [sys.executable, "-m", "pytest", str(SUITES), "--benchmark-only", "-q"]
        command += ["-k", only] if only else []
        code = subprocess.run(
            [*command, f"--benchmark-json={path}"], check=False
        ).returncode
        if code:
            raise InputError(f"pytest {SUITES} ended with code {code}")
        found = json.loads(path.read_text(encoding="utf-8"))["benchmarks"]
    return Report({"times": [_row(each) for each in found]})


def _row(benchmark: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a benchmark by the names of their columns."""
    case, size = _case(benchmark["name"], benchmark.get("params") or {})
    stats, extra = benchmark["stats"], dict(benchmark["extra_info"])
    row = {
        "suite": Path(benchmark["fullname"].partition("::")[0]).stem.removeprefix(
            "test_"
        ),
        "case": case,
        "size": size,
        "median_ms": 1e3 * stats["median"],
        "spread_ms": 1e3 * stats["iqr"],
        "rounds": stats["rounds"],
        "convolutions": extra.pop("convolutions", ""),
        "residual": extra.pop("residual", ""),
    }
    more = [
        f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in extra.items()
    ]
    return {**row, "more": "; ".join(more)}


def _case(name: str, params: dict[str, Any]) -> tuple[str, str]:
    """Case and size of `test_solve_at_contact[50-large]`; values may hold hyphens themselves."""
    function, _, inside = name.rstrip("]").partition("[")
    size = str(
        params.get("size") or next((s for s in SIZES if s in inside.split("-")), "")
    )
    if inside.startswith(f"{size}-"):
        inside = inside.removeprefix(f"{size}-")
    elif size:
        inside = inside.removesuffix(size).removesuffix("-")
    case = function.removeprefix("test_").replace("_", " ")
    return f"{case}: {inside}" if inside else case, size


TIMES = "predict_s", "fit_s", "search_s"
"""Kinds of run time; None where there is none."""


def models(comparison: Path) -> list[Row]:
    """Read errors and times of all models that a comparison has results of, in Table 4's order.

    A row has a model with its result (`baseline` or `tuned`), and the kinds of time in which no
    other beats it in both error and time (`front`).

    An InputError is raised if the folder has no scores and times.
    """
    try:
        scores, times, searches = (
            read_table(comparison / "area" / name)[1]
            for name in ("scores.csv", "times.csv", "tuning-times.csv")
        )
    except InputError as error:
        raise InputError(
            f"{error}; give a folder of learn compare or learn tune"
        ) from None
    timed = {(row["model"], row["result"]): row for row in times}
    searched = {(row["model"], "tuned"): float(row["fit_seconds"]) for row in searches}
    found: list[Row] = []
    for row in scores:
        key = row["model"], row["result"]
        if key in timed and not row["failure"]:
            errors = {name: float(row[name]) for name in ("nmae", "r2")}
            answer, fit = (float(timed[key][name]) for name in ("predict_row_s", "fit_s"))
            spent = {"predict_s": answer, "fit_s": fit, "search_s": searched.get(key)}
            found.append({"model": key[0], "result": key[1], **errors, **spent})
    if not found:
        raise InputError(
            f"{comparison}: has no scores and times of area; run learn compare"
        )
    for time in TIMES:
        for cost in front(found, time):
            cost["front"] = f"{cost.get('front', '')} {time.removesuffix('_s')}".strip()
    return [{**cost, "front": cost.get("front", "")} for cost in found]


def front(costs: Iterable[Row], time: str) -> list[Row]:
    """Return those that no other beats in both error and a time, the fastest first."""
    kept: list[Row] = []
    known = (cost for cost in costs if cost[time] is not None)
    for cost in sorted(known, key=lambda cost: (cost[time], cost["nmae"])):
        if not kept or cost["nmae"] < kept[-1]["nmae"]:
            kept.append(cost)
    return kept
