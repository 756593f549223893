"""Checks of a database, and its repair.

Every finished row is compared with its checksum, the plan and limits, and some rows are computed
again and compared bit for bit.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bem.problem import pose
from gen.arrays import Columns, Indices, Values
from gen.database import Reader, Writer
from gen.generation.plan import Plan, parameters, planned_columns
from gen.generation.sample import compute_rows
from gen.quantities import stored_quantities
from gen.scene import Scene
from gen.schema import (
    CHECKSUM,
    DONE_REASONS,
    REASONS,
    STATUS,
    TABLE_1,
    Column,
    Reason,
    Status,
    made_by_other_solver,
)

Mask = NDArray[np.bool_]  # one truth value for each row of a chunk
CHUNK_ROWS = 65_536  # rows that are read and checked together
ROUNDING = 1e-9  # relative error that rounding can cause in a sum of pressures


@dataclass(frozen=True, eq=False)
class Fault:
    """Something wrong with rows of a database, in words."""

    rows: Indices  # (k,), numbers of the rows
    words: str
    # False if the file has the bytes that were written, and this machine computes other last bits.
    damaged: bool = True

    def __str__(self) -> str:
        """Return one line for all rows."""
        if self.rows.size == 1:
            return f"row {self.rows[0]}: {self.words}"
        return f"row {self.rows[0]} and {self.rows.size - 1} more rows: {self.words}"


class Repair(NamedTuple):
    """What a repair has done with the rows that have faults."""

    pending: Indices  # (k,), rows that were damaged and are pending now
    left_faulty: Indices  # (m,), rows that still have faults


class _Violation(NamedTuple):
    """Rows of a chunk that break a rule, and the words for it."""

    rows: Mask
    words: str


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Consecutive rows of a database, as far as checks read them."""

    scene: Scene
    plan: Plan
    columns: Columns  # all deterministic columns but fields
    numbers: list[str]  # names of those of them that hold floats

    @classmethod
    def read(
        cls, reader: Reader, start: int, stop: int, status: NDArray[np.uint8]
    ) -> "_Chunk":
        """Read the rows start to stop - 1, whose status is known, and draw their plan again."""
        columns: Columns = {}
        numbers = []
        for column in reader.columns():
            if column.deterministic and not column.shape_of:
                columns[column.name] = reader.column(column.name, start, stop)
                if column.dtype[0] == "f":
                    numbers.append(column.name)
        # A run that goes on writing may have finished rows since the status was read.
        columns[STATUS.name] = status
        plan = parameters(reader.scene, start, stop)
        return cls(reader.scene, plan, columns, numbers)


def faults(path: Path, recompute: int, seed: int = 0) -> Iterator[Fault]:
    """Check all finished rows of a database, and compute some of them again.

    Parameters
    ----------
    path : Path
        Database.
    recompute : int
        Number of finished rows that are computed again.
    seed : int
        Seed of the choice of these rows.

    Yields
    ------
    Fault
        Each fault with its rows, as soon as it is known.

    Raises
    ------
    InputError
        If the file is no database, or rows are to be computed again and what their surfaces need is
        missing. SourceError, an InputError, if they need a user's function that fails or is not
        trusted.
    """
    finished = []
    damaged = []
    with Reader(path) as reader:
        for start in reader.rows[::CHUNK_ROWS]:
            stop = min(start + CHUNK_ROWS, reader.rows.stop)
            status = reader.column("status", start, stop)
            unknown = _Violation(status > Status.FAILED, "status is not a known one")
            yield from _faults_of(unknown, start)
            positions = np.flatnonzero(np.isin(status, (Status.DONE, Status.FAILED)))
            if not positions.size:
                continue
            rows = reader.damaged_rows(start, stop)
            if rows.size:
                yield Fault(rows, "checksum is not that of the row's bytes")
            for violation in _violations(_Chunk.read(reader, start, stop, status)):
                yield from _faults_of(violation, start)
            finished.append(start + positions)
            damaged.append(rows)
        if not finished:
            return
        if recompute:
            reader.scene.surface.make_ready(path.parent, sources=True)
        random = np.random.default_rng(seed)
        chosen = random.permutation(np.concatenate(finished))[:recompute]
        columns = _compared_columns(reader)
        for row in np.setdiff1d(chosen, np.concatenate(damaged)):
            yield from _recomputed_faults(reader, columns, int(row))


def repair(path: Path, faults: Sequence[Fault]) -> Repair:
    """Make damaged rows pending, so that the next run computes them again.

    Rows that another physics number computed stay as they are: this version cannot compute them.

    Parameters
    ----------
    path : Path
        Database, whose `gen.database.lock` the caller has held since it found the faults.
    faults : sequence of Fault
        Faults of the database, from the function `faults`.

    Returns
    -------
    Repair
        Rows that were made pending, and rows that stay as they were.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with Reader(path) as reader:
        scene = reader.scene
        other_physics = made_by_other_solver(int(reader.attributes["physics"]))
    faulty = _union([fault.rows for fault in faults])
    pending = _union([])
    if not other_physics:
        pending = _union([fault.rows for fault in faults if fault.damaged])
    if pending.size:
        with Writer(path, scene) as writer:
            writer.make_pending(pending)
    return Repair(pending, np.setdiff1d(faulty, pending))


def _union(rows: Sequence[Indices]) -> Indices:
    """Return the row numbers that are in one of several arrays or more, in ascending order."""
    return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *rows]))


def _faults_of(violation: _Violation, start: int) -> Iterator[Fault]:
    """Yield one fault for all rows of a violation, if there are any, in a chunk from `start` on."""
    rows = start + np.flatnonzero(violation.rows)
    if rows.size:
        yield Fault(rows, violation.words)


def _violations(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield the rules that finished rows of a chunk have to keep, with the rows that break them."""
    done = chunk.columns["status"] == Status.DONE
    failed = chunk.columns["status"] == Status.FAILED
    reason = chunk.columns["reason"]
    has_done_reason = np.isin(reason, DONE_REASONS)
    has_reason = np.isin(reason, [code for code in REASONS if code != Reason.NONE])
    yield _Violation(done & ~has_done_reason, "done, but has a reason to fail")
    yield _Violation(failed & ~has_reason, "failed without a known reason")
    for name, values in planned_columns(chunk.scene, chunk.plan).items():
        unequal = chunk.columns[name] != values
        yield _Violation((done | failed) & unequal, f"{name} is not the plan's")
    for rules in (_not_finite, _contact_rules, _load_rules, _hardness_rules):
        for violation in rules(chunk):
            yield _Violation(done & violation.rows, violation.words)


def _not_finite(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield columns with numbers that are not finite though they have to be.

    Statistics may be undefined, with their reason; some results are infinite at full contact.
    """
    undefined = chunk.columns["reason"] == Reason.NO_STATISTICS
    statistics = {column.name for column in TABLE_1}
    may_be_infinite = _infinite_at_full_contact(chunk.scene)
    for name in chunk.numbers:
        values = chunk.columns[name]
        excused = (values == np.inf) & (name in may_be_infinite)
        if name in statistics:
            excused |= undefined & np.isnan(values)
        yield _Violation(~np.isfinite(values) & ~excused, f"{name} is not finite")
    columns = [chunk.columns[name] for name in sorted(statistics)]
    missing = np.isnan(columns).any(axis=0)
    yield _Violation(
        undefined & ~missing, "statistics are said to be undefined, but are not"
    )


def _infinite_at_full_contact(scene: Scene) -> set[str]:
    """Return the columns that are infinite at full contact of a scene's patches."""
    contact = scene.contact
    problem = pose(
        np.zeros(scene.grid.shape),
        scene.grid.sides,
        None,
        force=0.0,
        spacing=scene.grid.spacing,
        boundary=contact.boundary,
        kernel=contact.kernel,
        far_field=contact.far_field,
    )
    return {
        quantity.name
        for quantity in stored_quantities()
        if quantity.diverges and quantity.is_infinite_at_full_contact(problem)
    }


def _contact_rules(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield the bounds of area, force and nodes, how they belong together, and the residual."""
    area = chunk.columns["area_percent"]
    force = chunk.columns["force"]
    nodes = chunk.columns["contact_nodes"]
    share = 100.0 * nodes / math.prod(chunk.scene.grid.shape)
    rtol = chunk.scene.contact.rtol
    yield _Violation(~((area >= 0) & (area <= 100)), "area outside 0 to 100 %")
    yield _Violation(~(force >= 0), "force is negative")
    yield _Violation(area != share, "area is not the share of contact nodes")
    yield _Violation(
        (force > 0) != (nodes > 0), "force without contact, or contact without force"
    )
    yield _Violation(chunk.columns["residual"] > rtol, f"residual above {rtol}")


def _load_rules(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield rows whose force or Delta does not belong to the planned load in the column `load`.

    A planned Delta has been compared itself; a load over the slope is not checked here.
    """
    load = chunk.plan.load
    grid = chunk.scene.grid
    match chunk.scene.quantity:
        case "force":
            yield _not_of_the_load(chunk, "force", load)
        case "pressure":
            area = math.prod(grid.shape) * math.prod(grid.spacing)  # [um2]
            yield _not_of_the_load(chunk, "force", load * area)
        case "delta/height_rms":
            delta = load * chunk.columns["height_rms"]
            yield _not_of_the_load(chunk, "delta", delta)


def _not_of_the_load(chunk: _Chunk, name: str, expected: Values) -> _Violation:
    """Return the rows whose value of a column differs from the load by more than rounding."""
    equal = np.isclose(chunk.columns[name], expected, rtol=ROUNDING, atol=0.0)
    return _Violation(~equal, f"{name} is not that of the load")


def _hardness_rules(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield the bounds of yielded nodes and of the force, where bodies have a hardness."""
    hardness = chunk.plan.hardness
    if hardness is None:
        return
    yielded = chunk.columns["yielded_percent"]
    area = chunk.columns["area_percent"]
    nodes = chunk.columns["contact_nodes"]
    largest_force = hardness * math.prod(chunk.scene.grid.spacing) * nodes
    yield _Violation(
        ~((yielded >= 0) & (yielded <= area)),
        "more nodes have yielded than are in contact",
    )
    yield _Violation(
        chunk.columns["force"] > largest_force * (1 + ROUNDING),
        "force above what the hardness bears",
    )


def _compared_columns(reader: Reader) -> list[Column]:
    """Return the columns that computing a row again has to give with the same bits.

    If another solver made the database, these are the columns of the surfaces alone.
    """
    columns = [
        column
        for column in reader.columns()
        if column.deterministic and column != CHECKSUM
    ]
    if not made_by_other_solver(int(reader.attributes["physics"])):
        return columns
    of_surfaces = {"surface", "heights", *(column.name for column in TABLE_1)}
    return [column for column in columns if column.name in of_surfaces]


def _recomputed_faults(
    reader: Reader, columns: Sequence[Column], row: int
) -> Iterator[Fault]:
    """Compute a row again, with the other rows of its surface, and compare the bits.

    Where checksums vouch for the bytes, other bits are those of another machine or other versions.
    """
    m = reader.scene.samples_per_surface
    first = row // m * m
    computed = compute_rows(reader.scene, first, min(first + m, reader.scene.samples))
    position = row - first
    for column in columns:
        stored = reader.column(column.name, row, row + 1)
        fresh = computed[column.name][position : position + 1]
        # Rows with undefined statistics were failed rows once.
        if column is STATUS and computed["reason"][position] == Reason.NO_STATISTICS:
            continue
        if stored.tobytes() != fresh.tobytes():
            words = f"{column.name} is not what this machine and these versions compute"
            if not column.shape_of:
                # Python's own numbers, which print without their type.
                old = stored[0].tolist()
                new = fresh[0].tolist()
                words += f": {old!r} in the file, {new!r} now"
            yield Fault(np.array([row]), words, damaged=not reader.has_checksums)
