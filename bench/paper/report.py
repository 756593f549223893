"""`python -m bench paper`: parts in the order of the paper, each made of the inputs it needs."""

import time
from collections.abc import Callable, Mapping, Sequence
from inspect import signature
from pathlib import Path

from bench import databases
from bench.contents import Absent, Content, files_of
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
    "tuned": models.tuned,
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


GENERATED = {"database", "fine"}  # inputs that are generated where they are not given

HOW = "python -m learn compare and learn tune, then their folder as --comparison of "
"""How to get the input that is not generated."""


def inputs_of(name: str) -> dict[str, bool]:
    """Return the inputs of a part, and whether it needs them."""
    _, *inputs = signature(PARTS[name]).parameters.values()
    return {each.name: each.default is each.empty for each in inputs}


def missing_of(name: str, given: Mapping[str, Path]) -> list[str]:
    """List the inputs that a part needs, and that are neither given nor generated."""
    needed = [each for each, needs in inputs_of(name).items() if needs]
    return [each for each in needed if each not in given and each not in GENERATED]


def write_report(
    folder: Path, given: Mapping[str, Path], rows: int, *, only: Sequence[str] = ()
) -> list[Path]:
    """Make the parts that are not made yet, or whose inputs have changed.

    Inputs are `given` by the names of the command's options; databases that are not are generated
    in the folder's `databases`. Return pictures and tables, in the paper's order.
    """
    check_folder(folder)
    for name, refuse in (("comparison", models.opened), ("fine", database.check)):
        if name in given:
            refuse(given[name])
    parts = _chosen(only, given)
    needed = {each for name in parts for each in inputs_of(name)} & GENERATED
    sources = {**given, **_databases(folder / "databases", given, rows, needed)}
    make_folder(folder)
    written: dict[Path, None] = {}
    for number, name in enumerate(parts, 1):
        own = {each: sources[each] for each in inputs_of(name) if each in sources}
        making = Making(_record(folder, name), _command(folder, name, given, rows), own)
        shown = recorded(making.path)
        if shown is None or not making.stays():
            remark(f"{number} of {len(parts)}: {name}")
            began = time.monotonic()
            shown = PARTS[name](folder, **own)
            making.write(shown, seconds=round(time.monotonic() - began, 1))
        written |= dict.fromkeys(path for each in shown for path in files_of(each))
    return list(written)


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder of the report: each part, or that it is absent.

    Parts that earlier code made, and this code does not make, come last.
    """
    shown: list[Content] = []
    for name in PARTS:
        how = HOW * bool(missing_of(name, {})) + "python -m bench paper"
        shown += recorded(_record(folder, name)) or [Absent(name, how)]
    earlier = sorted({*folder.glob("*.part.json")} - {_record(folder, name) for name in PARTS})
    return shown + [each for path in earlier for each in recorded(path) or ()]


def _record(folder: Path, name: str) -> Path:
    return folder / f"{name}.part.json"


def _command(folder: Path, part: str, given: Mapping[str, Path], rows: int) -> str:
    """Return the command that makes one part, as a user types it."""
    words = ["-m", "bench", "paper", "-o", str(folder), "--only", part]
    for name in inputs_of(part):
        if name in given:
            words += [f"--{name}", str(given[name])]
        elif name == "database":
            words += ["--rows", str(rows)]
    return typed(words)


def _chosen(only: Sequence[str], given: Mapping[str, Path]) -> list[str]:
    """Return the parts that are asked for and that the inputs allow."""
    for name in only:
        if name not in PARTS:
            raise InputError(f"--only {name}: give one of {', '.join(PARTS)}")
        if missing := missing_of(name, given):
            raise InputError(f"--only {name}: needs --{missing[0]}")
    return [name for name in PARTS if (not only or name in only) and not missing_of(name, given)]


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
