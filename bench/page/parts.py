"""The parts of the page, in its order: what each runs, and what it shows.

Each report says it in a file of its own, `bench/reports/NAME.toml`: title,
commands, and `contents`, each a figure, a table or words of a file, with its caption.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from bench.files import content_of, is_there, named, read_toml
from bench.page.content import Absent, Content, Figure, Table, Words
from bench.table import read_table

ShowContents = Callable[[Path], Sequence[Content]]


@dataclass(frozen=True)
class Part:
    """A report of its own, under the headings of a chapter and a section.

    `quick` and `full` are arguments of the Python interpreter in a short and in a full run, empty
    if the part does not belong to that run. A run fills in {folder}, {database}, {comparison},
    {cost} and {concentrated}; words in brackets are left out where the file that they name
    is not there.
    """

    name: str
    chapter: str
    title: str
    quick: str
    full: str
    show: ShowContents  # lists what the part's folder holds
    folder: str = ""  # name of another part, to whose files it adds; empty for a folder of its own
    retired: str = ""  # commit up to which the code has the command that made it
    judges: bool = False  # whether exit code 1 says that a check failed, not that the report did


def part_of(report: str, chapter: str) -> Part:
    """Return the part of a report.

    Where the report lists its contents itself, `show` names that function: its module is loaded
    when the page asks, since a part does not need the packages of all others.
    """
    said = read_toml(f"reports/{report}")
    said.pop("contents", None)
    own = said.pop("show", "")

    def show(folder: Path) -> Sequence[Content]:
        contents: ShowContents | None = resolve_name(own) if own else None
        return contents(folder) if contents else contents_of(report, folder)

    return Part(report, chapter, **{"quick": "", "full": "", **said}, show=show)


def contents_of(report: str, folder: Path) -> list[Content]:
    """List what a folder holds of a report, by the report's file."""
    return [
        each
        for entry in read_toml(f"reports/{report}")["contents"]
        for each in _contents(entry, folder)
    ]


def _contents(entry: Mapping[str, Any], folder: Path) -> Iterator[Content]:
    """Yield the contents of an entry: one for each file that its name, with a *, may stand for.

    A table that is not there, or has no rows, is `absent` if the entry says so. Words, names with
    a *, what a command of its own makes, and what is `optional` are left out where no file is
    there.
    """
    (kind,) = entry.keys() & {"figure", "table", "words"}
    name, command = entry[kind], entry.get("command", "")
    for path in named(folder, name):
        caption = " ".join(entry.get("caption", "").replace("{target}", path.parent.name).split())
        if "absent" in entry and not (is_there(path) and read_table(path)[1]):
            yield Absent(entry["absent"], entry["how"].format(folder=folder))
        elif (command or kind == "words" or "optional" in entry) and not is_there(path):
            continue
        elif kind == "figure":
            data = tuple(folder / each for each in entry.get("data", ()))
            yield Figure(path, caption, command, data)
        elif kind == "table":
            columns = tuple(entry.get("columns", ()))
            yield Table(path, caption, command, columns, entry.get("verdict", ""))
        else:
            text, typed = content_of(path).decode(), entry.get("typed", False)
            yield from [Words(text, typed)] if typed else map(Words, text.splitlines())


ROWS = 1500  # rows of the paper preset that a short run generates; a full one generates all 15,878

CHAPTERS = {
    "The contact solver: error against run time": (*("solver", "peers", "growth", "hertz"),),
    "Bodies that yield": ("yielding", "hardness", "yielding-surrogate"),
    "Patches without edges, and theory": ("periodic", "theory"),
    "Stiff and extreme cases": ("stability",),
    "Laws in CalculiX": ("calculix",),
    "Cores": ("threads", "speedup"),
    "The farm": ("databases", "outputs", "scale", "writers", "faults"),
    "Surrogates: errors and costs": (
        *("comparison", "tuning", "grids"),
        *("comparison-hybrid", "comparison-concentrated", "models"),
        *("features", "tolerance", "grow"),
        *("cost", "throughput", "memory"),
    ),
    "Surrogates under shift": ("generalisation", "coverage"),
    "Measured maps": ("scans",),
    "The paper, side by side": ("paper", "unstated", "nearest"),
    "Benchmarks": ("benchmarks",),
}
"""The reports under each chapter's heading."""

PARTS = tuple(
    part_of(report, chapter) for chapter, reports in CHAPTERS.items() for report in reports
)
