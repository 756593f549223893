"""A JSON file of pytest-benchmark as one table that people can read."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bench.page.content import Absent, Content, Table, Words
from bench.table import write_table
from gen.runtime.errors import InputError

COMMAND = "pytest bench --benchmark-only --benchmark-json {json}"

SIZES = ("smoke", "paper", "large")

HEADER = (
    "suite",
    "case",
    "size",
    "median_ms",
    "spread_ms",
    "rounds",
    "convolutions",
    "residual",
    "more",
)
"""The spread is the interquartile range of the rounds."""

SHOWN = ("suite", "case", "size", "median_ms", "spread_ms", "rounds", "convolutions", "residual")


def contents(path: Path) -> list[Content]:
    """The table, and where and with what it was measured; writes the CSV file beside the JSON one.

    Parameters
    ----------
    path : that `pytest bench --benchmark-json` has written
    """
    command = COMMAND.format(json=path)
    if not path.exists():
        return [Absent("Times of single steps", command)]
    measured = read(path)
    table = write_table(path.with_suffix(".csv"), HEADER, rows(measured))
    return [
        Table(
            table,
            "Times of single steps, each with its answer asserted: median and interquartile range"
            " of the rounds, convolutions and residual where something is solved. Sizes: smoke is a"
            " look, paper the paper's, large beyond it. Compare ratios, not milliseconds.",
            columns=SHOWN,
        ),
        Words(circumstances(measured)),
    ]


def read(path: Path) -> dict[str, Any]:
    """What pytest-benchmark has written.

    Raises
    ------
    InputError
        If it is no such file.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        found["benchmarks"], found["machine_info"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is no JSON file of pytest-benchmark: {error}") from None
    return dict(found)


def rows(measured: dict[str, Any]) -> Iterator[tuple[object, ...]]:
    """One a benchmark, in the order of the suites."""
    for each in measured["benchmarks"]:
        case, size = _case(each["name"], each.get("params") or {})
        stats, extra = each["stats"], dict(each["extra_info"])
        extra.pop("versions", None)
        yield (
            Path(each["fullname"].partition("::")[0]).stem.removeprefix("test_"),
            case,
            size,
            1e3 * stats["median"],
            1e3 * stats["iqr"],
            stats["rounds"],
            extra.pop("convolutions", ""),
            extra.pop("residual", ""),
            "; ".join(f"{name} {_number(value)}" for name, value in extra.items()),
        )


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


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def circumstances(measured: dict[str, Any]) -> str:
    """Machine, date, commit and versions, in a sentence."""
    machine, commit = measured["machine_info"], measured.get("commit_info", {})
    versions = ", ".join(
        f"{name} {version}" for name, version in measured.get("versions", {}).items() if version
    )
    processor = machine.get("processor") or machine.get("cpu", {}).get("brand_raw", "unknown")
    return (
        f"Measured on {processor}, {machine.get('cores', '?')} cores, threads:"
        f" {machine.get('threads', '?')}, Python {machine.get('python_version', '?')},"
        f" {measured.get('datetime', '')[:16]}, commit {str(commit.get('id', 'unknown'))[:12]};"
        f" {versions}."
    )
