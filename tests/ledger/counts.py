"""What the ledger counts and holds: contacts, the quick database, and searches on it."""

import csv
import io
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import bem
from gen.arrays import Columns, Heights
from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.run import generate_database
from gen.generation.sample import compute_rows, surface_of
from gen.runtime.errors import InputError
from gen.runtime.farm import World
from gen.runtime.files import require_file, write
from gen.scene import load, row_bytes
from gen.schema import Status
from learn.comparison import grid as grids
from learn.comparison import jobs
from learn.comparison.folder import Folder
from learn.dataset import Request as ComparisonRequest
from learn.executor import Executor
from learn.models import MODELS
from learn.split import FOLDS

LEDGER = Path(__file__).with_name("counts.csv")

RISE = 0.02
"""Largest rise of a count of work, relative to the ledger."""

CHANGE = 0.001
"""Largest change of a count of results, relative to the ledger."""

WORK = frozenset({"iterations", "convolutions", "fits", "bytes", "bytes per row"})
"""Counts of work; all further ones are results."""

HEADER = ("item", "count", "value", "reason")


class Key(NamedTuple):
    """The name of an entry: of a calculation, and of what is counted in it."""

    item: str
    quantity: str

    def __str__(self) -> str:
        """Name the entry in messages."""
        return f"{self.item}, {self.quantity}"


class Entry(NamedTuple):
    """A line of the ledger: the count, and the reason of its last change."""

    value: int
    reason: str


Counts = Mapping[Key, int]


def read(path: Path = LEDGER) -> dict[Key, Entry]:
    """Read the ledger, in the order of the file; no entries if there is no file."""
    if not path.exists():
        return {}
    rows = list(csv.reader(io.StringIO(require_file(path).read_text(encoding="utf-8"))))
    try:
        entries = {Key(row[0], row[1]): Entry(int(row[2]), row[3]) for row in rows[1:]}
    except (ValueError, IndexError):
        entries = {}
    if rows[:1] != [list(HEADER)] or not entries:
        raise InputError(f"{path} is no ledger: give lines of {', '.join(HEADER)}")
    return entries


def updated(
    entries: Mapping[Key, Entry], counts: Counts, reason: str
) -> dict[Key, Entry]:
    """Return the entries of new counts; those that have changed get a new reason."""
    return {
        key: entries[key]
        if key in entries and entries[key].value == value
        else Entry(value, reason)
        for key, value in counts.items()
    }


def write_entries(entries: Mapping[Key, Entry], path: Path = LEDGER) -> None:
    """Write the ledger."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    writer.writerows((*key, *entry) for key, entry in entries.items())
    write(path, text.getvalue())


def faults(entries: Mapping[Key, Entry], counts: Counts) -> Iterator[str]:
    """Yield one line for each count that is out of its bound, missing, or unknown."""
    for key in sorted(entries.keys() - counts.keys()):
        yield f"{key}: is in the ledger but was not counted"
    for key, value in counts.items():
        if key not in entries:
            yield f"{key}: {value} is not in the ledger"
            continue
        was = entries[key].value
        change = (value - was) / max(was, 1)
        if key.quantity in WORK and change > RISE:
            yield f"{key}: rises from {was} to {value} ({change:+.1%}, at most {RISE:+.0%})"
        if key.quantity not in WORK and abs(change) > CHANGE:
            yield f"{key}: changes from {was} to {value} (at most {CHANGE:.1%} either way)"


def text_table(entries: Mapping[Key, Entry], counts: Counts) -> str:
    """Return a table of all counts beside those of the ledger."""
    lines = [f"{'item':45}{'count':>30}{'ledger':>9}{'now':>9}{'change':>8}"]
    for key, value in counts.items():
        was = entries[key].value if key in entries else None
        change = "" if was in {None, value} else f"{value / max(was or 1, 1) - 1:+.1%}"
        told = "-" if was is None else was
        lines.append(
            f"{key.item:45}{key.quantity:>30}{told:>9}{value:>9}{change:>8}".rstrip()
        )
    return "\n".join(lines)


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
    scene = paper.model_copy(
        update={"surface": paper.surface.model_copy(update={"nodes": nodes})}
    )
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
    "concentrated force": lambda: _each(
        surfaces(), delta=15.0, kernel="concentrated-force"
    ),
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
    "hardness of 0.05 E*, given pressure": lambda: _each(
        surfaces(), pressure=0.005, hardness=0.05
    ),
    "hardness of 0.05 E*, ladder of 21 pressures": lambda: bem.ladder(
        surfaces()[0], SIDE, pressures=np.geomspace(1e-4, 1e-2, 21), hardness=0.05
    ),
    "periodic, given Delta": lambda: _each(cells(), delta=5.0, boundary="periodic"),
    "periodic, given pressure": lambda: _each(
        cells(), pressure=0.02, boundary="periodic"
    ),
    "mirror, given Delta": lambda: _each(cells(), delta=5.0, boundary="mirror"),
    "mirror, given pressure": lambda: _each(cells(), pressure=0.02, boundary="mirror"),
    "mirror, nearly full contact": lambda: _each(
        cells(), pressure=0.2, boundary="mirror"
    ),
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
            yielded = sum(
                contact.yielded_percent * contact.pressure.size for contact in contacts
            )
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
        counts[Key(item, "bytes")] = reader.path.stat().st_size
    return counts


def search_counts(database: Path) -> dict[Key, int]:
    """Search the grids of `SEARCHED` on a database, and count the fits that this takes."""
    output = database.parent / "comparison"
    jobs.tune(ComparisonRequest((database,), output, models=SEARCHED), Executor())
    counts = {}
    for name in SEARCHED:
        result = Folder(output / "area").result("tuned", name)
        if result is None or result.search is None:
            raise RuntimeError(f"the search of {name} has left no result in {output}")
        item = f"comparison on the quick scene, {name}"
        counts[Key(item, "candidates scored")] = result.search.candidates_scored
        counts[Key(item, "fits")] = result.search.fits
    return counts


def grid_counts() -> dict[Key, int]:
    """Count candidates and fits of the whole grid of every model, without fitting any."""
    counts = {}
    for model in MODELS.values():
        space = grids.space_of(model.name, "paper").values
        grid = grids.Grid(model, space, INPUTS)
        item = f"grid of Table 2, {model.name}"
        counts[Key(item, "candidates")] = len(grid.candidates)
        counts[Key(item, "candidates that differ")] = len(grid.differing)
        counts[Key(item, "fits")] = FOLDS * len(grid.families)
    return counts
