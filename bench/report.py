"""A report: a function that returns rows, and a TOML file that describes the report.

`bench/reports/NAME.toml` has the title, the function (`measure`) and the options of its command,
the commands of a short and of a full run, and the `contents`: the tables, pictures and words that
the page shows, with their captions. `CHAPTERS` has the order of the reports.
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
    """Print a line about the progress of a report on standard error.

    Parameters
    ----------
    line : str
        The text, without a line break at its end.
    """
    echo(line, err=True)


@dataclass(frozen=True, eq=False)
class Report:
    """Results of a report that are ready to be written, by the names of their files without ending.

    Rows of one table have the same columns. `pictures` has only matplotlib's figures that the TOML
    file of the report does not describe.
    """

    tables: Mapping[str, Sequence[Row]]
    pictures: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""  # for people: printed below the tables, and not written

    @property
    def passed(self) -> bool:
        """Whether every row that has a verdict has the verdict `passed`."""
        rows = (row for rows in self.tables.values() for row in rows)
        return all(row.get("verdict", "passed") == "passed" for row in rows)

    def write(
        self, folder: Path, contents: Sequence[Mapping[str, Any]] = ()
    ) -> list[Path]:
        """Write tables (CSV) and pictures (PNG) into a folder, which is made if need be.

        Parameters
        ----------
        folder : Path
            The folder of the report.
        contents : sequence of mappings
            Contents of the report's TOML file, which describe pictures of the tables.

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

    `quick` and `full` are the arguments of the Python interpreter in a short and in a full run. A
    run fills in {folder}, {database} and {comparison}, and leaves out words in brackets if the
    file that they name does not exist. All fields but `name`, `chapter` and `show` are keys of the
    report's TOML file.
    """

    name: str  # of its command, of its TOML file, and of its folder unless `folder` is given
    chapter: str  # heading above the report on the page
    title: str  # heading of the report
    quick: str  # empty if a short run leaves the part out
    full: str  # empty if a full run leaves the part out
    show: Callable[[Path], Sequence[Content]]  # lists the contents of the part's folder
    # Name of another part whose folder gets the files; empty for a folder of its own.
    folder: str = ""
    # Last commit whose code has the command of the part; empty if today's code has it.
    retired: str = ""
    judges: bool = False  # whether exit code 1 reports a failed check instead of an error
    seconds: float | None = None  # processor time of the short run [s]
    # Time of the full run [min], if the published record is of another command; otherwise 0.
    minutes: float = 0
    beside: bool = False  # whether other parts may be made at the same time
    # Programs and distributions. If one is not installed, some rows are left out.
    needs: Sequence[str] = ()
    # The function of the rows ("module:name"), if the command is one of `bench`; otherwise empty.
    measure: str = ""
    help: str = ""  # help text of that command
    # Options of that command by their names: the keys of typer.Option, `default` and `kind`, and
    # `path` or `argument` for a path or an argument.
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    keeps: bool = False  # whether the function itself writes files into the folder
    # Pictures, tables and words that are shown; see `bench.contents` and `bench.picture`.
    contents: Sequence[Mapping[str, Any]] = ()


def part_of(report: str, chapter: str = "") -> Part:
    """Read the TOML file of a report.

    Parameters
    ----------
    report : str
        Name of the report, which is that of the file in `bench/reports`.
    chapter : str
        Heading above the report on the page.

    Returns
    -------
    Part
        The report as a part of a run.
    """
    description: dict[str, Any] = {"quick": "", "full": "", "contents": ()}
    description |= read_toml(f"reports/{report}")
    show = partial(contents_of, description["contents"])
    return Part(name=report, chapter=chapter, show=show, **description)


CHAPTERS: Mapping[str, Sequence[str]] = {
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
    "Bodies that yield": ["yielding", "hardness", "yielding-surrogate"],
    "Patches without edges, and theory": ["periodic", "theory"],
    "Stiff and extreme cases": ["stability"],
    "Laws of interfaces": ["calculix", "bands"],
    "Cores": ["threads", "speedup"],
    "The farm": ["databases", "outputs", "scale", "writers", "faults"],
    "Surrogates: errors and costs": [
        "comparison",
        "tuning",
        "search",
        "comparison-hybrid",
        "comparison-concentrated",
        "models",
        "features",
        "scene-surrogate",
        "tolerance",
        "grow",
        "cost",
        "throughput",
        "memory",
    ],
    "Surrogates under shift": ["generalisation", "coverage"],
    "Measured maps": ["scans"],
    "The paper, side by side": ["paper", "unstated", "nearest"],
    "Benchmarks": ["benchmarks"],
}
"""Names of the reports below the heading of each chapter, in the order of the page."""

PARTS = tuple(
    part_of(name, chapter) for chapter, names in CHAPTERS.items() for name in names
)
"""All reports, in the order of the page."""
