"""`python -m bench paper`: parts in the order of the paper, each made of the inputs it needs."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from inspect import signature
from pathlib import Path

from bench import databases
from bench.contents import Content, files_of
from bench.databases import OTHER_SEED
from bench.paper import database, models, surfaces
from bench.record import Making, recorded, typed
from bench.report import Report, remark
from gen.runtime.errors import InputError
from gen.runtime.files import check_folder, make_folder

PARTS: Mapping[str, Callable[..., list[Content]]] = {
    "numbers": models.numbers,
    "levels": surfaces.levels,
    "profile": surfaces.profile,
    "topographies": surfaces.topographies,
    "hertz": surfaces.paraboloid,
    "solve-times": database.solve_times,
    "distributions": database.distributions,
    "table-1": database.table_1,
    "table-2": models.table_2,
    "table-3": models.table_3,
    "baselines": models.baselines,
    "tuned": partial(models.predictions, kind="tuned"),
    "table-4": models.table_4,
    "fine": database.fine_grid,
    "appendix": surfaces.equal_kernels,
}
"""All parts in the paper's order, by the functions that make their files in a folder.

The further parameters of a function are its inputs by name; it makes more of those with a default.
"""


def paper(
    folder: Path,
    rows: int,
    database: Path | None,
    fine: Path | None,
    comparison: Path | None,
    only: Sequence[str],
) -> Report:
    """Draw the paper's figures and tables anew; the arguments are those of the command."""
    inputs = {"database": database, "fine": fine, "comparison": comparison}
    given = {name: path for name, path in inputs.items() if path is not None}
    paths = write_report(folder, given, rows, only=only)
    return Report({}, text="\n".join(map(str, paths)))


def write_report(
    folder: Path, given: Mapping[str, Path], rows: int, *, only: Sequence[str] = ()
) -> list[Path]:
    """Make the parts that are asked for, all unless named, and that the inputs allow.

    Inputs are `given` by the names of the command's options; databases that are not are generated
    in the folder's `databases`. Return pictures and tables, in the paper's order.
    """
    check_folder(folder)
    for name, refuse in (("comparison", models.opened), ("fine", database.check)):
        if name in given:
            refuse(given[name])
    parts = _chosen(only, given)
    needed = {each for name in parts for each in signature(PARTS[name]).parameters}
    sources = {**given, **_databases(folder / "databases", given, rows, needed)}
    make_folder(folder)
    options = [word for name, path in given.items() for word in (f"--{name}", str(path))]
    command = typed(["-m", "bench", "paper", *options, "-o", str(folder)])
    written: dict[Path, None] = {}
    for number, name in enumerate(parts, 1):
        remark(f"{number} of {len(parts)}: {name}")
        _, *wanted = signature(PARTS[name]).parameters
        own = {each: sources[each] for each in wanted if each in sources}
        shown = PARTS[name](folder, **own)
        Making(folder / f"{name}.part.json", command, own).write(shown)
        written |= dict.fromkeys(path for each in shown for path in files_of(each))
    return list(written)


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder of the report: its parts, those of earlier code last."""
    records = [folder / f"{name}.part.json" for name in PARTS]
    earlier = sorted({*folder.glob("*.part.json")} - {*records})
    return [each for path in (*records, *earlier) for each in recorded(path) or ()]


def _chosen(only: Sequence[str], given: Mapping[str, Path]) -> list[str]:
    """Return the parts that are asked for and that the inputs allow: databases are generated."""
    possible = list(PARTS)
    for name, function in PARTS.items():
        needed = signature(function).parameters.get("comparison")
        if needed and needed.default is needed.empty and "comparison" not in given:
            possible.remove(name)
    for name in only:
        if name not in PARTS:
            raise InputError(f"--only {name}: give one of {', '.join(PARTS)}")
        if name not in possible:
            raise InputError(f"--only {name}: needs --comparison")
    return [name for name in possible if not only or name in only]


def _databases(
    place: Path, given: Mapping[str, Path], rows: int, needed: set[str]
) -> dict[str, Path]:
    """Return the databases that are needed: given, generated, or found in their place."""
    found = {}
    if "database" in needed:
        found["database"] = databases.of_the_paper(given.get("database"), place, rows)
    if "fine" in needed and "fine" not in given:
        count = database.tests_of(len(database.finished(found["database"])))
        text = f"samples = {count}\nseed = {OTHER_SEED}\n{database.FINE_SCENE}"
        found["fine"] = databases.generated(place, "fine", text)
    return found
