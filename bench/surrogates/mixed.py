"""Which area a surrogate should learn on mixed grids: the count of nodes, or the continuum's.

The count of nodes in contact depends on the grid. The area in the continuum should not. Spectral
surfaces of one distribution are solved on four grids. Surrogates are trained on each grid alone, on
all four grids, and on the three coarser ones, which the finest one judges. Their inputs are
dimensionless statistics, hybrid features of the heights, or the parameters of the scene alone.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.databases import generated
from bench.files import Row, read_toml
from bench.report import remark
from bench.surrogates.fitting import fit, parted, request_for
from learn import dataset
from learn.database_rows import Dataset
from learn.dataset import Request

GRIDS = (33, 65, 129, 257)
"""Nodes a side of the grids, the coarsest one first."""

TARGETS = {"count": "area", "continuum": "continuum_area_percent"}
"""Targets of the surrogates, by the first word of their columns in the table."""

SCENE: str = read_toml("surrogates/scenes")["mixed-grids"]["scene"]
"""The scene (TOML) of the coarsest grid, without its number of rows and seed."""


@dataclass(frozen=True)
class JudgedGrid:
    """Errors of a surrogate on rows of one grid that it was not trained on."""

    trained_on: str  # nodes a side of the grids that train, with blanks between them
    judged_on: str  # nodes a side of the grid of the rows that judge
    nmae: float  # error nMAE [%]
    bias: float  # sum of the predictions over the sum of the solved areas, less 1 [%]


def mixed(folder: Path, rows: int) -> list[Row]:
    """Fit surrogates to both areas on sets of grids, and judge them on each grid.

    Databases are generated in the folder `databases`, and kept. Progress is printed on standard
    error.

    Parameters
    ----------
    folder : Path
        Folder of the report.
    rows : int
        Number of rows of each grid's database.

    Returns
    -------
    list of Row
        One row for each feature set, set of training grids and judging grid, with the errors and
        biases of both areas [%].
    """
    paths = tuple(_database(folder, nodes, rows) for nodes in GRIDS)
    table: dict[tuple[str, str, str], Row] = {}
    for features in ("dimensionless", "hybrid", "scene"):
        for name, target in TARGETS.items():
            request = request_for(Path(), "kernel-ridge", features, None)
            request = replace(request, databases=paths, targets=(target,))
            (all_rows,) = dataset.read(request)
            for judged in _judged(request, all_rows):
                key = (features, judged.trained_on, judged.judged_on)
                # The second target adds its columns to the row of the first one.
                row = table.setdefault(key, _new_row(features, judged))
                row[f"{name}_nmae_percent"] = judged.nmae
                row[f"{name}_bias_percent"] = judged.bias
            remark(f"{features} features, {target}: done")
    return list(table.values())


def _database(folder: Path, nodes: int, rows: int) -> Path:
    """Generate the database of one grid, with the number of its nodes a side as its seed."""
    scene = SCENE.replace("nodes = 33", f"nodes = {nodes}")
    text = f"samples = {rows}\nseed = {nodes}\n{scene}"
    return generated(folder / "databases", f"spectral-{nodes}", text)


def _new_row(features: str, judged: JudgedGrid) -> Row:
    """Return a new row of the table, without its columns of errors and biases."""
    return {
        "features": features,
        "trained_on": judged.trained_on,
        "judged_on": judged.judged_on,
    }


def _judged(request: Request, all_rows: Dataset) -> Iterator[JudgedGrid]:
    """Yield the errors of a surrogate for each set of training grids, on each grid that judges it.

    `all_rows` are of all grids: the number of their database is the place of the grid in `GRIDS`. A
    surrogate is judged by test rows of its training grids. The one trained on the three coarser
    grids is judged by all rows of the finest grid instead.
    """
    nodes = np.array(GRIDS)[all_rows.database]  # nodes a side, for each row
    single = [(grid,) for grid in GRIDS]
    coarser = GRIDS[:-1]
    for trained in [*single, GRIDS, coarser]:
        parts = parted(all_rows.at(np.flatnonzero(np.isin(nodes, trained))))
        fitted = fit(request, parts.train, parts.folds)
        test = parts.test
        judging = trained
        if trained == coarser:
            # Only the finest grid judges. None of its rows was used for training.
            test = all_rows
            judging = GRIDS[-1:]
        for grid in judging:
            rows = test.at(np.flatnonzero(test.database == GRIDS.index(grid)))
            sum_ratio = fitted.predict(rows).sum() / rows.target.sum()
            bias = 100 * (sum_ratio - 1)
            yield JudgedGrid(
                trained_on=" ".join(map(str, trained)),
                judged_on=str(grid),
                nmae=fitted.scores(rows).nmae,
                bias=float(bias),
            )
