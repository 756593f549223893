"""A JSON file of pytest-benchmark as one table that people can read."""

import json
from pathlib import Path
from typing import Any

from bench.contents import Content, contents_of
from bench.files import write_rows
from gen.runtime.errors import InputError

SIZES = ("smoke", "paper", "large")


def contents(folder: Path) -> list[Content]:
    """List the table of times, written from pytest-benchmark's `times.json` if that is there."""
    measured = folder / "times.json"
    if measured.exists():
        write_rows(measured.with_suffix(".csv"), map(_row, read(measured)["benchmarks"]))
    return contents_of("benchmarks", folder)


def read(path: Path) -> dict[str, Any]:
    """Read a file of pytest-benchmark."""
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        document["benchmarks"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is no JSON file of pytest-benchmark: {error}") from None
    return document


def _row(benchmark: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a benchmark by the names of their columns."""
    case, size = _case(benchmark["name"], benchmark.get("params") or {})
    stats, extra = benchmark["stats"], dict(benchmark["extra_info"])
    row = {
        "suite": Path(benchmark["fullname"].partition("::")[0]).stem.removeprefix("test_"),
        "case": case,
        "size": size,
        "median_ms": 1e3 * stats["median"],
        "spread_ms": 1e3 * stats["iqr"],
        "rounds": stats["rounds"],
        "convolutions": extra.pop("convolutions", ""),
        "residual": extra.pop("residual", ""),
    }
    more = [f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in extra.items()]
    return {**row, "more": "; ".join(more)}


def _case(name: str, params: dict[str, Any]) -> tuple[str, str]:
    """Case and size of `test_solve_at_contact[50-large]`; values may hold hyphens themselves."""
    function, _, inside = name.rstrip("]").partition("[")
    size = str(params.get("size") or next((s for s in SIZES if s in inside.split("-")), ""))
    if inside.startswith(f"{size}-"):
        inside = inside.removeprefix(f"{size}-")
    elif size:
        inside = inside.removesuffix(size).removesuffix("-")
    case = function.removeprefix("test_").replace("_", " ")
    return f"{case}: {inside}" if inside else case, size
