"""Count of nodes or area in the continuum: which of the two a surrogate learns on mixed grids.

A count depends on the grid, the area in the continuum should not. Spectral surfaces of one
distribution on four grids: a surrogate of each grid, of all, and of the coarser ones for the
finest; from statistics, from features of the heights, and from the scene's parameters alone.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.databases import generated
from bench.files import Row, read_toml
from bench.report import remark
from bench.surrogates.fitting import fit, parted, request_for
from learn import dataset
from learn.database_rows import Dataset
from learn.dataset import Request

GRIDS = (33, 65, 129, 257)  # nodes a side
TARGETS = {"count": "area", "continuum": "continuum_area_percent"}
SCENE: str = read_toml("surrogates/scenes")["mixed-grids"]["scene"]


def mixed(folder: Path, rows: int) -> list[Row]:
    """Return errors and biases [%] of both areas, for each set of grids that trains and judges."""
    paths = []
    for n in GRIDS:
        text = f"samples = {rows}\nseed = {n}\n" + SCENE.replace(
            "nodes = 33", f"nodes = {n}"
        )
        paths.append(generated(folder / "databases", f"spectral-{n}", text))
    found: dict[tuple[str, ...], Row] = {}
    for features in ("dimensionless", "hybrid", "scene"):
        for name, target in TARGETS.items():
            request = request_for(Path(), "kernel-ridge", features, None)
            request = replace(request, databases=tuple(paths), targets=(target,))
            (every,) = dataset.read(request)
            for key, scores in _judged(request, every):
                row = found.setdefault((features, *key), {})
                row |= {
                    f"{name}_{score}_percent": value for score, value in scores.items()
                }
            remark(f"{features} features, {target}: done")
    names = "features", "trained_on", "judged_on"
    return [dict(zip(names, key, strict=True)) | row for key, row in found.items()]


def _judged(
    request: Request, every: Dataset
) -> Iterator[tuple[tuple[str, str], dict[str, float]]]:
    """Yield the grids that train and judge, with the errors of rows that have not trained."""
    nodes = np.array(GRIDS)[every.database]
    for trains in (*((grid,) for grid in GRIDS), GRIDS, GRIDS[:-1]):
        parts = parted(every.at(np.flatnonzero(np.isin(nodes, trains))))
        fitted = fit(request, parts.train, parts.folds)
        test, judges = parts.test, trains
        if trains == GRIDS[:-1]:
            test, judges = every, GRIDS[-1:]
        for grid in judges:
            rows = test.at(np.flatnonzero(test.database == GRIDS.index(grid)))
            bias = 100 * (fitted.predict(rows).sum() / rows.target.sum() - 1)
            scores = {"nmae": fitted.scores(rows).nmae, "bias": float(bias)}
            yield (" ".join(map(str, trains)), str(grid)), scores
