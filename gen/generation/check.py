"""Checks of a database: its columns against plan and limits, rows recomputed bit for bit."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Columns, Values
from gen.database import Reader
from gen.generation.plan import parameters, planned_columns
from gen.generation.sample import compute_rows
from gen.scene import Scene
from gen.schema import (
    DONE_REASONS,
    INFINITE_AT_FULL_CONTACT,
    REASONS,
    STATUS,
    Reason,
    Status,
    statistics_columns,
)

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
        if finished and recompute:
            reader.scene.surface.make_ready(path.parent, sources=True)
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
    solved = np.isin(reason, DONE_REASONS)
    yield from _row_faults(done & ~solved, start, "done, but has a reason to fail")
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
    yield from _finite_faults(start, done, reason == Reason.NO_STATISTICS, rows)
    nodes = reader.column("contact_nodes", start, stop)
    yield from _range_faults(reader, start, done, rows, nodes)
    yield from _load_faults(scene, plan.load, start, done, rows)
    if plan.hardness is not None:
        bearable = plan.hardness * (scene.spacing[0] * scene.spacing[1]) * nodes
        yield from _yielding_faults(start, done, rows, bearable)


def _finite_faults(
    start: int, done: NDArray[np.bool_], undefined: NDArray[np.bool_], rows: Columns
) -> Iterator[str]:
    """Refuse values that are not finite in done rows, but for statistics that are undefined.

    A stiffness may be infinite.

    Parameters
    ----------
    start : int
        Number of the first row.
    done, undefined : ndarray of bool, shape (rows,)
        Whether a row is done, and whether its reason says that statistics are undefined.
    rows : Columns
        Columns of the rows.
    """
    statistics = {column.name for column in statistics_columns()}
    missing = np.zeros_like(undefined)
    for name, values in rows.items():
        excused = undefined & np.isnan(values) if name in statistics else np.zeros_like(undefined)
        missing |= excused
        if name in INFINITE_AT_FULL_CONTACT:
            excused |= values == np.inf
        unknown = ~np.isfinite(values) & ~excused
        yield from _row_faults(done & unknown, start, f"{name} is not finite")
    groundless = done & undefined & ~missing
    yield from _row_faults(groundless, start, "statistics are said to be undefined, but are not")


def _range_faults(
    reader: Reader,
    start: int,
    done: NDArray[np.bool_],
    rows: Columns,
    contact_nodes: NDArray[np.int32],
) -> Iterator[str]:
    """Compare done rows with the limits that hold for every solution."""
    scene = reader.scene
    area, total = rows["area_percent"], math.prod(scene.shape)
    yield from _row_faults(done & ~((area >= 0) & (area <= 100)), start, "area outside 0 to 100 %")
    shares = 100.0 * contact_nodes / total
    yield from _row_faults(done & (area != shares), start, "area is not the share of contact nodes")
    yield from _row_faults(done & ~(rows["force"] >= 0), start, "force is negative")
    loaded = (rows["force"] > 0) == (contact_nodes > 0)
    yield from _row_faults(done & ~loaded, start, "force without contact, or contact without force")
    wide = rows["residual"] > scene.contact.rtol
    yield from _row_faults(done & wide, start, f"residual above {scene.contact.rtol}")


def _load_faults(
    scene: Scene, load: Values, start: int, done: NDArray[np.bool_], rows: Columns
) -> Iterator[str]:
    """Compare done rows with their loads; that of a pressure over E* and slope is not stored.

    Parameters
    ----------
    scene : Scene
        Scene of the rows.
    load : ndarray, shape (rows,)
        Loads in the scene's quantity.
    start : int
        Number of the first row.
    done : ndarray of bool, shape (rows,)
        Whether a row is done.
    rows : Columns
        Columns of the rows.
    """
    patch = math.prod(scene.shape) * math.prod(scene.spacing)
    asked = {
        "force": ("force", load),
        "pressure": ("force", load * patch),
        "delta/height_rms": ("delta", load * rows["height_rms"]),
    }
    if scene.quantity in asked:
        name, wanted = asked[scene.quantity]
        unequal = ~np.isclose(rows[name], wanted, rtol=ROUNDING, atol=0.0)
        yield from _row_faults(done & unequal, start, f"{name} is not that of the load")


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
    """Compute a row again, with the other rows of its surface, and compare the bits.

    Rows with undefined statistics were failed rows once; those of older files stay sound.
    """
    m = reader.scene.samples_per_surface
    first = row // m * m
    again = compute_rows(reader.scene, first, min(first + m, reader.scene.samples))
    for column in reader.columns():
        if not column.deterministic:
            continue
        stored = reader.column(column.name, row, row + 1)
        fresh = again[column.name][row - first : row - first + 1]
        if column is STATUS and again["reason"][row - first] == Reason.NO_STATISTICS:
            continue
        if stored.tobytes() != fresh.tobytes():
            old, new = (each[0].tolist() for each in (stored, fresh))  # Python's own numbers
            detail = "" if column.shape_of else f": {old!r} in the file, {new!r} now"
            yield (
                f"row {row}: {column.name} is not what this machine and these versions compute"
                f"{detail}"
            )
