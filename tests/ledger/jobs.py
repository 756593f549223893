"""The jobs of the ledger: the database of the quick scene, and a comparison of models on it."""

import tempfile
from pathlib import Path

from gen.database import Reader
from gen.generation.run import Request, generate_database
from gen.runtime.farm import World
from gen.scene.columns import row_bytes
from learn.comparison import grid as grids
from learn.comparison import jobs
from learn.comparison.folder import Folder
from learn.dataset import Request as ComparisonRequest
from learn.executor import Executor
from learn.models import MODELS
from learn.split import FOLDS
from tests.ledger.solves import column_counts
from tests.ledger.table import Key

SEARCHED = ("kernel-ridge", "decision-tree")
"""Models of the comparison: those with fits of milliseconds, one of them with shared fits."""

INPUTS = 23
"""Inputs of the paper's features: Delta and the 22 statistics."""


def job_counts() -> dict[Key, int]:
    """Generate the quick scene's database and tune models on it, in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        database = Path(folder) / "quick.h5"
        generate_database(Request("quick", database), World())
        return database_counts(database) | search_counts(database) | grid_counts()


def database_counts(path: Path) -> dict[Key, int]:
    """Count rows, work, contact nodes and bytes of a database of the quick scene."""
    item = "quick scene"
    with Reader(path) as reader:
        names = ("status", "iterations", "convolutions", "contact_nodes")
        counts = column_counts(item, {name: reader.column(name) for name in names})
        counts[Key(item, "bytes per row")] = row_bytes(reader.scene)
        counts[Key(item, "bytes")] = reader.size_bytes
    return counts


def search_counts(database: Path) -> dict[Key, int]:
    """Search the grids of `SEARCHED` on a database, and count the fits that this takes."""
    output = database.parent / "comparison"
    jobs.tune(ComparisonRequest((database,), output, models=SEARCHED), Executor())
    counts = {}
    for name in SEARCHED:
        result = Folder(output / "area").result("tuned", name)
        if result is None:
            raise RuntimeError(f"the search of {name} has left no result in {output}")
        item = f"comparison on the quick scene, {name}"
        counts[Key(item, "candidates scored")] = int(result["search"]["candidates_scored"])
        counts[Key(item, "fits")] = int(result["search"]["fits"])
    return counts


def grid_counts() -> dict[Key, int]:
    """Count candidates and fits of the whole grid of every model, without fitting any."""
    counts = {}
    for model in MODELS.values():
        _, space = grids.space_of(model.name, "paper")
        grid = grids.grid(model, space, INPUTS)
        item = f"grid of Table 2, {model.name}"
        counts[Key(item, "candidates")] = grid.nominal
        counts[Key(item, "candidates that differ")] = len(grid.differing)
        counts[Key(item, "fits")] = FOLDS * len(grid.families)
    return counts
