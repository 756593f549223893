"""`python -m bench paper`: parts in the order of the paper, each made of the inputs it needs."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from bench import databases
from bench.databases import OTHER_SEED
from bench.page.content import Absent, Content, files_of
from bench.page.inputs import typed
from bench.page.record import Making, contents_of
from bench.paper import borrowed, cost, database, fine, models, numbers, predictions, surfaces
from bench.surrogates.cases import CASES, FINE
from bench.surrogates.generalisation import tests_of
from gen.runtime.errors import InputError
from gen.runtime.output import check_folder, make_folder

DATABASES = {"database", "fine"}
"""Inputs that are generated where they are not given."""

PAPER = "python -m bench paper"
COMPARED = f"python -m learn compare, its folder as --comparison of {PAPER}"
TUNED = f"python -m learn tune, its folder as --comparison of {PAPER}"
PAID = f"python -m bench cost, its folder as --cost of {PAPER}"

Remark = Callable[[str], None]


@dataclass(frozen=True)
class Part:
    """A part of the report.

    Attributes
    ----------
    name : str
        Name of the part and of its record.
    title : str
        What it is about.
    make : callable
        Makes its files in a folder, given its inputs by name; returns what they show.
    needs, takes : tuple of str
        Inputs without which it is not made, and inputs of which it makes more.
    how : str
        How to get it where it is missing.
    """

    name: str
    title: str
    make: Callable[..., list[Content]]
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()
    how: str = PAPER


BASE, COMPARISON = ("database",), ("comparison",)
PARTS = (
    Part(
        "numbers",
        "numbers in the text",
        numbers.numbers,
        BASE,
        takes=("comparison", "cost"),
        how=f"any of the options of {PAPER}",
    ),
    Part("levels", "random midpoint displacement", surfaces.levels),
    Part("profile", "a profile and its statistics", surfaces.profile),
    Part("topographies", "topography against contact pressure", surfaces.topographies),
    Part("hertz", "Hertz", borrowed.paraboloid),
    Part("solve-times", "solve times", database.solve_times, BASE),
    Part("distributions", "the database's distributions", database.distributions, BASE),
    Part("table-1", "Table 1", database.table_1, BASE),
    Part("table-2", "Table 2", models.table_2, takes=COMPARISON),
    Part("table-3", "Table 3", models.table_3, COMPARISON, how=TUNED),
    Part(
        "baselines",
        "predictions and scores of the baselines",
        predictions.baselines,
        COMPARISON,
        how=COMPARED,
    ),
    Part("tuned", "predictions of the tuned models", predictions.tuned, COMPARISON, how=TUNED),
    Part("table-4", "Table 4", models.table_4, COMPARISON, how=COMPARED),
    Part("fine", "the finer grid and Table 5", fine.fine_grid, ("database", "fine")),
    Part("cost", "total cost and break-even point", cost.total_cost, ("cost",), how=PAID),
    Part("appendix", "Appendix A", borrowed.equal_kernels, BASE),
)
"""All parts in the paper's order."""


def write_report(
    folder: Path,
    given: Mapping[str, Path],
    rows: int,
    *,
    only: Sequence[str] = (),
    remark: Remark = lambda line: None,
) -> list[Path]:
    """Make the parts that are not made yet, or whose inputs have changed.

    Parameters
    ----------
    folder : Path
        Folder to write into; its `databases` holds the databases that are generated.
    given : mapping of str to Path
        Inputs by name: `database` and `fine`, databases of the paper preset and of its finer grid;
        `comparison`, a folder of `learn compare` or `learn tune`; `cost`, a folder of `bench cost`.
    rows : int
        Rows of the paper preset that are generated where no database is given.
    only : sequence of str
        Names of the parts that are made; all that the inputs allow if empty.
    remark : callable
        Told how far it is.

    Returns
    -------
    list of Path
        Pictures and tables, in the paper's order.

    Raises
    ------
    InputError
        If an input cannot be used, or the folder cannot be written to.
    KeyboardInterrupt
        After a signal: the same call goes on.
    """
    check_folder(folder)
    _check(given)
    parts = _chosen(only, given)
    needed = {name for part in parts for name in part.needs}
    sources = _with_databases(folder / "databases", given, rows, needed, remark)
    make_folder(folder)
    written: list[Path] = []
    for number, part in enumerate(parts, 1):
        own = {name: sources[name] for name in (*part.needs, *part.takes) if name in sources}
        making = Making(_record(folder, part), _command(folder, part, given, rows), own)
        heading = f"{number} of {len(parts)}: {part.name}"
        written += _made(part, making, partial(remark, heading))
    return list(dict.fromkeys(written))


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder of the report: each part, or that it is absent.

    Raises
    ------
    InputError
        If the record of a part cannot be read.
    """
    shown: list[Content] = []
    for part in PARTS:
        shown += contents_of(_record(folder, part)) or [Absent(part.title, part.how)]
    return shown


def _made(part: Part, making: Making, remark: Callable[[], None]) -> list[Path]:
    """The files of a part, made now unless they are there and fit the inputs."""
    shown = contents_of(making.path)
    if shown is None or not making.stays():
        remark()
        began = time.monotonic()
        shown = part.make(making.path.parent, **making.sources)
        making.write(shown, seconds=round(time.monotonic() - began, 1))
    return [path for each in shown for path in files_of(each)]


def _record(folder: Path, part: Part) -> Path:
    return folder / f"{part.name}.part.json"


def _command(folder: Path, part: Part, given: Mapping[str, Path], rows: int) -> str:
    """The command that makes one part, as a user types it."""
    words = ["-m", "bench", "paper", "-o", str(folder), "--only", part.name]
    for name in (*part.needs, *part.takes):
        if name in given:
            words += [f"--{name}", str(given[name])]
    if "database" in part.needs and "database" not in given:
        words += ["--rows", str(rows)]
    return typed(words)


def _check(given: Mapping[str, Path]) -> None:
    """Refuse what cannot be used before anything is computed."""
    for name, refuse in (("comparison", models.opened), ("cost", cost.read), ("fine", fine.check)):
        if name in given:
            refuse(given[name])


def _chosen(only: Sequence[str], given: Mapping[str, Path]) -> list[Part]:
    """The parts that are asked for and that the inputs allow."""
    parts = {part.name: part for part in PARTS}
    for name in only:
        if name not in parts:
            raise InputError(f"--only {name}: give one of {', '.join(parts)}")
        if missing := set(parts[name].needs) - given.keys() - DATABASES:
            raise InputError(f"--only {name}: needs --{missing.pop()}")
    return [
        part
        for part in PARTS
        if (not only or part.name in only) and given.keys() | DATABASES >= set(part.needs)
    ]


def _with_databases(
    place: Path, given: Mapping[str, Path], rows: int, needed: Iterable[str], remark: Remark
) -> dict[str, Path]:
    """The inputs, with the databases that are needed and not given: generated, or found there."""
    sources = dict(given)
    if "database" in needed:
        sources["database"] = databases.of_the_paper(given.get("database"), place, rows, remark)
    if "fine" in needed and "fine" not in given:
        # The one that `bench generalisation` tests on too.
        (case,) = (case for case in CASES if case.name == FINE)
        count = tests_of(max(100, database.read(sources["database"]).rows.size))
        text = f"samples = {count}\nseed = {OTHER_SEED}\n{case.scene}"
        sources["fine"] = databases.generated(place, case.file, text, remark)
    return sources
