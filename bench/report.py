"""A report: a function that returns rows, and a TOML file that says all the rest.

`bench/reports/NAME.toml` has the title, the function (`measure`) with the options of its command,
the commands of a short and of a full run, and the `contents` that are shown: what the columns
are, how they are drawn and what to see. `CHAPTERS` puts the reports in order.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from bench.contents import Content, contents_of
from bench.files import Row, read_toml, write_rows
from gen.runtime.files import make_folder
from gen.runtime.terminal import echo


def remark(line: str) -> None:
    """Print a line to standard error: how far a report is."""
    echo(line, err=True)


@dataclass(frozen=True, eq=False)
class Report:
    """Results that are ready to be written, by the names of their files without ending.

    Tables are rows with the same columns, pictures are figures that the TOML file does not
    describe. The text is for people, and printed below the tables.
    """

    tables: Mapping[str, Sequence[Row]]
    pictures: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""

    @property
    def passed(self) -> bool:
        """Whether no row has a verdict other than `passed`."""
        rows = (row for rows in self.tables.values() for row in rows)
        return all(row.get("verdict", "passed") == "passed" for row in rows)

    def write(
        self, folder: Path, contents: Sequence[Mapping[str, Any]] = ()
    ) -> list[Path]:
        """Write all files into a folder, with pictures as contents of a TOML file describe them."""
        from bench.picture import drawn, save

        make_folder(folder)
        there = {name: rows for name, rows in self.tables.items() if rows}
        paths = [write_rows(folder / f"{name}.csv", rows) for name, rows in there.items()]
        pictures = {**self.pictures, **drawn(contents, self.tables)}
        return [
            *paths,
            *(save(each, folder / f"{name}.png") for name, each in pictures.items()),
        ]


@dataclass(frozen=True)
class Part:
    """A report as a part of the page, under the headings of a chapter and a section.

    `quick` and `full` are arguments of the Python interpreter in a short and in a full run, empty
    if the part does not belong to that run. A run fills in {folder}, {database} and
    {comparison}; words in brackets are left out where the file that they name is not there.
    """

    name: str
    chapter: str
    title: str
    quick: str
    full: str
    show: Callable[[Path], Sequence[Content]]  # lists what the part's folder holds
    folder: str = (
        ""  # name of another part, to whose files it adds; empty for a folder of its own
    )
    retired: str = ""  # commit up to which the code has the command that made it
    judges: bool = (
        False  # whether exit code 1 says that a check failed, not that the report did
    )
    seconds: float | None = None  # processor time of the short run [s]
    minutes: float = (
        0  # time of the full run, where the published record is of another command
    )
    beside: bool = False  # whether another part may be made at the same time
    needs: Sequence[
        str
    ] = ()  # programs and distributions without which something is left out
    measure: str = ""  # function that returns the rows, if its command is one of `bench`
    help: str = ""  # of that command
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    keeps: bool = False  # whether the function keeps files of its own in the folder
    contents: Sequence[Mapping[str, Any]] = ()  # what is shown, and how it is drawn


def part_of(report: str, chapter: str = "") -> Part:
    """Return the part of a report."""
    said = {"quick": "", "full": "", "contents": (), **read_toml(f"reports/{report}")}
    return Part(report, chapter, **said, show=partial(contents_of, said["contents"]))


CHAPTERS = {
    "The contact area in the continuum": (
        "resolution",
        "grid-error",
        "border-weights",
        "mixed",
    ),
    "The contact solver: error against run time": (
        "solver",
        "default-tolerance",
        "peers",
        "growth",
        "hertz",
    ),
    "Bodies that yield": ("yielding", "hardness", "yielding-surrogate"),
    "Patches without edges, and theory": ("periodic", "theory"),
    "Stiff and extreme cases": ("stability",),
    "Laws of interfaces": ("calculix", "bands"),
    "Cores": ("threads", "speedup"),
    "The farm": ("databases", "outputs", "scale", "writers", "faults"),
    "Surrogates: errors and costs": (
        *(
            "comparison",
            "tuning",
            "search",
            "comparison-hybrid",
            "comparison-concentrated",
        ),
        *("models", "features", "scene-surrogate", "tolerance", "grow"),
        *("cost", "throughput", "memory"),
    ),
    "Surrogates under shift": ("generalisation", "coverage"),
    "Measured maps": ("scans",),
    "The paper, side by side": ("paper", "unstated", "nearest"),
    "Benchmarks": ("benchmarks",),
}
"""The reports under each chapter's heading."""

PARTS = tuple(
    part_of(name, chapter) for chapter, names in CHAPTERS.items() for name in names
)
