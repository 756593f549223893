"""A JSON file of pytest-benchmark as one table that people can read."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.contents import Content, contents_of
from bench.files import write_rows
from gen.runtime.errors import InputError
from gen.runtime.files import write

SIZES = ("smoke", "paper", "large")


def contents(folder: Path) -> list[Content]:
    """List the table of times, and a sentence on the machine and the versions.

    Where pytest-benchmark's `times.json` is in the folder, `times.csv` and `times.txt` are written
    from it first; without it they are shown as they are.
    """
    measured = folder / "times.json"
    if measured.exists():
        document = read(measured)
        write_rows(measured.with_suffix(".csv"), map(_row, document["benchmarks"]))
        write(measured.with_suffix(".txt"), circumstances(document) + "\n")
    return contents_of("benchmarks", folder)


def read(path: Path) -> dict[str, Any]:
    """Read a file of pytest-benchmark."""
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        document["benchmarks"], document["machine_info"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is no JSON file of pytest-benchmark: {error}") from None
    return document


def _row(benchmark: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a benchmark by the names of their columns."""
    case, size = _case(benchmark["name"], benchmark.get("params") or {})
    stats, extra = benchmark["stats"], dict(benchmark["extra_info"])
    extra.pop("versions", None)
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


def circumstances(measured: dict[str, Any]) -> str:
    """Return machine, date, commit and versions in a sentence."""
    machine, commit = measured["machine_info"], measured.get("commit_info", {})
    versions = ", ".join(f"{name} {each}" for name, each in measured.get("versions", {}).items())
    processor = machine.get("processor") or machine.get("cpu", {}).get("brand_raw", "unknown")
    return (
        f"Measured on {processor}, {machine.get('cores', '?')} cores, threads:"
        f" {machine.get('threads', '?')}, Python {machine.get('python_version', '?')},"
        f" {measured.get('datetime', '')[:16]}, commit {str(commit.get('id', 'unknown'))[:12]};"
        f" {versions}."
    )


Row = dict[str, str]

SOLVES = 64
"""Solves in a round of `solve paper`."""


def in_short(times: Sequence[Row], growth: Sequence[Row]) -> list[tuple[str, str, str]]:
    """Return the times of a contact's steps at 129 x 129 nodes, and the growth of the convolutions.

    Takes the rows of `times.csv` and of the table of `bench growth`; returns for each quantity its
    name, its median time with the spread of the middle half, and a ratio in words.
    """
    found = {(row["case"], row["size"]): row for row in times}

    def time(case: str, size: str = "paper", of: int = 1) -> str:
        middle, spread = (float(found[case, size][f"{e}_ms"]) / of for e in ("median", "spread"))
        return f"{middle:.2g} ms ± {spread:.1g}"

    def ratio(case: str, name: str) -> str:
        (value,) = re.findall(rf"{name} (\S+?)(?:;|$)", found[case, ""]["more"])
        return f"{float(value):.2g}"

    tight, default, force = "solve paper: 1e-06", "solve paper: 2e-07", "solve given force: force"
    few, alone = "solve few in contact: 129-1.0", "time_over_iterations_alone"
    bare = [
        f"{ratio(e, 'bare_convolutions_per_solve')} bare convolutions' time"
        for e in (tight, default)
    ]
    rungs = [ratio(f"solve ladder: {many}", "time_over_single_solves") for many in (161, 9, 41)]
    longer = [ratio(force, f"{name}_over_given_delta") for name in ("time", "convolutions")]
    first = "contact solve, mean over the first 64 rows of `paper`, residual 1e-6 of Delta"
    return [
        (first, time(tight, "", SOLVES), bare[0]),
        ("the same at the default residual, 2e-7", time(default, "", SOLVES), bare[1]),
        (
            "the first 16 by their force instead of Delta",
            *("", "{} times as long, {} times the convolutions".format(*longer)),
        ),
        (
            "1 % of the nodes in contact, dense algebra on these",
            *(time(few, ""), f"{ratio(few, alone)} of the time of iterations alone"),
        ),
        ("one convolution, double", time("convolution: float64"), ""),
        ("the same, single precision", time("convolution: float32"), ""),
        ("surface, diamond-square", time("generate: diamond-square"), ""),
        ("the 22 statistics", time("describe"), ""),
        (
            "a contact among 161 loads on one surface (9, 41 loads)",
            *("", "{} of a separate solve's time ({}, {})".format(*rungs)),
        ),
        _grown(growth),
    ]


def _grown(growth: Sequence[Row]) -> tuple[str, str, str]:
    """Return how convolutions grow from the smallest grid to the largest, in words."""
    sizes = sorted({int(row["nodes"]) for row in growth})
    last = [row for row in growth if int(row["nodes"]) == sizes[-1]]
    shares = ", ".join(f"{float(row['percent']):g}" for row in last)
    growths = ", ".join(f"{float(row['growth']):.2f}" for row in last)
    what = "convolutions of iterations alone per doubling of the nodes a side"
    grids = f"{sizes[0]} to {sizes[-1]:,}, at {shares} % contact"
    return f"{what}, {grids}", "", f"{growths} times as many"
