"""`python -m bench paper`: parts in the order of the paper, each made of the inputs it needs."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from bench import databases
from bench.databases import OTHER_SEED
from bench.files import Row
from bench.paper import database as of_database
from bench.paper import models, surfaces
from bench.report import Report, remark


def paper(
    folder: Path, rows: int, database: Path | None, comparison: Path | None
) -> Report:
    """Make all parts that the inputs allow; some need a comparison.

    The arguments are those of the command. Databases that are not given are generated in the
    folder's `databases`.
    """
    if comparison is not None:
        models.opened(comparison)
    path = databases.of_the_paper(database, folder / "databases", rows)
    count = of_database.tests_of(len(of_database.finished(path)))
    text = f"samples = {count}\nseed = {OTHER_SEED}\n{of_database.FINE_SCENE}"
    fine = databases.generated(folder / "databases", "fine", text)
    parts: list[Callable[[], Report]] = [
        partial(models.numbers, path, comparison),
        *(surfaces.levels, surfaces.profile, surfaces.topographies),
        partial(of_database.solve_times, path),
        partial(of_database.table_1, path),
        partial(models.table_2, comparison),
        partial(of_database.fine_grid, path, fine),
        partial(surfaces.equal_kernels, path),
    ]
    if comparison is not None:
        found = (models.table_3, models.table_4, models.predictions, models.bars)
        parts += [partial(each, comparison) for each in found]
    tables: dict[str, Sequence[Row]] = {}
    pictures: dict[str, Any] = {}
    for number, make in enumerate(parts, 1):
        remark(f"{number} of {len(parts)}")
        made = make()
        tables |= made.tables
        pictures |= made.pictures
    return Report(tables, pictures)
