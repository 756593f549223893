"""`asperity bench paper`: all tables and figures of the paper for which there are inputs."""

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
    """Make the tables and figures of the paper, ours beside the paper's numbers.

    The rows of the finer grid are always generated. Progress is printed on standard error.

    Parameters
    ----------
    folder : Path
        Folder of the report. Generated databases are kept in its folder `databases`.
    rows : int
        Number of the first rows of the paper preset that are generated if `database` is None.
    database : Path or None
        A database of the paper preset; None to generate one.
    comparison : Path or None
        Folder of `learn compare` and `learn tune`. With None, Tables 3 and 4, their pictures, our
        optima in Table 2 and the numbers of the comparison are left out.

    Returns
    -------
    Report
        All tables and pictures of this package.

    Raises
    ------
    InputError
        If the database or the folder cannot be used.
    KeyboardInterrupt
        If a signal interrupted the generation of a database.
    """
    if comparison is not None:
        models.area_folder(comparison)  # refuses a wrong folder before any work is done
    path = databases.of_the_paper(database, folder / "databases", rows)
    fine = _fine_database(folder, path)
    # Functions without arguments, each of which makes some of the tables and pictures.
    parts: list[Callable[[], Report]] = [
        partial(models.numbers, path, comparison),
        surfaces.levels,
        surfaces.profile,
        surfaces.topographies,
        partial(of_database.solve_times, path),
        partial(of_database.table_1, path),
        partial(models.table_2, comparison),
        partial(of_database.fine_grid, path, fine),
        partial(surfaces.equal_kernels, path),
    ]
    if comparison is not None:
        parts += [
            partial(models.table_3, comparison),
            partial(models.table_4, comparison),
            partial(models.predictions, comparison),
            partial(models.bars, comparison),
        ]
    tables: dict[str, Sequence[Row]] = {}
    pictures: dict[str, Any] = {}
    for number, make in enumerate(parts, 1):
        remark(f"{number} of {len(parts)}")
        part = make()
        tables |= part.tables
        pictures |= part.pictures
    return Report(tables, pictures)


def _fine_database(folder: Path, coarse: Path) -> Path:
    """Generate the database of the finer grid, and return its path.

    The number of its rows depends on the number of finished rows of the `coarse` database.
    """
    number = of_database.number_of_fine_rows(len(of_database.finished(coarse)))
    text = f"samples = {number}\nseed = {OTHER_SEED}\n{of_database.FINE_SCENE}"
    return databases.generated(folder / "databases", "fine", text)
