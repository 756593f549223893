"""Checks of a database: its columns against plan and limits, rows recomputed bit for bit."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Columns, Values
from gen.database import Reader
from gen.generation.plan import parameters, planned_columns
from gen.generation.sample import compute_rows
from gen.schema import REASONS, Reason, Status

CHUNK_ROWS = 65_536
"""Rows that are read and checked together."""

ROUNDING = 1e-9
"""Relative error that rounding can cause in a sum of pressures."""


def faults(path: Path, recompute: int, seed: int = 0) -> Iterator[str]:
    """Find the faults of a database.

    Parameters
    ----------
    path : Path
        The database.
    recompute : int
        Number of finished rows, drawn at random, to compute again.
    seed : int
        Seed of the draw.

    Yields
    ------
    str
        One line for each fault, with the row; nothing for a sound file.

    Raises
    ------
    InputError
        If the file cannot be read or is not a database of this layout.
    """
    with Reader(path) as reader:
        finished = []
        for start in reader.rows[::CHUNK_ROWS]:
            stop = min(start + CHUNK_ROWS, reader.rows.stop)
            status = reader.column("status", start, stop)
            yield from _row_faults(status > Status.FAILED, start, "status is not a known one")
            some = np.flatnonzero(np.isin(status, (Status.DONE, Status.FAILED)))
            if some.size:
                finished.append(start + some)
                yield from _chunk_faults(reader, start, stop, status)
        if finished:
            rows = np.concatenate(finished)
            chosen = np.random.default_rng(seed).permutation(rows)[:recompute]
            for row in np.sort(chosen):
                yield from _recomputed_faults(reader, int(row))


def _chunk_faults(
    reader: Reader, start: int, stop: int, status: NDArray[np.uint8]
) -> Iterator[str]:
    """Compare the columns of a chunk with its plan, and refuse values that are not finite."""
    scene = reader.scene
    done, failed = status == Status.DONE, status == Status.FAILED
    reason = reader.column("reason", start, stop)
    yield from _row_faults(done & (reason != Reason.NONE), start, "done, but has a reason to fail")
    known = np.isin(reason, [code for code in REASONS if code])
    yield from _row_faults(failed & ~known, start, "failed without a known reason")
    plan = parameters(scene, start, stop)
    for name, planned in planned_columns(scene, plan).items():
        unplanned = reader.column(name, start, stop) != planned
        yield from _row_faults((done | failed) & unplanned, start, f"{name} is not the plan's")
    rows: Columns = {}
    for column in reader.columns():
        if column.dtype[0] != "f" or not column.deterministic:
            continue
        if column.shape_of:
            continue  # only recomputation compares fields
        rows[column.name] = reader.column(column.name, start, stop)
        unknown = ~np.isfinite(rows[column.name])
        yield from _row_faults(done & unknown, start, f"{column.name} is not finite")
    nodes = reader.column("contact_nodes", start, stop)
    yield from _range_faults(reader, start, done, rows, nodes)
    if plan.hardness is not None:
        bearable = plan.hardness * scene.spacing**2 * nodes
        yield from _yielding_faults(start, done, rows, bearable)


def _range_faults(
    reader: Reader,
    start: int,
    done: NDArray[np.bool_],
    rows: Columns,
    contact_nodes: NDArray[np.int32],
) -> Iterator[str]:
    """Compare done rows with the limits that hold for every solution."""
    scene = reader.scene
    area, total = rows["area_percent"], scene.nodes**2
    yield from _row_faults(done & ~((area >= 0) & (area <= 100)), start, "area outside 0 to 100 %")
    shares = 100.0 * contact_nodes / total
    yield from _row_faults(done & (area != shares), start, "area is not the share of contact nodes")
    yield from _row_faults(done & ~(rows["force"] >= 0), start, "force is negative")
    loaded = (rows["force"] > 0) == (contact_nodes > 0)
    yield from _row_faults(done & ~loaded, start, "force without contact, or contact without force")
    wide = rows["residual"] > scene.contact.rtol
    yield from _row_faults(done & wide, start, f"residual above {scene.contact.rtol}")


def _yielding_faults(
    start: int, done: NDArray[np.bool_], rows: Columns, bearable: Values
) -> Iterator[str]:
    """Compare done rows with the limits of bodies that yield.

    Parameters
    ----------
    start : int
        Number of the first row.
    done : ndarray of bool, shape (rows,)
        Whether a row is done.
    rows : Columns
        Columns of the rows.
    bearable : ndarray, shape (rows,)
        Force of a contact that has yielded at all its nodes [uN].
    """
    yielded = rows["yielded_percent"]
    shares = (yielded >= 0) & (yielded <= rows["area_percent"])
    yield from _row_faults(done & ~shares, start, "more nodes have yielded than are in contact")
    beyond = rows["force"] > bearable * (1 + ROUNDING)
    yield from _row_faults(done & beyond, start, "force above what the hardness bears")


def _row_faults(wrong: NDArray[np.bool_], start: int, fault: str) -> Iterator[str]:
    """Yield one line for all the rows of a chunk that share a fault."""
    rows = start + np.flatnonzero(wrong)
    if rows.size:
        others = f" and {rows.size - 1} more rows" if rows.size > 1 else ""
        yield f"row {rows[0]}{others}: {fault}"


def _recomputed_faults(reader: Reader, row: int) -> Iterator[str]:
    """Compute a row again, with the other rows of its surface, and compare the bits."""
    m = reader.scene.samples_per_surface
    first = row // m * m
    again = compute_rows(reader.scene, first, min(first + m, reader.scene.samples))
    for column in reader.columns():
        if not column.deterministic:
            continue
        stored = reader.column(column.name, row, row + 1)
        fresh = again[column.name][row - first : row - first + 1]
        if stored.tobytes() != fresh.tobytes():
            detail = "" if column.shape_of else f": {stored[0]!r} in the file, {fresh[0]!r} now"
            yield (
                f"row {row}: {column.name} is not what this machine and these versions compute"
                f"{detail}"
            )
