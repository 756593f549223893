"""What a disturbed database has to hold: the rows of an undisturbed one, once computed for good."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.scene.columns import ALL_COLUMNS
from gen.schema import Status

Columns = dict[str, NDArray[Any]]


def columns_of(path: Path) -> Columns | None:
    """All columns of a database, into memory; None where there is no file yet."""
    if not path.exists():
        return None
    with Reader(path) as reader:
        return {column.name: reader.column(column.name) for column in reader.columns()}


def finished(columns: Columns | None) -> NDArray[np.bool_]:
    """(rows,) whether a row is done or failed; no rows in no file."""
    if columns is None:
        return np.zeros(0, dtype=bool)
    return np.asarray(columns["status"] != Status.PENDING)


def count_finished(columns: Columns | None) -> int:
    """Number of rows that are done or failed."""
    return int(np.count_nonzero(finished(columns)))


def row_fault(
    before: Columns | None,
    now: Columns | None,
    reference: Columns,
    failed: dict[int, int] | None = None,
) -> str:
    """What is wrong with the finished rows of a database after a disturbance, "" if nothing is.

    Parameters
    ----------
    before, now : its columns before and after, None for no file
    reference : the columns of an undisturbed run of the same scene
    failed : rows that have to have failed, and the code of the reason that they have to give
    """
    if now is None:
        return "" if before is None else "the database has vanished"
    expected = failed or {}
    for row, reason in expected.items():
        if (now["status"][row], now["reason"][row]) != (Status.FAILED, reason):
            return f"row {row} should have failed for reason {reason}"
    done = finished(now)
    done[list(expected)] = False
    for name in deterministic(now):
        if now[name][done].tobytes() != reference[name][done].tobytes():
            return f"a finished row has a wrong {name}"
    if before is not None:
        old = finished(before)
        if not finished(now)[old].all():
            return "a finished row is pending again"
        if now["solve_seconds"][old].tobytes() != before["solve_seconds"][old].tobytes():
            return "a finished row was computed again"
    return ""


def difference(now: Columns | None, reference: Columns) -> str:
    """How a finished database differs from the undisturbed one, "" if it does not."""
    if now is None:
        return "the finished database does not exist"
    for name in deterministic(reference):
        if now[name].tobytes() != reference[name].tobytes():
            return f"the finished database has another {name} than the undisturbed one"
    return ""


def deterministic(columns: Columns) -> list[str]:
    """Names of the columns that the scene alone decides."""
    names = {column.name for column in ALL_COLUMNS if column.deterministic}
    return [name for name in columns if name in names]
