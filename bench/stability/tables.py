"""The tables of `bench stability`: their cases, and how they are run."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module

from bench.files import Row
from bench.report import Report, remark
from bench.stability.case import Answer, Case, run_case
from gen.runtime.errors import InputError

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

    def row(self, case: Case, answer: Answer) -> Row:
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
        "surfaces",
        ("surfaces.generator_cases", "surfaces.statistics_cases"),
    ),
    "solver": Sheet(
        "The contact solver",
        "stability",
        ("solver.elastic_cases", "solver.hardness_cases"),
        (*FIRST, "message", *NUMBERS, "times_ordinary", "checks", "worst", "verdict", "reason"),
    ),
    "loads": Sheet("Random loads", "loads", ("loads",)),
    "hardness": Sheet("Random contacts that yield", "hardness", ("hardness",)),
    "edgeless": Sheet("Random contacts without edges", "edgeless", ("edgeless",)),
    "models": Sheet("The nine models", "models", ("models.fit_cases", "models.part_cases")),
}
"""In the order of the page, which is that of the work."""


def cases_of(name: str) -> list[Case]:
    """Return the cases of a table, family after family; imports only what this table needs."""
    modules = (import_module(f"bench.stability.{each}") for each in TABLES[name].modules)
    return [case for module in modules for case in module.cases()]


def report(full: bool, of: Sequence[str]) -> Report:
    """Run the cases of some tables, of all unless named; only `full` tables have the slow ones.

    Raises
    ------
    InputError
        If there is no such table, before anything is run.
    """
    unknown = [name for name in of if name not in TABLES]
    if unknown:
        raise InputError(f"--of {unknown[0]!r}: give one of {', '.join(TABLES)}")
    tables, said = {}, []
    for name in of or TABLES:
        sheet, cases = TABLES[name], [case for case in cases_of(name) if full or not case.slow]
        remark(f"{sheet.title}: {len(cases)} cases")
        judged = [(case, run_case(case)) for case in cases]
        tables[sheet.file] = [sheet.row(*each) for each in judged]
        failed = [(case, answer) for case, answer in judged if not answer.passed]
        said.append(f"{sheet.title}: {len(judged)} cases, {len(failed)} failed")
        said += [f"  {case.family}, {case.name}: {answer.failed}" for case, answer in failed]
    return Report(tables, text="\n".join(said))
