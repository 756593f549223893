"""Checks of a database, and its repair.

Every finished row, which is a done or a failed one, is compared with its checksum, with the plan
and with physical limits. Some of these rows are computed again and compared bit for bit.
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

Mask = NDArray[np.bool_]
"""One truth value for each row of a chunk, shape (rows,)."""

CHUNK_ROWS = 65_536
"""Number of rows that are read and checked together."""

ROUNDING = 1e-9
"""Largest relative error of a force or a displacement that rounding can explain."""


@dataclass(frozen=True, eq=False)
class Fault:
    """Rows of a database with the same fault, and the fault in words."""

    rows: Indices  # numbers of the rows in ascending order, at least one; shape (k,)
    words: str  # the fault, without the rows
    # Whether the content of the file is wrong. It is False if checksums show that the file is as it
    # was written, and only this machine or these versions compute other bits.
    damaged: bool = True

    def __str__(self) -> str:
        """Return one line with the first row, the number of further rows and the fault."""
        if self.rows.size == 1:
            return f"row {self.rows[0]}: {self.words}"
        return f"row {self.rows[0]} and {self.rows.size - 1} more rows: {self.words}"


class Repair(NamedTuple):
    """Rows that a repair has changed, and rows that it has left."""

    # Numbers of the rows that were damaged and are pending now, shape (k,).
    pending: Indices
    left_faulty: Indices  # numbers of the rows that still have faults, shape (m,)


class _Violation(NamedTuple):
    """A rule for the rows of a chunk that some rows may break."""

    rows: Mask  # whether each row breaks the rule; all False if no row does
    words: str  # what is wrong with a row that breaks it


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Consecutive rows of a database, with everything that the rules compare."""

    scene: Scene
    plan: Plan  # of these rows, drawn anew
    columns: Columns  # the deterministic columns of one value a row, by their names
    numbers: list[str]  # names of the columns among them that hold floating-point numbers

    @classmethod
    def read(
        cls, reader: Reader, start: int, stop: int, status: NDArray[np.uint8]
    ) -> "_Chunk":
        """Read the rows start to stop - 1, and draw their plan again.

        `status` are the statuses of these rows, shape (rows,), which the caller has read before.
        """
        columns: Columns = {}
        numbers = []
        for column in reader.columns():
            is_field = column.shape_of != ""
            if column.deterministic and not is_field:
                columns[column.name] = reader.column(column.name, start, stop)
                if column.dtype[0] == "f":
                    numbers.append(column.name)
        # A run that still writes the file may have finished rows since the caller read the status.
        # The earlier status keeps these rows out of the checks.
        columns[STATUS.name] = status
        plan = parameters(reader.scene, start, stop)
        return cls(scene=reader.scene, plan=plan, columns=columns, numbers=numbers)


def faults(path: Path, recompute: int, seed: int = 0) -> Iterator[Fault]:
    """Check all finished rows of a database, and compute some of them again.

    Parameters
    ----------
    path : Path
        Database.
    recompute : int
        Number of finished rows that are chosen at random and computed again. Rows with a wrong
        checksum are left out after the choice, so fewer rows may be computed.
    seed : int
        Seed of this choice.

    Yields
    ------
    Fault
        Each fault with its rows, as soon as it is known. A row can have several faults.

    Raises
    ------
    InputError
        If the file is no database.
    SourceError
        If rows are to be computed again, and an original map is missing or has changed, or a user's
        function fails or is not trusted. It is a kind of InputError.
    """
    finished = []  # numbers of the finished rows, one array for each chunk
    damaged = []  # numbers of the rows with a wrong checksum, one array for each chunk
    with Reader(path) as reader:
        for start in reader.rows[::CHUNK_ROWS]:
            stop = min(start + CHUNK_ROWS, reader.rows.stop)
            status = reader.column("status", start, stop)
            unknown = _Violation(
                rows=status > Status.FAILED, words="status is not a known one"
            )
            yield from _faults_of(unknown, start)
            positions = np.flatnonzero(np.isin(status, (Status.DONE, Status.FAILED)))
            if not positions.size:
                continue  # no row of this chunk is finished
            rows = reader.damaged_rows(start, stop)
            if rows.size:
                yield Fault(rows=rows, words="checksum is not that of the row's bytes")
            chunk = _Chunk.read(reader, start, stop, status)
            for violation in _violations(chunk):
                yield from _faults_of(violation, start)
            finished.append(start + positions)
            damaged.append(rows)
        if not finished:
            return  # there is no row to compute again
        if recompute:
            # The surfaces are made from the original files of maps, not from the prepared copies
            # that a run keeps, because these may be damaged.
            reader.scene.surface.make_ready(path.parent, sources=True)
        random = np.random.default_rng(seed)
        chosen = random.permutation(np.concatenate(finished))[:recompute]
        columns = _compared_columns(reader)
        for row in np.setdiff1d(chosen, np.concatenate(damaged)):
            yield from _recomputed_faults(reader, columns, int(row))


def repair(path: Path, faults: Sequence[Fault]) -> Repair:
    """Make the damaged rows of a database pending, so that the next run computes them again.

    No row is changed if another physics number computed the database, because this version cannot
    compute its rows again. Rows whose faults are not damage are not changed either.

    Parameters
    ----------
    path : Path
        Database. The caller holds its `gen.database.lock`, and has held it since before it looked
        for the faults.
    faults : sequence of Fault
        Faults of the database, from the function `faults`.

    Returns
    -------
    Repair
        Rows that are pending now, and rows that still have faults.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with Reader(path) as reader:
        scene = reader.scene
        other_physics = made_by_other_solver(int(reader.attributes["physics"]))
    faulty = _union([fault.rows for fault in faults])
    damaged = []
    if not other_physics:
        damaged = [fault.rows for fault in faults if fault.damaged]
    pending = _union(damaged)
    if pending.size:
        with Writer(path, scene) as writer:
            writer.make_pending(pending)
    return Repair(pending=pending, left_faulty=np.setdiff1d(faulty, pending))


def _union(arrays: Sequence[Indices]) -> Indices:
    """Join arrays of row numbers into one, in ascending order and each number once.

    The result is empty if there are no arrays.
    """
    return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *arrays]))


def _faults_of(violation: _Violation, start: int) -> Iterator[Fault]:
    """Yield one fault with all rows that break a rule, or nothing if no row does.

    `start` is the number of the first row of the chunk.
    """
    rows = start + np.flatnonzero(violation.rows)
    if rows.size:
        yield Fault(rows=rows, words=violation.words)


def _violations(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield every rule for finished rows, with the rows of a chunk that break it.

    Pending rows break no rule. Rules about reasons and the plan hold for done and failed rows, and
    rules about results only for done rows.
    """
    done = chunk.columns["status"] == Status.DONE
    failed = chunk.columns["status"] == Status.FAILED
    reason = chunk.columns["reason"]
    may_be_done = np.isin(reason, DONE_REASONS)
    may_have_failed = np.isin(reason, [code for code in REASONS if code != Reason.NONE])
    yield _Violation(rows=done & ~may_be_done, words="done, but has a reason to fail")
    yield _Violation(
        rows=failed & ~may_have_failed, words="failed without a known reason"
    )
    for name, planned in planned_columns(chunk.scene, chunk.plan).items():
        unequal = chunk.columns[name] != planned
        yield _Violation(
            rows=(done | failed) & unequal, words=f"{name} is not the plan's"
        )
    for rules in (_rules_of_finite_numbers, _contact_rules, _load_rules, _hardness_rules):
        for violation in rules(chunk):
            yield _Violation(rows=done & violation.rows, words=violation.words)


def _rules_of_finite_numbers(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield, for each column of floating-point numbers, the rows whose number is not finite.

    Two kinds of numbers are allowed: NaN in a statistic if the row has the reason NO_STATISTICS,
    and infinity in a quantity that is infinite at full contact. The last rule finds rows with the
    reason NO_STATISTICS whose statistics are all defined. The rules hold for done rows; the caller
    removes the other ones.
    """
    undefined = chunk.columns["reason"] == Reason.NO_STATISTICS
    statistics = {column.name for column in TABLE_1}
    may_be_infinite = _infinite_at_full_contact(chunk.scene)
    for name in chunk.numbers:
        values = chunk.columns[name]
        allowed = np.isfinite(values)
        if name in may_be_infinite:
            allowed |= values == np.inf
        if name in statistics:
            allowed |= undefined & np.isnan(values)
        yield _Violation(rows=~allowed, words=f"{name} is not finite")
    # One array for each statistic; together of shape (statistics, rows).
    columns = [chunk.columns[name] for name in sorted(statistics)]
    has_undefined_statistic = np.isnan(columns).any(axis=0)
    yield _Violation(
        rows=undefined & ~has_undefined_statistic,
        words="statistics are said to be undefined, but are not",
    )


def _infinite_at_full_contact(scene: Scene) -> set[str]:
    """Return the names of the quantities that are infinite at full contact of a scene's patches."""
    contact = scene.contact
    # Only grid, boundary, kernel, far field and what a layer lies on decide: a flat surface without
    # load is enough.
    problem = pose(
        np.zeros(scene.grid.shape),
        scene.grid.sides,
        delta=None,
        force=0.0,
        spacing=scene.grid.spacing,
        boundary=contact.boundary,
        kernel=contact.kernel,
        far_field=contact.far_field,
        body=contact.body({}),
    )
    return {
        quantity.name
        for quantity in stored_quantities()
        if quantity.diverges and quantity.is_infinite_at_full_contact(problem)
    }


def _contact_rules(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield the rules for area, force, number of contact nodes and residual of a solved contact.

    The caller removes rows that are not done.
    """
    area = chunk.columns["area_percent"]
    force = chunk.columns["force"]
    nodes = chunk.columns["contact_nodes"]
    share = 100.0 * nodes / math.prod(chunk.scene.grid.shape)  # [%]
    rtol = chunk.scene.contact.rtol
    # `~(... >= 0)` is also true for NaN.
    yield _Violation(rows=~((area >= 0) & (area <= 100)), words="area outside 0 to 100 %")
    yield _Violation(rows=~(force >= 0), words="force is negative")
    yield _Violation(rows=area != share, words="area is not the share of contact nodes")
    yield _Violation(
        rows=(force > 0) != (nodes > 0),
        words="force without contact, or contact without force",
    )
    yield _Violation(
        rows=chunk.columns["residual"] > rtol, words=f"residual above {rtol}"
    )


def _load_rules(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield the rule that the force or Delta of a contact is its planned load.

    Two quantities of the load have no rule here. A planned Delta is itself a column that has been
    compared with the plan. A pressure over the rms slope is not checked. The caller removes rows
    that are not done.
    """
    load = chunk.plan.load  # in the scene's quantity
    grid = chunk.scene.grid
    match chunk.scene.quantity:
        case "force":
            yield _not_of_the_load(chunk, "force", expected=load)
        case "pressure":
            area = math.prod(grid.shape) * math.prod(grid.spacing)  # [um2]
            yield _not_of_the_load(chunk, "force", expected=load * area)
        case "delta/height_rms":
            delta = load * chunk.columns["height_rms"]  # [um]
            yield _not_of_the_load(chunk, "delta", expected=delta)


def _not_of_the_load(chunk: _Chunk, name: str, expected: Values) -> _Violation:
    """Return the rule that a column has the values expected from the loads, but for rounding.

    `expected` are the values in the unit of the column `name`, shape (rows,).
    """
    equal = np.isclose(chunk.columns[name], expected, rtol=ROUNDING, atol=0.0)
    return _Violation(rows=~equal, words=f"{name} is not that of the load")


def _hardness_rules(chunk: _Chunk) -> Iterator[_Violation]:
    """Yield the rules for yielded nodes and for the force of bodies with a hardness.

    Elastic bodies have none of these rules. The caller removes rows that are not done.
    """
    hardness = chunk.plan.hardness
    if hardness is None:
        return  # elastic bodies
    yielded = chunk.columns["yielded_percent"]
    area = chunk.columns["area_percent"]
    nodes = chunk.columns["contact_nodes"]
    area_of_node = math.prod(chunk.scene.grid.spacing)  # [um2]
    largest_force = hardness * area_of_node * nodes  # [uN]
    yield _Violation(
        rows=~((yielded >= 0) & (yielded <= area)),
        words="more nodes have yielded than are in contact",
    )
    yield _Violation(
        rows=chunk.columns["force"] > largest_force * (1 + ROUNDING),
        words="force above what the hardness bears",
    )


def _compared_columns(reader: Reader) -> list[Column]:
    """Return the columns whose bits have to be equal if a row is computed again.

    These are all deterministic columns but the checksum. If another solver made the database, they
    are the columns of the surfaces alone.
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
    """Compute a row again, and yield a fault for each of `columns` whose bits differ.

    `row` is its number. All rows of its surface are computed with it. If the file has checksums,
    the caller has found that the row's checksum is right. A difference is no damage then: another
    machine or other versions have computed the row.
    """
    scene = reader.scene
    per_surface = scene.samples_per_surface
    first = row // per_surface * per_surface  # first row of the surface
    computed = compute_rows(scene, first, min(first + per_surface, scene.samples))
    position = row - first
    for column in columns:
        stored = reader.column(column.name, row, row + 1)
        fresh = computed[column.name][position : position + 1]
        # Older versions called rows with undefined statistics failed, this one calls them done.
        if column is STATUS and computed["reason"][position] == Reason.NO_STATISTICS:
            continue
        if stored.tobytes() == fresh.tobytes():
            continue
        words = f"{column.name} is not what this machine and these versions compute"
        if not column.shape_of:  # a field has too many numbers for a message
            # Python's own numbers print without the name of their type.
            old = stored[0].tolist()
            new = fresh[0].tolist()
            words += f": {old!r} in the file, {new!r} now"
        yield Fault(rows=np.array([row]), words=words, damaged=not reader.has_checksums)
