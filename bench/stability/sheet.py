"""A table of cases: how it is run, printed for people and written for programs."""

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from rich.console import Console
from rich.progress import track
from rich.table import Table

from bench.table import write_table

MANY_COLUMNS = 1000
"""Of a file or a pipe, whose lines are not broken."""


class Case(Protocol):
    """What every case says about itself."""

    @property
    def family(self) -> str:
        """What kind of extreme it is."""

    @property
    def name(self) -> str:
        """Of the case, unique in its family."""

    @property
    def slow(self) -> bool:
        """Whether only the full table has it."""


class Result(Protocol):
    """What came out of a case."""

    @property
    def case(self) -> Case:
        """What was run."""

    @property
    def passed(self) -> bool:
        """Whether all that was found is within its bounds, and anything was looked for."""


def nothing_more(_results: Sequence[Any]) -> Iterator[str]:
    """No lines below the table."""
    return iter(())


@dataclass(frozen=True)
class Sheet:
    """A table of cases.

    Attributes
    ----------
    title : of the printed table
    file : CSV file in the report's folder
    cases : family after family
    run : runs one case; what goes wrong is a result too
    header, row : of the file; numbers have all their digits
    titles, cells : of the printed table
    closing : lines to print below it, before the sum
    """

    title: str
    file: str
    cases: Sequence[Case]
    run: Callable[[Any], Result]
    header: tuple[str, ...]
    row: Callable[[Any], tuple[object, ...]]
    titles: tuple[str, ...]
    cells: Callable[[Any], tuple[str, ...]]
    closing: Callable[[Sequence[Any]], Iterator[str]] = nothing_more

    def results(self, *, full: bool = False) -> list[Result]:
        """Run one case after the other, the slow ones too if `full`."""
        cases = [case for case in self.cases if full or not case.slow]
        return [self.run(case) for case in _with_progress(cases)]

    def write(self, folder: Path, results: Iterable[Result]) -> Path:
        """Write the CSV file."""
        return write_table(folder / self.file, self.header, map(self.row, results))

    def show(self, results: Sequence[Result]) -> None:
        """Print the table, red where a case failed, its closing lines, then the sum."""
        console = Console(
            markup=False, highlight=False, width=None if sys.stdout.isatty() else MANY_COLUMNS
        )
        table = Table(box=None, pad_edge=False)
        for title in (*self.titles, "verdict"):
            table.add_column(title)
        family = ""
        for result in results:
            if result.case.family != family:
                family = result.case.family
                table.add_row(family, style="bold")
            style = "" if result.passed else "red"
            cells = (*self.cells(result), "passed" if result.passed else "FAILED")
            table.add_row(f"  {result.case.name}", *cells, style=style)
        console.print(f"\n{self.title}", style="bold")
        console.print(table)
        for line in (*self.closing(results), *_sum(results)):
            console.print(line)


def verdict(result: Result) -> str:
    """In a word."""
    return "passed" if result.passed else "failed"


def _sum(results: Sequence[Result]) -> Iterator[str]:
    failed = [result.case.name for result in results if not result.passed]
    yield f"\n{len(results)} cases, {len(failed)} failed{': ' * bool(failed)}{'; '.join(failed)}"


def _with_progress(cases: Sequence[Case]) -> Iterable[Case]:
    """Show on a terminal how far the run is."""
    console = Console(stderr=True)
    off = not console.is_terminal
    return track(cases, "cases", console=console, transient=True, disable=off)
