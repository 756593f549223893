"""Columns of a database as tables of Arrow, a chunk of rows at a time."""

import json
from collections.abc import Iterator

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from gen.database import Reader
from gen.database.layout import chunks
from gen.schema import STATUS, Column, Status

Mask = NDArray[np.bool_]
"""One truth value for each row of a file."""

KEPT_BACK = frozenset(("status", "rank", "host"))
"""Columns that are not exported: the status, since all exported rows are done, and the machine that
computed a row, which is private.
"""

TABLE_ROWS = 50_000
"""Number of rows that are in memory at once, and in one row group of a file."""


def scalars(reader: Reader) -> list[Column]:
    """Return the columns with one value a row, in the order of the database."""
    wanted = [column for column in reader.columns() if column.name not in KEPT_BACK]
    return [column for column in wanted if not column.shape_of]


def fields(reader: Reader) -> list[Column]:
    """Return the columns with one field of nx x ny nodes a row."""
    return [column for column in reader.columns() if column.shape_of]


def schema_of(reader: Reader, columns: list[Column]) -> pa.Schema:
    """Return the schema of Arrow for columns, with units and meanings in its metadata.

    Parameters
    ----------
    reader : Reader
        Database.
    columns : list of Column
        Columns of the table beside `sample`, the index of the row in the scene.

    Returns
    -------
    pyarrow.Schema
        Types, with the keys `unit` and `long_name` in the metadata of every column.
    """
    sample = pa.field(
        "sample",
        pa.int64(),
        nullable=False,
        metadata=_metadata("1", "index of the row in the scene"),
    )
    return pa.schema([sample, *(_field(reader, column) for column in columns)])


def _field(reader: Reader, column: Column) -> pa.Field:
    """Return type and metadata of a column; a field of nodes is a list of fixed length."""
    kind = pa.from_numpy_dtype(np.dtype(column.dtype))
    metadata = _metadata(column.unit, column.long_name)
    if column.shape_of:
        shape = reader.scene.shape
        kind = pa.list_(kind, shape[0] * shape[1])
        metadata["shape"] = json.dumps(shape)
    return pa.field(column.name, kind, nullable=False, metadata=metadata)


def _metadata(unit: str, long_name: str) -> dict[str, str]:
    """Return the metadata of a column."""
    return {"unit": unit, "long_name": long_name}


def done_rows(reader: Reader) -> Mask:
    """Tell which rows of a database are done.

    Parameters
    ----------
    reader : Reader
        Database, perhaps of a run that goes on.

    Returns
    -------
    ndarray of bool, shape (rows,)
        Whether each row of the file is done at this moment.
    """
    return np.asarray(reader.column(STATUS.name) == Status.DONE)


def tables(reader: Reader, schema: pa.Schema, part: range, done: Mask) -> Iterator[pa.Table]:
    """Read the done rows among some rows, a few megabytes at a time.

    Parameters
    ----------
    reader : Reader
        Database.
    schema : pyarrow.Schema
        Schema of the columns, from `schema_of`.
    part : range
        Rows, by their indices in the scene.
    done : ndarray of bool, shape (rows,)
        Which rows of the file to export, from `done_rows`.

    Yields
    ------
    pyarrow.Table
        A row for each done row, in their order.
    """
    names = schema.names[1:]
    row = max(
        column.row_bytes(reader.scene.shape) for column in reader.columns() if column.name in names
    )
    for start, stop in chunks(part.stop, row, part.start):
        for first in range(start, stop, TABLE_ROWS):
            last = min(first + TABLE_ROWS, stop)
            wanted = done[first - reader.rows.start : last - reader.rows.start]
            yield _table(reader, schema, first, last, wanted)


def _table(reader: Reader, schema: pa.Schema, first: int, last: int, done: Mask) -> pa.Table:
    """Read the done rows from a first row to one before a last."""
    arrays = [pa.array(first + np.flatnonzero(done), type=pa.int64())]
    for field in list(schema)[1:]:
        values = reader.column(field.name, first, last)[done]
        if values.ndim == 1:
            arrays.append(pa.array(values, type=field.type))
        else:
            flat = pa.array(np.ascontiguousarray(values).reshape(-1))
            arrays.append(pa.FixedSizeListArray.from_arrays(flat, field.type.list_size))
    return pa.Table.from_arrays(arrays, schema=schema)
