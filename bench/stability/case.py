"""Cases of stiff and extreme input as data, their verdicts, and the tables of these verdicts."""

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pkgutil import resolve_name

from bench.files import Row
from bench.report import Report, remark
from gen.quantities import AREA, FORCE
from gen.runtime.errors import InputError


@dataclass(frozen=True)
class Finding:
    """One number that a check has measured, and the largest number that passes."""

    name: str  # name of the number in the table, as "force off its pressure"
    error: float  # the number, in the unit that its check states; NaN never passes
    allowed: float  # largest number that passes, in the same unit

    @property
    def passed(self) -> bool:
        """Whether the number is at most the allowed one."""
        return self.error <= self.allowed

    @property
    def rank(self) -> tuple[bool, float]:
        """Key that sorts findings from good to bad: whether it failed, then a share.

        The share is the number over the largest allowed one, or the number itself if only zero is
        allowed. It is infinite if the number is NaN.
        """
        share = self.error
        if self.allowed:
            share /= self.allowed
        if math.isnan(share):
            share = math.inf
        return not self.passed, share

    def __str__(self) -> str:
        """Return a text as "force off its pressure 2e-16 ≤ 1e-12"; the sign is > if it failed."""
        sign = "≤" if self.passed else ">"
        return f"{self.name} {self.error:.2g} {sign} {self.allowed:.2g}"


@dataclass(frozen=True)
class Refusal:
    """The error by which the solver has to refuse the input of a case."""

    error: type[Exception]  # exact class of the error; a subclass fails
    words: tuple[str, ...]  # texts that the message has to contain

    def judge(self, raised: Exception | None) -> Iterator[Finding]:
        """Compare an error with the required one by its class, number of lines, and words.

        Parameters
        ----------
        raised : Exception or None
            Error that the case has raised; None if it has raised none, which fails.

        Yields
        ------
        Finding
            1 if the class is another one or else 0; the number of lines of the message, of which
            one is allowed; and the number of texts that the message lacks.
        """
        message = str(raised)
        missing = [word for word in self.words if word not in message]
        is_other = type(raised) is not self.error
        yield Finding(
            name=f"other than {self.error.__name__}",
            error=int(is_other),
            allowed=0,
        )
        yield Finding(
            name="lines",
            error=len(message.splitlines()),
            allowed=1,
        )
        yield Finding(
            name=", ".join(["words missing", *missing]),
            error=len(missing),
            allowed=0,
        )


@dataclass(frozen=True)
class Answer:
    """The answer to a case, and the findings that judge it.

    `Case.examine` makes it. `run_case` then adds the input of the case if the answer has none,
    findings about a refusal, and a failed finding for each warning.
    """

    out: str  # the answer in words, or the message of the error
    findings: Sequence[Finding] = ()
    input: str = ""  # the input in words; empty if the case describes it
    # Further values of the row, by the names of the columns `NUMBERS`.
    numbers: Mapping[str, object] = field(default_factory=dict)
    raised: Exception | None = None  # the error, None if there was an answer

    @property
    def passed(self) -> bool:
        """Whether there are findings, and all of them have passed."""
        return bool(self.findings) and all(finding.passed for finding in self.findings)

    @property
    def failed(self) -> str:
        """The findings that have failed, in one line; empty if there are none."""
        return "; ".join(str(finding) for finding in self.findings if not finding.passed)

    @property
    def worst(self) -> Finding:
        """The finding with the highest rank; if there are no findings, one that fails."""
        nothing = Finding("nothing was looked for", error=1, allowed=0)
        return max(self.findings, key=lambda finding: finding.rank, default=nothing)


@dataclass(frozen=True)
class Case:
    """A row of a table: input of one kind, and the function that examines the answer to it."""

    family: str  # kind of the extreme, as "size"
    name: str  # name of the case within its family
    input: str  # the input in words; empty if the answer describes it
    # Runs the case. It returns an `Answer` with findings; any other result is an answer without
    # findings, and an error that it raises is one, too.
    examine: Callable[[], object]
    # How the input has to be refused; None if it has an answer.
    refusal: Refusal | None = None
    slow: bool = False  # whether only the full table has the case


def run_case(case: Case) -> Answer:
    """Run a case and judge it; errors and warnings of the run become findings.

    Parameters
    ----------
    case : Case
        The case.

    Returns
    -------
    Answer
        The answer with all findings: those about the refusal, those of the case itself, and a
        failed one for each distinct text of a warning.

    Raises
    ------
    ModuleNotFoundError
        If a package of an extra is not installed, which is no fault of the case.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        answer = _examined(case)
    texts = dict.fromkeys(one_line(warning.message) for warning in caught)
    of_warnings = [Finding(f"warning {text[:200]}", error=1, allowed=0) for text in texts]
    findings = (*_refusal_findings(case, answer), *answer.findings, *of_warnings)
    return replace(answer, input=answer.input or case.input, findings=findings)


def _examined(case: Case) -> Answer:
    """Return the answer of a case; if the case raises an error, an answer that has it as `raised`.

    ModuleNotFoundError passes through.
    """
    try:
        answer = case.examine()
    except ModuleNotFoundError:  # an extra is missing: this says nothing about the case
        raise
    except Exception as error:  # any error belongs into the table
        return Answer(one_line(error), raised=error)
    if isinstance(answer, Answer):
        return answer
    return Answer("an answer")


def _refusal_findings(case: Case, answer: Answer) -> list[Finding]:
    """Return findings on whether a case was refused as it has to be.

    The list is empty if the case must not be refused, and was not.
    """
    if case.refusal is not None:
        return list(case.refusal.judge(answer.raised))
    if answer.raised is not None:
        name = f"{type(answer.raised).__name__} instead of an answer"
        return [Finding(name, error=1, allowed=0)]
    return []


def one_line(message: object) -> str:
    """Return the text of an error or a warning in one line.

    Parameters
    ----------
    message : object
        The error or warning, or its text.

    Returns
    -------
    str
        The text, in which runs of white space are single blanks.
    """
    return " ".join(str(message).split())


@dataclass(frozen=True)
class CaseTable:
    """A table of cases."""

    file: str  # name of the CSV file without its ending
    title: str  # title in the text of the report
    cases: str  # function that yields the cases, as "module:name" in this package


TABLES = {
    "surfaces": CaseTable(
        file="surfaces",
        title="Generators and statistics",
        cases="surfaces:cases",
    ),
    "solver": CaseTable(
        file="stability",
        title="The contact solver",
        cases="solver:cases",
    ),
    "hardness": CaseTable(
        file="hardness",
        title="Random contacts that yield",
        cases="random_contacts:yielding",
    ),
    "edgeless": CaseTable(
        file="edgeless",
        title="Random contacts without edges",
        cases="random_contacts:edgeless",
    ),
    "models": CaseTable(
        file="models",
        title="The nine models",
        cases="models:cases",
    ),
}
"""The tables by their names in the option --of, in the order in which they are made."""

NUMBERS = (AREA.name, FORCE.in_tables, "residual", "iterations", "ordinary_iterations")
"""Columns of `Answer.numbers`, which only the table of the solver has."""


def cases_of(table: str) -> list[Case]:
    """Return the cases of a table, from the only module that is imported for them.

    Parameters
    ----------
    table : str
        Name of the table in `TABLES`.

    Returns
    -------
    list of Case
        All cases, also the slow ones, family after family.
    """
    cases = resolve_name(f"bench.stability.{TABLES[table].cases}")
    return list(cases())


def row_of(table: str, case: Case, answer: Answer) -> Row:
    """Return the row of a case.

    Parameters
    ----------
    table : str
        Name of the table in `TABLES`.
    case : Case
        The case.
    answer : Answer
        Its answer, from `run_case`.

    Returns
    -------
    Row
        The input, the answer, the worst finding, all findings, and the verdict "passed" or
        "failed". The table of the solver adds the message of an error, the worst finding as a text,
        and the columns `NUMBERS`, "" where there is no value.
    """
    worst = answer.worst
    row = {
        "family": case.family,
        "case": case.name,
        "input": answer.input,
        "what_came_out": answer.out,
        "check": worst.name,
        "error": float(worst.error),
        "allowed": float(worst.allowed),
        "all_checks": "; ".join(map(str, answer.findings)),
        "verdict": "passed" if answer.passed else "failed",
    }
    if table == "solver":
        row["message"] = answer.out if answer.raised else ""
        row["worst"] = str(worst)
        for name in NUMBERS:
            row[name] = answer.numbers.get(name, "")
    return row


def report(full: bool, of: Sequence[str]) -> Report:
    """Run the cases of some tables, and print the progress on standard error.

    Parameters
    ----------
    full : bool
        Whether the slow cases are run too.
    of : sequence of str
        Names of the tables in `TABLES`, from the option --of; empty for all tables.

    Returns
    -------
    Report
        The tables by the names of their files. The text counts the cases and names failed ones.

    Raises
    ------
    InputError
        If there is no table of a name; no case is run then.
    """
    unknown = [table for table in of if table not in TABLES]
    if unknown:
        raise InputError(f"--of {unknown[0]!r}: give one of {', '.join(TABLES)}")
    tables: dict[str, list[Row]] = {}
    lines: list[str] = []
    for table in of or TABLES:
        answers = _run_table(table, full=full)
        file = TABLES[table].file
        tables[file] = [row_of(table, case, answer) for case, answer in answers]
        lines.extend(_summary(table, answers))
    return Report(tables, text="\n".join(lines))


def _run_table(table: str, *, full: bool) -> list[tuple[Case, Answer]]:
    """Run the cases of a table, the slow ones only if `full`; return them with their answers."""
    cases = [case for case in cases_of(table) if full or not case.slow]
    remark(f"{TABLES[table].title}: {len(cases)} cases")
    return [(case, run_case(case)) for case in cases]


def _summary(table: str, answers: Sequence[tuple[Case, Answer]]) -> list[str]:
    """Return the lines of text about the cases of a table.

    `table` is a key of `TABLES`. The first line has the numbers of all and of failed cases. One
    line for each failed case follows, with the reason.
    """
    failed = [(case, answer) for case, answer in answers if not answer.passed]
    counts = f"{TABLES[table].title}: {len(answers)} cases, {len(failed)} failed"
    names = [f"  {case.family}, {case.name}: {answer.failed}" for case, answer in failed]
    return [counts, *names]
