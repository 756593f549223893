"""`python -m bench paper`: parts in the order of the paper, each made of the inputs it needs."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any

from bench import databases
from bench.databases import OTHER_SEED
from bench.files import Row
from bench.paper import database as of_database
from bench.paper import models, surfaces
from bench.report import Report, remark
from gen.runtime.errors import InputError

PARTS: Mapping[str, Callable[..., Report]] = {
    "numbers": models.numbers,
    "levels": surfaces.levels,
    "profile": surfaces.profile,
    "topographies": surfaces.topographies,
    "solve-times": of_database.solve_times,
    "distributions": of_database.distributions,
    "table-1": of_database.table_1,
    "table-2": models.table_2,
    "table-3": models.table_3,
    "baselines": models.baselines,
    "tuned": partial(models.predictions, kind="tuned"),
    "table-4": models.table_4,
    "fine": of_database.fine_grid,
    "appendix": surfaces.equal_kernels,
}
"""All parts in the paper's order, by the functions that make their tables and pictures.

The parameters of a function are its inputs by name; it makes more of those with a default.
"""


def paper(
    folder: Path,
    rows: int,
    database: Path | None,
    fine: Path | None,
    comparison: Path | None,
    only: Sequence[str],
) -> Report:
    """Make the parts that are asked for, all unless named, and that the inputs allow.

    The arguments are those of the command. Databases that are not given are generated in the
    folder's `databases`.
    """
    inputs = {"database": database, "fine": fine, "comparison": comparison}
    given = {name: path for name, path in inputs.items() if path is not None}
    for name, refuse in (("comparison", models.opened), ("fine", of_database.check)):
        if name in given:
            refuse(given[name])
    parts = _chosen(only, given)
    needed = {each for name in parts for each in signature(PARTS[name]).parameters}
    sources = {**given, **_databases(folder / "databases", given, rows, needed)}
    tables: dict[str, Sequence[Row]] = {}
    pictures: dict[str, Any] = {}
    for number, name in enumerate(parts, 1):
        remark(f"{number} of {len(parts)}: {name}")
        wanted = signature(PARTS[name]).parameters
        made = PARTS[name](**{each: sources[each] for each in wanted if each in sources})
        tables |= made.tables
        pictures |= made.pictures
    return Report(tables, pictures)


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
        count = of_database.tests_of(len(of_database.finished(found["database"])))
        text = f"samples = {count}\nseed = {OTHER_SEED}\n{of_database.FINE_SCENE}"
        found["fine"] = databases.generated(place, "fine", text)
    return found
