"""The parts that a page is made of: what each runs, and what it shows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name

from bench.page.content import Content

ShowContents = Callable[[Path], Sequence[Content]]


@dataclass(frozen=True)
class Part:
    """A report of its own, under the headings of a chapter and a section.

    Attributes
    ----------
    quick, full : str
        Arguments of the Python interpreter in a short and in a full run, with {folder}, {database},
        {comparison}, {cost} and {fine} for what a run fills in; words in brackets are left out
        where the file that they name is not there. Empty if the part does not belong to that run.
    show : callable
        Lists what the part's folder holds.
    folder : str
        Name of another part, to whose files it adds; empty for a folder of its own.
    judges : bool
        Whether exit code 1 says that a check has failed, not that the report has.
    """

    name: str
    chapter: str
    title: str
    quick: str
    full: str
    show: ShowContents
    folder: str = ""
    judges: bool = False


def contents_of(report: str) -> ShowContents:
    """Return the function "module:function" by which a report says what its folder shows.

    Its module is loaded when the page asks: a part does not need the packages of all others.
    """

    def show(folder: Path) -> Sequence[Content]:
        contents: ShowContents = resolve_name(report)
        return contents(folder)

    return show
