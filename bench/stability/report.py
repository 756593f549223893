"""The table for people, red where a case failed, and for programs as CSV."""

import csv
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from rich.console import Console
from rich.progress import track
from rich.table import Table

from bench.stability.case import MOST_TIMES_ORDINARY, Case, Result, run
from bench.stability.table import CASES
from gen.errors import InputError

NUMBERS = (
    "area_percent",
    "force_uN",
    "residual",
    "iterations",
    "ordinary_iterations",
    "times_ordinary",
)
HEADER = (
    "family",
    "case",
    "input",
    "message",
    *NUMBERS,
    "checks",
    "verdict",
    "reason",
)


def report(folder: Path | None = None, *, full: bool = False) -> bool:
    """Run the table, print it, and write `stability.csv` where a folder is given.

    Parameters
    ----------
    folder : to write into, made where there is none
    full : the slow cases too

    Returns
    -------
    Whether every case passed

    Raises
    ------
    InputError
        if the folder cannot be written to, before anything is run
    """
    cases = [case for case in CASES if full or not case.slow]
    with ExitStack() as files:
        table = None
        if folder is not None:
            try:
                folder.mkdir(parents=True, exist_ok=True)
                file = (folder / "stability.csv").open("w", encoding="utf-8", newline="")
            except OSError as error:
                message = f"{folder} cannot be written to: {error.strerror or error}"
                raise InputError(message) from None
            table = csv.writer(files.enter_context(file))
        results = run(_with_progress(cases))
        if table is not None:
            table.writerows(rows(results))
    show(results)
    return all(result.passed for result in results)


def rows(results: Iterable[Result]) -> Iterator[tuple[object, ...]]:
    """The table, its header first; numbers have all their digits."""
    yield HEADER
    for result in results:
        yield (
            result.case.family,
            result.case.name,
            result.asked,
            result.message,
            *(_numbers(result) if result.answered else ("",) * len(NUMBERS)),
            "; ".join(str(finding) for finding in (*result.findings, *result.conduct)),
            verdict(result),
            result.reason,
        )


def _numbers(result: Result) -> tuple[float, ...]:
    return (
        result.area_percent,
        result.force,
        result.residual,
        result.iterations,
        result.ordinary_iterations,
        result.times_ordinary,
    )


def verdict(result: Result) -> str:
    """In a word."""
    return "passed" if result.passed else "FAILED"


def answer(result: Result) -> str:
    """What came out, in words."""
    if result.message:
        return result.message
    return f"{result.area_percent:.4g} %, {result.force:.6g} µN"


def show(results: Sequence[Result]) -> None:
    """Print the table, then why iterations were many, then the sum."""
    console = Console(
        markup=False, highlight=False, width=None if sys.stdout.isatty() else MANY_COLUMNS
    )
    table = Table(box=None, pad_edge=False)
    for title in ("case", "input (um, MPa)", "what came out", "residual"):
        table.add_column(title, justify="right" if title == "residual" else "left")
    table.add_column("iterations (times ordinary)", justify="right")
    table.add_column("checks: error ≤ allowed")
    table.add_column("verdict")
    family = ""
    for result in results:
        if result.case.family != family:
            family = result.case.family
            table.add_row(family, style="bold")
        table.add_row(*_cells(result), style="" if result.passed else "red")
    console.print(table)
    for line in _closing_lines(results):
        console.print(line)


MANY_COLUMNS = 1000
"""Of a file or a pipe, whose lines are not broken."""


def _cells(result: Result) -> tuple[str, ...]:
    """A row: all that was found where there was an answer, and whatever failed."""
    shown = [
        *(f for f in result.findings if not f.passed or result.case.refusal is None),
        *(f for f in result.conduct if not f.passed),
    ]
    return (
        f"  {result.case.name}",
        result.asked,
        answer(result),
        f"{result.residual:.1e}" if result.answered else "",
        f"{result.iterations} ({result.times_ordinary:.2f})" if result.answered else "",
        "; ".join(str(finding) for finding in shown) or "refused as it should be",
        verdict(result),
    )


def _closing_lines(results: Sequence[Result]) -> Iterator[str]:
    reasons: dict[str, list[str]] = {}
    for result in results:
        if result.reason:
            line = f"{result.case.family}: {result.case.name} ({result.times_ordinary:.1f})"
            reasons.setdefault(result.reason, []).append(line)
    if reasons:
        yield f"\nmore than {MOST_TIMES_ORDINARY:g} times the ordinary iterations:"
    for reason, names in reasons.items():
        yield f"- {reason}:"
        yield from (f"    {name}" for name in names)
    failed = [result.case.name for result in results if not result.passed]
    yield f"\n{len(results)} cases, {len(failed)} failed{': ' * bool(failed)}{'; '.join(failed)}"


def _with_progress(cases: Sequence[Case]) -> Iterable[Case]:
    """Show on a terminal how far the run is."""
    console = Console(stderr=True)
    off = not console.is_terminal
    return track(cases, "cases", console=console, transient=True, disable=off)
