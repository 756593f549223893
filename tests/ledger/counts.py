"""What the ledger counts: contacts of the paper preset, the quick database, and searches on it."""

import tempfile
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import bem
from gen.arrays import Columns, Heights
from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.run import generate_database
from gen.generation.sample import compute_rows, surface_of
from gen.runtime.farm import World
from gen.scene import load
from gen.scene.columns import row_bytes
from gen.schema import Status
from learn.comparison import grid as grids
from learn.comparison import jobs
from learn.comparison.folder import Folder
from learn.dataset import Request as ComparisonRequest
from learn.executor import Executor
from learn.models import MODELS
from learn.split import FOLDS
from tests.ledger.table import Key

SIDE = 1000.0
"""Scan length of the surfaces [um]."""

ROWS = 32
"""Surfaces of most items: enough that one convolution more is less than 2 % of them."""

EXTREME_ROWS = 96
"""Rows of the extreme scene, from the touch of one node to full contact."""


@cache
def surfaces(count: int = ROWS, nodes: int = 129) -> tuple[Heights, ...]:
    """Generate the first surfaces of the paper preset, heights (nodes, nodes) [um]."""
    paper = load("paper")
    scene = paper.model_copy(update={"surface": paper.surface.model_copy(update={"nodes": nodes})})
    plan = parameters(scene, 0, count)
    return tuple(surface_of(scene, plan, row) for row in range(count))


def cells() -> Iterable[Heights]:
    """Return the same surfaces without their last row and column, for patches without edges."""
    return (heights[:-1, :-1] for heights in surfaces())


def _each(
    heights: Iterable[Heights], side: float | tuple[float, float] = SIDE, **arguments: Any
) -> Iterator[bem.Contact]:
    """Solve the same load on every surface."""
    return (bem.solve(surface, side, **arguments) for surface in heights)


Solves = Callable[[], Iterable[bem.Contact]]

SOLVES: dict[str, Solves] = {
    "Delta = 1 um": lambda: _each(surfaces(), delta=1.0),
    "Delta = 5 um": lambda: _each(surfaces(), delta=5.0),
    "Delta = 15 um": lambda: _each(surfaces(), delta=15.0),
    "Delta = 45 um": lambda: _each(surfaces(), delta=45.0),
    "Delta = 300 um": lambda: _each(surfaces(), delta=300.0),
    "rtol = 1e-10": lambda: _each(surfaces(), delta=15.0, rtol=1e-10),
    "compliant far field": lambda: _each(surfaces(), delta=5.0, far_field="compliant"),
    "given force": lambda: _each(surfaces(), force=1e4),
    "given pressure": lambda: _each(surfaces(), pressure=0.05),
    "concentrated force": lambda: _each(surfaces(), delta=15.0, kernel="concentrated-force"),
    "oblong cells, 1:4": lambda: _each(surfaces(), (SIDE, 4 * SIDE), delta=15.0),
    "oblong grid, 129 x 65": lambda: _each(
        (heights[:, :65] for heights in surfaces()), (SIDE, SIDE / 2), delta=15.0
    ),
    "257 nodes": lambda: _each(surfaces(16, 257), delta=15.0),
    "513 nodes": lambda: _each(surfaces(8, 513), delta=15.0),
    "ladder of 41 Delta": lambda: bem.ladder(surfaces()[0], SIDE, np.linspace(5, 45, 41)),
    "ladder of 21 pressures": lambda: bem.ladder(
        surfaces()[0], SIDE, pressures=np.geomspace(1e-3, 1e-1, 21)
    ),
    "hardness of 0.005 E*": lambda: _each(surfaces(), delta=15.0, hardness=0.005),
    "hardness of 0.05 E*": lambda: _each(surfaces(), delta=15.0, hardness=0.05),
    "hardness of 0.2 E*": lambda: _each(surfaces(), delta=15.0, hardness=0.2),
    "hardness of 0.05 E*, given pressure": lambda: _each(surfaces(), pressure=0.005, hardness=0.05),
    "hardness of 0.05 E*, ladder of 21 pressures": lambda: bem.ladder(
        surfaces()[0], SIDE, pressures=np.geomspace(1e-4, 1e-2, 21), hardness=0.05
    ),
    "periodic, given Delta": lambda: _each(cells(), delta=5.0, boundary="periodic"),
    "periodic, given pressure": lambda: _each(cells(), pressure=0.02, boundary="periodic"),
    "mirror, given Delta": lambda: _each(cells(), delta=5.0, boundary="mirror"),
    "mirror, given pressure": lambda: _each(cells(), pressure=0.02, boundary="mirror"),
    "mirror, nearly full contact": lambda: _each(cells(), pressure=0.2, boundary="mirror"),
    "mirror, hardness of 0.05 E*": lambda: _each(
        cells(), pressure=0.005, hardness=0.05, boundary="mirror"
    ),
}
"""The items and their solves."""

STIFF = ("Delta = 15 um", "257 nodes", "mirror, given pressure", "hardness of 0.05 E*")
"""Items whose contacts are asked for their stiffness too."""


def solve_counts() -> dict[Key, int]:
    """Count the work and the contact nodes of all items of `SOLVES`, and of the extreme scene."""
    counts = {}
    for item, solves in SOLVES.items():
        contacts = list(solves())
        counts[Key(item, "solves")] = len(contacts)
        for count in ("iterations", "convolutions", "contact_nodes"):
            total = sum(getattr(contact, count) for contact in contacts)
            counts[Key(item, count.replace("_", " "))] = total
        if item in STIFF:
            taken = sum(contact.punch.effort.convolutions for contact in contacts)
            counts[Key(item, "convolutions of the stiffness")] = taken
        if contacts[0].problem.hardness is not None:
            yielded = sum(contact.yielded_percent * contact.pressure.size for contact in contacts)
            counts[Key(item, "yielded nodes")] = round(yielded / 100)
    extreme = compute_rows(load("extreme"), 0, EXTREME_ROWS)
    return counts | column_counts("extreme scene", extreme)


def column_counts(item: str, columns: Columns) -> dict[Key, int]:
    """Count rows, done rows, iterations, convolutions and contact nodes by their columns."""
    status = columns["status"]
    counts = {
        Key(item, "rows"): status.size,
        Key(item, "rows done"): int(np.count_nonzero(status == Status.DONE)),
    }
    for count in ("iterations", "convolutions", "contact_nodes"):
        counts[Key(item, count.replace("_", " "))] = int(columns[count].sum())
    return counts


SEARCHED = ("kernel-ridge", "decision-tree")
"""Models of the comparison: those with fits of milliseconds, one of them with shared fits."""

INPUTS = 23
"""Inputs of the paper's features: Delta and the 22 statistics."""


def job_counts() -> dict[Key, int]:
    """Generate the quick scene's database and tune models on it, in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        database = Path(folder) / "quick.h5"
        generate_database("quick", database, World())
        return database_counts(database) | search_counts(database) | grid_counts()


def database_counts(path: Path, item: str = "quick scene") -> dict[Key, int]:
    """Count rows, work, contact nodes and bytes of a database of the quick scene."""
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
        counts[Key(item, "candidates")] = len(grid.candidates)
        counts[Key(item, "candidates that differ")] = len(grid.differing)
        counts[Key(item, "fits")] = FOLDS * len(grid.families)
    return counts
