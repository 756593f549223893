"""The solver's table: what is printed and written of each contact."""

from collections.abc import Iterator, Sequence

from bench.stability.finding import worst_of
from bench.stability.sheet import Sheet, verdict
from bench.stability.solver.case import MOST_TIMES_ORDINARY, Result, run_case
from bench.stability.solver.table import CASES

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
    "worst",
    "verdict",
    "reason",
)
TITLES = (
    "case",
    "input (um, MPa)",
    "what came out",
    "residual",
    "iterations (times ordinary)",
    "checks: error ≤ allowed",
)


def row(result: Result) -> tuple[object, ...]:
    """Of the file."""
    return (
        result.case.family,
        result.case.name,
        result.asked,
        result.message,
        *(_numbers(result) if result.answered else ("",) * len(NUMBERS)),
        "; ".join(str(finding) for finding in (*result.findings, *result.conduct)),
        worst_of((*result.findings, *result.conduct)),
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


def answer(result: Result) -> str:
    """What came out, in words."""
    if result.message:
        return result.message
    return f"{result.area_percent:.4g} %, {result.force:.6g} µN"


def cells(result: Result) -> tuple[str, ...]:
    """Of the printed table: all that was found where there was an answer, and whatever failed."""
    shown = [
        *(f for f in result.findings if not f.passed or result.case.refusal is None),
        *(f for f in result.conduct if not f.passed),
    ]
    return (
        result.asked,
        answer(result),
        f"{result.residual:.1e}" if result.answered else "",
        f"{result.iterations} ({result.times_ordinary:.2f})" if result.answered else "",
        "; ".join(str(finding) for finding in shown) or "refused as it should be",
    )


def closing(results: Sequence[Result]) -> Iterator[str]:
    """Why iterations were many."""
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


SHEET = Sheet(
    "The contact solver",
    "stability.csv",
    CASES,
    run_case,
    HEADER,
    row,
    TITLES,
    cells,
    closing,
)
"""The table as it is run and shown."""
