"""Tables of measurements by other programs: times of pytest-benchmark, and errors of nine models.

`benchmarks` runs pytest-benchmark, which times single steps, and reads its JSON file. `models`
reads the errors of the models, and the times of their predictions, fits and searches, from a folder
of `learn compare` and `learn tune`. These run one fit at a time, on one thread.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.files import Row, read_table
from bench.report import Report
from gen.runtime.errors import InputError

SUITES = Path(__file__).with_name("suites")
"""Folder of the files with benchmarks."""

SIZES = ("smoke", "paper", "large")
"""Values of the parameter of benchmarks that is called size."""

TIMES = ("predict_s", "fit_s", "search_s")
"""Columns with the run times of models [s]."""


def benchmarks(only: str) -> Report:
    """Run the benchmarks by pytest, which prints its progress on standard output.

    Parameters
    ----------
    only : str
        Expression that selects benchmarks by their names, as pytest's -k; empty for all.

    Returns
    -------
    Report
        Table `times`, with a row for each benchmark; its times are in ms.

    Raises
    ------
    InputError
        If pytest fails, or no benchmark is selected.
    """
    command = [sys.executable, "-m", "pytest", str(SUITES), "--benchmark-only", "-q"]
    if only:
        command += ["-k", only]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "times.json"
        done = subprocess.run([*command, f"--benchmark-json={path}"], check=False)
        if done.returncode:
            raise InputError(f"pytest {SUITES} ended with code {done.returncode}")
        content = json.loads(path.read_text(encoding="utf-8"))
    return Report({"times": [_row(benchmark) for benchmark in content["benchmarks"]]})


def _row(benchmark: dict[str, Any]) -> Row:
    """Return the row of a benchmark from its entry in the file of pytest-benchmark.

    Times are in ms. The spread is the interquartile range. Columns `convolutions` and `residual`
    are "" if the benchmark records none. Its other numbers are a text in column `more`.
    """
    case = _case(benchmark["name"], benchmark.get("params") or {})
    stats = benchmark["stats"]
    extra = dict(benchmark["extra_info"])
    file = Path(benchmark["fullname"].partition("::")[0])
    return {
        "suite": file.stem.removeprefix("test_"),
        "case": case.name,
        "size": case.size,
        "median_ms": 1e3 * stats["median"],
        "spread_ms": 1e3 * stats["iqr"],
        "rounds": stats["rounds"],
        "convolutions": extra.pop("convolutions", ""),
        "residual": extra.pop("residual", ""),
        "more": "; ".join(f"{name} {_short(value)}" for name, value in extra.items()),
    }


def _short(value: Any) -> str:
    """Return a value as text, floats with four digits."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class _BenchmarkCase:
    """The work that a benchmark times."""

    name: str  # name with all parameters except the size, as "solve at contact: 50"
    size: str  # one of `SIZES`, or empty if the benchmark has none


def _case(name: str, params: dict[str, Any]) -> _BenchmarkCase:
    """Return case and size of a benchmark with a name as `test_solve_at_contact[50-large]`.

    `params` are the values of its parameters by their names. The size is taken out of the values in
    brackets if it is the first or the last of them. Other values may contain hyphens themselves.
    """
    function, _, values = name.rstrip("]").partition("[")
    size = str(params.get("size") or _size_among(values))
    if values.startswith(f"{size}-"):
        values = values.removeprefix(f"{size}-")
    elif size:
        values = values.removesuffix(size).removesuffix("-")
    case = function.removeprefix("test_").replace("_", " ")
    if values:
        case += f": {values}"
    return _BenchmarkCase(case, size)


def _size_among(values: str) -> str:
    """Return the first of `SIZES` that is among values with hyphens between them, else ""."""
    parts = values.split("-")
    for size in SIZES:
        if size in parts:
            return size
    return ""


def models(comparison: Path) -> list[Row]:
    """Read errors and times of all models that a comparison has results of.

    Parameters
    ----------
    comparison : Path
        Folder of `learn compare` and `learn tune`.

    Returns
    -------
    list of Row
        A row for each model and result (`baseline` or `tuned`), in the order of Table 4: nMAE and
        R2 [%], and the times of `TIMES` [s], None where there is none. Column `front` has the kinds
        of time ("predict", "fit" and "search", with blanks between them) for which no other row has
        both a smaller error and a shorter time.

    Raises
    ------
    InputError
        If the folder has no scores and times of the area.
    """
    rows = _rows_of_models(comparison)
    for row in rows:
        row["front"] = ""
    for time in TIMES:
        kind = time.removesuffix("_s")
        for row in front(rows, time):
            row["front"] = f"{row['front']} {kind}".lstrip()
    return rows


def _rows_of_models(comparison: Path) -> list[Row]:
    """Return the rows of `models` without the column `front`.

    Raises InputError if there are none. Models that failed or were not timed are left out.
    """
    area = comparison / "area"
    try:
        _, scores = read_table(area / "scores.csv")
        _, times = read_table(area / "times.csv")
        _, searches = read_table(area / "tuning-times.csv")
    except InputError as error:
        raise InputError(
            f"{error}; give a folder of learn compare or learn tune"
        ) from None
    timed = {(row["model"], row["result"]): row for row in times}
    search_seconds = {row["model"]: float(row["fit_seconds"]) for row in searches}
    rows: list[Row] = []
    for score in scores:
        model = score["model"]
        result = score["result"]
        if (model, result) not in timed or score["failure"]:
            continue
        time = timed[model, result]
        search = search_seconds.get(model) if result == "tuned" else None
        rows.append(
            {
                "model": model,
                "result": result,
                "nmae": float(score["nmae"]),
                "r2": float(score["r2"]),
                "predict_s": float(time["predict_row_s"]),
                "fit_s": float(time["fit_s"]),
                "search_s": search,
            }
        )
    if not rows:
        raise InputError(
            f"{comparison}: has no scores and times of area; run learn compare"
        )
    return rows


def front(rows: Iterable[Row], time: str) -> list[Row]:
    """Return the Pareto front of error and time: rows that no other row beats in both.

    Parameters
    ----------
    rows : iterable of Row
        Rows with the error in the column `nmae`.
    time : str
        Column of the time. Rows in which it is None are left out.

    Returns
    -------
    list of Row
        The given rows that are not beaten, the fastest first. They are not copied.
    """
    timed = [row for row in rows if row[time] is not None]
    timed.sort(key=lambda row: (row[time], row["nmae"]))
    best: list[Row] = []
    for row in timed:
        if not best or row["nmae"] < best[-1]["nmae"]:
            best.append(row)
    return best
