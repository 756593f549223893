"""`python -m bench paper`: makes every part whose inputs are there, skips what is made already."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import gen.schema
from bench.page.content import Content
from bench.paper import borrowed, cost, database, fine, models, numbers, predictions, surfaces
from bench.paper.contents import files_of, keep, record, whole
from bench.surrogates import databases
from bench.surrogates.cases import CASES, FINE
from bench.surrogates.databases import OTHER_SEED
from bench.surrogates.generalisation import tests_of
from gen.runtime.output import check_folder, make_folder

VERSION = 1
"""Raised whenever a part shows something else for the same inputs."""

Remark = Callable[[str], None]


@dataclass(frozen=True)
class Inputs:
    """What the report is made of.

    Attributes
    ----------
    database : of the paper preset
    fine : the same on a finer grid
    comparison : folder of `learn compare` or `learn tune`, None for none
    cost : folder of `bench cost`, None for none
    command : that made it, for the captions
    """

    database: Path
    fine: Path
    comparison: Path | None
    cost: Path | None
    command: str


@dataclass(frozen=True)
class Part:
    """A part of the report.

    Attributes
    ----------
    name : in `contents.ORDER`
    sources : files and folders that it is made of
    make : makes its files in a folder
    """

    name: str
    sources: tuple[Path, ...]
    make: Callable[[Path], list[Content]]

    def key(self) -> str:
        """Fingerprint of what the part is made of."""
        files = [file for source in self.sources for file in _files(source)]
        states = (
            (str(file.resolve()), file.stat().st_size, file.stat().st_mtime_ns) for file in files
        )
        text = f"{VERSION} {gen.schema.PHYSICS} {sorted(states)}"
        return hashlib.sha256(text.encode()).hexdigest()


def write_report(
    folder: Path,
    rows: int,
    *,
    given: Path | None = None,
    finer: Path | None = None,
    comparison: Path | None = None,
    costs: Path | None = None,
    command: str = "",
    remark: Remark = lambda line: None,
) -> list[Path]:
    """Make what is not made yet.

    Parameters
    ----------
    folder : to write into; its `databases` holds what is generated
    rows : of the paper preset that are generated unless a database is given
    given : database of the preset
    finer : database of the preset with a finer grid, None to generate one
    comparison : folder of `learn compare` or `learn tune`
    costs : folder of `bench cost`
    command : for the captions
    remark : told how far it is

    Returns
    -------
    Pictures and tables, in the order in which they were asked for

    Raises
    ------
    InputError
        If an input cannot be used, or the folder cannot be written to.
    KeyboardInterrupt
        After a signal: the same command goes on.
    """
    _check(folder, comparison, costs)
    if finer is not None:
        fine.check(finer)
    source = databases.of_the_paper(given, folder / "databases", rows, remark)
    other = finer or _fine_database(folder, source, remark)
    inputs = Inputs(source, other, comparison, costs, command)
    make_folder(folder)
    parts = list(parts_of(inputs))
    written: list[Path] = []
    for number, part in enumerate(parts, 1):
        shown = _made(folder, part, partial(remark, f"{number} of {len(parts)}: {part.name}"))
        written += [path for each in shown for path in files_of(each)]
    return list(dict.fromkeys(written))


def _check(folder: Path, comparison: Path | None, costs: Path | None) -> None:
    """Refuse what cannot be used before anything is computed."""
    check_folder(folder)
    if comparison is not None:
        models.opened(comparison)
    if costs is not None:
        cost.read(costs)


def _fine_database(folder: Path, source: Path, remark: Remark) -> Path:
    """Generate the database of the finer grid that `bench generalisation` tests on too."""
    (case,) = (case for case in CASES if case.name == FINE)
    rows = tests_of(max(100, database.read(source).rows.size))
    text = f"samples = {rows}\nseed = {OTHER_SEED}\n{case.scene}"
    return databases.generated(folder / "databases", case.file, text, remark)


def parts_of(inputs: Inputs) -> Iterator[Part]:
    """All parts that can be made of some inputs, in the paper's order."""
    source, command = inputs.database, inputs.command
    given = tuple(path for path in (source, inputs.comparison, inputs.cost) if path is not None)
    yield Part(
        "numbers",
        given,
        lambda folder: numbers.numbers(folder, source, inputs.comparison, inputs.cost, command),
    )
    for name, make in (
        ("levels", surfaces.levels),
        ("profile", surfaces.profile),
        ("topographies", surfaces.topographies),
        ("hertz", borrowed.paraboloid),
    ):
        yield Part(name, (), partial(make, command=command))
    for name, draw in (
        ("solve-times", database.solve_times),
        ("distributions", database.distributions),
        ("table-1", database.table_1),
    ):
        yield Part(name, (source,), partial(draw, database=source, command=command))
    yield from _of_models(inputs)
    yield Part(
        "fine",
        (source, inputs.fine),
        lambda folder: fine.fine_grid(folder, source, inputs.fine, command),
    )
    paid = inputs.cost
    if paid is not None:
        yield Part("cost", (paid,), lambda folder: cost.total_cost(folder, paid, command))
    yield Part(
        "appendix", (source,), partial(borrowed.equal_kernels, source=source, command=command)
    )


def _of_models(inputs: Inputs) -> Iterator[Part]:
    """The parts that rest on a comparison."""
    compared, command = inputs.comparison, inputs.command
    yield Part(
        "table-2",
        () if compared is None else (compared,),
        lambda folder: models.table_2(folder, compared, command),
    )
    if compared is None:
        return
    path: Path = compared

    def baselines(folder: Path) -> list[Content]:
        drawn = predictions.predictions(folder, path, "baseline", command)
        return drawn + predictions.bars(folder, path, command)

    yield Part("table-3", (path,), partial(models.table_3, comparison=path, command=command))
    yield Part("baselines", (path,), baselines)
    yield Part(
        "tuned", (path,), lambda folder: predictions.predictions(folder, path, "tuned", command)
    )
    yield Part("table-4", (path,), partial(models.table_4, comparison=path, command=command))


def _made(folder: Path, part: Part, remark: Callable[[], None]) -> list[Content]:
    """What a part shows, made now unless it is there and fits the inputs."""
    key, before = part.key(), record(folder).get(part.name)
    if before is not None and before["key"] == key:
        shown = whole(folder, before)
        if shown or not before["contents"]:
            return shown
    remark()
    shown = part.make(folder)
    keep(folder, part.name, key, shown)
    return shown


def _files(source: Path) -> list[Path]:
    """Files of a source that decide results: not the tables and pictures made of them."""
    if source.is_file():
        return [source]
    return sorted({*source.glob("area/*.json"), *source.glob("area/*/*"), *source.glob("cost.csv")})
