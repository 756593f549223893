"""The tables: how they are run, printed, written, and shown on the page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import groupby
from pathlib import Path

from rich.console import Console
from rich.progress import track
from rich.table import Table

from bench.stability.case import Answer, Case, run_case
from bench.table import write_rows
from gen.runtime.errors import InputError
from gen.runtime.files import check_folder
from gen.runtime.terminal import echo, print_table

MANY_COLUMNS = 1000  # of a file or a pipe, whose lines are not broken


FIRST = "family", "case", "input"
LAST = "check", "error", "allowed"
NUMBERS = "area_percent", "force_uN", "residual", "iterations", "ordinary_iterations"


@dataclass(frozen=True)
class Sheet:
    """A table of cases: title, file, the modules whose `cases` are its rows, and columns."""

    title: str
    file: str
    modules: tuple[str, ...]
    columns: tuple[str, ...] = (*FIRST, "what_came_out", *LAST, "all_checks", "verdict")

    def row(self, case: Case, answer: Answer) -> Mapping[str, object]:
        """Return a row of the file: the answer, its numbers, the worst check, then all checks."""
        worst, checks = answer.worst, "; ".join(map(str, answer.findings))
        cells: dict[str, object] = {
            "family": case.family,
            "case": case.name,
            "input": answer.asked,
            "what_came_out": answer.out,
            "message": answer.out if answer.raised else "",
            "check": worst.what,
            "error": float(worst.error),
            "allowed": float(worst.allowed),
            "worst": str(worst),
            "all_checks": checks,
            "checks": checks,
            "verdict": answer.verdict,
            **answer.numbers,
        }
        return {name: cells.get(name, "") for name in self.columns}


TABLES = {
    "surfaces": Sheet(
        "Generators and statistics",
        "surfaces.csv",
        ("surfaces.generator_cases", "surfaces.statistics_cases"),
    ),
    "solver": Sheet(
        "The contact solver",
        "stability.csv",
        ("solver.elastic_cases", "solver.hardness_cases"),
        (*FIRST, "message", *NUMBERS, "times_ordinary", "checks", "worst", "verdict", "reason"),
    ),
    "loads": Sheet("Random loads", "loads.csv", ("loads",)),
    "hardness": Sheet("Random contacts that yield", "hardness.csv", ("hardness",)),
    "edgeless": Sheet("Random contacts without edges", "edgeless.csv", ("edgeless",)),
    "models": Sheet("The nine models", "models.csv", ("models.fit_cases", "models.part_cases")),
}
"""In the order of the page, which is that of the work."""


def cases_of(name: str) -> list[Case]:
    """Return the cases of a table, family after family; imports only what this table needs."""
    modules = (import_module(f"bench.stability.{each}") for each in TABLES[name].modules)
    return [case for module in modules for case in module.cases()]


def report(folder: Path | None = None, *, full: bool = False, of: Sequence[str] = ()) -> bool:
    """Run and print tables, all unless named, and write a CSV file of each where a folder is given.

    Return whether every case passed; only the `full` tables have the slow ones.

    Raises
    ------
    InputError
        If there is no such table, or the folder cannot be written to, before anything is run.
    """
    unknown = [name for name in of if name not in TABLES]
    if unknown:
        raise InputError(f"--of {unknown[0]!r}: give one of {', '.join(TABLES)}")
    if folder is not None:
        check_folder(folder)
    passed = True
    for name in of or TABLES:
        sheet, cases = TABLES[name], [case for case in cases_of(name) if full or not case.slow]
        progress = Console(stderr=True)
        tracked = track(cases, console=progress, transient=True, disable=not progress.is_terminal)
        judged = [(case, run_case(case)) for case in tracked]
        show(sheet.title, judged)
        if folder is not None:
            write_rows(folder / sheet.file, [sheet.row(*each) for each in judged])
        passed &= all(answer.passed for _, answer in judged)
    return passed


def show(title: str, judged: Sequence[tuple[Case, Answer]]) -> None:
    """Print a table, red where a case failed, and the number of failures."""
    table = Table(
        *("case", "input (um, MPa)", "result", "checks: error ≤ allowed", "verdict"),
        box=None,
        pad_edge=False,
    )
    for family, members in groupby(judged, key=lambda each: each[0].family):
        table.add_row(family, style="bold")
        for case, answer in members:
            worst = "refused as it should be" if case.refusal else str(answer.worst)
            cells = f"  {case.name}", answer.asked, answer.out, answer.failed or worst
            table.add_row(*cells, answer.verdict, style="" if answer.passed else "red")
    failed = [case.name for case, answer in judged if not answer.passed]
    echo("")
    echo(title)
    print_table(table, MANY_COLUMNS)
    echo("")
    names = f": {'; '.join(failed)}" if failed else ""
    echo(f"{len(judged)} cases, {len(failed)} failed{names}")
