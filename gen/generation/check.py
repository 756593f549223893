"""Checks of a database: its columns against plan and limits, rows recomputed bit for bit."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bem.problem import pose
from gen.arrays import Columns, Values
from gen.database import Reader
from gen.generation.plan import Parameters, parameters, planned_columns
from gen.generation.sample import compute_rows
from gen.quantities import stored_quantities
from gen.scene import Scene
from gen.schema import (
    DONE_REASONS,
    REASONS,
    STATUS,
    TABLE_1,
    Column,
    Reason,
    Status,
    made_by_another,
)

Mask = NDArray[np.bool_]  # one truth value for each row of a chunk
CHUNK_ROWS = 65_536  # rows that are read and checked together
ROUNDING = 1e-9  # relative error that rounding can cause in a sum of pressures


def faults(path: Path, recompute: int, seed: int = 0) -> Iterator[str]:
    """Yield a line for each fault of a database; `recompute` finished rows are computed again."""
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
            columns = [column for column in reader.columns() if column.deterministic]
            if made_by_another(int(reader.attributes["physics"])):  # the surfaces are the same
                names = {each.name for each in TABLE_1} | {"surface", "heights"}
                columns = [column for column in columns if column.name in names]
            chosen = np.random.default_rng(seed).permutation(rows)[:recompute]
            for row in np.sort(chosen):
                yield from _recomputed_faults(reader, columns, int(row))


def _chunk_faults(
    reader: Reader, start: int, stop: int, status: NDArray[np.uint8]
) -> Iterator[str]:
    """Compare a chunk's columns with its plan, and done rows with what holds for all of them."""
    scene, reason = reader.scene, reader.column("reason", start, stop)
    done, failed = status == Status.DONE, status == Status.FAILED
    plan = parameters(scene, start, stop)
    known = np.isin(reason, [code for code in REASONS if code])
    faults = [
        (done & ~np.isin(reason, DONE_REASONS), "done, but has a reason to fail"),
        (failed & ~known, "failed without a known reason"),
    ]
    for name, values in planned_columns(scene, plan).items():
        unequal = reader.column(name, start, stop) != values
        faults.append(((done | failed) & unequal, f"{name} is not the plan's"))
    rows: Columns = {
        column.name: reader.column(column.name, start, stop)
        for column in reader.columns()
        if column.dtype[0] == "f" and column.deterministic and not column.shape_of
    }
    faults += [(done & wrong, fault) for wrong, fault in _impossible(reader, plan, rows, reason)]
    for wrong, fault in faults:
        yield from _row_faults(wrong, start, fault)


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


def _unlike(rows: Columns, name: str, wanted: Values) -> tuple[Mask, str]:
    """Return where a column is not that of the load, and the words for it."""
    unequal = ~np.isclose(rows[name], wanted, rtol=ROUNDING, atol=0.0)
    return unequal, f"{name} is not that of the load"


def _impossible(
    reader: Reader, plan: Parameters, rows: Columns, reason: NDArray[np.uint8]
) -> Iterator[tuple[Mask, str]]:
    """Compare rows with the bounds of their columns, the solver's promise, and loads and nodes."""
    scene, undefined = reader.scene, reason == Reason.NO_STATISTICS
    statistics = {column.name for column in TABLE_1}
    endless = _infinite_at_full_contact(scene)
    for name, values in rows.items():
        excused = (values == np.inf) & (name in endless)
        excused |= undefined & np.isnan(values) & (name in statistics)
        yield ~np.isfinite(values) & ~excused, f"{name} is not finite"
    missing = np.isnan([rows[name] for name in sorted(statistics)]).any(axis=0)
    yield undefined & ~missing, "statistics are said to be undefined, but are not"
    total, cell = math.prod(scene.grid.shape), math.prod(scene.grid.spacing)
    area, force = rows["area_percent"], rows["force"]
    nodes = reader.column("contact_nodes", plan.first, plan.first + len(force))
    yield ~((area >= 0) & (area <= 100)), "area outside 0 to 100 %"
    yield ~(force >= 0), "force is negative"
    yield area != 100.0 * nodes / total, "area is not the share of contact nodes"
    yield (force > 0) != (nodes > 0), "force without contact, or contact without force"
    yield rows["residual"] > scene.contact.rtol, f"residual above {scene.contact.rtol}"
    match scene.quantity:
        case "force":
            yield _unlike(rows, "force", plan.load)
        case "pressure":
            yield _unlike(rows, "force", plan.load * (total * cell))
        case "delta/height_rms":
            yield _unlike(rows, "delta", plan.load * rows["height_rms"])
    if plan.hardness is not None:
        yielded = rows["yielded_percent"]
        yield ~((yielded >= 0) & (yielded <= area)), "more nodes have yielded than are in contact"
        bearable = plan.hardness * cell * nodes
        yield force > bearable * (1 + ROUNDING), "force above what the hardness bears"


def _row_faults(wrong: Mask, start: int, fault: str) -> Iterator[str]:
    """Yield one line for all the rows of a chunk that share a fault."""
    rows = start + np.flatnonzero(wrong)
    if rows.size:
        others = f" and {rows.size - 1} more rows" if rows.size > 1 else ""
        yield f"row {rows[0]}{others}: {fault}"


def _recomputed_faults(reader: Reader, columns: Sequence[Column], row: int) -> Iterator[str]:
    """Compute a row again, with the other rows of its surface, and compare the bits."""
    m = reader.scene.samples_per_surface
    first = row // m * m
    again = compute_rows(reader.scene, first, min(first + m, reader.scene.samples))
    for column in columns:
        stored = reader.column(column.name, row, row + 1)
        fresh = again[column.name][row - first : row - first + 1]
        # Rows with undefined statistics were failed rows once.
        if column is STATUS and again["reason"][row - first] == Reason.NO_STATISTICS:
            continue
        if stored.tobytes() != fresh.tobytes():
            old, new = (each[0].tolist() for each in (stored, fresh))  # Python's own numbers
            detail = "" if column.shape_of else f": {old!r} in the file, {new!r} now"
            yield (
                f"row {row}: {column.name} is not what this machine and these versions compute"
                f"{detail}"
            )
