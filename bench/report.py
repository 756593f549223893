"""A report: a function that returns rows, and a TOML file that describes the report.

`bench/reports/NAME.toml` has the title, the function (`measure`) and the options of its command,
the commands of a short and of a full run, and the `contents`: the tables, pictures and words that
the page shows, with their captions. `CHAPTERS` has the order of the reports.
"""

import itertools
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
    """Print a line about the progress of a report on standard error.

    Parameters
    ----------
    line : str
        The text, without a line break at its end.
    """
    echo(line, err=True)


@dataclass(frozen=True, eq=False)
class Report:
    """Results of a report that are ready to be written."""

    # Tables by the names of their files without ending. Rows of one table have the same columns.
    tables: Mapping[str, Sequence[Row]]
    # Matplotlib's figures by the names of their files without ending. Figures that the TOML file of
    # the report describes are not among them: they are drawn when the report is written.
    pictures: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""  # for people: printed below the tables, and not written

    @property
    def passed(self) -> bool:
        """Whether every row with a value in the column `verdict` has the value "passed"."""
        rows = itertools.chain.from_iterable(self.tables.values())
        return all(row.get("verdict", "passed") == "passed" for row in rows)

    def write(
        self, folder: Path, contents: Sequence[Mapping[str, Any]] = ()
    ) -> list[Path]:
        """Write tables (CSV) and pictures (PNG) into a folder, which is made if it is missing.

        Parameters
        ----------
        folder : Path
            The folder of the report.
        contents : sequence of mappings
            Entries `contents` of the report's TOML file. Figures among them are drawn from the
            tables.

        Returns
        -------
        list of Path
            The written files. Tables without rows are not written.
        """
        from bench.picture import draw_figures, save

        make_folder(folder)
        paths = []
        for name, rows in self.tables.items():
            if rows:
                paths.append(write_rows(folder / f"{name}.csv", rows))
        pictures = {**self.pictures, **draw_figures(contents, self.tables)}
        for name, figure in pictures.items():
            paths.append(save(figure, folder / f"{name}.png"))
        return paths


@dataclass(frozen=True)
class Part:
    """A report as a part of a run and of the page of all reports.

    All fields but `name`, `chapter` and `show` are keys of the report's TOML file.
    """

    # Name of the command and of the TOML file; also of the folder, unless `folder` is given.
    name: str
    chapter: str  # heading above the report on the page
    title: str  # heading of the report
    # Arguments of the Python interpreter that make the part in a short run. A run fills in
    # {folder}, {database} and {comparison}. It leaves out words in brackets if the file that they
    # name does not exist. Empty if a short run leaves the part out.
    quick: str
    full: str  # as `quick`, for a full run
    show: Callable[[Path], Sequence[Content]]  # lists the contents of the part's folder
    # Name of another part, into whose folder the files are written; empty for a folder of its own.
    folder: str = ""
    # True if exit code 1 reports a failed check; False if it reports an error.
    judges: bool = False
    # Processor time of the short run [s]; None if it has not been measured.
    seconds: float | None = None
    # Time of the full run [min], if the published record is of another command than the full run's
    # or of a busy machine; otherwise 0.
    minutes: float = 0
    beside: bool = False  # True if other parts may be made at the same time
    # True if a run makes the part only if its user names it, because it takes hours.
    named: bool = False
    # Names of programs and distributions. If one is not installed, some rows are left out.
    needs: Sequence[str] = ()
    # The function that returns the rows ("module:name"); empty if the command is not in `bench`.
    measure: str = ""
    help: str = ""  # help text of the command in `bench`
    # Descriptions of the command's options, by their names. The keys of a description are `help`,
    # `metavar`, `min` and `max` as of typer.Option; `default`; `kind`, the type of the entries if
    # the default is a list; and `path` or `argument` if the value is a path or an argument.
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    keeps: bool = False  # True if the function itself writes files into the folder
    # Pictures, tables and words that are shown; see `bench.contents` and `bench.picture`.
    contents: Sequence[Mapping[str, Any]] = ()


def part_of(report: str, chapter: str = "") -> Part:
    """Read the TOML file of a report.

    Parameters
    ----------
    report : str
        Name of the report and of its file in `bench/reports`, without ending.
    chapter : str
        Heading above the report on the page.

    Returns
    -------
    Part
        The report as a part of a run.
    """
    required: dict[str, Any] = {"quick": "", "full": "", "contents": ()}
    description = required | read_toml(f"reports/{report}")
    show = partial(contents_of, description["contents"])
    return Part(name=report, chapter=chapter, show=show, **description)


CHAPTERS: Mapping[str, Sequence[str]] = {
    "The error as input": ["accuracy"],
    "The contact area in the continuum": [
        "resolution",
        "grid-error",
        "border-weights",
        "mixed",
    ],
    "The contact solver: error against run time": [
        "solver",
        "default-tolerance",
        "peers",
        "growth",
        "hertz",
    ],
    "Bodies that yield": ["hardness"],
    "Patches without edges, and theory": ["periodic", "theory", "challenge"],
    "Stiff and extreme cases": ["stability"],
    "Laws of interfaces": ["calculix", "bands"],
    "Cores": ["threads", "speedup"],
    "The farm": ["writers", "faults"],
    "Surrogates: errors and costs": [
        "comparison",
        "tuning",
        "nine-models",
        "search",
        "comparison-hybrid",
        "models",
        "features",
        "scene-surrogate",
        "grow",
        "cost",
        "memory",
    ],
    "Surrogates under shift": ["generalisation", "coverage"],
    "Measured maps": ["scans"],
    "The paper, side by side": ["paper"],
    "Benchmarks": ["benchmarks"],
}
"""Names of the reports below the heading of each chapter, in the order of the page."""

PARTS = tuple(
    part_of(name, chapter) for chapter, names in CHAPTERS.items() for name in names
)
"""All reports, in the order of the page."""
