"""A JSON file of pytest-benchmark as one table that people can read."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bench.files import content_of, is_there
from bench.page.content import Absent, Content, Table, Words
from bench.table import write_table
from gen.runtime.errors import InputError
from gen.runtime.output import write

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


def contents(folder: Path) -> list[Content]:
    """List the table of times, and a sentence on where and with what they were measured.

    Where pytest-benchmark's `times.json` is in the folder, `times.csv` and `times.txt` are written
    from it first; without it they are shown as they are.

    Parameters
    ----------
    folder : Path
        Folder of `times.json`, or of the two files made of it.
    """
    measured = folder / "times.json"
    table, words = measured.with_suffix(".csv"), measured.with_suffix(".txt")
    if measured.exists():
        found = read(measured)
        write_table(table, HEADER, rows(found))
        write(words, circumstances(found) + "\n")
    if not is_there(table):
        return [Absent("Times of single steps", COMMAND.format(json=measured))]
    return [
        Table(
            table,
            "Times of single steps, each with its answer asserted: median and interquartile range"
            " of the rounds, convolutions and residual where something is solved. Sizes: smoke is a"
            " look, paper the paper's, large beyond it. Compare ratios, not milliseconds.",
            columns=SHOWN,
        ),
        Words(content_of(words).decode().strip()),
    ]


def read(path: Path) -> dict[str, Any]:
    """Read a file of pytest-benchmark.

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
    """Return a row for each benchmark, in the order of the suites."""
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
    """Return machine, date, commit and versions in a sentence."""
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
