"""Files of the rows of a database: Parquet, each written whole or not at all, in chunks of rows."""

import json
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from gen.database import Reader
from gen.database.reader import CHUNK_BYTES
from gen.runtime.files import atomic, inside, kind_of
from gen.runtime.terminal import RunProgress
from gen.schema import Column, Status

KEPT_BACK = frozenset(("status", "checksum", "rank", "host"))
"""Columns that are not exported: the status, since all exported rows are done, the checksum, which
is that of a row of the database, and the machine that computed a row, which is private.
"""

ROWS = "rows.parquet"  # file of all columns with one value a row
FIELDS = "fields"  # folder of the files of columns with one field a row

# largest number of rows that are in memory at once, and in one row group of a file
TABLE_ROWS = 50_000
# most bytes of a field's file before compression: what an interruption loses
FILE_BYTES = 2**28
KEY = b"asperity"  # key of a file's metadata under which its origin stands


class Piece(NamedTuple):
    """A file of an export."""

    name: str  # in the folder of the export
    schema: pa.Schema  # its columns, the first of which is `sample`
    rows: range  # rows of the database that may be in it


class ExportedColumns(NamedTuple):
    """The columns of a database that are exported."""

    scalars: list[Column]  # those with one value a row
    fields: list[Column]  # those with one field of nx x ny nodes a row


@dataclass(frozen=True, eq=False)
class DoneRows:
    """The rows of a database that are done, and are exported, as they were at one moment."""

    first: int  # first row of the database, in the plan of its scene
    is_done: NDArray[np.bool_]  # whether each row is done, shape (rows of the database,)

    @classmethod
    def of(cls, reader: Reader) -> "DoneRows":
        """Return the done rows of a database to which a run may go on adding.

        Parameters
        ----------
        reader : Reader
            The database.

        Returns
        -------
        DoneRows
            Its rows as they are now.
        """
        return cls(reader.rows.start, np.asarray(reader.column("status") == Status.DONE))

    @property
    def number(self) -> int:
        """Number of rows that are done."""
        return int(self.is_done.sum())

    @property
    def first_done(self) -> int:
        """First row that is done, of which there has to be one."""
        return self.first + int(self.is_done.argmax())

    def within(self, start: int, stop: int) -> NDArray[np.bool_]:
        """Return whether the rows from start to stop - 1 are done.

        Parameters
        ----------
        start, stop : int
            First row, and the row behind the last one, in the plan of the scene.

        Returns
        -------
        ndarray of bool, shape (stop - start,)
            True for the rows that are done.
        """
        return self.is_done[start - self.first : stop - self.first]


def exported_columns(reader: Reader) -> ExportedColumns:
    """Return the columns of a database that are exported.

    Parameters
    ----------
    reader : Reader
        The database.

    Returns
    -------
    ExportedColumns
        Those with one value a row, and those with one field, in the schema's order.
    """
    columns = [column for column in reader.columns() if column.name not in KEPT_BACK]
    return ExportedColumns(
        scalars=[column for column in columns if not column.shape_of],
        fields=[column for column in columns if column.shape_of],
    )


def pieces(reader: Reader) -> list[Piece]:
    """List the files of an export.

    Parameters
    ----------
    reader : Reader
        The database.

    Returns
    -------
    list of Piece
        The table of all rows, and behind it the files of each field, with `FILE_BYTES` at most.
    """
    columns = exported_columns(reader)
    files = [Piece(ROWS, _schema(reader, columns.scalars), reader.rows)]
    for field in columns.fields:
        schema = _schema(reader, [field])
        step = max(1, FILE_BYTES // field.row_bytes(reader.scene.grid.shape))
        for start in reader.rows[::step]:
            rows = range(start, min(start + step, reader.rows.stop))
            name = f"{FIELDS}/{field.name}-{start:010d}.parquet"
            files.append(Piece(name, schema, rows))
    return files


def _schema(reader: Reader, columns: list[Column]) -> pa.Schema:
    """Return Arrow's schema of columns behind `sample`, with their units and meanings."""
    words = {"unit": "1", "long_name": "index of the row in the scene"}
    fields = [pa.field("sample", pa.int64(), nullable=False, metadata=words)]
    fields += [_arrow_field(column, reader.scene.grid.shape) for column in columns]
    return pa.schema(fields)


def _arrow_field(column: Column, nodes: tuple[int, int]) -> pa.Field:
    """Return Arrow's description of a column; a field of nodes is a list with a shape beside it."""
    nx, ny = nodes
    kind = pa.from_numpy_dtype(np.dtype(column.dtype))
    words = {"unit": column.unit, "long_name": column.long_name}
    if column.shape_of:
        kind = pa.list_(kind, nx * ny)
        words["shape"] = json.dumps([nx, ny])
    return pa.field(column.name, kind, nullable=False, metadata=words)


def write_piece(
    piece: Piece, folder: Path, reader: Reader, done: DoneRows, progress: RunProgress
) -> None:
    """Write a file of an export with the rows that are done, unless it is there already.

    Parameters
    ----------
    piece : Piece
        The file.
    folder : Path
        Folder of the export.
    reader : Reader
        The database.
    done : DoneRows
        The rows that are done.
    progress : RunProgress
        Display that the rows of the file are added to.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = inside(folder, piece.name)
    rows = piece.rows
    number = int(done.within(rows.start, rows.stop).sum())
    origin = identity(reader) | {"rows": [rows.start, rows.stop], "done": number}
    if origin_of(path) == origin:
        progress.advance(len(rows))
        return
    schema = piece.schema.with_metadata({KEY: json.dumps(origin)})
    step = _rows_at_once(piece, reader)
    with (
        atomic(path, "parquet") as file,
        parquet.ParquetWriter(file, schema, compression="zstd") as writer,
    ):
        for start in rows[::step]:
            stop = min(start + step, rows.stop)
            table = _table(schema, reader, done, start, stop)
            writer.write_table(table)
            progress.advance(len(table))


def _rows_at_once(piece: Piece, reader: Reader) -> int:
    """Return the number of rows of a file in memory at once: a few megabytes of each column."""
    widest = max(
        column.row_bytes(reader.scene.grid.shape)
        for column in reader.columns()
        if column.name in piece.schema.names[1:]
    )
    return min(TABLE_ROWS, max(1, CHUNK_BYTES // widest))


def _table(
    schema: pa.Schema, reader: Reader, done: DoneRows, start: int, stop: int
) -> pa.Table:
    """Return the rows from start to stop - 1 that are done, with the columns of a schema."""
    is_done = done.within(start, stop)
    arrays = [pa.array(start + np.flatnonzero(is_done), type=pa.int64())]
    for field in list(schema)[1:]:
        values = reader.column(field.name, start, stop)[is_done]
        array = pa.array(np.ascontiguousarray(values).reshape(-1))
        if pa.types.is_fixed_size_list(field.type):
            array = pa.FixedSizeListArray.from_arrays(array, field.type.list_size)
        arrays.append(array)
    return pa.Table.from_arrays(arrays, schema=schema)


def identity(reader: Reader) -> dict[str, object]:
    """Return what tells a database from others.

    Parameters
    ----------
    reader : Reader
        The database.

    Returns
    -------
    dict of str to object
        The hash of its scene, the moment of its creation, and the number of its physics.
    """
    attributes = reader.attributes
    return {name: attributes[name] for name in ("scene_hash", "created", "physics")}


def origin_of(path: Path) -> dict[str, object]:
    """Return the origin that a Parquet file states.

    Parameters
    ----------
    path : Path
        Any file, or none.

    Returns
    -------
    dict of str to object
        The identity of the database, the range of its rows, and the number of those that are done;
        empty if the file is no whole file of an export.
    """
    with suppress(OSError, KeyError, ValueError, pa.ArrowException):
        if path.is_file() and kind_of(path) == "parquet":
            metadata = parquet.read_schema(path).metadata or {}
            return dict(json.loads(metadata[KEY]))
    return {}
