"""How far a surrogate of the paper preset may be taken: the paper's section 4.3, and further.

Kernel ridge is fitted to the paper preset with each feature set, and judged on other grids,
generators and scan lengths, and on larger Hurst exponents than it was trained on. The report
`coverage` judges the intervals in the same way, on many more kinds of surfaces.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from bench import databases
from bench.databases import OTHER_SEED
from bench.files import Row, read_toml
from bench.report import remark
from bench.surrogates.coverage import HURST_BORDER, LEVEL, column
from bench.surrogates.fitting import (
    AREA_MAX,
    Fitted,
    Parts,
    fit,
    parted,
    read,
    request_for,
)
from gen.runtime.errors import InputError
from learn import dataset
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.features import OF_SURFACES

FEWEST_ROWS = 200
"""Smallest number of rows of the preset that is accepted."""

SHARE = 10
"""Number of rows of the preset over that of each database which judges."""

FEWEST_TO_JUDGE = 40
"""Smallest number of rows of a database that judges."""

SCENES: dict[str, str] = read_toml("surrogates/scenes")["generalisation"]
"""Scenes (TOML) of the databases that judge, by their names in the table, without their numbers of
rows and seeds. Keys that a scene does not have are those of the paper preset."""

FINE = "fine grid (257)"
"""The scene of which some rows train a further surrogate, together with the preset."""

HOME = "same distribution"
"""Name of the case in which the test rows of the preset judge."""

UNSEEN = "unseen Hurst exponents"
"""Name of the case in which rows up to `HURST_BORDER` train and rows above it judge."""

ADDED = "fine grid (257), some rows added"
"""Name of the case in which rows of the fine grid train too."""


@dataclass(frozen=True, eq=False)
class Case:
    """A surrogate, and rows that judge it."""

    tested_on: str  # name of the rows, for the table
    fitted: Fitted
    trained: int  # number of training rows
    judged: Dataset  # rows that judge


def generalisation(folder: Path, rows: int) -> list[Row]:
    """Fit a surrogate of each feature set to the paper preset, and judge it elsewhere.

    Progress is printed on standard error.

    Parameters
    ----------
    folder : Path
        Folder of the report. Databases are generated in its folder `databases`, and kept.
    rows : int
        Number of rows of the paper preset, `FEWEST_ROWS` or more.

    Returns
    -------
    list of Row
        One row for each feature set and case: numbers of rows, scores [%], and the shares of rows
        that are flagged and that are inside their interval (0 to 1).

    Raises
    ------
    InputError
        If there are too few rows.
    """
    if rows < FEWEST_ROWS:
        raise InputError(f"--rows {rows}: give {FEWEST_ROWS} or more")
    paths = _databases(folder / "databases", rows)
    table: list[Row] = []
    for features in OF_SURFACES:
        request = request_for(paths[HOME], "kernel-ridge", features, AREA_MAX)
        for case in _cases(request, paths):
            row = _row(features, case)
            remark(f"{features} features, {case.tested_on}: nMAE {row['nmae']:.3g} %")
            table.append(row)
    return table


def _databases(folder: Path, rows: int) -> dict[str, Path]:
    """Return the databases by the names of their cases; generate those that are missing."""
    paths = {HOME: databases.generated(folder, databases.PAPER, f"samples = {rows}\n")}
    number = max(rows // SHARE, FEWEST_TO_JUDGE)
    head = f"samples = {number}\nseed = {OTHER_SEED}\n"
    for place, (name, scene) in enumerate(SCENES.items(), start=1):
        paths[name] = databases.generated(folder, f"other-{place}", head + scene)
    return paths


def _cases(request: Request, paths: dict[str, Path]) -> Iterator[Case]:
    """Yield the cases of a feature set, the one at home first."""
    parts = parted(read(request))
    home = fit(request, parts.train, parts.folds)
    trained = parts.train.size
    yield Case(HOME, home, trained, parts.test)
    yield _case_of_hurst(request, parts)
    for name in SCENES:
        elsewhere = read(replace(request, databases=(paths[name],)))
        yield Case(name, home, trained, elsewhere)
    yield _case_of_added_rows(request, (paths[HOME], paths[FINE]))


def _case_of_hurst(request: Request, parts: Parts) -> Case:
    """Fit the training rows of small Hurst exponents; the test rows of larger ones judge."""
    seen = np.flatnonzero(column(parts.train, "hurst") <= HURST_BORDER)
    unseen = np.flatnonzero(column(parts.test, "hurst") > HURST_BORDER)
    fitted = fit(request, parts.train.at(seen), parts.folds[seen])
    return Case(UNSEEN, fitted, seen.size, parts.test.at(unseen))


def _case_of_added_rows(request: Request, paths: tuple[Path, Path]) -> Case:
    """Fit rows of the preset and half of the rows of the fine grid; its other half judges.

    `paths` are the databases of the preset and of the fine grid.
    """
    (rows,) = dataset.read(replace(request, databases=paths))
    fine = np.flatnonzero(rows.database == 1)
    added = fine[::2]
    judged = fine[1::2]
    parts = parted(rows.at(np.setdiff1d(np.arange(rows.size), judged)))
    fitted = fit(request, parts.train, parts.folds)
    remark(f"  {added.size} rows of the fine grid added")
    return Case(ADDED, fitted, parts.train.size, rows.at(judged))


def _row(features: str, case: Case) -> Row:
    """Return the row of a case with a feature set."""
    judged = case.judged
    truth = judged.target * judged.scale
    ends = case.fitted.interval(judged, LEVEL)
    covered = (ends.low <= truth) & (truth <= ends.high)
    return {
        "tested_on": case.tested_on,
        "features": features,
        "trained": case.trained,
        "judged": judged.size,
        **asdict(case.fitted.scores(judged)),
        "flagged": float(case.fitted.flags(judged).mean()),
        "covered": float(covered.mean()),
    }
